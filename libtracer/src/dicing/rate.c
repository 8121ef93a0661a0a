#include "dicing/rate.h"

#include <math.h>

#include "dicing/vector.h"

static void to_camera(const float m[12], const float p[3], float out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
}

/* Metres from a point in front of the sides of a frustum, of those that it is outside of. */
static float outside_of_frustum(const float window[4], const float p[3]) {
    const float away[4] = {(-p[0] - window[0] * p[2]) / sqrtf(1.0f + window[0] * window[0]),
                           (p[0] + window[1] * p[2]) / sqrtf(1.0f + window[1] * window[1]),
                           (-p[1] - window[2] * p[2]) / sqrtf(1.0f + window[2] * window[2]),
                           (p[1] + window[3] * p[2]) / sqrtf(1.0f + window[3] * window[3])};
    float outside = 0.0f;
    for (int i = 0; i < 4; i++)
        outside = away[i] > outside ? away[i] : outside;
    return outside;
}

static float excess(float value, float low, float high) {
    return value < low ? low - value : value > high ? value - high : 0.0f;
}

/* Of a window's box in front of the camera, in halves of its sides. */
static float outside_of_box(const float window[4], const float p[3]) {
    const float away[3] = {excess(p[0], window[0], window[1]), excess(p[1], window[2], window[3]),
                           p[2] > 0.0f ? p[2] : 0.0f};
    const float x = 0.5f * (window[1] - window[0]), y = 0.5f * (window[3] - window[2]);
    return trc_length(away) / sqrtf(0.5f * (x * x + y * y));
}

/* The side of the square at a point of camera space. */
static float side_at(const trc_dicing_desc *how, const float p[3]) {
    const bool is_central = how->space == TRC_DICING_CENTRAL;
    const float side = is_central ? how->side * trc_length(p) : how->side;
    if (how->offscreen_scale == 1.0f || how->window[0] == how->window[1])
        return side;
    const float outside =
        is_central ? outside_of_frustum(how->window, p) : outside_of_box(how->window, p);
    return side * (1.0f + outside * (how->offscreen_scale - 1.0f));
}

bool trc_edge_is_too_long(const trc_dicing_desc *how, const float a[3], const float b[3]) {
    const float diagonal = sqrtf(2.0f);
    float ends[3][3], along[3];
    if (how->space == TRC_DICING_OBJECT) {
        for (int i = 0; i < 3; i++)
            along[i] = b[i] - a[i];
        const float size = trc_length(along);
        return size > diagonal * how->side && size < INFINITY;
    }
    to_camera(how->object_to_camera, a, ends[0]);
    to_camera(how->object_to_camera, b, ends[1]);
    float side = INFINITY;
    for (int i = 0; i < 3; i++) {
        along[i] = ends[1][i] - ends[0][i];
        ends[2][i] = 0.5f * (ends[0][i] + ends[1][i]);
    }
    for (int i = 0; i < 3; i++) { /* an edge may come from far away to near the camera */
        const float here = side_at(how, ends[i]);
        side = here < side ? here : side;
    }
    const float size = trc_length(along);
    return size > diagonal * side && size < INFINITY;
}
