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
    struct trc_operand in[10];
    for (int i = 0; i < 10; i++)
        in[i] = trc_constant(0.0f);
    memcpy(in, vector, 3 * sizeof *in);
    if (mode == TRC_VECTOR_DIVIDE)
        in[3] = in[4] = in[5] = scale;
    else
        in[9] = scale;
    return op(b, TRC_OP_VECTOR_MATH, mode, in, out);
}

static trc_status calculate(struct trc_build *b, uint32_t mode, struct trc_operand x,
                            struct trc_operand y, struct trc_operand *out) {
    return trc_build_math(b, mode, x, y, trc_constant(0.0f), out);
}

static trc_status clamped(struct trc_build *b, struct trc_operand x, float low, float high,
                          struct trc_operand *out) {
    const struct trc_operand in[3] = {x, trc_constant(low), trc_constant(high)};
    return op(b, TRC_OP_CLAMP, 0, in, out);
}

/* Octaves beyond the first are called detail. */
static trc_status octaves_of(struct trc_build *b, struct trc_operand detail,
                             struct trc_operand *out) {
    TRC_TRY(clamped(b, detail, 0.0f, TRC_MAX_OCTAVES - 1.0f, out));
    return calculate(b, TRC_MATH_ADD, *out, trc_constant(1.0f), out);
}

/* The place in the space of the texture, vector and w; unused components are 0, so that they cost
 * nothing. */
static trc_status place(struct trc_build *b, uint32_t dims, const struct trc_operand *vector,
                        struct trc_operand w, struct trc_operand scale, struct trc_operand *out) {
    struct trc_operand used[3];
    for (uint32_t i = 0; i < 3; i++)
        used[i] = dims == 1 || i >= dims ? trc_constant(0.0f) : vector[i];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, used, scale, out));
    out[3] = trc_constant(0.0f);
    if (dims == 1 || dims == 4)
        return calculate(b, TRC_MATH_MULTIPLY, w, scale, out + 3);
    return TRC_OK;
}

/* ---- textures ---- */

/* in: vector, w, scale, detail, roughness, lacunarity, offset, gain, distortion */
static trc_status build_noise(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                              struct trc_operand *out) {
    struct trc_operand to[10];
    TRC_TRY(place(b, (mode & 3u) + 1, in, in[3], in[4], to));
    TRC_TRY(octaves_of(b, in[5], to + 4));
    /* Cycles 3.4 has no roughness above 1, later ones have it without normalisation only. */
    const float highest = mode >> TRC_NOISE_TYPE_SHIFT == TRC_FRACTAL_FBM_UNIT ? 1.0f : 1e30f;
    TRC_TRY(clamped(b, in[6], 0.0f, highest, to + 5));
    memcpy(to + 6, in + 7, 4 * sizeof *to);
    return op(b, TRC_OP_NOISE, mode, to, out);
}

/* in: vector, w, scale, detail, dimension, lacunarity, offset, gain. An octave is by lacunarity to
 * the power of -dimension fainter than the one before it. */
static trc_status build_musgrave(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                                 struct trc_operand *out) {
    struct trc_operand to[10], all[4], dimension, zero = trc_constant(0.0f);
    TRC_TRY(place(b, (mode & 3u) + 1, in, in[3], in[4], to));
    TRC_TRY(clamped(b, in[5], 0.0f, TRC_MAX_OCTAVES - 1.0f, to + 4));
    TRC_TRY(calculate(b, TRC_MATH_MAXIMUM, in[6], trc_constant(1e-5f), &dimension));
    TRC_TRY(calculate(b, TRC_MATH_SUBTRACT, zero, dimension, &dimension));
    TRC_TRY(calculate(b, TRC_MATH_MAXIMUM, in[7], trc_constant(1e-5f), to + 6));
    TRC_TRY(calculate(b, TRC_MATH_POWER, to[6], dimension, to + 5));
    to[7] = in[8];
    to[8] = in[9];
    to[9] = zero;
    TRC_TRY(op(b, TRC_OP_NOISE, mode, to, all));
    *out = all[0];
    return TRC_OK;
}

/* in: vector, w, scale, smoothness, exponent, randomness, detail, roughness, lacunarity */
static trc_status build_voronoi(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                                struct trc_operand *out) {
    struct trc_operand to[10];
    TRC_TRY(place(b, (mode & 3u) + 1, in, in[3], in[4], to));
    memcpy(to + 4, in + 5, 6 * sizeof *to);
    TRC_TRY(op(b, TRC_OP_VORONOI, mode, to, out));
    TRC_TRY(scaled(b, TRC_VECTOR_DIVIDE, out + 4, in[4], out + 4));
    return calculate(b, TRC_MATH_DIVIDE, out[7], in[4], out + 7);
}

/* in: vector, scale, distortion, detail, detail scale, detail roughness, phase */
static trc_status build_wave(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                             struct trc_operand *out) {
    struct trc_operand to[8];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, in, in[3], to));
    to[3] = in[4];
    to[4] = in[6];
    TRC_TRY(octaves_of(b, in[5], to + 5));
    to[6] = in[7];
    to[7] = in[8];
    return op(b, TRC_OP_WAVE, mode, to, out);
}

/* in: vector, color 1, color 2, mortar, scale, mortar size, mortar smoothness, bias, brick width,
 * row height, offset, squash */
static trc_status build_brick(struct trc_build *b, uint32_t mode, const struct trc_operand *in,
                              struct trc_operand *out) {
    struct trc_operand to[10], found[2], mix[7];
    TRC_TRY(scaled(b, TRC_VECTOR_SCALE, in, in[12], to));
    memcpy(to + 3, in + 13, 7 * sizeof *to);
    TRC_TRY(op(b, TRC_OP_BRICK, mode, to, found));
    mix[0] = found[0];
    memcpy(mix + 1, in + 3, 6 * sizeof *mix);
    TRC_TRY(op(b, TRC_OP_MIX, TRC_BLEND_MIX, mix, mix + 1));
    mix[0] = found[1];
    memcpy(mix + 4, in + 9, 3 * sizeof *mix);
    TRC_TRY(op(b, TRC_OP_MIX, TRC_BLEND_MIX, mix, out));
    out[3] = found[1];
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
    case TRC_NODE_GRADIENT:
        return op(b, TRC_OP_GRADIENT, node->mode, in, out);
    case TRC_NODE_WHITE_NOISE:
        return op(b, TRC_OP_WHITE_NOISE, node->mode, in, out);
    case TRC_NODE_MAGIC:
        TRC_TRY(op(b, TRC_OP_MAGIC, node->mode, in, out));
        return op(b, TRC_OP_AVERAGE, 0, out, out + 3);
    case TRC_NODE_BRICK:
        return build_brick(b, node->mode, in, out);
    default:
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "a node has an unknown type");
    }
}
