/* Texture operations, with the meanings of Cycles 3.4. */
#ifndef TRACER_KERNELS_PROGRAM_TEXTURE_H
#define TRACER_KERNELS_PROGRAM_TEXTURE_H

#include "kernels/program_input.h"
#include "kernels/texture.h"

TRC_INLINE const struct trc_image *image_of(const struct trc_surface *s, uint32_t resource) {
    return resource < s->snapshot->image_count ? s->snapshot->images[resource] : NULL;
}

/* A vector to the (u, v) of an image wrapped around it. The first two take directions, the others
 * coordinates in the unit cube. */
static void op_project(uint32_t mode, vvec3 d, vfloat *out) {
    const vfloat half = vf_set(0.5f), one = vf_one(), zero = vf_zero();
    if (mode == TRC_PROJECT_MIRROR_BALL) {
        d = v3_normalize(d);
        d.y = d.y - one;
        const vfloat length = vf_set(2.0f) * vf_safe_sqrt(-half * d.y);
        const vfloat inverse = vf_select(vf_gt(length, zero), vf_rcp(length), one);
        out[0] = half * (d.x * inverse + one);
        out[1] = half * (d.z * inverse + one);
        return;
    }
    if (mode == TRC_PROJECT_EQUIRECTANGULAR) {
        const vfloat length = v3_length(d);
        const vmask valid = vf_gt(length, zero);
        const vfloat z = d.z / vf_select(valid, length, one);
        out[0] = vf_where(valid, half - vf_atan2(d.y, d.x) * vf_set(0.5f * TRC_INV_PI));
        out[1] = vf_where(valid, one - vf_acos(z) * vf_set(TRC_INV_PI));
        return;
    }
    d = v3_scale(v3_sub(d, v3_splat(half)), vf_set(2.0f));
    const vmask sideways = vm_or(vf_ne(d.x, zero), vf_ne(d.y, zero));
    const vfloat around = vf_where(sideways, half - vf_atan2(d.x, d.y) * vf_set(0.5f * TRC_INV_PI));
    if (mode == TRC_PROJECT_TUBE) {
        out[0] = around;
        out[1] = vf_where(sideways, (d.z + one) * half);
        return;
    }
    const vfloat length = v3_length(d);
    const vmask valid = vf_gt(length, zero);
    const vfloat z = d.z / vf_select(valid, length, one);
    out[0] = around;
    out[1] = vf_where(valid, one - vf_acos(z) * vf_set(TRC_INV_PI));
}

/* Box projection without blending: the side that the object-space normal faces most. */
static void op_image_box(const struct trc_surface *s, const struct trc_image *image, uint32_t mode,
                         vvec3 co, vfloat *out) {
    const vvec3 n = op_object_normal(s), a = v3_abs(n);
    const vfloat zero = vf_zero(), one = vf_one();
    const vmask is_x = vm_and(vf_gt(a.x, a.y), vf_gt(a.x, a.z));
    const vmask is_y = vm_and(vf_gt(a.y, a.x), vf_gt(a.y, a.z));
    const vmask is_z = vm_and(vf_gt(a.z, a.x), vf_gt(a.z, a.y));
    /* Ties go to X, as in Cycles. */
    vfloat u = vf_select(vf_lt(n.x, zero), one - co.y, co.y), v = co.z;
    u = vf_select(is_y, vf_select(vf_gt(n.y, zero), one - co.x, co.x), u);
    u = vf_select(is_z, vf_select(vf_gt(n.z, zero), one - co.y, co.y), u);
    v = vf_select(vm_andnot(is_z, is_x), co.x, v);
    texture_lookup(image, mode, u, v, vf_zero(), s->active, out);
}

/* vector, color 1, color 2, scale -> color, factor */
static void op_checker(const vfloat *in, vfloat *out) {
    const vvec3 p = v3_scale(v3_read(in), in[9]), a = v3_read(in + 3), b = v3_read(in + 6);
    /* The shift and the shrinking keep whole coordinates off the edges. */
    const vfloat shift = vf_set(0.000001f), shrink = vf_set(0.999999f);
    const vint x = vf_to_int(vf_floor((p.x + shift) * shrink));
    const vint y = vf_to_int(vf_floor((p.y + shift) * shrink));
    const vint z = vf_to_int(vf_floor((p.z + shift) * shrink));
    const vmask first = vi_eq((x ^ y ^ z) & vi_set(1), vi_set(1));
    v3_write(out, v3_select(first, a, b));
    out[3] = vf_truth(first);
}

#endif
