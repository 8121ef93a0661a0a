#include "scene/dicing.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/catmull_clark.h"
#include "scene/edge_table.h"
#include "scene/mesh.h"

/* Some 2 GB of a mesh, and as much again of its BVH. */
#define TRIANGLE_MAX_DEFAULT ((uint64_t)1 << 25)
/* Catmull-Clark levels are even all over the mesh: where faces need more than this many make,
 * curved edges follow the surface closely enough. */
#define EVEN_FACE_MAX 65536u
/* Of a sum of unit normals: what is shorter than 1e-6 is the error of the sum. */
#define SQUARE_MIN 1e-12f

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the dicing of a mesh");
}

/* ---- the mesh under way ---- */

/* Triangles one after another, each with three corners. */
struct triangles {
    size_t count, capacity;
    uint32_t *indices;
    float *corners; /* the values of the attributes, side by side */
    uint16_t *material_index;
    uint8_t *smooth;
};

/* A vertex is a row: positions of all keys, Generated coordinates if there are any, normals of all
 * keys if they matter. */
struct dicer {
    const trc_dicing_desc *how;
    size_t key_count;
    size_t normals, generated; /* where they begin in a row; 0: there are none */
    size_t vertex_width, corner_width;
    size_t vertex_count, vertex_capacity;
    float *vertices;
    struct triangles done, open, next; /* final, may have to be split, halves of the latter */
    bool is_coarse;
};

static void free_triangles(struct triangles *t) {
    trc_free(t->indices);
    trc_free(t->corners);
    trc_free(t->material_index);
    trc_free(t->smooth);
    *t = (struct triangles){.count = 0};
}

static void free_dicer(struct dicer *d) {
    trc_free(d->vertices);
    free_triangles(&d->done);
    free_triangles(&d->open);
    free_triangles(&d->next);
}

/* Gives an array room for more elements of a size; false without memory, and it stays. */
static bool grow(void *array_pointer, size_t count, size_t capacity, size_t size) {
    void *array, *larger = trc_alloc(capacity, size);
    if (!larger)
        return false;
    memcpy(&array, array_pointer, sizeof array);
    if (count)
        memcpy(larger, array, count * size);
    trc_free(array);
    memcpy(array_pointer, &larger, sizeof larger);
    return true;
}

static trc_status reserve_triangles(struct triangles *t, size_t more, size_t corner_width) {
    if (t->count + more <= t->capacity)
        return TRC_OK;
    const size_t capacity = t->count + more > 2 * t->capacity ? t->count + more : 2 * t->capacity;
    if (!grow(&t->indices, t->count, capacity, 3 * sizeof *t->indices) ||
        !grow(&t->corners, t->count, capacity, 3 * corner_width * sizeof *t->corners) ||
        !grow(&t->material_index, t->count, capacity, sizeof *t->material_index) ||
        !grow(&t->smooth, t->count, capacity, 1))
        return no_memory();
    t->capacity = capacity;
    return TRC_OK;
}

static trc_status reserve_vertices(struct dicer *d, size_t more) {
    const size_t needed = d->vertex_count + more;
    if (3 * needed * d->key_count > INT32_MAX)
        return trc_fail(TRC_ERROR_TOO_LARGE, "the diced mesh has too many vertices");
    if (needed <= d->vertex_capacity)
        return TRC_OK;
    const size_t capacity = needed > 2 * d->vertex_capacity ? needed : 2 * d->vertex_capacity;
    if (!grow(&d->vertices, d->vertex_count, capacity, d->vertex_width * sizeof *d->vertices))
        return no_memory();
    d->vertex_capacity = capacity;
    return TRC_OK;
}

static float *row(const struct dicer *d, size_t vertex) {
    return d->vertices + vertex * d->vertex_width;
}

/* ---- how long an edge may be ---- */

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static float length(const float a[3]) { return sqrtf(dot(a, a)); }

static void to_camera(const float m[12], const float p[3], float out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
}

/* Metres from a point in front of the sides of a frustum, of those that it is outside of. */
static float outside_of_frustum(const float window[4], const float p[3]) {
    const float away[4] = {(-p[0] - window[0] * p[2]) / sqrtf(1.0f + window[0] * window[0]),
                           (p[0] + window[1] * p[2]) / sqrtf(1.0f + window[1] * window[1]),
                           (-p[1] - window[2] * p[2]) / sqrtf(1.0f + window[2] * window[2]),
                           (p[1] + window[3] * p[2]) / sqrtf(1.0f + window[3] * window[3])};
    float outside = 0.0f;
    for (int i = 0; i < 4; i++)
        outside = away[i] > outside ? away[i] : outside;
    return outside;
}

static float excess(float value, float low, float high) {
    return value < low ? low - value : value > high ? value - high : 0.0f;
}

/* Of a window's box in front of the camera, in halves of its sides. */
static float outside_of_box(const float window[4], const float p[3]) {
    const float away[3] = {excess(p[0], window[0], window[1]), excess(p[1], window[2], window[3]),
                           p[2] > 0.0f ? p[2] : 0.0f};
    const float x = 0.5f * (window[1] - window[0]), y = 0.5f * (window[3] - window[2]);
    return length(away) / sqrtf(0.5f * (x * x + y * y));
}

/* The side of the square at a point of camera space. */
static float side_at(const trc_dicing_desc *how, const float p[3]) {
    const bool is_central = how->space == TRC_DICING_CENTRAL;
    const float side = is_central ? how->side * length(p) : how->side;
    if (how->offscreen_scale == 1.0f || how->window[0] == how->window[1])
        return side;
    const float outside =
        is_central ? outside_of_frustum(how->window, p) : outside_of_box(how->window, p);
    return side * (1.0f + outside * (how->offscreen_scale - 1.0f));
}

/* Of two points of the object. An edge that is not finite stays. */
static bool is_too_long(const trc_dicing_desc *how, const float a[3], const float b[3]) {
    const float diagonal = sqrtf(2.0f);
    float ends[3][3], along[3];
    if (how->space == TRC_DICING_OBJECT) {
        for (int i = 0; i < 3; i++)
            along[i] = b[i] - a[i];
        const float size = length(along);
        return size > diagonal * how->side && size < INFINITY;
    }
    to_camera(how->object_to_camera, a, ends[0]);
    to_camera(how->object_to_camera, b, ends[1]);
    float side = INFINITY;
    for (int i = 0; i < 3; i++) {
        along[i] = ends[1][i] - ends[0][i];
        ends[2][i] = 0.5f * (ends[0][i] + ends[1][i]);
    }
    for (int i = 0; i < 3; i++) { /* an edge may come from far away to near the camera */
        const float here = side_at(how, ends[i]);
        side = here < side ? here : side;
    }
    const float size = length(along);
    return size > diagonal * side && size < INFINITY;
}

/* ---- splitting edges ---- */

/* The middle of a cubic and the normal there, as in A. Vlachos, J. Peters, C. Boyd, J. Mitchell,
 * "Curved PN triangles", 2001: both are an edge's own. middle is the mean of both ends. */
static void curve_middle(const float a[3], const float b[3], const float normal_a[3],
                         const float normal_b[3], float middle[3], float normal[3]) {
    float along[3], sum[3];
    for (int i = 0; i < 3; i++) {
        along[i] = b[i] - a[i];
        sum[i] = normal_a[i] + normal_b[i];
    }
    const float square = dot(along, along);
    if (!(square > 0.0f))
        return;
    const float rise_a = dot(along, normal_a), rise_b = -dot(along, normal_b);
    const float turn = 2.0f * dot(along, sum) / square;
    float turned[3];
    for (int i = 0; i < 3; i++) {
        middle[i] -= 0.125f * (rise_a * normal_a[i] + rise_b * normal_b[i]);
        turned[i] = sum[i] - turn * along[i];
    }
    const float size = length(turned);
    for (int i = 0; i < 3 && size > 0.0f; i++)
        normal[i] = turned[i] / size;
}

/* The row of the middle of an edge. */
static void place_middle(const struct dicer *d, uint32_t a, uint32_t b, uint32_t middle) {
    const float *of_a = row(d, a), *of_b = row(d, b);
    float *to = row(d, middle);
    for (size_t i = 0; i < d->vertex_width; i++)
        to[i] = 0.5f * (of_a[i] + of_b[i]);
    if (d->how->surface == TRC_DICING_LINEAR)
        return;
    for (size_t k = 0; k < 3 * d->key_count; k += 3) {
        const size_t n = d->normals + k;
        curve_middle(of_a + k, of_b + k, of_a + n, of_b + n, to + k, to + n);
    }
}

/* Bit k: the edge from corner k to the next one is too long. Both triangles of an edge agree. */
static uint32_t split_mask(const struct dicer *d, const uint32_t v[3]) {
    uint32_t mask = 0;
    for (uint32_t k = 0; k < 3; k++) {
        const uint32_t a = v[k], b = v[(k + 1) % 3];
        const bool is_split = is_too_long(d->how, row(d, a < b ? a : b), row(d, a < b ? b : a));
        mask |= (uint32_t)is_split << k;
    }
    return mask;
}

/* A triangle with its corners, 0 to 2, and the middles of its edges, from 3 on. */
struct cut {
    const struct triangles *from;
    size_t triangle;
    uint32_t vertices[6];
};

static void copy_triangle(struct triangles *to, const struct triangles *from, size_t triangle,
                          size_t corner_width) {
    const size_t values = 3 * corner_width;
    memcpy(to->indices + 3 * to->count, from->indices + 3 * triangle, 3 * sizeof *to->indices);
    if (values)
        memcpy(to->corners + values * to->count, from->corners + values * triangle,
               values * sizeof(float));
    to->material_index[to->count] = from->material_index[triangle];
    to->smooth[to->count++] = from->smooth[triangle];
}

static void put_piece(struct triangles *to, const struct cut *cut, const uint32_t points[3],
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

static float square_distance(const struct dicer *d, uint32_t a, uint32_t b) {
    const float *p = row(d, a), *q = row(d, b);
    const float along[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    return dot(along, along);
}

/* Puts the two to four pieces of a triangle with split edges; a quadrilateral is cut along its
 * shorter diagonal. */
static void put_pieces(struct dicer *d, const struct cut *cut, uint32_t mask) {
    struct triangles *to = &d->next;
    const size_t width = d->corner_width;
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
    if (square_distance(d, v[a], v[bc]) < square_distance(d, v[ab], v[c])) {
        put_piece(to, cut, (const uint32_t[3]){a, ab, bc}, width);
        put_piece(to, cut, (const uint32_t[3]){a, bc, c}, width);
    } else {
        put_piece(to, cut, (const uint32_t[3]){a, ab, c}, width);
        put_piece(to, cut, (const uint32_t[3]){ab, bc, c}, width);
    }
}

static uint32_t count_bits(uint32_t mask) { return (mask & 1) + (mask >> 1 & 1) + (mask >> 2); }

/* Splits the open triangles by their masks; what needs no split is done. */
static void split_open(struct dicer *d, const uint8_t *masks, struct trc_edge_table *table) {
    for (size_t t = 0; t < d->open.count; t++) {
        if (!masks[t]) {
            copy_triangle(&d->done, &d->open, t, d->corner_width);
            continue;
        }
        struct cut cut = {.from = &d->open, .triangle = t};
        memcpy(cut.vertices, d->open.indices + 3 * t, 3 * sizeof *cut.vertices);
        for (uint32_t k = 0; k < 3; k++) {
            if (!(masks[t] >> k & 1))
                continue;
            const uint32_t a = cut.vertices[k], b = cut.vertices[(k + 1) % 3];
            const uint32_t middle = trc_edge_table_take(table, a, b, (uint32_t)d->vertex_count);
            if (middle == d->vertex_count) {
                place_middle(d, a < b ? a : b, a < b ? b : a, middle);
                d->vertex_count++;
            }
            cut.vertices[3 + k] = middle;
        }
        put_pieces(d, &cut, masks[t]);
    }
}

/* Room for a pass of so many pieces and, at most, splits. */
static trc_status reserve_pass(struct dicer *d, size_t whole, size_t pieces, size_t splits) {
    TRC_TRY(reserve_triangles(&d->done, whole, d->corner_width));
    TRC_TRY(reserve_triangles(&d->next, pieces, d->corner_width));
    return reserve_vertices(d, splits);
}

static uint64_t triangle_max(const struct dicer *d) {
    return d->how->triangle_max ? d->how->triangle_max : TRIANGLE_MAX_DEFAULT;
}

/* One pass; open is empty at the end unless there would be too many triangles. */
static trc_status split_once(struct dicer *d, uint8_t *masks, bool *is_last_out) {
    size_t splits = 0, whole = 0;
    for (size_t t = 0; t < d->open.count; t++) {
        masks[t] = (uint8_t)split_mask(d, d->open.indices + 3 * t);
        splits += count_bits(masks[t]);
        whole += !masks[t];
    }
    const size_t pieces = d->open.count - whole + splits;
    d->is_coarse = splits && d->done.count + whole + pieces > triangle_max(d);
    *is_last_out = !splits || d->is_coarse;
    if (*is_last_out)
        return TRC_OK;
    struct trc_edge_table table;
    trc_status status = TRC_OK;
    if (!trc_edge_table_create(&table, splits))
        status = no_memory();
    if (status == TRC_OK)
        status = reserve_pass(d, whole, pieces, splits);
    if (status == TRC_OK)
        split_open(d, masks, &table);
    trc_edge_table_free(&table);
    if (status == TRC_OK) {
        const struct triangles empty = d->open;
        d->open = d->next;
        d->next = empty;
        d->next.count = 0;
    }
    return status;
}

static trc_status split_edges(struct dicer *d, uint32_t levels) {
    bool is_last = false;
    for (uint32_t i = 0; i < levels && !is_last; i++) {
        uint8_t *masks = trc_alloc(d->open.count, 1);
        if (!masks)
            return no_memory();
        const trc_status status = split_once(d, masks, &is_last);
        trc_free(masks);
        TRC_TRY(status);
    }
    TRC_TRY(reserve_triangles(&d->done, d->open.count, d->corner_width));
    for (size_t t = 0; t < d->open.count; t++)
        copy_triangle(&d->done, &d->open, t, d->corner_width);
    d->open.count = 0;
    return TRC_OK;
}

/* ---- normals of the vertices ---- */

/* Adds the unit normal of a triangle, times its angle there, to each of its vertices, of the key
 * that begins at an offset of the rows. */
static void add_normals(const struct dicer *d, const uint32_t v[3], size_t key) {
    float sides[3][3], normal[3];
    for (int k = 0; k < 3; k++)
        for (size_t i = 0; i < 3; i++)
            sides[k][i] = row(d, v[(k + 1) % 3])[key + i] - row(d, v[k])[key + i];
    for (int i = 0; i < 3; i++)
        normal[i] = sides[0][(i + 1) % 3] * sides[1][(i + 2) % 3] -
                    sides[0][(i + 2) % 3] * sides[1][(i + 1) % 3];
    const float size = length(normal);
    if (!(size > 0.0f))
        return;
    for (int k = 0; k < 3; k++) { /* the cross product of any two sides is as long */
        const float angle = atan2f(size, -dot(sides[k], sides[(k + 2) % 3]));
        for (size_t i = 0; i < 3; i++)
            row(d, v[k])[d->normals + key + i] += angle / size * normal[i];
    }
}

static void compute_normals(struct dicer *d) {
    for (size_t k = 0; k < 3 * d->key_count; k += 3) {
        for (size_t t = 0; t < d->open.count; t++)
            add_normals(d, d->open.indices + 3 * t, k);
        for (size_t v = 0; v < d->vertex_count; v++) {
            float *n = row(d, v) + d->normals + k;
            const float square = dot(n, n);
            for (int i = 0; i < 3; i++)
                n[i] = square > SQUARE_MIN ? n[i] / sqrtf(square) : 0.0f;
        }
    }
}

/* ---- from the descriptor ---- */

static void fill_row(const struct dicer *d, const trc_mesh_desc *desc, size_t vertex, float *to) {
    for (size_t k = 0; k < d->key_count; k++) {
        const size_t from = 3 * (desc->vertex_count * k + vertex);
        memcpy(to + 3 * k, desc->positions + from, 3 * sizeof *to);
        if (d->how->surface == TRC_DICING_LINEAR && d->normals)
            memcpy(to + d->normals + 3 * k, desc->normals + from, 3 * sizeof *to);
    }
    if (d->generated)
        memcpy(to + d->generated, desc->generated + 3 * vertex, 3 * sizeof *to);
}

static void fill_corner(const trc_mesh_desc *desc, size_t corner, float *to) {
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        const size_t width = desc->attributes[i].width;
        memcpy(to, desc->attributes[i].values + width * corner, width * sizeof *to);
        to += width;
    }
}

static uint16_t slot_of(const trc_mesh_desc *desc, size_t triangle) {
    return desc->material_index ? desc->material_index[triangle] : 0;
}

static uint8_t smooth_of(const trc_mesh_desc *desc, size_t triangle) {
    if (desc->normals && desc->normal_kind == TRC_NORMALS_CORNER)
        return 1;
    return desc->smooth ? desc->smooth[triangle] : 0;
}

/* What rows and corners hold; normals only where the surface is of them. */
static void lay_out(struct dicer *d, const trc_mesh_desc *desc) {
    d->how = desc->dicing;
    d->key_count = desc->key_count;
    d->vertex_width = 3 * d->key_count;
    if (desc->generated) {
        d->generated = d->vertex_width;
        d->vertex_width += 3;
    }
    for (uint32_t i = 0; i < desc->attribute_count; i++)
        d->corner_width += desc->attributes[i].width;
    const bool has_normals = desc->normals && desc->normal_kind == TRC_NORMALS_VERTEX;
    if (d->how->surface != TRC_DICING_LINEAR || has_normals) {
        d->normals = d->vertex_width;
        d->vertex_width += 3 * d->key_count;
    }
}

static trc_status take_triangles(struct dicer *d, const trc_mesh_desc *desc) {
    TRC_TRY(reserve_vertices(d, desc->vertex_count));
    TRC_TRY(reserve_triangles(&d->open, desc->triangle_count, d->corner_width));
    for (size_t v = 0; v < desc->vertex_count; v++) {
        memset(row(d, v), 0, d->vertex_width * sizeof(float));
        fill_row(d, desc, v, row(d, v));
    }
    d->vertex_count = desc->vertex_count;
    for (size_t t = 0; t < desc->triangle_count; t++) {
        memcpy(d->open.indices + 3 * t, desc->indices + 3 * t, 3 * sizeof *desc->indices);
        for (size_t k = 0; k < 3; k++)
            fill_corner(desc, 3 * t + k, d->open.corners + d->corner_width * (3 * t + k));
        d->open.material_index[t] = slot_of(desc, t);
        d->open.smooth[t] = smooth_of(desc, t);
    }
    d->open.count = desc->triangle_count;
    return TRC_OK;
}

/* ---- faces of Catmull-Clark ---- */

/* Whether another triangle of a face shares the edge that begins at a corner. */
static bool is_inner(const uint32_t *indices, size_t count, size_t corner) {
    const uint32_t a = indices[corner], b = indices[corner / 3 * 3 + (corner + 1) % 3];
    for (size_t c = 0; c < count; c++)
        if (indices[c] == b && indices[c / 3 * 3 + (c + 1) % 3] == a)
            return true;
    return false;
}

/* The outline of the triangles of one face, count corners from the first on; its number of
 * corners, written as theirs. 0: it is not one ring. */
static uint32_t trace_outline(const uint32_t *indices, size_t count, uint32_t *outline) {
    uint32_t size = 0;
    const size_t expected = count / 3 + 2;
    size_t corner = 0;
    while (corner < count && is_inner(indices, count, corner))
        corner++;
    const size_t first = corner;
    while (corner < count && size < expected) {
        outline[size++] = (uint32_t)corner;
        const uint32_t end = indices[corner / 3 * 3 + (corner + 1) % 3];
        for (corner = 0; corner < count; corner++)
            if (indices[corner] == end && !is_inner(indices, count, corner))
                break;
        if (corner == first)
            break;
    }
    return corner == first && size == expected ? size : 0;
}

static void put_face(struct trc_faces *f, const trc_mesh_desc *desc, size_t triangle,
                     const uint32_t *outline, uint32_t size) {
    const uint32_t begin = f->begin[f->face_count];
    for (uint32_t k = 0; k < size; k++) {
        const size_t corner = 3 * triangle + outline[k];
        f->indices[begin + k] = desc->indices[corner];
        fill_corner(desc, corner, f->corners + f->corner_width * (begin + k));
    }
    f->material_index[f->face_count] = slot_of(desc, triangle);
    f->smooth[f->face_count] = smooth_of(desc, triangle);
    f->begin[++f->face_count] = begin + size;
}

/* Triangles of one face become one, or stay where they make no ring. */
static void join_triangles(struct trc_faces *f, const trc_mesh_desc *desc, uint32_t *outline) {
    static const uint32_t whole[3] = {0, 1, 2};
    const uint32_t *faces = desc->dicing->faces;
    size_t end;
    f->begin[0] = 0;
    for (size_t t = 0; t < desc->triangle_count; t = end) {
        for (end = t + 1; faces && end < desc->triangle_count && faces[end] == faces[t]; end++)
            continue;
        const uint32_t size = trace_outline(desc->indices + 3 * t, 3 * (end - t), outline);
        if (size)
            put_face(f, desc, t, outline, size);
        for (size_t k = t; !size && k < end; k++)
            put_face(f, desc, k, whole, 3);
    }
}

static trc_status make_faces(const struct dicer *d, const trc_mesh_desc *desc,
                             struct trc_faces *f) {
    const size_t corners = 3 * desc->triangle_count;
    *f = (struct trc_faces){
        .vertex_width = 3 * d->key_count + (d->generated ? 3 : 0),
        .corner_width = d->corner_width,
        .vertex_count = (uint32_t)desc->vertex_count,
        .begin = trc_alloc(desc->triangle_count + 1, sizeof *f->begin),
        .indices = trc_alloc(corners, sizeof *f->indices),
        .corners = trc_alloc(corners * d->corner_width, sizeof *f->corners),
        .material_index = trc_alloc(desc->triangle_count, sizeof *f->material_index),
        .smooth = trc_alloc(desc->triangle_count, 1),
    };
    f->vertices = trc_alloc(desc->vertex_count * f->vertex_width, sizeof *f->vertices);
    uint32_t *outline = trc_alloc(desc->triangle_count + 2, sizeof *outline);
    const bool enough = f->begin && f->indices && f->corners && f->material_index && f->smooth &&
                        f->vertices && outline;
    if (enough) {
        join_triangles(f, desc, outline);
        for (size_t v = 0; v < desc->vertex_count; v++)
            fill_row(d, desc, v, f->vertices + f->vertex_width * v);
    }
    trc_free(outline);
    return enough ? TRC_OK : no_memory();
}

static bool has_long_edge(const struct dicer *d, const struct trc_faces *f) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t next = c + 1 == f->begin[face + 1] ? f->begin[face] : c + 1;
            if (is_too_long(d->how, f->vertices + f->vertex_width * f->indices[c],
                            f->vertices + f->vertex_width * f->indices[next]))
                return true;
        }
    }
    return false;
}

/* Quadrilaterals as two triangles each. */
static trc_status take_faces(struct dicer *d, const struct trc_faces *f) {
    TRC_TRY(reserve_vertices(d, f->vertex_count));
    TRC_TRY(reserve_triangles(&d->open, 2 * (size_t)f->face_count, d->corner_width));
    for (size_t v = 0; v < f->vertex_count; v++) {
        memset(row(d, v), 0, d->vertex_width * sizeof(float));
        memcpy(row(d, v), f->vertices + f->vertex_width * v, f->vertex_width * sizeof(float));
    }
    d->vertex_count = f->vertex_count;
    for (size_t i = 0; i < (size_t)6 * f->face_count; i++) {
        static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
        const size_t corner = 4 * (i / 6) + corners[i % 6];
        d->open.indices[i] = f->indices[corner];
        if (d->corner_width)
            memcpy(d->open.corners + d->corner_width * i, f->corners + d->corner_width * corner,
                   d->corner_width * sizeof(float));
        d->open.material_index[i / 3] = f->material_index[i / 6];
        d->open.smooth[i / 3] = f->smooth[i / 6];
    }
    d->open.count = 2 * (size_t)f->face_count;
    return TRC_OK;
}

/* Even levels, then the limit; the levels taken are in *levels_out. */
static trc_status subdivide(struct dicer *d, struct trc_faces *f, uint32_t *levels_out) {
    const bool sharp = d->how->sharp_corners != 0;
    uint32_t levels = 0;
    do {
        TRC_TRY(trc_catmull_clark_subdivide(f, sharp));
        levels++;
    } while (levels < d->how->max_subdivisions && f->face_count <= EVEN_FACE_MAX &&
             8 * (uint64_t)f->face_count <= triangle_max(d) && has_long_edge(d, f));
    TRC_TRY(trc_catmull_clark_limit(f, sharp));
    *levels_out = levels;
    return take_faces(d, f);
}

/* ---- to the descriptor ---- */

static trc_status alloc_attributes(const trc_mesh_desc *desc, struct trc_diced_mesh *out) {
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        trc_corner_attribute *attribute = &out->attributes[i];
        *attribute = desc->attributes[i];
        attribute->value_count = attribute->width * out->desc.index_count;
        attribute->values = out->values[i] = trc_alloc(attribute->value_count, sizeof(float));
        if (!attribute->values)
            return no_memory();
    }
    out->desc.attributes = out->attributes;
    return TRC_OK;
}

static void write_rows(const struct dicer *d, struct trc_diced_mesh *out) {
    for (size_t v = 0; v < d->vertex_count; v++) {
        const float *from = row(d, v);
        for (size_t k = 0; k < d->key_count; k++) {
            const size_t to = 3 * (d->vertex_count * k + v);
            memcpy(out->positions + to, from + 3 * k, 3 * sizeof *from);
            if (!out->normals)
                continue;
            const float *n = from + d->normals + 3 * k;
            const float size = length(n);
            for (size_t i = 0; i < 3; i++)
                out->normals[to + i] = size > 0.0f ? n[i] / size : 0.0f;
        }
        if (d->generated)
            memcpy(out->generated + 3 * v, from + d->generated, 3 * sizeof *from);
    }
}

static void write_corners(const struct dicer *d, struct trc_diced_mesh *out) {
    size_t offset = 0;
    for (uint32_t i = 0; i < out->desc.attribute_count; i++) {
        const size_t width = out->attributes[i].width;
        for (size_t c = 0; c < 3 * d->done.count; c++)
            memcpy(out->values[i] + width * c, d->done.corners + d->corner_width * c + offset,
                   width * sizeof(float));
        offset += width;
    }
}

/* Takes over what is laid out as in a descriptor already. */
static trc_status describe(struct dicer *d, const trc_mesh_desc *desc, struct trc_diced_mesh *out) {
    const bool keeps_normals = d->how->surface == TRC_DICING_LINEAR && d->normals;
    const size_t floats = 3 * d->vertex_count * d->key_count;
    out->is_coarse = d->is_coarse;
    out->positions = trc_alloc(floats, sizeof(float));
    out->normals = keeps_normals ? trc_alloc(floats, sizeof(float)) : NULL;
    out->generated = d->generated ? trc_alloc(3 * d->vertex_count, sizeof(float)) : NULL;
    if (!out->positions || (keeps_normals && !out->normals) || (d->generated && !out->generated))
        return no_memory();
    out->desc.index_count = 3 * d->done.count;
    TRC_TRY(alloc_attributes(desc, out));
    write_rows(d, out);
    write_corners(d, out);
    out->indices = d->done.indices;
    out->smooth = d->done.smooth;
    out->material_index = d->done.material_index;
    d->done.indices = NULL;
    d->done.smooth = NULL;
    d->done.material_index = NULL;
    trc_mesh_desc *to = &out->desc;
    to->dicing = NULL;
    to->vertex_count = d->vertex_count;
    to->triangle_count = d->done.count;
    to->positions = out->positions;
    to->position_count = floats;
    to->indices = out->indices;
    to->normals = out->normals;
    to->normal_kind = keeps_normals ? TRC_NORMALS_VERTEX : TRC_NORMALS_NONE;
    to->normal_count = keeps_normals ? floats : 0;
    to->smooth = out->smooth;
    to->material_index = out->material_index;
    to->generated = out->generated;
    to->generated_count = d->generated ? 3 * d->vertex_count : 0;
    return TRC_OK;
}

void trc_diced_mesh_free(struct trc_diced_mesh *diced) {
    trc_free(diced->indices);
    trc_free(diced->positions);
    trc_free(diced->normals);
    trc_free(diced->generated);
    trc_free(diced->smooth);
    trc_free(diced->material_index);
    for (uint32_t i = 0; i < TRC_MAX_ATTRIBUTES; i++)
        trc_free(diced->values[i]);
}

/* ---- the whole ---- */

static trc_status refine(struct dicer *d, const trc_mesh_desc *desc) {
    uint32_t levels = 0;
    trc_status status = TRC_OK;
    if (d->how->surface == TRC_DICING_CATMULL_CLARK) {
        struct trc_faces faces;
        status = make_faces(d, desc, &faces);
        if (status == TRC_OK)
            status = subdivide(d, &faces, &levels);
        trc_faces_free(&faces);
    } else {
        status = take_triangles(d, desc);
    }
    TRC_TRY(status);
    if (d->how->surface != TRC_DICING_LINEAR)
        compute_normals(d);
    const uint32_t levels_max = d->how->max_subdivisions;
    return split_edges(d, levels < levels_max ? levels_max - levels : 0);
}

trc_status trc_dice(const trc_mesh_desc *desc, struct trc_diced_mesh *diced_out) {
    struct dicer d = {.vertex_count = 0};
    *diced_out = (struct trc_diced_mesh){.desc = *desc};
    TRC_TRY(trc_check_indices(desc->indices, 3 * desc->triangle_count, desc->vertex_count));
    lay_out(&d, desc);
    trc_status status = refine(&d, desc);
    if (status == TRC_OK)
        status = describe(&d, desc, diced_out);
    free_dicer(&d);
    if (status != TRC_OK)
        trc_diced_mesh_free(diced_out);
    return status;
}
