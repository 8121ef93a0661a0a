/* Clipped refs: nothing of a triangle is lost between its pieces, and what need not be cut stays
 * whole. */
#include "query_test.h"

#include "bvh/clip.h"
#include "bvh/part.h"
#include "bvh/tree.h"
#include "core/core.h"
#include "figures.h"
#include "model/ref.h"
#include "rng.h"

/* ---- one ref ---- */

#define MAX_TRIANGLES 4

/* Triangles that go together as one ref of the first part. */
struct cluster {
    float positions[9 * MAX_TRIANGLES + 1];
    uint32_t indices[3 * MAX_TRIANGLES];
    struct trc_mesh mesh;
    struct trc_part part;
    struct trc_ref ref;
};

static void cluster_measure(struct cluster *c, uint32_t count) {
    struct box box = box_empty();
    c->mesh = (struct trc_mesh){.key_count = 1,
                                .vertex_count = 3 * count,
                                .triangle_count = count,
                                .positions = c->positions,
                                .indices = c->indices};
    c->part = (struct trc_part){.mesh = &c->mesh};
    for (uint32_t v = 0; v < 3 * count; v++) {
        c->indices[v] = v;
        box_add(&box, f4_load3(c->positions + 3 * (size_t)v));
    }
    c->ref = (struct trc_ref){.primitive = (count - 1) * TRC_REF_NEXT};
    f4_store3(c->ref.lower, box.lower);
    f4_store3(c->ref.upper, box.upper);
}

/* Random triangles that follow one another, from needles to round ones, a way from the origin. */
static void cluster_random(struct rng *rng, float offset, struct cluster *c) {
    const uint32_t count = 1 + rng_below(rng, MAX_TRIANGLES);
    float along[3], aside[3];
    rng_direction(rng, along);
    rng_direction(rng, aside);
    const float width = powf(10.0f, rng_range(rng, -6.0f, 0.0f));
    for (uint32_t v = 0; v < 3 * count; v++) {
        const float x = rng_range(rng, -1.0f, 1.0f), y = width * rng_range(rng, -1.0f, 1.0f);
        for (int axis = 0; axis < 3; axis++)
            c->positions[3 * v + (uint32_t)axis] = offset + x * along[axis] + y * aside[axis];
    }
    cluster_measure(c, count);
}

static struct trc_clip clip_of(const struct trc_ref *ref, float min_area) {
    const f4 margin = {0.4f, 0.7f, 0.1f, 0.0f}; /* planes fall anywhere in it */
    struct box bounds = trc_ref_box(ref);
    bounds.lower -= margin;
    bounds.upper += margin;
    return (struct trc_clip){bounds, min_area};
}

static bool box_has(const struct trc_ref *r, const long double p[3]) {
    for (int axis = 0; axis < 3; axis++)
        if (!(r->lower[axis] <= p[axis] && p[axis] <= r->upper[axis]))
            return false;
    return true;
}

/* Whether a piece that has the triangle holds the point. */
static bool is_held(const struct trc_ref *pieces, uint32_t count, uint32_t triangle,
                    const long double p[3]) {
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t first = trc_ref_first(&pieces[i]);
        if (triangle >= first && triangle < first + trc_ref_count(&pieces[i]) &&
            box_has(&pieces[i], p))
            return true;
    }
    return false;
}

/* Points of a triangle, some of them on its edges, in long double: of those, how many no piece
 * holds. */
static uint32_t lost_points(struct rng *rng, const struct cluster *c, uint32_t triangle,
                            const struct trc_ref *pieces, uint32_t count, uint32_t points) {
    const float *v = c->positions + 9 * (size_t)triangle;
    uint32_t lost = 0;
    for (uint32_t i = 0; i < points; i++) {
        long double a = rng_unit(rng), b = rng_unit(rng), p[3];
        if (a + b > 1.0L) {
            a = 1.0L - a;
            b = 1.0L - b;
        }
        if (i % 4 == 0)
            b = 0.0L;
        for (int axis = 0; axis < 3; axis++)
            p[axis] = v[axis] + a * ((long double)v[3 + axis] - v[axis]) +
                      b * ((long double)v[6 + axis] - v[axis]);
        lost += !is_held(pieces, count, triangle, p);
    }
    return lost;
}

static void pieces_hold_all_points(void **state) {
    (void)state;
    static const float offsets[] = {0.0f, 3.0f, 1e3f, 1e6f};
    struct rng rng = rng_seed(31);
    uint64_t points = 0, lost = 0, cut = 0;
    for (int i = 0; i < 4000; i++) {
        struct cluster c;
        struct trc_ref pieces[TRC_CLIP_MAX_PIECES];
        uint32_t triangles, counted, sum = 0;
        cluster_random(&rng, offsets[i % 4], &c);
        const struct trc_clip clip = clip_of(&c.ref, powf(10.0f, rng_range(&rng, -4.0f, -1.0f)));
        const uint32_t count = trc_ref_clip(&c.part, &c.ref, &clip, pieces, &triangles);
        assert_int_equal(trc_ref_clip(&c.part, &c.ref, &clip, NULL, &counted), count);
        assert_int_equal(counted, triangles);
        assert_in_range(count, 1, TRC_CLIP_MAX_PIECES);
        for (uint32_t k = 0; k < count; k++) {
            sum += trc_ref_count(&pieces[k]);
            assert_int_equal(pieces[k].part, count > 1 ? TRC_PART_CLIPPED : 0);
            for (int axis = 0; axis < 3; axis++) {
                assert_true(pieces[k].lower[axis] <= pieces[k].upper[axis]);
                assert_true(pieces[k].lower[axis] >= c.ref.lower[axis]);
                assert_true(pieces[k].upper[axis] <= c.ref.upper[axis]);
            }
        }
        assert_int_equal(sum, triangles);
        cut += count > 1;
        for (uint32_t t = 0; t < c.mesh.triangle_count; t++) {
            lost += lost_points(&rng, &c, t, pieces, count, 200);
            points += 200;
        }
    }
    print_figure("points of clipped triangles", "%llu of %llu lost, %llu of 4000 refs cut",
                 (unsigned long long)lost, (unsigned long long)points, (unsigned long long)cut);
    assert_int_equal(lost, 0);
    assert_true(cut > 1000);
}

/* A strip along the diagonal of a cube: in n pieces boxes are n squared times smaller. */
static void pieces_are_smaller(void **state) {
    (void)state;
    struct cluster c = {.positions = {0, 0, 0, 1, 1, 1, 1, 1, 0.999f}};
    struct trc_ref pieces[TRC_CLIP_MAX_PIECES];
    uint32_t triangles;
    float sum = 0.0f;
    cluster_measure(&c, 1);
    const struct trc_clip clip = {trc_ref_box(&c.ref), 0.02f * box_area(trc_ref_box(&c.ref))};
    const uint32_t count = trc_ref_clip(&c.part, &c.ref, &clip, pieces, &triangles);
    assert_int_equal(count, 8);
    for (uint32_t i = 0; i < count; i++)
        sum += box_area(trc_ref_box(&pieces[i]));
    assert_float_equal(sum, 3.0f / 8, 0.01f);
}

static void full_and_small_boxes_stay_whole(void **state) {
    (void)state;
    struct trc_ref pieces[TRC_CLIP_MAX_PIECES];
    struct cluster upright = {.positions = {0, 0, 0, 5, 0, 0, 5, 5, 0, 0, 0, 0, 5, 5, 0, 0, 5, 0}};
    struct cluster slanting = {.positions = {0, 0, 0, 1, 1, 1, 1, 1, 0.99f}};
    struct cluster line = {.positions = {0, 0, 0, 1, 1, 1, 2, 2, 2}};
    struct {
        struct cluster *cluster;
        uint32_t count;
        float min_area;
    } whole[] = {{&upright, 2, 0.0f}, {&upright, 1, 0.0f}, {&slanting, 1, 3.0f}, {&line, 1, 0.0f}};
    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++) {
        struct cluster *c = whole[i].cluster;
        uint32_t triangles;
        cluster_measure(c, whole[i].count);
        const struct trc_clip clip = clip_of(&c->ref, whole[i].min_area);
        assert_int_equal(trc_ref_clip(&c->part, &c->ref, &clip, pieces, &triangles), 1);
        assert_int_equal(triangles, whole[i].count);
        assert_memory_equal(&pieces[0], &c->ref, sizeof c->ref);
    }
}

/* ---- trees ---- */

/* Small triangles in a cube, and long strips across it, turned. */
static void strips_world(struct query_world *world, uint32_t small, uint32_t strips) {
    static const float lower[3] = {-1, -1, -1}, upper[3] = {1, 1, 1};
    struct rng rng = rng_seed(5);
    query_world_init(world);
    struct mesh *mesh = query_world_object(world);
    mesh_add_soup(mesh, &rng, small, lower, upper, 0.02f);
    mesh_add_strips(mesh, &rng, strips, 2.0f, 0.01f);
}

static const struct trc_tree *joined_tree(const struct query_scene *scene) {
    const struct trc_bvh *bvh = query_scene_snapshot(scene->scene)->bvh;
    assert_ptr_equal(bvh->tree, &bvh->joined->tree);
    return bvh->tree;
}

/* Final scenes cut what slants, unless there is no room for pieces; others do not. Boxes are met by
 * chance less often, and any number of threads makes the same tree. */
static void final_trees_are_clipped(void **state) {
    (void)state;
    struct query_world world, full;
    struct query_scene again;
    strips_world(&world, 20000, 40);
    strips_world(&full, 0, 40);
    struct query_scene scene = query_test_scene(&world, true),
                       quick = query_test_scene(&world, false),
                       uncut = query_test_scene(&full, true);
    const struct trc_tree *tree = joined_tree(&scene);
    const struct trc_tree *whole = &query_scene_snapshot(quick.scene)->bvh->blas[0]->tree;
    assert_int_equal(tree->triangle_count, 20080);
    assert_in_range(tree->slot_count, 20500, 20080 + 20080 / 8);
    assert_int_equal(whole->slot_count, 20080);
    assert_int_equal(joined_tree(&uncut)->slot_count, 80);
    print_figure("strips", "SAH cost %.1f with %u slots, %.1f without pieces", tree->sah_cost,
                 tree->slot_count, whole->sah_cost);
    assert_true(tree->sah_cost < 0.8f * whole->sah_cost);
    assert_ok(query_scene_create(&world, true, 4, &again));
    assert_int_equal(joined_tree(&again)->slot_count, tree->slot_count);
    assert_memory_equal(joined_tree(&again)->nodes, tree->nodes,
                        tree->node_count * tree->node_stride);
    query_scene_destroy(&again);
    query_scene_destroy(&uncut);
    query_scene_destroy(&quick);
    query_scene_destroy(&scene);
    query_world_free(&full);
    query_world_free(&world);
}

/* A mesh of several instances has a tree of its own, which its poses refit: it is not clipped. */
static void trees_that_are_refitted_are_not(void **state) {
    (void)state;
    struct query_world world;
    strips_world(&world, 20000, 40);
    query_world_instance(&world, 0);
    struct query_scene scene = query_test_scene(&world, true);
    const struct trc_tree *tree = &query_scene_snapshot(scene.scene)->bvh->blas[0]->tree;
    assert_int_equal(tree->slot_count, 20080);
    assert_false(tree->has_pieces);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* A leaf's box that is too small for what only that leaf has of a triangle. */
static void the_check_finds_lost_pieces(void **state) {
    (void)state;
    struct query_world world;
    char message[256] = "";
    strips_world(&world, 20000, 40);
    struct query_scene scene = query_test_scene(&world, true);
    const struct trc_snapshot *snapshot = query_scene_snapshot(scene.scene);
    const struct trc_tree *tree = joined_tree(&scene);
    uint32_t found = 0, tried = 0;
    for (uint32_t n = 0; n < tree->node_count && tried < 50; n++)
        for (uint32_t i = 0; i < TRC_NODE_WIDTH && tried < 50; i++) {
            const uint32_t ref = trc_node_children(tree, n)[i];
            float *upper = (float *)trc_node_bounds(tree, n) + 8 + i;
            const float whole = *upper;
            if (ref == TRC_REF_EMPTY || !(ref & TRC_REF_LEAF))
                continue;
            tried++;
            *upper = 0.5f * (upper[-8] + whole);
            found += !bvh_check(snapshot->bvh, snapshot, message, sizeof message);
            *upper = whole;
        }
    assert_int_equal(tried, 50);
    assert_int_equal(found, 50);
    assert_non_null(strstr(message, "sticks out"));
    query_scene_destroy(&scene);
    query_world_free(&world);
}

/* Whichever allocation fails, a build says so and keeps no memory. */
static void clipped_builds_fail_cleanly(void **state) {
    (void)state;
    struct query_world world;
    struct query_scene scene;
    strips_world(&world, 20000, 40);
    assert_ok(query_scene_create(&world, true, 1, &scene)); /* what stays is taken here */
    query_scene_destroy(&scene);
    const uint64_t before = trc_memory_bytes();
    trc_status status = TRC_ERROR_OUT_OF_MEMORY;
    int64_t n = 0;
    for (; status != TRC_OK && n < 1000; n++) {
        trc_memory_fail_at(n, false);
        status = query_scene_create(&world, true, 1, &scene);
        trc_memory_fail_at(-1, false);
        if (status == TRC_OK)
            query_scene_destroy(&scene);
        else
            assert_int_equal(status, TRC_ERROR_OUT_OF_MEMORY);
        assert_int_equal(trc_memory_bytes(), before);
    }
    assert_in_range(n, 20, 999);
    query_world_free(&world);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pieces_hold_all_points),
        cmocka_unit_test(pieces_are_smaller),
        cmocka_unit_test(full_and_small_boxes_stay_whole),
        cmocka_unit_test(final_trees_are_clipped),
        cmocka_unit_test(trees_that_are_refitted_are_not),
        cmocka_unit_test(the_check_finds_lost_pieces),
        cmocka_unit_test(clipped_builds_fail_cleanly),
    };
    return cmocka_run_group_tests_name("clip", tests, NULL, NULL);
}
