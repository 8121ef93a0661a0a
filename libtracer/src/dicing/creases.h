/* The creases of a descriptor. */
#ifndef TRACER_DICING_CREASES_H
#define TRACER_DICING_CREASES_H

#include "dicing/faces.h"
#include "tracer/geometry.h"

/* The sharpness of the faces' edges and vertices. OUT_OF_MEMORY. */
trc_status trc_take_creases(struct trc_faces *faces, const trc_dicing_desc *how);

#endif
