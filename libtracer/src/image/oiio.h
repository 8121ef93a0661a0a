/* Image files through OpenImageIO. The only C++ of the library stands behind these functions; no
 * exception leaves them. One file is one thread's. */
#ifndef TRACER_IMAGE_OIIO_H
#define TRACER_IMAGE_OIIO_H

#include <stdint.h>

#include "tracer/base.h"

TRC_BEGIN_DECLS

/* What a file says of itself. */
struct trc_file_info {
    uint32_t width, height;
    uint32_t channels;        /* that are read: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA */
    uint32_t format;          /* enum trc_texel: what keeps the file's precision */
    uint32_t is_unassociated; /* its colours are not multiplied by its alpha */
};

struct trc_oiio;

/* Opens the first picture of a file. OUT_OF_MEMORY or IMAGE, with the reason; the size is as the
 * file claims, to be checked before memory is taken. */
trc_status trc_oiio_open(const char *path, struct trc_oiio **file_out,
                         struct trc_file_info *info_out);

/* Reads all pixels as info says, the bottom row first, each channel 1, 2 (U16, F16) or 4 bytes;
 * row_bytes from row to row, texel_bytes from texel to texel: what is between stays. capacity is
 * the size of texels. IMAGE, OUT_OF_MEMORY. */
trc_status trc_oiio_read(struct trc_oiio *file, void *texels, uint64_t capacity,
                         uint64_t texel_bytes, uint64_t row_bytes);

/* NULL is fine. */
void trc_oiio_close(struct trc_oiio *file);

TRC_END_DECLS

#endif
