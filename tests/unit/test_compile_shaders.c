/* The material compiler: what becomes of trees of shaders, what is known of them, and what shadow
 * rays need of them. */
#include "graph.h"

#include <math.h>

#include "model/nodes.h"

/* ---- the shader tree ---- */

static void test_mixes_become_weights(void **state) {
    (void)state;
    graph_clear();
    const int32_t a = add_diffuse(color(1, 0, 0)), b = add_diffuse(color(0, 1, 0));
    const int32_t c = add_diffuse(color(0, 0, 1));
    const int32_t inner = add_mix(value(.25f), a, b);
    const int32_t outer = add_mix(value(.5f), inner, c);
    ADD(TRC_NODE_ADD_SHADER, 0, link_to(outer, 0), link_to(a, 0));
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 3);
    float sum[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            sum[k] += m->leaves[i].weight.value * m->operands[m->leaves[i].first_operand + k].value;
        }
    }
    assert_true(sum[0] == 1.375f && sum[1] == .125f && sum[2] == .5f);
    trc_material_release(m);
}

static void test_factors_are_clamped(void **state) {
    (void)state;
    static const float factors[4] = {-3, 0, 1, 9};
    for (int i = 0; i < 4; i++) {
        graph_clear();
        const int32_t a = add_diffuse(color(1, 0, 0)), b = add_emission(color(0, 1, 0), 1);
        add_mix(value(factors[i]), a, b);
        assert_int_equal(traits(), i < 2 ? TRC_MATERIAL_HAS_DIFFUSE : TRC_MATERIAL_HAS_EMISSION);
    }
}

static void test_what_light_path_tells(void **state) {
    (void)state;
    static const uint32_t of_lobes = 1u << TRC_OUTPUT_OF(LIGHT_PATH, is_diffuse) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, is_glossy) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, is_reflection) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, is_transmission) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, ray_depth) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, diffuse_depth) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, glossy_depth) |
                                     1u << TRC_OUTPUT_OF(LIGHT_PATH, transmission_depth);
    for (uint32_t output = 0; output < TRC_OUTPUT_OF(LIGHT_PATH, end); output++) {
        graph_clear();
        const int32_t path = add(TRC_NODE_LIGHT_PATH, 0, 0, NULL);
        const int32_t a = add_diffuse(color(1, 0, 0)), b = add_emission(color(0, 1, 0), 1);
        add_mix(link_to(path, (int32_t)output), a, b);
        assert_int_equal(!(traits() & TRC_MATERIAL_READS_LOBES), !(of_lobes >> output & 1u));
    }
}

static void test_varying_factor(void **state) {
    (void)state;
    graph_clear();
    const int32_t path = add(TRC_NODE_LIGHT_PATH, 0, 0, NULL);
    const int32_t a = add_diffuse(color(1, 0, 0)), b = add_emission(color(0, 1, 0), 1);
    add_mix(link_to(path, 0), a, b);
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 2);
    assert_int_equal(m->has, TRC_MATERIAL_HAS_DIFFUSE | TRC_MATERIAL_HAS_EMISSION |
                                 TRC_MATERIAL_EMISSION_VARIES | TRC_MATERIAL_HAS_PROGRAM |
                                 TRC_MATERIAL_READS_LIGHT_PATH);
    struct trc_registers regs;
    struct trc_surface s = {.active = vm_all_set(), .path = TRC_VISIBLE_CAMERA};
    for (int camera = 0; camera < 2; camera++) {
        s.path = camera ? TRC_VISIBLE_CAMERA : TRC_VISIBLE_GLOSSY;
        trc_program_run_scalar(m, &s, &regs);
        for (int i = 0; i < 2; i++) {
            const bool is_second = m->leaves[i].type == TRC_NODE_EMISSION;
            assert_true(trc_operand_value(&m->leaves[i].weight, &regs) == (is_second == camera));
        }
    }
    trc_material_release(m);
}

static void test_shaders_without_effect(void **state) {
    (void)state;
    graph_clear();
    add_emission(color(1, 1, 1), 0);
    assert_int_equal(traits(), 0);
    graph_clear();
    add_emission(color(0, 0, 0), 3);
    assert_int_equal(traits(), 0);
    graph_clear();
    ADD(TRC_NODE_TRANSPARENT, 0, color(0, 0, 0));
    assert_int_equal(traits(), 0);
    graph_clear(); /* an empty socket */
    ADD(TRC_NODE_MIX_SHADER, 0, value(.5f), value(0), value(0));
    assert_int_equal(traits(), 0);
}

/* ---- traits ---- */

enum {
    D = TRC_MATERIAL_HAS_DIFFUSE,
    S = TRC_MATERIAL_HAS_SPECULAR,
    G = TRC_MATERIAL_HAS_GLOSSY,
    R = TRC_MATERIAL_HAS_REFRACTION | TRC_MATERIAL_LIT_BELOW,
    T = TRC_MATERIAL_HAS_TRANSPARENCY | TRC_MATERIAL_CLEARS_SHADOWS,
    E = TRC_MATERIAL_HAS_EMISSION
};

static void test_traits_of_principled(void **state) {
    (void)state;
    static const struct {
        uint32_t mode;
        struct {
            uint32_t input;
            float value;
        } changes[4];
        uint32_t has;
    } cases[] = {
        {0, {{0, .8f}}, D | G},
        {0, {{4, 0}}, D},          /* no specular */
        {0, {{3, 1}}, G},          /* metal */
        {0, {{3, 1}, {6, 0}}, S},  /* polished */
        {0, {{6, .0177f}}, D | S}, /* alpha^2 below 1e-7 */
        {0, {{6, .0179f}}, D | G},
        {0, {{4, 0}, {11, 1}}, D | G}, /* clearcoat alone */
        {0, {{4, 0}, {11, 1}, {12, 0}}, D | S},
        {0, {{14, 1}}, G | R}, /* glass */
        {0, {{14, 1}, {6, 0}}, S | R},
        {0, {{14, 1}, {6, 0}, {15, .5f}}, S | G | R}, /* rough refraction only */
        {1, {{14, 1}, {6, 0}, {15, .5f}}, S | R},     /* which multiscatter ignores */
        {0, {{14, 1}, {3, 1}}, G},                    /* metal rules */
        {0, {{14, .5f}}, D | G | R},
        {0, {{18, .5f}}, D | G | T},
        {0, {{18, 0}}, T},
        {0, {{18, 2}}, D | G},
        {0, {{16, 1}}, D | G | E},
        {0, {{16, 1}, {17, 0}}, D | G},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        graph_clear();
        const int32_t node = add_principled(cases[i].mode);
        for (int k = 0; k < 4; k++) {
            if (k && !cases[i].changes[k].input)
                continue;
            *input_of(node, cases[i].changes[k].input) = value(cases[i].changes[k].value);
        }
        const uint32_t has = traits();
        if (has != cases[i].has)
            fail_msg("case %zu: %#x, not %#x", i, has, cases[i].has);
    }
}

/* An input that a program computes may have any value. */
static void test_traits_of_varying_inputs(void **state) {
    (void)state;
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL), node = add_principled(0);
    static const uint32_t inputs[] = {3, 6, 14, 18};
    for (int i = 0; i < 4; i++)
        *input_of(node, inputs[i]) = link_to(info, 5);
    assert_int_equal(traits(), D | S | G | R | T | TRC_MATERIAL_HAS_PROGRAM);
}

static void test_traits_of_simple_shaders(void **state) {
    (void)state;
    const trc_node_input white = color(1, 1, 1), n = standard();
    graph_clear();
    ADD(TRC_NODE_GLOSSY, TRC_DISTRIBUTION_SHARP, white, value(.5f), value(0), value(0), n, n);
    assert_int_equal(traits(), S);
    graph_clear();
    ADD(TRC_NODE_GLASS, TRC_DISTRIBUTION_GGX, white, value(-.5f), value(1.5f), n, value(0),
        value(0));
    assert_int_equal(traits(), G | R); /* the square of the roughness counts */
    graph_clear();
    ADD(TRC_NODE_REFRACTION, TRC_DISTRIBUTION_GGX, white, value(.5f), value(1.5f), n);
    assert_int_equal(traits(), G | R);
    graph_clear();
    ADD(TRC_NODE_TRANSPARENT, 0, white);
    assert_int_equal(traits(), T);
    graph_clear();
    ADD(TRC_NODE_TRANSLUCENT, 0, white, n);
    assert_int_equal(traits(), TRC_MATERIAL_HAS_TRANSLUCENT | TRC_MATERIAL_LIT_BELOW);
    graph_clear();
    add(TRC_NODE_HOLDOUT, 0, 0, NULL);
    assert_int_equal(traits(), TRC_MATERIAL_HAS_HOLDOUT);

    /* Ellipses are clear beside themselves, but to shadow rays. */
    trc_node_input strand[TRC_INPUT_OF(HUANG_HAIR, end)];
    for (size_t i = 0; i < sizeof strand / sizeof *strand; i++)
        strand[i] = value(1.0f);
    graph_clear();
    add(TRC_NODE_HUANG_HAIR, 0, TRC_INPUT_OF(HUANG_HAIR, end), strand);
    assert_int_equal(traits(), G | R | TRC_MATERIAL_READS_PIXEL);
    strand[TRC_INPUT_OF(HUANG_HAIR, aspect_ratio)] = value(0.5f);
    graph_clear();
    add(TRC_NODE_HUANG_HAIR, 0, TRC_INPUT_OF(HUANG_HAIR, end), strand);
    assert_int_equal(traits(), G | R | TRC_MATERIAL_READS_PIXEL | TRC_MATERIAL_HAS_TRANSPARENCY);

    /* Of what cuts out, transparency alone is left. */
    graph_clear();
    graph.flags = TRC_MATERIAL_CUTS_OUT;
    const int32_t light = ADD(TRC_NODE_EMISSION, 0, white, value(2));
    ADD(TRC_NODE_ADD_SHADER, 0, link_to(light, 0), link_to(add_diffuse(white), 0));
    assert_int_equal(traits(), TRC_MATERIAL_HAS_HOLDOUT);
    const int32_t clear = ADD(TRC_NODE_TRANSPARENT, 0, white);
    ADD(TRC_NODE_ADD_SHADER, 0, link_to(light, 0), link_to(clear, 0));
    assert_int_equal(traits(), TRC_MATERIAL_HAS_HOLDOUT | TRC_MATERIAL_HAS_TRANSPARENCY |
                                   TRC_MATERIAL_CLEARS_SHADOWS);
    graph.flags = 0;
    graph_clear();
    ADD(TRC_NODE_BACKGROUND, 0, white, value(2));
    assert_int_equal(traits(), E);
}

/* Fibres that reflect are lit from below without a light tree; those that transmit always. */
static void test_traits_of_hair(void **state) {
    (void)state;
    static const struct {
        uint32_t mode, flags, has;
    } cases[] = {
        {TRC_HAIR_REFLECTION, 0, G | R},
        {TRC_HAIR_REFLECTION, TRC_MATERIAL_DEFENSIVE_SAMPLING, G | R},
        {TRC_HAIR_REFLECTION, TRC_MATERIAL_LIGHT_TREE, G | TRC_MATERIAL_HAS_REFRACTION},
        {TRC_HAIR_TRANSMISSION, 0, G | R},
        {TRC_HAIR_TRANSMISSION, TRC_MATERIAL_LIGHT_TREE, G | R},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        graph_clear();
        ADD(TRC_NODE_HAIR, cases[i].mode, color(1, 1, 1), value(0), value(.2f), value(.2f),
            standard());
        graph.flags = cases[i].flags;
        assert_int_equal(traits(), cases[i].has);
    }
}

static void test_emission_of_principled(void **state) {
    (void)state;
    graph_clear();
    const int32_t node = add_principled(0);
    *input_of(node, TRC_INPUT_OF(PRINCIPLED, emission)) = color(1, .5f, 0);
    *input_of(node, TRC_INPUT_OF(PRINCIPLED, emission_strength)) = value(4);
    *input_of(node, TRC_INPUT_OF(PRINCIPLED, alpha)) = value(.5f);
    struct trc_material *m = compiled();
    assert_true(m->emission[0] == 2 && m->emission[1] == 1 && m->emission[2] == 0);
    trc_material_release(m);
}

/* Anisotropy without a tangent gets the default one; else nothing runs. */
static void test_default_tangent(void **state) {
    (void)state;
    for (int anisotropic = 0; anisotropic < 2; anisotropic++) {
        graph_clear();
        *input_of(add_principled(0), TRC_INPUT_OF(PRINCIPLED, anisotropic)) =
            value(anisotropic ? .5f : 0);
        struct trc_material *m = compiled();
        const struct trc_operand *tangent =
            &m->operands[m->leaves[0].first_operand + TRC_AT(PRINCIPLED, tangent)];
        assert_int_equal(m->instruction_count, anisotropic);
        assert_true(anisotropic ? tangent->reg >= 0 : tangent->reg == TRC_REG_DEFAULT);
        trc_material_release(m);
    }
}

/* ---- what shadow rays need ---- */

static int32_t add_transparent(trc_node_input c) { return ADD(TRC_NODE_TRANSPARENT, 0, c); }

/* What a leaf lets through, where the random number of the object is that. */
static float leaf_weight(const struct trc_material *m, uint32_t leaf, float random) {
    struct trc_instance instance = {.random = random};
    struct trc_mesh mesh = {.default_uv = -1}, *meshes[1] = {&mesh};
    const struct trc_snapshot snapshot = {
        .instance_count = 1, .instances = &instance, .mesh_count = 1, .meshes = meshes};
    struct trc_surface s = {.snapshot = &snapshot, .active = vm_all_set()};
    static struct trc_registers regs;
    trc_program_run_scalar(m, &s, &regs);
    return trc_operand_value(&m->leaves[leaf].weight, &regs);
}

/* Alpha, but not the colour beside it. */
static void test_shadows_of_principled(void **state) {
    (void)state;
    static const float alphas[] = {-0.5f, 0.0f, 0.25f, 1.0f, 1.5f};
    graph_clear();
    graph.flags = TRC_MATERIAL_TRANSPARENT_SHADOW;
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    const int32_t image = add_image(3, "");
    const int32_t principled = add_principled(0);
    *input_of(principled, TRC_INPUT_OF(PRINCIPLED, base_color)) = link_to(image, 0);
    *input_of(principled, TRC_INPUT_OF(PRINCIPLED, alpha)) = link_to(info, 5);
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_IMAGE), 1);
    assert_non_null(m->shadow);
    assert_int_equal(count_op(m->shadow, TRC_OP_IMAGE), 0);
    assert_int_equal(m->shadow->leaf_count, 1);
    assert_int_equal(m->shadow->leaves[0].type, TRC_NODE_TRANSPARENT);
    for (size_t i = 0; i < sizeof alphas / sizeof *alphas; i++) {
        const float want = 1.0f - fminf(fmaxf(alphas[i], 0.0f), 1.0f);
        assert_true(leaf_weight(m->shadow, 0, alphas[i]) == want);
    }
    trc_material_release(m);
}

static void test_shadows_of_mixes(void **state) {
    (void)state;
    graph_clear();
    graph.flags = TRC_MATERIAL_TRANSPARENT_SHADOW;
    const int32_t clear = add_transparent(color(.2f, .4f, .6f));
    const int32_t principled = add_principled(0);
    *input_of(principled, TRC_INPUT_OF(PRINCIPLED, alpha)) = value(.5f);
    const int32_t both = add_mix(value(.25f), clear, principled);
    add_mix(value(.5f), both, add_diffuse(color(1, 1, 1)));
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 3);
    assert_non_null(m->shadow);
    assert_int_equal(m->shadow->instruction_count, 0);
    assert_int_equal(m->shadow->leaf_count, 2);
    float sum[3] = {0};
    for (uint32_t i = 0; i < 2; i++)
        for (int c = 0; c < 3; c++)
            sum[c] += m->shadow->leaves[i].weight.value *
                      m->shadow->operands[m->shadow->leaves[i].first_operand + c].value;
    for (int c = 0; c < 3; c++) /* half of .75 of the colour and of .25 of .5 */
        assert_float_equal(sum[c], .375f * .2f * (float)(c + 1) + .0625f, 1e-6);
    trc_material_release(m);
}

/* Where it is opaque, or nothing but what shadow rays pass. */
static void test_materials_without_shadows_of_their_own(void **state) {
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        graph_clear();
        graph.flags = TRC_MATERIAL_TRANSPARENT_SHADOW;
        if (kind == 0)
            *input_of(add_principled(0), TRC_INPUT_OF(PRINCIPLED, alpha)) = value(1.0f);
        else
            add_transparent(color(.5f, .5f, .5f));
        struct trc_material *m = compiled();
        assert_null(m->shadow);
        trc_material_release(m);
    }
}

/* Of what is opaque to shadow rays, rays of lobes ask what they pass. */
static void test_opaque_shadows(void **state) {
    (void)state;
    graph_clear();
    graph.flags = 0;
    *input_of(add_principled(0), TRC_INPUT_OF(PRINCIPLED, alpha)) = value(.5f);
    struct trc_material *m = compiled();
    assert_non_null(m->shadow);
    assert_true(trc_material_is_clear(m) && !trc_material_shadows_transparent(m));
    trc_material_release(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mixes_become_weights),
        cmocka_unit_test(test_factors_are_clamped),
        cmocka_unit_test(test_what_light_path_tells),
        cmocka_unit_test(test_varying_factor),
        cmocka_unit_test(test_shaders_without_effect),
        cmocka_unit_test(test_traits_of_principled),
        cmocka_unit_test(test_traits_of_varying_inputs),
        cmocka_unit_test(test_traits_of_simple_shaders),
        cmocka_unit_test(test_traits_of_hair),
        cmocka_unit_test(test_emission_of_principled),
        cmocka_unit_test(test_default_tangent),
        cmocka_unit_test(test_shadows_of_principled),
        cmocka_unit_test(test_shadows_of_mixes),
        cmocka_unit_test(test_materials_without_shadows_of_their_own),
        cmocka_unit_test(test_opaque_shadows),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
