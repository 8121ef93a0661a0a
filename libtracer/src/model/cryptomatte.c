#include "model/cryptomatte.h"

#include <string.h>

#include "tracer/render.h"

/* ---- ids ---- */

static uint32_t rotate_left(uint32_t x, int bits) { return x << bits | x >> (32 - bits); }

static uint32_t mix_block(uint32_t k) { return rotate_left(k * 0xcc9e2d51u, 15) * 0x1b873593u; }

/* MurmurHash3_x86_32, seed 0; blocks are little-endian. */
static uint32_t hash_bytes(const uint8_t *bytes, size_t count) {
    uint32_t h = 0, tail = 0;
    size_t i = 0;
    for (; count - i >= 4; i += 4) {
        const uint32_t block = (uint32_t)bytes[i] | (uint32_t)bytes[i + 1] << 8 |
                               (uint32_t)bytes[i + 2] << 16 | (uint32_t)bytes[i + 3] << 24;
        h = rotate_left(h ^ mix_block(block), 13) * 5u + 0xe6546b64u;
    }
    for (size_t k = count; k-- > i;)
        tail = tail << 8 | bytes[k];
    h ^= mix_block(tail);
    h ^= (uint32_t)count;
    h = (h ^ h >> 16) * 0x85ebca6bu;
    h = (h ^ h >> 13) * 0xc2b2ae35u;
    return h ^ h >> 16;
}

#define EXPONENT_BITS 0x7f800000u
#define LOWEST_EXPONENT_BIT 0x00800000u

float trc_cryptomatte_id(const char *name) {
    if (!name)
        return 0.0f;
    uint32_t bits = hash_bytes((const uint8_t *)name, strlen(name));
    /* Zero and denormals, infinity and NaN: the next exponent inwards. */
    const uint32_t exponent = bits & EXPONENT_BITS;
    if (exponent == 0 || exponent == EXPONENT_BITS)
        bits ^= LOWEST_EXPONENT_BIT;
    float id;
    memcpy(&id, &bits, sizeof id);
    return id;
}

/* ---- ranks ---- */

static uint32_t bits_of(float id) {
    uint32_t bits;
    memcpy(&bits, &id, sizeof bits);
    return bits;
}

static int is_before(const struct trc_matte *a, const struct trc_matte *b) {
    return a->weight != b->weight ? a->weight > b->weight : bits_of(a->id) < bits_of(b->id);
}

void trc_mattes_read(const struct trc_matte *mattes, uint32_t count, uint32_t layer, uint32_t whole,
                     float out[TRC_MATTE_CHANNELS]) {
    struct trc_matte ranked[TRC_MAX_CRYPTOMATTE_DEPTH + TRC_SPARE_MATTES];
    uint32_t used = 0;
    for (uint32_t i = 0; i < count; i++) {
        struct trc_matte m;
        __atomic_load(&mattes[i].id, &m.id, __ATOMIC_RELAXED);
        __atomic_load(&mattes[i].weight, &m.weight, __ATOMIC_RELAXED);
        if (m.id == 0.0f)
            break;
        uint32_t k = used++;
        for (; k > 0 && is_before(&m, &ranked[k - 1]); k--)
            ranked[k] = ranked[k - 1];
        ranked[k] = m;
    }
    memset(out, 0, TRC_MATTE_CHANNELS * sizeof *out);
    for (uint32_t i = 0; whole && i < TRC_CRYPTOMATTE_LAYER_RANKS; i++) {
        const uint32_t rank = TRC_CRYPTOMATTE_LAYER_RANKS * layer + i;
        if (rank >= used)
            break;
        const float coverage = (float)ranked[rank].weight / (float)whole;
        out[2 * i] = ranked[rank].id;
        out[2 * i + 1] = coverage < 1.0f ? coverage : 1.0f;
    }
}
