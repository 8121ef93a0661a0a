/* The film: sums of samples per pixel and pass, written by tiles, read at any time.
 *
 * A pixel belongs to one tile and a tile to one thread, so sums need no locks and their order is
 * fixed. A tile's batches of samples appear whole: model/sequence.h. Sums are doubles: 1e9 samples
 * over 1e8 of dynamic range keep a relative error below 1e-6.
 */
#ifndef TRACER_MODEL_FILM_H
#define TRACER_MODEL_FILM_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "model/cryptomatte.h"
#include "model/passes.h"
#include "tracer/render.h"

/* Passes that are sums have numbers below this. */
#define TRC_SUM_COUNT TRC_PASS_LIGHT_GROUP(TRC_MAX_LIGHT_GROUPS)

/* Pixels of a tile's side. 1024 pixels fill packets of 256 with one sample and still sort into
 * useful groups by material; sums of all passes of a tile (49 doubles a pixel at most) stay in a
 * second-level cache; a small preview still has tiles for all threads. */
#define TRC_TILE_SIZE 32

/* Tiles along a side of so many pixels. */
static inline uint32_t trc_film_tiles(uint32_t pixels) {
    return (uint32_t)(((uint64_t)pixels + TRC_TILE_SIZE - 1) / TRC_TILE_SIZE);
}

/* What a pixel's shadow catchers got, sums over its samples. Blocked over unblocked light is the
 * ratio by which the footage darkens: of the sums, as ratios of samples would have a mean of their
 * own. */
struct trc_caught {
    double blocked[3], unblocked[3]; /* light as it is, and with nothing but catchers in its way */
    double background[3];            /* radiance that the world shows behind them; 0 where the film
                                        is transparent */
    double coverage;                 /* how much of the footage the catchers stand for */
};

/* So many doubles. */
#define TRC_CAUGHT_CHANNELS (sizeof(struct trc_caught) / sizeof(double))

/* Sums over the first half of a pixel's samples, by which reconstruction and extra samples know
 * noise. */
struct trc_half {
    float light[4];    /* of Combined; with the light of shadow catchers */
    float features[7]; /* of the passes for denoisers: albedo, normal, depth; 0 without them */
    uint32_t count;    /* of the samples, below that of all; 0: there is no half yet */
};

/* What reconstruction makes of sums of light; NULL where there is nothing of the kind. */
struct trc_clean_film {
    double *sums[TRC_SUM_COUNT];
    struct trc_caught *caught;
};

struct trc_film {
    uint32_t width, height;      /* of the crop */
    double *sums[TRC_SUM_COUNT]; /* by pass: trc_pass_info.sums * width * height, or NULL; bottom
                                    row first. TRC_PASS_KIND_FIRST: the value itself */
    struct trc_matte *mattes[TRC_CRYPTOMATTE_KINDS]; /* matte_count * width * height, or NULL */
    uint32_t matte_count;                            /* places of a pixel's table; 0: no mattes */
    uint32_t matte_units;                            /* weight of a whole sample in them */
    uint32_t *sample_counts;                         /* width * height */
    atomic_uint *sequences;    /* of the tiles: odd while one is written (model/sequence.h) */
    bool shows_counts;         /* they are a pass */
    struct trc_caught *caught; /* width * height, or NULL: the scene has no shadow catchers */
    bool shows_shadows;        /* their shadows are a pass, so Combined is without them */
    bool is_transparent;       /* trc_render_desc.film_transparent */
    struct trc_half *halves;   /* width * height, or NULL: nobody asks for noise */
    uint32_t half_count;       /* samples of the first half; 0: the largest power of two below
                                  their count */
    uint32_t extra_begin;      /* where extra samples begin, which double a pixel's; 0: never */
    uint32_t sample_offset;    /* samples of a pixel before those of this film, to tell halves by */
    struct trc_clean_film clean;
    uint32_t guides;   /* trc_render_desc.guides */
    uint32_t is_clean; /* atomic: the clean film is what is read */
    bool shows_noise;  /* the plain Combined is a pass */
};

/* The sequence number of the tile that has the pixel. */
static inline atomic_uint *trc_film_sequence(const struct trc_film *film, uint32_t x, uint32_t y) {
    const size_t row = y / TRC_TILE_SIZE;
    return &film->sequences[row * trc_film_tiles(film->width) + x / TRC_TILE_SIZE];
}

/* Whether a pixel's first half of samples ends with so many of this film. */
static inline bool trc_film_ends_half(const struct trc_film *film, uint32_t count) {
    count += film->sample_offset;
    if (!film->half_count)
        return count && !(count & (count - 1));
    if (!film->extra_begin || count <= film->half_count)
        return count == film->half_count;
    const uint32_t times = count / film->extra_begin;
    return times && count % film->extra_begin == 0 && !(times & (times - 1));
}

/* The least count above this one with which a first half ends, UINT32_MAX where there is none. */
static inline uint32_t trc_film_next_half(const struct trc_film *film, uint32_t count) {
    const uint32_t all = count + film->sample_offset;
    uint64_t next = film->half_count;
    if (!next)
        next = all ? UINT64_C(2) << (31 - __builtin_clz(all)) : 1;
    else if (film->extra_begin && next <= all)
        for (next = film->extra_begin; next <= all;)
            next *= 2;
    return next > all && next < UINT32_MAX ? (uint32_t)next - film->sample_offset : UINT32_MAX;
}

/* Keeps the sums of a pixel's first half of samples: what it has so far, count samples of which sum
 * is Combined. */
void trc_film_keep_half(const struct trc_film *film, size_t pixel, const double sum[4],
                        uint32_t count);

/* Whether desc is that of a part of the samples. */
static inline bool trc_film_is_part(const trc_render_desc *desc) {
    return desc->sample_offset || (desc->sample_subset && desc->sample_subset < desc->sample_count);
}

/* Whether the film has sums of a pass: it is asked for by the resolved desc, and is of a kind that
 * has them. */
bool trc_film_has_sums(const trc_render_desc *desc, uint32_t pass);

/* Places of a pixel's table of mattes; 0: none are asked for. A part has all, as what it leaves out
 * may be what other parts have much of. */
uint32_t trc_film_matte_count(const trc_render_desc *desc);

#endif
