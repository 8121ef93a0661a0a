/* trc_kernels.split_find and split_apply: see there. */
#ifndef TRACER_KERNELS_TRACE_SPLIT_H
#define TRACER_KERNELS_TRACE_SPLIT_H

#include "kernels/simd/simd.h"
#include "model/split.h"

void trc_split_find(struct trc_split_blocks *blocks, const struct trc_range *r,
                    struct trc_split *out);
void trc_split_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                     const struct trc_split *s, struct trc_range *left, struct trc_range *right);

#endif
