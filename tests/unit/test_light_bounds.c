/* What the bounds of emissive triangles promise: positions and normals of all that they stand for,
 * at every time, in a list of lights and in a tree. A point that they leave out gets no light. */
#include "fixture.h"

#include <stdbool.h>
#include <stdio.h>

#include "model/lights.h"
#include "query_scene.h"
#include "rng.h"

enum { KEYS = 3, TIMES = 9 };

/* Triangles of any place, nearly level; at later keys moved, or moved and turned to any side. */
static trc_scene shining(uint32_t count, bool moves, bool turns) {
    static float positions[KEYS * 9 * 128];
    static uint32_t indices[3 * 128];
    static const float level[9] = {-0.5f, -0.5f, 0, 0.5f, -0.5f, 0, 0, 0.5f, 0};
    struct rng rng = rng_seed(count + moves + 2 * turns);
    const uint32_t keys = moves ? KEYS : 1;
    for (uint32_t t = 0; t < count; t++) {
        float center[3], way[3];
        for (int i = 0; i < 3; i++) {
            center[i] = rng_range(&rng, -5.0f, 5.0f);
            way[i] = rng_range(&rng, -0.5f, 0.5f);
        }
        float corner[9] = {0};
        for (uint32_t k = 0; k < keys; k++)
            for (int v = 0; v < 3; v++)
                for (int i = 0; i < 3; i++) {
                    if (k == 0)
                        corner[3 * v + i] = level[3 * v + i] + rng_range(&rng, -0.1f, 0.1f);
                    else if (turns)
                        corner[3 * v + i] = rng_range(&rng, -0.5f, 0.5f);
                    positions[9 * (k * count + t) + 3 * (uint32_t)v + (uint32_t)i] =
                        center[i] + corner[3 * v + i] + (float)k * way[i];
                }
        for (uint32_t v = 0; v < 3; v++)
            indices[3 * t + v] = 3 * t + v;
    }
    const trc_scene scene = fixture_level_view();
    trc_mesh_desc desc = default_mesh_desc();
    desc.key_count = keys;
    desc.vertex_count = 3 * count;
    desc.triangle_count = count;
    desc.positions = positions;
    desc.position_count = (uint64_t)keys * 9 * count;
    desc.indices = indices;
    desc.index_count = 3 * count;
    fixture_mesh(scene, &desc, fixture_material(scene, TRC_NODE_EMISSION, 1.0f), 0);
    /* What light samples are taken for. */
    fixture_level(scene, 20.0f, -9.0f, fixture_material(scene, TRC_NODE_DIFFUSE, 0.5f));
    assert_int_equal(trc_scene_commit(scene), TRC_OK);
    return scene;
}

static void corners_at(const struct trc_snapshot *s, const struct trc_light_triangle *light,
                       double time, double p[3][3]) {
    const struct trc_mesh *mesh = s->meshes[s->instances[light->instance].mesh];
    const double at = time * (mesh->key_count - 1);
    const uint32_t key =
        mesh->key_count > 1 && at >= mesh->key_count - 1 ? mesh->key_count - 2 : (uint32_t)at;
    const double f = at - key;
    for (int v = 0; v < 3; v++) {
        const uint32_t index = mesh->indices[3 * light->triangle + v];
        const float *a = mesh->positions + 3 * ((size_t)key * mesh->vertex_count + index);
        const float *b = mesh->key_count > 1 ? a + 3 * (size_t)mesh->vertex_count : a;
        for (int i = 0; i < 3; i++)
            p[v][i] = (1.0 - f) * (double)a[i] + f * (double)b[i];
    }
}

/* The triangle at that time is within the bound. Single precision: 1e-4. */
static void expect_within(const struct trc_light_bound *b, const double p[3][3]) {
    double e[2][3], n[3], size = 0.0, cosine = 0.0;
    for (int i = 0; i < 3; i++) {
        e[0][i] = p[1][i] - p[0][i];
        e[1][i] = p[2][i] - p[0][i];
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = e[0][j] * e[1][k] - e[0][k] * e[1][j];
        size += n[i] * n[i];
        cosine += n[i] * (double)b->axis[i];
    }
    cosine /= sqrt(size);
    for (int v = 0; v < 3; v++) {
        double distance = 0.0;
        for (int i = 0; i < 3; i++)
            distance += pow(p[v][i] - (double)b->center[i], 2.0);
        if (sqrt(distance) > (double)b->radius * (1.0 + 1e-4) + 1e-5)
            fail_msg("a corner %g from the middle of a bound of radius %g", sqrt(distance),
                     (double)b->radius);
    }
    if (b->cos_o <= -1.0f)
        return; /* all directions */
    assert_true(b->two_sided);
    if (fabs(cosine) < (double)b->cos_o - 1e-4)
        fail_msg("a normal of cosine %g to the axis of a cone of %g", fabs(cosine),
                 (double)b->cos_o);
}

/* All triangles of the subtree at a bound are within it, and within those below it. */
static uint32_t expect_subtree(const struct trc_snapshot *s, uint32_t top, uint32_t node) {
    const struct trc_light_table *t = s->lights;
    const struct trc_light_bound *b = &t->bounds[node];
    if (b->child >= 0)
        return expect_subtree(s, top, node + 1) + expect_subtree(s, top, (uint32_t)b->child);
    const struct trc_light_triangle *light = &t->triangles[(uint32_t)b->light - t->first_triangle];
    for (int k = 0; k < TIMES; k++) {
        double p[3][3];
        corners_at(s, light, (double)k / (TIMES - 1), p);
        expect_within(&t->bounds[top], p);
    }
    return 1;
}

static void bounds_hold_what_they_stand_for(void **state) {
    (void)state;
    static const uint32_t counts[] = {8, 100}; /* a list, a tree */
    for (int n = 0; n < 2; n++)
        for (int motion = 0; motion < 3; motion++) {
            const trc_scene scene = shining(counts[n], motion > 0, motion > 1);
            const struct trc_snapshot *s = query_scene_snapshot(scene);
            const struct trc_light_table *t = s->lights;
            assert_int_equal(t->triangle_count, counts[n]);
            assert_int_equal(t->moves, motion > 0);
            assert_int_equal(t->bound_count, n ? 2 * counts[n] - 1 : counts[n]);
            uint32_t inner = 0, cones = 0;
            for (uint32_t top = 0; top < t->bound_count; top++) {
                inner += t->bounds[top].child >= 0;
                cones += t->bounds[top].cos_o > -1.0f;
                assert_true(expect_subtree(s, top, top) >= 1);
            }
            assert_int_equal(inner, n ? counts[n] - 1 : 0);
            assert_int_equal(cones, motion ? 0 : t->bound_count);
            assert_int_equal(trc_scene_destroy(scene), TRC_OK);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(bounds_hold_what_they_stand_for)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
