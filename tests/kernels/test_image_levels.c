/* Which level of an image a picture shows: by the part of a pixel that one sample stands for. */
#include "figures.h"
#include "level_test.h"

/* Texels across a pixel; the image is a square on a strip, narrower texels above each other. */
enum { TEXELS = 8, WIDTH = LEVEL_WIDTH * TEXELS, HEIGHT = WIDTH };

/* Every other pixel's texels are white, over the whole view. is_late: the image gets its contents
 * when the material is there. */
static trc_scene striped(bool is_late) {
    static uint8_t pixels[4 * WIDTH * HEIGHT];
    const trc_scene scene = fixture_level_view();
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++)
        for (uint32_t c = 0; c < 4; c++)
            pixels[4 * i + c] = c == 3 || i % WIDTH / TEXELS % 2 ? 255 : 0;
    trc_image_desc desc = default_image_desc();
    trc_id image = 0;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.is_float = 0;
    desc.is_mip_mapped = 1;
    desc.pixels = pixels;
    desc.pixel_bytes = sizeof pixels;
    const trc_image_desc none = {.struct_size = sizeof none, .is_mip_mapped = 1};
    assert_ok(trc_image_create(scene, is_late ? &none : &desc, &image));
    struct node_list list = {0};
    const uint32_t texture = NODE_ADD(&list, TRC_NODE_IMAGE, TRC_IMAGE_LINEAR | TRC_IMAGE_EXTEND,
                                      node_standard(), node_number(0.0f));
    list.nodes[texture].image = image;
    const uint32_t surface =
        NODE_ADD(&list, TRC_NODE_EMISSION, 0, node_link(texture, 0), node_number(1.0f));
    const float corners[12] = {0, -0.5f, 0, 4, -0.5f, 0, 4, 0.5f, 0, 0, 0.5f, 0};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float uv[12] = {0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1};
    const trc_corner_attribute map = {
        .struct_size = sizeof map, .name = "UVMap", .width = 2, .values = uv, .value_count = 12};
    trc_mesh_desc mesh = default_mesh_desc();
    mesh.vertex_count = 4;
    mesh.triangle_count = 2;
    mesh.positions = corners;
    mesh.position_count = 12;
    mesh.indices = indices;
    mesh.index_count = 6;
    mesh.attributes = &map;
    mesh.attribute_count = 1;
    fixture_mesh(scene, &mesh, level_material(scene, &list, surface, 0), 0);
    assert_ok(trc_image_update(scene, image, &desc));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* Mean of the white pixels less that of the black ones, without those at the image's sides. */
static double contrast(trc_scene scene, uint32_t samples) {
    static float pixels[4 * LEVEL_PIXELS];
    trc_render_desc desc = default_render_desc(LEVEL_WIDTH, LEVEL_HEIGHT, samples);
    desc.filter_width = 1.0f;
    double sum[2] = {0.0, 0.0};
    render(scene, &desc, pixels);
    for (int p = 0; p < LEVEL_PIXELS; p++)
        if (p % LEVEL_WIDTH > 0 && p % LEVEL_WIDTH < LEVEL_WIDTH - 1)
            sum[p % LEVEL_WIDTH % 2] += (double)pixels[4 * p] / (7.0 * LEVEL_HEIGHT);
    return sum[1] - sum[0];
}

/* With one sample a pixel shows the level whose texels are as wide as it, blurred over two of them:
 * a half of the contrast. With many it shows the image, whose ramp of one texel between neighbours
 * takes a quarter of a texel from each end of a stripe. */
static void check_levels(bool is_late) {
    const trc_scene scene = striped(is_late);
    double found[2];
    for (int k = 0; k < 2; k++)
        found[k] = contrast(scene, k ? 1024 : 1);
    print_figure("contrast of stripes of a pixel", "%.3f of 1, 1024 samples %.3f", found[0],
                 found[1]);
    assert_true(fabs(found[0] - 0.5) < 0.1);
    assert_true(fabs(found[1] - (1.0 - 2.0 / (4.0 * TEXELS))) < 0.01);
    assert_ok(trc_scene_destroy(scene));
}

static void samples_choose_the_level(void **state) {
    (void)state;
    check_levels(false);
    check_levels(true);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(samples_choose_the_level)};
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("image levels", tests, NULL, NULL);
}
