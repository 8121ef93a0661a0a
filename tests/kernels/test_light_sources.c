/* Lights of every kind beside what they give in closed form, or beside the same picture without
 * light samples. */
#include "level_test.h"

/* Pictures of so many seeds tell the noise. */
enum { SEEDS = 16 };

/* Mean of the first channel of the level view. */
static struct mean mean_of(trc_scene scene, uint32_t samples) {
    static float pixels[4 * LEVEL_PIXELS];
    trc_render_desc desc = default_render_desc(LEVEL_WIDTH, LEVEL_HEIGHT, samples);
    double sum = 0.0, sum2 = 0.0;
    for (uint32_t seed = 0; seed < SEEDS; seed++) {
        double picture = 0.0;
        desc.seed = 1 + seed;
        fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, (uint64_t)4 * LEVEL_PIXELS);
        for (int p = 0; p < LEVEL_PIXELS; p++)
            picture += (double)pixels[4 * p] / LEVEL_PIXELS;
        sum += picture / SEEDS;
        sum2 += picture * picture / SEEDS;
    }
    return mean_from(sum, sum2, SEEDS);
}

/* Five standard errors of both. */
static void expect_same(const char *what, struct mean found, struct mean want) {
    const double error = sqrt(found.error * found.error + want.error * want.error);
    printf("  %s: %.5f +- %.5f, %.5f +- %.5f expected\n", what, found.value, found.error,
           want.value, want.error);
    assert_true(error < 0.005 * fmax(fabs(want.value), 1e-3));
    assert_true(fabs(found.value - want.value) <= 5.0 * error + 1e-6);
}

/* A mirror inside of a sphere of light shows its far wall everywhere: strength / (4 pi^2 r^2). */
static void spheres_are_met_from_inside(void **state) {
    (void)state;
    const double radius = 50.0, strength = 4.0 * PI * PI * radius * radius;
    const trc_scene scene = fixture_level_view();
    trc_light_desc light = default_light_desc();
    trc_id id = 0;
    light.type = TRC_LIGHT_POINT;
    light.flags = TRC_LIGHT_SPHERE;
    light.radius = (float)radius;
    light.strength = (float)strength;
    assert_ok(trc_light_create(scene, &light, &id));
    fixture_level(scene, 100.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.0f));
    assert_ok(trc_scene_commit(scene));
    expect_same("in a sphere", mean_of(scene, 4), (struct mean){1.0, 1e-4});
    assert_ok(trc_scene_destroy(scene));
}

/* Of eight suns alike under a roof some shine through everything. A floor gets those alone,
 * whichever lamps its packets choose. */
static void lamps_keep_their_switches(void **state) {
    (void)state;
    enum { SUNS = 8 };
    for (uint32_t through = 1; through < 1u << SUNS; through = 5 * through + 1) {
        const trc_scene scene = fixture_level_view();
        double want = 0.0;
        for (uint32_t k = 0; k < SUNS; k++) {
            trc_light_desc light = default_light_desc();
            trc_id id = 0;
            light.type = TRC_LIGHT_SUN;
            light.strength = (float)PI;
            light.cast_shadow = !(through >> k & 1);
            want += (through >> k & 1) * 0.5;
            assert_ok(trc_light_create(scene, &light, &id));
        }
        fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
        fixture_level(scene, 100.0f, 2.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
        assert_ok(trc_scene_commit(scene));
        expect_same("suns", mean_of(scene, 64), (struct mean){want, 0.0});
        assert_ok(trc_scene_destroy(scene));
    }
}

/* A roof of emission 4 m above a floor. */
static trc_scene roofed(uint32_t visibility, uint32_t surface) {
    static const uint32_t down[6] = {0, 2, 1, 0, 3, 2};
    static const float corners[12] = {-3, -3, 4, 7, -3, 4, 7, 3, 4, -3, 3, 4};
    const trc_scene scene = fixture_level_view();
    trc_mesh_desc mesh_desc = default_mesh_desc();
    trc_id mesh = 0, instance = 0;
    mesh_desc.vertex_count = 4;
    mesh_desc.triangle_count = 2;
    mesh_desc.positions = corners;
    mesh_desc.position_count = 12;
    mesh_desc.indices = down;
    mesh_desc.index_count = 6;
    assert_ok(trc_mesh_create(scene, &mesh_desc, &mesh));
    const trc_id shining = fixture_material(scene, TRC_NODE_EMISSION, 1.0f);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = &shining;
    desc.material_count = 1;
    desc.visibility = visibility;
    assert_ok(trc_instance_create(scene, &desc, &instance));
    fixture_level(scene, 100.0f, 0.0f,
                  surface == TRC_NODE_DIFFUSE ? fixture_material(scene, surface, 0.5f)
                                              : fixture_glossy(scene, 0.5f, 0.3f));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* What is hidden from rays of a kind gives its surfaces no light, and others as much as before. */
static void emissive_meshes_keep_their_switches(void **state) {
    (void)state;
    static const struct {
        uint32_t surface, own;
    } cases[] = {{TRC_NODE_DIFFUSE, TRC_VISIBLE_DIFFUSE}, {TRC_NODE_GLOSSY, TRC_VISIBLE_GLOSSY}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint32_t other = (TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_GLOSSY) & ~cases[i].own;
        const trc_scene seen = roofed(TRC_VISIBLE_ALL, cases[i].surface);
        const trc_scene hidden = roofed(TRC_VISIBLE_ALL & ~cases[i].own, cases[i].surface);
        const trc_scene apart = roofed(TRC_VISIBLE_ALL & ~other, cases[i].surface);
        const struct mean want = mean_of(seen, 64);
        assert_true(want.value > 0.1);
        expect_same("hidden from others", mean_of(apart, 64), want);
        assert_true(mean_of(hidden, 4).value == 0.0);
        assert_ok(trc_scene_destroy(seen));
        assert_ok(trc_scene_destroy(hidden));
        assert_ok(trc_scene_destroy(apart));
    }
}

/* A roof of strips, every third of which shines, of widths from .1 to 1.5 m, over rough gloss.
 * is_sampled: they are lights, else rays alone find them. */
static trc_scene striped(bool is_sampled) {
    enum { STRIPS = 24 };
    static float corners[12 * STRIPS];
    static uint32_t indices[6 * STRIPS];
    static uint16_t slots[2 * STRIPS];
    const trc_scene scene = fixture_level_view();
    float x = -6.0f;
    for (uint32_t k = 0; k < STRIPS; k++) {
        const float next = x + 0.1f + 0.2f * (float)(k * 5 % 8), z = 2.0f;
        const float strip[12] = {x, -4, z, x, 4, z, next, 4, z, next, -4, z};
        const uint32_t quad[6] = {0, 1, 2, 0, 2, 3};
        memcpy(corners + 12 * k, strip, sizeof strip);
        for (int i = 0; i < 6; i++)
            indices[6 * k + i] = 4 * k + quad[i];
        slots[2 * k] = slots[2 * k + 1] = k % 3 == 0;
        x = next;
    }
    trc_mesh_desc mesh_desc = default_mesh_desc();
    trc_id mesh = 0, instance = 0, materials[2];
    mesh_desc.vertex_count = 4 * STRIPS;
    mesh_desc.triangle_count = 2 * STRIPS;
    mesh_desc.positions = corners;
    mesh_desc.position_count = 12 * STRIPS;
    mesh_desc.indices = indices;
    mesh_desc.index_count = 6 * STRIPS;
    mesh_desc.material_index = slots;
    assert_ok(trc_mesh_create(scene, &mesh_desc, &mesh));
    struct node_list list = {0};
    NODE_ADD(&list, TRC_NODE_EMISSION, 0, node_color(1, 1, 1), node_number(1.0f));
    materials[0] = fixture_glossy(scene, 0.0f, 0.3f); /* matt ones would need the samples */
    materials[1] = level_material(scene, &list, 0, is_sampled ? TRC_MATERIAL_SAMPLE_EMISSION : 0);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = materials;
    desc.material_count = 2;
    assert_ok(trc_instance_create(scene, &desc, &instance));
    fixture_level(scene, 100.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.3f));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

static void faces_that_shine_are_weighed_by_themselves(void **state) {
    (void)state;
    const trc_scene sampled = striped(true), found = striped(false);
    expect_same("strips", mean_of(sampled, 256), mean_of(found, 256));
    assert_ok(trc_scene_destroy(sampled));
    assert_ok(trc_scene_destroy(found));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_are_met_from_inside),
        cmocka_unit_test(lamps_keep_their_switches),
        cmocka_unit_test(emissive_meshes_keep_their_switches),
        cmocka_unit_test(faces_that_shine_are_weighed_by_themselves),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("light sources", tests, NULL, NULL);
}
