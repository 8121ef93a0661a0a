/* Status messages, memory, small helpers. */
#ifndef TRACER_CORE_CORE_H
#define TRACER_CORE_CORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tracer/base.h"

/* What the compiler holds formats against: C's own, also where the system has others. */
#ifdef __MINGW32__
#define TRC_PRINTF gnu_printf
#else
#define TRC_PRINTF printf
#endif

/* Sets this thread's message (printf-like, cut to 511 bytes) and returns status. */
trc_status trc_fail(trc_status status, const char *format, ...)
    __attribute__((format(TRC_PRINTF, 2, 3)));

/* Memory of the library: 64-byte aligned, counted, may fail (NULL). Sizes are count * size, checked
 * for overflow. trc_free(NULL) is fine. Freed blocks must come from here. Blocks of 2 MiB or more
 * take large pages where there are any: the system clears each whole when it is met first. */
void *trc_alloc(size_t count, size_t size);
void *trc_alloc_zeroed(size_t count, size_t size);
void trc_free(void *block);

/* Bytes in use now and at most. */
uint64_t trc_memory_bytes(void);
uint64_t trc_memory_peak_bytes(void);

/* Bytes that may be taken besides: what is left of the machine's memory, or of a container's,
 * beside the library's own, and of a limit of address space beside all of the process. Some system
 * calls: for what is large. */
uint64_t trc_memory_left_bytes(void);

/* Test hook: the n-th allocation or thread creation from now fails (0: the next), and each later
 * one too if all is true; negative n switches it off. */
void trc_memory_fail_at(int64_t n, bool all);
/* Whether an operation of that kind (thread creation) must fail now. */
bool trc_memory_should_fail(void);

/* Seconds of a monotonic clock. */
double trc_seconds(void);

#endif
