/* The material compiler on random node lists: folding changes no value, nonsense does no harm. */
#include "graph.h"

#include <math.h>

static uint32_t random_state;
static uint32_t random_below(uint32_t n) {
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % n;
}
/* Never exactly 0 or 1, which short cuts look for. */
static float random_value(void) {
    return ((float)random_below(1u << 20) + .37f) / (float)(1u << 18) - 1.3f;
}

static const struct {
    uint32_t type, modes;
    const char *inputs;
} random_types[] = {
    {TRC_NODE_MATH, TRC_MATH_DEGREES + 1, "fff"},
    {TRC_NODE_MIX_COLOR, TRC_BLEND_EXCLUSION + 1, "fcc"},
    {TRC_NODE_VECTOR_MATH, TRC_VECTOR_POWER + 1, "cccf"},
    {TRC_NODE_SEPARATE, 4, "c"},
    {TRC_NODE_COMBINE, 4, "fff"},
    {TRC_NODE_CLAMP, 2, "fff"},
    {TRC_NODE_MAP_RANGE, 1, "fffff"},
    {TRC_NODE_GAMMA, 1, "cf"},
    {TRC_NODE_INVERT, 1, "fc"},
    {TRC_NODE_HUE_SATURATION, 1, "ffffc"},
    {TRC_NODE_BRIGHT_CONTRAST, 1, "cff"},
    {TRC_NODE_CHECKER, 1, "cccf"},
    {TRC_NODE_MAPPING, 4, "cccc"},
    {TRC_NODE_RGB_TO_BW, 1, "c"},
    {TRC_NODE_NOISE, 6 << TRC_NOISE_TYPE_SHIFT, "cffffffff"},
    {TRC_NODE_VORONOI, 5 << TRC_VORONOI_FEATURE_SHIFT, "cffffffff"},
    {TRC_NODE_WAVE, 2, "cffffff"},
    {TRC_NODE_GRADIENT, 7, "c"},
    {TRC_NODE_MAGIC, 11, "cff"},
    {TRC_NODE_BRICK, 1, "ccccffffffff"},
    {TRC_NODE_BLACKBODY, 1, "f"},
    {TRC_NODE_VECTOR_ROTATE, 5, "cccfc"},
};
static uint32_t outputs_of(uint32_t type) {
    switch (type) {
    case TRC_NODE_VORONOI:
        return 5;
    case TRC_NODE_SEPARATE:
        return 3;
    case TRC_NODE_CHECKER:
    case TRC_NODE_VECTOR_MATH:
    case TRC_NODE_NOISE:
    case TRC_NODE_MAGIC:
    case TRC_NODE_BRICK:
        return 2;
    default:
        return 1;
    }
}

/* A random graph of operations on constants. If hidden, each constant is multiplied by the random
 * number of the object, which is 1 when the program runs: nothing can be folded. */
static void random_graph(uint32_t seed, bool hidden) {
    int32_t made[24];
    random_state = seed;
    graph_clear();
    const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
    for (int n = 0; n < 24; n++) {
        const uint32_t t = random_below(sizeof random_types / sizeof *random_types);
        const uint32_t count = (uint32_t)strlen(random_types[t].inputs);
        trc_node_input in[12];
        for (uint32_t i = 0; i < count; i++) {
            if (n && random_below(2)) {
                const int32_t from = made[random_below((uint32_t)n)];
                in[i] = link_to(from, random_below(outputs_of(graph.nodes[from].type)));
                continue;
            }
            in[i] = color(random_value(), random_value(), random_value());
            if (!hidden)
                continue;
            in[i] = link_to(ADD(TRC_NODE_VECTOR_MATH, TRC_VECTOR_SCALE, in[i], value(0), value(0),
                                link_to(info, 5)),
                            0);
            if (random_types[t].inputs[i] == 'f') { /* the first component, not the mean */
                in[i] = link_to(ADD(TRC_NODE_SEPARATE, 0, in[i]), 0);
            }
        }
        made[n] = add(random_types[t].type, random_below(random_types[t].modes), count, in);
    }
    add_emission(link_to(made[23], 0), 1);
}

static bool is_same(float a, float b) { return a == b || (isnan(a) && isnan(b)); }

static void test_folded_equals_run(void **state) {
    (void)state;
    struct trc_instance instance = {.random = 1.0f};
    struct trc_mesh mesh = {.default_uv = -1}, *meshes[1] = {&mesh};
    const struct trc_snapshot snapshot = {
        .instance_count = 1, .instances = &instance, .mesh_count = 1, .meshes = meshes};
    struct trc_surface s = {.snapshot = &snapshot, .active = vm_all_set()};
    static struct trc_registers regs;
    uint32_t programs = 0;
    for (uint32_t seed = 1; seed <= 3000; seed++) {
        random_graph(seed, false);
        struct trc_material *folded = compiled();
        assert_int_equal(folded->instruction_count, 0);
        random_graph(seed, true);
        struct trc_material *run = compiled();
        if (folded->leaf_count == 1 && run->leaf_count == 1) {
            programs += run->instruction_count > 0;
            trc_program_run_scalar(run, &s, &regs);
            for (int c = 0; c < 3; c++) {
                const float a = folded->operands[folded->leaves[0].first_operand + c].value;
                const float b =
                    trc_operand_value(&run->operands[run->leaves[0].first_operand + c], &regs);
                if (!is_same(a, b)) {
                    fail_msg("seed %u: folded %.9g, run %.9g", seed, a, b);
                }
            }
        }
        trc_material_release(folded);
        trc_material_release(run);
    }
    assert_true(programs > 1000);
}

/* Operations that give an input back for 0 or 1 at the other: each mode of Math and of Mix Color
 * with such a constant at any of its inputs, and a number of the object at the rest. The same as
 * where that constant is one of the object, too, so that nothing is known of it. */
static void test_neutral_constants(void **state) {
    (void)state;
    struct trc_instance instance = {.random = 0.375f, .color = {0.0f, 1.0f, 0.0f, 0.0f}};
    struct trc_mesh mesh = {.default_uv = -1}, *meshes[1] = {&mesh};
    const struct trc_snapshot snapshot = {
        .instance_count = 1, .instances = &instance, .mesh_count = 1, .meshes = meshes};
    struct trc_surface s = {.snapshot = &snapshot, .active = vm_all_set()};
    static struct trc_registers regs;
    static const struct {
        uint32_t type, modes;
    } types[] = {{TRC_NODE_MATH, TRC_MATH_DEGREES + 1},
                 {TRC_NODE_MIX_COLOR, TRC_BLEND_EXCLUSION + 1}};
    uint32_t shorter = 0;
    for (int type = 0; type < 2; type++)
        for (uint32_t mode = 0; mode < types[type].modes; mode++)
            for (int at = 0; at < 3; at++)
                for (int constant = 0; constant < 2; constant++) {
                    float found[2][3];
                    uint32_t lengths[2];
                    for (int hidden = 0; hidden < 2; hidden++) {
                        graph_clear();
                        const int32_t info = add(TRC_NODE_OBJECT_INFO, 0, 0, NULL);
                        const int32_t parts = ADD(TRC_NODE_SEPARATE, 0, link_to(info, 1));
                        trc_node_input in[3];
                        for (int i = 0; i < 3; i++)
                            in[i] = link_to(info, 5);
                        in[at] =
                            hidden ? link_to(parts, (uint32_t)constant) : value((float)constant);
                        const int32_t node = add(types[type].type, mode, 3, in);
                        add_emission(link_to(node, 0), 1);
                        struct trc_material *m = compiled();
                        lengths[hidden] = m->instruction_count;
                        trc_program_run_scalar(m, &s, &regs);
                        for (int c = 0; c < 3; c++)
                            found[hidden][c] =
                                m->leaf_count
                                    ? trc_operand_value(
                                          &m->operands[m->leaves[0].first_operand + c], &regs)
                                    : 0.0f;
                        trc_material_release(m);
                    }
                    shorter += lengths[0] < lengths[1];
                    for (int c = 0; c < 3; c++)
                        if (!is_same(found[0][c], found[1][c]))
                            fail_msg("node %u mode %u, %d at input %d: %g, not %g",
                                     types[type].type, mode, constant, at, (double)found[0][c],
                                     (double)found[1][c]);
                }
    assert_true(shorter > 100);
}

/* Random node lists, mostly nonsense: compiled or refused, never worse. */
static void test_random_descriptors(void **state) {
    (void)state;
    const uint64_t bytes = trc_memory_bytes();
    uint32_t accepted = 0;
    for (uint32_t seed = 1; seed <= 20000; seed++) {
        random_graph(seed, seed & 1);
        for (uint32_t i = random_below(4); i > 0; i--) {
            trc_node *node = &graph.nodes[random_below(graph.node_count)];
            trc_node_input *input = &graph.inputs[random_below(graph.input_count)];
            switch (random_below(7)) {
            case 0:
                node->type = random_below(100);
                break;
            case 1:
                node->mode = random_below(2) ? random_below(512) : random_state;
                break;
            case 2:
                node->first_input = random_below(graph.input_count + 8);
                break;
            case 3:
                input->node = (int32_t)random_below(graph.node_count + 4) - 3;
                break;
            case 4:
                input->output = random_below(14);
                break;
            case 5:
                memcpy(input->value, &random_state, 4);
                break;
            default:
                graph.surface = (int32_t)random_below(graph.node_count + 2) - 1;
                break;
            }
        }
        struct trc_material *m = NULL;
        if (compile(&m) == TRC_OK)
            accepted++;
        trc_material_release(m);
    }
    assert_true(accepted > 1000);
    assert_true(trc_memory_bytes() == bytes);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_folded_equals_run),
        cmocka_unit_test(test_neutral_constants),
        cmocka_unit_test(test_random_descriptors),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
