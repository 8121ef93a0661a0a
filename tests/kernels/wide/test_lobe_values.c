/* Values of lobes beside their formulas in double, written down anew from the papers and from what
 * Cycles 3.4 computes; and what a sampled ray carries of what is behind the next surface. */
#include "bsdf_test.h"

/* ---- vectors in double ---- */

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static void make_unit(double a[3]) {
    const double size = sqrt(dot(a, a));
    for (int k = 0; k < 3; k++)
        a[k] /= size;
}
static vvec3 wide_of(const double a[3]) { return wide(a[0], a[1], a[2]); }

/* A direction whose cosine is between two numbers. */
static void draw(struct rng *random, double low, double high, double out[3]) {
    const double c = low + (high - low) * (double)rng_unit(random);
    const double phi = 2.0 * M_PI * (double)rng_unit(random), s = sqrt(1.0 - c * c);
    out[0] = s * cos(phi);
    out[1] = s * sin(phi);
    out[2] = c;
}

/* ---- formulas; o and i in the lobe's frame, the cosine of i included ---- */

typedef double formula(const double o[3], const double i[3]);

/* Numbers of the models below. */
#define SIGMA 0.7
#define ROUGHNESS 0.6
#define ALPHA (ROUGHNESS * ROUGHNESS)
#define ANISOTROPY 0.4
#define ALPHA_X (ALPHA * (1.0 - ANISOTROPY))
#define ALPHA_Y (ALPHA / (1.0 - ANISOTROPY))
#define INDEX 1.4
#define TOON_SIZE 0.5
#define TOON_FADE 0.3

static double lambert(const double o[3], const double i[3]) {
    (void)o;
    return i[2] / M_PI;
}
static double translucent_below(const double o[3], const double i[3]) {
    (void)o;
    return -i[2] / M_PI;
}

/* Y. Fujii's form of Oren and Nayar (1994). */
static double oren_nayar(const double o[3], const double i[3]) {
    const double a = 1.0 / (M_PI + (3.0 * M_PI - 4.0) / 6.0 * SIGMA), b = SIGMA * a;
    const double s = dot(o, i) - o[2] * i[2];
    return i[2] * (a + b * (s > 0.0 ? s / fmax(o[2], i[2]) : s));
}

static double schlick(double cosine) { return pow(1.0 - cosine, 5.0); }

/* B. Burley, "Extending the Disney BRDF to a BSDF with Integrated Subsurface Scattering" (2015),
 * equation 4 and the one after it. */
static double burley(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double cos_d = dot(h, i), fi = schlick(i[2]), fo = schlick(o[2]);
    const double rr = 2.0 * ROUGHNESS * cos_d * cos_d;
    return i[2] / M_PI *
           ((1.0 - 0.5 * fi) * (1.0 - 0.5 * fo) + rr * (fi + fo + fi * fo * (rr - 1.0)));
}

/* M. Ashikhmin, S. Premoze and P. Shirley (2000) as in Cycles: the distribution of slopes upside
 * down, and V-cavities. */
static double velvet_of_sigma(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double sine2 = 1.0 - h[2] * h[2], cotangent2 = h[2] * h[2] / sine2;
    const double d = exp(-cotangent2 / (SIGMA * SIGMA)) / (SIGMA * SIGMA * M_PI * sine2 * sine2);
    const double valley = 2.0 * h[2] / fabs(dot(o, h));
    const double g = fmin(1.0, fmin(valley * o[2], valley * i[2]));
    return 0.25 * d * g / o[2];
}

static double toon_about(double cosine) {
    const double angle = acos(fmin(cosine, 1.0)), size = TOON_SIZE * M_PI / 2.0;
    const double fade = TOON_FADE * M_PI / 2.0, all = fmin(size + fade, M_PI / 2.0);
    const double light = angle < size ? 1.0 : fmax(1.0 - (angle - size) / fade, 0.0);
    return light / (2.0 * M_PI * (1.0 - cos(all)));
}
static double diffuse_toon(const double o[3], const double i[3]) {
    (void)o;
    return toon_about(i[2]);
}
static double glossy_toon(const double o[3], const double i[3]) {
    const double mirrored[3] = {-o[0], -o[1], o[2]};
    return toon_about(dot(mirrored, i));
}

/* tan(theta)^2 times the square of the roughness towards w. */
static double rough_tan2(double x, double y, const double w[3]) {
    return (x * x * w[0] * w[0] + y * y * w[1] * w[1]) / (w[2] * w[2]);
}
static double ggx_d(double x, double y, const double m[3]) {
    const double e = m[0] * m[0] / (x * x) + m[1] * m[1] / (y * y) + m[2] * m[2];
    return 1.0 / (M_PI * x * y * e * e);
}
static double ggx_lambda(double x, double y, const double w[3]) {
    return 0.5 * (sqrt(1.0 + rough_tan2(x, y, w)) - 1.0);
}
/* Height-correlated or each on its own: E. Heitz (2014), equations 98 and 99. */
static double ggx(double x, double y, bool is_correlated, const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double lo = ggx_lambda(x, y, o), li = ggx_lambda(x, y, i);
    const double g = is_correlated ? 1.0 / (1.0 + lo + li) : 1.0 / ((1.0 + lo) * (1.0 + li));
    return ggx_d(x, y, h) * g / (4.0 * o[2]);
}
static double even_ggx(const double o[3], const double i[3]) {
    return ggx(ALPHA, ALPHA, false, o, i);
}
static double brushed_ggx(const double o[3], const double i[3]) {
    return ggx(ALPHA_X, ALPHA_Y, false, o, i);
}
static double correlated_ggx(const double o[3], const double i[3]) {
    return ggx(ALPHA_X, ALPHA_Y, true, o, i);
}

/* B. Walter et al. (2007), equations 25 and 27. */
static double beckmann_g1(double tan2) {
    const double a = 1.0 / sqrt(tan2);
    return a >= 1.6 ? 1.0 : (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a);
}
static double brushed_beckmann(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double e =
        (h[0] * h[0] / (ALPHA_X * ALPHA_X) + h[1] * h[1] / (ALPHA_Y * ALPHA_Y)) / (h[2] * h[2]);
    const double d = exp(-e) / (M_PI * ALPHA_X * ALPHA_Y * pow(h[2], 4.0));
    return d * beckmann_g1(rough_tan2(ALPHA_X, ALPHA_Y, o)) *
           beckmann_g1(rough_tan2(ALPHA_X, ALPHA_Y, i)) / (4.0 * o[2]);
}

/* M. Ashikhmin and P. Shirley (2000), equation 4, with exponents 2 / alpha^2 - 2 and F of 1. */
static double ashikhmin(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double nx = 2.0 / (ALPHA_X * ALPHA_X) - 2.0, ny = 2.0 / (ALPHA_Y * ALPHA_Y) - 2.0;
    const double exponent = (nx * h[0] * h[0] + ny * h[1] * h[1]) / (1.0 - h[2] * h[2]);
    return sqrt((nx + 1.0) * (ny + 1.0)) / (8.0 * M_PI) * pow(h[2], exponent) * i[2] /
           (dot(h, i) * fmax(o[2], i[2]));
}

static double fresnel(double cosine, double eta) {
    const double beyond = sqrt(1.0 - (1.0 - cosine * cosine) / (eta * eta));
    const double s = (cosine - eta * beyond) / (cosine + eta * beyond);
    const double p = (eta * cosine - beyond) / (eta * cosine + beyond);
    return 0.5 * (s * s + p * p);
}

/* Clearcoat of 1: a quarter of GTR1 with F from 0.04 to 1, masked as GGX of 0.25. */
static double coat(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    const double a2 = ALPHA * ALPHA;
    const double d = (a2 - 1.0) / (M_PI * log(a2) * (1.0 + (a2 - 1.0) * h[2] * h[2]));
    const double g = 1.0 / ((1.0 + ggx_lambda(0.25, 0.25, o)) * (1.0 + ggx_lambda(0.25, 0.25, i)));
    const double blend = (fresnel(dot(h, i), 1.5) - 0.04) / (1.0 - 0.04);
    return 0.25 * (0.04 + 0.96 * blend) * d * g / (4.0 * o[2]);
}

/* The node's defaults: a reflectance of 0.04 at the normal, an index of 1.5. */
static double dielectric(const double o[3], const double i[3]) {
    double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
    make_unit(h);
    return fresnel(dot(h, i), 1.5) * ggx(ALPHA, ALPHA, false, o, i);
}

/* Walter et al. (2007), equation 21 without F; seen from a medium of index 1. */
static double refracted(double eta, const double o[3], const double i[3]) {
    double h[3];
    for (int k = 0; k < 3; k++)
        h[k] = o[k] + eta * i[k];
    make_unit(h);
    const double side = h[2] < 0.0 ? -1.0 : 1.0;
    for (int k = 0; k < 3; k++)
        h[k] *= side;
    const double oh = dot(o, h), ih = dot(i, h);
    if (oh <= 0.0 || ih >= 0.0)
        return 0.0;
    const double g =
        1.0 / ((1.0 + ggx_lambda(ALPHA, ALPHA, o)) * (1.0 + ggx_lambda(ALPHA, ALPHA, i)));
    const double sum = oh + eta * ih;
    return fabs(oh * ih) * eta * eta * g * ggx_d(ALPHA, ALPHA, h) / (o[2] * sum * sum);
}
static double refracted_in(const double o[3], const double i[3]) { return refracted(INDEX, o, i); }
static double refracted_out(const double o[3], const double i[3]) {
    return refracted(1.0 / INDEX, o, i);
}

/* ---- values ---- */

static struct model brushed(uint32_t mode) {
    struct model m = glossy(mode, (float)ROUGHNESS, (float)ANISOTROPY);
    set(&m, TRC_AT(GLOSSY, rotation), 0.0f); /* the tangent is x */
    return m;
}
static struct model velvet(void) {
    struct model m = diffuse((float)SIGMA);
    m.material.leaves[0].type = TRC_NODE_VELVET;
    m.name = "velvet";
    return m;
}
static struct model burley_of(double roughness) {
    struct model m = principled("Burley");
    set3(&m, TRC_AT(PRINCIPLED, base_color), 1, 1, 1);
    set(&m, TRC_AT(PRINCIPLED, specular), 0.0f);
    set(&m, TRC_AT(PRINCIPLED, roughness), (float)roughness);
    return m;
}
static struct model dielectric_of(void) {
    struct model m = principled("dielectric");
    set3(&m, TRC_AT(PRINCIPLED, base_color), 0, 0, 0);
    set(&m, TRC_AT(PRINCIPLED, roughness), (float)ROUGHNESS);
    return m;
}
static struct model refraction_of(bool back) {
    struct model m = refraction(TRC_DISTRIBUTION_GGX, (float)ROUGHNESS, (float)INDEX);
    m.back = back;
    return m;
}

enum part { DIFFUSE, GLOSSY, TRANSMISSION };

static double part_of(const struct trc_bsdf_value *v, enum part part) {
    const vvec3 *parts[] = {&v->diffuse, &v->glossy, &v->transmission};
    return (double)vf_get(parts[part]->x, 0);
}

static void values_match_formulas(void **state) {
    (void)state;
    const struct {
        struct model model;
        formula *formula;
        enum part part;
        bool is_below;
    } cases[] = {
        {diffuse(0.0f), lambert, DIFFUSE, false},
        {translucent(), translucent_below, DIFFUSE, true},
        {diffuse((float)SIGMA), oren_nayar, DIFFUSE, false},
        {burley_of(ROUGHNESS), burley, DIFFUSE, false},
        {velvet(), velvet_of_sigma, GLOSSY, false},
        {toon(0, (float)TOON_SIZE, (float)TOON_FADE), diffuse_toon, DIFFUSE, false},
        {toon(1, (float)TOON_SIZE, (float)TOON_FADE), glossy_toon, GLOSSY, false},
        {glossy(TRC_DISTRIBUTION_GGX, (float)ROUGHNESS, 0.0f), even_ggx, GLOSSY, false},
        {brushed(TRC_DISTRIBUTION_GGX), brushed_ggx, GLOSSY, false},
        {brushed(TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_CORRELATED), correlated_ggx, GLOSSY,
         false},
        {brushed(TRC_DISTRIBUTION_BECKMANN), brushed_beckmann, GLOSSY, false},
        {brushed(TRC_DISTRIBUTION_ASHIKHMIN), ashikhmin, GLOSSY, false},
        {clearcoat((float)ROUGHNESS), coat, GLOSSY, false},
        {dielectric_of(), dielectric, GLOSSY, false},
        {refraction_of(false), refracted_in, TRANSMISSION, true},
        {refraction_of(true), refracted_out, TRANSMISSION, true},
    };
    for (size_t n = 0; n < sizeof cases / sizeof *cases; n++) {
        struct rng random = rng_seed(n);
        struct model m = cases[n].model;
        double worst = 0.0, brightest = 0.0;
        for (int k = 0; k < 400; k++) {
            double o[3], i[3];
            struct trc_surface s;
            struct trc_lobes l;
            struct trc_bsdf_value v;
            draw(&random, 0.05, 1.0, o);
            draw(&random, cases[n].is_below ? -1.0 : 0.05, cases[n].is_below ? -0.05 : 1.0, i);
            prepare(&m, wide_of(o), &s, &l);
            trc_bsdf_eval(&l, &s, wide_of(i), vm_all_set(), vm_none(), &v);
            const double want = cases[n].formula(o, i), found = part_of(&v, cases[n].part);
            /* Single precision through some tens of operations; below 0.01, beside that. */
            worst = fmax(worst, fabs(found - want) / (want + 1e-2));
            brightest = fmax(brightest, want);
        }
        printf("  %-12s off by %.1e, values to %.3g\n", m.name, worst, brightest);
        assert_true(brightest > 0.05);
        assert_true(worst <= 2e-5);
    }
}

/* M. J.-Y. Chiang, Y. K. Li and B. Burley (2019): light on a normal that was bent. */
static void bent_normals_fade_at_the_terminator(void **state) {
    (void)state;
    struct rng random = rng_seed(31);
    int faded = 0;
    for (int k = 0; k < 2000; k++) {
        double o[3], i[3], n[3];
        draw(&random, 0.3, 1.0, o);
        draw(&random, 0.02, 1.0, i);
        draw(&random, 0.5, 1.0, n);
        /* Normals whose mirror direction is below the surface are bent back, and not these. */
        const double c = dot(n, o);
        if (dot(n, i) < 0.02 || c < 0.05 || 2.0 * c * n[2] - o[2] < 0.02)
            continue;
        struct model m = diffuse(0.0f);
        set3(&m, TRC_AT(DIFFUSE, normal), (float)n[0], (float)n[1], (float)n[2]);
        struct trc_surface s;
        struct trc_lobes l;
        struct trc_bsdf_value v;
        prepare(&m, wide_of(o), &s, &l);
        trc_bsdf_eval(&l, &s, wide_of(i), vm_all_set(), vm_none(), &v);
        const double g = i[2] / (dot(n, i) * n[2]);
        const double fade = g >= 1.0 ? 1.0 : g + g * g - g * g * g;
        const double want = dot(n, i) / M_PI * fade;
        faded += fade < 0.9;
        assert_true(fabs((double)vf_get(v.diffuse.x, 0) - want) <= 1e-5);
    }
    assert_true(faded > 100);
}

/* ---- beyond ---- */

/* Cycles picks a lobe, the diffuse one too, and weighs it with the densities of all of them: with
 * those of diffuse lobes ended, what is behind the next surface has the share of the others. The
 * chances are the lobes' own (their weights and albedos: test_shaders.py has them beside Cycles).
 */
static void rays_carry_the_share_of_continued_lobes(void **state) {
    (void)state;
    struct model m = principled("Principled");
    struct rng random = rng_seed(33);
    set(&m, TRC_AT(PRINCIPLED, roughness), (float)ROUGHNESS);
    double lowest = 1.0, highest = 0.0;
    for (int k = 0; k < 400; k++) {
        double o[3];
        struct trc_surface s;
        struct trc_lobes l;
        struct trc_bsdf_sample b;
        draw(&random, 0.1, 1.0, o);
        prepare(&m, wide_of(o), &s, &l);
        assert_int_equal(l.count, 2);
        trc_bsdf_sample(&l, &s, vf_set(0.5f), vf_set(rng_unit(&random)), vf_set(rng_unit(&random)),
                        &b);
        if (!(vm_bits(b.valid) & 1u))
            continue;
        const double i[3] = {(double)vf_get(b.wi.x, 0), (double)vf_get(b.wi.y, 0),
                             (double)vf_get(b.wi.z, 0)};
        double h[3] = {o[0] + i[0], o[1] + i[1], o[2] + i[2]};
        make_unit(h);
        const double gloss = ggx_d(ALPHA, ALPHA, h) / (1.0 + ggx_lambda(ALPHA, ALPHA, o)) /
                             (4.0 * o[2]) * (double)vf_get(l.lobe[1].mix_weight, 0);
        const double matt = i[2] / M_PI * (double)vf_get(l.lobe[0].mix_weight, 0);
        const double want = gloss / (gloss + matt);
        assert_true(fabs((double)vf_get(b.indirect_scale, 0) - want) <= 1e-4);
        lowest = fmin(lowest, want);
        highest = fmax(highest, want);
    }
    assert_true(lowest < 0.05 && highest > 0.2);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_match_formulas),
        cmocka_unit_test(bent_normals_fade_at_the_terminator),
        cmocka_unit_test(rays_carry_the_share_of_continued_lobes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
