/* The clearcoat of Principled in Blender 3.4. */
#include "kernels/lobe/facets.h"

/* As Burley (2012): alpha of the masking, index, and its reflectance at normal incidence. */
#define MASKING_ALPHA 0.25f
#define CLEARCOAT_IOR 1.5f
#define CLEARCOAT_F0 0.04f

/* Clearcoat: D of GTR1, masking of GGX. Cycles samples it as GGX and claims GTR1. */
static struct lobe_value clearcoat_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                         vvec3 wi) {
    struct meeting at;
    if (!meet(lobe, s->wo, wi, &at))
        return no_value();
    const vfloat d = trc_gtr1_d(at.h.sin2_m, lobe->alpha_x);
    const vfloat alpha2 = vf_set(MASKING_ALPHA * MASKING_ALPHA);
    const vfloat co2 = lobe->cos_o * lobe->cos_o, ci2 = at.cos_i * at.cos_i;
    const vfloat g_o = trc_ggx_g1(vf_max(alpha2 * (vf_one() - co2) / co2, vf_zero()));
    const vfloat g_i = trc_ggx_g1(vf_max(alpha2 * (vf_one() - ci2) / ci2, vf_zero()));
    const vfloat quarter = vf_set(0.25f) / lobe->cos_o;
    const vfloat claim = vf_where(at.m, g_o * d * quarter);
    const vfloat sampled_d = trc_ggx_d(at.h.e, at.h.cos_m, lobe->alpha_x * lobe->alpha_y);
    return (struct lobe_value){
        v3_mul(v3_scale(lobe->weight, claim * g_i), facet_fresnel(lobe, at.cos_h)),
        vf_where(at.m, sampled_d * lobe->pdf_scale),
        vf_where(at.m, sampled_d * lobe->g1_o * quarter), claim};
}

void trc_add_clearcoat(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness, vfloat coat) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_REFLECT,
                                                .has_facets = true,
                                                .value = clearcoat_value,
                                                .direction = TRC_KERNEL(trc_facets_direction)};
    struct trc_lobe *lobe = trc_add_lobe(c, &model, weight);
    if (!lobe)
        return;
    lobe->distribution = TRC_LOBE_GTR1;
    lobe->n = n;
    lobe->ior = vf_set(CLEARCOAT_IOR);
    lobe->alpha_x = lobe->alpha_y = vf_square(roughness);
    trc_facets_finish(c, lobe, false);
    const vfloat quarter = vf_set(0.25f) * coat;
    set_overshoot(c, lobe, v3_splat(vf_set(CLEARCOAT_F0) * quarter), v3_splat(quarter));
}
