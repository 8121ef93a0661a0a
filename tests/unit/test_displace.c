/* True displacement at commit: where vertices and normals go, what is kept, what follows edits. */
#include "fixture.h"

#include "core/core.h"
#include "model/snapshot.h"
#include "node_list.h"
#include "query_scene.h"

/* A square of two triangles, smooth, in the plane z = 0, in two slots. */
static const float square[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
static const uint32_t triangles[6] = {0, 1, 2, 0, 2, 3};
static const uint8_t smooth[2] = {1, 1};
static const uint16_t slots[2] = {0, 1};

static trc_mesh_desc square_desc(void) {
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = 4;
    desc.triangle_count = 2;
    desc.key_count = 1;
    desc.positions = square;
    desc.position_count = 12;
    desc.indices = triangles;
    desc.index_count = 6;
    desc.normals = NULL;
    desc.normal_count = 0;
    desc.normal_kind = TRC_NORMALS_NONE;
    desc.smooth = smooth;
    desc.material_index = slots;
    return desc;
}

/* A material that moves each vertex by its place in the world times factor, or with no method. */
static trc_material_desc mover(struct node_list *list, float factor, uint32_t method) {
    *list = (struct node_list){.node_count = 0};
    const uint32_t place = node_add(list, TRC_NODE_GEOMETRY, 0, 0, list->inputs);
    const uint32_t offset =
        NODE_ADD(list, TRC_NODE_VECTOR_MATH, TRC_VECTOR_SCALE, node_link(place, 0), node_number(0),
                 node_number(0), node_number(factor));
    NODE_ADD(list, TRC_NODE_DISPLACEMENT_OUTPUT, method, node_link(offset, 0), node_number(1));
    const uint32_t surface =
        NODE_ADD(list, TRC_NODE_DIFFUSE, 0, node_color(1, 1, 1), node_number(0), node_standard());
    return node_list_material(list, surface);
}

struct stage {
    trc_scene scene;
    trc_id mesh, instance, materials[2];
    trc_instance_desc desc;
    float transform[12];
};

/* The square in a scene, scaled and moved, with a material in each slot. */
static void build(struct stage *s, const trc_material_desc *first,
                  const trc_material_desc *second) {
    static const float placed[12] = {2, 0, 0, 1, 0, 2, 0, 0, 0, 0, 2, 3};
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_mesh_desc mesh_desc = square_desc();
    memset(s, 0, sizeof *s);
    memcpy(s->transform, placed, sizeof placed);
    assert_int_equal(trc_scene_create(&scene_desc, &s->scene), TRC_OK);
    assert_int_equal(trc_mesh_create(s->scene, &mesh_desc, &s->mesh), TRC_OK);
    assert_int_equal(trc_material_create(s->scene, first, &s->materials[0]), TRC_OK);
    assert_int_equal(trc_material_create(s->scene, second, &s->materials[1]), TRC_OK);
    s->desc = default_instance_desc(s->mesh);
    s->desc.transforms = s->transform;
    s->desc.materials = s->materials;
    s->desc.material_count = 2;
    assert_int_equal(trc_instance_create(s->scene, &s->desc, &s->instance), TRC_OK);
    assert_int_equal(trc_scene_commit(s->scene), TRC_OK);
}

/* Vertex v at 2 v + (1, 0, 3) moves by that times factor, which is half as much in the object. */
static void expect_moved(const struct trc_mesh *mesh, uint32_t vertex, float factor) {
    static const float origin[3] = {1, 0, 3};
    for (uint32_t i = 0; i < 3; i++) {
        const float from = square[3 * vertex + i];
        const float expected = from + factor * (2 * from + origin[i]) / 2;
        assert_true(fabsf(mesh->positions[3 * vertex + i] - expected) < 1e-6f);
    }
}

static void vertices_move(void **state) {
    (void)state;
    uint64_t bytes = 0; /* after the first scene, which leaves what all share */
    for (int round = 0; round < 2; round++) {
        struct node_list list;
        struct stage s;
        const trc_material_desc desc = mover(&list, 0.5f, TRC_DISPLACEMENT_TRUE);
        build(&s, &desc, &desc);
        const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
        for (uint32_t v = 0; v < 4; v++)
            expect_moved(mesh, v, 0.5f);
        assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
        assert_true(!round || trc_memory_bytes() == bytes);
        bytes = trc_memory_bytes();
    }
}

/* One slot moves the vertices of its triangle alone, those of the other's too. */
static void slots_move_their_own(void **state) {
    (void)state;
    struct node_list moving, still;
    struct stage s;
    const trc_material_desc first = mover(&moving, 0.5f, TRC_DISPLACEMENT_TRUE);
    const trc_material_desc second = mover(&still, 0.5f, TRC_DISPLACEMENT_BUMP);
    build(&s, &first, &second);
    const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
    for (uint32_t v = 0; v < 3; v++)
        expect_moved(mesh, v, 0.5f);
    expect_moved(mesh, 3, 0.0f);
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

/* The material of the first triangle that has a vertex moves it. */
static void first_triangles_rule(void **state) {
    (void)state;
    struct node_list near, far;
    struct stage s;
    const trc_material_desc first = mover(&near, 0.25f, TRC_DISPLACEMENT_TRUE);
    const trc_material_desc second = mover(&far, 1.0f, TRC_DISPLACEMENT_TRUE);
    build(&s, &first, &second);
    const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
    for (uint32_t v = 0; v < 3; v++)
        expect_moved(mesh, v, 0.25f);
    expect_moved(mesh, 3, 1.0f);
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

/* Of two slots that move, none does for an instance that keeps its shape, and both do again after.
 */
static void shapes_are_kept(void **state) {
    (void)state;
    struct node_list list;
    struct stage s;
    const trc_material_desc desc = mover(&list, 0.5f, TRC_DISPLACEMENT_TRUE);
    build(&s, &desc, &desc);
    for (uint32_t round = 0; round < 2; round++) {
        s.desc.flags = round ? 0 : TRC_INSTANCE_KEEPS_SHAPE;
        assert_int_equal(trc_instance_update(s.scene, s.instance, &s.desc), TRC_OK);
        assert_int_equal(trc_scene_commit(s.scene), TRC_OK);
        for (uint32_t v = 0; v < 4; v++)
            expect_moved(query_scene_snapshot(s.scene)->meshes[0], v, round ? 0.5f : 0.0f);
    }
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

static void unit_normal(const struct trc_mesh *mesh, uint32_t triangle, double n[3]) {
    const uint32_t *v = triangles + 3 * triangle;
    double a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = (double)mesh->positions[3 * v[1] + (uint32_t)i] -
               mesh->positions[3 * v[0] + (uint32_t)i];
        b[i] = (double)mesh->positions[3 * v[2] + (uint32_t)i] -
               mesh->positions[3 * v[0] + (uint32_t)i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    const double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; i++)
        n[i] /= length;
}

/* Normals are means of those of the moved triangles, whatever their angles; with BOTH they stay. */
static void normals_are_made_anew(void **state) {
    (void)state;
    for (int keeps = 0; keeps < 2; keeps++) {
        struct node_list near, far;
        struct stage s;
        const uint32_t method = keeps ? TRC_DISPLACEMENT_BOTH : TRC_DISPLACEMENT_TRUE;
        const trc_material_desc first = mover(&near, 0.25f, method);
        const trc_material_desc second = mover(&far, 1.0f, method);
        build(&s, &first, &second);
        const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
        double n[2][3], sum[3], length = 0;
        unit_normal(mesh, 0, n[0]);
        unit_normal(mesh, 1, n[1]);
        assert_true(n[1][2] < 0.99); /* it is bent */
        for (int i = 0; i < 3; i++) {
            sum[i] = n[0][i] + n[1][i];
            length += sum[i] * sum[i];
        }
        for (uint32_t v = 0; v < 4; v++)
            for (int i = 0; i < 3; i++) {
                const double shared = sum[i] / sqrt(length);
                const double moved = v == 1 ? n[0][i] : v == 3 ? n[1][i] : shared;
                const double expected = keeps ? (i == 2) : moved;
                assert_true(fabs(mesh->vertex_normals[3 * v + (uint32_t)i] - expected) < 1e-6);
            }
        assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
    }
}

/* Generated coordinates are those of the mesh before it moved. */
static void generated_coordinates_stay(void **state) {
    (void)state;
    struct node_list list;
    struct stage s;
    const trc_material_desc desc = mover(&list, 0.5f, TRC_DISPLACEMENT_TRUE);
    build(&s, &desc, &desc);
    const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
    assert_non_null(mesh->generated);
    for (uint32_t v = 0; v < 4; v++) {
        assert_true(mesh->generated[3 * v] == square[3 * v]);
        assert_true(mesh->generated[3 * v + 1] == square[3 * v + 1]);
        assert_true(mesh->generated[3 * v + 2] == 0.5f);
    }
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

/* What moved a mesh is remembered; edits of the material, the place and the shape are followed. */
static void edits_are_followed(void **state) {
    (void)state;
    struct node_list list;
    struct stage s;
    trc_material_desc desc = mover(&list, 0.5f, TRC_DISPLACEMENT_TRUE);
    build(&s, &desc, &desc);
    const struct trc_mesh *moved = query_scene_snapshot(s.scene)->meshes[0];
    const struct trc_bvh *bvh = query_scene_snapshot(s.scene)->bvh;
    const trc_camera_desc camera = default_camera_desc();
    assert_int_equal(trc_scene_set_camera(s.scene, &camera), TRC_OK);
    assert_int_equal(trc_scene_commit(s.scene), TRC_OK);
    assert_ptr_equal(query_scene_snapshot(s.scene)->meshes[0], moved);
    assert_ptr_equal(query_scene_snapshot(s.scene)->bvh, bvh);

    desc = mover(&list, 0.125f, TRC_DISPLACEMENT_TRUE);
    assert_int_equal(trc_material_update(s.scene, s.materials[0], &desc), TRC_OK);
    assert_int_equal(trc_material_update(s.scene, s.materials[1], &desc), TRC_OK);
    assert_int_equal(trc_scene_commit(s.scene), TRC_OK);
    for (uint32_t v = 0; v < 4; v++)
        expect_moved(query_scene_snapshot(s.scene)->meshes[0], v, 0.125f);
    assert_ptr_not_equal(query_scene_snapshot(s.scene)->bvh, bvh);

    s.transform[3] = 5; /* along X: the place moves by more */
    assert_int_equal(trc_instance_update(s.scene, s.instance, &s.desc), TRC_OK);
    assert_int_equal(trc_scene_commit(s.scene), TRC_OK);
    assert_true(fabsf(query_scene_snapshot(s.scene)->meshes[0]->positions[0] - 0.125f * 2.5f) <
                1e-6f);

    desc = mover(&list, 0.125f, TRC_DISPLACEMENT_BUMP);
    assert_int_equal(trc_material_update(s.scene, s.materials[0], &desc), TRC_OK);
    assert_int_equal(trc_material_update(s.scene, s.materials[1], &desc), TRC_OK);
    assert_int_equal(trc_scene_commit(s.scene), TRC_OK);
    assert_memory_equal(query_scene_snapshot(s.scene)->meshes[0]->positions, square, sizeof square);
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

/* A commit without memory changes nothing, and the next one moves the mesh. */
static void memory_may_end(void **state) {
    (void)state;
    struct node_list list;
    struct stage s;
    trc_material_desc desc = mover(&list, 0.5f, TRC_DISPLACEMENT_TRUE);
    build(&s, &desc, &desc);
    desc = mover(&list, 0.25f, TRC_DISPLACEMENT_TRUE);
    assert_int_equal(trc_material_update(s.scene, s.materials[0], &desc), TRC_OK);
    assert_int_equal(trc_material_update(s.scene, s.materials[1], &desc), TRC_OK);
    trc_status status = TRC_ERROR_OUT_OF_MEMORY;
    uint32_t failures = 0;
    for (; status != TRC_OK && failures < 1000; failures++) {
        expect_moved(query_scene_snapshot(s.scene)->meshes[0], 2, 0.5f);
        trc_memory_fail_at(failures, true);
        status = trc_scene_commit(s.scene);
        trc_memory_fail_at(-1, false);
        assert_true(status == TRC_OK || status == TRC_ERROR_OUT_OF_MEMORY);
    }
    assert_int_equal(status, TRC_OK);
    assert_true(failures > 15); /* those of the displacement among them */
    for (uint32_t v = 0; v < 4; v++)
        expect_moved(query_scene_snapshot(s.scene)->meshes[0], v, 0.25f);
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

/* Numbers that are none move nothing. */
static void bad_numbers_move_nothing(void **state) {
    (void)state;
    struct node_list list;
    struct stage s;
    const trc_material_desc desc = mover(&list, 3e38f, TRC_DISPLACEMENT_TRUE);
    build(&s, &desc, &desc);
    const struct trc_mesh *mesh = query_scene_snapshot(s.scene)->meshes[0];
    for (uint32_t i = 0; i < 12; i++)
        assert_true(isfinite(mesh->positions[i]));
    assert_int_equal(trc_scene_destroy(s.scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(vertices_move),
        cmocka_unit_test(slots_move_their_own),
        cmocka_unit_test(shapes_are_kept),
        cmocka_unit_test(first_triangles_rule),
        cmocka_unit_test(normals_are_made_anew),
        cmocka_unit_test(generated_coordinates_stay),
        cmocka_unit_test(edits_are_followed),
        cmocka_unit_test(memory_may_end),
        cmocka_unit_test(bad_numbers_move_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
