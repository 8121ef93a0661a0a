/* A scene to throw things at: a quad that fills the view of a camera above it, a light; and what is
 * done with any scene. Whatever the calls say, nothing may crash, hang or leak. */
#ifndef TRACER_TESTS_FUZZ_STAGE_H
#define TRACER_TESTS_FUZZ_STAGE_H

#include "default_descs.h"

#define STAGE_SIZE 8 /* pixels */

static inline trc_scene stage_scene(void) {
    trc_scene_desc desc = default_scene_desc();
    desc.thread_count = 1;
    trc_scene scene = 0;
    return trc_scene_create(&desc, &scene) == TRC_OK ? scene : 0;
}

static inline void stage_camera(trc_scene scene) {
    const trc_camera_desc desc = default_camera_desc();
    (void)trc_scene_set_camera(scene, &desc);
}

static inline void stage_light(trc_scene scene) {
    trc_light_desc desc = default_light_desc();
    desc.type = TRC_LIGHT_POINT;
    desc.radius = 0.1f;
    trc_id light;
    (void)trc_light_create(scene, &desc, &light);
}

static inline void stage_quad(trc_scene scene, trc_id material) {
    static const float positions[12] = {-4, -4, 0, 4, -4, 0, 4, 4, 0, -4, 4, 0};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float uv[12] = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};
    const trc_corner_attribute map = {
        .struct_size = sizeof map, .width = 2, .name = "UV", .values = uv, .value_count = 12};
    const trc_mesh_desc desc = {.struct_size = sizeof desc,
                                .key_count = 1,
                                .vertex_count = 4,
                                .triangle_count = 2,
                                .positions = positions,
                                .position_count = 12,
                                .indices = indices,
                                .index_count = 6,
                                .attribute_count = 1,
                                .attributes = &map};
    trc_instance_desc instance = default_instance_desc(0);
    instance.materials = &material;
    instance.material_count = 1;
    trc_id id;
    if (trc_mesh_create(scene, &desc, &instance.mesh) == TRC_OK)
        (void)trc_instance_create(scene, &instance, &id);
}

static inline trc_render_desc stage_render(void) {
    trc_render_desc desc = default_render_desc(STAGE_SIZE, STAGE_SIZE, 1);
    desc.passes = (1ull << TRC_PASS_COUNT) - 1;
    desc.thread_count = 1;
    return desc;
}

/* Commits, renders and reads back. */
static inline void stage_run(trc_scene scene, const trc_render_desc *desc) {
    trc_render render = 0;
    float pixels[STAGE_SIZE * STAGE_SIZE * 4];
    if (trc_scene_commit(scene) != TRC_OK || trc_render_start(scene, desc, &render) != TRC_OK)
        return;
    (void)trc_render_wait(render, -1.0);
    (void)trc_render_read(render, TRC_PASS_COMBINED, pixels, sizeof pixels / sizeof *pixels);
    (void)trc_render_destroy(render);
}

#endif
