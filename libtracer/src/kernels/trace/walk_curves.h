/* Leaves of curves: pieces against the rays of packets, and against one ray. */
#ifndef TRACER_KERNELS_TRACE_WALK_CURVES_H
#define TRACER_KERNELS_TRACE_WALK_CURVES_H

#include "core/box.h"
#include "kernels/trace/curve.h"
#include "kernels/trace/walk_leaf.h"

/* What tells a strand from others of its tree. */
TRC_INLINE uint32_t slot_strand(const struct walk *w, const struct trc_slot *slot) {
    return trc_shape_is_balls(w->tree->shape) ? slot->triangle
                                              : slot->instance & TRC_SLOT_STRAND_MASK;
}

/* Numbers of the vertices of a piece: its ends, the one before and the one after. */
struct piece_vertices {
    uint32_t end[2], before, after;
};
TRC_INLINE struct piece_vertices piece_vertices_of(const struct walk *w,
                                                   const struct trc_slot *slot) {
    if (trc_shape_is_balls(w->tree->shape))
        return (struct piece_vertices){
            {slot->triangle, slot->triangle}, slot->triangle, slot->triangle};
    const uint32_t first = slot->triangle + (slot->instance & TRC_SLOT_STRAND_MASK);
    return (struct piece_vertices){{first, first + 1},
                                   first - !(slot->instance & TRC_SLOT_FIRST),
                                   first + 1 + !(slot->instance & TRC_SLOT_LAST)};
}

/* A vertex of w's tree, at the first key of the segment or the next. */
TRC_INLINE const float *curve_vertex(const struct walk *w, uint32_t vertex, uint32_t next) {
    return w->tree->vertices +
           TRC_CURVE_VERTEX_FLOATS * ((size_t)(w->key + next) * w->tree->vertex_count + vertex);
}

/* ---- packets ---- */

TRC_INLINE struct trc_curve_ray_lanes curve_rays(const struct walk *w, int k, int i) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_turned *r = &w->turned[k];
    const struct trc_shear axis = w->group->beam.axis;
    const vfloat tmin = vf_max(vf_load(&p->tmin[i]), vf_set(0.0f));
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
        .tmin = tmin,
        .near = p->left ? vf_set(0.0f) : tmin,
        .side = vf_set(w->group->beam.sign),
    };
}

/* Broadcasts a vertex in the order u, v, z, or interpolates it for each ray by f. */
TRC_INLINE void vertex_lanes_load(const struct walk *w, uint32_t vertex, bool motion, vfloat f,
                                  vfloat p[3], vfloat *radius) {
    const struct trc_shear axis = w->group->beam.axis;
    const int order[TRC_CURVE_VERTEX_FLOATS] = {axis.u, axis.v, axis.z, 3};
    const float *a = curve_vertex(w, vertex, 0), *b = motion ? curve_vertex(w, vertex, 1) : a;
    for (int i = 0; i < TRC_CURVE_VERTEX_FLOATS; i++) {
        const vfloat x = vf_set(a[order[i]]);
        *(i < 3 ? &p[i] : radius) = motion ? x + f * (vf_set(b[order[i]]) - x) : x;
    }
}

/* Broadcasts the ends of a piece, or interpolates them for each ray of chunk i of packet k. */
TRC_INLINE void piece_lanes_load(const struct walk *w, const struct piece_vertices *v, bool motion,
                                 int k, int i, struct trc_piece_lanes *out) {
    const vfloat f = motion ? vf_load(&w->group->of[k].f[i]) : vf_set(0.0f);
    for (int end = 0; end < 2; end++)
        vertex_lanes_load(w, v->end[end], motion, f, out->p[end], &out->r[end]);
}

/* The same of its neighbours. */
TRC_INLINE void piece_lanes_join(const struct walk *w, const struct piece_vertices *v, bool motion,
                                 int k, int i, struct trc_piece_lanes *out) {
    const vfloat f = motion ? vf_load(&w->group->of[k].f[i]) : vf_set(0.0f);
    vertex_lanes_load(w, v->before, motion, f, out->before, &out->r_before);
    vertex_lanes_load(w, v->after, motion, f, out->after, &out->r_after);
}

/* A vertex of each slot, x, y, z and radius, at a key. */
TRC_INLINE void vertices8_load(const struct walk *w, const uint32_t vertex[8], uint32_t next,
                               f8 out[TRC_CURVE_VERTEX_FLOATS]) {
    f4 rows[8];
    for (int i = 0; i < 8; i++)
        rows[i] = f4_load4(curve_vertex(w, vertex[i], next));
    f4_transpose(rows);
    f4_transpose(rows + 4);
    for (int i = 0; i < TRC_CURVE_VERTEX_FLOATS; i++)
        out[i] = __builtin_shufflevector(rows[i], rows[i + 4], 0, 1, 2, 3, 4, 5, 6, 7);
}

/* The same at both keys of a segment; of curves at rest at the one. */
struct vertices8 {
    f8 key[2][TRC_CURVE_VERTEX_FLOATS];
};
TRC_INLINE void vertices8_load_keys(const struct walk *w, const uint32_t vertex[8], bool motion,
                                    struct vertices8 *out) {
    vertices8_load(w, vertex, 0, out->key[0]);
    if (motion)
        vertices8_load(w, vertex, 1, out->key[1]);
}

/* One of the four numbers at a fraction between the keys. */
TRC_INLINE f8 vertices8_at(const struct vertices8 *v, int i, bool motion, float fraction) {
    const f8 x = v->key[0][i];
    return motion ? x + f8_set(fraction) * (v->key[1][i] - x) : x;
}

/* Vertices of a leaf's pieces; of fewer than eight, the first stands in the lanes left. */
struct leaf_vertices {
    uint32_t end[2][8], before[8], after[8];
};
TRC_INLINE void leaf_vertices_of(const struct walk *w, const struct trc_slot *slots, uint32_t count,
                                 struct leaf_vertices *out) {
    const i8x lane = {0, 1, 2, 3, 4, 5, 6, 7};
    const i8x in = lane < (int32_t)count;
    i8x low, high;
    memcpy(&low, slots, sizeof low);
    memcpy(&high, slots + 4, sizeof high);
    i8x word = __builtin_shufflevector(low, high, 0, 2, 4, 6, 8, 10, 12, 14);
    i8x number = __builtin_shufflevector(low, high, 1, 3, 5, 7, 9, 11, 13, 15);
    word = (word & in) | ((int32_t)slots->instance & ~in);
    number = (number & in) | ((int32_t)slots->triangle & ~in);
    i8x first = number, last = number, before = number, after = number;
    if (!trc_shape_is_balls(w->tree->shape)) {
        const i8x none = {0};
        first = number + (word & (int32_t)TRC_SLOT_STRAND_MASK);
        last = first + 1;
        /* Comparisons are -1 where they hold: a neighbour. */
        before = first + ((word & (int32_t)TRC_SLOT_FIRST) == none);
        after = last - ((word & (int32_t)TRC_SLOT_LAST) == none);
    }
    memcpy(out->end[0], &first, sizeof first);
    memcpy(out->end[1], &last, sizeof last);
    memcpy(out->before, &before, sizeof before);
    memcpy(out->after, &after, sizeof after);
}

/* Widens boxes by the pieces' as they are at a fraction between two keys. */
TRC_INLINE void piece_boxes_grow(const struct vertices8 ends[2], bool motion, float fraction,
                                 f8 lower[3], f8 upper[3]) {
    for (int end = 0; end < 2; end++) {
        const f8 r = vertices8_at(&ends[end], 3, motion, fraction);
        for (int axis = 0; axis < 3; axis++) {
            const f8 x = vertices8_at(&ends[end], axis, motion, fraction);
            lower[axis] = f8_min(lower[axis], x - r);
            upper[axis] = f8_max(upper[axis], x + r);
        }
    }
}

/* Bits of the pieces that the beam may touch. */
TRC_INLINE uint32_t piece_candidates(const struct walk *w, const struct trc_slot *slots,
                                     uint32_t count, bool motion) {
    struct leaf_vertices v;
    f8 lower[3], upper[3], key;
    leaf_vertices_of(w, slots, count, &v);
    struct vertices8 ends[2];
    for (int end = 0; end < 2; end++)
        vertices8_load_keys(w, v.end[end], motion, &ends[end]);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f8_set(INFINITY);
        upper[axis] = f8_set(-INFINITY);
    }
    piece_boxes_grow(ends, motion, w->group->f_min, lower, upper);
    if (motion)
        piece_boxes_grow(ends, motion, w->group->f_max, lower, upper);
    return trc_beam_test(&w->group->beam, lower, upper, &key) & ((1u << count) - 1u);
}

/* Tests a piece, whose neighbours are loaded where they count: few rays pass near enough. */
TRC_INLINE struct trc_curve_hit_lanes curve_test_lanes(const struct walk *w,
                                                       const struct trc_curve_ray_lanes *rays,
                                                       const struct piece_vertices *v, bool motion,
                                                       int k, int i,
                                                       struct trc_piece_lanes *piece) {
    struct trc_curve_hit_lanes none = {.hit = vm_none()};
    if (w->tree->shape == TRC_SHAPE_RIBBONS) {
        const struct trc_ribbon_pass_lanes pass = trc_ribbon_pass_of_lanes(rays, piece);
        if (!vm_any(pass.hit))
            return none;
        piece_lanes_join(w, v, motion, k, i, piece);
        return trc_ribbon_hit_lanes(rays, piece, &pass);
    }
    if (w->tree->shape == TRC_SHAPE_ROUND) {
        const struct trc_round_pass_lanes pass = trc_round_pass_of_lanes(rays, piece);
        if (!vm_any(pass.hit))
            return none;
        piece_lanes_join(w, v, motion, k, i, piece);
        return trc_round_hit_lanes(rays, piece, &pass);
    }
    return trc_ball_test_lanes(rays, piece, w->tree->shape == TRC_SHAPE_BALLS);
}

/* Bits of chunk i of packet k that have left the strand. */
TRC_INLINE vmask left_lanes(const struct walk *w, int k, int i, const struct trc_slot *slot) {
    const struct trc_left_strands *left = w->packets[k].left;
    const vint instance = vi_load((const int32_t *)&left->instance[i]),
               strand = vi_load((const int32_t *)&left->strand[i]);
    return vm_and(vi_eq(instance, vi_set((int32_t)w->instance)),
                  vi_eq(strand, vi_set((int32_t)slot_strand(w, slot))));
}

/* Tests the piece in a slot against the rays of packet k in mask; those that it hits or, of closest
 * hits, whose hit it became. */
TRC_INLINE uint64_t piece_packet(struct walk *w, const struct trc_slot *slot, int k, uint64_t mask,
                                 bool any, bool motion) {
    const struct trc_packet *p = &w->packets[k];
    uint64_t found = 0;
    const struct piece_vertices v = piece_vertices_of(w, slot);
    struct trc_piece_lanes piece;
    if (!motion)
        piece_lanes_load(w, &v, false, 0, 0, &piece);
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        const uint32_t bits = trc_chunk_bits(mask, c);
        if (!bits)
            continue;
        const int i = c * TRC_WIDTH;
        if (motion)
            piece_lanes_load(w, &v, true, k, i, &piece);
        const struct trc_curve_ray_lanes rays = curve_rays(w, k, i);
        TRC_COUNT(triangle_rays, __builtin_popcount(bits));
        const struct trc_curve_hit_lanes h = curve_test_lanes(w, &rays, &v, motion, k, i, &piece);
        vmask hit = vm_and(vm_from_bits(bits), h.hit);
        if (!vm_any(hit))
            continue;
        if (p->left)
            hit = vm_andnot(hit, left_lanes(w, k, i, slot));
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
    const uint32_t count = trc_leaf_count(ref);
    const struct trc_slot *ids = trc_leaf_slots(w->tree, ref);
    uint64_t found = 0;
    for (uint32_t slots = piece_candidates(w, ids, count, motion); slots; slots &= slots - 1) {
        const int slot = __builtin_ctz(slots);
        if (any && w->packets->skip_transparent && (ids[slot].instance & TRC_SLOT_TRANSPARENT))
            continue;
        for (int k = 0; k < TRC_WALK_PACKETS; k++) {
            if (!mask.of[k])
                continue;
            const uint64_t hit = piece_packet(w, &ids[slot], k, mask.of[k], any, motion);
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
    const float tmin = f_max(p->tmin[ray], 0.0f);
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
        .tmin = f8_set(tmin),
        .near = f8_set(p->left ? 0.0f : tmin),
        .side = f8_set(w->group->beam.sign),
    };
}

/* A leaf on its way through single rays. */
struct curve_leaf {
    const struct trc_slot *slots;
    uint32_t count;
    struct leaf_vertices vertices;
    struct vertices8 ends[2], neighbors[2]; /* neighbors: before and after */
    struct trc_piece8 pieces;               /* as the ray meets them */
    bool has_neighbors;                     /* loaded, */
    bool is_joined;                         /* and in pieces */
};

TRC_INLINE void vertices8_place(const struct walk *w, const struct vertices8 *v, bool motion,
                                float fraction, f8 p[3], f8 *radius) {
    const struct trc_shear axis = w->group->beam.axis;
    const int order[3] = {axis.u, axis.v, axis.z};
    for (int i = 0; i < 3; i++)
        p[i] = vertices8_at(v, order[i], motion, fraction);
    *radius = vertices8_at(v, 3, motion, fraction);
}

/* The ends of a leaf's pieces at a fraction between two keys. */
TRC_INLINE void curve_leaf_place(const struct walk *w, struct curve_leaf *leaf, bool motion,
                                 float fraction) {
    for (int end = 0; end < 2; end++)
        vertices8_place(w, &leaf->ends[end], motion, fraction, leaf->pieces.p[end],
                        &leaf->pieces.r[end]);
    leaf->is_joined = false;
}

/* The vertices before and after them. */
TRC_INLINE void curve_leaf_join(const struct walk *w, struct curve_leaf *leaf, bool motion,
                                float fraction) {
    if (leaf->is_joined)
        return;
    if (!leaf->has_neighbors) {
        vertices8_load_keys(w, leaf->vertices.before, motion, &leaf->neighbors[0]);
        vertices8_load_keys(w, leaf->vertices.after, motion, &leaf->neighbors[1]);
    }
    vertices8_place(w, &leaf->neighbors[0], motion, fraction, leaf->pieces.before,
                    &leaf->pieces.r_before);
    vertices8_place(w, &leaf->neighbors[1], motion, fraction, leaf->pieces.after,
                    &leaf->pieces.r_after);
    leaf->has_neighbors = leaf->is_joined = true;
}

TRC_INLINE void curve_leaf_load(const struct walk *w, uint32_t ref, bool motion,
                                struct curve_leaf *leaf) {
    leaf->slots = trc_leaf_slots(w->tree, ref);
    leaf->count = trc_leaf_count(ref);
    leaf->has_neighbors = leaf->is_joined = false;
    leaf->pieces = (struct trc_piece8){.r_before = {0}}; /* compilers do not follow is_joined */
    leaf_vertices_of(w, leaf->slots, leaf->count, &leaf->vertices);
    for (int end = 0; end < 2; end++)
        vertices8_load_keys(w, leaf->vertices.end[end], motion, &leaf->ends[end]);
}

TRC_INLINE struct trc_curve_hit8 curve_test8(const struct walk *w, const struct trc_curve_ray8 *ray,
                                             bool motion, float fraction, struct curve_leaf *leaf) {
    struct trc_curve_hit8 none = {.hit = 0};
    if (w->tree->shape == TRC_SHAPE_RIBBONS) {
        const struct trc_ribbon_pass8 pass = trc_ribbon_pass_of8(ray, &leaf->pieces);
        if (!pass.hit)
            return none;
        curve_leaf_join(w, leaf, motion, fraction);
        return trc_ribbon_hit8(ray, &leaf->pieces, &pass);
    }
    if (w->tree->shape == TRC_SHAPE_ROUND) {
        const struct trc_round_pass8 pass = trc_round_pass_of8(ray, &leaf->pieces);
        if (!pass.hit)
            return none;
        curve_leaf_join(w, leaf, motion, fraction);
        return trc_round_hit8(ray, &leaf->pieces, &pass);
    }
    return trc_ball_test8(ray, &leaf->pieces, w->tree->shape == TRC_SHAPE_BALLS);
}

/* Bits of the slots whose strands the ray has not left. */
TRC_INLINE uint32_t slots_not_left(const struct walk *w, const struct trc_slot *slots, int k,
                                   int ray, uint32_t bits) {
    const struct trc_left_strands *left = w->packets[k].left;
    if (!left || left->instance[ray] != w->instance)
        return bits;
    for (uint32_t rest = bits; rest; rest &= rest - 1)
        if (slot_strand(w, &slots[__builtin_ctz(rest)]) == left->strand[ray])
            bits &= ~(rest & -rest);
    return bits;
}

/* One ray's tests against a leaf. True: occluded (any only). */
TRC_INLINE bool curve_leaf_single(struct walk *w, struct curve_leaf *leaf, int k, int ray, bool any,
                                  bool motion) {
    const float fraction = motion ? w->group->of[k].f[ray] : 0.0f;
    if (motion)
        curve_leaf_place(w, leaf, true, fraction);
    const struct trc_curve_ray8 r = curve_ray(w, k, ray);
    TRC_COUNT(single_leaves, 1);
    TRC_COUNT(single_triangles, leaf->count);
    const struct trc_curve_hit8 h = curve_test8(w, &r, motion, fraction, leaf);
    const uint32_t hit = slots_not_left(w, leaf->slots, k, ray, h.hit & ((1u << leaf->count) - 1u));
    return hit && ray_keep(w, leaf->slots, k, ray, hit, h.t, h.u, h.v, any);
}

#endif
