/* What regression compares: a tile's halves of samples, their noise, and features. */
#include "kernels/filter/filter.h"

/* Light above is as good as this, so that squares stay finite. */
#define MOST_LIGHT 1e15f
/* Variance of light that is none. */
#define LEAST_NOISE 1e-8f
/* Part of the noise around a pixel that it has itself although its halves agree, which they may do
 * by chance: 0.02 takes a tenth off what is gained at 4 samples, 0.3 smears thin highlights. */
#define LEAST_OWN_NOISE 0.1f

/* A pixel's red, green, blue and alpha in the mean of some of its samples. */
struct color {
    float c[4];
};

static struct color mean_of(const double sum[4], double count) {
    struct color mean;
    for (int c = 0; c < 4; c++)
        mean.c[c] = fminf(fmaxf((float)(sum[c] / count), 0.0f), MOST_LIGHT);
    return mean;
}

static float light_of(struct color color) {
    return (color.c[0] + color.c[1] + color.c[2]) * (1.0f / 3.0f);
}

/* The color with the light of shadow catchers, whose noise is the shadow's. */
static void sum_of(const struct trc_film *film, size_t pixel, double sum[4]) {
    memcpy(sum, film->sums[TRC_PASS_COMBINED] + 4 * pixel, 4 * sizeof *sum);
    for (int c = 0; film->caught && c < 3; c++)
        sum[c] += film->caught[pixel].blocked[c];
}

/* Both halves of a pixel; false if there is but one. parts: of the samples that are in each. */
static bool halves_of(const struct trc_film *film, size_t pixel, struct color half[2],
                      float parts[2]) {
    double sum[4], first[4];
    const double count = film->sample_counts[pixel];
    const struct trc_half *h = &film->halves[pixel];
    sum_of(film, pixel, sum);
    if (!h->count || h->count >= film->sample_counts[pixel]) {
        half[0] = half[1] = mean_of(sum, count);
        parts[0] = parts[1] = 1.0f;
        return false;
    }
    for (int c = 0; c < 4; c++) {
        first[c] = (double)h->light[c];
        sum[c] -= first[c];
    }
    half[0] = mean_of(first, h->count);
    half[1] = mean_of(sum, count - h->count);
    parts[0] = (float)(h->count / count);
    parts[1] = 1.0f - parts[0];
    return true;
}

static void load_pixel(const struct trc_film *film, size_t pixel, struct trc_guide *g, int at) {
    struct color half[2];
    float parts[2];
    const bool both = halves_of(film, pixel, half, parts);
    /* The difference of two means has the variance of the mean of all, over both parts. */
    const float scale = both ? parts[0] * parts[1] : 0.0f;
    for (int c = 0; c < TRC_GUIDE_CHANNELS; c++) {
        for (int k = 0; k < 2; k++)
            g->half[k][c][at] = c < 3 ? sqrtf(half[k].c[c]) : half[k].c[c];
        const float change = g->half[0][c][at] - g->half[1][c][at];
        g->variance[c][at] = change * change * scale;
    }
    for (int k = 0; k < 2; k++) {
        g->more[k][at] = 1.0f / parts[k];
        g->light[k][at] = light_of(half[k]);
    }
    float change2 = 0.0f;
    for (int c = 0; c < 3; c++)
        change2 += (half[0].c[c] - half[1].c[c]) * (half[0].c[c] - half[1].c[c]);
    g->noise[at] = change2 * scale * (1.0f / 3.0f);
}

/* Pixels with one sample tell nothing of noise: what their neighbours' mean differs by stands for
 * it. */
static void guess_variance(struct trc_guide *g, int at) {
    for (int c = 0; c < TRC_GUIDE_CHANNELS + 1; c++) {
        const float *of = c < TRC_GUIDE_CHANNELS ? g->half[0][c] : g->light[0];
        float sum = 0.0f;
        for (int j = -1; j <= 1; j++)
            for (int i = -1; i <= 1; i++)
                sum += of[at + j * TRC_PLANE_STRIDE + i];
        const float change = of[at] - sum * (1.0f / 9.0f);
        *(c < TRC_GUIDE_CHANNELS ? &g->variance[c][at] : &g->noise[at]) = change * change;
    }
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
    for (int y = 1 - TRC_HALO; y < TRC_TILE_SIZE + TRC_HALO - 1; y++)
        for (int x = 1 - TRC_HALO; x < TRC_TILE_SIZE + TRC_HALO - 1; x++)
            if (g->more[0][trc_plane_at(x, y)] == 1.0f)
                guess_variance(g, trc_plane_at(x, y));
    for (int c = 0; c < TRC_GUIDE_CHANNELS; c++)
        smooth(g, g->variance[c], 0.0f);
    smooth(g, g->noise, LEAST_NOISE);
    for (int i = 0; i < TRC_PLANE_FLOATS; i += TRC_WIDTH) {
        const vfloat noise = vf_load(g->noise + i), own = vf_load(g->rest + i); /* unsmoothed */
        vf_store(g->own_noise + i, vf_min(noise, own + vf_set(LEAST_OWN_NOISE) * noise));
    }
}
