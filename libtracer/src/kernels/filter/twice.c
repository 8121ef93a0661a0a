/* What a filter leaves of a noisy picture is noise, which differs from pixel to pixel, and light
 * that it has moved, which is alike in pixels side by side: of trails of motion, edges out of focus
 * and soft shadows whose features do not show where they are. Means of 3 x 3 pixels of what is left
 * are given back, by the part of their squares, over the pixels around, that noise does not
 * explain. */
#include "kernels/filter/filter.h"

/* The squares of means over those of pixels where there is noise alone. It would be a ninth of
 * independent ones; but samplers spread noise over pixels evenly, and the slow part of it stays in
 * the clean film. */
#define NOISE_PART 0.06f
/* Light that counts as dark, and residual as large as can be, over the light around. */
#define DARK 0.01f
#define MOST_RESIDUAL 32.0f
/* Of a channel that is the same everywhere but for rounding, and its square summed. */
#define LEAST_CHANGE 1e-5f
#define LEAST_SQUARES 1e-9f
/* The first channels, of Combined: three colours, and alpha. */
enum { COLORS = 3, ALPHA = 3, CHANNELS };

struct work {
    float *light, *part;
    float *residual[CHANNELS], *mean[CHANNELS]; /* mean: of 3 x 3 pixels */
    float *relative, *smooth;                   /* what is explained, squared at last */
    float *columns, *own_sum, *smooth_sum;
};

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    float **const all[] = {&w->light,   &w->part,    &w->relative,  &w->smooth,
                           &w->columns, &w->own_sum, &w->smooth_sum};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        *all[i] = trc_plane_carve(&c);
    for (int k = 0; k < CHANNELS; k++) {
        w->residual[k] = trc_plane_carve(&c);
        w->mean[k] = trc_plane_carve(&c);
    }
    return c.used;
}

size_t trc_twice_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* A plane of the film that holds residual. */
static float *plane_of(const struct trc_denoise *d, uint32_t number) {
    return d->memory + (size_t)number * d->film->width * d->film->height;
}

static uint32_t batch_of(const struct trc_denoise *d, uint32_t first) {
    const uint32_t left = d->channel_count - first;
    return left < TRC_RESIDUAL_CHANNELS ? left : TRC_RESIDUAL_CHANNELS;
}

static size_t pixel_at(const struct trc_denoise_job *job, uint32_t x, uint32_t y) {
    return (size_t)(job->y + y) * job->denoise->film->width + job->x + x;
}

static void store_residual(const struct trc_denoise_job *job, uint32_t number, float *plane) {
    const struct trc_film *film = job->denoise->film;
    const struct trc_light_channel c = trc_light_channel_at(film, number);
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const size_t pixel = pixel_at(job, x, y), i = pixel * c.stride;
            const uint32_t count = film->sample_counts[pixel];
            const double left = count ? (c.sums[i] - c.clean[i]) / count : 0.0;
            plane[pixel] = isfinite(left) ? (float)left : 0.0f;
        }
}

static void store_light(const struct trc_denoise_job *job, float *plane) {
    const struct trc_film *film = job->denoise->film;
    const double *clean = film->clean.sums[TRC_PASS_COMBINED];
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const size_t pixel = pixel_at(job, x, y);
            const double *color = clean + 4 * pixel;
            const uint32_t count = film->sample_counts[pixel];
            const double light =
                count ? (color[0] + color[1] + color[2]) / (COLORS * (double)count) : 0.0;
            plane[pixel] = isfinite(light) && light > 0.0 ? (float)light : 0.0f;
        }
}

void trc_residual(const struct trc_denoise_job *job, uint32_t first) {
    const struct trc_denoise *d = job->denoise;
    for (uint32_t k = 0; k < batch_of(d, first); k++)
        store_residual(job, first + k, plane_of(d, TRC_RESIDUAL_PLANES + k));
    if (first == 0)
        store_light(job, plane_of(d, TRC_RESIDUAL_LIGHT));
}

/* The mean of the colours' residual over the light around. */
static void find_relative(struct work *w) {
    trc_plane_smooth(w->light, w->smooth, TRC_HALO - 1);
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        vfloat sum = vf_set(0.0f);
        for (int k = 0; k < COLORS; k++)
            sum = sum + vf_load(w->residual[k] + i);
        const vfloat around = (vf_load(w->smooth + i) + vf_set(DARK)) * vf_set((float)COLORS);
        vf_store(w->relative + i, vf_clamp(sum / around, -MOST_RESIDUAL, MOST_RESIDUAL));
    }
}

static void square(float *plane) {
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        const vfloat value = vf_load(plane + i);
        vf_store(plane + i, value * value);
    }
}

static bool has_residual(const float *plane) {
    vmask found = vm_none();
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH)
        found = vm_or(found, vf_gt(vf_abs(vf_load(plane + i)), vf_set(LEAST_CHANGE)));
    return vm_any(found);
}

/* Leaves of the parts what noise of the relative residual does not explain of its means. without:
 * the part where there is no residual. */
static void explain(struct work *w, float without) {
    trc_plane_smooth(w->relative, w->smooth, TRC_HALO - 2);
    square(w->relative);
    square(w->smooth);
    trc_plane_sum(w->relative, w->columns, w->own_sum);
    trc_plane_sum(w->smooth, w->columns, w->smooth_sum);
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        const vfloat own = vf_load(w->own_sum + i), smooth = vf_load(w->smooth_sum + i);
        const vfloat excess =
            (smooth - own * vf_set(NOISE_PART)) * vf_set(1.0f / (1.0f - NOISE_PART));
        const vfloat part = vf_clamp(excess / vf_max(smooth, vf_set(1e-30f)), 0.0f, 1.0f);
        const vmask is_none = vf_le(own, vf_set(LEAST_SQUARES));
        vf_store(w->part + i,
                 vf_min(vf_load(w->part + i), vf_select(is_none, vf_set(without), part)));
    }
}

/* By the colours, and by alpha, too, where there is a residual of it. */
static void find_parts(struct work *w) {
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH)
        vf_store(w->part + i, vf_set(1.0f));
    find_relative(w);
    explain(w, 0.0f);
    if (!has_residual(w->residual[ALPHA]))
        return;
    memcpy(w->relative, w->residual[ALPHA], TRC_PLANE_FLOATS * sizeof *w->relative);
    explain(w, 1.0f);
}

/* The part by which a pixel's channels from begin to end move no farther than they are from the
 * plain ones: what has no noise stays beside single bright samples. */
static float limit_change(const struct work *w, int at, float part, int begin, int end) {
    float own = 0.0f, given = 0.0f;
    for (int k = begin; k < end; k++) {
        own += fabsf(w->residual[k][at]);
        given += fabsf(w->mean[k][at]) * part;
    }
    own += LEAST_CHANGE;
    return given > own ? part * (own / given) : part;
}

/* The part by which no colour falls below 0. */
static float limit_dark(const struct trc_film *film, const struct work *w, size_t pixel, int at,
                        float part) {
    for (int k = 0; k < COLORS; k++) {
        const double clean = film->clean.sums[TRC_PASS_COMBINED][4 * pixel + (size_t)k];
        const double given = (double)w->mean[k][at] * film->sample_counts[pixel];
        if (clean >= 0.0 && clean + (double)part * given < 0.0)
            part = (float)(clean / -given);
    }
    return part;
}

static void limit_parts(const struct trc_denoise_job *job, struct work *w) {
    for (int k = 0; k < CHANNELS; k++)
        trc_plane_smooth(w->residual[k], w->mean[k], 0);
    float *const stored = plane_of(job->denoise, TRC_RESIDUAL_PART);
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const size_t pixel = pixel_at(job, x, y);
            const int at = trc_plane_at((int)x, (int)y);
            float part = limit_change(w, at, w->part[at], 0, COLORS);
            part = limit_change(w, at, part, ALPHA, CHANNELS);
            stored[pixel] = limit_dark(job->denoise->film, w, pixel, at, part);
        }
}

static void give(const struct trc_denoise_job *job, uint32_t number, const float *mean) {
    const struct trc_film *film = job->denoise->film;
    const struct trc_light_channel c = trc_light_channel_at(film, number);
    const float *parts = plane_of(job->denoise, TRC_RESIDUAL_PART);
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const size_t pixel = pixel_at(job, x, y);
            const float given = parts[pixel] * mean[trc_plane_at((int)x, (int)y)];
            c.clean[pixel * c.stride] += (double)given * film->sample_counts[pixel];
        }
}

void trc_twice(const struct trc_denoise_job *job, uint32_t first) {
    const struct trc_denoise *d = job->denoise;
    const uint32_t count = batch_of(d, first);
    struct work w;
    carve(&w, job->memory);
    if (first == 0) {
        trc_plane_load(job, plane_of(d, TRC_RESIDUAL_LIGHT), w.light);
        for (uint32_t k = 0; k < CHANNELS; k++)
            trc_plane_load(job, plane_of(d, TRC_RESIDUAL_PLANES + k), w.residual[k]);
        find_parts(&w);
        limit_parts(job, &w);
    }
    for (uint32_t k = 0; k < count; k++) {
        const bool is_made = first + k < CHANNELS;
        float *const mean = is_made ? w.mean[k] : w.smooth;
        if (!is_made) {
            trc_plane_load(job, plane_of(d, TRC_RESIDUAL_PLANES + k), w.relative);
            trc_plane_smooth(w.relative, mean, 0);
        }
        give(job, first + k, mean);
    }
    if (first + count == d->channel_count)
        trc_limit_covers(job);
}
