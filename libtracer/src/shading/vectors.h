/* Vectors and colours of three floats, for the builders of light tables. */
#ifndef TRACER_SHADING_VECTORS_H
#define TRACER_SHADING_VECTORS_H

#include <math.h>

#include "model/lights.h"

static inline float trc_dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static inline void trc_cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}
static inline float trc_length(const float a[3]) { return sqrtf(trc_dot(a, a)); }
/* Length before; a zero vector becomes fallback. */
static inline float trc_normalize(float a[3], float x, float y, float z) {
    const float size = trc_length(a);
    if (size > 0.0f && size < INFINITY) {
        for (int i = 0; i < 3; i++)
            a[i] /= size;
        return size;
    }
    a[0] = x;
    a[1] = y;
    a[2] = z;
    return 0.0f;
}
/* By magnitudes: what takes light away is chosen as often as what gives as much. */
static inline float trc_brightness(const float c[3]) {
    const float magnitude[3] = {fabsf(c[0]), fabsf(c[1]), fabsf(c[2])};
    return trc_luminance(magnitude);
}

#endif
