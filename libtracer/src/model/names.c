#define _POSIX_C_SOURCE 200809L
#include "model/names.h"

#include <stdbool.h>
#include <string.h>

#include "core/core.h"

/* More are an attack on memory and on the scan. */
#define MAX_NAMES 65536u

struct name {
    uint32_t hash;
    char text[TRC_MAX_NAME_BYTES + 1];
};

struct trc_names {
    struct name *items;
    uint32_t count, capacity;
};

struct trc_names *trc_names_create(void) {
    return trc_alloc_zeroed(1, sizeof(struct trc_names));
}

void trc_names_destroy(struct trc_names *names) {
    if (!names)
        return;
    trc_free(names->items);
    trc_free(names);
}

/* FNV-1a. */
static uint32_t hash_text(const char *text, size_t size) {
    uint32_t hash = 2166136261u;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ (uint8_t)text[i]) * 16777619u;
    return hash;
}

static bool grow(struct trc_names *names) {
    const uint32_t capacity = names->capacity ? names->capacity * 2 : 16;
    struct name *items = trc_alloc(capacity, sizeof *items);
    if (!items)
        return false;
    if (names->count)
        memcpy(items, names->items, names->count * sizeof *items);
    trc_free(names->items);
    names->items = items;
    names->capacity = capacity;
    return true;
}

trc_status trc_names_add(struct trc_names *names, const char *name, uint32_t *number_out) {
    if (!name)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "an attribute name is NULL");
    const size_t size = strnlen(name, TRC_MAX_NAME_BYTES + 1);
    if (size > TRC_MAX_NAME_BYTES) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "an attribute name is longer than %d bytes",
                        TRC_MAX_NAME_BYTES);
    }
    /* A scene has a handful of names: a scan that compares hashes is enough. */
    const uint32_t hash = hash_text(name, size);
    for (uint32_t i = 0; i < names->count; i++) {
        if (names->items[i].hash == hash && strcmp(names->items[i].text, name) == 0) {
            *number_out = i;
            return TRC_OK;
        }
    }
    if (names->count == MAX_NAMES) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "the scene has more than %u attribute names",
                        MAX_NAMES);
    }
    if (names->count == names->capacity && !grow(names)) {
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an attribute name");
    }
    struct name *item = &names->items[names->count];
    item->hash = hash;
    memcpy(item->text, name, size + 1);
    *number_out = names->count++;
    return TRC_OK;
}
