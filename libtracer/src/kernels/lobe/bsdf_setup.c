/* From the leaves of a material to lobes, as Cycles 3.4 sets up its closures.
 *
 * Departures: subsurface scattering is Principled's diffuse lobe with the mixed colour;
 * multiple-scattering GGX is an analytic lobe instead of a random walk (ggx_energy.h). */
#include "kernels/lobe/bsdf.h"

#include "kernels/lobe/ggx_energy.h"
#include "kernels/lobe/microfacet.h"
#include "model/nodes.h"

/* Indices that close to 1 do not refract. */
#define NO_REFRACTION 1e-4f
/* First hit: a lobe gets at least this share of the samples (Cycles 3.4's defensive sampling). */
#define DEFENSIVE_SHARE 0.125f

struct setup {
    const struct trc_material *material;
    const struct trc_surface *s;
    const struct trc_registers *regs;
    vfloat filter_alpha;
    vvec3 default_n; /* s->n made valid; set once asked for */
    bool has_default_n;
    struct trc_lobes *out;
};

/* Inputs of a leaf are numbered in floats from its first operand. */
TRC_INLINE const struct trc_operand *input(const struct setup *c, const struct trc_leaf *leaf,
                                           uint32_t at) {
    return c->material->operands + leaf->first_operand + at;
}
TRC_INLINE vfloat number(const struct setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return trc_operand_value(input(c, leaf, at), c->regs);
}
TRC_INLINE vvec3 colour(const struct setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return trc_operand_vec3(input(c, leaf, at), c->regs);
}
TRC_INLINE bool is_unlinked(const struct setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return input(c, leaf, at)->reg == TRC_REG_DEFAULT;
}

/* ---- normals and tangents ---- */

/* Of two candidates for the squared z of the bent normal, the one whose mirror direction is valid;
 * see below. Returns x and z in the plane of ng and n. */
static void choose_bend(vfloat first2, vfloat second2, vfloat ix, vfloat iz, vfloat *x, vfloat *z,
                        vmask *any) {
    const vfloat least = vf_set(1e-5f), most = vf_set(1.0f + 1e-5f);
    const vmask fits1 = vm_and(vf_gt(first2, least), vf_le(first2, most));
    const vmask fits2 = vm_and(vf_gt(second2, least), vf_le(second2, most));
    const vfloat x1 = vf_safe_sqrt(vf_one() - first2), z1 = vf_safe_sqrt(first2);
    const vfloat x2 = vf_safe_sqrt(vf_one() - second2), z2 = vf_safe_sqrt(second2);
    const vfloat r1 = vf_set(2.0f) * (x1 * ix + z1 * iz) * z1 - iz;
    const vfloat r2 = vf_set(2.0f) * (x2 * ix + z2 * iz) * z2 - iz;
    const vmask up1 = vf_ge(r1, least), up2 = vf_ge(r2, least);
    /* Both fit: the shallower of two valid mirrors, else the higher. */
    const vmask first_of_both =
        vm_or(vm_and(vm_and(up1, up2), vf_lt(r1, r2)), vm_andnot(vf_gt(r1, r2), vm_and(up1, up2)));
    const vmask use1 = vm_and(fits1, vm_or(vm_not(fits2), first_of_both));
    *x = vf_select(use1, x1, x2);
    *z = vf_select(use1, z1, z2);
    *any = vm_or(fits1, fits2);
}

/* Turns n towards the geometric normal as little as makes the mirror direction of wo rise above the
 * surface by a threshold t. With z = ng and x = the part of n across it, the turned normal (x, 0,
 * z) satisfies 2 (x ix + z iz) z - iz = t, a quadratic in z^2 because x^2 = 1 - z^2. */
static vvec3 valid_normal(const struct trc_surface *s, vvec3 n) {
    const vfloat iz = v3_dot(s->ng, s->wo);
    const vfloat t = vf_min(vf_set(0.9f) * iz, vf_set(0.01f));
    const vmask bad = vm_and(s->active, vf_lt(v3_dot(s->ng, v3_reflect(s->wo, n)), t));
    if (!vm_any(bad))
        return n;
    const vvec3 across = v3_normalize(v3_sub(n, v3_scale(s->ng, v3_dot(n, s->ng))));
    const vfloat ix = v3_dot(s->wo, across), ix2 = ix * ix;
    const vfloat a = ix2 + iz * iz;
    const vfloat b = vf_safe_sqrt(ix2 * (a - t * t));
    const vfloat c = iz * t + a;
    const vfloat half = vf_divide(vf_set(0.5f), a);
    vfloat x, z;
    vmask found;
    choose_bend(half * (c + b), half * (c - b), ix, iz, &x, &z, &found);
    const vvec3 turned = v3_mad(across, x, v3_scale(s->ng, z));
    return v3_select(bad, v3_select(found, turned, s->ng), n);
}

static vvec3 leaf_normal(struct setup *c, const struct trc_leaf *leaf, uint32_t at) {
    if (!is_unlinked(c, leaf, at))
        return valid_normal(c->s, colour(c, leaf, at));
    if (!c->has_default_n) {
        c->default_n = valid_normal(c->s, c->s->n);
        c->has_default_n = true;
    }
    return c->default_n;
}

/* The tangent of an anisotropic leaf, turned about n by rotation (in turns), then orthogonal to n.
 */
static vvec3 leaf_tangent(const struct setup *c, const struct trc_leaf *leaf, uint32_t at, vvec3 n,
                          vfloat rotation) {
    const vvec3 t = colour(c, leaf, at);
    vfloat sine, cosine;
    vf_sincos_turns(rotation, &sine, &cosine);
    const vvec3 along = v3_scale(n, v3_dot(n, t) * (vf_one() - cosine));
    const vvec3 turned = v3_mad(v3_cross(n, t), sine, v3_mad(t, cosine, along));
    const vvec3 bitangent = v3_normalize(v3_cross(n, turned));
    vvec3 a, b;
    v3_frame(n, &a, &b);
    const vmask fine = vf_gt(v3_dot(bitangent, bitangent), vf_zero());
    return v3_select(fine, v3_cross(bitangent, n), a);
}

/* ---- adding lobes ---- */

/* A lobe of weight in the lanes where it matters, or NULL where it matters in none. */
static struct trc_lobe *add_lobe(struct setup *c, enum trc_lobe_kind kind, vvec3 weight) {
    struct trc_lobes *out = c->out;
    const vvec3 w =
        v3(vf_max(weight.x, vf_zero()), vf_max(weight.y, vf_zero()), vf_max(weight.z, vf_zero()));
    const vfloat mean = v3_average(w);
    /* False for NaN too. */
    const vmask counts = vm_and(c->s->active, vf_ge(mean, vf_set(TRC_WEIGHT_CUTOFF)));
    if (!vm_any(counts) || out->count == TRC_MAX_LOBES)
        return NULL;
    struct trc_lobe *lobe = &out->lobe[out->count++];
    lobe->kind = kind;
    lobe->distribution = 0;
    lobe->fresnel = TRC_FRESNEL_NONE;
    lobe->correlated = false;
    lobe->albedo_scale = vf_one();
    lobe->anisotropic = false;
    lobe->ideal = lobe->paired = vm_none();
    lobe->weight = v3_where(counts, w);
    lobe->mix_weight = vf_where(counts, mean);
    lobe->sample_weight = vf_zero();
    return lobe;
}

static struct trc_lobe *add_diffuse(struct setup *c, enum trc_lobe_kind kind, uint32_t model,
                                    vvec3 weight, vvec3 n, vfloat roughness) {
    struct trc_lobe *lobe = add_lobe(c, kind, weight);
    if (!lobe)
        return NULL;
    lobe->distribution = model;
    lobe->n = n;
    lobe->roughness = roughness;
    lobe->cos_o = v3_dot(n, c->s->wo);
    if (kind == TRC_LOBE_SHEEN && model == TRC_SHEEN_SCHLICK) {
        const vfloat mean = trc_schlick_weight(lobe->cos_o) * lobe->cos_o;
        lobe->mix_weight = lobe->mix_weight * vf_max(mean, vf_zero());
    }
    return lobe;
}

/* Rough diffuse that keeps its energy; albedo: the colour of what scatters more than once. */
static void add_energy_oren_nayar(struct setup *c, vvec3 weight, vvec3 albedo, vvec3 n,
                                  vfloat sigma) {
    struct trc_lobe *lobe =
        add_diffuse(c, TRC_LOBE_DIFFUSE, TRC_DIFFUSE_ENERGY_OREN_NAYAR, weight, n, sigma);
    if (!lobe)
        return;
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    const vfloat mean = a * (vf_set(TRC_PI) + vf_set((2.0f * TRC_PI - 5.6f) / 3.0f) * sigma);
    const vfloat lost = vf_one() - mean;
    const vfloat scale = vf_divide(vf_set(TRC_INV_PI) * mean, lost) *
                         (vf_one() - trc_oren_nayar_albedo(sigma, lobe->cos_o));
    /* The weight has the colour once; Cycles gives the later bounces two more. */
    const vvec3 color = v3_saturate(albedo);
    lobe->f0 = v3(color.x * color.x * scale / (vf_one() - color.x * lost),
                  color.y * color.y * scale / (vf_one() - color.y * lost),
                  color.z * color.z * scale / (vf_one() - color.z * lost));
}

static void add_transparent(struct setup *c, vvec3 weight) {
    for (int i = 0; i < c->out->count; i++) {
        struct trc_lobe *lobe = &c->out->lobe[i];
        if (lobe->kind != TRC_LOBE_TRANSPARENT)
            continue;
        const vfloat mean = vf_abs(v3_average(weight));
        const vmask counts = vm_and(c->s->active, vf_ge(mean, vf_set(TRC_WEIGHT_CUTOFF)));
        lobe->weight = v3_add(lobe->weight, v3_where(counts, weight));
        lobe->mix_weight = lobe->mix_weight + vf_where(counts, mean);
        return;
    }
    struct trc_lobe *lobe = add_lobe(c, TRC_LOBE_TRANSPARENT, weight);
    if (!lobe)
        return;
    lobe->n = c->s->n;
    lobe->cos_o = v3_dot(lobe->n, c->s->wo);
    lobe->ideal = vm_all_set();
}

/* What both kinds of microfacet lobe need once alpha, ior and tangent are set. */
static void finish_microfacets(const struct setup *c, struct trc_lobe *lobe, bool is_sharp) {
    const vfloat least =
        vf_set(lobe->distribution == TRC_LOBE_ASHIKHMIN || lobe->distribution == TRC_LOBE_MULTI_GGX
                   ? 1e-4f
                   : 0.0f);
    if (is_sharp) {
        lobe->alpha_x = lobe->alpha_y = vf_zero();
    } else {
        lobe->alpha_x = vf_max(vf_min(vf_max(lobe->alpha_x, least), vf_one()), c->filter_alpha);
        lobe->alpha_y = vf_max(vf_min(vf_max(lobe->alpha_y, least), vf_one()), c->filter_alpha);
    }
    const vfloat ax = lobe->alpha_x, ay = lobe->alpha_y;
    lobe->ideal = lobe->distribution == TRC_LOBE_ASHIKHMIN
                      ? vf_le(vf_max(ax, ay), vf_set(1e-4f))
                      : vf_le(ax * ay, vf_set(TRC_SINGULAR_ALPHA2));
    if (lobe->kind == TRC_LOBE_REFRACT)
        lobe->ideal =
            vm_or(lobe->ideal, vf_lt(vf_abs(lobe->ior - vf_one()), vf_set(NO_REFRACTION)));
    const vfloat cos_o = vf_max(v3_dot(lobe->n, c->s->wo), vf_set(1e-6f));
    /* Densities and values have to agree about it. */
    lobe->cos_o =
        vf_select(vf_gt(v3_dot(lobe->n, c->s->wo), vf_zero()), cos_o, v3_dot(lobe->n, c->s->wo));
    vfloat tan2 = ax * ax * (vf_one() - cos_o * cos_o) / (cos_o * cos_o);
    if (lobe->anisotropic) {
        const vfloat x = v3_dot(lobe->tangent, c->s->wo) * ax;
        const vfloat y = v3_dot(v3_cross(lobe->n, lobe->tangent), c->s->wo) * ay;
        tan2 = (x * x + y * y) / (cos_o * cos_o);
    }
    tan2 = vf_max(tan2, vf_zero());
    if (lobe->distribution == TRC_LOBE_BECKMANN) {
        lobe->g1_o = trc_beckmann_g1(tan2);
        lobe->pdf_scale = trc_beckmann_g1_exact(tan2) * vf_set(0.25f) / cos_o;
        return;
    }
    lobe->g1_o = trc_ggx_g1(tan2);
    const vfloat whole = vf_set(2.0f) / lobe->g1_o;
    const vfloat bound = lobe->kind == TRC_LOBE_REFLECT ? trc_ggx_bound(cos_o, ax, ay) : vf_one();
    lobe->pdf_scale = vf_set(0.5f) / (cos_o * (bound + whole - vf_one()));
}

/* Mean over the cosine-weighted hemisphere of how far a dielectric is from its F0, after the fit of
 * Kulla and Conty (2017) to the mean of F. */
static vfloat mean_blend(vfloat ior) {
    const vfloat eta = vf_max(ior, vf_rcp(ior));
    const vfloat f0 = trc_fresnel_normal(eta);
    const vfloat mean = (eta - vf_one()) / (vf_set(4.08567f) + vf_set(1.00071f) * eta);
    return vf_saturate((mean - f0) / (vf_one() - f0));
}

/* The lobe of the light that scatters more than once; per_bounce: colour of every bounce, the first
 * included where is_first (the Fresnel factor), else the first is in the weight already. Of an
 * anisotropic surface it has all that is missing, in the shape of the isotropic one of the same
 * alpha_x alpha_y. */
static void set_multiple(struct trc_lobe *lobe, vvec3 wo, vvec3 per_bounce, bool is_first) {
    const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y);
    const vfloat kept = trc_ggx_mean_albedo(alpha), lost = vf_one() - kept;
    vfloat missing = vf_one() - trc_ggx_albedo(lobe->cos_o, alpha);
    if (lobe->anisotropic) {
        const vvec3 bitangent = v3_cross(lobe->n, lobe->tangent);
        const vvec3 local = v3_to_frame(wo, lobe->tangent, bitangent, lobe->n);
        missing = vf_one() - trc_ggx_anisotropic_albedo(local, lobe->alpha_x, lobe->alpha_y);
    }
    const vfloat scale = vf_select(vf_gt(lost, vf_set(1e-6f)),
                                   missing * vf_set(TRC_INV_PI) * kept / lost, vf_zero());
    vvec3 f = v3(per_bounce.x / (vf_one() - per_bounce.x * lost),
                 per_bounce.y / (vf_one() - per_bounce.y * lost),
                 per_bounce.z / (vf_one() - per_bounce.z * lost));
    if (is_first)
        f = v3_mul(f, per_bounce);
    lobe->multi_weight = v3_scale(f, scale);
    lobe->multi_chance = missing;
}

/* The same in Cycles 4: E. Turquin, "Practical Multiple Scattering Compensation for Microfacet
 * Models" (2019). The lobe of single scattering is scaled so that a white one keeps all energy; the
 * rest of the bounces have per_bounce as their colour. From then on it is an ordinary GGX lobe. */
static void keep_energy(struct trc_lobe *lobe, vvec3 per_bounce) {
    const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y), one = vf_one();
    const vfloat mean = trc_ggx_mean_albedo(alpha), lost = one - mean;
    const vfloat single = vf_max(trc_ggx_albedo(lobe->cos_o, alpha), vf_set(1e-3f));
    const vfloat missing = (one - single) / single;
    const vvec3 again = v3(per_bounce.x * mean / (one - per_bounce.x * lost),
                           per_bounce.y * mean / (one - per_bounce.y * lost),
                           per_bounce.z * mean / (one - per_bounce.z * lost));
    const vvec3 gain = v3_mad(again, missing, v3_splat(one));
    lobe->distribution = TRC_LOBE_GGX;
    lobe->weight = v3_mul(lobe->weight, gain);
    lobe->albedo_scale = single;
    lobe->mix_weight = lobe->mix_weight * v3_average(gain) * single;
}

/* ---- leaves ---- */

static uint32_t distribution_of(uint32_t mode) {
    switch (mode & ~(uint32_t)TRC_DISTRIBUTION_CORRELATED) {
    case TRC_DISTRIBUTION_BECKMANN:
        return TRC_LOBE_BECKMANN;
    case TRC_DISTRIBUTION_ASHIKHMIN:
        return TRC_LOBE_ASHIKHMIN;
    case TRC_DISTRIBUTION_MULTI_GGX:
        return TRC_LOBE_MULTI_GGX;
    default:
        return TRC_LOBE_GGX;
    }
}

static bool is_sharp(uint32_t mode) {
    return (mode & ~(uint32_t)TRC_DISTRIBUTION_CORRELATED) == TRC_DISTRIBUTION_SHARP;
}

static void add_glossy(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 base = colour(c, leaf, TRC_AT(GLOSSY, color));
    struct trc_lobe *lobe = add_lobe(c, TRC_LOBE_REFLECT, v3_scale(base, weight));
    if (!lobe)
        return;
    lobe->distribution = distribution_of(leaf->mode);
    lobe->correlated = leaf->mode & TRC_DISTRIBUTION_CORRELATED;
    lobe->n = leaf_normal(c, leaf, TRC_AT(GLOSSY, normal));
    lobe->ior = vf_one();
    const vfloat alpha = vf_square(number(c, leaf, TRC_AT(GLOSSY, roughness)));
    const struct trc_operand *twist = input(c, leaf, TRC_AT(GLOSSY, anisotropy));
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->anisotropic = twist->reg >= 0 || twist->value != 0.0f;
    if (lobe->anisotropic) {
        const vfloat anisotropy = vf_clamp(trc_operand_value(twist, c->regs), -0.99f, 0.99f);
        const vmask negative = vf_lt(anisotropy, vf_zero());
        const vfloat less = vf_one() - vf_abs(anisotropy);
        lobe->alpha_x = vf_select(negative, alpha / less, alpha * less);
        lobe->alpha_y = vf_select(negative, alpha * less, alpha / less);
        lobe->tangent = leaf_tangent(c, leaf, TRC_AT(GLOSSY, tangent), lobe->n,
                                     number(c, leaf, TRC_AT(GLOSSY, rotation)));
    }
    finish_microfacets(c, lobe, is_sharp(leaf->mode));
    if (lobe->distribution == TRC_LOBE_MULTI_GGX && lobe->correlated)
        keep_energy(lobe, v3_saturate(base));
    else if (lobe->distribution == TRC_LOBE_MULTI_GGX)
        set_multiple(lobe, c->s->wo, v3_saturate(base), false);
}

/* As Cycles, which limits the cone to the hemisphere. */
static void add_toon(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const bool is_glossy = leaf->mode == TRC_TOON_GLOSSY;
    struct trc_lobe *lobe = add_lobe(c, is_glossy ? TRC_LOBE_REFLECT : TRC_LOBE_DIFFUSE,
                                     v3_scale(colour(c, leaf, TRC_AT(TOON, color)), weight));
    if (!lobe)
        return;
    const vfloat quarter = vf_set(TRC_HALF_PI);
    const vfloat angle = vf_saturate(number(c, leaf, TRC_AT(TOON, size))) * quarter;
    const vfloat fade = vf_saturate(number(c, leaf, TRC_AT(TOON, smooth))) * quarter;
    const vfloat whole = vf_min(angle + fade, quarter);
    lobe->distribution = is_glossy ? (uint32_t)TRC_LOBE_TOON : (uint32_t)TRC_DIFFUSE_TOON;
    lobe->n = leaf_normal(c, leaf, TRC_AT(TOON, normal));
    lobe->cos_o = v3_dot(lobe->n, c->s->wo);
    lobe->ior = vf_one();
    lobe->f0 = v3(angle, fade, vf_cos(whole));
    /* How wide it spreads, for Filter Glossy. */
    lobe->alpha_x = lobe->alpha_y = whole / quarter;
    const vmask is_nothing = vf_le(whole, vf_zero());
    lobe->weight = v3_where(vm_not(is_nothing), lobe->weight);
    lobe->mix_weight = vf_where(vm_not(is_nothing), lobe->mix_weight);
}

static void add_velvet(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vfloat sigma = vf_max(number(c, leaf, TRC_AT(VELVET, sigma)), vf_set(0.01f));
    add_diffuse(c, TRC_LOBE_DIFFUSE, TRC_DIFFUSE_VELVET,
                v3_scale(colour(c, leaf, TRC_AT(VELVET, color)), weight),
                leaf_normal(c, leaf, TRC_AT(VELVET, normal)), vf_rcp(sigma * sigma));
}

/* Index seen from the side of wo. */
static vfloat relative_ior(const struct setup *c, vfloat ior) {
    const vfloat eta = vf_max(ior, vf_set(1e-5f));
    return vf_select(c->s->backfacing, vf_rcp(eta), eta);
}

#include "kernels/lobe/glass_lobes.h"

/* ---- Principled ---- */

/* Whether an input can differ from 0. */
static bool may_exceed_zero(const struct setup *c, const struct trc_leaf *leaf, uint32_t at) {
    const struct trc_operand *o = input(c, leaf, at);
    return o->reg >= 0 || o->value > 0.0f;
}

/* Turns a lobe into one that goes from f0 at normal incidence to f90, and accounts for it in the
 * chance. */
static void set_blend(const struct setup *c, struct trc_lobe *lobe, vvec3 f0, vvec3 f90) {
    lobe->fresnel = TRC_FRESNEL_BLEND;
    lobe->f0 = f0;
    lobe->f90 = f90;
    const vfloat blend = trc_fresnel_blend(v3_dot(lobe->n, c->s->wo), lobe->ior);
    lobe->mix_weight = lobe->mix_weight * v3_average(v3_lerp(f0, f90, blend));
}

static vvec3 mix_white(vvec3 tint, vfloat amount) {
    return v3_lerp(v3_splat(vf_one()), tint, amount);
}

/* Colour without its brightness; white for black. */
static vvec3 hue_of(vvec3 base, vfloat brightness) {
    const vmask lit = vf_gt(brightness, vf_zero());
    const vfloat inverse = vf_divide(vf_one(), brightness);
    return v3_select(lit, v3_scale(base, inverse), v3_splat(vf_one()));
}

static void principled_diffuse(struct setup *c, const struct trc_leaf *leaf, vfloat weight, vvec3 n,
                               vfloat diffuse_weight) {
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    vvec3 tint = base;
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, subsurface)))
        tint = v3_lerp(base, colour(c, leaf, TRC_AT(PRINCIPLED, subsurface_color)),
                       number(c, leaf, TRC_AT(PRINCIPLED, subsurface)));
    const vmask kept = vf_gt(diffuse_weight, vf_set(TRC_WEIGHT_CUTOFF));
    const vfloat w = vf_where(kept, weight * diffuse_weight);
    add_diffuse(c, TRC_LOBE_DIFFUSE, TRC_DIFFUSE_PRINCIPLED, v3_scale(tint, w), n,
                number(c, leaf, TRC_AT(PRINCIPLED, roughness)));
    if (!may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, sheen)))
        return;
    const vvec3 hue = hue_of(base, v3_luminance(base));
    const vvec3 sheen = mix_white(hue, number(c, leaf, TRC_AT(PRINCIPLED, sheen_tint)));
    add_diffuse(c, TRC_LOBE_SHEEN, TRC_SHEEN_SCHLICK,
                v3_scale(sheen, w * number(c, leaf, TRC_AT(PRINCIPLED, sheen))), n, vf_zero());
}

static void principled_specular(struct setup *c, const struct trc_leaf *leaf, vfloat weight,
                                vvec3 n, vfloat metallic, vfloat specular_weight) {
    const vfloat specular = number(c, leaf, TRC_AT(PRINCIPLED, specular));
    const vfloat cutoff = vf_set(TRC_WEIGHT_CUTOFF);
    const vmask kept = vm_and(vf_gt(specular_weight, cutoff),
                              vm_or(vf_gt(specular, cutoff), vf_gt(metallic, cutoff)));
    struct trc_lobe *lobe =
        add_lobe(c, TRC_LOBE_REFLECT, v3_splat(vf_where(kept, weight * specular_weight)));
    if (!lobe)
        return;
    const vfloat roughness = number(c, leaf, TRC_AT(PRINCIPLED, roughness)),
                 alpha = roughness * roughness;
    lobe->n = n;
    lobe->ior = vf_set(2.0f) / (vf_one() - vf_safe_sqrt(vf_set(0.08f) * specular)) - vf_one();
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->anisotropic = may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, anisotropic));
    if (lobe->anisotropic) {
        const vfloat aspect = vf_safe_sqrt(
            vf_one() - vf_set(0.9f) * number(c, leaf, TRC_AT(PRINCIPLED, anisotropic)));
        lobe->alpha_x = alpha / aspect;
        lobe->alpha_y = alpha * aspect;
        lobe->tangent = leaf_tangent(c, leaf, TRC_AT(PRINCIPLED, tangent), n,
                                     number(c, leaf, TRC_AT(PRINCIPLED, anisotropic_rotation)));
    }
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    vvec3 dielectric = v3_splat(vf_set(0.08f) * specular);
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, specular_tint))) {
        const vfloat bright = vf_set(0.3f) * base.x + vf_set(0.6f) * base.y + vf_set(0.1f) * base.z;
        const vvec3 tint =
            mix_white(hue_of(base, bright), number(c, leaf, TRC_AT(PRINCIPLED, specular_tint)));
        dielectric = v3_mul(tint, dielectric);
    }
    const vvec3 f0 = v3_saturate(v3_lerp(dielectric, base, metallic));
    /* Cycles keeps single scattering at low roughness; where lanes disagree the missing energy is
     * nil. */
    const bool multiple = leaf->mode == TRC_DISTRIBUTION_MULTI_GGX &&
                          vm_any(vm_and(c->s->active, vf_gt(roughness, vf_set(0.075f))));
    lobe->distribution = multiple ? TRC_LOBE_MULTI_GGX : TRC_LOBE_GGX;
    finish_microfacets(c, lobe, false);
    set_blend(c, lobe, f0, v3_splat(vf_one()));
    if (multiple)
        set_multiple(lobe, c->s->wo, v3_lerp(f0, v3_splat(vf_one()), mean_blend(lobe->ior)), true);
}

static void principled_glass(struct setup *c, const struct trc_leaf *leaf, vvec3 glass, vvec3 n) {
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    const vfloat roughness = number(c, leaf, TRC_AT(PRINCIPLED, roughness)),
                 alpha = roughness * roughness;
    const vfloat eta = relative_ior(c, number(c, leaf, TRC_AT(PRINCIPLED, ior)));
    const vvec3 f0 =
        v3_saturate(mix_white(base, number(c, leaf, TRC_AT(PRINCIPLED, specular_tint))));
    if (leaf->mode == TRC_DISTRIBUTION_MULTI_GGX &&
        vm_any(vm_and(c->s->active, vf_gt(roughness, vf_set(5e-2f))))) {
        const vfloat blend = trc_fresnel_blend(v3_dot(n, c->s->wo), eta);
        add_multi_glass(c, glass, v3_lerp(f0, v3_splat(vf_one()), vf_saturate(blend)),
                        v3_saturate(base), n, alpha, eta);
        return;
    }
    const vfloat f = reflected_part(trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta));
    struct trc_lobe *lobe = add_dielectric(c, TRC_LOBE_REFLECT, v3_scale(glass, f), n, alpha, eta,
                                           TRC_DISTRIBUTION_GGX);
    if (lobe)
        set_blend(c, lobe, f0, v3_splat(vf_one()));
    vfloat through = roughness;
    if (leaf->mode != TRC_DISTRIBUTION_MULTI_GGX)
        through =
            vf_one() - (vf_one() - roughness) *
                           (vf_one() - number(c, leaf, TRC_AT(PRINCIPLED, transmission_roughness)));
    const vvec3 weight = v3_scale(v3_mul(base, glass), vf_one() - f);
    add_dielectric(c, TRC_LOBE_REFRACT, weight, n, through * through, eta, TRC_DISTRIBUTION_GGX);
}

static void principled_clearcoat(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vfloat coat = number(c, leaf, TRC_AT(PRINCIPLED, clearcoat));
    const vmask kept = vf_gt(coat, vf_set(TRC_WEIGHT_CUTOFF));
    struct trc_lobe *lobe = add_lobe(c, TRC_LOBE_REFLECT, v3_splat(vf_where(kept, weight)));
    if (!lobe)
        return;
    lobe->distribution = TRC_LOBE_GTR1;
    lobe->n = leaf_normal(c, leaf, TRC_AT(PRINCIPLED, clearcoat_normal));
    lobe->ior = vf_set(1.5f);
    lobe->alpha_x = lobe->alpha_y =
        vf_square(number(c, leaf, TRC_AT(PRINCIPLED, clearcoat_roughness)));
    finish_microfacets(c, lobe, false);
    const vfloat quarter = vf_set(0.25f) * coat;
    set_blend(c, lobe, v3_splat(vf_set(0.04f) * quarter), v3_splat(quarter));
}

static void add_principled(struct setup *c, const struct trc_leaf *leaf, vfloat whole) {
    vfloat weight = whole;
    const struct trc_operand *alpha = input(c, leaf, TRC_AT(PRINCIPLED, alpha));
    if (alpha->reg >= 0 || alpha->value < 1.0f) {
        const vfloat opacity = vf_saturate(trc_operand_value(alpha, c->regs));
        weight = whole * opacity;
        add_transparent(c, v3_splat(whole - weight));
    }
    const vvec3 n = leaf_normal(c, leaf, TRC_AT(PRINCIPLED, normal));
    const vfloat metallic = vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, metallic)));
    const vfloat transmission =
        vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, transmission))) * (vf_one() - metallic);
    const vfloat diffuse_weight =
        (vf_one() - metallic) *
        (vf_one() - vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, transmission))));
    principled_diffuse(c, leaf, weight, n, diffuse_weight);
    principled_specular(c, leaf, weight, n, number(c, leaf, TRC_AT(PRINCIPLED, metallic)),
                        vf_one() - transmission);
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, transmission))) {
        const vmask kept = vf_gt(transmission, vf_set(TRC_WEIGHT_CUTOFF));
        principled_glass(c, leaf, v3_splat(vf_where(kept, weight * transmission)), n);
    }
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, clearcoat)))
        principled_clearcoat(c, leaf, weight);
}

#include "kernels/lobe/layered_principled.h"

/* ---- interface ---- */

_Static_assert(TRC_AT(EMISSION, color) == TRC_AT(BACKGROUND, color) &&
                   TRC_AT(EMISSION, strength) == TRC_AT(BACKGROUND, strength),
               "a background is an emission");

/* Emission of one leaf, false for a leaf that cannot emit. Without a surface the layers above the
 * emission of a layered Principled are left out, as Cycles does when it samples lights. */
static bool leaf_emission(const struct setup *c, const struct trc_leaf *leaf, vfloat weight,
                          vvec3 *emission) {
    if (leaf->type == TRC_NODE_EMISSION || leaf->type == TRC_NODE_BACKGROUND) {
        *emission = v3_scale(colour(c, leaf, TRC_AT(EMISSION, color)),
                             number(c, leaf, TRC_AT(EMISSION, strength)) * weight);
        return true;
    }
    if (leaf->type == TRC_NODE_LAYERED_PRINCIPLED)
        return layered_emission(c, leaf, weight, emission);
    if (leaf->type != TRC_NODE_PRINCIPLED)
        return false;
    const struct trc_operand *strength = input(c, leaf, TRC_AT(PRINCIPLED, emission_strength));
    if (strength->reg < 0 && strength->value == 0.0f)
        return false;
    const vfloat opacity = vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, alpha)));
    *emission = v3_scale(colour(c, leaf, TRC_AT(PRINCIPLED, emission)),
                         trc_operand_value(strength, c->regs) * weight * opacity);
    return true;
}

static void add_leaf(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    switch (leaf->type) {
    case TRC_NODE_DIFFUSE: {
        const struct trc_operand *roughness = input(c, leaf, TRC_AT(DIFFUSE, roughness));
        const bool is_lambert = roughness->reg < 0 && roughness->value == 0.0f;
        const vvec3 base = colour(c, leaf, TRC_AT(DIFFUSE, color)), tint = v3_scale(base, weight);
        const vvec3 n = leaf_normal(c, leaf, TRC_AT(DIFFUSE, normal));
        const vfloat sigma = vf_saturate(trc_operand_value(roughness, c->regs));
        if (leaf->mode == TRC_DIFFUSE_KEEPS_ENERGY && !is_lambert)
            add_energy_oren_nayar(c, tint, base, n, sigma);
        else
            add_diffuse(c, TRC_LOBE_DIFFUSE,
                        is_lambert ? TRC_DIFFUSE_LAMBERT : TRC_DIFFUSE_OREN_NAYAR, tint, n, sigma);
        break;
    }
    case TRC_NODE_TRANSLUCENT:
        add_diffuse(c, TRC_LOBE_TRANSLUCENT, 0,
                    v3_scale(colour(c, leaf, TRC_AT(TRANSLUCENT, color)), weight),
                    leaf_normal(c, leaf, TRC_AT(TRANSLUCENT, normal)), vf_zero());
        break;
    case TRC_NODE_VELVET:
        add_velvet(c, leaf, weight);
        break;
    case TRC_NODE_TOON:
        add_toon(c, leaf, weight);
        break;
    case TRC_NODE_GLOSSY:
        add_glossy(c, leaf, weight);
        break;
    case TRC_NODE_GLASS:
        add_glass(c, leaf, weight);
        break;
    case TRC_NODE_REFRACTION:
        add_refraction(c, leaf, weight);
        break;
    case TRC_NODE_TRANSPARENT:
        add_transparent(c, v3_scale(colour(c, leaf, TRC_AT(TRANSPARENT, color)), weight));
        break;
    case TRC_NODE_HOLDOUT:
        c->out->holdout = c->out->holdout + vf_where(c->s->active, weight);
        break;
    case TRC_NODE_PRINCIPLED:
        add_principled(c, leaf, weight);
        break;
    case TRC_NODE_LAYERED_PRINCIPLED:
        add_layered_principled(c, leaf, weight);
        break;
    case TRC_NODE_SHEEN:
        add_fibres(c, v3_scale(colour(c, leaf, TRC_AT(SHEEN, color)), weight),
                   leaf_normal(c, leaf, TRC_AT(SHEEN, normal)),
                   number(c, leaf, TRC_AT(SHEEN, roughness)));
        break;
    default:
        break;
    }
}

/* Chances of the lobes. At the first hit small ones may be raised to a share of the sum. */
static void set_chances(const struct trc_material *m, const struct trc_surface *s,
                        struct trc_lobes *out) {
    vfloat floor_weight = vf_zero();
    if (!(m->flags & TRC_MATERIAL_PLAIN_CHOICE)) {
        vfloat sum = vf_zero();
        for (int i = 0; i < out->count; i++)
            sum = sum + out->lobe[i].mix_weight;
        const vmask is_first = vi_eq(s->depth + s->transparent_depth, vi_set(0));
        floor_weight = vf_where(is_first, sum * vf_set(DEFENSIVE_SHARE));
    }
    out->mix_weight = vf_zero();
    out->continue_weight = vf_zero();
    for (int i = 0; i < out->count; i++) {
        struct trc_lobe *lobe = &out->lobe[i];
        const vmask present = vf_gt(v3_max(lobe->weight), vf_zero());
        lobe->mix_weight = vf_where(present, vf_max(lobe->mix_weight, floor_weight));
        out->mix_weight = out->mix_weight + lobe->mix_weight;
        if (lobe->kind == TRC_LOBE_DIFFUSE || lobe->kind == TRC_LOBE_SHEEN)
            continue;
        lobe->sample_weight = lobe->mix_weight;
        out->continue_weight = out->continue_weight + lobe->mix_weight;
    }
}

void trc_lobes_setup(const struct trc_material *m, const struct trc_surface *s,
                     const struct trc_registers *regs, vfloat filter_alpha, struct trc_lobes *out) {
    struct setup c = {m, s, regs, filter_alpha, v3_zero(), false, out};
    out->count = 0;
    out->emission = v3_zero();
    out->holdout = vf_zero();
    out->below_horizon = vm_none();
    for (uint32_t i = 0; i < m->leaf_count; i++) {
        const struct trc_leaf *leaf = &m->leaves[i];
        const vfloat weight = trc_operand_value(&leaf->weight, regs);
        if (!vm_any(vm_and(s->active, vf_ne(weight, vf_zero()))))
            continue;
        vvec3 emission;
        if (leaf_emission(&c, leaf, weight, &emission))
            out->emission = v3_add(out->emission, emission);
        add_leaf(&c, leaf, weight);
    }
    set_chances(m, s, out);
}

vvec3 trc_lobes_emission(const struct trc_material *m, const struct trc_registers *regs) {
    const struct setup c = {m, NULL, regs, vf_zero(), v3_zero(), false, NULL};
    vvec3 sum = v3_zero(), emission;
    for (uint32_t i = 0; i < m->leaf_count; i++)
        if (leaf_emission(&c, &m->leaves[i], trc_operand_value(&m->leaves[i].weight, regs),
                          &emission))
            sum = v3_add(sum, emission);
    return sum;
}
