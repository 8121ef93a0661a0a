/* Light sampling for TRC_WIDTH points at once. Tables are built by shading/lights.c.
 *
 * Numbers of lights: lamps of the scene first, then the world if it shines, then emissive
 * triangles.
 *
 * What n means below: the shading normal (s->n) of a point that scatters to its upper side only, or
 * TRC_BOTH_SIDES times it for one whose material lets light through (translucent, refracting
 * lobes). Lights wholly below the former are not chosen. The same n must be passed when a light is
 * sampled and when a continuation ray of the same point asks for the weights. */
#ifndef TRACER_KERNELS_LIGHT_LIGHT_H
#define TRACER_KERNELS_LIGHT_LIGHT_H

#include "kernels/simd/simd.h"
#include "kernels/trace/surface.h"

#define TRC_BOTH_SIDES 0.25f

struct trc_light_sample {
    vvec3 wi;        /* unit, from the point to the light */
    vfloat distance; /* to the point on the light; TRC_FAR for the sun and the world */
    vvec3 radiance;  /* emitted towards the point, before division by pdf; intensity form for
                        delta lights so that contribution = radiance * f * cos / pdf */
    vfloat density;  /* of the place, per solid angle; 1 for delta lights */
    vfloat pdf;      /* density, times the chance of having chosen this light */
    vmask valid;     /* pdf > 0 and radiance not 0 */
    vmask delta;     /* point light or sun without extent: no MIS */
    vmask no_mis;    /* reflected rays towards wi do not see this light: weight 1 */
    vmask casts_shadow;
    vint light; /* number for sorting shadow rays; emissive triangles and world included */
    /* Where trc_light_table.triangles_ask_rays, in lanes that chose a triangle: what it emits to
     * rays of matt lobes, and those which Cycles finds by such rays alone. */
    vvec3 matt_radiance;
    vmask by_rays;
};

#define TRC_FAR 1e30f
#define TRC_ALL_GROUPS UINT32_MAX

/* Chooses a light by u_select (importance for the point) and a place on it by u1, u2, for the lanes
 * in s->active. Lights that are hidden from diffuse, glossy and transmission alike are not chosen;
 * for one that is hidden from some of them, trc_light_visibility tells which parts of the BSDF to
 * leave out. */
void trc_light_sample(const struct trc_surface *s, vvec3 n, vfloat u_select, vfloat u1, vfloat u2,
                      struct trc_light_sample *out);

/* The same for the world alone, where trc_light_table.world_apart says that trc_light_sample leaves
 * it out. */
void trc_light_sample_world(const struct trc_surface *s, vvec3 n, vfloat u1, vfloat u2,
                            struct trc_light_sample *out);

/* The chances with which the lanes of m chose their lights. */
vfloat trc_light_chosen(const struct trc_surface *s, vvec3 n, const struct trc_light_sample *sample,
                        vmask m);

/* Visibility bits (TRC_VISIBLE_*) of the light each lane chose, none where unblocked rays, by their
 * path, are not to have it; all bits in lanes that chose none. Of scenes whose lights hide from
 * something (trc_light_table.hides). */
vuint trc_light_visibility(const struct trc_snapshot *snapshot,
                           const struct trc_light_sample *sample, vuint path);

/* Rays that were traced from p in direction wi over (tmin, tmax], tmax TRC_FAR for a miss. */
struct trc_light_ray {
    vvec3 p, n, wi; /* n: see above, of the point at p */
    vfloat tmin, tmax;
    vfloat bsdf_pdf; /* of the bounce, per solid angle; < 0 for camera rays and ideal bounces, which
                        have no MIS */
    vfloat light_sample_count; /* L of the point, for the weights */
    vfloat time;
    vuint path;   /* TRC_VISIBLE_* | TRC_PATH_* */
    vuint depths; /* TRC_DEPTH_* */
    vint left;    /* instance at p, -1: none; read where lights are linked */
};

/* Light seen directly by the rays: area, point, spot with extent; where they miss also the sun.
 * Lights do not occlude. group: only lamps of that light group, or TRC_ALL_GROUPS. Adds to radiance
 * what the rays see, MIS-weighted (power heuristic). Of lamps with a shadow class the camera's rays
 * alone. */
void trc_light_hit(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                   uint32_t group, vmask active, vvec3 *radiance);

/* The same under Cycles' clamps: what each lamp gives to a path of that weight is scaled down to
 * the limit (kernels/light/clamp.h). */
void trc_light_hit_clamped(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                           uint32_t group, vvec3 weight, vfloat limit, vmask active,
                           vvec3 *radiance);

/* One lamp, as the other rays see it if nothing is in the way, whatever tmin and tmax are: returns
 * what they see, weighted in the same way, and how far it is, TRC_FAR for the sun. */
vvec3 trc_light_hit_one(const struct trc_snapshot *snapshot, const struct trc_light_ray *ray,
                        uint32_t number, vmask active, vfloat *distance);

/* Shadow classes of the lights in lanes m, 0 elsewhere. */
vuint trc_light_shadow_class(const struct trc_snapshot *snapshot, vint light, vmask m);

/* The light group of a light, 0 for none. Numbers after the last light are ambient occlusion, which
 * belongs to the world where it replaces its light. */
uint32_t trc_light_group(const struct trc_snapshot *snapshot, uint32_t light);

/* MIS weight of emission found on triangle lights by such rays: s is the emissive surface,
 * p_from/n_from the point the ray left, left its instance as trc_light_ray has it. 1 where the
 * triangle is not sampled as a light or bsdf_pdf < 0. */
vfloat trc_light_triangle_weight(const struct trc_surface *s, vvec3 p_from, vvec3 n_from, vint left,
                                 vfloat bsdf_pdf, vfloat light_sample_count);

/* Numbers of the lanes' triangles as lights, -1 for those that are none. */
vint trc_light_of_triangle(const struct trc_surface *s, vmask m);

/* Radiance of the world in direction wi, MIS-weighted in the same way, left as there; 0 where the
 * world is hidden from rays of that path. */
vvec3 trc_world_radiance(const struct trc_snapshot *snapshot, vvec3 p_from, vvec3 n_from, vint left,
                         vvec3 wi, vfloat bsdf_pdf, vfloat light_sample_count, vuint path,
                         vuint depths, vmask active);

#endif
