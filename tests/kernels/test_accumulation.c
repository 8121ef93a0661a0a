/* The mean of very many samples of very different light.
 *
 * Films add up samples in double. Floats would fail this: a sum of 1e6, which the bright spot of a
 * pixel makes of 256 samples of 1e4, has a step of .06 to .25 and takes nothing of 1e-4, four
 * hundred-thousandths of the mean. */
#include "buffers.h"
#include "figures.h"
#include "picture_test.h"

/* As many as a pixel may have. Cells, so many by so many of a pixel, have the same number of them
 * each. */
#define SAMPLES (1u << 20)
#define CELLS 64
/* Usual, in all; the environment may ask for 1e9 (TRACER_TEST_RAYS). */
#define USUAL_SAMPLES (64 * SAMPLES)
#define BRIGHT 1e4f
#define EVEN 1.0f
#define DIM 1e-4f
#define TOLERANCE 1e-6

/* The side of a picture, in pixels, that takes so many samples or more. */
static uint32_t side_of(uint32_t samples) {
    return (uint32_t)ceil(sqrt((double)samples / SAMPLES));
}

/* Emission of a strength, and two channels that say which it is. */
static trc_id add_light(trc_scene scene, float strength, float is_bright, float is_even) {
    return add_material(scene, TRC_NODE_EMISSION, (float[3]){strength, is_bright, is_even}, 1.0f);
}

/* A dim ground seen in parallel from above, a metre a pixel, and in each pixel two spots of one
 * cell, others than in its neighbours. */
static trc_scene spots_create(uint32_t side) {
    const float window[4] = {0.0f, (float)side, 0.0f, (float)side}, half = 0.5f / CELLS;
    const trc_scene scene = scene_create();
    const trc_id bright = add_light(scene, BRIGHT, 1, 0), even = add_light(scene, EVEN, 0, 1);
    add_square(scene, 0.5f * (float)side, 0.5f * (float)side, -1.0f, (float)side,
               add_light(scene, DIM, 0, 0));
    for (uint32_t i = 0; i < side * side; i++) {
        const uint32_t column = i * 5 % CELLS, row = i * 11 % CELLS;
        const float left = (float)(i % side) + half, bottom = (float)(i / side) + half;
        const float y = bottom + (float)row / CELLS;
        add_square(scene, left + (float)column / CELLS, y, 0.0f, half, bright);
        add_square(scene, left + (float)(CELLS - 1 - column) / CELLS, y, 0.0f, half, even);
    }
    trc_camera_desc camera = camera_desc(window);
    camera.type = TRC_CAMERA_ORTHOGRAPHIC;
    set_camera(scene, &camera);
    return scene;
}

/* What a pixel is off by, as a part of it. The first channel is the light, the others are the parts
 * of the samples that met the spots: a few, nearest to the sides of a cell, are rounded to beyond
 * them. */
static double pixel_error(const float *pixel) {
    const double is_bright = (double)pixel[1], is_even = (double)pixel[2];
    const double cell = 1.0 / (CELLS * CELLS), rounded = 8.0 / SAMPLES;
    assert_true(fabs(is_bright - cell) <= rounded && fabs(is_even - cell) <= rounded);
    const double mean = (double)BRIGHT * is_bright + (double)EVEN * is_even +
                        (double)DIM * (1.0 - is_bright - is_even);
    return fabs((double)pixel[0] / mean - 1.0);
}

static void many_samples(void **state) {
    (void)state;
    const uint32_t side = side_of(query_test_rays(USUAL_SAMPLES));
    float *pixels = buffer_alloc((size_t)4 * side * side, sizeof *pixels);
    const trc_scene scene = spots_create(side);
    trc_render_desc desc = render_desc(side, SAMPLES);
    desc.filter_width = 1.0f;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    double worst = 0.0;
    for (uint32_t i = 0; i < side * side; i++) {
        const double error = pixel_error(pixels + 4 * (size_t)i);
        if (!(error <= TOLERANCE))
            fail_msg("pixel %u has %.9g, %.1e off", i, (double)pixels[4 * (size_t)i], error);
        worst = fmax(worst, error);
    }
    free(pixels);
    print_figure("40: very many samples over 1e8 of range", "%.1e samples: off by %.1e",
                 (double)side * side * SAMPLES, worst);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(many_samples),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("accumulation", tests, NULL, NULL);
}
