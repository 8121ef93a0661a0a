/* Memory of a tree: vertices into leaves, bounds into nodes, refit. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/tree.h"
#include "core/core.h"
#include "threads/pool.h"

/* Nodes whose leaves one task fills: large enough that handing out tasks costs nothing. */
#define NODES_PER_TASK 256
/* Kernels load this many slots from wherever a leaf begins. */
#define LOAD_SLOTS 8

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

static trc_status tree_alloc(struct trc_tree *tree, uint32_t node_count, uint32_t slot_count,
                             uint32_t key_count, bool is_top) {
    *tree = (struct trc_tree){.key_count = key_count,
                              .node_count = node_count,
                              .slot_count = slot_count,
                              .root = TRC_REF_EMPTY,
                              .is_top = is_top};
    tree->node_stride = TRC_NODE_HEADER_BYTES + (size_t)key_count * TRC_NODE_KEY_BYTES;
    tree->nodes = trc_alloc(node_count ? node_count : 1, tree->node_stride);
    const size_t floats = (size_t)slot_count * key_count * TRC_TRIANGLE_FLOATS;
    if (!is_top) {
        tree->vertices = trc_alloc(floats + LOAD_SLOTS, sizeof *tree->vertices);
        tree->slots = trc_alloc(slot_count ? slot_count : 1, sizeof *tree->slots);
    }
    if (!tree->nodes || (!is_top && (!tree->vertices || !tree->slots))) {
        trc_tree_destroy(tree);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree of %u nodes and %u slots",
                        node_count, slot_count);
    }
    tree->bytes = node_count * (uint64_t)tree->node_stride;
    if (!is_top) {
        memset(tree->vertices + floats, 0, LOAD_SLOTS * sizeof *tree->vertices);
        tree->bytes += (floats + LOAD_SLOTS) * sizeof *tree->vertices +
                       slot_count * (uint64_t)sizeof *tree->slots;
    }
    return TRC_OK;
}

void trc_tree_destroy(struct trc_tree *tree) {
    trc_free(tree->nodes);
    trc_free(tree->vertices);
    trc_free(tree->slots);
    *tree = (struct trc_tree){.root = TRC_REF_EMPTY};
}

struct fill_job {
    const struct trc_ref *refs; /* by slot; NULL: the slots are there, all of parts[0] */
    const struct trc_part *parts;
    struct trc_tree *tree;
    atomic_bool transparent;
};

static bool part_is_transparent(const struct trc_part *part, uint32_t triangle) {
    if (!part->transparent)
        return false;
    const uint32_t slot = part->mesh->material_index ? part->mesh->material_index[triangle] : 0;
    return part->transparent[slot < part->slot_count ? slot : part->slot_count - 1] != 0;
}

static const struct trc_part *slot_fill(struct fill_job *job, uint32_t slot) {
    if (!job->refs)
        return job->parts;
    const struct trc_ref *ref = &job->refs[slot];
    const struct trc_part *part = &job->parts[ref->part];
    const bool transparent = part_is_transparent(part, ref->primitive);
    if (transparent)
        atomic_store_explicit(&job->transparent, true, memory_order_relaxed);
    job->tree->slots[slot] = (struct trc_slot){
        part->instance | (transparent ? TRC_SLOT_TRANSPARENT : 0u), ref->primitive};
    return part;
}

static void leaf_fill(struct fill_job *job, uint32_t ref) {
    struct trc_tree *tree = job->tree;
    const uint32_t first = trc_leaf_first(ref), count = trc_leaf_count(ref);
    for (uint32_t slot = 0; slot < count; slot++) {
        const struct trc_part *part = slot_fill(job, first + slot);
        for (uint32_t key = 0; key < tree->key_count; key++) {
            float *v = trc_leaf_vertices(tree, ref, key) + slot;
            float p[3][3];
            trc_part_triangle(part, tree->slots[first + slot].triangle, key, p);
            for (uint32_t corner = 0; corner < 3; corner++)
                for (uint32_t axis = 0; axis < 3; axis++)
                    v[(3 * corner + axis) * count] = p[corner][axis];
        }
    }
}

/* lower and upper of a leaf at a key. */
static void leaf_bounds(const struct trc_tree *tree, uint32_t ref, uint32_t key, float lower[3],
                        float upper[3]) {
    const uint32_t count = trc_leaf_count(ref);
    const float *v = trc_leaf_vertices(tree, ref, key);
    for (uint32_t axis = 0; axis < 3; axis++) {
        const float *a = v + axis * count, *b = a + 3 * count, *c = b + 3 * count;
        float low = a[0], high = a[0];
        for (uint32_t slot = 0; slot < count; slot++) {
            const float l = a[slot] < b[slot] ? a[slot] : b[slot];
            const float h = a[slot] > b[slot] ? a[slot] : b[slot];
            low = l < low ? l : low;
            low = c[slot] < low ? c[slot] : low;
            high = h > high ? h : high;
            high = c[slot] > high ? c[slot] : high;
        }
        lower[axis] = low;
        upper[axis] = high;
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
        leaf_bounds(tree, ref, key, lower, upper);
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

/* Leaves of a run of nodes, and their boxes while they are at hand. */
static void fill_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct fill_job *job = context;
    struct trc_tree *tree = job->tree;
    const uint32_t begin = index * NODES_PER_TASK;
    for (uint32_t n = begin; n < tree->node_count && n < begin + NODES_PER_TASK; n++) {
        const uint32_t *children = trc_node_children(tree, n);
        for (int i = 0; i < TRC_NODE_WIDTH; i++)
            if (children[i] != TRC_REF_EMPTY && (children[i] & TRC_REF_LEAF))
                leaf_fill(job, children[i]);
        children_bound(tree, n, false);
    }
}

/* Leaves by all threads, then nodes after their children; all keys in one pass. */
static void tree_fill(struct fill_job *job, struct trc_pool *pool) {
    struct trc_tree *tree = job->tree;
    if (tree->root != TRC_REF_EMPTY && (tree->root & TRC_REF_LEAF))
        leaf_fill(job, tree->root);
    trc_pool_run(pool, (tree->node_count + NODES_PER_TASK - 1) / NODES_PER_TASK, fill_task, job);
    for (uint32_t n = tree->node_count; n-- > 0;)
        children_bound(tree, n, true);
    tree_finish(tree);
}

trc_status trc_tree_fill(const struct trc_topology *topology, const struct trc_ref *refs,
                         uint32_t count, const struct trc_part *parts, uint32_t key_count,
                         struct trc_pool *pool, struct trc_tree *tree) {
    const trc_status status = tree_alloc(tree, topology->node_count, count, key_count, false);
    if (status != TRC_OK)
        return status;
    for (uint32_t n = 0; n < topology->node_count; n++)
        memcpy(tree->nodes + n * tree->node_stride, topology->children[n],
               sizeof topology->children[n]);
    tree->root = topology->root;
    struct fill_job job = {refs, parts, tree, false};
    tree_fill(&job, pool);
    tree->has_transparent = job.transparent;
    return TRC_OK;
}

trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, from->node_count, from->slot_count, key_count, false);
    if (status != TRC_OK)
        return status;
    for (uint32_t n = 0; n < from->node_count; n++)
        memcpy(tree->nodes + n * tree->node_stride, from->nodes + n * from->node_stride,
               TRC_NODE_HEADER_BYTES);
    if (from->slot_count)
        memcpy(tree->slots, from->slots, from->slot_count * sizeof *tree->slots);
    tree->root = from->root;
    tree->has_transparent = from->has_transparent;
    struct fill_job job = {NULL, part, tree, false};
    tree_fill(&job, pool);
    return TRC_OK;
}

trc_status trc_tree_fill_top(const struct trc_topology *topology, const struct trc_ref *refs,
                             uint32_t count, const struct trc_item *items,
                             struct trc_item *items_out, struct trc_tree *tree) {
    const trc_status status = tree_alloc(tree, topology->node_count, count, 1, true);
    if (status != TRC_OK)
        return status;
    for (uint32_t slot = 0; slot < count; slot++)
        items_out[slot] = items[refs[slot].primitive];
    tree->items = items_out;
    for (uint32_t n = tree->node_count; n-- > 0;) {
        uint32_t *children = (uint32_t *)trc_node_children(tree, n);
        memcpy(children, topology->children[n], sizeof topology->children[n]);
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
            float lower[3], upper[3];
            const uint32_t ref = children[i];
            if (ref != TRC_REF_EMPTY && (ref & TRC_REF_LEAF)) {
                const struct trc_ref *r = &refs[trc_leaf_first(ref)];
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
