/* The list of node types: what is made of it agrees with itself, and with rules said in other
 * words. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "model/nodes.h"
#include "model/program.h"

/* An input or output by its name, as TRC_AT and the others place it. */
struct placed {
    const char *name;
    uint32_t number, at;
};

static void check_sockets(const char *label, const struct trc_socket *sockets, uint32_t count,
                          const struct placed *placed, uint32_t end) {
    uint32_t floats = 0;
    for (uint32_t i = 0; i < count; i++) {
        assert_string_equal(sockets[i].name, placed[i].name);
        if (placed[i].number != i || placed[i].at != floats)
            fail_msg("%s: %s is number %u at %u, not %u at %u", label, placed[i].name,
                     placed[i].number, placed[i].at, i, floats);
        floats += trc_socket_floats(sockets[i].kind);
    }
    assert_int_equal(end, floats);
}

/* Offsets are what adding up the kinds gives: that is how the compiler places values. */
static void test_offsets_add_up(void **state) {
    (void)state;
    const struct trc_node_info *info;
#define NODE_SOCKETS(NAME)                                                                      \
    info = trc_node_info_of(TRC_NODE_##NAME);                                                   \
    assert_non_null(info);                                                                      \
    check_sockets(#NAME, info->inputs, info->input_count, inputs_of_##NAME, TRC_AT(NAME, end)); \
    check_sockets(#NAME, info->outputs, info->output_count, outputs_of_##NAME,                  \
                  TRC_OUT_AT(NAME, end))
#define INPUT(NAME, input) \
    { #input, TRC_INPUT_OF(NAME, input), TRC_AT(NAME, input) }
#define OUTPUT(NAME, output) \
    { #output, TRC_OUTPUT_OF(NAME, output), TRC_OUT_AT(NAME, output) }
/* Shaders have no floats: they stand where what follows begins. */
#define SHADER(NAME, input) \
    { #input, TRC_INPUT_OF(NAME, input), TRC_AT(NAME, end) }
#define CLOSURE(NAME) \
    { "closure", TRC_OUTPUT_OF(NAME, closure), TRC_OUT_AT(NAME, end) }
    const struct placed inputs_of_MIX_SHADER[] = {
        INPUT(MIX_SHADER, factor), SHADER(MIX_SHADER, first), SHADER(MIX_SHADER, second)};
    const struct placed outputs_of_MIX_SHADER[] = {CLOSURE(MIX_SHADER)};
    NODE_SOCKETS(MIX_SHADER);
    const struct placed inputs_of_GLOSSY[] = {INPUT(GLOSSY, color),      INPUT(GLOSSY, roughness),
                                              INPUT(GLOSSY, anisotropy), INPUT(GLOSSY, rotation),
                                              INPUT(GLOSSY, normal),     INPUT(GLOSSY, tangent)};
    const struct placed outputs_of_GLOSSY[] = {CLOSURE(GLOSSY)};
    NODE_SOCKETS(GLOSSY);
    const struct placed inputs_of_VORONOI[] = {
        INPUT(VORONOI, vector),     INPUT(VORONOI, w),         INPUT(VORONOI, scale),
        INPUT(VORONOI, smoothness), INPUT(VORONOI, exponent),  INPUT(VORONOI, randomness),
        INPUT(VORONOI, detail),     INPUT(VORONOI, roughness), INPUT(VORONOI, lacunarity)};
    const struct placed outputs_of_VORONOI[] = {OUTPUT(VORONOI, distance), OUTPUT(VORONOI, color),
                                                OUTPUT(VORONOI, position), OUTPUT(VORONOI, w),
                                                OUTPUT(VORONOI, radius)};
    NODE_SOCKETS(VORONOI);
    const struct placed inputs_of_HOLDOUT[1] = {{0}};
    const struct placed outputs_of_HOLDOUT[] = {CLOSURE(HOLDOUT)};
    NODE_SOCKETS(HOLDOUT);
}

static uint32_t floats_of(const struct trc_socket *sockets, uint32_t count) {
    uint32_t floats = 0;
    for (uint32_t i = 0; i < count; i++)
        floats += trc_socket_floats(sockets[i].kind);
    return floats;
}

/* The structs of all types end where their kinds do. */
static void test_all_types_add_up(void **state) {
    (void)state;
#define TRC_NODE(NAME, number, label, inputs_, outputs_, modes)                                \
    {                                                                                          \
        const struct trc_node_info *info = trc_node_info_of(number);                           \
        assert_non_null(info);                                                                 \
        assert_int_equal(floats_of(info->inputs, info->input_count), TRC_AT(NAME, end));       \
        assert_int_equal(floats_of(info->outputs, info->output_count), TRC_OUT_AT(NAME, end)); \
        assert_int_equal(trc_node_is_shader(number),                                           \
                         info->output_count && info->outputs[0].kind == TRC_SOCKET_SHADER);    \
        assert_int_equal(trc_node_is_output(number), info->output_count == 0);                 \
    }
#include "tracer/nodes.def"
    assert_null(trc_node_info_of(0));
    assert_null(trc_node_info_of(TRC_NODE_IMAGE - 1));
    assert_null(trc_node_info_of(1000));
    assert_null(trc_node_info_of(UINT32_MAX));
}

/* Every shader is a closure, once, but for those that weigh others. */
static void test_all_shaders_are_closures(void **state) {
    (void)state;
    uint32_t closures[TRC_NODE_IMAGE] = {0};
#define TRC_CLOSURE(NAME, lobes, branches) closures[TRC_NODE_##NAME]++;
#include "tracer/nodes.def"
    for (uint32_t type = 0; type < TRC_NODE_IMAGE; type++) {
        const bool is_closure =
            trc_node_info_of(type) && type != TRC_NODE_MIX_SHADER && type != TRC_NODE_ADD_SHADER;
        assert_int_equal(closures[type], is_closure);
    }
}

/* How many modes below 2^16 a type has: the product of what its fields may be. */
static void test_counts_of_modes(void **state) {
    (void)state;
    static const struct {
        uint32_t type, count;
    } cases[] = {
        {TRC_NODE_DIFFUSE, 2},
        {TRC_NODE_GLOSSY, 5 * 2},
        {TRC_NODE_GLASS, 5 * 2},
        {TRC_NODE_PRINCIPLED, 2},
        {TRC_NODE_TRANSPARENT, 1},
        {TRC_NODE_TOON, 2},
        {TRC_NODE_PRINCIPLED_HAIR, 3 * 2},
        {TRC_NODE_IMAGE, 3 * 4 * 4}, /* interpolation, extension, projection */
        {TRC_NODE_ENVIRONMENT, 3 * 2},
        {TRC_NODE_MAPPING, 4},
        {TRC_NODE_MIX_COLOR, 19 * 2},
        {TRC_NODE_MATH, 40 * 2},
        {TRC_NODE_MAP_RANGE, 2},
        {TRC_NODE_NORMAL_MAP, 5 * 2 * 2 * 2}, /* space, flags */
        {TRC_NODE_COLOR_RAMP, 2},
        {TRC_NODE_SEPARATE, 4},
        {TRC_NODE_VECTOR_MATH, 30},
        {TRC_NODE_INSTANCE_VALUES, TRC_MAX_INSTANCE_VALUES},
        {TRC_NODE_NOISE, 4 * 6},
        {TRC_NODE_MUSGRAVE, 4 * 5},
        {TRC_NODE_VORONOI, 4 * 4 * 5 * 2 * 2 * 2}, /* dimensions, metric, feature, flags */
        {TRC_NODE_WAVE, 3 * 2 * 4},                /* profile, bands or rings, direction */
        {TRC_NODE_GRADIENT, 7},
        {TRC_NODE_WHITE_NOISE, 4},
        {TRC_NODE_RADIAL_TILING, 2},
        {TRC_NODE_MAGIC, 11 * 2},
        {TRC_NODE_BRICK, 128 * 128},
        {TRC_NODE_VECTOR_TRANSFORM, 3 * 3 * 4},
        {TRC_NODE_VECTOR_ROTATE, 5 * 2},
        {TRC_NODE_TANGENT, 4},
        {TRC_NODE_BUMP, 2 * 2},
        {TRC_NODE_AMBIENT_OCCLUSION, 255 * 2 * 2 * 2}, /* samples, bits */
        {TRC_NODE_BEVEL, 255},
        {TRC_NODE_RAYCAST, 2},
        {TRC_NODE_RAYCAST_ATTRIBUTE, 2},
        {TRC_NODE_POINT_INFO, 1},
        {TRC_NODE_DISPLACEMENT, 2},
        {TRC_NODE_VECTOR_DISPLACEMENT, 3},
        {TRC_NODE_DISPLACEMENT_OUTPUT, 3 * 2},
        {TRC_NODE_AOV_COLOR, TRC_MAX_AOVS},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint32_t count = 0;
        for (uint32_t mode = 0; mode < 1u << 16; mode++)
            count += trc_node_mode_is_valid(cases[i].type, mode);
        if (count != cases[i].count)
            fail_msg("%s has %u modes, not %u", trc_node_info_of(cases[i].type)->label, count,
                     cases[i].count);
    }
    assert_false(trc_node_mode_is_valid(TRC_NODE_MATH, 1u << 31));
    assert_false(trc_node_mode_is_valid(0, 0));
}

/* Numbers are part of the interface: the first and last of each run, and those out of order. */
static void test_numbers(void **state) {
    (void)state;
    assert_int_equal(TRC_NODE_DIFFUSE, 1);
    assert_int_equal(TRC_NODE_PRINCIPLED, 12);
    assert_int_equal(TRC_NODE_SHEEN, 16);
    assert_int_equal(TRC_NODE_IMAGE, 64);
    assert_int_equal(TRC_NODE_LIGHT_PATH, 74);
    assert_int_equal(TRC_NODE_INSTANCE_VALUES, 90);
    assert_int_equal(TRC_NODE_NOISE, 96);
    assert_int_equal(TRC_NODE_WIREFRAME, 111);
    assert_int_equal(TRC_NODE_AOV_VALUE, 112);
    assert_int_equal(TRC_NODE_AOV_COLOR, 113);
    assert_int_equal(TRC_NODE_TANGENT, 114);
    assert_int_equal(TRC_NODE_BUMP, 115);
    assert_int_equal(TRC_NODE_DISPLACEMENT, 116);
    assert_int_equal(TRC_NODE_DISPLACEMENT_OUTPUT, 118);
    assert_int_equal(TRC_NODE_AMBIENT_OCCLUSION, 124);
    assert_int_equal(TRC_NODE_RAYCAST, 126);
    assert_int_equal(TRC_NODE_RADIAL_TILING, 128);
    assert_int_equal(TRC_NODE_RAYCAST_ATTRIBUTE, 129);
}

/* Outputs of operations that stand for outputs of nodes stand alike. */
static void test_operations_that_fill_a_node(void **state) {
    (void)state;
    assert_int_equal(TRC_OP_OUT_AT(VORONOI, position), TRC_OUT_AT(VORONOI, position));
    assert_int_equal(TRC_OP_OUT_AT(VORONOI, end), TRC_OUT_AT(VORONOI, end));
    assert_int_equal(TRC_OP_AT(VECTOR_MATH, b), TRC_OP_AT(VECTOR_MEASURE, b));
    assert_int_equal(TRC_OP_AT(MIX, b), TRC_AT(MIX_COLOR, b));
    assert_int_equal(TRC_OP_AT(HUE_SATURATION, color), TRC_AT(HUE_SATURATION, color));
    assert_int_equal(TRC_OP_OUT_AT(CHECKER, factor), TRC_OUT_AT(CHECKER, factor));
    assert_int_equal(TRC_OP_OUT_AT(NOISE, color), TRC_OUT_AT(NOISE, color));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_offsets_add_up),
        cmocka_unit_test(test_all_types_add_up),
        cmocka_unit_test(test_all_shaders_are_closures),
        cmocka_unit_test(test_counts_of_modes),
        cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_operations_that_fill_a_node),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
