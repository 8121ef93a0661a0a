/* The faces that a descriptor's triangles were cut from. */
#ifndef TRACER_DICING_FACE_JOINING_H
#define TRACER_DICING_FACE_JOINING_H

#include "dicing/faces.h"
#include "dicing/rows.h"

/* Triangles of one face become one, or stay where they make no ring. OUT_OF_MEMORY; free the faces
 * in either case. */
trc_status trc_join_faces(const struct trc_row_layout *rows, const trc_mesh_desc *desc,
                          struct trc_faces *f);

#endif
