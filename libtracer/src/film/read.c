/* What a film shows of its sums. Tile by tile, as tiles may be written meanwhile
 * (model/sequence.h).
 */
#define _POSIX_C_SOURCE 200809L
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <sched.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "film/film.h"
#include "model/sequence.h"

/* Writing a batch of samples takes some ten microseconds, unless the system stops the thread. */
#define LOOKS_BEFORE_YIELDING 1000

/* What is read, to where: channels of the film's pixels. */
struct reading {
    const struct trc_film *film;
    uint32_t pass;
    const struct trc_pass_info *info;
    float exposure;
    bool is_clean; /* reconstructed light, where there is any */
    float *out;
};

/* Pixels [first, end) of a row, of one tile. */
struct row {
    uint64_t first, end;
};

static float to_float(double value) {
    if (!(value > -FLT_MAX))
        return value <= -FLT_MAX ? -FLT_MAX : 0.0f; /* NaN: 0 */
    return value < FLT_MAX ? (float)value : FLT_MAX;
}

static uint32_t load_count(const struct trc_film *film, uint64_t pixel) {
    return __atomic_load_n(&film->sample_counts[pixel], __ATOMIC_RELAXED);
}

static const double *sums_of(const struct reading *r, uint32_t pass) {
    const double *clean = r->film->clean.sums[pass];
    return r->is_clean && clean ? clean : r->film->sums[pass];
}
static const struct trc_caught *caught_of(const struct reading *r) {
    const struct trc_caught *clean = r->film->clean.caught;
    return r->is_clean && clean ? clean : r->film->caught;
}

static bool has_pass(const struct trc_film *film, uint32_t pass) {
    const enum trc_pass_kind kind = trc_pass_info_of(pass)->kind;
    if (kind == TRC_PASS_KIND_COUNT)
        return film->shows_counts;
    if (kind == TRC_PASS_KIND_SHADOW)
        return film->shows_shadows;
    if (kind == TRC_PASS_KIND_PLAIN)
        return film->shows_noise;
    if (kind != TRC_PASS_KIND_MATTE)
        return film->sums[pass] != NULL;
    const uint32_t number = pass - TRC_PASS_CRYPTOMATTE(0, 0),
                   layer = number % TRC_MAX_CRYPTOMATTE_LAYERS;
    return film->mattes[number / TRC_MAX_CRYPTOMATTE_LAYERS] &&
           layer * TRC_CRYPTOMATTE_LAYER_RANKS + TRC_SPARE_MATTES < film->matte_count;
}

/* ---- rows ---- */

static void read_mattes(const struct reading *r, struct row row) {
    const struct trc_film *film = r->film;
    const uint32_t number = r->pass - TRC_PASS_CRYPTOMATTE(0, 0);
    const struct trc_matte *mattes = film->mattes[number / TRC_MAX_CRYPTOMATTE_LAYERS];
    for (uint64_t i = row.first; i < row.end; i++)
        trc_mattes_read(mattes + i * film->matte_count, film->matte_count,
                        number % TRC_MAX_CRYPTOMATTE_LAYERS,
                        load_count(film, i) * film->matte_units, r->out + i * TRC_MATTE_CHANNELS);
}

static void read_counts(const struct reading *r, struct row row) {
    for (uint64_t i = row.first; i < row.end; i++)
        r->out[i] = (float)load_count(r->film, i);
}

/* How much of a pixel the picture covers, or mist does, of the sum of so many samples. What is
 * transparent by more than white, of which the sum tells less than nothing, covers nothing, as in
 * Cycles; nor is there mist where glass counts that the film is transparent through, and what is
 * behind it again. */
static double coverage(double sum, double count) { return fmin(fmax(sum / count, 0.0), 1.0); }

/* Passes that are sums or values of samples. Light is divided by its colour as Cycles divides it.
 */
static void read_sums(const struct reading *r, struct row row) {
    const enum trc_pass_kind kind = r->info->kind;
    const bool has_coverage = r->pass == TRC_PASS_COMBINED || r->pass == TRC_PASS_MIST;
    const uint32_t channels = r->info->channels, stride = r->info->sums;
    const uint32_t plain = has_coverage ? channels - 1 : channels; /* which is the last channel */
    const double *sums = sums_of(r, r->pass);
    const double *divisor = r->info->color != TRC_PASS_NONE ? sums_of(r, r->info->color) : NULL;
    const double light = kind == TRC_PASS_KIND_LIGHT ? r->exposure : 1.0;
    for (uint64_t i = row.first; i < row.end; i++) {
        const uint32_t count = load_count(r->film, i);
        float *pixel = r->out + i * channels;
        double weight = kind == TRC_PASS_KIND_FIRST ? 1.0 : count;
        if (kind == TRC_PASS_KIND_HITS)
            weight = trc_sum_load(&sums[i * stride + channels]);
        const double factor = count && weight > 0.0 ? 1.0 / weight : 0.0;
        for (uint32_t c = 0; c < plain; c++) {
            double value = trc_sum_load(&sums[i * stride + c]);
            if (divisor) {
                /* Both are sums of the same samples: the counts cancel. */
                const double by = trc_sum_load(&divisor[i * channels + c]);
                value = by != 0.0 ? value / by * count : 0.0;
            }
            pixel[c] = count ? to_float(value * factor * light) : 0.0f;
        }
        if (has_coverage)
            pixel[plain] =
                count ? (float)coverage(trc_sum_load(&sums[i * stride + plain]), count) : 0.0f;
    }
}

/* What shines is albedo to denoisers, where it is a pass. */
static void add_emission(const struct reading *r, struct row row) {
    const uint32_t channels = r->info->channels;
    const double *sums = sums_of(r, TRC_PASS_DENOISING_EMISSION);
    for (uint64_t i = row.first; sums && i < row.end; i++) {
        const uint32_t count = load_count(r->film, i);
        for (uint32_t c = 0; count && c < channels; c++)
            r->out[i * channels + c] += to_float(trc_sum_load(&sums[i * channels + c]) / count);
    }
}

/* What is left of the footage's light where catchers stand for it; 1 where they have no light. */
static void remains_of(const struct trc_caught *caught, double remains[3]) {
    for (int c = 0; c < 3; c++) {
        const double unblocked = trc_sum_load(&caught->unblocked[c]);
        remains[c] = unblocked != 0.0 ? trc_sum_load(&caught->blocked[c]) / unblocked : 1.0;
    }
}

/* What the footage is to be multiplied by: a pixel's mean over what the picture does not cover. */
static void read_shadows(const struct reading *r, struct row row) {
    const struct trc_film *film = r->film;
    const struct trc_caught *caught = caught_of(r);
    const double *combined = sums_of(r, TRC_PASS_COMBINED);
    for (uint64_t i = row.first; i < row.end; i++) {
        double remains[3] = {1.0, 1.0, 1.0}, part = 0.0;
        if (caught) {
            const double count = load_count(film, i);
            const double sum = trc_sum_load(&combined[4 * i + 3]);
            const double open = count > 0.0 ? count * (1.0 - coverage(sum, count)) : 0.0;
            remains_of(&caught[i], remains);
            part = open > 0.0 ? fmin(trc_sum_load(&caught[i].coverage) / open, 1.0) : 0.0;
        }
        for (int c = 0; c < 3; c++)
            r->out[3 * i + c] = to_float(1.0 + part * (remains[c] - 1.0));
    }
}

/* Adds to the picture what catchers do to it: cover it, as grey as a shadow can be by alpha alone,
 * or where the world is shown, let it through in part. */
static void add_shadows(const struct reading *r, struct row row) {
    const struct trc_film *film = r->film;
    for (uint64_t i = row.first; i < row.end; i++) {
        const struct trc_caught *caught = &caught_of(r)[i];
        const uint32_t count = load_count(film, i);
        const double part = count ? trc_sum_load(&caught->coverage) / count : 0.0;
        if (!(part > 0.0))
            continue;
        double remains[3];
        remains_of(caught, remains);
        const double light = fmin(fmax((remains[0] + remains[1] + remains[2]) / 3.0, 0.0), 1.0);
        float *pixel = r->out + 4 * i;
        pixel[3] =
            to_float(fmin(pixel[3] + part * (film->is_transparent ? 1.0 - light : 1.0), 1.0));
        for (int c = 0; c < 3; c++)
            pixel[c] = to_float(pixel[c] +
                                trc_sum_load(&caught->background[c]) / count * light * r->exposure);
    }
}

static void read_row(const struct reading *r, struct row row) {
    const struct trc_film *film = r->film;
    switch ((enum trc_pass_kind)r->info->kind) {
    case TRC_PASS_KIND_MATTE:
        read_mattes(r, row);
        break;
    case TRC_PASS_KIND_SHADOW:
        read_shadows(r, row);
        break;
    case TRC_PASS_KIND_COUNT:
        read_counts(r, row);
        break;
    case TRC_PASS_KIND_LIGHT:
    case TRC_PASS_KIND_MEAN:
    case TRC_PASS_KIND_HITS:
    case TRC_PASS_KIND_FIRST:
    case TRC_PASS_KIND_PLAIN:
        read_sums(r, row);
    }
    if (r->pass == TRC_PASS_COMBINED && film->caught && !film->shows_shadows)
        add_shadows(r, row);
    if (r->pass == TRC_PASS_DENOISING_ALBEDO)
        add_emission(r, row);
}

/* ---- tiles ---- */

unsigned trc_film_await_writer(const atomic_uint *sequence) {
    unsigned number;
    for (uint32_t looks = 0; !trc_sequence_read_begin(sequence, &number); looks++)
        if (looks >= LOOKS_BEFORE_YIELDING)
            sched_yield();
    return number;
}

static void read_tile(const struct reading *r, uint32_t tile_x, uint32_t tile_y) {
    const struct trc_film *film = r->film;
    const uint32_t x = tile_x * TRC_TILE_SIZE, y = tile_y * TRC_TILE_SIZE;
    const uint32_t width = film->width - x < TRC_TILE_SIZE ? film->width - x : TRC_TILE_SIZE;
    const uint32_t height = film->height - y < TRC_TILE_SIZE ? film->height - y : TRC_TILE_SIZE;
    const atomic_uint *sequence = trc_film_sequence(film, x, y);
    unsigned number;
    do {
        number = trc_film_await_writer(sequence);
        for (uint32_t j = y; j < y + height; j++) {
            const uint64_t first = (uint64_t)j * film->width + x;
            read_row(r, (struct row){first, first + width});
        }
    } while (!trc_sequence_is_whole(sequence, number));
}

trc_status trc_film_read(const struct trc_film *film, uint32_t pass, float exposure, float *out,
                         uint64_t float_count) {
    const struct trc_pass_info *info = trc_pass_info_of(pass);
    if (!info->channels)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "there is no pass %" PRIu32, pass);
    if (!has_pass(film, pass)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "pass %" PRIu32 " was not asked for", pass);
    }
    TRC_TRY(trc_check_array(out, float_count, (uint64_t)film->width * film->height * info->channels,
                            sizeof(float), sizeof(float), "pixels_out"));
    struct reading reading = {
        .film = film,
        .pass = pass,
        .info = info,
        .exposure = exposure,
        .is_clean = __atomic_load_n(&film->is_clean, __ATOMIC_ACQUIRE),
        .out = out,
    };
    if (info->kind == TRC_PASS_KIND_PLAIN) {
        reading.pass = TRC_PASS_COMBINED;
        reading.info = trc_pass_info_of(TRC_PASS_COMBINED);
        reading.is_clean = false;
    }
    for (uint32_t y = 0; y < trc_film_tiles(film->height); y++)
        for (uint32_t x = 0; x < trc_film_tiles(film->width); x++)
            read_tile(&reading, x, y);
    return TRC_OK;
}
