/* Meshes made by rule, for tests and the benchmark: shapes with known hard spots.
 *
 * Object space, any unit. Shapes that say "closed" share the vertices of neighbouring triangles,
 * have no T-junctions and no holes: every ray that starts inside meets them. Nothing here depends
 * on the platform but the last bits of sinf and cosf. */
#ifndef TRACER_TESTS_MESHES_H
#define TRACER_TESTS_MESHES_H

#include <stdint.h>

#include "rng.h"

/* Owned arrays. Shapes are appended while there is one key; keys come last. */
struct mesh {
    float *positions;  /* 3 * vertex_count * key_count, key after key */
    uint32_t *indices; /* 3 * triangle_count */
    uint32_t vertex_count, triangle_count, key_count;
    uint32_t vertex_capacity, triangle_capacity;
};

/* An empty mesh of one key; also a valid argument for mesh_free. */
void mesh_init(struct mesh *mesh);
/* Frees the arrays and leaves an empty mesh. */
void mesh_free(struct mesh *mesh);

/* ---- elements ---- */

uint32_t mesh_add_vertex(struct mesh *mesh, float x, float y, float z);
void mesh_add_triangle(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c);
/* Two triangles: a b c and a c d. */
void mesh_add_quad(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d);
/* The vertices and triangles of another mesh, key 0. */
void mesh_append(struct mesh *mesh, const struct mesh *other);
/* Applies a 3x4 matrix (rows) to the vertices from first on, key 0. */
void mesh_transform(struct mesh *mesh, uint32_t first, const float transform[12]);

/* ---- motion ---- */

/* key_count copies of the positions, which were of one key. */
void mesh_set_keys(struct mesh *mesh, uint32_t key_count);
/* Positions of a key: 3 * vertex_count floats. */
float *mesh_key(const struct mesh *mesh, uint32_t key);
/* The positions of a key become the transformed ones of key 0. */
void mesh_key_transform(struct mesh *mesh, uint32_t key, const float transform[12]);

/* ---- closed shapes; normals point outwards ---- */

/* Twelve triangles. */
void mesh_add_box(struct mesh *mesh, const float lower[3], const float upper[3]);
/* 2 * slices * (stacks - 1) triangles; poles on z; stacks >= 2, slices >= 3. */
void mesh_add_uv_sphere(struct mesh *mesh, const float center[3], float radius, uint32_t stacks,
                        uint32_t slices);
/* 20 * 4^levels triangles. */
void mesh_add_icosphere(struct mesh *mesh, const float center[3], float radius, uint32_t levels);
/* Two apexes at z = -height and height over a ring of count vertices at the given rising angles:
 * 2 * count triangles. The apexes have valence count. */
void mesh_add_bipyramid(struct mesh *mesh, const float *angles, uint32_t count, float radius,
                        float height);
/* The same with count vertices evenly spaced. */
void mesh_add_even_bipyramid(struct mesh *mesh, uint32_t count, float radius, float height);
/* A bipyramid of 2 * count slices in which every second one is a needle, width 1 / aspect of its
 * length. */
void mesh_add_needle_fan(struct mesh *mesh, uint32_t count, float radius, float aspect);

/* ---- open shapes ---- */

/* columns x rows squares, split along one diagonal, on the parallelogram of two edges: no
 * T-junctions. Vertices are at origin + edge_u * (i / columns) + edge_v * (j / rows). */
void mesh_add_grid(struct mesh *mesh, const float origin[3], const float edge_u[3],
                   const float edge_v[3], uint32_t columns, uint32_t rows);
/* count unconnected triangles: centres in the box, corners within size of them. */
void mesh_add_soup(struct mesh *mesh, struct rng *rng, uint32_t count, const float lower[3],
                   const float upper[3], float size);
/* count strips of two triangles about the origin in any direction: parallelograms of that length
 * and at most that width. */
void mesh_add_strips(struct mesh *mesh, struct rng *rng, uint32_t count, float length, float width);

/* Bounds over all keys; lower > upper for a mesh without vertices. */
void mesh_bounds(const struct mesh *mesh, float lower[3], float upper[3]);

#endif
