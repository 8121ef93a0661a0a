/* Materials of the measured frames. */
#ifndef TRACER_BENCH_FRAMES_PALETTE_H
#define TRACER_BENCH_FRAMES_PALETTE_H

#include "spec.h"
#include "tracer/tracer.h"

#define PALETTE_SIZE 8

/* Creates the materials of a kind of surface: slot i is for every PALETTE_SIZE-th object.
 * SURFACE_PAPER is as in Boulos et al. 2007: all reflect, most with a diffuse part beside, and one
 * object in eight is of glass; where the integrator distributes rays, reflections are glossy. */
trc_status palette_create(trc_scene scene, enum surface surface, bool rough,
                          trc_id materials_out[PALETTE_SIZE]);

#endif
