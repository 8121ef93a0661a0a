/* Lights whose shadows are linked, as rays find them that surfaces reflect or let through. What
 * such a ray meets need not block such a light, so along it goes a shadow ray to each of those
 * lights, which their own blockers stop and, as in Cycles from 4.0 on, what is opaque and no
 * light's blocker. The camera sees these lights as any. */
#include "kernels/tile/shade.h"

/* Lanes that bounced and did not come straight on: each ray looks for lights once. */
static vmask looks_for_lights(const struct arrival *a) {
    const vint camera = (vint)(a->path & vu_set(TRC_VISIBLE_CAMERA));
    const vmask fresh = vf_le(a->tmin, vf_set(0.0f));
    return vm_and(a->active, vm_and(fresh, vi_eq(camera, vi_set(0))));
}

/* Sends shadow rays along the lanes' rays, to what is at that distance and carries that radiance.
 */
static void found_push(struct trc_tile *t, const struct arrival *a, vvec3 radiance, vfloat distance,
                       vint light, vmask casts_shadow, vmask active) {
    vvec3 c = v3_mul(a->found_weight, radiance);
    active = vm_and(active, is_light(v3_max(v3_abs(c))));
    if (!vm_any(active))
        return;
    if (trc_clamps(t->desc))
        c = v3_scale(c, trc_clamp_factor(c, found_limit(t, a)));
    const vmask far = vf_ge(distance, vf_set(TRC_FAR));
    const vfloat end = vf_select(far, vf_set(INFINITY), vf_set(SHADOW_END));
    const vvec3 target = v3_scale(a->d, vf_select(far, vf_set(1.0f), distance));
    const vuint path = vu_set(TRC_PATH_FOUND | TRC_PATH_CLAMPED | TRC_VISIBLE_SHADOW) |
                       trc_light_shadow_class(t->snapshot, light, active) << TRC_PATH_CLASS_SHIFT;
    const struct trc_shadow_rays rays = {
        .o = {a->o.x, a->o.y, a->o.z},
        .d = {target.x, target.y, target.z},
        .tmax = vf_select(casts_shadow, end, vf_set(-1.0f)),
        .time = a->time,
        .radiance = {c.x, c.y, c.z},
        .slot = a->slot,
        .path = (a->path & vu_set(~(TRC_PATH_FEATURES | TRC_PATH_KIND))) | path,
        .target = (vuint)light * vu_set(TRC_DIRECTION_CELLS) + trc_direction_cell(a->d),
        .depths = a->depths,
    };
    trc_shadow_reserve(t, 1);
    struct trc_shadow_store *q = &t->shadows;
    const uint32_t bits = vm_bits(active), at = trc_shadows_append(q, &rays, bits);
    for (uint32_t k = 3; k < q->scaled_count; k++) /* of the passes of first surfaces */
        vf_compress(q->scaled[k] + at, vf_set(0.0f), bits);
    if (t->light_passes)
        vu_compress(q->share + at, word_column(t->work.w[TRC_RAY_SHARE], a), bits);
    if (q->split_scale)
        vf_compress(q->split_scale + at, split_scale(t, a), bits);
    if (q->pixel) { /* the path ends here: nothing says how far its rays go apart */
        vf_compress(q->pixel + at, vf_set(0.0f), bits);
        vf_compress(q->spread + at, vf_set(0.0f), bits);
    }
}

static void find_lamps(struct trc_tile *t, const struct arrival *a, vmask active) {
    const struct trc_light_table *lights = t->snapshot->lights;
    const struct trc_light_ray ray = light_ray(t, a, vf_set(TRC_FAR));
    for (uint32_t i = 0; i < lights->group_seen[TRC_MAX_LIGHT_GROUPS + 1]; i++) {
        const uint32_t number = lights->seen[i];
        const struct trc_lamp *lamp = &lights->lamps[number];
        if (!lamp->shadow_class)
            continue;
        vfloat distance = vf_set(TRC_FAR);
        const vvec3 c = trc_light_hit_one(t->snapshot, &ray, number, active, &distance);
        const vmask casts = lamp->flags & TRC_LAMP_CASTS_SHADOW ? vm_all_set() : vm_none();
        found_push(t, a, c, distance, vi_set((int32_t)number), casts, active);
    }
}

/* Lanes whose kind of ray sees what they met. */
static vmask is_visible(const struct arrival *a, const struct trc_surface *s, vmask active) {
    uint32_t path[TRC_WIDTH], seen = 0;
    vu_store(path, a->path);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const uint32_t visibility = s->snapshot->instances[vi_get(s->instance, i)].visibility;
        seen |= (uint32_t)((visibility & trc_ray_visibility(path[i])) != 0) << i;
    }
    return vm_from_bits(seen);
}

/* Lanes of active whose surfaces have the material of the first of them. */
static vmask same_material(const struct trc_snapshot *snapshot, const struct trc_surface *s,
                           vmask active, uint32_t *material) {
    uint32_t same = 0;
    *material = UINT32_MAX;
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const uint32_t own = trc_hit_material(snapshot, (uint32_t)vi_get(s->instance, i),
                                              (uint32_t)vi_get(s->triangle, i));
        if (*material == UINT32_MAX)
            *material = own;
        same |= (uint32_t)(own == *material) << i;
    }
    return vm_from_bits(same);
}

/* What the surfaces emit that the lanes' rays met, one material after the other. */
static void push_surfaces(struct trc_tile *t, const struct arrival *a, struct trc_surface *s,
                          vmask met) {
    vmask todo = trc_emission_linked(t, a, s, vm_and(met, is_visible(a, s, met)));
    while (vm_any(todo)) {
        uint32_t number;
        s->active = same_material(t->snapshot, s, todo, &number);
        todo = vm_andnot(todo, s->active);
        const struct trc_material *m = t->snapshot->materials[number];
        if (!(m->has & TRC_MATERIAL_HAS_EMISSION))
            continue;
        struct trc_registers regs;
        struct trc_lobes lobes;
        trc_surface_fetch(s);
        if (m->instruction_count)
            trc_program_run(m, s, &regs);
        trc_lobes_setup(m, s, &regs, vf_set(0.0f), &lobes);
        const vint light = trc_light_of_triangle(s, s->active);
        const vmask lit = vm_andnot(s->active, vi_lt(light, vi_set(0)));
        const vfloat w = trc_light_triangle_weight(s, a->o, a->n_from, left_before(t, a), a->pdf,
                                                   light_count_before(t, a->depths));
        found_push(t, a, v3_scale(lobes.emission, w), s->ray_length, light, vm_all_set(), lit);
    }
}

/* A packet of rays, those at order, and what it has met. */
struct search {
    struct trc_packet packet;
    struct trc_packet_hits hits;
};

static void packet_load(const struct trc_tile *t, const uint32_t *order, uint32_t count,
                        struct trc_packet *p) {
    float *const to[] = {p->o[0], p->o[1], p->o[2], p->d[0], p->d[1], p->d[2]};
    memset(p, 0, sizeof *p);
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vmask m = vm_first((int32_t)(count - i));
        const vint at = vi_load((const int32_t *)order + i);
        for (int k = 0; k < 6; k++)
            vf_store(to[k] + i, vf_gather(t->work.f[TRC_RAY_OX + k], at, m));
        vf_store(&p->t[i], vf_set(INFINITY));
        vf_store(&p->time[i], vf_gather(t->work.f[TRC_RAY_TIME], at, m));
        p->active |= (uint64_t)vm_bits(m) << i;
    }
    p->left = NULL;
    p->visibility = TRC_VISIBLE_EMITTER;
}

/* What a group of the packet's rays has met, from i on. */
static void push_group(struct trc_tile *t, const struct search *search, int i,
                       const uint32_t *order, vmask met) {
    const struct trc_packet_hits *hits = &search->hits;
    struct arrival a;
    trc_arrival_load(t, vi_load((const int32_t *)order), met, &a);
    trc_arrival_load_samples(t, &a);
    struct trc_surface s;
    memset(&s, 0, sizeof s);
    s.snapshot = t->snapshot;
    s.instance = vi_load((const int32_t *)&hits->instance[i]);
    s.triangle = vi_load((const int32_t *)&hits->triangle[i]);
    s.u = vf_load(&hits->u[i]);
    s.v = vf_load(&hits->v[i]);
    s.time = a.time;
    s.wo = v3_neg(a.d);
    s.ray_length = vf_load(&search->packet.t[i]);
    s.path = a.path;
    s.depths = a.depths;
    push_surfaces(t, &a, &s, met);
}

/* All emissive surfaces along the rays at order, up to a packet of them. */
static void find_surfaces(struct trc_tile *t, const uint32_t *order, uint32_t count) {
    struct search search;
    struct trc_packet *p = &search.packet;
    packet_load(t, order, count, p);
    while (p->active) {
        memset(search.hits.instance, 0xff, sizeof search.hits.instance);
        trc_trace_closest(t->snapshot, p, &search.hits, 1);
        uint64_t next = 0;
        for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
            const int i = c * TRC_WIDTH;
            const vint instance = vi_load((const int32_t *)&search.hits.instance[i]);
            const vmask met =
                vm_andnot(vm_from_bits(trc_chunk_bits(p->active, c)), vi_eq(instance, vi_set(-1)));
            if (!vm_any(met))
                continue;
            push_group(t, &search, i, order + i, met);
            next |= (uint64_t)vm_bits(met) << i;
            vf_store(&p->tmin[i], vf_select(met, vf_load(&p->t[i]), vf_load(&p->tmin[i])));
            vf_store(&p->t[i], vf_set(INFINITY));
        }
        p->active = next;
    }
}

void trc_linked_lights(struct trc_tile *t) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < t->work.count; i += TRC_WIDTH) {
        const vmask active = vm_first((int32_t)(t->work.count - i));
        struct arrival a;
        trc_arrival_load(t, vi_set((int32_t)i) + vi_lane(), active, &a);
        const vmask looks = looks_for_lights(&a);
        if (!vm_any(looks))
            continue;
        find_lamps(t, &a, looks);
        for (uint32_t bits = vm_bits(looks); bits; bits &= bits - 1)
            t->order[count++] = i + (uint32_t)__builtin_ctz(bits);
    }
    if (!t->snapshot->lights->shadows_linked)
        return;
    for (uint32_t i = 0; i < count; i += TRC_PACKET_SIZE) {
        const uint32_t left = count - i;
        find_surfaces(t, t->order + i, left < TRC_PACKET_SIZE ? left : TRC_PACKET_SIZE);
    }
}
