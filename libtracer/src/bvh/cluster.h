/* Clusters: up to four triangles, one after the other in a mesh, that a tree is built over as one
 * ref.
 *
 * The triangles of a quad, and often those of its neighbour, have so much of their boxes in common
 * that no plane would part them: with fewer refs builds are faster, at the same SAH cost. */
#ifndef TRACER_BVH_CLUSTER_H
#define TRACER_BVH_CLUSTER_H

#include "bvh/tree.h"

/* Makes next a part of former, if it is the triangle that follows there and their common box is as
 * good as both apart. */
bool trc_cluster_join(struct trc_ref *former, const struct trc_ref *next);

/* The triangles of count refs in order: what stands in the slots of a tree over them. */
void trc_clusters_open(const struct trc_ref *refs, uint32_t count,
                       struct trc_part_triangle *triangles_out);

#endif
