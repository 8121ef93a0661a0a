#include "race.h"

#include <math.h>
#include <stdlib.h>

#include "buffers.h"
#include "core/core.h"
#include "core/pool.h"

/* Relative: float distances along different ways of computing them agree far better. */
#define SAME_DISTANCE 1e-4f

/* One contestant's pass over a list. */
struct lap {
    const struct contestant *contestant;
    const struct ray_list *list;
    uint32_t part_count;
    bool streamed;
    size_t batch_bytes;
    char **memory;   /* per part */
    double *seconds; /* per part */
};

static uint32_t part_begin(const struct lap *lap, uint32_t part) {
    return (uint32_t)((uint64_t)lap->list->batch_count * part / lap->part_count);
}

static void trace_resident(const struct lap *lap, uint32_t part) {
    const struct contestant *c = lap->contestant;
    double seconds = 0.0;
    for (uint32_t batch = part_begin(lap, part); batch < part_begin(lap, part + 1); batch++) {
        c->calls->load(c, lap->list, batch, lap->memory[part]);
        const double start = trc_seconds();
        c->calls->trace(c, lap->list, batch, lap->memory[part]);
        seconds += trc_seconds() - start;
    }
    lap->seconds[part] = seconds;
}

static void trace_streamed(const struct lap *lap, uint32_t part) {
    const struct contestant *c = lap->contestant;
    const uint32_t begin = part_begin(lap, part), end = part_begin(lap, part + 1);
    char *const memory = lap->memory[part];
    for (uint32_t batch = begin; batch < end; batch++)
        c->calls->load(c, lap->list, batch, memory + (batch - begin) * lap->batch_bytes);
    const double start = trc_seconds();
    for (uint32_t batch = begin; batch < end; batch++)
        c->calls->trace(c, lap->list, batch, memory + (batch - begin) * lap->batch_bytes);
    lap->seconds[part] = trc_seconds() - start;
}

static void lap_part(void *context, uint32_t part, uint32_t worker) {
    const struct lap *lap = context;
    (void)worker;
    (lap->streamed ? trace_streamed : trace_resident)(lap, part);
}

/* Mrays/s. */
static double lap_run(struct lap *lap, struct trc_pool *pool) {
    double rate = 0.0;
    trc_pool_run(pool, lap->part_count, lap_part, lap);
    for (uint32_t part = 0; part < lap->part_count; part++) {
        const uint32_t begin = lap->list->batch_begin[part_begin(lap, part)];
        const uint32_t end = lap->list->batch_begin[part_begin(lap, part + 1)];
        if (end > begin && lap->seconds[part] > 0.0)
            rate += 1e-6 * (end - begin) / lap->seconds[part];
    }
    return rate;
}

static void lap_open(struct lap *lap) {
    lap->batch_bytes = lap->contestant->calls->batch_bytes(lap->contestant, lap->list);
    lap->memory = buffer_alloc(lap->part_count, sizeof *lap->memory);
    lap->seconds = buffer_alloc(lap->part_count, sizeof *lap->seconds);
    for (uint32_t part = 0; part < lap->part_count; part++) {
        const uint32_t batches = part_begin(lap, part + 1) - part_begin(lap, part);
        lap->memory[part] = buffer_alloc(lap->streamed ? batches : 1, lap->batch_bytes);
    }
}

static void lap_close(struct lap *lap) {
    for (uint32_t part = 0; part < lap->part_count; part++)
        free(lap->memory[part]);
    free(lap->memory);
    free(lap->seconds);
}

void race_run(const struct contestant *contestants, uint32_t count, const struct ray_list *list,
              struct trc_pool *pool, uint32_t repeats, bool streamed, struct rate *rates_out) {
    struct lap *laps = buffer_alloc(count, sizeof *laps);
    for (uint32_t i = 0; i < count; i++) {
        laps[i] = (struct lap){.contestant = &contestants[i],
                               .list = list,
                               .part_count = trc_pool_thread_count(pool),
                               .streamed = streamed};
        lap_open(&laps[i]);
        rates_out[i].count = 0;
    }
    for (uint32_t repeat = 0; repeat <= repeats; repeat++)
        for (uint32_t i = 0; i < count; i++) {
            const double rate = lap_run(&laps[i], pool);
            if (repeat > 0)
                rate_add(&rates_out[i], rate);
        }
    for (uint32_t i = 0; i < count; i++)
        lap_close(&laps[i]);
    free(laps);
}

/* ---- hits ---- */

void race_hits(const struct contestant *contestant, const struct ray_list *list,
               struct hit_set *hits) {
    void *memory = buffer_alloc(1, contestant->calls->batch_bytes(contestant, list));
    for (uint32_t batch = 0; batch < list->batch_count; batch++) {
        contestant->calls->load(contestant, list, batch, memory);
        contestant->calls->trace(contestant, list, batch, memory);
        contestant->calls->store(contestant, list, batch, memory, hits);
    }
    free(memory);
}

static bool is_hit(const struct ray_list *list, const struct hit_set *hits, uint32_t ray) {
    return list->any ? hits->occluded[ray] : hits->instance[ray] != TRC_NO_HIT;
}

struct hit_difference race_difference(const struct ray_list *list, const struct hit_set *a,
                                      const struct hit_set *b) {
    struct hit_difference out = {0};
    for (uint32_t i = 0; i < list->rays.count; i++) {
        const bool in_a = is_hit(list, a, i), in_b = is_hit(list, b, i);
        out.only_a += in_a && !in_b;
        out.only_b += in_b && !in_a;
        if (list->any || !in_a || !in_b)
            continue;
        const float scale = fmaxf(fabsf(a->distance[i]), fabsf(b->distance[i]));
        const float difference = fabsf(a->distance[i] - b->distance[i]);
        if (!(difference <= SAME_DISTANCE * scale))
            out.distance++;
        else if (scale > 0.0f)
            out.largest = fmax(out.largest, (double)(difference / scale));
    }
    return out;
}

double race_miss_share(const struct ray_list *list, const struct hit_set *hits) {
    uint32_t misses = 0;
    for (uint32_t i = 0; i < list->rays.count; i++)
        misses += !is_hit(list, hits, i);
    return list->rays.count ? (double)misses / list->rays.count : 0.0;
}
