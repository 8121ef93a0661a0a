/* Procedural textures: apart from other operations, so that programs without them stay small and
 * quick. */
#ifndef TRACER_KERNELS_PROGRAM_PROCEDURAL_H
#define TRACER_KERNELS_PROGRAM_PROCEDURAL_H

#include "kernels/simd/simd.h"

/* Runs the operation of a procedural texture; inputs and outputs do not overlap. */
void trc_program_procedural(uint32_t op, uint32_t mode, const vfloat *in, vfloat *out);

/* The operations that stand for a part of their textures' nodes. (kernels/program/noise.c,
 * voronoi.c, pattern.c) */
void trc_program_noise(uint32_t mode, const vfloat *in, vfloat *out);
void trc_program_voronoi(uint32_t mode, const vfloat *in, vfloat *out);
void trc_program_wave(uint32_t mode, const vfloat *in, vfloat *out);
void trc_program_magic(uint32_t mode, const vfloat *in, vfloat *out); /* mode: number of folds */
void trc_program_brick(uint32_t mode, const vfloat *in, vfloat *out);

/* A TRC_TEXTURE of tracer/nodes.def: reads the floats of its inputs, writes those of its outputs.
 */
struct trc_texture {
    void (*run)(uint32_t mode, const vfloat *in, vfloat *out);
};

/* Where that of a node is defined, and where it is used. */
#define TRC_TEXTURE_OF(NODE) TRC_KERNEL(trc_texture_##NODE)
#define TRC_TEXTURE(NAME, number, label, inputs, outputs, modes) \
    extern const struct trc_texture TRC_TEXTURE_OF(NAME);
#include "tracer/nodes.def"

#endif
