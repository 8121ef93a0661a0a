/* What a film shows while it gathers samples, quickly reconstructed (model/denoise.h). */
#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"
#include "film/film.h"
#include "model/kernels.h"
#include "model/sequence.h"

/* Rows of a strip: more are filtered with fewer around them, fewer keep more threads busy. */
#define STRIP_HEIGHT 128

struct preview {
    const struct trc_film *film;
    const struct trc_kernels *kernels;
    float exposure;
    float *memory; /* planes of each worker */
    float *out;
};

static float load_float(const float *p) {
    float value;
    __atomic_load(p, &value, __ATOMIC_RELAXED);
    return value;
}

static void load_sums(const double *sums, uint32_t channels, float *plane) {
    for (uint32_t k = 0; k < channels; k++)
        plane[k * TRC_PREVIEW_FLOATS] = (float)trc_sum_load(&sums[k]);
}

/* Asks for what the pixel above will take: a row is too short for processors to look ahead. */
static void fetch_pixel(const struct trc_film *film, size_t pixel) {
    const size_t next = pixel + film->width;
    if (next >= (size_t)film->width * film->height)
        return;
    __builtin_prefetch(film->sums[TRC_PASS_COMBINED] + 4 * next);
    if (film->guides != TRC_GUIDES_NONE)
        __builtin_prefetch(film->sums[TRC_PASS_DENOISING_ALBEDO] + 3 * next);
    if (film->guides == TRC_GUIDES_ALBEDO_NORMAL) {
        __builtin_prefetch(film->sums[TRC_PASS_DENOISING_NORMAL] + 3 * next);
        __builtin_prefetch(film->sums[TRC_PASS_DENOISING_DEPTH] + next);
    }
    __builtin_prefetch(&film->halves[next]);
    __builtin_prefetch(&film->sample_counts[next]);
}

/* A pixel of the film into planes that begin at its place. */
static void load_pixel(const struct trc_film *film, size_t pixel, float *at) {
    load_sums(film->sums[TRC_PASS_COMBINED] + 4 * pixel, 4,
              at + TRC_PREVIEW_COLOR * TRC_PREVIEW_FLOATS);
    if (film->guides != TRC_GUIDES_NONE)
        load_sums(film->sums[TRC_PASS_DENOISING_ALBEDO] + 3 * pixel, 3,
                  at + TRC_PREVIEW_ALBEDO * TRC_PREVIEW_FLOATS);
    if (film->guides == TRC_GUIDES_ALBEDO_NORMAL) {
        load_sums(film->sums[TRC_PASS_DENOISING_NORMAL] + 3 * pixel, 3,
                  at + TRC_PREVIEW_NORMAL * TRC_PREVIEW_FLOATS);
        load_sums(film->sums[TRC_PASS_DENOISING_DEPTH] + pixel, 1,
                  at + TRC_PREVIEW_DEPTH * TRC_PREVIEW_FLOATS);
    }
    const struct trc_half *half = &film->halves[pixel];
    at[TRC_PREVIEW_HALF * TRC_PREVIEW_FLOATS] =
        load_float(&half->light[0]) + load_float(&half->light[1]) + load_float(&half->light[2]);
    at[TRC_PREVIEW_HALF_COUNT * TRC_PREVIEW_FLOATS] =
        (float)__atomic_load_n(&half->count, __ATOMIC_RELAXED);
    at[TRC_PREVIEW_COUNT * TRC_PREVIEW_FLOATS] =
        (float)__atomic_load_n(&film->sample_counts[pixel], __ATOMIC_RELAXED);
}

/* Pixels [x, x_end) of a row, counted from a strip, that are in one tile of the film. */
struct run {
    int x, x_end, y;
    size_t pixel; /* the first */
    int step;     /* to the next one: -1 in the frame's mirror image */
};

/* The run that begins at a place of the strip and ends by x_end. */
static struct run run_of(const struct preview *p, int64_t left, int64_t bottom, int x, int y,
                         int x_end) {
    const struct trc_film *film = p->film;
    const uint32_t first = trc_mirror(left + x, film->width);
    struct run run = {x, x + 1, y,
                      (size_t)trc_mirror(bottom + y, film->height) * film->width + first, 1};
    const bool inside = left + x >= 0 && left + x < film->width;
    const uint32_t end = (first / TRC_TILE_SIZE + 1) * TRC_TILE_SIZE;
    if (inside)
        run.x_end = x + (int)((end < film->width ? end : film->width) - first);
    if (run.x_end > x_end)
        run.x_end = x_end;
    return run;
}

static void load_run(const struct preview *p, const struct run *run, float *memory) {
    const struct trc_film *film = p->film;
    const atomic_uint *sequence = trc_film_sequence(film, (uint32_t)(run->pixel % film->width),
                                                    (uint32_t)(run->pixel / film->width));
    unsigned number;
    do {
        number = trc_film_await_writer(sequence);
        for (int x = run->x; x < run->x_end; x++)
            fetch_pixel(film, run->pixel + (size_t)(x - run->x));
        for (int x = run->x; x < run->x_end; x++)
            load_pixel(film, run->pixel + (size_t)(x - run->x), memory + trc_preview_at(x, run->y));
    } while (!trc_sequence_is_whole(sequence, number));
}

static void load_row(const struct preview *p, uint32_t left, uint32_t bottom, int y,
                     float *memory) {
    for (int x = -TRC_PREVIEW_HALO; x < TRC_PREVIEW_WIDTH + TRC_PREVIEW_HALO;) {
        const struct run run = run_of(p, left, bottom, x, y, TRC_PREVIEW_WIDTH + TRC_PREVIEW_HALO);
        load_run(p, &run, memory);
        x = run.x_end;
    }
}

static void store_row(const struct preview *p, uint32_t left, uint32_t bottom, int y,
                      const float *memory) {
    const struct trc_film *film = p->film;
    for (uint32_t x = 0; x < TRC_PREVIEW_WIDTH && left + x < film->width; x++) {
        float *out = p->out + 4 * ((size_t)(bottom + (uint32_t)y) * film->width + left + x);
        const float *from = memory + trc_preview_at((int)x, y);
        for (int c = 0; c < 4; c++)
            out[c] = from[c * TRC_PREVIEW_FLOATS];
    }
}

static uint32_t strips_along(uint32_t pixels, uint32_t size) {
    return (uint32_t)(((uint64_t)pixels + size - 1) / size);
}

static void show_strip(void *context, uint32_t index, uint32_t worker) {
    const struct preview *p = context;
    const uint32_t across = strips_along(p->film->width, TRC_PREVIEW_WIDTH);
    const uint32_t left = index % across * TRC_PREVIEW_WIDTH;
    const uint32_t bottom = index / across * STRIP_HEIGHT, rest = p->film->height - bottom;
    const int height = (int)(rest < STRIP_HEIGHT ? rest : STRIP_HEIGHT);
    float *memory = p->memory + (size_t)worker * TRC_PREVIEW_PLANES * TRC_PREVIEW_FLOATS;
    for (int y = -TRC_PREVIEW_HALO; y < height + TRC_PREVIEW_HALO; y++) {
        load_row(p, left, bottom, y, memory);
        p->kernels->preview_filter(memory, y, p->exposure);
        if (y >= TRC_PREVIEW_HALO)
            store_row(p, left, bottom, y - TRC_PREVIEW_HALO, memory);
    }
}

trc_status trc_film_read_preview(const struct trc_film *film, const struct trc_kernels *kernels,
                                 uint32_t thread_count, float exposure, float *out,
                                 uint64_t float_count) {
    if (!film->halves || film->caught)
        return trc_film_read(film, TRC_PASS_COMBINED, exposure, out, float_count);
    TRC_TRY(trc_check_array(out, float_count, (uint64_t)film->width * film->height * 4,
                            sizeof(float), sizeof(float), "pixels_out"));
    const uint32_t strips =
        strips_along(film->width, TRC_PREVIEW_WIDTH) * strips_along(film->height, STRIP_HEIGHT);
    struct trc_pool *pool;
    TRC_TRY(trc_pool_create(thread_count < strips ? thread_count : strips, &pool));
    struct preview preview = {film, kernels, exposure, NULL, out};
    preview.memory = trc_alloc_zeroed(trc_pool_thread_count(pool),
                                      TRC_PREVIEW_PLANES * TRC_PREVIEW_FLOATS * sizeof(float));
    if (preview.memory)
        trc_pool_run(pool, strips, show_strip, &preview);
    trc_pool_destroy(pool);
    const bool ok = preview.memory != NULL;
    trc_free(preview.memory);
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for reconstruction");
}
