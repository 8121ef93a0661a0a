/* Streams: few rays on their way together. A node is met once for all of them, each against its
 * eight boxes, which cost as much as they would alone, but order, stack and fetches are shared.
 *
 * Rasmus Barringer, Tomas Akenine-Moller, "Dynamic Ray Stream Traversal", 2014, keep streams from
 * the root on; here packets end in them. Rays share their dominant axis: near boxes come first for
 * all. */
#ifndef TRACER_KERNELS_TRACE_WALK_STREAM_H
#define TRACER_KERNELS_TRACE_WALK_STREAM_H

#include "kernels/trace/walk_curves.h"

static void item_packet(struct walk *w, const struct trc_item *item, struct trc_live mask,
                        bool any);

struct stream {
    float inv[3][TRC_STREAM_SIZE], shift[3][TRC_STREAM_SIZE]; /* 1 / d, -o / d */
    float tmin[TRC_STREAM_SIZE], t[TRC_STREAM_SIZE];
    float f[TRC_STREAM_SIZE];      /* moving trees: position between the keys */
    uint16_t ray[TRC_STREAM_SIZE]; /* packet * TRC_PACKET_SIZE + its number there */
    int count;
    uint32_t alive; /* any only: bits of those that are not occluded */
};

/* A subtree to visit. */
struct stream_entry {
    uint32_t ref, rays; /* rays: bits, into the stream */
    float near;         /* closest only: the least distance at which one of them meets its box */
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
    s->count = n;
}

/* Those of a stream's rays that have no hit before a distance. */
TRC_INLINE uint32_t stream_beyond(const struct stream *s, uint32_t rays, float distance) {
    uint32_t beyond = 0;
    for (int i = 0; i < s->count; i += 8)
        beyond |= f8_le(f8_set(distance), f8_load(&s->t[i])) << i;
    return rays & beyond;
}

/* Boxes of a node's children, wider by the slack; in motion at the first key, and the ways to the
 * next. */
struct stream_boxes {
    f8 low[3], high[3], low_way[3], high_way[3];
};
TRC_INLINE void stream_boxes_load(const struct walk *w, uint32_t node, bool motion,
                                  struct stream_boxes *out) {
    if (!motion) {
        const float *b = trc_node_bounds(w->tree, node);
        const f8 slack = f8_set(w->group->beam.slack);
        for (int axis = 0; axis < 3; axis++) {
            out->low[axis] = f8_load(b + 16 * axis) - slack;
            out->high[axis] = f8_load(b + 16 * axis + 8) + slack;
        }
        return;
    }
    const struct trc_packed_boxes *packed = trc_node_packed(w->tree, node, w->key);
    const f8 slack = f8_set((1.0f + TRC_UNPACK_SLACK) * w->group->beam.slack);
    trc_boxes_unpack(packed, out->low, out->high);
    trc_boxes_unpack(packed + 1, out->low_way, out->high_way);
    for (int axis = 0; axis < 3; axis++) {
        out->low_way[axis] -= out->low[axis];
        out->high_way[axis] -= out->high[axis];
        out->low[axis] -= slack;
        out->high[axis] += slack;
    }
}

/* For each child of a node the rays that meet its box, and for closest hits the least distance at
 * which one does; returns the bits of children with any. */
TRC_INLINE uint32_t stream_node(const struct walk *w, uint32_t node, const struct stream *s,
                                uint32_t rays, bool any, bool motion, uint32_t met[TRC_NODE_WIDTH],
                                float nearest[TRC_NODE_WIDTH]) {
    struct stream_boxes boxes;
    stream_boxes_load(w, node, motion, &boxes);
    i8x children, all = {0};
    f8 least = f8_set(INFINITY);
    for (; rays; rays &= rays - 1) {
        const int i = __builtin_ctz(rays);
        f8 near = f8_set(s->tmin[i]), far = f8_set(s->t[i]);
        for (int axis = 0; axis < 3; axis++) {
            f8 l = boxes.low[axis], h = boxes.high[axis];
            if (motion) {
                const f8 f = f8_set(s->f[i]);
                l += f * boxes.low_way[axis];
                h += f * boxes.high_way[axis];
            }
            const f8 inv = f8_set(s->inv[axis][i]), shift = f8_set(s->shift[axis][i]);
            l = f8_madd(l, inv, shift);
            h = f8_madd(h, inv, shift);
            near = f8_max(near, f8_min(l, h));
            far = f8_min(far, f8_max(l, h));
        }
        all |= (i8x)(near <= far) & (int32_t)(1u << i);
        if (!any)
            least = f8_min(least, f8_select_le(near, far, near, f8_set(INFINITY)));
    }
    if (!any)
        f8_store(nearest, least);
    memcpy(&children, trc_node_children(w->tree, node), sizeof children);
    all &= children != (int32_t)TRC_REF_EMPTY; /* inverted boxes are met, too */
    memcpy(met, &all, sizeof all);
    return i8_nonzero(all);
}

#define CACHE_LINE 64
#define NODE_LINES ((TRC_NODE_CHILDREN_BYTES + TRC_NODE_BOUNDS_BYTES + CACHE_LINE - 1) / CACHE_LINE)
#define MOVING_NODE_LINES 3 /* with two keys */
#define MOVING_LEAF_LINES 3 /* three triangles, five vertices, two keys: 144 bytes */
#define LEAF_LINES 2        /* a leaf is of three triangles, mostly */
/* Asks for the memory of what waits on a stack; a TLAS is small. */
TRC_INLINE void ref_prefetch(const struct walk *w, uint32_t ref, bool any, bool motion,
                             bool curves) {
    const bool is_leaf = ref & TRC_REF_LEAF;
    if (!curves && w->tree->is_top)
        return;
    if (curves && is_leaf) {
        __builtin_prefetch(trc_leaf_slots(w->tree, ref));
        return;
    }
    const char *at = (const char *)trc_node_children(w->tree, ref);
    if (is_leaf)
        at = motion ? (const char *)trc_leaf_block(w->tree, ref)
                    : (const char *)trc_leaf_vertices(w->tree, ref);
    const int node_lines = motion ? MOVING_NODE_LINES : NODE_LINES;
    const int leaf_lines = motion ? MOVING_LEAF_LINES : LEAF_LINES;
    for (int line = 0; line < (is_leaf ? leaf_lines : node_lines); line++)
        __builtin_prefetch(at + line * CACHE_LINE);
    if (is_leaf && !any && !motion)
        __builtin_prefetch(trc_leaf_slots(w->tree, ref));
}

/* Pushes the children that are met: to the closest hit the nearest on top, to any in any order. */
TRC_INLINE int stream_push(const struct walk *w, uint32_t node, uint32_t bits,
                           const uint32_t met[TRC_NODE_WIDTH], const float nearest[TRC_NODE_WIDTH],
                           bool any, bool motion, bool curves, struct stream_entry *stack,
                           int top) {
    const uint32_t *children = trc_node_children(w->tree, node);
    const int bottom = top;
    for (; bits; bits &= bits - 1) {
        const int child = __builtin_ctz(bits);
        const struct stream_entry entry = {children[child], met[child],
                                           any ? 0.0f : nearest[child]};
        int at = top++;
        ref_prefetch(w, entry.ref, any, motion, curves);
        for (; !any && at > bottom && stack[at - 1].near < entry.near; at--)
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
    item_packet(w, &w->tree->items[trc_ref_index(ref)], live, any);
    for (uint32_t m = rays; m; m &= m - 1) {
        const int i = __builtin_ctz(m);
        const uint32_t k = s->ray[i] / TRC_PACKET_SIZE, ray = s->ray[i] % TRC_PACKET_SIZE;
        if (any && (w->occluded.of[k] >> ray & 1u))
            s->alive &= ~(1u << i);
        s->t[i] = w->packets[k].t[ray];
    }
}

TRC_INLINE void stream_leaf(struct walk *w, uint32_t ref, struct stream *s, uint32_t rays, bool any,
                            bool motion, bool curves) {
    struct curve_leaf leaf;
    if (curves) {
        curve_leaf_load(w, ref, motion, &leaf);
        if (!motion)
            curve_leaf_place(w, &leaf, false, 0.0f);
    }
    for (; rays; rays &= rays - 1) {
        const int i = __builtin_ctz(rays);
        const int k = s->ray[i] / TRC_PACKET_SIZE, ray = s->ray[i] % TRC_PACKET_SIZE;
        const bool occluded = curves ? curve_leaf_single(w, &leaf, k, ray, any, motion)
                                     : leaf_single(w, ref, k, ray, any, motion);
        if (occluded) {
            w->occluded.of[k] |= 1ull << ray;
            s->alive &= ~(1u << i);
        }
        if (!any)
            s->t[i] = w->packets[k].t[ray];
    }
}

/* Walks live rays, at most TRC_STREAM_SIZE, through the subtree at ref. */
TRC_INLINE void stream_walk(struct walk *w, uint32_t ref, const struct trc_live *live, bool any,
                            bool motion, bool curves) {
    struct stream_entry stack[TRC_STACK_SIZE];
    struct stream s;
    int top = 0;
    stream_setup(w, live, motion, &s);
    for (uint32_t rays = s.alive;;) {
        if (!(ref & TRC_REF_LEAF)) {
            uint32_t met[TRC_NODE_WIDTH];
            float nearest[TRC_NODE_WIDTH];
            TRC_COUNT(single_nodes, __builtin_popcount(rays));
            uint32_t bits = stream_node(w, ref, &s, rays, any, motion, met, nearest);
            if (any && w->see_through)
                bits &= ~(uint32_t)w->see_through[ref];
            top = stream_push(w, ref, bits, met, nearest, any, motion, curves, stack, top);
        } else if (!curves && w->tree->is_top) {
            stream_item(w, ref, &s, rays, any);
        } else {
            stream_leaf(w, ref, &s, rays, any, motion, curves);
        }
        do {
            if (top == 0)
                return;
            ref = stack[--top].ref;
            rays = any ? stack[top].rays & s.alive
                       : stream_beyond(&s, stack[top].rays, stack[top].near);
        } while (!rays);
    }
}

#endif
