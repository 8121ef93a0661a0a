#include "accuracy.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "aim.h"
#include "buffers.h"
#include "core/fpstate.h"
#include "embree.h"
#include "kernels/trace/packet.h"
#include "model/kernels.h"
#include "model/snapshot.h"
#include "query_scene.h"
#include "race.h"

/* Rays of one list, and lists of each mesh. */
#define LIST_RAYS 65536
#define LIST_COUNT 8
#define NEEDLES 512

static const float near_center[3] = {0, 0, 0}, far_center[3] = {148376, 1234, -223423};

static void fill_sphere(struct mesh *mesh) { mesh_add_uv_sphere(mesh, near_center, 1.0f, 48, 64); }
static void fill_far_sphere(struct mesh *mesh) {
    mesh_add_uv_sphere(mesh, far_center, 100.0f, 48, 64);
}
static void fill_thin_needles(struct mesh *mesh) { query_turned_needles(mesh, NEEDLES, 1e4f); }
static void fill_thinnest_needles(struct mesh *mesh) { query_turned_needles(mesh, NEEDLES, 1e6f); }

static const struct hard_mesh {
    const char *name;
    void (*fill)(struct mesh *mesh);
    const float *inside;
    float reach;
} hard_meshes[] = {{"sphere", fill_sphere, near_center, 0.5f},
                   {"sphere far from the origin", fill_far_sphere, far_center, 50.0f},
                   {"needles, 1e4 times as long as wide", fill_thin_needles, near_center, 0.3f},
                   {"needles, 1e6 times", fill_thinnest_needles, near_center, 0.3f}};

/* Of one way to trace. Distances in ulps of the exact one, normals in half-ulps of 1, both against
 * the plane of the triangle that was hit, in long arithmetic. */
struct accuracy {
    const char *tracer, *mode;
    uint64_t rays, misses;
    long double distance_most, distance_sum, normal_most;
};

static void exact_hit(const struct mesh *mesh, uint32_t triangle, const float o[3],
                      const float d[3], long double *t, long double normal[3]) {
    const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
    const float *a = mesh->positions + 3 * (size_t)index[0],
                *b = mesh->positions + 3 * (size_t)index[1],
                *c = mesh->positions + 3 * (size_t)index[2];
    long double along = 0.0L, across = 0.0L, length = 0.0L;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        normal[k] = ((long double)b[i] - a[i]) * ((long double)c[j] - a[j]) -
                    ((long double)b[j] - a[j]) * ((long double)c[i] - a[i]);
        along += normal[k] * ((long double)a[k] - o[k]);
        across += normal[k] * d[k];
        length += normal[k] * normal[k];
    }
    *t = along / across;
    for (int k = 0; k < 3; k++)
        normal[k] /= sqrtl(length);
}

static void accuracy_add(struct accuracy *out, const struct mesh *mesh, const struct ray_set *rays,
                         const struct hit_set *hits) {
    for (uint32_t i = 0; i < rays->count; i++) {
        float o[3], d[3];
        long double t, normal[3], length = 0.0L;
        out->rays++;
        if (hits->instance[i] == TRC_NO_HIT) {
            out->misses++;
            continue;
        }
        ray_set_get(rays, i, o, d);
        exact_hit(mesh, hits->triangle[i], o, d, &t, normal);
        const float rounded = (float)t;
        const long double ulp = (long double)nextafterf(rounded, INFINITY) - rounded;
        const long double error = fabsl((long double)hits->distance[i] - t) / ulp;
        out->distance_most = fmaxl(out->distance_most, error);
        out->distance_sum += error;
        for (int k = 0; k < 3; k++)
            length += (long double)hits->normal[k][i] * hits->normal[k][i];
        length = sqrtl(length);
        long double same = 0.0L; /* normals may point either way */
        for (int k = 0; k < 3; k++)
            same += normal[k] * hits->normal[k][i];
        length = copysignl(length, same);
        for (int k = 0; k < 3; k++)
            out->normal_most =
                fmaxl(out->normal_most, fabsl(hits->normal[k][i] / length - normal[k]) * 0x1p24L);
    }
}

/* ---- lists ---- */

/* The list's batches and packets, of rays that aim_rays will fill in. */
static void list_open(struct ray_list *list) {
    memset(list, 0, sizeof *list);
    ray_set_init(&list->rays);
    list->batch_count = LIST_RAYS / RAY_BATCH;
    list->packet_count = list->packet_capacity = LIST_RAYS / TRC_PACKET_SIZE;
    list->batch_begin = buffer_alloc(list->batch_count + 1, sizeof *list->batch_begin);
    list->batch_packet = buffer_alloc(list->batch_count + 1, sizeof *list->batch_packet);
    list->packet_begin = buffer_alloc(list->packet_count + 1, sizeof *list->packet_begin);
    for (uint32_t i = 0; i <= list->batch_count; i++) {
        list->batch_begin[i] = i * RAY_BATCH;
        list->batch_packet[i] = i * RAY_BATCH / TRC_PACKET_SIZE;
    }
    for (uint32_t i = 0; i <= list->packet_count; i++)
        list->packet_begin[i] = i * TRC_PACKET_SIZE;
}

/* ---- contestants ---- */

/* Volley by the public query, in packets and alone; each of Embree's modes, in its default scene
 * and its robust one. */
#define MOST_WAYS (2 + 2 * EMBREE_MODES)

struct ways {
    const struct trc_snapshot *snapshot;
    const struct trc_kernels *kernels;
    struct contestant peers[2 * EMBREE_MODES];
    uint32_t peer_count;
    struct accuracy accuracy[MOST_WAYS];
};

static void ways_open(struct ways *w, const struct trc_snapshot *snapshot, uint32_t isa,
                      struct embree_scene *const scenes[2]) {
    static const char *const tracers[] = {"embree default", "embree robust"};
    memset(w, 0, sizeof *w);
    w->snapshot = snapshot;
    w->kernels = trc_kernels_get(isa);
    w->accuracy[0] = (struct accuracy){.tracer = "volley", .mode = "packets"};
    w->accuracy[1] = (struct accuracy){.tracer = "volley", .mode = "single"};
    for (int use = 0; use < 2 && scenes[0]; use++) {
        const uint32_t first = w->peer_count;
        w->peer_count += embree_contestants(scenes[use], w->peers + first);
        for (uint32_t i = first; i < w->peer_count; i++)
            w->accuracy[2 + i] =
                (struct accuracy){.tracer = tracers[use], .mode = w->peers[i].name};
    }
}

static void ways_run(struct ways *w, const struct mesh *mesh, const struct ray_list *list,
                     struct hit_set *hits) {
    const trc_rays rays = ray_set_view(&list->rays, 0, list->rays.count);
    for (uint32_t i = 0; i < 2; i++) {
        const trc_hits out = hit_set_view(hits);
        const uint64_t fp_state = trc_fp_enter();
        w->kernels->query_closest(w->snapshot, &rays, &out, 0, rays.count, i ? 1 : TRC_PACKET_SIZE,
                                  NULL);
        trc_fp_leave(fp_state);
        accuracy_add(&w->accuracy[i], mesh, &list->rays, hits);
    }
    for (uint32_t i = 0; i < w->peer_count; i++) {
        race_hits(&w->peers[i], list, hits);
        accuracy_add(&w->accuracy[2 + i], mesh, &list->rays, hits);
    }
}

/* ---- report ---- */

static void print_ways(const struct ways *w, const char *mesh, const char *isa, FILE *json) {
    printf("\n%s, %s, rays at vertices and edges\n  %-32s %10s %8s %18s %14s %14s\n", mesh, isa, "",
           "rays", "misses", "t: most, ulps", "mean", "normal: most");
    for (uint32_t i = 0; i < 2 + w->peer_count; i++) {
        const struct accuracy *a = &w->accuracy[i];
        const uint64_t hits = a->rays - a->misses;
        const double mean = hits ? (double)a->distance_sum / (double)hits : 0.0;
        printf("  %-14s %-17s %10llu %8llu %18.1f %14.3f %14.1f\n", a->tracer, a->mode,
               (unsigned long long)a->rays, (unsigned long long)a->misses, (double)a->distance_most,
               mean, (double)a->normal_most);
        if (json)
            fprintf(
                json,
                "{\"row\": \"accuracy\", \"mesh\": \"%s\", \"isa\": \"%s\", \"tracer\": \"%s\", "
                "\"mode\": \"%s\", \"rays\": %llu, \"misses\": %llu, \"distance_most_ulps\": %.6g, "
                "\"distance_mean_ulps\": %.6g, \"normal_most_half_ulps\": %.6g}\n",
                mesh, isa, a->tracer, a->mode, (unsigned long long)a->rays,
                (unsigned long long)a->misses, (double)a->distance_most, mean,
                (double)a->normal_most);
    }
    fflush(stdout);
}

static void measure_isa(const struct hard_mesh *hard, const struct query_world *world,
                        const struct trc_snapshot *snapshot, uint32_t isa,
                        const struct options *options, FILE *json) {
    const struct mesh *mesh = &world->meshes[0];
    struct embree_device *device = options->embree ? embree_open(isa, 0) : NULL;
    struct embree_scene *scenes[2] = {NULL, NULL};
    struct aim aim = {.mesh = mesh, .at = AIM_BOTH, .reach = hard->reach};
    struct rng rng = rng_seed(1);
    struct ways ways;
    struct ray_list list;
    struct hit_set hits;
    memcpy(aim.inside, hard->inside, sizeof aim.inside);
    if (device) {
        scenes[0] = embree_scene_create(device, mesh, EMBREE_FAST);
        scenes[1] = embree_scene_create(device, mesh, EMBREE_ROBUST);
    }
    ways_open(&ways, snapshot, isa, scenes);
    list_open(&list);
    hit_set_init(&hits, LIST_RAYS);
    for (uint32_t i = 0; i < LIST_COUNT; i++) {
        ray_set_clear(&list.rays);
        aim_rays(&aim, &rng, LIST_RAYS, &list.rays);
        ways_run(&ways, mesh, &list, &hits);
    }
    print_ways(&ways, hard->name, trc_isa_name(isa), json);
    hit_set_free(&hits);
    ray_list_free(&list);
    embree_scene_destroy(scenes[0]);
    embree_scene_destroy(scenes[1]);
    embree_close(device);
}

bool accuracy_measure(const struct options *options, FILE *json) {
    for (size_t i = 0; i < sizeof hard_meshes / sizeof *hard_meshes; i++) {
        struct query_world world;
        struct query_scene scene;
        query_world_init(&world);
        hard_meshes[i].fill(query_world_object(&world));
        if (query_scene_create(&world, true, 0, &scene) != TRC_OK) {
            fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
            query_world_free(&world);
            return false;
        }
        for (uint32_t k = 0; k < options->isa_count; k++)
            measure_isa(&hard_meshes[i], &world, query_scene_snapshot(scene.scene),
                        options->isas[k], options, json);
        query_scene_destroy(&scene);
        query_world_free(&world);
    }
    return true;
}
