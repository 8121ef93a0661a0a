/* Where rays go. Those that share their dominant axis and its side share a beam
 * (kernels/trace/walk.h), so packets are best of such rays. */
#ifndef TRACER_KERNELS_TRACE_DIRECTION_H
#define TRACER_KERNELS_TRACE_DIRECTION_H

#include "kernels/simd/simd.h"

/* Dominant axes, each with two sides. */
#define TRC_DIRECTIONS 6

/* Twice the dominant axis, and one more where the ray goes down it. */
TRC_INLINE vuint trc_direction_cell(vvec3 d) {
    const vfloat x = vf_abs(d.x), y = vf_abs(d.y), z = vf_abs(d.z);
    const vmask by_x = vm_and(vf_ge(x, y), vf_ge(x, z)), by_y = vf_ge(y, z);
    const vint axis = vi_select(by_x, vi_set(0), vi_select(by_y, vi_set(2), vi_set(4)));
    const vfloat along = vf_select(by_x, d.x, vf_select(by_y, d.y, d.z));
    return (vuint)(axis + vi_select(vf_lt(along, vf_set(0.0f)), vi_set(1), vi_set(0)));
}

#endif
