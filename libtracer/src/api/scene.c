/* Public calls on scenes. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "core/handle.h"
#include "core/thread.h"
#include "scene/commit.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

trc_status trc_scene_create(const trc_scene_desc *desc, trc_scene *scene_out) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_scene_desc"));
    TRC_TRY(trc_check_out(scene_out, sizeof *scene_out, "scene_out"));
    TRC_TRY(trc_check_count(desc->thread_count, 0, TRC_MAX_THREADS, "thread_count"));
    TRC_TRY(trc_check_enum(desc->is_final, 2, "is_final"));
    const uint64_t fp_state = trc_fp_enter();
    struct trc_scene_state *scene;
    trc_status status = trc_scene_state_create(desc, &scene);
    if (status == TRC_OK) {
        status = trc_handle_create(TRC_HANDLE_SCENE, scene, scene_out);
        if (status != TRC_OK)
            trc_scene_state_destroy(scene);
    }
    trc_fp_leave(fp_state);
    return status;
}

static void cancel_commit(struct trc_scene_state *scene) {
    pthread_mutex_lock(&scene->cancel_lock);
    if (scene->committing)
        atomic_store(&scene->cancel, 1);
    pthread_mutex_unlock(&scene->cancel_lock);
}

trc_status trc_scene_destroy(trc_scene scene) {
    void *object;
    TRC_TRY(trc_handle_acquire(scene, TRC_HANDLE_SCENE, &object));
    cancel_commit(object);
    TRC_TRY(trc_handle_remove(scene));
    trc_scene_state_destroy(object);
    return TRC_OK;
}

trc_status trc_scene_commit(trc_scene scene) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_state_commit(access.scene);
    trc_scene_leave(&access);
    return status;
}

/* Without the scene's lock, which a running commit holds. */
trc_status trc_scene_cancel(trc_scene scene) {
    void *object;
    TRC_TRY(trc_handle_acquire(scene, TRC_HANDLE_SCENE, &object));
    cancel_commit(object);
    trc_handle_release(scene);
    return TRC_OK;
}

static trc_status not_committed(void) {
    return trc_fail(TRC_ERROR_NOT_COMMITTED, "the scene has not been committed yet");
}

trc_status trc_scene_get_stats(trc_scene scene, trc_scene_stats *stats_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = trc_check_struct(stats_out, sizeof *stats_out, "trc_scene_stats");
    if (status == TRC_OK && !access.scene->snapshot)
        status = not_committed();
    if (status == TRC_OK)
        *stats_out = access.scene->snapshot->stats;
    trc_scene_leave(&access);
    return status;
}

/* Copies as much of text as fits, not ending within a character. */
static void copy_text(const char *text, uint64_t size, char *text_out, uint64_t capacity) {
    uint64_t count = size < capacity ? size : capacity;
    if (!count)
        return;
    count--; /* the terminator */
    while (count > 0 && ((uint8_t)text[count] & 0xc0) == 0x80)
        count--;
    memcpy(text_out, text, count);
    text_out[count] = '\0';
}

trc_status trc_scene_get_warnings(trc_scene scene, char *text_out, uint64_t capacity,
                                  uint64_t *size_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = TRC_OK;
    if (capacity && !text_out) {
        status = trc_fail(TRC_ERROR_INVALID_ARGUMENT, "text_out is NULL");
    } else if (size_out) {
        status = trc_check_out(size_out, sizeof *size_out, "size_out");
    }
    if (status == TRC_OK && !access.scene->snapshot)
        status = not_committed();
    if (status == TRC_OK) {
        const char *text = trc_snapshot_warnings(access.scene->snapshot);
        const uint64_t size = strlen(text) + 1;
        copy_text(text, size, text_out, capacity);
        if (size_out)
            *size_out = size;
    }
    trc_scene_leave(&access);
    return status;
}
