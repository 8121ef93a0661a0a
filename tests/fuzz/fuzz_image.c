/* Images: pixels of any bits and sizes, files of any bytes and format, looked up by every
 * interpolation. Files are read by tracer_reader, which they may crash, but nothing else.
 *
 * tests/support/image_corpus.py --fuzz FOLDER writes inputs with a valid file of every format. */
#include "bytes.h"
#include "stage.h"

#include <ctype.h>
#include <stdio.h>
#include <unistd.h>

enum { EXTENSION_MAX = 6 };

/* The name's extension: letters and digits up to a byte that is none, which is used up. */
static void extension_of(struct bytes *b, char out[EXTENSION_MAX + 1]) {
    size_t length = 0;
    for (;;) {
        const int c = bytes_byte(b);
        if (!isalnum(c) || length == EXTENSION_MAX)
            break;
        out[length++] = (char)c;
    }
    out[length] = '\0';
}

/* A file of the rest of the input. It is in the current folder and the process's own, so that
 * fuzzers can run side by side. */
static void file_image(struct bytes *b, trc_image_desc *desc, char *path, size_t path_size) {
    char extension[EXTENSION_MAX + 1];
    extension_of(b, extension);
    (void)snprintf(path, path_size, "fuzz_image_%ld.%s", (long)getpid(), extension);
    FILE *file = fopen(path, "wb");
    if (!file)
        return;
    (void)fwrite(b->at, 1, b->left, file);
    (void)fclose(file);
    desc->path = path;
}

/* One for all inputs: to start its program takes longer than they do. */
static trc_reader the_reader(void) {
    static trc_reader reader;
    if (!reader) {
        trc_reader_desc desc = trc_reader_desc_default();
#ifdef TRC_TEST_READER
        desc.program = TRC_TEST_READER;
#endif
        (void)trc_reader_create(&desc, &reader);
    }
    return reader;
}

static trc_scene reading_scene(void) {
    trc_scene_desc desc = default_scene_desc();
    desc.thread_count = 1;
    desc.reader = the_reader();
    trc_scene scene = 0;
    return trc_scene_create(&desc, &scene) == TRC_OK ? scene : 0;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct bytes b = {data, size};
    char path[64] = "";
    float pixels[16 * 16 * 4];
    trc_image_desc desc = {.struct_size = sizeof desc,
                           .alpha_mode = bytes_below(&b, 5),
                           .is_srgb = bytes_below(&b, 3),
                           .is_float = bytes_below(&b, 2)};
    const uint32_t mode = bytes_below(&b, 64);
    if (bytes_below(&b, 2)) {
        file_image(&b, &desc, path, sizeof path);
    } else {
        desc.width = bytes_below(&b, 17);
        desc.height = bytes_below(&b, 17);
        desc.pixel_bytes = (uint64_t)desc.width * desc.height * (desc.is_float ? 16 : 4);
        desc.pixel_bytes -= bytes_below(&b, 64) == 0;
        bytes_floats(&b, pixels, (size_t)4 * desc.width * desc.height);
        desc.pixels = pixels;
    }
    const trc_scene scene = reading_scene();
    trc_id image = 0, material = 0;
    (void)trc_image_create(scene, &desc, &image);
    const trc_node_input inputs[] = {{.node = 0},
                                     {.node = -1, .value = {bytes_float(&b)}},
                                     {.node = 1},
                                     {.node = -1, .value = {1.0f}}};
    const trc_node nodes[] = {
        {.type = TRC_NODE_TEXTURE_COORDINATE},
        {.type = TRC_NODE_IMAGE, .mode = mode, .input_count = 2, .image = image},
        {.type = TRC_NODE_EMISSION, .first_input = 2, .input_count = 2}};
    const trc_material_desc shader = {.struct_size = sizeof shader,
                                      .node_count = 3,
                                      .nodes = nodes,
                                      .inputs = inputs,
                                      .input_count = 4,
                                      .surface = 2,
                                      .flags = TRC_MATERIAL_SAMPLE_EMISSION};
    (void)trc_material_create(scene, &shader, &material);
    stage_camera(scene);
    stage_quad(scene, material);
    const trc_render_desc render = stage_render();
    stage_run(scene, &render);
    (void)trc_scene_destroy(scene);
    if (desc.path)
        (void)unlink(path);
    return 0;
}
