/* How much of the clean film is kept: all where its estimated error is below half of the plain
 * pixel's, then less, by means over the pixels around, as estimates of single pixels are noise. The
 * same is asked of smoothed pictures, in which noise is less and what was blurred is not, and the
 * smaller part is kept. */
#include "kernels/filter/filter.h"

/* The part kept is that much of variance / (variance + error), which would be best for independent
 * estimates; of smoothed ones more, as fewer are independent. */
#define FAVOR 1.5f
#define SMOOTH_FAVOR 3.0f
/* Along a line of pixels, which tells surfaces without noise beside noisy ones: so much more that
 * chance has no part in it. */
#define LINE_FAVOR 1000.0f
#define LINE_REACH 4
/* Variance of the mean over that of the difference of halves that are about as large. */
#define MEAN_VARIANCE (0.25f * (1.0f + TRC_HALVES_CORRELATION) / (1.0f - TRC_HALVES_CORRELATION))

/* Of a pixel as it is or of smoothed pictures: the plain one's variance, the clean one's error. */
struct estimate {
    float *variance, *error;         /* with halo */
    float *variance_sum, *error_sum; /* over squares of pixels, of the tile */
};

struct work {
    struct estimate own, smooth;
    float *half[3], *columns, *rest; /* half: missed by either, change */
};

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    float **const all[] = {&w->half[0], &w->half[1], &w->half[2], &w->columns, &w->rest};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        *all[i] = trc_plane_carve(&c);
    struct estimate *const estimates[] = {&w->own, &w->smooth};
    for (int i = 0; i < 2; i++) {
        estimates[i]->variance = trc_plane_carve(&c);
        estimates[i]->error = trc_plane_carve(&c);
        estimates[i]->variance_sum = trc_plane_carve(&c);
        estimates[i]->error_sum = trc_plane_carve(&c);
    }
    return c.used;
}

size_t trc_blend_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* The error of smoothed pictures, and their variance, as regress.c has those of pixels. */
static void estimate_smooth(const struct trc_denoise_job *job, struct work *w) {
    const struct trc_denoise *d = job->denoise;
    const float *const planes[3] = {d->missed[0], d->missed[1], d->change};
    for (int k = 0; k < 3; k++) {
        trc_plane_load(job, planes[k], w->half[k]);
        trc_plane_smooth(w->half[k], w->rest, TRC_HALO - 1);
        trc_plane_smooth(w->rest, w->half[k], TRC_HALO - 2);
    }
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        const vfloat first = vf_load(w->half[0] + i), second = vf_load(w->half[1] + i);
        const vfloat change = vf_load(w->half[2] + i), change2 = change * change;
        const vfloat noise2 = change2 * vf_set(1.0f / (1.0f - TRC_HALVES_CORRELATION));
        const vfloat missed2 = first * first + second * second;
        vf_store(w->smooth.variance + i, change2 * vf_set(MEAN_VARIANCE));
        vf_store(w->smooth.error + i, vf_set(0.5f) * (missed2 - noise2));
    }
}

static void estimate(const struct trc_denoise_job *job, struct work *w) {
    trc_plane_load(job, job->denoise->variance, w->own.variance);
    trc_plane_load(job, job->denoise->error, w->own.error);
    estimate_smooth(job, w);
    const struct estimate *const estimates[] = {&w->own, &w->smooth};
    for (int i = 0; i < 2; i++) {
        trc_plane_sum(estimates[i]->variance, w->columns, estimates[i]->variance_sum);
        trc_plane_sum(estimates[i]->error, w->columns, estimates[i]->error_sum);
    }
}

static float part_of(float variance, float error, float favor) {
    const float sum = variance + (error > 0.0f ? error : 0.0f);
    const float part = variance > 0.0f ? favor * variance / sum : 0.0f;
    return part < 1.0f ? part : 1.0f;
}

/* By the pixels of a line through one that are step apart in a plane. */
static float line_part(const struct estimate *e, int at, int step) {
    float variance = 0.0f, error = 0.0f;
    for (int i = -LINE_REACH; i <= LINE_REACH; i++) {
        variance += e->variance[at + i * step];
        error += e->error[at + i * step];
    }
    return error > 0.0f ? part_of(variance, error, LINE_FAVOR) : 1.0f;
}

static bool has_halves(const struct trc_film *film, size_t pixel) {
    const uint32_t first = film->halves[pixel].count;
    return first && first < film->sample_counts[pixel];
}

static float part_at(const struct work *w, int at, bool halves) {
    float part = part_of(w->own.variance_sum[at], w->own.error_sum[at], FAVOR);
    if (!halves)
        return part;
    const float others[] = {
        part_of(w->smooth.variance_sum[at], w->smooth.error_sum[at], SMOOTH_FAVOR),
        line_part(&w->own, at, 1), line_part(&w->own, at, TRC_PLANE_STRIDE)};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        part = others[i] < part ? others[i] : part;
    return part;
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
            const size_t pixel = (size_t)(job->y + y) * film->width + job->x + x;
            const int at = trc_plane_at((int)x, (int)y);
            const float part = part_at(w, at, has_halves(film, pixel));
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

void trc_limit_covers(const struct trc_denoise_job *job) {
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
    estimate(job, &w);
    float *parts = w.columns;
    find_parts(job, &w, parts);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        if (film->clean.sums[pass])
            blend(job, parts, film->sums[pass], film->clean.sums[pass],
                  trc_pass_info_of(pass)->sums);
    if (film->clean.caught)
        blend(job, parts, (const double *)film->caught, (double *)film->clean.caught,
              TRC_CAUGHT_CHANNELS);
    trc_limit_covers(job);
}
