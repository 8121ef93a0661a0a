/* Sorting by keys: of rays by what packets share, of hits by material, of samples by cells. */
#include "kernels/tile/tile.h"

void trc_tile_sort(struct trc_tile *t, const uint32_t *keys, uint32_t count, uint32_t *order) {
    uint32_t minimum = UINT32_MAX, maximum = 0;
    for (uint32_t i = 0; i < count; i++) {
        minimum = keys[i] < minimum ? keys[i] : minimum;
        maximum = keys[i] > maximum ? keys[i] : maximum;
    }
    if (minimum >= maximum) { /* mostly so for camera rays */
        for (uint32_t i = 0; i < count; i++)
            order[i] = i;
        return;
    }
    uint32_t *const bins = t->bins;
    const uint32_t bin_count = maximum - minimum + 1;
    memset(bins, 0, (bin_count + 1) * sizeof *bins);
    for (uint32_t i = 0; i < count; i++)
        bins[keys[i] - minimum + 1]++;
    for (uint32_t i = 1; i < bin_count; i++)
        bins[i] += bins[i - 1];
    for (uint32_t i = 0; i < count; i++)
        order[bins[keys[i] - minimum]++] = i;
}
