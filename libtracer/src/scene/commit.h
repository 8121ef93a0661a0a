/* Snapshots as their holders see them, and what only commits know of them. */
#ifndef TRACER_SCENE_COMMIT_H
#define TRACER_SCENE_COMMIT_H

#include <stdbool.h>

#include "bvh/bvh.h"
#include "core/core.h"
#include "model/snapshot.h"
#include "scene/shared.h"

struct trc_scene_state; /* scene/scene.h */

/* Any thread. NULL is fine. The last release frees what no other snapshot shares. */
struct trc_snapshot *trc_snapshot_retain(struct trc_snapshot *snapshot);
void trc_snapshot_release(struct trc_snapshot *snapshot);

/* Warnings of the commit that made the snapshot, one per line. */
const char *trc_snapshot_warnings(const struct trc_snapshot *snapshot);

/* ---- for scene/commit.c, scene/collect.c and scene/features.c ---- */

#define TRC_WARNING_BYTES 1024

/* A snapshot with the parts it shares with others. */
struct trc_snapshot_block {
    struct trc_snapshot snapshot;     /* first: a trc_snapshot is a trc_snapshot_block */
    struct trc_shared *instance_data; /* what the instances point to */
    struct trc_shared *bvh;
    struct trc_shared *lights;
    struct trc_shared *camera;
    struct trc_bvh_build_stats build; /* of the trees, when they were built */
    bool takes_rebuild;               /* its trees start from the scene's rebuilt one */
    char warnings[TRC_WARNING_BYTES];
};

static inline const struct trc_snapshot_block *trc_snapshot_block_of(
    const struct trc_snapshot *snapshot) {
    return (const struct trc_snapshot_block *)snapshot;
}

/* Fill the arrays of images, materials and meshes (with their normals), in that order. */
trc_status trc_collect_images(const struct trc_scene_state *scene, struct trc_snapshot *s);
trc_status trc_collect_materials(const struct trc_scene_state *scene, struct trc_snapshot *s);
trc_status trc_collect_meshes(struct trc_scene_state *scene, struct trc_snapshot *s);

/* Fills the instances, sharing those of former (or NULL) where nothing has changed. */
trc_status trc_collect_instances(const struct trc_scene_state *scene,
                                 const struct trc_snapshot_block *former,
                                 struct trc_snapshot_block *block);

/* Camera and world. */
void trc_collect_view(const struct trc_scene_state *scene, struct trc_snapshot_block *block);

/* What the scene uses, from all other fields of the snapshot and its lights. */
uint32_t trc_find_features(const struct trc_scene_state *scene, const struct trc_snapshot *s);

/* Rays that a hit sends on at most, >= 1. */
uint32_t trc_find_branches(const struct trc_snapshot *s);

/* Fills counts, features and bytes of stats; times, trees and lights are the caller's. */
void trc_count_stats(const struct trc_scene_state *scene, struct trc_snapshot *s);

/* Appends a line to the warnings; what does not fit is left out. */
void trc_warn(struct trc_snapshot_block *block, const char *format, ...)
    __attribute__((format(TRC_PRINTF, 2, 3)));

#endif
