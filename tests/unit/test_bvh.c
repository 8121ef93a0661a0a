/* Trees hold their invariants (bvh_check) whatever they are built from and however they are
 * posed, and the check finds trees that do not. */
#include "query_test.h"

#include "bvh/binary.h"
#include "bvh/cluster.h"
#include "core/core.h"
#include "core/pool.h"
#include "figures.h"
#include "model/kernels.h"
#include "model/split.h"

static const float unit_lower[3] = {-1, -1, -1}, unit_upper[3] = {1, 1, 1}, origin[3] = {0, 0, 0};

static void expect_good(trc_scene scene, const char *name) {
    char message[256] = "";
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s: %s", name, message);
}

static trc_scene_stats stats_of(trc_scene scene) {
    trc_scene_stats stats = {.struct_size = sizeof stats};
    assert_ok(trc_scene_get_stats(scene, &stats));
    return stats;
}

/* Builds both kinds of scene and frees the world. */
static void expect_good_world(const char *name, struct query_world *world) {
    for (int is_final = 0; is_final < 2; is_final++) {
        struct query_scene scene;
        assert_ok(query_scene_create(world, is_final, 1, &scene));
        expect_good(scene.scene, name);
        query_scene_destroy(&scene);
    }
    query_world_free(world);
}

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

/* ---- what trees are built from ---- */

static void any_number_of_triangles(void **state) {
    (void)state;
    static const uint32_t counts[] = {0, 1, 2, 7, 8, 9, 63, 64, 65, 1000, 20000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        struct query_world world;
        struct rng rng = rng_seed(i);
        query_world_init(&world);
        mesh_add_soup(query_world_object(&world), &rng, counts[i], unit_lower, unit_upper, 0.1f);
        expect_good_world("soup", &world);
    }
}

static void shapes_and_instances(void **state) {
    (void)state;
    struct query_world world;
    struct rng rng = rng_seed(1);
    query_world_init(&world);
    mesh_add_icosphere(query_world_mesh(&world), origin, 1.0f, 3);
    mesh_add_even_bipyramid(query_world_mesh(&world), 10000, 1.0f, 1.0f);
    mesh_add_needle_fan(query_world_object(&world), 200, 1.0f, 1e6f);
    for (uint32_t i = 0; i < 40; i++) {
        struct query_instance *instance = query_world_instance(&world, i % 2);
        float axis[3];
        const float s = rng_range(&rng, 0.1f, 3.0f), scale[3] = {s, -s, 2.0f * s};
        const float offset[3] = {rng_range(&rng, -9, 9), rng_range(&rng, -9, 9), (float)i};
        rng_direction(&rng, axis);
        instance->key_count = 1 + i % 3;
        for (uint32_t key = 0; key < instance->key_count; key++)
            query_transform(axis, (float)key, scale, offset, instance->transforms[key]);
        if (i == 7)
            memset(instance->transforms[0], 0, sizeof instance->transforms[0]);
        if (i % 5 == 0)
            instance->visibility = i % 32;
    }
    expect_good_world("instances", &world);
}

/* In final scenes static instances that share a mesh of few triangles are joined, while there are
 * not too many together: then the smaller ones alone. */
static void small_instances_are_joined(void **state) {
    (void)state;
    enum { SMALL = 80, MEDIUM = 4095, LARGE = 4096, TOTAL = 1 << 20 };
    for (uint32_t is_final = 0; is_final < 2; is_final++)
        for (uint32_t crowd = 0; crowd < 2; crowd++) {
            struct query_world world;
            struct rng rng = rng_seed(3);
            query_world_init(&world);
            mesh_add_icosphere(query_world_mesh(&world), origin, 1.0f, 1);
            mesh_add_soup(query_world_mesh(&world), &rng, MEDIUM, unit_lower, unit_upper, 0.1f);
            mesh_add_soup(query_world_mesh(&world), &rng, LARGE, unit_lower, unit_upper, 0.1f);
            assert_int_equal(world.meshes[0].triangle_count, SMALL);
            const uint32_t counts[] = {3, crowd ? TOTAL / MEDIUM + 1 : 3, 2};
            float at = 0.0f;
            for (uint32_t mesh = 0; mesh < 3; mesh++)
                for (uint32_t i = 0; i < counts[mesh]; i++, at += 3.0f)
                    query_world_instance(&world, mesh)->transforms[0][3] = at;
            struct query_scene scene;
            assert_ok(query_scene_create(&world, is_final, 1, &scene));
            expect_good(scene.scene, "small instances");
            const struct trc_bvh *bvh = query_scene_snapshot(scene.scene)->bvh;
            assert_int_equal(!bvh->blas[0], is_final);
            assert_int_equal(!bvh->blas[1], is_final && !crowd);
            assert_non_null(bvh->blas[2]);
            query_scene_destroy(&scene);
            query_world_free(&world);
        }
}

/* Cases 21, 23, 24: through the origin, a collapse, one vertex far ahead of the rest; and many
 * keys. */
static void moving_meshes(void **state) {
    (void)state;
    for (uint32_t kind = 0; kind < 5; kind++) {
        struct query_world world;
        struct rng rng = rng_seed(kind);
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        mesh_add_uv_sphere(mesh, origin, 1.0f, 24, 32);
        mesh_set_keys(mesh, kind < 3 ? 2 : 5);
        for (uint32_t key = 1; key < mesh->key_count; key++)
            for (uint32_t i = 0; i < mesh->vertex_count; i++) {
                float *p = mesh_key(mesh, key) + 3 * (size_t)i;
                for (int axis = 0; axis < 3; axis++)
                    switch (kind) {
                    case 0:
                        p[axis] += axis == 1 ? -2e6f : 2e6f;
                        break;
                    case 1:
                        p[axis] = -p[axis];
                        break;
                    case 2:
                        p[axis] *= i == 77 ? 1e4f : 1.0001f;
                        break;
                    case 3:
                        p[axis] += rng_range(&rng, -0.5f, 0.5f);
                        break;
                    default:
                        p[axis] *= powf(10.0f, 4.0f * (float)key);
                    }
            }
        if (kind == 0)
            for (uint32_t i = 0; i < 2 * mesh->vertex_count; i++)
                for (int axis = 0; axis < 3; axis++)
                    mesh->positions[3 * (size_t)i + (size_t)axis] += axis == 1 ? 1e6f : -1e6f;
        expect_good_world("moving sphere", &world);
    }
}

/* Coordinates from random bits: every exponent, denormals, infinities and NaN among them. */
static void random_bits(void **state) {
    (void)state;
    for (uint32_t keys = 1; keys <= 3; keys++) {
        struct query_world world;
        struct rng rng = rng_seed(keys);
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        mesh_add_soup(mesh, &rng, 3000, unit_lower, unit_upper, 1.0f);
        mesh_set_keys(mesh, keys);
        for (uint32_t i = 0; i < 3 * keys * mesh->vertex_count; i++) {
            const uint32_t bits = rng_bits(&rng);
            memcpy(&mesh->positions[i], &bits, sizeof bits);
        }
        expect_good_world("random bits", &world);
    }
}

/* ---- skipped triangles ---- */

/* Triangles that a vertex of index % 10 == 3 belongs to are spoiled at the last key. */
static uint64_t spoil(struct mesh *mesh, float value) {
    float *last = mesh_key(mesh, mesh->key_count - 1);
    uint64_t count = 0;
    for (uint32_t i = 3; i < mesh->vertex_count; i += 10)
        last[3 * (size_t)i + i % 3] = value;
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->indices + 3 * (size_t)t;
        count += v[0] % 10 == 3 || v[1] % 10 == 3 || v[2] % 10 == 3;
    }
    return count;
}

static void skipped_triangles_are_counted(void **state) {
    (void)state;
    static const float values[] = {NAN, INFINITY, -INFINITY, 1.9e18f, -3e38f};
    for (uint32_t i = 0; i < 10; i++)
        for (int is_final = 0; is_final < 2; is_final++) {
            struct query_world world;
            struct query_scene scene;
            query_world_init(&world);
            struct mesh *mesh = query_world_object(&world);
            mesh_add_uv_sphere(mesh, origin, 1.0f, 12, 16);
            mesh_set_keys(mesh, 1 + i / 5);
            const uint64_t count = spoil(mesh, values[i % 5]);
            assert_ok(query_scene_create(&world, is_final, 1, &scene));
            expect_good(scene.scene, "spoiled sphere");
            assert_int_equal(stats_of(scene.scene).skipped_triangle_count, count);
            query_scene_destroy(&scene);
            query_world_free(&world);
        }
}

/* The same when they are spoiled by a pose, and when the next pose is whole again. */
static void poses_skip_triangles_too(void **state) {
    (void)state;
    static const float values[] = {NAN, INFINITY, 1.9e18f};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) {
        struct query_world world;
        struct query_scene scene;
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        mesh_add_uv_sphere(mesh, origin, 1.0f, 12, 16);
        assert_ok(query_scene_create(&world, false, 1, &scene));
        const uint64_t count = spoil(mesh, values[i]);
        assert_ok(query_scene_pose(&scene, &world, 0));
        expect_good(scene.scene, "spoiled by a pose");
        assert_int_equal(stats_of(scene.scene).skipped_triangle_count, count);
        (void)spoil(mesh, 0.5f);
        assert_ok(query_scene_pose(&scene, &world, 0));
        expect_good(scene.scene, "whole again");
        assert_int_equal(stats_of(scene.scene).skipped_triangle_count, 0);
        query_scene_destroy(&scene);
        query_world_free(&world);
    }
}

/* ---- poses ---- */

/* A posed scene gives the bits of one that was built with the pose. */
static void expect_hits_of_new_scene(const struct query_scene *posed,
                                     const struct query_world *world, bool is_final) {
    struct query_scene built;
    struct ray_set rays;
    struct hit_set a, b;
    struct rng rng = rng_seed(4);
    ray_set_init(&rays);
    for (int i = 0; i < 2000; i++) {
        float o[3], d[3];
        rng_direction(&rng, o);
        rng_direction(&rng, d);
        for (int axis = 0; axis < 3; axis++)
            d[axis] = 0.5f * d[axis] - 3.0f * o[axis], o[axis] *= 3.0f;
        ray_set_add(&rays, o, d, 0.0f, INFINITY, rng_unit(&rng));
    }
    assert_ok(query_scene_create(world, is_final, 1, &built));
    hit_set_init(&a, rays.count);
    hit_set_init(&b, rays.count);
    assert_ok(hit_set_query(&a, posed->scene, &rays, 64));
    assert_ok(hit_set_query(&b, built.scene, &rays, 64));
    assert_int_equal(hit_set_difference(&a, &b), UINT32_MAX);
    hit_set_free(&a);
    hit_set_free(&b);
    ray_set_free(&rays);
    query_scene_destroy(&built);
}

static void small_poses_refit_and_large_ones_rebuild(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(2);
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    mesh_add_icosphere(mesh, origin, 1.0f, 4);
    mesh_add_box(query_world_object(&world), unit_lower, unit_upper);
    assert_ok(query_scene_create(&world, false, 2, &scene));
    assert_int_equal(stats_of(scene.scene).built_count, 2);
    for (uint32_t step = 0; step < 8; step++) {
        const uint32_t keys =
            step / 2 % 2 + 1; /* 1, 1, 2, 2, ...: refits change the number of keys */
        mesh->key_count = 1;
        mesh_set_keys(mesh, keys);
        for (uint32_t i = 0; i < 3 * keys * mesh->vertex_count; i++)
            mesh->positions[i] += rng_range(&rng, -1e-3f, 1e-3f);
        assert_ok(query_scene_pose(&scene, &world, 0));
        expect_good(scene.scene, "small pose");
        expect_hits_of_new_scene(&scene, &world, false);
        assert_int_equal(stats_of(scene.scene).refitted_count, 1);
        assert_int_equal(stats_of(scene.scene).built_count, 0);
    }
    for (uint32_t i = 0; i < mesh->vertex_count; i++) /* neighbours no more */
        rng_direction(&rng, mesh->positions + 3 * (size_t)i);
    mesh->key_count = 1;
    assert_ok(query_scene_pose(&scene, &world, 0));
    expect_good(scene.scene, "large pose");
    expect_hits_of_new_scene(&scene, &world, false);
    assert_int_equal(stats_of(scene.scene).built_count, 1);
    assert_int_equal(stats_of(scene.scene).refitted_count, 0);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* Instances that change in a final scene: how many are of trees of their own then, and how many
 * trees were built. */
static void expect_after_moves(struct query_scene *scene, const struct query_world *world,
                               uint32_t own, uint32_t built) {
    uint32_t found = 0;
    assert_ok(trc_scene_commit(scene->scene));
    expect_good(scene->scene, "changed instances");
    expect_hits_of_new_scene(scene, world, true);
    const struct trc_bvh *bvh = query_scene_snapshot(scene->scene)->bvh;
    for (uint32_t i = 0; i < world->instance_count; i++)
        found += trc_bvh_has_own_tree(bvh, i);
    assert_int_equal(found, own);
    assert_int_equal(stats_of(scene->scene).built_count, built);
}

/* The joined tree is built once without what moves, stays while the rest does, and is built of all
 * again when much of it has moved; rays find the bits that they find in a new scene. */
static void what_moves_leaves_the_joined_tree(void **state) {
    (void)state;
    enum { COUNT = 40 };
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(23);
    query_world_init(&world);
    mesh_add_icosphere(query_world_mesh(&world), origin, 1.0f, 1);
    for (uint32_t i = 0; i < COUNT; i++) {
        float axis[3], scale[3], offset[3];
        rng_direction(&rng, axis);
        for (int k = 0; k < 3; k++) {
            scale[k] = rng_range(&rng, 0.1f, 0.4f);
            offset[k] = rng_range(&rng, -1.0f, 1.0f);
        }
        query_transform(axis, rng_range(&rng, 0.0f, 3.0f), scale, offset,
                        query_world_instance(&world, 0)->transforms[0]);
    }
    assert_ok(query_scene_create(&world, true, 2, &scene));
    assert_int_equal(stats_of(scene.scene).built_count, 1);
    const struct trc_joined_tree *joined = NULL;
    for (uint32_t frame = 0; frame < 4; frame++) {
        world.instances[3].transforms[0][3] += 0.1f;
        assert_ok(query_scene_move(&scene, &world, 3));
        expect_after_moves(&scene, &world, 1, frame ? 1 : 2);
        if (frame)
            assert_ptr_equal(query_scene_snapshot(scene.scene)->bvh->joined, joined);
        joined = query_scene_snapshot(scene.scene)->bvh->joined;
    }
    world.instances[COUNT - 1].transforms[0][7] -= 0.2f;
    assert_ok(query_scene_move(&scene, &world, COUNT - 1));
    expect_after_moves(&scene, &world, 2, 2);
    world.instances[7].visibility = TRC_VISIBLE_CAMERA; /* a tree that others could share */
    assert_ok(query_scene_move(&scene, &world, 7));
    expect_after_moves(&scene, &world, 2, 2);
    world.instances[7].visibility = TRC_VISIBLE_ALL;
    assert_ok(query_scene_move(&scene, &world, 7));
    expect_after_moves(&scene, &world, 3, 1);
    for (uint32_t frame = 0; frame < 2; frame++) {
        for (uint32_t i = 10; i <= 10 + COUNT / 4; i++) {
            world.instances[i].transforms[0][11] += 0.1f;
            assert_ok(query_scene_move(&scene, &world, i));
        }
        expect_after_moves(&scene, &world, 0, 1);
    }
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* ---- depth ---- */

static uint32_t depth_of(const struct trc_tree *tree, uint32_t ref) {
    uint32_t deepest = 0;
    if (ref & TRC_REF_LEAF)
        return 0;
    for (int i = 0; i < TRC_NODE_WIDTH; i++) {
        const uint32_t child = trc_node_children(tree, ref)[i];
        const uint32_t depth = child == TRC_REF_EMPTY ? 0 : depth_of(tree, child);
        deepest = depth > deepest ? depth : deepest;
    }
    return deepest + 1;
}

/* Copies of one triangle: no split tells them apart, and the tree is as deep as halving makes it:
 * 17 halvings to leaves of 8, three to a level. */
static void one_million_identical_centroids(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(17);
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    mesh_add_soup(mesh, &rng, 1, unit_lower, unit_upper, 1.0f);
    for (uint32_t i = 1; i < 1000000; i++)
        mesh_add_triangle(mesh, i % 3, (i + 1) % 3, (i + 2) % 3);
    assert_ok(query_scene_create(&world, true, 1, &scene));
    const struct trc_tree *tree = query_scene_snapshot(scene.scene)->bvh->tree;
    const uint32_t depth = depth_of(tree, tree->root);
    print_figure("17: 1,000,000 triangles in one place", "%u levels of %d", depth, TRC_MAX_LEVELS);
    assert_true(depth <= 8);
    expect_good(scene.scene, "copies");
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* Rungs of a ladder, each a sixteenth of the one before; at its foot copies of one triangle. The
 * sheets are flat in x and long in z, so that areas shrink with y alone and stay far from
 * underflow. A rung's triangles have more area than all that is below it: each level of the binary
 * tree peels off no more than one rung. What is left when splits are forced to the middle can only
 * be halved. */
static void ladder(const char *name, uint32_t rung_size, uint32_t foot, float top) {
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(18);
    float s = top;
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    for (; s > 1e-36f; s /= 16.0f)
        for (uint32_t i = 0; i < rung_size; i++) {
            const float y = rng_range(&rng, 0.3f * s, 0.8f * s);
            const float z = rng_range(&rng, 0.1f * top, 0.8f * top);
            const uint32_t v = mesh_add_vertex(mesh, 0.0f, y - 0.1f * s, z);
            mesh_add_vertex(mesh, 0.0f, y + 0.1f * s, z);
            mesh_add_vertex(mesh, 0.0f, y, z + 0.1f * top);
            mesh_add_triangle(mesh, v, v + 1, v + 2);
        }
    const uint32_t v = mesh_add_vertex(mesh, 0.0f, 0.0f, 0.0f);
    mesh_add_vertex(mesh, 0.0f, s, 0.0f);
    mesh_add_vertex(mesh, 0.0f, 0.0f, top);
    for (uint32_t i = 0; i < foot; i++)
        mesh_add_triangle(mesh, v, v + 1, v + 2);
    assert_ok(query_scene_create(&world, true, 1, &scene));
    const struct trc_tree *tree = query_scene_snapshot(scene.scene)->bvh->tree;
    print_figure(name, "%u levels of %d", depth_of(tree, tree->root), TRC_MAX_LEVELS);
    expect_good(scene.scene, name);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

static void geometric_series_stays_within_the_stack(void **state) {
    (void)state;
    ladder("18: one triangle a rung", 1, 100, 1e15f);
    ladder("18: eight triangles a rung", 8, 1000, 1e15f);
    ladder("18: 100 triangles a rung", 100, 1000, 1e15f);
    ladder("18: 100 triangles a rung, a million at the foot", 100, 1000000, 1e14f);
}

/* ---- determinism ---- */

static void trees_do_not_depend_on_threads(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene one, other;
    struct rng rng = rng_seed(3);
    query_world_init(&world);
    mesh_add_soup(query_world_object(&world), &rng, 60000, unit_lower, unit_upper, 0.02f);
    assert_ok(query_scene_create(&world, false, 1, &one));
    for (uint32_t threads = 2; threads <= 8; threads *= 2) {
        assert_ok(query_scene_create(&world, false, threads, &other));
        const struct trc_tree *a = &query_scene_snapshot(one.scene)->bvh->blas[0]->tree;
        const struct trc_tree *b = &query_scene_snapshot(other.scene)->bvh->blas[0]->tree;
        assert_int_equal(a->node_count, b->node_count);
        assert_int_equal(a->slot_count, b->slot_count);
        for (uint32_t n = 0; n < a->node_count; n++) {
            assert_memory_equal(trc_node_children(a, n), trc_node_children(b, n),
                                TRC_NODE_CHILDREN_BYTES);
            assert_memory_equal(trc_node_bounds(a, n), trc_node_bounds(b, n),
                                TRC_NODE_BOUNDS_BYTES);
        }
        assert_memory_equal(a->slots->slots, b->slots->slots,
                            a->slot_count * sizeof a->slots->slots[0]);
        assert_memory_equal(a->vertices, b->vertices,
                            a->slot_count * TRC_TRIANGLE_FLOATS * sizeof *a->vertices);
        query_scene_destroy(&other);
    }
    query_scene_destroy(&one);
    query_world_free(&world);
}

/* ---- cancelling ---- */

/* Filling and refitting a tree, told beforehand to stop, say so and keep no memory. */
static void fills_and_refits_are_cancelled(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(7);
    struct trc_pool *pool = NULL;
    const atomic_uint cancel = 1;
    query_world_init(&world);
    mesh_add_soup(query_world_object(&world), &rng, 20000, unit_lower, unit_upper, 0.02f);
    assert_ok(query_scene_create(&world, false, 1, &scene));
    assert_int_equal(trc_pool_create(1, &pool), TRC_OK); /* threads free memory as they start */
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene.scene);
    const struct trc_tree *from = &snapshot->bvh->blas[0]->tree;
    const struct trc_part part = {.mesh = snapshot->meshes[0]};
    const uint64_t held = trc_memory_bytes();
    struct trc_tree tree;
    assert_int_equal(trc_tree_refit(from, &part, 1, pool, &cancel, &tree), TRC_ERROR_CANCELLED);
    const struct trc_part_triangle triangle = {0, 0};
    const struct trc_topology leaf = {.root = trc_leaf_ref(0, 1)};
    assert_int_equal(trc_tree_fill(&leaf, &triangle, NULL, 1, &part, 1, pool, &cancel, &tree),
                     TRC_ERROR_CANCELLED);
    assert_int_equal(trc_memory_bytes(), held);
    trc_pool_destroy(pool);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* ---- the check itself ---- */

/* What is done to a tree; each is undone by restoring its bytes. */
static void damage(struct trc_tree *tree, int kind) {
    uint32_t *root = (uint32_t *)tree->nodes;
    struct trc_slot *slots = tree->slots->slots;
    float *bounds = (float *)(tree->nodes + TRC_NODE_CHILDREN_BYTES);
    switch (kind) {
    case 0:
        bounds[0] = nextafterf(bounds[0], INFINITY);
        break; /* a child sticks out */
    case 1:
        bounds[8] = NAN;
        break;
    case 2:
        root[0] = 0;
        break; /* a cycle */
    case 3:
        root[1] = root[0];
        break; /* reached twice, another not at all */
    case 4:
        root[0] = tree->node_count;
        break; /* out of range */
    case 5:
        root[0] = TRC_REF_EMPTY;
        break; /* a part lost */
    case 6:
        slots[0].triangle = slots[1].triangle;
        break; /* a triangle twice */
    case 7:
        slots[0].triangle = 1u << 30;
        break; /* a number out of range */
    case 8:
        slots[0].instance = 5;
        break; /* another instance */
    case 9:
        slots[0] = slots[tree->slot_count - 1];
        break; /* one in two leaves */
    case 10:
        tree->vertices[3] += 1e-3f;
        break; /* another place */
    default:
        break;
    }
}

static void check_finds_damage(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene scene;
    struct rng rng = rng_seed(5);
    query_world_init(&world);
    mesh_add_soup(query_world_object(&world), &rng, 2000, unit_lower, unit_upper, 0.2f);
    assert_ok(query_scene_create(&world, false, 1, &scene));
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene.scene);
    struct trc_tree *tree = &snapshot->bvh->blas[0]->tree;
    const size_t node_bytes = tree->node_stride;
    uint8_t *node = malloc(node_bytes);
    assert_non_null(node);
    memcpy(node, tree->nodes, node_bytes);
    const struct trc_slot slot = tree->slots->slots[0];
    const float coordinate = tree->vertices[3];
    for (int kind = 0; kind < 11; kind++) {
        char message[256] = "";
        damage(tree, kind);
        if (bvh_check(snapshot->bvh, snapshot, message, sizeof message))
            fail_msg("damage %d was not found", kind);
        assert_true(strlen(message) > 0);
        assert_false(bvh_check(snapshot->bvh, snapshot, NULL, 0));
        memcpy(tree->nodes, node, node_bytes);
        tree->slots->slots[0] = slot;
        tree->vertices[3] = coordinate;
        expect_good(scene.scene, "mended");
    }
    tree->triangle_count++;
    assert_false(bvh_check(snapshot->bvh, snapshot, NULL, 0));
    tree->triangle_count--;
    tree->upper[0] = 0.0f;
    assert_false(bvh_check(snapshot->bvh, snapshot, NULL, 0));
    free(node);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(clusters_are_what_has_a_box_in_common),
        cmocka_unit_test(clusters_open_into_slots),
        cmocka_unit_test(splits_are_the_same),
        cmocka_unit_test(few_refs_split_at_the_best),
        cmocka_unit_test(flat_ranges_are_cut_into_squares),
        cmocka_unit_test(wide_nodes_cost_the_least),
        cmocka_unit_test(any_number_of_triangles),
        cmocka_unit_test(shapes_and_instances),
        cmocka_unit_test(small_instances_are_joined),
        cmocka_unit_test(what_moves_leaves_the_joined_tree),
        cmocka_unit_test(moving_meshes),
        cmocka_unit_test(random_bits),
        cmocka_unit_test(skipped_triangles_are_counted),
        cmocka_unit_test(poses_skip_triangles_too),
        cmocka_unit_test(small_poses_refit_and_large_ones_rebuild),
        cmocka_unit_test(one_million_identical_centroids),
        cmocka_unit_test(geometric_series_stays_within_the_stack),
        cmocka_unit_test(trees_do_not_depend_on_threads),
        cmocka_unit_test(fills_and_refits_are_cancelled),
        cmocka_unit_test(check_finds_damage),
    };
    return cmocka_run_group_tests_name("bvh", tests, NULL, NULL);
}
