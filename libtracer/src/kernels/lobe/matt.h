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

/* Of a lobe that wi meets at cos_i to its normal, from the bare value f and density. */
TRC_INLINE struct lobe_value matt_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                        vvec3 wi, vfloat cos_i, vfloat f, vfloat density) {
    const vmask faces = vf_gt(cos_i, vf_zero());
    const vfloat bumps = bump_shadowing(s->n, lobe->n, wi, v3_dot(lobe->n, wi));
    const vfloat pdf = vf_where(faces, density);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(faces, f * bumps)), pdf, pdf, pdf};
}

/* Density of the cosine, and of directions spread evenly over the hemisphere, which Cycles samples
 * some lobes by. */
TRC_INLINE vfloat cosine_density(vfloat cos_i) { return cos_i * vf_set(TRC_INV_PI); }
TRC_INLINE vfloat even_density(void) { return vf_set(0.5f * TRC_INV_PI); }

#endif
