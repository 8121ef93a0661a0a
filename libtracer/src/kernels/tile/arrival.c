/* Loading what a group of lanes carries. */
#include "kernels/tile/arrival.h"

void trc_arrival_load(const struct trc_tile *t, vint index, vmask active, struct arrival *a) {
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
    a->indirect_scale = column(f[TRC_RAY_INDIRECT_SCALE], a);
    a->weight = v3_scale(a->found_weight, a->indirect_scale);
    a->time = column(f[TRC_RAY_TIME], a);
    a->pdf = column(f[TRC_RAY_PDF], a);
    a->min_pdf = column(f[TRC_RAY_MIN_PDF], a);
    a->slot = word_column(r->w[TRC_RAY_SLOT], a);
    a->path = word_column(r->w[TRC_RAY_PATH], a);
    a->depths = word_column(r->w[TRC_RAY_DEPTHS], a);
    a->t = column(t->hits.t, a);
    vu_store(a->slots, a->slot);
}

void trc_arrival_load_samples(const struct trc_tile *t, struct arrival *a) {
    a->pixel = vu_gather(t->samples.pixel, (vint)a->slot, a->active);
    a->sample = vu_gather(t->samples.index, (vint)a->slot, a->active);
}
