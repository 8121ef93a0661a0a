/* How much of the clean film is kept: all where its estimated error is below half of the plain
 * pixel's, then less, by means over the pixels around, as estimates of single pixels are noise. */
#include "kernels/filter/filter.h"

/* Pixels on each side over which estimates are averaged. */
#define REACH 4
/* The part kept is that much of variance / (variance + error), which would be best for independent
 * estimates. */
#define FAVOR 1.5f

struct work {
    float *estimate, *columns, *mean[2]; /* of variance, error */
};

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    float **const all[] = {&w->estimate, &w->columns, &w->mean[0], &w->mean[1]};
    for (int i = 0; i < 4; i++)
        *all[i] = trc_plane_carve(&c);
    return c.used;
}

size_t trc_blend_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* Sums over squares of pixels of the tile; beyond the frame its mirror image. */
static void sum_squares(const struct trc_denoise_job *job, const float *values, struct work *w,
                        float *sums) {
    const struct trc_film *film = job->denoise->film;
    for (int y = -REACH; y < TRC_TILE_SIZE + REACH; y++)
        for (int x = -REACH; x < TRC_TILE_SIZE + REACH; x++)
            w->estimate[trc_plane_at(x, y)] =
                values[(size_t)trc_mirror((int64_t)job->y + y, film->height) * film->width +
                       trc_mirror((int64_t)job->x + x, film->width)];
    for (int y = 0; y < TRC_TILE_SIZE; y++)
        for (int x = -REACH; x < TRC_TILE_SIZE + REACH; x++) {
            float sum = 0.0f;
            for (int j = -REACH; j <= REACH; j++)
                sum += w->estimate[trc_plane_at(x, y + j)];
            w->columns[trc_plane_at(x, y)] = sum;
        }
    for (int y = 0; y < TRC_TILE_SIZE; y++)
        for (int x = 0; x < TRC_TILE_SIZE; x++) {
            float sum = 0.0f;
            for (int i = -REACH; i <= REACH; i++)
                sum += w->columns[trc_plane_at(x + i, y)];
            sums[trc_plane_at(x, y)] = sum;
        }
}

/* Moves a pixel's clean sums to the plain ones as far as these are kept. */
static void blend(const double *plain, double *clean, uint32_t channels, double part) {
    for (uint32_t k = 0; k < channels; k++) {
        const double mixed = plain[k] + part * (clean[k] - plain[k]);
        clean[k] = isfinite(mixed) ? mixed : plain[k];
    }
}

/* The largest part with which no colour of Combined falls below 0, as a slope that is followed
 * beyond what it was found by would have it. */
static double limit(const struct trc_film *film, size_t pixel, double part) {
    const double *plain = film->sums[TRC_PASS_COMBINED] + 4 * pixel;
    const double *clean = film->clean.sums[TRC_PASS_COMBINED] + 4 * pixel;
    for (int c = 0; c < 3; c++)
        if (plain[c] >= 0.0 && clean[c] < 0.0)
            part = fmin(part, plain[c] / (plain[c] - clean[c]));
    return part;
}

static void blend_pixel(const struct trc_film *film, size_t pixel, double part) {
    part = limit(film, pixel, part);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        if (film->clean.sums[pass]) {
            const uint32_t channels = trc_pass_info_of(pass)->sums;
            blend(film->sums[pass] + pixel * channels, film->clean.sums[pass] + pixel * channels,
                  channels, part);
        }
    double *alpha = &film->clean.sums[TRC_PASS_COMBINED][4 * pixel + 3];
    *alpha = fmin(fmax(*alpha, 0.0), film->sample_counts[pixel]);
    if (film->clean.caught)
        blend((const double *)&film->caught[pixel], (double *)&film->clean.caught[pixel],
              TRC_CAUGHT_CHANNELS, part);
}

void trc_blend(const struct trc_denoise_job *job) {
    const struct trc_denoise *d = job->denoise;
    struct work w;
    carve(&w, job->memory);
    sum_squares(job, d->variance, &w, w.mean[0]);
    sum_squares(job, d->error, &w, w.mean[1]);
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const int at = trc_plane_at((int)x, (int)y);
            const float variance = w.mean[0][at], error = fmaxf(w.mean[1][at], 0.0f);
            const float part =
                variance > 0.0f ? fminf(FAVOR * variance / (variance + error), 1.0f) : 0.0f;
            blend_pixel(d->film, (size_t)(job->y + y) * d->film->width + job->x + x, (double)part);
        }
}
