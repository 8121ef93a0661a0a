/* Contestants trace the same rays: how fast, and with what hits. */
#ifndef TRACER_BENCH_RACE_H
#define TRACER_BENCH_RACE_H

#include "contestant.h"
#include "rate.h"

struct trc_pool;

/* Each contestant's Mrays/s, interleaved repeat by repeat after one round that warms up. Only
 * tracing is timed. With several threads each traces its part of the batches, and their rates are
 * summed. streamed: all batches are loaded before any is traced; else each just before. */
void race_run(const struct contestant *contestants, uint32_t count, const struct ray_list *list,
              struct trc_pool *pool, uint32_t repeats, bool streamed, struct rate *rates_out);

/* The answers of one contestant; hits must have room for all rays. */
void race_hits(const struct contestant *contestant, const struct ray_list *list,
               struct hit_set *hits);

struct hit_difference {
    uint32_t only_a, only_b; /* hit, or occluded, in one of both */
    uint32_t distance;       /* hit in both, at distances that differ by more than 1e-4 of them */
    double largest;          /* relative difference of the distances that differ by less */
};
struct hit_difference race_difference(const struct ray_list *list, const struct hit_set *a,
                                      const struct hit_set *b);

/* Share of the rays that hit nothing, or are not occluded. */
double race_miss_share(const struct ray_list *list, const struct hit_set *hits);

#endif
