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
    vvec3 found_weight; /* of emission the ray finds, also straight on through transparency */
    vvec3 weight;       /* of light and rays that scatter here: found_weight * beyond */
    vfloat beyond;      /* kernels/lobe/bsdf.h, trc_bsdf_sample */
    vvec3 receive_n;    /* normal as kernels/light/light.h wants it of the surface hit */
    vfloat t;           /* 0 or below: what coincides with the surface that the ray left */
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

static void arrival_load(const struct trc_tile *t, vint index, vmask active, struct arrival *a) {
    const struct trc_ray_store *r = &t->work;
    const int32_t first = vi_get(index, 0);
    a->index = index;
    a->active = active;
    a->run = vm_all(vm_and(active, vi_eq(index, vi_set(first) + vi_lane()))) ? first : -1;
    float *const *f = r->f;
    a->o = v3(column(f[TRC_RAY_OX], a), column(f[TRC_RAY_OY], a), column(f[TRC_RAY_OZ], a));
    a->d = v3(column(f[TRC_RAY_DX], a), column(f[TRC_RAY_DY], a), column(f[TRC_RAY_DZ], a));
    a->found_weight = v3(column(f[TRC_RAY_WEIGHT_R], a), column(f[TRC_RAY_WEIGHT_G], a),
                         column(f[TRC_RAY_WEIGHT_B], a));
    a->n_from = v3(column(f[TRC_RAY_NX], a), column(f[TRC_RAY_NY], a), column(f[TRC_RAY_NZ], a));
    a->tmin = column(f[TRC_RAY_TMIN], a);
    a->beyond = column(f[TRC_RAY_BEYOND], a);
    a->weight = v3_scale(a->found_weight, a->beyond);
    a->time = column(f[TRC_RAY_TIME], a);
    a->pdf = column(f[TRC_RAY_PDF], a);
    a->min_pdf = column(f[TRC_RAY_MIN_PDF], a);
    a->slot = word_column(r->w[TRC_RAY_SLOT], a);
    a->path = word_column(r->w[TRC_RAY_PATH], a);
    a->depths = word_column(r->w[TRC_RAY_DEPTHS], a);
    a->t = column(t->hits.t, a);
    vu_store(a->slots, a->slot);
}

/* Lengths of the lanes' rays. */
TRC_INLINE vfloat arrival_length(const struct arrival *a) { return vf_max(a->t, vf_set(0.0f)); }

/* The lanes' pixels and sample numbers, for those that shade. */
static void arrival_load_samples(const struct trc_tile *t, struct arrival *a) {
    a->pixel = vu_gather(t->samples.pixel, (vint)a->slot, a->active);
    a->sample = vu_gather(t->samples.index, (vint)a->slot, a->active);
}

/* Light samples taken where the ray left: the count of one bounce before. */
TRC_INLINE vfloat light_count_before(const struct trc_tile *t, vuint depths) {
    return vf_select(vi_eq((vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT), vi_set(1)),
                     vf_set((float)t->desc->light_samples), vf_set(1.0f));
}

#endif
