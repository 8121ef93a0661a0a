/* What the ray queries promise, rule by rule: intervals, ties, triangles and rays that do not
 * count, rays on planes and boxes. Numbers at the ends of their range: test_trace_numbers.c. */
#include "figures.h"
#include "trial.h"

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

static const float unit_lower[3] = {-1, -1, -1}, unit_upper[3] = {1, 1, 1};

/* A right triangle in the plane z = height that covers the origin. */
static void add_floor(struct mesh *mesh, float height) {
    const uint32_t v = mesh_add_vertex(mesh, -4, -4, height);
    mesh_add_vertex(mesh, 12, -4, height);
    mesh_add_vertex(mesh, -4, 12, height);
    mesh_add_triangle(mesh, v, v + 1, v + 2);
}

/* ---- intervals ---- */

/* Closest hits lie in (tmin, tmax], occluders in (tmin, tmax). */
static void intervals_are_half_open(void **state) {
    (void)state;
    struct trial t;
    trial_init(&t);
    add_floor(query_world_object(&t.world), 2.0f);
    const float down = nextafterf(2.0f, 0.0f), up = nextafterf(2.0f, 3.0f), d[3] = {0, 0, 1};
    const struct {
        float tmin, tmax;
        bool closest, any;
    } cases[] = {{0, INFINITY, true, true},
                 {2, INFINITY, false, false},
                 {down, INFINITY, true, true},
                 {up, INFINITY, false, false},
                 {0, 2, true, false},
                 {0, up, true, true},
                 {0, down, false, false},
                 {2, 2, false, false},
                 {down, 2, true, false},
                 {down, up, true, true},
                 {3, 1, false, false},
                 {-INFINITY, INFINITY, true, true},
                 {-INFINITY, -1, false, false},
                 {INFINITY, INFINITY, false, false},
                 {NAN, INFINITY, false, false},
                 {0, NAN, false, false},
                 {-INFINITY, -INFINITY, false, false}};
    const uint32_t count = sizeof cases / sizeof *cases;
    for (uint32_t i = 0; i < 70; i++)
        ray_set_add(&t.rays, origin, d, cases[i % count].tmin, cases[i % count].tmax, 0.0f);
    for (int is_final = 0; is_final < 2; is_final++) {
        run(&t, is_final);
        for (uint32_t i = 0; i < t.rays.count; i++) {
            const bool hit = t.hits.instance[i] != TRC_NO_HIT;
            if (hit != cases[i % count].closest || t.hits.occluded[i] != cases[i % count].any) {
                hit_set_print(&t.hits, &t.rays, i);
                fail_msg("case %u", i % count);
            }
        }
    }
    trial_free(&t);
}

/* Distances are in units of the direction's length, also where the length is extreme. */
static void directions_need_not_be_unit(void **state) {
    (void)state;
    static const float lengths[] = {1.0f,   3.0f,  1e-6f,  1e6f,  1e-18f, 1e18f,
                                    1e-30f, 1e30f, 1e-37f, 1e38f, 1e-40f, 1e-44f};
    struct trial t;
    trial_init(&t);
    const float height = 0x1p-20f; /* so that distances stay finite */
    add_floor(query_world_object(&t.world), height);
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        const float d[3] = {0, 0, lengths[i]};
        const double exact = (double)height / lengths[i];
        ray_set_add_simple(&t.rays, origin, d);
        ray_set_add(&t.rays, origin, d, (float)(exact * 1.001), INFINITY, 0.0f);
        ray_set_add(&t.rays, origin, d, 0.0f, (float)(exact * 0.999), 0.0f);
    }
    run(&t, false);
    for (uint32_t i = 0; i < t.rays.count; i += 3) {
        const double exact = (double)height / t.rays.direction[2][i];
        if (t.hits.instance[i] == TRC_NO_HIT ||
            !(fabs(t.hits.distance[i] - exact) <= 1e-6 * exact + 0x1p-149)) {
            hit_set_print(&t.hits, &t.rays, i);
            fail_msg("%g expected", exact);
        }
        if ((float)(exact * 1.001) < INFINITY)
            expect_miss(&t, i + 1);
        if (exact > 1e-35)
            expect_miss(&t, i + 2);
    }
    trial_free(&t);
}

/* ---- ties ---- */

/* Copies of a triangle: the lowest number wins whatever its place in the tree. */
static void lowest_number_wins(void **state) {
    (void)state;
    struct rng rng = rng_seed(16);
    uint64_t total = 0;
    for (int kind = 0; kind < 3; kind++) {
        struct trial t;
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        mesh_add_soup(mesh, &rng, 30, unit_lower, unit_upper, 0.7f);
        for (int copies = 0; copies < 3; copies++)
            for (uint32_t i = 0; i < 30; i++) {
                /* The same place, first another corner: the same plane with other rounding. */
                const uint32_t *v = mesh->indices + 3 * (size_t)(kind == 0 ? i : 29 - i);
                mesh_add_triangle(mesh, v[0], v[1], v[2]);
            }
        if (kind == 2) {
            mesh_set_keys(mesh, 2);
            for (uint32_t i = 0; i < 3 * mesh->vertex_count; i++)
                mesh_key(mesh, 1)[i] += rng_range(&rng, -0.2f, 0.2f);
        }
        for (int copies = 0; copies < 2; copies++) {
            if (kind == 2)
                query_world_instance(&t.world, 0);
            else
                mesh_append(query_world_object(&t.world), mesh);
        }
        for (int i = 0; i < 1000; i++) {
            float o[3], d[3];
            rng_direction(&rng, d);
            for (int axis = 0; axis < 3; axis++)
                o[axis] = -2.0f * d[axis] + 0.3f * rng_unit(&rng);
            ray_set_add(&t.rays, o, d, 0.0f, INFINITY, rng_unit(&rng));
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            uint32_t hits = 0;
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++) {
                if (t.hits.instance[i] == TRC_NO_HIT)
                    continue;
                hits++;
                assert_int_equal(t.hits.instance[i], 0);
                assert_true(t.hits.triangle[i] < 30);
            }
            assert_true(hits > 300);
            total += hits;
        }
        trial_free(&t);
    }
    print_right("16: the lowest number of coplanar copies", total);
}

/* ---- triangles that do not count ---- */

/* Duplicate vertices, no extent, vertices on a line: never hit, wherever rays aim. */
static void degenerate_triangles_are_never_hit(void **state) {
    (void)state;
    struct trial t;
    struct rng rng = rng_seed(11);
    trial_init(&t);
    struct mesh *mesh = query_world_object(&t.world);
    static const float corners[][9] = {
        {1, 2, 3, 1, 2, 3, 1, 2, 3},          {0, 0, 0, 1, 1, 1, 1, 1, 1},
        {0, 0, 0, 0, 0, 0, 1, -1, 2},         {1, 0, 0, 0, 1, 0, 1, 0, 0},
        {0, 0, 0, 1, 1, 1, 2, 2, 2},          {-1, -1, -1, 0, 0, 0, 3, 3, 3},
        {0, 0, 1, 0, 0, 3, 0, 0, -4},         {1, 2, 3, 3, 6, 9, 2, 4, 6},
        {0.1f, 0, 0, 0.2f, 0, 0, 0.7f, 0, 0}, {-3, 5, 0, 3, -5, 0, 0, 0, 0}};
    for (size_t i = 0; i < sizeof corners / sizeof *corners; i++)
        add_corners(mesh, corners[i]);
    for (uint32_t i = 0; i < 300; i++) { /* whole numbers on a line */
        float p[9];
        for (int axis = 0; axis < 3; axis++) {
            const float from = (float)rng_below(&rng, 201) - 100.0f;
            const float step = (float)rng_below(&rng, 201) - 100.0f;
            p[axis] = from;
            p[3 + axis] = from + step;
            p[6 + axis] = from + 3.0f * step;
        }
        add_corners(mesh, p);
    }
    for (uint32_t i = 0; i < 30000; i++) {
        const float *p = mesh->positions + 9 * (size_t)rng_below(&rng, mesh->triangle_count);
        const float share = i % 3 ? rng_unit(&rng) : (float)rng_below(&rng, 3) / 2.0f;
        float target[3], o[3];
        for (int axis = 0; axis < 3; axis++) {
            target[axis] = p[axis] + share * (p[6 + axis] - p[axis]);
            o[axis] = i & 1 ? rng_range(&rng, -50.0f, 50.0f) : (float)rng_below(&rng, 9) - 4.0f;
        }
        ray_set_aim(&t.rays, o, target, 0.0f);
    }
    for (int is_final = 0; is_final < 2; is_final++) {
        uint32_t wrong = 0;
        run(&t, is_final);
        for (uint32_t i = 0; i < t.rays.count; i++) {
            if (t.hits.instance[i] == TRC_NO_HIT && !t.hits.occluded[i])
                continue;
            if (!wrong++)
                hit_set_print(&t.hits, &t.rays, i);
        }
        if (wrong)
            print_message("%u of %u rays hit a degenerate triangle\n", wrong, t.rays.count);
        assert_int_equal(wrong, 0);
    }
    print_right("11: triangles without area", 2 * t.rays.count);
    trial_free(&t);
}

/* Not finite or beyond 1.8e18: skipped and counted; what shares the mesh is hit as before. */
static void invalid_triangles_are_skipped(void **state) {
    (void)state;
    static const float bad[] = {NAN, INFINITY, -INFINITY, 1.9e18f, -3e38f};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        for (uint32_t keys = 1; keys <= 2; keys++) {
            struct trial t;
            trc_scene_stats stats = {.struct_size = sizeof stats};
            trial_init(&t);
            struct mesh *mesh = query_world_object(&t.world);
            mesh_add_box(mesh, unit_lower, unit_upper);
            add_floor(mesh, 0.5f);
            mesh_add_vertex(mesh, 0, 0, 9);
            mesh_add_triangle(mesh, 0, 1, 11);
            if (keys > 1)
                mesh_set_keys(mesh, keys);
            mesh_key(mesh, keys - 1)[3 * 8 + 1] = bad[i]; /* of the floor, at the last key */
            add_ray(&t, 0, 0, 0, 0, 0, 1);
            add_ray(&t, 0, 0, 0, 0.3f, 0.1f, -1);
            struct query_scene scene = query_test_scene(&t.world, false);
            query(&t, scene.scene);
            assert_ok(trc_scene_get_stats(scene.scene, &stats));
            assert_int_equal(stats.skipped_triangle_count, 1);
            assert_true(t.hits.instance[0] == 0 && t.hits.triangle[0] < 12);
            assert_true(t.hits.distance[0] == 1.0f && t.hits.distance[1] == 1.0f);
            query_scene_destroy(&scene);
            trial_free(&t);
        }
}

/* A scene with nothing in it, and instances that nobody sees. */
static void empty_scenes_are_never_hit(void **state) {
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        struct trial t;
        trial_init(&t);
        if (kind > 0) {
            struct mesh *mesh = query_world_object(&t.world);
            if (kind > 1)
                mesh_add_box(mesh, unit_lower, unit_upper);
            if (kind == 2)
                memset(t.world.instances[0].transforms[0], 0, 12 * sizeof(float));
            if (kind == 3)
                t.world.instances[0].visibility = 0;
        }
        for (int i = 0; i < 70; i++)
            add_ray(&t, 0, 0, 0, 0, (float)i, 1);
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++)
                expect_miss(&t, i);
        }
        trial_free(&t);
    }
}

/* ---- rays that do not count ---- */

static void make_bad_ray(struct ray_set *rays, uint32_t ray, struct rng *rng) {
    static const float bad[] = {NAN, -NAN, INFINITY, -INFINITY};
    const float value = bad[rng_below(rng, 4)];
    switch (rng_below(rng, 6)) {
    case 0:
        rays->origin[rng_below(rng, 3)][ray] = value;
        break;
    case 1:
        rays->direction[rng_below(rng, 3)][ray] = value;
        break;
    case 2:
        rays->tmin[ray] = NAN;
        break;
    case 3:
        rays->tmax[ray] = NAN;
        break;
    case 4:
        rays->time[ray] = NAN;
        break;
    default:
        for (int axis = 0; axis < 3; axis++)
            rays->direction[axis][ray] = rng_bits(rng) & 1 ? 0.0f : -0.0f;
    }
}

/* Rays with a NaN, an infinity or no direction hit nothing; the others have the bits they had
 * alone. */
static void bad_rays_disturb_nobody(void **state) {
    (void)state;
    struct trial t;
    struct rng rng = rng_seed(26);
    trial_init(&t);
    struct mesh *mesh = query_world_object(&t.world);
    mesh_add_uv_sphere(mesh, origin, 1.0f, 16, 24);
    mesh_set_keys(mesh, 2);
    mesh_key(mesh, 1)[0] += 0.25f;
    for (uint32_t i = 0; i < 64 * 100; i++) {
        float d[3], o[3] = {0.1f, 0.2f, 0.3f};
        rng_direction(&rng, d);
        if (i / 64 % 2)
            o[0] = rng_unit(&rng) - 0.5f;
        ray_set_add(&t.rays, o, d, 0.0f, INFINITY, rng_unit(&rng));
    }
    run(&t, false);
    struct hit_set before = t.hits;
    bool *bad = calloc(t.rays.count, sizeof *bad);
    t.hits = (struct hit_set){0};
    assert_non_null(bad);
    for (uint32_t i = 0; i < t.rays.count; i++) {
        /* From one bad ray in a packet to one good one. */
        bad[i] = i / 64 < 50 ? i % 64 == i / 64 : i % 64 != i / 64;
        if (bad[i])
            make_bad_ray(&t.rays, i, &rng);
    }
    run(&t, false);
    for (uint32_t i = 0; i < t.rays.count; i++) {
        if (bad[i]) {
            expect_miss(&t, i);
            before.instance[i] = t.hits.instance[i];
            before.triangle[i] = t.hits.triangle[i];
            before.distance[i] = t.hits.distance[i];
            before.u[i] = t.hits.u[i];
            before.v[i] = t.hits.v[i];
            before.occluded[i] = t.hits.occluded[i];
        } else {
            assert_true(t.hits.instance[i] == 0);
        }
    }
    assert_int_equal(hit_set_difference(&before, &t.hits), UINT32_MAX);
    print_right("25, 26: packets with 1 to 64 rays that count, beside NaN", t.rays.count);
    hit_set_free(&before);
    free(bad);
    trial_free(&t);
}

/* ---- rays on planes, grids and boxes ---- */

/* Rays within a triangle's plane miss it. */
static void rays_in_the_plane_miss(void **state) {
    (void)state;
    struct trial t;
    struct rng rng = rng_seed(7);
    uint64_t total = 0;
    trial_init(&t);
    for (int axis = 0; axis < 3; axis++) {
        const float corner[3] = {-4, -4, -4};
        float u[3] = {0}, v[3] = {0}, at[3];
        memcpy(at, corner, sizeof at);
        at[axis] = 0.0f;
        u[(axis + 1) % 3] = 8.0f;
        v[(axis + 2) % 3] = 8.0f;
        trial_free(&t);
        mesh_add_grid(query_world_object(&t.world), at, u, v, 8, 8);
        for (int i = 0; i < 500; i++) {
            float o[3], d[3];
            for (int k = 0; k < 3; k++) {
                o[k] = (float)rng_below(&rng, 17) / 2.0f - 4.0f;
                d[k] = (float)rng_below(&rng, 5) - 2.0f;
            }
            o[axis] = 0.0f;
            d[axis] = rng_bits(&rng) & 1 ? 0.0f : -0.0f;
            if (d[(axis + 1) % 3] == 0.0f && d[(axis + 2) % 3] == 0.0f)
                d[(axis + 1) % 3] = 1.0f;
            ray_set_add_simple(&t.rays, o, d);
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++)
                expect_miss(&t, i);
            total += t.rays.count;
        }
    }
    print_right("7: rays in a triangle's plane", total);
    trial_free(&t);
}

/* Axis-aligned rays at the vertices, edges and faces of a grid, with zeros of both signs, from both
 * sides. */
static void aligned_rays_meet_grids_exactly(void **state) {
    (void)state;
    struct rng rng = rng_seed(6);
    uint64_t total = 0;
    for (int axis = 0; axis < 3; axis++) {
        struct trial t;
        float u[3] = {0}, v[3] = {0}, at[3] = {-8, -8, -8};
        trial_init(&t);
        at[axis] = 2.0f;
        u[(axis + 1) % 3] = 16.0f;
        v[(axis + 2) % 3] = 16.0f;
        mesh_add_grid(query_world_object(&t.world), at, u, v, 16, 16);
        at[axis] = 3.0f;
        mesh_add_grid(query_world_object(&t.world), at, v, u, 16, 16);
        for (int i = 0; i < 3000; i++) {
            float o[3], d[3];
            for (int k = 0; k < 3; k++) {
                o[k] = (float)rng_below(&rng, 73) / 4.0f - 9.0f;
                d[k] = rng_bits(&rng) & 1 ? 0.0f : -0.0f;
            }
            if (i & 1)
                o[axis] = 0.0f; /* else the ray may start on a grid, or behind it */
            d[axis] = rng_bits(&rng) & 1 ? 1.0f : -1.0f;
            ray_set_add_simple(&t.rays, o, d);
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            expect_exact(&t, "grid");
            total += t.rays.count;
        }
        trial_free(&t);
    }
    print_right("6: rays along axes against grids", total);
}

/* Origins on corners, edges and faces of boxes, thin boxes among them, with zero components. A ray
 * does not hit what it starts on. */
static void origins_on_boxes(void **state) {
    (void)state;
    struct rng rng = rng_seed(9);
    uint64_t total = 0;
    static const float sizes[][3] = {{2, 2, 2}, {4, 1, 2}, {2, 4, 0}, {0, 2, 2}, {2, 0, 4}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        struct trial t;
        trial_init(&t);
        mesh_add_box(query_world_object(&t.world), origin, sizes[s]);
        for (int i = 0; i < 3000; i++) {
            float o[3], d[3];
            const uint32_t axis = rng_below(&rng, 3);
            for (uint32_t k = 0; k < 3; k++) {
                o[k] = sizes[s][k] * ((float)rng_below(&rng, 5) / 4.0f);
                d[k] = rng_bits(&rng) & 1 ? 0.0f : -0.0f;
            }
            d[axis] = rng_bits(&rng) & 1 ? 1.0f : -1.0f;
            ray_set_add_simple(&t.rays, o, d);
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            expect_exact(&t, "box");
            total += t.rays.count;
        }
        trial_free(&t);
    }
    print_right("8, 9: origins on corners, edges, faces of boxes", total);
}

/* ---- visibility, time ---- */

static void instances_hide_from_rays(void **state) {
    (void)state;
    struct trial t;
    trial_init(&t);
    for (uint32_t i = 0; i < 5; i++) {
        add_floor(query_world_object(&t.world), (float)i + 1.0f);
        t.world.instances[i].visibility = 1u << i;
    }
    for (int i = 0; i < 40; i++)
        add_ray(&t, 0.1f * (float)(i % 3), 0, 0, 0, 0, 1);
    for (int is_final = 0; is_final < 2; is_final++)
        for (uint32_t mask = 0; mask <= TRC_VISIBLE_ALL; mask++) {
            t.rays.visibility = mask;
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++) {
                if (!mask) {
                    expect_miss(&t, i);
                    continue;
                }
                const uint32_t first = (uint32_t)__builtin_ctz(mask);
                expect_hit(&t, i, first, 0, (float)first + 1.0f);
            }
        }
    trial_free(&t);
}

/* A plane that rises from 1 to 3: heights at times within and outside of [0, 1]. */
static void times_are_clamped(void **state) {
    (void)state;
    static const float times[] = {0, 0.25f, 0.5f, 1, -1, 2, -0.0f, -INFINITY, INFINITY};
    static const float heights[] = {1, 1.5f, 2, 3, 1, 3, 1, 1, 3};
    for (int moving_instance = 0; moving_instance < 2; moving_instance++) {
        struct trial t;
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        add_floor(mesh, 1.0f);
        if (moving_instance) {
            t.world.instances[0].key_count = 2;
            t.world.instances[0].transforms[1][11] = 2.0f;
        } else {
            mesh_set_keys(mesh, 2);
            for (int i = 0; i < 3; i++)
                mesh_key(mesh, 1)[3 * i + 2] = 3.0f;
        }
        const float d[3] = {0, 0, 1};
        for (uint32_t i = 0; i < 63; i++)
            ray_set_add(&t.rays, origin, d, 0.0f, INFINITY, times[i % 9]);
        run(&t, false);
        for (uint32_t i = 0; i < t.rays.count; i++)
            expect_hit(&t, i, 0, 0, heights[i % 9]);
        trial_free(&t);
    }
}

/* A triangle that stretches while its instance turns, of other keys than it: normals are those of
 * the corners as they stand in the world, each in its own time. */
static void normals_are_of_both_motions(void **state) {
    (void)state;
    static const float times[] = {0.0f, 0.2f, 0.35f, 0.5f, 0.6f, 0.9f, 1.0f};
    const uint32_t time_count = sizeof times / sizeof *times;
    struct trial t;
    trial_init(&t);
    struct mesh *mesh = query_world_object(&t.world);
    add_floor(mesh, 3.0f);
    mesh_set_keys(mesh, 2);
    for (int v = 0; v < 3; v++)
        mesh_key(mesh, 1)[3 * v + 2] += 0.3f * (float)v;
    struct query_instance *instance = &t.world.instances[0];
    instance->key_count = 4;
    for (uint32_t key = 0; key < 4; key++) {
        static const float axis[3] = {1, 0, 0}, scale[3] = {1, 1, 1}, none[3] = {0, 0, 0};
        query_transform(axis, 0.15f * (float)key, scale, none, instance->transforms[key]);
    }
    for (uint32_t i = 0; i < time_count; i++)
        ray_set_add(&t.rays, origin, (const float[3]){0, 0, 1}, 0.0f, INFINITY, times[i]);
    run(&t, false);
    for (uint32_t i = 0; i < time_count; i++) {
        const double time = (double)times[i], at = 3.0 * time, f = at - fmin(floor(at), 2.0);
        const int key = (int)fmin(floor(at), 2.0);
        double p[3][3], n[3], size = 0.0, found_size = 0.0, cosine = 0.0;
        assert_int_equal(t.hits.instance[i], 0);
        for (int v = 0; v < 3; v++)
            for (int r = 0; r < 3; r++) {
                const float *a = instance->transforms[key] + 4 * r, *b = a + 12;
                p[v][r] = (1.0 - f) * (double)a[3] + f * (double)b[3];
                for (int k = 0; k < 3; k++)
                    p[v][r] += ((1.0 - f) * (double)a[k] + f * (double)b[k]) *
                               ((1.0 - time) * (double)mesh_key(mesh, 0)[3 * v + k] +
                                time * (double)mesh_key(mesh, 1)[3 * v + k]);
            }
        for (int k = 0; k < 3; k++) {
            const int x = (k + 1) % 3, y = (k + 2) % 3;
            n[k] = (p[1][x] - p[0][x]) * (p[2][y] - p[0][y]) -
                   (p[1][y] - p[0][y]) * (p[2][x] - p[0][x]);
            const double found = (double)t.hits.normal[k][i];
            size += n[k] * n[k];
            found_size += found * found;
            cosine += n[k] * found;
        }
        /* Of any length, on the side of the winding. */
        assert_true(cosine / sqrt(size * found_size) > 1.0 - 1e-10);
    }
    trial_free(&t);
}

/* ---- the host ---- */

/* The caller's floating-point state neither changes nor matters. */
static void host_state_is_kept(void **state) {
    (void)state;
#if defined(__SSE__)
    struct trial t;
    struct rng rng = rng_seed(12);
    trial_init(&t);
    mesh_add_icosphere(query_world_object(&t.world), origin, 1e-39f, 1);
    for (int i = 0; i < 640; i++) {
        float d[3];
        rng_direction(&rng, d);
        for (int axis = 0; axis < 3; axis++)
            d[axis] *= 1e-3f;
        ray_set_add_simple(&t.rays, origin, d);
    }
    struct query_scene scene = query_test_scene(&t.world, false);
    query(&t, scene.scene);
    struct hit_set flushed;
    hit_set_init(&flushed, t.rays.count);
    const uint32_t before = _mm_getcsr();
    const uint32_t unusual = (before | 0x8040u | 0x6000u) & ~0x3fu; /* FTZ, DAZ, round to zero */
    _mm_setcsr(unusual);
    const trc_status status = hit_set_query(&flushed, scene.scene, &t.rays, 64);
    const uint32_t after = _mm_getcsr();
    _mm_setcsr(before);
    assert_ok(status);
    assert_int_equal(after & ~0x3fu, unusual);
    assert_int_equal(after & 0x3fu, 0);
    assert_int_equal(hit_set_difference(&t.hits, &flushed), UINT32_MAX);
    print_right("12: denormal coordinates, the caller's FTZ and DAZ on and off", t.rays.count);
    hit_set_free(&flushed);
    query_scene_destroy(&scene);
    trial_free(&t);
#endif
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(intervals_are_half_open),
        cmocka_unit_test(directions_need_not_be_unit),
        cmocka_unit_test(lowest_number_wins),
        cmocka_unit_test(degenerate_triangles_are_never_hit),
        cmocka_unit_test(invalid_triangles_are_skipped),
        cmocka_unit_test(empty_scenes_are_never_hit),
        cmocka_unit_test(bad_rays_disturb_nobody),
        cmocka_unit_test(rays_in_the_plane_miss),
        cmocka_unit_test(aligned_rays_meet_grids_exactly),
        cmocka_unit_test(origins_on_boxes),
        cmocka_unit_test(instances_hide_from_rays),
        cmocka_unit_test(times_are_clamped),
        cmocka_unit_test(normals_are_of_both_motions),
        cmocka_unit_test(host_state_is_kept),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("trace rules", tests, NULL, NULL);
}
