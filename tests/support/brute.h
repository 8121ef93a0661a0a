/* The oracle of the ray queries: every triangle in double precision, no tree.
 *
 * What kernels compute in single precision may differ from it near edges and in the last bits of a
 * distance. So each triangle near a ray is a candidate with bounds of the error that a kernel may
 * make there (derived in brute.c), and an answer is judged: it agrees, it is one of several that
 * rounding allows, or it is wrong. */
#ifndef TRACER_TESTS_BRUTE_H
#define TRACER_TESTS_BRUTE_H

#include <stdbool.h>
#include <stdint.h>

#include "query_scene.h"
#include "ray_set.h"

/* A triangle that the ray's line passes through, or may pass through after rounding. */
struct brute_candidate {
    uint32_t instance, triangle;
    bool inside; /* by double arithmetic, edges included */
    bool sure;   /* inside by more than rounding can move edges */
    double distance, u, v;
    double distance_error;    /* bound for a kernel's result */
    double barycentric_error; /* may exceed 1 for slivers */
    double blind_distance;    /* hits no farther than this, either way, may be taken for the surface
                                 the    ray left, and dropped */
};

struct brute_list {
    uint32_t count, capacity;
    struct brute_candidate *candidates;
};

void brute_list_free(struct brute_list *list);

/* All candidates of a ray in all instances that it may see, whatever their distance. None for rays
 * that by the rules hit nothing. Grows the list as needed; zero-initialise it before the first
 * call. */
void brute_collect(const struct query_world *world, const struct ray_set *rays, uint32_t ray,
                   struct brute_list *list);

/* The nearest candidate inside within (tmin, tmax] of the ray; of equal distances the lowest
 * (instance, triangle); NULL for a miss. Only where arithmetic is exact does it rule over a
 * kernel's answer. */
const struct brute_candidate *brute_nearest(const struct brute_list *list,
                                            const struct ray_set *rays, uint32_t ray);

enum brute_verdict {
    BRUTE_AGREES,   /* the only answer that rounding allows */
    BRUTE_DOUBTFUL, /* one of several */
    BRUTE_DIFFERS
};

/* Judges the closest hit, with distance and barycentrics, and the occlusion of one ray. */
enum brute_verdict brute_judge_closest(const struct brute_list *list, const struct ray_set *rays,
                                       uint32_t ray, const struct hit_set *hits);
enum brute_verdict brute_judge_occluded(const struct brute_list *list, const struct ray_set *rays,
                                        uint32_t ray, const struct hit_set *hits);

/* Candidates in order of collection, to the standard error stream. */
void brute_list_print(const struct brute_list *list);

#endif
