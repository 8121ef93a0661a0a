/* The triangles of a leaf as seen from the common origin of a packet: edge normals, so that an edge
 * function is one dot product with a direction (du/dz, dv/dz, 1).
 *
 * It only rejects: lanes that may hit take the full test, so hits stay the same bits. The normal of
 * the edge from a to b is (b - a) x (a + b), vertices relative to the origin, which keeps its
 * precision far away (products of vertices do not).
 *
 * Error: each difference and sum half an ulp, products and sums of the normal and of the dot
 * product together below 10 half-ulps of |b - a| (|a| + |b|), 1-norms; the full test's own movement
 * of vertices below 8 more. TRC_EDGE_MARGIN is 33 half-ulps.
 *
 * Trees at rest only: normals that are interpolated with the triangle reject as well (5.8 tests a
 * ray become 3.4) but cost more than the tests. */
#ifndef TRACER_KERNELS_TRACE_EDGE_FILTER_H
#define TRACER_KERNELS_TRACE_EDGE_FILTER_H

#include "kernels/trace/beam.h"

struct trc_edge_filter {
    f8 n[3][3]; /* edge opposite to the vertex, axis u, v, z */
    f8 margin;  /* largest of the three edges */
};
#define TRC_EDGE_MARGIN 2e-6f
/* Products of lengths must neither overflow nor vanish; slack is in proportion to lengths. */
#define TRC_FILTER_MIN_SLACK 1e-18f
#define TRC_FILTER_MAX_SLACK 1e6f

TRC_INLINE bool trc_edge_filter_applies(const struct trc_packet *p, const struct trc_group *g) {
    return p->common_origin && g->beam.slack > TRC_FILTER_MIN_SLACK &&
           g->beam.slack < TRC_FILTER_MAX_SLACK;
}

/* Sets the filter up for the triangles [vertex][axis u, v, z] of a leaf. Bits of the candidates
 * that some ray may hit. */
TRC_INLINE uint32_t trc_edge_filter_setup(const struct trc_group *g, f8 v[3][3],
                                          uint32_t candidates, struct trc_edge_filter *e) {
    f8 a[3][3];
    for (int corner = 0; corner < 3; corner++)
        for (int axis = 0; axis < 3; axis++)
            a[corner][axis] = v[corner][axis] - f8_set(g->origin[axis]);
    f8 inside = f8_set(INFINITY), outside = f8_set(-INFINITY), margin = f8_set(0.0f);
    const f8 u0 = f8_set(g->su_min), u1 = f8_set(g->su_max), v0 = f8_set(g->sv_min),
             v1 = f8_set(g->sv_max);
    for (int k = 0; k < 3; k++) {
        const int from = (k + 1) % 3, to = (k + 2) % 3;
        f8 d[3], sum[3], length = f8_set(0.0f), reach = f8_set(0.0f);
        for (int axis = 0; axis < 3; axis++) {
            d[axis] = v[to][axis] - v[from][axis];
            sum[axis] = a[to][axis] + a[from][axis];
            length = length + f8_abs(d[axis]);
            reach = reach + (f8_abs(a[to][axis]) + f8_abs(a[from][axis]));
        }
        for (int axis = 0; axis < 3; axis++) {
            const int i = (axis + 1) % 3, j = (axis + 2) % 3;
            e->n[k][axis] = d[i] * sum[j] - d[j] * sum[i];
        }
        margin = f8_max(margin, length * reach);
        /* Over all directions of the packet. */
        const f8 x0 = e->n[k][0] * u0, x1 = e->n[k][0] * u1, y0 = e->n[k][1] * v0,
                 y1 = e->n[k][1] * v1;
        inside = f8_min(inside, f8_max(x0, x1) + f8_max(y0, y1) + e->n[k][2]);
        outside = f8_max(outside, f8_min(x0, x1) + f8_min(y0, y1) + e->n[k][2]);
    }
    /* Products may underflow. */
    e->margin = margin * f8_set(TRC_EDGE_MARGIN) + f8_set(TRC_TINY_EDGE);
    return candidates & (f8_le(-e->margin, inside) | f8_le(outside, e->margin));
}

/* Lanes of chunk i that may pass the triangle in slot. */
TRC_INLINE uint32_t trc_edge_filter_lanes(const struct trc_edge_filter *e,
                                          const struct trc_sheared *r, int slot, int i) {
    const vfloat su = vf_load(&r->su[i]), sv = vf_load(&r->sv[i]);
    vfloat value[3];
    for (int k = 0; k < 3; k++)
        value[k] = vf_madd(vf_set(e->n[k][0][slot]), su,
                           vf_madd(vf_set(e->n[k][1][slot]), sv, vf_set(e->n[k][2][slot])));
    const vfloat minimum = vf_min(value[0], vf_min(value[1], value[2]));
    const vfloat maximum = vf_max(value[0], vf_max(value[1], value[2]));
    const vfloat margin = vf_set(e->margin[slot]);
    return vm_bits(vm_or(vf_ge(minimum, -margin), vf_le(maximum, margin)));
}

#endif
