#define _POSIX_C_SOURCE 200809L
#include <time.h>

#include "core/core.h"

double trc_seconds(void) {
    struct timespec now = {0};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}
