/* Regular patterns: the Wave, Magic and Brick textures, as in Cycles 3.4 (Magic: and 5.2). */
#include "kernels/program/hash.h"
#include "kernels/program/noise.h"
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

/* ---- wave ---- */

/* How far along the bands, or from the axis or the centre of the rings. */
TRC_INLINE vfloat wave_place(uint32_t mode, vvec3 p) {
    const uint32_t direction = (mode >> TRC_WAVE_DIRECTION_SHIFT) & TRC_WAVE_DIRECTION_MASK;
    const vfloat c[3] = {p.x, p.y, p.z};
    if (!(mode & TRC_WAVE_RINGS)) {
        return direction != TRC_WAVE_DIAGONAL ? c[direction] * vf_set(20.0f)
                                              : (p.x + p.y + p.z) * vf_set(10.0f);
    }
    vfloat sum = vf_zero();
    for (uint32_t i = 0; i < 3; i++)
        sum = i == direction ? sum : sum + c[i] * c[i];
    return vf_sqrt(sum) * vf_set(20.0f);
}

/* n: the phase, in radians. */
TRC_INLINE vfloat wave_profile(uint32_t mode, vfloat n) {
    const vfloat half = vf_set(0.5f), two = vf_set(2.0f);
    const vfloat turns = n / vf_set(TRC_TWO_PI);
    switch (mode & TRC_WAVE_PROFILE_MASK) {
    case TRC_WAVE_SINE:
        return half + half * vf_sin(n - vf_set(TRC_HALF_PI));
    case TRC_WAVE_SAW:
        return turns - vf_floor(turns);
    default:
        return vf_abs(turns - vf_floor(turns + half)) * two;
    }
}

void trc_program_wave(uint32_t mode, const vfloat *in, vfloat *out) {
    /* The shift and the shrinking keep whole coordinates off the edges. */
    const vfloat shift = vf_set(0.000001f), shrink = vf_set(0.999999f);
    const vfloat one = vf_one(), two = vf_set(2.0f);
    const vvec3 v = v3_read(in + TRC_OP_AT(WAVE, vector));
    const vvec3 p = v3((v.x + shift) * shrink, (v.y + shift) * shrink, (v.z + shift) * shrink);
    const vfloat distortion = in[TRC_OP_AT(WAVE, distortion)];
    const vmask is_bent = vf_ne(distortion, vf_zero());
    vfloat n = wave_place(mode, p) + in[TRC_OP_AT(WAVE, phase)];
    if (vm_any(is_bent)) {
        const struct fractal f = {.type = TRC_FRACTAL_FBM_UNIT,
                                  .dims = 3,
                                  .octaves =
                                      vf_clamp(in[TRC_OP_AT(WAVE, octaves)], 0.0f, TRC_MAX_OCTAVES),
                                  .roughness = vf_saturate(in[TRC_OP_AT(WAVE, roughness)]),
                                  .lacunarity = two};
        const vfloat finer = in[TRC_OP_AT(WAVE, detail_scale)];
        const vfloat place[TRC_MAX_DIMENSIONS] = {p.x * finer, p.y * finer, p.z * finer};
        const vfloat bent = n + distortion * (trc_fractal_noise(&f, place) * two - one);
        n = vf_select(is_bent, bent, n);
    }
    out[0] = wave_profile(mode, n);
}

/* ---- magic ---- */

/* One fold of the coordinates: the target becomes the sine or cosine of their signed sum. */
struct magic_fold {
    int8_t target, is_cosine, sign, of[3];
};
static const struct magic_fold magic_folds[TRC_MAGIC_MAX_DEPTH] = {
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

void trc_program_magic(uint32_t mode, const vfloat *in, vfloat *out) {
    static const int8_t first[3][3] = {{1, 1, 1}, {-1, 1, -1}, {-1, -1, 1}};
    const vfloat turn = vf_set(TRC_TWO_PI), one = vf_set(1.0f), scale = in[TRC_OP_AT(MAGIC, scale)];
    const bool scaled_first = mode & TRC_MAGIC_SCALED_FIRST;
    const vfloat before = scaled_first ? scale : one, after = scaled_first ? one : scale;
    const vfloat distortion = in[TRC_OP_AT(MAGIC, distortion)];
    const uint32_t depth = mode & TRC_MAGIC_DEPTH_MASK;
    vfloat reduced[3], c[3];
    for (int i = 0; i < 3; i++)
        reduced[i] = math_modulo(in[TRC_OP_AT(MAGIC, vector) + i] * before, turn);
    for (int i = 0; i < 3; i++)
        c[i] = magic_sum(reduced, first[i]) * vf_set(5.0f) * after;
    c[0] = vf_sin(c[0]);
    c[1] = vf_cos(c[1]);
    c[2] = -vf_cos(c[2]);
    for (uint32_t k = 0; k < depth && k < TRC_MAGIC_MAX_DEPTH; k++) {
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
        out[i] = half - vf_select(bent, c[i] / twice, c[i]);
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

void trc_program_brick(uint32_t mode, const vfloat *in, vfloat *out) {
    const uint32_t offset_every = mode & TRC_BRICK_ROWS_MASK;
    const uint32_t squash_every = (mode >> TRC_BRICK_SQUASH_SHIFT) & TRC_BRICK_ROWS_MASK;
    const vvec3 p = v3_read(in + TRC_OP_AT(BRICK, vector));
    const vfloat zero = vf_zero(), one = vf_one();
    const vfloat size = in[TRC_OP_AT(BRICK, mortar_size)];
    const vfloat smooth = in[TRC_OP_AT(BRICK, mortar_smooth)];
    const vfloat height = in[TRC_OP_AT(BRICK, row_height)];
    const vint row = vf_to_int(vf_floor(p.y / height));
    vfloat width = in[TRC_OP_AT(BRICK, brick_width)], shift = zero;
    if (offset_every && squash_every) {
        width =
            width * vf_select(is_multiple(row, squash_every), in[TRC_OP_AT(BRICK, squash)], one);
        shift = vf_where(is_multiple(row, offset_every), width * in[TRC_OP_AT(BRICK, offset)]);
    }
    const vint brick = vf_to_int(vf_floor((p.x + shift) / width));
    const vfloat x = p.x + shift - width * vi_to_float(brick);
    const vfloat y = p.y - height * vi_to_float(row);
    const vuint number = ((vuint)row << 16) + ((vuint)brick & vu_set(0xffff));
    out[TRC_OP_OUT_AT(BRICK, shade)] =
        vf_saturate(brick_shade(number) + in[TRC_OP_AT(BRICK, bias)]);
    const vfloat edge = vf_min(vf_min(x, y), vf_min(width - x, height - y));
    const vfloat depth = one - edge / size, t = depth / smooth;
    const vfloat soft = t * t * (vf_set(3.0f) - vf_set(2.0f) * t);
    const vmask is_soft = vm_and(vf_ne(smooth, zero), vf_lt(depth, smooth));
    out[TRC_OP_OUT_AT(BRICK, mortar)] = vf_where(vf_lt(edge, size), vf_select(is_soft, soft, one));
}
