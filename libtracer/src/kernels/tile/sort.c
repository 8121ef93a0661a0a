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
    /* Each half of the keys has bins of its own, so that equal keys one after the other wait for
     * each other half as long. */
    const uint32_t bin_count = maximum - minimum + 1, half = count / 2;
    uint32_t *const bins[2] = {t->bins[0], t->bins[1]};
    for (int k = 0; k < 2; k++)
        memset(bins[k], 0, bin_count * sizeof *bins[k]);
    for (uint32_t i = 0; i < half; i++) {
        bins[0][keys[i] - minimum]++;
        bins[1][keys[half + i] - minimum]++;
    }
    if (count & 1)
        bins[1][keys[count - 1] - minimum]++;
    for (uint32_t i = 0, place = 0; i < bin_count; i++) {
        const uint32_t first = bins[0][i], both = first + bins[1][i];
        bins[0][i] = place;
        bins[1][i] = place + first;
        place += both;
    }
    for (uint32_t i = 0; i < half; i++) {
        order[bins[0][keys[i] - minimum]++] = i;
        order[bins[1][keys[half + i] - minimum]++] = half + i;
    }
    if (count & 1)
        order[bins[1][keys[count - 1] - minimum]++] = count - 1;
}
