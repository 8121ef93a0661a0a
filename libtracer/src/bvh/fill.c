/* Memory of a tree: leaves, bounds into nodes, refit. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/block.h"
#include "bvh/packed.h"
#include "bvh/see_through.h"
#include "bvh/tree.h"
#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"

/* What is filled is fetched so many nodes ahead. */
#define PREFETCH_NODES 4
/* Kernels load this many slots from wherever a leaf begins, and floats. */
#define LOAD_SLOTS 8
#define LOAD_FLOATS TRC_BLOCK_LOAD
_Static_assert(LOAD_FLOATS >= LOAD_SLOTS, "blocks are loaded by more than other leaves");

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

/* slots: to share, or NULL for new ones. mesh: whose shape is in it; NULL: a TLAS. floats: of its
 * vertices, but for curves. */
static trc_status tree_alloc(struct trc_tree *tree, uint32_t node_count, uint32_t slot_count,
                             uint32_t key_count, const struct trc_mesh *mesh, size_t floats,
                             struct trc_slot_block *slots) {
    const bool is_top = !mesh;
    *tree = (struct trc_tree){.key_count = key_count,
                              .node_count = node_count,
                              .slot_count = slot_count,
                              .root = TRC_REF_EMPTY,
                              .is_top = is_top};
    tree->node_stride = node_stride_of(key_count);
    tree->nodes = trc_alloc(node_count ? node_count : 1, tree->node_stride);
    if (mesh && mesh->shape) {
        tree->shape = mesh->shape;
        tree->vertex_count = mesh->vertex_count;
        floats = (size_t)mesh->vertex_count * key_count * TRC_CURVE_VERTEX_FLOATS;
    }
    if (!is_top) {
        tree->vertex_floats = floats;
        tree->vertices = trc_alloc(floats + LOAD_FLOATS, sizeof *tree->vertices);
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
        memset(tree->vertices + floats, 0, LOAD_FLOATS * sizeof *tree->vertices);
        tree->bytes += (floats + LOAD_FLOATS) * sizeof *tree->vertices +
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
    trc_slot_vertices_release(tree->slot_vertices);
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

static bool is_node(uint32_t ref) { return !(ref & TRC_REF_LEAF); } /* the empty one has it too */

/* A reference of what is filled from, as the tree has it. Leaves that are blocks are begun. */
static uint32_t ref_fill(const struct trc_fill *fill, uint32_t from) {
    uint32_t ref = from;
    if (!trc_ref_is_leaf(from))
        return from;
    if (fill->plan)
        ref = trc_leaf_ref(fill->plan->places[trc_fill_first(fill, from)], trc_leaf_count(from));
    else if (!trc_tree_has_blocks(fill->tree))
        ref = trc_leaf_ref(trc_fill_first(fill, from), trc_leaf_count(from));
    if (trc_tree_has_blocks(fill->tree))
        trc_block_begin(fill, from, ref);
    return ref;
}

/* A node's references to its children: copied as its boxes are filled, so that its memory is met
 * once, and by all threads. */
static void children_fill(struct trc_fill *fill, uint32_t n) {
    const uint32_t *from = trc_fill_children(fill, n);
    uint32_t *children = (uint32_t *)trc_node_children(fill->tree, n);
    for (int i = 0; i < TRC_NODE_WIDTH; i++)
        children[i] = ref_fill(fill, from[i]);
}

/* A leaf while it is filled key by key. */
struct leaf {
    const uint32_t *vertices; /* of its block, or NULL */
    uint32_t memory[TRC_BLOCK_VERTICES];
};
static void leaf_prepare(struct trc_fill *fill, uint32_t ref, struct leaf *leaf) {
    leaf->vertices = NULL;
    if (trc_tree_has_blocks(fill->tree))
        leaf->vertices = trc_block_prepare(fill, ref, leaf->memory);
    else
        trc_leaf_prepare(fill, ref);
}
static void leaf_fill(struct trc_fill *fill, uint32_t ref, const struct leaf *leaf, uint32_t key,
                      float lower[3], float upper[3]) {
    const bool is_finite = leaf->vertices
                               ? trc_block_fill(fill, ref, leaf->vertices, key, lower, upper)
                               : trc_leaf_fill(fill, ref, key, lower, upper);
    if (!is_finite)
        atomic_store_explicit(&fill->spoiled, true, memory_order_relaxed);
}

/* The leaves of a node at rest, and the boxes of those and of no children. */
static void leaves_fill(struct trc_fill *fill, uint32_t node) {
    struct trc_tree *tree = fill->tree;
    const uint32_t *children = trc_node_children(tree, node);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        float lower[3], upper[3];
        struct leaf leaf;
        if (is_node(children[i]))
            continue;
        empty_bounds(lower, upper);
        if (trc_ref_is_leaf(children[i])) {
            leaf_prepare(fill, children[i], &leaf);
            leaf_fill(fill, children[i], &leaf, 0, lower, upper);
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
    struct leaf leaves[TRC_NODE_WIDTH];
    double area = 0.0;
    for (int i = 0; i < TRC_NODE_WIDTH; i++)
        if (trc_ref_is_leaf(children[i]))
            leaf_prepare(fill, children[i], &leaves[i]);
    for (uint32_t key = 0; key < tree->key_count; key++) {
        float boxes[TRC_BOXES_FLOATS];
        for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
            float lower[3], upper[3];
            empty_bounds(lower, upper);
            if (trc_ref_is_leaf(children[i]))
                leaf_fill(fill, children[i], &leaves[i], key, lower, upper);
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
    const uint32_t begin = index * TRC_FILL_NODES, left = tree->node_count - begin;
    const uint32_t end = begin + (left < TRC_FILL_NODES ? left : TRC_FILL_NODES);
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
    struct leaf leaf;
    leaf_prepare(fill, tree->root, &leaf);
    for (uint32_t key = 0; key < tree->key_count; key++) {
        leaf_fill(fill, tree->root, &leaf, key, lower, upper);
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

/* root: of what is filled from. */
static trc_status tree_fill(struct trc_fill *fill, uint32_t root, struct trc_pool *pool) {
    struct trc_tree *tree = fill->tree;
    if (tree->shape)
        curve_vertices_fill(fill->parts->mesh, tree);
    const uint32_t task_count = trc_fill_tasks(tree->node_count);
    fill->pending = trc_alloc(tree->node_count ? tree->node_count : 1, sizeof *fill->pending);
    fill->area_sums = trc_alloc(task_count ? task_count : 1, sizeof *fill->area_sums);
    trc_status status = TRC_OK;
    empty_bounds(tree->lower, tree->upper);
    if (!fill->pending || !fill->area_sums)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to fill a tree of %u nodes",
                          tree->node_count);
    if (status == TRC_OK)
        tree->root = ref_fill(fill, root);
    if (status == TRC_OK && trc_ref_is_leaf(tree->root))
        root_leaf_fill(fill);
    if (status == TRC_OK)
        status = nodes_fill(fill, task_count, pool);
    trc_free(fill->pending);
    trc_free(fill->area_sums);
    return status;
}

/* Floats of a tree's leaves, but for curves. */
static size_t leaf_floats(const struct trc_fill *fill, uint32_t slot_count, uint32_t key_count) {
    if (fill->plan)
        return (size_t)fill->plan->unit_count * (TRC_BLOCK_UNIT / sizeof(float));
    return key_count > 1 && fill->from ? fill->from->vertex_floats
                                       : (size_t)slot_count * TRC_TRIANGLE_FLOATS;
}

/* Whether leaves are blocks that what they are filled from does not have. */
static bool needs_plan(const struct trc_fill *fill, uint32_t key_count) {
    return key_count > 1 && !fill->parts->mesh->shape &&
           !(fill->from && fill->from->key_count == key_count);
}

trc_status trc_tree_fill(const struct trc_topology *topology,
                         const struct trc_part_triangle *triangles, const struct box *boxes,
                         uint32_t count, const struct trc_part *parts, uint32_t key_count,
                         struct trc_pool *pool, const atomic_uint *cancel, struct trc_tree *tree) {
    struct trc_fill fill = {.topology = topology,
                            .triangles = triangles,
                            .boxes = boxes,
                            .parts = parts,
                            .tree = tree,
                            .cancel = cancel};
    struct trc_block_plan plan = {0};
    trc_status status = TRC_OK;
    if (needs_plan(&fill, key_count)) {
        status = trc_block_plan_make(&fill, topology->node_count, topology->root, count, key_count,
                                     pool, &plan);
        fill.plan = &plan;
        fill.known = plan.vertices;
    }
    if (status == TRC_OK)
        status = tree_alloc(tree, topology->node_count, count, key_count, parts->mesh,
                            leaf_floats(&fill, count, key_count), NULL);
    if (status == TRC_OK) {
        tree->has_pieces = boxes != NULL;
        status = tree_fill(&fill, topology->root, pool);
        if (status == TRC_OK && fill.has_transparent)
            status = trc_tree_mark_see_through(tree);
        if (status != TRC_OK)
            trc_tree_destroy(tree);
    }
    trc_block_plan_destroy(&plan);
    return status;
}

/* What a refit knows of slots, or learns for the next: without memory for it, that asks the mesh
 * again. */
static void slot_vertices_share(struct trc_fill *fill) {
    struct trc_tree *tree = fill->tree;
    const bool is_learnt_alike =
        trc_tree_has_blocks(fill->from) == trc_tree_has_blocks(tree) && !tree->shape;
    fill->known = is_learnt_alike ? fill->from->slot_vertices : NULL;
    if (fill->plan)
        fill->known = fill->plan->vertices;
    if (fill->known) {
        tree->slot_vertices = (struct trc_slot_vertices *)fill->known;
        atomic_fetch_add(&tree->slot_vertices->refs, 1);
    } else if (!tree->shape) {
        tree->slot_vertices = fill->learnt = trc_slot_vertices_alloc(tree->slot_count);
    }
    if (tree->slot_vertices)
        tree->bytes += tree->slot_count * (uint64_t)sizeof tree->slot_vertices->index[0];
}

trc_status trc_tree_refit(const struct trc_tree *from, const struct trc_part *part,
                          uint32_t key_count, struct trc_pool *pool, const atomic_uint *cancel,
                          struct trc_tree *tree) {
    struct trc_fill fill = {.from = from, .parts = part, .tree = tree, .cancel = cancel};
    struct trc_block_plan plan = {0};
    trc_status status = TRC_OK;
    if (needs_plan(&fill, key_count)) {
        status = trc_block_plan_make(&fill, from->node_count, from->root, from->slot_count,
                                     key_count, pool, &plan);
        fill.plan = &plan;
    }
    if (status == TRC_OK)
        status = tree_alloc(tree, from->node_count, from->slot_count, key_count, part->mesh,
                            leaf_floats(&fill, from->slot_count, key_count), from->slots);
    if (status == TRC_OK) {
        slot_vertices_share(&fill);
        status = tree_fill(&fill, from->root, pool);
        if (status == TRC_OK)
            status = trc_tree_copy_see_through(from, tree);
        if (status != TRC_OK)
            trc_tree_destroy(tree);
    }
    trc_block_plan_destroy(&plan);
    return status;
}

trc_status trc_tree_fill_top(const struct trc_topology *topology,
                             const struct trc_part_triangle *order, uint32_t count,
                             const struct trc_item *items, const struct box *boxes,
                             struct trc_item *items_out, struct trc_tree *tree) {
    TRC_TRY(tree_alloc(tree, topology->node_count, count, 1, NULL, 0, NULL));
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
            if (trc_ref_is_leaf(ref)) {
                const struct box *box = &boxes[order[trc_ref_index(ref)].triangle];
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
