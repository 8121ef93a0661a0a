#include "film/part.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"

/* Doubles of struct trc_half: light, features and count; of struct trc_matte: id and weight. */
#define HALF_LIGHT 4
#define HALF_FEATURES 7
#define HALF_CHANNELS (HALF_LIGHT + HALF_FEATURES + 1)
#define MATTE_CHANNELS 2

_Static_assert(TRC_SUMS_END <= UINT8_MAX, "numbers of sums fit small tables");

/* A kind of mattes, TRC_CRYPTOMATTE_KINDS for other numbers: a kind is at that of its first layer.
 */
static uint32_t matte_kind(uint32_t sums) {
    const uint32_t number = sums - TRC_PASS_CRYPTOMATTE(0, 0);
    const uint32_t kind = number / TRC_MAX_CRYPTOMATTE_LAYERS;
    return kind < TRC_CRYPTOMATTE_KINDS && number % TRC_MAX_CRYPTOMATTE_LAYERS == 0
               ? kind
               : TRC_CRYPTOMATTE_KINDS;
}

uint32_t trc_film_sums_channels(const struct trc_film *film, uint32_t sums) {
    if (sums == TRC_PASS_SAMPLE_COUNT)
        return 1;
    if (sums == TRC_SUMS_CATCHERS)
        return film->caught ? TRC_CAUGHT_CHANNELS : 0;
    if (sums == TRC_SUMS_HALVES)
        return film->halves ? HALF_CHANNELS : 0;
    const uint32_t kind = matte_kind(sums);
    if (kind < TRC_CRYPTOMATTE_KINDS)
        return film->mattes[kind] ? MATTE_CHANNELS * film->matte_count : 0;
    return sums < TRC_SUM_COUNT && film->sums[sums] ? trc_pass_info_of(sums)->sums : 0;
}

static uint64_t pixel_count(const struct trc_film *film) {
    return (uint64_t)film->width * film->height;
}

/* ---- reading ---- */

static void read_mattes(const struct trc_film *film, uint32_t kind, double *out) {
    const struct trc_matte *mattes = film->mattes[kind];
    for (uint64_t i = 0; i < pixel_count(film) * film->matte_count; i++) {
        out[MATTE_CHANNELS * i] = (double)mattes[i].id;
        out[MATTE_CHANNELS * i + 1] = mattes[i].weight;
    }
}

static void read_halves(const struct trc_film *film, double *out) {
    for (uint64_t i = 0; i < pixel_count(film); i++) {
        const struct trc_half *half = &film->halves[i];
        for (int k = 0; k < HALF_LIGHT; k++)
            *out++ = (double)half->light[k];
        for (int k = 0; k < HALF_FEATURES; k++)
            *out++ = (double)half->features[k];
        *out++ = half->count;
    }
}

trc_status trc_film_read_sums(const struct trc_film *film, uint32_t sums, double *out,
                              uint64_t double_count) {
    const uint32_t channels = trc_film_sums_channels(film, sums);
    if (!channels)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the film has no sums %" PRIu32, sums);
    const uint64_t count = pixel_count(film) * channels;
    TRC_TRY(trc_check_array(out, double_count, count, sizeof(double), sizeof(double), "sums_out"));
    if (sums == TRC_PASS_SAMPLE_COUNT)
        for (uint64_t i = 0; i < count; i++)
            out[i] = film->sample_counts[i];
    else if (sums == TRC_SUMS_CATCHERS)
        memcpy(out, film->caught, count * sizeof *out);
    else if (sums == TRC_SUMS_HALVES)
        read_halves(film, out);
    else if (matte_kind(sums) < TRC_CRYPTOMATTE_KINDS)
        read_mattes(film, matte_kind(sums), out);
    else
        memcpy(out, film->sums[sums], count * sizeof *out);
    return TRC_OK;
}

/* ---- adding ---- */

/* The arrays of a part by number of sums, NULL for those that there are not. */
struct part {
    const double *values[TRC_SUMS_END];
    uint32_t matte_count; /* places of a pixel's table, more than the film's unless it is whole */
};

/* Doubles of a pixel that a part for this film has under a number. */
static uint32_t part_channels(const struct trc_film *film, const struct part *part, uint32_t sums) {
    const uint32_t channels = trc_film_sums_channels(film, sums);
    const bool is_matte = channels && matte_kind(sums) < TRC_CRYPTOMATTE_KINDS;
    return is_matte ? MATTE_CHANNELS * part->matte_count : channels;
}

/* Values that a film cannot have would be read as numbers of another type. */
static trc_status check_whole_numbers(const double *values, uint64_t count, uint64_t first,
                                      uint64_t step, double maximum, const char *name) {
    for (uint64_t i = first; i < count; i += step)
        if (!(values[i] >= 0.0 && values[i] <= maximum && values[i] == floor(values[i])))
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "a %s of the part is %g", name, values[i]);
    return TRC_OK;
}

static trc_status check_values(const trc_sums *sums, uint32_t sample_subset) {
    const double *values = sums->values;
    const uint64_t count = sums->value_count;
    if (sums->number == TRC_PASS_SAMPLE_COUNT)
        return check_whole_numbers(values, count, 0, 1, sample_subset, "sample count");
    if (sums->number == TRC_SUMS_HALVES)
        return check_whole_numbers(values, count, HALF_CHANNELS - 1, HALF_CHANNELS, sample_subset,
                                   "half's sample count");
    if (matte_kind(sums->number) < TRC_CRYPTOMATTE_KINDS)
        return check_whole_numbers(values, count, 1, MATTE_CHANNELS, UINT32_MAX, "matte's weight");
    return TRC_OK;
}

static trc_status open_part(const struct trc_film *film, const trc_part_desc *desc, bool is_whole,
                            struct part *part) {
    memset(part, 0, sizeof *part);
    part->matte_count = is_whole ? film->matte_count : TRC_MAX_CRYPTOMATTE_DEPTH + TRC_SPARE_MATTES;
    TRC_TRY(trc_check_array(desc->sums, desc->sums_count, desc->sums_count, sizeof *desc->sums,
                            _Alignof(trc_sums), "sums"));
    for (uint32_t i = 0; i < desc->sums_count; i++) {
        const trc_sums *sums = &desc->sums[i];
        TRC_TRY(trc_check_struct(sums, sizeof *sums, "trc_sums"));
        const uint32_t channels = part_channels(film, part, sums->number);
        if (!channels || part->values[sums->number])
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the part has sums %" PRIu32 "%s",
                            sums->number, channels ? " twice" : ", the film has not");
        TRC_TRY(trc_check_array(sums->values, sums->value_count, pixel_count(film) * channels,
                                sizeof(double), sizeof(double), "values"));
        TRC_TRY(check_values(sums, desc->sample_subset));
        part->values[sums->number] = sums->values;
    }
    for (uint32_t number = 0; number < TRC_SUMS_END; number++)
        if (trc_film_sums_channels(film, number) && !part->values[number])
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the part lacks sums %" PRIu32, number);
    return TRC_OK;
}

/* A first half that ends within the part: what there is and what the part has of it. */
static void join_half(struct trc_film *film, const double *from, uint64_t pixel) {
    static const uint32_t passes[] = {TRC_PASS_DENOISING_ALBEDO, TRC_PASS_DENOISING_NORMAL,
                                      TRC_PASS_DENOISING_DEPTH};
    struct trc_half *half = &film->halves[pixel];
    for (int c = 0; c < HALF_LIGHT; c++) {
        const bool is_caught = film->caught && c < 3;
        const double sum = film->sums[TRC_PASS_COMBINED][4 * pixel + (uint64_t)c] +
                           (is_caught ? film->caught[pixel].blocked[c] : 0.0);
        half->light[c] = (float)(sum + *from++);
    }
    float *feature = half->features;
    for (int i = 0; i < 3; i++) {
        const uint32_t channels = trc_pass_info_of(passes[i])->sums;
        for (uint32_t k = 0; k < channels; k++)
            *feature++ = (float)(film->sums[passes[i]][channels * pixel + k] + *from++);
    }
    half->count = film->sample_counts[pixel] + (uint32_t)*from;
}

/* The first half of a pixel's samples ends before the part, or within it, or neither. */
static void add_half(struct trc_film *film, const struct part *part, uint64_t pixel) {
    const uint32_t count = film->sample_counts[pixel];
    const double *from = part->values[TRC_SUMS_HALVES] + pixel * HALF_CHANNELS;
    if (from[HALF_CHANNELS - 1] > 0.0)
        join_half(film, from, pixel);
    else if (count && trc_film_ends_half(film, count))
        trc_film_keep_half(film, pixel, film->sums[TRC_PASS_COMBINED] + 4 * pixel, count);
}

static void add_mattes(struct trc_film *film, const struct part *part, uint64_t pixel) {
    for (uint32_t kind = 0; kind < TRC_CRYPTOMATTE_KINDS; kind++) {
        if (!film->mattes[kind])
            continue;
        const double *from = part->values[TRC_PASS_CRYPTOMATTE(kind, 0)] +
                             pixel * part->matte_count * MATTE_CHANNELS;
        for (uint32_t i = 0; i < part->matte_count; i++, from += MATTE_CHANNELS)
            if (from[0] != 0.0)
                trc_matte_add(film->mattes[kind] + pixel * film->matte_count, film->matte_count,
                              (float)from[0], (uint32_t)from[1]);
    }
}

/* The first samples are stored as they are: zeros have signs. */
static void add_sums(struct trc_film *film, const struct part *part, uint64_t pixel) {
    const bool has_any = film->sample_counts[pixel] != 0;
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++) {
        if (!film->sums[pass])
            continue;
        const struct trc_pass_info *info = trc_pass_info_of(pass);
        double *to = film->sums[pass] + pixel * info->sums;
        const double *from = part->values[pass] + pixel * info->sums;
        for (uint32_t k = 0; k < info->sums; k++) {
            if (!has_any)
                to[k] = from[k];
            else if (info->kind != TRC_PASS_KIND_FIRST)
                to[k] += from[k];
        }
    }
}

static void add_caught(struct trc_film *film, const struct part *part, uint64_t pixel) {
    double to[TRC_CAUGHT_CHANNELS];
    const double *from = part->values[TRC_SUMS_CATCHERS] + pixel * TRC_CAUGHT_CHANNELS;
    memcpy(to, &film->caught[pixel], sizeof to);
    for (uint32_t k = 0; k < TRC_CAUGHT_CHANNELS; k++)
        to[k] += from[k];
    memcpy(&film->caught[pixel], to, sizeof to);
}

static void add_pixel(struct trc_film *film, const struct part *part, uint64_t pixel) {
    const uint32_t count = (uint32_t)part->values[TRC_PASS_SAMPLE_COUNT][pixel];
    if (!count)
        return;
    if (film->halves)
        add_half(film, part, pixel);
    add_sums(film, part, pixel);
    add_mattes(film, part, pixel);
    if (film->caught)
        add_caught(film, part, pixel);
    film->sample_counts[pixel] += count;
}

trc_status trc_film_add_part(struct trc_film *film, struct trc_adaptive_pixel *adaptive,
                             const trc_part_desc *desc, bool is_whole) {
    struct part part;
    TRC_TRY(open_part(film, desc, is_whole, &part));
    const double *combined = part.values[TRC_PASS_COMBINED];
    const double *caught = part.values[TRC_SUMS_CATCHERS];
    for (uint64_t i = 0; i < pixel_count(film); i++) {
        for (int c = 0; adaptive && c < 3; c++)
            adaptive[i].sum[c] +=
                combined[4 * i + c] + (caught ? caught[TRC_CAUGHT_CHANNELS * i + c] : 0.0);
        if (!adaptive || adaptive[i].reasons & TRC_PIXEL_COUNTS)
            add_pixel(film, &part, i);
    }
    return TRC_OK;
}
