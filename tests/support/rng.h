/* Random numbers for tests and the benchmark: the same sequence on every platform.
 *
 * PCG32 (XSH-RR 64/32): Melissa O'Neill, "PCG: A Family of Simple Fast Space-Efficient
 * Statistically Good Algorithms for Random Number Generation", 2014. Not for rendering: the library
 * has its own samplers. */
#ifndef TRACER_TESTS_RNG_H
#define TRACER_TESTS_RNG_H

#include <math.h>
#include <stdint.h>

#define RNG_INLINE static inline __attribute__((unused))

struct rng {
    uint64_t state;
};

/* Different seeds give unrelated sequences. */
RNG_INLINE struct rng rng_seed(uint64_t seed) {
    return (struct rng){seed * 0x9e3779b97f4a7c15ull + 0xda3e39cb94b95bdbull};
}

/* 32 uniform bits. */
RNG_INLINE uint32_t rng_bits(struct rng *r) {
    const uint64_t old = r->state;
    r->state = old * 6364136223846793005ull + 1442695040888963407ull;
    const uint32_t x = (uint32_t)(((old >> 18) ^ old) >> 27), turn = (uint32_t)(old >> 59);
    return (x >> turn) | (x << ((32u - turn) & 31u));
}

/* [0, count), count > 0; the bias is below count / 2^32. */
RNG_INLINE uint32_t rng_below(struct rng *r, uint32_t count) {
    return (uint32_t)(((uint64_t)rng_bits(r) * count) >> 32);
}

/* [0, 1), a multiple of 2^-24. */
RNG_INLINE float rng_unit(struct rng *r) { return (float)(rng_bits(r) >> 8) * 0x1p-24f; }

/* [low, high), up to rounding. */
RNG_INLINE float rng_range(struct rng *r, float low, float high) {
    return low + (high - low) * rng_unit(r);
}

/* Uniform over the unit sphere. */
RNG_INLINE void rng_direction(struct rng *r, float direction[3]) {
    const float z = rng_range(r, -1.0f, 1.0f), angle = 6.2831853f * rng_unit(r);
    const float s = sqrtf(fmaxf(0.0f, 1.0f - z * z));
    direction[0] = s * cosf(angle);
    direction[1] = s * sinf(angle);
    direction[2] = z;
}

#endif
