/* Life of the editable scene, and how public calls get at it. */
#define _POSIX_C_SOURCE 200809L
#include "scene/scene.h"
#include "scene/rebuild.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "core/handle.h"
#include "core/pool.h"
#include "image/image.h"
#include "image/prefetch.h"
#include "image/reader.h"
#include "scene/commit.h"
#include "scene/displace.h"
#include "scene/mesh.h"
#include "shading/compile.h"

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a scene");
}

static void init_stores(struct trc_scene_state *scene) {
    const uint32_t seed = trc_handle_serial();
    trc_store_init(&scene->meshes, TRC_STORE_MESH, false, seed);
    trc_store_init(&scene->instances, TRC_STORE_INSTANCE, false, seed);
    trc_store_init(&scene->materials, TRC_STORE_MATERIAL, false, seed);
    trc_store_init(&scene->images, TRC_STORE_IMAGE, true, seed);
    trc_store_init(&scene->lights, TRC_STORE_LIGHT, false, seed);
}

/* The reader of a handle, or one of the scene's own. */
static trc_status take_reader(trc_reader handle, struct trc_image_reader **reader_out) {
    if (!handle)
        return trc_image_reader_create(NULL, NULL, reader_out);
    void *object;
    TRC_TRY(trc_handle_acquire(handle, TRC_HANDLE_READER, &object));
    *reader_out = trc_image_reader_retain(object);
    trc_handle_release(handle);
    return TRC_OK;
}

trc_status trc_scene_state_create(const trc_scene_desc *desc, struct trc_scene_state **scene_out) {
    struct trc_scene_state *scene = trc_alloc_zeroed(1, sizeof *scene);
    if (!scene)
        return no_memory();
    if (pthread_mutex_init(&scene->lock, NULL)) {
        trc_free(scene);
        return no_memory();
    }
    if (pthread_mutex_init(&scene->cancel_lock, NULL)) {
        pthread_mutex_destroy(&scene->lock);
        trc_free(scene);
        return no_memory();
    }
    scene->thread_count = desc->thread_count;
    scene->is_final = desc->is_final != 0;
    scene->image_bytes_max = (uint64_t)desc->image_megabytes << 20;
    scene->changed = TRC_CHANGED_ALL;
    atomic_init(&scene->cancel, 0);
    init_stores(scene);
    scene->names = trc_names_create();
    trc_status status = scene->names ? trc_scene_make_default_material(scene) : no_memory();
    if (status == TRC_OK)
        status = take_reader(desc->reader, &scene->reader);
    if (status != TRC_OK) {
        trc_scene_state_destroy(scene);
        return status;
    }
    *scene_out = scene;
    return TRC_OK;
}

static void destroy_mesh(void *object) {
    trc_displacer_destroy(((struct trc_scene_mesh *)object)->displacer);
    trc_geometry_release(((struct trc_scene_mesh *)object)->geometry);
    trc_free(object);
}

static void destroy_material(void *object) { trc_material_release(object); }

static void destroy_image(void *object) { trc_image_release(object); }

static void destroy_all(struct trc_store *store, void (*destroy)(void *object)) {
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        destroy(store->slots[i].object);
    }
    trc_store_free(store);
}

void trc_scene_state_destroy(struct trc_scene_state *scene) {
    trc_prefetch_destroy(scene->prefetch);
    trc_rebuild_destroy(scene->rebuild);
    trc_pool_destroy(scene->pool);
    trc_snapshot_release(scene->snapshot);
    trc_shared_release(scene->camera);
    destroy_all(&scene->instances, trc_free);
    destroy_all(&scene->meshes, destroy_mesh);
    destroy_all(&scene->lights, trc_free);
    destroy_all(&scene->materials, destroy_material);
    destroy_all(&scene->images, destroy_image);
    trc_material_release(scene->default_material);
    trc_names_destroy(scene->names);
    if (scene->reader)
        trc_image_reader_rest(scene->reader);
    trc_image_reader_release(scene->reader);
    pthread_mutex_destroy(&scene->cancel_lock);
    pthread_mutex_destroy(&scene->lock);
    trc_free(scene);
}

trc_status trc_scene_enter(trc_scene handle, struct trc_scene_access *access_out) {
    void *object;
    TRC_TRY(trc_handle_acquire(handle, TRC_HANDLE_SCENE, &object));
    struct trc_scene_state *scene = object;
    /* Calls on one scene must not overlap; if they do all the same, they take turns. */
    pthread_mutex_lock(&scene->lock);
    *access_out = (struct trc_scene_access){scene, handle, trc_fp_enter()};
    return TRC_OK;
}

void trc_scene_leave(const struct trc_scene_access *access) {
    trc_fp_leave(access->fp_state);
    pthread_mutex_unlock(&access->scene->lock);
    trc_handle_release(access->handle);
}
