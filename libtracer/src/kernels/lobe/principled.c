/* Principled of Blender 3.4: diffuse and sheen, reflection, glass, clearcoat.
 *
 * Departure from Cycles: subsurface scattering is the diffuse lobe with the mixed colour. */
#include "kernels/lobe/facets.h"

/* Reflectance at normal incidence where Specular is 1 (Burley 2012). */
#define SPECULAR_SCALE 0.08f
/* Roughness from which Cycles follows light that scatters more than once. */
#define MULTIPLE_FROM 0.075f
#define MULTIPLE_GLASS_FROM 0.05f

static vvec3 mix_white(vvec3 tint, vfloat amount) {
    return v3_lerp(v3_splat(vf_one()), tint, amount);
}

/* Colour without its brightness; white for black. */
static vvec3 hue_of(vvec3 base, vfloat brightness) {
    const vmask lit = vf_gt(brightness, vf_zero());
    const vfloat inverse = vf_divide(vf_one(), brightness);
    return v3_select(lit, v3_scale(base, inverse), v3_splat(vf_one()));
}

static void principled_diffuse(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                               vvec3 n, vfloat diffuse_weight) {
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    vvec3 tint = base;
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, subsurface)))
        tint = v3_lerp(base, colour(c, leaf, TRC_AT(PRINCIPLED, subsurface_color)),
                       number(c, leaf, TRC_AT(PRINCIPLED, subsurface)));
    const vmask kept = vf_gt(diffuse_weight, vf_set(TRC_WEIGHT_CUTOFF));
    const vfloat w = vf_where(kept, weight * diffuse_weight);
    trc_add_burley(c, v3_scale(tint, w), n, number(c, leaf, TRC_AT(PRINCIPLED, roughness)));
    if (!may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, sheen)))
        return;
    const vvec3 hue = hue_of(base, v3_luminance(base));
    const vvec3 sheen = mix_white(hue, number(c, leaf, TRC_AT(PRINCIPLED, sheen_tint)));
    trc_add_schlick_sheen(c, v3_scale(sheen, w * number(c, leaf, TRC_AT(PRINCIPLED, sheen))), n);
}

static void principled_specular(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                                vvec3 n, vfloat metallic, vfloat specular_weight) {
    const vfloat specular = number(c, leaf, TRC_AT(PRINCIPLED, specular));
    const vfloat cutoff = vf_set(TRC_WEIGHT_CUTOFF);
    const vmask kept = vm_and(vf_gt(specular_weight, cutoff),
                              vm_or(vf_gt(specular, cutoff), vf_gt(metallic, cutoff)));
    struct trc_lobe *lobe =
        trc_add_reflection(c, v3_splat(vf_where(kept, weight * specular_weight)));
    if (!lobe)
        return;
    const vfloat roughness = number(c, leaf, TRC_AT(PRINCIPLED, roughness)),
                 alpha = roughness * roughness;
    lobe->n = n;
    lobe->ior =
        vf_set(2.0f) / (vf_one() - vf_safe_sqrt(vf_set(SPECULAR_SCALE) * specular)) - vf_one();
    lobe->alpha_x = lobe->alpha_y = alpha;
    const struct trc_operand *twist = input(c, leaf, TRC_AT(PRINCIPLED, anisotropic));
    lobe->anisotropic = twist->reg >= 0 || twist->value != 0.0f;
    if (lobe->anisotropic) {
        const vfloat aspect = aspect_of(trc_operand_value(twist, c->regs));
        lobe->alpha_x = alpha / aspect;
        lobe->alpha_y = alpha * aspect;
        lobe->tangent = trc_leaf_tangent(c, leaf, TRC_AT(PRINCIPLED, tangent), n,
                                         number(c, leaf, TRC_AT(PRINCIPLED, anisotropic_rotation)));
    }
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    vvec3 dielectric = v3_splat(vf_set(SPECULAR_SCALE) * specular);
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, specular_tint))) {
        const vfloat bright = vf_set(0.3f) * base.x + vf_set(0.6f) * base.y + vf_set(0.1f) * base.z;
        const vvec3 tint =
            mix_white(hue_of(base, bright), number(c, leaf, TRC_AT(PRINCIPLED, specular_tint)));
        dielectric = v3_mul(tint, dielectric);
    }
    const vvec3 f0 = v3_saturate(v3_lerp(dielectric, base, metallic));
    /* Cycles keeps single scattering at low roughness; where lanes disagree the missing energy is
     * nil. */
    const bool multiple = leaf->mode == TRC_DISTRIBUTION_MULTI_GGX &&
                          vm_any(vm_and(c->s->active, vf_gt(roughness, vf_set(MULTIPLE_FROM))));
    lobe->distribution = multiple ? TRC_LOBE_MULTI_GGX : TRC_LOBE_GGX;
    trc_facets_finish(c, lobe, false);
    set_overshoot(c, lobe, f0, v3_splat(vf_one()));
    if (multiple)
        trc_facets_set_multiple(lobe, c->s->wo,
                                v3_lerp(f0, v3_splat(vf_one()), mean_blend(lobe->ior)), true);
}

static void principled_glass(struct trc_setup *c, const struct trc_leaf *leaf, vvec3 glass,
                             vvec3 n) {
    const vvec3 base = colour(c, leaf, TRC_AT(PRINCIPLED, base_color));
    const vfloat roughness = number(c, leaf, TRC_AT(PRINCIPLED, roughness)),
                 alpha = roughness * roughness;
    const vfloat eta = trc_relative_ior(c, number(c, leaf, TRC_AT(PRINCIPLED, ior)));
    const vvec3 f0 =
        v3_saturate(mix_white(base, number(c, leaf, TRC_AT(PRINCIPLED, specular_tint))));
    if (leaf->mode == TRC_DISTRIBUTION_MULTI_GGX &&
        vm_any(vm_and(c->s->active, vf_gt(roughness, vf_set(MULTIPLE_GLASS_FROM))))) {
        const vfloat blend = trc_fresnel_blend(v3_dot(n, c->s->wo), eta);
        trc_add_multi_glass(c, glass, v3_lerp(f0, v3_splat(vf_one()), blend), v3_saturate(base),
                            glass, n, alpha, eta);
        return;
    }
    const vfloat f = trc_reflected_part(trc_fresnel_dielectric(v3_dot(n, c->s->wo), eta));
    struct trc_lobe *lobe = trc_add_dielectric(c, TRC_LOBE_REFLECT, v3_scale(glass, f), n, alpha,
                                               eta, TRC_DISTRIBUTION_GGX);
    if (lobe)
        set_overshoot(c, lobe, f0, v3_splat(vf_one()));
    vfloat through = roughness;
    if (leaf->mode != TRC_DISTRIBUTION_MULTI_GGX)
        through =
            vf_one() - (vf_one() - roughness) *
                           (vf_one() - number(c, leaf, TRC_AT(PRINCIPLED, transmission_roughness)));
    const vvec3 weight = v3_scale(v3_mul(base, glass), vf_one() - f);
    trc_add_dielectric(c, TRC_LOBE_REFRACT, weight, n, through * through, eta,
                       TRC_DISTRIBUTION_GGX);
}

static void principled_clearcoat(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vfloat coat = number(c, leaf, TRC_AT(PRINCIPLED, clearcoat));
    const vmask kept = vf_gt(coat, vf_set(TRC_WEIGHT_CUTOFF));
    trc_add_clearcoat(c, v3_splat(vf_where(kept, weight)),
                      trc_leaf_normal(c, leaf, TRC_AT(PRINCIPLED, clearcoat_normal)),
                      number(c, leaf, TRC_AT(PRINCIPLED, clearcoat_roughness)), coat);
}

static void add_principled(struct trc_setup *c, const struct trc_leaf *leaf, vfloat whole) {
    vfloat weight = whole;
    const struct trc_operand *alpha = input(c, leaf, TRC_AT(PRINCIPLED, alpha));
    if (alpha->reg >= 0 || alpha->value < 1.0f) {
        const vfloat opacity = vf_saturate(trc_operand_value(alpha, c->regs));
        weight = whole * opacity;
        trc_add_transparent(c, v3_splat(whole - weight));
    }
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(PRINCIPLED, normal));
    const vfloat metallic = vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, metallic)));
    const vfloat transmission =
        vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, transmission))) * (vf_one() - metallic);
    const vfloat diffuse_weight =
        (vf_one() - metallic) *
        (vf_one() - vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, transmission))));
    principled_diffuse(c, leaf, weight, n, diffuse_weight);
    principled_specular(c, leaf, weight, n, number(c, leaf, TRC_AT(PRINCIPLED, metallic)),
                        vf_one() - transmission);
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, transmission))) {
        const vmask kept = vf_gt(transmission, vf_set(TRC_WEIGHT_CUTOFF));
        principled_glass(c, leaf, v3_splat(vf_where(kept, weight * transmission)), n);
    }
    if (may_exceed_zero(c, leaf, TRC_AT(PRINCIPLED, clearcoat)))
        principled_clearcoat(c, leaf, weight);
}

static bool emission_of(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                        vvec3 *emission) {
    const struct trc_operand *strength = input(c, leaf, TRC_AT(PRINCIPLED, emission_strength));
    if (strength->reg < 0 && strength->value == 0.0f)
        return false;
    const vfloat opacity = vf_saturate(number(c, leaf, TRC_AT(PRINCIPLED, alpha)));
    *emission = v3_scale(colour(c, leaf, TRC_AT(PRINCIPLED, emission)),
                         trc_operand_value(strength, c->regs) * weight * opacity);
    return true;
}

const struct trc_closure TRC_CLOSURE_OF(PRINCIPLED) = {.add = add_principled,
                                                       .emission = emission_of};
