/* The filter of a finished film, tile by tile. See model/denoise.h for what it does. */
#ifndef TRACER_KERNELS_FILTER_FILTER_H
#define TRACER_KERNELS_FILTER_FILTER_H

#include "kernels/filter/plane.h"

/* What the light of a pixel is compared by: square roots of its red, green and blue, and alpha. */
#define TRC_GUIDE_CHANNELS 4

/* How halves of a pixel's samples depend on each other, their correlation: points of a sequence
 * fill the gaps of those before. Less would blur textures at few samples, more keeps noise. */
#define TRC_HALVES_CORRELATION -0.3f

/* Planes of a tile for regression. Variances are those of the mean of all samples, smoothed. */
struct trc_guide {
    float *half[2][TRC_GUIDE_CHANNELS]; /* of either half of the samples */
    float *more[2];                     /* how many times as noisy that half is */
    float *light[2];                    /* mean of its red, green and blue */
    float *variance[TRC_GUIDE_CHANNELS];
    float *noise;     /* variance of the light, above 0 */
    float *own_noise; /* the same, or less where the pixel's own halves agree */
    float *rest;      /* scratch */
    float *inside;    /* 1 where there are samples, 0 beyond the frame */
    float *features[TRC_FEATURE_COUNT];
    bool has_alpha; /* alpha differs somewhere */
};

/* Fills the planes from the film and the features. (kernels/filter/guide.c) */
void trc_guide_load(const struct trc_denoise_job *job, struct trc_guide *guide);

/* A channel of the film's light: sums of pixels, every stride doubles. */
struct trc_light_channel {
    const double *sums;
    double *clean;
    uint32_t stride;
};

/* The channel of that number, below denoise->channel_count: passes in their order, then what shadow
 * catchers got. (kernels/filter/denoise.c) */
struct trc_light_channel trc_light_channel_at(const struct trc_film *film, uint32_t number);

/* Values of a plane of the film, by pixel, to a tile's; beyond the frame is its mirror image.
 * (kernels/filter/denoise.c) */
void trc_plane_load(const struct trc_denoise_job *job, const float *values, float *plane);

/* Cuts what no reconstruction may be: alpha, and light of shadow catchers. After blending, so that
 * residuals are those of what may be, and at last. (kernels/filter/blend.c) */
void trc_limit_covers(const struct trc_denoise_job *job);

/* The phases. (kernels/filter/features.c, regress.c, blend.c, twice.c) */
size_t trc_features_bytes(void);
void trc_features_filter(const struct trc_denoise_job *job);
size_t trc_regress_bytes(void);
void trc_regress(const struct trc_denoise_job *job);
size_t trc_blend_bytes(void);
void trc_blend(const struct trc_denoise_job *job);
void trc_residual(const struct trc_denoise_job *job, uint32_t first);
size_t trc_twice_bytes(void);
void trc_twice(const struct trc_denoise_job *job, uint32_t first); /* the number of a channel */

size_t trc_denoise_memory_bytes(void);
void trc_denoise_tile(const struct trc_denoise_job *job);

/* The quick filter. (kernels/filter/preview.c) */
void trc_preview_load(const struct trc_film *film, size_t pixel, int count, float *planes);
void trc_preview_filter(float *memory, int width, int y, float exposure);
void trc_preview_store(const float *planes, int count, float *rgba);

#endif
