/* Passes of what lies behind something partly transparent, and of light in groups, beside sums by
 * hand. */
#include "level_test.h"

static uint32_t add_emission(struct node_list *list, float r, float g, float b) {
    return NODE_ADD(list, TRC_NODE_EMISSION, 0, node_color(r, g, b), node_number(1.0f));
}

static void expect(const char *what, const float *found, const double *want, int channels,
                   double allowed) {
    for (int k = 0; k < channels; k++)
        if (!(fabs((double)found[k] - want[k]) <= allowed))
            fail_msg("%s: channel %d is %.6f, not %.6f", what, k, (double)found[k], want[k]);
}

/* Renders a pass of every pixel with so many samples. */
static void draw(trc_scene scene, uint32_t pass, uint32_t samples, uint32_t transparent,
                 float *pixels) {
    trc_render_desc desc = level_desc(samples);
    desc.film_transparent = transparent;
    desc.passes = pass < 64 ? UINT64_C(1) << pass : 0;
    desc.aov_value_count = desc.aov_color_count = 2;
    desc.light_group_count = 4;
    fixture_draw(scene, &desc, pass, pixels, (uint64_t)trc_pass_channels(pass) * LEVEL_PIXELS);
}

/* ---- behind something partly transparent ---- */

/* A veil at half the camera's height: emission, and transparency of that share and tint. */
static const float veil_light[3] = {0.1f, 0.2f, 0.3f}, veil_tint[3] = {0.4f, 0.8f, 1.0f};

static void add_veil(trc_scene scene, float clear) {
    struct node_list list = {0};
    const uint32_t light = add_emission(&list, veil_light[0], veil_light[1], veil_light[2]);
    const uint32_t glass = NODE_ADD(&list, TRC_NODE_TRANSPARENT, 0,
                                    node_color(veil_tint[0], veil_tint[1], veil_tint[2]));
    const uint32_t mix = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_number(clear),
                                  node_link(light, 0), node_link(glass, 0));
    NODE_ADD(&list, TRC_NODE_AOV_COLOR, 1, node_color(0.1f, 0.2f, 0.4f));
    NODE_ADD(&list, TRC_NODE_AOV_VALUE, 0, node_number(3.0f));
    fixture_level(scene, 10.0f, 0.5f, level_material(scene, &list, mix, 0));
}

/* An opaque square or a sky, both with AOVs. */
static uint32_t add_aovs(struct node_list *list, uint32_t type) {
    const uint32_t light = NODE_ADD(list, type, 0, node_color(0.3f, 0.3f, 0.3f), node_number(1.0f));
    NODE_ADD(list, TRC_NODE_AOV_COLOR, 1, node_color(0.5f, 0.25f, 1.0f));
    NODE_ADD(list, TRC_NODE_AOV_VALUE, 0, node_number(2.0f));
    return light;
}

/* As Cycles 3.4 and 4.3 render the same: all values up to the first surface that is not mostly seen
 * through, added up, and 1 for each in the last channel. */
static void aovs_behind_a_veil(void **state) {
    (void)state;
    static const double both[4] = {0.6, 0.45, 1.4, 2.0}, veil[4] = {0.1, 0.2, 0.4, 1.0};
    static const double both_value[1] = {5.0}, veil_value[1] = {3.0};
    for (int is_sky = 0; is_sky < 2; is_sky++)
        for (int is_dense = 0; is_dense < 2; is_dense++) {
            const trc_scene scene = fixture_level_view();
            struct node_list list = {0};
            add_veil(scene, is_dense ? 0.3f : 0.75f);
            const uint32_t type = is_sky ? TRC_NODE_BACKGROUND : TRC_NODE_EMISSION;
            const trc_id behind = level_material(scene, &list, add_aovs(&list, type), 0);
            if (is_sky) {
                const trc_world_desc world = default_world_desc(behind);
                assert_ok(trc_scene_set_world(scene, &world));
            } else {
                fixture_level(scene, 10.0f, 0.0f, behind);
            }
            assert_ok(trc_scene_commit(scene));
            float color[4 * LEVEL_PIXELS], value[LEVEL_PIXELS];
            draw(scene, TRC_PASS_AOV_COLOR(1), 4, 0, color);
            draw(scene, TRC_PASS_AOV_VALUE(0), 4, 0, value);
            for (int p = 0; p < LEVEL_PIXELS; p++) {
                expect("colour", color + 4 * p, is_dense ? veil : both, 4, 1e-6);
                expect("value", value + p, is_dense ? veil_value : both_value, 1, 1e-6);
            }
            assert_ok(trc_scene_destroy(scene));
        }
}

/* A holdout takes from the film what the veil lets be seen of it, also in part; what a mirror shows
 * of it is black and covers. */
static void holdouts_behind_a_veil(void **state) {
    (void)state;
    const double clear = 0.75;
    for (int kind = 0; kind < 3; kind++)
        for (uint32_t transparent = 0; transparent < 2; transparent++) {
            const double part = kind == 1 ? 0.6 : 1.0; /* of the surface that is a holdout */
            const trc_scene scene = fixture_level_view();
            struct node_list list = {0};
            const uint32_t light = add_emission(&list, 0.3f, 0.3f, 0.3f);
            const uint32_t hole = NODE_ADD(&list, TRC_NODE_HOLDOUT, 0, node_standard());
            list.nodes[hole].input_count = 0;
            const uint32_t mix = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_number((float)part),
                                          node_link(light, 0), node_link(hole, 0));
            const trc_id material = level_material(scene, &list, mix, 0);
            add_veil(scene, (float)clear);
            if (kind == 2) {
                fixture_level(scene, 10.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.0f));
                fixture_level(scene, 10.0f, 2.0f, material);
            } else {
                fixture_level(scene, 10.0f, 0.0f, material);
            }
            assert_ok(trc_scene_commit(scene));
            float pixels[4 * LEVEL_PIXELS];
            double want[4], seen = 0.0;
            draw(scene, TRC_PASS_COMBINED, 4, transparent, pixels);
            for (int c = 0; c < 3; c++) {
                const double through = clear * (double)veil_tint[c];
                seen += through / 3.0;
                want[c] = (1.0 - clear) * (double)veil_light[c] + through * (1.0 - part) * 0.3;
                /* The mirror's ray meets the veil twice more, both times as something that
                 * shines. */
                if (kind == 2)
                    want[c] += through * (1.0 - clear) * (double)veil_light[c];
            }
            want[3] = kind == 2 ? 1.0 : 1.0 - seen * part;
            for (int p = 0; p < LEVEL_PIXELS; p++)
                expect("holdout", pixels + 4 * p, want, 4, 1e-6);
            assert_ok(trc_scene_destroy(scene));
        }
}

/* ---- features for denoisers ---- */

/* A surface of a diffuse of that share, the rest glossy, both white, and how much of it is clear.
 */
struct rough_surface {
    float diffuse, roughness, clear;
};

static trc_id add_rough(trc_scene scene, const struct rough_surface *s) {
    struct node_list list = {0};
    const trc_node_input white = node_color(0.8f, 0.4f, 0.6f);
    const uint32_t matt =
        NODE_ADD(&list, TRC_NODE_DIFFUSE, 0, white, node_number(0.0f), node_standard());
    const uint32_t gloss =
        NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_GGX, white, node_number(s->roughness),
                 node_number(0.0f), node_number(0.0f), node_standard(), node_standard());
    const uint32_t both = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_number(s->diffuse),
                                   node_link(gloss, 0), node_link(matt, 0));
    const uint32_t clear = NODE_ADD(&list, TRC_NODE_TRANSPARENT, 0, node_color(1.0f, 1.0f, 1.0f));
    const uint32_t mix = NODE_ADD(&list, TRC_NODE_MIX_SHADER, 0, node_number(s->clear),
                                  node_link(both, 0), node_link(clear, 0));
    return level_material(scene, &list, mix, 0);
}

/* Every branch is followed, so that what is behind is seen without noise. */
static void draw_features(trc_scene scene, uint32_t pass, float *pixels) {
    trc_render_desc desc = level_desc(1);
    desc.integrator = TRC_INTEGRATOR_WHITTED;
    desc.passes = UINT64_C(1) << pass;
    fixture_draw(scene, &desc, pass, pixels, (uint64_t)trc_pass_channels(pass) * LEVEL_PIXELS);
}

static double mean_alpha(const struct rough_surface *s) {
    return (double)s->diffuse + (1.0 - (double)s->diffuse) * pow((double)s->roughness, 2.0);
}

/* Of a surface, and of one behind it by what the first lets through. */
static void roughness_is_that_of_what_is_seen(void **state) {
    (void)state;
    static const struct rough_surface near[] = {
        {0.0f, 0.3f, 0.0f}, {0.0f, 0.0f, 0.0f},  {1.0f, 0.0f, 0.0f}, {0.25f, 0.5f, 0.0f},
        {0.0f, 0.7f, 0.5f}, {0.5f, 0.2f, 0.25f}, {0.0f, 0.1f, 1.0f}};
    static const struct rough_surface far = {0.5f, 0.4f, 0.0f};
    double worst = 0.0;
    for (size_t k = 0; k < sizeof near / sizeof *near; k++) {
        const trc_scene scene = fixture_level_view();
        fixture_level(scene, 10.0f, 0.5f, add_rough(scene, &near[k]));
        fixture_level(scene, 10.0f, 0.0f, add_rough(scene, &far));
        assert_ok(trc_scene_commit(scene));
        /* A surface that is clear throughout has no lobe of its own. */
        const double own = near[k].clear < 1.0f ? sqrt(mean_alpha(&near[k])) : 0.0;
        const double want = own + (double)near[k].clear * sqrt(mean_alpha(&far));
        float pixels[LEVEL_PIXELS];
        draw_features(scene, TRC_PASS_DENOISING_ROUGHNESS, pixels);
        for (int p = 0; p < LEVEL_PIXELS; p++) {
            expect("roughness", pixels + p, &want, 1, 1e-5);
            worst = fmax(worst, fabs((double)pixels[p] - want));
        }
        assert_ok(trc_scene_destroy(scene));
    }
    printf("  roughness: at most %.1e off\n", worst);
}

/* The white of both lobes, of the glossy one as far as it is nearly a mirror. */
static void specular_albedo_is_of_mirrors(void **state) {
    (void)state;
    static const double color[3] = {0.8, 0.4, 0.6};
    static const struct rough_surface surfaces[] = {
        {0.0f, 0.0f, 0.0f}, {0.0f, 0.2f, 0.0f},  {0.0f, 0.3f, 0.0f},  {0.0f, 0.4f, 0.0f},
        {1.0f, 0.1f, 0.0f}, {0.25f, 0.3f, 0.0f}, {0.0f, 0.25f, 0.5f}, {0.5f, 0.35f, 1.0f}};
    static const struct rough_surface far = {0.5f, 0.2f, 0.0f};
    double worst = 0.0;
    for (size_t k = 0; k < sizeof surfaces / sizeof *surfaces; k++) {
        const trc_scene scene = fixture_level_view();
        const struct rough_surface *const both[2] = {&surfaces[k], &far};
        double want[3] = {0.0, 0.0, 0.0}, through = 1.0;
        for (int i = 0; i < 2; i++) {
            const double t = fmin(pow((double)both[i]->roughness, 2.0) / 0.15, 1.0);
            const double own = (1.0 - (double)both[i]->clear) * (1.0 - (double)both[i]->diffuse) *
                               (1.0 - t * t * (3.0 - 2.0 * t));
            for (int c = 0; c < 3; c++)
                want[c] += through * own * color[c];
            through *= (double)both[i]->clear;
            fixture_level(scene, 10.0f, i ? 0.0f : 0.5f, add_rough(scene, both[i]));
        }
        assert_ok(trc_scene_commit(scene));
        float pixels[3 * LEVEL_PIXELS];
        draw_features(scene, TRC_PASS_DENOISING_SPECULAR_ALBEDO, pixels);
        for (int p = 0; p < LEVEL_PIXELS; p++) {
            expect("specular albedo", pixels + 3 * p, want, 3, 1e-5);
            for (int c = 0; c < 3; c++)
                worst = fmax(worst, fabs((double)pixels[3 * p + c] - want[c]));
        }
        assert_ok(trc_scene_destroy(scene));
    }
    printf("  specular albedo: at most %.1e off\n", worst);
}

/* ---- light in groups ---- */

enum { GROUPS = 4 };

/* The light of column x of strips, and its group, 0 for none: all have one material, the brightness
 * is of the colour of the instance. */
static double strip_light(int x) { return 0.25 + 0.125 * (x % 8); }
static uint32_t strip_group(int x) { return (uint32_t)(7 * x / 2) % (GROUPS + 1); }

static void add_strip(trc_scene scene, trc_id material, int x, float z) {
    const float left = 0.25f * (float)x, right = left + 0.25f;
    const float corners[12] = {left, -5, z, right, -5, z, right, 5, z, left, 5, z};
    const float light = (float)strip_light(x);
    trc_mesh_desc mesh_desc = fixture_quad_desc(corners);
    trc_id mesh = 0, instance = 0;
    assert_ok(trc_mesh_create(scene, &mesh_desc, &mesh));
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = &material;
    desc.material_count = 1;
    desc.light_group = strip_group(x);
    for (int c = 0; c < 3; c++)
        desc.color[c] = light;
    assert_ok(trc_instance_create(scene, &desc, &instance));
}

static trc_id add_colored_light(trc_scene scene) {
    struct node_list list = {0};
    const uint32_t info = node_add(&list, TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    const uint32_t light =
        NODE_ADD(&list, TRC_NODE_EMISSION, 0, node_link(info, 1), node_number(1.0f));
    return level_material(scene, &list, light, 0);
}

/* Emission that the camera sees, directly or in a mirror, is in its own instance's group, whatever
 * its neighbours in a packet are in. */
static void emission_is_in_its_instances_group(void **state) {
    (void)state;
    for (int is_mirrored = 0; is_mirrored < 2; is_mirrored++) {
        const trc_scene scene = fixture_level_view();
        const trc_id material = add_colored_light(scene);
        for (int x = 0; x < LEVEL_WIDTH; x++)
            add_strip(scene, material, x, is_mirrored ? 2.0f : 0.0f);
        if (is_mirrored)
            fixture_level(scene, 10.0f, 0.0f, fixture_glossy(scene, 1.0f, 0.0f));
        assert_ok(trc_scene_commit(scene));
        for (uint32_t group = 1; group <= GROUPS; group++) {
            float pixels[3 * LEVEL_PIXELS];
            draw(scene, TRC_PASS_LIGHT_GROUP(group - 1), 4, 0, pixels);
            for (int p = 0; p < LEVEL_PIXELS; p++) {
                const int x = p % LEVEL_WIDTH;
                const double light = strip_group(x) == group ? strip_light(x) : 0.0;
                const double want[3] = {light, light, light};
                expect("group", pixels + 3 * p, want, 3, 1e-6);
            }
        }
        assert_ok(trc_scene_destroy(scene));
    }
}

/* Mean of a pass's first channel over the picture and its standard error by the pixels. */
static struct mean mean_of(trc_scene scene, uint32_t pass) {
    static float pixels[4 * LEVEL_PIXELS];
    double sum = 0.0, sum2 = 0.0;
    const uint32_t channels = trc_pass_channels(pass);
    draw(scene, pass, 256, 0, pixels);
    for (uint32_t p = 0; p < LEVEL_PIXELS; p++) {
        const double value = (double)pixels[channels * p];
        sum += value / LEVEL_PIXELS;
        sum2 += value * value / LEVEL_PIXELS;
    }
    return mean_from(sum, sum2, LEVEL_PIXELS);
}

/* Five standard errors. */
static void expect_mean(const char *what, struct mean m, double want) {
    printf("  %s: %.5f +- %.5f, %.5f expected\n", what, m.value, m.error, want);
    assert_true(m.error < 0.02 * fmax(want, 1e-3));
    assert_true(fabs(m.value - want) <= 5.0 * m.error + 1e-6);
}

/* A white floor under a sun of group 1, a large light on high of group 2, a world of group 3 and
 * ambient occlusion, which adds light of no group or replaces the world's in its. */
#define SUN 0.5
#define SKY 0.25
#define AMBIENT 0.4

static trc_scene lit_floor(uint32_t method) {
    const trc_scene scene = fixture_level_view();
    trc_light_desc light = default_light_desc();
    trc_id id = 0;
    fixture_level(scene, 100.0f, 0.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 1.0f));
    light.type = TRC_LIGHT_SUN;
    light.strength = (float)SUN;
    light.light_group = 1;
    assert_ok(trc_light_create(scene, &light, &id));
    /* Emission of a mesh, as large as half of the sky by the cosine: a disk seen at 45 degrees. */
    struct mesh disk;
    mesh_init(&disk);
    const uint32_t corners = 256;
    const uint32_t center = mesh_add_vertex(&disk, 2.0f, 0.0f, 1000.0f);
    for (uint32_t k = 0; k < corners; k++)
        mesh_add_vertex(&disk, 2.0f + 1000.0f * cosf(2.0f * (float)PI * (float)k / corners),
                        1000.0f * sinf(2.0f * (float)PI * (float)k / corners), 1000.0f);
    for (uint32_t k = 0; k < corners; k++)
        mesh_add_triangle(&disk, center, 1 + (k + 1) % corners, 1 + k);
    trc_mesh_desc mesh_desc = default_mesh_desc();
    mesh_desc.vertex_count = disk.vertex_count;
    mesh_desc.triangle_count = disk.triangle_count;
    mesh_desc.positions = disk.positions;
    mesh_desc.position_count = 3 * disk.vertex_count;
    mesh_desc.indices = disk.indices;
    mesh_desc.index_count = 3 * disk.triangle_count;
    trc_id mesh = 0, instance = 0;
    assert_ok(trc_mesh_create(scene, &mesh_desc, &mesh));
    const trc_id shining = fixture_material(scene, TRC_NODE_EMISSION, 0.5f);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = &shining;
    desc.material_count = 1;
    desc.light_group = 2;
    /* It is not in the sun's way; the sky is, whose light is for rays of matt lobes. */
    desc.visibility = TRC_VISIBLE_ALL & ~(uint32_t)TRC_VISIBLE_SHADOW;
    assert_ok(trc_instance_create(scene, &desc, &instance));
    mesh_free(&disk);
    trc_world_desc world =
        default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, (float)SKY));
    world.light_group = 3;
    world.ao_distance = 10.0f;
    world.ao_factor = (float)AMBIENT;
    world.ao_method = method;
    assert_ok(trc_scene_set_world(scene, &world));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

static void groups_share_out_light_samples(void **state) {
    (void)state;
    for (uint32_t method = TRC_AO_ADD; method <= TRC_AO_REPLACE; method++) {
        const trc_scene scene = lit_floor(method);
        /* What a white floor sends back of so much. The disk is a polygon: less than 1e-4 less of
         * it. It hides half of the sky, but is too far away for ambient occlusion. */
        const double sun = SUN / PI, disk = 0.5 * 0.5;
        const double sky = method == TRC_AO_ADD ? 0.5 * SKY : AMBIENT * SKY;
        const double ambient = method == TRC_AO_ADD ? AMBIENT : 0.0;
        expect_mean("sun", mean_of(scene, TRC_PASS_LIGHT_GROUP(0)), sun);
        expect_mean("disk", mean_of(scene, TRC_PASS_LIGHT_GROUP(1)), disk);
        expect_mean("sky", mean_of(scene, TRC_PASS_LIGHT_GROUP(2)), sky);
        expect_mean("all", mean_of(scene, TRC_PASS_COMBINED), sun + disk + sky + ambient);
        static float none[3 * LEVEL_PIXELS];
        draw(scene, TRC_PASS_LIGHT_GROUP(3), 4, 0, none);
        for (int i = 0; i < 3 * LEVEL_PIXELS; i++)
            assert_true(none[i] == 0.0f);
        assert_ok(trc_scene_destroy(scene));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(aovs_behind_a_veil),
        cmocka_unit_test(holdouts_behind_a_veil),
        cmocka_unit_test(roughness_is_that_of_what_is_seen),
        cmocka_unit_test(specular_albedo_is_of_mirrors),
        cmocka_unit_test(emission_is_in_its_instances_group),
        cmocka_unit_test(groups_share_out_light_samples),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("passes", tests, NULL, NULL);
}
