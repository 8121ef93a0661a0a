/* What is known of passes: tracer/passes.def in forms that code can look up. */
#ifndef TRACER_MODEL_PASSES_H
#define TRACER_MODEL_PASSES_H

#include <stdint.h>

#include "tracer/render.h"

/* How a pass is read from the film, as tracer/passes.def explains it. */
enum trc_pass_kind {
    TRC_PASS_KIND_LIGHT,
    TRC_PASS_KIND_MEAN,
    TRC_PASS_KIND_HITS,
    TRC_PASS_KIND_FIRST,
    TRC_PASS_KIND_COUNT,
    TRC_PASS_KIND_SHADOW,
    TRC_PASS_KIND_MATTE,
    TRC_PASS_KIND_PLAIN
};

/* No pass: trc_pass_info.color. */
#define TRC_PASS_NONE UINT8_MAX

struct trc_pass_info {
    uint8_t channels; /* 0: no such pass */
    uint8_t sums;     /* that the film keeps of a pixel, 0..TRC_MAX_PASS_SUMS */
    uint8_t kind;     /* enum trc_pass_kind */
    uint8_t color;    /* the pass that light is divided by, or TRC_PASS_NONE */
    float miss;       /* of a sample that hits nothing, all channels */
};

/* Of RGBA or XYZW, and a count of hits. */
#define TRC_MAX_PASS_SUMS 5

/* Of any number. */
const struct trc_pass_info *trc_pass_info_of(uint32_t pass);

/* Bits of the passes, and of those that these are divided by. */
uint64_t trc_passes_with_colors(uint64_t passes);

/* Bits of the passes that are divided by a colour: light by its first bounce. */
static inline uint64_t trc_passes_divided(void) {
#define TRC_PASS(NAME, number, channels, kind, color, miss) \
    | (uint64_t)(TRC_PASS_##color != TRC_PASS_NONE) << number
    return 0
#include "tracer/passes.def"
        ;
}

/* Bits of the passes of what surfaces are, features for denoisers among them. */
static inline uint64_t trc_passes_data(void) {
#define TRC_PASS(NAME, number, channels, kind, color, miss)    \
    | (uint64_t)(TRC_PASS_KIND_##kind == TRC_PASS_KIND_MEAN || \
                 TRC_PASS_KIND_##kind == TRC_PASS_KIND_HITS || \
                 TRC_PASS_KIND_##kind == TRC_PASS_KIND_FIRST)  \
            << number
    return 0
#include "tracer/passes.def"
        ;
}

#endif
