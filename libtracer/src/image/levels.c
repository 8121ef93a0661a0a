/* Levels of images: see levels.h. */
#include "image/levels.h"

#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/texel.h"

#define BLOCK (1 << TRC_LEVEL_FIRST_LOG2)
#define BLOCK_SHARE (1.0f / (BLOCK * BLOCK))

/* Simpson's rule in two dimensions for the mean of decoded bilinear interpolation: shares of
 * texels, of the middles between two and of those between four. */
#define TEXEL_SHARE (4.0f / 36.0f)
#define EDGE_SHARE (8.0f / 36.0f) /* of either direction */
#define SQUARE_SHARE (16.0f / 36.0f)

/* What texels of a block, and middles between them, add to its light: by the sum of the encoded
 * bytes of one, two or four, so that no mean is rounded. */
struct light_tables {
    float texel[UINT8_MAX + 1], edge[2 * UINT8_MAX + 1], square[4 * UINT8_MAX + 1];
};

static float light_of(float x) {
    return x < 0.04045f ? x / 12.92f : powf((x + 0.055f) / 1.055f, 2.4f);
}

static void tables_make(struct light_tables *tables) {
    for (int i = 0; i <= 4 * UINT8_MAX; i++) {
        const float light = BLOCK_SHARE * light_of((float)i / (4 * UINT8_MAX));
        tables->square[i] = SQUARE_SHARE * light;
        if (i % 2 == 0)
            tables->edge[i / 2] = EDGE_SHARE * light;
        if (i % 4 == 0)
            tables->texel[i / 4] = TEXEL_SHARE * light;
    }
}

static float channel_of(enum trc_texel format, const void *texels, uint64_t i) {
    switch (format) {
    case TRC_TEXEL_U8:
        return (float)((const uint8_t *)texels)[i] / UINT8_MAX;
    case TRC_TEXEL_U16:
        return (float)((const uint16_t *)texels)[i] / UINT16_MAX;
    case TRC_TEXEL_F16:
        return trc_half_to_float(((const uint16_t *)texels)[i]);
    case TRC_TEXEL_F32:
    default:
        return ((const float *)texels)[i];
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
                const uint64_t row = step * y + k / step, column = step * x + k % step;
                const uint64_t texel = 4 * (row * from->width + column);
                for (uint64_t c = 0; c < 4; c++)
                    mean[c] += share * channel_of(from_format, from->texels, texel + c);
            }
            texel_store(format, mean, to->texels, y * to->width + x);
        }
}

/* Rows whose middles with the row below them lie on one line of a block; of the lowest and the
 * highest line, which lie on its border, half counts. */
struct line {
    const uint8_t *row, *below;
    float share;
    float left[3]; /* of the middles between a block and the one before it, in channels */
};

/* Middles between texel x of a line's row and the one after it. has_row: texels of the row itself
 * count, not only what lies below them. */
static inline float right_of(const struct light_tables *t, const struct line *line, uint64_t x,
                             uint64_t after, bool has_row) {
    const int texel = line->row[x], beside = line->row[after];
    const int both = texel + beside, under = line->below[x] + line->below[after];
    return line->share * t->square[both + under] + (has_row ? t->edge[both] : 0.0f);
}

/* Adds what a block of a line has to its light. x: of its first texel; what lies on its border
 * counts by half. */
static inline void line_add(const struct light_tables *t, struct line *line, uint64_t x,
                            uint64_t width, bool has_row, float mean[3]) {
    for (uint64_t c = 0; c < 3; c++) {
        float rights = 0.5f * line->left[c], others = 0.0f, right = 0.0f;
        for (uint64_t i = 0; i < BLOCK; i++) {
            const uint64_t at = 4 * (x + i) + c, after = x + i + 1 < width ? at + 4 : at;
            const int texel = line->row[at];
            rights += right;
            others += line->share * t->edge[texel + line->below[at]];
            others += has_row ? t->texel[texel] : 0.0f;
            right = right_of(t, line, at, after, has_row);
        }
        mean[c] += rights + 0.5f * right + others;
        line->left[c] = right;
    }
}

/* Blocks of encoded bytes. */
static void fill_light(const struct trc_image_level *from, const struct trc_image_level *to) {
    struct light_tables tables;
    tables_make(&tables);
    for (uint64_t y = 0; y < to->height; y++) {
        struct line lines[BLOCK + 1];
        for (uint64_t j = 0; j <= BLOCK; j++) {
            const uint64_t row = BLOCK * y + j, last = from->height - 1;
            const uint8_t *texels = from->texels;
            lines[j].row = texels + 4 * (row < last ? row : last) * from->width;
            lines[j].below = texels + 4 * (row ? row - 1 : 0) * from->width;
            lines[j].share = j % BLOCK ? 1.0f : 0.5f;
            for (uint64_t c = 0; c < 3; c++)
                lines[j].left[c] = right_of(&tables, &lines[j], c, c, j < BLOCK);
        }
        for (uint64_t x = 0; x < to->width; x++) {
            float mean[4] = {0.0f, 0.0f, 0.0f, 1.0f};
            for (int j = 0; j < BLOCK; j++)
                line_add(&tables, &lines[j], BLOCK * x, from->width, true, mean);
            line_add(&tables, &lines[BLOCK], BLOCK * x, from->width, false, mean);
            texel_store(TRC_TEXEL_F16, mean, to->texels, y * to->width + x);
        }
    }
}

static bool is_opaque(const struct trc_image *image) {
    const struct trc_image_level *level = &image->levels[0];
    const uint64_t count = (uint64_t)level->width * level->height;
    for (uint64_t i = 0; i < count; i++)
        if (channel_of(image->format, level->texels, 4 * i + 3) != 1.0f)
            return false;
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
