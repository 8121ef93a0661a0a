/* What the tests of material programs share: a program of one operation. */
#ifndef PROGRAM_TEST_H
#define PROGRAM_TEST_H

#include "wide_test.h"

#include <math.h>
#include <string.h>

#include "kernels/program/program.h"
#include "kernels/simd/wide_math.h"
#include "model/program.h"

#define PROGRAM_INLINE static inline __attribute__((unused))

/* A program of one operation on registers 0, 1, ...; the results go to register 100 and following.
 */
struct single {
    struct trc_material material;
    struct trc_instruction instruction;
    struct trc_operand operands[TRC_OP_MAX_INPUTS];
};
#define OUT 100

static const uint8_t op_input_counts[] __attribute__((unused)) = {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) TRC_OP_AT(NAME, end),
#include "model/operations.def"
};
static const uint8_t op_output_counts[] __attribute__((unused)) = {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) TRC_OP_OUT_AT(NAME, end),
#include "model/operations.def"
};
static const char *const op_names[] __attribute__((unused)) = {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) #NAME,
#include "model/operations.def"
};

PROGRAM_INLINE void single_init(struct single *p, uint32_t op, uint32_t mode, uint32_t resource) {
    memset(p, 0, sizeof *p);
    p->instruction = (struct trc_instruction){.op = (uint16_t)op,
                                              .mode = (uint16_t)mode,
                                              .out = OUT,
                                              .input_count = op_input_counts[op],
                                              .resource = resource};
    for (int i = 0; i < TRC_OP_MAX_INPUTS; i++)
        p->operands[i].reg = i;
    p->material.operands = p->operands;
    p->material.instructions = &p->instruction;
    p->material.instruction_count = 1;
    p->material.register_count = OUT + TRC_OP_MAX_OUTPUTS;
}

PROGRAM_INLINE bool is_near(float value, float expected, float relative) {
    if (isinf(expected))
        return value == expected;
    return fabsf(value - expected) <= relative * fmaxf(fabsf(expected), 1.0f);
}

#endif
