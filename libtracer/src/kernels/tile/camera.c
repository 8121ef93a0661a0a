/* Camera rays: pixel filter, lens, shutter, panoramas and their stereo. The lens is a disk by the
 * concentric map of Shirley and Chiu, 1997, or a regular polygon. */
#include <float.h>

#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/panorama.h"
#include "model/filter.h"

/* Linear look-up of an inverse distribution of n values at u in [0, 1). */
TRC_INLINE vfloat table_lookup(const float *table, uint32_t n, vfloat u, vmask m) {
    const vfloat x = u * vf_set((float)(n - 1));
    const vfloat low = vf_min(vf_floor(x), vf_set((float)(n - 2)));
    const vint i = vf_to_int(low);
    const vfloat a = vf_gather(table, i, m), b = vf_gather(table + 1, i, m);
    return a + (b - a) * (x - low);
}

/* A point of the aperture, radius 1. */
TRC_INLINE void lens_point(const struct trc_camera *camera, vfloat u, vfloat v, vfloat *x,
                           vfloat *y) {
    const vfloat one = vf_set(1.0f);
    if (camera->blade_count < 3) {
        const vfloat a = vf_set(2.0f) * u - one, b = vf_set(2.0f) * v - one;
        const vmask wide = vf_gt(vf_abs(a), vf_abs(b));
        const vfloat r = vf_select(wide, a, b);
        const vfloat ratio = vf_select(wide, b, a) / vf_select(vf_eq(r, vf_set(0.0f)), one, r);
        const vfloat quarter = vf_set(0.785398163397448f);
        const vfloat angle =
            vf_select(wide, quarter * ratio, vf_set(1.57079632679490f) - quarter * ratio);
        *x = r * vf_cos(angle);
        *y = r * vf_sin(angle);
    } else {
        /* A triangle of the polygon by u, a point of it by the rest of u and by v (Turk 1990). */
        const float corners = (float)camera->blade_count;
        const vfloat scaled = u * vf_set(corners), corner = vf_floor(scaled);
        const vfloat w = vf_sqrt(scaled - corner);
        const float half = 3.14159265358979f / corners;
        /* Weights of the corners at +half and -half of the triangle's axis; the centre has the
         * rest. The first triangle's axis is what is turned, as in Cycles. */
        const vfloat a = v * w, b = (one - v) * w;
        const vfloat lx = (a + b) * vf_set(cosf(half)), ly = (a - b) * vf_set(sinf(half));
        const vfloat angle = corner * vf_set(2.0f * half) + vf_set(camera->blade_rotation);
        const vfloat c = vf_cos(angle), sn = vf_sin(angle);
        *x = c * lx - sn * ly;
        *y = sn * lx + c * ly;
    }
    *x = *x * vf_set(1.0f / camera->aperture_ratio);
}

/* Camera-to-world of each lane's time. */
TRC_INLINE void camera_matrix(const struct trc_camera *camera, vfloat time, vmask active,
                              vfloat m[TRC_AFFINE_FLOATS], vfloat window[4]) {
    const float *base = camera->camera_to_world->m, *windows = camera->windows[0];
    if (camera->key_count < 2) {
        for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
            m[k] = vf_set(base[k]);
        for (int k = 0; k < 4; k++)
            window[k] = vf_set(windows[k]);
        return;
    }
    vfloat f;
    const vint key = trc_wide_key(time, camera->key_count, &f);
    for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
        m[k] = trc_between(
            vf_gather(base + k, key * vi_set(TRC_AFFINE_FLOATS), active),
            vf_gather(base + TRC_AFFINE_FLOATS + k, key * vi_set(TRC_AFFINE_FLOATS), active), f);
    for (int k = 0; k < 4; k++)
        window[k] = trc_between(vf_gather(windows + k, key * vi_set(4), active),
                                vf_gather(windows + 4 + k, key * vi_set(4), active), f);
}

/* Rays in the camera's own space, whose axes are those of its matrix. */
struct view_rays {
    vvec3 o, d;         /* d: of unit length */
    vfloat clip_length; /* ray length per metre of clip_start and clip_end */
    vmask seen;         /* not outside of what the lens shows */
};

/* Lanes that lie on the view axis have no direction of their own away from it. */
static vvec3 lens_axis(vvec3 d) {
    const vvec3 across = v3(vf_one() - d.x * d.x, vf_zero() - d.x * d.y, vf_zero() - d.x * d.z);
    const vmask on_axis = vf_le(v3_dot(across, across), vf_zero());
    return v3_select(on_axis, v3(vf_zero(), vf_one(), vf_zero()), v3_normalize(across));
}

static struct view_rays plane_rays(const struct trc_camera *camera, vfloat sx, vfloat sy,
                                   const vfloat lens[2]) {
    const bool orthographic = camera->type == TRC_CAMERA_ORTHOGRAPHIC;
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    vvec3 o = orthographic ? v3(sx, sy, zero) : v3_zero();
    vvec3 d = orthographic ? v3(zero, zero, -one) : v3(sx, sy, -one);
    const vvec3 center = v3_normalize(d);
    if (lens) {
        const vvec3 focus = v3_add(o, v3_scale(d, vf_set(camera->focus_distance)));
        const vfloat radius = vf_set(camera->aperture_radius);
        o = v3_add(o, v3(lens[0] * radius, lens[1] * radius, zero));
        d = v3_normalize(v3_sub(focus, o));
    } else {
        d = center;
    }
    /* Of perspective views the centre of the lens says where they are clipped, as in Cycles. */
    return (struct view_rays){o, d, -one / (orthographic ? d.z : center.z), vm_all_set()};
}

/* The lens faces each direction, its first axis the one away from the view axis, as in Cycles. */
static struct view_rays panorama_rays(const struct trc_camera *camera, vfloat u, vfloat v,
                                      const vfloat lens[2]) {
    struct view_rays r = {.o = v3_zero(), .clip_length = vf_one()};
    r.d = v3_normalize(trc_panorama_direction(camera, u, v, &r.seen));
    if (lens) {
        const vvec3 focus = v3_scale(r.d, vf_set(camera->focus_distance));
        const vfloat radius = vf_set(camera->aperture_radius);
        const vvec3 first = lens_axis(r.d), second = v3_cross(r.d, first);
        r.o = v3_add(v3_scale(first, lens[0] * radius), v3_scale(second, lens[1] * radius));
        r.d = v3_normalize(v3_sub(focus, r.o));
    }
    return r;
}

/* From the camera to the eye that looks in each direction, d of unit length; up is +Z. */
static void move_to_eye(const struct trc_stereo *stereo, vvec3 *o, vvec3 *d) {
    vfloat offset = vf_set(stereo->eye_offset);
    if (stereo->pole_merge_to > 0.0f) {
        const float from = stereo->pole_merge_from, to = stereo->pole_merge_to;
        const vfloat altitude = vf_abs(vf_asin(d->z));
        const vfloat part =
            (altitude - vf_set(from)) * vf_set(to > from ? 1.0f / (to - from) : 0.0f);
        const vfloat fading = vf_cos(vf_saturate(part) * vf_set(TRC_HALF_PI));
        offset = offset * vf_where(vf_le(altitude, vf_set(to)), fading);
    }
    const vvec3 side = v3_normalize(v3(d->y, vf_zero() - d->x, vf_zero()));
    const vvec3 moved = v3_scale(side, offset);
    *o = v3_add(*o, moved);
    if (stereo->convergence_distance < INFINITY) {
        const vvec3 met = v3_scale(*d, vf_set(stereo->convergence_distance));
        *d = v3_normalize(v3_sub(met, moved));
    }
}

/* Columns of a matrix (rows of four) in the order of the axes that a panorama's directions are
 * along. */
static void turn_to_panorama(const struct trc_camera *camera, vfloat m[TRC_AFFINE_FLOATS]) {
    const struct trc_view_axis *axes = trc_view_axes(camera);
    for (int row = 0; row < TRC_AFFINE_FLOATS; row += 4) {
        const vfloat given[3] = {m[row], m[row + 1], m[row + 2]};
        for (int k = 0; k < 3; k++)
            m[row + k] = given[axes[k].column] * vf_set(axes[k].sign);
    }
}

/* When the lanes' samples are taken, in shares of the shutter's time. */
static vfloat sample_times(const struct trc_tile *t, vuint pixel, vuint index, vmask active) {
    const struct trc_camera *camera = &t->snapshot->camera;
    const vfloat half = vf_set(0.5f);
    if (!camera->has_motion)
        return half;
    vfloat time = trc_sample(&t->sampler, pixel, index, TRC_DIM_TIME);
    if (camera->shutter_cdf_inverse)
        time = table_lookup(camera->shutter_cdf_inverse, TRC_SHUTTER_ENTRIES, time, active);
    if (camera->row_delay > 0.0f) {
        const vfloat row =
            vi_to_float((vint)(pixel >> TRC_PIXEL_Y_SHIFT)) * vf_set(1.0f / (float)t->desc->height);
        const float delay = camera->row_delay;
        time = half + (time - half) * vf_set(1.0f - delay) + (half - row) * vf_set(delay);
    }
    return time;
}

/* Closes the gaps that rays outside of the lens leave: those that end before they begin. Returns
 * how many are left. */
static uint32_t drop_unseen(struct trc_ray_store *r, uint32_t count) {
    uint32_t kept = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (r->f[TRC_RAY_TMAX][i] < 0.0f)
            continue;
        if (kept != i)
            trc_rays_move(r, i, kept);
        kept++;
    }
    return kept;
}

/* What a path has behind it at its start: nothing. */
static void path_begin(struct trc_tile *t, uint32_t i) {
    struct trc_ray_store *out = &t->stack;
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    for (int k = TRC_RAY_WEIGHT_R; k <= TRC_RAY_WEIGHT_B; k++)
        vf_store(out->f[k] + i, one);
    vf_store(out->f[TRC_RAY_PDF] + i, -one);
    vf_store(out->f[TRC_RAY_MIN_PDF] + i, vf_set(FLT_MAX));
    for (int k = TRC_RAY_NX; k <= TRC_RAY_NZ; k++)
        vf_store(out->f[k] + i, zero);
    vf_store(out->f[TRC_RAY_INDIRECT_SCALE] + i, one);
    vi_store((int32_t *)out->w[TRC_RAY_SLOT] + i, vi_set((int32_t)i) + vi_lane());
    vu_store(out->w[TRC_RAY_PATH] + i,
             vu_set(TRC_VISIBLE_CAMERA | TRC_PATH_TRANSPARENT_BACKGROUND));
    vu_store(out->w[TRC_RAY_DEPTHS] + i, vu_set(0));
    vu_store(out->w[TRC_RAY_PARENT] + i, vu_set(0));
    if (t->measures_paths)
        vf_store(out->f[TRC_RAY_PATH_LENGTH] + i, zero);
    if (t->scales_clamps)
        vf_store(out->f[TRC_RAY_SPLIT_SCALE] + i, one);
    if (t->remembers_left)
        vu_store(out->w[TRC_RAY_LEFT] + i, vu_set(TRC_NO_HIT));
    if (t->light_passes)
        vu_store(out->w[TRC_RAY_SHARE] + i, vu_set(0));
    if (t->left) {
        vu_store(out->w[TRC_RAY_STRAND_INSTANCE] + i, vu_set(TRC_NO_HIT));
        vu_store(out->w[TRC_RAY_STRAND] + i, vu_set(0));
    }
}

void trc_camera_rays(struct trc_tile *t) {
    const struct trc_camera *camera = &t->snapshot->camera;
    const struct trc_sampler *sampler = &t->sampler;
    struct trc_ray_store *out = &t->stack;
    const bool lens = camera->aperture_radius > 0.0f;
    const bool panorama = trc_is_panorama(camera), stereo = camera->stereo.eye_offset != 0.0f;
    bool all_seen = true;
    trc_rays_reserve(out, t->samples.count);
    const bool sheared = camera->axes_volume < 1.0f;
    for (uint32_t i = 0; i < t->samples.count; i += TRC_WIDTH) {
        const vmask active = vm_first((int32_t)(t->samples.count - i));
        const vuint pixel = vu_load(t->samples.pixel + i), index = vu_load(t->samples.index + i);
        vfloat f[2];
        trc_samples(sampler, pixel, index, TRC_DIM_FILTER_X, 2, 0, 1, f);
        const vfloat px = vi_to_float((vint)(pixel & vu_set(TRC_PIXEL_X_MASK))) + vf_set(0.5f) +
                          table_lookup(t->job->filter_table, TRC_FILTER_TABLE, f[0], active);
        const vfloat py = vi_to_float((vint)(pixel >> TRC_PIXEL_Y_SHIFT)) + vf_set(0.5f) +
                          table_lookup(t->job->filter_table, TRC_FILTER_TABLE, f[1], active);
        const vfloat time = sample_times(t, pixel, index, active);
        vfloat m[TRC_AFFINE_FLOATS], window[4];
        camera_matrix(camera, time, active, m, window);
        const vfloat sx =
            window[0] + (window[1] - window[0]) * px * vf_set(1.0f / (float)t->desc->width);
        const vfloat sy =
            window[2] + (window[3] - window[2]) * py * vf_set(1.0f / (float)t->desc->height);
        vfloat at[2];
        if (lens) {
            vfloat u[2];
            trc_samples(sampler, pixel, index, TRC_DIM_LENS_X, 2, 0, 1, u);
            lens_point(camera, u[0], u[1], &at[0], &at[1]);
        }
        const struct view_rays r = panorama ? panorama_rays(camera, sx, sy, lens ? at : NULL)
                                            : plane_rays(camera, sx, sy, lens ? at : NULL);
        vvec3 o = r.o, d = r.d;
        if (panorama) {
            turn_to_panorama(camera, m);
            if (stereo)
                move_to_eye(&camera->stereo, &o, &d);
        }
        vvec3 way = v3(m[0] * d.x + m[1] * d.y + m[2] * d.z, m[4] * d.x + m[5] * d.y + m[6] * d.z,
                       m[8] * d.x + m[9] * d.y + m[10] * d.z);
        /* A sheared camera clips by lengths in its own space, as Cycles does. */
        if (sheared)
            way = v3_normalize(way);
        vvec3 from = v3(m[0] * o.x + m[1] * o.y + m[2] * o.z + m[3],
                        m[4] * o.x + m[5] * o.y + m[6] * o.z + m[7],
                        m[8] * o.x + m[9] * o.y + m[10] * o.z + m[11]);
        if (stereo && !panorama)
            move_to_eye(&camera->stereo, &from, &way);
        all_seen &= !vm_any(vm_andnot(active, r.seen));
        const vfloat end = vf_set(camera->clip_end) * r.clip_length;
        vf_store(out->f[TRC_RAY_OX] + i, from.x);
        vf_store(out->f[TRC_RAY_OY] + i, from.y);
        vf_store(out->f[TRC_RAY_OZ] + i, from.z);
        vf_store(out->f[TRC_RAY_DX] + i, way.x);
        vf_store(out->f[TRC_RAY_DY] + i, way.y);
        vf_store(out->f[TRC_RAY_DZ] + i, way.z);
        vf_store(out->f[TRC_RAY_TMIN] + i, vf_set(camera->clip_start) * r.clip_length);
        vf_store(out->f[TRC_RAY_TMAX] + i, vf_select(r.seen, end, vf_set(-1.0f)));
        vf_store(out->f[TRC_RAY_TIME] + i, time);
        path_begin(t, i);
    }
    trc_rays_add(out, all_seen ? t->samples.count : drop_unseen(out, t->samples.count));
}
