#include "bvh/split.h"

#include <float.h>
#include <string.h>

#include "core/core.h"
#include "threads/pool.h"

/* Bins per axis: 16 loses about 1 % of SAH cost against 32 and builds a third faster; where
 * triangles are few, half as many are as good. What might stay a leaf is sorted instead, along the
 * longest axis alone (for all few triangles, that costs 3 %). */
#define BIN_COUNT 16
#define FEW_TRIANGLES 24
#define FEW_BINS 8

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

static inline struct box ref_box(const struct trc_ref *r) {
    return (struct box){ref_lower(r), ref_upper(r)};
}

/* Twice the middle of its box. */
static inline f4 ref_centroid(const struct trc_ref *r) { return ref_lower(r) + ref_upper(r); }

void trc_range_measure(struct trc_range *r) {
    r->triangles = 0;
    r->bounds = r->centroids = box_empty();
    for (uint32_t i = 0; i < r->count; i++) {
        r->triangles += trc_ref_count(&r->refs[i]);
        box_grow(&r->bounds, ref_box(&r->refs[i]));
        box_add(&r->centroids, ref_centroid(&r->refs[i]));
    }
}

static inline i4 bin_of(const struct trc_split *s, const struct trc_ref *r) {
    const f4 x = (ref_centroid(r) - s->origin) * s->scale;
    return __builtin_convertvector(f4_min(f4_max(x, (f4){0.0f, 0.0f, 0.0f, 0.0f}), s->last_bin),
                                   i4);
}

/* The same along one axis, not yet held to the bins nor rounded down. */
static inline float place_of(const struct trc_split *s, const struct trc_ref *r, int axis) {
    return (r->lower[axis] + r->upper[axis] - s->origin[axis]) * s->scale[axis];
}

/* Refs in the upper half, their triangles in the lower one: both are counted in one step. */
typedef uint64_t tally;
static inline tally tally_of(const struct trc_ref *r) { return (1ull << 32) + trc_ref_count(r); }
static inline uint32_t tally_refs(tally t) { return (uint32_t)(t >> 32); }
static inline uint32_t tally_triangles(tally t) { return (uint32_t)t; }

struct bins {
    struct box box[3][BIN_COUNT];
    tally count[3][BIN_COUNT];
};

static void bins_clear(struct bins *bins, const struct trc_split *s) {
    const struct box empty = box_empty();
    for (int axis = 0; axis < 3; axis++) {
        memset(bins->count[axis], 0, sizeof bins->count[axis]);
        for (int i = 0; i < s->bin_count; i++)
            bins->box[axis][i] = empty;
    }
}

static void bins_fill(const struct trc_ref *refs, uint32_t count, const struct trc_split *s,
                      struct bins *bins) {
    bins_clear(bins, s);
    for (uint32_t i = 0; i < count; i++) {
        const i4 b = bin_of(s, &refs[i]);
        const struct box box = ref_box(&refs[i]);
        const tally counted = tally_of(&refs[i]);
        for (int axis = 0; axis < 3; axis++) {
            box_grow(&bins->box[axis][b[axis]], box);
            bins->count[axis][b[axis]] += counted;
        }
    }
}

/* Sweeps the bins of one axis from both ends, keeping the cheapest plane. */
static void bins_sweep(const struct bins *bins, int axis, struct trc_split *s) {
    f4 left_size[BIN_COUNT], right_size[BIN_COUNT]; /* of the boxes beside the plane below a bin */
    float left_count[BIN_COUNT], right_count[BIN_COUNT];
    struct box left = box_empty(), right = box_empty();
    uint32_t before = 0, after = 0;
    for (int i = 0, k = s->bin_count - 1; k >= 0; i++, k--) {
        left_size[i] = box_size(left);
        left_count[i] = (float)before;
        box_grow(&left, bins->box[axis][i]);
        before += tally_triangles(bins->count[axis][i]);
        box_grow(&right, bins->box[axis][k]);
        after += tally_triangles(bins->count[axis][k]);
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

/* The bins of a range, before it has a plane. */
static struct trc_split split_begin(const struct trc_range *r) {
    struct trc_split s = {.axis = -1, .bin = 0, .cost = FLT_MAX};
    s.bin_count = r->triangles <= FEW_TRIANGLES ? FEW_BINS : BIN_COUNT;
    s.last_bin = f4_set((float)(s.bin_count - 1));
    s.origin = r->centroids.lower;
    for (int axis = 0; axis < 3; axis++) {
        /* A little below the count so that the last centroid falls into the last bin; flat axes all
         * go to bin 0 and offer no plane. */
        const float size = r->centroids.upper[axis] - r->centroids.lower[axis];
        const float scale = (float)s.bin_count * 0.9999f / size;
        s.scale[axis] = size > 0.0f && scale < FLT_MAX ? scale : 0.0f;
    }
    return s;
}

/* Its cheapest plane. */
static void split_choose(struct trc_split *s, const struct bins *bins) {
    tally before = 0;
    for (int axis = 0; axis < 3; axis++)
        if (s->scale[axis] > 0.0f)
            bins_sweep(bins, axis, s);
    if (s->axis < 0)
        return;
    s->left = s->right = box_empty();
    for (int i = 0; i < s->bin; i++) {
        box_grow(&s->left, bins->box[s->axis][i]);
        before += bins->count[s->axis][i];
    }
    for (int i = s->bin; i < s->bin_count; i++)
        box_grow(&s->right, bins->box[s->axis][i]);
    s->left_count = tally_refs(before);
    s->left_triangles = tally_triangles(before);
}

/* The refs of a range that may stay a leaf, put in order along the axis on which they lie farthest
 * apart. */
static void few_sort(const struct trc_range *r) {
    struct trc_ref *refs = r->refs;
    const f4 size = r->centroids.upper - r->centroids.lower;
    const int xy = size[0] >= size[1] ? 0 : 1, axis = size[xy] >= size[2] ? xy : 2;
    for (uint32_t i = 1; i < r->count; i++) {
        const struct trc_ref ref = refs[i];
        const float at = ref.lower[axis] + ref.upper[axis];
        uint32_t k = i;
        for (; k > 0 && refs[k - 1].lower[axis] + refs[k - 1].upper[axis] > at; k--)
            refs[k] = refs[k - 1];
        refs[k] = ref;
    }
}

/* Every plane between sorted refs. */
static struct trc_split few_find(const struct trc_range *r) {
    struct trc_split s = {.axis = -1, .cost = FLT_MAX, .is_sorted = true};
    struct box right[TRC_NODE_WIDTH], left = box_empty(), rest = box_empty();
    uint32_t before = 0;
    few_sort(r);
    for (uint32_t i = r->count; i-- > 1;) {
        box_grow(&rest, ref_box(&r->refs[i]));
        right[i] = rest;
    }
    for (uint32_t i = 1; i < r->count; i++) {
        box_grow(&left, ref_box(&r->refs[i - 1]));
        before += trc_ref_count(&r->refs[i - 1]);
        const float cost =
            box_area(left) * (float)before + box_area(right[i]) * (float)(r->triangles - before);
        if (cost >= s.cost)
            continue;
        s.cost = cost;
        s.axis = 0;
        s.left_count = i;
        s.left_triangles = before;
        s.left = left;
        s.right = right[i];
    }
    return s;
}

struct trc_split trc_split_find(const struct trc_range *r) {
    if (r->triangles <= TRC_NODE_WIDTH)
        return few_find(r);
    struct trc_split s = split_begin(r);
    struct bins bins;
    bins_fill(r->refs, r->count, &s, &bins);
    split_choose(&s, &bins);
    return s;
}

/* The range's parts, the left one of so many refs and triangles; not measured. */
static void range_part(const struct trc_range *r, struct trc_ref *refs, struct trc_ref *spare,
                       uint32_t left_count, uint32_t left_triangles, struct trc_range *left,
                       struct trc_range *right) {
    *left = (struct trc_range){.refs = refs,
                               .spare = spare,
                               .count = left_count,
                               .first_slot = r->first_slot,
                               .triangles = left_triangles};
    *right = (struct trc_range){.refs = refs + left_count,
                                .spare = spare + left_count,
                                .count = r->count - left_count,
                                .first_slot = r->first_slot + left_triangles,
                                .triangles = r->triangles - left_triangles};
}

/* Moves count refs to where those of either side go next; grows the boxes of their centroids. No
 * branch depends on a ref: half of them would be mispredicted. */
static void refs_part(const struct trc_ref *refs, uint32_t count, const struct trc_split *s,
                      struct trc_ref *left, struct trc_ref *right, struct box *left_centroids,
                      struct box *right_centroids) {
    struct box before = box_empty(), after = box_empty();
    const f4 bin = f4_set((float)s->bin);
    for (uint32_t i = 0; i < count; i++) {
        const f4 centroid = ref_centroid(&refs[i]);
        const i4 is_left = f4_set(place_of(s, &refs[i], s->axis)) < bin;
        /* A centroid of the other side is not a number: boxes ignore it. */
        box_add_number(&before, (f4)((i4)centroid | ~is_left));
        box_add_number(&after, (f4)((i4)centroid | is_left));
        *(is_left[0] ? left : right) = refs[i];
        left -= is_left[0];
        right += 1 + is_left[0];
    }
    *left_centroids = before;
    *right_centroids = after;
}

void trc_split_apply(const struct trc_range *r, const struct trc_split *s, struct trc_range *left,
                     struct trc_range *right) {
    if (s->is_sorted) {
        range_part(r, r->refs, r->spare, s->left_count, s->left_triangles, left, right);
        trc_range_measure(left);
        trc_range_measure(right);
        return;
    }
    range_part(r, r->spare, r->refs, s->left_count, s->left_triangles, left, right);
    left->bounds = s->left;
    right->bounds = s->right;
    refs_part(r->refs, r->count, s, left->refs, right->refs, &left->centroids, &right->centroids);
}

void trc_split_middle(const struct trc_range *r, struct trc_range *left, struct trc_range *right) {
    const uint32_t middle = r->count / 2;
    uint32_t before = 0;
    for (uint32_t i = 0; i < middle; i++)
        before += trc_ref_count(&r->refs[i]);
    range_part(r, r->refs, r->spare, middle, before, left, right);
    trc_range_measure(left);
    trc_range_measure(right);
}

/* ---- by all threads ---- */

/* A range is cut into at most so many blocks, by its length alone, so that the tree does not depend
 * on the number of threads. */
#define MOST_BLOCKS 64
#define LEAST_BLOCK 2048

struct split_block {
    struct bins bins;
    struct trc_ref *left, *right; /* where its refs of either side go */
    struct box before, after;     /* centroids of either side */
};

struct trc_split_blocks {
    struct trc_pool *pool;
    const atomic_uint *cancel; /* may be NULL */
    /* Of the last search, and of what follows it: */
    const struct trc_range *range;
    const struct trc_split *split;
    uint32_t block_size, block_count;
    struct split_block block[MOST_BLOCKS];
};

struct trc_split_blocks *trc_split_blocks_create(struct trc_pool *pool, const atomic_uint *cancel) {
    struct trc_split_blocks *b = trc_alloc(1, sizeof *b);
    if (!b)
        return NULL;
    b->pool = pool;
    b->cancel = cancel;
    return b;
}

void trc_split_blocks_destroy(struct trc_split_blocks *blocks) { trc_free(blocks); }

static struct trc_ref *block_refs(const struct trc_split_blocks *b, uint32_t block) {
    return b->range->refs + block * b->block_size;
}
static uint32_t block_length(const struct trc_split_blocks *b, uint32_t block) {
    const uint32_t left = b->range->count - block * b->block_size;
    return left < b->block_size ? left : b->block_size;
}

static bool is_cancelled(const struct trc_split_blocks *b) { return b->cancel && *b->cancel; }

static void blocks_run(struct trc_split_blocks *b, const struct trc_range *r,
                       const struct trc_split *s, void (*task)(void *, uint32_t, uint32_t)) {
    const uint32_t share = (r->count + MOST_BLOCKS - 1) / MOST_BLOCKS;
    b->range = r;
    b->split = s;
    b->block_size = share > LEAST_BLOCK ? share : LEAST_BLOCK;
    b->block_count = (r->count + b->block_size - 1) / b->block_size;
    trc_pool_run(b->pool, b->block_count, task, b);
}

static void fill_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    (void)worker;
    bins_fill(block_refs(b, index), is_cancelled(b) ? 0 : block_length(b, index), b->split,
              &b->block[index].bins);
}

static void bins_add(struct bins *to, const struct bins *from, const struct trc_split *s) {
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < s->bin_count; i++) {
            box_grow(&to->box[axis][i], from->box[axis][i]);
            to->count[axis][i] += from->count[axis][i];
        }
}

struct trc_split trc_split_shared_find(struct trc_split_blocks *blocks, const struct trc_range *r) {
    struct trc_split s = split_begin(r);
    struct bins all;
    blocks_run(blocks, r, &s, fill_block);
    bins_clear(&all, &s);
    for (uint32_t i = 0; i < blocks->block_count; i++)
        bins_add(&all, &blocks->block[i].bins, &s);
    split_choose(&s, &all);
    return s;
}

static void part_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    struct split_block *block = &b->block[index];
    (void)worker;
    if (!is_cancelled(b))
        refs_part(block_refs(b, index), block_length(b, index), b->split, block->left, block->right,
                  &block->before, &block->after);
}

void trc_split_shared_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                            const struct trc_split *s, struct trc_range *left,
                            struct trc_range *right) {
    range_part(r, r->spare, r->refs, s->left_count, s->left_triangles, left, right);
    left->bounds = s->left;
    right->bounds = s->right;
    struct trc_ref *next_left = left->refs, *next_right = right->refs;
    for (uint32_t i = 0; i < blocks->block_count; i++) {
        struct split_block *block = &blocks->block[i];
        uint32_t before = 0;
        for (int bin = 0; bin < s->bin; bin++)
            before += tally_refs(block->bins.count[s->axis][bin]);
        block->left = next_left;
        block->right = next_right;
        block->before = block->after = box_empty();
        next_left += before;
        next_right += block_length(blocks, i) - before;
    }
    blocks_run(blocks, r, s, part_block);
    left->centroids = right->centroids = box_empty();
    for (uint32_t i = 0; i < blocks->block_count; i++) {
        box_grow(&left->centroids, blocks->block[i].before);
        box_grow(&right->centroids, blocks->block[i].after);
    }
}
