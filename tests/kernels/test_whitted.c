/* Whitted's trees of rays: whole, however many rays wait. A closed room of mirrors whose pictures
 * and counts of rays are known from following the one path that all rays of a tree share. */
#include "level_test.h"

/* Each wall has so many ideal lobes of that weight: more rays than any stack of the tile's rays
 * would hold at once if steps took all they can. */
#define LOBES 3
#define LOBE_WEIGHT 0.34f
#define CUTOFF 0.01f
#define LAST_BOUNCE 4 /* .34^5 is below the cutoff */
#define TREE_RAYS (3 + 9 + 27 + 81)

enum { SIZE = 64, FRAME = SIZE * SIZE };

/* The room, with the camera above its middle. */
static const float bounds[2][3] = {{-3.0f, -2.5f, -2.0f}, {2.5f, 3.0f, 7.0f}};

static void wall_emission(int axis, int side, float rgb[3]) {
    for (int c = 0; c < 3; c++)
        rgb[c] = 0.1f + 0.2f * (float)((3 * axis + 2 * side + 5 * c) % 7);
}

static trc_id wall_material(trc_scene scene, const float emission[3]) {
    enum { INPUTS = 2 + 6 * LOBES + 2 * LOBES };
    trc_node nodes[1 + 2 * LOBES];
    trc_node_input inputs[INPUTS];
    uint32_t node = 0, input = 0;
    int32_t sum = 0;
    for (uint32_t i = 0; i < INPUTS; i++)
        inputs[i] = (trc_node_input){.node = -1};
    nodes[node++] = (trc_node){.type = TRC_NODE_EMISSION, .input_count = 2};
    memcpy(inputs[input++].value, emission, 3 * sizeof *emission);
    inputs[input++].value[0] = 1.0f;
    for (int lobe = 0; lobe < LOBES; lobe++) {
        nodes[node++] = (trc_node){.type = TRC_NODE_GLOSSY,
                                   .mode = TRC_DISTRIBUTION_SHARP,
                                   .first_input = input,
                                   .input_count = 6};
        for (int c = 0; c < 3; c++)
            inputs[input].value[c] = LOBE_WEIGHT;
        inputs[input + 4].node = inputs[input + 5].node = -2;
        input += 6;
        nodes[node++] =
            (trc_node){.type = TRC_NODE_ADD_SHADER, .first_input = input, .input_count = 2};
        inputs[input++].node = sum;
        inputs[input++].node = (int32_t)node - 2;
        sum = (int32_t)node - 1;
    }
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = node,
                                    .nodes = nodes,
                                    .inputs = inputs,
                                    .input_count = input,
                                    .surface = sum};
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

static trc_scene room(uint32_t flags) {
    const trc_scene scene = scene_create();
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            float corners[12], emission[3];
            for (int k = 0; k < 4; k++) {
                corners[3 * k + axis] = bounds[side][axis];
                corners[3 * k + u] = bounds[k == 1 || k == 2][u];
                corners[3 * k + v] = bounds[k >= 2][v];
            }
            wall_emission(axis, side, emission);
            fixture_flagged_quad(scene, corners, wall_material(scene, emission), flags);
        }
    const trc_camera_desc camera = default_camera_desc();
    set_camera(scene, &camera);
    return scene;
}

/* What a ray sees, in double; false where it passes near an edge. */
static bool follow(const double origin[3], const double direction[3], double radiance[3]) {
    double o[3], d[3], weight = 1.0;
    memcpy(o, origin, sizeof o);
    memcpy(d, direction, sizeof d);
    memset(radiance, 0, 3 * sizeof *radiance);
    for (int bounce = 0; bounce <= LAST_BOUNCE; bounce++) {
        double nearest = INFINITY, next = INFINITY;
        int axis = 0;
        for (int k = 0; k < 3; k++) {
            const double t = ((double)bounds[d[k] > 0.0][k] - o[k]) / d[k];
            next = t < nearest ? nearest : fmin(next, t);
            axis = t < nearest ? k : axis;
            nearest = fmin(nearest, t);
        }
        if (next - nearest < 1e-3)
            return false;
        float emission[3];
        wall_emission(axis, d[axis] > 0.0, emission);
        for (int c = 0; c < 3; c++)
            radiance[c] += weight * (double)emission[c];
        for (int k = 0; k < 3; k++)
            o[k] += nearest * d[k];
        o[axis] = (double)bounds[d[axis] > 0.0][axis];
        d[axis] = -d[axis];
        weight *= LOBES * (double)LOBE_WEIGHT;
    }
    return true;
}

static trc_render_desc whitted_desc(uint32_t samples) {
    trc_render_desc desc = render_desc(SIZE, samples);
    desc.filter_width = 1e-4f;
    desc.integrator = TRC_INTEGRATOR_WHITTED;
    desc.attenuation_cutoff = CUTOFF;
    desc.max_depth = 50;
    return desc;
}

static void whole_trees(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    const trc_scene scene = room(0);
    for (uint32_t samples = 1; samples <= 3; samples += 2) {
        const trc_render_desc desc = whitted_desc(samples);
        const trc_render_progress progress = render(scene, &desc, pixels);
        assert_int_equal(progress.rays_camera, FRAME * samples);
        uint32_t compared = 0;
        for (uint32_t i = 0; i < FRAME; i++) {
            const double origin[3] = {0.0, 0.0, (double)CAMERA_HEIGHT};
            const double direction[3] = {(i % SIZE + 0.5) / SIZE - 0.5,
                                         (i / SIZE + 0.5) / SIZE - 0.5, -1.0};
            double expected[3];
            if (!follow(origin, direction, expected))
                continue;
            compared++;
            for (uint32_t c = 0; c < 3; c++)
                if (fabs((double)pixels[4 * i + c] - expected[c]) > 1e-4 * expected[c])
                    fail_msg("pixel %u has %g, not %g", i, (double)pixels[4 * i + c], expected[c]);
        }
        assert_true(compared > FRAME * 9 / 10);
        /* Near edges rays may slip out of the room. */
        assert_in_range(progress.rays_reflection, compared * samples * TREE_RAYS,
                        FRAME * samples * TREE_RAYS);
    }
    assert_ok(trc_scene_destroy(scene));
}

/* Shadow catchers split the rays before they branch: two trees for each sample. */
static void two_trees(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    const trc_scene scene = room(TRC_INSTANCE_SHADOW_CATCHER);
    const trc_render_desc desc = whitted_desc(1);
    const trc_render_progress progress = render(scene, &desc, pixels);
    assert_in_range(progress.rays_reflection, 2 * FRAME * 9 / 10 * TREE_RAYS,
                    2 * FRAME * TREE_RAYS);
    assert_ok(trc_scene_destroy(scene));
}

/* A roof of radiance 1 over a rough mirror, as a lamp or as a surface that is no light. */
static trc_scene mirrored_roof(bool is_lamp) {
    const trc_scene scene = fixture_level_view();
    fixture_level(scene, 100.0f, 0.0f, fixture_glossy(scene, 0.8f, 0.3f));
    if (is_lamp) {
        trc_light_desc lamp = default_light_desc();
        trc_id id = 0;
        lamp.transform[11] = 3.0f;
        lamp.size_x = lamp.size_y = 20.0f;
        lamp.strength = 4.0f * 20.0f * 20.0f;
        assert_ok(trc_light_create(scene, &lamp, &id));
    } else {
        struct node_list list = {0};
        NODE_ADD(&list, TRC_NODE_EMISSION, 0, node_color(1, 1, 1), node_number(1.0f));
        fixture_level(scene, 10.0f, 3.0f, level_material(scene, &list, 0, 0));
    }
    assert_ok(trc_scene_commit(scene));
    return scene;
}

/* What a lamp of extent looks like in gloss is left to ideal rays, as of any surface that shines:
 * its samples add nothing there. */
static void lamps_are_mirrored_once(void **state) {
    (void)state;
    float pixels[2][4 * LEVEL_PIXELS];
    for (int is_lamp = 0; is_lamp < 2; is_lamp++) {
        const trc_scene scene = mirrored_roof(is_lamp);
        trc_render_desc desc = level_desc(4);
        desc.integrator = TRC_INTEGRATOR_WHITTED;
        render(scene, &desc, pixels[is_lamp]);
        assert_ok(trc_scene_destroy(scene));
    }
    for (int p = 0; p < LEVEL_PIXELS; p++) {
        assert_true(pixels[0][4 * p] > 0.5f);
        assert_float_equal(pixels[1][4 * p], pixels[0][4 * p], 1e-5f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(whole_trees), cmocka_unit_test(two_trees),
                                       cmocka_unit_test(lamps_are_mirrored_once)};
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("whitted", tests, NULL, NULL);
}
