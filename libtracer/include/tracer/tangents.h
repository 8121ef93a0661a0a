/* Tangents of UV maps, for normal maps and anisotropic gloss. */
#ifndef TRACER_TANGENTS_H
#define TRACER_TANGENTS_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

/* Triangles, whose corners are told one after the other. */
typedef struct trc_tangents_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t has_seams;      /* 0: corners are alike whatever their UVs; 1: of equal UVs alone */
    uint64_t triangle_count; /* below 2^30 */
    const float *positions;  /* 9 * triangle_count: metres */
    const float *normals;    /* 9 * triangle_count: unit, those that corners are shaded with */
    const float *uvs;        /* 6 * triangle_count */
} trc_tangents_desc;

/* No triangles; has_seams is 1. */
TRC_API trc_tangents_desc trc_tangents_desc_default(void);

enum trc_tangents_form {
    /* Unit vectors, 9 * triangle_count floats. */
    TRC_TANGENTS_VECTORS = 0,
    /* 12 * triangle_count floats: a and b, with the tangent along a (p1 - p0) + b (p2 - p0) made
     * perpendicular to the corner's normal, so that tangents go along with a triangle that is
     * turned and stretched; the handedness, 1 or -1; 0. */
    TRC_TANGENTS_COORDINATES = 1
};

/* The tangents of all corners, as Cycles has them (M. S. Mikkelsen, "Simulation of Wrinkled
 * Surfaces Revisited", 2008): corners of one place, normal, UV and handedness whose triangles are
 * joined by edges share one, the mean of their triangles' directions of growing U by the angles
 * there; (1, 0, 0) where U grows nowhere. tangents_out: float_count floats, of the form. At once,
 * on the calling thread, from any thread; 50 bytes for each corner while it lasts, some .1
 * microseconds. INVALID_ARGUMENT, TOO_LARGE or OUT_OF_MEMORY. */
TRC_API trc_status trc_tangents_find(const trc_tangents_desc *desc, uint32_t form,
                                     float *tangents_out, uint64_t float_count);

TRC_END_DECLS

#endif
