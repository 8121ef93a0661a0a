/* The shader tree to a list of leaves with weights. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

static trc_status multiply(struct trc_build *b, struct trc_operand x, struct trc_operand y,
                           struct trc_operand *out) {
    return trc_build_math(b, TRC_MATH_MULTIPLY, x, y, trc_constant(0.0f), out);
}

/* Adds a weight to that of the shader an input is linked to. */
static trc_status give_weight(struct trc_build *b, const trc_node *node, uint32_t input,
                              struct trc_operand weight, struct trc_operand *weights) {
    const trc_node_input *link = &b->desc->inputs[node->first_input + input];
    if (link->node < 0)
        return TRC_OK;
    struct trc_operand *sum = &weights[link->node];
    return trc_build_math(b, TRC_MATH_ADD, *sum, weight, trc_constant(0.0f), sum);
}

/* A mix gives w (1 - f) and w f, the factor clamped to [0, 1]; a sum gives w to both. */
static trc_status share_weight(struct trc_build *b, const trc_node *node, struct trc_operand weight,
                               struct trc_operand *weights) {
    if (node->type == TRC_NODE_ADD_SHADER) {
        TRC_TRY(give_weight(b, node, TRC_INPUT_OF(ADD_SHADER, first), weight, weights));
        return give_weight(b, node, TRC_INPUT_OF(ADD_SHADER, second), weight, weights);
    }
    struct trc_operand factor, rest, first, second;
    const struct trc_operand zero = trc_constant(0.0f), one = trc_constant(1.0f);
    TRC_TRY(trc_build_input(b, node, TRC_INPUT_OF(MIX_SHADER, factor), &factor));
    const struct trc_operand clamp[TRC_OP_AT(CLAMP, end)] = {factor, zero, one};
    TRC_TRY(trc_build_op(b, TRC_OP_CLAMP, TRC_CLAMP_MINMAX, TRC_NO_RESOURCE, clamp, &factor));
    TRC_TRY(trc_build_math(b, TRC_MATH_SUBTRACT, one, factor, zero, &rest));
    TRC_TRY(multiply(b, weight, rest, &first));
    TRC_TRY(multiply(b, weight, factor, &second));
    TRC_TRY(give_weight(b, node, TRC_INPUT_OF(MIX_SHADER, first), first, weights));
    return give_weight(b, node, TRC_INPUT_OF(MIX_SHADER, second), second, weights);
}

static bool is_black(const struct trc_operand *color) {
    return trc_is_value(color[0], 0.0f) && trc_is_value(color[1], 0.0f) &&
           trc_is_value(color[2], 0.0f);
}

/* Whether a leaf of these operands neither scatters nor emits, whatever the light. */
static bool is_nothing(uint32_t type, const struct trc_operand *in) {
    switch (type) {
    case TRC_NODE_EMISSION:
        return is_black(in + TRC_AT(EMISSION, color)) ||
               trc_is_value(in[TRC_AT(EMISSION, strength)], 0.0f);
    case TRC_NODE_BACKGROUND:
        return is_black(in + TRC_AT(BACKGROUND, color)) ||
               trc_is_value(in[TRC_AT(BACKGROUND, strength)], 0.0f);
    case TRC_NODE_TRANSPARENT:
        return is_black(in + TRC_AT(TRANSPARENT, color));
    default:
        return false;
    }
}

/* Anisotropic leaves without a tangent have the default one. */
static trc_status fill_tangent(struct trc_build *b, uint32_t type, struct trc_operand *in) {
    uint32_t anisotropy = TRC_AT(GLOSSY, anisotropy), tangent = TRC_AT(GLOSSY, tangent);
    if (type == TRC_NODE_PRINCIPLED) {
        anisotropy = TRC_AT(PRINCIPLED, anisotropic);
        tangent = TRC_AT(PRINCIPLED, tangent);
    } else if (type == TRC_NODE_LAYERED_PRINCIPLED) {
        anisotropy = TRC_AT(LAYERED_PRINCIPLED, anisotropic);
        tangent = TRC_AT(LAYERED_PRINCIPLED, tangent);
    } else if (type != TRC_NODE_GLOSSY) {
        return TRC_OK;
    }
    if (in[tangent].reg != TRC_REG_DEFAULT || trc_is_value(in[anisotropy], 0.0f))
        return TRC_OK;
    return trc_build_op(b, TRC_OP_DEFAULT_TANGENT, 0, TRC_NO_RESOURCE, NULL, in + tangent);
}

static trc_status add_leaf(struct trc_build *b, const trc_node *node, struct trc_operand weight) {
    struct trc_operand *in = b->leaf_operands + b->leaf_operand_count;
    if (b->leaf_count == TRC_MAX_LEAVES) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "the material mixes more than %d shaders",
                        TRC_MAX_LEAVES);
    }
    const struct trc_socket *sockets = trc_node_info_of(node->type)->inputs;
    uint32_t floats = 0;
    for (uint32_t i = 0; i < node->input_count; i++) {
        TRC_TRY(trc_build_input(b, node, i, in + floats));
        floats += trc_socket_floats(sockets[i].kind);
    }
    if (is_nothing(node->type, in))
        return TRC_OK;
    TRC_TRY(fill_tangent(b, node->type, in));
    b->leaves[b->leaf_count++] = (struct trc_leaf){
        .type = node->type,
        .mode = node->mode,
        .weight = weight,
        .first_operand = b->leaf_operand_count,
        .operand_count = floats,
    };
    b->leaf_operand_count += floats;
    return TRC_OK;
}

/* From the output backwards: links lead to earlier nodes only, so a weight is complete when its
 * node's turn comes. A shader that is used twice is one leaf with the sum of both weights, as in
 * Cycles. */
static trc_status weigh(struct trc_build *b, struct trc_operand *weights) {
    for (uint32_t i = 0; i < b->desc->node_count; i++)
        weights[i] = trc_constant(0.0f);
    weights[b->desc->surface] = trc_constant(1.0f);
    for (uint32_t i = (uint32_t)b->desc->surface + 1; i-- > 0;) {
        const trc_node *node = &b->desc->nodes[i];
        if (!trc_node_is_shader(node->type) || trc_is_value(weights[i], 0.0f))
            continue;
        if (node->type == TRC_NODE_MIX_SHADER || node->type == TRC_NODE_ADD_SHADER) {
            TRC_TRY(share_weight(b, node, weights[i], weights));
        } else {
            TRC_TRY(add_leaf(b, node, weights[i]));
        }
    }
    return TRC_OK;
}

trc_status trc_build_leaves(struct trc_build *b) {
    if (b->desc->node_count == 0 || b->desc->surface < 0)
        return TRC_OK;
    struct trc_operand *weights = trc_alloc(b->desc->node_count, sizeof *weights);
    if (!weights)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to compile a material");
    const trc_status status = weigh(b, weights);
    trc_free(weights);
    return status;
}

bool trc_leaf_has_shadow(const struct trc_leaf *leaf) {
    switch (leaf->type) {
    case TRC_NODE_RAY_PORTAL:
    case TRC_NODE_HUANG_HAIR: /* depends on the strand */
        return false;
    case TRC_NODE_LAYERED_PRINCIPLED: /* thin walls are clear where they are smooth */
        return !(leaf->mode & TRC_DISTRIBUTION_THIN_WALL);
    default:
        return true;
    }
}

/* What of the light a leaf covers goes straight through it, three operands, and which part of the
 * light it covers. False: nothing. */
static bool shadow_of(const struct trc_leaf *leaf, const struct trc_operand *in,
                      struct trc_operand color_out[3], struct trc_operand *alpha_out) {
    for (int c = 0; c < 3; c++)
        color_out[c] = trc_constant(1.0f);
    *alpha_out = trc_constant(0.0f);
    if (leaf->type == TRC_NODE_TRANSPARENT)
        memcpy(color_out, in + TRC_AT(TRANSPARENT, color), 3 * sizeof *color_out);
    else if (leaf->type == TRC_NODE_PRINCIPLED)
        *alpha_out = in[TRC_AT(PRINCIPLED, alpha)];
    else if (leaf->type == TRC_NODE_LAYERED_PRINCIPLED)
        *alpha_out = in[TRC_AT(LAYERED_PRINCIPLED, alpha)];
    else
        return false;
    return !trc_is_constant(*alpha_out) || !(alpha_out->value >= 1.0f);
}

trc_status trc_build_shadow(struct trc_build *b) {
    const struct trc_operand zero = trc_constant(0.0f), one = trc_constant(1.0f);
    struct trc_operand operands[TRC_MAX_LEAVES][3];
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->leaf_count; i++) {
        const struct trc_leaf *leaf = &b->leaves[i];
        struct trc_operand weight = leaf->weight, alpha, open;
        if (!shadow_of(leaf, b->leaf_operands + leaf->first_operand, operands[count], &alpha))
            continue;
        if (!trc_is_value(alpha, 0.0f)) {
            const struct trc_operand clamp[TRC_OP_AT(CLAMP, end)] = {alpha, zero, one};
            TRC_TRY(trc_build_op(b, TRC_OP_CLAMP, TRC_CLAMP_MINMAX, TRC_NO_RESOURCE, clamp, &open));
            TRC_TRY(trc_build_math(b, TRC_MATH_SUBTRACT, one, open, zero, &open));
            TRC_TRY(multiply(b, weight, open, &weight));
        }
        b->leaves[count] = (struct trc_leaf){.type = TRC_NODE_TRANSPARENT,
                                             .weight = weight,
                                             .first_operand = 3 * count,
                                             .operand_count = 3};
        count++;
    }
    b->leaf_count = count;
    b->leaf_operand_count = 3 * count;
    memcpy(b->leaf_operands, operands, count * sizeof *operands);
    return TRC_OK;
}

trc_status trc_build_aovs(struct trc_build *b) {
    for (uint32_t i = 0; i < b->desc->node_count; i++) {
        const trc_node *node = &b->desc->nodes[i];
        if (!trc_node_is_output(node->type) || node->type == TRC_NODE_DISPLACEMENT_OUTPUT)
            continue;
        if (b->aov_count == TRC_MAX_AOV_OUTPUTS) {
            return trc_fail(TRC_ERROR_TOO_LARGE, "the material has more than %d AOV nodes",
                            TRC_MAX_AOV_OUTPUTS);
        }
        const bool is_value = node->type == TRC_NODE_AOV_VALUE;
        TRC_TRY(trc_build_input(b, node, 0, b->leaf_operands + b->leaf_operand_count));
        b->aovs[b->aov_count++] = (struct trc_aov_output){
            .pass = is_value ? TRC_PASS_AOV_VALUE(node->mode) : TRC_PASS_AOV_COLOR(node->mode),
            .first_operand = b->leaf_operand_count,
        };
        b->leaf_operand_count += is_value ? TRC_AT(AOV_VALUE, end) : TRC_AT(AOV_COLOR, end);
    }
    return TRC_OK;
}
