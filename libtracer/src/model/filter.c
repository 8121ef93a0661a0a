#include "model/filter.h"

#include <math.h>

#include "tracer/render.h"

static double filter_value(uint32_t filter, double x, double width) {
    const double pi = 3.14159265358979323846;
    if (filter == TRC_FILTER_GAUSSIAN) {
        const double v = 6.0 * x / width;
        return exp(-2.0 * v * v);
    }
    if (filter == TRC_FILTER_BLACKMAN_HARRIS) {
        const double v = 2.0 * pi * (x / width + 0.5);
        return 0.35875 - 0.48829 * cos(v) + 0.14128 * cos(2.0 * v) - 0.01168 * cos(3.0 * v);
    }
    return 1.0;
}

void trc_filter_table_fill(uint32_t filter, float width, float table[TRC_FILTER_TABLE]) {
    enum { STEPS = 2 * TRC_FILTER_TABLE };
    /* Support of the filters in widths, as Cycles has it. */
    const double support = filter == TRC_FILTER_GAUSSIAN          ? 3.0
                           : filter == TRC_FILTER_BLACKMAN_HARRIS ? 2.0
                                                                  : 1.0;
    const double half = 0.5 * support * (double)width;
    const double full = 2.0 * half, step = full / STEPS;
    double values[STEPS], total = 0.0, sum = 0.0;
    for (int i = 0; i < STEPS; i++) {
        values[i] = filter_value(filter, -half + (i + 0.5) * step, full);
        total += values[i];
    }
    int filled = 0;
    for (int i = 0; i < STEPS && filled < TRC_FILTER_TABLE; i++) {
        const double value = values[i];
        for (; filled < TRC_FILTER_TABLE; filled++) {
            const double target = total * filled / (TRC_FILTER_TABLE - 1);
            if (target > sum + value && i < STEPS - 1)
                break;
            const double f = value > 0.0 ? (target - sum) / value : 0.0;
            table[filled] = (float)(-half + (i + (f < 1.0 ? f : 1.0)) * step);
        }
        sum += value;
    }
}
