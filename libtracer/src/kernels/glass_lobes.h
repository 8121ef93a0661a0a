/* Glass: the lobes that reflect and refract, and how they share the light. A part of bsdf_setup.c.
 */
#ifndef TRACER_KERNELS_GLASS_LOBES_H
#define TRACER_KERNELS_GLASS_LOBES_H

/* One of the two lobes of glass. */
static struct trc_lobe *add_dielectric(struct setup *c, enum trc_lobe_kind kind, vvec3 weight,
                                       vvec3 n, vfloat alpha, vfloat eta, uint32_t mode) {
    struct trc_lobe *lobe = add_lobe(c, kind, weight);
    if (!lobe)
        return NULL;
    const uint32_t distribution = distribution_of(mode);
    lobe->distribution = distribution == TRC_LOBE_BECKMANN ? TRC_LOBE_BECKMANN : TRC_LOBE_GGX;
    lobe->correlated = mode & TRC_DISTRIBUTION_CORRELATED;
    lobe->n = n;
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->ior = eta;
    finish_microfacets(c, lobe, is_sharp(mode));
    return lobe;
}

/* Chance of reflection where both lobes have the factor of the micro-normal: near its part of the
 * light, or else the few samples of the brighter lobe have large weights, which clamping cuts off.
 */
static vfloat reflected_chance(vfloat cos_o, vfloat alpha, vfloat eta) {
    return vf_clamp(trc_glass_reflected_share(cos_o, alpha, eta), 0.05f, 0.95f);
}

/* Multiple-scattering glass: both lobes with the factor of the micro-normal, scaled so that they
 * keep all energy together. reflected, refracted: colours of the lobes. */
static void add_multi_glass(struct setup *c, vvec3 weight, vvec3 reflected, vvec3 refracted,
                            vvec3 n, vfloat alpha, vfloat eta) {
    /* As rough as the lobes will be: a filtered one keeps its energy too. */
    const vfloat rough = vf_max(vf_clamp(alpha, 1e-4f, 1.0f), c->filter_alpha);
    const vfloat kept = trc_glass_albedo(v3_dot(n, c->s->wo), rough, eta);
    const vfloat f = reflected_chance(v3_dot(n, c->s->wo), rough, eta);
    /* What does not get away is coloured again at every further bounce: a geometric series. */
    const vvec3 again = v3_scale(v3_lerp(refracted, reflected, f), vf_one() - kept);
    const vfloat least = vf_set(0.1f), one = vf_one();
    const vvec3 gain =
        v3(vf_rcp(vf_max(one - again.x, least)), vf_rcp(vf_max(one - again.y, least)),
           vf_rcp(vf_max(one - again.z, least)));
    const vvec3 w = v3_mul(weight, gain);
    struct trc_lobe *lobe = add_dielectric(c, TRC_LOBE_REFLECT, v3_mul(w, reflected), n, rough, eta,
                                           TRC_DISTRIBUTION_GGX);
    if (lobe) {
        lobe->fresnel = TRC_FRESNEL_DIELECTRIC;
        lobe->mix_weight = lobe->mix_weight * f;
    }
    lobe = add_dielectric(c, TRC_LOBE_REFRACT, v3_mul(w, refracted), n, rough, eta,
                          TRC_DISTRIBUTION_GGX);
    if (lobe) {
        lobe->fresnel = TRC_FRESNEL_DIELECTRIC;
        lobe->mix_weight = lobe->mix_weight * (vf_one() - f);
    }
}

/* Glass of Cycles 4: both lobes with the factor of the micro-normal, which goes from f0 to 1. */
static void add_correlated_glass(struct setup *c, vvec3 reflected, vvec3 refracted, vvec3 f0,
                                 vvec3 n, vfloat alpha, vfloat eta, uint32_t mode) {
    const vfloat cos_o = v3_dot(n, c->s->wo);
    vfloat kept = vf_one();
    if (distribution_of(mode) == TRC_LOBE_MULTI_GGX) {
        kept = vf_max(trc_correlated_glass_albedo(cos_o, alpha, eta), vf_set(0.1f));
        reflected = v3_scale(reflected, vf_rcp(kept));
        refracted = v3_scale(refracted, vf_rcp(kept));
    }
    const vfloat f = reflected_chance(cos_o, vf_max(alpha, c->filter_alpha), eta);
    struct trc_lobe *lobe = add_dielectric(c, TRC_LOBE_REFLECT, reflected, n, alpha, eta, mode);
    if (lobe) {
        lobe->fresnel = TRC_FRESNEL_BLEND;
        lobe->f0 = f0;
        lobe->f90 = v3_splat(vf_one());
        lobe->albedo_scale = kept;
        lobe->mix_weight = lobe->mix_weight * kept * f;
    }
    lobe = add_dielectric(c, TRC_LOBE_REFRACT, refracted, n, alpha, eta, mode);
    if (lobe) {
        lobe->fresnel = TRC_FRESNEL_BLEND;
        lobe->f0 = f0;
        lobe->f90 = v3_splat(vf_one());
        lobe->albedo_scale = kept;
        lobe->mix_weight = lobe->mix_weight * kept * (vf_one() - f);
    }
}

static void add_glass(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 tint = v3_scale(colour(c, leaf, 0), weight);
    const vvec3 n = leaf_normal(c, leaf, 5);
    const vfloat alpha = vf_square(number(c, leaf, 3));
    const vfloat eta = relative_ior(c, number(c, leaf, 4));
    if (leaf->mode & TRC_DISTRIBUTION_CORRELATED) {
        add_correlated_glass(c, tint, tint, v3_splat(trc_fresnel_normal(eta)), n,
                             vf_saturate(alpha), eta, leaf->mode);
        return;
    }
    if (leaf->mode == TRC_DISTRIBUTION_MULTI_GGX) {
        const vvec3 color = v3_saturate(colour(c, leaf, 0));
        add_multi_glass(c, v3_splat(weight), color, color, n, alpha, eta);
        return;
    }
    const vfloat f = trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta);
    add_dielectric(c, TRC_LOBE_REFLECT, v3_scale(tint, f), n, alpha, eta, leaf->mode);
    /* Cycles never lets the refracted part vanish altogether. */
    const vfloat through = vf_max(vf_one() - f, vf_set(1e-4f));
    add_dielectric(c, TRC_LOBE_REFRACT, v3_scale(tint, through), n, alpha, eta, leaf->mode);
}

static void add_refraction(struct setup *c, const struct trc_leaf *leaf, vfloat weight) {
    add_dielectric(c, TRC_LOBE_REFRACT, v3_scale(colour(c, leaf, 0), weight),
                   leaf_normal(c, leaf, 5), vf_square(number(c, leaf, 3)),
                   relative_ior(c, number(c, leaf, 4)), leaf->mode);
}

#endif
