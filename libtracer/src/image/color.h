/* Transforms between colour spaces of an OpenColorIO configuration, through OpenImageIO. No
 * exception leaves these functions. One transform is one thread's. */
#ifndef TRACER_IMAGE_COLOR_H
#define TRACER_IMAGE_COLOR_H

#include <stdint.h>

#include "tracer/base.h"

TRC_BEGIN_DECLS

struct trc_color_transform;

/* The transform from a colour space to the one that the configuration, a file, has for the role
 * scene_linear; NULL where it changes nothing. IMAGE with the reason, OUT_OF_MEMORY. Cost: the
 * configuration and its tables are read anew, milliseconds. */
trc_status trc_color_open(const char *config, const char *space,
                          struct trc_color_transform **transform_out);

/* Transforms count colours in place, each followed by an alpha that stays. */
trc_status trc_color_apply(const struct trc_color_transform *transform, float *rgba,
                           uint32_t count);

/* NULL is fine. */
void trc_color_close(struct trc_color_transform *transform);

TRC_END_DECLS

#endif
