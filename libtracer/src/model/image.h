/* Images that Image and Environment nodes read: texels as the lookups want them.
 *
 * As in Cycles, what is stored is what the file or the caller gave: sRGB-encoded bytes stay encoded
 * and are decoded after filtering, and colours of images with alpha are multiplied by it before
 * filtering (in their encoding). Other encodings and colour spaces are converted to scene-linear
 * floats. Rows run from the bottom (v = 0) upwards, texels are RGBA.
 * Immutable once created; the count of holders is atomic. */
#ifndef TRACER_MODEL_IMAGE_H
#define TRACER_MODEL_IMAGE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "model/texel_format.h"

#define TRC_IMAGE_MAX_SIDE 65536u
#define TRC_IMAGE_MAX_TEXELS (1u << 30)
/* Texels of all levels are addressed by a signed 32-bit number of 4-byte words. */
#define TRC_IMAGE_MAX_BYTES (((uint64_t)1 << 33) - 4)
/* 65536 halved down to 1. */
#define TRC_IMAGE_MAX_LEVELS 17

struct trc_image_level {
    uint32_t width, height;
    void *texels;
};

struct trc_image {
    atomic_uint refs;
    enum trc_texel format;
    uint32_t is_srgb;       /* colours are sRGB-encoded: to be decoded after filtering */
    uint32_t is_associated; /* colours are multiplied by alpha: divided when alpha is used too */
    uint32_t level_count;   /* 1: only itself; smaller ones: image/levels.h; 0: no contents yet */
    bool will_have_levels;  /* of no contents yet: if they are large enough */
    enum trc_texel level_format; /* of those: linear light */
    struct trc_image_level levels[TRC_IMAGE_MAX_LEVELS];
    bool is_halved;           /* to fit the scene's limit: worth a warning */
    uint64_t bytes;           /* of the texels of all levels */
    uint64_t bad_texel_count; /* were NaN or infinite, and are 0 now: worth a warning */
};

/* Level 1 has a quarter of the sides and each one beyond half of those before it: half the sides
 * would cost four times the memory for what gains least. */
#define TRC_LEVEL_FIRST_LOG2 2
/* No side is shorter: by then an image costs no cache misses and has little left to average. */
#define TRC_LEVEL_MIN_SIDE 8u

#endif
