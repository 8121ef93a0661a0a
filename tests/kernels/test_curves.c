/* Curves: rays against ribbons, round strands and balls in double precision, aimed at axes and
 * joints, and what the interface refuses. */
#include "figures.h"
#include "query_test.h"

#define STRANDS 40
#define POINTS 5
#define PIECES 3
#define PIECES_OF_STRAND ((POINTS - 1) * PIECES)
#define MAX_KEYS 3
#define SHAPES (TRC_CURVE_HOLLOW_BALL + 1)
#define RAYS 1200
#define AIMED 20000 /* at once */
/* A distance across a curve this near its edge, as a share of the radius, may go either way. */
#define MARGIN 2e-3

struct strands {
    trc_curves_desc desc;
    float points[MAX_KEYS][STRANDS * POINTS][4];
    uint32_t lengths[STRANDS];
    float transforms[2][12];
    uint32_t transform_count;
    trc_scene scene;
    trc_id mesh;
};

static bool is_ball(uint32_t shape) {
    return shape == TRC_CURVE_BALL || shape == TRC_CURVE_HOLLOW_BALL;
}

/* spacing: from strand to strand; 0: some cross. */
static void strands_make(struct strands *s, struct rng *rng, uint32_t shape, uint32_t key_count,
                         bool moved, float spacing) {
    /* Pieces are longer than their radius, or open ends show what joints have of balls. */
    const bool is_tube = shape == TRC_CURVE_ROUND, balls = is_ball(shape);
    s->desc = trc_curves_desc_default();
    for (uint32_t i = 0; i < STRANDS; i++) {
        float p[3], way[3];
        for (int k = 0; k < 3; k++)
            p[k] = rng_range(rng, -1.0f, 1.0f);
        p[0] += spacing * (float)i;
        s->lengths[i] = POINTS;
        rng_direction(rng, way);
        for (uint32_t j = 0; j < POINTS; j++) {
            for (uint32_t key = 0; key < key_count; key++) {
                float *point = s->points[key][i * POINTS + j];
                for (int k = 0; k < 3; k++)
                    point[k] = p[k] + (float)key * rng_range(rng, -0.1f, 0.1f);
                point[3] = is_tube ? rng_range(rng, 0.025f, 0.035f) : rng_range(rng, 0.02f, 0.08f);
            }
            for (int k = 0; k < 3; k++)
                p[k] += 0.2f * way[k] + rng_range(rng, -0.1f, 0.1f);
        }
    }
    s->desc.key_count = key_count;
    s->desc.shape = shape;
    s->desc.piece_count = PIECES;
    s->desc.tolerance = 0.0f;
    s->desc.point_count = STRANDS * POINTS;
    s->desc.points = s->points[0][0];
    s->desc.point_value_count = 4ull * STRANDS * POINTS * key_count;
    s->desc.lengths = balls ? NULL : s->lengths;
    s->desc.strand_count = balls ? 0 : STRANDS;
    const float axis[3] = {1, 2, 3}, scale[3] = {1, moved ? 1.5f : 1, 1}, one[3] = {2, 2, 2};
    const float here[3] = {0.5f, -0.25f, 1.0f}, there[3] = {0.6f, -0.2f, 0.9f};
    s->transform_count = moved ? 2 : 1;
    query_transform(axis, 0.7f, moved ? one : scale, here, s->transforms[0]);
    query_transform(axis, 0.9f, moved ? one : scale, there, s->transforms[1]);
    const trc_scene_desc scene = trc_scene_desc_default();
    assert_ok(trc_scene_create(&scene, &s->scene));
    assert_ok(trc_curves_create(s->scene, &s->desc, &s->mesh));
    trc_instance_desc instance = trc_instance_desc_default();
    instance.mesh = s->mesh;
    instance.key_count = s->transform_count;
    instance.transforms = s->transforms[0];
    trc_id id;
    assert_ok(trc_instance_create(s->scene, &instance, &id));
    assert_ok(trc_scene_commit(s->scene));
}

/* ---- the oracle ---- */

static double mix(double a, double b, double f) { return a + f * (b - a); }

/* A vertex of strand i, from 0 to PIECES_OF_STRAND, at a time. */
static void vertex_at(const struct strands *s, uint32_t strand, uint32_t vertex, float time,
                      double out[4]) {
    uint32_t key;
    float f;
    trc_key_at(time, s->desc.key_count, &key, &f);
    const uint32_t next = key + (s->desc.key_count > 1);
    const uint32_t first = vertex / PIECES < POINTS - 1 ? vertex / PIECES : POINTS - 2;
    const double t = (double)vertex / PIECES - first;
    for (int k = 0; k < 4; k++) {
        double p[4];
        for (uint32_t i = 0; i < 4; i++) {
            uint32_t at = first + i;
            at = at < 1 ? 0 : at > POINTS ? POINTS - 1 : at - 1;
            at += strand * POINTS;
            p[i] = mix((double)s->points[key][at][k], (double)s->points[next][at][k], (double)f);
        }
        out[k] =
            0.5 * (2 * p[1] + t * (p[2] - p[0]) + t * t * (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3]) +
                   t * t * t * (3 * (p[1] - p[2]) + p[3] - p[0]));
    }
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A ray in object space, unit, and its length there. */
struct object_ray {
    double o[3], d[3], length;
};

static void ray_to_object(const struct strands *s, const float o[3], const float d[3], float time,
                          struct object_ray *out) {
    uint32_t key;
    float f;
    double m[12], c[3][3];
    trc_key_at(time, s->transform_count, &key, &f);
    for (int i = 0; i < 12; i++)
        m[i] = mix((double)s->transforms[key][i],
                   (double)s->transforms[key + (s->transform_count > 1)][i], (double)f);
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++) {
            const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            c[r][k] = m[4 * r1 + k1] * m[4 * r2 + k2] - m[4 * r1 + k2] * m[4 * r2 + k1];
        }
    const double det = m[0] * c[0][0] + m[1] * c[0][1] + m[2] * c[0][2];
    for (int k = 0; k < 3; k++) {
        out->o[k] = out->d[k] = 0.0;
        for (int r = 0; r < 3; r++) {
            out->o[k] += c[r][k] * ((double)o[r] - m[4 * r + 3]) / det;
            out->d[k] += c[r][k] * (double)d[r] / det;
        }
    }
    out->length = sqrt(dot(out->d, out->d));
    for (int k = 0; k < 3; k++)
        out->d[k] /= out->length;
}

/* Where the middle of a piece at s is beside the ray: how far along, the square of how far across,
 * and the radius there. */
struct beside {
    double along, across2, radius;
};
static struct beside beside_at(const struct object_ray *ray, const double a[4], const double b[4],
                               double s) {
    double way[3];
    for (int k = 0; k < 3; k++)
        way[k] = mix(a[k], b[k], s) - ray->o[k];
    const double along = dot(way, ray->d);
    return (struct beside){along, fmax(dot(way, way) - along * along, 0.0), mix(a[3], b[3], s)};
}

enum answer { MISSES, UNSURE, HITS };

/* Across the ray, in two dimensions: from one place to another. */
static void way_across(const struct object_ray *ray, const double a[3], const double b[3],
                       double out[3]) {
    double way[3];
    for (int k = 0; k < 3; k++)
        way[k] = b[k] - a[k];
    const double along = dot(way, ray->d);
    for (int k = 0; k < 3; k++)
        out[k] = way[k] - along * ray->d[k];
}

/* On which side of the line that halves the angle at a place the ray is: above 0 ahead. */
static double side_at(const struct object_ray *ray, const double before[3], const double at[3],
                      const double after[3]) {
    double in[3], out[3], from[3], sum = 0.0;
    way_across(ray, before, at, in);
    way_across(ray, at, after, out);
    way_across(ray, at, ray->o, from);
    const double a = sqrt(dot(in, in)), b = sqrt(dot(out, out));
    for (int k = 0; k < 3; k++)
        sum += from[k] * ((a > 0 ? in[k] / a : 0) + (b > 0 ? out[k] / b : 0));
    return sum;
}

/* The place of a ribbon's axis that is nearest to the ray. v: the vertices before, of and after the
 * piece. */
static enum answer meet_ribbon(const struct object_ray *ray, const double v[4][4],
                               double *distance) {
    double low = 0.0, high = 1.0; /* the distance across is convex along the piece */
    for (int i = 0; i < 100; i++) {
        const double x = low + (high - low) / 3, y = high - (high - low) / 3;
        if (beside_at(ray, v[1], v[2], x).across2 < beside_at(ray, v[1], v[2], y).across2)
            high = y;
        else
            low = x;
    }
    const struct beside p = beside_at(ray, v[1], v[2], 0.5 * (low + high));
    const double share = sqrt(p.across2) / p.radius, ahead = p.along / p.radius;
    const double before = side_at(ray, v[0], v[1], v[2]) / p.radius,
                 after = -side_at(ray, v[1], v[2], v[3]) / p.radius;
    *distance = p.along / ray->length;
    const double least = fmin(fmin(1 - share, ahead - 2), fmin(before, after));
    return least < -MARGIN ? MISSES : least < MARGIN ? UNSURE : HITS;
}

/* How far a place on the ray is beyond the plane that halves the angle at a vertex; upright at the
 * end of a strand, where next is the vertex. */
static double beyond(const struct object_ray *ray, double z, const double before[3],
                     const double at[3], const double next[3]) {
    double in[3], out[3], from[3], w[3], size = 0.0;
    for (int k = 0; k < 3; k++) {
        in[k] = at[k] - before[k];
        out[k] = next[k] - at[k];
        from[k] = ray->o[k] + z * ray->d[k] - at[k];
    }
    const double a = sqrt(dot(in, in)), b = sqrt(dot(out, out));
    for (int k = 0; k < 3; k++)
        w[k] = (a > 0 ? in[k] / a : 0) + (b > 0 ? out[k] / b : 0);
    size = sqrt(dot(w, w));
    return size > 0 ? dot(from, w) / size : 0;
}

/* Whether a piece has what the ray meets at z: beyond its joints neighbours may have it. */
static enum answer owns(const struct object_ray *ray, double z, const double v[4][4], bool first,
                        bool last, double radius) {
    const double before = beyond(ray, z, v[2], v[1], v[0]),
                 after = beyond(ray, z, v[1], v[2], v[3]);
    const double slack = 0.02 * radius;
    if ((first && before > slack) || (last && after > slack) || fmax(before, after) > 2 * radius)
        return MISSES;
    return fmax(before, after) > -slack ? UNSURE : HITS;
}

/* The nearest of all balls along a piece, by many of them; from within the farthest. v: as above.
 */
static enum answer meet_round(const struct object_ray *ray, const double v[4][4], bool first,
                              bool last, double *distance) {
    enum { STEPS = 400 };
    double near = INFINITY, far = -INFINITY, deepest = -INFINITY;
    for (int i = 0; i <= STEPS; i++) {
        const struct beside p = beside_at(ray, v[1], v[2], (double)i / STEPS);
        const double g = p.radius * p.radius - p.across2;
        if (g / (p.radius * p.radius) > deepest) {
            deepest = g / (p.radius * p.radius);
            *distance = (p.along - p.radius) / ray->length; /* unless it is sure */
        }
        if (g < 0)
            continue;
        near = fmin(near, p.along - sqrt(g));
        far = fmax(far, p.along + sqrt(g));
    }
    const double radius = fmax(v[1][3], v[2][3]), slack = 0.02 * radius;
    const bool is_ball = memcmp(v[1], v[2], sizeof v[1]) == 0;
    if (deepest < -0.02)
        return MISSES;
    if (deepest < 0.02)
        return UNSURE;
    for (int end = 0; end < 2; end++) {
        const double z = end ? far : near;
        const enum answer owned = is_ball ? HITS : owns(ray, z, v, first, last, radius);
        if (z < -slack || owned == MISSES)
            continue;
        *distance = z / ray->length;
        return fabs(z) <= slack ? UNSURE : owned;
    }
    return MISSES;
}

/* The nearest sure distance, and the nearest that is not sure. */
static void expected(const struct strands *s, const struct ray_set *rays, uint32_t i, double *sure,
                     double *unsure) {
    float o[3], d[3];
    struct object_ray ray;
    ray_set_get(rays, i, o, d);
    ray_to_object(s, o, d, rays->time[i], &ray);
    *sure = *unsure = INFINITY;
    const bool balls = is_ball(s->desc.shape);
    const uint32_t pieces = balls ? POINTS : PIECES_OF_STRAND;
    for (uint32_t strand = 0; strand < STRANDS; strand++)
        for (uint32_t p = 0; p < pieces; p++) {
            double v[4][4], distance = INFINITY;
            const bool first = p == 0, last = p + 1 == pieces;
            const uint32_t at = balls ? p * PIECES : p;
            vertex_at(s, strand, first || balls ? at : at - 1, rays->time[i], v[0]);
            vertex_at(s, strand, at, rays->time[i], v[1]);
            vertex_at(s, strand, balls ? at : at + 1, rays->time[i], v[2]);
            vertex_at(s, strand, balls ? at : last ? at + 1 : at + 2, rays->time[i], v[3]);
            const double(*const vertices)[4] = (const double(*)[4])v;
            const enum answer answer = s->desc.shape == TRC_CURVE_RIBBON
                                           ? meet_ribbon(&ray, vertices, &distance)
                                           : meet_round(&ray, vertices, first, last, &distance);
            if (answer == HITS && distance > 0)
                *sure = fmin(*sure, distance);
            if (answer == UNSURE)
                *unsure = fmin(*unsure, distance);
        }
}

/* ---- rays ---- */

static void random_rays(struct rng *rng, struct ray_set *rays, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        static float from[3];
        float to[3], d[3];
        for (int k = 0; k < 3; k++) {
            if (i % 64 == 0 || i / 64 % 3 == 0) /* packets of one origin, and of many */
                from[k] = rng_range(rng, i / 64 % 3 == 1 ? -2.0f : -8.0f, 8.0f);
            to[k] = rng_range(rng, -1.5f, 1.5f);
            d[k] = to[k] - from[k];
        }
        ray_set_add(rays, from, d, 0.0f, INFINITY, rng_unit(rng));
    }
}

static void check_against_oracle(struct strands *s, struct rng *rng) {
    struct ray_set rays;
    struct hit_set hits, others;
    const uint32_t count = query_test_is_narrow() ? RAYS / 4 : RAYS;
    ray_set_init(&rays);
    random_rays(rng, &rays, count);
    hit_set_init(&hits, count);
    hit_set_init(&others, count);
    assert_ok(hit_set_query(&hits, s->scene, &rays, 64));
    uint32_t met = 0, doubtful = 0;
    for (uint32_t i = 0; i < count; i++) {
        double sure, unsure;
        expected(s, &rays, i, &sure, &unsure);
        const double found = hits.instance[i] == TRC_NO_HIT ? INFINITY : (double)hits.distance[i];
        const double off = 0.002 * fmin(sure, 1.0);
        met += found < INFINITY;
        doubtful += unsure < INFINITY && unsure <= sure;
        if (unsure <= sure + off) {
            if (!(found <= sure + off))
                fail_msg("ray %u: %g is farther than %g", i, found, sure);
        } else if (!(fabs(found - sure) <= off || (found == INFINITY && sure == INFINITY))) {
            hit_set_print(&hits, &rays, i);
            fail_msg("ray %u: %g instead of %g", i, found, sure);
        }
        assert_int_equal(hits.occluded[i], found < INFINITY);
    }
    assert_true(met > count / 10);
    assert_true(doubtful < count / 10);
    const uint32_t sizes[] = {0, 1, 4, 16, 256};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        assert_ok(hit_set_query(&others, s->scene, &rays, sizes[k]));
        const uint32_t at = hit_set_difference(&hits, &others);
        if (at != UINT32_MAX)
            fail_msg("packets of %u: ray %u differs", sizes[k], at);
    }
    hit_set_free(&hits);
    hit_set_free(&others);
    ray_set_free(&rays);
}

static void test_against_double(void **state) {
    (void)state;
    struct rng rng = rng_seed(7);
    for (uint32_t variant = 0; variant < 3 * SHAPES; variant++) {
        static struct strands s;
        strands_make(&s, &rng, variant % SHAPES, 1, variant / SHAPES == 1, 0.0f);
        check_against_oracle(&s, &rng);
        assert_ok(trc_scene_destroy(s.scene));
    }
}

static void test_moving(void **state) {
    (void)state;
    struct rng rng = rng_seed(8);
    for (uint32_t shape = 0; shape < SHAPES; shape++) {
        static struct strands s;
        strands_make(&s, &rng, shape, MAX_KEYS, true, 0.0f);
        check_against_oracle(&s, &rng);
        assert_ok(trc_scene_destroy(s.scene));
    }
}

/* Where a point is in the world at a time, of the scene's only instance. */
static void to_world(const struct strands *s, float time, const double point[3], float out[3]) {
    uint32_t key;
    float f;
    trc_key_at(time, s->transform_count, &key, &f);
    const uint32_t next = key + (s->transform_count > 1);
    for (int r = 0; r < 3; r++) {
        double m[4];
        for (int k = 0; k < 4; k++)
            m[k] = mix((double)s->transforms[key][4 * r + k],
                       (double)s->transforms[next][4 * r + k], (double)f);
        out[r] = (float)(m[0] * point[0] + m[1] * point[1] + m[2] * point[2] + m[3]);
    }
}

/* How many of count rays from all sides, half of them at joints, half at places of axes, meet
 * neither that strand nor one before it. (Through an open end, its inside is farther than the
 * axis.) */
static uint32_t missed_of(const struct strands *s, struct rng *rng, uint32_t count) {
    struct ray_set rays;
    struct hit_set hits;
    uint32_t aimed[AIMED];
    ray_set_init(&rays);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t strand = aimed[i] = rng_below(rng, STRANDS);
        const uint32_t vertex = 1 + rng_below(rng, PIECES_OF_STRAND - 1);
        const float time = rng_unit(rng);
        const double part = i % 2 ? 0.0 : (double)rng_range(rng, -0.5f, 0.5f);
        double a[4], b[4];
        float from[3], target[3];
        vertex_at(s, strand, vertex, time, a);
        vertex_at(s, strand, part < 0 ? vertex - 1 : vertex + 1, time, b);
        for (int k = 0; k < 3; k++)
            a[k] = mix(a[k], b[k], fabs(part));
        to_world(s, time, a, target);
        rng_direction(rng, from);
        for (int k = 0; k < 3; k++)
            from[k] = 20.0f * from[k];
        ray_set_aim(&rays, from, target, time);
    }
    hit_set_init(&hits, count);
    assert_ok(hit_set_query(&hits, s->scene, &rays, 64));
    uint32_t missed = 0;
    for (uint32_t i = 0; i < count; i++)
        missed += hits.instance[i] == TRC_NO_HIT ||
                  (hits.distance[i] > 1 && hits.triangle[i] / PIECES_OF_STRAND != aimed[i]);
    hit_set_free(&hits);
    ray_set_free(&rays);
    return missed;
}

/* 0 misses; TRACER_TEST_RAYS sets the number of rays of each kind. */
static void test_aimed(void **state) {
    (void)state;
    static const char *const names[4] = {
        "41: ribbons, joints and axes", "41: round strands, joints and axes",
        "41: ribbons that move, joints and axes", "41: round strands that move, joints and axes"};
    struct rng rng = rng_seed(9);
    for (uint32_t variant = 0; variant < 4; variant++) {
        static struct strands s;
        uint64_t missed = 0;
        const uint32_t all = query_test_rays(AIMED);
        strands_make(&s, &rng, variant % 2 ? TRC_CURVE_ROUND : TRC_CURVE_RIBBON,
                     variant / 2 ? MAX_KEYS : 1, variant / 2, 4.0f);
        for (uint32_t done = 0; done < all; done += AIMED)
            missed += missed_of(&s, &rng, all - done < AIMED ? all - done : AIMED);
        print_misses(names[variant], missed, all);
        assert_int_equal(missed, 0);
        assert_ok(trc_scene_destroy(s.scene));
    }
}

/* ---- bad input ---- */

static void test_bad_strands(void **state) {
    (void)state;
    const float points[6][4] = {{0, 0, 0, 0.1f}, {1, 0, 0, 0.1f}, {NAN, 0, 0, 0.1f},
                                {0, 0, 1, 0.1f}, {5, 0, 0, -1},   {6, 0, 0, 0}};
    const uint32_t lengths[4] = {2, 1, 1, 2};
    const trc_scene_desc scene_desc = trc_scene_desc_default();
    trc_scene scene;
    trc_id mesh, instance;
    assert_ok(trc_scene_create(&scene_desc, &scene));
    trc_curves_desc desc = trc_curves_desc_default();
    desc.piece_count = 1;
    desc.points = points[0];
    desc.point_count = 6;
    desc.point_value_count = 24;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    desc.lengths = lengths;
    desc.strand_count = 4;
    for (uint32_t shape = TRC_CURVE_BALL; shape <= SHAPES; shape++) { /* and one that is none */
        desc.shape = shape;
        assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    }
    desc.shape = TRC_CURVE_RIBBON;
    desc.strand_count = 3;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    desc.strand_count = 4;
    desc.piece_count = 0;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    desc.piece_count = TRC_MAX_CURVE_PIECES + 1;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_TOO_LARGE);
    desc.piece_count = 1;
    desc.point_value_count = 23;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    desc.point_value_count = 24;
    desc.points = NULL;
    assert_int_equal(trc_curves_create(scene, &desc, &mesh), TRC_ERROR_INVALID_ARGUMENT);
    desc.points = points[0];
    assert_ok(trc_curves_create(scene, &desc, &mesh));
    trc_instance_desc instance_desc = trc_instance_desc_default();
    instance_desc.mesh = mesh;
    assert_ok(trc_instance_create(scene, &instance_desc, &instance));
    assert_ok(trc_scene_commit(scene));
    trc_scene_stats stats = trc_scene_stats_default();
    assert_ok(trc_scene_get_stats(scene, &stats));
    assert_int_equal(stats.triangle_count, 2);
    assert_int_equal(stats.skipped_triangle_count, 0); /* that is for what is not finite */
    assert_int_equal(trc_mesh_update(scene, mesh, 1, points[0], 24, NULL, 0),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_curves_update(scene, mesh, 1, points[0], 23), TRC_ERROR_INVALID_ARGUMENT);
    assert_ok(trc_curves_update(scene, mesh, 1, points[0], 24));
    assert_ok(trc_scene_commit(scene));
    assert_ok(trc_scene_destroy(scene));
}

int main(void) {
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_against_double),
                                       cmocka_unit_test(test_moving), cmocka_unit_test(test_aimed),
                                       cmocka_unit_test(test_bad_strands)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
