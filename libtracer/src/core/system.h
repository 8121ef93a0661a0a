/* What the library asks of the operating system beside C and POSIX threads, which all compilers
 * bring: system_posix.c, system_windows.c. Processes and files: image/process.h. */
#ifndef TRACER_CORE_SYSTEM_H
#define TRACER_CORE_SYSTEM_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* As good as no limit, and sums of two do not overflow. */
#define TRC_SYSTEM_NO_LIMIT (UINT64_MAX / 2)

/* Starts a thread that never handles a signal of the host; false if the system refuses. */
bool trc_system_start_thread(pthread_t *thread_out, size_t stack_bytes, void *(*body)(void *),
                             void *argument);

/* Logical processors this process may use; 0 if the system does not say. */
uint32_t trc_system_processor_count(void);

/* Memory of the machine, or of the smallest container that the process is in. */
uint64_t trc_system_memory_bytes(void);

/* What a limit of the process's address space leaves beside all that it has mapped. */
uint64_t trc_system_address_space_left(void);

/* Asks for large pages for a block of memory: a wish, since small ones do, too. */
void trc_system_want_large_pages(void *block, size_t bytes);

/* A condition for trc_system_wait. */
bool trc_system_create_condition(pthread_cond_t *condition);

/* Waits at most until trc_seconds() has come to the deadline; false then. Setting the clock changes
 * nothing. */
bool trc_system_wait(pthread_cond_t *condition, pthread_mutex_t *lock, double deadline);

#endif
