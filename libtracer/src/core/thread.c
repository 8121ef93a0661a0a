#include "core/thread.h"

#include "core/core.h"
#include "core/fpstate.h"
#include "core/system.h"

/* Enough for the deepest kernel frames whatever limit the host was started with. */
#define STACK_BYTES ((size_t)8 << 20)

struct start {
    void (*body)(void *context);
    void *context;
};

static void *thread_main(void *argument) {
    struct start *start = argument;
    const struct start own = *start;
    trc_free(start);
    (void)trc_fp_enter();
    own.body(own.context);
    return NULL;
}

trc_status trc_thread_start(pthread_t *thread_out, void (*body)(void *context), void *context) {
    struct start *start = trc_alloc(1, sizeof *start);
    if (!start)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a thread");
    start->body = body;
    start->context = context;
    if (trc_memory_should_fail() ||
        !trc_system_start_thread(thread_out, STACK_BYTES, thread_main, start)) {
        trc_free(start);
        return trc_fail(TRC_ERROR_NO_THREAD, "the system refused to start a thread");
    }
    return TRC_OK;
}

uint32_t trc_thread_processor_count(void) {
    const uint32_t count = trc_system_processor_count();
    if (count < 1)
        return 1;
    return count < TRC_MAX_THREADS ? count : TRC_MAX_THREADS;
}
