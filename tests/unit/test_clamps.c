/* Clamps: of what, to what, and that passes still add up. Pictures of even light, whose values are
 * known. */
#include <stdbool.h>

#include "fixture.h"

enum { SIZE = 16, FRAME = SIZE * SIZE };

/* Of the light that a sun of strength 1 gives to a Lambert surface of albedo .5. */
#define LIT (0.5f / 3.14159265f)

static trc_id add_sun(trc_scene scene, float strength, uint32_t group) {
    trc_light_desc sun = default_light_desc();
    trc_id id = 0;
    sun.type = TRC_LIGHT_SUN;
    sun.size_x = sun.size_y = 0.0f;
    sun.strength = strength;
    sun.light_group = group;
    assert_int_equal(trc_light_create(scene, &sun, &id), TRC_OK);
    return id;
}

static trc_render_desc clamped_desc(float direct, float indirect) {
    trc_render_desc desc = default_render_desc(SIZE, SIZE, 4);
    desc.clamp_direct = direct;
    desc.clamp_indirect = indirect;
    return desc;
}

/* The mean of a pass; every pixel has it. */
static float even_value(trc_scene scene, const trc_render_desc *desc, uint32_t pass) {
    static float pixels[4 * FRAME];
    const uint32_t channels = trc_pass_channels(pass);
    fixture_draw(scene, desc, pass, pixels, channels * FRAME);
    for (uint32_t i = 1; i < FRAME; i++)
        if (fabsf(pixels[i * channels] - pixels[0]) > 1e-4f * fabsf(pixels[0]))
            fail_msg("pass %u: pixel %u has %g, the first %g", pass, i,
                     (double)pixels[i * channels], (double)pixels[0]);
    return pixels[0];
}

static void expect(float value, float expected) {
    if (fabsf(value - expected) > 1e-4f * fabsf(expected) + 1e-6f)
        fail_msg("%g, not %g", (double)value, (double)expected);
}

/* Light samples share the limit of their hit, so that their number has no influence. */
static void lamp_light(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    add_sun(scene, 20.0f, 0);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    for (uint32_t light_samples = 1; light_samples <= 16; light_samples *= 4) {
        trc_render_desc desc = clamped_desc(0.0f, 1.0f);
        desc.light_samples = light_samples;
        expect(even_value(scene, &desc, TRC_PASS_COMBINED), 20.0f * LIT);
        desc.clamp_direct = 1.0f;
        expect(even_value(scene, &desc, TRC_PASS_COMBINED), 1.0f);
        desc.clamp_direct = 4.0f;
        expect(even_value(scene, &desc, TRC_PASS_COMBINED), 20.0f * LIT);
        desc.clamp_direct = 0.25f;
        desc.passes = UINT64_C(1) << TRC_PASS_DIFFUSE_DIRECT | UINT64_C(1) << TRC_PASS_SHADOW;
        expect(even_value(scene, &desc, TRC_PASS_DIFFUSE_DIRECT), 0.25f / 0.5f);
        expect(even_value(scene, &desc, TRC_PASS_SHADOW), 1.0f);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* What transparent surfaces take from light is taken before the clamp. */
static void light_through_a_veil(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    struct default_material m;
    trc_id veil = 0;
    default_material_init(&m, TRC_NODE_TRANSPARENT);
    m.node.input_count = m.desc.input_count = 1;
    for (int c = 0; c < 3; c++)
        m.inputs[0].value[c] = 0.1f;
    m.desc.flags |= TRC_MATERIAL_TRANSPARENT_SHADOW;
    assert_int_equal(trc_material_create(scene, &m.desc, &veil), TRC_OK);
    fixture_level(scene, 100.0f, 3.0f, veil); /* behind the camera */
    add_sun(scene, 20.0f, 0);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const trc_render_desc desc = clamped_desc(0.5f, 0.0f);
    expect(even_value(scene, &desc, TRC_PASS_COMBINED), 0.1f * 20.0f * LIT);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Lamps that a ray passes are clamped one by one, whether they are in groups or not. */
static void seen_lamps(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    for (int k = 0; k < 2; k++) {
        trc_light_desc lamp = default_light_desc();
        trc_id id = 0;
        lamp.size_x = lamp.size_y = 20.0f;
        lamp.strength = 4000.0f;
        lamp.light_group = 1;
        lamp.transform[0] = -1.0f, lamp.transform[10] = -1.0f; /* facing up */
        lamp.transform[11] = -1.0f - (float)k;
        assert_int_equal(trc_light_create(scene, &lamp, &id), TRC_OK);
    }
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    for (uint32_t groups = 0; groups <= 1; groups++) {
        trc_render_desc desc = clamped_desc(0.25f, 0.0f);
        desc.light_group_count = groups;
        expect(even_value(scene, &desc, TRC_PASS_COMBINED), 0.5f);
        if (groups)
            expect(even_value(scene, &desc, TRC_PASS_LIGHT_GROUP(0)), 0.5f);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* The pass of ambient occlusion is white at the limit of direct light; its light is clamped before
 * it takes the colour of the surface. */
static void ambient_occlusion(void **state) {
    (void)state;
    const trc_scene scene = fixture_level_view();
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    trc_world_desc world = default_world_desc(0);
    world.ao_factor = 1.0f;
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const float limits[] = {0.0f, 2.0f, 1.0f, 0.5f};
    for (int k = 0; k < 4; k++) {
        trc_render_desc desc = clamped_desc(limits[k], 0.0f);
        const float white = limits[k] == 0.5f ? 0.5f : 1.0f;
        desc.light_samples = 4;
        desc.passes = UINT64_C(1) << TRC_PASS_AMBIENT_OCCLUSION;
        expect(even_value(scene, &desc, TRC_PASS_AMBIENT_OCCLUSION), white);
        expect(even_value(scene, &desc, TRC_PASS_COMBINED), 0.5f * white);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* ---- sums ---- */

/* A floor, a rough and an ideal mirror, a glowing square, a lamp, a sun and a sky, all light in
 * groups. */
static trc_scene mixed_scene(void) {
    const trc_scene scene = fixture_level_view();
    const float half[3][2] = {{0.0f, 1.2f}, {1.2f, 2.4f}, {2.4f, 3.2f}};
    const trc_id materials[3] = {fixture_material(scene, TRC_NODE_DIFFUSE, 0.8f),
                                 fixture_glossy(scene, 0.7f, 0.4f),
                                 fixture_glossy(scene, 0.9f, 0.0f)};
    for (int k = 0; k < 3; k++) {
        const float l = half[k][0], r = half[k][1];
        const float corners[12] = {l, -1, 0, r, -1, 0, r, 1, 0, l, 1, 0};
        fixture_quad(scene, corners, materials[k]);
    }
    fixture_level(scene, 30.0f, 9.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.6f));
    trc_light_desc lamp = default_light_desc();
    lamp.light_group = 1;
    trc_id id = 0;
    assert_int_equal(trc_light_create(scene, &lamp, &id), TRC_OK);
    add_sun(scene, 9.0f, 2);
    trc_world_desc world = default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.7f));
    world.light_group = 3;
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

/* The largest difference of a sum and Combined, and how much of Combined the clamps have taken. */
static void sums(void **state) {
    (void)state;
    static float part[3 * FRAME], color[3 * FRAME], combined[4 * FRAME], free_light[4 * FRAME];
    static double by_kind[3 * FRAME], by_group[3 * FRAME];
    const trc_scene scene = mixed_scene();
    trc_render_desc desc = default_render_desc(SIZE, SIZE, 16);
    desc.passes = UINT64_C(0x3ff) << TRC_PASS_EMISSION | UINT64_C(0xff) << TRC_PASS_GLOSSY_COLOR;
    desc.light_group_count = 3;
    desc.light_samples = 2;
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, free_light, 4 * FRAME);
    desc.clamp_direct = 0.3f;
    desc.clamp_indirect = 0.1f;
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, combined, 4 * FRAME);
    memset(by_kind, 0, sizeof by_kind);
    memset(by_group, 0, sizeof by_group);
    for (uint32_t pass = TRC_PASS_EMISSION; pass <= TRC_PASS_TRANSMISSION_INDIRECT; pass++) {
        const bool is_color =
            pass > TRC_PASS_ENVIRONMENT && (pass - TRC_PASS_DIFFUSE_DIRECT) % 3 == 2;
        if (is_color)
            continue;
        fixture_draw(scene, &desc, pass, part, 3 * FRAME);
        if (pass > TRC_PASS_ENVIRONMENT)
            fixture_draw(scene, &desc, pass + 2 - (pass - TRC_PASS_DIFFUSE_DIRECT) % 3, color,
                         3 * FRAME);
        for (int i = 0; i < 3 * FRAME; i++)
            by_kind[i] += (double)part[i] * (pass > TRC_PASS_ENVIRONMENT ? (double)color[i] : 1.0);
    }
    for (uint32_t group = 0; group < 3; group++) {
        fixture_draw(scene, &desc, TRC_PASS_LIGHT_GROUP(group), part, 3 * FRAME);
        for (int i = 0; i < 3 * FRAME; i++)
            by_group[i] += (double)part[i];
    }
    double taken = 0.0, apart[2] = {0.0, 0.0};
    for (int i = 0; i < FRAME; i++)
        for (int c = 0; c < 3; c++) {
            const double whole = (double)combined[4 * i + c];
            taken = fmax(taken, (double)free_light[4 * i + c] - whole);
            apart[0] = fmax(apart[0], fabs(by_kind[3 * i + c] - whole));
            apart[1] = fmax(apart[1], fabs(by_group[3 * i + c] - whole));
        }
    if (taken < 0.5 || apart[0] > 1e-5 || apart[1] > 1e-5)
        fail_msg("clamps take up to %g; sums of kinds are up to %g apart, of groups %g", taken,
                 apart[0], apart[1]);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lamp_light), cmocka_unit_test(light_through_a_veil),
        cmocka_unit_test(seen_lamps), cmocka_unit_test(ambient_occlusion), cmocka_unit_test(sums)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
