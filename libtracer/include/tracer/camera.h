/* The camera. */
#ifndef TRACER_CAMERA_H
#define TRACER_CAMERA_H

#include "tracer/base.h"
#include "tracer/geometry.h"

TRC_BEGIN_DECLS

enum trc_camera_type { TRC_CAMERA_PERSPECTIVE = 0, TRC_CAMERA_ORTHOGRAPHIC = 1 };

/* The camera looks along its -Z with +Y up. The view window is given on the plane at distance 1
 * (perspective) or in metres (orthographic), for the FULL frame of trc_render_desc; sensor fit,
 * shift and pixel aspect are in it. */
typedef struct trc_camera_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t type;           /* TRC_CAMERA_* */
    uint32_t key_count;      /* 1..TRC_MAX_KEYS evenly spaced over the shutter */
    uint32_t blade_count;    /* 0..2: round aperture */
    const float *transforms; /* camera to world, 12 floats per key: the axes' lengths are ignored,
                                their directions count, shear and all; refused if singular */
    const float *windows; /* left, right, bottom, top per key (zoom blur), or one key's 4 floats */
    uint32_t window_key_count;  /* 1 or key_count */
    float clip_start, clip_end; /* metres along the view axis, 0 < start < end; of a sheared camera
                                   in its own space */
    float aperture_radius;      /* metres; 0: pinhole */
    float focus_distance;       /* metres along the view axis, > 0 */
    float blade_rotation;       /* radians from +X to +Y, of the middle of an edge */
    float aperture_ratio;       /* anamorphic, > 0, 1 round */
    float shutter_time;         /* in frames; 0: no motion, time is 0.5 for all rays */
    uint32_t shutter_curve_count; /* 0: box; else samples of the shutter's opening over [0, 1] */
    const float *shutter_curve;   /* that many, >= 0; NULL without */
} trc_camera_desc;

/* At the origin, looking down: perspective, as wide as high, 0.1 to 1000 m, a pinhole, no motion.
 */
TRC_API trc_camera_desc trc_camera_desc_default(void);

/* Replaces the scene's camera, which it has none of at first; renders need one. INVALID_ARGUMENT
 * for a window of no width or height, a singular transform or a value out of range. */
TRC_API trc_status trc_scene_set_camera(trc_scene scene, const trc_camera_desc *desc);

TRC_END_DECLS

#endif
