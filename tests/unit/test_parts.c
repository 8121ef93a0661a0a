/* Parts of the samples of a picture, put together: the bits of one render, of every pass, for every
 * sampler; adaptive sampling, reconstruction, and what does not fit. */
#include "fixture.h"

#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "rng.h"

enum {
    WIDTH = 40, /* two tiles, one of them narrow */
    HEIGHT = 12,
    FRAME = WIDTH * HEIGHT,
    SAMPLES = 64,
    LAYERS = 2,
    MAX_CHANNELS = 2 * (TRC_MAX_CRYPTOMATTE_DEPTH + 2)
};

/* ---- a scene with something in every pass ---- */

static trc_id add_square(trc_scene scene, float x, float z, trc_id material, const char *name,
                         uint32_t flags) {
    const float corners[12] = {x - 1, -1, z, x + 1, -1, z, x + 1, 1, z, x - 1, 1, z};
    trc_mesh_desc desc = fixture_quad_desc(corners);
    trc_id mesh = 0, instance = 0;
    assert_int_equal(trc_mesh_create(scene, &desc, &mesh), TRC_OK);
    trc_instance_desc instance_desc = default_instance_desc(mesh);
    instance_desc.materials = &material;
    instance_desc.material_count = 1;
    instance_desc.flags = flags;
    instance_desc.cryptomatte_object = trc_cryptomatte_id(name);
    assert_int_equal(trc_instance_create(scene, &instance_desc, &instance), TRC_OK);
    return instance;
}

enum view { STILL, MOVING, WIDE_LENS, VIEW_COUNT };

static void set_camera(trc_scene scene, enum view view) {
    static const float transforms[24] = {1, 0, 0, 0,    0, 1, 0, 0, 0, 0, 1, 6,
                                         1, 0, 0, 0.3f, 0, 1, 0, 0, 0, 0, 1, 6};
    trc_camera_desc camera = default_camera_desc();
    const float half = 0.25f * (float)HEIGHT / (float)WIDTH;
    const float windows[8] = {-0.25f, 0.25f, -half, half, -0.25f, 0.25f, -half, half};
    camera.transforms = transforms;
    camera.windows = windows;
    camera.key_count = view == MOVING ? 2 : 1;
    camera.shutter_time = view == MOVING ? 1.0f : 0.0f;
    camera.aperture_radius = view == WIDE_LENS ? 0.5f : 0.0f;
    assert_int_equal(trc_scene_set_camera(scene, &camera), TRC_OK);
}

static trc_scene create_scene(enum view view) {
    trc_scene scene = 0;
    trc_id id = 0;
    const trc_scene_desc desc = default_scene_desc();
    assert_int_equal(trc_scene_create(&desc, &scene), TRC_OK);
    const trc_id grey = fixture_material(scene, TRC_NODE_DIFFUSE, 0.6f);
    add_square(scene, 0.0f, 0.0f, grey, "floor", TRC_INSTANCE_SHADOW_CATCHER);
    add_square(scene, -1.2f, 0.5f, grey, "wall", 0);
    add_square(scene, 1.1f, 1.0f, fixture_glossy(scene, 0.8f, 0.4f), "gloss", 0);
    /* Mattes of parts of samples. */
    const trc_id veil = fixture_transparent(scene, 0.3f, 0.4f, 0.2f, "veil");
    add_square(scene, 0.4f, 2.0f, veil, "veil", 0);
    add_square(scene, 0.7f, 2.2f, veil, "other veil", 0);
    trc_light_desc light = default_light_desc();
    light.size_x = 2.0f;
    light.light_group = 1;
    assert_int_equal(trc_light_create(scene, &light, &id), TRC_OK);
    const trc_world_desc world =
        default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.1f));
    assert_int_equal(trc_scene_set_world(scene, &world), TRC_OK);
    set_camera(scene, view);
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

static trc_render_desc whole_desc(void) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, SAMPLES);
    desc.passes = (UINT64_C(1) << TRC_PASS_COUNT) - 1 - (UINT64_C(1) << TRC_PASS_SHADOW_CATCHER);
    desc.light_group_count = 2;
    desc.aov_value_count = desc.aov_color_count = 1;
    desc.cryptomattes = (1u << TRC_CRYPTOMATTE_KINDS) - 1;
    desc.cryptomatte_depth = 2 * LAYERS;
    desc.clamp_direct = 0.9f;
    desc.clamp_indirect = 0.4f;
    desc.film_exposure = 1.3f;
    desc.filter = TRC_FILTER_BLACKMAN_HARRIS;
    desc.filter_width = 1.5f;
    return desc;
}

/* ---- pictures ---- */

/* Every pass that a render has, one after the other. */
struct picture {
    float *pixels;
    uint64_t count;
};

static struct picture read_all(trc_render render) {
    struct picture p = {.pixels = NULL};
    for (uint32_t pass = 0; pass < TRC_SUMS_END; pass++) {
        const uint64_t count = (uint64_t)trc_pass_channels(pass) * FRAME;
        if (!count)
            continue;
        p.pixels = realloc(p.pixels, (p.count + count) * sizeof *p.pixels);
        assert_non_null(p.pixels);
        if (trc_render_read(render, pass, p.pixels + p.count, count) == TRC_OK)
            p.count += count;
    }
    return p;
}

static trc_render run(trc_scene scene, const trc_render_desc *desc) {
    trc_render render = 0;
    assert_int_equal(trc_render_start(scene, desc, &render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    return render;
}

static struct picture draw(trc_scene scene, const trc_render_desc *desc) {
    const trc_render render = run(scene, desc);
    const struct picture p = read_all(render);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    return p;
}

/* ---- parts ---- */

/* What a part's film has. */
struct part {
    trc_part_desc desc;
    trc_sums sums[TRC_SUMS_END];
    double *values[TRC_SUMS_END];
};

static void part_draw(trc_scene scene, trc_render_desc desc, uint32_t begin, uint32_t end,
                      struct part *part) {
    desc.sample_offset = begin;
    desc.sample_subset = end - begin;
    const trc_render render = run(scene, &desc);
    trc_render_progress progress = trc_render_progress_default();
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_true(progress.fraction == 1.0f && progress.samples_done == end - begin);
    part->desc = trc_part_desc_default();
    part->desc.sample_offset = begin;
    part->desc.sample_subset = end - begin;
    part->desc.sums = part->sums;
    for (uint32_t number = 0; number < TRC_SUMS_END; number++) {
        const uint64_t count = (uint64_t)trc_sums_channels(render, number) * FRAME;
        if (!count)
            continue;
        double *values = malloc(count * sizeof *values);
        assert_non_null(values);
        assert_int_equal(trc_sums_read(render, number, values, count), TRC_OK);
        part->values[part->desc.sums_count] = values;
        part->sums[part->desc.sums_count++] = (trc_sums){sizeof(trc_sums), number, values, count};
    }
    assert_int_equal(trc_render_destroy(render), TRC_OK);
}

static void part_free(struct part *part) {
    for (uint32_t i = 0; i < part->desc.sums_count; i++)
        free(part->values[i]);
    memset(part, 0, sizeof *part);
}

/* The picture of parts that end at such counts of samples. */
static struct picture merge(trc_scene scene, const trc_render_desc *desc, const uint32_t *ends,
                            uint32_t count) {
    static struct part part;
    trc_render render = 0;
    assert_int_equal(trc_merge_start(desc, 1, &render), TRC_OK);
    for (uint32_t i = 0; i < count; i++) {
        part_draw(scene, *desc, i ? ends[i - 1] : 0, ends[i], &part);
        assert_int_equal(trc_merge_add(render, &part.desc), TRC_OK);
        part_free(&part);
    }
    assert_int_equal(trc_merge_finish(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    trc_render_progress progress = trc_render_progress_default();
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    assert_int_equal(progress.state, TRC_PROGRESS_DONE);
    assert_true(progress.fraction == 1.0f && progress.samples_done == desc->sample_count);
    const struct picture p = read_all(render);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    return p;
}

static struct picture merge_even(trc_scene scene, const trc_render_desc *desc, uint32_t count) {
    uint32_t ends[SAMPLES];
    for (uint32_t i = 0; i < count; i++)
        ends[i] = (i + 1) * SAMPLES / count;
    return merge(scene, desc, ends, count);
}

static void expect_same_bits(struct picture a, struct picture b, const char *what) {
    assert_int_equal(a.count, b.count);
    uint64_t different = 0;
    for (uint64_t i = 0; i < a.count; i++)
        different += memcmp(a.pixels + i, b.pixels + i, sizeof *a.pixels) != 0;
    if (different)
        fail_msg("%s: %u of %u numbers differ", what, (unsigned)different, (unsigned)a.count);
}

static void expect_bits_of(trc_scene scene, uint32_t sampler, const uint32_t *counts) {
    trc_render_desc desc = whole_desc();
    desc.sampler = sampler;
    struct picture whole = draw(scene, &desc);
    for (; *counts; counts++) {
        struct picture merged = merge_even(scene, &desc, *counts);
        char what[64];
        snprintf(what, sizeof what, "sampler %u, %u parts", sampler, *counts);
        expect_same_bits(whole, merged, what);
        free(merged.pixels);
    }
    free(whole.pixels);
}

static void bits_of_one_render(void **state) {
    (void)state;
    static const uint32_t all[] = {1, 2, 5, SAMPLES, 0}, some[] = {5, 0};
    for (int view = 0; view < VIEW_COUNT; view++) {
        const trc_scene scene = create_scene((enum view)view);
        expect_bits_of(scene, TRC_SAMPLER_SOBOL, all);
        for (uint32_t sampler = 1; view == MOVING && sampler <= TRC_SAMPLER_BLUE_NOISE; sampler++)
            expect_bits_of(scene, sampler, some);
        assert_int_equal(trc_scene_destroy(scene), TRC_OK);
    }
}

/* A picture of the catchers' shadows, and a transparent film. */
static void catchers_apart(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    trc_render_desc desc = whole_desc();
    desc.passes |= UINT64_C(1) << TRC_PASS_SHADOW_CATCHER;
    desc.film_transparent = 1;
    struct picture whole = draw(scene, &desc), merged = merge_even(scene, &desc, 3);
    expect_same_bits(whole, merged, "shadow catchers");
    free(whole.pixels);
    free(merged.pixels);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Parts that end where pixels may stop have all samples; what one render would have left out is
 * left out of the merge. */
static void adaptive_sampling(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    trc_render_desc desc = whole_desc();
    desc.noise_threshold = 0.03f;
    desc.min_samples = 8;
    struct picture whole = draw(scene, &desc);
    static const uint32_t ends[] = {2, 4, 8, 12, 16, 32, 48, 63, 64};
    struct picture merged = merge(scene, &desc, ends, sizeof ends / sizeof *ends);
    expect_same_bits(whole, merged, "adaptive sampling");
    desc.noise_threshold = 0.0f;
    struct picture all = draw(scene, &desc);
    assert_memory_not_equal(whole.pixels, all.pixels, 4 * FRAME * sizeof(float));
    free(whole.pixels);
    free(merged.pixels);
    free(all.pixels);
    static struct part part;
    desc.noise_threshold = 0.03f;
    trc_render render = 0;
    assert_int_equal(trc_merge_start(&desc, 1, &render), TRC_OK);
    part_draw(scene, desc, 0, 5, &part);
    assert_int_equal(trc_merge_add(render, &part.desc), TRC_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(trc_last_message(), "sample 4"));
    part_free(&part);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* The first half may end between parts, in one, or at a power of two with adaptive sampling. */
static void reconstruction(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    static const uint32_t ends[3][5] = {{32, 64}, {20, 40, 64}, {4, 8, 16, 32, 64}};
    static const uint32_t counts[3] = {2, 3, 5};
    for (int kind = 0; kind < 3; kind++) {
        trc_render_desc desc = whole_desc();
        desc.denoise = 1;
        desc.noise_threshold = kind == 2 ? 0.03f : 0.0f;
        desc.min_samples = 8;
        struct picture whole = draw(scene, &desc);
        struct picture merged = merge(scene, &desc, ends[kind], counts[kind]);
        assert_int_equal(whole.count, merged.count);
        double error = 0.0;
        for (uint64_t i = 0; i < 4 * FRAME; i++)
            error = fmax(error, fabs((double)whole.pixels[i] - (double)merged.pixels[i]));
        printf("reconstruction of parts %d: %.1e apart\n", kind, error);
        assert_true(error < 1e-5);
        if (kind != 1)
            expect_same_bits(whole, merged, "reconstruction");
        free(whole.pixels);
        free(merged.pixels);
    }
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* ---- what does not fit ---- */

static void expect_refused(trc_render render, const struct part *part, const char *reason) {
    assert_int_equal(trc_merge_add(render, &part->desc), TRC_ERROR_INVALID_ARGUMENT);
    if (!strstr(trc_last_message(), reason))
        fail_msg("\"%s\" does not say \"%s\"", trc_last_message(), reason);
}

static void parts_that_do_not_fit(void **state) {
    (void)state;
    static struct part part;
    const trc_scene scene = create_scene(STILL);
    const trc_render_desc desc = whole_desc();
    struct picture whole = draw(scene, &desc);
    trc_render render = 0;
    assert_int_equal(trc_merge_start(&desc, 1, &render), TRC_OK);
    assert_int_equal(trc_merge_finish(render), TRC_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(trc_last_message(), "samples 0 to 64"));

    part_draw(scene, desc, 8, 64, &part);
    expect_refused(render, &part, "begins at sample 8, not at 0");
    part.desc.sample_offset = 0;
    part.desc.sample_subset = 65;
    assert_int_equal(trc_merge_add(render, &part.desc), TRC_ERROR_TOO_LARGE);
    part_free(&part);

    part_draw(scene, desc, 0, 8, &part);
    part.desc.sums_count--;
    expect_refused(render, &part, "lacks sums");
    part.desc.sums_count++;
    const trc_sums kept = part.sums[1];
    part.sums[1].number = TRC_PASS_COMBINED;
    part.sums[1].value_count = part.sums[0].value_count;
    expect_refused(render, &part, "twice");
    part.sums[1] = kept;
    part.sums[1].number = TRC_SUMS_HALVES;
    expect_refused(render, &part, "the film has not");
    part.sums[1] = kept;
    part.sums[1].value_count--;
    expect_refused(render, &part, "values");
    part.sums[1] = kept;
    static const double bad[] = {NAN, -1.0, 0.5, 9.0, INFINITY};
    for (uint32_t i = 0; i < part.desc.sums_count; i++)
        for (int k = 0; part.sums[i].number == TRC_PASS_SAMPLE_COUNT && k < 5; k++) {
            part.values[i][FRAME - 1] = bad[k];
            expect_refused(render, &part, "sample count");
            part.values[i][FRAME - 1] = 8.0;
        }
    /* None of it is in the picture. */
    assert_int_equal(trc_merge_add(render, &part.desc), TRC_OK);
    expect_refused(render, &part, "begins at sample 0, not at 8");
    part_free(&part);
    part_draw(scene, desc, 8, 64, &part);
    assert_int_equal(trc_merge_add(render, &part.desc), TRC_OK);
    assert_int_equal(trc_merge_finish(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_merge_finish(render), TRC_ERROR_INVALID_ARGUMENT);
    struct picture merged = read_all(render);
    expect_same_bits(whole, merged, "after refusals");
    expect_refused(render, &part, "has ended");
    part_free(&part);
    free(whole.pixels);
    free(merged.pixels);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* A cancelled merge ends; renders have no parts added; ranges are checked. */
static void misuse(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    trc_render_desc desc = whole_desc();
    trc_render render = 0;
    trc_part_desc none = trc_part_desc_default();
    none.sample_subset = SAMPLES;
    double value = 0.0;
    assert_int_equal(trc_merge_start(&desc, 0, &render), TRC_OK);
    assert_int_equal(trc_sums_channels(render, TRC_SUMS_CATCHERS), 0);
    assert_int_equal(trc_sums_channels(render, TRC_SUMS_END), 0);
    assert_int_equal(trc_sums_read(render, 0, &value, 1), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_render_cancel(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(trc_merge_add(render, &none), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_merge_finish(render), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_sums_channels(render, 0), 0);
    assert_int_equal(trc_merge_start(&desc, 2, &render), TRC_ERROR_INVALID_ARGUMENT);
    render = run(scene, &desc);
    assert_int_equal(trc_merge_add(render, &none), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_merge_finish(render), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    desc.sample_offset = SAMPLES;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_ERROR_TOO_LARGE);
    desc.sample_offset = SAMPLES - 1;
    desc.sample_subset = 2;
    assert_int_equal(trc_render_start(scene, &desc, &render), TRC_ERROR_TOO_LARGE);
    desc.sample_subset = 1;
    assert_int_equal(trc_merge_start(&desc, 0, &render), TRC_ERROR_INVALID_ARGUMENT);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

static trc_render_progress poll(trc_render render) {
    trc_render_progress progress = trc_render_progress_default();
    assert_int_equal(trc_render_poll(render, &progress), TRC_OK);
    return progress;
}

/* A merge that has all its parts, and is not finished. */
static trc_render start_merge(trc_scene scene, const trc_render_desc *desc) {
    static struct part part;
    trc_render render = 0;
    assert_int_equal(trc_merge_start(desc, 1, &render), TRC_OK);
    part_draw(scene, *desc, 0, SAMPLES, &part);
    assert_int_equal(trc_merge_add(render, &part.desc), TRC_OK);
    part_free(&part);
    return render;
}

/* What was cancelled is not done later, and its time is that since the start of the merge. */
static void ends(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    const trc_render_desc desc = whole_desc();
    trc_render render = start_merge(scene, &desc);
    assert_int_equal(trc_render_cancel(render), TRC_OK);
    assert_int_equal(trc_merge_finish(render), TRC_ERROR_INVALID_ARGUMENT);
    assert_non_null(strstr(trc_last_message(), "has ended"));
    assert_int_equal(poll(render).state, TRC_PROGRESS_CANCELLED);
    assert_int_equal(trc_render_destroy(render), TRC_OK);

    render = start_merge(scene, &desc);
    const double seconds = poll(render).seconds;
    assert_int_equal(trc_merge_finish(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    assert_int_equal(poll(render).state, TRC_PROGRESS_DONE);
    assert_true(poll(render).seconds >= seconds);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

/* Of a merge for which the system has no thread, all is as before: it can be finished later. */
static void finish_without_threads(void **state) {
    (void)state;
    const trc_scene scene = create_scene(STILL);
    trc_render_desc desc = whole_desc();
    desc.denoise = TRC_DENOISE_FINAL;
    struct picture whole = draw(scene, &desc);
    const trc_render render = start_merge(scene, &desc);
    trc_memory_fail_at(0, true);
    const trc_status status = trc_merge_finish(render);
    trc_memory_fail_at(-1, false);
    assert_int_equal(status, TRC_ERROR_OUT_OF_MEMORY);
    assert_int_equal(poll(render).state, TRC_PROGRESS_RUNNING);
    assert_int_equal(poll(render).tiles_done, 0);
    assert_int_equal(trc_merge_finish(render), TRC_OK);
    assert_int_equal(trc_render_wait(render, -1.0), TRC_OK);
    struct picture merged = read_all(render);
    expect_same_bits(whole, merged, "a second finish");
    free(whole.pixels);
    free(merged.pixels);
    assert_int_equal(trc_render_destroy(render), TRC_OK);
    assert_int_equal(trc_scene_destroy(scene), TRC_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bits_of_one_render),
        cmocka_unit_test(catchers_apart),
        cmocka_unit_test(adaptive_sampling),
        cmocka_unit_test(reconstruction),
        cmocka_unit_test(parts_that_do_not_fit),
        cmocka_unit_test(misuse),
        cmocka_unit_test(ends),
        cmocka_unit_test(finish_without_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
