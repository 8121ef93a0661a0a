/* What both models of Principled Hair share: what strands absorb, and the distribution along them,
 * after M. J.-Y. Chiang, B. Bitterli, C. Tappan and B. Burley, "A Practical and Controllable Hair
 * and Fur Model for Production Path Tracing" (2016). */
#ifndef TRACER_KERNELS_LOBE_FIBRE_H
#define TRACER_KERNELS_LOBE_FIBRE_H

#include "kernels/lobe/lobe.h"

/* Roughnesses are at least this (Cycles). */
#define TRC_MIN_FIBRE_ROUGHNESS 1e-3f
/* What melanin leaves of 1 is at least this: its concentration is finite (Cycles). */
#define TRC_MIN_LEFT 1e-4f
/* Of random numbers whose logarithm is taken (Cycles). */
#define TRC_MIN_FIBRE_RANDOM 1e-5f

/* ---- pigment ---- */

struct trc_strand_pigment {
    uint32_t mode; /* TRC_PIGMENT_* */
    vvec3 color, absorption, tint;
    vfloat melanin, redness, factor; /* factor: of the melanin */
};

/* Chiang et al., equation 9: how the albedo's logarithm grows with the root of the absorption. */
TRC_INLINE vfloat trc_albedo_scale(vfloat roughness) {
    static const float terms[] = {0.245f, 5.574f, -10.73f, 2.532f, -0.215f, 5.969f};
    vfloat sum = vf_zero();
    for (size_t i = 0; i < sizeof terms / sizeof terms[0]; i++)
        sum = sum * roughness + vf_set(terms[i]);
    return sum;
}

TRC_INLINE vfloat trc_absorbed(vfloat color, vfloat scale) {
    return vf_square(vf_log(vf_max(color, vf_zero())) / scale);
}

TRC_INLINE vvec3 trc_absorption_of_color(vvec3 color, vfloat roughness) {
    const vfloat scale = trc_albedo_scale(roughness);
    return v3(trc_absorbed(color.x, scale), trc_absorbed(color.y, scale),
              trc_absorbed(color.z, scale));
}

/* Absorption by melanin, 0 to 1: E. d'Eon et al. 2011, with B. Bitterli's ratio of both kinds. */
TRC_INLINE vvec3 trc_absorption_of_melanin(vfloat melanin, vfloat redness) {
    static const float eumelanin[3] = {0.506f, 0.841f, 1.653f};
    static const float pheomelanin[3] = {0.343f, 0.733f, 1.924f};
    const vfloat amount = -vf_log(vf_max(vf_one() - melanin, vf_set(TRC_MIN_LEFT)));
    const vfloat brown = amount * (vf_one() - redness), red = amount * redness;
    return v3_mad(v3_set(eumelanin), brown, v3_scale(v3_set(pheomelanin), red));
}

/* Per radius; roughness: around the strand. */
TRC_INLINE vvec3 trc_absorption(const struct trc_strand_pigment *p, vfloat roughness) {
    if (p->mode == TRC_PIGMENT_ABSORPTION)
        return p->absorption;
    if (p->mode == TRC_PIGMENT_COLOR)
        return trc_absorption_of_color(p->color, roughness);
    return v3_add(trc_absorption_of_melanin(p->melanin * p->factor, p->redness),
                  trc_absorption_of_color(p->tint, roughness));
}

/* ---- light ---- */

/* Where samples of lights give anything in Cycles 5: not on faces whose normal and the one across
 * the strand and wo, which it takes for the lobe's own, disagree on the side. */
TRC_INLINE vmask trc_fibre_lit(vvec3 tangent, const struct trc_surface *s, vvec3 wi) {
    const vvec3 across = v3_cross(tangent, s->wo);
    const vfloat agreement = v3_dot(s->n, wi) * v3_dot(s->n, across) * v3_dot(across, wi);
    return vm_or(vf_ge(agreement, vf_zero()), trc_on_strand(s));
}

/* ---- along the strand ---- */

/* exp(-x) times the modified Bessel function of order 0, x >= 0: M. Abramowitz and I. Stegun,
 * "Handbook of Mathematical Functions" (1964), 9.8.1 and 9.8.2, within 2e-7. */
TRC_INLINE vfloat trc_scaled_bessel(vfloat x) {
    static const float near[] = {0.0045813f, 0.0360768f, 0.2659732f, 1.2067492f,
                                 3.0899424f, 3.5156229f, 1.0f};
    static const float far[] = {0.00392377f,  -0.01647633f, 0.02635537f, -0.02057706f, 0.00916281f,
                                -0.00157565f, 0.00225319f,  0.01328592f, 0.39894228f};
    const vfloat bound = vf_set(3.75f);
    const vfloat inside = vf_min(x, bound) / bound, square = inside * inside;
    const vfloat beyond = bound / vf_max(x, bound);
    vfloat a = vf_zero(), b = vf_zero();
    for (size_t i = 0; i < sizeof near / sizeof near[0]; i++)
        a = a * square + vf_set(near[i]);
    for (size_t i = 0; i < sizeof far / sizeof far[0]; i++)
        b = b * beyond + vf_set(far[i]);
    return vf_select(vf_lt(x, bound), a * vf_exp(-vf_min(x, bound)), b / vf_sqrt(vf_max(x, bound)));
}

/* Along the strand, of variance v; its exponent is that of the distance between both directions, in
 * which nothing cancels. */
TRC_INLINE vfloat trc_along_strand(vfloat sin_i, vfloat cos_i, vfloat sin_o, vfloat cos_o,
                                   vfloat v) {
    const vfloat across = cos_i - cos_o, along = sin_i + sin_o, half = vf_set(0.5f);
    const vfloat distance = half * (across * across + along * along) / v;
    const vfloat norm = v * (vf_one() - vf_exp(vf_set(-2.0f) / v));
    return trc_scaled_bessel(cos_i * cos_o / v) * vf_exp(-distance) / norm;
}

/* The sine to the strand's normal plane of a direction of that density, by numbers in [0, 1). */
TRC_INLINE vfloat trc_along_strand_sampled(vfloat sin_o, vfloat cos_o, vfloat v, vfloat u1,
                                           vfloat u2) {
    const vfloat one = vf_one();
    /* 1 less the cosine of how far it is off, along the strand and around an axis of it. */
    const vfloat tail = vf_exp(vf_set(-2.0f) / v), u = vf_clamp(u1, TRC_MIN_FIBRE_RANDOM, 1.0f);
    const vfloat off = vf_clamp(-v * vf_log(u + (one - u) * tail), 0.0f, 2.0f);
    vfloat unused, cosine;
    vf_sincos_turns(u2, &unused, &cosine);
    return vf_clamp((off - one) * sin_o + vf_safe_sqrt(off * (vf_set(2.0f) - off)) * cosine * cos_o,
                    -1.0f, 1.0f);
}

#endif
