/* Passes for denoisers: features of the first surface that is rough enough, seen directly, in
 * mirrors or through glass.
 *
 * As Cycles of 3.4, or with TRC_PASSES_BLENDED_FEATURES of 5.2, whose roughness and specular
 * albedo are for both. Departures: Cycles loses the paths that pick diffuse lobes (diffuse bounces
 * are 0), and with them a part of what lies behind surfaces that have some and yet pass on their
 * features; what a surface leaves to those behind it has no colour here. */
#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/panorama.h"

#define SPECULAR_PASSES \
    (1ull << TRC_PASS_DENOISING_ROUGHNESS | 1ull << TRC_PASS_DENOISING_SPECULAR_ALBEDO)
#define DENOISING_PASSES                                                     \
    (1ull << TRC_PASS_DENOISING_ALBEDO | 1ull << TRC_PASS_DENOISING_NORMAL | \
     1ull << TRC_PASS_DENOISING_DEPTH | SPECULAR_PASSES)

/* Rougher lobes blur what they show too much for its features to be of use. */
#define FEATURE_ALPHA 0.075f
/* From this alpha on, a lobe's albedo is not specular. */
#define SPECULAR_ALPHA 0.15f
/* Part of all lobes that must be rough, by mix_weight. */
#define ROUGH_SHARE 0.25f
/* Blended: part of the lobes' albedo that is not specular, from which on a surface takes all. */
#define WHOLE_SHARE 0.5f

struct features {
    vvec3 normal, albedo; /* mean of all lobes; sum of the rough ones */
    vmask are_taken;      /* lanes whose lobes are rough enough, or that have none */
};

/* Features by how specular lobes are. */
struct specular_features {
    vvec3 specular_albedo; /* of the lobes that are nearly mirrors */
    vfloat alpha;          /* mean of all lobes but transparent ones, by albedo */
    /* Blended: the mean normal of lobes but transparent ones, times their part of all; albedo that
     * is not specular; how much of both is taken, and how much is left to what those lobes show. */
    vvec3 solid_normal, blended_albedo;
    vfloat taken, left;
};

/* From 0 to 1 smoothly as x goes from 0 to end. */
static vfloat fade(vfloat x, float end) {
    const vfloat t = vf_saturate(x * vf_set(1.0f / end));
    return t * t * (vf_set(3.0f) - t - t);
}

static vmask is_rough(const struct trc_lobe *lobe) {
    if (lobe->kind == TRC_LOBE_TRANSPARENT)
        return vm_none();
    return vf_gt(trc_lobe_alpha(lobe), vf_set(FEATURE_ALPHA));
}

static void features_of(const struct trc_lobes *l, const struct trc_surface *s, uint32_t pass_flags,
                        struct features *out) {
    const vfloat zero = vf_zero();
    vvec3 normal = v3_zero(), albedo = v3_zero();
    vfloat all = zero, rough = zero;
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const vmask counts = is_rough(lobe);
        normal = v3_mad(trc_lobe_feature(lobe, s), lobe->mix_weight, normal);
        all = all + lobe->mix_weight;
        rough = rough + vf_where(counts, lobe->mix_weight);
        if (vm_any(counts))
            albedo = v3_add(albedo, v3_where(counts, trc_lobe_albedo(lobe, s->wo, pass_flags)));
    }
    const vmask some = vf_gt(all, zero);
    out->normal = v3_where(some, v3_scale(normal, vf_rcp(vf_select(some, all, vf_one()))));
    out->albedo = albedo;
    out->are_taken = vm_or(vm_not(some), vf_gt(rough * vf_set(1.0f / ROUGH_SHARE), all));
}

static void specular_features_of(const struct trc_lobes *l, const struct trc_surface *s,
                                 uint32_t pass_flags, struct specular_features *out) {
    const vfloat zero = vf_zero();
    vvec3 specular = v3_zero(), solid = v3_zero(), blended = v3_zero();
    vfloat alpha = zero, scattered = zero, clear = zero, blurred = zero;
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_TRANSPARENT) {
            clear = clear + v3_average(lobe->weight);
            continue;
        }
        const vvec3 color = trc_lobe_albedo(lobe, s->wo, pass_flags);
        const vfloat share = v3_average(color), rough = fade(trc_lobe_alpha(lobe), SPECULAR_ALPHA);
        specular = v3_mad(color, vf_one() - rough, specular);
        blended = v3_mad(color, rough, blended);
        blurred = blurred + share * rough;
        solid = v3_mad(trc_lobe_feature(lobe, s), share, solid);
        alpha = alpha + trc_lobe_alpha(lobe) * share;
        scattered = scattered + share;
    }
    out->specular_albedo = specular;
    out->alpha = vf_divide(alpha, scattered);
    out->solid_normal = v3_scale(solid, vf_divide(vf_one(), scattered + clear));
    out->blended_albedo = blended;
    const vfloat part = vf_divide(blurred, scattered);
    out->taken = fade(part, WHOLE_SHARE);
    out->left = (vf_one() - out->taken) * (vf_one() - part);
}

/* A normal in the space that shaders see as the camera's: x right, y up, z forward; of panoramas
 * along their own axes. */
static vvec3 normal_to_camera(const struct trc_tile *t, vvec3 normal) {
    const float *camera = t->snapshot->camera.world_to_camera[1].m;
    const struct trc_view_axis *axes = trc_view_axes(&t->snapshot->camera);
    vfloat n[3];
    for (int k = 0; k < 3; k++) {
        const float *row = camera + 4 * axes[k].column;
        const vfloat along = v3_dot(normal, v3(vf_set(row[0]), vf_set(row[1]), vf_set(row[2])));
        n[k] = axes[k].sign < 0.0f ? vf_zero() - along : along;
    }
    return v3(n[0], n[1], n[2]);
}

/* Writes the mean normal once, whichever path of the sample comes first. */
static void write_normal(struct trc_tile *t, vvec3 normal, const uint32_t *slots, vmask active) {
    float *const *out = t->samples.pass[TRC_PASS_DENOISING_NORMAL];
    if (!out[0])
        return;
    const vvec3 seen = normal_to_camera(t, normal);
    float n[3][TRC_WIDTH];
    vf_store(n[0], seen.x);
    vf_store(n[1], seen.y);
    vf_store(n[2], seen.z);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const uint32_t slot = slots[i];
        if (out[0][slot] != 0.0f || out[1][slot] != 0.0f || out[2][slot] != 0.0f)
            continue;
        for (int k = 0; k < 3; k++)
            out[k][slot] = n[k][i];
    }
}

static void add_number(struct trc_tile *t, uint32_t pass, vfloat value, const uint32_t *slots,
                       vmask active) {
    trc_pass_add_lanes(t, pass, v3(value, vf_zero(), vf_zero()), slots, active);
}

/* The path word of what leaves that part of the passes, in 255ths. */
static vuint with_features_left(vuint path, vfloat left) {
    const vint taken = vf_to_int((vf_one() - left) * vf_set(255.0f) + vf_set(0.5f));
    return (path & vu_set(~TRC_PATH_FEATURES)) | (vuint)taken << TRC_PATH_FEATURES_SHIFT;
}

vuint trc_denoising_passes(struct trc_tile *t, const struct trc_surface *s,
                           const struct trc_lobes *lobes, vvec3 weight, vfloat length,
                           const uint32_t slots[TRC_WIDTH]) {
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    const uint32_t flags = t->desc->pass_flags;
    const bool is_blended = flags & TRC_PASSES_BLENDED_FEATURES;
    const vmask seen = vm_and(s->active, vi_eq((vint)s->path & straight, straight));
    vfloat left = trc_features_left(s->path);
    if (is_blended) /* what is behind transparency counts besides what is before it */
        left = vf_select(seen, vf_one(), left);
    const vmask on = vm_and(s->active, vf_gt(left, vf_zero()));
    if (!(t->desc->passes & DENOISING_PASSES) || !vm_any(vm_or(on, seen)))
        return s->path;
    const vvec3 open_weight = v3_scale(weight, left);
    add_number(t, TRC_PASS_DENOISING_DEPTH, v3_average(open_weight) * length, slots, on);
    struct specular_features specular;
    if (is_blended || t->desc->passes & SPECULAR_PASSES) {
        specular_features_of(lobes, s, flags, &specular);
        add_number(t, TRC_PASS_DENOISING_ROUGHNESS, v3_average(weight) * vf_sqrt(specular.alpha),
                   slots, seen);
        trc_pass_add_lanes(t, TRC_PASS_DENOISING_SPECULAR_ALBEDO,
                           v3_mul(weight, specular.specular_albedo), slots, seen);
    }
    if (is_blended) {
        const vvec3 taken_weight = v3_scale(open_weight, specular.taken);
        trc_pass_add_lanes(t, TRC_PASS_DENOISING_ALBEDO,
                           v3_mul(taken_weight, specular.blended_albedo), slots, on);
        const vvec3 normal = normal_to_camera(t, specular.solid_normal);
        trc_pass_add_lanes(t, TRC_PASS_DENOISING_NORMAL, v3_scale(normal, v3_average(taken_weight)),
                           slots, on);
        left = left * specular.left;
    } else {
        struct features f;
        features_of(lobes, s, flags, &f);
        const vmask taken = vm_and(on, f.are_taken);
        trc_pass_add_lanes(t, TRC_PASS_DENOISING_ALBEDO, v3_mul(weight, f.albedo), slots, taken);
        write_normal(t, f.normal, slots, taken);
        left = vf_select(taken, vf_zero(), left);
    }
    return (vuint)vi_select(on, (vint)with_features_left(s->path, left), (vint)s->path);
}
