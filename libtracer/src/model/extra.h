/* Extra samples: a share of a picture's samples that is spent where noise remains, once every pixel
 * has those that it was asked for.
 *
 * Most of a picture's error is on few pixels: edges in motion, small highlights, what is seen
 * through glass. Where a sample has the deviation s and costs c rays, n samples leave an error of
 * s^2 / n; the error of all pixels is least if their counts go with s / sqrt(c) (J. Neyman, "On the
 * Two Different Aspects of the Representative Method", 1934). A pixel gets 2^k times its samples
 * where that is at least 2^(k-1) times a threshold, the lowest that keeps to the share of rays.
 * Counts are powers of two times the first ones, so that what is whole in a Sobol sequence stays
 * so.
 *
 * The deviation is taken from how far the means of two halves of samples lie apart, relative to the
 * light, by the root mean square of the pixels around, and the rays are those of its tile.
 * Unbiased: a pixel's count depends on the deviations of its neighbours, never on its own
 * (model/adaptive.h says why), given that pixels are sampled independently; of its tile's rays its
 * own are a thousandth. */
#ifndef TRACER_MODEL_EXTRA_H
#define TRACER_MODEL_EXTRA_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "model/film.h"
#include "tracer/render.h"

/* A pixel gets at most 2^TRC_EXTRA_LEVELS times its samples. */
#define TRC_EXTRA_LEVELS 3
/* Fewest samples of a pixel whose halves say something. */
#define TRC_EXTRA_MIN_SAMPLES 4

/* Bytes of a pixel, and of a tile. */
#define TRC_EXTRA_PIXEL_BYTES (sizeof(uint8_t) + sizeof(float))
#define TRC_EXTRA_TILE_BYTES sizeof(uint64_t)

struct trc_extra {
    uint32_t width, height; /* of the film */
    uint32_t sample_count;  /* of every pixel, before extra ones */
    float share;            /* of all rays, at most */
    float exposure;         /* trc_render_desc.film_exposure */
    uint8_t *levels;        /* width * height: a pixel gets 2^level times its samples; NULL: off */
    float *noise_squares;   /* width * height, and a row of sums of columns */
    uint64_t *tile_rays;    /* of the samples before, by tile; each is its tile's thread's */
};

/* The most samples that a pixel may get; desc is resolved. */
static inline uint32_t trc_extra_most_samples(const trc_render_desc *desc) {
    return desc->extra_samples > 0.0f ? desc->sample_count << TRC_EXTRA_LEVELS : desc->sample_count;
}

/* Takes the memory; desc is resolved, with extra samples. OUT_OF_MEMORY. */
trc_status trc_extra_create(const trc_render_desc *desc, struct trc_extra *extra);
void trc_extra_destroy(struct trc_extra *extra);

/* To be called once every pixel of the film has its samples and tile_rays are counted: finds the
 * levels. The film has halves.
 * Returns how many extra samples all pixels get together. */
uint64_t trc_extra_plan(struct trc_extra *extra, const struct trc_film *film);

/* The rays of the tile that has the pixel. */
static inline uint64_t *trc_extra_tile_rays(const struct trc_extra *extra, uint32_t x, uint32_t y) {
    const size_t row = y / TRC_TILE_SIZE;
    return &extra->tile_rays[row * trc_film_tiles(extra->width) + x / TRC_TILE_SIZE];
}

/* How many pixels of a tile have that level or a higher one. */
uint32_t trc_extra_pixels(const struct trc_extra *extra, uint32_t x, uint32_t y, uint32_t width,
                          uint32_t height, uint32_t level);

#endif
