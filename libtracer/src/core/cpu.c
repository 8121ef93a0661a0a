/* Chooses the instruction set: what CPU and operating system offer, lowered by the environment
 * variable TRACER_ISA (read once) or by trc_set_isa. */
#define _POSIX_C_SOURCE 200809L
#include "core/cpu.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

#define ISA_COUNT (TRC_ISA_NEON + 1)

static const char *const isa_names[ISA_COUNT] = {"auto", "scalar", "sse42",
                                                 "avx2", "avx512", "neon"};

static pthread_once_t once = PTHREAD_ONCE_INIT;
static bool available[ISA_COUNT]; /* written once */
static uint32_t best;             /* of those, lowered by the environment; written once */
static atomic_uint chosen;        /* by trc_set_isa, TRC_ISA_AUTO: best */

#if defined(__x86_64__)
/* XCR0: which registers the operating system saves. */
static uint64_t read_xcr0(void) {
    uint32_t low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (uint64_t)high << 32 | low;
}

static bool has(uint32_t word, uint32_t bits) { return (word & bits) == bits; }

static void detect(void) {
    const uint32_t sse42_popcnt = 1u << 20 | 1u << 23;
    const uint32_t fma_f16c = 1u << 12 | 1u << 29;
    const uint32_t osxsave_avx = 1u << 27 | 1u << 28;
    const uint32_t bmi_avx2 = 1u << 3 | 1u << 5 | 1u << 8;
    const uint32_t avx512_f_dq_cd_bw_vl = 1u << 16 | 1u << 17 | 1u << 28 | 1u << 30 | 1u << 31;
    const uint64_t ymm_saved = 0x6, zmm_saved = 0xe6;
    uint32_t a, b, c, d;
    available[TRC_ISA_SCALAR] = true;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !has(c, sse42_popcnt))
        return;
    available[TRC_ISA_SSE42] = true;
    if (!has(c, fma_f16c | osxsave_avx))
        return;
    const uint64_t saved = read_xcr0();
    if ((saved & ymm_saved) != ymm_saved)
        return;
    const bool lzcnt = __get_cpuid(0x80000001u, &a, &b, &c, &d) && has(c, 1u << 5);
    if (!lzcnt || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !has(b, bmi_avx2))
        return;
    available[TRC_ISA_AVX2] = true;
    available[TRC_ISA_AVX512] = has(b, avx512_f_dq_cd_bw_vl) && (saved & zmm_saved) == zmm_saved;
}
#else
static void detect(void) {
    available[TRC_ISA_SCALAR] = true;
#if defined(__aarch64__)
    available[TRC_ISA_NEON] = true; /* part of the architecture */
#endif
}
#endif

/* Sets whose kernels were left out of this build. */
static void drop_missing(void) {
#ifdef TRC_WITHOUT_SSE42
    available[TRC_ISA_SSE42] = false;
#endif
#ifdef TRC_WITHOUT_AVX2
    available[TRC_ISA_AVX2] = false;
#endif
#ifdef TRC_WITHOUT_AVX512
    available[TRC_ISA_AVX512] = false;
#endif
#ifdef TRC_WITHOUT_NEON
    available[TRC_ISA_NEON] = false;
#endif
}

static void initialise(void) {
    detect();
    drop_missing();
    for (uint32_t isa = TRC_ISA_SCALAR; isa < ISA_COUNT; isa++) {
        if (available[isa])
            best = isa;
    }
    /* A name that is unknown or not available changes nothing: there is nobody to tell. */
    const char *wanted = getenv("TRACER_ISA");
    for (uint32_t isa = TRC_ISA_SCALAR; wanted && isa < ISA_COUNT; isa++) {
        if (available[isa] && strcmp(wanted, isa_names[isa]) == 0)
            best = isa;
    }
}

bool trc_cpu_has(uint32_t isa) {
    pthread_once(&once, initialise);
    return isa < ISA_COUNT && available[isa];
}

uint32_t trc_isa(void) {
    pthread_once(&once, initialise);
    const uint32_t isa = atomic_load(&chosen);
    return isa == TRC_ISA_AUTO ? best : isa;
}

trc_status trc_set_isa(uint32_t isa) {
    if (isa >= ISA_COUNT) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%u is not an instruction set", isa);
    }
    if (isa != TRC_ISA_AUTO && !trc_cpu_has(isa)) {
        return trc_fail(TRC_ERROR_UNSUPPORTED, "this CPU or build has no %s kernels",
                        isa_names[isa]);
    }
    atomic_store(&chosen, isa);
    return TRC_OK;
}

const char *trc_isa_name(uint32_t isa) { return isa < ISA_COUNT ? isa_names[isa] : "unknown"; }
