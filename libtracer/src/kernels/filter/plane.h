/* Planes: a tile's pixels and those around it, one float each, in rows that vectors may overrun.
 *
 * Beyond the frame lies its mirror image, so that patches are whole; but no pixel takes light from
 * there. */
#ifndef TRACER_KERNELS_FILTER_PLANE_H
#define TRACER_KERNELS_FILTER_PLANE_H

#include "core/carver.h"
#include "kernels/simd/wide_math.h"
#include "model/denoise.h"

/* Pixels on each side: of a window, a patch and a smoothed variance. */
#define TRC_HALO 6
#define TRC_PLANE_ROWS (TRC_TILE_SIZE + 2 * TRC_HALO)
/* The tile begins at this column; vectors of a row end before the stride. */
#define TRC_PLANE_LEFT 8
#define TRC_PLANE_STRIDE 64
#define TRC_PLANE_FLOATS (TRC_PLANE_ROWS * TRC_PLANE_STRIDE)

/* Where the tile's pixel x, y is in a plane; coordinates from -TRC_HALO on. */
TRC_INLINE int trc_plane_at(int x, int y) {
    return (y + TRC_HALO) * TRC_PLANE_STRIDE + x + TRC_PLANE_LEFT;
}

/* A plane of zeros. */
TRC_INLINE float *trc_plane_carve(struct trc_carver *c) {
    float *plane = trc_carve(c, TRC_PLANE_FLOATS * sizeof *plane);
    if (c->base)
        memset(plane, 0, TRC_PLANE_FLOATS * sizeof *plane);
    return plane;
}

/* Columns from -TRC_HALO on that may be of use, in whole vectors of every width. */
#define TRC_PLANE_COLUMNS 48

/* Means of 3 x 3 pixels of the rows [-end, TRC_TILE_SIZE + end); one more around them is read. */
TRC_INLINE void trc_plane_smooth(const float *in, float *out, int end) {
    for (int y = -end; y < TRC_TILE_SIZE + end; y++)
        for (int x = -TRC_HALO; x < TRC_PLANE_COLUMNS - TRC_HALO; x += TRC_WIDTH) {
            vfloat sum = vf_set(0.0f);
            for (int j = -1; j <= 1; j++)
                for (int i = -1; i <= 1; i++)
                    sum = sum + vf_load(in + trc_plane_at(x + i, y + j));
            vf_store(out + trc_plane_at(x, y), sum * vf_set(1.0f / 9.0f));
        }
}

/* Pixels on each side over which estimates are summed. */
#define TRC_SUM_REACH 4

/* Sums over squares of pixels, of the tile. columns: scratch. */
TRC_INLINE void trc_plane_sum(const float *plane, float *columns, float *sums) {
    for (int y = 0; y < TRC_TILE_SIZE; y++) {
        for (int x = -TRC_HALO; x < TRC_PLANE_COLUMNS - TRC_HALO; x += TRC_WIDTH) {
            const float *values = plane + trc_plane_at(x, y);
            vfloat sum = vf_set(0.0f);
            for (int j = -TRC_SUM_REACH; j <= TRC_SUM_REACH; j++)
                sum = sum + vf_load(values + j * TRC_PLANE_STRIDE);
            vf_store(columns + trc_plane_at(x, 0), sum);
        }
        for (int x = 0; x < TRC_TILE_SIZE; x += TRC_WIDTH) {
            vfloat sum = vf_set(0.0f);
            for (int i = -TRC_SUM_REACH; i <= TRC_SUM_REACH; i++)
                sum = sum + vf_load(columns + trc_plane_at(x + i, 0));
            vf_store(sums + trc_plane_at(x, y), sum);
        }
    }
}

/* A mean as a float within limits; NaN: the lower. Comparisons, as fminf may be a call. */
TRC_INLINE float trc_cut(double mean, float low, float high) {
    const float value = (float)mean;
    return value > low ? (value < high ? value : high) : low;
}

/* Squared differences less what noise makes of them, over what it may make of them. least: what
 * differences of no noise are compared to. */
TRC_INLINE vfloat trc_excess(vfloat change2, vfloat noise_p, vfloat noise_q, float least) {
    return (change2 - (noise_p + vf_min(noise_p, noise_q))) / (noise_p + noise_q + vf_set(least));
}

/* Sums of a row and the two above it, in place, for patches of 3 x 3; rows in their order. */
TRC_INLINE void trc_patch_columns(float *row, int stride) {
    for (int x = 0; x < TRC_PLANE_COLUMNS; x += TRC_WIDTH)
        vf_store(row + x,
                 vf_load(row + x) + vf_load(row + stride + x) + vf_load(row + 2 * stride + x));
}

/* The mean of the patch whose column sums begin there. */
TRC_INLINE vfloat trc_patch_mean(const float *columns) {
    return (vf_load(columns) + vf_load(columns + 1) + vf_load(columns + 2)) * vf_set(1.0f / 9.0f);
}

/* A weight by how far patches are apart: like exp(-x), but 0 from 8 on; 1 below 0. */
TRC_INLINE vfloat trc_bell(vfloat x) {
    const vfloat t = vf_clamp(vf_set(1.0f) - x * vf_set(0.125f), 0.0f, 1.0f);
    const vfloat t2 = t * t, t4 = t2 * t2;
    return t4 * t4;
}

#endif
