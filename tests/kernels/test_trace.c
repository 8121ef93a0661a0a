/* Closest and any hit against brute force, over whole worlds and many kinds of rays.
 *
 * Each world is built as a final scene (static meshes joined in world space) and as an interactive
 * one (a tree per mesh). For both: packets of every size give the same bits, scalar kernels give
 * the bits of the instruction set under test, occlusion is what the closest hit implies, and the
 * oracle in double precision finds nothing wrong. */
#include "aim.h"
#include "figures.h"
#include "query_test.h"

/* Rays of a world against brute force. */
#define USUAL_RAYS 3000

enum {
    RAYS_FAR,      /* one origin, 300 times as far */
    RAYS_PINHOLE,  /* one origin outside */
    RAYS_INSIDE,   /* one origin, all directions: all octants in a packet */
    RAYS_BEAM,     /* origins close together, nearly parallel: a lens or an area light */
    RAYS_RANDOM,   /* nothing in common */
    RAYS_ALIGNED,  /* one or two components are +0 or -0 */
    RAYS_SEGMENTS, /* tmin and tmax bound them, some are empty, some begin behind the origin */
    RAYS_SPARSE,   /* some of them are not valid: lanes that are off */
    RAYS_KINDS
};

struct ray_maker {
    struct rng rng;
    float lower[3], upper[3]; /* of the world, a little wider */
    struct ray_set *rays;
};

static void point_within(struct ray_maker *m, float p[3]) {
    for (int axis = 0; axis < 3; axis++)
        p[axis] = rng_range(&m->rng, m->lower[axis], m->upper[axis]);
}

static float world_size(const struct ray_maker *m) {
    return fmaxf(m->upper[0] - m->lower[0],
                 fmaxf(m->upper[1] - m->lower[1], m->upper[2] - m->lower[2]));
}

static void point_outside(struct ray_maker *m, float away, float p[3]) {
    float d[3];
    rng_direction(&m->rng, d);
    for (int axis = 0; axis < 3; axis++)
        p[axis] = 0.5f * (m->lower[axis] + m->upper[axis]) + away * world_size(m) * d[axis];
}

static void aligned_direction(struct rng *rng, float d[3]) {
    const uint32_t zeros = 1 + rng_below(rng, 6); /* bits of the axes that are 0 */
    for (uint32_t axis = 0; axis < 3; axis++) {
        const float zero = rng_bits(rng) & 1 ? 0.0f : -0.0f;
        d[axis] = zeros >> axis & 1u ? zero : rng_range(rng, -1.0f, 1.0f);
    }
}

static void make_segment(struct ray_maker *m, const float o[3], const float d[3], float time) {
    const float size = world_size(m);
    float tmin = 0.0f, tmax = INFINITY;
    switch (rng_below(&m->rng, 5)) {
    case 0:
        tmin = rng_range(&m->rng, 0.0f, 0.5f * size);
        break;
    case 1:
        tmax = rng_range(&m->rng, 0.0f, 0.5f * size);
        break;
    case 2:
        tmin = -INFINITY;
        break;
    case 3:
        tmin = rng_range(&m->rng, -size, size);
        tmax = tmin;
        break;
    default:
        tmin = rng_range(&m->rng, -size, size);
        tmax = tmin + rng_range(&m->rng, -0.1f * size, size);
    }
    ray_set_add(m->rays, o, d, tmin, tmax, time);
}

static void make_invalid(struct ray_maker *m, const float o[3], const float d[3]) {
    float broken_o[3], broken_d[3], tmin = 0.0f, tmax = INFINITY;
    const uint32_t axis = rng_below(&m->rng, 3);
    memcpy(broken_o, o, sizeof broken_o);
    memcpy(broken_d, d, sizeof broken_d);
    switch (rng_below(&m->rng, 7)) {
    case 0:
        broken_o[axis] = NAN;
        break;
    case 1:
        broken_o[axis] = -INFINITY;
        break;
    case 2:
        broken_d[axis] = NAN;
        break;
    case 3:
        broken_d[axis] = INFINITY;
        break;
    case 4:
        broken_d[0] = broken_d[1] = 0.0f;
        broken_d[2] = -0.0f;
        break;
    case 5:
        tmin = NAN;
        break;
    default:
        tmin = 2.0f;
        tmax = 1.0f;
    }
    ray_set_add(m->rays, broken_o, broken_d, tmin, tmax, 0.5f);
}

/* One ray of a packet whose rays share origin o and direction d, as far as its kind shares
 * anything. */
static void make_ray(struct ray_maker *m, uint32_t kind, const float o[3], const float d[3],
                     float time) {
    float a[3], b[3];
    memcpy(a, o, sizeof a);
    memcpy(b, d, sizeof b);
    if (kind == RAYS_FAR || kind == RAYS_PINHOLE || kind == RAYS_BEAM) {
        for (int axis = 0; axis < 3; axis++) {
            b[axis] += rng_range(&m->rng, -0.2f, 0.2f) * world_size(m);
            if (kind == RAYS_BEAM)
                a[axis] += rng_range(&m->rng, -0.02f, 0.02f) * world_size(m);
        }
    } else if (kind == RAYS_INSIDE) {
        rng_direction(&m->rng, b);
    } else {
        point_within(m, a);
        rng_direction(&m->rng, b);
    }
    if (kind == RAYS_ALIGNED)
        aligned_direction(&m->rng, b);
    if (kind == RAYS_SEGMENTS)
        make_segment(m, a, b, time);
    else if (kind == RAYS_SPARSE && rng_below(&m->rng, 4) != 0)
        make_invalid(m, a, b);
    else
        ray_set_add(m->rays, a, b, 0.0f, INFINITY, time);
}

/* 64 rays of a kind; every other packet lies in a narrow interval of time. */
static void make_packet(struct ray_maker *m, uint32_t kind) {
    const float stratum = floorf(16.0f * rng_unit(&m->rng));
    const bool narrow = rng_bits(&m->rng) & 1;
    float o[3], d[3], target[3];
    if (kind == RAYS_INSIDE)
        point_within(m, o);
    else
        point_outside(m, kind == RAYS_FAR ? 300.0f : 1.0f, o);
    point_within(m, target);
    for (int axis = 0; axis < 3; axis++)
        d[axis] = target[axis] - o[axis];
    for (int i = 0; i < 64; i++) {
        const float x = rng_unit(&m->rng);
        make_ray(m, kind, o, d, narrow ? (stratum + x) / 16.0f : x);
    }
}

static void make_rays(const struct query_scene *scene, uint32_t seed, uint32_t count,
                      struct ray_set *rays) {
    struct ray_maker m = {.rng = rng_seed(seed), .rays = rays};
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_ok(trc_scene_get_stats(scene->scene, &stats));
    for (int axis = 0; axis < 3; axis++) {
        const float low = stats.bounds_lower[axis], high = stats.bounds_upper[axis];
        m.lower[axis] = low - 0.1f * (high - low);
        m.upper[axis] = high + 0.1f * (high - low);
    }
    for (uint32_t kind = 0; rays->count < count; kind++)
        make_packet(&m, kind % RAYS_KINDS);
    rays->count -= 27; /* the last packet is never full */
}

/* ---- checks ---- */

static void expect_same(const char *name, const char *what, const struct hit_set *a,
                        const struct hit_set *b, const struct ray_set *rays) {
    const uint32_t ray = hit_set_difference(a, b);
    if (ray == UINT32_MAX)
        return;
    hit_set_print(a, rays, ray);
    hit_set_print(b, rays, ray);
    fail_msg("%s: %s differ at ray %u", name, what, ray);
}

/* Queries with all packet sizes, and with scalar kernels; hits gets the result. */
static void query_all_ways(const char *name, trc_scene scene, const struct ray_set *rays,
                           struct hit_set *hits) {
    static const uint32_t sizes[] = {1, 4, 16, 256, 0};
    struct hit_set other;
    hit_set_init(&other, rays->count);
    assert_ok(hit_set_query(hits, scene, rays, 64));
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        char what[64];
        (void)snprintf(what, sizeof what, "packets of 64 and of %u", sizes[i]);
        assert_ok(hit_set_query(&other, scene, rays, sizes[i]));
        expect_same(name, what, hits, &other, rays);
        struct ray_set reordered = *rays;
        reordered.flags = TRC_RAYS_REORDER;
        (void)snprintf(what, sizeof what, "packets of 64 and reordered ones of %u", sizes[i]);
        assert_ok(hit_set_query(&other, scene, &reordered, sizes[i]));
        expect_same(name, what, hits, &other, rays);
    }
    assert_ok(trc_set_isa(TRC_ISA_SCALAR));
    assert_ok(hit_set_query(&other, scene, rays, 64));
    assert_ok(trc_set_isa(TRC_ISA_AUTO));
    expect_same(name, "scalar and wide kernels", hits, &other, rays);
    hit_set_free(&other);
    for (uint32_t i = 0; i < rays->count; i++) {
        const bool hit = hits->instance[i] != TRC_NO_HIT && hits->distance[i] < rays->tmax[i];
        if (hit == (hits->occluded[i] == 1))
            continue;
        hit_set_print(hits, rays, i);
        fail_msg("%s: closest and any hit disagree at ray %u", name, i);
    }
}

/* Judges two sets of answers; the share of answers (two of a ray) that the oracle cannot vouch for
 * stays small. */
static void judge(const char *name, const struct query_world *world, const struct ray_set *rays,
                  const struct hit_set hits[2]) {
    struct brute_list list = {0};
    uint32_t doubtful = 0, hit_count = 0;
    for (uint32_t i = 0; i < rays->count; i++) {
        brute_collect(world, rays, i, &list);
        for (int k = 0; k < 2; k++) {
            const enum brute_verdict closest = brute_judge_closest(&list, rays, i, &hits[k]);
            const enum brute_verdict any = brute_judge_occluded(&list, rays, i, &hits[k]);
            doubtful += closest == BRUTE_DOUBTFUL || any == BRUTE_DOUBTFUL;
            hit_count += hits[k].instance[i] != TRC_NO_HIT;
            if (closest != BRUTE_DIFFERS && any != BRUTE_DIFFERS)
                continue;
            hit_set_print(&hits[k], rays, i);
            brute_list_print(&list);
            fail_msg("%s, %s scene: wrong at ray %u", name, k ? "final" : "interactive", i);
        }
    }
    print_figure(name, "0 wrong of %u rays, %u of them hit, %u in doubt", 2 * rays->count,
                 hit_count, doubtful);
    assert_true(hit_count > rays->count / 10);
    /* Matrices in motion are inverted in single precision for each ray, so bounds are wide. */
    bool turns = false;
    for (uint32_t i = 0; i < world->instance_count; i++)
        turns = turns || world->instances[i].key_count > 1;
    assert_true(doubtful < rays->count / (turns ? 3 : 10) + 10);
    brute_list_free(&list);
}

/* All of the above for a world, which is freed. is_plain: static and untransformed, where a joined
 * tree must give the bits of a tree per mesh. */
static void check_world(const char *name, struct query_world *world, bool is_plain) {
    struct ray_set rays;
    struct hit_set hits[2];
    ray_set_init(&rays);
    for (int is_final = 0; is_final < 2; is_final++) {
        struct query_scene scene = query_test_scene(world, is_final);
        if (!is_final)
            make_rays(&scene, 17, query_test_rays(USUAL_RAYS), &rays);
        hit_set_init(&hits[is_final], rays.count);
        query_all_ways(name, scene.scene, &rays, &hits[is_final]);
        query_scene_destroy(&scene);
    }
    if (is_plain)
        expect_same(name, "interactive and final scenes", &hits[0], &hits[1], &rays);
    judge(name, world, &rays, hits);
    hit_set_free(&hits[0]);
    hit_set_free(&hits[1]);
    ray_set_free(&rays);
    query_world_free(world);
}

/* ---- worlds ---- */

static const float unit_lower[3] = {-1, -1, -1}, unit_upper[3] = {1, 1, 1}, origin[3] = {0, 0, 0};
static const float no_scale[3] = {1, 1, 1}, z_axis[3] = {0, 0, 1};

static void soups(void **state) {
    (void)state;
    static const struct {
        const char *name;
        uint32_t count;
        float size;
    } soup[] = {{"one triangle", 1, 1.0f}, {"leaf", 8, 0.8f},
                {"small soup", 60, 0.5f},  {"fine soup", 2500, 0.1f},
                {"dense soup", 400, 0.9f}, {"soup of specks", 1500, 0.01f}};
    for (size_t i = 0; i < sizeof soup / sizeof *soup; i++) {
        struct query_world world;
        struct rng rng = rng_seed(i);
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        mesh_add_soup(mesh, &rng, soup[i].count, unit_lower, unit_upper, soup[i].size);
        if (soup[i].count == 1)
            mesh_add_box(mesh, unit_lower, unit_upper);
        if (soup[i].size < 0.05f)
            mesh_add_box(mesh, unit_lower, unit_upper);
        check_world(soup[i].name, &world, true);
    }
}

/* Long strips that slant among small triangles: final scenes clip them. */
static void slanting_strips(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(8);
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    mesh_add_soup(mesh, &rng, 2500, unit_lower, unit_upper, 0.05f);
    mesh_add_strips(mesh, &rng, 30, 2.0f, 0.02f);
    check_world("slanting strips", &world, true);
}

static void closed_shapes(void **state) {
    (void)state;
    struct query_world world;
    const float edge_u[3] = {8, 0, 0}, edge_v[3] = {0, 8, 0}, corner[3] = {-4, -4, 0};
    query_world_init(&world);
    mesh_add_uv_sphere(query_world_object(&world), origin, 1.0f, 24, 32);
    check_world("sphere of rings", &world, true);
    mesh_add_icosphere(query_world_object(&world), origin, 100.0f, 3);
    mesh_add_box(query_world_object(&world), unit_lower, unit_upper);
    check_world("icosphere around a box", &world, true);
    mesh_add_needle_fan(query_world_object(&world), 40, 1.0f, 1e4f);
    check_world("needles", &world, true);
    mesh_add_grid(query_world_object(&world), corner, edge_u, edge_v, 16, 16);
    mesh_add_box(query_world_object(&world), unit_lower, unit_upper);
    check_world("grid", &world, true);
}

/* Barycentrics of a needle are not worth much in float; its distance must be: of millions of rays
 * the worst was off by 3.4e-5 of it. */
#define NEEDLE_ERROR 6e-5
static void distances_on_needles(void **state) {
    (void)state;
    static const float aspects[] = {1e2f, 1e3f, 1e4f, 1e5f, 1e6f};
    for (size_t i = 0; i < sizeof aspects / sizeof *aspects; i++) {
        struct query_world world;
        struct rng rng = rng_seed(4);
        struct ray_set rays;
        struct hit_set hits;
        struct brute_list exact = {0};
        double most = 0.0;
        char title[64];
        query_world_init(&world);
        query_turned_needles(query_world_object(&world), 64, aspects[i]);
        const struct aim aim = {.mesh = &world.meshes[0], .at = AIM_EDGES, .reach = 0.3f};
        ray_set_init(&rays);
        aim_rays(&aim, &rng, query_test_rays(USUAL_RAYS), &rays);
        hit_set_init(&hits, rays.count);
        struct query_scene scene = query_test_scene(&world, true);
        assert_ok(hit_set_query(&hits, scene.scene, &rays, i % 2 ? 64 : 1));
        for (uint32_t ray = 0; ray < rays.count; ray++) {
            uint32_t k = 0;
            brute_collect(&world, &rays, ray, &exact);
            while (k < exact.count && exact.candidates[k].triangle != hits.triangle[ray])
                k++;
            assert_true(k < exact.count && hits.instance[ray] == 0);
            most = fmax(most, fabs(hits.distance[ray] / exact.candidates[k].distance - 1.0));
        }
        (void)snprintf(title, sizeof title, "4: distance on needles, %g times as long as wide",
                       (double)aspects[i]);
        print_figure(title, "at most %.1e of it off", most);
        assert_true(most < NEEDLE_ERROR);
        brute_list_free(&exact);
        hit_set_free(&hits);
        ray_set_free(&rays);
        query_scene_destroy(&scene);
        query_world_free(&world);
    }
}

/* Rotated, scaled unevenly, mirrored, moved far; several instances of one mesh, some meshes alone.
 */
static void add_instances(struct query_world *world, struct rng *rng, uint32_t mesh,
                          uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        float axis[3], scale[3], offset[3];
        struct query_instance *instance = query_world_instance(world, mesh);
        rng_direction(rng, axis);
        for (int k = 0; k < 3; k++) {
            scale[k] = rng_range(rng, 0.5f, 2.0f) * (rng_bits(rng) & 1 ? 1.0f : -1.0f);
            offset[k] = rng_range(rng, -4.0f, 4.0f);
        }
        query_transform(axis, rng_range(rng, -3.0f, 3.0f), scale, offset, instance->transforms[0]);
    }
}

static void instances(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(5);
    query_world_init(&world);
    mesh_add_soup(query_world_mesh(&world), &rng, 60, unit_lower, unit_upper, 0.5f);
    mesh_add_icosphere(query_world_mesh(&world), origin, 1.0f, 1);
    mesh_add_box(query_world_mesh(&world), unit_lower, unit_upper);
    add_instances(&world, &rng, 0, 6);
    add_instances(&world, &rng, 1, 10);
    add_instances(&world, &rng, 2, 1);
    check_world("instances", &world, false);
    mesh_add_soup(query_world_mesh(&world), &rng, 200, unit_lower, unit_upper, 0.5f);
    add_instances(&world, &rng, 0, 1);
    check_world("one transformed mesh", &world, false);
}

/* Moves every vertex of each further key by up to reach. */
static void jitter_keys(struct mesh *mesh, struct rng *rng, uint32_t key_count, float reach) {
    mesh_set_keys(mesh, key_count);
    for (uint32_t key = 1; key < key_count; key++)
        for (uint32_t i = 0; i < 3 * mesh->vertex_count; i++)
            mesh_key(mesh, key)[i] += rng_range(rng, -reach, reach);
}

static void moving_meshes(void **state) {
    (void)state;
    struct rng rng = rng_seed(6);
    for (uint32_t keys = 2; keys <= 5; keys += 3) {
        struct query_world world;
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        mesh_add_soup(mesh, &rng, 500, unit_lower, unit_upper, 0.3f);
        jitter_keys(mesh, &rng, keys, 0.5f);
        check_world(keys == 2 ? "moving soup, 2 keys" : "moving soup, 5 keys", &world, false);
        mesh = query_world_object(&world);
        mesh_add_icosphere(mesh, origin, 1.0f, 2);
        mesh_set_keys(mesh, keys);
        for (uint32_t key = 1; key < keys; key++) {
            const float offset[3] = {0.3f * (float)key, 0.0f, -0.1f * (float)key};
            float transform[12];
            query_transform(z_axis, 0.7f * (float)key, no_scale, offset, transform);
            mesh_key_transform(mesh, key, transform);
        }
        mesh_add_box(query_world_object(&world), unit_lower, unit_upper);
        check_world(keys == 2 ? "turning sphere, 2 keys" : "turning sphere, 5 keys", &world, false);
    }
}

static void moving_instances(void **state) {
    (void)state;
    struct rng rng = rng_seed(7);
    for (uint32_t keys = 2; keys <= 5; keys++) {
        struct query_world world;
        char name[40];
        query_world_init(&world);
        mesh_add_soup(query_world_mesh(&world), &rng, 120, unit_lower, unit_upper, 0.5f);
        mesh_add_icosphere(query_world_mesh(&world), origin, 1.0f, 1);
        if (keys == 3)
            jitter_keys(&world.meshes[0], &rng, 2, 0.3f); /* mesh and instance move */
        add_instances(&world, &rng, 0, 2);
        add_instances(&world, &rng, 1, 6);
        for (uint32_t i = 0; i < world.instance_count; i++) {
            struct query_instance *instance = &world.instances[i];
            instance->key_count = keys;
            for (uint32_t key = 1; key < keys; key++)
                for (int k = 0; k < 12; k++)
                    instance->transforms[key][k] =
                        instance->transforms[key - 1][k] + rng_range(&rng, -0.03f, 0.03f);
        }
        (void)snprintf(name, sizeof name, "moving instances, %u keys", keys);
        check_world(name, &world, false);
    }
}

/* Static, moving, joined and instanced objects together, with ties between objects. */
static void mixed_world(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(8);
    query_world_init(&world);
    mesh_add_soup(query_world_object(&world), &rng, 200, unit_lower, unit_upper, 0.4f);
    mesh_append(query_world_object(&world), &world.meshes[0]);
    mesh_append(query_world_object(&world), &world.meshes[0]);
    jitter_keys(&world.meshes[2], &rng, 2, 0.2f);
    mesh_add_box(query_world_mesh(&world), unit_lower, unit_upper);
    add_instances(&world, &rng, 3, 5);
    struct ray_set rays;
    struct hit_set hits;
    struct query_scene scene = query_test_scene(&world, true);
    ray_set_init(&rays);
    make_rays(&scene, 3, query_test_rays(USUAL_RAYS), &rays);
    hit_set_init(&hits, rays.count);
    query_all_ways("mixed world", scene.scene, &rays, &hits);
    for (uint32_t i = 0; i < rays.count; i++) /* the copy never wins a tie */
        assert_int_not_equal(hits.instance[i], 1);
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(soups),
        cmocka_unit_test(slanting_strips),
        cmocka_unit_test(closed_shapes),
        cmocka_unit_test(distances_on_needles),
        cmocka_unit_test(instances),
        cmocka_unit_test(moving_meshes),
        cmocka_unit_test(moving_instances),
        cmocka_unit_test(mixed_world),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("trace", tests, NULL, NULL);
}
