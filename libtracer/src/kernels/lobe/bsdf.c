/* Evaluating and sampling lobes.
 *
 * A direction on the upper side of a reflecting lobe counts only if it is above the lobe's normal,
 * the shading normal and the geometric surface; for transmission below all three. So nothing shines
 * through a surface whose normals are bent, and evaluation and sampling have the same support.
 *
 * Departures from Cycles 3.4: a sampled direction of a toon lobe fades as an evaluated one;
 * reflections are sampled by bounded visible normals, refractions by the spherical cap; densities
 * are the true ones, where Cycles gives clearcoat the density of GTR1 and samples GGX. What that
 * does to its pictures is kept in trc_bsdf_sample.beyond. */
#include "kernels/lobe/bsdf.h"

#include "kernels/lobe/ggx_energy.h"
#include "kernels/lobe/microfacet.h"

/* Value times cosine, and three densities: of this file's sampling; of Cycles' sampling; and the
 * one that Cycles weights it with. */
struct lobe_value {
    vvec3 value;
    vfloat pdf, pick, claim;
};

TRC_INLINE struct lobe_value no_value(void) {
    return (struct lobe_value){v3_zero(), vf_zero(), vf_zero(), vf_zero()};
}

/* ---- diffuse lobes ---- */

/* Softens the terminator of normals bent by a texture: M. J.-Y. Chiang, Y. K. Li and B. Burley,
 * "Taming the Shadow Terminator" (2019). */
TRC_INLINE vfloat bump_shadowing(vvec3 n_surface, vvec3 n_lobe, vvec3 wi, vfloat cos_i) {
    const vfloat g = vf_divide(v3_dot(n_surface, wi), cos_i * v3_dot(n_surface, n_lobe));
    const vfloat g2 = g * g;
    const vfloat soft = vf_select(vf_ge(g, vf_one()), vf_one(), g + g2 - g2 * g);
    return vf_select(vf_lt(g, vf_zero()), vf_zero(), soft);
}

/* M. Oren and S. Nayar (1994) in the form of Y. Fujii, as Cycles has it. */
TRC_INLINE vfloat oren_nayar(vfloat sigma, vfloat cos_i, vfloat cos_o, vfloat cos_io) {
    const vfloat scale = vf_rcp(vf_set(TRC_PI) + vf_set((3.0f * TRC_PI - 4.0f) / 6.0f) * sigma);
    const vfloat no = vf_max(cos_o, vf_zero());
    const vfloat t = cos_io - cos_i * no;
    const vfloat high = vf_max(vf_max(cos_i, no), vf_set(1e-30f));
    const vfloat tilt = vf_select(vf_gt(t, vf_zero()), t / high, t);
    return cos_i * scale * vf_max(vf_one() + sigma * tilt, vf_zero());
}

/* Burley's diffuse lobe (2012) in the split form of 2015: Lambert and retro-reflection. */
TRC_INLINE vfloat principled_diffuse(vfloat roughness, vfloat cos_i, vfloat cos_o, vfloat cos_io) {
    const vfloat fi = trc_schlick_weight(cos_i), fo = trc_schlick_weight(cos_o);
    const vfloat half = vf_set(0.5f);
    const vfloat retro = roughness * (cos_io + vf_one());
    const vfloat lambert = (vf_one() - half * fi) * (vf_one() - half * fo);
    return cos_i * vf_set(TRC_INV_PI) *
           (lambert + retro * (fi + fo + fi * fo * (retro - vf_one())));
}

/* Albedo of Fujii's form over sigma, less that of sigma 0 (OpenPBR specification 1.1, 2024). */
TRC_INLINE vfloat oren_nayar_gain(vfloat cosine) {
    const vfloat c = vf_max(cosine, vf_set(1e-6f)), third = vf_set(2.0f / 3.0f);
    const vfloat s = vf_safe_sqrt(vf_one() - c * c);
    return s * (vf_acos(vf_min(c, vf_one())) - third - s * c) +
           third * (s / c) * (vf_one() - s * s * s);
}
/* Albedo towards a direction. */
vfloat trc_oren_nayar_albedo(vfloat sigma, vfloat cosine) {
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    return a * (vf_set(TRC_PI) + sigma * oren_nayar_gain(cosine));
}
/* Y. Fujii's other form with what scatters more than once: the first part is grey, the rest is
 * multi. */
TRC_INLINE vvec3 energy_oren_nayar(const struct trc_lobe *lobe, vfloat cos_i, vfloat cos_io) {
    const vfloat sigma = lobe->roughness, no = vf_max(lobe->cos_o, vf_zero());
    const vfloat a = vf_rcp(vf_set(TRC_PI) + vf_set(0.5f * TRC_PI - 2.0f / 3.0f) * sigma);
    const vfloat t = cos_io - cos_i * no;
    const vfloat high = vf_max(vf_max(cos_i, no), vf_set(1e-30f));
    const vfloat tilt = vf_select(vf_gt(t, vf_zero()), t / high, t);
    const vfloat once = a * (vf_one() + sigma * tilt);
    const vfloat rest = vf_one() - trc_oren_nayar_albedo(sigma, cos_i);
    return v3_scale(v3_add(v3_splat(once), v3_scale(lobe->f0, rest)), cos_i);
}

/* A cosine lobe that a linear map has drawn out: T. Zeltner, B. Burley and M. J.-Y. Chiang,
 * "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines" (2022). */
TRC_INLINE vfloat fibres(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi, vfloat cos_i) {
    const vvec3 across = v3_sub(wo, v3_scale(lobe->n, lobe->cos_o));
    const vfloat length2 = v3_dot(across, across);
    const vvec3 x = v3_scale(across, vf_divide(vf_one(), vf_sqrt(length2)));
    const vvec3 flat = v3_sub(wi, v3_scale(lobe->n, cos_i));
    const vfloat along = v3_dot(flat, x), a = lobe->f0.x, b = lobe->f0.y;
    const vfloat aside2 = vf_max(v3_dot(flat, flat) - along * along, vf_zero());
    const vfloat size2 = vf_square(a * along + b * cos_i) + a * a * aside2 + cos_i * cos_i;
    return vf_set(TRC_INV_PI) * cos_i * vf_square(vf_divide(a, size2));
}

/* M. Ashikhmin, S. Premoze and P. Shirley, "A Microfacet-Based BRDF Generator" (2000): slopes are
 * rare around the normal. */
TRC_INLINE vfloat velvet(vfloat inverse_sigma2, vfloat cos_i, vfloat cos_o, vfloat cos_m,
                         vfloat cos_mo) {
    const vfloat one = vf_one(), least = vf_set(1e-5f), c = vf_abs(cos_mo);
    const vmask valid =
        vm_and(vm_and(vf_gt(cos_o, vf_zero()), vf_gt(c, least)), vf_lt(vf_abs(cos_m), one - least));
    const vfloat ratio = vf_set(2.0f) * vf_max(vf_divide(cos_m, c), least);
    const vfloat masking = vf_min(one, ratio * vf_min(vf_abs(cos_o), vf_abs(cos_i)));
    const vfloat sin2 = vf_select(valid, one - cos_m * cos_m, one);
    const vfloat d = vf_exp(-cos_m * cos_m / sin2 * inverse_sigma2) * inverse_sigma2 *
                     vf_set(TRC_INV_PI) / (sin2 * sin2);
    return vf_where(valid, vf_set(0.25f) * d * masking / cos_o);
}

/* Light from within an angle of the lobe's axis, fading beyond; cosine: to the axis. *pdf: of
 * directions spread evenly over all of that cone. */
TRC_INLINE vfloat toon(const struct trc_lobe *lobe, vfloat cosine, vfloat *pdf) {
    const vfloat fade = lobe->f0.y, over = vf_acos(vf_max(cosine, vf_zero())) - lobe->f0.x;
    const vfloat soft = vf_saturate(vf_one() - vf_divide(over, fade));
    const vfloat light =
        vf_select(vf_lt(over, vf_zero()), vf_one(), vf_where(vf_gt(fade, vf_zero()), soft));
    const vfloat density = vf_divide(vf_set(0.5f * TRC_INV_PI), vf_one() - lobe->f0.z);
    *pdf = vf_where(vf_ge(cosine, lobe->f0.z), density);
    return density * light;
}

/* What Cycles spreads evenly over the hemisphere when it samples. */
TRC_INLINE bool is_sampled_evenly(const struct trc_lobe *lobe) {
    return lobe->kind == TRC_LOBE_DIFFUSE && (lobe->distribution == TRC_DIFFUSE_OREN_NAYAR ||
                                              lobe->distribution == TRC_DIFFUSE_VELVET);
}

TRC_INLINE struct lobe_value diffuse_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                           vvec3 wi) {
    const vfloat cos_n = v3_dot(lobe->n, wi);
    const vfloat cos_i = lobe->kind == TRC_LOBE_TRANSLUCENT ? -cos_n : cos_n;
    const vmask faces = vf_gt(cos_i, vf_zero());
    vfloat f = cos_i * vf_set(TRC_INV_PI);
    const vfloat cosine = vf_where(faces, f);
    if (lobe->kind == TRC_LOBE_SHEEN && lobe->distribution == TRC_SHEEN_FIBRES) {
        f = vf_where(vf_gt(lobe->cos_o, vf_zero()), fibres(lobe, s->wo, wi, cos_i));
    } else if (lobe->kind == TRC_LOBE_SHEEN) {
        const vvec3 h = v3_normalize(v3_add(wi, s->wo));
        f = trc_schlick_weight(v3_dot(wi, h)) * cos_i;
        f = vf_where(vf_ge(lobe->cos_o, vf_zero()), f);
    } else if (lobe->kind == TRC_LOBE_DIFFUSE && lobe->distribution == TRC_DIFFUSE_OREN_NAYAR) {
        f = oren_nayar(lobe->roughness, cos_i, lobe->cos_o, v3_dot(wi, s->wo));
    } else if (lobe->kind == TRC_LOBE_DIFFUSE && lobe->distribution == TRC_DIFFUSE_PRINCIPLED) {
        f = principled_diffuse(lobe->roughness, cos_i, lobe->cos_o, v3_dot(wi, s->wo));
    } else if (lobe->kind == TRC_LOBE_DIFFUSE && lobe->distribution == TRC_DIFFUSE_VELVET) {
        const vvec3 h = v3_normalize(v3_add(wi, s->wo));
        f = velvet(lobe->roughness, cos_i, lobe->cos_o, v3_dot(lobe->n, h), v3_dot(s->wo, h));
    }
    vfloat pdf = is_sampled_evenly(lobe) ? vf_where(faces, vf_set(0.5f * TRC_INV_PI)) : cosine;
    if (lobe->kind == TRC_LOBE_DIFFUSE && lobe->distribution == TRC_DIFFUSE_TOON) {
        f = toon(lobe, cos_i, &pdf);
        pdf = vf_where(faces, pdf);
    }
    if (lobe->kind == TRC_LOBE_SHEEN && lobe->distribution == TRC_SHEEN_FIBRES)
        pdf = vf_where(faces, f);
    const vfloat bumps = bump_shadowing(s->n, lobe->n, wi, cos_n);
    if (lobe->kind == TRC_LOBE_DIFFUSE && lobe->distribution == TRC_DIFFUSE_ENERGY_OREN_NAYAR) {
        const vvec3 value = energy_oren_nayar(lobe, cos_i, v3_dot(wi, s->wo));
        const vvec3 lit = v3_where(faces, v3_scale(value, bumps));
        return (struct lobe_value){v3_mul(lobe->weight, lit), pdf, pdf, pdf};
    }
    f = vf_where(faces, f * bumps);
    return (struct lobe_value){v3_scale(lobe->weight, f), pdf, pdf, pdf};
}

/* ---- microfacets ---- */

/* The half vector and the direction as seen from the normal. */
struct half_vector {
    vfloat cos_m; /* n . m */
    vfloat
        sin2_m; /* isotropic lobes: its sine squared; from the cross product, which keeps digits */
    vfloat e;   /* see microfacet.h */
    vfloat tan2_i; /* alpha-weighted, of wi */
    vvec3 local;   /* m in the frame, anisotropic lobes */
};

TRC_INLINE struct half_vector half_of(const struct trc_lobe *lobe, vvec3 m, vvec3 wi,
                                      vfloat cos_i) {
    struct half_vector h;
    h.cos_m = v3_dot(lobe->n, m);
    const vfloat inverse_i = vf_rcp(cos_i * cos_i);
    if (lobe->anisotropic) {
        const vvec3 bitangent = v3_cross(lobe->n, lobe->tangent);
        h.local = v3_to_frame(m, lobe->tangent, bitangent, lobe->n);
        h.e = vf_square(h.local.x / lobe->alpha_x) + vf_square(h.local.y / lobe->alpha_y);
        h.sin2_m = h.local.x * h.local.x + h.local.y * h.local.y;
        h.tan2_i = (vf_square(v3_dot(wi, lobe->tangent) * lobe->alpha_x) +
                    vf_square(v3_dot(wi, bitangent) * lobe->alpha_y)) *
                   inverse_i;
        return h;
    }
    const vvec3 across = v3_cross(lobe->n, m);
    const vfloat alpha2 = lobe->alpha_x * lobe->alpha_x;
    h.sin2_m = v3_dot(across, across);
    h.e = h.sin2_m / alpha2;
    h.tan2_i = vf_max(alpha2 * (vf_one() - cos_i * cos_i) * inverse_i, vf_zero());
    h.local = v3(vf_sqrt(h.sin2_m), vf_zero(), h.cos_m);
    return h;
}

/* Reflected part of what meets a micro-normal. */
TRC_INLINE vvec3 reflectance_of(const struct trc_lobe *lobe, vfloat cos_m) {
    if (lobe->fresnel == TRC_FRESNEL_BLEND)
        return v3_lerp(lobe->f0, lobe->f90, trc_fresnel_blend(cos_m, lobe->ior));
    if (lobe->fresnel == TRC_FRESNEL_F82) {
        const vfloat rest = vf_saturate(vf_one() - cos_m), power = trc_schlick_weight(cos_m);
        const vvec3 schlick = v3_lerp(lobe->f0, v3_splat(vf_one()), power);
        return v3_saturate(v3_sub(schlick, v3_scale(lobe->f90, cos_m * power * rest)));
    }
    if (lobe->fresnel == TRC_FRESNEL_DIELECTRIC)
        return v3_splat(trc_fresnel_dielectric(cos_m, lobe->ior));
    return v3_splat(vf_one());
}
/* The part that the lobe has of it. */
TRC_INLINE vvec3 fresnel_of(const struct trc_lobe *lobe, vfloat cos_m) {
    const vvec3 f = reflectance_of(lobe, cos_m);
    const bool is_rest = lobe->kind == TRC_LOBE_REFRACT && lobe->fresnel != TRC_FRESNEL_NONE;
    return is_rest ? v3_sub(v3_splat(vf_one()), f) : f;
}

/* Chance that a micro-normal of paired lobes reflects. */
TRC_INLINE vfloat pair_chance(const struct trc_lobe *lobe, vfloat cos_m) {
    const vfloat f = v3_average(reflectance_of(lobe, cos_m));
    return f / (f + (vf_one() - f) * lobe->pair_tint);
}
/* Densities of a lobe as those of its pair: this half is chosen in half of all cases, and then the
 * micro-normal has the say. */
TRC_INLINE void weigh_pair(const struct trc_lobe *lobe, vfloat cos_m, struct lobe_value *r) {
    if (!vm_any(lobe->paired))
        return;
    const vfloat reflects = pair_chance(lobe, cos_m);
    const vfloat own = lobe->kind == TRC_LOBE_REFRACT ? vf_one() - reflects : reflects;
    const vfloat factor = vf_select(lobe->paired, own + own, vf_one());
    r->pdf = r->pdf * factor;
    r->claim = r->claim * factor;
    r->pick = r->pick * factor;
}

/* D of GGX or Beckmann, masking of wi. */
TRC_INLINE vfloat distribution_d(const struct trc_lobe *lobe, const struct half_vector *h) {
    const vfloat alpha2 = lobe->alpha_x * lobe->alpha_y;
    if (lobe->distribution == TRC_LOBE_BECKMANN)
        return trc_beckmann_d(h->e, h->cos_m, alpha2);
    return trc_ggx_d(h->e, h->cos_m, alpha2);
}
TRC_INLINE vfloat masking(const struct trc_lobe *lobe, vfloat tan2) {
    return lobe->distribution == TRC_LOBE_BECKMANN ? trc_beckmann_g1(tan2) : trc_ggx_g1(tan2);
}

/* Masking of wo times shadowing of wi, over that of wo. With one height for both it is 1 / (1 + L_o
 * + L_i), where 1 / g1 = 1 + L. */
TRC_INLINE vfloat shadowing(const struct trc_lobe *lobe, vfloat tan2_i) {
    const vfloat g1_i = masking(lobe, tan2_i);
    if (!lobe->correlated)
        return g1_i;
    return vf_rcp(vf_one() + lobe->g1_o * (vf_rcp(g1_i) - vf_one()));
}

static struct lobe_value ashikhmin_value(const struct trc_lobe *lobe, const struct half_vector *h,
                                         vfloat cos_i, vfloat cos_h, vmask m) {
    const vfloat density =
        trc_ashikhmin_lobe(h->local, lobe->alpha_x, lobe->alpha_y) / vf_max(cos_h, vf_set(1e-6f));
    const vfloat f = density * cos_i / vf_max(vf_max(cos_i, lobe->cos_o), vf_set(1e-6f));
    const vfloat pdf = vf_where(m, density);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(m, f)), pdf, pdf, pdf};
}

/* Clearcoat: D of GTR1, masking of GGX with alpha 1/4. Cycles samples it as GGX and claims GTR1. */
static struct lobe_value clearcoat_value(const struct trc_lobe *lobe, const struct half_vector *h,
                                         vfloat cos_i, vfloat cos_h, vmask m) {
    const vfloat d = trc_gtr1_d(h->sin2_m, lobe->alpha_x);
    const vfloat alpha2 = vf_set(0.0625f);
    const vfloat co2 = lobe->cos_o * lobe->cos_o, ci2 = cos_i * cos_i;
    const vfloat g_o = trc_ggx_g1(vf_max(alpha2 * (vf_one() - co2) / co2, vf_zero()));
    const vfloat g_i = trc_ggx_g1(vf_max(alpha2 * (vf_one() - ci2) / ci2, vf_zero()));
    const vfloat quarter = vf_set(0.25f) / lobe->cos_o;
    const vfloat claim = vf_where(m, g_o * d * quarter);
    const vfloat sampled_d = trc_ggx_d(h->e, h->cos_m, lobe->alpha_x * lobe->alpha_y);
    return (struct lobe_value){v3_mul(v3_scale(lobe->weight, claim * g_i), fresnel_of(lobe, cos_h)),
                               vf_where(m, sampled_d * lobe->pdf_scale),
                               vf_where(m, sampled_d * lobe->g1_o * quarter), claim};
}

static struct lobe_value toon_value(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi, vmask m) {
    vfloat pdf;
    const vfloat f = toon(lobe, v3_dot(v3_reflect(wo, lobe->n), wi), &pdf);
    pdf = vf_where(m, pdf);
    return (struct lobe_value){v3_scale(lobe->weight, vf_where(m, f)), pdf, pdf, pdf};
}

TRC_INLINE struct lobe_value reflect_value(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    vmask m = vm_and(vf_gt(cos_i, vf_zero()), vf_gt(lobe->cos_o, vf_zero()));
    m = vm_andnot(m, lobe->ideal);
    if (!vm_any(m))
        return no_value();
    if (lobe->distribution == TRC_LOBE_TOON)
        return toon_value(lobe, wo, wi, m);
    const vvec3 half = v3_normalize(v3_add(wo, wi));
    const vfloat cos_h = v3_dot(half, wi);
    const struct half_vector h = half_of(lobe, half, wi, cos_i);
    if (lobe->distribution == TRC_LOBE_ASHIKHMIN)
        return ashikhmin_value(lobe, &h, cos_i, cos_h, m);
    if (lobe->distribution == TRC_LOBE_GTR1)
        return clearcoat_value(lobe, &h, cos_i, cos_h, m);
    const vfloat d = vf_where(m, distribution_d(lobe, &h));
    const vfloat quarter = vf_set(0.25f) / lobe->cos_o;
    struct lobe_value r;
    r.pdf = d * lobe->pdf_scale;
    r.claim = d * lobe->g1_o * quarter;
    vfloat f = r.claim * shadowing(lobe, h.tan2_i);
    if (lobe->distribution == TRC_LOBE_MULTI_GGX) {
        /* Height-correlated: 1 / (1 + L_o + L_i), with 1 + L_o = 1 / g1_o. */
        f = d * quarter / (vf_rcp(lobe->g1_o) + trc_ggx_lambda(h.tan2_i));
        const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y);
        const vfloat cosine = vf_where(m, cos_i);
        const vfloat missing = (vf_one() - trc_ggx_albedo(cos_i, alpha)) * cosine;
        const vfloat spread = lobe->multi_chance;
        r.pdf = vf_lerp(r.pdf, cosine * vf_set(TRC_INV_PI), spread);
        r.claim = vf_lerp(r.claim, cosine * vf_set(TRC_INV_PI), spread);
        r.value =
            v3_add(v3_scale(fresnel_of(lobe, cos_h), f), v3_scale(lobe->multi_weight, missing));
        r.value = v3_mul(r.value, lobe->weight);
    } else {
        r.value = v3_mul(v3_scale(lobe->weight, f), fresnel_of(lobe, cos_h));
    }
    r.pick = r.claim;
    weigh_pair(lobe, cos_h, &r);
    return r;
}

/* Walter 2007, eq. 21 and 17. */
TRC_INLINE struct lobe_value refract_value(const struct trc_lobe *lobe, vvec3 wo, vvec3 wi) {
    const vfloat cos_i = v3_dot(lobe->n, wi);
    vmask m = vm_and(vf_lt(cos_i, vf_zero()), vf_gt(lobe->cos_o, vf_zero()));
    m = vm_andnot(m, lobe->ideal);
    if (!vm_any(m))
        return no_value();
    vvec3 sum = v3_mad(wi, lobe->ior, wo);
    /* It points to the denser side; the micro-normal is on the side of n. */
    sum = v3_scale(sum, vf_copysign(vf_one(), v3_dot(sum, lobe->n)));
    const vfloat length2 = v3_dot(sum, sum);
    const vvec3 half = v3_normalize(sum);
    const vfloat cos_ho = v3_dot(half, wo), cos_hi = v3_dot(half, wi);
    const struct half_vector h = half_of(lobe, half, wi, cos_i);
    /* Only micro-normals that wo sees and that refract to the other side. */
    m = vm_and(m, vm_and(vf_gt(h.cos_m, vf_zero()),
                         vm_and(vf_gt(cos_ho, vf_zero()), vf_lt(cos_hi, vf_zero()))));
    const vfloat d = vf_where(m, distribution_d(lobe, &h));
    const vfloat jacobian = vf_abs(cos_ho * cos_hi) * lobe->ior * lobe->ior / length2;
    const vfloat visible = d * jacobian;
    struct lobe_value r;
    r.pdf = vf_set(4.0f) * lobe->pdf_scale * visible;
    r.claim = r.pick = lobe->g1_o * visible / lobe->cos_o;
    const vfloat f = r.claim * shadowing(lobe, h.tan2_i);
    r.value = v3_mul(v3_scale(lobe->weight, f), fresnel_of(lobe, cos_ho));
    r.value = v3_where(m, r.value);
    r.pdf = vf_where(m, r.pdf);
    r.claim = r.pick = vf_where(m, r.claim);
    weigh_pair(lobe, cos_ho, &r);
    return r;
}

/* ---- all lobes ---- */

/* Lanes in which wi counts as reflected, as transmitted. */
TRC_INLINE void sides(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi,
                      vmask active, vmask *above, vmask *below) {
    const vfloat cos_n = v3_dot(s->n, wi), cos_g = v3_dot(s->ng, wi);
    const vmask over = vm_or(vf_gt(cos_g, vf_zero()), l->below_horizon);
    *above = vm_and(active, vm_and(vf_gt(cos_n, vf_zero()), over));
    /* By the shading normal alone, as Cycles: near the silhouette of a smooth surface refraction
     * may leave on the side of the flat triangle it came from, and still has to go on. */
    *below = vm_and(active, vf_lt(cos_n, vf_zero()));
}

TRC_INLINE bool is_reflection(enum trc_lobe_kind kind) {
    return kind == TRC_LOBE_DIFFUSE || kind == TRC_LOBE_SHEEN || kind == TRC_LOBE_REFLECT;
}

TRC_INLINE struct lobe_value value_of(const struct trc_lobe *lobe, const struct trc_surface *s,
                                      vvec3 wi, vmask side) {
    struct lobe_value r;
    if (lobe->kind == TRC_LOBE_REFLECT)
        r = reflect_value(lobe, s->wo, wi);
    else if (lobe->kind == TRC_LOBE_REFRACT)
        r = refract_value(lobe, s->wo, wi);
    else
        r = diffuse_value(lobe, s, wi);
    r.value = v3_where(side, r.value);
    r.pdf = vf_where(side, r.pdf);
    r.pick = vf_where(side, r.pick);
    r.claim = vf_where(side, r.claim);
    return r;
}

void trc_bsdf_eval(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi, vmask active,
                   struct trc_bsdf_value *out) {
    vmask above, below;
    sides(l, s, wi, active, &above, &below);
    const bool any_above = vm_any(above), any_below = vm_any(below);
    out->diffuse = out->glossy = out->transmission = v3_zero();
    out->pdf = vf_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const bool up = is_reflection(lobe->kind);
        if (lobe->kind == TRC_LOBE_TRANSPARENT || !(up ? any_above : any_below))
            continue;
        const struct lobe_value r = value_of(lobe, s, wi, up ? above : below);
        if (lobe->kind == TRC_LOBE_REFLECT)
            out->glossy = v3_add(out->glossy, r.value);
        else if (lobe->kind == TRC_LOBE_REFRACT)
            out->transmission = v3_add(out->transmission, r.value);
        else
            out->diffuse = v3_add(out->diffuse, r.value);
        out->pdf = out->pdf + r.pdf * lobe->sample_weight;
    }
    out->pdf = vf_divide(out->pdf, l->continue_weight);
}

/* Sums over the lobes for a sampled rough direction. */
static void weigh_direction(const struct trc_lobes *l, const struct trc_surface *s, vmask active,
                            struct trc_bsdf_sample *out) {
    vmask above, below;
    sides(l, s, out->wi, active, &above, &below);
    const bool any_above = vm_any(above), any_below = vm_any(below);
    vvec3 value = v3_zero();
    vfloat pdf = vf_zero(), picked = vf_zero(), claimed = vf_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const bool up = is_reflection(lobe->kind);
        if (lobe->kind == TRC_LOBE_TRANSPARENT || !(up ? any_above : any_below))
            continue;
        const struct lobe_value r = value_of(lobe, s, out->wi, up ? above : below);
        value = v3_add(value, r.value);
        pdf = pdf + r.pdf * lobe->sample_weight;
        claimed = claimed + r.claim * lobe->mix_weight;
        if (lobe->kind != TRC_LOBE_DIFFUSE && lobe->kind != TRC_LOBE_SHEEN)
            picked = picked + r.pick * lobe->mix_weight;
    }
    pdf = vf_divide(pdf, l->continue_weight);
    const vmask lit = vm_and(active, vf_gt(pdf, vf_zero()));
    out->pdf = vf_select(active, pdf, out->pdf);
    out->weight = v3_select(active, v3_where(lit, v3_scale(value, vf_rcp(pdf))), out->weight);
    out->beyond = vf_select(lit, vf_divide(picked, claimed), out->beyond);
    out->valid = vm_or(vm_andnot(out->valid, active), vm_and(lit, vf_gt(v3_max(value), vf_zero())));
}

/* ---- sampling ---- */

/* Mirror direction or ideal refraction, with what the lobe gives there. Lanes that have none get
 * weight 0. */
static vvec3 ideal_direction(const struct trc_lobe *lobe, const struct trc_surface *s,
                             vvec3 *weight) {
    vvec3 wi;
    vmask good = vf_gt(lobe->cos_o, vf_zero());
    if (lobe->kind == TRC_LOBE_REFLECT) {
        wi = v3_reflect(s->wo, lobe->n);
        good = vm_and(good, vf_gt(v3_dot(s->ng, wi), vf_zero()));
    } else {
        good = vm_and(good, trc_refract(s->wo, lobe->n, lobe->ior, &wi));
    }
    *weight = v3_where(good, v3_mul(lobe->weight, fresnel_of(lobe, lobe->cos_o)));
    return wi;
}

/* Evenly in the cone about the mirror direction, of which what is below the surface is lost. */
static vvec3 toon_direction(const struct trc_lobe *lobe, vvec3 wo, vfloat u1, vfloat u2,
                            vmask *alive) {
    const vvec3 axis = v3_reflect(wo, lobe->n);
    vvec3 a, b;
    v3_frame(axis, &a, &b);
    const vvec3 wi = v3_from_frame(trc_warp_cone(lobe->f0.z, u1, u2), a, b, axis);
    const vmask above =
        vm_and(vf_gt(lobe->cos_o, vf_zero()), vf_gt(v3_dot(lobe->n, wi), vf_zero()));
    *alive = vm_and(*alive, above);
    return wi;
}

/* A direction of the lobe's density. chosen_at, evenly below its sample_weight, decides between
 * paired lobes. Lanes leave *alive where total reflection leaves none, or where it is on the wrong
 * side: other lobes may have a density there, but it was not theirs that was sampled. *crosses:
 * lanes that are transmitted. */
static vvec3 rough_direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                             vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    vvec3 a, b;
    *crosses = lobe->kind == TRC_LOBE_REFLECT ? vm_none() : *alive;
    if (lobe->kind == TRC_LOBE_TRANSLUCENT) {
        const vvec3 n = v3_neg(lobe->n);
        v3_frame(n, &a, &b);
        return v3_from_frame(trc_warp_cosine(u1, u2), a, b, n);
    }
    if (lobe->kind == TRC_LOBE_REFLECT && lobe->distribution == TRC_LOBE_TOON)
        return toon_direction(lobe, s->wo, u1, u2, alive);
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
            bound = vf_select(lobe->paired, bound, trc_ggx_bound(lobe->cos_o, ax, ay));
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

static void clear_sample(struct trc_bsdf_sample *out) {
    out->wi = v3(vf_zero(), vf_zero(), vf_one());
    out->weight = v3_zero();
    out->beyond = vf_one();
    out->pdf = vf_zero();
    out->valid = out->singular = out->transparent = out->transmitted = out->diffuse = vm_none();
}

/* Enters the ideal direction of a lobe in lanes m; chance: that it was chosen there. */
static void take_ideal(const struct trc_lobe *lobe, const struct trc_surface *s, vmask m,
                       vfloat chance, struct trc_bsdf_sample *out) {
    vvec3 weight = lobe->weight;
    vvec3 wi = v3_neg(s->wo);
    if (lobe->kind == TRC_LOBE_TRANSPARENT)
        out->transparent = vm_or(out->transparent, m);
    else
        wi = ideal_direction(lobe, s, &weight);
    weight = v3_scale(weight, vf_divide(vf_one(), chance));
    out->wi = v3_select(m, wi, out->wi);
    out->weight = v3_select(m, weight, out->weight);
    out->singular = vm_or(out->singular, m);
    out->valid = vm_or(out->valid, vm_and(m, vf_gt(v3_max(weight), vf_zero())));
}

void trc_bsdf_sample(const struct trc_lobes *l, const struct trc_surface *s, vfloat u_lobe,
                     vfloat u1, vfloat u2, struct trc_bsdf_sample *out) {
    clear_sample(out);
    vmask waiting = vm_and(s->active, vf_gt(l->continue_weight, vf_zero()));
    vmask rough = vm_none();
    vfloat rest = u_lobe * l->continue_weight;
    int last = -1;
    for (int i = 0; i < l->count; i++)
        if (l->lobe[i].kind != TRC_LOBE_DIFFUSE && l->lobe[i].kind != TRC_LOBE_SHEEN)
            last = i;
    for (int i = 0; i <= last; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_DIFFUSE || lobe->kind == TRC_LOBE_SHEEN)
            continue;
        /* The last lobe takes what rounding left over, if it has any chance. */
        vmask m = vm_and(waiting, vf_gt(lobe->sample_weight, vf_zero()));
        if (i != last)
            m = vm_and(m, vf_lt(rest, lobe->sample_weight));
        const vfloat chosen_at = rest;
        rest = rest - lobe->sample_weight;
        waiting = vm_andnot(waiting, m);
        if (!vm_any(m))
            continue;
        const vmask exact = vm_and(m, lobe->ideal), spread = vm_andnot(m, lobe->ideal);
        if (lobe->kind != TRC_LOBE_REFLECT && lobe->kind != TRC_LOBE_TRANSPARENT)
            out->transmitted = vm_or(out->transmitted, exact);
        if (lobe->kind == TRC_LOBE_TRANSLUCENT)
            out->diffuse = vm_or(out->diffuse, m);
        if (vm_any(exact))
            take_ideal(lobe, s, exact, lobe->sample_weight / l->continue_weight, out);
        if (vm_any(spread)) {
            vmask alive = spread, crosses, above, below;
            const vvec3 wi =
                v3_normalize(rough_direction(lobe, s, u1, u2, chosen_at, &alive, &crosses));
            sides(l, s, wi, alive, &above, &below);
            out->wi = v3_select(spread, wi, out->wi);
            out->transmitted = vm_or(out->transmitted, crosses);
            rough = vm_or(rough, vm_select(crosses, below, above));
        }
    }
    if (vm_any(rough))
        weigh_direction(l, s, rough, out);
}

void trc_bsdf_ideal(const struct trc_lobes *l, int i, const struct trc_surface *s,
                    struct trc_bsdf_sample *out) {
    const struct trc_lobe *lobe = &l->lobe[i];
    clear_sample(out);
    if (lobe->kind != TRC_LOBE_REFLECT && lobe->kind != TRC_LOBE_REFRACT &&
        lobe->kind != TRC_LOBE_TRANSPARENT)
        return;
    if (lobe->kind == TRC_LOBE_REFRACT)
        out->transmitted = s->active;
    take_ideal(lobe, s, s->active, vf_one(), out);
}

void trc_bsdf_albedo(const struct trc_lobes *l, const struct trc_surface *s, vvec3 albedo_out[3]) {
    (void)s;
    for (int k = 0; k < 3; k++)
        albedo_out[k] = v3_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_TRANSPARENT)
            continue;
        const int k = lobe->kind == TRC_LOBE_REFLECT ? 1 : lobe->kind == TRC_LOBE_REFRACT ? 2 : 0;
        vvec3 albedo = v3_scale(lobe->weight, lobe->albedo_scale);
        if (lobe->correlated)
            albedo = v3_mul(albedo, fresnel_of(lobe, lobe->cos_o));
        albedo_out[k] = v3_add(albedo_out[k], albedo);
    }
}

/* Lanes where a lobe is too rough for the surfaces it shows to be told from each other. */
#define FEATURE_ALPHA 0.075f
static vmask is_rough(const struct trc_lobe *lobe) {
    if (lobe->kind == TRC_LOBE_TRANSPARENT)
        return vm_none();
    if (lobe->kind != TRC_LOBE_REFLECT && lobe->kind != TRC_LOBE_REFRACT)
        return vm_all_set();
    if (lobe->distribution == TRC_LOBE_TOON)
        return vm_all_set();
    const vmask blurred =
        vf_gt(lobe->alpha_x * lobe->alpha_y, vf_set(FEATURE_ALPHA * FEATURE_ALPHA));
    return vm_andnot(blurred, lobe->ideal);
}

void trc_lobes_features(const struct trc_lobes *l, const struct trc_surface *s,
                        struct trc_denoising_features *out) {
    const vfloat zero = vf_zero();
    vvec3 normal = v3_zero(), albedo = v3_zero();
    vfloat all = zero, rough = zero;
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const bool is_microfacet = lobe->kind == TRC_LOBE_REFLECT || lobe->kind == TRC_LOBE_REFRACT;
        const vmask told = is_rough(lobe);
        const vvec3 n = lobe->kind == TRC_LOBE_TRANSPARENT ? s->n : lobe->n;
        vvec3 color = v3_scale(lobe->weight, lobe->albedo_scale);
        if (is_microfacet)
            color = v3_mul(color, fresnel_of(lobe, v3_dot(n, s->wo)));
        normal = v3_mad(n, lobe->mix_weight, normal);
        all = all + lobe->mix_weight;
        rough = rough + vf_where(told, lobe->mix_weight);
        albedo = v3_add(albedo, v3_where(told, color));
    }
    const vmask some = vf_gt(all, zero);
    out->normal = v3_where(some, v3_scale(normal, vf_rcp(vf_select(some, all, vf_one()))));
    out->albedo = albedo;
    out->is_told = vm_or(vm_not(some), vf_gt(rough * vf_set(4.0f), all));
}

vvec3 trc_lobes_diffuse(const struct trc_lobes *l, const struct trc_surface *s, vvec3 *normal_out) {
    vvec3 weight = v3_zero(), n = v3_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_DIFFUSE || lobe->kind == TRC_LOBE_SHEEN ||
            lobe->kind == TRC_LOBE_TRANSLUCENT) {
            weight = v3_add(weight, lobe->weight);
            n = v3_mad(lobe->n, v3_average(lobe->weight), n);
        }
    }
    *normal_out = v3_select(vf_gt(v3_dot(n, n), vf_zero()), v3_normalize(n), s->n);
    return weight;
}

vvec3 trc_lobes_transparency(const struct trc_lobes *l) {
    vvec3 sum = v3_zero();
    for (int i = 0; i < l->count; i++)
        if (l->lobe[i].kind == TRC_LOBE_TRANSPARENT)
            sum = v3_add(sum, l->lobe[i].weight);
    return sum;
}
