/* The regression of model/denoise.h: from planes to the weights with which each pixel takes from
 * those around it, and with these from the film to the clean film.
 *
 * A tile goes in strips, so that the weights of a strip stay in a second-level cache. Sums are
 * written out without fused multiplication: all instruction sets give the same bits. */
#include <stdlib.h>

#include "kernels/filter/filter.h"

/* Pixels on each side from which a pixel takes: all that are near, farther off every second one, as
 * fields of a chessboard, within a circle. A window of 5 or 6 gives lower errors on flat surfaces,
 * but softens shadows, and FLIP is worse than without at 16 samples. */
#define REACH 4
#define NEAR 2
#define SIDE (2 * REACH + 1)
/* Rows of a strip, of whose patches one row more on each side is compared. */
#define STRIP 16
#define PATCH_ROWS (STRIP + 2)
/* How many standard deviations are still alike: 0.5 left noise, 0.85 to 1.4 flattened textures
 * and spread highlights. */
#define BANDWIDTH 0.7f
/* Squared differences of roots of light, and of alpha, that count where there is no noise. */
#define LEAST_CHANGE 2e-8f
/* A constant, features, place. */
#define TERMS (1 + TRC_FEATURE_COUNT + 2)
#define PRODUCTS (TERMS * (TERMS + 1) / 2)
/* What keeps slopes small where features hardly differ: a part of the sum of weights. */
#define RIDGE 0.02f
/* Differences of features that count as one: albedo, normal, logarithm of depth, of the window. */
static const float feature_scale[TRC_FEATURE_COUNT] = {4.5f, 4.5f, 4.5f, 3.0f, 3.0f, 3.0f, 3.0f};
#define PLACE_SCALE (1.0f / REACH)
/* Light that counts as dark, and errors as large as can be: one bright pixel shall not decide for
 * all around it. */
#define DARK 0.01f
#define MOST_ERROR 1e3f
#define MOST_MISSED 32.0f /* about its root */
#define MOST_LIGHT 1e30f
/* Of what one half's weights take, which with those of the other half sum to 1. */
#define LEAST_TOTAL 0.05f

/* Of a pixel from which is taken, from the one that takes. */
struct offset {
    int x, y, shift; /* shift: in a plane */
};

struct work {
    struct trc_guide guide;
    int offset_count; /* of those below */
    struct offset offsets[SIDE * SIDE];
    /* By the half that was compared, offset, row, column; then the first holds what is taken. */
    float (*weights[2])[STRIP][TRC_TILE_SIZE];
    float (*apart)[TRC_PLANE_STRIDE]; /* PATCH_ROWS: how far pixels are apart */
    float *data;                      /* a plane of light */
};

static void list_offsets(struct work *w) {
    w->offset_count = 0;
    for (int y = -REACH; y <= REACH; y++)
        for (int x = -REACH; x <= REACH; x++) {
            const bool is_taken = (abs(x) <= NEAR && abs(y) <= NEAR) || !((x + y) & 1);
            if (is_taken && x * x + y * y <= REACH * REACH)
                w->offsets[w->offset_count++] = (struct offset){x, y, y * TRC_PLANE_STRIDE + x};
        }
}

static size_t carve(struct work *w, void *memory) {
    struct trc_carver c = {.base = memory};
    struct trc_guide *g = &w->guide;
    float **const single[] = {&g->noise, &g->own_noise, &g->rest, &g->inside, &w->data};
    list_offsets(w);
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < TRC_GUIDE_CHANNELS; i++)
            g->half[k][i] = trc_plane_carve(&c);
        g->more[k] = trc_plane_carve(&c);
        g->light[k] = trc_plane_carve(&c);
        w->weights[k] = trc_carve(&c, (size_t)w->offset_count * sizeof *w->weights[k]);
    }
    for (int i = 0; i < TRC_GUIDE_CHANNELS; i++)
        g->variance[i] = trc_plane_carve(&c);
    for (int i = 0; i < TRC_FEATURE_COUNT; i++)
        g->features[i] = trc_plane_carve(&c);
    for (size_t i = 0; i < sizeof single / sizeof *single; i++)
        *single[i] = trc_plane_carve(&c);
    w->apart = trc_carve(&c, PATCH_ROWS * sizeof *w->apart);
    return c.used;
}

size_t trc_regress_bytes(void) {
    struct work w;
    return carve(&w, NULL);
}

/* ---- weights ---- */

/* How far pixels at p and q are apart in one half. */
static vfloat difference(const struct trc_guide *g, int half, int p, int q) {
    const vfloat more_p = vf_load(g->more[half] + p), more_q = vf_load(g->more[half] + q);
    vfloat sum = vf_set(0.0f);
    for (int c = 0; c < (g->has_alpha ? 4 : 3); c++) {
        const vfloat change = vf_load(g->half[half][c] + p) - vf_load(g->half[half][c] + q);
        const vfloat apart = trc_excess(change * change, more_p * vf_load(g->variance[c] + p),
                                        more_q * vf_load(g->variance[c] + q), LEAST_CHANGE);
        sum = sum + (c < 3 ? apart * vf_set(1.0f / 3.0f) : apart);
    }
    return sum * vf_set(1.0f / (BANDWIDTH * BANDWIDTH));
}

/* Weights of the pixels at an offset for those of the strip that begins at row y. */
static void weigh(struct work *w, int half, int y, int offset) {
    const struct trc_guide *g = &w->guide;
    const int shift = w->offsets[offset].shift;
    for (int j = 0; j < PATCH_ROWS; j++)
        for (int x = -1; x < TRC_PLANE_COLUMNS - 1; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y + j - 1);
            vf_store(w->apart[j] + x + 1, difference(g, half, p, p + shift));
        }
    for (int j = 0; j < STRIP; j++)
        trc_patch_columns(w->apart[j], TRC_PLANE_STRIDE);
    float(*const weights)[TRC_TILE_SIZE] = w->weights[half][offset];
    for (int j = 0; j < STRIP; j++)
        for (int x = 0; x < TRC_TILE_SIZE; x += TRC_WIDTH) {
            const int p = trc_plane_at(x, y + j), q = p + shift;
            const vfloat calm =
                vf_min(vf_load(g->own_noise + p) / vf_load(g->noise + q), vf_set(1.0f));
            vf_store(weights[j] + x,
                     trc_bell(trc_patch_mean(w->apart[j] + x)) * calm * vf_load(g->inside + q));
        }
}

/* ---- regression ---- */

/* A vector of pixels of a strip. */
struct group {
    const struct work *work;
    int row, x, at; /* in the strip; in a plane */
};

static vfloat weight_of(const struct group *u, int half, int offset) {
    return vf_load(u->work->weights[half][offset][u->row] + u->x);
}

/* What the pixels at an offset differ by in all terms. */
static void terms_of(const struct group *u, const struct offset *o, vfloat terms[TERMS]) {
    const struct trc_guide *g = &u->work->guide;
    terms[0] = vf_set(1.0f);
    for (int k = 0; k < TRC_FEATURE_COUNT; k++)
        terms[1 + k] =
            (vf_load(g->features[k] + u->at + o->shift) - vf_load(g->features[k] + u->at)) *
            vf_set(feature_scale[k]);
    terms[TERMS - 2] = vf_set((float)o->x * PLACE_SCALE);
    terms[TERMS - 1] = vf_set((float)o->y * PLACE_SCALE);
}

/* Sums of weighted products of terms, the lower triangle row by row; the weights of both halves go
 * into one sum, as slopes of each would cost twice as much and measured no better. */
static void sum_products(const struct group *u, vfloat products[PRODUCTS]) {
    const struct work *w = u->work;
    for (int k = 0; k < PRODUCTS; k++)
        products[k] = vf_set(0.0f);
    for (int offset = 0; offset < w->offset_count; offset++) {
        const vfloat weight = weight_of(u, 0, offset) + weight_of(u, 1, offset);
        if (!vm_any(vf_gt(weight, vf_set(0.0f))))
            continue;
        vfloat terms[TERMS];
        terms_of(u, &w->offsets[offset], terms);
        products[0] = products[0] + weight;
        vfloat *sum = products + 1;
        for (int i = 1; i < TERMS; i++) {
            const vfloat weighted = weight * terms[i];
            *sum = *sum + weighted;
            sum++;
            for (int j = 1; j <= i; j++, sum++)
                *sum = *sum + weighted * terms[j];
        }
    }
}

/* First column of the inverse of the matrix, damped: by L D L^T, in place. */
static void solve(vfloat a[PRODUCTS], vfloat out[TERMS]) {
#define AT(i, j) a[(i) * ((i) + 1) / 2 + (j)]
    const vfloat ridge = AT(0, 0) * vf_set(RIDGE);
    for (int j = 0; j < TERMS; j++) {
        vfloat scaled[TERMS] = {vf_set(0.0f)}, pivot = j ? AT(j, j) + ridge : AT(j, j);
        for (int k = 0; k < j; k++) {
            scaled[k] = AT(j, k) * AT(k, k);
            pivot = pivot - AT(j, k) * scaled[k];
        }
        AT(j, j) = vf_max(pivot, vf_set(1e-12f));
        const vfloat inverse = vf_set(1.0f) / AT(j, j);
        for (int i = j + 1; i < TERMS; i++) {
            vfloat sum = AT(i, j);
            for (int k = 0; k < j; k++)
                sum = sum - AT(i, k) * scaled[k];
            AT(i, j) = sum * inverse;
        }
    }
    for (int i = 0; i < TERMS; i++) {
        out[i] = vf_set(i ? 0.0f : 1.0f);
        for (int k = 0; k < i; k++)
            out[i] = out[i] - AT(i, k) * out[k];
    }
    for (int i = TERMS - 1; i >= 0; i--) {
        out[i] = out[i] / AT(i, i);
        for (int k = i + 1; k < TERMS; k++)
            out[i] = out[i] - AT(k, i) * out[k];
    }
#undef AT
}

/* ---- error ---- */

/* The light around a pixel: what errors are relative to. */
static vfloat light_around(const struct trc_guide *g, int at) {
    vfloat sum = vf_set(0.0f);
    for (int j = -2; j <= 2; j++)
        for (int i = -2; i <= 2; i++) {
            const int q = at + j * TRC_PLANE_STRIDE + i;
            sum = sum + vf_load(g->light[0] + q) + vf_load(g->light[1] + q);
        }
    return sum * vf_set(0.5f / 25.0f) + vf_set(DARK);
}

#define STORED 5 /* planes of estimates */

/* Where one half's weights make of the other half's light what is in the first half, there is no
 * error but the noise of that. */
static void store_error(const struct trc_denoise_job *job, const struct group *u, int y,
                        const vfloat clean[2]) {
    const struct trc_guide *g = &u->work->guide;
    const vfloat light[2] = {vf_load(g->light[0] + u->at), vf_load(g->light[1] + u->at)};
    const vfloat more[2] = {vf_load(g->more[0] + u->at), vf_load(g->more[1] + u->at)};
    const vfloat change = light[0] - light[1];
    const vmask alone = vf_le(more[0], vf_set(1.0f)); /* no halves: noise is a guess */
    const vfloat noise = vf_load(g->noise + u->at);
    const vfloat change2 = change * change * vf_set(1.0f / (1.0f - TRC_HALVES_CORRELATION));
    const vfloat half_noise = vf_select(alone, noise, vf_set(0.5f) * change2);
    const vfloat variance = vf_select(
        alone, noise, change2 * vf_set(1.0f + TRC_HALVES_CORRELATION) / (more[0] * more[1]));
    const vfloat missed[2] = {clean[0] - light[0], clean[1] - light[1]};
    const vfloat error =
        vf_set(0.5f) * (missed[0] * missed[0] + missed[1] * missed[1]) - half_noise;
    const vfloat root = vf_set(1.0f) / light_around(g, u->at), unit = root * root;
    float lanes[STORED][TRC_WIDTH];
    vf_store(lanes[0], vf_min(variance * unit, vf_set(MOST_ERROR)));
    vf_store(lanes[1], vf_clamp(error * unit, -MOST_ERROR, MOST_ERROR));
    const vfloat of_halves[3] = {missed[0], missed[1], change};
    for (int k = 0; k < 3; k++)
        vf_store(lanes[2 + k], vf_select(alone, vf_set(0.0f),
                                         vf_clamp(of_halves[k] * root, -MOST_MISSED, MOST_MISSED)));
    const struct trc_denoise *d = job->denoise;
    float *const stored[STORED] = {d->variance, d->error, d->missed[0], d->missed[1], d->change};
    for (int i = 0; i < TRC_WIDTH && (uint32_t)(u->x + i) < job->width; i++) {
        const size_t pixel =
            (size_t)(job->y + (uint32_t)y) * d->film->width + job->x + (uint32_t)(u->x + i);
        for (int k = 0; k < STORED; k++)
            stored[k][pixel] = lanes[k][i];
    }
}

/* Regression for a vector of pixels of the tile's row y: weights become what is taken. */
static void regress(const struct trc_denoise_job *job, struct work *w, const struct group *u,
                    int y) {
    vfloat products[PRODUCTS], slopes[TERMS];
    sum_products(u, products);
    solve(products, slopes);
    vfloat clean[2] = {vf_set(0.0f), vf_set(0.0f)}, total[2] = {vf_set(0.0f), vf_set(0.0f)};
    for (int offset = 0; offset < w->offset_count; offset++) {
        const struct offset *o = &w->offsets[offset];
        vfloat terms[TERMS], taken[2];
        terms_of(u, o, terms);
        vfloat sum = slopes[0];
        for (int i = 1; i < TERMS; i++)
            sum = sum + slopes[i] * terms[i];
        for (int half = 0; half < 2; half++) {
            taken[half] = sum * weight_of(u, half, offset);
            const float *light = w->guide.light[1 - half];
            total[half] = total[half] + taken[half];
            clean[half] = clean[half] + taken[half] * vf_load(light + u->at + o->shift);
        }
        vf_store(w->weights[0][offset][u->row] + u->x, taken[0] + taken[1]);
    }
    for (int half = 0; half < 2; half++)
        clean[half] = clean[half] / vf_max(total[half], vf_set(LEAST_TOTAL));
    store_error(job, u, y, clean);
}

/* ---- light ---- */

/* Means of a strip's pixels and those around, into the plane. */
static void load_strip(const struct trc_denoise_job *job, const struct trc_light_channel *c, int y,
                       float *data) {
    const struct trc_film *film = job->denoise->film;
    for (int j = y - REACH; j < y + STRIP + REACH; j++)
        for (int i = -REACH; i < TRC_TILE_SIZE + REACH; i++) {
            const int64_t frame_x = (int64_t)job->x + i, frame_y = (int64_t)job->y + j;
            double mean = 0.0;
            if (frame_x >= 0 && frame_x < film->width && frame_y >= 0 && frame_y < film->height) {
                const size_t pixel = (size_t)frame_y * film->width + (size_t)frame_x;
                const uint32_t count = film->sample_counts[pixel];
                if (count)
                    mean = c->sums[pixel * c->stride] / count;
            }
            data[trc_plane_at(i, j)] = trc_cut(mean, -MOST_LIGHT, MOST_LIGHT);
        }
}

static void take_channel(const struct trc_denoise_job *job, const struct work *w,
                         const struct trc_light_channel *c, int y) {
    const struct trc_film *film = job->denoise->film;
    load_strip(job, c, y, w->data);
    for (int j = 0; j < STRIP && (uint32_t)(y + j) < job->height; j++)
        for (int x = 0; (uint32_t)x < job->width; x += TRC_WIDTH) {
            vfloat sum = vf_set(0.0f);
            const float *data = w->data + trc_plane_at(x, y + j);
            for (int offset = 0; offset < w->offset_count; offset++)
                sum = sum + vf_load(w->weights[0][offset][j] + x) *
                                vf_load(data + w->offsets[offset].shift);
            float lanes[TRC_WIDTH];
            vf_store(lanes, sum);
            for (int i = 0; i < TRC_WIDTH && (uint32_t)(x + i) < job->width; i++) {
                const size_t pixel =
                    (size_t)(job->y + (uint32_t)(y + j)) * film->width + job->x + (uint32_t)(x + i);
                c->clean[pixel * c->stride] = (double)lanes[i] * film->sample_counts[pixel];
            }
        }
}

static void take_light(const struct trc_denoise_job *job, const struct work *w, int y) {
    for (uint32_t k = 0; k < job->denoise->channel_count; k++) {
        const struct trc_light_channel c = trc_light_channel_at(job->denoise->film, k);
        take_channel(job, w, &c, y);
    }
}

void trc_regress(const struct trc_denoise_job *job) {
    struct work w;
    carve(&w, job->memory);
    trc_guide_load(job, &w.guide);
    for (int y = 0; (uint32_t)y < job->height; y += STRIP) {
        for (int half = 0; half < 2; half++)
            for (int offset = 0; offset < w.offset_count; offset++)
                weigh(&w, half, y, offset);
        for (int row = 0; row < STRIP && (uint32_t)(y + row) < job->height; row++)
            for (int x = 0; (uint32_t)x < job->width; x += TRC_WIDTH) {
                const struct group u = {&w, row, x, trc_plane_at(x, y + row)};
                regress(job, &w, &u, y + row);
            }
        take_light(job, &w, y);
    }
}
