/* A walk and its leaves: triangles against the rays of packets, and against one ray. */
#ifndef TRACER_KERNELS_TRACE_WALK_LEAF_H
#define TRACER_KERNELS_TRACE_WALK_LEAF_H

#include "kernels/trace/beam.h"
#include "kernels/trace/edge_filter.h"
#include "kernels/trace/live.h"
#include "kernels/trace/triangle.h"
#include "model/tree.h"

/* The benchmark compiles a walk once more to count its steps; here it is nothing. */
#ifndef TRC_COUNT
#define TRC_COUNT(what, amount) ((void)0)
#endif

/* Whether rays look back (kernels/trace/spawn.h): with a tmin of 0 or below, they must not meet the
 * instance that they left at or before 0. The walk is compiled once more for them: asked of every
 * packet, it costs the others 4 to 9 % of their time. */
#ifndef TRC_WALK_LOOKS_BACK
#define TRC_WALK_LOOKS_BACK 0
#endif

/* Whether rays meet nothing but one instance each, w->left; compiled apart likewise. */
#ifndef TRC_WALK_ONE_INSTANCE
#define TRC_WALK_ONE_INSTANCE 0
#endif

struct trc_turned; /* kernels/trace/curve.h */

struct walk {
    const struct trc_snapshot *snapshot;
    const struct trc_tree *tree;
    const uint8_t *see_through; /* the tree's, where its children do not count; or NULL */
    struct trc_packet *packets;
    struct trc_packet_hits *hits; /* closest only */
    struct trc_live occluded;     /* any only: found so far */
    uint32_t instance;            /* of the tree; TRC_NO_HIT: leaves say */
    uint32_t key;                 /* moving trees: first key of the segment */
    struct trc_group *group;
    struct trc_turned *turned; /* curves: of each packet's rays in the group */
    const uint32_t *left;      /* looking back, one instance: those of the packet's rays */
};

/* ---- what a leaf has ---- */

/* A leaf on its way through packets. */
struct leaf {
    const float *vertices;  /* at rest [vertex][axis][slot]; moving: a block's at the first key */
    const uint8_t *corners; /* moving: of the block, [corner][slot] */
    uint32_t vertex_count;  /* moving */
    uint32_t count;
    const struct trc_slot *ids;
    struct trc_precision8 precision; /* see trc_triangle_test */
    bool filter;                     /* edges is set: rays of one origin, at rest */
    struct trc_edge_filter edges;
};

TRC_INLINE void leaf_find(const struct walk *w, uint32_t ref, bool motion, struct leaf *leaf) {
    leaf->count = trc_leaf_count(ref);
    if (!motion) {
        leaf->vertices = trc_leaf_vertices(w->tree, ref);
        leaf->ids = trc_leaf_slots(w->tree, ref);
        return;
    }
    const struct trc_block *block = trc_leaf_block(w->tree, ref);
    leaf->vertices = trc_block_rows(block, leaf->count, w->key);
    leaf->corners = block->corners;
    leaf->vertex_count = block->vertex_count;
    leaf->ids = w->tree->slots->slots + block->first_slot;
}

/* Eight floats between the keys of a block's row. */
TRC_INLINE f8 row_between(const float *row, const float *next, uint32_t at, f8 f) {
    const f8 p = f8_load(row + at);
    return p + f * (f8_load(next + at) - p);
}

/* The leaf's triangles [vertex][axis u, v, z]; moving: at a place f between the keys. */
TRC_INLINE void leaf_corners(const struct walk *w, const struct leaf *leaf, bool motion, float f,
                             f8 out[3][3]) {
    const uint32_t count = leaf->count;
    const uint32_t order[3] = {(uint32_t)w->group->beam.axis.u, (uint32_t)w->group->beam.axis.v,
                               (uint32_t)w->group->beam.axis.z};
    if (!motion) {
        for (uint32_t corner = 0; corner < 3; corner++)
            for (int axis = 0; axis < 3; axis++)
                out[corner][axis] = f8_load(leaf->vertices + (3 * corner + order[axis]) * count);
        return;
    }
    const uint32_t vertices = leaf->vertex_count;
    const f8 between = f8_set(f);
    if (__builtin_expect(vertices > TRC_BLOCK_LOAD, 0)) {
        for (int axis = 0; axis < 3; axis++) {
            const float *row = leaf->vertices + order[axis] * vertices, *next = row + 3 * vertices;
            for (uint32_t corner = 0; corner < 3; corner++)
                out[corner][axis] = row_between(row, next, corner * count, between);
        }
        return;
    }
    i8x number[3];
    for (uint32_t corner = 0; corner < 3; corner++)
        number[corner] = i8_load_bytes(leaf->corners + corner * count);
    for (int axis = 0; axis < 3; axis++) {
        const float *row = leaf->vertices + order[axis] * vertices, *next = row + 3 * vertices;
        const f8 low = row_between(row, next, 0, between),
                 high = row_between(row, next, 8, between);
        for (int corner = 0; corner < 3; corner++)
            out[corner][axis] = f8_pick(low, high, number[corner]);
    }
}

/* ---- packets ---- */

/* Beam cull of the leaf's triangles. */
TRC_INLINE uint32_t leaf_candidates(const struct walk *w, f8 v[3][3], f8 later[3][3],
                                    uint32_t count, bool motion, bool edges,
                                    struct trc_precision8 *precision_out) {
    const struct trc_beam *b = &w->group->beam;
    struct trc_beam_corners begin, end;
    for (int corner = 0; corner < 3; corner++) {
        trc_beam_corners_set(b, corner, v[corner][0], v[corner][1], v[corner][2], &begin);
        if (motion)
            trc_beam_corners_set(b, corner, later[corner][0], later[corner][1], later[corner][2],
                                 &end);
    }
    return trc_beam_triangles(w->group, &begin, motion ? &end : NULL, edges, precision_out) &
           ((1u << count) - 1u);
}

/* Broadcasts the triangle in a slot, or interpolates it for each ray of chunk i of packet k. */
TRC_INLINE void lanes_load(const struct walk *w, const struct leaf *leaf, int slot, bool motion,
                           int k, int i, struct trc_triangle_lanes *tri) {
    const uint32_t order[3] = {(uint32_t)w->group->beam.axis.u, (uint32_t)w->group->beam.axis.v,
                               (uint32_t)w->group->beam.axis.z};
    const uint32_t count = leaf->count, vertices = leaf->vertex_count;
    for (uint32_t corner = 0; corner < 3; corner++) {
        if (!motion) {
            for (int axis = 0; axis < 3; axis++)
                tri->v[corner][axis] =
                    vf_set(leaf->vertices[(3 * corner + order[axis]) * count + (uint32_t)slot]);
            continue;
        }
        const vfloat f = vf_load(&w->group->of[k].f[i]);
        const float *p = leaf->vertices + leaf->corners[corner * count + (uint32_t)slot];
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t at = order[axis] * vertices;
            const vfloat a = vf_set(p[at]);
            tri->v[corner][axis] = a + f * (vf_set(p[at + 3 * vertices]) - a);
        }
    }
}

TRC_INLINE uint32_t slot_instance(const struct walk *w, struct trc_slot slot) {
    return w->instance == TRC_NO_HIT ? slot.instance & TRC_SLOT_INSTANCE_MASK : w->instance;
}

/* How far hits of a slot must be ahead, of a chunk of rays and of one. */
TRC_INLINE vfloat least_distances(const struct walk *w, int k, int i, const struct trc_slot *slot) {
    const vfloat tmin = vf_load(&w->packets[k].tmin[i]);
    if (!TRC_WALK_LOOKS_BACK && !TRC_WALK_ONE_INSTANCE)
        return tmin;
    const vint instance = vi_set((int32_t)slot_instance(w, *slot));
    const vmask same = vi_eq(vi_load((const int32_t *)w->left + i), instance);
    if (TRC_WALK_ONE_INSTANCE)
        return vf_select(same, tmin, vf_set(INFINITY));
    return vf_select(same, vf_max(tmin, vf_set(0.0f)), tmin);
}
TRC_INLINE float least_distance(const struct walk *w, int k, int ray, const struct trc_slot *slot) {
    const float tmin = w->packets[k].tmin[ray];
    if (TRC_WALK_ONE_INSTANCE)
        return w->left[ray] == slot_instance(w, *slot) ? tmin : INFINITY;
    if (!TRC_WALK_LOOKS_BACK || w->left[ray] != slot_instance(w, *slot))
        return tmin;
    return f_max(tmin, 0.0f);
}

/* From such a distance on those of triangles are to be precise: floats may put what a ray looks
 * back for too far behind it. */
TRC_INLINE vfloat precise_beyond(vfloat minimum) {
    if (!TRC_WALK_LOOKS_BACK)
        return minimum;
    return vf_select(vf_lt(minimum, vf_set(0.0f)), vf_set(-INFINITY), minimum);
}
TRC_INLINE float leaf_precise_beyond(const struct walk *w, int k, int ray,
                                     const struct trc_slot *slots, uint32_t count) {
    const float tmin = w->packets[k].tmin[ray];
    if (!TRC_WALK_LOOKS_BACK || tmin >= 0.0f)
        return tmin;
    bool others = false;
    for (uint32_t slot = 0; slot < count; slot++)
        others |= slot_instance(w, slots[slot]) != w->left[ray];
    return others ? -INFINITY : 0.0f;
}

/* Keeps hits that are nearer than the ray's, or as near with a lower number. What is infinitely far
 * is none: distances of extreme directions overflow. */
TRC_INLINE uint32_t hits_keep(const struct walk *w, int k, int i, vmask hit, vfloat t, vfloat u,
                              vfloat v, const struct trc_slot *slot) {
    struct trc_packet *p = &w->packets[k];
    struct trc_packet_hits *h = &w->hits[k];
    const uint32_t instance = slot_instance(w, *slot), triangle = slot->triangle;
    const vfloat best = vf_load(&p->t[i]);
    vmask keep = vm_and(hit, vm_and(vf_lt(t, best), vf_gt(t, least_distances(w, k, i, slot))));
    uint32_t ties = vm_bits(vm_and(hit, vf_eq(t, best)));
    if (__builtin_expect(ties != 0, 0)) {
        uint32_t bits = vm_bits(keep);
        for (; ties; ties &= ties - 1) {
            const int l = i + __builtin_ctz(ties);
            const bool lower = instance < h->instance[l] ||
                               (instance == h->instance[l] && triangle < h->triangle[l]);
            if (lower && p->t[l] > least_distance(w, k, l, slot) && p->t[l] < INFINITY)
                bits |= ties & -ties;
        }
        keep = vm_from_bits(bits);
    }
    vf_store(&p->t[i], vf_select(keep, t, best));
    vf_store(&h->u[i], vf_select(keep, u, vf_load(&h->u[i])));
    vf_store(&h->v[i], vf_select(keep, v, vf_load(&h->v[i])));
    vi_store((int32_t *)&h->instance[i],
             vi_select(keep, vi_set((int32_t)instance), vi_load((int32_t *)&h->instance[i])));
    vi_store((int32_t *)&h->triangle[i],
             vi_select(keep, vi_set((int32_t)triangle), vi_load((int32_t *)&h->triangle[i])));
    return vm_bits(keep);
}

/* Of mask, the rays of packet k that pass the edges of the triangle in a slot, or may. For all
 * chunks, live or not, and all packets before the first test: to branch by masks that are still in
 * the making costs more than it spares. */
TRC_INLINE uint64_t slot_edges(const struct walk *w, const struct leaf *leaf, int slot,
                               const struct trc_precision *maximum, struct trc_triangle_lanes *tri,
                               int k, uint64_t mask, bool motion) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    uint64_t pass = 0;
    if (leaf->filter) {
        for (int i = 0; i < TRC_PACKET_SIZE; i += TRC_WIDTH)
            pass |= (uint64_t)trc_edge_filter_lanes(&leaf->edges, g, slot, i) << i;
        return pass & mask;
    }
    for (int i = 0; i < TRC_PACKET_SIZE; i += TRC_WIDTH) {
        if (motion)
            lanes_load(w, leaf, slot, true, k, i, tri);
        const vmask near = trc_triangle_near(
            tri, vf_load(&p->o[axis.u][i]), vf_load(&p->o[axis.v][i]), vf_load(&p->o[axis.z][i]),
            vf_load(&g->su[i]), vf_load(&g->sv[i]), maximum->weight_error);
        pass |= (uint64_t)vm_bits(near) << i;
    }
    return pass & mask;
}

/* Tests the triangle in a slot, loaded into tri where it is at rest, against the rays of packet k
 * in mask; those that it hits or, of closest hits, whose hit it became. */
TRC_INLINE uint64_t slot_packet(struct walk *w, const struct leaf *leaf, int slot,
                                const struct trc_precision *maximum, struct trc_triangle_lanes *tri,
                                int k, uint64_t mask, bool any, bool motion) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    uint64_t found = 0;
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        const uint32_t bits = trc_chunk_bits(mask, c);
        if (!bits)
            continue;
        const int i = c * TRC_WIDTH;
        if (motion)
            lanes_load(w, leaf, slot, true, k, i, tri);
        TRC_COUNT(triangle_rays, __builtin_popcount(bits));
        vfloat t, bu, bv;
        vmask hit = trc_triangle_test(tri, vf_load(&p->o[axis.u][i]), vf_load(&p->o[axis.v][i]),
                                      vf_load(&p->o[axis.z][i]), vf_load(&g->su[i]),
                                      vf_load(&g->sv[i]), vf_load(&g->sz[i]),
                                      precise_beyond(least_distances(w, k, i, &leaf->ids[slot])),
                                      maximum, vm_from_bits(bits), &t, &bu, &bv);
        if (!vm_any(hit))
            continue;
        if (any) {
            hit = vm_and(hit, vm_and(vf_gt(t, vf_load(&p->tmin[i])), vf_lt(t, vf_load(&p->t[i]))));
            found |= (uint64_t)vm_bits(hit) << i;
        } else {
            found |= (uint64_t)hits_keep(w, k, i, hit, t, bu, bv, &leaf->ids[slot]) << i;
        }
    }
    return found;
}

/* Tests a leaf's triangles; true if any ray found a (nearer) hit. */
TRC_INLINE bool leaf_packet(struct walk *w, uint32_t ref, struct trc_live mask, bool any,
                            bool motion) {
    const struct trc_group *g = w->group;
    struct leaf leaf = {.filter = !motion && trc_edge_filter_applies(w->packets, g)};
    f8 corners[3][3], later[3][3];
    uint64_t found = 0;
    leaf_find(w, ref, motion, &leaf);
    leaf_corners(w, &leaf, motion, g->f_min, corners);
    if (motion)
        leaf_corners(w, &leaf, true, g->f_max, later);
    /* The filter has the edges, closer. */
    uint32_t slots =
        leaf_candidates(w, corners, later, leaf.count, motion, !leaf.filter, &leaf.precision);
    if (slots && leaf.filter)
        slots = trc_edge_filter_setup(g, corners, slots, &leaf.edges);
    for (; slots; slots &= slots - 1) {
        const int slot = __builtin_ctz(slots);
        if (any && w->packets->skip_transparent && (leaf.ids[slot].instance & TRC_SLOT_TRANSPARENT))
            continue;
        const struct trc_precision maximum = trc_precision_of(&leaf.precision, slot);
        struct trc_triangle_lanes tri;
        if (!motion)
            lanes_load(w, &leaf, slot, false, 0, 0, &tri);
        struct trc_live pass = mask;
        for (int k = 0; k < TRC_WALK_PACKETS; k++)
            if (mask.of[k])
                pass.of[k] = slot_edges(w, &leaf, slot, &maximum, &tri, k, mask.of[k], motion);
        for (int k = 0; k < TRC_WALK_PACKETS; k++) {
            if (!pass.of[k])
                continue;
            const uint64_t hit =
                slot_packet(w, &leaf, slot, &maximum, &tri, k, pass.of[k], any, motion);
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

/* Keeps a ray's hits of slots, as hits_keep. True: occluded (any only). */
TRC_INLINE bool ray_keep(struct walk *w, const struct trc_slot *ids, int k, int ray, uint32_t hit,
                         f8 t, f8 u, f8 v, bool any) {
    struct trc_packet *p = &w->packets[k];
    for (; hit; hit &= hit - 1) {
        const int slot = __builtin_ctz(hit);
        const float distance = t[slot];
        if (!(distance > least_distance(w, k, ray, &ids[slot])))
            continue;
        if (any) {
            if (distance < p->t[ray] &&
                !(p->skip_transparent && (ids[slot].instance & TRC_SLOT_TRANSPARENT)))
                return true;
            continue;
        }
        const uint32_t instance = slot_instance(w, ids[slot]), triangle = ids[slot].triangle;
        struct trc_packet_hits *h = &w->hits[k];
        const bool lower = instance < h->instance[ray] ||
                           (instance == h->instance[ray] && triangle < h->triangle[ray]);
        if (distance < p->t[ray] || (distance == p->t[ray] && lower && distance < INFINITY)) {
            p->t[ray] = distance;
            h->u[ray] = u[slot];
            h->v[ray] = v[slot];
            h->instance[ray] = instance;
            h->triangle[ray] = triangle;
        }
    }
    return false;
}

/* One ray's tests against a leaf. True: occluded (any only). */
TRC_INLINE bool leaf_single(struct walk *w, uint32_t ref, int k, int ray, bool any, bool motion) {
    struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    struct leaf leaf;
    struct trc_triangle8 tri;
    leaf_find(w, ref, motion, &leaf);
    leaf_corners(w, &leaf, motion, motion ? g->f[ray] : 0.0f, tri.v);
    const uint32_t count = leaf.count;
    const struct trc_slot *ids = leaf.ids;
    f8 t, bu, bv;
    TRC_COUNT(single_leaves, 1);
    TRC_COUNT(single_triangles, count);
    uint32_t hit = trc_triangle8_test(
        &tri, p->o[axis.u][ray], p->o[axis.v][ray], p->o[axis.z][ray], g->su[ray], g->sv[ray],
        g->sz[ray], leaf_precise_beyond(w, k, ray, ids, count), (1u << count) - 1u, &t, &bu, &bv);
    return ray_keep(w, ids, k, ray, hit, t, bu, bv, any);
}

#endif
