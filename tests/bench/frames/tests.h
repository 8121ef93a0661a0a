/* Numbers of tests by kind of ray, counted while frames are rendered by kernels compiled for it:
 * every file of libtracer/src/kernels once more, as the instruction set "counted", one lane wide,
 * with this header before it. */
#ifndef TRACER_BENCH_FRAMES_TESTS_H
#define TRACER_BENCH_FRAMES_TESTS_H

#include "../trace_counts.h"

/* By the packet's visibility; RAYS_MIXED: packets of the blind assembly. */
enum ray_class {
    RAYS_CAMERA,
    RAYS_REFLECTION,
    RAYS_REFRACTION,
    RAYS_SHADOW,
    RAYS_MIXED,
    RAY_CLASSES
};

/* Of the frames counted so far. Not for several threads at once. */
extern struct trace_counts frame_tests[RAY_CLASSES];

enum ray_class frame_tests_class(uint32_t visibility);

#define TRC_COUNT(what, amount) \
    (frame_tests[frame_tests_class(w->packets->visibility)].what += (uint64_t)(amount))

#endif
