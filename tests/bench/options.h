/* What the command line asks for. */
#ifndef TRACER_BENCH_OPTIONS_H
#define TRACER_BENCH_OPTIONS_H

#include <stdbool.h>
#include <stdint.h>

#define OPTIONS_SCENES 16
#define OPTIONS_ISAS 4
#define OPTIONS_THREADS 8

struct options {
    const char *scenes[OPTIONS_SCENES]; /* names of stages or paths */
    uint32_t scene_count;
    uint32_t isas[OPTIONS_ISAS]; /* TRC_ISA_* */
    uint32_t isa_count;
    uint32_t threads[OPTIONS_THREADS]; /* counts, 1 or more */
    uint32_t thread_count;
    uint32_t turn;    /* of all scenes about the vertical, degrees */
    uint32_t kinds;   /* bits of enum ray_kind */
    uint32_t orders;  /* bits of enum ray_order */
    uint32_t motions; /* bit 0: still, bit 1: moving */
    uint32_t repeats; /* of each measurement, after one that warms up */
    uint32_t size;    /* of the square frame, pixels */
    uint32_t samples; /* per pixel */
    uint32_t tiles;   /* of the frame that are traced */
    uint32_t bundle;  /* packets that go through the tree together at most */
    bool streamed;    /* rays and results of a whole set in memory, not of one batch in cache */
    bool queries;     /* the public ray queries beside the kernels */
    bool embree;
    bool builds;
    bool counts;   /* steps of traversal */
    bool accuracy; /* of hits beside Embree's, on meshes of its own; no speed */
    bool strands;  /* curves beside Embree's; nothing else is measured */
    bool check;    /* hits against brute force, nothing is measured */
    const char *json;
};

enum options_result { OPTIONS_RUN, OPTIONS_DONE, OPTIONS_ERROR };

/* DONE: help was asked for and printed. ERROR: what is wrong was printed to the standard error
 * stream. */
enum options_result options_parse(int argc, char **argv, struct options *options);

#endif
