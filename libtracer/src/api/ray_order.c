#include "api/ray_order.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>

#include "core/checks.h"
#include "core/core.h"

/* Bits of a key, from the highest on: the dominant axis and its side; where the origin is, by the
 * upper bits of each axis; the direction's other axes; where the origin is within that cell. */
#define PLACE_BITS 5  /* of an axis of the origin */
#define COARSE_BITS 3 /* the upper ones of them */
#define SLOPE_CELLS 4 /* of another axis of the direction, against the dominant one */
#define SLOPE_BITS 2
#define FINE_BITS (3 * (PLACE_BITS - COARSE_BITS))
#define SLOPES_AT FINE_BITS
#define COARSE_AT (SLOPES_AT + 2 * SLOPE_BITS)
#define SIDE_AT (COARSE_AT + 3 * COARSE_BITS)
#define NO_SIDE 6u /* of rays that hit nothing: behind the six sides */

/* Half of a key's bits are sorted in one pass. */
#define DIGIT_BITS ((SIDE_AT + 3) / 2)
#define DIGITS (1u << DIGIT_BITS)
_Static_assert(2 * DIGIT_BITS == SIDE_AT + 3, "two passes sort by all bits");

trc_status trc_ray_order_open(uint32_t count, struct trc_ray_order *order) {
    order->order = trc_alloc_zeroed((size_t)count + TRC_RAY_ORDER_ROOM, sizeof *order->order);
    order->keys = trc_alloc(count, sizeof *order->keys);
    order->sorted = trc_alloc(count, sizeof *order->sorted);
    if (order->order && order->keys && order->sorted)
        return TRC_OK;
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to reorder %u rays", count);
}

void trc_ray_order_close(struct trc_ray_order *order) {
    trc_free(order->order);
    trc_free(order->keys);
    trc_free(order->sorted);
    *order = (struct trc_ray_order){0};
}

/* Cubes that hold all origins, 2^PLACE_BITS along the longest axis. */
struct grid {
    float low[3], per_length;
};

static struct grid grid_of(const trc_rays *rays, uint64_t begin, uint32_t count) {
    const float *const origins[3] = {rays->origin_x + begin, rays->origin_y + begin,
                                     rays->origin_z + begin};
    struct grid grid = {{0.0f, 0.0f, 0.0f}, 0.0f};
    float longest = 0.0f;
    for (int k = 0; k < 3; k++) {
        float low = INFINITY, high = -INFINITY;
        for (uint32_t i = 0; i < count; i++) {
            const float o = origins[k][i];
            low = o < low && o >= -FLT_MAX ? o : low;
            high = o > high && o <= FLT_MAX ? o : high;
        }
        grid.low[k] = low;
        longest = high - low > longest ? high - low : longest;
    }
    if (longest > 0.0f)
        grid.per_length = (float)(1 << PLACE_BITS) / longest;
    return grid;
}

/* Whether all numbers are finite and the direction is not zero. */
static bool ray_may_hit(const float o[3], const float d[3]) {
    const float none = 0.0f * o[0] + 0.0f * o[1] + 0.0f * o[2] + 0.0f * d[0] + 0.0f * d[1] +
                       0.0f * d[2]; /* not a number where one is infinite or none */
    return none == 0.0f && (d[0] != 0.0f || d[1] != 0.0f || d[2] != 0.0f);
}

/* The whole part of a number, within 0 and last; what is none is there, too. */
static uint32_t cell_of(float at, float last) {
    const float below = at < last ? at : last;
    return (uint32_t)(int32_t)(below > 0.0f ? below : 0.0f);
}

/* Five bits, two zeros between each two. */
static uint32_t spread(uint32_t bits) {
    bits = (bits | bits << 8) & 0x100f;
    bits = (bits | bits << 4) & 0x10c3;
    return (bits | bits << 2) & 0x1249;
}

static uint32_t key_of(const struct grid *grid, const float o[3], const float d[3]) {
    const float last_place = (float)((1 << PLACE_BITS) - 1), last_slope = SLOPE_CELLS - 1;
    uint32_t place = 0;
    for (int k = 0; k < 3; k++)
        place |= spread(cell_of((o[k] - grid->low[k]) * grid->per_length, last_place)) << k;
    const float x = fabsf(d[0]), y = fabsf(d[1]), z = fabsf(d[2]);
    const bool by_x = (x >= y) & (x >= z), by_y = y >= z;
    const float along = by_x ? d[0] : by_y ? d[1] : d[2];
    const float u = by_x ? d[1] : by_y ? d[2] : d[0], v = by_x ? d[2] : by_y ? d[0] : d[1];
    const float half = 0.5f * SLOPE_CELLS, per_slope = half / fabsf(along);
    const uint32_t slopes = cell_of(u * per_slope + half, last_slope) << SLOPE_BITS |
                            cell_of(v * per_slope + half, last_slope);
    const uint32_t side = (by_x ? 0u : by_y ? 2u : 4u) + (along < 0.0f);
    return side << SIDE_AT | place >> FINE_BITS << COARSE_AT | slopes << SLOPES_AT |
           (place & ((1u << FINE_BITS) - 1));
}

/* Sorts stably by one digit of the keys. */
static void digit_sort(const struct trc_ray_key *from, uint32_t count, uint32_t shift,
                       struct trc_ray_key *to) {
    uint32_t first[DIGITS + 1] = {0};
    for (uint32_t i = 0; i < count; i++)
        first[(from[i].key >> shift & (DIGITS - 1)) + 1]++;
    for (uint32_t k = 0; k < DIGITS; k++)
        first[k + 1] += first[k];
    for (uint32_t i = 0; i < count; i++)
        to[first[from[i].key >> shift & (DIGITS - 1)]++] = from[i];
}

void trc_ray_order_sort(struct trc_ray_order *order, const trc_rays *rays, uint64_t begin,
                        uint32_t count) {
    const struct grid grid = grid_of(rays, begin, count);
    for (uint32_t i = 0; i < count; i++) {
        const uint64_t ray = begin + i;
        const float o[3] = {rays->origin_x[ray], rays->origin_y[ray], rays->origin_z[ray]};
        const float d[3] = {rays->direction_x[ray], rays->direction_y[ray], rays->direction_z[ray]};
        order->keys[i] =
            (struct trc_ray_key){ray_may_hit(o, d) ? key_of(&grid, o, d) : NO_SIDE << SIDE_AT, i};
    }
    digit_sort(order->keys, count, 0, order->sorted);
    digit_sort(order->sorted, count, DIGIT_BITS, order->keys);
    for (uint32_t i = 0; i < count; i++)
        order->order[i] = order->keys[i].ray;
}
