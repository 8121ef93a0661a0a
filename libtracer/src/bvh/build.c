/* Shape of a tree: where ranges are split (kernels/split.c), and where they stay leaves.
 *
 * Nodes are opened to eight children by splitting the child of the largest area, as in Ingo Wald,
 * Carsten Benthin, Solomon Boulos, "Getting Rid of Packets", 2008. The upper part of the tree is
 * made by one thread, all of them at work on each split; subtrees of TRC_SHARED_RANGE refs or less
 * are tasks. Sizes do not depend on the number of threads, so the tree does not either.
 *
 * Without gain: triangles cut before the build at spatial median planes (Karras and Aila, "Fast
 * Parallel Construction of High-Quality Bounding Volume Hierarchies", 2013) make the cost of
 * the generated conference room 10 to 29 % higher for 5 to 90 % more refs. */
#include <string.h>

#include "bvh/binary.h"
#include "bvh/cluster.h"
#include "bvh/split.h"
#include "core/core.h"
#include "kernels/kernels.h"
#include "threads/pool.h"

/* Cost of visiting a node against one triangle of a leaf. A leaf is one block whatever its count,
 * and packets cull its triangles in one step, so leaves may be full. */
#define NODE_COST 4.0f
/* From this level (of 8-wide nodes) on, ranges are halved whatever the SAH says: 2^28 refs are
 * exhausted within TRC_MAX_LEVELS. */
#define MEDIAN_LEVEL 32

/* A growing part of the tree. */
struct arena {
    uint32_t (*children)[TRC_NODE_WIDTH];
    uint32_t node_count, node_capacity;
    bool failed;
};

struct task {
    struct trc_range range;
    uint32_t parent, slot; /* where in the upper part its root goes */
    uint32_t level;
    uint32_t root;
    struct arena arena;
};

struct builder {
    const struct trc_kernels *kernels;
    uint32_t leaf_size;
    const atomic_uint *cancel;
    struct trc_part_triangle *triangles; /* by slot */
    struct trc_split_blocks *blocks;     /* for the upper part */
    struct task *tasks;                  /* filled while the upper part is made */
    uint32_t task_count, task_capacity;
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

/* Splits r in two unless it is better, and possible, to leave it a leaf. A build that is cancelled
 * splits no more: what it has made is thrown away. */
static bool range_divide(struct builder *b, const struct trc_range *r, uint32_t level,
                         struct trc_range *left, struct trc_range *right) {
    const uint32_t count = r->triangles;
    const bool must = count > b->leaf_size;
    if (r->count < 2 || (!must && (float)count <= NODE_COST) || is_cancelled(b))
        return false;
    if (level >= MEDIAN_LEVEL) {
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

/* Opens r into up to eight ranges, the largest area first, then the most refs; 1 when r stays a
 * leaf. closed: those that stay leaves; the others are yet to be asked. */
static int range_open(struct builder *b, const struct trc_range *r, uint32_t level,
                      struct trc_range out[TRC_NODE_WIDTH], bool closed[TRC_NODE_WIDTH]) {
    int count = 1;
    const float margin = trc_range_margin(r);
    float area[TRC_NODE_WIDTH]; /* -1: of those that are closed */
    memset(closed, 0, TRC_NODE_WIDTH * sizeof *closed);
    out[0] = *r;
    area[0] = box_area_wider(r->bounds, margin);
    while (count < TRC_NODE_WIDTH) {
        int best = 0;
        for (int i = 1; i < count; i++)
            if (area[i] > area[best] || (area[i] == area[best] && out[i].count > out[best].count))
                best = i;
        if (area[best] < 0.0f)
            break;
        struct trc_range left, right;
        closed[best] = !range_divide(b, &out[best], level, &left, &right);
        if (closed[best]) {
            area[best] = -1.0f;
            continue;
        }
        out[best] = left;
        out[count] = right;
        area[best] = box_area_wider(left.bounds, margin);
        area[count++] = box_area_wider(right.bounds, margin);
    }
    return count;
}

/* Cancelled, refs may be in any state. */
static uint32_t build_leaf(const struct builder *b, const struct trc_range *r) {
    if (is_cancelled(b))
        return TRC_REF_EMPTY;
    trc_clusters_open(r->refs, r->count, b->triangles + r->first_slot);
    return trc_leaf_ref(r->first_slot, r->triangles);
}

/* A binary tree over r; its root. Levels count as if none were left out. */
static uint32_t binary_build(struct builder *b, struct trc_binary *binary,
                             const struct trc_range *r, uint32_t level) {
    struct trc_range left, right;
    if (!range_divide(b, r, level, &left, &right))
        return trc_binary_add_leaf(binary, build_leaf(b, r));
    const uint32_t l = binary_build(b, binary, &left, level + 1),
                   k = binary_build(b, binary, &right, level + 1);
    return trc_binary_add_node(binary, l, k, box_area(r->bounds));
}

/* The wide node that stands for one of a binary tree, and those below it. */
static uint32_t binary_collapse(struct arena *a, const struct trc_binary *binary, uint32_t root) {
    uint32_t child[TRC_NODE_WIDTH];
    if (binary->nodes[root].ref != TRC_REF_EMPTY)
        return binary->nodes[root].ref;
    const uint32_t node = arena_node(a);
    if (a->failed)
        return TRC_REF_EMPTY;
    const int count = trc_binary_children(binary, root, child);
    for (int i = 0; i < count; i++) {
        const uint32_t ref = binary_collapse(a, binary, child[i]);
        a->children[node][i] = ref; /* a->children may have moved meanwhile */
    }
    return node;
}

static uint32_t build_small(struct builder *b, struct arena *a, const struct trc_range *r,
                            uint32_t level) {
    struct trc_binary binary = {.nodes = trc_alloc(2 * (size_t)r->count, sizeof *binary.nodes)};
    if (!binary.nodes) {
        a->failed = true;
        return TRC_REF_EMPTY;
    }
    const uint32_t root = binary_build(b, &binary, r, level);
    const uint32_t ref = binary_collapse(a, &binary, root);
    trc_free(binary.nodes);
    return ref;
}

/* Builds r into the arena, depth first; in the upper part (tasks true) small ranges become tasks.
 */
static uint32_t build_range(struct builder *b, struct arena *a, const struct trc_range *r,
                            uint32_t level, bool tasks) {
    struct trc_range child[TRC_NODE_WIDTH];
    bool closed[TRC_NODE_WIDTH];
    if (a->failed || b->failed || is_cancelled(b))
        return TRC_REF_EMPTY;
    const int count = range_open(b, r, level, child, closed);
    if (count == 1)
        return build_leaf(b, r);
    const uint32_t node = arena_node(a);
    if (a->failed)
        return TRC_REF_EMPTY;
    for (int i = 0; i < count; i++) {
        if (closed[i]) {
            a->children[node][i] = build_leaf(b, &child[i]);
        } else if (tasks && child[i].count <= TRC_SHARED_RANGE) {
            if (b->task_count == b->task_capacity) {
                void *array = b->tasks;
                if (!grow(&array, &b->task_capacity, sizeof *b->tasks)) {
                    b->failed = true;
                    return TRC_REF_EMPTY;
                }
                b->tasks = array;
            }
            b->tasks[b->task_count++] = (struct task){
                .range = child[i], .parent = node, .slot = (uint32_t)i, .level = level + 1};
        } else {
            const uint32_t ref = build_range(b, a, &child[i], level + 1, tasks);
            a->children[node][i] = ref; /* a->children may have moved meanwhile */
        }
    }
    return node;
}

static void task_run(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct builder *b = context;
    struct task *t = &b->tasks[index];
    t->root = t->level < MEDIAN_LEVEL ? build_small(b, &t->arena, &t->range, t->level)
                                      : build_range(b, &t->arena, &t->range, t->level, false);
}

/* Appends the tasks' parts to the upper part. */
static trc_status join(struct builder *b, struct arena *top, uint32_t root,
                       struct trc_topology *out) {
    uint32_t node_count = top->node_count;
    bool failed = top->failed || b->failed;
    for (uint32_t i = 0; i < b->task_count; i++) {
        node_count += b->tasks[i].arena.node_count;
        failed = failed || b->tasks[i].arena.failed;
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
    for (uint32_t i = 0; i < b->task_count; i++) {
        const struct task *t = &b->tasks[i];
        for (uint32_t n = 0; n < t->arena.node_count; n++)
            for (int c = 0; c < TRC_NODE_WIDTH; c++) {
                const uint32_t ref = t->arena.children[n][c];
                out->children[node + n][c] = (ref & TRC_REF_LEAF) ? ref : ref + node;
            }
        out->children[t->parent][t->slot] = (t->root & TRC_REF_LEAF) ? t->root : t->root + node;
        node += t->arena.node_count;
    }
    return TRC_OK;
}

trc_status trc_topology_build(const struct trc_range *all, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_part_triangle *triangles_out, struct trc_topology *out) {
    struct builder b = {.kernels = trc_kernels_current(),
                        .leaf_size = leaf_size,
                        .cancel = cancel,
                        .triangles = triangles_out};
    struct arena top = {0};
    *out = (struct trc_topology){.root = TRC_REF_EMPTY};
    if (all->count == 0)
        return TRC_OK;
    if (all->triangles > TRC_REF_INDEX_MASK)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%u primitives in one tree, at most %u",
                        all->triangles, TRC_REF_INDEX_MASK);
    const bool shared = all->count > TRC_SHARED_RANGE;
    if (shared) {
        b.blocks = trc_alloc(1, sizeof *b.blocks);
        if (!b.blocks)
            return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to build over %u primitives",
                            all->triangles);
        *b.blocks = (struct trc_split_blocks){.pool = pool, .cancel = cancel};
    }
    const uint32_t root = shared ? build_range(&b, &top, all, 0, true) : build_small(&b, &top, all, 0);
    if (!top.failed && !b.failed)
        trc_pool_run(pool, b.task_count, task_run, &b);
    const trc_status status = join(&b, &top, root, out);
    for (uint32_t i = 0; i < b.task_count; i++)
        trc_free(b.tasks[i].arena.children);
    trc_free(b.tasks);
    trc_free(top.children);
    trc_free(b.blocks);
    return status;
}

void trc_topology_destroy(struct trc_topology *topology) {
    trc_free(topology->children);
    *topology = (struct trc_topology){.root = TRC_REF_EMPTY};
}
