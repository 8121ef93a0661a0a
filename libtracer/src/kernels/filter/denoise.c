/* The filter's phases behind one call. */
#include "kernels/filter/filter.h"

size_t trc_denoise_memory_bytes(void) {
    const size_t bytes[] = {trc_features_bytes(), trc_regress_bytes(), trc_blend_bytes()};
    size_t most = 0;
    for (int i = 0; i < 3; i++)
        most = bytes[i] > most ? bytes[i] : most;
    return most;
}

void trc_denoise_tile(const struct trc_denoise_job *job) {
    switch ((enum trc_denoise_phase)job->phase) {
    case TRC_DENOISE_FEATURES:
        trc_features_filter(job);
        break;
    case TRC_DENOISE_REGRESS:
        trc_regress(job);
        break;
    case TRC_DENOISE_BLEND:
        trc_blend(job);
        break;
    case TRC_DENOISE_PHASE_COUNT:
        break;
    }
}
