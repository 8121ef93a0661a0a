/* Rough gloss beside integrals in double: light samples and continuation rays share the light of
 * what has extent, whatever their numbers; Filter Glossy. */
#include "figures.h"
#include "node_list.h"
#include "picture_test.h"

/* The picture: a strip of the floor z = 0 about the origin, seen from straight above in parallel
 * rays. */
enum { SIDE = 16, FRAME = SIDE * SIDE, SAMPLES = 256 };
#define HALF 0.1

#define ROUGHNESS 0.5
#define ALPHA (ROUGHNESS * ROUGHNESS)

/* What shines on it: a square beside the view, or a sky that shows its directions. */
static const double square_from[2] = {0.15, -0.4}, square_to[2] = {0.95, 0.4}, square_height = 1.0;

enum source { LAMP, MESH, SKY, SOURCES };
static const char *const source_names[] = {"lamp", "mesh", "sky"};

/* ---- the integral ---- */

static double masking(double alpha2, double cosine) {
    return 2.0 / (1.0 + sqrt(1.0 + alpha2 * (1.0 / (cosine * cosine) - 1.0)));
}

/* GGX with separable masking about z, from i to o, times the cosine of i: Walter et al. 2007,
 * equations 20, 33 and 34. */
static double gloss_towards(double alpha, const double o[3], const double i[3]) {
    double size2 = 0.0;
    for (int k = 0; k < 3; k++)
        size2 += (o[k] + i[k]) * (o[k] + i[k]);
    const double cos_h2 = (o[2] + i[2]) * (o[2] + i[2]) / size2, a2 = alpha * alpha;
    const double tan_h2 = (1.0 - cos_h2) / cos_h2;
    const double d = a2 / (PI * cos_h2 * cos_h2 * (a2 + tan_h2) * (a2 + tan_h2));
    return d * masking(a2, o[2]) * masking(a2, i[2]) / (4.0 * o[2]);
}

static double gloss(double alpha, const double i[3]) {
    static const double up[3] = {0, 0, 1};
    return gloss_towards(alpha, up, i);
}

/* Of unit radiance from the square at a point of the floor. Quadratures are off by less than 1e-4
 * of their values. */
static double square_light(double x, double y) {
    enum { STEPS = 48 };
    double sum = 0.0;
    const double size[2] = {square_to[0] - square_from[0], square_to[1] - square_from[1]};
    for (int a = 0; a < STEPS; a++)
        for (int b = 0; b < STEPS; b++) {
            const double dx = square_from[0] + (a + 0.5) / STEPS * size[0] - x;
            const double dy = square_from[1] + (b + 0.5) / STEPS * size[1] - y;
            const double r2 = dx * dx + dy * dy + square_height * square_height, r = sqrt(r2);
            const double i[3] = {dx / r, dy / r, square_height / r};
            sum += gloss(ALPHA, i) * i[2] / r2;
        }
    return sum * size[0] * size[1] / (STEPS * STEPS);
}

/* Of a sky whose radiance is 1 + z, by the cosine z to the zenith. */
static double sky_light(void) {
    enum { STEPS = 1 << 14 };
    double sum = 0.0;
    for (int k = 0; k < STEPS; k++) {
        const double z = (k + 0.5) / STEPS, i[3] = {sqrt(1.0 - z * z), 0.0, z};
        sum += gloss(ALPHA, i) * (1.0 + z);
    }
    return sum * 2.0 * PI / STEPS;
}

/* ---- the picture ---- */

/* A background of radiance 1 + z of the direction. */
static void set_sky(trc_scene scene) {
    const trc_id sky =
        add_vector_shader(scene, TRC_NODE_BACKGROUND, TRC_NODE_TEXTURE_COORDINATE, 0.5f);
    const trc_world_desc world = default_world_desc(sky);
    assert_ok(trc_scene_set_world(scene, &world));
}

static void add_source(trc_scene scene, enum source source) {
    const float from[2] = {(float)square_from[0], (float)square_from[1]};
    const float to[2] = {(float)square_to[0], (float)square_to[1]}, z = (float)square_height;
    if (source == SKY) {
        set_sky(scene);
    } else if (source == MESH) {
        const float color[3] = {1, 1, 1};
        /* Clockwise from above: it faces the floor. */
        const float corners[12] = {from[0], from[1], z, from[0], to[1],   z,
                                   to[0],   to[1],   z, to[0],   from[1], z};
        fixture_quad(scene, corners, add_material(scene, TRC_NODE_EMISSION, color, 1.0f));
    } else {
        trc_light_desc desc = default_light_desc();
        trc_id id = 0;
        desc.size_x = to[0] - from[0];
        desc.size_y = to[1] - from[1];
        desc.transform[3] = 0.5f * (from[0] + to[0]);
        desc.transform[7] = 0.5f * (from[1] + to[1]);
        desc.transform[11] = z;
        /* A watt of an area light is a radiance of 1 / (4 area): Blender's units. */
        desc.strength = 4.0f * desc.size_x * desc.size_y;
        assert_ok(trc_light_create(scene, &desc, &id));
    }
}

static trc_scene floor_scene(enum source source, float value, bool is_behind_glass) {
    const trc_scene scene = scene_create();
    fixture_look_down(scene, 0.0f, 3.0f, (float)HALF, (float)HALF);
    fixture_level(scene, 1.0f, 0.0f, fixture_glossy(scene, value, (float)ROUGHNESS));
    add_source(scene, source);
    /* In the camera's way alone: what comes from the square passes below. */
    if (is_behind_glass)
        fixture_level(scene, (float)HALF + 0.02f, 2.0f, fixture_clear(scene));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

struct result {
    double ratio, error; /* of picture and integral, and its standard error by the pixels */
};

static struct result compare(trc_scene scene, enum source source, double value,
                             uint32_t light_samples) {
    static float pixels[4 * FRAME];
    trc_render_desc desc = render_desc(SIDE, SAMPLES);
    desc.light_samples = light_samples;
    render(scene, &desc, pixels);
    const double sky = source == SKY ? sky_light() : 0.0;
    double sum = 0.0, sum2 = 0.0;
    for (int p = 0; p < FRAME; p++) {
        const double x = HALF * ((p % SIDE + 0.5) * 2.0 / SIDE - 1.0);
        const double y = HALF * ((p / SIDE + 0.5) * 2.0 / SIDE - 1.0);
        /* The sky's colours are halves of 1 + the direction: blue is z. */
        const double want = value * (source == SKY ? 0.5 * sky : square_light(x, y));
        const double ratio = (double)pixels[4 * p + 2] / want;
        sum += ratio;
        sum2 += ratio * ratio;
    }
    const double mean = sum / FRAME;
    return (struct result){mean, sqrt(fmax(sum2 / FRAME - mean * mean, 0.0) / (FRAME - 1))};
}

/* Five standard errors, which must be less than what a fault of weights does: at 4 samples in 16,
 * where densities are alike, weights that do not add up are several per cent off. 2e-4: of the
 * integral. */
static void expect_light(const char *what, enum source source, float value, bool is_behind_glass) {
    static const uint32_t counts[] = {1, 4, 16};
    const trc_scene scene = floor_scene(source, value, is_behind_glass);
    for (int k = 0; k < 3; k++) {
        const struct result r = compare(scene, source, (double)value, counts[k]);
        printf("  %s, %s, %u light samples: %.4f +- %.4f of the integral\n", what,
               source_names[source], counts[k], r.ratio, r.error);
        assert_true(r.error < 2e-3);
        assert_true(fabs(r.ratio - 1.0) <= 5.0 * r.error + 2e-4);
    }
    assert_ok(trc_scene_destroy(scene));
}

static void weights_count_light_samples(void **state) {
    (void)state;
    for (enum source source = LAMP; source < SOURCES; source++)
        expect_light("seen directly", source, 1.0f, false);
}

/* A weak lobe's rays are sent now and then, which is in their density too. */
static void weights_count_rays_not_sent(void **state) {
    (void)state;
    for (enum source source = LAMP; source < SOURCES; source++)
        expect_light("weak", source, 0.05f, false);
}

/* What is behind something clear is still the camera's first hit. */
static void weights_pass_transparency(void **state) {
    (void)state;
    for (enum source source = LAMP; source < SOURCES; source++)
        expect_light("behind clear glass", source, 1.0f, true);
}

/* ---- Filter Glossy ---- */

/* A floor that reflects evenly into a cone about the mirror direction, which is a density that
 * needs no model; above, behind the camera, a ceiling of sharp gloss, lit by a point that the
 * floor's cone misses. */
#define CONE_ANGLE (PI / 6.0)
#define CEILING_ROUGHNESS 0.4
static const double point_at[3] = {0.6, 0.0, 0.05};

static trc_scene toon_and_ceiling(void) {
    const trc_node_input inputs[] = {{.node = -1, .value = {1, 1, 1}},
                                     {.node = -1, .value = {(float)(CONE_ANGLE * 2.0 / PI)}},
                                     {.node = -1},
                                     {.node = -2}};
    const trc_node toon = {.type = TRC_NODE_TOON, .mode = 1, .input_count = 4};
    const trc_material_desc toon_desc = {.struct_size = sizeof toon_desc,
                                         .node_count = 1,
                                         .nodes = &toon,
                                         .inputs = inputs,
                                         .input_count = 4};
    const trc_scene scene = scene_create();
    trc_id material = 0, light = 0;
    fixture_look_down(scene, 0.0f, 0.5f, 0.001f, 0.001f);
    assert_ok(trc_material_create(scene, &toon_desc, &material));
    fixture_level(scene, 0.5f, 0.0f, material);
    fixture_level(scene, 2.0f, 1.0f, fixture_glossy(scene, 1.0f, (float)CEILING_ROUGHNESS));
    trc_light_desc desc = default_light_desc();
    desc.type = TRC_LIGHT_POINT;
    for (int k = 0; k < 3; k++)
        desc.transform[4 * k + 3] = (float)point_at[k];
    desc.strength = (float)(4.0 * PI); /* an irradiance of 1 at a metre */
    assert_ok(trc_light_create(scene, &desc, &light));
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* Light from the ceiling, if it is as rough as that, by way of the floor: the mean over the
 * cone. */
static double filtered_light(double alpha) {
    enum { STEPS = 256 };
    double sum = 0.0;
    for (int a = 0; a < STEPS; a++)
        for (int b = 0; b < STEPS; b++) {
            const double c = 1.0 - (a + 0.5) / STEPS * (1.0 - cos(CONE_ANGLE));
            const double phi = 2.0 * PI * (b + 0.5) / STEPS, s = sqrt(1.0 - c * c);
            /* Seen from the ceiling, z downwards. */
            const double o[3] = {-s * cos(phi), -s * sin(phi), c};
            double i[3] = {point_at[0] + o[0] / c, point_at[1] + o[1] / c, 1.0 - point_at[2]};
            const double r2 = i[0] * i[0] + i[1] * i[1] + i[2] * i[2];
            for (int k = 0; k < 3; k++)
                i[k] /= sqrt(r2);
            sum += gloss_towards(alpha, o, i) / r2;
        }
    return sum / (STEPS * STEPS);
}

/* As in Cycles: after a bounce of density p, alpha is at least sqrt(1 - p / filter) / 2. */
static void filter_glossy(void **state) {
    (void)state;
    static const float filters[] = {0.0f, 0.5f, 1.5f, 3.0f, 10.0f};
    static float pixels[4 * FRAME];
    const trc_scene scene = toon_and_ceiling();
    const double density = 1.0 / (2.0 * PI * (1.0 - cos(CONE_ANGLE)));
    for (size_t n = 0; n < sizeof filters / sizeof *filters; n++) {
        trc_render_desc desc = render_desc(SIDE, SAMPLES);
        desc.filter_glossy = filters[n];
        desc.max_depth = 1;
        render(scene, &desc, pixels);
        const double rest = filters[n] > 0.0f ? 1.0 - density / (double)filters[n] : 0.0;
        const double least = 0.5 * sqrt(fmax(rest, 0.0));
        const double want = filtered_light(fmax(least, CEILING_ROUGHNESS * CEILING_ROUGHNESS));
        double sum = 0.0, sum2 = 0.0;
        for (int p = 0; p < FRAME; p++) {
            sum += (double)pixels[4 * p] / FRAME;
            sum2 += (double)pixels[4 * p] * (double)pixels[4 * p] / FRAME;
        }
        /* Five standard errors by the pixels; 2e-4: of the integral. */
        const double error = sqrt(fmax(sum2 - sum * sum, 0.0) / (FRAME - 1));
        printf("  filter %.1f: %.5f +- %.5f, %.5f expected\n", (double)filters[n], sum, error,
               want);
        assert_true(error < 2e-3 * want);
        assert_true(fabs(sum - want) <= 5.0 * error + 2e-4 * want);
    }
    assert_ok(trc_scene_destroy(scene));
}

/* Two weak mirrors, one leaning to each side, under walls of their own brightness: rays are sent
 * now and then. Those of the camera's first hits may follow both, others choose between them. */
static void expect_two_mirrors(bool is_behind_glass) {
    static const float left[12] = {-4, -9, -9, -4, -9, 9, -4, 9, 9, -4, 9, -9};
    static const float right[12] = {4, -9, -9, 4, 9, -9, 4, 9, 9, 4, -9, 9};
    static const float weights[2] = {0.002f, 0.005f}, walls[2] = {10.0f, 40.0f};
    static float pixels[4 * FRAME];
    const trc_scene scene = floor_scene(SOURCES, 0.0f, is_behind_glass);
    struct node_list list = {0};
    uint32_t mirrors[2];
    for (int k = 0; k < 2; k++) {
        const float x = k ? 0.6f : -0.6f;
        mirrors[k] = NODE_ADD(&list, TRC_NODE_GLOSSY, TRC_DISTRIBUTION_SHARP,
                              node_color(weights[k], weights[k], weights[k]), node_number(0.0f),
                              node_number(0.0f), node_number(0.0f), node_color(x, 0.0f, 0.8f),
                              node_standard());
    }
    const uint32_t sum =
        NODE_ADD(&list, TRC_NODE_ADD_SHADER, 0, node_link(mirrors[0], 0), node_link(mirrors[1], 0));
    const trc_material_desc both = node_list_material(&list, sum);
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &both, &id));
    fixture_level(scene, 1.0f, 0.1f, id);
    fixture_quad(scene, left, fixture_material(scene, TRC_NODE_EMISSION, walls[0]));
    fixture_quad(scene, right, fixture_material(scene, TRC_NODE_EMISSION, walls[1]));
    assert_ok(trc_scene_commit(scene));
    const trc_render_desc desc = render_desc(SIDE, 4 * SAMPLES);
    render(scene, &desc, pixels);
    const double want = (double)(weights[0] * walls[0] + weights[1] * walls[1]);
    double mean = 0.0, mean2 = 0.0;
    for (int p = 0; p < FRAME; p++) {
        mean += (double)pixels[4 * p] / FRAME;
        mean2 += (double)pixels[4 * p] * (double)pixels[4 * p] / FRAME;
    }
    const double error = sqrt(fmax(mean2 - mean * mean, 0.0) / (FRAME - 1));
    printf("  two weak mirrors%s: %.5f +- %.5f, %.5f expected\n",
           is_behind_glass ? " behind clear glass" : "", mean, error, want);
    assert_true(error < 0.005 * want);
    assert_true(fabs(mean - want) <= 5.0 * error + 1e-5);
    assert_ok(trc_scene_destroy(scene));
}

static void rays_sent_seldom_choose_all_lobes(void **state) {
    (void)state;
    expect_two_mirrors(false);
    expect_two_mirrors(true);
}

/* What a weak narrow lobe finds is not left to chance: with one sample a floor under a wide bright
 * ceiling has its share of it in nine pixels of ten. The others' directions are so far off the
 * mirror's that light samples have their weight. */
static void narrow_lobes_send_their_rays(void **state) {
    (void)state;
    static const float roughness[3] = {0.0f, 0.1f, 0.3f};
    static float pixels[4 * FRAME];
    const float weight = 0.05f, radiance = 10.0f;
    for (int k = 0; k < 3; k++) {
        const trc_scene scene = floor_scene(SOURCES, 0.0f, false);
        fixture_level(scene, 1.0f, 0.1f, fixture_glossy(scene, weight, roughness[k]));
        const float h = 50.0f, z = 4.0f;
        const float ceiling[12] = {-h, -h, z, -h, h, z, h, h, z, h, -h, z};
        fixture_quad(scene, ceiling, fixture_material(scene, TRC_NODE_EMISSION, radiance));
        assert_ok(trc_scene_commit(scene));
        const trc_render_desc desc = render_desc(SIDE, 1);
        render(scene, &desc, pixels);
        const double want = (double)(weight * radiance);
        int near = 0;
        for (int p = 0; p < FRAME; p++)
            near += fabs((double)pixels[4 * p] / want - 1.0) < 0.5;
        printf("  roughness %.1f: %d of %d pixels within a half of %.4f\n", (double)roughness[k],
               near, FRAME, want);
        assert_true(near > 0.9 * FRAME);
        assert_ok(trc_scene_destroy(scene));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_count_light_samples),
        cmocka_unit_test(weights_count_rays_not_sent),
        cmocka_unit_test(rays_sent_seldom_choose_all_lobes),
        cmocka_unit_test(narrow_lobes_send_their_rays),
        cmocka_unit_test(weights_pass_transparency),
        cmocka_unit_test(filter_glossy),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("gloss", tests, NULL, NULL);
}
