/* What lobes of microfacets share: half vectors, Fresnel's factor, masking, pairs. */
#ifndef TRACER_KERNELS_LOBE_FACETS_H
#define TRACER_KERNELS_LOBE_FACETS_H

#include "kernels/lobe/ggx_energy.h"
#include "kernels/lobe/lobe.h"
#include "kernels/lobe/microfacet.h"

/* ---- values ---- */

/* The half vector and the direction as seen from the normal. */
struct half_vector {
    vfloat cos_m; /* n . m */
    vfloat
        sin2_m; /* isotropic lobes: its sine squared; from the cross product, which keeps digits */
    vfloat e;   /* see microfacet.h */
    vfloat tan2_i; /* alpha-weighted, of wi */
    vvec3 local;   /* m in the frame, anisotropic lobes */
};

TRC_INLINE struct half_vector half_of(const struct trc_lobe *lobe, vvec3 m, vvec3 wi,
                                      vfloat cos_i) {
    struct half_vector h;
    h.cos_m = v3_dot(lobe->n, m);
    const vfloat inverse_i = vf_rcp(cos_i * cos_i);
    if (lobe->anisotropic) {
        const vvec3 bitangent = v3_cross(lobe->n, lobe->tangent);
        h.local = v3_to_frame(m, lobe->tangent, bitangent, lobe->n);
        h.e = vf_square(h.local.x / lobe->alpha_x) + vf_square(h.local.y / lobe->alpha_y);
        h.sin2_m = h.local.x * h.local.x + h.local.y * h.local.y;
        h.tan2_i = (vf_square(v3_dot(wi, lobe->tangent) * lobe->alpha_x) +
                    vf_square(v3_dot(wi, bitangent) * lobe->alpha_y)) *
                   inverse_i;
        return h;
    }
    const vvec3 across = v3_cross(lobe->n, m);
    const vfloat alpha2 = lobe->alpha_x * lobe->alpha_x;
    h.sin2_m = v3_dot(across, across);
    h.e = h.sin2_m / alpha2;
    h.tan2_i = vf_max(alpha2 * (vf_one() - cos_i * cos_i) * inverse_i, vf_zero());
    h.local = v3(vf_sqrt(h.sin2_m), vf_zero(), h.cos_m);
    return h;
}

/* What reflection of wo to wi has in common, whatever the distribution. */
struct meeting {
    vmask m; /* lanes that reflect at all */
    vfloat cos_i, cos_h;
    struct half_vector h;
};
/* False: no lane does. */
TRC_INLINE bool meet(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi, struct meeting *out) {
    out->cos_i = v3_dot(lobe->n, wi);
    out->m = vm_and(vf_gt(out->cos_i, vf_zero()), vf_gt(lobe->cos_o, vf_zero()));
    out->m = vm_andnot(out->m, lobe->ideal);
    if (!vm_any(out->m))
        return false;
    const vvec3 half = v3_normalize(v3_add(wo, wi));
    out->cos_h = v3_dot(half, wi);
    out->h = half_of(lobe, half, wi, out->cos_i);
    return true;
}

/* Reflected part of what meets a micro-normal. */
TRC_INLINE vvec3 facet_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    if (lobe->fresnel == TRC_FRESNEL_BLEND)
        return v3_lerp(lobe->f0, lobe->f90, trc_fresnel_blend(cos_m, lobe->ior));
    if (lobe->fresnel == TRC_FRESNEL_OVERSHOOT)
        return v3_lerp(lobe->f0, lobe->f90, trc_fresnel_overshoot(cos_m, lobe->ior));
    if (lobe->fresnel >= TRC_FRESNEL_OWN)
        return lobe->reflectance(lobe, cos_m);
    if (lobe->fresnel == TRC_FRESNEL_DIELECTRIC)
        return v3_splat(trc_fresnel_dielectric(cos_m, lobe->ior));
    return v3_splat(vf_one());
}
/* The part that the lobe has of it. */
TRC_INLINE vvec3 facet_fresnel(const struct trc_lobe *lobe, vfloat cos_m) {
    const vvec3 f = facet_reflectance(lobe, cos_m);
    const bool is_rest = lobe->kind == TRC_LOBE_REFRACT && lobe->fresnel != TRC_FRESNEL_NONE;
    return is_rest ? v3_sub(v3_splat(vf_one()), f) : f;
}

/* Chance that a micro-normal of paired lobes reflects. */
TRC_INLINE vfloat pair_chance(const struct trc_lobe *lobe, vfloat cos_m) {
    const vfloat f = v3_average(facet_reflectance(lobe, cos_m));
    return f / (f + (vf_one() - f) * lobe->pair_tint);
}
/* Densities of a lobe as those of its pair: this half is chosen in half of all cases, and then the
 * micro-normal has the say. */
TRC_INLINE void weigh_pair(const struct trc_lobe *lobe, vfloat cos_m, struct lobe_value *r) {
    if (!vm_any(lobe->paired))
        return;
    const vfloat reflects = pair_chance(lobe, cos_m);
    const vfloat own = lobe->kind == TRC_LOBE_REFRACT ? vf_one() - reflects : reflects;
    const vfloat factor = vf_select(lobe->paired, own + own, vf_one());
    r->pdf = r->pdf * factor;
    r->claim = r->claim * factor;
    r->pick = r->pick * factor;
}

/* D of GGX or Beckmann, masking of wi. */
TRC_INLINE vfloat distribution_d(const struct trc_lobe *lobe, const struct half_vector *h) {
    const vfloat alpha2 = lobe->alpha_x * lobe->alpha_y;
    if (lobe->distribution == TRC_LOBE_BECKMANN)
        return trc_beckmann_d(h->e, h->cos_m, alpha2);
    return trc_ggx_d(h->e, h->cos_m, alpha2);
}
TRC_INLINE vfloat masking(const struct trc_lobe *lobe, vfloat tan2) {
    return lobe->distribution == TRC_LOBE_BECKMANN ? trc_beckmann_g1(tan2) : trc_ggx_g1(tan2);
}

/* Masking of wo times shadowing of wi, over that of wo. With one height for both it is 1 / (1 + L_o
 * + L_i), where 1 / g1 = 1 + L. */
TRC_INLINE vfloat shadowing(const struct trc_lobe *lobe, vfloat tan2_i) {
    const vfloat g1_i = masking(lobe, tan2_i);
    if (!lobe->correlated)
        return g1_i;
    return vf_rcp(vf_one() + lobe->g1_o * (vf_rcp(g1_i) - vf_one()));
}

/* ---- setting up ---- */

/* The lowest alpha of Ashikhmin's distribution, which is ideal from there on, and of surfaces whose
 * missing energy is put back. */
#define MIN_ALPHA 1e-4f
/* Of what light that grazes is divided by. */
#define MIN_COSINE 1e-6f
/* Indices that close to 1 do not refract. */
#define NO_REFRACTION 1e-4f

TRC_INLINE uint32_t distribution_of(uint32_t mode) {
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
TRC_INLINE bool is_sharp(uint32_t mode) {
    return (mode & ~(uint32_t)TRC_DISTRIBUTION_CORRELATED) == TRC_DISTRIBUTION_SHARP;
}

/* Ratio of alpha_x to their mean, and of that to alpha_y, for an anisotropy in [0, 1] (B. Burley,
 * "Physically Based Shading at Disney", 2012). */
TRC_INLINE vfloat aspect_of(vfloat anisotropy) {
    return vf_safe_sqrt(vf_one() - vf_set(0.9f) * anisotropy);
}

TRC_INLINE void set_fresnel(struct trc_lobe *lobe, const struct trc_fresnel *fresnel) {
    lobe->fresnel = fresnel->kind;
    lobe->reflectance = fresnel->reflectance;
    lobe->film_colors = fresnel->film_colors;
    lobe->f0 = fresnel->f0;
    lobe->f90 = fresnel->f90;
}
/* From f0 at normal incidence to white. */
TRC_INLINE struct trc_fresnel blend_to_white(vvec3 f0) {
    return (struct trc_fresnel){.kind = TRC_FRESNEL_BLEND, .f0 = f0, .f90 = v3_splat(vf_one())};
}

/* Turns a lobe into one of Blender 3.4 that goes from f0 at normal incidence to f90, and accounts
 * for it in the chance. */
TRC_INLINE void set_overshoot(const struct trc_setup *c, struct trc_lobe *lobe, vvec3 f0,
                              vvec3 f90) {
    lobe->fresnel = TRC_FRESNEL_OVERSHOOT;
    lobe->f0 = f0;
    lobe->f90 = f90;
    const vfloat blend = trc_fresnel_overshoot(v3_dot(lobe->n, c->s->wo), lobe->ior);
    lobe->mix_weight = lobe->mix_weight * v3_average(v3_lerp(f0, f90, blend));
}

/* Mean over the cosine-weighted hemisphere of how far a dielectric is from its F0, after the fit of
 * Kulla and Conty (2017) to the mean of F. */
TRC_INLINE vfloat mean_blend(vfloat ior) {
    const vfloat eta = vf_max(ior, vf_rcp(ior));
    const vfloat f0 = trc_fresnel_normal(eta);
    const vfloat mean = (eta - vf_one()) / (vf_set(4.08567f) + vf_set(1.00071f) * eta);
    return vf_saturate((mean - f0) / (vf_one() - f0));
}

/* Bound on what bounces between facets let out of the light that comes back to them. */
#define MIN_KEPT 0.1f

/* What the bounces after the first keep where each takes a colour from the light, over what they
 * keep of white (Kulla and Conty 2017); mean: what one lets out, over the cosine-weighted
 * hemisphere. */
TRC_INLINE vvec3 colour_of_bounces(vvec3 per_bounce, vfloat mean) {
    const vfloat one = vf_one(), lost = one - mean, minimum = vf_set(MIN_KEPT);
    return v3(per_bounce.x * mean / vf_max(one - per_bounce.x * lost, minimum),
              per_bounce.y * mean / vf_max(one - per_bounce.y * lost, minimum),
              per_bounce.z * mean / vf_max(one - per_bounce.z * lost, minimum));
}

/* ---- kernels/lobe/facets.c ---- */

/* As trc_lobe_model.direction, of all distributions. */
vvec3 trc_facets_direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                           vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses);

/* As trc_lobe_model.value, of the reflection of all distributions. (kernels/lobe/reflection.c) */
struct lobe_value trc_reflection_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                       vvec3 wi);

/* What reflection and refraction need once alpha, ior and tangent are set. */
void trc_facets_finish(const struct trc_setup *c, struct trc_lobe *lobe, bool is_sharp);

/* The same of the twin of a lobe that is set up: it has the normal, distribution and alpha. */
void trc_facets_finish_twin(struct trc_lobe *lobe, const struct trc_lobe *of);

/* The lobe of the light that scatters more than once; per_bounce: colour of every bounce, the first
 * included where is_first (the Fresnel factor), else the first is in the weight already. Of an
 * anisotropic surface it has all that is missing, in the shape of the isotropic one of the same
 * alpha_x alpha_y. */
void trc_facets_set_multiple(struct trc_lobe *lobe, vvec3 wo, vvec3 per_bounce, bool is_first);

/* The same in Cycles 4: E. Turquin, "Practical Multiple Scattering Compensation for Microfacet
 * Models" (2019). The lobe of single scattering is scaled so that a white one keeps all energy; the
 * rest of the bounces have per_bounce as their colour. From then on it is an ordinary GGX lobe. */
void trc_facets_keep_energy(struct trc_lobe *lobe, vvec3 per_bounce);
/* What that scales a lobe by; single_out: the albedo of single scattering, white. */
vvec3 trc_facets_gain(vfloat cos_o, vfloat alpha, vvec3 per_bounce, vfloat *single_out);

#endif
