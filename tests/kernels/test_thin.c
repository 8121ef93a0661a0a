/* Instances whose transforms leave one dimension out, at all times or at some, against triangles of
 * transformed corners in double precision. */
#include "trial.h"

/* A ray this near an edge, as a share of the box, may go either way. */
#define MARGIN 1e-3
/* Twice the area of what counts as a line. */
#define SLIVER 1e-4
#define OBJECTS_APART 10.0f

static const float lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1};

/* rotation * scale * other rotation, moved: rounding makes it singular to floats alone. */
static void random_transform(struct rng *rng, const float scale[3], float m[12]) {
    static const float one[3] = {1, 1, 1}, nowhere[3] = {0, 0, 0};
    float a[3], b[3], offset[3], first[12], second[12];
    rng_direction(rng, a);
    rng_direction(rng, b);
    for (int k = 0; k < 3; k++)
        offset[k] = rng_range(rng, -2.0f, 2.0f);
    query_transform(a, rng_range(rng, 0.0f, 6.0f), scale, nowhere, first);
    query_transform(b, rng_range(rng, 0.0f, 6.0f), one, offset, second);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            m[4 * r + c] = 0.0f;
            for (int k = 0; k < 3; k++)
                m[4 * r + c] += second[4 * r + k] * first[4 * k + c];
        }
        m[4 * r + 3] = second[4 * r + 3];
    }
}

/* A world point of a mesh at a time: keys of both are joined by straight lines. */
static void world_point(const struct query_instance *instance, const struct mesh *mesh,
                        uint32_t vertex, float time, double out[3]) {
    uint32_t key, pose;
    float f, g;
    trc_key_at(time, mesh->key_count, &key, &f);
    trc_key_at(time, instance->key_count, &pose, &g);
    const float *a = mesh_key(mesh, key) + 3 * (size_t)vertex;
    const float *b = mesh->key_count > 1 ? mesh_key(mesh, key + 1) + 3 * (size_t)vertex : a;
    const float *m = instance->transforms[pose];
    const float *n = instance->transforms[pose + (instance->key_count > 1)];
    for (int r = 0; r < 3; r++) {
        out[r] = (1.0 - g) * m[4 * r + 3] + (double)g * n[4 * r + 3];
        for (int k = 0; k < 3; k++)
            out[r] += ((1.0 - g) * m[4 * r + k] + (double)g * n[4 * r + k]) *
                      ((1.0 - f) * a[k] + (double)f * b[k]);
    }
}

static void subtract(const double a[3], const double b[3], double out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}
static double triple(const double a[3], const double b[3], const double c[3]) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/* Twice the area. */
static double area(const double p[3][3]) {
    double e1[3], e2[3], square = 0.0;
    subtract(p[1], p[0], e1);
    subtract(p[2], p[0], e2);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        square += (e1[i] * e2[j] - e1[j] * e2[i]) * (e1[i] * e2[j] - e1[j] * e2[i]);
    }
    return sqrt(square);
}

enum answer { MISSES, UNSURE, HITS };

/* Moeller and Trumbore's test in double. What is left of the sides of a flat box cannot be hit but
 * within the margin of the others. */
static enum answer meet(const struct trial *t, uint32_t ray, const double p[3][3],
                        double *distance) {
    float o[3], d[3];
    double e1[3], e2[3], s[3], from[3], direction[3];
    ray_set_get(&t->rays, ray, o, d);
    for (int k = 0; k < 3; k++) {
        from[k] = (double)o[k];
        direction[k] = (double)d[k];
    }
    subtract(p[1], p[0], e1);
    subtract(p[2], p[0], e2);
    subtract(from, p[0], s);
    if (area(p) < SLIVER)
        return MISSES;
    const double det = -triple(direction, e1, e2);
    *distance = 0.0;
    if (fabs(det) < MARGIN * area(p))
        return UNSURE;
    const double u = -triple(direction, s, e2) / det, v = -triple(direction, e1, s) / det;
    const double inside = fmin(fmin(u, v), 1.0 - u - v);
    *distance = triple(s, e1, e2) / det;
    return inside < -MARGIN ? MISSES : inside < MARGIN ? UNSURE : HITS;
}

/* The answer for a ray: the nearest sure distance unless something unsure is in the way. */
static enum answer expected(const struct trial *t, uint32_t ray, double *nearest) {
    enum answer answer = MISSES;
    double unsure = INFINITY;
    *nearest = INFINITY;
    for (uint32_t i = 0; i < t->world.instance_count; i++) {
        const struct query_instance *instance = &t->world.instances[i];
        const struct mesh *mesh = &t->world.meshes[instance->mesh];
        for (uint32_t triangle = 0; triangle < mesh->triangle_count; triangle++) {
            double p[3][3], distance = 0.0;
            for (int k = 0; k < 3; k++)
                world_point(instance, mesh, mesh->indices[3 * triangle + (uint32_t)k],
                            t->rays.time[ray], p[k]);
            const enum answer one = meet(t, ray, (const double(*)[3])p, &distance);
            if (one == UNSURE)
                unsure = fmin(unsure, distance);
            if (one == HITS && distance > 0.0 && distance < *nearest) {
                *nearest = distance;
                answer = HITS;
            }
        }
    }
    return isfinite(unsure) && unsure <= *nearest ? UNSURE : answer;
}

/* A random point of a random triangle at a time. */
static void random_target(const struct query_instance *instance, const struct mesh *mesh,
                          float time, struct rng *rng, float target[3]) {
    double p[3][3];
    for (int tries = 0; tries < 100; tries++) {
        const uint32_t triangle = rng_below(rng, mesh->triangle_count);
        for (int k = 0; k < 3; k++)
            world_point(instance, mesh, mesh->indices[3 * triangle + (uint32_t)k], time, p[k]);
        if (area((const double(*)[3])p) >= SLIVER)
            break;
    }
    float u = rng_unit(rng), v = rng_unit(rng);
    if (u + v > 1.0f) {
        u = 1.0f - u;
        v = 1.0f - v;
    }
    for (int k = 0; k < 3; k++)
        target[k] = (float)(p[0][k] + u * (p[1][k] - p[0][k]) + v * (p[2][k] - p[0][k]));
}

/* Rays from around to the instances or past them, at any time or, of times, at those of as many
 * keys. */
static void add_rays(struct trial *t, struct rng *rng, uint32_t count, uint32_t times) {
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t number = rng_below(rng, t->world.instance_count);
        const struct query_instance *instance = &t->world.instances[number];
        const float time =
            times ? (float)rng_below(rng, times) / (float)(times - 1) : rng_unit(rng);
        float o[3], target[3];
        random_target(instance, &t->world.meshes[instance->mesh], time, rng, target);
        rng_direction(rng, o);
        for (int k = 0; k < 3; k++) {
            if (i % 4 == 0)
                target[k] += rng_range(rng, -2.0f, 2.0f);
            o[k] = target[k] + 4.0f * o[k];
        }
        ray_set_aim(&t->rays, o, target, time);
    }
}

/* Both kinds of scene; most answers must be sure, and of each kind there are some. */
static void check(struct trial *t, const char *name) {
    for (int is_final = 0; is_final < 2; is_final++) {
        uint32_t hits = 0, misses = 0;
        run(t, is_final);
        for (uint32_t i = 0; i < t->rays.count; i++) {
            double distance;
            const enum answer answer = expected(t, i, &distance);
            hits += answer == HITS;
            misses += answer == MISSES;
            if (answer == UNSURE)
                continue;
            const bool hit = t->hits.instance[i] != TRC_NO_HIT;
            if (hit == (answer == HITS) && hit == (t->hits.occluded[i] != 0) &&
                (!hit || fabs(t->hits.distance[i] - distance) < 1e-4 * (1.0 + distance)))
                continue;
            hit_set_print(&t->hits, &t->rays, i);
            fail_msg("%s, ray %u: %s at %g expected", name, i, answer == HITS ? "a hit" : "a miss",
                     distance);
        }
        if (hits < t->rays.count / 2 || !misses || hits + misses < t->rays.count * 3 / 4)
            fail_msg("%s: %u hits and %u misses are sure", name, hits, misses);
    }
    trial_free(t);
}

/* Boxes without one dimension, alone with their mesh or not. */
static void still_boxes(void **state) {
    (void)state;
    static const float scales[][3] = {{1, 1, 0},     {0, 2, 0.5f},   {-1, 0, 1},
                                      {1, 1e-9f, 1}, {1, 1, 1e-39f}, {1e-5f, 1, 1}};
    struct rng rng = rng_seed(1);
    for (uint32_t users = 1; users < 3; users++)
        for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
            struct trial t;
            trial_init(&t);
            mesh_add_box(query_world_object(&t.world), lower, upper);
            random_transform(&rng, scales[i], t.world.instances[0].transforms[0]);
            if (users == 2) {
                struct query_instance *other = query_world_instance(&t.world, 0);
                random_transform(&rng, scales[i], other->transforms[0]);
                other->transforms[0][3] += OBJECTS_APART;
            }
            add_rays(&t, &rng, 500, 0);
            check(&t, "still");
        }
}

/* No rounding anywhere: a square along the axes. */
static void exact_square(void **state) {
    (void)state;
    struct trial t;
    trial_init(&t);
    mesh_add_box(query_world_object(&t.world), lower, upper);
    t.world.instances[0].transforms[0][10] = 0.0f; /* of z */
    t.world.instances[0].transforms[0][11] = 3.0f;
    add_ray(&t, 0.25f, -0.5f, 0, 0, 0, 1);
    add_ray(&t, 0.25f, -0.5f, 5, 0, 0, -1);
    add_ray(&t, 1.5f, 0, 0, 0, 0, 1);
    for (int is_final = 0; is_final < 2; is_final++) {
        run(&t, is_final);
        assert_true(t.hits.instance[0] == 0 && t.hits.distance[0] == 3.0f);
        assert_true(t.hits.instance[1] == 0 && t.hits.distance[1] == 2.0f);
        expect_miss(&t, 2);
    }
    trial_free(&t);
}

/* Solid at some keys, flat or nothing at others. */
static void scaled_in_time(void **state) {
    (void)state;
    static const float scales[][3][3] = {{{1, 1, 1}, {1, 1, 0}, {1, 1, 1}},
                                         {{1, 1, 0}, {1, 1, 0}, {1, 0.5f, 0}},
                                         {{0, 0, 0}, {1, 0.5f, 1}, {1, 1, 1}},
                                         {{0, 0, 1}, {0, 1, 1}, {1, 1, 0}}};
    struct rng rng = rng_seed(2);
    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        struct trial t;
        trial_init(&t);
        mesh_add_box(query_world_object(&t.world), lower, upper);
        struct query_instance *instance = &t.world.instances[0];
        float axis[3];
        rng_direction(&rng, axis);
        instance->key_count = 3;
        for (int key = 0; key < 3; key++) {
            const float offset[3] = {0.5f * (float)key, 0, 1};
            query_transform(axis, 0.7f, scales[i][key], offset, instance->transforms[key]);
        }
        add_rays(&t, &rng, 1000, 0);
        check(&t, "scaled in time");
    }
}

/* Mesh and instance move: at the keys of both nothing is between. */
static void deformed_and_scaled(void **state) {
    (void)state;
    static const float scale[3] = {1, 0, 1};
    struct rng rng = rng_seed(3);
    struct trial t;
    trial_init(&t);
    struct mesh *mesh = query_world_object(&t.world);
    mesh_add_box(mesh, lower, upper);
    mesh_set_keys(mesh, 3);
    for (uint32_t i = 3 * mesh->vertex_count; i < 9 * mesh->vertex_count; i++)
        mesh->positions[i] += rng_range(&rng, -0.3f, 0.3f);
    struct query_instance *instance = &t.world.instances[0];
    instance->key_count = 4;
    for (int key = 0; key < 4; key++)
        random_transform(&rng, scale, instance->transforms[key]);
    add_rays(&t, &rng, 1000, 7); /* 2 and 3 steps: 6 in all */
    check(&t, "deformed and scaled");
}

/* A line or a point is nothing to meet. */
static void less_than_flat(void **state) {
    (void)state;
    struct trial t;
    trial_init(&t);
    mesh_add_box(query_world_object(&t.world), lower, upper);
    t.world.instances[0].transforms[0][0] = t.world.instances[0].transforms[0][10] = 0.0f;
    add_ray(&t, -3, 0.5f, 0, 1, 0, 0);
    add_ray(&t, 0, -3, 0, 0, 1, 0);
    run(&t, false);
    expect_miss(&t, 0);
    expect_miss(&t, 1);
    trial_free(&t);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(still_boxes),    cmocka_unit_test(exact_square),
        cmocka_unit_test(scaled_in_time), cmocka_unit_test(deformed_and_scaled),
        cmocka_unit_test(less_than_flat),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("thin", tests, NULL, NULL);
}
