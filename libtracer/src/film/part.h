/* Sums of a film as numbers of the caller, and films that are put together of them: parts of the
 * samples of a picture (tracer/render.h).
 */
#ifndef TRACER_FILM_PART_H
#define TRACER_FILM_PART_H

#include "model/adaptive.h"
#include "model/film.h"

/* Doubles of each pixel under a number of sums, 0 for none. */
uint32_t trc_film_sums_channels(const struct trc_film *film, uint32_t sums);

/* Copies them. No tile may be written meanwhile. INVALID_ARGUMENT. */
trc_status trc_film_read_sums(const struct trc_film *film, uint32_t sums, double *out,
                              uint64_t double_count);

/* Adds what such a film had of a part, to pixels that still get samples, with adaptive sampling.
 * adaptive: their reasons and sums, or NULL. is_whole: the part has all samples of the picture.
 * INVALID_ARGUMENT leaves all as it was. */
trc_status trc_film_add_part(struct trc_film *film, struct trc_adaptive_pixel *adaptive,
                             const trc_part_desc *desc, bool is_whole);

#endif
