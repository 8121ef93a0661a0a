/* Adaptive sampling: the mean does not depend on who stops when, counts, determinism. */
#include "counted_picture.h"

#include <float.h>
#include <stdbool.h>
#include <stdio.h>

#include "model/adaptive.h"
#include "rng.h"

/* ---- the decisions, on samples whose mean is known ---- */

enum { SIDE = 16, PIXELS = SIDE * SIDE, MOST = 512, TRIALS = 600 };

/* A pixel that is mostly dim and seldom bright: the mean is 0.02 + 0.01 * 20. */
#define RARE 0.01f
#define RARE_MEAN (0.02 + 0.01 * 20.0)
static float rare_sample(struct rng *r) { return rng_unit(r) < RARE ? 20.02f : 0.02f; }

/* Distance of the mean from the truth in standard errors. */
static double moments_score(const struct moments *m, double truth) {
    return (moments_mean(m) - truth) / sqrt(moments_variance(m));
}

static trc_render_desc square_desc(float threshold, uint32_t min_samples) {
    trc_render_desc desc = default_render_desc(SIDE, SIDE, MOST);
    desc.crop_width = desc.crop_height = SIDE;
    desc.noise_threshold = threshold;
    desc.min_samples = min_samples;
    return desc;
}

/* One picture of a tile; own: each pixel stops when its own chain does. spent: all samples drawn.
 */
static void draw_square(struct rng *r, bool own, struct moments *m, double *spent) {
    const trc_render_desc desc = square_desc(0.05f, 16);
    struct trc_adaptive a;
    assert_int_equal(trc_adaptive_create(&desc, &a), TRC_OK);
    static double sum[PIXELS], count[PIXELS];
    memset(sum, 0, sizeof sum);
    memset(count, 0, sizeof count);
    const uint32_t counts = own ? TRC_PIXEL_CHAIN : TRC_PIXEL_COUNTS;
    uint32_t done = 0;
    while (done < MOST && trc_adaptive_tile_runs(&a, 0, 0, SIDE, SIDE)) {
        const uint32_t stage = trc_adaptive_next_stage(&a, done);
        for (; done < stage; done++)
            for (uint32_t i = 0; i < PIXELS; i++) {
                if (!a.pixels[i].reasons)
                    continue;
                const float sample = rare_sample(r);
                for (int c = 0; c < 3; c++)
                    a.pixels[i].sum[c] += sample;
                *spent += 1.0;
                if (a.pixels[i].reasons & counts) {
                    sum[i] += sample;
                    count[i] += 1.0;
                }
            }
        trc_adaptive_update(&a, 0, 0, SIDE, SIDE, stage);
    }
    /* Pixels of one picture share decisions: the picture is one observation. */
    double mean = 0.0, samples = 0.0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        mean += sum[i] / count[i] / PIXELS;
        samples += count[i];
    }
    moments_add(m, mean, samples);
    trc_adaptive_destroy(&a);
}

static void unbiased(void **state) {
    (void)state;
    struct rng r = rng_seed(7);
    struct moments neighbours = {0}, own = {0};
    double spent = 0.0, spent_own = 0.0;
    for (int i = 0; i < TRIALS; i++) {
        draw_square(&r, false, &neighbours, &spent);
        draw_square(&r, true, &own, &spent_own);
    }
    const double mean = neighbours.sum / TRIALS, mean_own = own.sum / TRIALS;
    const double average = neighbours.samples / TRIALS / PIXELS;
    printf("mean %.5f of %.5f (%.1f standard errors), by themselves %.5f (%.1f); "
           "%.1f samples a pixel, %.1f %% of them for the chain alone\n",
           mean, RARE_MEAN, moments_score(&neighbours, RARE_MEAN), mean_own,
           moments_score(&own, RARE_MEAN), average, 100.0 * (spent - neighbours.samples) / spent);
    assert_true(fabs(moments_score(&neighbours, RARE_MEAN)) < 4.0);
    /* The test can see a bias: pixels that decide for themselves come out dark. */
    assert_true(moments_score(&own, RARE_MEAN) < -20.0);
    /* And it is about decisions: some pixels stop early, some go on. */
    assert_true(average > 17.0 && average < 0.9 * MOST);
}

static void stages(void **state) {
    (void)state;
    assert_int_equal(trc_adaptive_min_samples(0.1f, 0), 32);
    assert_int_equal(trc_adaptive_min_samples(0.01f, 0), 64);
    assert_int_equal(trc_adaptive_min_samples(0.001f, 0), 128);
    assert_int_equal(trc_adaptive_min_samples(FLT_MIN, 0), 1u << 20);
    assert_int_equal(trc_adaptive_min_samples(0.01f, 1), 4);
    assert_int_equal(trc_adaptive_min_samples(0.01f, 20), 32);
    const trc_render_desc desc = square_desc(0.01f, 16);
    struct trc_adaptive a;
    assert_int_equal(trc_adaptive_create(&desc, &a), TRC_OK);
    /* Halves of the first decision, then doubling. */
    const uint32_t after[] = {0, 7, 8, 15, 16, 17, 32}, expected[] = {8, 8, 16, 16, 32, 32, 64};
    for (int i = 0; i < 7; i++)
        assert_int_equal(trc_adaptive_next_stage(&a, after[i]), expected[i]);
    trc_adaptive_destroy(&a);
}

/* One noisy pixel among quiet ones: its neighbours of both kinds go on, others stop. */
static void neighbours(void **state) {
    (void)state;
    const trc_render_desc desc = square_desc(0.01f, 16);
    struct trc_adaptive a;
    assert_int_equal(trc_adaptive_create(&desc, &a), TRC_OK);
    for (uint32_t stage = 8; stage <= 16; stage *= 2) {
        for (uint32_t i = 0; i < PIXELS; i++)
            for (int c = 0; c < 3; c++)
                a.pixels[i].sum[c] = stage;
        if (stage == 16)
            a.pixels[5 * SIDE + 5].sum[0] = 3.0 * stage;
        trc_adaptive_update(&a, 0, 0, SIDE, SIDE, stage);
    }
    for (uint32_t y = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++) {
            const uint32_t reasons = a.pixels[y * SIDE + x].reasons;
            const uint32_t dx = x > 5 ? x - 5 : 5 - x, dy = y > 5 ? y - 5 : 5 - y;
            const bool chain = dx == dy && dx <= 1;
            /* One step from a pixel of the chain. */
            const bool called = (dx + dy) % 2 == 1 && dx <= 2 && dy <= 2;
            assert_int_equal(reasons,
                             (chain ? TRC_PIXEL_CHAIN : 0) | (called ? TRC_PIXEL_COUNTS : 0));
        }
    trc_adaptive_destroy(&a);
}

/* ---- renders ---- */

static trc_render_desc picture_desc(float threshold) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, 256);
    desc.passes = UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
    desc.noise_threshold = threshold;
    desc.min_samples = 8;
    return desc;
}

/* A threshold that nothing reaches, and one that needs more samples than there are, change no
 * bit. */
static void unreached(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    trc_render_desc desc = picture_desc(0.0f);
    struct picture *plain = picture_draw(scene, &desc);
    desc.noise_threshold = 1e-12f;
    struct picture *strict = picture_draw(scene, &desc);
    desc.noise_threshold = 0.1f;
    desc.min_samples = 256;
    struct picture *few = picture_draw(scene, &desc);
    uint32_t spared = 0;
    for (uint32_t i = 0; i < FRAME; i++) {
        assert_true(plain->counts[i] == 256.0f && few->counts[i] == 256.0f);
        /* Where nothing is seen there is no noise at all. */
        spared += strict->counts[i] < 256.0f;
        if (strict->counts[i] == 256.0f)
            assert_memory_equal(plain->combined + 4 * i, strict->combined + 4 * i, 16);
        else
            assert_true(plain->combined[4 * i] == strict->combined[4 * i]);
    }
    assert_true(spared > 0 && spared < FRAME);
    assert_memory_equal(plain->combined, few->combined, sizeof plain->combined);
    free(plain);
    free(strict);
    free(few);
}

static void counts(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    for (uint32_t progressive = 0; progressive < 2; progressive++) {
        trc_render_desc desc = picture_desc(0.01f);
        desc.progressive = progressive;
        struct picture *one = picture_draw(scene, &desc);
        desc.thread_count = 5;
        struct picture *five = picture_draw(scene, &desc);
        assert_memory_equal(one->combined, five->combined, sizeof one->combined);
        assert_memory_equal(one->counts, five->counts, sizeof one->counts);
        assert_true(one->progress.fraction == 1.0f && one->progress.samples_done == 256);
        uint32_t with[257] = {0};
        for (uint32_t i = 0; i < FRAME; i++) {
            const uint32_t n = (uint32_t)one->counts[i];
            assert_true(n >= 8 && n <= 256 && (n & (n - 1)) == 0);
            with[n]++;
        }
        assert_true(with[8] > FRAME / 10 && with[8] < FRAME && with[64] + with[128] > 0);
        free(one);
        free(five);
    }
}

/* The mean of many pictures is that of a fixed count. */
static void same_mean(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    enum { SEEDS = 24 };
    struct moments adaptive = {0}, fixed = {0};
    for (uint32_t seed = 0; seed < SEEDS; seed++) {
        for (int kind = 0; kind < 2; kind++) {
            trc_render_desc desc = picture_desc(kind ? 0.0f : 0.003f);
            desc.seed = seed;
            if (kind)
                desc.sample_count = 64;
            struct picture *p = picture_draw(scene, &desc);
            moments_add_picture(kind ? &fixed : &adaptive, p);
            free(p);
        }
    }
    moments_require_same(&adaptive, &fixed);
}

/* A veil over all of the picture that lets half through: every sample that counts meets it, so it
 * covers a half of every pixel, however many samples are taken for the error alone. */
static void mattes_are_of_samples_that_count(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const float corners[12] = {-9, -9, 3, 9, -9, 3, 9, 9, 3, -9, 9, 3};
    const trc_mesh_desc mesh = fixture_quad_desc(corners);
    const trc_id material = fixture_transparent(scene, 0.5f, 0.5f, 0.5f, NULL);
    trc_id id = 0;
    assert_int_equal(trc_mesh_create(scene, &mesh, &id), TRC_OK);
    trc_instance_desc instance = default_instance_desc(id);
    instance.materials = &material;
    instance.material_count = 1;
    instance.cryptomatte_object = trc_cryptomatte_id("veil");
    assert_int_equal(trc_instance_create(scene, &instance, &id), TRC_OK);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    static float mattes[4 * FRAME], counts[FRAME];
    trc_render_desc desc = picture_desc(0.003f);
    desc.passes |= UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
    desc.cryptomattes = 1u << TRC_CRYPTOMATTE_OBJECT;
    desc.cryptomatte_depth = 2;
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(
        trc_render_read(render, TRC_PASS_CRYPTOMATTE(TRC_CRYPTOMATTE_OBJECT, 0), mattes, 4 * FRAME),
        TRC_OK);
    assert_int_equal(trc_render_read(render, TRC_PASS_SAMPLE_COUNT, counts, FRAME), TRC_OK);
    trc_render_progress progress = {.struct_size = sizeof progress};
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    double counted = 0.0;
    float least = INFINITY, most = 0.0f;
    for (uint32_t i = 0; i < FRAME; i++) {
        counted += (double)counts[i];
        least = fminf(least, counts[i]);
        most = fmaxf(most, counts[i]);
        assert_true(mattes[4 * i] == trc_cryptomatte_id("veil"));
        assert_float_equal(mattes[4 * i + 1], 0.5f, 1e-6f);
    }
    assert_true(least < most);
    assert_true(counted < 0.99 * (double)progress.rays_camera / 2.0); /* one on through the veil */
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(unbiased),
                                       cmocka_unit_test(stages),
                                       cmocka_unit_test(neighbours),
                                       cmocka_unit_test(unreached),
                                       cmocka_unit_test(counts),
                                       cmocka_unit_test(same_mean),
                                       cmocka_unit_test(mattes_are_of_samples_that_count)};
    return cmocka_run_group_tests(tests, fixture_setup, fixture_teardown);
}
