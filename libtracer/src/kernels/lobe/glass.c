/* Glass: refraction of microfacets, and how it shares the light with reflection. The Glass and
 * Refraction shaders. */
#include "kernels/lobe/facets.h"

/* ---- refraction ---- */

/* Walter 2007, eq. 21 and 17. */
static struct lobe_value refraction_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                          vvec3 wi) {
    const vvec3 wo = s->wo;
    const vfloat cos_i = v3_dot(lobe->n, wi);
    vmask m = vm_and(vf_lt(cos_i, vf_zero()), vf_gt(lobe->cos_o, vf_zero()));
    m = vm_andnot(m, lobe->ideal);
    if (!vm_any(m))
        return no_value();
    vvec3 sum = v3_mad(wi, lobe->ior, wo);
    /* It points to the denser side; the micro-normal is on the side of n. */
    sum = v3_scale(sum, vf_copysign(vf_one(), v3_dot(sum, lobe->n)));
    const vfloat length2 = v3_dot(sum, sum);
    const vvec3 half = v3_normalize(sum);
    const vfloat cos_ho = v3_dot(half, wo), cos_hi = v3_dot(half, wi);
    const struct half_vector h = half_of(lobe, half, wi, cos_i);
    /* Only micro-normals that wo sees and that refract to the other side. */
    m = vm_and(m, vm_and(vf_gt(h.cos_m, vf_zero()),
                         vm_and(vf_gt(cos_ho, vf_zero()), vf_lt(cos_hi, vf_zero()))));
    const vfloat d = vf_where(m, distribution_d(lobe, &h));
    const vfloat jacobian = vf_abs(cos_ho * cos_hi) * lobe->ior * lobe->ior / length2;
    const vfloat visible = d * jacobian;
    struct lobe_value r;
    r.pdf = vf_set(4.0f) * lobe->pdf_scale * visible;
    r.claim = r.pick = lobe->g1_o * visible / lobe->cos_o;
    const vfloat f = r.claim * shadowing(lobe, h.tan2_i);
    r.value = v3_mul(v3_scale(lobe->weight, f), facet_fresnel(lobe, cos_ho));
    r.value = v3_where(m, r.value);
    r.pdf = vf_where(m, r.pdf);
    r.claim = r.pick = vf_where(m, r.claim);
    weigh_pair(lobe, cos_ho, &r);
    return r;
}

/* ---- setting up ---- */

vfloat trc_relative_ior(const struct trc_setup *c, vfloat ior) {
    const vfloat eta = vf_max(ior, vf_set(TRC_MIN_IOR));
    return vf_select(c->s->backfacing, vf_rcp(eta), eta);
}

vfloat trc_ior_above(const struct trc_setup *c, vfloat ior) {
    return vf_select(c->s->backfacing, vf_max(ior, vf_set(TRC_MIN_IOR)), vf_one());
}

/* A lobe of glass without its alpha. */
static struct trc_lobe *start_dielectric(struct trc_setup *c, enum trc_lobe_kind kind, vvec3 weight,
                                         vvec3 n, vfloat eta, uint32_t mode) {
    static const struct trc_lobe_model refraction = {.kind = TRC_LOBE_REFRACT,
                                                     .has_facets = true,
                                                     .value = refraction_value,
                                                     .direction = TRC_KERNEL(trc_facets_direction)};
    struct trc_lobe *lobe = kind == TRC_LOBE_REFRACT ? trc_add_lobe(c, &refraction, weight)
                                                     : trc_add_reflection(c, weight);
    if (!lobe)
        return NULL;
    const uint32_t distribution = distribution_of(mode);
    lobe->distribution = distribution == TRC_LOBE_BECKMANN ? TRC_LOBE_BECKMANN : TRC_LOBE_GGX;
    lobe->correlated = mode & TRC_DISTRIBUTION_CORRELATED;
    lobe->n = n;
    lobe->ior = eta;
    return lobe;
}

struct trc_lobe *trc_add_dielectric(struct trc_setup *c, enum trc_lobe_kind kind, vvec3 weight,
                                    vvec3 n, vfloat alpha, vfloat eta, uint32_t mode) {
    struct trc_lobe *lobe = start_dielectric(c, kind, weight, n, eta, mode);
    if (!lobe)
        return NULL;
    lobe->alpha_x = lobe->alpha_y = alpha;
    trc_facets_finish(c, lobe, is_sharp(mode));
    return lobe;
}

/* What refracts as the twin of a lobe that reflects and was added last, or alone where that is
 * NULL; all but the weight is the same of both. */
static struct trc_lobe *add_twin(struct trc_setup *c, struct trc_lobe *reflect, vvec3 weight,
                                 vvec3 n, vfloat alpha, vfloat eta, uint32_t mode) {
    if (!reflect)
        return trc_add_dielectric(c, TRC_LOBE_REFRACT, weight, n, alpha, eta, mode);
    struct trc_lobe *lobe = start_dielectric(c, TRC_LOBE_REFRACT, weight, n, eta, mode);
    if (!lobe)
        return NULL;
    trc_facets_finish_twin(lobe, reflect);
    reflect->has_twin = true;
    return lobe;
}

/* Chances of two lobes that have the factor of the micro-normal, f that of the normal. Where both
 * are rough they share micro-normals, each of which reflects as often as it should (weigh_pair):
 * with chances by the normal, a path within glass would gain or lose weight at every bounce, until
 * few paths carry most of the light. */
static void share_chances(struct trc_lobe *reflect, struct trc_lobe *refract, vfloat f) {
    if (reflect)
        reflect->mix_weight = reflect->mix_weight * f;
    if (refract)
        refract->mix_weight = refract->mix_weight * (vf_one() - f);
    if (!reflect || !refract)
        return;
    const vfloat reflected = v3_average(reflect->weight), refracted = v3_average(refract->weight);
    const vmask both = vm_and(vf_gt(reflected, vf_zero()), vf_gt(refracted, vf_zero()));
    const vmask paired = vm_andnot(both, vm_or(reflect->ideal, refract->ideal));
    const vfloat half = vf_set(0.5f) * (reflect->mix_weight + refract->mix_weight);
    reflect->mix_weight = vf_select(paired, half, reflect->mix_weight);
    refract->mix_weight = vf_select(paired, half, refract->mix_weight);
    reflect->pdf_scale = vf_select(paired, refract->pdf_scale, reflect->pdf_scale);
    reflect->paired = refract->paired = paired;
    reflect->pair_tint = refract->pair_tint = vf_divide(refracted, reflected);
}

/* What single scattering keeps; all where trc_facets_finish makes refraction ideal, for the index
 * is that of what is around. */
static vfloat kept_by_glass(vfloat albedo, vfloat eta) {
    const vmask is_nothing = vf_lt(vf_abs(eta - vf_one()), vf_set(NO_REFRACTION));
    return vf_select(is_nothing, vf_one(), albedo);
}

/* Bounds on the share of reflection that is taken from tables. */
#define MIN_SHARE 0.05f
#define MAX_SHARE 0.95f

void trc_add_multi_glass(struct trc_setup *c, vvec3 weight, vvec3 reflected, vvec3 refracted,
                         vvec3 albedo, vvec3 n, vfloat alpha, vfloat eta) {
    /* As rough as the lobes will be: a filtered one keeps its energy too. */
    const vfloat rough = vf_max(vf_clamp(alpha, MIN_ALPHA, 1.0f), c->filter_alpha);
    const vfloat kept = kept_by_glass(trc_glass_albedo(v3_dot(n, c->s->wo), rough, eta), eta);
    /* What does not get away is coloured again at every further bounce: a geometric series. */
    const vfloat share = trc_glass_reflected_share(v3_dot(n, c->s->wo), rough, eta);
    const vvec3 colors = v3_lerp(refracted, reflected, vf_clamp(share, MIN_SHARE, MAX_SHARE));
    const vvec3 again = v3_scale(colors, vf_one() - kept);
    const vfloat minimum = vf_set(MIN_KEPT), one = vf_one();
    const vvec3 gain =
        v3(vf_rcp(vf_max(one - again.x, minimum)), vf_rcp(vf_max(one - again.y, minimum)),
           vf_rcp(vf_max(one - again.z, minimum)));
    const vvec3 w = v3_mul(weight, gain);
    struct trc_lobe *reflect = trc_add_dielectric(c, TRC_LOBE_REFLECT, v3_mul(w, reflected), n,
                                                  rough, eta, TRC_DISTRIBUTION_GGX);
    /* To the passes of colours and of features all of it is one transmission, and bounces between
     * facets add nothing: Cycles 3.4. */
    if (reflect) {
        reflect->fresnel = TRC_FRESNEL_DIELECTRIC;
        reflect->is_whole_glass = true;
        reflect->f0 = v3_zero();
    }
    struct trc_lobe *refract =
        add_twin(c, reflect, v3_mul(w, refracted), n, rough, eta, TRC_DISTRIBUTION_GGX);
    if (refract) {
        refract->fresnel = TRC_FRESNEL_DIELECTRIC;
        refract->is_whole_glass = true;
    }
    struct trc_lobe *seen = refract ? refract : reflect; /* black glass reflects alone */
    if (seen)
        seen->f0 = albedo;
    c->out->rare |= TRC_LOBES_WHOLE_GLASS;
    share_chances(reflect, refract, trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta));
}

/* kept: what single scattering keeps. */
static void correlate(struct trc_lobe *lobe, const struct trc_fresnel *fresnel, vfloat kept) {
    set_fresnel(lobe, fresnel);
    lobe->albedo_scale = kept;
    lobe->mix_weight = lobe->mix_weight * kept;
}

/* What all bounces between facets keep of a colour after its first: each takes what refraction does
 * or, where nothing is refracted, what reflection does. kept: what the first lets out. */
static vvec3 coloured_again(vvec3 reflected, vvec3 refracted, const struct trc_fresnel *fresnel,
                            vfloat kept, vfloat alpha, vfloat eta) {
    const vvec3 of_reflection =
        v3_saturate(v3_mul(reflected, v3_lerp(fresnel->f0, fresnel->f90, mean_blend(eta))));
    const vvec3 per_bounce =
        v3_select(vf_gt(v3_max(refracted), vf_zero()), refracted, of_reflection);
    const vvec3 taken = v3_sub(per_bounce, v3_splat(vf_one()));
    if (!vm_any(vf_ne(v3_dot(taken, taken), vf_zero())))
        return v3_splat(vf_one());
    const vfloat mean = kept_by_glass(trc_correlated_glass_mean_albedo(alpha, eta), eta);
    return v3_lerp(colour_of_bounces(per_bounce, mean), v3_splat(vf_one()), kept);
}

void trc_add_correlated_glass(struct trc_setup *c, vvec3 weight, vvec3 reflected, vvec3 refracted,
                              const struct trc_fresnel *fresnel, vvec3 n, vfloat alpha, vfloat eta,
                              uint32_t mode) {
    const vfloat cos_o = v3_dot(n, c->s->wo);
    vfloat kept = vf_one();
    if (distribution_of(mode) == TRC_LOBE_MULTI_GGX) {
        kept = kept_by_glass(trc_correlated_glass_albedo(cos_o, alpha, eta), eta);
        kept = vf_max(kept, vf_set(MIN_KEPT));
        weight = v3_mul(weight, coloured_again(reflected, refracted, fresnel, kept, alpha, eta));
        weight = v3_scale(weight, vf_rcp(kept));
    }
    reflected = v3_mul(weight, reflected);
    refracted = v3_mul(weight, refracted);
    struct trc_lobe *reflect =
        trc_add_dielectric(c, TRC_LOBE_REFLECT, reflected, n, alpha, eta, mode);
    if (reflect)
        correlate(reflect, fresnel, kept);
    struct trc_lobe *refract = add_twin(c, reflect, refracted, n, alpha, eta, mode);
    if (refract)
        correlate(refract, fresnel, kept);
    const struct trc_lobe *either = reflect ? reflect : refract;
    if (either)
        share_chances(reflect, refract, v3_average(facet_reflectance(either, cos_o)));
}

/* Cycles refracts at least 1e-4, and so gives that much more than it gets. */
vfloat trc_reflected_part(vfloat f) {
    const vfloat minimum = vf_set(TRC_WEIGHT_CUTOFF);
    return vf_where(vf_ge(f, minimum), vf_select(vf_lt(vf_one() - f, minimum), vf_one(), f));
}

static void add_glass(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 color = colour(c, leaf, TRC_AT(GLASS, color));
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(GLASS, normal));
    const vfloat alpha = vf_square(number(c, leaf, TRC_AT(GLASS, roughness)));
    const vfloat ior = number(c, leaf, TRC_AT(GLASS, ior)), eta = trc_relative_ior(c, ior);
    if (leaf->mode & TRC_DISTRIBUTION_CORRELATED) {
        struct trc_fresnel fresnel = blend_to_white(v3_splat(trc_fresnel_normal(eta)));
        trc_thin_film_cover(c, leaf, TRC_AT(GLASS, film_thickness), trc_ior_above(c, ior),
                            TRC_WHOLE_FILM_5, &fresnel);
        trc_add_correlated_glass(c, v3_splat(weight), color, color, &fresnel, n, vf_saturate(alpha),
                                 eta, leaf->mode);
        return;
    }
    if (leaf->mode == TRC_DISTRIBUTION_MULTI_GGX) {
        const vvec3 tint = v3_saturate(color);
        trc_add_multi_glass(c, v3_splat(weight), tint, tint, v3_scale(color, weight), n, alpha,
                            eta);
        return;
    }
    const vvec3 tint = v3_scale(color, weight);
    const vfloat f = trc_reflected_part(trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta));
    struct trc_lobe *reflect =
        trc_add_dielectric(c, TRC_LOBE_REFLECT, v3_scale(tint, f), n, alpha, eta, leaf->mode);
    add_twin(c, reflect, v3_scale(tint, vf_one() - f), n, alpha, eta, leaf->mode);
}

const struct trc_closure TRC_CLOSURE_OF(GLASS) = {.add = add_glass};

static void add_refraction(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(REFRACTION, normal));
    const vfloat eta = trc_relative_ior(c, number(c, leaf, TRC_AT(REFRACTION, ior)));
    struct trc_lobe *lobe = trc_add_dielectric(
        c, TRC_LOBE_REFRACT, v3_scale(colour(c, leaf, TRC_AT(REFRACTION, color)), weight), n,
        vf_square(number(c, leaf, TRC_AT(REFRACTION, roughness))), eta, leaf->mode);
    /* Of what is reflected totally, if the surface is smooth, Cycles 4 has no colour. */
    if (lobe && lobe->correlated)
        lobe->albedo_scale =
            vf_where(vf_lt(trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta), vf_one()), vf_one());
}

const struct trc_closure TRC_CLOSURE_OF(REFRACTION) = {.add = add_refraction};
