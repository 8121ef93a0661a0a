/* A packet: up to 64 general rays side by side, with no constraint on origins or directions.
 *
 * Boulos et al. 2007, section 3.1. Rays of a packet may differ in everything but visibility. What
 * traversal derives from them (kernels/trace/beam.h) is kept apart. */
#ifndef TRACER_KERNELS_TRACE_PACKET_H
#define TRACER_KERNELS_TRACE_PACKET_H

#include "kernels/simd/simd.h"

#define TRC_PACKET_SIZE 64
#define TRC_PACKET_CHUNKS (TRC_PACKET_SIZE / TRC_WIDTH)

/* The strands that rays have left, and meet no more, as in Cycles; of balls their numbers. */
struct trc_left_strands {
    uint32_t instance[TRC_PACKET_SIZE]; /* TRC_NO_HIT: none */
    uint32_t strand[TRC_PACKET_SIZE];
} __attribute__((aligned(64)));

/* Directions need not be unit, but their largest component must be in [2^-60, 2^60]; distances are
 * in units of the direction. Lanes out of the active mask may hold anything. */
struct trc_packet {
    float o[3][TRC_PACKET_SIZE];
    float d[3][TRC_PACKET_SIZE];
    float tmin[TRC_PACKET_SIZE];
    float t[TRC_PACKET_SIZE];    /* in: farthest distance; out: distance of the hit */
    float time[TRC_PACKET_SIZE]; /* [0, 1]; read only in scenes with object motion */
    uint64_t active;
    const struct trc_left_strands *left; /* NULL: none; read only where there are curves */
    uint32_t visibility;                 /* TRC_VISIBLE_* */
    bool common_origin;                  /* all active rays start at the same point */
    bool skip_transparent; /* occlusion: materials that shadow rays see through do not count */
} __attribute__((aligned(64)));

/* Added to the v of hits of round curves and balls that are met from within; of TRC_SHAPE_BALLS
 * that the ray has come into since its origin once more. */
#define TRC_CURVE_WITHIN 4.0f

/* Written where a ray hits; instance must be TRC_NO_HIT before. u and v as in tracer/query.h. */
struct trc_packet_hits {
    uint32_t instance[TRC_PACKET_SIZE];
    uint32_t triangle[TRC_PACKET_SIZE];
    float u[TRC_PACKET_SIZE], v[TRC_PACKET_SIZE];
} __attribute__((aligned(64)));

/* The bits of chunk c. */
TRC_INLINE uint32_t trc_chunk_bits(uint64_t mask, int c) {
#if TRC_WIDTH == 64
    return (uint32_t)mask;
#else
    return (uint32_t)(mask >> (c * TRC_WIDTH)) & TRC_LANE_BITS;
#endif
}

/* Packets of a bundle at most. */
#define TRC_BUNDLE 4

/* Maximum of rays of a stream, and live rays at or below which packets end in one
 * (kernels/trace/walk_stream.h): lanes that are half empty cost more than streams. */
#define TRC_STREAM_SIZE 32
#define TRC_STREAM_ANY TRC_STREAM_SIZE
#define TRC_STREAM_CLOSEST (TRC_WIDTH < 16 ? TRC_STREAM_SIZE : 24)

struct trc_bvh;
struct trc_snapshot;

/* A bundle: 1 to TRC_BUNDLE packets that go through the tree together, so that nodes and leaves
 * are met once. They agree in all but their rays; common_origin is of the rays of all. Where
 * packets part ways, a bundle costs more than each alone. */

/* Nearest hit of each active ray in (tmin, t]; among equal distances the lowest (instance,
 * triangle). */
void trc_trace_closest(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                       struct trc_packet_hits *hits, uint32_t packet_count);

/* The same of one packet whose rays may have a tmin below 0, but meet nothing at or before 0 of the
 * instances that they left. (kernels/trace/trace_back.c) */
void trc_trace_looking_back(const struct trc_snapshot *snapshot, struct trc_packet *packet,
                            struct trc_packet_hits *hits, const uint32_t left[TRC_PACKET_SIZE]);

/* The same of one packet whose rays meet nothing but the instance of that number, whatever lies in
 * the same place. (kernels/trace/trace_one.c) */
void trc_trace_one_instance(const struct trc_snapshot *snapshot, struct trc_packet *packet,
                            struct trc_packet_hits *hits, const uint32_t instance[TRC_PACKET_SIZE]);

/* Active rays with anything in (tmin, t): a mask for each packet. t is left as it was. */
void trc_trace_occluded(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                        uint32_t packet_count, uint64_t *occluded);

#endif
