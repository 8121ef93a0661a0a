/* The trees of a snapshot: which instances share a tree, which are joined, what is kept, refitted
 * or rebuilt. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "bvh/bvh.h"
#include "bvh/former.h"
#include "bvh/refs.h"
#include "bvh/thin.h"
#include "bvh/tree.h"
#include "core/box.h"
#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"
#include "model/material.h"
#include "model/range.h"

/* A refitted tree whose SAH cost has grown by this factor is rebuilt. */
#define REBUILD_GROWTH 1.4f
/* The same where the caller builds such trees apart: beyond it a build costs less than the rays. */
#define REBUILD_GROWTH_AT_ONCE 3.0f
/* Instances of meshes of fewer triangles than 1 << (SHARED_CLASSES - 1) are joined, the smallest
 * first, while they are no more triangles than that together: some 50 MiB. */
#define SHARED_CLASSES 13u
#define SHARED_TRIANGLES (1u << 20)
/* Instances that have changed have trees of their own while they are at most one in so many of the
 * triangles that would be joined: the joined tree is built anew for more. */
#define RESTLESS_PART 4u

struct create_job {
    const struct trc_snapshot *snapshot, *before; /* before: the former one, or NULL */
    const struct trc_bvh_options *options;
    struct trc_pool *pool;
    struct trc_bvh *bvh;
    struct trc_bvh_build_stats *stats;
    uint8_t *is_restless; /* per instance: has a tree of its own, for it may change again */
    uint8_t *transparent; /* per material slot over all instances */
    uint32_t *first_slot; /* per instance */
    /* The instances of each mesh: the first, and after each the next; TRC_NO_HIT ends them. */
    uint32_t *first_user, *next_user;
    struct trc_former former;
};

/* One tree over parts of one key count. clips: they are at rest, and it is never refitted, which
 * would bound pieces by whole triangles. */
static trc_status tree_build(struct create_job *job, const struct trc_part *parts,
                             uint32_t part_count, uint32_t key_count, bool clips,
                             struct trc_tree *tree) {
    uint64_t total = 0;
    for (uint32_t i = 0; i < part_count; i++)
        total += parts[i].mesh->triangle_count;
    if (total > TRC_REF_INDEX_MASK)
        return trc_fail(TRC_ERROR_TOO_LARGE, "%llu triangles in one tree, at most %u",
                        (unsigned long long)total, TRC_REF_INDEX_MASK);
    struct trc_refs refs = {0};
    trc_status status =
        trc_refs_collect(parts, part_count, total, clips, job->pool, job->options->cancel, &refs);
    const uint32_t slot_count = refs.all.triangles;
    struct trc_part_triangle *triangles = NULL;
    struct box *boxes = NULL;
    if (status == TRC_OK) {
        triangles = trc_alloc(slot_count ? slot_count : 1, sizeof *triangles);
        boxes = refs.is_clipped ? trc_alloc(slot_count, sizeof *boxes) : NULL;
        if (!triangles || (refs.is_clipped && !boxes))
            status =
                trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory to build a tree of %llu triangles",
                         (unsigned long long)total);
    }
    struct trc_topology topology;
    if (status == TRC_OK)
        status = trc_topology_build(&refs.all, TRC_NODE_WIDTH, job->pool, job->options->cancel,
                                    triangles, boxes, &topology);
    trc_free(refs.memory); /* before the tree needs as much */
    if (status == TRC_OK) {
        status = trc_tree_fill(&topology, triangles, boxes, slot_count, parts, key_count, job->pool,
                               job->options->cancel, tree);
        trc_topology_destroy(&topology);
    }
    trc_free(boxes);
    trc_free(triangles);
    if (status != TRC_OK)
        return status;
    tree->triangle_count = refs.triangle_count;
    tree->skipped_count = total - refs.triangle_count;
    tree->thin_count = refs.thin_count;
    job->stats->built_count++;
    return TRC_OK;
}

void trc_blas_release(struct trc_blas *blas) {
    if (!blas || atomic_fetch_sub(&blas->refs, 1) != 1)
        return;
    trc_tree_destroy(&blas->tree);
    trc_free(blas->transparent);
    trc_free(blas);
}

/* Transparency flags of a shared tree: a slot is flagged when any instance of the mesh has a
 * transparent material there. */
static trc_status mesh_slots(const struct create_job *job, uint32_t mesh, uint8_t **slots_out,
                             uint32_t *count_out) {
    const struct trc_snapshot *s = job->snapshot;
    uint32_t count = 0;
    for (uint32_t i = job->first_user[mesh]; i != TRC_NO_HIT; i = job->next_user[i])
        if (s->instances[i].material_count > count)
            count = s->instances[i].material_count;
    uint8_t *slots = trc_alloc_zeroed(count ? count : 1, 1);
    if (!slots)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for material slots");
    for (uint32_t i = job->first_user[mesh]; i != TRC_NO_HIT; i = job->next_user[i]) {
        const uint32_t last = s->instances[i].material_count - 1;
        for (uint32_t slot = 0; slot < count; slot++)
            slots[slot] |= job->transparent[job->first_slot[i] + (slot < last ? slot : last)];
    }
    *slots_out = slots;
    *count_out = count;
    return TRC_OK;
}

/* The slots as a tree keeps them: none where none is transparent. */
static uint32_t transparent_count_of(const uint8_t *slots, uint32_t count) {
    return count && memchr(slots, 1, count) ? count : 0;
}

/* Whether a tree has the same slots for transparent, as flags are in its leaves. */
static bool slots_match(const struct trc_blas *blas, const uint8_t *slots, uint32_t count) {
    count = transparent_count_of(slots, count);
    return blas->transparent_count == count &&
           (count == 0 || memcmp(blas->transparent, slots, count) == 0);
}

static trc_status slots_keep(struct trc_blas *blas, const uint8_t *slots, uint32_t count) {
    blas->transparent_count = transparent_count_of(slots, count);
    if (blas->transparent_count == 0)
        return TRC_OK;
    blas->transparent = trc_alloc(count, 1);
    if (!blas->transparent)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for material slots");
    memcpy(blas->transparent, slots, count);
    return TRC_OK;
}

/* The tree of a mesh: the former one, a refit of it, or a new one. */
static trc_status blas_obtain(struct create_job *job, uint32_t mesh_index,
                              struct trc_mesh *const *replaced) {
    const struct trc_mesh *mesh = job->snapshot->meshes[mesh_index];
    const struct trc_mesh *source = replaced && replaced[mesh_index] ? replaced[mesh_index] : mesh;
    uint8_t *slots = NULL;
    uint32_t slot_count = 0;
    trc_status status = mesh_slots(job, mesh_index, &slots, &slot_count);
    if (status != TRC_OK)
        return status;
    struct trc_blas *from = trc_former_find(&job->former, source);
    if (from && !slots_match(from, slots, slot_count))
        from = NULL;
    /* Those that are built apart know no slots. */
    const bool apart = from && from->transparent_count == 0;
    if (apart && job->options->rebuilt && job->options->rebuilt[mesh_index])
        from = job->options->rebuilt[mesh_index];
    if (from && from->mesh == mesh) {
        atomic_fetch_add(&from->refs, 1);
        job->bvh->blas[mesh_index] = from;
        trc_free(slots);
        return TRC_OK;
    }
    struct trc_blas *blas = trc_alloc_zeroed(1, sizeof *blas);
    if (!blas) {
        trc_free(slots);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree");
    }
    atomic_init(&blas->refs, 1);
    blas->mesh = mesh;
    const struct trc_part part = {mesh, 0, NULL, slots, slot_count};
    bool done = false;
    const float growth =
        job->options->keeps_grown && apart ? REBUILD_GROWTH_AT_ONCE : REBUILD_GROWTH;
    status = slots_keep(blas, slots, slot_count);
    /* A skipped triangle may have become valid and the other way round: then the shape is stale. */
    if (from && from->tree.skipped_count == 0 && status == TRC_OK) {
        status = trc_tree_refit(&from->tree, &part, mesh->key_count, job->pool,
                                job->options->cancel, &blas->tree);
        blas->tree.triangle_count = from->tree.triangle_count;
        blas->built_cost = from->built_cost;
        done = status == TRC_OK && blas->tree.extent <= TRC_MAX_COORDINATE &&
               blas->tree.sah_cost <= growth * from->built_cost;
        if (done)
            job->stats->refitted_count++;
        else
            trc_tree_destroy(&blas->tree);
    }
    if (!done && status == TRC_OK) {
        status = tree_build(job, &part, 1, mesh->key_count, false, &blas->tree);
        blas->built_cost = blas->tree.sah_cost;
    }
    trc_free(slots);
    if (status == TRC_OK)
        job->bvh->blas[mesh_index] = blas;
    else
        trc_blas_release(blas);
    return status;
}

/* ---- instances with trees of their own ---- */

/* The tree that the instance of that number had before, if nothing about it has changed. */
static struct trc_own_tree *own_previous(const struct create_job *job, uint32_t number,
                                         const uint8_t *slots) {
    const struct trc_instance *instance = &job->snapshot->instances[number];
    const struct trc_bvh *previous = job->before ? job->before->bvh : NULL;
    if (!previous || !previous->own || number >= previous->instance_count)
        return NULL;
    struct trc_own_tree *own = previous->own[number];
    if (!own || !trc_own_tree_is_of(own, instance, job->snapshot->meshes[instance->mesh]) ||
        !slots_match(&own->blas, slots, instance->material_count))
        return NULL;
    atomic_fetch_add(&own->blas.refs, 1);
    return own;
}

/* Over the instance's triangles where they are in the world; of one that is not thin they are
 * placed, and bounded, as in the joined tree, so that rays find the same. */
static trc_status own_fill(struct create_job *job, const struct trc_instance *instance,
                           const uint8_t *slots, struct trc_tree *tree) {
    const struct trc_mesh *mesh = job->snapshot->meshes[instance->mesh];
    struct trc_part part = {mesh, 0, instance->object_to_world, slots, instance->material_count};
    if (!instance->is_thin)
        return tree_build(job, &part, 1, 1, true, tree);
    struct trc_mesh placed;
    TRC_TRY(trc_thin_mesh(instance, mesh, &placed));
    part.mesh = &placed;
    part.transform = NULL;
    const trc_status status = tree_build(job, &part, 1, placed.key_count, false, tree);
    trc_free(placed.positions);
    return status;
}

static trc_status own_build(struct create_job *job, uint32_t number, const uint8_t *slots,
                            struct trc_own_tree **own_out) {
    const struct trc_instance *instance = &job->snapshot->instances[number];
    struct trc_own_tree *own = trc_own_tree_create(instance, job->snapshot->meshes[instance->mesh]);
    if (!own)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree");
    trc_status status = slots_keep(&own->blas, slots, instance->material_count);
    if (status == TRC_OK)
        status = own_fill(job, instance, slots, &own->blas.tree);
    if (status == TRC_OK)
        *own_out = own;
    else
        trc_blas_release(&own->blas);
    return status;
}

static trc_status own_obtain(struct create_job *job, uint32_t number) {
    const uint8_t *slots = job->transparent + job->first_slot[number];
    struct trc_bvh *bvh = job->bvh;
    if (!bvh->own) {
        bvh->own = trc_alloc_zeroed(bvh->instance_count, sizeof(struct trc_own_tree *));
        if (!bvh->own)
            return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the trees");
    }
    bvh->own[number] = own_previous(job, number, slots);
    return bvh->own[number] ? TRC_OK : own_build(job, number, slots, &bvh->own[number]);
}

bool trc_bvh_has_grown(const struct trc_bvh *bvh, uint32_t mesh) {
    const struct trc_blas *blas = bvh->blas[mesh];
    return blas && blas->transparent_count == 0 &&
           blas->tree.sah_cost > REBUILD_GROWTH * blas->built_cost;
}

trc_status trc_blas_build(const struct trc_mesh *mesh, struct trc_pool *pool,
                          const atomic_uint *cancel, struct trc_blas **blas_out) {
    struct trc_blas *blas = trc_alloc_zeroed(1, sizeof *blas);
    if (!blas)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a tree");
    atomic_init(&blas->refs, 1);
    blas->mesh = mesh;
    struct trc_bvh_build_stats stats = {0};
    const struct trc_bvh_options options = {.cancel = cancel};
    struct create_job job = {.options = &options, .pool = pool, .stats = &stats};
    const struct trc_part part = {.mesh = mesh};
    const trc_status status = tree_build(&job, &part, 1, mesh->key_count, false, &blas->tree);
    if (status != TRC_OK) {
        trc_blas_release(blas);
        return status;
    }
    blas->built_cost = blas->tree.sah_cost;
    *blas_out = blas;
    return TRC_OK;
}

/* Sizes of meshes by powers of two: the first of which it has fewer triangles than 1 << size. */
static uint32_t size_class(uint32_t triangle_count) {
    uint32_t size = 0;
    while (size < SHARED_CLASSES && triangle_count >> size)
        size++;
    return size;
}

/* The largest class of which, and of those below, all instances together are few enough triangles
 * to be joined though they share their meshes. */
static uint32_t shared_class(const struct create_job *job, const uint32_t *uses) {
    const struct trc_snapshot *s = job->snapshot;
    uint64_t triangles[SHARED_CLASSES + 1] = {0}, sum = 0;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const uint32_t mesh = s->instances[i].mesh, count = s->meshes[mesh]->triangle_count;
        if (job->bvh->is_joined[i] && uses[mesh] > 1)
            triangles[size_class(count)] += count;
    }
    uint32_t size = 0;
    while (size < SHARED_CLASSES && sum + triangles[size] <= SHARED_TRIANGLES)
        sum += triangles[size++];
    return size;
}

/* Which instances go to the joined tree: static, seen by all rays, alone with their mesh or sharing
 * a small one. Boxes of small instances overlap, and each that a ray enters costs it a transform
 * and a walk from the root. */
static void join_select(struct create_job *job) {
    const struct trc_snapshot *s = job->snapshot;
    if (!job->options->is_final)
        return;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        const struct trc_mesh *mesh = s->meshes[instance->mesh];
        job->bvh->is_joined[i] = instance->key_count == 1 && mesh->key_count == 1 &&
                                 !mesh->strands && instance->visibility == TRC_VISIBLE_ALL;
    }
    uint32_t *uses = trc_alloc_zeroed(s->mesh_count ? s->mesh_count : 1, sizeof *uses);
    if (!uses) {
        memset(job->bvh->is_joined, 0, s->instance_count); /* slower, not wrong */
        return;
    }
    for (uint32_t i = 0; i < s->instance_count; i++)
        uses[s->instances[i].mesh]++;
    const uint32_t size = shared_class(job, uses);
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const uint32_t mesh = s->instances[i].mesh;
        if (uses[mesh] > 1 && size_class(s->meshes[mesh]->triangle_count) >= size)
            job->bvh->is_joined[i] = 0;
    }
    trc_free(uses);
}

/* Whether an instance shows what it showed before, where it was. */
static bool stands_still(const struct create_job *job, uint32_t number) {
    const struct trc_snapshot *s = job->snapshot, *before = job->before;
    const struct trc_instance *now = &s->instances[number], *then = &before->instances[number];
    return before->meshes[then->mesh] == s->meshes[now->mesh] &&
           memcmp(then->object_to_world, now->object_to_world, sizeof(struct trc_affine)) == 0;
}

/* What of the instances to be joined was not, or has changed, has trees of its own instead: what
 * moves in one frame moves in the next, and the joined tree can stay. */
static void restless_select(struct create_job *job) {
    const struct trc_snapshot *s = job->snapshot;
    const struct trc_bvh *previous = job->before ? job->before->bvh : NULL;
    if (!previous || !previous->joined)
        return;
    uint64_t all = 0, restless = 0;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        if (!job->bvh->is_joined[i])
            continue;
        const uint32_t triangles = s->meshes[s->instances[i].mesh]->triangle_count;
        all += triangles;
        job->is_restless[i] =
            i >= previous->instance_count || !previous->is_joined[i] || !stands_still(job, i);
        restless += job->is_restless[i] ? triangles : 0;
    }
    const bool are_few = restless * RESTLESS_PART <= all;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        job->is_restless[i] &= are_few;
        job->bvh->is_joined[i] &= !job->is_restless[i];
    }
}

/* Whether the same triangles are joined as before, with the same flags. */
static bool joins_the_same(const struct create_job *job) {
    const struct trc_snapshot *s = job->snapshot, *before = job->before;
    const struct trc_bvh *previous = before ? before->bvh : NULL;
    if (!previous || !previous->joined)
        return false;
    for (uint32_t i = s->instance_count; i < previous->instance_count; i++)
        if (previous->is_joined[i])
            return false;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const bool was_joined = i < previous->instance_count && previous->is_joined[i];
        if (was_joined != job->bvh->is_joined[i] || (was_joined && !stands_still(job, i)))
            return false;
        if (!was_joined)
            continue;
        const struct trc_instance *then = &before->instances[i];
        if (then->material_count != s->instances[i].material_count)
            return false;
        for (uint32_t k = 0; k < then->material_count; k++)
            if (job->transparent[job->first_slot[i] + k] !=
                trc_material_is_clear(before->materials[then->materials[k]]))
                return false;
    }
    return true;
}

static void joined_release(struct trc_joined_tree *joined) {
    if (!joined || atomic_fetch_sub(&joined->refs, 1) != 1)
        return;
    trc_tree_destroy(&joined->tree);
    trc_free(joined);
}

static trc_status joined_build(struct create_job *job, uint32_t count) {
    const struct trc_snapshot *s = job->snapshot;
    struct trc_part *parts = trc_alloc(count, sizeof *parts);
    struct trc_joined_tree *joined = trc_alloc_zeroed(1, sizeof *joined);
    if (!parts || !joined) {
        trc_free(parts);
        trc_free(joined);
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u meshes", count);
    }
    atomic_init(&joined->refs, 1);
    uint32_t n = 0;
    for (uint32_t i = 0; i < s->instance_count; i++)
        if (job->bvh->is_joined[i])
            parts[n++] = (struct trc_part){
                s->meshes[s->instances[i].mesh], i, s->instances[i].object_to_world,
                job->transparent + job->first_slot[i], s->instances[i].material_count};
    const trc_status status = tree_build(job, parts, count, 1, true, &joined->tree);
    trc_free(parts);
    if (status == TRC_OK)
        job->bvh->joined = joined;
    else
        joined_release(joined);
    return status;
}

static trc_status joined_obtain(struct create_job *job) {
    uint32_t count = 0;
    for (uint32_t i = 0; i < job->snapshot->instance_count; i++)
        count += job->bvh->is_joined[i];
    if (count == 0)
        return TRC_OK;
    if (!joins_the_same(job))
        return joined_build(job, count);
    job->bvh->joined = job->before->bvh->joined;
    atomic_fetch_add(&job->bvh->joined->refs, 1);
    return TRC_OK;
}

/* World box of a box under all keys of an instance. M(t) p(t) is a convex combination of the keys'
 * images of points of the box, so the hull of the images of its corners holds it at all times. */
static struct box instance_box(const struct trc_instance *instance, const struct trc_tree *tree) {
    float lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t key = 0; key < instance->key_count; key++)
        for (int corner = 0; corner < 8; corner++) {
            const float *m = instance->object_to_world[key].m;
            const double p[3] = {(corner & 1 ? tree->upper : tree->lower)[0],
                                 (corner & 2 ? tree->upper : tree->lower)[1],
                                 (corner & 4 ? tree->upper : tree->lower)[2]};
            for (int i = 0; i < 3; i++) {
                const double x =
                    m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
                lower[i] = fminf(lower[i], nextafterf((float)x, -INFINITY));
                upper[i] = fmaxf(upper[i], nextafterf((float)x, INFINITY));
            }
        }
    return (struct box){f4_load3(lower), f4_load3(upper)};
}

static uint32_t items_collect(struct create_job *job, struct trc_item *items, struct box *boxes) {
    const struct trc_snapshot *s = job->snapshot;
    const struct trc_bvh *bvh = job->bvh;
    const struct trc_tree *joined = bvh->joined ? &bvh->joined->tree : NULL;
    uint32_t count = 0;
    if (joined && joined->root != TRC_REF_EMPTY) {
        items[0] = (struct trc_item){joined, TRC_NO_HIT, TRC_VISIBLE_ALL};
        boxes[0] = (struct box){f4_load3(joined->lower), f4_load3(joined->upper)};
        count = 1;
    }
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        if (bvh->is_joined[i] || !instance->visibility)
            continue;
        const struct trc_own_tree *own = bvh->own ? bvh->own[i] : NULL;
        const struct trc_tree *tree = own ? &own->blas.tree : &bvh->blas[instance->mesh]->tree;
        if (tree->root == TRC_REF_EMPTY)
            continue;
        items[count] = (struct trc_item){tree, i, instance->visibility};
        boxes[count] = own ? (struct box){f4_load3(tree->lower), f4_load3(tree->upper)}
                           : instance_box(instance, tree);
        count++;
    }
    return count;
}

/* The tree over count items. */
static trc_status items_build(struct create_job *job, const struct trc_item *items,
                              const struct box *boxes, uint32_t count) {
    struct trc_bvh *bvh = job->bvh;
    struct trc_ref *refs = trc_alloc(2 * ((size_t)count + 1), sizeof *refs);
    struct trc_part_triangle *order = trc_alloc((size_t)count + 1, sizeof *order);
    struct trc_range all = {.refs = refs, .spare = refs + count, .count = count};
    struct trc_topology topology;
    trc_status status = TRC_OK;
    if (!refs || !order)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u instances", count);
    for (uint32_t i = 0; i < count && status == TRC_OK; i++) {
        refs[i] = (struct trc_ref){.primitive = i};
        f4_store3(refs[i].lower, boxes[i].lower);
        f4_store3(refs[i].upper, boxes[i].upper);
    }
    if (status == TRC_OK) {
        trc_range_measure(&all);
        status =
            trc_topology_build(&all, 1, job->pool, job->options->cancel, order, NULL, &topology);
    }
    if (status == TRC_OK) {
        status = trc_tree_fill_top(&topology, order, count, items, boxes, bvh->items, &bvh->top);
        trc_topology_destroy(&topology);
    }
    trc_free(order);
    trc_free(refs);
    if (status != TRC_OK)
        return status;
    for (int axis = 0; axis < 3; axis++) {
        bvh->top.lower[axis] = count ? all.bounds.lower[axis] : INFINITY;
        bvh->top.upper[axis] = count ? all.bounds.upper[axis] : -INFINITY;
        if (count)
            bvh->top.extent = fmaxf(
                bvh->top.extent, fmaxf(fabsf(bvh->top.lower[axis]), fabsf(bvh->top.upper[axis])));
    }
    return TRC_OK;
}

static trc_status top_build(struct create_job *job) {
    struct trc_bvh *bvh = job->bvh;
    const uint32_t capacity = job->snapshot->instance_count + 1;
    struct trc_item *items = trc_alloc(capacity, sizeof *items);
    struct box *boxes = trc_alloc(capacity, sizeof *boxes);
    bvh->items = trc_alloc(capacity, sizeof *bvh->items);
    trc_status status = TRC_OK;
    if (!items || !boxes || !bvh->items)
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u instances", capacity - 1);
    if (status == TRC_OK) {
        const uint32_t count = items_collect(job, items, boxes);
        if (count == 1 && items[0].instance == TRC_NO_HIT) {
            bvh->tree = &bvh->joined->tree;
        } else {
            status = items_build(job, items, boxes, count);
            bvh->tree = &bvh->top;
        }
    }
    trc_free(items);
    trc_free(boxes);
    return status;
}

static trc_status slots_collect(struct create_job *job) {
    const struct trc_snapshot *s = job->snapshot;
    uint64_t total = 0;
    for (uint32_t i = 0; i < s->instance_count; i++)
        total += s->instances[i].material_count;
    const uint32_t count = s->instance_count ? s->instance_count : 1;
    job->bvh->is_joined = trc_alloc_zeroed(count, 1);
    job->is_restless = trc_alloc_zeroed(count, 1);
    job->transparent = trc_alloc_zeroed(total ? total : 1, 1);
    job->first_slot = trc_alloc(count, sizeof *job->first_slot);
    if (!job->bvh->is_joined || !job->is_restless || !job->transparent || !job->first_slot)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u instances", s->instance_count);
    uint32_t slot = 0;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        job->first_slot[i] = slot;
        for (uint32_t k = 0; k < s->instances[i].material_count; k++, slot++)
            job->transparent[slot] =
                trc_material_is_clear(s->materials[s->instances[i].materials[k]]);
    }
    return TRC_OK;
}

static trc_status users_collect(struct create_job *job) {
    const struct trc_snapshot *s = job->snapshot;
    job->first_user = trc_alloc(s->mesh_count ? s->mesh_count : 1, sizeof *job->first_user);
    job->next_user = trc_alloc(s->instance_count ? s->instance_count : 1, sizeof *job->next_user);
    if (!job->first_user || !job->next_user)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for %u instances", s->instance_count);
    for (uint32_t mesh = 0; mesh < s->mesh_count; mesh++)
        job->first_user[mesh] = TRC_NO_HIT;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        job->next_user[i] = job->first_user[s->instances[i].mesh];
        job->first_user[s->instances[i].mesh] = i;
    }
    return TRC_OK;
}

static trc_status trees_build(struct create_job *job, struct trc_mesh *const *replaced) {
    const struct trc_snapshot *s = job->snapshot;
    trc_status status = slots_collect(job);
    if (status == TRC_OK)
        status = users_collect(job);
    if (status == TRC_OK)
        status = trc_former_open(job->before ? job->before->bvh : NULL, &job->former);
    if (status == TRC_OK) {
        join_select(job);
        restless_select(job);
        status = joined_obtain(job);
    }
    for (uint32_t i = 0; i < s->instance_count && status == TRC_OK; i++) {
        const struct trc_instance *instance = &s->instances[i];
        if (job->bvh->is_joined[i])
            continue;
        if (instance->is_thin || job->is_restless[i])
            status = own_obtain(job, i);
        else if (!job->bvh->blas[instance->mesh])
            status = blas_obtain(job, instance->mesh, replaced);
    }
    if (status == TRC_OK)
        status = top_build(job);
    trc_free(job->is_restless);
    trc_free(job->transparent);
    trc_free(job->first_slot);
    trc_free(job->first_user);
    trc_free(job->next_user);
    trc_former_close(&job->former);
    return status;
}

static void stats_add(const struct trc_tree *tree, struct trc_bvh_build_stats *stats) {
    stats->bytes += tree->bytes;
    stats->skipped_triangles += tree->skipped_count - tree->thin_count;
}

static void stats_collect(const struct trc_bvh *bvh, struct trc_bvh_build_stats *stats) {
    stats->bytes = bvh->top.bytes;
    if (bvh->joined)
        stats_add(&bvh->joined->tree, stats);
    for (uint32_t i = 0; i < bvh->blas_count; i++)
        if (bvh->blas[i])
            stats_add(&bvh->blas[i]->tree, stats);
    for (uint32_t i = 0; bvh->own && i < bvh->instance_count; i++)
        if (bvh->own[i])
            stats_add(&bvh->own[i]->blas.tree, stats);
    memcpy(stats->bounds_lower, bvh->tree->lower, sizeof stats->bounds_lower);
    memcpy(stats->bounds_upper, bvh->tree->upper, sizeof stats->bounds_upper);
}

trc_status trc_bvh_create(const struct trc_snapshot *snapshot, const struct trc_snapshot *before,
                          struct trc_mesh *const *replaced, const struct trc_bvh_options *options,
                          struct trc_pool *pool, struct trc_bvh **bvh_out,
                          struct trc_bvh_build_stats *stats_out) {
    const double start = trc_seconds();
    struct trc_bvh_build_stats stats = {0};
    struct trc_bvh *bvh = trc_alloc_zeroed(1, sizeof *bvh);
    if (!bvh)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the trees");
    bvh->top.root = TRC_REF_EMPTY;
    bvh->instance_count = snapshot->instance_count;
    bvh->blas_count = snapshot->mesh_count;
    bvh->blas = trc_alloc_zeroed(bvh->blas_count ? bvh->blas_count : 1, sizeof *bvh->blas);
    struct create_job job = {.snapshot = snapshot,
                             .before = before,
                             .options = options,
                             .pool = pool,
                             .bvh = bvh,
                             .stats = &stats};
    trc_status status = bvh->blas ? trees_build(&job, replaced)
                                  : trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the trees");
    if (status != TRC_OK) {
        trc_bvh_destroy(bvh);
        return status;
    }
    stats_collect(bvh, &stats);
    stats.seconds = trc_seconds() - start;
    *stats_out = stats;
    *bvh_out = bvh;
    return TRC_OK;
}

bool trc_bvh_has_own_tree(const struct trc_bvh *bvh, uint32_t instance) {
    return bvh->own && bvh->own[instance];
}

void trc_bvh_destroy(struct trc_bvh *bvh) {
    if (!bvh)
        return;
    for (uint32_t i = 0; bvh->blas && i < bvh->blas_count; i++)
        trc_blas_release(bvh->blas[i]);
    for (uint32_t i = 0; bvh->own && i < bvh->instance_count; i++)
        if (bvh->own[i])
            trc_blas_release(&bvh->own[i]->blas);
    trc_tree_destroy(&bvh->top);
    joined_release(bvh->joined);
    trc_free(bvh->items);
    trc_free(bvh->blas);
    trc_free(bvh->own);
    trc_free(bvh->is_joined);
    trc_free(bvh);
}
