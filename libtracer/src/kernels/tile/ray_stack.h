/* Rays that wait, in columns: a stack that has room for whatever is pushed on it.
 *
 * Whitted follows every lobe of a surface, so that the rays of a step may leave several times as
 * many. No ray is left out or chosen by chance for want of room. Instead, steps take fewer rays as
 * the stack fills: at most half of the room may be used up by what they leave, and in the limit a
 * single ray is followed to its ends, depth first. For that the stack keeps room of its own: at
 * each bounce of a path of the greatest length there is, all branches but one wait. So a picture
 * and its counts of rays are those of the whole tree; a tree too large for the stack costs speed,
 * as its packets are small, and nothing else.
 *
 * The owner of the room is here: reserve says how many rays may follow, append and the like assert
 * in debug builds that no more do. */
#ifndef TRACER_KERNELS_TILE_RAY_STACK_H
#define TRACER_KERNELS_TILE_RAY_STACK_H

#include <assert.h>

#include "core/carver.h"
#include "kernels/simd/simd.h"
#include "tracer/render.h"

/* Rays of one step: 16 packets; their state stays in L2. */
#define TRC_BATCH 1024

enum trc_ray_float {
    TRC_RAY_OX,
    TRC_RAY_OY,
    TRC_RAY_OZ,
    TRC_RAY_DX,
    TRC_RAY_DY,
    TRC_RAY_DZ,
    TRC_RAY_TMIN,
    TRC_RAY_TMAX,
    TRC_RAY_TIME,
    TRC_RAY_WEIGHT_R,
    TRC_RAY_WEIGHT_G,
    TRC_RAY_WEIGHT_B,
    TRC_RAY_PDF,     /* of the bounce, solid angle; -1: camera or ideal, no MIS */
    TRC_RAY_MIN_PDF, /* smallest so far, for Filter Glossy */
    TRC_RAY_NX,
    TRC_RAY_NY,
    TRC_RAY_NZ,             /* normal where it left, as kernels/light/light.h wants it */
    TRC_RAY_INDIRECT_SCALE, /* factor on everything behind the next surface: kernels/lobe/bsdf.h */
    TRC_RAY_PATH_LENGTH, /* from the camera to where it left; of scenes with TRC_FEATURE_SLOPES */
    TRC_RAY_SPLIT_SCALE, /* factor on its weight by which it is one of two (kernels/tile/bounce.c);
                            where light is clamped and rays are split */
    TRC_RAY_FLOATS
};
enum trc_ray_word {
    TRC_RAY_SLOT, /* sample of the batch */
    TRC_RAY_PATH,
    TRC_RAY_DEPTHS,
    TRC_RAY_PARENT, /* material it left: key of runs and groups */
    TRC_RAY_LEFT,  /* instance it left; of scenes in which rays look back (kernels/trace/spawn.h) or
                      lights are linked */
    TRC_RAY_SHARE, /* what diffuse lobes have of its light; with passes of light by kind
                      (kernels/tile/light_split.h) */
    /* Of scenes with curves, as struct trc_left_strands has them: */
    TRC_RAY_STRAND_INSTANCE,
    TRC_RAY_STRAND,
    TRC_RAY_WORDS
};

/* Columns that not every tile has. */
struct trc_ray_columns {
    bool path_length, split_scale, left, share, strands;
};

struct trc_ray_store {
    uint32_t capacity, count;
    uint32_t reserved_end;      /* rays there may be until the next reserve */
    float *f[TRC_RAY_FLOATS];   /* NULL: a column that nothing reads */
    uint32_t *w[TRC_RAY_WORDS]; /* the same */
};

/* How much of a stack its rays may need. */
struct trc_ray_room {
    uint32_t branches; /* rays that one of the stack leaves at most, >= 1 */
    uint32_t depth;    /* entries for one ray to be followed depth first */
    uint32_t capacity; /* of the stack */
};

/* Rays that wait before steps take fewer than TRC_BATCH. */
#define TRC_WAITING_RAYS (8 * TRC_BATCH)

/* branches: as above. Paths branch until their last bounce, which one limit or the other ends. */
TRC_INLINE struct trc_ray_room trc_ray_room_of(const trc_render_desc *desc, uint32_t branches) {
    if (branches <= 1) /* a step's rays leave no more than they are */
        return (struct trc_ray_room){1, 0, TRC_BATCH};
    const uint32_t more = branches - 1, length = desc->max_depth + desc->max_transparent_depth + 2;
    const uint32_t depth = more * length;
    return (struct trc_ray_room){branches, depth, TRC_WAITING_RAYS + 2 * more * TRC_BATCH + depth};
}

TRC_INLINE void trc_rays_carve(struct trc_carver *c, struct trc_ray_store *r, uint32_t capacity,
                               struct trc_ray_columns columns) {
    r->capacity = capacity;
    r->count = r->reserved_end = 0;
    const bool has_word[TRC_RAY_WORDS - TRC_RAY_LEFT] = {columns.left, columns.share,
                                                         columns.strands, columns.strands};
    const bool has_float[TRC_RAY_FLOATS - TRC_RAY_PATH_LENGTH] = {columns.path_length,
                                                                  columns.split_scale};
    /* Vectors are stored whole: vf_compress. */
    for (int i = 0; i < TRC_RAY_FLOATS; i++)
        if (i < TRC_RAY_PATH_LENGTH || has_float[i - TRC_RAY_PATH_LENGTH])
            r->f[i] = trc_carve(c, (capacity + TRC_WIDTH) * sizeof(float));
    for (int i = 0; i < TRC_RAY_WORDS; i++)
        if (i < TRC_RAY_LEFT || has_word[i - TRC_RAY_LEFT])
            r->w[i] = trc_carve(c, (capacity + TRC_WIDTH) * sizeof(uint32_t));
}

/* Up to count rays will follow, for which there must be room. */
TRC_INLINE void trc_rays_reserve(struct trc_ray_store *r, uint32_t count) {
    assert(r->count <= r->capacity && count <= r->capacity - r->count);
    r->reserved_end = r->count + count;
}

/* Counts rays in that were stored behind the others. */
TRC_INLINE void trc_rays_add(struct trc_ray_store *r, uint32_t count) {
    assert(count <= r->reserved_end - r->count);
    r->count += count;
}

/* The lanes of bits. Values of columns that the store lacks are not read. */
TRC_INLINE void trc_rays_append(struct trc_ray_store *r, const vfloat values[TRC_RAY_FLOATS],
                                const vuint words[TRC_RAY_WORDS], uint32_t bits) {
    const uint32_t at = r->count;
    trc_rays_add(r, (uint32_t)__builtin_popcount(bits));
    for (int k = 0; k < TRC_RAY_PATH_LENGTH; k++)
        vf_compress(r->f[k] + at, values[k], bits);
    for (int k = TRC_RAY_PATH_LENGTH; k < TRC_RAY_FLOATS; k++)
        if (r->f[k])
            vf_compress(r->f[k] + at, values[k], bits);
    for (int k = 0; k < TRC_RAY_LEFT; k++)
        vu_compress(r->w[k] + at, words[k], bits);
    for (int k = TRC_RAY_LEFT; k < TRC_RAY_WORDS; k++)
        if (r->w[k])
            vu_compress(r->w[k] + at, words[k], bits);
}

/* Copies a ray to the place of another. */
TRC_INLINE void trc_rays_move(struct trc_ray_store *r, uint32_t from, uint32_t to) {
    for (int k = 0; k < TRC_RAY_FLOATS; k++)
        if (r->f[k])
            r->f[k][to] = r->f[k][from];
    for (int k = 0; k < TRC_RAY_WORDS; k++)
        if (r->w[k])
            r->w[k][to] = r->w[k][from];
}

/* One of the rays once more; its number. */
TRC_INLINE uint32_t trc_rays_duplicate(struct trc_ray_store *r, uint32_t ray) {
    const uint32_t other = r->count;
    trc_rays_add(r, 1);
    trc_rays_move(r, ray, other);
    return other;
}

/* How many rays the next step takes from the top. */
TRC_INLINE uint32_t trc_rays_step(const struct trc_ray_store *r, const struct trc_ray_room *room) {
    const uint32_t all = r->count < TRC_BATCH ? r->count : TRC_BATCH;
    if (room->branches <= 1)
        return all;
    const uint32_t used = r->count + room->depth;
    const uint32_t left = used < r->capacity ? r->capacity - used : 0;
    const uint32_t fit = left / (2 * (room->branches - 1));
    return fit >= all ? all : fit > 1 ? fit : 1;
}

/* Moves count rays from the top of one store to the other, whose own are dropped. What was reserved
 * in either ends. */
TRC_INLINE void trc_rays_take(struct trc_ray_store *from, struct trc_ray_store *to,
                              uint32_t count) {
    assert(count <= from->count && count <= to->capacity);
    if (count == from->count) {
        const struct trc_ray_store swap = *from;
        *from = *to;
        *to = swap;
        from->count = from->reserved_end = 0;
        to->reserved_end = count;
        return;
    }
    const uint32_t first = from->count - count;
    for (int i = 0; i < TRC_RAY_FLOATS; i++)
        if (from->f[i])
            memcpy(to->f[i], from->f[i] + first, count * sizeof(float));
    for (int i = 0; i < TRC_RAY_WORDS; i++)
        if (from->w[i])
            memcpy(to->w[i], from->w[i] + first, count * sizeof(uint32_t));
    to->count = to->reserved_end = count;
    from->count = from->reserved_end = first;
}

#endif
