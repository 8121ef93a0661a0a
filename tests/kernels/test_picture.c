/* Whole pictures whose values are known without another renderer. */
#include "picture_test.h"

/* ---- light samples ---- */

#define GRID 8
#define GRID_PX 64

static void cell_albedo(uint32_t cell, float albedo[3]) {
    for (uint32_t k = 0; k < 3; k++)
        albedo[k] = 0.1f + 0.8f * (float)(cell * (5 + 2 * k) % 61) / 60.0f;
}

/* Under a sun without extent all light samples are alike, so any number of them gives the matt
 * square's albedo * irradiance / pi: also when so many wait that they are traced in the middle of a
 * step. */
static void any_number_of_light_samples(void **state) {
    (void)state;
    const float irradiance = 2.5f, window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
    const trc_scene scene = scene_create();
    for (uint32_t cell = 0; cell < GRID * GRID; cell++) {
        float albedo[3];
        cell_albedo(cell, albedo);
        const float edge = CAMERA_HEIGHT / GRID;
        add_square(scene, ((float)(cell % GRID) + 0.5f - GRID / 2) * edge,
                   ((float)(cell / GRID) + 0.5f - GRID / 2) * edge, 0.0f, 0.5f * edge,
                   add_material(scene, TRC_NODE_DIFFUSE, albedo, 0.0f));
    }
    trc_light_desc sun = default_light_desc();
    sun.type = TRC_LIGHT_SUN;
    sun.size_x = sun.size_y = 0.0f;
    sun.strength = irradiance;
    trc_id id = 0;
    assert_ok(trc_light_create(scene, &sun, &id));
    const trc_camera_desc camera = camera_desc(window);
    assert_ok(trc_scene_set_camera(scene, &camera));
    assert_ok(trc_scene_commit(scene));
    static float pixels[4 * GRID_PX * GRID_PX];
    static const uint32_t counts[] = {1, 2, 3, 4, 8, 64};
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        trc_render_desc desc = render_desc(GRID_PX, 4);
        desc.light_samples = counts[c];
        render(scene, &desc, pixels);
        for (uint32_t y = 0; y < GRID_PX; y++)
            for (uint32_t x = 0; x < GRID_PX; x++) {
                float albedo[3];
                cell_albedo(y * GRID / GRID_PX * GRID + x * GRID / GRID_PX, albedo);
                for (int k = 0; k < 3; k++) {
                    const float expected = albedo[k] * irradiance / (float)PI;
                    const float found = pixels[4 * (y * GRID_PX + x) + (uint32_t)k];
                    if (fabsf(found - expected) > 1e-5f * expected)
                        fail_msg("%u light samples: pixel %u %u has %g, not %g", counts[c], x, y,
                                 (double)found, (double)expected);
                }
            }
    }
    assert_ok(trc_scene_destroy(scene));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_number_of_light_samples),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("pictures", tests, NULL, NULL);
}
