/* Trials: small worlds, rays through them, and what these must hit, the same by packets of any
 * size. Needs cmocka. */
#ifndef TRACER_TESTS_TRIAL_H
#define TRACER_TESTS_TRIAL_H

#include "query_test.h"

static const uint32_t packet_sizes[] = {1, 4, 16, 64, 256};
#define PACKET_SIZES (sizeof packet_sizes / sizeof *packet_sizes)

static const float origin[3] = {0, 0, 0};

/* A world with its rays and, after run, the hits of the last query. */
struct trial {
    struct query_world world;
    struct ray_set rays;
    struct hit_set hits;
};

QUERY_TEST_INLINE void trial_init(struct trial *t) {
    query_world_init(&t->world);
    ray_set_init(&t->rays);
    t->hits = (struct hit_set){0};
}

QUERY_TEST_INLINE void trial_free(struct trial *t) {
    query_world_free(&t->world);
    ray_set_free(&t->rays);
    hit_set_free(&t->hits);
}

QUERY_TEST_INLINE void add_ray(struct trial *t, float ox, float oy, float oz, float dx, float dy,
                               float dz) {
    const float o[3] = {ox, oy, oz}, d[3] = {dx, dy, dz};
    ray_set_add_simple(&t->rays, o, d);
}

/* Queries an existing scene with every packet size: all the same bits. */
QUERY_TEST_INLINE void query(struct trial *t, trc_scene scene) {
    struct hit_set other;
    hit_set_free(&t->hits);
    hit_set_init(&t->hits, t->rays.count);
    hit_set_init(&other, t->rays.count);
    assert_ok(hit_set_query(&t->hits, scene, &t->rays, packet_sizes[0]));
    for (size_t i = 1; i < PACKET_SIZES; i++) {
        assert_ok(hit_set_query(&other, scene, &t->rays, packet_sizes[i]));
        const uint32_t ray = hit_set_difference(&t->hits, &other);
        if (ray == UINT32_MAX)
            continue;
        hit_set_print(&t->hits, &t->rays, ray);
        hit_set_print(&other, &t->rays, ray);
        fail_msg("packets of 1 and of %u differ at ray %u", packet_sizes[i], ray);
    }
    hit_set_free(&other);
}

QUERY_TEST_INLINE void run(struct trial *t, bool is_final) {
    struct query_scene scene = query_test_scene(&t->world, is_final);
    query(t, scene.scene);
    query_scene_destroy(&scene);
}

QUERY_TEST_INLINE void expect_hit(const struct trial *t, uint32_t ray, uint32_t instance,
                                  uint32_t triangle, float distance) {
    if (t->hits.instance[ray] != instance || t->hits.triangle[ray] != triangle ||
        t->hits.distance[ray] != distance) {
        hit_set_print(&t->hits, &t->rays, ray);
        fail_msg("ray %u: %u/%u at %a expected", ray, instance, triangle, distance);
    }
}

QUERY_TEST_INLINE void expect_miss(const struct trial *t, uint32_t ray) {
    if (t->hits.instance[ray] == TRC_NO_HIT && !t->hits.occluded[ray])
        return;
    hit_set_print(&t->hits, &t->rays, ray);
    fail_msg("ray %u: a miss expected", ray);
}

/* Where arithmetic is exact, the oracle's nearest hit is the answer, bit for bit. */
QUERY_TEST_INLINE void expect_exact(const struct trial *t, const char *name) {
    struct brute_list list = {0};
    for (uint32_t i = 0; i < t->rays.count; i++) {
        brute_collect(&t->world, &t->rays, i, &list);
        const struct brute_candidate *best = brute_nearest(&list, &t->rays, i);
        if (best ? t->hits.instance[i] == best->instance && t->hits.triangle[i] == best->triangle &&
                       t->hits.distance[i] == (float)best->distance && t->hits.occluded[i]
                 : t->hits.instance[i] == TRC_NO_HIT && !t->hits.occluded[i])
            continue;
        hit_set_print(&t->hits, &t->rays, i);
        brute_list_print(&list);
        fail_msg("%s: ray %u", name, i);
    }
    brute_list_free(&list);
}

/* A triangle of its own vertices. */
QUERY_TEST_INLINE void add_corners(struct mesh *mesh, const float p[9]) {
    const uint32_t first = mesh->vertex_count;
    for (int k = 0; k < 3; k++)
        mesh_add_vertex(mesh, p[3 * k], p[3 * k + 1], p[3 * k + 2]);
    mesh_add_triangle(mesh, first, first + 1, first + 2);
}

#endif
