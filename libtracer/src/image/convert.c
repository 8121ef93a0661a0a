/* Conversion of an image's colours: see convert.h. */
#include "image/convert.h"

#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/reader.h"
#include "model/texel.h"

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

/* An image on its way to texels of another format, or in place. */
struct conversion {
    struct trc_image *image;
    const struct trc_color_source *source;
    enum trc_texel format;
    char *texels; /* NULL before there are any */
};

static trc_status begin(void *context) {
    struct conversion *c = context;
    const struct trc_image_level *level = &c->image->levels[0];
    const uint64_t count = (uint64_t)level->width * level->height;
    const uint64_t bytes = count * trc_texel_bytes(c->format);
    if (bytes == c->image->bytes) {
        c->texels = level->texels;
        return TRC_OK;
    }
    TRC_TRY(trc_image_check_size(level->width, level->height, c->format, ""));
    c->texels = trc_alloc(count, trc_texel_bytes(c->format));
    return c->texels ? TRC_OK
                     : trc_fail(TRC_ERROR_OUT_OF_MEMORY,
                                "no memory for an image of %" PRIu64 " bytes", bytes);
}

static void load(void *context, uint64_t first, uint32_t count, float *rgba) {
    const struct conversion *c = context;
    const enum trc_texel format = c->image->format;
    load_texels(format, (const char *)c->image->levels[0].texels + first * trc_texel_bytes(format),
                count, rgba);
    if (c->source->is_multiplied)
        scale_by_alpha(rgba, count, true);
}

/* Texels that are stored on the way, on the stack. */
#define BATCH 512

static void store_batch(const struct conversion *c, uint64_t first, uint32_t count,
                        const float *colors) {
    float rgba[4 * BATCH];
    memcpy(rgba, colors, 4 * count * sizeof *rgba);
    for (uint32_t i = 0; c->source->is_grey && i < count; i++) {
        float *t = rgba + 4 * (size_t)i;
        t[0] = t[1] = t[2] = (t[0] + t[1] + t[2]) * (1.0f / 3.0f);
    }
    if (c->source->is_multiplied)
        scale_by_alpha(rgba, count, false);
    store_texels(c->format, rgba, count, c->texels + first * trc_texel_bytes(c->format));
}

static void store(void *context, uint64_t first, uint32_t count, const float *rgba) {
    for (uint32_t done = 0; done < count; done += BATCH)
        store_batch(context, first + done, count - done < BATCH ? count - done : BATCH,
                    rgba + 4 * (size_t)done);
}

trc_status trc_image_to_scene_linear(struct trc_image *image, const struct trc_image_source *from,
                                     const struct trc_color_source *source) {
    struct trc_image_level *level = &image->levels[0];
    struct conversion conversion = {.image = image,
                                    .source = source,
                                    .format = image->format == TRC_TEXEL_F32 ? TRC_TEXEL_F32
                                                                             : TRC_TEXEL_F16};
    const struct trc_color_batches batches = {.context = &conversion,
                                              .cancel = from->cancel,
                                              .count = (uint64_t)level->width * level->height,
                                              .begin = begin,
                                              .load = load,
                                              .store = store};
    const trc_status status =
        trc_image_reader_convert(from->reader, source->config, source->space, &batches);
    if (!conversion.texels)
        return status;
    if (conversion.texels != level->texels)
        trc_free(level->texels);
    level->texels = conversion.texels;
    image->format = conversion.format;
    image->bytes = batches.count * trc_texel_bytes(conversion.format);
    return status;
}
