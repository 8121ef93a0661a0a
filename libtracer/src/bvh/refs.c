/* Refs to the triangles of parts: see refs.h. */
#include "bvh/refs.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/clip.h"
#include "bvh/cluster.h"
#include "bvh/part.h"
#include "core/core.h"
#include "core/pool.h"

static bool ends_are_valid(const f4 p[2], const float r[2]) {
    const f4 limit = f4_set(TRC_MAX_COORDINATE);
    /* False for what is not a number. */
    return i4_all((f4_abs(p[0]) <= limit) & (f4_abs(p[1]) <= limit)) &&
           r[0] <= TRC_MAX_COORDINATE && r[1] <= TRC_MAX_COORDINATE;
}

/* Whether both ends of a piece of a curve are valid at all keys. */
static bool piece_is_valid(const struct trc_mesh *mesh, uint32_t piece) {
    for (uint32_t key = 0; key < mesh->key_count; key++) {
        f4 p[2];
        float r[2];
        trc_piece_ends(mesh, piece, key, p, r);
        if (!ends_are_valid(p, r))
            return false;
    }
    return true;
}

/* Box of a piece of a curve, the mean over its keys; false where an end is not valid at some key,
 * or neither has a radius. */
static bool piece_ref(const struct trc_mesh *mesh, uint32_t piece, struct trc_ref *ref) {
    const f4 share = f4_set(1.0f / (float)mesh->key_count);
    f4 lower = f4_set(0.0f), upper = f4_set(0.0f);
    for (uint32_t key = 0; key < mesh->key_count; key++) {
        f4 p[2];
        float r[2];
        trc_piece_ends(mesh, piece, key, p, r);
        if (!ends_are_valid(p, r) || r[0] + r[1] <= 0.0f)
            return false;
        lower += f4_min(p[0] - f4_set(r[0]), p[1] - f4_set(r[1])) * share;
        upper += f4_max(p[0] + f4_set(r[0]), p[1] + f4_set(r[1])) * share;
    }
    f4_store3(ref->lower, lower);
    f4_store3(ref->upper, upper);
    return true;
}

/* Box of a triangle, the mean over its keys; false where a corner is not valid at some key. */
static bool triangle_ref(const struct trc_part *part, uint32_t triangle, struct trc_ref *ref) {
    if (part->mesh->strands)
        return piece_ref(part->mesh, triangle, ref);
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
    uint32_t part, begin, end;  /* triangles */
    uint32_t thin_count;        /* valid pieces of curves without a radius */
    struct trc_range range;     /* its refs, from where they would be if none were joined */
    uint32_t pieces, triangles; /* its refs when clipped, and their triangles */
    bool is_clipped;
    struct trc_ref *to; /* where they stand in the end */
};
struct ref_job {
    const struct trc_part *parts;
    const atomic_uint *cancel; /* may be NULL */
    struct ref_block *blocks;
    struct trc_clip clip;
};
/* Of so many triangles one more may come from clipping. */
#define TRIANGLES_PER_PIECE 8

static void collect_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct ref_job *job = context;
    struct ref_block *block = &job->blocks[index];
    const struct trc_part *part = &job->parts[block->part];
    uint32_t count = 0;
    if (job->cancel && *job->cancel)
        return;
    for (uint32_t t = block->begin; t < block->end; t++) {
        struct trc_ref *ref = &block->range.refs[count];
        if (!triangle_ref(part, t, ref)) {
            block->thin_count += part->mesh->strands && piece_is_valid(part->mesh, t);
            continue;
        }
        ref->part = block->part;
        ref->primitive = t;
        if (!count || !trc_cluster_join(ref - 1, ref))
            count++;
    }
    block->range.count = count;
    trc_range_measure(&block->range);
}

static bool is_cancelled(const struct ref_job *job) { return job->cancel && *job->cancel; }

static bool is_large(const struct ref_job *job, const struct trc_ref *ref) {
    return box_area(trc_ref_box(ref)) > job->clip.min_area;
}

/* Counts what a block comes to when it is clipped; cancelled, it stays as it is. */
static void clip_count_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct ref_job *job = context;
    struct ref_block *block = &job->blocks[index];
    const struct trc_range *r = &block->range;
    uint32_t pieces = 0, triangles = 0;
    for (uint32_t i = 0; i < r->count && !is_cancelled(job); i++) {
        uint32_t count = trc_ref_count(&r->refs[i]);
        pieces += is_large(job, &r->refs[i]) ? trc_ref_clip(&job->parts[block->part], &r->refs[i],
                                                            &job->clip, NULL, &count)
                                             : 1;
        triangles += count;
    }
    block->is_clipped = pieces > r->count && !is_cancelled(job);
    block->pieces = block->is_clipped ? pieces : r->count;
    block->triangles = block->is_clipped ? triangles : r->triangles;
}

/* Moves a block to where it stands in the end, clipped if it is to be. */
static void gather_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct ref_job *job = context;
    const struct ref_block *block = &job->blocks[index];
    const struct trc_range *r = &block->range;
    struct trc_ref *to = block->to;
    uint32_t triangles;
    if (!block->is_clipped)
        memcpy(to, r->refs, r->count * sizeof *to);
    for (uint32_t i = 0; i < r->count && block->is_clipped; i++)
        if (is_large(job, &r->refs[i]))
            to += trc_ref_clip(&job->parts[block->part], &r->refs[i], &job->clip, to, &triangles);
        else
            *to++ = r->refs[i];
}

/* Chooses what is clipped: all that is large, or of too many such refs the largest. */
static void clip_choose(struct ref_job *job, uint32_t block_count, uint64_t room,
                        struct trc_pool *pool) {
    /* Areas that underflow would be 0. */
    job->clip.min_area = fmaxf(TRC_CLIP_MIN_SHARE * box_area(job->clip.bounds), FLT_MIN);
    for (;; job->clip.min_area *= 2.0f) {
        uint64_t more = 0;
        trc_pool_run(pool, block_count, clip_count_task, job);
        for (uint32_t i = 0; i < block_count; i++)
            more += job->blocks[i].triangles - job->blocks[i].range.triangles;
        if (more <= room)
            return;
    }
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

/* Box of the centroids of refs that have been clipped. */
static struct box centroids_of(const struct trc_ref *refs, uint32_t count) {
    struct trc_range r = {.refs = (struct trc_ref *)refs, .count = count};
    trc_range_measure(&r);
    return r.centroids;
}

trc_status trc_refs_collect(const struct trc_part *parts, uint32_t part_count,
                            uint64_t triangle_count, bool clips, struct trc_pool *pool,
                            const atomic_uint *cancel, struct trc_refs *out) {
    const uint64_t limit = TRC_REF_INDEX_MASK - triangle_count,
                   wanted = clips ? triangle_count / TRIANGLES_PER_PIECE : 0,
                   room = wanted < limit ? wanted : limit;
    const uint64_t capacity = triangle_count + room;
    uint32_t block_count;
    struct trc_ref *memory = trc_alloc(2 * (capacity + 1), sizeof *memory);
    struct ref_block *blocks =
        memory ? blocks_create(parts, part_count, memory, &block_count) : NULL;
    if (!blocks) {
        trc_free(memory);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to build a tree of %llu triangles",
                        (unsigned long long)triangle_count);
    }
    struct ref_job job = {.parts = parts, .cancel = cancel, .blocks = blocks};
    *out = (struct trc_refs){.memory = memory};
    struct trc_range *all = &out->all;
    *all = (struct trc_range){.refs = memory + capacity,
                              .spare = memory,
                              .bounds = box_empty(),
                              .centroids = box_empty()};
    trc_pool_run(pool, block_count, collect_task, &job);
    for (uint32_t i = 0; i < block_count; i++) {
        struct ref_block *b = &blocks[i];
        b->pieces = b->range.count;
        b->triangles = b->range.triangles;
        out->triangle_count += b->triangles;
        out->thin_count += b->thin_count;
        if (b->range.count > 0) /* else not measured, where it was cancelled */
            box_grow(&all->bounds, b->range.bounds);
    }
    if (room > 0) {
        job.clip.bounds = all->bounds;
        clip_choose(&job, block_count, room, pool);
    }
    for (uint32_t i = 0; i < block_count; i++) {
        blocks[i].to = all->refs + all->count;
        all->count += blocks[i].pieces;
        all->triangles += blocks[i].triangles;
        out->is_clipped = out->is_clipped || blocks[i].is_clipped;
    }
    trc_pool_run(pool, block_count, gather_task, &job);
    for (uint32_t i = 0; i < block_count; i++)
        if (blocks[i].is_clipped)
            box_grow(&all->centroids, centroids_of(blocks[i].to, blocks[i].pieces));
        else if (blocks[i].range.count > 0)
            box_grow(&all->centroids, blocks[i].range.centroids);
    trc_free(blocks);
    return TRC_OK;
}
