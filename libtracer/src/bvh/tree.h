/* The memory of a tree: 8-wide nodes and leaves of up to 8 triangles, with bounds and vertices at
 * every motion key.
 *
 * A node is TRC_NODE_HEADER_BYTES of header (8 child references) followed, for each key, by 48
 * floats: for each axis 8 lower bounds, then 8 upper ones. Unused children have inverted infinite
 * bounds. A leaf is a header (8 instance words, 8 triangle numbers) followed, for each key, by 72
 * floats: vertex by axis by slot. Unused slots repeat the last triangle, with number
 * TRC_EMPTY_SLOT. Nodes stand before their children, so that a backward walk refits.
 *
 * A TLAS has the same nodes; its leaves have no vertices: each is one entry of items. */
#ifndef TRACER_BVH_TREE_H
#define TRACER_BVH_TREE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "scene/snapshot.h"

#define TRC_NODE_WIDTH 8
#define TRC_NODE_HEADER_BYTES 64
#define TRC_NODE_KEY_BYTES 192
#define TRC_LEAF_HEADER_BYTES 64
#define TRC_LEAF_KEY_BYTES 288

/* A reference: a node's index, or a leaf's with TRC_REF_LEAF and its count - 1 in bits 28-30. */
#define TRC_REF_LEAF 0x80000000u
#define TRC_REF_INDEX_MASK 0x0fffffffu
#define TRC_REF_EMPTY 0xffffffffu
#define TRC_EMPTY_SLOT 0xffffffffu

/* Instance word of a leaf slot: the instance's index, and a bit for materials that shadow rays may
 * see through. */
#define TRC_SLOT_TRANSPARENT 0x80000000u
#define TRC_SLOT_INSTANCE_MASK 0x7fffffffu

/* Deepest level a builder makes: binary splits are forced to the middle well before it. A traversal
 * pushes at most 7 entries a level. */
#define TRC_MAX_LEVELS 48
#define TRC_STACK_SIZE (TRC_MAX_LEVELS * (TRC_NODE_WIDTH - 1) + 1)

struct trc_tree;

/* What a TLAS leaf stands for. */
struct trc_item {
    const struct trc_tree *tree;
    uint32_t instance; /* into the snapshot's instances; TRC_NO_HIT: the joined world-space tree */
    uint32_t visibility; /* TRC_VISIBLE_* */
};

struct trc_tree {
    uint32_t key_count;
    uint32_t node_count, leaf_count;
    uint32_t root; /* reference; TRC_REF_EMPTY for no triangles */
    size_t node_stride, leaf_stride;
    uint8_t *nodes;               /* node_count * node_stride, 64-byte aligned */
    uint8_t *leaves;              /* leaf_count * leaf_stride */
    const struct trc_item *items; /* TLAS only, by leaf index */
    bool is_top;
    bool has_transparent;     /* some slot has TRC_SLOT_TRANSPARENT */
    float lower[3], upper[3]; /* over all keys; lower > upper when empty */
    float extent;             /* largest |coordinate| of the bounds: scale of rounding errors */
    uint64_t triangle_count, skipped_count;
    float sah_cost;
    uint64_t bytes;
};

/* A tree shared between snapshots. */
struct trc_blas {
    atomic_uint refs;
    const struct trc_mesh
        *mesh;        /* identity only: compared while the snapshot that holds it lives */
    float built_cost; /* SAH cost when last built, to judge refits */
    struct trc_tree tree;
};

struct trc_bvh {
    const struct trc_tree *tree; /* the TLAS, or the joined tree when it is all there is */
    struct trc_tree top, joined;
    struct trc_item *items;
    struct trc_blas **blas; /* per snapshot mesh, NULL where only the joined tree has it */
    uint32_t blas_count;
};

static inline const uint32_t *trc_node_children(const struct trc_tree *t, uint32_t node) {
    return (const uint32_t *)(t->nodes + (size_t)node * t->node_stride);
}
/* 48 floats: [axis][lower, upper][child]. */
static inline const float *trc_node_bounds(const struct trc_tree *t, uint32_t node, uint32_t key) {
    return (const float *)(t->nodes + (size_t)node * t->node_stride + TRC_NODE_HEADER_BYTES +
                           (size_t)key * TRC_NODE_KEY_BYTES);
}
static inline const uint32_t *trc_leaf_instances(const struct trc_tree *t, uint32_t leaf) {
    return (const uint32_t *)(t->leaves + (size_t)leaf * t->leaf_stride);
}
static inline const uint32_t *trc_leaf_triangles(const struct trc_tree *t, uint32_t leaf) {
    return trc_leaf_instances(t, leaf) + TRC_NODE_WIDTH;
}
/* 72 floats: [vertex][axis][slot]. */
static inline const float *trc_leaf_vertices(const struct trc_tree *t, uint32_t leaf,
                                             uint32_t key) {
    return (const float *)(t->leaves + (size_t)leaf * t->leaf_stride + TRC_LEAF_HEADER_BYTES +
                           (size_t)key * TRC_LEAF_KEY_BYTES);
}

/* ---- building (bvh/build.c, bvh/fill.c) ---- */

struct trc_pool;

/* One primitive for the builder: its box (of a moving one: the mean over the keys). */
struct trc_ref {
    float lower[3];
    uint32_t part; /* index of the part, see below; TLAS: unused */
    float upper[3];
    uint32_t primitive; /* triangle of the part's mesh; TLAS: item */
};

/* A mesh as it stands in a tree. */
struct trc_part {
    const struct trc_mesh *mesh;
    uint32_t instance;                  /* instance word without flags; 0 for a shared BLAS */
    const struct trc_affine *transform; /* NULL: object space */
    const uint8_t *transparent;         /* per material slot of the instance, or NULL: none */
    uint32_t slot_count;
};

/* Shape of the tree over refs (reordered): nodes without bounds, leaves as ranges of refs. */
struct trc_topology {
    uint32_t node_count, leaf_count;
    uint32_t root;
    uint32_t (*children)[TRC_NODE_WIDTH]; /* node_count */
    uint32_t *leaf_begin;                 /* leaf_count: first ref; the count is in the reference */
};

/* Binned SAH (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007), opened
 * to 8 children by largest area. leaf_size: most refs of a leaf, 1..8. Same result for any thread
 * count. */
trc_status trc_topology_build(struct trc_ref *refs, uint32_t count, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_topology *out);
void trc_topology_destroy(struct trc_topology *topology);

/* Vertex v of a triangle at a key, as it stands in the tree (transformed if the part is). */
void trc_part_vertex(const struct trc_part *part, uint32_t triangle, uint32_t v, uint32_t key,
                     float out[3]);

/* All three, as a leaf holds them: corners on a line (of meshes at rest) become one point, which no
 * ray hits, where rounding would give them an area. */
void trc_part_triangle(const struct trc_part *part, uint32_t triangle, uint32_t key,
                       float out[3][3]);

/* Takes memory for a tree of that shape and copies leaves and vertices; then trc_tree_bound. */
trc_status trc_tree_fill(const struct trc_topology *topology, const struct trc_ref *refs,
                         const struct trc_part *parts, uint32_t key_count, struct trc_pool *pool,
                         struct trc_tree *tree);

/* The same tree with other positions of the same topology: a copy of *from, refilled and bounded.
 */
trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, struct trc_tree *tree);

/* A TLAS: leaf i stands for items[refs[topology leaf i].primitive], whose world box is its ref's.
 */
trc_status trc_tree_fill_top(const struct trc_topology *topology, const struct trc_ref *refs,
                             const struct trc_item *items, struct trc_item *items_out,
                             struct trc_tree *tree);

/* Bounds of all nodes from the leaves, all keys in one pass, and the SAH cost. */
void trc_tree_bound(struct trc_tree *tree, struct trc_pool *pool);

void trc_tree_destroy(struct trc_tree *tree);

#endif
