/* Early split clipping: one ref as several, each to what lies of its triangles in a part of its
 * box.
 *
 * For the tree that joins what is at rest in final frames: others stand in the space of their mesh,
 * whose walls mostly follow the axes, and are refitted.
 *
 * Long triangles that slant have boxes of many times their area, which no split of whole triangles
 * makes smaller. After Manfred Ernst, Günther Greiner, "Early Split Clipping for Bounding Volume
 * Hierarchies", 2007, who cut whatever has a large box; here it must be mostly empty, too. Planes
 * are those of grids over the tree, so that neighbours are cut alike: Tero Karras, Timo Aila, "Fast
 * Parallel Construction of High-Quality Bounding Volume Hierarchies", 2013.
 *
 * Spatial splits within the build (Martin Stich, Heiko Friedrich, Andreas Dietrich, "Spatial Splits
 * in Bounding Volume Hierarchies", 2009) do less for more: docs/measurements.md. */
#ifndef TRACER_BVH_CLIP_H
#define TRACER_BVH_CLIP_H

#include "bvh/tree.h"
#include "core/box.h"

/* What is to be cut: refs of a tree with those bounds whose boxes are larger (half the surface). */
struct trc_clip {
    struct box bounds;
    float min_area;
};

/* Boxes of less than this part of the tree's stay whole. */
#define TRC_CLIP_MIN_SHARE 3e-3f

/* Pieces of a ref at most. */
#define TRC_CLIP_MAX_PIECES 256

/* Cuts a ref to triangles of the part: pieces_out, unless it is NULL, gets those that stand for it,
 * itself where it stays whole. Each point of its triangles is in the box of a piece that has that
 * triangle; a hit that rounding puts beyond it is as near to that box as to a whole triangle's, and
 * kernels allow for that (kernels/trace/beam.h). Returns how many pieces there are, at least 1;
 * *triangles_out: the triangles of all together. */
uint32_t trc_ref_clip(const struct trc_part *part, const struct trc_ref *ref,
                      const struct trc_clip *clip, struct trc_ref *pieces_out,
                      uint32_t *triangles_out);

#endif
