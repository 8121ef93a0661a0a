/* Making, freeing and reading a film (model/film.h). */
#ifndef TRACER_FILM_FILM_H
#define TRACER_FILM_FILM_H

#include "model/denoise.h"
#include "model/film.h"
#include "model/kernels.h"

/* TRC_ERROR_TOO_LARGE unless so many bytes for every pixel, and others, can be had
 * (trc_memory_left_bytes): a system that overcommits would grant more than there is and kill the
 * host later. pixel_bytes < 1 KiB, other_bytes < 2^60. */
trc_status trc_film_check_budget(uint32_t width, uint32_t height, uint64_t pixel_bytes,
                                 uint64_t other_bytes);

/* Bytes that trc_film_create takes for each pixel. */
uint64_t trc_film_pixel_bytes(const trc_render_desc *desc);

/* Takes the memory of the passes and mattes that desc asks for, zeroed; desc is resolved.
 * TRC_ERROR_TOO_LARGE or OUT_OF_MEMORY. */
trc_status trc_film_create(const trc_render_desc *desc, struct trc_film *film);

/* Takes the memory for shadow catchers. TRC_ERROR_OUT_OF_MEMORY. */
trc_status trc_film_add_catchers(struct trc_film *film);

/* Takes the memory that reconstruction and extra samples need of the film, after the memory for
 * shadow catchers; desc is resolved. TRC_ERROR_OUT_OF_MEMORY. (film/denoise.c) */
trc_status trc_film_add_halves(const trc_render_desc *desc, struct trc_film *film);

/* Bytes of that and of the filter for each pixel. */
uint64_t trc_film_half_bytes(const trc_render_desc *desc, bool has_catchers);

/* Takes the memory between the phases of reconstruction, of a film with halves.
 * TRC_ERROR_OUT_OF_MEMORY. */
trc_status trc_denoise_create(struct trc_film *film, struct trc_denoise *denoise);
void trc_denoise_destroy(struct trc_denoise *denoise);

void trc_film_destroy(struct trc_film *film);

/* Sums over counts as float32, times exposure for light passes. From any thread while tiles are
 * written: each shows a batch of samples whole or not at all; every value is finite. Waits while a
 * tile's batch is being added, some ten microseconds. (film/read.c) */
trc_status trc_film_read(const struct trc_film *film, uint32_t pass, float exposure, float *out,
                         uint64_t float_count);

/* The number of a tile that is not being written, after waiting for that (model/sequence.h).
 * (film/read.c) */
unsigned trc_film_await_writer(const atomic_uint *sequence);

/* Combined, quickly reconstructed by so many threads; as trc_film_read gives it where the film has
 * no halves, or has shadow catchers. OUT_OF_MEMORY and NO_THREAD, too. (film/preview.c) */
trc_status trc_film_read_preview(const struct trc_film *film, const struct trc_kernels *kernels,
                                 uint32_t thread_count, float exposure, float *out,
                                 uint64_t float_count);

#endif
