/* Sample sequences: stratification, independence of lanes and of dimensions, bounds of the error
 * they give. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "kernels/simd/wide_math.h"
#include "kernels/tile/sampler.h"
#include "model/sobol.h"
#include "tracer/tracer.h"
#include "wide_test.h"

static uint32_t *table;

static int make_table(void **state) {
    (void)state;
    return trc_sobol_table_create(&table) == TRC_OK ? 0 : -1;
}
static int drop_table(void **state) {
    (void)state;
    trc_free(table);
    return 0;
}

static struct trc_sampler sampler(uint32_t kind, uint32_t count) {
    return (struct trc_sampler){kind, 17, count, table};
}
static const uint32_t kinds[] = {TRC_SAMPLER_SOBOL, TRC_SAMPLER_SUDOKU, TRC_SAMPLER_JITTER,
                                 TRC_SAMPLER_INDEPENDENT, TRC_SAMPLER_BLUE_NOISE};
static const char *const names[] = {"Sobol", "Sudoku", "jitter", "independent", "blue noise"};

static uint32_t pixel_at(uint32_t x, uint32_t y) { return x | y << 16; }

/* Numbers of count samples of a pixel in one dimension. */
static void numbers(const struct trc_sampler *s, uint32_t pixel, uint32_t dimension, uint32_t count,
                    float *out) {
    for (uint32_t i = 0; i < count; i += TRC_WIDTH) {
        const vfloat u = trc_sample(s, vu_set(pixel), (vuint)vi_lane() + vu_set(i), dimension);
        for (uint32_t k = 0; k < TRC_WIDTH && i + k < count; k++) {
            out[i + k] = vf_get(u, (int)k);
            assert_true(out[i + k] >= 0.0f && out[i + k] < 1.0f);
        }
    }
}

/* Points of the first 2^a x 2^b boxes: how many are in each must be count / boxes. */
static bool fills_boxes(const float *x, const float *y, uint32_t count, uint32_t a, uint32_t b) {
    static uint32_t boxes[1 << 16];
    memset(boxes, 0, sizeof boxes[0] << (a + b));
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t column = (uint32_t)(x[i] * (float)(1u << a));
        const uint32_t row = (uint32_t)(y[i] * (float)(1u << b));
        boxes[row << a | column]++;
    }
    for (uint32_t i = 0; i < 1u << (a + b); i++)
        if (boxes[i] != count >> (a + b))
            return false;
    return true;
}

static void sobol_is_stratified(void **state) {
    (void)state;
    const struct trc_sampler s = sampler(TRC_SAMPLER_SOBOL, 256);
    static float x[256], y[256];
    for (uint32_t d = 0; d < 40; d++) {
        numbers(&s, pixel_at(3, 5), d, 256, x);
        for (uint32_t k = 0; k <= 8; k++)
            for (uint32_t first = 0; first < 256; first += 1u << k)
                assert_true(fills_boxes(x + first, x, 1u << k, k, 0));
    }
    /* Pairs that are used together are (0, 8, 2)-nets: every box shape is filled; also in deeper
     * hits. */
    uint32_t pairs[12] = {TRC_DIM_FILTER_X, TRC_DIM_LENS_X};
    for (uint32_t hit = 0; hit < 5; hit++) {
        pairs[2 + 2 * hit] = TRC_DIM_BOUNCE + hit * TRC_DIMS_PER_BOUNCE + TRC_DIM_LIGHT_X;
        pairs[3 + 2 * hit] = TRC_DIM_BOUNCE + hit * TRC_DIMS_PER_BOUNCE + TRC_DIM_BSDF_X;
    }
    for (size_t i = 0; i < 12; i++) {
        numbers(&s, pixel_at(1000, 77), pairs[i], 256, x);
        numbers(&s, pixel_at(1000, 77), pairs[i] + 1, 256, y);
        for (uint32_t a = 0; a <= 8; a++)
            assert_true(fills_boxes(x, y, 256, a, 8 - a));
    }
}

static void split_samples_are_stratified(void **state) {
    (void)state;
    /* 16 samples of 8 light samples: 128 places, all boxes filled once. */
    for (size_t k = 0; k < 2; k++) {
        const struct trc_sampler s = sampler(TRC_SAMPLER_SOBOL, 16);
        const uint32_t d = TRC_DIM_BOUNCE + TRC_DIM_LIGHT_X + (k ? 4 * TRC_DIMS_PER_BOUNCE : 0);
        float x[128], y[128];
        for (uint32_t i = 0; i < 16; i++)
            for (uint32_t l = 0; l < 8; l++) {
                const vuint pixel = vu_set(pixel_at(8, 2)), index = vu_set(i);
                vfloat u[2];
                trc_samples(&s, pixel, index, d, 2, l, 8, u);
                x[8 * i + l] = vf_get(u[0], 0);
                y[8 * i + l] = vf_get(u[1], 0);
            }
        for (uint32_t a = 0; a <= 7; a++)
            assert_true(fills_boxes(x, y, 128, a, 7 - a));
        for (uint32_t i = 0; i < 16; i++)
            for (uint32_t a = 0; a <= 3; a++)
                assert_true(fills_boxes(x + 8 * i, y + 8 * i, 8, a, 3 - a));
    }
}

static void every_kind_has_its_strata(void **state) {
    (void)state;
    static float x[1024];
    for (size_t k = 0; k < 5; k++) {
        if (kinds[k] == TRC_SAMPLER_INDEPENDENT)
            continue;
        for (uint32_t count = 1; count <= 1024; count *= 4) {
            const struct trc_sampler s = sampler(kinds[k], count);
            for (uint32_t d = 0; d < 30; d++) {
                numbers(&s, pixel_at(7, 11), d, count, x);
                uint32_t bits = 0;
                while (1u << bits < count)
                    bits++;
                /* Pairs of the jittered kind share their cells between two dimensions. */
                if (kinds[k] == TRC_SAMPLER_JITTER)
                    bits /= 2;
                assert_true(fills_boxes(x, x, count, bits, 0));
            }
        }
    }
}

static void jitter_fills_its_grid(void **state) {
    (void)state;
    const struct trc_sampler s = sampler(TRC_SAMPLER_JITTER, 64);
    float x[64], y[64];
    const uint32_t first[] = {TRC_DIM_FILTER_X, TRC_DIM_LENS_X, TRC_DIM_BOUNCE + TRC_DIM_LIGHT_X,
                              TRC_DIM_BOUNCE + 3 * TRC_DIMS_PER_BOUNCE + TRC_DIM_BSDF_X};
    for (size_t i = 0; i < 4; i++) {
        numbers(&s, pixel_at(1, 2), first[i], 64, x);
        numbers(&s, pixel_at(1, 2), first[i] + 1, 64, y);
        assert_true(fills_boxes(x, y, 64, 3, 3));
    }
}

/* In a tile of 8 x 8, for every sample: 64 cells once each; every row, column and block of 4 x 2
 * has the 8 coarse cells once; the stratum is the same for all. */
static void sudoku_covers_tiles(void **state) {
    (void)state;
    const uint32_t count = 16;
    const struct trc_sampler s = sampler(TRC_SAMPLER_SUDOKU, count);
    for (uint32_t d = 0; d < 20; d++)
        for (uint32_t i = 0; i < count; i++) {
            uint32_t cell[8][8], stratum = 0;
            uint64_t all = 0;
            for (uint32_t y = 0; y < 8; y++)
                for (uint32_t x = 0; x < 8; x++) {
                    const vuint pixel = vu_set(pixel_at(16 + x, 24 + y));
                    const float u = vf_get(trc_sample(&s, pixel, vu_set(i), d), 0);
                    const uint32_t fine = (uint32_t)(u * (float)count * 64.0f);
                    if (x + y == 0)
                        stratum = fine / 64;
                    assert_int_equal((int)(fine / 64), (int)stratum);
                    cell[y][x] = fine % 64 / 8;
                    all |= 1ull << fine % 64;
                }
            assert_true(all == ~0ull);
            for (uint32_t k = 0; k < 8; k++) {
                uint32_t row = 0, column = 0, block = 0;
                for (uint32_t j = 0; j < 8; j++) {
                    row |= 1u << cell[k][j];
                    column |= 1u << cell[j][k];
                    block |= 1u << cell[2 * (k / 2) + j / 4][4 * (k % 2) + j % 4];
                }
                assert_true(row == 255 && column == 255 && block == 255);
            }
        }
}

/* A number is a function of pixel, index and dimension: whatever the other lanes are, and however
 * many dimensions are asked for. Sample numbers are equal, consecutive or neither. */
static void lanes_do_not_matter(void **state) {
    (void)state;
    struct rng random = rng_seed(2);
    for (size_t k = 0; k < 5; k++) {
        const struct trc_sampler s = sampler(kinds[k], 100);
        for (int n = 0; n < 2000; n++) {
            uint32_t pixel[TRC_WIDTH], index[TRC_WIDTH];
            const uint32_t first = rng_bits(&random) % (n % 2 ? 2100 : 3000000);
            for (uint32_t i = 0; i < TRC_WIDTH; i++) {
                pixel[i] = pixel_at(rng_bits(&random) % 500, rng_bits(&random) % 500);
                index[i] = n % 4 == 0   ? first
                           : n % 4 == 1 ? first + i
                                        : rng_bits(&random) % (n % 4 == 2 ? 100 : 3000000);
            }
            const uint32_t d = rng_bits(&random) % 40, dims = 1 + rng_bits(&random) % 3;
            vfloat u[3];
            trc_samples(&s, vu_load(pixel), vu_load(index), d, dims, 0, 1, u);
            for (uint32_t j = 0; j < dims; j++)
                for (int i = 0; i < TRC_WIDTH; i++) {
                    const vfloat one = trc_sample(&s, vu_set(pixel[i]), vu_set(index[i]), d + j);
                    assert_true(vf_get(u[j], i) == vf_get(one, 0));
                }
        }
    }
}

/* Dimensions of ten hits, and samples of as many pixels as are looked at: blocks, tiles and keys of
 * their own. */
#define DEEP_DIMENSIONS (TRC_DIM_BOUNCE + 10 * TRC_DIMS_PER_BOUNCE)
enum { DEEP_SAMPLES = 64, DEEP_PIXELS = 64, DEEP_CELLS = 4 };

static float deep[DEEP_DIMENSIONS][DEEP_PIXELS][DEEP_SAMPLES];

static void fill_deep(uint32_t kind) {
    const struct trc_sampler s = sampler(kind, DEEP_SAMPLES);
    struct rng random = rng_seed(11);
    for (uint32_t p = 0; p < DEEP_PIXELS; p++) {
        const uint32_t x = rng_below(&random, 1 << 14), y = rng_below(&random, 1 << 14);
        for (uint32_t d = 0; d < DEEP_DIMENSIONS; d++)
            numbers(&s, pixel_at(x, y), d, DEEP_SAMPLES, deep[d][p]);
    }
}

/* Chi-square of the points of one pixel in two dimensions, in cells of 4 x 4. */
static double cells_chi2(const float *x, const float *y) {
    int cells[DEEP_CELLS * DEEP_CELLS] = {0};
    const double expected = (double)DEEP_SAMPLES / (DEEP_CELLS * DEEP_CELLS);
    double sum = 0.0;
    for (int i = 0; i < DEEP_SAMPLES; i++)
        cells[(int)(x[i] * DEEP_CELLS) + DEEP_CELLS * (int)(y[i] * DEEP_CELLS)]++;
    for (int k = 0; k < DEEP_CELLS * DEEP_CELLS; k++)
        sum += (cells[k] - expected) * (cells[k] - expected) / expected;
    return sum;
}

/* The joint sequence, or the deeper hits that share a shuffled one. */
static uint32_t padding_group(uint32_t dimension) {
    return dimension < TRC_JOINT_DIMENSIONS
               ? 0
               : (dimension - TRC_DIM_BOUNCE) / (TRC_JOINT_DIMENSIONS - TRC_DIM_BOUNCE);
}

/* What independent points would have: means over the pixels, of chi-square by cells and of the
 * correlation, and deviations of the first. */
struct pair_bounds {
    double chi2, chi2_deviation;
};

/* Numbers on their own have 15 degrees of freedom, and those that are stratified in each dimension
 * 9, times n / (n - 1). Groups go through Sobol's points in orders that are nested in each other's
 * blocks: digits of the first place then agree over blocks of 2 points and those of the second over
 * 4, the others not at all, so that of nine products of digits one has four times the variance of
 * random points, four have twice that, and four none. */
static struct pair_bounds pair_bounds(uint32_t kind) {
    const double stratified = 9.0 * DEEP_SAMPLES / (DEEP_SAMPLES - 1.0);
    if (kind == TRC_SAMPLER_INDEPENDENT)
        return (struct pair_bounds){15.0, sqrt(2.0 * 15.0)};
    if (kind == TRC_SAMPLER_JITTER)
        return (struct pair_bounds){stratified, sqrt(2.0 * stratified)};
    return (struct pair_bounds){4.0 + 4.0 * 2.0, sqrt(2.0 * (4.0 * 4.0 + 4.0 * 2.0 * 2.0))};
}

/* Chi-square by cells and correlation of two dimensions, over all pixels. */
static void measure_pair(uint32_t a, uint32_t b, double *chi2, double *r) {
    *chi2 = *r = 0.0;
    for (uint32_t p = 0; p < DEEP_PIXELS; p++) {
        *chi2 += cells_chi2(deep[a][p], deep[b][p]) / DEEP_PIXELS;
        for (uint32_t i = 0; i < DEEP_SAMPLES; i++)
            *r += 12.0 * ((double)deep[a][p][i] - 0.5) * ((double)deep[b][p][i] - 0.5);
    }
    *r /= (double)DEEP_SAMPLES * DEEP_PIXELS;
}

/* Any two dimensions, of one padding group or of two: in a pixel they are spread as evenly together
 * as independent numbers would be, and over all pixels they do not go together. If two groups took
 * the points in one order, each pixel's would lie in a few cells: a chi-square of 192. Bounds are
 * of six deviations, as there are 2,080 pairs; a correlation's is 1 / sqrt(n P), and 1.14 times
 * that with nested orders. */
static void deep_dimensions_are_independent(void **state) {
    (void)state;
    for (size_t k = 0; k < 5; k++) {
        const struct pair_bounds bounds = pair_bounds(kinds[k]);
        const double allowed_chi2 =
            bounds.chi2 + 6.0 * bounds.chi2_deviation / sqrt((double)DEEP_PIXELS);
        const double allowed_r = 6.0 * 1.14 / sqrt((double)DEEP_SAMPLES * DEEP_PIXELS);
        const bool is_sobol = kinds[k] != TRC_SAMPLER_JITTER && kinds[k] != TRC_SAMPLER_INDEPENDENT;
        double worst_chi2 = 0.0, worst_r = 0.0;
        int failures = 0;
        fill_deep(kinds[k]);
        for (uint32_t a = 0; a < DEEP_DIMENSIONS; a++)
            for (uint32_t b = a + 1; b < DEEP_DIMENSIONS; b++) {
                double chi2, r;
                measure_pair(a, b, &chi2, &r);
                worst_r = fmax(worst_r, fabs(r));
                bool is_even = fabs(r) <= allowed_r;
                if (is_sobol && padding_group(a) == padding_group(b)) {
                    /* 64 points of any two dimensions fill quarters evenly, and half of all cells
                     * at least. */
                    for (uint32_t bits = 0; bits <= 2; bits++)
                        is_even = is_even &&
                                  fills_boxes(deep[a][0], deep[b][0], DEEP_SAMPLES, bits, 2 - bits);
                    is_even = is_even && chi2 <= (double)DEEP_SAMPLES;
                } else {
                    is_even = is_even && chi2 <= allowed_chi2;
                    worst_chi2 = fmax(worst_chi2, chi2);
                }
                if (!is_even && failures++ < 8)
                    printf("  %s, dimensions %u and %u: chi-square %.1f, correlation %.3f\n",
                           names[k], a, b, chi2, r);
            }
        printf("  %-12s chi-square at most %.1f of %.1f, correlation %.3f of %.3f\n", names[k],
               worst_chi2, allowed_chi2, worst_r, allowed_r);
        assert_int_equal(failures, 0);
    }
}

/* The same where pixels have one sample each, so that no order tells groups apart: over pixels, 15
 * degrees of freedom. */
static void single_samples_are_independent(void **state) {
    (void)state;
    enum { PIXELS = DEEP_PIXELS * DEEP_SAMPLES };
    for (size_t k = 0; k < 5; k++) {
        const struct trc_sampler s = sampler(kinds[k], 1);
        struct rng random = rng_seed(12);
        for (uint32_t i = 0; i < PIXELS; i += TRC_WIDTH) {
            uint32_t pixel[TRC_WIDTH];
            for (int n = 0; n < TRC_WIDTH; n++)
                pixel[n] = pixel_at(rng_below(&random, 1 << 14), rng_below(&random, 1 << 14));
            for (uint32_t d = 0; d < DEEP_DIMENSIONS; d++)
                vf_store(&deep[d][0][0] + i, trc_sample(&s, vu_load(pixel), vu_set(0), d));
        }
        double worst_chi2 = 0.0, worst_r = 0.0;
        for (uint32_t a = 0; a < DEEP_DIMENSIONS; a++)
            for (uint32_t b = a + 1; b < DEEP_DIMENSIONS; b++) {
                double chi2, r;
                measure_pair(a, b, &chi2, &r);
                worst_r = fmax(worst_r, fabs(r));
                worst_chi2 = fmax(worst_chi2, chi2);
            }
        printf("  %-12s chi-square at most %.1f, correlation %.3f\n", names[k], worst_chi2,
               worst_r);
        assert_true(worst_chi2 <= 15.0 + 6.0 * sqrt(2.0 * 15.0 / DEEP_PIXELS));
        assert_true(worst_r <= 6.0 / sqrt((double)PIXELS));
    }
}

/* A long sequence fills as many boxes as it has points, through all rows of the table. */
static void long_sequences_are_stratified(void **state) {
    (void)state;
    enum { BITS = 2 * TRC_SOBOL_POINT_BITS + 1 };
    static uint64_t boxes[1 << (BITS - 6)];
    const struct trc_sampler s = sampler(TRC_SAMPLER_SOBOL, 1u << BITS);
    static const uint32_t dimensions[] = {TRC_DIM_FILTER_X, TRC_JOINT_DIMENSIONS - 1,
                                          TRC_DIM_BOUNCE + 5 * TRC_DIMS_PER_BOUNCE};
    for (size_t d = 0; d < 3; d++) {
        memset(boxes, 0, sizeof boxes);
        for (uint32_t i = 0; i < 1u << BITS; i += TRC_WIDTH) {
            const vfloat u =
                trc_sample(&s, vu_set(pixel_at(4, 4)), (vuint)vi_lane() + vu_set(i), dimensions[d]);
            for (int k = 0; k < TRC_WIDTH; k++) {
                const uint32_t box = (uint32_t)(vf_get(u, k) * (float)(1u << BITS));
                boxes[box / 64] |= 1ull << box % 64;
            }
        }
        for (size_t i = 0; i < sizeof boxes / sizeof *boxes; i++)
            assert_true(boxes[i] == ~0ull);
    }
}

/* The same on every instruction set: sums of a few numbers, as the scalar build gave them. */
static void widths_agree(void **state) {
    (void)state;
    static const uint32_t expected[5] = {0x3a8124d8u, 0x204e1b37u, 0x71e006c5u, 0x207255b9u,
                                         0x016da85eu};
    bool sums_match = true;
    for (size_t k = 0; k < 5; k++) {
        const struct trc_sampler s = sampler(kinds[k], 48);
        uint32_t sum = 0;
        for (uint32_t d = 0; d < 31; d++)
            for (uint32_t i = 0; i < 4096; i += 64)
                for (uint32_t j = 0; j < 64; j += TRC_WIDTH) {
                    const vuint lane = (vuint)vi_lane() + vu_set(i + j);
                    const vfloat u = trc_sample(&s, lane * vu_set(40503u), lane, d);
                    for (int n = 0; n < TRC_WIDTH; n++) {
                        const float f = vf_get(u, n);
                        uint32_t bits;
                        memcpy(&bits, &f, sizeof bits);
                        sum = (uint32_t)vi_get((vint)vu_hash(vu_set(sum ^ bits)), 0) + d;
                    }
                }
        printf("%-12s %08x\n", names[k], sum);
        sums_match &= sum == expected[k];
    }
    assert_true(sums_match);
}

/* Mean squared error of smooth and of broken integrands over 1024 pixels. */
static double error_of(uint32_t kind, uint32_t count, uint32_t dimensions, bool broken) {
    const struct trc_sampler s = sampler(kind, count);
    const uint32_t base = TRC_DIM_BOUNCE + TRC_DIM_LIGHT_SELECT;
    double error = 0.0;
    for (uint32_t pixel = 0; pixel < 1024; pixel += TRC_WIDTH) {
        const vuint lanes = (vuint)vi_lane() + vu_set(pixel);
        const vuint at = (lanes & vu_set(31)) | (lanes >> 5) << 16;
        vfloat sum = vf_zero();
        for (uint32_t i = 0; i < count; i++) {
            vfloat f = vf_one(), line = vf_zero();
            for (uint32_t d = 0; d < dimensions; d++) {
                const vfloat u = trc_sample(&s, at, vu_set(i), base + d);
                f = f * (vf_set(0.5f) + u);
                line = line + u;
            }
            if (broken)
                f = vf_where(vf_lt(line, vf_set(0.5f * (float)dimensions)), vf_set(2.0f));
            sum = sum + f;
        }
        for (int k = 0; k < TRC_WIDTH; k++) {
            const double off = (double)vf_get(sum, k) / count - 1.0;
            error += off * off;
        }
    }
    return error / 1024;
}
static void errors_are_small(void **state) {
    (void)state;
    for (uint32_t dimensions = 2; dimensions <= 6; dimensions += 2)
        for (int broken = 0; broken < 2; broken++) {
            const double plain = error_of(TRC_SAMPLER_INDEPENDENT, 64, dimensions, broken);
            printf("%u dimensions, %s:", dimensions, broken ? "edge" : "smooth");
            for (size_t k = 0; k < 5; k++) {
                const double gain = plain / error_of(kinds[k], 64, dimensions, broken);
                printf("  %s %.1f", names[k], gain);
                assert_true(gain > (k == 3 ? 0.8 : k == 2 ? 0.9 : broken ? 1.3 : 3.0));
            }
            printf("  times less variance than random\n");
        }
}

/* Blue noise: at one sample per pixel the error of neighbours cancels when pictures are blurred. */
static void blue_noise_is_blue(void **state) {
    (void)state;
    double blurred[2] = {0};
    for (int k = 0; k < 2; k++) {
        const struct trc_sampler s = sampler(k ? TRC_SAMPLER_BLUE_NOISE : TRC_SAMPLER_SOBOL, 1);
        static float image[128][128];
        for (uint32_t y = 0; y < 128; y++)
            for (uint32_t x = 0; x < 128; x += TRC_WIDTH) {
                const vuint at = ((vuint)vi_lane() + vu_set(x)) | vu_set(y << 16);
                vf_store(&image[y][x], trc_sample(&s, at, vu_set(0), TRC_DIM_BOUNCE + 1));
            }
        for (int y = 0; y < 128; y += 4)
            for (int x = 0; x < 128; x += 4) {
                double mean = 0;
                for (int i = 0; i < 16; i++)
                    mean += (double)image[y + i / 4][x + i % 4] / 16;
                blurred[k] += (mean - 0.5) * (mean - 0.5) / 1024;
            }
    }
    printf("variance after blurring: Sobol %.2g, blue noise %.2g\n", blurred[0], blurred[1]);
    assert_true(blurred[1] < 0.1 * blurred[0]);
}

static void table_fails_cleanly(void **state) {
    (void)state;
    uint32_t *t = NULL;
    trc_memory_fail_at(0, false);
    assert_int_equal(trc_sobol_table_create(&t), TRC_ERROR_OUT_OF_MEMORY);
    trc_memory_fail_at(-1, false);
    assert_null(t);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sobol_is_stratified),
        cmocka_unit_test(split_samples_are_stratified),
        cmocka_unit_test(every_kind_has_its_strata),
        cmocka_unit_test(jitter_fills_its_grid),
        cmocka_unit_test(sudoku_covers_tiles),
        cmocka_unit_test(lanes_do_not_matter),
        cmocka_unit_test(deep_dimensions_are_independent),
        cmocka_unit_test(single_samples_are_independent),
        cmocka_unit_test(long_sequences_are_stratified),
        cmocka_unit_test(widths_agree),
        cmocka_unit_test(errors_are_small),
        cmocka_unit_test(blue_noise_is_blue),
        cmocka_unit_test(table_fails_cleanly),
    };
    return cmocka_run_group_tests(tests, make_table, drop_table);
}
