/* Ideal glass, alone and in stacks, beside what optics says. */
#include "figures.h"
#include "meshes.h"
#include "picture_test.h"

static const float white[3] = {1, 1, 1};

/* The most bounces there are, and throughput below which Whitted leaves rays out: what is lost is
 * far below the tolerances. */
#define DEEP 253
#define FAINT 1e-8f

static const uint32_t integrators[] = {TRC_INTEGRATOR_WHITTED, TRC_INTEGRATOR_DISTRIBUTION};
static const char *const integrator_names[] = {"Whitted", "Distribution"};
enum { INTEGRATORS = 2 };

/* ---- materials and shapes ---- */

/* GLASS or REFRACTION, ideal; ior: the index within its surface over that outside. */
static trc_id add_dielectric(trc_scene scene, uint32_t type, float ior) {
    const trc_node_input inputs[6] = {{.node = -1, .value = {1, 1, 1}},
                                      {.node = -1},
                                      {.node = -1, .value = {ior}},
                                      {.node = -2},
                                      {.node = -1},
                                      {.node = -1}};
    const uint32_t count = type == TRC_NODE_GLASS ? 6 : 4; /* it may have a film */
    const trc_node node = {.type = type, .mode = TRC_DISTRIBUTION_SHARP, .input_count = count};
    const trc_material_desc desc = {.struct_size = sizeof desc,
                                    .node_count = 1,
                                    .nodes = &node,
                                    .inputs = inputs,
                                    .input_count = count};
    trc_id id = 0;
    assert_ok(trc_material_create(scene, &desc, &id));
    return id;
}

/* Adds a shape, moved by a transform, and frees it. */
static void add_shape_at(trc_scene scene, struct mesh *shape, const float transform[12],
                         trc_id material) {
    trc_mesh_desc desc = default_mesh_desc();
    desc.vertex_count = shape->vertex_count;
    desc.triangle_count = shape->triangle_count;
    desc.positions = shape->positions;
    desc.position_count = 3 * shape->vertex_count;
    desc.indices = shape->indices;
    desc.index_count = 3 * shape->triangle_count;
    fixture_mesh_at(scene, &desc, transform, material, 0);
    mesh_free(shape);
}

static void add_shape(trc_scene scene, struct mesh *shape, trc_id material) {
    add_shape_at(scene, shape, identity_transform, material);
}

/* Half of a slab's side, metres: wide enough for all that is seen of it. */
#define SLAB_HALF 400.0f

static void add_slab(trc_scene scene, float bottom, float top, trc_id material) {
    struct mesh box;
    mesh_init(&box);
    mesh_add_box(&box, (float[3]){-SLAB_HALF, -SLAB_HALF, bottom},
                 (float[3]){SLAB_HALF, SLAB_HALF, top});
    add_shape(scene, &box, material);
}

static void set_world(trc_scene scene, trc_id material) {
    const trc_world_desc world = default_world_desc(material);
    assert_ok(trc_scene_set_world(scene, &world));
}

/* A white furnace. */
static void set_white_world(trc_scene scene) {
    set_world(scene, add_material(scene, TRC_NODE_BACKGROUND, white, 1.0f));
}

/* A picture in which light goes on until nothing is left of it. */
static trc_render_desc deep_render_desc(uint32_t size, uint32_t samples, uint32_t integrator) {
    trc_render_desc desc = render_desc(size, samples);
    desc.integrator = integrator;
    desc.max_depth = DEEP;
    desc.attenuation_cutoff = FAINT;
    return desc;
}

/* ---- 34: through a slab and out again ---- */

enum { SLAB_PX = 64, SLAB_FLOATS = 4 * SLAB_PX * SLAB_PX };

/* What is seen of a world that shows directions, through a slab of that index or, if 0, none. The
 * corners are 80 degrees off the axis. */
static void draw_directions(float ior, uint32_t integrator, float pixels[SLAB_FLOATS]) {
    static const float window[4] = {-4.01f, 4.01f, -4.01f, 4.01f};
    const trc_scene scene = scene_create();
    set_world(scene,
              add_vector_shader(scene, TRC_NODE_BACKGROUND, TRC_NODE_TEXTURE_COORDINATE, 0.5f));
    if (ior > 0.0f)
        add_slab(scene, 1.0f, 2.0f, add_dielectric(scene, TRC_NODE_REFRACTION, ior));
    const trc_camera_desc camera = camera_desc(window);
    set_camera(scene, &camera);
    const trc_render_desc desc = deep_render_desc(SLAB_PX, 1, integrator);
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
}

/* The angle between directions that two colours show, which are nearly the same. */
static double angle_between(const float *a, const float *b) {
    double square = 0.0;
    for (int k = 0; k < 3; k++)
        square += pow(2.0 * ((double)a[k] - (double)b[k]), 2.0);
    return sqrt(square);
}

static void slab_round_trip(void **state) {
    (void)state;
    static float straight[SLAB_FLOATS], bent[SLAB_FLOATS];
    static const float indices[] = {1.5f, 2.4f};
    double worst = 0.0;
    for (int g = 0; g < INTEGRATORS; g++) {
        draw_directions(0.0f, integrators[g], straight);
        for (size_t i = 0; i < sizeof indices / sizeof *indices; i++) {
            draw_directions(indices[i], integrators[g], bent);
            for (uint32_t p = 0; p < SLAB_FLOATS; p += 4) {
                const double off = angle_between(straight + p, bent + p);
                if (!(off <= 1e-5))
                    fail_msg("%s, index %g: pixel %u exits %g rad off", integrator_names[g],
                             (double)indices[i], p / 4, off);
                worst = fmax(worst, off);
            }
        }
    }
    print_figure("34: slab round trip", "exit off by at most %.1e rad", worst);
}

/* ---- 35: stacks of dielectrics ---- */

/* The share of unpolarised light that a plane reflects; eta: index beyond over index before. */
static double fresnel(double cosine, double eta) {
    const double sine2 = (1.0 - cosine * cosine) / (eta * eta);
    if (sine2 >= 1.0)
        return 1.0;
    const double beyond = sqrt(1.0 - sine2);
    const double s = (cosine - eta * beyond) / (cosine + eta * beyond);
    const double p = (eta * cosine - beyond) / (eta * cosine + beyond);
    return 0.5 * (s * s + p * p);
}

/* What planes between media of these indices, the first that of the camera, let through of light
 * whose waves do not interfere: each further plane and those before it send light to and fro. */
static double stack_transmission(const double *indices, int count, double cosine) {
    const double sine = indices[0] * sqrt(1.0 - cosine * cosine);
    double through = 1.0, back = 0.0; /* of the planes so far, back: seen from below */
    for (int i = 0; i + 1 < count; i++) {
        const double at = sine / indices[i];
        const double r = fresnel(sqrt(1.0 - at * at), indices[i + 1] / indices[i]);
        const double gain = 1.0 / (1.0 - back * r);
        through *= (1.0 - r) * gain;
        back = r + (1.0 - r) * (1.0 - r) * back * gain;
    }
    return through;
}

enum { ANGLES = 24 };

/* Up to 75 degrees off the axis, a row of pixels. */
#define LARGEST_TANGENT 3.73f
static double angle_cosine(int pixel) {
    const double tangent = (double)LARGEST_TANGENT * (pixel + 0.5) / ANGLES;
    return 1.0 / sqrt(1.0 + tangent * tangent);
}

/* The scene from above under all angles; destroys it. */
static void draw_angles(trc_scene scene, uint32_t integrator, uint32_t samples,
                        float pixels[4 * ANGLES]) {
    static const float window[4] = {0.0f, LARGEST_TANGENT, -1e-3f, 1e-3f};
    const trc_camera_desc camera = camera_desc(window);
    set_camera(scene, &camera);
    trc_render_desc desc = deep_render_desc(ANGLES, samples, integrator);
    desc.height = 1;
    desc.filter_width = 1e-4f;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
}

/* Slabs from the camera down, each with the index inside over that outside. */
struct slab {
    float bottom, top, ior;
};

struct stack {
    const char *name;
    struct slab slabs[2];
    int slab_count;
    double indices[5]; /* of the media */
    int index_count;
};

static trc_scene stack_create(const struct stack *s) {
    const trc_scene scene = scene_create();
    for (int i = 0; i < s->slab_count; i++)
        add_slab(scene, s->slabs[i].bottom, s->slabs[i].top,
                 add_dielectric(scene, TRC_NODE_GLASS, s->slabs[i].ior));
    return scene;
}

/* A shining floor through glass under a black sky, under all angles. */
static void draw_stack(const struct stack *s, uint32_t integrator, uint32_t samples,
                       float pixels[4 * ANGLES]) {
    const trc_scene scene = stack_create(s);
    add_square(scene, 0.0f, 0.0f, 0.0f, SLAB_HALF,
               add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
    draw_angles(scene, integrator, samples, pixels);
}

static const struct stack stacks[] = {
    {"slab", {{1, 2, 1.5f}}, 1, {1, 1.5, 1}, 3},
    {"dense slab", {{1, 2, 2.4f}}, 1, {1, 2.4, 1}, 3},
    {"slabs apart", {{3, 4, 1.5f}, {1, 2, 1.5f}}, 2, {1, 1.5, 1, 1.5, 1}, 5},
    {"slab in a slab", {{1, 4, 1.5f}, {2, 3, 1.2f}}, 2, {1, 1.5, 1.8, 1.5, 1}, 5},
    {"air in a slab", {{1, 4, 1.5f}, {2, 3, 1 / 1.5f}}, 2, {1, 1.5, 1, 1.5, 1}, 5},
};
#define STACKS (sizeof stacks / sizeof *stacks)

/* Whitted follows every way. */
static void every_way_through_slabs(void **state) {
    (void)state;
    double worst = 0.0;
    for (const struct stack *s = stacks; s < stacks + STACKS; s++) {
        float pixels[4 * ANGLES];
        draw_stack(s, TRC_INTEGRATOR_WHITTED, 1, pixels);
        for (int i = 0; i < ANGLES; i++) {
            const double found = (double)pixels[4 * i], cosine = angle_cosine(i);
            const double expected = stack_transmission(s->indices, s->index_count, cosine);
            const double error = fabs(found / expected - 1.0);
            if (!(error <= 2e-3))
                fail_msg("%s: %g, not %g at cosine %g", s->name, found, expected, cosine);
            worst = fmax(worst, error);
        }
    }
    print_figure("35: slabs of glass, Whitted", "light through them off by at most %.1e", worst);
}

/* Distribution leaves ways to chance: their mean over all angles is off by .04 % or so. */
static void chance_ways_through_slabs(void **state) {
    (void)state;
    double worst = 0.0;
    for (const struct stack *s = stacks; s < stacks + STACKS; s++) {
        float pixels[4 * ANGLES];
        double found = 0.0, expected = 0.0;
        draw_stack(s, TRC_INTEGRATOR_DISTRIBUTION, 16384, pixels);
        for (int i = 0; i < ANGLES; i++) {
            found += (double)pixels[4 * i] / ANGLES;
            expected += stack_transmission(s->indices, s->index_count, angle_cosine(i)) / ANGLES;
        }
        const double error = fabs(found / expected - 1.0);
        if (!(error <= 2e-3))
            fail_msg("%s: %g, not %g", s->name, found, expected);
        worst = fmax(worst, error);
    }
    print_figure("35: slabs of glass, Distribution", "light through them off by at most %.1e",
                 worst);
}

/* A picture of a furnace is white all over; destroys the scene. Returns the largest error. */
static double expect_white(trc_scene scene, const trc_camera_desc *camera, uint32_t integrator,
                           uint32_t samples, const char *what) {
    enum { SIZE = 16 };
    static float pixels[4 * SIZE * SIZE];
    set_white_world(scene);
    set_camera(scene, camera);
    const trc_render_desc desc = deep_render_desc(SIZE, samples, integrator);
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    double worst = 0.0;
    for (uint32_t i = 0; i < 4 * SIZE * SIZE; i++) {
        const double error = fabs((double)pixels[i] - 1.0);
        if (!(error <= 2e-3))
            fail_msg("%s: pixel %u is %g", what, i / 4, (double)pixels[i]);
        worst = fmax(worst, error);
    }
    return worst;
}

/* From within a cube of glass, below the critical angle of the face ahead: beside it rays are
 * reflected totally, but nothing is lost. */
static void furnace_from_within(void **state) {
    (void)state;
    static const float window[4] = {-0.6f, 0.6f, -0.6f, 0.6f};
    trc_camera_desc camera = camera_desc(window);
    camera.transforms = identity_transform;
    double worst = 0.0;
    for (int g = 0; g < INTEGRATORS; g++) {
        const trc_scene scene = scene_create();
        const trc_mesh_desc cube = default_mesh_desc();
        fixture_mesh(scene, &cube, add_dielectric(scene, TRC_NODE_GLASS, 1.5f), 0);
        worst =
            fmax(worst, expect_white(scene, &camera, integrators[g], 1024, integrator_names[g]));
    }
    print_figure("35: camera in glass, furnace", "off by at most %.1e", worst);
}

static void add_ball(trc_scene scene, float radius, float ior) {
    struct mesh ball;
    mesh_init(&ball);
    mesh_add_icosphere(&ball, (float[3]){0.1f, 0.05f, 0.0f}, radius, 4);
    add_shape(scene, &ball, add_dielectric(scene, TRC_NODE_GLASS, ior));
}

/* Their middle: facets keep a part of the light that comes in at the rim for more bounces than
 * there are, a few percent of it. */
static void furnace_of_balls(void **state) {
    (void)state;
    static const float window[4] = {-0.04f, 0.04f, -0.04f, 0.04f};
    static const float inner[] = {1.2f, 1 / 1.5f, 1.5f};
    const trc_camera_desc camera = camera_desc(window);
    double worst = 0.0;
    for (size_t i = 0; i < sizeof inner / sizeof *inner; i++) {
        const trc_scene scene = scene_create();
        add_ball(scene, 1.0f, 1.5f);
        add_ball(scene, 0.5f, inner[i]);
        worst = fmax(
            worst, expect_white(scene, &camera, TRC_INTEGRATOR_DISTRIBUTION, 1024, "nested balls"));
    }
    print_figure("35: nested balls of glass, furnace", "off by at most %.1e", worst);
}

/* Slabs that share a face: as if a sheet of air were between them, but that rounding decides which
 * of the two surfaces a ray meets first. From a slab that comes before its own end, light goes into
 * the next one as if from air, which reflects less. */
static void faces_that_touch(void **state) {
    (void)state;
    static const struct stack touching = {
        "touching", {{2, 3, 1.5f}, {1, 2, 1.5f}}, 2, {1, 1.5, 1, 1.5, 1}, 5};
    float pixels[4 * ANGLES];
    double worst = 0.0, worst_white = 0.0;
    draw_stack(&touching, TRC_INTEGRATOR_WHITTED, 1, pixels);
    for (int i = 0; i < ANGLES; i++) {
        const double found = (double)pixels[4 * i];
        const double expected =
            stack_transmission(touching.indices, touching.index_count, angle_cosine(i));
        if (!(fabs(found - expected) <= 0.03))
            fail_msg("touching slabs: %g, not %g at angle %d", found, expected, i);
        worst = fmax(worst, fabs(found - expected));
    }
    const trc_scene scene = stack_create(&touching);
    set_white_world(scene);
    draw_angles(scene, TRC_INTEGRATOR_WHITTED, 1, pixels);
    for (int i = 0; i < 4 * ANGLES; i++) {
        const double error = fabs((double)pixels[i] - 1.0);
        if (!(error <= 2e-3))
            fail_msg("touching slabs in a furnace: pixel %d is %g", i / 4, (double)pixels[i]);
        worst_white = fmax(worst_white, error);
    }
    print_figure("35: slabs that touch", "light through them off by at most %.3f", worst);
    print_figure("35: slabs that touch, furnace", "off by at most %.1e", worst_white);
}

/* A slab as an instance that is turned and moved: its faces are where add_slab has them, but for
 * rounding. */
static void add_turned_slab(trc_scene scene, float bottom, float top, trc_id material) {
    const float half = 0.5f * (top - bottom), z = 0.5f * (top + bottom);
    const float transform[12] = {0.8f, -0.6f, 0, 0, 0.6f, 0.8f, 0, 0, 0, 0, 1, z};
    struct mesh box;
    mesh_init(&box);
    mesh_add_box(&box, (float[3]){-SLAB_HALF, -SLAB_HALF, -half},
                 (float[3]){SLAB_HALF, SLAB_HALF, half});
    add_shape_at(scene, &box, transform, material);
}

/* How a slab stands on a shining floor. */
struct standing {
    float level;
    bool is_turned, floor_first;
};
static const float standing_index = 1.5f;

static void draw_standing(const struct standing *s, uint32_t integrator, uint32_t samples,
                          float pixels[4 * ANGLES]) {
    const trc_scene scene = scene_create();
    const trc_id shining = add_material(scene, TRC_NODE_EMISSION, white, 1.0f);
    const trc_id glass = add_dielectric(scene, TRC_NODE_GLASS, standing_index);
    if (s->floor_first)
        add_square(scene, 0.0f, 0.0f, s->level, 1.5f * SLAB_HALF, shining);
    (s->is_turned ? add_turned_slab : add_slab)(scene, s->level, s->level + 1.0f, glass);
    if (!s->floor_first)
        add_square(scene, 0.0f, 0.0f, s->level, 1.5f * SLAB_HALF, shining);
    draw_angles(scene, integrator, samples, pixels);
}

/* Light comes through both of the slab's faces, or through the upper one alone where the floor is
 * met first; what is left of it goes to and fro in the slab. Returns by how much there is less or
 * more of it. */
static double expect_standing(const struct standing *s, uint32_t integrator, uint32_t samples,
                              double tolerance) {
    const double indices[3] = {1.0, (double)standing_index, 1.0};
    float pixels[4 * ANGLES];
    double worst = 0.0;
    draw_standing(s, integrator, samples, pixels);
    for (int i = 0; i < ANGLES; i++) {
        const double found = (double)pixels[4 * i], cosine = angle_cosine(i);
        const double two = stack_transmission(indices, 3, cosine),
                     one = stack_transmission(indices, 2, cosine);
        const double off = fmax(two - found, found - one);
        if (!(off <= tolerance))
            fail_msg("level %g: %g at angle %d, not %g to %g", (double)s->level, found, i, two,
                     one);
        worst = fmax(worst, off);
    }
    return worst;
}

static void slab_on_a_floor(void **state) {
    (void)state;
    double worst = 0.0;
    for (int first = 0; first < 2; first++) {
        const struct standing ways[] = {
            {0.0f, false, first}, {0.3f, false, first}, {0.3f, true, first}};
        for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
            worst = fmax(worst, expect_standing(&ways[i], TRC_INTEGRATOR_WHITTED, 1, 2e-3));
            expect_standing(&ways[i], TRC_INTEGRATOR_DISTRIBUTION, 4096, 0.03);
        }
    }
    print_figure("35: slab on a floor", "beyond light through one or two faces by at most %.1e",
                 worst);
}

/* ---- 36: a cage of total reflection ---- */

/* Turns z to the diagonal of a cube, from which all its faces are seen under 55 degrees, and the
 * other way round. */
static const float to_diagonal[12] = {0.7071067812f,
                                      0.4082482905f,
                                      0.5773502692f,
                                      0,
                                      -0.7071067812f,
                                      0.4082482905f,
                                      0.5773502692f,
                                      0,
                                      0,
                                      -0.8164965809f,
                                      0.5773502692f,
                                      0};
static const float from_diagonal[12] = {0.7071067812f,
                                        -0.7071067812f,
                                        0,
                                        0,
                                        0.4082482905f,
                                        0.4082482905f,
                                        -0.8164965809f,
                                        0,
                                        0.5773502692f,
                                        0.5773502692f,
                                        0.5773502692f,
                                        0};

enum { CAGE_PX = 32, CAGE_SAMPLES = 4 };

/* What comes of a picture from within a cube of glass under a white sky, along directions that keep
 * 35 degrees and more off the normals of its faces. is_turned: the cube instead of the camera. */
static trc_render_progress draw_cage(uint32_t integrator, uint32_t max_depth, bool is_turned,
                                     float pixels[4 * CAGE_PX * CAGE_PX]) {
    static const float window[4] = {-0.2f, 0.2f, -0.2f, 0.2f};
    const trc_scene scene = scene_create();
    struct mesh cube;
    mesh_init(&cube);
    mesh_add_box(&cube, (float[3]){-1, -1, -1}, (float[3]){1, 1, 1});
    if (is_turned)
        mesh_transform(&cube, 0, from_diagonal);
    add_shape(scene, &cube, add_dielectric(scene, TRC_NODE_GLASS, 2.4f));
    set_white_world(scene);
    trc_camera_desc camera = camera_desc(window);
    camera.transforms = is_turned ? identity_transform : to_diagonal;
    set_camera(scene, &camera);
    trc_render_desc desc = deep_render_desc(CAGE_PX, CAGE_SAMPLES, integrator);
    desc.filter_width = 1.0f;
    desc.max_depth = max_depth;
    const trc_render_progress done = render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    return done;
}

/* The picture is black but for ways that got out, of which there are no more than most. Returns
 * their number, at least. */
static uint32_t count_escapes(const float *pixels, uint32_t most) {
    uint32_t escapes = 0;
    for (uint32_t i = 0; i < 4 * CAGE_PX * CAGE_PX; i += 4) {
        assert_true(isfinite(pixels[i]) && pixels[i] >= 0.0f);
        escapes += pixels[i] > 0.0f;
    }
    if (escapes > most)
        fail_msg("light got into %u pixels", escapes);
    return escapes;
}

/* Depths beyond the most there is are that one. The last ray of a way is one that still finds light
 * but is not scattered any more. */
static uint64_t cage_rays(uint32_t max_depth) {
    const uint64_t depth = max_depth < DEEP ? max_depth : DEEP;
    return (uint64_t)CAGE_PX * CAGE_PX * CAGE_SAMPLES * (depth + 1);
}

static const uint32_t cage_depths[] = {8, 64, 1024};
#define CAGE_DEPTHS (sizeof cage_depths / sizeof *cage_depths)

/* Every ray is followed by one, until the last; where ways are left to chance, some end before, as
 * Distribution gives a little of it to refraction that does not happen. */
static void cage(void **state) {
    (void)state;
    static float pixels[4 * CAGE_PX * CAGE_PX];
    for (size_t d = 0; d < CAGE_DEPTHS; d++) {
        const uint64_t rays = cage_rays(cage_depths[d]);
        trc_render_progress done = draw_cage(TRC_INTEGRATOR_WHITTED, cage_depths[d], false, pixels);
        count_escapes(pixels, 0);
        assert_true(done.rays_reflection == rays && done.rays_refraction == 0);
        done = draw_cage(TRC_INTEGRATOR_DISTRIBUTION, cage_depths[d], false, pixels);
        count_escapes(pixels, 0);
        assert_true(done.rays_reflection <= rays && done.rays_refraction == 0);
        assert_true(done.rays_reflection >= rays / 2);
    }
    const uint64_t rays = cage_rays(cage_depths[CAGE_DEPTHS - 1]);
    print_figure("36: cage of total reflection", "none of %" PRIu64 " bounces gets out", rays);
}

/* Where faces are not along the axes, what hits one of them nearer to an edge than the rounding
 * error of the point may be beyond the other face there, and the ray that leaves it is outside:
 * less than one of a million bounces. */
static void turned_cage(void **state) {
    (void)state;
    static float pixels[4 * CAGE_PX * CAGE_PX];
    const uint64_t rays = cage_rays(DEEP);
    const trc_render_progress done = draw_cage(TRC_INTEGRATOR_WHITTED, DEEP, true, pixels);
    const uint32_t escapes = count_escapes(pixels, (uint32_t)(rays / 100000));
    assert_true(done.rays_reflection <= rays);
    print_figure("36: turned cage of total reflection", "%u of %" PRIu64 " bounces get out",
                 escapes, rays);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slab_round_trip),
        cmocka_unit_test(every_way_through_slabs),
        cmocka_unit_test(chance_ways_through_slabs),
        cmocka_unit_test(furnace_from_within),
        cmocka_unit_test(furnace_of_balls),
        cmocka_unit_test(faces_that_touch),
        cmocka_unit_test(slab_on_a_floor),
        cmocka_unit_test(cage),
        cmocka_unit_test(turned_cage),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("optics", tests, NULL, NULL);
}
