/* A part of a snapshot that several snapshots share: an object and the number of its holders. */
#ifndef TRACER_SCENE_SHARED_H
#define TRACER_SCENE_SHARED_H

#include <stdatomic.h>

struct trc_shared {
    atomic_uint refs;
    void *object;
    void (*destroy)(void *object);
};

/* One holder, who owns object through it. NULL when out of memory: object is untouched then. */
struct trc_shared *trc_shared_create(void *object, void (*destroy)(void *object));

/* NULL is fine for both. The last release destroys the object. */
struct trc_shared *trc_shared_retain(struct trc_shared *shared);
void trc_shared_release(struct trc_shared *shared);

#endif
