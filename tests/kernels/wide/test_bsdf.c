/* Lobes: sampling against its density, energy, reciprocity, agreement of evaluating and sampling,
 * and values against formulas in double. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "figures.h"
#include "kernels/bsdf.h"
#include "kernels/wide_math.h"
#include "shading/build.h"
#include "wide_test.h"

#define OPERANDS 40

/* ---- materials of one leaf ---- */

struct model {
    const char *name;
    struct trc_material material;
    struct trc_operand operands[OPERANDS];
    bool back; /* seen from the back */
};

static struct trc_operand constant(float value) { return (struct trc_operand){-1, value}; }

static void begin(struct model *m, const char *name, uint32_t type, uint32_t mode, uint32_t count) {
    memset(m, 0, sizeof *m);
    m->name = name;
    m->material.leaf_count = 1;
    m->material.leaves[0] = (struct trc_leaf){type, mode, {-1, 1.0f}, 0, count};
    for (uint32_t i = 0; i < OPERANDS; i++)
        m->operands[i] = constant(0.0f);
}
static void set(struct model *m, uint32_t at, float a) { m->operands[at] = constant(a); }
static void set3(struct model *m, uint32_t at, float a, float b, float c) {
    set(m, at, a);
    set(m, at + 1, b);
    set(m, at + 2, c);
}
static void unlink_vector(struct model *m, uint32_t at) {
    for (uint32_t i = 0; i < 3; i++)
        m->operands[at + i] = (struct trc_operand){-2, 0.0f};
}
/* The material points into the model: after the model has its final place. */
static const struct trc_material *material_of(struct model *m) {
    m->material.operands = m->operands;
    m->material.operand_count = OPERANDS;
    return &m->material;
}

static struct model diffuse(float roughness) {
    struct model m;
    begin(&m, roughness > 0 ? "Oren-Nayar" : "Lambert", TRC_NODE_DIFFUSE, 0, 7);
    set3(&m, 0, 1, 1, 1);
    set(&m, 3, roughness);
    unlink_vector(&m, 4);
    return m;
}
static struct model translucent(void) {
    struct model m;
    begin(&m, "translucent", TRC_NODE_TRANSLUCENT, 0, 6);
    set3(&m, 0, 1, 1, 1);
    unlink_vector(&m, 3);
    return m;
}
static struct model glossy(uint32_t mode, float roughness, float anisotropy) {
    struct model m;
    begin(&m, "glossy", TRC_NODE_GLOSSY, mode, 12);
    set3(&m, 0, 1, 1, 1);
    set(&m, 3, roughness);
    set(&m, 4, anisotropy);
    set(&m, 5, 0.1f);
    unlink_vector(&m, 6);
    set3(&m, 9, 1, 0, 0);
    return m;
}
static struct model glass(uint32_t mode, float roughness, float ior, bool back) {
    struct model m;
    begin(&m, "glass", TRC_NODE_GLASS, mode, 8);
    set3(&m, 0, 1, 1, 1);
    set(&m, 3, roughness);
    set(&m, 4, ior);
    unlink_vector(&m, 5);
    m.back = back;
    return m;
}
static struct model refraction(uint32_t mode, float roughness, float ior) {
    struct model m = glass(mode, roughness, ior, false);
    m.material.leaves[0].type = TRC_NODE_REFRACTION;
    m.name = "refraction";
    return m;
}
/* Defaults of the node. */
static struct model principled(const char *name) {
    struct model m;
    begin(&m, name, TRC_NODE_PRINCIPLED, TRC_DISTRIBUTION_GGX, 34);
    set3(&m, 0, 0.8f, 0.8f, 0.8f);
    set(&m, 8, 0.5f);
    set(&m, 10, 0.5f);
    set(&m, 14, 0.5f);
    set(&m, 16, 0.03f);
    set(&m, 17, 1.45f);
    set(&m, 23, 1.0f);
    set(&m, 24, 1.0f);
    unlink_vector(&m, 25);
    unlink_vector(&m, 28);
    set3(&m, 31, 1, 0, 0);
    return m;
}
static struct model principled_metal(uint32_t mode, float roughness) {
    struct model m = principled("Principled metal");
    m.material.leaves[0].mode = mode;
    set3(&m, 0, 1, 1, 1);
    set(&m, 7, 1.0f);
    set(&m, 10, roughness);
    set(&m, 11, 0.6f);
    return m;
}
static struct model principled_glass(uint32_t mode, float roughness, bool back) {
    struct model m = principled("Principled glass");
    m.material.leaves[0].mode = mode;
    set3(&m, 0, 1, 1, 1);
    set(&m, 10, roughness);
    set(&m, 18, 1.0f);
    set(&m, 19, 0.2f);
    m.back = back;
    return m;
}
static struct model principled_all(void) {
    struct model m = principled("Principled, everything");
    set3(&m, 0, 0.8f, 0.5f, 0.3f);
    set(&m, 3, 0.2f);
    set3(&m, 4, 0.9f, 0.3f, 0.2f);
    set(&m, 7, 0.3f);
    set(&m, 9, 0.4f);
    set(&m, 11, 0.5f);
    set(&m, 13, 0.7f);
    set(&m, 15, 0.8f);
    set(&m, 16, 0.3f);
    set(&m, 18, 0.4f);
    return m;
}
/* Principled of Blender 4 with every layer, or white metal, or white glass. */
static struct model layered(const char *name, uint32_t mode, float roughness) {
    struct model m;
    begin(&m, name, TRC_NODE_LAYERED_PRINCIPLED, mode, 39);
    set3(&m, 0, 1, 1, 1);
    set(&m, TRC_LAYERED_ROUGHNESS, roughness);
    set(&m, TRC_LAYERED_IOR, 1.5f);
    set(&m, TRC_LAYERED_ALPHA, 1.0f);
    unlink_vector(&m, TRC_LAYERED_NORMAL);
    set(&m, TRC_LAYERED_SPECULAR_LEVEL, 0.5f);
    set3(&m, TRC_LAYERED_SPECULAR_TINT, 1, 1, 1);
    set3(&m, TRC_LAYERED_TANGENT, 1, 0, 0);
    set(&m, TRC_LAYERED_COAT_ROUGHNESS, 0.3f);
    set(&m, TRC_LAYERED_COAT_IOR, 1.5f);
    set3(&m, TRC_LAYERED_COAT_TINT, 1, 1, 1);
    unlink_vector(&m, TRC_LAYERED_COAT_NORMAL);
    set(&m, TRC_LAYERED_SHEEN_ROUGHNESS, 0.5f);
    set3(&m, TRC_LAYERED_SHEEN_TINT, 1, 1, 1);
    return m;
}
static struct model layered_metal(uint32_t mode, float roughness) {
    struct model m = layered("layered metal", mode, roughness);
    set(&m, TRC_LAYERED_METALLIC, 1.0f);
    return m;
}
static struct model layered_glass(uint32_t mode, float roughness, bool back) {
    struct model m = layered("layered glass", mode, roughness);
    set(&m, TRC_LAYERED_TRANSMISSION, 1.0f);
    m.back = back;
    return m;
}
static struct model layered_all(void) {
    struct model m = layered("all layers", TRC_DISTRIBUTION_MULTI_GGX, 0.6f);
    set(&m, TRC_LAYERED_METALLIC, 0.3f);
    set(&m, TRC_LAYERED_TRANSMISSION, 0.4f);
    set(&m, TRC_LAYERED_COAT, 0.7f);
    set(&m, TRC_LAYERED_SHEEN, 0.8f);
    set(&m, TRC_LAYERED_DIFFUSE_ROUGHNESS, 0.5f);
    set(&m, TRC_LAYERED_ANISOTROPY, 0.4f);
    set3(&m, TRC_LAYERED_COAT_TINT, 0.9f, 0.5f, 0.7f);
    return m;
}

static struct model toon(uint32_t mode, float size, float smooth) {
    struct model m;
    begin(&m, mode ? "glossy toon" : "toon", TRC_NODE_TOON, mode, 8);
    set3(&m, 0, 1, 1, 1);
    set(&m, 3, size);
    set(&m, 4, smooth);
    unlink_vector(&m, 5);
    return m;
}
static struct model clearcoat(float roughness) {
    struct model m = principled("clearcoat");
    set3(&m, 0, 0, 0, 0);
    set(&m, 8, 0.0f);
    set(&m, 15, 1.0f);
    set(&m, 16, roughness);
    return m;
}

/* ---- a shading point ---- */

static vvec3 wide(double x, double y, double z) {
    return v3(vf_set((float)x), vf_set((float)y), vf_set((float)z));
}

static void point(struct trc_surface *s, vvec3 wo, const struct model *m) {
    memset(s, 0, sizeof *s);
    s->active = vm_all_set();
    s->instance = vi_set(-1);
    s->ng = s->n = wide(0, 0, 1);
    s->wo = wo;
    s->backfacing = m->back ? vm_all_set() : vm_none();
    s->depth = vi_set(1);
}
static void prepare(struct model *m, vvec3 wo, struct trc_surface *s, struct trc_lobes *l) {
    struct trc_registers regs;
    memset(&regs, 0, sizeof regs);
    point(s, wo, m);
    TRC_KERNEL(trc_lobes_setup)(material_of(m), s, &regs, vf_zero(), l);
}
static vvec3 direction(double cos_theta, double phi) {
    const double r = sqrt(fmax(0.0, 1.0 - cos_theta * cos_theta));
    return wide(r * cos(phi), r * sin(phi), cos_theta);
}

/* ---- sampling against density ---- */

#define ROWS 16
#define COLUMNS 24
#define FINE 32
#define SAMPLES (1 << 19)
#define EXTREME_SAMPLES (1 << 16)

struct histogram {
    double count[ROWS][COLUMNS], lost;
    double weight, weight2;
};

/* Cell of a direction: rows of equal cos(theta) over the sphere. */
static void cell_of(float x, float y, float z, int *row, int *column) {
    double phi = atan2((double)y, (double)x);
    if (phi < 0)
        phi += 2 * M_PI;
    *row = (int)((1.0 - (double)z) * 0.5 * ROWS);
    *column = (int)(phi / (2 * M_PI) * COLUMNS);
    *row = *row < 0 ? 0 : *row >= ROWS ? ROWS - 1 : *row;
    *column = *column >= COLUMNS ? COLUMNS - 1 : *column;
}

static void draw_samples(const struct trc_lobes *l, const struct trc_surface *s, int count,
                         struct histogram *h) {
    struct rng random = rng_seed(1);
    memset(h, 0, sizeof *h);
    for (int i = 0; i < count; i += TRC_WIDTH) {
        struct trc_bsdf_sample b;
        const vfloat u0 = test_wide_uniform(&random), u1 = test_wide_uniform(&random);
        TRC_KERNEL(trc_bsdf_sample)(l, s, u0, u1, test_wide_uniform(&random), &b);
        for (int k = 0; k < TRC_WIDTH; k++) {
            const float pdf = vf_get(b.pdf, k), w = vf_get(b.weight.x, k);
            assert_true(isfinite(w) && w >= 0.0f && isfinite(pdf) && pdf >= 0.0f);
            const bool valid = (vm_bits(b.valid) >> k) & 1u;
            if (valid) {
                h->weight += (double)w;
                h->weight2 += (double)w * (double)w;
            }
            if (pdf == 0.0f) {
                h->lost += 1.0;
                continue;
            }
            int row, column;
            cell_of(vf_get(b.wi.x, k), vf_get(b.wi.y, k), vf_get(b.wi.z, k), &row, &column);
            h->count[row][column] += 1.0;
        }
    }
}

/* Integrals of density and value over one cell by the midpoint rule, FINE x FINE directions, finer
 * where asked. */
static void integrate_cell(const struct trc_lobes *l, const struct trc_surface *s, int row,
                           int column, int fine, double *density, double *value) {
    *density = *value = 0.0;
    for (int i = 0; i < fine; i++)
        for (int j = 0; j < fine; j += TRC_WIDTH) {
            float x[TRC_WIDTH], y[TRC_WIDTH], z[TRC_WIDTH];
            for (int k = 0; k < TRC_WIDTH; k++) {
                const double c = 1.0 - 2.0 * (row + (i + 0.5) / fine) / ROWS;
                const double phi = 2 * M_PI * (column + (j + k + 0.5) / fine) / COLUMNS;
                const double r = sqrt(1.0 - c * c);
                x[k] = (float)(r * cos(phi));
                y[k] = (float)(r * sin(phi));
                z[k] = (float)c;
            }
            struct trc_bsdf_value v;
            TRC_KERNEL(trc_bsdf_eval)
            (l, s, v3(vf_load(x), vf_load(y), vf_load(z)), vm_all_set(), &v);
            for (int k = 0; k < TRC_WIDTH; k++) {
                *density += (double)vf_get(v.pdf, k);
                *value += (double)(vf_get(v.diffuse.x, k) + vf_get(v.glossy.x, k) +
                                   vf_get(v.transmission.x, k));
            }
        }
    const double area = 4 * M_PI / (ROWS * COLUMNS) / ((double)fine * fine);
    *density *= area;
    *value *= area;
}

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
        layered_all(),
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
        principled("Principled"),
        principled_all(),
        clearcoat(0.6f),
        toon(1, 0.4f, 0.1f),
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

/* ---- energy ---- */

static double albedo(struct model *m, double cos_o) {
    struct trc_surface s;
    struct trc_lobes l;
    prepare(m, direction(cos_o, 0.3), &s, &l);
    struct histogram h;
    draw_samples(&l, &s, SAMPLES, &h);
    return h.weight / SAMPLES;
}

#define STARTS 16 /* of sequences */

struct furnace {
    double mean, half_width; /* the mean is in between with 99 % */
};

/* Density of directions whose cosine is the square of an even number. */
static double grazing_density(double cosine) { return 1.0 / (4.0 * M_PI * sqrt(cosine)); }

/* What a direction by that density adds beside the samples of a lobe (balance heuristic). */
static double grazing_light(const struct trc_lobes *l, const struct trc_surface *s,
                            float u[3][TRC_WIDTH]) {
    float x[TRC_WIDTH], y[TRC_WIDTH], z[TRC_WIDTH];
    for (int k = 0; k < TRC_WIDTH; k++) {
        const double c = fmax((double)u[0][k] * (double)u[0][k], 1e-12);
        const double r = sqrt(1.0 - c * c), phi = 2.0 * M_PI * (double)u[1][k];
        x[k] = (float)(r * cos(phi));
        y[k] = (float)(r * sin(phi));
        z[k] = (float)c;
    }
    struct trc_bsdf_value v;
    TRC_KERNEL(trc_bsdf_eval)(l, s, v3(vf_load(x), vf_load(y), vf_load(z)), vm_all_set(), &v);
    double sum = 0.0;
    for (int k = 0; k < TRC_WIDTH; k++)
        sum += (double)vf_get(v.glossy.x, k) /
               ((double)vf_get(v.pdf, k) + grazing_density((double)z[k]));
    return sum;
}

/* Mean weight of samples by M. Roberts' sequence for three dimensions (2018) from a start. grazing:
 * with further directions for lobes that reflect only, of which those that scatter more than once
 * weigh much at grazing angles. */
static double mean_weight(const struct trc_lobes *l, const struct trc_surface *s, double at[3],
                          int points, bool grazing) {
    const double step[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    double sum = 0.0;
    for (int i = 0; i < points; i += TRC_WIDTH) {
        float u[3][TRC_WIDTH];
        for (int k = 0; k < TRC_WIDTH; k++)
            for (int d = 0; d < 3; d++) {
                u[d][k] = fminf((float)at[d], 0.99999994f);
                at[d] += step[d];
                at[d] -= floor(at[d]);
            }
        struct trc_bsdf_sample b;
        TRC_KERNEL(trc_bsdf_sample)(l, s, vf_load(u[0]), vf_load(u[1]), vf_load(u[2]), &b);
        for (int k = 0; k < TRC_WIDTH; k++) {
            if (!((vm_bits(b.valid) >> k) & 1u))
                continue;
            const double pdf = (double)vf_get(b.pdf, k);
            const double other =
                grazing ? grazing_density(fmax((double)vf_get(b.wi.z, k), 1e-12)) : 0.0;
            sum += (double)vf_get(b.weight.x, k) * (pdf / (pdf + other));
        }
        if (grazing)
            sum += grazing_light(l, s, u);
    }
    return sum / points;
}

/* The error is known from that of random starts; as many points as it takes. */
static struct furnace furnace(struct model *m, double cos_o, double wanted, bool grazing) {
    const double quantile = 2.947; /* Student's t, 15 degrees */
    struct trc_surface s;
    struct trc_lobes l;
    prepare(m, direction(cos_o, 0.3), &s, &l);
    struct furnace f = {0.0, 1.0};
    for (int points = 1 << 10; f.half_width > wanted && points <= 1 << 19; points *= 2) {
        struct rng random = rng_seed(1);
        double sum = 0.0, sum2 = 0.0;
        for (int k = 0; k < STARTS; k++) {
            double at[3];
            for (int d = 0; d < 3; d++)
                at[d] = (double)rng_unit(&random);
            const double mean = mean_weight(&l, &s, at, points, grazing);
            sum += mean;
            sum2 += mean * mean;
        }
        f.mean = sum / STARTS;
        f.half_width = quantile * sqrt(fmax(sum2 / STARTS - f.mean * f.mean, 0.0) / (STARTS - 1));
    }
    return f;
}

/* Adds what a lobe is off to the kind's worst. */
static void add_furnace(struct model *m, double cos_o, double roughness, bool grazing,
                        double *worst, double *half_width) {
    const struct furnace f = furnace(m, cos_o, 0.0005, grazing);
    *half_width = fmax(*half_width, f.half_width);
    const double off = fabs(f.mean - 1.0);
    if (off > 0.002)
        printf("%s, cos %.2f, roughness %.2f: %.4f +- %.4f\n", m->name, cos_o, roughness, f.mean,
               f.half_width);
    *worst = fmax(*worst, off);
}

static void furnace_is_white(void **state) {
    (void)state;
    const uint32_t multi = TRC_DISTRIBUTION_MULTI_GGX, later = multi | TRC_DISTRIBUTION_CORRELATED;
    const double cosines[] = {1.0, 0.8, 0.5, 0.25, 0.1, 0.05};
    const float roughnesses[] = {0.1f, 0.2f, 0.35f, 0.6f, 0.85f, 1.0f};
    const float iors[] = {1.1f, 1.45f, 1.5f, 2.4f};
    double of_glossy = 0.0, of_metal = 0.0, of_glass = 0.0, half_width = 0.0;
    for (int k = 0; k < 6; k++)
        for (int j = 0; j < 6; j++) {
            const float r = roughnesses[j];
            const double c = cosines[k];
            struct model reflecting[] = {glossy(multi, r, 0.0f), glossy(later, r, 0.0f)};
            struct model metals[] = {principled_metal(multi, r), layered_metal(multi, r)};
            set(&metals[0], 11, 0.0f);
            for (int i = 0; i < 2; i++) {
                add_furnace(&reflecting[i], c, (double)r, true, &of_glossy, &half_width);
                add_furnace(&metals[i], c, (double)r, true, &of_metal, &half_width);
            }
            for (int i = 0; i < 8; i++) {
                const float ior = iors[i / 2];
                const bool back = i % 2;
                /* Indices that are rare at every other angle. */
                if ((k + j) % 2 && (ior < 1.4f || ior > 2.0f))
                    continue;
                struct model clear[] = {glass(multi, r, ior, back), glass(later, r, ior, back)};
                for (int n = 0; n < 2; n++)
                    add_furnace(&clear[n], c, (double)r, false, &of_glass, &half_width);
            }
            struct model layer = layered_glass(multi, r, (k + j) % 2);
            add_furnace(&layer, c, (double)r, false, &of_glass, &half_width);
            /* Nothing may give more than it gets. */
            struct model single[] = {glossy(TRC_DISTRIBUTION_GGX, r, 0.0f),
                                     glossy(TRC_DISTRIBUTION_BECKMANN, r, 0.3f),
                                     glass(TRC_DISTRIBUTION_GGX, r, 1.45f, true),
                                     principled_metal(TRC_DISTRIBUTION_GGX, r), clearcoat(r)};
            for (size_t i = 0; i < sizeof single / sizeof single[0]; i++)
                assert_true(furnace(&single[i], c, 0.002, false).mean < 1.006);
        }
    print_figure("39: white furnace, glossy", "off by at most %.4f", of_glossy);
    print_figure("39: white furnace, metal", "off by at most %.4f", of_metal);
    print_figure("39: white furnace, glass", "off by at most %.4f", of_glass);
    printf("99 %% half-width at most %.5f\n", half_width);
    assert_true(of_glossy <= 0.002 && of_metal <= 0.002 && of_glass <= 0.002);
    assert_true(half_width <= 0.0005);
}

static double diffuse_albedo(struct model *m, double cos_o) {
    struct trc_surface s;
    struct trc_lobes l;
    prepare(m, direction(cos_o, 0.3), &s, &l);
    double sum = 0.0;
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < COLUMNS; j++) {
            double density, value;
            integrate_cell(&l, &s, i, j, 16, &density, &value);
            sum += value;
        }
    return sum;
}
static void diffuse_albedos(void **state) {
    (void)state;
    struct model lambert = diffuse(0.0f), rough = diffuse(0.8f), all = principled("");
    set(&all, 8, 0.0f);
    set(&all, 10, 0.5f);
    set3(&all, 0, 1, 1, 1);
    double worst = 0.0;
    for (double c = 0.1; c <= 1.0; c += 0.3) {
        worst = fmax(worst, fabs(diffuse_albedo(&lambert, c) - 1.0));
        assert_true(diffuse_albedo(&rough, c) < 1.01);
        printf("cos %.1f: Oren-Nayar %.3f, Principled diffuse %.3f\n", c, diffuse_albedo(&rough, c),
               diffuse_albedo(&all, c));
        struct model whole = rough;
        whole.material.leaves[0].mode = 1;
        worst = fmax(worst, fabs(diffuse_albedo(&whole, c) - 1.0));
        /* A linear map of a cosine lobe keeps its integral. */
        struct model fibres = diffuse(0.4f);
        fibres.material.leaves[0].type = TRC_NODE_SHEEN;
        struct trc_surface s;
        struct trc_lobes l;
        prepare(&fibres, direction(c, 0.3), &s, &l);
        const double kept = (double)vf_get(l.lobe[0].weight.x, 0);
        printf("cos %.1f: fibre sheen keeps %.4f\n", c, kept);
        assert_true(kept > 1e-3 && kept < 1.0);
        assert_true(fabs(diffuse_albedo(&fibres, c) / kept - 1.0) < 0.01);
    }
    print_figure("39: white furnace, diffuse", "off by at most %.4f", worst);
    assert_true(worst <= 0.002);
}

/* ---- ideal lobes ---- */

/* What ideal glass reflects and refracts of light from a direction. */
static double ideal_sum(struct model m, float ior, double c) {
    const bool back = m.back;
    struct trc_surface s;
    struct trc_lobes l;
    prepare(&m, direction(c, 1.0), &s, &l);
    double sum = 0.0;
    for (int k = 0; k < l.count; k++) {
        struct trc_bsdf_sample b;
        TRC_KERNEL(trc_bsdf_ideal)(&l, k, &s, &b);
        if (!vm_any(b.valid))
            continue;
        sum += (double)vf_get(b.weight.x, 0);
        /* Snell: the tangential parts scale by the index. */
        const double eta = back ? 1.0 / (double)ior : (double)ior;
        const double x = (double)vf_get(b.wi.x, 0), y = (double)vf_get(b.wi.y, 0);
        const double scale = vm_any(b.transmitted) ? 1.0 / eta : 1.0;
        const double sine = sqrt(1.0 - c * c) * scale;
        assert_true(fabs(hypot(x, y) - sine) < 2e-6);
        /* 1 - cos^2 times the square of a large index has lost digits. */
        const double allowed = ior > 100.0f ? 1e-5 : 1e-6;
        assert_true(fabs((double)vf_get(v3_length(b.wi), 0) - 1.0) < allowed);
    }
    return sum;
}

static struct model ideal_glass(float ior, bool back) {
    return glass(TRC_DISTRIBUTION_SHARP, 0.0f, ior, back);
}

static void ideal_glass_splits_energy(void **state) {
    (void)state;
    const float iors[] = {1.001f, 1.2f, 1.5f, 2.5f, 4.0f};
    double worst = 0.0;
    for (int i = 0; i < 5; i++)
        for (int back = 0; back < 2; back++)
            for (double c = 1e-3; c <= 1.0; c += 0.0333)
                worst = fmax(worst, fabs(ideal_sum(ideal_glass(iors[i], back), iors[i], c) - 1.0));
    /* Rough glass of an index that does not refract. */
    for (int back = 0; back < 2; back++)
        for (double c = 1e-3; c <= 1.0; c += 0.0333) {
            const uint32_t multi = TRC_DISTRIBUTION_MULTI_GGX;
            const struct model plain = glass(multi, 0.8f, 1.0f, back);
            const struct model later = glass(multi | TRC_DISTRIBUTION_CORRELATED, 0.8f, 1.0f, back);
            worst = fmax(worst, fabs(ideal_sum(plain, 1.0f, c) - 1.0));
            worst = fmax(worst, fabs(ideal_sum(later, 1.0f, c) - 1.0));
        }
    print_figure("39: white furnace, ideal glass", "off by at most %.1e", worst);
    assert_true(worst < 1e-6);
}

/* On both sides, at the critical angle and one ulp of its cosine beside it. */
static void glass_at_the_critical_angle(void **state) {
    (void)state;
    const float iors[] = {1.0f, 1.0000001f, 1.1f, 1.45f, 1.5f, 2.4f, 1e3f, 1e6f};
    double worst = 0.0;
    for (size_t i = 0; i < sizeof iors / sizeof iors[0]; i++) {
        const double inverse = 1.0 / (double)iors[i];
        const float critical = (float)sqrt((1.0 - inverse) * (1.0 + inverse));
        const float cosines[] = {nextafterf(critical, 0.0f), critical, nextafterf(critical, 2.0f)};
        for (int k = 0; k < 3; k++)
            for (int back = 0; back < 2; back++) {
                if (cosines[k] <= 0.0f || cosines[k] > 1.0f)
                    continue;
                const double sum =
                    ideal_sum(ideal_glass(iors[i], back), iors[i], (double)cosines[k]);
                if (!(fabs(sum - 1.0) <= 1e-6))
                    printf("ior %.7g, back %d, cos %.9g: %.8f\n", (double)iors[i], back,
                           (double)cosines[k], sum);
                assert_true(isfinite(sum));
                worst = fmax(worst, fabs(sum - 1.0));
            }
    }
    print_figure("33: refraction at the critical angle +-1 ulp", "energy off by at most %.1e",
                 worst);
    assert_true(worst <= 1e-6);
}

/* Paths within glass meet dozens of surfaces: no sample may gain much at one, also where a part of
 * the micro-normals reflects totally. */
static void glass_weights_are_steady(void **state) {
    (void)state;
    const uint32_t later = TRC_DISTRIBUTION_MULTI_GGX | TRC_DISTRIBUTION_CORRELATED;
    double most = 0.0;
    for (int i = 0; i < 2; i++)
        for (int back = 0; back < 2; back++) {
            const float r = i ? 0.3f : 0.15f;
            struct model models[] = {glass(later, r, 1.45f, back),
                                     glass(TRC_DISTRIBUTION_MULTI_GGX, r, 1.45f, back),
                                     layered_glass(TRC_DISTRIBUTION_MULTI_GGX, r, back)};
            for (size_t k = 0; k < sizeof models / sizeof models[0]; k++)
                for (double c = 0.05; c <= 1.0; c += 0.05) {
                    struct trc_surface s;
                    struct trc_lobes l;
                    prepare(&models[k], direction(c, 0.3), &s, &l);
                    struct rng random = rng_seed(3);
                    for (int n = 0; n < (1 << 12); n += TRC_WIDTH) {
                        struct trc_bsdf_sample b;
                        const vfloat u0 = test_wide_uniform(&random);
                        const vfloat u1 = test_wide_uniform(&random);
                        TRC_KERNEL(trc_bsdf_sample)(&l, &s, u0, u1, test_wide_uniform(&random), &b);
                        for (int lane = 0; lane < TRC_WIDTH; lane++)
                            if ((vm_bits(b.valid) >> lane) & 1u)
                                most = fmax(most, (double)vf_get(b.weight.x, lane));
                    }
                }
        }
    printf("  weight of a sample of white glass at most %.3f\n", most);
    assert_true(most < 1.35);
}

static void rough_goes_over_into_ideal(void **state) {
    (void)state;
    double worst = 0.0;
    for (int k = 0; k < 4; k++) {
        const float roughnesses[] = {0.0f, 1e-4f, 0.02f, 0.05f};
        struct model m = glossy(TRC_DISTRIBUTION_GGX, roughnesses[k], 0.0f);
        const double a = albedo(&m, 0.6);
        printf("roughness %g: %.5f\n", (double)roughnesses[k], a);
        worst = fmax(worst, fabs(a - 1.0));
    }
    print_figure("32: roughness to 0", "energy off the mirror's by at most %.5f", worst);
    assert_true(worst < 1e-3);
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
                TRC_KERNEL(trc_bsdf_eval)(&l, &s, k ? a : b, vm_all_set(), &v);
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
            TRC_KERNEL(trc_bsdf_eval)(&l, &s, wide(i[0], i[1], i[2]), vm_all_set(), &v);
            const double want = ggx_reference((double)(roughnesses[k] * roughnesses[k]), o, i);
            assert_true(fabs((double)vf_get(v.glossy.y, 0) - want) <= 2e-3 * want + 1e-7);
        }
}

/* ---- what follows from the rules ---- */

static void extremes_stay_finite(void **state) {
    (void)state;
    const double cosines[] = {1.0, 1e-2, 1e-4, 1e-7};
    const float roughnesses[] = {0.0f, 1e-7f, 1e-4f, 0.018f, 0.05f, 1.0f};
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
                most = fmax(most, h.weight / EXTREME_SAMPLES);
                for (int n = 0; n < 64; n++) {
                    struct trc_bsdf_value v;
                    TRC_KERNEL(trc_bsdf_eval)
                    (&l, &s, direction(1.0 - n / 31.5, n), vm_all_set(), &v);
                    assert_true(isfinite(vf_get(v.diffuse.x + v.glossy.x + v.transmission.x, 0)));
                    assert_true(vf_get(v.pdf, 0) >= 0.0f && isfinite(vf_get(v.pdf, 0)));
                }
            }
        }
    print_figure("31: lobes at roughness 0 to 1, cos to 1e-7",
                 "chi-square passes %d of %d, energy at most %.3f", chi_passes, chi_tests, most);
    assert_true(most < 1.01);
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
            TRC_KERNEL(trc_lobes_setup)(material_of(&models[i]), &s, &regs, vf_zero(), &l);
            struct trc_bsdf_value v;
            TRC_KERNEL(trc_bsdf_eval)
            (&l, &s, direction(-0.05 - 0.009 * n, 0.06 * n), vm_all_set(), &v);
            count++;
            below += vf_get(v3_max(v.diffuse) + v3_max(v.glossy), 0) != 0.0f;
            struct trc_bsdf_sample b;
            TRC_KERNEL(trc_bsdf_sample)
            (&l, &s, vf_set(0.5f), vf_set(0.01f * (float)n), vf_set(0.9f), &b);
            count++;
            below += vm_any(b.valid) && vf_get(b.wi.z, 0) <= 0.0f;
        }
    print_figure("37: shading normal against geometric normal",
                 "%d of %d samples and evaluations below the surface", below, count);
    assert_int_equal(below, 0);
}

/* Without lobes that end there is nothing to make up for; with them the factor is Cycles' share. */
static void factor_beyond(void **state) {
    (void)state;
    struct model pure = glossy(TRC_DISTRIBUTION_GGX, 0.6f, 0.0f), mixed = principled("");
    struct trc_surface s;
    struct trc_lobes l;
    struct trc_bsdf_sample b;
    prepare(&pure, direction(0.7, 0.0), &s, &l);
    TRC_KERNEL(trc_bsdf_sample)(&l, &s, vf_set(0.5f), vf_set(0.3f), vf_set(0.4f), &b);
    assert_true(fabsf(vf_get(b.beyond, 0) - 1.0f) < 1e-6f);
    prepare(&mixed, direction(0.7, 0.0), &s, &l);
    TRC_KERNEL(trc_bsdf_sample)(&l, &s, vf_set(0.5f), vf_set(0.3f), vf_set(0.4f), &b);
    assert_true(vf_get(b.beyond, 0) > 0.0f && vf_get(b.beyond, 0) < 1.0f);
    const double share = (double)vf_get(l.continue_weight / l.mix_weight, 0);
    struct trc_lobes first;
    s.depth = vi_set(0);
    struct trc_registers regs;
    memset(&regs, 0, sizeof regs);
    TRC_KERNEL(trc_lobes_setup)(material_of(&mixed), &s, &regs, vf_zero(), &first);
    const double defended = (double)vf_get(first.continue_weight / first.mix_weight, 0);
    printf("share of the reflection: %.3f, at the first hit %.3f\n", share, defended);
    assert_true(share < 0.125 && defended > share);
}

static void light_weights_drop_out(void **state) {
    (void)state;
    struct model m = diffuse(0.0f);
    struct trc_surface s;
    struct trc_lobes l;
    set3(&m, 0, 1e-6f, 1e-6f, 1e-6f);
    prepare(&m, direction(0.7, 0.0), &s, &l);
    assert_int_equal(l.count, 0);
    set3(&m, 0, -1.0f, NAN, 0.5f);
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
        cmocka_unit_test(furnace_is_white),
        cmocka_unit_test(diffuse_albedos),
        cmocka_unit_test(ideal_glass_splits_energy),
        cmocka_unit_test(glass_at_the_critical_angle),
        cmocka_unit_test(glass_weights_are_steady),
        cmocka_unit_test(rough_goes_over_into_ideal),
        cmocka_unit_test(lobes_are_reciprocal),
        cmocka_unit_test(values_match_formulas),
        cmocka_unit_test(extremes_stay_finite),
        cmocka_unit_test(nothing_shines_through),
        cmocka_unit_test(factor_beyond),
        cmocka_unit_test(light_weights_drop_out),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
