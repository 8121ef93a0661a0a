#include "bvh/block.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"

/* What is filled next, backwards, and what refits know of it, are fetched so far ahead. */
#define PREFETCH_BYTES 2048
#define PREFETCH_SLOTS 32
/* Of a plan, for each slot: three corners, and a quarter of what the leaf has. */
#define PLAN_HEAD_BYTES 4
/* What is left of a block's head, and of its end, to a whole number of floats and of units. */
#define HEAD_UNIT sizeof(float)

static size_t block_bytes(uint32_t triangles, uint32_t vertices, uint32_t key_count) {
    const size_t bytes =
        trc_block_head_bytes(triangles) + (size_t)key_count * vertices * 3 * sizeof(float);
    return (bytes + TRC_BLOCK_UNIT - 1) / TRC_BLOCK_UNIT * TRC_BLOCK_UNIT;
}

/* Numbers the vertices of the triangles from a slot on: corners as in a block, and the vertices,
 * whose count is returned. Where they are more than kernels load at once, each corner has its own.
 */
static uint32_t vertices_number(const struct trc_fill *fill, uint32_t first, uint32_t count,
                                uint8_t corners[], uint32_t vertices[]) {
    const uint32_t *indices = fill->parts->mesh->indices;
    uint32_t own[TRC_BLOCK_VERTICES], known = 0;
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t corner = 0; corner < 3; corner++)
            own[corner * count + i] =
                indices[3 * (size_t)trc_fill_triangle(fill, first + i) + corner];
    for (uint32_t i = 0; i < 3 * count; i++) {
        uint32_t number = 0;
        while (number < known && vertices[number] != own[i])
            number++;
        vertices[number] = own[i];
        known += number == known;
        corners[i] = (uint8_t)number;
    }
    if (known <= TRC_BLOCK_LOAD)
        return known;
    for (uint32_t i = 0; i < 3 * count; i++) {
        vertices[i] = own[i];
        corners[i] = (uint8_t)i;
    }
    return 3 * count;
}

/* ---- plans ---- */

struct plan_job {
    const struct trc_fill *fill;
    uint32_t node_count, key_count;
    struct trc_block_plan *plan;
};

static void leaf_plan(const struct plan_job *job, uint32_t ref) {
    struct trc_block_plan *plan = job->plan;
    const uint32_t first = trc_fill_first(job->fill, ref), count = trc_leaf_count(ref);
    uint8_t *head = plan->heads + PLAN_HEAD_BYTES * (size_t)first;
    head[0] =
        (uint8_t)vertices_number(job->fill, first, count, head + 1, plan->vertices->index[first]);
    plan->places[first] = (uint32_t)(block_bytes(count, head[0], job->key_count) / TRC_BLOCK_UNIT);
}

static void plan_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct plan_job *job = context;
    const uint32_t begin = index * TRC_FILL_NODES, left = job->node_count - begin;
    const uint32_t end = begin + (left < TRC_FILL_NODES ? left : TRC_FILL_NODES);
    for (uint32_t n = begin; n < end; n++) {
        const uint32_t *children = trc_fill_children(job->fill, n);
        for (int i = 0; i < TRC_NODE_WIDTH; i++)
            if (trc_ref_is_leaf(children[i]))
                leaf_plan(job, children[i]);
    }
}

trc_status trc_block_plan_make(const struct trc_fill *fill, uint32_t node_count, uint32_t root,
                               uint32_t slot_count, uint32_t key_count, struct trc_pool *pool,
                               struct trc_block_plan *plan) {
    struct plan_job job = {fill, node_count, key_count, plan};
    uint64_t total = 0;
    *plan = (struct trc_block_plan){
        .places = trc_alloc_zeroed((size_t)slot_count + 1, sizeof *plan->places),
        .heads = trc_alloc((size_t)slot_count + 1, PLAN_HEAD_BYTES),
        .vertices = trc_slot_vertices_alloc(slot_count),
    };
    if (!plan->places || !plan->heads || !plan->vertices)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the leaves of %u triangles",
                        slot_count);
    trc_pool_run(pool, trc_fill_tasks(node_count), plan_task, &job);
    if (trc_ref_is_leaf(root))
        leaf_plan(&job, root);
    for (uint32_t slot = 0; slot < slot_count; slot++) {
        const uint32_t units = plan->places[slot];
        plan->places[slot] = (uint32_t)total;
        total += units;
        if (total > TRC_REF_INDEX_MASK)
            return trc_fail(TRC_ERROR_TOO_LARGE,
                            "%u triangles at %u keys in one tree take more than 4 GiB", slot_count,
                            key_count);
    }
    plan->unit_count = (uint32_t)total;
    return TRC_OK;
}

void trc_block_plan_destroy(struct trc_block_plan *plan) {
    trc_free(plan->places);
    trc_free(plan->heads);
    trc_slot_vertices_release(plan->vertices);
    *plan = (struct trc_block_plan){0};
}

/* ---- filling ---- */

void trc_block_begin(const struct trc_fill *fill, uint32_t from, uint32_t ref) {
    const uint32_t count = trc_leaf_count(ref), key_count = fill->tree->key_count;
    const size_t head_bytes = trc_block_head_bytes(count);
    struct trc_block *block = trc_leaf_block(fill->tree, ref);
    if (!fill->plan) {
        memcpy(block, trc_leaf_block(fill->from, from), head_bytes);
    } else {
        const uint32_t first = trc_fill_first(fill, from);
        const uint8_t *head = fill->plan->heads + PLAN_HEAD_BYTES * (size_t)first;
        memset((uint8_t *)block + head_bytes - HEAD_UNIT, 0, HEAD_UNIT);
        block->first_slot = first;
        block->vertex_count = head[0];
        memcpy(block->corners, head + 1, 3 * (size_t)count);
    }
    const size_t bytes = block_bytes(count, block->vertex_count, key_count);
    uint8_t *end = (uint8_t *)trc_block_rows(block, count, key_count);
    for (; end < (uint8_t *)block + bytes; end += HEAD_UNIT)
        memset(end, 0, HEAD_UNIT);
}

const uint32_t *trc_block_prepare(struct trc_fill *fill, uint32_t ref,
                                  uint32_t memory[TRC_BLOCK_VERTICES]) {
    const struct trc_block *block = trc_leaf_block(fill->tree, ref);
    const uint32_t count = trc_leaf_count(ref), first = block->first_slot;
    trc_leaf_prepare(fill, ref);
    if (fill->known) {
        __builtin_prefetch(fill->known->index[first < PREFETCH_SLOTS ? 0 : first - PREFETCH_SLOTS]);
        return fill->known->index[first];
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t triangle = trc_fill_triangle(fill, first + i);
        for (uint32_t corner = 0; corner < 3; corner++)
            memory[block->corners[corner * count + i]] =
                fill->parts->mesh->indices[3 * (size_t)triangle + corner];
    }
    if (fill->learnt)
        memcpy(fill->learnt->index[first], memory, block->vertex_count * sizeof memory[0]);
    return memory;
}

/* Four vertices at a time: the last four, some for the second time, or fewer. */
bool trc_block_fill(const struct trc_fill *fill, uint32_t ref, const uint32_t *vertices,
                    uint32_t key, float lower_out[3], float upper_out[3]) {
    const struct trc_part *part = fill->parts;
    const struct trc_block *block = trc_leaf_block(fill->tree, ref);
    const uint32_t count = block->vertex_count, last = count > 4 ? count - 4 : 0;
    const float *positions = trc_part_positions(part, key);
    float *rows = trc_block_rows(block, trc_leaf_count(ref), key);
    f4 lower[3], upper[3], sum = f4_set(0.0f);
    trc_fetch((const char *)rows - PREFETCH_BYTES, 3 * count * sizeof *rows);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f4_set(INFINITY);
        upper[axis] = f4_set(-INFINITY);
    }
    for (uint32_t i = 0;; i = i + 4 < last ? i + 4 : last) {
        f4 p[4];
        for (uint32_t j = 0; j < 4; j++) {
            const uint32_t vertex = vertices[i + (j < count ? j : count - 1)];
            p[j] = trc_part_point(part, f4_load4(positions + 3 * (size_t)vertex));
        }
        f4_transpose(p);
        for (uint32_t axis = 0; axis < 3; axis++) {
            lower[axis] = f4_min(p[axis], lower[axis]);
            upper[axis] = f4_max(p[axis], upper[axis]);
            sum += p[axis];
            if (count < 4)
                memcpy(rows + axis * count, &p[axis], count * sizeof *rows);
            else
                f4_store4(rows + axis * count + i, p[axis]);
        }
        if (i == last)
            break;
    }
    const struct box box = box_around4(lower, upper);
    f4_store3(lower_out, box.lower);
    f4_store3(upper_out, box.upper);
    return i4_all(f4_abs(sum) < f4_set(INFINITY));
}
