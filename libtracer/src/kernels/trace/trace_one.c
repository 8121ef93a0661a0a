/* Tracing of packets whose rays meet one instance each. */
#define TRC_WALK_PACKETS 1
#define TRC_WALK_ONE_INSTANCE 1
#include "kernels/trace/walk.h"

void trc_trace_one_instance(const struct trc_snapshot *snapshot, struct trc_packet *packet,
                            struct trc_packet_hits *hits,
                            const uint32_t instance[TRC_PACKET_SIZE]) {
    walk_run(snapshot, packet, hits, instance, 1, false);
}
