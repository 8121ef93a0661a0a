/* Paths of files: long ones, names in every script, what is no file. */
#define _XOPEN_SOURCE 700 /* P_tmpdir, mkdir */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "image/process.h"

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#else
#include <sys/stat.h>
#include <unistd.h>
#endif

/* Latin, Greek, Chinese and, beyond 16 bits, a pictogram. */
#define NAME "pl\xc3\xa4tze \xce\xb1\xce\xb2 \xe5\x9b\xbe \xf0\x9f\x8e\xa8"
/* Of these the path is longer than the 260 characters that Windows once knew, and shorter than the
 * 255 bytes of a name on Linux. */
#define DEPTH 6
#define FILL "a folder whose name is as long as artists may make them"
#define CONTENT "1234567"

#ifdef _WIN32
/* To be freed. The prefix lets it be long. */
static wchar_t *wide_of(const char *path) {
    wchar_t *wide = malloc(4096 * sizeof *wide), relative[4096];
    assert_non_null(wide);
    assert_true(MultiByteToWideChar(CP_UTF8, 0, path, -1, relative, 4096));
    wcscpy(wide, L"\\\\?\\");
    assert_true(GetFullPathNameW(relative, 4000, wide + 4, NULL));
    return wide;
}
#endif

static void make_folder(const char *path) {
#ifdef _WIN32
    wchar_t *wide = wide_of(path);
    assert_true(CreateDirectoryW(wide, NULL) || GetLastError() == ERROR_ALREADY_EXISTS);
    free(wide);
#else
    (void)mkdir(path, 0700);
#endif
}

static void make_file(const char *path) {
#ifdef _WIN32
    wchar_t *wide = wide_of(path);
    DWORD written = 0;
    const HANDLE file = CreateFileW(wide, GENERIC_WRITE, 0, NULL, CREATE_ALWAYS, 0, NULL);
    assert_true(WriteFile(file, CONTENT, strlen(CONTENT), &written, NULL));
    CloseHandle(file);
    free(wide);
#else
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(CONTENT, file);
    assert_int_equal(fclose(file), 0);
#endif
}

static void remove_path(const char *path) {
#ifdef _WIN32
    wchar_t *wide = wide_of(path);
    if (!DeleteFileW(wide))
        RemoveDirectoryW(wide);
    free(wide);
#else
    (void)remove(path);
#endif
}

static void looks_as(const char *path, const char *reason) {
    char *absolute = NULL;
    uint64_t bytes = 0;
    assert_int_equal(trc_file_look(path, &absolute, &bytes), TRC_ERROR_IMAGE);
    assert_null(absolute);
    if (!strstr(trc_last_message(), path) || !strstr(trc_last_message(), reason))
        fail_msg("%s", trc_last_message());
}

static void long_paths_in_every_script(void **state) {
    (void)state;
    const char *const temporary = getenv("TMPDIR");
    char path[2048], *absolute = NULL;
    size_t ends[DEPTH + 1];
    uint64_t bytes = 0;
    ends[0] = (size_t)snprintf(path, sizeof path, "%s/trc_files", temporary ? temporary : P_tmpdir);
    make_folder(path);
    for (int i = 1; i <= DEPTH; i++) {
        ends[i] = ends[i - 1] + (size_t)snprintf(path + ends[i - 1], sizeof path - ends[i - 1],
                                                 "/%s", i % 2 ? FILL : NAME);
        make_folder(path);
    }
    const size_t deepest = ends[DEPTH];
    snprintf(path + deepest, sizeof path - deepest, "/%s", NAME ".png");
    assert_true(strlen(path) > 260);
    looks_as(path, "No such file");
    make_file(path);
    const trc_status status = trc_file_look(path, &absolute, &bytes);
    remove_path(path);
    path[deepest] = '\0';
    looks_as(path, "it is not a file"); /* a folder */
    for (int i = DEPTH; i >= 0; i--) {
        path[ends[i]] = '\0';
        remove_path(path);
    }
    assert_int_equal(status, TRC_OK);
    assert_int_equal(bytes, strlen(CONTENT));
    assert_string_equal(absolute + strlen(absolute) - strlen(NAME ".png"), NAME ".png");
    trc_free(absolute);
}

static void programs_are_beside_the_library(void **state) {
    (void)state;
    char *path = trc_file_beside_library("tracer_reader");
    assert_non_null(path);
    const char *name = strstr(path, "tracer_reader");
    assert_non_null(name);
    assert_true(name > path && strchr("/\\", name[-1]));
    trc_free(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(long_paths_in_every_script),
        cmocka_unit_test(programs_are_beside_the_library),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
