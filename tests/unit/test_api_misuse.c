/* Bad input at the functions that edit a scene: a status and a message, outputs untouched, the
 * object still usable. (Renders and queries: test_render_misuse.c.) */
#include "misuse.h"

/* ---- handles ---- */

/* Calls every function that takes a scene with a handle that is not one. */
static void refuse_scene(trc_scene bad) {
    trc_id id = UNTOUCHED;
    uint64_t size = UNTOUCHED;
    const trc_mesh_desc mesh = default_mesh_desc();
    const trc_instance_desc instance = default_instance_desc(1);
    const trc_camera_desc camera = default_camera_desc();
    const trc_light_desc light = default_light_desc();
    const trc_world_desc world = default_world_desc(0);
    const trc_image_desc image = default_image_desc();
    const trc_render_desc render = default_render_desc(8, 8, 1);
    struct default_material material;
    default_material_init(&material, TRC_NODE_DIFFUSE);
    trc_scene_stats stats = {.struct_size = sizeof stats, .mesh_count = 77};
    char text[8] = "same";
    uint32_t hit = 5;
    uint8_t occluded = 9;
    const float zero = 0.0f;
    const trc_rays rays = {.struct_size = sizeof rays,
                           .count = 1,
                           .origin_x = &zero,
                           .origin_y = &zero,
                           .origin_z = &zero,
                           .direction_x = &zero,
                           .direction_y = &zero,
                           .direction_z = &zero};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = &hit};
    REFUSED(HANDLE, trc_scene_commit(bad));
    REFUSED(HANDLE, trc_scene_cancel(bad));
    REFUSED(HANDLE, trc_scene_get_stats(bad, &stats));
    REFUSED(HANDLE, trc_scene_get_warnings(bad, text, sizeof text, &size));
    REFUSED(HANDLE, trc_mesh_create(bad, &mesh, &id));
    REFUSED(HANDLE, trc_mesh_update(bad, 1, 1, cube_positions, 24, NULL, 0));
    REFUSED(HANDLE, trc_mesh_destroy(bad, 1));
    REFUSED(HANDLE, trc_instance_create(bad, &instance, &id));
    REFUSED(HANDLE, trc_instance_update(bad, 1, &instance));
    REFUSED(HANDLE, trc_instances_move(bad, &id, 1, 1, identity_transform, 12));
    REFUSED(HANDLE, trc_instance_destroy(bad, 1));
    REFUSED(HANDLE, trc_material_create(bad, &material.desc, &id));
    REFUSED(HANDLE, trc_material_update(bad, 1, &material.desc));
    REFUSED(HANDLE, trc_material_destroy(bad, 1));
    REFUSED(HANDLE, trc_image_create(bad, &image, &id));
    REFUSED(HANDLE, trc_image_destroy(bad, 1));
    REFUSED(HANDLE, trc_light_create(bad, &light, &id));
    REFUSED(HANDLE, trc_light_update(bad, 1, &light));
    REFUSED(HANDLE, trc_light_destroy(bad, 1));
    REFUSED(HANDLE, trc_scene_set_camera(bad, &camera));
    REFUSED(HANDLE, trc_scene_set_world(bad, &world));
    REFUSED(HANDLE, trc_render_start(bad, &render, &id));
    REFUSED(HANDLE, trc_query_closest(bad, &rays, 0, &hits));
    REFUSED(HANDLE, trc_query_occluded(bad, &rays, 0, &occluded, 1));
    REFUSED(HANDLE, trc_scene_destroy(bad));
    assert_true(id == UNTOUCHED && size == UNTOUCHED);
    assert_int_equal(stats.mesh_count, 77);
    assert_string_equal(text, "same");
    assert_int_equal(hit, 5);
    assert_int_equal(occluded, 9);
}

static void refuse_render(trc_render bad) {
    trc_render_progress progress = {.struct_size = sizeof progress, .state = 77};
    float pixel = 3.0f;
    REFUSED(HANDLE, trc_render_poll(bad, &progress));
    REFUSED(HANDLE, trc_render_wait(bad, 0.0));
    REFUSED(HANDLE, trc_render_cancel(bad));
    REFUSED(HANDLE, trc_render_read(bad, TRC_PASS_COMBINED, &pixel, 1));
    REFUSED(HANDLE, trc_render_destroy(bad));
    assert_int_equal(progress.state, 77);
    assert_true(pixel == 3.0f);
}

static void bad_handles(void **state) {
    (void)state;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_render_desc desc = default_render_desc(8, 8, 1);
    trc_scene stale = 0;
    trc_render render = 0;
    assert_int_equal(trc_scene_create(&scene_desc, &stale), TRC_OK);
    assert_int_equal(trc_scene_destroy(stale), TRC_OK);
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    const trc_scene bad[] = {0,     1, UINT64_MAX, stale, scene + 1, scene ^ (UINT64_C(1) << 63),
                             render};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        refuse_scene(bad[i]);
    const trc_render stale_render = render;
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    const trc_render bad_renders[] = {0, 1, UINT64_MAX, stale_render, scene};
    for (size_t i = 0; i < sizeof bad_renders / sizeof *bad_renders; i++) {
        refuse_render(bad_renders[i]);
    }
}

static void bad_ids(void **state) {
    (void)state;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_mesh_desc mesh = default_mesh_desc();
    const trc_light_desc light = default_light_desc();
    const trc_image_desc image = default_image_desc();
    struct default_material material;
    default_material_init(&material, TRC_NODE_DIFFUSE);
    trc_scene other = 0;
    trc_id stale = 0, foreign = 0, of_light = 0, id = UNTOUCHED;
    assert_int_equal(trc_mesh_create(scene, &mesh, &stale), TRC_OK);
    assert_int_equal(trc_mesh_destroy(scene, stale), TRC_OK);
    assert_int_equal(trc_light_create(scene, &light, &of_light), TRC_OK);
    assert_int_equal(trc_scene_create(&scene_desc, &other), TRC_OK);
    assert_int_equal(trc_mesh_create(other, &mesh, &foreign), TRC_OK);
    const trc_id bad[] = {0, 1, UINT64_MAX, stale, of_light + (UINT64_C(1) << 32), foreign};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        const trc_instance_desc instance = default_instance_desc(bad[i]);
        REFUSED(HANDLE, trc_mesh_update(scene, bad[i], 1, cube_positions, 24, NULL, 0));
        REFUSED(HANDLE, trc_mesh_destroy(scene, bad[i]));
        REFUSED(HANDLE, trc_instance_create(scene, &instance, &id));
        REFUSED(HANDLE, trc_instance_update(scene, bad[i], &instance));
        REFUSED(HANDLE, trc_instances_move(scene, &bad[i], 1, 1, identity_transform, 12));
        REFUSED(HANDLE, trc_instance_destroy(scene, bad[i]));
        REFUSED(HANDLE, trc_material_update(scene, bad[i], &material.desc));
        REFUSED(HANDLE, trc_material_destroy(scene, bad[i]));
        REFUSED(HANDLE, trc_image_update(scene, bad[i], &image));
        REFUSED(HANDLE, trc_image_destroy(scene, bad[i]));
        REFUSED(HANDLE, trc_light_update(scene, bad[i], &light));
        REFUSED(HANDLE, trc_light_destroy(scene, bad[i]));
        if (bad[i]) {
            const trc_world_desc world = default_world_desc(bad[i]);
            REFUSED(HANDLE, trc_scene_set_world(scene, &world));
        }
    }
    assert_true(id == UNTOUCHED);
    REFUSED(HANDLE, trc_mesh_destroy(scene, of_light));
    assert_int_equal(trc_scene_destroy(other), TRC_OK);
}

/* ---- descriptors ---- */

/* NULL, misaligned, and each wrong size of a descriptor. */
#define REFUSE_DESC(desc, call_with)                                       \
    do {                                                                   \
        const uint32_t right_ = (desc).struct_size;                        \
        const uint32_t wrong_[] = {0, right_ - 1, right_ + 8, UINT32_MAX}; \
        REFUSED(ARGUMENT, call_with(NULL));                                \
        REFUSED(ARGUMENT, call_with((void *)((char *)odd_storage + 2)));   \
        for (int w_ = 0; w_ < 4; w_++) {                                   \
            (desc).struct_size = wrong_[w_];                               \
            REFUSED(SIZE, call_with(&(desc)));                             \
            assert_non_null(strstr(trc_last_message(), "struct_size"));    \
        }                                                                  \
        (desc).struct_size = right_;                                       \
    } while (0)

static void wrong_struct_sizes(void **state) {
    (void)state;
    trc_id id = UNTOUCHED, mesh = 0, instance = 0, light = 0, material = 0, of_image = 0;
    trc_scene_desc scene_desc = default_scene_desc();
    trc_mesh_desc mesh_desc = default_mesh_desc();
    trc_camera_desc camera = default_camera_desc();
    trc_light_desc light_desc = default_light_desc();
    trc_world_desc world = default_world_desc(0);
    trc_image_desc image = default_image_desc();
    trc_render_desc render_desc = default_render_desc(8, 8, 1);
    trc_scene_stats stats = {.struct_size = sizeof stats};
    trc_render_progress progress = {.struct_size = sizeof progress};
    struct default_material m;
    default_material_init(&m, TRC_NODE_DIFFUSE);
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc instance_desc = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &instance_desc, &instance), TRC_OK);
    assert_int_equal(trc_light_create(scene, &light_desc, &light), TRC_OK);
    assert_int_equal(trc_material_create(scene, &m.desc, &material), TRC_OK);
    assert_int_equal(trc_image_create(scene, &image, &of_image), TRC_OK);
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &render_desc, &render), TRC_OK);
#define CALL(d) trc_scene_create(d, &id)
    REFUSE_DESC(scene_desc, CALL);
#undef CALL
#define CALL(d) trc_mesh_create(scene, d, &id)
    REFUSE_DESC(mesh_desc, CALL);
#undef CALL
#define CALL(d) trc_instance_create(scene, d, &id)
    REFUSE_DESC(instance_desc, CALL);
#undef CALL
#define CALL(d) trc_instance_update(scene, instance, d)
    REFUSE_DESC(instance_desc, CALL);
#undef CALL
#define CALL(d) trc_light_create(scene, d, &id)
    REFUSE_DESC(light_desc, CALL);
#undef CALL
#define CALL(d) trc_light_update(scene, light, d)
    REFUSE_DESC(light_desc, CALL);
#undef CALL
#define CALL(d) trc_material_create(scene, d, &id)
    REFUSE_DESC(m.desc, CALL);
#undef CALL
#define CALL(d) trc_material_update(scene, material, d)
    REFUSE_DESC(m.desc, CALL);
#undef CALL
#define CALL(d) trc_image_create(scene, d, &id)
    REFUSE_DESC(image, CALL);
#undef CALL
#define CALL(d) trc_image_update(scene, of_image, d)
    REFUSE_DESC(image, CALL);
#undef CALL
#define CALL(d) trc_scene_set_camera(scene, d)
    REFUSE_DESC(camera, CALL);
#undef CALL
#define CALL(d) trc_scene_set_world(scene, d)
    REFUSE_DESC(world, CALL);
#undef CALL
#define CALL(d) trc_render_start(scene, d, &id)
    REFUSE_DESC(render_desc, CALL);
#undef CALL
#define CALL(d) trc_scene_get_stats(scene, d)
    REFUSE_DESC(stats, CALL);
#undef CALL
#define CALL(d) trc_render_poll(render, d)
    REFUSE_DESC(progress, CALL);
#undef CALL
    assert_true(id == UNTOUCHED);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

static void missing_outputs(void **state) {
    (void)state;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    const trc_light_desc light_desc = default_light_desc();
    const trc_image_desc image = default_image_desc();
    const trc_render_desc render_desc = default_render_desc(8, 8, 1);
    struct default_material m;
    default_material_init(&m, TRC_NODE_DIFFUSE);
    trc_id mesh = 0;
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    const trc_instance_desc instance_desc = default_instance_desc(mesh);
    trc_id *const bad[] = {NULL, MISALIGNED(trc_id)};
    for (int i = 0; i < 2; i++) {
        REFUSED(ARGUMENT, trc_scene_create(&scene_desc, bad[i]));
        REFUSED(ARGUMENT, trc_mesh_create(scene, &mesh_desc, bad[i]));
        REFUSED(ARGUMENT, trc_instance_create(scene, &instance_desc, bad[i]));
        REFUSED(ARGUMENT, trc_light_create(scene, &light_desc, bad[i]));
        REFUSED(ARGUMENT, trc_material_create(scene, &m.desc, bad[i]));
        REFUSED(ARGUMENT, trc_image_create(scene, &image, bad[i]));
        REFUSED(ARGUMENT, trc_render_start(scene, &render_desc, bad[i]));
    }
    REFUSED(ARGUMENT, trc_scene_get_warnings(scene, NULL, 1, NULL));
    REFUSED(ARGUMENT, trc_scene_get_warnings(scene, NULL, 0, MISALIGNED(uint64_t)));
    assert_int_equal(trc_scene_get_warnings(scene, NULL, 0, NULL), TRC_OK);
    /* Nothing was added by the calls that could not say what. */
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
    assert_int_equal(stats.mesh_count, 2);
    assert_int_equal(stats.instance_count, 1);
    assert_int_equal(stats.light_count, 1);
    assert_int_equal(stats.material_count, 0);
}

/* ---- scenes ---- */

static void scene_limits(void **state) {
    (void)state;
    trc_scene_desc desc = default_scene_desc();
    trc_scene made = UNTOUCHED;
    desc.thread_count = 1025;
    REFUSED(LARGE, trc_scene_create(&desc, &made));
    desc.thread_count = UINT32_MAX;
    REFUSED(LARGE, trc_scene_create(&desc, &made));
    desc = default_scene_desc();
    desc.is_final = 2;
    REFUSED(ARGUMENT, trc_scene_create(&desc, &made));
    assert_true(made == UNTOUCHED);
}

static void nothing_committed(void **state) {
    (void)state;
    const trc_scene_desc scene_desc = default_scene_desc();
    const trc_render_desc desc = default_render_desc(8, 8, 1);
    trc_scene empty = 0;
    trc_render render = UNTOUCHED;
    trc_scene_stats stats = {.struct_size = sizeof stats};
    uint32_t hit = 5;
    const trc_rays rays = {.struct_size = sizeof rays};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = &hit};
    uint8_t occluded = 9;
    assert_int_equal(trc_scene_create(&scene_desc, &empty), TRC_OK);
    REFUSED(TRC_ERROR_NOT_COMMITTED, trc_render_start(empty, &desc, &render));
    REFUSED(TRC_ERROR_NOT_COMMITTED, trc_scene_get_stats(empty, &stats));
    REFUSED(TRC_ERROR_NOT_COMMITTED, trc_scene_get_warnings(empty, NULL, 0, NULL));
    REFUSED(TRC_ERROR_NOT_COMMITTED, trc_query_closest(empty, &rays, 0, &hits));
    REFUSED(TRC_ERROR_NOT_COMMITTED, trc_query_occluded(empty, &rays, 0, &occluded, 0));
    /* An empty scene commits; without a camera it does not render. */
    assert_int_equal(trc_scene_commit(empty), TRC_OK);
    assert_int_equal(trc_scene_get_stats(empty, &stats), TRC_OK);
    assert_true(stats.bounds_lower[0] > stats.bounds_upper[0]);
    REFUSED(ARGUMENT, trc_render_start(empty, &desc, &render));
    assert_true(render == UNTOUCHED);
    /* With a camera it renders the background. */
    const trc_camera_desc camera = default_camera_desc();
    assert_int_equal(trc_scene_set_camera(empty, &camera), TRC_OK);
    assert_int_equal(trc_scene_commit(empty), TRC_OK);
    assert_int_equal(trc_render_start(empty, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(empty), TRC_OK);
}

/* ---- meshes ---- */

static void refuse_mesh(trc_status status, const trc_mesh_desc *desc) {
    trc_id id = UNTOUCHED;
    REFUSED(status, trc_mesh_create(scene, desc, &id));
    assert_true(id == UNTOUCHED);
}

#define REFUSE_MESH(status, change)               \
    do {                                          \
        trc_mesh_desc desc = default_mesh_desc(); \
        change;                                   \
        refuse_mesh(status, &desc);               \
    } while (0)

static void mesh_counts(void **state) {
    (void)state;
    REFUSE_MESH(ARGUMENT, desc.key_count = 0);
    REFUSE_MESH(ARGUMENT, desc.generated = cube_positions; desc.generated_count = 23);
    REFUSE_MESH(ARGUMENT, desc.generated_count = 24);
    REFUSE_MESH(ARGUMENT, desc.generated = MISALIGNED(float); desc.generated_count = 24);
    REFUSE_MESH(LARGE, desc.key_count = TRC_MAX_KEYS + 1);
    REFUSE_MESH(LARGE, desc.key_count = UINT32_MAX);
    REFUSE_MESH(ARGUMENT, desc.key_count = 2);
    REFUSE_MESH(ARGUMENT, desc.positions = NULL);
    REFUSE_MESH(ARGUMENT, desc.indices = NULL);
    REFUSE_MESH(ARGUMENT, desc.positions = MISALIGNED(float));
    REFUSE_MESH(ARGUMENT, desc.indices = MISALIGNED(uint32_t));
    REFUSE_MESH(ARGUMENT, desc.material_index = (uint16_t *)(void *)((char *)odd_storage + 1));
    REFUSE_MESH(ARGUMENT, desc.position_count = 23);
    REFUSE_MESH(ARGUMENT, desc.index_count = 37);
    REFUSE_MESH(LARGE, desc.vertex_count = UINT64_MAX);
    REFUSE_MESH(LARGE, desc.vertex_count = UINT64_MAX / 3 + 9); /* 3 * it is 24 modulo 2^64 */
    REFUSE_MESH(LARGE, desc.triangle_count = UINT64_MAX);
    REFUSE_MESH(LARGE, desc.triangle_count = UINT64_MAX / 3 + 13);
    REFUSE_MESH(LARGE, desc.triangle_count = UINT64_C(1) << 40;
                desc.index_count = UINT64_C(3) << 40);
    REFUSE_MESH(LARGE, desc.vertex_count = 1u << 31; desc.position_count = UINT64_C(3) << 31);
    REFUSE_MESH(LARGE, desc.position_count = UINT64_MAX);
    REFUSE_MESH(LARGE, desc.attribute_count = TRC_MAX_ATTRIBUTES + 1);
    REFUSE_MESH(ARGUMENT, desc.attribute_count = 1);
}

static void mesh_indices(void **state) {
    (void)state;
    uint32_t indices[36];
    memcpy(indices, cube_indices, sizeof indices);
    indices[17] = 8;
    indices[20] = UINT32_MAX;
    REFUSE_MESH(ARGUMENT, desc.indices = indices);
    assert_non_null(strstr(trc_last_message(), "index 17 "));
    assert_non_null(strstr(trc_last_message(), " 8"));
    REFUSE_MESH(ARGUMENT, desc.vertex_count = 0; desc.position_count = 0);
    /* No triangles, or nothing at all, is a mesh. */
    trc_id id = 0;
    trc_mesh_desc empty = {.struct_size = sizeof empty, .key_count = 1};
    assert_int_equal(trc_mesh_create(scene, &empty, &id), TRC_OK);
    const trc_instance_desc instance = default_instance_desc(id);
    assert_int_equal(trc_instance_create(scene, &instance, &id), TRC_OK);
}

static void mesh_normals(void **state) {
    (void)state;
    static float normals[3 * 36];
    REFUSE_MESH(ARGUMENT, desc.normal_kind = 3);
    REFUSE_MESH(ARGUMENT, desc.normals = normals; desc.normal_count = 24);
    REFUSE_MESH(ARGUMENT, desc.normals = normals; desc.normal_kind = TRC_NORMALS_VERTEX;
                desc.normal_count = 23);
    REFUSE_MESH(ARGUMENT, desc.normals = NULL; desc.normal_kind = TRC_NORMALS_VERTEX;
                desc.normal_count = 24);
    REFUSE_MESH(ARGUMENT, desc.normals = normals; desc.normal_kind = TRC_NORMALS_CORNER;
                desc.normal_count = 24);
    REFUSE_MESH(ARGUMENT, desc.normals = MISALIGNED(float); desc.normal_kind = TRC_NORMALS_VERTEX;
                desc.normal_count = 24);
    REFUSE_MESH(LARGE, desc.normal_kind = TRC_NORMALS_CORNER; desc.triangle_count = 1u << 29;
                desc.index_count = 3u << 29); /* nothing is read before that */
    /* Zero and NaN normals are replaced. */
    normals[5] = NAN;
    trc_mesh_desc desc = default_mesh_desc();
    desc.normals = normals;
    desc.normal_kind = TRC_NORMALS_CORNER;
    desc.normal_count = 108;
    trc_id id = 0;
    assert_int_equal(trc_mesh_create(scene, &desc, &id), TRC_OK);
    const trc_instance_desc instance = default_instance_desc(id);
    assert_int_equal(trc_instance_create(scene, &instance, &id), TRC_OK);
}

static void mesh_attributes(void **state) {
    (void)state;
    static float values[4 * 36];
    const trc_corner_attribute good = {.struct_size = sizeof good,
                                       .width = 2,
                                       .name = "UVMap",
                                       .values = values,
                                       .value_count = 72};
    trc_corner_attribute bad = good;
    char long_name[65];
    memset(long_name, 'n', 64);
    long_name[64] = '\0';
#define REFUSE_ATTRIBUTE(status, change)                                       \
    do {                                                                       \
        bad = good;                                                            \
        change;                                                                \
        const trc_corner_attribute both[2] = {good, bad};                      \
        REFUSE_MESH(status, desc.attributes = both; desc.attribute_count = 2); \
    } while (0)
    REFUSE_ATTRIBUTE(SIZE, bad.struct_size = 8);
    REFUSE_ATTRIBUTE(ARGUMENT, bad.width = 3);
    REFUSE_ATTRIBUTE(ARGUMENT, bad.width = 4);
    REFUSE_ATTRIBUTE(ARGUMENT, bad.name = NULL);
    REFUSE_ATTRIBUTE(LARGE, bad.name = long_name);
    REFUSE_ATTRIBUTE(ARGUMENT, bad.values = NULL);
    REFUSE_ATTRIBUTE(ARGUMENT, bad.values = MISALIGNED(float));
    REFUSE_ATTRIBUTE(ARGUMENT, bad.value_count = 71);
    REFUSE_ATTRIBUTE(LARGE, bad.value_count = UINT64_MAX);
    bad = good;
    bad.width = 4;
    REFUSE_MESH(LARGE, desc.attributes = &bad; desc.attribute_count = 1;
                desc.triangle_count = 1u << 28; desc.index_count = 3u << 28);
    values[3] = NAN; /* becomes 0 */
    trc_mesh_desc desc = default_mesh_desc();
    desc.attributes = &good;
    desc.attribute_count = 1;
    trc_id id = 0;
    assert_int_equal(trc_mesh_create(scene, &desc, &id), TRC_OK);
}

static void mesh_updates(void **state) {
    (void)state;
    const trc_mesh_desc desc = default_mesh_desc();
    trc_id mesh = 0, instance = 0;
    float two_keys[48] = {0};
    assert_int_equal(trc_mesh_create(scene, &desc, &mesh), TRC_OK);
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 0, cube_positions, 0, NULL, 0));
    REFUSED(LARGE, trc_mesh_update(scene, mesh, UINT32_MAX, cube_positions, 24, NULL, 0));
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 2, cube_positions, 24, NULL, 0));
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 1, cube_positions, 23, NULL, 0));
    REFUSED(LARGE, trc_mesh_update(scene, mesh, 1, cube_positions, UINT64_MAX, NULL, 0));
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 1, NULL, 24, NULL, 0));
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 1, MISALIGNED(float), 24, NULL, 0));
    REFUSED(ARGUMENT, trc_mesh_update(scene, mesh, 1, cube_positions, 24, cube_positions, 24));
    assert_int_equal(trc_mesh_update(scene, mesh, 2, two_keys, 48, NULL, 0), TRC_OK);
    const trc_instance_desc placed = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &placed, &instance), TRC_OK);
    REFUSED(ARGUMENT, trc_mesh_destroy(scene, mesh));
    assert_int_equal(trc_instance_destroy(scene, instance), TRC_OK);
    assert_int_equal(trc_mesh_destroy(scene, mesh), TRC_OK);
    REFUSED(HANDLE, trc_instance_destroy(scene, instance));
}

static void bad_vertices_are_counted(void **state) {
    (void)state;
    float positions[24];
    memcpy(positions, cube_positions, sizeof positions);
    positions[0] = NAN; /* in 4 triangles or 5: whatever holds vertex 0 */
    uint64_t expected = 0;
    for (int t = 0; t < 12; t++) {
        expected += cube_indices[3 * t] == 0 || cube_indices[3 * t + 1] == 0 ||
                    cube_indices[3 * t + 2] == 0;
    }
    trc_mesh_desc desc = default_mesh_desc();
    desc.positions = positions;
    trc_id mesh = 0, instance = 0;
    trc_scene_stats stats = {.struct_size = sizeof stats};
    const float values[] = {NAN, INFINITY, -INFINITY, 1.9e18f, -3e38f};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        positions[0] = values[i];
        assert_int_equal(trc_mesh_create(scene, &desc, &mesh), TRC_OK);
        const trc_instance_desc placed = default_instance_desc(mesh);
        assert_int_equal(trc_instance_create(scene, &placed, &instance), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
        assert_int_equal(stats.skipped_triangle_count, expected * (i + 1));
    }
}

/* ---- instances, lights, camera, world ---- */

static void instances(void **state) {
    (void)state;
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    const trc_id stale_materials[2] = {0, 12345};
    trc_id mesh = 0, id = UNTOUCHED, instance = 0;
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    const trc_instance_desc good = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &good, &instance), TRC_OK);
#define REFUSE_INSTANCE(status, change)                               \
    do {                                                              \
        trc_instance_desc desc = good;                                \
        change;                                                       \
        REFUSED(status, trc_instance_create(scene, &desc, &id));      \
        REFUSED(status, trc_instance_update(scene, instance, &desc)); \
    } while (0)
    REFUSE_INSTANCE(ARGUMENT, desc.key_count = 0);
    REFUSE_INSTANCE(LARGE, desc.key_count = 34);
    REFUSE_INSTANCE(ARGUMENT, desc.transforms = NULL);
    REFUSE_INSTANCE(ARGUMENT, desc.transforms = MISALIGNED(float));
    REFUSE_INSTANCE(ARGUMENT, desc.material_count = 1);
    REFUSE_INSTANCE(LARGE, desc.material_count = UINT32_MAX);
    REFUSE_INSTANCE(HANDLE, desc.materials = stale_materials; desc.material_count = 2);
    REFUSE_INSTANCE(ARGUMENT, desc.visibility = 32);
    REFUSE_INSTANCE(ARGUMENT, desc.flags = 8);
    REFUSE_INSTANCE(ARGUMENT, desc.random = NAN);
    REFUSE_INSTANCE(ARGUMENT, desc.color[2] = INFINITY);
    REFUSE_INSTANCE(ARGUMENT, desc.cryptomatte_object = NAN);
    REFUSE_INSTANCE(ARGUMENT, desc.cryptomatte_asset = -INFINITY);
    REFUSE_INSTANCE(LARGE, desc.light_group = TRC_MAX_LIGHT_GROUPS + 1);
    REFUSE_INSTANCE(ARGUMENT, desc.ao_distance = -1.0f);
    REFUSE_INSTANCE(ARGUMENT, desc.shadow_terminator_geometry = NAN);
    REFUSE_INSTANCE(ARGUMENT, desc.shadow_terminator_geometry = 1.01f);
    REFUSE_INSTANCE(ARGUMENT, desc.shadow_terminator_shading = -0.01f);
    const float bad_values[] = {1.0f, NAN};
    REFUSE_INSTANCE(ARGUMENT, desc.value_count = 1);
    REFUSE_INSTANCE(ARGUMENT, desc.values = bad_values; desc.value_count = 2);
    REFUSE_INSTANCE(LARGE, desc.values = bad_values;
                    desc.value_count = TRC_MAX_INSTANCE_VALUES + 1);
    assert_true(id == UNTOUCHED);
    /* Transforms that are no transforms hide the instance. */
    const float values[] = {NAN, INFINITY, 3e38f, 1e-45f};
    float transform[12];
    for (size_t i = 0; i < 4; i++) {
        trc_instance_desc desc = good;
        memset(transform, 0, sizeof transform);
        transform[0] = values[i];
        desc.transforms = transform;
        assert_int_equal(trc_instance_create(scene, &desc, &id), TRC_OK);
    }
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_scene_get_stats(scene, &stats), TRC_OK);
    assert_int_equal(stats.skipped_instance_count, 4);
}

static void lights(void **state) {
    (void)state;
    const trc_light_desc good = default_light_desc();
    trc_id id = UNTOUCHED, light = 0;
    assert_int_equal(trc_light_create(scene, &good, &light), TRC_OK);
#define REFUSE_LIGHT_AS(status, change)                         \
    do {                                                        \
        trc_light_desc desc = good;                             \
        change;                                                 \
        REFUSED(status, trc_light_create(scene, &desc, &id));   \
        REFUSED(status, trc_light_update(scene, light, &desc)); \
    } while (0)
#define REFUSE_LIGHT(change) REFUSE_LIGHT_AS(ARGUMENT, change)
    REFUSE_LIGHT(desc.type = 4);
    REFUSE_LIGHT(desc.transform[7] = NAN);
    REFUSE_LIGHT(desc.color[0] = INFINITY);
    REFUSE_LIGHT(desc.strength = NAN);
    REFUSE_LIGHT(desc.radius = -1.0f);
    REFUSE_LIGHT(desc.angle = -0.1f);
    REFUSE_LIGHT(desc.angle = 4.0f);
    REFUSE_LIGHT(desc.size_x = NAN);
    REFUSE_LIGHT(desc.size_y = INFINITY);
    REFUSE_LIGHT(desc.area_shape = 2);
    REFUSE_LIGHT(desc.spread = 0.0f);
    REFUSE_LIGHT(desc.spread = NAN);
    REFUSE_LIGHT(desc.type = TRC_LIGHT_SPOT; desc.spot_angle = 0.0f);
    REFUSE_LIGHT(desc.type = TRC_LIGHT_SPOT; desc.spot_blend = 1.5f);
    REFUSE_LIGHT(desc.flags = 2 * TRC_LIGHT_CENTERED);
    REFUSE_LIGHT(desc.visibility = 32);
    REFUSE_LIGHT(desc.cast_shadow = 2);
    REFUSE_LIGHT(desc.use_mis = 7);
    REFUSE_LIGHT_AS(LARGE, desc.light_group = TRC_MAX_LIGHT_GROUPS + 1);
    assert_true(id == UNTOUCHED);
}

static void cameras(void **state) {
    (void)state;
    const float singular[12] = {0}, nan[12] = {NAN, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    const float empty[4] = {0, 0, -1, 1}, flat[4] = {-1, 1, 1, 1};
    const float infinite[4] = {-INFINITY, 1, -1, 1};
    const float curve[3] = {1, -1, 1}, nan_curve[2] = {NAN, 1}, dark[3] = {0, 0, 0};
#define REFUSE_CAMERA(status, change)                        \
    do {                                                     \
        trc_camera_desc desc = default_camera_desc();        \
        change;                                              \
        REFUSED(status, trc_scene_set_camera(scene, &desc)); \
    } while (0)
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_CYLINDRICAL + 1);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_EQUIRECTANGULAR; desc.longitude_min = NAN);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_EQUIRECTANGULAR; desc.latitude_max = 1.6f);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_CYLINDRICAL; desc.height_max = INFINITY);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_FISHEYE_EQUIDISTANT; desc.fisheye_angle = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_FISHEYE_EQUISOLID; desc.fisheye_lens = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_FISHEYE_EQUISOLID; desc.sensor_height = -1.0f);
    REFUSE_CAMERA(ARGUMENT, desc.type = TRC_CAMERA_FISHEYE_POLYNOMIAL;
                  desc.fisheye_polynomial[4] = NAN);
    REFUSE_CAMERA(ARGUMENT, desc.eye_offset = INFINITY);
    REFUSE_CAMERA(ARGUMENT, desc.eye_offset = 0.1f; desc.convergence_distance = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.eye_offset = 0.1f; desc.convergence_distance = 2.0f;
                  desc.pole_merge_to = 2.0f);
    REFUSE_CAMERA(ARGUMENT, desc.row_delay = 1.5f);
    REFUSE_CAMERA(ARGUMENT, desc.key_count = 0);
    REFUSE_CAMERA(LARGE, desc.key_count = 34);
    REFUSE_CAMERA(ARGUMENT, desc.transforms = NULL);
    REFUSE_CAMERA(ARGUMENT, desc.transforms = singular);
    REFUSE_CAMERA(ARGUMENT, desc.transforms = nan);
    REFUSE_CAMERA(ARGUMENT, desc.transforms = MISALIGNED(float));
    REFUSE_CAMERA(ARGUMENT, desc.windows = NULL);
    REFUSE_CAMERA(ARGUMENT, desc.windows = empty);
    REFUSE_CAMERA(ARGUMENT, desc.windows = flat);
    REFUSE_CAMERA(ARGUMENT, desc.windows = infinite);
    REFUSE_CAMERA(ARGUMENT, desc.window_key_count = 0);
    REFUSE_CAMERA(ARGUMENT, desc.window_key_count = 2);
    REFUSE_CAMERA(ARGUMENT, desc.clip_start = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.clip_start = NAN);
    REFUSE_CAMERA(ARGUMENT, desc.clip_end = 0.05f);
    REFUSE_CAMERA(ARGUMENT, desc.clip_end = INFINITY);
    REFUSE_CAMERA(ARGUMENT, desc.aperture_radius = -1.0f);
    REFUSE_CAMERA(ARGUMENT, desc.focus_distance = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.focus_distance = NAN);
    REFUSE_CAMERA(LARGE, desc.blade_count = UINT32_MAX);
    REFUSE_CAMERA(ARGUMENT, desc.blade_rotation = NAN);
    REFUSE_CAMERA(ARGUMENT, desc.aperture_ratio = 0.0f);
    REFUSE_CAMERA(ARGUMENT, desc.shutter_time = -1.0f);
    REFUSE_CAMERA(ARGUMENT, desc.shutter_curve_count = 3);
    REFUSE_CAMERA(LARGE, desc.shutter_curve = curve; desc.shutter_curve_count = UINT32_MAX);
    REFUSE_CAMERA(ARGUMENT, desc.shutter_curve = curve; desc.shutter_curve_count = 3);
    REFUSE_CAMERA(ARGUMENT, desc.shutter_curve = nan_curve; desc.shutter_curve_count = 2);
    /* A shutter that never opens is a box; focus at infinity is a focus. */
    trc_camera_desc desc = default_camera_desc();
    desc.shutter_time = 0.5f;
    desc.shutter_curve = dark;
    desc.shutter_curve_count = 3;
    desc.aperture_radius = 0.1f;
    desc.focus_distance = INFINITY;
    assert_int_equal(trc_scene_set_camera(scene, &desc), TRC_OK);
}

static void worlds(void **state) {
    (void)state;
#define REFUSE_WORLD(status, change)                        \
    do {                                                    \
        trc_world_desc desc = default_world_desc(0);        \
        change;                                             \
        REFUSED(status, trc_scene_set_world(scene, &desc)); \
    } while (0)
    REFUSE_WORLD(ARGUMENT, desc.use_sampling = 2);
    REFUSE_WORLD(ARGUMENT, desc.cast_shadow = 2);
    REFUSE_WORLD(ARGUMENT, desc.visibility = 32);
    REFUSE_WORLD(LARGE, desc.map_resolution = UINT32_MAX);
    REFUSE_WORLD(ARGUMENT, desc.ao_method = 2);
    REFUSE_WORLD(ARGUMENT, desc.ao_factor = NAN);
    REFUSE_WORLD(ARGUMENT, desc.ao_factor = -1.0f);
    REFUSE_WORLD(ARGUMENT, desc.ao_factor = 1.0f; desc.ao_distance = 0.0f);
    REFUSE_WORLD(ARGUMENT, desc.ao_distance = NAN);
    REFUSE_WORLD(ARGUMENT, desc.sun_angle = NAN);
    REFUSE_WORLD(ARGUMENT, desc.sun_angle = 4.0f);
    REFUSE_WORLD(ARGUMENT, desc.sun_angle = 0.01f); /* in no direction */
    REFUSE_WORLD(ARGUMENT, desc.sun_angle = 0.01f; desc.sun_direction[0] = INFINITY);
    REFUSE_WORLD(LARGE, desc.light_group = TRC_MAX_LIGHT_GROUPS + 1);
    REFUSE_WORLD(ARGUMENT, desc.ao_factor = 1.0f; desc.ao_distance = NAN);
}

/* ---- materials and images ---- */

static void materials(void **state) {
    (void)state;
    trc_id id = UNTOUCHED, material = 0;
    struct default_material good, bad;
    default_material_init(&good, TRC_NODE_DIFFUSE);
    assert_int_equal(trc_material_create(scene, &good.desc, &material), TRC_OK);
#define REFUSE_MATERIAL(status, change)                                   \
    do {                                                                  \
        default_material_init(&bad, TRC_NODE_DIFFUSE);                    \
        change;                                                           \
        REFUSED(status, trc_material_create(scene, &bad.desc, &id));      \
        REFUSED(status, trc_material_update(scene, material, &bad.desc)); \
    } while (0)
    REFUSE_MATERIAL(LARGE, bad.desc.node_count = TRC_MAX_NODES + 1);
    REFUSE_MATERIAL(LARGE, bad.desc.input_count = UINT32_MAX);
    REFUSE_MATERIAL(ARGUMENT, bad.desc.nodes = NULL);
    REFUSE_MATERIAL(ARGUMENT, bad.desc.inputs = NULL);
    REFUSE_MATERIAL(ARGUMENT, bad.desc.surface = 1);
    REFUSE_MATERIAL(ARGUMENT, bad.desc.surface = -2);
    REFUSE_MATERIAL(ARGUMENT, bad.node.first_input = UINT32_MAX);
    REFUSE_MATERIAL(ARGUMENT, bad.node.first_input = 1);
    REFUSE_MATERIAL(LARGE, bad.node.table_count = UINT64_MAX);
    REFUSE_MATERIAL(ARGUMENT, bad.node.table_count = 4);
    REFUSE_MATERIAL(ARGUMENT, bad.inputs[0].value[1] = NAN);
    REFUSE_MATERIAL(ARGUMENT, bad.inputs[0].value[0] = INFINITY);
    assert_true(id == UNTOUCHED);
    assert_int_equal(trc_material_destroy(scene, material), TRC_OK);
    REFUSED(HANDLE, trc_material_destroy(scene, material));
}

static void images(void **state) {
    (void)state;
    trc_id id = UNTOUCHED;
#define REFUSE_IMAGE(status, change)                          \
    do {                                                      \
        trc_image_desc desc = default_image_desc();           \
        change;                                               \
        REFUSED(status, trc_image_create(scene, &desc, &id)); \
    } while (0)
    REFUSE_IMAGE(ARGUMENT, desc.width = 0);
    REFUSE_IMAGE(LARGE, desc.width = 65537);
    REFUSE_IMAGE(ARGUMENT, desc.height = 0);
    REFUSE_IMAGE(LARGE, desc.height = 65537);
    REFUSE_IMAGE(LARGE, desc.width = 65536; desc.height = 65536);
    REFUSE_IMAGE(ARGUMENT, desc.alpha_mode = 4);
    REFUSE_IMAGE(ARGUMENT, desc.is_srgb = 2);
    REFUSE_IMAGE(ARGUMENT, desc.is_mip_mapped = 2);
    REFUSE_IMAGE(ARGUMENT, desc.is_float = 2);
    REFUSE_IMAGE(ARGUMENT, desc.pixels = NULL);
    REFUSE_IMAGE(ARGUMENT, desc.pixel_bytes--);
    REFUSE_IMAGE(ARGUMENT, desc.pixels = MISALIGNED(float));
    REFUSE_IMAGE(ARGUMENT, desc.path = "both");
#undef REFUSE_IMAGE
    trc_image_desc desc = {.struct_size = sizeof desc, .path = "/nowhere/nothing.png"};
    assert_int_equal(trc_image_create(scene, &desc, &id), TRC_ERROR_IMAGE);
    assert_true(id == UNTOUCHED);
    const trc_image_desc good = default_image_desc();
    assert_int_equal(trc_image_create(scene, &good, &id), TRC_OK);
    assert_int_equal(trc_image_update(scene, id, &desc), TRC_ERROR_IMAGE);
    desc.alpha_mode = 4;
    REFUSED(ARGUMENT, trc_image_update(scene, id, &desc));
    assert_int_equal(trc_image_update(scene, id, &good), TRC_OK);
    assert_int_equal(trc_image_destroy(scene, id), TRC_OK);
    REFUSED(HANDLE, trc_image_update(scene, id, &good));
    REFUSED(HANDLE, trc_image_destroy(scene, id));
}

/* What a later version gives a meaning is 0 in programs of this one. */
static void reserved_fields(void **state) {
    (void)state;
    trc_id id = UNTOUCHED;
    trc_material_desc material = trc_material_desc_default();
    material.reserved = 1;
    REFUSED(ARGUMENT, trc_material_create(scene, &material, &id));
    trc_reader_desc reader = trc_reader_desc_default();
    reader.reserved = 1;
    REFUSED(ARGUMENT, trc_reader_create(&reader, &id));

    const float points[8] = {0}, values[2] = {0};
    const uint32_t length = 2;
    trc_curve_attribute attribute = trc_curve_attribute_default();
    attribute.name = "UVMap";
    attribute.values = values;
    attribute.value_count = 2;
    attribute.per_strand = 1;
    attribute.reserved = 1;
    trc_curves_desc curves = trc_curves_desc_default();
    curves.point_count = 2;
    curves.points = points;
    curves.point_value_count = 8;
    curves.lengths = &length;
    curves.strand_count = 1;
    curves.attributes = &attribute;
    curves.attribute_count = 1;
    REFUSED(ARGUMENT, trc_curves_create(scene, &curves, &id));
    assert_true(id == UNTOUCHED);

    const trc_rays rays = trc_rays_default();
    uint32_t instance = 0;
    trc_hits hits = trc_hits_default();
    hits.instance = &instance;
    hits.reserved = 1;
    REFUSED(ARGUMENT, trc_query_closest(scene, &rays, 0, &hits));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(bad_handles),     TEST(bad_ids),      TEST(wrong_struct_sizes),
        TEST(missing_outputs), TEST(scene_limits), TEST(nothing_committed),
        TEST(mesh_counts),     TEST(mesh_indices), TEST(mesh_normals),
        TEST(mesh_attributes), TEST(mesh_updates), TEST(bad_vertices_are_counted),
        TEST(instances),       TEST(lights),       TEST(cameras),
        TEST(worlds),          TEST(materials),    TEST(images),
        TEST(reserved_fields),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
