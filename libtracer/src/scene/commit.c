/* Commit: from edits to an immutable snapshot.
 *
 * A snapshot is built beside the one in force and replaces it only when complete. Parts whose
 * inputs have not changed are shared with it: meshes and materials always, trees when geometry
 * stands still, lights when only the camera has moved. */
#include "scene/commit.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"
#include "image/image.h"
#include "image/prefetch.h"
#include "model/material.h"
#include "scene/displace.h"
#include "scene/mesh.h"
#include "scene/rebuild.h"
#include "scene/scene.h"
#include "shading/compile.h"
#include "shading/lights.h"

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the scene");
}

/* ---- holding ---- */

static void destroy_block(struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    trc_shared_release(block->lights);
    trc_shared_release(block->bvh);
    trc_shared_release(block->instance_data);
    trc_shared_release(block->camera);
    for (uint32_t i = 0; i < s->mesh_count; i++)
        trc_geometry_release(s->meshes[i]);
    for (uint32_t i = 0; i < s->material_count; i++)
        trc_material_release(s->materials[i]);
    for (uint32_t i = 0; i < s->image_count; i++)
        trc_image_release(s->images[i]);
    trc_free(s->meshes);
    trc_free(s->instances);
    trc_free(s->materials);
    trc_free(s->images);
    trc_free(block);
}

struct trc_snapshot *trc_snapshot_retain(struct trc_snapshot *snapshot) {
    if (snapshot)
        atomic_fetch_add_explicit(&snapshot->refs, 1, memory_order_relaxed);
    return snapshot;
}

void trc_snapshot_release(struct trc_snapshot *snapshot) {
    if (!snapshot || atomic_fetch_sub(&snapshot->refs, 1) != 1)
        return;
    destroy_block((struct trc_snapshot_block *)snapshot);
}

const char *trc_snapshot_warnings(const struct trc_snapshot *snapshot) {
    return trc_snapshot_block_of(snapshot)->warnings;
}

/* ---- trees ---- */

static void destroy_bvh(void *object) { trc_bvh_destroy(object); }

/* What the trees read of materials is the same in both snapshots, and what instances in them are
 * marked by as solid. */
static bool transparency_is_equal(const struct trc_snapshot *a, const struct trc_snapshot *b) {
    if (a->material_count != b->material_count)
        return false;
    for (uint32_t i = 0; i < a->material_count; i++) {
        const struct trc_material *x = a->materials[i], *y = b->materials[i];
        if (x != y && (trc_material_is_clear(x) != trc_material_is_clear(y) ||
                       trc_material_shadows_transparent(x) != trc_material_shadows_transparent(y)))
            return false;
    }
    return true;
}

static trc_status build_bvh(struct trc_scene_state *scene, const struct trc_snapshot_block *former,
                            struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    struct trc_mesh **replaced = trc_alloc_zeroed(s->mesh_count, sizeof *replaced);
    struct trc_blas **rebuilt = NULL;
    if (block->takes_rebuild)
        rebuilt = trc_alloc_zeroed(s->mesh_count, sizeof(struct trc_blas *));
    if (!replaced || (block->takes_rebuild && !rebuilt)) {
        trc_free(replaced);
        trc_free(rebuilt);
        return no_memory();
    }
    if (rebuilt)
        trc_rebuild_offer(scene->rebuild, &scene->meshes, rebuilt);
    const struct trc_store *store = &scene->meshes;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        const struct trc_scene_mesh *mesh = store->slots[i].object;
        if (mesh->committed != mesh->shown)
            replaced[mesh->index] = mesh->committed;
    }
    const struct trc_bvh_options options = {.is_final = scene->is_final,
                                            .keeps_grown = !scene->is_final,
                                            .rebuilt = rebuilt,
                                            .cancel = &scene->cancel};
    struct trc_bvh *bvh;
    const trc_status status = trc_bvh_create(s, former ? &former->snapshot : NULL, replaced,
                                             &options, scene->pool, &bvh, &block->build);
    trc_free(replaced);
    trc_free(rebuilt);
    if (status != TRC_OK)
        return status;
    block->bvh = trc_shared_create(bvh, destroy_bvh);
    if (!block->bvh) {
        trc_bvh_destroy(bvh);
        return no_memory();
    }
    return TRC_OK;
}

/* A mesh may be moved by what materials and images have become. */
static bool geometry_is_equal(const struct trc_snapshot *a, const struct trc_snapshot *b) {
    return a->mesh_count == b->mesh_count &&
           (a->mesh_count == 0 ||
            memcmp(a->meshes, b->meshes, a->mesh_count * sizeof(struct trc_mesh *)) == 0);
}

/* Trees are alike for all instruction sets: one that another has made is as good. */
static trc_status collect_bvh(struct trc_scene_state *scene,
                              const struct trc_snapshot_block *former,
                              struct trc_snapshot_block *block) {
    const bool is_static = !(scene->changed & (TRC_CHANGED_MESHES | TRC_CHANGED_INSTANCES));
    if (former && is_static && geometry_is_equal(&former->snapshot, &block->snapshot) &&
        transparency_is_equal(&former->snapshot, &block->snapshot)) {
        block->bvh = trc_shared_retain(former->bvh);
        block->build = former->build;
        block->build.seconds = 0.0;
        block->build.built_count = block->build.refitted_count = 0;
    } else {
        block->takes_rebuild = trc_rebuild_is_done(scene->rebuild);
        TRC_TRY(build_bvh(scene, former, block));
    }
    struct trc_snapshot *s = &block->snapshot;
    s->bvh = block->bvh->object;
    for (uint32_t i = 0; i < s->instance_count; i++)
        s->instances[i].in_world = trc_bvh_has_own_tree(s->bvh, i);
    return TRC_OK;
}

/* ---- lights ---- */

static void destroy_lights(void *object) { trc_light_table_destroy(object); }

static const struct trc_material *world_material(const struct trc_snapshot *s) {
    return s->world.material == UINT32_MAX ? NULL : s->materials[s->world.material];
}

/* The table whose importance map of the world is still right, or NULL. */
static const struct trc_light_table *same_world(const struct trc_scene_state *scene,
                                                const struct trc_snapshot_block *former,
                                                const struct trc_snapshot_block *block) {
    if (!former || (scene->changed & (TRC_CHANGED_WORLD | TRC_CHANGED_IMAGES)))
        return NULL;
    if (world_material(&former->snapshot) != world_material(&block->snapshot))
        return NULL;
    return former->snapshot.lights;
}

/* What light samples are taken for: the lobes of all surfaces. */
static uint32_t find_scattering(const struct trc_snapshot *s) {
    uint32_t has = 0;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        for (uint32_t m = 0; m < instance->material_count; m++)
            has |= s->materials[instance->materials[m]]->has;
    }
    return has & TRC_MATERIAL_SCATTERS;
}

/* From corner to corner of the bounds, 0 for an empty scene. */
static float scene_extent(const struct trc_bvh_build_stats *build) {
    float square = 0.0f;
    for (int i = 0; i < 3; i++) {
        const float side = build->bounds_upper[i] - build->bounds_lower[i];
        square += side > 0.0f && side < 1e18f ? side * side : 0.0f;
    }
    return sqrtf(square);
}

static trc_status build_lights(const struct trc_scene_state *scene,
                               const struct trc_snapshot_block *former,
                               struct trc_snapshot_block *block) {
    const struct trc_store *store = &scene->lights;
    trc_light_desc *descs = trc_alloc(store->living_count, sizeof *descs);
    uint32_t *materials = trc_alloc(store->living_count, sizeof *materials);
    if (!descs || !materials) {
        trc_free(descs);
        trc_free(materials);
        return no_memory();
    }
    uint32_t count = 0;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        descs[count] = *(const trc_light_desc *)store->slots[i].object;
        materials[count] = trc_scene_material_index(scene, descs[count].material);
        count++;
    }
    struct trc_light_table *lights;
    const struct trc_light_options options = {
        .lights = descs,
        .light_materials = materials,
        .light_count = count,
        .reach = scene_extent(&block->build),
        .scatters = find_scattering(&block->snapshot),
        .world = scene->world.struct_size ? &scene->world : NULL,
        .previous = same_world(scene, former, block),
        .pool = scene->pool,
        .cancel = &scene->cancel,
    };
    const trc_status status = trc_light_table_create(&block->snapshot, &options, &lights);
    trc_free(descs);
    trc_free(materials);
    if (status != TRC_OK)
        return status;
    block->lights = trc_shared_create(lights, destroy_lights);
    if (!block->lights) {
        trc_light_table_destroy(lights);
        return no_memory();
    }
    return TRC_OK;
}

/* A light table depends on all but the camera. The instances of former, with their light numbers,
 * are those of the new snapshot then. */
static trc_status collect_lights(const struct trc_scene_state *scene,
                                 const struct trc_snapshot_block *former,
                                 struct trc_snapshot_block *block) {
    if (former && !(scene->changed & ~(uint32_t)TRC_CHANGED_CAMERA)) {
        block->lights = trc_shared_retain(former->lights);
    } else {
        struct trc_snapshot *s = &block->snapshot;
        for (uint32_t i = 0; i < s->instance_count; i++)
            s->instances[i].first_light = UINT32_MAX;
        TRC_TRY(build_lights(scene, former, block));
    }
    block->snapshot.lights = block->lights->object;
    return TRC_OK;
}

/* ---- the whole ---- */

static void warn_of_images(const struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    const struct trc_snapshot *s = &block->snapshot;
    uint64_t images = 0, texels = 0, halved = 0;
    for (uint32_t i = 0; i < s->image_count; i++) {
        halved += s->images[i] && s->images[i]->is_halved;
        if (s->images[i] && s->images[i]->bad_texel_count) {
            images++;
            texels += s->images[i]->bad_texel_count;
        }
    }
    if (images) {
        trc_warn(block,
                 "%" PRIu64 " texels in %" PRIu64 " images are not finite and count as black",
                 texels, images);
    }
    if (halved) {
        trc_warn(block, "%" PRIu64 " images are shown smaller, to keep all within %" PRIu64 " MiB",
                 halved, scene->image_bytes_max >> 20);
    }
}

static void warn_of_dicing(const struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    uint64_t coarse = 0;
    const struct trc_store *store = &scene->meshes;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        const struct trc_scene_mesh *mesh = store->slots[i].object;
        coarse += mesh->is_coarse;
    }
    if (coarse) {
        trc_warn(block, "%" PRIu64 " meshes are diced more coarsely than asked, to save memory",
                 coarse);
    }
}

static void finish_stats(const struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    trc_count_stats(scene, s);
    trc_scene_stats *stats = &s->stats;
    stats->skipped_triangle_count = block->build.skipped_triangles;
    stats->bvh_bytes = block->build.bytes;
    stats->build_seconds = block->build.seconds;
    stats->built_count = block->build.built_count;
    stats->refitted_count = block->build.refitted_count;
    stats->emissive_triangle_count = trc_light_table_triangle_count(s->lights);
    memcpy(stats->bounds_lower, block->build.bounds_lower, sizeof stats->bounds_lower);
    memcpy(stats->bounds_upper, block->build.bounds_upper, sizeof stats->bounds_upper);
    if (stats->skipped_triangle_count) {
        trc_warn(block,
                 "%" PRIu64 " triangles are left out: a vertex is not finite or beyond 1.8e18",
                 stats->skipped_triangle_count);
    }
    if (stats->skipped_instance_count) {
        trc_warn(
            block,
            "%" PRIu64
            " instances are hidden: their transform makes them a line or a point, or is not finite",
            stats->skipped_instance_count);
    }
    warn_of_images(scene, block);
    warn_of_dicing(scene, block);
}

static trc_status check_cancel(const struct trc_scene_state *scene) {
    if (!atomic_load(&scene->cancel))
        return TRC_OK;
    return trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
}

static trc_status fill_block(struct trc_scene_state *scene, const struct trc_snapshot_block *former,
                             struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    TRC_TRY(trc_collect_images(scene, s));
    TRC_TRY(trc_collect_materials(scene, s));
    TRC_TRY(trc_collect_meshes(scene, s));
    TRC_TRY(trc_collect_instances(scene, former, block));
    trc_collect_view(scene, block);
    TRC_TRY(trc_displace_meshes(scene, s));
    s->features = trc_find_features(scene, s);
    s->branch_count = trc_find_branches(s);
    TRC_TRY(check_cancel(scene));
    TRC_TRY(collect_bvh(scene, former, block));
    TRC_TRY(check_cancel(scene));
    TRC_TRY(collect_lights(scene, former, block));
    TRC_TRY(check_cancel(scene));
    finish_stats(scene, block);
    return TRC_OK;
}

/* Lets go of a rebuilt tree that was taken, and starts on the next. */
static void follow_rebuilds(struct trc_scene_state *scene, const struct trc_snapshot_block *block) {
    if (block->takes_rebuild) {
        trc_rebuild_destroy(scene->rebuild);
        scene->rebuild = NULL;
    }
    if (!scene->is_final && !scene->rebuild)
        scene->rebuild = trc_rebuild_start(&scene->meshes, block->snapshot.bvh);
}

static void publish(struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    trc_snapshot_release(scene->snapshot);
    scene->snapshot = &block->snapshot;
    scene->changed = 0;
    const struct trc_store *store = &scene->meshes;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        struct trc_scene_mesh *mesh = store->slots[i].object;
        mesh->committed = mesh->shown;
    }
    follow_rebuilds(scene, block);
}

static trc_status commit(struct trc_scene_state *scene) {
    const double start = trc_seconds();
    trc_prefetch_destroy(scene->prefetch); /* what was not asked for by now will not be */
    scene->prefetch = NULL;
    if (!scene->pool)
        TRC_TRY(trc_pool_create(scene->thread_count, &scene->pool));
    struct trc_snapshot_block *block = trc_alloc_zeroed(1, sizeof *block);
    if (!block)
        return no_memory();
    atomic_init(&block->snapshot.refs, 1);
    const struct trc_snapshot_block *former =
        scene->snapshot ? trc_snapshot_block_of(scene->snapshot) : NULL;
    const trc_status status = fill_block(scene, former, block);
    if (status != TRC_OK) {
        destroy_block(block);
        return status;
    }
    block->snapshot.stats.commit_seconds = trc_seconds() - start;
    publish(scene, block);
    return TRC_OK;
}

/* A cancel counts from here to the end: before and after it has no effect. */
trc_status trc_scene_state_commit(struct trc_scene_state *scene) {
    pthread_mutex_lock(&scene->cancel_lock);
    atomic_store(&scene->cancel, 0);
    scene->committing = true;
    pthread_mutex_unlock(&scene->cancel_lock);
    const trc_status status = commit(scene);
    pthread_mutex_lock(&scene->cancel_lock);
    scene->committing = false;
    pthread_mutex_unlock(&scene->cancel_lock);
    return status;
}
