/* Shadow rays: sorted by light and by the place on it, traced as full packets, occlusion only.
 *
 * Boulos et al. 2007, section 3.3: shadow rays are assembled apart from others. Rays of a packet go
 * from neighbouring points to the same part of the same light. Where materials let shadow rays
 * through, those that nothing opaque blocks go on in kernels/tile/see_through.c. */
#include "kernels/light/clamp.h"
#include "kernels/light/light.h"
#include "kernels/tile/light_split.h"
#include "kernels/tile/shadow_bundle.h"

/* Clamps what of the rays' light has arrived; the parts of a ray by one factor. All light samples
 * of a hit share its limit. */
static void light_clamp(struct trc_tile *t) {
    const struct trc_shadow_store *q = &t->shadows;
    const vint exempt = vi_set(TRC_PATH_CLAMPED), single = vi_set(TRC_PATH_OCCLUSION);
    const vfloat one = vf_set(1.0f), share = vf_set(1.0f / (float)t->desc->light_samples);
    for (uint32_t i = 0; i < q->count; i += TRC_WIDTH) {
        const vuint depths = (vuint)vi_load((const int32_t *)q->depths + i);
        const vmask is_direct = vi_eq((vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT), vi_set(0));
        const vint path = vi_load((const int32_t *)q->path + i);
        const vmask shared = vm_and(is_direct, vi_eq(path & single, vi_set(0)));
        vfloat limit = trc_clamp_limit(t->desc, is_direct) * vf_select(shared, share, one);
        if (q->split_scale)
            limit = limit * vf_load(q->split_scale + i);
        const vvec3 light = v3(vf_load(q->radiance[0] + i), vf_load(q->radiance[1] + i),
                               vf_load(q->radiance[2] + i));
        const vfloat factor =
            vf_select(vi_eq(path & exempt, exempt), one, trc_clamp_factor(light, limit));
        for (int k = 0; k < 3; k++)
            vf_store(q->radiance[k] + i, vf_load(q->radiance[k] + i) * factor);
        for (int k = 0; t->light_passes && k < 9; k++)
            vf_store(q->split[k] + i, vf_load(q->split[k] + i) * factor);
    }
}

/* Adds what a ray carries to the passes of light by kind. */
static void passes_add(struct trc_tile *t, uint32_t ray) {
    static const uint32_t direct[3] = {TRC_PASS_DIFFUSE_DIRECT, TRC_PASS_GLOSSY_DIRECT,
                                       TRC_PASS_TRANSMISSION_DIRECT};
    const struct trc_shadow_store *q = &t->shadows;
    const uint32_t slot = q->slot[ray], path = q->path[ray];
    if ((path >> TRC_PATH_CATEGORY_SHIFT & 3u) != TRC_CATEGORY_CAMERA) {
        const float rgb[3] = {q->radiance[0][ray], q->radiance[1][ray], q->radiance[2][ray]};
        const bool is_direct =
            (path & TRC_PATH_FOUND) && (q->depths[ray] >> TRC_DEPTH_ALL_SHIFT & 255u) < 2;
        trc_light_split_add(t, path, q->share[ray], is_direct, slot, rgb);
        return;
    }
    for (int k = 0; k < 3; k++) {
        const float part[3] = {q->split[3 * k][ray], q->split[3 * k + 1][ray],
                               q->split[3 * k + 2][ray]};
        trc_pass_add(t, direct[k], slot, part);
    }
}

/* Adds what rays found to the passes of ambient occlusion and shadow. Those of ambient occlusion
 * carry no light besides. */
static void occlusion_add(struct trc_tile *t) {
    struct trc_shadow_store *q = &t->shadows;
    for (uint32_t i = 0; i < q->count; i++) {
        if (q->lamp[0]) {
            const float lamp[3] = {q->lamp[0][i], q->lamp[1][i], q->lamp[2][i]};
            trc_pass_add(t, TRC_PASS_SHADOW, q->slot[i], lamp);
        }
        if (!(q->path[i] & TRC_PATH_OCCLUSION))
            continue;
        const float open[3] = {q->radiance[0][i], q->radiance[1][i], q->radiance[2][i]};
        trc_pass_add(t, TRC_PASS_AMBIENT_OCCLUSION, q->slot[i], open);
        trc_shadow_scale(q, i, 0.0f, 0.0f, 0.0f);
    }
}

/* Adds light to the passes of light groups. */
static void groups_add(struct trc_tile *t) {
    const struct trc_shadow_store *q = &t->shadows;
    for (uint32_t i = 0; i < q->count; i++) {
        const float rgb[3] = {q->radiance[0][i], q->radiance[1][i], q->radiance[2][i]};
        const uint32_t light = q->target[i] / TRC_DIRECTION_CELLS;
        const uint32_t group = trc_light_group(t->snapshot, light);
        if (group)
            trc_pass_add(t, TRC_PASS_LIGHT_GROUP(group - 1), q->slot[i], rgb);
    }
}

/* Takes what the blocked rays of a packet carry. Those that may still meet something transparent
 * come to waiting, which may begin at order; returns how many. order: the packet's rays. */
static uint32_t packet_take(struct trc_tile *t, const struct trc_packet *p, const uint32_t *order,
                            uint64_t blocked, uint32_t *waiting) {
    uint32_t count = 0;
    t->job->counts.rays_shadow += (uint64_t)__builtin_popcountll(p->active);
    for (uint64_t bits = blocked; bits; bits &= bits - 1)
        trc_shadow_scale(&t->shadows, order[__builtin_ctzll(bits)], 0.0f, 0.0f, 0.0f);
    for (uint64_t bits = p->skip_transparent ? p->active & ~blocked : 0; bits; bits &= bits - 1)
        waiting[count++] = order[__builtin_ctzll(bits)];
    return count;
}

/* Traces the rays [begin, end) of the order, which see what has that visibility. What waits is
 * written over those that were traced. */
static void rays_trace(struct trc_tile *t, uint32_t begin, uint32_t end, uint32_t visibility) {
    uint32_t *const rays = t->shadows.order + begin;
    const uint32_t count = end - begin;
    uint32_t waiting = 0;
    for (uint32_t at = 0; at < count;) {
        const uint32_t *order = rays + at;
        const struct trc_shadow_bundle b =
            trc_shadow_bundle_load(t, order, count - at, visibility, NULL);
        uint64_t blocked[TRC_BUNDLE];
        trc_trace_occluded(t->snapshot, t->packets, b.packets, blocked);
        for (uint32_t k = 0; k < b.packets; order += b.counts[k++])
            waiting += packet_take(t, &t->packets[k], order, blocked[k], rays + waiting);
        at += b.rays;
    }
    if (waiting)
        trc_see_through(t, rays, waiting, visibility);
}

/* Moves unblocked rays behind the others, each kind in its order. Returns how many others there
 * are. */
static uint32_t unblocked_last(struct trc_tile *t) {
    struct trc_shadow_store *q = &t->shadows;
    uint32_t others = 0, unblocked = 0;
    for (uint32_t i = 0; i < q->count; i++) {
        const uint32_t ray = q->order[i];
        if (q->path[ray] & TRC_VISIBLE_UNBLOCKED)
            t->keys[unblocked++] = ray;
        else
            q->order[others++] = ray;
    }
    memcpy(q->order + others, t->keys, unblocked * sizeof *q->order);
    return others;
}

/* Traces the rays [begin, end) of the order. blockers: what is in the way of shadow rays; in that
 * of rays that stand for those of lobes is what these see. shift: where the bits of both stand. */
static void lit_trace(struct trc_tile *t, uint32_t begin, uint32_t end, uint32_t blockers,
                      uint32_t shift) {
    struct trc_shadow_store *q = &t->shadows;
    if (!(t->snapshot->features & TRC_FEATURE_RAY_KINDS)) {
        rays_trace(t, begin, end, blockers << shift);
        return;
    }
    while (begin < end) {
        const uint32_t kind = trc_ray_visibility(q->path[q->order[begin]]);
        uint32_t same = begin, others = 0;
        for (uint32_t i = begin; i < end; i++) {
            const uint32_t ray = q->order[i];
            if (trc_ray_visibility(q->path[ray]) == kind)
                q->order[same++] = ray;
            else
                t->keys[others++] = ray;
        }
        memcpy(q->order + same, t->keys, others * sizeof *q->order);
        rays_trace(t, begin, same, (kind == TRC_VISIBLE_SHADOW ? blockers : kind) << shift);
        begin = same;
    }
}

/* What blocks rays whose path words have that shadow class and TRC_PATH_FOUND, class by class. */
static uint32_t blockers(uint32_t kind) {
    const uint32_t class = kind >> 1, is_found = kind & 1;
    if (!class)
        return TRC_VISIBLE_SHADOW;
    return 1u << (TRC_SHADOW_CLASS_SHIFT + class - 1) | (is_found ? TRC_VISIBLE_SOLID : 0u);
}
_Static_assert(TRC_PATH_FOUND == 1 << (TRC_PATH_CLASS_SHIFT - 1),
               "kinds of rays are whole numbers");

/* Traces the first count rays of the order, those of each kind by themselves. */
static void kinds_trace(struct trc_tile *t, uint32_t count) {
    struct trc_shadow_store *q = &t->shadows;
    uint32_t begin = 0;
    for (uint32_t kind = 0; kind < 2 * (t->snapshot->shadow_class_count + 1); kind++) {
        uint32_t end = begin, others = 0;
        for (uint32_t i = begin; i < count; i++) {
            const uint32_t ray = q->order[i];
            if (q->path[ray] >> (TRC_PATH_CLASS_SHIFT - 1) == kind)
                q->order[end++] = ray;
            else
                t->keys[others++] = ray;
        }
        memcpy(q->order + end, t->keys, others * sizeof *q->order);
        lit_trace(t, begin, end, blockers(kind), 0);
        begin = end;
    }
}

void trc_shadow_flush(struct trc_tile *t) {
    struct trc_shadow_store *q = &t->shadows;
    if (!q->count)
        return;
    trc_clock_trace(t);
    for (uint32_t i = 0; i < q->count; i++)
        t->keys[i] = q->target[i] < TRC_BINS ? q->target[i] : TRC_BINS - 1;
    trc_tile_sort(t, t->keys, q->count, q->order);
    memset(q->order + q->count, 0, TRC_PACKET_SIZE * sizeof *q->order);
    const uint32_t blocked = t->catchers ? unblocked_last(t) : q->count;
    if (t->snapshot->shadow_class_count)
        kinds_trace(t, blocked);
    else
        lit_trace(t, 0, blocked, TRC_VISIBLE_SHADOW, 0);
    lit_trace(t, blocked, q->count, TRC_VISIBLE_SHADOW, TRC_UNBLOCKED_SHIFT);
    if (trc_clamps(t->desc))
        light_clamp(t);
    if (t->occlusion_passes)
        occlusion_add(t);
    if (t->desc->light_group_count)
        groups_add(t);
    for (uint32_t i = 0; i < q->count; i++) {
        const float rgb[3] = {q->radiance[0][i], q->radiance[1][i], q->radiance[2][i]};
        trc_sample_add(t, q->slot[i], rgb);
        if (t->light_passes)
            passes_add(t, i);
    }
    q->count = 0;
    trc_clock_shade(t);
}
