/* The committed scene: everything that kernels read, immutable once published.
 *
 * Built by commit (scene/commit.c), reference-counted, kept alive by renders and queries. What did
 * not change between two commits is shared between their snapshots. No pointers back to the
 * editable scene. */
#ifndef TRACER_MODEL_SNAPSHOT_H
#define TRACER_MODEL_SNAPSHOT_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "tracer/tracer.h"

struct trc_bvh;         /* bvh/bvh.h */
struct trc_material;    /* model/material.h */
struct trc_light_table; /* shading/lights.h */
struct trc_image;       /* image/image.h */

/* One attribute per triangle corner; of curves, per vertex. */
struct trc_attribute {
    uint32_t name;           /* index of the name in the snapshot's name table (trc_names) */
    uint32_t width;          /* 2 or 4 */
    float *values;           /* width * 3 * triangle_count; curves: width * vertex_count */
    const uint32_t *strands; /* of the mesh */
    uint32_t piece_end;      /* from a piece's first vertex to its other: 1, balls 0 */
};

/* What the primitives of a mesh are. */
enum trc_mesh_shape {
    TRC_SHAPE_TRIANGLES = 0,
    TRC_SHAPE_RIBBONS,
    TRC_SHAPE_ROUND,
    TRC_SHAPE_BALLS,       /* which count once for a shadow ray, lit as round ones */
    TRC_SHAPE_HOLLOW_BALLS /* which count where it comes in and goes out, lit as ellipsoids */
};

static inline bool trc_shape_is_balls(uint32_t shape) { return shape >= TRC_SHAPE_BALLS; }

/* Geometry of a mesh, shared and immutable; refs counts the holders.
 *
 * Of curves the vertices are the ends of straight pieces, and what is said of triangles is of
 * pieces: their corners are those of trc_mesh_corners, and attributes are one of each vertex. */
struct trc_mesh {
    atomic_uint refs;
    uint32_t key_count;
    uint32_t vertex_count, triangle_count;
    float *positions;      /* 3 * vertex_count * key_count, and one unset beyond: f4_load3_padded */
    uint32_t *indices;     /* 3 * triangle_count; curves: NULL */
    uint32_t shape;        /* TRC_SHAPE_* */
    uint32_t *strands;     /* curves: of each piece, numbered as they have vertices; balls: 0; else
                              NULL */
    float *radii;          /* curves: vertex_count * key_count */
    float *vertex_normals; /* 3 * vertex_count * key_count or NULL */
    float *corner_normals; /* 9 * triangle_count * key_count or NULL; rules over vertex_normals */
    uint8_t *smooth;       /* per triangle, or NULL: none smooth (corner normals: all) */
    uint16_t *material_index; /* per triangle, or NULL: all 0 */
    uint32_t attribute_count;
    const struct trc_attribute *attributes; /* attribute_count, or NULL */
    float *generated;                       /* 3 * vertex_count or NULL */
    const float *rest;  /* positions before displacement, of as many keys; NULL: not displaced */
    int32_t default_uv; /* index of the attribute that is the default UV map, or -1 */
    float bounds_lower[3],
        bounds_upper[3]; /* object space, all keys: Generated coordinates use key 0 */
};

/* Vertices of a triangle's corners; of a piece of a curve its ends, of a ball its middle, with the
 * first for the third: barycentrics (u, 0) are along it. */
static inline void trc_mesh_corners(const struct trc_mesh *mesh, uint32_t triangle,
                                    uint32_t corners_out[3]) {
    if (!mesh->strands) {
        const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
        for (int k = 0; k < 3; k++)
            corners_out[k] = index[k];
        return;
    }
    corners_out[0] = corners_out[2] = triangle + mesh->strands[triangle];
    corners_out[1] = corners_out[0] + !trc_shape_is_balls(mesh->shape);
}

/* Whether a piece of a curve is the first, or the last, of its strand. */
static inline bool trc_piece_is_first(const struct trc_mesh *mesh, uint32_t piece) {
    return piece == 0 || mesh->strands[piece - 1] != mesh->strands[piece];
}
static inline bool trc_piece_is_last(const struct trc_mesh *mesh, uint32_t piece) {
    return piece + 1 == mesh->triangle_count || mesh->strands[piece + 1] != mesh->strands[piece];
}

/* Coordinates beyond this, or not finite, take their triangles out of the scene: sums and
 * differences of what remains stay far from overflow, and so do the squares in a triangle test
 * (1.8e18^2 = 3.2e36). */
#define TRC_MAX_COORDINATE 1.8e18f

/* Whether all three coordinates are finite and within the limit. */
static inline int trc_point_is_valid(const float p[3]) {
    const float m = TRC_MAX_COORDINATE; /* a NaN fails every comparison */
    return p[0] >= -m && p[0] <= m && p[1] >= -m && p[1] <= m && p[2] >= -m && p[2] <= m;
}

/* A 3x4 matrix, rows. */
#define TRC_AFFINE_FLOATS 12
struct trc_affine {
    float m[TRC_AFFINE_FLOATS];
};

/* Visibility beside TRC_VISIBLE_*. Unblocked rays find the light that would be there if nothing but
 * shadow catchers could be in its way (kernels/tile/catcher.c). */
enum {
    TRC_VISIBLE_UNBLOCKED = 1 << 5, /* of such rays, of shadow catchers, of lights they find */
    TRC_VISIBLE_EMITTER = 1 << 6,   /* of what has a shadow class: kernels/tile/linked.c */
    TRC_VISIBLE_SOLID = 1 << 7,     /* of what hides those from some, whatever blocks them */
    TRC_UNBLOCKED_SHIFT = 8, /* shadow catchers have their TRC_VISIBLE_* here once more, so that one
                                test of a traversal tells which unblocked rays meet them */
    TRC_SHADOW_CLASS_SHIFT = 16 /* from here on, by shadow class - 1: what blocks such lights */
};

/* Cosine below which shadow rays of most instances begin to start from the curved surface. */
#define TRC_TERMINATOR_COSINE 0.1f

struct trc_instance {
    uint32_t mesh; /* into snapshot meshes */
    uint32_t key_count;
    const struct trc_affine *object_to_world; /* key_count */
    const struct trc_affine *world_to_object; /* key_count, inverse of each key; of one that
                                                 has none see trc_affine_invert_thin */
    uint32_t visibility;                      /* TRC_VISIBLE_*; of catchers more, see above */
    uint32_t material_count;                  /* >= 1 */
    const uint32_t *materials;                /* into snapshot materials, per slot */
    uint32_t value_count;
    const float *values; /* for TRC_OP_INSTANCE_VALUES */
    int32_t pass_index;
    float random;
    float color[4];
    float cryptomatte_object, cryptomatte_asset;
    uint32_t light_group;           /* of its emission, from 1 on; 0: none */
    uint32_t light_set, shadow_set; /* as trc_instance_desc has them */
    uint32_t shadow_class;          /* of its emission: trc_snapshot.shadow_classes */
    uint64_t light_exclude;         /* as trc_instance_desc has it */
    float terminator_cosine; /* shadow_terminator_geometry, TRC_TERMINATOR_COSINE by default */
    float terminator_turn; /* of shadow_terminator_shading: the factor on the angle of light to the
                              normal at which lobes reflect it; 1 by default */
    float ao_distance;     /* 0: the world's */
    uint32_t first_light;  /* first emissive-triangle light of this instance or UINT32_MAX */
    uint8_t flips;         /* 1: negative determinant at key 0 */
    uint8_t keeps_shape;   /* 1: displacement moves no vertices */
    uint8_t world_normals; /* 1: TRC_INSTANCE_WORLD_NORMALS, and that is seen */
    uint8_t is_identity;   /* 1: one key, which changes no point */
    uint8_t is_thin;       /* 1: some key's transform is (scene/affine.h) */
    uint8_t in_world;      /* 1: rays meet a tree of its own in world space */
};

/* Entries of trc_camera.shutter_cdf_inverse. */
#define TRC_SHUTTER_ENTRIES 256

/* Of a panorama, as trc_camera_desc has it. */
struct trc_panorama {
    float longitude[2], latitude[2], height[2]; /* at the lower and at the upper end */
    float angle, lens, sensor[2], polynomial[5];
};

/* Of spherical stereo, as trc_camera_desc has it. */
struct trc_stereo {
    float eye_offset, convergence_distance, pole_merge_from, pole_merge_to;
};

struct trc_camera {
    uint32_t type;
    uint32_t key_count;
    struct trc_affine *camera_to_world;   /* key_count, axes of unit length */
    float (*windows)[4];                  /* key_count: left, right, bottom, top */
    struct trc_affine world_to_camera[3]; /* at the start, middle and end of the shutter */
    float axes_volume; /* the smallest of all keys' (scene/affine.h); 1: nothing is sheared */
    float clip_start, clip_end;
    float aperture_radius, focus_distance, blade_rotation, aperture_ratio;
    uint32_t blade_count;
    float *shutter_cdf_inverse; /* TRC_SHUTTER_ENTRIES times, or NULL: identity */
    uint32_t has_motion;        /* shutter open: rays carry a time */
    float row_delay;
    struct trc_panorama panorama;
    struct trc_stereo stereo;
};

static inline bool trc_is_panorama(const struct trc_camera *camera) {
    return camera->type >= TRC_CAMERA_EQUIRECTANGULAR;
}

struct trc_world {
    uint32_t material; /* into snapshot materials, or UINT32_MAX: black */
    uint32_t visibility;
    uint32_t is_constant; /* radiance below rules, no program */
    float radiance[3];
    float ao_distance, ao_factor;
    uint32_t ao_method; /* TRC_AO_* */
    uint32_t light_group;
};

struct trc_snapshot {
    atomic_uint refs;
    uint32_t features;     /* TRC_FEATURE_* */
    uint32_t branch_count; /* rays that a hit sends on at most, if all lobes are followed; >= 1 */
    uint32_t mesh_count, instance_count, material_count, image_count;
    struct trc_mesh **meshes;
    struct trc_instance *instances;
    struct trc_material **materials; /* [0] is the default material */
    struct trc_image **images;
    const struct trc_bvh *bvh;      /* what rays are traced against; never NULL, may be empty */
    struct trc_light_table *lights; /* never NULL */
    struct trc_camera camera;
    uint32_t has_camera;
    struct trc_world world;
    /* The values of shadow_exclude, by shadow class - 1; class 0: everything blocks. */
    uint64_t shadow_classes[TRC_MAX_SHADOW_CLASSES];
    uint32_t shadow_class_count;
    trc_scene_stats stats;
};

/* 0 also for a set that there was no class left for. */
static inline uint32_t trc_shadow_class_of(const struct trc_snapshot *s, uint64_t excluded) {
    for (uint32_t i = 0; excluded && i < s->shadow_class_count; i++)
        if (s->shadow_classes[i] == excluded)
            return i + 1;
    return 0;
}

/* Position of an instance's transform at a time. Formula of every interpolation in the library:
 * a + f * (b - a), so that what stands still keeps its bits beside what never had keys. Bounds
 * built from keys contain what lies between up to rounding, which kernels/trace/beam.h allows for.
 */
static inline void trc_key_at(float time, uint32_t key_count, uint32_t *key, float *f) {
    if (key_count < 2) {
        *key = 0;
        *f = 0.0f;
        return;
    }
    const float x = (time > 0.0f ? (time < 1.0f ? time : 1.0f) : 0.0f) * (float)(key_count - 1);
    uint32_t k = (uint32_t)x;
    if (k > key_count - 2)
        k = key_count - 2;
    *key = k;
    *f = x - (float)k;
}

#endif
