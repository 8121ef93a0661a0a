/* Tables of passes. */
#include "model/passes.h"

/* A kind without sums of its own is read from what the film keeps anyway. */
#define HAS_SUMS(kind) (TRC_PASS_KIND_##kind <= TRC_PASS_KIND_FIRST)
#define INFO(letters, kind, color, miss)                                                       \
    {                                                                                          \
        sizeof letters - 1,                                                                    \
            HAS_SUMS(kind) ? sizeof letters - 1 + (TRC_PASS_KIND_##kind == TRC_PASS_KIND_HITS) \
                           : 0,                                                                \
            TRC_PASS_KIND_##kind, TRC_PASS_##color, miss                                       \
    }

static const struct trc_pass_info singles[] = {
#define TRC_PASS(NAME, number, letters, kind, color, miss) \
    [number] = INFO(letters, kind, color, miss),
#include "tracer/passes.def"
};

static const struct range {
    uint32_t first, count;
    struct trc_pass_info info;
} ranges[] = {
#define TRC_PASS_RANGE(NAME, first, count, letters, kind) \
    {first, count, INFO(letters, kind, NONE, 0.0f)},
#include "tracer/passes.def"
};

#define TRC_PASS(NAME, number, letters, kind, color, miss)                           \
    _Static_assert(number < TRC_PASS_FIRST_AOV_VALUE && sizeof letters - 1 <= 4 &&   \
                       (TRC_PASS_##color == TRC_PASS_NONE || TRC_PASS_##color < 64), \
                   #NAME);
#include "tracer/passes.def"

const struct trc_pass_info *trc_pass_info_of(uint32_t pass) {
    static const struct trc_pass_info unknown = {.color = TRC_PASS_NONE};
    if (pass < TRC_PASS_COUNT)
        return &singles[pass];
    for (const struct range *r = ranges; r < ranges + sizeof ranges / sizeof *ranges; r++)
        if (pass - r->first < r->count)
            return &r->info;
    return &unknown;
}

uint32_t trc_pass_channels(uint32_t pass) { return trc_pass_info_of(pass)->channels; }

uint64_t trc_passes_with_colors(uint64_t passes) {
    uint64_t colors = 0;
    for (uint32_t pass = 0; pass < TRC_PASS_COUNT; pass++)
        if (passes >> pass & 1 && singles[pass].color != TRC_PASS_NONE)
            colors |= UINT64_C(1) << singles[pass].color;
    return passes | colors;
}
