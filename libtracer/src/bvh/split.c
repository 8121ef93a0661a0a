#include "bvh/split.h"

#include <float.h>
#include <string.h>

#include "core/core.h"
#include "threads/pool.h"

/* Bins per axis: 16 loses about 1 % of SAH cost against 32 and builds a third faster; where refs
 * are few, half as many are as good, and where a leaf would do, a quarter, of the longest axis
 * alone (for all few refs, that costs 3 %). */
#define BIN_COUNT 16
#define FEW_REFS 24
#define FEW_BINS 8
#define LEAF_BINS 4

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

struct trc_range trc_range_measure(const struct trc_ref *refs, uint32_t begin, uint32_t end,
                                   uint32_t first_slot) {
    struct trc_range r = {begin, end, first_slot, 0, box_empty(), box_empty()};
    for (uint32_t i = begin; i < end; i++) {
        r.triangles += trc_ref_count(&refs[i]);
        box_grow(&r.bounds, (struct box){ref_lower(&refs[i]), ref_upper(&refs[i])});
        box_add(&r.centroids, ref_centroid(&refs[i]));
    }
    return r;
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

static inline bool is_left(const struct trc_split *s, const struct trc_ref *r) {
    return place_of(s, r, s->axis) < (float)s->bin;
}

/* Refs in the upper half, their triangles in the lower one: both are counted in one step. */
typedef uint64_t tally;
static inline tally tally_of(const struct trc_ref *r) { return (1ull << 32) + trc_ref_count(r); }
static inline uint32_t tally_refs(tally t) { return (uint32_t)(t >> 32); }
static inline uint32_t tally_triangles(tally t) { return (uint32_t)t; }

/* Of the axes that the split looks at. */
struct bins {
    struct box box[3][BIN_COUNT];
    tally count[3][BIN_COUNT];
};

static void bins_clear(struct bins *bins, const struct trc_split *s) {
    const struct box empty = box_empty();
    for (int axis = s->first_axis; axis < s->end_axis; axis++) {
        memset(bins->count[axis], 0, sizeof bins->count[axis]);
        for (int i = 0; i < s->bin_count; i++)
            bins->box[axis][i] = empty;
    }
}

static inline void bins_put(struct bins *bins, int axis, int bin, struct box box, tally count) {
    box_grow(&bins->box[axis][bin], box);
    bins->count[axis][bin] += count;
}

static void bins_fill(const struct trc_ref *refs, uint32_t begin, uint32_t end,
                      const struct trc_split *s, struct bins *bins) {
    bins_clear(bins, s);
    if (s->end_axis - s->first_axis == 1) {
        const int axis = s->first_axis;
        for (uint32_t i = begin; i < end; i++) {
            const float place = place_of(s, &refs[i], axis), last = s->last_bin[0];
            const float bin = place < last ? place : last;
            bins_put(bins, axis, bin > 0.0f ? (int)bin : 0,
                     (struct box){ref_lower(&refs[i]), ref_upper(&refs[i])}, tally_of(&refs[i]));
        }
        return;
    }
    for (uint32_t i = begin; i < end; i++) {
        const i4 b = bin_of(s, &refs[i]);
        const struct box box = {ref_lower(&refs[i]), ref_upper(&refs[i])};
        const tally count = tally_of(&refs[i]);
        for (int axis = 0; axis < 3; axis++)
            bins_put(bins, axis, b[axis], box, count);
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

static int bin_count(uint32_t triangles) {
    if (triangles <= TRC_NODE_WIDTH)
        return LEAF_BINS;
    return triangles <= FEW_REFS ? FEW_BINS : BIN_COUNT;
}

/* The bins of a range, before it has a plane. */
static struct trc_split split_begin(const struct trc_range *r) {
    struct trc_split s = {.axis = -1, .bin = 0, .cost = FLT_MAX};
    s.bin_count = bin_count(r->triangles);
    s.last_bin = f4_set((float)(s.bin_count - 1));
    const f4 size = r->centroids.upper - r->centroids.lower;
    s.origin = r->centroids.lower;
    s.end_axis = 3;
    if (s.bin_count == LEAF_BINS) {
        s.first_axis = size[0] >= size[1] ? 0 : 1;
        s.first_axis = size[s.first_axis] >= size[2] ? s.first_axis : 2;
        s.end_axis = s.first_axis + 1;
    }
    for (int axis = s.first_axis; axis < s.end_axis; axis++) {
        /* A little below the count so that the last centroid falls into the last bin; flat axes all
         * go to bin 0 and offer no plane. */
        const float scale = (float)s.bin_count * 0.9999f / size[axis];
        s.scale[axis] = size[axis] > 0.0f && scale < FLT_MAX ? scale : 0.0f;
    }
    return s;
}

/* Its cheapest plane. */
static void split_choose(struct trc_split *s, const struct bins *bins) {
    for (int axis = s->first_axis; axis < s->end_axis; axis++)
        if (s->scale[axis] > 0.0f)
            bins_sweep(bins, axis, s);
    if (s->axis < 0)
        return;
    s->left = s->right = box_empty();
    s->left_triangles = s->right_triangles = 0;
    for (int i = 0; i < s->bin_count; i++) {
        const bool is_before = i < s->bin;
        box_grow(is_before ? &s->left : &s->right, bins->box[s->axis][i]);
        *(is_before ? &s->left_triangles : &s->right_triangles) +=
            tally_triangles(bins->count[s->axis][i]);
    }
}

struct trc_split trc_split_find(const struct trc_ref *refs, const struct trc_range *r) {
    struct trc_split s = split_begin(r);
    struct bins bins;
    bins_fill(refs, r->begin, r->end, &s, &bins);
    split_choose(&s, &bins);
    return s;
}

/* Both sides of a plane, refs from middle on being the right ones; their centroids are not known.
 */
static void range_sides(const struct trc_range *r, const struct trc_split *s, uint32_t middle,
                        struct trc_range *left, struct trc_range *right) {
    *left = (struct trc_range){r->begin,          middle,  r->first_slot,
                               s->left_triangles, s->left, box_empty()};
    *right = (struct trc_range){
        middle,   r->end,     r->first_slot + s->left_triangles, s->right_triangles,
        s->right, box_empty()};
}

/* Measures both sides' centroids on the way. */
void trc_split_apply(struct trc_ref *refs, const struct trc_range *r, const struct trc_split *s,
                     struct trc_range *left, struct trc_range *right) {
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
    range_sides(r, s, i, left, right);
    left->centroids = before;
    right->centroids = after;
}

void trc_split_middle(const struct trc_ref *refs, const struct trc_range *r, struct trc_range *left,
                      struct trc_range *right) {
    const uint32_t middle = r->begin + (r->end - r->begin) / 2;
    *left = trc_range_measure(refs, r->begin, middle, r->first_slot);
    *right = trc_range_measure(refs, middle, r->end, r->first_slot + left->triangles);
}

/* ---- by all threads ---- */

/* A range is cut into at most so many blocks, by its length alone, so that the tree does not depend
 * on the number of threads. */
#define MOST_BLOCKS 64
#define LEAST_BLOCK 2048

struct split_block {
    struct trc_range range; /* as measured */
    struct bins bins;
    uint32_t left_at, right_at; /* where its refs of either side go */
    struct box before, after;   /* centroids of either side */
};

struct trc_split_blocks {
    struct trc_ref *refs, *spare; /* spare: as many */
    struct trc_pool *pool;
    const atomic_uint *cancel; /* may be NULL */
    /* Of the last search, and of what follows it: */
    const struct trc_split *split;
    uint32_t begin, end;
    uint32_t block_size, block_count;
    struct split_block block[MOST_BLOCKS];
};

struct trc_split_blocks *trc_split_blocks_create(struct trc_ref *refs, uint32_t count,
                                                 struct trc_pool *pool, const atomic_uint *cancel) {
    struct trc_split_blocks *b = trc_alloc(1, sizeof *b);
    struct trc_ref *spare = trc_alloc(count, sizeof *spare);
    if (!b || !spare) {
        trc_free(b);
        trc_free(spare);
        return NULL;
    }
    b->refs = refs;
    b->spare = spare;
    b->pool = pool;
    b->cancel = cancel;
    return b;
}

void trc_split_blocks_destroy(struct trc_split_blocks *blocks) {
    if (!blocks)
        return;
    trc_free(blocks->spare);
    trc_free(blocks);
}

static uint32_t block_begin(const struct trc_split_blocks *b, uint32_t block) {
    return b->begin + block * b->block_size;
}
static uint32_t block_end(const struct trc_split_blocks *b, uint32_t block) {
    const uint32_t end = block_begin(b, block) + b->block_size;
    return end < b->end ? end : b->end;
}

static void blocks_cut(struct trc_split_blocks *b, uint32_t begin, uint32_t end) {
    const uint32_t count = end - begin, share = (count + MOST_BLOCKS - 1) / MOST_BLOCKS;
    b->begin = begin;
    b->end = end;
    b->block_size = share > LEAST_BLOCK ? share : LEAST_BLOCK;
    b->block_count = (count + b->block_size - 1) / b->block_size;
}

static void blocks_run(struct trc_split_blocks *b, const struct trc_split *s,
                       void (*task)(void *, uint32_t, uint32_t)) {
    b->split = s;
    trc_pool_run(b->pool, b->block_count, task, b);
}

static bool is_cancelled(const struct trc_split_blocks *b) { return b->cancel && *b->cancel; }

static void measure_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    (void)worker;
    b->block[index].range =
        trc_range_measure(b->refs, block_begin(b, index), block_end(b, index), 0);
}

struct trc_range trc_split_shared_measure(struct trc_split_blocks *blocks, uint32_t count) {
    struct trc_range all = {0, count, 0, 0, box_empty(), box_empty()};
    blocks_cut(blocks, 0, count);
    blocks_run(blocks, NULL, measure_block);
    for (uint32_t i = 0; i < blocks->block_count; i++) {
        all.triangles += blocks->block[i].range.triangles;
        box_grow(&all.bounds, blocks->block[i].range.bounds);
        box_grow(&all.centroids, blocks->block[i].range.centroids);
    }
    return all;
}

static void fill_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    (void)worker;
    const uint32_t begin = block_begin(b, index);
    bins_fill(b->refs, begin, is_cancelled(b) ? begin : block_end(b, index), b->split,
              &b->block[index].bins);
}

static void bins_add(struct bins *to, const struct bins *from, const struct trc_split *s) {
    for (int axis = s->first_axis; axis < s->end_axis; axis++)
        for (int i = 0; i < s->bin_count; i++) {
            box_grow(&to->box[axis][i], from->box[axis][i]);
            to->count[axis][i] += from->count[axis][i];
        }
}

struct trc_split trc_split_shared_find(struct trc_split_blocks *blocks, const struct trc_range *r) {
    struct trc_split s = split_begin(r);
    struct bins all;
    blocks_cut(blocks, r->begin, r->end);
    blocks_run(blocks, &s, fill_block);
    bins_clear(&all, &s);
    for (uint32_t i = 0; i < blocks->block_count; i++)
        bins_add(&all, &blocks->block[i].bins, &s);
    split_choose(&s, &all);
    return s;
}

static void move_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    struct split_block *block = &b->block[index];
    struct trc_ref *to[2] = {b->spare + block->right_at, b->spare + block->left_at};
    struct box centroids[2] = {box_empty(), box_empty()};
    (void)worker;
    if (is_cancelled(b))
        return;
    for (uint32_t i = block_begin(b, index); i < block_end(b, index); i++) {
        const bool left = is_left(b->split, &b->refs[i]);
        box_add(&centroids[left], ref_centroid(&b->refs[i]));
        *to[left]++ = b->refs[i];
    }
    block->before = centroids[1];
    block->after = centroids[0];
}

static void return_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    const uint32_t begin = block_begin(b, index);
    (void)worker;
    if (!is_cancelled(b))
        memcpy(b->refs + begin, b->spare + begin, (block_end(b, index) - begin) * sizeof *b->refs);
}

void trc_split_shared_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                            const struct trc_split *s, struct trc_range *left,
                            struct trc_range *right) {
    const uint32_t count = blocks->block_count;
    uint32_t at = r->begin;
    for (uint32_t i = 0; i < count; i++) {
        blocks->block[i].left_at = at;
        for (int bin = 0; bin < s->bin; bin++)
            at += tally_refs(blocks->block[i].bins.count[s->axis][bin]);
    }
    const uint32_t middle = at;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t next = i + 1 < count ? blocks->block[i + 1].left_at : middle;
        blocks->block[i].right_at = at;
        at += block_end(blocks, i) - block_begin(blocks, i) - (next - blocks->block[i].left_at);
        blocks->block[i].before = blocks->block[i].after = box_empty();
    }
    blocks_run(blocks, s, move_block);
    blocks_run(blocks, s, return_block);
    range_sides(r, s, middle, left, right);
    for (uint32_t i = 0; i < count; i++) {
        box_grow(&left->centroids, blocks->block[i].before);
        box_grow(&right->centroids, blocks->block[i].after);
    }
}
