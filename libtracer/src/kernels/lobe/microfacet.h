/* Microfacet distributions, their masking, and the sampling of visible normals.
 *
 * Local frame: z along the lobe's normal. B. Walter, S. Marschner, H. Li and K. Torrance,
 * "Microfacet Models for Refraction through Rough Surfaces" (2007); E. Heitz, "Understanding the
 * Masking-Shadowing Function in Microfacet-Based BRDFs" (2014) and "Sampling the GGX Distribution
 * of Visible Normals" (2018), here in the spherical-cap form of J. Dupuy and A. Benyoub (2023); K.
 * Eto and Y. Tokuyoshi, "Bounded VNDF Sampling for Smith-GGX Reflections" (2023), which spends few
 * samples on directions below the surface; W. Jakob, "An Improved Visible Normal Sampling Routine
 * for the Beckmann Distribution" (2014); B. Burley, "Physically Based Shading at Disney" (2012),
 * GTR1; M. Ashikhmin and P. Shirley, "An Anisotropic Phong BRDF Model" (2000). */
#ifndef TRACER_KERNELS_LOBE_MICROFACET_H
#define TRACER_KERNELS_LOBE_MICROFACET_H

#include "kernels/simd/wide_math.h"

/* ---- Fresnel ---- */

/* The lowest index that shaders take, as in Cycles. */
#define TRC_MIN_IOR 1e-5f

/* Reflectance of a dielectric, eta the relative index, transmitted over incident side. 1 at total
 * reflection. */
TRC_INLINE vfloat trc_fresnel_dielectric(vfloat cos_i, vfloat eta) {
    const vfloat c = vf_abs(cos_i);
    const vfloat g2 = eta * eta - vf_one() + c * c;
    const vfloat g = vf_safe_sqrt(g2);
    const vfloat sum = g + c, difference = g - c;
    const vfloat a = vf_divide(difference, sum);
    const vfloat b = (c * sum - vf_one()) / (c * difference + vf_one());
    const vfloat f = vf_set(0.5f) * a * a * (vf_one() + b * b);
    return vf_select(vf_gt(g2, vf_zero()), vf_min(f, vf_one()), vf_one());
}
/* At normal incidence. */
TRC_INLINE vfloat trc_fresnel_normal(vfloat eta) {
    return vf_square((eta - vf_one()) / (eta + vf_one()));
}
/* (F(cos) - F(1)) / (1 - F(1)): how far a reflection of Principled in Blender 3.4 is from its F0
 * colour. Below 0 for an index above 2 + sqrt(3), of which less is reflected before the edge than
 * head-on. */
TRC_INLINE vfloat trc_fresnel_overshoot(vfloat cos_i, vfloat eta) {
    const vfloat f0 = trc_fresnel_normal(eta);
    return (trc_fresnel_dielectric(cos_i, eta) - f0) / (vf_one() - f0);
}
/* The same of Blender 4. */
TRC_INLINE vfloat trc_fresnel_blend(vfloat cos_i, vfloat eta) {
    return vf_saturate(trc_fresnel_overshoot(cos_i, eta));
}
TRC_INLINE vfloat trc_schlick_weight(vfloat u) {
    const vfloat m = vf_saturate(vf_one() - u), m2 = m * m;
    return m2 * m2 * m;
}

/* Metal: Schlick's approximation with a dip before the edge (N. Kutz, M. Hasan and D. Edmondson,
 * "Novel Aspects of the Adobe Standard Material", 2021): from f0 to white, less dip * cos * (1 -
 * cos)^6. */
#define TRC_METAL_EDGE (1.0f / 7.0f) /* the cosine at which the dip is given: 82 degrees */
TRC_INLINE vfloat trc_metal_fresnel(vfloat f0, vfloat dip, vfloat cos_m) {
    const vfloat rest = vf_saturate(vf_one() - cos_m), power = trc_schlick_weight(cos_m);
    return vf_saturate(vf_lerp(f0, vf_one(), power) - dip * (cos_m * power * rest));
}
/* What Schlick's approximation makes of f0 there, and the dip that lowers it to a reflectance. */
#define TRC_METAL_EDGE_POWER 0.46266436f /* (6 / 7)^5 */
TRC_INLINE vfloat trc_metal_dip(vfloat f0, vfloat at_edge) {
    const vfloat schlick = vf_lerp(f0, vf_one(), vf_set(TRC_METAL_EDGE_POWER));
    return (schlick - at_edge) * (vf_set(49.0f / 6.0f) / vf_set(TRC_METAL_EDGE_POWER));
}

/* A conductor of index n + ik in air (M. Born and E. Wolf, "Principles of Optics", 14.2). */
TRC_INLINE vfloat trc_conductor_fresnel(vfloat n, vfloat k, vfloat cos_m) {
    const vfloat c = vf_saturate(cos_m), c2 = c * c, sin2 = vf_one() - c2, two = vf_set(2.0f);
    const vfloat real = n * n - k * k - sin2, imaginary = two * n * k;
    const vfloat size = vf_sqrt(real * real + imaginary * imaginary);
    const vfloat twice = two * c * vf_safe_sqrt(vf_set(0.5f) * (size + real));
    const vfloat across = vf_divide(size + c2 - twice, size + c2 + twice);
    const vfloat sum = c2 * size + sin2 * sin2, part = twice * sin2;
    return vf_set(0.5f) * (across + across * vf_divide(sum - part, sum + part));
}
/* The same where n^2 + k^2 is large beside 1, as Cycles 4 has it for all. */
TRC_INLINE vfloat trc_strong_conductor_fresnel(vfloat n, vfloat k, vfloat cos_m) {
    const vfloat c = vf_saturate(cos_m), c2 = c * c, square = n * n + k * k;
    const vfloat twice = vf_set(2.0f) * n * c;
    const vfloat along = vf_divide(square * c2 - twice + vf_one(), square * c2 + twice + vf_one());
    const vfloat across = vf_divide(square - twice + c2, square + twice + c2);
    return vf_set(0.5f) * (along + across);
}

/* Refracted direction of wo at the unit normal m (m . wo > 0); lanes of total reflection are not in
 * the result's mask. eta as above. */
TRC_INLINE vmask trc_refract(vvec3 wo, vvec3 m, vfloat eta, vvec3 *wi) {
    const vfloat inverse = vf_rcp(eta), c = v3_dot(wo, m);
    const vfloat k = vf_one() - inverse * inverse * (vf_one() - c * c);
    const vfloat t = inverse * c - vf_sqrt(vf_max(k, vf_set(1e-14f)));
    *wi = v3_sub(v3_scale(m, t), v3_scale(wo, inverse));
    return vm_and(vf_ge(k, vf_zero()), vf_gt(c, vf_zero()));
}

/* ---- masking: tan2 = (alpha_x^2 x^2 + alpha_y^2 y^2) / z^2 of the direction ---- */

/* Heitz 2014, eq. 72: Smith's Lambda of GGX. */
TRC_INLINE vfloat trc_ggx_lambda(vfloat tan2) {
    return vf_set(0.5f) * (vf_sqrt(vf_one() + tan2) - vf_one());
}
TRC_INLINE vfloat trc_ggx_g1(vfloat tan2) {
    return vf_set(2.0f) / (vf_one() + vf_sqrt(vf_one() + tan2));
}
/* Walter 2007, eq. 27, the rational fit that Cycles uses too. */
TRC_INLINE vfloat trc_beckmann_g1(vfloat tan2) {
    const vfloat a = vf_rcp(vf_sqrt(vf_max(tan2, vf_set(1e-12f))));
    const vfloat g = ((vf_set(2.181f) * a + vf_set(3.535f)) * a) /
                     ((vf_set(2.577f) * a + vf_set(2.276f)) * a + vf_one());
    return vf_select(vf_lt(tan2, vf_set(0.625f * 0.625f)), vf_one(), g);
}
/* The exact masking, 1 / (1 + Lambda): density of visible normals. */
TRC_INLINE vfloat trc_beckmann_g1_exact(vfloat tan2) {
    const vfloat a = vf_rcp(vf_sqrt(vf_max(tan2, vf_set(1e-12f))));
    const vfloat tail = vf_exp(-a * a) / (a * vf_set(1.7724538509f));
    const vfloat lambda = vf_set(0.5f) * (vf_erf(a) - vf_one() + tail);
    return vf_rcp(vf_one() + vf_max(lambda, vf_zero()));
}

/* ---- distributions: e = x^2 / alpha_x^2 + y^2 / alpha_y^2 of the micro-normal, c its z ---- */

TRC_INLINE vfloat trc_ggx_d(vfloat e, vfloat c, vfloat alpha2) {
    const vfloat d = e + c * c;
    return vf_set(TRC_INV_PI) / (alpha2 * d * d);
}
TRC_INLINE vfloat trc_beckmann_d(vfloat e, vfloat c, vfloat alpha2) {
    const vfloat c2 = c * c;
    return vf_exp(-e / c2) * vf_set(TRC_INV_PI) / (alpha2 * c2 * c2);
}
/* sin2 = 1 - c^2 of the micro-normal. */
TRC_INLINE vfloat trc_gtr1_d(vfloat sin2, vfloat alpha) {
    const vfloat alpha2 = vf_min(alpha * alpha, vf_set(0.99999f));
    const vfloat less = alpha2 - vf_one();
    /* 1 + (a^2 - 1) c^2 = a^2 + (1 - a^2) sin^2 */
    const vfloat t = alpha2 - less * sin2;
    const vfloat d = less * vf_set(TRC_INV_PI) / (vf_log(alpha2) * t);
    return vf_select(vf_ge(alpha, vf_one()), vf_set(TRC_INV_PI), d);
}

/* ---- sampling ---- */

/* How far below the horizon the cap of stretched directions must reach (Eto and Tokuyoshi, eq. 5),
 * as a fraction of the stretched z of wo; 1 is the whole cap. */
TRC_INLINE vfloat trc_ggx_bound(vfloat cos_o, vfloat alpha_x, vfloat alpha_y) {
    const vfloat a2 = vf_square(vf_min(vf_min(alpha_x, alpha_y), vf_one()));
    const vfloat s2 = vf_square(vf_one() + vf_safe_sqrt(vf_one() - cos_o * cos_o));
    return (vf_one() - a2) * s2 / (s2 + a2 * cos_o * cos_o);
}
/* Micro-normal of GGX visible from wo (local, z > 0). bound: 1, or trc_ggx_bound where the result
 * serves reflection only. The density of the reflected direction is D / (2 cos_o (bound + 2 / G1 -
 * 1)). */
TRC_INLINE vvec3 trc_ggx_sample(vvec3 wo, vfloat alpha_x, vfloat alpha_y, vfloat bound, vfloat u1,
                                vfloat u2) {
    const vvec3 stretched = v3_normalize(v3(wo.x * alpha_x, wo.y * alpha_y, wo.z));
    vfloat s, c;
    vf_sincos_turns(u1, &s, &c);
    const vfloat low = stretched.z * bound;
    const vfloat z = (vf_one() - u2) * (vf_one() + low) - low;
    const vfloat r = vf_safe_sqrt(vf_one() - z * z);
    const vvec3 h = v3(r * c + stretched.x, r * s + stretched.y, z + stretched.z);
    return v3_normalize(v3(h.x * alpha_x, h.y * alpha_y, vf_max(h.z, vf_set(1e-9f))));
}

/* Micro-normal of Beckmann visible from wo: inverts the distribution of the slope towards wo by
 * Halley's method, the slope across is a Gaussian. */
TRC_INLINE vvec3 trc_beckmann_sample(vvec3 wo, vfloat alpha_x, vfloat alpha_y, vfloat u1,
                                     vfloat u2) {
    const vvec3 w = v3_normalize(v3(wo.x * alpha_x, wo.y * alpha_y, wo.z));
    const vfloat sin_o = vf_sqrt(w.x * w.x + w.y * w.y);
    const vmask upright = vf_lt(sin_o, vf_set(1e-3f));
    const vfloat tan_o = vf_select(upright, vf_set(1e-3f), sin_o) / vf_max(w.z, vf_set(1e-6f));
    const vfloat cot_o = vf_rcp(tan_o);
    const vfloat erf_a = vf_erf(cot_o);
    const vfloat k = tan_o * vf_set(0.5641895835f);
    const vfloat total = vf_one() + erf_a + k * vf_exp(-cot_o * cot_o);
    const vfloat goal = vf_clamp(u1, 1e-6f, 0.999999f) * total;
    /* Solve 1 + b + k exp(-x^2) = goal for the slope x below cot_o, where b = erf(x); the start
     * replaces the exponential by 1 - b^2. Three steps leave 1.2e-5 of the distribution at most. */
    const vfloat y0 = goal * (vf_one() + erf_a + k * (vf_one() - erf_a * erf_a)) / total;
    const vfloat b = (vf_set(0.5f) - vf_safe_sqrt(k * (k - y0 + vf_one()) + vf_set(0.25f))) / k;
    vfloat slope_x = vf_erfinv(vf_min(vf_max(b, vf_set(-0.9999999f)), erf_a));
    for (int i = 0; i < 3; i++) {
        const vfloat size = vf_min(vf_abs(slope_x), vf_set(6.0f)); /* vf_erf's, too */
        const vfloat gauss = vf_exp(-size * size);
        const vfloat error = vf_one() + vf_erf(slope_x) + k * gauss - goal;
        /* The first derivative is this times a Gaussian, the second over the first is bend. */
        const vfloat rise = vf_max(vf_one() - slope_x * tan_o, vf_set(1e-3f));
        const vfloat bend = vf_set(-2.0f) * slope_x - tan_o / rise;
        const vfloat step = vf_set(0.88622692545f) * error / (rise * gauss);
        const vfloat curved = vf_max(vf_one() - vf_set(0.5f) * step * bend, vf_set(0.3f));
        slope_x = vf_min(slope_x - step / curved, cot_o);
    }
    vfloat slope_y = vf_erfinv(vf_set(2.0f) * u2 - vf_one());
    /* Seen from above the slopes are isotropic. */
    vfloat s, c;
    vf_sincos_turns(u2, &s, &c);
    const vfloat r = vf_sqrt(-vf_log(vf_max(vf_one() - u1, vf_set(1e-12f))));
    slope_x = vf_select(upright, r * c, slope_x);
    slope_y = vf_select(upright, r * s, slope_y);
    const vfloat inverse = vf_divide(vf_one(), sin_o);
    const vfloat cos_phi = vf_select(upright, vf_one(), w.x * inverse);
    const vfloat sin_phi = vf_select(upright, vf_zero(), w.y * inverse);
    const vfloat turned_x = cos_phi * slope_x - sin_phi * slope_y;
    const vfloat turned_y = sin_phi * slope_x + cos_phi * slope_y;
    return v3_normalize(v3(-alpha_x * turned_x, -alpha_y * turned_y, vf_one()));
}

/* ---- Ashikhmin-Shirley ---- */

TRC_INLINE vfloat trc_ashikhmin_exponent(vfloat alpha) {
    return vf_set(2.0f) / (alpha * alpha) - vf_set(2.0f);
}
/* Half vector: the azimuth in one quadrant by u1, its height by a power of u2. */
TRC_INLINE vvec3 trc_ashikhmin_sample(vfloat alpha_x, vfloat alpha_y, vfloat u1, vfloat u2) {
    const vfloat nx = trc_ashikhmin_exponent(alpha_x), ny = trc_ashikhmin_exponent(alpha_y);
    const vfloat ratio = vf_sqrt((nx + vf_one()) / (ny + vf_one()));
    /* tan(phi) = ratio tan(2 pi u1), kept in its quadrant by scaling the sine. */
    vfloat s, c;
    vf_sincos_turns(u1, &s, &c);
    s = s * ratio;
    const vfloat inverse = vf_rcp(vf_sqrt(s * s + c * c));
    s = s * inverse;
    c = c * inverse;
    const vfloat exponent = vf_rcp(nx * c * c + ny * s * s + vf_one());
    const vfloat z = vf_pow(vf_max(vf_one() - u2, vf_set(1e-12f)), exponent);
    const vfloat r = vf_safe_sqrt((vf_one() - z) * (vf_one() + z));
    return v3(r * c, r * s, z);
}
/* Density of the half vector over 4, local m. */
TRC_INLINE vfloat trc_ashikhmin_lobe(vvec3 m, vfloat alpha_x, vfloat alpha_y) {
    const vfloat nx = trc_ashikhmin_exponent(alpha_x), ny = trc_ashikhmin_exponent(alpha_y);
    const vfloat sin2 = m.x * m.x + m.y * m.y;
    const vfloat mean = vf_divide(nx * m.x * m.x + ny * m.y * m.y, sin2);
    const vfloat exponent = vf_select(vf_gt(sin2, vf_zero()), mean, nx);
    /* cos^n = (1 - sin^2)^(n/2), which keeps digits where the exponent is large. */
    const vfloat below_one = vf_max(-sin2, vf_set(-0.99999994f));
    const vfloat power = vf_exp(vf_set(0.5f) * exponent * vf_log1p(below_one));
    const vfloat norm = vf_sqrt((nx + vf_one()) * (ny + vf_one())) * vf_set(0.125f * TRC_INV_PI);
    return norm * power;
}

#endif
