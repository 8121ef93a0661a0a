/* One frame, or one for each eye of a spec: rendered and measured, or rendered and counted. */
#ifndef TRACER_BENCH_FRAMES_FRAME_H
#define TRACER_BENCH_FRAMES_FRAME_H

#include "frame_scene.h"

struct frame_result {
    double seconds;                                     /* of all eyes */
    double seconds_trace, seconds_shade, seconds_other; /* summed over threads */
    double build_seconds, commit_seconds;               /* of the scene's first commit */
    uint64_t rays_camera, rays_shadow, rays_reflection, rays_refraction;
    uint64_t triangle_count, bvh_bytes, geometry_bytes, peak_bytes;
};

/* On failure why is in trc_last_message(). picture: NULL, or the first eye's, 4 * width * height
 * floats, bottom row first. */
trc_status frame_render(const struct frame_scene *scene, const struct spec *spec,
                        struct frame_result *out, float *picture);

/* What spec asks of the renderer. */
trc_render_desc frame_desc(const struct spec *spec);

#endif
