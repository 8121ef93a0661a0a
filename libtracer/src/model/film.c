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
    return desc->cryptomattes ? layers * TRC_CRYPTOMATTE_LAYER_RANKS + TRC_SPARE_MATTES : 0;
}
