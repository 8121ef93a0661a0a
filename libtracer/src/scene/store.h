/* Objects of a scene under generation-checked ids, in creation order. The store knows the objects'
 * addresses only; their owner frees them. Not locked: the scene's lock covers it. */
#ifndef TRACER_SCENE_STORE_H
#define TRACER_SCENE_STORE_H

#include <stdbool.h>
#include <stdint.h>

#include "tracer/base.h"

/* Part of every id, so that a mesh's id is never taken for a light's. */
enum trc_store_kind {
    TRC_STORE_MESH = 1,
    TRC_STORE_INSTANCE = 2,
    TRC_STORE_MATERIAL = 3,
    TRC_STORE_IMAGE = 4,
    TRC_STORE_LIGHT = 5
};

#define TRC_STORE_END UINT32_MAX

struct trc_store_slot {
    void *object;          /* NULL: free */
    uint32_t generation;   /* of the object, or of the next one */
    uint32_t next, former; /* neighbours in creation order; next of a free slot: the next free */
};

struct trc_store {
    enum trc_store_kind kind;
    bool keeps_slots; /* a slot is used once: for objects that others name by slot number */
    uint32_t first_generation;
    struct trc_store_slot *slots;
    uint32_t slot_count, capacity;
    uint32_t first, last; /* of the living; TRC_STORE_END: none */
    uint32_t free_slot;
    uint32_t living_count;
};

/* seed differs from scene to scene, so that an id of another scene is most likely refused. */
void trc_store_init(struct trc_store *store, enum trc_store_kind kind, bool keeps_slots,
                    uint32_t seed);

/* Frees the table, not the objects. */
void trc_store_free(struct trc_store *store);

/* OUT_OF_MEMORY or TOO_LARGE leave everything as it was. */
trc_status trc_store_add(struct trc_store *store, void *object, trc_id *id_out);

/* INVALID_HANDLE, with a message, for a null, stale or foreign id. */
trc_status trc_store_find(const struct trc_store *store, trc_id id, void **object_out);

/* The object, or NULL without a message. */
void *trc_store_get(const struct trc_store *store, trc_id id);

/* The id must be alive. */
void trc_store_remove(struct trc_store *store, trc_id id);

/* Undoes the last trc_store_add, whose id nobody was given: no slot is used up. */
void trc_store_take_back(struct trc_store *store, trc_id id);

/* Slot number of a living id; slot_count bounds it. */
uint32_t trc_store_slot_of(trc_id id);

/* for (i = trc_store_first(s); i != TRC_STORE_END; i = trc_store_next(s, i)): creation order. */
static inline uint32_t trc_store_first(const struct trc_store *store) { return store->first; }
static inline uint32_t trc_store_next(const struct trc_store *store, uint32_t slot) {
    return store->slots[slot].next;
}

#endif
