/* The list of procedural textures. */
#include "kernels/program/procedural.h"

#include "kernels/program/noise.h"
#include "kernels/program/pattern.h"
#include "kernels/program/voronoi.h"

void trc_program_procedural(uint32_t op, uint32_t mode, const vfloat *in, vfloat *out) {
    switch (op) {
    case TRC_OP_NOISE:
        op_noise(mode, in, out);
        break;
    case TRC_OP_VORONOI:
        op_voronoi(mode, in, out);
        break;
    case TRC_OP_WAVE:
        out[0] = op_wave(mode, in);
        break;
    case TRC_OP_MAGIC:
        v3_write(out, op_magic(mode, in));
        break;
    case TRC_OP_BRICK:
        op_brick(mode, in, out);
        break;
#define TRC_TEXTURE(NAME, number, label, inputs, outputs, modes) \
    case TRC_OP_##NAME:                                          \
        TRC_TEXTURE_OF(NAME)(mode, in, out);                     \
        break;
#include "tracer/nodes.def"
    default:
        break;
    }
}
