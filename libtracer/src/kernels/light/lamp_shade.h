/* What the node trees of lamps emit. */
#ifndef TRACER_KERNELS_LIGHT_LAMP_SHADE_H
#define TRACER_KERNELS_LIGHT_LAMP_SHADE_H

#include "kernels/simd/simd.h"
#include "model/lights.h"

/* Points and the lamps they see. */
struct trc_lamp_view {
    const struct trc_snapshot *scene;
    const struct trc_light_table *table;
    vint light;      /* numbers of lamps, of the lanes asked for */
    vvec3 p, wi;     /* the point; unit, from there to a place on the lamp */
    vfloat distance; /* to that place; TRC_FAR for a distant lamp */
    vfloat time;
    vuint depths; /* TRC_DEPTH_* that the point has behind it */
};

/* What the programs of the lanes' lamps emit towards the points; white for those without. */
vvec3 trc_lamp_emission(const struct trc_lamp_view *view, vmask m);

/* trc_kernels.lamp_measure. */
void trc_lamp_measure(const struct trc_snapshot *scene, const struct trc_light_table *table,
                      uint32_t number, const struct trc_light_bound *bound, float reach,
                      float mean[3]);

#endif
