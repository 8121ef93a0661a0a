/* What shading a group of hits is made of, each in a source of its own. */
#ifndef TRACER_KERNELS_TILE_SHADE_H
#define TRACER_KERNELS_TILE_SHADE_H

#include "kernels/light/light.h"
#include "kernels/tile/arrival.h"

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

/* ---- light that rays find (kernels/tile/emission.c) ---- */

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

/* ---- light that samples bring (kernels/tile/direct.c) ---- */

/* What a light sample brings. */
struct light_result {
    vvec3 diffuse, glossy, transmission; /* unshadowed contributions */
    vfloat lamp;                         /* and that to the Shadow pass */
};

void trc_direct_light(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                      const struct trc_lobes *lobes, vmask active);

/* Adds the lanes' shadow rays to the queue. cell: where on the light, for sorting, below
 * TRC_DIRECTION_CELLS. */
void trc_shadow_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_light_sample *l, const struct light_result *r, vuint cell,
                     vmask active);

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
