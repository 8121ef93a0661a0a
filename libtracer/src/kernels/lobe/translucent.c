/* Translucency: diffuse light from the other side. */
#include "kernels/lobe/matt.h"

static struct lobe_value value(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi) {
    const vfloat cos_i = -v3_dot(lobe->n, wi), f = cosine_density(cos_i);
    return matt_value(lobe, s, wi, cos_i, f, f);
}

static vvec3 direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    (void)s, (void)chosen_at;
    *crosses = *alive;
    vvec3 a, b;
    const vvec3 n = v3_neg(lobe->n);
    v3_frame(n, &a, &b);
    return v3_from_frame(trc_warp_cosine(u1, u2), a, b, n);
}

static void add_translucent(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model model = {
        .kind = TRC_LOBE_TRANSLUCENT, .value = value, .direction = direction};
    trc_add_matt(c, &model, v3_scale(colour(c, leaf, TRC_AT(TRANSLUCENT, color)), weight),
                 trc_matt_normal(c, leaf, TRC_AT(TRANSLUCENT, normal)), vf_zero());
}

const struct trc_closure TRC_CLOSURE_OF(TRANSLUCENT) = {.add = add_translucent};
