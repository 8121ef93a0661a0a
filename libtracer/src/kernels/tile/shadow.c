/* Shadow rays: sorted by light and by the place on it, traced as full packets, occlusion only.
 *
 * Boulos et al. 2007, section 3.3: shadow rays are assembled apart from others. Rays of a packet go
 * from neighbouring points to the same part of the same light. Where materials let shadow rays
 * through, packets that nothing opaque blocks are walked from surface to surface. */
#include "kernels/light/clamp.h"
#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"
#include "kernels/tile/light_split.h"
#include "kernels/tile/tile.h"

/* left: NULL where there are no curves. */
static void packet_load(const struct trc_tile *t, const uint32_t *order, uint32_t count,
                        uint32_t visibility, struct trc_packet *p, struct trc_left_strands *left) {
    const struct trc_shadow_store *q = &t->shadows;
    p->active = 0;
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vmask m = vm_first((int32_t)(count - i));
        const vint at = vi_load((const int32_t *)order + i);
        for (int axis = 0; axis < 3; axis++) {
            vf_store(&p->o[axis][i], vf_gather(q->o[axis], at, m));
            vf_store(&p->d[axis][i], vf_gather(q->d[axis], at, m));
        }
        vf_store(&p->tmin[i], vf_set(0.0f));
        const vfloat tmax = vf_gather(q->tmax, at, m);
        vf_store(&p->t[i], tmax);
        if (t->object_motion)
            vf_store(&p->time[i], vf_gather(q->time, at, m));
        /* Lights that cast no shadow have a negative reach: not traced, never occluded. */
        p->active |= (uint64_t)(vm_bits(vm_and(m, vf_gt(tmax, vf_set(0.0f))))) << i;
    }
    p->visibility = visibility;
    p->common_origin = false;
    p->skip_transparent = t->snapshot->features & TRC_FEATURE_TRANSPARENCY;
    p->left = left;
    for (uint32_t i = 0; left && i < count; i++) {
        left->instance[i] = q->strand_instance[order[i]];
        left->strand[i] = q->strand[order[i]];
    }
}

/* What the surfaces that the lanes' rays meet let through; 0 where a material is opaque to shadows.
 */
static vvec3 surface_transparency(struct trc_tile *t, const struct trc_packet *p,
                                  const struct trc_packet_hits *hits, int i, vmask active,
                                  vuint path) {
    vvec3 through = v3_zero();
    uint32_t todo = vm_bits(active);
    while (todo) {
        const int first = i + __builtin_ctz(todo);
        const uint32_t material =
            trc_hit_material(t->snapshot, hits->instance[first], hits->triangle[first]);
        uint32_t same = 0;
        for (uint32_t bits = todo; bits; bits &= bits - 1) {
            const int k = i + __builtin_ctz(bits);
            if (trc_hit_material(t->snapshot, hits->instance[k], hits->triangle[k]) == material)
                same |= bits & -bits;
        }
        todo &= ~same;
        const struct trc_material *m = t->snapshot->materials[material];
        if (!trc_material_shadows_transparent(m))
            continue;
        struct trc_surface s = {.snapshot = t->snapshot, .active = vm_from_bits(same)};
        struct trc_registers regs;
        struct trc_lobes lobes;
        s.instance = vi_load((const int32_t *)&hits->instance[i]);
        s.triangle = vi_load((const int32_t *)&hits->triangle[i]);
        s.u = vf_load(&hits->u[i]);
        s.v = vf_load(&hits->v[i]);
        s.time = t->object_motion ? vf_load(&p->time[i]) : vf_set(0.0f);
        s.wo = v3_normalize(
            v3_neg(v3(vf_load(&p->d[0][i]), vf_load(&p->d[1][i]), vf_load(&p->d[2][i]))));
        s.path = path;
        s.ray_length = vf_load(&p->t[i]);
        s.depth = s.diffuse_depth = s.glossy_depth = s.transmission_depth = s.transparent_depth =
            vi_set(0);
        s.footprint = s.pixel = s.raster_x = s.raster_y = vf_set(0.0f);
        trc_surface_fetch(&s);
        if (m->instruction_count)
            trc_program_run(m, &s, &regs);
        trc_lobes_setup(m, &s, &regs, vf_set(0.0f), &lobes);
        through = v3_select(vm_from_bits(same), trc_lobes_transparency(&lobes), through);
    }
    return through;
}

/* Lanes of the rays at order that may pass one more surface, having passed so many; those that
 * their path came through count, too. */
static vmask may_pass(const struct trc_tile *t, const uint32_t *order, vint passed, vmask m) {
    const vuint depths = vu_gather(t->shadows.depths, vi_load((const int32_t *)order), m);
    const vint before = (vint)trc_depth_of(depths, TRC_DEPTH_TRANSPARENT_SHIFT);
    return vm_and(m, vi_lt(before + passed, vi_set((int32_t)t->desc->max_transparent_depth)));
}

/* Lanes whose rays leave a ball that has taken its part where they came in: shadow rays of Cycles 5
 * meet each once. */
static vmask leaves_ball(const struct trc_packet_hits *hits, int i, vmask met) {
    return vm_and(met, vf_gt(vf_load(&hits->v[i]), vf_set(1.5f * TRC_CURVE_WITHIN)));
}

/* Walks a packet's rays, those at order, from surface to surface; factor: what of their light
 * arrives. Returns the rays that are blocked after all. */
static uint64_t transparency(struct trc_tile *t, struct trc_packet *p, const uint32_t *order,
                             float factor[3][TRC_PACKET_SIZE]) {
    struct trc_packet_hits *hits = t->packet_hits;
    float reach[TRC_PACKET_SIZE];
    int32_t passed[TRC_PACKET_SIZE] = {0};
    uint64_t blocked = 0;
    memcpy(reach, p->t, sizeof reach);
    while (p->active) {
        memset(hits->instance, 0xff, sizeof hits->instance);
        trc_trace_closest(t->snapshot, p, hits, 1);
        uint64_t next = 0;
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
            const int i = c * TRC_WIDTH;
            const uint32_t bits = trc_chunk_bits(p->active, c);
            const vmask met = vm_andnot(vm_from_bits(bits),
                                        vi_eq(vi_load((int32_t *)&hits->instance[i]), vi_set(-1)));
            if (!vm_any(met))
                continue;
            vvec3 f = v3_zero();
            const vmask leaves = p->left ? leaves_ball(hits, i, met) : vm_none();
            const vint before = vi_load(&passed[i]);
            const vmask open = vm_andnot(may_pass(t, order + i, before, met), leaves);
            vi_store(&passed[i], vi_select(leaves, before, before + vi_set(1)));
            if (vm_any(open))
                f = surface_transparency(t, p, hits, i, open, vu_set(TRC_VISIBLE_SHADOW));
            f = v3_select(leaves, v3_splat(vf_one()), f);
            const vfloat channel[3] = {f.x, f.y, f.z};
            for (int k = 0; k < 3; k++)
                vf_store(&factor[k][i], vf_select(met, vf_load(&factor[k][i]) * channel[k],
                                                  vf_load(&factor[k][i])));
            const vmask shut = vm_and(met, vf_le(v3_max(f), vf_set(0.0f)));
            blocked |= (uint64_t)vm_bits(shut) << i;
            next |= (uint64_t)vm_bits(vm_andnot(met, shut)) << i;
            vf_store(&p->tmin[i], vf_select(met, vf_load(&p->t[i]), vf_load(&p->tmin[i])));
            vf_store(&p->t[i], vf_load(&reach[i]));
        }
        p->active = next;
    }
    return blocked;
}

/* Scales what a ray carries by what of its light arrives. */
static void light_scale(struct trc_tile *t, uint32_t ray, float r, float g, float b) {
    struct trc_shadow_store *q = &t->shadows;
    const float factor[3] = {r, g, b};
    for (uint32_t k = 0; k < q->scaled_count; k += 3)
        for (uint32_t c = 0; c < 3; c++)
            q->scaled[k + c][ray] *= factor[c];
}

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
        const vfloat limit = trc_clamp_limit(t->desc, is_direct) * vf_select(shared, share, one);
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
        light_scale(t, i, 0.0f, 0.0f, 0.0f);
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

/* Takes from what a packet's rays carry what does not arrive; blocked: by what is opaque. */
static void packet_take(struct trc_tile *t, struct trc_packet *p, const uint32_t *order,
                        uint32_t count, uint64_t blocked) {
    t->job->counts.rays_shadow += (uint64_t)__builtin_popcountll(p->active);
    if (t->snapshot->features & TRC_FEATURE_TRANSPARENCY) {
        float factor[3][TRC_PACKET_SIZE];
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < TRC_PACKET_SIZE; i++)
                factor[k][i] = 1.0f;
        p->active &= ~blocked;
        blocked |= transparency(t, p, order, factor);
        for (uint32_t i = 0; i < count; i++)
            light_scale(t, order[i], factor[0][i], factor[1][i], factor[2][i]);
    }
    for (; blocked; blocked &= blocked - 1)
        light_scale(t, order[__builtin_ctzll(blocked)], 0.0f, 0.0f, 0.0f);
}

/* Traces the rays [begin, end) of the order, which see what has that visibility, in bundles of
 * packets that go to one place of a light. */
static void rays_trace(struct trc_tile *t, uint32_t begin, uint32_t end, uint32_t visibility) {
    const struct trc_shadow_store *q = &t->shadows;
    while (begin < end) {
        const uint32_t *order = q->order + begin;
        uint32_t packets = 0, taken = 0, counts[TRC_BUNDLE];
        do {
            const uint32_t left = end - begin - taken;
            const uint32_t count = left < t->packet_size ? left : t->packet_size;
            packet_load(t, order + taken, count, visibility, &t->packets[packets],
                        t->left ? &t->left[packets] : NULL);
            counts[packets++] = count;
            taken += count;
        } while (packets < t->bundle && begin + taken < end &&
                 q->target[order[taken]] == q->target[order[0]]);
        uint64_t blocked[TRC_BUNDLE];
        trc_trace_occluded(t->snapshot, t->packets, packets, blocked);
        for (uint32_t k = 0; k < packets; order += counts[k++])
            packet_take(t, &t->packets[k], order, counts[k], blocked[k]);
        begin += taken;
    }
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
        rays_trace(t, begin, end, blockers(kind));
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
        rays_trace(t, 0, blocked, TRC_VISIBLE_SHADOW);
    rays_trace(t, blocked, q->count, TRC_VISIBLE_SHADOW << TRC_UNBLOCKED_SHIFT);
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
