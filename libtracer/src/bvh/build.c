/* Shape of a tree: where ranges are split (kernels/trace/split.c), where they stay leaves, and
 * which of the nodes so made stay (bvh/binary.h).
 *
 * The upper part of the binary tree is made by one thread, all of them at work on each split;
 * subtrees of TRC_SHARED_RANGE refs or less are tasks, and so are the wide nodes that stand for
 * them. Sizes do not depend on the number of threads, so the tree does not either.
 *
 * Other ways to make wide nodes, and to improve a tree once it is built, were measured:
 * docs/measurements.md. */
#include <string.h>

#include "bvh/binary.h"
#include "bvh/cluster.h"
#include "core/core.h"
#include "core/pool.h"
#include "model/kernels.h"
#include "model/split.h"

/* Cost of visiting a node against one triangle of a leaf. A leaf is one block whatever its count,
 * and packets cull its triangles in one step, so leaves may be full. */
#define NODE_COST 4.0f

/* A growing part of the tree. */
struct arena {
    uint32_t (*children)[TRC_NODE_WIDTH];
    uint32_t node_count, node_capacity;
    bool failed;
};

/* A small range, and the binary tree over it. */
struct task {
    struct trc_range range;
    uint32_t first_ref; /* of all */
    uint32_t level;
    uint32_t root; /* node, or a leaf's reference */
};

/* A split of the upper part. Its sides: forks, or tasks with FORK_TASK. */
struct fork {
    uint32_t node;
    uint32_t left, right;
    float area;
};
#define FORK_TASK 0x80000000u

/* A binary tree whose wide nodes are made apart. */
struct piece {
    uint32_t node;         /* its root */
    uint32_t parent, slot; /* where in the upper part its wide root goes */
    uint32_t root;
    struct arena arena;
};

struct builder {
    const struct trc_kernels *kernels;
    uint32_t leaf_size;
    const atomic_uint *cancel;
    struct trc_part_triangle *triangles; /* by slot */
    struct box *boxes;                   /* of clipped leaves, by their first slot, or NULL */
    struct trc_split_blocks *blocks;     /* for the upper part */
    struct task *tasks;
    uint32_t task_count, task_capacity;
    struct fork *forks; /* children before parents */
    uint32_t fork_count, fork_capacity;
    struct trc_binary binary;
    struct piece *pieces;
    uint32_t piece_count, piece_capacity;
    bool failed;
};

static bool grow(void **array, uint32_t *capacity, size_t size) {
    const uint32_t larger = *capacity ? *capacity * 2 : 64;
    void *block = trc_alloc(larger, size);
    if (!block)
        return false;
    if (*array)
        memcpy(block, *array, *capacity * size);
    trc_free(*array);
    *array = block;
    *capacity = larger;
    return true;
}

static uint32_t arena_node(struct arena *a) {
    if (a->node_count == a->node_capacity) {
        void *children = a->children;
        if (!grow(&children, &a->node_capacity, sizeof *a->children)) {
            a->failed = true;
            return 0;
        }
        a->children = children;
    }
    for (int i = 0; i < TRC_NODE_WIDTH; i++)
        a->children[a->node_count][i] = TRC_REF_EMPTY;
    return a->node_count++;
}

static bool is_cancelled(const struct builder *b) { return b->cancel && *b->cancel; }

/* Halves by number, where no plane will do. */
static void range_halve(const struct trc_range *r, struct trc_range *left,
                        struct trc_range *right) {
    uint32_t before = 0;
    for (uint32_t i = 0; i < r->count / 2; i++)
        before += trc_ref_count(&r->refs[i]);
    trc_range_part(r, r->refs, r->spare, r->count / 2, before, left, right);
    trc_range_measure(left);
    trc_range_measure(right);
}

/* Whether halving is all that keeps a range's subtree within the levels there may be. */
static bool is_deep(const struct trc_range *r, uint32_t level) {
    const uint32_t halvings = 32 - (uint32_t)__builtin_clz(r->count - 1);
    return level + halvings >= TRC_MAX_LEVELS - 1;
}

/* Splits r in two unless it is better, and possible, to leave it a leaf. A build that is cancelled
 * splits no more: what it has made is thrown away. */
static bool range_divide(struct builder *b, const struct trc_range *r, uint32_t level,
                         struct trc_range *left, struct trc_range *right) {
    const uint32_t count = r->triangles;
    const bool must = count > b->leaf_size;
    if (r->count < 2 || (!must && (float)count <= NODE_COST) || is_cancelled(b))
        return false;
    if (is_deep(r, level)) {
        if (must)
            range_halve(r, left, right);
        return must;
    }
    struct trc_split_blocks *blocks = r->count > TRC_SHARED_RANGE ? b->blocks : NULL;
    struct trc_split s;
    b->kernels->split_find(blocks, r, &s);
    const float area = box_area_wider(r->bounds, trc_range_margin(r));
    if (!must && !(s.axis >= 0 && s.cost + area * NODE_COST < area * (float)count))
        return false;
    if (s.axis < 0)
        range_halve(r, left, right);
    else
        b->kernels->split_apply(blocks, r, &s, left, right);
    return true;
}

static bool is_clipped(const struct trc_range *r) {
    uint32_t parts = 0;
    for (uint32_t i = 0; i < r->count; i++)
        parts |= r->refs[i].part;
    return parts & TRC_PART_CLIPPED;
}

/* Cancelled, refs may be in any state. */
static uint32_t build_leaf(const struct builder *b, const struct trc_range *r) {
    if (is_cancelled(b))
        return TRC_REF_EMPTY;
    trc_clusters_open(r->refs, r->count, b->triangles + r->first_slot);
    if (b->boxes && is_clipped(r)) {
        b->boxes[r->first_slot] = r->bounds;
        b->triangles[r->first_slot].part |= TRC_PART_CLIPPED;
    }
    return trc_leaf_ref(r->first_slot, r->triangles);
}

/* Makes room for one more; false, and nothing has changed, where the build has failed. */
static bool has_room(struct builder *b, void **array, uint32_t count, uint32_t *capacity,
                     size_t size) {
    if (!b->failed && count == *capacity)
        b->failed = !grow(array, capacity, size);
    return !b->failed;
}

/* A node stands where the last ref of its left side was, of all refs and their spare memory: no
 * other has that place, and nobody reads it any more once both sides are made. */
static uint32_t node_between(uint32_t first_ref, const struct trc_range *left) {
    return first_ref + left->count - 1;
}
_Static_assert(sizeof(struct trc_binary_node) == sizeof(struct trc_ref) &&
                   sizeof(struct trc_binary_cost) == sizeof(struct trc_ref),
               "nodes stand where refs were");

/* The upper part over r, down to what are tasks; the side of a fork that it is. */
static uint32_t upper_build(struct builder *b, const struct trc_range *r, uint32_t first_ref,
                            uint32_t level) {
    struct trc_range left, right;
    void *array;
    if (b->failed || is_cancelled(b))
        return FORK_TASK;
    if (r->count <= TRC_SHARED_RANGE || !range_divide(b, r, level, &left, &right)) {
        array = b->tasks;
        if (!has_room(b, &array, b->task_count, &b->task_capacity, sizeof *b->tasks))
            return FORK_TASK;
        b->tasks = array;
        b->tasks[b->task_count] =
            (struct task){.range = *r, .first_ref = first_ref, .level = level};
        return FORK_TASK | b->task_count++;
    }
    const uint32_t l = upper_build(b, &left, first_ref, level + 1),
                   k = upper_build(b, &right, first_ref + left.count, level + 1);
    array = b->forks;
    if (!has_room(b, &array, b->fork_count, &b->fork_capacity, sizeof *b->forks))
        return FORK_TASK;
    b->forks = array;
    b->forks[b->fork_count] =
        (struct fork){node_between(first_ref, &left), l, k, box_area(r->bounds)};
    return b->fork_count++;
}

/* The binary tree over r, children first; its root. */
static uint32_t task_build(struct builder *b, const struct trc_range *r, uint32_t first_ref,
                           uint32_t level) {
    struct trc_range left, right;
    if (!range_divide(b, r, level, &left, &right))
        return build_leaf(b, r);
    const uint32_t l = task_build(b, &left, first_ref, level + 1),
                   k = task_build(b, &right, first_ref + left.count, level + 1),
                   node = node_between(first_ref, &left);
    trc_binary_join(&b->binary, node, l, k, box_area(r->bounds));
    return node;
}

static void task_run(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct builder *b = context;
    struct task *t = &b->tasks[index];
    t->root = task_build(b, &t->range, t->first_ref, t->level);
}

/* The node, or leaf, that is a side of a fork. */
static uint32_t side_node(const struct builder *b, uint32_t side) {
    return side & FORK_TASK ? b->tasks[side & ~FORK_TASK].root : b->forks[side].node;
}

static void binary_build(struct builder *b, struct trc_pool *pool) {
    trc_pool_run(pool, b->task_count, task_run, b);
    for (uint32_t i = 0; i < b->fork_count; i++) {
        const struct fork *f = &b->forks[i];
        trc_binary_join(&b->binary, f->node, side_node(b, f->left), side_node(b, f->right),
                        f->area);
        b->binary.nodes[f->node].is_upper = true;
    }
}

static bool is_upper(const struct builder *b, uint32_t binary) {
    return !(binary & TRC_REF_LEAF) && b->binary.nodes[binary].is_upper;
}

/* The wide node that stands for a binary one, and those below it, depth first. Those below forks
 * are left to pieces. */
static uint32_t collapse(struct builder *b, struct arena *a, uint32_t binary) {
    uint32_t child[TRC_NODE_WIDTH];
    if (binary & TRC_REF_LEAF)
        return binary;
    const uint32_t node = arena_node(a);
    if (a->failed)
        return TRC_REF_EMPTY;
    const int count = trc_binary_children(b->binary.nodes, binary, child);
    for (int i = 0; i < count; i++) {
        if (is_upper(b, binary) && !(child[i] & TRC_REF_LEAF) && !is_upper(b, child[i])) {
            void *array = b->pieces;
            if (!has_room(b, &array, b->piece_count, &b->piece_capacity, sizeof *b->pieces))
                return TRC_REF_EMPTY;
            b->pieces = array;
            b->pieces[b->piece_count++] =
                (struct piece){.node = child[i], .parent = node, .slot = (uint32_t)i};
            continue;
        }
        const uint32_t ref = collapse(b, a, child[i]);
        a->children[node][i] = ref; /* a->children may have moved meanwhile */
    }
    return node;
}

static void piece_run(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct builder *b = context;
    struct piece *p = &b->pieces[index];
    p->root = collapse(b, &p->arena, p->node);
}

/* Appends the pieces to the upper part. */
static trc_status join(struct builder *b, struct arena *top, uint32_t root,
                       struct trc_topology *out) {
    uint32_t node_count = top->node_count;
    bool failed = top->failed || b->failed;
    for (uint32_t i = 0; i < b->piece_count; i++) {
        node_count += b->pieces[i].arena.node_count;
        failed = failed || b->pieces[i].arena.failed;
    }
    if (is_cancelled(b))
        return trc_fail(TRC_ERROR_CANCELLED, "the build was cancelled");
    if (failed)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree");
    *out = (struct trc_topology){.node_count = node_count, .root = root};
    out->children = trc_alloc(node_count ? node_count : 1, sizeof *out->children);
    if (!out->children) {
        trc_topology_destroy(out);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree of %u nodes", node_count);
    }
    if (top->node_count)
        memcpy(out->children, top->children, top->node_count * sizeof *out->children);
    uint32_t node = top->node_count;
    for (uint32_t i = 0; i < b->piece_count; i++) {
        const struct piece *p = &b->pieces[i];
        for (uint32_t n = 0; n < p->arena.node_count; n++)
            for (int c = 0; c < TRC_NODE_WIDTH; c++) {
                const uint32_t ref = p->arena.children[n][c];
                out->children[node + n][c] = (ref & TRC_REF_LEAF) ? ref : ref + node;
            }
        out->children[p->parent][p->slot] = (p->root & TRC_REF_LEAF) ? p->root : p->root + node;
        node += p->arena.node_count;
    }
    return TRC_OK;
}

trc_status trc_topology_build(const struct trc_range *all, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_part_triangle *triangles_out, struct box *boxes_out,
                              struct trc_topology *out) {
    struct builder b = {
        .kernels = trc_kernels_current(),
        .leaf_size = leaf_size,
        .cancel = cancel,
        .triangles = triangles_out,
        .boxes = boxes_out,
        .binary = {(struct trc_binary_node *)all->refs, (struct trc_binary_cost *)all->spare}};
    struct arena top = {0};
    *out = (struct trc_topology){.root = TRC_REF_EMPTY};
    if (all->count == 0)
        return TRC_OK;
    if (all->triangles > TRC_REF_INDEX_MASK)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%u primitives in one tree, at most %u",
                        all->triangles, TRC_REF_INDEX_MASK);
    if (all->count > TRC_SHARED_RANGE) {
        b.blocks = trc_alloc(1, sizeof *b.blocks);
        if (!b.blocks)
            return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to build over %u primitives",
                            all->triangles);
        *b.blocks = (struct trc_split_blocks){.pool = pool, .cancel = cancel};
    }
    const uint32_t side = upper_build(&b, all, 0, 0);
    uint32_t root = TRC_REF_EMPTY;
    b.failed = b.failed || is_cancelled(&b);
    if (!b.failed) {
        binary_build(&b, pool);
        root = collapse(&b, &top, side_node(&b, side));
        trc_pool_run(pool, b.piece_count, piece_run, &b);
    }
    const trc_status status = join(&b, &top, root, out);
    for (uint32_t i = 0; i < b.piece_count; i++)
        trc_free(b.pieces[i].arena.children);
    trc_free(b.pieces);
    trc_free(b.forks);
    trc_free(b.tasks);
    trc_free(top.children);
    trc_free(b.blocks);
    return status;
}

void trc_topology_destroy(struct trc_topology *topology) {
    trc_free(topology->children);
    *topology = (struct trc_topology){.root = TRC_REF_EMPTY};
}
