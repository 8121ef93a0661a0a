/* Shading of a step's hits: emission, direct light, continuation rays.
 *
 * Hits come sorted by material, so a group of TRC_WIDTH runs one material's code; loops over lobes
 * and light samples are uniform. N rays in, N rays out (Boulos et al. 2007, section 4.1):
 * Distribution chooses one lobe per ray from the sample sequence; Whitted follows every lobe along
 * its ideal direction. Diffuse lobes end here: their light is all in the light samples. Rough lobes
 * join light samples and continuation rays by multiple importance sampling (Veach and Guibas 1995,
 * power heuristic). */
#include "kernels/light/clamp.h"
#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"
#include "kernels/tile/arrival.h"
#include "kernels/trace/spawn.h"
#include "model/lights.h"

/* Shadow rays end this much before the light, as a fraction of the way: mesh lights must not shade
 * themselves, whatever the rounding of both ends. */
#define SHADOW_END (1.0f - 2e-5f)

/* The limit of what rays find by themselves: what one bounce shows is direct light. */
static vfloat found_limit(const struct trc_tile *t, const struct arrival *a) {
    const vint depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_ALL_SHIFT);
    return trc_clamp_limit(t->desc, vi_lt(depth, vi_set(2)));
}

/* Light found by rays, weighted and clamped: to the samples, and to the pass its depth says.
 * camera_pass: what camera rays see it as. */
static void found_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 c,
                      uint32_t camera_pass) {
    const vuint depth = trc_depth_of(a->depths, TRC_DEPTH_ALL_SHIFT);
    float lanes[3][TRC_WIDTH];
    uint32_t depths[TRC_WIDTH], path[TRC_WIDTH];
    vf_store(lanes[0], c.x), vf_store(lanes[1], c.y), vf_store(lanes[2], c.z);
    vu_store(depths, depth), vu_store(path, a->path);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const float rgb[3] = {lanes[0][i], lanes[1][i], lanes[2][i]};
        trc_sample_add(t, a->slots[i], rgb);
        const uint32_t category = path[i] >> TRC_PATH_CATEGORY_SHIFT & 3u;
        if (category == TRC_CATEGORY_CAMERA)
            trc_pass_add(t, camera_pass, a->slots[i], rgb);
        else if (t->light_passes)
            trc_pass_add(t, trc_category_pass(category) + (depths[i] > 1 ? 1 : 0), a->slots[i],
                         rgb);
    }
}

/* Emission or background found by rays. Returns what is added. */
static vvec3 emission_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 radiance,
                          uint32_t camera_pass) {
    if (!vm_any(active))
        return v3_zero();
    vvec3 c = v3_mul(a->found_weight, radiance);
    if (trc_clamps(t->desc))
        c = v3_scale(c, trc_clamp_factor(c, found_limit(t, a)));
    found_add(t, a, active, c, camera_pass);
    return c;
}

/* The same light to the passes of the lanes' light groups. */
static void group_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 light,
                      const uint32_t groups[TRC_WIDTH]) {
    float lanes[3][TRC_WIDTH];
    vf_store(lanes[0], light.x), vf_store(lanes[1], light.y), vf_store(lanes[2], light.z);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const float rgb[3] = {lanes[0][i], lanes[1][i], lanes[2][i]};
        if (groups[i])
            trc_pass_add(t, TRC_PASS_LIGHT_GROUP(groups[i] - 1), a->slots[i], rgb);
    }
}

/* Of one group for all lanes. */
static void one_group_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 light,
                          uint32_t group) {
    uint32_t groups[TRC_WIDTH];
    vu_store(groups, vu_set(group));
    if (group)
        group_add(t, a, active, light, groups);
}

/* Rays that left the scene. */
static void shade_misses(struct trc_tile *t, const struct arrival *a, vmask missed) {
    if (t->desc->film_transparent) {
        const vmask seen =
            vm_and(missed, vi_eq((vint)(a->path & vu_set(TRC_PATH_TRANSPARENT_BACKGROUND)),
                                 vi_set(TRC_PATH_TRANSPARENT_BACKGROUND)));
        float through[TRC_WIDTH];
        vf_store(through, v3_average(a->found_weight));
        for (uint32_t bits = vm_bits(seen); bits; bits &= bits - 1) {
            const int i = __builtin_ctz(bits);
            t->samples.transparency[a->slots[i]] += through[i];
        }
        missed = vm_andnot(missed, seen);
    }
    if (!(t->snapshot->features & TRC_FEATURE_ENVIRONMENT) || !vm_any(missed))
        return;
    const vvec3 c = trc_world_radiance(t->snapshot, a->o, a->n_from, a->d, a->pdf,
                                       light_count_before(t, a->depths), a->path, missed);
    const vvec3 added = emission_add(t, a, missed, c, TRC_PASS_ENVIRONMENT);
    if (t->desc->light_group_count)
        one_group_add(t, a, missed, added, t->snapshot->world.light_group);
    const uint32_t material = t->snapshot->world.material;
    if (material != UINT32_MAX && t->snapshot->materials[material]->aov_count)
        trc_world_aovs(t, a->d, a->path, a->slots, missed);
}

/* Lamps of a light group, or of all, that the rays pass on their way to end. */
static vvec3 pass_lamps(struct trc_tile *t, const struct arrival *a, vfloat end, uint32_t group) {
    vvec3 c = v3_zero();
    /* It is surfaces alone that rays look back for. */
    const vfloat tmin = vf_max(a->tmin, vf_set(0.0f));
    const vfloat count = light_count_before(t, a->depths);
    if (trc_clamps(t->desc)) {
        trc_light_hit_clamped(t->snapshot, a->o, a->n_from, a->d, tmin, end, a->pdf, count, a->path,
                              group, a->found_weight, found_limit(t, a), a->active, &c);
    } else {
        trc_light_hit(t->snapshot, a->o, a->n_from, a->d, tmin, end, a->pdf, count, a->path, group,
                      a->active, &c);
    }
    const vmask seen = vm_and(a->active, vf_gt(v3_max(c), vf_set(0.0f)));
    if (!vm_any(seen))
        return v3_zero();
    c = v3_where(seen, v3_mul(a->found_weight, c));
    found_add(t, a, seen, c, TRC_PASS_EMISSION);
    return c;
}

/* Lights that rays pass on their way, in the order of t->work. */
static void shade_rays(struct trc_tile *t) {
    const bool lights = t->snapshot->features & TRC_FEATURE_LIGHTS;
    const uint32_t *seen = t->snapshot->lights->group_seen;
    for (uint32_t i = 0; i < t->work.count; i += TRC_WIDTH) {
        const vint index = vi_set((int32_t)i) + vi_lane();
        const vmask active = vm_first((int32_t)(t->work.count - i));
        const vmask missed =
            vm_and(active, vi_eq(vi_load((int32_t *)t->hits.instance + i), vi_set(-1)));
        if (!lights && !vm_any(missed))
            continue;
        struct arrival a;
        arrival_load(t, index, active, &a);
        if (lights) {
            const vfloat end = vf_select(missed, vf_set(TRC_FAR), a.t);
            if (!t->desc->light_group_count)
                pass_lamps(t, &a, end, TRC_ALL_GROUPS);
            for (uint32_t g = 0; t->desc->light_group_count && g <= TRC_MAX_LIGHT_GROUPS; g++)
                if (seen[g] < seen[g + 1])
                    one_group_add(t, &a, active, pass_lamps(t, &a, end, g), g);
        }
        if (vm_any(missed))
            shade_misses(t, &a, missed);
    }
}

/* Splits rays at shadow catchers; where the background is shown, what of it is behind them too. */
static void catch_shadows(struct trc_tile *t) {
    uint32_t i = t->work.count;
    trc_catcher_split(t);
    for (; i < t->work.count && !t->desc->film_transparent; i += TRC_WIDTH) {
        struct arrival a;
        const vmask active = vm_first((int32_t)(t->work.count - i));
        arrival_load(t, vi_set((int32_t)i) + vi_lane(), active, &a);
        const vuint sample = trc_sample_of(a.slot);
        const vuint row = vu_set(TRC_ROW_BACKGROUND * TRC_CATCHER_BATCH);
        vu_store(a.slots, sample + row);
        shade_misses(t, &a, active);
    }
}

/* ---- direct light ---- */

/* Lanes that have not bounced yet. */
TRC_INLINE vmask sees_directly(vuint depths) {
    return vi_eq((vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT), vi_set(0));
}

TRC_INLINE vmask goes_out(const struct trc_surface *s, vvec3 w) {
    return vf_ge(v3_dot(w, s->ng), vf_set(0.0f));
}

/* Origin of a shadow ray: where light grazes a smooth surface it starts from the curved surface
 * that the normals describe, or the flat triangles would cast shadows with edges of their own.
 * Shape and limit of the transition as in Cycles, with its default of the geometry offset. */
#define TERMINATOR_COSINE 0.1f
TRC_INLINE vvec3 shadow_origin(const struct trc_surface *s, vvec3 w) {
    const vfloat zero = vf_set(0.0f), one = vf_set(1.0f);
    const vfloat cos_n = v3_dot(w, s->n), cos_g = v3_dot(w, s->ng);
    const vmask outside = vf_ge(cos_n, zero);
    const vvec3 o = trc_spawn_origin(s, outside);
    if (!vm_any(s->smooth))
        return o;
    const vfloat scale = vf_set(1.0f / TERMINATOR_COSINE);
    const vfloat near = vf_select(vf_lt(cos_n, vf_set(TERMINATOR_COSINE)),
                                  vf_set(2.0f) - (cos_g + cos_n) * scale, one - cos_g * scale);
    const vfloat amount = vf_min(vf_max(near, zero), one);
    return v3_add(o, v3_scale(s->bulge, vf_select(outside, amount, zero)));
}

struct light_result {
    vvec3 diffuse, glossy, transmission; /* unshadowed contributions */
    vfloat lamp;                         /* and that to the Shadow pass */
};

/* Contributions of the lanes' light samples, weighted; lanes that get nothing are dropped from
 * active. */
static vmask light_contribute(const struct trc_tile *t, const struct arrival *a,
                              const struct trc_surface *s, const struct trc_lobes *lobes,
                              const struct trc_light_sample *l, vfloat count, vmask active,
                              struct light_result *out) {
    struct trc_bsdf_value f;
    trc_bsdf_eval(lobes, s, l->wi, active, &f);
    const vfloat one = vf_set(1.0f), zero = vf_set(0.0f);
    const vuint seen = trc_light_visibility(t->snapshot, l, a->path);
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
    const vvec3 light = v3_mul(a->weight, v3_scale(l->radiance, scale));
#define SEEN(bit) vi_eq((vint)(seen & vu_set(bit)), vi_set(bit))
    out->diffuse = v3_mul(
        light, v3_scale(v3_select(SEEN(TRC_VISIBLE_DIFFUSE), f.diffuse, v3_zero()), mis_diffuse));
    out->glossy =
        v3_mul(light, v3_scale(v3_select(SEEN(TRC_VISIBLE_GLOSSY), f.glossy, v3_zero()), mis));
    out->transmission = v3_mul(
        light, v3_scale(v3_select(SEEN(TRC_VISIBLE_TRANSMISSION), f.transmission, v3_zero()), mis));
#undef SEEN
    const vvec3 sum = v3_add(out->diffuse, v3_add(out->glossy, out->transmission));
    const vfloat size = v3_max(sum);
    return vm_and(active, vm_and(vf_gt(size, zero), vf_lt(size, vf_set(3e38f))));
}

/* Adds the lanes' shadow rays to the queue. cell: where on the light, for sorting, below
 * TRC_DIRECTION_CELLS. */
static void shadow_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                        const struct trc_light_sample *l, const struct light_result *r, vuint cell,
                        vmask active) {
    const vvec3 o = shadow_origin(s, l->wi);
    const vmask far = vf_ge(l->distance, vf_set(TRC_FAR));
    const vvec3 target = v3_add(v3_scale(l->wi, vf_select(far, vf_set(1.0f), l->distance)),
                                v3_select(far, v3_zero(), v3_sub(s->p, o)));
    const vfloat tmax = vf_select(vm_not(l->casts_shadow), vf_set(-1.0f),
                                  vf_select(far, vf_set(INFINITY), vf_set(SHADOW_END)));
    const vvec3 sum = v3_add(r->diffuse, v3_add(r->glossy, r->transmission));
    const struct trc_shadow_rays rays = {
        .o = {o.x, o.y, o.z},
        .d = {target.x, target.y, target.z},
        .tmax = tmax,
        .time = a->time,
        .radiance = {sum.x, sum.y, sum.z},
        .slot = a->slot,
        .path = a->path,
        .target = (vuint)l->light * vu_set(TRC_DIRECTION_CELLS) + cell,
        .depths = a->depths,
    };
    struct trc_shadow_store *q = &t->shadows;
    const uint32_t bits = vm_bits(active), at = trc_shadows_append(q, &rays, bits);
    if (t->light_passes) {
        const vvec3 parts[3] = {r->diffuse, r->glossy, r->transmission};
        for (int k = 0; k < 3; k++) {
            vf_compress(q->split[3 * k] + at, parts[k].x, bits);
            vf_compress(q->split[3 * k + 1] + at, parts[k].y, bits);
            vf_compress(q->split[3 * k + 2] + at, parts[k].z, bits);
        }
    }
    for (int k = 0; q->lamp[0] && k < 3; k++)
        vf_compress(q->lamp[k] + at, r->lamp, bits);
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

static void sample_use(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                       const struct trc_lobes *lobes, const struct trc_light_sample *sample,
                       vfloat count, vuint cell, vmask active) {
    struct light_result r;
    vmask lit = vm_and(active, sample->valid);
    if (vm_any(lit))
        lit = light_contribute(t, a, s, lobes, sample, count, lit, &r);
    if (t->shadows.lamp[0] && vm_any(lit))
        r.lamp = lamp_part(t, a, s, sample, count, lit);
    if (vm_any(lit))
        shadow_push(t, a, s, sample, &r, cell, lit);
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
static void direct_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                         const struct trc_lobes *lobes, vmask active) {
    const uint32_t many = t->desc->light_samples;
    const vmask seen = many > 1 ? vm_and(active, sees_directly(a->depths)) : vm_none();
    const vmask bounced = vm_andnot(active, seen);
    if (vm_any(seen))
        light_samples(t, a, s, lobes, many, seen);
    if (vm_any(bounced))
        light_samples(t, a, s, lobes, 1, bounced);
}

/* ---- ambient occlusion ---- */

/* White light on diffuse lobes, whatever the direction. */
static vvec3 ambient_white(const struct trc_tile *t, const struct arrival *a,
                           const struct trc_lobes *lobes, vvec3 albedo) {
    const vfloat one = vf_set(1.0f);
    const vvec3 through = trc_lobes_transparency(lobes);
    const vvec3 alpha = v3(one - vf_min(through.x, one), one - vf_min(through.y, one),
                           one - vf_min(through.z, one));
    const vvec3 white = v3_mul(albedo, alpha);
    if (!trc_clamps(t->desc))
        return white;
    /* Before the colour of the surface is in it, as in Cycles. */
    const vfloat limit = trc_clamp_limit(t->desc, sees_directly(a->depths));
    return v3_scale(white, trc_clamp_factor(v3_mul(a->weight, alpha), limit));
}

/* The world's light on diffuse lobes from wi, drawn by the cosine to n. */
static vvec3 ambient_world(const struct trc_tile *t, const struct trc_surface *s,
                           const struct trc_lobes *lobes, vvec3 n, vvec3 wi, vmask active) {
    struct trc_bsdf_value f;
    trc_bsdf_eval(lobes, s, wi, active, &f);
    const vfloat one = vf_set(1.0f), no_mis = vf_set(-1.0f);
    const vvec3 world = trc_world_radiance(t->snapshot, s->p, n, wi, no_mis, one,
                                           vu_set(TRC_VISIBLE_DIFFUSE), active);
    const vfloat cosine = vf_max(v3_dot(n, wi), vf_set(1e-6f));
    return v3_scale(v3_mul(f.diffuse, world), vf_divide(vf_set(TRC_PI), cosine));
}

/* Sends the rays of ambient occlusion along with the shadow rays. Diffuse lobes are not continued,
 * so the numbers of the continuation ray are free for them. */
static void ambient_samples(struct trc_tile *t, const struct arrival *a,
                            const struct trc_surface *s, const struct trc_lobes *lobes,
                            uint32_t sample_count, vmask active) {
    const struct trc_world *world = &t->snapshot->world;
    const struct trc_light_table *lights = t->snapshot->lights;
    const uint32_t dimension =
        TRC_DIM_BOUNCE + t->generation * TRC_DIMS_PER_BOUNCE + TRC_DIM_BSDF_X;
    vvec3 n, x, y;
    const vvec3 albedo = trc_lobes_diffuse(lobes, s, &n);
    const bool adds = world->ao_method == TRC_AO_ADD;
    const vvec3 white = ambient_white(t, a, lobes, albedo);
    const vvec3 weight = v3_scale(a->weight, vf_set(world->ao_factor / (float)sample_count));
    struct arrival own = *a;
    own.path = a->path | vu_set(adds ? TRC_PATH_CLAMPED : 0);
    v3_frame(n, &x, &y);
    trc_shadow_reserve(t, sample_count);
    /* Packets of their own: numbered after all lights. */
    const int32_t number = (int32_t)(lights->first_triangle + lights->triangle_count);
    for (uint32_t l = 0; l < sample_count; l++) {
        vfloat u[2];
        trc_samples(&t->sampler, a->pixel, a->sample, dimension, 2, l, sample_count, u);
        const struct trc_light_sample sample = {
            .wi = v3_from_frame(trc_warp_cosine(u[0], u[1]), x, y, n),
            .distance = vf_set(world->ao_distance),
            .casts_shadow = vm_all_set(),
            .light = vi_set(number)};
        const vvec3 light = adds ? white : ambient_world(t, s, lobes, n, sample.wi, active);
        const struct light_result r = {.diffuse = v3_mul(weight, light)};
        const vfloat size = v3_max(r.diffuse);
        const vmask lit =
            vm_and(active, vm_and(vf_gt(size, vf_set(0.0f)), vf_lt(size, vf_set(3e38f))));
        if (vm_any(lit))
            shadow_push(t, &own, s, &sample, &r, trc_direction_cell(sample.wi), lit);
    }
}

static void ambient_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_lobes *lobes, vmask active) {
    const uint32_t many = t->desc->light_samples;
    const vmask seen = many > 1 ? vm_and(active, sees_directly(a->depths)) : vm_none();
    const vmask bounced = vm_andnot(active, seen);
    if (vm_any(seen))
        ambient_samples(t, a, s, lobes, many, seen);
    if (vm_any(bounced))
        ambient_samples(t, a, s, lobes, 1, bounced);
}

/* One ray for each lane that the camera sees, also through what is transparent, for the pass. */
static void occlusion_pass(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                           const struct trc_lobes *lobes, vmask active) {
    const vint camera = vi_set(TRC_VISIBLE_CAMERA);
    active = vm_and(active, vi_eq((vint)a->path & camera, camera));
    trc_shadow_reserve(t, 1);
    vvec3 n, x, y;
    vfloat u[2];
    trc_lobes_diffuse(lobes, s, &n);
    v3_frame(n, &x, &y);
    trc_samples(&t->sampler, a->pixel, a->sample,
                TRC_DIM_BOUNCE + t->generation * TRC_DIMS_PER_BOUNCE + TRC_DIM_BSDF_X, 2, 0, 1, u);
    const struct trc_light_table *lights = t->snapshot->lights;
    const struct trc_light_sample sample = {
        .wi = v3_from_frame(trc_warp_cosine(u[0], u[1]), x, y, n),
        .distance = vf_set(t->snapshot->world.ao_distance),
        .casts_shadow = t->snapshot->world.ao_distance > 0.0f ? vm_all_set() : vm_none(),
        .light = vi_set((int32_t)(lights->first_triangle + lights->triangle_count))};
    const vvec3 one = v3(vf_set(1.0f), vf_set(1.0f), vf_set(1.0f));
    const vvec3 alpha = v3_sub(one, trc_lobes_transparency(lobes));
    const struct light_result r = {.diffuse = v3_mul(a->weight, alpha)};
    active = vm_and(active, vf_gt(v3_max(r.diffuse), vf_set(0.0f)));
    struct arrival own = *a;
    own.path = a->path | vu_set(TRC_PATH_OCCLUSION);
    if (t->catchers) {
        own.slot = trc_sample_of(a->slot);
        active = vm_andnot(active, trc_is_unblocked(a->path));
    }
    if (vm_any(active))
        shadow_push(t, &own, s, &sample, &r, trc_direction_cell(sample.wi), active);
}

/* ---- continuation ---- */

/* Pushes the lanes' rays. direction, weight factor, pdf (< 0: ideal). */
static void ray_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_bsdf_sample *b, uint32_t material, vmask active) {
    const trc_render_desc *desc = t->desc;
    const vmask straight = b->transparent;
    const vvec3 w = v3_select(straight, a->d, b->wi);
    const vvec3 o = v3_select(straight, a->o, trc_spawn_origin(s, goes_out(s, b->wi)));
    const vvec3 n = v3_select(straight, a->n_from, a->receive_n);
    const vvec3 weight = v3_mul(v3_select(straight, a->found_weight, a->weight), b->weight);
    const vfloat beyond = vf_select(straight, a->beyond, b->beyond);
    const vfloat back = t->looks_back ? trc_spawn_look_back(s, o, b->wi, a->t) : vf_set(0.0f);
    const vfloat tmin = vf_select(straight, a->t, back);
    const vfloat old_far = column(t->work.f[TRC_RAY_TMAX], a);
    const vfloat tmax = vf_select(straight, old_far, vf_set(INFINITY));
    const vmask ideal = vm_or(b->singular, vf_le(b->pdf, vf_set(0.0f)));
    const vfloat pdf =
        vf_select(straight, a->pdf, vf_select(ideal, vf_set(-1.0f), b->pdf * a->chance));
    const vfloat min_pdf =
        vf_select(vm_or(straight, ideal), a->min_pdf, vf_min(a->min_pdf, b->pdf));

    const vuint one = vu_set(1);
    vuint depths = a->depths;
    const vuint by_kind =
        (vuint)vi_select(b->transmitted, vi_set(1 << TRC_DEPTH_TRANSMISSION_SHIFT),
                         vi_set(1 << TRC_DEPTH_GLOSSY_SHIFT));
    depths = depths + (vuint)vi_select(straight, vi_set(1 << TRC_DEPTH_TRANSPARENT_SHIFT),
                                       (vint)(by_kind + one));
    const vmask over = vm_or(vm_or(vi_lt(vi_set((int32_t)desc->max_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT)),
                                   vi_lt(vi_set((int32_t)desc->max_glossy_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_GLOSSY_SHIFT))),
                             vm_or(vi_lt(vi_set((int32_t)desc->max_transmission_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_TRANSMISSION_SHIFT)),
                                   vi_lt(vi_set((int32_t)desc->max_transparent_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_TRANSPARENT_SHIFT))));
    /* Straight on: the same ray. Else a new kind, in the category of the first bounce. */
    const vuint category = a->path & vu_set(3u << TRC_PATH_CATEGORY_SHIFT);
    const vmask first =
        vi_eq((vint)category, vi_set(TRC_CATEGORY_CAMERA << TRC_PATH_CATEGORY_SHIFT));
    const vint own = vi_select(b->diffuse, vi_set(TRC_CATEGORY_DIFFUSE),
                               vi_select(b->transmitted, vi_set(TRC_CATEGORY_TRANSMISSION),
                                         vi_set(TRC_CATEGORY_GLOSSY)))
                     << TRC_PATH_CATEGORY_SHIFT;
    vuint kind = (vuint)vi_select(b->transmitted, vi_set(TRC_VISIBLE_TRANSMISSION),
                                  vi_set(TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED));
    kind = kind | (vuint)vi_select(ideal, vi_set(TRC_PATH_SINGULAR), vi_set(0));
    kind = kind | (vuint)vi_select(b->diffuse, vi_set(TRC_VISIBLE_DIFFUSE), vi_set(0));
    kind = kind | (vuint)vi_select(first, own, (vint)category);
    kind = kind | (a->path & vu_set(TRC_PATH_DATA_DONE | TRC_PATH_TOLD | TRC_VISIBLE_UNBLOCKED)) |
           vu_set(a->world_alone ? TRC_PATH_WORLD_ALONE : 0);
    vuint path = (vuint)vi_select(straight, (vint)a->path, (vint)kind);
    path = path | (vuint)vi_select(over, vi_set(TRC_PATH_LAST), vi_set(0));

    const vfloat values[TRC_RAY_FLOATS] = {o.x,  o.y,     o.z,     w.x,      w.y,      w.z,
                                           tmin, tmax,    a->time, weight.x, weight.y, weight.z,
                                           pdf,  min_pdf, n.x,     n.y,      n.z,      beyond};
    vuint left = vu_set(0);
    if (t->looks_back)
        left =
            (vuint)vi_select(straight, (vint)word_column(t->work.w[TRC_RAY_LEFT], a), s->instance);
    const vuint words[TRC_RAY_WORDS] = {a->slot, path, depths, vu_set(material), left};
    trc_rays_append(&t->stack, values, words, vm_bits(active));
}

/* Lanes whose rays are worth tracing: Whitted prunes its tree where a ray would add next to nothing
 * (Boulos et al. 2007). */
static vmask attenuate(const struct trc_tile *t, const struct arrival *a,
                       const struct trc_bsdf_sample *b, vmask active) {
    const vfloat size = v3_max(v3_mul(a->weight, b->weight));
    active = vm_and(active, vm_and(vf_gt(size, vf_set(0.0f)), vf_lt(size, vf_set(3e38f))));
    if (t->desc->integrator == TRC_INTEGRATOR_DISTRIBUTION)
        return active;
    return vm_andnot(active, vf_lt(size, vf_set(t->desc->attenuation_cutoff)));
}

/* Chance that the one continuation ray is traced at all, in proportion to what it can bring to the
 * picture (Russian roulette); certain from ROULETTE_FULL on. A matt surface with a weak gloss sends
 * a ray now and then instead of always: conference 1.9 times as fast at the same error, at most 1.2
 * times the error elsewhere. */
#define ROULETTE_FULL 0.25f
static vfloat roulette_chance(const struct trc_tile *t, const struct arrival *a,
                              const struct trc_lobes *lobes) {
    const vfloat one = vf_set(1.0f);
    if (t->desc->integrator != TRC_INTEGRATOR_DISTRIBUTION)
        return one;
    const vfloat brings = v3_max(a->weight) * lobes->continue_weight;
    return vf_min(brings * vf_set(1.0f / ROULETTE_FULL), one);
}

/* Straight on through transparency alone, for rays that may not bounce any more. */
static void continue_straight(struct trc_tile *t, const struct arrival *a,
                              const struct trc_surface *s, const struct trc_lobes *lobes,
                              uint32_t material, vmask active) {
    struct trc_bsdf_sample b = {.wi = a->d,
                                .weight = trc_lobes_transparency(lobes),
                                .beyond = vf_set(1.0f),
                                .pdf = vf_set(0.0f),
                                .singular = vm_all_set(),
                                .transparent = vm_all_set(),
                                .transmitted = vm_none(),
                                .diffuse = vm_none(),
                                .valid = active};
    const vmask below = vi_lt((vint)trc_depth_of(a->depths, TRC_DEPTH_TRANSPARENT_SHIFT),
                              vi_set((int32_t)t->desc->max_transparent_depth + 1));
    active = attenuate(t, a, &b, vm_and(active, below));
    if (vm_any(active))
        ray_push(t, a, s, &b, material, active);
}

static void continue_rays(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_lobes *lobes, uint32_t material, vmask active) {
    struct trc_bsdf_sample b;
    if (t->desc->integrator == TRC_INTEGRATOR_WHITTED) {
        for (int i = 0; i < lobes->count; i++) {
            trc_bsdf_ideal(lobes, i, s, &b);
            const vmask go = attenuate(t, a, &b, vm_and(active, b.valid));
            if (vm_any(go))
                ray_push(t, a, s, &b, material, go);
        }
        return;
    }
    const uint32_t dimension = TRC_DIM_BOUNCE + t->generation * TRC_DIMS_PER_BOUNCE + TRC_DIM_LOBE;
    vfloat u[3];
    trc_samples(&t->sampler, a->pixel, a->sample, dimension, 3, 0, 1, u);
    /* One stratified number for both choices: whether, and which lobe. */
    active = vm_and(active, vf_lt(u[0], a->chance));
    if (!vm_any(active))
        return;
    u[0] = vf_min(vf_divide(u[0], a->chance), vf_set(0x1.fffffep-1f));
    trc_bsdf_sample(lobes, s, u[0], u[1], u[2], &b);
    b.weight = v3_scale(b.weight, vf_divide(vf_set(1.0f), a->chance));
    const vmask go = attenuate(t, a, &b, vm_and(active, b.valid));
    if (vm_any(go))
        ray_push(t, a, s, &b, material, go);
}

/* ---- a group of one material ---- */

/* Width of the beam that one sample stands for where its ray arrives: of the camera's rays a share
 * of the pixel, of those that rough lobes have sent a share of their directions (Suykens and
 * Willems, "Path Differentials and Applications", 2001). Ideal bounces may focus: 0. */
static vfloat beam_width(const struct trc_tile *t, const struct arrival *a) {
    const vfloat length = arrival_length(a);
    const vfloat solid = vf_divide(vf_set(1.0f / (float)t->desc->sample_count), a->pdf);
    const vmask camera =
        vi_eq((vint)(a->path & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
    const vfloat bounced = vf_where(vf_gt(a->pdf, vf_set(0.0f)), length * vf_safe_sqrt(solid));
    return vf_select(camera, vf_set(t->beam_width) + length * vf_set(t->beam_spread), bounced);
}

static void surface_setup(struct trc_tile *t, const struct arrival *a, bool has_footprint,
                          struct trc_surface *s) {
    s->snapshot = t->snapshot;
    s->active = a->active;
    s->instance = (vint)word_column(t->hits.instance, a);
    s->triangle = (vint)word_column(t->hits.triangle, a);
    s->u = column(t->hits.u, a);
    s->v = column(t->hits.v, a);
    s->time = a->time;
    s->wo = v3_neg(a->d);
    s->ray_length = arrival_length(a);
    s->path = a->path;
    s->depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_ALL_SHIFT);
    s->diffuse_depth = vi_set(0);
    s->glossy_depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_GLOSSY_SHIFT);
    s->transmission_depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_TRANSMISSION_SHIFT);
    s->transparent_depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_TRANSPARENT_SHIFT);
    s->footprint = has_footprint ? beam_width(t, a) : vf_set(0.0f);
    s->raster_x = (vi_to_float((vint)(a->pixel & vu_set(0xffffu))) + vf_set(0.5f)) *
                  vf_set(1.0f / (float)t->desc->width);
    s->raster_y = (vi_to_float((vint)(a->pixel >> 16)) + vf_set(0.5f)) *
                  vf_set(1.0f / (float)t->desc->height);
    trc_surface_fetch(s);
}

/* Filter Glossy: roughness is at least what the sharpest bounce so far can no longer resolve
 * (Cycles). */
TRC_INLINE vfloat filter_alpha(const struct trc_tile *t, const struct arrival *a) {
    if (t->desc->filter_glossy <= 0.0f)
        return vf_set(0.0f);
    const vfloat blur = a->min_pdf * vf_set(1.0f / t->desc->filter_glossy);
    return vf_select(vf_lt(blur, vf_set(1.0f)),
                     vf_sqrt(vf_max(vf_set(1.0f) - blur, vf_set(0.0f))) * vf_set(0.5f),
                     vf_set(0.0f));
}

static void holdout(struct trc_tile *t, const struct arrival *a, const struct trc_lobes *lobes,
                    vmask active) {
    float part[TRC_WIDTH];
    const vmask background = vi_eq((vint)(a->path & vu_set(TRC_PATH_TRANSPARENT_BACKGROUND)),
                                   vi_set(TRC_PATH_TRANSPARENT_BACKGROUND));
    vf_store(part, v3_average(a->found_weight) * lobes->holdout);
    for (uint32_t bits = vm_bits(vm_and(active, background)); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        t->samples.transparency[a->slots[i]] += part[i];
    }
}

/* Emission of surfaces to the passes of their instances' light groups. */
static void surface_group_add(struct trc_tile *t, const struct arrival *a,
                              const struct trc_surface *s, vmask active, vvec3 light) {
    uint32_t groups[TRC_WIDTH];
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        groups[i] = t->snapshot->instances[vi_get(s->instance, i)].light_group;
    }
    group_add(t, a, active, light, groups);
}

/* Of a way that a shadow catcher split, the half that goes on as ever writes the sample's data. */
static vuint data_passes(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                         const struct trc_material *m, const struct trc_registers *regs,
                         const struct trc_lobes *lobes) {
    const vfloat length = vf_max(a->t - vf_max(a->tmin, vf_set(0.0f)), vf_set(0.0f));
    if (!t->catchers)
        return trc_data_passes(t, s, m, regs, lobes, a->found_weight, a->beyond, length, a->slots);
    struct trc_surface seen = *s;
    uint32_t samples[TRC_WIDTH];
    seen.active = vm_andnot(s->active, trc_is_unblocked(a->path));
    vu_store(samples, trc_sample_of(a->slot));
    return trc_data_passes(t, &seen, m, regs, lobes, a->found_weight, a->beyond, length, samples);
}

static void shade_group(struct trc_tile *t, uint32_t material, vint index, vmask active) {
    const struct trc_material *m = t->snapshot->materials[material];
    struct arrival a;
    struct trc_surface s;
    struct trc_registers regs;
    struct trc_lobes lobes;
    arrival_load(t, index, active, &a);
    arrival_load_samples(t, &a);
    surface_setup(t, &a, m->has & TRC_MATERIAL_READS_FOOTPRINT, &s);
    if (m->instruction_count)
        trc_program_run(m, &s, &regs);
    trc_lobes_setup(m, &s, &regs, filter_alpha(t, &a), &lobes);
    a.chance = roulette_chance(t, &a, &lobes);
    const bool lets_through = m->has & (TRC_MATERIAL_HAS_REFRACTION | TRC_MATERIAL_HAS_TRANSLUCENT);
    a.receive_n = lets_through ? v3_zero() : s.n;
    /* A lobe's own density fits an even world. Matt lobes send no rays. */
    a.world_alone = t->snapshot->world.is_constant && !(m->has & TRC_MATERIAL_IS_MATT);
    if (m->has & TRC_MATERIAL_HAS_HOLDOUT)
        holdout(t, &a, &lobes, active);
    if (t->extra_passes)
        a.path = data_passes(t, &a, &s, m, &regs, &lobes);
    if (m->has & TRC_MATERIAL_HAS_EMISSION) {
        const vmask lit = vm_and(active, vf_gt(v3_max(lobes.emission), vf_set(0.0f)));
        if (vm_any(lit)) {
            const vfloat w = trc_light_triangle_weight(&s, a.o, a.n_from, a.pdf,
                                                       light_count_before(t, a.depths));
            const vvec3 added =
                emission_add(t, &a, lit, v3_scale(lobes.emission, w), TRC_PASS_EMISSION);
            if (t->desc->light_group_count)
                surface_group_add(t, &a, &s, lit, added);
        }
    }
    const vmask last = vi_eq((vint)(a.path & vu_set(TRC_PATH_LAST)), vi_set(TRC_PATH_LAST));
    const vmask on = vm_andnot(active, last);
    if ((m->has & TRC_MATERIAL_HAS_TRANSPARENCY) && vm_any(vm_and(active, last)))
        continue_straight(t, &a, &s, &lobes, material, vm_and(active, last));
    if (!vm_any(on))
        return;
    if (m->has & TRC_MATERIAL_SCATTERS) {
        lobes.below_horizon = s.smooth;
        direct_light(t, &a, &s, &lobes, on);
        if ((t->snapshot->features & TRC_FEATURE_AMBIENT_OCCLUSION) &&
            (m->has & TRC_MATERIAL_IS_MATT))
            ambient_light(t, &a, &s, &lobes, on);
        lobes.below_horizon = vm_none();
    }
    if (t->samples.pass[TRC_PASS_AMBIENT_OCCLUSION][0])
        occlusion_pass(t, &a, &s, &lobes, on);
    if (t->desc->integrator == TRC_INTEGRATOR_RAYCAST) {
        if (m->has & TRC_MATERIAL_HAS_TRANSPARENCY)
            continue_straight(t, &a, &s, &lobes, material, on);
    } else if (vm_any(vm_and(on, vf_gt(lobes.continue_weight, vf_set(0.0f))))) {
        continue_rays(t, &a, &s, &lobes, material, on);
    }
}

void trc_shade_batch(struct trc_tile *t) {
    if (t->snapshot->features & (TRC_FEATURE_LIGHTS | TRC_FEATURE_ENVIRONMENT) ||
        t->desc->film_transparent)
        shade_rays(t);
    if (t->catchers)
        catch_shadows(t);
    trc_rays_reserve(&t->stack, t->work.count * t->hit_branches);
    /* Hits by material; those that missed have the last key. */
    uint32_t keys_count = t->snapshot->material_count + 1;
    if (keys_count > TRC_BINS)
        keys_count = TRC_BINS;
    for (uint32_t i = 0; i < t->work.count; i++) {
        const uint32_t key =
            t->hits.instance[i] == TRC_NO_HIT ? keys_count - 1 : t->hits.material[i];
        t->keys[i] = key < keys_count ? key : keys_count - 1;
    }
    trc_tile_sort(t, t->keys, t->work.count, t->order);
    for (uint32_t i = 0; i < t->work.count;) {
        const uint32_t first = t->order[i];
        if (t->hits.instance[first] == TRC_NO_HIT) {
            i++; /* only beyond TRC_BINS materials do misses stand among hits */
            continue;
        }
        const uint32_t material = t->hits.material[first];
        uint32_t lanes[TRC_WIDTH] = {0}, n = 0;
        for (; n < TRC_WIDTH && i < t->work.count && t->hits.instance[t->order[i]] != TRC_NO_HIT &&
               t->hits.material[t->order[i]] == material;
             i++)
            lanes[n++] = t->order[i];
        shade_group(t, material, vi_load((int32_t *)lanes), vm_first((int32_t)n));
    }
}
