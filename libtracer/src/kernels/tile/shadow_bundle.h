/* Packets of shadow rays, from the queue. */
#ifndef TRACER_KERNELS_TILE_SHADOW_BUNDLE_H
#define TRACER_KERNELS_TILE_SHADOW_BUNDLE_H

#include "kernels/tile/tile.h"

/* Packets of rays that go to one place of a light, side by side in an order. */
struct trc_shadow_bundle {
    uint32_t packets, counts[TRC_BUNDLE]; /* counts: of each packet's rays */
    uint32_t rays;                        /* of all of them */
};

/* tmin: by ray, or NULL: 0. left: NULL where there are no curves. */
TRC_INLINE void trc_shadow_packet_load(const struct trc_tile *t, const uint32_t *order,
                                       uint32_t count, uint32_t visibility, const float *tmin,
                                       struct trc_packet *p, struct trc_left_strands *left) {
    const struct trc_shadow_store *q = &t->shadows;
    p->active = 0;
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vmask m = vm_first((int32_t)(count - i));
        const vint at = vi_load((const int32_t *)order + i);
        for (int axis = 0; axis < 3; axis++) {
            vf_store(&p->o[axis][i], vf_gather(q->o[axis], at, m));
            vf_store(&p->d[axis][i], vf_gather(q->d[axis], at, m));
        }
        vf_store(&p->tmin[i], tmin ? vf_gather(tmin, at, m) : vf_set(0.0f));
        const vfloat tmax = vf_gather(q->tmax, at, m);
        vf_store(&p->t[i], tmax);
        if (t->object_motion)
            vf_store(&p->time[i], vf_gather(q->time, at, m));
        /* Lights that cast no shadow have a negative reach: not traced, never occluded. */
        p->active |= (uint64_t)(vm_bits(vm_and(m, vf_gt(tmax, vf_set(0.0f))))) << i;
    }
    p->visibility = visibility;
    p->common_origin = false;
    p->skip_transparent = t->snapshot->features & TRC_FEATURE_TRANSPARENCY;
    p->left = left;
    for (uint32_t i = 0; left && i < count; i++) {
        left->instance[i] = q->strand_instance[order[i]];
        left->strand[i] = q->strand[order[i]];
    }
}

/* Loads the tile's packets with the first of count rays at order that go to one place of a light,
 * which see what has that visibility. tmin: as above. */
TRC_INLINE struct trc_shadow_bundle trc_shadow_bundle_load(struct trc_tile *t,
                                                           const uint32_t *order, uint32_t count,
                                                           uint32_t visibility, const float *tmin) {
    const uint32_t *target = t->shadows.target;
    struct trc_shadow_bundle b = {0};
    do {
        const uint32_t left = count - b.rays;
        const uint32_t size = left < t->packet_size ? left : t->packet_size;
        trc_shadow_packet_load(t, order + b.rays, size, visibility, tmin, &t->packets[b.packets],
                               t->left ? &t->left[b.packets] : NULL);
        b.counts[b.packets++] = size;
        b.rays += size;
    } while (b.packets < t->bundle && b.rays < count && target[order[b.rays]] == target[order[0]]);
    return b;
}

/* Scales what a ray carries by what of its light arrives. */
TRC_INLINE void trc_shadow_scale(struct trc_shadow_store *q, uint32_t ray, float r, float g,
                                 float b) {
    const float factor[3] = {r, g, b};
    for (uint32_t k = 0; k < q->scaled_count; k += 3)
        for (uint32_t c = 0; c < 3; c++)
            q->scaled[k + c][ray] *= factor[c];
}

#endif
