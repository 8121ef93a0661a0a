/* What can trace a list of rays, batch by batch. The memory that it works in is the caller's, so
 * that one batch stays in cache or all of them pass through memory, as wanted. */
#ifndef TRACER_BENCH_CONTESTANT_H
#define TRACER_BENCH_CONTESTANT_H

#include <stddef.h>

#include "rays.h"

struct contestant;

struct contestant_calls {
    /* Memory for the largest batch of a list, a multiple of 64. */
    size_t (*batch_bytes)(const struct contestant *c, const struct ray_list *list);
    /* Puts a batch's rays into memory (64-byte aligned), with no hits. */
    void (*load)(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                 void *memory);
    /* Traces what load put there: the part that is timed. */
    void (*trace)(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  void *memory);
    /* Copies the answers to the batch's rays in hits. */
    void (*store)(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  const void *memory, struct hit_set *hits);
};

struct contestant {
    const struct contestant_calls *calls;
    char name[24];
    const void *tracer; /* what calls need: not owned */
    uint32_t width;     /* Embree: rays of a packet */
    bool coherent;      /* Embree: the flag of coherent rays */
};

static inline uint32_t batch_rays(const struct ray_list *list, uint32_t batch) {
    return list->batch_begin[batch + 1] - list->batch_begin[batch];
}

#endif
