/* tracer_bench: how fast rays are traced and trees are built, beside Embree on the same work. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "accuracy.h"
#include "check.h"
#include "core/pool.h"
#include "options.h"
#include "query.h"
#include "report.h"
#include "strands.h"
#include "volley.h"

/* The kernels, two kinds of queries, Embree's modes on two scenes. */
#define CONTESTANTS (3 + 2 * EMBREE_MODES)

struct bench {
    struct options options;
    struct bench_scene scene;
    FILE *json;
};

static bool ok(trc_status status) {
    if (status != TRC_OK)
        fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
    return status == TRC_OK;
}

static struct report_table table_of(const struct bench *b, bool moving, uint32_t isa,
                                    uint32_t threads) {
    return (struct report_table){.scene = b->scene.name,
                                 .triangle_count = b->scene.worlds[0].meshes[0].triangle_count,
                                 .moving = moving,
                                 .streamed = b->options.streamed,
                                 .queries = b->options.queries,
                                 .isa = isa,
                                 .threads = threads};
}

static uint32_t differences(const struct hit_difference *d) {
    return d->only_a + d->only_b + d->distance;
}

/* One list's hits and rates. scene: of the queries; peers: Embree's default and robust scene, or
 * NULL both. */
static void race_list(const struct bench *b, const struct volley *volley, trc_scene scene,
                      struct embree_scene *const peers[2], const struct ray_list *list,
                      struct trc_pool *pool, struct race_row *row) {
    const struct query_target packets = {scene, 0}, alone = {scene, 1};
    struct contestant all[CONTESTANTS];
    struct rate rates[CONTESTANTS];
    struct hit_set ours, theirs;
    uint32_t count = 0;
    memset(row, 0, sizeof *row);
    row->list = list;
    all[count++] = volley_contestant(volley);
    if (b->options.queries) {
        all[count++] = query_contestant("query", &packets);
        all[count++] = query_contestant("alone", &alone);
    }
    const uint32_t own = count;
    hit_set_init(&ours, list->rays.count);
    hit_set_init(&theirs, list->rays.count);
    race_hits(&all[0], list, &ours);
    row->miss_share = race_miss_share(list, &ours);
    for (uint32_t i = 1; i < own; i++) {
        race_hits(&all[i], list, &theirs);
        const struct hit_difference d = race_difference(list, &ours, &theirs);
        row->query_differences += differences(&d);
    }
    for (int use = 0; use < 2 && peers[0]; use++) {
        row->mode_count = embree_contestants(peers[use], all + count);
        memcpy(row->modes, all + count, row->mode_count * sizeof *all);
        race_hits(&all[count], list, &theirs);
        row->difference[use] = race_difference(list, &ours, &theirs);
        row->peer_miss_share[use] = race_miss_share(list, &theirs);
        count += row->mode_count;
    }
    race_run(all, count, list, pool, b->options.repeats, b->options.streamed, rates);
    row->volley = rates[0];
    if (own > 1) {
        row->query = rates[1];
        row->alone = rates[2];
    }
    for (uint32_t i = 0; i < row->mode_count; i++)
        for (int use = 0; use < 2; use++)
            row->peer[use][i] = rates[own + (uint32_t)use * row->mode_count + i];
    hit_set_free(&ours);
    hit_set_free(&theirs);
}

static bool list_wanted(const struct bench *b, int kind, int order) {
    return (b->options.kinds >> kind & 1) && (b->options.orders >> order & 1);
}

static void list_make(const struct bench *b, const struct trc_snapshot *snapshot, bool moving,
                      int kind, int order, struct ray_list *list) {
    ray_list_make(list, (enum ray_kind)kind, (enum ray_order)order, &b->scene, moving, &b->options,
                  snapshot, packet_kernels_get(trc_isa()));
}

static bool measure_table(const struct bench *b, trc_scene scene, const struct report_table *table,
                          struct embree_scene *const peers[2]) {
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    const struct volley volley = {snapshot, packet_kernels_get(table->isa)};
    struct trc_pool *pool = NULL;
    if (!ok(trc_pool_create(table->threads, &pool)))
        return false;
    report_races_begin(table, peers[0]);
    for (int kind = 0; kind < RAY_KIND_COUNT; kind++)
        for (int order = 0; order < RAY_ORDER_COUNT; order++) {
            struct ray_list list;
            struct race_row row;
            if (!list_wanted(b, kind, order))
                continue;
            list_make(b, snapshot, table->moving, kind, order, &list);
            race_list(b, &volley, scene, peers, &list, pool, &row);
            report_race(table, &row, b->json);
            ray_list_free(&list);
        }
    trc_pool_destroy(pool);
    return true;
}

static void measure_counts(const struct bench *b, const struct trc_snapshot *snapshot,
                           bool moving) {
    const struct report_table table = table_of(b, moving, trc_isa(), 1);
    report_counts_begin(&table);
    for (int kind = 0; kind < RAY_KIND_COUNT; kind++)
        for (int order = 0; order < RAY_ORDER_COUNT; order++) {
            struct ray_list list;
            if (!list_wanted(b, kind, order))
                continue;
            list_make(b, snapshot, moving, kind, order, &list);
            const struct trace_counts counts = counted_trace(snapshot, &list);
            report_counts(&table, &list, &counts, b->json);
            ray_list_free(&list);
        }
}

/* Tables of one instruction set, one for each number of threads. */
static bool measure_isa(const struct bench *b, trc_scene scene, bool moving, uint32_t isa) {
    const struct options *o = &b->options;
    const struct mesh *mesh = &b->scene.worlds[moving].meshes[0];
    struct embree_device *device = o->embree ? embree_open(isa, 0) : NULL;
    struct embree_scene *peers[2] = {NULL, NULL};
    bool done = ok(trc_set_isa(isa)); /* of the queries */
    if (device) {
        peers[0] = embree_scene_create(device, mesh, EMBREE_FAST);
        peers[1] = embree_scene_create(device, mesh, EMBREE_ROBUST);
    }
    for (uint32_t i = 0; i < o->thread_count && done; i++) {
        const struct report_table table = table_of(b, moving, isa, o->threads[i]);
        done = measure_table(b, scene, &table, peers);
    }
    embree_scene_destroy(peers[0]);
    embree_scene_destroy(peers[1]);
    embree_close(device);
    return done;
}

static bool measure_builds(const struct bench *b, bool moving) {
    for (uint32_t i = 0; i < b->options.thread_count; i++) {
        struct build_result result;
        const struct report_table table = table_of(b, moving, trc_isa(), b->options.threads[i]);
        if (!builds_measure(&b->scene, moving, table.threads, &b->options, &result))
            return false;
        report_builds(&table, &result, b->json);
    }
    return true;
}

static bool measure_scene(const struct bench *b) {
    for (int moving = 0; moving < 2; moving++) {
        struct query_scene built;
        if (!(b->options.motions >> moving & 1))
            continue;
        if (b->options.builds && !measure_builds(b, moving))
            return false;
        if (!ok(query_scene_create(&b->scene.worlds[moving], true, 0, &built)))
            return false;
        bool done = true;
        if (b->options.counts)
            measure_counts(b, query_scene_snapshot(built.scene), moving);
        for (uint32_t i = 0; i < b->options.isa_count && done; i++)
            done = measure_isa(b, built.scene, moving, b->options.isas[i]);
        query_scene_destroy(&built);
        if (!done)
            return false;
    }
    return true;
}

static bool run(struct bench *b) {
    bool good = true;
    if (b->options.strands)
        return strands_measure(&b->options, b->json);
    if (b->options.accuracy)
        return accuracy_measure(&b->options, b->json);
    for (uint32_t i = 0; i < b->options.scene_count && good; i++) {
        char message[512];
        const char *name = b->options.scenes[i];
        if (!bench_scene_load(name, &b->scene, message, sizeof message)) {
            fprintf(stderr, "tracer_bench: no generated scene has that name: %s\n", message);
            return false;
        }
        if (b->options.turn)
            bench_scene_turn(&b->scene, b->options.turn);
        good = b->options.check ? check_scene(&b->scene, &b->options) : measure_scene(b);
        bench_scene_free(&b->scene);
    }
    return good;
}

int main(int argc, char **argv) {
    static struct bench bench;
    switch (options_parse(argc, argv, &bench.options)) {
    case OPTIONS_DONE:
        return EXIT_SUCCESS;
    case OPTIONS_ERROR:
        return EXIT_FAILURE;
    default:
        break;
    }
    const char *path = bench.options.json;
    if (path && !(bench.json = fopen(path, "w"))) {
        fprintf(stderr, "tracer_bench: %s: %s\n", path, strerror(errno));
        return EXIT_FAILURE;
    }
    bool good = run(&bench);
    if (bench.json && fclose(bench.json) != 0) {
        fprintf(stderr, "tracer_bench: %s: %s\n", path, strerror(errno));
        good = false;
    }
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
