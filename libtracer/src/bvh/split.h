/* Splitting a range of refs in two by the surface area heuristic.
 *
 * Ingo Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007: centroids are
 * counted into bins of all three axes, and the cheapest plane between bins is taken. */
#ifndef TRACER_BVH_SPLIT_H
#define TRACER_BVH_SPLIT_H

#include "bvh/tree.h"
#include "core/box.h"

/* A range of refs that becomes a child. */
struct trc_range {
    uint32_t begin, end;
    uint32_t first_slot;          /* triangles of all refs before */
    uint32_t triangles;           /* of its refs */
    struct box bounds, centroids; /* centroids: of lower + upper */
};

struct trc_split {
    int axis; /* -1: none found */
    int bin;  /* refs of bins < bin go left */
    int bin_count;
    int first_axis, end_axis; /* those that are looked at */
    float cost;               /* sum of area * triangles of both sides */
    f4 origin, scale;         /* bin = (centroid - origin) * scale, at most last_bin */
    f4 last_bin;
    struct box left, right;
    uint32_t left_triangles, right_triangles;
};

struct trc_range trc_range_measure(const struct trc_ref *refs, uint32_t begin, uint32_t end,
                                   uint32_t first_slot);

/* The cheapest plane; no two refs may stand on different sides of any. */
struct trc_split trc_split_find(const struct trc_ref *refs, const struct trc_range *r);

/* Moves the refs left of the plane to the front. */
void trc_split_apply(struct trc_ref *refs, const struct trc_range *r, const struct trc_split *s,
                     struct trc_range *left, struct trc_range *right);

/* Halves by number, where no plane will do. */
void trc_split_middle(const struct trc_ref *refs, const struct trc_range *r, struct trc_range *left,
                      struct trc_range *right);

/* ---- by all threads ---- */

/* Ranges from here on are worth handing to other threads. */
#define TRC_SHARED_RANGE 8192

struct trc_split_blocks;

/* For ranges of up to count refs; NULL without memory. */
struct trc_split_blocks *trc_split_blocks_create(struct trc_ref *refs, uint32_t count,
                                                 struct trc_pool *pool, const atomic_uint *cancel);
void trc_split_blocks_destroy(struct trc_split_blocks *blocks);

/* All refs from the first on, as trc_range_measure does. */
struct trc_range trc_split_shared_measure(struct trc_split_blocks *blocks, uint32_t count);

/* The same split as trc_split_find's. trc_split_shared_apply is then to be called for it, if any,
 * before the next search; it keeps the refs of a side in their order. Cancelled, both leave the
 * range in any state. */
struct trc_split trc_split_shared_find(struct trc_split_blocks *blocks, const struct trc_range *r);
void trc_split_shared_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                            const struct trc_split *s, struct trc_range *left,
                            struct trc_range *right);

#endif
