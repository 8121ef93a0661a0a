/* Normals that a texture bent, turned back until what they reflect leaves the surface (Cycles). */
#ifndef TRACER_KERNELS_TRACE_VALID_NORMAL_H
#define TRACER_KERNELS_TRACE_VALID_NORMAL_H

#include "kernels/simd/wide_math.h"
#include "kernels/trace/surface.h"

/* What rounding may add to a square in [0, 1]. */
#define TRC_BEND_SLACK 1e-5f

/* Of two candidates for the squared z of the bent normal, the one whose mirror direction is valid;
 * see below. Returns x and z in the plane of ng and n. */
static void choose_bend(vfloat first2, vfloat second2, vfloat ix, vfloat iz, vfloat *x, vfloat *z,
                        vmask *any) {
    const vfloat minimum = vf_set(TRC_BEND_SLACK), maximum = vf_set(1.0f + TRC_BEND_SLACK);
    const vmask fits1 = vm_and(vf_gt(first2, minimum), vf_le(first2, maximum));
    const vmask fits2 = vm_and(vf_gt(second2, minimum), vf_le(second2, maximum));
    const vfloat x1 = vf_safe_sqrt(vf_one() - first2), z1 = vf_safe_sqrt(first2);
    const vfloat x2 = vf_safe_sqrt(vf_one() - second2), z2 = vf_safe_sqrt(second2);
    const vfloat r1 = vf_set(2.0f) * (x1 * ix + z1 * iz) * z1 - iz;
    const vfloat r2 = vf_set(2.0f) * (x2 * ix + z2 * iz) * z2 - iz;
    const vmask up1 = vf_ge(r1, minimum), up2 = vf_ge(r2, minimum);
    /* Both fit: the shallower of two valid mirrors, else the higher. */
    const vmask first_of_both =
        vm_or(vm_and(vm_and(up1, up2), vf_lt(r1, r2)), vm_andnot(vf_gt(r1, r2), vm_and(up1, up2)));
    const vmask use1 = vm_and(fits1, vm_or(vm_not(fits2), first_of_both));
    *x = vf_select(use1, x1, x2);
    *z = vf_select(use1, z1, z2);
    *any = vm_or(fits1, fits2);
}

/* How high the mirror direction must rise: less where the view itself is lower, as in Cycles. */
#define TRC_BEND_HEIGHT 0.01f
#define TRC_BEND_SHARE 0.9f

/* Turns n towards the geometric normal as little as makes the mirror direction of wo rise above the
 * surface by a threshold t. With z = ng and x = the part of n across it, the turned normal (x, 0,
 * z) satisfies 2 (x ix + z iz) z - iz = t, a quadratic in z^2 because x^2 = 1 - z^2. The geometric
 * normal stands in for what has no direction. */
static vvec3 valid_normal(const struct trc_surface *s, vvec3 n) {
    const vfloat iz = v3_dot(s->ng, s->wo);
    const vfloat t = vf_min(vf_set(TRC_BEND_SHARE) * iz, vf_set(TRC_BEND_HEIGHT));
    /* True for NaN too. */
    const vmask bad = vm_andnot(s->active, vf_ge(v3_dot(s->ng, v3_reflect(s->wo, n)), t));
    if (!vm_any(bad))
        return n;
    const vvec3 across = v3_normalize(v3_sub(n, v3_scale(s->ng, v3_dot(n, s->ng))));
    const vfloat ix = v3_dot(s->wo, across), ix2 = ix * ix;
    const vfloat a = ix2 + iz * iz;
    const vfloat b = vf_safe_sqrt(ix2 * (a - t * t));
    const vfloat c = iz * t + a;
    const vfloat half = vf_divide(vf_set(0.5f), a);
    vfloat x, z;
    vmask found;
    choose_bend(half * (c + b), half * (c - b), ix, iz, &x, &z, &found);
    const vvec3 turned = v3_mad(across, x, v3_scale(s->ng, z));
    /* What is too short, or of no length, has no side to turn from. */
    const vmask turns = vm_and(found, vf_gt(v3_dot(across, across), vf_zero()));
    return v3_select(bad, v3_select(turns, turned, s->ng), n);
}

#endif
