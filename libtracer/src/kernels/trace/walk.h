/* Traversal: packets at the top, streams of few rays where a packet has thinned out.
 *
 * Boulos et al. 2007: general packets against a BVH, first an interval cull of the whole packet,
 * then the first active ray. Departures, each by measurement: 8-wide nodes; the interval test is a
 * beam (kernels/trace/beam.h) against eight children in one step, as the first live ray is; all are
 * tried only when a child is taken from the stack, against distances as they are by then; a 64-bit
 * mask instead of a first active index; packets are split by dominant axis and its side; four
 * packets that stay together share one walk, for which this file is compiled twice
 * (TRC_WALK_PACKETS); rays that are few go on as a stream, each against eight boxes or eight
 * triangles at a time. Hits do not depend on any of it: candidates are tested by
 * kernels/trace/triangle.h and compared by distance, then by number.
 *
 * Other ways were measured: docs/measurements.md. */
#ifndef TRACER_KERNELS_TRACE_WALK_H
#define TRACER_KERNELS_TRACE_WALK_H

#include "kernels/trace/object_rays.h"
#include "kernels/trace/walk_stream.h"

/* A node whose children wait, so that it is read once: their boxes, wider by the slack; of moving
 * trees, hulled over the group's interval of time. */
struct opened {
    float planes[6][TRC_NODE_WIDTH]; /* low and high along u, v; near and far along z */
    float order[TRC_NODE_WIDTH];     /* minimum first; of closest hits, nearest mirrored z */
    struct trc_live mask;            /* rays that reached it */
    uint32_t first; /* bits of the children that the first of those meets; wide beams: none */
} __attribute__((aligned(64)));

/* A subtree to visit: a child of an opened node. */
struct entry {
    uint32_t ref;
    uint16_t level, child; /* level: of the opened node */
};

/* ---- bounds, static or moving ---- */

/* Boxes of a node's children: at rest, or hulled over the group's interval of time. */
TRC_INLINE void boxes_load(const struct walk *w, uint32_t node, bool motion, f8 lower[3],
                           f8 upper[3]) {
    if (!motion) {
        const float *b = trc_node_bounds(w->tree, node);
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = f8_load(b + 16 * axis);
            upper[axis] = f8_load(b + 16 * axis + 8);
        }
        return;
    }
    const struct trc_packed_boxes *packed = trc_node_packed(w->tree, node, w->key);
    const f8 f0 = f8_set(w->group->f_min), f1 = f8_set(w->group->f_max);
    const f8 slack = f8_set(TRC_UNPACK_SLACK * w->group->beam.slack);
    f8 later_lower[3], later_upper[3];
    trc_boxes_unpack(packed, lower, upper);
    trc_boxes_unpack(packed + 1, later_lower, later_upper);
    for (int axis = 0; axis < 3; axis++) {
        const f8 l = later_lower[axis] - lower[axis], h = later_upper[axis] - upper[axis];
        lower[axis] = f8_min(lower[axis] + f0 * l, lower[axis] + f1 * l) - slack;
        upper[axis] = f8_max(upper[axis] + f0 * h, upper[axis] + f1 * h) + slack;
    }
}

/* Bits of the children that a node has. */
TRC_INLINE uint32_t node_used(const struct trc_tree *tree, uint32_t node) {
    i8x children;
    memcpy(&children, trc_node_children(tree, node), sizeof children);
    return i8_nonzero(children != (int32_t)TRC_REF_EMPTY);
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
    for (int i = 0; i < TRC_PACKET_SIZE; i += TRC_WIDTH) {
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
        live |= (uint64_t)vm_bits(vf_le(near, far)) << i;
    }
    return live & mask;
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
    if (any && w->see_through)
        bits &= ~(uint32_t)w->see_through[node];
    if (motion)
        bits &= node_used(w->tree, node);
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

TRC_INLINE bool leaf_rays(struct walk *w, uint32_t ref, struct trc_live mask, bool any, bool motion,
                          bool curves) {
    if (curves)
        return curve_leaf_packet(w, ref, mask, any, motion);
    return leaf_packet(w, ref, mask, any, motion);
}

/* curves: what is in the tree's leaves. */
TRC_INLINE void packet_walk(struct walk *w, struct trc_live mask, bool any, bool motion,
                            bool curves) {
    struct entry stack[TRC_STACK_SIZE];
    struct opened opened[TRC_MAX_LEVELS + 1]; /* on the way to ref */
    uint16_t level = 0;
    bool together = w->group->beam.is_narrow;
    struct trc_live live = mask;
    uint32_t ref = w->tree->root;
    int top = 0;
    for (;;) {
        const int count = trc_live_count(&live);
        if (count <= (any ? TRC_STREAM_ANY : TRC_STREAM_CLOSEST)) {
            stream_walk(w, ref, &live, any, motion, curves);
        } else {
            TRC_COUNT(visits, 1);
            TRC_COUNT(visit_rays, count);
            if (!(ref & TRC_REF_LEAF)) {
                TRC_COUNT(nodes, 1);
                top = node_open(w, ref, &live, any, motion, level, &opened[level], stack, top);
            } else if (!curves && w->tree->is_top) {
                item_packet(w, &w->tree->items[trc_ref_index(ref)], live, any);
                if (!any)
                    beam_shorten(w, &mask);
            } else if (leaf_rays(w, ref, live, any, motion, curves) && !any) {
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

static void walk_any(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, true, false, false);
}
static void walk_closest(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, false, false);
}
static void walk_any_moving(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, true, true, false);
}
static void walk_closest_moving(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, true, false);
}
static void walk_any_curves(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, true, false, true);
}
static void walk_closest_curves(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, false, true);
}
static void walk_any_moving_curves(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, true, true, true);
}
static void walk_closest_moving_curves(struct walk *w, struct trc_live mask) {
    packet_walk(w, mask, false, true, true);
}

static void walk_curves(struct walk *w, struct trc_live mask, bool any, bool motion) {
    if (motion)
        (any ? walk_any_moving_curves : walk_closest_moving_curves)(w, mask);
    else
        (any ? walk_any_curves : walk_closest_curves)(w, mask);
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
        if (w->tree->shape)
            walk_curves(w, same, any, true);
        else
            (any ? walk_any_moving : walk_closest_moving)(w, same);
    }
}

/* The same of trees of curves. */
static void walk_curves_group(struct walk *w, struct trc_live mask, bool any) {
    struct trc_turned turned[TRC_WALK_PACKETS];
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        trc_turned_setup(&w->group->of[k], mask.of[k], &turned[k]);
    w->turned = turned;
    if (w->tree->key_count > 1)
        walk_segments(w, mask, any);
    else
        walk_curves(w, mask, any, false);
}

/* The rays of w's group through w's tree. */
static void walk_group(struct walk *w, struct trc_live mask, bool any) {
    if (w->tree->shape)
        walk_curves_group(w, mask, any);
    else if (w->tree->key_count > 1)
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

/* The rays of mask through w's tree as w's instance has it. */
static void walk_instance(struct walk *w, struct trc_live mask, bool any) {
    const struct trc_instance *instance = &w->snapshot->instances[w->instance];
    if (instance->is_identity | instance->in_world) { /* the tree is in world space */
        walk_packets(w, mask, any);
        return;
    }
    struct trc_packet *const world = w->packets;
    struct trc_packet local[TRC_WALK_PACKETS];
    for (int k = 0; k < TRC_WALK_PACKETS; k++)
        if (mask.of[k] || k == 0) /* the first says what holds for all */
            trc_packet_to_object(instance, &world[k], mask.of[k], &local[k]);
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

static void tree_enter(struct walk *w, const struct trc_tree *tree) {
    w->tree = tree;
    w->see_through = w->packets->skip_transparent ? tree->see_through : NULL;
}

static void item_packet(struct walk *w, const struct trc_item *item, struct trc_live mask,
                        bool any) {
    if (!(item->visibility & w->packets->visibility))
        return;
    const struct walk outer = *w;
    tree_enter(w, item->tree);
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
                                struct trc_packet_hits *hits, const uint32_t *left, uint32_t count,
                                bool any) {
    struct trc_live active = {{0}};
    struct walk w = {.snapshot = snapshot,
                     .packets = packets,
                     .hits = hits,
                     .left = left,
                     .instance = TRC_NO_HIT};
    for (uint32_t k = 0; k < count; k++)
        active.of[k] = packets[k].active;
    tree_enter(&w, snapshot->bvh->tree);
    if (trc_live_any(&active))
        walk_packets(&w, active, any);
    for (uint32_t k = 0; k < count; k++)
        w.occluded.of[k] &= active.of[k];
    return w.occluded;
}

#endif
