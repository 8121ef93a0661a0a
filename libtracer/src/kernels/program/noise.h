/* Sums of octaves of gradient noise. */
#ifndef TRACER_KERNELS_PROGRAM_NOISE_H
#define TRACER_KERNELS_PROGRAM_NOISE_H

#include "kernels/simd/simd.h"

/* octaves: whole ones, and a last one that counts by the rest. */
struct fractal {
    uint32_t type; /* TRC_FRACTAL_* */
    int dims;
    vfloat octaves, roughness, lacunarity, offset, gain;
};

/* At a place of f->dims coordinates. (kernels/program/noise.c) */
vfloat trc_fractal_noise(const struct fractal *f, const vfloat *place);

#endif
