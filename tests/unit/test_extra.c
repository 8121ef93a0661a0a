/* Extra samples: who gets them, how many, that the mean does not depend on it, and what they gain.
 */
#include "counted_picture.h"

#include <stdbool.h>

#include "model/extra.h"
#include "rng.h"

/* ---- the plan, of films whose noise is known ---- */

/* Four tiles. */
enum { SIDE = 40, PIXELS = SIDE * SIDE, SAMPLES = 16 };

struct square {
    struct trc_film film;
    struct trc_half halves[PIXELS];
    double combined[4 * PIXELS];
    uint32_t counts[PIXELS];
    struct trc_extra extra;
};

/* Even light of 1; its two halves agree. */
static struct square *square_create(float share) {
    struct square *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->film = (struct trc_film){
        .width = SIDE, .height = SIDE, .sample_counts = s->counts, .halves = s->halves};
    s->film.sums[TRC_PASS_COMBINED] = s->combined;
    for (uint32_t i = 0; i < PIXELS; i++) {
        s->counts[i] = SAMPLES;
        s->halves[i].count = SAMPLES / 2;
        for (int c = 0; c < 4; c++) {
            s->combined[4 * i + (uint32_t)c] = SAMPLES;
            s->halves[i].light[c] = SAMPLES / 2;
        }
    }
    trc_render_desc desc = default_render_desc(SIDE, SIDE, SAMPLES);
    desc.crop_width = desc.crop_height = SIDE;
    desc.extra_samples = share;
    assert_int_equal(trc_extra_create(&desc, &s->extra), TRC_OK);
    return s;
}

static void square_destroy(struct square *s) {
    trc_extra_destroy(&s->extra);
    free(s);
}

/* Lets the halves of a pixel lie apart by so much. */
static void set_noise(struct square *s, uint32_t pixel, float apart) {
    s->halves[pixel].light[0] = SAMPLES / 2 * (1.0f + apart / 2.0f);
}

/* The noise that is planned by: apart over three channels of light, root mean square around. */
static double noise_around(const double *apart, uint32_t pixel) {
    const int px = (int)(pixel % SIDE), py = (int)(pixel / SIDE);
    double sum = 0.0, weights = 0.0;
    for (int y = py - 2; y <= py + 2; y++)
        for (int x = px - 2; x <= px + 2; x++) {
            if (x < 0 || y < 0 || x >= SIDE || y >= SIDE || (x == px && y == py))
                continue;
            const double weight = exp(-0.5 * ((x - px) * (x - px) + (y - py) * (y - py)));
            sum += weight * pow(apart[y * SIDE + x] / 3.03, 2.0);
            weights += weight;
        }
    return sqrt(sum / weights);
}

static uint64_t planned_of(const struct square *s) {
    uint64_t extra = 0;
    for (uint32_t i = 0; i < PIXELS; i++)
        extra += ((UINT64_C(1) << s->extra.levels[i]) - 1) * SAMPLES;
    return extra;
}

/* Rays of a sample of each pixel, by its tile: some power of two. */
static void set_rays(struct square *s, struct rng *r, double *rays) {
    for (uint32_t y = 0; y < SIDE; y += TRC_TILE_SIZE)
        for (uint32_t x = 0; x < SIDE; x += TRC_TILE_SIZE) {
            const uint32_t each = 1u << rng_below(r, 6);
            const uint32_t right = x ? SIDE : TRC_TILE_SIZE, up = y ? SIDE : TRC_TILE_SIZE;
            *trc_extra_tile_rays(&s->extra, x, y) = (right - x) * (up - y) * SAMPLES * each;
            for (uint32_t j = y; j < up; j++)
                for (uint32_t i = x; i < right; i++)
                    rays[j * SIDE + i] = each;
        }
}

/* Against noise over the root of rays, and rays, by doubles, pixel by pixel. */
static void plans(void **state) {
    (void)state;
    struct rng r = rng_seed(3);
    for (int trial = 0; trial < 40; trial++) {
        const double share = trial % 4 * 0.15 + 0.02;
        struct square *s = square_create((float)share);
        double apart[PIXELS], worth[PIXELS], rays[PIXELS], all = 0.0, planned = 0.0;
        set_rays(s, &r, rays);
        for (uint32_t i = 0; i < PIXELS; i++) {
            apart[i] = pow(2.0, -6.0 * (double)rng_unit(&r));
            set_noise(s, i, (float)apart[i]);
        }
        assert_true(trc_extra_plan(&s->extra, &s->film) == planned_of(s));
        double least = INFINITY; /* of level 1 */
        for (uint32_t i = 0; i < PIXELS; i++) {
            worth[i] = noise_around(apart, i) / sqrt(rays[i]);
            all += rays[i];
            planned += rays[i] * (pow(2.0, s->extra.levels[i]) - 1.0);
            if (s->extra.levels[i] && worth[i] < least)
                least = worth[i];
        }
        /* As many as the share allows: a bin is a sixteenth of an octave, weights have 4 digits. */
        double lower = 0.0;
        for (uint32_t i = 0; i < PIXELS; i++) {
            const double octave = log2(worth[i] / least);
            const uint32_t level = s->extra.levels[i];
            assert_true(level == 0 || octave > (double)level - 1.0 - 0.1);
            assert_true(level == TRC_EXTRA_LEVELS || octave < (double)level + 0.1);
            for (int k = 0; k < TRC_EXTRA_LEVELS; k++)
                lower += octave > k - 0.15 ? rays[i] * pow(2.0, k) : 0.0;
        }
        assert_true(planned <= share * all * 1.000001);
        assert_true(lower > share * all);
        square_destroy(s);
    }
}

/* One noisy pixel: it gets none, those around it do, whatever its noise is. */
static void neighbours(void **state) {
    (void)state;
    enum { AT = 12 * SIDE + 9 };
    for (float apart = 0.125f; apart <= 1.0f; apart *= 2.0f) {
        struct square *s = square_create(1.0f);
        set_noise(s, AT, apart);
        trc_extra_plan(&s->extra, &s->film);
        for (uint32_t i = 0; i < PIXELS; i++) {
            const int dx = (int)(i % SIDE) - AT % SIDE, dy = (int)(i / SIDE) - AT / SIDE;
            const bool is_near = i != AT && dx * dx <= 1 && dy * dy <= 1;
            const bool is_far = dx * dx > 4 || dy * dy > 4;
            assert_true(!is_near || s->extra.levels[i]);
            assert_true(!(is_far || i == AT) || !s->extra.levels[i]);
        }
        square_destroy(s);
    }
}

/* What nobody sees gets nothing; nor do pixels without two halves, or a picture of one pixel. */
static void nothing_to_do(void **state) {
    (void)state;
    struct square *s = square_create(1.0f);
    assert_true(trc_extra_plan(&s->extra, &s->film) == 0);
    for (uint32_t i = 0; i < PIXELS; i++)
        set_noise(s, i, 0.002f);
    assert_true(trc_extra_plan(&s->extra, &s->film) == 0);
    for (uint32_t i = 0; i < PIXELS; i++) {
        set_noise(s, i, 0.5f);
        s->halves[i].count = i % 2 ? 0 : SAMPLES;
    }
    assert_true(trc_extra_plan(&s->extra, &s->film) == 0);
    for (uint32_t i = 0; i < PIXELS; i++)
        s->halves[i].count = SAMPLES / 2;
    assert_true(trc_extra_plan(&s->extra, &s->film) > 0);
    s->extra.width = s->extra.height = 1;
    assert_true(trc_extra_plan(&s->extra, &s->film) == 0);
    square_destroy(s);
}

/* ---- renders ---- */

static trc_render_desc picture_desc(uint32_t samples, float share) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples);
    desc.passes = UINT64_C(1) << TRC_PASS_SAMPLE_COUNT;
    desc.extra_samples = share;
    return desc;
}

/* Counts are those of the plan's levels and keep to the share, one thread or five make the same
 * bits, and pixels without extra samples are what they are without. */
static void counts(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    const uint32_t samples[] = {4, 5, 16, 37};
    for (int k = 0; k < 4; k++) {
        const uint32_t n = samples[k];
        trc_render_desc desc = picture_desc(n, 0.0f);
        struct picture *plain = picture_draw(scene, &desc);
        desc.extra_samples = 0.2f;
        struct picture *one = picture_draw(scene, &desc);
        desc.thread_count = 5;
        struct picture *five = picture_draw(scene, &desc);
        assert_memory_equal(one->combined, five->combined, sizeof one->combined);
        assert_memory_equal(one->counts, five->counts, sizeof one->counts);
        assert_true(one->progress.fraction == 1.0f && one->progress.samples_done == n);
        double sum = 0.0;
        uint32_t most = 0;
        for (uint32_t i = 0; i < FRAME; i++) {
            const uint32_t count = (uint32_t)one->counts[i];
            sum += count;
            most = count > most ? count : most;
            assert_true(count == n || count == 2 * n || count == 4 * n || count == 8 * n);
            assert_true(plain->counts[i] == (float)n);
            if (count == n)
                assert_memory_equal(plain->combined + 4 * i, one->combined + 4 * i, 16);
        }
        assert_true(sum == (double)one->progress.rays_camera);
        assert_true(sum > 1.02 * n * FRAME && sum <= 1.2 * n * FRAME && most > 2 * n);
        free(plain);
        free(one);
        free(five);
    }
}

/* The first half of a pixel's samples, as reconstruction needs it, is half of them. */
static void halves(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    enum { CHANNELS = 12, COUNT = CHANNELS - 1 };
    static double sums[CHANNELS * FRAME], counts[FRAME];
    trc_render_desc desc = picture_desc(SAMPLES, 0.2f);
    desc.denoise = TRC_DENOISE_FINAL;
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_sums_read(render, TRC_SUMS_HALVES, sums, CHANNELS * FRAME), TRC_OK);
    assert_int_equal(trc_sums_read(render, TRC_PASS_SAMPLE_COUNT, counts, FRAME), TRC_OK);
    double most = 0.0;
    for (uint32_t i = 0; i < FRAME; i++) {
        assert_true(sums[CHANNELS * i + COUNT] == counts[i] / 2.0);
        most = fmax(most, counts[i]);
    }
    assert_true(most > SAMPLES);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

/* The mean of many pictures, and what the extra samples gain: with a fifth more, the error of this
 * picture of edges is less than half. */
static void same_mean_and_less_error(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    enum { SEEDS = 24 };
    struct moments means[2] = {0};
    double errors[2] = {0.0};
    trc_render_desc desc = picture_desc(4096, 0.0f);
    desc.seed = 1000;
    struct picture *exact = picture_draw(scene, &desc);
    for (uint32_t seed = 0; seed < SEEDS; seed++)
        for (int kind = 0; kind < 2; kind++) {
            desc = picture_desc(SAMPLES, kind ? 0.2f : 0.0f);
            desc.seed = seed;
            struct picture *p = picture_draw(scene, &desc);
            moments_add_picture(&means[kind], p);
            for (uint32_t i = 0; i < 4 * FRAME; i++)
                errors[kind] += pow((double)(p->combined[i] - exact->combined[i]), 2.0);
            free(p);
        }
    free(exact);
    moments_require_same(&means[1], &means[0]);
    print_message("error over that without: %.3f\n", errors[1] / errors[0]);
    assert_true(errors[1] < 0.5 * errors[0]);
}

/* Where they cannot be had they change no bit. */
static void not_read(void **state) {
    const trc_scene scene = *(const trc_scene *)*state;
    for (int kind = 0; kind < 4; kind++) {
        struct picture *pictures[2];
        for (int with = 0; with < 2; with++) {
            trc_render_desc desc = picture_desc(kind == 0 ? 3 : SAMPLES, with ? 1.0f : 0.0f);
            desc.progressive = kind == 1;
            desc.noise_threshold = kind == 2 ? 0.1f : 0.0f;
            desc.min_samples = 4;
            desc.sample_subset = kind == 3 ? SAMPLES / 2 : 0;
            pictures[with] = picture_draw(scene, &desc);
        }
        assert_memory_equal(pictures[0]->counts, pictures[1]->counts, sizeof pictures[0]->counts);
        assert_memory_equal(pictures[0]->combined, pictures[1]->combined,
                            sizeof pictures[0]->combined);
        free(pictures[0]);
        free(pictures[1]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plans),         cmocka_unit_test(neighbours),
        cmocka_unit_test(nothing_to_do), cmocka_unit_test(counts),
        cmocka_unit_test(halves),        cmocka_unit_test(same_mean_and_less_error),
        cmocka_unit_test(not_read)};
    return cmocka_run_group_tests(tests, fixture_setup, fixture_teardown);
}
