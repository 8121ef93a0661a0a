/* Chances of the importance map of the world: of its cells in their blocks, and of the blocks as
 * normals weigh them, by light times cosine. Products of light and cosine are sampled by P.
 * Clarberg, W. Jarosz, T. Akenine-Moeller and H. W. Jensen, "Wavelet Importance Sampling" (2005),
 * over all levels of a hierarchy; here by one level, with the cosines of ranges of normals
 * beforehand. */
#include <math.h>
#include <string.h>

#include "shading/lights.h"

#define PI 3.14159265358979f

/* Running sums of positive values, count + 1 of 0 to 1; returns the sum of all. */
static double accumulate(const float *values, uint32_t count, float *sums) {
    double total = 0.0, sum = 0.0;
    for (uint32_t i = 0; i < count; i++)
        total += (double)values[i];
    const double inverse = 1.0 / total;
    for (uint32_t i = 0; i < count; i++) {
        sums[i] = (float)(sum * inverse);
        sum += (double)values[i];
    }
    sums[count] = 1.0f;
    return total;
}

/* Sums within the blocks. */
static void accumulate_blocks(struct trc_world_map *map) {
    const uint32_t across = map->width / TRC_MAP_COLUMNS, down = map->height / TRC_MAP_ROWS;
    float rows[TRC_MAP_MAX_WIDTH / 2 / TRC_MAP_ROWS];
    for (uint32_t block = 0; block < TRC_MAP_BLOCKS; block++) {
        const uint32_t column = block / TRC_MAP_ROWS, first = block % TRC_MAP_ROWS * down;
        for (uint32_t y = 0; y < down; y++) {
            const size_t part = (size_t)(first + y) * TRC_MAP_COLUMNS + column;
            rows[y] = (float)accumulate(map->density + part * across, across,
                                        map->along + part * (across + 1));
        }
        accumulate(rows, down, map->down + (size_t)block * (down + 1));
    }
}

/* Parts of a block along a side, whose light a normal weighs by their middles. */
#define BLOCK_PARTS 4
#define PART_COLUMNS (TRC_MAP_COLUMNS * BLOCK_PARTS)
#define PART_ROWS (TRC_MAP_ROWS * BLOCK_PARTS)
#define PARTS (BLOCK_PARTS * BLOCK_PARTS)

/* Blocks stand side by side, so that vectors of them are weighed at once. */
struct parts {
    float x[PARTS][TRC_MAP_BLOCKS], y[PARTS][TRC_MAP_BLOCKS], z[PARTS][TRC_MAP_BLOCKS];
    float light[PARTS][TRC_MAP_BLOCKS]; /* over that of the whole sphere */
};

/* Of part number i of count along a side; small maps leave some without. */
static uint32_t first_cell(uint32_t i, uint32_t count, uint32_t cells) {
    return (i * cells + count - 1) / count;
}

static float row_light(const struct trc_world_map *map, uint32_t y, uint32_t column) {
    const float *row = map->density + (size_t)y * map->width;
    const uint32_t end = first_cell(column + 1, PART_COLUMNS, map->width);
    float sum = 0.0f;
    for (uint32_t x = first_cell(column, PART_COLUMNS, map->width); x < end; x++)
        sum += row[x];
    return sum / ((float)map->width * (float)map->height);
}

static void set_parts(const struct trc_world_map *map, struct parts *parts) {
    for (uint32_t column = 0; column < PART_COLUMNS; column++) {
        const float phi = 2.0f * PI * ((float)column + 0.5f) / PART_COLUMNS;
        for (uint32_t row = 0; row < PART_ROWS; row++) {
            const float theta = PI * ((float)row + 0.5f) / PART_ROWS;
            const uint32_t block = column / BLOCK_PARTS * TRC_MAP_ROWS + row / BLOCK_PARTS;
            const uint32_t part = column % BLOCK_PARTS * BLOCK_PARTS + row % BLOCK_PARTS;
            parts->x[part][block] = sinf(theta) * cosf(phi);
            parts->y[part][block] = sinf(theta) * sinf(phi);
            parts->z[part][block] = cosf(theta);
            const uint32_t end = first_cell(row + 1, PART_ROWS, map->height);
            float light = 0.0f;
            for (uint32_t y = first_cell(row, PART_ROWS, map->height); y < end; y++)
                light += row_light(map, y, column);
            parts->light[part][block] = light;
        }
    }
}

/* The middle of a range of normals. */
static void facing_normal(uint32_t facing, float n[3]) {
    const uint32_t column = facing % TRC_MAP_NORMALS, row = facing / TRC_MAP_NORMALS;
    const float x = 2.0f * ((float)column + 0.5f) / TRC_MAP_NORMALS - 1.0f;
    const float y = 2.0f * ((float)row + 0.5f) / TRC_MAP_NORMALS - 1.0f;
    const float z = 1.0f - fabsf(x) - fabsf(y);
    n[0] = z < 0.0f ? copysignf(1.0f - fabsf(y), x) : x;
    n[1] = z < 0.0f ? copysignf(1.0f - fabsf(x), y) : y;
    n[2] = z;
    const float length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int i = 0; i < 3; i++)
        n[i] /= length;
}

/* Cosines below the horizon that may still be above it for other normals of the range, and other
 * directions of the part. */
#define FACING_MARGIN 0.6f
/* What light below the surface counts, so that nothing is impossible. */
#define LEAST_COSINE 0.02f

/* The cosine, rounded off where it becomes 0: the mean over the margin. */
static float soft_cosine(float cosine) {
    const float above = cosine > -FACING_MARGIN ? cosine + FACING_MARGIN : 0.0f;
    const float rounded = above * above * (0.25f / FACING_MARGIN);
    return cosine < FACING_MARGIN ? rounded : cosine;
}

/* Light of the blocks for a normal, or as it is. */
static void weigh_blocks(const struct parts *parts, const float n[3], float *light) {
    memset(light, 0, TRC_MAP_BLOCKS * sizeof *light);
    for (int i = 0; i < PARTS; i++)
        for (int block = 0; block < TRC_MAP_BLOCKS; block++) {
            const float cosine =
                n[0] * parts->x[i][block] + n[1] * parts->y[i][block] + n[2] * parts->z[i][block];
            light[block] += parts->light[i][block] * (soft_cosine(cosine) + LEAST_COSINE);
        }
}
static void add_blocks(const struct parts *parts, float *light) {
    memset(light, 0, TRC_MAP_BLOCKS * sizeof *light);
    for (int i = 0; i < PARTS; i++)
        for (int block = 0; block < TRC_MAP_BLOCKS; block++)
            light[block] += parts->light[i][block];
}

/* By what the blocks bring and by their light as it is. */
static void set_facing(struct trc_map_facing *facing, const float *weighed, const float *light) {
    float columns[TRC_MAP_COLUMNS];
    for (uint32_t column = 0; column < TRC_MAP_COLUMNS; column++)
        columns[column] = (float)accumulate(weighed + (size_t)column * TRC_MAP_ROWS, TRC_MAP_ROWS,
                                            facing->down[column]);
    const double total = accumulate(columns, TRC_MAP_COLUMNS, facing->across);
    for (uint32_t block = 0; block < TRC_MAP_BLOCKS; block++)
        facing->factor[block] = (float)((double)weighed[block] / total) / light[block];
}

void trc_world_map_set_chances(struct trc_world_map *map) {
    struct parts parts;
    float light[TRC_MAP_BLOCKS], weighed[TRC_MAP_BLOCKS], n[3];
    accumulate_blocks(map);
    set_parts(map, &parts);
    add_blocks(&parts, light);
    for (uint32_t i = 0; i < TRC_MAP_FACINGS - 1; i++) {
        facing_normal(i, n);
        weigh_blocks(&parts, n, weighed);
        set_facing(&map->facings[i], weighed, light);
    }
    set_facing(&map->facings[TRC_MAP_FACINGS - 1], light, light);
}
