/* Memory of a tree: vertices into leaves, bounds into nodes, refit. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/tree.h"
#include "core/core.h"
#include "threads/pool.h"

/* Leaves one task fills: large enough that handing out tasks costs nothing. */
#define LEAVES_PER_TASK 1024
#define NODES_PER_TASK 512

void trc_part_vertex(const struct trc_part *part, uint32_t triangle, uint32_t v, uint32_t key,
                     float out[3]) {
    const struct trc_mesh *mesh = part->mesh;
    const uint32_t k = mesh->key_count > 1 ? key : 0;
    const float *p = mesh->positions +
                     3 * ((size_t)k * mesh->vertex_count + mesh->indices[3 * (size_t)triangle + v]);
    if (!part->transform) {
        memcpy(out, p, 3 * sizeof(float));
        return;
    }
    const float *m = part->transform->m;
    for (int i = 0; i < 3; i++)
        out[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
}

/* Whether a triangle's corners, by double arithmetic, lie on a line. */
static bool is_on_a_line(const float *a, const float *b, const float *c) {
    double p[3], q[3];
    for (int i = 0; i < 3; i++) {
        p[i] = (double)b[i] - a[i];
        q[i] = (double)c[i] - a[i];
    }
    return p[1] * q[2] == p[2] * q[1] && p[2] * q[0] == p[0] * q[2] && p[0] * q[1] == p[1] * q[0];
}

void trc_part_triangle(const struct trc_part *part, uint32_t triangle, uint32_t key,
                       float out[3][3]) {
    const struct trc_mesh *mesh = part->mesh;
    const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
    const float *p = mesh->positions;
    for (uint32_t v = 0; v < 3; v++)
        trc_part_vertex(part, triangle, v, key, out[v]);
    if (mesh->key_count == 1 &&
        is_on_a_line(p + 3 * (size_t)index[0], p + 3 * (size_t)index[1], p + 3 * (size_t)index[2]))
        for (int v = 1; v < 3; v++)
            memcpy(out[v], out[0], sizeof out[0]);
}

static trc_status tree_alloc(struct trc_tree *tree, uint32_t node_count, uint32_t leaf_count,
                             uint32_t key_count, bool is_top) {
    *tree = (struct trc_tree){.key_count = key_count,
                              .node_count = node_count,
                              .leaf_count = leaf_count,
                              .root = TRC_REF_EMPTY,
                              .is_top = is_top};
    tree->node_stride = TRC_NODE_HEADER_BYTES + (size_t)key_count * TRC_NODE_KEY_BYTES;
    tree->leaf_stride = is_top ? 0 : TRC_LEAF_HEADER_BYTES + (size_t)key_count * TRC_LEAF_KEY_BYTES;
    tree->nodes = trc_alloc(node_count ? node_count : 1, tree->node_stride);
    if (!is_top)
        tree->leaves = trc_alloc(leaf_count ? leaf_count : 1, tree->leaf_stride);
    if (!tree->nodes || (!is_top && !tree->leaves)) {
        trc_tree_destroy(tree);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree of %u nodes and %u leaves",
                        node_count, leaf_count);
    }
    tree->bytes =
        node_count * (uint64_t)tree->node_stride + leaf_count * (uint64_t)tree->leaf_stride;
    return TRC_OK;
}

void trc_tree_destroy(struct trc_tree *tree) {
    trc_free(tree->nodes);
    trc_free(tree->leaves);
    *tree = (struct trc_tree){.root = TRC_REF_EMPTY};
}

/* Vertices of all slots of a leaf from the triangle numbers in its header. part_of: the part of a
 * slot. */
static void leaf_vertices(struct trc_tree *tree, uint32_t leaf,
                          const struct trc_part *const *part_of) {
    const uint32_t *triangles = trc_leaf_triangles(tree, leaf);
    uint32_t used = 0;
    while (used < TRC_NODE_WIDTH && triangles[used] != TRC_EMPTY_SLOT)
        used++;
    for (uint32_t key = 0; key < tree->key_count; key++) {
        float *v = (float *)trc_leaf_vertices(tree, leaf, key);
        for (uint32_t slot = 0; slot < TRC_NODE_WIDTH; slot++) {
            const uint32_t from = slot < used ? slot : used - 1;
            float p[3][3];
            trc_part_triangle(part_of[from], triangles[from], key, p);
            for (uint32_t corner = 0; corner < 3; corner++)
                for (uint32_t axis = 0; axis < 3; axis++)
                    v[(3 * corner + axis) * TRC_NODE_WIDTH + slot] = p[corner][axis];
        }
    }
}

struct fill_job {
    const struct trc_topology *topology;
    const struct trc_ref *refs;
    const struct trc_part *parts;
    const uint8_t *leaf_counts;
    struct trc_tree *tree;
    atomic_bool transparent;
};

static bool part_is_transparent(const struct trc_part *part, uint32_t triangle) {
    if (!part->transparent)
        return false;
    const uint32_t slot = part->mesh->material_index ? part->mesh->material_index[triangle] : 0;
    return part->transparent[slot < part->slot_count ? slot : part->slot_count - 1] != 0;
}

static void fill_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct fill_job *job = context;
    struct trc_tree *tree = job->tree;
    const uint32_t begin = index * LEAVES_PER_TASK;
    const uint32_t end =
        tree->leaf_count - begin < LEAVES_PER_TASK ? tree->leaf_count : begin + LEAVES_PER_TASK;
    for (uint32_t leaf = begin; leaf < end; leaf++) {
        uint32_t *instances = (uint32_t *)trc_leaf_instances(tree, leaf);
        uint32_t *triangles = instances + TRC_NODE_WIDTH;
        const struct trc_part *part_of[TRC_NODE_WIDTH];
        const uint32_t count = job->leaf_counts[leaf];
        for (uint32_t slot = 0; slot < TRC_NODE_WIDTH; slot++) {
            const struct trc_ref *ref =
                &job->refs[job->topology->leaf_begin[leaf] + (slot < count ? slot : count - 1)];
            part_of[slot] = &job->parts[ref->part];
            const bool transparent = part_is_transparent(part_of[slot], ref->primitive);
            if (transparent)
                atomic_store_explicit(&job->transparent, true, memory_order_relaxed);
            instances[slot] = part_of[slot]->instance | (transparent ? TRC_SLOT_TRANSPARENT : 0u);
            triangles[slot] = slot < count ? ref->primitive : TRC_EMPTY_SLOT;
        }
        leaf_vertices(tree, leaf, part_of);
    }
}

/* Counts live in the references, the task wants them by leaf. */
static void leaf_counts_collect(const struct trc_topology *topology, uint8_t *counts) {
    if (topology->root != TRC_REF_EMPTY && (topology->root & TRC_REF_LEAF))
        counts[topology->root & TRC_REF_INDEX_MASK] = (uint8_t)(((topology->root >> 28) & 7u) + 1u);
    for (uint32_t n = 0; n < topology->node_count; n++)
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const uint32_t ref = topology->children[n][i];
            if (ref != TRC_REF_EMPTY && (ref & TRC_REF_LEAF))
                counts[ref & TRC_REF_INDEX_MASK] = (uint8_t)(((ref >> 28) & 7u) + 1u);
        }
}

trc_status trc_tree_fill(const struct trc_topology *topology, const struct trc_ref *refs,
                         const struct trc_part *parts, uint32_t key_count, struct trc_pool *pool,
                         struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, topology->node_count, topology->leaf_count, key_count, false);
    if (status != TRC_OK)
        return status;
    uint8_t *counts = trc_alloc_zeroed(topology->leaf_count ? topology->leaf_count : 1, 1);
    if (!counts) {
        trc_tree_destroy(tree);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u leaves", topology->leaf_count);
    }
    leaf_counts_collect(topology, counts);
    for (uint32_t n = 0; n < topology->node_count; n++)
        memcpy(tree->nodes + n * tree->node_stride, topology->children[n],
               sizeof topology->children[n]);
    struct fill_job job = {topology, refs, parts, counts, tree, false};
    trc_pool_run(pool, (topology->leaf_count + LEAVES_PER_TASK - 1) / LEAVES_PER_TASK, fill_task,
                 &job);
    trc_free(counts);
    tree->root = topology->root;
    tree->has_transparent = job.transparent;
    trc_tree_bound(tree, pool);
    return TRC_OK;
}

struct refit_job {
    const struct trc_part *part;
    struct trc_tree *tree;
};

static void refit_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct refit_job *job = context;
    const struct trc_part *part_of[TRC_NODE_WIDTH];
    for (int i = 0; i < TRC_NODE_WIDTH; i++)
        part_of[i] = job->part;
    const uint32_t begin = index * LEAVES_PER_TASK, count = job->tree->leaf_count;
    for (uint32_t leaf = begin; leaf < count && leaf < begin + LEAVES_PER_TASK; leaf++)
        leaf_vertices(job->tree, leaf, part_of);
}

trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, from->node_count, from->leaf_count, key_count, false);
    if (status != TRC_OK)
        return status;
    for (uint32_t n = 0; n < from->node_count; n++)
        memcpy(tree->nodes + n * tree->node_stride, from->nodes + n * from->node_stride,
               TRC_NODE_HEADER_BYTES);
    for (uint32_t n = 0; n < from->leaf_count; n++)
        memcpy(tree->leaves + n * tree->leaf_stride, from->leaves + n * from->leaf_stride,
               TRC_LEAF_HEADER_BYTES);
    tree->root = from->root;
    tree->has_transparent = from->has_transparent;
    struct refit_job job = {part, tree};
    trc_pool_run(pool, (tree->leaf_count + LEAVES_PER_TASK - 1) / LEAVES_PER_TASK, refit_task,
                 &job);
    trc_tree_bound(tree, pool);
    return TRC_OK;
}

/* lower and upper of a leaf at a key. */
static void leaf_bounds(const struct trc_tree *tree, uint32_t leaf, uint32_t key, float lower[3],
                        float upper[3]) {
    const float *v = trc_leaf_vertices(tree, leaf, key);
    for (int axis = 0; axis < 3; axis++) {
        const float *a = v + axis * TRC_NODE_WIDTH, *b = a + 3 * TRC_NODE_WIDTH,
                    *c = b + 3 * TRC_NODE_WIDTH;
        float low[TRC_NODE_WIDTH], high[TRC_NODE_WIDTH];
        for (int slot = 0; slot < TRC_NODE_WIDTH; slot++) { /* side by side */
            const float l = a[slot] < b[slot] ? a[slot] : b[slot];
            const float h = a[slot] > b[slot] ? a[slot] : b[slot];
            low[slot] = l < c[slot] ? l : c[slot];
            high[slot] = h > c[slot] ? h : c[slot];
        }
        lower[axis] = low[0];
        upper[axis] = high[0];
        for (int slot = 1; slot < TRC_NODE_WIDTH; slot++) {
            lower[axis] = low[slot] < lower[axis] ? low[slot] : lower[axis];
            upper[axis] = high[slot] > upper[axis] ? high[slot] : upper[axis];
        }
    }
}

static void node_bounds(const struct trc_tree *tree, uint32_t node, uint32_t key, float lower[3],
                        float upper[3]) {
    const float *b = trc_node_bounds(tree, node, key);
    for (int axis = 0; axis < 3; axis++) {
        float low = INFINITY, high = -INFINITY;
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const float l = b[16 * axis + i], h = b[16 * axis + 8 + i];
            low = l < low ? l : low;
            high = h > high ? h : high;
        }
        lower[axis] = low;
        upper[axis] = high;
    }
}

static void ref_bounds(const struct trc_tree *tree, uint32_t ref, uint32_t key, float lower[3],
                       float upper[3]) {
    if (ref == TRC_REF_EMPTY) {
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = INFINITY;
            upper[axis] = -INFINITY;
        }
    } else if (ref & TRC_REF_LEAF) {
        leaf_bounds(tree, ref & TRC_REF_INDEX_MASK, key, lower, upper);
    } else {
        node_bounds(tree, ref, key, lower, upper);
    }
}

static void child_store(struct trc_tree *tree, uint32_t node, uint32_t child, uint32_t key,
                        const float lower[3], const float upper[3]) {
    float *b = (float *)trc_node_bounds(tree, node, key);
    for (int axis = 0; axis < 3; axis++) {
        b[16 * axis + (int)child] = lower[axis];
        b[16 * axis + 8 + (int)child] = upper[axis];
    }
}

static float box_area(const float lower[3], const float upper[3]) {
    const float x = upper[0] - lower[0], y = upper[1] - lower[1], z = upper[2] - lower[2];
    return x >= 0.0f ? x * y + y * z + z * x : 0.0f;
}

/* Root bounds, their scale, and the SAH cost at key 0: area of every child's box over the root's.
 */
static void tree_finish(struct trc_tree *tree) {
    for (int axis = 0; axis < 3; axis++) {
        tree->lower[axis] = INFINITY;
        tree->upper[axis] = -INFINITY;
    }
    tree->extent = 0.0f;
    for (uint32_t key = 0; key < tree->key_count; key++) {
        float lower[3], upper[3];
        ref_bounds(tree, tree->root, key, lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            if (lower[axis] < tree->lower[axis])
                tree->lower[axis] = lower[axis];
            if (upper[axis] > tree->upper[axis])
                tree->upper[axis] = upper[axis];
        }
    }
    if (tree->root == TRC_REF_EMPTY)
        return;
    for (int axis = 0; axis < 3; axis++)
        tree->extent =
            fmaxf(tree->extent, fmaxf(fabsf(tree->lower[axis]), fabsf(tree->upper[axis])));
    double sum = 0.0;
    for (uint32_t n = 0; n < tree->node_count; n++) {
        const float *b = trc_node_bounds(tree, n, 0);
        for (int i = 0; i < TRC_NODE_WIDTH; i++) {
            const float lower[3] = {b[i], b[16 + i], b[32 + i]};
            const float upper[3] = {b[8 + i], b[24 + i], b[40 + i]};
            sum += box_area(lower, upper);
        }
    }
    const float root_area = box_area(tree->lower, tree->upper);
    tree->sah_cost = root_area > 0.0f ? (float)(sum / root_area) : 0.0f;
}

/* Boxes of a node's children of one sort: leaves and empty ones, or nodes. */
static void children_bound(struct trc_tree *tree, uint32_t node, bool nodes) {
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        const bool is_node = children[i] != TRC_REF_EMPTY && !(children[i] & TRC_REF_LEAF);
        if (is_node != nodes)
            continue;
        for (uint32_t key = 0; key < tree->key_count; key++) {
            float lower[3], upper[3];
            ref_bounds(tree, children[i], key, lower, upper);
            child_store(tree, node, i, key, lower, upper);
        }
    }
}

static void bound_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct trc_tree *tree = context;
    const uint32_t begin = index * NODES_PER_TASK;
    for (uint32_t n = begin; n < tree->node_count && n < begin + NODES_PER_TASK; n++)
        children_bound(tree, n, false);
}

/* Leaves by all threads, then nodes after their children. */
void trc_tree_bound(struct trc_tree *tree, struct trc_pool *pool) {
    trc_pool_run(pool, (tree->node_count + NODES_PER_TASK - 1) / NODES_PER_TASK, bound_task, tree);
    for (uint32_t n = tree->node_count; n-- > 0;)
        children_bound(tree, n, true);
    tree_finish(tree);
}

trc_status trc_tree_fill_top(const struct trc_topology *topology, const struct trc_ref *refs,
                             const struct trc_item *items, struct trc_item *items_out,
                             struct trc_tree *tree) {
    const trc_status status = tree_alloc(tree, topology->node_count, topology->leaf_count, 1, true);
    if (status != TRC_OK)
        return status;
    for (uint32_t leaf = 0; leaf < topology->leaf_count; leaf++)
        items_out[leaf] = items[refs[topology->leaf_begin[leaf]].primitive];
    tree->items = items_out;
    for (uint32_t n = tree->node_count; n-- > 0;) {
        uint32_t *children = (uint32_t *)trc_node_children(tree, n);
        memcpy(children, topology->children[n], sizeof topology->children[n]);
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
            float lower[3], upper[3];
            const uint32_t ref = children[i];
            if (ref != TRC_REF_EMPTY && (ref & TRC_REF_LEAF)) {
                const struct trc_ref *r = &refs[topology->leaf_begin[ref & TRC_REF_INDEX_MASK]];
                memcpy(lower, r->lower, sizeof lower);
                memcpy(upper, r->upper, sizeof upper);
            } else {
                ref_bounds(tree, ref, 0, lower, upper);
            }
            child_store(tree, n, i, 0, lower, upper);
        }
    }
    tree->root = topology->root;
    return TRC_OK;
}
