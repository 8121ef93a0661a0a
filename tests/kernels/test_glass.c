/* Glass beside exact values: what the camera sees reflected and refracted at its first hit, where
 * both may be followed, and behind something clear, where one of them is. */
#include "figures.h"
#include "node_list.h"
#include "picture_test.h"

/* A strip of a pane about the origin, seen from straight above in parallel rays; below it shines
 * the floor, above the camera a ceiling. */
enum { SIDE = 16, FRAME = SIDE * SIDE };
#define HALF 0.1f
#define BELOW 1.0f
#define ABOVE 5.0f
#define IOR 1.5
/* Of light that meets glass at a right angle. */
#define REFLECTED ((IOR - 1.0) * (IOR - 1.0) / ((IOR + 1.0) * (IOR + 1.0)))

struct glass {
    const char *name;
    uint32_t mode;
    float roughness;
    bool has_mirror; /* with a weak mirror before it, which is a third lobe */
};

static trc_id add_glass(trc_scene scene, const struct glass *glass) {
    struct node_list list = {0};
    uint32_t sum = NODE_ADD(&list, TRC_NODE_GLASS, glass->mode, node_color(1, 1, 1),
                            node_number(glass->roughness), node_number((float)IOR), node_standard(),
                            node_number(0.0f), node_number(1.0f));
    if (glass->has_mirror) {
        const uint32_t mirror =
            NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_SHARP, node_color(0.1f, 0.1f, 0.1f),
                     node_number(0.0f), node_number(0.0f), node_number(0.0f), node_standard(),
                     node_standard());
        sum = NODE_ADD(&list, TRC_NODE_ADD_SHADER, 0, node_link(sum, 0), node_link(mirror, 0));
    }
    const trc_material_desc desc = node_list_material(&list, sum);
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

static void render_pane(const struct glass *glass, bool is_behind_clear, uint32_t samples,
                        float pixels[4 * FRAME]) {
    const float h = 50.0f, z = 4.0f;
    const float ceiling[12] = {-h, -h, z, -h, h, z, h, h, z, h, -h, z};
    const trc_scene scene = scene_create();
    fixture_look_down(scene, 0.0f, 3.0f, HALF, HALF);
    fixture_level(scene, 1.0f, 0.0f, add_glass(scene, glass));
    fixture_level(scene, 1.0f, -0.05f, fixture_material(scene, TRC_NODE_EMISSION, BELOW));
    fixture_quad(scene, ceiling, fixture_material(scene, TRC_NODE_EMISSION, ABOVE));
    if (is_behind_clear)
        fixture_level(scene, HALF + 0.02f, 2.0f, fixture_clear(scene));
    assert_ok(trc_scene_commit(scene));
    const trc_render_desc desc = render_desc(SIDE, samples);
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
}

struct mean {
    double value, error; /* and its standard error by the pixels */
};

static struct mean mean_of(const float *pixels) {
    double sum = 0.0, sum2 = 0.0;
    for (int p = 0; p < FRAME; p++) {
        sum += (double)pixels[4 * p] / FRAME;
        sum2 += (double)pixels[4 * p] * (double)pixels[4 * p] / FRAME;
    }
    return (struct mean){sum, sqrt(fmax(sum2 - sum * sum, 0.0) / (FRAME - 1))};
}

static const struct glass sharp = {"sharp", TRC_DISTRIBUTION_SHARP, 0.0f, false};

/* The mean is the same whether one lobe is followed or two are. */
static void lobes_have_their_weights(void **state) {
    (void)state;
    static const struct glass glasses[] = {
        {"sharp", TRC_DISTRIBUTION_SHARP, 0.0f, false},
        {"sharp, and a mirror", TRC_DISTRIBUTION_SHARP, 0.0f, true},
        {"GGX", TRC_DISTRIBUTION_GGX, 0.5f, false},
        {"GGX, and a mirror", TRC_DISTRIBUTION_GGX, 0.5f, true},
        {"Beckmann", TRC_DISTRIBUTION_BECKMANN, 0.3f, false},
        {"multiple GGX", TRC_DISTRIBUTION_MULTI_GGX, 0.5f, false},
        {"multiple GGX, and a mirror", TRC_DISTRIBUTION_MULTI_GGX, 0.5f, true},
        {"correlated GGX", TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_CORRELATED, 0.5f, false},
    };
    static float pixels[4 * FRAME];
    for (size_t k = 0; k < sizeof glasses / sizeof *glasses; k++) {
        const struct glass *glass = &glasses[k];
        render_pane(glass, false, 1024, pixels);
        const struct mean seen = mean_of(pixels);
        render_pane(glass, true, 1024, pixels);
        const struct mean behind = mean_of(pixels);
        printf("  %s: %.5f +- %.5f seen directly, %.5f +- %.5f behind something clear\n",
               glass->name, seen.value, seen.error, behind.value, behind.error);
        /* A wrong weight of either is several per cent. */
        assert_true(seen.error < 1e-3 && behind.error < 3e-3);
        assert_true(fabs(seen.value - behind.value) <=
                    5.0 * hypot(seen.error, behind.error) + 1e-5);
        if (glass->roughness > 0.0f)
            continue;
        const double mirror = glass->has_mirror ? 0.1 : 0.0;
        const double want =
            (1.0 - REFLECTED) * (double)BELOW + (REFLECTED + mirror) * (double)ABOVE;
        assert_true(fabs(seen.value - want) <= 5.0 * seen.error + 1e-5);
        assert_true(fabs(behind.value - want) <= 5.0 * behind.error + 1e-5);
    }
}

/* Each sample of what the camera sees has all that glass refracts, and some have a reflection
 * besides; behind something clear a sample has either. */
static void refraction_is_always_seen(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    const double refracted = (1.0 - REFLECTED) * (double)BELOW;
    int refracts = 0, reflects = 0, both = 0;
    render_pane(&sharp, false, 1, pixels);
    for (int p = 0; p < FRAME; p++) {
        refracts += fabs((double)pixels[4 * p] - refracted) < 1e-5;
        both += (double)pixels[4 * p] > refracted + 1e-5;
    }
    printf("  seen directly: %d pixels refract, %d reflect besides\n", refracts, both);
    assert_int_equal(refracts + both, FRAME);
    assert_in_range(both, 1, FRAME / 8);
    refracts = 0;
    render_pane(&sharp, true, 1, pixels);
    for (int p = 0; p < FRAME; p++) {
        refracts += fabs((double)pixels[4 * p] - (double)BELOW) < 1e-5;
        reflects += fabs((double)pixels[4 * p] - (double)ABOVE) < 1e-4;
    }
    printf("  behind something clear: %d pixels refract, %d reflect\n", refracts, reflects);
    assert_int_equal(refracts + reflects, FRAME);
    assert_in_range(reflects, 1, FRAME / 8);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lobes_have_their_weights),
        cmocka_unit_test(refraction_is_always_seen),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("glass", tests, NULL, NULL);
}
