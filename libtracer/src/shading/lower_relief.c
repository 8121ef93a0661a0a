/* Heights to slopes: the nodes of a height are lowered three times, at the point that is shaded and
 * at two beside it, as in Cycles. What does not change from one to the next is shared like all
 * equal operations. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

static trc_status make_room(struct trc_build *b) {
    if (!b->height_outputs)
        b->height_outputs = trc_alloc(b->output_count, sizeof *b->height_outputs);
    if (!b->height_nodes)
        b->height_nodes = trc_alloc(b->desc->node_count, 1);
    return b->height_outputs && b->height_nodes
               ? TRC_OK
               : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to compile a material");
}

/* Bump nodes within a height are what they are at the point. */
static bool is_of_point(const trc_node *node) { return node->type == TRC_NODE_BUMP; }

static void mark_source(struct trc_build *b, const trc_node_input *input) {
    if (input->node >= 0)
        b->height_nodes[input->node] = 1;
}

/* The nodes that an input depends on; the number after the last. */
static uint32_t mark_nodes(struct trc_build *b, const trc_node_input *input) {
    memset(b->height_nodes, 0, b->desc->node_count);
    mark_source(b, input);
    const uint32_t end = input->node >= 0 ? (uint32_t)input->node + 1 : 0;
    for (uint32_t i = end; i-- > 0;) {
        const trc_node *node = &b->desc->nodes[i];
        if (!b->height_nodes[i] || is_of_point(node))
            continue;
        for (uint32_t k = 0; k < node->input_count; k++)
            mark_source(b, &b->desc->inputs[node->first_input + k]);
    }
    return end;
}

/* Takes over the outputs of marked nodes that are those of the point. */
static void keep_outputs(struct trc_build *b, const struct trc_operand *outputs, uint32_t end) {
    for (uint32_t i = 0; i < end; i++) {
        if (!b->height_nodes[i] || !is_of_point(&b->desc->nodes[i]))
            continue;
        const uint32_t first = b->first_output[i];
        memcpy(b->height_outputs + first, outputs + first, 3 * sizeof *outputs);
        b->height_nodes[i] = 0;
    }
}

/* An input of a node at the three places, each of the floats of its kind; all nodes that it depends
 * on have been lowered for the shaded point. */
static trc_status lower_height(struct trc_build *b, const trc_node *node, uint32_t input,
                               struct trc_operand filter_width, struct trc_operand position_width,
                               struct trc_operand out[3][3]) {
    struct trc_operand *const outputs = b->outputs;
    TRC_TRY(make_room(b));
    const uint32_t end = mark_nodes(b, &b->desc->inputs[node->first_input + input]);
    keep_outputs(b, outputs, end);
    b->outputs = b->height_outputs;
    b->filter_width = filter_width;
    b->position_width = position_width;
    trc_status status = TRC_OK;
    for (uint32_t i = 0; i < 3 && status == TRC_OK; i++) {
        b->place = TRC_PLACE_MIDDLE + i;
        status = trc_build_nodes(b, b->height_nodes, end);
        if (status == TRC_OK)
            status = trc_build_input(b, node, input, out[i]);
    }
    b->outputs = outputs;
    b->place = TRC_PLACE_SHADED;
    return status;
}

static bool is_same(struct trc_operand a, struct trc_operand b) {
    return a.reg == b.reg && a.value == b.value;
}

trc_status trc_build_bump(struct trc_build *b, const trc_node *node, const struct trc_operand *in,
                          struct trc_operand *out) {
    struct trc_operand to[TRC_OP_AT(BUMP, end)], height[3][3];
    const struct trc_operand *normal = in + TRC_AT(BUMP, normal);
    const struct trc_operand width = in[TRC_AT(BUMP, filter_width)];
    TRC_TRY(lower_height(b, node, TRC_INPUT_OF(BUMP, height), width, width, height));
    if (is_same(height[0][0], height[1][0]) && is_same(height[0][0], height[2][0])) {
        memcpy(out, normal, 3 * sizeof *out);
        return TRC_OK;
    }
    to[TRC_OP_AT(BUMP, strength)] = in[TRC_AT(BUMP, strength)];
    to[TRC_OP_AT(BUMP, distance)] = in[TRC_AT(BUMP, distance)];
    to[TRC_OP_AT(BUMP, filter_width)] = width;
    memcpy(to + TRC_OP_AT(BUMP, normal), normal, 3 * sizeof *to);
    to[TRC_OP_AT(BUMP, middle)] = height[0][0];
    to[TRC_OP_AT(BUMP, beside_x)] = height[1][0];
    to[TRC_OP_AT(BUMP, beside_y)] = height[2][0];
    return trc_build_op(b, TRC_OP_BUMP, node->mode, TRC_NO_RESOURCE, to, out);
}

/* ---- displacement ---- */

/* Along the normal, scaled in object or world space. */
trc_status trc_build_displacement(struct trc_build *b, const trc_node *node,
                                  const struct trc_operand *in, struct trc_operand *out) {
    const struct trc_operand none = trc_constant(0.0f);
    const bool is_object = node->mode == TRC_SPACE_OBJECT;
    const uint32_t to_object = TRC_TRANSFORM_WORLD_TO_OBJECT | TRC_TRANSFORM_NORMAL;
    struct trc_operand height, normal[3];
    memcpy(normal, in + TRC_AT(DISPLACEMENT, normal), sizeof normal);
    TRC_TRY(trc_build_math(b, TRC_MATH_SUBTRACT, in[TRC_AT(DISPLACEMENT, height)],
                           in[TRC_AT(DISPLACEMENT, midlevel)], none, &height));
    TRC_TRY(trc_build_math(b, TRC_MATH_MULTIPLY, height, in[TRC_AT(DISPLACEMENT, scale)], none,
                           &height));
    if (is_object)
        TRC_TRY(trc_build_op(b, TRC_OP_TRANSFORM, to_object, TRC_NO_RESOURCE, normal, normal));
    for (uint32_t i = 0; i < 3; i++)
        TRC_TRY(trc_build_math(b, TRC_MATH_MULTIPLY, normal[i], height, none, out + i));
    return is_object ? trc_build_op(b, TRC_OP_TRANSFORM, TRC_TRANSFORM_OBJECT_TO_WORLD,
                                    TRC_NO_RESOURCE, out, out)
                     : TRC_OK;
}

const trc_node *trc_displacement_of(const trc_material_desc *desc) {
    for (uint32_t i = 0; i < desc->node_count; i++)
        if (desc->nodes[i].type == TRC_NODE_DISPLACEMENT_OUTPUT)
            return &desc->nodes[i];
    return NULL;
}

uint32_t trc_displacement_method_of(const trc_node *node) {
    return node ? node->mode & ~(uint32_t)TRC_DISPLACEMENT_ABOVE : (uint32_t)TRC_DISPLACEMENT_BUMP;
}

/* Lowers all nodes up to those that the displacement comes from, for the point. */
static trc_status lower_sources(struct trc_build *b, const trc_node *node) {
    uint32_t end = 0;
    for (uint32_t i = 0; i < node->input_count; i++) {
        const int32_t source = b->desc->inputs[node->first_input + i].node;
        if (source >= 0 && (uint32_t)source >= end)
            end = (uint32_t)source + 1;
    }
    return trc_build_nodes(b, NULL, end);
}

static trc_status set_position(struct trc_build *b, const struct trc_operand position[3]) {
    struct trc_operand out[3];
    TRC_TRY(trc_build_op(b, TRC_OP_SET_POSITION, 0, TRC_NO_RESOURCE, position, out));
    b->moves_point = true;
    b->point_since = b->op_count;
    return TRC_OK;
}

/* Offsets along the normal at the three places: heights of a bump. rest_step: that of
 * TRC_OP_REST. */
static trc_status lower_offsets(struct trc_build *b, const trc_node *node,
                                struct trc_operand filter_width, struct trc_operand rest_step,
                                const struct trc_operand normal[3], struct trc_operand heights[3]) {
    const struct trc_operand none = trc_constant(0.0f);
    struct trc_operand dot[TRC_OP_AT(VECTOR_MEASURE, end)], offset[3][3], position_width;
    TRC_TRY(trc_build_math(b, TRC_MATH_MULTIPLY, filter_width, rest_step, none, &position_width));
    TRC_TRY(lower_height(b, node, TRC_INPUT_OF(DISPLACEMENT_OUTPUT, displacement), filter_width,
                         position_width, offset));
    for (uint32_t i = 0; i < 3; i++) {
        memcpy(dot + TRC_OP_AT(VECTOR_MEASURE, a), offset[i], sizeof offset[i]);
        memcpy(dot + TRC_OP_AT(VECTOR_MEASURE, b), normal, 3 * sizeof *normal);
        TRC_TRY(trc_build_op(b, TRC_OP_VECTOR_MEASURE, TRC_VECTOR_DOT, TRC_NO_RESOURCE, dot,
                             heights + i));
    }
    return TRC_OK;
}

/* As a bump whose height is the offset along the normal, as in Cycles. rest_step: how long steps
 * were where heights are looked up. */
static trc_status bend(struct trc_build *b, const trc_node *node, uint32_t mode,
                       struct trc_operand rest_step) {
    const struct trc_operand none = trc_constant(0.0f), one = trc_constant(1.0f);
    struct trc_operand to[TRC_OP_AT(BUMP, end)];
    struct trc_operand *const heights = to + TRC_OP_AT(BUMP, middle);
    struct trc_operand *const normal = to + TRC_OP_AT(BUMP, normal);
    struct trc_operand *const width = to + TRC_OP_AT(BUMP, filter_width);
    TRC_TRY(lower_sources(b, node));
    TRC_TRY(trc_build_input(b, node, TRC_INPUT_OF(DISPLACEMENT_OUTPUT, filter_width), width));
    TRC_TRY(trc_build_op(b, TRC_OP_NORMAL, 0, TRC_NO_RESOURCE, NULL, normal));
    TRC_TRY(lower_offsets(b, node, *width, rest_step, normal, heights));
    if (is_same(heights[0], heights[1]) && is_same(heights[0], heights[2]))
        return TRC_OK;
    to[TRC_OP_AT(BUMP, strength)] = one;
    TRC_TRY(
        trc_build_math(b, TRC_MATH_DIVIDE, one, rest_step, none, to + TRC_OP_AT(BUMP, distance)));
    TRC_TRY(trc_build_op(b, TRC_OP_BUMP, mode, TRC_NO_RESOURCE, to, to));
    TRC_TRY(trc_build_op(b, TRC_OP_SET_NORMAL, 0, TRC_NO_RESOURCE, to, to));
    b->point_since = b->op_count;
    return TRC_OK;
}

trc_status trc_build_relief(struct trc_build *b) {
    const trc_node *node = trc_displacement_of(b->desc);
    const uint32_t method = trc_displacement_method_of(node);
    if (!node || method == TRC_DISPLACEMENT_TRUE)
        return TRC_OK;
    const uint32_t mode = node->mode & TRC_DISPLACEMENT_ABOVE ? TRC_BUMP_ABOVE : 0u;
    if (method == TRC_DISPLACEMENT_BUMP)
        return bend(b, node, mode, trc_constant(1.0f));
    /* On the surface as it was before its vertices moved. */
    struct trc_operand position[3], rest[TRC_OP_OUT_AT(REST, end)];
    TRC_TRY(trc_build_op(b, TRC_OP_POSITION, 0, TRC_NO_RESOURCE, NULL, position));
    TRC_TRY(trc_build_op(b, TRC_OP_REST, 0, TRC_NO_RESOURCE, NULL, rest));
    TRC_TRY(set_position(b, rest + TRC_OP_OUT_AT(REST, position)));
    TRC_TRY(bend(b, node, mode | TRC_BUMP_IN_OBJECT, rest[TRC_OP_OUT_AT(REST, step)]));
    return set_position(b, position);
}

trc_status trc_build_offset(struct trc_build *b) {
    const trc_node *node = trc_displacement_of(b->desc);
    TRC_TRY(trc_build_prepare(b));
    TRC_TRY(lower_sources(b, node));
    TRC_TRY(trc_build_input(b, node, TRC_INPUT_OF(DISPLACEMENT_OUTPUT, displacement),
                            b->leaf_operands));
    b->leaf_operand_count = 3;
    b->aovs[b->aov_count++] = (struct trc_aov_output){.first_operand = 0};
    return TRC_OK;
}
