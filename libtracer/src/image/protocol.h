/* What the library and a process that reads images say to each other: messages of fixed size over a
 * stream, texts and pixels in the block of memory that they share. Both are of one build.
 *
 *   FILE    -> INFO, then ROWS from top to bottom until all are there, then DONE; or FAILED at any
 *              point. Rows come in slots 0 and 1 by turns. After each ROWS the library answers
 *              TAKEN, without which the slot is not written again.
 *   COLORS  -> DONE, with is_identity, or FAILED. Then as often as wanted, and two at once:
 *   APPLY   -> DONE or FAILED, of the colours in a slot.
 *
 * The library trusts no answer: a damaged file may have made anything of the process. */
#ifndef TRACER_IMAGE_PROTOCOL_H
#define TRACER_IMAGE_PROTOCOL_H

#include <stdint.h>

/* Raised with every change. */
#define TRC_READER_MAGIC 0x54524301u

#define TRC_READER_SLOTS 2u
/* Rows of 65536 pixels of 16 bytes fit; enough blocks of rows of an EXR file to decode at once. */
#define TRC_READER_SLOT_BYTES ((uint64_t)4 << 20)
#define TRC_READER_SHARED_BYTES (TRC_READER_SLOTS * TRC_READER_SLOT_BYTES)
/* RGBA floats: what stays in a cache. */
#define TRC_READER_COLORS_MAX ((uint32_t)1 << 15)
#define TRC_READER_TEXT_BYTES 256u

enum { TRC_READER_FILE = 1, TRC_READER_TAKEN, TRC_READER_COLORS, TRC_READER_APPLY };

struct trc_reader_request {
    uint32_t magic, kind;
    /* Address space that the process may take besides what it has: at first, for each byte of a
     * FILE's pixels in addition, at most. */
    uint64_t memory_bytes, memory_bytes_max;
    uint32_t memory_per_byte;
    uint64_t pixel_bytes_max; /* of a FILE's pixels, else it is TOO_LARGE */
    /* Of texts at the start of slot 0, each with its terminator: FILE: a path; COLORS: a
     * configuration, then a colour space. */
    uint32_t text_bytes[2];
    uint32_t slot, count; /* APPLY: RGBA colours from the start of a slot */
};

enum { TRC_READER_INFO = 1, TRC_READER_ROWS, TRC_READER_DONE, TRC_READER_FAILED };

struct trc_reader_answer {
    uint32_t magic, kind;
    /* INFO: as struct trc_file_info has them. */
    uint32_t width, height, channels, format, is_unassociated;
    uint32_t slot, row_count;         /* ROWS: without gaps from the start of a slot */
    uint32_t is_identity;             /* DONE after COLORS: the transform changes nothing */
    int32_t status;                   /* FAILED: IMAGE, FORMAT, OUT_OF_MEMORY or TOO_LARGE */
    char text[TRC_READER_TEXT_BYTES]; /* FAILED: the reason, UTF-8, terminated */
};

#endif
