/* What single scattering on a rough surface keeps: tables for kernels/lobe/ggx_energy.h, which says
 * where their points lie. tests/support/energy_tables.py reads the sizes here and writes the
 * tables. */
#ifndef TRACER_MODEL_GGX_ENERGY_TABLES_H
#define TRACER_MODEL_GGX_ENERGY_TABLES_H

#include <stdint.h>

#define TRC_GGX_ENERGY_SIZE 48
#define TRC_GGX_ENERGY_MEANS 189 /* four to a row */
/* From inside, where the critical angle moves with the index, more slices are needed. */
#define TRC_GLASS_ENERGY_INSIDE 26
#define TRC_GLASS_ENERGY_OUTSIDE 11
#define TRC_GLASS_ENERGY_ROWS 32
#define TRC_GLASS_ENERGY_COLUMNS 36
#define TRC_GLASS_ENERGY_MEANS \
    ((TRC_GLASS_ENERGY_INSIDE + TRC_GLASS_ENERGY_OUTSIDE) * TRC_GLASS_ENERGY_ROWS)
#define TRC_GLASS_ENERGY_COUNT (TRC_GLASS_ENERGY_MEANS * TRC_GLASS_ENERGY_COLUMNS)
#define TRC_GLASS_SHARE_SLICES 5 /* for each side of the surface */
#define TRC_GLASS_SHARE_ROWS 5
#define TRC_GLASS_SHARE_COLUMNS 9
#define TRC_GLASS_SHARE_REACH 0.5f /* an ior of 3 or 1/3 */
#define TRC_SHARE_SLICES 13
#define TRC_SHARE_ROWS 8
#define TRC_SHARE_COLUMNS 12

/* Albedos in parts of 65535, two of which one gather reads. */

/* Of reflection with height-correlated masking, no Fresnel factor. */
extern const uint16_t trc_ggx_energy[TRC_GGX_ENERGY_SIZE * TRC_GGX_ENERGY_SIZE];
/* Its mean over the cosine-weighted hemisphere, by sqrt(alpha). */
extern const float trc_ggx_energy_mean[TRC_GGX_ENERGY_MEANS];
/* Of reflection and refraction together, separable masking, Fresnel by micro-normal; slices from
 * inside first. */
extern const uint16_t trc_glass_energy[TRC_GLASS_ENERGY_COUNT];
/* The same with height-correlated masking. */
extern const uint16_t trc_correlated_glass_energy[TRC_GLASS_ENERGY_COUNT];
/* Its mean over the cosine-weighted hemisphere, by slice and row. */
extern const uint16_t trc_correlated_glass_energy_mean[TRC_GLASS_ENERGY_MEANS];
/* Which part of trc_glass_energy is reflected: what colours light that scatters more than once,
 * where the factor of the macro normal is far off (rough glass from inside). */
extern const float
    trc_glass_share[2 * TRC_GLASS_SHARE_SLICES * TRC_GLASS_SHARE_ROWS * TRC_GLASS_SHARE_COLUMNS];
/* How far the albedo of reflection at a dielectric, over that without a Fresnel factor, is from F0
 * to 1. */
extern const float
    trc_dielectric_share_table[TRC_SHARE_SLICES * TRC_SHARE_ROWS * TRC_SHARE_COLUMNS];
/* The same by Schlick's approximation. */
extern const float trc_schlick_share_table[TRC_SHARE_ROWS * TRC_SHARE_COLUMNS];

#endif
