#include "model/sobol.h"

#include "core/core.h"

/* Rows of Joe and Kuo's file new-joe-kuo-6: degree s of the primitive polynomial, its inner
 * coefficients a, initial direction numbers m. Row 0 stands for the van der Corput sequence. */
struct direction_seed {
    uint8_t s, a;
    uint8_t m[7];
};
static const struct direction_seed seeds[TRC_SOBOL_DIMENSIONS] = {
    {0, 0, {0}},
    {1, 0, {1}},
    {2, 1, {1, 3}},
    {3, 1, {1, 3, 1}},
    {3, 2, {1, 1, 1}},
    {4, 1, {1, 1, 3, 3}},
    {4, 4, {1, 3, 5, 13}},
    {5, 2, {1, 1, 5, 5, 17}},
    {5, 4, {1, 1, 5, 5, 5}},
    {5, 7, {1, 1, 7, 11, 19}},
    {5, 11, {1, 1, 5, 1, 1}},
    {5, 13, {1, 1, 1, 3, 11}},
    {5, 14, {1, 3, 5, 5, 31}},
    {6, 1, {1, 3, 3, 9, 7, 49}},
    {6, 13, {1, 1, 1, 15, 21, 21}},
    {6, 16, {1, 3, 1, 13, 27, 49}},
    {6, 19, {1, 1, 1, 15, 7, 5}},
};

/* Row of seeds for each dimension of enum trc_dimension. Rows 0 and 1 are a perfect (0,2)-sequence
 * and serve the place on the light at the first hit; for the other pairs the sum of their t-values
 * over the first 2^2 to 2^10 points is 8 or 9, against 13 for an average pair of rows. */
static const uint8_t row_of[TRC_SOBOL_DIMENSIONS] = {
    5,  7,                /* pixel */
    2,  3,                /* lens */
    11,                   /* time */
    9,  0,  1,  12, 4, 6, /* first hit: light, place on it, lobe, direction */
    16, 10, 13, 14, 8, 15 /* second hit */
};

static uint32_t reverse_bits(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
    x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
    x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
    return ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
}

/* v[i]: what bit i of the index contributes, first binary digit in bit 31. The recurrence is eq. 2
 * of the paper. */
static void direction_numbers(const struct direction_seed *seed, uint32_t v[32]) {
    const uint32_t s = seed->s;
    if (s == 0) {
        for (uint32_t i = 0; i < 32; i++)
            v[i] = 1u << (31 - i);
        return;
    }
    for (uint32_t i = 0; i < s && i < sizeof seed->m; i++)
        v[i] = (uint32_t)seed->m[i] << (31 - i);
    for (uint32_t i = s; i < 32; i++) {
        v[i] = v[i - s] ^ (v[i - s] >> s);
        for (uint32_t k = 1; k < s; k++)
            if ((seed->a >> (s - 1 - k)) & 1u)
                v[i] ^= v[i - k];
    }
}

trc_status trc_sobol_table_create(uint32_t **table_out) {
    uint32_t *table = trc_alloc((size_t)TRC_SOBOL_LEVELS * TRC_SOBOL_DIMENSIONS * TRC_SOBOL_POINTS,
                                sizeof *table);
    if (!table)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the sample table");
    for (uint32_t d = 0; d < TRC_SOBOL_DIMENSIONS; d++) {
        uint32_t v[32];
        direction_numbers(&seeds[row_of[d]], v);
        for (uint32_t level = 0; level < TRC_SOBOL_LEVELS; level++) {
            uint32_t *entry = table + trc_sobol_offset(level, d);
            entry[0] = 0;
            for (uint32_t bit = 0; bit < TRC_SOBOL_POINT_BITS; bit++) {
                const uint32_t number = reverse_bits(v[level * TRC_SOBOL_POINT_BITS + bit]);
                for (uint32_t i = 0; i < 1u << bit; i++)
                    entry[(1u << bit) + i] = entry[i] ^ number;
            }
        }
    }
    *table_out = table;
    return TRC_OK;
}
