/* The packet kernels with counters of the steps of traversal: libtracer/src/kernels/walk.h,
 * compiled once more. */
#ifndef TRACER_BENCH_COUNTED_H
#define TRACER_BENCH_COUNTED_H

#include "contestant.h"
#include "trace_counts.h"

/* Of the trace that runs. */
extern struct trace_counts counted_steps;

/* Traces a list on the calling thread and counts. Not for several threads at once. */
struct trace_counts counted_trace(const struct trc_snapshot *snapshot, const struct ray_list *list);

#endif
