/* The surface at hits of curves. */
#ifndef TRACER_KERNELS_TRACE_CURVE_SURFACE_H
#define TRACER_KERNELS_TRACE_CURVE_SURFACE_H

#include "kernels/trace/surface.h"

/* Active lanes that hit curves. */
vmask trc_curve_lanes(const struct trc_surface *s);

/* What trc_surface_fetch fills, of those lanes; what others have stays. v, which normals are made
 * of, becomes 0: with u, barycentrics of the piece's ends. */
void trc_curve_fetch(struct trc_surface *s, vmask lanes);

/* Of a surface that was fetched, of those lanes: along the strand in the world, unit. */
vvec3 trc_curve_along(const struct trc_surface *s, vmask lanes);

/* The true normal of a surface that was fetched, as nodes are told it: of ribbons, which face the
 * ray, the way that it came from. */
vvec3 trc_curve_true_normal(const struct trc_surface *s);

#endif
