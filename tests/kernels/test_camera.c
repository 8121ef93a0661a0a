/* Cameras: the shape of the aperture, zoom and motion over the shutter, and what passes make of a
 * camera that moves. */
#include "figures.h"
#include "picture_test.h"

#include <complex.h>

static const float white[3] = {1, 1, 1};

/* ---- the aperture's polygon ---- */

#define SPOT_PX 64
#define SPOT_SAMPLES 256
/* Of each coordinate, for integrals over polygons: off by less than 1e-4 of the moments. */
#define FINE_POINTS 400

struct moment {
    double complex mean;
    double deviation; /* of one sample */
};

/* The mean of z^order over a regular polygon of circumradius 1 that has the middle of an edge at
 * an angle. */
static struct moment polygon_moment(uint32_t corners, double angle, int order) {
    const double half = PI / corners, reach = cos(half);
    double complex sum = 0.0;
    double square = 0.0;
    uint64_t count = 0;
    for (int i = 0; i < FINE_POINTS; i++)
        for (int j = 0; j < FINE_POINTS; j++) {
            const double x = (2.0 * i + 1.0) / FINE_POINTS - 1.0;
            const double y = (2.0 * j + 1.0) / FINE_POINTS - 1.0;
            bool inside = true;
            for (uint32_t k = 0; k < corners && inside; k++)
                inside = x * cos(angle + 2.0 * half * k) + y * sin(angle + 2.0 * half * k) <= reach;
            if (!inside)
                continue;
            const double complex power = cpow(x + I * y, order);
            sum += power;
            square += creal(power * conj(power));
            count++;
        }
    const double complex mean = sum / (double)count;
    return (struct moment){mean, sqrt(square / (double)count)};
}

/* A shining square out of focus, behind the focus or before it, where the aperture's image is
 * turned over. Its moment of the polygon's order is that of the aperture's image alone: square and
 * pixels have none of an order that 4 does not divide, and the polygon none of lower orders. */
static void blades_turn_with_the_lens(void **state) {
    (void)state;
    static const struct {
        uint32_t blades;
        float rotation, focus;
    } cases[] = {
        {3, 0.2f, 4.0f}, {3, -0.2f, 9.0f}, {5, 0.1f, 4.0f}, {5, 0.25f, 9.0f}, {6, 0.15f, 4.0f}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const float distance = 6.0f, radius = 0.3f;
        const double image =
            (double)radius * (1.0 / (double)cases[c].focus - 1.0 / (double)distance);
        const float edge = 1.5f * (float)fabs(image);
        const float window[4] = {-edge, edge, -edge, edge};
        trc_camera_desc camera = camera_desc(window);
        camera.aperture_radius = radius;
        camera.focus_distance = cases[c].focus;
        camera.blade_count = cases[c].blades;
        camera.blade_rotation = cases[c].rotation;
        const trc_scene scene = scene_create();
        add_square(scene, 0.0f, 0.0f, CAMERA_HEIGHT - distance, 0.2f * edge * distance,
                   add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
        set_camera(scene, &camera);
        static float pixels[4 * SPOT_PX * SPOT_PX];
        trc_render_desc desc = render_desc(SPOT_PX, SPOT_SAMPLES);
        desc.filter_width = 1.0f;
        render(scene, &desc, pixels);
        assert_ok(trc_scene_destroy(scene));
        double sum = 0.0;
        double complex found = 0.0;
        const int order = (int)cases[c].blades;
        for (uint32_t i = 0; i < SPOT_PX * SPOT_PX; i++) {
            const double x = (i % SPOT_PX + 0.5 - SPOT_PX / 2) * 2.0 / SPOT_PX;
            const double y = (i / SPOT_PX + 0.5 - SPOT_PX / 2) * 2.0 / SPOT_PX;
            sum += (double)pixels[4 * i];
            found += (double)pixels[4 * i] * cpow((x + I * y) * (double)edge / image, order);
        }
        found /= sum;
        const struct moment m = polygon_moment(cases[c].blades, (double)cases[c].rotation, order);
        /* Five standard errors of as many independent samples as have met the square, of which the
         * square itself makes the moments' deviation up to 1.5 times as large. */
        const double allowed = 5.0 * 1.5 * m.deviation / sqrt(sum * SPOT_SAMPLES);
        const double off = cabs(found - m.mean);
        printf("  %u blades: moment %.4f%+.4fi, %.4f%+.4fi expected, off by %.4f of %.4f\n",
               cases[c].blades, creal(found), cimag(found), creal(m.mean), cimag(m.mean), off,
               allowed);
        assert_true(allowed < 0.3 * cabs(m.mean));
        assert_true(off <= allowed);
    }
}

/* ---- zoom and motion over the shutter ---- */

enum { SIDE = 16, FRAME = SIDE * SIDE, SAMPLES = 256, STEPS = 1 << 14 };

#define MAX_KEYS 4

/* A camera over the floor z = 0 that looks straight down: where it is and its window, at each
 * key. */
struct flight {
    uint32_t type, key_count;
    double at[MAX_KEYS][3], window[MAX_KEYS][4];
};

static const struct flight flights[] = {
    /* Zoom alone: in and back out by another way. */
    {TRC_CAMERA_PERSPECTIVE,
     3,
     {{0, 0, 5}, {0, 0, 5}, {0, 0, 5}},
     {{-.5, .5, -.5, .5}, {-.2, .35, -.3, .3}, {-.4, .6, -.2, .8}}},
    {TRC_CAMERA_ORTHOGRAPHIC,
     3,
     {{0, 0, 5}, {0, 0, 5}, {0, 0, 5}},
     {{-2.5, 2.5, -2.5, 2.5}, {-1, 1.7, -1.5, 1.5}, {-2, 3, -1, 4}}},
    /* With motion along and across the view; an even count of keys has none in the middle. */
    {TRC_CAMERA_PERSPECTIVE,
     2,
     {{0.4, 0, 4}, {-0.6, 0.3, 7}},
     {{-.5, .5, -.5, .5}, {-.3, .35, -.3, .3}}},
    {TRC_CAMERA_PERSPECTIVE,
     4,
     {{0.4, 0, 4}, {0, 0.3, 5}, {-0.3, 0.1, 5.5}, {0.2, 0, 7}},
     {{-.5, .5, -.5, .5}, {-.3, .35, -.3, .3}, {-.4, .4, -.4, .4}, {-.6, .4, -.6, .4}}},
    {TRC_CAMERA_ORTHOGRAPHIC,
     3,
     {{0.4, 0, 4}, {0, 0.3, 5.5}, {-0.3, 0.1, 6}},
     {{-2.5, 2.5, -2.5, 2.5}, {-1, 1.7, -1.5, 1.5}, {-2, 3, -1, 4}}},
};
enum { FLIGHTS = sizeof flights / sizeof *flights };

struct pose {
    double at[3], window[4];
};

static struct pose pose_at(const struct flight *f, double time) {
    struct pose pose;
    const double x = time * (f->key_count - 1);
    const uint32_t key = x < f->key_count - 2.0 ? (uint32_t)x : f->key_count - 2;
    const double part = x - key;
    for (int k = 0; k < 3; k++)
        pose.at[k] = f->at[key][k] * (1.0 - part) + f->at[key + 1][k] * part;
    for (int k = 0; k < 4; k++)
        pose.window[k] = f->window[key][k] * (1.0 - part) + f->window[key + 1][k] * part;
    return pose;
}

/* Where the middle of a pixel meets the floor. */
static void floor_point(const struct flight *f, const struct pose *pose, uint32_t x, uint32_t y,
                        double point[2]) {
    const double middle[2] = {(x + 0.5) / SIDE, (y + 0.5) / SIDE};
    const double scale = f->type == TRC_CAMERA_ORTHOGRAPHIC ? 1.0 : pose->at[2];
    for (int k = 0; k < 2; k++)
        point[k] = pose->at[k] + scale * (pose->window[2 * k] * (1.0 - middle[k]) +
                                          pose->window[2 * k + 1] * middle[k]);
}

static void set_flight(trc_scene scene, const struct flight *f, const float *curve,
                       uint32_t curve_count) {
    float transforms[12 * MAX_KEYS], windows[4 * MAX_KEYS];
    for (uint32_t key = 0; key < f->key_count; key++) {
        memcpy(transforms + 12 * key, identity_transform, sizeof identity_transform);
        for (int k = 0; k < 3; k++)
            transforms[12 * key + 4 * (uint32_t)k + 3] = (float)f->at[key][k];
        for (int k = 0; k < 4; k++)
            windows[4 * key + (uint32_t)k] = (float)f->window[key][k];
    }
    trc_camera_desc camera = default_camera_desc();
    camera.type = f->type;
    camera.key_count = camera.window_key_count = f->key_count;
    camera.transforms = transforms;
    camera.windows = windows;
    camera.shutter_time = 1.0f;
    camera.shutter_curve = curve;
    camera.shutter_curve_count = curve_count;
    set_camera(scene, &camera);
}

/* The corner of the floor that shines. */
static const double corner[2] = {0.31, -0.23};

/* How long a pixel sees the shining corner: the share of the shutter's light. */
static double corner_share(const struct flight *f, uint32_t x, uint32_t y, bool is_wedge) {
    double seen = 0.0, all = 0.0;
    for (int i = 0; i < STEPS; i++) {
        const double time = (i + 0.5) / STEPS, open = is_wedge ? time : 1.0;
        const struct pose pose = pose_at(f, time);
        double point[2];
        floor_point(f, &pose, x, y, point);
        all += open;
        seen += point[0] > corner[0] && point[1] > corner[1] ? open : 0.0;
    }
    return seen / all;
}

/* What is seen of a corner of the floor, by a shutter that is open all the time or opens slowly. */
static void zoom_and_motion_blur(void **state) {
    (void)state;
    static const float wedge[2] = {0.0f, 1.0f};
    static float pixels[4 * FRAME];
    for (size_t i = 0; i < FLIGHTS; i++)
        for (int is_wedge = 0; is_wedge < 2; is_wedge++) {
            const trc_scene scene = scene_create();
            const float half = 50.0f;
            add_square(scene, (float)corner[0] + half, (float)corner[1] + half, 0.0f, half,
                       add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
            set_flight(scene, &flights[i], is_wedge ? wedge : NULL, is_wedge ? 2 : 0);
            const trc_render_desc desc = render_desc(SIDE, SAMPLES);
            render(scene, &desc, pixels);
            assert_ok(trc_scene_destroy(scene));
            double worst = 0.0, blurred = 0.0;
            for (uint32_t p = 0; p < FRAME; p++) {
                const double want = corner_share(&flights[i], p % SIDE, p / SIDE, is_wedge != 0);
                worst = fmax(worst, fabs((double)pixels[4 * p] - want));
                blurred += want > 0.02 && want < 0.98;
            }
            /* Times are stratified, one in each of SAMPLES strata, and a pixel's view crosses the
             * corner's edges up to four times: up to 4 strata off; and as much again for the
             * filter's hundredth of a pixel and the table of the shutter. */
            printf("  flight %zu, %s: off by %.4f at most, %.0f blurred pixels\n", i,
                   is_wedge ? "wedge" : "box", worst, blurred);
            assert_true(blurred > 20.0);
            assert_true(worst <= 8.0 / SAMPLES);
        }
}

/* ---- passes of a moving camera ---- */

static const float mist_start = 3.0f, mist_depth = 6.0f, mist_falloff = 2.0f;

/* Passes of the first sample that is seen of the whole floor. */
static void draw_floor(const struct flight *f, uint32_t pass, uint32_t samples, float *pixels) {
    const trc_scene scene = scene_create();
    add_square(scene, 0.0f, 0.0f, 0.0f, 50.0f, add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
    set_flight(scene, f, NULL, 0);
    trc_render_desc desc = render_desc(SIDE, samples);
    desc.passes = UINT64_C(1) << pass;
    desc.mist_start = mist_start;
    desc.mist_depth = mist_depth;
    desc.mist_falloff = mist_falloff;
    fixture_draw(scene, &desc, pass, pixels, (uint64_t)trc_pass_channels(pass) * FRAME);
    assert_ok(trc_scene_destroy(scene));
}

/* Cycles measures depth from where the camera is in the middle of the shutter. */
static void depth_is_of_the_middle(void **state) {
    (void)state;
    static float depth[FRAME];
    for (size_t i = 0; i < FLIGHTS; i++) {
        draw_floor(&flights[i], TRC_PASS_DEPTH, 4, depth);
        const double want = pose_at(&flights[i], 0.5).at[2];
        for (uint32_t p = 0; p < FRAME; p++)
            if (!(fabs((double)depth[p] - want) <= 1e-5)) /* a few ulp of 7 m */
                fail_msg("flight %zu, pixel %u: depth %.6f, not %.6f", i, p, (double)depth[p],
                         want);
    }
}

/* The same for mist, whose distance is that of a point which does depend on the time. */
static void mist_is_of_the_middle(void **state) {
    (void)state;
    static float mist[FRAME];
    double worst = 0.0;
    for (size_t i = 0; i < FLIGHTS; i++) {
        const struct flight *f = &flights[i];
        const struct pose middle = pose_at(f, 0.5);
        draw_floor(f, TRC_PASS_MIST, SAMPLES, mist);
        for (uint32_t p = 0; p < FRAME; p++) {
            double want = 0.0;
            for (int k = 0; k < SAMPLES; k++) {
                const struct pose pose = pose_at(f, (k + 0.5) / SAMPLES);
                double point[2];
                floor_point(f, &pose, p % SIDE, p / SIDE, point);
                const double across = f->type == TRC_CAMERA_ORTHOGRAPHIC
                                          ? 0.0
                                          : hypot(point[0] - middle.at[0], point[1] - middle.at[1]);
                const double depth =
                    (hypot(across, middle.at[2]) - (double)mist_start) / (double)mist_depth;
                want += pow(fmin(fmax(depth, 0.0), 1.0), (double)mist_falloff) / SAMPLES;
            }
            worst = fmax(worst, fabs((double)mist[p] - want));
        }
    }
    /* One time in each of SAMPLES strata, evenly spread there, and mist changes by less than 1 over
     * the shutter: a standard error below 1 / (SAMPLES sqrt(12 SAMPLES)), of which 5. */
    printf("  mist off by at most %.5f\n", worst);
    assert_true(worst <= 5.0 / (SAMPLES * sqrt(12.0 * SAMPLES)));
}

/* The Vector pass tells where the camera sees a point of the floor at the shutter's start, middle
 * and end, in pixels. */
static void vectors_follow_camera_and_zoom(void **state) {
    (void)state;
    static float vectors[4 * FRAME];
    double worst = 0.0, farthest = 0.0;
    for (size_t i = 0; i < FLIGHTS; i++) {
        const struct flight *f = &flights[i];
        /* Of one sample, whose place on the floor the Position pass has. */
        const trc_scene scene = scene_create();
        add_square(scene, 0.0f, 0.0f, 0.0f, 50.0f,
                   add_material(scene, TRC_NODE_EMISSION, white, 1.0f));
        set_flight(scene, f, NULL, 0);
        trc_render_desc desc = render_desc(SIDE, 1);
        desc.passes = UINT64_C(1) << TRC_PASS_VECTOR | UINT64_C(1) << TRC_PASS_POSITION;
        static float at[3 * FRAME];
        trc_render id = 0;
        assert_ok(trc_render_start(scene, &desc, &id));
        assert_ok(trc_render_wait(id, -1.0));
        assert_ok(trc_render_read(id, TRC_PASS_VECTOR, vectors, 4 * FRAME));
        assert_ok(trc_render_read(id, TRC_PASS_POSITION, at, 3 * FRAME));
        assert_ok(trc_render_destroy(id));
        assert_ok(trc_scene_destroy(scene));
        for (uint32_t p = 0; p < FRAME; p++) {
            double raster[3][2];
            for (int k = 0; k < 3; k++) {
                const struct pose pose = pose_at(f, 0.5 * k);
                const double scale = f->type == TRC_CAMERA_ORTHOGRAPHIC ? 1.0 : pose.at[2];
                for (int c = 0; c < 2; c++)
                    raster[k][c] = SIDE *
                                   (((double)at[3 * p + (uint32_t)c] - pose.at[c]) / scale -
                                    pose.window[2 * c]) /
                                   (pose.window[2 * c + 1] - pose.window[2 * c]);
            }
            for (int c = 0; c < 2; c++) {
                const double before = raster[0][c] - raster[1][c];
                const double after = raster[1][c] - raster[2][c];
                worst = fmax(worst, fabs((double)vectors[4 * p + (uint32_t)c] - before));
                worst = fmax(worst, fabs((double)vectors[4 * p + 2 + (uint32_t)c] - after));
                farthest = fmax(farthest, fmax(fabs(before), fabs(after)));
            }
        }
    }
    printf("  vectors off by at most %.6f pixels, up to %.1f long\n", worst, farthest);
    /* Single precision: differences of numbers of some tens of pixels, through quotients. */
    assert_true(worst <= 1e-4);
    assert_true(farthest > 5.0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(blades_turn_with_the_lens),      cmocka_unit_test(zoom_and_motion_blur),
        cmocka_unit_test(depth_is_of_the_middle),         cmocka_unit_test(mist_is_of_the_middle),
        cmocka_unit_test(vectors_follow_camera_and_zoom),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("cameras", tests, NULL, NULL);
}
