/* Sample sequences: which number in [0, 1) each pixel, sample and dimension gets. */
#ifndef TRACER_KERNELS_TILE_SAMPLER_H
#define TRACER_KERNELS_TILE_SAMPLER_H

#include "kernels/simd/simd.h"

/* Dimensions of one camera sample; the first TRC_JOINT_DIMENSIONS are one joint sequence: camera,
 * first and second hit. Each deeper hit is another such sequence, shuffled against the first. */
#define TRC_JOINT_DIMENSIONS 17
enum trc_dimension {
    TRC_DIM_FILTER_X = 0,
    TRC_DIM_FILTER_Y,
    TRC_DIM_LENS_X,
    TRC_DIM_LENS_Y,
    TRC_DIM_TIME,
    TRC_DIM_BOUNCE =
        5 /* first dimension of the first hit; TRC_DIMS_PER_BOUNCE for each further one */
};
/* Within a bounce. */
enum {
    TRC_DIM_LIGHT_SELECT = 0,
    TRC_DIM_LIGHT_X,
    TRC_DIM_LIGHT_Y,
    TRC_DIM_LOBE,
    TRC_DIM_BSDF_X,
    TRC_DIM_BSDF_Y,
    TRC_DIMS_PER_BOUNCE
};

/* First dimension of the numbers that programs ask for at the first hit, and how many of each;
 * those of further hits follow. Beyond any that paths take. */
#define TRC_DIM_PROBE (TRC_DIM_BOUNCE + 4096 * TRC_DIMS_PER_BOUNCE)

struct trc_sampler {
    uint32_t kind; /* TRC_SAMPLER_* */
    uint32_t seed;
    uint32_t sample_count; /* planned per pixel */
    const uint32_t *table; /* Sobol numbers: trc_sobol_table_create, model/sobol.h */
};

/* u[0..n) in [0, 1), dimensions dimension .. dimension + n - 1, for each lane: pixel = number of
 * the pixel (x | y << 16), index = sample number, below 2^30; lanes may differ in both. count > 1:
 * light sample l of count, stratified jointly over the pixel's samples (index * count + l in the
 * sequence). One number costs about 3 instructions per lane at 16 lanes; the table is read with one
 * load where lanes hold the same or consecutive points of the joint dimensions. */
void trc_samples(const struct trc_sampler *sampler, vuint pixel, vuint index, uint32_t dimension,
                 uint32_t n, uint32_t l, uint32_t count, vfloat *u);

/* One of them, with count 1. */
vfloat trc_sample(const struct trc_sampler *sampler, vuint pixel, vuint index, uint32_t dimension);

#endif
