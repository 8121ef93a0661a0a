/* The camera. */
#ifndef TRACER_CAMERA_H
#define TRACER_CAMERA_H

#include "tracer/base.h"
#include "tracer/geometry.h"

TRC_BEGIN_DECLS

/* The panoramas, from EQUIRECTANGULAR on, are those of Cycles. */
enum trc_camera_type {
    TRC_CAMERA_PERSPECTIVE = 0,
    TRC_CAMERA_ORTHOGRAPHIC = 1,
    TRC_CAMERA_EQUIRECTANGULAR = 2,     /* across: longitude, up: latitude */
    TRC_CAMERA_CUBE_MAP_FACE = 3,       /* 90 by 90 degrees, equal angles for equal steps */
    TRC_CAMERA_MIRROR_BALL = 4,         /* what a ball ahead shows of all around the camera */
    TRC_CAMERA_FISHEYE_EQUIDISTANT = 5, /* fisheye_angle over the frame, whatever its shape */
    TRC_CAMERA_FISHEYE_EQUISOLID = 6,   /* r = 2 fisheye_lens sin(angle / 2) on the sensor */
    TRC_CAMERA_FISHEYE_POLYNOMIAL = 7,  /* angle = -(k0 + k1 r + .. + k4 r^4) on the sensor */
    TRC_CAMERA_CYLINDRICAL = 8          /* across: longitude, up: height on a cylinder */
};

/* The camera looks along its -Z with +Y up. The view window is given on the plane at distance 1
 * (perspective), in metres (orthographic) or in shares of the whole panorama, which spans 0 to 1
 * both ways, for the FULL frame of trc_render_desc; sensor fit, shift and pixel aspect are in it.
 * Of fisheyes and the mirror ball what lies outside of their circle is black and opaque. */
typedef struct trc_camera_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t type;           /* TRC_CAMERA_* */
    uint32_t key_count;      /* 1..TRC_MAX_KEYS evenly spaced over the shutter */
    uint32_t blade_count;    /* up to 1024; 0..2: round aperture */
    const float *transforms; /* camera to world, 12 floats per key: the axes' lengths are ignored,
                                their directions count, shear and all; refused if singular */
    const float *windows; /* left, right, bottom, top per key (zoom blur), or one key's 4 floats */
    uint32_t window_key_count;  /* 1 or key_count */
    float clip_start, clip_end; /* metres along the view axis, 0 < start < end; of a sheared camera
                                   in its own space; of panoramas along the ray */
    float aperture_radius;      /* metres; 0: pinhole */
    float focus_distance;       /* metres along the view axis, of panoramas along the ray; > 0 */
    float blade_rotation;       /* radians from +X to +Y, of the middle of an edge */
    float aperture_ratio;       /* anamorphic, > 0, 1 round */
    float shutter_time;         /* in frames; 0: no motion, time is 0.5 for all rays */
    uint32_t shutter_curve_count; /* 0: box; else up to 65536 samples of the shutter's opening over
                                     [0, 1] */
    const float *shutter_curve;   /* that many, >= 0, all of them 0: box; NULL without */
    /* Of panoramas; each type reads its own. Radians, the middle of the view at 0. */
    float longitude_min, longitude_max; /* to the right: EQUIRECTANGULAR, CYLINDRICAL */
    float latitude_min, latitude_max;   /* up: EQUIRECTANGULAR */
    float height_min, height_max;       /* on a cylinder of radius 1: CYLINDRICAL */
    float fisheye_angle;                /* across the circle that is seen, > 0: fisheyes */
    float fisheye_lens;                 /* focal length in units of the sensor, > 0: EQUISOLID */
    float sensor_width, sensor_height;  /* > 0: EQUISOLID, POLYNOMIAL */
    float fisheye_polynomial[5];        /* k0..k4: POLYNOMIAL */
    /* Spherical stereo, of perspective cameras and panoramas: each ray starts at the eye that turns
     * with it around the Z axis of the world (perspective) or the up axis of the panorama. */
    float eye_offset;           /* metres to the right of the camera; 0: no stereo */
    float convergence_distance; /* metres, > 0; where both eyes see the same; INFINITY: parallel */
    float pole_merge_from, pole_merge_to; /* radians above or below the horizon, 0 <= from; the
                                   offset fades to 0 between them; to = 0: no fading */
    /* Rolling shutter: the share of the shutter's time in which rows begin to be exposed, one after
     * the other from the top; what is left is each row's own exposure. In [0, 1]; 0: all at once.
     */
    float row_delay;
} trc_camera_desc;

/* At the origin, looking down: perspective, as wide as high, 0.1 to 1000 m, a pinhole, no motion.
 */
TRC_API trc_camera_desc trc_camera_desc_default(void);

/* Replaces the scene's camera, which it has none of at first; renders need one. INVALID_ARGUMENT
 * for a window of no width or height, a singular transform or a value out of range. */
TRC_API trc_status trc_scene_set_camera(trc_scene scene, const trc_camera_desc *desc);

TRC_END_DECLS

#endif
