/* The film's part of a tile: samples that are done, and mattes. */
#include "kernels/tile/tile.h"

#include <math.h>

#include "model/sequence.h"

TRC_INLINE bool is_finite_sample(const struct trc_tile *t, uint32_t slot) {
    return isfinite(t->samples.radiance[0][slot] + t->samples.radiance[1][slot] +
                    t->samples.radiance[2][slot]);
}

/* The first of the slots [begin, end) at which the sum of the columns is not finite, else end. */
static uint32_t finite_end(const float *const *columns, int count, uint32_t begin, uint32_t end) {
    for (uint32_t slot = begin; slot < end; slot += TRC_WIDTH) { /* columns are a vector longer */
        vfloat sum = vf_load(columns[0] + slot);
        for (int k = 1; k < count; k++)
            sum = sum + vf_load(columns[k] + slot);
        const vmask is_finite = vf_lt(vf_abs(sum), vf_set(INFINITY));
        const uint32_t others = vm_bits(vm_andnot(vm_first((int32_t)(end - slot)), is_finite));
        if (others)
            return slot + (uint32_t)__builtin_ctz(others);
    }
    return end;
}

/* The end of the samples from begin on that are finite and in one half of a pixel's samples, of
 * which it has count. */
static uint32_t stretch_end(const struct trc_tile *t, uint32_t begin, uint32_t end,
                            uint32_t count) {
    const struct trc_film *film = t->job->film;
    const uint32_t left = film->halves ? trc_film_next_half(film, count) - count : end - begin;
    const float *const columns[3] = {t->samples.radiance[0], t->samples.radiance[1],
                                     t->samples.radiance[2]};
    return finite_end(columns, 3, begin, left < end - begin ? begin + left : end);
}

/* Adds what shadow catchers of a sample got to its pixel, if it is finite. */
static void film_add_caught(struct trc_tile *t, uint32_t sample, size_t pixel) {
    const uint32_t blocked = sample + TRC_ROW_BLOCKED * TRC_CATCHER_BATCH;
    const uint32_t unblocked = sample + TRC_ROW_UNBLOCKED * TRC_CATCHER_BATCH;
    const uint32_t background = sample + TRC_ROW_BACKGROUND * TRC_CATCHER_BATCH;
    if (!is_finite_sample(t, blocked) || !is_finite_sample(t, unblocked) ||
        !is_finite_sample(t, background)) {
        t->job->counts.dropped_samples++;
        return;
    }
    struct trc_caught *sum = &t->job->film->caught[pixel];
    double *environment = t->job->film->sums[TRC_PASS_ENVIRONMENT];
    for (int c = 0; c < 3; c++) {
        const double behind = (double)t->samples.radiance[c][background];
        trc_sum_add(&sum->blocked[c], (double)t->samples.radiance[c][blocked]);
        trc_sum_add(&sum->unblocked[c], (double)t->samples.radiance[c][unblocked]);
        trc_sum_add(&sum->background[c], behind);
        if (environment)
            trc_sum_add(&environment[3 * pixel + (size_t)c], behind);
    }
    trc_sum_add(&sum->coverage, -(double)t->samples.transparency[blocked]);
}

/* The value of the sample with the first number, unless that was dropped. Samples may come in
 * another order than that of their numbers. */
static void film_take_first(struct trc_tile *t, uint32_t pass, uint32_t begin, uint32_t end,
                            double *sums, bool has_any) {
    for (uint32_t slot = begin; slot < end; slot++) {
        const bool is_first = t->samples.index[slot] == t->desc->sample_offset;
        for (uint32_t k = 0; k < trc_pass_info_of(pass)->sums; k++) {
            const double value = (double)t->samples.pass[pass][k][slot];
            if (isfinite(value) && (is_first || (!has_any && slot == begin)))
                trc_sum_store(&sums[k], value);
        }
    }
}

/* Columns of samples and the sums that their values go to. */
#define ABREAST 8 /* additions that wait for none of each other */
struct addends {
    uint32_t count;
    const float *values[ABREAST];
    double *sums[ABREAST];
    double sum[ABREAST]; /* so far */
};

/* Adds the values [begin, end) that are finite, one after the other, and takes the columns out. */
static void add_values(struct addends *a, uint32_t begin, uint32_t end) {
    for (uint32_t k = a->count; k < ABREAST; k++)
        a->values[k] = a->values[0];
    if (finite_end(a->values, ABREAST, begin, end) == end)
        for (uint32_t slot = begin; slot < end; slot++)
            for (int k = 0; k < ABREAST; k++)
                a->sum[k] += (double)a->values[k][slot];
    else
        for (uint32_t slot = begin; slot < end; slot++)
            for (int k = 0; k < ABREAST; k++)
                a->sum[k] += isfinite(a->values[k][slot]) ? (double)a->values[k][slot] : 0.0;
    for (uint32_t k = 0; k < a->count; k++)
        trc_sum_store(a->sums[k], a->sum[k]);
    a->count = 0;
}

/* Adds the passes of the samples [begin, end) of one pixel to it; has_any: it has samples. */
static void film_add_passes(struct trc_tile *t, uint32_t begin, uint32_t end, size_t pixel,
                            bool has_any) {
    struct addends a = {.count = 0};
    for (uint32_t i = 0; i < t->samples.pass_count; i++) {
        const uint32_t pass = t->samples.passes[i];
        const struct trc_pass_info *info = trc_pass_info_of(pass);
        double *sums = t->job->film->sums[pass] + info->sums * pixel;
        if (info->kind == TRC_PASS_KIND_FIRST) {
            film_take_first(t, pass, begin, end, sums, has_any);
            continue;
        }
        for (uint32_t k = 0; k < info->sums; k++) {
            a.values[a.count] = t->samples.pass[pass][k];
            a.sums[a.count] = &sums[k];
            a.sum[a.count++] = has_any ? sums[k] : 0.0;
            if (a.count == ABREAST)
                add_values(&a, begin, end);
        }
    }
    if (a.count)
        add_values(&a, begin, end);
    for (uint32_t slot = begin; t->catchers && slot < end; slot++)
        film_add_caught(t, slot, pixel);
}

/* Adds the samples [begin, end), of one pixel, to it, in their order. Those that are not finite are
 * left out and counted. */
static void film_add_run(struct trc_tile *t, uint32_t begin, uint32_t end, size_t pixel) {
    struct trc_film *film = t->job->film;
    double *combined = film->sums[TRC_PASS_COMBINED] + 4 * pixel;
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    /* A pixel's first sample reads no sums: fresh memory that is read before it is written costs
     * each page a second fault, a third of a picture of one sample. */
    uint32_t count = film->sample_counts[pixel];
    if (count)
        memcpy(sum, combined, sizeof sum);
    for (uint32_t slot = begin, stop; slot < end; slot = stop) {
        stop = stretch_end(t, slot, end, count);
        if (stop == slot) {
            t->job->counts.dropped_samples++;
            stop++;
            continue;
        }
        if (film->halves && trc_film_ends_half(film, count))
            trc_film_keep_half(film, pixel, sum, count);
        for (uint32_t i = slot; i < stop; i++) {
            for (int c = 0; c < 3; c++)
                sum[c] += (double)t->samples.radiance[c][i];
            sum[3] += 1.0 - (double)t->samples.transparency[i];
        }
        if (t->extra_passes)
            film_add_passes(t, slot, stop, pixel, count > 0);
        count += stop - slot;
    }
    for (int c = 0; c < 4; c++)
        trc_sum_store(&combined[c], sum[c]);
    __atomic_store_n(&film->sample_counts[pixel], count, __ATOMIC_RELAXED);
    const size_t mattes = trc_tile_pixel(t, begin) * film->matte_count;
    for (int k = 0; film->matte_count && k < TRC_CRYPTOMATTE_KINDS; k++)
        if (t->mattes[k])
            trc_mattes_store(film->mattes[k] + pixel * film->matte_count, t->mattes[k] + mattes,
                             film->matte_count);
}

/* The same with adaptive sampling, whose sums may go on where the film's count has ended. */
static void adaptive_add_run(struct trc_tile *t, uint32_t begin, uint32_t end, size_t pixel) {
    struct trc_adaptive_pixel *p = &t->job->adaptive->pixels[pixel];
    for (uint32_t slot = begin; slot < end; slot++) {
        if (!is_finite_sample(t, slot))
            continue;
        for (int c = 0; c < 3; c++)
            p->sum[c] += (double)t->samples.radiance[c][slot];
        /* A catcher's light is as noisy as the shadow on it. */
        for (int c = 0; t->catchers && c < 3; c++)
            p->sum[c] += (double)t->samples.radiance[c][slot + TRC_ROW_BLOCKED * TRC_CATCHER_BATCH];
    }
    if (p->reasons & TRC_PIXEL_COUNTS)
        film_add_run(t, begin, end, pixel);
}

/* Adds the batch's samples to the film in the order of their slots. */
static void film_add_runs(struct trc_tile *t) {
    const uint32_t *pixel = t->samples.pixel, count = t->samples.count;
    for (uint32_t begin = 0, end; begin < count; begin = end) {
        end = begin + 1;
        while (end < count && pixel[end] == pixel[begin])
            end++;
        if (t->job->adaptive)
            adaptive_add_run(t, begin, end, trc_film_pixel(t, begin));
        else
            film_add_run(t, begin, end, trc_film_pixel(t, begin));
    }
}

void trc_film_add(struct trc_tile *t) {
    atomic_uint *sequence = trc_film_sequence(t->job->film, t->job->x, t->job->y);
    trc_sequence_write_begin(sequence);
    film_add_runs(t);
    trc_sequence_write_end(sequence);
}

/* The tables of mattes as the film has them. */
void trc_film_load_mattes(struct trc_tile *t) {
    const struct trc_tile_job *job = t->job;
    const struct trc_film *film = job->film;
    const size_t places = film->matte_count, row = job->width * places;
    for (int k = 0; k < TRC_CRYPTOMATTE_KINDS; k++)
        for (uint32_t y = 0; t->mattes[k] && y < job->height; y++) {
            struct trc_matte *to = t->mattes[k] + y * TRC_TILE_SIZE * places;
            const size_t pixel = (size_t)(job->y + y) * film->width + job->x;
            /* Fresh memory is not read: film_add_run. */
            if (job->sample_begin == t->desc->sample_offset)
                memset(to, 0, row * sizeof *to);
            else
                memcpy(to, film->mattes[k] + pixel * places, row * sizeof *to);
        }
}
