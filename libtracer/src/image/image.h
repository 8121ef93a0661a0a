/* Images that Image and Environment nodes read: texels as the lookups want them.
 *
 * As in Cycles, what is stored is what the file or the caller gave: sRGB-encoded bytes stay encoded
 * and are decoded after filtering, and colours of images with alpha are multiplied by it before
 * filtering (in their encoding). Other encodings and colour spaces are converted to scene-linear
 * floats. Rows run from the bottom (v = 0) upwards, texels are RGBA.
 * Immutable once created; the count of holders is atomic. */
#ifndef TRACER_IMAGE_IMAGE_H
#define TRACER_IMAGE_IMAGE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "image/texel_format.h"
#include "tracer/tracer.h"

#define TRC_IMAGE_MAX_SIDE 65536u
#define TRC_IMAGE_MAX_TEXELS (1u << 30)
/* Texels of all levels are addressed by a signed 32-bit number of 4-byte words. */
#define TRC_IMAGE_MAX_BYTES (((uint64_t)1 << 33) - 4)
/* 65536 halved down to 1. */
#define TRC_IMAGE_MAX_LEVELS 17

struct trc_image_level {
    uint32_t width, height;
    void *texels;
};

struct trc_image {
    atomic_uint refs;
    enum trc_texel format;
    uint32_t is_srgb;       /* colours are sRGB-encoded: to be decoded after filtering */
    uint32_t is_associated; /* colours are multiplied by alpha: divided when alpha is used too */
    uint32_t level_count;   /* 1: only itself; smaller ones: image/levels.h */
    enum trc_texel level_format; /* of those: linear light */
    struct trc_image_level levels[TRC_IMAGE_MAX_LEVELS];
    bool is_halved;           /* to fit the scene's limit: worth a warning */
    uint64_t bytes;           /* of the texels of all levels */
    uint64_t bad_texel_count; /* were NaN or infinite, and are 0 now: worth a warning */
};

struct trc_image_reader;

/* Where images come from: reader reads files and converts colours; cancel is NULL, or not 0 to give
 * up. */
struct trc_image_source {
    struct trc_image_reader *reader;
    const atomic_uint *cancel;
};

/* Copies the pixels or reads the file of a descriptor, which is checked in full. INVALID_ARGUMENT,
 * STRUCT_SIZE, TOO_LARGE, OUT_OF_MEMORY, IMAGE (unreadable file, unknown colour space), UNSUPPORTED
 * (a path or a colour space where no program reads them), CANCELLED. One holder: the caller. */
trc_status trc_image_load(const trc_image_desc *desc, const struct trc_image_source *source,
                          struct trc_image **image_out);

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
