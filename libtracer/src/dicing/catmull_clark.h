/* Catmull-Clark subdivision: E. Catmull, J. Clark, "Recursively generated B-spline surfaces on
 * arbitrary topological meshes", 1978; creases are cubic B-splines. Limit positions by
 * M. Halstead, M. Kass, T. DeRose, "Efficient, fair interpolation using Catmull-Clark surfaces",
 * 1993. */
#ifndef TRACER_DICING_CATMULL_CLARK_H
#define TRACER_DICING_CATMULL_CLARK_H

#include "dicing/faces.h"

/* One level more, all quadrilaterals. On failure faces stays. TOO_LARGE or OUT_OF_MEMORY. */
trc_status trc_catmull_clark_subdivide(struct trc_faces *faces);

/* Moves the vertices of quadrilaterals to where infinitely many levels would. OUT_OF_MEMORY. */
trc_status trc_catmull_clark_limit(struct trc_faces *faces);

#endif
