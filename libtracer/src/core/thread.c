#define _GNU_SOURCE
#include "core/thread.h"

#include <sched.h>
#include <signal.h>
#include <unistd.h>

#include "core/core.h"
#include "core/fpstate.h"

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

static int create(pthread_t *thread, void *argument) {
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error)
        return error;
    pthread_attr_setstacksize(&attributes, STACK_BYTES);
    /* The new thread inherits the mask: no signal of the host is ever handled in it. */
    sigset_t all, former;
    sigfillset(&all);
    error = pthread_sigmask(SIG_SETMASK, &all, &former);
    if (!error) {
        error = pthread_create(thread, &attributes, thread_main, argument);
        pthread_sigmask(SIG_SETMASK, &former, NULL);
    }
    pthread_attr_destroy(&attributes);
    return error;
}

trc_status trc_thread_start(pthread_t *thread_out, void (*body)(void *context), void *context) {
    struct start *start = trc_alloc(1, sizeof *start);
    if (!start)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a thread");
    start->body = body;
    start->context = context;
    if (trc_memory_should_fail() || create(thread_out, start)) {
        trc_free(start);
        return trc_fail(TRC_ERROR_NO_THREAD, "the system refused to start a thread");
    }
    return TRC_OK;
}

uint32_t trc_thread_processor_count(void) {
    long count = 0;
#if defined(__linux__)
    /* A fixed set covers 1024 processors; a larger machine makes the call fail, not overflow. */
    cpu_set_t set;
    CPU_ZERO(&set);
    if (sched_getaffinity(0, sizeof set, &set) == 0)
        count = CPU_COUNT(&set);
#endif
    if (count <= 0)
        count = sysconf(_SC_NPROCESSORS_ONLN);
    if (count < 1)
        return 1;
    return count < TRC_MAX_THREADS ? (uint32_t)count : TRC_MAX_THREADS;
}
