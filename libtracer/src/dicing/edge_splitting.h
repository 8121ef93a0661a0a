/* Splitting of edges, not of triangles: both triangles of an edge agree, so nothing opens. */
#ifndef TRACER_DICING_EDGE_SPLITTING_H
#define TRACER_DICING_EDGE_SPLITTING_H

#include "dicing/refined_mesh.h"

/* Halves what is too long at most levels times; then all triangles are done. A mesh that would have
 * too many triangles stays coarse. OUT_OF_MEMORY or TOO_LARGE. */
trc_status trc_split_edges(struct trc_refined_mesh *mesh, uint32_t levels);

#endif
