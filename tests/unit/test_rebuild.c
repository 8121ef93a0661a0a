/* Trees that grow bad as their meshes are posed are built anew beside the scene. */
#include "fixture.h"

#include <sched.h>

#include "bvh/bvh.h"
#include "bvh_check.h"
#include "query_scene.h"
#include "scene/rebuild.h"
#include "scene/scene.h"

#define SHEET_SIDE 40u
#define SHEET_VERTICES (SHEET_SIDE * SHEET_SIDE)
#define SHEET_TRIANGLES (2 * (SHEET_SIDE - 1) * (SHEET_SIDE - 1))

/* A flat sheet, each vertex a share of the way to where another one was. */
static void sheet_positions(float share, float positions[3 * SHEET_VERTICES]) {
    for (uint32_t i = 0; i < SHEET_VERTICES; i++) {
        const uint32_t other = i * 611u % SHEET_VERTICES; /* coprime: no two go to the same */
        const float x = (float)(i % SHEET_SIDE), y = (float)(i / SHEET_SIDE);
        const float to_x = (float)(other % SHEET_SIDE), to_y = (float)(other / SHEET_SIDE);
        positions[3 * i] = ((1.0f - share) * x + share * to_x) / SHEET_SIDE - 0.5f;
        positions[3 * i + 1] = ((1.0f - share) * y + share * to_y) / SHEET_SIDE - 0.5f;
        positions[3 * i + 2] = 0.01f * share * (float)(i % 7);
    }
}

struct sheet {
    trc_scene scene;
    trc_id mesh, instance;
};

static struct sheet sheet_create(uint32_t is_final, float share) {
    static float positions[3 * SHEET_VERTICES];
    static uint32_t indices[3 * SHEET_TRIANGLES];
    uint32_t *index = indices;
    for (uint32_t y = 0; y + 1 < SHEET_SIDE; y++)
        for (uint32_t x = 0; x + 1 < SHEET_SIDE; x++) {
            const uint32_t i = y * SHEET_SIDE + x;
            const uint32_t corners[6] = {
                i, i + 1, i + SHEET_SIDE, i + 1, i + SHEET_SIDE + 1, i + SHEET_SIDE};
            memcpy(index, corners, sizeof corners);
            index += 6;
        }
    sheet_positions(share, positions);
    trc_mesh_desc mesh = default_mesh_desc();
    mesh.vertex_count = SHEET_VERTICES;
    mesh.triangle_count = SHEET_TRIANGLES;
    mesh.positions = positions;
    mesh.position_count = 3 * SHEET_VERTICES;
    mesh.indices = indices;
    mesh.index_count = 3 * SHEET_TRIANGLES;
    trc_scene_desc desc = default_scene_desc();
    desc.is_final = is_final;
    struct sheet sheet = {0};
    assert_int_equal(trc_scene_create(&desc, &sheet.scene), TRC_OK);
    assert_int_equal(trc_mesh_create(sheet.scene, &mesh, &sheet.mesh), TRC_OK);
    trc_instance_desc instance = default_instance_desc(sheet.mesh);
    instance.visibility = TRC_VISIBLE_CAMERA; /* keeps it out of a joined tree */
    assert_int_equal(trc_instance_create(sheet.scene, &instance, &sheet.instance), TRC_OK);
    assert_int_equal(trc_scene_commit(sheet.scene), TRC_OK);
    return sheet;
}

static void sheet_pose(const struct sheet *sheet, float share) {
    static float positions[3 * SHEET_VERTICES];
    sheet_positions(share, positions);
    assert_int_equal(
        trc_mesh_update(sheet->scene, sheet->mesh, 1, positions, 3 * SHEET_VERTICES, NULL, 0),
        TRC_OK);
    assert_int_equal(trc_scene_commit(sheet->scene), TRC_OK);
}

/* Waits for a rebuild that is under way; whether there is one. */
static bool await_rebuild(trc_scene scene) {
    struct trc_scene_access access;
    assert_int_equal(trc_scene_enter(scene, &access), TRC_OK);
    const struct trc_rebuild *rebuild = access.scene->rebuild;
    while (rebuild && !trc_rebuild_is_done(rebuild))
        sched_yield();
    trc_scene_leave(&access);
    return rebuild != NULL;
}

/* Poses until a rebuild has started; the share of the last. No pose builds at once. */
static float pose_until_grown(const struct sheet *sheet) {
    float share = 0.0f;
    while (!await_rebuild(sheet->scene)) {
        share += 0.002f;
        assert_true(share < 0.5f);
        sheet_pose(sheet, share);
        assert_int_equal(query_scene_stats(sheet->scene).built_count, 0);
        assert_int_equal(query_scene_stats(sheet->scene).refitted_count, 1);
    }
    return share;
}

/* The same hits as in a scene that was made with that pose, and a sound tree. */
static void expect_fresh_hits(const struct sheet *sheet, float share) {
    enum { RAYS = 1000 };
    static float o[3][RAYS], d[3][RAYS], distance[2][RAYS];
    static uint32_t instance[RAYS], triangle[2][RAYS];
    for (uint32_t i = 0; i < RAYS; i++) {
        o[0][i] = (float)(i * 7919u % RAYS) / RAYS - 0.5f;
        o[1][i] = (float)(i * 6101u % RAYS) / RAYS - 0.5f;
        o[2][i] = 1.0f;
        d[0][i] = 0.1f;
        d[1][i] = -0.05f;
        d[2][i] = -1.0f;
    }
    const trc_rays rays = {.struct_size = sizeof rays,
                           .visibility = TRC_VISIBLE_ALL,
                           .count = RAYS,
                           .origin_x = o[0],
                           .origin_y = o[1],
                           .origin_z = o[2],
                           .direction_x = d[0],
                           .direction_y = d[1],
                           .direction_z = d[2]};
    const struct sheet fresh = sheet_create(0, share);
    for (int i = 0; i < 2; i++) {
        const trc_hits hits = {.struct_size = sizeof hits,
                               .instance = instance,
                               .triangle = triangle[i],
                               .distance = distance[i]};
        assert_int_equal(trc_query_closest(i ? fresh.scene : sheet->scene, &rays, 0, &hits),
                         TRC_OK);
    }
    assert_true(instance[RAYS / 2] == 0);
    assert_memory_equal(triangle[0], triangle[1], sizeof triangle[0]);
    assert_memory_equal(distance[0], distance[1], sizeof distance[0]);
    assert_int_equal(trc_scene_destroy(fresh.scene), TRC_OK);
    char message[256];
    const struct trc_snapshot *snapshot = query_scene_snapshot(sheet->scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s", message);
}

static void grown_trees_are_rebuilt_apart(void **state) {
    (void)state;
    const struct sheet sheet = sheet_create(0, 0.0f);
    const float grown = pose_until_grown(&sheet);
    assert_true(trc_bvh_has_grown(query_scene_snapshot(sheet.scene)->bvh, 0));
    expect_fresh_hits(&sheet, grown);
    sheet_pose(&sheet, grown + 0.002f); /* takes the tree of the pose before */
    assert_int_equal(query_scene_stats(sheet.scene).built_count, 0);
    assert_false(trc_bvh_has_grown(query_scene_snapshot(sheet.scene)->bvh, 0));
    assert_false(await_rebuild(sheet.scene));
    expect_fresh_hits(&sheet, grown + 0.002f);
    assert_int_equal(trc_scene_destroy(sheet.scene), TRC_OK);
}

/* Another edit takes the tree as it is; an edit of the view leaves it for later. */
static void rebuilt_trees_wait_to_be_taken(void **state) {
    (void)state;
    const struct sheet sheet = sheet_create(0, 0.0f);
    const float grown = pose_until_grown(&sheet);
    const trc_camera_desc camera = default_camera_desc();
    assert_int_equal(trc_scene_set_camera(sheet.scene, &camera), TRC_OK);
    assert_int_equal(trc_scene_commit(sheet.scene), TRC_OK);
    assert_true(trc_bvh_has_grown(query_scene_snapshot(sheet.scene)->bvh, 0));
    trc_instance_desc instance = default_instance_desc(sheet.mesh);
    assert_int_equal(trc_instance_update(sheet.scene, sheet.instance, &instance), TRC_OK);
    assert_int_equal(trc_scene_commit(sheet.scene), TRC_OK);
    assert_int_equal(query_scene_stats(sheet.scene).built_count +
                         query_scene_stats(sheet.scene).refitted_count,
                     0);
    assert_false(trc_bvh_has_grown(query_scene_snapshot(sheet.scene)->bvh, 0));
    expect_fresh_hits(&sheet, grown);
    assert_int_equal(trc_scene_destroy(sheet.scene), TRC_OK);
}

/* A mesh that goes, or the scene, while its tree is under way; final scenes build at once. */
static void rebuilds_end_with_what_they_are_for(void **state) {
    (void)state;
    const struct sheet gone = sheet_create(0, 0.0f), freed = sheet_create(0, 0.0f);
    (void)pose_until_grown(&gone);
    assert_int_equal(trc_instance_destroy(gone.scene, gone.instance), TRC_OK);
    assert_int_equal(trc_mesh_destroy(gone.scene, gone.mesh), TRC_OK);
    assert_int_equal(trc_scene_commit(gone.scene), TRC_OK);
    assert_false(await_rebuild(gone.scene));
    assert_int_equal(trc_scene_destroy(gone.scene), TRC_OK);
    const float grown = pose_until_grown(&freed);
    assert_int_equal(trc_scene_destroy(freed.scene), TRC_OK);
    const struct sheet final = sheet_create(1, 0.0f);
    sheet_pose(&final, grown);
    assert_int_equal(query_scene_stats(final.scene).built_count, 1);
    assert_false(await_rebuild(final.scene));
    assert_int_equal(trc_scene_destroy(final.scene), TRC_OK);
}

static bool has_rebuild(trc_scene scene) {
    struct trc_scene_access access;
    assert_int_equal(trc_scene_enter(scene, &access), TRC_OK);
    const bool found = access.scene->rebuild != NULL;
    trc_scene_leave(&access);
    return found;
}

/* Destroys the sheet while its tree is under way and puts a cube in its place; false if the tree
 * was done before the cube was committed. */
static bool replace_sheet(struct sheet *sheet) {
    for (float share = 0.002f; !has_rebuild(sheet->scene); share += 0.002f) {
        assert_true(share < 0.5f);
        sheet_pose(sheet, share);
    }
    const trc_mesh_desc cube = default_mesh_desc();
    assert_int_equal(trc_instance_destroy(sheet->scene, sheet->instance), TRC_OK);
    assert_int_equal(trc_mesh_destroy(sheet->scene, sheet->mesh), TRC_OK);
    assert_int_equal(trc_mesh_create(sheet->scene, &cube, &sheet->mesh), TRC_OK);
    trc_instance_desc instance = default_instance_desc(sheet->mesh);
    instance.visibility = TRC_VISIBLE_CAMERA;
    assert_int_equal(trc_instance_create(sheet->scene, &instance, &sheet->instance), TRC_OK);
    assert_int_equal(trc_scene_commit(sheet->scene), TRC_OK);
    return has_rebuild(sheet->scene);
}

/* The tree of a mesh that has gone is not for the one in its place. */
static void rebuilds_are_for_their_own_mesh(void **state) {
    (void)state;
    bool is_under_way = false;
    for (int trial = 0; trial < 200 && !is_under_way; trial++) {
        struct sheet sheet = sheet_create(0, 0.0f);
        is_under_way = replace_sheet(&sheet);
        if (is_under_way) {
            float posed[24];
            char message[256];
            assert_true(await_rebuild(sheet.scene));
            for (int i = 0; i < 24; i++)
                posed[i] = 1.01f * cube_positions[i];
            assert_int_equal(trc_mesh_update(sheet.scene, sheet.mesh, 1, posed, 24, NULL, 0),
                             TRC_OK);
            assert_int_equal(trc_scene_commit(sheet.scene), TRC_OK);
            const struct trc_snapshot *snapshot = query_scene_snapshot(sheet.scene);
            if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
                fail_msg("%s", message);
        }
        assert_int_equal(trc_scene_destroy(sheet.scene), TRC_OK);
    }
    assert_true(is_under_way);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(grown_trees_are_rebuilt_apart),
        cmocka_unit_test(rebuilt_trees_wait_to_be_taken),
        cmocka_unit_test(rebuilds_end_with_what_they_are_for),
        cmocka_unit_test(rebuilds_are_for_their_own_mesh),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
