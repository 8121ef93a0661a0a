/* Hits of the kernels against brute force. */
#ifndef TRACER_BENCH_CHECK_H
#define TRACER_BENCH_CHECK_H

#include "options.h"
#include "scene.h"

/* Judges every ray of every list that the options ask for, for each instruction set, and prints a
 * line for each. False if any answer is wrong. */
bool check_scene(const struct bench_scene *scene, const struct options *options);

#endif
