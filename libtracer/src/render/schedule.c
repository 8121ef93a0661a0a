#include "render/schedule.h"

#include <string.h>

#include "core/core.h"
#include "model/extra.h"

/* Batches double up to this size: a larger one would leave a preview unchanged for too long. */
#define MAX_BATCH_LOG2 6

static uint32_t clamp_u32(int64_t value, uint32_t high) {
    return value < 0 ? 0 : value > high ? high : (uint32_t)value;
}

/* Appends the tiles of row y from x0 to x1 that lie in the frame. */
static void append_row(struct trc_schedule *s, uint32_t *count, int64_t y, int64_t x0, int64_t x1) {
    if (y < 0 || y >= s->tiles_y || x1 < 0 || x0 >= s->tiles_x)
        return;
    const uint32_t begin = clamp_u32(x0, s->tiles_x - 1), end = clamp_u32(x1, s->tiles_x - 1);
    for (uint32_t x = begin; x <= end; x++)
        s->order[(*count)++] = (uint32_t)y * s->tiles_x + x;
}

static void append_column(struct trc_schedule *s, uint32_t *count, int64_t x, int64_t y0,
                          int64_t y1) {
    if (x < 0 || x >= s->tiles_x || y1 < 0 || y0 >= s->tiles_y || y0 > y1)
        return;
    const uint32_t begin = clamp_u32(y0, s->tiles_y - 1), end = clamp_u32(y1, s->tiles_y - 1);
    for (uint32_t y = begin; y <= end; y++)
        s->order[(*count)++] = y * s->tiles_x + (uint32_t)x;
}

/* Rings of growing radius around the centre; each side of a ring is cut to the frame first, so the
 * cost is that of the tiles, however long and thin the frame. */
static void order_from_centre(struct trc_schedule *s) {
    const int64_t cx = (s->tiles_x - 1) / 2, cy = (s->tiles_y - 1) / 2;
    uint32_t count = 1;
    s->order[0] = (uint32_t)cy * s->tiles_x + (uint32_t)cx;
    for (int64_t r = 1; count < s->tile_count; r++) {
        append_row(s, &count, cy + r, cx - r, cx + r);
        append_column(s, &count, cx + r, cy - r + 1, cy + r - 1);
        append_row(s, &count, cy - r, cx - r, cx + r);
        append_column(s, &count, cx - r, cy - r + 1, cy + r - 1);
    }
}

uint32_t trc_schedule_batch_begin(const struct trc_schedule *schedule, uint32_t batch) {
    if (batch == 0)
        return 0;
    if (schedule->extra_batches)
        return schedule->sample_count << (batch - 1);
    if (!schedule->progressive || batch >= schedule->batch_count)
        return schedule->sample_count;
    if (batch <= MAX_BATCH_LOG2 + 1)
        return 1u << (batch - 1);
    return (batch - MAX_BATCH_LOG2) << MAX_BATCH_LOG2;
}

/* Those of a part, or all. */
static uint32_t sample_count_of(const trc_render_desc *desc) {
    return desc->sample_subset ? desc->sample_subset : desc->sample_count - desc->sample_offset;
}

static uint32_t count_batches(const trc_render_desc *desc) {
    if (!desc->progressive)
        return 1;
    const uint32_t doubling = 1u << MAX_BATCH_LOG2;
    const uint32_t samples = sample_count_of(desc);
    uint32_t batches = 1;
    for (uint32_t end = 1; end < samples && end < doubling; end *= 2)
        batches++;
    if (samples > doubling)
        batches += (samples - 1) / doubling;
    return batches;
}

trc_status trc_schedule_create(const trc_render_desc *desc, struct trc_schedule *schedule) {
    struct trc_schedule made = {
        .width = desc->crop_width,
        .height = desc->crop_height,
        .tiles_x = trc_film_tiles(desc->crop_width),
        .tiles_y = trc_film_tiles(desc->crop_height),
        .sample_begin = desc->sample_offset,
        .sample_count = sample_count_of(desc),
        .extra_batches = desc->extra_samples > 0.0f ? TRC_EXTRA_LEVELS : 0,
        .progressive = desc->progressive != 0,
    };
    made.batch_count = count_batches(desc) + made.extra_batches;
    made.tile_count = made.tiles_x * made.tiles_y;
    made.order = trc_alloc(made.tile_count, sizeof *made.order);
    if (!made.order)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the order of tiles");
    order_from_centre(&made);
    *schedule = made;
    return TRC_OK;
}

void trc_schedule_destroy(struct trc_schedule *schedule) {
    trc_free(schedule->order);
    memset(schedule, 0, sizeof *schedule);
}

struct trc_tile_area trc_schedule_tile(const struct trc_schedule *schedule, uint32_t tile) {
    struct trc_tile_area t = {.x = tile % schedule->tiles_x * TRC_TILE_SIZE,
                              .y = tile / schedule->tiles_x * TRC_TILE_SIZE};
    t.width = schedule->width - t.x < TRC_TILE_SIZE ? schedule->width - t.x : TRC_TILE_SIZE;
    t.height = schedule->height - t.y < TRC_TILE_SIZE ? schedule->height - t.y : TRC_TILE_SIZE;
    return t;
}
