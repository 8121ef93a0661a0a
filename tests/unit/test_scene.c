/* How a scene becomes a snapshot, and what renders do with it. */
#define _GNU_SOURCE
#include "fixture.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "core/core.h"
#include "model/film.h"
#include "query_scene.h"
#include "scene/scene.h"

/* ---- scene to snapshot ---- */

static void commits_share_what_stays(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const struct trc_snapshot *first = query_scene_snapshot(scene);
    const struct trc_bvh *bvh = first->bvh;
    const struct trc_light_table *lights = first->lights;
    assert_int_equal(first->instance_count, 1);
    assert_int_equal(first->has_camera, 1);

    trc_camera_desc camera = default_camera_desc();
    camera.aperture_radius = 0.1f;
    assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const struct trc_snapshot *second = query_scene_snapshot(scene);
    assert_ptr_equal(second->bvh, bvh);
    assert_ptr_equal(second->lights, lights);
    assert_true(second->features & TRC_FEATURE_LENS);
    assert_int_equal(query_scene_stats(scene).built_count, 0);

    trc_light_desc light = default_light_desc();
    trc_id id = 0;
    assert_int_equal(trc_light_create(scene, &light, &id), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_ptr_equal(query_scene_snapshot(scene)->bvh, bvh);
    assert_int_equal(query_scene_stats(scene).light_count, 2);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void features_are_what_the_scene_uses(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    uint32_t features = query_scene_stats(scene).features;
    assert_int_equal(features, TRC_FEATURE_LIGHTS | TRC_FEATURE_AREA_LIGHTS);
    trc_id mesh = 0, instance = 0;
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    float transforms[24];
    memcpy(transforms, identity_transform, sizeof identity_transform);
    memcpy(transforms + 12, identity_transform, sizeof identity_transform);
    desc.transforms = transforms;
    desc.key_count = 2;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_false(query_scene_stats(scene).features &
                 TRC_FEATURE_OBJECT_MOTION); /* it stands still */
    transforms[15] = 1.0f;
    desc.visibility = TRC_VISIBLE_CAMERA;
    assert_int_equal(trc_instance_update(scene, instance, &desc), TRC_OK);
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    features = query_scene_stats(scene).features;
    assert_true(features & TRC_FEATURE_OBJECT_MOTION);
    assert_true(features & TRC_FEATURE_VISIBILITY);
    assert_true(features & TRC_FEATURE_INSTANCES);
    float positions[48];
    memcpy(positions, cube_positions, sizeof cube_positions);
    memcpy(positions + 24, cube_positions, sizeof cube_positions);
    positions[30] = 3.0f;
    assert_int_equal(trc_mesh_update(scene, mesh, 2, positions, 48, NULL, 0), TRC_OK);
    trc_world_desc world = default_world_desc(0);
    world.ao_factor = 0.5f;
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    features = query_scene_stats(scene).features;
    assert_true(features & TRC_FEATURE_DEFORMATION);
    assert_true(features & TRC_FEATURE_AMBIENT_OCCLUSION);
    assert_false(features & TRC_FEATURE_ENVIRONMENT);
    assert_int_equal(
        query_scene_stats(scene).refitted_count + query_scene_stats(scene).built_count > 0, 1);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* ---- queries ---- */

/* Whether they are answered or refused. */
static void queries_hold_the_snapshot_no_longer(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    const uint32_t refs = (uint32_t)atomic_load(&snapshot->refs);
    const float zero = 0.0f, down = -1.0f, up = 5.0f;
    uint32_t instance = 0;
    uint8_t occluded = 0;
    trc_rays rays = {.struct_size = sizeof rays,
                     .visibility = TRC_VISIBLE_ALL,
                     .count = 1,
                     .origin_x = &zero,
                     .origin_y = &zero,
                     .origin_z = &up,
                     .direction_x = &zero,
                     .direction_y = &zero,
                     .direction_z = &down};
    const trc_hits hits = {.struct_size = sizeof hits, .instance = &instance};
    for (uint32_t size = 0; size < 2; size++) {
        const trc_status want = size ? TRC_ERROR_INVALID_ARGUMENT : TRC_OK;
        const uint32_t packet_size = 3 * size;
        assert_int_equal(trc_query_closest(scene, &rays, packet_size, &hits), want);
        assert_int_equal(trc_query_occluded(scene, &rays, packet_size, &occluded, 1), want);
        assert_int_equal((uint32_t)atomic_load(&snapshot->refs), refs);
    }
    rays.direction_x = NULL;
    assert_int_equal(trc_query_closest(scene, &rays, 0, &hits), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_query_occluded(scene, &rays, 0, &occluded, 1), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal((uint32_t)atomic_load(&snapshot->refs), refs);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* ---- edits ---- */

static void removed_lights_are_gone(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const trc_light_desc desc = default_light_desc();
    trc_id light = 0;
    assert_int_equal(trc_light_create(scene, &desc, &light), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).light_count, 2);
    assert_int_equal(trc_light_destroy(scene, light), TRC_OK);
    assert_int_equal(trc_light_destroy(scene, light), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(query_scene_stats(scene).light_count, 2); /* until the commit */
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).light_count, 1);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void cameras_move_if_their_keys_differ(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    float transforms[24], windows[8];
    trc_camera_desc desc = default_camera_desc();
    for (int key = 0; key < 2; key++) {
        memcpy(transforms + 12 * key, desc.transforms, sizeof above_transform);
        memcpy(windows + 4 * key, desc.windows, 4 * sizeof *windows);
    }
    desc.key_count = desc.window_key_count = 2;
    desc.transforms = transforms;
    desc.windows = windows;
    desc.shutter_time = 0.5f;
    for (int changed = 0; changed < 3; changed++) { /* nothing, where it is, how far it zooms */
        transforms[12 + 3] = changed == 1 ? 1.0f : 0.0f;
        windows[4] = changed == 2 ? -0.4f : -0.5f;
        assert_int_equal(trc_scene_set_camera(scene, &desc), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        assert_int_equal((query_scene_stats(scene).features & TRC_FEATURE_CAMERA_MOTION) != 0,
                         changed != 0);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void bad_texels_are_named(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    float pixels[16] = {1, 2, 3, 1, NAN, 0, 0, 1, 0, INFINITY, 0, 1, 1, 1, 1, 1};
    trc_image_desc desc = default_image_desc();
    desc.pixels = pixels;
    trc_id image = 0;
    char text[256];
    assert_int_equal(trc_image_create(scene, &desc, &image), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_scene_get_warnings(scene, text, sizeof text, NULL), TRC_OK);
    assert_non_null(strstr(text, "2 texels in 1 images"));
    assert_int_equal(trc_image_destroy(scene, image), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(trc_scene_get_warnings(scene, text, sizeof text, NULL), TRC_OK);
    assert_string_equal(text, "");
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void singular_instances_are_hidden_and_counted(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_id mesh = 0, instance = 0;
    float positions[48];
    memcpy(positions, cube_positions, sizeof cube_positions);
    memcpy(positions + 24, cube_positions, sizeof cube_positions);
    positions[30] = 3.0f;
    trc_mesh_desc mesh_desc = default_mesh_desc();
    mesh_desc.key_count = 2;
    mesh_desc.positions = positions;
    mesh_desc.position_count = 48;
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    float transform[12] = {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    desc.transforms = transform;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).skipped_instance_count, 1);
    const struct trc_snapshot *s = query_scene_snapshot(scene);
    assert_int_equal(s->instance_count, 2);
    assert_int_equal(s->instances[1].visibility, 0);
    assert_false(s->features & TRC_FEATURE_DEFORMATION); /* what nobody sees costs nothing */
    char text[256];
    uint64_t size = 0;
    assert_int_equal(trc_scene_get_warnings(scene, text, sizeof text, &size), TRC_OK);
    assert_non_null(strstr(text, "a line or a point"));
    assert_int_equal(size, strlen(text) + 1);
    assert_int_equal(trc_scene_get_warnings(scene, text, 5, NULL), TRC_OK);
    assert_int_equal(strlen(text), 4);
    transform[5] = 1.0f; /* flat */
    assert_int_equal(trc_instance_update(scene, instance, &desc), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).skipped_instance_count, 0);
    assert_int_equal(query_scene_snapshot(scene)->instances[1].visibility, TRC_VISIBLE_ALL);
    assert_true(query_scene_snapshot(scene)->instances[1].is_thin);
    transform[10] = -2.0f;
    assert_int_equal(trc_instance_update(scene, instance, &desc), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).skipped_instance_count, 0);
    assert_int_equal(query_scene_snapshot(scene)->instances[1].flips, 1);
    assert_false(query_scene_snapshot(scene)->instances[1].is_thin);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Trees of flat instances are kept as those of meshes are, and built anew when theirs move. */
static void trees_of_flat_instances_are_kept(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_id mesh = 0, flat[2];
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    float transform[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    desc.transforms = transform;
    for (int i = 0; i < 2; i++)
        assert_int_equal(trc_instance_create(scene, &desc, &flat[i]), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_true(query_scene_stats(scene).built_count >= 2);
    for (int moved = 0; moved < 2; moved++) {
        transform[3] = (float)moved;
        assert_int_equal(trc_instance_update(scene, flat[1], &desc), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        assert_int_equal(query_scene_stats(scene).built_count, moved);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void destroyed_materials_leave_the_default(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_id mesh = 0, instance = 0, materials[2] = {0};
    struct default_material material;
    default_material_init(&material, TRC_NODE_DIFFUSE);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(trc_material_create(scene, &material.desc, &materials[i]), TRC_OK);
    }
    const trc_mesh_desc mesh_desc = default_mesh_desc();
    assert_int_equal(trc_mesh_create(scene, &mesh_desc, &mesh), TRC_OK);
    trc_instance_desc desc = default_instance_desc(mesh);
    desc.materials = materials;
    desc.material_count = 2;
    assert_int_equal(trc_instance_create(scene, &desc, &instance), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const struct trc_instance *placed = &query_scene_snapshot(scene)->instances[1];
    assert_int_equal(placed->materials[0], 1);
    assert_int_equal(placed->materials[1], 2);
    assert_int_equal(trc_material_destroy(scene, materials[0]), TRC_OK);
    trc_id replacement = 0; /* takes the slot, not the place */
    assert_int_equal(trc_material_create(scene, &material.desc, &replacement), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    placed = &query_scene_snapshot(scene)->instances[1];
    assert_int_equal(placed->materials[0], 0);
    assert_int_equal(placed->materials[1], 2);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* ---- renders ---- */

static float *render_image(trc_scene scene, const trc_render_desc *desc) {
    trc_render render = 0;
    const uint64_t count = (uint64_t)desc->width * desc->height * 4;
    float *pixels = malloc(count * sizeof *pixels);
    trc_render_progress progress = {.struct_size = sizeof progress};
    assert_non_null(pixels);
    assert_int_equal(trc_render_start(scene, desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_int_equal(progress.state, TRC_PROGRESS_DONE);
    assert_true(progress.fraction == 1.0f);
    assert_int_equal(progress.samples_done, desc->sample_count);
    assert_int_equal(progress.tiles_done, progress.tile_count);
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, count), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    return pixels;
}

/* Pictures can be had of all instruction sets, and trees stay. */
static void instruction_sets_may_change(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const uint32_t isa = trc_isa();
    const struct trc_bvh *bvh = query_scene_snapshot(scene)->bvh;
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_ptr_equal(query_scene_snapshot(scene)->bvh, bvh);
    assert_int_equal(trc_set_isa(TRC_ISA_SCALAR), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_ptr_equal(query_scene_snapshot(scene)->bvh, bvh);
    assert_int_equal(query_scene_stats(scene).built_count + query_scene_stats(scene).refitted_count,
                     0);
    trc_render_desc desc = default_render_desc(16, 16, 1);
    desc.thread_count = 0; /* all processors */
    free(render_image(scene, &desc));
    assert_int_equal(trc_set_isa(isa), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void image_does_not_depend_on_threads(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_render_desc desc = default_render_desc(100, 70, 19);
    desc.thread_count = 1;
    float *reference = render_image(scene, &desc);
    const size_t bytes = (size_t)100 * 70 * 4 * sizeof(float);
    float brightest = 0.0f;
    for (size_t i = 0; i < bytes / sizeof(float); i++)
        brightest = fmaxf(brightest, reference[i]);
    assert_true(brightest > 0.0f);
    for (uint32_t threads = 2; threads <= 5; threads++) {
        desc.thread_count = threads;
        for (desc.progressive = 0; desc.progressive < 2; desc.progressive++) {
            float *image = render_image(scene, &desc);
            assert_memory_equal(image, reference, bytes);
            free(image);
        }
    }
    free(reference);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void cancelled_renders_keep_what_they_have(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_render_desc desc = default_render_desc(256, 256, 1u << 20);
    desc.progressive = 1;
    trc_render render = 0;
    trc_render_progress progress = {.struct_size = sizeof progress};
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK); /* the snapshot stays with the render */
    do {
        assert_int_equal(trc_render_wait(render, 0.002), TRC_OK);
        assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
        assert_int_equal(progress.state, TRC_PROGRESS_RUNNING);
    } while (progress.samples_done < 1);
    assert_int_equal(trc_render_cancel(render), TRC_OK);
    assert_int_equal(trc_render_cancel(render), TRC_OK);
    const double start = trc_seconds();
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_true(trc_seconds() - start < 5.0);
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_int_equal(progress.state, TRC_PROGRESS_CANCELLED);
    assert_true(progress.fraction > 0.0f && progress.fraction < 1.0f);
    const double seconds = progress.seconds;
    static float pixels[256 * 256 * 4];
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, 256 * 256 * 4), TRC_OK);
    for (size_t i = 0; i < 256 * 256 * 4; i++)
        assert_true(isfinite(pixels[i]));
    assert_true(pixels[3] > 0.0f || pixels[4 * (128 * 256 + 128) + 3] > 0.0f);
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_true(progress.seconds == seconds); /* the clock stands still */
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_ERROR_INVALID_HANDLE);
}

/* Of a tile and the edge of another, the thread that has the edge waits for the tile most of the
 * time. */
static void waiting_threads_are_cancelled(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_render_desc desc = default_render_desc(TRC_TILE_SIZE + 1, TRC_TILE_SIZE, 1u << 20);
    desc.progressive = 1;
    desc.thread_count = 2;
    for (int trial = 0; trial < 20; trial++) {
        trc_render render = 0;
        trc_render_progress progress = {.struct_size = sizeof progress};
        assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
        assert_int_equal(trc_render_wait(render, 0.005 * (trial + 1)), TRC_OK);
        assert_int_equal(trc_render_cancel(render), TRC_OK);
        assert_int_equal(trc_render_wait(render, 20.0), TRC_OK);
        assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
        if (progress.state != TRC_PROGRESS_CANCELLED)
            fail_msg("a thread still waits for a tile"); /* destroying would wait for it, too */
        assert_int_equal(trc_render_destroy(render), TRC_OK);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Every pixel has at least as many samples as are said to be done: all together no fewer than the
 * fraction. A film that is cancelled keeps them. */
static void progress_counts_whole_batches(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    trc_render_desc desc = default_render_desc(96, 96, 1u << 12);
    desc.progressive = 1;
    trc_render render = 0;
    trc_render_progress progress = {.struct_size = sizeof progress};
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    do {
        assert_int_equal(trc_render_wait(render, 0.001), TRC_OK);
        assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
        assert_true(progress.samples_done <=
                    (double)progress.fraction * desc.sample_count * (1.0 + 1e-6));
    } while (progress.state == TRC_PROGRESS_RUNNING && progress.samples_done < 4);
    assert_int_equal(trc_render_cancel(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_true(progress.samples_done >= 4);
    assert_true(progress.samples_done <=
                (double)progress.fraction * desc.sample_count * (1.0 + 1e-6));
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void *wait_for_end(void *context) {
    return (void *)(uintptr_t)(trc_render_wait(*(trc_render *)context, -1.0) + 1);
}

static void destroying_releases_waiters(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const trc_render_desc desc = default_render_desc(128, 128, 1u << 20);
    trc_render render = 0;
    pthread_t thread;
    void *result = NULL;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(pthread_create(&thread, NULL, wait_for_end, &render), 0);
    assert_int_equal(trc_render_wait(render, 0.02), TRC_OK);
    trc_render stale = render;
    assert_int_equal(trc_render_destroy(stale), TRC_OK);
    pthread_join(thread, &result);
    /* Either it waited, or it came too late and was told so. */
    const uintptr_t status = (uintptr_t)result - 1;
    assert_true(status == TRC_OK || status == TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static void several_renders_at_once(void **state) {
    (void)state;
    enum { COUNT = 4 };
    trc_scene scenes[COUNT];
    trc_render renders[COUNT];
    const trc_render_desc desc = default_render_desc(64, 64, 4);
    const uint64_t floats = 64 * 64 * 4;
    static float first[64 * 64 * 4], other[64 * 64 * 4];
    for (int i = 0; i < COUNT; i++) {
        scenes[i] = fixture_scene();
        assert_int_equal(trc_render_start(scenes[i], &desc, &renders[i]), TRC_OK);
    }
    for (int i = 0; i < COUNT; i++) {
        assert_int_equal(trc_render_wait(renders[i], -1.0), TRC_OK);
        float *pixels = i ? other : first;
        assert_int_equal(trc_render_read(renders[i], TRC_PASS_COMBINED, pixels, floats), TRC_OK);
        if (i)
            assert_memory_equal(first, other, sizeof first);
        assert_int_equal(trc_render_destroy(renders[i]), TRC_OK);
        assert_int_equal(trc_scene_destroy(scenes[i]), TRC_OK);
    }
}

struct cancel_job {
    trc_scene scene;
    atomic_int stop;
};

static void *cancel_commits(void *context) {
    const struct cancel_job *job = context;
    while (!atomic_load(&job->stop))
        (void)trc_scene_cancel(job->scene);
    return NULL;
}

#define SIDE 400 /* a mesh of 320,000 smooth triangles: its commit takes long enough to be met */

static trc_id create_large_mesh(trc_scene scene) {
    const uint64_t vertex_count = SIDE * SIDE, triangle_count = (SIDE - 1) * (SIDE - 1) * 2;
    float *positions = malloc(vertex_count * 3 * sizeof *positions);
    uint32_t *indices = malloc(triangle_count * 3 * sizeof *indices);
    uint8_t *smooth = malloc(triangle_count);
    assert_true(positions && indices && smooth);
    memset(smooth, 1, triangle_count);
    for (uint32_t i = 0; i < vertex_count; i++) {
        positions[3 * i] = (float)(i % SIDE);
        positions[3 * i + 1] = (float)(i / SIDE);
        positions[3 * i + 2] = (float)(i % 7);
    }
    uint32_t *next = indices;
    for (uint32_t a = 0; a < vertex_count - SIDE; a++) {
        if (a % SIDE == SIDE - 1)
            continue;
        const uint32_t quad[6] = {a, a + 1, a + SIDE, a + 1, a + SIDE + 1, a + SIDE};
        memcpy(next, quad, sizeof quad);
        next += 6;
    }
    const trc_mesh_desc desc = {.struct_size = sizeof desc,
                                .key_count = 1,
                                .vertex_count = vertex_count,
                                .triangle_count = triangle_count,
                                .positions = positions,
                                .position_count = vertex_count * 3,
                                .indices = indices,
                                .index_count = triangle_count * 3,
                                .smooth = smooth};
    trc_id mesh = 0, instance = 0;
    assert_int_equal(trc_mesh_create(scene, &desc, &mesh), TRC_OK);
    const trc_instance_desc placed = default_instance_desc(mesh);
    assert_int_equal(trc_instance_create(scene, &placed, &instance), TRC_OK);
    free(positions);
    free(indices);
    free(smooth);
    return mesh;
}

static void cancelled_commits_leave_the_snapshot(void **state) {
    (void)state;
    struct cancel_job job = {.scene = fixture_scene()};
    const trc_scene scene = job.scene;
    assert_int_equal(trc_scene_cancel(scene), TRC_OK); /* none runs: no effect on the next */
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    const struct trc_snapshot *before = query_scene_snapshot(scene);
    create_large_mesh(scene);
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, cancel_commits, &job), 0);
    for (int i = 0; i < 3; i++) {
        const double start = trc_seconds();
        assert_int_equal(trc_scene_commit(scene), TRC_ERROR_CANCELLED);
        assert_true(trc_seconds() - start < 5.0);
        assert_ptr_equal(query_scene_snapshot(scene), before);
    }
    atomic_store(&job.stop, 1);
    pthread_join(thread, NULL);
    assert_int_equal(query_scene_stats(scene).mesh_count, 1);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    assert_int_equal(query_scene_stats(scene).mesh_count, 2);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(commits_share_what_stays),
        cmocka_unit_test(features_are_what_the_scene_uses),
        cmocka_unit_test(queries_hold_the_snapshot_no_longer),
        cmocka_unit_test(removed_lights_are_gone),
        cmocka_unit_test(cameras_move_if_their_keys_differ),
        cmocka_unit_test(instruction_sets_may_change),
        cmocka_unit_test(bad_texels_are_named),
        cmocka_unit_test(singular_instances_are_hidden_and_counted),
        cmocka_unit_test(trees_of_flat_instances_are_kept),
        cmocka_unit_test(destroyed_materials_leave_the_default),
        cmocka_unit_test(image_does_not_depend_on_threads),
        cmocka_unit_test(cancelled_renders_keep_what_they_have),
        cmocka_unit_test(waiting_threads_are_cancelled),
        cmocka_unit_test(progress_counts_whole_batches),
        cmocka_unit_test(destroying_releases_waiters),
        cmocka_unit_test(several_renders_at_once),
        cmocka_unit_test(cancelled_commits_leave_the_snapshot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
