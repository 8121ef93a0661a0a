/* What the tests of wide kernel code share. Each program is compiled once per instruction set, with
 * the flags and the macros TRC_ISA, TRC_WIDTH, TRC_TARGET_* of the kernels. */
#ifndef WIDE_TEST_H
#define WIDE_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "kernels/simd/simd.h"
#include "rng.h"

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

TRC_INLINE vfloat test_wide_uniform(struct rng *r) {
    float u[TRC_WIDTH];
    for (int i = 0; i < TRC_WIDTH; i++)
        u[i] = rng_unit(r);
    return vf_load(u);
}

#endif
