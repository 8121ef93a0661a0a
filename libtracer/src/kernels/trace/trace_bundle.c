#include "kernels/trace/trace_bundle.h"

#include <string.h>

#define TRC_WALK_PACKETS TRC_BUNDLE
#include "kernels/trace/walk.h"

void trc_bundle_closest(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                        struct trc_packet_hits *hits, uint32_t packet_count) {
    walk_run(snapshot, packets, hits, NULL, packet_count, false);
}

void trc_bundle_occluded(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                         uint32_t packet_count, uint64_t *occluded) {
    const struct trc_live found = walk_run(snapshot, packets, NULL, NULL, packet_count, true);
    memcpy(occluded, found.of, packet_count * sizeof *occluded);
}
