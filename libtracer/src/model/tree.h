/* The memory of a tree: 8-wide nodes and leaves of 1 to 8 triangles, with bounds and vertices at
 * every motion key.
 *
 * A node is 8 child references followed by 48 floats: for each axis 8 lower bounds, then 8 upper
 * ones. It lies in four cache lines, whether it begins with one or in the middle of one. Unused
 * children have inverted infinite bounds. In moving trees the bounds of each key are bytes, and two
 * keys lie in three lines. Nodes stand before their children, so that a backward walk refits.
 *
 * Triangles stand in slots, those of a leaf side by side: its reference has the first and the
 * count. A leaf of n has 9 n floats: vertex by axis by slot, without gaps between leaves, since
 * fetching leaves is a good part of an incoherent ray's time. Kernels load 8 slots whatever the
 * count and ignore the lanes beyond it; after the last leaf there is room for that. What a hit
 * needs to know of a slot is kept apart.
 *
 * In moving trees the triangles of a leaf share their vertices, each of which is there once for
 * each key: the leaf's reference has the place of its block instead, which has the first slot.
 *
 * All of that is the same for every instruction set, whatever its width, to the bit: trees serve
 * each of them.
 *
 * Leaves of curves have slots alone: what they stand for is read from the vertices, which pieces
 * share: x, y, z and radius of each at the first key, then at the next.
 *
 * A TLAS has the same nodes; its leaves have no vertices: each is one entry of items. */
#ifndef TRACER_MODEL_TREE_H
#define TRACER_MODEL_TREE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "model/snapshot.h"

#define TRC_NODE_WIDTH 8
#define TRC_NODE_CHILDREN_BYTES 32
#define TRC_NODE_BOUNDS_BYTES 192 /* at rest */
#define TRC_TRIANGLE_FLOATS 9
#define TRC_NODE_ALIGNMENT 64 /* of moving trees */

/* A reference: a node's index, or a leaf's first slot (where it has a block, the place of that in
 * units of TRC_BLOCK_UNIT) with TRC_REF_LEAF and its count - 1 in bits 28-30. */
#define TRC_REF_LEAF 0x80000000u
#define TRC_REF_INDEX_MASK 0x0fffffffu
#define TRC_REF_EMPTY 0xffffffffu

/* Instance word of a slot: the instance's index, and a bit for materials that shadow rays may
 * see through. */
#define TRC_SLOT_TRANSPARENT 0x80000000u
#define TRC_SLOT_INSTANCE_MASK 0x7fffffffu

/* Deepest level a builder makes: splits are forced to the middle where the levels left would not do
 * otherwise. A traversal pushes at most 7 entries a level. */
#define TRC_MAX_LEVELS 48
#define TRC_STACK_SIZE (TRC_MAX_LEVELS * (TRC_NODE_WIDTH - 1) + 1)

/* Instance word of a slot in a tree of curves: transparency as above, the strand, and whether the
 * piece begins or ends it. Its first vertex is the number of the piece plus that of the strand. */
#define TRC_SLOT_FIRST 0x40000000u
#define TRC_SLOT_LAST 0x20000000u
#define TRC_SLOT_STRAND_MASK 0x1fffffffu

#define TRC_CURVE_VERTEX_FLOATS 4

struct trc_tree;

/* Bounds of a moving tree's node at a key: origin + step * byte along each axis, [lower, upper] by
 * child; of no child 255, 0. Kernels widen them by what rounding moves them (TRC_UNPACK_SLACK). */
struct trc_packed_boxes {
    float origin[3], step[3];
    uint8_t bytes[3][2][TRC_NODE_WIDTH];
};

/* A leaf of a moving tree of triangles, at a multiple of TRC_BLOCK_UNIT bytes: corners has for each
 * of three corners and each triangle the number of its vertex; from the next multiple of 4 bytes on
 * there are for each key the x of all vertices, y, and z. Kernels load TRC_BLOCK_LOAD vertices at
 * once, and 8 corners; where there are more vertices, each corner has its own, in order. */
#define TRC_BLOCK_UNIT 16
#define TRC_BLOCK_LOAD 16
#define TRC_BLOCK_VERTICES (3 * TRC_NODE_WIDTH) /* at most */
struct trc_block {
    uint32_t first_slot;
    uint8_t vertex_count;
    uint8_t corners[]; /* [3][triangles] */
};

struct trc_slot {
    uint32_t instance; /* word, see above */
    uint32_t triangle; /* of the mesh */
};

/* What a TLAS leaf stands for. */
struct trc_item {
    const struct trc_tree *tree;
    uint32_t instance; /* into the snapshot's instances; TRC_NO_HIT: the joined world-space tree */
    uint32_t visibility; /* TRC_VISIBLE_* */
};

/* The slots of a tree and its refits. */
struct trc_slot_block {
    atomic_uint refs;
    struct trc_slot slots[];
};

/* Vertices of the triangle in each slot, in the order in which refits meet them: without it, when
 * they are asked of the mesh, a refit takes a fifth longer. Of a block those of its vertices, side
 * by side from its first slot on. */
struct trc_slot_vertices {
    atomic_uint refs;
    uint32_t index[][3];
};

struct trc_tree {
    uint32_t key_count;
    uint32_t node_count, slot_count;
    uint32_t root; /* reference; TRC_REF_EMPTY for no triangles */
    size_t node_stride;
    uint8_t *nodes;                          /* node_count * node_stride, 32-byte aligned */
    float *vertices;                         /* slot_count * 9, and a load beyond; blocks;
                                                curves: key by key vertex_count * 4 */
    size_t vertex_floats;                    /* without the load beyond */
    struct trc_slot_block *slots;            /* slot_count; TLAS: NULL, as vertices are */
    struct trc_slot_vertices *slot_vertices; /* shared by refits of one tree; or NULL */
    const struct trc_item *items;            /* TLAS only, by slot */
    /* Per node the bits of children below which there is nothing but what is transparent to shadow
     * rays, and of no children; NULL: there is nothing of it. */
    uint8_t *see_through;
    bool is_see_through; /* all of the tree is */
    bool is_top;
    uint32_t shape;           /* TRC_SHAPE_* of what is in its leaves */
    uint32_t vertex_count;    /* curves */
    bool has_pieces;          /* a triangle may stand in several leaves (bvh/clip.h) */
    float lower[3], upper[3]; /* over all keys; lower > upper when empty */
    float extent;             /* largest |coordinate| of the bounds: scale of rounding errors */
    uint64_t triangle_count, skipped_count;
    uint64_t thin_count; /* skipped pieces of curves that are valid, but have no radius */
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
    /* Per material slot whether the tree has it as transparent to shadow rays; NULL and 0: none. */
    uint8_t *transparent;
    uint32_t transparent_count;
};

/* The tree of one instance, in world space: of a thin one, or of one that would be joined but for
 * what has changed. */
struct trc_own_tree {
    struct trc_blas blas; /* first: it is released as one */
    uint32_t key_count;   /* of the instance, whose transforms follow */
    struct trc_affine transforms[];
};

/* The tree over all joined instances, in world space, shared between snapshots. */
struct trc_joined_tree {
    atomic_uint refs;
    struct trc_tree tree;
};

struct trc_bvh {
    const struct trc_tree *tree; /* the TLAS, or the joined tree when it is all there is */
    struct trc_tree top;
    struct trc_joined_tree *joined; /* NULL: nothing is */
    struct trc_item *items;
    struct trc_blas **blas; /* per snapshot mesh, NULL where only the joined tree has it */
    uint32_t blas_count;
    /* Per snapshot instance; NULL where it has none, or none has. */
    struct trc_own_tree **own;
    uint8_t *is_joined; /* per snapshot instance */
    uint32_t instance_count;
};

static inline const uint32_t *trc_node_children(const struct trc_tree *t, uint32_t node) {
    return (const uint32_t *)(t->nodes + (size_t)node * t->node_stride);
}
/* 48 floats of a tree at rest: [axis][lower, upper][child]. */
static inline const float *trc_node_bounds(const struct trc_tree *t, uint32_t node) {
    return (const float *)(t->nodes + (size_t)node * t->node_stride + TRC_NODE_CHILDREN_BYTES);
}
/* Of a moving tree; the next key's follow. */
static inline const struct trc_packed_boxes *trc_node_packed(const struct trc_tree *t,
                                                             uint32_t node, uint32_t key) {
    return (const struct trc_packed_boxes *)(t->nodes + (size_t)node * t->node_stride +
                                             TRC_NODE_CHILDREN_BYTES) +
           key;
}
/* Whether the tree's leaves are blocks: it moves, and has triangles. */
static inline bool trc_tree_has_blocks(const struct trc_tree *t) {
    return t->key_count > 1 && !t->shape;
}
/* Of a leaf, not of a node or no child. */
static inline bool trc_ref_is_leaf(uint32_t ref) {
    return ref != TRC_REF_EMPTY && (ref & TRC_REF_LEAF);
}
static inline uint32_t trc_ref_index(uint32_t ref) { return ref & TRC_REF_INDEX_MASK; }
static inline uint32_t trc_leaf_count(uint32_t ref) { return ((ref >> 28) & 7u) + 1u; }
static inline uint32_t trc_leaf_ref(uint32_t index, uint32_t count) {
    return TRC_REF_LEAF | (count - 1) << 28 | index;
}
static inline struct trc_block *trc_leaf_block(const struct trc_tree *t, uint32_t ref) {
    return (struct trc_block *)((uint8_t *)t->vertices +
                                (size_t)TRC_BLOCK_UNIT * trc_ref_index(ref));
}
/* A leaf's first slot, of any tree; kernels know which kind theirs is. */
static inline uint32_t trc_leaf_first(const struct trc_tree *t, uint32_t ref) {
    return trc_tree_has_blocks(t) ? trc_leaf_block(t, ref)->first_slot : trc_ref_index(ref);
}
/* Of a leaf without a block. */
static inline const struct trc_slot *trc_leaf_slots(const struct trc_tree *t, uint32_t ref) {
    return t->slots->slots + trc_ref_index(ref);
}
/* 9 * count floats of a tree at rest: [vertex][axis][slot]. */
static inline float *trc_leaf_vertices(const struct trc_tree *t, uint32_t ref) {
    return t->vertices + TRC_TRIANGLE_FLOATS * (size_t)trc_ref_index(ref);
}
/* Bytes of a block before its vertices. */
static inline size_t trc_block_head_bytes(uint32_t triangles) {
    return (offsetof(struct trc_block, corners) + 3 * triangles + 3) / 4 * 4;
}
/* The x of a block's vertices at a key, behind which are y and z. */
static inline float *trc_block_rows(const struct trc_block *b, uint32_t triangles, uint32_t key) {
    return (float *)((uint8_t *)b + trc_block_head_bytes(triangles)) +
           3 * (size_t)b->vertex_count * key;
}

#endif
