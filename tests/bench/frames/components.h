/* The objects of a mesh: what hangs together by shared vertices. */
#ifndef TRACER_BENCH_FRAMES_COMPONENTS_H
#define TRACER_BENCH_FRAMES_COMPONENTS_H

#include "meshes.h"

/* The number of each triangle's object, in the order of their first vertices, modulo modulus
 * (1..65536): triangle_count values, for free(). */
uint16_t *components_of(const struct mesh *mesh, uint32_t modulus);

#endif
