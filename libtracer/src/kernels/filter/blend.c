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
    for (int y = -REACH; y < TRC_TILE_SIZE + REACH; y++) {
        const float *row =
            values + (size_t)trc_mirror((int64_t)job->y + y, film->height) * film->width;
        for (int x = -REACH; x < TRC_TILE_SIZE + REACH; x++)
            w->estimate[trc_plane_at(x, y)] = row[trc_mirror((int64_t)job->x + x, film->width)];
    }
    for (int y = 0; y < TRC_TILE_SIZE; y++) {
        for (int x = -TRC_HALO; x < TRC_PLANE_COLUMNS - TRC_HALO; x += TRC_WIDTH) {
            const float *estimate = w->estimate + trc_plane_at(x, y);
            vfloat sum = vf_set(0.0f);
            for (int j = -REACH; j <= REACH; j++)
                sum = sum + vf_load(estimate + j * TRC_PLANE_STRIDE);
            vf_store(w->columns + trc_plane_at(x, 0), sum);
        }
        for (int x = 0; x < TRC_TILE_SIZE; x += TRC_WIDTH) {
            vfloat sum = vf_set(0.0f);
            for (int i = -REACH; i <= REACH; i++)
                sum = sum + vf_load(w->columns + trc_plane_at(x + i, 0));
            vf_store(sums + trc_plane_at(x, y), sum);
        }
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

/* Moves a tile's clean sums to the plain ones as far as these are kept. */
static void blend(const struct trc_denoise_job *job, const float *parts, const double *plain,
                  double *clean, uint32_t channels) {
    for (uint32_t y = 0; y < job->height; y++) {
        const size_t row = (size_t)(job->y + y) * job->denoise->film->width + job->x;
        for (uint32_t x = 0; x < job->width; x++) {
            const double part = (double)parts[trc_plane_at((int)x, (int)y)];
            for (size_t i = (row + x) * channels; i < (row + x + 1) * channels; i++) {
                const double mixed = plain[i] + part * (clean[i] - plain[i]);
                clean[i] = isfinite(mixed) ? mixed : plain[i];
            }
        }
    }
}

static void find_parts(const struct trc_denoise_job *job, const struct work *w, float *parts) {
    const struct trc_film *film = job->denoise->film;
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const int at = trc_plane_at((int)x, (int)y);
            const float variance = w->mean[0][at];
            const float error = w->mean[1][at] > 0.0f ? w->mean[1][at] : 0.0f;
            float part = variance > 0.0f ? FAVOR * variance / (variance + error) : 0.0f;
            part = part < 1.0f ? part : 1.0f;
            const size_t pixel = (size_t)(job->y + y) * film->width + job->x + x;
            parts[at] = (float)limit(film, pixel, (double)part);
        }
}

static double clamp(double x, double most) { return x > 0.0 ? (x < most ? x : most) : 0.0; }

/* Light of shadow catchers is none below 0, as a shadow is one over another, and they stand for no
 * more than alpha leaves. */
static void limit_caught(struct trc_caught *caught, double most_coverage) {
    caught->coverage = clamp(caught->coverage, most_coverage);
    for (int c = 0; c < 3; c++) {
        caught->blocked[c] = fmax(caught->blocked[c], 0.0);
        caught->unblocked[c] = fmax(caught->unblocked[c], 0.0);
    }
}

static void limit_covers(const struct trc_denoise_job *job) {
    const struct trc_film *film = job->denoise->film;
    for (uint32_t y = 0; y < job->height; y++)
        for (uint32_t x = 0; x < job->width; x++) {
            const size_t pixel = (size_t)(job->y + y) * film->width + job->x + x;
            double *alpha = &film->clean.sums[TRC_PASS_COMBINED][4 * pixel + 3];
            *alpha = clamp(*alpha, film->sample_counts[pixel]);
            if (film->clean.caught)
                limit_caught(&film->clean.caught[pixel], film->sample_counts[pixel] - *alpha);
        }
}

void trc_blend(const struct trc_denoise_job *job) {
    const struct trc_denoise *d = job->denoise;
    const struct trc_film *film = d->film;
    struct work w;
    carve(&w, job->memory);
    sum_squares(job, d->variance, &w, w.mean[0]);
    sum_squares(job, d->error, &w, w.mean[1]);
    float *parts = w.columns;
    find_parts(job, &w, parts);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        if (film->clean.sums[pass])
            blend(job, parts, film->sums[pass], film->clean.sums[pass],
                  trc_pass_info_of(pass)->sums);
    if (film->clean.caught)
        blend(job, parts, (const double *)film->caught, (double *)film->clean.caught,
              TRC_CAUGHT_CHANNELS);
    limit_covers(job);
}
