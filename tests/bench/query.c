#include "query.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The caller's arrays of a batch. */
struct arrays {
    float *origin[3], *direction[3], *tmin, *tmax, *time;
    uint32_t *instance, *triangle;
    float *distance, *u, *v;
    uint8_t *occluded;
};
#define ARRAYS 14 /* of 32 bits each */
#define ARRAY_BYTES (RAY_BATCH * sizeof(float))

static size_t batch_bytes(const struct contestant *c, const struct ray_list *list) {
    (void)c;
    (void)list;
    return ARRAYS * ARRAY_BYTES + RAY_BATCH;
}

static struct arrays arrays_in(const void *memory) {
    char *at = (char *)memory;
    struct arrays a;
    float **const floats[] = {&a.origin[0],    &a.origin[1],    &a.origin[2], &a.direction[0],
                              &a.direction[1], &a.direction[2], &a.tmin,      &a.tmax,
                              &a.time,         &a.distance,     &a.u,         &a.v};
    for (size_t i = 0; i < sizeof floats / sizeof *floats; i++, at += ARRAY_BYTES)
        *floats[i] = (float *)at;
    a.instance = (uint32_t *)at;
    a.triangle = (uint32_t *)(at + ARRAY_BYTES);
    a.occluded = (uint8_t *)(at + 2 * ARRAY_BYTES);
    return a;
}

static void load(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                 void *memory) {
    const struct arrays a = arrays_in(memory);
    const uint32_t begin = list->batch_begin[batch];
    const size_t bytes = batch_rays(list, batch) * sizeof(float);
    const struct ray_set *rays = &list->rays;
    (void)c;
    for (int axis = 0; axis < 3; axis++) {
        memcpy(a.origin[axis], rays->origin[axis] + begin, bytes);
        memcpy(a.direction[axis], rays->direction[axis] + begin, bytes);
    }
    memcpy(a.tmin, rays->tmin + begin, bytes);
    memcpy(a.tmax, rays->tmax + begin, bytes);
    memcpy(a.time, rays->time + begin, bytes);
}

static void trace(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  void *memory) {
    const struct query_target *target = c->tracer;
    const struct arrays a = arrays_in(memory);
    trc_rays rays = trc_rays_default();
    rays.count = batch_rays(list, batch);
    rays.origin_x = a.origin[0], rays.origin_y = a.origin[1], rays.origin_z = a.origin[2];
    rays.direction_x = a.direction[0], rays.direction_y = a.direction[1];
    rays.direction_z = a.direction[2];
    rays.tmin = a.tmin, rays.tmax = a.tmax, rays.time = a.time;
    trc_hits hits = trc_hits_default();
    hits.instance = a.instance, hits.triangle = a.triangle;
    hits.distance = a.distance, hits.u = a.u, hits.v = a.v;
    const trc_status status =
        list->any
            ? trc_query_occluded(target->scene, &rays, target->packet_size, a.occluded, rays.count)
            : trc_query_closest(target->scene, &rays, target->packet_size, &hits);
    if (status != TRC_OK) {
        fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
        exit(EXIT_FAILURE);
    }
}

static void store(const struct contestant *c, const struct ray_list *list, uint32_t batch,
                  const void *memory, struct hit_set *hits) {
    const struct arrays a = arrays_in(memory);
    const uint32_t begin = list->batch_begin[batch];
    (void)c;
    for (uint32_t i = 0; i < batch_rays(list, batch); i++) {
        hits->occluded[begin + i] = list->any && a.occluded[i];
        hits->instance[begin + i] = a.instance[i];
        hits->triangle[begin + i] = a.triangle[i];
        hits->distance[begin + i] = a.distance[i];
        hits->u[begin + i] = a.u[i];
        hits->v[begin + i] = a.v[i];
    }
}

struct contestant query_contestant(const char *name, const struct query_target *target) {
    static const struct contestant_calls calls = {batch_bytes, load, trace, store};
    struct contestant c = {.calls = &calls, .tracer = target};
    snprintf(c.name, sizeof c.name, "%s", name);
    return c;
}
