/* What a film shows while it gathers samples, quickly reconstructed (model/denoise.h). */
#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"
#include "film/film.h"
#include "model/kernels.h"
#include "model/sequence.h"

/* So many strips for each thread keep all busy to the end, but a strip has so many rows: with
 * fewer, most of what is filtered are rows around it. */
#define STRIPS_PER_THREAD 2
#define LEAST_STRIP_HEIGHT 64
/* Pixels of the widest vector. */
#define VECTOR 16

struct preview {
    uint32_t strip_width, strip_height;
    const struct trc_film *film;
    const struct trc_kernels *kernels;
    float exposure;
    float *memory; /* planes of each worker */
    float *out;
};

/* Pixels [x, x_end) of a row, counted from a strip, that are in one tile of the film. */
struct run {
    int x, x_end, y;
    size_t pixel; /* the first */
};

/* The run that begins at a place of the strip and ends by x_end. */
static struct run run_of(const struct preview *p, int64_t left, int64_t bottom, int x, int y,
                         int x_end) {
    const struct trc_film *film = p->film;
    const uint32_t first = trc_mirror(left + x, film->width);
    struct run run = {x, x + 1, y,
                      (size_t)trc_mirror(bottom + y, film->height) * film->width + first};
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
        p->kernels->preview_load(film, run->pixel, run->x_end - run->x,
                                 memory + trc_preview_at(run->x, run->y));
    } while (!trc_sequence_is_whole(sequence, number));
}

static void load_row(const struct preview *p, uint32_t left, uint32_t bottom, int y,
                     float *memory) {
    const int end = (int)p->strip_width + TRC_PREVIEW_HALO;
    for (int x = -TRC_PREVIEW_HALO; x < end;) {
        const struct run run = run_of(p, left, bottom, x, y, end);
        load_run(p, &run, memory);
        x = run.x_end;
    }
}

static void store_row(const struct preview *p, uint32_t left, uint32_t bottom, int y,
                      const float *memory) {
    const struct trc_film *film = p->film;
    const uint32_t right = film->width - left;
    p->kernels->preview_store(memory + trc_preview_at(0, y),
                              (int)(right < p->strip_width ? right : p->strip_width),
                              p->out + 4 * ((size_t)(bottom + (uint32_t)y) * film->width + left));
}

static uint32_t strips_along(uint32_t pixels, uint32_t size) {
    return (uint32_t)(((uint64_t)pixels + size - 1) / size);
}

static void show_strip(void *context, uint32_t index, uint32_t worker) {
    const struct preview *p = context;
    const uint32_t across = strips_along(p->film->width, p->strip_width);
    const uint32_t left = index % across * p->strip_width;
    const uint32_t bottom = index / across * p->strip_height;
    const uint32_t rest = p->film->height - bottom;
    const int height = (int)(rest < p->strip_height ? rest : p->strip_height);
    float *memory = p->memory + (size_t)worker * TRC_PREVIEW_PLANES * TRC_PREVIEW_FLOATS;
    for (int y = -TRC_PREVIEW_HALO; y < height + TRC_PREVIEW_HALO; y++) {
        load_row(p, left, bottom, y, memory);
        p->kernels->preview_filter(memory, (int)p->strip_width, y, p->exposure);
        if (y >= TRC_PREVIEW_HALO)
            store_row(p, left, bottom, y - TRC_PREVIEW_HALO, memory);
    }
}

/* Pixels of a strip's row, in whole vectors: as few strips side by side as there can be, all alike.
 */
static uint32_t strip_width(const struct trc_film *film) {
    const uint32_t across = strips_along(film->width, TRC_PREVIEW_MAX_WIDTH);
    return strips_along(strips_along(film->width, across), VECTOR) * VECTOR;
}

/* Rows of a strip. What is shown does not depend on it. */
static uint32_t strip_height(const struct trc_film *film, uint32_t across, uint32_t thread_count) {
    const uint32_t rows = strips_along(STRIPS_PER_THREAD * thread_count, across);
    const uint32_t height = strips_along(film->height, rows ? rows : 1);
    return height < LEAST_STRIP_HEIGHT ? LEAST_STRIP_HEIGHT : height;
}

trc_status trc_film_read_preview(const struct trc_film *film, const struct trc_kernels *kernels,
                                 uint32_t thread_count, float exposure, float *out,
                                 uint64_t float_count) {
    if (!film->halves || film->caught)
        return trc_film_read(film, TRC_PASS_COMBINED, exposure, out, float_count);
    TRC_TRY(trc_check_array(out, float_count, (uint64_t)film->width * film->height * 4,
                            sizeof(float), sizeof(float), "pixels_out"));
    struct preview preview = {.strip_width = strip_width(film),
                              .film = film,
                              .kernels = kernels,
                              .exposure = exposure,
                              .out = out};
    const uint32_t across = strips_along(film->width, preview.strip_width);
    preview.strip_height = strip_height(film, across, thread_count);
    const uint32_t strips = across * strips_along(film->height, preview.strip_height);
    struct trc_pool *pool;
    TRC_TRY(trc_pool_create(thread_count < strips ? thread_count : strips, &pool));
    preview.memory = trc_alloc_zeroed(trc_pool_thread_count(pool),
                                      TRC_PREVIEW_PLANES * TRC_PREVIEW_FLOATS * sizeof(float));
    if (preview.memory)
        trc_pool_run(pool, strips, show_strip, &preview);
    trc_pool_destroy(pool);
    const bool ok = preview.memory != NULL;
    trc_free(preview.memory);
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for reconstruction");
}
