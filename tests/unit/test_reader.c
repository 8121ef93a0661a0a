/* Processes that read images: whatever they do, it costs the file alone and leaves nothing behind.
 * The program is mostly bad_reader.c, which does what the name of a file says. */
#define _GNU_SOURCE /* usleep, mkdtemp */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/core.h"
#include "image/image.h"
#include "image/prefetch.h"
#include "image/process.h"
#include "image/reader.h"
#include "programs/bad_reader.h"

/* Waits end early in the tests of what hangs, and never in the others. */
#define SHORT_PATIENCE 0.3
#define LONG_PATIENCE 60.0

static char folder[256];

static const char *path_of(const char *name) {
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static const char *make_file(const char *name, const char *text, mode_t mode) {
    const char *path = path_of(name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(chmod(path, mode), 0);
    return path;
}

static struct trc_image_reader *reader_of(const char *program, double patience) {
    struct trc_image_reader *reader;
    assert_int_equal(trc_image_reader_create(program, NULL, &reader), TRC_OK);
    trc_image_reader_set_patience(reader, patience);
    return reader;
}

static trc_status load(struct trc_image_reader *reader, const char *name,
                       struct trc_image **image_out) {
    const struct trc_image_source source = {.reader = reader};
    const trc_image_desc desc = {.struct_size = sizeof desc,
                                 .path = make_file(name, "not read", 0600)};
    *image_out = NULL;
    return trc_image_load(&desc, &source, image_out);
}

static void check_good(const struct trc_image *image) {
    assert_non_null(image);
    const uint8_t *texels = image->levels[0].texels;
    assert_int_equal(image->levels[0].width, GOOD_WIDTH);
    assert_int_equal(image->levels[0].height, GOOD_HEIGHT);
    for (int y = 0; y < GOOD_HEIGHT; y++)
        for (int x = 0; x < GOOD_WIDTH; x++)
            for (int c = 0; c < 4; c++)
                assert_int_equal(texels[4 * (GOOD_WIDTH * y + x) + c],
                                 c == 3 ? UINT8_MAX : 10 * (GOOD_HEIGHT - 1 - y));
}

static void loads_good(struct trc_image_reader *reader) {
    struct trc_image *image;
    const trc_status status = load(reader, "good", &image);
    if (status != TRC_OK)
        fail_msg("status %d: %s", status, trc_last_message());
    check_good(image);
    trc_image_release(image);
}

/* A file fails with a message that names it and says why, and the next one is read. */
static void fails(struct trc_image_reader *reader, const char *name, trc_status expected,
                  const char *why) {
    struct trc_image *image;
    const trc_status status = load(reader, name, &image);
    if (status != expected || !strstr(trc_last_message(), why) ||
        !strstr(trc_last_message(), path_of(name)))
        fail_msg("%s: status %d: %s", name, status, trc_last_message());
    assert_null(image);
}

static int count_descriptors(void) {
    int count = 0;
    DIR *directory = opendir("/proc/self/fd");
    assert_non_null(directory);
    while (readdir(directory))
        count++;
    closedir(directory);
    return count;
}

static void has_no_children(void) {
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
    assert_int_equal(errno, ECHILD);
}

/* ---- what a process may do ---- */

static void processes_that_die(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    for (int is_used = 0; is_used < 2; is_used++) { /* a new process and one that has read */
        if (is_used)
            loads_good(reader);
        fails(reader, "dies", TRC_ERROR_IMAGE, "signal 11");
        loads_good(reader);
        fails(reader, "ends", TRC_ERROR_IMAGE, "code 3");
        loads_good(reader);
        fails(reader, "dies_halfway", TRC_ERROR_IMAGE, "signal 6");
        fails(reader, "says_half", TRC_ERROR_IMAGE, "ended");
    }
    loads_good(reader);
    trc_image_reader_release(reader);
}

static void processes_that_hang(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, SHORT_PATIENCE);
    fails(reader, "hangs", TRC_ERROR_IMAGE, "no progress for");
    fails(reader, "hangs_halfway", TRC_ERROR_IMAGE, "no progress for");
    fails(reader, "hangs_up", TRC_ERROR_IMAGE, "ended"); /* and lives on, until it is killed */
    trc_image_reader_set_patience(reader, LONG_PATIENCE);
    loads_good(reader);
    trc_image_reader_release(reader);
    has_no_children();
}

static void answers_without_sense(void **state) {
    (void)state;
    static const char *const names[] = {
        "no_magic",   "unknown_kind", "rows_first",     "done_first",     "no_width",
        "no_height",  "no_channels",  "five_channels",  "unknown_format", "unknown_alpha",
        "wrong_slot", "far_slot",     "unknown_status", "ok_status",      "no_rows",
        "many_rows",  "all_rows",     "done_early",     "info_twice",     "huge_for_its_file"};
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        fails(reader, names[i], TRC_ERROR_IMAGE, "nonsense");
    fails(reader, "too_wide", TRC_ERROR_TOO_LARGE, "4294967295 x 4294967295");
    loads_good(reader);
    trc_image_reader_release(reader);
}

static void failures_are_one_line(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    fails(reader, "fails", TRC_ERROR_IMAGE, ": line one line two");
    assert_null(strpbrk(trc_last_message(), "\n\t"));
    fails(reader, "fails_at_length", TRC_ERROR_OUT_OF_MEMORY, "xxxx");
    trc_image_reader_release(reader);
}

/* A process whose memory another file may have damaged is not to blame for the next. */
static void files_are_read_again_in_a_new_process(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    struct trc_image *image;
    loads_good(reader);
    assert_int_equal(load(reader, "dies_if_used", &image), TRC_OK);
    check_good(image);
    trc_image_release(image);
    assert_int_equal(load(reader, "talks_on", &image), TRC_OK); /* what comes after is not heard */
    trc_image_release(image);
    loads_good(reader);
    trc_image_reader_release(reader);
}

static void the_program_is_started_again(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    loads_good(reader);
    fails(reader, "kills_launcher", TRC_ERROR_IMAGE, "ended");
    loads_good(reader);
    trc_image_reader_release(reader);
    has_no_children();
}

/* ---- what is left behind ---- */

static void nothing_is_left(void **state) {
    (void)state;
    const uint64_t bytes = trc_memory_bytes();
    const int descriptors = count_descriptors();
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    loads_good(reader);
    const int in_use = count_descriptors();
    for (int i = 0; i < 5; i++) {
        fails(reader, "dies", TRC_ERROR_IMAGE, "signal");
        loads_good(reader);
    }
    assert_int_equal(count_descriptors(), in_use);
    trc_image_reader_release(reader);
    assert_int_equal(count_descriptors(), descriptors);
    assert_int_equal(trc_memory_bytes(), bytes);
    has_no_children();
}

/* Hosts that reap their children unasked, or have no standard streams. */
static void hosts_of_every_kind(void **state) {
    (void)state;
    struct sigaction ignored = {.sa_handler = SIG_IGN}, former;
    assert_int_equal(sigaction(SIGCHLD, &ignored, &former), 0);
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    loads_good(reader);
    fails(reader, "dies", TRC_ERROR_IMAGE, "signal 11");
    trc_image_reader_release(reader);
    sigaction(SIGCHLD, &former, NULL);

    const int copies[3] = {dup(0), dup(1), dup(2)};
    for (int i = 0; i < 3; i++)
        close(i);
    reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    struct trc_image *image;
    const trc_status status = load(reader, "good", &image);
    /* None of them became something else's. */
    const bool are_closed = fcntl(0, F_GETFD) < 0 && fcntl(1, F_GETFD) < 0 && fcntl(2, F_GETFD) < 0;
    for (int i = 0; i < 3; i++) {
        dup2(copies[i], i);
        close(copies[i]);
    }
    assert_int_equal(status, TRC_OK);
    assert_true(are_closed);
    trc_image_release(image);
    trc_image_reader_release(reader);
}

/* Processes that read end with a host that dies in the midst of it. */
static void processes_end_with_the_host(void **state) {
    (void)state;
    const char *const list = "hangs.pid";
    unlink(path_of(list));
    const pid_t host = fork();
    assert_true(host >= 0);
    if (host == 0) {
        struct trc_image *image;
        (void)load(reader_of(TRC_BAD_READER, LONG_PATIENCE), "hangs", &image);
        _exit(0);
    }
    long process = 0, program = 0;
    for (int i = 0; i < 2000 && !program; i++) {
        FILE *file = fopen(path_of(list), "r");
        if (file && fscanf(file, "%ld %ld", &process, &program) != 2)
            program = 0;
        if (file)
            fclose(file);
        usleep(10000);
    }
    assert_true(program > 1 && process > 1);
    assert_int_equal(kill((pid_t)process, 0), 0);
    assert_int_equal(kill(host, SIGKILL), 0);
    assert_int_equal(waitpid(host, NULL, 0), host);
    for (int i = 0; i < 2000 && (!kill((pid_t)process, 0) || !kill((pid_t)program, 0)); i++) {
        /* In a container nobody may reap them: then they are zombies. */
        char name[64], line[256] = "";
        snprintf(name, sizeof name, "/proc/%ld/stat", process);
        FILE *file = fopen(name, "r");
        if (file && fgets(line, sizeof line, file) && strstr(line, ") Z "))
            i = 2000;
        if (file)
            fclose(file);
        assert_true(i != 1999);
        usleep(10000);
    }
}

/* ---- programs ---- */

static void no_program(const char *program, double patience, const char *why) {
    struct trc_image_reader *reader = reader_of(program, patience);
    struct trc_image *image;
    char first[512];
    for (int i = 0; i < 2; i++) { /* it is not tried for each file */
        trc_image_reader_start(reader);
        assert_int_equal(load(reader, "good", &image), TRC_ERROR_UNSUPPORTED);
        if (!strstr(trc_last_message(), why) || !strstr(trc_last_message(), program))
            fail_msg("%s: %s", program, trc_last_message());
        if (i)
            assert_string_equal(first, trc_last_message());
        snprintf(first, sizeof first, "%s", trc_last_message());
    }
    trc_image_reader_release(reader);
    has_no_children();
}

static void programs_that_are_none(void **state) {
    (void)state;
    char path[512];
    no_program("/nonexistent/reader", LONG_PATIENCE, "No such file");
    no_program(folder, LONG_PATIENCE, "cannot be started");
    snprintf(path, sizeof path, "%s", make_file("plain", "#!/bin/sh\n", 0600));
    no_program(path, LONG_PATIENCE, "Permission denied");
    snprintf(path, sizeof path, "%s", make_file("ends", "#!/bin/sh\nexit 1\n", 0700));
    no_program(path, LONG_PATIENCE, "it has ended");
    snprintf(path, sizeof path, "%s",
             make_file("hangs", "#!/bin/sh\nread x <&3\nread y <&3\n", 0700));
    no_program(path, SHORT_PATIENCE, "it does not answer");
    snprintf(path, sizeof path, "%s",
             make_file("chatters", "#!/bin/sh\nwhile echo nonsense >&3; do :; done\n", 0700));
    no_program(path, LONG_PATIENCE, "it answers nonsense");
}

/* ---- reading ahead ---- */

static void expect(struct trc_prefetch *prefetch, const char *name, trc_image_desc *desc) {
    *desc = (trc_image_desc){.struct_size = sizeof *desc,
                             .path = strdup(make_file(name, "not read", 0600))};
    trc_prefetch_add(prefetch, desc);
}

/* What was added comes once, as if it had been read then; what was not is for the caller. */
static void images_read_ahead(void **state) {
    (void)state;
    static const char *const names[] = {"a", "b", "c", "d", "dies", "e", "f", "fails", "g"};
    enum { COUNT = sizeof names / sizeof *names };
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    struct trc_prefetch *prefetch;
    assert_int_equal(trc_prefetch_create(reader, 0, &prefetch), TRC_OK);
    trc_image_desc descs[COUNT], other;
    for (size_t i = 0; i < COUNT; i++) {
        expect(prefetch, names[i], &descs[i]);
        trc_prefetch_add(prefetch, &descs[i]);
    }
    other = descs[0];
    other.max_side = 1;
    struct trc_image *image = NULL;
    trc_status status;
    assert_false(trc_prefetch_take(prefetch, &other, &status, &image));
    const struct trc_image_source source = {.reader = reader};
    for (size_t i = 0; i + 1 < COUNT; i++) { /* the last is not asked for */
        image = NULL;
        if (!trc_prefetch_take(prefetch, &descs[i], &status, &image))
            status = trc_image_load(&descs[i], &source, &image);
        const bool is_bad = strchr("df", names[i][0]) && names[i][1];
        assert_int_equal(status, is_bad ? TRC_ERROR_IMAGE : TRC_OK);
        if (is_bad)
            assert_non_null(strstr(trc_last_message(), descs[i].path));
        else
            check_good(image);
        trc_image_release(image);
        assert_false(trc_prefetch_take(prefetch, &descs[i], &status, &image));
    }
    trc_prefetch_destroy(prefetch);
    trc_prefetch_destroy(NULL);
    for (size_t i = 0; i < COUNT; i++)
        free((char *)descs[i].path);
    trc_image_reader_release(reader);
}

/* A file that hangs keeps nobody from giving up. */
static void reading_ahead_is_cancelled(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, 1e6);
    struct trc_prefetch *prefetch;
    trc_image_desc desc;
    unlink(path_of("hangs.pid"));
    assert_int_equal(trc_prefetch_create(reader, 0, &prefetch), TRC_OK);
    expect(prefetch, "hangs", &desc);
    while (access(path_of("hangs.pid"), F_OK))
        usleep(1000);
    trc_prefetch_destroy(prefetch);
    free((char *)desc.path);
    loads_good(reader);
    trc_image_reader_release(reader);
}

/* Without memory for it an image is not read ahead, and is read all the same. */
static void reading_ahead_without_memory(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    for (int64_t n = 0; n < 12; n++) {
        struct trc_prefetch *prefetch;
        trc_image_desc desc;
        struct trc_image *image = NULL;
        trc_status status = TRC_ERROR_OUT_OF_MEMORY;
        trc_memory_fail_at(n, false);
        if (trc_prefetch_create(reader, 0, &prefetch) == TRC_OK) {
            expect(prefetch, "good", &desc);
            const bool is_taken = trc_prefetch_take(prefetch, &desc, &status, &image);
            trc_memory_fail_at(-1, false);
            const struct trc_image_source source = {.reader = reader};
            if (!is_taken)
                status = trc_image_load(&desc, &source, &image);
            assert_int_equal(status, TRC_OK);
            check_good(image);
            trc_image_release(image);
            trc_prefetch_destroy(prefetch);
            free((char *)desc.path);
        }
        trc_memory_fail_at(-1, false);
    }
    trc_image_reader_release(reader);
}

/* Several threads share a reader. */
static void *load_many(void *reader) {
    for (int i = 0; i < 20; i++) {
        const struct trc_image_source source = {.reader = reader};
        char path[512];
        snprintf(path, sizeof path, "%s/%s", folder, i % 5 ? "good" : "dies");
        const trc_image_desc desc = {.struct_size = sizeof desc, .path = path};
        struct trc_image *image = NULL;
        const trc_status status = trc_image_load(&desc, &source, &image);
        if (status != (i % 5 ? TRC_OK : TRC_ERROR_IMAGE))
            return "wrong status";
        trc_image_release(image);
    }
    return NULL;
}

static void threads_share_a_reader(void **state) {
    (void)state;
    pthread_t threads[4];
    make_file("good", "not read", 0600);
    make_file("dies", "not read", 0600);
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    for (int i = 0; i < 4; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, load_many, reader), 0);
    for (int i = 0; i < 4; i++) {
        void *failure;
        pthread_join(threads[i], &failure);
        assert_null(failure);
    }
    trc_image_reader_release(reader);
    has_no_children();
}

/* ---- memory ---- */

static void every_allocation_fails(void **state) {
    (void)state;
    bool is_read = false;
    int refused = 0;
    make_file("good", "not read", 0600);
    for (int64_t n = 0; !is_read; n++) {
        const uint64_t bytes = trc_memory_bytes();
        const int descriptors = count_descriptors();
        struct trc_image_reader *reader = NULL;
        struct trc_image *image = NULL;
        trc_memory_fail_at(n, false);
        trc_status status = trc_image_reader_create(TRC_BAD_READER, NULL, &reader);
        if (status == TRC_OK)
            status = load(reader, "good", &image);
        trc_memory_fail_at(-1, false);
        is_read = status == TRC_OK;
        assert_true(is_read || status == TRC_ERROR_OUT_OF_MEMORY);
        refused += !is_read;
        if (reader)
            loads_good(reader);
        trc_image_release(image);
        trc_image_reader_release(reader);
        assert_int_equal(trc_memory_bytes(), bytes);
        assert_int_equal(count_descriptors(), descriptors);
    }
    assert_true(refused >= 6);
}

/* ---- handles ---- */

static void readers_of_scenes(void **state) {
    (void)state;
    trc_reader reader = 0;
    trc_scene scene = 0;
    trc_id image = 0;
    const trc_reader_desc desc = {.struct_size = sizeof desc, .program = TRC_BAD_READER};
    trc_reader_desc wrong = desc;
    wrong.struct_size = 1;
    assert_int_equal(trc_reader_create(&wrong, &reader), TRC_ERROR_STRUCT_SIZE);
    assert_int_equal(trc_reader_create(&desc, NULL), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_reader_create(&desc, &reader), TRC_OK);
    assert_int_equal(trc_reader_start(reader), TRC_OK);
    trc_scene_desc scene_desc = {.struct_size = sizeof scene_desc, .reader = reader + 1};
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_ERROR_INVALID_HANDLE);
    scene_desc.reader = reader;
    assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
    assert_int_equal(trc_reader_destroy(reader), TRC_OK); /* the scene keeps it */
    assert_int_equal(trc_reader_destroy(reader), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_reader_start(reader), TRC_ERROR_INVALID_HANDLE);
    const trc_image_desc good = {.struct_size = sizeof good,
                                 .path = make_file("good", "not read", 0600)};
    assert_int_equal(trc_image_expect(scene, &good), TRC_OK);
    assert_int_equal(trc_image_create(scene, &good, &image), TRC_OK);
    assert_int_equal(trc_image_expect(scene, &good), TRC_OK); /* not asked for */
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    trc_image_desc pixels = {.struct_size = sizeof pixels, .width = 1, .height = 1};
    static const uint8_t pixel[4];
    pixels.pixels = pixel;
    pixels.pixel_bytes = 4;
    assert_int_equal(trc_image_expect(scene, &pixels), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    has_no_children();
}

/* ---- files ---- */

static void files_that_are_none(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of("/nonexistent/reader", LONG_PATIENCE);
    const struct trc_image_source source = {.reader = reader};
    struct trc_image *image = NULL;
    const char *pipe_path = path_of("pipe");
    assert_true(mkfifo(pipe_path, 0600) == 0 || errno == EEXIST);
    const char *const paths[] = {"/nonexistent/image.png", folder, pipe_path, "/dev/zero", ""};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) { /* none gets to a program */
        const trc_image_desc desc = {.struct_size = sizeof desc, .path = paths[i]};
        assert_int_equal(trc_image_load(&desc, &source, &image), TRC_ERROR_IMAGE);
        assert_non_null(strstr(trc_last_message(), paths[i]));
    }
    trc_image_reader_release(reader);
}

static void relative_paths(void **state) {
    (void)state;
    char here[4096];
    assert_non_null(getcwd(here, sizeof here));
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    loads_good(reader); /* the program has been started elsewhere */
    assert_int_equal(chdir(folder), 0);
    const struct trc_image_source source = {.reader = reader};
    const trc_image_desc good = {.struct_size = sizeof good, .path = "good"};
    struct trc_image *image = NULL;
    const trc_status status = trc_image_load(&good, &source, &image);
    char *absolute = NULL;
    uint64_t bytes = 0;
    assert_int_equal(trc_file_look("good", &absolute, &bytes), TRC_OK);
    assert_int_equal(chdir(here), 0);
    assert_int_equal(status, TRC_OK);
    assert_string_equal(absolute, path_of("good"));
    assert_int_equal(bytes, strlen("not read"));
    trc_free(absolute);
    trc_image_release(image);
    trc_image_reader_release(reader);
}

static void remove_folder(void) {
    DIR *directory = opendir(folder);
    if (!directory)
        return;
    for (struct dirent *entry; (entry = readdir(directory));)
        if (entry->d_name[0] != '.')
            unlink(path_of(entry->d_name));
    closedir(directory);
    rmdir(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(processes_that_die),
        cmocka_unit_test(processes_that_hang),
        cmocka_unit_test(answers_without_sense),
        cmocka_unit_test(failures_are_one_line),
        cmocka_unit_test(files_are_read_again_in_a_new_process),
        cmocka_unit_test(the_program_is_started_again),
        cmocka_unit_test(nothing_is_left),
        cmocka_unit_test(hosts_of_every_kind),
        cmocka_unit_test(processes_end_with_the_host),
        cmocka_unit_test(programs_that_are_none),
        cmocka_unit_test(images_read_ahead),
        cmocka_unit_test(reading_ahead_is_cancelled),
        cmocka_unit_test(reading_ahead_without_memory),
        cmocka_unit_test(threads_share_a_reader),
        cmocka_unit_test(every_allocation_fails),
        cmocka_unit_test(readers_of_scenes),
        cmocka_unit_test(files_that_are_none),
        cmocka_unit_test(relative_paths),
    };
    const char *temporary = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/trc_reader_XXXXXX", temporary ? temporary : "/tmp");
    if (!mkdtemp(folder))
        return EXIT_FAILURE;
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    remove_folder();
    return failed;
}
