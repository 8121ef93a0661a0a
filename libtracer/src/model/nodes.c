/* Tables of node types. */
#include "model/nodes.h"

#define TRC_IN(kind, name) {TRC_SOCKET_##kind, #name},
#define TRC_OUT(kind, name) {TRC_SOCKET_##kind, #name},
#define TRC_NODE(NAME, number, label, inputs, outputs, modes)                             \
    static const struct trc_socket inputs_of_##NAME[] = {inputs{TRC_SOCKET_FLOAT, NULL}}; \
    static const struct trc_socket outputs_of_##NAME[] = {outputs{TRC_SOCKET_FLOAT, NULL}};
#include "tracer/nodes.def"

#define TRC_NODE(NAME, number, label, inputs, outputs, modes) \
    _Static_assert(TRC_INPUT_OF(NAME, end) <= TRC_MAX_NODE_INPUTS, label);
#include "tracer/nodes.def"

static const struct trc_node_info infos[] = {
#define TRC_NODE(NAME, number, label, inputs, outputs, modes)                               \
    [number] = {label, TRC_INPUT_OF(NAME, end), TRC_OUTPUT_OF(NAME, end), inputs_of_##NAME, \
                outputs_of_##NAME},
#include "tracer/nodes.def"
};

const struct trc_node_info *trc_node_info_of(uint32_t type) {
    if (type >= sizeof infos / sizeof *infos || !infos[type].label)
        return NULL;
    return &infos[type];
}

bool trc_node_is_shader(uint32_t type) { return type < TRC_NODE_IMAGE; }

bool trc_node_is_output(uint32_t type) {
    return type == TRC_NODE_AOV_VALUE || type == TRC_NODE_AOV_COLOR ||
           type == TRC_NODE_DISPLACEMENT_OUTPUT;
}

bool trc_node_has_table(uint32_t type) {
    return type == TRC_NODE_COLOR_RAMP || type == TRC_NODE_CURVES || type == TRC_NODE_FLOAT_CURVE;
}

bool trc_node_mode_is_valid(uint32_t type, uint32_t mode) {
    switch (type) {
#define TRC_NODE(NAME, number, label, inputs, outputs, modes) \
    case number:                                              \
        return modes;
#include "tracer/nodes.def"
    default:
        return false;
    }
}

enum trc_socket_kind trc_node_output_kind(const trc_node *node, uint32_t output) {
    if (node->type == TRC_NODE_COMBINE && node->mode == TRC_SEPARATE_XYZ)
        return TRC_SOCKET_VECTOR;
    return trc_node_info_of(node->type)->outputs[output].kind;
}
