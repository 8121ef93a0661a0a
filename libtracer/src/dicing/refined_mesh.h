/* The mesh under way: rows of vertices, and lists of triangles. */
#ifndef TRACER_DICING_REFINED_MESH_H
#define TRACER_DICING_REFINED_MESH_H

#include <stdbool.h>

#include "dicing/rows.h"

/* Triangles one after another, each with three corners. */
struct trc_triangle_list {
    size_t count, capacity;
    uint32_t *indices;
    float *corners; /* rows */
    uint16_t *material_index;
    uint8_t *smooth;
};

struct trc_refined_mesh {
    struct trc_row_layout rows;
    size_t vertex_count, vertex_capacity;
    float *vertices;               /* rows */
    struct trc_triangle_list done; /* final */
    struct trc_triangle_list open; /* may have to be split */
    struct trc_triangle_list next; /* pieces of what is open */
    bool is_coarse;                /* it would have had too many triangles */
};

void trc_refined_mesh_free(struct trc_refined_mesh *mesh);

/* Room for so many more; OUT_OF_MEMORY, or TOO_LARGE where the mesh would be. */
trc_status trc_reserve_triangles(struct trc_triangle_list *list, size_t more, size_t corner_width);
trc_status trc_reserve_vertices(struct trc_refined_mesh *mesh, size_t more);

static inline float *trc_refined_row(const struct trc_refined_mesh *mesh, size_t vertex) {
    return mesh->vertices + vertex * mesh->rows.vertex_width;
}

/* The descriptor's, or what makes some 2 GB of a mesh and as much again of its BVH. */
uint64_t trc_triangle_max(const struct trc_refined_mesh *mesh);

/* Vertex normals of the open triangles, each weighted by its angle there. */
void trc_compute_vertex_normals(struct trc_refined_mesh *mesh);

/* A vertex has none from here on. */
void trc_forget_normals(struct trc_refined_mesh *mesh, size_t vertex);

trc_status trc_no_memory_to_dice(void);

#endif
