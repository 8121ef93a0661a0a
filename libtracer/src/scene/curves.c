#include "scene/curves.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "scene/mesh.h"

/* Of the descriptor: x, y, z and radius. */
#define POINT_FLOATS 4

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for curves");
}

/* ---- how finely strands are cut ---- */

/* Larger second difference of the control points of a spline's Bezier form. */
static float bend_of(const float *p0, const float *p1, const float *p2, const float *p3) {
    float first = 0.0f, second = 0.0f;
    for (int axis = 0; axis < 3; axis++) {
        const float b1 = p1[axis] + (p2[axis] - p0[axis]) / 6.0f;
        const float b2 = p2[axis] - (p3[axis] - p1[axis]) / 6.0f;
        const float x = p1[axis] - 2.0f * b1 + b2, y = b1 - 2.0f * b2 + p2[axis];
        first += x * x;
        second += y * y;
    }
    return sqrtf(first > second ? first : second);
}

/* Pieces that stay within the tolerance, in metres: a piece is off by at most 3/4 of the second
 * difference over the square of their number (G. Wang, 1984, "The subdivision method for finding
 * the intersection between two Bezier curves or surfaces"). What is not finite takes as many as
 * there may be. */
static uint32_t cuts_of(float bend, float tolerance, uint32_t maximum) {
    const float needed = ceilf(sqrtf(0.75f * bend / tolerance));
    if (!(needed < (float)maximum))
        return bend == 0.0f && tolerance > 0.0f ? 1 : maximum;
    return needed > 1.0f ? (uint32_t)needed : 1;
}

/* The points of the spline from point i of a strand to the next. */
static void spline_points(const float *points, uint32_t length, uint32_t i, const float *p[4]) {
    p[1] = points + POINT_FLOATS * (size_t)i;
    p[2] = p[1] + POINT_FLOATS;
    p[0] = i > 0 ? p[1] - POINT_FLOATS : p[1];
    p[3] = i + 2 < length ? p[2] + POINT_FLOATS : p[2];
}

/* Cuts of all strands, as they are at the first key. */
static void cuts_fill(const struct trc_mesh_topology *t, const trc_curves_desc *desc) {
    const float *points = desc->points;
    uint8_t *cuts = t->cuts;
    for (uint32_t i = 0; i < t->strand_count; i++) {
        const uint32_t length = t->lengths[i];
        for (uint32_t k = 0; k + 1 < length; k++) {
            const float *p[4];
            spline_points(points, length, k, p);
            const float tolerance = desc->tolerance * fmaxf(p[1][3], p[2][3]);
            cuts[k] =
                (uint8_t)cuts_of(bend_of(p[0], p[1], p[2], p[3]), tolerance, desc->piece_count);
        }
        cuts += length;
        points += POINT_FLOATS * (size_t)length;
    }
}

/* ---- counts ---- */

/* Of vertices and primitives. */
struct counts {
    uint64_t vertices, pieces;
};

/* cuts: of its points. */
static struct counts strand_counts(const uint8_t *cuts, uint32_t length) {
    struct counts c = {0, 0};
    for (uint32_t i = 0; i + 1 < length; i++)
        c.pieces += cuts[i];
    c.vertices = c.pieces ? c.pieces + 1 : 0;
    return c;
}

static trc_status check_lengths(const trc_curves_desc *desc) {
    uint64_t points = 0;
    for (uint64_t i = 0; desc->lengths && i < desc->strand_count; i++)
        points += desc->lengths[i];
    if (desc->lengths && points != desc->point_count)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "the lengths of strands sum up to %" PRIu64 ", but there are %" PRIu64
                        " points",
                        points, desc->point_count);
    return TRC_OK;
}

static trc_status check_counts(const struct counts *counts, uint32_t key_count) {
    if (counts->vertices > INT32_MAX / 4 || 4 * counts->vertices * key_count > INT32_MAX)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%" PRIu64 " ends of pieces at %u keys are too many",
                        counts->vertices, key_count);
    return TRC_OK;
}

static struct counts count_all(const struct trc_mesh_topology *t) {
    struct counts all = {0, 0};
    const uint8_t *cuts = t->cuts;
    if (!t->lengths)
        return (struct counts){t->point_count, t->point_count};
    for (uint32_t i = 0; i < t->strand_count; cuts += t->lengths[i++]) {
        const struct counts c = strand_counts(cuts, t->lengths[i]);
        all.vertices += c.vertices;
        all.pieces += c.pieces;
    }
    return all;
}

/* ---- from points to vertices ---- */

/* The spline's weights of the points p0 to p3, t from p1 to p2. */
static void spline_weights(float t, float w[4]) {
    const float t2 = t * t, t3 = t2 * t;
    w[0] = 0.5f * (-t + 2.0f * t2 - t3);
    w[1] = 0.5f * (2.0f - 5.0f * t2 + 3.0f * t3);
    w[2] = 0.5f * (t + 4.0f * t2 - 3.0f * t3);
    w[3] = 0.5f * (t3 - t2);
}

/* A vertex; NaN stays, as it takes its pieces out. */
static void vertex_store(const float p[4], float position[3], float *radius) {
    memcpy(position, p, 3 * sizeof *p);
    *radius = p[3] < 0.0f ? 0.0f : p[3];
}

/* The vertices of a strand of two points or more. */
static void strand_fill(const float *points, const uint8_t *cuts, uint32_t length, float *positions,
                        float *radii) {
    for (uint32_t i = 0; i + 1 < length; i++) {
        const float *p[4];
        spline_points(points, length, i, p);
        vertex_store(p[1], positions, radii++);
        positions += 3;
        for (uint32_t k = 1; k < cuts[i]; k++, positions += 3) {
            float w[4], v[POINT_FLOATS];
            spline_weights((float)k / (float)cuts[i], w);
            for (int axis = 0; axis < POINT_FLOATS; axis++)
                v[axis] =
                    w[0] * p[0][axis] + w[1] * p[1][axis] + w[2] * p[2][axis] + w[3] * p[3][axis];
            vertex_store(v, positions, radii++);
        }
    }
    vertex_store(points + POINT_FLOATS * (size_t)(length - 1), positions, radii);
}

/* The vertices of all strands at a key. */
static void key_fill(const struct trc_mesh_topology *t, const float *points, float *positions,
                     float *radii) {
    const uint8_t *cuts = t->cuts;
    for (uint32_t i = 0; !t->lengths && i < t->point_count; i++)
        vertex_store(points + POINT_FLOATS * (size_t)i, positions + 3 * (size_t)i, radii + i);
    for (uint32_t i = 0; t->lengths && i < t->strand_count; i++) {
        const uint32_t length = t->lengths[i];
        const uint64_t vertices = strand_counts(cuts, length).vertices;
        if (vertices)
            strand_fill(points, cuts, length, positions, radii);
        points += POINT_FLOATS * (size_t)length;
        cuts += length;
        positions += 3 * vertices;
        radii += vertices;
    }
}

static trc_status create_pose(struct trc_mesh_topology *topology, const struct counts *counts,
                              uint32_t key_count, const float *points, struct trc_mesh **mesh_out) {
    const size_t per_key = (size_t)POINT_FLOATS * topology->point_count,
                 vertices = counts->vertices;
    bool moves = false;
    for (uint32_t key = 1; key < key_count && !moves; key++)
        moves = memcmp(points, points + per_key * key, per_key * sizeof *points) != 0;
    key_count = moves ? key_count : 1;
    struct trc_mesh *mesh;
    TRC_TRY(trc_geometry_alloc(topology, (uint32_t)vertices, (uint32_t)counts->pieces, key_count,
                               &mesh));
    mesh->radii = trc_alloc(vertices * key_count, sizeof *mesh->radii);
    if (!mesh->radii) {
        trc_geometry_release(mesh);
        return no_memory();
    }
    for (uint32_t key = 0; key < key_count; key++)
        key_fill(topology, points + per_key * key, mesh->positions + 3 * vertices * key,
                 mesh->radii + vertices * key);
    trc_geometry_bound(mesh);
    *mesh_out = mesh;
    return TRC_OK;
}

/* ---- what does not move ---- */

/* Strands are numbered without those that have no pieces, so that each has a vertex more than
 * pieces. */
static void strands_fill(const struct trc_mesh_topology *t, uint64_t piece_count,
                         uint32_t *strands) {
    const uint8_t *cuts = t->cuts;
    uint32_t number = 0;
    if (!t->lengths)
        memset(strands, 0, piece_count * sizeof *strands);
    for (uint32_t i = 0; t->lengths && i < t->strand_count; cuts += t->lengths[i++]) {
        const uint64_t pieces = strand_counts(cuts, t->lengths[i]).pieces;
        for (uint64_t k = 0; k < pieces; k++)
            *strands++ = number;
        number += pieces > 0;
    }
}

/* Values of strands, for each of their vertices. */
static void spread_strands(const struct trc_mesh_topology *t, const float *values, uint32_t width,
                           float *out) {
    const uint8_t *cuts = t->cuts;
    for (uint32_t i = 0; i < t->strand_count; i++, values += width) {
        uint64_t count = 1;
        if (t->lengths) {
            count = strand_counts(cuts, t->lengths[i]).vertices;
            cuts += t->lengths[i];
        }
        for (uint64_t k = 0; k < count; k++, out += width)
            memcpy(out, values, width * sizeof *out);
    }
}

/* Values of points, on straight lines between them. */
static void spread_points(const struct trc_mesh_topology *t, const float *values, uint32_t width,
                          float *out) {
    const uint8_t *cuts = t->cuts;
    if (!t->lengths) {
        if (t->point_count)
            memcpy(out, values, (size_t)t->point_count * width * sizeof *out);
        return;
    }
    for (uint32_t i = 0; i < t->strand_count; i++) {
        const uint32_t length = t->lengths[i];
        for (uint32_t p = 0; p + 1 < length; p++)
            for (uint32_t k = 0; k < cuts[p]; k++, out += width) {
                const float f = (float)k / (float)cuts[p];
                const float *a = values + (size_t)p * width, *b = a + width;
                for (uint32_t c = 0; c < width; c++)
                    out[c] = a[c] + f * (b[c] - a[c]);
            }
        if (length > 1) {
            memcpy(out, values + (size_t)(length - 1) * width, width * sizeof *out);
            out += width;
        }
        values += (size_t)length * width;
        cuts += length;
    }
}

static trc_status add_attribute(struct trc_mesh_topology *t, const trc_curve_attribute *desc,
                                uint64_t vertices, struct trc_names *names) {
    struct trc_attribute *a = &t->attributes[t->attribute_count];
    a->width = desc->width;
    a->strands = t->strands;
    a->piece_end = !trc_shape_is_balls(t->shape);
    TRC_TRY(trc_names_add(names, desc->name, &a->name));
    a->values = trc_alloc(vertices * desc->width, sizeof *a->values);
    if (!a->values)
        return no_memory();
    if (desc->width == 2 && desc->per_strand && t->lengths && t->default_uv < 0)
        t->default_uv = (int32_t)t->attribute_count;
    t->attribute_count++;
    t->bytes += vertices * desc->width * sizeof *a->values;
    (desc->per_strand ? spread_strands : spread_points)(t, desc->values, desc->width, a->values);
    trc_clear_bad_values(a->values, vertices * desc->width);
    return TRC_OK;
}

#define GENERATED_FLOATS 3

static uint32_t shape_of(const trc_curves_desc *desc) {
    static const uint32_t shapes[] = {[TRC_CURVE_RIBBON] = TRC_SHAPE_RIBBONS,
                                      [TRC_CURVE_ROUND] = TRC_SHAPE_ROUND,
                                      [TRC_CURVE_BALL] = TRC_SHAPE_BALLS,
                                      [TRC_CURVE_HOLLOW_BALL] = TRC_SHAPE_HOLLOW_BALLS};
    return shapes[desc->shape];
}

/* What strands there are, and how they are cut. */
static trc_status fill_strands(struct trc_mesh_topology *t, const trc_curves_desc *desc) {
    t->shape = shape_of(desc);
    t->normal_kind = TRC_NORMALS_NONE;
    t->point_count = (uint32_t)desc->point_count;
    t->strand_count = (uint32_t)(desc->lengths ? desc->strand_count : desc->point_count);
    if (!desc->lengths)
        return TRC_OK;
    if (!trc_topology_copy(t, desc->lengths, desc->strand_count, sizeof(uint32_t), &t->lengths))
        return no_memory();
    t->cuts = trc_alloc(desc->point_count, sizeof *t->cuts);
    if (!t->cuts)
        return no_memory();
    t->bytes += desc->point_count * sizeof *t->cuts;
    cuts_fill(t, desc);
    return TRC_OK;
}

static trc_status fill_topology(struct trc_mesh_topology *t, const trc_curves_desc *desc,
                                struct trc_names *names, struct counts *counts) {
    TRC_TRY(fill_strands(t, desc));
    *counts = count_all(t);
    TRC_TRY(check_counts(counts, desc->key_count));
    t->strands = trc_alloc(counts->pieces, sizeof *t->strands);
    if (!t->strands)
        return no_memory();
    t->bytes += counts->pieces * sizeof *t->strands;
    strands_fill(t, counts->pieces, t->strands);
    if (desc->generated) {
        const uint64_t count = GENERATED_FLOATS * counts->vertices;
        t->generated = trc_alloc(count, sizeof *t->generated);
        if (!t->generated)
            return no_memory();
        t->bytes += count * sizeof *t->generated;
        spread_strands(t, desc->generated, GENERATED_FLOATS, t->generated);
        trc_clear_bad_values(t->generated, count);
    }
    TRC_TRY(trc_topology_expect_attributes(t, desc->attribute_count));
    for (uint32_t i = 0; i < desc->attribute_count; i++)
        TRC_TRY(add_attribute(t, &desc->attributes[i], counts->vertices, names));
    return TRC_OK;
}

trc_status trc_curves_geometry_create(const trc_curves_desc *desc, struct trc_names *names,
                                      struct trc_mesh **mesh_out) {
    struct counts counts;
    TRC_TRY(check_lengths(desc));
    struct trc_mesh_topology *topology = trc_alloc_zeroed(1, sizeof *topology);
    if (!topology)
        return no_memory();
    atomic_init(&topology->refs, 1);
    const trc_status status = fill_topology(topology, desc, names, &counts);
    if (status != TRC_OK) {
        trc_topology_release(topology);
        return status;
    }
    return create_pose(topology, &counts, desc->key_count, desc->points, mesh_out);
}

trc_status trc_curves_geometry_pose(const struct trc_mesh *from, uint32_t key_count,
                                    const float *points, uint64_t point_value_count,
                                    struct trc_mesh **mesh_out) {
    struct trc_mesh_topology *topology = ((const struct trc_geometry *)from)->topology;
    const struct counts counts = {from->vertex_count, from->triangle_count};
    if (!topology->strands)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the mesh is not of curves");
    TRC_TRY(trc_check_array(points, point_value_count,
                            (uint64_t)POINT_FLOATS * topology->point_count * key_count,
                            sizeof(float), sizeof(float), "points"));
    TRC_TRY(check_counts(&counts, key_count));
    atomic_fetch_add(&topology->refs, 1);
    return create_pose(topology, &counts, key_count, points, mesh_out);
}
