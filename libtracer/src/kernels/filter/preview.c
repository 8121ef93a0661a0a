/* The quick filter of model/denoise.h, of one tile's planes. */
#include "kernels/filter/filter.h"

/* Wavelets, of steps of 1, 2 and 4 pixels. */
#define LEVELS 3
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

#define AT(x, y) trc_preview_at(x, y)
#define STRIDE TRC_PREVIEW_STRIDE

struct planes {
    float *color, *albedo, *normal, *depth, *half, *half_count, *count;
    float *light[2][4], *light_mean, *variance[2], *smooth, *slope, *own, *first_variance;
    float *estimate;
};

static struct planes planes_of(float *memory) {
    struct planes p = {
        .color = memory + TRC_PREVIEW_COLOR * TRC_PREVIEW_FLOATS,
        .albedo = memory + TRC_PREVIEW_ALBEDO * TRC_PREVIEW_FLOATS,
        .normal = memory + TRC_PREVIEW_NORMAL * TRC_PREVIEW_FLOATS,
        .depth = memory + TRC_PREVIEW_DEPTH * TRC_PREVIEW_FLOATS,
        .half = memory + TRC_PREVIEW_HALF * TRC_PREVIEW_FLOATS,
        .half_count = memory + TRC_PREVIEW_HALF_COUNT * TRC_PREVIEW_FLOATS,
        .count = memory + TRC_PREVIEW_COUNT * TRC_PREVIEW_FLOATS,
    };
    float *next = memory + TRC_PREVIEW_INPUTS * TRC_PREVIEW_FLOATS;
    for (int k = 0; k < 2; k++) {
        for (int c = 0; c < 4; c++, next += TRC_PREVIEW_FLOATS)
            p.light[k][c] = next;
        p.variance[k] = next;
        next += TRC_PREVIEW_FLOATS;
    }
    float **const others[] = {&p.light_mean, &p.smooth,         &p.slope,
                              &p.own,        &p.first_variance, &p.estimate};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++, next += TRC_PREVIEW_FLOATS)
        *others[i] = next;
    return p;
}

static vfloat albedo_at(const struct planes *p, int c, int at) {
    return vf_load(p->albedo + c * TRC_PREVIEW_FLOATS + at) + vf_set(LEAST_ALBEDO);
}

/* Calls body for vectors of the tile and as many pixels around it. */
#define FOR_PIXELS(margin, at)                                                        \
    for (int y_ = -(margin); y_ < TRC_PREVIEW_HEIGHT + (margin); y_++)                \
        for (int at = AT(0, y_) - ((margin) + TRC_WIDTH - 1) / TRC_WIDTH * TRC_WIDTH; \
             at < AT(TRC_PREVIEW_WIDTH + (margin), y_); at += TRC_WIDTH)

static vfloat box(const float *in, int at) {
    vfloat sum = vf_set(0.0f);
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++)
            sum = sum + vf_load(in + at + j * STRIDE + i);
    return sum * vf_set(1.0f / 9.0f);
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
    mean_of(p->color + 3 * TRC_PREVIEW_FLOATS, at, scale, 0.0f);
    mean_of(p->depth, at, scale, 0.0f);
    vf_store(p->depth + at, vf_select(some, vf_log1p(vf_load(p->depth + at)), vf_set(NO_DEPTH)));
}

static void prepare_light(const struct planes *p, float exposure) {
    FOR_PIXELS(TRC_PREVIEW_HALO, at) {
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
        vf_store(p->light_mean + at, mean * vf_set(1.0f / 3.0f));
        const vfloat change = deviation * vf_set(3.0f) / albedo_mean;
        vf_store(p->first_variance + at, change * change);
        vf_store(p->own + at, vf_set(1.0f));
    }
}

/* Pixels without halves have the variance of what is around them. */
static void prepare_variance(const struct planes *p) {
    FOR_PIXELS(TRC_PREVIEW_HALO - 1, at) {
        const vmask without = without_halves(p, at);
        if (!vm_any(without)) {
            vf_store(p->variance[0] + at, vf_load(p->first_variance + at));
            continue;
        }
        const vfloat mean = box(p->light_mean, at);
        vfloat square = vf_set(0.0f);
        for (int j = -1; j <= 1; j++)
            for (int i = -1; i <= 1; i++) {
                const vfloat apart = vf_load(p->light_mean + at + j * STRIDE + i) - mean;
                square = square + apart * apart;
            }
        const vfloat variance =
            vf_select(without, square * vf_set(1.0f / 8.0f), vf_load(p->first_variance + at));
        vf_store(p->variance[0] + at, variance);
        vf_store(p->first_variance + at, variance);
    }
}

/* How fast depth changes from pixel to pixel on the flatter sides. */
static void prepare_slope(const struct planes *p) {
    FOR_PIXELS(TRC_PREVIEW_HALO - 1, at) {
        const vfloat depth = vf_load(p->depth + at);
        vfloat slope = vf_set(0.0f);
        for (int axis = 0; axis < 2; axis++) {
            const int step = axis ? STRIDE : 1;
            slope = slope + vf_min(vf_abs(vf_load(p->depth + at + step) - depth),
                                   vf_abs(vf_load(p->depth + at - step) - depth));
        }
        vf_store(p->smooth + at, slope);
    }
    FOR_PIXELS(TRC_PREVIEW_HALO - 2, at)
    vf_store(p->slope + at, box(p->smooth, at));
}

/* ---- wavelets ---- */

/* What a pixel is compared by. */
struct center {
    vfloat light, normal[3], depth, per_light, slope;
};

static struct center center_at(const struct planes *p, int at) {
    struct center c = {.light = vf_load(p->light_mean + at),
                       .depth = vf_load(p->depth + at),
                       .slope = vf_load(p->slope + at)};
    for (int k = 0; k < 3; k++)
        c.normal[k] = vf_load(p->normal + k * TRC_PREVIEW_FLOATS + at);
    c.per_light = vf_set(1.0f) / (vf_sqrt(vf_load(p->smooth + at)) * vf_set(LIGHT_WIDTH) +
                                  vf_set(LEAST_LIGHT_WIDTH));
    return c;
}

static vfloat weight_at(const struct planes *p, const struct center *c, int q, vfloat per_depth) {
    vfloat apart = vf_abs(vf_load(p->light_mean + q) - c->light) * c->per_light +
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

static void filter_pixels(const struct planes *p, int level, int at) {
    const vfloat rest = rest_of(p, level, at);
    if (!vm_any(vf_gt(rest, vf_set(0.0f)))) {
        keep_pixels(p, level, at);
        return;
    }
    float *const *in = p->light[level & 1], *const *out = p->light[~level & 1];
    const float *variance = p->variance[level & 1];
    const struct center center = center_at(p, at);
    vfloat sums[4], total = vf_set(0.25f), noise = vf_set(0.0625f) * vf_load(variance + at);
    for (int c = 0; c < 4; c++)
        sums[c] = vf_set(0.25f) * vf_load(in[c] + at);
    const int step = 1 << level;
    const vfloat per_depth[2] = {
        vf_set(1.0f) / (center.slope * vf_set((float)step) + vf_set(LEAST_DEPTH_WIDTH)),
        vf_set(1.0f) /
            (center.slope * vf_set((float)step * 1.41421356f) + vf_set(LEAST_DEPTH_WIDTH))};
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            if (!i && !j)
                continue;
            const int q = at + step * (j * STRIDE + i);
            const bool corner = i && j;
            const vfloat weight =
                weight_at(p, &center, q, per_depth[corner]) * vf_set(corner ? 0.0625f : 0.125f);
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
                              (vf_set(1.0f) + rest * (vf_set(0.25f) * inverse - vf_set(1.0f))));
}

/* Pixels around the tile that a level still needs: of those that follow it, and of estimates. */
static int margin_of(int level) {
    int margin = 2;
    for (int next = level + 1; next < LEVELS; next++)
        margin += 1 << next;
    return margin;
}

static void filter_level(const struct planes *p, int level) {
    const int margin = margin_of(level);
    FOR_PIXELS(margin, at)
    vf_store(p->smooth + at, box(p->variance[level & 1], at));
    FOR_PIXELS(margin, at)
    filter_pixels(p, level, at);
    float *const *light = p->light[~level & 1];
    if (level + 1 < LEVELS)
        FOR_PIXELS(margin, at)
    vf_store(p->light_mean + at,
             (vf_load(light[0] + at) + vf_load(light[1] + at) + vf_load(light[2] + at)) *
                 vf_set(1.0f / 3.0f));
}

/* ---- how much of it is kept ---- */

/* Sums of five estimates above each other, and of five such sums side by side. */
static void sum_columns(const float *estimate, float *columns) {
    FOR_PIXELS(2, at) {
        vfloat sum = vf_load(estimate + at);
        for (int j = 1; j <= 2; j++)
            sum = sum + vf_load(estimate + at + j * STRIDE) + vf_load(estimate + at - j * STRIDE);
        vf_store(columns + at, sum);
    }
}
static vfloat around(const float *columns, int at) {
    vfloat sum = vf_load(columns + at);
    for (int i = 1; i <= 2; i++)
        sum = sum + vf_load(columns + at + i) + vf_load(columns + at - i);
    return sum;
}

/* Estimates of the plain pixel's variance and the filtered one's error, over the light there,
 * squared: into smooth and estimate. Light gets its albedo again. */
static void estimate(const struct planes *p) {
    float *const *light = p->light[LEVELS & 1];
    FOR_PIXELS(2, at) {
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
        vf_store(p->smooth + at, variance);
        vf_store(p->estimate + at,
                 vf_min(change2 * third * unit, vf_set(MOST_ERROR)) - variance * own);
    }
}

static void blend(const struct planes *p) {
    float *const *light = p->light[LEVELS & 1];
    estimate(p);
    sum_columns(p->smooth, p->variance[0]);
    sum_columns(p->estimate, p->variance[1]);
    FOR_PIXELS(0, at) {
        const vfloat variance = around(p->variance[0], at);
        const vfloat error = vf_max(around(p->variance[1], at), vf_set(0.0f));
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

void trc_preview_filter(float *memory, float exposure) {
    const struct planes p = planes_of(memory);
    prepare_light(&p, exposure);
    prepare_variance(&p);
    prepare_slope(&p);
    for (int level = 0; level < LEVELS; level++)
        filter_level(&p, level);
    blend(&p);
}
