/* In which order a render's pixels and samples are taken. Pure arithmetic; nothing here is shared
 * between threads.
 *
 * The crop is cut into tiles, taken in a square spiral from the centre, where people look first.
 * Samples are cut into batches; an item is one batch of one tile, and items are numbered batch by
 * batch. */
#ifndef TRACER_RENDER_SCHEDULE_H
#define TRACER_RENDER_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

#include "film/film.h"
#include "tracer/render.h"

struct trc_schedule {
    uint32_t width, height; /* of the crop */
    uint32_t tiles_x, tiles_y, tile_count;
    uint32_t *order; /* tile_count: tile numbers, rows from the bottom */
    uint32_t sample_begin, sample_count;
    uint32_t batch_count;
    /* Of those, with extra samples: each doubles what its pixels have. */
    uint32_t extra_batches;
    bool progressive; /* batches 1, 1, 2, 4, ... samples; else one batch of all */
};

struct trc_tile_area {
    uint32_t x, y, width, height; /* pixels of the crop */
};

/* OUT_OF_MEMORY. desc is resolved. */
trc_status trc_schedule_create(const trc_render_desc *desc, struct trc_schedule *schedule);
void trc_schedule_destroy(struct trc_schedule *schedule);

/* First sample of a batch, counted from sample_begin; of batch_count: the end of the last. */
uint32_t trc_schedule_batch_begin(const struct trc_schedule *schedule, uint32_t batch);

struct trc_tile_area trc_schedule_tile(const struct trc_schedule *schedule, uint32_t tile);

#endif
