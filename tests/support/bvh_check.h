/* Invariants of trees, by walking them whole.
 *
 * What traversal relies on: references in range, every node and slot reached once and nodes after
 * their parents (so there is no cycle), no path longer than the stack allows, boxes that hold what
 * is below them at every key, or, of clipped triangles, boxes that do so together, leaves that hold
 * their triangles' vertices as the mesh and the transform give them. Containment between keys
 * follows up to rounding, as boxes and vertices are interpolated by the same formula;
 * kernels/trace/beam.h allows for the rounding. */
#ifndef TRACER_TESTS_BVH_CHECK_H
#define TRACER_TESTS_BVH_CHECK_H

#include <stdbool.h>
#include <stdint.h>

#include "bvh/bvh.h"

/* Checks the invariants: every child inside its parent at every key, every triangle in exactly one
 * leaf, or in several that hold it together (or counted as skipped), acyclic, depth within the
 * stack. False writes why to message. */
bool bvh_check(const struct trc_bvh *bvh, const struct trc_snapshot *snapshot, char *message,
               uint32_t capacity);

#endif
