/* What tests of whole pictures share: scenes of few objects seen from above, rendered through the
 * public API. Needs cmocka. */
#ifndef TRACER_TESTS_PICTURE_TEST_H
#define TRACER_TESTS_PICTURE_TEST_H

#include "query_test.h"

#include "fixture.h"

#define PICTURE_TEST_INLINE static inline __attribute__((unused))

#define PI 3.14159265358979

/* Of the default camera, which looks down on the origin: x is right, y is up. */
#define CAMERA_HEIGHT 6.0f

PICTURE_TEST_INLINE trc_scene scene_create(void) {
    const trc_scene_desc desc = default_scene_desc();
    trc_scene scene = 0;
    assert_ok(trc_scene_create(&desc, &scene));
    return scene;
}

/* A material of one node with a colour and a number (diffuse: roughness, emission and background:
 * strength). */
PICTURE_TEST_INLINE trc_id add_material(trc_scene scene, uint32_t type, const float color[3],
                                        float number) {
    struct default_material m;
    trc_id id = 0;
    default_material_init(&m, type);
    memcpy(m.inputs[0].value, color, sizeof m.inputs[0].value);
    m.inputs[1].value[0] = number;
    assert_ok(trc_material_create(scene, &m.desc, &id));
    return id;
}

/* Shows a vector, an output of the node given, as colour: scale * vector + .5. type: EMISSION or
 * BACKGROUND. */
PICTURE_TEST_INLINE trc_id add_vector_shader(trc_scene scene, uint32_t type, uint32_t vector_node,
                                             float scale) {
    const trc_node_input inputs[] = {{.node = 0, .output = 0},
                                     {.node = -1, .value = {scale, scale, scale}},
                                     {.node = -1, .value = {0.5f, 0.5f, 0.5f}},
                                     {.node = -1},
                                     {.node = 1, .output = 0},
                                     {.node = -1, .value = {1.0f}}};
    const trc_node nodes[] = {
        {.type = vector_node},
        {.type = TRC_NODE_VECTOR_MATH, .mode = TRC_VECTOR_MULTIPLY_ADD, .input_count = 4},
        {.type = type, .first_input = 4, .input_count = 2}};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 3,
                                    .nodes = nodes,
                                    .inputs = inputs,
                                    .input_count = 6,
                                    .surface = 2};
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* A square of edge 2 * half around (x, y, z), facing up. */
PICTURE_TEST_INLINE void add_square(trc_scene scene, float x, float y, float z, float half,
                                    trc_id material) {
    const float corners[12] = {x - half, y - half, z, x + half, y - half, z,
                               x + half, y + half, z, x - half, y + half, z};
    fixture_quad(scene, corners, material);
}

/* A camera whose picture spans left, right, bottom, top at distance 1. */
PICTURE_TEST_INLINE trc_camera_desc camera_desc(const float window[4]) {
    trc_camera_desc desc = default_camera_desc();
    desc.windows = window;
    desc.focus_distance = CAMERA_HEIGHT;
    return desc;
}

/* The scene as the camera has it from now on. */
PICTURE_TEST_INLINE void set_camera(trc_scene scene, const trc_camera_desc *camera) {
    assert_ok(trc_scene_set_camera(scene, camera));
    assert_ok(trc_scene_commit(scene));
}

/* A square picture seen through narrow pixels, so that each shows one point of the scene. */
PICTURE_TEST_INLINE trc_render_desc render_desc(uint32_t size, uint32_t samples) {
    trc_render_desc desc = default_render_desc(size, size, samples);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 0.01f;
    return desc;
}

/* Renders the committed scene; pixels: RGBA, lowest row first. Every sample must be finite. Returns
 * what has been done. */
PICTURE_TEST_INLINE trc_render_progress render(trc_scene scene, const trc_render_desc *desc,
                                               float *pixels) {
    trc_render_progress progress = {.struct_size = sizeof progress};
    trc_render id = 0;
    assert_ok(trc_render_start(scene, desc, &id));
    assert_ok(trc_render_wait(id, INFINITY));
    assert_ok(
        trc_render_read(id, TRC_PASS_COMBINED, pixels, (uint64_t)4 * desc->width * desc->height));
    assert_ok(trc_render_poll(id, &progress));
    assert_ok(trc_render_destroy(id));
    assert_true(progress.dropped_samples == 0);
    return progress;
}

#endif
