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
    TRC_TRY(trc_check_enum(hits->reserved, 1, "reserved"));
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

static trc_status check_packet_size(uint32_t packet_size) {
    switch (packet_size) {
    case 0:
    case 1:
    case 4:
    case 16:
    case 64:
    case 256:
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

/* What a query was called with. */
struct query {
    const trc_rays *rays;
    uint32_t packet_size;
    bool any; /* whether anything is hit, into occluded; else what is nearest, into hits */
    const trc_hits *hits;
    uint8_t *occluded;
    uint64_t occluded_count;
};

static trc_status query_check(const struct query *q) {
    TRC_TRY(check_rays(q->rays));
    if (!q->any)
        TRC_TRY(check_hits(q->hits, q->rays->count));
    else
        TRC_TRY(
            trc_check_array(q->occluded, q->occluded_count, q->rays->count, 1, 1, "occluded_out"));
    return check_packet_size(q->packet_size);
}

static void query_chunk(const struct query *q, const struct trc_snapshot *snapshot,
                        const struct chunks *c) {
    const struct trc_kernels *kernels = trc_kernels_current();
    if (!q->any)
        kernels->query_closest(snapshot, q->rays, q->hits, c->begin, c->end, q->packet_size,
                               c->order.order);
    else
        kernels->query_occluded(snapshot, q->rays, q->occluded, c->begin, c->end, q->packet_size,
                                c->order.order);
}

static trc_status query_run(trc_scene scene, const struct query *q) {
    struct trc_snapshot *snapshot = NULL;
    TRC_TRY(take_snapshot(scene, &snapshot));
    struct chunks chunks = {0};
    trc_status status = query_check(q);
    if (status == TRC_OK)
        status = chunks_open(q->rays, &chunks);
    if (status == TRC_OK) {
        const uint64_t fp_state = trc_fp_enter();
        while (chunks_next(&chunks))
            query_chunk(q, snapshot, &chunks);
        trc_fp_leave(fp_state);
    }
    trc_ray_order_close(&chunks.order);
    trc_snapshot_release(snapshot);
    return status;
}

trc_status trc_query_closest(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                             const trc_hits *hits_out) {
    const struct query query = {.rays = rays, .packet_size = packet_size, .hits = hits_out};
    return query_run(scene, &query);
}

trc_status trc_query_occluded(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                              uint8_t *occluded_out, uint64_t occluded_count) {
    const struct query query = {.rays = rays,
                                .packet_size = packet_size,
                                .any = true,
                                .occluded = occluded_out,
                                .occluded_count = occluded_count};
    return query_run(scene, &query);
}
