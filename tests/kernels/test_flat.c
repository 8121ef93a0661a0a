/* Rays that start just before, on and behind axis-aligned triangles, the floors and walls of most
 * scenes, against exact arithmetic: a ray that leaves a wall never meets it again, one that starts
 * before it does. */
#include "figures.h"
#include "query_test.h"

#define EXTENT 10.0f /* of the wall: rays pass through it, however steep */

static const uint32_t packet_sizes[] = {1, 4, 64, 256};

/* A wall in the plane where the axis has the value of height, which moves to height + travel. */
struct wall {
    int axis;
    float height, travel;
};

static void add_wall(struct query_world *world, const struct wall *wall) {
    struct mesh *mesh = query_world_object(world);
    const float corners[4][2] = {
        {-EXTENT, -EXTENT}, {EXTENT, -EXTENT}, {EXTENT, EXTENT}, {-EXTENT, EXTENT}};
    for (int i = 0; i < 4; i++) {
        float p[3];
        p[wall->axis] = wall->height;
        p[(wall->axis + 1) % 3] = corners[i][0];
        p[(wall->axis + 2) % 3] = corners[i][1];
        mesh_add_vertex(mesh, p[0], p[1], p[2]);
    }
    mesh_add_quad(mesh, 0, 1, 2, 3);
    if (wall->travel == 0.0f)
        return;
    mesh_set_keys(mesh, 2);
    for (int i = 0; i < 4; i++)
        mesh_key(mesh, 1)[3 * i + wall->axis] = wall->height + wall->travel;
}

/* A ray whose origin is depth before the plane (behind: negative), which it meets within the
 * wall. Quarters are exact times of the wall's travel, so the plane it meets is exact too. */
static void add_ray(struct ray_set *rays, const struct wall *wall, struct rng *rng, float depth,
                    float tmin) {
    const float time = 0.25f * (float)rng_below(rng, 5);
    const float plane = wall->height + time * wall->travel;
    const float towards = rng_below(rng, 2) ? 1.0f : -1.0f;
    float o[3], d[3];
    for (int k = 0; k < 3; k++) {
        d[k] = rng_range(rng, -1.0f, 1.0f);
        o[k] = rng_range(rng, -1.0f, 1.0f);
    }
    if (rng_below(rng, 2)) { /* through the edge that the wall's triangles share */
        const int u = (wall->axis + 1) % 3, v = (wall->axis + 2) % 3;
        o[u] = o[v];
        d[u] = d[v];
    }
    /* From steep to grazing: flat in the dominant axis or in another one. */
    d[wall->axis] = towards * ldexpf(rng_range(rng, 0.5f, 1.0f), -(int)rng_below(rng, 3));
    o[wall->axis] = plane - towards * depth;
    ray_set_add(rays, o, d, tmin, INFINITY, time);
}

/* The distance at which a ray meets the plane; floats are exact in double, so its sign is right. */
static double distance_of(const struct ray_set *rays, uint32_t ray, const struct wall *wall) {
    float o[3], d[3];
    ray_set_get(rays, ray, o, d);
    const double plane = (double)wall->height + (double)rays->time[ray] * (double)wall->travel;
    return (plane - (double)o[wall->axis]) / (double)d[wall->axis];
}

/* What is off by more than that is computed in double (TRC_T_IMPRECISE of triangle.h). */
#define T_PRECISION (1.0 / 512.0)

/* How near a plane may be for a ray to pass it: what floats say is not ahead is not asked again in
 * double. Their error for the lengths at hand, 8 half-ulps of the vertices' lengths, sideways ones
 * times the slope. */
static double blind_distance(const struct ray_set *rays, uint32_t ray, const struct wall *wall) {
    float o[3], d[3];
    ray_set_get(rays, ray, o, d);
    double longest = 0.0;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, fabs((double)d[k]));
    const double slope = longest / fabs((double)d[wall->axis]);
    return 8.0 * 0x1p-24 * 2.0 * EXTENT * (1.0 + slope) / longest;
}

/* Returns how many rays were right. */
static uint64_t check_wall(const struct wall *wall, uint32_t seed, float tmin) {
    struct query_world world;
    struct ray_set rays;
    struct hit_set hits;
    struct rng rng = rng_seed(seed);
    query_world_init(&world);
    ray_set_init(&rays);
    add_wall(&world, wall);
    const uint32_t count = query_test_rays(4096);
    for (uint32_t i = 0; i < count; i++) {
        const float depth = rng_below(&rng, 8)
                                ? ldexpf(rng_range(&rng, 0.5f, 1.0f), -(int)rng_below(&rng, 28))
                                : 0.0f;
        add_ray(&rays, wall, &rng, rng_below(&rng, 2) ? depth : -depth, tmin);
    }
    struct query_scene scene = query_test_scene(&world, false);
    hit_set_init(&hits, count);
    for (size_t size = 0; size < sizeof packet_sizes / sizeof *packet_sizes; size++) {
        assert_ok(hit_set_query(&hits, scene.scene, &rays, packet_sizes[size]));
        for (uint32_t i = 0; i < count; i++) {
            const double distance = distance_of(&rays, i, wall);
            const bool hit = hits.instance[i] != TRC_NO_HIT;
            const double off = fabs((double)hits.distance[i] - distance);
            const bool may = distance > (double)tmin;
            const bool must = may && fabs(distance) > blind_distance(&rays, i, wall);
            if (hit == (hits.occluded[i] != 0) &&
                (hit ? may && off <= T_PRECISION * fabs(distance) : !must))
                continue;
            hit_set_print(&hits, &rays, i);
            fail_msg("axis %d, packets of %u, ray %u: the wall is at %a", wall->axis,
                     packet_sizes[size], i, distance);
        }
    }
    hit_set_free(&hits);
    query_scene_destroy(&scene);
    ray_set_free(&rays);
    query_world_free(&world);
    return count;
}

/* Heights and travels with few bits: see add_ray. */
static void walls(float tmin, const char *what) {
    static const float heights[] = {0.0f, 1.0f, -3.0f, 0.40625f}, travels[] = {0.0f, 2.0f, -0.5f};
    uint32_t seed = 0;
    uint64_t total = 0;
    for (int axis = 0; axis < 3; axis++)
        for (size_t h = 0; h < sizeof heights / sizeof *heights; h++)
            for (size_t t = 0; t < sizeof travels / sizeof *travels; t++) {
                const struct wall wall = {axis, heights[h], travels[t]};
                total += check_wall(&wall, ++seed, tmin);
            }
    print_right(what, total);
}

static void rays_ahead(void **state) {
    (void)state;
    walls(0.0f, "27, 28: origins a float to half a unit before, on and behind walls");
}

/* A ray that starts before its origin meets what is behind it. */
static void rays_both_ways(void **state) {
    (void)state;
    walls(-INFINITY, "rays that begin before their origins there");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rays_ahead),
        cmocka_unit_test(rays_both_ways),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("flat", tests, NULL, NULL);
}
