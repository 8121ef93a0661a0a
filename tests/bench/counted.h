/* The packet kernels with counters of the steps of traversal: libtracer/src/kernels/trace.c,
 * compiled once more. */
#ifndef TRACER_BENCH_COUNTED_H
#define TRACER_BENCH_COUNTED_H

#include "contestant.h"

struct trace_counts {
    uint64_t nodes;            /* beams against the eight boxes of a node */
    uint64_t box_rays;         /* rays of packets against one box */
    uint64_t triangle_rays;    /* rays of packets against one triangle */
    uint64_t visits;           /* of nodes and leaves by packets */
    uint64_t visit_rays;       /* live rays at those */
    uint64_t single_nodes;     /* rays on their own against the eight boxes of a node */
    uint64_t single_leaves;    /* rays on their own against the triangles of a leaf */
    uint64_t single_triangles; /* and those triangles */
};

/* Traces a list on the calling thread and counts. Not for several threads at once. */
struct trace_counts counted_trace(const struct trc_snapshot *snapshot, const struct ray_list *list);

#endif
