/* Names of attributes, interned: equal names have equal numbers within one scene, so that meshes
 * and compiled materials meet by comparing integers. Numbers are never reused while the scene
 * lives. Calls on one table must not overlap. */
#ifndef TRACER_MODEL_NAMES_H
#define TRACER_MODEL_NAMES_H

#include <stdint.h>

#include "tracer/base.h"

/* Longest name in bytes, without the terminator. */
#define TRC_MAX_NAME_BYTES 63

struct trc_names;

/* NULL when out of memory. */
struct trc_names *trc_names_create(void);
void trc_names_destroy(struct trc_names *names);

/* The number of a name, which is added if it is new. INVALID_ARGUMENT (NULL), TOO_LARGE (longer
 * than TRC_MAX_NAME_BYTES, too many) or OUT_OF_MEMORY. */
trc_status trc_names_add(struct trc_names *names, const char *name, uint32_t *number_out);

#endif
