/* How texels are stored: their sizes, and half floats. */
#ifndef TRACER_MODEL_TEXEL_H
#define TRACER_MODEL_TEXEL_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "model/image.h"

/* 1.0 and the largest number as half floats, and what all infinities and NaN have set. */
#define TRC_HALF_ONE 0x3c00u
#define TRC_HALF_MAX 65504.0f
#define TRC_HALF_EXPONENT 0x7c00u

static inline uint64_t trc_texel_bytes(enum trc_texel format) {
    static const uint8_t bytes[] = {
        [TRC_TEXEL_U8] = 4, [TRC_TEXEL_U16] = 8, [TRC_TEXEL_F16] = 8, [TRC_TEXEL_F32] = 16};
    return bytes[format];
}

static inline float trc_half_to_float(uint16_t half) {
    const uint32_t bits = (uint32_t)(half & 0x7fffu) << 13;
    float value;
    memcpy(&value, &bits, sizeof value);
    value *= 0x1p112f;
    return half & 0x8000u ? -value : value;
}

/* To the nearest half float; infinite above the largest. */
static inline uint16_t trc_float_to_half(float value) {
    const float scaled = fminf(fabsf(value), 65536.0f) * 0x1p-112f;
    uint32_t bits;
    memcpy(&bits, &scaled, sizeof bits);
    bits += 0x0fffu + ((bits >> 13) & 1u); /* ties to even */
    return (uint16_t)(bits >> 13 | (signbit(value) ? 0x8000u : 0u));
}

#endif
