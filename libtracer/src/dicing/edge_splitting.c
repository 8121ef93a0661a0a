#include "dicing/edge_splitting.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/edge_table.h"
#include "dicing/rate.h"
#include "dicing/vector.h"

/* The unit normal at one end of an edge; where there is none, that of the other end mirrored. */
static void normal_at_end(const float own[3], const float other[3], const float along[3],
                          float square, float normal[3]) {
    const bool is_known = trc_dot(own, own) > 0.0f;
    const float turn = 2.0f * trc_dot(along, other) / square;
    for (int i = 0; i < 3; i++)
        normal[i] = is_known ? own[i] : other[i] - turn * along[i];
}

/* The middle of a cubic and the normal there, as in A. Vlachos, J. Peters, C. Boyd, J. Mitchell,
 * "Curved PN triangles", 2001: both are an edge's own. middle is the mean of both ends. */
static void curve_middle(const float a[3], const float b[3], const float normal_a[3],
                         const float normal_b[3], float middle[3], float normal[3]) {
    float along[3], at_a[3], at_b[3], sum[3];
    for (int i = 0; i < 3; i++)
        along[i] = b[i] - a[i];
    const float square = trc_dot(along, along);
    if (!(square > 0.0f))
        return;
    normal_at_end(normal_a, normal_b, along, square, at_a);
    normal_at_end(normal_b, normal_a, along, square, at_b);
    for (int i = 0; i < 3; i++)
        sum[i] = at_a[i] + at_b[i];
    const float rise_a = trc_dot(along, at_a), rise_b = -trc_dot(along, at_b);
    const float turn = 2.0f * trc_dot(along, sum) / square;
    float turned[3];
    for (int i = 0; i < 3; i++) {
        middle[i] -= 0.125f * (rise_a * at_a[i] + rise_b * at_b[i]);
        turned[i] = sum[i] - turn * along[i];
    }
    const float size = trc_length(turned);
    for (int i = 0; i < 3 && size > 0.0f; i++)
        normal[i] = turned[i] / size;
}

/* The row of the middle of an edge. */
static void place_middle(const struct trc_refined_mesh *mesh, uint32_t a, uint32_t b,
                         uint32_t middle) {
    const float *of_a = trc_refined_row(mesh, a), *of_b = trc_refined_row(mesh, b);
    float *to = trc_refined_row(mesh, middle);
    for (size_t i = 0; i < mesh->rows.vertex_width; i++)
        to[i] = 0.5f * (of_a[i] + of_b[i]);
    if (mesh->rows.how->surface == TRC_DICING_LINEAR)
        return;
    for (size_t k = 0; k < 3 * mesh->rows.key_count; k += 3) {
        const size_t n = mesh->rows.normals + k;
        curve_middle(of_a + k, of_b + k, of_a + n, of_b + n, to + k, to + n);
    }
}

/* Bit k: the edge from corner k to the next one is too long. Both triangles of an edge agree. */
static uint32_t split_mask(const struct trc_refined_mesh *mesh, const uint32_t v[3]) {
    uint32_t mask = 0;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t a = v[k], b = v[(k + 1) % 3];
        const bool is_split =
            trc_edge_is_too_long(mesh->rows.how, trc_refined_row(mesh, a < b ? a : b),
                                 trc_refined_row(mesh, a < b ? b : a));
        mask |= (uint32_t)is_split << k;
    }
    return mask;
}

/* A triangle with its corners, 0 to 2, and the middles of its edges, from 3 on. */
struct cut {
    const struct trc_triangle_list *from;
    size_t triangle;
    uint32_t vertices[6];
};

static void copy_triangle(struct trc_triangle_list *to, const struct trc_triangle_list *from,
                          size_t triangle, size_t corner_width) {
    const size_t values = 3 * corner_width;
    memcpy(to->indices + 3 * to->count, from->indices + 3 * triangle, 3 * sizeof *to->indices);
    if (values)
        memcpy(to->corners + values * to->count, from->corners + values * triangle,
               values * sizeof(float));
    to->material_index[to->count] = from->material_index[triangle];
    to->smooth[to->count++] = from->smooth[triangle];
}

static void put_piece(struct trc_triangle_list *to, const struct cut *cut, const uint32_t points[3],
                      size_t corner_width) {
    const float *from = cut->from->corners + 3 * corner_width * cut->triangle;
    for (size_t k = 0; k < 3; k++) {
        const uint32_t point = points[k];
        const size_t one = point % 3, other = point < 3 ? one : (one + 1) % 3;
        float *values = to->corners + corner_width * (3 * to->count + k);
        to->indices[3 * to->count + k] = cut->vertices[point];
        for (size_t i = 0; i < corner_width; i++)
            values[i] = 0.5f * (from[corner_width * one + i] + from[corner_width * other + i]);
    }
    to->material_index[to->count] = cut->from->material_index[cut->triangle];
    to->smooth[to->count++] = cut->from->smooth[cut->triangle];
}

static float square_distance(const struct trc_refined_mesh *mesh, uint32_t a, uint32_t b) {
    const float *p = trc_refined_row(mesh, a), *q = trc_refined_row(mesh, b);
    const float along[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    return trc_dot(along, along);
}

/* Puts the two to four pieces of a triangle with split edges; a quadrilateral is cut along its
 * shorter diagonal. */
static void put_pieces(struct trc_refined_mesh *mesh, const struct cut *cut, uint32_t mask) {
    struct trc_triangle_list *to = &mesh->next;
    const size_t width = mesh->rows.corner_width;
    if (mask == 7) {
        static const uint32_t pieces[4][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}};
        for (int i = 0; i < 4; i++)
            put_piece(to, cut, pieces[i], width);
        return;
    }
    const bool is_single = (mask & (mask - 1)) == 0;
    /* Turned so that edge 0 is the only one split, or edge 2 the only one that is not. */
    const uint32_t turn = is_single ? (mask == 1   ? 0
                                       : mask == 2 ? 1
                                                   : 2)
                                    : (mask == 3   ? 0
                                       : mask == 6 ? 1
                                                   : 2);
    const uint32_t a = turn, b = (turn + 1) % 3, c = (turn + 2) % 3, ab = 3 + a, bc = 3 + b;
    if (is_single) {
        put_piece(to, cut, (const uint32_t[3]){a, ab, c}, width);
        put_piece(to, cut, (const uint32_t[3]){ab, b, c}, width);
        return;
    }
    put_piece(to, cut, (const uint32_t[3]){ab, b, bc}, width);
    const uint32_t *v = cut->vertices;
    if (square_distance(mesh, v[a], v[bc]) < square_distance(mesh, v[ab], v[c])) {
        put_piece(to, cut, (const uint32_t[3]){a, ab, bc}, width);
        put_piece(to, cut, (const uint32_t[3]){a, bc, c}, width);
    } else {
        put_piece(to, cut, (const uint32_t[3]){a, ab, c}, width);
        put_piece(to, cut, (const uint32_t[3]){ab, bc, c}, width);
    }
}

static uint32_t count_bits(uint32_t mask) { return (mask & 1) + (mask >> 1 & 1) + (mask >> 2); }

/* Splits the open triangles by their masks; what needs no split is done. */
static void split_open(struct trc_refined_mesh *mesh, const uint8_t *masks,
                       struct trc_edge_table *table) {
    for (size_t t = 0; t < mesh->open.count; t++) {
        if (!masks[t]) {
            copy_triangle(&mesh->done, &mesh->open, t, mesh->rows.corner_width);
            continue;
        }
        struct cut cut = {.from = &mesh->open, .triangle = t};
        memcpy(cut.vertices, mesh->open.indices + 3 * t, 3 * sizeof *cut.vertices);
        for (uint32_t k = 0; k < 3; k++) {
            if (!(masks[t] >> k & 1))
                continue;
            const uint32_t a = cut.vertices[k], b = cut.vertices[(k + 1) % 3];
            const uint32_t middle = trc_edge_table_take(table, a, b, (uint32_t)mesh->vertex_count);
            if (middle == mesh->vertex_count) {
                place_middle(mesh, a < b ? a : b, a < b ? b : a, middle);
                mesh->vertex_count++;
            }
            cut.vertices[3 + k] = middle;
        }
        put_pieces(mesh, &cut, masks[t]);
    }
}

/* Room for a pass of so many pieces and, at most, splits. */
static trc_status reserve_pass(struct trc_refined_mesh *mesh, size_t whole, size_t pieces,
                               size_t splits) {
    TRC_TRY(trc_reserve_triangles(&mesh->done, whole, mesh->rows.corner_width));
    TRC_TRY(trc_reserve_triangles(&mesh->next, pieces, mesh->rows.corner_width));
    return trc_reserve_vertices(mesh, splits);
}

/* One pass; open is empty at the end unless there would be too many triangles. */
static trc_status split_once(struct trc_refined_mesh *mesh, uint8_t *masks, bool *is_last_out) {
    size_t splits = 0, whole = 0;
    for (size_t t = 0; t < mesh->open.count; t++) {
        masks[t] = (uint8_t)split_mask(mesh, mesh->open.indices + 3 * t);
        splits += count_bits(masks[t]);
        whole += !masks[t];
    }
    const size_t pieces = mesh->open.count - whole + splits;
    mesh->is_coarse = splits && mesh->done.count + whole + pieces > trc_triangle_max(mesh);
    *is_last_out = !splits || mesh->is_coarse;
    if (*is_last_out)
        return TRC_OK;
    struct trc_edge_table table;
    trc_status status = TRC_OK;
    if (!trc_edge_table_create(&table, splits))
        status = trc_no_memory_to_dice();
    if (status == TRC_OK)
        status = reserve_pass(mesh, whole, pieces, splits);
    if (status == TRC_OK)
        split_open(mesh, masks, &table);
    trc_edge_table_free(&table);
    if (status == TRC_OK) {
        const struct trc_triangle_list empty = mesh->open;
        mesh->open = mesh->next;
        mesh->next = empty;
        mesh->next.count = 0;
    }
    return status;
}

trc_status trc_split_edges(struct trc_refined_mesh *mesh, uint32_t levels) {
    bool is_last = false;
    for (uint32_t i = 0; i < levels && !is_last; i++) {
        uint8_t *masks = trc_alloc(mesh->open.count, 1);
        if (!masks)
            return trc_no_memory_to_dice();
        const trc_status status = split_once(mesh, masks, &is_last);
        trc_free(masks);
        TRC_TRY(status);
    }
    TRC_TRY(trc_reserve_triangles(&mesh->done, mesh->open.count, mesh->rows.corner_width));
    for (size_t t = 0; t < mesh->open.count; t++)
        copy_triangle(&mesh->done, &mesh->open, t, mesh->rows.corner_width);
    mesh->open.count = 0;
    return TRC_OK;
}
