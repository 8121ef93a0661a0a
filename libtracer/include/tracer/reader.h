/* A reader of image files: OpenImageIO and OpenColorIO, in processes of their own.
 *
 * Files are read by the program tracer_reader, which stands beside the library, and by processes
 * that it makes: whatever a damaged file does to one of them, crashes, takes time or memory without
 * end, costs that file alone (TRC_ERROR_IMAGE), never the host. Pixels come through shared memory.
 * The program is started when a file or a colour space is first asked for, which takes a quarter of
 * a second, and ends with the reader, with the host, or when nothing was asked of it for two
 * minutes; then it is started again. The host's signals, descriptors, environment and working
 * folder stay untouched, and no signal handler is needed.
 *
 * A reader serves any number of scenes. A scene that is given none has one of its own. */
#ifndef TRACER_READER_H
#define TRACER_READER_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

typedef struct trc_reader_desc {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t reserved;    /* 0 */
    const char *program;  /* path of the program; NULL: tracer_reader in the library's folder */
    /* What the program is to run if it is a Python, apart from the user's environment (-I); NULL:
     * the program reads images itself. */
    const char *script;
} trc_reader_desc;

/* The program in the library's folder. */
TRC_API trc_reader_desc trc_reader_desc_default(void);

/* A reader, owned by the caller until trc_reader_destroy. Starts nothing yet. A program that is
 * absent or does not run is found out when a file is read: TRC_ERROR_UNSUPPORTED with the reason,
 * from then on for each. */
TRC_API trc_status trc_reader_create(const trc_reader_desc *desc, trc_reader *reader_out);

/* Starts the program, so that the first file need not wait for it. Returns at once. */
TRC_API trc_status trc_reader_start(trc_reader reader);

/* Gives up the caller's hold. The program ends with the last scene that was created with the
 * reader. */
TRC_API trc_status trc_reader_destroy(trc_reader reader);

TRC_END_DECLS

#endif
