/* Cycles' clamps: a contribution whose channels' mean magnitude exceeds the limit is scaled down to
 * it. What goes to the passes is scaled by the same factor, so that they add up to Combined. */
#ifndef TRACER_KERNELS_LIGHT_CLAMP_H
#define TRACER_KERNELS_LIGHT_CLAMP_H

#include "kernels/simd/wide_math.h"
#include "tracer/render.h"

TRC_INLINE bool trc_clamps(const trc_render_desc *desc) {
    return desc->clamp_direct > 0.0f || desc->clamp_indirect > 0.0f;
}

/* The limit of lanes of direct light, of others that of indirect light; INFINITY: off. */
TRC_INLINE vfloat trc_clamp_limit(const trc_render_desc *desc, vmask is_direct) {
    const float direct = desc->clamp_direct > 0.0f ? desc->clamp_direct : INFINITY;
    const float indirect = desc->clamp_indirect > 0.0f ? desc->clamp_indirect : INFINITY;
    return vf_select(is_direct, vf_set(direct), vf_set(indirect));
}

/* What a contribution is to be multiplied by. */
TRC_INLINE vfloat trc_clamp_factor(vvec3 c, vfloat limit) {
    const vfloat sum = vf_abs(c.x) + vf_abs(c.y) + vf_abs(c.z), maximum = limit * vf_set(3.0f);
    const vmask over = vf_gt(sum, maximum);
    return vf_select(over, vf_divide(maximum, vf_select(over, sum, vf_set(1.0f))), vf_set(1.0f));
}

#endif
