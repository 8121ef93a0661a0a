#include "rate.h"

#include <stdlib.h>
#include <string.h>

void rate_add(struct rate *rate, double value) {
    if (rate->count < RATE_REPEATS)
        rate->values[rate->count++] = value;
}

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double rate_quantile(const struct rate *rate, double share) {
    double sorted[RATE_REPEATS];
    if (rate->count == 0)
        return 0.0;
    memcpy(sorted, rate->values, rate->count * sizeof *sorted);
    qsort(sorted, rate->count, sizeof *sorted, compare);
    const double at = share * (rate->count - 1);
    const uint32_t low = (uint32_t)at, high = low + 1 < rate->count ? low + 1 : low;
    return sorted[low] + (at - low) * (sorted[high] - sorted[low]);
}

double rate_median(const struct rate *rate) { return rate_quantile(rate, 0.5); }
