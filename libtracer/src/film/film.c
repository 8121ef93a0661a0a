#include "film/film.h"

#include <inttypes.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/extra.h"

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

uint64_t trc_film_pixel_bytes(const trc_render_desc *desc) {
    uint64_t bytes = sizeof(uint32_t); /* its sample count */
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++) {
        if (trc_film_has_sums(desc, pass))
            bytes += trc_pass_info_of(pass)->sums * sizeof(double);
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
                            .shows_noise = desc->passes >> TRC_PASS_NOISY_COMBINED & 1,
                            .is_transparent = desc->film_transparent,
                            .guides = desc->guides,
                            .matte_count = trc_film_matte_count(desc),
                            .matte_units = trc_matte_units(trc_extra_most_samples(desc)),
                            .sample_offset = desc->sample_offset};
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
        made.sums[pass] = trc_alloc_zeroed(pixels, trc_pass_info_of(pass)->sums * sizeof(double));
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
    trc_free(film->halves);
    trc_free(film->clean.caught);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        trc_free(film->clean.sums[pass]);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        trc_free(film->sums[pass]);
    for (uint32_t kind = 0; kind < TRC_CRYPTOMATTE_KINDS; kind++)
        trc_free(film->mattes[kind]);
    trc_free(film->sample_counts);
    trc_free(film->sequences);
    memset(film, 0, sizeof *film);
}
