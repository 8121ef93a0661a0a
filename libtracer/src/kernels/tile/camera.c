/* Camera rays: pixel filter, lens, shutter. The lens is a disk by the concentric map of Shirley and
 * Chiu, 1997, or a regular polygon. */
#include <float.h>

#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/mesh_fetch.h"
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
                              vfloat m[12], vfloat window[4]) {
    const float *base = camera->camera_to_world->m, *windows = camera->windows[0];
    if (camera->key_count < 2) {
        for (int k = 0; k < 12; k++)
            m[k] = vf_set(base[k]);
        for (int k = 0; k < 4; k++)
            window[k] = vf_set(windows[k]);
        return;
    }
    vfloat f;
    const vint key = trc_wide_key(time, camera->key_count, &f);
    for (int k = 0; k < 12; k++)
        m[k] = trc_between(vf_gather(base + k, key * vi_set(12), active),
                           vf_gather(base + 12 + k, key * vi_set(12), active), f);
    for (int k = 0; k < 4; k++)
        window[k] = trc_between(vf_gather(windows + k, key * vi_set(4), active),
                                vf_gather(windows + 4 + k, key * vi_set(4), active), f);
}

void trc_camera_rays(struct trc_tile *t) {
    const struct trc_camera *camera = &t->snapshot->camera;
    const struct trc_sampler *sampler = &t->sampler;
    struct trc_ray_store *out = &t->stack;
    const bool lens = camera->aperture_radius > 0.0f;
    const bool orthographic = camera->type == TRC_CAMERA_ORTHOGRAPHIC;
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
        vfloat time = vf_set(0.5f);
        if (camera->has_motion) {
            time = trc_sample(sampler, pixel, index, TRC_DIM_TIME);
            if (camera->shutter_cdf_inverse)
                time = table_lookup(camera->shutter_cdf_inverse, TRC_SHUTTER_ENTRIES, time, active);
        }
        vfloat m[12], window[4];
        camera_matrix(camera, time, active, m, window);
        const vfloat sx =
            window[0] + (window[1] - window[0]) * px * vf_set(1.0f / (float)t->desc->width);
        const vfloat sy =
            window[2] + (window[3] - window[2]) * py * vf_set(1.0f / (float)t->desc->height);
        const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
        vvec3 o = orthographic ? v3(sx, sy, zero) : v3_zero();
        vvec3 d = orthographic ? v3(zero, zero, -one) : v3(sx, sy, -one);
        if (lens) {
            vfloat at[2], lx, ly;
            trc_samples(sampler, pixel, index, TRC_DIM_LENS_X, 2, 0, 1, at);
            lens_point(camera, at[0], at[1], &lx, &ly);
            const vvec3 focus = v3_add(o, v3_scale(d, vf_set(camera->focus_distance)));
            const vfloat radius = vf_set(camera->aperture_radius);
            o = v3_add(o, v3(lx * radius, ly * radius, zero));
            d = v3_sub(focus, o);
        }
        d = v3_normalize(d);
        /* Ray length per unit along the view axis; a sheared camera clips by lengths in its own
         * space, as Cycles does. */
        const vfloat per_z = -one / d.z;
        vvec3 way = v3(m[0] * d.x + m[1] * d.y + m[2] * d.z, m[4] * d.x + m[5] * d.y + m[6] * d.z,
                       m[8] * d.x + m[9] * d.y + m[10] * d.z);
        if (sheared)
            way = v3_normalize(way);
        vf_store(out->f[TRC_RAY_OX] + i, m[0] * o.x + m[1] * o.y + m[2] * o.z + m[3]);
        vf_store(out->f[TRC_RAY_OY] + i, m[4] * o.x + m[5] * o.y + m[6] * o.z + m[7]);
        vf_store(out->f[TRC_RAY_OZ] + i, m[8] * o.x + m[9] * o.y + m[10] * o.z + m[11]);
        vf_store(out->f[TRC_RAY_DX] + i, way.x);
        vf_store(out->f[TRC_RAY_DY] + i, way.y);
        vf_store(out->f[TRC_RAY_DZ] + i, way.z);
        vf_store(out->f[TRC_RAY_TMIN] + i, vf_set(camera->clip_start) * per_z);
        vf_store(out->f[TRC_RAY_TMAX] + i, vf_set(camera->clip_end) * per_z);
        vf_store(out->f[TRC_RAY_TIME] + i, time);
        for (int k = TRC_RAY_WEIGHT_R; k <= TRC_RAY_WEIGHT_B; k++)
            vf_store(out->f[k] + i, one);
        vf_store(out->f[TRC_RAY_PDF] + i, -one);
        vf_store(out->f[TRC_RAY_MIN_PDF] + i, vf_set(FLT_MAX));
        for (int k = TRC_RAY_NX; k <= TRC_RAY_NZ; k++)
            vf_store(out->f[k] + i, zero);
        vf_store(out->f[TRC_RAY_BEYOND] + i, one);
        vi_store((int32_t *)out->w[TRC_RAY_SLOT] + i, vi_set((int32_t)i) + vi_lane());
        vu_store(out->w[TRC_RAY_PATH] + i,
                 vu_set(TRC_VISIBLE_CAMERA | TRC_PATH_TRANSPARENT_BACKGROUND));
        vu_store(out->w[TRC_RAY_DEPTHS] + i, vu_set(0));
        vu_store(out->w[TRC_RAY_PARENT] + i, vu_set(0));
        if (t->looks_back)
            vu_store(out->w[TRC_RAY_LEFT] + i, vu_set(TRC_NO_HIT));
    }
    trc_rays_add(out, t->samples.count);
}
