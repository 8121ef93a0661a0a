/* Ambient occlusion: rays from diffuse lobes by the cosine, along with the shadow rays. Diffuse
 * lobes are not continued, so the random numbers of the continuation ray are free for them. */
#include <stddef.h>

#include "kernels/light/clamp.h"
#include "kernels/tile/shade.h"
#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/spawn.h"
#include "model/lights.h"

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
    const vfloat limit = trc_clamp_limit(t->desc, sees_directly(a->depths)) * split_scale(t, a);
    return v3_scale(white, trc_clamp_factor(v3_mul(a->weight, alpha), limit));
}

/* The world's light on diffuse lobes from wi, drawn by the cosine to n. */
static vvec3 ambient_world(const struct trc_tile *t, const struct trc_surface *s,
                           const struct trc_lobes *lobes, vvec3 n, vvec3 wi, vmask active) {
    struct trc_bsdf_value f;
    trc_bsdf_eval(lobes, s, wi, active, active, &f);
    const vfloat one = vf_set(1.0f), no_mis = vf_set(-1.0f);
    const vvec3 world = trc_world_radiance(
        t->snapshot, s->p, n, s->instance, wi, no_mis, one, vu_set(TRC_VISIBLE_DIFFUSE),
        trc_depths_beyond(s->depths, TRC_DEPTH_ALL_SHIFT), active);
    const vfloat cosine = vf_max(v3_dot(n, wi), vf_set(1e-6f));
    return v3_scale(v3_mul(f.diffuse, world), vf_divide(vf_set(TRC_PI), cosine));
}

/* How far rays of the lanes' objects go where ambient light takes the place of the world's. */
static vfloat ambient_distance(const struct trc_surface *s) {
    const vfloat own = trc_instance_float(s->snapshot, s->instance,
                                          offsetof(struct trc_instance, ao_distance), s->active);
    return vf_select(vf_gt(own, vf_set(0.0f)), own, vf_set(s->snapshot->world.ao_distance));
}

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
    const vfloat distance = adds ? vf_set(world->ao_distance) : ambient_distance(s);
    struct arrival own = *a;
    own.path = a->path | vu_set(adds ? TRC_PATH_CLAMPED : 0);
    v3_frame(n, &x, &y);
    trc_shadow_reserve(t, sample_count);
    /* Those that replace the world's light stand for rays of matt lobes. */
    const uint32_t kind = adds ? TRC_VISIBLE_SHADOW : TRC_VISIBLE_DIFFUSE | TRC_PATH_REFLECTED;
    /* Packets of their own: numbered after all lights. */
    const int32_t number = (int32_t)(lights->first_triangle + lights->triangle_count);
    for (uint32_t l = 0; l < sample_count; l++) {
        vfloat u[2];
        trc_samples(&t->sampler, a->pixel, a->sample, dimension, 2, l, sample_count, u);
        const struct trc_light_sample sample = {
            .wi = v3_from_frame(trc_warp_cosine(u[0], u[1]), x, y, n),
            .distance = distance,
            .light = vi_set(number)};
        const vvec3 light = adds ? white : ambient_world(t, s, lobes, n, sample.wi, active);
        const struct light_result r = {
            .diffuse = v3_mul(weight, light), .is_blocked = vm_all_set(), .kind = vu_set(kind)};
        const vfloat size = v3_max(v3_abs(r.diffuse));
        const vmask lit = vm_and(active, is_light(size));
        if (!vm_any(lit))
            continue;
        const vuint cell = trc_direction_cell(sample.wi);
        if (adds) {
            trc_shadow_push(t, &own, s, &sample, &r, cell, lit);
        } else {
            /* They start as rays of the path do. */
            const vvec3 o = trc_spawn_origin(s, goes_out(s, sample.wi));
            trc_shadow_push_from(t, &own, s, &sample, &r, &o, cell, lit);
        }
    }
}

void trc_ambient_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
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
void trc_ambient_pass(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                      const struct trc_lobes *lobes, vmask active) {
    const vint camera = vi_set(TRC_VISIBLE_CAMERA);
    active = vm_and(active, vi_eq((vint)a->path & camera, camera));
    active = vm_andnot(active, trc_lobes_are_holdout(lobes));
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
        .light = vi_set((int32_t)(lights->first_triangle + lights->triangle_count))};
    const vvec3 one = v3(vf_set(1.0f), vf_set(1.0f), vf_set(1.0f));
    const vvec3 alpha = v3_sub(one, trc_lobes_transparency(lobes));
    const struct light_result r = {
        .diffuse = v3_mul(a->weight, alpha),
        .is_blocked = t->snapshot->world.ao_distance > 0.0f ? vm_all_set() : vm_none(),
        .kind = vu_set(TRC_VISIBLE_SHADOW)};
    active = vm_and(active, vf_gt(v3_max(r.diffuse), vf_set(0.0f)));
    struct arrival own = *a;
    own.path = a->path | vu_set(TRC_PATH_OCCLUSION);
    if (t->catchers) {
        own.slot = trc_sample_of(a->slot);
        active = vm_andnot(active, trc_is_unblocked(a->path));
    }
    if (vm_any(active))
        trc_shadow_push(t, &own, s, &sample, &r, trc_direction_cell(sample.wi), active);
}
