#include "ray_set.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"

/* The arrays of a set, to treat them alike. */
#define COLUMN_COUNT 9
static void columns_of(struct ray_set *rays, float **columns[COLUMN_COUNT]) {
    for (int axis = 0; axis < 3; axis++) {
        columns[axis] = &rays->origin[axis];
        columns[3 + axis] = &rays->direction[axis];
    }
    columns[6] = &rays->tmin;
    columns[7] = &rays->tmax;
    columns[8] = &rays->time;
}

void ray_set_init(struct ray_set *rays) { *rays = (struct ray_set){.visibility = TRC_VISIBLE_ALL}; }

void ray_set_free(struct ray_set *rays) {
    float **columns[COLUMN_COUNT];
    columns_of(rays, columns);
    for (int i = 0; i < COLUMN_COUNT; i++)
        free(*columns[i]);
    ray_set_init(rays);
}

void ray_set_clear(struct ray_set *rays) { rays->count = 0; }

void ray_set_add(struct ray_set *rays, const float origin[3], const float direction[3], float tmin,
                 float tmax, float time) {
    const uint32_t i = rays->count++;
    if (i == rays->capacity) {
        float **columns[COLUMN_COUNT];
        columns_of(rays, columns);
        rays->capacity = rays->capacity ? 2 * rays->capacity : 1024;
        for (int c = 0; c < COLUMN_COUNT; c++)
            *columns[c] =
                buffer_grow(*columns[c], i * sizeof(float), rays->capacity, sizeof(float));
    }
    for (int axis = 0; axis < 3; axis++) {
        rays->origin[axis][i] = origin[axis];
        rays->direction[axis][i] = direction[axis];
    }
    rays->tmin[i] = tmin;
    rays->tmax[i] = tmax;
    rays->time[i] = time;
}

void ray_set_add_simple(struct ray_set *rays, const float origin[3], const float direction[3]) {
    ray_set_add(rays, origin, direction, 0.0f, INFINITY, 0.0f);
}

void ray_set_aim(struct ray_set *rays, const float origin[3], const float target[3], float time) {
    const float direction[3] = {target[0] - origin[0], target[1] - origin[1],
                                target[2] - origin[2]};
    ray_set_add(rays, origin, direction, 0.0f, INFINITY, time);
}

void ray_set_get(const struct ray_set *rays, uint32_t ray, float origin[3], float direction[3]) {
    for (int axis = 0; axis < 3; axis++) {
        origin[axis] = rays->origin[axis][ray];
        direction[axis] = rays->direction[axis][ray];
    }
}

trc_rays ray_set_view(const struct ray_set *rays, uint32_t first, uint32_t count) {
    return (trc_rays){.struct_size = sizeof(trc_rays),
                      .visibility = rays->visibility,
                      .count = count,
                      .origin_x = rays->origin[0] + first,
                      .origin_y = rays->origin[1] + first,
                      .origin_z = rays->origin[2] + first,
                      .direction_x = rays->direction[0] + first,
                      .direction_y = rays->direction[1] + first,
                      .direction_z = rays->direction[2] + first,
                      .tmin = rays->tmin + first,
                      .tmax = rays->tmax + first,
                      .time = rays->time + first,
                      .flags = rays->flags};
}

void hit_set_init(struct hit_set *hits, uint32_t count) {
    *hits = (struct hit_set){.count = count};
    hits->instance = buffer_alloc(count, sizeof(uint32_t));
    hits->triangle = buffer_alloc(count, sizeof(uint32_t));
    hits->distance = buffer_alloc(count, sizeof(float));
    hits->u = buffer_alloc(count, sizeof(float));
    hits->v = buffer_alloc(count, sizeof(float));
    for (int axis = 0; axis < 3; axis++)
        hits->normal[axis] = buffer_alloc(count, sizeof(float));
    hits->occluded = buffer_alloc(count, 1);
}

void hit_set_free(struct hit_set *hits) {
    free(hits->instance);
    free(hits->triangle);
    free(hits->distance);
    free(hits->u);
    free(hits->v);
    for (int axis = 0; axis < 3; axis++)
        free(hits->normal[axis]);
    free(hits->occluded);
    *hits = (struct hit_set){0};
}

static void hit_set_clear(struct hit_set *hits) {
    const size_t bytes = hits->count * sizeof(float);
    memset(hits->instance, 0, bytes);
    memset(hits->triangle, 0, bytes);
    memset(hits->distance, 0, bytes);
    memset(hits->u, 0, bytes);
    memset(hits->v, 0, bytes);
    for (int axis = 0; axis < 3; axis++)
        memset(hits->normal[axis], 0, bytes);
}

trc_hits hit_set_view(const struct hit_set *hits) {
    return (trc_hits){.struct_size = sizeof(trc_hits),
                      .instance = hits->instance,
                      .triangle = hits->triangle,
                      .distance = hits->distance,
                      .u = hits->u,
                      .v = hits->v,
                      .normal_x = hits->normal[0],
                      .normal_y = hits->normal[1],
                      .normal_z = hits->normal[2]};
}

trc_status hit_set_query(struct hit_set *hits, trc_scene scene, const struct ray_set *rays,
                         uint32_t packet_size) {
    const trc_rays view = ray_set_view(rays, 0, rays->count);
    const trc_hits out = hit_set_view(hits);
    hit_set_clear(hits);
    const trc_status status = trc_query_closest(scene, &view, packet_size, &out);
    if (status != TRC_OK)
        return status;
    return trc_query_occluded(scene, &view, packet_size, hits->occluded, hits->count);
}

static bool same_float(const float *a, const float *b, uint32_t i) {
    return memcmp(a + i, b + i, sizeof *a) == 0;
}

uint32_t hit_set_difference(const struct hit_set *a, const struct hit_set *b) {
    for (uint32_t i = 0; i < a->count; i++)
        if (a->instance[i] != b->instance[i] || a->triangle[i] != b->triangle[i] ||
            !same_float(a->distance, b->distance, i) || !same_float(a->u, b->u, i) ||
            !same_float(a->v, b->v, i) || a->occluded[i] != b->occluded[i])
            return i;
    return UINT32_MAX;
}

void hit_set_print(const struct hit_set *hits, const struct ray_set *rays, uint32_t ray) {
    float o[3], d[3];
    ray_set_get(rays, ray, o, d);
    fprintf(stderr, "ray %u: from %a %a %a along %a %a %a, %a to %a, time %a\n", ray, o[0], o[1],
            o[2], d[0], d[1], d[2], rays->tmin[ray], rays->tmax[ray], rays->time[ray]);
    if (hits->instance[ray] == TRC_NO_HIT)
        fprintf(stderr, "  hits nothing, occluded %u\n", hits->occluded[ray]);
    else
        fprintf(stderr, "  hits %u/%u at %a (%a, %a), occluded %u\n", hits->instance[ray],
                hits->triangle[ray], hits->distance[ray], hits->u[ray], hits->v[ray],
                hits->occluded[ray]);
}
