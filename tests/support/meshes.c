#include "meshes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"

#define PI 3.14159265f

void mesh_init(struct mesh *mesh) { *mesh = (struct mesh){.key_count = 1}; }

void mesh_free(struct mesh *mesh) {
    free(mesh->positions);
    free(mesh->indices);
    mesh_init(mesh);
}

/* ---- elements ---- */

uint32_t mesh_add_vertex(struct mesh *mesh, float x, float y, float z) {
    const size_t bytes = 3 * sizeof(float);
    if (mesh->vertex_count == mesh->vertex_capacity) {
        mesh->vertex_capacity = mesh->vertex_capacity ? 2 * mesh->vertex_capacity : 64;
        mesh->positions =
            buffer_grow(mesh->positions, mesh->vertex_count * bytes, mesh->vertex_capacity, bytes);
    }
    float *p = mesh->positions + 3 * (size_t)mesh->vertex_count;
    p[0] = x;
    p[1] = y;
    p[2] = z;
    return mesh->vertex_count++;
}

void mesh_add_triangle(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c) {
    const size_t bytes = 3 * sizeof(uint32_t);
    if (mesh->triangle_count == mesh->triangle_capacity) {
        mesh->triangle_capacity = mesh->triangle_capacity ? 2 * mesh->triangle_capacity : 64;
        mesh->indices = buffer_grow(mesh->indices, mesh->triangle_count * bytes,
                                    mesh->triangle_capacity, bytes);
    }
    uint32_t *index = mesh->indices + 3 * (size_t)mesh->triangle_count++;
    index[0] = a;
    index[1] = b;
    index[2] = c;
}

void mesh_add_quad(struct mesh *mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
    mesh_add_triangle(mesh, a, b, c);
    mesh_add_triangle(mesh, a, c, d);
}

void mesh_append(struct mesh *mesh, const struct mesh *other) {
    const uint32_t first = mesh->vertex_count;
    for (uint32_t i = 0; i < other->vertex_count; i++) {
        const float *p = other->positions + 3 * (size_t)i;
        mesh_add_vertex(mesh, p[0], p[1], p[2]);
    }
    for (uint32_t i = 0; i < other->triangle_count; i++) {
        const uint32_t *index = other->indices + 3 * (size_t)i;
        mesh_add_triangle(mesh, first + index[0], first + index[1], first + index[2]);
    }
}

static void point_transform(const float m[12], const float p[3], float out[3]) {
    const float x = p[0], y = p[1], z = p[2];
    for (int i = 0; i < 3; i++)
        out[i] = m[4 * i] * x + m[4 * i + 1] * y + m[4 * i + 2] * z + m[4 * i + 3];
}

void mesh_transform(struct mesh *mesh, uint32_t first, const float transform[12]) {
    for (uint32_t i = first; i < mesh->vertex_count; i++) {
        float *p = mesh->positions + 3 * (size_t)i;
        point_transform(transform, p, p);
    }
}

/* ---- motion ---- */

void mesh_set_keys(struct mesh *mesh, uint32_t key_count) {
    const size_t per_key = 3 * (size_t)mesh->vertex_count;
    mesh->positions =
        buffer_grow(mesh->positions, per_key * sizeof(float), per_key * key_count, sizeof(float));
    for (uint32_t key = 1; key < key_count; key++)
        memcpy(mesh->positions + per_key * key, mesh->positions, per_key * sizeof(float));
    mesh->key_count = key_count;
    mesh->vertex_capacity = mesh->vertex_count;
}

float *mesh_key(const struct mesh *mesh, uint32_t key) {
    return mesh->positions + 3 * (size_t)mesh->vertex_count * key;
}

void mesh_key_transform(struct mesh *mesh, uint32_t key, const float transform[12]) {
    for (uint32_t i = 0; i < mesh->vertex_count; i++)
        point_transform(transform, mesh->positions + 3 * (size_t)i,
                        mesh_key(mesh, key) + 3 * (size_t)i);
}

/* ---- closed shapes ---- */

void mesh_add_box(struct mesh *mesh, const float lower[3], const float upper[3]) {
    const uint32_t first = mesh->vertex_count;
    static const uint8_t faces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (int i = 0; i < 8; i++)
        mesh_add_vertex(mesh, (i & 1 ? upper : lower)[0], (i & 2 ? upper : lower)[1],
                        (i & 4 ? upper : lower)[2]);
    for (int i = 0; i < 6; i++)
        mesh_add_quad(mesh, first + faces[i][0], first + faces[i][1], first + faces[i][2],
                      first + faces[i][3]);
}

void mesh_add_uv_sphere(struct mesh *mesh, const float center[3], float radius, uint32_t stacks,
                        uint32_t slices) {
    const uint32_t south = mesh_add_vertex(mesh, center[0], center[1], center[2] - radius);
    for (uint32_t j = 1; j < stacks; j++)
        for (uint32_t i = 0; i < slices; i++) {
            const float polar = PI * (float)j / (float)stacks;
            const float turn = 2.0f * PI * (float)i / (float)slices;
            const float r = radius * sinf(polar);
            mesh_add_vertex(mesh, center[0] + r * cosf(turn), center[1] + r * sinf(turn),
                            center[2] - radius * cosf(polar));
        }
    const uint32_t north = mesh_add_vertex(mesh, center[0], center[1], center[2] + radius);
    const uint32_t ring = south + 1, last = ring + (stacks - 2) * slices;
    for (uint32_t i = 0; i < slices; i++) {
        const uint32_t k = (i + 1) % slices;
        mesh_add_triangle(mesh, south, ring + k, ring + i);
        for (uint32_t j = 0; j + 2 < stacks; j++) {
            const uint32_t low = ring + j * slices, high = low + slices;
            mesh_add_quad(mesh, low + i, low + k, high + k, high + i);
        }
        mesh_add_triangle(mesh, last + i, last + k, north);
    }
}

/* Middles of edges by their two ends, each made once: a table with open addressing. */
struct middles {
    uint64_t *keys; /* 0: free, else the ends + 1 */
    uint32_t *values;
    uint32_t mask;
};

static uint32_t middle_of(struct middles *m, struct mesh *mesh, uint32_t a, uint32_t b) {
    const uint64_t key = ((uint64_t)(a < b ? a : b) << 32 | (a < b ? b : a)) + 1;
    uint32_t at = (uint32_t)((key * 0x9e3779b97f4a7c15ull) >> 32) & m->mask;
    while (m->keys[at] && m->keys[at] != key)
        at = (at + 1) & m->mask;
    if (!m->keys[at]) {
        const float *p = mesh->positions + 3 * (size_t)a, *q = mesh->positions + 3 * (size_t)b;
        const float x = p[0] + q[0], y = p[1] + q[1], z = p[2] + q[2];
        const float s = 1.0f / sqrtf(x * x + y * y + z * z);
        m->keys[at] = key;
        m->values[at] = mesh_add_vertex(mesh, x * s, y * s, z * s);
    }
    return m->values[at];
}

/* Each triangle becomes four; new vertices go to the unit sphere. */
static void subdivide(struct mesh *mesh) {
    struct middles m = {.mask = 1};
    const uint32_t count = mesh->triangle_count;
    while (m.mask < 6 * count)
        m.mask = 2 * m.mask + 1;
    m.keys = buffer_alloc((size_t)m.mask + 1, sizeof *m.keys);
    m.values = buffer_alloc((size_t)m.mask + 1, sizeof *m.values);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t v[3], e[3];
        memcpy(v, mesh->indices + 3 * (size_t)i, sizeof v);
        for (int k = 0; k < 3; k++)
            e[k] = middle_of(&m, mesh, v[k], v[(k + 1) % 3]);
        for (int k = 0; k < 3; k++)
            mesh_add_triangle(mesh, v[k], e[k], e[(k + 2) % 3]);
        memcpy(mesh->indices + 3 * (size_t)i, e, sizeof e);
    }
    free(m.keys);
    free(m.values);
}

void mesh_add_icosphere(struct mesh *mesh, const float center[3], float radius, uint32_t levels) {
    static const uint8_t faces[20][3] = {
        {0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
        {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
        {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    const float s = 0.525731112f, l = 0.850650808f; /* of a unit icosahedron */
    const float corners[12][3] = {{-s, l, 0}, {s, l, 0}, {-s, -l, 0}, {s, -l, 0},
                                  {0, -s, l}, {0, s, l}, {0, -s, -l}, {0, s, -l},
                                  {l, 0, -s}, {l, 0, s}, {-l, 0, -s}, {-l, 0, s}};
    struct mesh sphere;
    mesh_init(&sphere);
    for (int i = 0; i < 12; i++)
        mesh_add_vertex(&sphere, corners[i][0], corners[i][1], corners[i][2]);
    for (int i = 0; i < 20; i++)
        mesh_add_triangle(&sphere, faces[i][0], faces[i][1], faces[i][2]);
    for (uint32_t i = 0; i < levels; i++)
        subdivide(&sphere);
    const float place[12] = {radius, 0,         0, center[0], 0,      radius,
                             0,      center[1], 0, 0,         radius, center[2]};
    mesh_transform(&sphere, 0, place);
    mesh_append(mesh, &sphere);
    mesh_free(&sphere);
}

void mesh_add_bipyramid(struct mesh *mesh, const float *angles, uint32_t count, float radius,
                        float height) {
    const uint32_t south = mesh_add_vertex(mesh, 0.0f, 0.0f, -height);
    const uint32_t north = mesh_add_vertex(mesh, 0.0f, 0.0f, height);
    for (uint32_t i = 0; i < count; i++)
        mesh_add_vertex(mesh, radius * cosf(angles[i]), radius * sinf(angles[i]), 0.0f);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t a = north + 1 + i, b = north + 1 + (i + 1) % count;
        mesh_add_triangle(mesh, a, b, north);
        mesh_add_triangle(mesh, b, a, south);
    }
}

void mesh_add_even_bipyramid(struct mesh *mesh, uint32_t count, float radius, float height) {
    float *angles = buffer_alloc(count, sizeof *angles);
    for (uint32_t i = 0; i < count; i++)
        angles[i] = 2.0f * PI * (float)i / (float)count;
    mesh_add_bipyramid(mesh, angles, count, radius, height);
    free(angles);
}

void mesh_add_needle_fan(struct mesh *mesh, uint32_t count, float radius, float aspect) {
    float *angles = buffer_alloc(2 * (size_t)count, sizeof *angles);
    for (uint32_t i = 0; i < count; i++) {
        angles[2 * i] = 2.0f * PI * (float)i / (float)count;
        angles[2 * i + 1] = angles[2 * i] + 1.4142136f / aspect; /* slant length: radius * sqrt 2 */
    }
    mesh_add_bipyramid(mesh, angles, 2 * count, radius, radius);
    free(angles);
}

/* ---- open shapes ---- */

void mesh_add_grid(struct mesh *mesh, const float origin[3], const float edge_u[3],
                   const float edge_v[3], uint32_t columns, uint32_t rows) {
    const uint32_t first = mesh->vertex_count, stride = columns + 1;
    for (uint32_t j = 0; j <= rows; j++)
        for (uint32_t i = 0; i <= columns; i++) {
            const float u = (float)i / (float)columns, v = (float)j / (float)rows;
            mesh_add_vertex(mesh, origin[0] + edge_u[0] * u + edge_v[0] * v,
                            origin[1] + edge_u[1] * u + edge_v[1] * v,
                            origin[2] + edge_u[2] * u + edge_v[2] * v);
        }
    for (uint32_t j = 0; j < rows; j++)
        for (uint32_t i = 0; i < columns; i++) {
            const uint32_t a = first + j * stride + i;
            mesh_add_quad(mesh, a, a + 1, a + stride + 1, a + stride);
        }
}

void mesh_add_soup(struct mesh *mesh, struct rng *rng, uint32_t count, const float lower[3],
                   const float upper[3], float size) {
    for (uint32_t i = 0; i < count; i++) {
        float center[3];
        for (int axis = 0; axis < 3; axis++)
            center[axis] = rng_range(rng, lower[axis], upper[axis]);
        const uint32_t first = mesh->vertex_count;
        for (int corner = 0; corner < 3; corner++) {
            const float x = center[0] + rng_range(rng, -size, size);
            const float y = center[1] + rng_range(rng, -size, size);
            const float z = center[2] + rng_range(rng, -size, size);
            mesh_add_vertex(mesh, x, y, z);
        }
        mesh_add_triangle(mesh, first, first + 1, first + 2);
    }
}

void mesh_add_strips(struct mesh *mesh, struct rng *rng, uint32_t count, float length,
                     float width) {
    for (uint32_t i = 0; i < count; i++) {
        float corner[3], along[3], aside[3];
        rng_direction(rng, along);
        rng_direction(rng, aside);
        for (int axis = 0; axis < 3; axis++) {
            along[axis] *= length;
            aside[axis] *= width;
            corner[axis] = -0.5f * (along[axis] + aside[axis]);
        }
        mesh_add_grid(mesh, corner, along, aside, 1, 1);
    }
}

void mesh_bounds(const struct mesh *mesh, float lower[3], float upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = INFINITY;
        upper[axis] = -INFINITY;
    }
    for (size_t i = 0; i < (size_t)mesh->vertex_count * mesh->key_count; i++)
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = fminf(lower[axis], mesh->positions[3 * i + (size_t)axis]);
            upper[axis] = fmaxf(upper[axis], mesh->positions[3 * i + (size_t)axis]);
        }
}
