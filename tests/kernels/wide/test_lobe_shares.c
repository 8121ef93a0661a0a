/* How lobes share light, beside integrals over micro-normals in double: glass between reflection
 * and transmission, anisotropic gloss between scattering once and more often. */
#include "bsdf_test.h"

/* ---- micro-normals ---- */

/* Of each coordinate; integrals are off by less than 2e-4. */
#define NORMALS 192

/* GGX of a lobe that is seen from o, in its frame. */
struct facets {
    double alpha_x, alpha_y, o[3];
};

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Smith's Lambda: Heitz 2014, equation 72. */
static double lambda(const struct facets *f, const double w[3]) {
    const double x = f->alpha_x * w[0], y = f->alpha_y * w[1];
    return 0.5 * (sqrt(1.0 + (x * x + y * y) / (w[2] * w[2])) - 1.0);
}

/* A micro-normal by D times its cosine, and how many times as often it is seen from o. Slopes go by
 * their sine, as grazing ones weigh in proportion to their tangent. */
static double facet_at(const struct facets *f, int i, int j, double m[3]) {
    const double s = (i + 0.5) / NORMALS, phi = 2.0 * M_PI * (j + 0.5) / NORMALS;
    const double r = sqrt(1.0 - s * s) / s;
    const double x = f->alpha_x * r * cos(phi), y = f->alpha_y * r * sin(phi);
    const double size = sqrt(1.0 + x * x + y * y);
    m[0] = x / size, m[1] = y / size, m[2] = 1.0 / size;
    const double seen = fmax(dot(f->o, m), 0.0);
    return 2.0 * s * seen / (m[2] * f->o[2]) / (1.0 + lambda(f, f->o));
}

/* Fresnel 1823; eta: index beyond over before. */
static double fresnel(double cosine, double eta) {
    const double sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if (sine2 >= 1.0)
        return 1.0;
    const double beyond = sqrt(1.0 - sine2);
    const double s = (cosine - eta * beyond) / (cosine + eta * beyond);
    const double p = (eta * cosine - beyond) / (eta * cosine + beyond);
    return 0.5 * (s * s + p * p);
}

/* The part of what meets a facet that gets away in direction i. */
static double shadowing(const struct facets *f, const double i[3], bool is_correlated) {
    const double before = lambda(f, f->o), after = lambda(f, i);
    return is_correlated ? (1.0 + before) / (1.0 + before + after) : 1.0 / (1.0 + after);
}

/* What a white mirror of facets reflects at once; heights of masking are correlated. */
static double mirror_energy(const struct facets *f) {
    double sum = 0.0;
    for (int i = 0; i < NORMALS; i++)
        for (int j = 0; j < NORMALS; j++) {
            double m[3], w[3];
            const double seen = facet_at(f, i, j, m), c = dot(f->o, m);
            for (int k = 0; k < 3; k++)
                w[k] = 2.0 * c * m[k] - f->o[k];
            if (seen > 0.0 && w[2] > 0.0)
                sum += seen * shadowing(f, w, true);
        }
    return sum / (NORMALS * NORMALS);
}

/* Glass: what is reflected, what is transmitted, how often a facet reflects. */
struct split {
    double reflected, transmitted, chance;
};

/* by_facet: each facet has its own Fresnel factor; else all have that of the normal. tint: how
 * bright refraction is over reflection. */
static struct split glass_split(const struct facets *f, double eta, bool by_facet,
                                bool is_correlated, double tint) {
    struct split s = {0.0, 0.0, 0.0};
    for (int i = 0; i < NORMALS; i++)
        for (int j = 0; j < NORMALS; j++) {
            double m[3], up[3], down[3];
            const double seen = facet_at(f, i, j, m), c = dot(f->o, m);
            if (!(seen > 0.0))
                continue;
            const double reflectance = fresnel(by_facet ? c : f->o[2], eta);
            const double k = 1.0 - (1.0 - c * c) / (eta * eta);
            for (int n = 0; n < 3; n++) {
                up[n] = 2.0 * c * m[n] - f->o[n];
                down[n] = (c / eta - sqrt(fmax(k, 0.0))) * m[n] - f->o[n] / eta;
            }
            if (up[2] > 0.0)
                s.reflected += seen * reflectance * shadowing(f, up, is_correlated);
            if (k > 0.0 && down[2] < 0.0)
                s.transmitted += seen * (1.0 - reflectance) * shadowing(f, down, is_correlated);
            s.chance += seen * reflectance / (reflectance + (1.0 - reflectance) * tint);
        }
    s.reflected /= NORMALS * NORMALS;
    s.transmitted /= NORMALS * NORMALS;
    s.chance /= NORMALS * NORMALS;
    return s;
}

/* ---- samples of lobes ---- */

enum { STARTS = 16, POINTS = 1 << 10, SUMS = 3 };

/* Means of the weight of samples that stay above, of those that go below, and of how many are of
 * lobes that go below; their standard errors by random starts of the sequence of points. */
struct means {
    double mean[SUMS], error[SUMS];
};

static void add_start(const struct trc_lobes *l, const struct trc_surface *s, double at[3],
                      double sums[SUMS]) {
    for (int i = 0; i < POINTS; i += TRC_WIDTH) {
        float u[3][TRC_WIDTH];
        struct trc_bsdf_sample b;
        next_points(at, u);
        trc_bsdf_sample(l, s, vf_load(u[0]), vf_load(u[1]), vf_load(u[2]), &b);
        for (int k = 0; k < TRC_WIDTH; k++) {
            if (vm_bits(b.valid) >> k & 1u)
                sums[vf_get(b.wi.z, k) < 0.0f] += (double)vf_get(b.weight.x, k) / POINTS;
            sums[2] += (vm_bits(b.transmitted) >> k & 1u) / (double)POINTS;
        }
    }
}

static struct means sample_means(struct model *m, vvec3 wo) {
    struct trc_surface s;
    struct trc_lobes l;
    struct rng random = rng_seed(5);
    struct means r = {{0}, {0}};
    prepare(m, wo, &s, &l);
    for (int n = 0; n < STARTS; n++) {
        double at[3], sums[SUMS] = {0};
        for (int d = 0; d < 3; d++)
            at[d] = (double)rng_unit(&random);
        add_start(&l, &s, at, sums);
        for (int k = 0; k < SUMS; k++) {
            r.mean[k] += sums[k] / STARTS;
            r.error[k] += sums[k] * sums[k] / STARTS;
        }
    }
    for (int k = 0; k < SUMS; k++)
        r.error[k] = sqrt(fmax(r.error[k] - r.mean[k] * r.mean[k], 0.0) / (STARTS - 1));
    return r;
}

static int failures;

/* Five standard errors and what the integral, or a table where one is read, is off by. */
static void expect(const char *what, const char *name, double found, double error, double want,
                   double table) {
    const double allowed = 5.0 * error + 2e-4 + table;
    assert_true(allowed < 0.02);
    if (fabs(found - want) <= allowed)
        return;
    failures++;
    printf("  %s, %s: %.4f +- %.4f, not %.4f\n", name, what, found, error, want);
}

/* ---- glass ---- */

static void glass_splits_by_fresnel(void **state) {
    (void)state;
    static const struct {
        const char *name;
        uint32_t mode;
        bool by_facet, is_correlated;
        double table; /* of what is kept, off by so much: ggx_energy.h */
    } kinds[] = {
        {"GGX", TRC_DISTRIBUTION_GGX, false, false, 0.0},
        {"multiple GGX", TRC_DISTRIBUTION_MULTI_GGX, true, false, 0.0025},
        {"correlated", TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_CORRELATED, true, true, 0.0},
        {"correlated multiple", TRC_DISTRIBUTION_MULTI_GGX | TRC_DISTRIBUTION_CORRELATED, true,
         true, 0.0025},
    };
    failures = 0;
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        for (int k = 0; k < 12; k++) {
            const float roughness = k % 2 ? 0.75f : 0.4f;
            const bool back = k / 2 % 2;
            const double cosine = k / 4 == 0 ? 0.95 : k / 4 == 1 ? 0.6 : 0.25;
            const double alpha = (double)roughness * (double)roughness;
            const struct facets f = {alpha, alpha, {sqrt(1.0 - cosine * cosine), 0.0, cosine}};
            const double eta = back ? 1.0 / 1.5 : 1.5;
            const struct split want =
                glass_split(&f, eta, kinds[i].by_facet, kinds[i].is_correlated, 1.0);
            /* All that is lost otherwise is put back in proportion. */
            const bool is_multi = kinds[i].mode & TRC_DISTRIBUTION_MULTI_GGX;
            const double gain = is_multi ? 1.0 / (want.reflected + want.transmitted) : 1.0;
            struct model m = glass(kinds[i].mode, roughness, 1.5f, back);
            const struct means found = sample_means(&m, wide(f.o[0], f.o[1], f.o[2]));
            char name[80];
            snprintf(name, sizeof name, "%s, roughness %.2f, cos %.2f, %s", kinds[i].name,
                     (double)roughness, cosine, back ? "inside" : "outside");
            expect("reflected", name, found.mean[0], found.error[0], want.reflected * gain,
                   kinds[i].table);
            expect("transmitted", name, found.mean[1], found.error[1], want.transmitted * gain,
                   kinds[i].table);
            expect("rays sent below", name, found.mean[2], found.error[2], 1.0 - want.chance, 0.0);
        }
    assert_int_equal(failures, 0);
}

/* Where refraction is darker than reflection, rays are sent as bright as they come back: the root
 * of the colour at each of two surfaces. */
static void tinted_glass_splits_by_brightness(void **state) {
    (void)state;
    static const double tints[] = {0.1, 0.5};
    failures = 0;
    for (int k = 0; k < 8; k++) {
        const bool back = k % 2;
        const double tint = tints[k / 2 % 2], cosine = k < 4 ? 0.9 : 0.35;
        const struct facets f = {0.36, 0.36, {sqrt(1.0 - cosine * cosine), 0.0, cosine}};
        const struct split want = glass_split(&f, back ? 1.0 / 1.5 : 1.5, true, true, tint);
        struct model m = layered_glass(TRC_DISTRIBUTION_GGX, 0.6f, back);
        const float color = (float)(tint * tint);
        set3(&m, TRC_AT(LAYERED_PRINCIPLED, base_color), color, color, color);
        const struct means found = sample_means(&m, wide(f.o[0], f.o[1], f.o[2]));
        char name[80];
        snprintf(name, sizeof name, "tint %.1f, cos %.2f, %s", tint, cosine,
                 back ? "inside" : "outside");
        expect("reflected", name, found.mean[0], found.error[0], want.reflected, 0.0);
        expect("transmitted", name, found.mean[1], found.error[1], tint * want.transmitted, 0.0);
        expect("rays sent below", name, found.mean[2], found.error[2], 1.0 - want.chance, 0.0);
    }
    assert_int_equal(failures, 0);
}

/* ---- anisotropic gloss ---- */

/* Energy of white gloss. As Cycles' random walk, the older model keeps all of it. The newer one has
 * what its isotropic surface of the same alpha_x alpha_y would need: it is scaled by what that
 * keeps (Turquin 2019), as in Cycles 4, where an anisotropic one then loses some. */
static void anisotropy_keeps_energy(void **state) {
    (void)state;
    static const uint32_t modes[] = {TRC_DISTRIBUTION_MULTI_GGX,
                                     TRC_DISTRIBUTION_MULTI_GGX | TRC_DISTRIBUTION_CORRELATED};
    static const float anisotropies[] = {0.5f, -0.5f, 0.8f};
    static const double cosines[] = {0.9, 0.5, 0.25};
    failures = 0;
    for (int k = 0; k < 18; k++) {
        const int kind = k % 2;
        const float roughness = k < 9 ? 0.7f : 0.5f, anisotropy = anisotropies[k / 2 % 3];
        const double cosine = cosines[k / 6], alpha = (double)roughness * (double)roughness;
        const double less = 1.0 - fabs((double)anisotropy);
        const double x = anisotropy < 0.0f ? alpha / less : alpha * less;
        const double y = anisotropy < 0.0f ? alpha * less : alpha / less;
        /* The tangent of the model is turned by a tenth of a turn. */
        const double sine = sqrt(1.0 - cosine * cosine), phi = 1.1, across = phi - 0.2 * M_PI;
        const struct facets f = {
            fmin(x, 1.0), fmin(y, 1.0), {sine * cos(across), sine * sin(across), cosine}};
        const double mean = sqrt(f.alpha_x * f.alpha_y);
        const struct facets even = {mean, mean, {sine, 0.0, cosine}};
        const double once = mirror_energy(&f), kept = mirror_energy(&even);
        const double want = kind ? once / kept : 1.0;
        struct model m = glossy(modes[kind], roughness, anisotropy);
        const struct means found = sample_means(&m, direction(cosine, phi));
        char name[80];
        snprintf(name, sizeof name, "%s, roughness %.2f, anisotropy %.1f, cos %.2f",
                 kind ? "Cycles 4" : "Cycles 3", (double)roughness, (double)anisotropy, cosine);
        printf("  %s: %.4f +- %.4f, %.4f expected\n", name, found.mean[0], found.error[0], want);
        /* Of the table of isotropic surfaces, and of the integral: ggx_energy.h. */
        expect("energy", name, found.mean[0], found.error[0], want, kind ? 0.001 : 0.012);
    }
    assert_int_equal(failures, 0);
}

/* ---- coats ---- */

/* Blender 5: what a coat sends back and what it leaves for white below is all the light. The tables
 * of both are off by up to .003. */
static void whole_coats_keep_energy(void **state) {
    (void)state;
    static const double cosines[] = {0.9, 0.5, 0.25};
    failures = 0;
    for (int k = 0; k < 12; k++) {
        const float roughness = k % 2 ? 0.8f : 0.5f, ior = k / 2 % 2 ? 2.0f : 1.3f;
        struct model m = layered("whole coat", TRC_DISTRIBUTION_WHOLE_COAT, 0.5f);
        set3(&m, TRC_AT(LAYERED_PRINCIPLED, base_color), 1.0f, 1.0f, 1.0f);
        set(&m, TRC_AT(LAYERED_PRINCIPLED, specular_ior_level), 0.0f);
        set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_weight), 1.0f);
        set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_roughness), roughness);
        set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_ior), ior);
        const struct means found = sample_means(&m, direction(cosines[k / 4], 0.3));
        char name[80];
        snprintf(name, sizeof name, "roughness %.1f, ior %.1f, cos %.2f", (double)roughness,
                 (double)ior, cosines[k / 4]);
        printf("  %s: %.4f +- %.4f\n", name, found.mean[0], found.error[0]);
        expect("energy", name, found.mean[0], found.error[0], 1.0, 0.003);
    }
    assert_int_equal(failures, 0);
}

/* ---- thin walls ---- */

/* However rough, both sides get what the two surfaces of a sheet send there after any number of
 * bounces between them; glass that is smooth is transparent but to the camera. */
static void thin_walls_sum_bounces(void **state) {
    (void)state;
    static const double cosines[] = {0.95, 0.5, 0.2};
    failures = 0;
    for (int k = 0; k < 18; k++) {
        const float roughness = k % 3 == 0 ? 0.0f : k % 3 == 1 ? 0.4f : 0.8f;
        const double cosine = cosines[k / 6], tint = k / 3 % 2 ? 0.6 : 1.0;
        const double beyond = sqrt(1.0 - (1.0 - cosine * cosine) / (1.5 * 1.5));
        const double f = fresnel(cosine, 1.5), way = pow(tint, 1.0 / beyond);
        double reflected = f, transmitted = 0.0, inside = 1.0 - f;
        for (int bounce = 0; bounce < 40; bounce++) {
            inside *= way;
            *(bounce % 2 ? &reflected : &transmitted) += inside * (1.0 - f);
            inside *= f;
        }
        struct model m = thin_wall(roughness);
        set3(&m, TRC_AT(LAYERED_PRINCIPLED, base_color), (float)tint, 1.0f, 1.0f);
        const struct means found = sample_means(&m, direction(cosine, 0.3));
        char name[80];
        snprintf(name, sizeof name, "roughness %.1f, tint %.1f, cos %.2f", (double)roughness, tint,
                 cosine);
        printf("  %s: %.4f and %.4f\n", name, found.mean[0], found.mean[1]);
        /* What facets keep is of a table (ggx_energy.h). */
        expect("reflected", name, found.mean[0], found.error[0], reflected, 0.003);
        expect("transmitted", name, found.mean[1], found.error[1], transmitted, 0.003);
    }
    assert_int_equal(failures, 0);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(glass_splits_by_fresnel),
        cmocka_unit_test(tinted_glass_splits_by_brightness),
        cmocka_unit_test(anisotropy_keeps_energy),
        cmocka_unit_test(whole_coats_keep_energy),
        cmocka_unit_test(thin_walls_sum_bounces),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
