/* Reconstruction: what the filter of a finished film reads and writes (kernels/filter/).
 *
 * Each pixel of the light becomes a linear combination of those around it, the same one for every
 * pass, so that passes still sum to Combined. Its weights are those of a first-order regression on
 * features (B. Bitterli, F. Rousselle, B. Moon, J. Iglesias-Guitian, D. Adler, K. Mitchell, W.
 * Jarosz, J. Novak, "Nonlinearly Weighted First-order Regression for Denoising Monte Carlo
 * Renderings", EGSR 2016). Departures: features are albedo, normal and the logarithm of depth and
 * the place in the picture; a window has holes, and both halves share one matrix of products;
 * colours are compared as square roots, whose noise depends less on brightness; a pixel that is
 * noisier than the one that it lends to counts less by the ratio of their variances, its own halves
 * counting most, so that single bright samples stay where they are; the prediction is taken at the
 * pixel alone, without collaboration, which costs half and measured as good; and instead of a
 * choice among bandwidths the estimated error decides how much of the plain pixel stays.
 *
 * Two halves of each pixel's samples, a sum of the first one kept aside, tell noise from structure:
 * weights found in one half are tried on the other.
 *
 * Phases, each over all tiles before the next begins; within one, tiles are independent. */
#ifndef TRACER_MODEL_DENOISE_H
#define TRACER_MODEL_DENOISE_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "model/film.h"

enum trc_denoise_phase {
    TRC_DENOISE_FEATURES, /* film to features: noise of edges in motion or out of focus goes */
    TRC_DENOISE_REGRESS,  /* film and features to the clean film, and its estimated error */
    TRC_DENOISE_BLEND,    /* estimates to the part of the clean film that is kept */
    TRC_DENOISE_PHASE_COUNT
};

/* Albedo, normal, depth: of the passes that a render with reconstruction has. */
#define TRC_FEATURE_COUNT 7
#define TRC_DENOISE_PASSES                                                                 \
    (UINT64_C(1) << TRC_PASS_DENOISING_ALBEDO | UINT64_C(1) << TRC_PASS_DENOISING_NORMAL | \
     UINT64_C(1) << TRC_PASS_DENOISING_DEPTH)

struct trc_denoise {
    struct trc_film *film;              /* with halves and a clean film */
    float *features[TRC_FEATURE_COUNT]; /* width * height each */
    float *variance; /* of the plain pixel, relative to the light around it squared */
    float *error;    /* of the clean pixel, in the same way, with the noise of an estimate */
};

/* Bytes of the above for each pixel. */
#define TRC_DENOISE_PIXEL_BYTES ((TRC_FEATURE_COUNT + 2) * sizeof(float))

/* A tile in a phase, for one thread. */
struct trc_denoise_job {
    const struct trc_denoise *denoise;
    uint32_t phase;
    uint32_t x, y, width, height; /* of the crop, pixels; at most TRC_TILE_SIZE */
    void *memory; /* denoise_memory_bytes(...) bytes, 64-byte aligned, one thread's */
};

#endif
