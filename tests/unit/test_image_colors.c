/* Images of colour spaces that a configuration of OpenColorIO names. */
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

#ifdef TRC_TEST_READER

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
    static const char grey[] = "P5\n1 1\n255\n\x33";
    char image_path[sizeof path];
    write_file("grey.pgm", grey, sizeof grey - 1);
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

#endif

int main(void) {
    const struct CMUnitTest tests[] = {
#ifdef TRC_TEST_READER
        cmocka_unit_test(test_color_of_bytes),
        cmocka_unit_test(test_color_of_floats),
        cmocka_unit_test(test_color_of_grey_files),
        cmocka_unit_test(test_refused_colors),
#else
        cmocka_unit_test(test_no_colors),
#endif
    };
    return cmocka_run_group_tests(tests, set_up_reader, tear_down_reader);
}
