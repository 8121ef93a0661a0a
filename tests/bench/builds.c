#include "builds.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"
#include "bvh/tree.h"
#include "embree.h"

static bool failed(trc_status status) {
    if (status != TRC_OK)
        fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
    return status != TRC_OK;
}

static double million_per_second(const struct mesh *mesh, double seconds) {
    return seconds > 0.0 ? 1e-6 * mesh->triangle_count / seconds : 0.0;
}

/* Of the tree that holds the mesh. */
static double sah_cost(trc_scene scene) {
    const struct trc_bvh *bvh = query_scene_snapshot(scene)->bvh;
    return (double)(bvh->blas[0] ? bvh->blas[0]->tree.sah_cost : bvh->joined->tree.sah_cost);
}

static bool build_once(const struct query_world *world, uint32_t threads, bool keep,
                       struct build_result *out) {
    struct query_scene scene;
    trc_scene_stats stats = {.struct_size = sizeof stats};
    const struct mesh *mesh = &world->meshes[0];
    if (failed(query_scene_create(world, true, threads, &scene)))
        return false;
    const bool done = !failed(trc_scene_get_stats(scene.scene, &stats));
    if (done && keep) {
        rate_add(&out->build, million_per_second(mesh, stats.build_seconds));
        rate_add(&out->commit, million_per_second(mesh, stats.commit_seconds));
        out->bytes = (double)stats.bvh_bytes / mesh->triangle_count;
        out->sah_cost = sah_cost(scene.scene);
    }
    query_scene_destroy(&scene);
    return done;
}

static void peer_build_once(struct embree_device *device, const struct mesh *mesh, bool keep,
                            struct build_result *out) {
    struct embree_scene *scene = embree_scene_create(device, mesh, EMBREE_FAST);
    if (keep) {
        rate_add(&out->peer_build, million_per_second(mesh, embree_build_seconds(scene)));
        out->peer_bytes = (double)embree_build_bytes(scene) / mesh->triangle_count;
    }
    embree_scene_destroy(scene);
}

/* A pose beside the mesh's own: every vertex the same way off, so that no tree changes its cost. */
static float *other_pose(const struct bench_scene *scene, const struct mesh *mesh) {
    const size_t count = 3 * (size_t)mesh->vertex_count * mesh->key_count;
    float *positions = buffer_alloc(count, sizeof *positions);
    for (size_t i = 0; i < count; i++)
        positions[i] = mesh->positions[i] + 0.01f * scene->extent;
    return positions;
}

static bool refit_once(struct query_scene *scene, const struct mesh *mesh, const float *positions,
                       bool keep, struct build_result *out) {
    trc_scene_stats stats = {.struct_size = sizeof stats};
    const uint64_t count = (uint64_t)3 * mesh->vertex_count * mesh->key_count;
    if (failed(trc_mesh_update(scene->scene, scene->meshes[0], mesh->key_count, positions, count,
                               NULL, 0)) ||
        failed(trc_scene_commit(scene->scene)) || failed(trc_scene_get_stats(scene->scene, &stats)))
        return false;
    if (stats.refitted_count != 1) {
        fprintf(stderr, "tracer_bench: a pose was not refitted but built anew\n");
        return false;
    }
    if (keep)
        rate_add(&out->refit, million_per_second(mesh, stats.build_seconds));
    return true;
}

static bool measure_builds(const struct query_world *world, uint32_t threads, uint32_t repeats,
                           struct embree_device *device, struct build_result *out) {
    for (uint32_t repeat = 0; repeat <= repeats; repeat++) {
        if (!build_once(world, threads, repeat > 0, out))
            return false;
        if (device)
            peer_build_once(device, &world->meshes[0], repeat > 0, out);
    }
    return true;
}

static bool measure_refits(const struct query_world *world, const float *pose, uint32_t threads,
                           uint32_t repeats, struct embree_device *device,
                           struct build_result *out) {
    struct query_scene scene;
    const struct mesh *mesh = &world->meshes[0];
    if (failed(query_scene_create(world, false, threads, &scene)))
        return false;
    struct embree_scene *peer = device ? embree_scene_create(device, mesh, EMBREE_POSED) : NULL;
    bool done = true;
    for (uint32_t repeat = 0; repeat <= repeats && done; repeat++) {
        const float *positions = repeat % 2 ? mesh->positions : pose;
        done = refit_once(&scene, mesh, positions, repeat > 0, out);
        if (!peer)
            continue;
        const double seconds = embree_pose(peer, positions);
        if (repeat > 0)
            rate_add(&out->peer_refit, million_per_second(mesh, seconds));
    }
    embree_scene_destroy(peer);
    query_scene_destroy(&scene);
    return done;
}

bool builds_measure(const struct bench_scene *scene, bool moving, uint32_t threads,
                    const struct options *options, struct build_result *out) {
    const struct query_world *world = &scene->worlds[moving];
    memset(out, 0, sizeof *out);
    struct embree_device *device = options->embree ? embree_open(trc_isa(), threads) : NULL;
    float *pose = other_pose(scene, &world->meshes[0]);
    const bool done = measure_builds(world, threads, options->repeats, device, out) &&
                      measure_refits(world, pose, threads, options->repeats, device, out);
    free(pose);
    embree_close(device);
    return done;
}
