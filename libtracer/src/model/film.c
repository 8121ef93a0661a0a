#include "model/film.h"

bool trc_film_has_sums(const trc_render_desc *desc, uint32_t pass) {
    if (pass < TRC_PASS_COUNT)
        return desc->passes >> pass & 1 && trc_pass_info_of(pass)->sums;
    return pass - TRC_PASS_AOV_VALUE(0) < desc->aov_value_count ||
           pass - TRC_PASS_AOV_COLOR(0) < desc->aov_color_count ||
           pass - TRC_PASS_LIGHT_GROUP(0) < desc->light_group_count;
}

uint32_t trc_film_matte_count(const trc_render_desc *desc) {
    const uint32_t layers =
        (desc->cryptomatte_depth + TRC_CRYPTOMATTE_LAYER_RANKS - 1) / TRC_CRYPTOMATTE_LAYER_RANKS;
    if (!desc->cryptomattes)
        return 0;
    return (trc_film_is_part(desc) ? TRC_MAX_CRYPTOMATTE_DEPTH
                                   : layers * TRC_CRYPTOMATTE_LAYER_RANKS) +
           TRC_SPARE_MATTES;
}

/* What previews read meanwhile (model/sequence.h). */
static void store_float(float *p, float value) { __atomic_store(p, &value, __ATOMIC_RELAXED); }

void trc_film_keep_half(const struct trc_film *film, size_t pixel, const double sum[4],
                        uint32_t count) {
    static const uint32_t passes[] = {TRC_PASS_DENOISING_ALBEDO, TRC_PASS_DENOISING_NORMAL,
                                      TRC_PASS_DENOISING_DEPTH};
    struct trc_half *half = &film->halves[pixel];
    for (int c = 0; c < 4; c++) {
        const bool has_shadow = film->caught && c < 3;
        const double light = has_shadow ? sum[c] + film->caught[pixel].blocked[c] : sum[c];
        store_float(&half->light[c], (float)light);
    }
    float *feature = half->features;
    for (int i = 0; i < 3 && film->sums[passes[i]]; i++) /* all or none are there */
        for (uint32_t k = 0; k < trc_pass_info_of(passes[i])->sums; k++)
            *feature++ =
                (float)film->sums[passes[i]][trc_pass_info_of(passes[i])->sums * pixel + k];
    __atomic_store_n(&half->count, count, __ATOMIC_RELAXED);
}
