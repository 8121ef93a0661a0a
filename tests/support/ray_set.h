/* Arrays of rays and of what they hit, as the public queries take them. */
#ifndef TRACER_TESTS_RAY_SET_H
#define TRACER_TESTS_RAY_SET_H

#include <stdbool.h>
#include <stdint.h>

#include "rng.h"
#include "tracer/tracer.h"

struct ray_set {
    uint32_t count, capacity;
    uint32_t visibility; /* TRC_VISIBLE_* */
    uint32_t flags;      /* TRC_RAYS_* */
    float *origin[3], *direction[3], *tmin, *tmax, *time;
};

struct hit_set {
    uint32_t count;
    uint32_t *instance, *triangle;
    float *distance, *u, *v, *normal[3];
    uint8_t *occluded;
};

void ray_set_init(struct ray_set *rays); /* empty, TRC_VISIBLE_ALL */
void ray_set_free(struct ray_set *rays);
/* Keeps the memory. */
void ray_set_clear(struct ray_set *rays);

void ray_set_add(struct ray_set *rays, const float origin[3], const float direction[3], float tmin,
                 float tmax, float time);
/* From tmin 0 to infinity at time 0. */
void ray_set_add_simple(struct ray_set *rays, const float origin[3], const float direction[3]);
/* From one point through another: the target is at distance 1. */
void ray_set_aim(struct ray_set *rays, const float origin[3], const float target[3], float time);

void ray_set_get(const struct ray_set *rays, uint32_t ray, float origin[3], float direction[3]);

/* The arrays from first on, count of them, as the query's argument. */
trc_rays ray_set_view(const struct ray_set *rays, uint32_t first, uint32_t count);

void hit_set_init(struct hit_set *hits, uint32_t count);
void hit_set_free(struct hit_set *hits);

/* The arrays of nearest hits as the query's argument. */
trc_hits hit_set_view(const struct hit_set *hits);

/* Both queries for all rays. Where a ray misses, all fields but instance are 0. */
trc_status hit_set_query(struct hit_set *hits, trc_scene scene, const struct ray_set *rays,
                         uint32_t packet_size);

/* The first ray from which on a and b differ in a bit of anything but the normals, or UINT32_MAX.
 */
uint32_t hit_set_difference(const struct hit_set *a, const struct hit_set *b);

/* Writes a ray with its hit to the standard error stream, in full precision. */
void hit_set_print(const struct hit_set *hits, const struct ray_set *rays, uint32_t ray);

#endif
