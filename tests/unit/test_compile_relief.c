/* The material compiler on heights: what is taken at three points, and what is shared. */
#include "graph.h"

#include "model/nodes.h"

static int32_t add_bump(trc_node_input height, trc_node_input normal) {
    return ADD(TRC_NODE_BUMP, 0, value(1), value(.5f), value(.1f), height, normal);
}

/* A diffuse with a normal. */
static int32_t add_bent(int32_t bump) {
    return ADD(TRC_NODE_DIFFUSE, 0, color(1, 1, 1), value(0), link_to(bump, 0));
}

/* An output of a Geometry node times four. */
static int32_t add_height(uint32_t output) {
    const int32_t geometry = add(TRC_NODE_GEOMETRY, 0, 0, NULL);
    return ADD(TRC_NODE_MATH, TRC_MATH_MULTIPLY, link_to(geometry, output), value(4), value(0));
}

static void test_three_points(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    add_bent(add_bump(link_to(height, 0), standard()));
    struct trc_material *m = compiled();
    assert_int_equal(m->has, TRC_MATERIAL_HAS_DIFFUSE | TRC_MATERIAL_HAS_PROGRAM |
                                 TRC_MATERIAL_READS_PIXEL);
    assert_int_equal(count_op(m, TRC_OP_POSITION), 1);
    assert_int_equal(count_op(m, TRC_OP_BESIDE), 2);
    assert_int_equal(count_op(m, TRC_OP_MATH), 3);
    assert_int_equal(count_op(m, TRC_OP_NORMAL), 1);
    assert_int_equal(count_op(m, TRC_OP_BUMP), 1);
    uint32_t directions = 0;
    for (uint32_t i = 0; i < m->instruction_count; i++) {
        const struct trc_instruction *o = &m->instructions[i];
        if (o->op != TRC_OP_BESIDE)
            continue;
        assert_int_equal(o->mode & ~TRC_BESIDE_Y, TRC_OP_POSITION);
        assert_true(m->operands[o->first_input].value == .1f);
        directions |= o->mode & TRC_BESIDE_Y ? 2 : 1;
    }
    assert_int_equal(directions, 3);
    trc_material_release(m);
}

/* Normals as coordinates of a height are those of the point, unless their node says otherwise. */
static void test_curved_normals(void **state) {
    (void)state;
    for (uint32_t mode = 0; mode <= TRC_COORDINATE_CURVED; mode++) {
        graph_clear();
        const int32_t coordinates = add(TRC_NODE_TEXTURE_COORDINATE, mode, 0, NULL);
        const uint32_t normal = TRC_OUTPUT_OF(TEXTURE_COORDINATE, normal);
        const int32_t height =
            ADD(TRC_NODE_MATH, TRC_MATH_MULTIPLY, link_to(coordinates, normal), value(4), value(0));
        add_bent(add_bump(link_to(height, 0), standard()));
        struct trc_material *m = compiled();
        assert_int_equal(count_op(m, TRC_OP_BESIDE), mode ? 2 : 0);
        assert_int_equal(count_op(m, TRC_OP_BUMP), mode);
        for (uint32_t i = 0; i < m->instruction_count; i++)
            if (m->instructions[i].op == TRC_OP_BESIDE)
                assert_int_equal(m->instructions[i].mode & ~TRC_BESIDE_Y, TRC_OP_OBJECT_NORMAL);
        trc_material_release(m);
    }
}

/* Colours of a mesh make bumps, unless their node is level. */
static void test_level_colors(void **state) {
    (void)state;
    for (uint32_t mode = 0; mode <= TRC_ATTRIBUTE_LEVEL; mode++) {
        graph_clear();
        const int32_t colors = add(TRC_NODE_COLOR_ATTRIBUTE, mode, 0, NULL);
        graph.nodes[colors].name = "Tint";
        add_bent(add_bump(link_to(colors, 0), standard()));
        struct trc_material *m = compiled();
        assert_int_equal(count_op(m, TRC_OP_BUMP), !mode);
        assert_int_equal(count_op(m, TRC_OP_BESIDE), mode ? 0 : 2);
        trc_material_release(m);
    }
}

/* Wires are asked for at three places; steep ones also before the point, and not beside it. */
static void test_wires(void **state) {
    (void)state;
    for (uint32_t mode = 0; mode <= TRC_WIREFRAME_MASK; mode++) {
        graph_clear();
        const int32_t wires = ADD(TRC_NODE_WIREFRAME, mode, value(.1f));
        add_bent(add_bump(link_to(wires, 0), standard()));
        struct trc_material *m = compiled();
        assert_int_equal(count_op(m, TRC_OP_WIREFRAME), 3);
        assert_int_equal(count_op(m, TRC_OP_BESIDE), 2);
        assert_int_equal(count_op(m, TRC_OP_VECTOR_MEASURE), mode & TRC_WIREFRAME_STEEP ? 2 : 0);
        assert_int_equal(count_op(m, TRC_OP_BUMP), 1);
        trc_material_release(m);
    }
}

/* A second Bump node of the same height adds itself alone; the colour is that of the point. */
static void test_heights_are_shared(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    const int32_t first = add_bump(link_to(height, 0), standard());
    const int32_t second = add_bump(link_to(height, 0), link_to(first, 0));
    ADD(TRC_NODE_DIFFUSE, 0, link_to(height, 0), value(0), link_to(second, 0));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_BUMP), 2);
    assert_int_equal(count_op(m, TRC_OP_BESIDE), 2);
    assert_int_equal(count_op(m, TRC_OP_POSITION), 1);
    assert_int_equal(count_op(m, TRC_OP_MATH), 3);
    trc_material_release(m);
}

/* Heights that are the same everywhere, or of what is one at all three points, turn nothing. */
static void test_even_heights(void **state) {
    (void)state;
    static const uint32_t outputs[] = {TRC_OUTPUT_OF(GEOMETRY, normal),
                                       TRC_OUTPUT_OF(GEOMETRY, incoming),
                                       TRC_OUTPUT_OF(GEOMETRY, backfacing)};
    for (int i = 0; i < 4; i++) {
        graph_clear();
        const int32_t height = add_height(outputs[i % 3]);
        add_bent(add_bump(i == 3 ? value(2) : link_to(height, 0), standard()));
        struct trc_material *m = compiled();
        assert_int_equal(m->instruction_count, 1);
        assert_int_equal(count_op(m, TRC_OP_NORMAL), 1);
        assert_int_equal(m->has & TRC_MATERIAL_READS_PIXEL, 0);
        trc_material_release(m);
    }
}

/* Slopes are those of the whole image, colours may be of a smaller level. */
static void test_images_of_heights_are_whole(void **state) {
    (void)state;
    graph_clear();
    const int32_t map = add(TRC_NODE_UV_MAP, 0, 0, NULL);
    const int32_t image = ADD(TRC_NODE_IMAGE, TRC_IMAGE_EXTEND, link_to(map, 0), value(0));
    graph.nodes[image].image = 3;
    const int32_t bump = add_bump(link_to(image, 0), standard());
    ADD(TRC_NODE_DIFFUSE, 0, link_to(image, 0), value(0), link_to(bump, 0));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_IMAGE), 4);
    assert_int_equal(count_op(m, TRC_OP_UV_DENSITY), 1);
    uint32_t whole = 0;
    for (uint32_t i = 0; i < m->instruction_count; i++) {
        const struct trc_instruction *o = &m->instructions[i];
        if (o->op == TRC_OP_IMAGE)
            whole += m->operands[o->first_input + TRC_OP_AT(IMAGE, density)].reg < 0;
    }
    assert_int_equal(whole, 3);
    trc_material_release(m);
}

/* A height that depends on the normal of another Bump node: that normal is one for all points. */
static void test_bumps_within_heights(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    const int32_t inner = add_bump(link_to(height, 0), standard());
    const int32_t weight = ADD(TRC_NODE_LAYER_WEIGHT, 0, value(.5f), link_to(inner, 0));
    const int32_t sum =
        ADD(TRC_NODE_MATH, TRC_MATH_ADD, link_to(weight, 1), link_to(height, 0), value(0));
    add_bent(add_bump(link_to(sum, 0), standard()));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_BUMP), 2);
    assert_int_equal(count_op(m, TRC_OP_LAYER_FACING), 1);
    assert_int_equal(count_op(m, TRC_OP_BESIDE), 2);
    trc_material_release(m);
}

/* A height and a node that nothing reads leave the material as it was without them. */
static void test_unread_bumps(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    add_bump(link_to(height, 0), standard());
    add_diffuse(color(1, 1, 1));
    struct trc_material *m = compiled();
    assert_int_equal(m->instruction_count, 0);
    assert_int_equal(m->has, TRC_MATERIAL_HAS_DIFFUSE);
    trc_material_release(m);
}

/* ---- displacement ---- */

static int32_t add_displaced(uint32_t method, trc_node_input height) {
    const int32_t node =
        ADD(TRC_NODE_DISPLACEMENT, TRC_SPACE_WORLD, height, value(.5f), value(2), standard());
    return ADD(TRC_NODE_DISPLACEMENT_OUTPUT, method, link_to(node, 0), value(1));
}

/* As a bump it sets the normal for all that reads it afterwards; the displacement itself still has
 * the one of the mesh. */
static void test_displacement_sets_the_normal(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    add_displaced(TRC_DISPLACEMENT_BUMP, link_to(height, 0));
    const int32_t geometry = add(TRC_NODE_GEOMETRY, 0, 0, NULL);
    add_emission(link_to(geometry, TRC_OUTPUT_OF(GEOMETRY, normal)), 1);
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_SET_NORMAL), 1);
    assert_int_equal(count_op(m, TRC_OP_BUMP), 1);
    assert_int_equal(count_op(m, TRC_OP_NORMAL), 2);
    uint32_t set = 0, last = 0;
    for (uint32_t i = 0; i < m->instruction_count; i++) {
        set = m->instructions[i].op == TRC_OP_SET_NORMAL ? i : set;
        last = m->instructions[i].op == TRC_OP_NORMAL ? i : last;
    }
    assert_true(last > set);
    assert_null(m->displacement);
    trc_material_release(m);
}

/* Shaders see it even where no node does. */
static void test_displacement_needs_no_reader(void **state) {
    (void)state;
    graph_clear();
    const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
    add_displaced(TRC_DISPLACEMENT_BUMP, link_to(height, 0));
    add_diffuse(color(1, 1, 1));
    struct trc_material *m = compiled();
    assert_int_equal(count_op(m, TRC_OP_SET_NORMAL), 1);
    assert_true(m->has & TRC_MATERIAL_READS_PIXEL);
    trc_material_release(m);
}

/* Moved vertices have a program of their own, and leave that of the surface as it was. */
static void test_true_displacement(void **state) {
    (void)state;
    for (uint32_t method = TRC_DISPLACEMENT_TRUE; method <= TRC_DISPLACEMENT_BOTH; method++) {
        graph_clear();
        const int32_t height = add_height(TRC_OUTPUT_OF(GEOMETRY, position));
        add_displaced(method, link_to(height, 0));
        add_diffuse(color(1, 1, 1));
        struct trc_material *m = compiled();
        const bool is_both = method == TRC_DISPLACEMENT_BOTH;
        assert_int_equal(count_op(m, TRC_OP_SET_NORMAL), is_both);
        assert_int_equal(m->keeps_normals, is_both);
        assert_true(is_both || m->instruction_count == 0);
        const struct trc_material *offset = m->displacement;
        assert_non_null(offset);
        assert_int_equal(offset->leaf_count, 0);
        assert_int_equal(offset->aov_count, 1);
        assert_int_equal(count_op(offset, TRC_OP_SET_NORMAL) + count_op(offset, TRC_OP_BESIDE), 0);
        for (uint32_t i = 0; i < 3; i++)
            assert_true(offset->operands[offset->aovs[0].first_operand + i].reg >= 0);
        trc_material_release(m);
    }
}

/* An even displacement turns nothing. */
static void test_even_displacement(void **state) {
    (void)state;
    graph_clear();
    add_displaced(TRC_DISPLACEMENT_BUMP, value(3));
    add_diffuse(color(1, 1, 1));
    struct trc_material *m = compiled();
    assert_int_equal(m->instruction_count, 0);
    trc_material_release(m);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_three_points),
        cmocka_unit_test(test_curved_normals),
        cmocka_unit_test(test_wires),
        cmocka_unit_test(test_level_colors),
        cmocka_unit_test(test_heights_are_shared),
        cmocka_unit_test(test_even_heights),
        cmocka_unit_test(test_images_of_heights_are_whole),
        cmocka_unit_test(test_bumps_within_heights),
        cmocka_unit_test(test_unread_bumps),
        cmocka_unit_test(test_displacement_sets_the_normal),
        cmocka_unit_test(test_displacement_needs_no_reader),
        cmocka_unit_test(test_true_displacement),
        cmocka_unit_test(test_even_displacement),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
