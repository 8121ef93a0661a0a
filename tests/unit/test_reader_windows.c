/* Processes that read images, on Windows: what they do costs the file alone, and leaves nothing
 * behind (elsewhere: test_reader.c). The program is bad_reader.c, which does what the name of a
 * file says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include "core/core.h"
#include "image/image.h"
#include "image/reader.h"
#include "programs/bad_reader.h"

/* Waits end early in the tests of what hangs, and never in the others. */
#define SHORT_PATIENCE 1.0
#define LONG_PATIENCE 60.0

static struct trc_image_reader *reader_of(const char *program, double patience) {
    struct trc_image_reader *reader;
    assert_int_equal(trc_image_reader_create(program, NULL, &reader), TRC_OK);
    trc_image_reader_set_patience(reader, patience);
    return reader;
}

/* A file of that name, in the folder for passing ones. */
static const char *make_file(const char *name) {
    static char path[512];
    const char *const temporary = getenv("TMPDIR");
    snprintf(path, sizeof path, "%s/%s", temporary ? temporary : ".", name);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("not read", file);
    assert_int_equal(fclose(file), 0);
    return path;
}

static trc_status load(struct trc_image_reader *reader, const char *name,
                       struct trc_image **image_out) {
    const struct trc_image_source source = {.reader = reader};
    const trc_image_desc desc = {.struct_size = sizeof desc, .path = make_file(name)};
    *image_out = NULL;
    const trc_status status = trc_image_load(&desc, &source, image_out);
    remove(desc.path);
    return status;
}

static void loads_good(struct trc_image_reader *reader) {
    struct trc_image *image;
    const trc_status status = load(reader, "trc_good", &image);
    if (status != TRC_OK)
        fail_msg("status %d: %s", status, trc_last_message());
    const uint8_t *texels = image->levels[0].texels;
    assert_int_equal(image->levels[0].width, GOOD_WIDTH);
    assert_int_equal(image->levels[0].height, GOOD_HEIGHT);
    for (int y = 0; y < GOOD_HEIGHT; y++)
        for (int x = 0; x < GOOD_WIDTH; x++)
            assert_int_equal(texels[4 * (GOOD_WIDTH * y + x)], 10 * (GOOD_HEIGHT - 1 - y));
    trc_image_release(image);
}

static void fails(struct trc_image_reader *reader, const char *name, const char *why) {
    struct trc_image *image;
    const trc_status status = load(reader, name, &image);
    if (status != TRC_ERROR_IMAGE || !strstr(trc_last_message(), why))
        fail_msg("%s: status %d: %s", name, status, trc_last_message());
    assert_null(image);
}

static void processes_that_misbehave(void **state) {
    (void)state;
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    fails(reader, "ends", "code 3");
    loads_good(reader);
    fails(reader, "dies", "its reader ended");
    fails(reader, "dies_halfway", "its reader ended");
    fails(reader, "says_half", "ended");
    static const char *const lies[] = {"no_magic", "rows_first", "no_width", "far_slot",
                                       "many_rows"};
    for (size_t i = 0; i < sizeof lies / sizeof *lies; i++)
        fails(reader, lies[i], "nonsense");
    loads_good(reader);
    trc_image_reader_set_patience(reader, SHORT_PATIENCE);
    fails(reader, "hangs_halfway", "no progress for");
    trc_image_reader_set_patience(reader, LONG_PATIENCE);
    loads_good(reader);
    trc_image_reader_release(reader);
}

static void programs_that_are_none(void **state) {
    (void)state;
    static const char *const programs[] = {"Z:\\nonexistent\\reader.exe", __FILE__};
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        struct trc_image_reader *reader = reader_of(programs[i], LONG_PATIENCE);
        struct trc_image *image;
        assert_int_equal(load(reader, "trc_good", &image), TRC_ERROR_UNSUPPORTED);
        if (!strstr(trc_last_message(), "cannot be started"))
            fail_msg("%s", trc_last_message());
        trc_image_reader_release(reader);
    }
}

/* wine takes limits of jobs and forgets them. */
static bool system_has_limits(void) {
    JOBOBJECT_EXTENDED_LIMIT_INFORMATION limits = {.ProcessMemoryLimit = 1 << 30};
    limits.BasicLimitInformation.LimitFlags = JOB_OBJECT_LIMIT_PROCESS_MEMORY;
    const HANDLE job = CreateJobObjectW(NULL, NULL);
    assert_non_null(job);
    assert_true(
        SetInformationJobObject(job, JobObjectExtendedLimitInformation, &limits, sizeof limits));
    memset(&limits, 0, sizeof limits);
    assert_true(QueryInformationJobObject(job, JobObjectExtendedLimitInformation, &limits,
                                          sizeof limits, NULL));
    CloseHandle(job);
    return limits.ProcessMemoryLimit == 1 << 30;
}

static void memory_is_limited(void **state) {
    (void)state;
    if (!system_has_limits())
        skip();
    struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
    struct trc_image *image;
    assert_int_equal(load(reader, "swells", &image), TRC_ERROR_OUT_OF_MEMORY);
    loads_good(reader);
    trc_image_reader_release(reader);
}

static DWORD count_handles(void) {
    DWORD count = 0;
    assert_true(GetProcessHandleCount(GetCurrentProcess(), &count));
    return count;
}

static void nothing_is_left(void **state) {
    (void)state;
    const uint64_t bytes = trc_memory_bytes();
    DWORD handles = 0;
    for (int turn = 0; turn < 3; turn++) {
        struct trc_image_reader *reader = reader_of(TRC_BAD_READER, LONG_PATIENCE);
        loads_good(reader);
        fails(reader, "ends", "code 3");
        loads_good(reader);
        trc_image_reader_release(reader);
        if (turn == 0) /* the system keeps some from the first time on */
            handles = count_handles();
    }
    assert_int_equal(count_handles(), handles);
    assert_int_equal(trc_memory_bytes(), bytes);
}

static void every_allocation_fails(void **state) {
    (void)state;
    bool is_read = false;
    int refused = 0;
    for (int64_t n = 0; !is_read; n++) {
        const uint64_t bytes = trc_memory_bytes();
        struct trc_image_reader *reader = NULL;
        struct trc_image *image = NULL;
        trc_memory_fail_at(n, false);
        trc_status status = trc_image_reader_create(TRC_BAD_READER, NULL, &reader);
        if (status == TRC_OK)
            status = load(reader, "trc_good", &image);
        trc_memory_fail_at(-1, false);
        is_read = status == TRC_OK;
        assert_true(is_read || status == TRC_ERROR_OUT_OF_MEMORY);
        refused += !is_read;
        trc_image_release(image);
        trc_image_reader_release(reader);
        assert_int_equal(trc_memory_bytes(), bytes);
    }
    assert_true(refused >= 6);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(processes_that_misbehave), cmocka_unit_test(programs_that_are_none),
        cmocka_unit_test(memory_is_limited),        cmocka_unit_test(nothing_is_left),
        cmocka_unit_test(every_allocation_fails),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
