/* Reflection of microfacets: GGX, Beckmann, and GGX with what scatters more than once. The Glossy
 * shader. */
#include "kernels/lobe/facets.h"

struct lobe_value trc_reflection_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                       vvec3 wi) {
    struct meeting at;
    if (!meet(lobe, s->wo, wi, &at))
        return no_value();
    const vfloat d = vf_where(at.m, distribution_d(lobe, &at.h));
    const vfloat quarter = vf_set(0.25f) / lobe->cos_o;
    struct lobe_value r;
    r.pdf = d * lobe->pdf_scale;
    r.claim = d * lobe->g1_o * quarter;
    vfloat f = r.claim * shadowing(lobe, at.h.tan2_i);
    if (lobe->distribution == TRC_LOBE_MULTI_GGX) {
        /* Height-correlated: 1 / (1 + L_o + L_i), with 1 + L_o = 1 / g1_o. */
        f = d * quarter / (vf_rcp(lobe->g1_o) + trc_ggx_lambda(at.h.tan2_i));
        const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y);
        const vfloat cosine = vf_where(at.m, at.cos_i);
        const vfloat missing = (vf_one() - trc_ggx_albedo(at.cos_i, alpha)) * cosine;
        const vfloat spread = lobe->multi_chance;
        r.pdf = vf_lerp(r.pdf, cosine * vf_set(TRC_INV_PI), spread);
        r.claim = vf_lerp(r.claim, cosine * vf_set(TRC_INV_PI), spread);
        r.value = v3_add(v3_scale(facet_fresnel(lobe, at.cos_h), f),
                         v3_scale(lobe->multi_weight, missing));
        r.value = v3_mul(r.value, lobe->weight);
    } else {
        r.value = v3_mul(v3_scale(lobe->weight, f), facet_fresnel(lobe, at.cos_h));
    }
    r.pick = r.claim;
    weigh_pair(lobe, at.cos_h, &r);
    return r;
}

struct trc_lobe *trc_add_reflection(struct trc_setup *c, vvec3 weight) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_REFLECT,
                                                .has_facets = true,
                                                .value = TRC_KERNEL(trc_reflection_value),
                                                .direction = TRC_KERNEL(trc_facets_direction)};
    return trc_add_lobe(c, &model, weight);
}

static void add_glossy(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 base = colour(c, leaf, TRC_AT(GLOSSY, color));
    const uint32_t distribution = distribution_of(leaf->mode);
    struct trc_lobe *lobe = distribution == TRC_LOBE_ASHIKHMIN
                                ? trc_add_ashikhmin(c, v3_scale(base, weight))
                                : trc_add_reflection(c, v3_scale(base, weight));
    if (!lobe)
        return;
    lobe->distribution = distribution;
    lobe->correlated = leaf->mode & TRC_DISTRIBUTION_CORRELATED;
    lobe->n = trc_leaf_normal(c, leaf, TRC_AT(GLOSSY, normal));
    lobe->ior = vf_one();
    const vfloat alpha = vf_square(number(c, leaf, TRC_AT(GLOSSY, roughness)));
    const struct trc_operand *twist = input(c, leaf, TRC_AT(GLOSSY, anisotropy));
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->anisotropic = twist->reg >= 0 || twist->value != 0.0f;
    if (lobe->anisotropic) {
        const vfloat anisotropy = vf_clamp(trc_operand_value(twist, c->regs), -0.99f, 0.99f);
        const vmask negative = vf_lt(anisotropy, vf_zero());
        const vfloat less = vf_one() - vf_abs(anisotropy);
        lobe->alpha_x = vf_select(negative, alpha / less, alpha * less);
        lobe->alpha_y = vf_select(negative, alpha * less, alpha / less);
        lobe->tangent = trc_leaf_tangent(c, leaf, TRC_AT(GLOSSY, tangent), lobe->n,
                                         number(c, leaf, TRC_AT(GLOSSY, rotation)));
    }
    trc_facets_finish(c, lobe, is_sharp(leaf->mode));
    if (lobe->distribution == TRC_LOBE_MULTI_GGX && lobe->correlated)
        trc_facets_keep_energy(lobe, v3_saturate(base));
    else if (lobe->distribution == TRC_LOBE_MULTI_GGX)
        trc_facets_set_multiple(lobe, c->s->wo, v3_saturate(base), false);
}

const struct trc_closure TRC_CLOSURE_OF(GLOSSY) = {.add = add_glossy};
