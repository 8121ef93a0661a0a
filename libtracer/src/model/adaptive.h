/* Adaptive sampling: which pixels of a film still get samples.
 *
 * Every pixel gets min_samples (a power of two). There, and at every doubling, the error of a pixel
 * is estimated from what the second half of its samples changed, |mean of all - mean of the first
 * half| summed over the channels, over the root of the mean (H. Dammertz, J. Hanika, A. Keller, H.
 * Lensch, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination", 2010;
 * the threshold is scaled as in Cycles). Counts are powers of two, so that prefixes of a Sobol
 * sequence are whole nets.
 *
 * Unbiased. A pixel that decided for itself would stop just when its mean happens to lie where
 * little noise is seen (dark: a rare highlight has not been met yet), and the picture would darken.
 * So pixels decide for their neighbours, as on a chessboard. The chain of a colour is a function of
 * the samples of that colour alone: a pixel is in its chain until the mean square error over itself
 * and its four diagonal neighbours falls below the threshold. A pixel's own samples count towards
 * the film as long as one of its four direct neighbours, which have the other colour, is in its
 * chain. How many samples a mean has is therefore independent of their values, given that pixels
 * are sampled independently; they are, but for the interleaved tile and blue noise, which share
 * sequences among pixels. A pixel whose chain outlasts its count is sampled on for the chain alone:
 * those samples are left out of the picture.
 *
 * Extra samples (model/extra.h) are the other way about: a share of rays is given, not an error.
 *
 * Neighbours are looked for within the tile: no tile waits for another, and nothing depends on the
 * number of threads. A pixel without a direct neighbour gets all samples. */
#ifndef TRACER_MODEL_ADAPTIVE_H
#define TRACER_MODEL_ADAPTIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "tracer/render.h"

/* Why a pixel is sampled: 0 is "no more". */
enum { TRC_PIXEL_COUNTS = 1, TRC_PIXEL_CHAIN = 2 };

struct trc_adaptive_pixel {
    double sum[3];    /* of the radiance of all its samples, those left out of the film too */
    float mean[3];    /* of the former stage */
    float variance;   /* of one sample, relative, as its chain last saw it */
    uint32_t reasons; /* TRC_PIXEL_* */
};

struct trc_adaptive {
    uint32_t width, height;            /* of the film */
    uint32_t min_samples;              /* power of two, at least 2 */
    float error2;                      /* square of the relative error to reach */
    struct trc_adaptive_pixel *pixels; /* width * height; NULL: off */
};

/* min_samples of a descriptor: rounded up to a power of two, chosen by the threshold where 0. */
uint32_t trc_adaptive_min_samples(float noise_threshold, uint32_t min_samples);

/* Takes the memory; desc is resolved, with a noise threshold. OUT_OF_MEMORY. */
trc_status trc_adaptive_create(const trc_render_desc *desc, struct trc_adaptive *adaptive);
void trc_adaptive_destroy(struct trc_adaptive *adaptive);

/* The next count of samples above `samples` that trc_adaptive_update wants to see. */
uint32_t trc_adaptive_next_stage(const struct trc_adaptive *adaptive, uint32_t samples);

/* To be called at each stage, when every pixel of the tile that has a reason has got that many
 * samples: the decisions. */
void trc_adaptive_update(struct trc_adaptive *adaptive, uint32_t x, uint32_t y, uint32_t width,
                         uint32_t height, uint32_t samples);

/* Whether some pixel of the tile has a reason left. */
bool trc_adaptive_tile_runs(const struct trc_adaptive *adaptive, uint32_t x, uint32_t y,
                            uint32_t width, uint32_t height);

#endif
