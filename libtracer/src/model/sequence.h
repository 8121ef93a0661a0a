/* Reading a tile's pixels while a thread writes them: a number per tile that is odd meanwhile
 * (sequence lock; H.-J. Boehm, "Can Seqlocks Get Along With Programming Language Memory Models?",
 * 2012).
 *
 * One thread at a time writes a tile, a batch of samples at once: two stores a batch are all it
 * costs, and it never waits. Readers take what they read only if the number was even before and is
 * the same after, else they read again; so they see whole batches in every part of the film.
 *
 * Memory order, also where it is weak: the fence in begin keeps every store to the tile behind the
 * odd number, the release in end keeps the even one behind them. For readers the acquire in begin
 * keeps every load behind the first look at the number, the fence in is_whole before the second: if
 * a load saw a store of a writer, the second look sees that writer's odd number or a later one.
 * What is between is loaded and stored atomically, each number on its own, in any order. */
#ifndef TRACER_MODEL_SEQUENCE_H
#define TRACER_MODEL_SEQUENCE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#if defined(__SANITIZE_THREAD__)
#define TRC_HAS_THREAD_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer)
#define TRC_HAS_THREAD_SANITIZER 1
#endif
#endif

/* ThreadSanitizer knows no fences; the calls it makes of all accesses keep their order. */
static inline void trc_sequence_fence(memory_order order) {
#ifdef TRC_HAS_THREAD_SANITIZER
    (void)order;
#else
    atomic_thread_fence(order);
#endif
}

static inline void trc_sequence_write_begin(atomic_uint *sequence) {
    const unsigned number = atomic_load_explicit(sequence, memory_order_relaxed);
    atomic_store_explicit(sequence, number + 1, memory_order_relaxed);
    trc_sequence_fence(memory_order_release);
}
static inline void trc_sequence_write_end(atomic_uint *sequence) {
    const unsigned number = atomic_load_explicit(sequence, memory_order_relaxed);
    atomic_store_explicit(sequence, number + 1, memory_order_release);
}

/* False while the tile is being written. */
static inline bool trc_sequence_read_begin(const atomic_uint *sequence, unsigned *number_out) {
    *number_out = atomic_load_explicit(sequence, memory_order_acquire);
    return !(*number_out & 1u);
}
/* Whether nothing was written since. */
static inline bool trc_sequence_is_whole(const atomic_uint *sequence, unsigned number) {
    trc_sequence_fence(memory_order_acquire);
    return atomic_load_explicit(sequence, memory_order_relaxed) == number;
}

/* Numbers of the film. */
static inline double trc_sum_load(const double *p) {
    double value;
    __atomic_load(p, &value, __ATOMIC_RELAXED);
    return value;
}
static inline void trc_sum_store(double *p, double value) {
    __atomic_store(p, &value, __ATOMIC_RELAXED);
}
static inline void trc_sum_add(double *p, double value) { trc_sum_store(p, *p + value); }

#endif
