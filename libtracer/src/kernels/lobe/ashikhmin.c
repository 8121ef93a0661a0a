/* Reflection by the distribution of Ashikhmin and Shirley, one of the Glossy shader's. */
#include "kernels/lobe/facets.h"

static struct lobe_value ashikhmin_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                         vvec3 wi) {
    struct meeting at;
    if (!meet(lobe, s->wo, wi, &at))
        return no_value();
    const vfloat density = trc_ashikhmin_lobe(at.h.local, lobe->alpha_x, lobe->alpha_y) /
                           vf_max(at.cos_h, vf_set(MIN_COSINE));
    const vfloat f = density * at.cos_i / vf_max(vf_max(at.cos_i, lobe->cos_o), vf_set(MIN_COSINE));
    const vfloat pdf = vf_where(at.m, density);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(at.m, f)), pdf, pdf, pdf};
}

struct trc_lobe *trc_add_ashikhmin(struct trc_setup *c, vvec3 weight) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_REFLECT,
                                                .has_facets = true,
                                                .value = ashikhmin_value,
                                                .direction = TRC_KERNEL(trc_facets_direction)};
    return trc_add_lobe(c, &model, weight);
}
