/* Direct light: samples of lights, their weights, and the shadow rays that they send.
 *
 * Rough lobes join light samples and continuation rays by multiple importance sampling (E. Veach
 * and L. Guibas 1995, power heuristic). */
#include <stddef.h>

#include "kernels/light/world.h"
#include "kernels/light/world_place.h"
#include "kernels/program/hash.h"
#include "kernels/tile/shade.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/spawn.h"

/* Lanes whose light Cycles finds by continuation rays alone, which nothing lifts: an even world. */
TRC_INLINE vmask is_found_alone(const struct trc_surface *s, const struct trc_light_sample *l) {
    const struct trc_snapshot *snapshot = s->snapshot;
    const int32_t none = -1;
    return vi_eq(
        l->light,
        vi_set(snapshot->world.is_constant ? (int32_t)snapshot->lights->world_light : none));
}

/* Lanes in which light comes to the side that is shaded as seen. */
TRC_INLINE vmask goes_up(const struct trc_surface *s, vvec3 w) {
    return vf_ge(v3_dot(w, s->n), vf_set(0.0f));
}

/* Where light grazes a smooth surface, shadow rays start from the curved surface that the normals
 * describe, on the side of the light, or the flat triangles would cast shadows with edges of their
 * own. This is which part of the way to it a ray towards a light starts with; the transition,
 * between cosine and 0 to both normals, is as in Cycles. */
TRC_INLINE vfloat lift(const struct trc_surface *s, const struct trc_light_sample *l, vfloat cosine,
                       vfloat inverse) {
    const vvec3 w = l->wi;
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    const vfloat side = vf_select(goes_up(s, w), one, -one);
    const vfloat cos_n = v3_dot(w, s->n) * side, cos_g = v3_dot(w, s->ng) * side;
    const vfloat near = vf_select(vf_lt(cos_n, cosine), vf_set(2.0f) - (cos_g + cos_n) * inverse,
                                  one - cos_g * inverse);
    const vfloat amount = vf_min(vf_max(near, zero), one);
    return vf_select(is_found_alone(s, l), zero, amount);
}

/* That part of the way, of the active lanes. */
TRC_INLINE vvec3 lifted(const struct trc_surface *s, const struct trc_light_sample *l, vfloat part,
                        vmask active) {
    vvec3 bulge = s->bulge;
    const vmask behind =
        vm_andnot(vm_and(vm_and(active, s->smooth), vf_gt(part, vf_set(0.0f))), goes_up(s, l->wi));
    if (vm_any(behind))
        bulge = v3_select(behind, trc_bulge_behind(s, behind), bulge);
    return v3_scale(bulge, part);
}

/* Origin of a shadow ray towards a light. */
TRC_INLINE vvec3 shadow_origin(const struct trc_surface *s, const struct trc_light_sample *l,
                               vmask active) {
    const vvec3 o = trc_spawn_origin(s, goes_up(s, l->wi));
    if (!vm_any(s->smooth))
        return o;
    const vfloat part =
        lift(s, l, vf_set(TRC_TERMINATOR_COSINE), vf_set(1.0f / TRC_TERMINATOR_COSINE));
    return v3_add(o, lifted(s, l, part, active));
}

/* The same by the offset of each lane's instance. Where that is 0, no ray is lifted, and all leave
 * on the side that they go to. */
static vvec3 own_origin(const struct trc_surface *s, const struct trc_light_sample *l,
                        vmask active) {
    const vvec3 w = l->wi;
    const vfloat zero = vf_set(0.0f);
    const vfloat cosine = trc_instance_float(
        s->snapshot, s->instance, offsetof(struct trc_instance, terminator_cosine), s->active);
    const vmask lifts = vf_gt(cosine, zero);
    const vfloat part = vf_where(lifts, lift(s, l, cosine, vf_divide(vf_set(1.0f), cosine)));
    const vvec3 o = trc_spawn_origin(s, vm_select(lifts, goes_up(s, w), goes_out(s, w)));
    return v3_add(o, lifted(s, l, part, active));
}

/* Kinds of rays (TRC_VISIBLE_*) that see the lanes' lights. What rays alone would find in Cycles,
 * transmitted ones find behind the surface, diffuse ones among them. */
static vuint light_seen(const struct trc_tile *t, const struct trc_surface *s,
                        const struct trc_light_sample *l, vuint path) {
    if (!t->snapshot->lights->hides)
        return vu_set(TRC_VISIBLE_ALL);
    const vuint seen = trc_light_visibility(t->snapshot, l, path);
    const vint transmitted = (vint)(seen & vu_set(TRC_VISIBLE_TRANSMISSION));
    const vmask behind = vm_and(is_found_alone(s, l), vf_lt(v3_dot(s->ng, l->wi), vf_set(0.0f)));
    return (vuint)vi_select(vm_and(behind, vi_eq(transmitted, vi_set(0))), vi_set(0), (vint)seen);
}

/* The part of the world's light that Cycles has by samples where rays of that density find it, too.
 * Its samples are of the world's own density, without regard to the receiver. */
static vfloat sampled_part(const struct trc_surface *s, const struct trc_light_sample *l,
                           vfloat by_ray, vmask m) {
    const vfloat density = trc_world_density(s->snapshot->lights, s->n, vm_none(), l->wi, m);
    const vfloat by_sample = density * vf_divide(l->pdf, l->density);
    const vfloat pl2 = vf_square(by_sample), pb2 = vf_square(by_ray);
    return vf_divide(pl2, pl2 + pb2);
}

/* The density of the rays that Cycles sends from matt lobes. */
static vfloat matt_density(const struct trc_surface *s, const struct trc_light_sample *l) {
    return vf_abs(v3_dot(s->n, l->wi)) * vf_set(TRC_INV_PI);
}

/* What the world's light is to diffuse, glossy and transmitted rays that go where samples of it do.
 * Where Cycles has no samples, rays find it all. Else samples are told of no ray, and rays find the
 * rest: those of matt lobes, which are not followed, by the densities of both there. */
static void world_by_kind(const struct trc_surface *s, const struct trc_light_sample *l, vmask m,
                          vvec3 seen[3]) {
    const vmask behind = vf_lt(v3_dot(s->ng, l->wi), vf_set(0.0f));
    trc_world_shade_kinds(s->snapshot, l->wi, behind, s->depths, m, seen);
    if (!s->snapshot->lights->map)
        return;
    const vvec3 sampled = trc_world_shade(s->snapshot, l->wi, vu_set(0), s->depths, m);
    seen[0] = v3_lerp(seen[0], sampled, sampled_part(s, l, matt_density(s, l), m));
    seen[1] = seen[2] = sampled;
}

/* Replaces the light of lanes whose sample is of the world by that. */
static void world_light_by_kind(const struct arrival *a, const struct trc_surface *s,
                                const struct trc_light_sample *l, vfloat scale, vmask active,
                                vvec3 light[3]) {
    const vint world = vi_set((int32_t)s->snapshot->lights->world_light);
    const vmask m = vm_and(active, vi_eq(l->light, world));
    vvec3 seen[3];
    if (!vm_any(m))
        return;
    world_by_kind(s, l, m, seen);
    for (int k = 0; k < 3; k++)
        light[k] = v3_select(m, v3_mul(a->weight, v3_scale(seen[k], scale)), light[k]);
}

/* The same of all lights: what else rays find is sampled as here. Worlds without a map are not. */
static vfloat sampled_part_of_light(const struct trc_surface *s, const struct trc_light_sample *l,
                                    vfloat by_ray, vmask m) {
    const struct trc_light_table *table = s->snapshot->lights;
    const vmask of_world = vm_and(m, vi_eq(l->light, vi_set((int32_t)table->world_light)));
    const vfloat pl2 = vf_square(l->pdf), pb2 = vf_square(by_ray);
    vfloat part = vf_where(vm_andnot(m, of_world), vf_divide(pl2, pl2 + pb2));
    if (table->map && vm_any(of_world))
        part = vf_select(of_world, sampled_part(s, l, by_ray, of_world), part);
    return part;
}

/* Replaces what matt lobes have of lanes whose sample is of an emissive triangle: Cycles' samples
 * are of no kind of ray, and the rays of matt lobes, which are not followed here, find the rest. */
static __attribute__((noinline)) void triangle_light_by_kind(const struct arrival *a,
                                                             const struct trc_surface *s,
                                                             const struct trc_light_sample *l,
                                                             vfloat scale, vmask active,
                                                             vvec3 *matt) {
    const vint first = vi_set((int32_t)s->snapshot->lights->first_triangle);
    const vmask m = vm_andnot(active, vi_lt(l->light, first));
    if (!vm_any(m))
        return;
    const vfloat part = sampled_part_of_light(s, l, matt_density(s, l), vm_andnot(m, l->by_rays));
    const vvec3 seen = v3_lerp(l->matt_radiance, l->radiance, part);
    *matt = v3_select(m, v3_mul(a->weight, v3_scale(seen, scale)), *matt);
}

/* Lanes whose samples stand for what rays bring in Cycles: all that mis is above Cycles' part of
 * samples, by chance, and all of worlds that it does not sample. by_ray: the density of rays, of
 * matt lobes 0. */
static vmask stands_for_rays(const struct trc_surface *s, const struct trc_light_sample *l,
                             vfloat by_ray, vfloat mis, vvec3 diffuse, vmask active) {
    const vmask m = vm_andnot(active, vm_or(l->delta, l->no_mis));
    if (!vm_any(m))
        return m;
    const vfloat zero = vf_set(0.0f);
    const vmask matt =
        vm_and(vf_gt(v3_dot(s->n, l->wi), zero), vf_gt(v3_max(v3_abs(diffuse)), zero));
    by_ray = vf_max(by_ray, vf_where(matt, matt_density(s, l)));
    const vfloat chance = hash3(l->wi.x, l->wi.y, l->wi.z);
    return vm_and(m, vf_ge(chance * mis, sampled_part_of_light(s, l, by_ray, m)));
}

/* The kind of the rays for which the lanes' samples stand: of the lobes that bring most. */
static vuint lobe_ray(const struct trc_surface *s, const struct trc_light_sample *l,
                      const struct light_result *r) {
    vuint kinds[3];
    trc_lobe_rays(vf_lt(v3_dot(s->ng, l->wi), vf_set(0.0f)), kinds);
    const vfloat matt = v3_max(v3_abs(r->diffuse)), glossy = v3_max(v3_abs(r->glossy));
    const vfloat transmitted = v3_max(v3_abs(r->transmission));
    const vint rest = vi_select(vf_ge(glossy, transmitted), (vint)kinds[1], (vint)kinds[2]);
    return (vuint)vi_select(vf_ge(matt, vf_max(glossy, transmitted)), (vint)kinds[0], rest);
}

/* Where lights cast no shadows, or what is in their way tells shadow rays from others: what samples
 * that stand for rays are to that. by_ray: see stands_for_rays. */
static __attribute__((noinline)) void stand_for_rays(const struct trc_surface *s,
                                                     const struct trc_light_sample *l,
                                                     vfloat by_ray, vfloat mis, vmask active,
                                                     struct light_result *r) {
    const vmask rays = stands_for_rays(s, l, by_ray, mis, r->diffuse, active);
    r->is_blocked = vm_or(r->is_blocked, rays);
    r->kind = (vuint)vi_select(rays, (vint)lobe_ray(s, l, r), (vint)r->kind);
}

/* Contributions of the lanes' light samples, weighted; lanes that get nothing are dropped from
 * active. */
static vmask light_contribute(const struct trc_tile *t, const struct arrival *a,
                              const struct trc_surface *s, const struct trc_lobes *lobes,
                              const struct trc_light_sample *l, vfloat count, vmask active,
                              struct light_result *out) {
    struct trc_bsdf_value f;
    trc_bsdf_eval(lobes, s, l->wi, active, is_found_alone(s, l), &f);
    const vfloat one = vf_set(1.0f), zero = vf_set(0.0f);
    const vuint seen = light_seen(t, s, l, a->path);
    const vmask alone = vm_or(l->delta, l->no_mis);
    vfloat mis, mis_diffuse = one;
    if (t->desc->integrator == TRC_INTEGRATOR_DISTRIBUTION) {
        /* A continuation ray's weight has all lobes in it (kernels/lobe/bsdf.h), so this has too.
         */
        const vfloat pl = l->pdf * count, pb = f.pdf * a->chance;
        const vfloat pl2 = pl * pl, pb2 = pb * pb;
        mis = mis_diffuse = vf_select(alone, one, pl2 / (pl2 + pb2));
    } else {
        /* Ideal continuation rays find lights of extent by themselves; highlights of points are
         * here. */
        mis = vf_select(alone, one, zero);
    }
    const vfloat scale = one / (l->pdf * count);
    vvec3 light[3]; /* by what it is for: diffuse, glossy, transmission */
    light[0] = light[1] = light[2] = v3_mul(a->weight, v3_scale(l->radiance, scale));
    if (t->snapshot->lights->world_asks_rays)
        world_light_by_kind(a, s, l, scale, active, light);
    if (t->snapshot->lights->triangles_ask_rays)
        triangle_light_by_kind(a, s, l, scale, active, &light[0]);
#define SEEN(bit) vi_eq((vint)(seen & vu_set(bit)), vi_set(bit))
    out->diffuse =
        v3_mul(light[0],
               v3_scale(v3_select(SEEN(TRC_VISIBLE_DIFFUSE), f.diffuse, v3_zero()), mis_diffuse));
    out->glossy =
        v3_mul(light[1], v3_scale(v3_select(SEEN(TRC_VISIBLE_GLOSSY), f.glossy, v3_zero()), mis));
    out->transmission =
        v3_mul(light[2],
               v3_scale(v3_select(SEEN(TRC_VISIBLE_TRANSMISSION), f.transmission, v3_zero()), mis));
#undef SEEN
    out->is_blocked = l->casts_shadow;
    out->kind = vu_set(TRC_VISIBLE_SHADOW);
    if (t->snapshot->lights->has_shadowless || (t->snapshot->features & TRC_FEATURE_RAY_KINDS))
        stand_for_rays(s, l, f.pdf * a->chance, mis, active, out);
    const vvec3 sum = v3_add(out->diffuse, v3_add(out->glossy, out->transmission));
    const vfloat size = v3_max(v3_abs(sum)); /* there are lights that take light away */
    return vm_and(active, is_light(size));
}

/* The mean square alpha of the lobes that rays go on from, by how often they do. */
static vfloat mean_alpha2(const struct trc_lobes *lobes) {
    vfloat sum = vf_set(0.0f), weights = vf_set(0.0f);
    for (int i = 0; i < lobes->count; i++) {
        const struct trc_lobe *lobe = &lobes->lobe[i];
        if (trc_lobe_ends(lobe->kind))
            continue;
        sum = sum + lobe->sample_weight * vf_square(trc_lobe_alpha(lobe));
        weights = weights + lobe->sample_weight;
    }
    return vf_where(vf_gt(weights, vf_set(0.0f)), vf_divide(sum, weights));
}

/* How rough what is lit is, by which Cycles widens rays: the root of the mean square alpha, that of
 * what is matt being 1, by what each brings. Cycles takes the mean by densities. */
static vfloat spread_of(const struct light_result *r) {
    const vfloat matt = v3_max(v3_abs(r->diffuse));
    const vfloat rest = v3_max(v3_abs(v3_add(r->glossy, r->transmission)));
    return vf_sqrt(vf_divide(matt + rest * r->alpha2, matt + rest));
}

TRC_INLINE void push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_light_sample *l, const struct light_result *r, vvec3 o,
                     vuint cell, vmask active) {
    const vmask far = vf_ge(l->distance, vf_set(TRC_FAR));
    const vvec3 target = v3_add(v3_scale(l->wi, vf_select(far, vf_set(1.0f), l->distance)),
                                v3_select(far, v3_zero(), v3_sub(s->p, o)));
    const vfloat tmax = vf_select(vm_not(r->is_blocked), vf_set(-1.0f),
                                  vf_select(far, vf_set(INFINITY), vf_set(SHADOW_END)));
    const vvec3 sum = v3_add(r->diffuse, v3_add(r->glossy, r->transmission));
    const struct trc_shadow_rays rays = {
        .o = {o.x, o.y, o.z},
        .d = {target.x, target.y, target.z},
        .tmax = tmax,
        .time = a->time,
        .radiance = {sum.x, sum.y, sum.z},
        .slot = a->slot,
        .path = (a->path & vu_set(~(TRC_PATH_FEATURES | TRC_PATH_KIND))) | r->kind,
        .target = (vuint)l->light * vu_set(TRC_DIRECTION_CELLS) + cell,
        .depths = a->depths,
    };
    struct trc_shadow_store *q = &t->shadows;
    const uint32_t bits = vm_bits(active), at = trc_shadows_append(q, &rays, bits);
    if (t->light_passes) {
        vu_compress(q->share + at, word_column(t->work.w[TRC_RAY_SHARE], a), bits);
        const vvec3 parts[3] = {r->diffuse, r->glossy, r->transmission};
        for (int k = 0; k < 3; k++) {
            vf_compress(q->split[3 * k] + at, parts[k].x, bits);
            vf_compress(q->split[3 * k + 1] + at, parts[k].y, bits);
            vf_compress(q->split[3 * k + 2] + at, parts[k].z, bits);
        }
    }
    for (int k = 0; q->lamp[0] && k < 3; k++)
        vf_compress(q->lamp[k] + at, r->lamp, bits);
    if (q->split_scale)
        vf_compress(q->split_scale + at, split_scale(t, a), bits);
    if (q->pixel) {
        vf_compress(q->pixel + at, s->pixel, bits);
        vf_compress(q->spread + at, spread_of(r), bits);
    }
}

/* Enters the strands that the lanes' rays have left, the last of the queue. */
static void strands_enter(struct trc_shadow_store *q, const struct trc_surface *s, vmask active) {
    const uint32_t bits = vm_bits(active), at = q->count - (uint32_t)__builtin_popcount(bits);
    vuint strand[2];
    trc_strand_words(s, strand);
    vu_compress(q->strand_instance + at, strand[0], bits);
    vu_compress(q->strand + at, strand[1], bits);
}

void trc_shadow_push_from(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_light_sample *l, const struct light_result *r,
                          const vvec3 *o, vuint cell, vmask active) {
    push(t, a, s, l, r, *o, cell, active);
    if (t->left)
        strands_enter(&t->shadows, s, active);
}

/* Where instances have offsets or there are curves: of others, rays pay nothing for it. */
static __attribute__((noinline)) void push_own(struct trc_tile *t, const struct arrival *a,
                                               const struct trc_surface *s,
                                               const struct trc_light_sample *l,
                                               const struct light_result *r, vuint cell,
                                               vmask active) {
    const bool has_offsets = t->snapshot->features & TRC_FEATURE_SHADOW_TERMINATORS;
    const vvec3 o = has_offsets ? own_origin(s, l, active) : shadow_origin(s, l, active);
    trc_shadow_push_from(t, a, s, l, r, &o, cell, active);
}

void trc_shadow_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_light_sample *l, const struct light_result *r, vuint cell,
                     vmask active) {
    if (t->snapshot->features & (TRC_FEATURE_SHADOW_TERMINATORS | TRC_FEATURE_CURVES))
        push_own(t, a, s, l, r, cell, active);
    else
        push(t, a, s, l, r, shadow_origin(s, l, active), cell, active);
}

/* What the lanes' light samples are in the Shadow pass if nothing is in the way: lamps count
 * equally, whatever they are chosen by; the world and emissive triangles do not. */
static vfloat lamp_part(const struct trc_tile *t, const struct arrival *a,
                        const struct trc_surface *s, const struct trc_light_sample *l, vfloat count,
                        vmask active) {
    const int32_t lamps = (int32_t)t->snapshot->lights->lamp_count;
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    const vmask counts = vm_and(vm_and(active, vi_lt(l->light, vi_set(lamps))),
                                vi_eq((vint)a->path & straight, straight));
    if (!vm_any(counts))
        return vf_set(0.0f);
    const vfloat chance = trc_light_chosen(s, a->receive_n, l, counts);
    return vf_select(counts, vf_divide(vf_set(1.0f / (float)lamps), chance * count), vf_set(0.0f));
}

/* Enters the shadow classes of the lanes' lights into the path words of their rays, the last of the
 * queue. */
static __attribute__((noinline)) void classify(struct trc_tile *t, vint light, vmask active) {
    uint32_t bits = vm_bits(active);
    uint32_t at = t->shadows.count - (uint32_t)__builtin_popcount(bits), classes[TRC_WIDTH];
    vu_store(classes, trc_light_shadow_class(t->snapshot, light, active));
    for (; bits; bits &= bits - 1)
        t->shadows.path[at++] |= classes[__builtin_ctz(bits)] << TRC_PATH_CLASS_SHIFT;
}

static void sample_use(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                       const struct trc_lobes *lobes, const struct trc_light_sample *sample,
                       vfloat count, vuint cell, vmask active) {
    struct light_result r;
    vmask lit = vm_and(active, sample->valid);
    if (vm_any(lit))
        lit = light_contribute(t, a, s, lobes, sample, count, lit, &r);
    if (t->shadows.pixel)
        r.alpha2 = mean_alpha2(lobes);
    if (t->shadows.lamp[0] && vm_any(lit))
        r.lamp = lamp_part(t, a, s, sample, count, lit);
    if (!vm_any(lit))
        return;
    trc_shadow_push(t, a, s, sample, &r, cell, lit);
    if (t->snapshot->shadow_class_count)
        classify(t, sample->light, lit);
}

/* sample_count: of each lane. */
static void light_samples(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_lobes *lobes, uint32_t sample_count, vmask active) {
    const uint32_t dimension = TRC_DIM_BOUNCE + t->generation * TRC_DIMS_PER_BOUNCE;
    const vfloat count = vf_set((float)sample_count);
    const struct trc_light_table *lights = t->snapshot->lights;
    const bool world_apart = lights->world_apart && !a->world_alone;
    const bool is_only_world = lights->world_light != UINT32_MAX && !lights->world_apart;
    if (lights->cut_count + lights->distant_count == 0 || (is_only_world && a->world_alone))
        return;
    trc_shadow_reserve(t, sample_count * (world_apart ? 2 : 1));
    for (uint32_t l = 0; l < sample_count; l++) {
        vfloat u[3];
        trc_samples(&t->sampler, a->pixel, a->sample, dimension, 3, l, sample_count, u);
        struct trc_light_sample sample;
        trc_light_sample(s, a->receive_n, u[0], u[1], u[2], &sample);
        const vuint cell =
            trc_light_cell(u[1], u[2], vf_select(sample.delta, vf_set(INFINITY), sample.density));
        sample_use(t, a, s, lobes, &sample, count, cell, active);
        if (world_apart) {
            trc_light_sample_world(s, a->receive_n, u[1], u[2], &sample);
            sample_use(t, a, s, lobes, &sample, count, trc_direction_cell(sample.wi), active);
        }
    }
}

/* The lanes that the camera sees, through transparent surfaces too, take as many samples as the
 * settings say, those behind a bounce one. */
void trc_direct_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                      const struct trc_lobes *lobes, vmask active) {
    const uint32_t many = t->desc->light_samples;
    const vmask seen = many > 1 ? vm_and(active, sees_directly(a->depths)) : vm_none();
    const vmask bounced = vm_andnot(active, seen);
    if (vm_any(seen))
        light_samples(t, a, s, lobes, many, seen);
    if (vm_any(bounced))
        light_samples(t, a, s, lobes, 1, bounced);
}
