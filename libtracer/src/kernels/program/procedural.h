/* Procedural textures: apart from other operations, so that programs without them stay small and
 * quick. */
#ifndef TRACER_KERNELS_PROGRAM_PROCEDURAL_H
#define TRACER_KERNELS_PROGRAM_PROCEDURAL_H

#include "kernels/simd/simd.h"

/* Runs one of TRC_OP_NOISE to TRC_OP_BRICK; inputs and outputs do not overlap. */
void trc_program_procedural(uint32_t op, uint32_t mode, const vfloat *in, vfloat *out);

#endif
