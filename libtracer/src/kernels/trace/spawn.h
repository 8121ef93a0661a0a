/* Where rays that leave a surface begin. */
#ifndef TRACER_KERNELS_TRACE_SPAWN_H
#define TRACER_KERNELS_TRACE_SPAWN_H

#include "kernels/trace/surface.h"

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

/* How far the box of the position's rounding error reaches along the geometric normal. */
TRC_INLINE vfloat trc_spawn_reach(const struct trc_surface *s) {
    return vf_abs(s->ng.x) * s->p_error.x + vf_abs(s->ng.y) * s->p_error.y +
           vf_abs(s->ng.z) * s->p_error.z;
}

/* Origin of a ray that leaves s, outside: to the side of its geometric normal. Moved along that
 * normal out of the box of the position's rounding error, then each coordinate to the next float
 * (Pharr, Jakob, Humphreys, "Physically Based Rendering", 3rd ed. 2016, section 3.9). */
TRC_INLINE vvec3 trc_spawn_origin(const struct trc_surface *s, vmask outside) {
    const vfloat reach = trc_spawn_reach(s);
    const vvec3 offset = v3_scale(s->ng, vf_select(outside, reach, -reach));
    return v3(trc_spawn_away(s->p.x, offset.x), trc_spawn_away(s->p.y, offset.y),
              trc_spawn_away(s->p.z, offset.z));
}

/* Cosine from which rays do not look back all the way: what they met would be somewhere else. */
#define TRC_GRAZING 1e-3f

/* How far a ray that leaves s from o in direction w looks back for surfaces of other instances that
 * coincide with s, 0 or below: a glass on a table, ice in water. Which of them a ray meets first is
 * left to rounding, and it starts beyond them all. It met s at a distance t from where it last
 * started; at 0 or below it had looked back.
 *
 * A ray that goes through s has one other to meet: it looks back neither from what it finds nor
 * where it comes from a surface as near as that. From what it finds, it is the reflected ray that
 * has to pass the first one again. */
TRC_INLINE vfloat trc_spawn_look_back(const struct trc_surface *s, vvec3 o, vvec3 w, vfloat t) {
    const vfloat zero = vf_set(0.0f), two = vf_set(2.0f);
    const vfloat cosine = v3_dot(w, s->ng);
    /* What the origin was moved by and both surfaces' errors: 0 on planes through the world's. */
    const vfloat moved = vf_abs(v3_dot(v3_sub(o, s->p), s->ng));
    const vfloat depth = vf_max(two * trc_spawn_reach(s) + moved, vf_set(1e-30f));
    const vfloat behind = -depth / vf_max(vf_abs(cosine), vf_set(TRC_GRAZING));
    const vmask through = vf_lt(cosine, zero);
    const vmask alone = vf_gt(t * v3_dot(s->wo, s->ng), two * depth);
    const vmask looks = vm_or(vm_and(through, alone), vm_andnot(vf_le(t, zero), through));
    /* Not as far as where the ray came from. */
    const vfloat maximum = vf_select(through, vf_set(-0.5f) * t, behind);
    return vf_select(looks, vf_max(behind, maximum), zero);
}

#endif
