/* The film adds up every sample of every pixel, in whatever order and parts they come, and shows
 * whole batches of them only. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>

#include "fixture.h"

#include "film/film.h"
#include "model/sequence.h"

enum { WIDTH = 80, HEIGHT = 72, FRAME = WIDTH * HEIGHT };

/* Under an even sky that fills the view a sum of all samples over their number is its radiance;
 * with an open shutter, or a wide lens, a pixel's samples come in several parts. */
static void all_samples(void **state) {
    (void)state;
    static float pixels[4 * FRAME], counts[FRAME];
    static const float transforms[24] = {1, 0, 0, 0,    0, 1, 0, 0, 0, 0, 1, 0,
                                         1, 0, 0, 0.1f, 0, 1, 0, 0, 0, 0, 1, 0};
    static const float windows[8] = {-0.5f, 0.5f, -0.5f, 0.5f, -0.5f, 0.5f, -0.5f, 0.5f};
    const uint32_t samples[] = {1, 7, 40};
    for (int kind = 0; kind < 3; kind++) {
        trc_scene scene = 0;
        const trc_scene_desc scene_desc = default_scene_desc();
        assert_int_equal(trc_scene_create(&scene_desc, &scene), TRC_OK);
        trc_camera_desc camera = default_camera_desc();
        camera.transforms = transforms;
        camera.windows = windows;
        camera.key_count = kind == 1 ? 2 : 1;
        camera.shutter_time = kind == 1 ? 1.0f : 0.0f;
        camera.aperture_radius = kind == 2 ? 0.5f : 0.0f;
        assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
        const trc_world_desc world =
            default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f));
        assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
        assert_int_equal(trc_scene_commit(scene), TRC_OK);
        for (int i = 0; i < 3; i++) {
            trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples[i]);
            desc.passes |= UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
            trc_render render = 0;
            assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
            assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
            assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, 4 * FRAME), TRC_OK);
            assert_int_equal(trc_render_read(render, TRC_PASS_SAMPLE_COUNT, counts, FRAME), TRC_OK);
            assert_int_equal(trc_render_destroy(render), TRC_OK);
            for (uint32_t k = 0; k < FRAME; k++) {
                assert_int_equal((int)counts[k], (int)samples[i]);
                assert_true(fabsf(pixels[4 * k] - 0.25f) < 1e-6f);
            }
        }
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

/* ---- reading while tiles are written ---- */

/* The steps of a writer and a reader in every order in which they can fall: what a reader takes for
 * whole was not being written. */
static void interleavings(void **state) {
    (void)state;
    for (int begin = 0; begin <= 2; begin++)     /* the reader's first look comes after so many */
        for (int end = begin; end <= 2; end++) { /* steps of the writer, its second after these */
            atomic_uint sequence;
            atomic_init(&sequence, 0);
            unsigned number = 0;
            bool looks = false, whole = false;
            for (int step = 0; step <= 2; step++) {
                if (step == begin)
                    looks = trc_sequence_read_begin(&sequence, &number);
                if (step == end)
                    whole = looks && trc_sequence_is_whole(&sequence, number);
                if (step == 0)
                    trc_sequence_write_begin(&sequence);
                if (step == 1)
                    trc_sequence_write_end(&sequence);
            }
            assert_int_equal(looks, begin != 1);
            assert_int_equal(whole, begin == end && begin != 1);
        }
}

/* Adds samples of 1 to every sum of a film's tile, over and over. */
struct writer {
    struct trc_film *film;
    uint32_t rounds;
    atomic_bool has_ended;
};

static void *write_film(void *context) {
    struct writer *w = context;
    for (uint32_t i = 0; i < w->rounds; i++) {
        trc_sequence_write_begin(&w->film->sequences[0]);
        for (uint32_t p = 0; p < w->film->width * w->film->height; p++) {
            for (uint32_t c = 0; c < 4; c++)
                trc_sum_add(&w->film->sums[TRC_PASS_COMBINED][4 * p + c], 1.0);
            for (uint32_t c = 0; c < 3; c++)
                trc_sum_add(&w->film->sums[TRC_PASS_NORMAL][3 * p + c], 1.0);
            __atomic_store_n(&w->film->sample_counts[p], i + 1, __ATOMIC_RELAXED);
        }
        trc_sequence_write_end(&w->film->sequences[0]);
    }
    atomic_store(&w->has_ended, true);
    return NULL;
}

static void expect_ones(const float *pixels, uint32_t count, const char *what) {
    for (uint32_t i = 0; i < count; i++)
        if (pixels[i] != 0.0f && fabsf(pixels[i] - 1.0f) > 1e-5f)
            fail_msg("%s: number %u is %.9g", what, i, (double)pixels[i]);
}

static void whole_batches(void **state) {
    (void)state;
    enum { EDGE = 8 };
    struct trc_film film;
    float pixels[4 * EDGE * EDGE];
    const trc_render_desc desc = {.crop_width = EDGE,
                                  .crop_height = EDGE,
                                  .passes = 1u << TRC_PASS_COMBINED | 1u << TRC_PASS_NORMAL};
    assert_int_equal(trc_film_create(&desc, &film), TRC_OK);
    struct writer writer = {.film = &film, .rounds = 100000};
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, write_film, &writer), 0);
    do {
        assert_int_equal(trc_film_read(&film, TRC_PASS_COMBINED, 1.0f, pixels, 4 * EDGE * EDGE),
                         TRC_OK);
        expect_ones(pixels, 4 * EDGE * EDGE, "combined");
        assert_int_equal(trc_film_read(&film, TRC_PASS_NORMAL, 1.0f, pixels, 3 * EDGE * EDGE),
                         TRC_OK);
        expect_ones(pixels, 3 * EDGE * EDGE, "normal");
    } while (!atomic_load(&writer.has_ended));
    pthread_join(thread, NULL);
    trc_film_destroy(&film);
}

/* A floor of diffuse light 1, under a lamp in a group, or a sky of radiance 1; every sample of
 * every pass that is looked at is 1, or what catchers leave of a footage without shadows. */
enum { SMALL = 24 };

static trc_scene even_scene(bool catches) {
    const trc_scene scene = fixture_level_view();
    const float corners[12] = {-9, -9, 0, 9, -9, 0, 9, 9, 0, -9, 9, 0};
    struct default_material m;
    trc_id material = 0, id = 0;
    default_material_init(&m, TRC_NODE_DIFFUSE);
    m.inputs[1].value[0] = 0.0f;
    m.desc.cryptomatte = 5.0f;
    assert_int_equal(trc_material_create(scene, &m.desc, &material), TRC_OK);
    fixture_flagged_quad(scene, corners, material, catches ? TRC_INSTANCE_SHADOW_CATCHER : 0);
    trc_light_desc sun = default_light_desc();
    sun.type = TRC_LIGHT_SUN;
    sun.size_x = sun.size_y = 0.0f;
    sun.strength = 2.0f * 3.14159265f;
    sun.light_group = 1;
    assert_int_equal(trc_light_create(scene, &sun, &id), TRC_OK);
    if (catches) {
        const trc_world_desc world =
            default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.0f));
        assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    }
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

/* Reads passes of a render as fast as it can until it has ended. */
static void hammer(trc_scene scene, const trc_render_desc *desc, const uint32_t *passes,
                   uint32_t pass_count) {
    static float pixels[4 * SMALL * SMALL];
    trc_render render = 0;
    trc_render_progress progress = {.struct_size = sizeof progress};
    assert_int_equal(trc_render_start(scene, desc, &render), TRC_OK);
    do {
        assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
        for (uint32_t k = 0; k < pass_count; k++) {
            const uint32_t channels = trc_pass_channels(passes[k]);
            assert_int_equal(trc_render_read(render, passes[k], pixels, channels * SMALL * SMALL),
                             TRC_OK);
            if (channels == 4 && passes[k] != TRC_PASS_COMBINED) /* an id, its coverage */
                for (uint32_t i = 0; i < SMALL * SMALL; i++)
                    pixels[4 * i] = pixels[4 * i + 1];
            char name[32];
            snprintf(name, sizeof name, "pass %u", passes[k]);
            expect_ones(pixels, channels * SMALL * SMALL, name);
        }
    } while (progress.state == TRC_PROGRESS_RUNNING);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

static trc_render_desc hammered_desc(void) {
    trc_render_desc desc = default_render_desc(SMALL, SMALL, 1024);
    desc.thread_count = 1;
    desc.passes = UINT64_C(1) << TRC_PASS_DIFFUSE_DIRECT | UINT64_C(1) << TRC_PASS_NORMAL |
                  UINT64_C(1) << TRC_PASS_SHADOW | UINT64_C(1) << TRC_PASS_UV;
    desc.light_group_count = 1;
    desc.cryptomattes = 1u << TRC_CRYPTOMATTE_MATERIAL;
    desc.cryptomatte_depth = 2;
    return desc;
}

static void never_too_bright(void **state) {
    (void)state;
    const uint32_t passes[] = {TRC_PASS_COMBINED, TRC_PASS_SHADOW, TRC_PASS_LIGHT_GROUP(0),
                               TRC_PASS_CRYPTOMATTE(TRC_CRYPTOMATTE_MATERIAL, 0)};
    const trc_scene scene = even_scene(false);
    for (int kind = 0; kind < 3; kind++) {
        trc_render_desc desc = hammered_desc();
        desc.progressive = kind == 1;
        desc.noise_threshold = kind == 2 ? 1e-9f : 0.0f;
        hammer(scene, &desc, passes, 4);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Combined is the catcher's cover then, the pass of its own what it leaves. */
static void catchers_while_written(void **state) {
    (void)state;
    const uint32_t passes[] = {TRC_PASS_SHADOW_CATCHER};
    const trc_scene scene = even_scene(true);
    trc_render_desc desc = hammered_desc();
    desc.passes |= UINT64_C(1) << TRC_PASS_SHADOW_CATCHER;
    desc.film_transparent = 1;
    hammer(scene, &desc, passes, 1);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* What passes on more than all light covers nothing, not less. */
static void alpha_is_a_part(void **state) {
    (void)state;
    enum { FLOATS = 4 * SMALL * SMALL };
    static float pixels[FLOATS];
    const trc_scene scene = fixture_level_view();
    const float corners[12] = {-9, -9, 0, 9, -9, 0, 9, 9, 0, -9, 9, 0};
    fixture_quad(scene, corners, fixture_material(scene, TRC_NODE_TRANSPARENT, 3.0f));
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    trc_render_desc desc = default_render_desc(SMALL, SMALL, 4);
    desc.film_transparent = 1;
    desc.denoise = TRC_DENOISE_PREVIEW;
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_COMBINED, pixels, FLOATS), TRC_OK);
    for (int i = 0; i < FLOATS; i++)
        assert_true(pixels[i] == 0.0f);
    assert_int_equal(trc_render_read_preview(render, pixels, FLOATS), TRC_OK);
    for (int i = 0; i < FLOATS; i++)
        assert_true(pixels[i] == 0.0f);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(all_samples),
                                       cmocka_unit_test(interleavings),
                                       cmocka_unit_test(whole_batches),
                                       cmocka_unit_test(never_too_bright),
                                       cmocka_unit_test(catchers_while_written),
                                       cmocka_unit_test(alpha_is_a_part)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
