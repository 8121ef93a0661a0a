/* Refs to the triangles of parts: what a tree is built over. */
#ifndef TRACER_BVH_REFS_H
#define TRACER_BVH_REFS_H

#include "bvh/tree.h"

/* What a tree is built over, and how much it is. */
struct trc_refs {
    struct trc_ref *memory;  /* of refs and their spare memory */
    struct trc_range all;    /* triangles: those in several refs once for each */
    uint32_t triangle_count; /* that are valid */
    uint32_t thin_count;     /* valid pieces of curves that are left out for want of a radius */
    bool is_clipped;         /* some boxes hold a part of their triangles */
};

/* Refs to the valid triangles of all parts, triangle_count with the others, in order, clustered
 * (bvh/cluster.h), clipped where they should be (bvh/clip.h: an eighth more triangles at most) and
 * measured, by all threads. out->memory is the caller's to free; on an error there is none.
 * Cancelled, it is some of them: the build that follows looks again. OUT_OF_MEMORY. */
trc_status trc_refs_collect(const struct trc_part *parts, uint32_t part_count,
                            uint64_t triangle_count, bool clips, struct trc_pool *pool,
                            const atomic_uint *cancel, struct trc_refs *out);

#endif
