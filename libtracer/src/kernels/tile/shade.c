/* Shading of a step's hits: groups of lanes that hit one material.
 *
 * Hits come sorted by material, so a group of TRC_WIDTH runs one material's code; loops over lobes
 * and light samples are uniform. */
#include <stddef.h>

#include "kernels/program/tracing.h"
#include "kernels/tile/shade.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/panorama.h"

/* What the pixels of a panorama see, in radians. */
static vfloat pixel_angle(const struct trc_tile *t, const struct arrival *a) {
    const struct trc_camera *c = &t->snapshot->camera;
    const float *w = c->windows[0];
    const float inv_width = 1.0f / (float)t->desc->width,
                inv_height = 1.0f / (float)t->desc->height;
    const vfloat x = vi_to_float((vint)(a->pixel & vu_set(TRC_PIXEL_X_MASK))) + vf_set(0.5f);
    const vfloat y = vi_to_float((vint)(a->pixel >> TRC_PIXEL_Y_SHIFT)) + vf_set(0.5f);
    return trc_panorama_pixel_angle(c, vf_set(w[0]) + x * vf_set((w[1] - w[0]) * inv_width),
                                    vf_set(w[2]) + y * vf_set((w[3] - w[2]) * inv_height),
                                    inv_width, inv_height);
}

/* ---- how far apart the rays of neighbouring pixels are where they arrive ---- */

/* Between the directions of (x, y, -1) and (x + dx, y + dy, -1). */
TRC_INLINE vfloat pixel_turn(vfloat x, vfloat y, float dx, float dy) {
    const vfloat down = vf_set(-1.0f);
    const vvec3 next = v3_normalize(v3(x + vf_set(dx), y + vf_set(dy), down));
    return v3_length(v3_sub(next, v3_normalize(v3(x, y, down))));
}

/* The mean of both directions on the image, as Cycles has it: rays go apart as those of the camera
 * do, along the whole path, whatever they met on it. Of scenes with TRC_FEATURE_SLOPES. */
static vfloat pixel_distance(const struct trc_tile *t, const struct arrival *a) {
    const struct trc_camera *c = &t->snapshot->camera;
    uint32_t key;
    float f, w[4];
    trc_key_at(0.5f, c->key_count, &key, &f);
    for (int i = 0; i < 4; i++) {
        const float from = c->windows[key][i];
        w[i] = from + f * (c->windows[key + (c->key_count > 1)][i] - from);
    }
    const float dx = (w[1] - w[0]) / (float)t->desc->width;
    const float dy = (w[3] - w[2]) / (float)t->desc->height;
    const vfloat half = vf_set(0.5f);
    if (c->type == TRC_CAMERA_ORTHOGRAPHIC)
        return half * vf_set(fabsf(dx) + fabsf(dy));
    const vfloat px = vi_to_float((vint)(a->pixel & vu_set(TRC_PIXEL_X_MASK))) + half;
    const vfloat py = vi_to_float((vint)(a->pixel >> TRC_PIXEL_Y_SHIFT)) + half;
    const vfloat x = vf_set(w[0]) + px * vf_set(dx), y = vf_set(w[2]) + py * vf_set(dy);
    return (column(t->work.f[TRC_RAY_PATH_LENGTH], a) + arrival_length(a)) * half *
           (pixel_turn(x, y, dx, 0.0f) + pixel_turn(x, y, 0.0f, dy));
}

/* ---- the surface ---- */

/* Width of the beam that one sample stands for where its ray arrives: of the camera's rays a share
 * of the pixel, of those that rough lobes have sent a share of their directions (Suykens and
 * Willems, "Path Differentials and Applications", 2001). Ideal bounces may focus: 0. */
static vfloat beam_width(const struct trc_tile *t, const struct arrival *a) {
    const vfloat length = arrival_length(a);
    const vfloat solid = vf_divide(vf_set(1.0f / (float)t->desc->sample_count), a->pdf);
    const vmask camera =
        vi_eq((vint)(a->path & vu_set(TRC_VISIBLE_CAMERA)), vi_set(TRC_VISIBLE_CAMERA));
    const vfloat bounced = vf_where(vf_gt(a->pdf, vf_set(0.0f)), length * vf_safe_sqrt(solid));
    vfloat spread = vf_set(t->beam_spread);
    if (trc_is_panorama(&t->snapshot->camera) && vm_any(camera))
        spread = spread * pixel_angle(t, a);
    return vf_select(camera, vf_set(t->beam_width) + length * spread, bounced);
}

/* has: of the material. */
static void surface_setup(struct trc_tile *t, const struct arrival *a, uint32_t has,
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
    s->depths = a->depths;
    s->footprint = has & TRC_MATERIAL_READS_FOOTPRINT ? beam_width(t, a) : vf_set(0.0f);
    const bool needs_pixel = (has & TRC_MATERIAL_READS_PIXEL) || t->shadows.pixel;
    s->pixel = needs_pixel ? pixel_distance(t, a) : vf_set(0.0f);
    s->raster_x = (vi_to_float((vint)(a->pixel & vu_set(TRC_PIXEL_X_MASK))) + vf_set(0.5f)) *
                  vf_set(1.0f / (float)t->desc->width);
    s->raster_y = (vi_to_float((vint)(a->pixel >> TRC_PIXEL_Y_SHIFT)) + vf_set(0.5f)) *
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

/* Whether a material has lobes that lamps light; so have mirrors that Filter Glossy made rough. */
static bool scatters(const struct trc_material *m, vfloat filter, vmask active) {
    if (m->has & TRC_MATERIAL_SCATTERS)
        return true;
    return (m->has & TRC_MATERIAL_HAS_SPECULAR) &&
           vm_any(vm_and(active, vf_gt(filter, vf_set(0.0f))));
}

/* Of a path that a shadow catcher split, the half that goes on as ever writes the sample's data. */
static vuint data_passes(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                         const struct trc_material *m, const struct trc_registers *regs,
                         const struct trc_lobes *lobes) {
    const vfloat length = vf_max(a->t - vf_max(a->tmin, vf_set(0.0f)), vf_set(0.0f));
    if (!t->catchers)
        return trc_data_passes(t, s, m, regs, lobes, a->found_weight, a->indirect_scale, length,
                               a->slots);
    struct trc_surface seen = *s;
    uint32_t samples[TRC_WIDTH];
    seen.active = vm_andnot(s->active, trc_is_unblocked(a->path));
    vu_store(samples, trc_sample_of(a->slot));
    return trc_data_passes(t, &seen, m, regs, lobes, a->found_weight, a->indirect_scale, length,
                           samples);
}

/* What programs trace rays with, for the lanes that have arrived. */
struct shading_probe {
    struct trc_probe probe;
    const struct trc_tile *tile;
    const struct arrival *arrival;
};

static void probe_numbers(const struct trc_probe *probe, enum trc_probe_use use, uint32_t sample,
                          uint32_t count, vfloat u[2]) {
    const struct shading_probe *p = (const struct shading_probe *)probe;
    const uint32_t at = 2 * (TRC_PROBE_USES * p->tile->generation + use);
    trc_samples(&p->tile->sampler, p->arrival->pixel, p->arrival->sample, TRC_DIM_PROBE + at, 2,
                sample, count, u);
}

static void program_run(struct trc_tile *t, const struct arrival *a, const struct trc_material *m,
                        struct trc_surface *s, struct trc_registers *regs) {
    const struct shading_probe own = {.probe = {.numbers = probe_numbers,
                                                .packet = &t->packets[0],
                                                .hits = &t->packet_hits[0],
                                                .left = t->left,
                                                .ray_count = &t->job->counts.rays_shadow,
                                                .min_pdf = a->min_pdf},
                                      .tile = t,
                                      .arrival = a};
    s->probe = &own.probe;
    trc_program_run(m, s, regs);
    s->probe = NULL;
}

static void shade_group(struct trc_tile *t, uint32_t material, vint index, vmask active) {
    const struct trc_material *m = t->snapshot->materials[material];
    struct arrival a;
    struct trc_surface s;
    struct trc_registers regs;
    struct trc_lobes lobes;
    trc_arrival_load(t, index, active, &a);
    trc_arrival_load_samples(t, &a);
    surface_setup(t, &a, m->has, &s);
    if (m->has & TRC_MATERIAL_TRACES_RAYS)
        program_run(t, &a, m, &s, &regs);
    else if (m->instruction_count)
        trc_program_run(m, &s, &regs);
    const vfloat filter = filter_alpha(t, &a);
    trc_lobes_setup(m, &s, &regs, filter, &lobes);
    /* Whitted leaves the glossy light of what has an extent to continuation rays. */
    if (lobes.rare && t->desc->integrator != TRC_INTEGRATOR_DISTRIBUTION)
        lobes.rare &= ~(uint32_t)TRC_LOBES_VELVET;
    if (!t->light_passes)
        lobes.rare &= ~(uint32_t)TRC_LOBES_WHOLE_GLASS;
    if (t->snapshot->features & TRC_FEATURE_SHADOW_TERMINATORS) {
        lobes.rare |= TRC_LOBES_TURN;
        lobes.turn = trc_instance_float(t->snapshot, s.instance,
                                        offsetof(struct trc_instance, terminator_turn), active);
    }
    if (t->desc->film_transparent && t->desc->film_transparent_glass) {
        const float alpha =
            t->desc->film_transparent_roughness * t->desc->film_transparent_roughness;
        lobes.clear_alpha2 = alpha * alpha;
    }
    a.chance = trc_bounce_chance(t, &a, &lobes);
    a.receive_n = m->has & TRC_MATERIAL_LIT_BELOW ? v3_scale(s.n, vf_set(TRC_BOTH_SIDES)) : s.n;
    /* A lobe's own density fits an even world. Matt lobes send no rays. */
    a.world_alone = t->snapshot->world.is_constant && !(m->has & TRC_MATERIAL_IS_MATT);
    if (m->has & TRC_MATERIAL_HAS_HOLDOUT)
        trc_emission_holdout(t, &a, &lobes, active);
    if (m->has & TRC_MATERIAL_HAS_EMISSION)
        trc_emission_surface(t, &a, &s, &lobes, active);
    if (t->extra_passes) /* after what is emitted, which denoisers know before features are taken */
        a.path = data_passes(t, &a, &s, m, &regs, &lobes);
    const vmask last = vi_eq((vint)(a.path & vu_set(TRC_PATH_LAST)), vi_set(TRC_PATH_LAST));
    const vmask on = vm_andnot(active, last);
    if ((m->has & TRC_MATERIAL_HAS_TRANSPARENCY) && vm_any(vm_and(active, last)))
        trc_bounce_straight(t, &a, &s, &lobes, material, vm_and(active, last));
    if (!vm_any(on))
        return;
    if (scatters(m, filter, on)) {
        lobes.below_horizon = s.smooth;
        trc_direct_light(t, &a, &s, &lobes, on);
        lobes.below_horizon = vm_none();
        if ((t->snapshot->features & TRC_FEATURE_AMBIENT_OCCLUSION) &&
            (m->has & TRC_MATERIAL_IS_MATT))
            trc_ambient_light(t, &a, &s, &lobes, on);
    }
    if (t->samples.pass[TRC_PASS_AMBIENT_OCCLUSION][0])
        trc_ambient_pass(t, &a, &s, &lobes, on);
    if (t->desc->integrator == TRC_INTEGRATOR_RAYCAST) {
        if (m->has & TRC_MATERIAL_HAS_TRANSPARENCY)
            trc_bounce_straight(t, &a, &s, &lobes, material, on);
    } else if (vm_any(vm_and(on, vf_gt(lobes.continue_weight, vf_set(0.0f))))) {
        trc_bounce(t, &a, &s, &lobes, material, on);
    }
}

/* Splits rays at shadow catchers; where the background is shown, what of it is behind them too. */
static void catch_shadows(struct trc_tile *t) {
    uint32_t i = t->work.count;
    trc_catcher_split(t);
    for (; i < t->work.count && !t->desc->film_transparent; i += TRC_WIDTH) {
        struct arrival a;
        const vmask active = vm_first((int32_t)(t->work.count - i));
        trc_arrival_load(t, vi_set((int32_t)i) + vi_lane(), active, &a);
        const vuint sample = trc_sample_of(a.slot);
        const vuint row = vu_set(TRC_ROW_BACKGROUND * TRC_CATCHER_BATCH);
        vu_store(a.slots, sample + row);
        trc_emission_misses(t, &a, active);
    }
}

void trc_shade_batch(struct trc_tile *t) {
    if (t->snapshot->features & (TRC_FEATURE_LIGHTS | TRC_FEATURE_ENVIRONMENT) ||
        t->desc->film_transparent || trc_shows_background_motion(t))
        trc_emission_rays(t);
    if (t->snapshot->shadow_class_count && t->generation > 0)
        trc_linked_lights(t);
    if (t->catchers)
        catch_shadows(t);
    trc_rays_reserve(&t->stack, t->work.count * t->hit_branches);
    if (t->splits && t->generation == 0)
        trc_rays_reserve(&t->later, t->work.count);
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
