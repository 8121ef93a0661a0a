/* The floating-point control state of a thread: rounding, flushing of denormals, exception masks
 * and flags.
 *
 * The library computes in the default state whatever the host has set, and gives the host its own
 * state back, flags included. */
#ifndef TRACER_CORE_FPSTATE_H
#define TRACER_CORE_FPSTATE_H

#include <stdint.h>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#define TRC_FP_INLINE static inline __attribute__((always_inline, unused))

/* All exceptions masked, round to nearest, denormals kept, no flags. */
#define TRC_FP_DEFAULT_MXCSR 0x1f80u

/* Sets the default state and returns the former one. */
TRC_FP_INLINE uint64_t trc_fp_enter(void) {
#if defined(__SSE__)
    const uint64_t former = _mm_getcsr();
    _mm_setcsr(TRC_FP_DEFAULT_MXCSR);
    return former;
#elif defined(__aarch64__)
    uint64_t control, flags;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    __asm__ volatile("mrs %0, fpsr" : "=r"(flags));
    __asm__ volatile("msr fpcr, %0" : : "r"((uint64_t)0));
    /* Both registers are 32 bits wide in use. */
    return control << 32 | (flags & 0xffffffffu);
#else
    return 0;
#endif
}

/* Restores what trc_fp_enter returned. */
TRC_FP_INLINE void trc_fp_leave(uint64_t former) {
#if defined(__SSE__)
    _mm_setcsr((uint32_t)former);
#elif defined(__aarch64__)
    __asm__ volatile("msr fpcr, %0" : : "r"(former >> 32));
    __asm__ volatile("msr fpsr, %0" : : "r"(former & 0xffffffffu));
#else
    (void)former;
#endif
}

#endif
