/* Reading images ahead: see prefetch.h. */
#define _POSIX_C_SOURCE 200809L
#include "image/prefetch.h"

#include <pthread.h>
#include <string.h>

#include "core/core.h"
#include "core/thread.h"

/* Files that are read at once: more wait for the disk and take memory. */
#define MAX_THREADS 8
#define MAX_BYTES ((uint64_t)1 << 30)
#define MESSAGE_BYTES 512

enum job_state { JOB_WAITS, JOB_RUNS, JOB_DONE };

struct job {
    struct job *next;
    trc_image_desc desc; /* its texts stand behind the job */
    enum job_state state;
    trc_status status;
    char message[MESSAGE_BYTES]; /* of a failure */
    struct trc_image *image;
};

struct trc_prefetch {
    struct trc_image_reader *reader; /* of whoever made this */
    uint64_t bytes_max;
    atomic_uint cancel;
    pthread_mutex_t lock; /* what follows */
    pthread_cond_t wake;  /* there is a job, or room, or the end */
    pthread_cond_t done;  /* a job is */
    struct job *jobs;     /* the first added first */
    uint64_t bytes;       /* of images that are done */
    bool ends;
    uint32_t thread_count;
    pthread_t threads[MAX_THREADS];
};

/* ---- jobs ---- */

static bool text_equals(const char *a, const char *b) {
    return a == b || (a && b && strcmp(a, b) == 0);
}

static bool desc_equals(const trc_image_desc *a, const trc_image_desc *b) {
    return a->alpha_mode == b->alpha_mode && a->is_alpha_literal == b->is_alpha_literal &&
           a->is_srgb == b->is_srgb && a->max_side == b->max_side &&
           a->is_mip_mapped == b->is_mip_mapped && text_equals(a->path, b->path) &&
           text_equals(a->color_space, b->color_space) &&
           text_equals(a->color_config, b->color_config);
}

static struct job *job_create(const trc_image_desc *desc) {
    const char *const texts[] = {desc->path, desc->color_config, desc->color_space};
    size_t bytes = 0;
    for (size_t i = 0; i < 3; i++)
        bytes += texts[i] ? strlen(texts[i]) + 1 : 0;
    struct job *job = trc_alloc_zeroed(1, sizeof *job + bytes);
    if (!job)
        return NULL;
    job->desc = *desc;
    const char **const copies[] = {&job->desc.path, &job->desc.color_config,
                                   &job->desc.color_space};
    char *to = (char *)(job + 1);
    for (size_t i = 0; i < 3; i++) {
        if (!texts[i])
            continue;
        *copies[i] = to;
        to = memcpy(to, texts[i], strlen(texts[i]) + 1);
        to += strlen(texts[i]) + 1;
    }
    return job;
}

static void job_destroy(struct job *job) {
    trc_image_release(job->image);
    trc_free(job);
}

/* The link to the job of a descriptor, or the last link. Under the lock. */
static struct job **find(struct trc_prefetch *prefetch, const trc_image_desc *desc) {
    struct job **link = &prefetch->jobs;
    while (*link && !desc_equals(&(*link)->desc, desc))
        link = &(*link)->next;
    return link;
}

/* ---- threads ---- */

/* The next job to do, or NULL at the end. Under the lock. */
static struct job *await_job(struct trc_prefetch *prefetch) {
    while (!prefetch->ends) {
        struct job *job = prefetch->bytes < prefetch->bytes_max ? prefetch->jobs : NULL;
        while (job && job->state != JOB_WAITS)
            job = job->next;
        if (job)
            return job;
        pthread_cond_wait(&prefetch->wake, &prefetch->lock);
    }
    return NULL;
}

static void work(void *context) {
    struct trc_prefetch *prefetch = context;
    const struct trc_image_source source = {.reader = prefetch->reader,
                                            .cancel = &prefetch->cancel};
    pthread_mutex_lock(&prefetch->lock);
    for (struct job *job; (job = await_job(prefetch));) {
        job->state = JOB_RUNS;
        pthread_mutex_unlock(&prefetch->lock);
        job->status = trc_image_load(&job->desc, &source, &job->image);
        if (job->status != TRC_OK)
            strncpy(job->message, trc_last_message(), sizeof job->message - 1);
        pthread_mutex_lock(&prefetch->lock);
        job->state = JOB_DONE;
        prefetch->bytes += trc_image_bytes(job->image);
        pthread_cond_broadcast(&prefetch->done);
    }
    pthread_mutex_unlock(&prefetch->lock);
}

/* Another thread where there are more jobs than threads. Under the lock. */
static void add_thread(struct trc_prefetch *prefetch) {
    uint32_t waiting = 0, limit = trc_thread_processor_count();
    for (const struct job *job = prefetch->jobs; job; job = job->next)
        waiting += job->state != JOB_DONE;
    if (limit > MAX_THREADS)
        limit = MAX_THREADS;
    if (prefetch->thread_count < limit && prefetch->thread_count < waiting &&
        trc_thread_start(&prefetch->threads[prefetch->thread_count], work, prefetch) == TRC_OK)
        prefetch->thread_count++;
}

/* ---- interface ---- */

trc_status trc_prefetch_create(struct trc_image_reader *reader, uint64_t bytes_max,
                               struct trc_prefetch **prefetch_out) {
    struct trc_prefetch *prefetch = trc_alloc_zeroed(1, sizeof *prefetch);
    if (!prefetch)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to read images ahead");
    prefetch->reader = reader;
    prefetch->bytes_max = bytes_max && bytes_max < MAX_BYTES ? bytes_max : MAX_BYTES;
    atomic_init(&prefetch->cancel, 0);
    /* Their initialisers take nothing that could be missing. */
    pthread_mutex_init(&prefetch->lock, NULL);
    pthread_cond_init(&prefetch->wake, NULL);
    pthread_cond_init(&prefetch->done, NULL);
    *prefetch_out = prefetch;
    return TRC_OK;
}

void trc_prefetch_destroy(struct trc_prefetch *prefetch) {
    if (!prefetch)
        return;
    atomic_store(&prefetch->cancel, 1);
    pthread_mutex_lock(&prefetch->lock);
    prefetch->ends = true;
    pthread_cond_broadcast(&prefetch->wake);
    pthread_mutex_unlock(&prefetch->lock);
    for (uint32_t i = 0; i < prefetch->thread_count; i++)
        pthread_join(prefetch->threads[i], NULL);
    while (prefetch->jobs) {
        struct job *job = prefetch->jobs;
        prefetch->jobs = job->next;
        job_destroy(job);
    }
    pthread_cond_destroy(&prefetch->done);
    pthread_cond_destroy(&prefetch->wake);
    pthread_mutex_destroy(&prefetch->lock);
    trc_free(prefetch);
}

void trc_prefetch_add(struct trc_prefetch *prefetch, const trc_image_desc *desc) {
    pthread_mutex_lock(&prefetch->lock);
    struct job **link = find(prefetch, desc);
    if (!*link && (*link = job_create(desc))) {
        add_thread(prefetch);
        pthread_cond_signal(&prefetch->wake);
    }
    pthread_mutex_unlock(&prefetch->lock);
}

bool trc_prefetch_take(struct trc_prefetch *prefetch, const trc_image_desc *desc,
                       trc_status *status_out, struct trc_image **image_out) {
    pthread_mutex_lock(&prefetch->lock);
    struct job *job = *find(prefetch, desc);
    while (job && job->state == JOB_RUNS)
        pthread_cond_wait(&prefetch->done, &prefetch->lock);
    if (job) {
        struct job **link = find(prefetch, desc);
        *link = job->next;
        prefetch->bytes -= trc_image_bytes(job->image);
        pthread_cond_signal(&prefetch->wake);
    }
    pthread_mutex_unlock(&prefetch->lock);
    if (!job)
        return false;
    /* With less under way there may be memory now. */
    const bool is_done = job->state == JOB_DONE && job->status != TRC_ERROR_OUT_OF_MEMORY;
    if (is_done && job->status == TRC_OK) {
        *image_out = job->image;
        job->image = NULL;
    }
    if (is_done)
        *status_out = job->status == TRC_OK ? TRC_OK : trc_fail(job->status, "%s", job->message);
    job_destroy(job);
    return is_done;
}
