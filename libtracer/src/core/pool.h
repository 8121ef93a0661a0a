/* A pool of worker threads of the library. Workers block all signals, set their own floating-point
 * state to the default, and never touch the host's. */
#ifndef TRACER_CORE_POOL_H
#define TRACER_CORE_POOL_H

#include <stdint.h>

#include "tracer/base.h"

struct trc_pool;

/* thread_count 0: one per logical processor the process may use. The calling thread of trc_pool_run
 * takes part, so a pool of n starts n - 1 threads. OUT_OF_MEMORY or NO_THREAD. */
trc_status trc_pool_create(uint32_t thread_count, struct trc_pool **pool_out);
void trc_pool_destroy(struct trc_pool *pool);
uint32_t trc_pool_thread_count(const struct trc_pool *pool);

/* Calls task(context, i, worker) for each i in [0, count), in any order on any thread, and returns
 * when all are done. worker < thread_count is unique among tasks that run at once. One run at a
 * time per pool. The calling thread's floating-point control state is set to the default while it
 * takes part and restored. */
void trc_pool_run(struct trc_pool *pool, uint32_t count,
                  void (*task)(void *context, uint32_t index, uint32_t worker), void *context);

#endif
