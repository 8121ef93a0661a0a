/* Packing the bounds of moving trees' nodes (model/tree.h). */
#ifndef TRACER_BVH_PACKED_H
#define TRACER_BVH_PACKED_H

#include "model/tree.h"

/* Floats of a node's boxes as nodes at rest have them: for each axis 8 lower bounds, then 8 upper
 * ones. */
#define TRC_BOXES_FLOATS (2 * 3 * TRC_NODE_WIDTH)

/* Packs the boxes of a node's children, of which at least one is not empty: the packed ones hold
 * them, but for the rounding of what unpacks them. */
void trc_boxes_pack(const float boxes[TRC_BOXES_FLOATS], struct trc_packed_boxes *out);

/* The box around all of them. */
void trc_packed_hull(const struct trc_packed_boxes *boxes, float lower_out[3], float upper_out[3]);

#endif
