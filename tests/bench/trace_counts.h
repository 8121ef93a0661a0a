/* Steps of traversal, by the names that TRC_COUNT has in libtracer/src/kernels/walk*.h. */
#ifndef TRACER_BENCH_TRACE_COUNTS_H
#define TRACER_BENCH_TRACE_COUNTS_H

#include <stdint.h>

struct trace_counts {
    uint64_t nodes;            /* beams of packets against the eight boxes of a node */
    uint64_t box_rays;         /* rays of packets against one box */
    uint64_t triangle_rays;    /* rays of packets against one triangle */
    uint64_t visits;           /* of nodes and leaves by packets */
    uint64_t visit_rays;       /* live rays at those */
    uint64_t single_nodes;     /* rays on their own against the eight boxes of a node */
    uint64_t single_leaves;    /* rays on their own against the triangles of a leaf */
    uint64_t single_triangles; /* and those triangles */
};

#endif
