/* What a walk of a packet keeps for its rays alone: one part's hits must not shorten the way of the
 * others, whatever their times and objects. Every world is asked by packets of all sizes, of which
 * those of one ray share nothing with others. */
#include "trial.h"

/* Rays enough that parts of a bundle walk as packets, not ray by ray. */
enum { RAYS = 1024 };

static float between(uint32_t i, uint32_t count, float low, float high) {
    return low + (high - low) * ((float)i + 0.5f) / (float)count;
}

static void add_wall(struct mesh *mesh, float left, float right, float z) {
    const float at[3] = {left, -4, z}, u[3] = {right - left, 0, 0}, v[3] = {0, 8, 0};
    mesh_add_grid(mesh, at, u, v, 8, 8);
}

/* Upwards from z = 0, spread over x and y from -3 to 3; the time alternates. */
static void add_rays(struct trial *t, float first_time, float second_time) {
    for (uint32_t i = 0; i < RAYS; i++) {
        const float o[3] = {between(i * 7 % RAYS, RAYS, -3, 3), between(i * 5 % RAYS, RAYS, -3, 3),
                            0};
        const float d[3] = {0.01f, 0.02f, 1};
        ray_set_add(&t->rays, o, d, 0.0f, INFINITY, i & 1 ? second_time : first_time);
    }
}

static void expect_walls(const struct trial *t, const float near_of[2], float left) {
    for (uint32_t i = 0; i < t->rays.count; i++) {
        const float x = t->rays.origin[0][i];
        const float want = near_of[i & 1];
        if (fabsf(x - left) < 0.5f)
            continue;
        if (t->hits.instance[i] == TRC_NO_HIT || !(fabsf(t->hits.distance[i] - want) < 1e-3f)) {
            hit_set_print(&t->hits, &t->rays, i);
            fail_msg("ray %u: %g expected", i, (double)want);
        }
    }
}

/* A near wall leaves to the side between the second and the third key; a far one stays. */
static void segments_of_time_are_apart(void **state) {
    (void)state;
    for (int first_is_late = 0; first_is_late < 2; first_is_late++) {
        static const float near_of[2][2] = {{1, 9}, {9, 1}};
        struct trial t;
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        add_wall(mesh, -4, 4, 1);
        const uint32_t near_count = mesh->vertex_count;
        add_wall(mesh, -4, 4, 9);
        mesh_set_keys(mesh, 3);
        for (uint32_t v = 0; v < near_count; v++)
            mesh_key(mesh, 2)[3 * v] += 100.0f;
        add_rays(&t, first_is_late ? 0.9f : 0.2f, first_is_late ? 0.2f : 0.9f);
        run(&t, false);
        expect_walls(&t, near_of[first_is_late], 100.0f);
        trial_free(&t);
    }
}

/* On the left a wall of the tree that joins what is at rest, on the right instances far behind it.
 */
static void joined_trees_are_for_their_rays(void **state) {
    (void)state;
    enum { BEHIND = 48 };
    struct trial t;
    trial_init(&t);
    add_wall(query_world_object(&t.world), -4, 0, 1);
    add_wall(query_world_mesh(&t.world), 0, 4, 0);
    for (uint32_t k = 0; k < BEHIND; k++) {
        struct query_instance *instance = query_world_instance(&t.world, 1);
        instance->transforms[0][11] = 9.0f + 0.25f * (float)k;
        instance->key_count = 2; /* not joined */
        memcpy(instance->transforms[1], instance->transforms[0], sizeof instance->transforms[0]);
    }
    add_rays(&t, 0.0f, 0.0f);
    run(&t, true);
    for (uint32_t i = 0; i < t.rays.count; i++) {
        const float x = t.rays.origin[0][i];
        if (fabsf(x) < 0.5f)
            continue;
        const float want = x < 0.0f ? 1.0f : 9.0f;
        if (t.hits.instance[i] == TRC_NO_HIT || !(fabsf(t.hits.distance[i] - want) < 1e-3f)) {
            hit_set_print(&t.hits, &t.rays, i);
            fail_msg("ray %u: %g expected", i, (double)want);
        }
    }
    trial_free(&t);
}

/* A wall that slides along itself, instanced: rays of one origin begin at as many places of it as
 * they have times. */
static void one_origin_is_many_to_what_moves(void **state) {
    (void)state;
    struct trial t;
    trial_init(&t);
    const float at[3] = {-50, -50, 5}, u[3] = {100, 0, 0}, v[3] = {0, 100, 0};
    mesh_add_grid(query_world_mesh(&t.world), at, u, v, 64, 64);
    for (uint32_t k = 0; k < 2; k++) {
        struct query_instance *instance = query_world_instance(&t.world, 0);
        instance->key_count = 2;
        memcpy(instance->transforms[1], instance->transforms[0], sizeof instance->transforms[0]);
        instance->transforms[1][3] = 30.0f;
        instance->transforms[1][7] = -20.0f;
        instance->transforms[0][11] = instance->transforms[1][11] = (float)k;
    }
    for (uint32_t i = 0; i < RAYS; i++) {
        const float d[3] = {between(i * 7 % RAYS, RAYS, -0.2f, 0.2f),
                            between(i * 5 % RAYS, RAYS, -0.2f, 0.2f), 1};
        ray_set_add(&t.rays, origin, d, 0.0f, INFINITY, between(i * 11 % RAYS, RAYS, 0, 1));
    }
    run(&t, false);
    for (uint32_t i = 0; i < t.rays.count; i++)
        if (t.hits.instance[i] != 0 || !(fabsf(t.hits.distance[i] - 5.0f) < 1e-3f)) {
            hit_set_print(&t.hits, &t.rays, i);
            fail_msg("ray %u passes the wall", i);
        }
    trial_free(&t);
}

/* Triangles that turn over while they move: a beam that is outside of an edge when its interval of
 * time begins and when it ends may be inside between. */
static void turning_edges_are_met(void **state) {
    (void)state;
    enum { WORLDS = 40, TRIANGLES = 64 };
    struct rng rng = rng_seed(21);
    uint32_t hits = 0;
    for (int world = 0; world < WORLDS; world++) {
        static const float lower[3] = {-1, -1, 4}, upper[3] = {1, 1, 6};
        struct trial t;
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        mesh_add_soup(mesh, &rng, TRIANGLES, lower, upper, 1.0f);
        mesh_set_keys(mesh, 2);
        for (uint32_t i = 0; i < mesh->vertex_count; i++)
            for (int axis = 0; axis < 3; axis++)
                mesh_key(mesh, 1)[3 * i + (uint32_t)axis] =
                    rng_range(&rng, lower[axis], upper[axis]);
        for (uint32_t i = 0; i < 256; i++) {
            const float o[3] = {rng_range(&rng, -0.01f, 0.01f), rng_range(&rng, -0.01f, 0.01f), 0};
            const float d[3] = {rng_range(&rng, -0.01f, 0.01f), rng_range(&rng, -0.01f, 0.01f), 1};
            ray_set_add(&t.rays, o, d, 0.0f, INFINITY, rng_unit(&rng));
        }
        run(&t, false);
        for (uint32_t i = 0; i < t.rays.count; i++)
            hits += t.hits.instance[i] != TRC_NO_HIT;
        trial_free(&t);
    }
    assert_true(hits > WORLDS * 256 / 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(segments_of_time_are_apart),
        cmocka_unit_test(joined_trees_are_for_their_rays),
        cmocka_unit_test(one_origin_is_many_to_what_moves),
        cmocka_unit_test(turning_edges_are_met),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("walk", tests, NULL, NULL);
}
