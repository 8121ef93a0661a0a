#include "bvh_check.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "bvh/part.h"
#include "bvh/thin.h"
#include "bvh/tree.h"
#include "core/core.h"

struct checker {
    const struct trc_bvh *bvh;
    const struct trc_snapshot *snapshot;
    char *message;
    uint32_t capacity;
};

/* One tree under check. */
struct tree_check {
    struct checker *checker;
    const char *name; /* for messages */
    const struct trc_tree *tree;
    const struct trc_part *parts; /* by instance number: joined; one part: a mesh's own */
    const uint64_t *first;        /* of each part: its triangles in seen */
    bool is_joined;
    uint8_t *nodes, *slots; /* reached */
    uint8_t *seen;          /* triangles found in leaves */
    uint64_t seen_count;
    uint64_t *covered; /* trees with pieces: points of each triangle in the boxes of its leaves */
};

__attribute__((format(printf, 2, 3))) static bool complain(struct checker *c, const char *format,
                                                           ...) {
    va_list arguments;
    va_start(arguments, format);
    if (c->message && c->capacity)
        vsnprintf(c->message, c->capacity, format, arguments);
    va_end(arguments);
    return false;
}

/* False for NaN anywhere. An empty inner box is inside everything. */
static bool box_holds(const float lower[3], const float upper[3], const float inner_lower[3],
                      const float inner_upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        if (inner_lower[axis] > inner_upper[axis])
            return true;
        if (!(lower[axis] <= inner_lower[axis] && inner_upper[axis] <= upper[axis]))
            return false;
    }
    return true;
}

/* A packed bound, rounded away from what it bounds. */
static float packed_bound(const struct trc_packed_boxes *boxes, uint32_t axis, uint32_t side,
                          uint32_t child) {
    const double x =
        boxes->origin[axis] + (double)boxes->step[axis] * boxes->bytes[axis][side][child];
    const float nearest = (float)x;
    if (side)
        return nearest < x ? nextafterf(nearest, INFINITY) : nearest;
    return nearest > x ? nextafterf(nearest, -INFINITY) : nearest;
}

static void child_box(const struct trc_tree *tree, uint32_t node, uint32_t child, uint32_t key,
                      float lower[3], float upper[3]) {
    for (uint32_t axis = 0; axis < 3; axis++) {
        if (tree->key_count > 1) {
            const struct trc_packed_boxes *boxes = trc_node_packed(tree, node, key);
            lower[axis] = packed_bound(boxes, axis, 0, child);
            upper[axis] = packed_bound(boxes, axis, 1, child);
        } else {
            const float *b = trc_node_bounds(tree, node);
            lower[axis] = b[16 * axis + child];
            upper[axis] = b[16 * axis + 8 + child];
        }
    }
}

/* ---- leaves ---- */

/* The part of a used slot, or NULL with a message. */
static const struct trc_part *slot_part(struct tree_check *t, uint32_t slot) {
    const struct trc_snapshot *s = t->checker->snapshot;
    const uint32_t word = t->tree->slots->slots[slot].instance;
    const uint32_t instance = word & TRC_SLOT_INSTANCE_MASK;
    const uint32_t triangle = t->tree->slots->slots[slot].triangle;
    const struct trc_part *part = NULL;
    if (!t->is_joined && instance == 0)
        part = t->parts;
    if (t->is_joined && instance < s->instance_count)
        part = &t->parts[instance];
    if (!part || !part->mesh) {
        complain(t->checker, "%s: slot %u: instance %u does not belong here", t->name, slot,
                 instance);
        return NULL;
    }
    if (triangle >= part->mesh->triangle_count) {
        complain(t->checker, "%s: slot %u: triangle %u of %u", t->name, slot, triangle,
                 part->mesh->triangle_count);
        return NULL;
    }
    return part;
}

/* A triangle at a key, as a leaf holds it: corners on a line, of meshes at rest, become one point.
 */
static void triangle_of(const struct trc_part *part, uint32_t triangle, uint32_t key,
                        float out[3][3]) {
    f4 corner[3];
    double p[3], q[3];
    trc_part_corners_unplaced(part, part->mesh->indices + 3 * (size_t)triangle, key, corner);
    for (int i = 0; i < 3; i++) {
        p[i] = (double)corner[1][i] - corner[0][i];
        q[i] = (double)corner[2][i] - corner[0][i];
    }
    const bool is_line = part->mesh->key_count < 2 && p[1] * q[2] == p[2] * q[1] &&
                         p[2] * q[0] == p[0] * q[2] && p[0] * q[1] == p[1] * q[0];
    for (int v = 0; v < 3; v++)
        f4_store3(out[v], trc_part_point(part, corner[is_line ? 0 : v]));
}

/* A corner of the triangle in a leaf's slot i, at a key. */
static void leaf_corner(const struct trc_tree *tree, uint32_t ref, uint32_t i, uint32_t corner,
                        uint32_t key, float out[3]) {
    const uint32_t count = trc_leaf_count(ref);
    const struct trc_block *block = trc_leaf_block(tree, ref);
    for (uint32_t axis = 0; axis < 3; axis++)
        out[axis] = trc_tree_has_blocks(tree)
                        ? trc_block_rows(
                              block, count,
                              key)[axis * block->vertex_count + block->corners[corner * count + i]]
                        : trc_leaf_vertices(tree, ref)[(3 * corner + axis) * count + i];
}

/* The vertices in a leaf's slot i are those of a triangle of the part, and valid. */
static bool check_vertices(struct tree_check *t, uint32_t ref, uint32_t i,
                           const struct trc_part *part, uint32_t triangle) {
    for (uint32_t key = 0; key < t->tree->key_count; key++) {
        float triangle_corners[3][3];
        triangle_of(part, triangle, key, triangle_corners);
        for (uint32_t corner = 0; corner < 3; corner++) {
            const float *expected = triangle_corners[corner];
            float actual[3];
            leaf_corner(t->tree, ref, i, corner, key, actual);
            if (memcmp(expected, actual, sizeof actual) != 0)
                return complain(t->checker,
                                "%s: slot %u: corner %u of triangle %u is not the mesh's at key %u",
                                t->name, trc_leaf_first(t->tree, ref) + i, corner, triangle, key);
            if (!trc_point_is_valid(actual))
                return complain(t->checker,
                                "%s: triangle %u has an invalid vertex and is in a leaf", t->name,
                                triangle);
        }
    }
    return true;
}

/* Points of a triangle, of a grid over it, that are looked for in the boxes of its leaves. */
#define POINTS_PER_EDGE 8
#define POINT_COUNT ((POINTS_PER_EDGE + 1) * (POINTS_PER_EDGE + 2) / 2)
#define ALL_POINTS ((1ull << POINT_COUNT) - 1)

/* Which of them a leaf's box has. */
static uint64_t points_within(const float corner[3][3], const float lower[3],
                              const float upper[3]) {
    uint64_t bits = 0, bit = 1;
    for (int i = 0; i <= POINTS_PER_EDGE; i++)
        for (int j = 0; i + j <= POINTS_PER_EDGE; j++, bit <<= 1) {
            const int weight[3] = {i, j, POINTS_PER_EDGE - i - j};
            float p[3];
            for (int axis = 0; axis < 3; axis++) {
                double x = 0.0;
                for (int v = 0; v < 3; v++)
                    x += (double)corner[v][axis] * weight[v];
                p[axis] = (float)(x / POINTS_PER_EDGE);
            }
            if (box_holds(lower, upper, p, p))
                bits |= bit;
        }
    return bits;
}

/* Marks what a leaf's box has of its triangles. */
static void points_cover(struct tree_check *t, uint32_t ref, const float lower[3],
                         const float upper[3]) {
    const uint32_t count = trc_leaf_count(ref);
    for (uint32_t i = 0; i < count; i++) {
        const struct trc_slot slot = trc_leaf_slots(t->tree, ref)[i];
        const uint64_t part = t->is_joined ? slot.instance & TRC_SLOT_INSTANCE_MASK : 0;
        float corner[3][3];
        for (uint32_t k = 0; k < 3; k++)
            leaf_corner(t->tree, ref, i, k, 0, corner[k]);
        t->covered[t->first[part] + slot.triangle] |= points_within(corner, lower, upper);
    }
}

static bool check_leaf(struct tree_check *t, uint32_t ref) {
    const uint32_t first = trc_leaf_first(t->tree, ref), count = trc_leaf_count(ref);
    for (uint32_t i = 0; i < count; i++) {
        const struct trc_part *part = slot_part(t, first + i);
        if (!part)
            return false;
        const uint32_t triangle = t->tree->slots->slots[first + i].triangle;
        uint8_t *seen = &t->seen[t->first[part - t->parts] + triangle];
        if (*seen && !t->tree->has_pieces)
            return complain(t->checker, "%s: triangle %u is in two leaves", t->name, triangle);
        t->seen_count += !*seen;
        *seen = 1;
        if (!check_vertices(t, ref, i, part, triangle))
            return false;
    }
    return true;
}

static void leaf_box(const struct trc_tree *tree, uint32_t ref, uint32_t key, float lower[3],
                     float upper[3]) {
    for (uint32_t axis = 0; axis < 3; axis++) {
        lower[axis] = INFINITY;
        upper[axis] = -INFINITY;
    }
    for (uint32_t i = 0; i < trc_leaf_count(ref); i++)
        for (uint32_t corner = 0; corner < 3; corner++) {
            float p[3];
            leaf_corner(tree, ref, i, corner, key, p);
            for (uint32_t axis = 0; axis < 3; axis++) {
                lower[axis] = fminf(lower[axis], p[axis]);
                upper[axis] = fmaxf(upper[axis], p[axis]);
            }
        }
}

/* The tree of an instance, NULL where only the joined one has it. */
static const struct trc_blas *blas_of(const struct checker *c, uint32_t number) {
    const struct trc_instance *instance = &c->snapshot->instances[number];
    if (c->bvh->own && c->bvh->own[number])
        return &c->bvh->own[number]->blas;
    return c->bvh->is_joined[number] || instance->is_thin ? NULL : c->bvh->blas[instance->mesh];
}

/* ---- items of a top tree ---- */

/* Box of the images of the tree's corners at every key: in double, so that it is no wider than it
 * is. */
static void item_box(const struct trc_snapshot *s, const struct trc_item *item, double lower[3],
                     double upper[3]) {
    static const struct trc_affine identity = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};
    const bool placed = item->instance != TRC_NO_HIT && !s->instances[item->instance].in_world;
    const uint32_t key_count = placed ? s->instances[item->instance].key_count : 1;
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = INFINITY;
        upper[axis] = -INFINITY;
    }
    for (uint32_t key = 0; key < key_count; key++) {
        const float *m =
            (placed ? &s->instances[item->instance].object_to_world[key] : &identity)->m;
        for (int corner = 0; corner < 8; corner++) {
            const double p[3] = {(corner & 1 ? item->tree->upper : item->tree->lower)[0],
                                 (corner & 2 ? item->tree->upper : item->tree->lower)[1],
                                 (corner & 4 ? item->tree->upper : item->tree->lower)[2]};
            for (int i = 0; i < 3; i++) {
                const double x =
                    m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
                lower[i] = fmin(lower[i], x);
                upper[i] = fmax(upper[i], x);
            }
        }
    }
}

/* The box that a top tree's parent keeps for an item (of the whole tree, when it is the root). */
static bool check_item_box(struct tree_check *t, uint32_t slot, const float lower[3],
                           const float upper[3]) {
    double item_lower[3], item_upper[3];
    item_box(t->checker->snapshot, &t->tree->items[slot], item_lower, item_upper);
    for (int axis = 0; axis < 3; axis++)
        if (!((double)lower[axis] <= item_lower[axis] && item_upper[axis] <= (double)upper[axis]))
            return complain(t->checker, "%s: item %u sticks out of its box on axis %d", t->name,
                            slot, axis);
    return true;
}

static bool check_item(struct checker *c, const struct trc_item *item, uint8_t *placed) {
    const struct trc_snapshot *s = c->snapshot;
    if (item->instance == TRC_NO_HIT) {
        if (!c->bvh->joined || item->tree != &c->bvh->joined->tree ||
            item->visibility != TRC_VISIBLE_ALL)
            return complain(c, "the joined tree's item is not right");
        return true;
    }
    if (item->instance >= s->instance_count)
        return complain(c, "an item stands for instance %u of %u", item->instance,
                        s->instance_count);
    const struct trc_instance *instance = &s->instances[item->instance];
    const struct trc_blas *blas = blas_of(c, item->instance);
    if (!blas || item->tree != &blas->tree)
        return complain(c, "the item of instance %u has another tree", item->instance);
    if (item->visibility != instance->visibility)
        return complain(c, "the item of instance %u has visibility %u", item->instance,
                        item->visibility);
    if (placed[item->instance]++)
        return complain(c, "instance %u has two items", item->instance);
    return true;
}

/* ---- nodes ---- */

/* The leaf's block, if it has one, lies within the tree's memory, and its corners are vertices. */
static bool check_block(struct tree_check *t, uint32_t ref) {
    const struct trc_tree *tree = t->tree;
    const uint32_t count = trc_leaf_count(ref);
    const float *end = tree->vertices + tree->vertex_floats;
    if (!trc_tree_has_blocks(tree))
        return true;
    const struct trc_block *block = trc_leaf_block(tree, ref);
    const float *rows = trc_block_rows(block, count, 0);
    if (rows > end || trc_block_rows(block, count, tree->key_count) > end)
        return complain(t->checker, "%s: block of leaf %08x is out of range", t->name, ref);
    for (uint32_t i = 0; i < 3 * count; i++)
        if (block->corners[i] >= block->vertex_count)
            return complain(t->checker, "%s: corner of leaf %08x is out of range", t->name, ref);
    return true;
}

/* ref is new, in range, and comes after its parent. */
static bool check_ref(struct tree_check *t, uint32_t ref, uint32_t parent) {
    const bool is_leaf = (ref & TRC_REF_LEAF) != 0;
    if (is_leaf && !check_block(t, ref))
        return false;
    const uint32_t index = is_leaf ? trc_leaf_first(t->tree, ref) : ref;
    const uint32_t end = index + (is_leaf ? trc_leaf_count(ref) : 1u);
    if (end > (is_leaf ? t->tree->slot_count : t->tree->node_count))
        return complain(t->checker, "%s: reference %08x is out of range", t->name, ref);
    if (!is_leaf && parent != UINT32_MAX && index <= parent)
        return complain(t->checker, "%s: node %u stands before its parent %u", t->name, index,
                        parent);
    uint8_t *reached = is_leaf ? t->slots : t->nodes;
    for (uint32_t i = index; i < end; i++) {
        if (reached[i])
            return complain(t->checker, "%s: reference %08x is reached twice", t->name, ref);
        reached[i] = 1;
    }
    return true;
}

/* What is below ref lies in the box its parent keeps for it, at a key. */
static bool check_box(struct tree_check *t, uint32_t ref, uint32_t key, const float lower[3],
                      const float upper[3]) {
    const uint32_t index = ref & TRC_REF_INDEX_MASK;
    float low[3], high[3];
    if ((ref & TRC_REF_LEAF) && t->tree->is_top)
        return check_item_box(t, index, lower, upper);
    if ((ref & TRC_REF_LEAF) && t->tree->has_pieces) {
        points_cover(t, ref, lower, upper);
        return true;
    }
    if (ref & TRC_REF_LEAF) {
        leaf_box(t->tree, ref, key, low, high);
        if (box_holds(lower, upper, low, high))
            return true;
        return complain(t->checker, "%s: leaf %08x sticks out of its box at key %u", t->name, ref,
                        key);
    }
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        if (trc_node_children(t->tree, index)[i] == TRC_REF_EMPTY)
            continue;
        child_box(t->tree, index, i, key, low, high);
        if (!box_holds(lower, upper, low, high))
            return complain(t->checker, "%s: child %u of node %u sticks out at key %u", t->name, i,
                            index, key);
    }
    return true;
}

/* Whether a box is that of no child. */
static bool is_inverted(const struct trc_tree *tree, uint32_t node, uint32_t child, uint32_t key,
                        int axis) {
    if (tree->key_count < 2) {
        const float *b = trc_node_bounds(tree, node) + 16 * axis + child;
        return b[0] == INFINITY && b[8] == -INFINITY;
    }
    const struct trc_packed_boxes *boxes = trc_node_packed(tree, node, key);
    return boxes->bytes[axis][0][child] == 255 && boxes->bytes[axis][1][child] == 0;
}
/* An unused child must never be entered: its box is inverted. */
static bool check_empty(struct tree_check *t, uint32_t node, uint32_t child) {
    for (uint32_t key = 0; key < t->tree->key_count; key++) {
        for (int axis = 0; axis < 3; axis++)
            if (!is_inverted(t->tree, node, child, key, axis))
                return complain(t->checker, "%s: unused child %u of node %u has a box", t->name,
                                child, node);
    }
    return true;
}

/* Everything below ref; level: nodes on the way to it. */
static bool check_below(struct tree_check *t, uint32_t ref, uint32_t parent, uint32_t level) {
    if (!check_ref(t, ref, parent))
        return false;
    if (ref & TRC_REF_LEAF)
        return t->tree->is_top || check_leaf(t, ref);
    if (level >= TRC_MAX_LEVELS)
        return complain(t->checker, "%s: more than %d levels", t->name, TRC_MAX_LEVELS);
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        const uint32_t child = trc_node_children(t->tree, ref)[i];
        if (child == TRC_REF_EMPTY) {
            if (!check_empty(t, ref, i))
                return false;
            continue;
        }
        if (!check_below(t, child, ref, level + 1))
            return false;
        for (uint32_t key = 0; key < t->tree->key_count; key++) {
            float low[3], high[3];
            child_box(t->tree, ref, i, key, low, high);
            if (!check_box(t, child, key, low, high))
                return false;
        }
    }
    return true;
}

/* Whether all below ref is transparent to shadow rays; *good: as its nodes say. */
static bool check_see_through(struct tree_check *t, uint32_t ref, bool *good) {
    const struct trc_tree *tree = t->tree;
    const uint32_t index = ref & TRC_REF_INDEX_MASK;
    if (ref & TRC_REF_LEAF) {
        bool all = true;
        const uint32_t first = trc_leaf_first(tree, ref);
        for (uint32_t i = first; i < first + trc_leaf_count(ref); i++)
            all &= tree->is_top ? tree->items[i].tree->is_see_through
                                : (tree->slots->slots[i].instance & TRC_SLOT_TRANSPARENT) != 0;
        return all;
    }
    uint32_t marks = 0;
    for (uint32_t i = 0; i < TRC_NODE_WIDTH; i++) {
        const uint32_t child = trc_node_children(tree, index)[i];
        if (child == TRC_REF_EMPTY || check_see_through(t, child, good))
            marks |= 1u << i;
    }
    const bool all = marks == (1u << TRC_NODE_WIDTH) - 1u;
    if (tree->see_through ? tree->see_through[index] != marks : all)
        *good = complain(t->checker, "%s: node %u says %02x of what is transparent, not %02x",
                         t->name, index, tree->see_through ? tree->see_through[index] : 0, marks);
    return all;
}

/* Shape and boxes from the root; every node and slot is reached. */
static bool check_shape(struct tree_check *t) {
    const struct trc_tree *tree = t->tree;
    if (tree->root != TRC_REF_EMPTY) {
        if (!check_below(t, tree->root, UINT32_MAX, 0))
            return false;
        for (uint32_t key = 0; key < tree->key_count; key++)
            if (!check_box(t, tree->root, key, tree->lower, tree->upper))
                return false;
        for (int axis = 0; axis < 3; axis++)
            if (!(fabsf(tree->lower[axis]) <= tree->extent &&
                  fabsf(tree->upper[axis]) <= tree->extent))
                return complain(t->checker, "%s: the extent is too small", t->name);
    }
    bool good = true;
    const bool all = tree->root != TRC_REF_EMPTY && check_see_through(t, tree->root, &good);
    if (good && all != tree->is_see_through)
        return complain(t->checker, "%s: all of it is transparent, or not", t->name);
    for (uint32_t i = 0; good && i < tree->node_count; i++)
        if (!t->nodes[i])
            return complain(t->checker, "%s: node %u is not reached", t->name, i);
    for (uint32_t i = 0; good && i < tree->slot_count; i++)
        if (!t->slots[i])
            return complain(t->checker, "%s: slot %u is not reached", t->name, i);
    return good;
}

/* ---- whole trees ---- */

static bool triangle_is_valid(const struct trc_part *part, uint32_t triangle, uint32_t key_count) {
    for (uint32_t key = 0; key < key_count; key++) {
        f4 corner[3];
        trc_part_corners(part, part->mesh->indices + 3 * (size_t)triangle, key, corner);
        for (uint32_t v = 0; v < 3; v++) {
            float p[3];
            f4_store3(p, corner[v]);
            if (!trc_point_is_valid(p))
                return false;
        }
    }
    return true;
}

/* Triangles that are in no leaf are invalid, and counted. */
static bool check_absent(struct tree_check *t, uint32_t part_count) {
    uint64_t absent = 0;
    for (uint32_t i = 0; i < part_count; i++) {
        const struct trc_part *part = &t->parts[i];
        for (uint32_t k = 0; part->mesh && k < part->mesh->triangle_count; k++) {
            if (t->seen[t->first[i] + k]) {
                if (t->covered && t->covered[t->first[i] + k] != ALL_POINTS)
                    return complain(t->checker, "%s: triangle %u sticks out of its boxes", t->name,
                                    k);
                continue;
            }
            absent++;
            if (triangle_is_valid(part, k, t->tree->key_count))
                return complain(t->checker, "%s: triangle %u is in no leaf", t->name, k);
        }
    }
    if (absent != t->tree->skipped_count || t->seen_count != t->tree->triangle_count)
        return complain(t->checker,
                        "%s: %llu triangles and %llu skipped, the tree says %llu and %llu", t->name,
                        (unsigned long long)t->seen_count, (unsigned long long)absent,
                        (unsigned long long)t->tree->triangle_count,
                        (unsigned long long)t->tree->skipped_count);
    return true;
}

/* Checks a tree over parts; those with a NULL mesh take no part. first: room for part_count. */
static bool check_tree(struct tree_check *t, uint32_t part_count, uint64_t *first) {
    uint64_t total = 0;
    for (uint32_t i = 0; i < part_count; i++) {
        first[i] = total;
        total += t->parts[i].mesh ? t->parts[i].mesh->triangle_count : 0;
    }
    t->first = first;
    t->nodes = trc_alloc_zeroed(t->tree->node_count, 1);
    t->slots = trc_alloc_zeroed(t->tree->slot_count, 1);
    t->seen = trc_alloc_zeroed(total, 1);
    t->covered = t->tree->has_pieces ? trc_alloc_zeroed(total, sizeof *t->covered) : NULL;
    bool good = t->nodes && t->slots && t->seen && (t->covered || !t->tree->has_pieces);
    if (!good)
        complain(t->checker, "no memory to check a tree");
    good = good && check_shape(t) && (t->tree->is_top || check_absent(t, part_count));
    trc_free(t->nodes);
    trc_free(t->slots);
    trc_free(t->seen);
    trc_free(t->covered);
    return good;
}

static bool check_blas(struct checker *c, uint32_t mesh) {
    const struct trc_blas *blas = c->bvh->blas[mesh];
    char name[32];
    uint64_t first;
    if (blas->mesh != c->snapshot->meshes[mesh])
        return complain(c, "tree %u is of another mesh", mesh);
    if (blas->tree.key_count != blas->mesh->key_count)
        return complain(c, "tree %u has %u keys", mesh, blas->tree.key_count);
    (void)snprintf(name, sizeof name, "mesh %u", mesh);
    const struct trc_part part = {.mesh = blas->mesh};
    struct tree_check t = {.checker = c, .name = name, .tree = &blas->tree, .parts = &part};
    return check_tree(&t, 1, &first);
}

static bool check_own(struct checker *c, uint32_t number) {
    const struct trc_instance *instance = &c->snapshot->instances[number];
    const struct trc_own_tree *own = c->bvh->own[number];
    const struct trc_mesh *mesh = c->snapshot->meshes[instance->mesh];
    struct trc_mesh thin = {.positions = NULL};
    char name[32];
    uint64_t first;
    if (!instance->in_world || !trc_own_tree_is_of(own, instance, mesh))
        return complain(c, "the own tree of instance %u is of another", number);
    if (instance->is_thin && trc_thin_mesh(instance, mesh, &thin) != TRC_OK)
        return complain(c, "no memory to check a tree");
    (void)snprintf(name, sizeof name, "instance %u", number);
    const struct trc_part part = {.mesh = instance->is_thin ? &thin : mesh,
                                  .transform =
                                      instance->is_thin ? NULL : instance->object_to_world};
    struct tree_check t = {.checker = c, .name = name, .tree = &own->blas.tree, .parts = &part};
    const bool good = own->blas.tree.key_count == part.mesh->key_count
                          ? check_tree(&t, 1, &first)
                          : complain(c, "%s: the tree has %u keys", name, own->blas.tree.key_count);
    trc_free(thin.positions);
    return good;
}

/* An instance without an item is invisible, has an empty tree, or is joined; only static ones are
 * joined. */
static bool is_joined(const struct checker *c, uint32_t i, const uint8_t *placed) {
    const struct trc_instance *instance = &c->snapshot->instances[i];
    if (placed[i] || !c->bvh->is_joined[i] || instance->visibility != TRC_VISIBLE_ALL ||
        instance->key_count != 1 || c->snapshot->meshes[instance->mesh]->key_count != 1)
        return false;
    const struct trc_blas *blas = blas_of(c, i);
    return !blas || blas->tree.root != TRC_REF_EMPTY;
}

static bool check_joined(struct checker *c, const uint8_t *placed) {
    const struct trc_snapshot *s = c->snapshot;
    struct trc_part *parts = trc_alloc_zeroed(s->instance_count, sizeof *parts);
    uint64_t *first = trc_alloc_zeroed(s->instance_count, sizeof *first);
    bool good = parts && first;
    if (!good)
        complain(c, "no memory to check a tree");
    for (uint32_t i = 0; good && i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        const struct trc_blas *blas = blas_of(c, i);
        if (is_joined(c, i, placed))
            parts[i] = (struct trc_part){.mesh = s->meshes[instance->mesh],
                                         .transform = instance->object_to_world};
        else if (!placed[i] && instance->visibility && (!blas || blas->tree.root != TRC_REF_EMPTY))
            good = complain(c, "instance %u is nowhere", i);
    }
    if (good && c->bvh->joined) {
        struct tree_check t = {.checker = c,
                               .name = "joined tree",
                               .tree = &c->bvh->joined->tree,
                               .parts = parts,
                               .is_joined = true};
        good = check_tree(&t, s->instance_count, first);
    }
    trc_free(parts);
    trc_free(first);
    return good;
}

static bool check_top(struct checker *c, uint8_t *placed) {
    const struct trc_tree *top = &c->bvh->top;
    if (c->bvh->tree != top)
        return true;
    for (uint32_t i = 0; i < top->slot_count; i++)
        if (!check_item(c, &top->items[i], placed))
            return false;
    struct tree_check t = {.checker = c, .name = "top tree", .tree = top};
    return check_tree(&t, 0, NULL);
}

bool bvh_check(const struct trc_bvh *bvh, const struct trc_snapshot *snapshot, char *message,
               uint32_t capacity) {
    struct checker c = {bvh, snapshot, message, capacity};
    if (bvh->tree != &bvh->top && (!bvh->joined || bvh->tree != &bvh->joined->tree))
        return complain(&c, "the tree in use is neither of its own");
    if (bvh->blas_count != snapshot->mesh_count)
        return complain(&c, "trees for %u meshes, there are %u", bvh->blas_count,
                        snapshot->mesh_count);
    for (uint32_t i = 0; i < bvh->blas_count; i++)
        if (bvh->blas[i] && !check_blas(&c, i))
            return false;
    if (bvh->instance_count != snapshot->instance_count)
        return complain(&c, "trees for %u instances, there are %u", bvh->instance_count,
                        snapshot->instance_count);
    for (uint32_t i = 0; bvh->own && i < bvh->instance_count; i++)
        if (bvh->own[i] && !check_own(&c, i))
            return false;
    uint8_t *placed = trc_alloc_zeroed(snapshot->instance_count, 1);
    if (!placed)
        return complain(&c, "no memory to check the trees");
    const bool good = check_top(&c, placed) && check_joined(&c, placed);
    trc_free(placed);
    return good;
}
