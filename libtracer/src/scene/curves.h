/* Curves of a scene: meshes whose primitives are pieces of strands, or balls (model/snapshot.h). */
#ifndef TRACER_SCENE_CURVES_H
#define TRACER_SCENE_CURVES_H

#include "model/names.h"
#include "model/snapshot.h"

/* Cuts the strands of a descriptor, whose counts and pointers are checked (api/curves.c), into
 * pieces: Catmull-Rom splines (E. Catmull, R. Rom, "A Class of Local Interpolating Splines", 1974),
 * radii too, into as many as the first pose needs; attributes are linear between points. Keys that
 * are all equal become one. INVALID_ARGUMENT, TOO_LARGE or OUT_OF_MEMORY. */
trc_status trc_curves_geometry_create(const trc_curves_desc *desc, struct trc_names *names,
                                      struct trc_mesh **mesh_out);

/* Other points of the same strands, as in the descriptor; from: curves. */
trc_status trc_curves_geometry_pose(const struct trc_mesh *from, uint32_t key_count,
                                    const float *points, uint64_t point_value_count,
                                    struct trc_mesh **mesh_out);

#endif
