/* Shadow rays that wait to be traced as full packets. Whoever adds some reserves room for them
 * first, for which the queue is flushed (kernels/tile/shadow.c); append asserts in debug builds
 * that no more come. */
#ifndef TRACER_KERNELS_TILE_SHADOW_QUEUE_H
#define TRACER_KERNELS_TILE_SHADOW_QUEUE_H

#include <assert.h>

#include "core/carver.h"
#include "kernels/simd/simd.h"
#include "kernels/trace/packet.h"

/* Rays that wait at most: more than one group of hits may send, 2 * 64 for each lane. */
#define TRC_SHADOW_QUEUE 4096
_Static_assert(TRC_SHADOW_QUEUE >= 2 * 64 * TRC_WIDTH, "an empty queue has room for a group");

/* Entries of a column: the last packet is loaded whole. */
#define TRC_SHADOW_COLUMN (TRC_SHADOW_QUEUE + TRC_PACKET_SIZE)

/* Radiance, its three parts, and what the Shadow pass gets. */
#define TRC_SCALED_COLUMNS (3 + 9 + 3)

/* target: the light's number and cell, what packets are sorted by. */
struct trc_shadow_store {
    uint32_t count;
    uint32_t reserved_end; /* rays there may be until the next reserve */
    float *o[3], *d[3], *tmax, *time, *radiance[3];
    float *split[9]; /* diffuse, glossy, transmission parts, or NULL: no light passes */
    uint32_t *share; /* of the path (kernels/tile/light_split.h), or NULL: no light passes */
    uint32_t *strand_instance;         /* as struct trc_left_strands has it, or NULL: no curves */
    uint32_t *strand;                  /* the same */
    float *tmin;                       /* how far a ray has come, or NULL: nothing is transparent */
    uint32_t *passed;                  /* surfaces that it has come through, or NULL */
    float *pixel;                      /* at what is lit (struct trc_surface), or NULL */
    float *spread;                     /* how much wider it may get per length, or NULL */
    float *split_scale;                /* as rays have it, or NULL */
    float *lamp[3];                    /* for the Shadow pass, or NULL */
    float *scaled[TRC_SCALED_COLUMNS]; /* those that what is in the way takes from, RGB by RGB */
    uint32_t scaled_count;
    uint32_t *slot, *path, *target;
    uint32_t *depths; /* of the path, as rays have them (kernels/tile/tile.h) */
    uint32_t *order;  /* own: the queue may be flushed while hits are shaded in t->order */
};

/* Columns that not every picture needs. */
struct trc_shadow_columns {
    bool splits;       /* of light passes */
    bool lamps;        /* of the Shadow pass */
    bool strands;      /* of curves */
    bool passes;       /* of transparent materials */
    bool pixels;       /* of those with slopes */
    bool split_scales; /* of clamped light of split rays */
};

TRC_INLINE void trc_shadows_carve(struct trc_carver *c, struct trc_shadow_store *q,
                                  struct trc_shadow_columns with) {
    const size_t column = TRC_SHADOW_COLUMN * sizeof(float);
    for (int i = 0; i < 3; i++) {
        q->o[i] = trc_carve(c, column);
        q->d[i] = trc_carve(c, column);
        q->radiance[i] = q->scaled[q->scaled_count++] = trc_carve(c, column);
    }
    q->tmax = trc_carve(c, column);
    q->time = trc_carve(c, column);
    for (int i = 0; with.splits && i < 9; i++)
        q->split[i] = q->scaled[q->scaled_count++] = trc_carve(c, column);
    if (with.splits)
        q->share = trc_carve(c, column);
    if (with.passes) {
        q->tmin = trc_carve(c, column);
        q->passed = trc_carve(c, column);
    }
    if (with.pixels) {
        q->pixel = trc_carve(c, column);
        q->spread = trc_carve(c, column);
    }
    if (with.split_scales)
        q->split_scale = trc_carve(c, column);
    if (with.strands) {
        q->strand_instance = trc_carve(c, column);
        q->strand = trc_carve(c, column);
    }
    for (int i = 0; with.lamps && i < 3; i++)
        q->lamp[i] = q->scaled[q->scaled_count++] = trc_carve(c, column);
    uint32_t **const words[] = {&q->slot, &q->path, &q->target, &q->depths, &q->order};
    for (int i = 0; i < 5; i++)
        *words[i] = trc_carve(c, column);
}

/* What a ray has in every queue. */
struct trc_shadow_rays {
    vfloat o[3], d[3], tmax, time, radiance[3];
    vuint slot, path, target, depths;
};

/* Counts the lanes' rays in; where they stand. The caller fills the columns of passes. */
TRC_INLINE uint32_t trc_shadows_append(struct trc_shadow_store *q, const struct trc_shadow_rays *s,
                                       uint32_t bits) {
    const uint32_t at = q->count, count = (uint32_t)__builtin_popcount(bits);
    assert(count <= q->reserved_end - q->count);
    for (int k = 0; k < 3; k++) {
        vf_compress(q->o[k] + at, s->o[k], bits);
        vf_compress(q->d[k] + at, s->d[k], bits);
        vf_compress(q->radiance[k] + at, s->radiance[k], bits);
    }
    vf_compress(q->tmax + at, s->tmax, bits);
    vf_compress(q->time + at, s->time, bits);
    vu_compress(q->slot + at, s->slot, bits);
    vu_compress(q->path + at, s->path, bits);
    vu_compress(q->target + at, s->target, bits);
    vu_compress(q->depths + at, s->depths, bits);
    q->count += count;
    return at;
}

#endif
