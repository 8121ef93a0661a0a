/* Levels of images: see levels.h. */
#include "image/levels.h"

#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/texel.h"

#define BLOCK (1 << TRC_LEVEL_FIRST_LOG2)
#define BLOCK_SHARE (1.0f / (BLOCK * BLOCK))

/* sRGB-encoded bytes times four, so that means of four need no rounding, to light. */
#define LIGHT_COUNT (4 * UINT8_MAX + 1)

/* Simpson's rule in two dimensions for the mean of decoded bilinear interpolation: shares of
 * texels, of the middles between two and of those between four. */
#define TEXEL_SHARE (4.0f / 36.0f)
#define EDGE_SHARE (8.0f / 36.0f) /* of either direction */
#define SQUARE_SHARE (16.0f / 36.0f)

static void light_make(float light[LIGHT_COUNT]) {
    for (int i = 0; i < LIGHT_COUNT; i++) {
        const float x = (float)i / (4 * UINT8_MAX);
        light[i] = x < 0.04045f ? x / 12.92f : powf((x + 0.055f) / 1.055f, 2.4f);
    }
}

static void texel_load(enum trc_texel format, const void *texels, uint64_t i, float out[4]) {
    for (int c = 0; c < 4; c++) {
        switch (format) {
        case TRC_TEXEL_U8:
            out[c] = (float)((const uint8_t *)texels)[4 * i + c] / UINT8_MAX;
            break;
        case TRC_TEXEL_U16:
            out[c] = (float)((const uint16_t *)texels)[4 * i + c] / UINT16_MAX;
            break;
        case TRC_TEXEL_F16:
            out[c] = trc_half_to_float(((const uint16_t *)texels)[4 * i + c]);
            break;
        case TRC_TEXEL_F32:
        default:
            out[c] = ((const float *)texels)[4 * i + c];
            break;
        }
    }
}

static void texel_store(enum trc_texel format, const float value[4], void *texels, uint64_t i) {
    for (int c = 0; c < 4; c++) {
        if (format == TRC_TEXEL_F32)
            ((float *)texels)[4 * i + c] = value[c];
        else
            ((uint16_t *)texels)[4 * i + c] = trc_float_to_half(value[c]);
    }
}

/* Means of blocks of step by step texels. */
static void fill_means(enum trc_texel from_format, const struct trc_image_level *from,
                       uint32_t step, enum trc_texel format, const struct trc_image_level *to) {
    const float share = 1.0f / (float)(step * step);
    for (uint64_t y = 0; y < to->height; y++)
        for (uint64_t x = 0; x < to->width; x++) {
            float mean[4] = {0.0f, 0.0f, 0.0f, 0.0f};
            for (uint64_t k = 0; k < (uint64_t)step * step; k++) {
                float texel[4];
                const uint64_t row = step * y + k / step, column = step * x + k % step;
                texel_load(from_format, from->texels, row * from->width + column, texel);
                for (int c = 0; c < 4; c++)
                    mean[c] += share * texel[c];
            }
            texel_store(format, mean, to->texels, y * to->width + x);
        }
}

/* The light of a block of encoded bytes. What lies on its border counts by half. */
static void block_light(const float light[LIGHT_COUNT], const struct trc_image_level *from,
                        uint64_t x, uint64_t y, float mean[3]) {
    for (int c = 0; c < 3; c++)
        mean[c] = 0.0f;
    for (uint64_t j = 0; j <= BLOCK; j++) {
        const uint64_t high = y + j < from->height ? y + j : from->height - 1;
        const uint64_t low = y + j ? y + j - 1 : 0;
        const uint8_t *above = (const uint8_t *)from->texels + 4 * high * from->width;
        const uint8_t *below = (const uint8_t *)from->texels + 4 * low * from->width;
        const float row_share = j % BLOCK ? 1.0f : 0.5f;
        for (uint64_t i = 0; i <= BLOCK; i++) {
            const uint64_t right = 4 * (x + i < from->width ? x + i : from->width - 1);
            const uint64_t left = 4 * (x + i ? x + i - 1 : 0);
            const float share = i % BLOCK ? 1.0f : 0.5f;
            for (int c = 0; c < 3; c++) {
                const int beside = above[left + c], texel = above[right + c];
                const int under = below[right + c];
                float sum = SQUARE_SHARE * share * row_share *
                            light[below[left + c] + under + beside + texel];
                if (j < BLOCK)
                    sum += EDGE_SHARE * share * light[2 * (beside + texel)];
                if (i < BLOCK)
                    sum += EDGE_SHARE * row_share * light[2 * (under + texel)];
                if (i < BLOCK && j < BLOCK)
                    sum += TEXEL_SHARE * light[4 * texel];
                mean[c] += BLOCK_SHARE * sum;
            }
        }
    }
}

static void fill_light(const struct trc_image_level *from, const struct trc_image_level *to) {
    float light[LIGHT_COUNT];
    light_make(light);
    for (uint64_t y = 0; y < to->height; y++)
        for (uint64_t x = 0; x < to->width; x++) {
            float mean[4];
            block_light(light, from, BLOCK * x, BLOCK * y, mean);
            mean[3] = 1.0f;
            texel_store(TRC_TEXEL_F16, mean, to->texels, y * to->width + x);
        }
}

static bool is_opaque(const struct trc_image *image) {
    const struct trc_image_level *level = &image->levels[0];
    const uint64_t count = (uint64_t)level->width * level->height;
    for (uint64_t i = 0; i < count; i++) {
        float texel[4];
        texel_load(image->format, level->texels, i, texel);
        if (texel[3] != 1.0f)
            return false;
    }
    return true;
}

/* Adds one level; whether there was one to add in *added. */
static trc_status level_add(struct trc_image *image, bool *added) {
    const uint32_t last = image->level_count - 1, step = last ? 2 : BLOCK;
    const struct trc_image_level *from = &image->levels[last];
    struct trc_image_level to = {from->width / step, from->height / step, NULL};
    *added = from->width % step == 0 && from->height % step == 0 &&
             to.width >= TRC_LEVEL_MIN_SIDE && to.height >= TRC_LEVEL_MIN_SIDE;
    if (!*added)
        return TRC_OK;
    const uint64_t count = (uint64_t)to.width * to.height;
    to.texels = trc_alloc(count, trc_texel_bytes(image->level_format));
    if (!to.texels)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a level of %" PRIu64 " texels",
                        count);
    if (image->is_srgb && !last)
        fill_light(from, &to);
    else
        fill_means(last ? image->level_format : image->format, from, step, image->level_format,
                   &to);
    image->levels[image->level_count++] = to;
    image->bytes += count * trc_texel_bytes(image->level_format);
    return TRC_OK;
}

trc_status trc_image_make_levels(struct trc_image *image) {
    if ((image->is_srgb && image->format != TRC_TEXEL_U8) || !is_opaque(image))
        return TRC_OK;
    image->level_format = image->format == TRC_TEXEL_F32 ? TRC_TEXEL_F32 : TRC_TEXEL_F16;
    for (bool added = true; added;)
        TRC_TRY(level_add(image, &added));
    return TRC_OK;
}
