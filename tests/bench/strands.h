/* Volley's curves beside Embree's of the same kind, on the same rays. */
#ifndef TRACER_BENCH_STRANDS_H
#define TRACER_BENCH_STRANDS_H

#include <stdio.h>

#include "options.h"

/* A table for each instruction set, on one thread: rays per second of the public queries, in
 * packets and alone, beside Embree's packets and single rays, and the shares of rays that miss.
 * json: NULL for none. False: what is wrong was printed to the standard error stream. */
bool strands_measure(const struct options *options, FILE *json);

#endif
