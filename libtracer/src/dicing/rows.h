/* What a vertex and a corner of a descriptor hold, side by side in a row of floats, so that all of
 * it is refined alike. */
#ifndef TRACER_DICING_ROWS_H
#define TRACER_DICING_ROWS_H

#include <stddef.h>
#include <stdint.h>

#include "tracer/geometry.h"

/* A vertex: positions of all keys, Generated coordinates if there are any, normals of all keys
 * where the surface is of them. A corner: the values of its attributes. */
struct trc_row_layout {
    const trc_dicing_desc *how;
    size_t key_count;
    size_t normals, generated; /* where they begin in a row; 0: there are none */
    size_t vertex_width, corner_width;
};

struct trc_row_layout trc_row_layout_of(const trc_mesh_desc *desc);

/* The descriptor's part of a vertex; normals that are still to be computed stay. */
void trc_fill_row(const struct trc_row_layout *rows, const trc_mesh_desc *desc, size_t vertex,
                  float *to);
void trc_fill_corner(const trc_mesh_desc *desc, size_t corner, float *to);

uint16_t trc_slot_of(const trc_mesh_desc *desc, size_t triangle);
uint8_t trc_smooth_of(const trc_mesh_desc *desc, size_t triangle);

#endif
