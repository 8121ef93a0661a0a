/* The library's defaults: each is accepted as it is or with what it says is still to be set, and a
 * picture of defaults alone is what the light on it must give. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tracer/tracer.h"

#define SIDE 8
#define PI 3.14159265358979

static trc_scene create(void) {
    const trc_scene_desc desc = trc_scene_desc_default();
    trc_scene scene = 0;
    assert_int_equal(trc_scene_create(&desc, &scene), TRC_OK);
    return scene;
}

/* A square of 4 m around (0, 0, -2), across the default camera's axis, with the default instance.
 */
static void add_wall(trc_scene scene) {
    static const float positions[12] = {-2, -2, -2, 2, -2, -2, 2, 2, -2, -2, 2, -2}, uv[12] = {0};
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    trc_corner_attribute attribute = trc_corner_attribute_default();
    attribute.name = "UV";
    attribute.values = uv;
    attribute.value_count = 12;
    trc_mesh_desc mesh_desc = trc_mesh_desc_default();
    mesh_desc.vertex_count = 4;
    mesh_desc.triangle_count = 2;
    mesh_desc.positions = positions;
    mesh_desc.position_count = 12;
    mesh_desc.indices = indices;
    mesh_desc.index_count = 6;
    mesh_desc.attributes = &attribute;
    mesh_desc.attribute_count = 1;
    trc_id id = 0;
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &id), TRC_OK);
    trc_instance_desc instance_desc = trc_instance_desc_default();
    instance_desc.mesh = id;
    assert_int_equal(trc_instance_create(scene, &instance_desc, &id), TRC_OK);
}

static void expect_near(double value, double expected, double tolerance, const char *what) {
    if (!(value >= expected - tolerance && value <= expected + tolerance))
        fail_msg("%s: %g, not %g", what, value, expected);
}

/* The default light, 1 W to all sides, is at the camera: at 2 m, head on, an irradiance of
 * 1 / (16 pi) W/m^2, of which the default grey sends 0.8 / pi back. */
static void a_picture_of_defaults(void **state) {
    (void)state;
    const trc_scene scene = create();
    add_wall(scene);
    const trc_light_desc light_desc = trc_light_desc_default();
    const trc_camera_desc camera_desc = trc_camera_desc_default();
    const trc_world_desc world_desc = trc_world_desc_default();
    trc_id light = 0;
    assert_int_equal(trc_light_create(scene, &light_desc, &light), TRC_OK);
    assert_int_equal(trc_scene_set_camera(scene, &camera_desc), TRC_OK);
    assert_int_equal(trc_scene_set_world(scene, &world_desc), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);

    trc_scene_stats stats = trc_scene_stats_default();
    assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
    assert_int_equal(stats.features, TRC_FEATURE_LIGHTS);

    trc_render_desc render_desc = trc_render_desc_default();
    render_desc.width = render_desc.height = SIDE;
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &render_desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    trc_render_progress progress = trc_render_progress_default();
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_int_equal(progress.state, TRC_PROGRESS_DONE);
    static float pixels[SIDE * SIDE * 4];
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, SIDE * SIDE * 4), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    const float *middle = pixels + 4 * (SIDE * SIDE / 2 + SIDE / 2);
    const double expected = 0.8 / PI / (16.0 * PI);
    expect_near(middle[0], expected, 0.05 * expected, "grey"); /* of a pixel beside the axis */
    assert_true(middle[3] == 1.0f);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void rays_and_hits(void **state) {
    (void)state;
    const trc_scene scene = create();
    add_wall(scene);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const float zero = 0.0f, down = -1.0f;
    uint32_t instance = 77;
    float distance = 0.0f;
    trc_rays rays = trc_rays_default();
    rays.count = 1;
    rays.origin_x = rays.origin_y = rays.origin_z = rays.direction_x = rays.direction_y = &zero;
    rays.direction_z = &down;
    trc_hits hits = trc_hits_default();
    hits.instance = &instance;
    hits.distance = &distance;
    assert_int_equal(trc_query_closest(scene, &rays, 0, &hits), TRC_OK);
    assert_int_equal(instance, 0);
    expect_near(distance, 2.0, 1e-6, "distance");
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void materials_and_readers(void **state) {
    (void)state;
    const trc_scene scene = create();
    trc_id material = 0;
    trc_material_desc desc = trc_material_desc_default();
    assert_int_equal(trc_material_create(scene, &desc, &material), TRC_OK);
    const trc_node_input inputs[] = {
        trc_node_input_default(), trc_node_input_default(), {.node = TRC_INPUT_DEFAULT}};
    trc_node node = trc_node_default();
    node.input_count = 3;
    desc.nodes = &node;
    desc.inputs = inputs;
    desc.node_count = 1;
    desc.input_count = 3;
    desc.surface = 0;
    assert_int_equal(trc_material_update(scene, material, &desc), TRC_OK);

    const uint8_t white[4] = {255, 255, 255, 255};
    trc_image_desc image_desc = trc_image_desc_default();
    image_desc.width = image_desc.height = 1;
    image_desc.pixels = white;
    image_desc.pixel_bytes = sizeof white;
    trc_id image = 0;
    assert_int_equal(trc_image_create(scene, &image_desc, &image), TRC_OK);

    const trc_reader_desc reader_desc = trc_reader_desc_default();
    trc_reader reader = 0;
    assert_int_equal(trc_reader_create(&reader_desc, &reader), TRC_OK);
    assert_int_equal(trc_reader_destroy(reader), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_picture_of_defaults),
        cmocka_unit_test(rays_and_hits),
        cmocka_unit_test(materials_and_readers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
