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

/* Nodes that emit white, so strong for any ray: by a program that adds what is 0 for lights. */
static trc_id even_nodes(trc_scene scene, float strength) {
    static const trc_node_input inputs[] = {
        {TRC_INPUT_CONSTANT, 0, {0}},       {0, 0, {0}}, {TRC_INPUT_CONSTANT, 0, {0}},
        {TRC_INPUT_CONSTANT, 0, {1, 1, 1}}, {1, 0, {0}},
    };
    trc_node_input own[5];
    memcpy(own, inputs, sizeof own);
    own[0].value[0] = strength;
    const trc_node nodes[] = {
        {.type = TRC_NODE_LIGHT_PATH},
        {.type = TRC_NODE_MATH, .mode = TRC_MATH_ADD, .first_input = 0, .input_count = 3},
        {.type = TRC_NODE_EMISSION, .first_input = 3, .input_count = 2},
    };
    trc_material_desc desc = trc_material_desc_default();
    trc_id id = 0;
    desc.nodes = nodes;
    desc.node_count = 3;
    desc.inputs = own;
    desc.input_count = 5;
    desc.surface = 2;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* The mean of a floor under a lamp of each kind; nodes: 0, or what its nodes emit. */
static double under_lamp(uint32_t type, float strength, float nodes, uint32_t bounce_limit,
                         bool is_glossy) {
    const trc_scene scene = fixture_level_view();
    trc_light_desc light = default_light_desc();
    trc_id id = 0;
    light.type = type;
    light.strength = strength;
    light.transform[11] = 3.0f;
    light.radius = 0.5f;
    light.angle = 0.2f;
    light.spot_angle = 2.0f;
    light.bounce_limit = bounce_limit;
    if (nodes != 0.0f)
        light.material = even_nodes(scene, nodes);
    assert_ok(trc_light_create(scene, &light, &id));
    light.material = id;
    assert_int_equal(trc_light_update(scene, id, &light), TRC_ERROR_INVALID_HANDLE);
    fixture_level(scene, 100.0f, 0.0f,
                  is_glossy ? fixture_glossy(scene, 0.5f, 0.3f)
                            : fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    assert_ok(trc_scene_commit(scene));
    const struct mean mean = mean_of(scene, 16);
    assert_ok(trc_scene_destroy(scene));
    return mean.value;
}

/* A program that emits evenly gives what a strength does, by light samples and by rays. */
static void programs_of_lamps_scale_their_light(void **state) {
    (void)state;
    for (uint32_t type = TRC_LIGHT_POINT; type <= TRC_LIGHT_AREA; type++)
        for (int glossy = 0; glossy < 2; glossy++) {
            const double want = under_lamp(type, 30.0f, 0.0f, 0, glossy);
            const double got = under_lamp(type, 10.0f, 3.0f, 0, glossy);
            assert_true(want > 0.0 && fabs(got - want) < 1e-5 * want);
        }
}

/* A lamp that is limited to no bounces lights what the camera sees all the same. */
static void limits_of_bounces_spare_the_first(void **state) {
    (void)state;
    for (int glossy = 0; glossy < 2; glossy++) {
        const double want = under_lamp(TRC_LIGHT_POINT, 30.0f, 0.0f, 0, glossy);
        const double got = under_lamp(TRC_LIGHT_POINT, 30.0f, 0.0f, 1, glossy);
        assert_true(want > 0.0 && fabs(got - want) < 1e-5 * want);
    }
}

/* A roof of emission 4 m above a floor. */
static trc_scene roofed(uint32_t visibility, uint32_t surface) {
    static const uint32_t down[6] = {0, 2, 1, 0, 3, 2};
    static const float corners[12] = {-3, -3, 4, 7, -3, 4, 7, 3, 4, -3, 3, 4};
    const trc_scene scene = fixture_level_view();
    trc_mesh_desc mesh_desc = fixture_quad_desc(corners);
    trc_id mesh = 0, instance = 0;
    mesh_desc.indices = down;
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

/* ---- many lights, and hidden ones ---- */

static trc_id add_material_sum(trc_scene scene, float matt, float gloss, float roughness) {
    struct node_list list = {0};
    const uint32_t a = NODE_ADD(&list, TRC_NODE_DIFFUSE, 0, node_color(matt, matt, matt),
                                node_number(0.0f), node_standard());
    const uint32_t b =
        NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_GGX, node_color(gloss, gloss, gloss),
                 node_number(roughness), node_number(0.0f), node_number(0.0f), node_standard(),
                 node_standard());
    const uint32_t sum = NODE_ADD(&list, TRC_NODE_ADD_SHADER, 0, node_link(a, 0), node_link(b, 0));
    return level_material(scene, &list, sum, 0);
}

/* A large lamp 2 m above a floor. */
static trc_scene lit_floor(uint32_t visibility, trc_id (*material)(trc_scene scene)) {
    const trc_scene scene = fixture_level_view();
    trc_light_desc lamp = default_light_desc();
    trc_id id = 0;
    lamp.transform[11] = 2.0f;
    lamp.size_x = lamp.size_y = 4.0f;
    lamp.visibility = visibility;
    assert_ok(trc_light_create(scene, &lamp, &id));
    fixture_level(scene, 100.0f, 0.0f, material(scene));
    assert_ok(trc_scene_commit(scene));
    return scene;
}
static trc_id matt(trc_scene scene) { return fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f); }
static trc_id matt_and_gloss(trc_scene scene) { return add_material_sum(scene, 0.5f, 0.4f, 0.7f); }

/* A lamp that glossy rays do not meet: no ray brings what its samples leave to rays, so that matt
 * and glossy lobes together show what matt ones do alone. */
static void hidden_lamps_leave_nothing_to_rays(void **state) {
    (void)state;
    const uint32_t hidden = TRC_VISIBLE_ALL & ~(uint32_t)TRC_VISIBLE_GLOSSY;
    const trc_scene alone = lit_floor(hidden, matt), both = lit_floor(hidden, matt_and_gloss);
    const trc_scene seen = lit_floor(TRC_VISIBLE_ALL, matt_and_gloss);
    const struct mean want = mean_of(alone, 64);
    expect_same("matt and glossy", mean_of(both, 64), want);
    assert_true(mean_of(seen, 64).value > 1.2 * want.value);
    assert_ok(trc_scene_destroy(alone));
    assert_ok(trc_scene_destroy(both));
    assert_ok(trc_scene_destroy(seen));
}

/* Commits a floor under the scene's lamp and, if asked for, a dim one. */
static trc_scene over_floor(trc_scene scene, bool has_dim) {
    trc_light_desc dim = default_light_desc();
    trc_id id = 0;
    dim.strength = 20.0f;
    dim.type = TRC_LIGHT_POINT;
    if (has_dim)
        assert_ok(trc_light_create(scene, &dim, &id));
    fixture_level(scene, 100.0f, 0.0f, matt(scene));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* A lamp on edge, most of it below the floor; and a dim one of its own. */
static trc_scene sunken(bool has_lamp, bool has_dim) {
    const trc_scene scene = fixture_level_view();
    /* Faces -x from x = 6, z from -5 to 1. */
    static const float on_edge[12] = {0, 0, 1, 6, 1, 0, 0, 0, 0, 1, 0, -2};
    trc_light_desc lamp = default_light_desc();
    trc_id id = 0;
    memcpy(lamp.transform, on_edge, sizeof on_edge);
    lamp.size_x = lamp.size_y = 6.0f;
    lamp.strength = 400.0f;
    lamp.cast_shadow = 0;
    if (has_lamp)
        assert_ok(trc_light_create(scene, &lamp, &id));
    return over_floor(scene, has_dim);
}

/* Where both are, there is the light of one and of the other. */
static void expect_sum(const char *what, trc_scene (*make)(bool has_lamp, bool has_dim)) {
    struct mean alone[2];
    for (int k = 0; k < 2; k++) {
        const trc_scene scene = make(k == 0, k == 1);
        alone[k] = mean_of(scene, 256);
        assert_ok(trc_scene_destroy(scene));
    }
    assert_true(alone[0].value > 0.1 * alone[1].value);
    const struct mean sum = {alone[0].value + alone[1].value,
                             hypot(alone[0].error, alone[1].error)};
    const trc_scene both = make(true, true);
    expect_same(what, mean_of(both, 256), sum);
    assert_ok(trc_scene_destroy(both));
}

/* Lights whose middle is below the horizon shine with what is above. */
static void lamps_below_the_horizon_are_chosen(void **state) {
    (void)state;
    expect_sum("two lamps", sunken);
}

/* A spot of half a turn whose middle lies below the floor, which its sphere lights; a dim lamp. */
static trc_scene half_turn(bool has_lamp, bool has_dim) {
    const trc_scene scene = fixture_level_view();
    static const float below[12] = {1, 0, 0, 2, 0, 1, 0, 0, 0, 0, 1, -0.2f};
    trc_light_desc spot = default_light_desc();
    trc_id id = 0;
    spot.type = TRC_LIGHT_SPOT;
    memcpy(spot.transform, below, sizeof below);
    spot.spot_angle = (float)PI;
    spot.spot_blend = 0.0f;
    spot.radius = 6.0f;
    spot.strength = 2000.0f;
    spot.cast_shadow = 0;
    if (has_lamp)
        assert_ok(trc_light_create(scene, &spot, &id));
    return over_floor(scene, has_dim);
}

/* What is behind the middle of a sphere is not behind all of it. */
static void spots_of_half_a_turn_are_chosen(void **state) {
    (void)state;
    expect_sum("spot and lamp", half_turn);
}

/* A bright lamp that faces away takes no samples from a sun: the floor behind it has no noise. */
static void lamps_are_not_chosen_behind_them(void **state) {
    (void)state;
    /* Faces up from .1 above the floor, beside the view. */
    static const float face_up[12] = {1, 0, 0, 2, 0, -1, 0, 3, 0, 0, -1, 0.1f};
    static float pixels[4 * LEVEL_PIXELS];
    const trc_scene scene = fixture_level_view();
    trc_light_desc lamp = default_light_desc(), sun = default_light_desc();
    trc_id id = 0;
    memcpy(lamp.transform, face_up, sizeof face_up);
    lamp.size_x = lamp.size_y = 4.0f;
    lamp.strength = 4000.0f;
    assert_ok(trc_light_create(scene, &lamp, &id));
    sun.type = TRC_LIGHT_SUN;
    sun.size_x = sun.size_y = 0.0f;
    sun.strength = (float)PI;
    assert_ok(trc_light_create(scene, &sun, &id));
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    assert_ok(trc_scene_commit(scene));
    const trc_render_desc desc = default_render_desc(LEVEL_WIDTH, LEVEL_HEIGHT, 1);
    fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, (uint64_t)4 * LEVEL_PIXELS);
    for (int p = 0; p < LEVEL_PIXELS; p++)
        if (fabsf(pixels[4 * p] - 0.5f) > 1e-5f)
            fail_msg("pixel %d has %g", p, (double)pixels[4 * p]);
    assert_ok(trc_scene_destroy(scene));
}

/* A dark sky with one bright texel above the horizon, over a floor. */
static trc_scene one_bright_texel(uint32_t is_sampled) {
    enum { WIDTH = 32, HEIGHT = 16 };
    static float pixels[4 * WIDTH * HEIGHT];
    const trc_scene scene = fixture_level_view();
    for (uint32_t i = 0; i < 4 * WIDTH * HEIGHT; i++)
        pixels[i] = i % 4 == 3 ? 1.0f : i / 4 == 11 * WIDTH + 5 ? 100.0f : 0.01f;
    trc_image_desc desc = default_image_desc();
    trc_id image = 0;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.pixels = pixels;
    desc.pixel_bytes = sizeof pixels;
    assert_ok(trc_image_create(scene, &desc, &image));
    struct node_list list = {0};
    const uint32_t texture =
        NODE_ADD(&list, TRC_NODE_ENVIRONMENT, TRC_IMAGE_CLOSEST, node_standard());
    list.nodes[texture].image = image;
    const uint32_t surface =
        NODE_ADD(&list, TRC_NODE_BACKGROUND, 0, node_link(texture, 0), node_number(1.0f));
    trc_world_desc world = default_world_desc(level_material(scene, &list, surface, 0));
    world.use_sampling = is_sampled;
    world.map_resolution = 64;
    assert_ok(trc_scene_set_world(scene, &world));
    fixture_level(scene, 100.0f, 0.0f, matt(scene));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* Samples go where the sky is bright: the noise is that of a tenth of them at most. */
static void the_sky_is_sampled_where_it_is_bright(void **state) {
    (void)state;
    const trc_scene even = one_bright_texel(0), map = one_bright_texel(1);
    const struct mean want = mean_of(even, 4096), found = mean_of(map, 256);
    const struct mean blind = mean_of(even, 256);
    printf("  sky: %.5f +- %.5f by the map, %.5f +- %.5f without\n", found.value, found.error,
           blind.value, blind.error);
    assert_true(fabs(found.value - want.value) <= 5.0 * hypot(found.error, want.error));
    assert_true(found.error < 0.3 * blind.error);
    assert_ok(trc_scene_destroy(even));
    assert_ok(trc_scene_destroy(map));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_are_met_from_inside),
        cmocka_unit_test(lamps_keep_their_switches),
        cmocka_unit_test(programs_of_lamps_scale_their_light),
        cmocka_unit_test(limits_of_bounces_spare_the_first),
        cmocka_unit_test(emissive_meshes_keep_their_switches),
        cmocka_unit_test(faces_that_shine_are_weighed_by_themselves),
        cmocka_unit_test(hidden_lamps_leave_nothing_to_rays),
        cmocka_unit_test(lamps_below_the_horizon_are_chosen),
        cmocka_unit_test(spots_of_half_a_turn_are_chosen),
        cmocka_unit_test(lamps_are_not_chosen_behind_them),
        cmocka_unit_test(the_sky_is_sampled_where_it_is_bright),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("light sources", tests, NULL, NULL);
}
