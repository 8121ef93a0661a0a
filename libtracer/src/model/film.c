#include "model/film.h"

static bool is_aov_value(uint32_t pass) {
    return pass >= TRC_PASS_AOV_VALUE(0) && pass < TRC_PASS_AOV_VALUE(TRC_MAX_AOVS);
}
static bool is_aov_color(uint32_t pass) {
    return pass >= TRC_PASS_AOV_COLOR(0) && pass < TRC_PASS_AOV_COLOR(TRC_MAX_AOVS);
}

uint32_t trc_pass_channels(uint32_t pass) {
    static const uint8_t channels[TRC_PASS_COUNT] = {
        [TRC_PASS_COMBINED] = 4,
        [TRC_PASS_DEPTH] = 1,
        [TRC_PASS_NORMAL] = 3,
        [TRC_PASS_POSITION] = 3,
        [TRC_PASS_UV] = 3,
        [TRC_PASS_OBJECT_INDEX] = 1,
        [TRC_PASS_MATERIAL_INDEX] = 1,
        [TRC_PASS_EMISSION] = 3,
        [TRC_PASS_ENVIRONMENT] = 3,
        [TRC_PASS_DIFFUSE_DIRECT] = 3,
        [TRC_PASS_DIFFUSE_INDIRECT] = 3,
        [TRC_PASS_DIFFUSE_COLOR] = 3,
        [TRC_PASS_GLOSSY_DIRECT] = 3,
        [TRC_PASS_GLOSSY_INDIRECT] = 3,
        [TRC_PASS_GLOSSY_COLOR] = 3,
        [TRC_PASS_TRANSMISSION_DIRECT] = 3,
        [TRC_PASS_TRANSMISSION_INDIRECT] = 3,
        [TRC_PASS_TRANSMISSION_COLOR] = 3,
        [TRC_PASS_SAMPLE_COUNT] = 1,
        [TRC_PASS_MIST] = 1,
        [TRC_PASS_DENOISING_ALBEDO] = 3,
        [TRC_PASS_DENOISING_NORMAL] = 3,
        [TRC_PASS_DENOISING_DEPTH] = 1,
        [TRC_PASS_VECTOR] = 4,
        [TRC_PASS_AMBIENT_OCCLUSION] = 3,
        [TRC_PASS_SHADOW] = 3,
        [TRC_PASS_SHADOW_CATCHER] = 3,
    };
    if (trc_film_is_cryptomatte(pass))
        return TRC_MATTE_CHANNELS;
    if (is_aov_value(pass))
        return 1;
    if (is_aov_color(pass))
        return 4;
    if (trc_film_is_light_group(pass))
        return 3;
    return pass < TRC_PASS_COUNT ? channels[pass] : 0;
}

uint32_t trc_film_channels(uint32_t pass) {
    return trc_pass_channels(pass) + (pass == TRC_PASS_VECTOR);
}

bool trc_film_is_first_sample(uint32_t pass) {
    return pass == TRC_PASS_DEPTH || pass == TRC_PASS_POSITION || pass == TRC_PASS_OBJECT_INDEX ||
           pass == TRC_PASS_MATERIAL_INDEX;
}

uint32_t trc_film_color_pass(uint32_t pass) {
    if (pass < TRC_PASS_DIFFUSE_DIRECT || pass > TRC_PASS_TRANSMISSION_COLOR)
        return TRC_PASS_COMBINED;
    /* direct, indirect, colour of one kind stand together */
    return pass + 2 - (pass - TRC_PASS_DIFFUSE_DIRECT) % 3;
}

bool trc_film_has_sums(const trc_render_desc *desc, uint32_t pass) {
    if (is_aov_value(pass))
        return pass - TRC_PASS_AOV_VALUE(0) < desc->aov_value_count;
    if (is_aov_color(pass))
        return pass - TRC_PASS_AOV_COLOR(0) < desc->aov_color_count;
    if (trc_film_is_light_group(pass))
        return pass - TRC_PASS_LIGHT_GROUP(0) < desc->light_group_count;
    const bool is_sum = pass != TRC_PASS_SAMPLE_COUNT && pass != TRC_PASS_SHADOW_CATCHER;
    return pass < TRC_PASS_COUNT && is_sum && (desc->passes >> pass & 1);
}

uint32_t trc_film_matte_count(const trc_render_desc *desc) {
    const uint32_t layers =
        (desc->cryptomatte_depth + TRC_CRYPTOMATTE_LAYER_RANKS - 1) / TRC_CRYPTOMATTE_LAYER_RANKS;
    return desc->cryptomattes ? layers * TRC_CRYPTOMATTE_LAYER_RANKS + TRC_SPARE_MATTES : 0;
}
