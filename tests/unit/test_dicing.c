/* Dicing: no crack opens, edges are as short as asked, what is carried stays linear, the limit of
 * Catmull-Clark is met, creases are as sharp as they say, memory may end. */
#include "fixture.h"

#include <stdlib.h>

#include "core/core.h"
#include "dicing/catmull_clark.h"
#include "dicing/dicing.h"
#include "dicing/face_joining.h"

/* A cube from -1 to 1 of six quadrilaterals. */
static const uint32_t quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};

struct cube {
    float positions[24], normals[24], generated[24], uv[72];
    uint32_t indices[36], faces[12];
    uint16_t slots[12];
    uint8_t smooth[12];
    uint32_t crease_edges[24];
    float crease_sharpness[12], vertex_sharpness[8];
    trc_corner_attribute attribute;
    trc_dicing_desc dicing;
    trc_mesh_desc desc;
};

static void fill_triangles(struct cube *c) {
    static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
    for (uint32_t i = 0; i < 36; i++) {
        const uint32_t vertex = quads[i / 6][corners[i % 6]];
        c->indices[i] = vertex;
        c->uv[2 * i] = c->positions[3 * vertex]; /* linear in the position: so it must stay */
        c->uv[2 * i + 1] = c->positions[3 * vertex + 1] - c->positions[3 * vertex + 2];
        c->faces[i / 3] = i / 6;
        c->slots[i / 3] = (uint16_t)(i / 6);
        c->smooth[i / 3] = i / 6 == 2;
    }
}

static void build(struct cube *c, uint32_t surface, float side) {
    memset(c, 0, sizeof *c);
    for (uint32_t i = 0; i < 24; i++) {
        c->positions[i] = i / 3 >> (i % 3) & 1 ? 1.0f : -1.0f;
        c->normals[i] = c->positions[i] / sqrtf(3.0f);
        c->generated[i] = 0.5f + 0.5f * c->positions[i];
    }
    fill_triangles(c);
    c->attribute = trc_corner_attribute_default();
    c->attribute.name = "UV";
    c->attribute.values = c->uv;
    c->attribute.value_count = 72;
    c->dicing = trc_dicing_desc_default();
    c->dicing.surface = surface;
    c->dicing.side = side;
    c->dicing.faces = c->faces;
    c->dicing.face_count = 12;
    c->desc = trc_mesh_desc_default();
    c->desc.vertex_count = 8;
    c->desc.triangle_count = 12;
    c->desc.positions = c->positions;
    c->desc.position_count = 24;
    c->desc.indices = c->indices;
    c->desc.index_count = 36;
    c->desc.smooth = c->smooth;
    c->desc.material_index = c->slots;
    c->desc.generated = c->generated;
    c->desc.generated_count = 24;
    c->desc.attributes = &c->attribute;
    c->desc.attribute_count = 1;
    c->desc.dicing = &c->dicing;
}

static void crease_edge(struct cube *c, uint32_t a, uint32_t b, float sharpness) {
    c->crease_edges[2 * c->dicing.crease_count] = a;
    c->crease_edges[2 * c->dicing.crease_count + 1] = b;
    c->crease_sharpness[c->dicing.crease_count++] = sharpness;
    c->dicing.crease_edges = c->crease_edges;
    c->dicing.crease_sharpness = c->crease_sharpness;
    c->dicing.crease_edge_count = 2 * c->dicing.crease_count;
}

/* The edges around the side of z = 1. */
static void crease_ring(struct cube *c, float sharpness) {
    for (uint32_t k = 0; k < 4; k++)
        crease_edge(c, quads[1][(k + 1) % 4], quads[1][k], sharpness);
}

static void crease_vertex(struct cube *c, uint32_t vertex, float sharpness) {
    c->vertex_sharpness[vertex] = sharpness;
    c->dicing.vertex_sharpness = c->vertex_sharpness;
    c->dicing.vertex_sharpness_count = 8;
}

static struct trc_diced_mesh dice(const struct cube *c) {
    struct trc_diced_mesh diced;
    assert_int_equal(trc_dice(&c->desc, &diced), TRC_OK);
    assert_null(diced.desc.dicing);
    return diced;
}

static const float *corner(const struct trc_diced_mesh *m, size_t c) {
    return m->positions + 3 * (size_t)m->indices[c];
}

static int compare_edges(const void *a, const void *b) {
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Each edge of each triangle belongs to one other, which runs along it the other way: there is no
 * crack and no vertex on an edge. */
static void expect_closed(const struct trc_diced_mesh *m) {
    const size_t count = 3 * (size_t)m->desc.triangle_count;
    uint64_t *there = malloc(count * sizeof *there), *back = malloc(count * sizeof *back);
    assert_true(there && back);
    for (size_t c = 0; c < count; c++) {
        const uint64_t a = m->indices[c], b = m->indices[c / 3 * 3 + (c + 1) % 3];
        there[c] = a << 32 | b;
        back[c] = b << 32 | a;
    }
    qsort(there, count, sizeof *there, compare_edges);
    qsort(back, count, sizeof *back, compare_edges);
    for (size_t i = 0; i < count; i++) {
        assert_true(there[i] == back[i]);
        assert_true(!i || there[i] != there[i - 1]);
    }
    free(there);
    free(back);
}

static double volume_of(const struct trc_diced_mesh *m) {
    double volume = 0;
    for (size_t t = 0; t < m->desc.triangle_count; t++) {
        const float *a = corner(m, 3 * t), *b = corner(m, 3 * t + 1), *c = corner(m, 3 * t + 2);
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            volume += (double)a[i] * ((double)b[j] * c[k] - (double)b[k] * c[j]) / 6;
        }
    }
    return volume;
}

/* The longest edge over the side at its nearest point, distances from eye where that is not NULL.
 */
static double longest_edge(const struct trc_diced_mesh *m, const float *eye) {
    double longest = 0;
    for (size_t c = 0; c < 3 * m->desc.triangle_count; c++) {
        const float *a = corner(m, c), *b = corner(m, c / 3 * 3 + (c + 1) % 3);
        double square = 0, near_a = 0, near_b = 0;
        for (int i = 0; i < 3; i++) {
            square += ((double)a[i] - b[i]) * ((double)a[i] - b[i]);
            near_a += eye ? ((double)a[i] - eye[i]) * ((double)a[i] - eye[i]) : 1.0 / 3;
            near_b += eye ? ((double)b[i] - eye[i]) * ((double)b[i] - eye[i]) : 1.0 / 3;
        }
        longest = fmax(longest, sqrt(square / fmin(near_a, near_b)));
    }
    return longest;
}

static void linear_cubes(void **state) {
    (void)state;
    struct cube c;
    build(&c, TRC_DICING_LINEAR, 0.11f);
    c.desc.normals = c.normals;
    c.desc.normal_count = 24;
    c.desc.normal_kind = TRC_NORMALS_VERTEX;
    struct trc_diced_mesh m = dice(&c);
    expect_closed(&m);
    assert_true(fabs(volume_of(&m) - 8) < 1e-6);
    assert_true(longest_edge(&m, NULL) <= 0.11 * sqrt(2.0) * (1 + 1e-6));
    assert_true(longest_edge(&m, NULL) > 0.11 / sqrt(2.0)); /* no finer than it must */
    for (size_t i = 0; i < 3 * m.desc.triangle_count; i++) {
        const float *p = corner(&m, i), *n = m.normals + 3 * (size_t)m.indices[i];
        const uint32_t face = m.material_index[i / 3];
        const int axis = face < 2 ? 2 : face < 4 ? 1 : 0;
        assert_true(fabsf(fabsf(p[axis]) - 1) < 1e-6f);
        assert_int_equal(m.smooth[i / 3], face == 2);
        assert_true(fabsf(m.values[0][2 * i] - p[0]) < 1e-6f);
        assert_true(fabsf(m.values[0][2 * i + 1] - (p[1] - p[2])) < 1e-6f);
        for (size_t k = 0; k < 3; k++) {
            const float length = sqrtf(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
            assert_true(fabsf(m.generated[3 * (size_t)m.indices[i] + k] - (0.5f + 0.5f * p[k])) <
                        1e-6f);
            assert_true(fabsf(n[k] - p[k] / length) < 1e-5f); /* of linear means, unit */
        }
    }
    trc_diced_mesh_free(&m);
}

/* Edges near the camera become short, those far from it less so; without a crack between. */
static void cameras(void **state) {
    (void)state;
    static const float eye[3] = {0, 0, 1.5f};
    size_t counts[2];
    for (int round = 0; round < 2; round++) {
        struct cube c;
        build(&c, TRC_DICING_LINEAR, 0.05f);
        c.dicing.space = TRC_DICING_CENTRAL;
        c.dicing.object_to_camera[11] = -eye[2];
        if (round) { /* of what is shown, the middle of the near side alone is inside */
            c.dicing.window[0] = c.dicing.window[2] = -0.1f;
            c.dicing.window[1] = c.dicing.window[3] = 0.1f;
            c.dicing.offscreen_scale = 4;
        }
        struct trc_diced_mesh m = dice(&c);
        expect_closed(&m);
        assert_true(fabs(volume_of(&m) - 8) < 1e-6);
        const double longest = longest_edge(&m, eye);
        assert_true(round ? longest > 0.1 : longest <= 0.05 * sqrt(2.0) * (1 + 1e-5));
        counts[round] = m.desc.triangle_count;
        trc_diced_mesh_free(&m);
    }
    assert_true(2 * counts[1] < counts[0]);
}

/* Of a cube, corners go to half their distance and the middles of faces to 68 / 81 of it: the
 * masks of the limit, by hand. */
static void catmull_clark(void **state) {
    (void)state;
    for (uint32_t levels = 1; levels < 4; levels++) {
        struct cube c;
        build(&c, TRC_DICING_CATMULL_CLARK, 0.01f);
        c.dicing.max_subdivisions = levels;
        struct trc_diced_mesh m = dice(&c);
        expect_closed(&m);
        float highest = 0;
        for (size_t v = 0; v < m.desc.vertex_count; v++)
            highest = fmaxf(highest, m.positions[3 * v + 2]);
        assert_true(fabsf(highest - 68.0f / 81.0f) < 1e-6f);
        for (size_t v = 0; v < 8; v++)
            for (size_t i = 0; i < 3; i++)
                assert_true(fabsf(m.positions[3 * v + i] - 0.5f * c.positions[3 * v + i]) < 1e-6f);
        assert_int_equal(m.desc.triangle_count, 12u << 2 * levels);
        assert_true(!m.is_coarse);
        trc_diced_mesh_free(&m);
    }
}

/* Levels that are even all over and halves of single edges make one surface. */
static void curved_edges_follow(void **state) {
    (void)state;
    struct cube even, halves;
    build(&even, TRC_DICING_CATMULL_CLARK, 0.02f);
    struct trc_diced_mesh m = dice(&even);
    const double expected = volume_of(&m);
    expect_closed(&m);
    trc_diced_mesh_free(&m);

    build(&halves, TRC_DICING_CATMULL_CLARK, 0.3f);
    struct trc_diced_mesh coarse = dice(&halves);
    trc_dicing_desc dicing = trc_dicing_desc_default();
    dicing.surface = TRC_DICING_CURVED;
    dicing.side = 0.02f;
    coarse.desc.dicing = &dicing;
    const double before = volume_of(&coarse);
    assert_int_equal(trc_dice(&coarse.desc, &m), TRC_OK);
    expect_closed(&m);
    /* Within a tenth of what the flat triangles lack. */
    assert_true(expected - before > 1e-2);
    assert_true(fabs(volume_of(&m) - expected) < 0.1 * (expected - before));
    trc_diced_mesh_free(&coarse);
    trc_diced_mesh_free(&m);
}

/* A square of two triangles: its boundary is smooth but for its corners, if they are sharp. */
static void open_boundaries(void **state) {
    (void)state;
    for (uint32_t sharp = 0; sharp < 2; sharp++) {
        struct cube c;
        build(&c, TRC_DICING_CATMULL_CLARK, 0.02f);
        c.desc.triangle_count = 2;
        c.desc.index_count = 6;
        c.attribute.value_count = 12;
        c.dicing.face_count = 2;
        c.dicing.sharp_corners = sharp;
        struct trc_diced_mesh m = dice(&c);
        double area = 0;
        for (size_t t = 0; t < m.desc.triangle_count; t++) {
            const float *a = corner(&m, 3 * t), *b = corner(&m, 3 * t + 1),
                        *d = corner(&m, 3 * t + 2);
            area += 0.5 * fabs((double)(b[0] - a[0]) * (d[1] - a[1]) -
                               (double)(b[1] - a[1]) * (d[0] - a[0]));
        }
        /* Of a closed cubic B-spline over a square of 4 m^2: 61 / 90 of it. */
        assert_true(fabs(area - (sharp ? 4.0 : 4.0 * 61 / 90)) < 2e-3);
        trc_diced_mesh_free(&m);
    }
}

/* The faces after one level; new vertices: those of the cube, then one of each edge. */
static struct trc_faces one_level(const struct cube *c) {
    const struct trc_row_layout rows = trc_row_layout_of(&c->desc);
    struct trc_faces f;
    assert_int_equal(trc_join_faces(&rows, &c->desc, &f), TRC_OK);
    assert_int_equal(trc_catmull_clark_subdivide(&f), TRC_OK);
    return f;
}

static void expect_vertex(const struct trc_faces *f, size_t vertex, double x, double y, double z) {
    const float *p = f->vertices + f->vertex_width * vertex;
    assert_true(fabs(p[0] - x) < 1e-6 && fabs(p[1] - y) < 1e-6 && fabs(p[2] - z) < 1e-6);
}

/* The new vertex between two of the cube's. */
static size_t middle_of(const struct trc_faces *f, uint32_t a, uint32_t b) {
    for (size_t c = 0; c < 4 * (size_t)f->face_count; c += 4)
        for (size_t d = 0; d < 4 * (size_t)f->face_count; d += 4)
            if (f->indices[c] == a && f->indices[d] == b && f->indices[c + 1] == f->indices[d + 3])
                return f->indices[c + 1];
    fail();
    return 0;
}

static double blended(double smooth, double sharp, double sharpness) {
    return smooth + (sharp - smooth) * fmin(sharpness, 1);
}

/* Of (1, 1, 1) and of an edge of it: smooth, they go to 5/9 and 3/4; along the ring, to 3/4 and, in
 * z and across the edge, nowhere. */
static void creases_blend(void **state) {
    (void)state;
    static const float sharpness[] = {0, 0.25f, 0.75f, 1, 1.5f, 4, 9.75f, 10};
    for (size_t i = 0; i < sizeof sharpness / sizeof *sharpness; i++) {
        const double s = sharpness[i];
        struct cube c;
        build(&c, TRC_DICING_CATMULL_CLARK, 1);
        crease_ring(&c, sharpness[i]);
        struct trc_faces f = one_level(&c);
        const double along = blended(5.0 / 9, 0.75, s), z = blended(5.0 / 9, 1, s);
        expect_vertex(&f, 7, along, along, z);
        expect_vertex(&f, middle_of(&f, 6, 7), 0, blended(0.75, 1, s), blended(0.75, 1, s));
        expect_vertex(&f, middle_of(&f, 3, 7), 0.75, 0.75, 0);
        expect_vertex(&f, 3, 5.0 / 9, 5.0 / 9, -5.0 / 9);
        const float after = s >= 10 ? sharpness[i] : fmaxf(sharpness[i] - 1, 0);
        size_t sharp_count = 0;
        for (size_t k = 0; k < 4 * (size_t)f.face_count; k++) {
            assert_true(f.edge_sharpness[k] == after || f.edge_sharpness[k] == 0);
            sharp_count += f.edge_sharpness[k] > 0;
        }
        assert_int_equal(sharp_count, after > 0 ? 16 : 0); /* 4 edges, 2 halves, 2 faces */
        trc_faces_free(&f);
    }
}

/* One sharp edge ends smoothly, three are a corner, whose fainter edge leaves a crease. */
static void ends_and_corners_of_creases(void **state) {
    (void)state;
    struct cube c;
    build(&c, TRC_DICING_CATMULL_CLARK, 1);
    crease_edge(&c, 6, 7, 10);
    struct trc_faces f = one_level(&c);
    expect_vertex(&f, 7, 5.0 / 9, 5.0 / 9, 5.0 / 9);
    expect_vertex(&f, middle_of(&f, 6, 7), 0, 1, 1);
    trc_faces_free(&f);

    for (uint32_t k = 0; k < 4; k++) {
        build(&c, TRC_DICING_CATMULL_CLARK, 1);
        crease_ring(&c, 10);
        crease_edge(&c, 7, 3, 0.5f * (float)k);
        f = one_level(&c);
        expect_vertex(&f, 7, blended(0.75, 1, 0.5 * k), blended(0.75, 1, 0.5 * k), 1);
        trc_faces_free(&f);
    }
    /* What ends together counts by its mean: two edges and the vertex, of 0.75. */
    build(&c, TRC_DICING_CATMULL_CLARK, 1);
    crease_ring(&c, 0.75f);
    crease_vertex(&c, 7, 0.25f);
    f = one_level(&c);
    const double corner = blended(5.0 / 9, 1, (0.75 + 0.75 + 0.25) / 3);
    expect_vertex(&f, 7, corner, corner, corner);
    trc_faces_free(&f);
}

static void creased_vertices(void **state) {
    (void)state;
    static const float sharpness[] = {0.25f, 1, 2.5f};
    struct cube c;
    for (size_t i = 0; i < 3; i++) {
        build(&c, TRC_DICING_CATMULL_CLARK, 1);
        crease_vertex(&c, 7, sharpness[i]);
        struct trc_faces f = one_level(&c);
        const double place = blended(5.0 / 9, 1, sharpness[i]);
        expect_vertex(&f, 7, place, place, place);
        assert_true(f.vertex_sharpness[7] == fmaxf(sharpness[i] - 1, 0));
        expect_vertex(&f, 6, -5.0 / 9, 5.0 / 9, 5.0 / 9);
        trc_faces_free(&f);
    }
    build(&c, TRC_DICING_CATMULL_CLARK, 0.1f);
    crease_vertex(&c, 7, 10);
    struct trc_diced_mesh m = dice(&c);
    expect_closed(&m);
    for (int i = 0; i < 3; i++)
        assert_true(m.positions[3 * 7 + i] == 1 && fabsf(m.positions[i] + 0.5f) < 1e-6f);
    trc_diced_mesh_free(&m);
}

static double area_of_slot(const struct trc_diced_mesh *m, uint16_t slot) {
    double area = 0;
    for (size_t t = 0; t < m->desc.triangle_count; t++) {
        const float *a = corner(m, 3 * t), *b = corner(m, 3 * t + 1), *c = corner(m, 3 * t + 2);
        double square = 0;
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            const double part = ((double)b[j] - a[j]) * ((double)c[k] - a[k]) -
                                ((double)b[k] - a[k]) * ((double)c[j] - a[j]);
            square += part * part;
        }
        area += m->material_index[t] == slot ? 0.5 * sqrt(square) : 0;
    }
    return area;
}

/* What a crease for ever surrounds is as if it had been cut out. */
static void creases_cut(void **state) {
    (void)state;
    struct cube c;
    build(&c, TRC_DICING_CATMULL_CLARK, 0.05f);
    crease_ring(&c, 10);
    struct trc_diced_mesh m = dice(&c);
    expect_closed(&m);
    for (size_t k = 0; k < m.desc.index_count; k++)
        assert_true(m.material_index[k / 3] != 1 || fabsf(corner(&m, k)[2] - 1) < 1e-6f);
    const double area = area_of_slot(&m, 1);
    trc_diced_mesh_free(&m);

    build(&c, TRC_DICING_CATMULL_CLARK, 0.05f);
    memcpy(c.indices, c.indices + 6, 6 * sizeof *c.indices); /* that side alone */
    c.desc.triangle_count = 2;
    c.desc.index_count = 6;
    c.attribute.value_count = 12;
    c.dicing.face_count = 2;
    m = dice(&c);
    assert_true(fabs(area_of_slot(&m, 0) - area) < 1e-6);
    trc_diced_mesh_free(&m);
}

/* With all edges sharp for ever a cube stays one; a sharpness of 0 is none. */
static void all_edges_creased(void **state) {
    (void)state;
    double volumes[3];
    for (int round = 0; round < 3; round++) {
        struct cube c;
        build(&c, TRC_DICING_CATMULL_CLARK, 0.1f);
        for (uint32_t a = 0; a < 8 && round; a++)
            for (uint32_t bit = 1; bit < 8; bit *= 2)
                if (!(a & bit))
                    crease_edge(&c, a, a | bit, round == 1 ? 0 : 10);
        if (round == 1)
            crease_vertex(&c, 0, 0);
        struct trc_diced_mesh m = dice(&c);
        expect_closed(&m);
        volumes[round] = volume_of(&m);
        trc_diced_mesh_free(&m);
    }
    assert_true(volumes[1] == volumes[0]);
    assert_true(fabs(volumes[2] - 8) < 1e-6);
}

static void keys_move_alike(void **state) {
    (void)state;
    struct cube c;
    float positions[48];
    build(&c, TRC_DICING_CATMULL_CLARK, 0.2f);
    memcpy(positions, c.positions, sizeof c.positions);
    for (int i = 0; i < 24; i++)
        positions[24 + i] = c.positions[i] + (i % 3 == 0 ? 3.0f : 0.0f);
    c.desc.key_count = 2;
    c.desc.positions = positions;
    c.desc.position_count = 48;
    struct trc_diced_mesh m = dice(&c);
    const size_t floats = 3 * (size_t)m.desc.vertex_count;
    assert_int_equal(m.desc.position_count, 2 * floats);
    for (size_t i = 0; i < floats; i++)
        assert_true(fabsf(m.positions[floats + i] - m.positions[i] - (i % 3 == 0 ? 3.0f : 0.0f)) <
                    1e-5f);
    trc_diced_mesh_free(&m);
}

/* A limit ends the dicing between two passes, and the commit says so. */
static void limits_are_kept(void **state) {
    (void)state;
    for (uint32_t surface = 0; surface <= TRC_DICING_CATMULL_CLARK; surface++) {
        struct cube c;
        build(&c, surface, 0.01f);
        c.dicing.triangle_max = 1000;
        struct trc_diced_mesh m = dice(&c);
        expect_closed(&m);
        assert_true(m.is_coarse);
        assert_in_range(m.desc.triangle_count, 200, 1000);
        trc_diced_mesh_free(&m);

        const trc_scene_desc scene_desc = default_scene_desc();
        trc_scene scene;
        trc_id id;
        char warnings[256] = "";
        assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
        assert_int_equal(trc_mesh_create(scene, &c.desc, &id), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        assert_int_equal(trc_scene_get_warnings(scene, warnings, sizeof warnings, NULL), TRC_OK);
        assert_non_null(strstr(warnings, "1 meshes are diced more coarsely than asked"));
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

/* What is not finite, nothing at all, and an index out of range. */
static void odd_meshes(void **state) {
    (void)state;
    struct cube c;
    for (uint32_t surface = 0; surface <= TRC_DICING_CATMULL_CLARK; surface++) {
        build(&c, surface, 0.2f);
        c.positions[4] = NAN;
        c.positions[8] = INFINITY;
        struct trc_diced_mesh m = dice(&c);
        expect_closed(&m);
        trc_diced_mesh_free(&m);

        build(&c, surface, 0.2f);
        c.dicing.faces = NULL;
        memset(c.faces, 0, sizeof c.faces); /* all of a cube is no face */
        c.dicing.faces = surface ? c.faces : NULL;
        m = dice(&c);
        expect_closed(&m);
        trc_diced_mesh_free(&m);

        build(&c, surface, 0.2f);
        c.desc.triangle_count = c.desc.index_count = c.attribute.value_count = 0;
        m = dice(&c);
        assert_int_equal(m.desc.triangle_count, 0);
        trc_diced_mesh_free(&m);

        build(&c, surface, 0.2f);
        c.indices[35] = 8;
        assert_int_equal(trc_dice(&c.desc, &m), TRC_ERROR_INVALID_ARGUMENT);
    }
}

static void memory_may_end(void **state) {
    (void)state;
    for (uint32_t surface = 0; surface <= TRC_DICING_CATMULL_CLARK; surface++) {
        struct cube c;
        build(&c, surface, 0.05f);
        crease_ring(&c, 2.5f);
        crease_vertex(&c, 0, 10);
        const uint64_t bytes = trc_memory_bytes();
        trc_status status = TRC_ERROR_OUT_OF_MEMORY;
        int failures = 0;
        for (; status != TRC_OK && failures < 1000; failures++) {
            struct trc_diced_mesh m;
            trc_memory_fail_at(failures, true);
            status = trc_dice(&c.desc, &m);
            trc_memory_fail_at(-1, false);
            assert_true(status == TRC_OK || status == TRC_ERROR_OUT_OF_MEMORY);
            if (status == TRC_OK)
                trc_diced_mesh_free(&m);
            assert_true(trc_memory_bytes() == bytes);
        }
        assert_int_equal(status, TRC_OK);
        assert_true(failures > 20);
    }
}

#define REFUSED(status, change)                                         \
    do {                                                                \
        build(&c, TRC_DICING_CATMULL_CLARK, 1);                         \
        change;                                                         \
        assert_int_equal(trc_mesh_create(scene, &c.desc, &id), status); \
    } while (0)

static void bad_descriptors(void **state) {
    (void)state;
    const trc_scene_desc scene_desc = default_scene_desc();
    struct cube c;
    trc_scene scene;
    trc_id id;
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    REFUSED(TRC_ERROR_STRUCT_SIZE, c.dicing.struct_size = 8);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.surface = 3);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.space = 3);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.sharp_corners = 2);
    REFUSED(TRC_ERROR_TOO_LARGE, c.dicing.max_subdivisions = 17);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.side = 0);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.side = NAN);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.object_to_camera[3] = NAN);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.window[3] = INFINITY);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.offscreen_scale = 0.5f);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.face_count = 11);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, c.dicing.faces = NULL);
    REFUSED(TRC_OK, c.dicing.faces = NULL; c.dicing.face_count = 0);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_ring(&c, 1); c.dicing.crease_edge_count = 7);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_ring(&c, 1); c.dicing.crease_edges = NULL);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_ring(&c, 1); c.dicing.crease_sharpness = NULL);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_edge(&c, 7, 8, 1));
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_edge(&c, 7, 6, -1));
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_edge(&c, 7, 6, NAN));
    REFUSED(TRC_ERROR_TOO_LARGE, crease_edge(&c, 7, 6, 1); c.dicing.crease_count = UINT64_MAX / 2);
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_vertex(&c, 7, -1));
    REFUSED(TRC_ERROR_INVALID_ARGUMENT, crease_vertex(&c, 7, 1);
            c.dicing.vertex_sharpness_count = 7);
    REFUSED(TRC_OK, crease_edge(&c, 7, 0, 1); crease_vertex(&c, 7, 1)); /* no edge, a diagonal */
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(linear_cubes),
        cmocka_unit_test(cameras),
        cmocka_unit_test(catmull_clark),
        cmocka_unit_test(curved_edges_follow),
        cmocka_unit_test(open_boundaries),
        cmocka_unit_test(creases_blend),
        cmocka_unit_test(ends_and_corners_of_creases),
        cmocka_unit_test(creased_vertices),
        cmocka_unit_test(creases_cut),
        cmocka_unit_test(all_edges_creased),
        cmocka_unit_test(keys_move_alike),
        cmocka_unit_test(limits_are_kept),
        cmocka_unit_test(odd_meshes),
        cmocka_unit_test(memory_may_end),
        cmocka_unit_test(bad_descriptors),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
