/* Which rays of a walk are live.
 *
 * A walk takes one packet, or up to four of a bundle: the source of the walk is compiled for either
 * (kernels/trace/walk.h), since a loop over one packet is none. */
#ifndef TRACER_KERNELS_TRACE_LIVE_H
#define TRACER_KERNELS_TRACE_LIVE_H

#include "kernels/trace/packet.h"

#define TRC_WALK_CHUNKS (TRC_WALK_PACKETS * TRC_PACKET_CHUNKS)

/* A bit for each ray of each packet. Packets that a bundle lacks have none. */
struct trc_live {
    uint64_t of[TRC_WALK_PACKETS];
};

TRC_INLINE bool trc_live_any(const struct trc_live *live) {
    uint64_t some = 0;
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        some |= live->of[k];
    return some != 0;
}

TRC_INLINE int trc_live_count(const struct trc_live *live) {
    int count = 0;
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        count += __builtin_popcountll(live->of[k]);
    return count;
}

/* The first packet that has live rays; the last if none has. */
TRC_INLINE int trc_live_first(const struct trc_live *live) {
    int k = 0;
    while (k < TRC_WALK_PACKETS - 1 && !live->of[k])
        k++;
    return k;
}

/* The bits of chunk c of all chunks of the walk. */
TRC_INLINE uint32_t trc_live_bits(const struct trc_live *live, int c) {
    return trc_chunk_bits(live->of[c / TRC_PACKET_CHUNKS], c % TRC_PACKET_CHUNKS);
}

#endif
