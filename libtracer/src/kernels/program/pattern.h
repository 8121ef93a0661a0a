/* Regular patterns: the Gradient, Wave, Magic and Brick textures, as in Cycles 3.4. */
#ifndef TRACER_KERNELS_PROGRAM_PATTERN_H
#define TRACER_KERNELS_PROGRAM_PATTERN_H

#include "kernels/program/noise.h"

/* ---- gradient ---- */

static vfloat op_gradient(uint32_t mode, vvec3 p) {
    const vfloat zero = vf_zero(), half = vf_set(0.5f);
    /* Unit vectors give exactly 0. */
    const vfloat inside = vf_max(vf_set(0.999999f) - v3_length(p), zero);
    vfloat r = zero;
    switch (mode) {
    case TRC_GRADIENT_LINEAR:
        r = p.x;
        break;
    case TRC_GRADIENT_QUADRATIC:
        r = vf_square(vf_max(p.x, zero));
        break;
    case TRC_GRADIENT_EASING: {
        const vfloat x = vf_saturate(p.x), square = x * x;
        r = vf_set(3.0f) * square - vf_set(2.0f) * square * x;
        break;
    }
    case TRC_GRADIENT_DIAGONAL:
        r = (p.x + p.y) * half;
        break;
    case TRC_GRADIENT_RADIAL:
        r = vf_atan2(p.y, p.x) / vf_set(TRC_TWO_PI) + half;
        break;
    case TRC_GRADIENT_QUADRATIC_SPHERE:
        r = inside * inside;
        break;
    default:
        r = inside;
        break;
    }
    return vf_saturate(r);
}

/* ---- wave ---- */

/* How far along the bands, or from the axis or the centre of the rings. */
TRC_INLINE vfloat wave_place(uint32_t mode, vvec3 p) {
    const uint32_t direction = (mode >> TRC_WAVE_DIRECTION_SHIFT) & 3u;
    const vfloat c[3] = {p.x, p.y, p.z};
    if (!(mode & TRC_WAVE_RINGS)) {
        return direction < 3 ? c[direction] * vf_set(20.0f) : (p.x + p.y + p.z) * vf_set(10.0f);
    }
    vfloat sum = vf_zero();
    for (uint32_t i = 0; i < 3; i++)
        sum = i == direction ? sum : sum + c[i] * c[i];
    return vf_sqrt(sum) * vf_set(20.0f);
}

/* vector, distortion, detail scale, octaves, roughness, phase */
static vfloat op_wave(uint32_t mode, const vfloat *in) {
    /* The shift and the shrinking keep whole coordinates off the edges. */
    const vfloat shift = vf_set(0.000001f), shrink = vf_set(0.999999f), half = vf_set(0.5f);
    const vfloat one = vf_one(), two = vf_set(2.0f);
    const vvec3 p =
        v3((in[0] + shift) * shrink, (in[1] + shift) * shrink, (in[2] + shift) * shrink);
    vfloat n = wave_place(mode, p) + in[7];
    if (vm_any(vf_ne(in[3], vf_zero()))) {
        const struct fractal f = {.type = TRC_FRACTAL_FBM_UNIT,
                                  .dims = 3,
                                  .octaves = vf_clamp(in[5], 0.0f, TRC_MAX_OCTAVES),
                                  .roughness = vf_saturate(in[6]),
                                  .lacunarity = two};
        const vfloat place[TRC_MAX_DIMENSIONS] = {p.x * in[4], p.y * in[4], p.z * in[4]};
        const vfloat bent = n + in[3] * (fractal_noise(&f, place) * two - one);
        n = vf_select(vf_ne(in[3], vf_zero()), bent, n);
    }
    const vfloat turns = n / vf_set(TRC_TWO_PI);
    switch (mode & TRC_WAVE_PROFILE) {
    case TRC_WAVE_SINE:
        return half + half * vf_sin(n - vf_set(TRC_HALF_PI));
    case TRC_WAVE_SAW:
        return turns - vf_floor(turns);
    default:
        return vf_abs(turns - vf_floor(turns + half)) * two;
    }
}

/* ---- magic ---- */

/* One fold of the coordinates: the target becomes the sine or cosine of their signed sum. */
struct magic_fold {
    int8_t target, is_cosine, sign, of[3];
};
#define MAGIC_DEPTH 10
static const struct magic_fold magic_folds[MAGIC_DEPTH] = {
    {1, 1, -1, {1, -1, 1}},  {0, 1, 1, {1, -1, -1}}, {2, 0, 1, {-1, -1, -1}},
    {0, 1, -1, {-1, 1, -1}}, {1, 0, -1, {-1, 1, 1}}, {1, 1, -1, {-1, 1, 1}},
    {0, 1, 1, {1, 1, 1}},    {2, 0, 1, {1, 1, -1}},  {0, 1, -1, {-1, -1, 1}},
    {1, 0, -1, {1, -1, 1}},
};

TRC_INLINE vfloat magic_sum(const vfloat c[3], const int8_t of[3]) {
    const vfloat x = of[0] < 0 ? -c[0] : c[0];
    const vfloat xy = of[1] < 0 ? x - c[1] : x + c[1];
    return of[2] < 0 ? xy - c[2] : xy + c[2];
}

/* vector, scale, distortion; mode: how many folds */
static vvec3 op_magic(uint32_t mode, const vfloat *in) {
    static const int8_t first[3][3] = {{1, 1, 1}, {-1, 1, -1}, {-1, -1, 1}};
    const vfloat turn = vf_set(TRC_TWO_PI), scale = in[3], distortion = in[4];
    vfloat reduced[3], c[3];
    for (int i = 0; i < 3; i++)
        reduced[i] = math_modulo(in[i], turn);
    for (int i = 0; i < 3; i++)
        c[i] = magic_sum(reduced, first[i]) * vf_set(5.0f) * scale;
    c[0] = vf_sin(c[0]);
    c[1] = vf_cos(c[1]);
    c[2] = -vf_cos(c[2]);
    for (uint32_t k = 0; k < mode && k < MAGIC_DEPTH; k++) {
        const struct magic_fold *fold = &magic_folds[k];
        for (int i = 0; k == 0 && i < 3; i++)
            c[i] = c[i] * distortion;
        const vfloat sum = magic_sum(c, fold->of);
        const vfloat wave = fold->is_cosine ? vf_cos(sum) : vf_sin(sum);
        c[fold->target] = (fold->sign < 0 ? -wave : wave) * distortion;
    }
    const vfloat twice = distortion * vf_set(2.0f), half = vf_set(0.5f);
    const vmask bent = vf_ne(distortion, vf_zero());
    for (int i = 0; i < 3; i++)
        c[i] = half - vf_select(bent, c[i] / twice, c[i]);
    return v3(c[0], c[1], c[2]);
}

/* ---- brick ---- */

/* Cheap integer noise, [0, 1): the shade of a brick. */
TRC_INLINE vfloat brick_shade(vuint n) {
    const vuint positive = vu_set(0x7fffffff);
    n = (n + vu_set(1013)) & positive;
    n = n ^ (n >> 13);
    n = (n * (n * n * vu_set(60493) + vu_set(19990303)) + vu_set(1376312589)) & positive;
    return vf_set(0.5f) * (vi_to_float((vint)n) * vf_set(0x1p-30f));
}

/* Whether whole numbers a, as floats, are multiples of n. */
TRC_INLINE vmask is_multiple(vint a, uint32_t n) {
#if TRC_WIDTH == 1
    return vi_eq(a % (int32_t)n, 0);
#else
    return vi_eq(a % vi_set((int32_t)n), vi_set(0));
#endif
}

/* vector, mortar size, mortar smoothness, bias, brick width, row height, offset, squash -> shade of
 * the brick, share of mortar; mode: how often rows are offset, how often squashed */
static void op_brick(uint32_t mode, const vfloat *in, vfloat *out) {
    const uint32_t offset_every = mode & 127u,
                   squash_every = (mode >> TRC_BRICK_SQUASH_SHIFT) & 127u;
    const vfloat zero = vf_zero(), one = vf_one(), size = in[3], smooth = in[4], height = in[7];
    const vint row = vf_to_int(vf_floor(in[1] / height));
    vfloat width = in[6], shift = zero;
    if (offset_every && squash_every) {
        width = width * vf_select(is_multiple(row, squash_every), in[9], one);
        shift = vf_where(is_multiple(row, offset_every), width * in[8]);
    }
    const vint brick = vf_to_int(vf_floor((in[0] + shift) / width));
    const vfloat x = in[0] + shift - width * vi_to_float(brick);
    const vfloat y = in[1] - height * vi_to_float(row);
    const vuint number = ((vuint)row << 16) + ((vuint)brick & vu_set(0xffff));
    out[0] = vf_saturate(brick_shade(number) + in[5]);
    const vfloat edge = vf_min(vf_min(x, y), vf_min(width - x, height - y));
    const vfloat depth = one - edge / size, t = depth / smooth;
    const vfloat soft = t * t * (vf_set(3.0f) - vf_set(2.0f) * t);
    const vmask is_soft = vm_and(vf_ne(smooth, zero), vf_lt(depth, smooth));
    out[1] = vf_where(vf_lt(edge, size), vf_select(is_soft, soft, one));
}

#endif
