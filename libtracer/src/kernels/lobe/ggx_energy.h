/* Energy that single scattering on a GGX surface keeps, for the two models that put the rest back.
 *
 * Tables are integrals of the models in microfacet.h (tests/support/energy_tables.py);
 * tests/kernels/wide/test_furnace.c checks them. Rows go by sqrt(alpha).
 * Columns of reflection, and of glass from outside, go by sqrt(cos / (cos + sqrt(alpha) sin)) of
 * theta_o: what is masked depends on alpha tan(theta_o), and this follows it half way, so that the
 * valley at grazing angles runs along a column. From inside, where the critical angle is another
 * valley, they go by sqrt(cos). Slices of glass go by the power 3/8 of |ior - 1| / (ior + 1) from 0
 * to 1, an infinite index, first those of rays from inside (ior < 1), then from outside.
 * Interpolation is linear, by cubics across slices. For roughness and cos from 0.1 and 0.05 it is
 * off by at most 0.001 of reflection and of glass from outside, 0.0025 from inside.
 *
 * Tables of shares have rows and columns by square roots too; slices of the first by the square
 * root of the same, of the second by sqrt((ior - 1) / (ior + 1)).
 *
 * Model of the missing energy: C. Kulla and A. Conty, "Revisiting Physically Based Shading at
 * Imageworks" (2017). */
#ifndef TRACER_KERNELS_LOBE_GGX_ENERGY_H
#define TRACER_KERNELS_LOBE_GGX_ENERGY_H

#include "kernels/lobe/microfacet.h"
#include "model/ggx_energy_tables.h"

/* Cell and fraction of x in [0, 1] on a grid of size points. */
TRC_INLINE vint trc_grid_cell(vfloat x, int size, vfloat *fraction) {
    const vfloat scaled = vf_saturate(x) * vf_set((float)(size - 1));
    const vfloat cell = vf_min(vf_floor(scaled), vf_set((float)(size - 2)));
    *fraction = scaled - cell;
    return vf_to_int(cell);
}
TRC_INLINE vfloat trc_grid_row(const float *table, vint at, vfloat x) {
    const vmask all = vm_all_set();
    return vf_lerp(vf_gather(table, at, all), vf_gather(table + 1, at, all), x);
}
/* Between the four points of a cell of a slice with so many columns. */
TRC_INLINE vfloat trc_grid_slice(const float *table, int columns, vint at, vfloat x, vfloat y) {
    return vf_lerp(trc_grid_row(table, at, x), trc_grid_row(table + columns, at, x), y);
}
/* As trc_grid_row in a table of parts of TRC_ENERGY_PARTS; the result is in such parts, too. */
#define TRC_ENERGY_PARTS 65535.0f
TRC_INLINE vfloat trc_energy_row(const uint16_t *table, vint at, vfloat x) {
    const vuint pair = vu_gather_pair(table, at);
    return vf_lerp(vi_to_float((vint)(pair & vu_set(0xffff))), vi_to_float((vint)(pair >> 16)), x);
}
/* Where the columns of energies lie, but for glass from inside; root: of alpha. */
TRC_INLINE vfloat trc_energy_column(vfloat cos_theta, vfloat root) {
    const vfloat c = vf_clamp(cos_theta, 1e-6f, 1.0f);
    const vfloat s = vf_safe_sqrt((vf_one() - c) * (vf_one() + c));
    return vf_sqrt(c / (c + root * s));
}

TRC_INLINE vfloat trc_ggx_albedo(vfloat cos_theta, vfloat alpha) {
    vfloat x, y;
    const vfloat root = vf_safe_sqrt(alpha);
    const vint column = trc_grid_cell(trc_energy_column(cos_theta, root), TRC_GGX_ENERGY_SIZE, &x);
    const vint row = trc_grid_cell(root, TRC_GGX_ENERGY_SIZE, &y);
    const vint at = row * vi_set(TRC_GGX_ENERGY_SIZE) + column;
    const vfloat parts = vf_lerp(trc_energy_row(trc_ggx_energy, at, x),
                                 trc_energy_row(trc_ggx_energy + TRC_GGX_ENERGY_SIZE, at, x), y);
    return parts * vf_set(1.0f / TRC_ENERGY_PARTS);
}
TRC_INLINE vfloat trc_ggx_mean_albedo(vfloat alpha) {
    vfloat y;
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_GGX_ENERGY_MEANS, &y);
    return trc_grid_row(trc_ggx_energy_mean, row, y);
}

/* Points of the integral for anisotropic surfaces: a Fibonacci lattice. */
#define TRC_ANISOTROPIC_POINTS 89
#define TRC_ANISOTROPIC_STEP 55
/* What single scattering keeps where alpha_x and alpha_y differ, of light from wo in the lobe's
 * frame: the mean over visible normals of what is not masked again. A table would have four
 * dimensions. For roughness from 0.1, cos from 0.05 and an anisotropy to 0.95 off by at most 0.012,
 * 0.004 in the mean square. */
TRC_INLINE vfloat trc_ggx_anisotropic_albedo(vvec3 wo, vfloat alpha_x, vfloat alpha_y) {
    const vvec3 o = v3(wo.x, wo.y, vf_max(wo.z, vf_set(1e-6f)));
    const vfloat ax2 = alpha_x * alpha_x, ay2 = alpha_y * alpha_y;
    const vfloat before =
        vf_one() + trc_ggx_lambda((ax2 * o.x * o.x + ay2 * o.y * o.y) / (o.z * o.z));
    vfloat sum = vf_zero();
    for (int k = 0; k < TRC_ANISOTROPIC_POINTS; k++) {
        const float scale = 1.0f / TRC_ANISOTROPIC_POINTS;
        const float turn = (float)(k * TRC_ANISOTROPIC_STEP % TRC_ANISOTROPIC_POINTS);
        const vvec3 m = trc_ggx_sample(o, alpha_x, alpha_y, vf_one(), vf_set((turn + 0.5f) * scale),
                                       vf_set(((float)k + 0.5f) * scale));
        const vvec3 i = v3_reflect(o, m);
        const vfloat tan2 = (ax2 * i.x * i.x + ay2 * i.y * i.y) / (i.z * i.z);
        const vfloat seen = before / (before + trc_ggx_lambda(tan2));
        sum = sum + vf_where(vf_gt(i.z, vf_zero()), seen);
    }
    return sum * vf_set(1.0f / TRC_ANISOTROPIC_POINTS);
}

/* A roughness of 0.1. */
#define TRC_GLASS_ROUGH_ALPHA 0.01f

/* The first of the four slices of glass that a cubic runs through, and where between them. */
struct trc_glass_slices {
    vint first;
    vfloat place;
};
TRC_INLINE struct trc_glass_slices trc_glass_slices_of(vfloat ior) {
    const vfloat depth = (ior - vf_one()) / (ior + vf_one());
    const vmask inside = vf_lt(depth, vf_zero());
    const vfloat part = vf_saturate(vf_abs(depth));
    const vfloat slices = vf_select(inside, vf_set((float)TRC_GLASS_ENERGY_INSIDE),
                                    vf_set((float)TRC_GLASS_ENERGY_OUTSIDE));
    const vfloat place = vf_sqrt(vf_sqrt(part * vf_sqrt(part))) * (slices - vf_one());
    const vfloat first =
        vf_max(vf_min(vf_floor(place) - vf_one(), slices - vf_set(4.0f)), vf_zero());
    return (struct trc_glass_slices){
        vf_to_int(first) + vi_select(inside, vi_set(0), vi_set(TRC_GLASS_ENERGY_INSIDE)),
        place - first};
}
/* What is kept, by the parts in four slices. */
TRC_INLINE vfloat trc_between_slices(const vfloat value[4], vfloat z, vfloat alpha) {
    /* Newton's form by forward differences. */
    const vfloat z1 = z - vf_one(), z2 = z1 - vf_one();
    const vfloat d0 = value[1] - value[0], d1 = value[2] - value[1], d2 = value[3] - value[2];
    const vfloat e0 = d1 - d0, e1 = d2 - d1;
    const vfloat parts =
        value[0] + z * (d0 + z1 * vf_set(0.5f) * (e0 + z2 * vf_set(1.0f / 3.0f) * (e1 - e0)));
    const vfloat energy = vf_min(parts * vf_set(1.0f / TRC_ENERGY_PARTS), vf_one());
    /* Where smooth glass is grazed, below a cos of 0.05, columns miss the valley. To put less back
     * than what is missing is safe. */
    const vfloat rough = vf_saturate(alpha * vf_set(1.0f / TRC_GLASS_ROUGH_ALPHA));
    return vf_one() - (vf_one() - energy) * rough;
}
/* Of one of the tables of glass. */
TRC_INLINE vfloat trc_glass_energy_lookup(const uint16_t *table, vfloat cos_theta, vfloat alpha,
                                          vfloat ior) {
    const int columns = TRC_GLASS_ENERGY_COLUMNS, size = TRC_GLASS_ENERGY_ROWS * columns;
    const vfloat root = vf_safe_sqrt(alpha);
    vfloat x, y;
    const vfloat across = vf_select(vf_lt(ior, vf_one()), vf_safe_sqrt(cos_theta),
                                    trc_energy_column(cos_theta, root));
    const vint column = trc_grid_cell(across, columns, &x);
    const vint row = trc_grid_cell(root, TRC_GLASS_ENERGY_ROWS, &y);
    const struct trc_glass_slices slices = trc_glass_slices_of(ior);
    const vint at = slices.first * vi_set(size) + row * vi_set(columns) + column;
    vfloat value[4];
    for (int i = 0; i < 4; i++) {
        const uint16_t *here = table + i * size;
        value[i] = vf_lerp(trc_energy_row(here, at, x), trc_energy_row(here + columns, at, x), y);
    }
    return trc_between_slices(value, slices.place, alpha);
}
TRC_INLINE vfloat trc_glass_albedo(vfloat cos_theta, vfloat alpha, vfloat ior) {
    return trc_glass_energy_lookup(trc_glass_energy, cos_theta, alpha, ior);
}
TRC_INLINE vfloat trc_correlated_glass_albedo(vfloat cos_theta, vfloat alpha, vfloat ior) {
    return trc_glass_energy_lookup(trc_correlated_glass_energy, cos_theta, alpha, ior);
}
/* Its mean over the cosine-weighted hemisphere. */
TRC_INLINE vfloat trc_correlated_glass_mean_albedo(vfloat alpha, vfloat ior) {
    vfloat y, value[4];
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_GLASS_ENERGY_ROWS, &y);
    const struct trc_glass_slices slices = trc_glass_slices_of(ior);
    const vint at = slices.first * vi_set(TRC_GLASS_ENERGY_ROWS) + row;
    for (int i = 0; i < 4; i++)
        value[i] =
            trc_energy_row(trc_correlated_glass_energy_mean + i * TRC_GLASS_ENERGY_ROWS, at, y);
    return trc_between_slices(value, slices.place, alpha);
}
TRC_INLINE vfloat trc_glass_reflected_share(vfloat cos_theta, vfloat alpha, vfloat ior) {
    const int slices = TRC_GLASS_SHARE_SLICES, rows = TRC_GLASS_SHARE_ROWS;
    const int columns = TRC_GLASS_SHARE_COLUMNS;
    vfloat x, y, z;
    const vfloat depth = (ior - vf_one()) / (ior + vf_one());
    const vfloat part = vf_abs(depth) * vf_set(1.0f / TRC_GLASS_SHARE_REACH);
    const vint column = trc_grid_cell(vf_safe_sqrt(cos_theta), columns, &x);
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), rows, &y);
    vint slice = trc_grid_cell(vf_safe_sqrt(part), slices, &z);
    slice = vi_select(vf_lt(depth, vf_zero()), slice, slice + vi_set(slices));
    const vint at = (slice * vi_set(rows) + row) * vi_set(columns) + column;
    return vf_lerp(trc_grid_slice(trc_glass_share, columns, at, x, y),
                   trc_grid_slice(trc_glass_share + rows * columns, columns, at, x, y), z);
}
TRC_INLINE vfloat trc_dielectric_share(vfloat cos_theta, vfloat alpha, vfloat ior) {
    vfloat x, y, z;
    const vfloat depth = vf_safe_sqrt(vf_abs((ior - vf_one()) / (ior + vf_one())));
    const vint column = trc_grid_cell(vf_safe_sqrt(cos_theta), TRC_SHARE_COLUMNS, &x);
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_SHARE_ROWS, &y);
    const vint slice = trc_grid_cell(depth, TRC_SHARE_SLICES, &z);
    const vint at = (slice * vi_set(TRC_SHARE_ROWS) + row) * vi_set(TRC_SHARE_COLUMNS) + column;
    const float *table = trc_dielectric_share_table;
    const int columns = TRC_SHARE_COLUMNS, step = TRC_SHARE_ROWS * columns;
    return vf_lerp(trc_grid_slice(table, columns, at, x, y),
                   trc_grid_slice(table + step, columns, at, x, y), z);
}
TRC_INLINE vfloat trc_schlick_share(vfloat cos_theta, vfloat alpha) {
    vfloat x, y;
    const vint column = trc_grid_cell(vf_safe_sqrt(cos_theta), TRC_SHARE_COLUMNS, &x);
    const vint row = trc_grid_cell(vf_safe_sqrt(alpha), TRC_SHARE_ROWS, &y);
    const vint at = row * vi_set(TRC_SHARE_COLUMNS) + column;
    return trc_grid_slice(trc_schlick_share_table, TRC_SHARE_COLUMNS, at, x, y);
}

#endif
