/* What tests of lobes share: materials of one leaf, a point that they shade, samples counted and
 * densities integrated by cells of directions. Needs cmocka. */
#ifndef TRACER_TESTS_BSDF_TEST_H
#define TRACER_TESTS_BSDF_TEST_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "kernels/lobe/bsdf.h"
#include "kernels/simd/wide_math.h"
#include "model/nodes.h"
#include "wide_test.h"

/* Of the node with the most inputs. */
#define OPERANDS TRC_AT(LAYERED_PRINCIPLED, end)

/* ---- materials of one leaf ---- */

struct model {
    const char *name;
    struct trc_material material;
    struct trc_operand operands[OPERANDS];
    bool back; /* seen from the back */
};

static inline struct trc_operand constant(float value) {
    return (struct trc_operand){TRC_REG_CONSTANT, value};
}

static inline void begin(struct model *m, const char *name, uint32_t type, uint32_t mode,
                         uint32_t count) {
    assert_true(count <= OPERANDS);
    memset(m, 0, sizeof *m);
    m->name = name;
    m->material.leaf_count = 1;
    m->material.leaves[0] = (struct trc_leaf){type, mode, {TRC_REG_CONSTANT, 1.0f}, 0, count};
    for (uint32_t i = 0; i < OPERANDS; i++)
        m->operands[i] = constant(0.0f);
}
static inline void set(struct model *m, uint32_t at, float a) { m->operands[at] = constant(a); }
static inline void set3(struct model *m, uint32_t at, float a, float b, float c) {
    set(m, at, a);
    set(m, at + 1, b);
    set(m, at + 2, c);
}
static inline void unlink_vector(struct model *m, uint32_t at) {
    for (uint32_t i = 0; i < 3; i++)
        m->operands[at + i] = (struct trc_operand){TRC_REG_DEFAULT, 0.0f};
}
/* The material points into the model: after the model has its final place. */
static const struct trc_material *material_of(struct model *m) {
    m->material.operands = m->operands;
    m->material.operand_count = OPERANDS;
    return &m->material;
}

static inline struct model diffuse(float roughness) {
    struct model m;
    begin(&m, roughness > 0 ? "Oren-Nayar" : "Lambert", TRC_NODE_DIFFUSE, 0, TRC_AT(DIFFUSE, end));
    set3(&m, TRC_AT(DIFFUSE, color), 1, 1, 1);
    set(&m, TRC_AT(DIFFUSE, roughness), roughness);
    unlink_vector(&m, TRC_AT(DIFFUSE, normal));
    return m;
}
static inline struct model translucent(void) {
    struct model m;
    begin(&m, "translucent", TRC_NODE_TRANSLUCENT, 0, TRC_AT(TRANSLUCENT, end));
    set3(&m, TRC_AT(TRANSLUCENT, color), 1, 1, 1);
    unlink_vector(&m, TRC_AT(TRANSLUCENT, normal));
    return m;
}
static inline struct model glossy(uint32_t mode, float roughness, float anisotropy) {
    struct model m;
    begin(&m, "glossy", TRC_NODE_GLOSSY, mode, TRC_AT(GLOSSY, end));
    set3(&m, TRC_AT(GLOSSY, color), 1, 1, 1);
    set(&m, TRC_AT(GLOSSY, roughness), roughness);
    set(&m, TRC_AT(GLOSSY, anisotropy), anisotropy);
    set(&m, TRC_AT(GLOSSY, rotation), 0.1f);
    unlink_vector(&m, TRC_AT(GLOSSY, normal));
    set3(&m, TRC_AT(GLOSSY, tangent), 1, 0, 0);
    return m;
}
static inline struct model glass(uint32_t mode, float roughness, float ior, bool back) {
    struct model m;
    begin(&m, "glass", TRC_NODE_GLASS, mode, TRC_AT(GLASS, end));
    set3(&m, TRC_AT(GLASS, color), 1, 1, 1);
    set(&m, TRC_AT(GLASS, roughness), roughness);
    set(&m, TRC_AT(GLASS, ior), ior);
    unlink_vector(&m, TRC_AT(GLASS, normal));
    m.back = back;
    return m;
}
static inline struct model refraction(uint32_t mode, float roughness, float ior) {
    struct model m = glass(mode, roughness, ior, false);
    m.material.leaves[0].type = TRC_NODE_REFRACTION;
    m.name = "refraction";
    return m;
}
/* Defaults of the node. */
static inline struct model principled(const char *name) {
    struct model m;
    begin(&m, name, TRC_NODE_PRINCIPLED, TRC_DISTRIBUTION_GGX, TRC_AT(PRINCIPLED, end));
    set3(&m, TRC_AT(PRINCIPLED, base_color), 0.8f, 0.8f, 0.8f);
    set(&m, TRC_AT(PRINCIPLED, specular), 0.5f);
    set(&m, TRC_AT(PRINCIPLED, roughness), 0.5f);
    set(&m, TRC_AT(PRINCIPLED, sheen_tint), 0.5f);
    set(&m, TRC_AT(PRINCIPLED, clearcoat_roughness), 0.03f);
    set(&m, TRC_AT(PRINCIPLED, ior), 1.45f);
    set(&m, TRC_AT(PRINCIPLED, emission_strength), 1.0f);
    set(&m, TRC_AT(PRINCIPLED, alpha), 1.0f);
    unlink_vector(&m, TRC_AT(PRINCIPLED, normal));
    unlink_vector(&m, TRC_AT(PRINCIPLED, clearcoat_normal));
    set3(&m, TRC_AT(PRINCIPLED, tangent), 1, 0, 0);
    return m;
}
static inline struct model principled_metal(uint32_t mode, float roughness) {
    struct model m = principled("Principled metal");
    m.material.leaves[0].mode = mode;
    set3(&m, TRC_AT(PRINCIPLED, base_color), 1, 1, 1);
    set(&m, TRC_AT(PRINCIPLED, metallic), 1.0f);
    set(&m, TRC_AT(PRINCIPLED, roughness), roughness);
    set(&m, TRC_AT(PRINCIPLED, anisotropic), 0.6f);
    return m;
}
static inline struct model principled_glass(uint32_t mode, float roughness, bool back) {
    struct model m = principled("Principled glass");
    m.material.leaves[0].mode = mode;
    set3(&m, TRC_AT(PRINCIPLED, base_color), 1, 1, 1);
    set(&m, TRC_AT(PRINCIPLED, roughness), roughness);
    set(&m, TRC_AT(PRINCIPLED, transmission), 1.0f);
    set(&m, TRC_AT(PRINCIPLED, transmission_roughness), 0.2f);
    m.back = back;
    return m;
}
static inline struct model principled_all(void) {
    struct model m = principled("Principled, everything");
    set3(&m, TRC_AT(PRINCIPLED, base_color), 0.8f, 0.5f, 0.3f);
    set(&m, TRC_AT(PRINCIPLED, subsurface), 0.2f);
    set3(&m, TRC_AT(PRINCIPLED, subsurface_color), 0.9f, 0.3f, 0.2f);
    set(&m, TRC_AT(PRINCIPLED, metallic), 0.3f);
    set(&m, TRC_AT(PRINCIPLED, specular_tint), 0.4f);
    set(&m, TRC_AT(PRINCIPLED, anisotropic), 0.5f);
    set(&m, TRC_AT(PRINCIPLED, sheen), 0.7f);
    set(&m, TRC_AT(PRINCIPLED, clearcoat), 0.8f);
    set(&m, TRC_AT(PRINCIPLED, clearcoat_roughness), 0.3f);
    set(&m, TRC_AT(PRINCIPLED, transmission), 0.4f);
    return m;
}
/* Principled of Blender 4 with every layer, or white metal, or white glass. */
static inline struct model layered(const char *name, uint32_t mode, float roughness) {
    struct model m;
    begin(&m, name, TRC_NODE_LAYERED_PRINCIPLED, mode, TRC_AT(LAYERED_PRINCIPLED, end));
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, base_color), 1, 1, 1);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, roughness), roughness);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, ior), 1.5f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, alpha), 1.0f);
    unlink_vector(&m, TRC_AT(LAYERED_PRINCIPLED, normal));
    set(&m, TRC_AT(LAYERED_PRINCIPLED, specular_ior_level), 0.5f);
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, specular_tint), 1, 1, 1);
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, tangent), 1, 0, 0);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_roughness), 0.3f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_ior), 1.5f);
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, coat_tint), 1, 1, 1);
    unlink_vector(&m, TRC_AT(LAYERED_PRINCIPLED, coat_normal));
    set(&m, TRC_AT(LAYERED_PRINCIPLED, sheen_roughness), 0.5f);
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, sheen_tint), 1, 1, 1);
    return m;
}
static inline struct model layered_metal(uint32_t mode, float roughness) {
    struct model m = layered("layered metal", mode, roughness);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, metallic), 1.0f);
    return m;
}
static inline struct model layered_glass(uint32_t mode, float roughness, bool back) {
    struct model m = layered("layered glass", mode, roughness);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, transmission_weight), 1.0f);
    m.back = back;
    return m;
}
static inline struct model thin_wall(float roughness) {
    struct model m = layered_glass(TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_THIN_WALL, roughness, 0);
    m.name = "thin wall";
    return m;
}
/* Glass and gloss under a film. */
static inline struct model filmed(uint32_t mode, float roughness, bool back) {
    struct model m = layered_glass(mode, roughness, back);
    m.name = "glass under a film";
    set(&m, TRC_AT(LAYERED_PRINCIPLED, transmission_weight), 0.7f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, film_thickness), 400.0f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, film_ior), 1.8f);
    return m;
}
static inline struct model layered_all(void) {
    struct model m = layered("all layers", TRC_DISTRIBUTION_MULTI_GGX, 0.6f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, metallic), 0.3f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, transmission_weight), 0.4f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, coat_weight), 0.7f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, sheen_weight), 0.8f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, diffuse_roughness), 0.5f);
    set(&m, TRC_AT(LAYERED_PRINCIPLED, anisotropic), 0.4f);
    set3(&m, TRC_AT(LAYERED_PRINCIPLED, coat_tint), 0.9f, 0.5f, 0.7f);
    return m;
}

static inline struct model toon(uint32_t mode, float size, float smooth) {
    struct model m;
    begin(&m, mode ? "glossy toon" : "toon", TRC_NODE_TOON, mode, TRC_AT(TOON, end));
    set3(&m, TRC_AT(TOON, color), 1, 1, 1);
    set(&m, TRC_AT(TOON, size), size);
    set(&m, TRC_AT(TOON, smooth), smooth);
    unlink_vector(&m, TRC_AT(TOON, normal));
    return m;
}
static inline struct model clearcoat(float roughness) {
    struct model m = principled("clearcoat");
    set3(&m, TRC_AT(PRINCIPLED, base_color), 0, 0, 0);
    set(&m, TRC_AT(PRINCIPLED, specular), 0.0f);
    set(&m, TRC_AT(PRINCIPLED, clearcoat), 1.0f);
    set(&m, TRC_AT(PRINCIPLED, clearcoat_roughness), roughness);
    return m;
}

/* Of fibres along a direction that lies in the surface. */
static inline struct model hair(uint32_t component, float u, float v, float offset) {
    struct model m;
    begin(&m, component ? "hair transmission" : "hair reflection", TRC_NODE_HAIR, component,
          TRC_AT(HAIR, end));
    set3(&m, TRC_AT(HAIR, color), 1, 1, 1);
    set(&m, TRC_AT(HAIR, offset), offset);
    set(&m, TRC_AT(HAIR, roughness_u), u);
    set(&m, TRC_AT(HAIR, roughness_v), v);
    set3(&m, TRC_AT(HAIR, tangent), 0.6f, 0.8f, 0.0f);
    return m;
}
static inline struct model principled_hair(float absorption, float roughness, float radial,
                                           float coat, float offset) {
    struct model m;
    begin(&m, "Principled Hair", TRC_NODE_PRINCIPLED_HAIR, TRC_PIGMENT_ABSORPTION,
          TRC_AT(PRINCIPLED_HAIR, end));
    set3(&m, TRC_AT(PRINCIPLED_HAIR, absorption), absorption, absorption, absorption);
    set(&m, TRC_AT(PRINCIPLED_HAIR, roughness), roughness);
    set(&m, TRC_AT(PRINCIPLED_HAIR, radial_roughness), radial);
    set(&m, TRC_AT(PRINCIPLED_HAIR, coat), coat);
    set(&m, TRC_AT(PRINCIPLED_HAIR, ior), 1.55f);
    set(&m, TRC_AT(PRINCIPLED_HAIR, offset), offset);
    set3(&m, TRC_AT(PRINCIPLED_HAIR, tangent), 0.6f, 0.8f, 0.0f);
    return m;
}

/* factors: of R, TT and TRT. */
static inline struct model huang_hair(float absorption, float roughness, float aspect,
                                      const float factors[3]) {
    struct model m;
    begin(&m, "Principled Hair (Huang)", TRC_NODE_HUANG_HAIR, TRC_PIGMENT_ABSORPTION,
          TRC_AT(HUANG_HAIR, end));
    set3(&m, TRC_AT(HUANG_HAIR, absorption), absorption, absorption, absorption);
    set(&m, TRC_AT(HUANG_HAIR, roughness), roughness);
    set(&m, TRC_AT(HUANG_HAIR, aspect_ratio), aspect);
    set(&m, TRC_AT(HUANG_HAIR, ior), 1.55f);
    set(&m, TRC_AT(HUANG_HAIR, random), 0.5f);
    set(&m, TRC_AT(HUANG_HAIR, reflection), factors[0]);
    set(&m, TRC_AT(HUANG_HAIR, transmission), factors[1]);
    set(&m, TRC_AT(HUANG_HAIR, second_reflection), factors[2]);
    set3(&m, TRC_AT(HUANG_HAIR, tangent), 0.6f, 0.8f, 0.0f);
    return m;
}

/* ---- a shading point ---- */

static inline vvec3 wide(double x, double y, double z) {
    return v3(vf_set((float)x), vf_set((float)y), vf_set((float)z));
}

static inline void point(struct trc_surface *s, vvec3 wo, const struct model *m) {
    memset(s, 0, sizeof *s);
    s->active = vm_all_set();
    s->instance = vi_set(-1);
    s->ng = s->n = wide(0, 0, 1);
    s->wo = wo;
    s->backfacing = m->back ? vm_all_set() : vm_none();
    s->depths = vu_set(1u << TRC_DEPTH_ALL_SHIFT);
}
static inline void prepare(struct model *m, vvec3 wo, struct trc_surface *s, struct trc_lobes *l) {
    struct trc_registers regs;
    memset(&regs, 0, sizeof regs);
    point(s, wo, m);
    trc_lobes_setup(material_of(m), s, &regs, vf_zero(), l);
}
static inline vvec3 direction(double cos_theta, double phi) {
    const double r = sqrt(fmax(0.0, 1.0 - cos_theta * cos_theta));
    return wide(r * cos(phi), r * sin(phi), cos_theta);
}

/* ---- sampling against density ---- */

#define ROWS 16
#define COLUMNS 24
#define FINE 32
#define SAMPLES (1 << 19)

struct histogram {
    double count[ROWS][COLUMNS], lost;
    double weight, weight2;
};

/* Cell of a direction: rows of equal cos(theta) over the sphere. */
static inline void cell_of(float x, float y, float z, int *row, int *column) {
    double phi = atan2((double)y, (double)x);
    if (phi < 0)
        phi += 2 * M_PI;
    *row = (int)((1.0 - (double)z) * 0.5 * ROWS);
    *column = (int)(phi / (2 * M_PI) * COLUMNS);
    *row = *row < 0 ? 0 : *row >= ROWS ? ROWS - 1 : *row;
    *column = *column >= COLUMNS ? COLUMNS - 1 : *column;
}

/* The next TRC_WIDTH points of M. Roberts' sequence for three dimensions (2018) after at, which is
 * its start and then its last point. */
static inline void next_points(double at[3], float u[3][TRC_WIDTH]) {
    const double step[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
    for (int k = 0; k < TRC_WIDTH; k++)
        for (int d = 0; d < 3; d++) {
            u[d][k] = fminf((float)at[d], 0.99999994f);
            at[d] += step[d];
            at[d] -= floor(at[d]);
        }
}

static inline void draw_samples(const struct trc_lobes *l, const struct trc_surface *s, int count,
                                struct histogram *h) {
    struct rng random = rng_seed(1);
    memset(h, 0, sizeof *h);
    for (int i = 0; i < count; i += TRC_WIDTH) {
        struct trc_bsdf_sample b;
        const vfloat u0 = test_wide_uniform(&random), u1 = test_wide_uniform(&random);
        trc_bsdf_sample(l, s, u0, u1, test_wide_uniform(&random), &b);
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
static inline void integrate_cell(const struct trc_lobes *l, const struct trc_surface *s, int row,
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
            trc_bsdf_eval(l, s, v3(vf_load(x), vf_load(y), vf_load(z)), vm_all_set(), vm_none(),
                          &v);
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

#endif
