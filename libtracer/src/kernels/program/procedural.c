/* The list of procedural textures. */
#include "kernels/program/procedural.h"

#include "model/program.h"

void trc_program_procedural(uint32_t op, uint32_t mode, const vfloat *in, vfloat *out) {
    switch (op) {
    case TRC_OP_NOISE:
        trc_program_noise(mode, in, out);
        break;
    case TRC_OP_VORONOI:
        trc_program_voronoi(mode, in, out);
        break;
    case TRC_OP_WAVE:
        trc_program_wave(mode, in, out);
        break;
    case TRC_OP_MAGIC:
        trc_program_magic(mode, in, out);
        break;
    case TRC_OP_BRICK:
        trc_program_brick(mode, in, out);
        break;
#define TRC_TEXTURE(NAME, number, label, inputs, outputs, modes) \
    case TRC_OP_##NAME:                                          \
        TRC_TEXTURE_OF(NAME).run(mode, in, out);                 \
        break;
#include "tracer/nodes.def"
    default:
        break;
    }
}
