/* Nodes that trace rays against closed forms, shown as emission: a floor below a ceiling at a
 * height h, and a corner. */
#include "fixture.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

enum { WIDTH = 16, HEIGHT = 4, FRAME = WIDTH * HEIGHT, SAMPLES = 256 };

/* How high the ceiling is, m. */
#define CEILING 1.5f

/* A constant, the default of its kind, or output of the node before it. */
static trc_node_input constant(float x, float y, float z) {
    return (trc_node_input){.node = TRC_INPUT_CONSTANT, .value = {x, y, z}};
}
static trc_node_input unlinked(void) { return (trc_node_input){.node = TRC_INPUT_DEFAULT}; }

/* What a node gives, as emission; factor: of it. */
static trc_id shown_named(trc_scene scene, uint32_t type, uint32_t mode, const char *name,
                          const trc_node_input in[3], uint32_t input_count, uint32_t output,
                          float factor) {
    trc_node_input inputs[5];
    for (uint32_t i = 0; i < input_count; i++)
        inputs[i] = in[i];
    inputs[input_count] = (trc_node_input){.node = 0, .output = output};
    inputs[input_count + 1] = constant(factor, 0.0f, 0.0f);
    const trc_node nodes[2] = {
        {.type = type, .mode = mode, .name = name, .input_count = input_count},
        {.type = TRC_NODE_EMISSION, .first_input = input_count, .input_count = 2}};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 2,
                                    .nodes = nodes,
                                    .inputs = inputs,
                                    .input_count = input_count + 2,
                                    .surface = 1};
    trc_id id = 0;
    assert_int_equal(trc_material_create(scene, &desc, &id), TRC_OK);
    return id;
}

static trc_id shown(trc_scene scene, uint32_t type, uint32_t mode, const trc_node_input in[3],
                    uint32_t input_count, uint32_t output, float factor) {
    return shown_named(scene, type, mode, NULL, in, input_count, output, factor);
}

/* Radiance of the columns of pixels, from x = 0 on. */
static void draw(trc_scene scene, uint32_t channel, double column[WIDTH]) {
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, SAMPLES);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1.0f;
    float pixels[4 * FRAME];
    fixture_draw(scene, &desc, 0, pixels, 4 * FRAME);
    for (int x = 0; x < WIDTH; x++) {
        column[x] = 0.0;
        for (int y = 0; y < HEIGHT; y++)
            column[x] += (double)pixels[4 * (y * WIDTH + x) + (int)channel] / HEIGHT;
    }
}

static void expect_all(const double column[WIDTH], double value, double tolerance) {
    for (int x = 0; x < WIDTH; x++)
        if (!(fabs(column[x] - value) <= tolerance))
            fail_msg("column %d: %.6f, not %.6f", x, column[x], value);
}

/* A floor and, of the same instance, what is above it: a ceiling. */
static void add_room(trc_scene scene, trc_id material) {
    const float h = CEILING, e = 1e3f;
    const float corners[24] = {-e, -e, 0, e, -e, 0, e, e, 0, -e, e, 0,
                               -e, -e, h, e, -e, h, e, e, h, -e, e, h};
    static const uint32_t indices[12] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7};
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = 8;
    desc.triangle_count = 4;
    desc.positions = corners;
    desc.position_count = 24;
    desc.indices = indices;
    desc.index_count = 12;
    fixture_mesh(scene, &desc, material, 0);
}

/* Rays shorter than the distance d meet the ceiling if their cosine is above h / d: (h / d)^2 of
 * them do not. Locally, what is in the way of the own ceiling, and what is in its place, does not
 * count; of the inside nothing is near. */
static void ambient_occlusion(void **state) {
    (void)state;
    static const struct {
        uint32_t mode;
        float distance, others; /* the height of a ceiling of another instance */
        double open;
    } cases[] = {{5, 1.49f, 3.0f, 1.0},
                 {7, 3.0f, 3.0f, 0.25},
                 {1, 3.0f, 1.2f, 0.16},
                 {200, 3.0f, 3.0f, 0.25},
                 {16 | TRC_AMBIENT_ONLY_LOCAL, 3.0f, 1.2f, 0.25},
                 {16 | TRC_AMBIENT_ONLY_LOCAL, 3.0f, CEILING, 0.25},
                 {3 | TRC_AMBIENT_INSIDE, 3.0f, 3.0f, 1.0},
                 {8 | TRC_AMBIENT_OF_WORLD, 0.0f, 3.0f, 0.25}};
    double worst = 0.0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const trc_scene scene = fixture_level_view();
        const trc_node_input in[3] = {constant(0.5f, 0.5f, 0.5f),
                                      constant(cases[i].distance, 0.0f, 0.0f), unlinked()};
        double column[WIDTH];
        add_room(scene, shown(scene, TRC_NODE_AMBIENT_OCCLUSION, cases[i].mode, in, 3, 0, 2.0f));
        fixture_level(scene, 1e3f, cases[i].others, 0);
        trc_world_desc world = default_world_desc(0);
        world.ao_distance = 3.0f;
        assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
        draw(scene, 1, column);
        expect_all(column, cases[i].open, 2e-2);
        double mean = 0.0;
        for (int x = 0; x < WIDTH; x++)
            mean += column[x] / WIDTH;
        worst = fmax(worst, fabs(mean - cases[i].open));
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
    printf("ambient occlusion: means at most %.2e off\n", worst);
    assert_true(worst < 2e-3);
}

/* A bevel keeps the normal of what is flat as far as it reaches, and halves the turn at an edge;
 * other instances do not matter. */
static void bevel(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    const trc_node_input in[3] = {constant(0.5f, 0.0f, 0.0f), unlinked()};
    const trc_id material = shown(scene, TRC_NODE_BEVEL, 16, in, 2, 0, 1.0f);
    /* A step down at x = 2 m, the edge in the middle of the picture. */
    const float corners[18] = {2, -9, 0, 2, 9, 0, -9, 9, 0, -9, -9, 0, 2, -9, -9, 2, 9, -9};
    static const uint32_t indices[12] = {3, 0, 1, 3, 1, 2, 0, 4, 5, 0, 5, 1};
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = 6;
    desc.triangle_count = 4;
    desc.positions = corners;
    desc.position_count = 18;
    desc.indices = indices;
    desc.index_count = 12;
    double up[WIDTH], along[WIDTH];
    fixture_mesh(scene, &desc, material, 0);
    fixture_level(scene, 9.0f, -0.1f, fixture_material(scene, TRC_NODE_EMISSION, 0.0f));
    draw(scene, 2, up);
    draw(scene, 0, along);
    for (int x = 0; x < WIDTH / 2 - 2; x++) { /* beyond .5 m of the edge */
        assert_true(fabs(up[x] - 1.0) < 1e-6);
        assert_true(fabs(along[x]) < 1e-6);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);

    /* Looked at closely: within 2 mm of it. */
    const trc_scene close = fixture_level_view();
    static const float transform[12] = {1, 0, 0, 1.999f, 0, 1, 0, 0, 0, 0, 1, 1};
    static const float window[4] = {-0.001f, 0.001f, -0.0005f, 0.0005f};
    trc_camera_desc camera = default_camera_desc();
    camera.type = TRC_CAMERA_ORTHOGRAPHIC;
    camera.transforms = transform;
    camera.windows = window;
    assert_int_equal(trc_scene_set_camera(close, &camera), TRC_OK);
    fixture_mesh(close, &desc, shown(close, TRC_NODE_BEVEL, 255, in, 2, 0, 1.0f), 0);
    draw(close, 2, up);
    draw(close, 0, along);
    double worst = 0.0;
    for (int x = 0; x < WIDTH; x++)
        worst = fmax(worst, fmax(fabs(up[x] - sqrt(0.5)), fabs(along[x] - sqrt(0.5))));
    printf("bevel at an edge: at most %.2e off\n", worst);
    assert_true(worst < 3e-2);
    assert_int_equal(trc_scene_destroy(close), TRC_OK);
}

/* Up from the floor, by twice a unit vector, to the ceilings of another instance at 1.2 m and of
 * the own; or from 1 m above the origin, aslant. */
static void raycast(void **state) {
    (void)state;
    enum { IS_HIT, SELF_HIT, DISTANCE, POSITION, NORMAL };
    enum { LOCAL = TRC_RAYCAST_ONLY_LOCAL };
    static const struct {
        uint32_t mode;
        bool is_elsewhere;
        float distance;
        uint32_t output, channel;
        double expected;
    } cases[] = {{0, false, 3.0f, IS_HIT, 0, 1.0},       {0, false, 3.0f, SELF_HIT, 0, 0.0},
                 {0, false, 3.0f, DISTANCE, 0, 0.6},     {0, false, 3.0f, POSITION, 2, 1.2},
                 {0, false, 3.0f, NORMAL, 2, -1.0},      {0, false, 0.5f, IS_HIT, 0, 0.0},
                 {0, false, 0.5f, DISTANCE, 0, 0.5},     {0, false, 0.5f, NORMAL, 2, 0.0},
                 {LOCAL, false, 3.0f, SELF_HIT, 0, 1.0}, {LOCAL, false, 3.0f, DISTANCE, 0, 0.75},
                 {LOCAL, true, 3.0f, DISTANCE, 0, 0.25}, {LOCAL, true, 3.0f, POSITION, 0, 0.5},
                 {0, true, 3.0f, POSITION, 0, 0.2}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const trc_scene scene = fixture_level_view();
        const bool is_elsewhere = cases[i].is_elsewhere;
        const trc_node_input in[3] = {is_elsewhere ? constant(0.0f, 0.0f, 1.0f) : unlinked(),
                                      constant(is_elsewhere ? 2.0f : 0.0f, 0.0f, 2.0f),
                                      constant(cases[i].distance, 0.0f, 0.0f)};
        double column[WIDTH];
        add_room(scene,
                 shown(scene, TRC_NODE_RAYCAST, cases[i].mode, in, 3, cases[i].output, 1.0f));
        fixture_level(scene, 1e3f, 1.2f, 0);
        draw(scene, cases[i].channel, column);
        expect_all(column, cases[i].expected, 1e-5);
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

/* Of the ceiling of another instance, black and opaque where that has no such attribute, nothing
 * beyond the ray's reach. */
static void raycast_attribute(void **state) {
    (void)state;
    static const float tint[4] = {0.3f, 0.6f, 0.9f, 0.5f};
    static const struct {
        const char *name;
        float distance;
        double color, alpha;
    } cases[] = {{"Tint", 3.0f, 0.6, 0.5}, {"Other", 3.0f, 0.0, 1.0}, {"Tint", 0.5f, 0.0, 0.0}};
    for (size_t i = 0; i < 2 * sizeof cases / sizeof *cases; i++) {
        const trc_scene scene = fixture_level_view();
        const bool is_alpha = i % 2;
        const trc_node_input in[3] = {unlinked(), constant(0.0f, 0.0f, 2.0f),
                                      constant(cases[i / 2].distance, 0.0f, 0.0f)};
        double column[WIDTH];
        add_room(scene, shown_named(scene, TRC_NODE_RAYCAST_ATTRIBUTE, 0, cases[i / 2].name, in, 3,
                                    is_alpha, 1.0f));
        const float h = 1.2f, e = 1e3f;
        const float corners[12] = {-e, -e, h, e, -e, h, e, e, h, -e, e, h};
        float values[4 * 6];
        for (size_t k = 0; k < 4 * 6; k++)
            values[k] = tint[k % 4];
        trc_corner_attribute attribute = trc_corner_attribute_default();
        attribute.width = 4;
        attribute.name = "Tint";
        attribute.values = values;
        attribute.value_count = 4 * 6;
        trc_mesh_desc desc = fixture_quad_desc(corners);
        desc.attribute_count = 1;
        desc.attributes = &attribute;
        fixture_mesh(scene, &desc, 0, 0);
        draw(scene, 1, column);
        expect_all(column, is_alpha ? cases[i / 2].alpha : cases[i / 2].color, 1e-5);
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(ambient_occlusion), cmocka_unit_test(bevel),
                                       cmocka_unit_test(raycast),
                                       cmocka_unit_test(raycast_attribute)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
