/* Chances of the importance map of the world: of its cells in their blocks, and of the blocks as
 * normals weigh them, by light times cosine. Products of light and cosine are sampled by P.
 * Clarberg, W. Jarosz, T. Akenine-Moeller and H. W. Jensen, "Wavelet Importance Sampling" (2005),
 * over all levels of a hierarchy; here by one level, with the cosines of ranges of normals
 * beforehand. */
#include <math.h>

#include "shading/lights.h"

#define PI 3.14159265358979f

/* Running sums of positive values, count + 1 of 0 to 1; returns the sum of all. */
static double accumulate(const float *values, uint32_t count, float *sums) {
    double total = 0.0, sum = 0.0;
    for (uint32_t i = 0; i < count; i++)
        total += (double)values[i];
    for (uint32_t i = 0; i < count; i++) {
        sums[i] = (float)(sum / total);
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
#define PARTS (BLOCK_PARTS * BLOCK_PARTS)

struct part {
    float direction[3]; /* of its middle */
    float light;        /* of that of the whole sphere */
};

static struct part *part_at(struct part parts[TRC_MAP_BLOCKS][PARTS], uint32_t x, uint32_t y) {
    const uint32_t block = x / BLOCK_PARTS * TRC_MAP_ROWS + y / BLOCK_PARTS;
    return &parts[block][x % BLOCK_PARTS * BLOCK_PARTS + y % BLOCK_PARTS];
}

static void set_parts(const struct trc_world_map *map, struct part parts[TRC_MAP_BLOCKS][PARTS]) {
    const uint32_t width = map->width, height = map->height;
    const uint32_t columns = TRC_MAP_COLUMNS * BLOCK_PARTS, rows = TRC_MAP_ROWS * BLOCK_PARTS;
    for (uint32_t i = 0; i < columns * rows; i++) {
        const uint32_t x = i % columns, y = i / columns;
        const float phi = 2.0f * PI * ((float)x + 0.5f) / (float)columns,
                    theta = PI * ((float)y + 0.5f) / (float)rows;
        *part_at(parts, x, y) =
            (struct part){{sinf(theta) * cosf(phi), sinf(theta) * sinf(phi), cosf(theta)}, 0.0f};
    }
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++)
            part_at(parts, x * columns / width, y * rows / height)->light +=
                map->density[(size_t)y * width + x] / ((float)width * (float)height);
}

/* The middle of a range of normals. */
static void facing_normal(uint32_t facing, float n[3]) {
    const float x = 2.0f * ((float)(facing % TRC_MAP_NORMALS) + 0.5f) / TRC_MAP_NORMALS - 1.0f;
    const float y = 2.0f * ((float)(facing / TRC_MAP_NORMALS) + 0.5f) / TRC_MAP_NORMALS - 1.0f;
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
    if (cosine >= FACING_MARGIN)
        return cosine;
    const float above = fmaxf(cosine + FACING_MARGIN, 0.0f);
    return above * above / (4.0f * FACING_MARGIN);
}

/* Light of a block for a normal, NULL for none. */
static float block_light(const struct part *parts, const float *n) {
    float sum = 0.0f;
    for (int i = 0; i < PARTS; i++) {
        const float *d = parts[i].direction;
        const float weight =
            n ? soft_cosine(n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) + LEAST_COSINE : 1.0f;
        sum += parts[i].light * weight;
    }
    return sum;
}

static void set_facing(struct trc_map_facing *facing, const float *n,
                       struct part parts[TRC_MAP_BLOCKS][PARTS]) {
    float light[TRC_MAP_BLOCKS], columns[TRC_MAP_COLUMNS];
    for (uint32_t block = 0; block < TRC_MAP_BLOCKS; block++)
        light[block] = block_light(parts[block], n);
    for (uint32_t column = 0; column < TRC_MAP_COLUMNS; column++)
        columns[column] = (float)accumulate(light + (size_t)column * TRC_MAP_ROWS, TRC_MAP_ROWS,
                                            facing->down[column]);
    const double total = accumulate(columns, TRC_MAP_COLUMNS, facing->across);
    for (uint32_t block = 0; block < TRC_MAP_BLOCKS; block++)
        facing->factor[block] =
            (float)((double)light[block] / total) / block_light(parts[block], NULL);
}

void trc_world_map_set_chances(struct trc_world_map *map) {
    accumulate_blocks(map);
    struct part parts[TRC_MAP_BLOCKS][PARTS];
    set_parts(map, parts);
    for (uint32_t i = 0; i < TRC_MAP_FACINGS - 1; i++) {
        float n[3];
        facing_normal(i, n);
        set_facing(&map->facings[i], n, parts);
    }
    set_facing(&map->facings[TRC_MAP_FACINGS - 1], NULL, parts);
}
