/* Windows: see system.h. Threads are those of winpthreads, which is linked to the library. */
#include "core/system.h"

#include <math.h>
#include <time.h>

#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include "core/core.h"

/* What a wait rounds up to: the system's clock ticks no finer. */
#define TICK_SECONDS 1e-3

static uint64_t smaller(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* ---- threads ---- */

bool trc_system_start_thread(pthread_t *thread_out, size_t stack_bytes, void *(*body)(void *),
                             void *argument) {
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes))
        return false;
    pthread_attr_setstacksize(&attributes, stack_bytes);
    const int error = pthread_create(thread_out, &attributes, body, argument);
    pthread_attr_destroy(&attributes);
    return !error;
}

/* Of all processor groups, unless the process was told to keep to some of its own group's. */
uint32_t trc_system_processor_count(void) {
    DWORD_PTR allowed, present;
    if (GetProcessAffinityMask(GetCurrentProcess(), &allowed, &present) && allowed != present)
        return (uint32_t)__builtin_popcountll(allowed);
    return GetActiveProcessorCount(ALL_PROCESSOR_GROUPS);
}

bool trc_system_create_condition(pthread_cond_t *condition) {
    return !pthread_cond_init(condition, NULL);
}

/* winpthreads has waits by the time of day alone: whoever sets that meanwhile has the wait end
 * early or late once, and only once, as it is made of short ones. */
bool trc_system_wait(pthread_cond_t *condition, pthread_mutex_t *lock, double deadline) {
    const double longest = 1.0, left = deadline - trc_seconds();
    if (left <= 0.0)
        return false;
    struct timespec time;
    clock_gettime(CLOCK_REALTIME, &time);
    const double until =
        (double)time.tv_nsec * 1e-9 + fmin(ceil(left / TICK_SECONDS) * TICK_SECONDS, longest);
    time.tv_sec += (time_t)floor(until);
    time.tv_nsec = (long)((until - floor(until)) * 1e9);
    pthread_cond_timedwait(condition, lock, &time);
    return true;
}

/* ---- memory ---- */

/* Of the machine, or what jobs, as containers are, let the process have. */
uint64_t trc_system_memory_bytes(void) {
    MEMORYSTATUSEX memory = {.dwLength = sizeof memory};
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION job = {0};
    uint64_t bytes = TRC_SYSTEM_NO_LIMIT;
    if (GlobalMemoryStatusEx(&memory))
        bytes = memory.ullTotalPhys;
    if (!QueryInformationJobObject(NULL, JobObjectExtendedLimitInformation, &job, sizeof job, NULL))
        return bytes;
    if (job.BasicLimitInformation.LimitFlags & JOB_OBJECT_LIMIT_PROCESS_MEMORY)
        bytes = smaller(bytes, job.ProcessMemoryLimit);
    if (job.BasicLimitInformation.LimitFlags & JOB_OBJECT_LIMIT_JOB_MEMORY)
        bytes = smaller(bytes, job.JobMemoryLimit);
    return bytes;
}

/* What can be committed: memory and page files, which all processes share. */
uint64_t trc_system_address_space_left(void) {
    MEMORYSTATUSEX memory = {.dwLength = sizeof memory};
    return GlobalMemoryStatusEx(&memory) ? memory.ullAvailPageFile : TRC_SYSTEM_NO_LIMIT;
}

/* They need a right that users do not have. */
void trc_system_want_large_pages(void *block, size_t bytes) {
    (void)block;
    (void)bytes;
}
