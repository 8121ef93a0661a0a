/* Files that tests of images write and load, and a configuration of colour spaces. Needs cmocka. */
#ifndef TRACER_UNIT_IMAGE_FILE_H
#define TRACER_UNIT_IMAGE_FILE_H

#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "image/image.h"
#include "image/reader.h"

/* Of the file written last: the test removes it. */
static char path[256];

static void write_file(const char *name, const void *bytes, size_t size) {
    const char *folder = getenv("TMPDIR");
    snprintf(path, sizeof path, "%s/trc_test_image_%s", folder ? folder : P_tmpdir, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

#ifndef TRC_READER_PROGRAM
#define TRC_READER_PROGRAM NULL /* a build without OpenImageIO */
#endif

/* Reads the files of all tests of the program, once there is one to read. */
static struct trc_image_reader *file_reader;
static uint64_t bytes_at_start;

static const struct trc_image_source *file_source(void) {
    static struct trc_image_source source;
    if (!file_reader)
        assert_int_equal(trc_image_reader_create(TRC_READER_PROGRAM, &file_reader), TRC_OK);
    source.reader = file_reader;
    return &source;
}

/* Where an image with those fields comes from: pixels in no colour space need no reader. */
static const struct trc_image_source *source_of(const trc_image_desc *desc) {
    static const struct trc_image_source none;
    return desc->path || desc->color_space ? file_source() : &none;
}

/* Group set-up and teardown: nothing of what the tests took is left, but for the table of handles,
 * which stays from the first scene on. */
static int note_memory(void **state) {
    (void)state;
    const trc_scene_desc desc = {.struct_size = sizeof desc, .thread_count = 1};
    trc_scene scene = 0;
    if (trc_scene_create(&desc, &scene) != TRC_OK || trc_scene_destroy(scene) != TRC_OK)
        return 1;
    bytes_at_start = trc_memory_bytes();
    return 0;
}
static int release_reader(void **state) {
    (void)state;
    trc_image_reader_release(file_reader);
    return trc_memory_bytes() != bytes_at_start;
}

/* An image that must load. */
static struct trc_image *loaded(const trc_image_desc *desc) {
    struct trc_image *image = NULL;
    const trc_status status = trc_image_load(desc, source_of(desc), &image);
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

#endif
