/* Samples of the world: its importance map by any normal, an even world on both sides. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/core.h"
#include "kernels/light/world_place.h"
#include "kernels/simd/wide_math.h"
#include "light_scene.h"

enum { MAP_WIDTH = 48, MAP_HEIGHT = MAP_WIDTH / 2, MAP_SIDE = 512 };

/* A map of even light, or of light that differs from cell to cell, one of them a sun. */
static struct trc_world_map *map_of(bool is_even) {
    struct rng random = rng_seed(5);
    struct trc_world_map *map = trc_alloc_zeroed(1, sizeof *map);
    assert_non_null(map);
    atomic_init(&map->refs, 1);
    map->width = MAP_WIDTH;
    map->height = MAP_HEIGHT;
    map->facings = trc_alloc(TRC_MAP_FACINGS, sizeof *map->facings);
    map->down = trc_alloc(TRC_MAP_BLOCKS * (MAP_HEIGHT / TRC_MAP_ROWS + 1), sizeof(float));
    map->along = trc_alloc((MAP_WIDTH + TRC_MAP_COLUMNS) * MAP_HEIGHT, sizeof(float));
    map->density = trc_alloc(MAP_WIDTH * MAP_HEIGHT, sizeof(float));
    assert_true(map->facings && map->down && map->along && map->density);
    double sum = 0.0;
    for (int i = 0; i < MAP_WIDTH * MAP_HEIGHT; i++) {
        const float sine = sinf((float)M_PI * ((float)(i / MAP_WIDTH) + 0.5f) / MAP_HEIGHT);
        const float light = i == 7 * MAP_WIDTH + 31 ? 500.0f : rng_range(&random, 0.05f, 1.0f);
        map->density[i] = is_even ? sine : sine * light;
        sum += (double)map->density[i];
    }
    for (int i = 0; i < MAP_WIDTH * MAP_HEIGHT; i++)
        map->density[i] *= (float)(MAP_WIDTH * MAP_HEIGHT / sum);
    trc_world_map_set_chances(map);
    return map;
}

/* Direction (u, v) of the map. */
static vvec3 map_direction(double u, double v) {
    return v3(vf_set((float)(sin(M_PI * v) * cos(2.0 * M_PI * u))),
              vf_set((float)(sin(M_PI * v) * sin(2.0 * M_PI * u))), vf_set((float)cos(M_PI * v)));
}

/* What MAP_SIDE squared samples find. */
struct map_samples {
    double mean[3];        /* direction */
    double differ;         /* share whose density is not that of their direction */
    double cosine, square; /* means of the cosine over the density, and of its square */
};

static struct map_samples sample_map(const struct trc_world_map *map, vvec3 n, vmask has_n) {
    struct map_samples found = {0};
    const double share = 1.0 / ((double)MAP_SIDE * MAP_SIDE);
    for (int i = 0; i < MAP_SIDE; i++)
        for (int j = 0; j < MAP_SIDE; j += TRC_WIDTH) {
            const vfloat u1 =
                (vi_to_float(vi_lane() + vi_set(j)) + vf_set(0.5f)) * vf_set(1.0f / MAP_SIDE);
            const vfloat u2 = vf_set(((float)i + 0.5f) / MAP_SIDE);
            vfloat pdf;
            const vvec3 wi = trc_map_sample(map, n, has_n, u1, u2, vm_all_set(), &pdf);
            const vfloat density = trc_map_density(map, n, has_n, wi, vm_all_set());
            const vfloat cosine = vf_max(v3_dot(n, wi), vf_zero()) / pdf;
            for (int k = 0; k < TRC_WIDTH; k++) {
                const double p = (double)vf_get(pdf, k), value = (double)vf_get(cosine, k);
                assert_true(p > 0.0);
                found.differ += fabs((double)vf_get(density, k) / p - 1.0) > 1e-3 ? share : 0.0;
                found.mean[0] += share * (double)vf_get(wi.x, k);
                found.mean[1] += share * (double)vf_get(wi.y, k);
                found.mean[2] += share * (double)vf_get(wi.z, k);
                found.cosine += share * value;
                found.square += share * value * value;
            }
        }
    return found;
}

/* The sum of the density over all cells, and its mean direction. */
static double integrate_map(const struct trc_world_map *map, vvec3 n, vmask has_n, double mean[3]) {
    enum { FINE = 8 }; /* places along a cell's side, for the mean */
    const int columns = FINE * MAP_WIDTH, rows = FINE * MAP_HEIGHT;
    double total = 0.0;
    memset(mean, 0, 3 * sizeof *mean);
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < columns; x++) {
            const double v = (y + 0.5) / rows;
            const vvec3 d = map_direction((x + 0.5) / columns, v);
            const double p = (double)vf_get(trc_map_density(map, n, has_n, d, vm_all_set()), 0) *
                             2.0 * M_PI * M_PI * sin(M_PI * v) / (columns * rows);
            total += p;
            mean[0] += p * (double)vf_get(d.x, 0);
            mean[1] += p * (double)vf_get(d.y, 0);
            mean[2] += p * (double)vf_get(d.z, 0);
        }
    return total;
}

/* For any normal, and for none: samples come by the density that they say, which integrates to
 * one. The first are along axes, at corners and edges of the octahedron's square. */
static void maps_are_sampled_by_their_density(void **state) {
    (void)state;
    struct trc_world_map *map = map_of(false);
    static const float normals[][3] = {{0, 0, 1},       {0, 0, -1},       {1, 0, 0},
                                       {0, -1, 0},      {-0.6f, 0, 0.8f}, {0.3f, -0.4f, -0.866f},
                                       {0.6f, 0.8f, 0}, {0, 0, 0}};
    for (size_t i = 0; i < sizeof normals / sizeof *normals; i++) {
        const vvec3 n = v3_normalize(v3_set(normals[i]));
        const vmask has_n = vf_gt(v3_dot(v3_set(normals[i]), v3_set(normals[i])), vf_zero());
        const struct map_samples found = sample_map(map, n, has_n);
        double mean[3];
        const double total = integrate_map(map, n, has_n, mean);
        double off = 0.0;
        for (int k = 0; k < 3; k++)
            off = fmax(off, fabs(found.mean[k] - mean[k]));
        printf("  normal %zu: %.5f, mean direction off by %.2g, %.2g %% differ\n", i, total, off,
               100.0 * found.differ);
        assert_true(fabs(total - 1.0) < 1e-4);
        assert_true(off < 2e-3);
        assert_true(found.differ < 2e-3); /* on edges of cells */
    }
    trc_world_map_release(map);
}

/* Under even light the cosine over the density has little variance left: a fifth of what it has
 * where the normal is not known. */
static void maps_know_normals(void **state) {
    (void)state;
    struct trc_world_map *map = map_of(true);
    struct rng random = rng_seed(6);
    for (int i = 0; i < 8; i++) {
        float some[3];
        rng_direction(&random, some);
        double relative[2];
        for (int knows = 0; knows < 2; knows++) {
            const struct map_samples found =
                sample_map(map, v3_set(some), knows ? vm_all_set() : vm_none());
            assert_true(fabs(found.cosine / M_PI - 1.0) < 5e-3);
            relative[knows] = found.square / (found.cosine * found.cosine) - 1.0;
        }
        printf("  relative variance %.3f, of samples without normals %.3f\n", relative[1],
               relative[0]);
        assert_true(relative[1] < 0.2 * relative[0]);
    }
    trc_world_map_release(map);
}

/* An even world lights both sides of what lets light through by the cosine: as many samples above
 * as below, each of them worth the same, and rays weighed by the same density. */
static void even_worlds_light_both_sides(void **state) {
    (void)state;
    struct scene s;
    scene_begin_in_even_world(&s);
    scene_commit(&s, NULL, 0);
    struct trc_surface r = receiver(&s, 0, 0, 0);
    struct rng random = rng_seed(7);
    int above = 0, count = 0;
    for (int i = 0; i < 4096; i += TRC_WIDTH) {
        float some[3];
        rng_direction(&random, some);
        const vvec3 n = v3_set(some), both = v3_scale(n, vf_set(TRC_BOTH_SIDES));
        struct trc_light_sample l;
        const vfloat u1 = (vi_to_float(vi_lane() + vi_set(i)) + vf_set(0.5f)) * vf_set(1.0f / 4096);
        trc_light_sample(&r, both, vf_set(0.5f), u1, test_wide_uniform(&random), &l);
        const vfloat bsdf_pdf = vf_set(0.2f);
        const vvec3 seen =
            trc_world_radiance(&s.snapshot, r.p, both, vi_set(-1), l.wi, bsdf_pdf, vf_one(),
                               vu_set(TRC_VISIBLE_GLOSSY), vu_set(0), vm_all_set());
        for (int k = 0; k < TRC_WIDTH; k++) {
            const double cosine = (double)vf_get(v3_dot(l.wi, n), k);
            const double pdf = (double)vf_get(l.pdf, k);
            assert_true(vm_bits(l.valid) >> k & 1u);
            assert_true(fabs(pdf - fabs(cosine) / (2.0 * M_PI)) < 1e-5);
            assert_true(fabs(implied_pdf((double)vf_get(seen.x, k), EVEN_RADIANCE, 0.2) - pdf) <
                        1e-4);
            above += cosine > 0.0;
            count++;
        }
    }
    assert_int_equal(2 * above, count);
    scene_end(&s);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(maps_are_sampled_by_their_density),
        cmocka_unit_test(maps_know_normals),
        cmocka_unit_test(even_worlds_light_both_sides),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
