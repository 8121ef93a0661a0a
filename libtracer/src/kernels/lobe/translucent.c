/* Translucency: diffuse light from the other side. */
#include "kernels/lobe/matt.h"

/* Cosine between normals from which they are taken for the same. */
#define STRAIGHT 0.99999f

static struct lobe_value value(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi) {
    const vfloat cos_i = -v3_dot(lobe->n, wi), f = cosine_density(cos_i);
    return matt_value(lobe, s, wi, cos_i, f, f);
}

/* As in Cycles, bumps leave no shadow on what is sampled, and what would stay on this side of the
 * triangle is lost. */
static struct lobe_value sampled(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                                 const struct trc_draw *draw) {
    (void)draw;
    const vfloat cos_i = -v3_dot(lobe->n, wi), f = cosine_density(cos_i);
    return value_where(vf_lt(v3_dot(s->ng, wi), vf_zero()), upper_value(lobe, cos_i, f, f));
}

static vvec3 direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    (void)chosen_at;
    vvec3 a, b;
    const vvec3 n = v3_neg(lobe->n);
    v3_frame(n, &a, &b);
    const vvec3 wi = v3_from_frame(trc_warp_cosine(u1, u2), a, b, n);
    *crosses = *alive;
    *alive = vm_and(*alive, vf_lt(v3_dot(s->ng, wi), vf_zero()));
    return wi;
}

static void add_translucent(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model model = {
        .kind = TRC_LOBE_TRANSLUCENT, .value = value, .sampled = sampled, .direction = direction};
    /* As facets have it: Cycles turns it until it reflects. */
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(TRANSLUCENT, normal));
    trc_add_matt(c, &model, v3_scale(colour(c, leaf, TRC_AT(TRANSLUCENT, color)), weight), n,
                 vf_zero());
    if (vm_any(vm_and(c->s->active, vf_lt(v3_dot(n, c->s->ng), vf_set(STRAIGHT)))))
        c->out->rare |= TRC_LOBES_BENT;
}

const struct trc_closure TRC_CLOSURE_OF(TRANSLUCENT) = {.add = add_translucent};
