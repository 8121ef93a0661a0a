/* Shadow rays that nothing opaque blocks, on their way through what is transparent: from surface to
 * surface, all of the queue one surface at a time, so that packets are full again where many rays
 * have ended. */
#include "kernels/simd/wide_math.h"
#include "kernels/tile/shadow_bundle.h"

/* How far apart neighbouring rays are where they meet a material, of scenes with
 * TRC_FEATURE_SHADOW_SLOPES. order: of the rays; length: how far they have come. */
static __attribute__((noinline)) vfloat pixel_of(const struct trc_shadow_store *q,
                                                 const struct trc_material *m, vint order,
                                                 vfloat length, vmask lanes) {
    const vfloat pixel = vf_gather(q->pixel, order, lanes);
    return m->flags & TRC_MATERIAL_WIDE_SHADOWS
               ? pixel + length * vf_gather(q->spread, order, lanes)
               : pixel;
}

/* What a path word's bit adds to the counter at shift. */
static vuint counted(vuint path, uint32_t bit, int shift) {
    const vmask has = vm_not(vi_eq((vint)(path & vu_set(bit)), vi_set(0)));
    return (vuint)vi_select(has, vi_set(1 << shift), vi_set(0));
}

/* What Light Path tells of the rays at order: one bounce beyond those of what they left, which
 * counts among its kind where they stand for rays of lobes. */
static void path_load(const struct trc_shadow_store *q, vint order, struct trc_surface *s) {
    const vuint depths = vu_gather(q->depths, order, s->active);
    s->path = vu_gather(q->path, order, s->active);
    s->depths = trc_depths_beyond(depths, TRC_DEPTH_ALL_SHIFT) +
                counted(s->path, TRC_VISIBLE_GLOSSY, TRC_DEPTH_GLOSSY_SHIFT) +
                counted(s->path, TRC_VISIBLE_TRANSMISSION, TRC_DEPTH_TRANSMISSION_SHIFT) +
                (vu_gather(q->passed, order, s->active) << TRC_DEPTH_TRANSPARENT_SHIFT);
}

/* The lanes whose rays stand for those of lobes. */
static vmask are_of_lobes(const struct trc_tile *t, vint order, vmask active) {
    const vuint path = vu_gather(t->shadows.path, order, active);
    return vm_and(active, vi_eq((vint)(path & vu_set(TRC_VISIBLE_SHADOW)), vi_set(0)));
}

/* What the surfaces that the lanes' rays meet let through; 0 where a material is opaque to shadows.
 * order: of the rays. */
static vvec3 surface_transparency(const struct trc_tile *t, const struct trc_packet *p,
                                  const struct trc_packet_hits *hits, int i, vint order,
                                  vmask active) {
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
        struct trc_surface s = {.snapshot = t->snapshot, .active = vm_from_bits(same)};
        if (!trc_material_shadows_transparent(m))
            s.active = are_of_lobes(t, order, s.active);
        if (!trc_material_is_clear(m) || !vm_any(s.active))
            continue;
        if (m->shadow)
            m = m->shadow;
        struct trc_registers regs;
        struct trc_lobes lobes;
        s.instance = vi_load((const int32_t *)&hits->instance[i]);
        s.triangle = vi_load((const int32_t *)&hits->triangle[i]);
        s.u = vf_load(&hits->u[i]);
        s.v = vf_load(&hits->v[i]);
        s.time = t->object_motion ? vf_load(&p->time[i]) : vf_set(0.0f);
        const vvec3 d = v3(vf_load(&p->d[0][i]), vf_load(&p->d[1][i]), vf_load(&p->d[2][i]));
        s.wo = v3_normalize(v3_neg(d));
        s.ray_length = vf_load(&p->t[i]) * v3_length(d); /* those to lamps end at 1 */
        path_load(&t->shadows, order, &s);
        s.footprint = s.pixel = s.raster_x = s.raster_y = vf_set(0.0f);
        if (t->shadows.pixel)
            s.pixel = pixel_of(&t->shadows, m, order, s.ray_length, s.active);
        trc_surface_fetch(&s);
        if (m->instruction_count)
            trc_program_run(m, &s, &regs);
        trc_lobes_setup(m, &s, &regs, vf_set(0.0f), &lobes);
        through = v3_select(s.active, trc_lobes_transparency(&lobes), through);
    }
    return through;
}

/* Lanes whose rays, those at order, may pass one more surface; those that their path came through
 * count, too. */
static vmask may_pass(const struct trc_tile *t, vint order, vmask m) {
    const vuint depths = vu_gather(t->shadows.depths, order, m);
    const vint passed = (vint)vu_gather(t->shadows.passed, order, m);
    const vint before = (vint)trc_depth_of(depths, TRC_DEPTH_TRANSPARENT_SHIFT);
    return vm_and(m, vi_lt(before + passed, vi_set((int32_t)t->desc->max_shadow_depth)));
}

/* Lanes whose rays leave a ball that has taken its part where they came in: shadow rays of Cycles 5
 * meet each once. */
static vmask leaves_ball(const struct trc_packet_hits *hits, int i, vmask met) {
    return vm_and(met, vf_gt(vf_load(&hits->v[i]), vf_set(1.5f * TRC_CURVE_WITHIN)));
}

/* Takes from the rays of a chunk what the surfaces that they met leave of their light. Those that
 * go on come to waiting; returns how many. order: the packet's rays. */
static uint32_t chunk_take(struct trc_tile *t, const struct trc_packet *p,
                           const struct trc_packet_hits *hits, int i, const uint32_t *order,
                           uint32_t *waiting) {
    struct trc_shadow_store *q = &t->shadows;
    const vmask met = vm_andnot(vm_from_bits(trc_chunk_bits(p->active, i / TRC_WIDTH)),
                                vi_eq(vi_load((const int32_t *)&hits->instance[i]), vi_set(-1)));
    if (!vm_any(met))
        return 0;
    const vmask leaves = p->left ? leaves_ball(hits, i, met) : vm_none();
    const vint own = vi_load((const int32_t *)order + i);
    const vmask open = may_pass(t, own, vm_andnot(met, leaves));
    vvec3 through = v3_zero();
    if (vm_any(open))
        through = surface_transparency(t, p, hits, i, own, open);
    through = v3_select(leaves, v3_splat(vf_one()), through);
    float factor[3][TRC_WIDTH];
    vf_store(factor[0], through.x);
    vf_store(factor[1], through.y);
    vf_store(factor[2], through.z);
    const uint32_t goes_on = vm_bits(vf_gt(v3_max(v3_abs(through)), vf_zero()));
    const uint32_t counts = vm_bits(vm_andnot(met, leaves));
    uint32_t count = 0;
    for (uint32_t bits = vm_bits(met); bits; bits &= bits - 1) {
        const int k = __builtin_ctz(bits);
        const uint32_t ray = order[i + k];
        trc_shadow_scale(q, ray, factor[0][k], factor[1][k], factor[2][k]);
        q->tmin[ray] = p->t[i + k];
        q->passed[ray] += counts >> k & 1u;
        if (goes_on >> k & 1u)
            waiting[count++] = ray;
    }
    return count;
}

void trc_see_through(struct trc_tile *t, uint32_t *rays, uint32_t count, uint32_t visibility) {
    struct trc_shadow_store *q = &t->shadows;
    for (uint32_t i = 0; i < count; i++) {
        q->tmin[rays[i]] = 0.0f;
        q->passed[rays[i]] = 0;
    }
    while (count) {
        uint32_t waiting = 0;
        for (uint32_t begin = 0; begin < count;) {
            const uint32_t *order = rays + begin;
            const struct trc_shadow_bundle b =
                trc_shadow_bundle_load(t, order, count - begin, visibility, q->tmin);
            for (uint32_t k = 0; k < b.packets; k++)
                memset(t->packet_hits[k].instance, 0xff, sizeof t->packet_hits[k].instance);
            trc_trace_closest(t->snapshot, t->packets, t->packet_hits, b.packets);
            for (uint32_t k = 0; k < b.packets; order += b.counts[k++])
                for (int i = 0; i < (int)b.counts[k]; i += TRC_WIDTH)
                    waiting +=
                        chunk_take(t, &t->packets[k], &t->packet_hits[k], i, order, rays + waiting);
            begin += b.rays;
        }
        count = waiting;
    }
}
