/* Shape of a tree: binned SAH.
 *
 * Ingo Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007, for the
 * binning; nodes are opened to eight children by splitting the child of the largest area, as in
 * Wald, Benthin and Boulos, "Getting Rid of Packets", 2008. The upper part of the tree is made by
 * one thread that leaves subtrees of TASK_SIZE refs or less as tasks; sizes do not depend on the
 * number of threads, so the tree does not either.
 *
 * Without gain: triangles cut before the build at spatial median planes (Karras and Aila, "Fast
 * Parallel Construction of High-Quality Bounding Volume Hierarchies", 2013) make the cost of
 * the generated conference room 10 to 29 % higher for 5 to 90 % more refs. */
#include <float.h>
#include <string.h>

#include "bvh/tree.h"
#include "core/box.h"
#include "core/core.h"
#include "threads/pool.h"

/* Bins per axis: 16 loses about 1 % of SAH cost against 32 and builds a third faster; where refs
 * are few, half as many are as good, and a quarter where a leaf would do. */
#define BIN_COUNT 16
#define FEW_REFS 24
#define FEW_BINS 8
#define LEAF_BINS 4
/* Largest subtree that is one task. */
#define TASK_SIZE 8192
/* Cost of visiting a node against one triangle of a leaf. A leaf is one block whatever its count,
 * and packets cull its triangles in one step, so leaves may be full. */
#define NODE_COST 3.0f
/* From this level (of 8-wide nodes) on, ranges are halved whatever the SAH says: 2^28 refs are
 * exhausted within TRC_MAX_LEVELS. */
#define MEDIAN_LEVEL 32

/* Four floats of a ref, of which lane 3 is one of its integers: never used as a number. */
static inline f4 ref_corner(const struct trc_ref *r, size_t offset) {
    i4 v;
    memcpy(&v, (const char *)r + offset, sizeof v);
    return (f4)(v & (i4){-1, -1, -1, 0});
}
static inline f4 ref_lower(const struct trc_ref *r) {
    return ref_corner(r, offsetof(struct trc_ref, lower));
}
static inline f4 ref_upper(const struct trc_ref *r) {
    return ref_corner(r, offsetof(struct trc_ref, upper));
}

/* Twice the middle of its box. */
static inline f4 ref_centroid(const struct trc_ref *r) { return ref_lower(r) + ref_upper(r); }

/* A range of refs that becomes a child. */
struct range {
    uint32_t begin, end;
    struct box bounds, centroids; /* centroids: of lower + upper */
};

struct split {
    int axis; /* -1: none found */
    int bin;  /* refs of bins < bin go left */
    int bin_count;
    float cost;       /* sum of area * count of both sides */
    f4 origin, scale; /* bin = (centroid - origin) * scale, at most last_bin */
    f4 last_bin;
    struct box left, right;
};

static struct range range_measure(const struct trc_ref *refs, uint32_t begin, uint32_t end) {
    struct range r = {begin, end, box_empty(), box_empty()};
    for (uint32_t i = begin; i < end; i++) {
        box_grow(&r.bounds, (struct box){ref_lower(&refs[i]), ref_upper(&refs[i])});
        box_add(&r.centroids, ref_centroid(&refs[i]));
    }
    return r;
}

static inline i4 bin_of(const struct split *s, const struct trc_ref *r) {
    const f4 x = (ref_centroid(r) - s->origin) * s->scale;
    return __builtin_convertvector(f4_min(f4_max(x, (f4){0.0f, 0.0f, 0.0f, 0.0f}), s->last_bin),
                                   i4);
}

static inline bool is_left(const struct split *s, const struct trc_ref *r) {
    return bin_of(s, r)[s->axis] < s->bin;
}

struct bins {
    struct box box[3][BIN_COUNT];
    uint32_t count[3][BIN_COUNT];
};

static void bins_fill(const struct trc_ref *refs, const struct range *r, const struct split *s,
                      struct bins *bins) {
    const struct box empty = box_empty();
    memset(bins->count, 0, sizeof bins->count);
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < s->bin_count; i++)
            bins->box[axis][i] = empty;
    for (uint32_t i = r->begin; i < r->end; i++) {
        const i4 b = bin_of(s, &refs[i]);
        const struct box box = {ref_lower(&refs[i]), ref_upper(&refs[i])};
        for (int axis = 0; axis < 3; axis++) {
            box_grow(&bins->box[axis][b[axis]], box);
            bins->count[axis][b[axis]]++;
        }
    }
}

/* Sweeps the bins of one axis from both ends, keeping the cheapest plane. */
static void bins_sweep(const struct bins *bins, int axis, struct split *s) {
    f4 left_size[BIN_COUNT], right_size[BIN_COUNT]; /* of the boxes beside the plane below a bin */
    float left_count[BIN_COUNT], right_count[BIN_COUNT];
    struct box left = box_empty(), right = box_empty();
    uint32_t before = 0, after = 0;
    for (int i = 0, k = s->bin_count - 1; k >= 0; i++, k--) {
        left_size[i] = box_size(left);
        left_count[i] = (float)before;
        box_grow(&left, bins->box[axis][i]);
        before += bins->count[axis][i];
        box_grow(&right, bins->box[axis][k]);
        after += bins->count[axis][k];
        right_size[k] = box_size(right);
        right_count[k] = (float)after;
    }
    for (int i = 0; i < s->bin_count; i += 4) {
        f4 left_counts, right_counts;
        memcpy(&left_counts, left_count + i, sizeof left_counts);
        memcpy(&right_counts, right_count + i, sizeof right_counts);
        const f4 cost =
            box_areas(left_size + i) * left_counts + box_areas(right_size + i) * right_counts;
        const i4 better = (cost < f4_set(s->cost)) & (left_counts > 0.0f) & (right_counts > 0.0f);
        for (int k = 0; i4_any(better) && k < 4; k++) {
            if (!better[k] || cost[k] >= s->cost)
                continue;
            s->cost = cost[k];
            s->axis = axis;
            s->bin = i + k;
        }
    }
}

static int bin_count(uint32_t ref_count) {
    if (ref_count <= TRC_NODE_WIDTH)
        return LEAF_BINS;
    return ref_count <= FEW_REFS ? FEW_BINS : BIN_COUNT;
}

static struct split split_find(const struct trc_ref *refs, const struct range *r) {
    struct split s = {.axis = -1, .bin = 0, .cost = FLT_MAX};
    s.bin_count = bin_count(r->end - r->begin);
    const float last = (float)(s.bin_count - 1);
    s.last_bin = (f4){last, last, last, last};
    const f4 size = r->centroids.upper - r->centroids.lower;
    s.origin = r->centroids.lower;
    for (int axis = 0; axis < 3; axis++) {
        /* A little below the count so that the last centroid falls into the last bin; flat axes all
         * go to bin 0 and offer no plane. */
        const float scale = (float)s.bin_count * 0.9999f / size[axis];
        s.scale[axis] = size[axis] > 0.0f && scale < FLT_MAX ? scale : 0.0f;
    }
    struct bins bins;
    bins_fill(refs, r, &s, &bins);
    for (int axis = 0; axis < 3; axis++)
        if (s.scale[axis] > 0.0f)
            bins_sweep(&bins, axis, &s);
    if (s.axis < 0)
        return s;
    s.left = s.right = box_empty();
    for (int i = 0; i < s.bin_count; i++)
        box_grow(i < s.bin ? &s.left : &s.right, bins.box[s.axis][i]);
    return s;
}

/* Moves the refs left of the plane to the front and measures both sides' centroids on the way. */
static void split_apply(struct trc_ref *refs, const struct range *r, const struct split *s,
                        struct range *left, struct range *right) {
    uint32_t i = r->begin, j = r->end;
    struct box before = box_empty(), after = box_empty();
    for (;;) {
        for (; i < j && is_left(s, &refs[i]); i++)
            box_add(&before, ref_centroid(&refs[i]));
        for (; i < j && !is_left(s, &refs[j - 1]); j--)
            box_add(&after, ref_centroid(&refs[j - 1]));
        if (i >= j)
            break;
        const struct trc_ref swap = refs[i];
        refs[i] = refs[j - 1];
        refs[j - 1] = swap;
    }
    *left = (struct range){r->begin, i, s->left, before};
    *right = (struct range){i, r->end, s->right, after};
}

static void split_middle(const struct trc_ref *refs, const struct range *r, struct range *left,
                         struct range *right) {
    const uint32_t middle = r->begin + (r->end - r->begin) / 2;
    *left = range_measure(refs, r->begin, middle);
    *right = range_measure(refs, middle, r->end);
}

/* A growing part of the tree. */
struct arena {
    uint32_t (*children)[TRC_NODE_WIDTH];
    uint32_t node_count, node_capacity;
    bool failed;
};

struct task {
    struct range range;
    uint32_t parent, slot; /* where in the upper part its root goes */
    uint32_t level;
    uint32_t root;
    struct arena arena;
};

struct builder {
    struct trc_ref *refs;
    uint32_t leaf_size;
    const atomic_uint *cancel;
    struct task *tasks; /* filled while the upper part is made */
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

/* Splits r in two unless it is better, and possible, to leave it a leaf. A build that is cancelled
 * splits no more: what it has made is thrown away. */
static bool range_divide(struct builder *b, const struct range *r, uint32_t level,
                         struct range *left, struct range *right) {
    const uint32_t count = r->end - r->begin;
    const bool must = count > b->leaf_size;
    if (count < 2 || (!must && (float)count <= NODE_COST) || is_cancelled(b))
        return false;
    if (level >= MEDIAN_LEVEL) {
        if (must)
            split_middle(b->refs, r, left, right);
        return must;
    }
    const struct split s = split_find(b->refs, r);
    const float area = box_area(r->bounds);
    if (!must && !(s.axis >= 0 && s.cost + area * NODE_COST < area * (float)count))
        return false;
    if (s.axis < 0) {
        split_middle(b->refs, r, left, right);
        return true;
    }
    split_apply(b->refs, r, &s, left, right);
    return true;
}

/* Opens r into up to eight ranges, the largest area first, then the most refs; 1 when r stays a
 * leaf.
 */
static int range_open(struct builder *b, const struct range *r, uint32_t level,
                      struct range out[TRC_NODE_WIDTH]) {
    int count = 1;
    bool closed[TRC_NODE_WIDTH] = {false};
    out[0] = *r;
    while (count < TRC_NODE_WIDTH) {
        int best = -1;
        float best_area = -1.0f;
        for (int i = 0; i < count; i++) {
            const float area = closed[i] ? -1.0f : box_area(out[i].bounds);
            const bool ties = best >= 0 && area == best_area &&
                              out[i].end - out[i].begin > out[best].end - out[best].begin;
            if (area > best_area || ties) {
                best_area = area;
                best = i;
            }
        }
        if (best < 0)
            break;
        struct range left, right;
        if (!range_divide(b, &out[best], level, &left, &right)) {
            closed[best] = true;
            continue;
        }
        out[best] = left;
        out[count++] = right;
    }
    return count;
}

/* Builds r into the arena, depth first; in the upper part (tasks true) small ranges become tasks.
 */
static uint32_t build_range(struct builder *b, struct arena *a, const struct range *r,
                            uint32_t level, bool tasks) {
    struct range child[TRC_NODE_WIDTH];
    if (a->failed || b->failed || is_cancelled(b))
        return TRC_REF_EMPTY;
    const int count = range_open(b, r, level, child);
    if (count == 1)
        return trc_leaf_ref(r->begin, r->end - r->begin);
    const uint32_t node = arena_node(a);
    if (a->failed)
        return TRC_REF_EMPTY;
    for (int i = 0; i < count; i++) {
        if (tasks && child[i].end - child[i].begin <= TASK_SIZE) {
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
    t->root = build_range(b, &t->arena, &t->range, t->level, false);
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

trc_status trc_topology_build(struct trc_ref *refs, uint32_t count, uint32_t leaf_size,
                              struct trc_pool *pool, const atomic_uint *cancel,
                              struct trc_topology *out) {
    struct builder b = {.refs = refs, .leaf_size = leaf_size, .cancel = cancel};
    struct arena top = {0};
    *out = (struct trc_topology){.root = TRC_REF_EMPTY};
    if (count == 0)
        return TRC_OK;
    if (count > TRC_REF_INDEX_MASK)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%u primitives in one tree, at most %u", count,
                        TRC_REF_INDEX_MASK);
    const struct range all = range_measure(refs, 0, count);
    const uint32_t root = build_range(&b, &top, &all, 0, count > TASK_SIZE);
    if (!top.failed && !b.failed)
        trc_pool_run(pool, b.task_count, task_run, &b);
    const trc_status status = join(&b, &top, root, out);
    for (uint32_t i = 0; i < b.task_count; i++)
        trc_free(b.tasks[i].arena.children);
    trc_free(b.tasks);
    trc_free(top.children);
    return status;
}

void trc_topology_destroy(struct trc_topology *topology) {
    trc_free(topology->children);
    *topology = (struct trc_topology){.root = TRC_REF_EMPTY};
}
