/* Memory of the library: every block is 64-byte aligned, counted, and can be made to fail. */
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/system.h"

/* A cache line, and the widest vector register. */
#define ALIGNMENT 64
/* Of x86 and arm64. Blocks of one or more take them. */
#define LARGE_PAGE ((size_t)2 << 20)

/* Stands directly before a block. */
struct header {
    void *base;   /* what malloc returned */
    size_t bytes; /* what the caller asked for */
};

/* Counters of the process; they steer nothing but the statistics. */
static atomic_uint_fast64_t bytes_in_use;
static atomic_uint_fast64_t bytes_peak;

/* Test hook: operations left before the failure; negative: off. */
static atomic_int_fast64_t fail_countdown = -1;
static atomic_bool fail_all;

void trc_memory_fail_at(int64_t n, bool all) {
    atomic_store(&fail_all, all);
    atomic_store(&fail_countdown, n < 0 ? -1 : n);
}

bool trc_memory_should_fail(void) {
    int_fast64_t left = atomic_load_explicit(&fail_countdown, memory_order_relaxed);
    while (left >= 0) {
        /* At 0 the failure happens; it stays at 0 when every later operation shall fail too. */
        const int_fast64_t next = left > 0 ? left - 1 : atomic_load(&fail_all) ? 0 : -1;
        if (atomic_compare_exchange_weak(&fail_countdown, &left, next))
            return left == 0;
    }
    return false;
}

static void count_block(size_t bytes) {
    const uint_fast64_t now = atomic_fetch_add(&bytes_in_use, bytes) + bytes;
    uint_fast64_t peak = atomic_load(&bytes_peak);
    while (now > peak && !atomic_compare_exchange_weak(&bytes_peak, &peak, now)) {
    }
}

/* Up to the end of its last large page, unless less than half of that is asked for. */
static size_t whole_pages(size_t bytes) {
    return bytes % LARGE_PAGE < LARGE_PAGE / 2 ? bytes : (bytes | (LARGE_PAGE - 1)) + 1;
}

static void *allocate(size_t count, size_t size, bool zeroed) {
    if (trc_memory_should_fail())
        return NULL;
    if (size && count > (PTRDIFF_MAX - 3 * LARGE_PAGE) / size)
        return NULL;
    const size_t bytes = count * size;
    const bool is_large = bytes >= LARGE_PAGE;
    const size_t used = is_large ? whole_pages(bytes) : bytes;
    const size_t alignment = is_large ? LARGE_PAGE : ALIGNMENT;
    const size_t total = used + sizeof(struct header) + alignment - 1;
    /* calloc leaves untouched pages of a large film to the system, large ones too; what is smaller
     * is used at once, and calloc may fetch new pages for it where malloc has old ones. */
    char *base = zeroed && is_large ? calloc(1, total) : malloc(total);
    if (!base)
        return NULL;
    const uintptr_t first = (uintptr_t)base + sizeof(struct header);
    char *block = base + sizeof(struct header) + (-first & (alignment - 1));
    const struct header header = {base, bytes};
    memcpy(block - sizeof header, &header, sizeof header);
    if (zeroed && !is_large)
        memset(block, 0, bytes);
    if (is_large)
        trc_system_want_large_pages(block, used);
    count_block(bytes);
    return block;
}

void *trc_alloc(size_t count, size_t size) { return allocate(count, size, false); }

void *trc_alloc_zeroed(size_t count, size_t size) { return allocate(count, size, true); }

void trc_free(void *block) {
    if (!block)
        return;
    struct header header;
    memcpy(&header, (char *)block - sizeof header, sizeof header);
    atomic_fetch_sub(&bytes_in_use, header.bytes);
    free(header.base);
}

uint64_t trc_memory_bytes(void) { return atomic_load(&bytes_in_use); }

uint64_t trc_memory_peak_bytes(void) { return atomic_load(&bytes_peak); }

uint64_t trc_memory_left_bytes(void) {
    const uint64_t used = trc_memory_bytes(), all = trc_system_memory_bytes();
    const uint64_t own = all > used ? all - used : 0, left = trc_system_address_space_left();
    return own < left ? own : left;
}
