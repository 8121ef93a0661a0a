#define _POSIX_C_SOURCE 200809L
#include "core/handle.h"

#include <pthread.h>
#include <stdbool.h>
#include <string.h>

#include "core/core.h"

struct slot {
    void *object;        /* NULL: free */
    uint32_t generation; /* of the object, or of the next one */
    uint32_t pins;
    enum trc_handle_kind kind;
    bool removed; /* stale already, waiting for its pins */
};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t unpinned = PTHREAD_COND_INITIALIZER;
static struct slot *slots;
static uint32_t slot_count;
static uint32_t next_serial;

/* Most objects at once: far above what a host opens. */
#define MAX_SLOTS (1u << 20)

static uint64_t handle_of(uint32_t index) {
    return (uint64_t)slots[index].generation << 32 | (index + 1);
}

/* The slot of a handle that is alive or waiting for its pins, else NULL. Under the lock. */
static struct slot *slot_of(uint64_t handle) {
    const uint32_t number = (uint32_t)handle;
    if (number == 0 || number > slot_count)
        return NULL;
    struct slot *slot = &slots[number - 1];
    return slot->object && slot->generation == handle >> 32 ? slot : NULL;
}

/* An index of a free slot; false when out of memory. Under the lock. */
static bool take_slot(uint32_t *index) {
    for (uint32_t i = 0; i < slot_count; i++) {
        /* A slot whose generations are used up is never used again. */
        if (!slots[i].object && slots[i].generation != UINT32_MAX) {
            *index = i;
            return true;
        }
    }
    if (slot_count >= MAX_SLOTS)
        return false;
    const uint32_t count = slot_count ? slot_count * 2 : 8;
    struct slot *grown = trc_alloc_zeroed(count, sizeof *grown);
    if (!grown)
        return false;
    if (slot_count)
        memcpy(grown, slots, slot_count * sizeof *slots);
    trc_free(slots);
    for (uint32_t i = slot_count; i < count; i++)
        grown[i].generation = 1;
    *index = slot_count;
    slots = grown;
    slot_count = count;
    return true;
}

/* Ends a slot; its generation makes the handle stale. The table stays for the life of the process,
 * as generations must go on. Under the lock. */
static void clear_slot(struct slot *slot) {
    slot->object = NULL;
    slot->removed = false;
    slot->generation++;
}

trc_status trc_handle_create(enum trc_handle_kind kind, void *object, uint64_t *handle_out) {
    uint32_t index;
    pthread_mutex_lock(&lock);
    const bool ok = take_slot(&index);
    if (ok) {
        slots[index].object = object;
        slots[index].kind = kind;
        slots[index].pins = 0;
        slots[index].removed = false;
        *handle_out = handle_of(index);
    }
    pthread_mutex_unlock(&lock);
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a handle");
}

static const char *kind_name(enum trc_handle_kind kind) {
    return kind == TRC_HANDLE_SCENE ? "scene" : kind == TRC_HANDLE_RENDER ? "render" : "reader";
}

trc_status trc_handle_acquire(uint64_t handle, enum trc_handle_kind kind, void **object_out) {
    pthread_mutex_lock(&lock);
    struct slot *slot = slot_of(handle);
    const bool foreign = slot && slot->kind != kind;
    const bool ok = slot && !foreign && !slot->removed;
    if (ok) {
        slot->pins++;
        *object_out = slot->object;
    }
    pthread_mutex_unlock(&lock);
    if (ok)
        return TRC_OK;
    return trc_fail(TRC_ERROR_INVALID_HANDLE, "the %s handle is %s", kind_name(kind),
                    handle == 0 ? "null"
                    : foreign   ? "one of another kind of object"
                                : "stale, or never was one");
}

void trc_handle_release(uint64_t handle) {
    pthread_mutex_lock(&lock);
    struct slot *slot = slot_of(handle);
    if (slot && --slot->pins <= 1 && slot->removed)
        pthread_cond_broadcast(&unpinned);
    pthread_mutex_unlock(&lock);
}

trc_status trc_handle_remove(uint64_t handle) {
    pthread_mutex_lock(&lock);
    struct slot *slot = slot_of(handle);
    const bool first = !slot->removed;
    if (first) {
        slot->removed = true;
        /* The table may move while the lock is given up: look the slot up again each time. */
        while ((slot = slot_of(handle))->pins > 1)
            pthread_cond_wait(&unpinned, &lock);
        clear_slot(slot);
    } else if (--slot->pins <= 1) {
        pthread_cond_broadcast(&unpinned);
    }
    pthread_mutex_unlock(&lock);
    if (first)
        return TRC_OK;
    return trc_fail(TRC_ERROR_INVALID_HANDLE, "the handle is being destroyed by another thread");
}

uint32_t trc_handle_serial(void) {
    pthread_mutex_lock(&lock);
    const uint32_t serial = ++next_serial;
    pthread_mutex_unlock(&lock);
    return serial;
}
