/* Blocks of moving trees: triangles share their vertices, each is there once for each key, and
 * refits give what a new tree has. */
#include "query_test.h"

#include "bvh/tree.h"
#include "core/pool.h"
#include "figures.h"
#include "model/tree.h"

#define KEYS 3
/* Of a grid of squares a leaf has at most this part of three vertices a triangle. */
#define GRID_SHARE .75
/* Most bytes of a triangle of a grid at two keys, all in all; 72 are vertices that are not shared.
 */
#define GRID_BYTES 65.0

static const float corner[3] = {-1, -1, 0}, edge_u[3] = {2, 0, 0}, edge_v[3] = {0, 2, 0};

/* Sets a scene of one mesh up. */
struct moving_scene {
    struct query_world world;
    struct query_scene scene;
};
static struct mesh *moving_begin(struct moving_scene *s) {
    query_world_init(&s->world);
    return query_world_object(&s->world);
}
static const struct trc_tree *moving_tree(struct moving_scene *s, struct mesh *mesh, uint32_t keys,
                                          uint32_t threads) {
    char message[256] = "";
    struct rng rng = rng_seed(keys);
    mesh_set_keys(mesh, keys);
    for (uint32_t i = 3 * mesh->vertex_count; i < 3 * keys * mesh->vertex_count; i++)
        mesh->positions[i] += rng_range(&rng, -.01f, .01f);
    assert_ok(query_scene_create(&s->world, false, threads, &s->scene));
    const struct trc_snapshot *snapshot = query_scene_snapshot(s->scene.scene);
    if (!bvh_check(snapshot->bvh, snapshot, message, sizeof message))
        fail_msg("%s", message);
    return &snapshot->bvh->blas[0]->tree;
}
static void moving_end(struct moving_scene *s) {
    query_scene_destroy(&s->scene);
    query_world_free(&s->world);
}

/* What the blocks of a tree have. */
struct counts {
    uint32_t triangles, vertices, crowded; /* crowded: leaves with more than are loaded at once */
};
static void blocks_count(const struct trc_tree *tree, uint32_t ref, struct counts *c) {
    if (ref == TRC_REF_EMPTY)
        return;
    if (!(ref & TRC_REF_LEAF)) {
        for (int i = 0; i < TRC_NODE_WIDTH; i++)
            blocks_count(tree, trc_node_children(tree, ref)[i], c);
        return;
    }
    const struct trc_block *block = trc_leaf_block(tree, ref);
    const uint32_t count = trc_leaf_count(ref);
    bool used[TRC_BLOCK_VERTICES] = {false}, is_own = block->vertex_count == 3 * count;
    for (uint32_t i = 0; i < 3 * count; i++) {
        assert_in_range(block->corners[i], 0, block->vertex_count - 1);
        used[block->corners[i]] = true;
        is_own &= block->corners[i] == i;
    }
    for (uint32_t i = 0; i < block->vertex_count; i++)
        assert_true(used[i]);
    assert_true(block->vertex_count <= TRC_BLOCK_LOAD || is_own);
    c->triangles += count;
    c->vertices += block->vertex_count;
    c->crowded += block->vertex_count > TRC_BLOCK_LOAD;
}

static void triangles_of_a_grid_share_vertices(void **state) {
    (void)state;
    struct moving_scene s;
    struct counts c = {0};
    struct mesh *mesh = moving_begin(&s);
    mesh_add_grid(mesh, corner, edge_u, edge_v, 64, 64);
    const struct trc_tree *tree = moving_tree(&s, mesh, 2, 1);
    blocks_count(tree, tree->root, &c);
    assert_int_equal(c.triangles, mesh->triangle_count);
    const double share = c.vertices / (3.0 * c.triangles),
                 bytes = (double)tree->bytes / c.triangles;
    print_figure("a grid of 8,192 triangles at two keys", "%.2f vertices and %.1f bytes a triangle",
                 3.0 * share, bytes);
    assert_true(share < GRID_SHARE);
    assert_true(bytes < GRID_BYTES);
    moving_end(&s);
}

/* Triangles in one place, every third with a neighbour. */
static void add_crowd(struct mesh *mesh, struct rng *rng, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t first = mesh->vertex_count;
        for (int v = 0; v < 4; v++)
            mesh_add_vertex(mesh, rng_range(rng, -1, 1), rng_range(rng, -1, 1),
                            rng_range(rng, -1, 1));
        mesh_add_triangle(mesh, first, first + 1, first + 2);
        if (i % 3 == 0)
            mesh_add_triangle(mesh, first, first + 2, first + 3);
    }
}

/* Where a leaf has more vertices than kernels load at once, each corner has its own. */
static void crowded_corners_have_their_own(void **state) {
    (void)state;
    struct moving_scene s;
    struct counts c = {0};
    struct rng rng = rng_seed(1);
    struct mesh *mesh = moving_begin(&s);
    add_crowd(mesh, &rng, 3000);
    const struct trc_tree *tree = moving_tree(&s, mesh, KEYS, 1);
    blocks_count(tree, tree->root, &c);
    assert_int_equal(c.triangles, mesh->triangle_count);
    assert_true(c.crowded > 100);
    moving_end(&s);
}

static void expect_equal(const struct trc_tree *a, const struct trc_tree *b) {
    assert_int_equal(a->node_count, b->node_count);
    assert_int_equal(a->vertex_floats, b->vertex_floats);
    assert_int_equal(a->root, b->root);
    assert_memory_equal(a->nodes, b->nodes, a->node_count * a->node_stride);
    assert_memory_equal(a->vertices, b->vertices, a->vertex_floats * sizeof *a->vertices);
}

/* All bytes, what is between blocks, too. */
static void blocks_do_not_depend_on_threads(void **state) {
    (void)state;
    struct moving_scene one, other;
    const struct trc_tree *trees[2];
    for (uint32_t i = 0; i < 2; i++) {
        struct mesh *mesh = moving_begin(i ? &other : &one);
        mesh_add_grid(mesh, corner, edge_u, edge_v, 100, 100);
        trees[i] = moving_tree(i ? &other : &one, mesh, KEYS, 1 + 3 * i);
    }
    expect_equal(trees[0], trees[1]);
    moving_end(&one);
    moving_end(&other);
}

/* A refit without a pose is a copy, of the tree, of its copy, and from and to other counts of keys.
 */
static void refits_are_copies(void **state) {
    (void)state;
    struct moving_scene still, moving;
    struct trc_pool *pool = NULL;
    struct mesh *mesh = moving_begin(&still);
    mesh_add_grid(mesh, corner, edge_u, edge_v, 40, 40);
    const struct trc_tree *at_rest = moving_tree(&still, mesh, 1, 1);
    mesh = moving_begin(&moving);
    mesh_add_grid(mesh, corner, edge_u, edge_v, 40, 40);
    const struct trc_tree *tree = moving_tree(&moving, mesh, KEYS, 1);
    const struct trc_part part = {.mesh = query_scene_snapshot(moving.scene.scene)->meshes[0]};
    const struct trc_part first = {.mesh = query_scene_snapshot(still.scene.scene)->meshes[0]};
    struct trc_tree copy, again, back, there;
    assert_int_equal(trc_pool_create(2, &pool), TRC_OK);
    assert_int_equal(trc_tree_refit(tree, &part, KEYS, pool, NULL, &copy), TRC_OK);
    expect_equal(tree, &copy);
    assert_int_equal(trc_tree_refit(&copy, &part, KEYS, pool, NULL, &again), TRC_OK);
    expect_equal(tree, &again);
    assert_int_equal(trc_tree_refit(&again, &first, 1, pool, NULL, &back), TRC_OK);
    assert_int_equal(back.vertex_floats, at_rest->vertex_floats);
    assert_int_equal(trc_tree_refit(&back, &part, KEYS, pool, NULL, &there), TRC_OK);
    expect_equal(tree, &there);
    for (int i = 0; i < 4; i++)
        trc_tree_destroy((struct trc_tree *[]){&copy, &again, &back, &there}[i]);
    trc_pool_destroy(pool);
    moving_end(&moving);
    moving_end(&still);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(triangles_of_a_grid_share_vertices),
        cmocka_unit_test(crowded_corners_have_their_own),
        cmocka_unit_test(blocks_do_not_depend_on_threads),
        cmocka_unit_test(refits_are_copies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
