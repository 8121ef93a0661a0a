#include "check.h"

#include <stdio.h>

#include "brute.h"
#include "race.h"
#include "volley.h"

struct verdicts {
    uint32_t counts[BRUTE_DIFFERS + 1];
};

static void judge_list(const struct query_world *world, const struct ray_list *list,
                       const struct hit_set *hits, const struct options *options,
                       struct verdicts *out) {
    struct brute_list candidates = {0};
    for (uint32_t ray = 0; ray < list->rays.count; ray++) {
        brute_collect(world, &list->rays, ray, &candidates);
        for (uint32_t i = 0; i < options->isa_count; i++) {
            const enum brute_verdict verdict =
                (list->any ? brute_judge_occluded : brute_judge_closest)(&candidates, &list->rays,
                                                                         ray, &hits[i]);
            out[i].counts[verdict]++;
            if (verdict == BRUTE_DIFFERS)
                hit_set_print(&hits[i], &list->rays, ray);
        }
    }
    brute_list_free(&candidates);
}

static bool check_list(const struct bench_scene *scene, bool moving, const struct ray_list *list,
                       const struct trc_snapshot *snapshot, const struct options *options) {
    struct hit_set hits[OPTIONS_ISAS];
    struct verdicts verdicts[OPTIONS_ISAS] = {0};
    bool good = list->rays.count > 0;
    for (uint32_t i = 0; i < options->isa_count; i++) {
        const struct volley volley = {snapshot, packet_kernels_get(options->isas[i])};
        const struct contestant contestant = volley_contestant(&volley);
        hit_set_init(&hits[i], list->rays.count);
        race_hits(&contestant, list, &hits[i]);
    }
    judge_list(&scene->worlds[moving], list, hits, options, verdicts);
    for (uint32_t i = 0; i < options->isa_count; i++) {
        const uint32_t *counts = verdicts[i].counts;
        printf("%-12s %-6s %-7s %-16s %-5s %7u rays, %u doubtful, %u wrong\n", scene->name,
               moving ? "moving" : "still", trc_isa_name(options->isas[i]),
               ray_kind_names[list->kind], ray_order_names[list->order], list->rays.count,
               counts[BRUTE_DOUBTFUL], counts[BRUTE_DIFFERS]);
        good = good && counts[BRUTE_DIFFERS] == 0;
        hit_set_free(&hits[i]);
    }
    return good;
}

bool check_scene(const struct bench_scene *scene, const struct options *options) {
    bool good = true;
    for (int moving = 0; moving < 2; moving++) {
        struct query_scene built;
        if (!(options->motions >> moving & 1))
            continue;
        if (query_scene_create(&scene->worlds[moving], true, 0, &built) != TRC_OK) {
            fprintf(stderr, "tracer_bench: %s\n", trc_last_message());
            return false;
        }
        const struct trc_snapshot *snapshot = query_scene_snapshot(built.scene);
        for (int kind = 0; kind < RAY_KIND_COUNT; kind++)
            for (int order = 0; order < RAY_ORDER_COUNT; order++) {
                struct ray_list list;
                if (!(options->kinds >> kind & 1) || !(options->orders >> order & 1))
                    continue;
                ray_list_make(&list, (enum ray_kind)kind, (enum ray_order)order, scene, moving,
                              options, snapshot, packet_kernels_get(trc_isa()));
                good = check_list(scene, moving, &list, snapshot, options) && good;
                ray_list_free(&list);
            }
        query_scene_destroy(&built);
    }
    return good;
}
