/* Lights at the edges of what might block them: a floor gets all of their light or none, by what is
 * in the way.
 *
 * Shadow rays go from the floor nearly to the light: they end 2e-5 of their way before it
 * (SHADOW_END in kernels/tile/direct.c). So what has a light on it, within that, does not block it,
 * whichever side it is seen from; what is farther from it does. */
#include "figures.h"
#include "picture_test.h"

/* Of the light, above the camera, which sees nothing but the floor. */
#define LIGHT_Z 8.0f
#define ALBEDO 0.5
/* Of the way from the floor to the light. */
#define SHADOW_END 2e-5f
#define SIZE_PX 16

/* A floor of grey under a camera; returns the scene. */
static trc_scene floor_create(void) {
    static const float window[4] = {-0.5f, 0.5f, -0.5f, 0.5f};
    const float grey[3] = {ALBEDO, ALBEDO, ALBEDO};
    const trc_scene scene = scene_create();
    const trc_camera_desc camera = camera_desc(window);
    assert_ok(trc_scene_set_camera(scene, &camera));
    add_square(scene, 0.0f, 0.0f, 0.0f, 10.0f, add_material(scene, TRC_NODE_DIFFUSE, grey, 0.0f));
    return scene;
}

/* Where a pixel's middle is on the floor. */
static double floor_at(uint32_t pixel) {
    return ((pixel + 0.5) / SIZE_PX - 0.5) * (double)CAMERA_HEIGHT;
}

static trc_id add_black(trc_scene scene) {
    return add_material(scene, TRC_NODE_DIFFUSE, (float[3]){0, 0, 0}, 0.0f);
}

/* Irradiance of the floor's pixels by the scene's light; destroys the scene. */
static void floor_light(trc_scene scene, uint32_t samples, double irradiance[SIZE_PX][SIZE_PX]) {
    static float pixels[4 * SIZE_PX * SIZE_PX];
    trc_render_desc desc = render_desc(SIZE_PX, samples);
    desc.filter_width = 1e-4f; /* 0.04 mm of the floor */
    assert_ok(trc_scene_commit(scene));
    render(scene, &desc, pixels);
    for (uint32_t y = 0; y < SIZE_PX; y++)
        for (uint32_t x = 0; x < SIZE_PX; x++)
            irradiance[y][x] = (double)pixels[4 * (y * SIZE_PX + x)] * PI / ALBEDO;
    assert_ok(trc_scene_destroy(scene));
}

/* ---- points of light ---- */

#define POINT_WATTS 100.0f

/* Above the floor at x. */
static void add_point(trc_scene scene, float x) {
    trc_light_desc light = default_light_desc();
    light.type = TRC_LIGHT_POINT;
    light.strength = POINT_WATTS;
    light.transform[3] = x;
    light.transform[11] = LIGHT_Z;
    trc_id id = 0;
    assert_ok(trc_light_create(scene, &light, &id));
}

enum lit { LIT_ALL, LIT_RIGHT, LIT_NONE };

/* The floor has what a point of light sends to the lit part, within rounding, and nothing at all
 * elsewhere. Returns the largest error. */
static double expect_point(trc_scene scene, float light_x, enum lit lit, const char *what) {
    static double irradiance[SIZE_PX][SIZE_PX];
    double worst = 0.0;
    add_point(scene, light_x);
    floor_light(scene, 4, irradiance);
    for (uint32_t y = 0; y < SIZE_PX; y++)
        for (uint32_t x = 0; x < SIZE_PX; x++) {
            const double at[2] = {floor_at(x) - (double)light_x, floor_at(y)}, z = (double)LIGHT_Z;
            const double distance2 = at[0] * at[0] + at[1] * at[1] + z * z;
            const double full = (double)POINT_WATTS / (4.0 * PI) * z / pow(distance2, 1.5);
            const bool is_lit = lit == LIT_ALL || (lit == LIT_RIGHT && at[0] > 0.0);
            const double found = irradiance[y][x];
            const double error = is_lit ? fabs(found / full - 1.0) : found == 0.0 ? 0.0 : INFINITY;
            if (!(error <= 1e-5))
                fail_msg("%s: pixel %u %u has %g, %s %g", what, x, y, found,
                         is_lit ? "not" : "should be dark, full is", full);
            worst = fmax(worst, error);
        }
    return worst;
}

/* A horizontal square whose right edge is at x = right, large enough to shade the floor left of
 * it. */
static void add_roof(trc_scene scene, float right, float z) {
    const float half = 4.0f;
    add_square(scene, right - half, 0.0f, z, half, add_black(scene));
}

static void add_wall(trc_scene scene, float top) {
    const float corners[12] = {0, -9, 0, 0, 9, 0, 0, 9, top, 0, -9, top};
    fixture_quad(scene, corners, add_black(scene));
}

static void point_at_an_edge(void **state) {
    (void)state;
    /* Farther from the light than shadow rays end before it. */
    const float gap = 1.5f * SHADOW_END * LIGHT_Z;
    static const float edges[] = {0.0f, 4.0f}; /* the free edge above x = 0, and the diagonal */
    double worst = 0.0;
    for (int e = 0; e < 2; e++) {
        const bool is_free = e == 0;
        const char *name = is_free ? "edge of a roof" : "diagonal of a roof";
        trc_scene scene = floor_create();
        add_roof(scene, edges[e], LIGHT_Z);
        worst = fmax(worst, expect_point(scene, 0.0f, LIT_ALL, name));
        /* One step towards the floor: no float of the way tells it from the light. */
        scene = floor_create();
        add_roof(scene, edges[e], nextafterf(LIGHT_Z, 0.0f));
        worst = fmax(worst, expect_point(scene, 0.0f, LIT_ALL, name));
        scene = floor_create();
        add_roof(scene, edges[e], LIGHT_Z - gap);
        worst = fmax(worst, expect_point(scene, 0.0f, is_free ? LIT_RIGHT : LIT_NONE, name));
    }
    trc_scene scene = floor_create();
    add_wall(scene, LIGHT_Z);
    worst = fmax(worst, expect_point(scene, 0.0f, LIT_ALL, "top of a wall"));
    /* Light beside the wall's edge: from behind, rays cross the wall just below its top. */
    scene = floor_create();
    add_wall(scene, LIGHT_Z);
    worst = fmax(worst, expect_point(scene, gap, LIT_RIGHT, "beside a wall"));
    print_figure("29: point of light on an edge", "lit or dark as it should be, light off by %.1e",
                 worst);
}

/* ---- areas of light ---- */

#define LIGHT_HALF 1.0
#define AREA_SAMPLES 4096

/* Irradiance of the floor's origin by an upright polygon of radiance 1, corners counter-clockwise
 * from below: half the sum over its edges of the angle they are seen under times the cosine of the
 * normal of the plane through them and the origin (J. H. Lambert, "Photometria", 1760). */
static double polygon_irradiance(const double corners[][3], int count) {
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        const double *a = corners[i], *b = corners[(i + 1) % count];
        const double normal[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                                  a[0] * b[1] - a[1] * b[0]};
        const double sine =
            sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        const double cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        sum += atan2(sine, cosine) * normal[2] / sine;
    }
    return 0.5 * fabs(sum);
}

/* Of the part of the light between x0 and its right side as a point of the floor has it. */
static double light_irradiance(double x, double y, double x0) {
    const double z = (double)LIGHT_Z, left = fmin(fmax(x0, -LIGHT_HALF), LIGHT_HALF) - x;
    const double right = LIGHT_HALF - x, near = -LIGHT_HALF - y, far = LIGHT_HALF - y;
    const double corners[4][3] = {
        {left, near, z}, {right, near, z}, {right, far, z}, {left, far, z}};
    return left < right ? polygon_irradiance(corners, 4) : 0.0;
}

/* A square light of radiance 1 above the origin, its edges along x and y. */
static void add_area(trc_scene scene) {
    trc_light_desc light = default_light_desc();
    light.transform[11] = LIGHT_Z;
    light.size_x = light.size_y = (float)(2.0 * LIGHT_HALF);
    light.strength = 4.0f * light.size_x * light.size_y; /* watts: 4 area per radiance */
    trc_id id = 0;
    assert_ok(trc_light_create(scene, &light, &id));
}

/* Under a light with a roof whose right edge is at x = right. Returns the largest error. */
static double expect_area(float right, float z, const char *what) {
    static double irradiance[SIZE_PX][SIZE_PX];
    const trc_scene scene = floor_create();
    add_roof(scene, right, z);
    add_area(scene);
    floor_light(scene, AREA_SAMPLES, irradiance);
    const bool blocks = z < LIGHT_Z * (1.0f - SHADOW_END);
    const double way = (double)z / (double)LIGHT_Z; /* up to the roof */
    double worst = 0.0;
    for (uint32_t j = 0; j < SIZE_PX; j++)
        for (uint32_t i = 0; i < SIZE_PX; i++) {
            const double x = floor_at(i), y = floor_at(j);
            /* The roof's edge as the floor sees it in the plane of the light. */
            const double edge = x + ((double)right - x) / way;
            const double expected = light_irradiance(x, y, blocks ? edge : -INFINITY);
            const double found = irradiance[j][i];
            const double error = expected > 0.0 ? fabs(found / expected - 1.0)
                                 : found == 0.0 ? 0.0
                                                : INFINITY;
            if (!(error <= 2e-3))
                fail_msg("%s: pixel %u %u has %g, not %g", what, i, j, found, expected);
            worst = fmax(worst, error);
        }
    return worst;
}

static void area_at_an_edge(void **state) {
    (void)state;
    const float below = LIGHT_Z * (1.0f - 1.5f * SHADOW_END), step = nextafterf(LIGHT_Z, 0.0f);
    double worst = expect_area(-(float)LIGHT_HALF, LIGHT_Z, "edge to edge");
    worst = fmax(worst, expect_area(-(float)LIGHT_HALF, below, "edge below edge"));
    /* A light in the plane of what it lies on, and one step before it. */
    worst = fmax(worst, expect_area(0.0f, LIGHT_Z, "half on a roof"));
    worst = fmax(worst, expect_area(0.0f, step, "half, one step below"));
    print_figure("29: area of light at an edge", "irradiance off by at most %.2f %%",
                 100.0 * worst);
    worst = fmax(expect_area(0.0f, below, "half"), expect_area(2.0f, below, "all"));
    print_figure("29: area of light half covered", "irradiance off by at most %.2f %%",
                 100.0 * worst);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(point_at_an_edge),
        cmocka_unit_test(area_at_an_edge),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("edges of lights", tests, NULL, NULL);
}
