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
                               struct trc_operand filter_width, struct trc_operand out[3][3]) {
    struct trc_operand *const outputs = b->outputs;
    TRC_TRY(make_room(b));
    const uint32_t end = mark_nodes(b, &b->desc->inputs[node->first_input + input]);
    keep_outputs(b, outputs, end);
    b->outputs = b->height_outputs;
    b->filter_width = filter_width;
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
    TRC_TRY(
        lower_height(b, node, TRC_INPUT_OF(BUMP, height), in[TRC_AT(BUMP, filter_width)], height));
    if (is_same(height[0][0], height[1][0]) && is_same(height[0][0], height[2][0])) {
        memcpy(out, normal, 3 * sizeof *out);
        return TRC_OK;
    }
    to[TRC_OP_AT(BUMP, strength)] = in[TRC_AT(BUMP, strength)];
    to[TRC_OP_AT(BUMP, distance)] = in[TRC_AT(BUMP, distance)];
    to[TRC_OP_AT(BUMP, filter_width)] = in[TRC_AT(BUMP, filter_width)];
    memcpy(to + TRC_OP_AT(BUMP, normal), normal, 3 * sizeof *to);
    to[TRC_OP_AT(BUMP, middle)] = height[0][0];
    to[TRC_OP_AT(BUMP, beside_x)] = height[1][0];
    to[TRC_OP_AT(BUMP, beside_y)] = height[2][0];
    return trc_build_op(b, TRC_OP_BUMP, node->mode, TRC_NO_RESOURCE, to, out);
}
