/* Radiance of the world's material. */
#ifndef TRACER_KERNELS_LIGHT_WORLD_H
#define TRACER_KERNELS_LIGHT_WORLD_H

#include "kernels/program/program.h"

/* What rays that leave the scene along direction (unit) see, 0 in lanes that are not active; path
 * is TRC_VISIBLE_* | TRC_PATH_* and depths TRC_DEPTH_* for the Light Path node. The world's
 * visibility is the caller's business. A constant world costs a broadcast. */
vvec3 trc_world_shade(const struct trc_snapshot *snapshot, vvec3 direction, vuint path,
                      vuint depths, vmask active);

/* The same to rays by the lobes that send them: diffuse (translucent where it goes behind the
 * surface), glossy, transmission. depths: of what met the surface that they leave. */
void trc_world_shade_kinds(const struct trc_snapshot *snapshot, vvec3 direction, vmask behind,
                           vuint depths, vmask active, vvec3 seen_out[3]);

/* Runs the world's material, which there must be; the same arguments. */
const struct trc_material *trc_world_run(const struct trc_snapshot *snapshot, vvec3 direction,
                                         vuint path, vuint depths, vmask active,
                                         struct trc_registers *regs);

/* trc_kernels.world_evaluate. Any length of directions but 0. Light Path is no kind of ray, as when
 * Cycles fills its importance map: what only the camera sees does not count. */
void trc_world_evaluate(const struct trc_snapshot *snapshot, const float *directions,
                        float *radiance, uint32_t count);

#endif
