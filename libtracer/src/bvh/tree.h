/* The memory of a tree: 8-wide nodes and leaves of 1 to 8 triangles, with bounds and vertices at
 * every motion key.
 *
 * A node is 8 child references followed, for each key, by 48 floats: for each axis 8 lower bounds,
 * then 8 upper ones. It lies in four cache lines, in motion in seven, whether it begins with one or
 * in the middle of one. Unused children have inverted infinite bounds. Nodes stand before their
 * children, so that a backward walk refits.
 *
 * Triangles stand in slots, those of a leaf side by side: its reference has the first and the
 * count. A leaf of n has, for each key, 9 n floats: vertex by axis by slot, without gaps between
 * leaves, since fetching leaves is a good part of an incoherent ray's time. Kernels load 8 slots
 * whatever the count and ignore the lanes beyond it; after the last leaf there is room for that.
 * What a hit needs to know of a slot is kept apart.
 *
 * All of that is the same for every instruction set, whatever its width, to the bit: trees serve
 * each of them.
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
#define TRC_NODE_CHILDREN_BYTES 32
#define TRC_NODE_KEY_BYTES 192
#define TRC_TRIANGLE_FLOATS 9

/* A reference: a node's index, or a leaf's first slot with TRC_REF_LEAF and its count - 1 in bits
 * 28-30. */
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

struct box; /* core/box.h */
struct trc_tree;

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
 * they are asked of the mesh, a refit takes a fifth longer. */
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
    float *vertices;                         /* slot_count * key_count * 9, and a load beyond */
    struct trc_slot_block *slots;            /* slot_count; TLAS: NULL, as vertices are */
    struct trc_slot_vertices *slot_vertices; /* shared by refits of one tree; or NULL */
    const struct trc_item *items;            /* TLAS only, by slot */
    bool is_top;
    bool has_transparent;     /* some slot has TRC_SLOT_TRANSPARENT */
    bool has_pieces;          /* a triangle may stand in several leaves (bvh/clip.h) */
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

/* The tree of a thin instance, in world space. */
struct trc_thin {
    struct trc_blas blas; /* first: it is released as one */
    uint32_t key_count;   /* of the instance, whose transforms follow */
    struct trc_affine transforms[];
};

struct trc_bvh {
    const struct trc_tree *tree; /* the TLAS, or the joined tree when it is all there is */
    struct trc_tree top, joined;
    struct trc_item *items;
    struct trc_blas **blas; /* per snapshot mesh, NULL where only the joined tree has it */
    uint32_t blas_count;
    struct trc_thin **thin; /* per snapshot instance, NULL where it is not thin or is joined; NULL
                               where none has one */
    uint32_t thin_count;
};

static inline const uint32_t *trc_node_children(const struct trc_tree *t, uint32_t node) {
    return (const uint32_t *)(t->nodes + (size_t)node * t->node_stride);
}
/* 48 floats: [axis][lower, upper][child]. */
static inline const float *trc_node_bounds(const struct trc_tree *t, uint32_t node, uint32_t key) {
    return (const float *)(t->nodes + (size_t)node * t->node_stride + TRC_NODE_CHILDREN_BYTES +
                           (size_t)key * TRC_NODE_KEY_BYTES);
}
static inline uint32_t trc_leaf_first(uint32_t ref) { return ref & TRC_REF_INDEX_MASK; }
static inline const struct trc_slot *trc_leaf_slots(const struct trc_tree *t, uint32_t ref) {
    return t->slots->slots + trc_leaf_first(ref);
}
static inline uint32_t trc_leaf_count(uint32_t ref) { return ((ref >> 28) & 7u) + 1u; }
static inline uint32_t trc_leaf_ref(uint32_t first, uint32_t count) {
    return TRC_REF_LEAF | (count - 1) << 28 | first;
}
/* 9 * count floats: [vertex][axis][slot]; the next key's follow. */
static inline float *trc_leaf_vertices(const struct trc_tree *t, uint32_t ref, uint32_t key) {
    return t->vertices + TRC_TRIANGLE_FLOATS * ((size_t)trc_leaf_first(ref) * t->key_count +
                                                (size_t)key * trc_leaf_count(ref));
}

/* ---- building (bvh/build.c, bvh/fill.c) ---- */

struct trc_pool;

/* One primitive for the builder: its box (of a moving one: the mean over the keys). */
struct trc_ref {
    float lower[3];
    uint32_t part; /* index of the part, see below, and TRC_PART_CLIPPED; TLAS: unused */
    float upper[3];
    /* First triangle of the part's mesh, and in bits 28-31 how many follow it (bvh/cluster.h);
     * TLAS: item. */
    uint32_t primitive;
};
#define TRC_REF_NEXT 0x10000000u
static inline uint32_t trc_ref_first(const struct trc_ref *r) {
    return r->primitive & (TRC_REF_NEXT - 1);
}
static inline uint32_t trc_ref_count(const struct trc_ref *r) {
    return r->primitive / TRC_REF_NEXT + 1;
}

/* In the place of a part: what stands there has a smaller box than its triangles (bvh/clip.h). */
#define TRC_PART_CLIPPED 0x80000000u
#define TRC_PART_INDEX_MASK 0x7fffffffu

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

struct trc_range; /* bvh/range.h */

/* Binned SAH (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007) over
 * measured refs, which are used up, as 8-wide nodes of the least cost (bvh/binary.h): triangles_out
 * gets what stands in the slots, boxes_out at the first slots of clipped leaves their boxes (NULL
 * where no ref is clipped). leaf_size: most triangles of a leaf, 1..8. Same result for any thread
 * count. OUT_OF_MEMORY, TOO_LARGE or CANCELLED. */
trc_status trc_topology_build(const struct trc_range *all, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_part_triangle *triangles_out, struct box *boxes_out,
                              struct trc_topology *out);
void trc_topology_destroy(struct trc_topology *topology);

/* A triangle at a key, as a leaf holds it: corners on a line (of meshes at rest) become one point,
 * which no ray hits, where rounding would give them an area. */
void trc_part_triangle(const struct trc_part *part, uint32_t triangle, uint32_t key,
                       float out[3][3]);

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
