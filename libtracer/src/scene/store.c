#include "scene/store.h"

#include <string.h>

#include "core/core.h"

/* An id: kind in bits 60-63, generation in bits 32-59, slot + 1 below. */
#define GENERATION_MASK 0x0fffffffu

/* Most objects of one kind over a scene's life (images) or at once. */
#define MAX_SLOTS (1u << 28)

void trc_store_init(struct trc_store *store, enum trc_store_kind kind, bool keeps_slots,
                    uint32_t seed) {
    memset(store, 0, sizeof *store);
    store->kind = kind;
    store->keeps_slots = keeps_slots;
    /* A multiplicative hash spreads scenes over the generations; 0 is no generation. */
    store->first_generation = (seed * 2654435761u >> 4 & GENERATION_MASK) | 1u;
    store->first = store->last = store->free_slot = TRC_STORE_END;
}

void trc_store_free(struct trc_store *store) {
    trc_free(store->slots);
    store->slots = NULL;
    store->slot_count = store->capacity = store->living_count = 0;
    store->first = store->last = store->free_slot = TRC_STORE_END;
}

static bool grow(struct trc_store *store) {
    const uint32_t capacity = store->capacity ? store->capacity * 2 : 16;
    struct trc_store_slot *slots = trc_alloc(capacity, sizeof *slots);
    if (!slots)
        return false;
    if (store->slot_count)
        memcpy(slots, store->slots, store->slot_count * sizeof *slots);
    trc_free(store->slots);
    store->slots = slots;
    store->capacity = capacity;
    return true;
}

static const char *kind_name(enum trc_store_kind kind) {
    static const char *const names[] = {"", "mesh", "instance", "material", "image", "light"};
    return names[kind];
}

trc_status trc_store_add(struct trc_store *store, void *object, trc_id *id_out) {
    uint32_t i = store->free_slot;
    if (i == TRC_STORE_END) {
        if (store->slot_count >= MAX_SLOTS) {
            return trc_fail(TRC_ERROR_TOO_LARGE, "the scene has too many objects (%s)",
                            kind_name(store->kind));
        }
        if (store->slot_count == store->capacity && !grow(store)) {
            return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for another %s",
                            kind_name(store->kind));
        }
        i = store->slot_count++;
        store->slots[i].generation = store->first_generation;
    } else {
        store->free_slot = store->slots[i].next;
    }
    struct trc_store_slot *slot = &store->slots[i];
    slot->object = object;
    slot->former = store->last;
    slot->next = TRC_STORE_END;
    if (store->last == TRC_STORE_END)
        store->first = i;
    else
        store->slots[store->last].next = i;
    store->last = i;
    store->living_count++;
    *id_out = (uint64_t)store->kind << 60 | (uint64_t)slot->generation << 32 | (i + 1);
    return TRC_OK;
}

void *trc_store_get(const struct trc_store *store, trc_id id) {
    const uint32_t number = (uint32_t)id;
    if (id >> 60 != store->kind || number == 0 || number > store->slot_count)
        return NULL;
    const struct trc_store_slot *slot = &store->slots[number - 1];
    return slot->generation == (id >> 32 & GENERATION_MASK) ? slot->object : NULL;
}

trc_status trc_store_find(const struct trc_store *store, trc_id id, void **object_out) {
    void *object = trc_store_get(store, id);
    if (object) {
        *object_out = object;
        return TRC_OK;
    }
    const char *why = id == 0                   ? "null"
                      : id >> 60 != store->kind ? "that of another kind of object"
                                                : "stale, or of another scene";
    return trc_fail(TRC_ERROR_INVALID_HANDLE, "the %s id is %s", kind_name(store->kind), why);
}

void trc_store_remove(struct trc_store *store, trc_id id) {
    const uint32_t i = trc_store_slot_of(id);
    struct trc_store_slot *slot = &store->slots[i];
    if (slot->former == TRC_STORE_END)
        store->first = slot->next;
    else
        store->slots[slot->former].next = slot->next;
    if (slot->next == TRC_STORE_END)
        store->last = slot->former;
    else
        store->slots[slot->next].former = slot->former;
    slot->object = NULL;
    store->living_count--;
    /* A slot whose generations are used up is never used again. */
    slot->generation = (slot->generation + 1) & GENERATION_MASK;
    if (store->keeps_slots || slot->generation == store->first_generation)
        return;
    slot->next = store->free_slot;
    store->free_slot = i;
}

void trc_store_take_back(struct trc_store *store, trc_id id) {
    trc_store_remove(store, id);
    if (store->keeps_slots)
        store->slot_count--; /* only the last one can have been added last */
}

uint32_t trc_store_slot_of(trc_id id) { return (uint32_t)id - 1; }
