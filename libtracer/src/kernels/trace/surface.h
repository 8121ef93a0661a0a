/* Shading points: TRC_WIDTH of them side by side, and the registers of a material's program. */
#ifndef TRACER_KERNELS_TRACE_SURFACE_H
#define TRACER_KERNELS_TRACE_SURFACE_H

#include "kernels/simd/simd.h"
#include "model/material.h"
#include "model/snapshot.h"

/* What kind of ray arrived, for Light Path and for visibility: TRC_VISIBLE_* and UNBLOCKED in the
 * low bits. */
enum {
    TRC_PATH_SINGULAR = 1 << 8,                /* last bounce was ideal */
    TRC_PATH_REFLECTED = 1 << 9,               /* last bounce was a reflection */
    TRC_PATH_TRANSPARENT_BACKGROUND = 1 << 10, /* only straight through so far: film alpha */
    TRC_PATH_WORLD_ALONE = 1 << 11, /* no light sample of the world was taken at the last bounce */
    TRC_PATH_PORTALS_SHIFT = 20     /* how many portals it went through, 3 bits, saturating */
};
#define TRC_PATH_PORTALS 7u

/* Those that tell what lobe or light sample sent a ray. */
#define TRC_PATH_KIND ((uint32_t)(TRC_VISIBLE_ALL | TRC_PATH_SINGULAR | TRC_PATH_REFLECTED))

/* The kinds of rays that rough lobes send: matt ones (through the surface in the lanes of behind),
 * glossy ones, and those that transmit. */
TRC_INLINE void trc_lobe_rays(vmask behind, vuint kinds_out[3]) {
    const vint matt = vi_select(behind, vi_set(TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_TRANSMISSION),
                                vi_set(TRC_VISIBLE_DIFFUSE | TRC_PATH_REFLECTED));
    kinds_out[0] = (vuint)matt;
    kinds_out[1] = vu_set(TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED);
    kinds_out[2] = vu_set(TRC_VISIBLE_TRANSMISSION);
}

/* In place of an instance's number: a world lookup, and the first lamp, below which others follow.
 */
enum { TRC_WORLD_LOOKUP = -1, TRC_FIRST_LAMP = -2 };

struct trc_probe; /* kernels/program/tracing.h */

/* A ray's four depth counters, 8 bits each, saturating by the limits on desc. */
enum {
    TRC_DEPTH_ALL_SHIFT = 0,
    TRC_DEPTH_GLOSSY_SHIFT = 8,
    TRC_DEPTH_TRANSMISSION_SHIFT = 16,
    TRC_DEPTH_TRANSPARENT_SHIFT = 24
};
TRC_INLINE vuint trc_depth_of(vuint depths, int shift) { return (depths >> shift) & vu_set(255u); }

/* Counters with one bounce more, which the kind of the one that shift is of counts, too. */
TRC_INLINE vuint trc_depths_beyond(vuint depths, int shift) {
    return depths + vu_set(1u << TRC_DEPTH_ALL_SHIFT | 1u << shift);
}

struct trc_surface {
    const struct trc_snapshot *snapshot;
    const struct trc_probe *probe;       /* what its program traces rays with; NULL: none */
    const struct trc_light_table *lamps; /* where the instance is a lamp */
    vmask active;
    vint instance, triangle; /* of the lanes in active; see above */
    vfloat u, v;             /* barycentrics, see query.h */
    vfloat time;
    vint strand; /* of curves, see struct trc_left_strands; -1: none; only where there are curves */
    vvec3 p;     /* world position */
    vvec3 p_error;    /* bound of its rounding error per axis, world */
    vvec3 ng;         /* geometric normal, unit, on the side of wo */
    vvec3 n;          /* shading normal, unit, on the side of wo as Cycles has it */
    vvec3 wo;         /* unit, towards where the ray came from */
    vmask backfacing; /* the ray came from the back of the winding */
    vmask smooth;     /* n is interpolated */
    vvec3 bulge;      /* from p to the curved surface that the normals describe, on the side of wo;
                         0 where that is not above the triangle or where not smooth */
    vfloat ray_length;
    vuint path;                /* TRC_VISIBLE_* | TRC_PATH_* */
    vuint depths;              /* TRC_DEPTH_* */
    vfloat footprint;          /* width of the ray's cone at p, world, for texture filters */
    vfloat pixel;              /* how far the next pixel's ray is from p, world, for slopes */
    vfloat raster_x, raster_y; /* window coordinates [0, 1] */
};

/* What rays that leave s keep of the strand: its instance, TRC_NO_HIT of none, and it. */
TRC_INLINE void trc_strand_words(const struct trc_surface *s, vuint out[2]) {
    const vmask none = vi_lt(s->strand, vi_set(0));
    out[0] = (vuint)vi_select(none, vi_set((int32_t)TRC_NO_HIT), s->instance);
    out[1] = (vuint)s->strand;
}

/* Directions in which the first and the second coordinate of the surface grow, turned over where
 * the ray came from the back, not unit: along strands (twice), of triangles the sides from the
 * first corner. Of the active lanes. (kernels/trace/surface.c) */
void trc_surface_sides(const struct trc_surface *s, vvec3 *first, vvec3 *second);

/* What bulge would be on the side away from wo, for light that comes through: loads the triangles
 * once more, so it is for the few lanes that ask. Of lanes that are smooth, at least one; others
 * are undefined. (kernels/trace/surface.c) */
vvec3 trc_bulge_behind(const struct trc_surface *s, vmask lanes);

/* The unit normal of triangles at u and v, on the side of the ray: between those of the corners
 * where the surface is smooth, s->n elsewhere; other lanes are undefined. Loads the triangles once
 * more. (kernels/trace/surface.c) */
vvec3 trc_normal_between(const struct trc_surface *s, vmask lanes);

/* Lanes whose surface is a strand's. */
TRC_INLINE vmask trc_on_strand(const struct trc_surface *s) {
    if (!(s->snapshot->features & TRC_FEATURE_CURVES))
        return vm_none();
    return vm_not(vi_lt(s->strand, vi_set(0)));
}

/* trc_surface_fetch where there are curves, and where there are none. */
void trc_mixed_fetch(struct trc_surface *s);
void trc_triangle_fetch(struct trc_surface *s);

/* Fills p, p_error, ng, n, backfacing, smooth, bulge from instance, triangle, u, v, time, wo.
 * (kernels/trace/surface.c) */
TRC_INLINE void trc_surface_fetch(struct trc_surface *s) {
    if (s->snapshot->features & TRC_FEATURE_CURVES)
        trc_mixed_fetch(s);
    else
        trc_triangle_fetch(s);
}

#endif
