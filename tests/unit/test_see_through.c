/* Shadow rays skip subtrees of what is transparent to them: trees know which those are, and what is
 * clear in a picture is as if it were not there. */
#include "level_test.h"

#include "bvh_check.h"
#include "meshes.h"
#include "model/tree.h"
#include "query_scene.h"

enum { TRIANGLES = 400, KEYS = 2 };

/* Triangles above the camera, in slots of two materials: for x above 2 m all in the second. */
struct soup {
    struct mesh mesh;
    uint16_t slots[TRIANGLES];
};

static void soup_make(struct soup *soup, uint32_t key_count) {
    static const float lower[3] = {-0.5f, -1, 2}, upper[3] = {4.5f, 1, 4};
    static const float moved[12] = {1, 0, 0, 0.1f, 0, 1, 0, 0, 0, 0, 1, 0};
    struct rng rng = rng_seed(11);
    mesh_init(&soup->mesh);
    mesh_add_soup(&soup->mesh, &rng, TRIANGLES, lower, upper, 0.15f);
    for (uint32_t i = 0; i < TRIANGLES; i++) {
        const uint32_t corner = soup->mesh.indices[3 * i];
        soup->slots[i] = soup->mesh.positions[3 * corner] > 2.0f || i % 3;
    }
    if (key_count > 1) {
        mesh_set_keys(&soup->mesh, key_count);
        mesh_key_transform(&soup->mesh, 1, moved);
    }
}

/* A mesh of those of its triangles, in both slots or in the first alone. */
static trc_id soup_create(trc_scene scene, const struct soup *soup, bool whole) {
    static uint32_t indices[3 * TRIANGLES];
    static uint16_t slots[TRIANGLES];
    uint32_t count = 0;
    for (uint32_t i = 0; i < TRIANGLES; i++)
        if (whole || soup->slots[i] == 0) {
            memcpy(indices + 3 * count, soup->mesh.indices + 3 * i, 3 * sizeof *indices);
            slots[count++] = soup->slots[i];
        }
    trc_mesh_desc desc = default_mesh_desc();
    desc.key_count = soup->mesh.key_count;
    desc.vertex_count = soup->mesh.vertex_count;
    desc.triangle_count = count;
    desc.positions = soup->mesh.positions;
    desc.position_count = (uint64_t)3 * desc.vertex_count * desc.key_count;
    desc.indices = indices;
    desc.index_count = (uint64_t)3 * count;
    desc.material_index = slots;
    trc_id mesh = 0;
    assert_ok(trc_mesh_create(scene, &desc, &mesh));
    return mesh;
}

static void soup_place(trc_scene scene, trc_id mesh, const trc_id materials[2], float turn,
                       float lift) {
    static const float up[3] = {0, 0, 1}, scale[3] = {1, 1, 1};
    const float offset[3] = {0, 0, lift};
    float transform[12];
    trc_id id = 0;
    query_transform(up, turn, scale, offset, transform);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.transforms = transform;
    desc.materials = materials;
    desc.material_count = 2;
    assert_ok(trc_instance_create(scene, &desc, &id));
}

struct shade {
    trc_scene scene;
    trc_id mesh, clear; /* clear: the material */
};

/* Soups over a floor under a sun: two that share a tree, one that moves and, where clear, one all
 * of whose triangles are. Without clear the others' clear triangles are not there, either. */
static struct shade shade_make(bool is_final, bool clear) {
    struct shade s = {0};
    trc_scene_desc desc = default_scene_desc();
    trc_light_desc sun = default_light_desc();
    trc_id id = 0;
    struct soup still, moving;
    desc.is_final = is_final;
    s.scene = fixture_level_view_in(&desc);
    sun.type = TRC_LIGHT_SUN;
    sun.strength = (float)PI;
    assert_ok(trc_light_create(s.scene, &sun, &id));
    fixture_level(s.scene, 20.0f, 0.0f, fixture_material(s.scene, TRC_NODE_DIFFUSE, 0.5f));
    const trc_id matt = fixture_material(s.scene, TRC_NODE_DIFFUSE, 0.5f);
    if (clear) /* without the material shadow rays ask for what is in the way alone */
        s.clear = fixture_clear(s.scene);
    const trc_id mixed[2] = {matt, clear ? s.clear : matt}, all[2] = {s.clear, s.clear};
    soup_make(&still, 1);
    soup_make(&moving, KEYS);
    s.mesh = soup_create(s.scene, &still, clear);
    soup_place(s.scene, s.mesh, mixed, 0.0f, 0.0f);
    soup_place(s.scene, s.mesh, mixed, 0.05f, 3.0f);
    soup_place(s.scene, soup_create(s.scene, &moving, clear), mixed, 0.0f, 6.0f);
    if (clear)
        soup_place(s.scene, soup_create(s.scene, &still, true), all, 0.0f, 9.0f);
    mesh_free(&still.mesh);
    mesh_free(&moving.mesh);
    assert_ok(trc_scene_commit(s.scene));
    return s;
}

static void expect_marked(trc_scene scene, bool expected) {
    char message[256] = "";
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s", message);
    uint32_t marked = 0;
    for (uint32_t i = 0; i < snapshot->bvh->blas_count; i++)
        marked += snapshot->bvh->blas[i] && snapshot->bvh->blas[i]->tree.see_through;
    const struct trc_joined_tree *joined = snapshot->bvh->joined;
    marked += snapshot->bvh->top.see_through || (joined && joined->tree.see_through);
    assert_true(expected ? marked > 1 : marked == 0);
}

static void draw(trc_scene scene, float pixels[4 * LEVEL_PIXELS]) {
    trc_render_desc desc = level_desc(4);
    desc.max_transparent_depth = 200;
    render(scene, &desc, pixels);
}

static void clear_triangles_are_as_if_away(void **state) {
    (void)state;
    for (int is_final = 0; is_final < 2; is_final++) {
        static float found[4 * LEVEL_PIXELS], want[4 * LEVEL_PIXELS];
        const struct shade with = shade_make(is_final, true), without = shade_make(is_final, false);
        double sum = 0.0;
        expect_marked(with.scene, true);
        draw(with.scene, found);
        draw(without.scene, want);
        for (int i = 0; i < 4 * LEVEL_PIXELS; i++) {
            assert_true(fabsf(found[i] - want[i]) <= 1e-5f);
            sum += i % 4 == 3 ? 0.0 : want[i];
        }
        /* Part of the floor is in shadow, part not. */
        assert_true(sum > 0.05 * 3 * LEVEL_PIXELS && sum < 0.45 * 3 * LEVEL_PIXELS);
        assert_ok(trc_scene_destroy(with.scene));
        assert_ok(trc_scene_destroy(without.scene));
    }
}

/* By refits, and where nothing is transparent any more. */
static void edits_keep_and_clear_the_marks(void **state) {
    (void)state;
    const struct shade s = shade_make(false, true);
    struct soup soup;
    struct default_material matt;
    soup_make(&soup, 1);
    for (uint32_t i = 0; i < 3 * soup.mesh.vertex_count; i++)
        soup.mesh.positions[i] *= 1.01f;
    assert_ok(trc_mesh_update(s.scene, s.mesh, 1, soup.mesh.positions,
                              (uint64_t)3 * soup.mesh.vertex_count, NULL, 0));
    mesh_free(&soup.mesh);
    assert_ok(trc_scene_commit(s.scene));
    expect_marked(s.scene, true);
    default_material_init(&matt, TRC_NODE_DIFFUSE);
    assert_ok(trc_material_update(s.scene, s.clear, &matt.desc));
    assert_ok(trc_scene_commit(s.scene));
    expect_marked(s.scene, false);
    assert_ok(trc_scene_destroy(s.scene));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clear_triangles_are_as_if_away),
        cmocka_unit_test(edits_keep_and_clear_the_marks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
