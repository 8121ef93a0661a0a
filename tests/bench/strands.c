#include "strands.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"
#include "core/pool.h"
#include "embree.h"
#include "query.h"
#include "race.h"

/* A ball of radius 1 with strands all over it that hang down, their radius about a thousandth of
 * it, as of hair on a head. */
#define STRAND_COUNT 20000
#define STRAND_POINTS 9
#define POINT_COUNT (STRAND_COUNT * STRAND_POINTS)
#define STRAND_LENGTH 0.6f
#define ROOT_RADIUS 0.0015f
#define TIP_RADIUS 0.0005f

#define SEED 33
#define FRAME_EDGE 512
#define SQUARE_EDGE 8     /* pixels that packets are cut from */
#define EYE_DISTANCE 4.0f /* of the pinhole, which sees all of the ball */
#define HALF_VIEW 0.42f   /* tangent */
/* How far before a hit rays start from it: ribbons count nothing nearer than their width. */
#define LIFT (8.0f * ROOT_RADIUS)

static const struct {
    const char *name;
    uint32_t shape, pieces;
    float tolerance; /* of pieces, as the add-on has it */
    enum embree_curve peer;
} kinds[] = {
    {"round, linear", TRC_CURVE_ROUND, 1, 0.0f, EMBREE_ROUND_LINEAR},
    {"flat, linear", TRC_CURVE_RIBBON, 1, 0.0f, EMBREE_FLAT_LINEAR},
    {"round, Catmull-Rom", TRC_CURVE_ROUND, 8, 0.1f, EMBREE_ROUND_CATMULL_ROM},
    {"flat, Catmull-Rom", TRC_CURVE_RIBBON, 4, 0.1f, EMBREE_FLAT_CATMULL_ROM},
};

enum strand_rays { STRAND_PRIMARY, STRAND_SHADOW, STRAND_SPHERE, STRAND_RAYS };
static const char *const ray_names[STRAND_RAYS] = {"primary", "point shadow", "all around"};

static void points_make(float (*points)[4]) {
    struct rng rng = rng_seed(SEED);
    for (uint32_t i = 0; i < STRAND_COUNT; i++) {
        float p[3], way[3];
        rng_direction(&rng, p);
        for (int k = 0; k < 3; k++)
            way[k] = p[k] + rng_range(&rng, -0.2f, 0.2f);
        for (uint32_t j = 0; j < STRAND_POINTS; j++) {
            const float along = (float)j / (STRAND_POINTS - 1);
            float *point = points[i * STRAND_POINTS + j];
            memcpy(point, p, sizeof p);
            point[3] = ROOT_RADIUS + along * (TIP_RADIUS - ROOT_RADIUS);
            way[2] -= 0.3f;
            const float length = sqrtf(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
            for (int k = 0; k < 3; k++)
                p[k] += way[k] / length * STRAND_LENGTH / (STRAND_POINTS - 1);
        }
    }
}

static trc_status scene_make(float (*points)[4], uint32_t kind, trc_scene *scene) {
    const trc_scene_desc scene_desc = trc_scene_desc_default();
    uint32_t *lengths = buffer_alloc(STRAND_COUNT, sizeof *lengths);
    for (uint32_t i = 0; i < STRAND_COUNT; i++)
        lengths[i] = STRAND_POINTS;
    trc_curves_desc desc = trc_curves_desc_default();
    desc.shape = kinds[kind].shape;
    desc.piece_count = kinds[kind].pieces;
    desc.tolerance = kinds[kind].tolerance;
    desc.point_count = POINT_COUNT;
    desc.points = points[0];
    desc.point_value_count = 4ull * POINT_COUNT;
    desc.lengths = lengths;
    desc.strand_count = STRAND_COUNT;
    trc_instance_desc instance = trc_instance_desc_default();
    trc_id id;
    trc_status status = trc_scene_create(&scene_desc, scene);
    if (status == TRC_OK)
        status = trc_curves_create(*scene, &desc, &instance.mesh);
    if (status == TRC_OK)
        status = trc_instance_create(*scene, &instance, &id);
    if (status == TRC_OK)
        status = trc_scene_commit(*scene);
    free(lengths);
    return status;
}

/* ---- rays ---- */

static void list_close(struct ray_list *list) {
    list->batch_count = (list->rays.count + RAY_BATCH - 1) / RAY_BATCH;
    list->batch_begin = buffer_alloc(list->batch_count + 1, sizeof *list->batch_begin);
    for (uint32_t i = 0; i <= list->batch_count; i++) {
        const uint32_t begin = i * RAY_BATCH;
        list->batch_begin[i] = begin < list->rays.count ? begin : list->rays.count;
    }
}

/* One ray through the middle of each pixel, square by square. */
static void primary_make(struct ray_list *list) {
    const uint32_t squares = FRAME_EDGE / SQUARE_EDGE, pixels = SQUARE_EDGE * SQUARE_EDGE;
    const float eye[3] = {0.0f, -EYE_DISTANCE, -0.2f};
    memset(list, 0, sizeof *list);
    ray_set_init(&list->rays);
    for (uint32_t i = 0; i < FRAME_EDGE * FRAME_EDGE; i++) {
        const uint32_t square = i / pixels, pixel = i % pixels;
        const float x = (float)(square % squares * SQUARE_EDGE + pixel % SQUARE_EDGE) + 0.5f;
        const float y = (float)(square / squares * SQUARE_EDGE + pixel / SQUARE_EDGE) + 0.5f;
        const float d[3] = {HALF_VIEW * (2.0f * x / FRAME_EDGE - 1.0f), 1.0f,
                            HALF_VIEW * (2.0f * y / FRAME_EDGE - 1.0f)};
        ray_set_add_simple(&list->rays, eye, d);
    }
    list_close(list);
}

/* From what the camera sees: towards a light, any hit, or to all sides, the nearest. */
static void secondary_make(const struct ray_list *seen, const struct hit_set *hits,
                           enum strand_rays which, struct ray_list *list) {
    static const float light[3] = {-3.0f, -3.0f, 4.0f};
    struct rng rng = rng_seed(SEED);
    memset(list, 0, sizeof *list);
    ray_set_init(&list->rays);
    list->any = which == STRAND_SHADOW;
    for (uint32_t i = 0; i < seen->rays.count; i++) {
        float o[3], d[3], from[3];
        if (hits->instance[i] == TRC_NO_HIT)
            continue;
        ray_set_get(&seen->rays, i, o, d);
        const float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        for (int k = 0; k < 3; k++)
            from[k] = o[k] + (hits->distance[i] - LIFT / length) * d[k];
        if (which == STRAND_SHADOW) {
            ray_set_aim(&list->rays, from, light, 0.0f);
            list->rays.tmax[list->rays.count - 1] = 1.0f;
        } else {
            rng_direction(&rng, d);
            ray_set_add_simple(&list->rays, from, d);
        }
    }
    list_close(list);
}

static void list_free(struct ray_list *list) {
    ray_set_free(&list->rays);
    free(list->batch_begin);
}

/* ---- races ---- */

#define OWN 2 /* contestants: in packets, and alone */

struct strand_row {
    uint32_t kind, isa;
    enum strand_rays which;
    double own[OWN], peer[OWN]; /* medians, Mrays/s; peer: its best mode of packets, and single */
    double misses, peer_misses; /* shares */
};

static void row_print(const struct strand_row *r, FILE *json) {
    printf("%-20s %-13s %8.2f %8.2f %8.2f %6.2f %8.2f %6.2f %9.4f %9.4f\n", kinds[r->kind].name,
           ray_names[r->which], r->own[0], r->own[1], r->peer[0],
           r->peer[0] > 0.0 ? r->own[0] / r->peer[0] : 0.0, r->peer[1],
           r->peer[1] > 0.0 ? r->own[1] / r->peer[1] : 0.0, r->misses, r->peer_misses);
    fflush(stdout);
    if (json)
        fprintf(json,
                "{\"what\":\"strands\",\"isa\":\"%s\",\"curve\":\"%s\",\"rays\":\"%s\","
                "\"packets_mrays_s\":%.4g,\"alone_mrays_s\":%.4g,\"embree_packets_mrays_s\":%.4g,"
                "\"embree_single_mrays_s\":%.4g,\"miss_share\":%.6g,\"embree_miss_share\":%.6g}\n",
                trc_isa_name(r->isa), kinds[r->kind].name, ray_names[r->which], r->own[0],
                r->own[1], r->peer[0], r->peer[1], r->misses, r->peer_misses);
}

/* peer: NULL for none. */
static void race(const struct options *o, trc_scene scene, const struct embree_scene *peer,
                 const struct ray_list *list, struct trc_pool *pool, struct strand_row *row) {
    const struct query_target targets[OWN] = {{scene, 0}, {scene, 1}};
    struct contestant all[OWN + EMBREE_MODES];
    struct rate rates[OWN + EMBREE_MODES];
    struct hit_set hits;
    uint32_t count = 0;
    all[count++] = query_contestant("packets", &targets[0]);
    all[count++] = query_contestant("alone", &targets[1]);
    if (peer)
        count += embree_contestants(peer, all + count);
    hit_set_init(&hits, list->rays.count);
    race_hits(&all[0], list, &hits);
    row->misses = race_miss_share(list, &hits);
    if (peer) {
        race_hits(&all[OWN], list, &hits);
        row->peer_misses = race_miss_share(list, &hits);
    }
    hit_set_free(&hits);
    race_run(all, count, list, pool, o->repeats, o->streamed, rates);
    for (uint32_t i = 0; i < count; i++) {
        const double rate = rate_median(&rates[i]);
        if (i < OWN)
            row->own[i] = rate;
        else if (i == OWN)
            row->peer[1] = rate;
        else
            row->peer[0] = fmax(row->peer[0], rate);
    }
}

/* All rays against one kind of curves. */
static void measure_kind(const struct options *o, trc_scene scene, const struct embree_scene *peer,
                         struct trc_pool *pool, uint32_t kind, uint32_t isa, FILE *json) {
    const struct query_target target = {scene, 0};
    const struct contestant own = query_contestant("packets", &target);
    struct ray_list seen, list;
    struct hit_set hits;
    primary_make(&seen);
    hit_set_init(&hits, seen.rays.count);
    race_hits(&own, &seen, &hits);
    for (uint32_t which = 0; which < STRAND_RAYS; which++) {
        struct strand_row row = {.kind = kind, .isa = isa, .which = which};
        if (which != STRAND_PRIMARY)
            secondary_make(&seen, &hits, which, &list);
        race(o, scene, peer, which == STRAND_PRIMARY ? &seen : &list, pool, &row);
        row_print(&row, json);
        if (which != STRAND_PRIMARY)
            list_free(&list);
    }
    hit_set_free(&hits);
    list_free(&seen);
}

static trc_status measure_isa(const struct options *o, float (*points)[4], uint32_t isa,
                              struct trc_pool *pool, FILE *json) {
    struct embree_device *device = o->embree ? embree_open(isa, 0) : NULL;
    trc_status status = trc_set_isa(isa);
    printf("\n%u strands of %u points, %s, one thread, Mrays/s:\n%-20s %-13s %8s %8s %8s %6s %8s "
           "%6s %9s %9s\n",
           STRAND_COUNT, STRAND_POINTS, trc_isa_name(isa), "curves", "rays", "packets", "alone",
           "Embree's", "ratio", "single", "ratio", "misses", "Embree's");
    for (uint32_t kind = 0; kind < sizeof kinds / sizeof *kinds && status == TRC_OK; kind++) {
        trc_scene scene = 0;
        status = scene_make(points, kind, &scene);
        struct embree_scene *peer =
            device ? embree_curves_create(device, kinds[kind].peer, points[0], STRAND_COUNT,
                                          STRAND_POINTS, kinds[kind].pieces)
                   : NULL;
        if (status == TRC_OK)
            measure_kind(o, scene, peer, pool, kind, isa, json);
        embree_scene_destroy(peer);
        (void)trc_scene_destroy(scene);
    }
    embree_close(device);
    return status;
}

bool strands_measure(const struct options *options, FILE *json) {
    float(*points)[4] = buffer_alloc(POINT_COUNT, sizeof *points);
    struct trc_pool *pool = NULL;
    points_make(points);
    trc_status status = trc_pool_create(1, &pool);
    for (uint32_t i = 0; i < options->isa_count && status == TRC_OK; i++)
        status = measure_isa(options, points, options->isas[i], pool, json);
    if (status != TRC_OK)
        fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
    trc_pool_destroy(pool);
    free(points);
    return status == TRC_OK;
}
