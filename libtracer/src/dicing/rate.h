/* The dicing rate: how long an edge may be at its place. */
#ifndef TRACER_DICING_RATE_H
#define TRACER_DICING_RATE_H

#include <stdbool.h>

#include "tracer/geometry.h"

/* Of an edge between two points of the object. One that is not finite stays. */
bool trc_edge_is_too_long(const trc_dicing_desc *how, const float a[3], const float b[3]);

#endif
