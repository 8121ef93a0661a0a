#include "model/kernels.h"

#include "core/cpu.h"

#if defined(__x86_64__)
extern const struct trc_kernels trc_kernels_sse42, trc_kernels_avx2, trc_kernels_avx512;
#elif defined(__aarch64__)
extern const struct trc_kernels trc_kernels_neon;
#endif
extern const struct trc_kernels trc_kernels_scalar;

const struct trc_kernels *trc_kernels_get(uint32_t isa) {
    if (!trc_cpu_has(isa))
        return NULL;
    switch (isa) {
    case TRC_ISA_SCALAR:
        return &trc_kernels_scalar;
#if defined(__x86_64__)
#ifndef TRC_WITHOUT_SSE42
    case TRC_ISA_SSE42:
        return &trc_kernels_sse42;
#endif
#ifndef TRC_WITHOUT_AVX2
    case TRC_ISA_AVX2:
        return &trc_kernels_avx2;
#endif
#ifndef TRC_WITHOUT_AVX512
    case TRC_ISA_AVX512:
        return &trc_kernels_avx512;
#endif
#elif defined(__aarch64__) && !defined(TRC_WITHOUT_NEON)
    case TRC_ISA_NEON:
        return &trc_kernels_neon;
#endif
    default:
        return NULL;
    }
}

const struct trc_kernels *trc_kernels_current(void) { return trc_kernels_get(trc_isa()); }
