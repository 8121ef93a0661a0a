/* Leaves of curves: pieces against the rays of packets, and against one ray. */
#ifndef TRACER_KERNELS_TRACE_WALK_CURVES_H
#define TRACER_KERNELS_TRACE_WALK_CURVES_H

#include "kernels/trace/curve.h"
#include "kernels/trace/walk_leaf.h"

/* ---- packets ---- */

TRC_INLINE struct trc_curve_ray_lanes curve_rays(const struct walk *w, int k, int i) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_turned *r = &w->turned[k];
    const struct trc_shear axis = w->group->beam.axis;
    return (struct trc_curve_ray_lanes){
        .ou = vf_load(&p->o[axis.u][i]),
        .ov = vf_load(&p->o[axis.v][i]),
        .oz = vf_load(&p->o[axis.z][i]),
        .su = vf_load(&g->su[i]),
        .sv = vf_load(&g->sv[i]),
        .xx = vf_load(&r->xx[i]),
        .xy = vf_load(&r->xy[i]),
        .yy = vf_load(&r->yy[i]),
        .zx = vf_load(&r->zx[i]),
        .zy = vf_load(&r->zy[i]),
        .zz = vf_load(&r->zz[i]),
        .per_length = vf_load(&r->per_length[i]),
        .tmin = vf_max(vf_load(&p->tmin[i]), vf_set(0.0f)),
        .side = vf_set(w->group->beam.sign),
    };
}

/* A float of a leaf of count pieces, between two keys where it moves. */
TRC_INLINE vfloat piece_lanes_at(const float *v, uint32_t count, uint32_t at, bool motion,
                                 vfloat f) {
    const vfloat a = vf_set(v[at * count]);
    return motion ? a + f * (vf_set(v[(TRC_TRIANGLE_FLOATS + at) * count]) - a) : a;
}

/* Broadcasts the piece of v's first slot, or interpolates it for each ray of chunk i of packet k.
 */
TRC_INLINE void piece_lanes_load(const struct walk *w, const float *v, uint32_t count, bool motion,
                                 int k, int i, struct trc_piece_lanes *out) {
    const uint32_t order[3] = {(uint32_t)w->group->beam.axis.u, (uint32_t)w->group->beam.axis.v,
                               (uint32_t)w->group->beam.axis.z};
    const vfloat f = motion ? vf_load(&w->group->of[k].f[i]) : vf_set(0.0f);
    for (uint32_t end = 0; end < 2; end++) {
        for (int axis = 0; axis < 3; axis++)
            out->p[end][axis] =
                piece_lanes_at(v, count, end * TRC_PIECE_END + order[axis], motion, f);
        out->r[end] = piece_lanes_at(v, count, end * TRC_PIECE_END + TRC_PIECE_RADIUS, motion, f);
    }
    const uint32_t flags = (uint32_t)v[TRC_PIECE_FLAGS * count];
    out->low = vf_set(flags & TRC_PIECE_FIRST ? 0.0f : -INFINITY);
    out->high = vf_set(flags & TRC_PIECE_LAST ? 1.0f : INFINITY);
}

/* Widens boxes by the pieces' as they are at a fraction between two keys. */
TRC_INLINE void piece_boxes_grow(const float *v, uint32_t count, bool motion, float fraction,
                                 f8 lower[3], f8 upper[3]) {
    const float *e = v + TRC_TRIANGLE_FLOATS * count;
    const f8 f = f8_set(fraction);
    for (uint32_t end = 0; end < 2; end++) {
        const uint32_t first = end * TRC_PIECE_END;
        f8 x[TRC_PIECE_END];
        for (uint32_t i = 0; i < TRC_PIECE_END; i++) {
            x[i] = f8_load(v + (first + i) * count);
            if (motion)
                x[i] = x[i] + f * (f8_load(e + (first + i) * count) - x[i]);
        }
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = f8_min(lower[axis], x[axis] - x[TRC_PIECE_RADIUS]);
            upper[axis] = f8_max(upper[axis], x[axis] + x[TRC_PIECE_RADIUS]);
        }
    }
}

/* Bits of the pieces that the beam may touch. */
TRC_INLINE uint32_t piece_candidates(const struct walk *w, const float *v, uint32_t count,
                                     bool motion) {
    f8 lower[3], upper[3], key;
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f8_set(INFINITY);
        upper[axis] = f8_set(-INFINITY);
    }
    piece_boxes_grow(v, count, motion, w->group->f_min, lower, upper);
    if (motion)
        piece_boxes_grow(v, count, motion, w->group->f_max, lower, upper);
    return trc_beam_test(&w->group->beam, lower, upper, &key) & ((1u << count) - 1u);
}

TRC_INLINE struct trc_curve_hit_lanes curve_test_lanes(uint32_t shape,
                                                       const struct trc_curve_ray_lanes *rays,
                                                       const struct trc_piece_lanes *piece) {
    return shape == TRC_SHAPE_RIBBONS ? trc_ribbon_test_lanes(rays, piece)
           : shape == TRC_SHAPE_ROUND ? trc_round_test_lanes(rays, piece)
                                      : trc_ball_test_lanes(rays, piece);
}

/* Tests the piece in a slot against the rays of packet k in mask; those that it hits or, of closest
 * hits, whose hit it became. */
TRC_INLINE uint64_t piece_packet(struct walk *w, const float *v, uint32_t count,
                                 const struct trc_slot *slot, int k, uint64_t mask, bool any,
                                 bool motion) {
    const struct trc_packet *p = &w->packets[k];
    uint64_t found = 0;
    struct trc_piece_lanes piece;
    if (!motion)
        piece_lanes_load(w, v, count, false, 0, 0, &piece);
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        const uint32_t bits = trc_chunk_bits(mask, c);
        if (!bits)
            continue;
        const int i = c * TRC_WIDTH;
        if (motion)
            piece_lanes_load(w, v, count, true, k, i, &piece);
        const struct trc_curve_ray_lanes rays = curve_rays(w, k, i);
        TRC_COUNT(triangle_rays, __builtin_popcount(bits));
        const struct trc_curve_hit_lanes h = curve_test_lanes(w->tree->shape, &rays, &piece);
        vmask hit = vm_and(vm_from_bits(bits), h.hit);
        if (!vm_any(hit))
            continue;
        if (any) {
            hit = vm_and(hit,
                         vm_and(vf_gt(h.t, vf_load(&p->tmin[i])), vf_lt(h.t, vf_load(&p->t[i]))));
            found |= (uint64_t)vm_bits(hit) << i;
        } else {
            found |= (uint64_t)hits_keep(w, k, i, hit, h.t, h.u, h.v, slot) << i;
        }
    }
    return found;
}

/* Tests a leaf's pieces; true if any ray found a (nearer) hit. */
TRC_INLINE bool curve_leaf_packet(struct walk *w, uint32_t ref, struct trc_live mask, bool any,
                                  bool motion) {
    const float *v = trc_leaf_vertices(w->tree, ref, w->key);
    const uint32_t count = trc_leaf_count(ref);
    const struct trc_slot *ids = trc_leaf_slots(w->tree, ref);
    uint64_t found = 0;
    for (uint32_t slots = piece_candidates(w, v, count, motion); slots; slots &= slots - 1) {
        const int slot = __builtin_ctz(slots);
        if (any && w->packets->skip_transparent && (ids[slot].instance & TRC_SLOT_TRANSPARENT))
            continue;
        for (int k = 0; k < TRC_WALK_PACKETS; k++) {
            if (!mask.of[k])
                continue;
            const uint64_t hit =
                piece_packet(w, v + slot, count, &ids[slot], k, mask.of[k], any, motion);
            found |= hit;
            if (any) {
                w->occluded.of[k] |= hit;
                mask.of[k] &= ~hit;
            }
        }
    }
    return found != 0;
}

/* ---- one ray ---- */

TRC_INLINE struct trc_curve_ray8 curve_ray(const struct walk *w, int k, int ray) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_turned *r = &w->turned[k];
    const struct trc_shear axis = w->group->beam.axis;
    return (struct trc_curve_ray8){
        .ou = f8_set(p->o[axis.u][ray]),
        .ov = f8_set(p->o[axis.v][ray]),
        .oz = f8_set(p->o[axis.z][ray]),
        .su = f8_set(g->su[ray]),
        .sv = f8_set(g->sv[ray]),
        .xx = f8_set(r->xx[ray]),
        .xy = f8_set(r->xy[ray]),
        .yy = f8_set(r->yy[ray]),
        .zx = f8_set(r->zx[ray]),
        .zy = f8_set(r->zy[ray]),
        .zz = f8_set(r->zz[ray]),
        .per_length = f8_set(r->per_length[ray]),
        .tmin = f8_set(f_max(p->tmin[ray], 0.0f)),
        .side = f8_set(w->group->beam.sign),
    };
}

TRC_INLINE void pieces8_load(const struct walk *w, const float *v, uint32_t count, bool motion,
                             float fraction, struct trc_piece8 *out) {
    const uint32_t order[3] = {(uint32_t)w->group->beam.axis.u, (uint32_t)w->group->beam.axis.v,
                               (uint32_t)w->group->beam.axis.z};
    const float *e = v + TRC_TRIANGLE_FLOATS * count;
    const f8 f = f8_set(fraction);
    for (uint32_t end = 0; end < 2; end++)
        for (int i = 0; i < TRC_PIECE_END; i++) {
            const bool is_radius = i == TRC_PIECE_RADIUS;
            const uint32_t at =
                (end * TRC_PIECE_END + (is_radius ? TRC_PIECE_RADIUS : order[i])) * count;
            f8 x = f8_load(v + at);
            if (motion)
                x = x + f * (f8_load(e + at) - x);
            if (is_radius)
                out->r[end] = x;
            else
                out->p[end][i] = x;
        }
    /* 0 to 3: TRC_PIECE_*. */
    const f8 flags = f8_load(v + TRC_PIECE_FLAGS * count), last = f8_set(TRC_PIECE_LAST);
    const f8 rest = f8_select_le(last, flags, flags - last, flags);
    out->low = f8_select_le(f8_set(TRC_PIECE_FIRST), rest, f8_set(0.0f), f8_set(-INFINITY));
    out->high = f8_select_le(last, flags, f8_set(1.0f), f8_set(INFINITY));
}

/* One ray's tests against a leaf. True: occluded (any only). */
TRC_INLINE bool curve_leaf_single(struct walk *w, uint32_t ref, int k, int ray, bool any,
                                  bool motion) {
    const uint32_t count = trc_leaf_count(ref), shape = w->tree->shape;
    struct trc_piece8 pieces;
    pieces8_load(w, trc_leaf_vertices(w->tree, ref, w->key), count, motion,
                 motion ? w->group->of[k].f[ray] : 0.0f, &pieces);
    const struct trc_curve_ray8 r = curve_ray(w, k, ray);
    TRC_COUNT(single_leaves, 1);
    TRC_COUNT(single_triangles, count);
    const struct trc_curve_hit8 h = shape == TRC_SHAPE_RIBBONS ? trc_ribbon_test8(&r, &pieces)
                                    : shape == TRC_SHAPE_ROUND ? trc_round_test8(&r, &pieces)
                                                               : trc_ball_test8(&r, &pieces);
    return ray_keep(w, trc_leaf_slots(w->tree, ref), k, ray, h.hit & ((1u << count) - 1u), h.t, h.u,
                    h.v, any);
}

#endif
