/* Tangents at corners: of planes, against brute force, and what they are told by. */
#include "fixture.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "figures.h"
#include "rng.h"
#include "tracer/tangents.h"

enum { MOST_TRIANGLES = 48, MOST_CORNERS = 3 * MOST_TRIANGLES };

/* Triangles by their corners. */
struct soup {
    uint32_t triangles;
    float positions[3 * MOST_CORNERS], normals[3 * MOST_CORNERS], uvs[2 * MOST_CORNERS];
};

static trc_tangents_desc desc_of(const struct soup *s) {
    trc_tangents_desc desc = trc_tangents_desc_default();
    desc.triangle_count = s->triangles;
    desc.positions = s->positions;
    desc.normals = s->normals;
    desc.uvs = s->uvs;
    return desc;
}

static void set_corner(struct soup *s, uint32_t corner, const float position[3],
                       const float normal[3], const float uv[2]) {
    memcpy(s->positions + 3 * corner, position, 3 * sizeof(float));
    memcpy(s->normals + 3 * corner, normal, 3 * sizeof(float));
    memcpy(s->uvs + 2 * corner, uv, 2 * sizeof(float));
}

/* The tangents in both forms; how many corners there are. */
static uint32_t find_both(const struct soup *s, float *vectors, float *told) {
    const trc_tangents_desc desc = desc_of(s);
    const uint32_t corners = 3 * s->triangles;
    assert_int_equal(trc_tangents_find(&desc, TRC_TANGENTS_VECTORS, vectors, 3 * corners), TRC_OK);
    assert_int_equal(trc_tangents_find(&desc, TRC_TANGENTS_COORDINATES, told, 4 * corners), TRC_OK);
    return corners;
}

/* A square of so many pieces to a side in the plane z = 0, U turned by an angle, mirrored or not.
 */
static void lay_plane(struct soup *s, uint32_t side, double angle, bool is_mirrored) {
    static const float up[3] = {0, 0, 1};
    static const uint32_t steps[6][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
    s->triangles = 2 * side * side;
    for (uint32_t corner = 0; corner < 3 * s->triangles; corner++) {
        const uint32_t square = corner / 6, *step = steps[corner % 6];
        const float at[3] = {(float)(square % side + step[0]), (float)(square / side + step[1]), 0};
        const double u = cos(angle) * (double)at[0] + sin(angle) * (double)at[1];
        const double v = cos(angle) * (double)at[1] - sin(angle) * (double)at[0];
        const float uv[2] = {(float)u, (float)(is_mirrored ? -v : v)};
        set_corner(s, corner, at, up, uv);
    }
}

static void planes(void **state) {
    (void)state;
    static struct soup s;
    static float vectors[3 * MOST_CORNERS], told[4 * MOST_CORNERS];
    for (int kind = 0; kind < 8; kind++) {
        const double angle = 0.3 + 0.7 * kind;
        lay_plane(&s, 3, angle, kind & 1);
        const uint32_t corners = find_both(&s, vectors, told);
        for (uint32_t i = 0; i < corners; i++) {
            assert_float_equal(vectors[3 * i], cos(angle), 1e-6);
            assert_float_equal(vectors[3 * i + 1], sin(angle), 1e-6);
            assert_float_equal(vectors[3 * i + 2], 0.0, 1e-6);
            assert_float_equal(told[4 * i + 2], (kind & 1 ? -1.0 : 1.0), 0.0);
            assert_float_equal(told[4 * i + 3], 0.0, 0.0);
        }
    }
}

/* ---- brute force ---- */

/* Points that triangles share, with normals and UVs that differ at seams. */
static void scatter(struct soup *s, struct rng *r) {
    float positions[8][3], normals[8][3], uvs[8][2];
    const uint32_t points = 3 + rng_below(r, 6);
    for (uint32_t i = 0; i < points; i++) {
        for (int k = 0; k < 3; k++)
            positions[i][k] = rng_range(r, -1.0f, 1.0f);
        rng_direction(r, normals[i]);
        for (int k = 0; k < 2; k++)
            uvs[i][k] = (float)rng_below(r, 3);
    }
    s->triangles = 1 + rng_below(r, 12);
    for (uint32_t corner = 0; corner < 3 * s->triangles; corner++) {
        const uint32_t i = rng_below(r, points);
        const float *uv = uvs[rng_below(r, 8) ? i : rng_below(r, points)];
        set_corner(s, corner, positions[i], normals[i], uv);
    }
}

static uint32_t next_of(uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

static double sign_of(const struct soup *s, uint32_t triangle) {
    const float *uv = s->uvs + 6 * triangle;
    const double area = ((double)uv[2] - (double)uv[0]) * ((double)uv[5] - (double)uv[1]) -
                        ((double)uv[3] - (double)uv[1]) * ((double)uv[4] - (double)uv[0]);
    return area > 0.0 ? 1.0 : -1.0;
}

static bool are_alike(const struct soup *s, uint32_t a, uint32_t b, bool has_seams) {
    return !memcmp(s->positions + 3 * a, s->positions + 3 * b, 3 * sizeof(float)) &&
           !memcmp(s->normals + 3 * a, s->normals + 3 * b, 3 * sizeof(float)) &&
           (!has_seams || !memcmp(s->uvs + 2 * a, s->uvs + 2 * b, 2 * sizeof(float))) &&
           sign_of(s, a / 3) == sign_of(s, b / 3);
}

/* Numbers of fans: pairs of edges in their order, and the least number that spreads over them. */
static void spread_fans(const struct soup *s, bool has_seams, uint32_t fans[MOST_CORNERS]) {
    const uint32_t corners = 3 * s->triangles;
    uint32_t partner[MOST_CORNERS];
    for (uint32_t a = 0; a < corners; a++) {
        partner[a] = UINT32_MAX;
        fans[a] = a;
    }
    for (uint32_t a = 0; a < corners; a++)
        for (uint32_t b = 0; b < corners && partner[a] == UINT32_MAX; b++)
            if (partner[b] == UINT32_MAX && !are_alike(s, a, next_of(a), has_seams) &&
                are_alike(s, a, next_of(b), has_seams) && are_alike(s, next_of(a), b, has_seams)) {
                partner[a] = b;
                partner[b] = a;
            }
    for (uint32_t round = 0; round < corners; round++)
        for (uint32_t a = 0; a < corners; a++) {
            if (partner[a] == UINT32_MAX)
                continue;
            const uint32_t other = next_of(partner[a]);
            fans[a] = fans[other] = fans[a] < fans[other] ? fans[a] : fans[other];
        }
}

static void make_unit(double v[3]) {
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] = length > 0.0 ? v[i] / length : 0.0;
}

/* What of a - b, or of a vector, is perpendicular to a corner's normal, as a unit vector. */
static void level(const struct soup *s, uint32_t corner, double v[3]) {
    const float *n = s->normals + 3 * corner;
    const double along = v[0] * (double)n[0] + v[1] * (double)n[1] + v[2] * (double)n[2];
    for (int i = 0; i < 3; i++)
        v[i] -= along * (double)n[i];
    make_unit(v);
}

static void way(const struct soup *s, uint32_t from, uint32_t to, double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = (double)s->positions[3 * to + (uint32_t)i] -
                 (double)s->positions[3 * from + (uint32_t)i];
}

/* The direction of growing U at a corner, times the angle there. */
static void weighted_direction(const struct soup *s, uint32_t corner, double out[3]) {
    const uint32_t first = corner - corner % 3, next = next_of(corner);
    const float *uv = s->uvs + 2 * first;
    double a[3], b[3];
    way(s, first, first + 1, a);
    way(s, first, first + 2, b);
    for (int i = 0; i < 3; i++)
        out[i] = (a[i] * ((double)uv[5] - (double)uv[1]) - b[i] * ((double)uv[3] - (double)uv[1])) *
                 sign_of(s, corner / 3);
    level(s, corner, out);
    way(s, corner, next, a);
    way(s, corner, next_of(next), b);
    level(s, corner, a);
    level(s, corner, b);
    const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    for (int i = 0; i < 3; i++)
        out[i] *= acos(fmax(-1.0, fmin(1.0, cosine)));
}

/* By how much a corner's tangent is off; not where directions cancel out. */
static double error_at(const struct soup *s, const uint32_t *fans, uint32_t corner,
                       const float *found) {
    double sum[3] = {0.0, 0.0, 0.0}, part[3];
    for (uint32_t other = 0; other < 3 * s->triangles; other++) {
        if (fans[other] != fans[corner])
            continue;
        weighted_direction(s, other, part);
        for (int i = 0; i < 3; i++)
            sum[i] += part[i];
    }
    const double length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    if (length > 0.0 && length < 1e-4)
        return 0.0;
    make_unit(sum);
    if (length == 0.0)
        sum[0] = 1.0;
    double worst = 0.0;
    for (int i = 0; i < 3; i++)
        worst = fmax(worst, fabs(sum[i] - (double)found[i]));
    return worst;
}

static void as_brute_force(void **state) {
    (void)state;
    static struct soup s;
    static float found[3 * MOST_CORNERS];
    struct rng r = rng_seed(5);
    double worst = 0.0;
    for (int trial = 0; trial < 2000; trial++) {
        scatter(&s, &r);
        trc_tangents_desc desc = desc_of(&s);
        desc.has_seams = trial & 1;
        uint32_t fans[MOST_CORNERS];
        spread_fans(&s, trial & 1, fans);
        assert_int_equal(
            trc_tangents_find(&desc, TRC_TANGENTS_VECTORS, found, 9 * (uint64_t)s.triangles),
            TRC_OK);
        for (uint32_t corner = 0; corner < 3 * s.triangles; corner++)
            worst = fmax(worst, error_at(&s, fans, corner, found + 3 * corner));
    }
    print_figure("tangents of 2,000 soups of triangles", "off by %.1e at most", worst);
    assert_true(worst < 1e-6);
}

/* ---- what is told ---- */

/* The vector that coordinates stand for is the tangent. */
static void coordinates(void **state) {
    (void)state;
    static struct soup s;
    static float vectors[3 * MOST_CORNERS], told[4 * MOST_CORNERS];
    struct rng r = rng_seed(6);
    double worst = 0.0;
    for (int trial = 0; trial < 500; trial++) {
        scatter(&s, &r);
        const uint32_t corners = find_both(&s, vectors, told);
        for (uint32_t corner = 0; corner < corners; corner++) {
            const uint32_t first = corner - corner % 3;
            double a[3], b[3], v[3], flat[3];
            way(&s, first, first + 1, a);
            way(&s, first, first + 2, b);
            for (int i = 0; i < 3; i++) {
                const int j = (i + 1) % 3, k = (i + 2) % 3;
                flat[i] = a[j] * b[k] - a[k] * b[j];
                v[i] = (double)told[4 * corner] * a[i] + (double)told[4 * corner + 1] * b[i];
            }
            make_unit(flat);
            const float *n = s.normals + 3 * corner;
            const double slope =
                flat[0] * (double)n[0] + flat[1] * (double)n[1] + flat[2] * (double)n[2];
            const float *tangent = vectors + 3 * corner;
            const float along = tangent[0] * n[0] + tangent[1] * n[1] + tangent[2] * n[2];
            /* Nearly upright, without an area, or U grows nowhere. */
            if (fabs(slope) < 0.1 || fabsf(along) > 1e-4f)
                continue;
            level(&s, corner, v);
            for (int i = 0; i < 3; i++)
                worst = fmax(worst, fabs(v[i] - (double)tangent[i]));
        }
    }
    print_figure("coordinates of tangents", "off by %.1e at most", worst);
    assert_true(worst < 1e-5);
}

static void misuse(void **state) {
    (void)state;
    static struct soup s;
    static float out[4 * MOST_CORNERS];
    lay_plane(&s, 1, 0.0, false);
    trc_tangents_desc desc = desc_of(&s);
    assert_int_equal(trc_tangents_find(NULL, 0, out, 18), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_tangents_find(&desc, 0, NULL, 18), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_tangents_find(&desc, 0, out, 24), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_tangents_find(&desc, 2, out, 18), TRC_ERROR_INVALID_ARGUMENT);
    desc.uvs = NULL;
    assert_int_equal(trc_tangents_find(&desc, 0, out, 18), TRC_ERROR_INVALID_ARGUMENT);
    desc.triangle_count = UINT64_C(1) << 30;
    assert_int_equal(trc_tangents_find(&desc, 0, out, 18), TRC_ERROR_TOO_LARGE);
    desc.triangle_count = 0;
    assert_int_equal(trc_tangents_find(&desc, 0, NULL, 0), TRC_OK);
    desc = desc_of(&s);
    for (uint32_t i = 0; i < 9 * s.triangles; i++) /* nothing falls */
        s.positions[i] = i & 1 ? NAN : INFINITY;
    assert_int_equal(trc_tangents_find(&desc, 1, out, 24), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(planes), cmocka_unit_test(as_brute_force),
                                       cmocka_unit_test(coordinates), cmocka_unit_test(misuse)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
