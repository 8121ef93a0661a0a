#include "model/adaptive.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/film.h"

/* Cycles' numbers and automatic choice, so that settings mean about the same in both engines. */
#define THRESHOLD_SCALE 5.0f
#define MEAN_EPSILON 1e-4f /* keeps the relative error of black finite */
#define MIN_SAMPLES_FLOOR 4

uint32_t trc_adaptive_min_samples(float noise_threshold, uint32_t min_samples) {
    float wanted = (float)min_samples;
    if (!min_samples) /* 0.1: 32, 0.01: 64, 0.001: 128, to the nearest power of two */
        wanted = fminf(16.0f / powf(noise_threshold, 0.3f) * 0.70710678f, 0x1p20f);
    uint32_t power = MIN_SAMPLES_FLOOR;
    while ((float)power < wanted)
        power *= 2;
    return power;
}

trc_status trc_adaptive_create(const trc_render_desc *desc, struct trc_adaptive *adaptive) {
    struct trc_adaptive made = {
        .width = desc->crop_width,
        .height = desc->crop_height,
        .min_samples = desc->min_samples,
    };
    const float error = THRESHOLD_SCALE * desc->noise_threshold;
    made.error2 = error * error;
    const size_t count = (size_t)made.width * made.height;
    made.pixels = trc_alloc_zeroed(count, sizeof *made.pixels);
    if (!made.pixels)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for adaptive sampling");
    for (size_t i = 0; i < count; i++)
        made.pixels[i].reasons = TRC_PIXEL_COUNTS | TRC_PIXEL_CHAIN;
    *adaptive = made;
    return TRC_OK;
}

void trc_adaptive_destroy(struct trc_adaptive *adaptive) {
    trc_free(adaptive->pixels);
    memset(adaptive, 0, sizeof *adaptive);
}

uint32_t trc_adaptive_next_stage(const struct trc_adaptive *adaptive, uint32_t samples) {
    /* The first decision already compares two halves. */
    uint32_t stage = adaptive->min_samples / 2;
    while (stage <= samples)
        stage *= 2;
    return stage;
}

/* A tile, and a place in it as coordinates of the tile. */
struct tile {
    struct trc_adaptive_pixel *first;
    uint32_t width, height, stride;
};

static struct tile tile_of(const struct trc_adaptive *a, uint32_t x, uint32_t y, uint32_t width,
                           uint32_t height) {
    return (struct tile){a->pixels + (size_t)y * a->width + x, width, height, a->width};
}

/* NULL beyond the tile; so are coordinates that wrapped below 0. */
static struct trc_adaptive_pixel *pixel_at(const struct tile *t, uint32_t x, uint32_t y) {
    return x < t->width && y < t->height ? t->first + (size_t)y * t->stride + x : NULL;
}

/* Estimates the variance of a sample while the pixel is in its chain, and notes the mean. */
static void look(struct trc_adaptive_pixel *p, uint32_t samples) {
    float change = 0.0f, total = 0.0f;
    for (int c = 0; c < 3; c++) {
        const float mean = (float)(p->sum[c] / samples);
        change += fabsf(mean - p->mean[c]);
        total += mean;
        p->mean[c] = mean;
    }
    const float error = change / (MEAN_EPSILON + sqrtf(fabsf(total)));
    p->variance = error * error * (float)samples;
}

static bool has_converged(const struct tile *t, uint32_t x, uint32_t y, float limit) {
    const struct trc_adaptive_pixel *const all[] = {
        pixel_at(t, x, y), pixel_at(t, x - 1, y - 1), pixel_at(t, x + 1, y - 1),
        pixel_at(t, x - 1, y + 1), pixel_at(t, x + 1, y + 1)};
    float sum = 0.0f, count = 0.0f;
    for (int i = 0; i < 5; i++) {
        if (all[i]) {
            sum += all[i]->variance;
            count += 1.0f;
        }
    }
    return sum <= limit * count; /* a sum that is not finite goes on */
}

static bool in_chain(const struct trc_adaptive_pixel *p) {
    return p && (p->reasons & TRC_PIXEL_CHAIN);
}

/* Whether a direct neighbour still calls for samples. */
static bool is_called(const struct tile *t, uint32_t x, uint32_t y) {
    const struct trc_adaptive_pixel *const all[] = {pixel_at(t, x - 1, y), pixel_at(t, x + 1, y),
                                                    pixel_at(t, x, y - 1), pixel_at(t, x, y + 1)};
    bool is_alone = true;
    for (int i = 0; i < 4; i++) {
        if (in_chain(all[i]))
            return true;
        is_alone = is_alone && !all[i];
    }
    return is_alone;
}

void trc_adaptive_update(struct trc_adaptive *adaptive, uint32_t x, uint32_t y, uint32_t width,
                         uint32_t height, uint32_t samples) {
    const struct tile t = tile_of(adaptive, x, y, width, height);
    const float limit = adaptive->error2 * (float)samples;
    for (uint32_t j = 0; j < height; j++)
        for (uint32_t i = 0; i < width; i++)
            if (in_chain(pixel_at(&t, i, j)))
                look(pixel_at(&t, i, j), samples);
    if (samples < adaptive->min_samples)
        return;
    /* Chains end by the variances alone, so the order of pixels has no influence. */
    for (uint32_t j = 0; j < height; j++)
        for (uint32_t i = 0; i < width; i++) {
            struct trc_adaptive_pixel *p = pixel_at(&t, i, j);
            if (in_chain(p) && has_converged(&t, i, j, limit))
                p->reasons &= ~(uint32_t)TRC_PIXEL_CHAIN;
        }
    for (uint32_t j = 0; j < height; j++)
        for (uint32_t i = 0; i < width; i++)
            if (!is_called(&t, i, j))
                pixel_at(&t, i, j)->reasons &= ~(uint32_t)TRC_PIXEL_COUNTS;
}

bool trc_adaptive_tile_runs(const struct trc_adaptive *adaptive, uint32_t x, uint32_t y,
                            uint32_t width, uint32_t height) {
    const struct tile t = tile_of(adaptive, x, y, width, height);
    for (uint32_t j = 0; j < height; j++)
        for (uint32_t i = 0; i < width; i++)
            if (pixel_at(&t, i, j)->reasons)
                return true;
    return false;
}
