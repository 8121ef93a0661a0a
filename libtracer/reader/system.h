/* What the program that reads images asks of the operating system (system_posix.c,
 * system_windows.c): to be a launcher of processes for the library (src/image/process.h), the
 * stream of a process, limits. */
#ifndef TRACER_READER_SYSTEM_H
#define TRACER_READER_SYSTEM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A process's connection to the library. */
struct connection {
    int stream;
    char *shared;
    size_t shared_bytes;
};

/* Takes leave of what the host has left open, of core files, and of whatever the program was
 * started with that is not its own. */
void system_prepare(void);

/* How many threads the program has; 0 where processes are not copies of it. */
size_t system_count_threads(void);

/* Makes and ends processes as the library asks, until the library has gone or has asked nothing for
 * long. In each process serve(connection) runs, and the process ends when it returns. The exit code
 * of the program. */
int system_launch(void (*serve)(struct connection *connection));

/* Waits for bytes; false when the library has gone. idle: also when it has asked nothing for long.
 */
bool connection_receive(struct connection *connection, void *bytes, size_t size, bool idle);
bool connection_send(struct connection *connection, const void *bytes, size_t size);

/* Address space that may be taken besides what the process had at its start: memory that does not
 * fit is refused. */
void system_limit_memory(uint64_t bytes);

#ifdef __cplusplus
}
#endif

#endif
