/* What regression compares: a tile's halves of samples, their noise, and features. */
#include "kernels/filter/filter.h"

/* Light above is as good as this, so that squares stay finite. */
#define MOST_LIGHT 1e15f
/* Variance of light that is none. */
#define LEAST_NOISE 1e-8f
/* Part of the noise around a pixel that it has itself although its halves agree, which they may do
 * by chance: 0.02 takes a tenth off what is gained at 4 samples, 0.3 smears thin highlights. */
#define LEAST_OWN_NOISE 0.05f

/* The sums of a pixel with the light of shadow catchers, whose noise is the shadow's. */
static void sum_of(const struct trc_film *film, size_t pixel, double sum[TRC_GUIDE_CHANNELS]) {
    memcpy(sum, film->sums[TRC_PASS_COMBINED] + 4 * pixel, TRC_GUIDE_CHANNELS * sizeof *sum);
    for (int c = 0; film->caught && c < 3; c++)
        sum[c] += film->caught[pixel].blocked[c];
}

/* Means of a pixel's halves, as light is; both are the mean of all samples if there is but one. */
static void load_pixel(const struct trc_film *film, size_t pixel, struct trc_guide *g, int at) {
    const double count = film->sample_counts[pixel];
    const struct trc_half *first = &film->halves[pixel];
    const bool both = first->count && first->count < film->sample_counts[pixel];
    const double parts[2] = {both ? first->count : count, both ? count - first->count : count};
    const double scales[2] = {1.0 / parts[0], 1.0 / parts[1]};
    double sum[TRC_GUIDE_CHANNELS];
    sum_of(film, pixel, sum);
    for (int c = 0; c < TRC_GUIDE_CHANNELS; c++) {
        const double of_first = both ? (double)first->light[c] : sum[c];
        const double of_second = both ? sum[c] - of_first : sum[c];
        g->half[0][c][at] = trc_cut(of_first * scales[0], 0.0f, MOST_LIGHT);
        g->half[1][c][at] = trc_cut(of_second * scales[1], 0.0f, MOST_LIGHT);
    }
    for (int k = 0; k < 2; k++)
        g->more[k][at] = (float)(count * scales[k]);
}

/* From halves to their light, their noise, and what is compared. The difference of two means has
 * the variance of the mean of all, over both parts. */
static void convert(struct trc_guide *g, int at) {
    const vfloat third = vf_set(1.0f / 3.0f), more = vf_load(g->more[0] + at);
    const vmask both = vf_gt(more, vf_set(1.0f));
    const vfloat scale = vf_select(
        both, vf_set(1.0f) / vf_max(more * vf_load(g->more[1] + at), vf_set(1.0f)), vf_set(0.0f));
    vfloat light[2] = {vf_set(0.0f), vf_set(0.0f)}, light2 = vf_set(0.0f);
    for (int c = 0; c < 3; c++) {
        vfloat half[2], root[2];
        for (int k = 0; k < 2; k++) {
            half[k] = vf_load(g->half[k][c] + at);
            root[k] = vf_sqrt(half[k]);
            light[k] = light[k] + half[k];
            vf_store(g->half[k][c] + at, root[k]);
        }
        light2 = light2 + (half[0] - half[1]) * (half[0] - half[1]);
        vf_store(g->variance[c] + at, (root[0] - root[1]) * (root[0] - root[1]) * scale);
    }
    const vfloat alpha = vf_load(g->half[0][3] + at) - vf_load(g->half[1][3] + at);
    vf_store(g->variance[3] + at, alpha * alpha * scale);
    for (int k = 0; k < 2; k++)
        vf_store(g->light[k] + at, light[k] * third);
    vf_store(g->noise + at, light2 * scale * third);
}

/* The squared difference of a pixel and the mean of those around it. */
static float change2_at(const float *plane, int at) {
    float sum = 0.0f;
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++)
            sum += plane[at + j * TRC_PLANE_STRIDE + i];
    const float change = plane[at] - sum * (1.0f / 9.0f);
    return change * change;
}

/* Pixels with one sample tell nothing of noise: what their neighbours' mean differs by stands for
 * it. */
static void guess_variance(struct trc_guide *g, int at) {
    for (int c = 0; c < TRC_GUIDE_CHANNELS; c++)
        g->variance[c][at] = change2_at(g->half[0][c], at);
    g->noise[at] = change2_at(g->light[0], at);
}

/* Whether alpha differs, which most pictures have none of. */
static bool alpha_varies(const struct trc_guide *g) {
    const float alpha = g->half[0][3][trc_plane_at(0, 0)];
    for (int y = -TRC_HALO; y < TRC_TILE_SIZE + TRC_HALO; y++)
        for (int x = -TRC_HALO; x < TRC_TILE_SIZE + TRC_HALO; x++)
            for (int k = 0; k < 2; k++)
                if (g->half[k][3][trc_plane_at(x, y)] != alpha)
                    return true;
    return false;
}

static void smooth(struct trc_guide *g, float *plane, float least) {
    memcpy(g->rest, plane, TRC_PLANE_FLOATS * sizeof *plane);
    trc_plane_smooth(g->rest, plane, TRC_HALO - 1);
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH)
        vf_store(plane + i, vf_max(vf_load(plane + i), vf_set(least)));
}

void trc_guide_load(const struct trc_denoise_job *job, struct trc_guide *g) {
    const struct trc_film *film = job->denoise->film;
    for (int y = -TRC_HALO; y < TRC_TILE_SIZE + TRC_HALO; y++)
        for (int x = -TRC_HALO; x < TRC_TILE_SIZE + TRC_HALO; x++) {
            const int64_t frame_x = (int64_t)job->x + x, frame_y = (int64_t)job->y + y;
            const size_t pixel = (size_t)trc_mirror(frame_y, film->height) * film->width +
                                 trc_mirror(frame_x, film->width);
            const int at = trc_plane_at(x, y);
            if (!film->sample_counts[pixel])
                continue;
            load_pixel(film, pixel, g, at);
            const bool inside =
                frame_x >= 0 && frame_x < film->width && frame_y >= 0 && frame_y < film->height;
            g->inside[at] = inside ? 1.0f : 0.0f;
            for (int k = 0; k < TRC_FEATURE_COUNT; k++)
                g->features[k][at] = job->denoise->features[k][pixel];
        }
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH)
        convert(g, i);
    for (int y = 1 - TRC_HALO; y < TRC_TILE_SIZE + TRC_HALO - 1; y++)
        for (int x = 1 - TRC_HALO; x < TRC_TILE_SIZE + TRC_HALO - 1; x++)
            if (g->more[0][trc_plane_at(x, y)] == 1.0f)
                guess_variance(g, trc_plane_at(x, y));
    for (int c = 0; c < TRC_GUIDE_CHANNELS; c++)
        smooth(g, g->variance[c], 0.0f);
    g->has_alpha = alpha_varies(g);
    smooth(g, g->noise, LEAST_NOISE);
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        const vfloat noise = vf_load(g->noise + i), own = vf_load(g->rest + i); /* unsmoothed */
        vf_store(g->own_noise + i, vf_min(noise, own + vf_set(LEAST_OWN_NOISE) * noise));
    }
}
