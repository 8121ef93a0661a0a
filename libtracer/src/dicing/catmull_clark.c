#include "dicing/catmull_clark.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/edge_table.h"

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the subdivision of a mesh");
}

void trc_faces_free(struct trc_faces *faces) {
    trc_free(faces->begin);
    trc_free(faces->indices);
    trc_free(faces->vertices);
    trc_free(faces->corners);
    trc_free(faces->material_index);
    trc_free(faces->smooth);
    *faces = (struct trc_faces){.vertex_count = 0};
}

/* ---- what lies around the vertices ---- */

/* Edges with two faces are inner ones; all others are boundaries. */
struct rings {
    uint32_t edge_count;
    uint32_t *edges;      /* of the corners, the edge to the next one */
    uint32_t *ends;       /* both of each edge */
    uint32_t *uses;       /* faces of each edge */
    uint32_t *valence;    /* faces of each vertex */
    uint32_t *boundaries; /* boundary edges of each vertex */
};

static void free_rings(struct rings *r) {
    trc_free(r->edges);
    trc_free(r->ends);
    trc_free(r->uses);
    trc_free(r->valence);
    trc_free(r->boundaries);
}

static uint32_t next_corner(const struct trc_faces *f, uint32_t face, uint32_t corner) {
    return corner + 1 == f->begin[face + 1] ? f->begin[face] : corner + 1;
}

static uint32_t previous_corner(const struct trc_faces *f, uint32_t face, uint32_t corner) {
    return corner == f->begin[face] ? f->begin[face + 1] - 1 : corner - 1;
}

static void number_edges(const struct trc_faces *f, struct trc_edge_table *table, struct rings *r) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t a = f->indices[c], b = f->indices[next_corner(f, face, c)];
            const uint32_t edge = trc_edge_table_take(table, a, b, r->edge_count);
            if (edge == r->edge_count) {
                r->ends[2 * (size_t)edge] = a;
                r->ends[2 * (size_t)edge + 1] = b;
                r->uses[edge] = 0;
                r->edge_count++;
            }
            r->edges[c] = edge;
            r->uses[edge]++;
            r->valence[a]++;
        }
    }
    for (size_t e = 0; e < r->edge_count; e++) {
        if (r->uses[e] != 2) {
            r->boundaries[r->ends[2 * e]]++;
            r->boundaries[r->ends[2 * e + 1]]++;
        }
    }
}

static trc_status find_rings(const struct trc_faces *f, struct rings *r) {
    const size_t corners = f->begin[f->face_count];
    *r = (struct rings){
        .edges = trc_alloc(corners, sizeof *r->edges),
        .ends = trc_alloc(2 * corners, sizeof *r->ends),
        .uses = trc_alloc(corners, sizeof *r->uses),
        .valence = trc_alloc_zeroed(f->vertex_count, sizeof *r->valence),
        .boundaries = trc_alloc_zeroed(f->vertex_count, sizeof *r->boundaries),
    };
    struct trc_edge_table table;
    const bool enough = trc_edge_table_create(&table, corners) && r->edges && r->ends && r->uses &&
                        r->valence && r->boundaries;
    if (enough)
        number_edges(f, &table, r);
    trc_edge_table_free(&table);
    return enough ? TRC_OK : no_memory();
}

/* Vertices of a smooth boundary have two neighbours along it. */
static bool is_smooth_boundary(const struct rings *r, uint32_t vertex, bool sharp_corners) {
    return r->boundaries[vertex] == 2 && !(sharp_corners && r->valence[vertex] == 1);
}

/* ---- rows of floats ---- */

static void add(float *to, const float *from, float weight, size_t width) {
    for (size_t i = 0; i < width; i++)
        to[i] += weight * from[i];
}

static void blend(float *to, float own, const float *from, float weight, size_t width) {
    for (size_t i = 0; i < width; i++)
        to[i] = own * to[i] + weight * from[i];
}

static float *vertex(const struct trc_faces *f, size_t index) {
    return f->vertices + index * f->vertex_width;
}

static float *corner(const struct trc_faces *f, size_t index) {
    return f->corners + index * f->corner_width;
}

/* ---- one level ---- */

/* New vertices: the former, then one of each edge, then one of each face. */
static void place_face_points(const struct trc_faces *f, const struct rings *r,
                              const struct trc_faces *to) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        const uint32_t begin = f->begin[face], end = f->begin[face + 1];
        float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = begin; c < end; c++)
            add(point, vertex(f, f->indices[c]), 1.0f / (float)(end - begin), f->vertex_width);
    }
}

static void place_edge_points(const struct trc_faces *f, const struct rings *r,
                              const struct trc_faces *to) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        const float weight = r->uses[e] == 2 ? 0.25f : 0.5f;
        for (size_t k = 0; k < 2; k++)
            add(vertex(to, f->vertex_count + e), vertex(f, r->ends[2 * e + k]), weight, width);
    }
    for (uint32_t face = 0; face < f->face_count; face++) {
        const float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t e = r->edges[c];
            if (r->uses[e] == 2)
                add(vertex(to, (size_t)f->vertex_count + e), point, 0.25f, width);
        }
    }
}

/* Of inner vertices of n faces: their points and twice the middles of the edges over n^2, and the
 * vertex times (n - 3) / n. */
static void place_vertex_points(const struct trc_faces *f, const struct rings *r,
                                const struct trc_faces *to, bool sharp_corners) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        for (size_t k = 0; k < 2; k++) {
            const uint32_t own = r->ends[2 * e + k], other = r->ends[2 * e + 1 - k];
            if (!r->boundaries[own]) {
                add(vertex(to, own), vertex(f, own), 1.0f, width);
                add(vertex(to, own), vertex(f, other), 1.0f, width);
            } else if (r->uses[e] != 2 && is_smooth_boundary(r, own, sharp_corners)) {
                add(vertex(to, own), vertex(f, other), 0.125f, width);
            }
        }
    }
    for (uint32_t face = 0; face < f->face_count; face++) {
        const float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++)
            if (!r->boundaries[f->indices[c]])
                add(vertex(to, f->indices[c]), point, 1.0f, width);
    }
    for (uint32_t v = 0; v < f->vertex_count; v++) {
        const float n = (float)r->valence[v];
        if (r->boundaries[v]) {
            const float weight = is_smooth_boundary(r, v, sharp_corners) ? 0.75f : 1.0f;
            add(vertex(to, v), vertex(f, v), weight, width);
        } else if (r->valence[v]) {
            blend(vertex(to, v), 1.0f / (n * n), vertex(f, v), (n - 3.0f) / n, width);
        } else {
            memcpy(vertex(to, v), vertex(f, v), width * sizeof(float));
        }
    }
}

static void cut_face(const struct trc_faces *f, const struct rings *r, uint32_t face,
                     const struct trc_faces *to) {
    const size_t width = f->corner_width;
    const uint32_t begin = f->begin[face], end = f->begin[face + 1];
    for (uint32_t c = begin; c < end; c++) {
        const uint32_t next = next_corner(f, face, c), previous = previous_corner(f, face, c);
        uint32_t *quad = to->indices + 4 * (size_t)c;
        quad[0] = f->indices[c];
        quad[1] = f->vertex_count + r->edges[c];
        quad[2] = f->vertex_count + r->edge_count + face;
        quad[3] = f->vertex_count + r->edges[previous];
        to->begin[c] = 4 * c;
        to->material_index[c] = f->material_index[face];
        to->smooth[c] = f->smooth[face];
        float *values = corner(to, 4 * (size_t)c);
        add(values, corner(f, c), 1.0f, width);
        add(values + width, corner(f, c), 0.5f, width);
        add(values + width, corner(f, next), 0.5f, width);
        for (uint32_t k = begin; k < end; k++)
            add(values + 2 * width, corner(f, k), 1.0f / (float)(end - begin), width);
        add(values + 3 * width, corner(f, c), 0.5f, width);
        add(values + 3 * width, corner(f, previous), 0.5f, width);
    }
}

/* Room for one level more, all 0. */
static trc_status create_level(const struct trc_faces *f, const struct rings *r,
                               struct trc_faces *to) {
    const uint64_t corners = f->begin[f->face_count];
    const uint64_t vertices = (uint64_t)f->vertex_count + r->edge_count + f->face_count;
    if (4 * corners > INT32_MAX || vertices > INT32_MAX)
        return trc_fail(TRC_ERROR_TOO_LARGE, "the mesh has too many faces to subdivide");
    *to = (struct trc_faces){
        .vertex_width = f->vertex_width,
        .corner_width = f->corner_width,
        .vertex_count = (uint32_t)vertices,
        .face_count = (uint32_t)corners,
        .begin = trc_alloc(corners + 1, sizeof *to->begin),
        .indices = trc_alloc(4 * corners, sizeof *to->indices),
        .vertices = trc_alloc_zeroed(vertices * f->vertex_width, sizeof *to->vertices),
        .corners = trc_alloc_zeroed(4 * corners * f->corner_width, sizeof *to->corners),
        .material_index = trc_alloc(corners, sizeof *to->material_index),
        .smooth = trc_alloc(corners, 1),
    };
    const bool enough =
        to->begin && to->indices && to->vertices && to->corners && to->material_index && to->smooth;
    return enough ? TRC_OK : no_memory();
}

trc_status trc_catmull_clark_subdivide(struct trc_faces *f, bool sharp_corners) {
    struct rings r;
    struct trc_faces to = {.vertex_count = 0};
    trc_status status = find_rings(f, &r);
    if (status == TRC_OK)
        status = create_level(f, &r, &to);
    if (status == TRC_OK) {
        place_face_points(f, &r, &to);
        place_edge_points(f, &r, &to);
        place_vertex_points(f, &r, &to, sharp_corners);
        for (uint32_t face = 0; face < f->face_count; face++)
            cut_face(f, &r, face, &to);
        to.begin[to.face_count] = 4 * to.face_count;
        trc_faces_free(f);
        *f = to;
    } else {
        trc_faces_free(&to);
    }
    free_rings(&r);
    return status;
}

/* ---- the limit ---- */

/* Of inner vertices of n faces: n^2 times itself, 4 times its neighbours and once the vertices
 * opposite of it, over n (n + 5). */
static void sum_limit(const struct trc_faces *f, const struct rings *r, bool sharp_corners,
                      float *sums) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        for (size_t k = 0; k < 2; k++) {
            const uint32_t own = r->ends[2 * e + k];
            const float *other = vertex(f, r->ends[2 * e + 1 - k]);
            const float n = (float)r->valence[own];
            if (!r->boundaries[own])
                add(sums + own * width, other, 4.0f / (n * (n + 5.0f)), width);
            else if (r->uses[e] != 2 && is_smooth_boundary(r, own, sharp_corners))
                add(sums + own * width, other, 1.0f / 6.0f, width);
        }
    }
    for (uint32_t c = 0; c < 4 * f->face_count; c++) {
        const uint32_t own = f->indices[c];
        const float n = (float)r->valence[own];
        if (!r->boundaries[own]) /* two corners on, of four */
            add(sums + own * width, vertex(f, f->indices[c ^ 2]), 1.0f / (n * (n + 5.0f)), width);
    }
}

trc_status trc_catmull_clark_limit(struct trc_faces *f, bool sharp_corners) {
    struct rings r;
    trc_status status = find_rings(f, &r);
    float *sums = trc_alloc_zeroed(f->vertex_count * f->vertex_width, sizeof *sums);
    if (status == TRC_OK && !sums)
        status = no_memory();
    if (status == TRC_OK) {
        sum_limit(f, &r, sharp_corners, sums);
        for (uint32_t v = 0; v < f->vertex_count; v++) {
            const float n = (float)r.valence[v];
            float own = r.valence[v] ? n / (n + 5.0f) : 1.0f;
            if (r.boundaries[v])
                own = is_smooth_boundary(&r, v, sharp_corners) ? 2.0f / 3.0f : 1.0f;
            blend(vertex(f, v), own, sums + v * f->vertex_width, 1.0f, f->vertex_width);
        }
    }
    trc_free(sums);
    free_rings(&r);
    return status;
}
