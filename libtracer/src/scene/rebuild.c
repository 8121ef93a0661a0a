#include "scene/rebuild.h"

#include <pthread.h>
#include <stdatomic.h>

#include "core/core.h"
#include "core/pool.h"
#include "core/thread.h"
#include "scene/mesh.h"
#include "scene/scene.h"

struct trc_rebuild {
    struct trc_mesh *geometry; /* held: the pose that the tree is built for */
    uint32_t slot, generation; /* of the mesh in the store */
    struct trc_pool *pool;     /* of this thread alone: the others render */
    pthread_t thread;
    atomic_uint cancel;
    atomic_bool done;
    struct trc_blas *blas; /* the thread's until done; NULL if it failed */
};

static void work(void *context) {
    struct trc_rebuild *rebuild = context;
    struct trc_blas *blas = NULL;
    if (trc_blas_build(rebuild->geometry, rebuild->pool, &rebuild->cancel, &blas) == TRC_OK)
        rebuild->blas = blas;
    atomic_store(&rebuild->done, true);
}

static void free_rebuild(struct trc_rebuild *rebuild) {
    trc_blas_release(rebuild->blas);
    trc_pool_destroy(rebuild->pool);
    trc_geometry_release(rebuild->geometry);
    trc_free(rebuild);
}

static struct trc_rebuild *start(const struct trc_store *meshes, uint32_t slot) {
    struct trc_rebuild *rebuild = trc_alloc_zeroed(1, sizeof *rebuild);
    if (!rebuild)
        return NULL;
    atomic_init(&rebuild->cancel, 0);
    atomic_init(&rebuild->done, false);
    rebuild->slot = slot;
    rebuild->generation = meshes->slots[slot].generation;
    rebuild->geometry =
        trc_geometry_retain(((struct trc_scene_mesh *)meshes->slots[slot].object)->shown);
    if (trc_pool_create(1, &rebuild->pool) != TRC_OK ||
        trc_thread_start(&rebuild->thread, work, rebuild) != TRC_OK) {
        free_rebuild(rebuild);
        return NULL;
    }
    return rebuild;
}

struct trc_rebuild *trc_rebuild_start(const struct trc_store *meshes, const struct trc_bvh *bvh) {
    for (uint32_t i = trc_store_first(meshes); i != TRC_STORE_END; i = trc_store_next(meshes, i)) {
        const struct trc_scene_mesh *mesh = meshes->slots[i].object;
        if (trc_bvh_has_grown(bvh, mesh->index))
            return start(meshes, i);
    }
    return NULL;
}

void trc_rebuild_destroy(struct trc_rebuild *rebuild) {
    if (!rebuild)
        return;
    atomic_store(&rebuild->cancel, 1);
    pthread_join(rebuild->thread, NULL);
    free_rebuild(rebuild);
}

bool trc_rebuild_is_done(const struct trc_rebuild *rebuild) {
    return rebuild && atomic_load(&rebuild->done);
}

void trc_rebuild_offer(const struct trc_rebuild *rebuild, const struct trc_store *meshes,
                       struct trc_blas **blas_of_meshes) {
    const struct trc_store_slot *slot = &meshes->slots[rebuild->slot];
    if (!slot->object || slot->generation != rebuild->generation)
        return;
    blas_of_meshes[((const struct trc_scene_mesh *)slot->object)->index] = rebuild->blas;
}
