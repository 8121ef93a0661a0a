/* Images: what pixels become, what is refused, their levels, and who holds them. */
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

/* The first images of a scene as the last commit has them, of which the caller is a holder. */
static void hold_images(trc_scene scene, struct trc_image *images[KEPT]) {
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    assert_true(snapshot->image_count >= KEPT);
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
 * memory enough the same call succeeds. is_late: it is an image already, without contents. */
static void check_limit_without_memory(bool is_late) {
    static uint8_t pixels[4 * KEPT_SIDE * KEPT_SIDE];
    static float column[TRC_IMAGE_MAX_SIDE * 4];
    for (uint32_t i = 0; i < sizeof pixels; i++)
        pixels[i] = i % 4 == 3 ? UINT8_MAX : (uint8_t)(i * 2654435761u >> 24);
    const trc_scene_desc scene_desc = {
        .struct_size = sizeof scene_desc, .thread_count = 1, .image_megabytes = 1};
    const trc_image_desc none = {.struct_size = sizeof none};
    trc_image_desc desc = pixels_desc(KEPT_SIDE, KEPT_SIDE, pixels, false);
    desc.is_mip_mapped = 1;
    trc_scene scene = 0;
    trc_id id = 0;
    struct trc_image *before[KEPT];
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    for (int i = 0; i < KEPT; i++)
        assert_int_equal(trc_image_create(scene, &desc, &id), TRC_OK);
    if (is_late)
        assert_int_equal(trc_image_create(scene, &none, &id), TRC_OK);
    hold_images(scene, before);
    const trc_image_desc large = pixels_desc(1, TRC_IMAGE_MAX_SIDE, column, true);
    const uint64_t bytes = trc_memory_bytes();
    int64_t refused_count = 0;
    for (;; refused_count++) {
        trc_memory_fail_at(refused_count, false);
        const trc_status status =
            is_late ? trc_image_update(scene, id, &large) : trc_image_create(scene, &large, &id);
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

static void test_scene_limit_without_memory(void **state) {
    (void)state;
    check_limit_without_memory(false);
    check_limit_without_memory(true);
}

/* ---- levels ---- */

#define LEVEL_SIDE 64

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
    };
    return cmocka_run_group_tests(tests, set_up_reader, tear_down_reader);
}
