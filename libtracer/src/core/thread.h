/* Starting a thread of the library: all signals blocked, default floating-point state, a stack of
 * known size. */
#ifndef TRACER_CORE_THREAD_H
#define TRACER_CORE_THREAD_H

#include <pthread.h>
#include <stdint.h>

#include "tracer/base.h"

/* Most threads of one pool or render. */
#define TRC_MAX_THREADS 1024

/* Runs body(context) in a new thread, to be joined. NO_THREAD if the system refuses. */
trc_status trc_thread_start(pthread_t *thread_out, void (*body)(void *context), void *context);

/* Logical processors this process may use, 1..TRC_MAX_THREADS. */
uint32_t trc_thread_processor_count(void);

#endif
