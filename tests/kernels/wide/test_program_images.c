/* Images in material programs: filters, extensions, colours and projections against values in
 * double. */
#include "program_test.h"

#include <stdlib.h>

#include "image/image.h"

static double wrap_reference(int i, int n, uint32_t extension, bool *outside) {
    *outside = extension == TRC_IMAGE_CLIP && (i < 0 || i >= n);
    if (extension == TRC_IMAGE_REPEAT)
        return ((i % n) + n) % n;
    if (extension == TRC_IMAGE_MIRROR) {
        const int m = ((i % (2 * n)) + 2 * n) % (2 * n);
        return m < n ? m : 2 * n - 1 - m;
    }
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

static double texel_reference(const float *texels, int width, int height, int x, int y,
                              uint32_t extension, int c) {
    bool out_x, out_y;
    const int column = (int)wrap_reference(x, width, extension, &out_x);
    const int row = (int)wrap_reference(y, height, extension, &out_y);
    return out_x || out_y ? 0.0 : (double)texels[4 * (row * width + column) + c];
}

static double spline(int i, double t) {
    const double w[4] = {(1 - t) * (1 - t) * (1 - t) / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
                         (-3 * t * t * t + 3 * t * t + 3 * t + 1) / 6, t * t * t / 6};
    return w[i];
}

static double lookup_reference(const float *texels, int width, int height, uint32_t mode, double u,
                               double v, int c) {
    const uint32_t extension = mode & TRC_IMAGE_EXTENSION_MASK,
                   kind = mode & TRC_IMAGE_INTERPOLATION_MASK;
    const double shift = kind == TRC_IMAGE_CLOSEST ? 0.0 : 0.5;
    const double x = u * width - shift, y = v * height - shift;
    const int ix = (int)floor(x), iy = (int)floor(y);
    const double tx = x - ix, ty = y - iy;
    if (kind == TRC_IMAGE_CLOSEST)
        return texel_reference(texels, width, height, ix, iy, extension, c);
    const int taps = kind == TRC_IMAGE_CUBIC ? 4 : 2, first = kind == TRC_IMAGE_CUBIC ? -1 : 0;
    double sum = 0;
    for (int j = 0; j < taps; j++) {
        for (int i = 0; i < taps; i++) {
            const double wx = taps == 4 ? spline(i, tx) : i ? tx : 1 - tx;
            const double wy = taps == 4 ? spline(j, ty) : j ? ty : 1 - ty;
            sum += wx * wy *
                   texel_reference(texels, width, height, ix + first + i, iy + first + j, extension,
                                   c);
        }
    }
    return sum;
}

/* Shading points where image 0 is the one described and image 1 was destroyed. */
struct image_scene {
    struct trc_image *images[2];
    struct trc_snapshot snapshot;
    struct trc_surface surface;
};

static void image_scene_init(struct image_scene *scene, const trc_image_desc *desc) {
    *scene =
        (struct image_scene){.snapshot = {.image_count = 2, .images = scene->images},
                             .surface = {.snapshot = &scene->snapshot, .active = vm_all_set()}};
    assert_int_equal(trc_image_load(desc, &(struct trc_image_source){0}, &scene->images[0]),
                     TRC_OK);
}

/* Every filter and extension on images of several sizes against double. */
static void check_lookups(int width, int height, struct rng *r) {
    float *texels = malloc((size_t)(width * height) * 4 * sizeof *texels);
    for (int i = 0; i < width * height * 4; i++)
        texels[i] = rng_unit(r);
    const trc_image_desc desc = {.struct_size = sizeof desc,
                                 .width = (uint32_t)width,
                                 .height = (uint32_t)height,
                                 .is_float = 1,
                                 .pixels = texels,
                                 .alpha_mode = TRC_ALPHA_CHANNEL_PACKED,
                                 .pixel_bytes = (uint64_t)(width * height) * 16};
    struct image_scene scene;
    image_scene_init(&scene, &desc);
    static struct trc_registers regs;
    for (uint32_t mode = 0; mode < 16; mode++) {
        struct single p;
        if ((mode & 3u) == 3)
            continue;
        single_init(&p, TRC_OP_IMAGE, mode, 0);
        for (int round = 0; round < 20; round++) {
            regs.r[0] = test_wide_uniform(r) * vf_set(5) - vf_set(2);
            regs.r[1] = test_wide_uniform(r) * vf_set(5) - vf_set(2);
            trc_program_run(&p.material, &scene.surface, &regs);
            for (int l = 0; l < TRC_WIDTH; l++) {
                for (int c = 0; c < 4; c++) {
                    const float u = vf_get(regs.r[0], l), v = vf_get(regs.r[1], l);
                    const double expected = lookup_reference(texels, width, height, mode, u, v, c);
                    if (fabs(vf_get(regs.r[OUT + c], l) - expected) < 2e-5)
                        continue;
                    fail_msg("%d x %d mode %u at (%.9g, %.9g): %.9g, not %.9g", width, height, mode,
                             u, v, vf_get(regs.r[OUT + c], l), expected);
                }
            }
        }
    }
    trc_image_release(scene.images[0]);
    free(texels);
}

static void test_filters(void **state) {
    (void)state;
    struct rng r = rng_seed(11);
    check_lookups(1, 1, &r);
    check_lookups(2, 3, &r);
    check_lookups(1, 7, &r);
    check_lookups(16, 5, &r);
}

/* Coordinates that are huge or not finite read inside the image. */
static void test_wild_coordinates(void **state) {
    (void)state;
    static const float wild[] = {NAN,     INFINITY,    -INFINITY, 1e38f, -1e38f,      2147483648.0f,
                                 -1e-30f, 0.99999994f, 1.0f,      -0.0f, 16777217.0f, 3e9f};
    const uint8_t pixels[16] = {255, 255, 255, 255, 255, 255, 255, 255,
                                255, 255, 255, 255, 255, 255, 255, 255};
    const trc_image_desc desc = {
        .struct_size = sizeof desc, .width = 2, .height = 2, .pixels = pixels, .pixel_bytes = 16};
    struct image_scene scene;
    image_scene_init(&scene, &desc);
    static struct trc_registers regs;
    for (uint32_t mode = 0; mode < 16; mode++) {
        struct single p;
        if ((mode & 3u) == 3)
            continue;
        single_init(&p, TRC_OP_IMAGE, mode, 0);
        for (size_t i = 0; i < sizeof wild / sizeof *wild; i++) {
            for (size_t j = 0; j < sizeof wild / sizeof *wild; j++) {
                regs.r[0] = vf_set(wild[i]);
                regs.r[1] = vf_set(wild[j]);
                trc_program_run(&p.material, &scene.surface, &regs);
                const float value = vf_get(regs.r[OUT], 0);
                assert_true(value >= 0.0f && value <= 1.00001f);
                if ((mode & TRC_IMAGE_EXTENSION_MASK) != TRC_IMAGE_CLIP)
                    assert_true(value > 0.99999f);
            }
        }
    }
    trc_image_release(scene.images[0]);
}

/* sRGB is decoded after filtering, associated colours are divided when alpha is used, missing
 * images are magenta. */
static void test_colors_of_images(void **state) {
    (void)state;
    const uint8_t pixels[8] = {255, 0, 128, 255, 0, 200, 100, 51};
    const trc_image_desc desc = {.struct_size = sizeof desc,
                                 .width = 2,
                                 .height = 1,
                                 .is_srgb = 1,
                                 .pixels = pixels,
                                 .pixel_bytes = 8,
                                 .alpha_mode = TRC_ALPHA_STRAIGHT};
    struct image_scene scene;
    image_scene_init(&scene, &desc);
    static struct trc_registers regs;
    regs.r[0] = regs.r[1] = vf_set(.5f);
    for (int alpha = 0; alpha < 2; alpha++) {
        struct single p;
        single_init(&p, TRC_OP_IMAGE, TRC_IMAGE_EXTEND | (alpha ? TRC_IMAGE_MODE_ALPHA : 0), 0);
        trc_program_run(&p.material, &scene.surface, &regs);
        /* bytes of the second texel times 51 / 255, rounded down: 0, 40, 20 */
        const double encoded[3] = {.5, 20.0 / 255, 74.0 / 255}, a = .5 + .5 * 51 / 255;
        for (int c = 0; c < 3; c++) {
            const double x = alpha ? encoded[c] / a : encoded[c];
            const double linear = x < .04045 ? x / 12.92 : pow((x + .055) / 1.055, 2.4);
            assert_true(is_near(vf_get(regs.r[OUT + c], 0), (float)linear, 2e-5f));
        }
        assert_true(is_near(vf_get(regs.r[OUT + 3], 0), (float)a, 1e-6f));
    }
    for (uint32_t i = 1; i < 4; i++) { /* destroyed, beyond the end, never there */
        struct single p;
        single_init(&p, TRC_OP_IMAGE, 0, i == 3 ? TRC_NO_RESOURCE : i);
        trc_program_run(&p.material, &scene.surface, &regs);
        for (int c = 0; c < 4; c++)
            assert_true(vf_get(regs.r[OUT + c], 0) == (c == 1 ? 0.0f : 1.0f));
    }
    trc_image_release(scene.images[0]);
}

/* Each lane reads the level whose texels are no wider than what its lookup stands for. Levels of a
 * constant image would not differ, so each is painted in a number of its own. */
static void test_levels(void **state) {
    (void)state;
    static float texels[128 * 128 * 4];
    for (size_t i = 0; i < sizeof texels / sizeof *texels; i++)
        texels[i] = 1.0f;
    const trc_image_desc desc = {.struct_size = sizeof desc,
                                 .width = 128,
                                 .height = 128,
                                 .is_float = 1,
                                 .pixels = texels,
                                 .pixel_bytes = sizeof texels,
                                 .is_mip_mapped = 1};
    struct image_scene scene;
    image_scene_init(&scene, &desc);
    struct trc_image *image = scene.images[0];
    assert_int_equal(image->level_count, 4); /* 128, 32, 16, 8 */
    for (uint32_t l = 0; l < image->level_count; l++)
        for (uint64_t i = 0; i < 4ull * image->levels[l].width * image->levels[l].height; i++)
            ((float *)image->levels[l].texels)[i] = (float)l;
    /* In texels of the image. */
    static const float widths[] = {0, 1e-20f, 3.99f, 4, 7.99f, 8, 15.9f, 16, 31.9f, 1e6f, INFINITY};
    static const float expected[] = {0, 0, 0, 1, 1, 2, 2, 3, 3, 3, 3};
    const uint32_t count = sizeof widths / sizeof *widths;
    static struct trc_registers regs;
    for (uint32_t mode = 0; mode <= TRC_IMAGE_CUBIC; mode += TRC_IMAGE_CUBIC) {
        struct single p;
        single_init(&p, TRC_OP_IMAGE, mode, 0);
        for (uint32_t first = 0; first < count; first++) {
            float lanes[TRC_WIDTH];
            for (uint32_t l = 0; l < TRC_WIDTH; l++)
                lanes[l] = widths[(first + l) % count] / 128.0f;
            regs.r[0] = regs.r[1] = vf_set(.3f);
            regs.r[2] = vf_load(lanes);
            scene.surface.footprint = vf_set(1.0f);
            trc_program_run(&p.material, &scene.surface, &regs);
            for (uint32_t l = 0; l < TRC_WIDTH; l++)
                assert_true(fabsf(vf_get(regs.r[OUT], (int)l) - expected[(first + l) % count]) <
                            1e-6f);
        }
    }
    trc_image_release(image);
}

static void check_projection(uint32_t mode, float x, float y, float z, float u, float v) {
    static struct trc_registers regs;
    struct single p;
    single_init(&p, TRC_OP_PROJECT, mode, 0);
    regs.r[0] = vf_set(x);
    regs.r[1] = vf_set(y);
    regs.r[2] = vf_set(z);
    trc_program_run(&p.material, NULL, &regs);
    if (!is_near(vf_get(regs.r[OUT], 0), u, 1e-6f) ||
        !is_near(vf_get(regs.r[OUT + 1], 0), v, 1e-6f)) {
        fail_msg("projection %u of (%g, %g, %g): (%.9g, %.9g), not (%.9g, %.9g)", mode, x, y, z,
                 vf_get(regs.r[OUT], 0), vf_get(regs.r[OUT + 1], 0), u, v);
    }
}

static void test_projections(void **state) {
    (void)state;
    check_projection(TRC_PROJECT_EQUIRECTANGULAR, 2, 0, 0, .5f, .5f);
    check_projection(TRC_PROJECT_EQUIRECTANGULAR, 0, 3, 0, .25f, .5f);
    check_projection(TRC_PROJECT_EQUIRECTANGULAR, 0, -1, 0, .75f, .5f);
    check_projection(TRC_PROJECT_EQUIRECTANGULAR, 0, 0, 1, .5f, 1);
    check_projection(TRC_PROJECT_EQUIRECTANGULAR, 0, 0, 0, 0, 0);
    check_projection(TRC_PROJECT_MIRROR_BALL, 0, -1, 0, .5f, .5f);
    check_projection(TRC_PROJECT_MIRROR_BALL, 1, 0, 0, .5f + .35355339f, .5f);
    check_projection(TRC_PROJECT_SPHERE, 1, .5f, .5f, .25f, .5f);
    check_projection(TRC_PROJECT_SPHERE, .5f, .5f, 1, 0, 1);
    check_projection(TRC_PROJECT_TUBE, .5f, 1, .75f, .5f, .75f);
    check_projection(TRC_PROJECT_TUBE, .5f, .5f, .75f, 0, 0);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_filters),          cmocka_unit_test(test_wild_coordinates),
        cmocka_unit_test(test_colors_of_images), cmocka_unit_test(test_levels),
        cmocka_unit_test(test_projections),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
