/* Checks of a material's descriptor: what passes here cannot make the compiler read astray. */
#include <inttypes.h>
#include <math.h>

#include "core/checks.h"
#include "core/core.h"
#include "shading/build.h"

/* Where a message points to. */
struct place {
    const struct trc_node_info *info;
    uint32_t node;
};

static trc_status fail_input(const struct place *at, uint32_t input, const char *what) {
    return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "node %" PRIu32 " (%s), input %" PRIu32 " (%s): %s",
                    at->node, at->info->label, input, at->info->inputs[input].name, what);
}

static trc_status check_constant(const struct place *at, uint32_t index, enum trc_socket_kind kind,
                                 const trc_node_input *input) {
    for (uint32_t i = 0; i < trc_socket_floats(kind); i++) {
        if (!isfinite(input->value[i]))
            return fail_input(at, index, "the value is not finite");
    }
    return TRC_OK;
}

static trc_status check_input(const trc_material_desc *desc, const struct place *at,
                              uint32_t index) {
    const trc_node_input *input = &desc->inputs[desc->nodes[at->node].first_input + index];
    const enum trc_socket_kind kind = at->info->inputs[index].kind;
    if (input->node == TRC_INPUT_CONSTANT)
        return check_constant(at, index, kind, input);
    if (input->node == TRC_INPUT_DEFAULT) {
        return trc_socket_has_default(kind) ? TRC_OK : fail_input(at, index, "it has no default");
    }
    if (input->node < 0 || (uint32_t)input->node >= at->node) {
        return fail_input(at, index, "it is linked to a node that is not earlier");
    }
    const struct trc_node_info *from = trc_node_info_of(desc->nodes[input->node].type);
    if (input->output >= from->output_count) {
        return fail_input(at, index, "it is linked to an output that does not exist");
    }
    const bool is_shader = kind == TRC_SOCKET_SHADER;
    if (is_shader != (from->outputs[input->output].kind == TRC_SOCKET_SHADER)) {
        return fail_input(at, index,
                          is_shader ? "it is linked to a value, not to a shader"
                                    : "it is linked to a shader, not to a value");
    }
    return TRC_OK;
}

static trc_status check_table(const trc_node *node, const struct place *at) {
    if (!trc_node_has_table(node->type))
        return TRC_OK;
    if (!node->table || (uintptr_t)node->table % sizeof(float) ||
        node->table_count != 4 * TRC_TABLE_ENTRIES) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "node %" PRIu32 " (%s): the table has %" PRIu64 " floats, not %d", at->node,
                        at->info->label, node->table ? node->table_count : 0,
                        4 * TRC_TABLE_ENTRIES);
    }
    for (uint64_t i = 0; i < node->table_count; i++) {
        if (!isfinite(node->table[i])) {
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "node %" PRIu32 " (%s): number %" PRIu64 " of the table is not finite",
                            at->node, at->info->label, i);
        }
    }
    return TRC_OK;
}

static trc_status check_node(const trc_material_desc *desc, uint32_t index) {
    const trc_node *node = &desc->nodes[index];
    const struct place at = {trc_node_info_of(node->type), index};
    if (!at.info) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "node %" PRIu32 " has the unknown type %" PRIu32, index, node->type);
    }
    if (!trc_node_mode_is_valid(node->type, node->mode)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "node %" PRIu32 " (%s) has the unknown mode %" PRIu32, index,
                        at.info->label, node->mode);
    }
    const uint32_t count = at.info->input_count;
    if (node->input_count != count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "node %" PRIu32 " (%s) has %" PRIu32 " inputs, not %" PRIu32, index,
                        at.info->label, node->input_count, count);
    }
    if (count &&
        (node->first_input > desc->input_count || count > desc->input_count - node->first_input)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "node %" PRIu32 " (%s): its inputs are beyond the %" PRIu32
                        " of the material",
                        index, at.info->label, desc->input_count);
    }
    for (uint32_t i = 0; i < count; i++)
        TRC_TRY(check_input(desc, &at, i));
    return check_table(node, &at);
}

trc_status trc_material_validate(const trc_material_desc *desc) {
    const uint32_t known = TRC_MATERIAL_SAMPLE_EMISSION | TRC_MATERIAL_TRANSPARENT_SHADOW |
                           TRC_MATERIAL_DEFENSIVE_SAMPLING | TRC_MATERIAL_FACET_SHADOWING |
                           TRC_MATERIAL_LIGHT_TREE | TRC_MATERIAL_KEEPS_NORMALS |
                           TRC_MATERIAL_CUTS_OUT | TRC_MATERIAL_WIDE_SHADOWS;
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_material_desc"));
    TRC_TRY(trc_check_count(desc->node_count, 0, TRC_MAX_NODES, "node_count"));
    TRC_TRY(
        trc_check_count(desc->input_count, 0, TRC_MAX_NODES * TRC_MAX_NODE_INPUTS, "input_count"));
    TRC_TRY(trc_check_array(desc->nodes, desc->node_count, desc->node_count, sizeof *desc->nodes,
                            _Alignof(trc_node), "nodes"));
    TRC_TRY(trc_check_array(desc->inputs, desc->input_count, desc->input_count,
                            sizeof *desc->inputs, _Alignof(trc_node_input), "inputs"));
    if (desc->flags & ~known) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "flags has unknown bits: %#" PRIx32,
                        desc->flags);
    }
    TRC_TRY(trc_check_finite(&desc->cryptomatte, 1, "cryptomatte"));
    if (desc->film_colors)
        TRC_TRY(trc_check_finite(desc->film_colors, 9, "film_colors"));
    for (uint32_t i = 0; i < desc->node_count; i++)
        TRC_TRY(check_node(desc, i));
    if (desc->node_count == 0 || desc->surface == -1)
        return TRC_OK;
    if (desc->surface < 0 || (uint32_t)desc->surface >= desc->node_count ||
        !trc_node_is_shader(desc->nodes[desc->surface].type)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "surface is %" PRId32 ", which is no shader node", desc->surface);
    }
    return TRC_OK;
}
