/* Sampling and setting up lobes of microfacets. */
#include "kernels/lobe/facets.h"

vvec3 trc_facets_direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                           vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    vvec3 a, b;
    if (lobe->kind != TRC_LOBE_REFLECT)
        *crosses = *alive;
    if (lobe->anisotropic) {
        a = lobe->tangent;
        b = v3_cross(lobe->n, a);
    } else {
        v3_frame(lobe->n, &a, &b);
    }
    const vvec3 wo = v3_to_frame(s->wo, a, b, lobe->n);
    const vfloat ax = lobe->alpha_x, ay = lobe->alpha_y;
    vmask spread = vm_none();
    vfloat u = u1;
    if (lobe->distribution == TRC_LOBE_MULTI_GGX) {
        /* Part of the first number chooses the lobe of the missing energy. */
        const vfloat chance = lobe->multi_chance;
        spread = vf_lt(u1, chance);
        u = vf_select(spread, vf_divide(u1, chance), (u1 - chance) / (vf_one() - chance));
    }
    vvec3 m;
    if (lobe->distribution == TRC_LOBE_BECKMANN) {
        m = trc_beckmann_sample(wo, ax, ay, u1, u2);
    } else if (lobe->distribution == TRC_LOBE_ASHIKHMIN) {
        m = trc_ashikhmin_sample(ax, ay, u1, u2);
    } else {
        vfloat bound = vf_one();
        if (lobe->kind == TRC_LOBE_REFLECT)
            bound =
                vf_select(vm_or(lobe->paired, *crosses), bound, trc_ggx_bound(lobe->cos_o, ax, ay));
        m = trc_ggx_sample(wo, ax, ay, bound, u, u2);
    }
    if (vm_any(lobe->paired)) {
        const vfloat chance = pair_chance(lobe, v3_dot(wo, m));
        const vmask up = vf_lt(chosen_at, chance * lobe->sample_weight);
        *crosses = vm_select(lobe->paired, vm_andnot(*alive, up), *crosses);
    }
    vvec3 wi = v3_reflect(wo, m);
    vmask seen = vm_or(spread, vf_gt(v3_dot(wo, m), vf_zero()));
    if (vm_any(spread))
        wi = v3_select(spread, trc_warp_cosine(u, u2), wi);
    seen = vm_and(seen, vf_gt(wi.z, vf_zero()));
    if (vm_any(*crosses)) {
        vvec3 bent;
        const vmask passes = trc_refract(wo, m, lobe->ior, &bent);
        seen = vm_select(*crosses, vm_and(passes, vf_lt(bent.z, vf_zero())), seen);
        wi = v3_select(*crosses, bent, wi);
    }
    *alive = vm_and(*alive, seen);
    return v3_from_frame(wi, a, b, lobe->n);
}

/* Lanes that scatter into one direction. */
static void set_ideal(struct trc_lobe *lobe) {
    const vfloat ax = lobe->alpha_x, ay = lobe->alpha_y;
    lobe->ideal = lobe->distribution == TRC_LOBE_ASHIKHMIN
                      ? vf_le(vf_max(ax, ay), vf_set(MIN_ALPHA))
                      : vf_le(ax * ay, vf_set(TRC_SINGULAR_ALPHA2));
    if (lobe->kind == TRC_LOBE_REFRACT)
        lobe->ideal =
            vm_or(lobe->ideal, vf_lt(vf_abs(lobe->ior - vf_one()), vf_set(NO_REFRACTION)));
}

/* Density of a direction over D of its half vector, of GGX. */
static vfloat ggx_pdf_scale(const struct trc_lobe *lobe) {
    const vfloat cos_o = vf_max(lobe->cos_o, vf_set(MIN_COSINE));
    const vfloat whole = vf_set(2.0f) / lobe->g1_o;
    const vfloat bound = lobe->kind == TRC_LOBE_REFLECT
                             ? trc_ggx_bound(cos_o, lobe->alpha_x, lobe->alpha_y)
                             : vf_one();
    return vf_set(0.5f) / (cos_o * (bound + whole - vf_one()));
}

void trc_facets_finish(const struct trc_setup *c, struct trc_lobe *lobe, bool is_sharp) {
    const vfloat minimum =
        vf_set(lobe->distribution == TRC_LOBE_ASHIKHMIN || lobe->distribution == TRC_LOBE_MULTI_GGX
                   ? MIN_ALPHA
                   : 0.0f);
    if (is_sharp) {
        lobe->alpha_x = lobe->alpha_y = lobe->mean_alpha = vf_zero();
    } else {
        const vfloat x = vf_min(vf_max(lobe->alpha_x, minimum), vf_one());
        const vfloat y = vf_min(vf_max(lobe->alpha_y, minimum), vf_one());
        lobe->mean_alpha = lobe->anisotropic ? vf_sqrt(x * y) : x;
        lobe->alpha_x = vf_max(x, c->filter_alpha);
        lobe->alpha_y = vf_max(y, c->filter_alpha);
    }
    const vfloat ax = lobe->alpha_x, ay = lobe->alpha_y;
    set_ideal(lobe);
    const vfloat cos_o = vf_max(v3_dot(lobe->n, c->s->wo), vf_set(MIN_COSINE));
    /* Densities and values have to agree about it. */
    lobe->cos_o =
        vf_select(vf_gt(v3_dot(lobe->n, c->s->wo), vf_zero()), cos_o, v3_dot(lobe->n, c->s->wo));
    vfloat tan2 = ax * ax * (vf_one() - cos_o * cos_o) / (cos_o * cos_o);
    if (lobe->anisotropic) {
        const vfloat x = v3_dot(lobe->tangent, c->s->wo) * ax;
        const vfloat y = v3_dot(v3_cross(lobe->n, lobe->tangent), c->s->wo) * ay;
        tan2 = (x * x + y * y) / (cos_o * cos_o);
    }
    tan2 = vf_max(tan2, vf_zero());
    if (lobe->distribution == TRC_LOBE_BECKMANN) {
        lobe->g1_o = trc_beckmann_g1(tan2);
        lobe->pdf_scale = trc_beckmann_g1_exact(tan2) * vf_set(0.25f) / cos_o;
        return;
    }
    lobe->g1_o = trc_ggx_g1(tan2);
    lobe->pdf_scale = ggx_pdf_scale(lobe);
}

void trc_facets_finish_twin(struct trc_lobe *lobe, const struct trc_lobe *of) {
    lobe->alpha_x = of->alpha_x;
    lobe->alpha_y = of->alpha_y;
    lobe->mean_alpha = of->mean_alpha;
    lobe->cos_o = of->cos_o;
    lobe->g1_o = of->g1_o;
    lobe->pdf_scale = lobe->distribution == TRC_LOBE_BECKMANN ? of->pdf_scale : ggx_pdf_scale(lobe);
    set_ideal(lobe);
}

void trc_facets_set_multiple(struct trc_lobe *lobe, vvec3 wo, vvec3 per_bounce, bool is_first) {
    const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y);
    const vfloat kept = trc_ggx_mean_albedo(alpha), lost = vf_one() - kept;
    vfloat missing = vf_one() - trc_ggx_albedo(lobe->cos_o, alpha);
    if (lobe->anisotropic) {
        const vvec3 bitangent = v3_cross(lobe->n, lobe->tangent);
        const vvec3 local = v3_to_frame(wo, lobe->tangent, bitangent, lobe->n);
        missing = vf_one() - trc_ggx_anisotropic_albedo(local, lobe->alpha_x, lobe->alpha_y);
    }
    const vfloat scale = vf_select(vf_gt(lost, vf_set(1e-6f)),
                                   missing * vf_set(TRC_INV_PI) * kept / lost, vf_zero());
    vvec3 f = v3(per_bounce.x / (vf_one() - per_bounce.x * lost),
                 per_bounce.y / (vf_one() - per_bounce.y * lost),
                 per_bounce.z / (vf_one() - per_bounce.z * lost));
    if (is_first)
        f = v3_mul(f, per_bounce);
    lobe->multi_weight = v3_scale(f, scale);
    lobe->multi_chance = missing;
}

vvec3 trc_facets_gain(vfloat cos_o, vfloat alpha, vvec3 per_bounce, vfloat *single_out) {
    const vfloat one = vf_one();
    const vfloat single = vf_max(trc_ggx_albedo(cos_o, alpha), vf_set(1e-3f));
    const vfloat missing = (one - single) / single;
    const vvec3 again = colour_of_bounces(per_bounce, trc_ggx_mean_albedo(alpha));
    *single_out = single;
    return v3_mad(again, missing, v3_splat(one));
}

void trc_facets_keep_energy(struct trc_lobe *lobe, vvec3 per_bounce) {
    vfloat single;
    const vvec3 gain = trc_facets_gain(lobe->cos_o, lobe->mean_alpha, per_bounce, &single);
    lobe->distribution = TRC_LOBE_GGX;
    lobe->weight = v3_mul(lobe->weight, gain);
    lobe->albedo_scale = single;
    lobe->mix_weight = lobe->mix_weight * v3_average(gain) * single;
}
