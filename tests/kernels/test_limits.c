/* Where rays end: the camera's clipping, the limits of bounces, switches of the world, and what is
 * reported of light that is no number; pictures beside what they are known to show. */
#include "level_test.h"

#define LIGHT 0.7f

/* Every pixel of a pass shows that in its first channel. */
static void expect_all(trc_scene scene, const trc_render_desc *desc, uint32_t pass, double want,
                       double allowed) {
    static float pixels[4 * LEVEL_PIXELS];
    const uint32_t channels = trc_pass_channels(pass);
    fixture_draw(scene, desc, pass, pixels, (uint64_t)channels * LEVEL_PIXELS);
    for (uint32_t p = 0; p < LEVEL_PIXELS; p++)
        if (!(fabs((double)pixels[channels * p] - want) <= allowed))
            fail_msg("pixel %u is %.6f, not %.6f", p, (double)pixels[channels * p], want);
}

static trc_id emission(trc_scene scene) {
    return fixture_material(scene, TRC_NODE_EMISSION, LIGHT);
}

/* Clear panes above each other, the first at z. */
static void add_panes(trc_scene scene, uint32_t count, float z) {
    const trc_id glass = fixture_clear(scene);
    for (uint32_t k = 0; k < count; k++)
        fixture_level(scene, 20.0f, z + 0.25f * (float)k, glass);
}

/* ---- the camera's clipping ---- */

/* Of a wide view down from 6 m: what is less deep than the clip's start is not there, in the
 * corners as in the middle, though it is farther away than that. */
static void clipping_begins_at_a_depth(void **state) {
    (void)state;
    static const float window[4] = {-2.0f, 2.0f, -2.0f, 2.0f};
    enum { SIZE = 8 };
    for (int is_clipped = 0; is_clipped < 2; is_clipped++) {
        const trc_scene scene = scene_create();
        trc_camera_desc camera = camera_desc(window);
        camera.clip_start = 3.0f;
        fixture_level(scene, 100.0f, is_clipped ? 3.1f : 2.9f,
                      fixture_material(scene, TRC_NODE_EMISSION, 0.25f));
        fixture_level(scene, 100.0f, 0.0f, emission(scene));
        set_camera(scene, &camera);
        const trc_render_desc desc = render_desc(SIZE, 4);
        float pixels[4 * SIZE * SIZE];
        render(scene, &desc, pixels);
        for (int p = 0; p < SIZE * SIZE; p++)
            assert_float_equal(pixels[4 * p], is_clipped ? LIGHT : 0.25f, 1e-6f);
        assert_ok(trc_scene_destroy(scene));
    }
}

/* Whether straight ahead or through panes. */
static void clipping_ends_behind_panes_too(void **state) {
    (void)state;
    for (uint32_t panes = 0; panes < 3; panes++)
        for (int is_clipped = 0; is_clipped < 2; is_clipped++) {
            const trc_scene scene = fixture_level_view();
            static const float transform[12] = {1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, 1};
            static const float window[4] = {-2.0f, 2.0f, -0.5f, 0.5f};
            trc_camera_desc camera = default_camera_desc();
            camera.type = TRC_CAMERA_ORTHOGRAPHIC;
            camera.transforms = transform;
            camera.windows = window;
            camera.clip_end = is_clipped ? 2.9f : 3.1f;
            add_panes(scene, panes, 0.0f);
            fixture_level(scene, 10.0f, -2.0f, emission(scene));
            set_camera(scene, &camera);
            const trc_render_desc desc = level_desc(4);
            expect_all(scene, &desc, TRC_PASS_COMBINED, is_clipped ? 0.0 : (double)LIGHT, 1e-6);
            assert_ok(trc_scene_destroy(scene));
        }
}

/* ---- limits of bounces ---- */

/* A mirror below the camera sends its rays to the left, a second one there sends them up, to a
 * light behind panes. */
static trc_scene two_mirrors(uint32_t panes) {
    static const float first[12] = {-0.5f, -5, -5.0f, 4.5f,  -5, 0.0f,
                                    4.5f,  5,  0.0f,  -0.5f, 5,  -5.0f};
    static const float second[12] = {-11, -5, 1.0f, -4, -5, -6.0f, -4, 5, -6.0f, -11, 5, 1.0f};
    static const float light[12] = {-20, -5, 9, -2, -5, 9, -2, 5, 9, -20, 5, 9};
    const trc_scene scene = fixture_level_view();
    const trc_id mirror = fixture_glossy(scene, 1.0f, 0.0f);
    fixture_quad(scene, first, mirror);
    fixture_quad(scene, second, mirror);
    fixture_quad(scene, light, emission(scene));
    add_panes(scene, panes, 4.0f);
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* As in Cycles a ray that bounced more often than it may still finds the light that it meets next.
 * So one mirror more than the limit shows a light, two do not. */
static void glossy_bounces_are_limited(void **state) {
    (void)state;
    const trc_scene scene = two_mirrors(0);
    trc_render_desc desc = level_desc(4);
    desc.max_depth = 8;
    desc.max_glossy_depth = 1;
    expect_all(scene, &desc, TRC_PASS_COMBINED, (double)LIGHT, 1e-5);
    desc.max_glossy_depth = 0;
    expect_all(scene, &desc, TRC_PASS_COMBINED, 0.0, 0.0);
    desc.max_glossy_depth = 8;
    desc.max_transmission_depth = 0;
    expect_all(scene, &desc, TRC_PASS_COMBINED, (double)LIGHT, 1e-5);
    assert_ok(trc_scene_destroy(scene));
}

/* Panes that the last ray of a path passes are as many as a camera ray passes. */
static void panes_are_limited(void **state) {
    (void)state;
    trc_render_desc desc = level_desc(4);
    desc.max_transparent_depth = 2;
    for (uint32_t panes = 2; panes < 5; panes++) {
        const double want = panes <= desc.max_transparent_depth + 1 ? (double)LIGHT : 0.0;
        const trc_scene ahead = fixture_level_view();
        add_panes(ahead, panes, -1.0f);
        fixture_level(ahead, 20.0f, -2.0f, emission(ahead));
        assert_ok(trc_scene_commit(ahead));
        expect_all(ahead, &desc, TRC_PASS_COMBINED, want, 1e-5);
        assert_ok(trc_scene_destroy(ahead));
        const trc_scene last = two_mirrors(panes);
        desc.max_depth = 1;
        expect_all(last, &desc, TRC_PASS_COMBINED, want, 1e-5);
        assert_ok(trc_scene_destroy(last));
    }
}

/* Shadow rays pass as many panes as their limit says, or that of paths, less those that the camera
 * saw the surface through, as in Cycles 3.4 (measured there with up to three seen and four in the
 * way, at limits of 2 and 3). Panes below the camera are in the way of both. */
static void expect_shadows(uint32_t max_transparent_depth, uint32_t max_shadow_depth,
                           uint32_t limit) {
    trc_render_desc desc = level_desc(4);
    desc.max_transparent_depth = max_transparent_depth;
    desc.max_shadow_depth = max_shadow_depth;
    for (uint32_t seen = 0; seen < 3; seen++)
        for (uint32_t above = 0; above < 5; above++) {
            const trc_scene scene = fixture_level_view();
            trc_light_desc light = default_light_desc();
            trc_id id = 0;
            light.type = TRC_LIGHT_SUN;
            light.strength = (float)PI;
            light.use_mis = 0;
            assert_ok(trc_light_create(scene, &light, &id));
            fixture_level(scene, 20.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
            add_panes(scene, seen, 0.2f);
            add_panes(scene, above, 2.0f);
            assert_ok(trc_scene_commit(scene));
            const double want = 2 * seen + above <= limit ? 0.5 : 0.0;
            expect_all(scene, &desc, TRC_PASS_COMBINED, want, 1e-4);
            assert_ok(trc_scene_destroy(scene));
        }
}

static void panes_in_shadows_are_limited(void **state) {
    (void)state;
    expect_shadows(3, UINT32_MAX, 3);
    expect_shadows(2, 3, 3);
    expect_shadows(3, 2, 2);
}

/* Triangles of slots that an instance has no material for have its last one, for shadow rays too.
 */
static void slots_beyond_the_materials_have_the_last(void **state) {
    (void)state;
    for (int is_clear = 0; is_clear < 2; is_clear++) {
        static const float corners[12] = {-9, -9, 3, 9, -9, 3, 9, 9, 3, -9, 9, 3};
        static const uint16_t slots[2] = {1, 7};
        const trc_scene scene = fixture_level_view();
        trc_light_desc light = default_light_desc();
        trc_id id = 0;
        light.type = TRC_LIGHT_SUN;
        light.strength = (float)PI;
        assert_ok(trc_light_create(scene, &light, &id));
        fixture_level(scene, 20.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
        trc_mesh_desc desc = fixture_quad_desc(corners);
        desc.material_index = slots;
        assert_ok(trc_mesh_create(scene, &desc, &id));
        const trc_id matt = fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f);
        const trc_id clear = fixture_clear(scene);
        const trc_id materials[2] = {is_clear ? matt : clear, is_clear ? clear : matt};
        trc_instance_desc instance = default_instance_desc(id);
        instance.materials = materials;
        instance.material_count = 2;
        assert_ok(trc_instance_create(scene, &instance, &id));
        assert_ok(trc_scene_commit(scene));
        const trc_render_desc render = level_desc(4);
        expect_all(scene, &render, TRC_PASS_COMBINED, is_clear ? 0.5 : 0.0, 1e-5);
        assert_ok(trc_scene_destroy(scene));
    }
}

/* ---- what is seen of world and lights ---- */

static void a_world_can_hide_from_the_camera(void **state) {
    (void)state;
    for (int is_hidden = 0; is_hidden < 2; is_hidden++)
        for (int is_mirrored = 0; is_mirrored < 2; is_mirrored++) {
            const trc_scene scene = fixture_level_view();
            trc_world_desc world =
                default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, LIGHT));
            if (is_hidden)
                world.visibility &= ~(uint32_t)TRC_VISIBLE_CAMERA;
            assert_ok(trc_scene_set_world(scene, &world));
            if (is_mirrored)
                fixture_level(scene, 20.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.0f));
            assert_ok(trc_scene_commit(scene));
            const trc_render_desc desc = level_desc(4);
            const double want = is_hidden && !is_mirrored ? 0.0 : (double)LIGHT;
            expect_all(scene, &desc, TRC_PASS_COMBINED, want, 1e-6);
            assert_ok(trc_scene_destroy(scene));
        }
}

/* The exposure of light is that of its groups. */
static void groups_are_exposed(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    trc_world_desc world = default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, LIGHT));
    world.light_group = 1;
    assert_ok(trc_scene_set_world(scene, &world));
    assert_ok(trc_scene_commit(scene));
    trc_render_desc desc = level_desc(4);
    desc.light_group_count = 1;
    for (int k = 0; k < 3; k++) {
        desc.film_exposure = (float)(1 << k);
        expect_all(scene, &desc, TRC_PASS_LIGHT_GROUP(0), (double)LIGHT * (1 << k), 1e-5);
        expect_all(scene, &desc, TRC_PASS_COMBINED, (double)LIGHT * (1 << k), 1e-5);
    }
    assert_ok(trc_scene_destroy(scene));
}

/* ---- what is no number ---- */

/* Beyond floats, by an object's colour. */
static uint32_t add_infinite(struct node_list *list) {
    const uint32_t info = node_add(list, TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    const uint32_t huge =
        NODE_ADD(list, TRC_NODE_VECTOR_MATH, TRC_VECTOR_MULTIPLY, node_link(info, 1),
                 node_color(3e38f, 3e38f, 3e38f), node_number(0.0f), node_number(1.0f));
    return NODE_ADD(list, TRC_NODE_VECTOR_MATH, TRC_VECTOR_MULTIPLY, node_link(huge, 0),
                    node_color(3e38f, 3e38f, 3e38f), node_number(0.0f), node_number(1.0f));
}

/* Emission, and AOVs: 0 infinite or 2, 1 of 3. */
static trc_id add_part(trc_scene scene, float light, bool is_infinite, bool has_infinite_aov) {
    struct node_list list = {0};
    const uint32_t infinite = add_infinite(&list);
    const trc_node_input none = node_link(infinite, 0);
    const uint32_t surface =
        NODE_ADD(&list, TRC_NODE_EMISSION, 0, is_infinite ? none : node_color(light, light, light),
                 node_number(1.0f));
    NODE_ADD(&list, TRC_NODE_AOV_COLOR, 0, has_infinite_aov ? none : node_color(2.0f, 2.0f, 2.0f));
    NODE_ADD(&list, TRC_NODE_AOV_COLOR, 1, node_color(3.0f, 3.0f, 3.0f));
    return level_material(scene, &list, surface, 0);
}

/* A ground, and in front of a part of it, which ends within a pixel, something else. Counts of
 * samples end within vectors, and with halves of a pixel's samples. */
#define EDGE_COLUMN 4
#define EDGE_SAMPLES 37
static trc_scene parts_create(float light, bool is_infinite, bool has_infinite_aov,
                              trc_render_desc *desc_out) {
    const trc_scene scene = fixture_level_view();
    const float left[12] = {-9, -9, 0.5f, 1.1f, -9, 0.5f, 1.1f, 9, 0.5f, -9, 9, 0.5f};
    fixture_quad(scene, left, add_part(scene, light, is_infinite, has_infinite_aov));
    fixture_level(scene, 20.0f, 0.0f, add_part(scene, LIGHT, false, false));
    assert_ok(trc_scene_commit(scene));
    trc_render_desc desc = level_desc(EDGE_SAMPLES);
    desc.filter_width = 1.0f;
    desc.passes = UINT64_C(1) << TRC_PASS_SAMPLE_COUNT | UINT64_C(1) << TRC_PASS_EMISSION;
    desc.aov_color_count = 2;
    desc.denoise = TRC_DENOISE_PREVIEW; /* keeps sums of halves */
    *desc_out = desc;
    return scene;
}

/* What the other samples of the pixel have stays whole: as many as show the ground where what is
 * in front of it is black. */
static void samples_without_a_number_take_no_others(void **state) {
    (void)state;
    trc_render_desc desc;
    float seen[4 * LEVEL_PIXELS];
    const trc_scene black = parts_create(0.0f, false, false, &desc);
    fixture_draw(black, &desc, TRC_PASS_COMBINED, seen, 4 * LEVEL_PIXELS);
    assert_ok(trc_scene_destroy(black));
    const trc_scene scene = parts_create(1.0f, true, false, &desc);
    trc_render render_id = 0;
    trc_render_progress progress = {.struct_size = sizeof progress};
    float light[4 * LEVEL_PIXELS], emission[3 * LEVEL_PIXELS], aov[4 * LEVEL_PIXELS];
    float counts[LEVEL_PIXELS];
    double counted = 0.0;
    assert_ok(trc_render_start(scene, &desc, &render_id));
    assert_ok(trc_render_wait(render_id, INFINITY));
    assert_ok(trc_render_read(render_id, TRC_PASS_COMBINED, light, 4 * LEVEL_PIXELS));
    assert_ok(trc_render_read(render_id, TRC_PASS_EMISSION, emission, 3 * LEVEL_PIXELS));
    assert_ok(trc_render_read(render_id, TRC_PASS_AOV_COLOR(1), aov, 4 * LEVEL_PIXELS));
    assert_ok(trc_render_read(render_id, TRC_PASS_SAMPLE_COUNT, counts, LEVEL_PIXELS));
    assert_ok(trc_render_poll(render_id, &progress));
    assert_ok(trc_render_destroy(render_id));
    for (int p = 0; p < LEVEL_PIXELS; p++) {
        const int column = p % LEVEL_WIDTH;
        counted += (double)counts[p];
        assert_float_equal(counts[p], seen[4 * p] / LIGHT * EDGE_SAMPLES, 1e-3f);
        if (column == EDGE_COLUMN)
            assert_in_range(counts[p], 1, EDGE_SAMPLES - 1);
        if (column < EDGE_COLUMN)
            continue;
        assert_float_equal(light[4 * p], LIGHT, 1e-6f);
        assert_float_equal(emission[3 * p], LIGHT, 1e-6f);
        assert_float_equal(aov[4 * p], 3.0f, 1e-6f);
    }
    assert_float_equal(counted + (double)progress.dropped_samples, LEVEL_PIXELS * EDGE_SAMPLES,
                       0.0);
    assert_ok(trc_scene_destroy(scene));
}

/* Values of a pass that are no number count as 0, those of other passes as they are. */
static void passes_without_a_number_take_no_others(void **state) {
    (void)state;
    trc_render_desc desc;
    const trc_scene scene = parts_create(0.0f, false, true, &desc);
    float light[4 * LEVEL_PIXELS], aov[2][4 * LEVEL_PIXELS];
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, light, 4 * LEVEL_PIXELS);
    for (uint32_t k = 0; k < 2; k++)
        fixture_draw(scene, &desc, TRC_PASS_AOV_COLOR(k), aov[k], 4 * LEVEL_PIXELS);
    for (int p = 0; p < LEVEL_PIXELS; p++) {
        const float part = light[4 * p] / LIGHT;
        if (p % LEVEL_WIDTH == EDGE_COLUMN)
            assert_true(part > 0.0f && part < 1.0f);
        assert_float_equal(aov[0][4 * p], 2.0f * part, 1e-6f);
        assert_float_equal(aov[1][4 * p], 3.0f, 1e-6f);
    }
    assert_ok(trc_scene_destroy(scene));
}

/* Light that is no number is left out of the film, and its samples are counted. */
static void samples_without_a_number_are_reported(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    struct node_list list = {0};
    const uint32_t light =
        NODE_ADD(&list, TRC_NODE_EMISSION, 0, node_link(add_infinite(&list), 0), node_number(1.0f));
    fixture_level(scene, 20.0f, 0.0f, level_material(scene, &list, light, 0));
    assert_ok(trc_scene_commit(scene));
    const trc_render_desc desc = level_desc(4);
    trc_render_progress progress = {.struct_size = sizeof progress};
    trc_render render_id = 0;
    float pixels[4 * LEVEL_PIXELS];
    assert_ok(trc_render_start(scene, &desc, &render_id));
    assert_ok(trc_render_wait(render_id, INFINITY));
    assert_ok(trc_render_read(render_id, TRC_PASS_COMBINED, pixels, 4 * LEVEL_PIXELS));
    assert_ok(trc_render_poll(render_id, &progress));
    assert_ok(trc_render_destroy(render_id));
    assert_int_equal(progress.dropped_samples, (uint64_t)LEVEL_PIXELS * desc.sample_count);
    for (int i = 0; i < 4 * LEVEL_PIXELS; i++)
        assert_true(isfinite(pixels[i]));
    assert_ok(trc_scene_destroy(scene));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clipping_begins_at_a_depth),
        cmocka_unit_test(clipping_ends_behind_panes_too),
        cmocka_unit_test(glossy_bounces_are_limited),
        cmocka_unit_test(panes_are_limited),
        cmocka_unit_test(panes_in_shadows_are_limited),
        cmocka_unit_test(slots_beyond_the_materials_have_the_last),
        cmocka_unit_test(a_world_can_hide_from_the_camera),
        cmocka_unit_test(groups_are_exposed),
        cmocka_unit_test(samples_without_a_number_are_reported),
        cmocka_unit_test(samples_without_a_number_take_no_others),
        cmocka_unit_test(passes_without_a_number_take_no_others),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("limits", tests, NULL, NULL);
}
