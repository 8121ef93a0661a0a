/* Lenses: how they blur, and what is left of that at their limits. */
#include "figures.h"
#include "picture_test.h"

#include <float.h>

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

/* ---- lenses at their limits ---- */

enum { LENS_PX = 32, LENS_FLOATS = 4 * LENS_PX * LENS_PX };

/* A floor that shows its position, seen through a lens. */
static void draw_floor(const trc_camera_desc *camera, uint32_t seed, float pixels[LENS_FLOATS]) {
    const trc_scene scene = scene_create();
    add_square(scene, 0.0f, 0.0f, 0.0f, 4.0f,
               add_vector_shader(scene, TRC_NODE_EMISSION, TRC_NODE_GEOMETRY, 0.1f));
    set_camera(scene, camera);
    trc_render_desc desc = render_desc(LENS_PX, 4);
    desc.filter_width = 1.0f;
    desc.seed = seed;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
}

static const float lens_window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};

/* A camera with every setting of its lens off the default. */
static trc_camera_desc lens_desc(float radius, float focus) {
    trc_camera_desc camera = camera_desc(lens_window);
    camera.aperture_radius = radius;
    camera.focus_distance = focus;
    camera.aperture_ratio = 2.0f;
    camera.blade_count = 5;
    camera.blade_rotation = 0.3f;
    return camera;
}

static double largest_difference(const float *a, const float *b, uint32_t count) {
    double largest = 0.0;
    for (uint32_t i = 0; i < count; i++) {
        if (!isfinite(a[i]) || !isfinite(b[i]))
            return INFINITY;
        largest = fmax(largest, fabs((double)a[i] - (double)b[i]));
    }
    return largest;
}

/* A lens without extent is a pinhole to the bit, one of hardly any extent within rounding. */
static void smallest_apertures(void **state) {
    (void)state;
    static float pinhole[LENS_FLOATS], lens[LENS_FLOATS];
    static const float focus[] = {1e-3f, CAMERA_HEIGHT, 1e10f};
    double worst = 0.0;
    for (uint32_t seed = 1; seed <= 3; seed++) {
        const trc_camera_desc plain = camera_desc(lens_window);
        draw_floor(&plain, seed, pinhole);
        for (size_t f = 0; f < sizeof focus / sizeof *focus; f++) {
            trc_camera_desc camera = lens_desc(0.0f, focus[f]);
            draw_floor(&camera, seed, lens);
            assert_memory_equal(lens, pinhole, sizeof lens);
        }
        const trc_camera_desc camera = lens_desc(1e-8f, CAMERA_HEIGHT);
        draw_floor(&camera, seed, lens);
        worst = fmax(worst, largest_difference(lens, pinhole, LENS_FLOATS));
    }
    assert_true(worst <= 5e-7);
    print_figure("30: aperture of 1e-8", "off by at most %.1e of a pinhole's colours", worst);
}

/* Where a lens is focused, its size does not matter. */
static void wide_apertures_in_focus(void **state) {
    (void)state;
    static float pinhole[LENS_FLOATS], lens[LENS_FLOATS];
    const trc_camera_desc plain = camera_desc(lens_window);
    draw_floor(&plain, 1, pinhole);
    static const float radii[] = {1.0f, 100.0f};
    double worst = 0.0;
    for (size_t r = 0; r < sizeof radii / sizeof *radii; r++) {
        const trc_camera_desc camera = lens_desc(radii[r], CAMERA_HEIGHT);
        draw_floor(&camera, 1, lens);
        worst = fmax(worst, largest_difference(lens, pinhole, LENS_FLOATS));
    }
    /* Colours change by .1 a metre; places on a lens of 100 m are rounded by up to 4e-6 m, and so
     * is where their rays arrive. */
    assert_true(worst <= 1e-5);
    print_figure("30: aperture of 100 m in focus", "off by at most %.1e of a pinhole's colours",
                 worst);
}

static void extreme_lenses(void **state) {
    (void)state;
    static float pixels[LENS_FLOATS], farthest[LENS_FLOATS];
    static const float radii[] = {1e-30f, 0.2f, 1e3f, 1e10f, 1e19f, FLT_MAX};
    static const float focus[] = {1e-3f, CAMERA_HEIGHT, 1e10f, FLT_MAX, INFINITY};
    for (size_t r = 0; r < sizeof radii / sizeof *radii; r++)
        for (size_t f = 0; f < sizeof focus / sizeof *focus; f++) {
            trc_camera_desc camera = lens_desc(radii[r], focus[f]);
            camera.aperture_ratio = 0.5f; /* the largest is twice as wide as floats go */
            draw_floor(&camera, 1, pixels);
            for (uint32_t i = 0; i < LENS_FLOATS; i++)
                if (!(pixels[i] >= 0.0f && pixels[i] <= 1.0f))
                    fail_msg("radius %g, focus %g: %g", (double)radii[r], (double)focus[f],
                             (double)pixels[i]);
        }
    /* What is farther than a billion metres is as far as it gets. */
    trc_camera_desc camera = lens_desc(0.2f, 1e10f);
    draw_floor(&camera, 1, pixels);
    camera.focus_distance = INFINITY;
    draw_floor(&camera, 1, farthest);
    assert_memory_equal(pixels, farthest, sizeof pixels);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(circle_of_confusion),
        cmocka_unit_test(smallest_apertures),
        cmocka_unit_test(wide_apertures_in_focus),
        cmocka_unit_test(extreme_lenses),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("lenses", tests, NULL, NULL);
}
