/* The importance map of a world that is not constant. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "kernels/kernels.h"
#include "shading/lights.h"

#define PI 3.14159265358979f

/* Directions per side of a cell: bright spots smaller than a cell are seen by one of them. */
#define SUBSAMPLES 2
/* Directions on the sun's disc whose mean stands for it: rings of as many. */
#define SUN_RINGS 4
#define SUN_TURNS 8
/* Share of the light samples that the sun gets at most: the sky around it lights shadows alone. */
#define MOST_SUN_SHARE 0.8f

/* Share of the mean that every cell gets: what the samples missed must not be impossible. */
#define LEAST_SHARE 0.05f

/* Same mapping as kernels/light_world.c: u by azimuth from +X, v by angle from +Z. */
static void cell_direction(float u, float v, float d[3]) {
    const float phi = 2.0f * PI * u, theta = PI * v;
    d[0] = sinf(theta) * cosf(phi);
    d[1] = sinf(theta) * sinf(phi);
    d[2] = cosf(theta);
}

static bool is_on_sun(const struct trc_world_sun *sun, const float d[3]) {
    float square = 0.0f;
    for (int i = 0; i < 3; i++)
        square += (d[i] - sun->direction[i]) * (d[i] - sun->direction[i]);
    return square < sun->square_chord;
}

/* Black where the sun is. */
static void leave_out_sun(const struct trc_world_sun *sun, const float *directions, float *radiance,
                          uint32_t count) {
    for (uint32_t i = 0; i < count; i++)
        if (is_on_sun(sun, directions + 3 * (size_t)i))
            memset(radiance + 3 * (size_t)i, 0, 3 * sizeof *radiance);
}

static void set_sun(struct trc_world_sun *sun, const trc_world_desc *world) {
    if (!world || !(world->sun_angle > 0.0f))
        return;
    const float *d = world->sun_direction;
    const float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int i = 0; i < 3; i++)
        sun->direction[i] = d[i] / length;
    const float radius = 0.5f * world->sun_angle, half_chord = sinf(0.5f * radius);
    sun->sine = sinf(radius);
    sun->tangent = tanf(radius);
    sun->square_chord = 4.0f * half_chord * half_chord;
}

/* Gives the sun its share of the samples by its part of the world's light, and adds its light to
 * the average. */
static void weigh_sun(const struct trc_snapshot *s, struct trc_world_map *map) {
    struct trc_world_sun *sun = &map->sun;
    float directions[3 * SUN_RINGS * SUN_TURNS], radiance[3 * SUN_RINGS * SUN_TURNS];
    const float *d = sun->direction;
    /* Any two axes across. */
    const bool is_steep = fabsf(d[2]) > 0.7f;
    const float length = is_steep ? hypotf(d[1], d[2]) : hypotf(d[0], d[1]);
    const float a[3] = {is_steep ? 0.0f : d[1] / length, (is_steep ? d[2] : -d[0]) / length,
                        is_steep ? -d[1] / length : 0.0f};
    const float b[3] = {d[1] * a[2] - d[2] * a[1], d[2] * a[0] - d[0] * a[2],
                        d[0] * a[1] - d[1] * a[0]};
    for (int k = 0; k < SUN_RINGS * SUN_TURNS; k++) {
        const float r = sun->tangent * sqrtf(((float)(k / SUN_TURNS) + 0.5f) / SUN_RINGS);
        const float phi = 2.0f * PI * (float)(k % SUN_TURNS) / SUN_TURNS;
        for (int i = 0; i < 3; i++)
            directions[3 * k + i] = d[i] + r * (cosf(phi) * a[i] + sinf(phi) * b[i]);
    }
    trc_kernels_current()->world_evaluate(s, directions, radiance, SUN_RINGS * SUN_TURNS);
    /* The part of the sphere that it covers. */
    const float part = 0.25f * sun->square_chord;
    float mean[3] = {0};
    for (int k = 0; k < 3 * SUN_RINGS * SUN_TURNS; k++)
        mean[k % 3] += fmaxf(radiance[k], 0.0f) * (part / (SUN_RINGS * SUN_TURNS));
    const float light = trc_luminance(mean), sky = trc_luminance(map->average);
    if (!(light > 0.0f && light < 1e30f))
        return;
    sun->share = fminf(light / (light + sky), MOST_SUN_SHARE);
    for (int i = 0; i < 3; i++)
        map->average[i] += mean[i];
}

/* Brightness of each cell of a row, the largest of its samples leaning on their mean, times sin
 * theta. */
static void measure_row(const struct trc_snapshot *s, struct trc_world_map *map, uint32_t row,
                        float *directions, float *radiance, double total[4]) {
    const uint32_t per_cell = SUBSAMPLES * SUBSAMPLES;
    for (uint32_t x = 0; x < map->width; x++)
        for (uint32_t k = 0; k < per_cell; k++) {
            const float du = ((float)(k % SUBSAMPLES) + 0.5f) / SUBSAMPLES;
            const float dv = ((float)(k / SUBSAMPLES) + 0.5f) / SUBSAMPLES;
            cell_direction(((float)x + du) / (float)map->width,
                           ((float)row + dv) / (float)map->height,
                           directions + 3 * ((size_t)x * per_cell + k));
        }
    trc_kernels_current()->world_evaluate(s, directions, radiance, map->width * per_cell);
    if (map->sun.square_chord > 0.0f)
        leave_out_sun(&map->sun, directions, radiance, map->width * per_cell);
    const float weight = sinf(PI * ((float)row + 0.5f) / (float)map->height);
    for (uint32_t x = 0; x < map->width; x++) {
        float mean = 0.0f;
        for (uint32_t k = 0; k < per_cell; k++) {
            const float *c = radiance + 3 * ((size_t)x * per_cell + k);
            const float light = trc_luminance(c);
            mean += light > 0.0f && light < 1e30f ? light / (float)per_cell : 0.0f;
            for (int i = 0; i < 3; i++)
                total[i] += c[i] > 0.0f && c[i] < 1e30f ? (double)(c[i] * weight) : 0.0;
        }
        total[3] += (double)per_cell * (double)weight;
        map->density[(size_t)row * map->width + x] = mean * weight;
    }
}

/* Running sums, each row's from 0 to 1; values become multiples of the mean. */
static void accumulate(struct trc_world_map *map) {
    const uint32_t width = map->width, height = map->height;
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)width * height; i++)
        sum += (double)map->density[i];
    const double mean = sum / ((double)width * height);
    double down = 0.0;
    for (uint32_t y = 0; y < height; y++) {
        float *cell = map->density + (size_t)y * width, *row = map->rows + (size_t)y * (width + 1);
        const double least = LEAST_SHARE * sin(3.14159265358979 * (y + 0.5) / height);
        double along = 0.0;
        for (uint32_t x = 0; x < width; x++) {
            cell[x] = (float)((mean > 0.0 ? (double)cell[x] / mean : 0.0) + least);
            row[x] = (float)along;
            along += (double)cell[x];
        }
        for (uint32_t x = 1; x < width; x++)
            row[x] = (float)((double)row[x] / along);
        row[width] = 1.0f;
        map->marginal[y] = (float)down;
        down += along / width;
    }
    for (uint32_t y = 1; y < height; y++)
        map->marginal[y] = (float)((double)map->marginal[y] / down);
    map->marginal[height] = 1.0f;
    const float scale = (float)(height / down);
    for (size_t i = 0; i < (size_t)width * height; i++)
        map->density[i] *= scale;
}

trc_status trc_world_map_create(const struct trc_snapshot *snapshot, uint32_t width,
                                const trc_world_desc *world, struct trc_world_map **out) {
    const uint32_t height = width / 2;
    struct trc_world_map *map = trc_alloc_zeroed(1, sizeof *map);
    const size_t samples = (size_t)width * SUBSAMPLES * SUBSAMPLES;
    float *directions = trc_alloc(samples, 3 * sizeof(float));
    float *radiance = trc_alloc(samples, 3 * sizeof(float));
    if (map) {
        atomic_init(&map->refs, 1);
        map->width = width;
        map->height = height;
        set_sun(&map->sun, world);
        map->rows = trc_alloc((size_t)(width + 1) * height, sizeof(float));
        map->marginal = trc_alloc((size_t)height + 1, sizeof(float));
        map->density = trc_alloc((size_t)width * height, sizeof(float));
    }
    const bool has_all =
        map && directions && radiance && map->rows && map->marginal && map->density;
    if (has_all) {
        double total[4] = {0};
        for (uint32_t y = 0; y < height; y++)
            measure_row(snapshot, map, y, directions, radiance, total);
        for (int i = 0; i < 3; i++)
            map->average[i] = (float)(total[i] / total[3]);
        if (map->sun.square_chord > 0.0f)
            weigh_sun(snapshot, map);
        accumulate(map);
        *out = map;
    }
    trc_free(directions);
    trc_free(radiance);
    if (has_all)
        return TRC_OK;
    if (map)
        trc_world_map_release(map);
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the importance map of the world");
}

void trc_world_map_release(struct trc_world_map *map) {
    if (!map || atomic_fetch_sub_explicit(&map->refs, 1, memory_order_acq_rel) != 1)
        return;
    trc_free(map->rows);
    trc_free(map->marginal);
    trc_free(map->density);
    trc_free(map);
}
