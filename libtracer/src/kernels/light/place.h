/* A place on a light as a point sees it. */
#ifndef TRACER_KERNELS_LIGHT_PLACE_H
#define TRACER_KERNELS_LIGHT_PLACE_H

#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"

struct trc_place {
    vvec3 wi, radiance;
    vfloat distance, pdf;
};

#endif
