/* Normals that are linked to shaders, of any length, as colours are: with
 * TRC_MATERIAL_KEEPS_NORMALS they are as long as 1, and those without a direction are the
 * surface's. */
#include "node_list.h"
#include "picture_test.h"

/* Red of a square in the lamp's light, which is shaded with that normal; NULL: its own. */
static float shaded(bool is_glossy, const float normal[3]) {
    struct node_list list = {0};
    const trc_node_input white = node_color(0.8f, 0.8f, 0.8f);
    const trc_node_input n = normal ? node_color(normal[0], normal[1], normal[2]) : node_standard();
    if (is_glossy)
        NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_GGX, white, node_number(0.5f),
                 node_number(0.0f), node_number(0.0f), n, node_standard());
    else
        NODE_ADD(&list, TRC_NODE_DIFFUSE, 0, white, node_number(0.0f), n);
    const trc_scene scene = scene_create();
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = list.node_count,
                                    .nodes = list.nodes,
                                    .inputs = list.inputs,
                                    .input_count = list.input_count,
                                    .flags = TRC_MATERIAL_KEEPS_NORMALS};
    trc_id material = 0, light = 0;
    assert_ok(trc_material_create(scene, &desc, &material));
    add_square(scene, 0.0f, 0.0f, 0.0f, 4.0f, material);
    const trc_light_desc lamp = default_light_desc();
    assert_ok(trc_light_create(scene, &lamp, &light));
    const float window[4] = {-0.1f, 0.1f, -0.1f, 0.1f};
    const trc_camera_desc camera = camera_desc(window);
    set_camera(scene, &camera);
    const trc_render_desc picture = render_desc(1, 64);
    float pixel[4];
    render(scene, &picture, pixel);
    assert_ok(trc_scene_destroy(scene));
    assert_true(pixel[0] > 0.0f);
    return pixel[0];
}

static void lengths(void **state) {
    (void)state;
    static const float unit[3] = {0.28f, 0.0f, 0.96f};
    for (int is_glossy = 0; is_glossy < 2; is_glossy++) {
        const float expected = shaded(is_glossy, unit), own = shaded(is_glossy, NULL);
        assert_true(fabsf(expected / own - 1.0f) > 0.01f);
        for (int k = 0; k < 2; k++) {
            const float length = k ? 1.7f : 0.4f;
            const float longer[3] = {length * unit[0], length * unit[1], length * unit[2]};
            assert_float_equal(shaded(is_glossy, longer) / expected, 1.0f, 1e-5f);
        }
        static const float none[3] = {0.0f, 0.0f, 0.0f};
        assert_float_equal(shaded(is_glossy, none) / own, 1.0f, 1e-5f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(lengths)};
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("linked normals", tests, NULL, NULL);
}
