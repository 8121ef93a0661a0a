/* The packet kernels of every instruction set, as the renderer calls them. */
#ifndef TRACER_BENCH_KERNELS_H
#define TRACER_BENCH_KERNELS_H

#include <stdint.h>

#include "kernels/trace/packet.h"

struct packet_kernels {
    void (*closest)(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                    struct trc_packet_hits *hits, uint32_t packet_count);
    void (*occluded)(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                     uint32_t packet_count, uint64_t *occluded);
};

/* NULL where the build or the CPU lacks that instruction set. */
const struct packet_kernels *packet_kernels_get(uint32_t isa);

#endif
