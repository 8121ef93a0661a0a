/* Meshes and their instances. See base.h for units, ownership and errors. */
#ifndef TRACER_GEOMETRY_H
#define TRACER_GEOMETRY_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

/* Most motion keys of one object, and most UV maps or colour attributes of one mesh. */
#define TRC_MAX_KEYS 33
#define TRC_MAX_ATTRIBUTES 64

enum trc_normals_layout { TRC_NORMALS_NONE = 0, TRC_NORMALS_VERTEX = 1, TRC_NORMALS_CORNER = 2 };

/* A named array with one value per triangle corner, in triangle order. */
typedef struct trc_corner_attribute {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t width;   /* floats per corner: 2 (UV map) or 4 (colour, scene-linear RGBA; tangents) */
    const char *name; /* UTF-8, up to 63 bytes; not NULL */
    const float *values;  /* width * 3 * triangle_count floats */
    uint64_t value_count; /* number of floats, checked */
} trc_corner_attribute;

/* A UV map without values. */
TRC_API trc_corner_attribute trc_corner_attribute_default(void);

/* Where the new vertices of a diced mesh lie. */
enum trc_dicing_surface {
    TRC_DICING_LINEAR = 0, /* on the given triangles */
    TRC_DICING_CURVED = 1, /* on a surface through the given vertices, curved by their normals */
    TRC_DICING_CATMULL_CLARK = 2 /* on the limit of Catmull-Clark subdivision of the faces */
};

/* In what the length of an edge is measured. */
enum trc_dicing_space {
    TRC_DICING_OBJECT = 0,   /* of the object */
    TRC_DICING_PARALLEL = 1, /* of the camera */
    TRC_DICING_CENTRAL = 2   /* of the camera, divided by the distance from it */
};

/* Subdivision of a mesh when it is created, by how large its edges are to a camera. An edge that is
 * longer than the diagonal of a square of the given side is split in two, whatever triangles it
 * belongs to, so that no crack opens; so are its halves, until none is too long. Displacement then
 * moves the new vertices. */
typedef struct trc_dicing_desc {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t surface; /* TRC_DICING_*, enum trc_dicing_surface. As in Cycles, UV maps and colours
                         are interpolated linearly in all; CATMULL_CLARK rounds the corners of
                         open boundaries */
    uint32_t space;   /* TRC_DICING_*, enum trc_dicing_space */
    uint32_t max_subdivisions;  /* 0..16 halvings of an edge; CATMULL_CLARK takes one at least */
    uint32_t sharp_corners;     /* 0 or 1: with CATMULL_CLARK, a vertex of a single face stays */
    float side;                 /* > 0: metres, or their ratio to the distance for CENTRAL */
    float object_to_camera[12]; /* see base.h; not read for OBJECT */
    /* left, right, bottom, top of what the camera shows, at distance 1 for CENTRAL; left = right:
     * it shows all directions. Not read for OBJECT. */
    float window[4];
    float offscreen_scale; /* >= 1: side grows by the factor 1 + d (offscreen_scale - 1) for an edge
                              outside of the window's frustum, by d metres, for PARALLEL by d halves
                              of the window's sides (their root mean square) */
    uint64_t triangle_max; /* a pass that may make more is not begun, and the next commit warns;
                              0: 2^25 */
    const uint32_t *faces; /* the face of each triangle, those of one side by side; NULL: each is
                              one by itself. Read for CATMULL_CLARK alone */
    uint64_t face_count;   /* number of elements of faces, checked */
    /* Creases, for CATMULL_CLARK alone. A sharpness, 0 or more, is the number of levels of
     * subdivision that an edge or vertex is sharp for, a fraction of one in part; from 10 on, for
     * all. */
    const uint32_t *crease_edges;  /* the two vertices of each crease, in either order; where they
                                      share no edge of a face, it is none; of an edge named twice
                                      the first counts */
    uint64_t crease_edge_count;    /* number of elements of crease_edges: 2 * crease_count */
    const float *crease_sharpness; /* of each crease */
    uint64_t crease_count; /* number of elements of crease_sharpness; 0: no edge is creased */
    const float *vertex_sharpness;   /* of each vertex; NULL: 0 */
    uint64_t vertex_sharpness_count; /* number of elements of vertex_sharpness, checked */
} trc_dicing_desc;

/* Linear, of a side of 1 metre in the object's space, 12 subdivisions at most, an offscreen_scale
 * of 1. */
TRC_API trc_dicing_desc trc_dicing_desc_default(void);

typedef struct trc_mesh_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t key_count;      /* motion keys, 1..TRC_MAX_KEYS, evenly spaced over [0, 1] */
    uint64_t vertex_count;   /* 3 * vertex_count * key_count < 2^31 */
    uint64_t triangle_count; /* 3 * triangle_count < 2^31; may be 0 */
    const float *positions;  /* 3 * vertex_count * key_count floats, key after key */
    uint64_t position_count; /* number of floats, checked */
    const uint32_t *indices; /* 3 * triangle_count */
    uint64_t index_count;    /* number of indices, checked */
    const float *normals;    /* unit normals or NULL: then smooth triangles get angle-weighted
                                vertex normals; layout by normal_kind, key after key as positions */
    uint64_t
        normal_count; /* number of floats: 3 * (vertex_count | 3 * triangle_count) * key_count */
    uint32_t normal_kind;           /* TRC_NORMALS_* */
    uint32_t attribute_count;       /* 0..TRC_MAX_ATTRIBUTES */
    const uint8_t *smooth;          /* per triangle, 0 flat, 1 smooth; NULL: all flat, unless
                                       normal_kind is CORNER, which rules by itself */
    const uint16_t *material_index; /* per triangle slot number, NULL: all 0 */
    const trc_corner_attribute *attributes; /* the first of width 2 is the default UV map */
    const float *generated; /* Generated coordinates of each vertex, 3 floats, the same at all keys
                               and in all poses; NULL: the bounding box is the unit cube */
    uint64_t generated_count;      /* number of floats, checked */
    const trc_dicing_desc *dicing; /* NULL: the mesh stays as it is. A diced mesh takes no
                                      trc_mesh_update; its normals are computed, but for those of
                                      vertices for LINEAR, which are interpolated; with CORNER, all
                                      of it is smooth */
} trc_mesh_desc;

/* One key of no vertices and no triangles, all flat. */
TRC_API trc_mesh_desc trc_mesh_desc_default(void);

/* Copies a mesh into the scene. Triangles with a vertex that is not finite or beyond 1.8e18 at any
 * key are skipped and counted (trc_scene_stats); an index out of range refuses the mesh, naming it.
 * Cost: one copy; building happens at commit. */
TRC_API trc_status trc_mesh_create(trc_scene scene, const trc_mesh_desc *desc, trc_id *mesh_out);

/* New positions (and, if the mesh had any, normals) for the same topology: a pose. Counts as in the
 * descriptor; the number of keys may differ from before. At commit the BVH is refitted. When its
 * SAH cost has grown too far, a final scene rebuilds it at once; another builds it in a thread of
 * its own, and a later commit that finds it ready takes it. Hits are the same either way. */
TRC_API trc_status trc_mesh_update(trc_scene scene, trc_id mesh, uint32_t key_count,
                                   const float *positions, uint64_t position_count,
                                   const float *normals, uint64_t normal_count);

/* Frees a mesh; snapshots that hold it keep it until they end. INVALID_ARGUMENT while an instance
 * uses it. */
TRC_API trc_status trc_mesh_destroy(trc_scene scene, trc_id mesh);

/* Which rays see an instance or a light. Shadow rays are those of light samples; samples of the
 * world that stand for what Cycles finds by rays of lobes are blocked by what these see: of even
 * worlds all, of others a part by the densities of both. */
enum trc_visible_rays {
    TRC_VISIBLE_CAMERA = 1,
    TRC_VISIBLE_DIFFUSE = 2,
    TRC_VISIBLE_GLOSSY = 4,
    TRC_VISIBLE_TRANSMISSION = 8,
    TRC_VISIBLE_SHADOW = 16,
    TRC_VISIBLE_ALL = 31
};

/* A shadow catcher stands for something of the footage behind the picture. Where the camera sees
 * it, also through what is transparent, it does not show itself: TRC_PASS_COMBINED is covered by
 * the part of its light that other instances take from it, and TRC_PASS_SHADOW_CATCHER has that
 * light by channel. Other rays meet it as any instance. Emission of instances that are none does
 * not light it as footage. */
enum trc_instance_flags {
    TRC_INSTANCE_SHADOW_CATCHER = 1,
    TRC_INSTANCE_KEEPS_SHAPE = 2, /* displacement moves no vertices, as of hair */
    /* Normals are made unit in world space before they are interpolated, as Cycles has them of what
     * it moves to world space; else after. Both are one of what is scaled evenly, and of what moves
     * they are always those of after. */
    TRC_INSTANCE_WORLD_NORMALS = 4
};

#define TRC_MAX_INSTANCE_VALUES 256

/* Different values of shadow_exclude beside 0, of instances and lights of one scene; what has one
 * of more is blocked by everything, and a warning says so. */
#define TRC_MAX_SHADOW_CLASSES 15

typedef struct trc_instance_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t key_count;      /* transforms, 1..TRC_MAX_KEYS, evenly spaced over [0, 1] */
    trc_id mesh;             /* of the same scene */
    const float *transforms; /* 12 floats per key, see base.h; what they flatten is shown flat;
                                where all keys make it a line or a point, or one is not finite, the
                                instance is hidden and counted in trc_scene_stats */
    const trc_id *materials; /* material of each slot; 0: the default grey diffuse, in Cryptomatte's
                                materials "default_surface" as in Cycles */
    uint32_t material_count; /* a triangle's slot beyond the last uses the last; 0: default */
    uint32_t visibility;     /* TRC_VISIBLE_* */
    int32_t pass_index;      /* Object Index pass */
    float random;            /* Object Info's Random, finite; in Blender [0, 1) */
    float color[4];          /* Object Info's Color and Alpha */
    float cryptomatte_object, cryptomatte_asset; /* trc_cryptomatte_id of its name and of its
                                                    asset's name; 0: in no matte */
    uint32_t light_group;                        /* of its emission, 0..TRC_MAX_LIGHT_GROUPS */
    uint32_t flags;                              /* TRC_INSTANCE_* */
    float ao_distance;    /* in place of that of trc_world_desc for TRC_AO_REPLACE, >= 0; 0: not */
    uint32_t value_count; /* 0..TRC_MAX_INSTANCE_VALUES */
    const float *values;  /* for TRC_NODE_INSTANCE_VALUES */
    uint32_t light_set;   /* 0..63: its bit in the light_exclude of what does not light it */
    uint32_t shadow_set;  /* 0..63: its bit in the shadow_exclude of what shines through it. What
                             is opaque and of set 0 hides such lights from reflected and
                             refracted rays all the same, as in Cycles */
    uint64_t light_exclude;  /* as an emitter: 1 << light_set of those that it does not light, as in
                                trc_light_desc. The camera sees its emission all the same */
    uint64_t shadow_exclude; /* as an emitter: 1 << shadow_set of those that do not block it */
    /* Where light grazes smooth triangles, shadow rays start from the curved surface that the
     * normals describe. geometry: cosine to either normal below which they begin to, 0 (not at all)
     * to 1. shading: 0 (none) to 1, takes light from reflecting lobes on the last part of the way
     * to where it would graze. */
    float shadow_terminator_geometry, shadow_terminator_shading;
} trc_instance_desc;

/* Of no mesh yet: at the origin, unscaled, the default material, visible to all rays, white, a
 * shadow_terminator_geometry of 0.1. */
TRC_API trc_instance_desc trc_instance_desc_default(void);

/* Places a mesh in the scene from the next commit on. INVALID_HANDLE for a mesh or a material that
 * the scene does not have, INVALID_ARGUMENT for a value out of range; transforms are judged at
 * commit. */
TRC_API trc_status trc_instance_create(trc_scene scene, const trc_instance_desc *desc,
                                       trc_id *instance_out);

/* Replaces all that is known of an instance; errors as for create. What stays equal costs nothing
 * at commit. */
TRC_API trc_status trc_instance_update(trc_scene scene, trc_id instance,
                                       const trc_instance_desc *desc);

/* Replaces the transforms of so many instances, which keep their number of keys, and nothing else:
 * 12 floats for each key of each instance, key by key. Takes no memory. Of an instance named twice
 * the last counts. All or nothing: INVALID_HANDLE for one that the scene does not have,
 * INVALID_ARGUMENT for one of other than key_count keys, or where float_count is not
 * 12 * key_count * instance_count. */
TRC_API trc_status trc_instances_move(trc_scene scene, const trc_id *instances,
                                      uint64_t instance_count, uint32_t key_count,
                                      const float *transforms, uint64_t float_count);

/* Takes an instance out of the scene from the next commit on; its mesh and materials stay. */
TRC_API trc_status trc_instance_destroy(trc_scene scene, trc_id instance);

TRC_END_DECLS

#endif
