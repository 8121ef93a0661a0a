/* Panoramic cameras: from a place of the picture to a direction, and back.
 *
 * Places are shares of the whole panorama, from its lower left corner. Directions are along the
 * panorama's own axes, X ahead, Y to the left and Z up; of a mirror ball X is to the right and Y
 * back. Shaders and passes see these axes as the camera's space, as in Cycles. */
#ifndef TRACER_KERNELS_TRACE_PANORAMA_H
#define TRACER_KERNELS_TRACE_PANORAMA_H

#include "kernels/simd/wide_math.h"
#include "model/snapshot.h"

/* An axis of the camera's space by one of trc_camera.camera_to_world. */
struct trc_view_axis {
    int column;
    float sign;
};

/* The three axes; plane cameras look along +Z. */
TRC_INLINE const struct trc_view_axis *trc_view_axes(const struct trc_camera *camera) {
    static const struct trc_view_axis axes[3][3] = {{{0, 1.0f}, {1, 1.0f}, {2, -1.0f}},
                                                    {{2, -1.0f}, {0, -1.0f}, {1, 1.0f}},
                                                    {{0, 1.0f}, {2, 1.0f}, {1, 1.0f}}};
    return axes[!trc_is_panorama(camera) ? 0 : camera->type == TRC_CAMERA_MIRROR_BALL ? 2 : 1];
}

/* ---- to directions ---- */

/* At an angle from ahead, towards (x, y) of the picture, whose distance from its middle is r. */
TRC_INLINE vvec3 trc_fisheye_direction(vfloat x, vfloat y, vfloat r, vfloat angle) {
    vfloat s, c;
    vf_sincos(angle, &s, &c);
    const vfloat across = vf_divide(s, r);
    return v3(c, vf_zero() - x * across, y * across);
}

TRC_INLINE vvec3 trc_equirectangular_direction(const struct trc_panorama *p, vfloat u, vfloat v) {
    vfloat sin_longitude, cos_longitude, sin_latitude, cos_latitude;
    vf_sincos(vf_lerp(vf_set(p->longitude[0]), vf_set(p->longitude[1]), u), &sin_longitude,
              &cos_longitude);
    vf_sincos(vf_lerp(vf_set(p->latitude[0]), vf_set(p->latitude[1]), v), &sin_latitude,
              &cos_latitude);
    return v3(cos_latitude * cos_longitude, vf_zero() - cos_latitude * sin_longitude, sin_latitude);
}

TRC_INLINE vvec3 trc_cylindrical_direction(const struct trc_panorama *p, vfloat u, vfloat v) {
    vfloat s, c;
    vf_sincos(vf_lerp(vf_set(p->longitude[0]), vf_set(p->longitude[1]), u), &s, &c);
    return v3(c, vf_zero() - s, vf_lerp(vf_set(p->height[0]), vf_set(p->height[1]), v));
}

/* The view is reflected where a ball of radius 1, seen from far away, covers (x, y). */
TRC_INLINE vvec3 trc_mirror_ball_direction(vfloat x, vfloat y, vfloat r_squared) {
    const vfloat two = vf_set(2.0f);
    const vfloat out = vf_safe_sqrt(vf_one() - r_squared); /* towards the viewer */
    return v3(two * out * x, vf_one() - two * out * out, two * out * y);
}

/* Angle from ahead at a distance from the middle of the sensor. */
TRC_INLINE vfloat trc_polynomial_angle(const float k[5], vfloat r) {
    vfloat sum = vf_set(k[4]);
    for (int i = 3; i >= 0; i--)
        sum = sum * r + vf_set(k[i]);
    return vf_zero() - sum;
}

/* Not of unit length. *seen_out: where the place is one that the lens shows. */
TRC_INLINE vvec3 trc_panorama_direction(const struct trc_camera *camera, vfloat u, vfloat v,
                                        vmask *seen_out) {
    const struct trc_panorama *p = &camera->panorama;
    const vfloat half = vf_set(0.5f), two = vf_set(2.0f);
    vfloat x = (u - half) * two, y = (v - half) * two;
    *seen_out = vm_all_set();
    switch (camera->type) {
    case TRC_CAMERA_EQUIRECTANGULAR:
        return trc_equirectangular_direction(p, u, v);
    case TRC_CAMERA_CYLINDRICAL:
        return trc_cylindrical_direction(p, u, v);
    case TRC_CAMERA_CUBE_MAP_FACE:
        return v3(vf_one(), vf_zero() - vf_tan(x * vf_set(0.25f * TRC_PI)),
                  vf_tan(y * vf_set(0.25f * TRC_PI)));
    case TRC_CAMERA_MIRROR_BALL: {
        const vfloat r_squared = x * x + y * y;
        *seen_out = vf_le(r_squared, vf_one());
        return trc_mirror_ball_direction(x, y, r_squared);
    }
    case TRC_CAMERA_FISHEYE_EQUIDISTANT: {
        const vfloat r = vf_sqrt(x * x + y * y);
        *seen_out = vf_le(r, vf_one());
        return trc_fisheye_direction(x, y, r, r * vf_set(0.5f * p->angle));
    }
    default: {
        x = (u - half) * vf_set(p->sensor[0]), y = (v - half) * vf_set(p->sensor[1]);
        const vfloat r = vf_sqrt(x * x + y * y);
        const bool is_equisolid = camera->type == TRC_CAMERA_FISHEYE_EQUISOLID;
        const vfloat angle = is_equisolid ? two * vf_asin(r * vf_set(0.5f / p->lens))
                                          : trc_polynomial_angle(p->polynomial, r);
        /* Of the equisolid lens by the distance, which ends where the sine does. */
        *seen_out = is_equisolid ? vf_le(r, vf_set(2.0f * p->lens * sinf(0.25f * p->angle)))
                                 : vf_le(vf_abs(angle), vf_set(0.5f * p->angle));
        return trc_fisheye_direction(x, y, r, angle);
    }
    }
}

/* ---- and back ---- */

/* Steps of Newton's method from the linear part on: lenses are nearly linear. */
#define TRC_LENS_STEPS 10

/* The distance from the middle of the sensor at which a lens shows what is at an angle. */
TRC_INLINE vfloat trc_polynomial_distance(const float k[5], vfloat angle) {
    vfloat r = vf_divide(vf_zero() - angle - vf_set(k[0]), vf_set(k[1]));
    for (int i = 0; i < TRC_LENS_STEPS; i++) {
        vfloat slope = vf_set(4.0f * k[4]);
        for (int j = 3; j >= 1; j--)
            slope = slope * r + vf_set((float)j * k[j]);
        r = r + vf_divide(trc_polynomial_angle(k, r) - angle, slope);
    }
    return r;
}

/* Where a value lies between two, as a share of the way; 0 where there is no way. */
TRC_INLINE vfloat trc_share_between(const float ends[2], vfloat value) {
    return vf_divide(value - vf_set(ends[0]), vf_set(ends[1] - ends[0]));
}

/* Distances from the middle of a fisheye's picture, in shares of the panorama each way. */
TRC_INLINE void trc_fisheye_place(const struct trc_camera *camera, vvec3 d, vfloat *u, vfloat *v) {
    const struct trc_panorama *p = &camera->panorama;
    const vfloat half = vf_set(0.5f), across = vf_sqrt(d.y * d.y + d.z * d.z);
    const vfloat angle = vf_atan2(across, d.x);
    vfloat r = angle * vf_set(1.0f / p->angle), width = vf_one(), height = vf_one();
    if (camera->type != TRC_CAMERA_FISHEYE_EQUIDISTANT) {
        width = vf_set(p->sensor[0]), height = vf_set(p->sensor[1]);
        r = camera->type == TRC_CAMERA_FISHEYE_EQUISOLID
                ? vf_set(2.0f * p->lens) * vf_sin(angle * half)
                : trc_polynomial_distance(p->polynomial, angle);
    }
    const vfloat scale = vf_divide(r, across);
    *u = half - d.y * scale / width;
    *v = half + d.z * scale / height;
}

/* The place at which a panorama shows a direction of any length. */
TRC_INLINE void trc_panorama_place(const struct trc_camera *camera, vvec3 d, vfloat *u, vfloat *v) {
    const struct trc_panorama *p = &camera->panorama;
    const vfloat half = vf_set(0.5f);
    switch (camera->type) {
    case TRC_CAMERA_EQUIRECTANGULAR:
    case TRC_CAMERA_CYLINDRICAL: {
        const vfloat level = vf_sqrt(d.x * d.x + d.y * d.y);
        *u = trc_share_between(p->longitude, vf_zero() - vf_atan2(d.y, d.x));
        *v = camera->type == TRC_CAMERA_CYLINDRICAL
                 ? trc_share_between(p->height, vf_divide(d.z, level))
                 : trc_share_between(p->latitude, vf_atan2(d.z, level));
        return;
    }
    case TRC_CAMERA_CUBE_MAP_FACE:
        *u = half - vf_atan2(d.y, d.x) * vf_set(2.0f * TRC_INV_PI);
        *v = half + vf_atan2(d.z, d.x) * vf_set(2.0f * TRC_INV_PI);
        return;
    case TRC_CAMERA_MIRROR_BALL: {
        /* The ball's normal is halfway between the direction and that to the viewer. */
        const vvec3 unit = v3_normalize(d);
        const vvec3 between = v3_normalize(v3(unit.x, unit.y - vf_one(), unit.z));
        *u = half + half * between.x;
        *v = half + half * between.z;
        return;
    }
    default:
        trc_fisheye_place(camera, d, u, v);
    }
}

/* ---- the angle of a pixel ---- */

/* The smaller of the angles that the pixel at (u, v) sees across and up, in radians, of a frame of
 * so many pixels. */
TRC_INLINE vfloat trc_panorama_pixel_angle(const struct trc_camera *camera, vfloat u, vfloat v,
                                           float inv_width, float inv_height) {
    const float *w = camera->windows[0];
    vmask seen;
    const vvec3 at = v3_normalize(trc_panorama_direction(camera, u, v, &seen));
    const vvec3 right = v3_normalize(
        trc_panorama_direction(camera, u + vf_set((w[1] - w[0]) * inv_width), v, &seen));
    const vvec3 up = v3_normalize(
        trc_panorama_direction(camera, u, v + vf_set((w[3] - w[2]) * inv_height), &seen));
    return vf_min(v3_length(v3_sub(right, at)), v3_length(v3_sub(up, at)));
}

#endif
