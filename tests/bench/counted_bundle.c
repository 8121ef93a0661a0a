/* The counting kernels of bundles: see counted.c. */
#undef TRC_ISA
#define TRC_ISA counted

#include "counted.h"

#define TRC_COUNT(what, amount) (counted_steps.what += (uint64_t)(amount))
#include "kernels/trace/trace_bundle.c"
