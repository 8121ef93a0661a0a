/* Sheen of fibres that stand off a surface: Schlick's of Principled in Blender 3.4, that of Blender
 * 4, and velvet. */
#include "kernels/lobe/matt.h"

#include "kernels/lobe/microfacet.h"

/* ---- Schlick's ---- */

static struct lobe_value schlick_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                       vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    const vvec3 h = v3_normalize(v3_add(wi, s->wo));
    const vfloat f = trc_schlick_weight(v3_dot(wi, h)) * cos_i;
    return matt_value(lobe, s, wi, cos_i, vf_where(vf_ge(lobe->cos_o, vf_zero()), f),
                      cosine_density(cos_i));
}

/* Taken at the normal, as if that were every half vector: Cycles. */
static vfloat schlick_mean(const struct trc_lobe *lobe) {
    return vf_max(trc_schlick_weight(lobe->cos_o) * lobe->cos_o, vf_zero());
}

void trc_add_schlick_sheen(struct trc_setup *c, vvec3 weight, vvec3 n) {
    static const struct trc_lobe_model model = {
        .kind = TRC_LOBE_DIFFUSE, .value = schlick_value, .mean = schlick_mean};
    struct trc_lobe *lobe = trc_add_matt(c, &model, weight, n, vf_zero());
    if (!lobe)
        return;
    lobe->mix_weight = lobe->mix_weight * schlick_mean(lobe);
}

/* ---- microfibres ---- */

/* A cosine lobe that a linear map has drawn out: T. Zeltner, B. Burley and M. J.-Y. Chiang,
 * "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines" (2022). */
TRC_INLINE vfloat fibres(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi, vfloat cos_i) {
    const vvec3 across = v3_sub(wo, v3_scale(lobe->n, lobe->cos_o));
    const vfloat length2 = v3_dot(across, across);
    const vvec3 x = v3_scale(across, vf_divide(vf_one(), vf_sqrt(length2)));
    const vvec3 flat = v3_sub(wi, v3_scale(lobe->n, cos_i));
    const vfloat along = v3_dot(flat, x), a = lobe->f0.x, b = lobe->f0.y;
    const vfloat aside2 = vf_max(v3_dot(flat, flat) - along * along, vf_zero());
    const vfloat size2 = vf_square(a * along + b * cos_i) + a * a * aside2 + cos_i * cos_i;
    return vf_set(TRC_INV_PI) * cos_i * vf_square(vf_divide(a, size2));
}

static struct lobe_value fibres_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                      vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    const vfloat f = fibres(lobe, s->wo, wi, cos_i);
    return matt_value(lobe, s, wi, cos_i, f, f);
}

static const struct trc_lobe_model fibres_model = {.kind = TRC_LOBE_DIFFUSE, .value = fibres_value};

/* Albedo of the fibres and the coefficients of their transform: rational fits to the tables of
 * Zeltner et al. (2022), as published with MaterialX 1.39. */
vfloat trc_fibres_albedo(vfloat x, vfloat y) {
    const vfloat s = y * (vf_set(0.0206607f) + vf_set(1.58491f) * y) /
                     (vf_set(0.0379424f) + y * (vf_set(1.32227f) + y));
    const vfloat m = y *
                     (vf_set(-0.193854f) +
                      y * (vf_set(-1.14885f) + y * (vf_set(1.7932f) - vf_set(0.95943f) * y * y))) /
                     (vf_set(0.046391f) + y);
    const vfloat o = y *
                     (vf_set(0.000654023f) + (vf_set(-0.0207818f) + vf_set(0.119681f) * y) * y) /
                     (vf_set(1.26264f) + y * (vf_set(-1.92021f) + y));
    const vfloat off = (x - m) / s;
    return vf_saturate(vf_exp(vf_set(-0.5f) * off * off) * vf_set(0.39894228f) / s + o);
}
static vfloat fibres_scale(vfloat x, vfloat y) {
    return (vf_set(2.58126f) * x + vf_set(0.813703f) * y) * y /
           (vf_one() + vf_set(0.310327f) * x * x + vf_set(2.60994f) * x * y);
}
static vfloat fibres_lean(vfloat x, vfloat y) {
    return vf_safe_sqrt(vf_one() - x) * (y - vf_one()) * y * y * y /
           (vf_set(0.0000254053f) + vf_set(1.71228f) * x - vf_set(1.71506f) * x * y +
            vf_set(1.34174f) * y * y);
}

/* Where the fits hold. */
#define MIN_FIBRE_ROUGHNESS 0.01f
vfloat trc_add_fibres(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness) {
    const vfloat rough = vf_clamp(roughness, MIN_FIBRE_ROUGHNESS, 1.0f);
    const vfloat cosine = vf_saturate(v3_dot(n, c->s->wo));
    const vfloat albedo = trc_fibres_albedo(cosine, rough);
    struct trc_lobe *lobe = trc_add_matt(c, &fibres_model, v3_scale(weight, albedo), n, rough);
    if (lobe)
        lobe->f0 = v3(fibres_scale(cosine, rough), fibres_lean(cosine, rough), vf_zero());
    return albedo;
}

static void add_sheen(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    trc_add_fibres(c, v3_scale(colour(c, leaf, TRC_AT(SHEEN, color)), weight),
                   trc_matt_normal(c, leaf, TRC_AT(SHEEN, normal)),
                   number(c, leaf, TRC_AT(SHEEN, roughness)));
}

const struct trc_closure TRC_CLOSURE_OF(SHEEN) = {.add = add_sheen};

/* ---- velvet ---- */

/* M. Ashikhmin, S. Premoze and P. Shirley, "A Microfacet-Based BRDF Generator" (2000): slopes are
 * rare around the normal. */
#define VELVET_MIN_COSINE 1e-5f
#define VELVET_MIN_SIGMA 0.01f
TRC_INLINE vfloat velvet(vfloat inverse_sigma2, vfloat cos_i, vfloat cos_o, vfloat cos_m,
                         vfloat cos_mo) {
    const vfloat one = vf_one(), minimum = vf_set(VELVET_MIN_COSINE), c = vf_abs(cos_mo);
    const vmask valid = vm_and(vm_and(vf_gt(cos_o, vf_zero()), vf_gt(c, minimum)),
                               vf_lt(vf_abs(cos_m), one - minimum));
    const vfloat ratio = vf_set(2.0f) * vf_max(vf_divide(cos_m, c), minimum);
    const vfloat masking = vf_min(one, ratio * vf_min(vf_abs(cos_o), vf_abs(cos_i)));
    const vfloat sin2 = vf_select(valid, one - cos_m * cos_m, one);
    const vfloat d = vf_exp(-cos_m * cos_m / sin2 * inverse_sigma2) * inverse_sigma2 *
                     vf_set(TRC_INV_PI) / (sin2 * sin2);
    return vf_where(valid, vf_set(0.25f) * d * masking / cos_o);
}

TRC_INLINE vfloat velvet_towards(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                                 vfloat cos_i) {
    const vvec3 h = v3_normalize(v3_add(wi, s->wo));
    return velvet(lobe->roughness, cos_i, lobe->cos_o, v3_dot(lobe->n, h), v3_dot(s->wo, h));
}

static struct lobe_value velvet_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                      vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    return upper_value(lobe, cos_i, velvet_towards(lobe, s, wi, cos_i), even_density());
}

/* In Cycles 3 and 4 bumps leave a shadow on what is sampled, not on what lights bring. */
static struct lobe_value velvet_sampled(const struct trc_lobe *lobe, const struct trc_surface *s,
                                        vvec3 wi, const struct trc_draw *draw) {
    (void)draw;
    if (lobe->facet_shadowing)
        return velvet_value(lobe, s, wi);
    const vfloat cos_i = v3_dot(lobe->n, wi);
    return matt_value(lobe, s, wi, cos_i, velvet_towards(lobe, s, wi, cos_i), even_density());
}

static const struct trc_lobe_model velvet_model = {
    .kind = TRC_LOBE_VELVET, .value = velvet_value, .sampled = velvet_sampled};

static void add_velvet(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vfloat sigma = vf_max(number(c, leaf, TRC_AT(VELVET, sigma)), vf_set(VELVET_MIN_SIGMA));
    trc_add_matt(c, &velvet_model, v3_scale(colour(c, leaf, TRC_AT(VELVET, color)), weight),
                 trc_matt_normal(c, leaf, TRC_AT(VELVET, normal)), vf_rcp(sigma * sigma));
    c->out->rare |= TRC_LOBES_VELVET;
}

const struct trc_closure TRC_CLOSURE_OF(VELVET) = {.add = add_velvet};
