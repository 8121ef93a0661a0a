/* Wavefront OBJ: positions and faces only. */
#ifndef TRACER_BENCH_OBJ_H
#define TRACER_BENCH_OBJ_H

#include <stdbool.h>
#include <stddef.h>

#include "meshes.h"

/* Reads a file into an empty mesh; polygons become fans of triangles, and Y up becomes Z up. On
 * failure the mesh is empty and message (of capacity bytes) says what is wrong, with the line. */
bool obj_load(const char *path, struct mesh *mesh, char *message, size_t capacity);

#endif
