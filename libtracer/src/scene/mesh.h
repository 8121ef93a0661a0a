/* Meshes of a scene: copies of what the caller described, immutable once a snapshot holds them. A
 * new pose is a new trc_mesh that shares the topology of the former. */
#ifndef TRACER_SCENE_MESH_H
#define TRACER_SCENE_MESH_H

#include <stdbool.h>

#include "model/names.h"
#include "model/snapshot.h"

struct trc_pool; /* core/pool.h */

/* Copies a descriptor whose counts and pointers are checked (api/geometry.c). Indices are checked
 * here. Keys that are all equal become one. Normals that are not finite or zero are replaced, so
 * that stored ones are finite and not zero. INVALID_ARGUMENT, TOO_LARGE or OUT_OF_MEMORY. */
trc_status trc_geometry_create(const trc_mesh_desc *desc, struct trc_names *names,
                               struct trc_mesh **mesh_out);

/* Another pose of the same topology; the arrays are checked and laid out as in the descriptor. */
trc_status trc_geometry_pose(const struct trc_mesh *from, uint32_t key_count,
                             const float *positions, const float *normals,
                             struct trc_mesh **mesh_out);

/* The same mesh with other positions, of as many keys; its normals are those of from. Generated
 * coordinates stay. Holds from. OUT_OF_MEMORY. */
trc_status trc_geometry_displace(struct trc_mesh *from, const float *positions,
                                 struct trc_mesh **mesh_out);

/* What normals the caller gave: TRC_NORMALS_*. */
uint32_t trc_geometry_normal_kind(const struct trc_mesh *mesh);

/* NULL is fine. */
struct trc_mesh *trc_geometry_retain(struct trc_mesh *mesh);
void trc_geometry_release(struct trc_mesh *mesh);

/* Bytes of the mesh's arrays, topology included. */
uint64_t trc_geometry_bytes(const struct trc_mesh *mesh);

/* Computes angle-weighted vertex normals if smooth triangles lack them (scene/normals.c): the last
 * step before a snapshot may hold the mesh. Angles weight as in Thuermer and Wuethrich, "Computing
 * vertex normals from polygonal facets", 1998. All triangles at a vertex count, flat ones too, as
 * in Blender. Deterministic for any number of threads. OUT_OF_MEMORY or CANCELLED. */
trc_status trc_geometry_finish(struct trc_mesh *mesh, struct trc_pool *pool,
                               const atomic_uint *cancel);

/* Unit normals of all vertices at the first key, whether the mesh is shaded with them or not; the
 * caller frees them. OUT_OF_MEMORY or CANCELLED. */
trc_status trc_geometry_vertex_normals(const struct trc_mesh *mesh, struct trc_pool *pool,
                                       const atomic_uint *cancel, float **normals_out);

/* ---- shared by scene/mesh.c, scene/normals.c and scene/curves.c ---- */

/* What all poses of a mesh have in common. */
struct trc_mesh_topology {
    atomic_uint refs;
    uint32_t normal_kind; /* what the caller gives, TRC_NORMALS_* */
    uint32_t *indices;
    uint8_t *smooth;
    uint16_t *material_index;
    float *generated;
    struct trc_attribute *attributes; /* attribute_count, or NULL */
    uint32_t attribute_count;
    int32_t default_uv; /* index of an attribute, or -1 */
    /* Corners (3 * triangle + corner) of each vertex, made when normals are first needed:
     * corners[corner_begin[v]] to corners[corner_begin[v + 1]]. */
    uint32_t *corner_begin, *corners;
    /* Curves, see model/snapshot.h. */
    uint32_t *strands;
    uint32_t *lengths; /* points of each strand, or NULL: balls */
    uint8_t *cuts;     /* pieces from each point of a strand to the next */
    uint32_t strand_count, point_count;
    uint32_t shape; /* TRC_SHAPE_* */
    uint64_t bytes;
};

struct trc_geometry {
    struct trc_mesh mesh; /* first: a trc_mesh is a trc_geometry */
    struct trc_mesh_topology *topology;
    struct trc_mesh *from; /* what it was before displacement, held, or NULL */
};

/* NULL is fine. */
void trc_topology_release(struct trc_mesh_topology *topology);

/* A copy of count elements, or NULL in *copy_out for none. False when out of memory. */
bool trc_topology_copy(struct trc_mesh_topology *topology, const void *source, uint64_t count,
                       size_t size, void *copy_out);

/* Room for so many attributes, of which there is none yet. OUT_OF_MEMORY. */
trc_status trc_topology_expect_attributes(struct trc_mesh_topology *topology, uint32_t count);

/* A mesh of that topology, whose reference it takes over, on failure too; its positions are not
 * set. OUT_OF_MEMORY. */
trc_status trc_geometry_alloc(struct trc_mesh_topology *topology, uint32_t vertex_count,
                              uint32_t triangle_count, uint32_t key_count,
                              struct trc_mesh **mesh_out);

/* Sets the bounds by the positions. */
void trc_geometry_bound(struct trc_mesh *mesh);

/* A NaN coordinate would reach integer conversions in texture lookups: what is not finite becomes
 * 0. */
void trc_clear_bad_values(float *values, uint64_t count);

/* A direction for a vertex whose triangles give none: away from the object's origin, as Blender. */
void trc_normal_fallback(const float position[3], float normal_out[3]);

#endif
