/* Runs the program of a material (model/program.h) for TRC_WIDTH shading points at once. */
#ifndef TRACER_KERNELS_PROGRAM_PROGRAM_H
#define TRACER_KERNELS_PROGRAM_PROGRAM_H

#include "kernels/trace/surface.h"
#include "model/kernels.h"
#include "model/program.h"

/* The registers of one run of a program. */
struct trc_registers {
    vfloat r[TRC_MAX_REGISTERS];
};

/* Runs the material's program, if it has one, for the active lanes. It may change the position
 * and the shading normal. (kernels/program/program.c) */
void trc_program_run(const struct trc_material *m, struct trc_surface *s,
                     struct trc_registers *regs);

/* How far vertices move, in the one-lane build alone. */
void trc_program_displace(const struct trc_displace_job *job);

TRC_INLINE vfloat trc_operand_value(const struct trc_operand *o, const struct trc_registers *regs) {
    return o->reg >= 0 ? regs->r[o->reg] : vf_set(o->value);
}
TRC_INLINE vvec3 trc_operand_vec3(const struct trc_operand *o, const struct trc_registers *regs) {
    return v3(trc_operand_value(o, regs), trc_operand_value(o + 1, regs),
              trc_operand_value(o + 2, regs));
}

/* Runs a pure operation once, in the one-lane build alone: out gets its outputs. table: if
 * trc_op_has_table. */
void trc_program_fold(uint32_t op, uint32_t mode, const float *table, const float *in, float *out);

#endif
