/* Image files of every type of sample and number of channels: what their texels become by each
 * alpha mode, and when made smaller. The files are TIFF, which has them all, written here. */
#define _XOPEN_SOURCE 700 /* image_file.h: P_tmpdir */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "image/image.h"
#include "model/texel.h"

#include "image_file.h"

#ifdef TRC_TEST_READER

#define WIDTH 6
#define HEIGHT 4

/* As TIFF has them. */
enum number { UNSIGNED = 1, SIGNED = 2, FLOAT = 3 };

static const struct type {
    const char *name;
    uint16_t bits;
    enum number number;
    enum trc_texel texel;
    float most;  /* number that means 1 */
    float error; /* of a texel, as part of 1 */
} types[] = {
    {"bytes", 8, UNSIGNED, TRC_TEXEL_U8, 255.0f, 1.01f / 255},
    {"signed bytes", 8, SIGNED, TRC_TEXEL_U8, 127.0f, 1.01f / 127},
    {"words", 16, UNSIGNED, TRC_TEXEL_U16, 65535.0f, 2.01f / 65535},
    {"signed words", 16, SIGNED, TRC_TEXEL_U16, 32767.0f, 2.01f / 32767},
    {"half floats", 16, FLOAT, TRC_TEXEL_F16, 1.0f, 2e-3f},
    {"floats", 32, FLOAT, TRC_TEXEL_F32, 1.0f, 1e-6f},
};
#define TYPES (sizeof types / sizeof *types)

struct file {
    uint8_t bytes[2048];
    size_t size;
};

static void put(struct file *f, uint32_t value, int bytes) {
    for (int i = 0; i < bytes; i++)
        f->bytes[f->size++] = (uint8_t)(value >> (8 * i));
}

/* A field of one number, or two words, or of where its words are. */
static void put_field(struct file *f, uint32_t tag, uint32_t type, uint32_t count, uint32_t value) {
    put(f, tag, 2);
    put(f, type, 2);
    put(f, count, 4);
    put(f, value, 4);
}

/* What channel c of the file's texel means, in [0, 1]; y: row from the bottom. */
static float meant(int x, int y, int c) {
    return (float)(1 + x + WIDTH * y + 7 * c) / (1 + WIDTH * HEIGHT + 7 * 3);
}

static void put_sample(struct file *f, const struct type *type, float value) {
    uint32_t bits = (uint32_t)lrintf(value * type->most);
    if (type->number == FLOAT && type->bits == 16)
        bits = trc_float_to_half(value);
    else if (type->number == FLOAT)
        memcpy(&bits, &value, sizeof bits);
    put(f, bits, type->bits / 8);
}

/* Not compressed, one strip, the top row first; the second or fourth channel is alpha, which
 * colours are not multiplied by. */
static struct file make_tiff(const struct type *type, uint32_t channels) {
    enum { SHORT = 3, LONG = 4 };
    const bool has_alpha = channels % 2 == 0, has_place = channels < 3;
    const uint32_t fields = has_alpha ? 12 : 11;
    const uint32_t after = 8 + 2 + fields * 12 + 4; /* words of each channel, then samples */
    const uint32_t samples = after + 2 * 2 * channels;
    struct file f = {{'I', 'I', 42, 0, 8, 0, 0, 0}, 8};
    put(&f, fields, 2);
    put_field(&f, 256, LONG, 1, WIDTH);
    put_field(&f, 257, LONG, 1, HEIGHT);
    put_field(&f, 258, SHORT, channels, has_place ? type->bits * 0x10001u : after);
    put_field(&f, 259, SHORT, 1, 1);                    /* not compressed */
    put_field(&f, 262, SHORT, 1, channels < 3 ? 1 : 2); /* grey or colours */
    put_field(&f, 273, LONG, 1, samples);
    put_field(&f, 277, SHORT, 1, channels);
    put_field(&f, 278, LONG, 1, HEIGHT); /* rows of a strip */
    put_field(&f, 279, LONG, 1, WIDTH * HEIGHT * channels * type->bits / 8);
    put_field(&f, 284, SHORT, 1, 1); /* channels side by side */
    if (has_alpha)
        put_field(&f, 338, SHORT, 1, 2);
    put_field(&f, 339, SHORT, channels, has_place ? type->number * 0x10001u : after + 2 * channels);
    put(&f, 0, 4);
    for (uint32_t c = 0; c < channels; c++)
        put(&f, type->bits, 2);
    for (uint32_t c = 0; c < channels; c++)
        put(&f, type->number, 2);
    assert_int_equal(f.size, samples);
    for (int y = HEIGHT - 1; y >= 0; y--)
        for (int x = 0; x < WIDTH; x++)
            for (uint32_t c = 0; c < channels; c++)
                put_sample(&f, type, meant(x, y, (int)c));
    return f;
}

static void write_tiff(const struct type *type, uint32_t channels) {
    const struct file tiff = make_tiff(type, channels);
    write_file("types.tif", tiff.bytes, tiff.size);
}

/* A channel of the image's largest level, as part of 1. */
static float texel_value(const struct trc_image *image, int channel) {
    const void *texels = image->levels[0].texels;
    switch (image->format) {
    case TRC_TEXEL_U8:
        return (float)((const uint8_t *)texels)[channel] / UINT8_MAX;
    case TRC_TEXEL_U16:
        return (float)((const uint16_t *)texels)[channel] / UINT16_MAX;
    case TRC_TEXEL_F16:
        return trc_half_to_float(((const uint16_t *)texels)[channel]);
    default:
        return ((const float *)texels)[channel];
    }
}

/* What the file's texel is to be. */
static void expected_texel(int x, int y, uint32_t channels, uint32_t alpha_mode, float out[4]) {
    const bool has_alpha = channels % 2 == 0;
    for (int c = 0; c < 3; c++)
        out[c] = meant(x, y, channels < 3 ? 0 : c);
    out[3] = has_alpha && alpha_mode != TRC_ALPHA_NONE ? meant(x, y, (int)channels - 1) : 1.0f;
    const bool multiplies =
        alpha_mode == TRC_ALPHA_STRAIGHT || alpha_mode == TRC_ALPHA_PREMULTIPLIED;
    for (int c = 0; c < 3 && multiplies; c++)
        out[c] *= out[3];
}

static struct trc_image *load(const struct type *type, uint32_t channels, uint32_t alpha_mode,
                              uint32_t max_side) {
    const trc_image_desc desc = {
        .struct_size = sizeof desc, .alpha_mode = alpha_mode, .path = path, .max_side = max_side};
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, type->texel);
    assert_int_equal(image->is_associated,
                     channels % 2 == 0 && alpha_mode < TRC_ALPHA_CHANNEL_PACKED);
    return image;
}

static void expect_near(const struct type *type, uint32_t channels, uint32_t mode, float value,
                        float expected, float error) {
    if (!(fabsf(value - expected) <= error))
        fail_msg("%s, %u channels, alpha mode %u: %.9g instead of %.9g", type->name, channels, mode,
                 (double)value, (double)expected);
}

static void check_whole(const struct type *type, uint32_t channels, uint32_t mode) {
    struct trc_image *image = load(type, channels, mode, 0);
    assert_int_equal(image->levels[0].width, WIDTH);
    assert_int_equal(image->levels[0].height, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        float expected[4];
        expected_texel(i % WIDTH, i / WIDTH, channels, mode, expected);
        for (int c = 0; c < 4; c++) /* twice: colour and alpha are rounded, and their product */
            expect_near(type, channels, mode, texel_value(image, 4 * i + c), expected[c],
                        2.0f * type->error);
    }
    trc_image_release(image);
}

/* Blocks of two by two texels become their means. */
static void check_smaller(const struct type *type, uint32_t channels) {
    struct trc_image *whole = load(type, channels, TRC_ALPHA_STRAIGHT, 0);
    struct trc_image *half = load(type, channels, TRC_ALPHA_STRAIGHT, WIDTH / 2);
    assert_int_equal(half->levels[0].width, WIDTH / 2);
    assert_int_equal(half->levels[0].height, HEIGHT / 2);
    for (int i = 0; i < WIDTH / 2 * HEIGHT / 2; i++)
        for (int c = 0; c < 4; c++) {
            const int x = 2 * (i % (WIDTH / 2)), y = 2 * (i / (WIDTH / 2));
            float sum = 0.0f;
            for (int k = 0; k < 4; k++)
                sum += texel_value(whole, 4 * (WIDTH * (y + k / 2) + x + k % 2) + c);
            expect_near(type, channels, 0, texel_value(half, 4 * i + c), 0.25f * sum, type->error);
        }
    trc_image_release(whole);
    trc_image_release(half);
}

static void every_type_and_number_of_channels(void **state) {
    (void)state;
    for (size_t i = 0; i < TYPES; i++)
        for (uint32_t channels = 1; channels <= 4; channels++) {
            write_tiff(&types[i], channels);
            for (uint32_t mode = 0; mode <= TRC_ALPHA_NONE; mode++)
                check_whole(&types[i], channels, mode);
            check_smaller(&types[i], channels);
        }
    remove(path);
}

/* From a space encoded as a square root: what is written of it, squared; numbers below 1 become
 * half floats. */
static void colors_of_every_type(void **state) {
    (void)state;
    char image_path[sizeof path];
    for (size_t i = 0; i < TYPES; i++)
        for (uint32_t channels = 1; channels <= 4; channels++) {
            write_tiff(&types[i], channels);
            memcpy(image_path, path, sizeof path);
            write_file("types.ocio", color_config, sizeof color_config - 1);
            const trc_image_desc desc = {.struct_size = sizeof desc,
                                         .alpha_mode = TRC_ALPHA_CHANNEL_PACKED,
                                         .path = image_path,
                                         .color_config = path,
                                         .color_space = "root"};
            struct trc_image *image = loaded(&desc);
            assert_int_equal(image->format, types[i].bits == 32 ? TRC_TEXEL_F32 : TRC_TEXEL_F16);
            for (int texel = 0; texel < WIDTH * HEIGHT; texel++) {
                float expected[4];
                expected_texel(texel % WIDTH, texel / WIDTH, channels, TRC_ALPHA_CHANNEL_PACKED,
                               expected);
                for (int c = 0; c < 4; c++)
                    expect_near(&types[i], channels, TRC_ALPHA_CHANNEL_PACKED,
                                texel_value(image, 4 * texel + c),
                                c < 3 ? expected[c] * expected[c] : expected[c],
                                2.0f * types[i].error + 1e-3f);
            }
            trc_image_release(image);
            remove(path);
            remove(image_path);
        }
}

#else

static void every_type_and_number_of_channels(void **state) {
    (void)state;
    skip();
}
static void colors_of_every_type(void **state) {
    (void)state;
    skip();
}

#endif

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_and_number_of_channels),
        cmocka_unit_test(colors_of_every_type),
    };
    return cmocka_run_group_tests_name("image types", tests, set_up_reader, tear_down_reader);
}
