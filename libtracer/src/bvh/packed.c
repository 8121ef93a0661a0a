/* Bounds of moving trees in bytes.
 *
 * H. Ylitie, T. Karras, S. Laine, "Efficient Incoherent Ray Traversal on GPUs Through Compressed
 * Wide BVHs", 2017, have a grid of powers of two in each node. Steps of any size make the outermost
 * bounds exact, so that what a byte loses does not add up from level to level. */
#include "bvh/packed.h"

#include <float.h>
#include <math.h>

#define LAST_BYTE 255.0f

/* A bound as its byte says it, in double: the product is exact. */
static double bound_at(float origin, float step, double byte) {
    return (double)origin + (double)step * byte;
}

/* The least step with which the last byte reaches that far. */
static float step_for(float origin, float end) {
    if (!(end > origin))
        return 0.0f;
    /* Of denormal steps, rounding is not relative to what they are. */
    float step = fmaxf((float)(((double)end - origin) / LAST_BYTE), FLT_MIN);
    while (bound_at(origin, step, LAST_BYTE) < end)
        step = nextafterf(step, INFINITY);
    return step;
}

/* Steps that the difference, the reciprocal and their product are wrong by, at most 3 half-ulps of
 * 255, with room. */
#define STEP_ERROR 1e-4f

/* What is not a number is 0. */
static uint8_t whole_steps(float steps) {
    const float positive = steps > 0.0f ? steps : 0.0f;
    return (uint8_t)(positive < LAST_BYTE ? positive : LAST_BYTE);
}

/* Bytes whose bounds are not above lower ones, and not below upper ones. */
static uint8_t byte_below(float steps) { return whole_steps(steps - STEP_ERROR); }
static uint8_t byte_above(float steps) {
    return (uint8_t)(UINT8_MAX - whole_steps(LAST_BYTE - STEP_ERROR - steps));
}

void trc_boxes_pack(const float boxes[TRC_BOXES_FLOATS], struct trc_packed_boxes *out) {
    for (int axis = 0; axis < 3; axis++) {
        const float *lower = boxes + 2 * TRC_NODE_WIDTH * axis, *upper = lower + TRC_NODE_WIDTH;
        float begin = INFINITY, end = -INFINITY;
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            begin = lower[i] < begin ? lower[i] : begin;
            end = upper[i] > end ? upper[i] : end;
        }
        const float step = step_for(begin, end);
        const float per_step = step > 0.0f ? 1.0f / step : 0.0f;
        out->origin[axis] = begin;
        out->step[axis] = step;
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const bool is_empty = !(lower[i] <= upper[i]);
            out->bytes[axis][0][i] =
                is_empty ? UINT8_MAX : byte_below((lower[i] - begin) * per_step);
            out->bytes[axis][1][i] = is_empty ? 0 : byte_above((upper[i] - begin) * per_step);
        }
    }
}

void trc_packed_hull(const struct trc_packed_boxes *boxes, float lower_out[3], float upper_out[3]) {
    for (int axis = 0; axis < 3; axis++) {
        const double end = bound_at(boxes->origin[axis], boxes->step[axis], LAST_BYTE);
        float upper = (float)end;
        if (upper < end)
            upper = nextafterf(upper, INFINITY);
        lower_out[axis] = boxes->origin[axis];
        upper_out[axis] = upper;
    }
}
