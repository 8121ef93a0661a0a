/* Faces of three or more corners, as they are subdivided. */
#ifndef TRACER_DICING_FACES_H
#define TRACER_DICING_FACES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tracer/base.h"

/* A vertex has vertex_width floats, all subdivided alike, a corner corner_width, which are
 * interpolated linearly. */
struct trc_faces {
    size_t vertex_width, corner_width;
    uint32_t vertex_count, face_count;
    bool sharp_corners; /* a vertex of a single face stays */
    uint32_t *begin;    /* face_count + 1: the first corner of each face */
    uint32_t *indices;  /* of the corners, their vertices */
    float *vertices, *corners;
    uint16_t *material_index; /* of the faces */
    uint8_t *smooth;          /* of the faces */
    /* For how many levels creases stay, of the corners that of the edge to the next one, and of the
     * vertices. NULL: there are none. */
    float *edge_sharpness, *vertex_sharpness;
};

void trc_faces_free(struct trc_faces *faces);

static inline uint32_t trc_next_corner(const struct trc_faces *f, uint32_t face, uint32_t corner) {
    return corner + 1 == f->begin[face + 1] ? f->begin[face] : corner + 1;
}

static inline uint32_t trc_previous_corner(const struct trc_faces *f, uint32_t face,
                                           uint32_t corner) {
    return corner == f->begin[face] ? f->begin[face + 1] - 1 : corner - 1;
}

#endif
