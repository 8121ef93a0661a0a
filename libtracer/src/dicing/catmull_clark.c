#include "dicing/catmull_clark.h"

#include "core/checks.h"
#include "core/core.h"
#include "dicing/refined_mesh.h"
#include "dicing/rings.h"

/* ---- rows of floats ---- */

static void add(float *to, const float *from, float weight, size_t width) {
    for (size_t i = 0; i < width; i++)
        to[i] += weight * from[i];
}

static float *vertex(const struct trc_faces *f, size_t index) {
    return f->vertices + index * f->vertex_width;
}

static float *corner(const struct trc_faces *f, size_t index) {
    return f->corners + index * f->corner_width;
}

/* ---- one level ---- */

/* New vertices: the former, then one of each edge, then one of each face. */
static void place_face_points(const struct trc_faces *f, const struct trc_rings *r,
                              const struct trc_faces *to) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        const uint32_t begin = f->begin[face], end = f->begin[face + 1];
        float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = begin; c < end; c++)
            add(point, vertex(f, f->indices[c]), 1.0f / (float)(end - begin), f->vertex_width);
    }
}

/* Smooth: a quarter of both ends and of the points of both faces. On a crease: the middle. */
static void place_edge_points(const struct trc_faces *f, const struct trc_rings *r,
                              const struct trc_faces *to) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        const float weight = 0.25f + 0.25f * trc_edge_rule(r, e);
        for (size_t k = 0; k < 2; k++)
            add(vertex(to, f->vertex_count + e), vertex(f, r->ends[2 * e + k]), weight, width);
    }
    for (uint32_t face = 0; face < f->face_count; face++) {
        const float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t e = r->edges[c];
            const float weight = 0.25f - 0.25f * trc_edge_rule(r, e);
            if (weight > 0.0f)
                add(vertex(to, (size_t)f->vertex_count + e), point, weight, width);
        }
    }
}

/* Smooth, with n faces: their points and twice the middles of the edges over n^2, and the vertex
 * times (n - 3) / n. On a crease: 3/4, and 1/8 of both neighbours along it. */
static void place_vertex_points(const struct trc_faces *f, const struct trc_rings *r,
                                const struct trc_faces *to) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        for (size_t k = 0; k < 2; k++) {
            const uint32_t own = r->ends[2 * e + k], other = r->ends[2 * e + 1 - k];
            const struct trc_vertex_rule *rule = &r->rules[own];
            const float n = (float)r->rings[own].face_count;
            if (rule->smooth > 0.0f) {
                add(vertex(to, own), vertex(f, own), rule->smooth / (n * n), width);
                add(vertex(to, own), vertex(f, other), rule->smooth / (n * n), width);
            }
            if (trc_is_along_crease(r, rule, e))
                add(vertex(to, own), vertex(f, other), 0.125f * rule->crease, width);
        }
    }
    for (uint32_t face = 0; face < f->face_count; face++) {
        const float *point = vertex(to, (size_t)f->vertex_count + r->edge_count + face);
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const struct trc_vertex_rule *rule = &r->rules[f->indices[c]];
            const float n = (float)r->rings[f->indices[c]].face_count;
            if (rule->smooth > 0.0f)
                add(vertex(to, f->indices[c]), point, rule->smooth / (n * n), width);
        }
    }
    for (uint32_t v = 0; v < f->vertex_count; v++) {
        const struct trc_vertex_rule *rule = &r->rules[v];
        const float n = (float)r->rings[v].face_count;
        float weight = 1.0f - rule->smooth - 0.25f * rule->crease;
        if (rule->smooth > 0.0f)
            weight += rule->smooth * (n - 3.0f) / n;
        add(vertex(to, v), vertex(f, v), weight, width);
    }
}

static void cut_face(const struct trc_faces *f, const struct trc_rings *r, uint32_t face,
                     const struct trc_faces *to) {
    const size_t width = f->corner_width;
    const uint32_t begin = f->begin[face], end = f->begin[face + 1];
    for (uint32_t c = begin; c < end; c++) {
        const uint32_t next = trc_next_corner(f, face, c),
                       previous = trc_previous_corner(f, face, c);
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
        if (f->edge_sharpness) { /* its inner edges are smooth */
            to->edge_sharpness[4 * (size_t)c] = trc_sharpness_after(f->edge_sharpness[c]);
            to->edge_sharpness[4 * (size_t)c + 3] =
                trc_sharpness_after(f->edge_sharpness[previous]);
        }
    }
}

/* Room for one level more, all 0. */
static trc_status create_level(const struct trc_faces *f, const struct trc_rings *r,
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
        .sharp_corners = f->sharp_corners,
        .begin = trc_alloc(corners + 1, sizeof *to->begin),
        .indices = trc_alloc(4 * corners, sizeof *to->indices),
        .vertices = trc_alloc_zeroed(vertices * f->vertex_width, sizeof *to->vertices),
        .corners = trc_alloc_zeroed(4 * corners * f->corner_width, sizeof *to->corners),
        .material_index = trc_alloc(corners, sizeof *to->material_index),
        .smooth = trc_alloc(corners, 1),
        .edge_sharpness =
            f->edge_sharpness ? trc_alloc_zeroed(4 * corners, sizeof *to->edge_sharpness) : NULL,
        .vertex_sharpness =
            f->vertex_sharpness ? trc_alloc_zeroed(vertices, sizeof *to->vertex_sharpness) : NULL,
    };
    const bool enough = to->begin && to->indices && to->vertices && to->corners &&
                        to->material_index && to->smooth &&
                        (to->edge_sharpness || !f->edge_sharpness) &&
                        (to->vertex_sharpness || !f->vertex_sharpness);
    return enough ? TRC_OK : trc_no_memory_to_dice();
}

trc_status trc_catmull_clark_subdivide(struct trc_faces *f) {
    struct trc_rings r;
    struct trc_faces to = {.vertex_count = 0};
    trc_status status = trc_rings_find(f, &r);
    if (status == TRC_OK)
        status = create_level(f, &r, &to);
    if (status == TRC_OK) {
        place_face_points(f, &r, &to);
        place_edge_points(f, &r, &to);
        place_vertex_points(f, &r, &to);
        for (uint32_t face = 0; face < f->face_count; face++)
            cut_face(f, &r, face, &to);
        to.begin[to.face_count] = 4 * to.face_count;
        for (uint32_t v = 0; to.vertex_sharpness && v < f->vertex_count; v++)
            to.vertex_sharpness[v] = trc_sharpness_after(f->vertex_sharpness[v]);
        trc_faces_free(f);
        *f = to;
    } else {
        trc_faces_free(&to);
    }
    trc_rings_free(&r);
    return status;
}

/* ---- the limit ---- */

/* Smooth, with n faces: n^2 times itself, 4 times its neighbours and once the vertices opposite of
 * it, over n (n + 5). On a crease: 2/3, and 1/6 of both neighbours along it. */
static void sum_limit(const struct trc_faces *f, const struct trc_rings *r, float *sums) {
    const size_t width = f->vertex_width;
    for (size_t e = 0; e < r->edge_count; e++) {
        for (size_t k = 0; k < 2; k++) {
            const uint32_t own = r->ends[2 * e + k];
            const float *other = vertex(f, r->ends[2 * e + 1 - k]);
            const struct trc_vertex_rule *rule = &r->rules[own];
            const float n = (float)r->rings[own].face_count;
            if (rule->smooth > 0.0f)
                add(sums + own * width, other, rule->smooth * 4.0f / (n * (n + 5.0f)), width);
            if (trc_is_along_crease(r, rule, e))
                add(sums + own * width, other, rule->crease / 6.0f, width);
        }
    }
    for (uint32_t c = 0; c < 4 * f->face_count; c++) {
        const uint32_t own = f->indices[c];
        const struct trc_vertex_rule *rule = &r->rules[own];
        const float n = (float)r->rings[own].face_count;
        if (rule->smooth > 0.0f) /* two corners on, of four */
            add(sums + own * width, vertex(f, f->indices[c ^ 2]), rule->smooth / (n * (n + 5.0f)),
                width);
    }
}

trc_status trc_catmull_clark_limit(struct trc_faces *f) {
    struct trc_rings r;
    trc_status status = trc_rings_find(f, &r);
    float *sums = trc_alloc_zeroed(f->vertex_count * f->vertex_width, sizeof *sums);
    if (status == TRC_OK && !sums)
        status = trc_no_memory_to_dice();
    if (status == TRC_OK) {
        sum_limit(f, &r, sums);
        for (uint32_t v = 0; v < f->vertex_count; v++) {
            const struct trc_vertex_rule *rule = &r.rules[v];
            const float n = (float)r.rings[v].face_count;
            const float own = 1.0f - rule->smooth * 5.0f / (n + 5.0f) - rule->crease / 3.0f;
            float *row = vertex(f, v);
            for (size_t i = 0; i < f->vertex_width; i++)
                row[i] = own * row[i] + sums[v * f->vertex_width + i];
        }
    }
    trc_free(sums);
    trc_rings_free(&r);
    return status;
}
