/* The table behind every low-discrepancy number: TRC_SOBOL_DIMENSIONS dimensions, in groups of one
 * or two that are used together (the place in the pixel, on the lens, on a light, ...).
 *
 * Every pair is the first two dimensions of Sobol's sequence, a perfect one: each box of area 2^-m
 * has one of 2^m points, which no other two of Sobol's dimensions have. The groups differ in the
 * order of the points, which keeps blocks of 2^k points whole and leaves each group as it is: H.
 * Faure and S. Tezuka, "Another Random Scrambling of Digital (t,s)-Sequences" (2002). Which orders
 * are good for several groups at once is found by search, see sobol.c.
 *
 * A number of the sequence is linear over GF(2) in the bits of its index, so three levels of
 * TRC_SOBOL_POINTS entries, xor-ed, give all indices below 2^30. Entries are bit-reversed (the
 * first binary digit of the number is bit 0), which is what hashed Owen scrambling wants. */
#ifndef TRACER_MODEL_SOBOL_H
#define TRACER_MODEL_SOBOL_H

#include <stdint.h>

#include "tracer/base.h"

#define TRC_SOBOL_DIMENSIONS 17
#define TRC_SOBOL_LEVELS 3
#define TRC_SOBOL_POINT_BITS 10
#define TRC_SOBOL_POINTS (1u << TRC_SOBOL_POINT_BITS)

/* Where the number of point i (below TRC_SOBOL_POINTS, times TRC_SOBOL_POINTS^level) stands. */
static inline uint32_t trc_sobol_offset(uint32_t level, uint32_t dimension) {
    return (level * TRC_SOBOL_DIMENSIONS + dimension) * TRC_SOBOL_POINTS;
}

#define TRC_SOBOL_TABLE_BYTES \
    (sizeof(uint32_t) * TRC_SOBOL_LEVELS * TRC_SOBOL_DIMENSIONS * TRC_SOBOL_POINTS)

/* The table, 204 KiB of which most renders touch the first third; to be freed by trc_free.
 * Immutable: threads share it. Takes about 50 microseconds. TRC_ERROR_OUT_OF_MEMORY leaves
 * *table_out as it is. */
trc_status trc_sobol_table_create(uint32_t **table_out);

#endif
