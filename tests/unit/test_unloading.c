/* The library as a host loads it: from a folder of any name, used by several threads of its own,
 * and gone afterwards, so that its file can be replaced while the host runs. */
#define _XOPEN_SOURCE 700 /* P_tmpdir, mkdir */
#include "query_test.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#else
#include <dlfcn.h>
#include <sys/stat.h>
#endif

/* Latin, Greek, Chinese. */
#define FOLDER "pl\xc3\xa4tze \xce\xb1\xce\xb2 \xe5\x9b\xbe"
#define PATH_BYTES 1024

enum { EDGE = 64, SAMPLES = 2, THREADS = 4 };

/* ---- the system's part ---- */

#ifdef _WIN32
typedef HMODULE module;

static const wchar_t *wide_of(const char *path) {
    static wchar_t wide[2][PATH_BYTES];
    static unsigned turn;
    wchar_t *out = wide[turn++ % 2];
    assert_true(MultiByteToWideChar(CP_UTF8, 0, path, -1, out, PATH_BYTES));
    for (wchar_t *c = out; *c; c++) /* LoadLibrary knows no others */
        *c = *c == L'/' ? L'\\' : *c;
    return out;
}
static void make_folder(const char *path) { CreateDirectoryW(wide_of(path), NULL); }
static void remove_folder(const char *path) { RemoveDirectoryW(wide_of(path)); }
static void copy_file(const char *from, const char *to) {
    const wchar_t *wide_from = wide_of(from);
    assert_true(CopyFileW(wide_from, wide_of(to), FALSE));
}
static module load(const char *path) { return LoadLibraryW(wide_of(path)); }
static void *find(module library, const char *name) {
    return (void *)(uintptr_t)GetProcAddress(library, name);
}
static void unload(module library) { assert_true(FreeLibrary(library)); }
/* Which the system does not let happen to what is loaded. */
static bool remove_file(const char *path) { return DeleteFileW(wide_of(path)); }
#else
typedef void *module;

static void make_folder(const char *path) { (void)mkdir(path, 0700); }
static void remove_folder(const char *path) { (void)remove(path); }
static void copy_file(const char *from, const char *to) {
    static char block[1 << 16];
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    assert_non_null(in);
    assert_non_null(out);
    for (size_t count; (count = fread(block, 1, sizeof block, in)) > 0;)
        assert_int_equal(fwrite(block, 1, count, out), count);
    fclose(in);
    assert_int_equal(fclose(out), 0);
}
static module load(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *find(module library, const char *name) { return dlsym(library, name); }
static void unload(module library) { assert_int_equal(dlclose(library), 0); }
static bool remove_file(const char *path) {
    const module left = dlopen(path, RTLD_NOW | RTLD_NOLOAD);
    return remove(path) == 0 && !left;
}
#endif

/* ---- the host's part ---- */

/* A function of the library, of the type that the headers give it. */
#define FIND(library, name) ((__typeof__(&name))(uintptr_t)find(library, #name))

/* An empty scene, rendered: threads are started and end. */
static void use(module library) {
    const trc_scene_desc scene_desc = FIND(library, trc_scene_desc_default)();
    const trc_camera_desc camera = FIND(library, trc_camera_desc_default)();
    trc_render_desc desc = FIND(library, trc_render_desc_default)();
    trc_scene scene = 0;
    trc_render render = 0;
    static float pixels[4 * EDGE * EDGE];
    desc.width = desc.height = EDGE;
    desc.sample_count = SAMPLES;
    desc.thread_count = THREADS;
    assert_ok(FIND(library, trc_scene_create)(&scene_desc, &scene));
    assert_ok(FIND(library, trc_scene_set_camera)(scene, &camera));
    assert_ok(FIND(library, trc_scene_commit)(scene));
    assert_ok(FIND(library, trc_render_start)(scene, &desc, &render));
    assert_ok(FIND(library, trc_render_wait)(render, 60.0));
    assert_ok(FIND(library, trc_render_read)(render, TRC_PASS_COMBINED, pixels,
                                             sizeof pixels / sizeof *pixels));
    assert_true(pixels[3] == 1.0f && pixels[4 * EDGE * EDGE - 1] == 1.0f);
    assert_ok(FIND(library, trc_render_destroy)(render));
    assert_ok(FIND(library, trc_scene_destroy)(scene));
}

static void loaded_used_and_unloaded(void **state) {
    (void)state;
    const char *const temporary = getenv("TMPDIR");
    const char *const name = strrchr(TRC_TEST_LIBRARY, '/');
    char folder[PATH_BYTES / 2], path[PATH_BYTES];
    snprintf(folder, sizeof folder, "%s/trc_%s", temporary ? temporary : P_tmpdir, FOLDER);
    snprintf(path, sizeof path, "%s%s", folder, name);
    make_folder(folder);
    for (int turn = 0; turn < 3; turn++) {
        copy_file(TRC_TEST_LIBRARY, path);
        const module library = load(path);
        assert_non_null(library);
        use(library);
        unload(library);
        assert_true(remove_file(path));
    }
    remove_folder(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(loaded_used_and_unloaded)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
