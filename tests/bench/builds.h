/* Speed of builds and refits, through the public interface, and what they cost in memory. */
#ifndef TRACER_BENCH_BUILDS_H
#define TRACER_BENCH_BUILDS_H

#include "options.h"
#include "rate.h"
#include "scene.h"

/* Millions of triangles per second; bytes per triangle. */
struct build_result {
    struct rate build;  /* trees alone */
    struct rate commit; /* all of trc_scene_commit */
    struct rate refit;  /* trees alone, after new positions of every key */
    double bytes, sah_cost;
    struct rate peer_build, peer_refit; /* Embree's best instruction set; count 0 without it */
    double peer_bytes;
};

/* False: the library failed, and said why to the standard error stream. */
bool builds_measure(const struct bench_scene *scene, bool moving, uint32_t threads,
                    const struct options *options, struct build_result *out);

#endif
