/* Memory of reconstruction: of the film, and of the filter between its phases. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "film/film.h"

/* Whether the film is to be reconstructed at its end; a part is not. */
static bool has_clean_film(const trc_render_desc *desc) {
    return desc->denoise == TRC_DENOISE_FINAL && !trc_film_is_part(desc);
}

/* Colours that light is divided by are filtered as it is: a pixel that gets light of its neighbours
 * may have no colour of that kind itself. */
static bool is_divisor(uint32_t pass) {
    for (uint32_t light = 0; light < TRC_PASS_COUNT; light++)
        if (trc_pass_info_of(light)->color == pass)
            return true;
    return false;
}

static bool is_reconstructed(const trc_render_desc *desc, uint32_t pass) {
    return trc_film_has_sums(desc, pass) &&
           (trc_pass_info_of(pass)->kind == TRC_PASS_KIND_LIGHT || is_divisor(pass));
}

uint64_t trc_film_half_bytes(const trc_render_desc *desc, bool has_catchers) {
    if (!has_clean_film(desc))
        return sizeof(struct trc_half);
    uint64_t bytes = sizeof(struct trc_half) + TRC_DENOISE_PIXEL_BYTES;
    if (has_catchers)
        bytes += sizeof(struct trc_caught);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        if (is_reconstructed(desc, pass))
            bytes += trc_pass_info_of(pass)->sums * sizeof(double);
    return bytes;
}

trc_status trc_film_add_halves(const trc_render_desc *desc, struct trc_film *film) {
    const size_t pixels = (size_t)film->width * film->height;
    /* Pixels that stop at a power of two, or are shown at one, are halved there. */
    const bool stops = desc->noise_threshold > 0.0f || desc->progressive;
    film->half_count = stops || desc->sample_count < 2 ? 0 : desc->sample_count / 2;
    film->extra_begin = desc->extra_samples > 0.0f ? desc->sample_count : 0;
    film->halves = trc_alloc_zeroed(pixels, sizeof *film->halves);
    bool ok = film->halves != NULL;
    if (!has_clean_film(desc))
        return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for halves of samples");
    for (uint32_t pass = 0; ok && pass < TRC_SUM_COUNT; pass++) {
        if (!is_reconstructed(desc, pass))
            continue;
        film->clean.sums[pass] =
            trc_alloc_zeroed(pixels, trc_pass_info_of(pass)->sums * sizeof(double));
        ok = film->clean.sums[pass] != NULL;
    }
    if (ok && film->caught) {
        film->clean.caught = trc_alloc_zeroed(pixels, sizeof *film->clean.caught);
        ok = film->clean.caught != NULL;
    }
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for reconstruction");
}

static uint32_t channel_count_of(const struct trc_film *film) {
    uint32_t count = film->clean.caught ? TRC_CAUGHT_CHANNELS : 0;
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        count += film->clean.sums[pass] ? trc_pass_info_of(pass)->sums : 0;
    return count;
}

trc_status trc_denoise_create(struct trc_film *film, struct trc_denoise *denoise) {
    const uint32_t channels = channel_count_of(film);
    const uint32_t batches = (channels + TRC_RESIDUAL_CHANNELS - 1) / TRC_RESIDUAL_CHANNELS;
    *denoise = (struct trc_denoise){
        .film = film, .channel_count = channels, .step_count = TRC_DENOISE_RESIDUAL + 2 * batches};
    float **const planes[TRC_DENOISE_PLANES - TRC_FEATURE_COUNT] = {
        &denoise->variance, &denoise->error, &denoise->missed[0], &denoise->missed[1],
        &denoise->change};
    /* One block, which may take large pages where a plane could not. */
    const size_t pixels = (size_t)film->width * film->height;
    denoise->memory = trc_alloc(pixels, TRC_DENOISE_PIXEL_BYTES);
    if (!denoise->memory)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for reconstruction");
    for (int k = 0; k < TRC_FEATURE_COUNT; k++)
        denoise->features[k] = denoise->memory + (size_t)k * pixels;
    for (int k = TRC_FEATURE_COUNT; k < TRC_DENOISE_PLANES; k++)
        *planes[k - TRC_FEATURE_COUNT] = denoise->memory + (size_t)k * pixels;
    return TRC_OK;
}

void trc_denoise_destroy(struct trc_denoise *denoise) {
    trc_free(denoise->memory);
    memset(denoise, 0, sizeof *denoise);
}
