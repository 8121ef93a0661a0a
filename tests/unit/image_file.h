/* Files that tests of images write and load, and a configuration of colour spaces. Needs cmocka. */
#ifndef TRACER_UNIT_IMAGE_FILE_H
#define TRACER_UNIT_IMAGE_FILE_H

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/core.h"
#include "image/image.h"
#include "image/reader.h"
#include "model/texel.h"

/* Of the file written last: the test removes it. */
static char path[256];

static inline void write_file(const char *name, const void *bytes, size_t size) {
    const char *folder = getenv("TMPDIR");
    snprintf(path, sizeof path, "%s/trc_test_image_%ld_%s", folder ? folder : P_tmpdir,
             (long)getpid(), name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

/* What reads the files; a group's set-up makes it. */
static struct trc_image_source source;

/* The environment may name another one: TRC_TEST_PYTHON to run TRC_TEST_SCRIPT. */
static int set_up_reader(void **state) {
    (void)state;
#ifdef TRC_TEST_READER
    const char *built = TRC_TEST_READER;
#else
    const char *built = "/nonexistent/reader";
#endif
    const char *python = getenv("TRC_TEST_PYTHON");
    if (trc_image_reader_create(python ? python : built, python ? getenv("TRC_TEST_SCRIPT") : NULL,
                                &source.reader) != TRC_OK)
        return -1;
    trc_image_reader_start(source.reader);
    return 0;
}

static int tear_down_reader(void **state) {
    (void)state;
    trc_image_reader_release(source.reader);
    return 0;
}

/* Memory that is in use, without processes that wait for the next file. */
static inline uint64_t memory_of_images(void) {
    trc_image_reader_rest(source.reader);
    return trc_memory_bytes();
}

/* An image that must load. */
static inline struct trc_image *loaded(const trc_image_desc *desc) {
    struct trc_image *image = NULL;
    const trc_status status = trc_image_load(desc, &source, &image);
    if (status != TRC_OK)
        fail_msg("status %d: %s", status, trc_last_message());
    return image;
}

/* Beside scene-linear: a space that is twice as bright, and one that is encoded as a square root.
 */
static const char color_config[] =
    "ocio_profile_version: 1\n"
    "roles: {scene_linear: linear, default: linear}\n"
    "displays:\n"
    "  d:\n"
    "    - !<View> {name: v, colorspace: linear}\n"
    "colorspaces:\n"
    "  - !<ColorSpace> {name: linear}\n"
    "  - !<ColorSpace>\n"
    "    name: bright\n"
    "    to_reference: !<MatrixTransform> {matrix: [.5,0,0,0, 0,.5,0,0, 0,0,.5,0, 0,0,0,1]}\n"
    "  - !<ColorSpace>\n"
    "    name: root\n"
    "    to_reference: !<ExponentTransform> {value: [2, 2, 2, 1]}\n";

/* Pixels of bytes or floats, RGBA, straight alpha. */
static inline trc_image_desc pixels_desc(uint32_t width, uint32_t height, const void *pixels,
                                         bool is_float) {
    return (trc_image_desc){.struct_size = sizeof(trc_image_desc),
                            .width = width,
                            .height = height,
                            .alpha_mode = TRC_ALPHA_STRAIGHT,
                            .is_float = is_float,
                            .pixels = pixels,
                            .pixel_bytes = (uint64_t)width * height * (is_float ? 16 : 4)};
}

/* An image that must not load, with that status and a message, and nothing kept. */
static inline void refused(const trc_image_desc *desc, trc_status expected) {
    struct trc_image *image = NULL;
    const uint64_t bytes = memory_of_images();
    const trc_status status = trc_image_load(desc, &source, &image);
    if (status != expected)
        fail_msg("status %d: %s", status, trc_last_message());
    assert_true(trc_last_message()[0] != '\0');
    assert_null(image);
    assert_true(memory_of_images() == bytes);
}

/* A value of a smaller level, by its place among the level's. */
static inline float level_value(const struct trc_image *image, uint32_t level, uint64_t channel) {
    const void *texels = image->levels[level].texels;
    return image->level_format == TRC_TEXEL_F32
               ? ((const float *)texels)[channel]
               : trc_half_to_float(((const uint16_t *)texels)[channel]);
}

#endif
