/* Light that rays find by themselves: of surfaces, of lights they pass, of the world. */
#include "kernels/tile/light_split.h"
#include "kernels/tile/shade.h"

/* Of light found by rays, what denoisers know as albedo: as much as paths have left to take. */
static void features_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 c) {
    const vfloat one = vf_one();
    vfloat left = trc_features_left(a->path);
    if (t->desc->pass_flags & TRC_PASSES_BLENDED_FEATURES) {
        const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
        left = vf_select(vi_eq((vint)a->path & straight, straight), one, left);
    }
    const vvec3 w = v3(vf_min(a->found_weight.x, one), vf_min(a->found_weight.y, one),
                       vf_min(a->found_weight.z, one));
    trc_pass_add_lanes(t, TRC_PASS_DENOISING_EMISSION, v3_scale(v3_mul(w, c), left), a->slots,
                       active);
}

/* The same as found_add for lanes whose slots follow each other from first on, and that are
 * straight or of no pass. */
static void found_add_row(struct trc_tile *t, vmask active, vmask straight, vvec3 c,
                          uint32_t camera_pass, uint32_t first) {
    const vfloat values[3] = {c.x, c.y, c.z};
    for (int k = 0; k < 3; k++) {
        trc_column_add(t->samples.radiance[k], first, values[k], active);
        if (t->samples.pass[camera_pass][k])
            trc_column_add(t->samples.pass[camera_pass][k], first, values[k], straight);
    }
}

/* Light found by rays, weighted and clamped: to the samples, and to the pass its depth says.
 * camera_pass: what camera rays see it as. */
static void found_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 c,
                      uint32_t camera_pass) {
    uint32_t first;
    if (!vm_any(active))
        return;
    if (t->samples.pass[TRC_PASS_DENOISING_EMISSION][0])
        features_add(t, a, active, c);
    const vint category = (vint)(a->path >> TRC_PATH_CATEGORY_SHIFT & vu_set(3u));
    const vmask straight = vm_and(active, vi_eq(category, vi_set(TRC_CATEGORY_CAMERA)));
    const bool is_split = t->light_passes && vm_any(vm_andnot(active, straight));
    if (!is_split && trc_slots_follow(a->slots, active, &first)) {
        found_add_row(t, active, straight, c, camera_pass, first);
        return;
    }
    const vuint depth = trc_depth_of(a->depths, TRC_DEPTH_ALL_SHIFT);
    float lanes[3][TRC_WIDTH];
    uint32_t depths[TRC_WIDTH], path[TRC_WIDTH], share[TRC_WIDTH];
    if (t->light_passes)
        vu_store(share, word_column(t->work.w[TRC_RAY_SHARE], a));
    vf_store(lanes[0], c.x), vf_store(lanes[1], c.y), vf_store(lanes[2], c.z);
    vu_store(depths, depth), vu_store(path, a->path);
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const float rgb[3] = {lanes[0][i], lanes[1][i], lanes[2][i]};
        trc_sample_add(t, a->slots[i], rgb);
        if ((path[i] >> TRC_PATH_CATEGORY_SHIFT & 3u) == TRC_CATEGORY_CAMERA)
            trc_pass_add(t, camera_pass, a->slots[i], rgb);
        else if (t->light_passes)
            trc_light_split_add(t, path[i], share[i], depths[i] <= 1, a->slots[i], rgb);
    }
}

/* What radiance that rays found brings. */
static vvec3 light_of(const struct trc_tile *t, const struct arrival *a, vvec3 radiance) {
    const vvec3 c = v3_mul(a->found_weight, radiance);
    return trc_clamps(t->desc) ? v3_scale(c, trc_clamp_factor(c, found_limit(t, a))) : c;
}

/* Emission found by rays. Returns what is added. */
static vvec3 emission_add(struct trc_tile *t, const struct arrival *a, vmask active, vvec3 radiance,
                          uint32_t camera_pass) {
    if (!vm_any(active))
        return v3_zero();
    const vvec3 c = light_of(t, a, radiance);
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

/* Lanes where a transparent film shows what is behind the picture, whose samples become as clear.
 */
static vmask see_through(struct trc_tile *t, const struct arrival *a, vmask missed) {
    const vint straight = vi_set(TRC_PATH_TRANSPARENT_BACKGROUND);
    const vmask seen = vm_and(missed, vi_eq((vint)a->path & straight, straight));
    float through[TRC_WIDTH];
    vf_store(through, v3_average(a->found_weight));
    for (uint32_t bits = vm_bits(seen); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        t->samples.transparency[a->slots[i]] += through[i];
    }
    return seen;
}

/* Rays that left the scene. What a transparent film leaves out of the picture is in the environment
 * pass, and where there is one in those of light groups, AOVs and for denoisers, too (Cycles). */
void trc_emission_misses(struct trc_tile *t, const struct arrival *a, vmask missed) {
    vmask clear = vm_none();
    if (t->desc->film_transparent) {
        clear = see_through(t, a, missed);
        if (!t->samples.pass[TRC_PASS_ENVIRONMENT][0])
            missed = vm_andnot(missed, clear);
    }
    if (!(t->snapshot->features & TRC_FEATURE_ENVIRONMENT) || !vm_any(missed))
        return;
    const vvec3 c =
        trc_world_radiance(t->snapshot, a->o, a->n_from, left_before(t, a), a->d, a->pdf,
                           light_count_before(t, a->depths), a->path, a->depths, missed);
    const vvec3 added = light_of(t, a, c);
    found_add(t, a, vm_andnot(missed, clear), added, TRC_PASS_ENVIRONMENT);
    if (vm_any(clear))
        trc_pass_add_lanes(t, TRC_PASS_ENVIRONMENT, added, a->slots, vm_and(missed, clear));
    if (vm_any(clear) && t->samples.pass[TRC_PASS_DENOISING_EMISSION][0])
        features_add(t, a, vm_and(missed, clear), added);
    if (t->desc->light_group_count)
        one_group_add(t, a, missed, added, t->snapshot->world.light_group);
    const uint32_t material = t->snapshot->world.material;
    if (material != UINT32_MAX && t->snapshot->materials[material]->aov_count)
        trc_world_aovs(t, a->d, a->path, a->depths, a->slots, missed);
}

/* Lamps of a light group, or of all, that the rays pass until their end. */
static vvec3 pass_lamps(struct trc_tile *t, const struct arrival *a, vfloat end, uint32_t group) {
    vvec3 c = v3_zero();
    const struct trc_light_ray ray = light_ray(t, a, end);
    if (trc_clamps(t->desc)) {
        trc_light_hit_clamped(t->snapshot, &ray, group, a->found_weight, found_limit(t, a),
                              a->active, &c);
    } else {
        trc_light_hit(t->snapshot, &ray, group, a->active, &c);
    }
    const vmask seen = vm_and(a->active, vf_gt(v3_max(v3_abs(c)), vf_set(0.0f)));
    if (!vm_any(seen))
        return v3_zero();
    c = v3_where(seen, v3_mul(a->found_weight, c));
    found_add(t, a, seen, c, TRC_PASS_EMISSION);
    return c;
}

/* Lights that rays pass, in the order of t->work. */
void trc_emission_rays(struct trc_tile *t) {
    const bool lights = t->snapshot->features & TRC_FEATURE_LIGHTS;
    const bool moves = trc_shows_background_motion(t);
    const uint32_t *seen = t->snapshot->lights->group_seen;
    for (uint32_t i = 0; i < t->work.count; i += TRC_WIDTH) {
        const vint index = vi_set((int32_t)i) + vi_lane();
        const vmask active = vm_first((int32_t)(t->work.count - i));
        const vmask missed =
            vm_and(active, vi_eq(vi_load((int32_t *)t->hits.instance + i), vi_set(-1)));
        if (!lights && !vm_any(missed))
            continue;
        struct arrival a;
        trc_arrival_load(t, index, active, &a);
        if (lights) {
            const vfloat end = vf_select(missed, vf_set(TRC_FAR), a.t);
            if (!t->desc->light_group_count)
                pass_lamps(t, &a, end, TRC_ALL_GROUPS);
            for (uint32_t g = 0; t->desc->light_group_count && g <= TRC_MAX_LIGHT_GROUPS; g++)
                if (seen[g] < seen[g + 1])
                    one_group_add(t, &a, active, pass_lamps(t, &a, end, g), g);
        }
        if (!vm_any(missed))
            continue;
        trc_emission_misses(t, &a, missed);
        if (moves)
            trc_background_motion(t, a.d, a.path, a.slots, missed);
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

vmask trc_emission_linked(const struct trc_tile *t, const struct arrival *a,
                          const struct trc_surface *s, vmask active) {
    const struct trc_instance *instances = t->snapshot->instances;
    const vint from = left_before(t, a);
    uint32_t unlinked = 0;
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        const int32_t left = vi_get(from, i);
        const uint64_t excluded = instances[vi_get(s->instance, i)].light_exclude;
        if (left >= 0 && excluded >> instances[left].light_set & 1)
            unlinked |= 1u << i;
    }
    return vm_andnot(active, vm_from_bits(unlinked));
}

/* Of the lanes, those that find the emission of s here and not in kernels/tile/linked.c. */
static vmask emission_seen(const struct trc_tile *t, const struct arrival *a,
                           const struct trc_surface *s, vmask active) {
    uint32_t classed = 0;
    for (uint32_t bits = vm_bits(active); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        if (t->snapshot->instances[vi_get(s->instance, i)].shadow_class)
            classed |= 1u << i;
    }
    const vint camera = (vint)(a->path & vu_set(TRC_VISIBLE_CAMERA));
    const vmask bounced = vi_eq(camera, vi_set(0));
    return trc_emission_linked(t, a, s, vm_andnot(active, vm_and(bounced, vm_from_bits(classed))));
}

void trc_emission_surface(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_lobes *lobes, vmask active) {
    vmask lit = vm_and(active, vf_gt(v3_max(v3_abs(lobes->emission)), vf_set(0.0f)));
    if (t->snapshot->lights->linked)
        lit = emission_seen(t, a, s, lit);
    if (!vm_any(lit))
        return;
    const vfloat w = trc_light_triangle_weight(s, a->o, a->n_from, left_before(t, a), a->pdf,
                                               light_count_before(t, a->depths));
    const vvec3 added = emission_add(t, a, lit, v3_scale(lobes->emission, w), TRC_PASS_EMISSION);
    if (t->desc->light_group_count)
        surface_group_add(t, a, s, lit, added);
}

void trc_emission_holdout(struct trc_tile *t, const struct arrival *a,
                          const struct trc_lobes *lobes, vmask active) {
    float part[TRC_WIDTH];
    const vmask background = vi_eq((vint)(a->path & vu_set(TRC_PATH_TRANSPARENT_BACKGROUND)),
                                   vi_set(TRC_PATH_TRANSPARENT_BACKGROUND));
    vf_store(part, v3_average(v3_mul(a->found_weight, lobes->holdout)));
    for (uint32_t bits = vm_bits(vm_and(active, background)); bits; bits &= bits - 1) {
        const int i = __builtin_ctz(bits);
        t->samples.transparency[a->slots[i]] += part[i];
    }
}
