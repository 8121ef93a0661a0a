/* A scene to throw things at: a quad that fills the view of a camera above it, a light; and what is
 * done with any scene. Whatever the calls say, nothing may crash, hang or leak. */
#ifndef TRACER_TESTS_FUZZ_STAGE_H
#define TRACER_TESTS_FUZZ_STAGE_H

#include "tracer/tracer.h"

#define STAGE_SIZE 8 /* pixels */

static const float stage_identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
static const float stage_above[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 3};

static inline trc_scene stage_scene(void) {
    const trc_scene_desc desc = {.struct_size = sizeof desc, .thread_count = 1};
    trc_scene scene = 0;
    return trc_scene_create(&desc, &scene) == TRC_OK ? scene : 0;
}

static inline void stage_camera(trc_scene scene) {
    static const float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
    const trc_camera_desc desc = {.struct_size = sizeof desc,
                                  .key_count = 1,
                                  .transforms = stage_above,
                                  .windows = window,
                                  .window_key_count = 1,
                                  .clip_start = 0.1f,
                                  .clip_end = 100.0f,
                                  .focus_distance = 3.0f,
                                  .aperture_ratio = 1.0f};
    (void)trc_scene_set_camera(scene, &desc);
}

static inline void stage_light(trc_scene scene) {
    trc_light_desc desc = {.struct_size = sizeof desc,
                           .type = TRC_LIGHT_POINT,
                           .color = {1, 1, 1},
                           .strength = 100.0f,
                           .radius = 0.1f,
                           .spread = 1.0f,
                           .spot_angle = 1.0f,
                           .visibility = TRC_VISIBLE_ALL,
                           .cast_shadow = 1,
                           .use_mis = 1};
    trc_id light;
    for (int k = 0; k < 12; k++)
        desc.transform[k] = stage_above[k];
    (void)trc_light_create(scene, &desc, &light);
}

static inline void stage_quad(trc_scene scene, trc_id material) {
    static const float positions[12] = {-2, -2, 0, 2, -2, 0, 2, 2, 0, -2, 2, 0};
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
    trc_instance_desc instance = {.struct_size = sizeof instance,
                                  .key_count = 1,
                                  .transforms = stage_identity,
                                  .materials = &material,
                                  .material_count = 1,
                                  .visibility = TRC_VISIBLE_ALL};
    trc_id id;
    if (trc_mesh_create(scene, &desc, &instance.mesh) == TRC_OK)
        (void)trc_instance_create(scene, &instance, &id);
}

static inline trc_render_desc stage_render(void) {
    return (trc_render_desc){.struct_size = sizeof(trc_render_desc),
                             .width = STAGE_SIZE,
                             .height = STAGE_SIZE,
                             .integrator = TRC_INTEGRATOR_DISTRIBUTION,
                             .sample_count = 1,
                             .max_depth = 4,
                             .max_transparent_depth = 4,
                             .max_glossy_depth = UINT32_MAX,
                             .max_transmission_depth = UINT32_MAX,
                             .filter_width = 1.5f,
                             .film_exposure = 1.0f,
                             .passes = (1ull << TRC_PASS_COUNT) - 1,
                             .thread_count = 1};
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
