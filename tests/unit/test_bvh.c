/* Trees hold their invariants (bvh_check) whatever they are built from and however they are
 * posed, and the check finds trees that do not. */
#include "query_test.h"

#include "bvh/tree.h"
#include "core/core.h"
#include "core/pool.h"
#include "figures.h"
#include "model/tree.h"

static const float unit_lower[3] = {-1, -1, -1}, unit_upper[3] = {1, 1, 1}, origin[3] = {0, 0, 0};

static void expect_good(trc_scene scene, const char *name) {
    char message[256] = "";
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s: %s", name, message);
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
            assert_int_equal(query_scene_stats(scene.scene).skipped_triangle_count, count);
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
        assert_int_equal(query_scene_stats(scene.scene).skipped_triangle_count, count);
        (void)spoil(mesh, 0.5f);
        assert_ok(query_scene_pose(&scene, &world, 0));
        expect_good(scene.scene, "whole again");
        assert_int_equal(query_scene_stats(scene.scene).skipped_triangle_count, 0);
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
    assert_int_equal(query_scene_stats(scene.scene).built_count, 2);
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
        assert_int_equal(query_scene_stats(scene.scene).refitted_count, 1);
        assert_int_equal(query_scene_stats(scene.scene).built_count, 0);
    }
    for (uint32_t i = 0; i < mesh->vertex_count; i++) /* neighbours no more */
        rng_direction(&rng, mesh->positions + 3 * (size_t)i);
    mesh->key_count = 1;
    assert_ok(query_scene_pose(&scene, &world, 0));
    expect_good(scene.scene, "large pose");
    expect_hits_of_new_scene(&scene, &world, false);
    assert_int_equal(query_scene_stats(scene.scene).built_count, 1);
    assert_int_equal(query_scene_stats(scene.scene).refitted_count, 0);
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
    assert_int_equal(query_scene_stats(scene->scene).built_count, built);
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
    assert_int_equal(query_scene_stats(scene.scene).built_count, 1);
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
