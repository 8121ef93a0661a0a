/* Elementary functions against long double, in units in the last place; frames and warps. */
#include <float.h>
#include <stdio.h>

#include "figures.h"
#include "kernels/simd/wide_math.h"
#include "wide_test.h"

#define POINTS (1 << 20)

/* |got - want| in ulps of want, or of smallest where want is below it (absolute error near
 * roots). */
static double ulps(float got, long double want, long double smallest) {
    if (isnan(got) && isnan(want))
        return 0.0;
    if (fabsl(want) > FLT_MAX)
        return isinf(got) ? 0.0 : 1e9;
    const long double size = fmaxl(fmaxl(fabsl(want), smallest), (long double)FLT_MIN);
    int exponent;
    frexpl(size, &exponent);
    return (double)(fabsl((long double)got - want) / ldexpl(1.0L, exponent - 24));
}

typedef vfloat (*wide_function)(vfloat x);
typedef long double (*long_function)(long double x);

static double worst(const char *name, wide_function f, long_function g, double from, double to,
                    bool by_exponent, long double smallest) {
    double most = 0.0;
    float at = 0.0f;
    for (int i = 0; i < POINTS; i += TRC_WIDTH) {
        float x[TRC_WIDTH], y[TRC_WIDTH];
        for (int k = 0; k < TRC_WIDTH; k++) {
            const double t = ((double)(i + k) + 0.5) / POINTS;
            x[k] = (float)(by_exponent ? from * pow(to / from, t) : from + (to - from) * t);
        }
        vf_store(y, f(vf_load(x)));
        for (int k = 0; k < TRC_WIDTH; k++) {
            const double error = ulps(y[k], g((long double)x[k]), smallest);
            if (!(error <= most)) {
                most = error;
                at = x[k];
            }
        }
    }
    char title[64];
    (void)snprintf(title, sizeof title, "%s from %g to %g", name, from, to);
    if (smallest >= 0.5L)
        print_figure(title, "%.2g, absolute", ldexp(most, -24));
    else
        print_figure(title, "%.2f ulp, at %.9g", most, (double)at);
    return most;
}

static vfloat wide_sin(vfloat x) { return vf_sin(x); }
static vfloat wide_cos(vfloat x) { return vf_cos(x); }
static vfloat wide_tan(vfloat x) { return vf_tan(x); }
static vfloat wide_exp(vfloat x) { return vf_exp(x); }
static vfloat wide_exp2(vfloat x) { return vf_exp2_split(x, vf_zero()); }
static vfloat wide_log(vfloat x) { return vf_log(x); }
/* As vf_pow takes it; the part that floats cannot hold is left out. */
static vfloat wide_log2(vfloat x) {
    vfloat high, low;
    vf_log2_split(vf_max(x, vf_set(1e-45f)), &high, &low);
    return vf_log_special(x, high);
}
static vfloat wide_acos(vfloat x) { return vf_acos(x); }
static vfloat wide_asin(vfloat x) { return vf_asin(x); }
static vfloat wide_atan(vfloat x) { return vf_atan(x); }
static vfloat wide_erf(vfloat x) { return vf_erf(x); }

static void bounds_of_functions(void **state) {
    (void)state;
    const long double near_root = ldexpl(1.0L, -3);
    assert_true(worst("sin", wide_sin, sinl, -8192.0, 8192.0, false, near_root) <= 4.0);
    assert_true(worst("sin", wide_sin, sinl, 1e-30, 0.7, true, 0.0L) <= 2.0);
    assert_true(worst("cos", wide_cos, cosl, -8192.0, 8192.0, false, near_root) <= 4.0);
    assert_true(worst("tan", wide_tan, tanl, -1.5, 1.5, false, 0.0L) <= 4.0);
    assert_true(worst("exp", wide_exp, expl, -87.0, 88.7, false, 0.0L) <= 2.0);
    assert_true(worst("exp2", wide_exp2, exp2l, -125.0, 127.9, false, 0.0L) <= 2.0);
    assert_true(worst("log", wide_log, logl, 1e-45, 3e38, true, 0.0L) <= 2.0);
    assert_true(worst("log", wide_log, logl, 0.5, 2.0, false, 0.0L) <= 2.0);
    assert_true(worst("log2", wide_log2, log2l, 1e-45, 3e38, true, 0.0L) <= 1.0);
    assert_true(worst("log2", wide_log2, log2l, 0.5, 2.0, false, 0.0L) <= 1.0);
    assert_true(worst("acos", wide_acos, acosl, -1.0, 1.0, false, 0.0L) <= 3.0);
    assert_true(worst("asin", wide_asin, asinl, -1.0, 1.0, false, 0.0L) <= 3.0);
    assert_true(worst("atan", wide_atan, atanl, 1e-20, 1e20, true, 0.0L) <= 3.0);
    assert_true(worst("atan", wide_atan, atanl, -3.0, 3.0, false, 0.0L) <= 3.0);
    assert_true(worst("erf", wide_erf, erfl, -5.0, 5.0, false, 0.75L) <= 12.0);
}

static void power(void **state) {
    (void)state;
    struct rng random = rng_seed(11);
    double most = 0.0;
    for (int i = 0; i < POINTS; i += TRC_WIDTH) {
        float x[TRC_WIDTH], y[TRC_WIDTH], r[TRC_WIDTH];
        for (int k = 0; k < TRC_WIDTH; k++) {
            x[k] = expf(10.0f * (rng_unit(&random) - 0.5f));
            y[k] = 40.0f * (rng_unit(&random) - 0.5f);
            if (i / TRC_WIDTH & 1) {
                x[k] = 1.0f - 0.3f * rng_unit(&random) * rng_unit(&random);
                y[k] = 2000.0f * rng_unit(&random) * rng_unit(&random);
            }
        }
        vf_store(r, vf_pow(vf_load(x), vf_load(y)));
        for (int k = 0; k < TRC_WIDTH; k++) {
            const long double want = powl((long double)x[k], (long double)y[k]);
            if (want > 2e-38L && want < 3e38L)
                most = fmax(most, ulps(r[k], want, 0.0L));
        }
    }
    print_figure("pow", "%.2f ulp", most);
    assert_true(most <= 4.0);
    assert_true(vf_get(vf_pow(vf_set(0.0f), vf_set(2.2f)), 0) == 0.0f);
    assert_true(vf_get(vf_pow(vf_set(0.0f), vf_set(0.0f)), 0) == 1.0f);
    assert_true(isinf(vf_get(vf_pow(vf_set(0.0f), vf_set(-1.0f)), 0)));
    assert_true(isnan(vf_get(vf_pow(vf_set(-1.0f), vf_set(0.5f)), 0)));
    assert_true(isnan(vf_get(vf_log(vf_set(-1.0f)), 0)));
    assert_true(vf_get(vf_log(vf_set(0.0f)), 0) == -INFINITY);
    assert_true(vf_get(vf_exp(vf_set(-INFINITY)), 0) == 0.0f);
    assert_true(isinf(vf_get(vf_exp(vf_set(100.0f)), 0)));
}

static void angles(void **state) {
    (void)state;
    struct rng random = rng_seed(5);
    double most = 0.0, most_turns = 0.0, most_inverse = 0.0;
    for (int i = 0; i < POINTS; i += TRC_WIDTH) {
        float x[TRC_WIDTH], y[TRC_WIDTH], t[TRC_WIDTH], s[TRC_WIDTH], e[TRC_WIDTH];
        for (int k = 0; k < TRC_WIDTH; k++) {
            x[k] = (rng_unit(&random) - 0.5f) * expf(20.0f * (rng_unit(&random) - 0.5f));
            y[k] = (rng_unit(&random) - 0.5f) * expf(20.0f * (rng_unit(&random) - 0.5f));
            t[k] = rng_unit(&random);
        }
        vfloat sine, cosine;
        vf_sincos_turns(vf_load(t), &sine, &cosine);
        vf_store(s, sine);
        vf_store(e, vf_erf(vf_erfinv(vf_load(t) * vf_set(0.998f))));
        float r[TRC_WIDTH];
        vf_store(r, vf_atan2(vf_load(y), vf_load(x)));
        for (int k = 0; k < TRC_WIDTH; k++) {
            most = fmax(most, ulps(r[k], atan2l((long double)y[k], (long double)x[k]), 0.0L));
            most_turns = fmax(
                most_turns, ulps(s[k], sinl(6.283185307179586476925L * (long double)t[k]), 1e-3L));
            most_inverse = fmax(most_inverse, fabs((double)e[k] - (double)t[k] * 0.998));
        }
    }
    print_figure("atan2", "%.2f ulp", most);
    print_figure("sine of turns", "%.2f ulp", most_turns);
    print_figure("erf of its inverse", "off by %.2g", most_inverse);
    assert_true(most <= 4.0);
    assert_true(most_turns <= 4.0);
    assert_true(most_inverse <= 2e-6);
}

static void frames_are_orthonormal(void **state) {
    (void)state;
    struct rng random = rng_seed(3);
    double most = 0.0;
    for (int i = 0; i < 1 << 16; i++) {
        const vfloat u1 = test_wide_uniform(&random), u2 = test_wide_uniform(&random);
        const vvec3 n = i == 0 ? v3(vf_zero(), vf_zero(), -vf_one()) : trc_warp_sphere(u1, u2);
        vvec3 a, b;
        v3_frame(n, &a, &b);
        const vvec3 c = v3_cross(a, b);
        const vfloat errors[] = {v3_dot(a, b),
                                 v3_dot(a, n),
                                 v3_dot(b, n),
                                 v3_dot(a, a) - vf_one(),
                                 v3_dot(b, b) - vf_one(),
                                 v3_dot(c, n) - vf_one()};
        for (size_t k = 0; k < sizeof errors / sizeof errors[0]; k++)
            for (int lane = 0; lane < TRC_WIDTH; lane++)
                most = fmax(most, fabs((double)vf_get(errors[k], lane)));
    }
    print_figure("frames around a normal", "off by %.2g", most);
    assert_true(most < 1e-6);
}

static void warps_keep_their_moments(void **state) {
    (void)state;
    const int side = 1024;
    double disk = 0.0, cosine = 0.0, cone = 0.0, sphere = 0.0, triangle[3] = {0};
    int count = 0;
    for (int i = 0; i < side; i++) {
        for (int j = 0; j < side; j += TRC_WIDTH) {
            const vfloat u1 = vf_set(((float)i + 0.5f) / (float)side);
            const vfloat u2 =
                (vi_to_float(vi_lane() + vi_set(j)) + vf_set(0.5f)) / vf_set((float)side);
            vfloat x, y, b1, b2;
            trc_warp_disk(u1, u2, &x, &y);
            trc_warp_triangle(u1, u2, &b1, &b2);
            const vfloat r2 = x * x + y * y, z = trc_warp_cosine(u1, u2).z;
            const vfloat c = trc_warp_cone(vf_set(0.5f), u1, u2).z, q = trc_warp_sphere(u1, u2).x;
            for (int lane = 0; lane < TRC_WIDTH; lane++, count++) {
                disk += vf_get(r2, lane);
                cosine += vf_get(z, lane);
                cone += vf_get(c, lane);
                sphere += vf_get(q, lane) * vf_get(q, lane);
                triangle[0] += vf_get(b1, lane);
                triangle[1] += vf_get(b2, lane);
                triangle[2] += vf_get(b1, lane) * vf_get(b2, lane);
            }
        }
    }
    assert_true(fabs(disk / count - 0.5) < 1e-4);
    assert_true(fabs(cosine / count - 2.0 / 3.0) < 1e-4);
    assert_true(fabs(cone / count - 0.75) < 1e-4);
    assert_true(fabs(sphere / count - 1.0 / 3.0) < 1e-4);
    assert_true(fabs(triangle[0] / count - 1.0 / 3.0) < 1e-3);
    assert_true(fabs(triangle[1] / count - 1.0 / 3.0) < 1e-3);
    assert_true(fabs(triangle[2] / count - 1.0 / 12.0) < 1e-3);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_of_functions),
        cmocka_unit_test(power),
        cmocka_unit_test(angles),
        cmocka_unit_test(frames_are_orthonormal),
        cmocka_unit_test(warps_keep_their_moments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
