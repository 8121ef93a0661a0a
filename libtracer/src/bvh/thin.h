/* Trees that one instance has for itself in world space, and the meshes of those that are thin,
 * which rays cannot be taken to the object space of. */
#ifndef TRACER_BVH_THIN_H
#define TRACER_BVH_THIN_H

#include "bvh/tree.h"

/* The mesh that a thin instance shows, in world space: *mesh_out points to the mesh's own arrays
 * but for positions, which are the caller's to free. Where mesh and instance both have keys, their
 * products, which are no straight lines, become straight between keys as often as both have.
 * Positions are rounded once. OUT_OF_MEMORY. */
trc_status trc_thin_mesh(const struct trc_instance *instance, const struct trc_mesh *mesh,
                         struct trc_mesh *mesh_out);

/* A tree to be filled and released as a trc_blas, for that instance of that mesh; NULL out of
 * memory.
 */
struct trc_own_tree *trc_own_tree_create(const struct trc_instance *instance,
                                         const struct trc_mesh *mesh);

/* Whether a tree is that of the instance as it stands. */
bool trc_own_tree_is_of(const struct trc_own_tree *thin, const struct trc_instance *instance,
                        const struct trc_mesh *mesh);

#endif
