/* Tracing of more than one packet: see trc_trace_closest and trc_trace_occluded. */
#ifndef TRACER_KERNELS_TRACE_TRACE_BUNDLE_H
#define TRACER_KERNELS_TRACE_TRACE_BUNDLE_H

#include "kernels/trace/packet.h"

void trc_bundle_closest(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                        struct trc_packet_hits *hits, uint32_t packet_count);
void trc_bundle_occluded(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                         uint32_t packet_count, uint64_t *occluded);

#endif
