/* Images that are read side by side, before they are asked for, while the host does other things.
 * What comes of them does not depend on that: who asks for one gets what reading it then would have
 * given.
 *
 * Threads: one user; the work is done by threads of its own. */
#ifndef TRACER_IMAGE_PREFETCH_H
#define TRACER_IMAGE_PREFETCH_H

#include <stdbool.h>

#include "image/image.h"

struct trc_prefetch;

/* bytes_max: of images that wait to be asked for, 0 for the library's own limit; no new one is read
 * while there are more. OUT_OF_MEMORY. */
trc_status trc_prefetch_create(struct trc_image_reader *reader, uint64_t bytes_max,
                               struct trc_prefetch **prefetch_out);

/* Stops what is under way and frees what nobody has asked for. NULL is fine. */
void trc_prefetch_destroy(struct trc_prefetch *prefetch);

/* Will be asked for: a descriptor with a path, which is copied. Nothing happens if it has been
 * added already, or if there is no memory or thread for it. */
void trc_prefetch_add(struct trc_prefetch *prefetch, const trc_image_desc *desc);

/* Whether an equal descriptor was added, and was or is being read: waits for it then, and gives
 * what trc_image_load does, once. Else the caller is to read it. */
bool trc_prefetch_take(struct trc_prefetch *prefetch, const trc_image_desc *desc,
                       trc_status *status_out, struct trc_image **image_out);

#endif
