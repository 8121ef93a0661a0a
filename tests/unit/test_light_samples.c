/* Several light samples for each camera hit: more than the queue of shadow rays holds at once. */
#include "fixture.h"

enum { WIDTH = 64, HEIGHT = 48, FRAME = WIDTH * HEIGHT };

static void draw(trc_scene scene, uint32_t samples, uint32_t light_samples, float *pixels) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples);
    desc.light_samples = light_samples;
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, 4 * FRAME);
}

/* The picture does not depend on how its light samples are spread over its samples: the means of
 * all pixels agree, and the means of blocks of 8 x 8. */
static void any_number(void **state) {
    (void)state;
    static float reference[4 * FRAME], pixels[4 * FRAME];
    const trc_scene scene = fixture_scene();
    draw(scene, 256, 1, reference);
    for (uint32_t light_samples = 2; light_samples <= 64; light_samples *= 2) {
        draw(scene, 32, light_samples, pixels);
        for (int y = 0; y < HEIGHT; y += 8)
            for (int x = 0; x < WIDTH; x += 8) {
                double sum = 0.0, expected = 0.0;
                for (int j = y; j < y + 8; j++)
                    for (int i = x; i < x + 8; i++) {
                        sum += (double)pixels[4 * (j * WIDTH + i)];
                        expected += (double)reference[4 * (j * WIDTH + i)];
                    }
                if (fabs(sum - expected) > 0.01 * expected + 1e-3)
                    fail_msg("%u light samples, block %d %d: %f, not %f", light_samples, x, y, sum,
                             expected);
            }
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Passes only look: the picture with all of them has the same bits. */
static void passes_change_nothing(void **state) {
    (void)state;
    static float without[4 * FRAME], with[4 * FRAME];
    const trc_scene scene = fixture_scene();
    draw(scene, 8, 4, without);
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, 8);
    desc.light_samples = 4;
    desc.passes = (UINT64_C(1) << TRC_PASS_COUNT) - 1;
    desc.cryptomattes = 1;
    desc.cryptomatte_depth = 2;
    desc.aov_value_count = desc.light_group_count = 1;
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, with, 4 * FRAME);
    assert_memory_equal(with, without, sizeof with);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(any_number),
                                       cmocka_unit_test(passes_change_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
