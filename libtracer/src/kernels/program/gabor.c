/* The Gabor texture: waves under Gaussian windows, strewn over the cells of a grid.
 *
 * V. Tavernier et al., "Making Gabor Noise Fast and Normalized" (2019): as many waves in every
 * cell, with weights of 1 or -1, the sines of them as the value. T. Tricard et al., "Procedural
 * Phasor Noise" (2019): phase and intensity of the sum. The windows, which are Hann's on top of
 * Gauss's, the hashes and the scale of the values are those of Cycles. */
#include "kernels/program/hash.h"
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "model/program.h"

#define GABOR_WAVES 8 /* of a cell */
#define GABOR_MIN_FREQUENCY 0.001f
/* Standard deviations of the sum in two and three dimensions: of GABOR_WAVES waves of the integral
 * 1/4 or 1/(4 sqrt(2)), the mean square of whose weights is taken as 1/2; a value of 1 or -1 is six
 * of them. */
#define GABOR_DEVIATION_2D 1.0f
#define GABOR_DEVIATION_3D 0.840896415f
#define GABOR_DEVIATIONS 6.0f

struct gabor {
    int dims; /* 2 or 3 */
    vfloat frequency, isotropy;
    /* Two dimensions: the angle. Three: inclination and azimuth of the direction. In turns. */
    vfloat angle, azimuth;
    vvec3 direction; /* in three dimensions, of waves that are not turned */
};

/* Where a wave goes; key: its cell and the number of a hash. */
static vvec3 gabor_direction(const struct gabor *g, const vfloat key[TRC_MAX_DIMENSIONS]) {
    const vfloat half = vf_set(0.5f);
    vfloat sine, cosine;
    if (g->dims == 2) {
        const vfloat turned = (hash_value(3, key) - half) * half;
        vf_sincos_turns(g->angle + turned * g->isotropy, &sine, &cosine);
        return v3(cosine, sine, vf_zero());
    }
    if (!vm_any(vf_gt(g->isotropy, vf_zero())))
        return g->direction;
    const vvec3 turned = v3_scale(hash_color(4, key), half);
    vfloat across, along;
    vf_sincos_turns(g->angle + turned.x * g->isotropy, &sine, &cosine);
    vf_sincos_turns(g->azimuth + turned.y * g->isotropy, &across, &along);
    return v3_select(vf_gt(g->isotropy, vf_zero()), v3(sine * along, sine * across, cosine),
                     g->direction);
}

/* The middle of a wave within its cell. */
TRC_INLINE vvec3 gabor_middle(const struct gabor *g, const vfloat key[TRC_MAX_DIMENSIONS]) {
    if (g->dims == 3)
        return hash_color(4, key);
    return v3(hash_value(3, key), hash3(key[2], key[0], key[1]), vf_zero());
}

/* Adds the waves of a cell. place: as seen from its corner; real, imaginary: of the sum. */
static void gabor_cell(const struct gabor *g, const vfloat cell[3], vvec3 place, vfloat *real,
                       vfloat *imaginary) {
    vfloat key[TRC_MAX_DIMENSIONS] = {cell[0], cell[1], cell[2], vf_zero()};
    for (int i = 0; i < GABOR_WAVES; i++) {
        key[g->dims] = vf_set((float)(3 * i + 1));
        const vvec3 p = v3_sub(place, gabor_middle(g, key));
        const vfloat d2 = v3_dot(p, p);
        const vmask near = vf_lt(d2, vf_one());
        if (!vm_any(near))
            continue;
        key[g->dims] = vf_set((float)(3 * i));
        const vvec3 direction = gabor_direction(g, key);
        key[g->dims] = vf_set((float)(3 * i + 2));
        const vmask negative = vf_lt(hash_value(g->dims + 1, key), vf_set(0.5f));
        vfloat sine, cosine, unused;
        vf_sincos_turns(d2 * vf_set(0.5f), &unused, &cosine);
        const vfloat hann = vf_set(0.5f) + vf_set(0.5f) * cosine;
        vfloat size = vf_exp(-vf_set(TRC_PI) * d2) * hann;
        size = vf_select(negative, -size, size);
        vf_sincos_turns(g->frequency * v3_dot(p, direction), &sine, &cosine);
        *real = *real + vf_where(near, size * cosine);
        *imaginary = *imaginary + vf_where(near, size * sine);
    }
}

/* The cells around a place. */
static void gabor_sum(const struct gabor *g, vvec3 place, vfloat *real, vfloat *imaginary) {
    const vfloat x = vf_floor(place.x), y = vf_floor(place.y), z = vf_floor(place.z);
    const vvec3 local = v3(place.x - x, place.y - y, g->dims == 3 ? place.z - z : vf_zero());
    const int deep = g->dims == 3 ? 1 : 0;
    for (int k = -deep; k <= deep; k++)
        for (int j = -1; j <= 1; j++)
            for (int i = -1; i <= 1; i++) {
                const vvec3 step = v3(vf_set((float)i), vf_set((float)j), vf_set((float)k));
                const vfloat cell[3] = {x + step.x, y + step.y, z + step.z};
                gabor_cell(g, cell, v3_sub(local, step), real, imaginary);
            }
}

static void gabor(uint32_t mode, const vfloat *in, vfloat *out) {
    const vfloat inv_turn = vf_set(1.0f / TRC_TWO_PI);
    struct gabor g = {.dims = (int)(mode & TRC_DIMENSIONS_MASK) + 1};
    g.frequency = vf_max(in[TRC_OP_AT(GABOR, frequency)], vf_set(GABOR_MIN_FREQUENCY));
    g.isotropy = vf_one() - vf_saturate(in[TRC_OP_AT(GABOR, anisotropy)]);
    g.direction = v3_normalize(v3_read(in + TRC_OP_AT(GABOR, direction)));
    g.angle = in[TRC_OP_AT(GABOR, angle)] * inv_turn;
    if (g.dims == 3) {
        g.angle = vf_acos(g.direction.z) * inv_turn;
        g.azimuth = vf_atan2(g.direction.y, g.direction.x) * inv_turn;
    }
    vfloat real = vf_zero(), imaginary = vf_zero();
    gabor_sum(&g, v3_scale(v3_read(in + TRC_OP_AT(GABOR, vector)), in[TRC_OP_AT(GABOR, scale)]),
              &real, &imaginary);
    const float deviation = g.dims == 3 ? GABOR_DEVIATION_3D : GABOR_DEVIATION_2D;
    const vfloat unit = vf_set(1.0f / (GABOR_DEVIATIONS * deviation)), half = vf_set(0.5f);
    out[TRC_OP_OUT_AT(GABOR, value)] = imaginary * unit * half + half;
    out[TRC_OP_OUT_AT(GABOR, phase)] = vf_atan2(imaginary, real) * inv_turn + half;
    out[TRC_OP_OUT_AT(GABOR, intensity)] = vf_sqrt(real * real + imaginary * imaginary) * unit;
}

const struct trc_texture TRC_TEXTURE_OF(GABOR) = {.run = gabor};
