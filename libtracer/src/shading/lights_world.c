/* The importance map of a world that is not constant. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "core/pool.h"
#include "model/kernels.h"
#include "shading/lights.h"
#include "shading/vectors.h"

#define PI 3.14159265358979f

/* Directions per side of a cell: bright spots smaller than a cell are seen by one of them. */
#define SUBSAMPLES 2
/* Directions on the sun's disc whose mean stands for it: rings of as many. */
#define SUN_RINGS 4
#define SUN_TURNS 8
/* Share of the light samples that the sun gets at most: the sky around it lights shadows alone. */
#define MAX_SUN_SHARE 0.8f

/* Share of the mean that every cell gets: what the samples missed must not be impossible. */
#define MIN_SHARE 0.05f

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
        const int ring = k / SUN_TURNS, turn = k % SUN_TURNS;
        const float r = sun->tangent * sqrtf(((float)ring + 0.5f) / SUN_RINGS);
        const float phi = 2.0f * PI * (float)turn / SUN_TURNS;
        for (int i = 0; i < 3; i++)
            directions[3 * k + i] = d[i] + r * (cosf(phi) * a[i] + sinf(phi) * b[i]);
    }
    trc_kernels_current()->world_evaluate(s, directions, radiance, SUN_RINGS * SUN_TURNS);
    /* The part of the sphere that it covers. */
    const float part = 0.25f * sun->square_chord;
    float mean[3] = {0};
    for (int k = 0; k < 3 * SUN_RINGS * SUN_TURNS; k++)
        mean[k % 3] += fabsf(radiance[k]) * (part / (SUN_RINGS * SUN_TURNS));
    const float light = trc_luminance(mean), sky = trc_luminance(map->average);
    if (!(light > 0.0f && light < 1e30f))
        return;
    sun->share = fminf(light / (light + sky), MAX_SUN_SHARE);
    for (int i = 0; i < 3; i++)
        map->average[i] += mean[i];
}

/* What is measured, row by row on all threads. */
struct measuring {
    const struct trc_light_options *options;
    const struct trc_snapshot *snapshot;
    struct trc_world_map *map;
    float *turns;      /* cos and sin of the azimuth of every column of samples */
    float *samples;    /* per thread: the directions of a row's samples, and their radiance */
    double (*sums)[3]; /* per row: radiance times the sine of its samples */
};

#define SAMPLES_PER_CELL (SUBSAMPLES * SUBSAMPLES)

/* Same mapping as kernels/light/world_place.h: u by azimuth from +X, v by angle from +Z. */
static void set_directions(const struct measuring *m, uint32_t row, float *directions) {
    const uint32_t columns = m->map->width * SUBSAMPLES;
    for (uint32_t k = 0; k < SUBSAMPLES; k++) {
        const float v = ((float)row + ((float)k + 0.5f) / SUBSAMPLES) / (float)m->map->height;
        const float sin_theta = sinf(PI * v), cos_theta = cosf(PI * v);
        for (uint32_t x = 0; x < columns; x++, directions += 3) {
            directions[0] = sin_theta * m->turns[2 * x];
            directions[1] = sin_theta * m->turns[2 * x + 1];
            directions[2] = cos_theta;
        }
    }
}

static float sample_weight(const struct trc_world_map *map, uint32_t row) {
    return sinf(PI * ((float)row + 0.5f) / (float)map->height);
}

/* Mean brightness of each cell of a row, times sin theta. */
static void measure_row(void *context, uint32_t row, uint32_t worker) {
    const struct measuring *m = context;
    struct trc_world_map *map = m->map;
    if (trc_lights_are_cancelled(m->options))
        return;
    const uint32_t count = map->width * SAMPLES_PER_CELL, columns = map->width * SUBSAMPLES;
    float *directions = m->samples + 6 * (size_t)count * worker;
    float *radiance = directions + 3 * (size_t)count;
    set_directions(m, row, directions);
    trc_kernels_current()->world_evaluate(m->snapshot, directions, radiance, count);
    if (map->sun.square_chord > 0.0f)
        leave_out_sun(&map->sun, directions, radiance, count);
    const float weight = sample_weight(map, row);
    for (uint32_t x = 0; x < map->width; x++) {
        float mean = 0.0f;
        for (uint32_t k = 0; k < SAMPLES_PER_CELL; k++) {
            const uint32_t at = k / SUBSAMPLES * columns + x * SUBSAMPLES + k % SUBSAMPLES;
            const float *c = radiance + 3 * (size_t)at;
            const float light = trc_brightness(c);
            mean += light > 0.0f && light < 1e30f ? light / SAMPLES_PER_CELL : 0.0f;
            for (int i = 0; i < 3; i++)
                m->sums[row][i] += fabsf(c[i]) < 1e30f ? (double)(fabsf(c[i]) * weight) : 0.0;
        }
        map->density[(size_t)row * map->width + x] = mean * weight;
    }
}

static void measure(struct measuring *m) {
    struct trc_world_map *map = m->map;
    const uint32_t columns = map->width * SUBSAMPLES;
    for (uint32_t x = 0; x < columns; x++) {
        const float phi = 2.0f * PI * ((float)x + 0.5f) / (float)columns;
        m->turns[2 * x] = cosf(phi);
        m->turns[2 * x + 1] = sinf(phi);
    }
    trc_pool_run(m->options->pool, map->height, measure_row, m);
    double total[3] = {0}, weight = 0.0;
    for (uint32_t y = 0; y < map->height; y++) {
        for (int i = 0; i < 3; i++)
            total[i] += m->sums[y][i];
        weight += (double)(map->width * SAMPLES_PER_CELL) * (double)sample_weight(map, y);
    }
    for (int i = 0; i < 3; i++)
        map->average[i] = (float)(total[i] / weight);
}

/* How far cells of an even world may be apart: rounding. */
#define EVEN_TOLERANCE 1e-4f

static bool is_even(const struct trc_world_map *map) {
    const float mean = trc_luminance(map->average);
    bool even = map->sun.square_chord == 0.0f;
    for (uint32_t y = 0; y < map->height && even; y++) {
        const float want = mean * sample_weight(map, y);
        for (uint32_t x = 0; x < map->width && even; x++)
            even = fabsf(map->density[(size_t)y * map->width + x] - want) <= EVEN_TOLERANCE * want;
    }
    return even;
}

/* Values become multiples of the mean, none of them 0. */
static void normalize(struct trc_world_map *map) {
    const uint32_t width = map->width, height = map->height;
    const size_t count = (size_t)width * height;
    double sum = 0.0, total = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += (double)map->density[i];
    const double scale = sum > 0.0 ? (double)count / sum : 0.0;
    for (uint32_t y = 0; y < height; y++) {
        const double minimum = MIN_SHARE * (double)sample_weight(map, y);
        for (uint32_t x = 0; x < width; x++) {
            float *cell = map->density + (size_t)y * width + x;
            *cell = (float)((double)*cell * scale + minimum);
            total += (double)*cell;
        }
    }
    for (size_t i = 0; i < count; i++)
        map->density[i] *= (float)((double)count / total);
}

static struct trc_world_map *create_map(uint32_t width, const trc_world_desc *world) {
    struct trc_world_map *map = trc_alloc_zeroed(1, sizeof *map);
    if (!map)
        return NULL;
    atomic_init(&map->refs, 1);
    map->width = width;
    map->height = width / 2;
    set_sun(&map->sun, world);
    map->facings = trc_alloc(TRC_MAP_FACINGS, sizeof *map->facings);
    map->down = trc_alloc((map->height / TRC_MAP_ROWS + 1) * (size_t)TRC_MAP_BLOCKS, sizeof(float));
    map->along = trc_alloc((size_t)(width + TRC_MAP_COLUMNS) * map->height, sizeof(float));
    map->density = trc_alloc((size_t)width * map->height, sizeof(float));
    if (map->facings && map->down && map->along && map->density)
        return map;
    trc_world_map_release(map);
    return NULL;
}

trc_status trc_world_map_create(const struct trc_snapshot *snapshot, uint32_t wanted_width,
                                const struct trc_light_options *options,
                                struct trc_world_map **out) {
    const uint32_t width = (wanted_width + TRC_MAP_COLUMNS - 1) / TRC_MAP_COLUMNS * TRC_MAP_COLUMNS;
    const size_t samples = (size_t)width * SAMPLES_PER_CELL * trc_pool_thread_count(options->pool);
    struct trc_world_map *map = create_map(width, options->world);
    struct measuring m = {.options = options,
                          .snapshot = snapshot,
                          .map = map,
                          .turns = trc_alloc((size_t)width * SUBSAMPLES, 2 * sizeof(float)),
                          .samples = trc_alloc(samples, 6 * sizeof(float)),
                          .sums = trc_alloc_zeroed(width / 2, sizeof *m.sums)};
    trc_status status = TRC_OK;
    if (!map || !m.turns || !m.samples || !m.sums)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the importance map of the world");
    if (status == TRC_OK) {
        measure(&m);
        if (trc_lights_are_cancelled(options))
            status = trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
    }
    trc_free(m.turns);
    trc_free(m.samples);
    trc_free(m.sums);
    if (status != TRC_OK) {
        trc_world_map_release(map);
        return status;
    }
    map->is_even = is_even(map);
    if (map->sun.square_chord > 0.0f)
        weigh_sun(snapshot, map);
    normalize(map);
    trc_world_map_set_chances(map);
    *out = map;
    return TRC_OK;
}

void trc_world_map_release(struct trc_world_map *map) {
    if (!map || atomic_fetch_sub_explicit(&map->refs, 1, memory_order_acq_rel) != 1)
        return;
    trc_free(map->facings);
    trc_free(map->down);
    trc_free(map->along);
    trc_free(map->density);
    trc_free(map);
}
