/* A material under compilation: shared by the files of shading/. Not for others. */
#ifndef TRACER_SHADING_BUILD_H
#define TRACER_SHADING_BUILD_H

#include <stdbool.h>

#include "model/material.h"
#include "model/nodes.h"
#include "model/program.h"
#include "shading/compile.h"

/* Every node of the descriptor, reached or not (shading/validate.c). */
trc_status trc_material_validate(const trc_material_desc *desc);

/* ---- operations on values ---- */

/* Until registers are given, a value is named by an operand too: its reg is the value's number. */
struct trc_build_op {
    uint16_t op, mode;
    uint32_t resource;
    uint32_t first_input; /* into inputs */
    uint32_t first_value; /* outputs are values first_value... */
    uint32_t next;        /* with the same hash, UINT32_MAX: none */
    bool is_live;
};

#define TRC_BUILD_BUCKETS 1024

/* Which point nodes are lowered for: the one that is shaded, or one of the three of a height. */
enum trc_build_place { TRC_PLACE_SHADED, TRC_PLACE_MIDDLE, TRC_PLACE_X, TRC_PLACE_Y };

struct trc_build {
    const trc_material_desc *desc;
    const struct trc_compile_context *context;
    struct trc_build_op *ops;
    uint32_t op_count, op_capacity;
    struct trc_operand *inputs; /* of operations */
    uint32_t input_count, input_capacity;
    float *tables;
    uint32_t table_count, table_capacity;
    uint32_t value_count;
    uint8_t *value_is_live; /* by trc_build_mark */
    uint32_t buckets[TRC_BUILD_BUCKETS];
    struct trc_operand *outputs; /* of nodes: three per colour or vector, one per float */
    uint32_t *first_output;      /* of each node, into outputs */
    uint32_t output_count;
    enum trc_build_place place;
    struct trc_operand filter_width;    /* of the height that is lowered */
    struct trc_operand position_width;  /* the same for what is read from the position */
    struct trc_operand *height_outputs; /* of its nodes; NULL before the first Bump node */
    uint32_t point_since;  /* operations from here on read what SET_NORMAL and SET_POSITION set */
    bool moves_point;      /* SET_POSITION is among them */
    uint8_t *height_nodes; /* which those are */
    struct trc_leaf leaves[TRC_MAX_LEAVES];
    uint32_t leaf_count;
    struct trc_aov_output aovs[TRC_MAX_AOV_OUTPUTS];
    uint32_t aov_count;
    /* Of leaves, then of AOVs. */
    struct trc_operand
        leaf_operands[TRC_MAX_LEAVES * 3 * TRC_MAX_NODE_INPUTS + 3 * TRC_MAX_AOV_OUTPUTS];
    uint32_t leaf_operand_count;
};

static inline struct trc_operand trc_constant(float value) {
    return (struct trc_operand){TRC_REG_CONSTANT, value};
}
static inline bool trc_is_constant(struct trc_operand o) { return o.reg == TRC_REG_CONSTANT; }
static inline bool trc_is_value(struct trc_operand o, float value) {
    return trc_is_constant(o) && o.value == value;
}

uint32_t trc_op_inputs(uint32_t op);
uint32_t trc_op_outputs(uint32_t op);

/* Values of an operation: constants when all inputs are, those of an equal operation if there is
 * one, else new ones. outputs has room for trc_op_outputs(op) and may overlap inputs.
 * OUT_OF_MEMORY, TOO_LARGE. (shading/fold.c) */
trc_status trc_build_op(struct trc_build *b, uint32_t op, uint32_t mode, uint32_t resource,
                        const struct trc_operand *inputs, struct trc_operand *outputs);
/* A TRC_OP_MATH; inputs that the mode does not read are ignored. (shading/fold.c) */
trc_status trc_build_math(struct trc_build *b, uint32_t mode, struct trc_operand x,
                          struct trc_operand y, struct trc_operand z, struct trc_operand *out);

/* Operands of an input of a value or shader node, converted to its kind; defaults are made, but for
 * normals and tangents of shader nodes, whose operands get TRC_REG_DEFAULT. (shading/lower.c) */
trc_status trc_build_input(struct trc_build *b, const trc_node *node, uint32_t index,
                           struct trc_operand *out);
/* The outputs of a procedural texture from its inputs, in floats as those of trc_build_input.
 * (shading/lower_texture.c) */
trc_status trc_build_texture(struct trc_build *b, const trc_node *node,
                             const struct trc_operand *in, struct trc_operand *out);
/* An operation of a point without inputs, at the point that nodes are lowered for.
 * (shading/lower.c)
 */
trc_status trc_build_point(struct trc_build *b, uint32_t code, uint32_t resource,
                           struct trc_operand *outputs);
/* Outputs of those value nodes before end that are wanted; NULL: all. (shading/lower.c) */
trc_status trc_build_nodes(struct trc_build *b, const uint8_t *wanted, uint32_t end);
/* The output of a Bump node from its inputs, in floats as those of trc_build_input.
 * (shading/lower_relief.c) */
trc_status trc_build_bump(struct trc_build *b, const trc_node *node, const struct trc_operand *in,
                          struct trc_operand *out);
/* The output of a displacement node, as above. (shading/lower_relief.c) */
trc_status trc_build_displacement(struct trc_build *b, const trc_node *node,
                                  const struct trc_operand *in, struct trc_operand *out);
/* The first DISPLACEMENT_OUTPUT, NULL without one. (shading/lower_relief.c) */
const trc_node *trc_displacement_of(const trc_material_desc *desc);
/* TRC_DISPLACEMENT_BUMP, TRUE or BOTH of such a node; BUMP for NULL. (shading/lower_relief.c) */
uint32_t trc_displacement_method_of(const trc_node *node);
/* Sets the normal by the displacement, before all that reads it; once room for outputs is made.
 * (shading/lower_relief.c) */
trc_status trc_build_relief(struct trc_build *b);
/* A program of the displacement alone: its vector is AOV 0. (shading/lower_relief.c) */
trc_status trc_build_offset(struct trc_build *b);
/* Room for the outputs of nodes. (shading/lower.c) */
trc_status trc_build_prepare(struct trc_build *b);
/* Whether an operation of the point reads its position. (shading/fold.c) */
bool trc_op_reads_position(uint32_t op);
/* Outputs of all value nodes. (shading/lower.c) */
trc_status trc_build_values(struct trc_build *b);
/* Leaves, their weights and operands. (shading/leaves.c) */
trc_status trc_build_leaves(struct trc_build *b);
/* Leaves become what goes straight through them. (shading/leaves.c) */
trc_status trc_build_shadow(struct trc_build *b);
/* Whether that is all that shadow rays meet of the leaf. (shading/leaves.c) */
bool trc_leaf_has_shadow(const struct trc_leaf *leaf);
/* AOVs and their operands, after the leaves. (shading/leaves.c) */
trc_status trc_build_aovs(struct trc_build *b);
/* has and emission, from the leaves and the live operations. (shading/traits.c) */
void trc_build_traits(const struct trc_build *b, struct trc_material *m);
/* Marks the operations that leaves and AOVs need. (shading/emit.c) */
trc_status trc_build_mark(struct trc_build *b);
/* Gives registers and fills the program, its tables and the leaves of m. (shading/emit.c) */
trc_status trc_build_emit(const struct trc_build *b, struct trc_material *m);

/* Makes room for needed elements of size bytes. OUT_OF_MEMORY. */
trc_status trc_build_reserve(void **array, uint32_t *capacity, uint32_t needed, size_t size);

#endif
