/* The public call on the camera. */
#include <float.h>
#include <math.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

/* Far above any lens, far below what a polygon's angle can resolve. */
#define MAX_BLADES 1024

/* Samples of the shutter's curve: hosts have some hundred. */
#define MAX_SHUTTER_SAMPLES 65536

/* Latitude of the poles, as a float of pi / 2 that has been rounded up. */
#define HALF_PI 1.5707964f

static trc_status check_windows(const trc_camera_desc *desc) {
    if (desc->window_key_count != 1 && desc->window_key_count != desc->key_count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "window_key_count is %u, it can be 1 or key_count (%u)",
                        desc->window_key_count, desc->key_count);
    }
    TRC_TRY(trc_check_out(desc->windows, sizeof(float), "windows"));
    TRC_TRY(trc_check_finite(desc->windows, (size_t)4 * desc->window_key_count, "windows"));
    for (uint32_t key = 0; key < desc->window_key_count; key++) {
        const float *w = desc->windows + (size_t)4 * key;
        if (w[0] == w[1] || w[2] == w[3]) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the camera's window %u is empty", key);
        }
    }
    return TRC_OK;
}

static trc_status check_lens(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_float(desc->clip_start, FLT_MIN, FLT_MAX, "clip_start"));
    TRC_TRY(trc_check_float(desc->clip_end, FLT_MIN, FLT_MAX, "clip_end"));
    if (desc->clip_start >= desc->clip_end) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "clip_start is not before clip_end");
    }
    TRC_TRY(trc_check_count(desc->blade_count, 0, MAX_BLADES, "blade_count"));
    TRC_TRY(trc_check_float(desc->aperture_radius, 0.0f, FLT_MAX, "aperture_radius"));
    TRC_TRY(trc_check_float(desc->focus_distance, FLT_MIN, INFINITY, "focus_distance"));
    TRC_TRY(trc_check_finite(&desc->blade_rotation, 1, "blade_rotation"));
    return trc_check_float(desc->aperture_ratio, FLT_MIN, FLT_MAX, "aperture_ratio");
}

static trc_status check_shutter(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_float(desc->shutter_time, 0.0f, FLT_MAX, "shutter_time"));
    TRC_TRY(trc_check_float(desc->row_delay, 0.0f, 1.0f, "row_delay"));
    TRC_TRY(
        trc_check_count(desc->shutter_curve_count, 0, MAX_SHUTTER_SAMPLES, "shutter_curve_count"));
    if (!desc->shutter_curve_count)
        return TRC_OK;
    TRC_TRY(trc_check_out(desc->shutter_curve, sizeof(float), "shutter_curve"));
    for (uint32_t i = 0; i < desc->shutter_curve_count; i++) {
        TRC_TRY(trc_check_float(desc->shutter_curve[i], 0.0f, FLT_MAX, "shutter_curve"));
    }
    return TRC_OK;
}

static trc_status check_longitudes(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_finite(&desc->longitude_min, 1, "longitude_min"));
    return trc_check_finite(&desc->longitude_max, 1, "longitude_max");
}

static trc_status check_sensor(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_float(desc->fisheye_angle, FLT_MIN, FLT_MAX, "fisheye_angle"));
    TRC_TRY(trc_check_float(desc->sensor_width, FLT_MIN, FLT_MAX, "sensor_width"));
    return trc_check_float(desc->sensor_height, FLT_MIN, FLT_MAX, "sensor_height");
}

/* What the type reads. */
static trc_status check_panorama(const trc_camera_desc *desc) {
    switch (desc->type) {
    case TRC_CAMERA_EQUIRECTANGULAR:
        TRC_TRY(check_longitudes(desc));
        TRC_TRY(trc_check_float(desc->latitude_min, -HALF_PI, HALF_PI, "latitude_min"));
        return trc_check_float(desc->latitude_max, -HALF_PI, HALF_PI, "latitude_max");
    case TRC_CAMERA_CYLINDRICAL:
        TRC_TRY(check_longitudes(desc));
        TRC_TRY(trc_check_finite(&desc->height_min, 1, "height_min"));
        return trc_check_finite(&desc->height_max, 1, "height_max");
    case TRC_CAMERA_FISHEYE_EQUIDISTANT:
        return trc_check_float(desc->fisheye_angle, FLT_MIN, FLT_MAX, "fisheye_angle");
    case TRC_CAMERA_FISHEYE_EQUISOLID:
        TRC_TRY(check_sensor(desc));
        return trc_check_float(desc->fisheye_lens, FLT_MIN, FLT_MAX, "fisheye_lens");
    case TRC_CAMERA_FISHEYE_POLYNOMIAL:
        TRC_TRY(check_sensor(desc));
        return trc_check_finite(desc->fisheye_polynomial, 5, "fisheye_polynomial");
    default:
        return TRC_OK;
    }
}

static trc_status check_stereo(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_finite(&desc->eye_offset, 1, "eye_offset"));
    if (desc->eye_offset == 0.0f)
        return TRC_OK;
    TRC_TRY(trc_check_float(desc->convergence_distance, FLT_MIN, INFINITY, "convergence_distance"));
    TRC_TRY(trc_check_float(desc->pole_merge_from, 0.0f, HALF_PI, "pole_merge_from"));
    return trc_check_float(desc->pole_merge_to, 0.0f, HALF_PI, "pole_merge_to");
}

static trc_status check_camera(const trc_camera_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_camera_desc"));
    TRC_TRY(trc_check_enum(desc->type, TRC_CAMERA_CYLINDRICAL + 1, "type"));
    TRC_TRY(trc_check_count(desc->key_count, 1, TRC_MAX_KEYS, "key_count"));
    TRC_TRY(trc_check_out(desc->transforms, sizeof(float), "transforms"));
    TRC_TRY(trc_check_finite(desc->transforms, (size_t)12 * desc->key_count, "transforms"));
    TRC_TRY(check_windows(desc));
    TRC_TRY(check_lens(desc));
    TRC_TRY(check_panorama(desc));
    TRC_TRY(check_stereo(desc));
    return check_shutter(desc);
}

trc_status trc_scene_set_camera(trc_scene scene, const trc_camera_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_camera(desc);
    if (status == TRC_OK)
        status = trc_scene_put_camera(access.scene, desc);
    trc_scene_leave(&access);
    return status;
}
