/* Kernels of trc_query_*. Arguments are valid; arrays are the caller's. */
#ifndef TRACER_KERNELS_TRACE_QUERY_H
#define TRACER_KERNELS_TRACE_QUERY_H

#include "kernels/simd/simd.h"
#include "model/snapshot.h"

void trc_query_closest_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                            const trc_hits *hits, uint64_t begin, uint64_t end,
                            uint32_t packet_size, const uint32_t *order);
void trc_query_occluded_rays(const struct trc_snapshot *snapshot, const trc_rays *rays,
                             uint8_t *occluded, uint64_t begin, uint64_t end, uint32_t packet_size,
                             const uint32_t *order);

/* Geometric normal in world space by winding, not normalised. */
void trc_query_normal(const struct trc_snapshot *snapshot, uint32_t instance, uint32_t triangle,
                      float time, float normal[3]);

#endif
