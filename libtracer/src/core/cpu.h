/* Instruction sets of the processor. */
#ifndef TRACER_CORE_CPU_H
#define TRACER_CORE_CPU_H

#include <stdbool.h>
#include <stdint.h>

/* Whether processor and operating system offer a TRC_ISA_*; false for TRC_ISA_AUTO and unknown
 * ones. */
bool trc_cpu_has(uint32_t isa);

#endif
