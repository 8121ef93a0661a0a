/* The samples of a tile's pixels, batch by batch: which go together, and in what order. */
#include "kernels/tile/tile.h"

#include <math.h>

#include "kernels/simd/wide_math.h"
#include "kernels/trace/panorama.h"

/* ---- a batch ---- */

/* Deeper steps than this share their sample dimensions: their light is faint. */
#define LAST_GENERATION 200

static void samples_clear(struct trc_tile *t) {
    const uint32_t entries = trc_column_entries(t->catchers);
    const size_t bytes = entries * sizeof(float);
    for (int k = 0; k < 3; k++)
        memset(t->samples.radiance[k], 0, bytes);
    memset(t->samples.transparency, 0, bytes);
    for (uint32_t i = 0; i < t->samples.pass_count; i++) {
        const uint32_t pass = t->samples.passes[i];
        const float miss = trc_pass_info_of(pass)->miss;
        for (uint32_t k = 0; k < trc_pass_info_of(pass)->sums; k++) {
            float *values = t->samples.pass[pass][k];
            for (uint32_t slot = 0; slot < entries; slot++)
                values[slot] = miss;
        }
    }
}

/* Rows of a catcher's light belong to the pixels of the first. */
static void samples_repeat(struct trc_tile *t) {
    uint32_t *const columns[] = {t->samples.pixel, t->samples.index};
    for (int k = 0; k < 2; k++)
        for (uint32_t row = 1; row < TRC_CATCHER_ROWS; row++)
            memcpy(columns[k] + row * TRC_CATCHER_BATCH, columns[k],
                   TRC_CATCHER_BATCH * sizeof *columns[k]);
}

/* Follows the rays of the stack to their ends. */
static void stack_render(struct trc_tile *t) {
    while (t->stack.count) {
        trc_rays_take(&t->stack, &t->work, trc_rays_step(&t->stack, &t->ray_room));
        trc_clock_trace(t);
        trc_assembly_trace(t);
        trc_clock_shade(t);
        trc_shade_batch(t);
        trc_shadow_flush(t);
        if (t->generation < LAST_GENERATION)
            t->generation++;
    }
}

static void batch_render(struct trc_tile *t) {
    samples_clear(t);
    if (t->catchers)
        samples_repeat(t);
    trc_camera_rays(t);
    t->generation = 0;
    stack_render(t);
    if (t->splits && t->later.count) {
        trc_rays_take(&t->later, &t->stack, t->later.count);
        t->generation = 1;
        stack_render(t);
    }
    trc_clock_other(t);
    trc_film_add(t);
}

/* ---- batches of a tile ---- */

/* Samples a pixel has in one batch, and the squares in which a batch takes pixels, in Z-order. A
 * packet of a pinhole camera then holds a 2x2 square of pixels: the narrowest beam. */
#define SAMPLES_PER_BATCH 16
#define SQUARE 8
/* With an open shutter packets hold a 4x4 square of pixels and a quarter of the time, else with a
 * wide lens a quarter of the lens. */
#define SHARED_CELLS 4
/* Radius of the circle of confusion far behind the focus, from which on a lens is wide. */
#define WIDE_LENS_PIXELS 8.0f

/* Whether a pixel of the tile gets samples. */
TRC_INLINE bool is_sampled(const struct trc_tile_job *job, uint32_t x, uint32_t y) {
    const size_t pixel = (size_t)(job->y + y) * job->film->width + job->x + x;
    if (job->extra)
        return job->extra->levels[pixel] >= job->extra_level;
    return !job->adaptive || job->adaptive->pixels[pixel].reasons;
}

/* How many pixels of the square at x, y get samples, at most. */
static uint32_t square_pixels(const struct trc_tile *t, uint32_t x, uint32_t y) {
    const struct trc_tile_job *job = t->job;
    if (!job->adaptive && !job->extra)
        return SQUARE * SQUARE;
    uint32_t count = 0;
    for (uint32_t j = y; j < y + SQUARE && j < job->height; j++)
        for (uint32_t i = x; i < x + SQUARE && i < job->width; i++)
            count += is_sampled(job, i, j);
    return count;
}

/* Appends the samples [begin, end) of the square of pixels at x, y of the tile, clipped to it. */
static void square_append(struct trc_tile *t, uint32_t x, uint32_t y, uint32_t begin,
                          uint32_t end) {
    const struct trc_tile_job *job = t->job;
    for (uint32_t place = 0; place < SQUARE * SQUARE; place++) { /* in Z-order */
        uint32_t i = x, j = y;
        for (uint32_t bit = 0; 1u << bit < SQUARE; bit++) {
            i += (place >> (2 * bit) & 1u) << bit;
            j += (place >> (2 * bit + 1) & 1u) << bit;
        }
        if (i >= job->width || j >= job->height || !is_sampled(job, i, j))
            continue;
        const uint32_t px = t->desc->crop_x + job->x + i, py = t->desc->crop_y + job->y + j;
        for (uint32_t s = begin; s < end; s++) {
            t->samples.pixel[t->samples.count] = px | py << TRC_PIXEL_Y_SHIFT;
            t->samples.index[t->samples.count++] = s;
        }
    }
}

/* What rays of a packet share beside their neighbourhood. */
enum sharing { SHARE_NOTHING, SHARE_TIME, SHARE_LENS };

static enum sharing sharing_of(const struct trc_tile *t, uint32_t sample_count) {
    const struct trc_camera *c = &t->snapshot->camera;
    float pixel = fabsf(c->windows[0][1] - c->windows[0][0]) / (float)t->desc->width;
    if (c->aperture_radius > 0.0f && trc_is_panorama(c))
        pixel = vf_get(trc_panorama_pixel_angle(c, vf_set(0.5f), vf_set(0.5f),
                                                1.0f / (float)t->desc->width,
                                                1.0f / (float)t->desc->height),
                       0);
    if (c->type != TRC_CAMERA_ORTHOGRAPHIC)
        pixel *= c->focus_distance;
    if (sample_count < SHARED_CELLS)
        return SHARE_NOTHING;
    if (c->has_motion)
        return SHARE_TIME;
    return c->aperture_radius > WIDE_LENS_PIXELS * pixel ? SHARE_LENS : SHARE_NOTHING;
}

/* Orders the batch by cells of lens or time, so that rays of a packet share one. This is what the
 * paper's interleaved tile does for coherence, without giving pixels the same pattern. */
static void samples_order(struct trc_tile *t, enum sharing sharing) {
    const uint32_t count = t->samples.count;
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vuint pixel = vu_load(t->samples.pixel + i), index = vu_load(t->samples.index + i);
        vfloat cell;
        if (sharing == SHARE_TIME) {
            cell =
                trc_sample(&t->sampler, pixel, index, TRC_DIM_TIME) * vf_set((float)SHARED_CELLS);
        } else {
            const vfloat two = vf_set(2.0f);
            vfloat at[2];
            trc_samples(&t->sampler, pixel, index, TRC_DIM_LENS_X, 2, 0, 1, at);
            cell = vf_floor(two * at[0]) * two + two * at[1];
        }
        vi_store((int32_t *)t->keys + i, vf_to_int(cell));
    }
    trc_tile_sort(t, t->keys, count, t->order);
    uint32_t *const columns[] = {t->samples.pixel, t->samples.index};
    for (int k = 0; k < 2; k++) {
        memcpy(t->keys, columns[k], count * sizeof *t->keys);
        for (uint32_t i = 0; i < count; i++)
            columns[k][i] = t->keys[t->order[i]];
    }
}

static void batch_flush(struct trc_tile *t, enum sharing sharing) {
    if (!t->samples.count)
        return;
    if (sharing != SHARE_NOTHING)
        samples_order(t, sharing);
    batch_render(t);
    t->samples.count = 0;
}

/* The samples [begin, end) of the tile's pixels. */
static void samples_render(struct trc_tile *t, uint32_t begin, uint32_t end) {
    const struct trc_tile_job *job = t->job;
    const uint32_t maximum = t->catchers ? TRC_CATCHER_BATCH : TRC_BATCH;
    const enum sharing sharing = sharing_of(t, end - begin);
    t->samples.count = 0;
    for (uint32_t y = 0; y < job->height; y += SQUARE)
        for (uint32_t x = 0; x < job->width; x += SQUARE) {
            if (t->samples.count + square_pixels(t, x, y) * (end - begin) > maximum)
                batch_flush(t, sharing);
            square_append(t, x, y, begin, end);
        }
    batch_flush(t, sharing);
}

void trc_samples_render(struct trc_tile *t) {
    const struct trc_tile_job *job = t->job;
    const uint32_t maximum = t->catchers ? SAMPLES_PER_BATCH / 2 : SAMPLES_PER_BATCH;
    for (uint32_t s = job->sample_begin; s < job->sample_end && !*job->cancel;) {
        const uint32_t end = job->sample_end - s > maximum ? s + maximum : job->sample_end;
        samples_render(t, s, end);
        s = end;
    }
}
