/* Lights: irradiance against closed forms and against figures measured on Cycles 3.4, densities
 * that integrate to one, light samples and rays that agree on them, many lights through the
 * tree. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/core.h"
#include "core/pool.h"
#include "kernels/light/light.h"
#include "kernels/light/select.h"
#include "kernels/simd/wide_math.h"
#include "light_scene.h"

#define SAMPLES (1 << 18)

/* ---- estimates ---- */

struct estimate {
    double value, error;
};

static vfloat lit_by(const struct trc_surface *s, const struct trc_light_sample *l) {
    return vf_where(l->valid, l->radiance.y * vf_max(v3_dot(s->n, l->wi), vf_zero()) / l->pdf);
}

/* Irradiance at the point through light samples. */
static struct estimate irradiance(const struct trc_surface *s) {
    struct rng random = rng_seed(7);
    double sum = 0, sum2 = 0;
    for (int i = 0; i < SAMPLES; i += TRC_WIDTH) {
        struct trc_light_sample l;
        const vfloat u0 = test_wide_uniform(&random), u1 = test_wide_uniform(&random);
        const vfloat u2 = test_wide_uniform(&random);
        trc_light_sample(s, s->n, u0, u1, u2, &l);
        vfloat e = lit_by(s, &l);
        if (s->snapshot->lights->world_apart) {
            trc_light_sample_world(s, s->n, u1, u2, &l);
            e = e + lit_by(s, &l);
        }
        for (int k = 0; k < TRC_WIDTH; k++) {
            const double v = (double)vf_get(e, k);
            assert_true(isfinite(v) && v >= 0);
            sum += v;
            sum2 += v * v;
        }
    }
    const double mean = sum / SAMPLES;
    return (struct estimate){mean, sqrt(fmax(sum2 / SAMPLES - mean * mean, 0) / SAMPLES)};
}

static void expect(const char *what, struct estimate e, double want) {
    printf("  %-34s %.6f +- %.6f, expected %.6f\n", what, e.value, e.error, want);
    assert_true(fabs(e.value - want) <= 5 * e.error + 2e-4 * want);
}

static double one_lamp(trc_light_desc d, double *error) {
    struct scene s;
    scene_begin(&s);
    scene_commit(&s, &d, 1);
    const struct trc_surface r = receiver(&s, 0, 0, 0);
    const struct estimate e = irradiance(&r);
    *error = e.error;
    scene_end(&s);
    return e.value;
}

/* Irradiance of a polygon of unit radiance above the plane z = 0 at the origin (Lambert 1760). */
static double polygon(const double (*corner)[3], int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) {
        const double *a = corner[i], *b = corner[(i + 1) % count];
        const double la = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
        const double lb = sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2]);
        const double c = (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) / (la * lb);
        const double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                             a[0] * b[1] - a[1] * b[0]};
        const double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        sum += acos(fmin(fmax(c, -1), 1)) * n[2] / size;
    }
    return 0.5 * fabs(sum);
}

static void lamps_have_cycles_units(void **state) {
    (void)state;
    struct estimate e;
    /* Figures of Cycles 3.4 are radiances of a diffuse plane of albedo 0.8. */
    const double to_plane = 0.8 / M_PI;
    const float radii[] = {0.0f, 0.3f, 2.0f};
    const double points[] = {0.126648, 0.125942, 0.101320};
    for (int i = 0; i < 3; i++) {
        trc_light_desc d = lamp(TRC_LIGHT_POINT, 0, 0, 4);
        d.radius = radii[i];
        e.value = one_lamp(d, &e.error);
        expect("point", e, points[i] / to_plane);
        expect("point, closed form", e,
               100 / (4 * M_PI) / (16 + (double)radii[i] * (double)radii[i]));
    }
    trc_light_desc ball = lamp(TRC_LIGHT_POINT, 0, 0, 4);
    ball.flags = TRC_LIGHT_SPHERE;
    for (int i = 0; i < 3; i++) { /* as if all came from the centre */
        ball.radius = radii[i];
        e.value = one_lamp(ball, &e.error);
        expect("sphere", e, 100 / (4 * M_PI) / 16);
    }
    ball.radius = 8.0f;
    e.value = one_lamp(ball, &e.error);
    expect("sphere from inside", e, 100 / (4 * M_PI) / 64);
    trc_light_desc even = lamp(TRC_LIGHT_SPOT, 3, 0, 4);
    even.radius = 0.0f;
    e.value = one_lamp(even, &e.error);
    expect("spot from the side", e, 100 / (4 * M_PI) / 25 * 0.8 * 0.8);
    even.flags = TRC_LIGHT_EVEN_CONE;
    e.value = one_lamp(even, &e.error);
    expect("even spot from the side", e, 100 / (4 * M_PI) / 25 * 0.8);
    even.spot_angle = 1.2f; /* the tangent of its half is 0.68, that of the way 0.75 */
    assert_true(one_lamp(even, &e.error) == 0.0);
    even.transform[10] = 0.5f;
    e.value = one_lamp(even, &e.error);
    expect("stretched spot from the side", e, 100 / (4 * M_PI) / 25 * 0.8);
    even.transform[0] = 0.25f;
    assert_true(one_lamp(even, &e.error) == 0.0);
    trc_light_desc spot = lamp(TRC_LIGHT_SPOT, 0, 0, 4);
    spot.radius = 2.0f;
    e.value = one_lamp(spot, &e.error);
    expect("spot, radius 2", e, 0.096071 / to_plane);
    trc_light_desc sun = lamp(TRC_LIGHT_SUN, 0, 0, 0);
    sun.strength = 3.0f;
    e.value = one_lamp(sun, &e.error);
    expect("sun", e, 3.0);
    sun.angle = 0.174532925f;
    e.value = one_lamp(sun, &e.error);
    expect("sun, 10 degrees", e, 3.0 * 0.762488 / 0.763921);
    sun.angle = 2.0943951f;
    e.value = one_lamp(sun, &e.error);
    expect("sun, 120 degrees", e, 3.0 * 0.509295 / 0.763921);
    sun.flags = TRC_LIGHT_EVEN_CONE; /* strength is the irradiance */
    e.value = one_lamp(sun, &e.error);
    expect("even sun, 120 degrees", e, 3.0);
    trc_light_desc area = lamp(TRC_LIGHT_AREA, 0, 0, 4);
    e.value = one_lamp(area, &e.error);
    expect("area", e, 0.3898 / to_plane);
    area.spread = 1.57079633f;
    e.value = one_lamp(area, &e.error);
    expect("area, spread 90 degrees", e, 1.6433 / to_plane);
}

static void areas_match_closed_forms(void **state) {
    (void)state;
    struct estimate e;
    const float heights[] = {0.02f, 0.5f, 3.0f, 40.0f};
    for (int i = 0; i < 4; i++) {
        const double h = (double)heights[i];
        trc_light_desc disk = lamp(TRC_LIGHT_AREA, 0, 0, heights[i]);
        disk.area_shape = TRC_AREA_ELLIPSE;
        e.value = one_lamp(disk, &e.error);
        expect("disk", e, M_PI * (100 / M_PI) * 0.25 / (0.25 + h * h));
        trc_light_desc rectangle = lamp(TRC_LIGHT_AREA, 0.2f, -0.7f, heights[i]);
        rectangle.size_x = 1.5f;
        rectangle.size_y = 0.4f;
        e.value = one_lamp(rectangle, &e.error);
        const double x0 = 0.2 - 0.75, x1 = 0.2 + 0.75, y0 = -0.7 - 0.2, y1 = -0.7 + 0.2;
        const double corners[4][3] = {{x0, y0, h}, {x1, y0, h}, {x1, y1, h}, {x0, y1, h}};
        expect("rectangle", e, 100 / (4 * 0.6) * polygon(corners, 4));
    }
    /* Scale and mirror in the transform. */
    trc_light_desc scaled = lamp(TRC_LIGHT_AREA, 0, 0, 1);
    scaled.transform[0] = -2.0f;
    scaled.transform[5] = 3.0f;
    e.value = one_lamp(scaled, &e.error);
    const double corners[4][3] = {{-1, -1.5, 1}, {1, -1.5, 1}, {1, 1.5, 1}, {-1, 1.5, 1}};
    expect("scaled rectangle", e, 100.0 / 24 * polygon(corners, 4));
    /* A diffuse world. */
    struct scene s;
    scene_begin_in_even_world(&s);
    scene_commit(&s, NULL, 0);
    struct trc_surface r = receiver(&s, 0, 0, 0);
    assert_false(s.table->world_apart);
    expect("world", irradiance(&r), 2 * M_PI);
    scene_end(&s);
    /* Beside a lamp: each by samples of its own, and both are certain. */
    scene_begin_in_even_world(&s);
    scene_commit(&s, &scaled, 1);
    r = receiver(&s, 0, 0, 0);
    assert_true(s.table->world_apart);
    expect("world and rectangle", irradiance(&r), 2 * M_PI + 100.0 / 24 * polygon(corners, 4));
    const struct trc_receiver who = trc_receiver_make(r.p, r.n);
    for (int k = 0; k < 2; k++)
        assert_true(
            vm_all(vf_eq(trc_light_chance(s.table, &who, vi_set(k), vm_all_set()), vf_one())));
    scene_end(&s);
}

static void triangles_match_closed_forms(void **state) {
    (void)state;
    const double scales[] = {20.0, 1.0, 0.05};
    for (int i = 0; i < 3; i++) {
        struct scene s;
        scene_begin(&s);
        scene_emit(&s, 1, 5, 2);
        const double k = scales[i];
        const double c[3][3] = {{-k, -0.5 * k, 1}, {k, -0.3 * k, 1.5}, {0.2 * k, 0.9 * k, 0.7}};
        float corners[9];
        for (int j = 0; j < 9; j++)
            corners[j] = (float)c[j / 3][j % 3];
        scene_triangle(&s, corners, 1);
        scene_triangle(&s, corners, 0);
        scene_commit(&s, NULL, 0);
        assert_int_equal((int)trc_light_table_triangle_count(s.table), 1);
        const struct trc_surface r = receiver(&s, 0, 0, 0);
        expect("triangle", irradiance(&r), 5 * polygon(c, 3));
        scene_end(&s);
    }
}

/* ---- densities ---- */

/* Rays of one light sample up to tmax. */
static struct trc_light_ray seeing(vvec3 p, vvec3 n, vvec3 wi, vfloat tmax, vfloat pdf,
                                   uint32_t path) {
    return (struct trc_light_ray){.p = p,
                                  .n = n,
                                  .wi = wi,
                                  .tmin = vf_zero(),
                                  .tmax = tmax,
                                  .bsdf_pdf = pdf,
                                  .light_sample_count = vf_one(),
                                  .path = vu_set(path)};
}

/* A sampled direction must be met by a ray, with the same density. */
static void rays_agree_with_samples(void **state) {
    (void)state;
    trc_light_desc lights[] = {lamp(TRC_LIGHT_AREA, 0, 0, 2),   lamp(TRC_LIGHT_AREA, 4, 0, 3),
                               lamp(TRC_LIGHT_POINT, -3, 1, 2), lamp(TRC_LIGHT_SPOT, 0, 4, 3),
                               lamp(TRC_LIGHT_SUN, 0, 0, 0),    lamp(TRC_LIGHT_POINT, 3, 4, 1),
                               lamp(TRC_LIGHT_SPOT, -4, -3, 3)};
    lights[5].flags = TRC_LIGHT_SPHERE;
    lights[6].flags = TRC_LIGHT_SPHERE | TRC_LIGHT_EVEN_CONE;
    lights[5].radius = lights[6].radius = 0.7f;
    lights[1].area_shape = TRC_AREA_ELLIPSE;
    lights[1].size_y = 0.5f;
    lights[0].spread = 1.2f;
    lights[0].strength = 3.0f;
    lights[2].radius = lights[3].radius = 0.4f;
    lights[3].spot_blend = 0.5f;
    lights[4].angle = 0.3f;
    lights[4].strength = 5.0f;
    /* The sun comes from the side. */
    lights[4].transform[2] = 0.6f;
    lights[4].transform[6] = -0.7f;
    lights[4].transform[10] = 0.4f;
    struct scene s;
    scene_begin(&s);
    scene_commit(&s, lights, 7);
    struct rng random = rng_seed(3);
    int seen[7] = {0}, missed = 0;
    double most = 0.0;
    for (int i = 0; i < 20000; i += TRC_WIDTH) {
        struct trc_surface r = receiver(&s, 0, 0, 0);
        r.p =
            v3(test_wide_uniform(&random), test_wide_uniform(&random), test_wide_uniform(&random));
        struct trc_light_sample l;
        const vfloat u0 = test_wide_uniform(&random), u1 = test_wide_uniform(&random);
        trc_light_sample(&r, r.n, u0, u1, test_wide_uniform(&random), &l);
        const vfloat pb = vf_set(0.7f);
        vvec3 radiance = v3_zero();
        const vfloat far =
            vf_select(vf_ge(l.distance, vf_set(TRC_FAR)), l.distance, l.distance * vf_set(1.001f));
        const struct trc_light_ray ray =
            seeing(r.p, r.n, l.wi, far, pb, TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED);
        trc_light_hit(&s.snapshot, &ray, TRC_ALL_GROUPS, l.valid, &radiance);
        for (int k = 0; k < TRC_WIDTH; k++) {
            if (!((vm_bits(l.valid) >> k) & 1u))
                continue;
            const double got = (double)vf_get(radiance.y, k),
                         want = (double)vf_get(l.radiance.y, k);
            if (got == 0.0) {
                missed++; /* on the very rim */
                continue;
            }
            seen[vi_get(l.light, k)]++;
            /* Several lamps may lie on the way; those give more. */
            if (got > want)
                continue;
            const double pdf = implied_pdf(got, want, 0.7);
            most = fmax(most, fabs(pdf - (double)vf_get(l.pdf, k)) / (double)vf_get(l.pdf, k));
        }
    }
    printf("  densities differ by %.2g at most; %d rays missed\n", most, missed);
    assert_true(most < 5e-3);
    assert_true(missed < 20);
    for (int i = 0; i < 7; i++) {
        printf("  lamp %d: %d samples\n", i, seen[i]);
        assert_true(seen[i] > 50);
    }
    scene_end(&s);
}

/* The density over the sphere, from rays in all directions, is the chance of the one light: 1. */
static void densities_integrate_to_one(void **state) {
    (void)state;
    for (int kind = 0; kind < 7; kind++) {
        trc_light_desc d = lamp(TRC_LIGHT_AREA, 0.3f, 0.2f, 0.6f);
        if (kind == 1)
            d.area_shape = TRC_AREA_ELLIPSE;
        if (kind == 2)
            d = lamp(TRC_LIGHT_POINT, 0, 0, 1);
        if (kind == 3)
            d = lamp(TRC_LIGHT_SUN, 0, 0, 1);
        if (kind == 4)
            d.spread = 1.5f;
        if (kind == 5)
            d = lamp(TRC_LIGHT_AREA, 0.3f, 0.2f, 25.0f), d.size_x = 4.0f;
        if (kind == 6)
            d = lamp(TRC_LIGHT_POINT, 0, 0, 1), d.flags = TRC_LIGHT_SPHERE;
        d.radius = 0.8f;
        d.angle = 1.0f;
        struct scene s;
        scene_begin(&s);
        scene_commit(&s, &d, 1);
        const struct trc_surface r = receiver(&s, 0, 0, 0);
        /* Rays into a cone that holds the light. */
        const double cos_cone = kind == 5 ? 0.99 : 0.0;
        const int side = 2048;
        double sum = 0;
        for (int i = 0; i < side; i++)
            for (int j = 0; j < side; j += TRC_WIDTH) {
                const vfloat u1 = vf_set(((float)i + 0.5f) / (float)side);
                const vfloat u2 =
                    (vi_to_float(vi_lane() + vi_set(j)) + vf_set(0.5f)) / vf_set((float)side);
                const vvec3 wi = trc_warp_cone(vf_set((float)cos_cone), u1, u2);
                vvec3 weighed = v3_zero(), whole = v3_zero();
                struct trc_light_ray ray = seeing(r.p, r.n, wi, vf_set(TRC_FAR), vf_one(),
                                                  TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED);
                trc_light_hit(&s.snapshot, &ray, TRC_ALL_GROUPS, vm_all_set(), &weighed);
                ray.bsdf_pdf = vf_set(-1.0f);
                trc_light_hit(&s.snapshot, &ray, TRC_ALL_GROUPS, vm_all_set(), &whole);
                for (int k = 0; k < TRC_WIDTH; k++)
                    if (vf_get(weighed.y, k) > 0.0f)
                        sum += implied_pdf((double)vf_get(weighed.y, k), (double)vf_get(whole.y, k),
                                           1.0);
            }
        const double total = sum * 2 * M_PI * (1 - cos_cone) / ((double)side * side);
        printf("  kind %d: %.5f\n", kind, total);
        /* With slats the corners of the visible rectangle are sampled, but dark: rays do not see
         * them. A large disk is sampled as a square. */
        if (kind == 4 || kind == 1)
            assert_true(total > 0.7 && total < 1.001);
        else
            assert_true(fabs(total - 1.0) < 3e-3);
        scene_end(&s);
    }
}

/* ---- many lights ---- */

/* A cloud of triangles above and around the origin. */
static void cloud(struct scene *s, int count, double corners[][3][3]) {
    struct rng random = rng_seed(21);
    scene_begin(s);
    scene_emit(s, 3, 3, 3);
    for (int i = 0; i < count; i++) {
        float c[9];
        double center[3];
        for (int k = 0; k < 3; k++)
            center[k] = 8.0 * ((double)rng_unit(&random) - 0.5);
        center[2] = fabs(center[2]) + 0.9;
        for (int k = 0; k < 9; k++) {
            c[k] = (float)(center[k % 3] + 0.6 * ((double)rng_unit(&random) - 0.5));
            corners[i][k / 3][k % 3] = (double)c[k];
        }
        scene_triangle(s, c, i % 7 == 3 ? 1 : 0);
    }
}

static void many_triangles(void **state) {
    (void)state;
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    const int counts[] = {20, 200, MESH_TRIANGLES};
    for (int i = 0; i < 3; i++) {
        cloud(&s, counts[i], corners);
        scene_commit(&s, NULL, 0);
        assert_true((s.table->trails != NULL) == (counts[i] > 40));
        double want = 0;
        for (int k = 0; k < counts[i]; k++)
            if (k % 7 != 3)
                want += 3 * polygon(corners[k], 3);
        const struct trc_surface r = receiver(&s, 0, 0, 0);
        char what[40];
        snprintf(what, sizeof what, "%d triangles", counts[i]);
        expect(what, irradiance(&r), want);
        scene_end(&s);
    }
}

/* Chances by counting against chances by asking, for lists and trees; sampled lights must agree
 * with trc_light_triangle_weight. */
static void chances_match(void **state) {
    (void)state;
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    const int counts[] = {20, 300};
    for (int i = 0; i < 2; i++) {
        cloud(&s, counts[i], corners);
        trc_light_desc lights[] = {lamp(TRC_LIGHT_SUN, 0, 0, 0), lamp(TRC_LIGHT_POINT, 1, 1, 2)};
        lights[0].strength = 2.0f;
        scene_commit(&s, lights, 2);
        struct trc_surface r = receiver(&s, 0.3, 0.1, 0);
        const struct trc_receiver who = trc_receiver_make(r.p, r.n);
        static int count[MESH_TRIANGLES + 3];
        memset(count, 0, sizeof count);
        struct rng random = rng_seed(5);
        double worst = 0.0, chi = 0.0, sum = 0.0;
        for (int n = 0; n < SAMPLES; n += TRC_WIDTH) {
            struct trc_light_sample l;
            const vfloat u0 = test_wide_uniform(&random), u1 = test_wide_uniform(&random);
            trc_light_sample(&r, r.n, u0, u1, test_wide_uniform(&random), &l);
            struct trc_surface e = receiver(&s, 0, 0, 0);
            const uint32_t first = s.table->first_triangle;
            e.active = vm_andnot(l.valid, vi_lt(l.light, vi_set((int32_t)first)));
            e.triangle = vi_gather(&s.table->triangles->triangle,
                                   (l.light - vi_set((int32_t)first)) * vi_set(TRC_TRIANGLE_WORDS),
                                   e.active);
            e.p = v3_mad(l.wi, l.distance, r.p);
            e.wo = v3_neg(l.wi);
            const vfloat w =
                trc_light_triangle_weight(&e, r.p, r.n, vi_set(-1), vf_one(), vf_one());
            for (int k = 0; k < TRC_WIDTH; k++) {
                if (vi_get(l.light, k) >= 0)
                    count[vi_get(l.light, k)]++;
                if ((vm_bits(e.active) >> k) & 1u) {
                    const double pdf = implied_pdf((double)vf_get(w, k), 1.0, 1.0);
                    /* The weight loses digits where the density is far from 1. */
                    if (pdf > 0.1 && pdf < 30.0)
                        worst = fmax(worst, fabs(pdf / (double)vf_get(l.pdf, k) - 1.0));
                }
            }
        }
        int degrees = 0;
        const int lights_in_all = (int)(s.table->first_triangle + s.table->triangle_count);
        for (int k = 0; k < lights_in_all; k++) {
            const double chance =
                (double)vf_get(trc_light_chance(s.table, &who, vi_set(k), vm_all_set()), 0);
            sum += chance;
            const double expected = chance * SAMPLES;
            if (expected < 5.0)
                continue;
            chi += (count[k] - expected) * (count[k] - expected) / expected;
            degrees++;
        }
        printf("  %d lights: chances sum to %.5f, chi2 %.0f of %d, weights off by %.2g\n",
               lights_in_all, sum, chi, degrees, worst);
        /* A branch without light loses what was given to it. */
        assert_true(sum <= 1.0001 && sum > 0.95);
        assert_true(chi < degrees + 6 * sqrt(2.0 * degrees));
        assert_true(worst < 2e-2);
        scene_end(&s);
    }
}

/* A point close below a ball: no light is found by so few samples that one of them outweighs what
 * all give. */
static void nearest_lights_are_found(void **state) {
    (void)state;
    enum { RINGS = 12, SEGMENTS = 24 };
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    scene_begin(&s);
    scene_emit(&s, 1, 1, 1);
    for (int i = 0; i < 2 * RINGS * SEGMENTS; i++) {
        const int ring = i / (2 * SEGMENTS), segment = i / 2 % SEGMENTS, upper = i % 2;
        const int rings[3] = {ring, ring + 1, ring + upper};
        const int segments[3] = {segment, segment + !upper, segment + 1};
        float c[9];
        for (int k = 0; k < 3; k++) {
            const double theta = M_PI * rings[k] / RINGS, phi = 2 * M_PI * segments[k] / SEGMENTS;
            corners[i][k][0] = sin(theta) * cos(phi) + 0.03;
            corners[i][k][1] = sin(theta) * sin(phi) + 0.05;
            corners[i][k][2] = 1.02 - cos(theta);
        }
        for (int k = 0; k < 9; k++)
            c[k] = (float)corners[i][k / 3][k % 3];
        scene_triangle(&s, c, 0);
    }
    scene_commit(&s, NULL, 0);
    assert_non_null(s.table->trails);
    const struct trc_surface r = receiver(&s, 0, 0, 0);
    const struct trc_receiver who = trc_receiver_make(r.p, r.n);
    double sum = 0.0, most = 0.0;
    for (uint32_t k = 0; k < s.table->triangle_count; k++) {
        const int light = (int)(s.table->first_triangle + k);
        const double gives = polygon(corners[s.table->triangles[k].triangle], 3);
        const double chance =
            (double)vf_get(trc_light_chance(s.table, &who, vi_set(light), vm_all_set()), 0);
        sum += gives;
        most = fmax(most, gives / fmax(chance, 1e-30));
    }
    printf("  %u triangles: a sample gives at most %.1f times what all do\n",
           s.table->triangle_count, most / sum);
    assert_true(most < 20.0 * sum);
    scene_end(&s);
}

static void moving_triangles(void **state) {
    (void)state;
    static struct scene s;
    scene_begin(&s);
    scene_emit(&s, 1, 1, 1);
    const double c[3][3] = {{-1, -1, 1}, {1, -1, 1}, {0, 1, 1}};
    float corners[9];
    for (int j = 0; j < 9; j++)
        corners[j] = (float)c[j / 3][j % 3];
    scene_triangle(&s, corners, 0);
    /* The mesh rises by 1 and the instance by 2 over the shutter. */
    for (int j = 0; j < 9; j++)
        s.positions[9 + j] = corners[j] + (j % 3 == 2 ? 1.0f : 0.0f);
    s.mesh.key_count = 2;
    s.instance.key_count = 2;
    s.to_world[1].m[11] = 2.0f;
    scene_commit(&s, NULL, 0);
    for (double t = 0; t <= 1.0; t += 0.25) {
        double now[3][3];
        memcpy(now, c, sizeof now);
        for (int k = 0; k < 3; k++)
            now[k][2] += 3 * t;
        struct trc_surface r = receiver(&s, 0, 0, 0);
        r.time = vf_set((float)t);
        expect("moving triangle", irradiance(&r), polygon(now, 3));
    }
    scene_end(&s);
}

/* ---- visibility ---- */

static void hidden_lamps(void **state) {
    (void)state;
    trc_light_desc d = lamp(TRC_LIGHT_AREA, 0, 0, 2);
    const vvec3 up = v3(vf_zero(), vf_zero(), vf_one());
    struct {
        uint32_t visibility, use_mis, path;
        bool seen;
    } cases[] = {
        {TRC_VISIBLE_ALL & ~TRC_VISIBLE_CAMERA, 1, TRC_VISIBLE_CAMERA, false},
        {TRC_VISIBLE_ALL, 1, TRC_VISIBLE_CAMERA, true},
        {TRC_VISIBLE_ALL, 0, TRC_VISIBLE_CAMERA, true},
        {TRC_VISIBLE_ALL, 0, TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED, false},
        {TRC_VISIBLE_ALL & ~TRC_VISIBLE_GLOSSY, 1, TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED, false},
        {TRC_VISIBLE_ALL & ~TRC_VISIBLE_GLOSSY, 1, TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION,
         true},
        {TRC_VISIBLE_ALL & ~TRC_VISIBLE_TRANSMISSION, 1, TRC_VISIBLE_TRANSMISSION, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        d.visibility = cases[i].visibility;
        d.use_mis = cases[i].use_mis;
        struct scene s;
        scene_begin(&s);
        scene_commit(&s, &d, 1);
        vvec3 radiance = v3_zero();
        struct trc_light_ray ray =
            seeing(v3_zero(), v3_zero(), up, vf_set(5.0f), vf_set(-1.0f), cases[i].path);
        trc_light_hit(&s.snapshot, &ray, TRC_ALL_GROUPS, vm_all_set(), &radiance);
        const float want = cases[i].seen ? 25.0f : 0.0f;
        assert_true(fabsf(vf_get(radiance.x, 0) - want) < 1e-3f);
        /* Rays that pass do not end at lamps; those that stop before do not see them. */
        ray.tmax = vf_set(1.9f);
        trc_light_hit(&s.snapshot, &ray, TRC_ALL_GROUPS, vm_all_set(), &radiance);
        assert_true(fabsf(vf_get(radiance.x, 0) - want) < 1e-3f);
        scene_end(&s);
    }
}

static void dark_tables(void **state) {
    (void)state;
    struct scene s;
    scene_begin(&s);
    trc_light_desc off[] = {lamp(TRC_LIGHT_POINT, 0, 0, 1), lamp(TRC_LIGHT_AREA, 0, 0, 1)};
    off[0].strength = 0.0f;
    off[1].size_x = 0.0f;
    scene_commit(&s, off, 2);
    assert_int_equal((int)s.table->lamp_count, 0);
    const struct trc_surface r = receiver(&s, 0, 0, 0);
    struct trc_light_sample l;
    trc_light_sample(&r, r.n, vf_set(0.5f), vf_set(0.5f), vf_set(0.5f), &l);
    assert_false(vm_any(l.valid));
    scene_end(&s);
    trc_light_table_destroy(NULL);
}

/* Where nothing scatters, lamps are seen and nothing is chosen from. */
static void lights_that_are_not_sampled(void **state) {
    (void)state;
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    cloud(&s, 100, corners);
    s.snapshot.world.material = 1;
    s.snapshot.world.radiance[0] = 1.0f;
    const trc_light_desc d = lamp(TRC_LIGHT_AREA, 0, 0, 1);
    scene_commit_as(&s, &d, 1, 0);
    assert_int_equal((int)s.table->lamp_count, 1);
    assert_int_equal((int)s.table->group_seen[TRC_MAX_LIGHT_GROUPS + 1], 1);
    assert_int_equal((int)s.table->triangle_count, 0);
    assert_true(s.instance.first_light == UINT32_MAX && s.table->world_light == UINT32_MAX);
    const struct trc_surface r = receiver(&s, 0, 0, 0);
    struct trc_light_sample l;
    trc_light_sample(&r, r.n, vf_set(0.5f), vf_set(0.5f), vf_set(0.5f), &l);
    assert_false(vm_any(l.valid));
    scene_end(&s);
}

/* A commit that is cancelled leaves no table, whatever part of it hears that. */
static void cancelled(void **state) {
    (void)state;
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    const atomic_uint cancel = 1;
    struct trc_pool *pool;
    assert_int_equal(trc_pool_create(1, &pool), TRC_OK);
    const struct trc_light_options options = {
        .scatters = TRC_MATERIAL_SCATTERS, .pool = pool, .cancel = &cancel};
    cloud(&s, 100, corners);
    const uint64_t before = trc_memory_bytes();
    struct trc_light_table *table = NULL;
    assert_int_equal(trc_light_table_create(&s.snapshot, &options, &table), TRC_ERROR_CANCELLED);
    struct trc_world_map *map = NULL;
    assert_int_equal(trc_world_map_create(&s.snapshot, 64, &options, &map), TRC_ERROR_CANCELLED);
    struct trc_light_table tree = {.triangle_count = 100};
    static struct trc_light_bound leaves[100];
    assert_int_equal(trc_light_tree_build(&tree, leaves, 100, 8, &options), TRC_ERROR_CANCELLED);
    trc_free(tree.bounds);
    trc_free(tree.trails);
    assert_true(!table && !map && trc_memory_bytes() == before);
    trc_pool_destroy(pool);
}

static void allocation_failures(void **state) {
    (void)state;
    static double corners[MESH_TRIANGLES][3][3];
    static struct scene s;
    cloud(&s, 100, corners);
    const trc_light_desc d = lamp(TRC_LIGHT_POINT, 0, 0, 1);
    struct trc_pool *pool; /* of one thread: threads free memory as they start */
    assert_int_equal(trc_pool_create(1, &pool), TRC_OK);
    const struct trc_light_options options = {
        .lights = &d, .light_count = 1, .scatters = TRC_MATERIAL_SCATTERS, .pool = pool};
    const uint64_t before = trc_memory_bytes();
    for (int64_t n = 0;; n++) {
        trc_memory_fail_at(n, false);
        struct trc_light_table *table = NULL;
        const trc_status status = trc_light_table_create(&s.snapshot, &options, &table);
        trc_memory_fail_at(-1, false);
        if (status == TRC_OK) {
            assert_true(n > 5);
            trc_light_table_destroy(table);
            break;
        }
        assert_int_equal(status, TRC_ERROR_OUT_OF_MEMORY);
        assert_null(table);
        assert_true(trc_memory_bytes() == before);
    }
    assert_true(trc_memory_bytes() == before);
    trc_pool_destroy(pool);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lamps_have_cycles_units),
        cmocka_unit_test(areas_match_closed_forms),
        cmocka_unit_test(triangles_match_closed_forms),
        cmocka_unit_test(rays_agree_with_samples),
        cmocka_unit_test(densities_integrate_to_one),
        cmocka_unit_test(many_triangles),
        cmocka_unit_test(chances_match),
        cmocka_unit_test(nearest_lights_are_found),
        cmocka_unit_test(moving_triangles),
        cmocka_unit_test(hidden_lamps),
        cmocka_unit_test(dark_tables),
        cmocka_unit_test(lights_that_are_not_sampled),
        cmocka_unit_test(cancelled),
        cmocka_unit_test(allocation_failures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
