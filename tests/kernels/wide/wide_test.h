/* What the tests of wide kernel code share. Each program is compiled once per instruction set, with
 * the flags and the macros TRC_ISA, TRC_WIDTH, TRC_TARGET_* of the kernels. */
#ifndef WIDE_TEST_H
#define WIDE_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "kernels/simd.h"

/* Whether this CPU runs the instruction set of the program. */
static inline bool test_cpu_can(void) {
#if defined(TRC_TARGET_AVX512)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
#elif defined(TRC_TARGET_AVX2)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#elif defined(TRC_TARGET_SSE42)
    return __builtin_cpu_supports("sse4.2");
#else
    return true;
#endif
}

/* PCG32 (M. O'Neill 2014): numbers that do not depend on the platform. */
struct test_random {
    uint64_t state;
};
static inline struct test_random test_random_seed(uint64_t seed) {
    return (struct test_random){seed * 0x9e3779b97f4a7c15ull + 0xda3e39cb94b95bdbull};
}
static inline uint32_t test_bits(struct test_random *r) {
    const uint64_t old = r->state;
    r->state = old * 6364136223846793005ull + 1442695040888963407ull;
    const uint32_t x = (uint32_t)(((old >> 18) ^ old) >> 27), turn = (uint32_t)(old >> 59);
    return (x >> turn) | (x << ((32u - turn) & 31u));
}
static inline float test_uniform(struct test_random *r) {
    return (float)(test_bits(r) >> 8) * 0x1p-24f;
}
TRC_INLINE vfloat test_wide_uniform(struct test_random *r) {
    float u[TRC_WIDTH];
    for (int i = 0; i < TRC_WIDTH; i++)
        u[i] = test_uniform(r);
    return vf_load(u);
}

#endif
