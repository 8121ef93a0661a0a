/* How much memory there is: of the machine, of the containers the process is in, of its address
 * space. */
#define _GNU_SOURCE
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/core.h"

/* As good as no limit, and sums of two do not overflow. */
#define NO_LIMIT (UINT64_MAX / 2)

static uint64_t smaller(uint64_t a, uint64_t b) { return a < b ? a : b; }

static uint64_t physical_bytes(void) {
    const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGESIZE);
    if (pages <= 0 || page_bytes <= 0)
        return NO_LIMIT;
    return (uint64_t)pages * (uint64_t)page_bytes;
}

#if defined(__linux__)
/* The first number of a file; no limit where there is none ("max"). */
static uint64_t number_in(const char *path) {
    FILE *file = fopen(path, "re");
    uint64_t number = NO_LIMIT;
    if (!file)
        return NO_LIMIT;
    if (fscanf(file, "%" SCNu64, &number) != 1)
        number = NO_LIMIT;
    fclose(file);
    return number;
}

/* The smallest limit of a control group and those around it. folder: of the group, cut on the way
 * up to the root, of root_length characters. */
static uint64_t group_limit(char *folder, size_t root_length, const char *name) {
    uint64_t limit = NO_LIMIT;
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
    uint64_t limit = NO_LIMIT;
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

/* What a limit of address space leaves beside all that the process has mapped. */
static uint64_t address_space_left(void) {
    struct rlimit limit;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return NO_LIMIT;
    const uint64_t pages = number_in("/proc/self/statm"); /* mapped */
    const long page_bytes = sysconf(_SC_PAGESIZE);
    if (pages == NO_LIMIT || page_bytes <= 0)
        return NO_LIMIT;
    const uint64_t used = pages * (uint64_t)page_bytes;
    return limit.rlim_cur > used ? limit.rlim_cur - used : 0;
}
#else
static uint64_t container_bytes(void) { return NO_LIMIT; }
static uint64_t address_space_left(void) { return NO_LIMIT; }
#endif

uint64_t trc_memory_left_bytes(void) {
    const uint64_t used = trc_memory_bytes(), all = smaller(physical_bytes(), container_bytes());
    return smaller(all > used ? all - used : 0, address_space_left());
}
