/* The packet kernels of one instruction set as a contestant. */
#ifndef TRACER_BENCH_VOLLEY_H
#define TRACER_BENCH_VOLLEY_H

#include "contestant.h"

struct volley {
    const struct trc_snapshot *snapshot;
    const struct packet_kernels *kernels;
};

/* The contestant refers to volley, which must live as long. */
struct contestant volley_contestant(const struct volley *volley);

#endif
