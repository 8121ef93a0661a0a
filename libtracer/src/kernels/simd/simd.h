/* The vector types of the kernels: TRC_WIDTH lanes of float and 32-bit integers.
 *
 * One kernel source is compiled once per instruction set with TRC_WIDTH 1, 4, 8 or 16; arithmetic
 * is the compiler's infix arithmetic on vector types, the rest is here. Lanes are independent,
 * there is no contraction (-ffp-contract=off), so every width gives the same bits for the same
 * operations. */
#ifndef TRACER_KERNELS_SIMD_SIMD_H
#define TRACER_KERNELS_SIMD_SIMD_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "kernels/simd/names.h"

#if TRC_WIDTH > 1 && (defined(__x86_64__) || defined(_M_X64))
#include <immintrin.h>
#elif TRC_WIDTH > 1 && defined(__aarch64__)
#include <arm_neon.h>
#endif

#define TRC_INLINE static inline __attribute__((always_inline, unused))

#if TRC_WIDTH == 1
typedef float vfloat;
typedef int32_t vint;
typedef uint32_t vuint;
#else
typedef float vfloat __attribute__((vector_size(4 * TRC_WIDTH)));
typedef int32_t vint __attribute__((vector_size(4 * TRC_WIDTH)));
typedef uint32_t vuint __attribute__((vector_size(4 * TRC_WIDTH)));
#endif

#if TRC_WIDTH == 16
typedef __mmask16 vmask; /* one bit per lane */
#else
typedef vint vmask; /* all bits of a lane set or none */
#endif

#define TRC_LANE_BITS ((uint32_t)((1ull << TRC_WIDTH) - 1u))

/* ---- broadcast, load, store (no alignment required) ---- */

TRC_INLINE vfloat vf_set(float a) {
#if TRC_WIDTH == 1
    return a;
#elif TRC_WIDTH == 4
    return (vfloat){a, a, a, a};
#elif TRC_WIDTH == 8
    return (vfloat){a, a, a, a, a, a, a, a};
#else
    return (vfloat){a, a, a, a, a, a, a, a, a, a, a, a, a, a, a, a};
#endif
}

TRC_INLINE vint vi_set(int32_t a) {
#if TRC_WIDTH == 1
    return a;
#elif TRC_WIDTH == 4
    return (vint){a, a, a, a};
#elif TRC_WIDTH == 8
    return (vint){a, a, a, a, a, a, a, a};
#else
    return (vint){a, a, a, a, a, a, a, a, a, a, a, a, a, a, a, a};
#endif
}

TRC_INLINE vuint vu_set(uint32_t a) { return (vuint)vi_set((int32_t)a); }

TRC_INLINE vfloat vf_load(const float *p) {
    vfloat v;
    memcpy(&v, p, sizeof v);
    return v;
}
TRC_INLINE void vf_store(float *p, vfloat v) { memcpy(p, &v, sizeof v); }
TRC_INLINE vint vi_load(const int32_t *p) {
    vint v;
    memcpy(&v, p, sizeof v);
    return v;
}
TRC_INLINE void vi_store(int32_t *p, vint v) { memcpy(p, &v, sizeof v); }
TRC_INLINE vuint vu_load(const uint32_t *p) {
    vuint v;
    memcpy(&v, p, sizeof v);
    return v;
}
TRC_INLINE void vu_store(uint32_t *p, vuint v) { memcpy(p, &v, sizeof v); }

/* 0, 1, 2, ... */
TRC_INLINE vint vi_lane(void) {
#if TRC_WIDTH == 1
    return 0;
#elif TRC_WIDTH == 4
    return (vint){0, 1, 2, 3};
#elif TRC_WIDTH == 8
    return (vint){0, 1, 2, 3, 4, 5, 6, 7};
#else
    return (vint){0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
#endif
}

/* ---- bit casts and conversions ---- */

TRC_INLINE vint vf_as_int(vfloat a) {
    vint r;
    memcpy(&r, &a, sizeof r);
    return r;
}
TRC_INLINE vfloat vi_as_float(vint a) {
    vfloat r;
    memcpy(&r, &a, sizeof r);
    return r;
}
TRC_INLINE vuint vf_as_uint(vfloat a) { return (vuint)vf_as_int(a); }

/* Rounds towards zero; values outside int32 give INT32_MIN. */
TRC_INLINE vint vf_to_int(vfloat a) {
#if TRC_WIDTH == 1
    return (a >= -2147483648.0f && a < 2147483648.0f) ? (int32_t)a : INT32_MIN;
#elif TRC_WIDTH == 16
    return (vint)_mm512_cvttps_epi32(a);
#elif TRC_WIDTH == 8 && defined(__AVX2__)
    return (vint)_mm256_cvttps_epi32(a);
#elif TRC_WIDTH == 4 && defined(__SSE2__)
    return (vint)_mm_cvttps_epi32(a);
#else
    /* What is too large or not a number would give the nearest or 0. */
    const vint fits = (vint)(a < vf_set(0x1p31f));
    return (__builtin_convertvector(a, vint) & fits) | (vi_set(INT32_MIN) & ~fits);
#endif
}
TRC_INLINE vfloat vi_to_float(vint a) {
#if TRC_WIDTH == 1
    return (float)a;
#else
    return __builtin_convertvector(a, vfloat);
#endif
}
/* [0, 1): the top 24 bits over 2^24, exact. */
TRC_INLINE vfloat vu_to_unit(vuint a) { return vi_to_float((vint)(a >> 8)) * vf_set(0x1p-24f); }

/* ---- comparisons (false for NaN, except vf_ne) ---- */

#if TRC_WIDTH == 16
#define TRC_VF_COMPARE(name, op, imm) \
    TRC_INLINE vmask name(vfloat a, vfloat b) { return _mm512_cmp_ps_mask(a, b, imm); }
#else
#define TRC_VF_COMPARE(name, op, imm) \
    TRC_INLINE vmask name(vfloat a, vfloat b) { return TRC_LANES(a op b); }
#if TRC_WIDTH == 1
#define TRC_LANES(x) (-(int32_t)(x))
#else
#define TRC_LANES(x) ((vint)(x))
#endif
#endif
TRC_VF_COMPARE(vf_lt, <, _CMP_LT_OQ)
TRC_VF_COMPARE(vf_le, <=, _CMP_LE_OQ)
TRC_VF_COMPARE(vf_gt, >, _CMP_GT_OQ)
TRC_VF_COMPARE(vf_ge, >=, _CMP_GE_OQ)
TRC_VF_COMPARE(vf_eq, ==, _CMP_EQ_OQ)
TRC_VF_COMPARE(vf_ne, !=, _CMP_NEQ_UQ)

#if TRC_WIDTH == 16
TRC_INLINE vmask vi_eq(vint a, vint b) { return _mm512_cmpeq_epi32_mask((__m512i)a, (__m512i)b); }
TRC_INLINE vmask vi_lt(vint a, vint b) { return _mm512_cmplt_epi32_mask((__m512i)a, (__m512i)b); }
#else
TRC_INLINE vmask vi_eq(vint a, vint b) { return TRC_LANES(a == b); }
TRC_INLINE vmask vi_lt(vint a, vint b) { return TRC_LANES(a < b); }
#endif

/* ---- masks ---- */

#if TRC_WIDTH == 16
TRC_INLINE uint32_t vm_bits(vmask m) { return m; }
TRC_INLINE vmask vm_from_bits(uint32_t bits) { return (vmask)bits; }
TRC_INLINE vmask vm_none(void) { return 0; }
TRC_INLINE vmask vm_all_set(void) { return (vmask)0xffff; }
TRC_INLINE vmask vm_and(vmask a, vmask b) { return (vmask)(a & b); }
TRC_INLINE vmask vm_or(vmask a, vmask b) { return (vmask)(a | b); }
TRC_INLINE vmask vm_andnot(vmask a, vmask b) { return (vmask)(a & ~b); } /* a and not b */
TRC_INLINE vmask vm_not(vmask a) { return (vmask)~a; }
#else
TRC_INLINE uint32_t vm_bits(vmask m) {
#if TRC_WIDTH == 1
    return (uint32_t)m & 1u;
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return (uint32_t)_mm256_movemask_ps((__m256)m);
#elif TRC_WIDTH == 4 && defined(__SSE__)
    return (uint32_t)_mm_movemask_ps((__m128)m);
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return vaddvq_u32((uint32x4_t)(m & (vint){1, 2, 4, 8}));
#else
    uint32_t bits = 0;
    for (int i = 0; i < TRC_WIDTH; i++)
        bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
#endif
}
TRC_INLINE vmask vm_from_bits(uint32_t bits) {
#if TRC_WIDTH == 1
    return -(int32_t)(bits & 1u);
#else
    const vint one = vi_set(1) << vi_lane();
    return (vmask)((vi_set((int32_t)bits) & one) == one);
#endif
}
TRC_INLINE vmask vm_none(void) { return vi_set(0); }
TRC_INLINE vmask vm_all_set(void) { return vi_set(-1); }
TRC_INLINE vmask vm_and(vmask a, vmask b) { return a & b; }
TRC_INLINE vmask vm_or(vmask a, vmask b) { return a | b; }
TRC_INLINE vmask vm_andnot(vmask a, vmask b) { return a & ~b; } /* a and not b */
TRC_INLINE vmask vm_not(vmask a) { return ~a; }
#endif
TRC_INLINE bool vm_any(vmask m) { return vm_bits(m) != 0; }
TRC_INLINE bool vm_all(vmask m) { return vm_bits(m) == TRC_LANE_BITS; }
/* The first n lanes (n may exceed the width or be negative). */
TRC_INLINE vmask vm_first(int32_t n) { return vi_lt(vi_lane(), vi_set(n)); }

/* ---- selection: lanes of a where m, else of b ---- */

TRC_INLINE vmask vm_select(vmask m, vmask a, vmask b) {
    return vm_or(vm_and(m, a), vm_andnot(b, m));
}
TRC_INLINE vfloat vf_select(vmask m, vfloat a, vfloat b) {
#if TRC_WIDTH == 1
    return m ? a : b;
#elif TRC_WIDTH == 16
    return _mm512_mask_blend_ps(m, b, a);
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return _mm256_blendv_ps(b, a, (__m256)m);
#elif TRC_WIDTH == 4 && defined(__SSE4_1__)
    return _mm_blendv_ps(b, a, (__m128)m);
#else
    return vi_as_float((vf_as_int(a) & m) | (vf_as_int(b) & ~m));
#endif
}
TRC_INLINE vint vi_select(vmask m, vint a, vint b) {
#if TRC_WIDTH == 1
    return m ? a : b;
#elif TRC_WIDTH == 16
    return (vint)_mm512_mask_blend_epi32(m, (__m512i)b, (__m512i)a);
#else
    return (a & m) | (b & ~m);
#endif
}

/* ---- arithmetic ---- */

/* b where either is NaN, as the x86 instructions. */
TRC_INLINE vfloat vf_min(vfloat a, vfloat b) {
#if TRC_WIDTH == 16
    return _mm512_min_ps(a, b);
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return _mm256_min_ps(a, b);
#elif TRC_WIDTH == 4 && defined(__SSE__)
    return _mm_min_ps(a, b);
#else
    return vf_select(vf_lt(a, b), a, b);
#endif
}
TRC_INLINE vfloat vf_max(vfloat a, vfloat b) {
#if TRC_WIDTH == 16
    return _mm512_max_ps(a, b);
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return _mm256_max_ps(a, b);
#elif TRC_WIDTH == 4 && defined(__SSE__)
    return _mm_max_ps(a, b);
#else
    return vf_select(vf_gt(a, b), a, b);
#endif
}
/* a, and in the lanes of m the minimum or maximum of a and b. */
TRC_INLINE vfloat vf_min_where(vmask m, vfloat a, vfloat b) {
#if TRC_WIDTH == 16
    return _mm512_mask_min_ps(a, m, a, b);
#else
    return vf_select(m, vf_min(a, b), a);
#endif
}
TRC_INLINE vfloat vf_max_where(vmask m, vfloat a, vfloat b) {
#if TRC_WIDTH == 16
    return _mm512_mask_max_ps(a, m, a, b);
#else
    return vf_select(m, vf_max(a, b), a);
#endif
}
TRC_INLINE vfloat vf_clamp(vfloat a, float low, float high) {
    return vf_min(vf_max(a, vf_set(low)), vf_set(high));
}
/* Correctly rounded on every width. */
TRC_INLINE vfloat vf_sqrt(vfloat a) {
#if TRC_WIDTH == 1
    return sqrtf(a);
#elif TRC_WIDTH == 16
    return _mm512_sqrt_ps(a);
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return _mm256_sqrt_ps(a);
#elif TRC_WIDTH == 4 && defined(__SSE__)
    return _mm_sqrt_ps(a);
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return (vfloat)vsqrtq_f32((float32x4_t)a);
#else
    vfloat r;
    for (int i = 0; i < TRC_WIDTH; i++)
        r[i] = sqrtf(a[i]);
    return r;
#endif
}
TRC_INLINE vfloat vf_abs(vfloat a) { return vi_as_float(vf_as_int(a) & vi_set(0x7fffffff)); }
/* |a| with the sign of b. */
TRC_INLINE vfloat vf_copysign(vfloat a, vfloat b) {
    return vi_as_float((vf_as_int(a) & vi_set(0x7fffffff)) | (vf_as_int(b) & vi_set(INT32_MIN)));
}
TRC_INLINE vfloat vf_floor(vfloat a) {
#if TRC_WIDTH == 1
    return floorf(a);
#elif TRC_WIDTH == 16
    return _mm512_roundscale_ps(a, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
#elif TRC_WIDTH == 8 && defined(__AVX__)
    return _mm256_floor_ps(a);
#elif TRC_WIDTH == 4 && defined(__SSE4_1__)
    return _mm_floor_ps(a);
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return (vfloat)vrndmq_f32((float32x4_t)a);
#else
    vfloat r;
    for (int i = 0; i < TRC_WIDTH; i++)
        r[i] = floorf(a[i]);
    return r;
#endif
}

/* a * b + c, fused where the hardware can: only where an error bound covers either rounding. */
TRC_INLINE vfloat vf_madd(vfloat a, vfloat b, vfloat c) {
#if TRC_WIDTH == 16
    return _mm512_fmadd_ps(a, b, c);
#elif TRC_WIDTH == 8 && defined(__FMA__)
    return _mm256_fmadd_ps(a, b, c);
#else
    return a * b + c;
#endif
}

/* Scalars; b where either is NaN. fminf and fmaxf are calls without -ffinite-math-only. */
TRC_INLINE float f_min(float a, float b) { return a < b ? a : b; }
TRC_INLINE float f_max(float a, float b) { return a > b ? a : b; }

/* Least and largest lane; undefined order for NaN. */
TRC_INLINE float vf_lanes_min(vfloat a) {
#if TRC_WIDTH == 1
    return a;
#elif TRC_WIDTH == 16
    return _mm512_reduce_min_ps(a);
#elif defined(__SSE__)
#if TRC_WIDTH == 8
    const __m128 four = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
#else
    const __m128 four = a;
#endif
    const __m128 two = _mm_min_ps(four, _mm_movehl_ps(four, four));
    return _mm_cvtss_f32(_mm_min_ss(two, _mm_shuffle_ps(two, two, 1)));
#elif TRC_WIDTH == 4
    const vfloat two = vf_min(a, __builtin_shufflevector(a, a, 2, 3, 2, 3));
    return f_min(two[0], two[1]);
#else
    float r = a[0];
    for (int i = 1; i < TRC_WIDTH; i++)
        r = f_min(r, a[i]);
    return r;
#endif
}
TRC_INLINE float vf_lanes_max(vfloat a) { return -vf_lanes_min(-a); }

/* ---- gathers: base[index] in the lanes of m, 0 elsewhere (their index is not read) ---- */

TRC_INLINE vfloat vf_gather(const float *base, vint index, vmask m) {
#if TRC_WIDTH == 1
    return m ? base[index] : 0.0f;
#elif TRC_WIDTH == 16
    return _mm512_mask_i32gather_ps(_mm512_setzero_ps(), m, (__m512i)index, base, 4);
#elif TRC_WIDTH == 8 && defined(__AVX2__)
    return _mm256_mask_i32gather_ps(_mm256_setzero_ps(), base, (__m256i)index, (__m256)m, 4);
#else
    vfloat r = vf_set(0.0f);
    for (int i = 0; i < TRC_WIDTH; i++)
        if (m[i])
            r[i] = base[index[i]];
    return r;
#endif
}
TRC_INLINE vint vi_gather(const int32_t *base, vint index, vmask m) {
#if TRC_WIDTH == 1
    return m ? base[index] : 0;
#elif TRC_WIDTH == 16
    return (vint)_mm512_mask_i32gather_epi32(_mm512_setzero_si512(), m, (__m512i)index, base, 4);
#elif TRC_WIDTH == 8 && defined(__AVX2__)
    return (vint)_mm256_mask_i32gather_epi32(_mm256_setzero_si256(), base, (__m256i)index,
                                             (__m256i)m, 4);
#else
    vint r = vi_set(0);
    for (int i = 0; i < TRC_WIDTH; i++)
        if (m[i])
            r[i] = base[index[i]];
    return r;
#endif
}
TRC_INLINE vuint vu_gather(const uint32_t *base, vint index, vmask m) {
    return (vuint)vi_gather((const int32_t *)base, index, m);
}
/* base[index] in the low half and base[index + 1] in the high half, of every lane. */
TRC_INLINE vuint vu_gather_pair(const uint16_t *base, vint index) {
#if TRC_WIDTH == 16
    return (vuint)_mm512_i32gather_epi32((__m512i)index, base, 2);
#elif TRC_WIDTH == 8 && defined(__AVX2__)
    return (vuint)_mm256_i32gather_epi32((const int *)base, (__m256i)index, 2);
#elif TRC_WIDTH == 1
    return base[index] | (uint32_t)base[index + 1] << 16;
#else
    vuint r = vu_set(0);
    for (int i = 0; i < TRC_WIDTH; i++)
        r[i] = base[index[i]] | (uint32_t)base[index[i] + 1] << 16;
    return r;
#endif
}

/* ---- lanes ---- */

TRC_INLINE float vf_get(vfloat a, int lane) {
#if TRC_WIDTH == 1
    (void)lane;
    return a;
#else
    return a[lane];
#endif
}
TRC_INLINE int32_t vi_get(vint a, int lane) {
#if TRC_WIDTH == 1
    (void)lane;
    return a;
#else
    return a[lane];
#endif
}

/* Writes the lanes of bits to p one after the other; up to TRC_WIDTH elements at p may be written.
 */
TRC_INLINE void vf_compress(float *p, vfloat a, uint32_t bits) {
#if TRC_WIDTH == 16
    _mm512_storeu_ps(p, _mm512_maskz_compress_ps((__mmask16)bits, a));
#else
    float lanes[TRC_WIDTH];
    vf_store(lanes, a);
    for (; bits; bits &= bits - 1)
        *p++ = lanes[__builtin_ctz(bits)];
#endif
}
TRC_INLINE void vu_compress(uint32_t *p, vuint a, uint32_t bits) {
#if TRC_WIDTH == 16
    _mm512_storeu_si512(p, _mm512_maskz_compress_epi32((__mmask16)bits, (__m512i)a));
#else
    uint32_t lanes[TRC_WIDTH];
    vu_store(lanes, a);
    for (; bits; bits &= bits - 1)
        *p++ = lanes[__builtin_ctz(bits)];
#endif
}

/* ---- three-component vectors ---- */

typedef struct {
    vfloat x, y, z;
} vvec3;

TRC_INLINE vvec3 v3(vfloat x, vfloat y, vfloat z) { return (vvec3){x, y, z}; }
TRC_INLINE vvec3 v3_set(const float *p) { return v3(vf_set(p[0]), vf_set(p[1]), vf_set(p[2])); }
TRC_INLINE vvec3 v3_splat(vfloat a) { return v3(a, a, a); }
TRC_INLINE vvec3 v3_zero(void) { return v3_splat(vf_set(0.0f)); }
TRC_INLINE vvec3 v3_add(vvec3 a, vvec3 b) { return v3(a.x + b.x, a.y + b.y, a.z + b.z); }
TRC_INLINE vvec3 v3_sub(vvec3 a, vvec3 b) { return v3(a.x - b.x, a.y - b.y, a.z - b.z); }
TRC_INLINE vvec3 v3_mul(vvec3 a, vvec3 b) { return v3(a.x * b.x, a.y * b.y, a.z * b.z); }
TRC_INLINE vvec3 v3_scale(vvec3 a, vfloat s) { return v3(a.x * s, a.y * s, a.z * s); }
TRC_INLINE vvec3 v3_neg(vvec3 a) { return v3(-a.x, -a.y, -a.z); }
TRC_INLINE vfloat v3_dot(vvec3 a, vvec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
TRC_INLINE vvec3 v3_cross(vvec3 a, vvec3 b) {
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
TRC_INLINE vvec3 v3_select(vmask m, vvec3 a, vvec3 b) {
    return v3(vf_select(m, a.x, b.x), vf_select(m, a.y, b.y), vf_select(m, a.z, b.z));
}
TRC_INLINE vfloat v3_length(vvec3 a) { return vf_sqrt(v3_dot(a, a)); }
/* Zero stays zero. */
TRC_INLINE vvec3 v3_normalize(vvec3 a) {
    const vfloat square = v3_dot(a, a);
    const vfloat inverse = vf_set(1.0f) / vf_sqrt(square);
    return v3_scale(a, vf_select(vf_gt(square, vf_set(0.0f)), inverse, vf_set(0.0f)));
}
TRC_INLINE vfloat v3_max(vvec3 a) { return vf_max(a.x, vf_max(a.y, a.z)); }
TRC_INLINE vfloat v3_average(vvec3 a) { return (a.x + a.y + a.z) * vf_set(1.0f / 3.0f); }
TRC_INLINE vvec3 v3_gather(const float *base, vint index, vmask m) {
    return v3(vf_gather(base, index, m), vf_gather(base + 1, index, m),
              vf_gather(base + 2, index, m));
}

#endif
