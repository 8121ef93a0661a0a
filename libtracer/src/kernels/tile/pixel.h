/* How far apart the rays of neighbouring pixels are where they arrive, for slopes of heights. */
#ifndef TRACER_KERNELS_TILE_PIXEL_H
#define TRACER_KERNELS_TILE_PIXEL_H

#include "kernels/tile/arrival.h"

/* Between the directions of (x, y, -1) and (x + dx, y + dy, -1). */
TRC_INLINE vfloat pixel_turn(vfloat x, vfloat y, float dx, float dy) {
    const vfloat down = vf_set(-1.0f);
    const vvec3 next = v3_normalize(v3(x + vf_set(dx), y + vf_set(dy), down));
    return v3_length(v3_sub(next, v3_normalize(v3(x, y, down))));
}

/* The mean of both directions on the image, as Cycles has it: rays go apart as those of the camera
 * do, along the whole path, whatever they met on it. Of scenes with TRC_FEATURE_SLOPES. */
static vfloat pixel_distance(const struct trc_tile *t, const struct arrival *a) {
    const struct trc_camera *c = &t->snapshot->camera;
    uint32_t key;
    float f, w[4];
    trc_key_at(0.5f, c->key_count, &key, &f);
    for (int i = 0; i < 4; i++) {
        const float from = c->windows[key][i];
        w[i] = from + f * (c->windows[key + (c->key_count > 1)][i] - from);
    }
    const float dx = (w[1] - w[0]) / (float)t->desc->width;
    const float dy = (w[3] - w[2]) / (float)t->desc->height;
    const vfloat half = vf_set(0.5f);
    if (c->type == TRC_CAMERA_ORTHOGRAPHIC)
        return half * vf_set(fabsf(dx) + fabsf(dy));
    const vfloat px = vi_to_float((vint)(a->pixel & vu_set(TRC_PIXEL_X_MASK))) + half;
    const vfloat py = vi_to_float((vint)(a->pixel >> TRC_PIXEL_Y_SHIFT)) + half;
    const vfloat x = vf_set(w[0]) + px * vf_set(dx), y = vf_set(w[2]) + py * vf_set(dy);
    return (column(t->work.f[TRC_RAY_PATH_LENGTH], a) + arrival_length(a)) * half *
           (pixel_turn(x, y, dx, 0.0f) + pixel_turn(x, y, 0.0f, dy));
}

#endif
