/* Meshes as they come in: normals, bounds, keys, and input that cannot be used. */
#include "fixture.h"

#include <stdatomic.h>
#include <stdbool.h>

#include "core/pool.h"
#include "model/names.h"
#include "scene/mesh.h"

static void normals_are_weighted_by_angle(void **state) {
    (void)state;
    struct trc_names *names = trc_names_create();
    struct trc_pool *pool = NULL;
    struct trc_mesh *mesh = NULL;
    const atomic_uint cancel = 0;
    assert_int_equal(trc_pool_create(3, &pool), TRC_OK);
    trc_mesh_desc desc = default_mesh_desc();
    desc.smooth = cube_smooth;
    assert_int_equal(trc_geometry_create(&desc, names, &mesh), TRC_OK);
    assert_int_equal(trc_geometry_finish(mesh, pool, &cancel), TRC_OK);
    /* A cube's corners point along its diagonals however its faces are cut in two: only weights by
     * angle do that. */
    for (int i = 0; i < 24; i++) {
        assert_true(fabsf(mesh->vertex_normals[i] - cube_positions[i] * 0.57735027f) < 1e-6f);
    }
    for (int i = 0; i < 3; i++) {
        assert_true(mesh->bounds_lower[i] == -1.0f && mesh->bounds_upper[i] == 1.0f);
    }
    trc_geometry_release(mesh);
    trc_pool_destroy(pool);
    trc_names_destroy(names);
}

static void bad_vertices_do_not_spread(void **state) {
    (void)state;
    float positions[30];
    memcpy(positions, cube_positions, sizeof cube_positions);
    const float extra[6] = {NAN, 0, 0, 0, 3e18f, 0};
    memcpy(positions + 24, extra, sizeof extra);
    uint32_t indices[42];
    memcpy(indices, cube_indices, sizeof cube_indices);
    const uint32_t more[6] = {0, 1, 8, 9, 2, 3};
    memcpy(indices + 36, more, sizeof more);
    uint8_t smooth[14];
    memset(smooth, 1, sizeof smooth);
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = 10;
    desc.triangle_count = 14;
    desc.positions = positions;
    desc.position_count = 30;
    desc.indices = indices;
    desc.index_count = 42;
    desc.smooth = smooth;
    struct trc_names *names = trc_names_create();
    struct trc_pool *pool = NULL;
    struct trc_mesh *mesh = NULL;
    const atomic_uint cancel = 0;
    assert_int_equal(trc_pool_create(1, &pool), TRC_OK);
    assert_int_equal(trc_geometry_create(&desc, names, &mesh), TRC_OK);
    assert_int_equal(trc_geometry_finish(mesh, pool, &cancel), TRC_OK);
    for (int i = 0; i < 24; i++) {
        assert_true(fabsf(mesh->vertex_normals[i] - cube_positions[i] * 0.57735027f) < 1e-6f);
    }
    for (int i = 24; i < 30; i++)
        assert_true(isfinite(mesh->vertex_normals[i]));
    for (int i = 0; i < 3; i++) {
        assert_true(mesh->bounds_lower[i] == -1.0f && mesh->bounds_upper[i] == 1.0f);
    }
    trc_geometry_release(mesh);
    trc_pool_destroy(pool);
    trc_names_destroy(names);
}

/* Normals and coordinates that cannot be interpolated are replaced when a mesh comes in. */
static void bad_normals_are_replaced(void **state) {
    (void)state;
    static float vertex[24], corner[108], generated[24];
    const float bad[][3] = {{NAN, 0, 0}, {0, 0, 0}, {1e9f, 0, 0}, {0, INFINITY, 0}};
    for (uint32_t kind = TRC_NORMALS_VERTEX; kind <= TRC_NORMALS_CORNER; kind++) {
        float *normals = kind == TRC_NORMALS_VERTEX ? vertex : corner;
        const uint32_t count = kind == TRC_NORMALS_VERTEX ? 8 : 36;
        for (uint32_t i = 0; i < count; i++)
            memcpy(normals + 3 * i, bad[i % 4], sizeof bad[0]);
        for (int i = 0; i < 24; i++)
            generated[i] = i % 2 ? NAN : 0.25f;
        trc_mesh_desc desc = default_mesh_desc();
        desc.normal_kind = kind;
        desc.normals = normals;
        desc.normal_count = 3 * count;
        desc.smooth = cube_smooth;
        desc.generated = generated;
        desc.generated_count = 24;
        struct trc_names *names = trc_names_create();
        struct trc_mesh *mesh = NULL;
        assert_int_equal(trc_geometry_create(&desc, names, &mesh), TRC_OK);
        const float *stored =
            kind == TRC_NORMALS_VERTEX ? mesh->vertex_normals : mesh->corner_normals;
        for (uint32_t i = 0; i < count; i++) { /* away from the origin */
            const float *p =
                cube_positions + 3 * (kind == TRC_NORMALS_VERTEX ? i : cube_indices[i]);
            for (int axis = 0; axis < 3; axis++)
                assert_true(fabsf(stored[3 * i + axis] - p[axis] * 0.57735027f) < 1e-6f);
        }
        for (int i = 0; i < 24; i++)
            assert_true(mesh->generated[i] == (i % 2 ? 0.0f : 0.25f));
        trc_geometry_release(mesh);
        trc_names_destroy(names);
    }
}

/* Bounds over blocks of points, over the rest of them, and past points that do not count. */
static void bounds_are_those_of_valid_points(void **state) {
    (void)state;
    enum { MOST = 70 };
    static float positions[3 * MOST];
    static const uint32_t indices[3] = {0, 1, 2};
    for (uint32_t count = 3; count <= MOST; count++) {
        for (uint32_t spoiled = 0; spoiled < 2; spoiled++) {
            float lower[3] = {INFINITY, INFINITY, INFINITY},
                  upper[3] = {-INFINITY, -INFINITY, -INFINITY};
            for (uint32_t i = 0; i < count; i++) {
                const bool bad = spoiled && i == count / 2;
                for (int axis = 0; axis < 3; axis++) {
                    const float x = (float)((i * 37 + 11 * (uint32_t)axis) % 101) - 50.0f;
                    positions[3 * i + axis] = bad && axis == 1 ? NAN : x;
                    lower[axis] = bad ? lower[axis] : fminf(lower[axis], x);
                    upper[axis] = bad ? upper[axis] : fmaxf(upper[axis], x);
                }
            }
            trc_mesh_desc desc = default_mesh_desc();
            desc.vertex_count = count;
            desc.positions = positions;
            desc.position_count = 3 * count;
            desc.triangle_count = 1;
            desc.indices = indices;
            desc.index_count = 3;
            struct trc_names *names = trc_names_create();
            struct trc_mesh *mesh = NULL;
            assert_int_equal(trc_geometry_create(&desc, names, &mesh), TRC_OK);
            assert_memory_equal(mesh->bounds_lower, lower, sizeof lower);
            assert_memory_equal(mesh->bounds_upper, upper, sizeof upper);
            trc_geometry_release(mesh);
            trc_names_destroy(names);
        }
    }
}

static void normals_do_not_depend_on_threads(void **state) {
    (void)state;
    enum { SIDE = 150 };
    static float positions[2 * SIDE * SIDE * 3];
    static uint32_t indices[(SIDE - 1) * (SIDE - 1) * 6];
    static uint8_t smooth[(SIDE - 1) * (SIDE - 1) * 2];
    memset(smooth, 1, sizeof smooth);
    uint32_t n = 0;
    for (uint32_t k = 0; k < 2 * SIDE * SIDE; k++) {
        positions[3 * k] = (float)(k % SIDE);
        positions[3 * k + 1] = (float)(k / SIDE % SIDE);
        positions[3 * k + 2] = sinf(0.37f * (float)k);
    }
    for (uint32_t y = 0; y + 1 < SIDE; y++) {
        for (uint32_t x = 0; x + 1 < SIDE; x++) {
            const uint32_t a = y * SIDE + x;
            const uint32_t quad[6] = {a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE};
            memcpy(indices + n, quad, sizeof quad);
            n += 6;
        }
    }
    trc_mesh_desc desc = {.struct_size = sizeof desc,
                          .key_count = 2,
                          .vertex_count = SIDE * SIDE,
                          .triangle_count = n / 3,
                          .positions = positions,
                          .position_count = 2 * SIDE * SIDE * 3,
                          .indices = indices,
                          .index_count = n,
                          .smooth = smooth};
    struct trc_names *names = trc_names_create();
    struct trc_mesh *meshes[2] = {0};
    const atomic_uint cancel = 0, cancelled = 1;
    for (uint32_t i = 0; i < 2; i++) {
        struct trc_pool *pool = NULL;
        assert_int_equal(trc_pool_create(i ? 4 : 1, &pool), TRC_OK);
        assert_int_equal(trc_geometry_create(&desc, names, &meshes[i]), TRC_OK);
        assert_int_equal(trc_geometry_finish(meshes[i], pool, &cancelled), TRC_ERROR_CANCELLED);
        assert_null(meshes[i]->vertex_normals);
        assert_int_equal(trc_geometry_finish(meshes[i], pool, &cancel), TRC_OK);
        trc_pool_destroy(pool);
    }
    assert_int_equal(meshes[0]->key_count, 2);
    assert_memory_equal(meshes[0]->vertex_normals, meshes[1]->vertex_normals,
                        2 * SIDE * SIDE * 3 * sizeof(float));
    trc_geometry_release(meshes[0]);
    trc_geometry_release(meshes[1]);
    trc_names_destroy(names);
}

static void equal_keys_become_one(void **state) {
    (void)state;
    float positions[48];
    memcpy(positions, cube_positions, sizeof cube_positions);
    memcpy(positions + 24, cube_positions, sizeof cube_positions);
    trc_mesh_desc desc = default_mesh_desc();
    desc.key_count = 2;
    desc.positions = positions;
    desc.position_count = 48;
    struct trc_names *names = trc_names_create();
    struct trc_mesh *mesh = NULL, *pose = NULL;
    assert_int_equal(trc_geometry_create(&desc, names, &mesh), TRC_OK);
    assert_int_equal(mesh->key_count, 1);
    positions[47] = 2.0f;
    assert_int_equal(trc_geometry_pose(mesh, 2, positions, NULL, &pose), TRC_OK);
    assert_int_equal(pose->key_count, 2);
    assert_ptr_equal(pose->indices, mesh->indices);
    assert_true(pose->bounds_upper[2] == 2.0f);
    trc_geometry_release(mesh);
    assert_int_equal(pose->indices[35],
                     cube_indices[35]); /* the topology lives with its last pose */
    trc_geometry_release(pose);
    trc_names_destroy(names);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_are_weighted_by_angle),
        cmocka_unit_test(bad_vertices_do_not_spread),
        cmocka_unit_test(bad_normals_are_replaced),
        cmocka_unit_test(bounds_are_those_of_valid_points),
        cmocka_unit_test(normals_do_not_depend_on_threads),
        cmocka_unit_test(equal_keys_become_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
