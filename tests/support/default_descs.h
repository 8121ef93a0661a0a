/* Descriptors that need no thought: a cube with the default material under a light and a camera 6 m
 * above it, for tests to change what they are about. Needs no cmocka. */
#ifndef TRACER_TESTS_DEFAULT_DESCS_H
#define TRACER_TESTS_DEFAULT_DESCS_H

#include <stdint.h>
#include <string.h>

#include "tracer/tracer.h"

#define DEFAULT_INLINE static inline __attribute__((unused))

/* A cube of edge 2 around the origin, the normals outwards. */
static const float cube_positions[24] __attribute__((unused)) = {
    -1, -1, -1, 1, -1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1};
static const uint32_t cube_indices[36]
    __attribute__((unused)) = {0, 2, 1, 0, 3, 2, 4, 5, 6, 4, 6, 7, 0, 1, 5, 0, 5, 4,
                               1, 2, 6, 1, 6, 5, 2, 3, 7, 2, 7, 6, 3, 0, 4, 3, 4, 7};
static const uint8_t cube_smooth[12] __attribute__((unused)) = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
static const uint16_t cube_slots[12] __attribute__((unused)) = {0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1};
static const float identity_transform[12]
    __attribute__((unused)) = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
/* 6 m up, looking down. */
static const float above_transform[12]
    __attribute__((unused)) = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 6};

DEFAULT_INLINE trc_scene_desc default_scene_desc(void) {
    return (trc_scene_desc){.struct_size = sizeof(trc_scene_desc), .thread_count = 2};
}

DEFAULT_INLINE trc_mesh_desc default_mesh_desc(void) {
    return (trc_mesh_desc){.struct_size = sizeof(trc_mesh_desc),
                           .key_count = 1,
                           .vertex_count = 8,
                           .triangle_count = 12,
                           .positions = cube_positions,
                           .position_count = 24,
                           .indices = cube_indices,
                           .index_count = 36};
}

DEFAULT_INLINE trc_instance_desc default_instance_desc(trc_id mesh) {
    return (trc_instance_desc){.struct_size = sizeof(trc_instance_desc),
                               .key_count = 1,
                               .mesh = mesh,
                               .transforms = identity_transform,
                               .visibility = TRC_VISIBLE_ALL,
                               .color = {1, 1, 1, 1}};
}

DEFAULT_INLINE trc_camera_desc default_camera_desc(void) {
    static const float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
    return (trc_camera_desc){.struct_size = sizeof(trc_camera_desc),
                             .key_count = 1,
                             .transforms = above_transform,
                             .windows = window,
                             .window_key_count = 1,
                             .clip_start = 0.1f,
                             .clip_end = 100.0f,
                             .focus_distance = 5.0f,
                             .aperture_ratio = 1.0f};
}

DEFAULT_INLINE trc_light_desc default_light_desc(void) {
    trc_light_desc desc = {.struct_size = sizeof(trc_light_desc),
                           .type = TRC_LIGHT_AREA,
                           .color = {1, 1, 1},
                           .strength = 100.0f,
                           .size_x = 1.0f,
                           .size_y = 1.0f,
                           .spread = 3.14159274f,
                           .spot_angle = 1.0f,
                           .visibility = TRC_VISIBLE_ALL,
                           .cast_shadow = 1,
                           .use_mis = 1};
    memcpy(desc.transform, above_transform, sizeof desc.transform);
    return desc;
}

DEFAULT_INLINE trc_world_desc default_world_desc(trc_id material) {
    return (trc_world_desc){.struct_size = sizeof(trc_world_desc),
                            .material = material,
                            .visibility = TRC_VISIBLE_ALL,
                            .ao_distance = 10.0f};
}

/* One node of constants, kept alive by the caller for the call. */
struct default_material {
    trc_node node;
    trc_node_input inputs[4];
    trc_material_desc desc;
};

DEFAULT_INLINE void default_material_init(struct default_material *m, uint32_t type) {
    memset(m, 0, sizeof *m);
    const uint32_t input_count = type == TRC_NODE_DIFFUSE ? 3 : 2; /* emission, background: 2 */
    m->node = (trc_node){.type = type, .input_count = input_count};
    m->inputs[0] = (trc_node_input){.node = -1, .value = {0.5f, 0.5f, 0.5f}};
    m->inputs[1] = (trc_node_input){.node = -1, .value = {1.0f}};
    m->inputs[2] = (trc_node_input){.node = -2};
    m->desc = (trc_material_desc){.struct_size = sizeof(trc_material_desc),
                                  .node_count = 1,
                                  .nodes = &m->node,
                                  .inputs = m->inputs,
                                  .input_count = input_count,
                                  .flags = TRC_MATERIAL_SAMPLE_EMISSION};
}

DEFAULT_INLINE trc_image_desc default_image_desc(void) {
    static const float pixels[16] = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1};
    return (trc_image_desc){.struct_size = sizeof(trc_image_desc),
                            .width = 2,
                            .height = 2,
                            .is_float = 1,
                            .pixels = pixels,
                            .pixel_bytes = sizeof pixels};
}

DEFAULT_INLINE trc_render_desc default_render_desc(uint32_t width, uint32_t height,
                                                   uint32_t samples) {
    return (trc_render_desc){.struct_size = sizeof(trc_render_desc),
                             .width = width,
                             .height = height,
                             .integrator = TRC_INTEGRATOR_DISTRIBUTION,
                             .sample_count = samples,
                             .max_depth = 4,
                             .max_transparent_depth = 8,
                             .max_glossy_depth = UINT32_MAX,
                             .max_transmission_depth = UINT32_MAX,
                             .attenuation_cutoff = 0.01f,
                             .seed = 1,
                             .filter_width = 1.5f,
                             .film_exposure = 1.0f,
                             .mist_depth = 1.0f,
                             .mist_falloff = 1.0f,
                             .thread_count = 2};
}

#endif
