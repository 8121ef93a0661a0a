/* Images: what pixels become, what is refused, and files that are damaged in every way. */
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
#include "model/snapshot.h"
#include "model/texel.h"
#include "query_scene.h"

static trc_image_desc pixels_desc(uint32_t width, uint32_t height, const void *pixels,
                                  bool is_float) {
    return (trc_image_desc){.struct_size = sizeof(trc_image_desc),
                            .width = width,
                            .height = height,
                            .alpha_mode = TRC_ALPHA_STRAIGHT,
                            .is_float = is_float,
                            .pixels = pixels,
                            .pixel_bytes = (uint64_t)width * height * (is_float ? 16 : 4)};
}

static void refused(const trc_image_desc *desc, trc_status expected) {
    struct trc_image *image = NULL;
    const uint64_t bytes = memory_of_images();
    const trc_status status = trc_image_load(desc, &source, &image);
    if (status != expected)
        fail_msg("status %d: %s", status, trc_last_message());
    assert_true(trc_last_message()[0] != '\0');
    assert_null(image);
    assert_true(memory_of_images() == bytes);
}

/* ---- pixels ---- */

static void test_bytes(void **state) {
    (void)state;
    static const uint8_t pixels[8] = {200, 100, 50, 128, 255, 1, 2, 0};
    static const uint8_t expected[4][8] = {
        {100, 50, 25, 128, 0, 0, 0, 0},      /* straight: multiplied, rounded down */
        {200, 100, 50, 128, 255, 1, 2, 0},   /* premultiplied: as it is */
        {200, 100, 50, 128, 255, 1, 2, 0},   /* channel packed */
        {200, 100, 50, 255, 255, 1, 2, 255}, /* none */
    };
    for (uint32_t mode = 0; mode < 4; mode++) {
        trc_image_desc desc = pixels_desc(2, 1, pixels, false);
        desc.alpha_mode = mode;
        desc.is_srgb = 1;
        struct trc_image *image = loaded(&desc);
        assert_int_equal(image->format, TRC_TEXEL_U8);
        assert_int_equal(image->is_srgb, 1);
        assert_int_equal(image->is_associated, mode < 2);
        assert_int_equal(image->levels[0].width, 2);
        assert_int_equal(image->levels[0].height, 1);
        assert_int_equal(image->bytes, 8);
        assert_memory_equal(image->levels[0].texels, expected[mode], 8);
        trc_image_release(image);
    }
}

static void test_floats(void **state) {
    (void)state;
    static const float pixels[16] = {1, 2, 3,         .5f, NAN,   1, 1, 1,
                                     1, 1, -INFINITY, 1,   3e38f, 0, 0, 4};
    static const float expected[16] = {.5f, 1, 1.5f, .5f};
    const trc_image_desc desc = pixels_desc(2, 2, pixels, true);
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_F32);
    assert_memory_equal(image->levels[0].texels, expected, sizeof expected);
    assert_int_equal(image->bad_texel_count, 3); /* the last overflows when multiplied */
    trc_image_release(image);
}

static void test_refused_pixels(void **state) {
    (void)state;
    static float pixels[16];
    const trc_image_desc good = pixels_desc(2, 2, pixels, true);
    trc_image_desc desc = good;
    desc.struct_size = 3;
    refused(&desc, TRC_ERROR_STRUCT_SIZE);
    desc = good;
    desc.width = 0;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = good;
    desc.height = TRC_IMAGE_MAX_SIDE + 1;
    refused(&desc, TRC_ERROR_TOO_LARGE);
    desc = good;
    desc.pixel_bytes--;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = good;
    desc.pixels = (const char *)pixels + 1;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = good;
    desc.pixels = NULL;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = good;
    desc.path = "x.png";
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = good;
    desc.alpha_mode = 4;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc = pixels_desc(65536, 65536, pixels, false);
    refused(&desc, TRC_ERROR_TOO_LARGE);
    desc = pixels_desc(32768, 32768, pixels, true); /* beyond what lookups can address */
    refused(&desc, TRC_ERROR_TOO_LARGE);
}

static void test_limits(void **state) {
    (void)state;
    uint8_t bytes[5 * 4 * 4];
    float numbers[5 * 4 * 4];
    for (int i = 0; i < 5 * 4 * 4; i++) {
        bytes[i] = (uint8_t)(3 * i);
        numbers[i] = 0.5f * (float)i;
    }
    for (int is_float = 0; is_float < 2; is_float++) {
        trc_image_desc desc = pixels_desc(5, 4, is_float ? (void *)numbers : bytes, is_float);
        desc.alpha_mode = TRC_ALPHA_CHANNEL_PACKED;
        desc.max_side = 5;
        struct trc_image *image = loaded(&desc);
        assert_int_equal(image->levels[0].width, 5);
        trc_image_release(image);
        desc.max_side = 4;
        image = loaded(&desc);
        assert_int_equal(image->levels[0].width, 2);
        assert_int_equal(image->levels[0].height, 2);
        assert_int_equal(image->bytes, is_float ? 64 : 16);
        for (int y = 0; y < 2; y++)
            for (int x = 0; x < 2; x++)
                for (int c = 0; c < 4; c++) {
                    /* The mean of a linear function over a block is that of its corners. */
                    const double mean = 4 * (5 * (2 * y + 0.5) + 2 * x + 0.5) + c;
                    const int at = 4 * (2 * y + x) + c;
                    if (is_float)
                        assert_true(fabs((double)((float *)image->levels[0].texels)[at] -
                                         0.5 * mean) < 1e-5);
                    else
                        assert_true(fabs(((uint8_t *)image->levels[0].texels)[at] - 3 * mean) <=
                                    0.5);
                }
        trc_image_release(image);
        desc.max_side = 1;
        image = loaded(&desc); /* 4 halvings would leave nothing of one side */
        assert_int_equal(image->levels[0].width * image->levels[0].height, 1);
        trc_image_release(image);
        trc_memory_fail_at(2, false);
        refused(&desc, TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
    }
}

static uint64_t committed_bytes(trc_scene scene, char *warnings, size_t capacity) {
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
    assert_int_equal(trc_scene_get_warnings(scene, warnings, capacity, NULL), TRC_OK);
    return stats.image_bytes;
}

/* Images of 256 KiB in a scene that allows 1 MiB: the fifth makes two of them smaller, the sixth a
 * third. Where there is no memory for a smaller one the image is refused and all others stay. */
static void test_scene_limit(void **state) {
    (void)state;
    static uint8_t pixels[256 * 256 * 4];
    char warnings[200];
    const trc_scene_desc scene_desc = {
        .struct_size = sizeof scene_desc, .thread_count = 1, .image_megabytes = 1};
    const trc_image_desc desc = pixels_desc(256, 256, pixels, false);
    trc_scene scene = 0;
    trc_id id = 0;
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    for (int i = 0; i < 4; i++)
        assert_int_equal(trc_image_create(scene, &desc, &id), TRC_OK);
    assert_int_equal(committed_bytes(scene, warnings, sizeof warnings), 4 << 18);
    assert_string_equal(warnings, "");
    for (int64_t n = 2; n < 4; n++) {
        trc_memory_fail_at(n, false);
        assert_int_equal(trc_image_create(scene, &desc, &id), TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
        assert_int_equal(committed_bytes(scene, warnings, sizeof warnings), 4 << 18);
    }
    assert_int_equal(trc_image_create(scene, &desc, &id), TRC_OK);
    assert_int_equal(committed_bytes(scene, warnings, sizeof warnings), (3 << 18) + (2 << 16));
    assert_non_null(strstr(warnings, "2 images are shown smaller"));
    assert_int_equal(trc_image_create(scene, &desc, &id), TRC_OK);
    assert_int_equal(committed_bytes(scene, warnings, sizeof warnings), (3 << 18) + (3 << 16));
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A smaller image is read as the whole one: what its numbers are stays. */
static void test_halves_keep_their_kind(void **state) {
    (void)state;
    static const float pixels[4 * 16] = {1, 0.5f, 0.25f, 0.5f, 1, 1, 1, 0};
    for (uint32_t mode = TRC_ALPHA_STRAIGHT; mode <= TRC_ALPHA_NONE; mode++)
        for (uint32_t is_float = 0; is_float < 2; is_float++) {
            trc_image_desc desc = pixels_desc(4, 4, pixels, is_float);
            desc.alpha_mode = mode;
            desc.is_srgb = !is_float;
            struct trc_image *image = loaded(&desc), *half = NULL;
            assert_int_equal(trc_image_halve(image, &half), TRC_OK);
            assert_int_equal(half->levels[0].width, 2);
            assert_int_equal(half->is_associated, image->is_associated);
            assert_int_equal(half->is_associated, mode < 2);
            assert_int_equal(half->is_srgb, image->is_srgb);
            assert_int_equal(half->format, image->format);
            assert_int_equal(half->bad_texel_count, image->bad_texel_count);
            trc_image_release(half);
            trc_image_release(image);
        }
}

enum { KEPT = 3, KEPT_SIDE = 256 };

/* The images of a scene as the last commit has them, of which the caller is a holder. */
static void hold_images(trc_scene scene, struct trc_image *images[KEPT]) {
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    assert_int_equal(snapshot->image_count, KEPT);
    for (int i = 0; i < KEPT; i++)
        images[i] = trc_image_retain(snapshot->images[i]);
}

static void check_kept(trc_scene scene, struct trc_image *const before[KEPT],
                       const uint8_t *pixels) {
    struct trc_image *images[KEPT];
    hold_images(scene, images);
    for (int i = 0; i < KEPT; i++) {
        assert_ptr_equal(images[i], before[i]);
        assert_int_equal(images[i]->levels[0].width, KEPT_SIDE);
        assert_int_equal(images[i]->level_count, 5);
        assert_false(images[i]->is_halved);
        assert_memory_equal(images[i]->levels[0].texels, pixels, 4 * KEPT_SIDE * KEPT_SIDE);
        trc_image_release(images[i]);
    }
}

/* The images that have been halved are shown with the next commit that succeeds. */
static void check_kept_until_commit(trc_scene scene, struct trc_image *const before[KEPT]) {
    char warnings[200];
    for (int64_t n = 0; n < 4; n++) {
        trc_memory_fail_at(n, false);
        assert_int_equal(trc_scene_commit(scene), TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
        for (int i = 0; i < KEPT; i++)
            assert_ptr_equal(query_scene_snapshot(scene)->images[i], before[i]);
    }
    assert_int_equal(committed_bytes(scene, warnings, sizeof warnings),
                     16 * TRC_IMAGE_MAX_SIDE + 4 * KEPT);
    assert_non_null(strstr(warnings, "3 images are shown smaller"));
}

/* An image that cannot be halved leaves room for nothing else: all others are halved down to a
 * texel. Wherever memory fails on the way, all images and levels are the former ones, and with
 * memory enough the same call succeeds. */
static void test_scene_limit_without_memory(void **state) {
    (void)state;
    static uint8_t pixels[4 * KEPT_SIDE * KEPT_SIDE];
    static float column[TRC_IMAGE_MAX_SIDE * 4];
    for (uint32_t i = 0; i < sizeof pixels; i++)
        pixels[i] = i % 4 == 3 ? UINT8_MAX : (uint8_t)(i * 2654435761u >> 24);
    const trc_scene_desc scene_desc = {
        .struct_size = sizeof scene_desc, .thread_count = 1, .image_megabytes = 1};
    trc_image_desc desc = pixels_desc(KEPT_SIDE, KEPT_SIDE, pixels, false);
    desc.is_mip_mapped = 1;
    trc_scene scene = 0;
    trc_id id = 0;
    struct trc_image *before[KEPT];
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    for (int i = 0; i < KEPT; i++)
        assert_int_equal(trc_image_create(scene, &desc, &id), TRC_OK);
    hold_images(scene, before);
    const trc_image_desc large = pixels_desc(1, TRC_IMAGE_MAX_SIDE, column, true);
    const uint64_t bytes = trc_memory_bytes();
    int64_t refused_count = 0;
    for (;; refused_count++) {
        trc_memory_fail_at(refused_count, false);
        const trc_status status = trc_image_create(scene, &large, &id);
        trc_memory_fail_at(-1, false);
        if (status == TRC_OK)
            break;
        assert_int_equal(status, TRC_ERROR_OUT_OF_MEMORY);
        check_kept(scene, before, pixels);
        assert_true(trc_memory_bytes() == bytes);
    }
    assert_true(refused_count > 3 * 2 * KEPT); /* several halvings of each, of several blocks */
    check_kept_until_commit(scene, before);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    for (int i = 0; i < KEPT; i++)
        trc_image_release(before[i]);
}

/* ---- levels ---- */

#define LEVEL_SIDE 64

static float level_value(const struct trc_image *image, uint32_t level, uint64_t channel) {
    const void *texels = image->levels[level].texels;
    return image->level_format == TRC_TEXEL_F32
               ? ((const float *)texels)[channel]
               : trc_half_to_float(((const uint16_t *)texels)[channel]);
}

/* The mean light of lookups between sRGB-encoded texels that are black and white by turns. */
static double checker_light(void) {
    const int steps = 64;
    double sum = 0;
    for (int j = 0; j < steps; j++)
        for (int i = 0; i < steps; i++) {
            const double s = (i + .5) / steps, t = (j + .5) / steps;
            const double x = s * (1 - t) + (1 - s) * t;
            sum += x < .04045 ? x / 12.92 : pow((x + .055) / 1.055, 2.4);
        }
    return sum / (steps * steps);
}

static void test_levels(void **state) {
    (void)state;
    static uint8_t bytes[LEVEL_SIDE * LEVEL_SIDE * 4];
    static float numbers[LEVEL_SIDE * LEVEL_SIDE * 4];
    for (int i = 0; i < LEVEL_SIDE * LEVEL_SIDE; i++)
        for (int c = 0; c < 4; c++) {
            const int x = i % LEVEL_SIDE, y = i / LEVEL_SIDE;
            bytes[4 * i + c] = c == 3 || (x + y) % 2 ? UINT8_MAX : 0;
            numbers[4 * i + c] = c == 3 ? 1.0f : (float)(x + c * y);
        }
    for (int is_srgb = 0; is_srgb < 2; is_srgb++) {
        trc_image_desc desc = pixels_desc(LEVEL_SIDE, LEVEL_SIDE, bytes, false);
        desc.is_mip_mapped = 1;
        desc.is_srgb = (uint32_t)is_srgb;
        struct trc_image *image = loaded(&desc);
        assert_int_equal(image->level_count, 3);
        assert_int_equal(image->levels[1].width, 16);
        assert_int_equal(image->levels[2].height, 8);
        assert_int_equal(image->bytes, 64 * 64 * 4 + (16 * 16 + 8 * 8) * 8);
        for (uint64_t i = 0; i < 8 * 8; i++) {
            const double inner = level_value(image, 1, 4 * (16 * (i / 8 + 4) + i % 8 + 4));
            assert_true(fabs(inner - (is_srgb ? checker_light() : .5)) < 5e-3);
            assert_true(level_value(image, 2, 4 * i + 3) == 1.0f);
        }
        trc_image_release(image);
    }
    trc_image_desc desc = pixels_desc(LEVEL_SIDE, LEVEL_SIDE, numbers, true);
    desc.is_mip_mapped = 1;
    struct trc_image *image = loaded(&desc);
    for (uint64_t i = 0; i < 8 * 8; i++)
        for (uint64_t c = 0; c < 3; c++) { /* the mean of a linear function is that of the middle */
            const double x = 8 * (double)(i % 8) + 3.5, y = 8 * (double)(i / 8) + 3.5;
            assert_true(fabs(level_value(image, 2, 4 * i + c) - (x + (double)c * y)) < 1e-3);
        }
    trc_image_release(image);
    for (int64_t n = 2; n < 4; n++) {
        trc_memory_fail_at(n, false);
        refused(&desc, TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
    }
    bytes[7] = 254; /* a texel that is not opaque */
    desc = pixels_desc(LEVEL_SIDE, LEVEL_SIDE, bytes, false);
    desc.is_mip_mapped = 1;
    image = loaded(&desc);
    assert_int_equal(image->level_count, 1);
    trc_image_release(image);
    desc.alpha_mode = TRC_ALPHA_NONE;
    desc.height = LEVEL_SIDE - 2; /* blocks do not fill it */
    desc.pixel_bytes = (uint64_t)desc.width * desc.height * 4;
    image = loaded(&desc);
    assert_int_equal(image->level_count, 1);
    trc_image_release(image);
}

static void test_holders(void **state) {
    (void)state;
    static const uint8_t pixels[4];
    const uint64_t bytes = trc_memory_bytes();
    const trc_image_desc desc = pixels_desc(1, 1, pixels, false);
    struct trc_image *image = loaded(&desc);
    assert_ptr_equal(trc_image_retain(image), image);
    trc_image_release(image);
    assert_int_equal(trc_image_bytes(image), 4);
    trc_image_release(image);
    assert_true(trc_memory_bytes() == bytes);
    assert_null(trc_image_retain(NULL));
    trc_image_release(NULL);
    assert_int_equal(trc_image_bytes(NULL), 0);
}

static void test_memory_failures(void **state) {
    (void)state;
    static const uint8_t pixels[16];
    const trc_image_desc desc = pixels_desc(2, 2, pixels, false);
    for (int64_t n = 0; n < 2; n++) {
        trc_memory_fail_at(n, false);
        refused(&desc, TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
    }
    struct trc_image *image = loaded(&desc);
    trc_image_release(image);
}

/* ---- files ---- */

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
    static const char head[] = "P6\n64 64\n65535\n";
    static uint8_t bytes[sizeof head - 1 + (size_t)LEVEL_SIDE * LEVEL_SIDE * 6];
    memcpy(bytes, head, sizeof head - 1);
    for (int i = 0; i < LEVEL_SIDE * LEVEL_SIDE; i++)
        for (int c = 0; c < 3; c++) { /* words, the high byte first, the top row first */
            const int x = i % LEVEL_SIDE, y = LEVEL_SIDE - 1 - i / LEVEL_SIDE;
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
    desc.max_side = LEVEL_SIDE / 2;
    desc.is_mip_mapped = 0;
    struct trc_image *half = loaded(&desc);
    assert_int_equal(half->levels[0].width, LEVEL_SIDE / 2);
    const uint16_t *texels = half->levels[0].texels;
    for (int i = 0; i < 8 * 8; i++)
        for (int c = 0; c < 3; c++) {
            const double x = 8 * (i % 8) + 3.5, y = 8 * (double)(i / 8) + 3.5;
            const double mean = (500 * x + 100 * (c + 1) * y) / UINT16_MAX;
            assert_true(fabs(level_value(image, 2, (uint64_t)(4 * i + c)) - mean) < 1e-3 * mean);
            const double near =
                500 * (2 * (i % 8) + .5) + 100 * (c + 1) * (2 * (double)(i / 8) + .5);
            const int at = 4 * (LEVEL_SIDE / 2 * (i / 8) + i % 8) + c;
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

/* ---- colour spaces ---- */

static trc_image_desc color_desc(const void *pixels, bool is_float, const char *space) {
    trc_image_desc desc = pixels_desc(1, 1, pixels, is_float);
    desc.color_config = path;
    desc.color_space = space;
    return desc;
}

static void test_color_of_bytes(void **state) {
    (void)state;
    static const uint8_t pixel[4] = {255, 204, 51, 128};
    static const struct {
        const char *space;
        uint32_t alpha_mode;
        float expected[4];
    } cases[] = {
        {"bright", TRC_ALPHA_CHANNEL_PACKED, {.5f, .4f, .1f, .502f}},
        {"root", TRC_ALPHA_NONE, {1, .64f, .04f, 1}},
        {"root", TRC_ALPHA_STRAIGHT, {.502f, .3213f, .02008f, .502f}},
        {"bright", TRC_ALPHA_PREMULTIPLIED, {.5f, .4f, .1f, .502f}},
        {"root", TRC_ALPHA_PREMULTIPLIED, {1.992f, 1.275f, .0797f, .502f}},
    };
    write_file("config.ocio", color_config, sizeof color_config - 1);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        trc_image_desc desc = color_desc(pixel, false, cases[i].space);
        desc.alpha_mode = cases[i].alpha_mode;
        struct trc_image *image = loaded(&desc);
        assert_int_equal(image->format, TRC_TEXEL_F16);
        assert_int_equal(image->bytes, 8);
        assert_int_equal(image->is_associated, cases[i].alpha_mode <= TRC_ALPHA_PREMULTIPLIED);
        for (int c = 0; c < 4; c++) {
            const float value = trc_half_to_float(((uint16_t *)image->levels[0].texels)[c]);
            assert_true(fabsf(value - cases[i].expected[c]) <= 2e-3f * cases[i].expected[c]);
        }
        trc_image_release(image);
    }
    const trc_image_desc desc = color_desc(pixel, false, "linear");
    struct trc_image *image = loaded(&desc);
    assert_int_equal(image->format, TRC_TEXEL_U8);
    trc_image_release(image);
    remove(path);
}

static void test_color_of_floats(void **state) {
    (void)state;
    static const float pixel[4] = {3, .5f, .25f, 1};
    static const float huge[4] = {3e38f, 0, 0, 1};
    write_file("config.ocio", color_config, sizeof color_config - 1);
    trc_image_desc desc = color_desc(pixel, true, "root");
    struct trc_image *image = loaded(&desc);
    const float *texel = image->levels[0].texels;
    assert_int_equal(image->format, TRC_TEXEL_F32);
    assert_true(fabsf(texel[0] - 9) < 1e-4f && fabsf(texel[1] - .25f) < 1e-5f && texel[3] == 1);
    trc_image_release(image);
    desc.pixels = huge;
    image = loaded(&desc);
    texel = image->levels[0].texels;
    assert_true(texel[0] == 0 && texel[3] == 0 && image->bad_texel_count == 1);
    trc_image_release(image);
    remove(path);
}

static void test_color_of_grey_files(void **state) {
    (void)state;
    struct sample f = {.name = "grey.pgm"};
    char image_path[sizeof path];
    put(&f, "P5\n1 1\n255\n\x33", 12);
    write_file(f.name, f.bytes, f.size);
    memcpy(image_path, path, sizeof path);
    write_file("config.ocio", color_config, sizeof color_config - 1);
    const trc_image_desc desc = {.struct_size = sizeof desc,
                                 .path = image_path,
                                 .color_config = path,
                                 .color_space = "root"};
    struct trc_image *image = loaded(&desc);
    const uint16_t *texel = image->levels[0].texels;
    assert_true(fabsf(trc_half_to_float(texel[0]) - .04f) < 5e-5f);
    assert_true(texel[1] == texel[0] && texel[2] == texel[0] && texel[3] == TRC_HALF_ONE);
    trc_image_release(image);
    remove(image_path);
    remove(path);
}

static void test_refused_colors(void **state) {
    (void)state;
    static const uint8_t pixel[4] = {1, 2, 3, 4};
    write_file("config.ocio", color_config, sizeof color_config - 1);
    trc_image_desc desc = color_desc(pixel, false, "no such space");
    refused(&desc, TRC_ERROR_IMAGE);
    assert_non_null(strstr(trc_last_message(), "no such space"));
    desc.color_space = "root";
    for (int64_t n = 0; n < 2; n++) {
        trc_memory_fail_at(n, false);
        refused(&desc, TRC_ERROR_OUT_OF_MEMORY);
        trc_memory_fail_at(-1, false);
    }
    desc.is_srgb = 1;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc.is_srgb = 0;
    desc.color_config = NULL;
    refused(&desc, TRC_ERROR_INVALID_ARGUMENT);
    desc.color_config = "/nonexistent/config.ocio";
    refused(&desc, TRC_ERROR_IMAGE);
    remove(path);
}

#else

static void test_no_colors(void **state) {
    (void)state;
    static const uint8_t pixel[4];
    trc_image_desc desc = pixels_desc(1, 1, pixel, false);
    desc.color_config = desc.color_space = "x";
    refused(&desc, TRC_ERROR_UNSUPPORTED);
}

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
        cmocka_unit_test(test_bytes),
        cmocka_unit_test(test_floats),
        cmocka_unit_test(test_refused_pixels),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_scene_limit),
        cmocka_unit_test(test_halves_keep_their_kind),
        cmocka_unit_test(test_scene_limit_without_memory),
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_holders),
        cmocka_unit_test(test_memory_failures),
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
        cmocka_unit_test(test_color_of_bytes),
        cmocka_unit_test(test_color_of_floats),
        cmocka_unit_test(test_color_of_grey_files),
        cmocka_unit_test(test_refused_colors),
#else
        cmocka_unit_test(test_no_colors),
        cmocka_unit_test(test_no_files),
#endif
    };
    return cmocka_run_group_tests(tests, set_up_reader, tear_down_reader);
}
