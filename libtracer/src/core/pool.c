#define _POSIX_C_SOURCE 200809L
#include "core/pool.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "core/core.h"
#include "core/fpstate.h"
#include "core/thread.h"

struct worker {
    struct trc_pool *pool;
    uint32_t number; /* 1..: the caller of trc_pool_run is number 0 */
    pthread_t thread;
};

struct trc_pool {
    uint32_t thread_count;
    uint32_t started_count; /* threads that run, at most thread_count - 1 */
    struct worker *workers;
    pthread_mutex_t lock;
    pthread_cond_t wake;      /* a run has begun, or the end */
    pthread_cond_t done;      /* the last worker has left a run */
    atomic_uint_fast64_t run; /* number of the current run; changes under the lock */
    atomic_uint busy;         /* workers that have not left the current run */
    bool stop;
    void (*task)(void *context, uint32_t index, uint32_t worker);
    void *context;
    uint32_t count;
    atomic_uint_fast64_t next; /* 64 bits: it passes count once per thread */
};

static void work(struct trc_pool *pool, uint32_t number) {
    for (;;) {
        const uint64_t index = atomic_fetch_add_explicit(&pool->next, 1, memory_order_relaxed);
        if (index >= pool->count)
            return;
        pool->task(pool->context, (uint32_t)index, number);
    }
}

/* Looks at most so often, some 20 microseconds long, before a thread goes to sleep: a build hands
 * out a hundred short runs, and to be woken takes as long. */
#define LOOKS 1000
static void look_away(void) {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
}

/* Waits for a run after the one seen; false at the end. */
static bool run_await(struct trc_pool *pool, uint64_t *seen) {
    for (int i = 0; i < LOOKS && atomic_load(&pool->run) == *seen; i++)
        look_away();
    pthread_mutex_lock(&pool->lock);
    while (!pool->stop && pool->run == *seen)
        pthread_cond_wait(&pool->wake, &pool->lock);
    *seen = pool->run;
    const bool goes_on = !pool->stop;
    pthread_mutex_unlock(&pool->lock);
    return goes_on;
}

static void worker_main(void *argument) {
    const struct worker *worker = argument;
    struct trc_pool *pool = worker->pool;
    uint64_t seen = 0;
    while (run_await(pool, &seen)) {
        work(pool, worker->number);
        if (atomic_fetch_sub(&pool->busy, 1) != 1)
            continue;
        pthread_mutex_lock(&pool->lock);
        pthread_cond_signal(&pool->done);
        pthread_mutex_unlock(&pool->lock);
    }
}

static void workers_await(struct trc_pool *pool) {
    for (int i = 0; i < LOOKS && atomic_load(&pool->busy); i++)
        look_away();
    if (!atomic_load(&pool->busy))
        return;
    pthread_mutex_lock(&pool->lock);
    while (pool->busy)
        pthread_cond_wait(&pool->done, &pool->lock);
    pthread_mutex_unlock(&pool->lock);
}

static trc_status start_workers(struct trc_pool *pool) {
    for (uint32_t i = 0; i + 1 < pool->thread_count; i++) {
        struct worker *worker = &pool->workers[i];
        worker->pool = pool;
        worker->number = i + 1;
        const trc_status status = trc_thread_start(&worker->thread, worker_main, worker);
        if (status != TRC_OK)
            return status;
        pool->started_count++;
    }
    return TRC_OK;
}

static trc_status init_sync(struct trc_pool *pool) {
    if (pthread_mutex_init(&pool->lock, NULL))
        goto fail;
    if (pthread_cond_init(&pool->wake, NULL))
        goto fail_lock;
    if (pthread_cond_init(&pool->done, NULL))
        goto fail_wake;
    return TRC_OK;
fail_wake:
    pthread_cond_destroy(&pool->wake);
fail_lock:
    pthread_mutex_destroy(&pool->lock);
fail:
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "the system has no resources for a thread pool");
}

trc_status trc_pool_create(uint32_t thread_count, struct trc_pool **pool_out) {
    if (!thread_count)
        thread_count = trc_thread_processor_count();
    if (thread_count > TRC_MAX_THREADS) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "%u threads, at most %d", thread_count,
                        TRC_MAX_THREADS);
    }
    struct trc_pool *pool = trc_alloc_zeroed(1, sizeof *pool);
    struct worker *workers = trc_alloc_zeroed(thread_count, sizeof *workers);
    if (!pool || !workers) {
        trc_free(pool);
        trc_free(workers);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a thread pool");
    }
    pool->thread_count = thread_count;
    pool->workers = workers;
    trc_status status = init_sync(pool);
    if (status != TRC_OK) {
        trc_free(workers);
        trc_free(pool);
        return status;
    }
    status = start_workers(pool);
    if (status != TRC_OK) {
        trc_pool_destroy(pool);
        return status;
    }
    *pool_out = pool;
    return TRC_OK;
}

void trc_pool_destroy(struct trc_pool *pool) {
    if (!pool)
        return;
    pthread_mutex_lock(&pool->lock);
    pool->stop = true;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->lock);
    for (uint32_t i = 0; i < pool->started_count; i++)
        pthread_join(pool->workers[i].thread, NULL);
    pthread_cond_destroy(&pool->done);
    pthread_cond_destroy(&pool->wake);
    pthread_mutex_destroy(&pool->lock);
    trc_free(pool->workers);
    trc_free(pool);
}

uint32_t trc_pool_thread_count(const struct trc_pool *pool) { return pool->thread_count; }

void trc_pool_run(struct trc_pool *pool, uint32_t count,
                  void (*task)(void *context, uint32_t index, uint32_t worker), void *context) {
    if (!count)
        return;
    const uint64_t former = trc_fp_enter();
    /* One task, or no workers: waking them would only cost. */
    if (count == 1 || !pool->started_count) {
        for (uint32_t i = 0; i < count; i++)
            task(context, i, 0);
        trc_fp_leave(former);
        return;
    }
    pthread_mutex_lock(&pool->lock);
    pool->task = task;
    pool->context = context;
    pool->count = count;
    atomic_store(&pool->next, 0);
    pool->busy = pool->started_count;
    pool->run++;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->lock);
    work(pool, 0);
    workers_await(pool);
    trc_fp_leave(former);
}
