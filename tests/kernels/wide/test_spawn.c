/* Rays that leave a surface: they do not meet it again, and begin no farther off than they must.
 *
 * Hard case 27: triangles of .01 to 100 units, up to a million units from the origin, rays from
 * along the normal to 1e-6 from grazing. The offset is compared with the bound of M. Pharr, W.
 * Jakob and G. Humphreys, "Physically Based Rendering", 3rd ed. 2016, section 3.9. */
#include "wide_test.h"

#include "figures.h"
#include "kernels/simd/wide_math.h"
#include "kernels/trace/object_rays.h"
#include "kernels/trace/spawn.h"
#include "model/kernels.h"
#include "query_test.h"

extern const struct trc_kernels TRC_KERNEL(trc_kernels);

#define TRIANGLES 512
#define ROUNDS 16         /* rays of each triangle for each angle */
#define LOOKING_BACK 6400 /* rays that go on through surfaces, of any width */
#define GAMMA(n) ((n)*0x1p-24 / (1.0 - (n)*0x1p-24))

/* A triangle of about that size, that far from the origin, whose corners are not on a line. */
static void add_triangle(struct mesh *mesh, struct rng *rng, float size, float distance) {
    float center[3], p[3][3];
    double normal[3];
    do {
        rng_direction(rng, center);
        for (int v = 0; v < 3; v++)
            for (int i = 0; i < 3; i++)
                p[v][i] = distance * center[i] + size * rng_range(rng, -0.5f, 0.5f);
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            normal[i] = ((double)p[1][j] - p[0][j]) * ((double)p[2][k] - p[0][k]) -
                        ((double)p[1][k] - p[0][k]) * ((double)p[2][j] - p[0][j]);
        }
    } while (normal[0] == 0.0 && normal[1] == 0.0 && normal[2] == 0.0);
    for (int v = 0; v < 3; v++)
        mesh_add_vertex(mesh, p[v][0], p[v][1], p[v][2]);
    const uint32_t first = mesh->vertex_count - 3;
    mesh_add_triangle(mesh, first, first + 1, first + 2);
}

/* Surfaces of the first instance's triangles first, first + step and so on, at random places, seen
 * from random sides at random times. */
static struct trc_surface surfaces(const struct trc_snapshot *snapshot, uint32_t first,
                                   uint32_t step, struct rng *rng) {
    struct trc_surface s;
    float u[TRC_WIDTH], v[TRC_WIDTH];
    int32_t triangle[TRC_WIDTH];
    memset(&s, 0, sizeof s);
    for (uint32_t k = 0; k < TRC_WIDTH; k++) {
        triangle[k] = (int32_t)(first + k * step);
        u[k] = rng_unit(rng);
        v[k] = rng_unit(rng) * (1.0f - u[k]);
    }
    s.snapshot = snapshot;
    s.active = vm_all_set();
    s.triangle = vi_load(triangle);
    s.time = test_wide_uniform(rng);
    s.u = vf_load(u);
    s.v = vf_load(v);
    s.wo = trc_warp_sphere(test_wide_uniform(rng), test_wide_uniform(rng));
    trc_surface_fetch(&s);
    return s;
}

/* Directions at that cosine to the normal, to either side. */
static vvec3 leaving(const struct trc_surface *s, float cosine, struct rng *rng) {
    const vvec3 any = trc_warp_sphere(test_wide_uniform(rng), test_wide_uniform(rng));
    const vfloat sign =
        vf_select(vf_lt(test_wide_uniform(rng), vf_set(0.5f)), vf_one(), vf_set(-1.0f));
    const vvec3 along = v3_normalize(v3_sub(any, v3_scale(s->ng, v3_dot(any, s->ng))));
    return v3_add(v3_scale(s->ng, sign * vf_set(cosine)),
                  v3_scale(along, vf_set(sqrtf(1.0f - cosine * cosine))));
}

static void add_rays(const struct trc_surface *s, vvec3 o, vvec3 w, struct ray_set *rays) {
    for (int k = 0; k < TRC_WIDTH; k++) {
        const float origin[3] = {vf_get(o.x, k), vf_get(o.y, k), vf_get(o.z, k)};
        const float direction[3] = {vf_get(w.x, k), vf_get(w.y, k), vf_get(w.z, k)};
        ray_set_add(rays, origin, direction, 0.0f, INFINITY, vf_get(s->time, k));
    }
}

/* The largest offsets, ours and those of the book. */
struct offsets {
    double ours, book;
};

/* The book's has gamma(7) for what interpolates the corners, and gamma(3) for the products of the
 * matrix, which is the identity here. */
static void offsets_add(struct offsets *largest, const struct mesh *mesh,
                        const struct trc_surface *s, int lane) {
    const int32_t triangle = vi_get(s->triangle, lane);
    const double u = vf_get(s->u, lane), v = vf_get(s->v, lane);
    const vfloat p[3] = {s->p.x, s->p.y, s->p.z}, ng[3] = {s->ng.x, s->ng.y, s->ng.z};
    const vfloat error[3] = {s->p_error.x, s->p_error.y, s->p_error.z};
    double ours = 0.0, book = 0.0;
    for (int i = 0; i < 3; i++) {
        const float *corner = mesh->positions + 9 * (size_t)triangle + i;
        const double sum = (1.0 - u - v) * fabs((double)corner[0]) + u * fabs((double)corner[3]) +
                           v * fabs((double)corner[6]);
        const double n = fabs((double)vf_get(ng[i], lane));
        ours += n * (double)vf_get(error[i], lane);
        book +=
            n * ((GAMMA(3) + 1.0) * GAMMA(7) * sum + GAMMA(3) * fabs((double)vf_get(p[i], lane)));
    }
    largest->ours = fmax(largest->ours, ours);
    largest->book = fmax(largest->book, book);
}

/* Rays of all triangles at that cosine. */
static void spawn_all(const struct mesh *mesh, const struct trc_snapshot *snapshot, float cosine,
                      struct rng *rng, struct ray_set *rays, struct offsets *largest) {
    for (uint32_t first = 0; first < TRIANGLES; first += TRC_WIDTH) {
        const struct trc_surface s = surfaces(snapshot, first, 1, rng);
        const vvec3 w = leaving(&s, cosine, rng);
        const vvec3 o = trc_spawn_origin(&s, vf_ge(v3_dot(w, s.ng), vf_zero()));
        add_rays(&s, o, w, rays);
        for (int k = 0; k < TRC_WIDTH; k++)
            offsets_add(largest, mesh, &s, k);
    }
}

/* Ray i left triangle i % TRIANGLES. */
static uint64_t count_self_hits(trc_scene scene, const struct ray_set *rays) {
    struct hit_set hits;
    uint64_t count = 0;
    hit_set_init(&hits, rays->count);
    assert_ok(hit_set_query(&hits, scene, rays, 64));
    for (uint32_t i = 0; i < rays->count; i++)
        count += hits.instance[i] == 0 && hits.triangle[i] == i % TRIANGLES;
    hit_set_free(&hits);
    return count;
}

static const float cosines[] = {1e-6f, 1e-3f, 0.1f, 1.0f};

/* Rays and self-hits of all worlds so far. */
struct tally {
    uint64_t self_hits, rays;
};

/* Leaves the triangles of the world's first instance; returns the largest offsets. */
static struct offsets leave_all(const struct query_world *world, bool is_final, struct rng *rng,
                                struct tally *tally) {
    struct ray_set rays;
    struct offsets largest = {0.0, 0.0};
    struct query_scene scene = query_test_scene(world, is_final);
    ray_set_init(&rays);
    for (int k = 0; k < 4 * ROUNDS; k++)
        spawn_all(&world->meshes[0], query_scene_snapshot(scene.scene), cosines[k % 4], rng, &rays,
                  &largest);
    tally->self_hits += count_self_hits(scene.scene, &rays);
    tally->rays += rays.count;
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    return largest;
}

static void print_tally(const char *what, const struct tally *tally) {
    print_figure(what, "%" PRIu64 " self-hits of %" PRIu64 " rays", tally->self_hits, tally->rays);
    assert_int_equal(tally->self_hits, 0);
}

/* Triangles where they are; returns the largest offset over the book's. */
static double leave_triangles(float size, float distance, bool is_final, struct rng *rng,
                              struct tally *tally) {
    struct query_world world;
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    for (uint32_t t = 0; t < TRIANGLES; t++)
        add_triangle(mesh, rng, size, distance);
    const struct offsets largest = leave_all(&world, is_final, rng, tally);
    query_world_free(&world);
    return largest.ours / largest.book;
}

/* Where a triangle is as large as its distance from the origin, what is interpolated along its
 * edges costs more. */
static void surfaces_are_left(void **state) {
    (void)state;
    static const float sizes[] = {0.01f, 1.0f, 100.0f}, distances[] = {0.0f, 1e2f, 1e4f, 1e6f};
    struct rng rng = rng_seed(27);
    struct tally tally = {0, 0};
    double far_share = 0.0, near_share = 0.0;
    for (int i = 0; i < 24; i++) {
        const float size = sizes[i % 3], distance = distances[i / 3 % 4];
        const double share = leave_triangles(size, distance, i >= 12, &rng, &tally);
        double *worst = distance >= 10.0f * size ? &far_share : &near_share;
        *worst = fmax(*worst, share);
    }
    print_tally("27: rays that leave a surface", &tally);
    print_figure("27: their offsets",
                 "at most %.2f of pbrt's, %.2f where a triangle is at the origin", far_share,
                 near_share);
    assert_true(far_share < 0.15);
    assert_true(near_share < 0.8);
}

/* Turned and scaled, that far from the origin. */
static void place(struct query_instance *instance, uint32_t key_count, const float scale[3],
                  float distance, struct rng *rng) {
    instance->key_count = key_count;
    for (uint32_t key = 0; key < key_count; key++) {
        float axis[3], offset[3];
        rng_direction(rng, axis);
        rng_direction(rng, offset);
        for (int i = 0; i < 3; i++)
            offset[i] *= distance;
        query_transform(axis, rng_range(rng, -3.0f, 3.0f), scale, offset,
                        instance->transforms[key]);
    }
}

/* Rays that leave an instance of a mesh, both of so many keys; another one keeps them out of world
 * space. */
static void leave_instance(const float scale[3], float distance, uint32_t key_count,
                           struct rng *rng, struct tally *tally) {
    struct query_world world;
    query_world_init(&world);
    struct mesh *mesh = query_world_mesh(&world);
    for (uint32_t t = 0; t < TRIANGLES; t++)
        add_triangle(mesh, rng, 0.5f, 1.0f);
    mesh_set_keys(mesh, key_count);
    for (uint32_t i = 0; i < 3 * mesh->vertex_count * (key_count - 1); i++)
        mesh_key(mesh, 1)[i] += rng_range(rng, -0.1f, 0.1f);
    for (int k = 0; k < 2; k++)
        place(query_world_instance(&world, 0), key_count, scale, distance, rng);
    leave_all(&world, false, rng, tally);
    query_world_free(&world);
}

static void instances_are_left(void **state) {
    (void)state;
    static const float scales[][3] = {
        {1, 1, 1}, {100, 100, 100}, {0.01f, 0.01f, 0.01f}, {-2, 2, 2}, {0.1f, 1, 5}};
    static const float distances[] = {0.0f, 1.0f, 1e2f, 1e4f, 1e6f};
    struct rng rng = rng_seed(29);
    struct tally tally = {0, 0};
    for (uint32_t key_count = 1; key_count < 3; key_count++)
        for (int i = 0; i < 25; i++)
            leave_instance(scales[i % 5], distances[i / 5], key_count, &rng, &tally);
    print_tally("27: rays that leave instances", &tally);
}

/* Each coordinate's tenth float away from 0. */
static void add_ten_floats_out(struct mesh *mesh, uint32_t first) {
    for (uint32_t v = first; v < first + 3; v++) {
        float p[3];
        for (int i = 0; i < 3; i++) {
            p[i] = mesh->positions[3 * v + (uint32_t)i];
            for (int k = 0; k < 10; k++)
                p[i] = nextafterf(p[i], copysignf(INFINITY, p[i]));
        }
        mesh_add_vertex(mesh, p[0], p[1], p[2]);
    }
    mesh_add_triangle(mesh, first + 3, first + 4, first + 5);
}

/* A triangle about the z axis at height z, of that size. */
static void add_sheet(struct mesh *mesh, float size, float z) {
    mesh_add_vertex(mesh, -size, -size, z);
    mesh_add_vertex(mesh, 2.0f * size, -size, z);
    mesh_add_vertex(mesh, -size, 2.0f * size, z);
    mesh_add_triangle(mesh, 0, 1, 2);
}

/* A triangle of unit size ten units from the origin, turned by up to 40 degrees from facing it. */
static void add_tilted_sheet(struct mesh *mesh, struct rng *rng) {
    static const float scale[3] = {1.0f, 1.0f, 1.0f}, up[3] = {0.0f, 0.0f, 0.0f};
    float axis[3], transform[12];
    add_sheet(mesh, 1.0f, 10.0f);
    for (int k = 0; k < 3; k++) /* heights of the corners */
        mesh->positions[3 * k + 2] += rng_range(rng, -1.0f, 1.0f);
    rng_direction(rng, axis);
    query_transform(axis, rng_range(rng, -3.0f, 3.0f), scale, up, transform);
    mesh_transform(mesh, 0, transform);
}

/* Adds rays that leave the middle of triangle 0 away from the origin, at that cosine. */
static void leave_outwards(const struct trc_snapshot *snapshot, float cosine, struct rng *rng,
                           struct ray_set *rays) {
    struct trc_surface s = surfaces(snapshot, 0, 0, rng);
    s.u = s.v = vf_set(0.3f);
    trc_surface_fetch(&s);
    const vvec3 w = leaving(&s, cosine, rng);
    const vmask inwards = vf_lt(v3_dot(w, s.ng) * v3_dot(s.p, s.ng), vf_zero());
    const vvec3 turned = v3_sub(w, v3_scale(s.ng, vf_set(2.0f) * v3_dot(w, s.ng)));
    const vvec3 out = v3_select(inwards, turned, w);
    add_rays(&s, trc_spawn_origin(&s, vf_ge(v3_dot(out, s.ng), vf_zero())), out, rays);
}

/* Of rays that leave triangle 0 towards triangle 1, those that do not meet it. */
static void meet_second(const struct query_world *world, struct rng *rng, uint64_t *missed,
                        uint64_t *total) {
    static const float slants[] = {1.0f, 0.9f, 0.75f, 0.3f, 0.1f, 0.01f};
    struct ray_set rays;
    struct hit_set hits;
    struct query_scene scene = query_test_scene(world, false);
    ray_set_init(&rays);
    for (int k = 0; rays.count < 6000; k++)
        leave_outwards(query_scene_snapshot(scene.scene), slants[k % 6], rng, &rays);
    hit_set_init(&hits, rays.count);
    assert_ok(hit_set_query(&hits, scene.scene, &rays, 64));
    for (uint32_t k = 0; k < rays.count; k++)
        *missed += hits.instance[k] == TRC_NO_HIT || hits.triangle[k] != 1 || !hits.occluded[k];
    *total += rays.count;
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
}

/* Hard case 28: sheets ten floats apart, level and tilted, are told apart by rays that leave one
 * towards the other, up to 89.4 degrees from the normal. */
static void near_sheets_are_met(void **state) {
    (void)state;
    static const float heights[] = {1.0f, 1.37f, 700.0f, 1e6f};
    struct rng rng = rng_seed(28);
    uint64_t missed = 0, total = 0;
    for (int i = 0; i < 20; i++) {
        struct query_world world;
        query_world_init(&world);
        struct mesh *mesh = query_world_object(&world);
        if (i < 4)
            add_sheet(mesh, fmaxf(1e-3f * heights[i], 1.0f),
                      heights[i]); /* wide enough for slants */
        else
            add_tilted_sheet(mesh, &rng);
        add_ten_floats_out(mesh, 0);
        meet_second(&world, &rng, &missed, &total);
        query_world_free(&world);
    }
    print_figure("28: a sheet ten floats above another", "not met by %llu of %llu rays",
                 (unsigned long long)missed, (unsigned long long)total);
    assert_int_equal(missed, 0);
}

/* ---- the bound itself ---- */

/* Small triangles about one unit from the origin, in planes through it: what the matrix adds is
 * most of their error. */
static void add_radial_triangles(struct mesh *mesh, struct rng *rng) {
    for (uint32_t t = 0; t < TRIANGLES; t++) {
        float center[3], side[3];
        rng_direction(rng, center);
        rng_direction(rng, side);
        const uint32_t axis = t % 3; /* of the plane's normal */
        for (int v = 0; v < 3; v++) {
            float p[3];
            for (int i = 0; i < 3; i++)
                p[i] = center[i] + (v == 1 ? 0.01f * side[i] : v == 2 ? 0.01f * side[2 - i] : 0.0f);
            p[axis] = 0.0f;
            mesh_add_vertex(mesh, p[0], p[1], p[2]);
        }
        mesh_add_triangle(mesh, 3 * t, 3 * t + 1, 3 * t + 2);
    }
}

/* The error of a point has room for what its image in object space is off by, seen from the world:
 * five half-ulps of |M| |image|, which test_object_rays.c holds object_rays.h to. About the origin
 * of the world little else is in it. */
static void errors_cover_the_way_to_object_space(void **state) {
    (void)state;
    static const float scale[3] = {1, 1, 1};
    struct rng rng = rng_seed(31);
    double most = 0.0;
    for (int world = 0; world < 20; world++) {
        struct query_world w;
        query_world_init(&w);
        add_radial_triangles(query_world_mesh(&w), &rng);
        for (int k = 0; k < 2; k++)
            place(query_world_instance(&w, 0), 1, scale, 0.0f, &rng);
        struct query_scene scene = query_test_scene(&w, false);
        const struct trc_snapshot *snapshot = query_scene_snapshot(scene.scene);
        const float *m = snapshot->instances[0].object_to_world->m;
        for (uint32_t first = 0; first < TRIANGLES; first += TRC_WIDTH) {
            const struct trc_surface s = surfaces(snapshot, first, 1, &rng);
            const vfloat p[3] = {s.p.x, s.p.y, s.p.z};
            const vfloat error[3] = {s.p_error.x, s.p_error.y, s.p_error.z};
            struct trc_packet rays, image;
            memset(&rays, 0, sizeof rays);
            for (int i = 0; i < 3; i++)
                vf_store(rays.o[i], p[i]);
            trc_packet_to_object(&snapshot->instances[0], &rays, UINT64_MAX, &image);
            for (int lane = 0; lane < TRC_WIDTH; lane++)
                for (int i = 0; i < 3; i++) {
                    double reach = 0.0;
                    for (int k = 0; k < 3; k++)
                        reach += fabs((double)m[4 * i + k]) * fabs((double)image.o[k][lane]);
                    most = fmax(most, 5.0 * 0x1p-24 * reach / (double)vf_get(error[i], lane));
                }
        }
        query_scene_destroy(&scene);
        query_world_free(&w);
    }
    print_figure("errors of points of turned instances", "the way back needs %.2f of them", most);
    assert_true(most < 1.0);
}

/* Rays that go on through a surface look back less than half of the way to where they come from,
 * and not at all to a surface as near as the error; those that stay on its side only where they had
 * looked back. */
static void rays_look_back_no_farther_than_they_came(void **state) {
    (void)state;
    struct rng rng = rng_seed(33);
    uint64_t through_count = 0, limited = 0;
    struct query_world world;
    query_world_init(&world);
    struct mesh *mesh = query_world_object(&world);
    for (uint32_t t = 0; t < TRIANGLES; t++)
        add_triangle(mesh, &rng, 1.0f, 100.0f);
    struct query_scene scene = query_test_scene(&world, false);
    for (int round = 0; round < LOOKING_BACK / TRC_WIDTH; round++) {
        const struct trc_surface s = surfaces(query_scene_snapshot(scene.scene),
                                              rng_below(&rng, TRIANGLES - TRC_WIDTH + 1), 1, &rng);
        const vvec3 w = leaving(&s, cosines[round % 4], &rng);
        const vvec3 o = trc_spawn_origin(&s, vf_ge(v3_dot(w, s.ng), vf_zero()));
        /* From far less than the error to the size of the scene. */
        const float way = round % 8 == 0 ? -1e-5f : exp2f(rng_range(&rng, -30.0f, 7.0f));
        const vfloat back = trc_spawn_look_back(&s, o, w, vf_set(way));
        for (int lane = 0; lane < TRC_WIDTH; lane++) {
            const float b = vf_get(back, lane);
            const float cosine = vf_get(v3_dot(w, s.ng), lane);
            assert_true(b <= 0.0f);
            if (cosine >= 0.0f) {
                assert_true(b == 0.0f || way <= 0.0f);
                continue;
            }
            through_count += b < 0.0f;
            limited += b == -0.5f * way;
            assert_true(way > 0.0f ? b >= -0.5f * way : b == 0.0f);
        }
    }
    assert_true(through_count > 1000);
    assert_true(limited > 100);
    query_scene_destroy(&scene);
    query_world_free(&world);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    if (trc_set_isa(TRC_KERNEL(trc_kernels).isa) != TRC_OK) /* queries, too */
        return 1;
    const struct CMUnitTest tests[] = {cmocka_unit_test(surfaces_are_left),
                                       cmocka_unit_test(instances_are_left),
                                       cmocka_unit_test(errors_cover_the_way_to_object_space),
                                       cmocka_unit_test(rays_look_back_no_farther_than_they_came),
                                       cmocka_unit_test(near_sheets_are_met)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
