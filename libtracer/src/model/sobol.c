#include "model/sobol.h"

#include "core/core.h"

/* Dimensions that are used together, in the order of enum trc_dimension. Pairs are both of Sobol's
 * first dimensions, single ones the first. */
enum { GROUPS = 11, COLUMNS = 12 };
static const uint8_t size_of[GROUPS] = {2, 2, 1, 1, 2, 1, 2, 1, 2, 1, 2};

/* Column b of a group's matrix: the bits of the index, up to b, that bit b is exchanged for.
 * Written by libtracer/tools/generate_sample_orders.py. The last four serve second hits. */
static const uint16_t columns[GROUPS][COLUMNS] = {
    {0x1, 0x2, 0x4, 0x8, 0x10, 0x20, 0x40, 0x80, 0x100, 0x200, 0x400, 0x800}, /* pixel */
    {0x1, 0x3, 0x4, 0xd, 0x11, 0x32, 0x61, 0xdb, 0x126, 0x35f, 0x494, 0xa7f}, /* lens */
    {0x1, 0x2, 0x4, 0xb, 0x13, 0x32, 0x79, 0xed, 0x122, 0x385, 0x447, 0xc36}, /* time */
    {0x1, 0x3, 0x6, 0x9, 0x12, 0x24, 0x48, 0x95, 0x18d, 0x286, 0x714, 0xb04}, /* light */
    {0x1, 0x3, 0x7, 0xa, 0x1b, 0x31, 0x48, 0xf8, 0x1b7, 0x230, 0x402, 0x8b0}, /* place */
    {0x1, 0x3, 0x4, 0xa, 0x1b, 0x25, 0x51, 0xa8, 0x167, 0x363, 0x71a, 0xd91}, /* lobe */
    {0x1, 0x2, 0x7, 0xa, 0x1d, 0x39, 0x6e, 0xa4, 0x12c, 0x3ff, 0x794, 0xde0}, /* direction */
    {0x1, 0x3, 0x6, 0xa, 0x14, 0x27, 0x48, 0xbd, 0x189, 0x26d, 0x5f4, 0xcbf}, /* light, 2 */
    {0x1, 0x3, 0x5, 0xb, 0x14, 0x30, 0x54, 0xb5, 0x1ce, 0x299, 0x51e, 0xd4a}, /* place, 2 */
    {0x1, 0x2, 0x4, 0xe, 0x17, 0x25, 0x46, 0xd4, 0x1fa, 0x35b, 0x5c0, 0xa44}, /* lobe, 2 */
    {0x1, 0x2, 0x5, 0x9, 0x15, 0x3f, 0x58, 0x92, 0x1d1, 0x205, 0x73d, 0xbcc}, /* direction, 2 */
};

/* Column b of a group's matrix; behind those of the table any will do that others do not have. */
static uint32_t column(uint32_t group, uint32_t b) {
    if (b < COLUMNS)
        return columns[group][b];
    uint32_t h = group * 0x9e3779b9u + b * 0x85ebca6bu;
    h = (h ^ (h >> 16)) * 0x21f0aaadu;
    h = (h ^ (h >> 15)) * 0x735a2d97u;
    h ^= h >> 15;
    return (h & ((1u << b) - 1u)) | 1u << b;
}

static uint32_t reverse_bits(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

/* v[i]: what bit i of the index contributes to dimension d of a group, first binary digit in bit
 * 31. */
static void direction_numbers(uint32_t group, uint32_t d, uint32_t v[32]) {
    uint32_t plain[32]; /* van der Corput's, or of the primitive polynomial of degree 1 */
    for (uint32_t i = 0; i < 32; i++)
        plain[i] = d == 0 ? 1u << (31 - i) : i == 0 ? 1u << 31 : plain[i - 1] ^ (plain[i - 1] >> 1);
    for (uint32_t b = 0; b < 32; b++) {
        const uint32_t bits = column(group, b);
        v[b] = 0;
        for (uint32_t i = 0; i <= b; i++)
            if (bits >> i & 1u)
                v[b] ^= plain[i];
    }
}

trc_status trc_sobol_table_create(uint32_t **table_out) {
    uint32_t *table = trc_alloc((size_t)TRC_SOBOL_LEVELS * TRC_SOBOL_DIMENSIONS * TRC_SOBOL_POINTS,
                                sizeof *table);
    if (!table)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the sample table");
    uint32_t dimension = 0;
    for (uint32_t group = 0; group < GROUPS; group++) {
        for (uint32_t d = 0; d < size_of[group]; d++, dimension++) {
            uint32_t v[32];
            direction_numbers(group, d, v);
            for (uint32_t level = 0; level < TRC_SOBOL_LEVELS; level++) {
                uint32_t *entry = table + trc_sobol_offset(level, dimension);
                entry[0] = 0;
                for (uint32_t bit = 0; bit < TRC_SOBOL_POINT_BITS; bit++) {
                    const uint32_t number = reverse_bits(v[level * TRC_SOBOL_POINT_BITS + bit]);
                    for (uint32_t i = 0; i < 1u << bit; i++)
                        entry[(1u << bit) + i] = entry[i] ^ number;
                }
            }
        }
    }
    *table_out = table;
    return TRC_OK;
}
