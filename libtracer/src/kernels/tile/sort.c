/* Sorting by keys: of rays by what packets share, of hits by material, of samples by cells. */
#include "kernels/tile/tile.h"

void trc_tile_sort(struct trc_tile *t, const uint32_t *keys, uint32_t count, uint32_t *order) {
    uint32_t least = UINT32_MAX, most = 0;
    for (uint32_t i = 0; i < count; i++) {
        least = keys[i] < least ? keys[i] : least;
        most = keys[i] > most ? keys[i] : most;
    }
    if (least >= most) { /* mostly so for camera rays */
        for (uint32_t i = 0; i < count; i++)
            order[i] = i;
        return;
    }
    uint32_t *const bins = t->bins;
    const uint32_t bin_count = most - least + 1;
    memset(bins, 0, (bin_count + 1) * sizeof *bins);
    for (uint32_t i = 0; i < count; i++)
        bins[keys[i] - least + 1]++;
    for (uint32_t i = 1; i < bin_count; i++)
        bins[i] += bins[i - 1];
    for (uint32_t i = 0; i < count; i++)
        order[bins[keys[i] - least]++] = i;
}
