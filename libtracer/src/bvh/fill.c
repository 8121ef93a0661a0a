/* Memory of a tree: vertices into leaves, bounds into nodes, refit.
 *
 * Without gain: a pose in the memory of a former one (new pages are warm in the cache as the system
 * clears them, memory left is not); large pages for what builds hold meanwhile. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/tree.h"
#include "bvh/triangles4.h"
#include "core/core.h"
#include "core/pool.h"

/* Nodes whose leaves one task fills: large enough that handing out tasks costs nothing. */
#define NODES_PER_TASK 256
/* What is fetched so far ahead: what refits know of slots, and the memory that is filled, nodes and
 * vertices. */
#define PREFETCH_SLOTS 32
#define PREFETCH_NODES 4
#define PREFETCH_VERTEX_BYTES 2048
#define CACHE_LINE 64
/* Kernels load this many slots from wherever a leaf begins. */
#define LOAD_SLOTS 8

void trc_part_triangle(const struct trc_part *part, uint32_t triangle, uint32_t key,
                       float out[3][3]) {
    f4 corner[3];
    trc_part_corners_unplaced(part, part->mesh->indices + 3 * (size_t)triangle, key, corner);
    triangle_place(part, part->mesh->key_count > 1, corner);
    for (int v = 0; v < 3; v++)
        f4_store3(out[v], corner[v]);
}

static struct trc_slot_block *slots_alloc(uint32_t count) {
    struct trc_slot_block *block = trc_alloc(sizeof *block + count * sizeof block->slots[0], 1);
    if (block)
        atomic_init(&block->refs, 1);
    return block;
}

/* slots: to share, or NULL for new ones. */
static trc_status tree_alloc(struct trc_tree *tree, uint32_t node_count, uint32_t slot_count,
                             uint32_t key_count, bool is_top, struct trc_slot_block *slots) {
    *tree = (struct trc_tree){.key_count = key_count,
                              .node_count = node_count,
                              .slot_count = slot_count,
                              .root = TRC_REF_EMPTY,
                              .is_top = is_top};
    tree->node_stride = TRC_NODE_CHILDREN_BYTES + (size_t)key_count * TRC_NODE_KEY_BYTES;
    tree->nodes = trc_alloc_large(node_count ? node_count : 1, tree->node_stride);
    const size_t floats = (size_t)slot_count * key_count * TRC_TRIANGLE_FLOATS;
    if (!is_top) {
        tree->vertices = trc_alloc_large(floats + LOAD_SLOTS, sizeof *tree->vertices);
        tree->slots = slots ? slots : slots_alloc(slot_count);
        if (slots)
            atomic_fetch_add(&slots->refs, 1);
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
                       slot_count * (uint64_t)sizeof tree->slots->slots[0];
    }
    return TRC_OK;
}

void trc_tree_destroy(struct trc_tree *tree) {
    trc_free(tree->nodes);
    trc_free(tree->vertices);
    if (tree->slots && atomic_fetch_sub(&tree->slots->refs, 1) == 1)
        trc_free(tree->slots);
    if (tree->slot_vertices && atomic_fetch_sub(&tree->slot_vertices->refs, 1) == 1)
        trc_free(tree->slot_vertices);
    *tree = (struct trc_tree){.root = TRC_REF_EMPTY};
}

struct fill_job {
    /* What stands where: as in a tree that is refitted, all of parts[0], or by a topology, with
     * triangles by slot. */
    const struct trc_tree *from;
    const struct trc_topology *topology;
    const struct trc_part_triangle *triangles;
    const struct box *boxes; /* of clipped leaves, by their first slot, or NULL */
    const struct trc_part *parts;
    struct trc_tree *tree;
    const struct trc_slot_vertices *known; /* or NULL: asked of the mesh */
    struct trc_slot_vertices *learnt;      /* or NULL: not kept */
    const atomic_uint *cancel;             /* may be NULL */
    uint8_t *pending;                      /* per node: its box waits for nodes of other tasks */
    double *area_sums;                     /* per task: areas of the boxes that it set */
    atomic_bool transparent, spoiled;      /* spoiled: a coordinate is not finite */
};

static bool part_is_transparent(const struct trc_part *part, uint32_t triangle) {
    if (!part->transparent)
        return false;
    const uint32_t slot = part->mesh->material_index ? part->mesh->material_index[triangle] : 0;
    return part->transparent[slot < part->slot_count ? slot : part->slot_count - 1] != 0;
}

/* The part of what stands in the slot of a new tree. */
static inline const struct trc_part *slot_part(const struct fill_job *job, uint32_t slot) {
    return &job->parts[job->triangles[slot].part & TRC_PART_INDEX_MASK];
}

/* What stands in the slot of a new tree. */
static void slot_fill(struct fill_job *job, uint32_t slot) {
    const uint32_t triangle = job->triangles[slot].triangle;
    const struct trc_part *part = slot_part(job, slot);
    const bool transparent = part_is_transparent(part, triangle);
    if (transparent)
        atomic_store_explicit(&job->transparent, true, memory_order_relaxed);
    job->tree->slots->slots[slot] =
        (struct trc_slot){part->instance | (transparent ? TRC_SLOT_TRANSPARENT : 0u), triangle};
}

/* The slot's part, and the three vertices of its triangle there. */
static inline const struct trc_part *slot_source(const struct fill_job *job, uint32_t slot,
                                                 const uint32_t **index_out) {
    const struct trc_part *part = job->from ? job->parts : slot_part(job, slot);
    *index_out = job->known
                     ? job->known->index[slot]
                     : part->mesh->indices + 3 * (size_t)job->tree->slots->slots[slot].triangle;
    return part;
}

/* What does not depend on the key: what a new tree's slots stand for, what a refit learns of them.
 */
static void leaf_prepare(struct fill_job *job, uint32_t ref) {
    const uint32_t first = trc_leaf_first(ref), count = trc_leaf_count(ref);
    for (uint32_t slot = first; !job->from && slot < first + count; slot++)
        slot_fill(job, slot);
    for (uint32_t slot = first; job->learnt && slot < first + count; slot++) {
        const uint32_t *index;
        (void)slot_source(job, slot, &index);
        memcpy(job->learnt->index[slot], index, sizeof job->learnt->index[slot]);
    }
}

/* Asks for memory that will be written. */
static inline void fetch(const void *begin, size_t bytes) {
    for (size_t i = 0; i < bytes; i += CACHE_LINE)
        __builtin_prefetch((const char *)begin + i, 1);
}

/* The triangles of four slots from there on; of fewer, the last stands in the lanes left. */
static inline void slots_load(const struct fill_job *job, uint32_t slot, uint32_t count,
                              uint32_t key, struct triangles4 *out) {
    const struct trc_part *part[4];
    const uint32_t *index[4];
    for (uint32_t i = 0; i < 4; i++)
        part[i] = slot_source(job, slot + (i < count ? i : count - 1), &index[i]);
    triangles4_load(part, index, key, out);
}

/* The same of a refit that knows their vertices. */
static inline void known_load(const struct fill_job *job, uint32_t slot, uint32_t count,
                              uint32_t key, struct triangles4 *out) {
    const uint32_t(*known)[3] = job->known->index + slot;
    const struct trc_part *const part[4] = {job->parts, job->parts, job->parts, job->parts};
    const uint32_t *index[4];
    for (uint32_t i = 0; i < 4; i++)
        index[i] = known[i < count ? i : count - 1];
    __builtin_prefetch(known[PREFETCH_SLOTS]);
    triangles4_load(part, index, key, out);
}

/* Stores them into the rows of a leaf of count triangles. The lanes left of fewer than four go
 * where the next row will be, or, at its end, nowhere. */
static inline void rows_store(float *row, uint32_t count, const struct triangles4 *t) {
    const int whole = count >= 4 ? 9 : count > 1 ? 8 : 6; /* rows with room for four */
    for (int k = 0; k < 9; k++, row += count)
        if (k < whole)
            f4_store4(row, t->v[k / 3][k % 3]);
        else
            memcpy(row, &t->v[k / 3][k % 3], count * sizeof *row);
}

/* Fills the leaf at a key, four triangles at a time: of five to eight the last four, some for the
 * second time. Gives its box; false if a coordinate is not finite: the box ignores NaN. */
static bool leaf_fill(const struct fill_job *job, uint32_t ref, uint32_t key, float lower_out[3],
                      float upper_out[3]) {
    const uint32_t first = trc_leaf_first(ref), count = trc_leaf_count(ref);
    const uint32_t last = count > 4 ? count - 4 : 0;
    float *v = trc_leaf_vertices(job->tree, ref, key);
    f4 lower[3], upper[3], sum = f4_set(0.0f);
    fetch((char *)v + PREFETCH_VERTEX_BYTES, count * TRC_TRIANGLE_FLOATS * sizeof *v);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f4_set(INFINITY);
        upper[axis] = f4_set(-INFINITY);
    }
    for (uint32_t i = 0;; i = last) {
        struct triangles4 t;
        if (job->known)
            known_load(job, first + i, count, key, &t);
        else
            slots_load(job, first + i, count, key, &t);
        for (int axis = 0; axis < 3; axis++) {
            const f4 a = t.v[0][axis], b = t.v[1][axis], c = t.v[2][axis];
            lower[axis] = f4_min(f4_min(a, f4_min(b, c)), lower[axis]);
            upper[axis] = f4_max(f4_max(a, f4_max(b, c)), upper[axis]);
            sum += a + b + c;
        }
        rows_store(v + i, count, &t);
        if (i == last)
            break;
    }
    struct box box = box_around4(lower, upper);
    if (job->boxes && (job->triangles[first].part & TRC_PART_CLIPPED))
        box = box_common(box, job->boxes[first]);
    f4_store3(lower_out, box.lower);
    f4_store3(upper_out, box.upper);
    return i4_all(f4_abs(sum) < f4_set(INFINITY));
}

static void node_bounds(const struct trc_tree *tree, uint32_t node, uint32_t key,
                        float lower_out[3], float upper_out[3]) {
    const float *b = trc_node_bounds(tree, node, key);
    f4 lower[3], upper[3];
    for (int axis = 0; axis < 3; axis++, b += 16) {
        lower[axis] = f4_min(f4_load4(b), f4_load4(b + 4));
        upper[axis] = f4_max(f4_load4(b + 8), f4_load4(b + 12));
    }
    const struct box box = box_around4(lower, upper);
    f4_store3(lower_out, box.lower);
    f4_store3(upper_out, box.upper);
}

/* Of no child: inverted. */
static void empty_bounds(float lower[3], float upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = INFINITY;
        upper[axis] = -INFINITY;
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

/* Areas of the boxes of a node's children at key 0. */
static double children_area(const struct trc_tree *tree, uint32_t node) {
    const float *b = trc_node_bounds(tree, node, 0);
    f4 sum = f4_set(0.0f);
    for (int i = 0; i < TRC_NODE_WIDTH; i += 4) {
        f4 size[3];
        for (int axis = 0; axis < 3; axis++)
            size[axis] =
                f4_max(f4_load4(b + 16 * axis + 8 + i) - f4_load4(b + 16 * axis + i), f4_set(0.0f));
        sum += size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
    }
    return (double)sum[0] + sum[1] + sum[2] + sum[3];
}

/* Widens the tree's bounds. */
static void bounds_grow(struct trc_tree *tree, const float lower[3], const float upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        tree->lower[axis] = fminf(tree->lower[axis], lower[axis]);
        tree->upper[axis] = fmaxf(tree->upper[axis], upper[axis]);
    }
}

/* Scale of the tree's bounds, and the SAH cost at key 0: area_sum, that of every child's box, over
 * the root's. */
static void tree_finish(struct trc_tree *tree, double area_sum) {
    tree->extent = 0.0f;
    if (tree->root == TRC_REF_EMPTY)
        return;
    for (int axis = 0; axis < 3; axis++)
        tree->extent =
            fmaxf(tree->extent, fmaxf(fabsf(tree->lower[axis]), fabsf(tree->upper[axis])));
    const float root_area = box_area((struct box){f4_load3(tree->lower), f4_load3(tree->upper)});
    tree->sah_cost = root_area > 0.0f ? (float)(area_sum / root_area) : 0.0f;
}

static bool is_leaf(uint32_t ref) { return ref != TRC_REF_EMPTY && (ref & TRC_REF_LEAF); }
static bool is_node(uint32_t ref) { return !(ref & TRC_REF_LEAF); } /* the empty one has it too */

/* A node's references to its children: copied as its boxes are filled, so that its memory is met
 * once, and by all threads. */
static void children_fill(struct fill_job *job, uint32_t n) {
    const uint32_t *from = job->from ? trc_node_children(job->from, n) : job->topology->children[n];
    memcpy(job->tree->nodes + n * job->tree->node_stride, from, TRC_NODE_CHILDREN_BYTES);
}

/* The leaves of a node, and the boxes of those and of no children. */
static void leaves_fill(struct fill_job *job, uint32_t node) {
    struct trc_tree *tree = job->tree;
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        float lower[3], upper[3];
        if (is_node(children[i]))
            continue;
        if (is_leaf(children[i]))
            leaf_prepare(job, children[i]);
        for (uint32_t key = 0; key < tree->key_count; key++) {
            if (is_leaf(children[i]) && !leaf_fill(job, children[i], key, lower, upper))
                atomic_store_explicit(&job->spoiled, true, memory_order_relaxed);
            if (children[i] == TRC_REF_EMPTY)
                empty_bounds(lower, upper);
            child_store(tree, node, i, key, lower, upper);
        }
    }
}

/* Boxes of a node's children that are nodes, whose own boxes must be there. */
static void nodes_bound(struct trc_tree *tree, uint32_t node) {
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++)
        for (uint32_t key = 0; is_node(children[i]) && key < tree->key_count; key++) {
            float lower[3], upper[3];
            node_bounds(tree, children[i], key, lower, upper);
            child_store(tree, node, i, key, lower, upper);
        }
}

static bool is_cancelled(const struct fill_job *job) { return job->cancel && *job->cancel; }

/* A run of nodes: leaves forwards, as they lie in memory; boxes backwards, since children come
 * after their parents, mostly in the same run. */
static void fill_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct fill_job *job = context;
    struct trc_tree *tree = job->tree;
    const uint32_t begin = index * NODES_PER_TASK, left = tree->node_count - begin;
    const uint32_t end = begin + (left < NODES_PER_TASK ? left : NODES_PER_TASK);
    double sum = 0.0;
    if (is_cancelled(job))
        return;
    for (uint32_t n = begin; n < end; n++) {
        fetch(tree->nodes + (n + PREFETCH_NODES) * tree->node_stride, tree->node_stride);
        children_fill(job, n);
        leaves_fill(job, n);
    }
    for (uint32_t n = end; n-- > begin;) {
        const uint32_t *children = trc_node_children(tree, n);
        job->pending[n] = false;
        for (int i = 0; i < TRC_NODE_WIDTH; i++)
            if (is_node(children[i]) && (children[i] >= end || job->pending[children[i]]))
                job->pending[n] = true;
        if (job->pending[n])
            continue;
        nodes_bound(tree, n);
        sum += children_area(tree, n);
    }
    job->area_sums[index] = sum;
}

/* A tree that is one leaf. */
static void root_leaf_fill(struct fill_job *job) {
    struct trc_tree *tree = job->tree;
    float lower[3], upper[3];
    leaf_prepare(job, tree->root);
    for (uint32_t key = 0; key < tree->key_count; key++) {
        if (!leaf_fill(job, tree->root, key, lower, upper))
            job->spoiled = true;
        bounds_grow(tree, lower, upper);
    }
}

/* Leaves and most nodes by all threads, then the nodes above them; all keys in one pass. */
static trc_status nodes_fill(struct fill_job *job, uint32_t task_count, struct trc_pool *pool) {
    struct trc_tree *tree = job->tree;
    double sum = 0.0;
    trc_pool_run(pool, task_count, fill_task, job);
    if (is_cancelled(job))
        return trc_fail(TRC_ERROR_CANCELLED, "the build was cancelled");
    for (uint32_t i = 0; i < task_count; i++)
        sum += job->area_sums[i];
    for (uint32_t n = tree->node_count; n-- > 0;)
        if (job->pending[n]) {
            nodes_bound(tree, n);
            sum += children_area(tree, n);
        }
    for (uint32_t key = 0; is_node(tree->root) && key < tree->key_count; key++) {
        float lower[3], upper[3];
        node_bounds(tree, tree->root, key, lower, upper);
        bounds_grow(tree, lower, upper);
    }
    tree_finish(tree, sum);
    if (job->spoiled)
        tree->extent = INFINITY;
    return TRC_OK;
}

static trc_status tree_fill(struct fill_job *job, struct trc_pool *pool) {
    struct trc_tree *tree = job->tree;
    const uint32_t task_count = (tree->node_count + NODES_PER_TASK - 1) / NODES_PER_TASK;
    job->pending = trc_alloc(tree->node_count ? tree->node_count : 1, sizeof *job->pending);
    job->area_sums = trc_alloc(task_count ? task_count : 1, sizeof *job->area_sums);
    trc_status status = TRC_OK;
    empty_bounds(tree->lower, tree->upper);
    if (!job->pending || !job->area_sums)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to fill a tree of %u nodes",
                          tree->node_count);
    if (status == TRC_OK && is_leaf(tree->root))
        root_leaf_fill(job);
    if (status == TRC_OK)
        status = nodes_fill(job, task_count, pool);
    trc_free(job->pending);
    trc_free(job->area_sums);
    return status;
}

trc_status trc_tree_fill(const struct trc_topology *topology,
                         const struct trc_part_triangle *triangles, const struct box *boxes,
                         uint32_t count, const struct trc_part *parts, uint32_t key_count,
                         struct trc_pool *pool, const atomic_uint *cancel, struct trc_tree *tree) {
    const trc_status status = tree_alloc(tree, topology->node_count, count, key_count, false, NULL);
    if (status != TRC_OK)
        return status;
    tree->root = topology->root;
    tree->has_pieces = boxes != NULL;
    struct fill_job job = {.topology = topology,
                           .triangles = triangles,
                           .boxes = boxes,
                           .parts = parts,
                           .tree = tree,
                           .cancel = cancel};
    const trc_status filled = tree_fill(&job, pool);
    tree->has_transparent = job.transparent;
    if (filled != TRC_OK)
        trc_tree_destroy(tree);
    return filled;
}

static struct trc_slot_vertices *slot_vertices_alloc(uint32_t count) {
    struct trc_slot_vertices *v = trc_alloc_large(sizeof *v + count * sizeof v->index[0], 1);
    if (v)
        atomic_init(&v->refs, 1);
    return v;
}

trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, const atomic_uint *cancel,
                          struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, from->node_count, from->slot_count, key_count, false, from->slots);
    if (status != TRC_OK)
        return status;
    tree->root = from->root;
    tree->has_transparent = from->has_transparent;
    struct fill_job job = {
        .from = from, .parts = part, .tree = tree, .known = from->slot_vertices, .cancel = cancel};
    tree->slot_vertices = from->slot_vertices;
    if (tree->slot_vertices)
        atomic_fetch_add(&tree->slot_vertices->refs, 1);
    else /* without memory for it, the next refit asks the mesh again */
        tree->slot_vertices = job.learnt = slot_vertices_alloc(from->slot_count);
    if (tree->slot_vertices)
        tree->bytes += from->slot_count * (uint64_t)sizeof tree->slot_vertices->index[0];
    const trc_status filled = tree_fill(&job, pool);
    if (filled != TRC_OK)
        trc_tree_destroy(tree);
    return filled;
}

trc_status trc_tree_fill_top(const struct trc_topology *topology,
                             const struct trc_part_triangle *order, uint32_t count,
                             const struct trc_item *items, const struct box *boxes,
                             struct trc_item *items_out, struct trc_tree *tree) {
    const trc_status status = tree_alloc(tree, topology->node_count, count, 1, true, NULL);
    if (status != TRC_OK)
        return status;
    for (uint32_t slot = 0; slot < count; slot++)
        items_out[slot] = items[order[slot].triangle];
    tree->items = items_out;
    for (uint32_t n = tree->node_count; n-- > 0;) {
        uint32_t *children = (uint32_t *)trc_node_children(tree, n);
        memcpy(children, topology->children[n], sizeof topology->children[n]);
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
            float lower[3], upper[3];
            const uint32_t ref = children[i];
            if (is_leaf(ref)) {
                const struct box *box = &boxes[order[trc_leaf_first(ref)].triangle];
                f4_store3(lower, box->lower);
                f4_store3(upper, box->upper);
            } else if (is_node(ref)) {
                node_bounds(tree, ref, 0, lower, upper);
            } else {
                empty_bounds(lower, upper);
            }
            child_store(tree, n, i, 0, lower, upper);
        }
    }
    tree->root = topology->root;
    return TRC_OK;
}
