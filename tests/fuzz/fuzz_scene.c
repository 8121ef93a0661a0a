/* Descriptors of lights, world, camera and render: any bits in every field that is not a pointer.
 */
#include "bytes.h"
#include "stage.h"

static void create_light(struct bytes *b, trc_scene scene) {
    trc_light_desc desc = {.struct_size = sizeof desc,
                           .type = bytes_below(b, 5),
                           .strength = bytes_float(b),
                           .radius = bytes_float(b),
                           .angle = bytes_float(b),
                           .size_x = bytes_float(b),
                           .size_y = bytes_float(b),
                           .area_shape = bytes_below(b, 3),
                           .spread = bytes_float(b),
                           .spot_angle = bytes_float(b),
                           .spot_blend = bytes_float(b),
                           .visibility = bytes_byte(b),
                           .cast_shadow = bytes_below(b, 3),
                           .use_mis = bytes_below(b, 3)};
    trc_id light;
    bytes_floats(b, desc.transform, 12);
    bytes_floats(b, desc.color, 3);
    (void)trc_light_create(scene, &desc, &light);
}

static void set_camera(struct bytes *b, trc_scene scene) {
    float transforms[24], windows[8], curve[16];
    const uint32_t keys = 1 + bytes_below(b, 2);
    bytes_floats(b, transforms, 24);
    bytes_floats(b, windows, 8);
    bytes_floats(b, curve, 16);
    const trc_camera_desc desc = {.struct_size = sizeof desc,
                                  .type = bytes_below(b, TRC_CAMERA_CYLINDRICAL + 2),
                                  .key_count = keys,
                                  .blade_count = bytes_byte(b),
                                  .transforms = transforms,
                                  .windows = windows,
                                  .window_key_count = bytes_below(b, 2) ? keys : 1,
                                  .clip_start = bytes_float(b),
                                  .clip_end = bytes_float(b),
                                  .aperture_radius = bytes_float(b),
                                  .focus_distance = bytes_float(b),
                                  .blade_rotation = bytes_float(b),
                                  .aperture_ratio = bytes_float(b),
                                  .shutter_time = bytes_float(b),
                                  .shutter_curve_count = bytes_below(b, 17),
                                  .shutter_curve = curve,
                                  .longitude_min = bytes_float(b),
                                  .longitude_max = bytes_float(b),
                                  .latitude_min = bytes_float(b),
                                  .latitude_max = bytes_float(b),
                                  .height_min = bytes_float(b),
                                  .height_max = bytes_float(b),
                                  .fisheye_angle = bytes_float(b),
                                  .fisheye_lens = bytes_float(b),
                                  .sensor_width = bytes_float(b),
                                  .sensor_height = bytes_float(b),
                                  .fisheye_polynomial = {bytes_float(b), bytes_float(b)},
                                  .eye_offset = bytes_float(b),
                                  .convergence_distance = bytes_float(b),
                                  .pole_merge_from = bytes_float(b),
                                  .pole_merge_to = bytes_float(b),
                                  .row_delay = bytes_float(b)};
    (void)trc_scene_set_camera(scene, &desc);
}

/* Sizes and counts stay small, or an input would take minutes. */
static trc_render_desc read_render(struct bytes *b) {
    trc_render_desc desc = stage_render();
    desc.width = bytes_below(b, STAGE_SIZE + 1);
    desc.height = bytes_below(b, STAGE_SIZE + 1);
    desc.crop_x = bytes_below(b, STAGE_SIZE);
    desc.crop_y = bytes_below(b, STAGE_SIZE);
    desc.crop_width = bytes_below(b, STAGE_SIZE);
    desc.crop_height = bytes_below(b, STAGE_SIZE);
    desc.integrator = bytes_below(b, 4);
    desc.sample_count = bytes_below(b, 4);
    desc.light_samples = bytes_below(b, 4);
    desc.max_depth = bytes_below(b, 8);
    desc.attenuation_cutoff = bytes_float(b);
    desc.filter_glossy = bytes_float(b);
    desc.clamp_direct = bytes_float(b);
    desc.clamp_indirect = bytes_float(b);
    desc.assembly = bytes_below(b, 8);
    static const uint32_t sizes[] = {0, 4, 16, 64, 256, 5};
    desc.packet_size = sizes[bytes_below(b, sizeof sizes / sizeof *sizes)];
    desc.sampler = bytes_below(b, 6);
    desc.seed = bytes_byte(b);
    desc.filter = bytes_below(b, 4);
    desc.filter_width = bytes_float(b);
    desc.film_transparent = bytes_below(b, 3);
    desc.film_exposure = bytes_float(b);
    bytes_read(b, &desc.passes, sizeof desc.passes);
    desc.progressive = bytes_below(b, 2);
    desc.noise_threshold = bytes_float(b);
    desc.min_samples = bytes_below(b, 8);
    return desc;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct bytes b = {data, size};
    const trc_scene scene = stage_scene();
    stage_quad(scene, 0);
    stage_camera(scene);
    if (bytes_below(&b, 2))
        set_camera(&b, scene);
    for (uint32_t i = bytes_below(&b, 5); i > 0; i--)
        create_light(&b, scene);
    const trc_world_desc world = {.struct_size = sizeof world,
                                  .use_sampling = bytes_below(&b, 3),
                                  .material = bytes_below(&b, 3),
                                  .visibility = bytes_byte(&b),
                                  .map_resolution = bytes_byte(&b),
                                  .ao_distance = bytes_float(&b),
                                  .ao_factor = bytes_float(&b),
                                  .ao_method = bytes_below(&b, 3),
                                  .cast_shadow = bytes_below(&b, 3)};
    (void)trc_scene_set_world(scene, &world);
    const trc_render_desc render = read_render(&b);
    stage_run(scene, &render);
    (void)trc_scene_destroy(scene);
    return 0;
}
