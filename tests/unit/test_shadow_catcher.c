/* Shadow catchers against closed forms: the light they lose, by channel and by coverage, in every
 * kind of picture. */
#include "fixture.h"

#include <stdio.h>

enum { WIDTH = 16, HEIGHT = 4, FRAME = WIDTH * HEIGHT, SAMPLES = 1024 };

#define CATCHER TRC_INSTANCE_SHADOW_CATCHER
#define SHADOWS TRC_PASS_SHADOW_CATCHER

static trc_render_desc desc_of(uint32_t samples) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1.0f;
    desc.film_transparent = 1;
    return desc;
}

static void draw(trc_scene scene, const trc_render_desc *desc, uint32_t pass, float *pixels) {
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    fixture_draw(scene, desc, pass, pixels, (uint64_t)trc_pass_channels(pass) * FRAME);
}

/* A part of the level z, all that the camera sees of y. */
static void add_strip(trc_scene scene, float from, float to, float z, trc_id material,
                      uint32_t flags) {
    const float corners[12] = {from, -9, z, to, -9, z, to, 9, z, from, 9, z};
    fixture_flagged_quad(scene, corners, material, flags);
}

static void add_sun(trc_scene scene, float red, float green, float blue, uint32_t cast_shadow,
                    uint32_t flags) {
    trc_id id = 0;
    trc_light_desc desc = default_light_desc();
    desc.type = TRC_LIGHT_SUN;
    desc.strength = 1.0f;
    desc.color[0] = red;
    desc.color[1] = green;
    desc.color[2] = blue;
    desc.cast_shadow = cast_shadow;
    desc.flags = flags;
    assert_int_equal(trc_light_create(scene, &desc, &id), TRC_OK);
}

static void set_world(trc_scene scene, float value, uint32_t visibility) {
    trc_world_desc world = default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, value));
    world.visibility = visibility;
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
}

/* A channel's mean over a column of pixels. */
static double column_mean(const float *pixels, int channels, int channel, int x) {
    double sum = 0.0;
    for (int y = 0; y < HEIGHT; y++)
        sum += (double)pixels[channels * (y * WIDTH + x) + channel];
    return sum / HEIGHT;
}

static void expect(const float *pixels, int x, const double value[4], double tolerance) {
    for (int c = 0; c < 4; c++) {
        const double found = column_mean(pixels, 4, c, x);
        if (fabs(found - value[c]) > tolerance)
            fail_msg("column %d channel %d: %.5f, not %.5f", x, c, found, value[c]);
    }
}

static void expect_clear(const float *pixels) {
    for (int i = 0; i < 4 * FRAME; i++)
        assert_true(pixels[i] == 0.0f);
}

/* Both halves have the same random numbers: without blockers nothing is left of the noise of area
 * light, world and rough reflection. */
static void lit(void **state) {
    (void)state;
    static float pixels[4 * FRAME], shadows[3 * FRAME];
    const trc_scene scene = fixture_level_view();
    const trc_light_desc area = default_light_desc();
    trc_id light = 0;
    add_strip(scene, -9, 9, 0, fixture_glossy(scene, 0.8f, 0.4f), CATCHER);
    add_strip(scene, 1, 2, 0.3f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f), CATCHER);
    assert_int_equal(trc_light_create(scene, &area, &light), TRC_OK);
    set_world(scene, 0.5f, TRC_VISIBLE_ALL);
    for (uint32_t integrator = 0; integrator <= TRC_INTEGRATOR_DISTRIBUTION; integrator++)
        for (uint32_t lights = 1; lights <= 64; lights *= 64) {
            trc_render_desc desc = desc_of(16);
            desc.integrator = integrator;
            desc.light_samples = lights;
            draw(scene, &desc, TRC_PASS_COMBINED, pixels);
            expect_clear(pixels);
            desc.passes = UINT64_C(1) << SHADOWS;
            draw(scene, &desc, SHADOWS, shadows);
            for (int i = 0; i < 3 * FRAME; i++)
                assert_true(shadows[i] == 1.0f);
        }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A wall of height h along the edge x = 0 of a floor under an even sky: at x it hides half of 1 - x
 * / sqrt(x^2 + h^2) of the light. A wall that is a catcher itself hides nothing. */
static void wall(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    const float corners[12] = {0, -40, 0, 0, 40, 0, 0, 40, 3, 0, -40, 3};
    for (uint32_t flags = 0; flags <= CATCHER; flags++) {
        const trc_scene scene = fixture_level_view();
        const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f);
        add_strip(scene, -40, 40, 0, grey, CATCHER);
        fixture_flagged_quad(scene, corners, grey, flags);
        set_world(scene, 0.7f, TRC_VISIBLE_ALL);
        const trc_render_desc desc = desc_of(SAMPLES);
        draw(scene, &desc, TRC_PASS_COMBINED, pixels);
        double most = 0.0;
        for (int x = 0; x < WIDTH; x++) {
            const double left = 4.0 * x / WIDTH, right = 4.0 * (x + 1) / WIDTH;
            const double slope = (hypot(right, 3.0) - hypot(left, 3.0)) / (right - left);
            const double hidden = flags ? 0.0 : 0.5 * (1.0 - slope);
            most = fmax(most, fabs(column_mean(pixels, 4, 3, x) - hidden));
        }
        printf("wall: at most %.2e off\n", most);
        assert_true(most < (flags ? 1e-12 : 6e-3));
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

/* A roof above the camera takes a yellow sun from the floor and leaves it a cyan one, which casts
 * no shadow: red is gone, green halved, blue is there. A sun, and an emitter, that are not of the
 * footage do not count, and the light of a third passes by. */
static void colors(void **state) {
    (void)state;
    static float pixels[4 * FRAME], shadows[3 * FRAME];
    const trc_scene scene = fixture_level_view();
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f);
    add_strip(scene, -9, 9, 0, grey, CATCHER);
    add_strip(scene, -9, 9, 2, grey, 0);
    add_sun(scene, 1, 1, 0, 1, 0);
    add_sun(scene, 0, 1, 1, 0, 0);
    add_sun(scene, 5, 5, 5, 1, TRC_LIGHT_SYNTHETIC);
    trc_render_desc desc = desc_of(4 * SAMPLES);
    draw(scene, &desc, TRC_PASS_COMBINED, pixels);
    desc.passes = UINT64_C(1) << SHADOWS;
    draw(scene, &desc, SHADOWS, shadows);
    for (int x = 0; x < WIDTH; x++) {
        const double green = column_mean(shadows, 3, 1, x);
        expect(pixels, x, (double[4]){0, 0, 0, 1.0 - (1.0 + green) / 3.0}, 1e-5);
        assert_true(column_mean(shadows, 3, 0, x) == 0.0 && column_mean(shadows, 3, 2, x) == 1.0);
        assert_true(fabs(green - 0.5) < 0.02);
    }
    /* What adds light takes no light: there is no shadow to fill. */
    add_sun(scene, 5, 5, 5, 0, TRC_LIGHT_SYNTHETIC);
    desc.passes = 0;
    draw(scene, &desc, TRC_PASS_COMBINED, pixels);
    expect_clear(pixels);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* One pixel has a black object (0.2 of it), a catcher of which half the light is gone (0.4), and
 * the world (0.4): each counts by its own part. */
static void coverage(void **state) {
    (void)state;
    static float pixels[4 * FRAME], shadows[3 * FRAME], environment[3 * FRAME];
    const int edge = 8;
    const trc_scene scene = fixture_level_view();
    const trc_id black = fixture_material(scene, TRC_NODE_DIFFUSE, 0.0f);
    add_strip(scene, 1, 2.05f, 0.5f, black, 0);
    add_strip(scene, -9, 2.15f, 0, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f), CATCHER);
    add_strip(scene, -9, 9, 2, black, 0);
    add_sun(scene, 1, 1, 1, 1, 0);
    add_sun(scene, 1, 1, 1, 0, 0);
    set_world(scene, 0.25f, TRC_VISIBLE_CAMERA);
    trc_render_desc desc = desc_of(4 * SAMPLES);
    draw(scene, &desc, TRC_PASS_COMBINED, pixels);
    expect(pixels, 2, (double[4]){0, 0, 0, 0.5}, 0.02);
    expect(pixels, 6, (double[4]){0, 0, 0, 1.0}, 1e-6);
    expect(pixels, edge, (double[4]){0, 0, 0, 0.2 + 0.4 * 0.5}, 0.02);
    expect(pixels, 12, (double[4]){0, 0, 0, 0.0}, 1e-6);
    desc.film_transparent = 0;
    desc.passes = UINT64_C(1) << TRC_PASS_ENVIRONMENT;
    desc.film_exposure = 2.0f;
    draw(scene, &desc, TRC_PASS_COMBINED, pixels);
    const double behind = 2.0 * 0.25 * 0.5, mixed = 2.0 * 0.25 * (0.4 + 0.4 * 0.5);
    expect(pixels, 2, (double[4]){behind, behind, behind, 1}, 0.02);
    expect(pixels, edge, (double[4]){mixed, mixed, mixed, 1}, 0.02);
    draw(scene, &desc, TRC_PASS_ENVIRONMENT, environment);
    assert_true(fabs(column_mean(environment, 3, 1, 2) - 2.0 * 0.25) < 1e-5);
    assert_true(fabs(column_mean(environment, 3, 1, edge) - 2.0 * 0.25 * 0.8) < 0.01);
    /* The pass tells what is done to the footage, so Combined has the objects alone. */
    desc.film_transparent = 1;
    desc.passes = UINT64_C(1) << SHADOWS;
    draw(scene, &desc, SHADOWS, shadows);
    assert_true(fabs(column_mean(shadows, 3, 1, 2) - 0.5) < 0.02);
    assert_true(fabs(column_mean(shadows, 3, 1, edge) - 0.75) < 0.02);
    assert_true(column_mean(shadows, 3, 1, 12) == 1.0);
    draw(scene, &desc, TRC_PASS_COMBINED, pixels);
    expect(pixels, 2, (double[4]){0, 0, 0, 0}, 0.0);
    expect(pixels, edge, (double[4]){0, 0, 0, 0.2}, 0.01);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Light stays out of the passes of light and groups; what a catcher is, is in those of data. */
static void passes(void **state) {
    (void)state;
    static float depth[FRAME], direct[3 * FRAME], color[3 * FRAME], group[3 * FRAME];
    const trc_scene scene = fixture_level_view();
    add_strip(scene, -9, 9, 0, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f), CATCHER);
    trc_light_desc area = default_light_desc();
    area.light_group = 1;
    trc_id light = 0;
    assert_int_equal(trc_light_create(scene, &area, &light), TRC_OK);
    trc_render_desc desc = desc_of(4);
    desc.passes = 1u << TRC_PASS_DEPTH | 1u << TRC_PASS_DIFFUSE_DIRECT;
    desc.light_group_count = 1;
    draw(scene, &desc, TRC_PASS_DEPTH, depth);
    draw(scene, &desc, TRC_PASS_DIFFUSE_DIRECT, direct);
    draw(scene, &desc, TRC_PASS_DIFFUSE_COLOR, color);
    draw(scene, &desc, TRC_PASS_LIGHT_GROUP(0), group);
    for (int i = 0; i < FRAME; i++) {
        assert_true(fabsf(depth[i] - 1.0f) < 1e-5f && fabsf(color[3 * i] - 0.5f) < 1e-5f);
        assert_true(direct[3 * i] == 0.0f && group[3 * i] == 0.0f);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Threads, crops and batches change no bit; adaptive sampling spares samples of what is settled. */
static void bits(void **state) {
    (void)state;
    static float whole[4 * FRAME], other[4 * FRAME], counts[FRAME];
    const trc_scene scene = fixture_level_view();
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f);
    add_strip(scene, -9, 9, 0, grey, CATCHER);
    add_strip(scene, -9, 1, 0.8f, grey, 0);
    trc_light_desc area = default_light_desc();
    area.size_x = 8.0f; /* a penumbra of 1.2 m */
    area.strength = 4000.0f;
    trc_id light = 0;
    assert_int_equal(trc_light_create(scene, &area, &light), TRC_OK);
    trc_render_desc desc = desc_of(64);
    draw(scene, &desc, TRC_PASS_COMBINED, whole);
    desc.thread_count = 1;
    desc.progressive = 1;
    draw(scene, &desc, TRC_PASS_COMBINED, other);
    assert_memory_equal(whole, other, sizeof whole);
    desc.crop_x = desc.crop_width = 4;
    desc.crop_height = HEIGHT;
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, other, 16 * HEIGHT);
    for (int y = 0; y < HEIGHT; y++)
        assert_memory_equal(other + 16 * y, whole + 4 * (y * WIDTH + 4), 16 * sizeof(float));
    desc = desc_of(SAMPLES);
    draw(scene, &desc, TRC_PASS_COMBINED, whole);
    desc.noise_threshold = 0.02f;
    desc.min_samples = 16;
    desc.passes = UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
    draw(scene, &desc, TRC_PASS_COMBINED, other);
    draw(scene, &desc, TRC_PASS_SAMPLE_COUNT, counts);
    for (int x = 0; x < WIDTH; x++)
        assert_true(fabs(column_mean(whole, 4, 3, x) - column_mean(other, 4, 3, x)) < 0.02);
    /* The edge of the shadow takes more than where the sum of light is even. */
    assert_true(column_mean(counts, 1, 0, 5) > 2.0 * column_mean(counts, 1, 0, 15));
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(lit),    cmocka_unit_test(wall),
                                       cmocka_unit_test(colors), cmocka_unit_test(coverage),
                                       cmocka_unit_test(passes), cmocka_unit_test(bits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
