/* Traversal: packets at the top, streams of few rays where a packet has thinned out.
 *
 * Boulos et al. 2007: general packets against a BVH, first an interval cull of the whole packet,
 * then the first active ray. Departures, each by measurement: 8-wide nodes; the interval test is a
 * beam (kernels/beam.h) against eight children in one step, as the first live ray is; all are tried
 * only when a child is taken from the stack, against distances as they are by then; a 64-bit mask
 * instead of a first active index; packets are split by dominant axis and its side; four packets
 * that stay together share one walk, for which this file is compiled twice (TRC_WALK_PACKETS); rays
 * that are few go on as a stream, each against eight boxes or eight triangles at a time. Hits do
 * not depend on any of it: candidates are tested by kernels/triangle.h and compared by distance,
 * then by number.
 *
 * Tried: boxes as one origin sees them, rectangles of slopes, cost a ray four comparisons but let
 * in a third more nodes, and with the silhouette's corners cut save no time; vertices less the
 * common origin of a packet, computed once for a triangle, cost more in registers than they save;
 * bundles of 8 packets are up to 6 % slower, of 16 up to 16; prefetching for packets, skipping a
 * stream's leaves behind its hits, and visiting what was prefetched longest ago change nothing. */
#ifndef TRACER_KERNELS_WALK_H
#define TRACER_KERNELS_WALK_H

#include "bvh/tree.h"
#include "kernels/beam.h"
#include "kernels/edge_filter.h"
#include "kernels/live.h"
#include "kernels/mesh_fetch.h"
#include "kernels/triangle.h"

/* The benchmark compiles this file once more to count the steps of a walk; here it is nothing. */
#ifndef TRC_COUNT
#define TRC_COUNT(what, amount) ((void)0)
#endif

/* Rays of a stream at most, and live rays at or below which packets end in one. By tracer_bench:
 * rays alone are up to 1.3 times as slow, at four of one origin or eight of many; lanes that are
 * half empty cost more than streams, more so where they are fewer. */
#define STREAM_SIZE 32
#define STREAM_ANY STREAM_SIZE
#define STREAM_CLOSEST (TRC_WIDTH < 16 ? STREAM_SIZE : 24)

/* A node whose children wait, so that it is read once: their boxes, wider by the slack; of moving
 * trees, hulled over the group's interval of time. */
struct opened {
    float planes[6][TRC_NODE_WIDTH]; /* low and high along u, v; near and far along z */
    float order[TRC_NODE_WIDTH];     /* least first; of closest hits, nearest mirrored z */
    struct trc_live mask;            /* rays that reached it */
    uint32_t first; /* bits of the children that the first of those meets; wide beams: none */
} __attribute__((aligned(64)));

/* A subtree to visit: a child of an opened node. */
struct entry {
    uint32_t ref;
    uint16_t level, child; /* level: of the opened node */
};

struct walk {
    const struct trc_snapshot *snapshot;
    const struct trc_tree *tree;
    struct trc_packet *packets;
    struct trc_packet_hits *hits; /* closest only */
    struct trc_live occluded;     /* any only: found so far */
    uint32_t instance;            /* of the tree; TRC_NO_HIT: leaves say */
    uint32_t key;                 /* moving trees: first key of the segment */
    struct trc_group *group;
};

static void item_packet(struct walk *w, const struct trc_item *item, struct trc_live mask,
                        bool any);

/* ---- bounds, static or moving ---- */

/* Boxes of a node's children: at rest, or hulled over the group's interval of time. */
TRC_INLINE void boxes_load(const struct walk *w, uint32_t node, bool motion, f8 lower[3],
                           f8 upper[3]) {
    const float *b = trc_node_bounds(w->tree, node, w->key);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f8_load(b + 16 * axis);
        upper[axis] = f8_load(b + 16 * axis + 8);
    }
    if (!motion)
        return;
    const float *e = b + TRC_NODE_KEY_BYTES / sizeof(float);
    const f8 f0 = f8_set(w->group->f_min), f1 = f8_set(w->group->f_max);
    for (int axis = 0; axis < 3; axis++) {
        const f8 l = f8_load(e + 16 * axis) - lower[axis];
        const f8 h = f8_load(e + 16 * axis + 8) - upper[axis];
        lower[axis] = f8_min(lower[axis] + f0 * l, lower[axis] + f1 * l);
        upper[axis] = f8_max(upper[axis] + f0 * h, upper[axis] + f1 * h);
    }
}

/* Rays of packet k in mask whose own slabs meet the box of the node's child. */
TRC_INLINE uint64_t box_packet(const struct walk *w, const struct opened *node, int child, int k,
                               uint64_t mask) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    const int u = axis.u, v = axis.v, z = axis.z;
    float box[6];
    for (int plane = 0; plane < 6; plane++)
        box[plane] = node->planes[plane][child];
    TRC_COUNT(box_rays, __builtin_popcountll(mask));
    uint64_t live = 0;
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        const uint32_t bits = trc_chunk_bits(mask, c);
        if (!bits)
            continue;
        const int i = c * TRC_WIDTH;
        const vfloat u_inv = vf_load(&g->inv[u][i]), u_shift = vf_load(&g->shift[u][i]),
                     v_inv = vf_load(&g->inv[v][i]), v_shift = vf_load(&g->shift[v][i]),
                     z_inv = vf_load(&g->inv[z][i]), z_shift = vf_load(&g->shift[z][i]);
        const vfloat u0 = vf_madd(vf_set(box[0]), u_inv, u_shift),
                     u1 = vf_madd(vf_set(box[1]), u_inv, u_shift),
                     v0 = vf_madd(vf_set(box[2]), v_inv, v_shift),
                     v1 = vf_madd(vf_set(box[3]), v_inv, v_shift),
                     z0 = vf_madd(vf_set(box[4]), z_inv, z_shift),
                     z1 = vf_madd(vf_set(box[5]), z_inv, z_shift);
        const vfloat near =
            vf_max(vf_max(vf_load(&p->tmin[i]), z0), vf_max(vf_min(u0, u1), vf_min(v0, v1)));
        const vfloat far =
            vf_min(vf_min(vf_load(&p->t[i]), z1), vf_min(vf_max(u0, u1), vf_max(v0, v1)));
        live |= (uint64_t)(vm_bits(vf_le(near, far)) & bits) << i;
    }
    return live;
}

/* Rays of mask that meet the box of the node's child. together: whether boxes still take all rays
 * of a narrow beam or none. */
TRC_INLINE struct trc_live box_rays(const struct walk *w, const struct opened *node, int child,
                                    const struct trc_live *mask, bool *together) {
    struct trc_live live;
    uint64_t some = 0, missed = 0;
    for (int k = 0; k < TRC_WALK_PACKETS; k++) {
        live.of[k] = mask->of[k] ? box_packet(w, node, child, k, mask->of[k]) : 0;
        some |= live.of[k];
        missed |= mask->of[k] ^ live.of[k];
    }
    *together = w->group->beam.is_narrow && (!some || !missed);
    return live;
}

/* ---- leaves, packets ---- */

/* The leaf's triangles [vertex][axis u, v, z]; in motion: as the group's interval of time begins,
 * and in later as it ends. */
TRC_INLINE void leaf_corners(const struct walk *w, const float *v, uint32_t count, bool motion,
                             f8 now[3][3], f8 later[3][3]) {
    const int order[3] = {w->group->beam.axis.u, w->group->beam.axis.v, w->group->beam.axis.z};
    const float *e = v + TRC_TRIANGLE_FLOATS * count; /* the next key */
    for (int corner = 0; corner < 3; corner++)
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t at = (uint32_t)(3 * corner + order[axis]) * count;
            const f8 p = f8_load(v + at);
            now[corner][axis] = p;
            if (!motion)
                continue;
            const f8 way = f8_load(e + at) - p;
            now[corner][axis] = p + f8_set(w->group->f_min) * way;
            later[corner][axis] = p + f8_set(w->group->f_max) * way;
        }
}

/* Beam cull of the leaf's triangles. */
TRC_INLINE uint32_t leaf_candidates(const struct walk *w, f8 v[3][3], f8 later[3][3],
                                    uint32_t count, bool motion, bool edges, f8 *t_error_out) {
    const struct trc_beam *b = &w->group->beam;
    struct trc_beam_corners begin, end;
    for (int corner = 0; corner < 3; corner++) {
        trc_beam_corners_set(b, corner, v[corner][0], v[corner][1], v[corner][2], &begin);
        if (motion)
            trc_beam_corners_set(b, corner, later[corner][0], later[corner][1], later[corner][2],
                                 &end);
    }
    return trc_beam_triangles(w->group, &begin, motion ? &end : NULL, edges, t_error_out) &
           ((1u << count) - 1u);
}

/* Broadcasts the triangle of v's first slot, or interpolates it for each ray of chunk i of packet
 * k. */
TRC_INLINE void lanes_load(const struct walk *w, const float *v, uint32_t count, bool motion, int k,
                           int i, struct trc_triangle_lanes *tri) {
    const int order[3] = {w->group->beam.axis.u, w->group->beam.axis.v, w->group->beam.axis.z};
    const float *e = v + TRC_TRIANGLE_FLOATS * count;
    const vfloat f = motion ? vf_load(&w->group->of[k].f[i]) : vf_set(0.0f);
    for (int corner = 0; corner < 3; corner++)
        for (int axis = 0; axis < 3; axis++) {
            const uint32_t at = (uint32_t)(3 * corner + order[axis]) * count;
            const vfloat a = vf_set(v[at]);
            tri->v[corner][axis] = motion ? a + f * (vf_set(e[at]) - a) : a;
        }
}

TRC_INLINE uint32_t slot_instance(const struct walk *w, struct trc_slot slot) {
    return w->instance == TRC_NO_HIT ? slot.instance & TRC_SLOT_INSTANCE_MASK : w->instance;
}

/* Keeps hits that are nearer than the ray's, or as near with a lower number. */
TRC_INLINE uint32_t hits_keep(const struct walk *w, int k, int i, vmask hit, vfloat t, vfloat u,
                              vfloat v, struct trc_slot slot) {
    struct trc_packet *p = &w->packets[k];
    struct trc_packet_hits *h = &w->hits[k];
    const uint32_t instance = slot_instance(w, slot), triangle = slot.triangle;
    const vfloat best = vf_load(&p->t[i]);
    vmask keep = vm_and(hit, vm_and(vf_lt(t, best), vf_gt(t, vf_load(&p->tmin[i]))));
    uint32_t ties = vm_bits(vm_and(hit, vf_eq(t, best)));
    if (__builtin_expect(ties != 0, 0)) {
        uint32_t bits = vm_bits(keep);
        for (; ties; ties &= ties - 1) {
            const int l = i + __builtin_ctz(ties);
            const bool lower = instance < h->instance[l] ||
                               (instance == h->instance[l] && triangle < h->triangle[l]);
            if (lower && p->t[l] > p->tmin[l])
                bits |= ties & -ties;
        }
        keep = vm_from_bits(bits);
    }
    if (!vm_any(keep))
        return 0;
    vf_store(&p->t[i], vf_select(keep, t, best));
    vf_store(&h->u[i], vf_select(keep, u, vf_load(&h->u[i])));
    vf_store(&h->v[i], vf_select(keep, v, vf_load(&h->v[i])));
    vi_store((int32_t *)&h->instance[i],
             vi_select(keep, vi_set((int32_t)instance), vi_load((int32_t *)&h->instance[i])));
    vi_store((int32_t *)&h->triangle[i],
             vi_select(keep, vi_set((int32_t)triangle), vi_load((int32_t *)&h->triangle[i])));
    return vm_bits(keep);
}

/* A leaf on its way through packets. */
struct leaf {
    const float *vertices; /* of all its triangles */
    uint32_t count;
    const struct trc_slot *ids;
    f8 t_error;  /* see trc_triangle_test */
    bool filter; /* edges is set: rays of one origin, at rest */
    struct trc_edge_filter edges;
};

/* Tests the triangle in a slot, loaded into tri where it is at rest, against the rays of packet k
 * in mask; those that it hits or, of closest hits, whose hit it became. */
TRC_INLINE uint64_t slot_packet(struct walk *w, const struct leaf *leaf, int slot,
                                struct trc_triangle_lanes *tri, int k, uint64_t mask, bool any,
                                bool motion) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    const float t_error = trc_t_error_usable(leaf->t_error[slot]);
    uint64_t found = 0;
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        uint32_t bits = trc_chunk_bits(mask, c);
        if (!bits)
            continue;
        const int i = c * TRC_WIDTH;
        if (leaf->filter) {
            bits &= trc_edge_filter_lanes(&leaf->edges, g, slot, i);
            if (!bits)
                continue;
        }
        if (motion)
            lanes_load(w, leaf->vertices + slot, leaf->count, true, k, i, tri);
        TRC_COUNT(triangle_rays, __builtin_popcount(bits));
        vfloat t, bu, bv;
        vmask hit = trc_triangle_test(tri, vf_load(&p->o[axis.u][i]), vf_load(&p->o[axis.v][i]),
                                      vf_load(&p->o[axis.z][i]), vf_load(&g->su[i]),
                                      vf_load(&g->sv[i]), vf_load(&g->sz[i]), vf_load(&p->tmin[i]),
                                      t_error, vm_from_bits(bits), &t, &bu, &bv);
        if (!vm_any(hit))
            continue;
        if (any) {
            hit = vm_and(hit, vm_and(vf_gt(t, vf_load(&p->tmin[i])), vf_lt(t, vf_load(&p->t[i]))));
            found |= (uint64_t)vm_bits(hit) << i;
        } else {
            found |= (uint64_t)hits_keep(w, k, i, hit, t, bu, bv, leaf->ids[slot]) << i;
        }
    }
    return found;
}

/* Tests a leaf's triangles; true if any ray found a (nearer) hit. */
TRC_INLINE bool leaf_packet(struct walk *w, uint32_t ref, struct trc_live mask, bool any,
                            bool motion) {
    const struct trc_group *g = w->group;
    struct leaf leaf = {.vertices = trc_leaf_vertices(w->tree, ref, w->key),
                        .count = trc_leaf_count(ref),
                        .ids = trc_leaf_slots(w->tree, ref),
                        .filter = !motion && trc_edge_filter_applies(w->packets, g)};
    f8 corners[3][3], later[3][3];
    uint64_t found = 0;
    leaf_corners(w, leaf.vertices, leaf.count, motion, corners, later);
    /* The filter has the edges, closer. */
    uint32_t slots =
        leaf_candidates(w, corners, later, leaf.count, motion, !leaf.filter, &leaf.t_error);
    if (slots && leaf.filter)
        slots = trc_edge_filter_setup(g, corners, slots, &leaf.edges);
    for (; slots; slots &= slots - 1) {
        const int slot = __builtin_ctz(slots);
        if (any && w->packets->skip_transparent && (leaf.ids[slot].instance & TRC_SLOT_TRANSPARENT))
            continue;
        struct trc_triangle_lanes tri;
        if (!motion)
            lanes_load(w, leaf.vertices + slot, leaf.count, false, 0, 0, &tri);
        for (int k = 0; k < TRC_WALK_PACKETS; k++) {
            if (!mask.of[k])
                continue;
            const uint64_t hit = slot_packet(w, &leaf, slot, &tri, k, mask.of[k], any, motion);
            found |= hit;
            if (any) {
                w->occluded.of[k] |= hit;
                mask.of[k] &= ~hit;
            }
        }
    }
    return found != 0;
}

/* After hits: the beam need not reach beyond the farthest ray. */
static void beam_shorten(struct walk *w, const struct trc_live *mask) {
    struct trc_beam *b = &w->group->beam;
    const int z = b->axis.z;
    vfloat far = vf_set(-INFINITY);
    for (int c = 0; c < TRC_WALK_CHUNKS; c++) {
        const uint32_t bits = trc_live_bits(mask, c);
        if (!bits)
            continue;
        const struct trc_packet *p = &w->packets[c / TRC_PACKET_CHUNKS];
        const int i = c % TRC_PACKET_CHUNKS * TRC_WIDTH;
        const vfloat end = vf_load(&p->o[z][i]) + vf_load(&p->t[i]) * vf_load(&p->d[z][i]);
        far = vf_max(far, vf_select(vm_from_bits(bits), vf_set(b->sign) * end, far));
    }
    b->z1 = f_min(b->z1, vf_lanes_max(far) + b->slack);
}

/* ---- leaves, one ray ---- */

/* One ray's tests against a leaf. True: occluded (any only). */
TRC_INLINE bool leaf_single(struct walk *w, uint32_t ref, int k, int ray, bool any, bool motion) {
    struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const uint32_t count = trc_leaf_count(ref);
    const struct trc_slot *ids = trc_leaf_slots(w->tree, ref);
    const struct trc_shear axis = w->group->beam.axis;
    const int order[3] = {axis.u, axis.v, axis.z};
    const float *v = trc_leaf_vertices(w->tree, ref, w->key);
    const float *e = v + TRC_TRIANGLE_FLOATS * count;
    struct trc_triangle8 tri;
    for (int corner = 0; corner < 3; corner++)
        for (int a = 0; a < 3; a++) {
            const uint32_t at = (uint32_t)(3 * corner + order[a]) * count;
            tri.v[corner][a] = f8_load(v + at);
            if (motion) {
                const f8 way = f8_load(e + at) - tri.v[corner][a];
                tri.v[corner][a] = tri.v[corner][a] + f8_set(g->f[ray]) * way;
            }
        }
    f8 t, bu, bv;
    TRC_COUNT(single_leaves, 1);
    TRC_COUNT(single_triangles, count);
    uint32_t hit = trc_triangle8_test(&tri, p->o[axis.u][ray], p->o[axis.v][ray], p->o[axis.z][ray],
                                      g->su[ray], g->sv[ray], g->sz[ray], p->tmin[ray],
                                      (1u << count) - 1u, &t, &bu, &bv);
    for (; hit; hit &= hit - 1) {
        const int slot = __builtin_ctz(hit);
        const float distance = t[slot];
        if (!(distance > p->tmin[ray]))
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
        if (distance < p->t[ray] || (distance == p->t[ray] && lower)) {
            p->t[ray] = distance;
            h->u[ray] = bu[slot];
            h->v[ray] = bv[slot];
            h->instance[ray] = instance;
            h->triangle[ray] = triangle;
        }
    }
    return false;
}

/* ---- streams ---- */

/* Few rays on their way together: a node is met once for all of them, each against its eight boxes,
 * which cost as much as they would alone, but no order of their own, no stack and no wrong guess of
 * a branch (V. Fuetterer et al., "Efficient Ray Tracing Through Aligned SIMD Computations and
 * Masked Stack", 2015). Rays share their dominant axis: near boxes come first for all. */
struct stream {
    float inv[3][STREAM_SIZE], shift[3][STREAM_SIZE]; /* 1 / d, -o / d */
    float tmin[STREAM_SIZE], t[STREAM_SIZE];
    float f[STREAM_SIZE];      /* moving trees: position between the keys */
    uint16_t ray[STREAM_SIZE]; /* packet * TRC_PACKET_SIZE + its number there */
    uint32_t alive;            /* any only: bits of those that are not occluded */
};

/* A subtree to visit. */
struct stream_entry {
    uint32_t ref, rays; /* rays: bits, into the stream */
    float z;            /* closest only: of its box, the nearest mirrored one */
};

TRC_INLINE void stream_setup(const struct walk *w, const struct trc_live *live, bool motion,
                             struct stream *s) {
    int n = 0;
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        for (uint64_t m = live->of[k]; m; m &= m - 1, n++) {
            const struct trc_packet *p = &w->packets[k];
            const struct trc_sheared *g = &w->group->of[k];
            const int i = __builtin_ctzll(m);
            for (int axis = 0; axis < 3; axis++) {
                s->inv[axis][n] = g->inv[axis][i];
                s->shift[axis][n] = g->shift[axis][i];
            }
            s->tmin[n] = p->tmin[i];
            s->t[n] = p->t[i];
            s->f[n] = motion ? g->f[i] : 0.0f;
            s->ray[n] = (uint16_t)(k * TRC_PACKET_SIZE + i);
        }
    s->alive = (uint32_t)((1ull << n) - 1);
}

/* For each child of a node the rays that meet its box; returns the bits of children with any. */
TRC_INLINE uint32_t stream_node(const struct walk *w, uint32_t node, const struct stream *s,
                                uint32_t rays, bool motion, uint32_t met[TRC_NODE_WIDTH]) {
    const float *b = trc_node_bounds(w->tree, node, w->key);
    const float *e = b + (motion ? TRC_NODE_KEY_BYTES / sizeof(float) : 0);
    const f8 slack = f8_set(w->group->beam.slack);
    f8 low[3], high[3];
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = f8_load(b + 16 * axis) - slack;
        high[axis] = f8_load(b + 16 * axis + 8) + slack;
    }
    i8x children, all = {0};
    for (; rays; rays &= rays - 1) {
        const int i = __builtin_ctz(rays);
        f8 near = f8_set(s->tmin[i]), far = f8_set(s->t[i]);
        for (int axis = 0; axis < 3; axis++) {
            f8 l = low[axis], h = high[axis];
            if (motion) {
                const f8 f = f8_set(s->f[i]);
                l += f * (f8_load(e + 16 * axis) - f8_load(b + 16 * axis));
                h += f * (f8_load(e + 16 * axis + 8) - f8_load(b + 16 * axis + 8));
            }
            const f8 inv = f8_set(s->inv[axis][i]), shift = f8_set(s->shift[axis][i]);
            l = f8_madd(l, inv, shift);
            h = f8_madd(h, inv, shift);
            near = f8_max(near, f8_min(l, h));
            far = f8_min(far, f8_max(l, h));
        }
        all |= (i8x)(near <= far) & (int32_t)(1u << i);
    }
    memcpy(&children, trc_node_children(w->tree, node), sizeof children);
    all &= children != (int32_t)TRC_REF_EMPTY; /* inverted boxes are met, too */
    memcpy(met, &all, sizeof all);
    return i8_nonzero(all);
}

#define CACHE_LINE 64
#define NODE_LINES ((TRC_NODE_HEADER_BYTES + TRC_NODE_KEY_BYTES) / CACHE_LINE)
#define LEAF_LINES 2 /* a leaf is of three triangles, mostly */
/* Asks for the memory of what waits on a stack; a TLAS is small. */
TRC_INLINE void ref_prefetch(const struct walk *w, uint32_t ref, bool any) {
    const bool is_leaf = ref & TRC_REF_LEAF;
    if (w->tree->is_top)
        return;
    const char *at = is_leaf ? (const char *)trc_leaf_vertices(w->tree, ref, w->key)
                             : (const char *)trc_node_children(w->tree, ref);
    for (int line = 0; line < (is_leaf ? LEAF_LINES : NODE_LINES); line++)
        __builtin_prefetch(at + line * CACHE_LINE);
    if (is_leaf && !any)
        __builtin_prefetch(trc_leaf_slots(w->tree, ref));
}

/* Pushes the children that are met: to the closest hit the nearest on top, to any in any order. */
TRC_INLINE int stream_push(const struct walk *w, uint32_t node, uint32_t bits,
                           const uint32_t met[TRC_NODE_WIDTH], bool any, struct stream_entry *stack,
                           int top) {
    const uint32_t *children = trc_node_children(w->tree, node);
    const struct trc_beam *b = &w->group->beam;
    const float *z = trc_node_bounds(w->tree, node, w->key) + 16 * b->axis.z + 8 * b->side;
    const int bottom = top;
    for (; bits; bits &= bits - 1) {
        const int child = __builtin_ctz(bits);
        const struct stream_entry entry = {children[child], met[child], b->sign * z[child]};
        int at = top++;
        ref_prefetch(w, entry.ref, any);
        for (; !any && at > bottom && stack[at - 1].z < entry.z; at--)
            stack[at] = stack[at - 1];
        stack[at] = entry;
    }
    return top;
}

/* A TLAS's leaf: on as packets. */
TRC_INLINE void stream_item(struct walk *w, uint32_t ref, struct stream *s, uint32_t rays,
                            bool any) {
    struct trc_live live = {{0}};
    for (uint32_t m = rays; m; m &= m - 1) {
        const uint32_t ray = s->ray[__builtin_ctz(m)];
        live.of[ray / TRC_PACKET_SIZE] |= 1ull << ray % TRC_PACKET_SIZE;
    }
    item_packet(w, &w->tree->items[trc_leaf_first(ref)], live, any);
    for (uint32_t m = rays; m; m &= m - 1) {
        const int i = __builtin_ctz(m);
        const uint32_t k = s->ray[i] / TRC_PACKET_SIZE, ray = s->ray[i] % TRC_PACKET_SIZE;
        if (any && (w->occluded.of[k] >> ray & 1u))
            s->alive &= ~(1u << i);
        s->t[i] = w->packets[k].t[ray];
    }
}

TRC_INLINE void stream_leaf(struct walk *w, uint32_t ref, struct stream *s, uint32_t rays, bool any,
                            bool motion) {
    for (; rays; rays &= rays - 1) {
        const int i = __builtin_ctz(rays);
        const int k = s->ray[i] / TRC_PACKET_SIZE, ray = s->ray[i] % TRC_PACKET_SIZE;
        if (leaf_single(w, ref, k, ray, any, motion)) {
            w->occluded.of[k] |= 1ull << ray;
            s->alive &= ~(1u << i);
        }
        if (!any)
            s->t[i] = w->packets[k].t[ray];
    }
}

/* Walks live rays, at most STREAM_SIZE, through the subtree at ref. */
TRC_INLINE void stream_walk(struct walk *w, uint32_t ref, const struct trc_live *live, bool any,
                            bool motion) {
    struct stream_entry stack[TRC_STACK_SIZE];
    struct stream s;
    int top = 0;
    stream_setup(w, live, motion, &s);
    for (uint32_t rays = s.alive;;) {
        if (!(ref & TRC_REF_LEAF)) {
            uint32_t met[TRC_NODE_WIDTH];
            TRC_COUNT(single_nodes, __builtin_popcount(rays));
            const uint32_t bits = stream_node(w, ref, &s, rays, motion, met);
            top = stream_push(w, ref, bits, met, any, stack, top);
        } else if (w->tree->is_top) {
            stream_item(w, ref, &s, rays, any);
        } else {
            stream_leaf(w, ref, &s, rays, any, motion);
        }
        do {
            if (top == 0)
                return;
            ref = stack[--top].ref;
            rays = any ? stack[top].rays & s.alive : stack[top].rays;
        } while (!rays);
    }
}

/* ---- the packet's walk ---- */

/* Bits of the children whose planes, in the order of struct opened, one ray meets. */
TRC_INLINE uint32_t planes_ray(const struct walk *w, const f8 planes[6], int k, int ray) {
    const struct trc_packet *p = &w->packets[k];
    const struct trc_sheared *g = &w->group->of[k];
    const struct trc_shear axis = w->group->beam.axis;
    const int axes[3] = {axis.u, axis.v, axis.z};
    f8 at[6];
    for (int plane = 0; plane < 6; plane++)
        at[plane] = f8_madd(planes[plane], f8_set(g->inv[axes[plane / 2]][ray]),
                            f8_set(g->shift[axes[plane / 2]][ray]));
    const f8 near = f8_max(f8_max(f8_set(p->tmin[ray]), at[4]),
                           f8_max(f8_min(at[0], at[1]), f8_min(at[2], at[3])));
    const f8 far = f8_min(f8_min(f8_set(p->t[ray]), at[5]),
                          f8_min(f8_max(at[0], at[1]), f8_max(at[2], at[3])));
    return f8_le(near, far);
}

/* Opens a node: pushes the children the beam may touch, the nearest on top; to any hit, those first
 * where the beam is narrowest, since what is there blocks most rays. */
TRC_INLINE int node_open(const struct walk *w, uint32_t node, const struct trc_live *mask, bool any,
                         bool motion, uint16_t level, struct opened *o, struct entry *stack,
                         int top) {
    const struct trc_beam *b = &w->group->beam;
    f8 lower[3], upper[3], key;
    boxes_load(w, node, motion, lower, upper);
    uint32_t bits = trc_beam_test(b, lower, upper, &key);
    if (!bits)
        return top;
    const f8 slack = f8_set(b->slack);
    const f8 z_low = lower[b->axis.z] - slack, z_high = upper[b->axis.z] + slack;
    const f8 planes[6] = {lower[b->axis.u] - slack, upper[b->axis.u] + slack,
                          lower[b->axis.v] - slack, upper[b->axis.v] + slack,
                          b->side ? z_high : z_low, b->side ? z_low : z_high};
    for (int plane = 0; plane < 6; plane++)
        f8_store(o->planes[plane], planes[plane]);
    f8_store(o->order, any && b->converges ? -key : key);
    o->mask = *mask;
    o->first = 0;
    if (b->is_narrow) {
        TRC_COUNT(box_rays, __builtin_popcount(bits));
        const int k = trc_live_first(mask);
        o->first = planes_ray(w, planes, k, __builtin_ctzll(mask->of[k]));
    }
    const uint32_t *children = trc_node_children(w->tree, node);
    const int bottom = top;
    for (; bits; bits &= bits - 1) {
        const int child = __builtin_ctz(bits);
        int at = top++;
        for (; at > bottom && o->order[stack[at - 1].child] < o->order[child]; at--)
            stack[at] = stack[at - 1];
        stack[at] = (struct entry){children[child], level, (uint16_t)child};
    }
    return top;
}

/* The live rays that visit a child of an opened node. In narrow beams, while boxes take all rays or
 * none, the others are not looked at when the first one meets the box and hits have not come to lie
 * before it. */
TRC_INLINE struct trc_live child_rays(const struct walk *w, const struct opened *node, int child,
                                      bool any, bool *together) {
    struct trc_live live = node->mask;
    const int k = trc_live_first(&live);
    const uint64_t first = live.of[k] & -live.of[k];
    for (int j = 0; any && j < TRC_WALK_PACKETS; j++)
        live.of[j] &= ~w->occluded.of[j];
    if (*together && (node->first >> child & 1u) && (live.of[k] & first) &&
        (any || node->order[child] <= w->group->beam.z1))
        return live;
    return trc_live_any(&live) ? box_rays(w, node, child, &live, together) : live;
}

TRC_INLINE void packet_walk(struct walk *w, struct trc_live mask, bool any, bool motion) {
    struct entry stack[TRC_STACK_SIZE];
    struct opened opened[TRC_MAX_LEVELS + 1]; /* on the way to ref */
    uint16_t level = 0;
    bool together = w->group->beam.is_narrow;
    struct trc_live live = mask;
    uint32_t ref = w->tree->root;
    int top = 0;
    for (;;) {
        const int count = trc_live_count(&live);
        if (count <= (any ? STREAM_ANY : STREAM_CLOSEST)) {
            stream_walk(w, ref, &live, any, motion);
        } else {
            TRC_COUNT(visits, 1);
            TRC_COUNT(visit_rays, count);
            if (!(ref & TRC_REF_LEAF)) {
                TRC_COUNT(nodes, 1);
                top = node_open(w, ref, &live, any, motion, level, &opened[level], stack, top);
            } else if (w->tree->is_top) {
                item_packet(w, &w->tree->items[trc_leaf_first(ref)], live, any);
                if (!any)
                    beam_shorten(w, &mask);
            } else if (leaf_packet(w, ref, live, any, motion) && !any) {
                beam_shorten(w, &mask);
            }
        }
        do {
            if (top == 0)
                return;
            const struct entry *at = &stack[--top];
            ref = at->ref;
            level = (uint16_t)(at->level + 1);
            live = child_rays(w, &opened[at->level], at->child, any, &together);
        } while (!trc_live_any(&live));
    }
}

static void walk_any(struct walk *w, struct trc_live mask) { packet_walk(w, mask, true, false); }
static void walk_closest(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, false);
}
static void walk_any_moving(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, true, true);
}
static void walk_closest_moving(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, true);
}

/* Moving trees: rays of one segment between keys at a time, each with its place in it. */
static void walk_segments(struct walk *w, struct trc_live mask, bool any) {
    struct trc_group *g = w->group;
    const float z1 = g->beam.z1; /* each segment's walk shortens the beam for its own rays */
    uint8_t keys[TRC_WALK_PACKETS][TRC_PACKET_SIZE];
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        for (uint64_t m = mask.of[k]; m; m &= m - 1) {
            const int i = __builtin_ctzll(m);
            uint32_t key;
            trc_key_at(w->packets[k].time[i], w->tree->key_count, &key, &g->of[k].f[i]);
            keys[k][i] = (uint8_t)key;
        }
    while (trc_live_any(&mask)) {
        const int first = trc_live_first(&mask);
        const uint8_t key = keys[first][__builtin_ctzll(mask.of[first])];
        struct trc_live same = {{0}};
        g->f_min = 1.0f;
        g->f_max = 0.0f;
        g->beam.z1 = z1;
        for (int k = 0; k < TRC_WALK_PACKETS; k++) {
            for (uint64_t m = mask.of[k]; m; m &= m - 1) {
                const int i = __builtin_ctzll(m);
                if (keys[k][i] != key)
                    continue;
                same.of[k] |= 1ull << i;
                g->f_min = f_min(g->f_min, g->of[k].f[i]);
                g->f_max = f_max(g->f_max, g->of[k].f[i]);
            }
            mask.of[k] &= ~same.of[k];
        }
        w->key = key;
        (any ? walk_any_moving : walk_closest_moving)(w, same);
    }
}

/* The rays of w's group through w's tree. */
static void walk_group(struct walk *w, struct trc_live mask, bool any) {
    if (w->tree->key_count > 1)
        walk_segments(w, mask, any);
    else
        (any ? walk_any : walk_closest)(w, mask);
}

/* Rays whose directions are dominated by an axis and have a side of it: [axis][side]. */
static void rays_split(const struct walk *w, const struct trc_live *mask,
                       struct trc_live out[3][2]) {
    for (int k = 0; k < TRC_WALK_PACKETS; k++) {
        const struct trc_packet *p = &w->packets[k];
        uint64_t x = 0, y = 0, down[3] = {0};
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
            if (!trc_chunk_bits(mask->of[k], c))
                continue;
            const int i = c * TRC_WIDTH;
            const vfloat dx = vf_load(&p->d[0][i]), dy = vf_load(&p->d[1][i]),
                         dz = vf_load(&p->d[2][i]);
            const vfloat ax = vf_abs(dx), ay = vf_abs(dy), az = vf_abs(dz), zero = vf_set(0.0f);
            x |= (uint64_t)vm_bits(vm_and(vf_ge(ax, ay), vf_ge(ax, az))) << i;
            y |= (uint64_t)vm_bits(vf_ge(ay, az)) << i;
            down[0] |= (uint64_t)vm_bits(vf_lt(dx, zero)) << i;
            down[1] |= (uint64_t)vm_bits(vf_lt(dy, zero)) << i;
            down[2] |= (uint64_t)vm_bits(vf_lt(dz, zero)) << i;
        }
        const uint64_t m = mask->of[k], dominant[3] = {m & x, m & ~x & y, m & ~x & ~y};
        for (int axis = 0; axis < 3; axis++) {
            out[axis][0].of[k] = dominant[axis] & ~down[axis];
            out[axis][1].of[k] = dominant[axis] & down[axis];
        }
    }
}

/* Splits the rays by dominant axis and side and walks each group. */
static void walk_packets(struct walk *w, struct trc_live mask, bool any) {
    struct trc_group group;
    struct trc_live rays[3][2];
    if (w->tree->root == TRC_REF_EMPTY)
        return;
    rays_split(w, &mask, rays);
    struct trc_group *const outer = w->group;
    w->group = &group;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < 2; side++) {
            const struct trc_live *r = &rays[axis][side];
            if (trc_live_any(r) && trc_group_setup(&group, w->packets, w->tree, r, axis, side))
                walk_group(w, *r, any);
        }
    w->group = outer;
}

/* ---- instances ---- */

/* World-to-object matrix of each lane's time: the key's inverse, or the inverse of the interpolated
 * matrix. */
TRC_INLINE void instance_inverse(const struct trc_instance *instance, vfloat time,
                                 vfloat inverse[12]) {
    if (instance->key_count < 2) {
        for (int k = 0; k < 12; k++)
            inverse[k] = vf_set(instance->world_to_object->m[k]);
        return;
    }
    vfloat m[12], f;
    const vint at = trc_wide_key(time, instance->key_count, &f) * vi_set(12);
    const float *base = instance->object_to_world->m;
    for (int k = 0; k < 12; k++)
        m[k] = trc_between(vf_gather(base + k, at, vm_all_set()),
                           vf_gather(base + 12 + k, at, vm_all_set()), f);
    const vvec3 r0 = v3(m[0], m[1], m[2]), r1 = v3(m[4], m[5], m[6]), r2 = v3(m[8], m[9], m[10]);
    const vvec3 c0 = v3_cross(r1, r2), c1 = v3_cross(r2, r0), c2 = v3_cross(r0, r1);
    const vfloat inv_det = vf_set(1.0f) / v3_dot(r0, c0);
    const vfloat rows[3][3] = {{c0.x, c1.x, c2.x}, {c0.y, c1.y, c2.y}, {c0.z, c1.z, c2.z}};
    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++)
            inverse[4 * r + k] = rows[r][k] * inv_det;
        inverse[4 * r + 3] =
            -(inverse[4 * r] * m[3] + inverse[4 * r + 1] * m[7] + inverse[4 * r + 2] * m[11]);
    }
}

/* The rays of mask in an instance's object space; distances keep their meaning. */
static void packet_transform(const struct trc_instance *instance, const struct trc_packet *p,
                             uint64_t mask, struct trc_packet *out) {
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        if (!trc_chunk_bits(mask, c))
            continue;
        const int i = c * TRC_WIDTH;
        vfloat m[12];
        instance_inverse(instance, vf_load(&p->time[i]), m);
        const vfloat ox = vf_load(&p->o[0][i]), oy = vf_load(&p->o[1][i]),
                     oz = vf_load(&p->o[2][i]);
        const vfloat dx = vf_load(&p->d[0][i]), dy = vf_load(&p->d[1][i]),
                     dz = vf_load(&p->d[2][i]);
        for (int r = 0; r < 3; r++) {
            vf_store(&out->o[r][i],
                     m[4 * r] * ox + m[4 * r + 1] * oy + m[4 * r + 2] * oz + m[4 * r + 3]);
            vf_store(&out->d[r][i], m[4 * r] * dx + m[4 * r + 1] * dy + m[4 * r + 2] * dz);
        }
        vf_store(&out->tmin[i], vf_load(&p->tmin[i]));
        vf_store(&out->t[i], vf_load(&p->t[i]));
        vf_store(&out->time[i], vf_load(&p->time[i]));
    }
    out->visibility = p->visibility;
    out->skip_transparent = p->skip_transparent;
    out->common_origin = p->common_origin && instance->key_count < 2;
}

/* The rays of mask through w's tree as w's instance has it. */
static void walk_instance(struct walk *w, struct trc_live mask, bool any) {
    struct trc_packet *const world = w->packets;
    struct trc_packet local[TRC_WALK_PACKETS];
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        if (mask.of[k] || k == 0) /* the first says what holds for all */
            packet_transform(&w->snapshot->instances[w->instance], &world[k], mask.of[k],
                             &local[k]);
    w->packets = local;
    walk_packets(w, mask, any);
    for (int c = 0; c < TRC_WALK_CHUNKS && !any; c++) {
        const uint32_t bits = trc_live_bits(&mask, c);
        const int k = c / TRC_PACKET_CHUNKS, i = c % TRC_PACKET_CHUNKS * TRC_WIDTH;
        if (bits)
            vf_store(&world[k].t[i], vf_select(vm_from_bits(bits), vf_load(&local[k].t[i]),
                                               vf_load(&world[k].t[i])));
    }
}

static void item_packet(struct walk *w, const struct trc_item *item, struct trc_live mask,
                        bool any) {
    if (!(item->visibility & w->packets->visibility))
        return;
    const struct walk outer = *w;
    w->tree = item->tree;
    w->instance = item->instance;
    if (item->instance == TRC_NO_HIT) { /* in world space, within the TLAS: the same beam */
        const float z1 = w->group->beam.z1;
        walk_group(w, mask, any);
        w->group->beam.z1 = z1;
    } else {
        walk_instance(w, mask, any);
    }
    const struct trc_live occluded = w->occluded;
    *w = outer;
    w->occluded = occluded;
}

/* Traces the active rays of the packets. Returns the mask of those of each that are occluded, or
 * none of closest hits. */
static struct trc_live walk_run(const struct trc_snapshot *snapshot, struct trc_packet *packets,
                                struct trc_packet_hits *hits, uint32_t count, bool any) {
    struct trc_live active = {{0}};
    struct walk w = {.snapshot = snapshot,
                     .tree = snapshot->bvh->tree,
                     .packets = packets,
                     .hits = hits,
                     .instance = TRC_NO_HIT};
    for (uint32_t k = 0; k < count; k++)
        active.of[k] = packets[k].active;
    if (trc_live_any(&active))
        walk_packets(&w, active, any);
    for (uint32_t k = 0; k < count; k++)
        w.occluded.of[k] &= active.of[k];
    return w.occluded;
}

#endif
