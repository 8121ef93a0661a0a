/* Surfaces at hits: positions within their error bounds, normals, sides, motion, the curved surface
 * above; lanes of one instance and of many give the same bits. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "figures.h"
#include "kernels/simd/wide_math.h"
#include "kernels/trace/surface.h"
#include "wide_test.h"

#define MESHES 5
#define INSTANCES 15
#define TRIANGLES 32
#define KEYS 3

struct scene {
    struct trc_snapshot snapshot;
    struct trc_mesh mesh[MESHES], *meshes[MESHES];
    struct trc_instance instance[INSTANCES];
    struct trc_affine to_world[INSTANCES][KEYS];
    float positions[MESHES][KEYS * 9 * TRIANGLES];
    float normals[MESHES][KEYS * 9 * TRIANGLES];
    uint32_t indices[3 * TRIANGLES];
    uint8_t smooth[TRIANGLES];
};
static struct scene scene;

static float around_zero(struct rng *r) { return rng_unit(r) - 0.5f; }

/* Mesh 0 static and flat, 1 with smooth vertex normals, 2 moving with corner normals, 3 far from
 * the origin, 4 moving with vertex normals. Vertices are in another order than corners. Instances:
 * the identity, said and not said to be it, others with scale and shear, mirrored, moving; every
 * other with normals that are unit in world space. */
static void build(void) {
    struct rng r = rng_seed(1);
    memset(&scene, 0, sizeof scene);
    for (uint32_t i = 0; i < 3 * TRIANGLES; i++)
        scene.indices[i] = (7 * i + 5) % (3 * TRIANGLES);
    for (uint32_t i = 0; i < TRIANGLES; i++)
        scene.smooth[i] = i % 2;
    for (int m = 0; m < MESHES; m++) {
        struct trc_mesh *mesh = &scene.mesh[m];
        mesh->key_count = m == 2 || m == 4 ? KEYS : 1;
        mesh->vertex_count = 3 * TRIANGLES;
        mesh->triangle_count = TRIANGLES;
        mesh->positions = scene.positions[m];
        mesh->indices = scene.indices;
        for (uint32_t i = 0; i < KEYS * 9 * TRIANGLES; i++) {
            scene.positions[m][i] = 4.0f * around_zero(&r) + (m == 3 ? 1e5f : 0.0f);
            scene.normals[m][i] = around_zero(&r);
        }
        if (m == 1 || m >= 3) {
            mesh->vertex_normals = scene.normals[m];
            mesh->smooth = scene.smooth;
        }
        if (m == 2)
            mesh->corner_normals = scene.normals[m];
        scene.meshes[m] = mesh;
    }
    for (int i = 0; i < INSTANCES; i++) {
        struct trc_instance *instance = &scene.instance[i];
        instance->mesh = (uint32_t)i % MESHES;
        instance->key_count = i >= 10 ? KEYS : 1;
        instance->is_identity = i < 3;
        instance->world_normals = i % 2;
        instance->object_to_world = scene.to_world[i];
        for (int k = 0; k < KEYS; k++)
            for (int e = 0; e < 12; e++)
                scene.to_world[i][k].m[e] =
                    (e % 5 == 0 ? 1.0f : 0.0f) +
                    (i < MESHES ? 0.0f : (e % 4 == 3 ? 5.0f : 0.8f)) * around_zero(&r);
        if (i == 6 || i == 8) /* mirrors */
            for (int e = 0; e < 12; e += 4)
                scene.to_world[i][0].m[e] = -scene.to_world[i][0].m[e];
        const float *m = scene.to_world[i][0].m;
        const float det = m[0] * (m[5] * m[10] - m[6] * m[9]) -
                          m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
        instance->flips = det < 0.0f;
    }
    scene.snapshot.meshes = scene.meshes;
    scene.snapshot.instances = scene.instance;
    scene.snapshot.mesh_count = MESHES;
    scene.snapshot.instance_count = INSTANCES;
}

/* One hit in long double from the same float keys: corners and matrix are rounded as the library
 * does. */
struct truth {
    long double p[3], ng[3], n[3], up[3];
    long double height[2]; /* of the bulge, in lengths of up, on that side and on the other */
    bool smooth;
};
static void cross(const long double a[3], const long double b[3], long double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static long double normalize(long double a[3]) {
    const long double size = sqrtl(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    for (int i = 0; i < 3; i++)
        a[i] /= size;
    return size;
}
static float between(const float *keys, uint32_t key_count, size_t stride, size_t at, float time) {
    uint32_t key;
    float f;
    trc_key_at(time, key_count, &key, &f);
    if (key_count < 2)
        return keys[at];
    const float a = keys[stride * key + at];
    return a + f * (keys[stride * (key + 1) + at] - a);
}
/* How high the surface that the normals describe lies on a side (1 or -1): the lowest of the planes
 * at the corners, in hollows raised to their highest neighbour, and half the parabolas of the
 * edges, of height wa wb (na - nb) . (pa - pb), where those are higher. In object space. */
static long double bulge_height(long double p[3][3], long double n[3][3],
                                const long double weight[3], int side) {
    long double planes = 1e30L, arcs = 0;
    for (int k = 0; k < 3; k++) {
        long double top = 0, here = 0, bend = 0;
        const int next = (k + 1) % 3;
        for (int j = 0; j < 3; j++) {
            long double above = 0;
            for (int i = 0; i < 3; i++)
                above += side * (p[j][i] - p[k][i]) * n[k][i];
            top = fmaxl(top, above);
            here += weight[j] * above;
        }
        planes = fminl(planes, fmaxl(top - here, 0));
        for (int i = 0; i < 3; i++)
            bend += side * (n[next][i] - n[k][i]) * (p[next][i] - p[k][i]);
        arcs += weight[k] * weight[next] * bend;
    }
    return side * fmaxl(planes, arcs / 2);
}
static void set_bulge(struct truth *t, long double p[3][3], long double n[3][3],
                      long double column[3][3], long double u, long double v) {
    const long double weight[3] = {1 - u - v, u, v};
    long double along[3];
    for (int side = 0; side < 2; side++)
        t->height[side] = bulge_height(p, n, weight, side ? -1 : 1);
    for (int i = 0; i < 3; i++)
        along[i] = weight[0] * n[0][i] + weight[1] * n[1][i] + weight[2] * n[2][i];
    for (int i = 0; i < 3; i++)
        t->up[i] = column[0][i] * along[0] + column[1][i] * along[1] + column[2][i] * along[2];
}
static struct truth exact(int instance_number, int triangle, float u, float v, float time) {
    const struct trc_instance *instance = &scene.instance[instance_number];
    const struct trc_mesh *mesh = scene.meshes[instance->mesh];
    const size_t stride = 9 * TRIANGLES;
    long double m[12], c[3][3], n[3][3], w[3][3];
    for (size_t i = 0; i < 12; i++)
        m[i] =
            (long double)between(instance->object_to_world[0].m, instance->key_count, 12, i, time);
    for (size_t k = 0; k < 3; k++)
        for (size_t i = 0; i < 3; i++) {
            const size_t corner = 3 * (size_t)triangle + k, at = 3 * scene.indices[corner] + i;
            c[k][i] = (long double)between(mesh->positions, mesh->key_count, stride, at, time);
            const float *normals = mesh->vertex_normals ? mesh->vertex_normals : scene.normals[1];
            n[k][i] = (long double)(mesh->corner_normals
                                        ? between(mesh->corner_normals, mesh->key_count, stride,
                                                  3 * corner + i, time)
                                        : between(normals, mesh->key_count, stride, at, time));
        }
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            w[k][i] =
                m[4 * i] * c[k][0] + m[4 * i + 1] * c[k][1] + m[4 * i + 2] * c[k][2] + m[4 * i + 3];
    struct truth t;
    const long double a = (long double)u, b = (long double)v;
    long double e1[3], e2[3], no[3] = {0}, column[3][3], cofactor[3][3];
    for (int i = 0; i < 3; i++) {
        e1[i] = w[1][i] - w[0][i];
        e2[i] = w[2][i] - w[0][i];
        t.p[i] = w[0][i] + a * e1[i] + b * e2[i];
        for (int k = 0; k < 3; k++)
            column[k][i] = m[4 * i + k];
    }
    cross(e1, e2, t.ng);
    normalize(t.ng);
    for (int k = 0; k < 3; k++)
        cross(column[(k + 1) % 3], column[(k + 2) % 3], cofactor[k]);
    long double det = 0;
    const long double weight[3] = {1 - a - b, a, b};
    for (int k = 0; k < 3; k++) {
        long double world[3];
        for (int i = 0; i < 3; i++)
            world[i] =
                cofactor[0][i] * n[k][0] + cofactor[1][i] * n[k][1] + cofactor[2][i] * n[k][2];
        const long double size = instance->world_normals ? normalize(world) : 1;
        for (int i = 0; i < 3; i++)
            no[i] += weight[k] / size * n[k][i];
    }
    for (int i = 0; i < 3; i++) {
        t.n[i] = cofactor[0][i] * no[0] + cofactor[1][i] * no[1] + cofactor[2][i] * no[2];
        det += column[0][i] * cofactor[0][i];
    }
    normalize(t.n);
    (void)det;
    set_bulge(&t, c, n, column, a, b);
    for (int i = 0; i < 3; i++) {
        t.ng[i] *= instance->flips ? -1 : 1;
        t.n[i] *= instance->flips ? -1 : 1;
    }
    t.smooth = mesh->corner_normals || (mesh->smooth && mesh->smooth[triangle]);
    return t;
}

struct hits {
    int32_t instance[TRC_WIDTH], triangle[TRC_WIDTH];
    float u[TRC_WIDTH], v[TRC_WIDTH], time[TRC_WIDTH];
};
static struct hits random_hits(struct rng *r, bool uniform) {
    struct hits h;
    for (int k = 0; k < TRC_WIDTH; k++) {
        h.instance[k] = uniform && k ? h.instance[0] : (int32_t)(rng_bits(r) % INSTANCES);
        h.triangle[k] = (int32_t)(rng_bits(r) % TRIANGLES);
        h.u[k] = rng_unit(r);
        h.v[k] = rng_unit(r) * (1.0f - h.u[k]);
        h.time[k] = rng_bits(r) % 4 ? rng_unit(r) : (float)(rng_bits(r) % 2);
    }
    return h;
}
static struct trc_surface fetch(const struct hits *h, vvec3 wo) {
    struct trc_surface s;
    memset(&s, 0, sizeof s);
    s.snapshot = &scene.snapshot;
    s.active = vm_all_set();
    s.instance = vi_load(h->instance);
    s.triangle = vi_load(h->triangle);
    s.u = vf_load(h->u);
    s.v = vf_load(h->v);
    s.time = vf_load(h->time);
    s.wo = wo;
    trc_surface_fetch(&s);
    return s;
}

/* How far a bulge of a lane is off, in lengths of its direction; back: it is on the back. */
static double bulge_error(vvec3 bulge, int lane, const struct truth *t, bool back) {
    const vfloat found[3] = {bulge.x, bulge.y, bulge.z};
    long double size = 0, above = 0;
    double off = 0.0;
    for (int i = 0; i < 3; i++) {
        size += t->up[i] * t->up[i];
        above += t->up[i] * t->ng[i] * (back ? -1 : 1);
    }
    size = sqrtl(size);
    /* Where it is nearly within the triangle, or cancels itself, rounding decides. */
    if (fabsl(above) < 1e-3L * size || size < 1e-3L)
        return 0.0;
    const long double height = t->smooth ? t->height[above < 0] : 0;
    for (int i = 0; i < 3; i++)
        off = fmax(off, fabs((double)vf_get(found[i], lane) - (double)(height * t->up[i])));
    return off / (double)size;
}

static void agrees_with_exact_arithmetic(void **state) {
    (void)state;
    build();
    struct rng r = rng_seed(2);
    double worst = 0.0, worst_normal = 0.0, worst_bulge = 0.0;
    int bulges[2] = {0};
    for (int n = 0; n < 4000; n++) {
        const struct hits h = random_hits(&r, n % 2);
        const vvec3 wo = trc_warp_sphere(test_wide_uniform(&r), test_wide_uniform(&r));
        const struct trc_surface s = fetch(&h, wo);
        const vvec3 behind = vm_any(s.smooth) ? trc_bulge_behind(&s, s.smooth) : v3_zero();
        for (int k = 0; k < TRC_WIDTH; k++) {
            const struct truth t = exact(h.instance[k], h.triangle[k], h.u[k], h.v[k], h.time[k]);
            const float p[3] = {vf_get(s.p.x, k), vf_get(s.p.y, k), vf_get(s.p.z, k)};
            const float e[3] = {vf_get(s.p_error.x, k), vf_get(s.p_error.y, k),
                                vf_get(s.p_error.z, k)};
            const float ng[3] = {vf_get(s.ng.x, k), vf_get(s.ng.y, k), vf_get(s.ng.z, k)};
            const float sn[3] = {vf_get(s.n.x, k), vf_get(s.n.y, k), vf_get(s.n.z, k)};
            const bool back = (vm_bits(s.backfacing) >> k) & 1u;
            double facing = 0.0, side = 0.0;
            for (int i = 0; i < 3; i++) {
                const double off = (double)fabsl((long double)p[i] - t.p[i]);
                assert_true(off <= (double)e[i]);
                worst = fmax(worst, off / (double)e[i]);
                facing += (double)ng[i] * (double)vf_get(i == 0 ? wo.x : i == 1 ? wo.y : wo.z, k);
                side += (double)ng[i] * (double)t.ng[i];
            }
            assert_true(facing >= 0.0);
            assert_true((side < 0.0) == back);
            const long double *want = t.smooth ? t.n : t.ng;
            for (int i = 0; i < 3; i++) {
                const double sign = back ? -1.0 : 1.0;
                worst_normal = fmax(worst_normal, fabs((double)ng[i] - sign * (double)t.ng[i]));
                worst_normal = fmax(worst_normal, fabs((double)sn[i] - sign * (double)want[i]));
            }
            worst_bulge = fmax(worst_bulge, bulge_error(s.bulge, k, &t, back));
            if (t.smooth)
                worst_bulge = fmax(worst_bulge, bulge_error(behind, k, &t, !back));
            bulges[back] += vf_get(v3_max(v3_abs(s.bulge)), k) > 0.0f;
        }
    }
    print_figure("hit points", "off by %.2f of their bound", worst);
    print_figure("normals at hits", "off by %.2g", worst_normal);
    print_figure("curved surfaces above hits", "off by %.2g of their size", worst_bulge);
    /* Random normals bend a surface to either side: a quarter of all have a bulge. */
    assert_true(bulges[0] > 300 * TRC_WIDTH && bulges[1] > 300 * TRC_WIDTH);
    assert_true(worst_bulge < 1e-4);
    assert_true(worst_normal < 1e-4);
    assert_true(worst > 0.05);
}

static void lanes_do_not_matter(void **state) {
    (void)state;
    build();
    struct rng r = rng_seed(3);
    for (int n = 0; n < 2000; n++) {
        const struct hits h = random_hits(&r, false);
        const vvec3 wo = trc_warp_sphere(test_wide_uniform(&r), test_wide_uniform(&r));
        const struct trc_surface s = fetch(&h, wo);
        for (int k = 0; k < TRC_WIDTH; k++) {
            struct hits one;
            for (int j = 0; j < TRC_WIDTH; j++) {
                one.instance[j] = h.instance[k];
                one.triangle[j] = h.triangle[k];
                one.u[j] = h.u[k];
                one.v[j] = h.v[k];
                one.time[j] = h.time[k];
            }
            const vvec3 to =
                v3(vf_set(vf_get(wo.x, k)), vf_set(vf_get(wo.y, k)), vf_set(vf_get(wo.z, k)));
            const struct trc_surface alone = fetch(&one, to);
            const vfloat pairs[][2] = {{s.p.x, alone.p.x},
                                       {s.p.z, alone.p.z},
                                       {s.p_error.y, alone.p_error.y},
                                       {s.ng.x, alone.ng.x},
                                       {s.n.y, alone.n.y}};
            for (size_t j = 0; j < sizeof pairs / sizeof pairs[0]; j++)
                assert_true(vf_get(pairs[j][0], k) == vf_get(pairs[j][1], 0));
        }
    }
}

static void identity_is_exact(void **state) {
    (void)state;
    build();
    struct hits h;
    memset(&h, 0, sizeof h);
    for (int corner = 0; corner < 3; corner++)
        for (int t = 0; t < TRIANGLES; t++) {
            for (int k = 0; k < TRC_WIDTH; k++) {
                h.triangle[k] = t;
                h.u[k] = h.v[k] = 0.0f;
            }
            const struct trc_surface s = fetch(&h, v3(vf_zero(), vf_zero(), vf_one()));
            const float *vertex = scene.positions[0] + 3 * scene.indices[3 * t];
            assert_true(vf_get(s.p.x, 0) == vertex[0]);
            assert_true(vf_get(s.p.y, 0) == vertex[1]);
            assert_true(vf_get(s.p.z, 0) == vertex[2]);
        }
}

/* Slivers, points and sizes from 1e-18 to 1e17: normals stay unit vectors. */
static void odd_triangles(void **state) {
    (void)state;
    const float sizes[] = {1e-18f, 1e-6f, 1.0f, 1e8f, 1e17f};
    for (int i = 0; i < 5; i++)
        for (int kind = 0; kind < 3; kind++) {
            build();
            const float a = sizes[i];
            const float corners[3][9] = {{0, 0, 0, a, 0, 0, 0, a, 0},
                                         {0, 0, 0, a, a, a, 2 * a, 2 * a, 2 * a},
                                         {a, a, a, a, a, a, a, a, a}};
            for (int k = 0; k < 3; k++)
                memcpy(scene.positions[0] + 3 * scene.indices[k], corners[kind] + 3 * k,
                       3 * sizeof(float));
            struct hits h;
            memset(&h, 0, sizeof h);
            for (int k = 0; k < TRC_WIDTH; k++)
                h.u[k] = h.v[k] = 0.3f;
            const struct trc_surface s = fetch(&h, v3(vf_zero(), vf_set(0.6f), vf_set(0.8f)));
            assert_true(fabsf(vf_get(v3_length(s.ng), 0) - 1.0f) < 1e-5f);
            assert_true(fabsf(vf_get(v3_length(s.n), 0) - 1.0f) < 1e-5f);
            if (kind == 0)
                assert_true(vf_get(s.ng.z, 0) > 0.9999f);
        }
}

/* A triangle of the unit sphere: at the middle of an edge the bulge is twice the height of the arc
 * above it. It is the same surface whichever way normals and winding turn, and is there for those
 * on its convex side alone, whether that is the triangle's front or its back. */
static void bulges_are_on_the_convex_side(void **state) {
    (void)state;
    const float angle = 0.1f, near = cosf(angle), far = sinf(angle);
    const float corners[3][3] = {{-far, 0, near}, {far, 0, near}, {0, far, near}};
    for (int kind = 0; kind < 8; kind++) {
        const bool is_inward = kind & 1, is_below = kind & 2, is_mirrored = kind & 4;
        build();
        for (int k = 0; k < 3; k++) {
            /* The second corner of those that face inwards is the third. */
            const uint32_t vertex = scene.indices[is_inward ? (3 - k) % 3 : k];
            for (int i = 0; i < 3; i++) {
                scene.positions[1][3 * vertex + (uint32_t)i] = corners[k][i];
                scene.normals[1][3 * vertex + (uint32_t)i] =
                    is_inward ? -corners[k][i] : corners[k][i];
            }
        }
        scene.smooth[0] = 1;
        struct trc_instance *instance = &scene.instance[1];
        instance->is_identity = !is_mirrored;
        instance->flips = is_mirrored;
        scene.to_world[1][0].m[0] = is_mirrored ? -1.0f : 1.0f;
        struct hits h;
        memset(&h, 0, sizeof h);
        for (int k = 0; k < TRC_WIDTH; k++) {
            h.instance[k] = 1;
            /* The middle of the edge between the first two of the corners above. */
            h.u[k] = is_inward ? 0.0f : 0.5f;
            h.v[k] = is_inward ? 0.5f : 0.0f;
        }
        const struct trc_surface s = fetch(&h, v3(vf_zero(), vf_zero(), vf_set(is_below ? -1 : 1)));
        assert_true(((vm_bits(s.backfacing) & 1u) != 0) == (is_inward != is_below));
        /* Of small angles: the parabola is cos (1 + cos) / 2 as high, with 0.1 that is 0.0075 less.
         */
        const float height = is_below ? 0.0f : 2.0f * (1.0f - near);
        assert_true(fabsf(vf_get(s.bulge.z, 0) - height) <= 0.01f * height + 1e-9f);
        assert_true(fabsf(vf_get(s.bulge.x, 0)) + fabsf(vf_get(s.bulge.y, 0)) < 1e-7f);
    }
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_exact_arithmetic),
        cmocka_unit_test(lanes_do_not_matter),
        cmocka_unit_test(identity_is_exact),
        cmocka_unit_test(odd_triangles),
        cmocka_unit_test(bulges_are_on_the_convex_side),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
