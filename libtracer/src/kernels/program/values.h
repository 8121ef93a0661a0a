/* What operations of material programs share: vectors in arrays of floats, whole parts, remainders.
 */
#ifndef TRACER_KERNELS_PROGRAM_VALUES_H
#define TRACER_KERNELS_PROGRAM_VALUES_H

#include "kernels/simd/wide_math.h"

TRC_INLINE vvec3 v3_read(const vfloat *in) { return v3(in[0], in[1], in[2]); }
TRC_INLINE void v3_write(vfloat *out, vvec3 a) {
    out[0] = a.x;
    out[1] = a.y;
    out[2] = a.z;
}
TRC_INLINE vfloat vf_ceil(vfloat a) { return -vf_floor(-a); }
TRC_INLINE vfloat vf_trunc(vfloat a) { return vf_copysign(vf_floor(vf_abs(a)), a); }
/* 1 or 0. */
TRC_INLINE vfloat vf_truth(vmask m) { return vf_select(m, vf_one(), vf_zero()); }

/* The remainder with the sign of a; 0 where b is 0. */
TRC_INLINE vfloat math_modulo(vfloat a, vfloat b) {
    const vfloat size = vf_abs(b), quotient = vf_trunc(vf_divide(a, b));
    const vfloat product = quotient * b;
    vfloat r = (a - product) - vf_product_low(quotient, b, product);
    /* A quotient that was rounded up to the next whole number leaves a remainder of the other sign.
     */
    const vfloat step = vf_copysign(b, a);
    r = vf_select(vf_lt(r * a, vf_zero()), r + step, r);
    r = vf_select(vf_ge(vf_abs(r), size), r - step, r);
    r = vf_where(vf_ne(b, vf_zero()), vf_copysign(r, a));
    /* Where digits would be lost: lane by lane, exact. */
    vmask easy = vm_and(vf_gt(size, vf_set(1e-18f)), vf_lt(size, vf_set(1e18f)));
    easy = vm_and(easy, vf_lt(vf_abs(quotient), vf_set(4194304.0f)));
    uint32_t rest = TRC_LANE_BITS & ~vm_bits(vm_or(easy, vf_eq(b, vf_zero())));
    if (!rest)
        return r;
    float x[TRC_WIDTH];
    vf_store(x, r);
    for (; rest; rest &= rest - 1) {
        const int i = __builtin_ctz(rest);
        x[i] = fmodf(vf_get(a, i), vf_get(b, i));
    }
    return vf_load(x);
}

#endif
