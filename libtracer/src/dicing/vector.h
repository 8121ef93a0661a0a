/* Vectors of three floats. */
#ifndef TRACER_DICING_VECTOR_H
#define TRACER_DICING_VECTOR_H

#include <math.h>

static inline float trc_dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline float trc_length(const float a[3]) { return sqrtf(trc_dot(a, a)); }

#endif
