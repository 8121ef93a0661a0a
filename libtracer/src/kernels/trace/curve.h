/* Tests of rays against pieces of curves, for many rays against one piece and one ray against
 * eight.
 *
 * An end of a piece is moved to the ray's origin, turned so that x and y are across the ray and z
 * is along it, and rounded the same way whatever piece it belongs to: two pieces that share an end
 * meet in it without a gap. A ribbon is hit where its axis passes nearest, if that is within its
 * radius there. A round piece is the union of the balls along it (a cone between two balls): a ball
 * at s is entered at z(s) - sqrt(g(s)), g = r^2 - x^2 - y^2 along s a parabola, and the first of
 * all is either end's or where the derivative is 0. Both forms make the same operations in the same
 * order: the same bits. What a ray has left is no hit (struct trc_packet.left).
 *
 * S. Woop, C. Benthin, I. Wald, G. Johnson, E. Tabellion, "Exploiting Local Orientation Similarity
 * for Efficient Ray Traversal of Hair and Fur", 2014, turn splines to the ray as well, and cut them
 * there; here they are cut once, before the tree is built. */
#ifndef TRACER_KERNELS_TRACE_CURVE_H
#define TRACER_KERNELS_TRACE_CURVE_H

#include <float.h>

#include "kernels/simd/simd8.h"
#include "kernels/trace/beam.h"

/* What hits of a ribbon must be ahead of where a ray begins, in radii, as in Embree, whose
 * curve_self_intersection_avoidance_factor this is: ribbons turn with the ray. Of round ones: what
 * sqrt(g) is off by where a ray grazes them, 2^-12 of a radius, with room. */
#define TRC_RIBBON_AHEAD 2.0f
#define TRC_ROUND_AHEAD 0x1p-10f

/* Squares of lengths are taken for this, at least, where they divide. */
#define TRC_CURVE_TINY 1e-36f
/* How far beyond the line between two pieces of a ribbon both of them own hits, relative: many
 * times what rounding may move the line by. */
#define TRC_RIBBON_DOUBT 1e-5f
/* Two pieces of a round strand overlap by MARGIN * (OVERLAP + bend + taper) radii at their joint;
 * OVERLAP is what straight strands have for rounding. No limit where the square of the bend times
 * the radius is beyond BEND_SQUARED of that of the shorter piece: the planes of its two joints may
 * meet within the radius. */
#define TRC_ROUND_OVERLAP 0.05f
#define TRC_ROUND_MARGIN 2.0f
#define TRC_ROUND_BEND_SQUARED 0.25f

/* Turns of the rays of a packet, after their shear: across x' = xx x + xy y, y' = yy y, along
 * z' = zz z + zx x + zy y, all in lengths of object space, and 1 / |d|. */
struct trc_turned {
    float xx[TRC_PACKET_SIZE], xy[TRC_PACKET_SIZE], yy[TRC_PACKET_SIZE];
    float zx[TRC_PACKET_SIZE], zy[TRC_PACKET_SIZE], zz[TRC_PACKET_SIZE];
    float per_length[TRC_PACKET_SIZE];
} __attribute__((aligned(64)));

/* Of all chunks with live rays. */
TRC_INLINE void trc_turned_setup(const struct trc_sheared *g, uint64_t mask,
                                 struct trc_turned *out) {
    const vfloat one = vf_set(1.0f);
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        if (!trc_chunk_bits(mask, c))
            continue;
        const int i = c * TRC_WIDTH;
        const vfloat su = vf_load(&g->su[i]), sv = vf_load(&g->sv[i]), sz = vf_load(&g->sz[i]);
        const vfloat w = one + sv * sv, q = w + su * su;
        const vfloat root_w = vf_sqrt(w), root_q = vf_sqrt(q);
        const vfloat per_length = one / root_q, yy = one / root_w;
        const vfloat along = vf_copysign(per_length, sz);
        vf_store(&out->xx[i], root_w * per_length);
        vf_store(&out->xy[i], -(su * sv) * (per_length * yy));
        vf_store(&out->yy[i], yy);
        vf_store(&out->zx[i], su * along);
        vf_store(&out->zy[i], sv * along);
        vf_store(&out->zz[i], vf_copysign(root_q, sz));
        vf_store(&out->per_length[i], vf_abs(sz) * per_length);
    }
}

#define REAL vfloat
#define MASK vmask
#define SET vf_set
#define MINIMUM vf_min
#define MAXIMUM vf_max
#define ROOT vf_sqrt
#define LE vf_le
#define ANY vm_any
#define BOTH vm_and
#define SELECT_LE(a, b, x, y) vf_select(vf_le(a, b), x, y)
#define NAMED(name) name##_lanes
#include "kernels/trace/curve_test.h"

#define REAL f8
#define MASK uint32_t
#define SET f8_set
#define MINIMUM f8_min
#define MAXIMUM f8_max
#define ROOT f8_sqrt
#define LE f8_le
#define ANY(m) ((m) != 0)
#define BOTH(a, b) ((a) & (b))
#define SELECT_LE f8_select_le
#define NAMED(name) name##8
#include "kernels/trace/curve_test.h"

#endif
