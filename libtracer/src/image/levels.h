/* Smaller levels of images (mip maps: L. Williams, "Pyramidal Parametrics", 1983). They hold light:
 * what lookups of the image itself give on average, which for sRGB-encoded bytes is less than the
 * mean of the texels' light, as these are interpolated before they are decoded. */
#ifndef TRACER_IMAGE_LEVELS_H
#define TRACER_IMAGE_LEVELS_H

#include "image/image.h"

/* Adds levels to an image of one, as long as blocks of texels fill it. None to an image with
 * transparency, whose colours mean something only with their own alpha, and none to sRGB-encoded
 * numbers other than bytes, which are rare. OUT_OF_MEMORY; the image is to be freed then. */
trc_status trc_image_make_levels(struct trc_image *image);

#endif
