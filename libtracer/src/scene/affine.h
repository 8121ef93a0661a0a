/* Algebra of 3x4 transforms for commits, in doubles. */
#ifndef TRACER_SCENE_AFFINE_H
#define TRACER_SCENE_AFFINE_H

#include <stdbool.h>

#include "model/snapshot.h"

extern const struct trc_affine trc_affine_identity;

/* Whether it leaves every point where it is. */
bool trc_affine_is_identity(const struct trc_affine *a);

/* Whether it keeps angles, but for rounding. */
bool trc_affine_keeps_angles(const struct trc_affine *a);

bool trc_affine_is_finite(const struct trc_affine *a);

/* Whether the transform can be undone in floats; then *inverse_out is its inverse. Not finite or
 * singular ones cannot, and leave the output alone. */
bool trc_affine_invert(const struct trc_affine *a, struct trc_affine *inverse_out);

/* Whether it maps all of space so close to a plane that rays are not to be taken through an
 * inverse: one that is flat, or would be but for rounding, or nearly so. Nothing of what is not
 * finite. */
bool trc_affine_is_thin(const struct trc_affine *a);

/* The inverse of a thin transform. Where there is none, that on the plane that all is mapped to;
 * what lies off it goes along the direction that was lost. False, and the output is left alone,
 * where all is mapped to a line or a point, or something is not finite. */
bool trc_affine_invert_thin(const struct trc_affine *a, struct trc_affine *inverse_out);

/* Sign of the determinant of the linear part: true for a mirror. */
bool trc_affine_flips(const struct trc_affine *a);

/* Scale taken out: the axes become unit vectors and keep their directions, shear and mirroring.
 * *volume_out is that of the solid that they span, in (0, 1]: 1 where they are perpendicular. False
 * (outputs untouched) if the transform is not finite or singular. */
bool trc_affine_make_unit(const struct trc_affine *a, struct trc_affine *unit_out,
                          float *volume_out);

#endif
