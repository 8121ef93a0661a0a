#include "dicing/edge_table.h"

#include <string.h>

#include "core/core.h"

/* Fibonacci hashing: 2^64 over the golden ratio (Knuth, "The Art of Computer Programming", vol. 3,
 * section 6.4). */
#define GOLDEN 0x9e3779b97f4a7c15u
#define CAPACITY_MIN 16u

bool trc_edge_table_create(struct trc_edge_table *table, uint64_t count) {
    uint64_t capacity = CAPACITY_MIN;
    while (capacity < 2 * count) /* half of it stays free: short runs */
        capacity *= 2;
    table->mask = capacity - 1;
    table->keys = trc_alloc(capacity, sizeof *table->keys);
    table->values = trc_alloc(capacity, sizeof *table->values);
    if (!table->keys || !table->values)
        return false;
    memset(table->keys, 0xff, capacity * sizeof *table->keys);
    return true;
}

void trc_edge_table_free(struct trc_edge_table *table) {
    trc_free(table->keys);
    trc_free(table->values);
}

static uint64_t key_of(uint32_t a, uint32_t b) {
    return a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
}

/* Where a key is, or is to be. */
static uint64_t place_of(const struct trc_edge_table *table, uint64_t key) {
    uint64_t place = (key * GOLDEN) >> 20 & table->mask;
    while (table->keys[place] != key && table->keys[place] != UINT64_MAX)
        place = (place + 1) & table->mask;
    return place;
}

uint32_t trc_edge_table_take(struct trc_edge_table *table, uint32_t a, uint32_t b, uint32_t next) {
    const uint64_t key = key_of(a, b), place = place_of(table, key);
    if (table->keys[place] == UINT64_MAX) {
        table->keys[place] = key;
        table->values[place] = next;
    }
    return table->values[place];
}

uint32_t trc_edge_table_find(const struct trc_edge_table *table, uint32_t a, uint32_t b) {
    const uint64_t key = key_of(a, b), place = place_of(table, key);
    return table->keys[place] == key ? table->values[place] : UINT32_MAX;
}
