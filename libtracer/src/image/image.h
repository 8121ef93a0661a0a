/* Images from pixels and files (model/image.h). */
#ifndef TRACER_IMAGE_IMAGE_H
#define TRACER_IMAGE_IMAGE_H

#include "model/image.h"
#include "tracer/tracer.h"

struct trc_image_reader;

/* Where images come from: reader reads files and converts colours; cancel is NULL, or not 0 to give
 * up. */
struct trc_image_source {
    struct trc_image_reader *reader;
    const atomic_uint *cancel;
};

/* Copies the pixels or reads the file of a descriptor, which is checked in full; with neither, an
 * image without contents. INVALID_ARGUMENT, STRUCT_SIZE, TOO_LARGE, OUT_OF_MEMORY, IMAGE
 * (unreadable file, unknown colour space), UNSUPPORTED (a path or a colour space where no program
 * reads them), CANCELLED. One holder: the caller. */
trc_status trc_image_load(const trc_image_desc *desc, const struct trc_image_source *source,
                          struct trc_image **image_out);

/* Whether a descriptor is that of an image without contents. */
static inline bool trc_image_desc_is_empty(const trc_image_desc *desc) {
    return !desc->path && !desc->pixels && !desc->width && !desc->height;
}

/* TOO_LARGE for an image of such a size and enum trc_texel, with a message that names it. name: ""
 * or the path of a file. */
trc_status trc_image_check_size(uint32_t width, uint32_t height, uint32_t format, const char *name);

/* A new image of half the size, of which the caller is the holder; whether it can be: a side of one
 * texel stays. OUT_OF_MEMORY. */
bool trc_image_can_halve(const struct trc_image *image);
trc_status trc_image_halve(const struct trc_image *image, struct trc_image **half_out);

/* NULL is fine for all three. The last release frees. */
struct trc_image *trc_image_retain(struct trc_image *image);
void trc_image_release(struct trc_image *image);
uint64_t trc_image_bytes(const struct trc_image *image);

#endif
