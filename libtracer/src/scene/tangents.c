/* Corners that are alike get one number (welding), those that edges join become fans, the
 * directions in a fan are summed. Doubles, because squares of large coordinates leave the range of
 * floats. */
#include "scene/tangents.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/core.h"

/* Multiplier of hashes: 2^64 over the golden ratio (Knuth, "The Art of Computer Programming",
 * vol. 3, section 6.4). */
#define GOLDEN 0x9e3779b97f4a7c15u
#define NONE UINT32_MAX
/* A normal nearer to the triangle's plane, as a sine, says nothing of directions in it. */
#define LEVEL 1e-3

struct work {
    const trc_tangents_desc *desc;
    uint32_t *equal_edge; /* the next corner at which an equal edge begins, or NONE */
    bool *is_joined;      /* the edge that begins at a corner */
    uint32_t count;       /* of corners */
    uint32_t *welded;     /* the first corner that is alike */
    uint32_t *fans;       /* a corner of the same fan, itself at the fan's first */
    uint32_t *table;      /* corners by hashes, NONE: free */
    uint64_t mask;        /* of places of the table */
    int8_t *signs;        /* handedness of triangles */
    double (*sums)[3];    /* of fans, at their first corners */
};

static const float *position(const struct work *w, uint32_t corner) {
    return w->desc->positions + 3 * (size_t)corner;
}
static const float *normal(const struct work *w, uint32_t corner) {
    return w->desc->normals + 3 * (size_t)corner;
}
static const float *uv(const struct work *w, uint32_t corner) {
    return w->desc->uvs + 2 * (size_t)corner;
}

static uint32_t next_corner(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

/* ---- vectors ---- */

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Makes a vector unit, or 0 where it has no direction. */
static void make_unit(double v[3]) {
    const double length = sqrt(dot(v, v));
    for (int i = 0; i < 3; i++)
        v[i] = length > 0.0 ? v[i] / length : 0.0;
}

/* Takes from a vector what is along a unit normal. */
static void flatten(double v[3], const float n[3]) {
    const double along = v[0] * (double)n[0] + v[1] * (double)n[1] + v[2] * (double)n[2];
    for (int i = 0; i < 3; i++)
        v[i] -= (double)n[i] * along;
}

static void subtract(const float a[3], const float b[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = (double)a[i] - (double)b[i];
}

/* ---- corners that are alike ---- */

static uint64_t mixed(uint64_t hash, float value) {
    const float one_zero = value + 0.0f; /* instead of two */
    uint32_t bits;
    memcpy(&bits, &one_zero, sizeof bits);
    hash = (hash ^ bits) * GOLDEN;
    return hash ^ hash >> 29;
}

static uint64_t hash_of_corner(const struct work *w, uint32_t corner) {
    uint64_t hash = (uint64_t)(uint8_t)w->signs[corner / 3];
    for (int i = 0; i < 3; i++)
        hash = mixed(mixed(hash, position(w, corner)[i]), normal(w, corner)[i]);
    for (int i = 0; w->desc->has_seams && i < 2; i++)
        hash = mixed(hash, uv(w, corner)[i]);
    return hash;
}

static bool are_alike(const struct work *w, uint32_t a, uint32_t b) {
    bool alike = w->signs[a / 3] == w->signs[b / 3];
    for (int i = 0; i < 3; i++)
        alike =
            alike && position(w, a)[i] == position(w, b)[i] && normal(w, a)[i] == normal(w, b)[i];
    for (int i = 0; w->desc->has_seams && i < 2; i++)
        alike = alike && uv(w, a)[i] == uv(w, b)[i];
    return alike;
}

static void clear_table(struct work *w) {
    memset(w->table, 0xff, (w->mask + 1) * sizeof *w->table);
}

static void weld(struct work *w) {
    clear_table(w);
    for (uint32_t corner = 0; corner < w->count; corner++) {
        uint64_t place = hash_of_corner(w, corner) & w->mask;
        while (w->table[place] != NONE && !are_alike(w, w->table[place], corner))
            place = (place + 1) & w->mask;
        if (w->table[place] == NONE)
            w->table[place] = corner;
        w->welded[corner] = w->table[place];
    }
}

/* ---- fans ---- */

/* The place of the edge from a to b, corners as they are welded: free, or of the corner where the
 * first such edge begins. */
static uint64_t place_of_edge(const struct work *w, uint32_t a, uint32_t b) {
    const uint64_t key = (uint64_t)a << 32 | b;
    uint64_t place = (key * GOLDEN) >> 20 & w->mask;
    while (w->table[place] != NONE) {
        const uint32_t corner = w->table[place];
        if (w->welded[corner] == a && w->welded[next_corner(corner)] == b)
            break;
        place = (place + 1) & w->mask;
    }
    return place;
}

/* The first corner of a fan. */
static uint32_t first_of(struct work *w, uint32_t corner) {
    while (w->fans[corner] != corner)
        corner = w->fans[corner] = w->fans[w->fans[corner]]; /* halves the way of the next */
    return corner;
}

static void join(struct work *w, uint32_t a, uint32_t b) {
    const uint32_t first_a = first_of(w, a), first_b = first_of(w, b);
    if (first_a < first_b)
        w->fans[first_b] = first_a;
    else
        w->fans[first_a] = first_b;
}

/* Enters the edge that begins at each corner into the table, those that are equal in a list: their
 * first in the table, in their order. */
static void list_edges(struct work *w) {
    clear_table(w);
    for (uint32_t corner = w->count; corner-- > 0;) {
        const uint64_t place = place_of_edge(w, w->welded[corner], w->welded[next_corner(corner)]);
        w->equal_edge[corner] = w->table[place];
        w->table[place] = corner;
    }
}

/* The first corner of a list at which no joined edge begins, NONE where there is none. */
static uint32_t first_free(struct work *w, uint32_t first) {
    uint32_t corner = first;
    while (corner != NONE && w->is_joined[corner])
        corner = w->equal_edge[corner];
    if (corner != first)
        w->equal_edge[first] = corner; /* the way of the next */
    return corner;
}

/* Joins corners that are alike on both sides of an edge. Of more than two triangles at an edge the
 * first two that run along it in opposite directions are joined, then the next two. */
static void find_fans(struct work *w) {
    list_edges(w);
    for (uint32_t corner = 0; corner < w->count; corner++)
        w->fans[corner] = corner;
    for (uint32_t corner = 0; corner < w->count; corner++) {
        const uint32_t a = w->welded[corner], b = w->welded[next_corner(corner)];
        if (w->is_joined[corner] || a == b)
            continue;
        const uint32_t back = first_free(w, w->table[place_of_edge(w, b, a)]);
        if (back == NONE)
            continue;
        w->is_joined[corner] = w->is_joined[back] = true;
        join(w, corner, next_corner(back));
        join(w, next_corner(corner), back);
    }
}

/* ---- directions ---- */

/* Whether U and V turn as the corners do: 1, else -1. */
static int8_t sign_of(const struct work *w, uint32_t corner) {
    double a[2], b[2];
    for (int i = 0; i < 2; i++) {
        a[i] = (double)uv(w, corner + 1)[i] - (double)uv(w, corner)[i];
        b[i] = (double)uv(w, corner + 2)[i] - (double)uv(w, corner)[i];
    }
    return a[0] * b[1] - a[1] * b[0] > 0.0 ? 1 : -1;
}

/* In which direction U grows on the triangle of a first corner. */
static void growing_u(const struct work *w, uint32_t corner, double out[3]) {
    double first[3], second[3];
    subtract(position(w, corner + 1), position(w, corner), first);
    subtract(position(w, corner + 2), position(w, corner), second);
    const double v1 = (double)uv(w, corner + 1)[1] - (double)uv(w, corner)[1];
    const double v2 = (double)uv(w, corner + 2)[1] - (double)uv(w, corner)[1];
    const int8_t sign = w->signs[corner / 3];
    for (int i = 0; i < 3; i++)
        out[i] = (first[i] * v2 - second[i] * v1) * sign;
}

/* The angle at a corner, seen along its normal. */
static double angle_at(const struct work *w, uint32_t corner) {
    const uint32_t next = next_corner(corner);
    double to_next[3], to_last[3];
    subtract(position(w, next), position(w, corner), to_next);
    subtract(position(w, next_corner(next)), position(w, corner), to_last);
    flatten(to_next, normal(w, corner));
    flatten(to_last, normal(w, corner));
    make_unit(to_next);
    make_unit(to_last);
    return acos(fmax(-1.0, fmin(1.0, dot(to_next, to_last))));
}

static void sum_directions(struct work *w) {
    for (uint32_t corner = 0; corner < w->count; corner++) {
        double direction[3];
        growing_u(w, corner - corner % 3, direction);
        flatten(direction, normal(w, corner));
        make_unit(direction);
        const double angle = angle_at(w, corner);
        double *sum = w->sums[first_of(w, corner)];
        for (int i = 0; i < 3; i++)
            sum[i] += direction[i] * angle;
    }
    for (uint32_t corner = 0; corner < w->count; corner++) {
        if (w->fans[corner] != corner)
            continue;
        double *sum = w->sums[corner];
        make_unit(sum);
        if (sum[0] == 0.0 && sum[1] == 0.0 && sum[2] == 0.0)
            sum[0] = 1.0;
    }
}

/* ---- what is given ---- */

/* The sides of a triangle, and what tells where in its plane a vector points. */
struct plane {
    double first[3], second[3], flat[3]; /* flat: its unit normal, 0 without an area */
    double a11, a12, a22, area2;         /* products of the sides; area2 is infinite for none */
};

static struct plane plane_at(const struct work *w, uint32_t corner) {
    struct plane p;
    subtract(position(w, corner + 1), position(w, corner), p.first);
    subtract(position(w, corner + 2), position(w, corner), p.second);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        p.flat[i] = p.first[j] * p.second[k] - p.first[k] * p.second[j];
    }
    make_unit(p.flat);
    p.a11 = dot(p.first, p.first);
    p.a12 = dot(p.first, p.second);
    p.a22 = dot(p.second, p.second);
    p.area2 = p.a11 * p.a22 - p.a12 * p.a12;
    if (!(p.area2 > 0.0))
        p.area2 = INFINITY;
    return p;
}

/* The vector in the plane that is the tangent once it is made perpendicular to the normal. */
static void give_coordinates(const struct plane *p, const double tangent[3], const float n[3],
                             int8_t sign, float out[4]) {
    double slope =
        p->flat[0] * (double)n[0] + p->flat[1] * (double)n[1] + p->flat[2] * (double)n[2];
    if (!(fabs(slope) > LEVEL))
        slope = INFINITY;
    const double above = dot(tangent, p->flat) / slope;
    double in_plane[3];
    for (int i = 0; i < 3; i++)
        in_plane[i] = tangent[i] - (double)n[i] * above;
    const double b1 = dot(in_plane, p->first), b2 = dot(in_plane, p->second);
    out[0] = (float)((b1 * p->a22 - b2 * p->a12) / p->area2);
    out[1] = (float)((b2 * p->a11 - b1 * p->a12) / p->area2);
    out[2] = sign;
    out[3] = 0.0f;
}

static void give(struct work *w, uint32_t form, float *out) {
    struct plane plane = {.area2 = INFINITY};
    for (uint32_t corner = 0; corner < w->count; corner++) {
        const double *tangent = w->sums[first_of(w, corner)];
        if (form == TRC_TANGENTS_VECTORS) {
            for (int i = 0; i < 3; i++)
                out[3 * (size_t)corner + (size_t)i] = (float)tangent[i];
            continue;
        }
        if (corner % 3 == 0)
            plane = plane_at(w, corner);
        give_coordinates(&plane, tangent, normal(w, corner), w->signs[corner / 3],
                         out + 4 * (size_t)corner);
    }
}

static bool take_memory(struct work *w) {
    uint64_t places = 16;
    while (places < 2 * (uint64_t)w->count) /* half of them stay free: short runs */
        places *= 2;
    w->mask = places - 1;
    w->table = trc_alloc(places, sizeof *w->table);
    w->welded = trc_alloc(w->count, sizeof *w->welded);
    w->fans = trc_alloc(w->count, sizeof *w->fans);
    w->equal_edge = trc_alloc(w->count, sizeof *w->equal_edge);
    w->is_joined = trc_alloc_zeroed(w->count, sizeof *w->is_joined);
    w->signs = trc_alloc(w->count / 3, sizeof *w->signs);
    w->sums = trc_alloc_zeroed(w->count, sizeof *w->sums);
    return w->table && w->welded && w->fans && w->equal_edge && w->is_joined && w->signs && w->sums;
}

trc_status trc_tangents_fill(const trc_tangents_desc *desc, uint32_t form, float *tangents_out) {
    struct work w = {.desc = desc, .count = (uint32_t)(3 * desc->triangle_count)};
    if (!w.count)
        return TRC_OK;
    const bool ok = take_memory(&w);
    if (ok) {
        for (uint32_t corner = 0; corner < w.count; corner += 3)
            w.signs[corner / 3] = sign_of(&w, corner);
        weld(&w);
        find_fans(&w);
        sum_directions(&w);
        give(&w, form, tangents_out);
    }
    trc_free(w.table);
    trc_free(w.welded);
    trc_free(w.fans);
    trc_free(w.equal_edge);
    trc_free(w.is_joined);
    trc_free(w.signs);
    trc_free(w.sums);
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for tangents");
}
