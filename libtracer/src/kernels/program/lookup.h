/* Image lookups for TRC_WIDTH places at once: one image, any coordinates.
 *
 * Filters and extensions are those of Cycles 3.4: B-spline weights for cubic, texels outside a
 * clipped image count as transparent black, sRGB is decoded after filtering. Coordinates may be
 * huge or not finite: NaN reads as 0. Cycles has no smaller levels: here one is read where its
 * texels are no wider than what one sample stands for, so that pictures go to the same limit. */
#ifndef TRACER_KERNELS_PROGRAM_LOOKUP_H
#define TRACER_KERNELS_PROGRAM_LOOKUP_H

#include "kernels/simd/wide_math.h"
#include "model/image.h"
#include "model/program.h"

/* ---- texels ---- */

/* Two half floats without infinities or NaN, from the low and the high part of a word. */
TRC_INLINE void half_unpack(vuint word, vfloat *low, vfloat *high) {
    const vuint magnitude = vu_set(0x7fffu), sign = vu_set(0x8000u);
    const vfloat scale = vf_set(0x1p112f); /* moves the exponent's bias from 15 to 127 */
    const vuint upper = word >> 16;
    const vfloat a = vi_as_float((vint)((word & magnitude) << 13)) * scale;
    const vfloat b = vi_as_float((vint)((upper & magnitude) << 13)) * scale;
    *low = vf_copysign(a, vi_as_float((vint)((word & sign) << 16)));
    *high = vf_copysign(b, vi_as_float((vint)((upper & sign) << 16)));
}

/* RGBA of the texels with these numbers, without the scale of integer formats; 0 outside lanes. */
TRC_INLINE void texel_load(enum trc_texel format, const void *texels, vint index, vmask lanes,
                           vfloat out[4]) {
    const uint32_t *words = texels;
    switch (format) {
    case TRC_TEXEL_U8: {
        const vuint t = vu_gather(words, index, lanes), byte = vu_set(0xffu);
        out[0] = vi_to_float((vint)(t & byte));
        out[1] = vi_to_float((vint)((t >> 8) & byte));
        out[2] = vi_to_float((vint)((t >> 16) & byte));
        out[3] = vi_to_float((vint)(t >> 24));
        break;
    }
    case TRC_TEXEL_U16: {
        const vuint low = vu_set(0xffffu);
        const vuint rg = vu_gather(words, index << 1, lanes);
        const vuint ba = vu_gather(words + 1, index << 1, lanes);
        out[0] = vi_to_float((vint)(rg & low));
        out[1] = vi_to_float((vint)(rg >> 16));
        out[2] = vi_to_float((vint)(ba & low));
        out[3] = vi_to_float((vint)(ba >> 16));
        break;
    }
    case TRC_TEXEL_F16:
        half_unpack(vu_gather(words, index << 1, lanes), &out[0], &out[1]);
        half_unpack(vu_gather(words + 1, index << 1, lanes), &out[2], &out[3]);
        break;
    case TRC_TEXEL_F32:
    default:
        for (int c = 0; c < 4; c++)
            out[c] = vf_gather((const float *)texels + c, index << 2, lanes);
        break;
    }
}

/* ---- coordinates ---- */

/* Where a coordinate falls on a row of size texels: the texel at or before it (relative to centres
 * if centred) and how far beyond. Repeated and mirrored coordinates are brought into one period
 * first: that keeps their digits and the integers small. */
TRC_INLINE vint axis_place(vfloat u, uint32_t size, uint32_t extension, bool centred, vfloat *t) {
    const vfloat zero = vf_zero(), count = vf_set((float)size);
    vfloat x;
    if (extension == TRC_IMAGE_REPEAT) {
        x = vf_saturate(u - vf_floor(u));
    } else if (extension == TRC_IMAGE_MIRROR) {
        const vfloat half = u * vf_set(0.5f);
        x = vf_clamp((half - vf_floor(half)) * vf_set(2.0f), 0.0f, 2.0f);
    } else { /* far outside is as good as three sizes outside */
        x = vf_clamp(vf_select(vf_eq(u, u), u, zero), -3.0f, 4.0f);
    }
    x = x * count - (centred ? vf_set(0.5f) : zero);
    const vfloat whole = vf_floor(x);
    *t = x - whole;
    return vf_to_int(whole);
}

/* Texel number i, up to two outside the period, within the image. */
TRC_INLINE vint axis_wrap(vint i, uint32_t size, uint32_t extension) {
    const vint n = vi_set((int32_t)size), zero = vi_set(0), last = vi_set((int32_t)size - 1);
    if (extension == TRC_IMAGE_REPEAT || extension == TRC_IMAGE_MIRROR) {
        const vint period = extension == TRC_IMAGE_MIRROR ? n + n : n;
        for (uint32_t step = 0; step < (size > 1 ? 1u : 2u); step++) {
            i = vi_select(vi_lt(i, zero), i + period, i);
            i = vi_select(vi_lt(i, period), i, i - period);
        }
        if (extension == TRC_IMAGE_MIRROR)
            i = vi_select(vi_lt(i, n), i, period - vi_set(1) - i);
    }
    return vi_select(vi_lt(i, zero), zero, vi_select(vi_lt(last, i), last, i));
}

/* ---- filters ---- */

#define TRC_MAX_TAPS 4

/* The columns (or rows) of texels that a filter reads, with their weights. inside: whether each is
 * part of the image; only a clipped one has others. */
struct axis_taps {
    vint index[TRC_MAX_TAPS];
    vfloat weight[TRC_MAX_TAPS];
    vmask inside[TRC_MAX_TAPS];
};

/* Uniform cubic B-spline. */
TRC_INLINE void cubic_weights(vfloat t, vfloat w[4]) {
    const vfloat half = vf_set(0.5f), sixth = vf_set(1.0f / 6.0f);
    w[0] = ((half - t * sixth) * t - half) * t + sixth;
    w[1] = (half * t - vf_one()) * t * t + vf_set(2.0f / 3.0f);
    w[2] = ((half - half * t) * t + half) * t + sixth;
    w[3] = sixth * t * t * t;
}

/* taps: 1 closest, 2 linear, 4 cubic. */
TRC_INLINE void axis_prepare(vfloat u, uint32_t size, uint32_t extension, int taps,
                             struct axis_taps *a) {
    vfloat t;
    const vint place = axis_place(u, size, extension, taps > 1, &t) - vi_set(taps > 2 ? 1 : 0);
    for (int k = 0; k < taps; k++) {
        const vint i = place + vi_set(k);
        a->index[k] = axis_wrap(i, size, extension);
        a->inside[k] = extension == TRC_IMAGE_CLIP ? vi_eq(a->index[k], i) : vm_all_set();
    }
    a->weight[0] = taps > 1 ? vf_one() - t : vf_one();
    a->weight[1] = t;
    if (taps == 4)
        cubic_weights(t, a->weight);
}

/* Sum over the texels of a filter, without the scale of integer formats. */
TRC_INLINE void filter_sum(enum trc_texel format, const struct trc_image_level *level,
                           uint32_t extension, int taps, vfloat u, vfloat v, vmask lanes,
                           vfloat sum[4]) {
    struct axis_taps x, y;
    axis_prepare(u, level->width, extension, taps, &x);
    axis_prepare(v, level->height, extension, taps, &y);
    for (int c = 0; c < 4; c++)
        sum[c] = vf_zero();
    for (int j = 0; j < taps; j++) {
        const vint row = y.index[j] * vi_set((int32_t)level->width);
        const vmask row_lanes = vm_and(lanes, y.inside[j]);
        for (int i = 0; i < taps; i++) {
            vfloat texel[4];
            const vfloat weight = y.weight[j] * x.weight[i];
            texel_load(format, level->texels, row + x.index[i], vm_and(row_lanes, x.inside[i]),
                       texel);
            for (int c = 0; c < 4; c++)
                sum[c] = sum[c] + weight * texel[c];
        }
    }
}

/* ---- colour ---- */

/* sRGB to linear on [0, 1]: minimax polynomial of ((x + 0.055) / 1.055)^2.4, relative error 1.3e-5,
 * and the straight part. */
TRC_INLINE vfloat srgb_decode_unit(vfloat x) {
    vfloat p = vf_set(-0.20740075409412384f);
    p = p * x + vf_set(0.8699970841407776f);
    p = p * x + vf_set(-1.5605111122131348f);
    p = p * x + vf_set(1.6143866777420044f);
    p = p * x + vf_set(-1.1669092178344727f);
    p = p * x + vf_set(0.9384191632270813f);
    p = p * x + vf_set(0.4752274453639984f);
    p = p * x + vf_set(0.035937875509262085f);
    p = p * x + vf_set(0.0008404380641877651f);
    return vf_select(vf_lt(x, vf_set(0.04045f)), x * vf_set(1.0f / 12.92f), p);
}

/* Any value; below 0 is 0. */
TRC_INLINE vfloat srgb_decode(vfloat x) {
    const vfloat low = vf_max(x, vf_zero()) * vf_set(1.0f / 12.92f);
    const vfloat base = (vf_max(x, vf_zero()) + vf_set(0.055f)) * vf_set(1.0f / 1.055f);
    return vf_select(vf_lt(x, vf_set(0.04045f)), low, vf_pow(base, vf_set(2.4f)));
}

/* Colours divided by alpha are above 1 where the image has more than its alpha; the rest of them
 * are not by more than rounding. */
#define UNIT_LIMIT 1.001f
TRC_INLINE vfloat srgb_decode_divided(vfloat x, vmask lanes) {
    const vfloat unit = srgb_decode_unit(x);
    const vmask above = vf_gt(x, vf_set(UNIT_LIMIT));
    return vm_any(vm_and(above, lanes)) ? vf_select(above, srgb_decode(x), unit) : unit;
}

/* RGBA of an image itself. mode: as TRC_OP_IMAGE. */
static void whole_lookup(const struct trc_image *image, uint32_t mode, vfloat u, vfloat v,
                         vmask lanes, vfloat out[4]) {
    const struct trc_image_level *level = &image->levels[0];
    const uint32_t extension = mode & TRC_IMAGE_EXTENSION_MASK;
    switch (mode & TRC_IMAGE_INTERPOLATION_MASK) {
    case TRC_IMAGE_CLOSEST:
        filter_sum(image->format, level, extension, 1, u, v, lanes, out);
        break;
    case TRC_IMAGE_CUBIC:
        filter_sum(image->format, level, extension, 4, u, v, lanes, out);
        break;
    default:
        filter_sum(image->format, level, extension, 2, u, v, lanes, out);
        break;
    }
    const bool is_integer = image->format == TRC_TEXEL_U8 || image->format == TRC_TEXEL_U16;
    if (is_integer) {
        const vfloat scale =
            vf_set(image->format == TRC_TEXEL_U8 ? 1.0f / 255.0f : 1.0f / 65535.0f);
        for (int c = 0; c < 4; c++)
            out[c] = out[c] * scale;
    }
    const bool is_divided = (mode & TRC_IMAGE_MODE_ALPHA) && image->is_associated;
    if (is_divided) {
        const vfloat inverse = vf_select(vf_ne(out[3], vf_zero()), vf_rcp(out[3]), vf_one());
        for (int c = 0; c < 3; c++)
            out[c] = out[c] * inverse;
    }
    if (!image->is_srgb)
        return;
    for (int c = 0; c < 3; c++) {
        if (!is_integer)
            out[c] = srgb_decode(out[c]);
        else
            out[c] = is_divided ? srgb_decode_divided(out[c], lanes) : srgb_decode_unit(out[c]);
    }
}

/* The smallest level whose texels are no wider than width, in units of the image's shorter side. */
TRC_INLINE vint level_of(const struct trc_image *image, vfloat width) {
    const struct trc_image_level *whole = &image->levels[0];
    const uint32_t side = whole->width < whole->height ? whole->width : whole->height;
    const vint log2 = (vint)((vuint)vf_as_int(width * vf_set((float)side)) >> 23) - vi_set(127);
    const vint level = log2 - vi_set(TRC_LEVEL_FIRST_LOG2 - 1);
    const vint last = vi_set((int32_t)image->level_count - 1), zero = vi_set(0);
    return vi_select(vi_lt(level, zero), zero, vi_select(vi_lt(last, level), last, level));
}

/* RGBA of an image; NULL is magenta. width: what a lookup stands for, in units of the coordinates,
 * >= 0. Smaller levels are interpolated linearly, level by level of the lanes. */
static void texture_lookup(const struct trc_image *image, uint32_t mode, vfloat u, vfloat v,
                           vfloat width, vmask lanes, vfloat out[4]) {
    if (!image) {
        out[0] = out[2] = out[3] = vf_one();
        out[1] = vf_zero();
        return;
    }
    if (image->level_count == 1) {
        whole_lookup(image, mode, u, v, lanes, out);
        return;
    }
    const vint level = level_of(image, width);
    for (uint32_t rest = vm_bits(lanes); rest;) {
        const int32_t number = vi_get(level, __builtin_ctz(rest));
        const vmask own = vm_and(vi_eq(level, vi_set(number)), vm_from_bits(rest));
        vfloat found[4];
        if (number)
            filter_sum(image->level_format, &image->levels[number], mode & TRC_IMAGE_EXTENSION_MASK,
                       2, u, v, own, found);
        else
            whole_lookup(image, mode, u, v, own, found);
        for (int c = 0; c < 4; c++)
            out[c] = vf_select(own, found[c], out[c]);
        rest &= ~vm_bits(own);
    }
}

#endif
