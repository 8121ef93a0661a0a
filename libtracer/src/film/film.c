#include "film/film.h"

#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"

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

trc_status trc_film_check_budget(uint32_t width, uint32_t height, uint64_t pixel_bytes,
                                 uint64_t other_bytes) {
    uint64_t bytes = 0;
    const bool fits =
        trc_multiply_u64((uint64_t)width * height, pixel_bytes, &bytes) && bytes <= PTRDIFF_MAX;
    const uint64_t needed = bytes + other_bytes, left = trc_memory_left_bytes();
    if (!fits || needed > left) {
        return trc_fail(TRC_ERROR_TOO_LARGE,
                        "%" PRIu32 " x %" PRIu32 " pixels with these settings need %" PRIu64
                        " MiB, there are %" PRIu64 " MiB left",
                        width, height, needed >> 20, left >> 20);
    }
    return TRC_OK;
}

uint32_t trc_film_matte_count(const trc_render_desc *desc) {
    const uint32_t layers =
        (desc->cryptomatte_depth + TRC_CRYPTOMATTE_LAYER_RANKS - 1) / TRC_CRYPTOMATTE_LAYER_RANKS;
    return desc->cryptomattes ? layers * TRC_CRYPTOMATTE_LAYER_RANKS + TRC_SPARE_MATTES : 0;
}

uint64_t trc_film_pixel_bytes(const trc_render_desc *desc) {
    uint64_t bytes = sizeof(uint32_t); /* its sample count */
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++) {
        if (trc_film_has_sums(desc, pass))
            bytes += trc_film_channels(pass) * sizeof(double);
    }
    return bytes + (uint64_t)__builtin_popcount(desc->cryptomattes) * trc_film_matte_count(desc) *
                       sizeof(struct trc_matte);
}

static size_t tile_count(const struct trc_film *film) {
    return (size_t)trc_film_tiles(film->width) * trc_film_tiles(film->height);
}

trc_status trc_film_create(const trc_render_desc *desc, struct trc_film *film) {
    struct trc_film made = {.width = desc->crop_width,
                            .height = desc->crop_height,
                            .shows_counts = desc->passes >> TRC_PASS_SAMPLE_COUNT & 1,
                            .shows_shadows = desc->passes >> TRC_PASS_SHADOW_CATCHER & 1,
                            .is_transparent = desc->film_transparent,
                            .matte_count = trc_film_matte_count(desc)};
    TRC_TRY(trc_film_check_budget(made.width, made.height, trc_film_pixel_bytes(desc), 0));
    const size_t pixels = (size_t)made.width * made.height;
    /* Tiles read the counts before they write them, and the sums only where there is a count. */
    made.sample_counts = trc_alloc(pixels, sizeof *made.sample_counts);
    made.sequences = trc_alloc(tile_count(&made), sizeof *made.sequences);
    bool ok = made.sample_counts && made.sequences;
    if (ok)
        memset(made.sample_counts, 0, pixels * sizeof *made.sample_counts);
    for (size_t i = 0; ok && i < tile_count(&made); i++)
        atomic_init(&made.sequences[i], 0);
    for (uint32_t pass = 0; ok && pass < TRC_SUM_COUNT; pass++) {
        if (!trc_film_has_sums(desc, pass))
            continue;
        made.sums[pass] = trc_alloc_zeroed(pixels, trc_film_channels(pass) * sizeof(double));
        ok = made.sums[pass] != NULL;
    }
    for (uint32_t kind = 0; ok && kind < TRC_CRYPTOMATTE_KINDS; kind++) {
        if (!(desc->cryptomattes >> kind & 1))
            continue;
        made.mattes[kind] = trc_alloc_zeroed(pixels, made.matte_count * sizeof(struct trc_matte));
        ok = made.mattes[kind] != NULL;
    }
    if (!ok) {
        trc_film_destroy(&made);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the film");
    }
    *film = made;
    return TRC_OK;
}

trc_status trc_film_add_catchers(struct trc_film *film) {
    film->caught = trc_alloc_zeroed((size_t)film->width * film->height, sizeof *film->caught);
    return film->caught ? TRC_OK
                        : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for shadow catchers");
}

void trc_film_destroy(struct trc_film *film) {
    trc_free(film->caught);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        trc_free(film->sums[pass]);
    for (uint32_t kind = 0; kind < TRC_CRYPTOMATTE_KINDS; kind++)
        trc_free(film->mattes[kind]);
    trc_free(film->sample_counts);
    trc_free(film->sequences);
    memset(film, 0, sizeof *film);
}
