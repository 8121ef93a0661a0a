/* What colour channels see of interference, by the difference of paths: Fourier transforms of the
 * colour matching functions over wavenumbers, real and imaginary parts, each turned back by the
 * phase of a carrier of that wavelength. Made by tools/generate_thin_film.py. */
#ifndef TRACER_MODEL_THIN_FILM_TABLE_H
#define TRACER_MODEL_THIN_FILM_TABLE_H

#define TRC_THIN_FILM_CHANNELS 3
#define TRC_THIN_FILM_SIZE 128
/* Difference of paths in nanometres where the table ends; little is left there. */
#define TRC_THIN_FILM_REACH 9600.0f
/* Wavelengths of the carriers, nanometres. */
#define TRC_THIN_FILM_RED 605.0f
#define TRC_THIN_FILM_GREEN 548.0f
#define TRC_THIN_FILM_BLUE 447.0f

extern const float trc_thin_film_table[TRC_THIN_FILM_CHANNELS][2][TRC_THIN_FILM_SIZE];

#endif
