/* Catmull-Clark subdivision: E. Catmull, J. Clark, "Recursively generated B-spline surfaces on
 * arbitrary topological meshes", 1978; open boundaries are cubic B-splines. Limit positions by
 * M. Halstead, M. Kass, T. DeRose, "Efficient, fair interpolation using Catmull-Clark surfaces",
 * 1993. */
#ifndef TRACER_DICING_CATMULL_CLARK_H
#define TRACER_DICING_CATMULL_CLARK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tracer/geometry.h"

/* Faces of three or more corners. A vertex has vertex_width floats, all subdivided alike, a corner
 * corner_width, which are interpolated linearly. */
struct trc_faces {
    size_t vertex_width, corner_width;
    uint32_t vertex_count, face_count;
    uint32_t *begin;   /* face_count + 1: the first corner of each face */
    uint32_t *indices; /* of the corners, their vertices */
    float *vertices, *corners;
    uint16_t *material_index; /* of the faces */
    uint8_t *smooth;          /* of the faces */
};

void trc_faces_free(struct trc_faces *faces);

/* One level more, all quadrilaterals. On failure faces stays. TOO_LARGE or OUT_OF_MEMORY. */
trc_status trc_catmull_clark_subdivide(struct trc_faces *faces, bool sharp_corners);

/* Moves the vertices of quadrilaterals to where infinitely many levels would. OUT_OF_MEMORY. */
trc_status trc_catmull_clark_limit(struct trc_faces *faces, bool sharp_corners);

#endif
