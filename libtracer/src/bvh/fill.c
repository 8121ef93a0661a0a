/* Memory of a tree: leaves, bounds into nodes, refit. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/leaf.h"
#include "bvh/packed.h"
#include "bvh/see_through.h"
#include "bvh/tree.h"
#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"

/* Nodes whose leaves one task fills: large enough that handing out tasks costs nothing. */
#define NODES_PER_TASK 256
/* What is filled is fetched so many nodes ahead. */
#define PREFETCH_NODES 4
/* Kernels load this many slots from wherever a leaf begins. */
#define LOAD_SLOTS 8

static struct trc_slot_block *slots_alloc(uint32_t count) {
    struct trc_slot_block *block =
        trc_alloc(sizeof *block + ((size_t)count + LOAD_SLOTS) * sizeof block->slots[0], 1);
    if (block)
        atomic_init(&block->refs, 1);
    return block;
}

static size_t node_stride_of(uint32_t key_count) {
    if (key_count < 2)
        return TRC_NODE_CHILDREN_BYTES + TRC_NODE_BOUNDS_BYTES;
    const size_t bytes = TRC_NODE_CHILDREN_BYTES + key_count * sizeof(struct trc_packed_boxes);
    return (bytes + TRC_NODE_ALIGNMENT - 1) / TRC_NODE_ALIGNMENT * TRC_NODE_ALIGNMENT;
}

/* slots: to share, or NULL for new ones. mesh: whose shape is in it; NULL: a TLAS. */
static trc_status tree_alloc(struct trc_tree *tree, uint32_t node_count, uint32_t slot_count,
                             uint32_t key_count, const struct trc_mesh *mesh,
                             struct trc_slot_block *slots) {
    const bool is_top = !mesh;
    *tree = (struct trc_tree){.key_count = key_count,
                              .node_count = node_count,
                              .slot_count = slot_count,
                              .root = TRC_REF_EMPTY,
                              .is_top = is_top};
    tree->node_stride = node_stride_of(key_count);
    tree->nodes = trc_alloc(node_count ? node_count : 1, tree->node_stride);
    size_t floats = (size_t)slot_count * key_count * TRC_TRIANGLE_FLOATS;
    if (mesh && mesh->shape) {
        tree->shape = mesh->shape;
        tree->vertex_count = mesh->vertex_count;
        floats = (size_t)mesh->vertex_count * key_count * TRC_CURVE_VERTEX_FLOATS;
    }
    if (!is_top) {
        tree->vertices = trc_alloc(floats + LOAD_SLOTS, sizeof *tree->vertices);
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
    trc_free(tree->see_through);
    if (tree->slots && atomic_fetch_sub(&tree->slots->refs, 1) == 1)
        trc_free(tree->slots);
    if (tree->slot_vertices && atomic_fetch_sub(&tree->slot_vertices->refs, 1) == 1)
        trc_free(tree->slot_vertices);
    *tree = (struct trc_tree){.root = TRC_REF_EMPTY};
}

static void node_bounds(const struct trc_tree *tree, uint32_t node, uint32_t key,
                        float lower_out[3], float upper_out[3]) {
    if (tree->key_count > 1) {
        trc_packed_hull(trc_node_packed(tree, node, key), lower_out, upper_out);
        return;
    }
    const float *b = trc_node_bounds(tree, node);
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

/* One of a node's boxes. */
static void box_store(float boxes[TRC_BOXES_FLOATS], uint32_t child, const float lower[3],
                      const float upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        boxes[16 * axis + (int)child] = lower[axis];
        boxes[16 * axis + 8 + (int)child] = upper[axis];
    }
}
static void child_store(struct trc_tree *tree, uint32_t node, uint32_t child, const float lower[3],
                        const float upper[3]) {
    box_store((float *)trc_node_bounds(tree, node), child, lower, upper);
}

/* Areas of a node's boxes. */
static double boxes_area(const float b[TRC_BOXES_FLOATS]) {
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
static void children_fill(struct trc_fill *fill, uint32_t n) {
    const uint32_t *from =
        fill->from ? trc_node_children(fill->from, n) : fill->topology->children[n];
    memcpy(fill->tree->nodes + n * fill->tree->node_stride, from, TRC_NODE_CHILDREN_BYTES);
}

/* Fills a leaf at a key and gives its box. */
static void leaf_fill(struct trc_fill *fill, uint32_t ref, uint32_t key, float lower[3],
                      float upper[3]) {
    if (!trc_leaf_fill(fill, ref, key, lower, upper))
        atomic_store_explicit(&fill->spoiled, true, memory_order_relaxed);
}

/* The leaves of a node at rest, and the boxes of those and of no children. */
static void leaves_fill(struct trc_fill *fill, uint32_t node) {
    struct trc_tree *tree = fill->tree;
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        float lower[3], upper[3];
        if (is_node(children[i]))
            continue;
        empty_bounds(lower, upper);
        if (is_leaf(children[i])) {
            trc_leaf_prepare(fill, children[i]);
            leaf_fill(fill, children[i], 0, lower, upper);
        }
        child_store(tree, node, i, lower, upper);
    }
}

/* Boxes of the children of a node at rest that are nodes, whose own boxes must be there; the areas
 * of all its boxes. */
static double nodes_bound(struct trc_tree *tree, uint32_t node) {
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        float lower[3], upper[3];
        if (!is_node(children[i]))
            continue;
        node_bounds(tree, children[i], 0, lower, upper);
        child_store(tree, node, i, lower, upper);
    }
    return boxes_area(trc_node_bounds(tree, node));
}

/* The leaves and boxes of a moving node, whose child nodes must be there, all bytes of it; the
 * areas of its boxes at key 0. */
static double moving_node_fill(struct trc_fill *fill, uint32_t node) {
    struct trc_tree *tree = fill->tree;
    const uint32_t *children = trc_node_children(tree, node);
    double area = 0.0;
    for (int i = 0; i < TRC_NODE_WIDTH; i++)
        if (is_leaf(children[i]))
            trc_leaf_prepare(fill, children[i]);
    for (uint32_t key = 0; key < tree->key_count; key++) {
        float boxes[TRC_BOXES_FLOATS];
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
            float lower[3], upper[3];
            empty_bounds(lower, upper);
            if (is_leaf(children[i]))
                leaf_fill(fill, children[i], key, lower, upper);
            else if (is_node(children[i]))
                node_bounds(tree, children[i], key, lower, upper);
            box_store(boxes, i, lower, upper);
        }
        trc_boxes_pack(boxes, (struct trc_packed_boxes *)trc_node_packed(tree, node, key));
        if (key == 0)
            area = boxes_area(boxes);
    }
    uint8_t *end = (uint8_t *)trc_node_packed(tree, node, tree->key_count);
    memset(end, 0, (size_t)(tree->nodes + (node + (size_t)1) * tree->node_stride - end));
    return area;
}

/* What of a node waits for its child nodes: of one at rest their boxes, of a moving one all. */
static double node_finish(struct trc_fill *fill, uint32_t node) {
    return fill->tree->key_count > 1 ? moving_node_fill(fill, node) : nodes_bound(fill->tree, node);
}

static bool is_cancelled(const struct trc_fill *fill) { return fill->cancel && *fill->cancel; }

/* A run of nodes: leaves forwards, as they lie in memory; boxes backwards, since children come
 * after their parents, mostly in the same run. */
static void fill_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    struct trc_fill *fill = context;
    struct trc_tree *tree = fill->tree;
    const uint32_t begin = index * NODES_PER_TASK, left = tree->node_count - begin;
    const uint32_t end = begin + (left < NODES_PER_TASK ? left : NODES_PER_TASK);
    double sum = 0.0;
    if (is_cancelled(fill))
        return;
    for (uint32_t n = begin; n < end; n++) {
        trc_fetch(tree->nodes + (n + PREFETCH_NODES) * tree->node_stride, tree->node_stride);
        children_fill(fill, n);
        if (tree->key_count < 2)
            leaves_fill(fill, n);
    }
    for (uint32_t n = end; n-- > begin;) {
        const uint32_t *children = trc_node_children(tree, n);
        fill->pending[n] = false;
        for (int i = 0; i < TRC_NODE_WIDTH; i++)
            if (is_node(children[i]) && (children[i] >= end || fill->pending[children[i]]))
                fill->pending[n] = true;
        if (fill->pending[n])
            continue;
        sum += node_finish(fill, n);
    }
    fill->area_sums[index] = sum;
}

/* A tree that is one leaf. */
static void root_leaf_fill(struct trc_fill *fill) {
    struct trc_tree *tree = fill->tree;
    float lower[3], upper[3];
    trc_leaf_prepare(fill, tree->root);
    for (uint32_t key = 0; key < tree->key_count; key++) {
        leaf_fill(fill, tree->root, key, lower, upper);
        bounds_grow(tree, lower, upper);
    }
}

/* Leaves and most nodes by all threads, then the nodes above them; all keys in one pass. */
static trc_status nodes_fill(struct trc_fill *fill, uint32_t task_count, struct trc_pool *pool) {
    struct trc_tree *tree = fill->tree;
    double sum = 0.0;
    trc_pool_run(pool, task_count, fill_task, fill);
    if (is_cancelled(fill))
        return trc_fail(TRC_ERROR_CANCELLED, "the build was cancelled");
    for (uint32_t i = 0; i < task_count; i++)
        sum += fill->area_sums[i];
    for (uint32_t n = tree->node_count; n-- > 0;)
        if (fill->pending[n])
            sum += node_finish(fill, n);
    for (uint32_t key = 0; is_node(tree->root) && key < tree->key_count; key++) {
        float lower[3], upper[3];
        node_bounds(tree, tree->root, key, lower, upper);
        bounds_grow(tree, lower, upper);
    }
    tree_finish(tree, sum);
    if (fill->spoiled)
        tree->extent = INFINITY;
    return TRC_OK;
}

/* Vertices of curves as kernels read them. */
static void curve_vertices_fill(const struct trc_mesh *mesh, struct trc_tree *tree) {
    const size_t count = (size_t)mesh->vertex_count * tree->key_count;
    for (size_t i = 0; i < count; i++) {
        float *v = tree->vertices + TRC_CURVE_VERTEX_FLOATS * i;
        memcpy(v, mesh->positions + 3 * i, 3 * sizeof *v);
        v[3] = mesh->radii[i];
    }
}

static trc_status tree_fill(struct trc_fill *fill, struct trc_pool *pool) {
    struct trc_tree *tree = fill->tree;
    if (tree->shape)
        curve_vertices_fill(fill->parts->mesh, tree);
    const uint32_t task_count = (tree->node_count + NODES_PER_TASK - 1) / NODES_PER_TASK;
    fill->pending = trc_alloc(tree->node_count ? tree->node_count : 1, sizeof *fill->pending);
    fill->area_sums = trc_alloc(task_count ? task_count : 1, sizeof *fill->area_sums);
    trc_status status = TRC_OK;
    empty_bounds(tree->lower, tree->upper);
    if (!fill->pending || !fill->area_sums)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to fill a tree of %u nodes",
                          tree->node_count);
    if (status == TRC_OK && is_leaf(tree->root))
        root_leaf_fill(fill);
    if (status == TRC_OK)
        status = nodes_fill(fill, task_count, pool);
    trc_free(fill->pending);
    trc_free(fill->area_sums);
    return status;
}

trc_status trc_tree_fill(const struct trc_topology *topology,
                         const struct trc_part_triangle *triangles, const struct box *boxes,
                         uint32_t count, const struct trc_part *parts, uint32_t key_count,
                         struct trc_pool *pool, const atomic_uint *cancel, struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, topology->node_count, count, key_count, parts->mesh, NULL);
    if (status != TRC_OK)
        return status;
    tree->root = topology->root;
    tree->has_pieces = boxes != NULL;
    struct trc_fill fill = {.topology = topology,
                            .triangles = triangles,
                            .boxes = boxes,
                            .parts = parts,
                            .tree = tree,
                            .cancel = cancel};
    trc_status filled = tree_fill(&fill, pool);
    if (filled == TRC_OK && fill.has_transparent)
        filled = trc_tree_mark_see_through(tree);
    if (filled != TRC_OK)
        trc_tree_destroy(tree);
    return filled;
}

static struct trc_slot_vertices *slot_vertices_alloc(uint32_t count) {
    struct trc_slot_vertices *v = trc_alloc(sizeof *v + count * sizeof v->index[0], 1);
    if (v)
        atomic_init(&v->refs, 1);
    return v;
}

trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, const atomic_uint *cancel,
                          struct trc_tree *tree) {
    const trc_status status =
        tree_alloc(tree, from->node_count, from->slot_count, key_count, part->mesh, from->slots);
    if (status != TRC_OK)
        return status;
    tree->root = from->root;
    struct trc_fill fill = {
        .from = from, .parts = part, .tree = tree, .known = from->slot_vertices, .cancel = cancel};
    tree->slot_vertices = from->slot_vertices;
    if (tree->slot_vertices)
        atomic_fetch_add(&tree->slot_vertices->refs, 1);
    else if (!tree->shape) /* without memory for it, the next refit asks the mesh again */
        tree->slot_vertices = fill.learnt = slot_vertices_alloc(from->slot_count);
    if (tree->slot_vertices)
        tree->bytes += from->slot_count * (uint64_t)sizeof tree->slot_vertices->index[0];
    trc_status filled = tree_fill(&fill, pool);
    if (filled == TRC_OK)
        filled = trc_tree_copy_see_through(from, tree);
    if (filled != TRC_OK)
        trc_tree_destroy(tree);
    return filled;
}

trc_status trc_tree_fill_top(const struct trc_topology *topology,
                             const struct trc_part_triangle *order, uint32_t count,
                             const struct trc_item *items, const struct box *boxes,
                             struct trc_item *items_out, struct trc_tree *tree) {
    TRC_TRY(tree_alloc(tree, topology->node_count, count, 1, NULL, NULL));
    bool has_transparent = false;
    for (uint32_t slot = 0; slot < count; slot++) {
        items_out[slot] = items[order[slot].triangle];
        has_transparent |= items_out[slot].tree->is_see_through;
    }
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
            child_store(tree, n, i, lower, upper);
        }
    }
    tree->root = topology->root;
    const trc_status marked = has_transparent ? trc_tree_mark_see_through(tree) : TRC_OK;
    if (marked != TRC_OK)
        trc_tree_destroy(tree);
    return marked;
}
