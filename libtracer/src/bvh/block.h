/* Blocks: leaves of moving trees, whose triangles share their vertices (model/tree.h). */
#ifndef TRACER_BVH_BLOCK_H
#define TRACER_BVH_BLOCK_H

#include "bvh/leaf.h"

/* The blocks of a tree that is to be filled, by the first slots of their leaves. */
struct trc_block_plan {
    uint32_t *places; /* in units of TRC_BLOCK_UNIT */
    uint8_t *heads;   /* from 4 * slot on: how many vertices, and the corners */
    struct trc_slot_vertices *vertices;
    uint32_t unit_count; /* of all blocks */
};

/* Plans the blocks of what fill is filled from. Destroy the plan, too, where it fails:
 * OUT_OF_MEMORY, TOO_LARGE. */
trc_status trc_block_plan_make(const struct trc_fill *fill, uint32_t node_count, uint32_t root,
                               uint32_t slot_count, uint32_t key_count, struct trc_pool *pool,
                               struct trc_block_plan *plan);
void trc_block_plan_destroy(struct trc_block_plan *plan);

/* All of a leaf's block but its vertices. from: its reference in what is filled from. */
void trc_block_begin(const struct trc_fill *fill, uint32_t from, uint32_t ref);

/* What of a leaf does not depend on the key; returns its vertices in the mesh, by their number in
 * the block: in memory, or known before. */
const uint32_t *trc_block_prepare(struct trc_fill *fill, uint32_t ref,
                                  uint32_t memory[TRC_BLOCK_VERTICES]);

/* As trc_leaf_fill, with those vertices. */
bool trc_block_fill(const struct trc_fill *fill, uint32_t ref, const uint32_t *vertices,
                    uint32_t key, float lower_out[3], float upper_out[3]);

#endif
