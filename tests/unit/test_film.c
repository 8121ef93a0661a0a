/* The film adds up every sample of every pixel, in whatever order and parts they come. */
#include "fixture.h"

enum { WIDTH = 80, HEIGHT = 72, FRAME = WIDTH * HEIGHT };

/* Under an even sky that fills the view a sum of all samples over their number is its radiance;
 * with an open shutter, or a wide lens, a pixel's samples come in several parts. */
static void all_samples(void **state) {
    (void)state;
    static float pixels[4 * FRAME], counts[FRAME];
    static const float transforms[24] = {1, 0, 0, 0,    0, 1, 0, 0, 0, 0, 1, 0,
                                         1, 0, 0, 0.1f, 0, 1, 0, 0, 0, 0, 1, 0};
    static const float windows[8] = {-0.5f, 0.5f, -0.5f, 0.5f, -0.5f, 0.5f, -0.5f, 0.5f};
    const uint32_t samples[] = {1, 7, 40};
    for (int kind = 0; kind < 3; kind++) {
        trc_scene scene = 0;
        const trc_scene_desc scene_desc = default_scene_desc();
        assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
        trc_camera_desc camera = default_camera_desc();
        camera.transforms = transforms;
        camera.windows = windows;
        camera.key_count = kind == 1 ? 2 : 1;
        camera.shutter_time = kind == 1 ? 1.0f : 0.0f;
        camera.aperture_radius = kind == 2 ? 0.5f : 0.0f;
        assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
        const trc_world_desc world =
            default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f));
        assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        for (int i = 0; i < 3; i++) {
            trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples[i]);
            desc.passes |= UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
            trc_render render = 0;
            assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
            assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
            assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, 4 * FRAME), TRC_OK);
            assert_int_equal(trc_render_read(render, TRC_PASS_SAMPLE_COUNT, counts, FRAME), TRC_OK);
            assert_int_equal(trc_render_destroy(render), TRC_OK);
            for (uint32_t k = 0; k < FRAME; k++) {
                assert_int_equal((int)counts[k], (int)samples[i]);
                assert_true(fabsf(pixels[4 * k] - 0.25f) < 1e-6f);
            }
        }
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_samples)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
