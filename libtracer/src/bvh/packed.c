/* Bounds of moving trees in bytes.
 *
 * H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed
 * Wide BVHs", 2017, have a grid of powers of two in each node. Steps of any size make the outermost
 * bounds exact, so that what a byte loses does not add up from level to level. */
#include "bvh/packed.h"

#include <float.h>
#include <math.h>

#define STEPS 255.0

/* A bound as its byte says it, in double: the product is exact. */
static double bound_at(float origin, float step, double byte) {
    return (double)origin + (double)step * byte;
}

/* The least step with which the last byte reaches that far. */
static float step_for(float origin, float end) {
    if (!(end > origin))
        return 0.0f;
    /* Of denormal steps, rounding is not relative to what they are. */
    float step = fmaxf((float)(((double)end - origin) / STEPS), FLT_MIN);
    while (bound_at(origin, step, STEPS) < end)
        step = nextafterf(step, INFINITY);
    return step;
}

/* The largest byte whose bound is not above x, and the least whose is not below. */
static uint8_t byte_below(float origin, float step, float x) {
    double byte = step > 0.0f ? floor(((double)x - origin) / step) : 0.0;
    byte = fmin(fmax(byte, 0.0), STEPS);
    while (byte > 0.0 && bound_at(origin, step, byte) > x)
        byte--;
    return (uint8_t)byte;
}
static uint8_t byte_above(float origin, float step, float x) {
    double byte = step > 0.0f ? ceil(((double)x - origin) / step) : 0.0;
    byte = fmin(fmax(byte, 0.0), STEPS);
    while (byte < STEPS && bound_at(origin, step, byte) < x)
        byte++;
    return (uint8_t)byte;
}

void trc_boxes_pack(const float boxes[TRC_BOXES_FLOATS], struct trc_packed_boxes *out) {
    for (int axis = 0; axis < 3; axis++) {
        const float *lower = boxes + 2 * TRC_NODE_WIDTH * axis, *upper = lower + TRC_NODE_WIDTH;
        float begin = INFINITY, end = -INFINITY;
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            begin = fminf(begin, lower[i]);
            end = fmaxf(end, upper[i]);
        }
        const float step = step_for(begin, end);
        out->origin[axis] = begin;
        out->step[axis] = step;
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const bool is_empty = !(lower[i] <= upper[i]);
            out->bytes[axis][0][i] = is_empty ? 255 : byte_below(begin, step, lower[i]);
            out->bytes[axis][1][i] = is_empty ? 0 : byte_above(begin, step, upper[i]);
        }
    }
}

void trc_packed_hull(const struct trc_packed_boxes *boxes, float lower_out[3], float upper_out[3]) {
    for (int axis = 0; axis < 3; axis++) {
        const double end = bound_at(boxes->origin[axis], boxes->step[axis], STEPS);
        float upper = (float)end;
        if (upper < end)
            upper = nextafterf(upper, INFINITY);
        lower_out[axis] = boxes->origin[axis];
        upper_out[axis] = upper;
    }
}
