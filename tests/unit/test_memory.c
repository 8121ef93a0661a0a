/* Textures, trees and films under a limit of address space: what does not fit is refused before any
 * of it is taken, and all that was there stays in use. In a process of its own. */
#define _GNU_SOURCE /* mallopt, rlimits */
#include "fixture.h"

#include <inttypes.h>
#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/carver.h"
#include "core/core.h"
#include "model/sequence.h"

#define MIB (UINT64_C(1) << 20)

/* Above what the process has mapped at the start. */
#define ROOM (400 * MIB)
/* Enough for a small picture and a thread, not for the tree of two million triangles. */
#define TREE_ROOM (40 * MIB)

/* Of the pictures that show whether everything still works. */
enum { SIZE = 48, FRAME = SIZE * SIZE };

/* In the process of its own: tells what is wrong and ends it. */
#define REQUIRE(condition)                                                                  \
    do {                                                                                    \
        if (!(condition)) {                                                                 \
            fprintf(stderr, "line %d: %s: %s\n", __LINE__, #condition, trc_last_message()); \
            _exit(1);                                                                       \
        }                                                                                   \
    } while (0)

static uint64_t mapped_bytes(void) {
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    REQUIRE(file && fscanf(file, "%lu", &pages) == 1);
    fclose(file);
    return pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

static void limit_address_space(uint64_t room) {
    struct rlimit limit;
    REQUIRE(getrlimit(RLIMIT_AS, &limit) == 0);
    limit.rlim_cur = mapped_bytes() + room;
    REQUIRE(setrlimit(RLIMIT_AS, &limit) == 0);
}

/* ---- what takes memory ---- */

static trc_status add_texture(trc_scene scene, uint32_t size, trc_id *image) {
    const uint64_t bytes = (uint64_t)4 * size * size;
    uint8_t *pixels = malloc(bytes);
    REQUIRE(pixels);
    memset(pixels, 100, bytes);
    trc_image_desc desc = default_image_desc();
    desc.width = desc.height = size;
    desc.is_float = 0;
    desc.pixels = pixels;
    desc.pixel_bytes = bytes;
    const trc_status status = trc_image_create(scene, &desc, image);
    free(pixels);
    return status;
}

/* A level grid of 2 * n * n triangles, n + 1 vertices along a side. */
static trc_status add_grid(trc_scene scene, uint32_t n, trc_id *mesh, trc_id *instance) {
    const uint64_t vertices = (uint64_t)(n + 1) * (n + 1), triangles = (uint64_t)2 * n * n;
    float *positions = malloc(3 * vertices * sizeof *positions);
    uint32_t *indices = malloc(3 * triangles * sizeof *indices), *index = indices;
    REQUIRE(positions && indices);
    for (uint64_t i = 0; i < vertices; i++) {
        positions[3 * i] = 4.0f * (float)(i % (n + 1)) / (float)n;
        positions[3 * i + 1] = 4.0f * (float)(i / (n + 1)) / (float)n - 2.0f;
        positions[3 * i + 2] = 0.1f * sinf((float)i);
    }
    for (uint32_t y = 0; y < n; y++)
        for (uint32_t x = 0; x < n; x++) {
            const uint32_t a = y * (n + 1) + x, b = a + n + 1;
            const uint32_t corners[6] = {a, a + 1, b + 1, a, b + 1, b};
            memcpy(index, corners, sizeof corners);
            index += 6;
        }
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = (uint32_t)vertices;
    desc.triangle_count = (uint32_t)triangles;
    desc.positions = positions;
    desc.position_count = 3 * vertices;
    desc.indices = indices;
    desc.index_count = 3 * triangles;
    trc_status status = trc_mesh_create(scene, &desc, mesh);
    free(positions);
    free(indices);
    if (status != TRC_OK)
        return status;
    const trc_instance_desc instance_desc = default_instance_desc(*mesh);
    return trc_instance_create(scene, &instance_desc, instance);
}

/* A scene with textures and trees of some 100 MiB. */
static trc_scene furnished_scene(void) {
    const trc_scene_desc scene_desc = {.struct_size = sizeof scene_desc, .thread_count = 1};
    const trc_camera_desc camera = default_camera_desc();
    const trc_light_desc light = default_light_desc();
    trc_scene scene = 0;
    trc_id image, mesh, id;
    REQUIRE(trc_scene_create(&scene_desc, &scene) == TRC_OK);
    REQUIRE(trc_scene_set_camera(scene, &camera) == TRC_OK);
    REQUIRE(trc_light_create(scene, &light, &id) == TRC_OK);
    for (int i = 0; i < 3; i++)
        REQUIRE(add_texture(scene, 2048, &image) == TRC_OK);
    REQUIRE(add_grid(scene, 400, &mesh, &id) == TRC_OK);
    REQUIRE(trc_scene_commit(scene) == TRC_OK);
    return scene;
}

static void draw(trc_scene scene, float *pixels) {
    trc_render_desc desc = default_render_desc(SIZE, SIZE, 2);
    trc_render render = 0;
    desc.thread_count = 1;
    REQUIRE(trc_render_start(scene, &desc, &render) == TRC_OK);
    REQUIRE(trc_render_wait(render, -1.0) == TRC_OK);
    REQUIRE(trc_render_read(render, TRC_PASS_COMBINED, pixels, 4 * FRAME) == TRC_OK);
    REQUIRE(trc_render_destroy(render) == TRC_OK);
}

/* ---- what is refused ---- */

/* The scene draws the same picture as ever. */
static void expect_picture(trc_scene scene, const float *picture) {
    static float pixels[4 * FRAME];
    draw(scene, pixels);
    REQUIRE(memcmp(pixels, picture, sizeof pixels) == 0);
}

/* The frame is too large, and nothing was taken to find out. */
static void expect_refused(trc_scene scene, const trc_render_desc *desc) {
    const uint64_t used = trc_memory_bytes(), peak = trc_memory_peak_bytes(), small = MIB;
    trc_render render = 0;
    REQUIRE(trc_render_start(scene, desc, &render) == TRC_ERROR_TOO_LARGE);
    REQUIRE(render == 0 && trc_memory_bytes() == used);
    REQUIRE(trc_memory_peak_bytes() - used < small || trc_memory_peak_bytes() == peak);
}

static trc_render_desc frame_desc(uint32_t width, uint32_t height) {
    trc_render_desc desc = default_render_desc(width, height, 64);
    desc.thread_count = 1;
    return desc;
}

static void refuse_films(trc_scene scene) {
    trc_render_desc desc = frame_desc(16384, 16384);
    expect_refused(scene, &desc); /* nowhere near */
    /* Each part of it fits, all together do not. */
    const uint64_t half = trc_memory_left_bytes() / 2;
    const uint32_t rows = (uint32_t)(half / (4096 * 36)) + 64; /* 36 bytes of a plain pixel */
    desc = frame_desc(4096, rows);
    desc.noise_threshold = 0.01f; /* 40 bytes more */
    desc.cryptomattes = 1;        /* 64 */
    desc.cryptomatte_depth = 6;
    expect_refused(scene, &desc);
    desc = frame_desc(4096, rows);
    desc.extra_samples = 0.25f; /* 53 */
    expect_refused(scene, &desc);
    desc = frame_desc(4096, rows);
    desc.thread_count = 1024; /* their scratch memory */
    desc.integrator = TRC_INTEGRATOR_WHITTED;
    expect_refused(scene, &desc);
    desc.thread_count = 1;
    trc_render render = 0;
    REQUIRE(trc_render_start(scene, &desc, &render) == TRC_OK);
    REQUIRE(trc_render_destroy(render) == TRC_OK);
}

static void refuse_texture(trc_scene scene, const float *picture) {
    const uint64_t used = trc_memory_bytes();
    trc_id images[64];
    uint32_t count = 0;
    trc_status status = TRC_OK;
    while (count < 64 && (status = add_texture(scene, 2048, &images[count])) == TRC_OK) {
        count++;
        if (trc_memory_left_bytes() < 60 * MIB)
            break; /* the pixels of the next one must fit, too */
    }
    REQUIRE(count > 1);
    const trc_image_desc large = {.struct_size = sizeof large,
                                  .width = 8192,
                                  .height = 8192,
                                  .pixels = "",
                                  .pixel_bytes = UINT64_C(4) * 8192 * 8192};
    trc_id image = 0;
    /* Refused before a pixel is read: there are none. */
    status = trc_image_create(scene, &large, &image);
    REQUIRE(status == TRC_ERROR_OUT_OF_MEMORY || status == TRC_ERROR_TOO_LARGE);
    expect_picture(scene, picture);
    while (count)
        REQUIRE(trc_image_destroy(scene, images[--count]) == TRC_OK);
    REQUIRE(trc_scene_commit(scene) == TRC_OK);
    REQUIRE(trc_memory_bytes() <= used + MIB);
    expect_picture(scene, picture);
}

/* The mesh fits, its tree does not: the commit fails and the former snapshot stays in force. */
static void refuse_tree(trc_scene scene, const float *picture) {
    const uint64_t used = trc_memory_bytes();
    trc_id mesh = 0, instance = 0;
    REQUIRE(add_grid(scene, 1000, &mesh, &instance) == TRC_OK);
    limit_address_space(TREE_ROOM);
    const trc_status status = trc_scene_commit(scene);
    REQUIRE(status == TRC_ERROR_OUT_OF_MEMORY || status == TRC_ERROR_TOO_LARGE);
    expect_picture(scene, picture);
    limit_address_space(ROOM);
    REQUIRE(trc_instance_destroy(scene, instance) == TRC_OK);
    REQUIRE(trc_mesh_destroy(scene, mesh) == TRC_OK);
    REQUIRE(trc_scene_commit(scene) == TRC_OK);
    REQUIRE(trc_memory_bytes() <= used + MIB);
    expect_picture(scene, picture);
}

static void run_limited(void) {
    static float picture[4 * FRAME];
    mallopt(M_ARENA_MAX, 1); /* arenas of threads would take address space at random */
    limit_address_space(ROOM);
    const uint64_t used = trc_memory_bytes();
    const trc_scene scene = furnished_scene();
    draw(scene, picture);
    refuse_films(scene);
    expect_picture(scene, picture);
    refuse_texture(scene, picture);
    refuse_tree(scene, picture);
    refuse_films(scene);
    expect_picture(scene, picture);
    REQUIRE(trc_scene_destroy(scene) == TRC_OK);
    REQUIRE(trc_memory_bytes() <= used + MIB);
    _exit(0);
}

static void under_a_limit(void **state) {
    (void)state;
#if defined(TRC_HAS_ADDRESS_SANITIZER) || defined(TRC_HAS_THREAD_SANITIZER)
    skip(); /* whose shadow memory takes terabytes of address space */
#endif
    const pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0)
        run_limited();
    int status = 0;
    assert_int_equal(waitpid(child, &status, 0), child);
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
        fail_msg("the process ended with status %x", (unsigned)status);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(under_a_limit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
