/* A program that the library takes for the one that reads images, for test_reader.c. What it does
 * with a file is the name of the file: to read it well, an image of GOOD_WIDTH x GOOD_HEIGHT, or
 * one of the many things that damaged files may make a process do. Nothing is read of the file. */
#define _GNU_SOURCE /* kill, getppid */
#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#endif

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bad_reader.h"
#include "image/protocol.h"
#include "model/texel_format.h"
#include "system.h"
#include "tracer/base.h"

/* More than a small file's reader may take. */
#define SWOLLEN_BYTES ((size_t)3 << 30)

/* Files that this process has been asked for before. */
static int served;

static struct trc_reader_answer answer_of(uint32_t kind) {
    return (struct trc_reader_answer){.magic = TRC_READER_MAGIC, .kind = kind};
}

static struct trc_reader_answer info(void) {
    struct trc_reader_answer answer = answer_of(TRC_READER_INFO);
    answer.width = GOOD_WIDTH;
    answer.height = GOOD_HEIGHT;
    answer.channels = 1;
    answer.format = TRC_TEXEL_U8;
    return answer;
}

static struct trc_reader_answer rows(uint32_t slot, uint32_t count) {
    struct trc_reader_answer answer = answer_of(TRC_READER_ROWS);
    answer.slot = slot;
    answer.row_count = count;
    return answer;
}

static struct trc_reader_answer failed(int32_t status, const char *text) {
    struct trc_reader_answer answer = answer_of(TRC_READER_FAILED);
    answer.status = status;
    const size_t size = strlen(text) + 1; /* not terminated if it is long */
    memcpy(answer.text, text, size < sizeof answer.text ? size : sizeof answer.text);
    return answer;
}

static void reply(struct connection *to, struct trc_reader_answer answer) {
    if (!connection_send(to, &answer, sizeof answer))
        _exit(1);
}

static _Noreturn void hang(void) {
    for (;;)
#ifdef _WIN32
        Sleep(INFINITE);
#else
        pause();
#endif
}

/* Where the test finds this process. */
static void write_process(const char *path) {
    char name[4200];
    (void)snprintf(name, sizeof name, "%s.pid", path);
    FILE *file = fopen(name, "w");
    if (!file)
        _exit(1);
#ifdef _WIN32
    (void)fprintf(file, "%ld\n", (long)getpid());
#else
    (void)fprintf(file, "%ld %ld\n", (long)getpid(), (long)getppid());
#endif
    (void)fclose(file);
}

/* A row in each message, by turns in both slots: gray of ten times the row from the top. */
static void serve_good(struct connection *to) {
    reply(to, info());
    for (uint32_t y = 0; y < GOOD_HEIGHT; y++) {
        struct trc_reader_request taken;
        if (y >= TRC_READER_SLOTS && !connection_receive(to, &taken, sizeof taken, false))
            _exit(1);
        memset(to->shared + y % TRC_READER_SLOTS * TRC_READER_SLOT_BYTES, (int)(10 * y),
               GOOD_WIDTH);
        reply(to, rows(y % TRC_READER_SLOTS, 1));
    }
    reply(to, answer_of(TRC_READER_DONE));
}

#define INFO(w, h, c, f, u)                                                          \
    {                                                                                \
        .magic = TRC_READER_MAGIC, .kind = TRC_READER_INFO, .width = w, .height = h, \
        .channels = c, .format = f, .is_unassociated = u                             \
    }

/* What is said instead of the first answer, or after it. */
static const struct lie {
    const char *name;
    bool comes_second;
    struct trc_reader_answer answer;
} lies[] = {
    {"no_magic", false, {.kind = TRC_READER_INFO, .width = 1, .height = 1, .channels = 1}},
    {"unknown_kind", false, {.magic = TRC_READER_MAGIC, .kind = 77}},
    {"rows_first", false, {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .row_count = 1}},
    {"done_first", false, {.magic = TRC_READER_MAGIC, .kind = TRC_READER_DONE}},
    {"no_width", false, INFO(0, 1, 1, 0, 0)},
    {"no_height", false, INFO(1, 0, 1, 0, 0)},
    {"no_channels", false, INFO(1, 1, 0, 0, 0)},
    {"five_channels", false, INFO(1, 1, 5, 0, 0)},
    {"unknown_format", false, INFO(1, 1, 1, 4, 0)},
    {"unknown_alpha", false, INFO(1, 1, 1, 0, 2)},
    {"huge_for_its_file", false, INFO(16384, 16384, 4, 3, 0)},
    {"too_wide", false, INFO(UINT32_MAX, UINT32_MAX, 4, 0, 0)},
    {"unknown_status", false, {.magic = TRC_READER_MAGIC, .kind = TRC_READER_FAILED, .status = 99}},
    {"ok_status", false, {.magic = TRC_READER_MAGIC, .kind = TRC_READER_FAILED, .status = TRC_OK}},
    {"wrong_slot",
     true,
     {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .slot = 1, .row_count = 1}},
    {"far_slot",
     true,
     {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .slot = 1u << 31, .row_count = 1}},
    {"no_rows",
     true,
     {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .slot = 0, .row_count = 0}},
    {"many_rows",
     true,
     {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .row_count = GOOD_HEIGHT + 1}},
    {"all_rows",
     true,
     {.magic = TRC_READER_MAGIC, .kind = TRC_READER_ROWS, .row_count = UINT32_MAX}},
    {"done_early", true, {.magic = TRC_READER_MAGIC, .kind = TRC_READER_DONE, .slot = 0}},
    {"info_twice", true, INFO(9, 9, 1, 0, 0)},
};

static bool tell_lie(struct connection *to, const char *name) {
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++) {
        if (strcmp(lies[i].name, name))
            continue;
        if (lies[i].comes_second)
            reply(to, info());
        reply(to, lies[i].answer);
        return true;
    }
    return false;
}

static void serve_file(struct connection *to, const char *path) {
    const char *name = path + strlen(path);
    while (name > path && !strchr("/\\", name[-1]))
        name--;
    const struct trc_reader_answer first = info();
    if (!strcmp(name, "dies") || (!strcmp(name, "dies_if_used") && served)) {
        (void)raise(SIGSEGV);
    } else if (!strcmp(name, "ends")) {
        _exit(3);
    } else if (!strcmp(name, "dies_halfway")) {
        reply(to, first);
        reply(to, rows(0, 1));
        (void)raise(SIGABRT);
    } else if (!strcmp(name, "says_half")) {
        (void)connection_send(to, &first, sizeof first / 2);
        _exit(0);
    } else if (!strcmp(name, "hangs")) {
        write_process(path);
        hang();
    } else if (!strcmp(name, "hangs_halfway")) {
        reply(to, first);
        reply(to, rows(0, 1));
        hang();
    } else if (!strcmp(name, "hangs_up")) {
        close(to->stream);
        hang();
    } else if (!strcmp(name, "talks_on")) {
        serve_good(to);
        reply(to, first);
#ifdef _WIN32
    } else if (!strcmp(name, "swells")) {
        if (VirtualAlloc(NULL, SWOLLEN_BYTES, MEM_COMMIT | MEM_RESERVE, PAGE_READWRITE))
            serve_good(to);
        else
            reply(to, failed(TRC_ERROR_OUT_OF_MEMORY, "no memory"));
#else
    } else if (!strcmp(name, "kills_launcher")) {
        (void)kill(getppid(), SIGKILL);
        hang();
#endif
    } else if (!strcmp(name, "fails")) {
        reply(to, failed(TRC_ERROR_IMAGE, "line one\nline two\t\n"));
    } else if (!strcmp(name, "fails_at_length")) {
        char text[2 * TRC_READER_TEXT_BYTES];
        memset(text, 'x', sizeof text - 1);
        text[sizeof text - 1] = '\0';
        reply(to, failed(TRC_ERROR_OUT_OF_MEMORY, text));
    } else if (!tell_lie(to, name)) {
        serve_good(to);
    }
}

static void serve(struct connection *to) {
    struct trc_reader_request request;
    for (; connection_receive(to, &request, sizeof request, true); served++) {
        char path[4096];
        if (request.kind != TRC_READER_FILE || request.text_bytes[0] > sizeof path) {
            served--;
            continue;
        }
        memcpy(path, to->shared, request.text_bytes[0]);
        serve_file(to, path);
    }
}

int main(void) {
    system_prepare();
    return system_launch(serve);
}
