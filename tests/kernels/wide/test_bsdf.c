/* Lobes: sampling against its density, reciprocity, agreement of evaluating and sampling, and
 * values against formulas in double. Their energy: test_furnace.c. */
#include "bsdf_test.h"
#include "figures.h"

#define EXTREME_SAMPLES (1 << 16)

struct result {
    double chi, degrees, density, value, mean, error;
};

static struct result check_sampling(struct model *m, double cos_o, double phi_o, int fine) {
    struct trc_surface s;
    struct trc_lobes l;
    prepare(m, direction(cos_o, phi_o), &s, &l);
    struct histogram h;
    draw_samples(&l, &s, SAMPLES, &h);
    struct result r = {0};
    double pooled_count = 0, pooled_expected = 0;
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < COLUMNS; j++) {
            double density, value;
            integrate_cell(&l, &s, i, j, fine, &density, &value);
            r.density += density;
            r.value += value;
            const double expected = density * SAMPLES;
            if (expected < 20.0) {
                pooled_count += h.count[i][j];
                pooled_expected += expected;
                continue;
            }
            /* The midpoint rule has an error of its own: half a per cent is forgiven. */
            const double off = fmax(fabs(h.count[i][j] - expected) - 0.005 * expected, 0.0);
            r.chi += off * off / expected;
            r.degrees += 1.0;
        }
    if (pooled_expected > 20.0) {
        const double off = fmax(fabs(pooled_count - pooled_expected) - 0.01 * pooled_expected, 0.0);
        r.chi += off * off / pooled_expected;
        r.degrees += 1.0;
    }
    r.mean = h.weight / SAMPLES;
    r.error = sqrt(fmax(h.weight2 / SAMPLES - r.mean * r.mean, 0.0) / SAMPLES);
    return r;
}

/* Chi-square of 5 standard deviations (Wilson and Hilferty 1931). */
static double chi_limit(double degrees) {
    const double a = 2.0 / (9.0 * degrees);
    return degrees * pow(1.0 - a + 5.0 * sqrt(a), 3.0);
}

/* Of the lobes whose samples were counted, and of those that passed; for the table of stability. */
static int chi_tests, chi_passes;

static void sampling_matches_density(void **state) {
    (void)state;
    struct model models[] = {
        translucent(),
        glossy(TRC_DISTRIBUTION_GGX, 0.5f, 0.0f),
        glossy(TRC_DISTRIBUTION_GGX, 1.0f, 0.0f),
        glossy(TRC_DISTRIBUTION_GGX, 0.7f, 0.5f),
        glossy(TRC_DISTRIBUTION_GGX, 0.7f, -0.6f),
        glossy(TRC_DISTRIBUTION_MULTI_GGX, 0.8f, 0.0f),
        glossy(TRC_DISTRIBUTION_MULTI_GGX, 0.8f, 0.4f),
        glossy(TRC_DISTRIBUTION_BECKMANN, 0.6f, 0.0f),
        glossy(TRC_DISTRIBUTION_BECKMANN, 0.8f, 0.4f),
        glossy(TRC_DISTRIBUTION_ASHIKHMIN, 0.6f, 0.0f),
        glossy(TRC_DISTRIBUTION_ASHIKHMIN, 0.7f, 0.4f),
        glass(TRC_DISTRIBUTION_GGX, 0.6f, 1.5f, false),
        glass(TRC_DISTRIBUTION_GGX, 0.6f, 1.5f, true),
        glass(TRC_DISTRIBUTION_BECKMANN, 0.6f, 1.3f, false),
        glass(TRC_DISTRIBUTION_MULTI_GGX, 0.8f, 1.5f, false),
        refraction(TRC_DISTRIBUTION_GGX, 0.7f, 1.4f),
        principled("Principled"),
        principled_metal(TRC_DISTRIBUTION_GGX, 0.7f),
        principled_metal(TRC_DISTRIBUTION_MULTI_GGX, 0.8f),
        principled_glass(TRC_DISTRIBUTION_GGX, 0.6f, false),
        principled_all(),
        clearcoat(0.6f),
        toon(1, 0.4f, 0.0f),
        toon(1, 0.4f, 0.1f),
        glossy(TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_CORRELATED, 0.7f, 0.3f),
        glass(TRC_DISTRIBUTION_MULTI_GGX | TRC_DISTRIBUTION_CORRELATED, 0.7f, 1.5f, true),
        layered_glass(TRC_DISTRIBUTION_GGX, 0.6f, false),
        thin_wall(0.7f),
        filmed(TRC_DISTRIBUTION_GGX, 0.6f, false),
        filmed(TRC_DISTRIBUTION_MULTI_GGX, 0.6f, true),
        layered_all(),
        principled_hair(0.2f, 0.6f, 0.7f, 0.3f, 0.05f),
        principled_hair(0.0f, 0.8f, 0.5f, 0.0f, 0.0f),
    };
    int failed = 0;
    for (size_t i = 0; i < sizeof models / sizeof models[0]; i++)
        for (int k = 0; k < 3; k++) {
            const double cosines[] = {0.95, 0.5, 0.1};
            const struct result r = check_sampling(&models[i], cosines[k], 0.7, FINE);
            const bool bad = r.chi > chi_limit(r.degrees);
            failed += bad;
            chi_tests++;
            chi_passes += !bad;
            if (bad || k == 1)
                printf("%-24s cos %.2f: chi2 %.0f of %.0f, density %.4f\n", models[i].name,
                       cosines[k], r.chi, r.degrees, r.density);
        }
    assert_int_equal(failed, 0);
}

/* Mean weight of samples against the integral of the value: with what is sampled only, no diffuse
 * lobes. */
static void weights_match_values(void **state) {
    (void)state;
    struct model models[] = {
        translucent(),
        glossy(TRC_DISTRIBUTION_GGX, 0.5f, 0.0f),
        glossy(TRC_DISTRIBUTION_GGX, 1.0f, 0.0f),
        glossy(TRC_DISTRIBUTION_GGX, 0.7f, 0.5f),
        glossy(TRC_DISTRIBUTION_MULTI_GGX, 0.8f, 0.0f),
        glossy(TRC_DISTRIBUTION_BECKMANN, 0.6f, 0.0f),
        glossy(TRC_DISTRIBUTION_ASHIKHMIN, 0.6f, 0.0f),
        glass(TRC_DISTRIBUTION_GGX, 0.6f, 1.5f, false),
        glass(TRC_DISTRIBUTION_GGX, 0.6f, 1.5f, true),
        glass(TRC_DISTRIBUTION_BECKMANN, 0.6f, 1.3f, false),
        principled_metal(TRC_DISTRIBUTION_GGX, 0.7f),
        principled_glass(TRC_DISTRIBUTION_GGX, 0.6f, false),
        thin_wall(0.6f),
        principled("Principled"),
        principled_all(),
        clearcoat(0.6f),
        toon(1, 0.4f, 0.1f),
        toon(1, 0.8f, 0.7f), /* the cone ends before its light does */
    };
    int failed = 0;
    for (size_t i = 0; i < sizeof models / sizeof models[0]; i++)
        for (int k = 0; k < 3; k++) {
            const double cosines[] = {0.95, 0.5, 0.15};
            const struct result r = check_sampling(&models[i], cosines[k], 0.7, FINE);
            /* Lobes that do not continue reach directions no sample does; those materials only must
             * not give more. */
            const double off = fabs(r.mean - r.value),
                         allowed = 5 * r.error + 0.004 * r.value + 1e-4;
            const bool mixed = models[i].material.leaves[0].type == TRC_NODE_PRINCIPLED &&
                               models[i].operands[0].value < 1.0f &&
                               models[i].operands[0].value > 0.0f;
            const bool bad = mixed ? r.mean > r.value + allowed : off > allowed;
            failed += bad;
            if (bad || k == 1)
                printf("%-24s cos %.2f: samples %.4f +- %.4f, integral %.4f\n", models[i].name,
                       cosines[k], r.mean, r.error, r.value);
        }
    assert_int_equal(failed, 0);
}

/* ---- reciprocity and values ---- */

static void lobes_are_reciprocal(void **state) {
    (void)state;
    struct model models[] = {diffuse(0.0f),
                             glossy(TRC_DISTRIBUTION_GGX, 0.5f, 0.4f),
                             glossy(TRC_DISTRIBUTION_BECKMANN, 0.5f, 0.0f),
                             glossy(TRC_DISTRIBUTION_MULTI_GGX, 0.9f, 0.0f),
                             glossy(TRC_DISTRIBUTION_ASHIKHMIN, 0.6f, 0.3f),
                             principled("Principled")};
    struct rng random = rng_seed(9);
    for (size_t i = 0; i < sizeof models / sizeof models[0]; i++)
        for (int n = 0; n < 200; n++) {
            const double c1 = 0.05 + 0.95 * (double)rng_unit(&random);
            const double c2 = 0.05 + 0.95 * (double)rng_unit(&random);
            const vvec3 a = direction(c1, 6.28 * (double)rng_unit(&random));
            const vvec3 b = direction(c2, 6.28 * (double)rng_unit(&random));
            float f[2];
            for (int k = 0; k < 2; k++) {
                struct trc_surface s;
                struct trc_lobes l;
                struct trc_bsdf_value v;
                prepare(&models[i], k ? b : a, &s, &l);
                trc_bsdf_eval(&l, &s, k ? a : b, vm_all_set(), vm_none(), &v);
                f[k] = (vf_get(v.diffuse.x, 0) + vf_get(v.glossy.x, 0)) / (float)(k ? c1 : c2);
            }
            assert_true(fabsf(f[0] - f[1]) <= 2e-4f * fmaxf(f[0], f[1]) + 1e-6f);
        }
}

/* Isotropic GGX with separable masking, in double: Walter 2007, eq. 20, 33, 34. */
static double ggx_reference(double alpha, const double o[3], const double i[3]) {
    double m[3], size = 0.0;
    for (int k = 0; k < 3; k++) {
        m[k] = o[k] + i[k];
        size += m[k] * m[k];
    }
    const double c = m[2] / sqrt(size), a2 = alpha * alpha, c2 = c * c, tan2 = (1 - c2) / c2;
    const double d = a2 / (M_PI * c2 * c2 * (a2 + tan2) * (a2 + tan2));
    const double go = 2 / (1 + sqrt(1 + a2 * (1 - o[2] * o[2]) / (o[2] * o[2])));
    const double gi = 2 / (1 + sqrt(1 + a2 * (1 - i[2] * i[2]) / (i[2] * i[2])));
    return d * go * gi / (4 * o[2]);
}
static void values_match_formulas(void **state) {
    (void)state;
    struct rng random = rng_seed(4);
    const float roughnesses[] = {0.03f, 0.1f, 0.5f, 1.0f};
    for (int k = 0; k < 4; k++)
        for (int n = 0; n < 500; n++) {
            struct model m = glossy(TRC_DISTRIBUTION_GGX, roughnesses[k], 0.0f);
            const double c = 0.05 + 0.95 * (double)rng_unit(&random), phi = 2.0;
            const double r = sqrt(1 - c * c);
            const double o[3] = {r * cos(phi), r * sin(phi), c};
            /* Near the mirror direction, so that sharp lobes are looked at where they live. */
            const double spread = 4.0 * (double)(roughnesses[k] * roughnesses[k]);
            double i[3] = {-o[0] + spread * ((double)rng_unit(&random) - 0.5),
                           -o[1] + spread * ((double)rng_unit(&random) - 0.5), o[2]};
            const double size = sqrt(i[0] * i[0] + i[1] * i[1] + i[2] * i[2]);
            for (int j = 0; j < 3; j++)
                i[j] /= size;
            struct trc_surface s;
            struct trc_lobes l;
            struct trc_bsdf_value v;
            prepare(&m, wide(o[0], o[1], o[2]), &s, &l);
            trc_bsdf_eval(&l, &s, wide(i[0], i[1], i[2]), vm_all_set(), vm_none(), &v);
            const double want = ggx_reference((double)(roughnesses[k] * roughnesses[k]), o, i);
            assert_true(fabs((double)vf_get(v.glossy.y, 0) - want) <= 2e-3 * want + 1e-7);
        }
}

/* ---- what follows from the rules ---- */

/* Mean weight of so many samples, less three standard deviations of it. */
static double least_energy(const struct histogram *h, int count) {
    const double mean = h->weight / count;
    return mean - 3.0 * sqrt(fmax(h->weight2 / count - mean * mean, 0.0) / count);
}

static void extremes_stay_finite(void **state) {
    (void)state;
    const double cosines[] = {1.0, 1e-2, 1e-4, 1e-7};
    const float roughnesses[] = {0.0f, 1e-7f, 1e-4f, 0.018f, 0.05f, 1.0f};
    const uint32_t later = TRC_DISTRIBUTION_MULTI_GGX | TRC_DISTRIBUTION_CORRELATED;
    double most = 0.0;
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 6; j++) {
            const float r = roughnesses[j];
            struct model models[] = {glossy(TRC_DISTRIBUTION_GGX, r, 0.9f),
                                     glossy(TRC_DISTRIBUTION_BECKMANN, r, 0.0f),
                                     glossy(TRC_DISTRIBUTION_ASHIKHMIN, r, 0.2f),
                                     glossy(TRC_DISTRIBUTION_MULTI_GGX, r, 0.0f),
                                     glass(TRC_DISTRIBUTION_GGX, r, 1.0f, true),
                                     glass(TRC_DISTRIBUTION_MULTI_GGX, r, 8.0f, true),
                                     glass(TRC_DISTRIBUTION_MULTI_GGX, r, 8.0f, false),
                                     glass(later, r, 8.0f, true),
                                     glass(later, r, 8.0f, false),
                                     glass(TRC_DISTRIBUTION_MULTI_GGX, r, 1.5f, true),
                                     glass(TRC_DISTRIBUTION_BECKMANN, r, 1.0000001f, false),
                                     principled_all(),
                                     clearcoat(r)};
            for (size_t i = 0; i < sizeof models / sizeof models[0]; i++) {
                struct trc_surface s;
                struct trc_lobes l;
                struct histogram h;
                prepare(&models[i], direction(cosines[k], 2.0), &s, &l);
                draw_samples(&l, &s, EXTREME_SAMPLES, &h); /* asserts */
                most = fmax(most, least_energy(&h, EXTREME_SAMPLES));
                for (int n = 0; n < 64; n++) {
                    struct trc_bsdf_value v;
                    trc_bsdf_eval(&l, &s, direction(1.0 - n / 31.5, n), vm_all_set(), vm_none(),
                                  &v);
                    assert_true(isfinite(vf_get(v.diffuse.x + v.glossy.x + v.transmission.x, 0)));
                    assert_true(vf_get(v.pdf, 0) >= 0.0f && isfinite(vf_get(v.pdf, 0)));
                }
            }
        }
    print_figure("31: lobes at roughness 0 to 1, cos to 1e-7",
                 "chi-square passes %d of %d, energy above %.3f nowhere, by three deviations",
                 chi_passes, chi_tests, most);
    assert_true(most < 1.005);
}

static void nothing_shines_through(void **state) {
    (void)state;
    int count = 0, below = 0;
    struct model models[] = {diffuse(0.0f), glossy(TRC_DISTRIBUTION_GGX, 0.6f, 0.0f),
                             principled("")};
    for (size_t i = 0; i < 3; i++)
        for (int n = 0; n < 100; n++) {
            struct trc_surface s;
            struct trc_lobes l;
            struct trc_registers regs;
            memset(&regs, 0, sizeof regs);
            point(&s, direction(0.4, 0.0), &models[i]);
            /* A shading normal 50 degrees off the geometric one. */
            s.n = direction(cos(0.87), 0.06 * n);
            trc_lobes_setup(material_of(&models[i]), &s, &regs, vf_zero(), &l);
            struct trc_bsdf_value v;
            trc_bsdf_eval(&l, &s, direction(-0.05 - 0.009 * n, 0.06 * n), vm_all_set(), vm_none(),
                          &v);
            count++;
            below += vf_get(v3_max(v.diffuse) + v3_max(v.glossy), 0) != 0.0f;
            struct trc_bsdf_sample b;
            trc_bsdf_sample(&l, &s, vf_set(0.5f), vf_set(0.01f * (float)n), vf_set(0.9f), &b);
            count++;
            below += vm_any(b.valid) && vf_get(b.wi.z, 0) <= 0.0f;
        }
    print_figure("37: shading normal against geometric normal",
                 "%d of %d samples and evaluations below the surface", below, count);
    assert_int_equal(below, 0);
}

/* A smooth surface whose normals are bent by an angle from the triangle's, and that is seen along
 * these. */
static void prepare_bent(struct model *m, double angle, struct trc_surface *s,
                         struct trc_lobes *l) {
    struct trc_registers regs;
    memset(&regs, 0, sizeof regs);
    point(s, direction(1.0, 0.0), m);
    s->n = direction(cos(angle), 0.3);
    s->smooth = vm_all_set();
    trc_lobes_setup(material_of(m), s, &regs, vf_zero(), l);
    l->below_horizon = s->smooth;
}

/* Integral of what a model gives there over all directions. */
#define BENT_STEPS 256
static double bent_integral(struct model *m, double angle, bool as_sampled) {
    struct trc_surface s;
    struct trc_lobes l;
    prepare_bent(m, angle, &s, &l);
    double sum = 0.0;
    for (int i = 0; i < BENT_STEPS; i++)
        for (int j = 0; j < BENT_STEPS; j++) {
            struct trc_bsdf_value v;
            trc_bsdf_eval(
                &l, &s,
                direction(1.0 - 2.0 * (i + 0.5) / BENT_STEPS, 2 * M_PI * (j + 0.5) / BENT_STEPS),
                vm_all_set(), as_sampled ? vm_all_set() : vm_none(), &v);
            sum += (double)vf_get(v.diffuse.x, 0);
        }
    return sum * 4 * M_PI / ((double)BENT_STEPS * BENT_STEPS);
}
/* Of what is sampled by the cosine to the bent normal, the part on the wrong side of the triangle
 * is lost: (1 - cos) / 2. Light from lights may come from there to what is smooth. */
static void bent_normals_lose_what_is_sampled(void **state) {
    (void)state;
    struct model models[] = {diffuse(0.0f), translucent()};
    double off = 0.0;
    for (int i = 0; i < 2; i++)
        for (double angle = 0.0; angle < 0.75; angle += 0.1) {
            const double lost = 0.5 * (1.0 - cos(angle));
            off = fmax(off, fabs(bent_integral(&models[i], angle, true) - (1.0 - lost)));
            off = fmax(off, fabs(bent_integral(&models[i], angle, false) - 1.0));
        }
    print_figure("matt lobes of bent normals", "integrals off by %.2g", off);
    assert_true(off < 2e-3);
}

/* The mean of sampled directions' weights is the integral of what they count. */
static void bent_normals_are_sampled_as_evaluated(void **state) {
    (void)state;
    struct model m = translucent();
    struct trc_surface s;
    struct trc_lobes l;
    struct histogram h;
    prepare_bent(&m, 0.6, &s, &l);
    draw_samples(&l, &s, EXTREME_SAMPLES, &h);
    const double mean = h.weight / EXTREME_SAMPLES, want = bent_integral(&m, 0.6, true);
    const double deviation =
        sqrt(fmax(h.weight2 / EXTREME_SAMPLES - mean * mean, 0.0) / EXTREME_SAMPLES);
    print_figure("translucency of bent normals", "samples off by %.1f deviations",
                 fabs(mean - want) / deviation);
    assert_true(fabs(mean - want) < 4.0 * deviation);
}

/* Without lobes that end there is nothing to make up for; with them the factor is Cycles' share. */
static void factor_beyond(void **state) {
    (void)state;
    struct model pure = glossy(TRC_DISTRIBUTION_GGX, 0.6f, 0.0f), mixed = principled("");
    struct trc_surface s;
    struct trc_lobes l;
    struct trc_bsdf_sample b;
    prepare(&pure, direction(0.7, 0.0), &s, &l);
    trc_bsdf_sample(&l, &s, vf_set(0.5f), vf_set(0.3f), vf_set(0.4f), &b);
    assert_true(fabsf(vf_get(b.indirect_scale, 0) - 1.0f) < 1e-6f);
    prepare(&mixed, direction(0.7, 0.0), &s, &l);
    trc_bsdf_sample(&l, &s, vf_set(0.5f), vf_set(0.3f), vf_set(0.4f), &b);
    assert_true(vf_get(b.indirect_scale, 0) > 0.0f && vf_get(b.indirect_scale, 0) < 1.0f);
    const double share = (double)vf_get(l.continue_weight / l.mix_weight, 0);
    struct trc_lobes first;
    s.depths = vu_set(0);
    struct trc_registers regs;
    memset(&regs, 0, sizeof regs);
    double at_first[2];
    for (int is_defended = 0; is_defended < 2; is_defended++) {
        mixed.material.flags = is_defended ? TRC_MATERIAL_DEFENSIVE_SAMPLING : 0;
        trc_lobes_setup(material_of(&mixed), &s, &regs, vf_zero(), &first);
        at_first[is_defended] = (double)vf_get(first.continue_weight / first.mix_weight, 0);
    }
    printf("share of the reflection: %.3f, at the first hit %.3f, defended %.3f\n", share,
           at_first[0], at_first[1]);
    assert_true(share < 0.125 && at_first[0] == share && at_first[1] > share);
}

static void light_weights_drop_out(void **state) {
    (void)state;
    struct model m = diffuse(0.0f);
    struct trc_surface s;
    struct trc_lobes l;
    set3(&m, TRC_AT(DIFFUSE, color), 1e-6f, 1e-6f, 1e-6f);
    prepare(&m, direction(0.7, 0.0), &s, &l);
    assert_int_equal(l.count, 0);
    set3(&m, TRC_AT(DIFFUSE, color), -1.0f, NAN, 0.5f);
    prepare(&m, direction(0.7, 0.0), &s, &l);
    for (int i = 0; i < l.count; i++)
        assert_true(isfinite(vf_get(v3_average(l.lobe[i].weight), 0)));
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sampling_matches_density),
        cmocka_unit_test(weights_match_values),
        cmocka_unit_test(lobes_are_reciprocal),
        cmocka_unit_test(values_match_formulas),
        cmocka_unit_test(extremes_stay_finite),
        cmocka_unit_test(nothing_shines_through),
        cmocka_unit_test(bent_normals_lose_what_is_sampled),
        cmocka_unit_test(bent_normals_are_sampled_as_evaluated),
        cmocka_unit_test(factor_beyond),
        cmocka_unit_test(light_weights_drop_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
