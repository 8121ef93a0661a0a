/* The White Noise texture: a hash of the place, as Cycles has it. */
#include "kernels/program/hash.h"
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

static void white_noise(uint32_t mode, const vfloat *in, vfloat *out) {
    const int dims = (int)(mode & TRC_DIMENSIONS_MASK) + 1;
    vfloat p[TRC_MAX_DIMENSIONS];
    place_of(dims, in + TRC_OP_AT(WHITE_NOISE, vector), in[TRC_OP_AT(WHITE_NOISE, w)], p);
    const vvec3 color = hash_color(dims, p);
    out[TRC_OP_OUT_AT(WHITE_NOISE, value)] = color.x;
    v3_write(out + TRC_OP_OUT_AT(WHITE_NOISE, color), color);
}

const struct trc_texture TRC_TEXTURE_OF(WHITE_NOISE) = {.run = white_noise};
