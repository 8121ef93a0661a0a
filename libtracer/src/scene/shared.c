#include "scene/shared.h"

#include "core/core.h"

struct trc_shared *trc_shared_create(void *object, void (*destroy)(void *object)) {
    struct trc_shared *shared = trc_alloc(1, sizeof *shared);
    if (!shared)
        return NULL;
    atomic_init(&shared->refs, 1);
    shared->object = object;
    shared->destroy = destroy;
    return shared;
}

struct trc_shared *trc_shared_retain(struct trc_shared *shared) {
    if (shared)
        atomic_fetch_add_explicit(&shared->refs, 1, memory_order_relaxed);
    return shared;
}

void trc_shared_release(struct trc_shared *shared) {
    if (!shared || atomic_fetch_sub(&shared->refs, 1) != 1)
        return;
    shared->destroy(shared->object);
    trc_free(shared);
}
