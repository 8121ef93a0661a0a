/* What diffuse lobes share: from the value of the bare model to that of the lobe. */
#ifndef TRACER_KERNELS_LOBE_MATT_H
#define TRACER_KERNELS_LOBE_MATT_H

#include "kernels/lobe/lobe.h"

/* Softens the terminator of normals bent by a texture: M. J.-Y. Chiang, Y. K. Li and B. Burley,
 * "Taming the Shadow Terminator" (2019). */
TRC_INLINE vfloat bump_shadowing(vvec3 n_surface, vvec3 n_lobe, vvec3 wi, vfloat cos_i) {
    const vfloat g = vf_divide(v3_dot(n_surface, wi), cos_i * v3_dot(n_surface, n_lobe));
    const vfloat g2 = g * g;
    const vfloat soft = vf_select(vf_ge(g, vf_one()), vf_one(), g + g2 - g2 * g);
    return vf_select(vf_lt(g, vf_zero()), vf_zero(), soft);
}

/* The same by the masking of microfacets of GGX, as rough as the normal is bent: A. Conty Estevez,
 * P. Lecocq and C. Stein, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator
 * Problem" (2019). */
TRC_INLINE vfloat facet_shadowing(vvec3 n_surface, vvec3 n_lobe, vvec3 wi, vfloat cos_lobe) {
    const vfloat cos_i = v3_dot(n_surface, wi), cos_d = v3_dot(n_surface, n_lobe);
    const vfloat cos2_i = vf_max(cos_i * cos_i, vf_set(1e-12f));
    const vfloat cos2_d = vf_min(cos_d * cos_d, vf_one());
    const vfloat alpha2 = vf_saturate(vf_set(0.125f) * vf_divide(vf_one() - cos2_d, cos2_d));
    const vfloat tan2_i = (vf_one() - vf_min(cos2_i, vf_one())) / cos2_i;
    const vfloat masking = vf_set(2.0f) / (vf_one() + vf_sqrt(vf_one() + alpha2 * tan2_i));
    /* Of both sides, as light may come through. */
    return vf_where(vf_ge(cos_i * cos_d * cos_lobe, vf_zero()), masking);
}

TRC_INLINE vfloat bump_shadowing_of(const struct trc_lobe *lobe, const struct trc_surface *s,
                                    vvec3 wi, vfloat cos_i) {
    return lobe->facet_shadowing ? facet_shadowing(s->n, lobe->n, wi, cos_i)
                                 : bump_shadowing(s->n, lobe->n, wi, cos_i);
}

/* Of a lobe that wi meets at cos_i to its normal, from the bare value f and density; bumps leave no
 * shadow on it. */
TRC_INLINE struct lobe_value upper_value(const struct trc_lobe *lobe, vfloat cos_i, vfloat f,
                                         vfloat density) {
    const vmask faces = vf_gt(cos_i, vf_zero());
    const vfloat pdf = vf_where(faces, density);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(faces, f)), pdf, pdf, pdf};
}

/* The same where they do. */
TRC_INLINE struct lobe_value matt_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                        vvec3 wi, vfloat cos_i, vfloat f, vfloat density) {
    const vfloat bumps = bump_shadowing_of(lobe, s, wi, v3_dot(lobe->n, wi));
    return upper_value(lobe, cos_i, f * bumps, density);
}

/* Density of the cosine, and of directions spread evenly over the hemisphere, which Cycles samples
 * some lobes by. */
TRC_INLINE vfloat cosine_density(vfloat cos_i) { return cos_i * vf_set(TRC_INV_PI); }
TRC_INLINE vfloat even_density(void) { return vf_set(0.5f * TRC_INV_PI); }

#endif
