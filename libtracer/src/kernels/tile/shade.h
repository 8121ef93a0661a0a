/* What shading a group of hits is made of, each in a source of its own. */
#ifndef TRACER_KERNELS_TILE_SHADE_H
#define TRACER_KERNELS_TILE_SHADE_H

#include "kernels/light/clamp.h"
#include "kernels/light/light.h"
#include "kernels/tile/arrival.h"
#include "model/lights.h"

/* Lanes that have not bounced yet. */
TRC_INLINE vmask sees_directly(vuint depths) {
    return vi_eq((vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT), vi_set(0));
}

TRC_INLINE vmask goes_out(const struct trc_surface *s, vvec3 w) {
    return vf_ge(v3_dot(w, s->ng), vf_set(0.0f));
}

/* Lanes whose light, by its largest channel, is some and finite. */
#define FINITE_LIGHT 3e38f
TRC_INLINE vmask is_light(vfloat size) {
    return vm_and(vf_gt(size, vf_set(0.0f)), vf_lt(size, vf_set(FINITE_LIGHT)));
}

/* Shadow rays end this much before the light, as a fraction of their length: mesh lights must not
 * shade themselves, whatever the rounding of both ends. */
#define SHADOW_END (1.0f - 2e-5f)

/* ---- light that rays find (kernels/tile/emission.c) ---- */

/* What the lanes' rays left, where lights are linked. */
TRC_INLINE vint left_before(const struct trc_tile *t, const struct arrival *a) {
    return t->snapshot->lights->linked ? (vint)word_column(t->work.w[TRC_RAY_LEFT], a) : vi_set(-1);
}

/* What the clamps' limits are to be multiplied by: light of rays that are one of two is clamped as
 * if they were the only ones, as in Cycles. */
TRC_INLINE vfloat split_scale(const struct trc_tile *t, const struct arrival *a) {
    return t->scales_clamps ? column(t->work.f[TRC_RAY_SPLIT_SCALE], a) : vf_set(1.0f);
}

/* The limit of what rays find by themselves: what one bounce shows is direct light. */
TRC_INLINE vfloat found_limit(const struct trc_tile *t, const struct arrival *a) {
    const vint depth = (vint)trc_depth_of(a->depths, TRC_DEPTH_ALL_SHIFT);
    return trc_clamp_limit(t->desc, vi_lt(depth, vi_set(2))) * split_scale(t, a);
}

/* The rays as lights want them, up to their end. */
TRC_INLINE struct trc_light_ray light_ray(const struct trc_tile *t, const struct arrival *a,
                                          vfloat end) {
    /* It is surfaces alone that rays look back for. */
    return (struct trc_light_ray){
        .p = a->o,
        .n = a->n_from,
        .wi = a->d,
        .tmin = vf_max(a->tmin, vf_set(0.0f)),
        .tmax = end,
        .bsdf_pdf = a->pdf,
        .light_sample_count = light_count_before(t, a->depths),
        .time = a->time,
        .path = a->path,
        .depths = a->depths,
        .left = left_before(t, a),
    };
}

/* Of the lanes that met the emissive surface s, those whose rays left what it lights, and the
 * camera's. */
vmask trc_emission_linked(const struct trc_tile *t, const struct arrival *a,
                          const struct trc_surface *s, vmask active);

/* Of lights that rays pass and of the world, of all rays of t->work. */
void trc_emission_rays(struct trc_tile *t);

/* Of the world, for rays that left the scene. */
void trc_emission_misses(struct trc_tile *t, const struct arrival *a, vmask missed);

/* Of the surfaces hit. */
void trc_emission_surface(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_lobes *lobes, vmask active);

/* What holdout leaves cut out of the film. */
void trc_emission_holdout(struct trc_tile *t, const struct arrival *a,
                          const struct trc_lobes *lobes, vmask active);

/* Of lights with a shadow class, of all rays of t->work that bounced. (kernels/tile/linked.c) */
void trc_linked_lights(struct trc_tile *t);

/* ---- light that samples bring (kernels/tile/direct.c) ---- */

/* What a light sample brings. */
struct light_result {
    vvec3 diffuse, glossy, transmission; /* unshadowed contributions */
    vfloat lamp;                         /* and that to the Shadow pass */
    vfloat alpha2; /* mean square alpha of the lobes of glossy and transmission; read where shadow
                      rays know of pixels */
    vmask is_blocked; /* by what is in the way, other samples by nothing */
    vuint kind;       /* of the rays, TRC_PATH_KIND */
};

void trc_direct_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                      const struct trc_lobes *lobes, vmask active);

/* Adds the lanes' shadow rays to the queue. cell: where on the light, for sorting, below
 * TRC_DIRECTION_CELLS. */
void trc_shadow_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_light_sample *l, const struct light_result *r, vuint cell,
                     vmask active);

/* The same of rays that start at o. */
void trc_shadow_push_from(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                          const struct trc_light_sample *l, const struct light_result *r,
                          const vvec3 *o, vuint cell, vmask active);

/* ---- ambient occlusion (kernels/tile/ambient.c) ---- */

/* Light by the world's ambient occlusion. */
void trc_ambient_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                       const struct trc_lobes *lobes, vmask active);

/* One ray for each lane that the camera sees, also through what is transparent, for the pass. */
void trc_ambient_pass(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                      const struct trc_lobes *lobes, vmask active);

/* ---- continuation rays (kernels/tile/bounce.c) ---- */

/* Chance that the one continuation ray is traced at all, of arrival.chance. */
vfloat trc_bounce_chance(const struct trc_tile *t, const struct arrival *a,
                         const struct trc_lobes *lobes);

/* Sends rays on by the lobes, by all or one of them. material: the one they leave. */
void trc_bounce(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                const struct trc_lobes *lobes, uint32_t material, vmask active);

/* Straight on through transparency alone, for rays that may not bounce any more. */
void trc_bounce_straight(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                         const struct trc_lobes *lobes, uint32_t material, vmask active);

#endif
