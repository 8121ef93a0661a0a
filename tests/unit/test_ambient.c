/* Ambient occlusion against closed forms: parallel planes, a corner, a closed box, what it does to
 * the rest of the light. */
#include "fixture.h"

#include <stdio.h>

/* The default material's albedo. */
#define ALBEDO 0.8

enum { WIDTH = 16, HEIGHT = 4, FRAME = WIDTH * HEIGHT, SAMPLES = 1024 };

struct setting {
    float distance, factor;
    uint32_t method, light_samples;
    trc_id world;
};

/* Radiance of the columns of pixels, from x = 0 on. */
static void draw(trc_scene scene, const struct setting *s, uint32_t pass, double column[WIDTH]) {
    trc_world_desc world = default_world_desc(s->world);
    world.ao_distance = s->distance;
    world.ao_factor = s->factor;
    world.ao_method = s->method;
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, SAMPLES);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1.0f;
    desc.light_samples = s->light_samples;
    desc.passes = UINT64_C(1) << pass;
    float pixels[4 * FRAME];
    const uint32_t channels = trc_pass_channels(pass);
    fixture_draw(scene, &desc, pass, pixels, channels * FRAME);
    for (int x = 0; x < WIDTH; x++) {
        column[x] = 0.0;
        for (int y = 0; y < HEIGHT; y++)
            column[x] += (double)pixels[channels * (uint32_t)(y * WIDTH + x)] / HEIGHT;
    }
}

static void expect_all(const double column[WIDTH], double value, double tolerance) {
    for (int x = 0; x < WIDTH; x++) {
        if (fabs(column[x] - value) > tolerance)
            fail_msg("column %d: %.6f, not %.6f", x, column[x], value);
    }
}

/* Nothing above: every ray is free, and there is no noise at all. */
static void plane(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double column[WIDTH];
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    draw(scene, &(struct setting){.distance = 1e20f, .factor = 0.7f}, 0, column);
    expect_all(column, 0.5 * 0.7, 1e-6);
    draw(scene, &(struct setting){.distance = 3.0f, .factor = 2.0f, .light_samples = 4}, 0, column);
    expect_all(column, 0.5 * 2.0, 1e-6);
    draw(scene, &(struct setting){.distance = 3.0f}, 0, column);
    expect_all(column, 0.0, 0.0);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A ceiling at height h blocks the rays shorter than the distance d: those with a cosine above h /
 * d, 1 - (h / d)^2 of them by the cosine. */
static void ceiling(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, (float)ALBEDO);
    const trc_id sky = fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f);
    fixture_level(scene, 1000.0f, 0.0f, grey);
    fixture_level(scene, 1000.0f, 1.5f, grey);
    for (uint32_t method = 0; method < 2; method++)
        for (uint32_t lights = 1; lights <= 4; lights *= 4)
            for (int i = 0; i < 4; i++) {
                static const double distance[4] = {1.49, 2.0, 3.0, 15.0};
                const double free = fmin(1.0, pow(1.5 / distance[i], 2.0));
                const double light = method == TRC_AO_ADD ? 1.0 : 0.25;
                double column[WIDTH];
                draw(scene,
                     &(struct setting){(float)distance[i], 0.5f, method, lights,
                                       method == TRC_AO_ADD ? 0 : sky},
                     0, column);
                expect_all(column, ALBEDO * 0.5 * light * free, 2e-3 * light);
            }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A wall of height h along the edge x = 0 of a floor: at x it hides half of 1 - x / sqrt(x^2 + h^2)
 * of the hemisphere by the cosine, so half of it in the corner. */
static void corner(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, (float)ALBEDO);
    const float wall[12] = {0, -40.0f, 0, 0, 40.0f, 0, 0, 40.0f, 3, 0, -40.0f, 3};
    double column[WIDTH];
    fixture_level(scene, 40.0f, 0.0f, grey);
    fixture_quad(scene, wall, grey);
    draw(scene, &(struct setting){.distance = 1e20f, .factor = 1.0f}, 0, column);
    double most = 0.0;
    for (int x = 0; x < WIDTH; x++) {
        /* The mean over the pixel: the integral of x / sqrt(x^2 + h^2) is the root. */
        const double left = 4.0 * x / WIDTH, right = 4.0 * (x + 1) / WIDTH;
        const double slope = (hypot(right, 3.0) - hypot(left, 3.0)) / (right - left);
        most = fmax(most, fabs(column[x] / ALBEDO - 0.5 * (1.0 + slope)));
    }
    printf("corner: at most %.2e off, %.4f beside the wall\n", most, column[0] / ALBEDO);
    assert_true(most < 4e-3);
    /* In the corner itself: 4 cm of floor. */
    static const float transform[12] = {1, 0, 0, 0.02f, 0, 1, 0, 0, 0, 0, 1, 1};
    static const float window[4] = {-0.02f, 0.02f, -0.5f, 0.5f};
    trc_camera_desc camera = default_camera_desc();
    camera.type = TRC_CAMERA_ORTHOGRAPHIC;
    camera.transforms = transform;
    camera.windows = window;
    assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
    draw(scene, &(struct setting){.distance = 1e20f, .factor = 1.0f}, 0, column);
    expect_all(column, ALBEDO * 0.5, 8e-3); /* 0.005 of it is the distance */
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* What is behind something clear is still the camera's first hit: it has as many rays as light
 * samples. Arithmetic alone: no ray is blocked. */
static void behind_glass(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double column[WIDTH];
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    fixture_level(scene, 100.0f, 0.5f, fixture_clear(scene));
    for (uint32_t lights = 1; lights <= 4; lights *= 4) {
        draw(scene, &(struct setting){.distance = 3.0f, .factor = 0.7f, .light_samples = lights}, 0,
             column);
        expect_all(column, 0.5 * 0.7, 1e-6);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Nothing comes in where the distance is longer than the box; a mirror shows the same light. */
static void box(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    const float above[12] = {5, 0, 0, 0, 0, 5, 0, 0, 0, 0, 5, 4};
    trc_id mesh = 0, instance = 0;
    trc_mesh_desc mesh_desc = default_mesh_desc();
    double column[WIDTH];
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.transforms = above;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    draw(scene, &(struct setting){.distance = 18.0f, .factor = 1.0f}, 0, column);
    expect_all(column, 0.0, 0.0);
    draw(scene, &(struct setting){.distance = 0.5f, .factor = 1.0f}, 0, column);
    expect_all(column, ALBEDO, 1e-6);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void mirror(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double column[WIDTH];
    fixture_level(scene, 1000.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.0f));
    fixture_level(scene, 1000.0f, 1.5f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    draw(scene, &(struct setting){.distance = 3.0f, .factor = 1.0f}, 0, column);
    expect_all(column, 0.5 * 0.25, 2e-3);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* The pass of direct diffuse light has it, divided by the colour. */
static void passes(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double column[WIDTH];
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    const struct setting s = {.distance = 3.0f, .factor = 0.7f};
    draw(scene, &s, TRC_PASS_DIFFUSE_DIRECT, column);
    expect_all(column, 0.7, 1e-6);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* The pass of its own is the free part alone, whatever the surface is and with the effect off. */
static void own_pass(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double column[WIDTH];
    fixture_level(scene, 1000.0f, 0.0f, fixture_material(scene, TRC_NODE_EMISSION, 0.5f));
    fixture_level(scene, 1000.0f, 1.5f, 0);
    draw(scene, &(struct setting){.distance = 3.0f}, TRC_PASS_AMBIENT_OCCLUSION, column);
    expect_all(column, 0.25, 5e-3);
    draw(scene, &(struct setting){.distance = 3.0f}, TRC_PASS_COMBINED, column);
    expect_all(column, 0.5, 1e-6);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Replacing takes the world's own light from diffuse surfaces, and only that: with a lamp the
 * picture is the sum. */
static void replaced(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    double both[WIDTH], lamp[WIDTH];
    trc_id light = 0;
    const trc_light_desc light_desc = default_light_desc();
    const trc_id sky = fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f);
    fixture_level(scene, 1000.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    assert_int_equal(trc_light_create(scene, &light_desc, &light), TRC_OK);
    draw(scene, &(struct setting){.distance = 3.0f, .light_samples = 8}, 0, lamp);
    draw(scene, &(struct setting){3.0f, 0.6f, TRC_AO_REPLACE, 8, sky}, 0, both);
    for (int x = 0; x < WIDTH; x++)
        both[x] -= lamp[x];
    expect_all(both, 0.5 * 0.25 * 0.6, 1e-3);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* An object's own distance: under a ceiling at h, (h / d)^2 of the rays are free. It is for
 * replacing alone. */
static void own_distance(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    const float floor[12] = {-1e3f, -1e3f, 0, 1e3f, -1e3f, 0, 1e3f, 1e3f, 0, -1e3f, 1e3f, 0};
    const trc_mesh_desc mesh_desc = fixture_quad_desc(floor);
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, (float)ALBEDO);
    const trc_id sky = fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f);
    trc_id mesh = 0, instance = 0;
    double column[WIDTH];
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = &grey;
    desc.material_count = 1;
    desc.ao_distance = 2.0f;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    fixture_level(scene, 1000.0f, 1.5f, grey);
    draw(scene, &(struct setting){15.0f, 0.5f, TRC_AO_REPLACE, 4, sky}, 0, column);
    expect_all(column, ALBEDO * 0.5 * 0.25 * 0.5625, 5e-4);
    draw(scene, &(struct setting){15.0f, 0.5f, TRC_AO_ADD, 4, 0}, 0, column);
    expect_all(column, ALBEDO * 0.5 * 0.01, 2e-3);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plane),       cmocka_unit_test(ceiling),  cmocka_unit_test(corner),
        cmocka_unit_test(box),         cmocka_unit_test(mirror),   cmocka_unit_test(passes),
        cmocka_unit_test(own_pass),    cmocka_unit_test(replaced), cmocka_unit_test(behind_glass),
        cmocka_unit_test(own_distance)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
