/* Eight floats, whatever the kernel's width: one child or one triangle per lane. */
#ifndef TRACER_KERNELS_SIMD_SIMD8_H
#define TRACER_KERNELS_SIMD_SIMD8_H

#include "kernels/simd/simd.h"

typedef float f8 __attribute__((vector_size(32)));
typedef int32_t i8x __attribute__((vector_size(32)));

TRC_INLINE f8 f8_set(float a) { return (f8){a, a, a, a, a, a, a, a}; }
TRC_INLINE f8 f8_load(const float *p) {
    f8 v;
    memcpy(&v, p, sizeof v);
    return v;
}
/* Bytes as numbers. */
TRC_INLINE i8x i8_load_bytes(const uint8_t p[8]) {
#if defined(__AVX2__)
    return (i8x)_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)p));
#else
    typedef uint8_t bytes __attribute__((vector_size(8)));
    bytes b;
    memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, i8x);
#endif
}
TRC_INLINE f8 f8_load_bytes(const uint8_t p[8]) {
    return __builtin_convertvector(i8_load_bytes(p), f8);
}
/* In each lane that one of sixteen floats, low before high; beyond 15 any. */
TRC_INLINE f8 f8_pick(f8 low, f8 high, i8x lane) {
#if defined(__AVX512VL__)
    return (f8)_mm256_permutex2var_ps((__m256)low, (__m256i)lane, (__m256)high);
#elif defined(__AVX2__)
    const __m256 l = _mm256_permutevar8x32_ps((__m256)low, (__m256i)lane);
    const __m256 h = _mm256_permutevar8x32_ps((__m256)high, (__m256i)lane);
    const __m256i is_high = _mm256_slli_epi32((__m256i)lane, 28); /* bit 3 as the sign */
    return (f8)_mm256_blendv_ps(l, h, _mm256_castsi256_ps(is_high));
#else
    float from[16];
    f8 r;
    memcpy(from, &low, sizeof low);
    memcpy(from + 8, &high, sizeof high);
    for (int i = 0; i < 8; i++)
        r[i] = from[lane[i] & 15];
    return r;
#endif
}
TRC_INLINE void f8_store(float *p, f8 v) { memcpy(p, &v, sizeof v); }

#if defined(__AVX__)
TRC_INLINE f8 f8_min(f8 a, f8 b) { return (f8)_mm256_min_ps((__m256)a, (__m256)b); }
TRC_INLINE f8 f8_max(f8 a, f8 b) { return (f8)_mm256_max_ps((__m256)a, (__m256)b); }
#else
TRC_INLINE f8 f8_min(f8 a, f8 b) {
    const i8x m = a < b;
    return (f8)(((i8x)a & m) | ((i8x)b & ~m));
}
TRC_INLINE f8 f8_max(f8 a, f8 b) {
    const i8x m = a > b;
    return (f8)(((i8x)a & m) | ((i8x)b & ~m));
}
#endif

TRC_INLINE f8 f8_sqrt(f8 a) {
#if defined(__AVX__)
    return (f8)_mm256_sqrt_ps((__m256)a);
#else
    f8 r;
    for (int i = 0; i < 8; i++)
        r[i] = __builtin_sqrtf(a[i]);
    return r;
#endif
}

#if TRC_WIDTH == 4 && defined(__aarch64__)
/* One bit per lane, of which all bits are set or none. */
TRC_INLINE uint32_t i8_mask_bits(i8x m) {
    const i8x bits = m & (i8x){1, 2, 4, 8, 16, 32, 64, 128};
    uint32x4_t halves[2];
    memcpy(halves, &bits, sizeof bits);
    return vaddvq_u32(vorrq_u32(halves[0], halves[1]));
}
#endif

/* x where a <= b, else y (also for NaN). */
TRC_INLINE f8 f8_select_le(f8 a, f8 b, f8 x, f8 y) {
    const i8x m = a <= b;
    return (f8)(((i8x)x & m) | ((i8x)y & ~m));
}

/* a * b + c, fused where the hardware can: only for culls whose slack covers either rounding. */
TRC_INLINE f8 f8_madd(f8 a, f8 b, f8 c) {
#if defined(__FMA__)
    return (f8)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
    return a * b + c;
#endif
}

/* One bit per lane where a <= b (not for NaN). */
TRC_INLINE uint32_t f8_le(f8 a, f8 b) {
#if defined(__AVX512VL__)
    return _mm256_cmp_ps_mask((__m256)a, (__m256)b, _CMP_LE_OQ);
#elif defined(__AVX__)
    return (uint32_t)_mm256_movemask_ps(_mm256_cmp_ps((__m256)a, (__m256)b, _CMP_LE_OQ));
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return i8_mask_bits(a <= b);
#else
    const i8x m = a <= b;
    uint32_t bits = 0;
    for (int i = 0; i < 8; i++)
        bits |= (uint32_t)(m[i] & 1) << i;
    return bits;
#endif
}

/* One bit per lane that is not 0. */
TRC_INLINE uint32_t i8_nonzero(i8x a) {
#if defined(__AVX512VL__)
    return _mm256_test_epi32_mask((__m256i)a, (__m256i)a);
#elif defined(__AVX2__)
    const __m256i zero = _mm256_cmpeq_epi32((__m256i)a, _mm256_setzero_si256());
    return ~(uint32_t)_mm256_movemask_ps((__m256)zero) & 0xffu;
#elif TRC_WIDTH == 4 && defined(__aarch64__)
    return i8_mask_bits(a != 0);
#else
    uint32_t bits = 0;
    for (int i = 0; i < 8; i++)
        bits |= (uint32_t)(a[i] != 0) << i;
    return bits;
#endif
}

TRC_INLINE f8 f8_abs(f8 a) {
    const i8x m = {0x7fffffff, 0x7fffffff, 0x7fffffff, 0x7fffffff,
                   0x7fffffff, 0x7fffffff, 0x7fffffff, 0x7fffffff};
    return (f8)((i8x)a & m);
}

#endif
