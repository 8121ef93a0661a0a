/* How exact hits are, beside Embree's: rays from inside of closed meshes at their vertices and
 * edges, which all must hit, against long arithmetic. */
#ifndef TRACER_BENCH_ACCURACY_H
#define TRACER_BENCH_ACCURACY_H

#include <stdbool.h>
#include <stdio.h>

#include "options.h"

/* Prints a table for each mesh and instruction set of the options, and writes JSON rows if json is
 * not NULL. False, with a message, if a scene cannot be made. */
bool accuracy_measure(const struct options *options, FILE *json);

#endif
