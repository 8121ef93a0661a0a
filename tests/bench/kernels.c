#include "kernels.h"

#include <stddef.h>

#include "model/kernels.h"

#define DECLARE(isa)                                                                          \
    void trc_trace_closest_##isa(const struct trc_snapshot *, struct trc_packet *,            \
                                 struct trc_packet_hits *, uint32_t);                         \
    void trc_trace_occluded_##isa(const struct trc_snapshot *, struct trc_packet *, uint32_t, \
                                  uint64_t *);
#define ENTRY(isa) \
    { trc_trace_closest_##isa, trc_trace_occluded_##isa }

#if defined(__x86_64__)
DECLARE(sse42)
DECLARE(avx2)
DECLARE(avx512)
#elif defined(__aarch64__)
DECLARE(neon)
#endif

static const struct packet_kernels kernels[] = {
    [TRC_ISA_SCALAR] = ENTRY(scalar), /* declared by packet.h: the benchmark's own ISA */
#if defined(__x86_64__)
    [TRC_ISA_SSE42] = ENTRY(sse42),
    [TRC_ISA_AVX2] = ENTRY(avx2),
    [TRC_ISA_AVX512] = ENTRY(avx512),
#elif defined(__aarch64__)
    [TRC_ISA_NEON] = ENTRY(neon),
#endif
};

const struct packet_kernels *packet_kernels_get(uint32_t isa) {
    return trc_kernels_get(isa) ? &kernels[isa] : NULL;
}
