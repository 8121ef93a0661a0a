/* Refs to the triangles of parts: see refs.h. */
#include "bvh/refs.h"

#include <string.h>

#include "bvh/cluster.h"
#include "bvh/part.h"
#include "core/core.h"
#include "scene/mesh.h"
#include "threads/pool.h"

/* Box of a triangle, the mean over its keys; false where a corner is not valid at some key. */
static bool triangle_ref(const struct trc_part *part, uint32_t triangle, struct trc_ref *ref) {
    const uint32_t *index = part->mesh->indices + 3 * (size_t)triangle;
    const uint32_t key_count = part->mesh->key_count;
    const f4 share = f4_set(1.0f / (float)key_count), limit = f4_set(TRC_MAX_COORDINATE);
    f4 lower = f4_set(0.0f), upper = f4_set(0.0f);
    for (uint32_t key = 0; key < key_count; key++) {
        f4 p[3];
        trc_part_corners(part, index, key, p);
        /* False for what is not a number. */
        if (!i4_all((f4_abs(p[0]) <= limit) & (f4_abs(p[1]) <= limit) & (f4_abs(p[2]) <= limit)))
            return false;
        lower += f4_min(p[0], f4_min(p[1], p[2])) * share;
        upper += f4_max(p[0], f4_max(p[1], p[2])) * share;
    }
    f4_store3(ref->lower, lower);
    f4_store3(ref->upper, upper);
    return true;
}

/* Triangles of a part that one task measures. */
#define BLOCK_TRIANGLES 8192
struct ref_block {
    uint32_t part, begin, end; /* triangles */
    struct trc_range range;    /* its refs, from where they would be if no triangles were joined */
    struct trc_ref *to;        /* where they stand in the end */
};
struct ref_job {
    const struct trc_part *parts;
    const atomic_uint *cancel; /* may be NULL */
    struct ref_block *blocks;
};

static void collect_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct ref_job *job = context;
    struct ref_block *block = &job->blocks[index];
    uint32_t count = 0;
    if (job->cancel && *job->cancel)
        return;
    for (uint32_t t = block->begin; t < block->end; t++) {
        struct trc_ref *ref = &block->range.refs[count];
        if (!triangle_ref(&job->parts[block->part], t, ref))
            continue;
        ref->part = block->part;
        ref->primitive = t;
        if (!count || !trc_cluster_join(ref - 1, ref))
            count++;
    }
    block->range.count = count;
    trc_range_measure(&block->range);
}

static void gather_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct ref_job *job = context;
    const struct ref_block *block = &job->blocks[index];
    memcpy(block->to, block->range.refs, block->range.count * sizeof *block->to);
}

/* The blocks of all parts, their refs from *refs on; NULL without memory. */
static struct ref_block *blocks_create(const struct trc_part *parts, uint32_t part_count,
                                       struct trc_ref *refs, uint32_t *count_out) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < part_count; i++)
        count += (parts[i].mesh->triangle_count + BLOCK_TRIANGLES - 1) / BLOCK_TRIANGLES;
    struct ref_block *blocks = trc_alloc_zeroed(count ? count : 1, sizeof *blocks);
    struct ref_block *block = blocks;
    for (uint32_t i = 0; i < part_count && blocks; i++)
        for (uint32_t t = 0; t < parts[i].mesh->triangle_count; t += BLOCK_TRIANGLES, block++) {
            const uint32_t left = parts[i].mesh->triangle_count - t;
            const uint32_t size = left < BLOCK_TRIANGLES ? left : BLOCK_TRIANGLES;
            *block =
                (struct ref_block){.part = i, .begin = t, .end = t + size, .range = {.refs = refs}};
            refs += size;
        }
    *count_out = count;
    return blocks;
}

trc_status trc_refs_collect(const struct trc_part *parts, uint32_t part_count,
                            uint64_t triangle_count, struct trc_pool *pool,
                            const atomic_uint *cancel, struct trc_ref **memory_out,
                            struct trc_range *all_out) {
    uint32_t block_count;
    struct trc_ref *memory = trc_alloc(2 * (triangle_count + 1), sizeof *memory);
    struct ref_block *blocks =
        memory ? blocks_create(parts, part_count, memory, &block_count) : NULL;
    if (!blocks) {
        trc_free(memory);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to build a tree of %llu triangles",
                        (unsigned long long)triangle_count);
    }
    struct ref_job job = {parts, cancel, blocks};
    struct trc_range all = {.refs = memory + triangle_count,
                            .spare = memory,
                            .bounds = box_empty(),
                            .centroids = box_empty()};
    trc_pool_run(pool, block_count, collect_task, &job);
    for (uint32_t i = 0; i < block_count; i++) {
        const struct trc_range *r = &blocks[i].range;
        blocks[i].to = all.refs + all.count;
        all.count += r->count;
        all.triangles += r->triangles;
        if (r->count == 0) /* not measured, where it was cancelled */
            continue;
        box_grow(&all.bounds, r->bounds);
        box_grow(&all.centroids, r->centroids);
    }
    trc_pool_run(pool, block_count, gather_task, &job);
    trc_free(blocks);
    *memory_out = memory;
    *all_out = all;
    return TRC_OK;
}
