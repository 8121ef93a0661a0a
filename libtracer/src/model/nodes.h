/* What is known of node types: tracer/nodes.def in forms that code can check against and count
 * with. The compiler of materials lays a node's inputs and outputs out as floats in their order,
 * three for a colour or vector, one for a number, none for a shader. */
#ifndef TRACER_MODEL_NODES_H
#define TRACER_MODEL_NODES_H

#include <stdbool.h>

#include "model/sockets.h"
#include "tracer/tracer.h"

/* Of inputs and outputs, as tracer/nodes.def explains them. */
enum trc_socket_kind {
    TRC_SOCKET_FLOAT,
    TRC_SOCKET_COLOR,
    TRC_SOCKET_VECTOR,
    TRC_SOCKET_SHADER,
    /* of inputs alone: with a default */
    TRC_SOCKET_NORMAL,
    TRC_SOCKET_TANGENT,
    TRC_SOCKET_UV,
    TRC_SOCKET_GENERATED,
    TRC_SOCKET_POSITION
};

static inline bool trc_socket_has_default(enum trc_socket_kind kind) {
    return kind > TRC_SOCKET_SHADER;
}
/* Floats of an input or output. */
static inline uint32_t trc_socket_floats(enum trc_socket_kind kind) {
    return kind == TRC_SOCKET_SHADER ? 0 : kind == TRC_SOCKET_FLOAT ? 1 : 3;
}

struct trc_socket {
    enum trc_socket_kind kind;
    const char *name;
};

struct trc_node_info {
    const char *label; /* NULL: no such type */
    uint32_t input_count, output_count;
    const struct trc_socket *inputs, *outputs;
};

/* NULL: unknown type. */
const struct trc_node_info *trc_node_info_of(uint32_t type);
bool trc_node_is_shader(uint32_t type);
bool trc_node_is_output(uint32_t type);
/* Whether it needs trc_node.table. */
bool trc_node_has_table(uint32_t type);
/* Whether mode is one that the type has. */
bool trc_node_mode_is_valid(uint32_t type, uint32_t mode);
/* Kind of a node's output; Combine XYZ gives a vector, the other modes a colour. */
enum trc_socket_kind trc_node_output_kind(const trc_node *node, uint32_t output);

/* ---- offsets, constants at compile time ---- */

#define TRC_IN(kind, name) TRC_FLOATS_##kind(name)
#define TRC_OUT(kind, name) TRC_FLOATS_##kind(name)
#define TRC_NODE(NAME, number, label, inputs, outputs, modes) \
    struct trc_inputs_of_##NAME {                             \
        inputs float end;                                     \
    };                                                        \
    struct trc_outputs_of_##NAME {                            \
        outputs float end;                                    \
    };
#include "tracer/nodes.def"

#define TRC_IN(kind, name) char name;
#define TRC_OUT(kind, name) char name;
#define TRC_NODE(NAME, number, label, inputs, outputs, modes) \
    struct trc_input_order_of_##NAME {                        \
        inputs char end;                                      \
    };                                                        \
    struct trc_output_order_of_##NAME {                       \
        outputs char end;                                     \
    };
#include "tracer/nodes.def"

/* Where an input or output stands among the floats of all of its node; end: how many there are. */
#define TRC_AT(NODE, input) TRC_FLOATS_BEFORE(struct trc_inputs_of_##NODE, input)
#define TRC_OUT_AT(NODE, output) TRC_FLOATS_BEFORE(struct trc_outputs_of_##NODE, output)
/* Its number; end: how many there are. */
#define TRC_INPUT_OF(NODE, input) ((uint32_t)offsetof(struct trc_input_order_of_##NODE, input))
#define TRC_OUTPUT_OF(NODE, output) ((uint32_t)offsetof(struct trc_output_order_of_##NODE, output))

#endif
