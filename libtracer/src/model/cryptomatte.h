/* Cryptomatte: which ids cover a pixel. See tracer/render.h.
 *
 * A pixel has a small table of ids and the sums of what they cover. Ids take places in the order in
 * which they come; a tile is one thread's, so that the order is fixed. When all places are taken,
 * further ids are left out, and those that are there stay right. Samples of a pixel come from all
 * over it, so what covers a good part of it is there early; a few places more than are read make
 * room for what covers little and comes first. */
#ifndef TRACER_MODEL_CRYPTOMATTE_H
#define TRACER_MODEL_CRYPTOMATTE_H

#include <stdint.h>

/* A place of the table: 0 is no id. */
struct trc_matte {
    float id;
    uint32_t weight; /* sum over the samples, of what each is covered by it, in units of which
                        trc_matte_units has a whole sample: the order of samples is of no account */
};

/* Units of a sample that an id covers whole, of so many samples of a pixel: a power of two, so that
 * all of them may be covered, and by a bright transparent surface, twice. */
static inline uint32_t trc_matte_units(uint32_t sample_count) {
    uint32_t units = 1u << 30;
    while (units > 1 && (uint64_t)units * sample_count > 1u << 31)
        units /= 2;
    return units;
}

/* Places beyond the ranks that are read. */
#define TRC_SPARE_MATTES 2

/* Channels of a layer. */
#define TRC_MATTE_CHANNELS 4

static inline void trc_matte_add(struct trc_matte *mattes, uint32_t count, float id,
                                 uint32_t weight) {
    for (uint32_t i = 0; i < count; i++) {
        if (mattes[i].id != id && mattes[i].id != 0.0f)
            continue;
        mattes[i].id = id;
        const uint32_t room = UINT32_MAX - mattes[i].weight;
        mattes[i].weight += weight < room ? weight : room;
        return;
    }
}

/* Copies a table of count places into one that may be read meanwhile. */
static inline void trc_mattes_store(struct trc_matte *to, const struct trc_matte *from,
                                    uint32_t count) {
    for (uint32_t i = 0; i < count && from[i].id != 0.0f; i++) {
        struct trc_matte matte = from[i];
        __atomic_store(&to[i].id, &matte.id, __ATOMIC_RELAXED);
        __atomic_store(&to[i].weight, &matte.weight, __ATOMIC_RELAXED);
    }
}

/* One layer of a pixel: ranks 2 * layer and the next of the table of count places, the largest
 * weights first and the smaller bits of the id where they are equal. Coverage is the weight over
 * that of a pixel that is covered whole, cut to [0, 1]; 0 where whole is 0. count <=
 * TRC_MAX_CRYPTOMATTE_DEPTH + TRC_SPARE_MATTES. The table may be written meanwhile: then what comes
 * out is of no use, but no harm is done. */
void trc_mattes_read(const struct trc_matte *mattes, uint32_t count, uint32_t layer, uint32_t whole,
                     float out[TRC_MATTE_CHANNELS]);

#endif
