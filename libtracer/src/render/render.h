/* A render in the background: its threads take items of the schedule until all are done or it is
 * cancelled. An item is claimed by one thread; a batch of a tile waits for the tile's former batch,
 * so each pixel gets its samples in order and the image does not depend on the number of threads.
 *
 * Every function may be called from any thread, destroy once and last. */
#ifndef TRACER_RENDER_RENDER_H
#define TRACER_RENDER_RENDER_H

#include <stdbool.h>

#include "model/snapshot.h"
#include "tracer/render.h"

/* Shadow rays per camera hit where the caller leaves the choice: many pixel samples do the rest. */
#define TRC_DEFAULT_LIGHT_SAMPLES 1
#define TRC_DEFAULT_PACKET_SIZE 256

/* Deepest path there is. Limits above it ("none") mean this: a path must end, and kernels count the
 * depths of a ray in 8 bits each, with two more for the world's light on what it meets. */
#define TRC_MAX_DEPTH 253

struct trc_render_state;

/* A checked descriptor with every value that 0 leaves to the library filled in. */
trc_render_desc trc_render_resolve(const trc_render_desc *desc);

/* Takes film and scratch memory and starts the threads. Takes a reference of its own on the
 * snapshot, which has a camera. desc is resolved. TOO_LARGE, OUT_OF_MEMORY, or NO_THREAD if not a
 * single thread could be started; one is enough to go on. */
trc_status trc_render_state_start(struct trc_snapshot *snapshot, const trc_render_desc *desc,
                                  struct trc_render_state **render_out);

/* Asks the threads to stop; does not wait. */
void trc_render_state_cancel(struct trc_render_state *render);

/* Until the end, or for that many seconds (< 0: no limit). */
void trc_render_state_wait(struct trc_render_state *render, double timeout_seconds);

/* struct_size stays. */
void trc_render_state_poll(struct trc_render_state *render, trc_render_progress *progress_out);

trc_status trc_render_state_read(struct trc_render_state *render, uint32_t pass, float *pixels_out,
                                 uint64_t float_count);

trc_status trc_render_state_read_preview(struct trc_render_state *render, float *pixels_out,
                                         uint64_t float_count);

/* Sums of the film, of a render that has ended (film/part.h). */
uint32_t trc_render_state_sums_channels(const struct trc_render_state *render, uint32_t sums);
trc_status trc_render_state_read_sums(struct trc_render_state *render, uint32_t sums,
                                      double *sums_out, uint64_t double_count);

/* A render whose samples come in parts, one after the other from one thread; it runs until it is
 * finished or cancelled. desc is resolved. The same errors. */
trc_status trc_render_state_merge(const trc_render_desc *desc, bool has_catchers,
                                  struct trc_render_state **render_out);
/* INVALID_ARGUMENT, with nothing changed. */
trc_status trc_render_state_add(struct trc_render_state *render, const trc_part_desc *part);
trc_status trc_render_state_finish(struct trc_render_state *render);

/* Cancels, joins and frees. NULL is fine. */
void trc_render_state_destroy(struct trc_render_state *render);

#endif
