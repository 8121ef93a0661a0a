/* Passes of light by kind: what lobes of the first surface have of the light that a path brings.
 *
 * A continued ray carries the light of all lobes there (kernels/lobe/bsdf.h), so its path keeps the
 * diffuse lobes' share of that, per channel; the rest is of the lobes by which the ray left. Where
 * fibres reflect and let through in one direction, the word has two shares, in fewer bits. */
#ifndef TRACER_KERNELS_TILE_LIGHT_SPLIT_H
#define TRACER_KERNELS_TILE_LIGHT_SPLIT_H

#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"

/* A share in a word: 11 bits of red, 11 of green, 10 of blue, each with 0 and 1 exact. */
#define TRC_SHARE_GREEN_SHIFT 11
#define TRC_SHARE_BLUE_SHIFT 22
#define TRC_SHARE_MAX 2047
#define TRC_SHARE_BLUE_MAX 1023

TRC_INLINE vuint trc_share_pack(vvec3 share) {
    const vfloat half = vf_set(0.5f), steps = vf_set((float)TRC_SHARE_MAX);
    const vint red = vf_to_int(vf_saturate(share.x) * steps + half);
    const vint green = vf_to_int(vf_saturate(share.y) * steps + half);
    const vint blue = vf_to_int(vf_saturate(share.z) * vf_set((float)TRC_SHARE_BLUE_MAX) + half);
    return (vuint)red | (vuint)green << TRC_SHARE_GREEN_SHIFT | (vuint)blue << TRC_SHARE_BLUE_SHIFT;
}

/* Of TRC_CATEGORY_MIXED: per channel the diffuse lobes' share and where the glossy ones' ends, both
 * rounded up as often as u, evenly in [0, 1), has it, so that their means are exact. */
#define TRC_MIXED_BITS 5
#define TRC_MIXED_MAX 31
TRC_INLINE vuint trc_mixed_pack(vvec3 diffuse, vvec3 glossy, vfloat u) {
    const vfloat from[3] = {diffuse.x, diffuse.y, diffuse.z};
    const vfloat ends[3] = {diffuse.x + glossy.x, diffuse.y + glossy.y, diffuse.z + glossy.z};
    const vfloat steps = vf_set((float)TRC_MIXED_MAX);
    vint word = vi_set(0);
    for (int c = 2; c >= 0; c--) {
        const vint end = vf_to_int(vf_min(vf_floor(vf_saturate(ends[c]) * steps + u), steps));
        const vint begin = vf_to_int(vf_min(vf_floor(vf_saturate(from[c]) * steps + u), steps));
        word = (word << 2 * TRC_MIXED_BITS) | (end << TRC_MIXED_BITS) | begin;
    }
    return (vuint)word;
}

/* Parts of the light, 3 floats each. */
struct trc_light_parts {
    float diffuse[3], glossy[3], transmitted[3];
};
TRC_INLINE struct trc_light_parts trc_mixed_parts(uint32_t share, const float rgb[3]) {
    struct trc_light_parts p;
    for (int c = 0; c < 3; c++, share >>= 2 * TRC_MIXED_BITS) {
        const float step = rgb[c] * (1.0f / TRC_MIXED_MAX);
        const float begin = step * (float)(share & TRC_MIXED_MAX);
        const float end = step * (float)(share >> TRC_MIXED_BITS & TRC_MIXED_MAX);
        p.diffuse[c] = begin;
        p.glossy[c] = end - begin;
        p.transmitted[c] = rgb[c] - end;
    }
    return p;
}

/* Adds light of a path that has bounced to the passes; path, share: its words; is_direct: found at
 * the first bounce. */
TRC_INLINE void trc_light_split_add(struct trc_tile *t, uint32_t path, uint32_t share,
                                    bool is_direct, uint32_t slot, const float rgb[3]) {
    const uint32_t category = path >> TRC_PATH_CATEGORY_SHIFT & 3u;
    if (category == TRC_CATEGORY_MIXED) {
        const struct trc_light_parts p = trc_mixed_parts(share, rgb);
        trc_pass_add(t, TRC_PASS_DIFFUSE_DIRECT + !is_direct, slot, p.diffuse);
        trc_pass_add(t, TRC_PASS_GLOSSY_DIRECT + !is_direct, slot, p.glossy);
        trc_pass_add(t, TRC_PASS_TRANSMISSION_DIRECT + !is_direct, slot, p.transmitted);
        return;
    }
    const uint32_t own =
        category == TRC_CATEGORY_GLOSSY ? TRC_PASS_GLOSSY_DIRECT : TRC_PASS_TRANSMISSION_DIRECT;
    const float part[3] = {(float)(share & TRC_SHARE_MAX) * (1.0f / TRC_SHARE_MAX),
                           (float)(share >> TRC_SHARE_GREEN_SHIFT & TRC_SHARE_MAX) *
                               (1.0f / TRC_SHARE_MAX),
                           (float)(share >> TRC_SHARE_BLUE_SHIFT) * (1.0f / TRC_SHARE_BLUE_MAX)};
    float diffuse[3], rest[3];
    for (int c = 0; c < 3; c++) {
        diffuse[c] = part[c] * rgb[c];
        rest[c] = rgb[c] - diffuse[c];
    }
    trc_pass_add(t, own + !is_direct, slot, rest); /* passes of indirect light follow */
    if (share)
        trc_pass_add(t, TRC_PASS_DIFFUSE_DIRECT + !is_direct, slot, diffuse);
}

#endif
