/* Descriptors that need no thought: what a caller does not set stays valid, and costs nothing. */
#include <math.h>
#include <stdint.h>

#include "tracer/tracer.h"

#define PI 3.14159265f

static const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
static const float square_window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};

trc_scene_desc trc_scene_desc_default(void) {
    return (trc_scene_desc){.struct_size = sizeof(trc_scene_desc)};
}

trc_scene_stats trc_scene_stats_default(void) {
    return (trc_scene_stats){.struct_size = sizeof(trc_scene_stats)};
}

trc_corner_attribute trc_corner_attribute_default(void) {
    return (trc_corner_attribute){.struct_size = sizeof(trc_corner_attribute), .width = 2};
}

trc_dicing_desc trc_dicing_desc_default(void) {
    return (trc_dicing_desc){.struct_size = sizeof(trc_dicing_desc),
                             .max_subdivisions = 12,
                             .side = 1.0f,
                             .object_to_camera = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0},
                             .offscreen_scale = 1.0f};
}

trc_mesh_desc trc_mesh_desc_default(void) {
    return (trc_mesh_desc){.struct_size = sizeof(trc_mesh_desc), .key_count = 1};
}

trc_curve_attribute trc_curve_attribute_default(void) {
    return (trc_curve_attribute){.struct_size = sizeof(trc_curve_attribute), .width = 2};
}

trc_curves_desc trc_curves_desc_default(void) {
    return (trc_curves_desc){.struct_size = sizeof(trc_curves_desc),
                             .key_count = 1,
                             .piece_count = 4,
                             .tolerance = 0.1f};
}

trc_instance_desc trc_instance_desc_default(void) {
    return (trc_instance_desc){.struct_size = sizeof(trc_instance_desc),
                               .key_count = 1,
                               .transforms = identity,
                               .visibility = TRC_VISIBLE_ALL,
                               .color = {1, 1, 1, 1},
                               .shadow_terminator_geometry = 0.1f};
}

trc_light_desc trc_light_desc_default(void) {
    return (trc_light_desc){.struct_size = sizeof(trc_light_desc),
                            .type = TRC_LIGHT_POINT,
                            .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0},
                            .color = {1, 1, 1},
                            .strength = 1.0f,
                            .size_x = 1.0f,
                            .size_y = 1.0f,
                            .spread = PI,
                            .spot_angle = 0.25f * PI,
                            .visibility = TRC_VISIBLE_ALL,
                            .cast_shadow = 1,
                            .use_mis = 1};
}

trc_world_desc trc_world_desc_default(void) {
    return (trc_world_desc){.struct_size = sizeof(trc_world_desc),
                            .use_sampling = 1,
                            .visibility = TRC_VISIBLE_ALL,
                            .ao_distance = 10.0f,
                            .cast_shadow = 1};
}

trc_camera_desc trc_camera_desc_default(void) {
    return (trc_camera_desc){.struct_size = sizeof(trc_camera_desc),
                             .type = TRC_CAMERA_PERSPECTIVE,
                             .key_count = 1,
                             .transforms = identity,
                             .windows = square_window,
                             .window_key_count = 1,
                             .clip_start = 0.1f,
                             .clip_end = 1000.0f,
                             .focus_distance = 10.0f,
                             .aperture_ratio = 1.0f,
                             .longitude_min = -PI,
                             .longitude_max = PI,
                             .latitude_min = -0.5f * PI,
                             .latitude_max = 0.5f * PI,
                             .height_min = -1.0f,
                             .height_max = 1.0f,
                             .fisheye_angle = PI,
                             .fisheye_lens = 10.5f,
                             .sensor_width = 36.0f,
                             .sensor_height = 24.0f,
                             .convergence_distance = INFINITY};
}

trc_node_input trc_node_input_default(void) { return (trc_node_input){.node = TRC_INPUT_CONSTANT}; }

trc_node trc_node_default(void) { return (trc_node){.type = TRC_NODE_DIFFUSE}; }

trc_material_desc trc_material_desc_default(void) {
    return (trc_material_desc){.struct_size = sizeof(trc_material_desc),
                               .surface = -1,
                               .flags =
                                   TRC_MATERIAL_SAMPLE_EMISSION | TRC_MATERIAL_TRANSPARENT_SHADOW};
}

trc_image_desc trc_image_desc_default(void) {
    return (trc_image_desc){.struct_size = sizeof(trc_image_desc)};
}

trc_reader_desc trc_reader_desc_default(void) {
    return (trc_reader_desc){.struct_size = sizeof(trc_reader_desc)};
}

trc_render_desc trc_render_desc_default(void) {
    return (trc_render_desc){.struct_size = sizeof(trc_render_desc),
                             .integrator = TRC_INTEGRATOR_DISTRIBUTION,
                             .sample_count = 16,
                             .max_depth = 50,
                             .max_transparent_depth = 8,
                             .max_shadow_depth = UINT32_MAX,
                             .max_glossy_depth = UINT32_MAX,
                             .max_transmission_depth = UINT32_MAX,
                             .filter = TRC_FILTER_BLACKMAN_HARRIS,
                             .filter_width = 1.5f,
                             .film_transparent_roughness = 0.1f,
                             .film_exposure = 1.0f,
                             .passes = UINT64_C(1) << TRC_PASS_COMBINED,
                             .mist_falloff = 1.0f,
                             .cryptomatte_depth = 6};
}

trc_render_progress trc_render_progress_default(void) {
    return (trc_render_progress){.struct_size = sizeof(trc_render_progress)};
}

trc_sums trc_sums_default(void) { return (trc_sums){.struct_size = sizeof(trc_sums)}; }

trc_part_desc trc_part_desc_default(void) {
    return (trc_part_desc){.struct_size = sizeof(trc_part_desc)};
}

trc_tangents_desc trc_tangents_desc_default(void) {
    return (trc_tangents_desc){.struct_size = sizeof(trc_tangents_desc), .has_seams = 1};
}

trc_rays trc_rays_default(void) {
    return (trc_rays){.struct_size = sizeof(trc_rays), .visibility = TRC_VISIBLE_ALL};
}

trc_hits trc_hits_default(void) { return (trc_hits){.struct_size = sizeof(trc_hits)}; }
