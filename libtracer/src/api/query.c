/* Public ray queries: on the calling thread, with the kernels in force. */
#include "api/ray_order.h"
#include "core/checks.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "model/kernels.h"
#include "scene/commit.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

/* Rays of one call of a kernel: whole packets of every size, and indices stay small. */
#define CHUNK 65536

/* An array of count elements that may be NULL unless it is required. */
static trc_status check_column(const void *column, uint64_t count, bool required,
                               const char *name) {
    if (!column && !required)
        return TRC_OK;
    return trc_check_array(column, count, count, sizeof(float), sizeof(float), name);
}

static trc_status check_rays(const trc_rays *rays) {
    TRC_TRY(trc_check_struct(rays, sizeof *rays, "trc_rays"));
    TRC_TRY(trc_check_enum(rays->visibility, TRC_VISIBLE_ALL + 1, "visibility"));
    TRC_TRY(trc_check_enum(rays->flags, TRC_RAYS_REORDER + 1, "flags"));
    TRC_TRY(trc_check_enum(rays->reserved, 1, "reserved"));
    const struct {
        const float *column;
        bool required;
        const char *name;
    } columns[] = {
        {rays->origin_x, true, "origin_x"},
        {rays->origin_y, true, "origin_y"},
        {rays->origin_z, true, "origin_z"},
        {rays->direction_x, true, "direction_x"},
        {rays->direction_y, true, "direction_y"},
        {rays->direction_z, true, "direction_z"},
        {rays->tmin, false, "tmin"},
        {rays->tmax, false, "tmax"},
        {rays->time, false, "time"},
    };
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
        TRC_TRY(check_column(columns[i].column, rays->count, columns[i].required, columns[i].name));
    }
    return TRC_OK;
}

static trc_status check_hits(const trc_hits *hits, uint64_t count) {
    TRC_TRY(trc_check_struct(hits, sizeof *hits, "trc_hits"));
    TRC_TRY(check_column(hits->instance, count, true, "instance"));
    const struct {
        const void *column;
        const char *name;
    } columns[] = {
        {hits->triangle, "triangle"},
        {hits->distance, "distance"},
        {hits->u, "u"},
        {hits->v, "v"},
        {hits->normal_x, "normal_x"},
        {hits->normal_y, "normal_y"},
        {hits->normal_z, "normal_z"},
    };
    for (size_t i = 0; i < sizeof columns / sizeof *columns; i++) {
        TRC_TRY(check_column(columns[i].column, count, false, columns[i].name));
    }
    return TRC_OK;
}

static trc_status resolve_packet_size(uint32_t packet_size, uint32_t *size_out) {
    switch (packet_size) {
    case 0:
    case 1:
    case 4:
    case 16:
    case 64:
    case 256:
        *size_out = packet_size;
        return TRC_OK;
    default:
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "packet_size is %u, it can be 0, 1, 4, 16, 64 or 256", packet_size);
    }
}

/* Holds the snapshot in force, so that the scene is free again while the query runs. */
static trc_status take_snapshot(trc_scene scene, struct trc_snapshot **snapshot_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    struct trc_snapshot *snapshot = trc_snapshot_retain(access.scene->snapshot);
    trc_scene_leave(&access);
    if (!snapshot) {
        return trc_fail(TRC_ERROR_NOT_COMMITTED, "the scene has not been committed yet");
    }
    *snapshot_out = snapshot;
    return TRC_OK;
}

static uint64_t chunk_end(uint64_t begin, uint64_t count) {
    return count - begin > CHUNK ? begin + CHUNK : count;
}

/* A query's rays, chunk by chunk. */
struct chunks {
    const trc_rays *rays;
    uint64_t begin, end;
    bool is_reordered;
    struct trc_ray_order order;
};

/* Closed by trc_ray_order_close, whatever is returned. */
static trc_status chunks_open(const trc_rays *rays, struct chunks *c) {
    *c = (struct chunks){.rays = rays, .is_reordered = rays->flags & TRC_RAYS_REORDER};
    if (!c->is_reordered || rays->count == 0)
        return TRC_OK;
    return trc_ray_order_open((uint32_t)chunk_end(0, rays->count), &c->order);
}

/* Goes on to the next one; false at the end. */
static bool chunks_next(struct chunks *c) {
    c->begin = c->end;
    c->end = chunk_end(c->begin, c->rays->count);
    if (c->begin == c->end)
        return false;
    if (c->is_reordered)
        trc_ray_order_sort(&c->order, c->rays, c->begin, (uint32_t)(c->end - c->begin));
    return true;
}

static trc_status check_closest(const trc_rays *rays, uint32_t packet_size, const trc_hits *hits,
                                uint32_t *size_out) {
    TRC_TRY(check_rays(rays));
    TRC_TRY(check_hits(hits, rays->count));
    return resolve_packet_size(packet_size, size_out);
}

trc_status trc_query_closest(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                             const trc_hits *hits_out) {
    struct trc_snapshot *snapshot = NULL;
    TRC_TRY(take_snapshot(scene, &snapshot));
    uint32_t size = 0;
    struct chunks chunks = {0};
    trc_status status = check_closest(rays, packet_size, hits_out, &size);
    if (status == TRC_OK)
        status = chunks_open(rays, &chunks);
    if (status == TRC_OK) {
        const uint64_t fp_state = trc_fp_enter();
        const struct trc_kernels *kernels = trc_kernels_current();
        while (chunks_next(&chunks))
            kernels->query_closest(snapshot, rays, hits_out, chunks.begin, chunks.end, size,
                                   chunks.order.order);
        trc_fp_leave(fp_state);
    }
    trc_ray_order_close(&chunks.order);
    trc_snapshot_release(snapshot);
    return status;
}

static trc_status check_occluded(const trc_rays *rays, uint32_t packet_size,
                                 const uint8_t *occluded, uint64_t occluded_count,
                                 uint32_t *size_out) {
    TRC_TRY(check_rays(rays));
    TRC_TRY(trc_check_array(occluded, occluded_count, rays->count, 1, 1, "occluded_out"));
    return resolve_packet_size(packet_size, size_out);
}

trc_status trc_query_occluded(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                              uint8_t *occluded_out, uint64_t occluded_count) {
    struct trc_snapshot *snapshot = NULL;
    TRC_TRY(take_snapshot(scene, &snapshot));
    uint32_t size = 0;
    struct chunks chunks = {0};
    trc_status status = check_occluded(rays, packet_size, occluded_out, occluded_count, &size);
    if (status == TRC_OK)
        status = chunks_open(rays, &chunks);
    if (status == TRC_OK) {
        const uint64_t fp_state = trc_fp_enter();
        const struct trc_kernels *kernels = trc_kernels_current();
        while (chunks_next(&chunks))
            kernels->query_occluded(snapshot, rays, occluded_out, chunks.begin, chunks.end, size,
                                    chunks.order.order);
        trc_fp_leave(fp_state);
    }
    trc_ray_order_close(&chunks.order);
    trc_snapshot_release(snapshot);
    return status;
}
