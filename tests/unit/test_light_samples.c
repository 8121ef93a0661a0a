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

/* Behind transparent surfaces, too: under a sun without extent all samples are alike. */
static void behind_a_veil(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    const trc_scene scene = fixture_level_view();
    struct default_material m;
    trc_id veil = 0, id = 0;
    default_material_init(&m, TRC_NODE_TRANSPARENT);
    m.node.input_count = m.desc.input_count = 1;
    m.desc.flags |= TRC_MATERIAL_TRANSPARENT_SHADOW;
    assert_int_equal(trc_material_create(scene, &m.desc, &veil), TRC_OK);
    trc_light_desc sun = default_light_desc();
    sun.type = TRC_LIGHT_SUN;
    sun.size_x = sun.size_y = 0.0f;
    sun.strength = 3.14159265f;
    assert_int_equal(trc_light_create(scene, &sun, &id), TRC_OK);
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    fixture_level(scene, 100.0f, 0.25f, veil); /* .5 for the camera, .5 for the light */
    fixture_level(scene, 100.0f, 0.5f, veil);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    for (uint32_t integrator = 0; integrator <= TRC_INTEGRATOR_DISTRIBUTION; integrator++)
        for (uint32_t light_samples = 1; light_samples <= 8; light_samples *= 2) {
            trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, 2);
            desc.integrator = integrator;
            desc.light_samples = light_samples;
            fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, 4 * FRAME);
            for (int i = 0; i < FRAME; i++)
                if (fabsf(pixels[4 * i] - 0.5f / 16.0f) > 1e-6f)
                    fail_msg("integrator %u, %u light samples: pixel %d has %g", integrator,
                             light_samples, i, (double)pixels[4 * i]);
        }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(any_number),
                                       cmocka_unit_test(passes_change_nothing),
                                       cmocka_unit_test(behind_a_veil)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
