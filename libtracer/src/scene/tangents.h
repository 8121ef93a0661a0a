/* Tangents of a UV map at the corners of triangles (tracer/tangents.h). */
#ifndef TRACER_SCENE_TANGENTS_H
#define TRACER_SCENE_TANGENTS_H

#include "tracer/tangents.h"

/* desc and form are checked, tangents_out has room. OUT_OF_MEMORY. */
trc_status trc_tangents_fill(const trc_tangents_desc *desc, uint32_t form, float *tangents_out);

#endif
