/* The filter's phases behind one call, and what they share. */
#include "kernels/filter/filter.h"

struct trc_light_channel trc_light_channel_at(const struct trc_film *film, uint32_t number) {
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++) {
        const uint32_t channels = film->clean.sums[pass] ? trc_pass_info_of(pass)->sums : 0;
        if (number < channels)
            return (struct trc_light_channel){film->sums[pass] + number,
                                              film->clean.sums[pass] + number, channels};
        number -= channels;
    }
    return (struct trc_light_channel){(const double *)film->caught + number,
                                      (double *)film->clean.caught + number, TRC_CAUGHT_CHANNELS};
}

void trc_plane_load(const struct trc_denoise_job *job, const float *values, float *plane) {
    const struct trc_film *film = job->denoise->film;
    const bool is_inside = job->x >= TRC_HALO && job->x + TRC_TILE_SIZE + TRC_HALO <= film->width;
    for (int y = -TRC_HALO; y < TRC_TILE_SIZE + TRC_HALO; y++) {
        const float *row =
            values + (size_t)trc_mirror((int64_t)job->y + y, film->height) * film->width;
        if (is_inside) { /* most tiles, whole rows at once */
            memcpy(plane + trc_plane_at(-TRC_HALO, y), row + job->x - TRC_HALO,
                   (TRC_TILE_SIZE + 2 * TRC_HALO) * sizeof *plane);
            continue;
        }
        for (int x = -TRC_HALO; x < TRC_TILE_SIZE + TRC_HALO; x++)
            plane[trc_plane_at(x, y)] = row[trc_mirror((int64_t)job->x + x, film->width)];
    }
}

size_t trc_denoise_memory_bytes(void) {
    const size_t bytes[] = {trc_features_bytes(), trc_regress_bytes(), trc_blend_bytes(),
                            trc_twice_bytes()};
    size_t most = 0;
    for (size_t i = 0; i < sizeof bytes / sizeof *bytes; i++)
        most = bytes[i] > most ? bytes[i] : most;
    return most;
}

void trc_denoise_tile(const struct trc_denoise_job *job) {
    const uint32_t batch =
        job->step > TRC_DENOISE_TWICE ? (job->step - TRC_DENOISE_RESIDUAL) / 2 : 0;
    const uint32_t first = batch * TRC_RESIDUAL_CHANNELS;
    switch ((enum trc_denoise_phase)(job->step - 2 * batch)) {
    case TRC_DENOISE_FEATURES:
        trc_features_filter(job);
        break;
    case TRC_DENOISE_REGRESS:
        trc_regress(job);
        break;
    case TRC_DENOISE_BLEND:
        trc_blend(job);
        break;
    case TRC_DENOISE_RESIDUAL:
        trc_residual(job, first);
        break;
    case TRC_DENOISE_TWICE:
        trc_twice(job, first);
        break;
    }
}
