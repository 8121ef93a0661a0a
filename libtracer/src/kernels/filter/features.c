/* Features of the film without the noise that motion, lenses and edges give them: means over pixels
 * whose neighbourhoods are alike (A. Buades, B. Coll, J.-M. Morel, "A Non-local Algorithm for Image
 * Denoising", CVPR 2005), albedo, normal and depth each by its own. */
#include "kernels/filter/filter.h"

#define REACH 3
/* Of the mean of all samples; features are of the order of 1. */
#define LEAST_VARIANCE 1e-8f
#define LEAST_WEIGHT 1e-4f
/* Lengths are compared as logarithms, their noise too. */
#define DEPTH (TRC_FEATURE_COUNT - 1)
#define MOST_DEPTH 1e15f

/* Features that are alike together: [begin, end). */
static const struct { int begin, end; } kinds[] = {{0, 3}, {3, 6}, {DEPTH, TRC_FEATURE_COUNT}};

struct work {
    float *mean[TRC_FEATURE_COUNT], *variance[TRC_FEATURE_COUNT];
    float *inside, *apart, *rest;
    float *sum[TRC_FEATURE_COUNT], *weight[3];
};

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    for (int k = 0; k < TRC_FEATURE_COUNT; k++) {
        w->mean[k] = trc_plane_carve(&c);
        w->variance[k] = trc_plane_carve(&c);
        w->sum[k] = trc_plane_carve(&c);
    }
    for (int k = 0; k < 3; k++)
        w->weight[k] = trc_plane_carve(&c);
    w->inside = trc_plane_carve(&c);
    w->apart = trc_plane_carve(&c);
    w->rest = trc_plane_carve(&c);
    return c.used;
}

size_t trc_features_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* The sums of a feature in the film. */
static double sum_of(const struct trc_film *film, int feature, size_t pixel) {
    if (feature == DEPTH)
        return film->sums[TRC_PASS_DENOISING_DEPTH][pixel];
    const uint32_t pass = feature < 3 ? TRC_PASS_DENOISING_ALBEDO : TRC_PASS_DENOISING_NORMAL;
    return film->sums[pass][3 * pixel + (size_t)(feature % 3)];
}

static float value_of(int feature, double mean) {
    if (feature != DEPTH)
        return fminf(fmaxf((float)mean, -MOST_DEPTH), MOST_DEPTH);
    /* A vector of one width is as good as another for one number. */
    float lanes[TRC_WIDTH];
    vf_store(lanes, vf_log1p(vf_set(fminf(fmaxf((float)mean, 0.0f), MOST_DEPTH))));
    return lanes[0];
}

static void load_pixel(const struct trc_film *film, size_t pixel, struct work *w, int at) {
    const uint32_t count = film->sample_counts[pixel];
    const struct trc_half *half = &film->halves[pixel];
    const bool both = half->count && half->count < count;
    const float part = both ? (float)half->count / (float)count : 0.0f;
    for (int k = 0; k < TRC_FEATURE_COUNT; k++) {
        const double sum = sum_of(film, k, pixel);
        w->mean[k][at] = value_of(k, sum / count);
        if (!both)
            continue;
        const double first = (double)half->features[k];
        const float change =
            value_of(k, first / half->count) - value_of(k, (sum - first) / (count - half->count));
        w->variance[k][at] = change * change * part * (1.0f - part);
    }
}

static void load(const struct trc_denoise_job *job, struct work *w) {
    const struct trc_film *film = job->denoise->film;
    const int halo = REACH + 2;
    for (int y = -halo; y < TRC_TILE_SIZE + halo; y++)
        for (int x = -halo; x < TRC_TILE_SIZE + halo; x++) {
            const int64_t frame_x = (int64_t)job->x + x, frame_y = (int64_t)job->y + y;
            const size_t pixel = (size_t)trc_mirror(frame_y, film->height) * film->width +
                                 trc_mirror(frame_x, film->width);
            if (!film->sample_counts[pixel])
                continue;
            load_pixel(film, pixel, w, trc_plane_at(x, y));
            const bool inside =
                frame_x >= 0 && frame_x < film->width && frame_y >= 0 && frame_y < film->height;
            w->inside[trc_plane_at(x, y)] = inside ? 1.0f : 0.0f;
        }
    for (int k = 0; k < TRC_FEATURE_COUNT; k++) {
        memcpy(w->rest, w->variance[k], TRC_PLANE_FLOATS * sizeof(float));
        trc_plane_smooth(w->rest, w->variance[k], REACH + 1);
    }
}

/* Adds the pixels at an offset, by how alike their patches are in the features of a kind. */
static void add_offset(struct work *w, int kind, int dx, int dy) {
    const int shift = dy * TRC_PLANE_STRIDE + dx, begin = kinds[kind].begin, end = kinds[kind].end;
    for (int y = -1; y < TRC_TILE_SIZE + 1; y++)
        for (int x = -1; x < TRC_PLANE_COLUMNS - 1; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y), q = p + shift;
            vfloat sum = vf_set(0.0f);
            for (int k = begin; k < end; k++) {
                const vfloat at_p = vf_load(w->variance[k] + p) + vf_set(LEAST_VARIANCE);
                const vfloat at_q = vf_load(w->variance[k] + q) + vf_set(LEAST_VARIANCE);
                const vfloat change = vf_load(w->mean[k] + p) - vf_load(w->mean[k] + q);
                sum = sum + (change * change - (at_p + vf_min(at_p, at_q))) / (at_p + at_q);
            }
            vf_store(w->apart + p, sum * vf_set(1.0f / (float)(end - begin)));
        }
    for (int y = 0; y < TRC_TILE_SIZE; y++)
        for (int x = 0; x < TRC_TILE_SIZE; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y);
            vfloat sum = vf_set(0.0f);
            for (int j = -1; j <= 1; j++)
                for (int i = -1; i <= 1; i++)
                    sum = sum + vf_load(w->apart + p + j * TRC_PLANE_STRIDE + i);
            vfloat weight = vf_exp(vf_min(sum * vf_set(-1.0f / 9.0f), vf_set(0.0f))) *
                            vf_load(w->inside + p + shift);
            weight = vf_select(vf_lt(weight, vf_set(LEAST_WEIGHT)), vf_set(0.0f), weight);
            vf_store(w->weight[kind] + p, vf_load(w->weight[kind] + p) + weight);
            for (int k = begin; k < end; k++)
                vf_store(w->sum[k] + p,
                         vf_load(w->sum[k] + p) + weight * vf_load(w->mean[k] + p + shift));
        }
}

void trc_features_filter(const struct trc_denoise_job *job) {
    struct work w;
    carve(&w, job->memory);
    load(job, &w);
    for (int kind = 0; kind < 3; kind++)
        for (int dy = -REACH; dy <= REACH; dy++)
            for (int dx = -REACH; dx <= REACH; dx++)
                add_offset(&w, kind, dx, dy);
    const struct trc_denoise *d = job->denoise;
    for (int kind = 0; kind < 3; kind++)
        for (int k = kinds[kind].begin; k < kinds[kind].end; k++)
            for (uint32_t y = 0; y < job->height; y++)
                for (uint32_t x = 0; x < job->width; x++) {
                    const int at = trc_plane_at((int)x, (int)y);
                    const float weight = w.weight[kind][at];
                    d->features[k][(size_t)(job->y + y) * d->film->width + job->x + x] =
                        weight > 0.0f ? w.sum[k][at] / weight : 0.0f;
                }
}
