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
#define TRC_HALO 7
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

/* A pixel of the frame beyond whose edges it is mirrored; far outside, its edge. */
TRC_INLINE uint32_t trc_mirror(int64_t x, uint32_t size) {
    if (x < 0)
        x = -x - 1;
    if (x >= size)
        x = 2 * (int64_t)size - 1 - x;
    return x < 0 ? 0 : x >= size ? size - 1 : (uint32_t)x;
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

#endif
