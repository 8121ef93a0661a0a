#define _POSIX_C_SOURCE 200809L
#include "film/film.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>
#include <unistd.h>

#include "core/checks.h"
#include "core/core.h"

/* Numbers of layers that TRC_PASS_CRYPTOMATTE keeps for each kind. */
#define MAX_LAYERS (TRC_MAX_CRYPTOMATTE_DEPTH / TRC_LAYER_RANKS)

/* Whether a pass is a layer of mattes. */
static bool is_cryptomatte(uint32_t pass) {
    return pass >= TRC_PASS_CRYPTOMATTE(0, 0) &&
           pass < TRC_PASS_CRYPTOMATTE(TRC_CRYPTOMATTE_KINDS, 0);
}

static bool is_aov_value(uint32_t pass) {
    return pass >= TRC_PASS_AOV_VALUE(0) && pass < TRC_PASS_AOV_VALUE(TRC_MAX_AOVS);
}
static bool is_aov_color(uint32_t pass) {
    return pass >= TRC_PASS_AOV_COLOR(0) && pass < TRC_PASS_AOV_COLOR(TRC_MAX_AOVS);
}

static bool is_light_group(uint32_t pass) {
    return pass >= TRC_PASS_LIGHT_GROUP(0) && pass < TRC_PASS_LIGHT_GROUP(TRC_MAX_LIGHT_GROUPS);
}

uint32_t trc_pass_channels(uint32_t pass) {
    static const uint8_t channels[TRC_PASS_COUNT] = {
        [TRC_PASS_COMBINED] = 4,
        [TRC_PASS_DEPTH] = 1,
        [TRC_PASS_NORMAL] = 3,
        [TRC_PASS_POSITION] = 3,
        [TRC_PASS_UV] = 3,
        [TRC_PASS_OBJECT_INDEX] = 1,
        [TRC_PASS_MATERIAL_INDEX] = 1,
        [TRC_PASS_EMISSION] = 3,
        [TRC_PASS_ENVIRONMENT] = 3,
        [TRC_PASS_DIFFUSE_DIRECT] = 3,
        [TRC_PASS_DIFFUSE_INDIRECT] = 3,
        [TRC_PASS_DIFFUSE_COLOR] = 3,
        [TRC_PASS_GLOSSY_DIRECT] = 3,
        [TRC_PASS_GLOSSY_INDIRECT] = 3,
        [TRC_PASS_GLOSSY_COLOR] = 3,
        [TRC_PASS_TRANSMISSION_DIRECT] = 3,
        [TRC_PASS_TRANSMISSION_INDIRECT] = 3,
        [TRC_PASS_TRANSMISSION_COLOR] = 3,
        [TRC_PASS_SAMPLE_COUNT] = 1,
        [TRC_PASS_MIST] = 1,
        [TRC_PASS_DENOISING_ALBEDO] = 3,
        [TRC_PASS_DENOISING_NORMAL] = 3,
        [TRC_PASS_DENOISING_DEPTH] = 1,
        [TRC_PASS_VECTOR] = 4,
        [TRC_PASS_AMBIENT_OCCLUSION] = 3,
        [TRC_PASS_SHADOW] = 3,
        [TRC_PASS_SHADOW_CATCHER] = 3,
    };
    if (is_cryptomatte(pass))
        return TRC_MATTE_CHANNELS;
    if (is_aov_value(pass))
        return 1;
    if (is_aov_color(pass))
        return 4;
    if (is_light_group(pass))
        return 3;
    return pass < TRC_PASS_COUNT ? channels[pass] : 0;
}

uint32_t trc_film_channels(uint32_t pass) {
    return trc_pass_channels(pass) + (pass == TRC_PASS_VECTOR);
}

bool trc_film_is_first_sample(uint32_t pass) {
    return pass == TRC_PASS_DEPTH || pass == TRC_PASS_POSITION || pass == TRC_PASS_OBJECT_INDEX ||
           pass == TRC_PASS_MATERIAL_INDEX;
}

/* Passes that are radiance: exposure scales them. */
static bool is_light(uint32_t pass) {
    switch (pass) {
    case TRC_PASS_COMBINED:
    case TRC_PASS_EMISSION:
    case TRC_PASS_ENVIRONMENT:
    case TRC_PASS_DIFFUSE_DIRECT:
    case TRC_PASS_DIFFUSE_INDIRECT:
    case TRC_PASS_GLOSSY_DIRECT:
    case TRC_PASS_GLOSSY_INDIRECT:
    case TRC_PASS_TRANSMISSION_DIRECT:
    case TRC_PASS_TRANSMISSION_INDIRECT:
        return true;
    default:
        return is_light_group(pass);
    }
}

bool trc_film_has_sums(const trc_render_desc *desc, uint32_t pass) {
    if (is_aov_value(pass))
        return pass - TRC_PASS_AOV_VALUE(0) < desc->aov_value_count;
    if (is_aov_color(pass))
        return pass - TRC_PASS_AOV_COLOR(0) < desc->aov_color_count;
    if (is_light_group(pass))
        return pass - TRC_PASS_LIGHT_GROUP(0) < desc->light_group_count;
    const bool is_sum = pass != TRC_PASS_SAMPLE_COUNT && pass != TRC_PASS_SHADOW_CATCHER;
    return pass < TRC_PASS_COUNT && is_sum && (desc->passes >> pass & 1);
}

/* Memory of the machine, or as good as none of a limit if the system does not say. */
static uint64_t physical_bytes(void) {
    const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGESIZE);
    if (pages <= 0 || page_bytes <= 0)
        return UINT64_MAX / 2;
    return (uint64_t)pages * (uint64_t)page_bytes;
}

trc_status trc_film_check_budget(uint32_t width, uint32_t height, uint64_t pixel_bytes) {
    uint64_t bytes = 0;
    const bool fits =
        trc_multiply_u64((uint64_t)width * height, pixel_bytes, &bytes) && bytes <= PTRDIFF_MAX;
    const uint64_t used = trc_memory_bytes(), physical = physical_bytes();
    if (!fits || used > physical || bytes > physical - used) {
        return trc_fail(TRC_ERROR_TOO_LARGE,
                        "%" PRIu32 " x %" PRIu32 " pixels with these settings need %" PRIu64
                        " MiB, the machine has %" PRIu64 " MiB in all",
                        width, height, bytes >> 20, physical >> 20);
    }
    return TRC_OK;
}

/* Bytes of a pixel. */
static uint64_t pixel_bytes(const trc_render_desc *desc, uint32_t matte_count) {
    uint64_t bytes = sizeof(uint32_t); /* its sample count */
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++) {
        if (trc_film_has_sums(desc, pass))
            bytes += trc_film_channels(pass) * sizeof(double);
    }
    return bytes + (uint64_t)__builtin_popcount(desc->cryptomattes) * matte_count *
                       sizeof(struct trc_matte);
}

static uint32_t matte_count(const trc_render_desc *desc) {
    const uint32_t layers = (desc->cryptomatte_depth + TRC_LAYER_RANKS - 1) / TRC_LAYER_RANKS;
    return desc->cryptomattes ? layers * TRC_LAYER_RANKS + TRC_SPARE_MATTES : 0;
}

trc_status trc_film_create(const trc_render_desc *desc, struct trc_film *film) {
    struct trc_film made = {.width = desc->crop_width,
                            .height = desc->crop_height,
                            .shows_counts = desc->passes >> TRC_PASS_SAMPLE_COUNT & 1,
                            .shows_shadows = desc->passes >> TRC_PASS_SHADOW_CATCHER & 1,
                            .is_transparent = desc->film_transparent,
                            .matte_count = matte_count(desc)};
    TRC_TRY(trc_film_check_budget(made.width, made.height, pixel_bytes(desc, made.matte_count)));
    const size_t pixels = (size_t)made.width * made.height;
    /* Tiles read the counts before they write them, and the sums only where there is a count. */
    made.sample_counts = trc_alloc(pixels, sizeof *made.sample_counts);
    bool ok = made.sample_counts != NULL;
    if (ok)
        memset(made.sample_counts, 0, pixels * sizeof *made.sample_counts);
    for (uint32_t pass = 0; ok && pass < TRC_SUM_COUNT; pass++) {
        if (!trc_film_has_sums(desc, pass))
            continue;
        made.sums[pass] = trc_alloc_zeroed(pixels, trc_film_channels(pass) * sizeof(double));
        ok = made.sums[pass] != NULL;
    }
    for (uint32_t kind = 0; ok && kind < TRC_CRYPTOMATTE_KINDS; kind++) {
        if (!(desc->cryptomattes >> kind & 1))
            continue;
        made.mattes[kind] = trc_alloc_zeroed(pixels, made.matte_count * sizeof(struct trc_matte));
        ok = made.mattes[kind] != NULL;
    }
    if (!ok) {
        trc_film_destroy(&made);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the film");
    }
    *film = made;
    return TRC_OK;
}

trc_status trc_film_add_catchers(struct trc_film *film) {
    TRC_TRY(trc_film_check_budget(film->width, film->height, sizeof *film->caught));
    film->caught = trc_alloc_zeroed((size_t)film->width * film->height, sizeof *film->caught);
    return film->caught ? TRC_OK
                        : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for shadow catchers");
}

void trc_film_destroy(struct trc_film *film) {
    trc_free(film->caught);
    for (uint32_t pass = 0; pass < TRC_SUM_COUNT; pass++)
        trc_free(film->sums[pass]);
    for (uint32_t kind = 0; kind < TRC_CRYPTOMATTE_KINDS; kind++)
        trc_free(film->mattes[kind]);
    trc_free(film->sample_counts);
    memset(film, 0, sizeof *film);
}

static float to_float(double value) {
    if (!(value > -FLT_MAX))
        return value <= -FLT_MAX ? -FLT_MAX : 0.0f; /* NaN: 0 */
    return value < FLT_MAX ? (float)value : FLT_MAX;
}

/* Tiles may be writing: each number is read once, whole, with no order among them. */
static double load_sum(const double *p) {
    double value;
    __atomic_load(p, &value, __ATOMIC_RELAXED);
    return value;
}

/* The sums that a light pass is divided by, as Cycles divides it: the colour of its kind; NULL:
 * none. */
static const double *divisor_of(const struct trc_film *film, uint32_t pass) {
    const uint32_t color = trc_film_color_pass(pass);
    return color != TRC_PASS_COMBINED && color != pass ? film->sums[color] : NULL;
}

uint32_t trc_film_color_pass(uint32_t pass) {
    if (pass < TRC_PASS_DIFFUSE_DIRECT || pass > TRC_PASS_TRANSMISSION_COLOR)
        return TRC_PASS_COMBINED;
    /* direct, indirect, colour of one kind stand together */
    return pass + 2 - (pass - TRC_PASS_DIFFUSE_DIRECT) % 3;
}

static bool has_pass(const struct trc_film *film, uint32_t pass) {
    if (pass == TRC_PASS_SAMPLE_COUNT)
        return film->shows_counts;
    if (pass == TRC_PASS_SHADOW_CATCHER)
        return film->shows_shadows;
    if (!is_cryptomatte(pass))
        return film->sums[pass] != NULL;
    const uint32_t number = pass - TRC_PASS_CRYPTOMATTE(0, 0), layer = number % MAX_LAYERS;
    return film->mattes[number / MAX_LAYERS] &&
           layer * TRC_LAYER_RANKS + TRC_SPARE_MATTES < film->matte_count;
}

static void read_mattes(const struct trc_film *film, uint32_t pass, float *out) {
    const uint32_t number = pass - TRC_PASS_CRYPTOMATTE(0, 0);
    const struct trc_matte *mattes = film->mattes[number / MAX_LAYERS];
    const uint64_t pixels = (uint64_t)film->width * film->height;
    for (uint64_t i = 0; i < pixels; i++) {
        const uint32_t samples = __atomic_load_n(&film->sample_counts[i], __ATOMIC_RELAXED);
        trc_mattes_read(mattes + i * film->matte_count, film->matte_count, number % MAX_LAYERS,
                        samples, out + i * TRC_MATTE_CHANNELS);
    }
}

/* Passes that are sums or values of samples. */
static void read_sums(const struct trc_film *film, uint32_t pass, float exposure, float *out) {
    const uint32_t channels = trc_pass_channels(pass);
    const uint64_t pixels = (uint64_t)film->width * film->height;
    const double *sums = film->sums[pass], *divisor = divisor_of(film, pass);
    const double light = is_light(pass) ? exposure : 1.0;
    const bool first_sample = trc_film_is_first_sample(pass);
    const uint32_t stride = trc_film_channels(pass);
    for (uint64_t i = 0; i < pixels; i++) {
        const uint32_t count = __atomic_load_n(&film->sample_counts[i], __ATOMIC_RELAXED);
        float *pixel = out + i * channels;
        if (pass == TRC_PASS_SAMPLE_COUNT) {
            pixel[0] = (float)count;
            continue;
        }
        double weight = first_sample ? 1.0 : count;
        if (pass == TRC_PASS_VECTOR)
            weight = load_sum(&sums[i * stride + channels]);
        const double factor = count && weight > 0.0 ? 1.0 / weight : 0.0;
        for (uint32_t c = 0; c < channels; c++) {
            const bool is_alpha = pass == TRC_PASS_COMBINED && c == 3;
            double value = load_sum(&sums[i * stride + c]);
            if (divisor) {
                /* Both are sums of the same samples: the counts cancel. */
                const double by = load_sum(&divisor[i * channels + c]);
                value = by != 0.0 ? value / by * count : 0.0;
            }
            pixel[c] = count ? to_float(value * factor * (is_alpha ? 1.0 : light)) : 0.0f;
        }
    }
}

/* ---- shadow catchers ---- */

/* What is left of the footage's light where catchers stand for it; 1 where they have no light. */
static void remains_of(const struct trc_caught *caught, double remains[3]) {
    for (int c = 0; c < 3; c++) {
        const double unblocked = load_sum(&caught->unblocked[c]);
        remains[c] = unblocked != 0.0 ? load_sum(&caught->blocked[c]) / unblocked : 1.0;
    }
}

/* What the footage is to be multiplied by: a pixel's mean over what the picture does not cover. */
static void read_shadows(const struct trc_film *film, float *out) {
    const uint64_t pixels = (uint64_t)film->width * film->height;
    for (uint64_t i = 0; i < pixels; i++) {
        double remains[3] = {1.0, 1.0, 1.0}, part = 0.0;
        if (film->caught) {
            const uint32_t count = __atomic_load_n(&film->sample_counts[i], __ATOMIC_RELAXED);
            const double open = count - load_sum(&film->sums[TRC_PASS_COMBINED][4 * i + 3]);
            remains_of(&film->caught[i], remains);
            part = open > 0.0 ? fmin(load_sum(&film->caught[i].coverage) / open, 1.0) : 0.0;
        }
        for (int c = 0; c < 3; c++)
            out[3 * i + c] = to_float(1.0 + part * (remains[c] - 1.0));
    }
}

/* Adds to the picture what catchers do to it: cover it, as grey as a shadow can be by alpha alone,
 * or where the world is shown, let it through in part. */
static void add_shadows(const struct trc_film *film, float exposure, float *combined) {
    const uint64_t pixels = (uint64_t)film->width * film->height;
    for (uint64_t i = 0; i < pixels; i++) {
        const struct trc_caught *caught = &film->caught[i];
        const uint32_t count = __atomic_load_n(&film->sample_counts[i], __ATOMIC_RELAXED);
        const double part = count ? load_sum(&caught->coverage) / count : 0.0;
        if (!(part > 0.0))
            continue;
        double remains[3];
        remains_of(caught, remains);
        const double light = fmin(fmax((remains[0] + remains[1] + remains[2]) / 3.0, 0.0), 1.0);
        float *pixel = combined + 4 * i;
        pixel[3] = to_float(pixel[3] + part * (film->is_transparent ? 1.0 - light : 1.0));
        for (int c = 0; c < 3; c++)
            pixel[c] =
                to_float(pixel[c] + load_sum(&caught->background[c]) / count * light * exposure);
    }
}

trc_status trc_film_read(const struct trc_film *film, uint32_t pass, float exposure, float *out,
                         uint64_t float_count) {
    const uint32_t channels = trc_pass_channels(pass);
    if (!channels)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "there is no pass %" PRIu32, pass);
    if (!has_pass(film, pass)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "pass %" PRIu32 " was not asked for", pass);
    }
    TRC_TRY(trc_check_array(out, float_count, (uint64_t)film->width * film->height * channels,
                            sizeof(float), sizeof(float), "pixels_out"));
    if (is_cryptomatte(pass))
        read_mattes(film, pass, out);
    else if (pass == TRC_PASS_SHADOW_CATCHER)
        read_shadows(film, out);
    else
        read_sums(film, pass, exposure, out);
    if (pass == TRC_PASS_COMBINED && film->caught && !film->shows_shadows)
        add_shadows(film, exposure, out);
    return TRC_OK;
}
