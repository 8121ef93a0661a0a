/* What light samples are taken of: an even world and emission that is not to be sampled are found
 * by the rays of glossy surfaces alone. */
#include "fixture.h"

enum { WIDTH = 16, HEIGHT = 4, FRAME = WIDTH * HEIGHT };

static trc_id add_emission(trc_scene scene, float strength, uint32_t flags) {
    struct default_material m;
    trc_id id = 0;
    default_material_init(&m, TRC_NODE_EMISSION);
    m.inputs[1].value[0] = strength;
    m.desc.flags = flags;
    assert_int_equal(trc_material_create(scene, &m.desc, &id), TRC_OK);
    return id;
}

static void draw(trc_scene scene, uint32_t samples, float *pixels) {
    const trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, 4 * FRAME);
}

static double mean(const float *pixels) {
    double sum = 0.0;
    for (uint32_t i = 0; i < FRAME; i++)
        sum += (double)pixels[4 * i] / FRAME;
    return sum;
}

static uint64_t light_triangles(trc_scene scene) {
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
    return stats.emissive_triangle_count;
}

/* Something matt and a lamp, both where the glossy floor does not see them, make the world a light
 * for others: the floor's picture stays the same. */
static void even_world(void **state) {
    (void)state;
    float alone[4 * FRAME], among[4 * FRAME];
    const trc_scene scene = fixture_level_view();
    const trc_world_desc world =
        default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.6f));
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    fixture_level(scene, 100.0f, 0.0f, fixture_glossy(scene, 0.5f, 0.3f));
    draw(scene, 64, alone);
    /* Half of the world, but for what a rough lobe loses below the horizon and by shadowing. */
    assert_true(mean(alone) > 0.28 && mean(alone) < 0.3001);
    fixture_level(scene, 1.0f, -1.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    trc_light_desc lamp = default_light_desc();
    trc_id light = 0;
    lamp.transform[11] = -0.5f;
    assert_int_equal(trc_light_create(scene, &lamp, &light), TRC_OK);
    draw(scene, 64, among);
    for (uint32_t i = 0; i < 4 * FRAME; i++)
        if (fabsf(among[i] - alone[i]) > 1e-5f)
            fail_msg("value %u: %f among others, %f alone", i, (double)among[i], (double)alone[i]);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A shining ceiling above the camera: the same light with and without samples of it. */
static void emission_by_choice(void **state) {
    (void)state;
    float pixels[4 * FRAME];
    double means[3];
    for (int i = 0; i < 3; i++) {
        const trc_scene scene = fixture_level_view();
        fixture_level(scene, 100.0f, 0.0f, fixture_glossy(scene, 0.5f, 0.5f));
        fixture_level(scene, 3.0f, 2.0f,
                      add_emission(scene, 2.0f, i == 0 ? TRC_MATERIAL_SAMPLE_EMISSION : 0));
        if (i == 2)
            fixture_level(scene, 1.0f, -1.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
        draw(scene, 1024, pixels);
        means[i] = mean(pixels);
        assert_int_equal((int)light_triangles(scene), i == 1 ? 0 : 2);
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
    assert_true(means[0] > 0.1);
    assert_true(fabs(means[1] - means[0]) < 2e-3 * means[0]);
    assert_true(fabs(means[2] - means[0]) < 2e-3 * means[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(even_world),
                                       cmocka_unit_test(emission_by_choice)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
