#include "render/render.h"

#include <math.h>
#include <pthread.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/system.h"
#include "core/thread.h"
#include "film/part.h"
#include "model/filter.h"
#include "model/kernels.h"
#include "model/sobol.h"
#include "render/schedule.h"
#include "scene/commit.h"

/* Most samples of one call of a kernel: progress of a long tile shows after each. */
#define SAMPLES_PER_JOB 16

struct worker {
    struct trc_render_state *render;
    pthread_t thread;
    void *memory; /* scratch of the kernels */
};

struct trc_render_state {
    struct trc_snapshot *snapshot;
    trc_render_desc desc;
    const struct trc_kernels *kernels;
    struct trc_film film;
    struct trc_adaptive adaptive; /* without pixels: off */
    struct trc_extra extra;       /* without levels: off */
    struct trc_denoise denoise;   /* without film: off */
    struct trc_schedule schedule;
    uint32_t *sampler_table;
    float filter_table[TRC_FILTER_TABLE];
    uint32_t worker_count, started_count;
    struct worker *workers;
    atomic_uint cancel;
    atomic_uint_fast64_t next_item, next_denoise_item;

    pthread_mutex_t lock; /* all below */
    pthread_cond_t tile_done;
    pthread_cond_t ended;
    uint32_t *tile_batches; /* batches done of each tile */
    uint32_t *batch_tiles;  /* tiles done of each batch */
    uint32_t lowest_batch;  /* first batch that not all tiles have */
    uint32_t tiles_done;    /* with all their batches */
    uint64_t denoise_done;  /* tiles of all steps of reconstruction */
    uint64_t pixel_samples_done;
    uint64_t extra_planned; /* extra samples of all pixels */
    bool is_planned;        /* that and the levels are there */
    uint32_t merged_count;  /* samples that parts brought */
    struct trc_tile_counts counts;
    uint32_t version, state;
    uint32_t running_count; /* threads that have not ended, and the starter */
    double time_start, time_end;
};

trc_render_desc trc_render_resolve(const trc_render_desc *desc) {
    trc_render_desc r = *desc;
    if (!r.crop_width) {
        r.crop_x = r.crop_y = 0;
        r.crop_width = r.width;
        r.crop_height = r.height;
    }
    if (!r.light_samples)
        r.light_samples = TRC_DEFAULT_LIGHT_SAMPLES;
    if (!r.packet_size)
        r.packet_size = TRC_DEFAULT_PACKET_SIZE;
    if (r.noise_threshold > 0.0f) {
        r.min_samples = trc_adaptive_min_samples(r.noise_threshold, r.min_samples);
        if (r.min_samples >= r.sample_count)
            r.noise_threshold = 0.0f;
    }
    if (!r.sample_subset)
        r.sample_subset = r.sample_count - r.sample_offset;
    if (r.progressive || r.noise_threshold > 0.0f || trc_film_is_part(&r) ||
        r.sample_count < TRC_EXTRA_MIN_SAMPLES)
        r.extra_samples = 0.0f;
    if (!r.thread_count)
        r.thread_count = trc_thread_processor_count();
    if (r.max_shadow_depth == UINT32_MAX)
        r.max_shadow_depth = r.max_transparent_depth;
    uint32_t *depths[] = {&r.max_depth, &r.max_transparent_depth, &r.max_shadow_depth,
                          &r.max_glossy_depth, &r.max_transmission_depth};
    for (size_t i = 0; i < sizeof depths / sizeof *depths; i++) {
        if (*depths[i] > TRC_MAX_DEPTH)
            *depths[i] = TRC_MAX_DEPTH;
    }
    r.passes = trc_passes_with_colors(r.passes) | UINT64_C(1) << TRC_PASS_COMBINED;
    if (r.denoise)
        r.passes |= TRC_DENOISE_PASSES;
    return r;
}

/* ---- the threads ---- */

/* Waits until the tile has all batches before this one; false if the render is cancelled. */
static bool await_former_batch(struct trc_render_state *render, uint32_t tile, uint32_t batch) {
    pthread_mutex_lock(&render->lock);
    while (render->tile_batches[tile] < batch && !atomic_load(&render->cancel)) {
        pthread_cond_wait(&render->tile_done, &render->lock);
    }
    pthread_mutex_unlock(&render->lock);
    return !atomic_load(&render->cancel);
}

/* pixels: that the job took samples of. */
static void add_counts(struct trc_render_state *render, const struct trc_tile_job *job,
                       uint32_t pixels, bool complete) {
    const struct trc_tile_counts *c = &job->counts;
    pthread_mutex_lock(&render->lock);
    render->counts.rays_camera += c->rays_camera;
    render->counts.rays_shadow += c->rays_shadow;
    render->counts.rays_reflection += c->rays_reflection;
    render->counts.rays_refraction += c->rays_refraction;
    render->counts.dropped_samples += c->dropped_samples;
    render->counts.seconds_trace += c->seconds_trace;
    render->counts.seconds_shade += c->seconds_shade;
    render->counts.seconds_other += c->seconds_other;
    if (complete)
        render->pixel_samples_done += (uint64_t)pixels * (job->sample_end - job->sample_begin);
    pthread_mutex_unlock(&render->lock);
}

/* Finds who gets extra samples, once all tiles have theirs. */
static void plan_extra(struct trc_render_state *render) {
    const uint64_t planned = trc_extra_plan(&render->extra, &render->film);
    pthread_mutex_lock(&render->lock);
    render->extra_planned = planned;
    render->is_planned = true;
    pthread_cond_broadcast(&render->tile_done);
    pthread_mutex_unlock(&render->lock);
}

/* Waits for the plan of extra samples; false if the render is cancelled. */
static bool await_plan(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    while (!render->is_planned && !atomic_load(&render->cancel))
        pthread_cond_wait(&render->tile_done, &render->lock);
    pthread_mutex_unlock(&render->lock);
    return !atomic_load(&render->cancel);
}

static void finish_item(struct trc_render_state *render, uint32_t tile, uint32_t batch) {
    const struct trc_schedule *schedule = &render->schedule;
    pthread_mutex_lock(&render->lock);
    render->tile_batches[tile] = batch + 1;
    if (batch + 1 == schedule->batch_count)
        render->tiles_done++;
    render->batch_tiles[batch]++;
    while (render->lowest_batch < schedule->batch_count &&
           render->batch_tiles[render->lowest_batch] == schedule->tile_count) {
        render->lowest_batch++;
    }
    const bool is_base = batch == 0 && render->lowest_batch > 0;
    render->version++;
    pthread_cond_broadcast(&render->tile_done);
    pthread_mutex_unlock(&render->lock);
    if (is_base && render->extra.levels)
        plan_extra(render);
}

/* Samples of a tile. */
struct sample_range {
    uint32_t begin, end; /* counted from the render's first */
    uint32_t level;      /* 0: of all pixels, else of those with that level of extra samples */
    uint32_t pixels;     /* how many these are */
};

/* False if the render was cancelled before the end. */
static bool render_samples(struct trc_render_state *render, const struct trc_tile_area *area,
                           struct sample_range range, void *memory) {
    struct trc_tile_job job = {
        .snapshot = render->snapshot,
        .desc = &render->desc,
        .sampler_table = render->sampler_table,
        .filter_table = render->filter_table,
        .film = &render->film,
        .adaptive = render->adaptive.pixels ? &render->adaptive : NULL,
        .extra = range.level ? &render->extra : NULL,
        .extra_level = range.level,
        .x = area->x,
        .y = area->y,
        .width = area->width,
        .height = area->height,
        .sample_begin = render->schedule.sample_begin + range.begin,
        .sample_end = render->schedule.sample_begin + range.end,
        .memory = memory,
        .cancel = &render->cancel,
    };
    render->kernels->tile_render(&job);
    const bool complete = !atomic_load(&render->cancel);
    if (render->extra.levels && !range.level)
        *trc_extra_tile_rays(&render->extra, area->x, area->y) +=
            job.counts.rays_camera + job.counts.rays_shadow + job.counts.rays_reflection +
            job.counts.rays_refraction;
    add_counts(render, &job, range.pixels, complete);
    return complete;
}

/* All samples of an item; false if the render was cancelled before the end. */
static bool render_item(struct trc_render_state *render, uint32_t tile, uint32_t batch,
                        void *memory) {
    const struct trc_schedule *schedule = &render->schedule;
    const struct trc_tile_area a = trc_schedule_tile(schedule, tile);
    const uint32_t end = trc_schedule_batch_begin(schedule, batch + 1);
    struct sample_range range = {.begin = trc_schedule_batch_begin(schedule, batch),
                                 .level = schedule->extra_batches ? batch : 0,
                                 .pixels = a.width * a.height};
    if (range.level) {
        if (!await_plan(render))
            return false;
        range.pixels = trc_extra_pixels(&render->extra, a.x, a.y, a.width, a.height, range.level);
    }
    for (; range.pixels && range.begin < end; range.begin = range.end) {
        range.end = end - range.begin < SAMPLES_PER_JOB ? end : range.begin + SAMPLES_PER_JOB;
        if (!render_samples(render, &a, range, memory))
            return false;
    }
    return true;
}

/* The same with adaptive sampling: stops at its stages to decide, and when no pixel is left. */
static bool render_item_adaptive(struct trc_render_state *render, uint32_t tile, uint32_t batch,
                                 void *memory) {
    const struct trc_schedule *schedule = &render->schedule;
    struct trc_adaptive *adaptive = &render->adaptive;
    const struct trc_tile_area a = trc_schedule_tile(schedule, tile);
    const uint32_t end = trc_schedule_batch_begin(schedule, batch + 1);
    uint32_t i = trc_schedule_batch_begin(schedule, batch);
    while (i < end && trc_adaptive_tile_runs(adaptive, a.x, a.y, a.width, a.height)) {
        const uint32_t stage = trc_adaptive_next_stage(adaptive, i);
        uint32_t next = end - i < SAMPLES_PER_JOB ? end : i + SAMPLES_PER_JOB;
        next = next < stage ? next : stage;
        const struct sample_range range = {i, next, 0, a.width * a.height};
        if (!render_samples(render, &a, range, memory))
            return false;
        if (next == stage)
            trc_adaptive_update(adaptive, a.x, a.y, a.width, a.height, stage);
        i = next;
    }
    pthread_mutex_lock(&render->lock);
    render->pixel_samples_done += (uint64_t)a.width * a.height * (end - i);
    pthread_mutex_unlock(&render->lock);
    return true;
}

/* ---- reconstruction ---- */

/* Tiles of all steps. */
static uint64_t denoise_item_count(const struct trc_render_state *render) {
    return (uint64_t)render->denoise.step_count * render->schedule.tile_count;
}

/* Waits until all tiles are through what comes before a step; false if the render is cancelled. */
static bool await_former_step(struct trc_render_state *render, uint32_t step) {
    const uint32_t tile_count = render->schedule.tile_count;
    pthread_mutex_lock(&render->lock);
    while (
        (render->tiles_done < tile_count || render->denoise_done < (uint64_t)step * tile_count) &&
        !atomic_load(&render->cancel))
        pthread_cond_wait(&render->tile_done, &render->lock);
    pthread_mutex_unlock(&render->lock);
    return !atomic_load(&render->cancel);
}

static void finish_denoise_item(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    if (++render->denoise_done == denoise_item_count(render)) {
        __atomic_store_n(&render->film.is_clean, 1, __ATOMIC_RELEASE);
        render->version++;
    }
    pthread_cond_broadcast(&render->tile_done);
    pthread_mutex_unlock(&render->lock);
}

/* Takes tiles of the steps in their order until none is left. */
static void reconstruct(struct trc_render_state *render, void *memory) {
    const uint64_t item_count = denoise_item_count(render);
    while (!atomic_load(&render->cancel)) {
        const uint64_t item = atomic_fetch_add(&render->next_denoise_item, 1);
        if (item >= item_count)
            return;
        const uint32_t tile_count = render->schedule.tile_count;
        const uint32_t step = (uint32_t)(item / tile_count);
        if (!await_former_step(render, step))
            return;
        const struct trc_tile_area area =
            trc_schedule_tile(&render->schedule, (uint32_t)(item % tile_count));
        const struct trc_denoise_job job = {&render->denoise, step,        area.x, area.y,
                                            area.width,       area.height, memory};
        render->kernels->denoise_tile(&job);
        finish_denoise_item(render);
    }
}

/* Under the lock. state: TRC_PROGRESS_DONE or TRC_PROGRESS_CANCELLED. */
static void end(struct trc_render_state *render, uint32_t state) {
    render->state = state;
    render->time_end = trc_seconds();
    pthread_cond_broadcast(&render->ended);
}

/* The last one to leave ends the render. */
static void leave(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    if (--render->running_count == 0) {
        const bool complete = render->tiles_done == render->schedule.tile_count &&
                              render->denoise_done == denoise_item_count(render);
        end(render, complete ? TRC_PROGRESS_DONE : TRC_PROGRESS_CANCELLED);
    }
    pthread_mutex_unlock(&render->lock);
}

static void worker_main(void *context) {
    const struct worker *worker = context;
    struct trc_render_state *render = worker->render;
    const struct trc_schedule *schedule = &render->schedule;
    const uint64_t item_count = (uint64_t)schedule->batch_count * schedule->tile_count;
    while (!atomic_load(&render->cancel)) {
        const uint64_t item = atomic_fetch_add(&render->next_item, 1);
        if (item >= item_count)
            break;
        const uint32_t batch = (uint32_t)(item / schedule->tile_count);
        const uint32_t tile = schedule->order[item % schedule->tile_count];
        if (!await_former_batch(render, tile, batch))
            break;
        const bool complete = render->adaptive.pixels
                                  ? render_item_adaptive(render, tile, batch, worker->memory)
                                  : render_item(render, tile, batch, worker->memory);
        if (!complete)
            break;
        finish_item(render, tile, batch);
    }
    reconstruct(render, worker->memory);
    leave(render);
}

/* ---- start ---- */

static trc_status init_sync(struct trc_render_state *render) {
    if (pthread_mutex_init(&render->lock, NULL))
        goto fail;
    if (pthread_cond_init(&render->tile_done, NULL))
        goto fail_lock;
    if (!trc_system_create_condition(&render->ended))
        goto fail_tile_done;
    return TRC_OK;
fail_tile_done:
    pthread_cond_destroy(&render->tile_done);
fail_lock:
    pthread_mutex_destroy(&render->lock);
fail:
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "the system has no resources for a render");
}

/* Pixels of a part cannot tell when to stop: that takes all samples before it. */
static bool is_adaptive(const trc_render_desc *desc) {
    return desc->noise_threshold > 0.0f && !trc_film_is_part(desc);
}

static bool has_halves(const trc_render_desc *desc) {
    return desc->denoise || desc->extra_samples > 0.0f;
}

/* Whether all parts of a frame can be had at once, before the first is taken. */
static trc_status check_memory(const trc_render_desc *desc, bool has_catchers,
                               uint64_t worker_bytes) {
    uint64_t pixel_bytes = trc_film_pixel_bytes(desc);
    if (has_catchers)
        pixel_bytes += sizeof(struct trc_caught);
    if (is_adaptive(desc))
        pixel_bytes += sizeof(struct trc_adaptive_pixel);
    if (desc->extra_samples > 0.0f)
        pixel_bytes += TRC_EXTRA_PIXEL_BYTES;
    if (has_halves(desc))
        pixel_bytes += trc_film_half_bytes(desc, has_catchers);
    const uint64_t tiles =
        (uint64_t)trc_film_tiles(desc->crop_width) * trc_film_tiles(desc->crop_height);
    const uint64_t tile_bytes =
        3 * sizeof(uint32_t) + (desc->extra_samples > 0.0f ? TRC_EXTRA_TILE_BYTES : 0);
    const uint64_t workers = desc->thread_count < tiles ? desc->thread_count : tiles;
    /* A tile has its place in the order, its batches and a number in the film. */
    return trc_film_check_budget(desc->crop_width, desc->crop_height, pixel_bytes,
                                 workers * worker_bytes + tiles * tile_bytes +
                                     TRC_SOBOL_TABLE_BYTES);
}

/* Bytes that a thread of the render works in: kernels take samples of a scene, or reconstruct. */
static size_t worker_memory_bytes(const struct trc_render_state *render) {
    const struct trc_kernels *kernels = render->kernels;
    size_t bytes =
        render->snapshot ? kernels->tile_memory_bytes(&render->desc, render->snapshot) : 1;
    if (render->desc.denoise == TRC_DENOISE_FINAL && kernels->denoise_memory_bytes() > bytes)
        bytes = kernels->denoise_memory_bytes();
    return bytes;
}

static trc_status take_film(struct trc_render_state *render, bool has_catchers) {
    const trc_render_desc *desc = &render->desc;
    TRC_TRY(trc_film_create(desc, &render->film));
    if (has_catchers)
        TRC_TRY(trc_film_add_catchers(&render->film));
    if (is_adaptive(desc))
        TRC_TRY(trc_adaptive_create(desc, &render->adaptive));
    if (desc->extra_samples > 0.0f)
        TRC_TRY(trc_extra_create(desc, &render->extra));
    if (has_halves(desc))
        TRC_TRY(trc_film_add_halves(desc, &render->film));
    if (desc->denoise == TRC_DENOISE_FINAL && !trc_film_is_part(desc))
        TRC_TRY(trc_denoise_create(&render->film, &render->denoise));
    return TRC_OK;
}

static trc_status take_memory(struct trc_render_state *render, bool has_catchers) {
    const trc_render_desc *desc = &render->desc;
    const size_t memory_bytes = worker_memory_bytes(render);
    TRC_TRY(check_memory(desc, has_catchers, memory_bytes));
    TRC_TRY(take_film(render, has_catchers));
    TRC_TRY(trc_schedule_create(desc, &render->schedule));
    const struct trc_schedule *schedule = &render->schedule;
    TRC_TRY(trc_sobol_table_create(&render->sampler_table));
    trc_filter_table_fill(desc->filter, desc->filter_width, render->filter_table);
    /* More threads than tiles would only wait. */
    render->worker_count =
        desc->thread_count < schedule->tile_count ? desc->thread_count : schedule->tile_count;
    render->tile_batches = trc_alloc_zeroed(schedule->tile_count, sizeof(uint32_t));
    render->batch_tiles = trc_alloc_zeroed(schedule->batch_count, sizeof(uint32_t));
    render->workers = trc_alloc_zeroed(render->worker_count, sizeof *render->workers);
    bool ok = render->tile_batches && render->batch_tiles && render->workers;
    for (uint32_t i = 0; ok && i < render->worker_count; i++) {
        render->workers[i].render = render;
        render->workers[i].memory = trc_alloc(memory_bytes, 1);
        ok = render->workers[i].memory != NULL;
    }
    return ok ? TRC_OK : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the render's threads");
}

static void free_memory(struct trc_render_state *render) {
    for (uint32_t i = 0; render->workers && i < render->worker_count; i++) {
        trc_free(render->workers[i].memory);
    }
    trc_free(render->workers);
    trc_free(render->batch_tiles);
    trc_free(render->tile_batches);
    trc_free(render->sampler_table);
    trc_schedule_destroy(&render->schedule);
    trc_adaptive_destroy(&render->adaptive);
    trc_extra_destroy(&render->extra);
    trc_denoise_destroy(&render->denoise);
    trc_film_destroy(&render->film);
    trc_snapshot_release(render->snapshot);
    trc_free(render);
}

/* The caller is counted as running, so that early ends do not end the render, and leaves it where a
 * thread was started. NO_THREAD only if not one could be. */
static trc_status start_workers(struct trc_render_state *render) {
    trc_status status = TRC_OK;
    for (uint32_t i = 0; i < render->worker_count && status == TRC_OK; i++) {
        struct worker *worker = &render->workers[i];
        pthread_mutex_lock(&render->lock);
        render->running_count++;
        pthread_mutex_unlock(&render->lock);
        status = trc_thread_start(&worker->thread, worker_main, worker);
        if (status == TRC_OK)
            render->started_count++;
        else
            leave(render);
    }
    if (!render->started_count)
        return status;
    leave(render);
    return TRC_OK;
}

/* A render without threads yet. snapshot: NULL, or the caller's reference, which it takes. */
static trc_status create(struct trc_snapshot *snapshot, const trc_render_desc *desc,
                         bool has_catchers, struct trc_render_state **render_out) {
    struct trc_render_state *render = trc_alloc_zeroed(1, sizeof *render);
    if (!render) {
        trc_snapshot_release(snapshot);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a render");
    }
    render->snapshot = snapshot;
    render->desc = *desc;
    render->kernels = trc_kernels_current();
    atomic_init(&render->cancel, 0);
    atomic_init(&render->next_item, 0);
    atomic_init(&render->next_denoise_item, 0);
    trc_status status = take_memory(render, has_catchers);
    if (status == TRC_OK)
        status = init_sync(render);
    if (status != TRC_OK) {
        free_memory(render);
        return status;
    }
    render->time_start = trc_seconds();
    *render_out = render;
    return TRC_OK;
}

trc_status trc_render_state_start(struct trc_snapshot *snapshot, const trc_render_desc *desc,
                                  struct trc_render_state **render_out) {
    struct trc_render_state *render = NULL; /* gcc 14 does not follow create() */
    TRC_TRY(create(trc_snapshot_retain(snapshot), desc,
                   snapshot->features & TRC_FEATURE_SHADOW_CATCHERS, &render));
    render->running_count = 1;
    const trc_status status = start_workers(render);
    if (status != TRC_OK) {
        trc_render_state_destroy(render);
        return status;
    }
    *render_out = render;
    return TRC_OK;
}

/* ---- merging parts ---- */

trc_status trc_render_state_merge(const trc_render_desc *desc, bool has_catchers,
                                  struct trc_render_state **render_out) {
    trc_render_desc own = *desc;
    own.extra_samples = 0.0f; /* parts have none */
    TRC_TRY(create(NULL, &own, has_catchers, render_out));
    struct trc_render_state *render = *render_out;
    const struct trc_schedule *schedule = &render->schedule;
    atomic_store(&render->next_item, (uint64_t)schedule->batch_count * schedule->tile_count);
    return TRC_OK;
}

/* What pixels decide after so many samples. */
static void decide(struct trc_render_state *render, uint32_t samples) {
    for (uint32_t tile = 0; tile < render->schedule.tile_count; tile++) {
        const struct trc_tile_area a = trc_schedule_tile(&render->schedule, tile);
        if (trc_adaptive_tile_runs(&render->adaptive, a.x, a.y, a.width, a.height))
            trc_adaptive_update(&render->adaptive, a.x, a.y, a.width, a.height, samples);
    }
}

/* Under the lock: whether parts can still come. */
static trc_status check_merge_runs(const struct trc_render_state *render) {
    const bool is_open = render->state == TRC_PROGRESS_RUNNING && !render->tiles_done;
    return is_open ? TRC_OK : trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the merge has ended");
}

static trc_status check_part(struct trc_render_state *render, const trc_part_desc *part) {
    const uint32_t begin = part->sample_offset, count = render->schedule.sample_count;
    pthread_mutex_lock(&render->lock);
    const trc_status status = check_merge_runs(render);
    pthread_mutex_unlock(&render->lock);
    TRC_TRY(status);
    if (begin != render->merged_count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the part begins at sample %u, not at %u",
                        begin, render->merged_count);
    }
    TRC_TRY(trc_check_count(part->sample_subset, 1, count - begin, "sample_subset"));
    if (!render->adaptive.pixels)
        return TRC_OK;
    const uint32_t stage = trc_adaptive_next_stage(&render->adaptive, begin);
    if (stage < begin + part->sample_subset) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                        "with adaptive sampling a part has to end at sample %u", stage);
    }
    return TRC_OK;
}

trc_status trc_render_state_add(struct trc_render_state *render, const trc_part_desc *part) {
    TRC_TRY(check_part(render, part));
    const bool is_whole = part->sample_subset == render->schedule.sample_count;
    TRC_TRY(trc_film_add_part(&render->film, render->adaptive.pixels, part, is_whole));
    render->merged_count += part->sample_subset;
    if (render->adaptive.pixels &&
        render->merged_count == trc_adaptive_next_stage(&render->adaptive, part->sample_offset))
        decide(render, render->merged_count);
    pthread_mutex_lock(&render->lock);
    render->pixel_samples_done =
        (uint64_t)render->merged_count * render->schedule.width * render->schedule.height;
    render->version++;
    pthread_mutex_unlock(&render->lock);
    return TRC_OK;
}

/* Under the lock: no part comes any more, and the caller is counted as running. */
static trc_status close_merge(struct trc_render_state *render) {
    const struct trc_schedule *schedule = &render->schedule;
    TRC_TRY(check_merge_runs(render));
    if (render->merged_count != schedule->sample_count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "parts are missing: samples %u to %u",
                        render->merged_count, schedule->sample_count);
    }
    render->tiles_done = schedule->tile_count;
    render->lowest_batch = schedule->batch_count;
    render->running_count = 1;
    return TRC_OK;
}

/* As before close_merge, or cancelled meanwhile. */
static void reopen_merge(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    render->tiles_done = 0;
    render->lowest_batch = 0;
    render->running_count = 0;
    if (atomic_load(&render->cancel))
        end(render, TRC_PROGRESS_CANCELLED);
    pthread_mutex_unlock(&render->lock);
}

trc_status trc_render_state_finish(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    trc_status status = close_merge(render);
    pthread_mutex_unlock(&render->lock);
    TRC_TRY(status);
    if (!denoise_item_count(render)) { /* nothing to do for threads */
        leave(render);
        return TRC_OK;
    }
    status = start_workers(render);
    if (status != TRC_OK)
        reopen_merge(render);
    return status;
}

/* ---- what the caller sees ---- */

void trc_render_state_cancel(struct trc_render_state *render) {
    pthread_mutex_lock(&render->lock);
    atomic_store(&render->cancel, 1);
    pthread_cond_broadcast(&render->tile_done);
    if (render->state == TRC_PROGRESS_RUNNING && !render->running_count) /* an unfinished merge */
        end(render, TRC_PROGRESS_CANCELLED);
    pthread_mutex_unlock(&render->lock);
}

void trc_render_state_destroy(struct trc_render_state *render) {
    if (!render)
        return;
    trc_render_state_cancel(render);
    for (uint32_t i = 0; i < render->started_count; i++) {
        pthread_join(render->workers[i].thread, NULL);
    }
    pthread_cond_destroy(&render->ended);
    pthread_cond_destroy(&render->tile_done);
    pthread_mutex_destroy(&render->lock);
    free_memory(render);
}

void trc_render_state_wait(struct trc_render_state *render, double timeout_seconds) {
    const bool limited = timeout_seconds >= 0.0;
    /* At most a century: what every system can count to. */
    const double deadline = trc_seconds() + fmin(timeout_seconds, 100.0 * 365 * 86400);
    bool goes_on = true;
    pthread_mutex_lock(&render->lock);
    while (render->state == TRC_PROGRESS_RUNNING && goes_on) {
        if (limited)
            goes_on = trc_system_wait(&render->ended, &render->lock, deadline);
        else
            pthread_cond_wait(&render->ended, &render->lock);
    }
    pthread_mutex_unlock(&render->lock);
}

/* Under the lock: extra samples are their share, however many they are. */
static double fraction_of(const struct trc_render_state *render) {
    const struct trc_schedule *schedule = &render->schedule;
    const double all = (double)schedule->width * schedule->height * schedule->sample_count;
    const double done = (double)render->pixel_samples_done, share = (double)render->extra.share;
    double extra = 0.0;
    if (render->is_planned)
        extra = render->extra_planned ? (done - all) / (double)render->extra_planned : 1.0;
    return (fmin(done / all, 1.0) + share * extra) / (1.0 + share);
}

void trc_render_state_poll(struct trc_render_state *render, trc_render_progress *progress_out) {
    const struct trc_schedule *schedule = &render->schedule;
    trc_render_progress p = {.struct_size = sizeof p, .tile_count = schedule->tile_count};
    pthread_mutex_lock(&render->lock);
    p.state = render->state;
    p.fraction = (float)fraction_of(render);
    p.samples_done = trc_schedule_batch_begin(schedule, render->lowest_batch);
    if (p.samples_done > schedule->sample_count) /* some pixels have more */
        p.samples_done = schedule->sample_count;
    p.seconds =
        (p.state == TRC_PROGRESS_RUNNING ? trc_seconds() : render->time_end) - render->time_start;
    p.rays_camera = render->counts.rays_camera;
    p.rays_shadow = render->counts.rays_shadow;
    p.rays_reflection = render->counts.rays_reflection;
    p.rays_refraction = render->counts.rays_refraction;
    p.dropped_samples = render->counts.dropped_samples;
    p.tiles_done = render->tiles_done;
    p.version = render->version;
    p.seconds_trace = render->counts.seconds_trace;
    p.seconds_shade = render->counts.seconds_shade;
    p.seconds_other = render->counts.seconds_other;
    pthread_mutex_unlock(&render->lock);
    p.memory_bytes = trc_memory_bytes();
    p.peak_memory_bytes = trc_memory_peak_bytes();
    *progress_out = p;
}

trc_status trc_render_state_read(struct trc_render_state *render, uint32_t pass, float *pixels_out,
                                 uint64_t float_count) {
    return trc_film_read(&render->film, pass, render->desc.film_exposure, pixels_out, float_count);
}

trc_status trc_render_state_read_preview(struct trc_render_state *render, float *pixels_out,
                                         uint64_t float_count) {
    return trc_film_read_preview(&render->film, render->kernels, render->desc.thread_count,
                                 render->desc.film_exposure, pixels_out, float_count);
}

uint32_t trc_render_state_sums_channels(const struct trc_render_state *render, uint32_t sums) {
    return trc_film_sums_channels(&render->film, sums);
}

trc_status trc_render_state_read_sums(struct trc_render_state *render, uint32_t sums,
                                      double *sums_out, uint64_t double_count) {
    pthread_mutex_lock(&render->lock);
    const bool is_running = render->state == TRC_PROGRESS_RUNNING;
    pthread_mutex_unlock(&render->lock);
    if (is_running)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the render has not ended");
    return trc_film_read_sums(&render->film, sums, sums_out, double_count);
}
