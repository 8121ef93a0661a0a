/* Every allocation and thread start of a whole session is made to fail, one after the other, once
 * or from there on. Each call must then succeed or fail cleanly: an error with a message, outputs
 * untouched, the object usable (the same call succeeds at once), nothing lost at the end. */
#include "fixture.h"

#include <stdbool.h>
#include <stdlib.h>

#include "core/core.h"
#include "meshes.h"

#define UNTOUCHED UINT64_C(0x1234567812345678)

/* A failed call is checked and made again without failures. */
static bool failed_cleanly(trc_status status) {
    if (status == TRC_OK)
        return false;
    trc_memory_fail_at(-1, false);
    assert_true(status == TRC_ERROR_OUT_OF_MEMORY || status == TRC_ERROR_NO_THREAD);
    assert_true(trc_last_message()[0] != '\0');
    return true;
}

#define STEP(call)                            \
    do {                                      \
        (void)trc_fail(TRC_OK, "%s", "");     \
        if (failed_cleanly(call))             \
            assert_int_equal((call), TRC_OK); \
    } while (0)

/* The same for a call that makes something. */
#define STEP_OUT(out, call)                            \
    do {                                               \
        (out) = UNTOUCHED;                             \
        (void)trc_fail(TRC_OK, "%s", "");              \
        if (failed_cleanly(call)) {                    \
            assert_true((out) == UNTOUCHED);           \
            assert_int_equal((call), TRC_OK);          \
        }                                              \
        assert_true((out) != UNTOUCHED && (out) != 0); \
    } while (0)

struct session {
    trc_scene scene;
    trc_id mesh, curves, instance, second, strands, material, glow, image, light;
};

static const float strand_points[2][3][4] = {
    {{-1, 0, 1.5f, 0.1f}, {0, 0.5f, 1.5f, 0.1f}, {1, 0, 1.5f, 0.1f}},
    {{-1, 0, 1.6f, 0.1f}, {0, 0.5f, 1.6f, 0.1f}, {1, 0, 1.6f, 0.1f}}};
#define STRAND_FLOATS 12

/* A strand in motion. */
static void create_curves(struct session *s) {
    static const uint32_t length = 3;
    static const float uv[2], generated[3];
    const trc_curve_attribute attribute = {.struct_size = sizeof attribute,
                                           .width = 2,
                                           .name = "UVMap",
                                           .values = uv,
                                           .value_count = 2,
                                           .per_strand = 1};
    trc_curves_desc desc = trc_curves_desc_default();
    desc.key_count = 2;
    desc.point_count = 3;
    desc.points = strand_points[0][0];
    desc.point_value_count = 2 * STRAND_FLOATS;
    desc.lengths = &length;
    desc.strand_count = 1;
    desc.generated = generated;
    desc.generated_count = 3;
    desc.attributes = &attribute;
    desc.attribute_count = 1;
    STEP_OUT(s->curves, trc_curves_create(s->scene, &desc, &s->curves));
    const trc_instance_desc instance = default_instance_desc(s->curves);
    STEP_OUT(s->strands, trc_instance_create(s->scene, &instance, &s->strands));
}

static trc_mesh_desc rich_mesh(void) {
    static float uv[72], positions[48];
    static trc_corner_attribute attribute;
    memcpy(positions, cube_positions, sizeof cube_positions);
    memcpy(positions + 24, cube_positions, sizeof cube_positions);
    positions[47] = 1.5f;
    attribute = (trc_corner_attribute){.struct_size = sizeof attribute,
                                       .width = 2,
                                       .name = "UVMap",
                                       .values = uv,
                                       .value_count = 72};
    trc_mesh_desc desc = default_mesh_desc();
    desc.key_count = 2;
    desc.positions = positions;
    desc.position_count = 48;
    desc.smooth = cube_smooth;
    desc.material_index = cube_slots;
    desc.attributes = &attribute;
    desc.attribute_count = 1;
    return desc;
}

/* A diffuse material that reads the image by the mesh's UV map: attribute name, program, texture.
 */
static void create_textured(struct session *s) {
    const trc_node nodes[3] = {
        {.type = TRC_NODE_UV_MAP, .name = "UVMap"},
        {.type = TRC_NODE_IMAGE, .first_input = 0, .input_count = 2, .image = s->image},
        {.type = TRC_NODE_DIFFUSE, .first_input = 2, .input_count = 3}};
    const trc_node_input inputs[5] = {
        {.node = 0}, {.node = -1}, {.node = 1}, {.node = -1}, {.node = -2}};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 3,
                                    .nodes = nodes,
                                    .inputs = inputs,
                                    .input_count = 5,
                                    .surface = 2};
    STEP_OUT(s->material, trc_material_create(s->scene, &desc, &s->material));
    STEP(trc_material_update(s->scene, s->material, &desc));
}

static void create_objects(struct session *s) {
    const trc_mesh_desc mesh = rich_mesh();
    const trc_image_desc image = default_image_desc(), none = {.struct_size = sizeof none};
    const trc_light_desc light = default_light_desc();
    struct default_material glow;
    default_material_init(&glow, TRC_NODE_EMISSION);
    STEP_OUT(s->mesh, trc_mesh_create(s->scene, &mesh, &s->mesh));
    STEP_OUT(s->image, trc_image_create(s->scene, &none, &s->image));
    create_textured(s);
    STEP(trc_image_update(s->scene, s->image, &image));
    STEP_OUT(s->glow, trc_material_create(s->scene, &glow.desc, &s->glow));
    const trc_id materials[2] = {s->material, s->glow};
    trc_instance_desc instance = default_instance_desc(s->mesh);
    instance.materials = materials;
    instance.material_count = 2;
    STEP_OUT(s->instance, trc_instance_create(s->scene, &instance, &s->instance));
    float aside[12];
    memcpy(aside, identity_transform, sizeof aside);
    aside[3] = 3.0f;
    instance.transforms = aside;
    instance.flags = TRC_INSTANCE_SHADOW_CATCHER;
    STEP_OUT(s->second, trc_instance_create(s->scene, &instance, &s->second));
    STEP(trc_instance_update(s->scene, s->second, &instance));
    STEP_OUT(s->light, trc_light_create(s->scene, &light, &s->light));
    create_curves(s);
}

static void set_view(struct session *s) {
    static const float curve[3] = {0, 1, 0};
    /* A sky that differs by direction: its importance is mapped. */
    const trc_node nodes[2] = {{.type = TRC_NODE_TEXTURE_COORDINATE},
                               {.type = TRC_NODE_BACKGROUND, .input_count = 2}};
    const trc_node_input inputs[2] = {{.node = 0}, {.node = -1, .value = {1.0f}}};
    const trc_material_desc background = {.struct_size = sizeof background,
                                          .node_count = 2,
                                          .nodes = nodes,
                                          .inputs = inputs,
                                          .input_count = 2,
                                          .surface = 1};
    trc_id material = 0;
    STEP_OUT(material, trc_material_create(s->scene, &background, &material));
    trc_world_desc world = default_world_desc(material);
    world.use_sampling = 1;
    world.map_resolution = 16;
    STEP(trc_scene_set_world(s->scene, &world));
    trc_camera_desc camera = default_camera_desc();
    camera.shutter_time = 0.5f;
    camera.shutter_curve = curve;
    camera.shutter_curve_count = 3;
    STEP(trc_scene_set_camera(s->scene, &camera));
}

static void check_render(struct session *s, uint32_t progressive) {
    enum { WIDTH = 33, HEIGHT = 1 }; /* two tiles; hundreds of sessions run */
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, progressive ? 8 : 4);
    desc.progressive = progressive;
    if (progressive) {
        desc.noise_threshold = 0.1f;
        desc.min_samples = 4;
    } else {
        desc.extra_samples = 0.25f;
    }
    desc.passes = (1u << TRC_PASS_COUNT) - 1;
    desc.cryptomattes = (1u << TRC_CRYPTOMATTE_KINDS) - 1;
    desc.cryptomatte_depth = 6;
    desc.aov_value_count = desc.aov_color_count = desc.light_group_count = 1;
    desc.denoise = 1;
    trc_render render;
    STEP_OUT(render, trc_render_start(s->scene, &desc, &render));
    STEP(trc_render_wait(render, -1.0));
    trc_render_progress progress = {.struct_size = sizeof progress};
    STEP(trc_render_poll(render, &progress));
    assert_int_equal(progress.state, TRC_PROGRESS_DONE);
    static float pixels[WIDTH * HEIGHT * 4];
    STEP(trc_render_read(render, TRC_PASS_COMBINED, pixels, WIDTH * HEIGHT * 4));
    STEP(trc_render_read_preview(render, pixels, WIDTH * HEIGHT * 4));
    for (int i = 0; i < WIDTH * HEIGHT * 4; i++)
        assert_true(isfinite(pixels[i]));
    STEP(trc_render_destroy(render));
}

static void check_queries(struct session *s) {
    static const float zero[5], up[5] = {5, 5, 5, 5, 5}, down[5] = {-1, -1, -1, -1, -1};
    uint32_t instance[5];
    uint8_t occluded[5];
    trc_rays rays = {.struct_size = sizeof rays,
                     .visibility = TRC_VISIBLE_ALL,
                     .count = 5,
                     .origin_x = zero,
                     .origin_y = zero,
                     .origin_z = up,
                     .direction_x = zero,
                     .direction_y = zero,
                     .direction_z = down};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = instance};
    STEP(trc_query_closest(s->scene, &rays, 0, &hits));
    STEP(trc_query_occluded(s->scene, &rays, 0, occluded, 5));
    rays.flags = TRC_RAYS_REORDER;
    STEP(trc_query_closest(s->scene, &rays, 0, &hits));
    STEP(trc_query_occluded(s->scene, &rays, 0, occluded, 5));
}

static void find_tangents(void) {
    static const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const float normals[9] = {0, 0, 1, 0, 0, 1, 0, 0, 1}, uvs[6] = {0, 0, 1, 0, 0, 1};
    trc_tangents_desc desc = trc_tangents_desc_default();
    desc.triangle_count = 1;
    desc.positions = positions;
    desc.normals = normals;
    desc.uvs = uvs;
    float tangents[9];
    STEP(trc_tangents_find(&desc, TRC_TANGENTS_VECTORS, tangents, 9));
}

/* Everything a host does between opening and closing a file. */
static void run_session(uint32_t is_final) {
    struct session s = {0};
    trc_scene_desc desc = default_scene_desc();
    desc.is_final = is_final;
    STEP_OUT(s.scene, trc_scene_create(&desc, &s.scene));
    create_objects(&s);
    find_tangents();
    set_view(&s);
    STEP(trc_scene_commit(s.scene));
    check_queries(&s);
    check_render(&s, 0);
    /* A pose, an edit of everything, a second commit beside the first. */
    const trc_light_desc light = default_light_desc();
    STEP(trc_mesh_update(s.scene, s.mesh, 1, cube_positions, 24, NULL, 0));
    STEP(trc_curves_update(s.scene, s.curves, 1, strand_points[1][0], STRAND_FLOATS));
    STEP(trc_light_update(s.scene, s.light, &light));
    static const float flat[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    trc_instance_desc second = default_instance_desc(s.mesh);
    second.transforms = flat;
    STEP(trc_instance_update(s.scene, s.second, &second));
    STEP(trc_scene_commit(s.scene));
    check_render(&s, 1);
    STEP(trc_instance_destroy(s.scene, s.second));
    STEP(trc_material_destroy(s.scene, s.glow));
    STEP(trc_image_destroy(s.scene, s.image));
    STEP(trc_scene_commit(s.scene));
    char text[64];
    STEP(trc_scene_get_warnings(s.scene, text, sizeof text, NULL));
    STEP(trc_scene_destroy(s.scene));
}

/* Whether the failure is still to come: the session was shorter than that. */
static bool is_pending(int64_t n) {
    bool pending = false;
    for (int64_t i = 0; i <= n && !pending; i++)
        pending = trc_memory_should_fail();
    trc_memory_fail_at(-1, false);
    return pending;
}

static void fail_everywhere(uint32_t is_final, bool all) {
    run_session(is_final); /* what stays for the life of the process is taken here */
    const uint64_t before = trc_memory_bytes();
    int64_t n = 0;
    for (bool pending = false; !pending; n++) {
        trc_memory_fail_at(n, all);
        run_session(is_final);
        pending = is_pending(n);
        assert_int_equal(trc_memory_bytes(), before);
        assert_true(n < 1000000);
    }
    assert_true(n > 100); /* the hook reaches the library */
}

static void each_operation_fails_once(void **state) {
    (void)state;
    fail_everywhere(0, false);
}

static void all_operations_fail_from_one_on(void **state) {
    (void)state;
    fail_everywhere(0, true);
}

static void each_operation_of_a_final_frame_fails_once(void **state) {
    (void)state;
    fail_everywhere(1, false);
}

/* A render needs one thread, not all it asked for. */
static void renders_go_on_with_fewer_threads(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_render_desc desc = default_render_desc(200, 200, 1);
    desc.thread_count = 4;
    int whole = 0, reduced = 0, refused = 0;
    for (int64_t n = 0; whole == 0; n++) {
        trc_render render = UNTOUCHED;
        trc_memory_fail_at(n, false);
        const trc_status status = trc_render_start(scene, &desc, &render);
        const bool consumed = !is_pending(n);
        if (status != TRC_OK) {
            assert_true(status == TRC_ERROR_OUT_OF_MEMORY || status == TRC_ERROR_NO_THREAD);
            assert_true(render == UNTOUCHED);
            refused++;
            continue;
        }
        if (consumed)
            reduced++;
        else
            whole++;
        trc_render_progress progress = {.struct_size = sizeof progress};
        assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
        assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
        assert_int_equal(progress.state, TRC_PROGRESS_DONE);
        assert_int_equal(progress.samples_done, 1);
        assert_int_equal(trc_render_destroy(render), TRC_OK);
    }
    assert_true(refused > 0 && reduced > 0);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Scenes and renders by the dozen, so that the table of handles must grow, each made while one of
 * its allocations fails. */
static void handles_without_memory(void **state) {
    (void)state;
    enum { COUNT = 40 };
    trc_scene scenes[COUNT];
    trc_render renders[COUNT];
    const trc_scene_desc scene_desc = default_scene_desc();
    trc_render_desc desc = default_render_desc(8, 8, 1);
    desc.thread_count = 1;
    const trc_scene shown = fixture_scene();
    for (uint32_t i = 0; i < COUNT; i++) {
        bool made = false;
        for (int64_t n = 0; !made; n++) {
            trc_memory_fail_at(n, false);
            scenes[i] = UNTOUCHED;
            made = !failed_cleanly(trc_scene_create(&scene_desc, &scenes[i]));
            assert_true(made != (scenes[i] == UNTOUCHED));
        }
        made = false;
        for (int64_t n = 0; !made; n++) {
            trc_memory_fail_at(n, false);
            renders[i] = UNTOUCHED;
            made = !failed_cleanly(trc_render_start(shown, &desc, &renders[i]));
            assert_true(made != (renders[i] == UNTOUCHED));
        }
        trc_memory_fail_at(-1, false);
    }
    for (uint32_t i = 0; i < COUNT; i++) {
        assert_int_equal(trc_render_destroy(renders[i]), TRC_OK);
        assert_int_equal(trc_scene_destroy(scenes[i]), TRC_OK);
    }
    assert_int_equal(trc_scene_destroy(shown), TRC_OK);
}

/* A mesh of so many triangles that all threads build its tree, posed, refitted and built anew. */
static void large_trees_without_memory(void **state) {
    (void)state;
    struct mesh grid;
    mesh_init(&grid);
    mesh_add_grid(&grid, (float[3]){-1, -1, 0}, (float[3]){2, 0, 0}, (float[3]){0, 2, 0}, 100, 100);
    const uint64_t floats = 3 * (uint64_t)grid.vertex_count;
    float *lifted = malloc(floats * sizeof *lifted);
    assert_non_null(lifted);
    for (uint64_t i = 0; i < floats; i++)
        lifted[i] = grid.positions[i] + (i % 3 == 2 ? 0.01f : 0.0f);
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = grid.vertex_count;
    desc.triangle_count = grid.triangle_count;
    desc.positions = grid.positions;
    desc.position_count = floats;
    desc.indices = grid.indices;
    desc.index_count = 3 * (uint64_t)grid.triangle_count;
    for (uint32_t is_final = 0; is_final < 2; is_final++) {
        bool pending = false;
        for (int64_t n = 0; !pending; n++) {
            const uint64_t before = trc_memory_bytes();
            trc_scene_desc scene_desc = default_scene_desc();
            scene_desc.is_final = is_final;
            struct session s = {0};
            STEP_OUT(s.scene, trc_scene_create(&scene_desc, &s.scene));
            STEP_OUT(s.mesh, trc_mesh_create(s.scene, &desc, &s.mesh));
            const trc_instance_desc instance = default_instance_desc(s.mesh);
            STEP_OUT(s.instance, trc_instance_create(s.scene, &instance, &s.instance));
            trc_memory_fail_at(n, false);
            STEP(trc_scene_commit(s.scene));
            STEP(trc_mesh_update(s.scene, s.mesh, 1, lifted, floats, NULL, 0));
            STEP(trc_scene_commit(s.scene));
            STEP(trc_mesh_update(s.scene, s.mesh, 1, grid.positions, floats, NULL, 0));
            STEP(trc_scene_commit(s.scene));
            pending = is_pending(n);
            STEP(trc_scene_destroy(s.scene));
            assert_int_equal(trc_memory_bytes(), before);
        }
    }
    free(lifted);
    mesh_free(&grid);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_operation_fails_once),
        cmocka_unit_test(all_operations_fail_from_one_on),
        cmocka_unit_test(each_operation_of_a_final_frame_fails_once),
        cmocka_unit_test(renders_go_on_with_fewer_threads),
        cmocka_unit_test(handles_without_memory),
        cmocka_unit_test(large_trees_without_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
