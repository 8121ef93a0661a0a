/* Features of the film without the noise that motion, lenses and edges give them: means over pixels
 * whose neighbourhoods are alike (A. Buades, B. Coll, J.-M. Morel, "A Non-local Algorithm for Image
 * Denoising", CVPR 2005), albedo, normal and depth each by its own. */
#include <stdlib.h>

#include "kernels/filter/filter.h"

/* Pixels on each side of a window, of which those around the middle are taken, and of the others
 * every second one, as fields of a chessboard. */
#define REACH 3
/* Rows and columns around the tile: of the window, a patch and a smoothed variance. */
#define HALO (REACH + 2)
/* Squared differences that count where there is no noise; features are of the order of 1. */
#define LEAST_CHANGE 2e-8f
/* Lengths are compared as logarithms, their noise too. */
#define DEPTH (TRC_FEATURE_COUNT - 1)
#define MOST_DEPTH 1e15f

/* Features that are alike together: [begin, end). */
#define KINDS 3
static const struct { int begin, end; } kinds[KINDS] = {{0, 3}, {3, 6}, {DEPTH, TRC_FEATURE_COUNT}};

struct work {
    float *mean[TRC_FEATURE_COUNT], *variance[KINDS];
    float *inside, *apart, *rest;
    float *half[2]; /* depth in either half of the samples */
    float *sum[TRC_FEATURE_COUNT], *weight[KINDS];
};

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    for (int k = 0; k < TRC_FEATURE_COUNT; k++) {
        w->mean[k] = trc_plane_carve(&c);
        w->sum[k] = trc_plane_carve(&c);
    }
    for (int k = 0; k < KINDS; k++) {
        w->variance[k] = trc_plane_carve(&c);
        w->weight[k] = trc_plane_carve(&c);
    }
    float **const single[] = {&w->inside, &w->apart, &w->rest, &w->half[0], &w->half[1]};
    for (size_t i = 0; i < sizeof single / sizeof *single; i++)
        *single[i] = trc_plane_carve(&c);
    return c.used;
}

size_t trc_features_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* ---- film to planes ---- */

static float cut(double mean) { return trc_cut(mean, -MOST_DEPTH, MOST_DEPTH); }

/* A pixel of the film, and how it goes into a plane. */
struct pixel {
    size_t index;
    int at;
    double to_mean, to_half[2]; /* over the samples of all, of the first half and of the others */
    float part;                 /* variance of the mean over squared difference of halves */
};

/* Three numbers of a pass; the variances of the three are one. */
static void load_vector(const struct trc_film *film, const struct pixel *p, uint32_t pass, int kind,
                        struct work *w) {
    const int begin = kinds[kind].begin;
    const double *sums = film->sums[pass] + 3 * p->index;
    const float *first = film->halves[p->index].features + begin;
    float change2 = 0.0f;
    for (int k = 0; k < 3; k++) {
        w->mean[begin + k][p->at] = cut(sums[k] * p->to_mean);
        const float change =
            cut(first[k] * p->to_half[0]) - cut((sums[k] - first[k]) * p->to_half[1]);
        change2 += change * change;
    }
    w->variance[kind][p->at] = change2 * p->part;
}

static void load_depth(const struct trc_film *film, const struct pixel *p, struct work *w) {
    const double sum = film->sums[TRC_PASS_DENOISING_DEPTH][p->index];
    const double first = film->halves[p->index].features[DEPTH];
    w->mean[DEPTH][p->at] = trc_cut(sum * p->to_mean, 0.0f, MOST_DEPTH);
    w->half[0][p->at] = trc_cut(first * p->to_half[0], 0.0f, MOST_DEPTH);
    w->half[1][p->at] = trc_cut((sum - first) * p->to_half[1], 0.0f, MOST_DEPTH);
    w->variance[2][p->at] = p->part;
}

static void load_pixel(const struct trc_film *film, size_t index, int at, struct work *w) {
    const double count = film->sample_counts[index], first = film->halves[index].count;
    struct pixel p = {.index = index, .at = at, .to_mean = 1.0 / count};
    if (first > 0.0 && first < count) {
        p.to_half[0] = 1.0 / first;
        p.to_half[1] = 1.0 / (count - first);
        p.part = (float)(first * (count - first) * p.to_mean * p.to_mean);
    }
    load_vector(film, &p, TRC_PASS_DENOISING_ALBEDO, 0, w);
    load_vector(film, &p, TRC_PASS_DENOISING_NORMAL, 1, w);
    load_depth(film, &p, w);
}

static void take_logarithms(struct work *w) {
    for (int y = -HALO; y < TRC_TILE_SIZE + HALO; y++)
        for (int x = -TRC_HALO; x < TRC_PLANE_COLUMNS - TRC_HALO; x += TRC_WIDTH) {
            const int at = trc_plane_at(x, y);
            const vfloat change =
                vf_log1p(vf_load(w->half[0] + at)) - vf_log1p(vf_load(w->half[1] + at));
            vf_store(w->mean[DEPTH] + at, vf_log1p(vf_load(w->mean[DEPTH] + at)));
            vf_store(w->variance[2] + at, vf_load(w->variance[2] + at) * change * change);
        }
}

static void load(const struct trc_denoise_job *job, struct work *w) {
    const struct trc_film *film = job->denoise->film;
    for (int y = -HALO; y < TRC_TILE_SIZE + HALO; y++)
        for (int x = -HALO; x < TRC_TILE_SIZE + HALO; x++) {
            const int64_t frame_x = (int64_t)job->x + x, frame_y = (int64_t)job->y + y;
            const size_t pixel = (size_t)trc_mirror(frame_y, film->height) * film->width +
                                 trc_mirror(frame_x, film->width);
            if (!film->sample_counts[pixel])
                continue;
            load_pixel(film, pixel, trc_plane_at(x, y), w);
            const bool inside =
                frame_x >= 0 && frame_x < film->width && frame_y >= 0 && frame_y < film->height;
            w->inside[trc_plane_at(x, y)] = inside ? 1.0f : 0.0f;
        }
    take_logarithms(w);
    for (int kind = 0; kind < KINDS; kind++) {
        memcpy(w->rest, w->variance[kind], TRC_PLANE_FLOATS * sizeof(float));
        trc_plane_smooth(w->rest, w->variance[kind], HALO - 1);
    }
}

/* ---- means ---- */

/* How far pixels at p and q are apart in the features of a kind. */
static vfloat difference(const struct work *w, int kind, int p, int q) {
    vfloat change2 = vf_set(0.0f);
    for (int k = kinds[kind].begin; k < kinds[kind].end; k++) {
        const vfloat change = vf_load(w->mean[k] + p) - vf_load(w->mean[k] + q);
        change2 = change2 + change * change;
    }
    return trc_excess(change2, vf_load(w->variance[kind] + p), vf_load(w->variance[kind] + q),
                      LEAST_CHANGE);
}

/* Adds the pixels at an offset, by how alike their patches are in the features of a kind. */
static void add_offset(struct work *w, int kind, int dx, int dy) {
    const int shift = dy * TRC_PLANE_STRIDE + dx;
    for (int y = -1; y < TRC_TILE_SIZE + 1; y++)
        for (int x = -1; x < TRC_PLANE_COLUMNS - 1; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y);
            vf_store(w->apart + p, difference(w, kind, p, p + shift));
        }
    for (int y = 0; y < TRC_TILE_SIZE; y++)
        trc_patch_columns(w->apart + trc_plane_at(-1, y - 1), TRC_PLANE_STRIDE);
    for (int y = 0; y < TRC_TILE_SIZE; y++)
        for (int x = 0; x < TRC_TILE_SIZE; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y);
            const vfloat weight = trc_bell(trc_patch_mean(w->apart + p - TRC_PLANE_STRIDE - 1)) *
                                  vf_load(w->inside + p + shift);
            vf_store(w->weight[kind] + p, vf_load(w->weight[kind] + p) + weight);
            for (int k = kinds[kind].begin; k < kinds[kind].end; k++)
                vf_store(w->sum[k] + p,
                         vf_load(w->sum[k] + p) + weight * vf_load(w->mean[k] + p + shift));
        }
}

/* Kinds that the render asks for; the others stay 0. */
static int kinds_of(const struct trc_denoise_job *job) {
    static const int counts[] = {
        [TRC_GUIDES_ALBEDO_NORMAL] = KINDS, [TRC_GUIDES_ALBEDO] = 1, [TRC_GUIDES_NONE] = 0};
    return counts[job->denoise->film->guides];
}

void trc_features_filter(const struct trc_denoise_job *job) {
    struct work w;
    carve(&w, job->memory);
    load(job, &w);
    for (int kind = 0; kind < kinds_of(job); kind++)
        for (int dy = -REACH; dy <= REACH; dy++)
            for (int dx = -REACH; dx <= REACH; dx++)
                if ((abs(dx) <= 1 && abs(dy) <= 1) || !((dx + dy) & 1))
                    add_offset(&w, kind, dx, dy);
    const struct trc_denoise *d = job->denoise;
    for (int kind = 0; kind < KINDS; kind++)
        for (int k = kinds[kind].begin; k < kinds[kind].end; k++)
            for (uint32_t y = 0; y < job->height; y++)
                for (uint32_t x = 0; x < job->width; x++) {
                    const int at = trc_plane_at((int)x, (int)y);
                    const float weight = w.weight[kind][at];
                    d->features[k][(size_t)(job->y + y) * d->film->width + job->x + x] =
                        weight > 0.0f ? w.sum[k][at] / weight : 0.0f;
                }
}
