/* What fills a new tree, and its leaves with slots and vertices. */
#ifndef TRACER_BVH_LEAF_H
#define TRACER_BVH_LEAF_H

#include "bvh/part.h"

struct trc_fill {
    /* What stands where: as in a tree that is refitted, all of parts[0], or by a topology, with
     * triangles by slot. */
    const struct trc_tree *from;
    const struct trc_topology *topology;
    const struct trc_part_triangle *triangles;
    const struct box *boxes; /* of clipped leaves, by their first slot, or NULL */
    const struct trc_part *parts;
    struct trc_tree *tree;
    const struct trc_slot_vertices *known; /* or NULL: asked of the mesh */
    struct trc_slot_vertices *learnt;      /* or NULL: not kept */
    const atomic_uint *cancel;             /* may be NULL */
    uint8_t *pending;                      /* per node: its box waits for nodes of other tasks */
    double *area_sums;                     /* per task: areas of the boxes that it set */
    atomic_bool spoiled;                   /* a coordinate is not finite */
    atomic_bool has_transparent;           /* slots; of a new tree */
};

/* What of a leaf does not depend on the key: what a new tree's slots stand for, what a refit learns
 * of them. */
void trc_leaf_prepare(struct trc_fill *fill, uint32_t ref);

/* Fills the leaf at a key and gives its box; false if a coordinate is not finite: the box ignores
 * NaN. */
bool trc_leaf_fill(const struct trc_fill *fill, uint32_t ref, uint32_t key, float lower_out[3],
                   float upper_out[3]);

/* Asks for memory that will be written. */
#define TRC_CACHE_LINE 64
static inline void trc_fetch(const void *begin, size_t bytes) {
    for (size_t i = 0; i < bytes; i += TRC_CACHE_LINE)
        __builtin_prefetch((const char *)begin + i, 1);
}

#endif
