/* Transforms that are flat or nearly so, and what undoes them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "query_scene.h"
#include "scene/affine.h"

static struct trc_affine scaled(float x, float y, float z) {
    return (struct trc_affine){{x, 0, 0, 1, 0, y, 0, 2, 0, 0, z, 3}};
}

/* Scaled along axes that are none of the world's. */
static struct trc_affine slanted(float x, float y, float z) {
    static const float axis[3] = {1, 2, 3}, other[3] = {-2, 1, 0.5f}, one[3] = {1, 1, 1};
    const float scale[3] = {x, y, z}, offset[3] = {4, -5, 6}, nowhere[3] = {0, 0, 0};
    float first[12], second[12];
    struct trc_affine m;
    query_transform(axis, 0.9f, scale, nowhere, first);
    query_transform(other, 2.1f, one, offset, second);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++)
            m.m[4 * r + c] = first[4 * r] * second[c] + first[4 * r + 1] * second[4 + c] +
                             first[4 * r + 2] * second[8 + c];
        m.m[4 * r + 3] = offset[r];
    }
    return m;
}

static void apply(const struct trc_affine *a, const double p[3], double out[3]) {
    for (int r = 0; r < 3; r++)
        out[r] =
            a->m[4 * r] * p[0] + a->m[4 * r + 1] * p[1] + a->m[4 * r + 2] * p[2] + a->m[4 * r + 3];
}

static void thin_is_what_floats_cannot_undo(void **state) {
    (void)state;
    const struct trc_affine solid[] = {scaled(1, 1, 1), scaled(1e-20f, 1e-20f, 1e-20f),
                                       scaled(1, 1, 1e-5f), slanted(1, 1, 0.01f)};
    const struct trc_affine thin[] = {scaled(1, 1, 0),      scaled(1, 1, 1e-7f), scaled(0, 0, 0),
                                      slanted(1, 1, 1e-4f), slanted(1, 0, 1),    slanted(-1, 0, 0)};
    for (size_t i = 0; i < sizeof solid / sizeof *solid; i++)
        assert_false(trc_affine_is_thin(&solid[i]));
    for (size_t i = 0; i < sizeof thin / sizeof *thin; i++)
        assert_true(trc_affine_is_thin(&thin[i]));
}

/* What stands on the plane comes back to what it is the image of: M inverse M = M. */
static void planes_are_undone(void **state) {
    (void)state;
    const struct trc_affine flat[] = {scaled(1, 1, 0),      scaled(0, 1e-10f, 2e-10f),
                                      slanted(1, 2, 0),     slanted(-3, 0, 1e3f),
                                      slanted(0, 1, 5e-3f), scaled(1, 1, 1e-39f)};
    static const double points[][3] = {{0, 0, 0}, {1, 2, 3}, {-4, 5, 0.5}};
    for (size_t i = 0; i < sizeof flat / sizeof *flat; i++) {
        struct trc_affine inverse;
        assert_true(trc_affine_invert_thin(&flat[i], &inverse));
        for (size_t k = 0; k < sizeof points / sizeof *points; k++) {
            double p[3], q[3], again[3];
            apply(&flat[i], points[k], p);
            apply(&inverse, p, q);
            apply(&flat[i], q, again);
            for (int r = 0; r < 3; r++) {
                double size = 0.0;
                for (int c = 0; c < 3; c++)
                    size = fmax(size, fabs((double)flat[i].m[4 * r + c]));
                /* Floats of the inverse, times what they are multiplied with. */
                assert_true(fabs(again[r] - p[r]) <=
                            1e-5 * (fabs(p[r]) + 10.0 * size + fabs(flat[i].m[4 * r + 3])));
            }
        }
    }
}

/* Of a flat one along the axes, coordinates are those of the object but for the lost one, which is
 * constant. */
static void lost_coordinate_is_constant(void **state) {
    (void)state;
    const struct trc_affine flat = scaled(2, 4, 0);
    struct trc_affine inverse;
    assert_true(trc_affine_invert_thin(&flat, &inverse));
    const double p[3] = {1 + 2 * 0.25, 2 + 4 * -0.5, 3};
    double q[3];
    apply(&inverse, p, q);
    assert_true(fabs(q[0] - 0.25) < 1e-6 && fabs(q[1] + 0.5) < 1e-6 && fabs(q[2]) < 1e-6);
}

static void lines_and_points_are_not(void **state) {
    (void)state;
    struct trc_affine bad[] = {scaled(0, 0, 0), scaled(1, 0, 0), scaled(1, 1, 1)};
    struct trc_affine inverse = {{42}};
    bad[2].m[5] = NAN;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_false(trc_affine_invert_thin(&bad[i], &inverse));
    bad[2] = scaled(1, 1, 0);
    bad[2].m[3] = INFINITY;
    assert_false(trc_affine_invert_thin(&bad[2], &inverse));
    assert_true(inverse.m[0] == 42);
}

static void even_scales_keep_angles(void **state) {
    (void)state;
    const struct trc_affine even[] = {scaled(1, 1, 1), scaled(-2, 2, 2),
                                      scaled(1e-18f, 1e-18f, 1e-18f), slanted(3, 3, 3),
                                      slanted(-1e15f, 1e15f, 1e15f)};
    const struct trc_affine uneven[] = {scaled(1, 1, 1.01f), slanted(1, 0.999f, 1), scaled(1, 0, 1),
                                        slanted(1e15f, 1.01e15f, 1e15f)};
    for (size_t i = 0; i < sizeof even / sizeof *even; i++)
        assert_true(trc_affine_keeps_angles(&even[i]));
    for (size_t i = 0; i < sizeof uneven / sizeof *uneven; i++)
        assert_false(trc_affine_keeps_angles(&uneven[i]));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(even_scales_keep_angles),
        cmocka_unit_test(thin_is_what_floats_cannot_undo),
        cmocka_unit_test(planes_are_undone),
        cmocka_unit_test(lost_coordinate_is_constant),
        cmocka_unit_test(lines_and_points_are_not),
    };
    return cmocka_run_group_tests_name("affine", tests, NULL, NULL);
}
