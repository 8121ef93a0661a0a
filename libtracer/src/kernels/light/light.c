/* Light samples: a light for every point, a place on it, the radiance it sends. */
#include "kernels/light/light.h"

#include "kernels/light/lamp_shade.h"
#include "kernels/light/lamps.h"
#include "kernels/light/select.h"
#include "kernels/light/triangle.h"
#include "kernels/light/world.h"
#include "kernels/light/world_place.h"
#include "kernels/lobe/bsdf.h"

/* Everything of one call. */
struct draw {
    const struct trc_snapshot *scene;
    const struct trc_light_table *table;
    const struct trc_surface *s;
    struct trc_receiver receiver;
    vfloat u1, u2, chance;
    vint light;
    struct trc_light_sample *out;
};

/* Enters a place in lanes m. */
static void set_place(const struct draw *d, const struct trc_place *place, vmask m) {
    struct trc_light_sample *out = d->out;
    out->wi = v3_select(m, place->wi, out->wi);
    out->distance = vf_select(m, place->distance, out->distance);
    out->radiance = v3_select(m, place->radiance, out->radiance);
    out->density = vf_select(m, place->pdf, out->density);
    out->pdf = vf_select(m, place->pdf * d->chance, out->pdf);
}

/* ---- lamps ---- */

/* kinds: 1 << kind of those among the lanes. */
static void sample_lamps(const struct draw *d, const struct trc_wide_lamp *l, uint32_t kinds,
                         vmask m) {
#define TRC_LAMP_KIND(NAME, name, is_it)                                                  \
    if (kinds & 1u << TRC_KIND_##NAME) {                                                  \
        const vmask lanes = vm_and(m, vi_eq(l->kind, vi_set(TRC_KIND_##NAME)));           \
        if (vm_any(lanes)) {                                                              \
            const struct trc_place place = trc_##name##_sample(l, d->s->p, d->u1, d->u2); \
            set_place(d, &place, lanes);                                                  \
        }                                                                                 \
    }
#include "model/light_kinds.def"
}

/* Lanes whose bits are set in a word. */
TRC_INLINE vmask has_bit(vint word, int32_t bit) { return vi_eq(word & vi_set(bit), vi_set(bit)); }

/* Lamps that lanes chose are taken one by one while there are few of them: their data is broadcast
 * then and only their own shape is computed. */
#define SEPARATE_LAMPS 3

static void mark_flags(const struct draw *d, vint flags, vmask m) {
    struct trc_light_sample *out = d->out;
    out->delta = vm_or(out->delta, vm_and(m, has_bit(flags, TRC_LAMP_DELTA)));
    out->no_mis = vm_or(out->no_mis, vm_andnot(m, has_bit(flags, TRC_LAMP_MIS)));
    out->casts_shadow =
        vm_andnot(out->casts_shadow, vm_andnot(m, has_bit(flags, TRC_LAMP_CASTS_SHADOW)));
}

static void sample_chosen_lamps(const struct draw *d, vmask m) {
    const struct trc_light_table *t = d->table;
    struct trc_wide_lamp l;
    for (int i = 0; i < SEPARATE_LAMPS; i++) {
        const int32_t number = vi_get(d->light, __builtin_ctz(vm_bits(m)));
        const vmask same = vm_and(m, vi_eq(d->light, vi_set(number)));
        l = trc_lamp_broadcast(&t->lamps[number]);
        sample_lamps(d, &l, 1u << t->lamps[number].kind, same);
        mark_flags(d, l.flags, same);
        m = vm_andnot(m, same);
        if (!vm_any(m))
            return;
    }
    l = trc_lamp_gather(t->lamps, d->light, m);
    sample_lamps(d, &l, t->kinds, m);
    mark_flags(d, l.flags, m);
}

/* Of lamps that do not emit evenly, what their nodes emit from the sampled places. */
static void shade_chosen_lamps(const struct draw *d, vmask m) {
    struct trc_light_sample *out = d->out;
    const struct trc_lamp_view view = {.scene = d->scene,
                                       .table = d->table,
                                       .light = d->light,
                                       .p = d->s->p,
                                       .wi = out->wi,
                                       .distance = out->distance,
                                       .time = d->s->time,
                                       .depths = d->s->depths};
    const vvec3 light = v3_mul(out->radiance, trc_lamp_emission(&view, m));
    out->radiance = v3_select(m, light, out->radiance);
}

/* ---- triangles ---- */

/* World corners of the triangles at the lanes' times. */
static struct trc_corners moving_corners(const struct draw *d, vint index, vmask m) {
    float p[TRC_WIDTH * 9];
    memset(p, 0, sizeof p);
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const struct trc_light_triangle *t = &d->table->triangles[vi_get(index, lane)];
        trc_world_corners_at(d->scene, t->instance, t->triangle, vf_get(d->s->time, lane),
                             p + 9 * lane);
    }
    return trc_corners_of(p);
}

/* Emission that a program computes: the surface at the sampled place, one material after the
 * other, as rays of that path and those depths see it. Replaces radiance in the lanes of m. */
static void evaluate_emission(const struct draw *d, vint index, vfloat u, vfloat v, vuint path,
                              vuint depths, vmask m, vvec3 *radiance) {
    const struct trc_light_triangle *all = d->table->triangles;
    const vint at = index * vi_set(TRC_TRIANGLE_WORDS);
    struct trc_surface e;
    memset(&e, 0, sizeof e);
    e.snapshot = d->scene;
    e.instance = vi_gather(&all->instance, at, m);
    e.triangle = vi_gather(&all->triangle, at, m);
    e.u = u;
    e.v = v;
    e.time = d->s->time;
    e.wo = v3_neg(d->out->wi);
    e.ray_length = d->out->distance;
    e.raster_x = d->s->raster_x;
    e.raster_y = d->s->raster_y;
    e.path = path;
    e.depths = depths;
    e.active = m;
    trc_surface_fetch(&e);
    const vint material = vi_gather((const int32_t *)&all->material, at, m);
    for (vmask left = m; vm_any(left);) {
        const int32_t number = vi_get(material, __builtin_ctz(vm_bits(left)));
        e.active = vm_and(left, vi_eq(material, vi_set(number)));
        left = vm_andnot(left, e.active);
        const struct trc_material *program = d->scene->materials[number];
        struct trc_registers registers;
        if (program->instruction_count)
            trc_program_run(program, &e, &registers);
        const vvec3 emission = trc_lobes_emission(program, &registers);
        *radiance = v3_select(e.active, emission, *radiance);
    }
}

/* What the triangles of lanes m emit to rays of matt lobes; flags: of the triangles. */
static __attribute__((noinline)) void sample_matt_radiance(const struct draw *d, vint index,
                                                           vfloat u, vfloat v, vint flags,
                                                           vmask m) {
    struct trc_light_sample *out = d->out;
    const vmask behind = vf_lt(v3_dot(d->s->ng, out->wi), vf_zero());
    const vuint reflected = trc_depths_beyond(d->s->depths, TRC_DEPTH_ALL_SHIFT);
    const vuint transmitted = trc_depths_beyond(d->s->depths, TRC_DEPTH_TRANSMISSION_SHIFT);
    const vuint depths = (vuint)vi_select(behind, (vint)transmitted, (vint)reflected);
    vuint kinds[3];
    trc_lobe_rays(behind, kinds);
    out->matt_radiance = out->radiance;
    out->by_rays = vm_and(m, has_bit(flags, TRC_TRIANGLE_BY_RAYS));
    const vmask asking = vm_and(m, has_bit(flags, TRC_TRIANGLE_ASKS_RAYS));
    if (vm_any(asking))
        evaluate_emission(d, index, u, v, kinds[0], depths, asking, &out->matt_radiance);
}

static void sample_triangles(const struct draw *d, vmask m) {
    const struct trc_light_table *t = d->table;
    const vint index = d->light - vi_set((int32_t)t->first_triangle);
    const vint at = index * vi_set(TRC_TRIANGLE_WORDS);
    struct trc_corners c;
    c.corner[0] = v3_gather(t->triangles->v0, at, m);
    c.corner[1] = v3_gather(t->triangles->v1, at, m);
    c.corner[2] = v3_gather(t->triangles->v2, at, m);
    const vint flags = vi_gather((const int32_t *)&t->triangles->flags, at, m);
    const vmask moves = t->moves ? vm_and(m, has_bit(flags, TRC_TRIANGLE_MOVES)) : vm_none();
    if (vm_any(moves)) {
        const struct trc_corners now = moving_corners(d, index, moves);
        for (int k = 0; k < 3; k++)
            c.corner[k] = v3_select(moves, now.corner[k], c.corner[k]);
    }
    vfloat u, v;
    struct trc_place place = trc_triangle_sample(&c, d->s->p, d->u1, d->u2, &u, &v);
    place.radiance = v3_gather(t->triangles->emission, at, m);
    set_place(d, &place, m);
    const vmask varies = t->varies ? vm_and(m, has_bit(flags, TRC_TRIANGLE_VARIES)) : vm_none();
    if (vm_any(varies))
        evaluate_emission(d, index, u, v, vu_set(0),
                          trc_depths_beyond(d->s->depths, TRC_DEPTH_ALL_SHIFT), varies,
                          &d->out->radiance);
    if (t->triangles_ask_rays)
        sample_matt_radiance(d, index, u, v, flags, m);
}

/* ---- world ---- */

static void sample_world(const struct draw *d, vmask m) {
    struct trc_place place =
        trc_world_sample(d->table, d->receiver.n, d->receiver.has_n, d->u1, d->u2, m);
    /* No kind of ray: Cycles evaluates light samples without any either. */
    place.radiance = trc_world_shade(d->scene, place.wi, vu_set(0), d->s->depths, m);
    if (d->table->world_asks_rays) { /* what rays of some kind see is not lost */
        vvec3 seen[3];
        const vmask behind = vf_lt(v3_dot(d->s->ng, place.wi), vf_zero());
        trc_world_shade_kinds(d->scene, place.wi, behind, d->s->depths, m, seen);
        for (int k = 0; k < 3; k++)
            place.radiance = v3_add(v3_abs(place.radiance), v3_abs(seen[k]));
    }
    set_place(d, &place, m);
    if (d->table->world_is_shadowless)
        d->out->casts_shadow = vm_andnot(d->out->casts_shadow, m);
}

/* ---- visibility ---- */

/* Bits of the lights in lanes m, all elsewhere. */
static vuint visibility_of(const struct trc_snapshot *scene, vint light, vmask m) {
    const struct trc_light_table *t = scene->lights;
    vuint bits = vu_set(TRC_VISIBLE_ALL | TRC_VISIBLE_UNBLOCKED);
    const vmask lamp = vm_and(m, vi_lt(light, vi_set((int32_t)t->lamp_count)));
    if (vm_any(lamp)) {
        const vuint word = vu_gather(&t->lamps->visibility, light * vi_set(TRC_LAMP_WORDS), lamp);
        bits = (vuint)vi_select(lamp, (vint)word, (vint)bits);
    }
    const vmask world = vm_and(m, vi_eq(light, vi_set((int32_t)t->world_light)));
    bits = (vuint)vi_select(world, vi_set((int32_t)t->world_visibility), (vint)bits);
    const vmask triangle = vm_andnot(m, vi_lt(light, vi_set((int32_t)t->first_triangle)));
    for (uint32_t lanes = vm_bits(triangle); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint32_t index = (uint32_t)vi_get(light, lane) - t->first_triangle;
        const uint32_t word = scene->instances[t->triangles[index].instance].visibility;
        bits = (vuint)vi_select(vm_from_bits(1u << lane), vi_set((int32_t)word), (vint)bits);
    }
    return bits;
}

vfloat trc_light_chosen(const struct trc_surface *s, vvec3 n, const struct trc_light_sample *sample,
                        vmask m) {
    struct trc_receiver receiver = trc_receiver_make(s->p, n);
    vuint sets[2];
    if (s->snapshot->lights->linked)
        trc_receiver_sets(s->snapshot, s->instance, m, sets);
    receiver.sets = sets;
    return trc_light_chance(s->snapshot->lights, &receiver, sample->light, m);
}

vuint trc_light_visibility(const struct trc_snapshot *snapshot,
                           const struct trc_light_sample *sample, vuint path) {
    const vmask chosen = vm_not(vi_lt(sample->light, vi_set(0)));
    const vuint bits = visibility_of(snapshot, sample->light, chosen);
    const vint hidden = (vint)(path & ~bits & vu_set(TRC_VISIBLE_UNBLOCKED));
    return (vuint)vi_select(vi_eq(hidden, vi_set(0)), (vint)bits, vi_set(0));
}

vuint trc_light_shadow_class(const struct trc_snapshot *snapshot, vint light, vmask m) {
    const struct trc_light_table *t = snapshot->lights;
    uint32_t classes[TRC_WIDTH] = {0};
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint32_t number = (uint32_t)vi_get(light, lane),
                       triangle = number - t->first_triangle;
        if (number < t->lamp_count)
            classes[lane] = t->lamps[number].shadow_class;
        else if (triangle < t->triangle_count)
            classes[lane] = snapshot->instances[t->triangles[triangle].instance].shadow_class;
    }
    return vu_load(classes);
}

/* A continuation ray towards wi is a glossy one above the surface. Below it all weights stay: what
 * translucent surfaces have of a light that transmitted rays do not see lacks the rays' part, as in
 * Cycles. */
static void mark_hidden(const struct draw *d, vmask m) {
    const vint bits = (vint)visibility_of(d->scene, d->light, m);
    const vmask above = vf_gt(v3_dot(d->s->ng, d->out->wi), vf_zero());
    const vmask unseen = vi_eq(bits & vi_set(TRC_VISIBLE_GLOSSY), vi_set(0));
    d->out->no_mis = vm_or(d->out->no_mis, vm_and(m, vm_and(above, unseen)));
}

/* ---- interface ---- */

static void clear_sample(struct trc_light_sample *out) {
    out->wi = v3(vf_zero(), vf_zero(), vf_one());
    out->distance = vf_set(TRC_FAR);
    out->radiance = v3_zero();
    out->density = out->pdf = vf_zero();
    out->valid = out->delta = out->no_mis = vm_none();
    out->casts_shadow = vm_all_set();
    out->light = vi_set(-1);
}

/* What all kinds of lights have in common, after a place was set in lanes m. */
TRC_INLINE void finish_sample(const struct draw *d, vmask m) {
    struct trc_light_sample *out = d->out;
    if (d->table->hides)
        mark_hidden(d, m);
    vfloat maximum = v3_max(v3_abs(out->radiance));
    if (d->table->triangles_ask_rays) { /* what rays of matt lobes see is not lost */
        const vmask chosen =
            vm_andnot(m, vi_lt(d->light, vi_set((int32_t)d->table->first_triangle)));
        maximum = vf_max(maximum, vf_where(chosen, v3_max(v3_abs(out->matt_radiance))));
    }
    const vmask finite = vm_and(vf_gt(out->pdf, vf_zero()), vf_lt(out->pdf, vf_set(INFINITY)));
    out->valid = vm_and(m, vm_and(finite, vf_gt(maximum, vf_zero())));
}

/* Lamps give nothing to points beyond their limit of bounces. */
static void limit_sample(const struct draw *d, vmask m) {
    const vint limit = vi_gather((const int32_t *)&d->table->lamps->bounce_limit,
                                 d->light * vi_set(TRC_LAMP_WORDS), m);
    const vmask limited = vm_andnot(m, vi_eq(limit, vi_set(0)));
    const vmask beyond =
        vm_andnot(limited, vi_lt((vint)trc_depth_of(d->s->depths, TRC_DEPTH_ALL_SHIFT), limit));
    d->out->valid = vm_andnot(d->out->valid, beyond);
}

/* Bits of the light sets that a light of that number excludes. */
static uint64_t excluded_by(const struct trc_snapshot *scene, uint32_t light) {
    const struct trc_light_table *t = scene->lights;
    if (light < t->lamp_count)
        return t->lamps[light].excluded[0] | (uint64_t)t->lamps[light].excluded[1] << 32;
    if (light - t->first_triangle < t->triangle_count)
        return scene->instances[t->triangles[light - t->first_triangle].instance].light_exclude;
    return 0;
}

/* Lights give nothing to instances that they exclude. */
TRC_LINKS void link_sample(const struct draw *d, vmask m) {
    uint32_t low[TRC_WIDTH], high[TRC_WIDTH], unlit = 0;
    vu_store(low, d->receiver.sets[0]);
    vu_store(high, d->receiver.sets[1]);
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint64_t set = low[lane] | (uint64_t)high[lane] << 32;
        const uint64_t excluded = excluded_by(d->scene, (uint32_t)vi_get(d->light, lane));
        unlit |= (uint32_t)((excluded & set) != 0) << lane;
    }
    d->out->valid = vm_andnot(d->out->valid, vm_from_bits(unlit));
}

/* The only light of a scene. */
TRC_INLINE int32_t single_light(const struct trc_light_table *t) {
    return t->bound_count ? t->bounds[0].light : (int32_t)t->distant[0];
}

static void prepare(const struct trc_surface *s, vvec3 n, struct trc_light_choices *out) {
    out->p = s->p;
    out->n = n;
    if (s->snapshot->lights->linked) {
        trc_receiver_sets(s->snapshot, s->instance, s->active, out->sets);
        trc_candidates_weigh_linked(s->snapshot->lights, out);
    } else {
        trc_candidates_weigh(s->snapshot->lights, out);
    }
}

void trc_light_sample_world(const struct trc_surface *s, vvec3 n, vfloat u1, vfloat u2,
                            struct trc_light_sample *out) {
    const struct trc_snapshot *scene = s->snapshot;
    const struct trc_light_table *t = scene->lights;
    clear_sample(out);
    out->light = vi_select(s->active, vi_set((int32_t)t->world_light), out->light);
    const struct draw d = {scene,    t,          s,  trc_receiver_make(s->p, n), u1, u2,
                           vf_one(), out->light, out};
    sample_world(&d, s->active);
    finish_sample(&d, s->active);
}

static void sample_prepared(const struct trc_surface *s, const struct trc_light_choices *choices,
                            vfloat u_select, vfloat u1, vfloat u2, struct trc_light_sample *out) {
    const struct trc_snapshot *scene = s->snapshot;
    const struct trc_light_table *t = scene->lights;
    clear_sample(out);
    struct draw d = {scene,    t,          s,  trc_receiver_make(s->p, choices->n), u1, u2,
                     vf_one(), vi_set(-1), out};
    d.receiver.sets = choices->sets;
    if (t->single)
        d.light = vi_select(s->active, vi_set(single_light(t)), d.light);
    else if (trc_candidate_count(t) > 0)
        d.light = trc_light_choose(t, choices, &d.receiver, u_select, s->active, &d.chance);
    const vmask chosen = vm_andnot(s->active, vi_lt(d.light, vi_set(0)));
    if (!vm_any(chosen))
        return;
    out->light = vi_select(chosen, d.light, out->light);
    const vmask lamps = vm_and(chosen, vi_lt(d.light, vi_set((int32_t)t->lamp_count)));
    if (vm_any(lamps)) {
        sample_chosen_lamps(&d, lamps);
        if (t->programs)
            shade_chosen_lamps(&d, lamps);
    }
    if (t->kinds & 1u << TRC_KIND_WORLD) {
        const vmask world = vm_and(chosen, vi_eq(d.light, vi_set((int32_t)t->world_light)));
        if (vm_any(world))
            sample_world(&d, world);
    }
    if (t->triangle_count) {
        const vmask triangles =
            vm_andnot(chosen, vi_lt(d.light, vi_set((int32_t)t->first_triangle)));
        if (vm_any(triangles))
            sample_triangles(&d, triangles);
    }
    finish_sample(&d, chosen);
    if (t->limited && vm_any(lamps))
        limit_sample(&d, lamps);
    if (t->linked)
        link_sample(&d, chosen);
}

void trc_light_sample(const struct trc_surface *s, vvec3 n, vfloat u_select, vfloat u1, vfloat u2,
                      struct trc_light_sample *out) {
    struct trc_light_choices choices;
    prepare(s, n, &choices);
    sample_prepared(s, &choices, u_select, u1, u2, out);
}
