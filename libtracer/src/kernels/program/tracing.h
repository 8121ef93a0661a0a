/* Operations that trace rays: apart from others, so that programs without them stay small and
 * quick. They find something only where a surface is shaded; for shadow rays, samples of lights and
 * displacement nothing is near, as in Cycles. */
#ifndef TRACER_KERNELS_PROGRAM_TRACING_H
#define TRACER_KERNELS_PROGRAM_TRACING_H

#include "kernels/trace/packet.h"
#include "kernels/trace/surface.h"

/* Which numbers an operation asks for. */
enum trc_probe_use { TRC_PROBE_AMBIENT, TRC_PROBE_BEVEL, TRC_PROBE_USES };

/* What a program traces rays with while the lanes of a surface are shaded. */
struct trc_probe {
    /* Two numbers of each lane in [0, 1), the sample-th of count. */
    void (*numbers)(const struct trc_probe *probe, enum trc_probe_use use, uint32_t sample,
                    uint32_t count, vfloat u[2]);
    struct trc_packet *packet; /* room for one */
    struct trc_packet_hits *hits;
    struct trc_left_strands *left; /* room for those of the packet; NULL: there are no curves */
    uint64_t *ray_count;           /* what is traced is added to it */
    vfloat min_pdf;                /* smallest density of a bounce so far */
};

/* What rays of RAYCAST's inputs meet: false if nothing, else the surface, active where there is
 * one. */
bool trc_program_cast(const struct trc_surface *s, uint32_t mode, const vfloat *in,
                      struct trc_surface *hit);

/* Runs one of them; inputs and outputs do not overlap. */
void trc_program_trace(const struct trc_surface *s, uint32_t op, uint32_t mode, const vfloat *in,
                       vfloat *out);

#endif
