/* The quick filter of model/denoise.h.
 *
 * Rows go through all of it one after the other, each step as many rows behind the newest one as
 * those around it reach that it needs: what a strip is filtered in stays in the cache, whatever its
 * height. */
#include "kernels/filter/filter.h"

/* Wavelets, of steps of 1, 2 and 4 pixels. */
#define LEVELS 3
/* What a wavelet takes of a pixel itself and of those a step left, right, above and below it. Those
 * at the corners, too, cost twice as much, and errors are larger. */
#define KEPT 0.25f
#define TAKEN 0.1875f
/* Standard deviations of light, lengths of normals, and slopes of the logarithm of depth by which
 * pixels are still alike: 1.5 of the first left noise, 3 smeared from 4 samples on. */
#define LIGHT_WIDTH 2.5f
#define LEAST_LIGHT_WIDTH 1e-3f
#define NORMAL_WIDTH 0.3f
#define LEAST_DEPTH_WIDTH 0.01f
/* Of albedo that light is divided by: less makes dark surfaces' noise large. */
#define LEAST_ALBEDO 0.2f
/* Samples at which a wavelet begins to fade and is gone; the first one stays. */
static const float fade_begin[LEVELS] = {0.0f, 16.0f, 4.0f},
                   fade_end[LEVELS] = {0.0f, 64.0f, 16.0f};
/* The part kept is that much of variance / (variance + error), as in blend.c. */
#define FAVOR 1.5f
/* Variance of the mean of all samples over what the halves tell, which depend on each other as
 * regress.c says: (1 - 0.3) / (1 + 0.3). */
#define HALVES_VARIANCE 0.54f
#define DARK 0.01f
#define MOST_ERROR 1e3f
/* Numbers above are as good as this, so that squares stay finite. */
#define MOST 1e15f
/* Of pixels without samples, which are unlike all others. */
#define NO_DEPTH -1e4f

struct planes {
    int width; /* of the strip */
    float *color, *albedo, *normal, *depth, *half, *half_count, *count;
    /* [level & 1]: what a wavelet begins with, the next one's else. */
    float *light[2][4], *light_mean[2], *variance[2];
    float *steepness, *slope, *own, *first_variance;
    float *estimate[2], *columns[2]; /* variance, error */
};

static struct planes planes_of(float *memory, int width) {
    struct planes p = {
        .width = width,
        .color = memory + TRC_PREVIEW_COLOR * TRC_PREVIEW_FLOATS,
        .albedo = memory + TRC_PREVIEW_ALBEDO * TRC_PREVIEW_FLOATS,
        .normal = memory + TRC_PREVIEW_NORMAL * TRC_PREVIEW_FLOATS,
        .depth = memory + TRC_PREVIEW_DEPTH * TRC_PREVIEW_FLOATS,
        .half = memory + TRC_PREVIEW_HALF * TRC_PREVIEW_FLOATS,
        .half_count = memory + TRC_PREVIEW_HALF_COUNT * TRC_PREVIEW_FLOATS,
        .count = memory + TRC_PREVIEW_COUNT * TRC_PREVIEW_FLOATS,
    };
    float *next = memory + TRC_PREVIEW_INPUTS * TRC_PREVIEW_FLOATS;
    float **const own[] = {&p.light[0][0],   &p.light[0][1],   &p.light[0][2], &p.light[0][3],
                           &p.light[1][0],   &p.light[1][1],   &p.light[1][2], &p.light[1][3],
                           &p.light_mean[0], &p.light_mean[1], &p.variance[0], &p.variance[1],
                           &p.steepness,     &p.slope,         &p.own,         &p.first_variance,
                           &p.estimate[0],   &p.estimate[1],   &p.columns[0],  &p.columns[1]};
    _Static_assert(sizeof own / sizeof *own == TRC_PREVIEW_PLANES - TRC_PREVIEW_INPUTS,
                   "a plane for each");
    for (size_t i = 0; i < sizeof own / sizeof *own; i++, next += TRC_PREVIEW_FLOATS)
        *own[i] = next;
    return p;
}

/* Rows a step above, at, and a step below one. */
struct rows {
    int at[3];
};
static struct rows rows_around(int y, int step) {
    return (struct rows){
        {trc_preview_at(0, y - step), trc_preview_at(0, y), trc_preview_at(0, y + step)}};
}

static vfloat albedo_at(const struct planes *p, int c, int at) {
    return vf_load(p->albedo + c * TRC_PREVIEW_FLOATS + at) + vf_set(LEAST_ALBEDO);
}

/* Vectors of a row of the strip, and of as many pixels beside it: x of the first. */
#define FOR_ROW(margin, x)                                                                     \
    for (int x = -((margin) + TRC_WIDTH - 1) / TRC_WIDTH * TRC_WIDTH; x < p->width + (margin); \
         x += TRC_WIDTH)

/* The mean of three by three pixels. */
static vfloat box(const float *in, const struct rows *rows, int x) {
    vfloat sum = vf_set(0.0f);
    for (int j = 0; j < 3; j++)
        for (int i = -1; i <= 1; i++)
            sum = sum + vf_load(in + rows->at[j] + x + i);
    return sum * vf_set(1.0f / 9.0f);
}

/* ---- sums of a film ---- */

/* What is read here may be written by others, and is read again then (model/sequence.h). By
 * vectors, which are not atomic: they are, number by number, on all processors that there are
 * kernels for. */
#define MAY_BE_WRITTEN __attribute__((no_sanitize("thread")))

/* Asks for what the row above will take: rows are too short for processors to look ahead. What is
 * behind the film is asked for in vain. */
#define CACHE_LINE 64
static void fetch_above(const void *run, size_t row_bytes, size_t run_bytes) {
    for (size_t i = 0; i < run_bytes; i += CACHE_LINE)
        __builtin_prefetch((const char *)run + row_bytes + i);
}

/* channels is a constant of each call. */
TRC_INLINE MAY_BE_WRITTEN void load_sums(const struct trc_film *film, uint32_t pass, size_t pixel,
                                         int channels, int count, float *plane) {
    const size_t bytes = (size_t)channels * sizeof(double);
    const double *sums = film->sums[pass] + (size_t)channels * pixel;
    float row[4 * TRC_TILE_SIZE];
    fetch_above(sums, bytes * film->width, bytes * (size_t)count);
    for (int i = 0; i < channels * count; i++)
        row[i] = (float)sums[i];
    for (int k = 0; k < channels; k++)
        for (int i = 0; i < count; i++)
            plane[k * TRC_PREVIEW_FLOATS + i] = row[channels * i + k];
}

/* Of a pixel with one sample there is no half, and its memory is not read. */
TRC_INLINE MAY_BE_WRITTEN void load_half(const struct trc_half *half, bool some, float *at) {
    at[TRC_PREVIEW_HALF * TRC_PREVIEW_FLOATS] =
        some ? half->light[0] + half->light[1] + half->light[2] : 0.0f;
    at[TRC_PREVIEW_HALF_COUNT * TRC_PREVIEW_FLOATS] = some ? (float)half->count : 0.0f;
}

MAY_BE_WRITTEN void trc_preview_load(const struct trc_film *film, size_t pixel, int count,
                                     float *planes) {
    const uint32_t *counts = film->sample_counts + pixel;
    load_sums(film, TRC_PASS_COMBINED, pixel, 4, count,
              planes + TRC_PREVIEW_COLOR * TRC_PREVIEW_FLOATS);
    if (film->guides != TRC_GUIDES_NONE)
        load_sums(film, TRC_PASS_DENOISING_ALBEDO, pixel, 3, count,
                  planes + TRC_PREVIEW_ALBEDO * TRC_PREVIEW_FLOATS);
    if (film->guides == TRC_GUIDES_ALBEDO_NORMAL) {
        load_sums(film, TRC_PASS_DENOISING_NORMAL, pixel, 3, count,
                  planes + TRC_PREVIEW_NORMAL * TRC_PREVIEW_FLOATS);
        load_sums(film, TRC_PASS_DENOISING_DEPTH, pixel, 1, count,
                  planes + TRC_PREVIEW_DEPTH * TRC_PREVIEW_FLOATS);
    }
    if (counts[0] > 1)
        fetch_above(&film->halves[pixel], film->width * sizeof *film->halves,
                    (size_t)count * sizeof *film->halves);
    for (int i = 0; i < count; i++) {
        load_half(&film->halves[pixel + (size_t)i], counts[i] > 1, planes + i);
        planes[TRC_PREVIEW_COUNT * TRC_PREVIEW_FLOATS + i] = (float)counts[i];
    }
}

/* ---- what there is ---- */

/* Within limits; NaN: the lower. */
static vfloat cut(vfloat mean, float low) {
    return vf_select(vf_gt(mean, vf_set(low)), vf_min(mean, vf_set(MOST)), vf_set(low));
}

static void mean_of(float *plane, int at, vfloat scale, float low) {
    vf_store(plane + at, cut(vf_load(plane + at) * scale, low));
}

/* Pixels whose halves are not both there. */
static vmask without_halves(const struct planes *p, int at) {
    const vfloat first = vf_load(p->half_count + at);
    return vm_or(vf_le(first, vf_set(0.0f)), vf_le(vf_load(p->count + at), first));
}

/* The standard deviation of a pixel's mean light, by its halves, where both are there. */
static vfloat change_at(const struct planes *p, int at, float exposure) {
    const vfloat one = vf_set(1.0f), count = vf_load(p->count + at);
    const vfloat first = vf_load(p->half_count + at), part = first / count;
    const vfloat of_first = vf_load(p->half + at);
    vfloat of_all = vf_set(0.0f);
    for (int c = 0; c < 3; c++)
        of_all = of_all + vf_load(p->color + c * TRC_PREVIEW_FLOATS + at);
    const vfloat change = vf_abs(of_first / first - (of_all - of_first) / (count - first));
    return cut(change * vf_sqrt(part * (one - part)) * vf_set(exposure / 3.0f), 0.0f);
}

static void prepare_means(const struct planes *p, int at, float exposure) {
    const vfloat count = vf_load(p->count + at);
    const vmask some = vf_gt(count, vf_set(0.0f));
    const vfloat scale = vf_select(some, vf_set(1.0f) / count, vf_set(0.0f));
    for (int c = 0; c < 3; c++) {
        mean_of(p->color + c * TRC_PREVIEW_FLOATS, at, scale * vf_set(exposure), -MOST);
        mean_of(p->albedo + c * TRC_PREVIEW_FLOATS, at, scale, 0.0f);
        mean_of(p->normal + c * TRC_PREVIEW_FLOATS, at, scale, -MOST);
    }
    float *alpha = p->color + 3 * TRC_PREVIEW_FLOATS + at;
    vf_store(alpha, vf_min(cut(vf_load(alpha) * scale, 0.0f), vf_set(1.0f)));
    mean_of(p->depth, at, scale, 0.0f);
    vf_store(p->depth + at, vf_select(some, vf_log1p(vf_load(p->depth + at)), vf_set(NO_DEPTH)));
}

static void prepare_light(const struct planes *p, int y, float exposure) {
    FOR_ROW(TRC_PREVIEW_HALO, x) {
        const int at = trc_preview_at(x, y);
        const vfloat deviation = change_at(p, at, exposure);
        prepare_means(p, at, exposure);
        vfloat mean = vf_set(0.0f), albedo_mean = vf_set(0.0f);
        for (int c = 0; c < 3; c++) {
            const vfloat albedo = albedo_at(p, c, at);
            const vfloat light = vf_load(p->color + c * TRC_PREVIEW_FLOATS + at) / albedo;
            vf_store(p->light[0][c] + at, light);
            mean = mean + light;
            albedo_mean = albedo_mean + albedo;
        }
        vf_store(p->light[0][3] + at, vf_load(p->color + 3 * TRC_PREVIEW_FLOATS + at));
        vf_store(p->light_mean[0] + at, mean * vf_set(1.0f / 3.0f));
        const vfloat change = deviation * vf_set(3.0f) / albedo_mean;
        vf_store(p->first_variance + at, change * change);
        vf_store(p->own + at, vf_set(1.0f));
    }
}

/* Pixels without halves have the variance of what is around them. */
static void prepare_variance(const struct planes *p, int y) {
    const struct rows rows = rows_around(y, 1);
    FOR_ROW(TRC_PREVIEW_HALO - 1, x) {
        const int at = rows.at[1] + x;
        const vmask without = without_halves(p, at);
        if (!vm_any(without)) {
            vf_store(p->variance[0] + at, vf_load(p->first_variance + at));
            continue;
        }
        const vfloat mean = box(p->light_mean[0], &rows, x);
        vfloat square = vf_set(0.0f);
        for (int j = 0; j < 3; j++)
            for (int i = -1; i <= 1; i++) {
                const vfloat apart = vf_load(p->light_mean[0] + rows.at[j] + x + i) - mean;
                square = square + apart * apart;
            }
        const vfloat variance =
            vf_select(without, square * vf_set(1.0f / 8.0f), vf_load(p->first_variance + at));
        vf_store(p->variance[0] + at, variance);
        vf_store(p->first_variance + at, variance);
    }
}

/* How fast depth changes from pixel to pixel on the flatter sides. */
static void prepare_steepness(const struct planes *p, int y) {
    const struct rows rows = rows_around(y, 1);
    FOR_ROW(TRC_PREVIEW_HALO - 1, x) {
        const float *depths = p->depth + x;
        const vfloat depth = vf_load(depths + rows.at[1]);
        const vfloat across = vf_min(vf_abs(vf_load(depths + rows.at[1] + 1) - depth),
                                     vf_abs(vf_load(depths + rows.at[1] - 1) - depth));
        const vfloat along = vf_min(vf_abs(vf_load(depths + rows.at[2]) - depth),
                                    vf_abs(vf_load(depths + rows.at[0]) - depth));
        vf_store(p->steepness + rows.at[1] + x, across + along);
    }
}
static void prepare_slope(const struct planes *p, int y) {
    const struct rows rows = rows_around(y, 1);
    FOR_ROW(TRC_PREVIEW_HALO - 2, x)
    vf_store(p->slope + rows.at[1] + x, box(p->steepness, &rows, x));
}

/* ---- wavelets ---- */

/* What a pixel is compared by. */
struct center {
    vfloat light, normal[3], depth, per_light, slope;
};

static struct center center_at(const struct planes *p, int level, const struct rows *near, int x) {
    const int at = near->at[1] + x;
    struct center c = {.light = vf_load(p->light_mean[level & 1] + at),
                       .depth = vf_load(p->depth + at),
                       .slope = vf_load(p->slope + at)};
    for (int k = 0; k < 3; k++)
        c.normal[k] = vf_load(p->normal + k * TRC_PREVIEW_FLOATS + at);
    c.per_light =
        vf_set(1.0f) / (vf_sqrt(box(p->variance[level & 1], near, x)) * vf_set(LIGHT_WIDTH) +
                        vf_set(LEAST_LIGHT_WIDTH));
    return c;
}

static vfloat weight_at(const struct planes *p, int level, const struct center *c, int q,
                        vfloat per_depth) {
    vfloat apart = vf_abs(vf_load(p->light_mean[level & 1] + q) - c->light) * c->per_light +
                   vf_abs(vf_load(p->depth + q) - c->depth) * per_depth;
    vfloat normal2 = vf_set(0.0f);
    for (int k = 0; k < 3; k++) {
        const vfloat change = vf_load(p->normal + k * TRC_PREVIEW_FLOATS + q) - c->normal[k];
        normal2 = normal2 + change * change;
    }
    return trc_bell(apart + normal2 * vf_set(1.0f / (NORMAL_WIDTH * NORMAL_WIDTH)));
}

/* The part of a wavelet that is left at the pixel's samples. */
static vfloat rest_of(const struct planes *p, int level, int at) {
    if (!level)
        return vf_set(1.0f);
    const float end = fade_end[level];
    return vf_clamp((vf_set(end) - vf_load(p->count + at)) *
                        vf_set(1.0f / (end - fade_begin[level])),
                    0.0f, 1.0f);
}

/* Where a wavelet is gone. */
static void keep_pixels(const struct planes *p, int level, int at) {
    for (int c = 0; c < 4; c++)
        vf_store(p->light[~level & 1][c] + at, vf_load(p->light[level & 1][c] + at));
    vf_store(p->variance[~level & 1] + at, vf_load(p->variance[level & 1] + at));
}

/* near, far: the rows around, and those that the wavelet takes. */
static void filter_pixels(const struct planes *p, int level, const struct rows *near,
                          const struct rows *far, int x) {
    const int at = near->at[1] + x;
    const vfloat rest = rest_of(p, level, at);
    if (!vm_any(vf_gt(rest, vf_set(0.0f)))) {
        keep_pixels(p, level, at);
        return;
    }
    float *const *in = p->light[level & 1], *const *out = p->light[~level & 1];
    const float *variance = p->variance[level & 1];
    const struct center center = center_at(p, level, near, x);
    vfloat sums[4], total = vf_set(KEPT), noise = vf_set(KEPT * KEPT) * vf_load(variance + at);
    for (int c = 0; c < 4; c++)
        sums[c] = vf_set(KEPT) * vf_load(in[c] + at);
    const int step = 1 << level;
    const vfloat per_depth =
        vf_set(1.0f) / (center.slope * vf_set((float)step) + vf_set(LEAST_DEPTH_WIDTH));
    const int taken[] = {far->at[0] + x, at - step, at + step, far->at[2] + x};
    for (int i = 0; i < 4; i++) {
        const int q = taken[i];
        const vfloat weight = weight_at(p, level, &center, q, per_depth) * vf_set(TAKEN);
        for (int c = 0; c < 4; c++)
            sums[c] = sums[c] + weight * vf_load(in[c] + q);
        total = total + weight;
        noise = noise + weight * weight * vf_load(variance + q);
    }
    const vfloat inverse = vf_set(1.0f) / total;
    for (int c = 0; c < 4; c++) {
        const vfloat former = vf_load(in[c] + at);
        vf_store(out[c] + at, former + rest * (sums[c] * inverse - former));
    }
    const vfloat former = vf_load(variance + at);
    vf_store(p->variance[~level & 1] + at, former + rest * (noise * inverse * inverse - former));
    vf_store(p->own + at, vf_load(p->own + at) *
                              (vf_set(1.0f) + rest * (vf_set(KEPT) * inverse - vf_set(1.0f))));
}

/* Pixels around the tile that a level still needs: of those that follow it, and of estimates. */
static int margin_of(int level) {
    int margin = 2;
    for (int next = level + 1; next < LEVELS; next++)
        margin += 1 << next;
    return margin;
}

static void filter_row(const struct planes *p, int level, int y) {
    const int margin = margin_of(level);
    const struct rows near = rows_around(y, 1), far = rows_around(y, 1 << level);
    float *const *light = p->light[~level & 1];
    FOR_ROW(margin, x)
    filter_pixels(p, level, &near, &far, x);
    FOR_ROW(margin, x) {
        const int at = near.at[1] + x;
        vf_store(p->light_mean[~level & 1] + at,
                 (vf_load(light[0] + at) + vf_load(light[1] + at) + vf_load(light[2] + at)) *
                     vf_set(1.0f / 3.0f));
    }
}

/* ---- how much of it is kept ---- */

/* Sums of five estimates above each other, and of five such sums side by side. */
static void sum_columns(const struct planes *p, int k, int y) {
    const float *estimate = p->estimate[k];
    float *columns = p->columns[k];
    FOR_ROW(2, x) {
        vfloat sum = vf_load(estimate + trc_preview_at(x, y));
        for (int j = 1; j <= 2; j++)
            sum = sum + vf_load(estimate + trc_preview_at(x, y + j)) +
                  vf_load(estimate + trc_preview_at(x, y - j));
        vf_store(columns + trc_preview_at(x, y), sum);
    }
}
static vfloat around(const float *columns, int at) {
    vfloat sum = vf_load(columns + at);
    for (int i = 1; i <= 2; i++)
        sum = sum + vf_load(columns + at + i) + vf_load(columns + at - i);
    return sum;
}

/* Estimates of the plain pixel's variance and the filtered one's error, over the light there,
 * squared. Light gets its albedo again. */
static void estimate(const struct planes *p, int y) {
    float *const *light = p->light[LEVELS & 1];
    FOR_ROW(2, x) {
        const int at = trc_preview_at(x, y);
        vfloat change2 = vf_set(0.0f), mean = vf_set(0.0f), albedo_mean = vf_set(0.0f);
        for (int c = 0; c < 3; c++) {
            const vfloat albedo = albedo_at(p, c, at), clean = vf_load(light[c] + at) * albedo;
            const vfloat change = clean - vf_load(p->color + c * TRC_PREVIEW_FLOATS + at);
            change2 = change2 + change * change;
            mean = mean + clean;
            albedo_mean = albedo_mean + albedo;
            vf_store(light[c] + at, clean);
        }
        const vfloat third = vf_set(1.0f / 3.0f), dark = mean * third + vf_set(DARK);
        const vfloat unit = vf_set(1.0f) / (dark * dark);
        const vfloat scale =
            vf_set(HALVES_VARIANCE) * (albedo_mean * third) * (albedo_mean * third);
        const vfloat variance =
            vf_min(vf_load(p->first_variance + at) * scale * unit, vf_set(MOST_ERROR));
        const vfloat own = vf_set(1.0f) - vf_set(2.0f) * vf_load(p->own + at);
        vf_store(p->estimate[0] + at, variance);
        vf_store(p->estimate[1] + at,
                 vf_min(change2 * third * unit, vf_set(MOST_ERROR)) - variance * own);
    }
}

static void blend(const struct planes *p, int y) {
    float *const *light = p->light[LEVELS & 1];
    for (int k = 0; k < 2; k++)
        sum_columns(p, k, y);
    FOR_ROW(0, x) {
        const int at = trc_preview_at(x, y);
        const vfloat variance = around(p->columns[0], at);
        const vfloat error = vf_max(around(p->columns[1], at), vf_set(0.0f));
        const vfloat kept = vf_set(FAVOR) * variance / (variance + error + vf_set(1e-12f));
        const vfloat part =
            vf_select(without_halves(p, at), vf_set(1.0f), vf_min(kept, vf_set(1.0f)));
        for (int c = 0; c < 4; c++) {
            float *shown = p->color + c * TRC_PREVIEW_FLOATS + at;
            const vfloat plain = vf_load(shown);
            vf_store(shown, plain + part * (vf_load(light[c] + at) - plain));
        }
    }
}

void trc_preview_filter(float *memory, int width, int y, float exposure) {
    const struct planes p = planes_of(memory, width);
    prepare_light(&p, y, exposure);
    prepare_variance(&p, y - 1);
    prepare_steepness(&p, y - 1);
    prepare_slope(&p, y - 2);
    for (int level = 0, behind = 1; level < LEVELS; level++) {
        behind += 1 << level;
        if (y - behind >= -margin_of(level))
            filter_row(&p, level, y - behind);
    }
    if (y - TRC_PREVIEW_HALO + 2 >= -2)
        estimate(&p, y - TRC_PREVIEW_HALO + 2);
    if (y - TRC_PREVIEW_HALO >= 0)
        blend(&p, y - TRC_PREVIEW_HALO);
}

void trc_preview_store(const float *planes, int count, float *rgba) {
    const float *from = planes + TRC_PREVIEW_COLOR * TRC_PREVIEW_FLOATS;
    for (int i = 0; i < count; i++)
        for (int c = 0; c < 4; c++)
            rgba[4 * i + c] = from[c * TRC_PREVIEW_FLOATS + i];
}
