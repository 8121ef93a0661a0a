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
 * weights found in one half are tried on the other. At last the film is filtered once more, by what
 * is left of the plain one (J. W. Tukey, "Exploratory Data Analysis", 1977: twicing).
 *
 * Steps, each over all tiles before the next begins; within one, tiles are independent. */
#ifndef TRACER_MODEL_DENOISE_H
#define TRACER_MODEL_DENOISE_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "model/film.h"

/* The last two are taken again and again, each time for some of the film's channels. */
enum trc_denoise_phase {
    TRC_DENOISE_FEATURES, /* film to features: noise of edges in motion or out of focus goes */
    TRC_DENOISE_REGRESS,  /* film and features to the clean film, and its estimated error */
    TRC_DENOISE_BLEND,    /* estimates to the part of the clean film that is kept */
    TRC_DENOISE_RESIDUAL, /* plain less clean film, to planes */
    TRC_DENOISE_TWICE     /* what of that is no noise is given back */
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
    /* What these are of: by how much each half's prediction misses the half, and by how much the
     * first half exceeds the other, relative to the light around. 0 where there is but one half. */
    float *missed[2], *change;
    float *memory;          /* all of the above, plane by plane; after blending, residual */
    uint32_t channel_count; /* of light that is reconstructed, Combined's at first */
    uint32_t step_count;
};

/* Planes of the above, and their bytes for each pixel. */
#define TRC_DENOISE_PLANES (TRC_FEATURE_COUNT + 5)
#define TRC_DENOISE_PIXEL_BYTES (TRC_DENOISE_PLANES * sizeof(float))

/* Planes when they hold residual: the clean light, the part that is given back, then channels. */
enum { TRC_RESIDUAL_LIGHT, TRC_RESIDUAL_PART, TRC_RESIDUAL_PLANES };
#define TRC_RESIDUAL_CHANNELS (TRC_DENOISE_PLANES - TRC_RESIDUAL_PLANES)

/* A pixel of the frame beyond whose edges it is mirrored; far outside, its edge. */
static inline uint32_t trc_mirror(int64_t x, uint32_t size) {
    if (x < 0)
        x = -x - 1;
    if (x >= size)
        x = 2 * (int64_t)size - 1 - x;
    return x < 0 ? 0 : x >= size ? size - 1 : (uint32_t)x;
}

/* A tile in a step, for one thread. */
struct trc_denoise_job {
    const struct trc_denoise *denoise;
    uint32_t step;                /* a phase, or once more the last two */
    uint32_t x, y, width, height; /* of the crop, pixels; at most TRC_TILE_SIZE */
    void *memory; /* denoise_memory_bytes(...) bytes, 64-byte aligned, one thread's */
};

/* ---- quick reconstruction, of a picture that is still gathering samples ----
 *
 * Wavelets with holes whose weights follow variance and features (H. Dammertz, D. Sewtz, J. Hanika,
 * H. Lensch, "Edge-Avoiding A-Trous Wavelet Transform for fast Global Illumination Filtering", HPG
 * 2010; C. Schied and others, "Spatiotemporal Variance-Guided Filtering", HPG 2017), of light over
 * albedo. Departures: nothing of former pictures; a wavelet takes four pixels instead of 24 or
 * eight; noise comes from two halves of the samples, the wider wavelets fade as samples gather, and
 * the part of the plain pixel that stays follows the estimated error. */

/* Most pixels of a row of a strip, and those around the strip: of three wavelets, and smoothed
 * estimates. */
#define TRC_PREVIEW_MAX_WIDTH 256
#define TRC_PREVIEW_HALO 10
/* Planes of floats, rows of so many; the strip begins at TRC_PREVIEW_LEFT. Each row has the place
 * of the one so many before it. What is added to a plane keeps rows of planes in sets of their own
 * in a cache. */
#define TRC_PREVIEW_LEFT 16
#define TRC_PREVIEW_STRIDE (TRC_PREVIEW_MAX_WIDTH + 2 * TRC_PREVIEW_LEFT)
#define TRC_PREVIEW_ROWS 16
#define TRC_PREVIEW_FLOATS (TRC_PREVIEW_ROWS * TRC_PREVIEW_STRIDE + 48)

/* What is in the planes: sums of a pixel's samples, from which the filter makes means first; the
 * colour becomes what is shown, TRC_PREVIEW_HALO rows later. */
enum trc_preview_plane {
    TRC_PREVIEW_COLOR = 0,  /* and alpha */
    TRC_PREVIEW_ALBEDO = 4, /* three */
    TRC_PREVIEW_NORMAL = 7, /* three */
    TRC_PREVIEW_DEPTH = 10,
    TRC_PREVIEW_HALF,       /* the three colours of the first half, added */
    TRC_PREVIEW_HALF_COUNT, /* samples of the first half; 0: there are no halves */
    TRC_PREVIEW_COUNT,      /* samples of all */
    TRC_PREVIEW_INPUTS,
    TRC_PREVIEW_PLANES = TRC_PREVIEW_INPUTS + 20 /* the others are the filter's own */
};

/* Where the strip's pixel x, y is in a plane; y is -2 * TRC_PREVIEW_HALO at least. */
static inline int trc_preview_at(int x, int y) {
    return (y + 2 * TRC_PREVIEW_ROWS) % TRC_PREVIEW_ROWS * TRC_PREVIEW_STRIDE + x +
           TRC_PREVIEW_LEFT;
}

#endif
