/* How wide shadow rays are: the shadow of a net whose wires are as thick as a share of that width,
 * beside the part of a triangle that is farther from its edges. */
#include "level_test.h"

#include "meshes.h"

/* Of the net, m; pixels of the level view are PIXEL wide, and wires that share of one. */
#define HEIGHT 2.0f
#define CELL 0.5f
#define PIXEL 0.25f
#define WIRE 0.05f
#define SAMPLES 256

/* Wires in pixels, black, of what is clear. flags: TRC_MATERIAL_*. */
static trc_id net_material(trc_scene scene, float size, uint32_t flags) {
    struct node_list list = {0};
    const uint32_t wires =
        NODE_ADD(&list, TRC_NODE_WIREFRAME, TRC_WIREFRAME_PIXELS, node_number(size));
    const uint32_t clear = NODE_ADD(&list, TRC_NODE_TRANSPARENT, 0, node_color(1.0f, 1.0f, 1.0f));
    const uint32_t black = NODE_ADD(&list, TRC_NODE_TRANSPARENT, 0, node_color(0.0f, 0.0f, 0.0f));
    const uint32_t mix = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_link(wires, 0),
                                  node_link(clear, 0), node_link(black, 0));
    return level_material(scene, &list, mix, flags);
}

/* Whole cells above the view, and more around them. */
static void add_net(trc_scene scene, trc_id material) {
    static const float origin[3] = {-1.0f, -1.5f, HEIGHT}, u[3] = {6, 0, 0}, v[3] = {0, 3, 0};
    struct mesh net;
    mesh_init(&net);
    mesh_add_grid(&net, origin, u, v, (uint32_t)(u[0] / CELL), (uint32_t)(v[1] / CELL));
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = net.vertex_count;
    desc.triangle_count = net.triangle_count;
    desc.positions = net.positions;
    desc.position_count = (uint64_t)3 * net.vertex_count;
    desc.indices = net.indices;
    desc.index_count = (uint64_t)3 * net.triangle_count;
    fixture_mesh(scene, &desc, material, 0);
    mesh_free(&net);
}

/* Matt and glossy; share: of the latter. */
static trc_id floor_material(trc_scene scene, float share, float roughness) {
    struct node_list list = {0};
    const trc_node_input grey = node_color(0.5f, 0.5f, 0.5f), none = node_number(0.0f);
    const uint32_t matt = NODE_ADD(&list, TRC_NODE_DIFFUSE, 0, grey, none, node_standard());
    const uint32_t gloss =
        NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_GGX, grey, node_number(roughness), none,
                 none, node_standard(), node_standard());
    const uint32_t mix = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_number(share),
                                  node_link(matt, 0), node_link(gloss, 0));
    return level_material(scene, &list, mix, 0);
}

/* The mean of a floor below a net of wires of that size in the sun. */
static double floor_mean(float share, float roughness, float size, uint32_t flags) {
    const trc_scene scene = fixture_level_view();
    trc_light_desc sun = default_light_desc();
    trc_id id = 0;
    float pixels[4 * LEVEL_PIXELS];
    double sum = 0.0;
    sun.type = TRC_LIGHT_SUN;
    sun.strength = (float)PI;
    assert_ok(trc_light_create(scene, &sun, &id));
    fixture_level(scene, 20.0f, 0.0f, floor_material(scene, share, roughness));
    add_net(scene, net_material(scene, size, flags));
    assert_ok(trc_scene_commit(scene));
    trc_render_desc desc = level_desc(SAMPLES);
    desc.filter_width = 1.0f;
    render(scene, &desc, pixels);
    for (int i = 0; i < LEVEL_PIXELS; i++)
        sum += (double)pixels[4 * i] / LEVEL_PIXELS;
    assert_ok(trc_scene_destroy(scene));
    return sum;
}

/* What is farther than half a wire from the edges of a triangle is one around the same middle. */
static double lit_share(double width) {
    const double inradius = CELL * (1.0 - sqrt(0.5)), side = 1.0 - 0.5 * width / inradius;
    return side * side;
}

static void expect_shadow(float share, float roughness, uint32_t flags, double spread) {
    const double open = floor_mean(share, roughness, 0.0f, flags);
    const double found = floor_mean(share, roughness, WIRE, flags) / open;
    const double want = lit_share(WIRE * (PIXEL + HEIGHT * spread));
    print_message("gloss %.2f of roughness %.2f: %.4f, %.4f\n", (double)share, (double)roughness,
                  found, want);
    if (!(fabs(found - want) <= 5e-3))
        fail_msg("%.4f lit, not %.4f", found, want);
}

static void rays_are_a_pixel_apart(void **state) {
    (void)state;
    expect_shadow(0.0f, 0.7f, 0, 0.0);
    expect_shadow(1.0f, 0.7f, 0, 0.0);
}

/* By the root of the mean square alpha, 1 of what is matt, by what each brings. */
static void wide_ones_are_as_far_apart_as_what_is_lit_is_rough(void **state) {
    (void)state;
    static const float roughness[] = {0.3f, 0.7f, 1.0f};
    const double matt = floor_mean(0.0f, 0.7f, 0.0f, 0);
    expect_shadow(0.0f, 0.7f, TRC_MATERIAL_WIDE_SHADOWS, 1.0);
    for (int i = 0; i < 3; i++) {
        const double alpha = (double)roughness[i] * (double)roughness[i];
        const double gloss = floor_mean(1.0f, roughness[i], 0.0f, 0);
        expect_shadow(1.0f, roughness[i], TRC_MATERIAL_WIDE_SHADOWS, alpha);
        expect_shadow(0.5f, roughness[i], TRC_MATERIAL_WIDE_SHADOWS,
                      sqrt((matt + gloss * alpha * alpha) / (matt + gloss)));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rays_are_a_pixel_apart),
        cmocka_unit_test(wide_ones_are_as_far_apart_as_what_is_lit_is_rough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
