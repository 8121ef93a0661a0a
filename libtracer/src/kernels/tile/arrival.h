/* Rays of one step that have arrived, a group of lanes at a time, as shading wants them. */
#ifndef TRACER_KERNELS_TILE_ARRIVAL_H
#define TRACER_KERNELS_TILE_ARRIVAL_H

#include "kernels/simd/wide_math.h"
#include "kernels/tile/tile.h"

/* Everything a group of lanes carries from the ray that arrived. */
struct arrival {
    vint index; /* into t->work */
    int32_t
        run; /* index of the first lane where all lanes are active and follow each other, or -1 */
    vmask active;
    vvec3 o, d, n_from;
    vvec3 found_weight;    /* of emission the ray finds, also straight on through transparency */
    vvec3 weight;          /* of light and rays that scatter here: found_weight * indirect_scale */
    vfloat indirect_scale; /* kernels/lobe/bsdf.h, trc_bsdf_sample */
    vvec3 receive_n;       /* normal as kernels/light/light.h wants it of the surface hit */
    vfloat t;              /* 0 or below: what coincides with the surface that the ray left */
    vfloat tmin, time, pdf, min_pdf;
    vfloat
        chance; /* that a continuation ray is sent: densities of its directions have it in them */
    vuint slot, path, depths, pixel, sample;
    uint32_t slots[TRC_WIDTH];
    bool world_alone; /* rays that go on find the world better than light samples of it would */
};

/* Numbers of the lanes' rays in a column: mostly side by side, as sorts are stable. */
TRC_INLINE vfloat column(const float *values, const struct arrival *a) {
    return a->run >= 0 ? vf_load(values + a->run) : vf_gather(values, a->index, a->active);
}
TRC_INLINE vuint word_column(const uint32_t *values, const struct arrival *a) {
    return a->run >= 0 ? vu_load(values + a->run) : vu_gather(values, a->index, a->active);
}

/* The lanes of index, into t->work. (kernels/tile/arrival.c) */
void trc_arrival_load(const struct trc_tile *t, vint index, vmask active, struct arrival *a);

/* Their pixels and sample numbers, for those that shade. */
void trc_arrival_load_samples(const struct trc_tile *t, struct arrival *a);

/* Lengths of the lanes' rays. */
TRC_INLINE vfloat arrival_length(const struct arrival *a) { return vf_max(a->t, vf_set(0.0f)); }

/* Light samples taken where the ray left: the count of one bounce before. */
TRC_INLINE vfloat light_count_before(const struct trc_tile *t, vuint depths) {
    return vf_select(vi_eq((vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT), vi_set(1)),
                     vf_set((float)t->desc->light_samples), vf_set(1.0f));
}

#endif
