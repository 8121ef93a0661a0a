/* Leaves: slots, and the vertices of their triangles, four side by side in the lanes. */
#include "bvh/leaf.h"

#include <math.h>
#include <string.h>

#include "bvh/tree.h"
#include "core/core.h"

/* What is fetched so far ahead: what refits know of slots, and the vertices that are filled. */
#define PREFETCH_SLOTS 32
#define PREFETCH_VERTEX_BYTES 2048

/* ---- triangles of meshes ---- */

/* [corner][axis] */
struct triangles4 {
    f4 v[3][3];
};

/* From triangles with their corners. */
static inline void triangles4_turn(const f4 triangle[4][3], struct triangles4 *out) {
    for (int corner = 0; corner < 3; corner++) {
        f4 rows[4];
        for (int i = 0; i < 4; i++)
            rows[i] = triangle[i][corner];
        f4_transpose(rows);
        for (int axis = 0; axis < 3; axis++)
            out->v[corner][axis] = rows[axis];
    }
}

/* Whether floats tell of all four that their corners are not on a line: nearly always. They do not
 * where the square of a sine is below this or edges are so short that products underflow. A
 * component of the cross product is off by less than 4 half-ulps of both its products, so the sine
 * by less than 4e-7. */
#define BENT_SINE_SQUARED 1e-10f
static inline bool triangles4_are_bent(const struct triangles4 *t) {
    f4 p[3], q[3], n = f4_set(0.0f);
    for (int axis = 0; axis < 3; axis++) {
        p[axis] = t->v[1][axis] - t->v[0][axis];
        q[axis] = t->v[2][axis] - t->v[0][axis];
    }
    for (int axis = 0; axis < 3; axis++) {
        const int next = (axis + 1) % 3;
        const f4 x = p[axis] * q[next] - p[next] * q[axis];
        n += x * x;
    }
    const f4 p_squared = p[0] * p[0] + p[1] * p[1] + p[2] * p[2],
             q_squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
    return i4_all(n > f4_set(BENT_SINE_SQUARED) * p_squared * q_squared);
}

/* Whether a triangle's corners, by double arithmetic, lie on a line. */
static inline bool is_on_a_line(const f4 corner[3]) {
    double p[3], q[3];
    for (int i = 0; i < 3; i++) {
        p[i] = (double)corner[1][i] - corner[0][i];
        q[i] = (double)corner[2][i] - corner[0][i];
    }
    return p[1] * q[2] == p[2] * q[1] && p[2] * q[0] == p[0] * q[2] && p[0] * q[1] == p[1] * q[0];
}

/* A triangle of a part as it stands in the tree. Corners on a line (of meshes at rest), which are
 * asked for only where they may be, become one point, which no ray hits, where rounding would give
 * them an area. */
static inline void triangle_place(const struct trc_part *part, bool is_bent, f4 corner[3]) {
    const bool is_line = !is_bent && is_on_a_line(corner);
    for (int v = 0; v < 3; v++)
        corner[v] = trc_part_point(part, corner[v]);
    if (is_line)
        corner[1] = corner[2] = corner[0];
}

/* The triangles of those parts, alike in their number of keys, with those vertices. */
static inline void triangles4_load(const struct trc_part *const part[4],
                                   const uint32_t *const index[4], uint32_t key,
                                   struct triangles4 *out) {
    f4 p[4][3];
    bool is_placed = false;
    for (int i = 0; i < 4; i++) {
        const float *positions = trc_part_positions(part[i], key);
        is_placed = is_placed || part[i]->transform;
        for (int v = 0; v < 3; v++)
            p[i][v] = f4_load4(positions + 3 * (size_t)index[i][v]);
    }
    triangles4_turn(p, out);
    const bool is_bent = part[0]->mesh->key_count > 1 || triangles4_are_bent(out);
    if (is_bent && !is_placed)
        return;
    for (int i = 0; i < 4; i++)
        triangle_place(part[i], is_bent, p[i]);
    triangles4_turn(p, out);
}

/* ---- leaves ---- */

static bool part_is_transparent(const struct trc_part *part, uint32_t triangle) {
    if (!part->transparent)
        return false;
    const uint32_t slot = part->mesh->material_index ? part->mesh->material_index[triangle] : 0;
    return part->transparent[slot < part->slot_count ? slot : part->slot_count - 1] != 0;
}

/* The part of what stands in the slot of a new tree. */
static inline const struct trc_part *slot_part(const struct trc_fill *fill, uint32_t slot) {
    return &fill->parts[fill->triangles[slot].part & TRC_PART_INDEX_MASK];
}

/* What a slot says of a piece of a curve. */
static uint32_t piece_word(const struct trc_mesh *mesh, uint32_t piece) {
    return mesh->strands[piece] | (trc_piece_is_first(mesh, piece) ? TRC_SLOT_FIRST : 0u) |
           (trc_piece_is_last(mesh, piece) ? TRC_SLOT_LAST : 0u);
}

/* What stands in the slot of a new tree. */
static void slot_fill(struct trc_fill *fill, uint32_t slot) {
    const uint32_t triangle = fill->triangles[slot].triangle;
    const struct trc_part *part = slot_part(fill, slot);
    const bool transparent = part_is_transparent(part, triangle);
    const uint32_t word = part->mesh->strands ? piece_word(part->mesh, triangle) : part->instance;
    fill->tree->slots->slots[slot] =
        (struct trc_slot){word | (transparent ? TRC_SLOT_TRANSPARENT : 0u), triangle};
    if (transparent)
        atomic_store_explicit(&fill->has_transparent, true, memory_order_relaxed);
}

/* The slot's part, and the three vertices of its triangle there. */
static inline const struct trc_part *slot_source(const struct trc_fill *fill, uint32_t slot,
                                                 const uint32_t **index_out) {
    const struct trc_part *part = fill->from ? fill->parts : slot_part(fill, slot);
    *index_out = fill->known
                     ? fill->known->index[slot]
                     : part->mesh->indices + 3 * (size_t)fill->tree->slots->slots[slot].triangle;
    return part;
}

void trc_leaf_prepare(struct trc_fill *fill, uint32_t ref) {
    const uint32_t first = trc_leaf_first(fill->tree, ref), count = trc_leaf_count(ref);
    const bool learns = fill->learnt && !trc_tree_has_blocks(fill->tree);
    for (uint32_t slot = first; !fill->from && slot < first + count; slot++)
        slot_fill(fill, slot);
    for (uint32_t slot = first; learns && slot < first + count; slot++) {
        const uint32_t *index;
        (void)slot_source(fill, slot, &index);
        memcpy(fill->learnt->index[slot], index, sizeof fill->learnt->index[slot]);
    }
}

/* The triangles of four slots from there on; of fewer, the last stands in the lanes left. */
static inline void slots_load(const struct trc_fill *fill, uint32_t slot, uint32_t count,
                              uint32_t key, struct triangles4 *out) {
    const struct trc_part *part[4];
    const uint32_t *index[4];
    for (uint32_t i = 0; i < 4; i++)
        part[i] = slot_source(fill, slot + (i < count ? i : count - 1), &index[i]);
    triangles4_load(part, index, key, out);
}

/* The same of a refit that knows their vertices. */
static inline void known_load(const struct trc_fill *fill, uint32_t slot, uint32_t count,
                              uint32_t key, struct triangles4 *out) {
    const uint32_t(*known)[3] = fill->known->index + slot;
    const struct trc_part *const part[4] = {fill->parts, fill->parts, fill->parts, fill->parts};
    const uint32_t *index[4];
    for (uint32_t i = 0; i < 4; i++)
        index[i] = known[i < count ? i : count - 1];
    __builtin_prefetch(known[PREFETCH_SLOTS]);
    triangles4_load(part, index, key, out);
}

/* Stores them into the rows of a leaf of count triangles. The lanes left of fewer than four go
 * where the next row will be, or, at its end, nowhere. */
static inline void rows_store(float *row, uint32_t count, const struct triangles4 *t) {
    const int whole = count >= 4 ? 9 : count > 1 ? 8 : 6; /* rows with room for four */
    for (int k = 0; k < 9; k++, row += count)
        if (k < whole)
            f4_store4(row, t->v[k / 3][k % 3]);
        else
            memcpy(row, &t->v[k / 3][k % 3], count * sizeof *row);
}

/* The box of a leaf's pieces of curves, as trc_leaf_fill. */
static bool pieces_bound(const struct trc_fill *fill, uint32_t ref, uint32_t key,
                         float lower_out[3], float upper_out[3]) {
    const uint32_t first = trc_ref_index(ref), count = trc_leaf_count(ref);
    f4 lower = f4_set(INFINITY), upper = f4_set(-INFINITY);
    bool is_finite = true;
    for (uint32_t slot = first; slot < first + count; slot++) {
        f4 p[2];
        float r[2];
        trc_piece_ends(fill->parts->mesh, fill->tree->slots->slots[slot].triangle, key, p, r);
        for (int end = 0; end < 2; end++) {
            lower = f4_min(p[end] - f4_set(r[end]), lower);
            upper = f4_max(p[end] + f4_set(r[end]), upper);
            is_finite &= i4_all(f4_abs(p[end]) + f4_set(r[end]) < f4_set(INFINITY));
        }
    }
    f4_store3(lower_out, lower);
    f4_store3(upper_out, upper);
    return is_finite;
}

/* Four triangles at a time: of five to eight the last four, some for the second time. */
bool trc_leaf_fill(const struct trc_fill *fill, uint32_t ref, uint32_t key, float lower_out[3],
                   float upper_out[3]) {
    if (fill->tree->shape)
        return pieces_bound(fill, ref, key, lower_out, upper_out);
    const uint32_t first = trc_ref_index(ref), count = trc_leaf_count(ref);
    const uint32_t last = count > 4 ? count - 4 : 0;
    float *v = trc_leaf_vertices(fill->tree, ref);
    f4 lower[3], upper[3], sum = f4_set(0.0f);
    trc_fetch((char *)v + PREFETCH_VERTEX_BYTES, count * TRC_TRIANGLE_FLOATS * sizeof *v);
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = f4_set(INFINITY);
        upper[axis] = f4_set(-INFINITY);
    }
    for (uint32_t i = 0;; i = last) {
        struct triangles4 t;
        if (fill->known)
            known_load(fill, first + i, count, key, &t);
        else
            slots_load(fill, first + i, count, key, &t);
        for (int axis = 0; axis < 3; axis++) {
            const f4 a = t.v[0][axis], b = t.v[1][axis], c = t.v[2][axis];
            lower[axis] = f4_min(f4_min(a, f4_min(b, c)), lower[axis]);
            upper[axis] = f4_max(f4_max(a, f4_max(b, c)), upper[axis]);
            sum += a + b + c;
        }
        rows_store(v + i, count, &t);
        if (i == last)
            break;
    }
    struct box box = box_around4(lower, upper);
    if (fill->boxes && (fill->triangles[first].part & TRC_PART_CLIPPED))
        box = box_common(box, fill->boxes[first]);
    f4_store3(lower_out, box.lower);
    f4_store3(upper_out, box.upper);
    return i4_all(f4_abs(sum) < f4_set(INFINITY));
}

/* ---- vertices of slots ---- */

struct trc_slot_vertices *trc_slot_vertices_alloc(uint32_t slot_count) {
    struct trc_slot_vertices *v = trc_alloc(sizeof *v + slot_count * sizeof v->index[0], 1);
    if (v)
        atomic_init(&v->refs, 1);
    return v;
}

void trc_slot_vertices_release(struct trc_slot_vertices *vertices) {
    if (vertices && atomic_fetch_sub(&vertices->refs, 1) == 1)
        trc_free(vertices);
}
