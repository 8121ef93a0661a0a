/* What builds do, part by part: clusters, splits of ranges, binary nodes that become wide ones. */
#include "query_test.h"

#include "bvh/binary.h"
#include "bvh/cluster.h"
#include "core/core.h"
#include "core/pool.h"
#include "model/kernels.h"
#include "model/split.h"

/* ---- clusters ---- */

static void clusters_are_what_has_a_box_in_common(void **state) {
    (void)state;
    struct trc_ref refs[8];
    for (uint32_t k = 0; k < 4; k++) { /* two unit squares in a row */
        const float x = (float)(k / 2);
        refs[k] = (struct trc_ref){{x, 0, 0}, 0, {x + 1, 1, 0}, 10 + k};
    }
    assert_true(trc_cluster_join(&refs[0], &refs[1])); /* the halves of a square */
    assert_int_equal(trc_ref_first(&refs[0]), 10);
    assert_int_equal(trc_ref_count(&refs[0]), 2);
    assert_false(trc_cluster_join(&refs[0], &refs[2])); /* two squares: as large as the sum */
    assert_int_equal(trc_ref_count(&refs[0]), 2);
    assert_true(refs[0].upper[0] == 1.0f);
    for (int k = 0; k < 8; k++) /* all in one place */
        refs[k] = (struct trc_ref){{0, 0, 0}, 0, {1, 1, 0.25f * (float)k}, (uint32_t)k};
    for (uint32_t k = 1; k < 4; k++)
        assert_true(trc_cluster_join(&refs[0], &refs[k]));
    assert_int_equal(trc_ref_count(&refs[0]), 4);
    assert_true(refs[0].upper[2] == 0.75f);
    assert_false(trc_cluster_join(&refs[0], &refs[4])); /* enough */
    assert_false(trc_cluster_join(&refs[4], &refs[6])); /* not side by side in the mesh */
    refs[6].part = 1;
    assert_false(trc_cluster_join(&refs[5], &refs[6]));
}

static void clusters_open_into_slots(void **state) {
    (void)state;
    const struct trc_ref refs[] = {{.primitive = 5 | TRC_REF_NEXT}, /* 5, 6 */
                                   {.part = 1, .primitive = 9},
                                   {.primitive = 7 | 3 * TRC_REF_NEXT}}; /* 7 to 10 */
    static const struct trc_part_triangle expected[] = {{0, 5}, {0, 6}, {1, 9}, {0, 7},
                                                        {0, 8}, {0, 9}, {0, 10}};
    struct trc_part_triangle triangles[7];
    trc_clusters_open(refs, 3, triangles);
    assert_memory_equal(triangles, expected, sizeof expected);
}

/* ---- splits ---- */

static void expect_box(struct box a, struct box b) {
    for (int axis = 0; axis < 3; axis++) {
        assert_true(a.lower[axis] == b.lower[axis]);
        assert_true(a.upper[axis] == b.upper[axis]);
    }
}

static void expect_range(const struct trc_range *a, const struct trc_range *b) {
    assert_int_equal(a->count, b->count);
    assert_int_equal(a->first_slot, b->first_slot);
    assert_int_equal(a->triangles, b->triangles);
    expect_box(a->bounds, b->bounds);
    expect_box(a->centroids, b->centroids);
}

/* What a split says of one of its sides is what its refs say. */
static void expect_measured(const struct trc_range *r) {
    struct trc_range measured = *r;
    trc_range_measure(&measured);
    expect_range(r, &measured);
}

/* count random refs in the first half of memory of their own, in order. */
static struct trc_range random_range(uint32_t count, uint64_t seed) {
    struct trc_ref *refs = malloc(2 * count * sizeof *refs);
    struct trc_range r = {.refs = refs, .spare = refs + count, .count = count};
    struct rng rng = rng_seed(seed);
    for (uint32_t i = 0; i < count; i++) {
        refs[i] = (struct trc_ref){.primitive = i | rng_below(&rng, 4) * TRC_REF_NEXT};
        for (int axis = 0; axis < 3; axis++) {
            refs[i].lower[axis] = rng_range(&rng, -1.0f, 1.0f);
            refs[i].upper[axis] = refs[i].lower[axis] + rng_unit(&rng) * rng_unit(&rng);
        }
    }
    trc_range_measure(&r);
    return r;
}

static bool is_in_order(const struct trc_range *r) {
    for (uint32_t i = 1; i < r->count; i++)
        if (trc_ref_first(&r->refs[i - 1]) >= trc_ref_first(&r->refs[i]))
            return false;
    return true;
}

/* By one thread, scalar, and by all of them on an instruction set: the same plane, the same refs on
 * either side in their order, their boxes as measured. */
static void expect_same_splits(uint32_t count, uint64_t seed, const struct trc_kernels *kernels) {
    const struct trc_kernels *scalar = trc_kernels_get(TRC_ISA_SCALAR);
    const struct trc_range all = random_range(count, seed), shared = random_range(count, seed);
    struct trc_pool *pool;
    assert_int_equal(trc_pool_create(3, &pool), TRC_OK);
    struct trc_split_blocks *blocks = malloc(sizeof *blocks);
    *blocks = (struct trc_split_blocks){.pool = pool};
    struct trc_split s, other;
    scalar->split_find(NULL, &all, &s);
    kernels->split_find(blocks, &shared, &other);
    assert_true(s.axis >= 0 && s.axis == other.axis && s.bin == other.bin);
    assert_true(s.cost == other.cost);
    struct trc_range left, right, shared_left, shared_right;
    scalar->split_apply(NULL, &all, &s, &left, &right);
    kernels->split_apply(blocks, &shared, &other, &shared_left, &shared_right);
    expect_range(&left, &shared_left);
    expect_range(&right, &shared_right);
    assert_true(left.count > 0 && right.count > 0 && left.count + right.count == count);
    assert_true(is_in_order(&left) && is_in_order(&right));
    assert_ptr_equal(left.refs, all.spare);
    assert_memory_equal(all.spare, shared.spare, count * sizeof *all.spare);
    expect_measured(&left);
    expect_measured(&right);
    free(blocks);
    trc_pool_destroy(pool);
    free(shared.refs);
    free(all.refs);
}

static void splits_are_the_same(void **state) {
    (void)state;
    static const uint32_t counts[] = {9, 30, 255, 256, 2047, 2048, 2049, 10000, 131072, 200001};
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++)
        for (uint32_t isa = TRC_ISA_SCALAR; isa <= TRC_ISA_NEON; isa++)
            if (trc_kernels_get(isa))
                expect_same_splits(counts[k], k, trc_kernels_get(isa));
}

/* Cost of a split of sorted refs before the given one. */
static float cost_before(const struct trc_range *r, uint32_t at) {
    struct trc_range left = *r, right = *r;
    left.count = at;
    right.refs += at;
    right.count -= at;
    trc_range_measure(&left);
    trc_range_measure(&right);
    const float margin = trc_range_margin(r);
    return box_area_wider(left.bounds, margin) * (float)left.triangles +
           box_area_wider(right.bounds, margin) * (float)right.triangles;
}

/* Up to eight triangles: the cheapest of all planes along the longest axis. */
static void few_refs_split_at_the_best(void **state) {
    (void)state;
    const struct trc_kernels *kernels = trc_kernels_current();
    for (uint64_t seed = 0; seed < 2000; seed++) {
        struct trc_range all = random_range(2 + (uint32_t)(seed % 7), seed), left, right;
        for (uint32_t i = 0; i < all.count; i++)
            all.refs[i].primitive %= TRC_REF_NEXT; /* one triangle each */
        trc_range_measure(&all);
        struct trc_split s;
        kernels->split_find(NULL, &all, &s);
        kernels->split_apply(NULL, &all, &s, &left, &right);
        assert_true(s.axis >= 0 && left.count > 0 && right.count > 0);
        assert_int_equal(left.count + right.count, all.count);
        expect_measured(&left);
        expect_measured(&right);
        for (uint32_t i = 1; i < all.count; i++)
            assert_true(s.cost <= cost_before(&all, i));
        assert_true(s.cost == cost_before(&all, left.count));
        const f4 size = all.centroids.upper - all.centroids.lower;
        int axis = 0;
        for (int i = 1; i < 3; i++)
            axis = size[i] > size[axis] ? i : axis;
        assert_true(left.centroids.upper[axis] <= right.centroids.lower[axis]);
        free(all.refs);
    }
}

/* A flat grid has the same area however it is cut: across its longer side. */
static void flat_ranges_are_cut_into_squares(void **state) {
    (void)state;
    static const uint32_t sides[][2] = {{3, 1}, {1, 3}, {96, 32}, {32, 96}, {200, 180}, {180, 200}};
    for (size_t k = 0; k < sizeof sides / sizeof *sides; k++)
        for (int flat = 0; flat < 3; flat++) {
            const uint32_t columns = sides[k][0], rows = sides[k][1], count = columns * rows;
            const int u = (flat + 1) % 3, v = (flat + 2) % 3;
            struct trc_range all = random_range(count, k);
            for (uint32_t i = 0; i < count; i++) {
                struct trc_ref *ref = &all.refs[i];
                memset(ref, 0, sizeof *ref);
                ref->primitive = i;
                ref->lower[u] = (float)(i % columns);
                ref->lower[v] = (float)(i / columns);
                ref->upper[u] = ref->lower[u] + 1.0f;
                ref->upper[v] = ref->lower[v] + 1.0f;
            }
            trc_range_measure(&all);
            struct trc_split s;
            trc_kernels_current()->split_find(NULL, &all, &s);
            assert_int_equal(s.axis, columns > rows ? u : v);
            free(all.refs);
        }
}

/* ---- binary trees ---- */

#define BINARY_NODES 12

/* A tree of so many inner nodes, of any shape; parents are no smaller than their children. */
static uint32_t binary_random(struct rng *rng, const struct trc_binary *made, float *areas,
                              uint32_t count, uint32_t *next, float area) {
    if (count == 0)
        return trc_leaf_ref(rng_below(rng, 1000), 1 + rng_below(rng, 8));
    const uint32_t left_count = rng_below(rng, count);
    const uint32_t left = binary_random(rng, made, areas, left_count, next, area * rng_unit(rng));
    const uint32_t right =
        binary_random(rng, made, areas, count - 1 - left_count, next, area * rng_unit(rng));
    trc_binary_join(made, *next, left, right, area);
    areas[*next] = area;
    return (*next)++;
}

/* What a node is to the one that stays above it: children, if those that stay are these bits. */
static uint32_t children_of_side(const struct trc_binary_node *nodes, uint32_t node,
                                 uint32_t stays) {
    if ((node & TRC_REF_LEAF) || (stays >> node & 1u))
        return 1;
    return children_of_side(nodes, nodes[node].left, stays) +
           children_of_side(nodes, nodes[node].right, stays);
}

/* The least sum of areas of all choices of nodes that stay, the last one among them. */
static float least_of_all(const struct trc_binary_node *nodes, const float *areas, uint32_t count) {
    float least = INFINITY;
    for (uint32_t stays = 1u << (count - 1); stays < 1u << count; stays++) {
        float sum = 0.0f;
        bool fits = true;
        for (uint32_t i = 0; i < count && fits; i++) {
            if (!(stays >> i & 1u))
                continue;
            sum += areas[i];
            fits = children_of_side(nodes, nodes[i].left, stays) +
                       children_of_side(nodes, nodes[i].right, stays) <=
                   TRC_NODE_WIDTH;
        }
        if (fits && sum < least)
            least = sum;
    }
    return least;
}

/* Sum of the areas of the wide nodes from there down; adds how many leaves they have. */
static float collapsed(const struct trc_binary_node *nodes, const float *areas, uint32_t node,
                       uint32_t *leaves) {
    uint32_t children[TRC_NODE_WIDTH];
    float sum = areas[node];
    const int count = trc_binary_children(nodes, node, children);
    assert_in_range(count, 2, TRC_NODE_WIDTH);
    for (int i = 0; i < count; i++)
        if (children[i] & TRC_REF_LEAF)
            ++*leaves;
        else
            sum += collapsed(nodes, areas, children[i], leaves);
    return sum;
}

/* Trees of up to twelve inner nodes, against every choice there is. */
static void wide_nodes_cost_the_least(void **state) {
    (void)state;
    struct rng rng = rng_seed(23);
    for (int tree = 0; tree < 300; tree++) {
        struct trc_binary_node nodes[BINARY_NODES];
        struct trc_binary_cost costs[BINARY_NODES];
        const struct trc_binary made = {nodes, costs};
        float areas[BINARY_NODES];
        const uint32_t count = 1 + rng_below(&rng, BINARY_NODES);
        uint32_t next = 0, leaves = 0;
        const float area = tree % 10 ? 1.0f : 0.0f; /* of triangles in one place: none */
        const uint32_t root = binary_random(&rng, &made, areas, count, &next, area);
        const float sum = collapsed(nodes, areas, root, &leaves);
        assert_int_equal(leaves, count + 1);
        assert_float_equal(sum, least_of_all(nodes, areas, count), 1e-5f);
        assert_float_equal(sum, costs[root].children[0], 1e-5f);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clusters_are_what_has_a_box_in_common),
        cmocka_unit_test(clusters_open_into_slots),
        cmocka_unit_test(splits_are_the_same),
        cmocka_unit_test(few_refs_split_at_the_best),
        cmocka_unit_test(flat_ranges_are_cut_into_squares),
        cmocka_unit_test(wide_nodes_cost_the_least),
    };
    return cmocka_run_group_tests_name("bvh_splits", tests, NULL, NULL);
}
