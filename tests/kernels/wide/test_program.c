/* Material programs: every operation against Cycles' values, against the scalar kernels bit by bit,
 * and operations on meshes, objects and cameras against values in double. */
#include "program_test.h"

#include <stdio.h>

#include "kernels/light/world.h"
#include "model/kernels.h"
#include "model/nodes.h"
#include "program_cases.h"

/* ---- one operation at a time ---- */

static const uint8_t op_is_pure[] = {
#define TRC_OPERATION(NAME, is_pure, inputs, outputs) is_pure,
#include "model/operations.def"
};

static void ramp_table(float table[4 * TRC_TABLE_ENTRIES]) {
    static const float from[4] = {.1f, .9f, .4f, 1}, to[4] = {.7f, .2f, .8f, 1};
    for (uint32_t i = 0; i < TRC_TABLE_ENTRIES; i++) {
        const float t = (float)i / (float)(TRC_TABLE_ENTRIES - 1);
        for (int c = 0; c < 4; c++)
            table[4 * i + c] = (1 - t) * from[c] + t * to[c];
    }
}

/* Numbers of the cases with the operation and mode of case number first. */
static int alike(size_t first, size_t numbers[], int capacity) {
    int count = 0;
    const struct program_case *a = &program_cases[first];
    for (size_t i = 0; i < sizeof program_cases / sizeof *program_cases && count < capacity; i++) {
        if (program_cases[i].op == a->op && program_cases[i].mode == a->mode)
            numbers[count++] = i;
    }
    return count;
}

/* Inputs of a case as the operation has them. */
static void case_inputs(const struct program_case *c, float in[TRC_OP_MAX_INPUTS]) {
    memset(in, 0, TRC_OP_MAX_INPUTS * sizeof *in);
    if (c->op != TRC_OP_MAPPING) {
        memcpy(in, c->in, sizeof c->in);
        return;
    }
    memcpy(in, c->in, 6 * sizeof *in);
    memcpy(in + 6, c->in + 9, 3 * sizeof *in);
    trc_kernels_get(TRC_ISA_SCALAR)->program_fold(TRC_OP_ROTATION, 0, NULL, c->in + 6, in + 9);
}

static void test_against_cycles(void **state) {
    (void)state;
    static float table[4 * TRC_TABLE_ENTRIES];
    int failures = 0;
    ramp_table(table);
    for (size_t i = 0; i < sizeof program_cases / sizeof *program_cases; i++) {
        size_t numbers[32];
        const int count = alike(i, numbers, 32);
        if (numbers[0] != i)
            continue;
        static struct trc_registers regs;
        struct single p;
        single_init(&p, program_cases[i].op, program_cases[i].mode, 0);
        p.material.tables = table;
        for (int start = 0; start < count; start++) {
            float lanes[TRC_OP_MAX_INPUTS][TRC_WIDTH], in[TRC_OP_MAX_INPUTS];
            for (int l = 0; l < TRC_WIDTH; l++) {
                case_inputs(&program_cases[numbers[(start + l) % count]], in);
                for (int k = 0; k < TRC_OP_MAX_INPUTS; k++)
                    lanes[k][l] = in[k];
            }
            for (int k = 0; k < TRC_OP_MAX_INPUTS; k++)
                regs.r[k] = vf_load(lanes[k]);
            trc_program_run(&p.material, NULL, &regs);
            for (int l = 0; l < TRC_WIDTH; l++) {
                const struct program_case *c = &program_cases[numbers[(start + l) % count]];
                const int outputs = op_output_counts[c->op] < 3 ? op_output_counts[c->op] : 3;
                for (int k = 0; k < outputs; k++) {
                    const float value = vf_get(regs.r[OUT + k], l);
                    if (isnan(c->out[k]) || is_near(value, c->out[k], 3e-6f))
                        continue;
                    failures++;
                    printf("%s mode %u (%g %g %g %g ...) output %d: %.9g, Cycles has %.9g\n",
                           op_names[c->op], c->mode, c->in[0], c->in[1], c->in[2], c->in[3], k,
                           value, c->out[k]);
                }
            }
        }
    }
    assert_int_equal(failures, 0);
}

/* Numbers of all sizes and signs, whole ones, 0 and some that are not finite. */
static float any_number(struct rng *r) {
    const uint32_t kind = rng_bits(r) % 16;
    const float u = rng_unit(r) * 2.0f - 1.0f;
    if (kind == 0)
        return 0.0f;
    if (kind == 1)
        return (float)(int)(u * 9.0f);
    if (kind == 2)
        return u * 1e6f;
    if (kind == 3)
        return u * 1e-6f;
    if (kind == 4 && (rng_bits(r) & 7) == 0)
        return u > 0 ? INFINITY : NAN;
    return u * 3.0f;
}

/* Highest mode of an operation. */
static uint32_t last_mode(uint32_t op) {
    switch (op) {
    case TRC_OP_MATH:
        return TRC_MATH_DEGREES;
    case TRC_OP_MIX:
        return TRC_BLEND_EXCLUSION;
    case TRC_OP_VECTOR_MATH:
    case TRC_OP_VECTOR_MEASURE:
        return TRC_VECTOR_POWER;
    case TRC_OP_NOISE:
        return (TRC_FRACTAL_RIDGED_MULTIFRACTAL << TRC_NOISE_TYPE_SHIFT) + 3;
    case TRC_OP_WHITE_NOISE:
        return 3;
    case TRC_OP_VORONOI:
        return TRC_VORONOI_UNLIMITED + TRC_VORONOI_PCG + TRC_VORONOI_NORMALIZE +
               (TRC_VORONOI_N_SPHERE_RADIUS << TRC_VORONOI_FEATURE_SHIFT) + 15;
    case TRC_OP_GRADIENT:
        return TRC_GRADIENT_SPHERICAL;
    case TRC_OP_WAVE:
        return (3 << TRC_WAVE_DIRECTION_SHIFT) + TRC_WAVE_RINGS + TRC_WAVE_TRIANGLE;
    case TRC_OP_MAGIC:
        return TRC_MAGIC_SCALED_FIRST + TRC_MAGIC_MAX_DEPTH;
    case TRC_OP_BRICK:
        return 2 + (3 << TRC_BRICK_SQUASH_SHIFT);
    case TRC_OP_MAPPING:
    case TRC_OP_PROJECT:
        return 3;
    case TRC_OP_CURVE:
        return TRC_CURVE_EXTRAPOLATE | 3;
    case TRC_OP_CLAMP:
    case TRC_OP_RAMP:
        return 1;
    case TRC_OP_SEPARATE:
    case TRC_OP_COMBINE:
        return TRC_SEPARATE_HSL;
    default:
        return 0;
    }
}

static bool same_bits_or_nan(float a, float b) {
    return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b));
}

/* Folding runs the scalar kernels: what it gives is what any width gives. */
static void test_against_scalar(void **state) {
    (void)state;
    static float table[4 * TRC_TABLE_ENTRIES];
    static struct trc_registers regs;
    struct rng r = rng_seed(7);
    ramp_table(table);
    for (uint32_t op = 0; op < TRC_OP_COUNT; op++) {
        for (uint32_t mode = 0; op_is_pure[op] && mode <= last_mode(op); mode++) {
            struct single p;
            single_init(&p, op, mode, 0);
            p.material.tables = table;
            /* Bricks' frequencies are many modes of one kind. */
            const int rounds = op == TRC_OP_BRICK || op == TRC_OP_VORONOI ? 8 : 200;
            for (int round = 0; round < rounds; round++) {
                float lanes[TRC_OP_MAX_INPUTS][TRC_WIDTH];
                for (int k = 0; k < TRC_OP_MAX_INPUTS; k++) {
                    for (int l = 0; l < TRC_WIDTH; l++)
                        lanes[k][l] = any_number(&r);
                    regs.r[k] = vf_load(lanes[k]);
                }
                trc_program_run(&p.material, NULL, &regs);
                for (int l = 0; l < TRC_WIDTH; l++) {
                    float in[TRC_OP_MAX_INPUTS], out[TRC_OP_MAX_OUTPUTS];
                    for (int k = 0; k < TRC_OP_MAX_INPUTS; k++)
                        in[k] = lanes[k][l];
                    trc_kernels_get(TRC_ISA_SCALAR)->program_fold(op, mode, table, in, out);
                    for (int k = 0; k < op_output_counts[op]; k++) {
                        const float value = vf_get(regs.r[OUT + k], l);
                        if (same_bits_or_nan(value, out[k]))
                            continue;
                        fail_msg("%s mode %u (%g %g %g %g): lane %d has %.9g, scalar %.9g",
                                 op_names[op], mode, in[0], in[1], in[2], in[3], l, value, out[k]);
                    }
                }
            }
        }
    }
}

/* Outputs may take the registers of inputs. */
static void test_outputs_over_inputs(void **state) {
    (void)state;
    struct trc_registers regs;
    struct single p;
    single_init(&p, TRC_OP_VECTOR_MATH, TRC_VECTOR_CROSS, 0);
    p.instruction.out = 0;
    for (int k = 0; k < TRC_OP_MAX_INPUTS; k++)
        regs.r[k] = vf_set((float)k);
    trc_program_run(&p.material, NULL, &regs);
    const float expected[3] = {1 * 5 - 2 * 4, 2 * 3 - 0 * 5, 0 * 4 - 1 * 3};
    for (int k = 0; k < 3; k++) {
        for (int l = 0; l < TRC_WIDTH; l++)
            assert_true(vf_get(regs.r[k], l) == expected[k]);
    }
}

/* On a straight table from .1 to .7 over 2 to 4, and straight on beyond. */
static void test_curves(void **state) {
    (void)state;
    static const float at[5] = {2, 3, 4, 1, 6}, flat[5] = {.1f, .4f, .7f, .1f, .7f},
                       straight[5] = {.1f, .4f, .7f, -.2f, 1.3f};
    static float table[4 * TRC_TABLE_ENTRIES];
    ramp_table(table);
    for (int i = 0; i < 5; i++) {
        const float in[3] = {at[i], 2, 4};
        float out;
        trc_kernels_get(TRC_ISA_SCALAR)->program_fold(TRC_OP_CURVE, 0, table, in, &out);
        assert_true(is_near(out, flat[i], 1e-6f));
        trc_kernels_get(TRC_ISA_SCALAR)
            ->program_fold(TRC_OP_CURVE, TRC_CURVE_EXTRAPOLATE, table, in, &out);
        assert_true(is_near(out, straight[i], 1e-5f));
    }
}

/* Turned by a third of a turn about the diagonal, axes follow each other; not at all about 0. */
static void test_axis_rotation(void **state) {
    (void)state;
    static const float around[4] = {5, 5, 5, 2.0943951f}, nothing[4] = {0, 0, 0, 1};
    static const float expected[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
    float rows[9];
    trc_kernels_get(TRC_ISA_SCALAR)->program_fold(TRC_OP_AXIS_ROTATION, 0, NULL, around, rows);
    for (int i = 0; i < 9; i++)
        assert_true(is_near(rows[i], expected[i], 1e-6f));
    trc_kernels_get(TRC_ISA_SCALAR)->program_fold(TRC_OP_AXIS_ROTATION, 0, NULL, nothing, rows);
    for (int i = 0; i < 9; i++)
        assert_true(rows[i] == (i % 4 == 0 ? 1.0f : 0.0f));
}

/* ---- a scene of two meshes ---- */

enum { NAME_UV = 5, NAME_COLOR = 6, NAME_OTHER = 7, NAME_TANGENT = 8 };

struct world_of_test {
    float positions[2][2][9]; /* mesh, key: one triangle each, the second moves */
    uint32_t indices[3];
    float uv[6], other[6], color[12], tangents[12];
    float normals[9];
    uint8_t smooth;
    struct trc_attribute attributes[4];
    struct trc_mesh mesh[2];
    struct trc_mesh *meshes[2];
    struct trc_affine to_world[3], to_object[3];
    struct trc_instance instances[2];
    struct trc_affine camera;
    float window[1][4];
    struct trc_snapshot snapshot;
};

/* A quarter turn about Z, scale (2, 1, 3), moved. */
static const float turned[12] = {0, -1, 0, 10, 2, 0, 0, 20, 0, 0, 3, 30};
static const float turned_inverse[12] = {0, .5f, 0, -10, -1, 0, 0, 10, 0, 0, 1.0f / 3.0f, -10};

static void build_meshes(struct world_of_test *w) {
    static const float first[9] = {0, 0, 0, 2, 0, 0, 0, 4, 0};
    static const float uv[6] = {0, 0, 0, 1, -1, 0}; /* U along -Y, V along X: mirrored is false */
    for (int k = 0; k < 9; k++) {
        w->positions[0][0][k] = w->positions[1][0][k] = first[k];
        w->positions[1][1][k] = first[k] + (k % 3 == 2 ? 1.0f : 0.0f);
    }
    for (int k = 0; k < 3; k++) { /* (x, x, 1) made unit */
        const float x = 0.25f * (float)k, length = sqrtf(2 * x * x + 1);
        w->normals[3 * k] = w->normals[3 * k + 1] = x / length;
        w->normals[3 * k + 2] = 1 / length;
    }
    for (uint32_t k = 0; k < 3; k++)
        w->indices[k] = k;
    memcpy(w->uv, uv, sizeof uv);
    for (int k = 0; k < 6; k++)
        w->other[k] = (float)k;
    for (int k = 0; k < 12; k++)
        w->color[k] = 0.1f * (float)k;
    for (int k = 0; k < 3; k++) { /* along Y, left-handed */
        w->tangents[4 * k + 1] = 2;
        w->tangents[4 * k + 2] = -1;
    }
    w->smooth = 1;
    const struct trc_attribute attributes[] = {
        {.name = NAME_UV, .width = 2, .values = w->uv},
        {.name = NAME_OTHER, .width = 2, .values = w->other},
        {.name = NAME_COLOR, .width = 4, .values = w->color},
        {.name = NAME_TANGENT, .width = 4, .values = w->tangents}};
    memcpy(w->attributes, attributes, sizeof attributes);
    for (int i = 0; i < 2; i++) {
        w->mesh[i] = (struct trc_mesh){
            .key_count = i ? 2 : 1,
            .vertex_count = 3,
            .triangle_count = 1,
            .positions = w->positions[i][0],
            .indices = w->indices,
            .attribute_count = i ? 0 : 4,
            .attributes = w->attributes,
            .default_uv = i ? -1 : 0,
            .bounds_lower = {0, 0, 0},
            .bounds_upper = {2, 4, 0},
        };
        w->meshes[i] = &w->mesh[i];
    }
}

static void build_scene(struct world_of_test *w) {
    memset(w, 0, sizeof *w);
    build_meshes(w);
    memcpy(w->to_world[0].m, turned, sizeof turned);
    memcpy(w->to_object[0].m, turned_inverse, sizeof turned_inverse);
    for (int k = 0; k < 2; k++) {
        w->to_world[1 + k] =
            (struct trc_affine){{1, 0, 0, 2.0f * (float)k, 0, 1, 0, 0, 0, 0, 1, 0}};
        w->to_object[1 + k] =
            (struct trc_affine){{1, 0, 0, -2.0f * (float)k, 0, 1, 0, 0, 0, 0, 1, 0}};
    }
    static const float values[] = {11, 12, 13};
    w->instances[0] = (struct trc_instance){.mesh = 0,
                                            .key_count = 1,
                                            .object_to_world = w->to_world,
                                            .world_to_object = w->to_object,
                                            .value_count = 3,
                                            .values = values,
                                            .pass_index = 3,
                                            .random = .25f,
                                            .color = {.1f, .2f, .3f, .4f}};
    w->instances[1] = (struct trc_instance){.mesh = 1,
                                            .key_count = 2,
                                            .object_to_world = w->to_world + 1,
                                            .world_to_object = w->to_object + 1,
                                            .pass_index = 4,
                                            .random = .75f,
                                            .color = {.5f, .6f, .7f, .8f}};
    w->camera = (struct trc_affine){{1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 50}};
    const float window[4] = {-.5f, .5f, -.25f, .25f};
    memcpy(w->window[0], window, sizeof window);
    w->snapshot = (struct trc_snapshot){.mesh_count = 2,
                                        .instance_count = 2,
                                        .meshes = w->meshes,
                                        .instances = w->instances,
                                        .has_camera = 1};
    w->snapshot.camera = (struct trc_camera){.type = TRC_CAMERA_PERSPECTIVE,
                                             .key_count = 1,
                                             .camera_to_world = &w->camera,
                                             .windows = w->window};
}

/* Lane l on instance l % 2, or in the world every third lane; barycentrics (.25, .5), time .5. */
static void build_surface(const struct world_of_test *w, struct trc_surface *s) {
    int32_t instance[TRC_WIDTH];
    for (int l = 0; l < TRC_WIDTH; l++)
        instance[l] = l % 3 == 2 ? -1 : l % 2;
    memset(s, 0, sizeof *s);
    s->snapshot = &w->snapshot;
    s->active = vm_all_set();
    s->instance = vi_load(instance);
    s->triangle = vi_set(0);
    s->u = vf_set(.25f);
    s->v = vf_set(.5f);
    s->time = vf_set(.5f);
    s->p = v3(vf_set(8), vf_set(21), vf_set(30));
    s->ng = s->n = v3(vf_zero(), vf_zero(), vf_one());
    s->wo = v3(vf_set(.6f), vf_zero(), vf_set(.8f));
    s->path = vu_set(TRC_VISIBLE_GLOSSY | TRC_PATH_SINGULAR);
    s->ray_length = vf_set(7);
    s->depths = vu_set(2u << TRC_DEPTH_ALL_SHIFT);
}

/* What an operation must give on instance 0, on instance 1 and in the world. */
struct expectation {
    uint32_t op, mode, resource;
    float in[4];
    float out[3][4];
};

#define H .70710678f /* sqrt(1/2) */
static const struct expectation expectations[] = {
    {TRC_OP_POSITION, 0, 0, {0}, {{8, 21, 30}, {8, 21, 30}, {8, 21, 30}}},
    {TRC_OP_INCOMING, 0, 0, {0}, {{.6f, 0, .8f}, {.6f, 0, .8f}, {.6f, 0, .8f}}},
    {TRC_OP_PARAMETRIC, 0, 0, {0}, {{.25f, .25f}, {.25f, .25f}, {.25f, .25f}}},
    /* object (.5, 2, 0) of a box (2, 4, 0): a flat side gives .5 */
    {TRC_OP_GENERATED, 0, 0, {0}, {{.25f, .5f, .5f}, {.25f, .5f, .5f}, {8, 21, 30}}},
    {TRC_OP_OBJECT_POSITION, 0, 0, {0}, {{.5f, 2, 0}, {7, 21, 30}, {8, 21, 30}}},
    {TRC_OP_OBJECT_NORMAL, 0, 0, {0}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_OBJECT_LOCATION, 0, 0, {0}, {{10, 20, 30}, {1, 0, 0}, {0, 0, 0}}},
    {TRC_OP_OBJECT_COLOR, 0, 0, {0}, {{.1f, .2f, .3f, .4f}, {.5f, .6f, .7f, .8f}, {0}}},
    {TRC_OP_OBJECT_INDEX, 0, 0, {0}, {{3}, {4}, {0}}},
    {TRC_OP_OBJECT_RANDOM, 0, 0, {0}, {{.25f}, {.75f}, {0}}},
    {TRC_OP_INSTANCE_VALUES, 1, 0, {0}, {{12, 13, 0}, {0}, {0}}},
    {TRC_OP_INSTANCE_VALUES, 3, 0, {0}, {{0}, {0}, {0}}},
    {TRC_OP_CAMERA_POSITION, 0, 0, {0}, {{7, 19, 20}, {7, 19, 20}, {8, 21, -30}}},
    {TRC_OP_WINDOW, 0, 0, {0}, {{.85f, 2.4f}, {.85f, 2.4f}, {.5f - 8.0f / 30, .5f - 1.4f}}},
    {TRC_OP_REFLECTION, 0, 0, {0}, {{-.6f, 0, .8f}, {-.6f, 0, .8f}, {.6f, 0, .8f}}},
    {TRC_OP_UV, 0, TRC_NO_RESOURCE, {0}, {{-.5f, .25f}, {0}, {0}}},
    {TRC_OP_UV, 0, NAME_OTHER, {0}, {{2.5f, 3.5f}, {0}, {0}}},
    {TRC_OP_UV, 0, 99, {0}, {{0}, {0}, {0}}},
    {TRC_OP_COLOR_ATTRIBUTE, 0, NAME_COLOR, {0}, {{.5f, .6f, .7f, .8f}, {0}, {0}}},
    {TRC_OP_COLOR_ATTRIBUTE, 0, TRC_NO_RESOURCE, {0}, {{.5f, .6f, .7f, .8f}, {0}, {0}}},
    {TRC_OP_COLOR_ATTRIBUTE, 0, NAME_OTHER, {0}, {{2.5f, 3.5f, 0, 1}, {0}, {0}}},
    {TRC_OP_LIGHT_PATH, TRC_OUTPUT_OF(LIGHT_PATH, is_camera), 0, {0}, {{0}, {0}, {0}}},
    {TRC_OP_LIGHT_PATH, TRC_OUTPUT_OF(LIGHT_PATH, is_glossy), 0, {0}, {{1}, {1}, {1}}},
    {TRC_OP_LIGHT_PATH, TRC_OUTPUT_OF(LIGHT_PATH, is_singular), 0, {0}, {{1}, {1}, {1}}},
    {TRC_OP_LIGHT_PATH, TRC_OUTPUT_OF(LIGHT_PATH, ray_length), 0, {0}, {{7}, {7}, {7}}},
    {TRC_OP_LIGHT_PATH, TRC_OUTPUT_OF(LIGHT_PATH, ray_depth), 0, {0}, {{2}, {2}, {2}}},
    /* ((1.5 - 1) / (1.5 + 1))^2 at normal incidence */
    {TRC_OP_FRESNEL, 0, 0, {1.5f, .6f, 0, .8f}, {{.04f}, {.04f}, {.04f}}},
    {TRC_OP_LAYER_FACING, 0, 0, {.5f, 0, 0, 1}, {{.2f}, {.2f}, {.2f}}},
    {TRC_OP_LAYER_FACING, 0, 0, {.25f, 0, 0, 1}, {{.10557281f}, {.10557281f}, {.10557281f}}},
    /* grown U runs along -Y, grown V along +X of the object, which a quarter turn makes +X and +Y
     */
    {TRC_OP_NORMAL_MAP, 0, TRC_NO_RESOURCE, {1, 1, .5f, .5f}, {{1, 0, 0}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 0, TRC_NO_RESOURCE, {1, .5f, 1, .5f}, {{0, 1, 0}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 0, NAME_UV, {1, .5f, .5f, 1}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 0, NAME_UV, {.5f, 1, .5f, .5f}, {{H, 0, H}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 0, NAME_TANGENT, {1, 1, .5f, .5f}, {{-1, 0, 0}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 0, NAME_TANGENT, {1, .5f, 1, .5f}, {{0, 1, 0}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP,
     TRC_NORMAL_MAP_SCALED,
     NAME_TANGENT,
     {-1, 1, .5f, .5f},
     {{.94868330f, 0, .31622777f}, {0, 0, 1}, {0, 0, 1}}}, /* the object is 3 high */
    {TRC_OP_NORMAL_MAP,
     TRC_NORMAL_MAP_SCALED,
     NAME_TANGENT,
     {2, 1, .5f, .5f},
     {{-1, 0, 0}, {0, 0, 1}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP,
     2 | TRC_NORMAL_MAP_DOWN,
     0,
     {1, .5f, 1, .5f},
     {{0, -1, 0}, {0, -1, 0}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 1, 0, {1, 1, .5f, .5f}, {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}},
    {TRC_OP_NORMAL_MAP, 2, 0, {1, 1, .5f, .5f}, {{1, 0, 0}, {1, 0, 0}, {0, 0, 1}}},
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_OBJECT_TO_WORLD | TRC_TRANSFORM_POINT,
     0,
     {1, 0, 0},
     {{10, 22, 30}, {2, 0, 0}, {1, 0, 0}}},
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_WORLD_TO_OBJECT,
     0,
     {1, 0, 0},
     {{0, -1, 0}, {1, 0, 0}, {1, 0, 0}}},
    /* By the inverse transpose: rows (0, -1, 0), (.5, 0, 0), (0, 0, 1/3). */
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_OBJECT_TO_WORLD | TRC_TRANSFORM_NORMAL,
     0,
     {1, 1, 0},
     {{-.89442719f, .44721360f, 0}, {H, H, 0}, {1, 1, 0}}},
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_WORLD_TO_OBJECT | TRC_TRANSFORM_NORMAL,
     0,
     {1, 1, 0},
     {{.89442719f, -.44721360f, 0}, {H, H, 0}, {1, 1, 0}}},
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_WORLD_TO_CAMERA | TRC_TRANSFORM_POINT,
     0,
     {1, 2, 40},
     {{0, 0, 10}, {0, 0, 10}, {0, 0, 10}}},
    {TRC_OP_TRANSFORM,
     TRC_TRANSFORM_CAMERA_TO_WORLD,
     0,
     {0, 0, 1},
     {{0, 0, -1}, {0, 0, -1}, {0, 0, -1}}},
    /* the point is sqrt(1/2) off the long side of its triangle */
    {TRC_OP_WIREFRAME, 0, 0, {1.3f, 8, 21, 30}, {{0}, {0}, {0}}},
    {TRC_OP_WIREFRAME, 0, 0, {1.5f, 8, 21, 30}, {{1}, {0}, {0}}},
    /* (-(y - .5), x - .5, 0) of Generated is (0, -.25, 0), which a quarter turn makes +X */
    {TRC_OP_TANGENT, TRC_TANGENT_Z, 0, {0}, {{1, 0, 0}, {0, -1, 0}, {0, 0, 0}}},
    {TRC_OP_TANGENT, TRC_TANGENT_UV, NAME_UV, {0}, {{1, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
    {TRC_OP_TANGENT, TRC_TANGENT_UV, NAME_TANGENT, {0}, {{-1, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
};

static void check_expectation(const struct expectation *e, struct trc_surface *s) {
    static struct trc_registers regs;
    struct single p;
    single_init(&p, e->op, e->mode, e->resource);
    for (int k = 0; k < 4; k++)
        regs.r[k] = vf_set(e->in[k]);
    trc_program_run(&p.material, s, &regs);
    for (int l = 0; l < TRC_WIDTH; l++) {
        const int32_t instance = vi_get(s->instance, l);
        const float *expected = e->out[instance < 0 ? 2 : instance];
        for (int k = 0; k < op_output_counts[e->op]; k++) {
            const float value = vf_get(regs.r[OUT + k], l);
            if (is_near(value, expected[k], 1e-5f))
                continue;
            fail_msg("%s mode %u on instance %d, output %d: %.9g, not %.9g", op_names[e->op],
                     e->mode, instance, k, value, expected[k]);
        }
    }
}

static void test_at_surfaces(void **state) {
    (void)state;
    static struct world_of_test w;
    struct trc_surface s;
    build_scene(&w);
    build_surface(&w, &s);
    for (size_t i = 0; i < sizeof expectations / sizeof *expectations; i++) {
        check_expectation(&expectations[i], &s);
    }
}

/* Seen from behind: the index of a Fresnel is that from inside, and mapped normals turn over. */
static void test_from_behind(void **state) {
    (void)state;
    static const struct expectation cases[] = {
        {TRC_OP_FRESNEL, 0, 0, {1.5f, 0, 0, 1}, {{0.11414110f}, {0.11414110f}, {0.11414110f}}},
        {TRC_OP_NORMAL_MAP,
         0,
         TRC_NO_RESOURCE,
         {1, 1, .5f, .5f},
         {{-1, 0, 0}, {0, 0, 1}, {0, 0, 1}}},
        {TRC_OP_NORMAL_MAP, 0, NAME_UV, {.5f, 1, .5f, .5f}, {{-H, 0, H}, {0, 0, 1}, {0, 0, 1}}},
        {TRC_OP_NORMAL_MAP, 1, 0, {1, 1, .5f, .5f}, {{0, -1, 0}, {-1, 0, 0}, {0, 0, 1}}},
    };
    static struct world_of_test w;
    struct trc_surface s;
    build_scene(&w);
    build_surface(&w, &s);
    s.backfacing = vm_all_set();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        check_expectation(&cases[i], &s);
}

/* An object mirrored along x, and twice as long there: normals go by the inverse transpose and stay
 * on their side. */
static void test_mirrored_object(void **state) {
    (void)state;
    static const float mirrored[12] = {-2, 0, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30},
                       inverse[12] = {-.5f, 0, 0, 5, 0, 1, 0, -20, 0, 0, 1, -30};
    static const struct expectation cases[] = {
        {TRC_OP_TRANSFORM,
         TRC_TRANSFORM_OBJECT_TO_WORLD | TRC_TRANSFORM_NORMAL,
         0,
         {1, 1, 0},
         {{-.44721360f, .89442719f, 0}, {H, H, 0}, {1, 1, 0}}},
        {TRC_OP_TRANSFORM,
         TRC_TRANSFORM_OBJECT_TO_WORLD | TRC_TRANSFORM_NORMAL,
         0,
         {0, 0, 1},
         {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
        {TRC_OP_TRANSFORM,
         TRC_TRANSFORM_WORLD_TO_OBJECT | TRC_TRANSFORM_NORMAL,
         0,
         {1, 1, 0},
         {{-.89442719f, .44721360f, 0}, {H, H, 0}, {1, 1, 0}}},
        {TRC_OP_NORMAL_MAP, 1, 0, {1, .5f, .5f, 1}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}},
    };
    static struct world_of_test w;
    struct trc_surface s;
    build_scene(&w);
    build_surface(&w, &s);
    memcpy(w.to_world[0].m, mirrored, sizeof mirrored);
    memcpy(w.to_object[0].m, inverse, sizeof inverse);
    w.instances[0].flips = 1;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        check_expectation(&cases[i], &s);
}

/* Lanes that are not active must not be read: their instance is nonsense. */
static void test_inactive_lanes(void **state) {
    (void)state;
    static struct world_of_test w;
    static struct trc_registers regs;
    struct trc_surface s;
    build_scene(&w);
    build_surface(&w, &s);
    s.active = vm_from_bits(1);
    s.instance = vi_select(s.active, s.instance, vi_set(12345678));
    s.triangle = vi_select(s.active, s.triangle, vi_set(-77777));
    for (size_t i = 0; i < sizeof expectations / sizeof *expectations; i++) {
        struct single p;
        single_init(&p, expectations[i].op, expectations[i].mode, expectations[i].resource);
        for (int k = 0; k < 4; k++)
            regs.r[k] = vf_set(expectations[i].in[k]);
        trc_program_run(&p.material, &s, &regs);
        assert_true(is_near(vf_get(regs.r[OUT], 0), expectations[i].out[0][0], 1e-5f));
    }
}

/* Smooth normals: the mapped normal (.5, .5, 1) is the interpolated one. */
static void test_smooth_normal_map(void **state) {
    (void)state;
    static struct world_of_test w;
    static struct trc_registers regs;
    struct trc_surface s;
    build_scene(&w);
    build_surface(&w, &s);
    w.mesh[0].vertex_normals = w.normals;
    w.mesh[0].smooth = &w.smooth;
    s.instance = vi_set(0);
    struct single p;
    single_init(&p, TRC_OP_NORMAL_MAP, 0, TRC_NO_RESOURCE);
    for (int k = 0; k < 4; k++)
        regs.r[k] = vf_set(k == 0 || k == 3 ? 1.0f : .5f);
    trc_program_run(&p.material, &s, &regs);
    double n[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const double x = .25 * k, length = sqrt(2 * x * x + 1),
                     weight = k == 1   ? .25
                              : k == 2 ? .5
                                       : .25;
        n[0] += weight * x / length;
        n[1] += weight * x / length;
        n[2] += weight / length;
    }
    /* The inverse transpose of the matrix: rows of the inverse are what normals are dotted with. */
    const double world[3] = {-n[1], .5 * n[0], n[2] / 3};
    const double length = sqrt(world[0] * world[0] + world[1] * world[1] + world[2] * world[2]);
    for (int k = 0; k < 3; k++) {
        assert_true(
            is_near(vf_get(regs.r[OUT + k], TRC_WIDTH - 1), (float)(world[k] / length), 1e-6f));
    }
}

/* ---- the world ---- */

/* Emission of the direction itself. */
static void test_world(void **state) {
    (void)state;
    struct trc_instruction instruction = {.op = TRC_OP_GENERATED, .out = 0};
    struct trc_operand operands[4] = {{0, 0}, {1, 0}, {2, 0}, {-1, 2}};
    struct trc_material material = {.leaf_count = 1,
                                    .operand_count = 4,
                                    .instruction_count = 1,
                                    .register_count = 3,
                                    .operands = operands,
                                    .instructions = &instruction,
                                    .has =
                                        TRC_MATERIAL_HAS_EMISSION | TRC_MATERIAL_EMISSION_VARIES};
    material.leaves[0] = (struct trc_leaf){TRC_NODE_BACKGROUND, 0, {-1, 1.0f}, 0, 4};
    struct trc_material *materials[1] = {&material};
    struct trc_snapshot snapshot = {.material_count = 1, .materials = materials};
    enum { COUNT = 2 * TRC_WIDTH + 1 };
    float directions[3 * COUNT], radiance[3 * COUNT];
    struct rng r = rng_seed(3);
    for (int i = 0; i < 3 * COUNT; i++)
        directions[i] = rng_unit(&r) + .1f;
    trc_world_evaluate(&snapshot, directions, radiance, COUNT);
    for (int i = 0; i < COUNT; i++) {
        const float *d = directions + 3 * i;
        const float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        for (int c = 0; c < 3; c++)
            assert_true(is_near(radiance[3 * i + c], 2 * d[c] / length, 1e-6f));
    }
    snapshot.world.is_constant = 1;
    snapshot.world.radiance[1] = 5;
    const vvec3 up = v3(vf_zero(), vf_zero(), vf_one());
    vvec3 c = trc_world_shade(&snapshot, up, vu_set(0), vu_set(0), vm_from_bits(1));
    assert_true(vf_get(c.y, 0) == 5.0f && vf_get(c.x, 0) == 0.0f);
    if (TRC_WIDTH > 1)
        assert_true(vf_get(c.y, TRC_WIDTH - 1) == 0.0f);
    snapshot.world.material = UINT32_MAX;
    c = trc_world_shade(&snapshot, up, vu_set(0), vu_set(0), vm_all_set());
    assert_true(vf_get(c.y, 0) == 0.0f);
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_cycles),
        cmocka_unit_test(test_against_scalar),
        cmocka_unit_test(test_outputs_over_inputs),
        cmocka_unit_test(test_curves),
        cmocka_unit_test(test_axis_rotation),
        cmocka_unit_test(test_at_surfaces),
        cmocka_unit_test(test_from_behind),
        cmocka_unit_test(test_mirrored_object),
        cmocka_unit_test(test_inactive_lanes),
        cmocka_unit_test(test_smooth_normal_map),
        cmocka_unit_test(test_world),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
