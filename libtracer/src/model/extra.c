#include "model/extra.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"

/* Light at which noise stops counting relative to it: a hundredth of white in three channels. */
#define LIGHT_FLOOR 0.03f
/* Relative noise below is seen by nobody, and gets no samples. */
#define LEAST_NOISE 0x1p-10f
/* Of noise over the root of rays: 2^LOWEST_OCTAVE and what is below, and none is 2^HIGHEST_OCTAVE.
 */
#define LOWEST_OCTAVE (-12)
#define HIGHEST_OCTAVE 3
/* Noise is sorted into bins, 16 of an octave: the exponent and the first four bits of a float. */
#define OCTAVE_BINS 16
#define BIN_SHIFT 19
#define FLOAT_BIAS 127
#define BIN_COUNT ((HIGHEST_OCTAVE - LOWEST_OCTAVE) * OCTAVE_BINS + 1) /* 0: what is too little */
_Static_assert(BIN_COUNT <= 256, "bins are kept in bytes");

/* Weights of the pixels around: a Gaussian of one pixel's deviation. */
#define REACH 2
static const float gaussian[REACH + 1] = {0.4026f, 0.2442f, 0.0545f};

trc_status trc_extra_create(const trc_render_desc *desc, struct trc_extra *extra) {
    struct trc_extra made = {
        .width = desc->crop_width,
        .height = desc->crop_height,
        .sample_count = desc->sample_count,
        .share = desc->extra_samples,
        .exposure = desc->film_exposure,
    };
    const size_t count = (size_t)made.width * made.height;
    made.levels = trc_alloc_zeroed(count, sizeof *made.levels);
    made.noise_squares = trc_alloc(count + made.width, sizeof *made.noise_squares);
    made.tile_rays = trc_alloc_zeroed(
        (size_t)trc_film_tiles(made.width) * trc_film_tiles(made.height), TRC_EXTRA_TILE_BYTES);
    if (!made.levels || !made.noise_squares || !made.tile_rays) {
        trc_extra_destroy(&made);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for extra samples");
    }
    *extra = made;
    return TRC_OK;
}

void trc_extra_destroy(struct trc_extra *extra) {
    trc_free(extra->levels);
    trc_free(extra->noise_squares);
    trc_free(extra->tile_rays);
    memset(extra, 0, sizeof *extra);
}

/* ---- noise ---- */

/* The square of how far the means of a pixel's halves lie apart, relative to its light; 0 where it
 * has no two. */
static float noise_square_of(const struct trc_extra *extra, const struct trc_film *film,
                             size_t pixel) {
    const struct trc_half *half = &film->halves[pixel];
    const uint32_t count = film->sample_counts[pixel];
    if (!half->count || half->count >= count)
        return 0.0f;
    const double first = 1.0 / half->count, rest = 1.0 / (count - half->count);
    double square = 0.0, light = 0.0;
    for (int c = 0; c < 4; c++) {
        double sum = film->sums[TRC_PASS_COMBINED][4 * pixel + (size_t)c];
        if (film->caught && c < 3)
            sum += film->caught[pixel].blocked[c];
        const double a = (double)half->light[c];
        const double apart = a * first - (sum - a) * rest;
        /* Of alpha as it is; of light as it is shown. */
        const double shown = c < 3 ? (double)extra->exposure : LIGHT_FLOOR;
        square += apart * apart * shown * shown;
        light += c < 3 ? fabs(sum) / count * shown : 0.0;
    }
    light += (double)LIGHT_FLOOR;
    const float noise = (float)(square / (light * light));
    return noise < INFINITY ? noise : 0.0f;
}

static void measure_noise(struct trc_extra *extra, const struct trc_film *film) {
    const size_t count = (size_t)extra->width * extra->height;
    for (size_t i = 0; i < count; i++)
        extra->noise_squares[i] = noise_square_of(extra, film, i);
}

/* Adds the rows around y, weighted, into columns; returns the sum of weights. */
static float add_rows(const struct trc_extra *extra, uint32_t y, float *columns) {
    float weights = 0.0f;
    memset(columns, 0, extra->width * sizeof *columns);
    for (int64_t k = -REACH; k <= REACH; k++) {
        const int64_t at = (int64_t)y + k;
        if (at < 0 || at >= extra->height)
            continue;
        const float weight = gaussian[k < 0 ? -k : k];
        const float *row = extra->noise_squares + (size_t)at * extra->width;
        for (uint32_t x = 0; x < extra->width; x++)
            columns[x] += weight * row[x];
        weights += weight;
    }
    return weights;
}

/* The weighted root mean square of noise of the pixels around x, without its own square;
 * row_weights: add_rows'. */
static float noise_around(const struct trc_extra *extra, const float *columns, uint32_t x,
                          float row_weights, float own) {
    float sum = 0.0f, weights = 0.0f;
    for (int64_t k = -REACH; k <= REACH; k++) {
        const int64_t at = (int64_t)x + k;
        if (at < 0 || at >= extra->width)
            continue;
        const float weight = gaussian[k < 0 ? -k : k];
        sum += weight * columns[at];
        weights += weight;
    }
    const float self = gaussian[0] * gaussian[0], others = weights * row_weights - self;
    return others > self * 0.01f ? sqrtf(fmaxf(sum - self * own, 0.0f) / others) : 0.0f;
}

/* ---- levels ---- */

/* Rays of one sample of a pixel, in the mean over its tile. */
static float rays_at(const struct trc_extra *extra, uint32_t x, uint32_t y) {
    const uint32_t right = extra->width - x / TRC_TILE_SIZE * TRC_TILE_SIZE;
    const uint32_t up = extra->height - y / TRC_TILE_SIZE * TRC_TILE_SIZE;
    const float pixels = (float)((right < TRC_TILE_SIZE ? right : TRC_TILE_SIZE) *
                                 (up < TRC_TILE_SIZE ? up : TRC_TILE_SIZE));
    const float rays = (float)*trc_extra_tile_rays(extra, x, y);
    return fmaxf(rays / (pixels * (float)extra->sample_count), 1.0f);
}

static uint8_t bin_of(float noise, float rays) {
    if (!(noise >= LEAST_NOISE))
        return 0;
    const float worth = fmaxf(fminf(noise / sqrtf(rays), ldexpf(0.99f, HIGHEST_OCTAVE)),
                              ldexpf(1.0f, LOWEST_OCTAVE));
    uint32_t bits;
    memcpy(&bits, &worth, sizeof bits);
    return (uint8_t)((bits >> BIN_SHIFT) - (FLOAT_BIAS + LOWEST_OCTAVE) * OCTAVE_BINS + 1u);
}

/* first: the bin from which pixels have level 1. */
static uint32_t level_of(uint32_t bin, uint32_t first) {
    if (bin < first)
        return 0;
    const uint32_t level = 1 + (bin - first) / OCTAVE_BINS;
    return level < TRC_EXTRA_LEVELS ? level : TRC_EXTRA_LEVELS;
}

/* How many times its samples a pixel gets besides. */
static uint32_t times_of(uint32_t level) { return (1u << level) - 1u; }

/* Rays of the extra samples, over the samples of a pixel. */
static double cost_of(const double *bin_rays, uint32_t first) {
    double cost = 0.0;
    for (uint32_t bin = first; bin < BIN_COUNT; bin++)
        cost += bin_rays[bin] * times_of(level_of(bin, first));
    return cost;
}

/* Sorts the pixels into bins, which are kept as levels, and adds up the rays of a sample of each
 * bin's. */
static void sort_pixels(struct trc_extra *extra, double *bin_rays) {
    float *columns = extra->noise_squares + (size_t)extra->width * extra->height;
    for (uint32_t y = 0; y < extra->height; y++) {
        const float weights = add_rows(extra, y, columns);
        for (uint32_t x = 0; x < extra->width; x++) {
            const size_t i = (size_t)y * extra->width + x;
            const float noise = noise_around(extra, columns, x, weights, extra->noise_squares[i]);
            const float rays = rays_at(extra, x, y);
            extra->levels[i] = bin_of(noise, rays);
            bin_rays[extra->levels[i]] += (double)rays;
        }
    }
}

uint64_t trc_extra_plan(struct trc_extra *extra, const struct trc_film *film) {
    const size_t pixels = (size_t)extra->width * extra->height;
    double bin_rays[BIN_COUNT] = {0.0}, all_rays = 0.0;
    measure_noise(extra, film);
    sort_pixels(extra, bin_rays);
    for (uint32_t bin = 0; bin < BIN_COUNT; bin++)
        all_rays += bin_rays[bin];
    uint32_t first = BIN_COUNT;
    while (first > 1 && cost_of(bin_rays, first - 1) <= all_rays * (double)extra->share)
        first--;
    uint64_t times = 0;
    for (size_t i = 0; i < pixels; i++) {
        extra->levels[i] = (uint8_t)level_of(extra->levels[i], first);
        times += times_of(extra->levels[i]);
    }
    return times * extra->sample_count;
}

uint32_t trc_extra_pixels(const struct trc_extra *extra, uint32_t x, uint32_t y, uint32_t width,
                          uint32_t height, uint32_t level) {
    uint32_t count = 0;
    for (uint32_t j = y; j < y + height; j++)
        for (uint32_t i = x; i < x + width; i++)
            count += extra->levels[(size_t)j * extra->width + i] >= level;
    return count;
}
