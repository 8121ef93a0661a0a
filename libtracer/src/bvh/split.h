/* Splitting a range of refs in two by the surface area heuristic.
 *
 * Ingo Wald, "On fast Construction of SAH-based Bounding Volume Hierarchies", 2007: centroids are
 * counted into bins of all three axes, and the cheapest plane between bins is taken. */
#ifndef TRACER_BVH_SPLIT_H
#define TRACER_BVH_SPLIT_H

#include "bvh/tree.h"
#include "core/box.h"

/* A range of refs that becomes a child, and as much memory beside it: splits move refs to and fro.
 */
struct trc_range {
    struct trc_ref *refs, *spare; /* count */
    uint32_t count;
    uint32_t first_slot;          /* triangles of all refs before */
    uint32_t triangles;           /* of its refs */
    struct box bounds, centroids; /* centroids: of lower + upper */
};

struct trc_split {
    int axis; /* -1: none found */
    int bin;  /* refs of bins < bin go left */
    int bin_count;
    bool is_sorted;   /* along the axis: bin refs go left, from where they are */
    float cost;       /* sum of area * triangles of both sides */
    f4 origin, scale; /* bin = (centroid - origin) * scale, at most last_bin */
    f4 last_bin;
    struct box left, right;
    uint32_t left_count, left_triangles;
};

/* Of count refs, the rest is set. */
void trc_range_measure(struct trc_range *r);

/* The cheapest plane; no two refs may stand on different sides of any. May sort the range's refs.
 */
struct trc_split trc_split_find(const struct trc_range *r);

/* Both sides of the plane, their refs in the order of the range's. Where those stood is their spare
 * memory then. */
void trc_split_apply(const struct trc_range *r, const struct trc_split *s, struct trc_range *left,
                     struct trc_range *right);

/* Halves by number, where no plane will do. */
void trc_split_middle(const struct trc_range *r, struct trc_range *left, struct trc_range *right);

/* ---- by all threads ---- */

/* Ranges from here on are worth handing to other threads. */
#define TRC_SHARED_RANGE 8192

struct trc_split_blocks;

/* NULL without memory. */
struct trc_split_blocks *trc_split_blocks_create(struct trc_pool *pool, const atomic_uint *cancel);
void trc_split_blocks_destroy(struct trc_split_blocks *blocks);

/* The same split as trc_split_find's. trc_split_shared_apply is then to be called for it, if any,
 * before the next search. Cancelled, both leave the refs in any state. */
struct trc_split trc_split_shared_find(struct trc_split_blocks *blocks, const struct trc_range *r);
void trc_split_shared_apply(struct trc_split_blocks *blocks, const struct trc_range *r,
                            const struct trc_split *s, struct trc_range *left,
                            struct trc_range *right);

#endif
