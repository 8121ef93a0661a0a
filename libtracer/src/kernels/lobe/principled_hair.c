/* Principled Hair: M. J.-Y. Chiang, B. Bitterli, C. Tappan and B. Burley, "A Practical and
 * Controllable Hair and Fur Model for Production Path Tracing" (2016), with the parameters of
 * Cycles: light that is reflected (R), goes through (TT), comes back from the far side (TRT), or
 * stays inside for longer, which is spread evenly around the strand. Along it: E. d'Eon,
 * G. Francois, M. Hill, J. Letteri and J.-M. Aubry, "An Energy-Conserving Hair Reflectance Model"
 * (2011); around it logistic distributions.
 *
 * Departure from Cycles: with a coat it samples the first reflection without it; here samples are
 * of the density that they are weighed with.
 *
 * Of its lobe alpha_x is the variance along the strand, roughness that of the first reflection,
 * alpha_y the scale around it, pair_tint the sine of the scales' tilt, the tangent is along the
 * strand; f0: what a crossing lets through, f90: Fresnel's factor, the angles to the strand's
 * normal of the ray outside and inside; multi_weight: the albedo. */
#include "kernels/lobe/microfacet.h"

#include "kernels/lobe/fibre.h"
#include "kernels/lobe/lobe.h"

enum { PATH_R, PATH_TT, PATH_TRT, PATH_REST, PATH_COUNT };

#define MIN_IOR 1e-5f
/* sqrt(pi / 8): of a normal distribution's width, that of the logistic one that is like it. */
#define SQRT_PI_8 0.626657069f
/* Albedos of whose paths inside all is kept would be infinite. */
#define MAX_KEPT 0.99999f

/* ---- distributions ---- */

/* Around the strand at x from the middle, of scale s, over one turn. */
static vfloat azimuthal(vfloat x, vfloat s) {
    const vfloat turn = vf_set(TRC_TWO_PI), one = vf_one();
    x = x - turn * vf_round(x / turn);
    const vfloat e = vf_exp(-vf_abs(x) / s), tail = vf_exp(vf_set(-TRC_PI) / s);
    return e / (s * (one + e) * (one + e)) * ((one + tail) / (one - tail));
}

static vfloat azimuth_sampled(vfloat u, vfloat s) {
    const vfloat one = vf_one(), tail = vf_exp(vf_set(-TRC_PI) / s), cdf = tail / (one + tail);
    const vfloat inside = u * (one - cdf - cdf) + cdf;
    return vf_clamp(-s * vf_log(vf_rcp(inside) - one), -TRC_PI, TRC_PI);
}

/* ---- the fibre ---- */

struct fibre {
    vvec3 x, y, z; /* along the strand, across it and wo, away from wo */
    vfloat sin_o[PATH_COUNT], cos_o[PATH_COUNT]; /* of wo, tilted for each path */
    vfloat variance[PATH_COUNT];
    vfloat turn[PATH_COUNT]; /* azimuths of the paths, but of the rest */
    vvec3 attenuation[PATH_COUNT];
    vfloat chance[PATH_COUNT]; /* sums up to 1 */
};

static void attenuate(const struct trc_lobe *lobe, struct fibre *f) {
    const vfloat one = vf_one(), fresnel = lobe->f90.x, passes = one - fresnel;
    const vvec3 through = lobe->f0, again = v3_scale(through, fresnel);
    f->attenuation[PATH_R] = v3_splat(fresnel);
    f->attenuation[PATH_TT] = v3_scale(through, passes * passes);
    f->attenuation[PATH_TRT] = v3_mul(f->attenuation[PATH_TT], again);
    const vfloat kept = vf_set(MAX_KEPT);
    const vvec3 series =
        v3(again.x / (one - vf_min(again.x, kept)), again.y / (one - vf_min(again.y, kept)),
           again.z / (one - vf_min(again.z, kept)));
    f->attenuation[PATH_REST] = v3_mul(f->attenuation[PATH_TRT], series);
    vfloat sum = vf_zero();
    for (int p = 0; p < PATH_COUNT; p++) {
        f->chance[p] = v3_luminance(f->attenuation[p]);
        sum = sum + f->chance[p];
    }
    for (int p = 0; p < PATH_COUNT; p++)
        f->chance[p] = vf_divide(f->chance[p], sum);
}

/* Turns wo along the strand by an angle of that sine and cosine. */
static void tilt(struct fibre *f, int path, vfloat sine, vfloat cosine) {
    const vfloat sin_o = f->sin_o[PATH_REST], cos_o = f->cos_o[PATH_REST];
    f->sin_o[path] = sin_o * cosine + cos_o * sine;
    f->cos_o[path] = vf_abs(cos_o * cosine - sin_o * sine);
}

static void fibre_of(const struct trc_lobe *lobe, const struct trc_surface *s, struct fibre *f) {
    const vfloat two = vf_set(2.0f), one = vf_one(), v = lobe->alpha_x;
    f->x = lobe->tangent;
    f->y = v3_normalize(v3_cross(f->x, s->wo));
    f->z = v3_cross(f->x, f->y);
    const vfloat sin_o = vf_clamp(v3_dot(f->x, s->wo), -1.0f, 1.0f);
    f->sin_o[PATH_REST] = sin_o;
    f->cos_o[PATH_REST] = vf_safe_sqrt(one - sin_o * sin_o);
    /* Scales tilt by a, TT by half of what R does, TRT by twice as much the other way. */
    const vfloat s1 = lobe->pair_tint, c1 = vf_safe_sqrt(one - s1 * s1);
    const vfloat s2 = two * s1 * c1, c2 = c1 * c1 - s1 * s1;
    tilt(f, PATH_R, -s2, c2);
    tilt(f, PATH_TT, s1, c1);
    tilt(f, PATH_TRT, two * s2 * c2, c2 * c2 - s2 * s2);
    f->variance[PATH_R] = lobe->roughness;
    f->variance[PATH_TT] = vf_set(0.25f) * v;
    f->variance[PATH_TRT] = f->variance[PATH_REST] = vf_set(4.0f) * v;
    for (int p = 0; p < PATH_REST; p++)
        f->turn[p] = vf_set((float)p) * (two * lobe->f90.z + vf_set(TRC_PI)) - two * lobe->f90.y;
    attenuate(lobe, f);
}

/* ---- value and directions ---- */

static struct lobe_value value(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi) {
    struct fibre f;
    fibre_of(lobe, s, &f);
    const vfloat sin_i = vf_clamp(v3_dot(f.x, wi), -1.0f, 1.0f);
    const vfloat cos_i = vf_safe_sqrt(vf_one() - sin_i * sin_i);
    /* From wo, which is at -z. */
    const vfloat phi = vf_atan2(v3_dot(f.y, wi), -v3_dot(f.z, wi));
    vvec3 sum = v3_zero();
    vfloat pdf = vf_zero();
    for (int p = 0; p < PATH_COUNT; p++) {
        vfloat part = trc_along_strand(sin_i, cos_i, f.sin_o[p], f.cos_o[p], f.variance[p]);
        part = part * (p == PATH_REST ? vf_set(0.5f * TRC_INV_PI)
                                      : azimuthal(phi - f.turn[p], lobe->alpha_y));
        sum = v3_mad(f.attenuation[p], part, sum);
        pdf = pdf + f.chance[p] * part;
    }
    return (struct lobe_value){v3_mul(lobe->weight, sum), pdf, pdf, pdf};
}

static struct lobe_value sided_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                     vvec3 wi) {
    return value_where(trc_fibre_lit(lobe->tangent, s, wi), value(lobe, s, wi));
}

static struct lobe_value sampled_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                       vvec3 wi, const struct trc_draw *draw) {
    (void)draw;
    return value(lobe, s, wi);
}

static vvec3 direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    struct fibre f;
    fibre_of(lobe, s, &f);
    const vfloat one = vf_one();
    /* One number for the path and, stretched, for the angle along the strand. */
    vfloat rest = vf_saturate(vf_divide(chosen_at, lobe->sample_weight));
    vfloat u = vf_zero(), sin_o = f.sin_o[PATH_R], cos_o = f.cos_o[PATH_R];
    vfloat v = f.variance[PATH_R], phi = vf_zero();
    vmask waiting = vm_all_set();
    *crosses = *alive;
    for (int p = 0; p < PATH_COUNT; p++) {
        const vmask m = p == PATH_REST ? waiting : vm_and(waiting, vf_lt(rest, f.chance[p]));
        if (vm_any(m)) {
            u = vf_select(m, vf_divide(rest, f.chance[p]), u);
            sin_o = vf_select(m, f.sin_o[p], sin_o);
            cos_o = vf_select(m, f.cos_o[p], cos_o);
            v = vf_select(m, f.variance[p], v);
            phi = vf_select(m,
                            p == PATH_REST ? vf_set(TRC_TWO_PI) * u1
                                           : f.turn[p] + azimuth_sampled(u1, lobe->alpha_y),
                            phi);
            if (p == PATH_R)
                *crosses = vm_andnot(*alive, m);
        }
        waiting = vm_andnot(waiting, m);
        rest = rest - f.chance[p];
    }
    const vfloat sin_i = trc_along_strand_sampled(sin_o, cos_o, v, u, u2);
    const vfloat cos_i = vf_safe_sqrt(one - sin_i * sin_i);
    vfloat sin_phi, cos_phi;
    vf_sincos(phi, &sin_phi, &cos_phi);
    const vvec3 around = v3_sub(v3_scale(f.y, sin_phi), v3_scale(f.z, cos_phi));
    return v3_mad(f.x, sin_i, v3_scale(around, cos_i));
}

/* ---- setting up ---- */

static vvec3 albedo(const struct trc_lobe *lobe, vfloat cos_o) {
    (void)cos_o;
    return lobe->multi_weight;
}

/* x^20. */
static vfloat power_20(vfloat x) {
    const vfloat x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
    return x8 * x8 * x4;
}

/* Chiang et al., equation 7: variance along the strand, of a roughness. */
static vfloat variance_of(vfloat roughness) {
    const vfloat r = roughness;
    return vf_square(vf_set(0.726f) * r + vf_set(0.812f) * r * r + vf_set(3.7f) * power_20(r));
}

/* Equation 8: the scale around it. */
static vfloat scale_of(vfloat roughness) {
    const vfloat r = roughness, r2 = r * r;
    return vf_set(SQRT_PI_8) *
           (vf_set(0.265f) * r + vf_set(1.194f) * r2 + vf_set(5.372f) * power_20(r) * r2);
}

static vvec3 absorption_of(const struct trc_setup *c, const struct trc_leaf *leaf,
                           vfloat randomness, vfloat roughness) {
#define NUMBER(input) number(c, leaf, TRC_AT(PRINCIPLED_HAIR, input))
#define COLOUR(input) colour(c, leaf, TRC_AT(PRINCIPLED_HAIR, input))
    const struct trc_strand_pigment pigment = {leaf->mode & TRC_PRINCIPLED_HAIR_PIGMENT_MASK,
                                               COLOUR(color),
                                               COLOUR(absorption),
                                               COLOUR(tint),
                                               NUMBER(melanin),
                                               NUMBER(melanin_redness),
                                               vf_one() +
                                                   randomness * vf_saturate(NUMBER(random_color))};
    return trc_absorption(&pigment, roughness);
}

/* Cycles' normal: from Blender 4 on across the ray. */
static vvec3 normal(const struct trc_lobe *lobe, vvec3 wo) {
    return lobe->correlated ? v3_normalize(v3_cross(lobe->tangent, wo)) : lobe->n;
}

static void add_principled_hair(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model model = {
        .kind = TRC_LOBE_HAIR_REFLECT, .normal = normal, .value = value, .direction = direction};
    static const struct trc_lobe_model sided = {.kind = TRC_LOBE_HAIR_REFLECT,
                                                .normal = normal,
                                                .value = sided_value,
                                                .sampled = sampled_value,
                                                .direction = direction};
    const bool is_sided = c->material->flags & TRC_MATERIAL_FACET_SHADOWING;
    struct trc_lobe *lobe = trc_add_lobe(c, is_sided ? &sided : &model, v3_splat(weight));
    if (!lobe)
        return;
    const struct trc_surface *s = c->s;
    const vfloat one = vf_one();
    c->out->rare |= TRC_LOBES_HAIR;
    lobe->n = trc_default_normal(c);
    lobe->cos_o = v3_dot(lobe->n, s->wo);
    vvec3 along = COLOUR(tangent), second;
    if (is_unlinked(c, leaf, TRC_AT(PRINCIPLED_HAIR, tangent)))
        trc_surface_sides(s, &along, &second);
    lobe->tangent = v3_normalize(along);

    const vfloat randomness = vf_set(2.0f) * NUMBER(random) - one; /* -1 to 1 */
    const vfloat factor = one + randomness * NUMBER(random_roughness);
    const vfloat radial = NUMBER(radial_roughness) * factor;
    const vfloat rough = vf_clamp(NUMBER(roughness) * factor, TRC_MIN_FIBRE_ROUGHNESS, 1.0f);
    const vfloat coat = vf_saturate(NUMBER(coat));
    lobe->alpha_x = vf_max(variance_of(rough), c->filter_alpha);
    lobe->roughness =
        vf_max(variance_of(vf_clamp((one - coat) * rough, TRC_MIN_FIBRE_ROUGHNESS, 1.0f)),
               c->filter_alpha);
    lobe->alpha_y =
        vf_max(scale_of(vf_clamp(radial, TRC_MIN_FIBRE_ROUGHNESS, 1.0f)), c->filter_alpha);
    lobe->pair_tint = -vf_sin(NUMBER(offset));

    const vvec3 x = lobe->tangent, y = v3_normalize(v3_cross(x, s->wo)), z = v3_cross(x, y);
    const vfloat eta = vf_max(NUMBER(ior), vf_set(MIN_IOR));
    const vfloat sin_o = vf_clamp(v3_dot(x, s->wo), -1.0f, 1.0f), sin_t = sin_o / eta;
    const vfloat cos_o = vf_safe_sqrt(one - sin_o * sin_o);
    const vfloat cos_t = vf_safe_sqrt(one - sin_t * sin_t);
    /* How far the ray passes the strand's middle, over its radius. */
    const vfloat h = vf_clamp(v3_dot(v3_cross(s->ng, x), z), -1.0f, 1.0f);
    const vfloat h_t =
        vf_clamp(vf_divide(h * cos_o, vf_safe_sqrt(eta * eta - sin_o * sin_o)), -1.0f, 1.0f);
    const vfloat fresnel = trc_fresnel_dielectric(cos_o * vf_safe_sqrt(one - h * h), eta);
    lobe->f90 = v3(fresnel, vf_asin(h), vf_asin(h_t));
    const vvec3 sigma = absorption_of(c, leaf, randomness, radial);
    const vfloat way = vf_divide(vf_set(2.0f) * vf_safe_sqrt(one - h_t * h_t), cos_t);
    lobe->f0 = v3(vf_exp(-sigma.x * way), vf_exp(-sigma.y * way), vf_exp(-sigma.z * way));

    const vfloat scale = trc_albedo_scale(lobe->alpha_x);
    lobe->multi_weight = v3(vf_exp(-vf_safe_sqrt(sigma.x) * scale) + fresnel,
                            vf_exp(-vf_safe_sqrt(sigma.y) * scale) + fresnel,
                            vf_exp(-vf_safe_sqrt(sigma.z) * scale) + fresnel);
    lobe->fresnel = TRC_FRESNEL_OWN;
    lobe->reflectance = albedo;
    lobe->correlated = leaf->mode & TRC_PRINCIPLED_HAIR_ALBEDO;
#undef NUMBER
#undef COLOUR
}

const struct trc_closure TRC_CLOSURE_OF(PRINCIPLED_HAIR) = {.add = add_principled_hair};
