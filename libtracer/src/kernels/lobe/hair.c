/* The Hair shader: reflection and transmission of fibres, each a product of a distribution along
 * the strand and one around it, after the first two lobes of S. Marschner, H. W. Jensen, M.
 * Cammarano, S. Worley and P. Hanrahan, "Light Scattering from Human Hair Fibers" (2003): Cauchy's
 * along it, a cosine around it for reflection, Cauchy's for transmission.
 *
 * As in Cycles samples reach directions that are dark to samples of lights, and their density is
 * told wider than it is where a reflection is narrow around the strand.
 *
 * Of its lobes alpha_x is the width along the strand, alpha_y that around it, roughness the offset,
 * the tangent is along the strand; f0: where Cauchy's distribution along it begins, the width of
 * its angles, and those of Cauchy's around it, in its own angles. */
#include "kernels/lobe/lobe.h"

/* Both roughnesses are at least this (Cycles). */
#define MIN_WIDTH 1e-3f
/* Directions this near to the strand's have no light, in radians (Cycles). */
#define ALONG_STRAND 1e-3f

/* A direction about the strand: its angle to what is upright on it, and to wo around it. */
struct fibre_angles {
    vfloat theta, phi, cos_theta;
    vmask upright; /* not along the strand */
};

static vfloat inclination(vvec3 tangent, vvec3 w) {
    const vfloat sine = vf_clamp(v3_dot(tangent, w), -1.0f, 1.0f);
    return vf_asin(sine);
}

static struct fibre_angles angles_of(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi) {
    const vvec3 t = lobe->tangent;
    const vfloat sine = vf_clamp(v3_dot(t, wi), -1.0f, 1.0f);
    const vvec3 across_i = v3_normalize(v3_sub(wi, v3_scale(t, sine)));
    const vvec3 across_o = v3_normalize(v3_sub(wo, v3_scale(t, v3_dot(t, wo))));
    const vfloat cos_phi = vf_clamp(v3_dot(across_i, across_o), -1.0f, 1.0f);
    struct fibre_angles a = {.theta = vf_asin(sine), .phi = vf_acos(cos_phi)};
    a.cos_theta = vf_safe_sqrt(vf_one() - sine * sine);
    a.upright = vf_gt(vf_set(TRC_HALF_PI) - vf_abs(a.theta), vf_set(ALONG_STRAND));
    return a;
}

/* Density along the strand, over the cosine that makes it one of directions. */
static vfloat density_along(const struct trc_lobe *lobe, vvec3 wo, const struct fibre_angles *a) {
    const vfloat half = vf_set(0.5f) * (a->theta + inclination(lobe->tangent, wo));
    const vfloat t = half - lobe->roughness, width = lobe->alpha_x;
    const vfloat two = vf_set(2.0f);
    return vf_divide(width, two * (t * t + width * width) * lobe->f0.y * a->cos_theta);
}

static struct lobe_value lobe_value_of(const struct trc_lobe *lobe, vmask lit, vfloat density) {
    const vfloat pdf = vf_where(lit, density);
    return (struct lobe_value){v3_scale(lobe->weight, pdf), pdf, pdf, pdf};
}

/* Around the strand; phi: the angle that a cosine is taken of half of, at most half a turn. */
static vfloat reflected_around(const struct trc_lobe *lobe, vfloat phi) {
    const vfloat half = vf_set(0.5f) * vf_min(phi, vf_set(TRC_PI));
    return vf_cos(half) * vf_set(0.25f) / lobe->alpha_y;
}

static struct lobe_value reflection_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                          vvec3 wi) {
    const struct fibre_angles a = angles_of(lobe, s->wo, wi);
    const vmask front = vf_le(a.phi, vf_set(TRC_HALF_PI));
    const vmask above = vf_ge(v3_dot(lobe->n, wi), vf_zero());
    const vfloat around = reflected_around(lobe, a.phi / lobe->alpha_y);
    return lobe_value_of(lobe, vm_and(a.upright, vm_and(front, above)),
                         around * density_along(lobe, s->wo, &a));
}

static struct lobe_value reflection_sampled(const struct trc_lobe *lobe,
                                            const struct trc_surface *s, vvec3 wi,
                                            const struct trc_draw *draw) {
    (void)draw;
    const struct fibre_angles a = angles_of(lobe, s->wo, wi);
    return lobe_value_of(lobe, a.upright,
                         reflected_around(lobe, a.phi) * density_along(lobe, s->wo, &a));
}

static vfloat transmitted_density(const struct trc_lobe *lobe, vvec3 wo,
                                  const struct fibre_angles *a) {
    const vfloat p = vf_set(TRC_PI) - a->phi, width = lobe->alpha_y;
    const vfloat around = width / (lobe->f0.z * (p * p + width * width));
    return around * density_along(lobe, wo, a);
}

static struct lobe_value transmission_value(const struct trc_lobe *lobe,
                                            const struct trc_surface *s, vvec3 wi) {
    const struct fibre_angles a = angles_of(lobe, s->wo, wi);
    const vmask below = vf_lt(v3_dot(lobe->n, wi), vf_zero());
    return lobe_value_of(lobe, vm_and(a.upright, below), transmitted_density(lobe, s->wo, &a));
}

static struct lobe_value transmission_sampled(const struct trc_lobe *lobe,
                                              const struct trc_surface *s, vvec3 wi,
                                              const struct trc_draw *draw) {
    (void)draw;
    const struct fibre_angles a = angles_of(lobe, s->wo, wi);
    return lobe_value_of(lobe, a.upright, transmitted_density(lobe, s->wo, &a));
}

/* The direction at an angle phi around the strand from wo, and along it by the density. */
static vvec3 turned(const struct trc_lobe *lobe, vvec3 wo, vfloat u, vfloat phi) {
    const vvec3 t = lobe->tangent;
    const vvec3 y = v3_normalize(v3_sub(wo, v3_scale(t, v3_dot(t, wo)))), x = v3_cross(y, t);
    const vfloat away = lobe->alpha_x * vf_tan(u * lobe->f0.y + lobe->f0.x);
    const vfloat theta = vf_set(2.0f) * (away + lobe->roughness) - inclination(t, wo);
    vfloat sine, cosine, sin_phi, cos_phi;
    vf_sincos(theta, &sine, &cosine);
    vf_sincos(phi, &sin_phi, &cos_phi);
    return v3_mad(t, sine, v3_scale(v3_sub(v3_scale(y, cos_phi), v3_scale(x, sin_phi)), cosine));
}

static vvec3 reflection_direction(const struct trc_lobe *lobe, const struct trc_surface *s,
                                  vfloat u1, vfloat u2, vfloat chosen_at, vmask *alive,
                                  vmask *crosses) {
    (void)chosen_at, (void)alive;
    *crosses = vm_none();
    const vfloat phi = vf_asin(vf_one() - vf_set(2.0f) * u2) * vf_set(2.0f) * lobe->alpha_y;
    return turned(lobe, s->wo, u1, phi);
}

static vvec3 transmission_direction(const struct trc_lobe *lobe, const struct trc_surface *s,
                                    vfloat u1, vfloat u2, vfloat chosen_at, vmask *alive,
                                    vmask *crosses) {
    (void)chosen_at;
    *crosses = *alive;
    const vfloat p = lobe->alpha_y * vf_tan(lobe->f0.z * (u2 - vf_set(0.5f)));
    return turned(lobe, s->wo, u1, p + vf_set(TRC_PI));
}

static void add_hair(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model reflection = {.kind = TRC_LOBE_HAIR_REFLECT,
                                                     .value = reflection_value,
                                                     .sampled = reflection_sampled,
                                                     .direction = reflection_direction};
    static const struct trc_lobe_model transmission = {.kind = TRC_LOBE_HAIR_TRANSMIT,
                                                       .value = transmission_value,
                                                       .sampled = transmission_sampled,
                                                       .direction = transmission_direction};
    const bool reflects = leaf->mode == TRC_HAIR_REFLECTION;
    struct trc_lobe *lobe = trc_add_lobe(c, reflects ? &reflection : &transmission,
                                         v3_scale(colour(c, leaf, TRC_AT(HAIR, color)), weight));
    if (!lobe)
        return;
    const struct trc_surface *s = c->s;
    c->out->rare |= TRC_LOBES_HAIR;
    lobe->n = trc_default_normal(c);
    lobe->cos_o = v3_dot(lobe->n, s->wo);
    lobe->roughness = -number(c, leaf, TRC_AT(HAIR, offset));
    vvec3 tangent;
    if (is_unlinked(c, leaf, TRC_AT(HAIR, tangent))) {
        vvec3 first;
        trc_surface_sides(s, &first, &tangent);
        lobe->roughness = vf_where(trc_on_strand(s), lobe->roughness);
    } else {
        tangent = colour(c, leaf, TRC_AT(HAIR, tangent));
    }
    lobe->tangent = v3_normalize(tangent);
    lobe->alpha_x = vf_clamp(number(c, leaf, TRC_AT(HAIR, roughness_u)), MIN_WIDTH, 1.0f);
    lobe->alpha_y = vf_clamp(number(c, leaf, TRC_AT(HAIR, roughness_v)), MIN_WIDTH, 1.0f);
    const vfloat quarter = vf_set(TRC_HALF_PI), half = vf_set(0.5f);
    const vfloat theta = inclination(lobe->tangent, s->wo);
    const vfloat end = vf_atan(((quarter + theta) * half - lobe->roughness) / lobe->alpha_x);
    const vfloat begin = vf_atan(((theta - quarter) * half - lobe->roughness) / lobe->alpha_x);
    lobe->f0 = v3(begin, end - begin, vf_set(2.0f) * vf_atan(quarter / lobe->alpha_y));
}

const struct trc_closure TRC_CLOSURE_OF(HAIR) = {.add = add_hair};
