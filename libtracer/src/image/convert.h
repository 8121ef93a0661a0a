/* Colours of any colour space to scene-linear ones. */
#ifndef TRACER_IMAGE_CONVERT_H
#define TRACER_IMAGE_CONVERT_H

#include <stdbool.h>

#include "image/image.h"

/* What a file's or a caller's colours are. */
struct trc_color_source {
    const char *config, *space; /* an OpenColorIO configuration, a colour space in it */
    bool is_grey;               /* of one channel */
    bool is_multiplied;         /* by alpha: converted as they are without it */
};

/* Converts the first level of an image, the only one. As in Cycles, bytes and words become half
 * floats, unless the space is scene-linear, and grey stays grey: the mean of what the three
 * channels become. Texels may be NaN or infinite after. As trc_image_reader_convert; the image is
 * to be freed if it fails. */
trc_status trc_image_to_scene_linear(struct trc_image *image, const struct trc_image_source *from,
                                     const struct trc_color_source *source);

#endif
