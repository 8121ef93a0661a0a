/* POSIX and Linux: see system.h. */
#define _GNU_SOURCE
#include "core/system.h"

#include <inttypes.h>
#include <math.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "core/core.h"

/* ---- threads ---- */

bool trc_system_start_thread(pthread_t *thread_out, size_t stack_bytes, void *(*body)(void *),
                             void *argument) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes))
        return false;
    pthread_attr_setstacksize(&attributes, stack_bytes);
    /* The new thread inherits the mask: no signal of the host is ever handled in it. */
    sigset_t all, former;
    sigfillset(&all);
    int error = pthread_sigmask(SIG_SETMASK, &all, &former);
    if (!error) {
        error = pthread_create(thread_out, &attributes, body, argument);
        pthread_sigmask(SIG_SETMASK, &former, NULL);
    }
    pthread_attr_destroy(&attributes);
    return !error;
}

uint32_t trc_system_processor_count(void) {
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
    return count > 0 ? (uint32_t)count : 0;
}

bool trc_system_create_condition(pthread_cond_t *condition) {
    pthread_condattr_t monotonic;
    if (pthread_condattr_init(&monotonic))
        return false;
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    const int error = pthread_cond_init(condition, &monotonic);
    pthread_condattr_destroy(&monotonic);
    return !error;
}

bool trc_system_wait(pthread_cond_t *condition, pthread_mutex_t *lock, double deadline) {
    if (trc_seconds() >= deadline)
        return false;
    const double whole = floor(deadline);
    const struct timespec time = {(time_t)whole, (long)((deadline - whole) * 1e9)};
    pthread_cond_timedwait(condition, lock, &time);
    return true;
}

/* ---- memory ---- */

void trc_system_want_large_pages(void *block, size_t bytes) {
#ifdef MADV_HUGEPAGE
    madvise(block, bytes, MADV_HUGEPAGE);
#else
    (void)block;
    (void)bytes;
#endif
}

static uint64_t smaller(uint64_t a, uint64_t b) { return a < b ? a : b; }

static uint64_t physical_bytes(void) {
    const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGESIZE);
    if (pages <= 0 || page_bytes <= 0)
        return TRC_SYSTEM_NO_LIMIT;
    return (uint64_t)pages * (uint64_t)page_bytes;
}

#if defined(__linux__)
/* The first number of a file; no limit where there is none ("max"). */
static uint64_t number_in(const char *path) {
    FILE *file = fopen(path, "re");
    uint64_t number = TRC_SYSTEM_NO_LIMIT;
    if (!file)
        return TRC_SYSTEM_NO_LIMIT;
    if (fscanf(file, "%" SCNu64, &number) != 1)
        number = TRC_SYSTEM_NO_LIMIT;
    fclose(file);
    return number;
}

/* The smallest limit of a control group and those around it. folder: of the group, cut on the way
 * up to the root, of root_length characters. */
static uint64_t group_limit(char *folder, size_t root_length, const char *name) {
    uint64_t limit = TRC_SYSTEM_NO_LIMIT;
    for (;;) {
        char path[4096];
        const int length = snprintf(path, sizeof path, "%s/%s", folder, name);
        if (length > 0 && (size_t)length < sizeof path)
            limit = smaller(limit, number_in(path));
        char *slash = strrchr(folder, '/');
        if (!slash || (size_t)(slash - folder) < root_length)
            return limit;
        *slash = '\0';
    }
}

/* Of both versions of control groups: lines of this file are "number:controllers:path". */
static uint64_t container_bytes(void) {
    static const struct {
        const char *controllers, *root, *name;
    } versions[] = {{"", "/sys/fs/cgroup", "memory.max"},
                    {"memory", "/sys/fs/cgroup/memory", "memory.limit_in_bytes"}};
    FILE *file = fopen("/proc/self/cgroup", "re");
    uint64_t limit = TRC_SYSTEM_NO_LIMIT;
    char line[2048], folder[4096];
    while (file && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\n")] = '\0';
        char *controllers = strchr(line, ':'), *path = NULL;
        if (controllers)
            path = strchr(++controllers, ':');
        if (!path)
            continue;
        *path++ = '\0';
        for (size_t i = 0; i < sizeof versions / sizeof *versions; i++) {
            if (strcmp(controllers, versions[i].controllers) != 0)
                continue;
            (void)snprintf(folder, sizeof folder, "%s%s", versions[i].root, path);
            limit = smaller(limit, group_limit(folder, strlen(versions[i].root), versions[i].name));
        }
    }
    if (file)
        fclose(file);
    return limit;
}

uint64_t trc_system_address_space_left(void) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return TRC_SYSTEM_NO_LIMIT;
    const uint64_t pages = number_in("/proc/self/statm"); /* mapped */
    const long page_bytes = sysconf(_SC_PAGESIZE);
    if (pages == TRC_SYSTEM_NO_LIMIT || page_bytes <= 0)
        return TRC_SYSTEM_NO_LIMIT;
    const uint64_t used = pages * (uint64_t)page_bytes;
    return limit.rlim_cur > used ? limit.rlim_cur - used : 0;
}
#else
static uint64_t container_bytes(void) { return TRC_SYSTEM_NO_LIMIT; }
uint64_t trc_system_address_space_left(void) { return TRC_SYSTEM_NO_LIMIT; }
#endif

uint64_t trc_system_memory_bytes(void) { return smaller(physical_bytes(), container_bytes()); }
