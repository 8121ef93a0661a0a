/* Processes that read images, as the operating system makes them: started, spoken to, ended. All of
 * the library that asks the system for processes, sockets and shared memory stands behind this
 * header (process_posix.c, process_windows.c).
 *
 * A launcher is the program that reads images, started once: to load its libraries takes it a
 * quarter of a second. Its processes are made from it in milliseconds. A process has a stream of
 * bytes to the library, and a block of memory that both share and neither can make smaller.
 *
 * The host's signals, descriptors, environment and working folder stay as they are: nothing is
 * inherited but the environment and the folder, no signal handler is needed, all processes end with
 * the launcher, and it ends with the host.
 *
 * Threads: a launcher may be used by several at once, a process by one. */
#ifndef TRACER_IMAGE_PROCESS_H
#define TRACER_IMAGE_PROCESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "tracer/base.h"

struct trc_launcher;
struct trc_process;

enum trc_received {
    TRC_RECEIVED,       /* all bytes that were asked for */
    TRC_RECEIVED_ENDED, /* the process has ended, or its stream */
    TRC_RECEIVED_LATE   /* the time is over */
};

/* How a process ended by itself. */
struct trc_process_exit {
    bool is_known;
    int32_t signal; /* 0: none */
    int32_t code;   /* without a signal */
};

/* Starts a program, a path, and does not wait for it; a Python runs the script, apart from the
 * user's environment, unless that is NULL. UNSUPPORTED with the reason if the system cannot run it,
 * OUT_OF_MEMORY. */
trc_status trc_launcher_start(const char *program, const char *script,
                              struct trc_launcher **launcher_out);

/* Whether it has not been found dead or talking nonsense. */
bool trc_launcher_is_sound(const struct trc_launcher *launcher);

/* Ends the program and with it all its processes; memory stays until those are destroyed. */
void trc_launcher_end(struct trc_launcher *launcher);

/* A new process that shares a block of so many bytes, zeroed. Waits until it is there.
 * UNSUPPORTED, with what the launcher did ("it has ended"), if that answers nonsense or nothing for
 * so many seconds: it is not sound any more then. OUT_OF_MEMORY. */
trc_status trc_process_create(struct trc_launcher *launcher, size_t shared_bytes, double seconds,
                              struct trc_process **process_out);

/* Ends the process in whatever state it is, and frees all; how it had ended if it had. */
struct trc_process_exit trc_process_destroy(struct trc_process *process);

/* Has memory refused to the process that goes so many bytes beyond what it had at its start. Where
 * the program can set that limit itself (POSIX) it does, and this changes nothing. */
void trc_process_limit_memory(struct trc_process *process, uint64_t bytes);

/* Its content may change at any time, as the process likes. */
void *trc_process_shared(const struct trc_process *process);

/* Without waiting; false if it has ended or its stream is full. */
bool trc_process_send(struct trc_process *process, const void *bytes, size_t size);

/* Waits at most so many seconds. */
enum trc_received trc_process_receive(struct trc_process *process, void *bytes, size_t size,
                                      double seconds);

/* Whether it lives and has said nothing that was not received. */
bool trc_process_is_idle(const struct trc_process *process);

/* ---- files ---- */

/* The absolute path of a file and its size. IMAGE with the reason if it is not a file, is missing,
 * or may not be read; OUT_OF_MEMORY. The path is to be freed. */
trc_status trc_file_look(const char *path, char **absolute_out, uint64_t *bytes_out);

/* The path of a file in the folder of this library's own, to be freed; NULL without memory or where
 * the system does not know the folder. */
char *trc_file_beside_library(const char *name);

/* What the system could give to processes, an estimate; UINT64_MAX if it does not say. */
uint64_t trc_memory_available(void);

#endif
