/* Diffuse reflection: Lambert's, Oren and Nayar's with and without the energy that scatters more
 * than once, and Burley's. */
#include "kernels/lobe/matt.h"

#include "kernels/lobe/microfacet.h"

/* ---- values ---- */

static struct lobe_value lambert_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                       vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi), f = cosine_density(cos_i);
    return matt_value(lobe, s, wi, cos_i, f, f);
}

/* M. Oren and S. Nayar (1994) in the form of Y. Fujii, as Cycles has it. */
TRC_INLINE vfloat oren_nayar(vfloat sigma, vfloat cos_i, vfloat cos_o, vfloat cos_io) {
    const vfloat scale = vf_rcp(vf_set(TRC_PI) + vf_set((3.0f * TRC_PI - 4.0f) / 6.0f) * sigma);
    const vfloat no = vf_max(cos_o, vf_zero());
    const vfloat t = cos_io - cos_i * no;
    const vfloat high = vf_max(vf_max(cos_i, no), vf_set(1e-30f));
    const vfloat tilt = vf_select(vf_gt(t, vf_zero()), t / high, t);
    return cos_i * scale * vf_max(vf_one() + sigma * tilt, vf_zero());
}

static struct lobe_value oren_nayar_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                          vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    const vfloat f = oren_nayar(lobe->roughness, cos_i, lobe->cos_o, v3_dot(wi, s->wo));
    return matt_value(lobe, s, wi, cos_i, f, even_density());
}

/* Burley's diffuse lobe (2012) in the split form of 2015: Lambert and retro-reflection. */
TRC_INLINE vfloat burley(vfloat roughness, vfloat cos_i, vfloat cos_o, vfloat cos_io) {
    const vfloat fi = trc_schlick_weight(cos_i), fo = trc_schlick_weight(cos_o);
    const vfloat half = vf_set(0.5f);
    const vfloat retro = roughness * (cos_io + vf_one());
    const vfloat lambert = (vf_one() - half * fi) * (vf_one() - half * fo);
    return cos_i * vf_set(TRC_INV_PI) *
           (lambert + retro * (fi + fo + fi * fo * (retro - vf_one())));
}

static struct lobe_value burley_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                      vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    const vfloat f = burley(lobe->roughness, cos_i, lobe->cos_o, v3_dot(wi, s->wo));
    return matt_value(lobe, s, wi, cos_i, f, cosine_density(cos_i));
}

/* Albedo of Fujii's form over sigma, less that of sigma 0 (OpenPBR specification 1.1, 2024). */
TRC_INLINE vfloat oren_nayar_gain(vfloat cosine) {
    const vfloat c = vf_max(cosine, vf_set(1e-6f)), third = vf_set(2.0f / 3.0f);
    const vfloat s = vf_safe_sqrt(vf_one() - c * c);
    return s * (vf_acos(vf_min(c, vf_one())) - third - s * c) +
           third * (s / c) * (vf_one() - s * s * s);
}

/* Albedo towards a direction. */
static vfloat oren_nayar_albedo(vfloat sigma, vfloat cosine) {
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    return a * (vf_set(TRC_PI) + sigma * oren_nayar_gain(cosine));
}

/* Y. Fujii's other form with what scatters more than once: the first part is grey, the rest is
 * multi. */
TRC_INLINE vvec3 energy_oren_nayar(const struct trc_lobe *lobe, vfloat cos_i, vfloat cos_io) {
    const vfloat sigma = lobe->roughness, no = vf_max(lobe->cos_o, vf_zero());
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    const vfloat t = cos_io - cos_i * no;
    const vfloat high = vf_max(vf_max(cos_i, no), vf_set(1e-30f));
    const vfloat tilt = vf_select(vf_gt(t, vf_zero()), t / high, t);
    const vfloat once = a * (vf_one() + sigma * tilt);
    const vfloat rest = vf_one() - oren_nayar_albedo(sigma, cos_i);
    return v3_scale(v3_add(v3_splat(once), v3_scale(lobe->f0, rest)), cos_i);
}

static struct lobe_value energy_oren_nayar_value(const struct trc_lobe *lobe,
                                                 const struct trc_surface *s, vvec3 wi) {
    const vfloat cos_n = v3_dot(lobe->n, wi);
    const vmask faces = vf_gt(cos_n, vf_zero());
    const vfloat bumps = bump_shadowing_of(lobe, s, wi, cos_n);
    const vvec3 value = energy_oren_nayar(lobe, cos_n, v3_dot(wi, s->wo));
    const vfloat pdf = vf_where(faces, cosine_density(cos_n));
    return (struct lobe_value){v3_mul(lobe->weight, v3_where(faces, v3_scale(value, bumps))), pdf,
                               pdf, pdf};
}

static const struct trc_lobe_model lambert_model = {.kind = TRC_LOBE_DIFFUSE,
                                                    .value = lambert_value},
                                   oren_nayar_model = {.kind = TRC_LOBE_DIFFUSE,
                                                       .value = oren_nayar_value},
                                   burley_model = {.kind = TRC_LOBE_DIFFUSE, .value = burley_value},
                                   energy_model = {.kind = TRC_LOBE_DIFFUSE,
                                                   .value = energy_oren_nayar_value};

/* ---- setting up ---- */

struct trc_lobe *trc_add_matt(struct trc_setup *c, const struct trc_lobe_model *model, vvec3 weight,
                              vvec3 n, vfloat roughness) {
    struct trc_lobe *lobe = trc_add_lobe(c, model, weight);
    if (!lobe)
        return NULL;
    lobe->n = n;
    lobe->roughness = roughness;
    lobe->cos_o = v3_dot(n, c->s->wo);
    return lobe;
}

void trc_add_lambert(struct trc_setup *c, vvec3 weight, vvec3 n) {
    trc_add_matt(c, &lambert_model, weight, n, vf_zero());
}

void trc_add_burley(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness) {
    trc_add_matt(c, &burley_model, weight, n, roughness);
}

void trc_add_energy_oren_nayar(struct trc_setup *c, vvec3 weight, vvec3 albedo, vvec3 n,
                               vfloat sigma) {
    struct trc_lobe *lobe = trc_add_matt(c, &energy_model, weight, n, sigma);
    if (!lobe)
        return;
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    const vfloat mean = a * (vf_set(TRC_PI) + vf_set((2.0f * TRC_PI - 5.6f) / 3.0f) * sigma);
    const vfloat lost = vf_one() - mean;
    const vfloat scale = vf_divide(vf_set(TRC_INV_PI) * mean, lost) *
                         (vf_one() - oren_nayar_albedo(sigma, lobe->cos_o));
    /* The weight has the colour once; Cycles gives the later bounces two more. */
    const vvec3 color = v3_saturate(albedo);
    lobe->f0 = v3(color.x * color.x * scale / (vf_one() - color.x * lost),
                  color.y * color.y * scale / (vf_one() - color.y * lost),
                  color.z * color.z * scale / (vf_one() - color.z * lost));
}

static void add_diffuse(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const struct trc_operand *roughness = input(c, leaf, TRC_AT(DIFFUSE, roughness));
    const bool is_lambert = roughness->reg < 0 && roughness->value == 0.0f;
    const vvec3 base = colour(c, leaf, TRC_AT(DIFFUSE, color)), tint = v3_scale(base, weight);
    const vvec3 n = trc_matt_normal(c, leaf, TRC_AT(DIFFUSE, normal));
    const vfloat sigma = vf_saturate(trc_operand_value(roughness, c->regs));
    if (leaf->mode == TRC_DIFFUSE_KEEPS_ENERGY && !is_lambert)
        trc_add_energy_oren_nayar(c, tint, base, n, sigma);
    else
        trc_add_matt(c, is_lambert ? &lambert_model : &oren_nayar_model, tint, n, sigma);
}

const struct trc_closure TRC_CLOSURE_OF(DIFFUSE) = {.add = add_diffuse};
