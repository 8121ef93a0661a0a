/* Ray queries with numbers at the ends of their range: scales, far origins, extreme instances,
 * needles. */
#include "figures.h"
#include "trial.h"

/* Of the last query. */
static uint32_t hit_count(const struct trial *t) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->rays.count; i++)
        count += t->hits.instance[i] != TRC_NO_HIT;
    return count;
}

static const float unit_lower[3] = {-1, -1, -1}, unit_upper[3] = {1, 1, 1};

/* A sphere at a scale, from inside, from outside and from very far, against the oracle. */
static void scales(void **state) {
    (void)state;
    static const float radii[] = {1e-38f, 1e-30f, 1e-20f, 1e-10f, 1e10f, 1e18f};
    uint64_t total = 0;
    for (size_t s = 0; s < sizeof radii / sizeof *radii; s++) {
        struct trial t;
        struct rng rng = rng_seed(s);
        struct brute_list list = {0};
        const float r = radii[s], lower[3] = {-r, -r, -r}, upper[3] = {r, r, r};
        trial_init(&t);
        mesh_add_icosphere(query_world_object(&t.world), origin, r, 2);
        mesh_add_soup(query_world_object(&t.world), &rng, 50, lower, upper, 0.2f * r);
        float o[3] = {0};
        for (int i = 0; i < 64 * 30; i++) {
            float d[3];
            if (i % 64 == 0) {
                rng_direction(&rng, o);
                const float far = i / 64 % 3 == 0 ? 0.4f : i / 64 % 3 == 1 ? 1.5f : 1000.0f;
                for (int axis = 0; axis < 3; axis++)
                    o[axis] *= far * r;
            }
            rng_direction(&rng, d);
            for (int axis = 0; axis < 3; axis++)
                d[axis] = 0.7f * r * d[axis] - o[axis];
            ray_set_add_simple(&t.rays, o, d);
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++) {
                brute_collect(&t.world, &t.rays, i, &list);
                if (brute_judge_closest(&list, &t.rays, i, &t.hits) != BRUTE_DIFFERS &&
                    brute_judge_occluded(&list, &t.rays, i, &t.hits) != BRUTE_DIFFERS)
                    continue;
                hit_set_print(&t.hits, &t.rays, i);
                brute_list_print(&list);
                fail_msg("radius %g: wrong at ray %u", (double)r, i);
            }
            total += t.rays.count;
            /* All of them are aimed at the inside of the sphere. */
            assert_int_equal(hit_count(&t), t.rays.count);
        }
        brute_list_free(&list);
        trial_free(&t);
    }
    print_right("12, 13: spheres of radius 1e-38 to 1e18", total);
}

/* Objects of sizes 1e-6 to 1e6 in one scene, each seen from near and from far. */
static void many_scales_in_one_scene(void **state) {
    (void)state;
    struct trial t;
    struct rng rng = rng_seed(14);
    struct brute_list list = {0};
    trial_init(&t);
    struct mesh *mesh = query_world_object(&t.world);
    for (int e = -6; e <= 6; e++) {
        const float r = powf(10.0f, (float)e), at[3] = {2.0f * r, -r, 0.5f * r};
        mesh_add_uv_sphere(mesh, at, 0.5f * r, 8, 12);
    }
    for (int i = 0; i < 4000; i++) {
        const float r = powf(10.0f, (float)(i / 64 % 13 - 6));
        float o[3], target[3];
        const float away = rng_bits(&rng) & 1 ? 1.0f : 100.0f;
        for (int axis = 0; axis < 3; axis++) {
            o[axis] = away * r * rng_range(&rng, -1.0f, 1.0f);
            target[axis] = r * rng_range(&rng, -0.4f, 0.4f) + r * (axis == 0 ? 2.0f : -0.5f);
        }
        ray_set_aim(&t.rays, o, target, 0.0f);
    }
    run(&t, true);
    for (uint32_t i = 0; i < t.rays.count; i++) {
        brute_collect(&t.world, &t.rays, i, &list);
        if (brute_judge_closest(&list, &t.rays, i, &t.hits) != BRUTE_DIFFERS)
            continue;
        hit_set_print(&t.hits, &t.rays, i);
        brute_list_print(&list);
        fail_msg("wrong at ray %u", i);
    }
    /* Targets are spread over boxes a few times as wide as the spheres: one in ten was hit. */
    assert_true(hit_count(&t) > t.rays.count / 20);
    print_right("14: sizes from 1e-6 to 1e6 in one scene", t.rays.count);
    brute_list_free(&list);
    trial_free(&t);
}

/* Origins beyond the range of coordinates: no NaN, no crash; what is reported is finite. */
static void far_origins_give_numbers(void **state) {
    (void)state;
    struct trial t;
    struct rng rng = rng_seed(13);
    trial_init(&t);
    mesh_add_icosphere(query_world_object(&t.world), origin, 1e18f, 2);
    mesh_add_box(query_world_object(&t.world), unit_lower, unit_upper);
    for (int i = 0; i < 6400; i++) {
        const float size = powf(10.0f, 18.0f + 20.0f * rng_unit(&rng));
        float o[3], d[3];
        rng_direction(&rng, o);
        for (int axis = 0; axis < 3; axis++) {
            o[axis] *= size;
            d[axis] = -o[axis] * 1e-3f;
        }
        ray_set_add_simple(&t.rays, o, d);
    }
    run(&t, false);
    for (uint32_t i = 0; i < t.rays.count; i++) {
        if (t.hits.instance[i] == TRC_NO_HIT)
            continue;
        assert_true(isfinite(t.hits.distance[i]) && t.hits.distance[i] > 0.0f);
        assert_true(t.hits.u[i] >= 0.0f && t.hits.u[i] <= 1.0f);
        assert_true(t.hits.v[i] >= 0.0f && t.hits.v[i] <= 1.0f);
    }
    /* Those that start within the range of coordinates have numbers that arithmetic can hold: two
     * fifths of all were hit. */
    assert_true(hit_count(&t) > t.rays.count / 4);
    print_right("13: origins up to 1e38 away, all finite", t.rays.count);
    trial_free(&t);
}

/* Instances scaled by extreme factors: directions in object space are as extreme. */
static void extreme_instances(void **state) {
    (void)state;
    static const float factors[] = {1e-15f, 1e-12f, 1e-9f, 1e-6f, 1e6f, 1e9f, 1e12f, 1e15f};
    uint64_t total = 0;
    for (size_t s = 0; s < sizeof factors / sizeof *factors; s++) {
        struct trial t;
        struct rng rng = rng_seed(38);
        const float f = factors[s], scale[3] = {f, f, f}, axis[3] = {1, -1, 2};
        uint32_t misses = 0;
        trial_init(&t);
        mesh_add_uv_sphere(query_world_object(&t.world), origin, 1.0f, 24, 32);
        query_transform(axis, 0.7f, scale, origin, t.world.instances[0].transforms[0]);
        for (int i = 0; i < 64 * 100; i++) {
            float d[3], o[3];
            rng_direction(&rng, d);
            for (int k = 0; k < 3; k++)
                o[k] = i / 64 & 1 ? f * rng_range(&rng, -0.5f, 0.5f) : 0.0f;
            ray_set_add_simple(&t.rays, o, d);
        }
        run(&t, false);
        for (uint32_t i = 0; i < t.rays.count; i++) {
            if (t.hits.instance[i] == 0 && t.hits.occluded[i])
                continue;
            if (!misses++)
                hit_set_print(&t.hits, &t.rays, i);
        }
        if (misses)
            print_message("scaled by %g: %u misses\n", (double)f, misses);
        assert_int_equal(misses, 0);
        total += t.rays.count;
        trial_free(&t);
    }
    print_right("38: instances scaled by 1e-15 to 1e15", total);
}

/* Needles from just before the ends of a packet's rays to far beyond, where these would be wide
 * apart: what of them is computed in double does not depend on who shares the packet. */
#define NEEDLES 4096
static void needles_reach_beyond_packets(void **state) {
    (void)state;
    for (int is_common = 0; is_common < 2; is_common++) {
        struct trial t;
        struct rng rng = rng_seed(6);
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        for (uint32_t i = 0; i < NEEDLES; i++) {
            const float x = rng_range(&rng, -0.3f, 0.3f), y = rng_range(&rng, -0.3f, 0.3f);
            const float width = exp2f(rng_range(&rng, -14.0f, -2.0f));
            const float far = exp2f(rng_range(&rng, 2.0f, 12.0f));
            const float turn_x = rng_range(&rng, -0.3f, 0.3f),
                        turn_y = rng_range(&rng, -0.3f, 0.3f);
            const float corners[9] = {x,   y, 1.0f,      far * turn_x, far * turn_y,
                                      far, x, y + width, 1.0f};
            const float b = 0.01f / far, c = rng_range(&rng, 0.0f, 0.9f);
            const float z = 1.0f + b * (far - 1.0f);
            add_corners(mesh, corners);
            ray_set_add(
                &t.rays, origin,
                (float[3]){x + b * (far * turn_x - x), y + b * (far * turn_y - y) + c * width, z},
                0.0f, 1.01f, 0.0f);
            for (int k = 0; k < 2 && !is_common; k++)
                t.rays.origin[k][i] = rng_range(&rng, -1e-3f, 1e-3f);
        }
        run(&t, true);
        assert_true(hit_count(&t) > NEEDLES / 4);
        trial_free(&t);
    }
}

/* ---- bit patterns ---- */

/* A float of random bits whose exponent is one of so many from exponent on. */
static float random_slice(struct rng *rng, int exponent, uint32_t count) {
    const uint32_t bits = rng_bits(rng);
    const uint32_t power = (uint32_t)(exponent + 127) + rng_below(rng, count);
    const uint32_t all = (bits & 0x807fffffu) | power << 23;
    float value;
    memcpy(&value, &all, sizeof value);
    return value;
}

/* Corners and origins of random bits in a slice of the exponents, some of them denormal, against
 * the oracle. */
static void slices_of_bits(void **state) {
    (void)state;
    static const int exponents[] = {-127, -100, -60, -20, -4, 0, 20, 50};
    const uint32_t powers = 8; /* of a slice */
    struct brute_list list = {0};
    uint64_t total = 0, hits = 0;
    for (size_t s = 0; s < sizeof exponents / sizeof *exponents; s++) {
        struct trial t;
        struct rng rng = rng_seed(100 + s);
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        for (int i = 0; i < 60; i++) {
            float p[9];
            for (int k = 0; k < 9; k++)
                p[k] = random_slice(&rng, exponents[s], powers);
            add_corners(mesh, p);
        }
        for (int i = 0; i < 2000; i++) {
            const float *p = mesh->positions + 9 * (size_t)rng_below(&rng, mesh->triangle_count);
            const float u = rng_unit(&rng), v = (1.0f - u) * rng_unit(&rng);
            float o[3], target[3];
            for (int k = 0; k < 3; k++) {
                o[k] = random_slice(&rng, exponents[s], powers);
                target[k] = p[k] + u * (p[3 + k] - p[k]) + v * (p[6 + k] - p[k]);
            }
            ray_set_aim(&t.rays, o, target, 0.0f);
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++) {
                brute_collect(&t.world, &t.rays, i, &list);
                hits += t.hits.instance[i] != TRC_NO_HIT;
                if (brute_judge_closest(&list, &t.rays, i, &t.hits) != BRUTE_DIFFERS &&
                    brute_judge_occluded(&list, &t.rays, i, &t.hits) != BRUTE_DIFFERS)
                    continue;
                hit_set_print(&t.hits, &t.rays, i);
                brute_list_print(&list);
                fail_msg("exponents from %d: wrong at ray %u", exponents[s], i);
            }
            total += t.rays.count;
        }
        trial_free(&t);
    }
    brute_list_free(&list);
    print_right("corners and origins of random bits, in slices of 8 exponents", total);
    assert_true(hits > total / 2);
}

/* Powers of two, from denormals on, of origins within the range of coordinates. */
#define ORIGIN_POWERS (127 + 60)

/* Corners, transforms and directions of any bits at all: nothing falls, packets agree, what is hit
 * has numbers. */
static void any_bits(void **state) {
    (void)state;
    struct rng rng = rng_seed(200);
    uint64_t total = 0, hits = 0;
    for (int trial = 0; trial < 40; trial++) {
        struct trial t;
        trial_init(&t);
        struct mesh *mesh = query_world_object(&t.world);
        for (int i = 0; i < 100; i++) {
            float p[9];
            for (int k = 0; k < 9; k++)
                p[k] = random_slice(&rng, -127, 256);
            add_corners(mesh, p);
        }
        for (int k = 0; k < 12 && trial & 1; k++)
            t.world.instances[0].transforms[0][k] = random_slice(&rng, -127, 256);
        for (int i = 0; i < 640; i++) {
            float o[3], d[3];
            for (int k = 0; k < 3; k++) {
                o[k] = random_slice(&rng, -127, ORIGIN_POWERS);
                d[k] = random_slice(&rng, -127, 256);
            }
            ray_set_add(&t.rays, o, d, random_slice(&rng, -127, 256), random_slice(&rng, -127, 256),
                        rng_unit(&rng));
        }
        for (int is_final = 0; is_final < 2; is_final++) {
            run(&t, is_final);
            for (uint32_t i = 0; i < t.rays.count; i++) {
                const float u = t.hits.u[i], v = t.hits.v[i];
                if (t.hits.instance[i] == TRC_NO_HIT ||
                    (isfinite(t.hits.distance[i]) && u >= 0.0f && u <= 1.0f && v >= 0.0f &&
                     v <= 1.0f))
                    continue;
                hit_set_print(&t.hits, &t.rays, i);
                fail_msg("trial %d: wrong at ray %u", trial, i);
            }
            hits += hit_count(&t);
            total += t.rays.count;
        }
        trial_free(&t);
    }
    /* A triangle of any bits is mostly as large as all there is: one ray in fourteen hit one. */
    assert_true(hits > total / 30);
    print_right("corners, transforms and rays of any bits: all finite, packets agree", total);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scales),
        cmocka_unit_test(many_scales_in_one_scene),
        cmocka_unit_test(far_origins_give_numbers),
        cmocka_unit_test(extreme_instances),
        cmocka_unit_test(needles_reach_beyond_packets),
        cmocka_unit_test(slices_of_bits),
        cmocka_unit_test(any_bits),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("trace numbers", tests, NULL, NULL);
}
