/* Coarse meshes that are shaded smooth: light that grazes them is not lost on the flat triangles
 * that carry the normals. */
#include "figures.h"
#include "picture_test.h"

#define ALBEDO 0.5
enum { SIZE_PX = 64, LEVELS = 2 };

/* A ball of radius 1, which a sun lights from +x; seen from above. */
static trc_scene lit_ball(uint32_t is_smooth) {
    static const float window[4] = {-0.2f, 0.2f, -0.2f, 0.2f};
    static const float from_x[12] = {0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0};
    static const float axis[3] = {1, 2, 3}, scale[3] = {1, 1, 1};
    static const float center[3] = {0, 0, 0}, grey[3] = {ALBEDO, ALBEDO, ALBEDO};
    const trc_scene scene = scene_create();
    const trc_camera_desc camera = camera_desc(window);
    assert_ok(trc_scene_set_camera(scene, &camera));
    trc_light_desc sun = default_light_desc();
    trc_id id = 0;
    sun.type = TRC_LIGHT_SUN;
    sun.strength = (float)PI;
    memcpy(sun.transform, from_x, sizeof from_x);
    assert_ok(trc_light_create(scene, &sun, &id));
    struct mesh ball;
    float turned[12];
    mesh_init(&ball);
    mesh_add_icosphere(&ball, center, 1.0f, LEVELS);
    query_transform(axis, 0.4f, scale, center, turned); /* no edge along the sun */
    mesh_transform(&ball, 0, turned);
    uint8_t *smooth = malloc(ball.triangle_count);
    assert_non_null(smooth);
    memset(smooth, (int)is_smooth, ball.triangle_count);
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = ball.vertex_count;
    desc.triangle_count = ball.triangle_count;
    desc.positions = ball.positions;
    desc.position_count = 3 * (uint64_t)ball.vertex_count;
    desc.indices = ball.indices;
    desc.index_count = 3 * (uint64_t)ball.triangle_count;
    desc.smooth = smooth;
    fixture_mesh(scene, &desc, add_material(scene, TRC_NODE_DIFFUSE, grey, 0.0f), 0);
    free(smooth);
    mesh_free(&ball);
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* Pixels whose normal on the true ball has a cosine to the sun between two numbers: how many, and
 * how many of them are black. */
struct band {
    uint32_t count, black;
    double least, most; /* of what is found over what the true ball has */
};

static struct band look(trc_scene scene, double low, double high) {
    static float pixels[4 * SIZE_PX * SIZE_PX];
    struct band band = {.least = INFINITY};
    trc_render_desc desc = render_desc(SIZE_PX, 1);
    render(scene, &desc, pixels);
    for (int p = 0; p < SIZE_PX * SIZE_PX; p++) {
        /* Where the ray from (0, 0, h) meets the ball. */
        const double u = ((p % SIZE_PX + 0.5) / SIZE_PX - 0.5) * 0.4;
        const double v = ((p / SIZE_PX + 0.5) / SIZE_PX - 0.5) * 0.4;
        const double h = (double)CAMERA_HEIGHT, a = 1.0 + u * u + v * v;
        const double root = h * h - a * (h * h - 1.0);
        if (root < 0.1)
            continue; /* beyond it, or where the mesh's own rim is near */
        const double cosine = (h - sqrt(root)) / a * u;
        if (cosine < low || cosine > high)
            continue;
        const double ratio = (double)pixels[4 * p] / (ALBEDO * cosine);
        band.count++;
        band.black += pixels[4 * p] == 0.0f;
        band.least = fmin(band.least, ratio);
        band.most = fmax(band.most, ratio);
    }
    return band;
}

/* Of flat shading the triangles that face away are black; of smooth shading none, as far as the
 * normals of the mesh follow the ball's. */
static void grazing_light_reaches_smooth_surfaces(void **state) {
    (void)state;
    const trc_scene flat = lit_ball(0), smooth = lit_ball(1);
    const struct band without = look(flat, 0.03, 0.15), with = look(smooth, 0.03, 0.15);
    print_figure("smooth balls in grazing light", "%u of %u pixels black, %u flat; %.2f to %.2f",
                 with.black, with.count, without.black, with.least, with.most);
    assert_true(without.black > without.count / 20);
    assert_true(with.count > 100);
    assert_int_equal(with.black, 0);
    const struct band bright = look(smooth, 0.3, 0.9);
    assert_true(bright.least > 0.95 && bright.most < 1.05);
    assert_ok(trc_scene_destroy(flat));
    assert_ok(trc_scene_destroy(smooth));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(grazing_light_reaches_smooth_surfaces)};
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("smooth", tests, NULL, NULL);
}
