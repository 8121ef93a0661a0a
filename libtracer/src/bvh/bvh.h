/* Bounding volume hierarchies: what rays are traced against. */
#ifndef TRACER_BVH_BVH_H
#define TRACER_BVH_BVH_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "model/snapshot.h"

struct trc_pool; /* core/pool.h */

/* The trees of a snapshot: BLASes and the TLAS over instances. */
struct trc_bvh;

/* The tree of one mesh. */
struct trc_blas;

struct trc_bvh_options {
    bool is_final;    /* join static instances, but those that share large meshes and the few that
                         have changed since, into one world-space tree, and clip what slants there
                         (bvh/clip.h) */
    bool keeps_grown; /* refitted trees whose SAH cost has grown too far stay for now, unless by
                         much: the caller builds them anew apart */
    struct trc_blas *const *rebuilt; /* per mesh, from trc_blas_build for any pose of it: what to
                                        start from instead of the previous tree; NULL: none */
    const atomic_uint *cancel;       /* non-zero: return TRC_ERROR_CANCELLED soon */
};

struct trc_bvh_build_stats {
    double seconds;
    uint64_t bytes;
    uint64_t skipped_triangles;
    uint32_t built_count, refitted_count;
    float bounds_lower[3], bounds_upper[3]; /* world, over all keys; lower > upper when empty */
};

/* Builds the trees for snapshot->meshes, ->instances and ->materials (which must be complete;
 * transparency flags of materials are read), reusing what it can of the trees of the snapshot
 * before (NULL: none): a mesh pointer that is in both keeps its BLAS; a mesh with the same index
 * array contents but new positions, as replaced[i] = the mesh of that snapshot it comes from (or
 * NULL), is refitted; the joined tree stays where all in it stands still. Ownership of the result
 * goes to the caller. OUT_OF_MEMORY, NO_THREAD or CANCELLED leave nothing behind. */
trc_status trc_bvh_create(const struct trc_snapshot *snapshot, const struct trc_snapshot *before,
                          struct trc_mesh *const *replaced, const struct trc_bvh_options *options,
                          struct trc_pool *pool, struct trc_bvh **bvh_out,
                          struct trc_bvh_build_stats *stats_out);
void trc_bvh_destroy(struct trc_bvh *bvh);

/* Whether rays meet a tree of its own, in world space, for an instance. */
bool trc_bvh_has_own_tree(const struct trc_bvh *bvh, uint32_t instance);

/* Whether refits have made the tree of a mesh so bad that it should be built anew. */
bool trc_bvh_has_grown(const struct trc_bvh *bvh, uint32_t mesh);

/* A tree for one mesh, which must outlive it, without transparent slots. OUT_OF_MEMORY, TOO_LARGE
 * or CANCELLED. */
trc_status trc_blas_build(const struct trc_mesh *mesh, struct trc_pool *pool,
                          const atomic_uint *cancel, struct trc_blas **blas_out);
/* NULL is fine; trees that took it on keep it. */
void trc_blas_release(struct trc_blas *blas);

#endif
