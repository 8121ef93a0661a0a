/* Storage of images: from pixels or files to texels ready for lookups. */
#include "image/image.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/convert.h"
#include "image/levels.h"
#include "image/reader.h"
#include "model/texel.h"

/* ---- life ---- */

struct trc_image *trc_image_retain(struct trc_image *image) {
    if (image)
        atomic_fetch_add_explicit(&image->refs, 1, memory_order_relaxed);
    return image;
}

static void image_free(struct trc_image *image) {
    for (uint32_t i = 0; i < image->level_count; i++)
        trc_free(image->levels[i].texels);
    trc_free(image);
}

void trc_image_release(struct trc_image *image) {
    if (!image)
        return;
    if (atomic_fetch_sub_explicit(&image->refs, 1, memory_order_acq_rel) == 1)
        image_free(image);
}

uint64_t trc_image_bytes(const struct trc_image *image) { return image ? image->bytes : 0; }

trc_status trc_image_check_size(uint32_t width, uint32_t height, uint32_t format,
                                const char *name) {
    const uint64_t texels = (uint64_t)width * height;
    /* Sides of 32 bits have too many texels before these have too many bytes for 64. */
    if (width <= TRC_IMAGE_MAX_SIDE && height <= TRC_IMAGE_MAX_SIDE &&
        texels <= TRC_IMAGE_MAX_TEXELS && texels * trc_texel_bytes(format) <= TRC_IMAGE_MAX_BYTES)
        return TRC_OK;
    return trc_fail(TRC_ERROR_TOO_LARGE,
                    "an image%s%s of %" PRIu32 " x %" PRIu32
                    " pixels is too large: at most %u per side, %u in all, %" PRIu64 " bytes",
                    name[0] ? " " : "", name, width, height, TRC_IMAGE_MAX_SIDE,
                    TRC_IMAGE_MAX_TEXELS, (uint64_t)TRC_IMAGE_MAX_BYTES);
}

/* An image of one level with texels still to be filled. */
static trc_status image_create(uint32_t width, uint32_t height, enum trc_texel format,
                               const trc_image_desc *desc, struct trc_image **image_out) {
    const uint64_t texels = (uint64_t)width * height, bytes = texels * trc_texel_bytes(format);
    TRC_TRY(trc_image_check_size(width, height, format, ""));
    struct trc_image *image = trc_alloc_zeroed(1, sizeof *image);
    void *block = trc_alloc_zeroed(texels, trc_texel_bytes(format));
    if (!image || !block) {
        trc_free(image);
        trc_free(block);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an image of %" PRIu64 " bytes",
                        bytes);
    }
    atomic_init(&image->refs, 1);
    image->format = format;
    image->is_srgb = desc->is_srgb != 0;
    image->level_count = 1;
    image->levels[0] = (struct trc_image_level){width, height, block};
    image->bytes = bytes;
    *image_out = image;
    return TRC_OK;
}

/* ---- texels ---- */

/* Grey, grey with alpha, RGB or RGBA, side by side, to RGBA. one: 1.0 of the format. A macro, as it
 * is the same for three types of number. */
#define DEFINE_SPREAD(name, type)                                                               \
    static void name(const type *from, type *to, uint64_t count, uint32_t channels, type one) { \
        switch (channels) {                                                                     \
        case 1:                                                                                 \
            for (uint64_t i = 0; i < count; i++, to += 4) {                                     \
                to[0] = to[1] = to[2] = from[i];                                                \
                to[3] = one;                                                                    \
            }                                                                                   \
            break;                                                                              \
        case 2:                                                                                 \
            for (uint64_t i = 0; i < count; i++, to += 4) {                                     \
                to[0] = to[1] = to[2] = from[2 * i];                                            \
                to[3] = from[2 * i + 1];                                                        \
            }                                                                                   \
            break;                                                                              \
        case 3:                                                                                 \
            for (uint64_t i = 0; i < count; i++, to += 4) {                                     \
                to[0] = from[3 * i];                                                            \
                to[1] = from[3 * i + 1];                                                        \
                to[2] = from[3 * i + 2];                                                        \
                to[3] = one;                                                                    \
            }                                                                                   \
            break;                                                                              \
        default:                                                                                \
            memcpy(to, from, 4 * count * sizeof *to);                                           \
            break;                                                                              \
        }                                                                                       \
    }
DEFINE_SPREAD(spread_u8, uint8_t)
DEFINE_SPREAD(spread_u16, uint16_t)
DEFINE_SPREAD(spread_f32, float)

static void spread(enum trc_texel format, const void *from, void *to, uint64_t count,
                   uint32_t channels) {
    switch (format) {
    case TRC_TEXEL_U8:
        spread_u8(from, to, count, channels, UINT8_MAX);
        break;
    case TRC_TEXEL_U16:
        spread_u16(from, to, count, channels, UINT16_MAX);
        break;
    case TRC_TEXEL_F16:
        spread_u16(from, to, count, channels, TRC_HALF_ONE);
        break;
    case TRC_TEXEL_F32:
        spread_f32(from, to, count, channels, 1.0f);
        break;
    }
}

/* Texels of floats with a NaN or an infinity become 0, as in Cycles: other channels alone would
 * have a strange hue. */
static void drop_bad_texels(struct trc_image *image, uint64_t count) {
    if (image->format != TRC_TEXEL_F16 && image->format != TRC_TEXEL_F32)
        return;
    uint16_t *h = image->levels[0].texels;
    float *f = image->levels[0].texels;
    for (uint64_t i = 0; i < count; i++) {
        bool is_bad = false;
        for (int c = 0; c < 4; c++) {
            is_bad |= image->format == TRC_TEXEL_F16
                          ? (h[4 * i + c] & TRC_HALF_EXPONENT) == TRC_HALF_EXPONENT
                          : !isfinite(f[4 * i + c]);
        }
        if (!is_bad)
            continue;
        image->bad_texel_count++;
        memset((char *)image->levels[0].texels + i * trc_texel_bytes(image->format), 0,
               trc_texel_bytes(image->format));
    }
}

static void set_opaque(struct trc_image *image, uint64_t count) {
    uint8_t *b = image->levels[0].texels;
    uint16_t *h = image->levels[0].texels;
    float *f = image->levels[0].texels;
    for (uint64_t i = 0; i < count; i++) {
        switch (image->format) {
        case TRC_TEXEL_U8:
            b[4 * i + 3] = UINT8_MAX;
            break;
        case TRC_TEXEL_U16:
            h[4 * i + 3] = UINT16_MAX;
            break;
        case TRC_TEXEL_F16:
            h[4 * i + 3] = TRC_HALF_ONE;
            break;
        case TRC_TEXEL_F32:
            f[4 * i + 3] = 1.0f;
            break;
        }
    }
}

/* Colours times alpha, in the encoding of the file and rounded down for bytes, as Cycles. Most
 * texels are opaque. */
static void multiply_by_alpha(struct trc_image *image, uint64_t count) {
    uint8_t *b = image->levels[0].texels;
    uint16_t *h = image->levels[0].texels;
    float *f = image->levels[0].texels;
    for (uint64_t i = 0; i < 4 * count; i += 4) {
        switch (image->format) {
        case TRC_TEXEL_U8:
            if (b[i + 3] != UINT8_MAX)
                for (uint64_t c = i; c < i + 3; c++)
                    b[c] = (uint8_t)(b[c] * b[i + 3] / UINT8_MAX);
            break;
        case TRC_TEXEL_U16:
            if (h[i + 3] != UINT16_MAX)
                for (uint64_t c = i; c < i + 3; c++)
                    h[c] = (uint16_t)((uint32_t)h[c] * h[i + 3] / UINT16_MAX);
            break;
        case TRC_TEXEL_F16:
            if (h[i + 3] != TRC_HALF_ONE)
                for (uint64_t c = i; c < i + 3; c++)
                    h[c] = trc_float_to_half(trc_half_to_float(h[c]) * trc_half_to_float(h[i + 3]));
            break;
        case TRC_TEXEL_F32:
            for (uint64_t c = i; c < i + 3; c++)
                f[c] *= f[i + 3];
            break;
        }
    }
}

/* What is left to do when the texels are there; the image is to be freed if it fails. channels: of
 * what they come from. */
static trc_status finish(struct trc_image *image, const trc_image_desc *desc,
                         const struct trc_image_source *from, uint32_t channels,
                         bool is_unassociated) {
    const uint64_t count = (uint64_t)image->levels[0].width * image->levels[0].height;
    const bool has_alpha = channels == 2 || channels == 4;
    drop_bad_texels(image, count);
    if (has_alpha && desc->alpha_mode == TRC_ALPHA_NONE)
        set_opaque(image, count);
    image->is_associated = has_alpha && (desc->alpha_mode == TRC_ALPHA_STRAIGHT ||
                                         desc->alpha_mode == TRC_ALPHA_PREMULTIPLIED);
    if (desc->color_space) {
        const struct trc_color_source source = {
            .config = desc->color_config,
            .space = desc->color_space,
            .is_grey = channels == 1,
            .is_multiplied = image->is_associated && !is_unassociated,
        };
        TRC_TRY(trc_image_to_scene_linear(image, from, &source));
        drop_bad_texels(image, count);
    }
    if (image->is_associated && is_unassociated) {
        multiply_by_alpha(image, count);
        drop_bad_texels(image, count); /* products may overflow */
    }
    return TRC_OK;
}

/* ---- limits ---- */

/* Means of the channels of count texels in a row of width texels, from a block of step by step. A
 * macro, as it is the same for three types of number. */
#define DEFINE_SHRINK(name, type, load, store)                                                \
    static void name(const type *from, uint32_t row, uint32_t step, type *to, uint32_t width, \
                     uint32_t height) {                                                       \
        const float share = 1.0f / ((float)step * (float)step);                               \
        for (uint32_t y = 0; y < height; y++)                                                 \
            for (uint32_t x = 0; x < width; x++, to += 4)                                     \
                for (uint32_t c = 0; c < 4; c++) {                                            \
                    float sum = 0.0f;                                                         \
                    for (uint64_t j = 0; j < step; j++)                                       \
                        for (uint64_t i = 0; i < step; i++) {                                 \
                            const uint64_t texel = (y * step + j) * row + x * step + i;       \
                            sum += load(from[4 * texel + c]);                                 \
                        }                                                                     \
                    to[c] = store(sum * share);                                               \
                }                                                                             \
    }
#define WHOLE_TO_FLOAT(v) ((float)(v))
#define BYTE_OF(v) ((uint8_t)((v) + 0.5f))
#define WORD_OF(v) ((uint16_t)((v) + 0.5f))
#define AS_IT_IS(v) (v)
DEFINE_SHRINK(shrink_u8, uint8_t, WHOLE_TO_FLOAT, BYTE_OF)
DEFINE_SHRINK(shrink_u16, uint16_t, WHOLE_TO_FLOAT, WORD_OF)
DEFINE_SHRINK(shrink_f16, uint16_t, trc_half_to_float, trc_float_to_half)
DEFINE_SHRINK(shrink_f32, float, AS_IT_IS, AS_IT_IS)

/* The first level of an image by blocks of step by step texels, in the encoding it is stored in.
 * What a block does not fill at the upper and right edge is left out. */
static trc_status shrink(const struct trc_image *image, uint32_t step,
                         struct trc_image_level *out) {
    const struct trc_image_level *level = &image->levels[0];
    const uint32_t width = level->width / step, height = level->height / step;
    void *texels = trc_alloc((uint64_t)width * height, trc_texel_bytes(image->format));
    if (!texels) {
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an image of %" PRIu64 " bytes",
                        (uint64_t)width * height * trc_texel_bytes(image->format));
    }
    switch (image->format) {
    case TRC_TEXEL_U8:
        shrink_u8(level->texels, level->width, step, texels, width, height);
        break;
    case TRC_TEXEL_U16:
        shrink_u16(level->texels, level->width, step, texels, width, height);
        break;
    case TRC_TEXEL_F16:
        shrink_f16(level->texels, level->width, step, texels, width, height);
        break;
    case TRC_TEXEL_F32:
        shrink_f32(level->texels, level->width, step, texels, width, height);
        break;
    }
    *out = (struct trc_image_level){width, height, texels};
    return TRC_OK;
}

static uint64_t whole_bytes(const struct trc_image *image) {
    return (uint64_t)image->levels[0].width * image->levels[0].height *
           trc_texel_bytes(image->format);
}

static uint32_t shorter_side(const struct trc_image_level *level) {
    return level->width < level->height ? level->width : level->height;
}

/* Halves an image as often as max_side asks for. */
static trc_status limit_size(struct trc_image *image, uint32_t max_side) {
    struct trc_image_level *level = &image->levels[0];
    const uint32_t longest = level->width > level->height ? level->width : level->height;
    uint32_t step = 1;
    while (longest / step > max_side && shorter_side(level) / step > 1)
        step *= 2;
    if (!max_side || step == 1)
        return TRC_OK;
    struct trc_image_level smaller;
    TRC_TRY(shrink(image, step, &smaller));
    trc_free(level->texels);
    *level = smaller;
    image->bytes = whole_bytes(image);
    return TRC_OK;
}

bool trc_image_can_halve(const struct trc_image *image) {
    return shorter_side(&image->levels[0]) > 1;
}

trc_status trc_image_halve(const struct trc_image *image, struct trc_image **half_out) {
    struct trc_image *half = trc_alloc_zeroed(1, sizeof *half);
    if (!half)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an image");
    const trc_status status = shrink(image, 2, &half->levels[0]);
    if (status != TRC_OK) {
        trc_free(half);
        return status;
    }
    atomic_init(&half->refs, 1);
    half->format = image->format;
    half->is_srgb = image->is_srgb;
    half->is_associated = image->is_associated;
    half->level_count = 1;
    half->is_halved = true;
    half->bytes = whole_bytes(half);
    half->bad_texel_count = image->bad_texel_count;
    if (image->level_count > 1) {
        const trc_status levels = trc_image_make_levels(half);
        if (levels != TRC_OK) {
            trc_image_release(half);
            return levels;
        }
    }
    *half_out = half;
    return TRC_OK;
}

/* ---- sources ---- */

static trc_status load_pixels(const trc_image_desc *desc, const struct trc_image_source *source,
                              struct trc_image **image_out) {
    const enum trc_texel format = desc->is_float ? TRC_TEXEL_F32 : TRC_TEXEL_U8;
    const size_t element = desc->is_float ? sizeof(float) : 1;
    if (!desc->width || !desc->height) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an image of %" PRIu32 " x %" PRIu32 " pixels",
                        desc->width, desc->height);
    }
    TRC_TRY(trc_check_count(desc->width, 1, TRC_IMAGE_MAX_SIDE, "width"));
    TRC_TRY(trc_check_count(desc->height, 1, TRC_IMAGE_MAX_SIDE, "height"));
    const uint64_t bytes = (uint64_t)desc->width * desc->height * trc_texel_bytes(format);
    TRC_TRY(trc_check_array(desc->pixels, desc->pixel_bytes, bytes, 1, element, "pixels"));
    struct trc_image *image;
    TRC_TRY(image_create(desc->width, desc->height, format, desc, &image));
    memcpy(image->levels[0].texels, desc->pixels, bytes);
    const trc_status status =
        finish(image, desc, source, 4, desc->alpha_mode == TRC_ALPHA_STRAIGHT);
    if (status != TRC_OK) {
        trc_image_release(image);
        return status;
    }
    *image_out = image;
    return TRC_OK;
}

/* A file that is being read. */
struct file {
    const trc_image_desc *desc;
    struct trc_file_info info;
    struct trc_image *image; /* NULL before there is a size */
};

static trc_status begin_file(void *context, const struct trc_file_info *info) {
    struct file *file = context;
    trc_image_release(file->image);
    file->image = NULL;
    file->info = *info;
    return image_create(info->width, info->height, (enum trc_texel)info->format, file->desc,
                        &file->image);
}

/* Files have the top row first. */
static void take_rows(void *context, uint32_t first, uint32_t count, const void *pixels) {
    const struct file *file = context;
    const struct trc_image_level *level = &file->image->levels[0];
    const enum trc_texel format = file->image->format;
    const uint64_t texel = trc_texel_bytes(format), row = texel * level->width;
    const uint64_t from = row / 4 * file->info.channels;
    for (uint32_t i = 0; i < count; i++) {
        char *to = (char *)level->texels + row * (level->height - 1 - first - i);
        spread(format, (const char *)pixels + i * from, to, level->width, file->info.channels);
    }
}

static trc_status load_file(const trc_image_desc *desc, const struct trc_image_source *source,
                            struct trc_image **image_out) {
    struct file file = {.desc = desc};
    const struct trc_file_taker taker = {
        .context = &file, .cancel = source->cancel, .begin = begin_file, .rows = take_rows};
    trc_status status = trc_image_reader_read(source->reader, desc->path, &taker);
    if (status == TRC_OK)
        status = finish(file.image, desc, source, file.info.channels,
                        desc->is_alpha_literal ? desc->alpha_mode == TRC_ALPHA_STRAIGHT
                                               : file.info.is_unassociated);
    if (status != TRC_OK) {
        trc_image_release(file.image);
        return status;
    }
    *image_out = file.image;
    return TRC_OK;
}

static trc_status make_empty(const trc_image_desc *desc, struct trc_image **image_out) {
    struct trc_image *image = trc_alloc_zeroed(1, sizeof *image);
    if (!image)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an image");
    atomic_init(&image->refs, 1);
    image->will_have_levels = desc->is_mip_mapped != 0;
    *image_out = image;
    return TRC_OK;
}

trc_status trc_image_load(const trc_image_desc *desc, const struct trc_image_source *source,
                          struct trc_image **image_out) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_image_desc"));
    TRC_TRY(trc_check_enum(desc->alpha_mode, TRC_ALPHA_NONE + 1, "alpha_mode"));
    if (desc->path && desc->pixels)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an image has either pixels or a path");
    if (desc->color_space && (!desc->color_config || desc->is_srgb)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "a colour space needs a configuration, and is not sRGB");
    }
    if (trc_image_desc_is_empty(desc))
        return make_empty(desc, image_out);
    struct trc_image *image = NULL;
    TRC_TRY(desc->path ? load_file(desc, source, &image) : load_pixels(desc, source, &image));
    trc_status status = limit_size(image, desc->max_side);
    if (status == TRC_OK && desc->is_mip_mapped)
        status = trc_image_make_levels(image);
    if (status != TRC_OK) {
        trc_image_release(image);
        return status;
    }
    *image_out = image;
    return TRC_OK;
}
