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
    trc_scene_desc desc = trc_scene_desc_default();
    desc.thread_count = 2;
    return desc;
}

DEFAULT_INLINE trc_mesh_desc default_mesh_desc(void) {
    trc_mesh_desc desc = trc_mesh_desc_default();
    desc.vertex_count = 8;
    desc.triangle_count = 12;
    desc.positions = cube_positions;
    desc.position_count = 24;
    desc.indices = cube_indices;
    desc.index_count = 36;
    return desc;
}

DEFAULT_INLINE trc_instance_desc default_instance_desc(trc_id mesh) {
    trc_instance_desc desc = trc_instance_desc_default();
    desc.mesh = mesh;
    return desc;
}

DEFAULT_INLINE trc_camera_desc default_camera_desc(void) {
    trc_camera_desc desc = trc_camera_desc_default();
    desc.transforms = above_transform;
    desc.clip_end = 100.0f;
    desc.focus_distance = 5.0f;
    return desc;
}

DEFAULT_INLINE trc_light_desc default_light_desc(void) {
    trc_light_desc desc = trc_light_desc_default();
    desc.type = TRC_LIGHT_AREA;
    desc.strength = 100.0f;
    memcpy(desc.transform, above_transform, sizeof desc.transform);
    return desc;
}

DEFAULT_INLINE trc_world_desc default_world_desc(trc_id material) {
    trc_world_desc desc = trc_world_desc_default();
    desc.material = material;
    desc.use_sampling = 0;
    return desc;
}

/* One node of constants, kept alive by the caller for the call. */
struct default_material {
    trc_node node;
    trc_node_input inputs[4];
    trc_material_desc desc;
};

DEFAULT_INLINE void default_material_init(struct default_material *m, uint32_t type) {
    memset(m, 0, sizeof *m);
    const uint32_t input_count = type == TRC_NODE_DIFFUSE       ? 3
                                 : type == TRC_NODE_TRANSPARENT ? 1
                                                                : 2; /* emission, background */
    m->node = (trc_node){.type = type, .input_count = input_count};
    m->inputs[0] = (trc_node_input){.node = TRC_INPUT_CONSTANT, .value = {0.5f, 0.5f, 0.5f}};
    m->inputs[1] = (trc_node_input){.node = TRC_INPUT_CONSTANT, .value = {1.0f}};
    m->inputs[2] = (trc_node_input){.node = TRC_INPUT_DEFAULT};
    m->desc = trc_material_desc_default();
    m->desc.node_count = 1;
    m->desc.nodes = &m->node;
    m->desc.inputs = m->inputs;
    m->desc.input_count = input_count;
    m->desc.surface = 0;
    m->desc.flags = TRC_MATERIAL_SAMPLE_EMISSION;
}

DEFAULT_INLINE trc_image_desc default_image_desc(void) {
    static const float pixels[16] = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1, 1, 1, 1, 1};
    trc_image_desc desc = trc_image_desc_default();
    desc.width = 2;
    desc.height = 2;
    desc.is_float = 1;
    desc.pixels = pixels;
    desc.pixel_bytes = sizeof pixels;
    return desc;
}

DEFAULT_INLINE trc_render_desc default_render_desc(uint32_t width, uint32_t height,
                                                   uint32_t samples) {
    trc_render_desc desc = trc_render_desc_default();
    desc.width = width;
    desc.height = height;
    desc.sample_count = samples;
    desc.max_depth = 4;
    desc.attenuation_cutoff = 0.01f;
    desc.seed = 1;
    desc.filter = TRC_FILTER_BOX;
    desc.mist_depth = 1.0f;
    desc.thread_count = 2;
    return desc;
}

#endif
