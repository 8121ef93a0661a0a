/* Gradient noise and its fractals: the Noise and Musgrave textures.
 *
 * K. Perlin, "Improving Noise" (2002), with hashed gradients in one to four dimensions;
 * F. K. Musgrave, in D. S. Ebert et al., "Texturing and Modeling: A Procedural Approach" (3rd
 * edition 2002), chapter 16. The sets of gradients, the scales and the offsets are those of
 * Cycles. */
#include "kernels/program/noise.h"
#include "kernels/program/hash.h"
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

/* ---- one octave ---- */

/* The sign of a turned around in lanes where that bit (0 to 3) of h is set. */
TRC_INLINE vfloat flip_by_bit(vfloat a, vuint h, int bit) {
    const vuint sign = ((h >> bit) & vu_set(1)) << 31;
    return vi_as_float(vf_as_int(a) ^ (vint)sign);
}
TRC_INLINE vmask vu_below(vuint a, int32_t limit) { return vi_lt((vint)a, vi_set(limit)); }

/* The gradient that a corner's hash chooses, times the way d from that corner. Two dimensions have
 * slopes (1, 2), three and four the middles of a cube's edges and a tesseract's faces. */
TRC_INLINE vfloat noise_gradient(int dims, vuint hash, const vfloat d[TRC_MAX_DIMENSIONS]) {
    if (dims == 1) {
        const vfloat slope = vf_one() + vi_to_float((vint)(hash & vu_set(7)));
        return flip_by_bit(slope, hash, 3) * d[0];
    }
    if (dims == 2) {
        const vmask low = vu_below(hash & vu_set(7), 4);
        const vfloat u = vf_select(low, d[0], d[1]);
        const vfloat v = vf_set(2.0f) * vf_select(low, d[1], d[0]);
        return flip_by_bit(u, hash, 0) + flip_by_bit(v, hash, 1);
    }
    if (dims == 3) {
        const vuint h = hash & vu_set(15);
        const vmask x_again = vi_eq((vint)(h & vu_set(13)), vi_set(12)); /* 12 or 14 */
        const vfloat u = vf_select(vu_below(h, 8), d[0], d[1]);
        const vfloat v = vf_select(vu_below(h, 4), d[1], vf_select(x_again, d[0], d[2]));
        return flip_by_bit(u, h, 0) + flip_by_bit(v, h, 1);
    }
    const vuint h = hash & vu_set(31);
    const vfloat u = vf_select(vu_below(h, 24), d[0], d[1]);
    const vfloat v = vf_select(vu_below(h, 16), d[1], d[2]);
    const vfloat s = vf_select(vu_below(h, 8), d[2], d[3]);
    return flip_by_bit(u, h, 0) + flip_by_bit(v, h, 1) + flip_by_bit(s, h, 2);
}

/* Corners of the cell are numbered by bits: bit i is set on the far side of axis i. */
TRC_INLINE vfloat noise_lattice(int dims, const vfloat *p) {
    vuint cell[TRC_MAX_DIMENSIONS];
    vfloat near[TRC_MAX_DIMENSIONS], fade[TRC_MAX_DIMENSIONS], corner[1 << TRC_MAX_DIMENSIONS];
    for (int i = 0; i < dims; i++) {
        const vfloat whole = vf_floor(p[i]), t = p[i] - whole;
        cell[i] = (vuint)vf_to_int(whole);
        near[i] = t;
        fade[i] = t * t * t * (t * (t * vf_set(6.0f) - vf_set(15.0f)) + vf_set(10.0f));
    }
    for (int k = 0; k < 1 << dims; k++) {
        vuint key[TRC_MAX_DIMENSIONS];
        vfloat d[TRC_MAX_DIMENSIONS];
        for (int i = 0; i < dims; i++) {
            const int far = (k >> i) & 1;
            key[i] = cell[i] + vu_set((uint32_t)far);
            d[i] = near[i] - vf_set((float)far);
        }
        corner[k] = noise_gradient(dims, hash_words(dims, key), d);
    }
    for (int i = 0; i < dims; i++) {
        for (int k = 0; k < 1 << (dims - 1 - i); k++)
            corner[k] = vf_lerp(corner[2 * k], corner[2 * k + 1], fade[i]);
    }
    return corner[0];
}

/* In [-1, 1]; 0 where a coordinate is not finite. */
static vfloat noise_signed(int dims, const vfloat *p) {
    vfloat r;
    switch (dims) { /* each with its own loops */
    case 1:
        r = noise_lattice(1, p) * vf_set(0.25f);
        break;
    case 2:
        r = noise_lattice(2, p) * vf_set(0.6616f);
        break;
    case 3:
        r = noise_lattice(3, p) * vf_set(0.9820f);
        break;
    default:
        r = noise_lattice(4, p) * vf_set(0.8344f);
        break;
    }
    return vf_where(vf_eq(r - r, vf_zero()), r);
}

/* ---- fractals ---- */

/* Sums as they grow: how depends on the type. */
struct fractal_sum {
    vfloat value;
    vfloat amplitude;
    vfloat weight; /* of the next octave; FBM: sum of amplitudes */
    vfloat signal; /* of the last octave, ridged only */
};

/* Below it, a hybrid multifractal has no further octave. */
#define HYBRID_CUTOFF 0.001f

/* One octave of noise n, counted by share, after the first. */
TRC_INLINE struct fractal_sum fractal_add(const struct fractal *f, struct fractal_sum s, vfloat n,
                                          vfloat share) {
    const vfloat one = vf_one();
    switch (f->type) {
    case TRC_FRACTAL_MULTIFRACTAL:
        s.value = s.value * (share * s.amplitude * n + one);
        break;
    case TRC_FRACTAL_HETERO_TERRAIN:
        s.value = s.value + share * ((n + f->offset) * s.amplitude * s.value);
        break;
    case TRC_FRACTAL_HYBRID_MULTIFRACTAL: {
        const vmask counts = vf_gt(s.weight, vf_set(HYBRID_CUTOFF));
        const vfloat weight = vf_min(s.weight, one);
        const vfloat signal = (n + f->offset) * s.amplitude;
        s.value = vf_select(counts, s.value + share * weight * signal, s.value);
        s.weight = vf_select(counts, weight * (f->gain * signal), s.weight);
        break;
    }
    case TRC_FRACTAL_RIDGED_MULTIFRACTAL: {
        const vfloat ridge = f->offset - vf_abs(n);
        s.signal = ridge * ridge * vf_saturate(s.signal * f->gain);
        s.value = s.value + s.signal * s.amplitude;
        break;
    }
    default:
        s.value = s.value + share * (n * s.amplitude);
        s.weight = s.weight + share * s.amplitude;
        break;
    }
    s.amplitude = s.amplitude * f->roughness;
    return s;
}

/* The first octave of those types that treat it otherwise. */
TRC_INLINE struct fractal_sum fractal_first(const struct fractal *f, vfloat n) {
    struct fractal_sum s = {.amplitude = f->roughness, .weight = vf_one()};
    if (f->type == TRC_FRACTAL_HETERO_TERRAIN) {
        s.value = n + f->offset;
        s.signal = vf_zero();
    } else {
        const vfloat ridge = f->offset - vf_abs(n);
        s.value = s.signal = ridge * ridge;
    }
    return s;
}

TRC_INLINE struct fractal_sum fractal_select(vmask m, struct fractal_sum a, struct fractal_sum b) {
    return (struct fractal_sum){vf_select(m, a.value, b.value),
                                vf_select(m, a.amplitude, b.amplitude),
                                vf_select(m, a.weight, b.weight), vf_select(m, a.signal, b.signal)};
}

/* FBM normalised to [0, 1]: between the mean with and without the last octave. */
TRC_INLINE vfloat fbm_unit(vfloat value, vfloat weight) {
    return vf_set(0.5f) * value / weight + vf_set(0.5f);
}

vfloat trc_fractal_noise(const struct fractal *f, const vfloat *place) {
    const bool starts =
        f->type == TRC_FRACTAL_HETERO_TERRAIN || f->type == TRC_FRACTAL_RIDGED_MULTIFRACTAL;
    const vfloat zero = vf_zero(), one = vf_one();
    vfloat whole = vf_floor(f->octaves), rest = f->octaves - whole, scale = one;
    vfloat p[TRC_MAX_DIMENSIONS];
    for (int i = 0; i < f->dims; i++)
        p[i] = place[i];
    struct fractal_sum s = {zero, one, zero, zero};
    int done = 0;
    if (f->type == TRC_FRACTAL_MULTIFRACTAL)
        s.value = one;
    else if (f->type == TRC_FRACTAL_HYBRID_MULTIFRACTAL)
        s.weight = one;
    if (starts) {
        s = fractal_first(f, noise_signed(f->dims, p));
        whole = vf_max(whole, one);
        done = 1;
    }
    if (f->type == TRC_FRACTAL_RIDGED_MULTIFRACTAL)
        rest = zero;
    vfloat unit = vf_set(0.5f);
    for (;; done++) {
        const vfloat number = vf_set((float)done);
        const vmask full = vf_lt(number, whole);
        const vmask part = vm_and(vf_eq(number, whole), vf_gt(rest, zero));
        if (!vm_any(vm_or(full, part)))
            break;
        if (done > 0) { /* the product with a power of a lacunarity of 2 is exact either way */
            scale = scale * f->lacunarity;
            for (int i = 0; i < f->dims; i++)
                p[i] = place[i] * scale;
        }
        const vfloat n = noise_signed(f->dims, p);
        if (f->type == TRC_FRACTAL_FBM_UNIT && vm_any(part)) {
            const struct fractal_sum more = fractal_add(f, s, n, one);
            const vfloat a = fbm_unit(s.value, s.weight), b = fbm_unit(more.value, more.weight);
            unit = vf_select(part, vf_lerp(a, b, rest), unit);
        }
        const struct fractal_sum next = fractal_add(f, s, n, vf_select(full, one, rest));
        s = fractal_select(vm_or(full, part), next, s);
    }
    if (f->type != TRC_FRACTAL_FBM_UNIT)
        return s.value;
    return vf_select(vf_gt(rest, zero), unit, fbm_unit(s.value, s.weight));
}

/* ---- textures ---- */

/* Far places that make independent noises of one, by seed: 100 to 200 along each axis. */
TRC_INLINE void noise_moved(int dims, const vfloat *p, int seed, vfloat *out) {
    const vfloat hundred = vf_set(100.0f), s = vf_set((float)seed);
    for (int i = 0; i < dims; i++) {
        const vfloat h = dims == 1 ? hash1(s) : hash2(s, vf_set((float)i));
        out[i] = p[i] + (hundred + h * hundred);
    }
}

void trc_program_noise(uint32_t mode, const vfloat *in, vfloat *out) {
    const struct fractal f = {.type = (mode & ~TRC_MODE_NO_COLOR) >> TRC_NOISE_TYPE_SHIFT,
                              .dims = (int)(mode & TRC_DIMENSIONS_MASK) + 1,
                              .octaves =
                                  vf_clamp(in[TRC_OP_AT(NOISE, octaves)], 0.0f, TRC_MAX_OCTAVES),
                              .roughness = in[TRC_OP_AT(NOISE, roughness)],
                              .lacunarity = in[TRC_OP_AT(NOISE, lacunarity)],
                              .offset = in[TRC_OP_AT(NOISE, offset)],
                              .gain = in[TRC_OP_AT(NOISE, gain)]};
    const vfloat distortion = in[TRC_OP_AT(NOISE, distortion)];
    vfloat p[TRC_MAX_DIMENSIONS], moved[TRC_MAX_DIMENSIONS];
    place_of(f.dims, in + TRC_OP_AT(NOISE, vector), in[TRC_OP_AT(NOISE, w)], p);
    if (vm_any(vf_ne(distortion, vf_zero()))) {
        vfloat shift[TRC_MAX_DIMENSIONS];
        for (int i = 0; i < f.dims; i++) {
            noise_moved(f.dims, p, i, moved);
            shift[i] = noise_signed(f.dims, moved) * distortion;
        }
        for (int i = 0; i < f.dims; i++)
            p[i] = p[i] + shift[i];
    }
    vfloat *color = out + TRC_OP_OUT_AT(NOISE, color);
    out[TRC_OP_OUT_AT(NOISE, value)] = color[0] = color[1] = color[2] = trc_fractal_noise(&f, p);
    if (mode & TRC_MODE_NO_COLOR)
        return;
    for (int i = 0; i < 2; i++) {
        noise_moved(f.dims, p, f.dims + i, moved);
        color[1 + i] = trc_fractal_noise(&f, moved);
    }
}
