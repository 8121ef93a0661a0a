/* Watertightness: rays aimed at vertices and at edges of closed meshes from inside never get out.
 *
 * A closed surface that turns once around the origin of a ray is met by every ray, whatever the
 * rounding of its vertices: so each miss is a defect. Every case runs with rays of one origin and
 * with rays of their own, in packets and alone, through a tree per mesh and through a joined one,
 * and prints how many rays missed. Rays without a miss bound the rate of misses at 3 / rays (95 %).
 *
 * TRACER_TEST_RAYS sets the number of rays of each case; tests/watertight.sh sends ten million. */
#include "aim.h"
#include "bvh/tree.h"
#include "figures.h"
#include "query_test.h"

#define USUAL_RAYS 48000
/* A ray at a vertex of valence 10,000 meets so many triangles, 25 ns each: a tenth of the rays. */
#define VALENCE_RAYS_DIVISOR 10
/* Rays of one query. */
#define BATCH 16384

/* Misses of a batch, closest and any hit. */
static uint64_t batch_misses(const struct ray_set *rays, const struct hit_set *hits) {
    uint64_t misses = 0;
    for (uint32_t i = 0; i < rays->count; i++) {
        const bool missed = hits->instance[i] == TRC_NO_HIT, open = hits->occluded[i] == 0;
        if ((missed || open) && misses == 0)
            hit_set_print(hits, rays, i);
        misses += missed || open;
    }
    return misses;
}

/* Misses of count rays against one scene. */
static uint64_t count_misses(const struct aim *aim, trc_scene scene, uint32_t count,
                             uint32_t packet_size, uint64_t seed) {
    struct rng rng = rng_seed(seed);
    struct ray_set rays;
    struct hit_set hits;
    uint64_t misses = 0;
    ray_set_init(&rays);
    hit_set_init(&hits, BATCH);
    for (uint32_t done = 0; done < count; done += hits.count) {
        hits.count = count - done < BATCH ? count - done : BATCH;
        ray_set_clear(&rays);
        aim_rays(aim, &rng, hits.count, &rays);
        assert_ok(hit_set_query(&hits, scene, &rays, packet_size));
        misses += batch_misses(&rays, &hits);
    }
    hit_set_free(&hits);
    ray_set_free(&rays);
    return misses;
}

/* Four parts of the rays in packets of 256, 64, 16 and 1; joined and instanced trees share them. */
static void expect_closed(const char *name, const struct query_world *world, const struct aim *aim,
                          uint32_t rays) {
    static const uint32_t sizes[] = {256, 64, 16, 1};
    const uint32_t count = (rays + 7) / 8;
    uint64_t misses = 0;
    for (int is_final = 0; is_final < 2; is_final++) {
        struct query_scene scene = query_test_scene(world, is_final);
        for (uint32_t i = 0; i < 4; i++)
            misses += count_misses(aim, scene.scene, count, sizes[i], 2 * i + (uint32_t)is_final);
        query_scene_destroy(&scene);
    }
    print_misses(name, misses, 8ull * count);
    assert_int_equal(misses, 0);
}

/* A world of one mesh that fill makes; then the case for each aim, with so many rays. */
static void expect_closed_rays(const char *name, void (*fill)(struct mesh *mesh),
                               const float inside[3], float reach, uint32_t rays) {
    static const char *const aims[] = {"vertices", "edges"};
    struct query_world world;
    query_world_init(&world);
    fill(query_world_object(&world));
    for (uint32_t at = AIM_VERTICES; at <= AIM_EDGES; at++) {
        char title[64];
        const struct aim aim = {&world.meshes[0], at, {inside[0], inside[1], inside[2]}, reach};
        (void)snprintf(title, sizeof title, "%s, %s", name, aims[at]);
        expect_closed(title, &world, &aim, rays);
    }
    query_world_free(&world);
}

static void expect_closed_mesh(const char *name, void (*fill)(struct mesh *mesh),
                               const float inside[3], float reach) {
    expect_closed_rays(name, fill, inside, reach, query_test_rays(USUAL_RAYS));
}

static const float origin[3] = {0, 0, 0}, far_center[3] = {148376, 1234, -223423};

/* ---- static: cases 1 to 5 ---- */

static void fill_sphere(struct mesh *mesh) { mesh_add_uv_sphere(mesh, origin, 1.0f, 48, 64); }
static void fill_icosphere(struct mesh *mesh) { mesh_add_icosphere(mesh, origin, 1.0f, 4); }
static void fill_far_sphere(struct mesh *mesh) {
    mesh_add_uv_sphere(mesh, far_center, 100.0f, 48, 64);
}
static void fill_far_small_sphere(struct mesh *mesh) { /* vertices are rounded to 1/64 */
    mesh_add_uv_sphere(mesh, far_center, 1.0f, 12, 16);
}
static void fill_fan(struct mesh *mesh) { mesh_add_needle_fan(mesh, 512, 1.0f, 1e6f); }
static void fill_thin_fan(struct mesh *mesh) { mesh_add_even_bipyramid(mesh, 32, 1e-6f, 1.0f); }
static void fill_valence(struct mesh *mesh) { mesh_add_even_bipyramid(mesh, 10000, 1.0f, 1.0f); }
static void fill_flat_valence(struct mesh *mesh) {
    mesh_add_even_bipyramid(mesh, 10000, 1.0f, 1e-3f);
}
static void fill_box(struct mesh *mesh) {
    const float lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1};
    mesh_add_box(mesh, lower, upper);
}

/* Each face a grid, so that boxes of the tree have no thickness. */
static void fill_grids(struct mesh *mesh) {
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            float at[3] = {-1, -1, -1}, u[3] = {0, 0, 0}, v[3] = {0, 0, 0};
            at[axis] = side ? 1.0f : -1.0f;
            u[(axis + 1) % 3] = 2.0f;
            v[(axis + 2) % 3] = 2.0f;
            mesh_add_grid(mesh, at, u, v, 16, 16);
        }
}

static void spheres(void **state) {
    (void)state;
    expect_closed_mesh("1, 2: sphere", fill_sphere, origin, 0.5f);
    expect_closed_mesh("1, 2: sphere, its centre", fill_sphere, origin, 0.0f);
    expect_closed_mesh("1, 2: icosphere", fill_icosphere, origin, 0.5f);
    expect_closed_mesh("1, 2: box", fill_box, origin, 0.99f);
    expect_closed_mesh("10: box of grids", fill_grids, origin, 0.99f);
}

static void far_spheres(void **state) {
    (void)state;
    expect_closed_mesh("3: sphere far away", fill_far_sphere, far_center, 50.0f);
    expect_closed_mesh("3: small sphere far away", fill_far_small_sphere, far_center, 0.5f);
}

static void needles_and_valence(void **state) {
    (void)state;
    expect_closed_mesh("4: fan of needles", fill_fan, origin, 0.3f);
    expect_closed_mesh("4: needle pyramid", fill_thin_fan, origin, 1e-7f);
    const uint32_t rays = query_test_rays(USUAL_RAYS) / VALENCE_RAYS_DIVISOR;
    expect_closed_rays("5: valence 10,000", fill_valence, origin, 0.3f, rays);
    expect_closed_rays("5: valence 10,000, flat", fill_flat_valence, origin, 3e-4f, rays);
}

/* A long thin pyramid that slants: final scenes cut its triangles, for which the triangles of a
 * small sphere beside it make room. */
static void clipped_needles(void **state) {
    (void)state;
    static const float beside[3] = {0.5f, -0.5f, 0.5f}, axis[3] = {1, 2, 3}, scale[3] = {1, 1, 1};
    static const char *const aims[] = {"vertices", "edges"};
    struct query_world world;
    float turn[12];
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    mesh_add_even_bipyramid(mesh, 16, 0.02f, 1.0f);
    query_transform(axis, 1.0f, scale, origin, turn);
    mesh_transform(mesh, 0, turn);
    mesh_add_icosphere(query_world_object(&world), beside, 0.01f, 4);
    struct query_scene scene = query_test_scene(&world, true);
    const struct trc_tree *tree = query_scene_snapshot(scene.scene)->bvh->tree;
    assert_true(tree->slot_count > tree->triangle_count + 100);
    query_scene_destroy(&scene);
    for (uint32_t at = AIM_VERTICES; at <= AIM_EDGES; at++) {
        char title[64];
        const struct aim aim = {.mesh = &world.meshes[0], .at = at, .reach = 0.005f};
        (void)snprintf(title, sizeof title, "4: clipped needles, %s", aims[at]);
        expect_closed(title, &world, &aim, query_test_rays(USUAL_RAYS));
    }
    query_world_free(&world);
}

/* Scaled to where products underflow and where they nearly overflow. */
static void extreme_sizes(void **state) {
    (void)state;
    static const struct {
        const char *name;
        float radius;
    } sizes[] = {{"sphere of radius 1e-20", 1e-20f},
                 {"sphere of radius 1e-30", 1e-30f},
                 {"sphere of radius 1e-38", 1e-38f},
                 {"sphere of radius 1e10", 1e10f},
                 {"sphere of radius 1e18", 1e18f}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        struct query_world world;
        query_world_init(&world);
        mesh_add_uv_sphere(query_world_object(&world), origin, sizes[i].radius, 24, 32);
        const struct aim aim = {
            .mesh = &world.meshes[0], .at = AIM_BOTH, .reach = 0.3f * sizes[i].radius};
        expect_closed(sizes[i].name, &world, &aim, query_test_rays(USUAL_RAYS));
        query_world_free(&world);
    }
}

/* From outside, ever farther away: the surface still turns once around the axis of the ray, so rays
 * through the middle meet it, though its triangles are small against the distance. */
static void seen_from_far(void **state) {
    (void)state;
    struct query_world world;
    const uint32_t count = query_test_rays(USUAL_RAYS) / 4;
    query_world_init(&world);
    mesh_add_uv_sphere(query_world_object(&world), origin, 1.0f, 24, 32);
    struct query_scene scene = query_test_scene(&world, false);
    for (float distance = 1e3f; distance < 2e6f; distance *= 10.0f) {
        struct rng rng = rng_seed(15);
        struct ray_set rays;
        struct hit_set hits;
        float o[3] = {0};
        ray_set_init(&rays);
        hit_set_init(&hits, count);
        for (uint32_t i = 0; i < count; i++) {
            float target[3];
            if (i % 64 == 0 || (i / 64 & 1)) {
                rng_direction(&rng, o);
                for (int axis = 0; axis < 3; axis++)
                    o[axis] *= distance;
            }
            for (int axis = 0; axis < 3; axis++)
                target[axis] = rng_range(&rng, -0.1f, 0.1f);
            ray_set_aim(&rays, o, target, 0.0f);
        }
        assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
        const uint64_t misses = batch_misses(&rays, &hits);
        char title[64];
        (void)snprintf(title, sizeof title, "15: seen from %g", (double)distance);
        print_misses(title, misses, count);
        assert_int_equal(misses, 0);
        hit_set_free(&hits);
        ray_set_free(&rays);
    }
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* ---- instances ---- */

/* The mesh as it stands in the world at a time, vertices rounded once: only to aim at. */
static void instances(void **state) {
    (void)state;
    const float axis[3] = {1, 2, 3};
    static const float scales[4][3] = {{1, 1, 1}, {-2, 2, 2}, {0.01f, 1, 5}, {1e-3f, 1e-3f, 1e-3f}};
    for (int i = 0; i < 4; i++) {
        struct query_world aimed, traced;
        float transform[12];
        const float offset[3] = {3.0f * (float)i, -1.0f, 0.5f};
        char title[64];
        query_transform(axis, 0.3f + (float)i, scales[i], offset, transform);
        query_world_init(&aimed);
        query_world_init(&traced);
        fill_sphere(query_world_object(&aimed));
        mesh_append(query_world_object(&traced), &aimed.meshes[0]);
        mesh_transform(&aimed.meshes[0], 0, transform);
        memcpy(traced.instances[0].transforms[0], transform, sizeof transform);
        struct query_scene scene = query_test_scene(&traced, false);
        struct aim aim = {.mesh = &aimed.meshes[0], .at = AIM_BOTH};
        memcpy(aim.inside, offset, sizeof offset);
        aim.reach = 0.1f * fminf(fabsf(scales[i][0]), fabsf(scales[i][1]));
        const uint32_t count = query_test_rays(USUAL_RAYS);
        const uint64_t misses = count_misses(&aim, scene.scene, count, 64, 9);
        (void)snprintf(title, sizeof title, "instance scaled by %g %g %g", scales[i][0],
                       scales[i][1], scales[i][2]);
        print_misses(title, misses, count);
        assert_int_equal(misses, 0);
        query_scene_destroy(&scene);
        query_world_free(&aimed);
        query_world_free(&traced);
    }
}

/* ---- in motion: cases 19 to 24 ---- */

/* Key k of the unit sphere: moved, turned and scaled by k times the steps. */
static void sphere_in_motion(struct mesh *mesh, uint32_t keys, const float step[3], float turn,
                             float growth) {
    const float axis[3] = {1, 2, -1};
    mesh_add_uv_sphere(mesh, origin, 1.0f, 24, 32);
    mesh_set_keys(mesh, keys);
    for (uint32_t key = 1; key < keys; key++) {
        const float k = (float)key, s = powf(growth, k);
        const float scale[3] = {s, s, s}, offset[3] = {k * step[0], k * step[1], k * step[2]};
        float transform[12];
        query_transform(axis, k * turn, scale, offset, transform);
        mesh_key_transform(mesh, key, transform);
    }
}

static const float no_step[3] = {0, 0, 0}, small_step[3] = {0.2f, -0.1f, 0.15f};

static void fill_moved(struct mesh *mesh) { sphere_in_motion(mesh, 2, small_step, 0.0f, 1.0f); }
static void fill_turned(struct mesh *mesh) { sphere_in_motion(mesh, 2, no_step, 1.5f, 1.0f); }
static void fill_scaled(struct mesh *mesh) { sphere_in_motion(mesh, 2, no_step, 0.0f, 7.0f); }
static void fill_all(struct mesh *mesh) { sphere_in_motion(mesh, 5, small_step, 0.8f, 1.4f); }

static void moving_spheres(void **state) {
    (void)state;
    expect_closed_mesh("19: sphere that moves", fill_moved, origin, 0.3f);
    expect_closed_mesh("19: sphere that turns", fill_turned, origin, 0.3f);
    expect_closed_mesh("19: sphere that grows", fill_scaled, origin, 0.3f);
    expect_closed_mesh("19, 22: sphere that does all, 5 keys", fill_all, small_step, 0.05f);
}

/* Half of the vertices stand still, so many edges join a static and a moving triangle. */
static void fill_half_moving(struct mesh *mesh) {
    mesh_add_icosphere(mesh, origin, 1.0f, 3);
    mesh_set_keys(mesh, 2);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        float *p = mesh_key(mesh, 1) + 3 * (size_t)i;
        const float s = p[2] > 0.0f ? 1.7f : 1.0f;
        for (int axis = 0; axis < 3; axis++)
            p[axis] *= s;
    }
}

static void static_and_moving(void **state) {
    (void)state;
    expect_closed_mesh("20: static beside moving, one mesh", fill_half_moving, origin, 0.5f);
}

/* The same surface as two meshes, static and moving, that share their border: vertices that do not
 * move must come out of interpolation as they went in. */
static void two_meshes(void **state) {
    (void)state;
    struct query_world whole, parts;
    query_world_init(&whole);
    query_world_init(&parts);
    struct mesh *all = query_world_object(&whole);
    fill_half_moving(all);
    for (int moving = 0; moving < 2; moving++) {
        struct mesh *part = query_world_object(&parts);
        for (uint32_t i = 0; i < all->vertex_count; i++) {
            const float *p = all->positions + 3 * (size_t)i;
            mesh_add_vertex(part, p[0], p[1], p[2]);
        }
        for (uint32_t i = 0; i < all->triangle_count; i++) {
            const uint32_t *v = all->indices + 3 * (size_t)i;
            bool moves = false;
            for (int k = 0; k < 3; k++)
                moves = moves || memcmp(all->positions + 3 * (size_t)v[k],
                                        mesh_key(all, 1) + 3 * (size_t)v[k], 12) != 0;
            if (moves == (moving == 1))
                mesh_add_triangle(part, v[0], v[1], v[2]);
        }
        if (!moving)
            continue;
        mesh_set_keys(part, 2);
        memcpy(mesh_key(part, 1), mesh_key(all, 1), 12 * (size_t)all->vertex_count);
    }
    uint64_t misses = 0;
    const uint32_t count = query_test_rays(USUAL_RAYS) / 2;
    const struct aim aim = {.mesh = &whole.meshes[0], .at = AIM_BOTH, .reach = 0.5f};
    for (int is_final = 0; is_final < 2; is_final++) {
        struct query_scene scene = query_test_scene(&parts, is_final);
        misses += count_misses(&aim, scene.scene, count, 64, 11 + (uint32_t)is_final);
        query_scene_destroy(&scene);
    }
    print_misses("20: static beside moving, two meshes", misses, 2 * count);
    query_world_free(&whole);
    query_world_free(&parts);
    assert_int_equal(misses, 0);
}

/* Through the origin from -1e6 to 1e6; the rays start inside at their own time. */
static void fill_passing(struct mesh *mesh) {
    const float step[3] = {2e6f, 2e6f, -2e6f};
    sphere_in_motion(mesh, 2, step, 0.0f, 1.0f);
    const float back[12] = {1, 0, 0, -1e6f, 0, 1, 0, -1e6f, 0, 0, 1, 1e6f};
    mesh_transform(mesh, 0, back);
    for (uint32_t i = 0; i < mesh->vertex_count; i++) {
        float *p = mesh_key(mesh, 1) + 3 * (size_t)i;
        p[0] -= 1e6f;
        p[1] -= 1e6f;
        p[2] += 1e6f;
    }
}

static void through_the_origin(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(21);
    struct ray_set rays;
    struct hit_set hits;
    const uint32_t count = query_test_rays(USUAL_RAYS);
    query_world_init(&world);
    fill_passing(query_world_object(&world));
    const struct aim aim = {.mesh = &world.meshes[0], .at = AIM_BOTH};
    struct query_scene scene = query_test_scene(&world, false);
    ray_set_init(&rays);
    for (uint32_t i = 0; i < count; i++) {
        const float time = 0.5f + rng_range(&rng, -1e-7f, 1e-7f);
        float o[3], target[3];
        const double f = time, step = 2e6 * f - 1e6;
        for (int axis = 0; axis < 3; axis++)
            o[axis] = (float)(axis == 2 ? -step : step);
        aim_target(&aim, &rng, time, target);
        ray_set_aim(&rays, o, target, time);
    }
    hit_set_init(&hits, count);
    assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
    const uint64_t misses = batch_misses(&rays, &hits);
    print_misses("21: through the origin at 1e6", misses, count);
    assert_int_equal(misses, 0);
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* Times at the joins of segments, their neighbours, and outside, where they count as 0 or 1. */
static void joins_of_segments(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(22);
    struct ray_set rays;
    struct hit_set hits, clamped;
    const uint32_t count = query_test_rays(USUAL_RAYS);
    static const float times[] = {0.0f, 0.25f, 0.5f, 0.75f, 1.0f, -1.0f, 2.0f, -0.0f};
    query_world_init(&world);
    fill_all(query_world_object(&world));
    const struct aim aim = {.mesh = &world.meshes[0], .at = AIM_BOTH};
    struct query_scene scene = query_test_scene(&world, false);
    ray_set_init(&rays);
    for (uint32_t i = 0; i < count; i++) {
        const float join = times[rng_below(&rng, 8)];
        const uint32_t side = rng_below(&rng, 3);
        const float time = side == 0 ? join : nextafterf(join, side == 1 ? -INFINITY : INFINITY);
        float target[3];
        aim_target(&aim, &rng, fminf(fmaxf(time, 0.0f), 1.0f), target);
        ray_set_aim(&rays, small_step, target, time);
    }
    hit_set_init(&hits, count);
    hit_set_init(&clamped, count);
    assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
    for (uint32_t i = 0; i < count; i++)
        rays.time[i] = fminf(fmaxf(rays.time[i], 0.0f), 1.0f);
    assert_ok(hit_set_query(&clamped, scene.scene, &rays, 64));
    const uint64_t misses = batch_misses(&rays, &hits);
    print_misses("22: joins of segments", misses, count);
    assert_int_equal(misses, 0);
    assert_int_equal(hit_set_difference(&hits, &clamped), UINT32_MAX);
    hit_set_free(&hits);
    hit_set_free(&clamped);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* A sphere that turns inside out through a point at time 0.5: hits are finite, and there are none
 * missing but where it is a point. */
static void fill_inverting(struct mesh *mesh) {
    const float inverted[12] = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0};
    mesh_add_uv_sphere(mesh, origin, 1.0f, 24, 32);
    mesh_set_keys(mesh, 2);
    mesh_key_transform(mesh, 1, inverted);
}

static void collapse_and_inversion(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(23);
    struct ray_set rays;
    struct hit_set hits;
    const uint32_t count = query_test_rays(USUAL_RAYS);
    uint64_t misses = 0;
    query_world_init(&world);
    fill_inverting(query_world_object(&world));
    const struct aim aim = {.mesh = &world.meshes[0], .at = AIM_BOTH};
    struct query_scene scene = query_test_scene(&world, false);
    ray_set_init(&rays);
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t near = rng_below(&rng, 4);
        const float time = near == 0   ? 0.5f
                           : near == 1 ? nextafterf(0.5f, rng_bits(&rng) & 1 ? 0.0f : 1.0f)
                                       : rng_unit(&rng);
        float target[3];
        aim_target(&aim, &rng, near == 0 ? 0.0f : time, target);
        ray_set_aim(&rays, origin, target, time);
    }
    hit_set_init(&hits, count);
    assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
    for (uint32_t i = 0; i < count; i++) {
        const bool hit = hits.instance[i] != TRC_NO_HIT;
        if (hit == (rays.time[i] != 0.5f)) {
            assert_true(isfinite(hits.distance[i]) && isfinite(hits.normal[0][i]) &&
                        isfinite(hits.normal[1][i]) && isfinite(hits.normal[2][i]));
            continue;
        }
        if (!misses++)
            hit_set_print(&hits, &rays, i);
    }
    print_misses("23: collapse and inversion", misses, count);
    assert_int_equal(misses, 0);
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* One vertex moves 1e4 times as far as the rest. */
#define FAR_VERTEX 100
static void fill_one_far(struct mesh *mesh) {
    sphere_in_motion(mesh, 2, no_step, 0.0f, 1.0001f);
    for (int axis = 0; axis < 3; axis++)
        mesh_key(mesh, 1)[3 * FAR_VERTEX + axis] *= 1e4f;
}

static void one_vertex_far(void **state) {
    (void)state;
    expect_closed_mesh("24: one vertex moves 1e4 times the rest", fill_one_far, origin, 0.3f);
}

/* Rays within the spike that this vertex pulls, at its tip: they meet its inner sides, whose planes
 * are so steep that rounding could move the hit behind the ray's origin, though no corner is. */
static void inside_a_spike(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(25);
    struct ray_set rays;
    struct hit_set hits;
    const uint32_t count = query_test_rays(USUAL_RAYS);
    query_world_init(&world);
    fill_one_far(query_world_object(&world));
    struct query_scene scene = query_test_scene(&world, false);
    ray_set_init(&rays);
    for (uint32_t i = 0; i < count; i++) {
        const float time = rng_unit(&rng);
        float o[3], tip[3];
        aim_vertex(&world.meshes[0], FAR_VERTEX, time, tip);
        for (int axis = 0; axis < 3; axis++)
            o[axis] = rng_range(&rng, -0.3f, 0.3f);
        ray_set_aim(&rays, o, tip, time);
    }
    hit_set_init(&hits, count);
    assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
    const uint64_t misses = batch_misses(&rays, &hits);
    print_misses("24: inside its spike", misses, count);
    assert_int_equal(misses, 0);
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres),
        cmocka_unit_test(far_spheres),
        cmocka_unit_test(needles_and_valence),
        cmocka_unit_test(clipped_needles),
        cmocka_unit_test(extreme_sizes),
        cmocka_unit_test(seen_from_far),
        cmocka_unit_test(instances),
        cmocka_unit_test(moving_spheres),
        cmocka_unit_test(static_and_moving),
        cmocka_unit_test(two_meshes),
        cmocka_unit_test(through_the_origin),
        cmocka_unit_test(joins_of_segments),
        cmocka_unit_test(collapse_and_inversion),
        cmocka_unit_test(one_vertex_far),
        cmocka_unit_test(inside_a_spike),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("watertight", tests, NULL, NULL);
}
