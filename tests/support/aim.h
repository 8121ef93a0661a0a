/* Rays that start inside of a closed mesh and are aimed at its vertices and edges, where rounding
 * could let them out. */
#ifndef TRACER_TESTS_AIM_H
#define TRACER_TESTS_AIM_H

#include "meshes.h"
#include "ray_set.h"

/* What rays are aimed at: vertices, middles of edges, or either. */
enum { AIM_VERTICES, AIM_EDGES, AIM_BOTH };

struct aim {
    const struct mesh *mesh; /* as it stands in the world; with several keys it moves */
    uint32_t at;
    float inside[3]; /* of the mesh at every time: origins are near it */
    float reach;     /* how near */
};

/* A vertex of a mesh at that time, as exactly as floats can be. */
void aim_vertex(const struct mesh *mesh, uint32_t vertex, float time, float out[3]);

/* A vertex, or the middle of an edge, of a random triangle at that time, as exactly as floats can
 * be. */
void aim_target(const struct aim *aim, struct rng *rng, float time, float target_out[3]);

/* Adds count rays. Packets of 64 of one origin and packets of many take turns, and so do packets of
 * one moment, of a short interval and of all times. */
void aim_rays(const struct aim *aim, struct rng *rng, uint32_t count, struct ray_set *rays);

#endif
