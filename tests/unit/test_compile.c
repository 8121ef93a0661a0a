/* The material compiler: what is refused, and what becomes of node lists. */
#include "graph.h"

#include <math.h>

#include "model/nodes.h"

/* ---- constants ---- */

static void test_constant_material(void **state) {
    (void)state;
    graph_clear();
    ADD(TRC_NODE_GLOSSY, TRC_DISTRIBUTION_BECKMANN, color(.1f, .2f, .3f), value(.4f), value(0),
        value(0), standard(), standard());
    graph.pass_index = 7;
    graph.flags = TRC_MATERIAL_SAMPLE_EMISSION;
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 1);
    assert_int_equal(m->instruction_count, 0);
    assert_int_equal(m->pass_index, 7);
    assert_int_equal(m->flags, TRC_MATERIAL_SAMPLE_EMISSION);
    const struct trc_leaf *leaf = &m->leaves[0];
    assert_int_equal(leaf->type, TRC_NODE_GLOSSY);
    assert_int_equal(leaf->mode, TRC_DISTRIBUTION_BECKMANN);
    assert_int_equal(leaf->operand_count, 12);
    assert_true(leaf->weight.reg == -1 && leaf->weight.value == 1.0f);
    const float expected[6] = {.1f, .2f, .3f, .4f, 0, 0};
    for (int i = 0; i < 6; i++) {
        const struct trc_operand o = m->operands[leaf->first_operand + i];
        assert_true(o.reg == -1 && o.value == expected[i]);
    }
    for (int i = 6; i < 12; i++)
        assert_int_equal(m->operands[leaf->first_operand + i].reg, TRC_REG_DEFAULT);
    trc_material_release(m);
}

static void test_empty_materials(void **state) {
    (void)state;
    graph_clear();
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 0);
    assert_int_equal(m->has, 0);
    trc_material_release(m);
    add_diffuse(color(1, 1, 1));
    graph.surface = -1;
    m = compiled();
    assert_int_equal(m->leaf_count, 0);
    trc_material_release(m);
}

/* (2 + 3) * 4 = 20, halved by a clamped mix, as strength of a red emission. */
static void test_folding(void **state) {
    (void)state;
    graph_clear();
    const int32_t sum = ADD(TRC_NODE_MATH, TRC_MATH_ADD, value(2), value(3), value(0));
    const int32_t product =
        ADD(TRC_NODE_MATH, TRC_MATH_MULTIPLY, link_to(sum, 0), value(4), value(0));
    const int32_t mix =
        ADD(TRC_NODE_MIX_COLOR, TRC_BLEND_MULTIPLY, value(7), link_to(product, 0), value(.5f));
    ADD(TRC_NODE_EMISSION, 0, color(1, 0, 0), link_to(mix, 0));
    struct trc_material *m = compiled();
    assert_int_equal(m->instruction_count, 0);
    assert_int_equal(m->has, TRC_MATERIAL_HAS_EMISSION);
    assert_true(fabsf(m->emission[0] - 10) < 1e-5f && m->emission[1] == 0 && m->emission[2] == 0);
    trc_material_release(m);
}

/* Colour to float is luminance, vector to float the mean, float to colour itself three times. */
static void test_conversions(void **state) {
    (void)state;
    const struct {
        uint32_t combine_mode;
        float expected;
    } cases[] = {{TRC_SEPARATE_RGB, .2126729f * .2f + .7151522f * .5f + .072175f * .8f},
                 {TRC_SEPARATE_XYZ, .5f}};
    for (int i = 0; i < 2; i++) {
        graph_clear();
        const int32_t c =
            ADD(TRC_NODE_COMBINE, cases[i].combine_mode, value(.2f), value(.5f), value(.8f));
        const int32_t f = ADD(TRC_NODE_MATH, TRC_MATH_ABSOLUTE, link_to(c, 0), value(0), value(0));
        add_emission(link_to(f, 0), 1);
        struct trc_material *m = compiled();
        for (int k = 0; k < 3; k++)
            assert_true(fabsf(m->emission[k] - cases[i].expected) < 1e-5f);
        trc_material_release(m);
    }
}

/* ---- sharing and dropping ---- */

static void test_equal_nodes_are_shared(void **state) {
    (void)state;
    graph_clear();
    const int32_t a = add_image(3, "map"), b = add_image(3, "map"), c = add_image(4, "map");
    const int32_t mix =
        ADD(TRC_NODE_MIX_COLOR, TRC_BLEND_ADD, value(.5f), link_to(a, 0), link_to(b, 0));
    const int32_t all =
        ADD(TRC_NODE_MIX_COLOR, TRC_BLEND_ADD, value(.5f), link_to(mix, 0), link_to(c, 0));
    add_diffuse(link_to(all, 0));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_UV), 1);
    assert_int_equal(count_op(m, TRC_OP_IMAGE), 2);
    assert_int_equal(count_op(m, TRC_OP_UV_DENSITY), 1);
    assert_int_equal(m->instruction_count, 6);
    assert_int_equal(m->has, TRC_MATERIAL_HAS_DIFFUSE | TRC_MATERIAL_HAS_PROGRAM |
                                 TRC_MATERIAL_HAS_TEXTURE | TRC_MATERIAL_READS_FOOTPRINT);
    trc_material_release(m);
}

/* One of 90 to 99 has no levels, whose choice then costs nothing. */
static void test_images_without_levels(void **state) {
    (void)state;
    graph_clear();
    add_diffuse(link_to(add_image(95, "map"), 0));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_IMAGE), 1);
    assert_int_equal(count_op(m, TRC_OP_UV_DENSITY), 0);
    assert_int_equal(m->has & TRC_MATERIAL_READS_FOOTPRINT, 0);
    trc_material_release(m);
}

/* Whether an image that is looked up at mapped UVs reads smaller levels. */
static bool mapped_image_has_density(uint32_t mode, float scale, float tilt) {
    graph_clear();
    const int32_t map = add(TRC_NODE_UV_MAP, 0, 0, NULL);
    graph.nodes[map].name = "map";
    const int32_t mapping = ADD(TRC_NODE_MAPPING, mode, link_to(map, 0), color(.1f, .2f, 0),
                                color(tilt, 0, .7f), color(scale, 2, 1));
    const int32_t node = ADD(TRC_NODE_IMAGE, 0, link_to(mapping, 0), value(0));
    graph.nodes[node].image = 3;
    add_diffuse(link_to(node, 0));
    struct trc_material *m = compiled();
    const bool found = count_op(m, TRC_OP_UV_DENSITY);
    trc_material_release(m);
    return found;
}

static void test_density_of_mapped_images(void **state) {
    (void)state;
    assert_true(mapped_image_has_density(0, 3, 0));
    assert_true(mapped_image_has_density(2, -1, 0));
    assert_false(mapped_image_has_density(1, 3, 0)); /* divides */
    assert_false(mapped_image_has_density(0, 0, 0));
    assert_false(mapped_image_has_density(0, 3, .5f)); /* foreshortens */
}

static void test_unreached_nodes_are_dropped(void **state) {
    (void)state;
    graph_clear();
    const int32_t image = add_image(3, "map");
    add(TRC_NODE_LIGHT_PATH, 0, 0, NULL);
    const int32_t lost = add_emission(link_to(image, 0), 5);
    const int32_t kept = add_diffuse(color(.5f, .5f, .5f));
    add_mix(value(0), kept, lost);
    struct trc_material *m = compiled();
    assert_int_equal(m->instruction_count, 0);
    assert_int_equal(m->leaf_count, 1);
    assert_int_equal(m->has, TRC_MATERIAL_HAS_DIFFUSE);
    trc_material_release(m);
}

/* An Image node divides by alpha only if alpha is used by what is reached. */
static void test_alpha_of_images(void **state) {
    (void)state;
    for (int used = 0; used < 2; used++) {
        graph_clear();
        const int32_t image = add_image(3, "");
        const int32_t principled = add_principled(0);
        *input_of(principled, TRC_INPUT_OF(PRINCIPLED, base_color)) = link_to(image, 0);
        if (used)
            *input_of(principled, TRC_INPUT_OF(PRINCIPLED, alpha)) = link_to(image, 1);
        struct trc_material *m = compiled();
        assert_int_equal(count_op(m, TRC_OP_IMAGE), 1);
        const struct trc_instruction *last = &m->instructions[m->instruction_count - 1];
        assert_int_equal(last->mode, TRC_IMAGE_EXTEND | (used ? TRC_IMAGE_MODE_ALPHA : 0u));
        assert_int_equal(last->resource, 3);
        assert_int_equal((m->has & TRC_MATERIAL_HAS_TRANSPARENCY) != 0, used);
        trc_material_release(m);
    }
}

static void test_unknown_images(void **state) {
    (void)state;
    static const trc_id ids[2] = {0, 1000};
    for (int i = 0; i < 2; i++) {
        graph_clear();
        add_diffuse(link_to(add_image(ids[i], NULL), 0));
        struct trc_material *m = compiled();
        assert_int_equal(m->instructions[1].resource, TRC_NO_RESOURCE);
        trc_material_release(m);
    }
}

static void test_ramps_share_tables(void **state) {
    (void)state;
    static float tables[3][4 * TRC_TABLE_ENTRIES];
    for (uint32_t i = 0; i < 4 * TRC_TABLE_ENTRIES; i++) {
        tables[0][i] = tables[1][i] = (float)i;
        tables[2][i] = -(float)i;
    }
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    int32_t ramp[3];
    for (int i = 0; i < 3; i++) {
        ramp[i] = ADD(TRC_NODE_COLOR_RAMP, 0, link_to(info, i == 1 ? 3 : 5));
        graph.nodes[ramp[i]].table = tables[i];
        graph.nodes[ramp[i]].table_count = 4 * TRC_TABLE_ENTRIES;
    }
    const int32_t mix =
        ADD(TRC_NODE_MIX_COLOR, 0, link_to(ramp[2], 1), link_to(ramp[0], 0), link_to(ramp[1], 0));
    add_diffuse(link_to(mix, 0));
    struct trc_material *m = compiled();
    assert_int_equal(m->table_count, 2 * 4 * TRC_TABLE_ENTRIES);
    assert_int_equal(count_op(m, TRC_OP_RAMP), 3);
    trc_material_release(m);
}

/* ---- limits ---- */

static void test_registers_are_reused(void **state) {
    (void)state;
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    int32_t last = info;
    for (int i = 0; i < 3000; i++) {
        last = ADD(TRC_NODE_MATH, TRC_MATH_MULTIPLY_ADD, link_to(last, i ? 0 : 5), value(.5f),
                   value((float)i));
    }
    add_diffuse(link_to(last, 0));
    struct trc_material *m = compiled();
    assert_int_equal(m->instruction_count, 3001);
    assert_int_equal(m->register_count, 1);
    trc_material_release(m);
}

static void test_too_many_registers(void **state) {
    (void)state;
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    int32_t values[TRC_MAX_REGISTERS + 1];
    for (int i = 0; i <= TRC_MAX_REGISTERS; i++) {
        values[i] =
            ADD(TRC_NODE_MATH, TRC_MATH_ADD, link_to(info, 5), value(1 + (float)i), value(0));
    }
    int32_t sum = values[0];
    for (int i = 1; i <= TRC_MAX_REGISTERS; i++) {
        sum = ADD(TRC_NODE_MATH, TRC_MATH_ADD, link_to(sum, 0), link_to(values[i], 0), value(0));
    }
    add_diffuse(link_to(sum, 0));
    refused(TRC_ERROR_TOO_LARGE, "1024", "values");
}

static void test_too_many_leaves(void **state) {
    (void)state;
    graph_clear();
    int32_t sum = add_diffuse(color(1, 1, 1));
    for (int i = 0; i < TRC_MAX_LEAVES; i++) {
        const int32_t leaf = add_diffuse(color(1, 1, 1));
        sum = ADD(TRC_NODE_ADD_SHADER, 0, link_to(sum, 0), link_to(leaf, 0));
    }
    refused(TRC_ERROR_TOO_LARGE, "64", "shaders");
}

/* A ladder of mixes that all share their shaders: its tree would have 2^1000 leaves. */
static void test_shared_shaders_do_not_multiply(void **state) {
    (void)state;
    graph_clear();
    int32_t a = add_diffuse(color(1, 0, 0)), b = add_diffuse(color(0, 1, 0));
    for (int i = 0; i < 1000; i++) {
        const int32_t c = add_mix(value(.5f), a, b);
        a = b;
        b = c;
    }
    struct trc_material *m = compiled();
    assert_int_equal(m->leaf_count, 2);
    assert_true(fabsf(m->leaves[0].weight.value + m->leaves[1].weight.value - 1) < 1e-5f);
    trc_material_release(m);
}

/* ---- AOVs ---- */

/* Outputs of their own: constants cost no program, others share it with the surface. */
static void test_aovs(void **state) {
    (void)state;
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    const int32_t half = ADD(TRC_NODE_MATH, TRC_MATH_MULTIPLY, value(2.0f), value(0.25f), value(0));
    ADD(TRC_NODE_AOV_VALUE, 3, link_to(half, 0));
    ADD(TRC_NODE_AOV_COLOR, 5, color(1, 2, 3));
    struct trc_material *m = compiled();
    assert_int_equal(m->aov_count, 2);
    assert_int_equal(m->instruction_count, 0);
    assert_int_equal(m->leaf_count, 0);
    assert_int_equal(m->aovs[0].pass, TRC_PASS_AOV_VALUE(3));
    assert_int_equal(m->aovs[1].pass, TRC_PASS_AOV_COLOR(5));
    const struct trc_operand *o = m->operands;
    assert_true(o[m->aovs[0].first_operand].value == 0.5f);
    for (uint32_t k = 0; k < 3; k++)
        assert_true(o[m->aovs[1].first_operand + k].value == (float)(k + 1));
    trc_material_release(m);

    add_diffuse(link_to(info, 1));
    ADD(TRC_NODE_AOV_COLOR, 0, link_to(info, 1));
    m = compiled();
    assert_int_equal(m->aov_count, 3);
    assert_int_equal(m->instruction_count, 1);
    for (uint32_t k = 0; k < 3; k++) {
        const int32_t reg = m->operands[m->aovs[2].first_operand + k].reg;
        assert_true(reg >= 0 && reg == m->operands[m->leaves[0].first_operand + k].reg);
    }
    trc_material_release(m);

    for (uint32_t i = 0; i < TRC_MAX_AOV_OUTPUTS; i++)
        ADD(TRC_NODE_AOV_VALUE, i % TRC_MAX_AOVS, value(0));
    refused(TRC_ERROR_TOO_LARGE, "32", "AOV");
    graph_clear();
    ADD(TRC_NODE_AOV_VALUE, TRC_MAX_AOVS, value(0));
    refused(TRC_ERROR_INVALID_ARGUMENT, "AOV Value", "mode");
    graph_clear();
    const int32_t aov = ADD(TRC_NODE_AOV_VALUE, 0, value(0));
    add_diffuse(link_to(aov, 0));
    refused(TRC_ERROR_INVALID_ARGUMENT, "color", "output");
}

/* ---- what is refused ---- */

static void test_refused_inputs(void **state) {
    (void)state;
    graph_clear();
    add_principled(0);
    *input_of(0, 6) = value(NAN);
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 0 (Principled)", "input 6 (roughness)");
    *input_of(0, 6) = value(INFINITY);
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 0 (Principled)", "(roughness)");
    *input_of(0, 6) = (trc_node_input){.node = -1, .value = {.5f, NAN, NAN}}; /* not read */
    trc_material_release(compiled());
    *input_of(0, 6) = standard();
    refused(TRC_ERROR_INVALID_ARGUMENT, "(roughness)", "default");
    *input_of(0, 6) = link_to(0, 0);
    refused(TRC_ERROR_INVALID_ARGUMENT, "(roughness)", "not earlier");
    *input_of(0, 6) = link_to(-3, 0);
    refused(TRC_ERROR_INVALID_ARGUMENT, "(roughness)", "not earlier");
    *input_of(0, 6) = link_to(INT32_MIN, 0);
    refused(TRC_ERROR_INVALID_ARGUMENT, "(roughness)", "not earlier");

    graph_clear();
    add(TRC_NODE_INSTANCE_VALUES, TRC_MAX_INSTANCE_VALUES, 0, NULL);
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 0 (Instance Values)", "mode");

    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL),
                  diffuse = add_diffuse(color(1, 1, 1));
    *input_of(diffuse, 0) = link_to(info, 6);
    refused(TRC_ERROR_INVALID_ARGUMENT, "(color)", "output that does not exist");
    *input_of(diffuse, 0) = link_to(info, 1);
    trc_material_release(compiled());
    add_diffuse(link_to(diffuse, 0));
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 2 (Diffuse)", "to a shader");
    graph.node_count--;
    ADD(TRC_NODE_ADD_SHADER, 0, link_to(diffuse, 0), link_to(info, 0));
    refused(TRC_ERROR_INVALID_ARGUMENT, "input 1 (second)", "to a value");
}

static void test_refused_nodes(void **state) {
    (void)state;
    graph_clear();
    add_diffuse(color(1, 1, 1));
    graph.nodes[0].type = 77777;
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 0", "77777");
    graph.nodes[0].type = 0;
    refused(TRC_ERROR_INVALID_ARGUMENT, "node 0", "type");
    graph.nodes[0].type = TRC_NODE_DIFFUSE;
    graph.nodes[0].mode = 3;
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Diffuse)", "mode");
    graph.nodes[0].mode = 0;
    graph.nodes[0].input_count = 2;
    refused(TRC_ERROR_INVALID_ARGUMENT, "2 inputs", "3");
    graph.nodes[0].input_count = 3;
    graph.nodes[0].first_input = 1;
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Diffuse)", "beyond");
    graph.nodes[0].first_input = UINT32_MAX;
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Diffuse)", "beyond");
    graph.nodes[0].first_input = 0;
    graph.surface = 1;
    refused(TRC_ERROR_INVALID_ARGUMENT, "surface", "1");
    graph.surface = -2;
    refused(TRC_ERROR_INVALID_ARGUMENT, "surface", "-2");
    graph.surface = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    refused(TRC_ERROR_INVALID_ARGUMENT, "surface", "shader");
    graph.surface = 0;
    graph.flags = 256;
    refused(TRC_ERROR_INVALID_ARGUMENT, "flags", "0x100");
}

static void test_refused_tables(void **state) {
    (void)state;
    static float table[4 * TRC_TABLE_ENTRIES];
    graph_clear();
    const int32_t ramp = ADD(TRC_NODE_COLOR_RAMP, 0, value(.5f));
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Color Ramp)", "table");
    graph.nodes[ramp].table = table;
    graph.nodes[ramp].table_count = 4 * TRC_TABLE_ENTRIES - 4;
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Color Ramp)", "1024 floats");
    graph.nodes[ramp].table_count = 4 * TRC_TABLE_ENTRIES;
    trc_material_release(compiled());
    table[17] = NAN;
    refused(TRC_ERROR_INVALID_ARGUMENT, "(Color Ramp)", "17");
    table[17] = 0;
}

static void test_refused_descriptors(void **state) {
    (void)state;
    struct trc_material *m = NULL;
    const struct trc_compile_context context = {names, index_of_image, has_levels, NULL};
    trc_material_desc desc = {.struct_size = sizeof desc, .surface = -1};
    assert_int_equal(trc_material_compile(NULL, &context, &m), TRC_ERROR_INVALID_ARGUMENT);
    desc.struct_size = 4;
    assert_int_equal(trc_material_compile(&desc, &context, &m), TRC_ERROR_STRUCT_SIZE);
    desc.struct_size = sizeof desc;
    desc.node_count = 1;
    assert_int_equal(trc_material_compile(&desc, &context, &m), TRC_ERROR_INVALID_ARGUMENT);
    desc.node_count = TRC_MAX_NODES + 1;
    assert_int_equal(trc_material_compile(&desc, &context, &m), TRC_ERROR_TOO_LARGE);
    desc.node_count = 0;
    desc.input_count = UINT32_MAX;
    assert_int_equal(trc_material_compile(&desc, &context, &m), TRC_ERROR_TOO_LARGE);
    desc.input_count = 3;
    assert_int_equal(trc_material_compile(&desc, &context, &m), TRC_ERROR_INVALID_ARGUMENT);
    assert_null(m);
    static char name[80];
    memset(name, 'x', sizeof name - 1);
    graph_clear();
    add_diffuse(link_to(add_image(1, name), 0));
    refused(TRC_ERROR_TOO_LARGE, "name", "63");
}

static void test_memory_failures(void **state) {
    (void)state;
    static float table[4 * TRC_TABLE_ENTRIES];
    graph_clear();
    const int32_t image = add_image(3, "map");
    const int32_t ramp = ADD(TRC_NODE_COLOR_RAMP, 0, link_to(image, 1));
    graph.nodes[ramp].table = table;
    graph.nodes[ramp].table_count = 4 * TRC_TABLE_ENTRIES;
    add_diffuse(link_to(ramp, 0));
    trc_material_release(compiled()); /* the name is known now */
    const uint64_t bytes = trc_memory_bytes();
    trc_status status = TRC_ERROR_OUT_OF_MEMORY;
    for (int64_t n = 0; status != TRC_OK; n++) {
        struct trc_material *m = NULL;
        trc_memory_fail_at(n, false);
        status = compile(&m);
        trc_memory_fail_at(-1, false);
        assert_true(status == TRC_OK || status == TRC_ERROR_OUT_OF_MEMORY);
        trc_material_release(m);
        assert_true(trc_memory_bytes() == bytes);
        assert_true(n < 100);
    }
}

static void test_holders(void **state) {
    (void)state;
    graph_clear();
    add_diffuse(color(1, 1, 1));
    const uint64_t bytes = trc_memory_bytes();
    struct trc_material *m = compiled();
    assert_ptr_equal(trc_material_retain(m), m);
    trc_material_release(m);
    assert_true(trc_memory_bytes() > bytes);
    trc_material_release(m);
    assert_true(trc_memory_bytes() == bytes);
    assert_null(trc_material_retain(NULL));
    trc_material_release(NULL);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_constant_material),
        cmocka_unit_test(test_empty_materials),
        cmocka_unit_test(test_folding),
        cmocka_unit_test(test_conversions),
        cmocka_unit_test(test_equal_nodes_are_shared),
        cmocka_unit_test(test_images_without_levels),
        cmocka_unit_test(test_density_of_mapped_images),
        cmocka_unit_test(test_unreached_nodes_are_dropped),
        cmocka_unit_test(test_alpha_of_images),
        cmocka_unit_test(test_unknown_images),
        cmocka_unit_test(test_ramps_share_tables),
        cmocka_unit_test(test_registers_are_reused),
        cmocka_unit_test(test_too_many_registers),
        cmocka_unit_test(test_too_many_leaves),
        cmocka_unit_test(test_shared_shaders_do_not_multiply),
        cmocka_unit_test(test_aovs),
        cmocka_unit_test(test_refused_inputs),
        cmocka_unit_test(test_refused_nodes),
        cmocka_unit_test(test_refused_tables),
        cmocka_unit_test(test_refused_descriptors),
        cmocka_unit_test(test_memory_failures),
        cmocka_unit_test(test_holders),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
