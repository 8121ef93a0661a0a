/* Lamps from their descriptors (model/light_kinds.def). */
#ifndef TRACER_SHADING_LAMPS_H
#define TRACER_SHADING_LAMPS_H

#include "model/lights.h"

/* False for a lamp that gives no light to anything; its flags are set even then. */
bool trc_lamp_make(const trc_light_desc *desc, struct trc_lamp *lamp);

/* Bounds of a lamp with a place, as the light of that number. */
void trc_lamp_bound(const struct trc_lamp *lamp, uint32_t number, struct trc_light_bound *b);

#endif
