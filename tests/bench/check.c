#include "check.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "brute.h"
#include "race.h"
#include "volley.h"

/* FNV-1a (G. Fowler, L. Noll, K.-P. Vo, 1991), by words of 32 bits. */
#define HASH_START UINT64_C(0xcbf29ce484222325)
#define HASH_PRIME UINT64_C(0x100000001b3)

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

static uint64_t add_words(uint64_t hash, const void *words, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        uint32_t word;
        memcpy(&word, (const char *)words + i * sizeof word, sizeof word);
        hash = (hash ^ word) * HASH_PRIME;
    }
    return hash;
}

/* Of all bits but the normals': where two machines say the same number, they found the same. */
static uint64_t hash_of(const struct hit_set *hits) {
    uint64_t hash = add_words(HASH_START, hits->instance, hits->count);
    hash = add_words(hash, hits->triangle, hits->count);
    hash = add_words(hash, hits->distance, hits->count);
    hash = add_words(hash, hits->u, hits->count);
    hash = add_words(hash, hits->v, hits->count);
    for (uint32_t i = 0; i < hits->count; i++)
        hash = (hash ^ hits->occluded[i]) * HASH_PRIME;
    return hash;
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
        printf("%-12s %-6s %-7s %-16s %-5s %7u rays, %u doubtful, %u wrong, hash %016" PRIx64 "\n",
               scene->name, moving ? "moving" : "still", trc_isa_name(options->isas[i]),
               ray_kind_names[list->kind], ray_order_names[list->order], list->rays.count,
               counts[BRUTE_DOUBTFUL], counts[BRUTE_DIFFERS], hash_of(&hits[i]));
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
