/* Texture operations, with the meanings of Cycles 3.4. */
#ifndef TRACER_KERNELS_PROGRAM_TEXTURE_H
#define TRACER_KERNELS_PROGRAM_TEXTURE_H

#include "kernels/program/input.h"
#include "kernels/program/lookup.h"

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
        out[TRC_OP_OUT_AT(PROJECT, u)] = half * (d.x * inverse + one);
        out[TRC_OP_OUT_AT(PROJECT, v)] = half * (d.z * inverse + one);
        return;
    }
    if (mode == TRC_PROJECT_EQUIRECTANGULAR) {
        const vfloat length = v3_length(d);
        const vmask valid = vf_gt(length, zero);
        const vfloat z = d.z / vf_select(valid, length, one);
        out[TRC_OP_OUT_AT(PROJECT, u)] =
            vf_where(valid, half - vf_atan2(d.y, d.x) * vf_set(0.5f * TRC_INV_PI));
        out[TRC_OP_OUT_AT(PROJECT, v)] = vf_where(valid, one - vf_acos(z) * vf_set(TRC_INV_PI));
        return;
    }
    d = v3_scale(v3_sub(d, v3_splat(half)), vf_set(2.0f));
    const vmask sideways = vm_or(vf_ne(d.x, zero), vf_ne(d.y, zero));
    const vfloat around = vf_where(sideways, half - vf_atan2(d.x, d.y) * vf_set(0.5f * TRC_INV_PI));
    if (mode == TRC_PROJECT_TUBE) {
        out[TRC_OP_OUT_AT(PROJECT, u)] = around;
        out[TRC_OP_OUT_AT(PROJECT, v)] = vf_where(sideways, (d.z + one) * half);
        return;
    }
    const vfloat length = v3_length(d);
    const vmask valid = vf_gt(length, zero);
    const vfloat z = d.z / vf_select(valid, length, one);
    out[TRC_OP_OUT_AT(PROJECT, u)] = around;
    out[TRC_OP_OUT_AT(PROJECT, v)] = vf_where(valid, one - vf_acos(z) * vf_set(TRC_INV_PI));
}

/* Where the sides of a box that face along an axis show an image, seen without mirroring. */
static void box_side(vvec3 co, vvec3 n, int axis, vfloat *u, vfloat *v) {
    const vfloat zero = vf_zero(), one = vf_one();
    if (axis == 0) {
        *u = vf_select(vf_lt(n.x, zero), one - co.y, co.y);
        *v = co.z;
    } else if (axis == 1) {
        *u = vf_select(vf_gt(n.y, zero), one - co.x, co.x);
        *v = co.z;
    } else {
        *u = vf_select(vf_gt(n.z, zero), one - co.y, co.y);
        *v = co.x;
    }
}

/* How much of each pair of sides a normal with components a sees, as in Cycles: in the middle of a
 * side that alone, towards an edge two and towards a corner three; blend (above 0) is how much of
 * the way is mixed. */
static void box_weights(const vfloat a[3], vfloat blend, vfloat w[3]) {
    const vfloat zero = vf_zero(), one = vf_one(), half = vf_set(0.5f);
    const vfloat limit = half * (one + blend), sum = a[0] + a[1] + a[2];
    vmask left = vm_all_set();
    for (int k = 0; k < 3; k++) /* towards a corner */
        w[k] = ((vf_set(2.0f) - limit) * (a[k] / sum) + limit - one) / blend;
    for (int k = 0; k < 3; k++) { /* one alone */
        const int p = (k + 1) % 3, q = (k + 2) % 3;
        const vmask alone = vm_and(
            left, vm_and(vf_gt(a[k], limit * (a[k] + a[p])), vf_gt(a[k], limit * (a[k] + a[q]))));
        w[k] = vf_select(alone, one, w[k]);
        w[p] = vf_select(alone, zero, w[p]);
        w[q] = vf_select(alone, zero, w[q]);
        left = vm_andnot(left, alone);
    }
    for (int k = 0; k < 3; k++) { /* two, where k is far */
        const int p = (k + 1) % 3, q = (k + 2) % 3;
        const vmask pair = vm_and(left, vf_lt(a[k], (one - limit) * (a[p] + a[q])));
        const vfloat share = vf_saturate((a[p] / (a[p] + a[q]) - half * (one - blend)) / blend);
        w[k] = vf_select(pair, zero, w[k]);
        w[p] = vf_select(pair, share, w[p]);
        w[q] = vf_select(pair, one - share, w[q]);
        left = vm_andnot(left, pair);
    }
}

/* Box projection by the object-space normal. Without blend the side that it faces most; ties go to
 * X, as in Cycles. */
static void op_image_box(const struct trc_surface *s, const struct trc_image *image, uint32_t mode,
                         vvec3 co, vfloat blend, vfloat *out) {
    const vvec3 n = op_object_normal(s), a = v3_abs(n);
    const vfloat zero = vf_zero();
    vfloat u[3], v[3];
    for (int axis = 0; axis < 3; axis++)
        box_side(co, n, axis, &u[axis], &v[axis]);
    if (!vm_any(vf_gt(blend, zero))) {
        const vmask is_y = vm_and(vf_gt(a.y, a.x), vf_gt(a.y, a.z));
        const vmask is_z = vm_and(vf_gt(a.z, a.x), vf_gt(a.z, a.y));
        texture_lookup(image, mode, vf_select(is_z, u[2], vf_select(is_y, u[1], u[0])),
                       vf_select(is_z, v[2], vf_select(is_y, v[1], v[0])), zero, s->active, out);
        return;
    }
    vfloat w[3], side[4];
    box_weights((vfloat[3]){a.x, a.y, a.z}, blend, w);
    for (int c = 0; c < 4; c++)
        out[c] = zero;
    for (int axis = 0; axis < 3; axis++) {
        const vmask seen = vm_and(s->active, vf_gt(w[axis], zero));
        if (!vm_any(seen))
            continue;
        texture_lookup(image, mode, u[axis], v[axis], zero, seen, side);
        for (int c = 0; c < 4; c++)
            out[c] = out[c] + vf_select(seen, w[axis] * side[c], zero);
    }
}

static void op_checker(const vfloat *in, vfloat *out) {
    const vvec3 p =
        v3_scale(v3_read(in + TRC_OP_AT(CHECKER, vector)), in[TRC_OP_AT(CHECKER, scale)]);
    const vvec3 a = v3_read(in + TRC_OP_AT(CHECKER, color1));
    const vvec3 b = v3_read(in + TRC_OP_AT(CHECKER, color2));
    /* The shift and the shrinking keep whole coordinates off the edges. */
    const vfloat shift = vf_set(0.000001f), shrink = vf_set(0.999999f);
    const vint x = vf_to_int(vf_floor((p.x + shift) * shrink));
    const vint y = vf_to_int(vf_floor((p.y + shift) * shrink));
    const vint z = vf_to_int(vf_floor((p.z + shift) * shrink));
    const vmask first = vi_eq((x ^ y ^ z) & vi_set(1), vi_set(1));
    v3_write(out + TRC_OP_OUT_AT(CHECKER, color), v3_select(first, a, b));
    out[TRC_OP_OUT_AT(CHECKER, factor)] = vf_truth(first);
}

#endif
