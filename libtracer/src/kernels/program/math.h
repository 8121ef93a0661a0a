/* Operations on floats and vectors, with the meanings of Cycles 3.4: Math, Vector Math, Clamp, Map
 * Range, Mapping. Each reads all its inputs before it writes. */
#ifndef TRACER_KERNELS_PROGRAM_MATH_H
#define TRACER_KERNELS_PROGRAM_MATH_H

#include <float.h>
#include <math.h>

#include "kernels/program/values.h"
#include "model/program.h"

/* ---- floats ---- */

/* a^b; 0 for a negative base unless the exponent is whole. */
static vfloat math_power(vfloat a, vfloat b) {
    const vmask negative = vf_lt(a, vf_zero());
    const vfloat magnitude = vf_pow(vf_abs(a), b);
    const vfloat half = b * vf_set(0.5f);
    const vmask whole = vf_eq(vf_floor(b), b), even = vf_eq(vf_floor(half), half);
    const vfloat below = vf_select(even, magnitude, -magnitude);
    return vf_select(negative, vf_where(whole, below), magnitude);
}

static vfloat math_logarithm(vfloat a, vfloat b) {
    const vmask valid = vm_and(vf_gt(a, vf_zero()), vf_gt(b, vf_zero()));
    const vfloat one = vf_one();
    return vf_where(valid,
                    vf_divide(vf_log(vf_select(valid, a, one)), vf_log(vf_select(valid, b, one))));
}

static vfloat math_wrap(vfloat value, vfloat high, vfloat low) {
    const vfloat range = high - low;
    const vfloat wrapped = value - range * vf_floor((value - low) / range);
    return vf_select(vf_ne(range, vf_zero()), wrapped, low);
}

TRC_INLINE vfloat math_snap(vfloat a, vfloat b) { return vf_floor(vf_divide(a, b)) * b; }

static vfloat math_ping_pong(vfloat a, vfloat b) {
    const vfloat x = (a - b) / (b * vf_set(2.0f));
    const vfloat folded = vf_abs((x - vf_floor(x)) * b * vf_set(2.0f) - b);
    return vf_where(vf_ne(b, vf_zero()), folded);
}

static vfloat math_smooth_min(vfloat a, vfloat b, vfloat k) {
    const vfloat h = vf_divide(vf_max(k - vf_abs(a - b), vf_zero()), k);
    return vf_min(a, b) - h * h * h * k * vf_set(1.0f / 6.0f);
}

/* sinh, accurate near 0, without early overflow. */
static vfloat math_sinh(vfloat x) {
    const vfloat a = vf_abs(x), z = x * x;
    vfloat p = vf_set(1.0f / 5040.0f);
    p = p * z + vf_set(1.0f / 120.0f);
    p = p * z + vf_set(1.0f / 6.0f);
    const vfloat near = p * z * x + x;
    const vfloat e = vf_exp(a - vf_set(0.693147180559945f)); /* e^|x| / 2 */
    const vfloat far = vf_copysign(e - vf_set(0.25f) / e, x);
    return vf_select(vf_lt(a, vf_set(0.5f)), near, far);
}
static vfloat math_cosh(vfloat x) {
    const vfloat e = vf_exp(vf_abs(x) - vf_set(0.693147180559945f));
    return e + vf_set(0.25f) / e;
}
static vfloat math_tanh(vfloat x) {
    const vfloat a = vf_min(vf_abs(x), vf_set(10.0f));
    const vfloat far = vf_one() - vf_set(2.0f) / (vf_exp(a + a) + vf_one());
    return vf_select(vf_lt(a, vf_set(0.5f)), math_sinh(x) / math_cosh(x), vf_copysign(far, x));
}

static vfloat math_sign(vfloat a) {
    const vfloat sign = vf_select(vf_lt(a, vf_zero()), vf_set(-1.0f), vf_one());
    return vf_select(vf_eq(a, vf_zero()), vf_zero(), sign);
}

static vfloat math_compare(vfloat a, vfloat b, vfloat c) {
    const vmask near = vf_le(vf_abs(a - b), vf_max(c, vf_set(FLT_EPSILON)));
    return vf_truth(vm_or(vf_eq(a, b), near));
}

/* Up to which angles in radians vf_sincos has all digits. */
#define TRC_LARGEST_ANGLE 8192.0f

/* Larger angles, one after the other by the C library. */
static __attribute__((noinline)) vfloat of_large_angles(vfloat x, vfloat small,
                                                        float (*function)(float)) {
    const uint32_t large = vm_bits(vf_gt(vf_abs(x), vf_set(TRC_LARGEST_ANGLE)));
    float values[TRC_WIDTH];
    vf_store(values, small);
    for (uint32_t rest = large; rest; rest &= rest - 1) {
        const int lane = __builtin_ctz(rest);
        values[lane] = function(vf_get(x, lane));
    }
    return vf_load(values);
}

TRC_INLINE bool has_large_angle(vfloat x) {
    return vm_any(vf_gt(vf_abs(x), vf_set(TRC_LARGEST_ANGLE)));
}

static vfloat math_sine(vfloat x) {
    const vfloat small = vf_sin(x);
    return has_large_angle(x) ? of_large_angles(x, small, sinf) : small;
}
static vfloat math_cosine(vfloat x) {
    const vfloat small = vf_cos(x);
    return has_large_angle(x) ? of_large_angles(x, small, cosf) : small;
}
static vfloat math_tangent(vfloat x) {
    const vfloat small = vf_tan(x);
    return has_large_angle(x) ? of_large_angles(x, small, tanf) : small;
}

/* Ties go up. */
static vfloat math_round(vfloat a) { return vf_floor(a + vf_set(0.5f)); }

/* The Math node without its clamp. Long because it is the list of its modes. */
static vfloat op_math(uint32_t mode, vfloat a, vfloat b, vfloat c) {
    switch (mode) {
    case TRC_MATH_ADD:
        return a + b;
    case TRC_MATH_SUBTRACT:
        return a - b;
    case TRC_MATH_MULTIPLY:
        return a * b;
    case TRC_MATH_DIVIDE:
        return vf_divide(a, b);
    case TRC_MATH_MULTIPLY_ADD:
        return a * b + c;
    case TRC_MATH_POWER:
        return math_power(a, b);
    case TRC_MATH_LOGARITHM:
        return math_logarithm(a, b);
    case TRC_MATH_SQRT:
        return vf_safe_sqrt(a);
    case TRC_MATH_INVERSE_SQRT:
        return vf_where(vf_gt(a, vf_zero()), vf_rcp(vf_safe_sqrt(a)));
    case TRC_MATH_ABSOLUTE:
        return vf_abs(a);
    case TRC_MATH_EXPONENT:
        return vf_exp(a);
    case TRC_MATH_MINIMUM:
        return vf_min(a, b);
    case TRC_MATH_MAXIMUM:
        return vf_max(a, b);
    case TRC_MATH_LESS_THAN:
        return vf_truth(vf_lt(a, b));
    case TRC_MATH_GREATER_THAN:
        return vf_truth(vf_gt(a, b));
    case TRC_MATH_SIGN:
        return math_sign(a);
    case TRC_MATH_COMPARE:
        return math_compare(a, b, c);
    case TRC_MATH_SMOOTH_MIN:
        return math_smooth_min(a, b, c);
    case TRC_MATH_SMOOTH_MAX:
        return -math_smooth_min(-a, -b, c);
    case TRC_MATH_ROUND:
        return math_round(a);
    case TRC_MATH_FLOOR:
        return vf_floor(a);
    case TRC_MATH_CEIL:
        return vf_ceil(a);
    case TRC_MATH_TRUNC:
        return vf_trunc(a);
    case TRC_MATH_FRACT:
        return a - vf_floor(a);
    case TRC_MATH_MODULO:
        return math_modulo(a, b);
    case TRC_MATH_WRAP:
        return math_wrap(a, b, c);
    case TRC_MATH_SNAP:
        return math_snap(a, b);
    case TRC_MATH_PINGPONG:
        return math_ping_pong(a, b);
    case TRC_MATH_SINE:
        return math_sine(a);
    case TRC_MATH_COSINE:
        return math_cosine(a);
    case TRC_MATH_TANGENT:
        return math_tangent(a);
    case TRC_MATH_ARCSINE:
        return vf_asin(a);
    case TRC_MATH_ARCCOSINE:
        return vf_acos(a);
    case TRC_MATH_ARCTANGENT:
        return vf_atan(a);
    case TRC_MATH_ARCTAN2:
        return vf_atan2(a, b);
    case TRC_MATH_SINH:
        return math_sinh(a);
    case TRC_MATH_COSH:
        return math_cosh(a);
    case TRC_MATH_TANH:
        return math_tanh(a);
    case TRC_MATH_RADIANS:
        return a * vf_set(TRC_PI / 180.0f);
    case TRC_MATH_DEGREES:
        return a * vf_set(180.0f / TRC_PI);
    default:
        return vf_zero();
    }
}

TRC_INLINE vfloat op_clamp(uint32_t mode, vfloat value, vfloat low, vfloat high) {
    if (mode == TRC_CLAMP_MINMAX)
        return vf_min(vf_max(value, low), high);
    return vf_min(vf_max(value, vf_min(low, high)), vf_max(low, high));
}

/* An empty source range gives 0. */
TRC_INLINE vfloat op_map_range(const vfloat *in) {
    const vfloat from_min = in[TRC_OP_AT(MAP_RANGE, from_min)];
    const vfloat from_max = in[TRC_OP_AT(MAP_RANGE, from_max)];
    const vfloat to_min = in[TRC_OP_AT(MAP_RANGE, to_min)];
    const vfloat to_max = in[TRC_OP_AT(MAP_RANGE, to_max)];
    const vfloat from = from_max - from_min;
    const vfloat factor = (in[TRC_OP_AT(MAP_RANGE, value)] - from_min) / from;
    return vf_where(vf_ne(from_max, from_min), to_min + factor * (to_max - to_min));
}

/* ---- vectors ---- */

TRC_INLINE vvec3 v3_divide(vvec3 a, vvec3 b) {
    return v3(vf_divide(a.x, b.x), vf_divide(a.y, b.y), vf_divide(a.z, b.z));
}
TRC_INLINE vvec3 v3_min(vvec3 a, vvec3 b) {
    return v3(vf_min(a.x, b.x), vf_min(a.y, b.y), vf_min(a.z, b.z));
}
TRC_INLINE vvec3 v3_max_each(vvec3 a, vvec3 b) {
    return v3(vf_max(a.x, b.x), vf_max(a.y, b.y), vf_max(a.z, b.z));
}
TRC_INLINE vvec3 v3_floor(vvec3 a) { return v3(vf_floor(a.x), vf_floor(a.y), vf_floor(a.z)); }

/* Along b; 0 where b is 0. */
static vvec3 vector_project(vvec3 a, vvec3 b) {
    return v3_scale(b, vf_divide(v3_dot(a, b), v3_dot(b, b)));
}
static vvec3 vector_reflect(vvec3 a, vvec3 b) {
    const vvec3 n = v3_normalize(b);
    return v3_sub(a, v3_scale(v3_scale(n, vf_set(2.0f)), v3_dot(a, n)));
}

/* Bent at a surface of normal b, which is made unit; 0 where all is reflected. */
static vvec3 vector_refract(vvec3 i, vvec3 b, vfloat ior) {
    const vvec3 n = v3_normalize(b);
    const vfloat cosine = v3_dot(n, i), one = vf_one();
    const vfloat k = one - ior * ior * (one - cosine * cosine);
    const vfloat along = ior * cosine + vf_safe_sqrt(k);
    const vmask reflected = vf_lt(k, vf_zero());
    return v3_select(reflected, v3_zero(), v3_sub(v3_scale(i, ior), v3_scale(n, along)));
}

static vvec3 op_vector_math(uint32_t mode, vvec3 a, vvec3 b, vvec3 c, vfloat scale) {
    switch (mode) {
    case TRC_VECTOR_ADD:
        return v3_add(a, b);
    case TRC_VECTOR_SUBTRACT:
        return v3_sub(a, b);
    case TRC_VECTOR_MULTIPLY:
        return v3_mul(a, b);
    case TRC_VECTOR_DIVIDE:
        return v3_divide(a, b);
    case TRC_VECTOR_MULTIPLY_ADD:
        return v3_add(v3_mul(a, b), c);
    case TRC_VECTOR_CROSS:
        return v3_cross(a, b);
    case TRC_VECTOR_PROJECT:
        return vector_project(a, b);
    case TRC_VECTOR_REFLECT:
        return vector_reflect(a, b);
    case TRC_VECTOR_SCALE:
        return v3_scale(a, scale);
    case TRC_VECTOR_NORMALIZE:
        return v3_normalize(a);
    case TRC_VECTOR_ABSOLUTE:
        return v3_abs(a);
    case TRC_VECTOR_MINIMUM:
        return v3_min(a, b);
    case TRC_VECTOR_MAXIMUM:
        return v3_max_each(a, b);
    case TRC_VECTOR_FLOOR:
        return v3_floor(a);
    case TRC_VECTOR_CEIL:
        return v3(vf_ceil(a.x), vf_ceil(a.y), vf_ceil(a.z));
    case TRC_VECTOR_FRACT:
        return v3_sub(a, v3_floor(a));
    case TRC_VECTOR_SINE:
        return v3(math_sine(a.x), math_sine(a.y), math_sine(a.z));
    case TRC_VECTOR_COSINE:
        return v3(math_cosine(a.x), math_cosine(a.y), math_cosine(a.z));
    case TRC_VECTOR_TANGENT:
        return v3(math_tangent(a.x), math_tangent(a.y), math_tangent(a.z));
    case TRC_VECTOR_SNAP:
        return v3(math_snap(a.x, b.x), math_snap(a.y, b.y), math_snap(a.z, b.z));
    case TRC_VECTOR_MODULO:
        return v3(math_modulo(a.x, b.x), math_modulo(a.y, b.y), math_modulo(a.z, b.z));
    case TRC_VECTOR_WRAP:
        return v3(math_wrap(a.x, b.x, c.x), math_wrap(a.y, b.y, c.y), math_wrap(a.z, b.z, c.z));
    case TRC_VECTOR_FACEFORWARD:
        return v3_select(vf_lt(v3_dot(c, b), vf_zero()), a, v3_neg(a));
    case TRC_VECTOR_REFRACT:
        return vector_refract(a, b, scale);
    case TRC_VECTOR_ROUND:
        return v3(math_round(a.x), math_round(a.y), math_round(a.z));
    case TRC_VECTOR_SIGN:
        return v3(math_sign(a.x), math_sign(a.y), math_sign(a.z));
    case TRC_VECTOR_POWER:
        return v3(math_power(a.x, b.x), math_power(a.y, b.y), math_power(a.z, b.z));
    default:
        return v3_zero();
    }
}

TRC_INLINE vfloat op_vector_measure(uint32_t mode, vvec3 a, vvec3 b) {
    switch (mode) {
    case TRC_VECTOR_DOT:
        return v3_dot(a, b);
    case TRC_VECTOR_DISTANCE:
        return v3_length(v3_sub(a, b));
    case TRC_VECTOR_LENGTH:
        return v3_length(a);
    default:
        return vf_zero();
    }
}

/* Rotation about X, then Y, then Z. */
static void op_rotation(vvec3 angles, vfloat *out) {
    vfloat sx, cx, sy, cy, sz, cz;
    vf_sincos(angles.x, &sx, &cx);
    vf_sincos(angles.y, &sy, &cy);
    vf_sincos(angles.z, &sz, &cz);
    v3_write(out + TRC_OP_OUT_AT(ROTATION, row0),
             v3(cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz));
    v3_write(out + TRC_OP_OUT_AT(ROTATION, row1),
             v3(cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz));
    v3_write(out + TRC_OP_OUT_AT(ROTATION, row2), v3(-sy, cy * sx, cy * cx));
}

/* Rotation about an axis of any length; none about 0. */
static void op_axis_rotation(vvec3 axis, vfloat angle, vfloat *out) {
    const vvec3 a = v3_normalize(axis);
    vfloat s, c;
    vf_sincos(angle, &s, &c);
    const vmask valid = vf_gt(v3_dot(axis, axis), vf_zero());
    c = vf_select(valid, c, vf_one());
    const vvec3 t = v3_scale(a, vf_one() - c);
    v3_write(out + TRC_OP_OUT_AT(AXIS_ROTATION, row0),
             v3(c + a.x * t.x, a.x * t.y - s * a.z, a.x * t.z + s * a.y));
    v3_write(out + TRC_OP_OUT_AT(AXIS_ROTATION, row1),
             v3(a.x * t.y + s * a.z, c + a.y * t.y, a.y * t.z - s * a.x));
    v3_write(out + TRC_OP_OUT_AT(AXIS_ROTATION, row2),
             v3(a.x * t.z - s * a.y, a.y * t.z + s * a.x, c + a.z * t.z));
}

static vvec3 op_mapping(uint32_t mode, const vfloat *in) {
    vvec3 v = v3_read(in + TRC_OP_AT(MAPPING, vector));
    const vvec3 location = v3_read(in + TRC_OP_AT(MAPPING, location));
    const vvec3 scale = v3_read(in + TRC_OP_AT(MAPPING, scale));
    const vvec3 r0 = v3_read(in + TRC_OP_AT(MAPPING, row0));
    const vvec3 r1 = v3_read(in + TRC_OP_AT(MAPPING, row1));
    const vvec3 r2 = v3_read(in + TRC_OP_AT(MAPPING, row2));
    if (mode == TRC_MAPPING_TEXTURE) {
        v = v3_sub(v, location);
        v = v3(v.x * r0.x + v.y * r1.x + v.z * r2.x, v.x * r0.y + v.y * r1.y + v.z * r2.y,
               v.x * r0.z + v.y * r1.z + v.z * r2.z);
        return v3_divide(v, scale);
    }
    v = mode == TRC_MAPPING_NORMAL ? v3_divide(v, scale) : v3_mul(v, scale);
    v = v3(v3_dot(r0, v), v3_dot(r1, v), v3_dot(r2, v));
    if (mode == TRC_MAPPING_POINT)
        return v3_add(v, location);
    return mode == TRC_MAPPING_NORMAL ? v3_normalize(v) : v;
}

#endif
