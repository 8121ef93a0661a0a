/* Cuts a block of memory into pieces, each at a multiple of 64 bytes. Without a block it measures.
 *
 * In builds with assertions or AddressSanitizer guards stand behind the pieces: sanitized code may
 * not touch them, in other debug builds they have a pattern that trc_carver_check looks for.
 * Release builds have none. */
#ifndef TRACER_CORE_CARVER_H
#define TRACER_CORE_CARVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__SANITIZE_ADDRESS__)
#define TRC_HAS_ADDRESS_SANITIZER 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define TRC_HAS_ADDRESS_SANITIZER 1
#endif
#endif
#ifdef TRC_HAS_ADDRESS_SANITIZER
#include <sanitizer/asan_interface.h>
#endif

#define TRC_CARVER_ALIGNMENT 64

/* A guard: the pattern, and where the guard before it ends; 0 for the first. */
struct trc_guard {
    uint64_t pattern[7];
    uint64_t former_end;
};
#define TRC_GUARD_PATTERN UINT64_C(0x7fa5c3967fa5c396) /* as two floats: NaN */
#if defined(TRC_HAS_ADDRESS_SANITIZER) || !defined(NDEBUG)
#define TRC_GUARD_BYTES 64 /* of struct trc_guard; read by #if, too */
#else
#define TRC_GUARD_BYTES 0
#endif
_Static_assert(TRC_GUARD_BYTES == 0 || TRC_GUARD_BYTES == sizeof(struct trc_guard), "of a guard");

struct trc_carver {
    char *base; /* aligned, or NULL */
    size_t used;
    size_t guards_end; /* of the last guard */
};

static inline void trc_carver_guard(struct trc_carver *c, size_t piece_end) {
#if defined(TRC_HAS_ADDRESS_SANITIZER)
    if (c->base)
        __asan_poison_memory_region(c->base + piece_end, c->used + TRC_GUARD_BYTES - piece_end);
#elif !defined(NDEBUG)
    if (c->base) {
        struct trc_guard guard = {.former_end = c->guards_end};
        for (size_t i = 0; i < sizeof guard.pattern / sizeof *guard.pattern; i++)
            guard.pattern[i] = TRC_GUARD_PATTERN;
        memcpy(c->base + c->used, &guard, sizeof guard);
    }
#endif
    (void)piece_end;
    c->used += TRC_GUARD_BYTES;
    c->guards_end = c->used;
}

/* The next piece; NULL without a block. */
static inline void *trc_carve(struct trc_carver *c, size_t bytes) {
    void *piece = c->base ? c->base + c->used : NULL;
    const size_t end = c->used + bytes;
    c->used = (end + TRC_CARVER_ALIGNMENT - 1) & ~(size_t)(TRC_CARVER_ALIGNMENT - 1);
    trc_carver_guard(c, end);
    return piece;
}

/* Whether no guard was written to; true in builds whose guards cannot be. */
static inline bool trc_carver_check(const struct trc_carver *c) {
#if !defined(TRC_HAS_ADDRESS_SANITIZER) && !defined(NDEBUG)
    for (size_t end = c->guards_end; end;) {
        struct trc_guard guard;
        memcpy(&guard, c->base + end - sizeof guard, sizeof guard);
        for (size_t i = 0; i < sizeof guard.pattern / sizeof *guard.pattern; i++)
            if (guard.pattern[i] != TRC_GUARD_PATTERN)
                return false;
        end = (size_t)guard.former_end;
    }
#else
    (void)c;
#endif
    return true;
}

#endif
