/* The public ray queries as a contestant: trc_query_closest and trc_query_occluded on arrays of a
 * batch's rays, as a caller of the library has them. */
#ifndef TRACER_BENCH_QUERY_H
#define TRACER_BENCH_QUERY_H

#include "contestant.h"
#include "tracer/tracer.h"

struct query_target {
    trc_scene scene;
    uint32_t packet_size; /* as trc_query_closest takes it */
};

/* The contestant refers to target, which must live as long. The kernels are those in force. */
struct contestant query_contestant(const char *name, const struct query_target *target);

#endif
