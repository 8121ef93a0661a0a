#include "rays.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"
#include "core/core.h"
#include "kernels/simd/wide_math.h"
#include "kernels/tile/sampler.h"
#include "kernels/tile/tile.h"
#include "kernels/trace/query.h"
#include "model/sobol.h"

const char *const ray_kind_names[RAY_KIND_COUNT] = {
    "primary",    "lens",   "point_shadow",     "area_shadow",    "mirror",
    "refraction", "glossy", "hemisphere_short", "hemisphere_long"};
const char *const ray_order_names[RAY_ORDER_COUNT] = {"auto", "pixel"};

_Static_assert(RAY_BATCH == TRC_BATCH, "batches are the renderer's");

#define PI 3.14159265f
/* Pixels on a side of a tile, and samples of a pixel in one batch, as the renderer has them. */
#define TILE_SIDE 32
#define SAMPLES_PER_BATCH 16
#define SQUARE 8
#define SHARED_CELLS 4
/* Share of the scene's extent: how far secondary rays start off the surface, the lens's radius, how
 * far short hemisphere rays reach. */
#define OFFSET_SHARE 1e-4f
#define LENS_SHARE 5e-3f
#define SHORT_SHARE 0.1f
/* Shadow rays end before the light by this part of their length. */
#define SHADOW_END 0.999f
#define PHONG_EXPONENT 200.0f
#define GLASS_INDEX 1.45f

struct ray {
    float o[3], d[3], tmax, time;
    uint32_t key; /* rays of one packet share it, in AUTO order */
};

struct sample {
    uint32_t pixel; /* x | y << 16 */
    uint32_t index, key;
};

struct camera {
    float eye[3], right[3], up[3], forward[3]; /* right and up scaled to half the window */
    float lens_radius, focus;
};

struct maker {
    struct ray_list *list;
    const struct bench_scene *scene;
    const struct options *options;
    const struct trc_snapshot *snapshot;
    const struct packet_kernels *kernels;
    struct trc_sampler sampler;
    struct camera camera;
    bool moving, lens;
    uint32_t sample_count, ray_count;
    struct sample samples[RAY_BATCH];
    struct ray rays[RAY_BATCH];
    struct trc_packet packet;
    struct trc_packet_hits hits;
};

/* ---- vectors ---- */

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const float a[3], const float b[3], float out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

static void normalize(float v[3]) {
    const float length = sqrtf(dot(v, v));
    for (int k = 0; k < 3; k++)
        v[k] /= length;
}

/* p + a * v */
static void add_scaled(const float p[3], float a, const float v[3], float out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = p[k] + a * v[k];
}

/* The direction at an angle from n whose cosine is z, turned about n by a share of the circle. */
static void direction_about(const float n[3], float z, float turn, float out[3]) {
    const float helper[3] = {fabsf(n[0]) < 0.5f ? 1.0f : 0.0f, fabsf(n[0]) < 0.5f ? 0.0f : 1.0f, 0};
    const float r = sqrtf(fmaxf(0.0f, 1.0f - z * z));
    float x[3], y[3];
    cross(helper, n, x);
    normalize(x);
    cross(n, x, y);
    for (int k = 0; k < 3; k++)
        out[k] = z * n[k] + r * (cosf(2 * PI * turn) * x[k] + sinf(2 * PI * turn) * y[k]);
}

/* ---- samples of the camera ---- */

static float sample_number(const struct maker *m, const struct sample *s, uint32_t dimension) {
    return trc_sample(&m->sampler, s->pixel, s->index, dimension);
}

static void camera_set(struct maker *m, float place) {
    struct camera *c = &m->camera;
    static const float vertical[3] = {0, 0, 1};
    float target[3];
    stage_camera(&m->scene->stage, place, c->eye, target);
    add_scaled(target, -1.0f, c->eye, c->forward);
    c->focus = sqrtf(dot(c->forward, c->forward));
    normalize(c->forward);
    cross(c->forward, vertical, c->right);
    normalize(c->right);
    cross(c->right, c->forward, c->up);
    const float half = tanf(0.5f * m->scene->stage.field_of_view);
    for (int k = 0; k < 3; k++) {
        c->right[k] *= half;
        c->up[k] *= half;
    }
    c->lens_radius = LENS_SHARE * m->scene->extent;
}

static void camera_ray(const struct maker *m, const struct sample *s, struct ray *r) {
    const struct camera *c = &m->camera;
    const float scale = 2.0f / (float)m->options->size;
    const float x = (float)(s->pixel & 0xffffu) + sample_number(m, s, TRC_DIM_FILTER_X);
    const float y = (float)(s->pixel >> 16) + sample_number(m, s, TRC_DIM_FILTER_Y);
    memcpy(r->o, c->eye, sizeof r->o);
    for (int k = 0; k < 3; k++)
        r->d[k] = c->forward[k] + (x * scale - 1.0f) * c->right[k] + (y * scale - 1.0f) * c->up[k];
    if (m->lens) {
        const float radius = c->lens_radius * sqrtf(sample_number(m, s, TRC_DIM_LENS_X));
        const float angle = 2 * PI * sample_number(m, s, TRC_DIM_LENS_Y);
        const float unit = 1.0f / sqrtf(dot(c->right, c->right));
        for (int k = 0; k < 3; k++) {
            const float focus = c->eye[k] + c->focus * r->d[k];
            r->o[k] += radius * unit * (cosf(angle) * c->right[k] + sinf(angle) * c->up[k]);
            r->d[k] = focus - r->o[k];
        }
    }
    normalize(r->d);
    r->tmax = INFINITY;
    r->time = m->moving ? sample_number(m, s, TRC_DIM_TIME) : 0.0f;
    r->key = 0;
}

/* The cell of time or lens that AUTO sorts camera samples by: kernels/tile/samples.c,
 * samples_order; lenses are wide here. */
static uint32_t sample_cell(const struct maker *m, const struct sample *s) {
    if (m->moving)
        return (uint32_t)(sample_number(m, s, TRC_DIM_TIME) * SHARED_CELLS);
    if (!m->lens)
        return 0;
    return (uint32_t)(sample_number(m, s, TRC_DIM_LENS_X) * 2.0f) * 2u +
           (uint32_t)(sample_number(m, s, TRC_DIM_LENS_Y) * 2.0f);
}

/* ---- the list ---- */

static void packet_open(struct ray_list *list, uint32_t key) {
    if (list->packet_count + 1 >= list->packet_capacity) {
        const uint32_t capacity = list->packet_capacity ? 2 * list->packet_capacity : 1024;
        list->packet_begin = buffer_grow(list->packet_begin, list->packet_count * sizeof(uint32_t),
                                         capacity, sizeof(uint32_t));
        list->packet_key = buffer_grow(list->packet_key, list->packet_count * sizeof(uint32_t),
                                       capacity, sizeof(uint32_t));
        list->packet_capacity = capacity;
    }
    list->packet_key[list->packet_count] = key;
    list->packet_begin[list->packet_count++] = list->rays.count;
}

/* Appends a batch in its present order, in packets that are full or, with breaks, end where the key
 * changes. */
static void batch_append(struct maker *m, bool breaks) {
    struct ray_list *list = m->list;
    uint32_t filled = TRC_PACKET_SIZE;
    if (m->ray_count == 0)
        return;
    list->batch_begin[list->batch_count] = list->rays.count;
    list->batch_packet[list->batch_count++] = list->packet_count;
    for (uint32_t i = 0; i < m->ray_count; i++) {
        const struct ray *r = &m->rays[i];
        if (filled == TRC_PACKET_SIZE || (breaks && i && r->key != m->rays[i - 1].key)) {
            packet_open(list, r->key);
            filled = 0;
        }
        ray_set_add(&list->rays, r->o, r->d, 0.0f, r->tmax, r->time);
        filled++;
    }
}

#define KEY_LIMIT 64 /* above all keys */

/* Stable, by key: index into the batch. */
static void keys_order(const uint32_t *keys, size_t stride, uint32_t count, uint32_t *order) {
    uint32_t n = 0;
    for (uint32_t key = 0; key < KEY_LIMIT; key++)
        for (uint32_t i = 0; i < count; i++)
            if (keys[i * stride] == key)
                order[n++] = i;
}

static void samples_sort(struct maker *m) {
    uint32_t order[RAY_BATCH];
    struct sample copy[RAY_BATCH];
    memcpy(copy, m->samples, m->sample_count * sizeof *copy);
    keys_order(&copy->key, sizeof *copy / sizeof copy->key, m->sample_count, order);
    for (uint32_t i = 0; i < m->sample_count; i++)
        m->samples[i] = copy[order[i]];
}

static void rays_sort(struct maker *m) {
    uint32_t order[RAY_BATCH];
    struct ray copy[RAY_BATCH];
    memcpy(copy, m->rays, m->ray_count * sizeof *copy);
    keys_order(&copy->key, sizeof *copy / sizeof copy->key, m->ray_count, order);
    for (uint32_t i = 0; i < m->ray_count; i++)
        m->rays[i] = copy[order[i]];
}

/* ---- secondary rays ---- */

/* A point that a camera ray met. */
struct meeting {
    const struct sample *sample;
    float p[3], n[3]; /* n: unit, against the ray */
    float d[3], time; /* of the camera ray */
};

/* Dominant axis and its side. */
static uint32_t direction_cell(const float d[3]) {
    return trc_direction_cell(v3(d[0], d[1], d[2]));
}

static void shadow_ray(const struct maker *m, const struct meeting *at, float size, struct ray *r) {
    const float u = sample_number(m, at->sample, TRC_DIM_BOUNCE + TRC_DIM_LIGHT_X);
    const float v = sample_number(m, at->sample, TRC_DIM_BOUNCE + TRC_DIM_LIGHT_Y);
    const float *light = m->scene->stage.light;
    const float target[3] = {light[0] + (u - 0.5f) * size, light[1] + (v - 0.5f) * size, light[2]};
    add_scaled(target, -1.0f, r->o, r->d);
    r->tmax = SHADOW_END;
    /* The light faces down. */
    const float reach = sqrtf(dot(r->d, r->d));
    r->key = trc_light_cell(u, v, reach * reach * reach / (size * size * fabsf(r->d[2])));
}

static void mirror_direction(const struct meeting *at, float out[3]) {
    add_scaled(at->d, -2.0f * dot(at->d, at->n), at->n, out);
}

static void refracted_direction(const struct meeting *at, float out[3]) {
    const float ratio = 1.0f / GLASS_INDEX, cosine = -dot(at->d, at->n);
    const float inner = sqrtf(1.0f - ratio * ratio * (1.0f - cosine * cosine));
    for (int k = 0; k < 3; k++)
        out[k] = ratio * at->d[k] + (ratio * cosine - inner) * at->n[k];
}

static void glossy_direction(const struct meeting *at, float u, float v, float out[3]) {
    float mirror[3];
    mirror_direction(at, mirror);
    direction_about(mirror, powf(1.0f - u, 1.0f / (PHONG_EXPONENT + 1.0f)), v, out);
    if (dot(out, at->n) <= 0.0f)
        memcpy(out, mirror, sizeof mirror);
}

static void secondary_ray(const struct maker *m, const struct meeting *at, struct ray *r) {
    const enum ray_kind kind = m->list->kind;
    const float u = sample_number(m, at->sample, TRC_DIM_BOUNCE + TRC_DIM_BSDF_X);
    const float v = sample_number(m, at->sample, TRC_DIM_BOUNCE + TRC_DIM_BSDF_Y);
    const float offset = OFFSET_SHARE * m->scene->extent;
    add_scaled(at->p, kind == RAY_REFRACTION ? -offset : offset, at->n, r->o);
    r->tmax = INFINITY;
    r->time = at->time;
    switch (kind) {
    case RAY_POINT_SHADOW:
        shadow_ray(m, at, 0.0f, r);
        return;
    case RAY_AREA_SHADOW:
        shadow_ray(m, at, m->scene->stage.light_size, r);
        return;
    case RAY_MIRROR:
        mirror_direction(at, r->d);
        break;
    case RAY_REFRACTION:
        refracted_direction(at, r->d);
        break;
    case RAY_GLOSSY:
        glossy_direction(at, u, v, r->d);
        break;
    default:
        direction_about(at->n, sqrtf(1.0f - u), v, r->d);
        if (kind == RAY_HEMISPHERE_SHORT)
            r->tmax = SHORT_SHARE * m->scene->extent;
    }
    r->key = direction_cell(r->d);
}

/* Traces the camera rays [begin, begin + count) of the batch. */
static void packet_trace(struct maker *m, uint32_t begin, uint32_t count) {
    struct trc_packet *p = &m->packet;
    memset(p, 0, sizeof *p);
    p->active = count < TRC_PACKET_SIZE ? (1ull << count) - 1 : ~0ull;
    p->visibility = TRC_VISIBLE_ALL;
    p->common_origin = true;
    memset(m->hits.instance, 0xff, sizeof m->hits.instance);
    for (uint32_t i = 0; i < count; i++) {
        const struct ray *r = &m->rays[begin + i];
        for (int k = 0; k < 3; k++) {
            p->o[k][i] = r->o[k];
            p->d[k][i] = r->d[k];
        }
        p->t[i] = r->tmax;
        p->time[i] = r->time;
    }
    m->kernels->closest(m->snapshot, p, &m->hits, 1);
}

/* False where lane i met nothing, or a triangle without area. */
static bool meeting_at(const struct maker *m, uint32_t ray, uint32_t i, struct meeting *at) {
    const struct ray *r = &m->rays[ray];
    if (m->hits.instance[i] == TRC_NO_HIT)
        return false;
    at->sample = &m->samples[ray];
    at->time = r->time;
    memcpy(at->d, r->d, sizeof at->d);
    add_scaled(r->o, m->packet.t[i], r->d, at->p);
    trc_query_normal(m->snapshot, m->hits.instance[i], m->hits.triangle[i], r->time, at->n);
    const float length = sqrtf(dot(at->n, at->n)), side = dot(at->n, r->d) > 0.0f ? -1.0f : 1.0f;
    for (int k = 0; k < 3; k++)
        at->n[k] *= side / length;
    return isfinite(at->n[0] + at->n[1] + at->n[2]);
}

/* The batch's camera rays become the rays that leave what they hit. */
static void secondary_rays(struct maker *m) {
    uint32_t made = 0;
    for (uint32_t begin = 0; begin < m->ray_count; begin += TRC_PACKET_SIZE) {
        const uint32_t left = m->ray_count - begin;
        const uint32_t count = left < TRC_PACKET_SIZE ? left : TRC_PACKET_SIZE;
        packet_trace(m, begin, count);
        for (uint32_t i = 0; i < count; i++) {
            struct meeting at;
            if (meeting_at(m, begin + i, i, &at))
                secondary_ray(m, &at, &m->rays[made++]); /* made <= begin + i: that one is done */
        }
    }
    m->ray_count = made;
}

/* ---- tiles ---- */

static void batch_make(struct maker *m, bool cells) {
    const bool secondary = m->list->kind != RAY_PRIMARY && m->list->kind != RAY_LENS;
    const bool is_auto = m->list->order == RAY_ORDER_AUTO;
    if (cells)
        samples_sort(m);
    for (uint32_t i = 0; i < m->sample_count; i++)
        camera_ray(m, &m->samples[i], &m->rays[i]);
    m->ray_count = m->sample_count;
    m->sample_count = 0;
    if (secondary)
        secondary_rays(m);
    if (secondary && is_auto)
        rays_sort(m);
    /* Shadow rays of a queue follow each other in packets that are always full. */
    batch_append(m, secondary && is_auto && !m->list->any);
}

struct rectangle {
    uint32_t x, y, width, height;
};

static void square_append(struct maker *m, const struct rectangle *tile, uint32_t x, uint32_t y,
                          uint32_t begin, uint32_t end) {
    for (uint32_t place = 0; place < SQUARE * SQUARE; place++) {
        uint32_t i = x, j = y;
        for (uint32_t bit = 0; 1u << bit < SQUARE; bit++) {
            i += (place >> (2 * bit) & 1u) << bit;
            j += (place >> (2 * bit + 1) & 1u) << bit;
        }
        for (uint32_t index = begin; i < tile->width && j < tile->height && index < end; index++) {
            struct sample *s = &m->samples[m->sample_count++];
            *s = (struct sample){(tile->x + i) | (tile->y + j) << 16, index, 0};
            s->key = sample_cell(m, s);
        }
    }
}

/* A range of a tile's samples, at most SAMPLES_PER_BATCH, in squares as
 * kernels/tile/samples.c walks it. */
static void samples_make(struct maker *m, const struct rectangle *tile, uint32_t begin,
                         uint32_t end) {
    const bool cells =
        m->list->order == RAY_ORDER_AUTO && (m->lens || m->moving) && end - begin >= SHARED_CELLS;
    for (uint32_t y = 0; y < tile->height; y += SQUARE)
        for (uint32_t x = 0; x < tile->width; x += SQUARE) {
            if (m->sample_count + SQUARE * SQUARE * (end - begin) > RAY_BATCH)
                batch_make(m, cells);
            square_append(m, tile, x, y, begin, end);
        }
    batch_make(m, cells);
}

/* Tiles are spread over all of the camera's way and over the frame, by the R2 sequence (M. Roberts,
 * "The unreasonable effectiveness of quasirandom sequences", 2018). */
static void tile_make(struct maker *m, uint32_t tile) {
    const uint32_t size = m->options->size, side = size < TILE_SIDE ? size : TILE_SIDE;
    const uint32_t across = size / side, eye = tile % STAGE_EYES, step = tile / STAGE_EYES;
    const double u = 0.5 + step * 0.7548776662466927, v = 0.5 + step * 0.5698402909980532;
    const struct rectangle at = {(uint32_t)((u - floor(u)) * across) * side,
                                 (uint32_t)((v - floor(v)) * across) * side, side, side};
    camera_set(m, (float)eye / (STAGE_EYES - 1));
    for (uint32_t s = 0; s < m->options->samples; s += SAMPLES_PER_BATCH) {
        const uint32_t left = m->options->samples - s;
        samples_make(m, &at, s, s + (left < SAMPLES_PER_BATCH ? left : SAMPLES_PER_BATCH));
    }
}

static bool is_occlusion(enum ray_kind kind) {
    return kind == RAY_POINT_SHADOW || kind == RAY_AREA_SHADOW || kind == RAY_HEMISPHERE_SHORT;
}

/* Kinds whose packets the renderer takes several at a time. */
static bool stays_together(enum ray_kind kind) { return kind <= RAY_REFRACTION; }

/* No batch has fewer samples than a square of pixels. */
static uint32_t most_batches(const struct options *options) {
    const uint32_t squares = TILE_SIDE * TILE_SIDE / (SQUARE * SQUARE);
    return options->tiles * squares * (1 + options->samples / SAMPLES_PER_BATCH);
}

void ray_list_make(struct ray_list *list, enum ray_kind kind, enum ray_order order,
                   const struct bench_scene *scene, bool moving, const struct options *options,
                   const struct trc_snapshot *snapshot, const struct packet_kernels *kernels) {
    struct maker *m = buffer_alloc(1, sizeof *m);
    uint32_t *table = NULL;
    if (trc_sobol_table_create(&table) != TRC_OK) {
        fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
        exit(EXIT_FAILURE);
    }
    *list = (struct ray_list){.kind = kind,
                              .order = order,
                              .any = is_occlusion(kind),
                              .common_origin = kind == RAY_PRIMARY,
                              .bundle = stays_together(kind) ? options->bundle : 1};
    ray_set_init(&list->rays);
    list->batch_begin = buffer_alloc(most_batches(options) + 1, sizeof(uint32_t));
    list->batch_packet = buffer_alloc(most_batches(options) + 1, sizeof(uint32_t));
    *m = (struct maker){.list = list,
                        .scene = scene,
                        .options = options,
                        .snapshot = snapshot,
                        .kernels = kernels,
                        .sampler = {TRC_SAMPLER_SOBOL, 0, options->samples, table},
                        .moving = moving,
                        .lens = kind == RAY_LENS};
    for (uint32_t tile = 0; tile < options->tiles; tile++)
        tile_make(m, tile);
    packet_open(list, 0); /* the end, which is no packet */
    list->packet_count--;
    list->batch_begin[list->batch_count] = list->rays.count;
    list->batch_packet[list->batch_count] = list->packet_count;
    trc_free(table);
    free(m);
}

void ray_list_free(struct ray_list *list) {
    ray_set_free(&list->rays);
    free(list->batch_begin);
    free(list->batch_packet);
    free(list->packet_begin);
    free(list->packet_key);
    *list = (struct ray_list){0};
}
