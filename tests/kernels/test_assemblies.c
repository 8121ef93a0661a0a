/* Pictures do not depend on how rays are put into packets: every assembly and size of packets, with
 * all that an integrator sends on, against the one that is chosen without asking. */
#include "query_test.h"

#include "default_descs.h"
#include "figures.h"

#define SIDE_PX 40
#define SAMPLES 4
#define FLOATS (4 * SIDE_PX * SIDE_PX)
/* Samples add up in another order: a few half-ulps of what a pixel gathers. */
#define TOLERANCE 2e-6f

static trc_id add_material(trc_scene scene, uint32_t type, float grey, float roughness, float ior) {
    const bool is_glass = type == TRC_NODE_GLASS, is_plain = type == TRC_NODE_TRANSPARENT;
    const uint32_t count = is_plain ? 1 : is_glass || type == TRC_NODE_GLOSSY ? 6 : 3;
    trc_node_input inputs[6] = {{.node = -1, .value = {grey, 0.8f * grey, 0.6f * grey}},
                                {.node = -1, .value = {roughness}},
                                {.node = -1, .value = {is_glass ? ior : 0.0f}},
                                {.node = is_glass ? -2 : -1},
                                {.node = is_glass ? -1 : -2},
                                {.node = is_glass ? -1 : -2}};
    if (type == TRC_NODE_DIFFUSE)
        inputs[2].node = -2;
    const trc_node node = {.type = type, .input_count = count};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 1,
                                    .nodes = &node,
                                    .inputs = inputs,
                                    .input_count = count};
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* A cube scaled to half sizes x, y, z around a place, which moves along x while the shutter is
 * open. */
static void add_box(trc_scene scene, const float place[3], const float half[3], float way,
                    trc_id material) {
    float transforms[24] = {0};
    for (int key = 0; key < 2; key++)
        for (int k = 0; k < 3; k++) {
            transforms[12 * key + 5 * k] = half[k];
            transforms[12 * key + 4 * k + 3] = place[k] + (k == 0 && key == 1 ? way : 0.0f);
        }
    const trc_mesh_desc mesh = default_mesh_desc();
    trc_id mesh_id = 0, instance_id = 0;
    assert_ok(trc_mesh_create(scene, &mesh, &mesh_id));
    trc_instance_desc instance = default_instance_desc(mesh_id);
    instance.transforms = transforms;
    instance.key_count = way != 0.0f ? 2 : 1;
    instance.materials = &material;
    instance.material_count = 1;
    assert_ok(trc_instance_create(scene, &instance, &instance_id));
}

/* Mirrors, gloss, glass, a veil and a box in motion under an area light, through a lens. */
static trc_scene gallery(void) {
    const trc_scene_desc scene_desc = default_scene_desc();
    trc_scene scene = 0;
    assert_ok(trc_scene_create(&scene_desc, &scene));
    add_box(scene, (float[3]){0, 0, -1.5f}, (float[3]){4, 4, 0.1f}, 0.0f,
            add_material(scene, TRC_NODE_DIFFUSE, 0.7f, 0.0f, 0.0f));
    add_box(scene, (float[3]){-1.2f, 1.0f, -0.5f}, (float[3]){0.6f, 0.7f, 0.9f}, 0.0f,
            add_material(scene, TRC_NODE_GLOSSY, 0.9f, 0.0f, 0.0f));
    add_box(scene, (float[3]){1.2f, 1.0f, -0.5f}, (float[3]){0.7f, 0.6f, 0.8f}, 0.0f,
            add_material(scene, TRC_NODE_GLOSSY, 0.8f, 0.3f, 0.0f));
    add_box(scene, (float[3]){-1.1f, -1.1f, -0.4f}, (float[3]){0.6f, 0.6f, 0.6f}, 0.0f,
            add_material(scene, TRC_NODE_GLASS, 0.9f, 0.1f, 1.5f));
    add_box(scene, (float[3]){0.8f, -1.1f, -0.4f}, (float[3]){0.5f, 0.5f, 0.5f}, 0.6f,
            add_material(scene, TRC_NODE_DIFFUSE, 0.5f, 0.4f, 0.0f));
    add_box(scene, (float[3]){0.3f, 0.2f, 1.0f}, (float[3]){1.0f, 0.5f, 0.02f}, 0.0f,
            add_material(scene, TRC_NODE_TRANSPARENT, 0.6f, 0.0f, 0.0f));
    trc_light_desc light = default_light_desc();
    light.transform[3] = 1.5f;
    light.strength = 500.0f;
    trc_id id = 0;
    assert_ok(trc_light_create(scene, &light, &id));
    trc_camera_desc camera = default_camera_desc();
    camera.aperture_radius = 0.1f;
    camera.shutter_time = 1.0f;
    assert_ok(trc_scene_set_camera(scene, &camera));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

static void render(trc_scene scene, const trc_render_desc *desc, float *pixels) {
    trc_render id = 0;
    assert_ok(trc_render_start(scene, desc, &id));
    assert_ok(trc_render_wait(id, INFINITY));
    assert_ok(trc_render_read(id, TRC_PASS_COMBINED, pixels, FLOATS));
    assert_ok(trc_render_destroy(id));
}

static float largest_difference(const float *a, const float *b) {
    float largest = 0.0f;
    for (int i = 0; i < FLOATS; i++)
        largest = fmaxf(largest, fabsf(a[i] - b[i]) / (1.0f + fabsf(b[i])));
    return largest;
}

static void assemblies_agree(void **state) {
    (void)state;
    static const uint32_t sizes[] = {0, 4, 16, 64, 256};
    static float expected[FLOATS], found[FLOATS];
    const trc_scene scene = gallery();
    float largest = 0.0f;
    for (uint32_t integrator = TRC_INTEGRATOR_RAYCAST; integrator <= TRC_INTEGRATOR_DISTRIBUTION;
         integrator++) {
        trc_render_desc desc = default_render_desc(SIDE_PX, SIDE_PX, SAMPLES);
        desc.integrator = integrator;
        render(scene, &desc, expected);
        float brightest = 0.0f;
        for (int i = 0; i < FLOATS; i++)
            brightest = fmaxf(brightest, i % 4 == 3 ? 0.0f : expected[i]);
        if (brightest < 0.1f) /* there must be a picture to agree on */
            fail_msg("integrator %u: nothing brighter than %g", integrator, (double)brightest);
        for (uint32_t assembly = TRC_ASSEMBLY_AUTO; assembly <= TRC_ASSEMBLY_NONE; assembly++)
            for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
                desc.assembly = assembly;
                desc.packet_size = sizes[s];
                render(scene, &desc, found);
                const float difference = largest_difference(found, expected);
                largest = fmaxf(largest, difference);
                if (!(difference <= TOLERANCE))
                    fail_msg("integrator %u, assembly %u, packets of %u: %g off", integrator,
                             assembly, sizes[s], (double)difference);
            }
    }
    print_figure("assemblies and sizes of packets", "pictures differ by %.1e at most",
                 (double)largest);
    assert_ok(trc_scene_destroy(scene));
}

/* Where bounces are used up, what is transparent still lets the light behind it through: from above
 * a veil to a mirror, through the veil again, to a ceiling that shines. */
static void last_bounces_go_straight(void **state) {
    (void)state;
    static float pixels[FLOATS];
    const float wide[3] = {20, 20, 0.1f}, veil = 0.9f, mirror = 0.95f;
    const trc_scene_desc scene_desc = default_scene_desc();
    trc_scene scene = 0;
    assert_ok(trc_scene_create(&scene_desc, &scene));
    struct default_material shining;
    default_material_init(&shining, TRC_NODE_EMISSION);
    trc_id emission = 0;
    assert_ok(trc_material_create(scene, &shining.desc, &emission));
    add_box(scene, (float[3]){0, 0, 8}, wide, 0.0f, emission);
    add_box(scene, (float[3]){0, 0, 1}, wide, 0.0f,
            add_material(scene, TRC_NODE_TRANSPARENT, veil, 0.0f, 0.0f));
    add_box(scene, (float[3]){0, 0, -1}, wide, 0.0f,
            add_material(scene, TRC_NODE_GLOSSY, mirror, 0.0f, 0.0f));
    const trc_camera_desc camera = default_camera_desc();
    assert_ok(trc_scene_set_camera(scene, &camera));
    assert_ok(trc_scene_commit(scene));
    for (uint32_t integrator = TRC_INTEGRATOR_WHITTED; integrator <= TRC_INTEGRATOR_DISTRIBUTION;
         integrator++) {
        trc_render_desc desc = default_render_desc(SIDE_PX, SIDE_PX, 1);
        desc.integrator = integrator;
        desc.max_depth = 1;
        desc.attenuation_cutoff = 0.0f;
        render(scene, &desc, pixels);
        for (int i = 0; i < FLOATS; i++) {
            static const float tint[4] = {1.0f, 0.8f, 0.6f, 1.0f};
            const float through = veil * tint[i % 4], back = mirror * tint[i % 4];
            const float expected = i % 4 == 3 ? 1.0f : 0.5f * back * powf(through, 4.0f);
            if (fabsf(pixels[i] - expected) > 1e-6f)
                fail_msg("integrator %u: %g, not %g", integrator, (double)pixels[i],
                         (double)expected);
        }
    }
    assert_ok(trc_scene_destroy(scene));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(assemblies_agree),
        cmocka_unit_test(last_bounces_go_straight),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("assemblies", tests, NULL, NULL);
}
