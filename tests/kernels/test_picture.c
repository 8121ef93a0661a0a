/* Whole pictures whose values are known without another renderer. */
#include "figures.h"
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

/* ---- circle of confusion ---- */

#define SPOT_PX 64

/* A shining square out of focus. What the lens does to a point is the image of the aperture with
 * radius * |1 / focus - 1 / distance| in the plane at distance 1; second moments of square,
 * aperture and pixels add. Returns the radius along x and y of the disk that has the aperture's
 * moments. */
static void measure_spot(float distance, const trc_camera_desc *camera, float half_window,
                         float radii_out[2]) {
    const float white[3] = {1, 1, 1}, half = 0.4f * half_window * distance;
    const trc_scene scene = scene_create();
    add_square(scene, 0.0f, 0.0f, CAMERA_HEIGHT - distance, half,
               add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
    assert_ok(trc_scene_set_camera(scene, camera));
    assert_ok(trc_scene_commit(scene));
    static float pixels[4 * SPOT_PX * SPOT_PX];
    trc_render_desc desc = render_desc(SPOT_PX, 256);
    desc.filter_width = 1.0f;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    double sum = 0.0, moments[2] = {0.0, 0.0};
    const double pixel = 2.0 * (double)half_window / SPOT_PX;
    for (uint32_t y = 0; y < SPOT_PX; y++)
        for (uint32_t x = 0; x < SPOT_PX; x++) {
            const double value = (double)pixels[4 * (y * SPOT_PX + x)];
            const double at[2] = {(x + 0.5 - SPOT_PX / 2) * pixel, (y + 0.5 - SPOT_PX / 2) * pixel};
            sum += value;
            for (int k = 0; k < 2; k++)
                moments[k] += value * at[k] * at[k];
        }
    const double square = (double)half / (double)distance;
    /* The filter blurs by a pixel, and every pixel's light counts at its middle. The moment of a
     * disk along one axis is radius^2 / 4. */
    for (int k = 0; k < 2; k++)
        radii_out[k] =
            (float)(2.0 * sqrt(moments[k] / sum - square * square / 3.0 - pixel * pixel / 12.0));
}

static void circle_of_confusion(void **state) {
    (void)state;
    static const struct {
        float radius, focus, distance, ratio;
        uint32_t blades;
    } cases[] = {{0.2f, 3.0f, 6.0f, 1.0f, 0},
                 {0.2f, 8.0f, 3.0f, 1.0f, 0},
                 {0.3f, 4.0f, 5.0f, 2.0f, 0},
                 {0.2f, 3.0f, 6.0f, 1.0f, 3},
                 {0.2f, 8.0f, 3.0f, 1.5f, 6}};
    double worst = 0.0;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const float confusion =
            cases[c].radius * fabsf(1.0f / cases[c].focus - 1.0f / cases[c].distance);
        /* Room for the aperture's image and the square's, which is 0.4 of it. */
        const float half_window = 1.75f * confusion;
        const float window[4] = {-half_window, half_window, -half_window, half_window};
        trc_camera_desc camera = camera_desc(window);
        camera.aperture_radius = cases[c].radius;
        camera.focus_distance = cases[c].focus;
        camera.aperture_ratio = cases[c].ratio;
        camera.blade_count = cases[c].blades;
        camera.blade_rotation = 0.4f;
        float radii[2];
        measure_spot(cases[c].distance, &camera, half_window, radii);
        /* A regular polygon with corners at the radius has the moments of a smaller disk. */
        const float angle = 2.0f * (float)PI / (float)cases[c].blades;
        const float disk =
            cases[c].blades ? confusion * sqrtf((2.0f + cosf(angle)) / 3.0f) : confusion;
        const float expected[2] = {disk / cases[c].ratio, disk};
        for (int k = 0; k < 2; k++) {
            const double error = fabs((double)radii[k] / (double)expected[k] - 1.0);
            if (!(error <= 0.005))
                fail_msg("case %zu, axis %d: radius %g, not %g", c, k, (double)radii[k],
                         (double)expected[k]);
            worst = fmax(worst, error);
        }
    }
    print_figure("30: circle of confusion", "radius off by at most %.2f %%", 100.0 * worst);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_number_of_light_samples),
        cmocka_unit_test(circle_of_confusion),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("pictures", tests, NULL, NULL);
}
