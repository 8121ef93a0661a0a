/* The parts everything else stands on: status, memory, handles, ids, names, pool, dispatch, film,
 * schedule, and how a scene becomes a snapshot. */
#define _GNU_SOURCE
#include "fixture.h"

#include <float.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/fpstate.h"
#include "core/handle.h"
#include "core/pool.h"
#include "core/thread.h"
#include "film/film.h"
#include "model/kernels.h"
#include "model/names.h"
#include "render/schedule.h"
#include "scene/affine.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "scene/store.h"

/* ---- status ---- */

static void message_is_formatted_and_cut(void **state) {
    (void)state;
    assert_int_equal(trc_fail(TRC_ERROR_TOO_LARGE, "%d of %s", 3, "four"), TRC_ERROR_TOO_LARGE);
    assert_string_equal(trc_last_message(), "3 of four");
    char text[601] = {0};
    memset(text, 'x', 600);
    (void)trc_fail(TRC_ERROR_IMAGE, "%s", text);
    assert_int_equal(strlen(trc_last_message()), 511);
}

/* Text of characters of each length, cut everywhere within one: what is left ends with a whole one.
 */
static void cut_messages_are_utf8(void **state) {
    (void)state;
    static const char *const characters[] = {"x", "\xc3\xa4", "\xe2\x82\xac", "\xf0\x9f\x98\x80",
                                             "\x80" /* of no character: left as it is */};
    char text[1024];
    for (int c = 0; c < 5; c++) {
        const size_t bytes = strlen(characters[c]);
        for (size_t before = 0; before < 4; before++) {
            memset(text, 'a', before);
            for (size_t i = 0; i < 600 / bytes; i++)
                memcpy(text + before + i * bytes, characters[c], bytes + 1);
            (void)trc_fail(TRC_ERROR_IMAGE, "%s", text);
            assert_int_equal(strlen(trc_last_message()), before + (511 - before) / bytes * bytes);
        }
    }
}

static void *other_thread_message(void *context) {
    (void)context;
    return (void *)(uintptr_t)(trc_last_message()[0] == '\0');
}

static void message_is_per_thread(void **state) {
    (void)state;
    pthread_t thread;
    void *empty = NULL;
    (void)trc_fail(TRC_ERROR_IMAGE, "mine");
    assert_int_equal(pthread_create(&thread, NULL, other_thread_message, NULL), 0);
    pthread_join(thread, &empty);
    assert_non_null(empty);
    assert_string_equal(trc_last_message(), "mine");
}

static int64_t abi_value(const char *name) {
    int64_t value = -77;
    assert_int_equal(trc_abi_value(name, &value), TRC_OK);
    return value;
}

static void versions_and_values(void **state) {
    (void)state;
    assert_int_equal(trc_abi_version(), TRC_ABI_VERSION);
    char version[32];
    snprintf(version, sizeof version, "%d.%d.%d", TRC_VERSION_MAJOR, TRC_VERSION_MINOR,
             TRC_VERSION_PATCH);
    assert_string_equal(trc_version_string(), version);
    assert_int_equal(abi_value("TRC_ABI_VERSION"), TRC_ABI_VERSION);
    assert_int_equal(abi_value("TRC_INPUT_DEFAULT"), -2);
    assert_int_equal(abi_value("TRC_NO_HIT"), UINT32_MAX);
    assert_int_equal(abi_value("trc_mesh_desc"), sizeof(trc_mesh_desc));
    assert_int_equal(abi_value("trc_mesh_desc.indices"), offsetof(trc_mesh_desc, indices));
    int64_t value = 77;
    assert_int_equal(trc_abi_value("trc_nothing", &value), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_abi_value(NULL, &value), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_abi_value("TRC_OK", NULL), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(value, 77);
}

/* ---- memory ---- */

static void memory_is_aligned_and_counted(void **state) {
    (void)state;
    const uint64_t before = trc_memory_bytes();
    char *blocks[64];
    for (size_t i = 0; i < 64; i++) {
        blocks[i] = i % 2 ? trc_alloc(i, 3) : trc_alloc_zeroed(i, 3);
        assert_non_null(blocks[i]);
        assert_int_equal((uintptr_t)blocks[i] % 64, 0);
        for (size_t b = 0; i % 2 == 0 && b < 3 * i; b++)
            assert_int_equal(blocks[i][b], 0);
        memset(blocks[i], 0x5a, 3 * i);
    }
    assert_int_equal(trc_memory_bytes() - before, 3 * 63 * 64 / 2);
    assert_true(trc_memory_peak_bytes() >= trc_memory_bytes());
    for (size_t i = 0; i < 64; i++)
        trc_free(blocks[i]);
    assert_int_equal(trc_memory_bytes(), before);
    trc_free(NULL);
}

/* In large pages: any size, all of it to write and to free, and cleared again where asked for. */
static void large_blocks(void **state) {
    (void)state;
    const uint64_t before = trc_memory_bytes();
    for (size_t bytes = (size_t)1 << 20; bytes < (size_t)1 << 25; bytes = 2 * bytes + 4093) {
        for (int zeroed = 0; zeroed < 2; zeroed++) {
            char *block = zeroed ? trc_alloc_zeroed(bytes, 1) : trc_alloc(bytes, 1);
            assert_non_null(block);
            assert_int_equal((uintptr_t)block % 64, 0);
            assert_int_equal(trc_memory_bytes() - before, bytes);
            for (size_t i = 0; zeroed && i < bytes; i++)
                assert_int_equal(block[i], 0);
            memset(block, 0x5a, bytes);
            trc_free(block);
        }
    }
    assert_int_equal(trc_memory_bytes(), before);
    assert_null(trc_alloc(SIZE_MAX, 2));
}

static void memory_sizes_do_not_wrap(void **state) {
    (void)state;
    assert_null(trc_alloc(SIZE_MAX, 2));
    assert_null(trc_alloc(SIZE_MAX / 2 + 1, 2));
    assert_null(trc_alloc(SIZE_MAX, 1));
    assert_null(trc_alloc_zeroed((size_t)1 << 33, (size_t)1 << 33));
    assert_null(trc_alloc(PTRDIFF_MAX, 1));
}

static void memory_fails_when_told(void **state) {
    (void)state;
    trc_memory_fail_at(2, false);
    void *a = trc_alloc(1, 1), *b = trc_alloc(1, 1), *c = trc_alloc(1, 1), *d = trc_alloc(1, 1);
    assert_non_null(a);
    assert_non_null(b);
    assert_null(c);
    assert_non_null(d);
    trc_memory_fail_at(1, true);
    assert_false(trc_memory_should_fail());
    assert_true(trc_memory_should_fail());
    assert_null(trc_alloc_zeroed(1, 1));
    trc_memory_fail_at(-1, false);
    assert_false(trc_memory_should_fail());
    trc_free(a);
    trc_free(b);
    trc_free(d);
}

static void products_are_checked(void **state) {
    (void)state;
    uint64_t product = 7;
    assert_true(trc_multiply_u64(UINT64_MAX, 1, &product));
    assert_true(product == UINT64_MAX);
    assert_true(trc_multiply_u64(0, UINT64_MAX, &product));
    assert_int_equal(product, 0);
    assert_false(trc_multiply_u64(UINT64_C(1) << 32, UINT64_C(1) << 32, &product));
    assert_int_equal(product, 0);
}

/* ---- handles, ids, names ---- */

static void handles_know_their_generation(void **state) {
    (void)state;
    int object = 0, other = 0;
    void *found = NULL;
    uint64_t first = 0, second = 0;
    assert_int_equal(trc_handle_create(TRC_HANDLE_SCENE, &object, &first), TRC_OK);
    assert_int_equal(trc_handle_acquire(first, TRC_HANDLE_RENDER, &found),
                     TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_handle_acquire(0, TRC_HANDLE_SCENE, &found), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_handle_acquire(first + 1000, TRC_HANDLE_SCENE, &found),
                     TRC_ERROR_INVALID_HANDLE);
    assert_null(found);
    assert_int_equal(trc_handle_acquire(first, TRC_HANDLE_SCENE, &found), TRC_OK);
    assert_ptr_equal(found, &object);
    assert_int_equal(trc_handle_remove(first), TRC_OK);
    assert_int_equal(trc_handle_acquire(first, TRC_HANDLE_SCENE, &found), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_handle_create(TRC_HANDLE_SCENE, &other, &second), TRC_OK);
    assert_true(first != second);
    assert_int_equal(trc_handle_acquire(first, TRC_HANDLE_SCENE, &found), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_handle_acquire(second, TRC_HANDLE_SCENE, &found), TRC_OK);
    assert_int_equal(trc_handle_remove(second), TRC_OK);
}

struct pin_job {
    uint64_t handle;
    atomic_int pinned, released;
};

static void *hold_pin(void *context) {
    struct pin_job *job = context;
    void *object;
    if (trc_handle_acquire(job->handle, TRC_HANDLE_SCENE, &object) != TRC_OK)
        return NULL;
    atomic_store(&job->pinned, 1);
    const double until = trc_seconds() + 0.05;
    while (trc_seconds() < until) {
    }
    atomic_store(&job->released, 1);
    trc_handle_release(job->handle);
    return context;
}

static void removing_a_handle_waits_for_pins(void **state) {
    (void)state;
    int object = 0;
    void *found, *ok = NULL;
    struct pin_job job = {0};
    pthread_t thread;
    assert_int_equal(trc_handle_create(TRC_HANDLE_SCENE, &object, &job.handle), TRC_OK);
    assert_int_equal(trc_handle_acquire(job.handle, TRC_HANDLE_SCENE, &found), TRC_OK);
    assert_int_equal(pthread_create(&thread, NULL, hold_pin, &job), 0);
    while (!atomic_load(&job.pinned)) {
    }
    assert_int_equal(trc_handle_remove(job.handle), TRC_OK);
    assert_int_equal(atomic_load(&job.released), 1);
    pthread_join(thread, &ok);
    assert_non_null(ok);
}

static void ids_keep_creation_order(void **state) {
    (void)state;
    int objects[6];
    trc_id ids[6];
    struct trc_store store;
    trc_store_init(&store, TRC_STORE_INSTANCE, false, 5);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(trc_store_add(&store, &objects[i], &ids[i]), TRC_OK);
    }
    trc_store_remove(&store, ids[1]);
    trc_store_remove(&store, ids[0]);
    assert_null(trc_store_get(&store, ids[1]));
    for (int i = 4; i < 6; i++) {
        assert_int_equal(trc_store_add(&store, &objects[i], &ids[i]), TRC_OK);
    }
    assert_true(trc_store_slot_of(ids[4]) < 2); /* slots are used again, ids are not */
    assert_null(trc_store_get(&store, ids[0]));
    const int expected[] = {2, 3, 4, 5};
    int n = 0;
    for (uint32_t i = trc_store_first(&store); i != TRC_STORE_END; i = trc_store_next(&store, i)) {
        assert_ptr_equal(store.slots[i].object, &objects[expected[n++]]);
    }
    assert_int_equal(n, 4);
    assert_int_equal(store.living_count, 4);
    void *found = NULL;
    assert_int_equal(trc_store_find(&store, ids[3] ^ (UINT64_C(1) << 60), &found),
                     TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_store_find(&store, 0, &found), TRC_ERROR_INVALID_HANDLE);
    assert_int_equal(trc_store_find(&store, ids[3], &found), TRC_OK);
    assert_ptr_equal(found, &objects[3]);
    trc_store_free(&store);
}

static void image_slots_are_used_once(void **state) {
    (void)state;
    int object;
    trc_id first, second;
    struct trc_store store;
    trc_store_init(&store, TRC_STORE_IMAGE, true, 1);
    assert_int_equal(trc_store_add(&store, &object, &first), TRC_OK);
    trc_store_remove(&store, first);
    assert_int_equal(trc_store_add(&store, &object, &second), TRC_OK);
    assert_int_equal(trc_store_slot_of(first), 0);
    assert_int_equal(trc_store_slot_of(second), 1);
    trc_store_free(&store);
}

static void names_are_interned(void **state) {
    (void)state;
    struct trc_names *names = trc_names_create();
    uint32_t number = 0;
    char name[80];
    for (int round = 0; round < 2; round++) {
        for (int i = 0; i < 100; i++) {
            snprintf(name, sizeof name, "map %d", i);
            assert_int_equal(trc_names_add(names, name, &number), TRC_OK);
            assert_int_equal(number, i);
        }
    }
    memset(name, 'x', sizeof name);
    name[63] = '\0';
    assert_int_equal(trc_names_add(names, name, &number), TRC_OK);
    assert_int_equal(number, 100);
    name[63] = 'x';
    name[64] = '\0';
    number = 77;
    assert_int_equal(trc_names_add(names, name, &number), TRC_ERROR_TOO_LARGE);
    assert_int_equal(trc_names_add(names, NULL, &number), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(number, 77);
    trc_names_destroy(names);
}

/* ---- threads ---- */

#define TASKS 10000

struct pool_job {
    atomic_uchar done[TASKS];
    atomic_uint active[8]; /* per worker: tasks running at once, at most 1 */
    atomic_uint bad;
};

static void pool_task(void *context, uint32_t index, uint32_t worker) {
    struct pool_job *job = context;
    if (worker >= 4 || atomic_fetch_add(&job->active[worker], 1) != 0)
        atomic_fetch_add(&job->bad, 1);
    atomic_fetch_add(&job->done[index], 1);
    if (worker < 8)
        atomic_fetch_sub(&job->active[worker], 1);
}

static void pool_runs_every_task_once(void **state) {
    (void)state;
    static struct pool_job job;
    struct trc_pool *pool = NULL;
    assert_int_equal(trc_pool_create(4, &pool), TRC_OK);
    assert_int_equal(trc_pool_thread_count(pool), 4);
    for (int round = 0; round < 50; round++) {
        memset(&job, 0, sizeof job);
        const uint32_t count = round % 5 == 0 ? (uint32_t)round / 5 : TASKS;
        trc_pool_run(pool, count, pool_task, &job);
        assert_int_equal(job.bad, 0);
        for (uint32_t i = 0; i < TASKS; i++)
            assert_int_equal(job.done[i], i < count);
    }
    trc_pool_destroy(pool);
}

/* Waits for the other side, so that the pool's own threads are sure to take part. */
struct state_job {
    atomic_uint arrived, bad_state, unblocked;
};

#ifdef _WIN32
/* Its signals are no thread's: nothing could be blocked. */
static bool are_signals_blocked(void) { return true; }
static bool is_interrupt_blocked(void) { return false; }
#else
static bool is_blocked(int signal) {
    sigset_t mask;
    pthread_sigmask(SIG_SETMASK, NULL, &mask);
    return sigismember(&mask, signal) == 1;
}
static bool is_interrupt_blocked(void) { return is_blocked(SIGINT); }
static bool are_signals_blocked(void) { return is_interrupt_blocked() && is_blocked(SIGUSR1); }
#endif

static void state_task(void *context, uint32_t index, uint32_t worker) {
    (void)index;
    struct state_job *job = context;
    atomic_fetch_add(&job->arrived, 1);
    while (atomic_load(&job->arrived) < 2) {
    }
#if defined(__SSE__)
    if ((_mm_getcsr() & ~0x3fu) != TRC_FP_DEFAULT_MXCSR)
        atomic_fetch_add(&job->bad_state, 1);
#endif
    if (worker > 0 && !are_signals_blocked())
        atomic_fetch_add(&job->unblocked, 1);
}

static void pool_sets_and_restores_float_state(void **state) {
    (void)state;
    struct state_job job = {0};
    struct trc_pool *pool = NULL;
    const bool was_blocked = is_interrupt_blocked();
#if defined(__SSE__)
    const uint32_t odd =
        TRC_FP_DEFAULT_MXCSR | 0x8040u | 0x4000u | 0x01u; /* FTZ, DAZ, up, a flag */
    const uint32_t former = _mm_getcsr();
    _mm_setcsr(odd);
#endif
    assert_int_equal(trc_pool_create(2, &pool), TRC_OK);
    trc_pool_run(pool, 2, state_task, &job);
    trc_pool_destroy(pool);
#if defined(__SSE__)
    const uint32_t now = _mm_getcsr();
    _mm_setcsr(former);
    assert_int_equal(now, odd);
#endif
    assert_int_equal(job.bad_state, 0);
    assert_int_equal(job.unblocked, 0);
    assert_int_equal(is_interrupt_blocked(), was_blocked);
}

static void pool_creation_can_fail(void **state) {
    (void)state;
    const uint64_t before = trc_memory_bytes();
    int failures = 0;
    for (int64_t n = 0;; n++) {
        struct trc_pool *pool = NULL;
        trc_memory_fail_at(n, false);
        const trc_status status = trc_pool_create(4, &pool);
        trc_memory_fail_at(-1, false);
        if (status == TRC_OK) {
            trc_pool_destroy(pool);
            break;
        }
        assert_null(pool);
        assert_true(status == TRC_ERROR_OUT_OF_MEMORY || status == TRC_ERROR_NO_THREAD);
        assert_int_equal(trc_memory_bytes(), before);
        failures++;
    }
    assert_int_equal(failures, 2 + 3 * 2); /* pool, workers; a block and a thread for each of 3 */
    assert_int_equal(trc_pool_create(TRC_MAX_THREADS + 1, &(struct trc_pool *){NULL}),
                     TRC_ERROR_TOO_LARGE);
}

static void dispatch_chooses_and_lowers(void **state) {
    (void)state;
    const uint32_t best = trc_isa();
    assert_true(best >= TRC_ISA_SCALAR);
    assert_non_null(trc_kernels_get(TRC_ISA_SCALAR));
    assert_null(trc_kernels_get(TRC_ISA_AUTO));
    assert_null(trc_kernels_get(99));
    for (uint32_t isa = TRC_ISA_SCALAR; isa <= TRC_ISA_NEON; isa++) {
        const struct trc_kernels *kernels = trc_kernels_get(isa);
        assert_int_equal(trc_set_isa(isa), kernels ? TRC_OK : TRC_ERROR_UNSUPPORTED);
        if (!kernels)
            continue;
        assert_int_equal(kernels->isa, isa);
        assert_int_equal(trc_isa(), isa);
        assert_ptr_equal(trc_kernels_current(), kernels);
    }
    assert_int_equal(trc_set_isa(6), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_set_isa(TRC_ISA_AUTO), TRC_OK);
    assert_int_equal(trc_isa(), best);
    assert_string_equal(trc_isa_name(TRC_ISA_AVX512), "avx512");
    assert_string_equal(trc_isa_name(6), "unknown");
}

/* ---- schedule and film ---- */

static void schedule_covers_every_pixel_once(void **state) {
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1},     {32, 32},   {33, 31},
                                        {640, 360}, {65536, 1}, {1, 5000}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        trc_render_desc desc = default_render_desc(sizes[i][0], sizes[i][1], 1);
        desc.crop_width = desc.width;
        desc.crop_height = desc.height;
        struct trc_schedule schedule;
        assert_int_equal(trc_schedule_create(&desc, &schedule), TRC_OK);
        uint8_t *seen = calloc((size_t)desc.width * desc.height, 1);
        for (uint32_t k = 0; k < schedule.tile_count; k++) {
            const struct trc_tile_area t = trc_schedule_tile(&schedule, schedule.order[k]);
            for (uint32_t y = t.y; y < t.y + t.height; y++) {
                for (uint32_t x = t.x; x < t.x + t.width; x++)
                    seen[(size_t)y * desc.width + x]++;
            }
        }
        for (size_t p = 0; p < (size_t)desc.width * desc.height; p++)
            assert_int_equal(seen[p], 1);
        free(seen);
        trc_schedule_destroy(&schedule);
    }
}

static void schedule_batches_rise(void **state) {
    (void)state;
    static const struct {
        uint32_t samples, batches;
    } cases[] = {{1, 1},  {2, 2},  {3, 3},   {4, 3},   {5, 4},
                 {64, 7}, {65, 8}, {128, 8}, {129, 9}, {1000, 22}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        trc_render_desc desc = default_render_desc(8, 8, cases[i].samples);
        desc.crop_width = desc.crop_height = 8;
        desc.progressive = 1;
        struct trc_schedule s;
        assert_int_equal(trc_schedule_create(&desc, &s), TRC_OK);
        assert_int_equal(s.batch_count, cases[i].batches);
        assert_int_equal(trc_schedule_batch_begin(&s, 0), 0);
        for (uint32_t b = 0; b < s.batch_count; b++) {
            const uint32_t begin = trc_schedule_batch_begin(&s, b);
            const uint32_t end = trc_schedule_batch_begin(&s, b + 1);
            assert_true(end > begin && end <= cases[i].samples);
            if (b == 0)
                assert_int_equal(end, 1);
        }
        assert_int_equal(trc_schedule_batch_begin(&s, s.batch_count), cases[i].samples);
        trc_schedule_destroy(&s);
    }
}

static trc_render_desc film_desc(uint32_t width, uint32_t height, uint64_t passes) {
    return (trc_render_desc){
        .crop_width = width, .crop_height = height, .passes = passes | 1u << TRC_PASS_COMBINED};
}

static void film_divides_and_exposes(void **state) {
    (void)state;
    struct trc_film film;
    const trc_render_desc desc = film_desc(
        2, 1, 1u << TRC_PASS_DEPTH | 1u << TRC_PASS_SAMPLE_COUNT | 1u << TRC_PASS_DIFFUSE_COLOR);
    assert_int_equal(trc_film_create(&desc, &film), TRC_OK);
    const double combined[4] = {4.0, 8.0, INFINITY, 2.0};
    memcpy(film.sums[TRC_PASS_COMBINED], combined, sizeof combined);
    film.sums[TRC_PASS_COMBINED][4] = 5.0; /* a pixel whose sample is not counted yet */
    film.sums[TRC_PASS_DEPTH][0] = 7.0;
    film.sums[TRC_PASS_DIFFUSE_COLOR][0] = 3.0;
    film.sample_counts[0] = 4;
    float out[8];
    assert_int_equal(trc_film_read(&film, TRC_PASS_COMBINED, 2.0f, out, 8), TRC_OK);
    const float expected[8] = {2.0f, 4.0f, FLT_MAX, 0.5f, 0, 0, 0, 0};
    assert_memory_equal(out, expected, sizeof out);
    assert_int_equal(trc_film_read(&film, TRC_PASS_DEPTH, 2.0f, out, 2), TRC_OK);
    assert_true(out[0] == 7.0f && out[1] == 0.0f);
    assert_int_equal(trc_film_read(&film, TRC_PASS_DIFFUSE_COLOR, 2.0f, out, 6), TRC_OK);
    assert_true(out[0] == 0.75f);
    assert_int_equal(trc_film_read(&film, TRC_PASS_SAMPLE_COUNT, 2.0f, out, 2), TRC_OK);
    assert_true(out[0] == 4.0f && out[1] == 0.0f);
    out[0] = -1.0f;
    assert_int_equal(trc_film_read(&film, TRC_PASS_COMBINED, 1.0f, out, 7),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_film_read(&film, TRC_PASS_NORMAL, 1.0f, out, 6),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_film_read(&film, TRC_PASS_COUNT, 1.0f, out, 6),
                     TRC_ERROR_INVALID_ARGUMENT);
    assert_true(out[0] == -1.0f);
    trc_film_destroy(&film);
}

static void film_refuses_what_the_machine_has_not(void **state) {
    (void)state;
    struct trc_film film;
    const uint64_t before = trc_memory_bytes(), all = (1u << TRC_PASS_COUNT) - 1;
    const trc_render_desc large = film_desc(65536, 65536, all);
    const trc_render_desc larger = film_desc(UINT32_MAX, UINT32_MAX, all);
    assert_int_equal(trc_film_create(&large, &film), TRC_ERROR_TOO_LARGE);
    assert_int_equal(trc_film_create(&larger, &film), TRC_ERROR_TOO_LARGE);
    assert_int_equal(trc_memory_bytes(), before);
}

static void pass_channels(void **state) {
    (void)state;
    static const struct {
        uint32_t pass, channels;
    } known[] = {{TRC_PASS_COMBINED, 4},
                 {TRC_PASS_DEPTH, 1},
                 {TRC_PASS_SAMPLE_COUNT, 1},
                 {TRC_PASS_VECTOR, 4},
                 {TRC_PASS_SHADOW_CATCHER, 3},
                 {TRC_PASS_COUNT, 0},
                 {TRC_PASS_AOV_VALUE(0) - 1, 0},
                 {TRC_PASS_AOV_VALUE(TRC_MAX_AOVS - 1), 1},
                 {TRC_PASS_AOV_COLOR(0), 4},
                 {TRC_PASS_AOV_COLOR(TRC_MAX_AOVS - 1), 4},
                 {TRC_PASS_LIGHT_GROUP(TRC_MAX_LIGHT_GROUPS - 1), 3},
                 {TRC_PASS_CRYPTOMATTE(0, 0), 4},
                 {TRC_PASS_CRYPTOMATTE(TRC_CRYPTOMATTE_KINDS, 0), 0},
                 {UINT32_MAX, 0}};
    for (size_t k = 0; k < sizeof known / sizeof *known; k++)
        assert_int_equal(trc_pass_channels(known[k].pass), known[k].channels);
    for (uint32_t pass = 0; pass < TRC_PASS_COUNT; pass++)
        assert_in_range(trc_pass_channels(pass), 1, 4);
}

/* ---- transforms ---- */

static void affine_inverts_what_it_can(void **state) {
    (void)state;
    const struct trc_affine a = {{2, 1, 0, 5, 0, -3, 0.5f, 6, 0.25f, 0, 4, -7}};
    struct trc_affine inverse;
    assert_true(trc_affine_invert(&a, &inverse));
    assert_true(trc_affine_flips(&a));
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 4; column++) {
            double sum = column == 3 ? a.m[4 * row + 3] : 0.0;
            for (int k = 0; k < 3; k++)
                sum += (double)a.m[4 * row + k] * inverse.m[4 * k + column];
            assert_true(fabs(sum - (row == column)) < 1e-5);
        }
    }
    const struct trc_affine tiny = {{1e-12f, 0, 0, 0, 0, 1e-12f, 0, 0, 0, 0, 1e-12f, 0}};
    assert_true(trc_affine_invert(&tiny, &inverse));
    const struct trc_affine flat = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}};
    const struct trc_affine sheet = {{1, 2, 3, 0, 2, 4, 6, 0, 1, 1, 1, 0}};
    const struct trc_affine thin = {{1, 1, 0, 0, 0, 1e-14f, 0, 0, 0, 0, 1, 0}};
    const struct trc_affine nan = {{1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0}};
    const struct trc_affine inf = {{INFINITY, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    assert_false(trc_affine_invert(&flat, &inverse));
    assert_false(trc_affine_invert(&sheet, &inverse));
    assert_false(trc_affine_invert(&thin, &inverse));
    assert_false(trc_affine_invert(&nan, &inverse));
    assert_false(trc_affine_invert(&inf, &inverse));
}

static float cosine(const struct trc_affine *a, int i, int j) {
    float dot = 0.0f;
    for (int row = 0; row < 3; row++)
        dot += a->m[4 * row + i] * a->m[4 * row + j];
    return dot;
}

static void affine_loses_its_scale(void **state) {
    (void)state;
    const struct trc_affine flat = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0}};
    const struct trc_affine sheared = {{2, 1, 0, 5, 0, -3, 0.5f, 6, 0.25f, 0, 4, -7}};
    const struct trc_affine turned = {
        {0.6f, 1.6f, 0, 5, -0.8f, 1.2f, 0, 6, 0, 0, -0.5f, -7}}; /* mirrored, scaled 1, 2, .5 */
    struct trc_affine unit = flat;
    float volume = -1.0f;
    assert_false(trc_affine_make_unit(&flat, &unit, &volume));
    assert_true(volume == -1.0f && unit.m[0] == 1.0f);
    assert_true(trc_affine_make_unit(&sheared, &unit, &volume));
    for (int i = 0; i < 3; i++) {
        assert_true(fabsf(cosine(&unit, i, i) - 1.0f) < 1e-6f);
        for (int row = 0; row < 3; row++) { /* the direction that it had */
            const float length = sqrtf(cosine(&sheared, i, i));
            assert_true(fabsf(unit.m[4 * row + i] * length - sheared.m[4 * row + i]) < 1e-5f);
        }
    }
    assert_true(volume > 0.1f && volume < 0.99f);
    assert_true(trc_affine_flips(&unit)); /* a mirrored camera stays mirrored */
    assert_true(unit.m[3] == 5.0f && unit.m[7] == 6.0f && unit.m[11] == -7.0f);
    assert_true(trc_affine_make_unit(&turned, &unit, &volume));
    assert_true(volume == 1.0f && trc_affine_flips(&unit));
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            assert_true(fabsf(cosine(&unit, i, j) - (float)(i == j)) < 1e-6f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(message_is_formatted_and_cut),
        cmocka_unit_test(cut_messages_are_utf8),
        cmocka_unit_test(message_is_per_thread),
        cmocka_unit_test(versions_and_values),
        cmocka_unit_test(memory_is_aligned_and_counted),
        cmocka_unit_test(large_blocks),
        cmocka_unit_test(memory_sizes_do_not_wrap),
        cmocka_unit_test(memory_fails_when_told),
        cmocka_unit_test(products_are_checked),
        cmocka_unit_test(handles_know_their_generation),
        cmocka_unit_test(removing_a_handle_waits_for_pins),
        cmocka_unit_test(ids_keep_creation_order),
        cmocka_unit_test(image_slots_are_used_once),
        cmocka_unit_test(names_are_interned),
        cmocka_unit_test(pool_runs_every_task_once),
        cmocka_unit_test(pool_sets_and_restores_float_state),
        cmocka_unit_test(pool_creation_can_fail),
        cmocka_unit_test(dispatch_chooses_and_lowers),
        cmocka_unit_test(schedule_covers_every_pixel_once),
        cmocka_unit_test(schedule_batches_rise),
        cmocka_unit_test(film_divides_and_exposes),
        cmocka_unit_test(film_refuses_what_the_machine_has_not),
        cmocka_unit_test(pass_channels),
        cmocka_unit_test(affine_inverts_what_it_can),
        cmocka_unit_test(affine_loses_its_scale),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
