/* Ray queries over arrays in the caller's memory, on the kernels that render. */
#ifndef TRACER_QUERY_H
#define TRACER_QUERY_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

/* Rays that have no order in the arrays are taken as if they were sorted by where they start and
 * where they go, which makes packets of them: every 65,536 of a call are sorted for themselves, at
 * 20 bytes each while the call lasts. Hits are the same. Those that are neighbours in
 * space already lose a tenth. */
#define TRC_RAYS_REORDER 1u

/* Arrays of count floats each; tmin, tmax and time may be NULL (0, infinity, 0). Directions need
 * not be unit; distances are in units of their length. A ray with a NaN, an infinite origin or
 * direction, a zero direction, or tmin > tmax hits nothing. */
typedef struct trc_rays {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t visibility;  /* TRC_VISIBLE_* bits an instance must share; TRC_VISIBLE_ALL usual */
    uint64_t count;       /* rays; may be 0 */
    const float *origin_x, *origin_y, *origin_z;          /* metres, world */
    const float *direction_x, *direction_y, *direction_z; /* world, of any length */
    const float *tmin, *tmax; /* the part of each ray that counts, in lengths of its direction */
    const float *time;        /* over the shutter, [0, 1] */
    uint32_t flags;           /* TRC_RAYS_REORDER or 0 */
    uint32_t reserved;        /* 0 */
} trc_rays;

/* No rays, which meet what any ray does. */
TRC_API trc_rays trc_rays_default(void);

#define TRC_NO_HIT 0xffffffffu

/* Arrays of count each, any may be NULL except instance. Barycentrics: hit = (1-u-v) p0 + u p1 + v
 * p2; of curves, u is along the piece, v across as the ray sees it, of round ones that are met from
 * within 4 more; of balls both are across, and v is 8 more where a ray leaves one of
 * TRC_CURVE_BALL that it came into. On a miss instance is TRC_NO_HIT and the rest is untouched.
 * Of equal distances, the lowest (instance, triangle) in creation order wins. */
typedef struct trc_hits {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t reserved;    /* 0 */
    uint32_t *instance;   /* position of the instance in creation order among the living */
    uint32_t *triangle;   /* its number in the mesh */
    float *distance;      /* in lengths of the direction */
    float *u, *v;         /* barycentrics, see above */
    float *normal_x, *normal_y, *normal_z; /* geometric, world, not normalised, by winding; of
                                              curves towards where the ray came from */
} trc_hits;

/* No arrays yet. */
TRC_API trc_hits trc_hits_default(void);

/* The first hit of each ray with the last committed snapshot, at once and on the calling thread.
 * packet_size: 0 is best for rays of which neighbours in the arrays are neighbours in space; they
 * are taken in bundles and, inside, ordered by direction where they mix. 4, 16, 64 or 256: packets
 * of so many neighbours as they are, 256 as a bundle of 64 each; 1: single rays, for those that
 * have nothing in common (4 and 16 are taken so, too). The result does not depend on it. Cost: rays
 * of one call go best by the thousand. NOT_COMMITTED before the first commit; INVALID_ARGUMENT for
 * a required array that is NULL or a misaligned one. OUT_OF_MEMORY: only of rays that are to be
 * reordered. */
TRC_API trc_status trc_query_closest(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                                     const trc_hits *hits_out);

/* occluded_out[i] = 1 if anything lies strictly within (tmin, tmax), else 0. occluded_count: bytes
 * of occluded_out, the number of rays. As trc_query_closest in all else. */
TRC_API trc_status trc_query_occluded(trc_scene scene, const trc_rays *rays, uint32_t packet_size,
                                      uint8_t *occluded_out, uint64_t occluded_count);

TRC_END_DECLS

#endif
