/* Refs to the triangles of parts: what a tree is built over. */
#ifndef TRACER_BVH_REFS_H
#define TRACER_BVH_REFS_H

#include "bvh/range.h"

/* Refs to the valid triangles of all parts, triangle_count with the others, in order, clustered
 * (bvh/cluster.h) and measured, by all threads. *memory_out, where they and their spare memory
 * stand, is the caller's to free; on an error nothing is. Cancelled, it is some of them: the build
 * that follows looks again. OUT_OF_MEMORY. */
trc_status trc_refs_collect(const struct trc_part *parts, uint32_t part_count,
                            uint64_t triangle_count, struct trc_pool *pool,
                            const atomic_uint *cancel, struct trc_ref **memory_out,
                            struct trc_range *all_out);

#endif
