/* Operations on colours, with the meanings of Cycles 3.4: Mix, Hue Saturation Value, Invert, Gamma,
 * Bright/Contrast, Color Ramp, Separate and Combine Color. */
#ifndef TRACER_KERNELS_PROGRAM_COLOR_H
#define TRACER_KERNELS_PROGRAM_COLOR_H

#include "kernels/program/math.h"

/* Applies a function of (t, a, b) to each channel. */
#define TRC_EACH(f, t, a, b) v3(f((t), (a).x, (b).x), f((t), (a).y, (b).y), f((t), (a).z, (b).z))

/* a + t (b - a): rounds otherwise than vf_lerp, and as Cycles does. */
TRC_INLINE vfloat blend_lerp(vfloat t, vfloat a, vfloat b) { return a + t * (b - a); }
TRC_INLINE vvec3 v3_blend(vfloat t, vvec3 a, vvec3 b) { return TRC_EACH(blend_lerp, t, a, b); }

/* ---- hue, saturation, value ---- */

static vvec3 color_rgb_to_hsv(vvec3 c) {
    const vfloat high = v3_max(c), low = vf_min(c.x, vf_min(c.y, c.z)), range = high - low;
    const vfloat saturation = vf_divide(range, high);
    const vfloat x = vf_divide(high - c.x, range), y = vf_divide(high - c.y, range),
                 z = vf_divide(high - c.z, range);
    vfloat hue = vf_set(4.0f) + y - x;
    hue = vf_select(vf_eq(c.y, high), vf_set(2.0f) + x - z, hue);
    hue = vf_select(vf_eq(c.x, high), z - y, hue);
    hue = hue * vf_set(1.0f / 6.0f);
    hue = vf_select(vf_lt(hue, vf_zero()), hue + vf_one(), hue);
    return v3(vf_where(vf_ne(saturation, vf_zero()), hue), saturation, high);
}

static vvec3 color_hsv_to_rgb(vvec3 c) {
    const vfloat one = vf_one(), s = c.y, v = c.z;
    const vfloat h = vf_select(vf_eq(c.x, one), vf_zero(), c.x) * vf_set(6.0f);
    const vfloat i = vf_floor(h), f = h - i;
    const vfloat p = v * (one - s), q = v * (one - s * f), t = v * (one - s * (one - f));
    vvec3 rgb = v3(v, p, q);
    rgb = v3_select(vf_eq(i, vf_set(4.0f)), v3(t, p, v), rgb);
    rgb = v3_select(vf_eq(i, vf_set(3.0f)), v3(p, q, v), rgb);
    rgb = v3_select(vf_eq(i, vf_set(2.0f)), v3(p, v, t), rgb);
    rgb = v3_select(vf_eq(i, one), v3(q, v, p), rgb);
    rgb = v3_select(vf_eq(i, vf_zero()), v3(v, t, p), rgb);
    return v3_select(vf_ne(s, vf_zero()), rgb, v3_splat(v));
}

static vvec3 color_rgb_to_hsl(vvec3 c) {
    const vfloat one = vf_one(), two = vf_set(2.0f), six = vf_set(6.0f);
    const vfloat high = v3_max(c), low = vf_min(c.x, vf_min(c.y, c.z)), range = high - low;
    const vfloat lightness = vf_min(one, (high + low) * vf_set(0.5f));
    const vmask grey = vf_eq(high, low);
    const vfloat saturation =
        vf_divide(range, vf_select(vf_gt(lightness, vf_set(0.5f)), two - high - low, high + low));
    vfloat hue = vf_divide(c.x - c.y, range) + vf_set(4.0f);
    hue = vf_select(vf_eq(c.y, high), vf_divide(c.z - c.x, range) + two, hue);
    const vfloat red = vf_divide(c.y - c.z, range) + vf_where(vf_lt(c.y, c.z), six);
    hue = vf_select(vf_eq(c.x, high), red, hue) * vf_set(1.0f / 6.0f);
    return v3(vf_where(vm_not(grey), hue), vf_where(vm_not(grey), saturation), lightness);
}

static vvec3 color_hsl_to_rgb(vvec3 c) {
    const vfloat one = vf_one(), two = vf_set(2.0f), half = vf_set(0.5f), l = c.z;
    const vfloat h = c.x * vf_set(6.0f);
    const vfloat r = vf_saturate(vf_abs(h - vf_set(3.0f)) - one);
    const vfloat g = vf_saturate(two - vf_abs(h - two));
    const vfloat b = vf_saturate(two - vf_abs(h - vf_set(4.0f)));
    const vfloat chroma = (one - vf_abs(two * l - one)) * c.y;
    return v3((r - half) * chroma + l, (g - half) * chroma + l, (b - half) * chroma + l);
}

TRC_INLINE vvec3 op_separate(uint32_t mode, vvec3 c) {
    return mode == TRC_SEPARATE_HSL ? color_rgb_to_hsl(c) : color_rgb_to_hsv(c);
}
TRC_INLINE vvec3 op_combine(uint32_t mode, vvec3 c) {
    return mode == TRC_SEPARATE_HSL ? color_hsl_to_rgb(c) : color_hsv_to_rgb(c);
}

static vvec3 op_hue_saturation(vfloat hue, vfloat saturation, vfloat value, vfloat factor,
                               vvec3 color) {
    vvec3 c = color_rgb_to_hsv(color);
    const vfloat turned = c.x + hue + vf_set(0.5f);
    c.x = turned - vf_trunc(turned); /* the remainder keeps the sign, as fmod */
    c.y = vf_saturate(c.y * saturation);
    c.z = c.z * value;
    c = color_hsv_to_rgb(c);
    const vfloat rest = vf_one() - factor, zero = vf_zero();
    return v3(vf_max(factor * c.x + rest * color.x, zero),
              vf_max(factor * c.y + rest * color.y, zero),
              vf_max(factor * c.z + rest * color.z, zero));
}

/* ---- blend modes: t in [0, 1], a below, b above ---- */

TRC_INLINE vfloat blend_screen(vfloat t, vfloat a, vfloat b) {
    const vfloat one = vf_one();
    return one - ((one - t) + t * (one - b)) * (one - a);
}
TRC_INLINE vfloat blend_overlay(vfloat t, vfloat a, vfloat b) {
    const vfloat one = vf_one(), two = vf_set(2.0f), rest = one - t;
    const vfloat low = a * (rest + two * t * b);
    const vfloat high = one - (rest + two * t * (one - b)) * (one - a);
    return vf_select(vf_lt(a, vf_set(0.5f)), low, high);
}
TRC_INLINE vfloat blend_divide(vfloat t, vfloat a, vfloat b) {
    const vfloat divided = (vf_one() - t) * a + t * a / b;
    return vf_select(vf_ne(b, vf_zero()), divided, a);
}
TRC_INLINE vfloat blend_dodge(vfloat t, vfloat a, vfloat b) {
    const vfloat one = vf_one(), d = one - t * b;
    const vfloat ratio = vf_select(vf_le(d, vf_zero()), one, vf_min(a / d, one));
    return vf_select(vf_ne(a, vf_zero()), ratio, a);
}
TRC_INLINE vfloat blend_burn(vfloat t, vfloat a, vfloat b) {
    const vfloat one = vf_one(), d = (one - t) + t * b;
    const vfloat burnt = vf_saturate(one - (one - a) / d);
    return vf_where(vf_gt(d, vf_zero()), burnt);
}
TRC_INLINE vfloat blend_soft_light(vfloat t, vfloat a, vfloat b) {
    const vfloat one = vf_one(), screen = one - (one - b) * (one - a);
    return (one - t) * a + t * ((one - a) * b * a + a * screen);
}
TRC_INLINE vfloat blend_linear_light(vfloat t, vfloat a, vfloat b) {
    return a + t * (vf_set(2.0f) * b - vf_one());
}
TRC_INLINE vfloat blend_exclusion(vfloat t, vfloat a, vfloat b) {
    return vf_max(blend_lerp(t, a, a + b - vf_set(2.0f) * a * b), vf_zero());
}

/* Hue of b, and its saturation too if both is true; unchanged where b is grey. */
static vvec3 blend_hue(vfloat t, vvec3 a, vvec3 b, bool both) {
    const vvec3 target = color_rgb_to_hsv(b);
    vvec3 c = color_rgb_to_hsv(a);
    c.x = target.x;
    if (both)
        c.y = target.y;
    return v3_select(vf_ne(target.y, vf_zero()), v3_blend(t, a, color_hsv_to_rgb(c)), a);
}
static vvec3 blend_saturation(vfloat t, vvec3 a, vvec3 b) {
    const vvec3 target = color_rgb_to_hsv(b);
    vvec3 c = color_rgb_to_hsv(a);
    const vmask colored = vf_ne(c.y, vf_zero());
    c.y = (vf_one() - t) * c.y + t * target.y;
    return v3_select(colored, color_hsv_to_rgb(c), a);
}
static vvec3 blend_value(vfloat t, vvec3 a, vvec3 b) {
    vvec3 c = color_rgb_to_hsv(a);
    c.z = (vf_one() - t) * c.z + t * v3_max(b);
    return color_hsv_to_rgb(c);
}

static vvec3 op_mix(uint32_t mode, vfloat factor, vvec3 a, vvec3 b) {
    const vfloat t = vf_saturate(factor);
    switch (mode) {
    case TRC_BLEND_MIX:
        return v3_blend(t, a, b);
    case TRC_BLEND_DARKEN:
        return v3_blend(t, a, v3_min(a, b));
    case TRC_BLEND_MULTIPLY:
        return v3_blend(t, a, v3_mul(a, b));
    case TRC_BLEND_BURN:
        return TRC_EACH(blend_burn, t, a, b);
    case TRC_BLEND_LIGHTEN:
        return v3_blend(t, a, v3_max_each(a, b));
    case TRC_BLEND_SCREEN:
        return TRC_EACH(blend_screen, t, a, b);
    case TRC_BLEND_DODGE:
        return TRC_EACH(blend_dodge, t, a, b);
    case TRC_BLEND_ADD:
        return v3_blend(t, a, v3_add(a, b));
    case TRC_BLEND_OVERLAY:
        return TRC_EACH(blend_overlay, t, a, b);
    case TRC_BLEND_SOFT_LIGHT:
        return TRC_EACH(blend_soft_light, t, a, b);
    case TRC_BLEND_LINEAR_LIGHT:
        return TRC_EACH(blend_linear_light, t, a, b);
    case TRC_BLEND_DIFFERENCE:
        return v3_blend(t, a, v3_abs(v3_sub(a, b)));
    case TRC_BLEND_SUBTRACT:
        return v3_blend(t, a, v3_sub(a, b));
    case TRC_BLEND_DIVIDE:
        return TRC_EACH(blend_divide, t, a, b);
    case TRC_BLEND_HUE:
        return blend_hue(t, a, b, false);
    case TRC_BLEND_SATURATION:
        return blend_saturation(t, a, b);
    case TRC_BLEND_COLOR:
        return blend_hue(t, a, b, true);
    case TRC_BLEND_VALUE:
        return blend_value(t, a, b);
    case TRC_BLEND_EXCLUSION:
        return TRC_EACH(blend_exclusion, t, a, b);
    default:
        return a;
    }
}

/* ---- the rest ---- */

TRC_INLINE vfloat color_invert(vfloat factor, vfloat rest, vfloat a) {
    return factor * (vf_one() - a) + rest * a;
}
TRC_INLINE vvec3 op_invert(vfloat factor, vvec3 c) {
    const vfloat rest = vf_one() - factor;
    return v3(color_invert(factor, rest, c.x), color_invert(factor, rest, c.y),
              color_invert(factor, rest, c.z));
}

TRC_INLINE vfloat color_gamma(vfloat a, vfloat gamma) {
    const vmask positive = vf_gt(a, vf_zero());
    return vf_select(positive, vf_pow(vf_select(positive, a, vf_one()), gamma), a);
}
static vvec3 op_gamma(vvec3 c, vfloat gamma) {
    const vvec3 raised =
        v3(color_gamma(c.x, gamma), color_gamma(c.y, gamma), color_gamma(c.z, gamma));
    return v3_select(vf_eq(gamma, vf_zero()), v3_splat(vf_one()), raised);
}

TRC_INLINE vvec3 op_bright_contrast(vvec3 c, vfloat bright, vfloat contrast) {
    const vfloat a = vf_one() + contrast, b = bright - contrast * vf_set(0.5f), zero = vf_zero();
    return v3(vf_max(a * c.x + b, zero), vf_max(a * c.y + b, zero), vf_max(a * c.z + b, zero));
}

/* A table over [0, 1]. */
static void op_ramp(uint32_t mode, const float *table, vfloat factor, vfloat *out) {
    const vint last = vi_set(TRC_TABLE_ENTRIES - 1);
    const vfloat x = vf_saturate(factor) * vf_set((float)(TRC_TABLE_ENTRIES - 1));
    const vint i = vf_to_int(x), next = vi_select(vi_lt(i, last), i + vi_set(1), last);
    const vfloat t = mode == TRC_RAMP_CONSTANT ? vf_zero() : x - vi_to_float(i);
    const vmask all = vm_all_set();
    for (int c = 0; c < 4; c++) {
        const vfloat a = vf_gather(table + c, i << 2, all);
        const vfloat b = vf_gather(table + c, next << 2, all);
        out[c] = (vf_one() - t) * a + t * b;
    }
}

#endif
