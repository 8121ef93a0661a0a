/* Image files and colour spaces, read by OpenImageIO in processes of their own, whatever becomes of
 * them there: a file that kills its process, hangs it, or has it say nonsense is a file that cannot
 * be read.
 *
 * A reader holds the processes that it has started: each serves one call at a time, as many run as
 * calls do, and idle ones stay for the next. One that met a damaged file is not used again, since
 * its memory may be damaged, too. All functions may be called from several threads at once. */
#ifndef TRACER_IMAGE_READER_H
#define TRACER_IMAGE_READER_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "tracer/base.h"

struct trc_image_reader;

/* program: the path of the program that reads images; NULL: tracer_reader beside the library.
 * script: what it runs if it is a Python, else NULL. Not started yet. One holder: the caller.
 * OUT_OF_MEMORY. */
trc_status trc_image_reader_create(const char *program, const char *script,
                                   struct trc_image_reader **reader_out);

/* NULL is fine for both. The last release ends all processes. */
struct trc_image_reader *trc_image_reader_retain(struct trc_image_reader *reader);
void trc_image_reader_release(struct trc_image_reader *reader);

/* Starts the program unless it runs, and does not wait for it: what is asked for next will. */
void trc_image_reader_start(struct trc_image_reader *reader);

/* Ends the processes that wait for the next call; the program stays. */
void trc_image_reader_rest(struct trc_image_reader *reader);

/* Seconds that a process may take for each step without a sign of progress; files get a second more
 * for each megabyte. For tests. */
void trc_image_reader_set_patience(struct trc_image_reader *reader, double seconds);

/* What a file says of itself, checked: sizes within the limits of images, 1 to 4 channels, an enum
 * trc_texel. */
struct trc_file_info {
    uint32_t width, height;
    uint32_t channels;        /* that are read: 1 grey, 2 grey and alpha, 3 RGB, 4 RGBA */
    uint32_t format;          /* enum trc_texel: what keeps the file's precision */
    uint32_t is_unassociated; /* its colours are not multiplied by its alpha */
};

/* Who takes the pixels of a file. begin may refuse; it is called again, and everything starts anew,
 * if the process ended for what it had read before. rows: so many from first on, the top row first,
 * channels side by side without gaps; every row comes once. */
struct trc_file_taker {
    void *context;
    const atomic_uint *cancel; /* NULL, or not 0: give up */
    trc_status (*begin)(void *context, const struct trc_file_info *info);
    void (*rows)(void *context, uint32_t first, uint32_t count, const void *pixels);
};

/* Reads the first picture of a file. IMAGE with the reason for a file that cannot be read, whatever
 * it did; TOO_LARGE, also for one that is small and claims to be huge; OUT_OF_MEMORY; FORMAT for
 * a file in no known format; UNSUPPORTED where there is no program that reads images or it does not
 * run; CANCELLED; what begin returns. */
trc_status trc_image_reader_read(struct trc_image_reader *reader, const char *path,
                                 const struct trc_file_taker *taker);

/* Who gives colours and takes them back transformed: RGBA, alpha stays. begin is called once, not
 * at all if the transform changes nothing. What was stored is not asked for again. */
struct trc_color_batches {
    void *context;
    const atomic_uint *cancel; /* as above */
    uint64_t count;
    trc_status (*begin)(void *context);
    void (*load)(void *context, uint64_t first, uint32_t count, float *rgba);
    void (*store)(void *context, uint64_t first, uint32_t count, const float *rgba);
};

/* Transforms colours to the one that an OpenColorIO configuration, a file, has for the role
 * scene_linear. IMAGE with the reason, OUT_OF_MEMORY, UNSUPPORTED as above, what begin returns. */
trc_status trc_image_reader_convert(struct trc_image_reader *reader, const char *config,
                                    const char *space, const struct trc_color_batches *batches);

#endif
