/* Conversion of an image's colours: see convert.h. */
#include "image/convert.h"

#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/color.h"
#include "image/texel.h"

#ifdef TRC_WITH_OIIO

/* Texels that are converted at once, on the stack. */
#define BATCH 512

/* Bytes and words are rounded to half floats, as Cycles reads them: what that loses shows where a
 * transform is steep. */
static void load_texels(enum trc_texel format, const void *texels, uint32_t count, float *rgba) {
    const uint8_t *b = texels;
    const uint16_t *h = texels;
    const float *f = texels;
    for (uint32_t i = 0; i < 4 * count; i++) {
        switch (format) {
        case TRC_TEXEL_U8:
            rgba[i] = trc_half_to_float(trc_float_to_half((float)b[i] / UINT8_MAX));
            break;
        case TRC_TEXEL_U16:
            rgba[i] = trc_half_to_float(trc_float_to_half((float)h[i] / UINT16_MAX));
            break;
        case TRC_TEXEL_F16:
            rgba[i] = trc_half_to_float(h[i]);
            break;
        case TRC_TEXEL_F32:
            rgba[i] = f[i];
            break;
        }
    }
}

/* What is too large for half floats becomes the largest; NaN stays one that is found later. */
static void store_texels(enum trc_texel format, const float *rgba, uint32_t count, void *texels) {
    uint16_t *h = texels;
    if (format == TRC_TEXEL_F32) {
        memcpy(texels, rgba, count * trc_texel_bytes(format));
        return;
    }
    for (uint32_t i = 0; i < 4 * count; i++) {
        const bool is_large = fabsf(rgba[i]) > TRC_HALF_MAX;
        h[i] = trc_float_to_half(is_large ? copysignf(TRC_HALF_MAX, rgba[i]) : rgba[i]);
    }
}

/* Multiplies the colours of texels that are neither opaque nor fully transparent by alpha, or
 * divides them by it. */
static void scale_by_alpha(float *rgba, uint32_t count, bool divide) {
    for (uint32_t i = 0; i < count; i++, rgba += 4) {
        if (rgba[3] <= 0.0f || rgba[3] == 1.0f)
            continue;
        const float scale = divide ? 1.0f / rgba[3] : rgba[3];
        for (int c = 0; c < 3; c++)
            rgba[c] *= scale;
    }
}

static trc_status convert_batch(const struct trc_color_transform *transform,
                                const struct trc_color_source *source, float *rgba,
                                uint32_t count) {
    if (source->is_multiplied)
        scale_by_alpha(rgba, count, true);
    TRC_TRY(trc_color_apply(transform, rgba, count));
    for (uint32_t i = 0; source->is_grey && i < count; i++) {
        float *t = rgba + 4 * (size_t)i;
        t[0] = t[1] = t[2] = (t[0] + t[1] + t[2]) * (1.0f / 3.0f);
    }
    if (source->is_multiplied)
        scale_by_alpha(rgba, count, false);
    return TRC_OK;
}

/* All texels, to texels of another format, or in place. */
static trc_status convert(const struct trc_image *image,
                          const struct trc_color_transform *transform,
                          const struct trc_color_source *source, enum trc_texel format,
                          char *texels) {
    const struct trc_image_level *level = &image->levels[0];
    const uint64_t count = (uint64_t)level->width * level->height;
    for (uint64_t first = 0; first < count; first += BATCH) {
        const uint32_t batch = count - first < BATCH ? (uint32_t)(count - first) : BATCH;
        float rgba[4 * BATCH];
        load_texels(image->format,
                    (const char *)level->texels + first * trc_texel_bytes(image->format), batch,
                    rgba);
        TRC_TRY(convert_batch(transform, source, rgba, batch));
        store_texels(format, rgba, batch, texels + first * trc_texel_bytes(format));
    }
    return TRC_OK;
}

static trc_status convert_level(struct trc_image *image,
                                const struct trc_color_transform *transform,
                                const struct trc_color_source *source) {
    struct trc_image_level *level = &image->levels[0];
    const uint64_t count = (uint64_t)level->width * level->height;
    const enum trc_texel format = image->format == TRC_TEXEL_F32 ? TRC_TEXEL_F32 : TRC_TEXEL_F16;
    const uint64_t bytes = count * trc_texel_bytes(format);
    void *texels = level->texels;
    if (bytes != image->bytes) {
        if (bytes > TRC_IMAGE_MAX_BYTES)
            return trc_fail(TRC_ERROR_TOO_LARGE, "an image of %" PRIu64 " bytes is too large",
                            bytes);
        texels = trc_alloc(count, trc_texel_bytes(format));
        if (!texels)
            return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an image of %" PRIu64 " bytes",
                            bytes);
    }
    const trc_status status = convert(image, transform, source, format, texels);
    if (texels != level->texels)
        trc_free(level->texels);
    level->texels = texels;
    image->format = format;
    image->bytes = bytes;
    return status;
}

trc_status trc_image_to_scene_linear(struct trc_image *image,
                                     const struct trc_color_source *source) {
    struct trc_color_transform *transform;
    TRC_TRY(trc_color_open(source->config, source->space, &transform));
    const trc_status status = transform ? convert_level(image, transform, source) : TRC_OK;
    trc_color_close(transform);
    return status;
}

#else

trc_status trc_image_to_scene_linear(struct trc_image *image,
                                     const struct trc_color_source *source) {
    (void)image;
    return trc_fail(TRC_ERROR_UNSUPPORTED,
                    "this build cannot convert colour spaces (no OpenImageIO): %s", source->space);
}

#endif
