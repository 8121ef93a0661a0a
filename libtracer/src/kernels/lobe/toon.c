/* Toon: light from within a cone, about the normal or about the mirror direction. */
#include "kernels/lobe/matt.h"

/* Light from within an angle of the lobe's axis, fading beyond, none outside of the whole cone, as
 * in Cycles 4; cosine: to the axis. *pdf: of directions spread evenly over all of that cone. */
TRC_INLINE vfloat toon(const struct trc_lobe *lobe, vfloat cosine, vfloat *pdf) {
    const vfloat fade = lobe->f0.y, over = vf_acos(cosine) - lobe->f0.x;
    const vfloat soft = vf_saturate(vf_one() - vf_divide(over, fade));
    const vfloat light =
        vf_select(vf_lt(over, vf_zero()), vf_one(), vf_where(vf_gt(fade, vf_zero()), soft));
    const vfloat density = vf_divide(vf_set(0.5f * TRC_INV_PI), vf_one() - lobe->f0.z);
    *pdf = vf_where(vf_ge(cosine, lobe->f0.z), density);
    return *pdf * light;
}

static struct lobe_value diffuse_toon_value(const struct trc_lobe *lobe,
                                            const struct trc_surface *s, vvec3 wi) {
    vfloat pdf;
    const vfloat cos_i = v3_dot(lobe->n, wi), f = toon(lobe, cos_i, &pdf);
    return matt_value(lobe, s, wi, cos_i, f, pdf);
}

static struct lobe_value glossy_toon_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                           vvec3 wi) {
    vmask m = vm_and(vf_gt(v3_dot(lobe->n, wi), vf_zero()), vf_gt(lobe->cos_o, vf_zero()));
    m = vm_andnot(m, lobe->ideal);
    if (!vm_any(m))
        return no_value();
    vfloat pdf;
    const vfloat f = toon(lobe, v3_dot(v3_reflect(s->wo, lobe->n), wi), &pdf);
    pdf = vf_where(m, pdf);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(m, f)), pdf, pdf, pdf};
}

/* Evenly in the cone about the mirror direction, of which what is below the surface is lost. */
static vvec3 glossy_toon_direction(const struct trc_lobe *lobe, const struct trc_surface *s,
                                   vfloat u1, vfloat u2, vfloat chosen_at, vmask *alive,
                                   vmask *crosses) {
    (void)chosen_at;
    *crosses = vm_none();
    const vvec3 axis = v3_reflect(s->wo, lobe->n);
    vvec3 a, b;
    v3_frame(axis, &a, &b);
    const vvec3 wi = v3_from_frame(trc_warp_cone(lobe->f0.z, u1, u2), a, b, axis);
    const vmask above =
        vm_and(vf_gt(lobe->cos_o, vf_zero()), vf_gt(v3_dot(lobe->n, wi), vf_zero()));
    *alive = vm_and(*alive, above);
    return wi;
}

static const struct trc_lobe_model diffuse_toon_model = {.kind = TRC_LOBE_DIFFUSE,
                                                         .value = diffuse_toon_value};
static const struct trc_lobe_model glossy_toon_model = {
    .kind = TRC_LOBE_REFLECT, .value = glossy_toon_value, .direction = glossy_toon_direction};

/* As Cycles, which limits the cone to the hemisphere. */
static void add_toon(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const bool is_glossy = leaf->mode == TRC_TOON_GLOSSY;
    struct trc_lobe *lobe = trc_add_lobe(c, is_glossy ? &glossy_toon_model : &diffuse_toon_model,
                                         v3_scale(colour(c, leaf, TRC_AT(TOON, color)), weight));
    if (!lobe)
        return;
    const vfloat quarter = vf_set(TRC_HALF_PI);
    const vfloat angle = vf_saturate(number(c, leaf, TRC_AT(TOON, size))) * quarter;
    const vfloat fade = vf_saturate(number(c, leaf, TRC_AT(TOON, smooth))) * quarter;
    const vfloat whole = vf_min(angle + fade, quarter);
    lobe->n = trc_matt_normal(c, leaf, TRC_AT(TOON, normal));
    lobe->cos_o = v3_dot(lobe->n, c->s->wo);
    lobe->ior = vf_one();
    lobe->f0 = v3(angle, fade, vf_cos(whole));
    /* How wide it spreads, for Filter Glossy. */
    lobe->alpha_x = lobe->alpha_y = whole / quarter;
    const vmask is_nothing = vf_le(whole, vf_zero());
    lobe->weight = v3_where(vm_not(is_nothing), lobe->weight);
    lobe->mix_weight = vf_where(vm_not(is_nothing), lobe->mix_weight);
}

const struct trc_closure TRC_CLOSURE_OF(TOON) = {.add = add_toon};
