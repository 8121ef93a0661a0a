/* Instruction sets side by side: what one has built, every other one traces and renders. */
#include "query_test.h"

#include "bvh/tree.h"
#include "fixture.h"

enum { RAYS = 6000, SIZE = 40, FRAME = SIZE * SIZE };

/* Instruction sets of this CPU and build, in rising order. */
static uint32_t isas[TRC_ISA_NEON], isa_count;

static void find_isas(void) {
    for (uint32_t isa = TRC_ISA_SCALAR; isa <= TRC_ISA_NEON; isa++)
        if (trc_set_isa(isa) == TRC_OK)
            isas[isa_count++] = isa;
    assert_ok(trc_set_isa(TRC_ISA_AUTO));
}

/* Enough triangles for builds to be shared among threads, slivers that final scenes clip,
 * instances, keys of both kinds. */
static void fill_world(struct query_world *world) {
    static const float axis[3] = {0.3f, -0.5f, 0.8f}, lower[3] = {-4, -4, -4}, upper[3] = {4, 4, 4};
    struct rng rng = rng_seed(5);
    query_world_init(world);
    mesh_add_soup(query_world_object(world), &rng, 20000, lower, upper, 0.3f);
    mesh_add_strips(query_world_object(world), &rng, 500, 6.0f, 0.01f);
    struct mesh *deformed = query_world_object(world);
    const float centre[3] = {1.0f, 2.0f, -1.0f}, scale[3] = {1.2f, 0.9f, 1.0f};
    float turn[12];
    mesh_add_icosphere(deformed, centre, 1.0f, 3);
    mesh_set_keys(deformed, 3);
    for (uint32_t key = 1; key < 3; key++) {
        query_transform(axis, 0.2f * (float)key, scale, centre, turn);
        mesh_key_transform(deformed, key, turn);
    }
    struct mesh *shared = query_world_mesh(world);
    const float origin[3] = {0, 0, 0};
    mesh_add_icosphere(shared, origin, 0.7f, 3);
    for (int i = 0; i < 3; i++) {
        struct query_instance *instance = query_world_instance(world, 3);
        const float place[3] = {2.0f * (float)i - 2.0f, -2.0f, 1.0f};
        query_transform(axis, (float)i, scale, place, instance->transforms[0]);
        if (i == 2) {
            instance->key_count = 2;
            query_transform(axis, 2.5f, scale, origin, instance->transforms[1]);
        }
    }
}

static void make_rays(struct ray_set *rays) {
    struct rng rng = rng_seed(9);
    ray_set_init(rays);
    for (uint32_t i = 0; i < RAYS; i++) {
        float o[3], d[3];
        for (int k = 0; k < 3; k++)
            o[k] = rng_range(&rng, -6.0f, 6.0f);
        rng_direction(&rng, d);
        ray_set_add(rays, o, d, 0.0f, INFINITY, rng_unit(&rng));
    }
}

static void expect_equal(const void *a, const void *b, size_t bytes, const char *what) {
    if ((a != NULL) != (b != NULL) || (a && memcmp(a, b, bytes) != 0))
        fail_msg("%s differ", what);
}

static void expect_same_tree(const struct trc_tree *a, const struct trc_tree *b) {
    assert_int_equal(a->node_count, b->node_count);
    assert_int_equal(a->slot_count, b->slot_count);
    assert_int_equal(a->key_count, b->key_count);
    assert_int_equal(a->root, b->root);
    assert_int_equal(a->node_stride, b->node_stride);
    expect_equal(a->nodes, b->nodes, a->node_count * a->node_stride, "nodes");
    assert_int_equal(a->vertex_floats, b->vertex_floats);
    expect_equal(a->vertices, b->vertices, sizeof(float) * a->vertex_floats, "vertices");
    if (a->slots && b->slots)
        expect_equal(a->slots->slots, b->slots->slots, a->slot_count * sizeof(struct trc_slot),
                     "slots");
}

static void expect_same_trees(trc_scene x, trc_scene y) {
    const struct trc_bvh *a = query_scene_snapshot(x)->bvh, *b = query_scene_snapshot(y)->bvh;
    expect_same_tree(&a->top, &b->top);
    assert_int_equal(a->joined != NULL, b->joined != NULL);
    if (a->joined)
        expect_same_tree(&a->joined->tree, &b->joined->tree);
    assert_int_equal(a->blas_count, b->blas_count);
    for (uint32_t i = 0; i < a->blas_count; i++) {
        assert_int_equal(a->blas[i] != NULL, b->blas[i] != NULL);
        if (a->blas[i])
            expect_same_tree(&a->blas[i]->tree, &b->blas[i]->tree);
    }
}

/* All pairs: scenes built by one set, hits found by the other, bit by bit. */
static void expect_same_hits(const struct query_scene *scenes, const struct ray_set *rays) {
    struct hit_set reference, hits;
    hit_set_init(&reference, rays->count);
    hit_set_init(&hits, rays->count);
    assert_ok(trc_set_isa(isas[0]));
    assert_ok(hit_set_query(&reference, scenes[0].scene, rays, 64));
    uint32_t hit_count = 0;
    for (uint32_t i = 0; i < rays->count; i++)
        hit_count += reference.instance[i] != TRC_NO_HIT;
    assert_true(hit_count > rays->count / 4);
    for (uint32_t built = 0; built < isa_count; built++)
        for (uint32_t traced = 0; traced < isa_count; traced++) {
            assert_ok(trc_set_isa(isas[traced]));
            assert_ok(hit_set_query(&hits, scenes[built].scene, rays, 64));
            const uint32_t ray = hit_set_difference(&hits, &reference);
            if (ray != UINT32_MAX)
                fail_msg("built by %s, traced by %s: ray %u", trc_isa_name(isas[built]),
                         trc_isa_name(isas[traced]), ray);
        }
    hit_set_free(&reference);
    hit_set_free(&hits);
}

static void trees_serve_all(void **state) {
    (void)state;
    struct query_world world;
    struct ray_set rays;
    fill_world(&world);
    make_rays(&rays);
    for (int is_final = 0; is_final < 2; is_final++) {
        struct query_scene scenes[TRC_ISA_NEON];
        for (uint32_t i = 0; i < isa_count; i++) {
            assert_ok(trc_set_isa(isas[i]));
            assert_ok(query_scene_create(&world, is_final, 2, &scenes[i]));
            expect_same_trees(scenes[0].scene, scenes[i].scene);
        }
        expect_same_hits(scenes, &rays);
        /* Refits by another set than the one that built. */
        for (uint32_t i = 0; i < world.meshes[3].vertex_count * 3; i++)
            world.meshes[3].positions[i] *= 1.1f;
        for (uint32_t i = 0; i < isa_count; i++) {
            assert_ok(trc_set_isa(isas[isa_count - 1 - i]));
            assert_ok(query_scene_pose(&scenes[i], &world, 3));
            expect_same_trees(scenes[0].scene, scenes[i].scene);
        }
        expect_same_hits(scenes, &rays);
        for (uint32_t i = 0; i < isa_count; i++)
            query_scene_destroy(&scenes[i]);
    }
    assert_ok(trc_set_isa(TRC_ISA_AUTO));
    ray_set_free(&rays);
    query_world_free(&world);
}

/* A scene's trees stay as they are when the set changes. */
static void trees_stay(void **state) {
    (void)state;
    const trc_scene scene = fixture_scene();
    const struct trc_bvh *bvh = query_scene_snapshot(scene)->bvh;
    for (uint32_t i = 0; i < isa_count; i++) {
        assert_ok(trc_set_isa(isas[i]));
        assert_ok(trc_scene_commit(scene));
        assert_ptr_equal(query_scene_snapshot(scene)->bvh, bvh);
    }
    assert_ok(trc_set_isa(TRC_ISA_AUTO));
    assert_ok(trc_scene_destroy(scene));
}

/* Pictures are those of the set that renders, whatever it was that committed; and hence lights,
 * maps of the world and folded materials are as good for all. */
static void snapshots_serve_all(void **state) {
    (void)state;
    static float reference[TRC_ISA_NEON][4 * FRAME], pixels[4 * FRAME];
    const trc_render_desc desc = default_render_desc(SIZE, SIZE, 4);
    for (uint32_t built = 0; built < isa_count; built++) {
        assert_ok(trc_set_isa(isas[built]));
        const trc_scene scene = fixture_scene();
        const trc_world_desc world =
            default_world_desc(fixture_material(scene, TRC_NODE_BACKGROUND, 0.25f));
        assert_ok(trc_scene_set_world(scene, &world));
        assert_ok(trc_scene_commit(scene));
        for (uint32_t drawn = 0; drawn < isa_count; drawn++) {
            assert_ok(trc_set_isa(isas[drawn]));
            fixture_draw(scene, &desc, TRC_PASS_COMBINED, pixels, 4 * FRAME);
            if (built == 0)
                memcpy(reference[drawn], pixels, sizeof pixels);
            else if (memcmp(reference[drawn], pixels, sizeof pixels) != 0)
                fail_msg("built by %s, drawn by %s", trc_isa_name(isas[built]),
                         trc_isa_name(isas[drawn]));
        }
        assert_ok(trc_scene_destroy(scene));
    }
    assert_ok(trc_set_isa(TRC_ISA_AUTO));
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(trees_serve_all),
                                       cmocka_unit_test(trees_stay),
                                       cmocka_unit_test(snapshots_serve_all)};
    find_isas();
    return cmocka_run_group_tests_name("instruction sets", tests, NULL, NULL);
}
