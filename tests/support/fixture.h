/* A small scene that uses every kind of object, and parts of others, for tests. Needs cmocka. */
#ifndef TRACER_TESTS_FIXTURE_H
#define TRACER_TESTS_FIXTURE_H

/* What cmocka.h needs, in its order. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "default_descs.h"

#define FIXTURE_INLINE static inline __attribute__((unused))

/* A committed scene: a cube with the default material, a light, a camera. */
FIXTURE_INLINE trc_scene fixture_scene(void) {
    trc_scene scene = 0;
    trc_id mesh = 0, instance = 0, light = 0;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    const trc_camera_desc camera_desc = default_camera_desc();
    const trc_light_desc light_desc = default_light_desc();
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    const trc_instance_desc instance_desc = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &instance_desc, &instance), TRC_OK);
    assert_int_equal(trc_light_create(scene, &light_desc, &light), TRC_OK);
    assert_int_equal(trc_scene_set_camera(scene, &camera_desc), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

/* Renders the committed scene; a pass of it, float_count numbers. */
FIXTURE_INLINE void fixture_draw(trc_scene scene, const trc_render_desc *desc, uint32_t pass,
                                 float *pixels, uint64_t float_count) {
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_read(render, pass, pixels, float_count), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

/* ---- for closed forms: level squares seen from above ---- */

/* An instance of a mesh, moved by a transform. flags: TRC_INSTANCE_*. */
FIXTURE_INLINE trc_id fixture_instance(trc_scene scene, trc_id mesh, const float transform[12],
                                       trc_id material, uint32_t flags) {
    trc_instance_desc desc = default_instance_desc(mesh);
    trc_id instance = 0;
    desc.transforms = transform;
    desc.materials = &material;
    desc.material_count = 1;
    desc.flags = flags;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    return instance;
}

/* The same of a new mesh; fixture_mesh: where it is. */
FIXTURE_INLINE trc_id fixture_mesh_at(trc_scene scene, const trc_mesh_desc *desc,
                                      const float transform[12], trc_id material, uint32_t flags) {
    trc_id mesh = 0;
    assert_int_equal(trc_mesh_create(scene, desc, &mesh), TRC_OK);
    return fixture_instance(scene, mesh, transform, material, flags);
}

FIXTURE_INLINE trc_id fixture_mesh(trc_scene scene, const trc_mesh_desc *desc, trc_id material,
                                   uint32_t flags) {
    return fixture_mesh_at(scene, desc, identity_transform, material, flags);
}

/* Two triangles; a, b, c, d counter-clockwise as seen from the front. */
FIXTURE_INLINE trc_mesh_desc fixture_quad_desc(const float corners[12]) {
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = 4;
    desc.triangle_count = 2;
    desc.positions = corners;
    desc.position_count = 12;
    desc.indices = indices;
    desc.index_count = 6;
    return desc;
}

FIXTURE_INLINE trc_id fixture_flagged_quad(trc_scene scene, const float corners[12],
                                           trc_id material, uint32_t flags) {
    const trc_mesh_desc desc = fixture_quad_desc(corners);
    return fixture_mesh(scene, &desc, material, flags);
}

FIXTURE_INLINE trc_id fixture_quad(trc_scene scene, const float corners[12], trc_id material) {
    return fixture_flagged_quad(scene, corners, material, 0);
}

/* A horizontal square around the origin. */
FIXTURE_INLINE trc_id fixture_level(trc_scene scene, float half, float z, trc_id material) {
    const float corners[12] = {-half, -half, z, half, -half, z, half, half, z, -half, half, z};
    return fixture_quad(scene, corners, material);
}

FIXTURE_INLINE trc_id fixture_material(trc_scene scene, uint32_t type, float value) {
    struct default_material m;
    trc_id id = 0;
    default_material_init(&m, type);
    for (int c = 0; c < 3; c++)
        m.inputs[0].value[c] = value;
    if (type == TRC_NODE_DIFFUSE)
        m.inputs[1].value[0] = 0.0f; /* Lambert */
    assert_int_equal(trc_material_create(scene, &m.desc, &id), TRC_OK);
    return id;
}

/* A glossy surface of that grey; roughness 0: a mirror. */
FIXTURE_INLINE trc_id fixture_glossy(trc_scene scene, float value, float roughness) {
    const trc_node_input inputs[6] = {{.node = -1, .value = {value, value, value}},
                                      {.node = -1, .value = {roughness}},
                                      {.node = -1},
                                      {.node = -1},
                                      {.node = -2},
                                      {.node = -2}};
    const trc_node node = {.type = TRC_NODE_GLOSSY,
                           .mode = roughness > 0.0f ? TRC_DISTRIBUTION_GGX : TRC_DISTRIBUTION_SHARP,
                           .input_count = 6};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 1,
                                    .nodes = &node,
                                    .inputs = inputs,
                                    .input_count = 6};
    trc_id id = 0;
    assert_int_equal(trc_material_create(scene, &desc, &id), TRC_OK);
    return id;
}

/* Straight through, for shadow rays, too, by that share of each colour. name: of its matte, or
 * NULL. */
FIXTURE_INLINE trc_id fixture_transparent(trc_scene scene, float r, float g, float b,
                                          const char *name) {
    const trc_node_input inputs[] = {{.node = -1, .value = {r, g, b}}};
    const trc_node node = {.type = TRC_NODE_TRANSPARENT, .input_count = 1};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 1,
                                    .nodes = &node,
                                    .inputs = inputs,
                                    .input_count = 1,
                                    .cryptomatte = name ? trc_cryptomatte_id(name) : 0.0f,
                                    .flags = TRC_MATERIAL_TRANSPARENT_SHADOW};
    trc_id id = 0;
    assert_int_equal(trc_material_create(scene, &desc, &id), TRC_OK);
    return id;
}

/* The same of all light. */
FIXTURE_INLINE trc_id fixture_clear(trc_scene scene) {
    return fixture_transparent(scene, 1.0f, 1.0f, 1.0f, NULL);
}

/* A camera that looks straight down from x, 0, z in parallel rays. */
FIXTURE_INLINE void fixture_look_down(trc_scene scene, float x, float z, float half_x,
                                      float half_y) {
    const float transform[12] = {1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, z};
    const float window[4] = {-half_x, half_x, -half_y, half_y};
    trc_camera_desc camera = default_camera_desc();
    camera.type = TRC_CAMERA_ORTHOGRAPHIC;
    camera.transforms = transform;
    camera.windows = window;
    assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
}

/* A camera 1 m up that looks straight down at x from 0 to 4 m, in parallel rays. */
FIXTURE_INLINE trc_scene fixture_level_view_in(const trc_scene_desc *scene_desc) {
    trc_scene scene = 0;
    assert_int_equal(trc_scene_create(scene_desc, &scene), TRC_OK);
    fixture_look_down(scene, 2.0f, 1.0f, 2.0f, 0.5f);
    return scene;
}

FIXTURE_INLINE trc_scene fixture_level_view(void) {
    const trc_scene_desc desc = default_scene_desc();
    return fixture_level_view_in(&desc);
}

#endif
