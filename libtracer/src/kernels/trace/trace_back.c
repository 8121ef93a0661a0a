/* Tracing of packets that look back: see kernels/trace/spawn.h. */
#define TRC_WALK_PACKETS 1
#define TRC_WALK_LOOKS_BACK 1
#include "kernels/trace/walk.h"

void trc_trace_looking_back(const struct trc_snapshot *snapshot, struct trc_packet *packet,
                            struct trc_packet_hits *hits, const uint32_t left[TRC_PACKET_SIZE]) {
    walk_run(snapshot, packet, hits, left, 1, false);
}
