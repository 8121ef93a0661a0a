/* Images of files: formats, sizes, and files that are damaged in every way. */
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
#include "image_file.h"
#include "model/texel.h"

static trc_image_desc file_desc(void) {
    return (trc_image_desc){
        .struct_size = sizeof(trc_image_desc), .alpha_mode = TRC_ALPHA_STRAIGHT, .path = path};
}

#ifdef TRC_TEST_READER

struct sample {
    const char *name;
    uint8_t bytes[1024];
    size_t size;
};

static void put(struct sample *f, const void *bytes, size_t size) {
    memcpy(f->bytes + f->size, bytes, size);
    f->size += size;
}
static void put8(struct sample *f, uint8_t x) { put(f, &x, 1); }
static void put32(struct sample *f, uint32_t x) {
    for (int i = 0; i < 4; i++)
        put8(f, (uint8_t)(x >> (8 * i)));
}
static void put_text(struct sample *f, const char *text) { put(f, text, strlen(text) + 1); }

/* 2 x 2 texels of Targa with 8 bits of alpha, the top row first. */
static struct sample make_targa(void) {
    struct sample f = {.name = "a.tga"};
    static const uint8_t head[18] = {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 2, 0, 32, 0x28};
    static const uint8_t bgra[16] = {30, 20, 10, 255, 60, 50, 40, 128, 3, 2, 1, 255, 6, 5, 4, 0};
    put(&f, head, sizeof head);
    put(&f, bgra, sizeof bgra);
    return f;
}

/* 3 x 1 of 16-bit RGB. */
static struct sample make_pnm(void) {
    struct sample f = {.name = "b.ppm"};
    static const uint8_t rgb[18] = {0, 0, 0x12, 0x34, 0xff, 0xff, 1, 0, 2,
                                    0, 3, 0,    4,    0,    5,    0, 6, 0};
    put(&f, "P6\n3 1\n65535\n", 13);
    put(&f, rgb, sizeof rgb);
    return f;
}

static void put_channel(struct sample *f, const char *name) {
    put_text(f, name);
    put32(f, 1); /* half */
    put32(f, 0);
    put32(f, 1);
    put32(f, 1);
}
static void put_attribute(struct sample *f, const char *name, const char *type, uint32_t size) {
    put_text(f, name);
    put_text(f, type);
    put32(f, size);
}
static void put_box(struct sample *f, const char *name) {
    put_attribute(f, name, "box2i", 16);
    put32(f, 0);
    put32(f, 0);
    put32(f, 2);
    put32(f, 0);
}

/* 3 x 1 of half floats, not compressed: (1, 2, 4), then one with a NaN, then one with an infinity.
 */
static struct sample make_exr(void) {
    struct sample f = {.name = "c.exr"};
    static const uint16_t rows[9] = {0x4400, 0x3c00, 0x7c00, 0x4000, 0x7e00,
                                     0x3c00, 0x3c00, 0x3c00, 0x3c00};
    put32(&f, 20000630);
    put32(&f, 2);
    put_attribute(&f, "channels", "chlist", 3 * 18 + 1);
    put_channel(&f, "B");
    put_channel(&f, "G");
    put_channel(&f, "R");
    put8(&f, 0);
    put_attribute(&f, "compression", "compression", 1);
    put8(&f, 0);
    put_box(&f, "dataWindow");
    put_box(&f, "displayWindow");
    put_attribute(&f, "lineOrder", "lineOrder", 1);
    put8(&f, 0);
    put_attribute(&f, "pixelAspectRatio", "float", 4);
    put32(&f, 0x3f800000);
    put_attribute(&f, "screenWindowCenter", "v2f", 8);
    put32(&f, 0);
    put32(&f, 0);
    put_attribute(&f, "screenWindowWidth", "float", 4);
    put32(&f, 0x3f800000);
    put8(&f, 0);
    put32(&f, (uint32_t)f.size + 8);
    put32(&f, 0);
    put32(&f, 0);
    put32(&f, sizeof rows);
    put(&f, rows, sizeof rows);
    return f;
}

/* 1 x 1 of Radiance RGBE. */
static struct sample make_hdr(void) {
    struct sample f = {.name = "d.hdr"};
    static const char head[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n";
    static const uint8_t rgbe[4] = {128, 64, 32, 130};
    put(&f, head, sizeof head - 1);
    put(&f, rgbe, sizeof rgbe);
    return f;
}

/* 2 x 1 of DirectDraw's, not compressed, with 8 bits of alpha. */
static struct sample make_dds(void) {
    struct sample f = {.name = "e.dds"};
    enum { HEADER = 124, RESERVED = 11, FORMAT = 32 };
    static const uint32_t format[] = {FORMAT, 0x41, 0, 32, 0xff0000, 0xff00, 0xff, 0xff000000};
    static const uint8_t bgra[8] = {30, 20, 10, 255, 60, 50, 40, 128};
    put(&f, "DDS ", 4);
    put32(&f, HEADER);
    put32(&f, 0x100f); /* height, width, pitch, format, and what it can do, are said */
    put32(&f, 1);
    put32(&f, 2);
    put32(&f, sizeof bgra);
    for (int i = 0; i < 2 + RESERVED; i++)
        put32(&f, 0);
    for (size_t i = 0; i < sizeof format / sizeof *format; i++)
        put32(&f, format[i]);
    put32(&f, 0x1000); /* a texture */
    for (int i = 0; i < 4; i++)
        put32(&f, 0);
    put(&f, bgra, sizeof bgra);
    return f;
}

typedef struct sample (*sample_maker)(void);
static const sample_maker makers[] = {make_targa, make_pnm, make_exr, make_hdr, make_dds};
#define SAMPLES (sizeof makers / sizeof *makers)

static void test_targa(void **state) {
    (void)state;
    static const uint8_t expected[16] = {1,  2,  3,  255, 0,  0,  0,  0,
                                         10, 20, 30, 255, 20, 25, 30, 128};
    const struct sample f = make_targa();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_U8);
    assert_int_equal(image->is_associated, 1);
    assert_memory_equal(image->levels[0].texels, expected, 16); /* the bottom row first */
    trc_image_release(image);
    remove(path);
}

/* Files of games say nothing of their alpha: colours are not multiplied, as in Blender. */
static void test_dds(void **state) {
    (void)state;
    static const uint8_t expected[8] = {10, 20, 30, 255, 20, 25, 30, 128};
    const struct sample f = make_dds();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_U8);
    assert_memory_equal(image->levels[0].texels, expected, 8);
    trc_image_release(image);
    remove(path);
}

static void test_16_bits(void **state) {
    (void)state;
    static const uint16_t expected[12] = {0,     0x1234, 0xffff, 0xffff, 0x100, 0x200,
                                          0x300, 0xffff, 0x400,  0x500,  0x600, 0xffff};
    const struct sample f = make_pnm();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_U16);
    assert_int_equal(image->is_associated, 0);        /* it has no alpha */
    const uint16_t *texels = image->levels[0].texels; /* OpenImageIO may round the largest down */
    for (int i = 0; i < 12; i++)
        assert_in_range(texels[i], expected[i] ? expected[i] - 1 : 0, expected[i]);
    trc_image_release(image);
    remove(path);
}

/* Smaller levels, and a smaller image, of 16 bits: means of a linear function. */
static void test_16_bits_made_smaller(void **state) {
    (void)state;
    enum { SIDE = 64 };
    static const char head[] = "P6\n64 64\n65535\n";
    static uint8_t bytes[sizeof head - 1 + (size_t)SIDE * SIDE * 6];
    memcpy(bytes, head, sizeof head - 1);
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int c = 0; c < 3; c++) { /* words, the high byte first, the top row first */
            const int x = i % SIDE, y = SIDE - 1 - i / SIDE;
            const int value = 500 * x + 100 * (c + 1) * y;
            bytes[(int)sizeof head - 1 + 6 * i + 2 * c] = (uint8_t)(value >> 8);
            bytes[(int)sizeof head - 1 + 6 * i + 2 * c + 1] = (uint8_t)value;
        }
    write_file("e.ppm", bytes, sizeof bytes);
    trc_image_desc desc = file_desc();
    desc.is_mip_mapped = 1;
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_U16);
    assert_int_equal(image->level_count, 3);
    desc.max_side = SIDE / 2;
    desc.is_mip_mapped = 0;
    struct trc_image *half = loaded(&desc);
    assert_int_equal(half->levels[0].width, SIDE / 2);
    const uint16_t *texels = half->levels[0].texels;
    for (int i = 0; i < 8 * 8; i++)
        for (int c = 0; c < 3; c++) {
            const double x = 8 * (i % 8) + 3.5, y = 8 * (double)(i / 8) + 3.5;
            const double mean = (500 * x + 100 * (c + 1) * y) / UINT16_MAX;
            assert_true(fabs(level_value(image, 2, (uint64_t)(4 * i + c)) - mean) < 1e-3 * mean);
            const double near =
                500 * (2 * (i % 8) + .5) + 100 * (c + 1) * (2 * (double)(i / 8) + .5);
            const int at = 4 * (SIDE / 2 * (i / 8) + i % 8) + c;
            assert_true(fabs(texels[at] - near) <= 1.5);
        }
    trc_image_release(image);
    trc_image_release(half);
    remove(path);
}

static void test_exr(void **state) {
    (void)state;
    static const uint16_t expected[12] = {0x3c00, 0x4000, 0x4400, 0x3c00};
    const struct sample f = make_exr();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_F16);
    assert_int_equal(image->bad_texel_count, 2);
    assert_memory_equal(image->levels[0].texels, expected, sizeof expected);
    trc_image_release(image);
    remove(path);
}

static void test_hdr(void **state) {
    (void)state;
    const struct sample f = make_hdr();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    struct trc_image *image = loaded(&desc);
    const float *texel = image->levels[0].texels;
    assert_int_equal(image->format, TRC_TEXEL_F32);
    assert_true(fabsf(texel[0] - 2) < .02f && fabsf(texel[1] - 1) < .02f && texel[3] == 1);
    trc_image_release(image);
    remove(path);
}

/* Either an image or an error of a file. */
static void load_damaged(void) {
    const trc_image_desc desc = file_desc();
    struct trc_image *image = NULL;
    const trc_status status = trc_image_load(&desc, &source, &image);
    if (status != TRC_OK && status != TRC_ERROR_IMAGE && status != TRC_ERROR_TOO_LARGE &&
        status != TRC_ERROR_OUT_OF_MEMORY) {
        fail_msg("status %d: %s", status, trc_last_message());
    }
    assert_true((status == TRC_OK) == (image != NULL));
    trc_image_release(image);
}

/* Each damaged file costs a process. Here are enough of them to see that every one is answered for
 * and nothing stays; tests/damaged.py has thousands, of every format. */
#define TRUNCATION_STEP 5
#define CORRUPTIONS 30

static void test_truncated_files(void **state) {
    (void)state;
    const uint64_t bytes = memory_of_images();
    for (size_t k = 0; k < SAMPLES; k++) {
        const struct sample f = makers[k]();
        for (size_t size = k; size < f.size; size += TRUNCATION_STEP) {
            write_file(f.name, f.bytes, size);
            load_damaged();
        }
        remove(path);
    }
    assert_true(memory_of_images() == bytes);
}

static void test_corrupt_files(void **state) {
    (void)state;
    const uint64_t bytes = memory_of_images();
    uint32_t random = 1;
    for (size_t k = 0; k < SAMPLES; k++) {
        for (int round = 0; round < CORRUPTIONS; round++) {
            struct sample f = makers[k]();
            for (int change = 0; change < 3; change++) {
                random = random * 1664525u + 1013904223u;
                const size_t at = (random >> 8) % f.size;
                random = random * 1664525u + 1013904223u;
                f.bytes[at] = (uint8_t)(random >> 24);
            }
            write_file(f.name, f.bytes, f.size);
            load_damaged();
        }
        remove(path);
    }
    assert_true(memory_of_images() == bytes);
}

/* A small file that claims to be huge is refused before memory is taken. */
static void test_claimed_sizes(void **state) {
    (void)state;
    struct sample f = make_targa();
    f.bytes[12] = f.bytes[13] = f.bytes[14] = f.bytes[15] = 0xff;
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    refused(&desc, TRC_ERROR_TOO_LARGE);
    assert_non_null(strstr(trc_last_message(), "65535"));
    remove(path);
}

static void test_missing_files(void **state) {
    (void)state;
    static const char *const paths[] = {"/nonexistent/image.png", "", "/", "no extension at all"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        snprintf(path, sizeof path, "%s", paths[i]);
        const trc_image_desc desc = file_desc();
        refused(&desc, TRC_ERROR_IMAGE);
    }
    write_file("e.png", "this is not a picture", 21);
    const trc_image_desc desc = file_desc();
    refused(&desc, TRC_ERROR_IMAGE);
    assert_non_null(strstr(trc_last_message(), "e.png"));
    remove(path);
}

static void test_files_without_memory(void **state) {
    (void)state;
    const struct sample f = make_targa();
    write_file(f.name, f.bytes, f.size);
    const trc_image_desc desc = file_desc();
    for (int64_t n = 0; n < 2; n++) {
        trc_memory_fail_at(n, false);
        refused(&desc, TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
    }
    remove(path);
}

#else

static void test_no_files(void **state) {
    (void)state;
    write_file("a.tga", "", 0);
    const trc_image_desc desc = file_desc();
    refused(&desc, TRC_ERROR_UNSUPPORTED);
    remove(path);
}

#endif

int main(void) {
    const struct CMUnitTest tests[] = {
#ifdef TRC_TEST_READER
        cmocka_unit_test(test_targa),
        cmocka_unit_test(test_dds),
        cmocka_unit_test(test_16_bits),
        cmocka_unit_test(test_16_bits_made_smaller),
        cmocka_unit_test(test_exr),
        cmocka_unit_test(test_hdr),
        cmocka_unit_test(test_truncated_files),
        cmocka_unit_test(test_corrupt_files),
        cmocka_unit_test(test_claimed_sizes),
        cmocka_unit_test(test_missing_files),
        cmocka_unit_test(test_files_without_memory),
#else
        cmocka_unit_test(test_no_files),
#endif
    };
    return cmocka_run_group_tests(tests, set_up_reader, tear_down_reader);
}
