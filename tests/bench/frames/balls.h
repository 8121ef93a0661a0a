/* Balls in a cube, for cost against the number of triangles and of instances. */
#ifndef TRACER_BENCH_FRAMES_BALLS_H
#define TRACER_BENCH_FRAMES_BALLS_H

#include "stages.h"

/* Balls of one mesh. */
#define BALLS_COUNT 64

/* BALLS_COUNT balls of about so many triangles (1024 or more) together. */
void balls_make(uint32_t triangle_count, struct stage *stage);

/* One ball, and the edge of the cubic grid that count instances of it are on; the same cube. */
void balls_make_one(uint32_t count, struct stage *stage, uint32_t *edge_out);
/* Where instance i is: a 3x4 matrix. */
void balls_place(uint32_t edge, uint32_t i, float transform_out[12]);

#endif
