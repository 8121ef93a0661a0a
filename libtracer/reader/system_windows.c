/* A process for the library, which starts the program anew for each: see system.h,
 * image/process_launch.h. */
#include "system.h"

#include <fcntl.h>
#include <io.h>
#include <stdlib.h>

#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include "image/process_launch.h"

void system_prepare(void) {
    /* No window asks what to do about a crash. */
    SetErrorMode(SEM_FAILCRITICALERRORS | SEM_NOGPFAULTERRORBOX | SEM_NOOPENFILEERRORBOX);
}

size_t system_count_threads(void) { return 0; }

/* It ends with its host, which idle processes end with, too. */
bool connection_receive(struct connection *connection, void *bytes, size_t size, bool idle) {
    (void)idle;
    for (size_t count = 0; count < size;) {
        const int got = _read(connection->stream, (char *)bytes + count, (unsigned)(size - count));
        if (got <= 0)
            return false;
        count += (size_t)got;
    }
    return true;
}

bool connection_send(struct connection *connection, const void *bytes, size_t size) {
    for (size_t count = 0; count < size;) {
        const int sent =
            _write(connection->stream, (const char *)bytes + count, (unsigned)(size - count));
        if (sent <= 0)
            return false;
        count += (size_t)sent;
    }
    return true;
}

/* The library limits its processes: trc_process_limit_memory. */
void system_limit_memory(uint64_t bytes) { (void)bytes; }

/* The stream from where it was inherited; what libraries print goes nowhere from here on. */
static int take_stream(void) {
    const int stream = _dup(0), nowhere = _open("NUL", _O_RDWR);
    if (stream < 0 || nowhere < 0 || _dup2(nowhere, 0) || _dup2(nowhere, 1) ||
        _setmode(stream, _O_BINARY) < 0)
        return -1;
    _close(nowhere);
    return stream;
}

int system_launch(void (*serve)(struct connection *connection)) {
    const struct trc_launch_answer hello = {.magic = TRC_LAUNCH_MAGIC};
    if (__argc < 3)
        return EXIT_FAILURE;
    const char *name = __argv[__argc - 2];
    const HANDLE block = OpenFileMappingA(FILE_MAP_ALL_ACCESS, FALSE, name);
    struct connection connection = {.stream = take_stream(),
                                    .shared_bytes = strtoull(__argv[__argc - 1], NULL, 10)};
    if (block)
        connection.shared =
            MapViewOfFile(block, FILE_MAP_ALL_ACCESS, 0, 0, connection.shared_bytes);
    if (!connection.shared || connection.stream < 0 ||
        !connection_send(&connection, &hello, sizeof hello))
        return EXIT_FAILURE;
    serve(&connection);
    return EXIT_SUCCESS;
}
