/* The Gradient texture, as in Cycles. */
#include "kernels/program/procedural.h"
#include "kernels/program/values.h"
#include "kernels/simd/wide_math.h"
#include "model/program.h"

static void gradient(uint32_t mode, const vfloat *in, vfloat *out) {
    const vvec3 p = v3_read(in + TRC_OP_AT(GRADIENT, vector));
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
    out[TRC_OP_OUT_AT(GRADIENT, value)] = vf_saturate(r);
}

const struct trc_texture TRC_TEXTURE_OF(GRADIENT) = {.run = gradient};
