/* Where rays that leave a surface begin. */
#ifndef TRACER_KERNELS_SPAWN_H
#define TRACER_KERNELS_SPAWN_H

#include "kernels/surface.h"

/* One float further in the direction of the offset than x + offset: the bits of a float count
 * upwards with its magnitude. */
TRC_INLINE vfloat trc_spawn_away(vfloat x, vfloat offset) {
    const vfloat moved = x + offset;
    const vint bits = vf_as_int(moved);
    const vmask up = vm_not(vf_lt(moved * offset, vf_set(0.0f)));
    const vint next = bits + vi_select(up, vi_set(1), vi_set(-1));
    return vf_select(vm_or(vf_eq(offset, vf_set(0.0f)), vf_eq(moved, vf_set(0.0f))), moved,
                     vi_as_float(next));
}

/* Origin of a ray that leaves s, outside: to the side of its geometric normal. Moved along that
 * normal out of the box of the position's rounding error, then each coordinate to the next float
 * (Pharr, Jakob, Humphreys, "Physically Based Rendering", 3rd ed. 2016, section 3.9). */
TRC_INLINE vvec3 trc_spawn_origin(const struct trc_surface *s, vmask outside) {
    const vfloat reach = vf_abs(s->ng.x) * s->p_error.x + vf_abs(s->ng.y) * s->p_error.y +
                         vf_abs(s->ng.z) * s->p_error.z;
    const vvec3 offset = v3_scale(s->ng, vf_select(outside, reach, -reach));
    return v3(trc_spawn_away(s->p.x, offset.x), trc_spawn_away(s->p.y, offset.y),
              trc_spawn_away(s->p.z, offset.z));
}

#endif
