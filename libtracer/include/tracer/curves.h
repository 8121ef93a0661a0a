/* Curves and points: hair, fur, strands, particles. See base.h for units, ownership and errors.
 *
 * They are meshes to everything else: instances show them, trc_mesh_destroy frees them. */
#ifndef TRACER_CURVES_H
#define TRACER_CURVES_H

#include "tracer/base.h"
#include "tracer/geometry.h"

TRC_BEGIN_DECLS

/* Most pieces that a spline is cut into from one of its points to the next. */
#define TRC_MAX_CURVE_PIECES 32

/* What is around a curve, or a point. */
enum trc_curve_shape {
    TRC_CURVE_RIBBON = 0,     /* flat, each ray sees it from the front, with the normals of a round
                                 one; ends are cut; nothing nearer than its width to a ray's origin
                                 counts, which is how it does not meet itself */
    TRC_CURVE_ROUND = 1,      /* a tube, closed at its joints, cut upright and open at its ends */
    TRC_CURVE_BALL = 2,       /* at each point; takes light of a shadow ray once, and has normals
                                 away from the middle where an instance stretches it, as in Cycles
                                 5 */
    TRC_CURVE_HOLLOW_BALL = 3 /* at each point; takes light where a shadow ray comes in and where it
                                 goes out, an ellipsoid where an instance stretches it, as in Cycles
                                 4 */
};

/* A named value of each point, or of each strand. */
typedef struct trc_curve_attribute {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t width;       /* floats: 2 (UV map) or 4 (colour, scene-linear RGBA) */
    const char *name;     /* UTF-8, up to 63 bytes; not NULL */
    const float *values;  /* width * point_count, or width * strand_count */
    uint64_t value_count; /* number of floats, checked */
    uint32_t per_strand;  /* 1: one of each strand; 0: one of each point, linear between them */
    uint32_t reserved;    /* 0 */
} trc_curve_attribute;

/* A UV map without values. */
TRC_API trc_curve_attribute trc_curve_attribute_default(void);

typedef struct trc_curves_desc {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t key_count;   /* motion keys, 1..TRC_MAX_KEYS, evenly spaced over [0, 1] */
    uint32_t shape;       /* TRC_CURVE_* */
    uint32_t piece_count; /* 1..TRC_MAX_CURVE_PIECES: straight pieces between two points of the
                             Catmull-Rom spline, whose first and last points stand for those beyond
                             the ends, too */
    uint64_t point_count; /* of all strands, one strand after the other */
    const float *points;  /* 4 * point_count * key_count: x, y, z, radius in metres (below 0: 0) */
    uint64_t point_value_count; /* number of floats, checked */
    const uint32_t *lengths;    /* points of each strand: they sum up to point_count, strands of
                                   fewer than two are left out; NULL for balls */
    uint64_t strand_count;      /* number of lengths */
    const float *generated;     /* Generated coordinates, 3 floats for each strand (or ball), the
                                   same at all keys; NULL: where a ray meets them, in the space of
                                   the object, as in Cycles */
    uint64_t generated_count;   /* number of floats, checked */
    const trc_curve_attribute *attributes; /* the default UV map is the first of width 2 that is one
                                              of each strand; balls have none */
    uint32_t attribute_count;              /* 0..TRC_MAX_ATTRIBUTES */
    float tolerance; /* how far pieces may be from the spline at the first key, in radii: then
                        there are fewer where it bends little; 0: piece_count everywhere */
} trc_curves_desc;

/* One key of no points, ribbons of 4 pieces at most, within a tenth of the radius. */
TRC_API trc_curves_desc trc_curves_desc_default(void);

/* Copies curves into the scene. Pieces that are not finite or beyond 1.8e18 at some key are skipped
 * and counted as triangles are (trc_scene_stats); those of radius 0 at some key at both ends are
 * skipped. Instances whose transform flattens them are hidden. Hits tell pieces for triangles, in
 * the order of points; u goes along a piece, v across it from -1 to 1 (trc_hits). They are no
 * lights, however they shine, and displacement does not move them. Renders let no ray meet again
 * the strand that it left; queries know of no strand that a ray left. Cost: 16 bytes for each
 * piece's end and key, which the tree has once more. INVALID_ARGUMENT, TOO_LARGE (of 4 * ends *
 * key_count floats there can be 2^31) or OUT_OF_MEMORY. */
TRC_API trc_status trc_curves_create(trc_scene scene, const trc_curves_desc *desc,
                                     trc_id *mesh_out);

/* Other places and radii of the same strands: a pose, as trc_mesh_update. points: as in the
 * descriptor. INVALID_ARGUMENT for a mesh that is not of curves. */
TRC_API trc_status trc_curves_update(trc_scene scene, trc_id mesh, uint32_t key_count,
                                     const float *points, uint64_t point_value_count);

TRC_END_DECLS

#endif
