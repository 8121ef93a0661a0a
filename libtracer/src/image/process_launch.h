/* What library and program say to each other to make and end processes. Both are of one build, on
 * one machine.
 *
 * Windows has no copies of a process: there the program is started for each, with the name of the
 * block of memory and its bytes as last arguments and the stream as standard input and output, and
 * says that it is there by an answer that nobody has asked for. */
#ifndef TRACER_IMAGE_PROCESS_LAUNCH_H
#define TRACER_IMAGE_PROCESS_LAUNCH_H

#include <stdint.h>

#define TRC_LAUNCH_MAGIC 0x5443524cu

/* The program's end of the stream to the library. */
#define TRC_LAUNCH_DESCRIPTOR 3

enum {
    TRC_LAUNCH_CREATE = 1, /* comes with two descriptors: a stream, a block of memory */
    TRC_LAUNCH_END = 2     /* kills a process if it still runs */
};

struct trc_launch_request {
    uint32_t magic, kind;
    int64_t process;       /* END */
    uint64_t shared_bytes; /* CREATE */
};

struct trc_launch_answer {
    uint32_t magic;
    int32_t error;       /* errno of a failure, else 0 */
    int64_t process;     /* CREATE: its number */
    int32_t exit_signal; /* END: what it had died of, 0: none; SIGKILL if it still ran */
    int32_t exit_code;
};

#endif
