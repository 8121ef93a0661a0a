/* Images: pixels of any bits and sizes, files of any bytes, looked up by every interpolation. */
#include "bytes.h"
#include "stage.h"

#include <stdio.h>
#include <unistd.h>

/* A file of the rest of the input in a format that the first byte chooses. It is in the
 * current folder and the process's own, so that fuzzers can run side by side. */
static void file_image(struct bytes *b, trc_image_desc *desc, char *path, size_t path_size) {
    static const char *const extensions[] = {"hdr", "bmp", "tga", "png", "pnm", "exr"};
    const char *extension = extensions[bytes_below(b, sizeof extensions / sizeof *extensions)];
    (void)snprintf(path, path_size, "fuzz_image_%ld.%s", (long)getpid(), extension);
    FILE *file = fopen(path, "wb");
    if (!file)
        return;
    (void)fwrite(b->at, 1, b->left, file);
    (void)fclose(file);
    desc->path = path;
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
    const trc_scene scene = stage_scene();
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
