/* Splitting a range of refs in two by the surface area heuristic.
 *
 * Ingo Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007: centroids are
 * counted into bins of all three axes, and the cheapest plane between bins is taken. With AVX a box
 * is one register. */
#include "kernels/trace/split.h"

#include <float.h>

#include "core/core.h"
#include "core/pool.h"
#include "kernels/simd/simd8.h"
#include "model/tree.h"

/* Where triangles are few, fewer bins are as good. What might stay a leaf is sorted instead, along
 * the longest axis alone. Where they are many, more bins cost nothing. */
#define FEW_TRIANGLES 24
#define FEW_BINS 8
#define MANY_TRIANGLES 4096
#define SOME_BINS 16

/* Refs from which every other one is counted into bins of its own: neighbours in a mesh mostly fall
 * into one bin, and would wait for each other's store. */
#define MANY_REFS 256

/* struct trc_bin_box, held. */
#if defined(__AVX__)
typedef f8 bounds;
static inline bounds bounds_of(f4 lower, f4 minus_upper) {
    return __builtin_shufflevector(lower, minus_upper, 0, 1, 2, 3, 4, 5, 6, 7);
}
static inline f4 bounds_lower(bounds b) { return __builtin_shufflevector(b, b, 0, 1, 2, 3); }
static inline f4 bounds_minus_upper(bounds b) { return __builtin_shufflevector(b, b, 4, 5, 6, 7); }
static inline bounds bounds_min(bounds a, bounds b) { return f8_min(a, b); }
static inline bounds bounds_ref(const struct trc_ref *r) {
    const i8x corners = {-1, -1, -1, 0, -1, -1, -1, 0};
    const i8x signs = {0, 0, 0, 0, INT32_MIN, INT32_MIN, INT32_MIN, INT32_MIN};
    i8x v;
    _Static_assert(sizeof *r == sizeof v && offsetof(struct trc_ref, upper) == 16, "two corners");
    memcpy(&v, r, sizeof v);
    return (bounds)((v & corners) ^ signs);
}
#else
typedef struct {
    f4 lower, minus_upper;
} bounds;
static inline bounds bounds_of(f4 lower, f4 minus_upper) { return (bounds){lower, minus_upper}; }
static inline f4 bounds_lower(bounds b) { return b.lower; }
static inline f4 bounds_minus_upper(bounds b) { return b.minus_upper; }
static inline bounds bounds_min(bounds a, bounds b) {
    return (bounds){f4_min(a.lower, b.lower), f4_min(a.minus_upper, b.minus_upper)};
}
static inline bounds bounds_ref(const struct trc_ref *r) {
    const struct box b = trc_ref_box(r);
    return (bounds){b.lower, -b.upper};
}
#endif

static inline bounds bounds_empty(void) {
    const f4 maximum = {FLT_MAX, FLT_MAX, FLT_MAX, 0.0f};
    return bounds_of(maximum, maximum);
}
static inline bounds bounds_load(const struct trc_bin_box *box) {
    bounds b;
    memcpy(&b, box, sizeof b);
    return b;
}
static inline void bounds_store(struct trc_bin_box *box, bounds b) { memcpy(box, &b, sizeof b); }
static inline struct box bounds_box(bounds b) {
    return (struct box){bounds_lower(b), -bounds_minus_upper(b)};
}
/* Lengths of the edges; 0 for an empty one. */
static inline f4 bounds_size(bounds b) {
    return f4_max(-(bounds_lower(b) + bounds_minus_upper(b)), f4_set(0.0f));
}

static inline uint32_t count_refs(uint64_t count) { return (uint32_t)(count >> 32); }
static inline uint32_t count_triangles(uint64_t count) { return (uint32_t)count; }

static inline i4 bin_of(const struct trc_split *s, const struct trc_ref *r) {
    const f4 x = (trc_ref_centroid(r) - s->origin) * s->scale;
    return __builtin_convertvector(f4_min(f4_max(x, f4_set(0.0f)), s->last_bin), i4);
}

/* The same along one axis, not yet held to the bins nor rounded down. */
static inline float place_of(const struct trc_split *s, const struct trc_ref *r, int axis) {
    return (r->lower[axis] + r->upper[axis] - s->origin[axis]) * s->scale[axis];
}

static void bins_clear(struct trc_bins *bins, int bin_count) {
    memset(bins->count, 0, sizeof bins->count);
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < bin_count; i++)
            bounds_store(&bins->box[axis][i], bounds_empty());
}

static inline void bins_put(struct trc_bins *bins, const struct trc_ref *ref, i4 bin) {
    const bounds b = bounds_ref(ref);
    const uint64_t count = (1ull << 32) + trc_ref_count(ref);
    for (int axis = 0; axis < 3; axis++) {
        struct trc_bin_box *box = &bins->box[axis][bin[axis]];
        bounds_store(box, bounds_min(bounds_load(box), b));
        bins->count[axis][bin[axis]] += count;
    }
}

static void bins_add(struct trc_bins *to, const struct trc_bins *from, int bin_count) {
    for (int axis = 0; axis < 3; axis++)
        for (int i = 0; i < bin_count; i++) {
            struct trc_bin_box *box = &to->box[axis][i];
            bounds_store(box, bounds_min(bounds_load(box), bounds_load(&from->box[axis][i])));
            to->count[axis][i] += from->count[axis][i];
        }
}

static void bins_fill(const struct trc_ref *refs, uint32_t count, const struct trc_split *s,
                      struct trc_bins *bins_out) {
    const struct trc_split split = *s; /* stores to bins cannot change it */
    uint32_t i = 0;
    bins_clear(bins_out, split.bin_count);
    if (count >= MANY_REFS) {
        struct trc_bins other;
        bins_clear(&other, split.bin_count);
        for (; i + 1 < count; i += 2) {
            const i4 bin = bin_of(&split, &refs[i]), next = bin_of(&split, &refs[i + 1]);
            bins_put(bins_out, &refs[i], bin);
            bins_put(&other, &refs[i + 1], next);
        }
        bins_add(bins_out, &other, split.bin_count);
    }
    for (; i < count; i++)
        bins_put(bins_out, &refs[i], bin_of(&split, &refs[i]));
}

/* Sweeps the bins of one axis from both ends, keeping the cheapest plane. */
static void bins_sweep(const struct trc_bins *bins, int axis, float margin, struct trc_split *s) {
    f4 left_size[TRC_BIN_COUNT], right_size[TRC_BIN_COUNT]; /* of both sides of the plane below */
    float left_count[TRC_BIN_COUNT], right_count[TRC_BIN_COUNT];
    bounds left = bounds_empty(), right = bounds_empty();
    uint32_t before = 0, after = 0;
    for (int i = 0, k = s->bin_count - 1; k >= 0; i++, k--) {
        left_size[i] = bounds_size(left) + f4_set(margin);
        left_count[i] = (float)before;
        left = bounds_min(left, bounds_load(&bins->box[axis][i]));
        before += count_triangles(bins->count[axis][i]);
        right = bounds_min(right, bounds_load(&bins->box[axis][k]));
        after += count_triangles(bins->count[axis][k]);
        right_size[k] = bounds_size(right) + f4_set(margin);
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

/* Its cheapest plane. */
static void bins_choose(const struct trc_bins *bins, float margin, struct trc_split *s) {
    for (int axis = 0; axis < 3; axis++)
        if (s->scale[axis] > 0.0f)
            bins_sweep(bins, axis, margin, s);
    if (s->axis < 0)
        return;
    bounds left = bounds_empty(), right = bounds_empty();
    uint64_t before = 0;
    for (int i = 0; i < s->bin; i++) {
        left = bounds_min(left, bounds_load(&bins->box[s->axis][i]));
        before += bins->count[s->axis][i];
    }
    for (int i = s->bin; i < s->bin_count; i++)
        right = bounds_min(right, bounds_load(&bins->box[s->axis][i]));
    s->left = bounds_box(left);
    s->right = bounds_box(right);
    s->left_count = count_refs(before);
    s->left_triangles = count_triangles(before);
}

/* Moves count refs to where those of either side go next, in their order; boxes of their centroids.
 */
static void refs_part(const struct trc_ref *refs, uint32_t count, const struct trc_split *s,
                      struct trc_ref *left, struct trc_ref *right, struct box *left_centroids,
                      struct box *right_centroids) {
    struct box before = box_empty(), after = box_empty();
    const struct trc_split split = *s;
    const f4 bin = f4_set((float)split.bin);
    for (uint32_t i = 0; i < count; i++) { /* without branches: half would be mispredicted */
        const f4 centroid = trc_ref_centroid(&refs[i]);
        const i4 is_left = f4_set(place_of(&split, &refs[i], split.axis)) < bin;
        /* A centroid of the other side is not a number. */
        box_add_number(&before, (f4)((i4)centroid | ~is_left));
        box_add_number(&after, (f4)((i4)centroid | is_left));
        *(is_left[0] ? left : right) = refs[i];
        left -= is_left[0];
        right += 1 + is_left[0];
    }
    *left_centroids = before;
    *right_centroids = after;
}

/* The bins of a range, before it has a plane. */
static struct trc_split split_begin(const struct trc_range *r) {
    struct trc_split s = {.axis = -1, .bin = 0, .cost = FLT_MAX};
    s.bin_count = r->triangles <= FEW_TRIANGLES    ? FEW_BINS
                  : r->triangles <= MANY_TRIANGLES ? SOME_BINS
                                                   : TRC_BIN_COUNT;
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

/* Puts the refs of a range that may stay a leaf in order along the axis on which they lie farthest
 * apart, and gives that axis. */
static int few_sort(const struct trc_range *r) {
    struct trc_ref *refs = r->refs;
    const int axis = f4_largest_axis(r->centroids.upper - r->centroids.lower);
    for (uint32_t i = 1; i < r->count; i++) {
        const struct trc_ref ref = refs[i];
        const float at = ref.lower[axis] + ref.upper[axis];
        uint32_t k = i;
        for (; k > 0 && refs[k - 1].lower[axis] + refs[k - 1].upper[axis] > at; k--)
            refs[k] = refs[k - 1];
        refs[k] = ref;
    }
    return axis;
}

/* The cheapest of all planes between sorted refs. */
static struct trc_split few_find(const struct trc_range *r) {
    struct trc_split s = {.axis = -1, .cost = FLT_MAX, .is_sorted = true};
    struct box right[TRC_NODE_WIDTH], left = box_empty(), rest = box_empty();
    uint32_t before = 0;
    const float margin = trc_range_margin(r);
    const int axis = few_sort(r);
    for (uint32_t i = r->count; i-- > 1;) {
        box_grow(&rest, trc_ref_box(&r->refs[i]));
        right[i] = rest;
    }
    for (uint32_t i = 1; i < r->count; i++) {
        box_grow(&left, trc_ref_box(&r->refs[i - 1]));
        before += trc_ref_count(&r->refs[i - 1]);
        const float cost = box_area_wider(left, margin) * (float)before +
                           box_area_wider(right[i], margin) * (float)(r->triangles - before);
        if (!(cost < s.cost))
            continue;
        s.cost = cost;
        s.axis = axis;
        s.left_count = i;
        s.left_triangles = before;
    }
    return s;
}

/* ---- by all threads ---- */

/* Refs of a block at least. */
#define MIN_BLOCK 2048

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
    const uint32_t share = (r->count + TRC_SPLIT_BLOCKS - 1) / TRC_SPLIT_BLOCKS;
    b->range = r;
    b->split = s;
    b->block_size = share > MIN_BLOCK ? share : MIN_BLOCK;
    b->block_count = (r->count + b->block_size - 1) / b->block_size;
    trc_pool_run(b->pool, b->block_count, task, b);
}

static void fill_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    (void)worker;
    bins_fill(block_refs(b, index), is_cancelled(b) ? 0 : block_length(b, index), b->split,
              &b->block[index].bins);
}

static void blocks_fill(struct trc_split_blocks *b, const struct trc_range *r,
                        const struct trc_split *s, struct trc_bins *out) {
    blocks_run(b, r, s, fill_block);
    *out = b->block[0].bins;
    for (uint32_t i = 1; i < b->block_count; i++)
        bins_add(out, &b->block[i].bins, s->bin_count);
}

static void part_block(void *context, uint32_t index, uint32_t worker) {
    struct trc_split_blocks *b = context;
    struct trc_split_block *block = &b->block[index];
    (void)worker;
    if (!is_cancelled(b))
        refs_part(block_refs(b, index), block_length(b, index), b->split, block->left, block->right,
                  &block->before, &block->after);
}

/* Moves the refs of the range whose bins were filled last. */
static void blocks_part(struct trc_split_blocks *b, const struct trc_range *r,
                        const struct trc_split *s, struct trc_range *left,
                        struct trc_range *right) {
    struct trc_ref *next_left = left->refs, *next_right = right->refs;
    for (uint32_t i = 0; i < b->block_count; i++) {
        struct trc_split_block *block = &b->block[i];
        uint32_t before = 0;
        for (int bin = 0; bin < s->bin; bin++)
            before += count_refs(block->bins.count[s->axis][bin]);
        block->left = next_left;
        block->right = next_right;
        block->before = block->after = box_empty();
        next_left += before;
        next_right += block_length(b, i) - before;
    }
    blocks_run(b, r, s, part_block);
    left->centroids = right->centroids = box_empty();
    for (uint32_t i = 0; i < b->block_count; i++) {
        box_grow(&left->centroids, b->block[i].before);
        box_grow(&right->centroids, b->block[i].after);
    }
}

/* ---- the kernels ---- */

void trc_split_find(struct trc_split_blocks *blocks, const struct trc_range *r,
                    struct trc_split *out) {
    if (r->triangles <= TRC_NODE_WIDTH) {
        *out = few_find(r);
        return;
    }
    struct trc_bins bins;
    *out = split_begin(r);
    if (blocks)
        blocks_fill(blocks, r, out, &bins);
    else
        bins_fill(r->refs, r->count, out, &bins);
    bins_choose(&bins, trc_range_margin(r), out);
}

void trc_split_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                     const struct trc_split *s, struct trc_range *left, struct trc_range *right) {
    if (s->is_sorted) {
        trc_range_part(r, r->refs, r->spare, s->left_count, s->left_triangles, left, right);
        trc_range_measure(left);
        trc_range_measure(right);
        return;
    }
    trc_range_part(r, r->spare, r->refs, s->left_count, s->left_triangles, left, right);
    left->bounds = s->left;
    right->bounds = s->right;
    if (blocks)
        blocks_part(blocks, r, s, left, right);
    else
        refs_part(r->refs, r->count, s, left->refs, right->refs, &left->centroids,
                  &right->centroids);
}
