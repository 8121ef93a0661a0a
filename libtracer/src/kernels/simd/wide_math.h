/* Elementary functions, hashes, frames and sampling warps on TRC_WIDTH lanes.
 *
 * No function here calls libm (square roots apart) and none branches on data, so every width gives
 * the same bits. Errors in units in the last place (ulp) are the bounds
 * tests/kernels/test_wide_math.c holds them to. Denormal results may be flushed to zero.
 *
 * Sources: S. L. Moshier, Cephes mathematical library 2.8 (1995), polynomials of sin, cos, exp,
 * log, asin, atan in single precision; W. J. Cody and W. Waite, "Software Manual for the Elementary
 * Functions" (1980), argument reduction; T. J. Dekker, "A floating-point technique for extending
 * the available precision" (1971), products in pow; M. Giles, "Approximating the erfinv function"
 * (2012). */
#ifndef TRACER_KERNELS_SIMD_WIDE_MATH_H
#define TRACER_KERNELS_SIMD_WIDE_MATH_H

#include "kernels/simd/simd.h"

#define TRC_PI 3.14159265358979f
#define TRC_TWO_PI 6.28318530717959f
#define TRC_HALF_PI 1.57079632679490f
#define TRC_INV_PI 0.318309886183791f
/* The largest number below 1: ends of what is drawn from [0, 1). */
#define TRC_BELOW_ONE 0x1.fffffep-1f

/* ---- small helpers ---- */

TRC_INLINE vfloat vf_zero(void) { return vf_set(0.0f); }
TRC_INLINE vfloat vf_one(void) { return vf_set(1.0f); }
TRC_INLINE vfloat vf_rcp(vfloat a) { return vf_one() / a; }
/* a / b, 0 where b is 0. */
TRC_INLINE vfloat vf_divide(vfloat a, vfloat b) {
    return vf_select(vf_ne(b, vf_zero()), a / b, vf_zero());
}
TRC_INLINE vfloat vf_safe_sqrt(vfloat a) { return vf_sqrt(vf_max(a, vf_zero())); }
TRC_INLINE vfloat vf_square(vfloat a) { return a * a; }
TRC_INLINE vfloat vf_saturate(vfloat a) { return vf_clamp(a, 0.0f, 1.0f); }
TRC_INLINE vfloat vf_where(vmask m, vfloat a) { return vf_select(m, a, vf_zero()); }
TRC_INLINE vfloat vf_lerp(vfloat a, vfloat b, vfloat t) { return a * (vf_one() - t) + b * t; }
/* To the nearest whole number, for |a| < 2^22. */
TRC_INLINE vfloat vf_round(vfloat a) {
    const vfloat magic = vf_set(12582912.0f);
    return (a + magic) - magic;
}
TRC_INLINE vvec3 v3_where(vmask m, vvec3 a) {
    return v3(vf_where(m, a.x), vf_where(m, a.y), vf_where(m, a.z));
}
TRC_INLINE vvec3 v3_abs(vvec3 a) { return v3(vf_abs(a.x), vf_abs(a.y), vf_abs(a.z)); }
TRC_INLINE vvec3 v3_mad(vvec3 a, vfloat s, vvec3 b) {
    return v3(a.x * s + b.x, a.y * s + b.y, a.z * s + b.z);
}
TRC_INLINE vvec3 v3_saturate(vvec3 a) {
    return v3(vf_saturate(a.x), vf_saturate(a.y), vf_saturate(a.z));
}
TRC_INLINE vvec3 v3_lerp(vvec3 a, vvec3 b, vfloat t) {
    return v3(vf_lerp(a.x, b.x, t), vf_lerp(a.y, b.y, t), vf_lerp(a.z, b.z, t));
}
/* Length that comes back with the unit vector; zero stays zero. */
TRC_INLINE vvec3 v3_normalize_length(vvec3 a, vfloat *length) {
    *length = v3_length(a);
    return v3_scale(a, vf_divide(vf_one(), *length));
}
/* Rec.709 luminance. */
TRC_INLINE vfloat v3_luminance(vvec3 c) {
    return c.x * vf_set(0.2126729f) + c.y * vf_set(0.7151522f) + c.z * vf_set(0.0721750f);
}

/* ---- trigonometry ---- */

/* sin and cos of r in [-pi/4, pi/4], 1 ulp. */
TRC_INLINE void vf_sincos_octant(vfloat r, vfloat *s, vfloat *c) {
    const vfloat z = r * r;
    vfloat ps = vf_set(-1.9515295891e-4f);
    ps = ps * z + vf_set(8.3321608736e-3f);
    ps = ps * z + vf_set(-1.6666654611e-1f);
    *s = ps * z * r + r;
    vfloat pc = vf_set(2.443315711809948e-5f);
    pc = pc * z + vf_set(-1.388731625493765e-3f);
    pc = pc * z + vf_set(4.166664568298827e-2f);
    *c = pc * z * z - vf_set(0.5f) * z + vf_one();
}

/* Turns sin and cos of the remainder into those of remainder + quadrant * pi/2. */
TRC_INLINE void vf_sincos_quadrant(vint quadrant, vfloat s, vfloat c, vfloat *sin_out,
                                   vfloat *cos_out) {
    const vint sin_sign = (vint)((vuint)(quadrant & vi_set(2)) << 30);
    const vint cos_sign = (vint)((vuint)((quadrant + vi_set(1)) & vi_set(2)) << 30);
    const vmask swap = vi_eq(quadrant & vi_set(1), vi_set(1));
    *sin_out = vi_as_float(vf_as_int(vf_select(swap, c, s)) ^ sin_sign);
    *cos_out = vi_as_float(vf_as_int(vf_select(swap, s, c)) ^ cos_sign);
}

/* 2 ulp for |x| <= 8192 (near multiples of pi/2: absolute error 2^-24 instead); larger arguments
 * lose digits in proportion. */
TRC_INLINE void vf_sincos(vfloat x, vfloat *s, vfloat *c) {
    const vfloat q = vf_round(vf_clamp(x * vf_set(0.636619772367581f), -4.0e6f, 4.0e6f));
    /* pi/2 in three parts of at most 11 bits each but the last: products with q are exact. */
    vfloat r = x - q * vf_set(1.5703125f);
    r = r - q * vf_set(4.837512969970703125e-4f);
    r = r - q * vf_set(7.54978995489188216e-8f);
    vfloat rs, rc;
    vf_sincos_octant(r, &rs, &rc);
    vf_sincos_quadrant(vf_to_int(q), rs, rc, s, c);
}
/* sin and cos of 2 pi turns, 2 ulp for |turns| < 2^20: for sampling, where angles come as
 * fractions. */
TRC_INLINE void vf_sincos_turns(vfloat turns, vfloat *s, vfloat *c) {
    const vfloat q = vf_round(turns * vf_set(4.0f));
    vfloat rs, rc;
    vf_sincos_octant((turns - q * vf_set(0.25f)) * vf_set(TRC_TWO_PI), &rs, &rc);
    vf_sincos_quadrant(vf_to_int(q), rs, rc, s, c);
}
TRC_INLINE vfloat vf_sin(vfloat x) {
    vfloat s, c;
    vf_sincos(x, &s, &c);
    return s;
}
TRC_INLINE vfloat vf_cos(vfloat x) {
    vfloat s, c;
    vf_sincos(x, &s, &c);
    return c;
}
/* 4 ulp under the conditions of vf_sincos. */
TRC_INLINE vfloat vf_tan(vfloat x) {
    vfloat s, c;
    vf_sincos(x, &s, &c);
    return s / c;
}

/* asin of x in [0, 0.5]; z = x * x. */
TRC_INLINE vfloat vf_asin_core(vfloat x, vfloat z) {
    vfloat p = vf_set(4.2163199048e-2f);
    p = p * z + vf_set(2.4181311049e-2f);
    p = p * z + vf_set(4.5470025998e-2f);
    p = p * z + vf_set(7.4953002686e-2f);
    p = p * z + vf_set(1.6666752422e-1f);
    return p * z * x + x;
}
/* 3 ulp; arguments are clamped to [-1, 1]. */
TRC_INLINE vfloat vf_acos(vfloat x) {
    const vfloat a = vf_min(vf_abs(x), vf_one());
    const vmask large = vf_gt(a, vf_set(0.5f));
    const vfloat z = vf_select(large, (vf_one() - a) * vf_set(0.5f), a * a);
    const vfloat core = vf_asin_core(vf_select(large, vf_sqrt(z), a), z);
    /* a > 1/2: acos a = 2 asin sqrt((1 - a) / 2), else pi/2 - asin a; acos(-a) = pi - acos a. */
    const vmask negative = vf_lt(x, vf_zero());
    const vfloat outer = vf_set(2.0f) * core;
    const vfloat outer_negative = (vf_set(TRC_PI) - outer) + vf_set(-8.742278e-8f);
    const vfloat signed_core = vf_copysign(core, x);
    const vfloat inner = vf_set(TRC_HALF_PI) - (signed_core - vf_set(-4.371139e-8f));
    return vf_select(large, vf_select(negative, outer_negative, outer), inner);
}
/* 3 ulp; arguments are clamped to [-1, 1]. */
TRC_INLINE vfloat vf_asin(vfloat x) {
    const vfloat a = vf_min(vf_abs(x), vf_one());
    const vmask large = vf_gt(a, vf_set(0.5f));
    if (!vm_any(large)) /* the same bits without the root */
        return vf_copysign(vf_asin_core(a, a * a), x);
    const vfloat z = vf_select(large, (vf_one() - a) * vf_set(0.5f), a * a);
    const vfloat core = vf_asin_core(vf_select(large, vf_sqrt(z), a), z);
    const vfloat outer = vf_set(TRC_HALF_PI) - (vf_set(2.0f) * core - vf_set(-4.371139e-8f));
    return vf_copysign(vf_select(large, outer, core), x);
}
/* atan of q in [0, 1]. */
TRC_INLINE vfloat vf_atan_core(vfloat num, vfloat den) {
    /* Above tan(pi/8): atan(n / d) = pi/4 + atan((n - d) / (n + d)). */
    const vmask upper = vf_gt(num, den * vf_set(0.414213562f));
    const vfloat q = vf_select(upper, num - den, num) / vf_select(upper, num + den, den);
    const vfloat z = q * q;
    vfloat p = vf_set(8.05374449538e-2f);
    p = p * z + vf_set(-1.38776856032e-1f);
    p = p * z + vf_set(1.99777106478e-1f);
    p = p * z + vf_set(-3.33329491539e-1f);
    return vf_select(upper, vf_set(0.785398163397448f), vf_zero()) + (p * z * q + q);
}
/* Angle of (x, y) in [-pi, pi], 4 ulp; atan2(0, 0) is 0 or pi by the sign of x. */
TRC_INLINE vfloat vf_atan2(vfloat y, vfloat x) {
    const vfloat ax = vf_abs(x), ay = vf_abs(y);
    const vfloat low = vf_min(ax, ay), high = vf_max(ax, ay);
    const vfloat first = vf_atan_core(low, vf_select(vf_gt(high, vf_zero()), high, vf_one()));
    const vfloat half = vf_set(TRC_HALF_PI) - (first - vf_set(-4.371139e-8f));
    const vfloat acute = vf_select(vf_gt(ay, ax), half, first);
    const vfloat obtuse = vf_set(TRC_PI) - (acute - vf_set(-8.742278e-8f));
    const vmask left = vi_lt(vf_as_int(x), vi_set(0));
    return vf_copysign(vf_select(left, obtuse, acute), y);
}
TRC_INLINE vfloat vf_atan(vfloat x) {
    const vfloat a = vf_abs(x);
    const vmask above = vf_gt(a, vf_one());
    const vfloat q = vf_atan_core(vf_select(above, vf_one(), a), vf_select(above, a, vf_one()));
    const vfloat high = vf_set(TRC_HALF_PI) - (q - vf_set(-4.371139e-8f));
    return vf_copysign(vf_select(above, high, q), x);
}

/* ---- exponentials ---- */

/* 2^n for whole n in [-252, 254], in two factors so that neither overflows. */
TRC_INLINE vfloat vf_scale_by_power(vfloat a, vint n) {
    const vint half = n >> 1;
    const vfloat f = vi_as_float((half + vi_set(127)) << 23);
    const vfloat g = vi_as_float((n - half + vi_set(127)) << 23);
    return a * f * g;
}
/* e^r for |r| <= ln 2 / 2. */
TRC_INLINE vfloat vf_exp_core(vfloat r) {
    vfloat p = vf_set(1.9875691500e-4f);
    p = p * r + vf_set(1.3981999507e-3f);
    p = p * r + vf_set(8.3334519073e-3f);
    p = p * r + vf_set(4.1665795894e-2f);
    p = p * r + vf_set(1.6666665459e-1f);
    p = p * r + vf_set(5.0000001201e-1f);
    return (p * r * r + r) + vf_one();
}
/* 2 ulp; below -87.3 the result goes to 0 within the denormal range, above 88.72 it is infinite. */
TRC_INLINE vfloat vf_exp(vfloat x) {
    const vfloat clamped = vf_clamp(x, -110.0f, 90.0f);
    const vfloat n = vf_round(clamped * vf_set(1.44269504088896f));
    vfloat r = clamped - n * vf_set(0.693359375f);
    r = r - n * vf_set(-2.12194440e-4f);
    return vf_scale_by_power(vf_exp_core(r), vf_to_int(n));
}
/* 2^(x + low), 2 ulp; low a small correction. */
TRC_INLINE vfloat vf_exp2_split(vfloat x, vfloat low) {
    const vfloat clamped = vf_clamp(x, -160.0f, 130.0f);
    const vfloat n = vf_round(clamped);
    const vfloat f = (clamped - n) + low;
    return vf_scale_by_power(vf_exp_core(f * vf_set(0.693147180559945f)), vf_to_int(n));
}

/* x = m * 2^e with m in [sqrt(1/2), sqrt(2)), for normal and denormal x > 0. */
TRC_INLINE vfloat vf_split_exponent(vfloat x, vfloat *e) {
    const vmask tiny = vf_lt(x, vf_set(1.17549435e-38f));
    const vint bits = vf_as_int(vf_select(tiny, x * vf_set(8388608.0f), x));
    const vint offset = bits - vi_set(0x3f3504f3);
    const vint power = offset >> 23;
    *e = vi_to_float(power) - vf_select(tiny, vf_set(23.0f), vf_zero());
    return vi_as_float((offset & vi_set(0x007fffff)) + vi_set(0x3f3504f3));
}
TRC_INLINE vfloat vf_log_special(vfloat x, vfloat result) {
    const vfloat infinity = vf_set(INFINITY);
    result = vf_select(vf_eq(x, infinity), infinity, result);
    result = vf_select(vf_eq(x, vf_zero()), -infinity, result);
    return vf_select(vf_lt(x, vf_zero()), vf_set(NAN), result);
}
/* Natural logarithm, 2 ulp; log 0 = -inf, NaN below. */
TRC_INLINE vfloat vf_log(vfloat x) {
    vfloat e;
    const vfloat f = vf_split_exponent(x, &e) - vf_one();
    const vfloat z = f * f;
    vfloat p = vf_set(7.0376836292e-2f);
    p = p * f + vf_set(-1.1514610310e-1f);
    p = p * f + vf_set(1.1676998740e-1f);
    p = p * f + vf_set(-1.2420140846e-1f);
    p = p * f + vf_set(1.4249322787e-1f);
    p = p * f + vf_set(-1.6668057665e-1f);
    p = p * f + vf_set(2.0000714765e-1f);
    p = p * f + vf_set(-2.4999993993e-1f);
    p = p * f + vf_set(3.3333331174e-1f);
    vfloat y = p * z * f;
    y = y + e * vf_set(-2.12194440e-4f);
    y = y - vf_set(0.5f) * z;
    y = f + y;
    return vf_log_special(x, y + e * vf_set(0.693359375f));
}

/* log(1 + x) for x > -1, 4 ulp (W. Kahan's correction of the rounded sum). */
TRC_INLINE vfloat vf_log1p(vfloat x) {
    const vfloat sum = vf_one() + x, kept = sum - vf_one();
    return vf_select(vf_eq(kept, vf_zero()), x, vf_log(sum) * (x / kept));
}

/* a * b as high + low, exact (Dekker) while nothing overflows. */
TRC_INLINE vfloat vf_product_low(vfloat a, vfloat b, vfloat high) {
    const vint upper = vi_set((int32_t)0xfffff000);
    const vfloat a1 = vi_as_float(vf_as_int(a) & upper), a2 = a - a1;
    const vfloat b1 = vi_as_float(vf_as_int(b) & upper), b2 = b - b1;
    return ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2;
}
/* log2 of x > 0 as high + low, relative error about 2^-34. */
TRC_INLINE void vf_log2_split(vfloat x, vfloat *high, vfloat *low) {
    vfloat e;
    const vfloat m = vf_split_exponent(x, &e);
    /* log2 m = 2/ln2 (s + s^3/3 + s^5/5 + ...), s = (m - 1) / (m + 1); only s needs a second
     * word. */
    const vfloat f = m - vf_one();
    const vfloat d = m + vf_one(), d_low = m - (d - vf_one());
    const vfloat s = f / d;
    const vfloat sd = s * d;
    const vfloat s_low = (((f - sd) - vf_product_low(s, d, sd)) - s * d_low) / d;
    const vfloat z = s * s;
    vfloat p = vf_set(0.262308189f);
    p = p * z + vf_set(0.320598898f);
    p = p * z + vf_set(0.412198583f);
    p = p * z + vf_set(0.577078016f);
    p = p * z + vf_set(0.961796694f);
    const vfloat c = vf_set(2.88539004f), c_low = vf_set(3.8519256e-8f);
    const vfloat sc = s * c;
    vfloat rest = vf_product_low(s, c, sc) + (s * c_low + s_low * c);
    rest = rest + p * z * s;
    const vfloat sum = e + sc;
    const vfloat sum_low = (e - sum) + sc;
    /* |e| >= |sc| or e == 0 makes this two-sum exact. */
    *high = sum + (sum_low + rest);
    *low = (sum - *high) + (sum_low + rest);
}
/* x^y for x >= 0, 4 ulp; 0^y is 0 for y > 0, 1 for y == 0, infinite for y < 0. Negative x is
 * NaN. */
TRC_INLINE vfloat vf_pow(vfloat x, vfloat y) {
    vfloat high, low;
    vf_log2_split(vf_max(x, vf_set(1e-45f)), &high, &low);
    const vfloat product = y * high;
    const vfloat product_low = vf_product_low(y, high, product) + y * low;
    vfloat r = vf_exp2_split(product, product_low);
    const vfloat at_zero = vf_select(vf_gt(y, vf_zero()), vf_zero(), vf_set(INFINITY));
    r = vf_select(vf_eq(x, vf_zero()), at_zero, r);
    r = vf_select(vf_lt(x, vf_zero()), vf_set(NAN), r);
    r = vf_select(vf_eq(x, vf_one()), vf_one(), r);
    return vf_select(vf_eq(y, vf_zero()), vf_one(), r);
}

/* Error function, absolute error 7e-7 (Abramowitz and Stegun 1964, 7.1.26 has 1.5e-7 before
 * rounding). */
TRC_INLINE vfloat vf_erf(vfloat x) {
    const vfloat a = vf_min(vf_abs(x), vf_set(6.0f));
    const vfloat t = vf_rcp(vf_one() + vf_set(0.3275911f) * a);
    vfloat p = vf_set(1.061405429f);
    p = p * t + vf_set(-1.453152027f);
    p = p * t + vf_set(1.421413741f);
    p = p * t + vf_set(-0.284496736f);
    p = p * t + vf_set(0.254829592f);
    return vf_copysign(vf_one() - p * t * vf_exp(-a * a), x);
}
/* Inverse of the error function for |x| < 1, relative error 1e-6 inside |x| < 0.9999. */
TRC_INLINE vfloat vf_erfinv(vfloat x) {
    const vfloat c = vf_clamp(x, -0.99999994f, 0.99999994f);
    const vfloat w = -vf_log((vf_one() - c) * (vf_one() + c));
    const vfloat a = w - vf_set(2.5f);
    vfloat p = vf_set(2.81022636e-08f);
    p = p * a + vf_set(3.43273939e-07f);
    p = p * a + vf_set(-3.5233877e-06f);
    p = p * a + vf_set(-4.39150654e-06f);
    p = p * a + vf_set(0.00021858087f);
    p = p * a + vf_set(-0.00125372503f);
    p = p * a + vf_set(-0.00417768164f);
    p = p * a + vf_set(0.246640727f);
    p = p * a + vf_set(1.50140941f);
    const vfloat b = vf_sqrt(vf_max(w, vf_zero())) - vf_set(3.0f);
    vfloat q = vf_set(-0.000200214257f);
    q = q * b + vf_set(0.000100950558f);
    q = q * b + vf_set(0.00134934322f);
    q = q * b + vf_set(-0.00367342844f);
    q = q * b + vf_set(0.00573950773f);
    q = q * b + vf_set(-0.0076224613f);
    q = q * b + vf_set(0.00943887047f);
    q = q * b + vf_set(1.00167406f);
    q = q * b + vf_set(2.83297682f);
    return vf_select(vf_lt(w, vf_set(5.0f)), p, q) * c;
}

/* ---- hashes ---- */

/* A bijective finalizer with low bias (C. Wellons and others, "lowbias32", 2018). */
TRC_INLINE vuint vu_hash(vuint x) {
    x ^= x >> 16;
    x *= vu_set(0x21f0aaadu);
    x ^= x >> 15;
    x *= vu_set(0xd35a2d97u);
    return x ^ (x >> 15);
}
TRC_INLINE vuint vu_hash2(vuint a, vuint b) {
    return vu_hash(a ^ (vu_hash(b) + vu_set(0x9e3779b9u)));
}

/* ---- frames ---- */

/* Two unit vectors that make a right-handed frame (a, b, n) with the unit vector n.
 * T. Duff et al., "Building an Orthonormal Basis, Revisited" (2017). */
TRC_INLINE void v3_frame(vvec3 n, vvec3 *a, vvec3 *b) {
    const vfloat sign = vf_copysign(vf_one(), n.z);
    const vfloat s = -vf_one() / (sign + n.z);
    const vfloat t = n.x * n.y * s;
    *a = v3(vf_one() + sign * n.x * n.x * s, sign * t, -sign * n.x);
    *b = v3(t, sign + n.y * n.y * s, -n.y);
}
TRC_INLINE vvec3 v3_to_frame(vvec3 v, vvec3 a, vvec3 b, vvec3 n) {
    return v3(v3_dot(v, a), v3_dot(v, b), v3_dot(v, n));
}
TRC_INLINE vvec3 v3_from_frame(vvec3 l, vvec3 a, vvec3 b, vvec3 n) {
    return v3_mad(a, l.x, v3_mad(b, l.y, v3_scale(n, l.z)));
}
/* Mirror of v about the unit vector m. */
TRC_INLINE vvec3 v3_reflect(vvec3 v, vvec3 m) {
    return v3_sub(v3_scale(m, vf_set(2.0f) * v3_dot(v, m)), v);
}

/* ---- warps of the unit square ---- */

/* Unit disk, area-preserving and continuous: P. Shirley and K. Chiu, "A Low Distortion Map Between
 * Disk and Square" (1997). */
TRC_INLINE void trc_warp_disk(vfloat u1, vfloat u2, vfloat *x, vfloat *y) {
    const vfloat a = vf_set(2.0f) * u1 - vf_one(), b = vf_set(2.0f) * u2 - vf_one();
    const vmask wide = vf_gt(a * a, b * b);
    const vfloat r = vf_select(wide, a, b);
    /* An eighth of a turn times the quotient, counted from the x or the y axis. */
    const vfloat part = vf_set(0.125f) * vf_divide(vf_select(wide, b, a), r);
    vfloat s, c;
    vf_sincos_octant(part * vf_set(TRC_TWO_PI), &s, &c);
    *x = r * vf_select(wide, c, s);
    *y = r * vf_select(wide, s, c);
}
/* Upper hemisphere with density cos / pi. */
TRC_INLINE vvec3 trc_warp_cosine(vfloat u1, vfloat u2) {
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    return v3(x, y, vf_safe_sqrt(vf_one() - x * x - y * y));
}
/* Sphere, density 1 / (4 pi). */
TRC_INLINE vvec3 trc_warp_sphere(vfloat u1, vfloat u2) {
    vfloat s, c;
    vf_sincos_turns(u2, &s, &c);
    const vfloat z = vf_one() - vf_set(2.0f) * u1;
    const vfloat r = vf_safe_sqrt(vf_one() - z * z);
    return v3(r * c, r * s, z);
}
/* Cone about z whose half angle has the cosine cos_max: density 1 / (2 pi (1 - cos_max)). */
TRC_INLINE vvec3 trc_warp_cone(vfloat cos_max, vfloat u1, vfloat u2) {
    vfloat s, c;
    vf_sincos_turns(u2, &s, &c);
    const vfloat z = vf_one() - u1 * (vf_one() - cos_max);
    const vfloat r = vf_safe_sqrt((vf_one() - z) * (vf_one() + z));
    return v3(r * c, r * s, z);
}
/* Barycentrics of the second and third vertex, uniform by area: E. Heitz, "A Low-Distortion Map
 * Between Triangle and Square" (2019). */
TRC_INLINE void trc_warp_triangle(vfloat u1, vfloat u2, vfloat *b1, vfloat *b2) {
    const vmask upper = vf_gt(u2, u1);
    const vfloat half1 = vf_set(0.5f) * u1, half2 = vf_set(0.5f) * u2;
    *b1 = vf_select(upper, half1, u1 - half2);
    *b2 = vf_select(upper, u2 - half1, half2);
}

#endif
