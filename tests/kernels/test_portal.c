/* Ray portals beside what they must show: the emission where their rays end, times their colour. */
#include "node_list.h"
#include "picture_test.h"

#define SIZE 16
#define COLOR 0.5f
/* Emissions of the squares that rays may end at. */
#define ABOVE 3.0f
#define BELOW 5.0f
#define BEHIND 7.0f
/* Where the other room is, and how wide all squares are. */
#define ROOM_X 40.0f
#define HALF 8.0f

static trc_id add_portal(trc_scene scene, trc_node_input position, trc_node_input direction) {
    struct node_list list = {0};
    const uint32_t portal = NODE_ADD(&list, TRC_NODE_RAY_PORTAL, 0, node_color(COLOR, COLOR, COLOR),
                                     position, direction);
    const trc_material_desc desc = node_list_material(&list, portal);
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* The picture's middle, of a portal that the camera looks down on. */
static float shown(trc_node_input position, trc_node_input direction, uint32_t integrator) {
    static float pixels[4 * SIZE * SIZE];
    static const float window[4] = {-0.1f, 0.1f, -0.1f, 0.1f};
    trc_scene scene = scene_create();
    add_square(scene, 0, 0, 0, HALF, add_portal(scene, position, direction));
    add_square(scene, 0, 0, -2, HALF, fixture_material(scene, TRC_NODE_EMISSION, BEHIND));
    add_square(scene, ROOM_X, 0, 1, HALF, fixture_material(scene, TRC_NODE_EMISSION, ABOVE));
    add_square(scene, ROOM_X, 0, -1, HALF, fixture_material(scene, TRC_NODE_EMISSION, BELOW));
    const trc_camera_desc camera = camera_desc(window);
    set_camera(scene, &camera);
    trc_render_desc desc = render_desc(SIZE, 1);
    desc.integrator = integrator;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    const float *middle = pixels + 4 * (SIZE * (SIZE / 2) + SIZE / 2);
    for (int i = 0; i < SIZE * SIZE; i++)
        assert_float_equal(pixels[4 * i], middle[0], 0.0f);
    return middle[0];
}

static void test_portals(void **state) {
    (void)state;
    const trc_node_input room = node_color(ROOM_X, 0, 0), own = node_number(0);
    static const uint32_t integrators[] = {TRC_INTEGRATOR_WHITTED, TRC_INTEGRATOR_DISTRIBUTION};
    for (int i = 0; i < 2; i++) {
        const struct {
            trc_node_input position, direction;
            float expected;
        } cases[] = {
            {room, own, COLOR * BELOW},
            {room, node_color(0, 0, 0.25f), COLOR * ABOVE}, /* need not be unit */
            {room, node_color(1, 0, 0), 0},                 /* between both */
            {node_standard(), own, COLOR * BEHIND},
            {node_color(ROOM_X, 0, -9), node_color(0, 0, 1), COLOR * BELOW},
            /* Squares that floats do not hold: the ray's own direction; no place, so black. */
            {room, node_color(0, 0, 1e30f), COLOR * BELOW},
            {node_color(1e30f, 0, 0), own, 0},
        };
        for (size_t k = 0; k < sizeof cases / sizeof *cases; k++)
            assert_float_equal(shown(cases[k].position, cases[k].direction, integrators[i]),
                               cases[k].expected, 0.0f);
    }
}

/* Portals end light samples, whatever they would lead to. */
static void test_shadow(void **state) {
    (void)state;
    static float pixels[4 * SIZE * SIZE];
    static const float window[4] = {-0.1f, 0.1f, -0.1f, 0.1f};
    for (int covered = 0; covered < 2; covered++) {
        trc_scene scene = scene_create();
        add_square(scene, 0, 0, 0, HALF, fixture_material(scene, TRC_NODE_DIFFUSE, 1.0f));
        /* Above the camera, which is at 6 m. */
        if (covered)
            add_square(scene, 0, 0, 8, HALF, add_portal(scene, node_standard(), node_number(0)));
        trc_light_desc light = trc_light_desc_default();
        light.transform[11] = 10.0f;
        light.strength = 1000.0f;
        trc_id id = 0;
        assert_ok(trc_light_create(scene, &light, &id));
        const trc_camera_desc camera = camera_desc(window);
        set_camera(scene, &camera);
        const trc_render_desc desc = render_desc(SIZE, 1);
        render(scene, &desc, pixels);
        assert_ok(trc_scene_destroy(scene));
        assert_int_equal(pixels[0] > 0.0f, !covered);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_portals),
        cmocka_unit_test(test_shadow),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
