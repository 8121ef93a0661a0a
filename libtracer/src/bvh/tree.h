/* Building, filling and refitting the memory of a tree (model/tree.h). */
#ifndef TRACER_BVH_TREE_H
#define TRACER_BVH_TREE_H

#include <stdatomic.h>
#include <stdint.h>

#include "model/range.h"
#include "model/tree.h"

struct trc_pool; /* core/pool.h */

/* What stands in a slot; TLAS: triangle is the item. The first slot of a clipped leaf has
 * TRC_PART_CLIPPED. */
struct trc_part_triangle {
    uint32_t part, triangle;
};

/* A mesh as it stands in a tree. */
struct trc_part {
    const struct trc_mesh *mesh;
    uint32_t instance;                  /* instance word without flags; 0 for a shared BLAS */
    const struct trc_affine *transform; /* NULL: object space */
    const uint8_t *transparent;         /* per material slot of the instance, or NULL: none */
    uint32_t slot_count;
};

/* Shape of a tree: nodes without bounds. */
struct trc_topology {
    uint32_t node_count;
    uint32_t root;
    uint32_t (*children)[TRC_NODE_WIDTH]; /* node_count */
};

/* Binned SAH (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007) over
 * measured refs, which are used up with their spare memory, as 8-wide nodes of the least cost
 * (bvh/binary.h): triangles_out gets what stands in the slots, boxes_out at the first slots of
 * clipped leaves their boxes (NULL where no ref is clipped). leaf_size: most triangles of a leaf,
 * 1..8. Same result for any thread count. OUT_OF_MEMORY, TOO_LARGE or CANCELLED. */
trc_status trc_topology_build(const struct trc_range *all, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_part_triangle *triangles_out, struct box *boxes_out,
                              struct trc_topology *out);
void trc_topology_destroy(struct trc_topology *topology);

/* A tree of that shape, whose leaves are ranges of count slots, with its vertices, bounds and SAH
 * cost. boxes: at the first slots of clipped leaves what they do not reach beyond, since what their
 * triangles have there stands in other leaves, or NULL. */
trc_status trc_tree_fill(const struct trc_topology *topology,
                         const struct trc_part_triangle *triangles, const struct box *boxes,
                         uint32_t count, const struct trc_part *parts, uint32_t key_count,
                         struct trc_pool *pool, const atomic_uint *cancel, struct trc_tree *tree);

/* The same tree with other positions of the same topology: a copy of *from, refilled and bounded.
 * Its extent is infinite if a position is not finite. */
trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, const atomic_uint *cancel,
                          struct trc_tree *tree);

/* A TLAS over count items with their world boxes; order: the item of each slot. */
trc_status trc_tree_fill_top(const struct trc_topology *topology,
                             const struct trc_part_triangle *order, uint32_t count,
                             const struct trc_item *items, const struct box *boxes,
                             struct trc_item *items_out, struct trc_tree *tree);

void trc_tree_destroy(struct trc_tree *tree);

#endif
