/* Splits of a range of refs in two by the surface area heuristic: what kernels/trace/split.c works
 * on. */
#ifndef TRACER_MODEL_SPLIT_H
#define TRACER_MODEL_SPLIT_H

#include <stdatomic.h>
#include <stdbool.h>

#include "model/range.h"

struct trc_pool; /* core/pool.h */

struct trc_split {
    int axis; /* -1: none found */
    int bin;  /* refs of bins < bin go left */
    int bin_count;
    bool is_sorted;   /* the range's refs, left ones first: there are no bins */
    float cost;       /* sum of area * triangles of both sides */
    f4 origin, scale; /* bin = (centroid - origin) * scale, at most last_bin */
    f4 last_bin;
    struct box left, right; /* of both sides; not set where refs are sorted */
    uint32_t left_count, left_triangles;
};

/* Bins per axis at most. */
#define TRC_BIN_COUNT 32

/* A box that grows: a corner, 0, and the upper one with its sign changed, 0, so that one minimum of
 * all eight grows both. */
struct trc_bin_box {
    float lower[4], minus_upper[4];
};

/* What the refs of a range add up to. */
struct trc_bins {
    struct trc_bin_box box[3][TRC_BIN_COUNT]; /* by axis, from its lower end */
    uint64_t count[3][TRC_BIN_COUNT];         /* refs << 32 | their triangles: one addition */
};

/* Ranges from here on are worth handing to other threads. */
#define TRC_SHARED_RANGE 8192
/* Such a range is cut into at most so many blocks, by its length alone, so that the tree does not
 * depend on the number of threads. */
#define TRC_SPLIT_BLOCKS 64

struct trc_split_block {
    struct trc_bins bins;
    struct trc_ref *left, *right; /* where its refs of either side go */
    struct box before, after;     /* centroids of either side */
};

/* A split by all threads. */
struct trc_split_blocks {
    struct trc_pool *pool;
    const atomic_uint *cancel; /* may be NULL */
    /* Of the last search, and of what follows it: */
    const struct trc_range *range;
    const struct trc_split *split;
    uint32_t block_size, block_count;
    struct trc_split_block block[TRC_SPLIT_BLOCKS];
};

#endif
