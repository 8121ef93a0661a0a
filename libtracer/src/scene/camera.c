/* The camera and the world: from descriptor to what kernels read. */
#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/affine.h"
#include "scene/scene.h"

/* Metres. A focus beyond is at infinity for every float, and infinity itself would give NaN. */
#define FOCUS_FAR 1e9f

static void destroy_camera(void *object) {
    struct trc_camera *camera = object;
    trc_free(camera->camera_to_world);
    trc_free(camera->windows);
    trc_free(camera->shutter_cdf_inverse);
    trc_free(camera);
}

/* The time up to which a piecewise-linear opening has let through the share u of its light: inverse
 * of the integral, a quadratic in each piece. */
static float invert_shutter(const float *curve, uint32_t count, double total, double u) {
    double left = u * total;
    const uint32_t pieces = count - 1;
    for (uint32_t i = 0; i < pieces; i++) {
        const double a = curve[i], slope = (double)curve[i + 1] - a;
        const double area = a + 0.5 * slope;
        if (left > area && i + 1 < pieces) {
            left -= area;
            continue;
        }
        /* a x + slope x^2 / 2 = left, in the form that is exact for slope 0 and for a = 0. */
        const double root = sqrt(fmax(a * a + 2.0 * slope * left, 0.0));
        const double x = a + root > 0.0 ? 2.0 * left / (a + root) : 1.0;
        return (float)((i + fmin(x, 1.0)) / pieces);
    }
    return 1.0f;
}

/* A curve that lets nothing through, or is the same all over, is a box: *inverse_out is NULL. */
static trc_status make_shutter(const float *curve, uint32_t count, float **inverse_out) {
    double total = 0.0;
    bool constant = true;
    for (uint32_t i = 0; i + 1 < count; i++) {
        total += 0.5 * ((double)curve[i] + curve[i + 1]);
        constant = constant && curve[i] == curve[i + 1];
    }
    if (constant || !(total > 0.0))
        return TRC_OK;
    float *inverse = trc_alloc(TRC_SHUTTER_ENTRIES, sizeof *inverse);
    if (!inverse)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the camera");
    for (int i = 0; i < TRC_SHUTTER_ENTRIES; i++) {
        inverse[i] = invert_shutter(curve, count, total, (double)i / (TRC_SHUTTER_ENTRIES - 1));
    }
    *inverse_out = inverse;
    return TRC_OK;
}

static void copy_settings(struct trc_camera *camera, const trc_camera_desc *desc) {
    camera->type = desc->type;
    camera->clip_start = desc->clip_start;
    camera->clip_end = desc->clip_end;
    camera->aperture_radius = desc->aperture_radius;
    camera->focus_distance = fminf(desc->focus_distance, FOCUS_FAR);
    camera->blade_rotation = desc->blade_rotation;
    camera->aperture_ratio = desc->aperture_ratio;
    camera->blade_count = desc->blade_count;
    camera->has_motion = desc->shutter_time > 0.0f;
    camera->row_delay = desc->row_delay;
    camera->panorama = (struct trc_panorama){
        .longitude = {desc->longitude_min, desc->longitude_max},
        .latitude = {desc->latitude_min, desc->latitude_max},
        .height = {desc->height_min, desc->height_max},
        .angle = desc->fisheye_angle,
        .lens = desc->fisheye_lens,
        .sensor = {desc->sensor_width, desc->sensor_height},
    };
    memcpy(camera->panorama.polynomial, desc->fisheye_polynomial,
           sizeof camera->panorama.polynomial);
    if (desc->type != TRC_CAMERA_ORTHOGRAPHIC) {
        camera->stereo = (struct trc_stereo){desc->eye_offset, desc->convergence_distance,
                                             desc->pole_merge_from, desc->pole_merge_to};
    }
}

/* A camera that stands still has one key: motion that is off costs nothing. */
static void merge_equal_keys(struct trc_camera *camera) {
    for (uint32_t key = 1; key < camera->key_count; key++) {
        if (memcmp(&camera->camera_to_world[0], &camera->camera_to_world[key],
                   sizeof camera->camera_to_world[0]) != 0 ||
            memcmp(&camera->windows[0], &camera->windows[key], sizeof camera->windows[0]) != 0) {
            return;
        }
    }
    camera->key_count = 1;
}

/* Where the way between two keys passes a singular matrix, as of two that look opposite ways, the
 * key before it stands for it. */
static trc_status invert_keys(struct trc_camera *camera) {
    const struct trc_affine *keys = camera->camera_to_world;
    for (int i = 0; i < 3; i++) {
        uint32_t key;
        float f;
        trc_key_at(0.5f * (float)i, camera->key_count, &key, &f);
        const float *a = keys[key].m, *b = keys[key + (camera->key_count > 1)].m;
        struct trc_affine between;
        for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
            between.m[k] = a[k] + f * (b[k] - a[k]);
        if (!trc_affine_invert(&between, &camera->world_to_camera[i]) &&
            !trc_affine_invert(&keys[key], &camera->world_to_camera[i])) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "the camera's transform at key %u cannot be inverted", key);
        }
    }
    return TRC_OK;
}

static trc_status fill_camera(struct trc_camera *camera, const trc_camera_desc *desc) {
    copy_settings(camera, desc);
    camera->key_count = desc->key_count;
    camera->axes_volume = 1.0f;
    camera->camera_to_world = trc_alloc(desc->key_count, sizeof *camera->camera_to_world);
    camera->windows = trc_alloc(desc->key_count, sizeof *camera->windows);
    if (!camera->camera_to_world || !camera->windows) {
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the camera");
    }
    for (uint32_t key = 0; key < desc->key_count; key++) {
        struct trc_affine given;
        float volume;
        memcpy(given.m, desc->transforms + (size_t)TRC_AFFINE_FLOATS * key, sizeof given.m);
        if (!trc_affine_make_unit(&given, &camera->camera_to_world[key], &volume)) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "the camera's transform at key %u is singular or not finite", key);
        }
        camera->axes_volume = fminf(camera->axes_volume, volume);
        memcpy(camera->windows[key],
               desc->windows + (desc->window_key_count > 1 ? (size_t)4 * key : 0),
               sizeof camera->windows[key]);
    }
    merge_equal_keys(camera);
    TRC_TRY(invert_keys(camera));
    return make_shutter(desc->shutter_curve, desc->shutter_curve_count,
                        &camera->shutter_cdf_inverse);
}

trc_status trc_scene_put_camera(struct trc_scene_state *scene, const trc_camera_desc *desc) {
    struct trc_camera *camera = trc_alloc_zeroed(1, sizeof *camera);
    if (!camera)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the camera");
    trc_status status = fill_camera(camera, desc);
    struct trc_shared *shared = NULL;
    if (status == TRC_OK) {
        shared = trc_shared_create(camera, destroy_camera);
        if (!shared)
            status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the camera");
    }
    if (status != TRC_OK) {
        destroy_camera(camera);
        return status;
    }
    trc_shared_release(scene->camera);
    scene->camera = shared;
    scene->changed |= TRC_CHANGED_CAMERA;
    return TRC_OK;
}

trc_status trc_scene_put_world(struct trc_scene_state *scene, const trc_world_desc *desc) {
    void *ignored;
    if (desc->material)
        TRC_TRY(trc_store_find(&scene->materials, desc->material, &ignored));
    scene->world = *desc;
    scene->changed |= TRC_CHANGED_WORLD;
    return TRC_OK;
}
