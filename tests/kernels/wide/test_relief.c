/* Slopes of heights: values at the points beside, and normals turned by heights whose slope is
 * known. */
#include "program_test.h"

enum { NAME_UV = 5, NAME_COLOR = 6 };

/* One triangle under a transform, seen from either side, and attributes that are linear in the
 * world: U = P . slope[0], V = P . slope[1], and so the colour. */
struct plane {
    float positions[9], uv[6], color[12];
    uint32_t indices[3];
    double slope[4][3], world[9], normal[3];
    struct trc_attribute attributes[2];
    struct trc_mesh mesh;
    struct trc_mesh *meshes[1];
    struct trc_affine to_world, to_object;
    struct trc_instance instance;
    struct trc_snapshot snapshot;
    struct trc_surface s;
};

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
static void cross(const double a[3], const double b[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static void normalize(double a[3]) {
    const double length = sqrt(dot(a, a));
    for (int i = 0; i < 3; i++)
        a[i] /= length;
}

/* A turn about Z, a mean scale of 2 and a shear. */
static const float to_world[12] = {0, -2, .3f, 1, 1.5f, 0, 0, -2, .2f, 0, 2.5f, 3};

static void place(struct plane *p, struct rng *r) {
    for (int k = 0; k < 9; k++)
        p->positions[k] = 2 * rng_unit(r) - 1;
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++) {
            const float *m = to_world + 4 * i, *v = p->positions + 3 * k;
            p->world[3 * k + i] =
                (double)m[0] * v[0] + (double)m[1] * v[1] + (double)m[2] * v[2] + m[3];
        }
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < 3; i++)
            p->slope[c][i] = rng_unit(r) - .5f;
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 4; c++) {
            const float value = (float)dot(p->world + 3 * k, p->slope[c]);
            p->color[4 * k + c] = value;
            if (c < 2)
                p->uv[2 * k + c] = value;
        }
}

static void build_plane(struct plane *p, struct rng *r, bool is_back, float pixel) {
    memset(p, 0, sizeof *p);
    place(p, r);
    for (uint32_t k = 0; k < 3; k++)
        p->indices[k] = k;
    memcpy(p->to_world.m, to_world, sizeof to_world);
    p->attributes[0] = (struct trc_attribute){.name = NAME_UV, .width = 2, .values = p->uv};
    p->attributes[1] = (struct trc_attribute){.name = NAME_COLOR, .width = 4, .values = p->color};
    p->mesh = (struct trc_mesh){.key_count = 1,
                                .vertex_count = 3,
                                .triangle_count = 1,
                                .positions = p->positions,
                                .indices = p->indices,
                                .attribute_count = 2,
                                .attributes = p->attributes,
                                .default_uv = 0};
    p->meshes[0] = &p->mesh;
    p->instance = (struct trc_instance){
        .key_count = 1, .object_to_world = &p->to_world, .world_to_object = &p->to_object};
    p->snapshot = (struct trc_snapshot){
        .mesh_count = 1, .instance_count = 1, .meshes = p->meshes, .instances = &p->instance};
    struct trc_surface *s = &p->s;
    double e1[3], e2[3], at[3];
    for (int i = 0; i < 3; i++) {
        e1[i] = p->world[3 + i] - p->world[i];
        e2[i] = p->world[6 + i] - p->world[i];
        at[i] = p->world[i] + .25 * e1[i] + .5 * e2[i];
    }
    cross(e1, e2, p->normal);
    normalize(p->normal);
    const double side = is_back ? -1 : 1;
    for (int i = 0; i < 3; i++)
        p->normal[i] *= side;
    s->snapshot = &p->snapshot;
    s->active = vm_all_set();
    s->instance = s->triangle = vi_set(0);
    s->u = vf_set(.25f);
    s->v = vf_set(.5f);
    s->p = v3(vf_set((float)at[0]), vf_set((float)at[1]), vf_set((float)at[2]));
    s->ng = s->n = s->wo =
        v3(vf_set((float)p->normal[0]), vf_set((float)p->normal[1]), vf_set((float)p->normal[2]));
    s->backfacing = is_back ? vm_all_set() : vm_none();
    s->pixel = vf_set(pixel);
}

static void run(struct single *p, struct trc_surface *s, float out[4]) {
    static struct trc_registers regs;
    for (int k = 0; k < TRC_OP_MAX_INPUTS; k++)
        if (p->operands[k].reg >= 0)
            p->operands[k].reg = TRC_REG_CONSTANT;
    trc_program_run(&p->material, s, &regs);
    for (int k = 0; k < 4; k++)
        out[k] = vf_get(regs.r[OUT + k], TRC_WIDTH - 1);
}

static void beside(struct plane *p, uint32_t op, uint32_t resource, bool is_y, float filter_width,
                   float out[4]) {
    struct single program;
    single_init(&program, TRC_OP_BESIDE, op | (is_y ? TRC_BESIDE_Y : 0), resource);
    program.operands[0].value = filter_width;
    run(&program, &p->s, out);
}

/* Steps of a pixel times the width, along the surface and across each other, in the order that
 * makes a right-handed frame with the normal; attributes follow them, or go the other way from
 * behind. */
static void test_points_beside(void **state) {
    (void)state;
    struct rng r = rng_seed(11);
    static struct plane p;
    for (int round = 0; round < 60; round++) {
        const bool is_back = round & 1;
        const float pixel = .01f, width = round % 3 ? .5f : 1;
        build_plane(&p, &r, is_back, pixel);
        double step[2][3], turn[3];
        for (int axis = 0; axis < 2; axis++) {
            float at[4];
            beside(&p, TRC_OP_POSITION, 0, axis, width, at);
            step[axis][0] = at[0] - vf_get(p.s.p.x, 0);
            step[axis][1] = at[1] - vf_get(p.s.p.y, 0);
            step[axis][2] = at[2] - vf_get(p.s.p.z, 0);
            assert_true(fabs(sqrt(dot(step[axis], step[axis])) - pixel * width) < 2e-6);
            assert_true(fabs(dot(step[axis], p.normal)) < 2e-6);
        }
        assert_true(fabs(dot(step[0], step[1])) < 1e-7);
        cross(step[0], step[1], turn);
        assert_true(dot(turn, p.normal) > .9 * pixel * pixel * width * width);
        for (int axis = 0; axis < 2; axis++) {
            float here[4], uv[4], color[4];
            beside(&p, TRC_OP_UV, NAME_UV, axis, 0, here);
            beside(&p, TRC_OP_UV, NAME_UV, axis, width, uv);
            beside(&p, TRC_OP_COLOR_ATTRIBUTE, NAME_COLOR, axis, width, color);
            for (int c = 0; c < 4; c++) {
                const double change = (is_back ? -1 : 1) * dot(step[axis], p.slope[c]);
                if (c < 2)
                    assert_true(fabs(uv[c] - here[c] - change) < 4e-6);
                if (c < 2)
                    assert_true(fabs(color[c] - uv[c]) < 1e-6f);
            }
        }
    }
}

/* Normals beside the point are between those of the corners, on the side of the ray; of a flat
 * triangle they are its own. */
static void test_normals_beside(void **state) {
    (void)state;
    struct rng r = rng_seed(13);
    static struct plane p;
    for (int round = 0; round < 60; round++) {
        const bool is_back = round & 1, is_y = round & 2;
        uint8_t is_smooth = round % 5 != 0;
        float normals[9], parametric[4], out[4], here[4];
        build_plane(&p, &r, is_back, .2f);
        for (int k = 0; k < 9; k++)
            normals[k] = (k % 3 == 2 ? 1 : 0) + rng_unit(&r) - .5f;
        p.mesh.vertex_normals = normals;
        p.mesh.smooth = &is_smooth;
        beside(&p, TRC_OP_PARAMETRIC, 0, is_y, 1, parametric);
        beside(&p, TRC_OP_OBJECT_NORMAL, 0, is_y, 1, out);
        struct single program;
        single_init(&program, TRC_OP_OBJECT_NORMAL, 0, 0);
        run(&program, &p.s, here);
        const double u = parametric[1], weight[3] = {parametric[0], u, 1.0 - parametric[0] - u};
        double expected[3];
        for (int i = 0; i < 3; i++)
            expected[i] = is_smooth ? (is_back ? -1 : 1) *
                                          (weight[0] * normals[i] + weight[1] * normals[3 + i] +
                                           weight[2] * normals[6 + i])
                                    : here[i];
        normalize(expected);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(out[i] - expected[i]) < 4e-6);
    }
}

/* How far the point is from the nearest edge, in metres. */
static double edge_distance(const struct plane *p) {
    const double at[3] = {vf_get(p->s.p.x, 0), vf_get(p->s.p.y, 0), vf_get(p->s.p.z, 0)};
    double nearest = INFINITY;
    for (int k = 0; k < 3; k++) {
        double edge[3], way[3], across[3];
        for (int i = 0; i < 3; i++) {
            edge[i] = p->world[3 * ((k + 1) % 3) + i] - p->world[3 * k + i];
            way[i] = at[i] - p->world[3 * k + i];
        }
        cross(edge, way, across);
        nearest = fmin(nearest, sqrt(dot(across, across) / dot(edge, edge)));
    }
    return nearest;
}

/* Wires reach half their size from the edges, in metres or in pixels; strands have none. */
static void test_wires(void **state) {
    (void)state;
    struct rng r = rng_seed(14);
    static struct plane p;
    for (int round = 0; round < 60; round++) {
        const float pixel = .02f;
        const bool in_pixels = round & 1;
        build_plane(&p, &r, round & 2, pixel);
        const double whole = 2 * edge_distance(&p) / (in_pixels ? pixel : 1);
        for (int beyond = 0; beyond < 2; beyond++)
            for (uint32_t shape = 0; shape <= TRC_SHAPE_RIBBONS; shape += TRC_SHAPE_RIBBONS) {
                struct single program;
                float out[4];
                single_init(&program, TRC_OP_WIREFRAME, in_pixels ? TRC_WIREFRAME_PIXELS : 0, 0);
                program.operands[TRC_OP_AT(WIREFRAME, size)].value =
                    (float)(whole * (beyond ? 1.001 : .999));
                const float at[3] = {vf_get(p.s.p.x, 0), vf_get(p.s.p.y, 0), vf_get(p.s.p.z, 0)};
                for (uint32_t i = 0; i < 3; i++)
                    program.operands[TRC_OP_AT(WIREFRAME, position) + i].value = at[i];
                p.mesh.shape = shape;
                run(&program, &p.s, out);
                assert_true(out[0] == (beyond && !shape ? 1 : 0));
            }
    }
}

/* Heights of a known slope turn the normal n to n - distance * slope, or part of the way. */
static void test_known_slopes(void **state) {
    (void)state;
    struct rng r = rng_seed(12);
    static struct plane p;
    double worst = 0;
    for (int round = 0; round < 200; round++) {
        const float pixel = round % 2 ? .01f : .0003f, width = round % 3 ? .1f : 1;
        const float strength = round % 4 ? .6f : 1, distance = round % 5 ? .7f : -.3f;
        const bool is_inverse = round % 7 == 0;
        build_plane(&p, &r, false, pixel);
        struct single program;
        single_init(&program, TRC_OP_BUMP, is_inverse ? TRC_BUMP_INVERT : 0, 0);
        struct trc_operand *in = program.operands;
        in[TRC_OP_AT(BUMP, strength)].value = strength;
        in[TRC_OP_AT(BUMP, distance)].value = distance;
        in[TRC_OP_AT(BUMP, filter_width)].value = width;
        for (int i = 0; i < 3; i++)
            in[TRC_OP_AT(BUMP, normal) + (uint32_t)i].value = (float)p.normal[i];
        double expected[3], turned[3];
        for (int axis = 0; axis < 2; axis++) {
            float at[4];
            const float here[3] = {vf_get(p.s.p.x, 0), vf_get(p.s.p.y, 0), vf_get(p.s.p.z, 0)};
            beside(&p, TRC_OP_POSITION, 0, axis, width, at);
            double height = 0;
            for (int i = 0; i < 3; i++)
                height += ((double)at[i] - here[i]) * p.slope[0][i];
            in[TRC_OP_AT(BUMP, beside_x) + (uint32_t)axis].value = (float)height;
        }
        const double across = dot(p.slope[0], p.normal), scale = is_inverse ? -distance : distance;
        for (int i = 0; i < 3; i++)
            turned[i] = p.normal[i] - scale * (p.slope[0][i] - across * p.normal[i]);
        normalize(turned);
        for (int i = 0; i < 3; i++)
            expected[i] = strength * turned[i] + (1 - strength) * p.normal[i];
        normalize(expected);
        float out[4];
        run(&program, &p.s, out);
        /* Positions of a few metres are rounded to some 2e-7: of a step of 3e-5 that is .01. */
        const double tolerance = 4e-7 / (pixel * width) + 2e-6;
        for (int i = 0; i < 3; i++) {
            worst = fmax(worst, fabs(out[i] - expected[i]) / tolerance);
            assert_true(fabs(out[i] - expected[i]) < tolerance);
        }
    }
    assert_true(worst > 1e-3); /* the tolerance is not out of all proportion */
}

/* Without a pixel, as for shadow rays, and without strength the normal stays; below the surface it
 * does not stay if it has to reflect upwards. */
static void test_limits(void **state) {
    (void)state;
    struct rng r = rng_seed(13);
    static struct plane p;
    for (int kind = 0; kind < 4; kind++) {
        build_plane(&p, &r, false, kind == 0 ? 0 : .01f);
        struct single program;
        single_init(&program, TRC_OP_BUMP, kind == 3 ? TRC_BUMP_ABOVE : 0, 0);
        struct trc_operand *in = program.operands;
        in[TRC_OP_AT(BUMP, strength)].value = kind == 1 ? -1 : 1;
        in[TRC_OP_AT(BUMP, distance)].value = 1;
        in[TRC_OP_AT(BUMP, filter_width)].value = 1;
        for (int i = 0; i < 3; i++)
            in[TRC_OP_AT(BUMP, normal) + (uint32_t)i].value = (float)p.normal[i];
        in[TRC_OP_AT(BUMP, middle)].value = 1;
        in[TRC_OP_AT(BUMP, beside_x)].value = 3;
        float out[4];
        run(&program, &p.s, out);
        const double n[3] = {out[0], out[1], out[2]};
        const double cosine = dot(n, p.normal);
        assert_true(fabs(dot(n, n) - 1) < 1e-5);
        if (kind < 2)
            assert_true(cosine > .99999);
        else if (kind == 2)
            assert_true(cosine < .01); /* a slope of 200 */
        else
            assert_true(2 * cosine * cosine - 1 > .009); /* wo is the normal */
    }
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_beside), cmocka_unit_test(test_normals_beside),
        cmocka_unit_test(test_wires),         cmocka_unit_test(test_known_slopes),
        cmocka_unit_test(test_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
