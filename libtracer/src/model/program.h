/* Operations of material programs: what shading/compile.c emits and kernels/program/program.c runs.
 *
 * An operation reads floats and writes floats; a colour or vector is three of them. One definition
 * of each operation's meaning (kernels/program/) serves rendering at every width and, on the
 * scalar kernels, the folding of constants. */
#ifndef TRACER_MODEL_PROGRAM_H
#define TRACER_MODEL_PROGRAM_H

#include <stdbool.h>
#include <stdint.h>

#include "model/material.h"
#include "model/sockets.h"

/* Most inputs and outputs of an operation. */
#define TRC_OP_MAX_INPUTS 18
#define TRC_OP_MAX_OUTPUTS 9

/* trc_instruction.resource that names nothing: the default attribute, a missing image. */
#define TRC_NO_RESOURCE UINT32_MAX

enum trc_op {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) TRC_OP_##NAME,
#include "model/operations.def"
    TRC_OP_COUNT
};

#define TRC_IN(kind, name) TRC_FLOATS_##kind(name)
#define TRC_OUT(kind, name) TRC_FLOATS_##kind(name)
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) \
    struct trc_op_inputs_of_##NAME {                  \
        inputs float end;                             \
    };                                                \
    struct trc_op_outputs_of_##NAME {                 \
        outputs float end;                            \
    };
#include "model/operations.def"

/* Where an input or output stands among those of its operation, in floats; end: how many there are.
 */
#define TRC_OP_AT(OP, input) TRC_FLOATS_BEFORE(struct trc_op_inputs_of_##OP, input)
#define TRC_OP_OUT_AT(OP, output) TRC_FLOATS_BEFORE(struct trc_op_outputs_of_##OP, output)

/* TRC_OP_IMAGE and IMAGE_BOX: the alpha is used too, colours are divided by it. Besides
 * interpolation and extension; projections are operations of their own. */
#define TRC_IMAGE_MODE_ALPHA (1u << 4)

/* TRC_OP_CAMERA_POSITION: of the Texture Coordinate node, of Camera Data, which differ on lamps. */
enum { TRC_CAMERA_COORDINATES, TRC_CAMERA_DATA_POSITION };

enum { TRC_PROJECT_EQUIRECTANGULAR, TRC_PROJECT_MIRROR_BALL, TRC_PROJECT_SPHERE, TRC_PROJECT_TUBE };

/* TRC_OP_CURVE: the channel of the table, and straight on beyond its ends. */
#define TRC_CURVE_CHANNEL_MASK 3u
#define TRC_CURVE_EXTRAPOLATE 4u

/* Modes of TRC_OP_TRANSFORM; points are moved too, vectors only turned and scaled. */
enum {
    TRC_TRANSFORM_OBJECT_TO_WORLD,
    TRC_TRANSFORM_WORLD_TO_OBJECT,
    TRC_TRANSFORM_WORLD_TO_CAMERA,
    TRC_TRANSFORM_CAMERA_TO_WORLD,
    TRC_TRANSFORM_SPACES_MASK = 3,
    TRC_TRANSFORM_POINT = 4, /* bit */
    TRC_TRANSFORM_NORMAL = 8 /* bit: by the inverse transpose, unit; between world and object */
};

/* TRC_OP_BUMP: heights are in the lengths of the object. */
#define TRC_BUMP_IN_OBJECT (1u << 2)

/* TRC_OP_BESIDE: the direction; below it, the operation. */
#define TRC_BESIDE_Y (1u << 15)

/* Set where nothing reads the colour of an operation whose colour costs extra. */
#define TRC_MODE_NO_COLOR (1u << 15)

/* A last octave counts by the fraction. */
#define TRC_MAX_OCTAVES 16.0f

/* Whether the resource of an operation is a table. */
static inline bool trc_op_has_table(uint32_t op) { return op == TRC_OP_RAMP || op == TRC_OP_CURVE; }

#endif
