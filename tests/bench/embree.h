/* Embree 3 as the peer to compare with. Without it (embree_absent.c) no device opens. */
#ifndef TRACER_BENCH_EMBREE_H
#define TRACER_BENCH_EMBREE_H

#include "contestant.h"

/* Single rays; packets and streams, each as incoherent and as coherent rays. */
#define EMBREE_MODES 5

struct embree_device;
struct embree_scene;

/* A device held to the instruction set that matches one of ours, with that many threads for builds
 * (0: all). NULL: no Embree, or it has nothing of the kind. */
struct embree_device *embree_open(uint32_t isa, uint32_t threads);
void embree_close(struct embree_device *device);

enum embree_use { EMBREE_FAST, EMBREE_ROBUST, EMBREE_POSED };

/* Builds a scene of one mesh with its keys, which must live as long. POSED: made to be refitted.
 * Ends the program on errors. */
struct embree_scene *embree_scene_create(struct embree_device *device, const struct mesh *mesh,
                                         enum embree_use use);
void embree_scene_destroy(struct embree_scene *scene);

enum embree_curve {
    EMBREE_ROUND_LINEAR,
    EMBREE_FLAT_LINEAR,
    EMBREE_ROUND_CATMULL_ROM,
    EMBREE_FLAT_CATMULL_ROM
};

/* Builds a scene of strands of point_count points each, which may go: x, y, z, radius, the first
 * and the last of a spline standing for those beyond the ends. pieces: of flat splines. Ends the
 * program on errors. */
struct embree_scene *embree_curves_create(struct embree_device *device, enum embree_curve curve,
                                          const float *points, uint32_t strand_count,
                                          uint32_t point_count, uint32_t pieces);

/* Of the build, and memory that it left in use. */
double embree_build_seconds(const struct embree_scene *scene);
uint64_t embree_build_bytes(const struct embree_scene *scene);

/* Refits to other arrays of positions, laid out as the mesh's; returns the seconds. */
double embree_pose(struct embree_scene *scene, const float *positions);

/* The modes that the device has, natively wide packets; returns how many. */
uint32_t embree_contestants(const struct embree_scene *scene, struct contestant out[EMBREE_MODES]);

#endif
