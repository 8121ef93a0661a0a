/* Boxes of moving nodes in bytes: they hold what was packed, and little more. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <float.h>
#include <math.h>

#include "bvh/packed.h"
#include "figures.h"
#include "rng.h"

#define BOXES 100000

static double bound(const struct trc_packed_boxes *p, int axis, int side, int child) {
    return p->origin[axis] + (double)p->step[axis] * p->bytes[axis][side][child];
}

/* Boxes of a size about that far from zero, none for the last children. */
static void random_boxes(struct rng *rng, float size, float away, int used,
                         float boxes[TRC_BOXES_FLOATS]) {
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const float a = away + size * rng_range(rng, -1.0f, 1.0f),
                        b = rng_below(rng, 8) ? away + size * rng_range(rng, -1.0f, 1.0f) : a;
            boxes[16 * axis + i] = i < used ? fminf(a, b) : INFINITY;
            boxes[16 * axis + 8 + i] = i < used ? fmaxf(a, b) : -INFINITY;
        }
}

/* Checks the boxes along one axis; the largest part of the node's size that one of them is wider
 * by. */
static double expect_holds(const float boxes[TRC_BOXES_FLOATS], const struct trc_packed_boxes *p,
                           int axis, int used) {
    const double size = 255.0 * p->step[axis];
    double worst = 0.0;
    for (int i = 0; i < used; i++) {
        const double lower = boxes[16 * axis + i], upper = boxes[16 * axis + 8 + i];
        assert_true(bound(p, axis, 0, i) <= lower);
        assert_true(bound(p, axis, 1, i) >= upper);
        const double wider = lower - bound(p, axis, 0, i) + bound(p, axis, 1, i) - upper;
        worst = size > 0.0 ? fmax(worst, wider / size) : worst;
    }
    for (int i = used; i < TRC_NODE_WIDTH; i++) {
        assert_int_equal(p->bytes[axis][0][i], 255);
        assert_int_equal(p->bytes[axis][1][i], 0);
    }
    return worst;
}

static void packed_boxes_hold_the_boxes(void **state) {
    (void)state;
    static const float sizes[][2] = {
        {1.0f, 0.0f},   {1.0f, 1e3f},   {1e-3f, 1e3f},     {0.0f, 5.0f},   {1e18f, 0.0f},
        {1e-38f, 0.0f}, {1e-44f, 0.0f}, {1e-30f, -1e-30f}, {1e-6f, -7.0f}, {3e-7f, 1.0f}};
    struct rng rng = rng_seed(1);
    double worst = 0.0;
    for (int k = 0; k < BOXES; k++) {
        const float *kind = sizes[k % (int)(sizeof sizes / sizeof *sizes)];
        const int used = 1 + (int)rng_below(&rng, TRC_NODE_WIDTH);
        float boxes[TRC_BOXES_FLOATS], lower[3], upper[3];
        struct trc_packed_boxes packed;
        random_boxes(&rng, kind[0], kind[1], used, boxes);
        trc_boxes_pack(boxes, &packed);
        trc_packed_hull(&packed, lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            const double wider = expect_holds(boxes, &packed, axis, used);
            if (kind[0] == 1.0f)
                worst = fmax(worst, wider);
            float begin = INFINITY, end = -INFINITY;
            for (int i = 0; i < used; i++) {
                begin = fminf(begin, boxes[16 * axis + i]);
                end = fmaxf(end, boxes[16 * axis + 8 + i]);
            }
            /* The outermost bounds are not wider than rounding makes them. */
            assert_true(lower[axis] == begin);
            assert_true(upper[axis] >= end);
            assert_true(upper[axis] - end <=
                        4.0f * FLT_EPSILON * fmaxf(fabsf(begin), fabsf(end)) + 256.0f * FLT_MIN);
        }
    }
    print_figure("packed boxes", "at most %.4f of their node's size wider", worst);
    assert_true(worst < 2.001 / 255.0);
}

/* What is not finite is the build's to refuse: packing it has some result. */
static void infinite_boxes_are_packed(void **state) {
    (void)state;
    float boxes[TRC_BOXES_FLOATS];
    struct trc_packed_boxes packed;
    struct rng rng = rng_seed(2);
    random_boxes(&rng, 1.0f, 0.0f, TRC_NODE_WIDTH, boxes);
    boxes[0] = -INFINITY;
    boxes[16 + 8] = INFINITY;
    boxes[32] = NAN;
    trc_boxes_pack(boxes, &packed);
    assert_true(packed.origin[0] == -INFINITY);
    assert_true(packed.step[1] == INFINITY);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packed_boxes_hold_the_boxes),
        cmocka_unit_test(infinite_boxes_are_packed),
    };
    return cmocka_run_group_tests_name("packed", tests, NULL, NULL);
}
