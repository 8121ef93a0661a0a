/* What fills a new tree, and its leaves with slots and vertices. */
#ifndef TRACER_BVH_LEAF_H
#define TRACER_BVH_LEAF_H

#include "bvh/part.h"

struct trc_block_plan; /* bvh/block.h */

struct trc_fill {
    /* What stands where: as in a tree that is refitted, all of parts[0], or by a topology, with
     * triangles by slot. */
    const struct trc_tree *from;
    const struct trc_topology *topology;
    const struct trc_part_triangle *triangles;
    const struct box *boxes; /* of clipped leaves, by their first slot, or NULL */
    const struct trc_part *parts;
    struct trc_tree *tree;
    const struct trc_block_plan *plan;     /* of blocks; NULL: none, or as in from */
    const struct trc_slot_vertices *known; /* or NULL: asked of the mesh */
    struct trc_slot_vertices *learnt;      /* or NULL: not kept */
    const atomic_uint *cancel;             /* may be NULL */
    uint8_t *pending;                      /* per node: its box waits for nodes of other tasks */
    double *area_sums;                     /* per task: areas of the boxes that it set */
    atomic_bool spoiled;                   /* a coordinate is not finite */
    atomic_bool has_transparent;           /* slots; of a new tree */
};

/* Nodes whose leaves one task fills: large enough that handing out tasks costs nothing. */
#define TRC_FILL_NODES 256
static inline uint32_t trc_fill_tasks(uint32_t node_count) {
    return (node_count + TRC_FILL_NODES - 1) / TRC_FILL_NODES;
}

/* References of a node, in what is filled from. */
static inline const uint32_t *trc_fill_children(const struct trc_fill *fill, uint32_t node) {
    return fill->from ? trc_node_children(fill->from, node) : fill->topology->children[node];
}
/* The first slot of a leaf there, and what triangle of its part stands in a slot. */
static inline uint32_t trc_fill_first(const struct trc_fill *fill, uint32_t ref) {
    return fill->from ? trc_leaf_first(fill->from, ref) : trc_ref_index(ref);
}
static inline uint32_t trc_fill_triangle(const struct trc_fill *fill, uint32_t slot) {
    return fill->from ? fill->from->slots->slots[slot].triangle : fill->triangles[slot].triangle;
}

/* What of a leaf does not depend on the key: what a new tree's slots stand for, and, without a
 * block, what a refit learns of them. */
void trc_leaf_prepare(struct trc_fill *fill, uint32_t ref);

/* Fills the leaf, which has no block, at a key and gives its box; false if a coordinate is not
 * finite: the box ignores NaN. */
bool trc_leaf_fill(const struct trc_fill *fill, uint32_t ref, uint32_t key, float lower_out[3],
                   float upper_out[3]);

/* With one reference; NULL: out of memory. */
struct trc_slot_vertices *trc_slot_vertices_alloc(uint32_t slot_count);
void trc_slot_vertices_release(struct trc_slot_vertices *vertices); /* NULL: nothing */

/* Asks for memory that will be written. */
#define TRC_CACHE_LINE 64
static inline void trc_fetch(const void *begin, size_t bytes) {
    for (size_t i = 0; i < bytes; i += TRC_CACHE_LINE)
        __builtin_prefetch((const char *)begin + i, 1);
}

#endif
