/* Procedural textures to operations. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

static trc_status op(struct trc_build *b, uint32_t code, uint32_t mode,
                     const struct trc_operand *in, struct trc_operand *out) {
    return trc_build_op(b, code, mode, TRC_NO_RESOURCE, in, out);
}

/* ---- parts ---- */

/* vector * scale or, with TRC_VECTOR_DIVIDE, vector / scale where that is not 0. */
static trc_status scaled(struct trc_build *b, uint32_t mode, const struct trc_operand *vector,
                         struct trc_operand scale, struct trc_operand *out) {
    struct trc_operand in[TRC_OP_AT(VECTOR_MATH, end)];
    for (uint32_t i = 0; i < TRC_OP_AT(VECTOR_MATH, end); i++)
        in[i] = trc_constant(0.0f);
    memcpy(in + TRC_OP_AT(VECTOR_MATH, a), vector, 3 * sizeof *in);
    if (mode == TRC_VECTOR_DIVIDE) {
        for (uint32_t i = 0; i < 3; i++)
            in[TRC_OP_AT(VECTOR_MATH, b) + i] = scale;
    } else {
        in[TRC_OP_AT(VECTOR_MATH, scale)] = scale;
    }
    return op(b, TRC_OP_VECTOR_MATH, mode, in, out);
}

static trc_status calculate(struct trc_build *b, uint32_t mode, struct trc_operand x,
                            struct trc_operand y, struct trc_operand *out) {
    return trc_build_math(b, mode, x, y, trc_constant(0.0f), out);
}

static trc_status clamped(struct trc_build *b, struct trc_operand x, float low, float high,
                          struct trc_operand *out) {
    const struct trc_operand in[TRC_OP_AT(CLAMP, end)] = {x, trc_constant(low), trc_constant(high)};
    return op(b, TRC_OP_CLAMP, TRC_CLAMP_MINMAX, in, out);
}

/* Octaves beyond the first are called detail. */
static trc_status octaves_of(struct trc_build *b, struct trc_operand detail,
                             struct trc_operand *out) {
    TRC_TRY(clamped(b, detail, 0.0f, TRC_MAX_OCTAVES - 1.0f, out));
    return calculate(b, TRC_MATH_ADD, *out, trc_constant(1.0f), out);
}

/* The place in the space of the texture; unused components are 0, so that they cost nothing. */
static trc_status place(struct trc_build *b, uint32_t mode, const struct trc_operand *vector,
                        struct trc_operand w, struct trc_operand scale,
                        struct trc_operand *vector_out, struct trc_operand *w_out) {
    const uint32_t dims = (mode & TRC_DIMENSIONS_MASK) + 1;
    struct trc_operand used[3];
    for (uint32_t i = 0; i < 3; i++)
        used[i] = dims == 1 || i >= dims ? trc_constant(0.0f) : vector[i];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, used, scale, vector_out));
    *w_out = trc_constant(0.0f);
    if (dims == 1 || dims == 4)
        return calculate(b, TRC_MATH_MULTIPLY, w, scale, w_out);
    return TRC_OK;
}

/* first + factor * (second - first) */
static trc_status mixed(struct trc_build *b, struct trc_operand factor,
                        const struct trc_operand *first, const struct trc_operand *second,
                        struct trc_operand *out) {
    struct trc_operand in[TRC_OP_AT(MIX, end)];
    in[TRC_OP_AT(MIX, factor)] = factor;
    memcpy(in + TRC_OP_AT(MIX, a), first, 3 * sizeof *in);
    memcpy(in + TRC_OP_AT(MIX, b), second, 3 * sizeof *in);
    return op(b, TRC_OP_MIX, TRC_BLEND_MIX, in, out);
}

/* ---- textures ---- */

/* Each reads and writes the floats of its node's inputs and outputs. */

static trc_status build_noise(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                              struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(NOISE, end)];
    TRC_TRY(place(b, mode, in + TRC_AT(NOISE, vector), in[TRC_AT(NOISE, w)],
                  in[TRC_AT(NOISE, scale)], to + TRC_OP_AT(NOISE, vector),
                  to + TRC_OP_AT(NOISE, w)));
    TRC_TRY(octaves_of(b, in[TRC_AT(NOISE, detail)], to + TRC_OP_AT(NOISE, octaves)));
    /* Cycles 3.4 has no roughness above 1, later ones have it without normalisation only. */
    const float highest = mode >> TRC_NOISE_TYPE_SHIFT == TRC_FRACTAL_FBM_UNIT ? 1.0f : 1e30f;
    TRC_TRY(
        clamped(b, in[TRC_AT(NOISE, roughness)], 0.0f, highest, to + TRC_OP_AT(NOISE, roughness)));
    to[TRC_OP_AT(NOISE, lacunarity)] = in[TRC_AT(NOISE, lacunarity)];
    to[TRC_OP_AT(NOISE, offset)] = in[TRC_AT(NOISE, offset)];
    to[TRC_OP_AT(NOISE, gain)] = in[TRC_AT(NOISE, gain)];
    to[TRC_OP_AT(NOISE, distortion)] = in[TRC_AT(NOISE, distortion)];
    return op(b, TRC_OP_NOISE, mode, to, out);
}

/* An octave is by lacunarity to the power of -dimension fainter than the one before it. */
static trc_status build_musgrave(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                                 struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(NOISE, end)], all[TRC_OP_OUT_AT(NOISE, end)];
    struct trc_operand dimension, zero = trc_constant(0.0f), minimum = trc_constant(1e-5f);
    struct trc_operand *lacunarity = to + TRC_OP_AT(NOISE, lacunarity);
    TRC_TRY(place(b, mode, in + TRC_AT(MUSGRAVE, vector), in[TRC_AT(MUSGRAVE, w)],
                  in[TRC_AT(MUSGRAVE, scale)], to + TRC_OP_AT(NOISE, vector),
                  to + TRC_OP_AT(NOISE, w)));
    TRC_TRY(clamped(b, in[TRC_AT(MUSGRAVE, detail)], 0.0f, TRC_MAX_OCTAVES - 1.0f,
                    to + TRC_OP_AT(NOISE, octaves)));
    TRC_TRY(calculate(b, TRC_MATH_MAXIMUM, in[TRC_AT(MUSGRAVE, dimension)], minimum, &dimension));
    TRC_TRY(calculate(b, TRC_MATH_SUBTRACT, zero, dimension, &dimension));
    TRC_TRY(calculate(b, TRC_MATH_MAXIMUM, in[TRC_AT(MUSGRAVE, lacunarity)], minimum, lacunarity));
    TRC_TRY(calculate(b, TRC_MATH_POWER, *lacunarity, dimension, to + TRC_OP_AT(NOISE, roughness)));
    to[TRC_OP_AT(NOISE, offset)] = in[TRC_AT(MUSGRAVE, offset)];
    to[TRC_OP_AT(NOISE, gain)] = in[TRC_AT(MUSGRAVE, gain)];
    to[TRC_OP_AT(NOISE, distortion)] = zero;
    TRC_TRY(op(b, TRC_OP_NOISE, mode, to, all));
    *out = all[TRC_OP_OUT_AT(NOISE, value)];
    return TRC_OK;
}

/* Outputs of the operation are those of the node. */
static trc_status build_voronoi(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                                struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(VORONOI, end)];
    struct trc_operand *position = out + TRC_OUT_AT(VORONOI, position);
    struct trc_operand *w = out + TRC_OUT_AT(VORONOI, w);
    const struct trc_operand scale = in[TRC_AT(VORONOI, scale)];
    TRC_TRY(place(b, mode, in + TRC_AT(VORONOI, vector), in[TRC_AT(VORONOI, w)], scale,
                  to + TRC_OP_AT(VORONOI, vector), to + TRC_OP_AT(VORONOI, w)));
    to[TRC_OP_AT(VORONOI, smoothness)] = in[TRC_AT(VORONOI, smoothness)];
    to[TRC_OP_AT(VORONOI, exponent)] = in[TRC_AT(VORONOI, exponent)];
    to[TRC_OP_AT(VORONOI, randomness)] = in[TRC_AT(VORONOI, randomness)];
    to[TRC_OP_AT(VORONOI, detail)] = in[TRC_AT(VORONOI, detail)];
    to[TRC_OP_AT(VORONOI, roughness)] = in[TRC_AT(VORONOI, roughness)];
    to[TRC_OP_AT(VORONOI, lacunarity)] = in[TRC_AT(VORONOI, lacunarity)];
    TRC_TRY(op(b, TRC_OP_VORONOI, mode, to, out));
    TRC_TRY(scaled(b, TRC_VECTOR_DIVIDE, position, scale, position));
    return calculate(b, TRC_MATH_DIVIDE, *w, scale, w);
}

static trc_status build_wave(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                             struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(WAVE, end)];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, in + TRC_AT(WAVE, vector), in[TRC_AT(WAVE, scale)],
                   to + TRC_OP_AT(WAVE, vector)));
    to[TRC_OP_AT(WAVE, distortion)] = in[TRC_AT(WAVE, distortion)];
    to[TRC_OP_AT(WAVE, detail_scale)] = in[TRC_AT(WAVE, detail_scale)];
    TRC_TRY(octaves_of(b, in[TRC_AT(WAVE, detail)], to + TRC_OP_AT(WAVE, octaves)));
    to[TRC_OP_AT(WAVE, roughness)] = in[TRC_AT(WAVE, detail_roughness)];
    to[TRC_OP_AT(WAVE, phase)] = in[TRC_AT(WAVE, phase)];
    return op(b, TRC_OP_WAVE, mode, to, out);
}

static trc_status build_brick(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                              struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(BRICK, end)], found[TRC_OP_OUT_AT(BRICK, end)];
    struct trc_operand brick[3];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, in + TRC_AT(BRICK, vector), in[TRC_AT(BRICK, scale)],
                   to + TRC_OP_AT(BRICK, vector)));
    to[TRC_OP_AT(BRICK, mortar_size)] = in[TRC_AT(BRICK, mortar_size)];
    to[TRC_OP_AT(BRICK, mortar_smooth)] = in[TRC_AT(BRICK, mortar_smooth)];
    to[TRC_OP_AT(BRICK, bias)] = in[TRC_AT(BRICK, bias)];
    to[TRC_OP_AT(BRICK, brick_width)] = in[TRC_AT(BRICK, brick_width)];
    to[TRC_OP_AT(BRICK, row_height)] = in[TRC_AT(BRICK, row_height)];
    to[TRC_OP_AT(BRICK, offset)] = in[TRC_AT(BRICK, offset)];
    to[TRC_OP_AT(BRICK, squash)] = in[TRC_AT(BRICK, squash)];
    TRC_TRY(op(b, TRC_OP_BRICK, mode, to, found));
    TRC_TRY(mixed(b, found[TRC_OP_OUT_AT(BRICK, shade)], in + TRC_AT(BRICK, color1),
                  in + TRC_AT(BRICK, color2), brick));
    TRC_TRY(mixed(b, found[TRC_OP_OUT_AT(BRICK, mortar)], brick, in + TRC_AT(BRICK, mortar),
                  out + TRC_OUT_AT(BRICK, color)));
    out[TRC_OUT_AT(BRICK, factor)] = found[TRC_OP_OUT_AT(BRICK, mortar)];
    return TRC_OK;
}

trc_status trc_build_texture(struct trc_build *b, const trc_node *node,
                             const struct trc_operand *in, struct trc_operand *out) {
    switch (node->type) {
    case TRC_NODE_NOISE:
        return build_noise(b, node->mode, in, out);
    case TRC_NODE_MUSGRAVE:
        return build_musgrave(b, node->mode, in, out);
    case TRC_NODE_VORONOI:
        return build_voronoi(b, node->mode, in, out);
    case TRC_NODE_WAVE:
        return build_wave(b, node->mode, in, out);
    case TRC_NODE_MAGIC:
        TRC_TRY(op(b, TRC_OP_MAGIC, node->mode, in, out + TRC_OUT_AT(MAGIC, color)));
        return op(b, TRC_OP_AVERAGE, 0, out + TRC_OUT_AT(MAGIC, color),
                  out + TRC_OUT_AT(MAGIC, factor));
    case TRC_NODE_BRICK:
        return build_brick(b, node->mode, in, out);
#define TRC_TEXTURE(NAME, number, label, inputs, outputs, modes) \
    case TRC_NODE_##NAME:                                        \
        return op(b, TRC_OP_##NAME, node->mode, in, out);
#include "tracer/nodes.def"
    default:
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "a node has an unknown type");
    }
}
