/* Repeated measurements of a rate: median and spread. */
#ifndef TRACER_BENCH_RATE_H
#define TRACER_BENCH_RATE_H

#include <stdint.h>

#define RATE_REPEATS 99

struct rate {
    double values[RATE_REPEATS];
    uint32_t count;
};

void rate_add(struct rate *rate, double value);
/* Of what was added, interpolated between neighbours: 0 the least, 0.5 the median, 1 the largest;
 * 0 if nothing was. */
double rate_quantile(const struct rate *rate, double share);
double rate_median(const struct rate *rate);

#endif
