/* Tracing: packets on their own here, bundles in kernels/trace/trace_bundle.c. */
#define TRC_WALK_PACKETS 1
#include "kernels/trace/trace_bundle.h"
#include "kernels/trace/walk.h"

void trc_trace_closest(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                       struct trc_packet_hits *hits, uint32_t packet_count) {
    if (packet_count > 1)
        trc_bundle_closest(snapshot, packets, hits, packet_count);
    else
        walk_run(snapshot, packets, hits, NULL, packet_count, false);
}

void trc_trace_occluded(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                        uint32_t packet_count, uint64_t *occluded) {
    if (packet_count > 1)
        trc_bundle_occluded(snapshot, packets, packet_count, occluded);
    else
        occluded[0] = walk_run(snapshot, packets, NULL, NULL, packet_count, true).of[0];
}
