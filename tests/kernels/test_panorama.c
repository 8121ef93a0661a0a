/* Panoramic cameras and spherical stereo: where each pixel looks, from where and when, beside the
 * projections in long arithmetic. */
#include "figures.h"
#include "picture_test.h"

#include <float.h>

typedef long double real;

#define PI_REAL 3.14159265358979323846264338327950288L

enum { WIDTH = 32, HEIGHT = 16, FRAME = WIDTH * HEIGHT };

/* ---- the projections as they are written in books ---- */

/* The angle at which a fisheye shows what is r from the middle; false: nothing. */
static bool fisheye_angle(const trc_camera_desc *c, real r, real *angle) {
    const real whole = c->fisheye_angle;
    if (c->type == TRC_CAMERA_FISHEYE_EQUIDISTANT) {
        *angle = r * whole / 2;
        return r <= 1;
    }
    if (c->type == TRC_CAMERA_FISHEYE_EQUISOLID) {
        const real part = r / (2 * (real)c->fisheye_lens);
        *angle = 2 * asinl(fminl(part, 1));
        return part <= sinl(whole / 4);
    }
    const float *k = c->fisheye_polynomial;
    *angle =
        -((real)k[0] + r * ((real)k[1] + r * ((real)k[2] + r * ((real)k[3] + r * (real)k[4]))));
    return fabsl(*angle) <= whole / 2;
}

/* Where the camera looks at (u, v) of the panorama, in its own axes: right, up, back. */
static bool look(const trc_camera_desc *c, real u, real v, real d[3]) {
    if (c->type == TRC_CAMERA_EQUIRECTANGULAR || c->type == TRC_CAMERA_CYLINDRICAL) {
        const real longitude = c->longitude_min + u * ((real)c->longitude_max - c->longitude_min);
        const real latitude = c->type == TRC_CAMERA_CYLINDRICAL
                                  ? atanl(c->height_min + v * ((real)c->height_max - c->height_min))
                                  : c->latitude_min + v * ((real)c->latitude_max - c->latitude_min);
        d[0] = cosl(latitude) * sinl(longitude);
        d[1] = sinl(latitude);
        d[2] = -cosl(latitude) * cosl(longitude);
        return true;
    }
    real x = 2 * u - 1, y = 2 * v - 1;
    if (c->type == TRC_CAMERA_CUBE_MAP_FACE) {
        d[0] = tanl(x * PI_REAL / 4), d[1] = tanl(y * PI_REAL / 4), d[2] = -1;
        return true;
    }
    if (c->type == TRC_CAMERA_MIRROR_BALL) { /* a view along -Z, reflected by a ball */
        const real n[3] = {x, y, sqrtl(fmaxl(1 - x * x - y * y, 0))};
        for (int k = 0; k < 3; k++)
            d[k] = 2 * n[2] * n[k] - (k == 2);
        d[2] = -d[2]; /* the ball is behind the camera, as in Cycles */
        return x * x + y * y <= 1;
    }
    if (c->type != TRC_CAMERA_FISHEYE_EQUIDISTANT)
        x *= (real)c->sensor_width / 2, y *= (real)c->sensor_height / 2;
    const real r = hypotl(x, y);
    real angle;
    const bool seen = fisheye_angle(c, r, &angle);
    d[0] = sinl(angle) * x / r, d[1] = sinl(angle) * y / r, d[2] = -cosl(angle);
    return seen;
}

/* ---- cameras ---- */

static const float polynomial[5] = {-1e-5f, -0.06f, -3e-4f, 3e-6f, -1e-7f};
static const float whole_window[4] = {0, 1, 0, 1};
static const float part_window[4] = {0.3f, 0.75f, -0.1f, 0.8f};

/* Turned and moved: columns right, up, back. */
static const float posed[12] = {0.36f, 0.48f,  -0.8f, 0.3f,  -0.8f, 0.6f,
                                0.0f,  -0.45f, 0.48f, 0.64f, 0.6f,  0.2f};

static trc_camera_desc panorama_desc(uint32_t type) {
    trc_camera_desc c = trc_camera_desc_default();
    c.type = type;
    c.transforms = posed;
    c.windows = whole_window;
    c.clip_start = 0.01f;
    memcpy(c.fisheye_polynomial, polynomial, sizeof polynomial);
    return c;
}

enum { CAMERAS = 11 };

static trc_camera_desc camera_of(int number) {
    static const uint32_t types[CAMERAS] = {
        TRC_CAMERA_EQUIRECTANGULAR,     TRC_CAMERA_CUBE_MAP_FACE,
        TRC_CAMERA_MIRROR_BALL,         TRC_CAMERA_FISHEYE_EQUIDISTANT,
        TRC_CAMERA_FISHEYE_EQUISOLID,   TRC_CAMERA_FISHEYE_POLYNOMIAL,
        TRC_CAMERA_CYLINDRICAL,         TRC_CAMERA_EQUIRECTANGULAR,
        TRC_CAMERA_FISHEYE_EQUIDISTANT, TRC_CAMERA_CYLINDRICAL,
        TRC_CAMERA_FISHEYE_EQUISOLID};
    trc_camera_desc c = panorama_desc(types[number]);
    if (number == 7) {
        c.longitude_min = -1.2f, c.longitude_max = 2.5f;
        c.latitude_min = -0.3f, c.latitude_max = 1.1f;
    } else if (number == 8) {
        c.fisheye_angle = 6.0f;
    } else if (number == 9) {
        c.longitude_min = -0.5f, c.longitude_max = 1.5f;
        c.height_min = -0.2f, c.height_max = 3.0f;
    } else if (number == 10) {
        c.windows = part_window;
        c.fisheye_lens = 8.0f;
        c.fisheye_angle = 4.0f;
    }
    return c;
}

/* ---- the room ---- */

/* A cube around the camera, whose walls are where no pixel's centre looks along an edge. */
static const real room_middle[3] = {0.5L, -0.25L, 1}, room_half = 4;

static void add_room(trc_scene scene) {
    static const float transform[12] = {4, 0, 0, 0.5f, 0, 4, 0, -0.25f, 0, 0, 4, 1};
    const trc_mesh_desc mesh = default_mesh_desc();
    fixture_mesh_at(scene, &mesh, transform, fixture_material(scene, TRC_NODE_EMISSION, 1.0f), 0);
}

static void meet_room(const real o[3], const real d[3], real p[3]) {
    real t = HUGE_VALL;
    for (int k = 0; k < 3; k++)
        if (d[k] != 0)
            t = fminl(t, (room_middle[k] + copysignl(room_half, d[k]) - o[k]) / d[k]);
    for (int k = 0; k < 3; k++)
        p[k] = o[k] + t * d[k];
}

static trc_render_desc panorama_render(uint32_t samples) {
    trc_render_desc desc = default_render_desc(WIDTH, HEIGHT, samples);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1e-6f; /* the middle of each pixel */
    return desc;
}

static void unit(real d[3]) {
    const real length = sqrtl(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int k = 0; k < 3; k++)
        d[k] /= length;
}

static void turn(const float m[12], const real v[3], real out[3]) {
    for (int k = 0; k < 3; k++)
        out[k] = m[4 * k] * v[0] + m[4 * k + 1] * v[1] + m[4 * k + 2] * v[2];
}

/* From the camera to its eye, all in one space whose up axis is given. */
static void use_eye(const trc_camera_desc *c, const real up[3], real o[3], real d[3]) {
    unit(d);
    real side[3], offset = c->eye_offset;
    for (int k = 0; k < 3; k++)
        side[k] = d[(k + 1) % 3] * up[(k + 2) % 3] - d[(k + 2) % 3] * up[(k + 1) % 3];
    unit(side);
    const real altitude = fabsl(asinl(d[0] * up[0] + d[1] * up[1] + d[2] * up[2]));
    const real from = c->pole_merge_from, to = c->pole_merge_to;
    if (to > 0 && altitude > from)
        offset *= altitude < to ? cosl((altitude - from) / (to - from) * PI_REAL / 2) : 0;
    for (int k = 0; k < 3; k++) {
        o[k] += offset * side[k];
        if (isfinite(c->convergence_distance))
            d[k] = c->convergence_distance * d[k] - offset * side[k];
    }
}

/* What a pixel's centre shows of the room, false where it shows nothing. */
static bool expect(const trc_camera_desc *c, uint32_t pixel, real p[3]) {
    static const real up[3] = {0, 1, 0}, world_up[3] = {0, 0, 1};
    const float *w = c->windows, *m = c->transforms;
    const real at[2] = {(pixel % WIDTH + 0.5L) / WIDTH, (pixel / WIDTH + 0.5L) / HEIGHT};
    const real u = w[0] + at[0] * ((real)w[1] - w[0]), v = w[2] + at[1] * ((real)w[3] - w[2]);
    real o[3] = {0, 0, 0}, d[3] = {u, v, -1}, origin[3], way[3];
    const bool is_plane = c->type == TRC_CAMERA_PERSPECTIVE;
    if (!is_plane && !look(c, u, v, d))
        return false;
    if (!is_plane && c->eye_offset != 0.0f)
        use_eye(c, up, o, d);
    turn(m, o, origin);
    turn(m, d, way);
    for (int k = 0; k < 3; k++)
        origin[k] += m[4 * k + 3];
    if (is_plane && c->eye_offset != 0.0f)
        use_eye(c, world_up, origin, way);
    meet_room(origin, way, p);
    return true;
}

static void draw(const trc_camera_desc *camera, const trc_render_desc *desc, uint32_t pass,
                 float *pixels) {
    const trc_scene scene = scene_create();
    add_room(scene);
    set_camera(scene, camera);
    fixture_draw(scene, desc, pass, pixels, (uint64_t)trc_pass_channels(pass) * FRAME);
    assert_ok(trc_scene_destroy(scene));
}

/* The largest error of the places that a camera shows, and how many pixels show some. */
static real compare_places(const trc_camera_desc *camera, uint32_t *seen_out) {
    static float at[3 * FRAME];
    trc_render_desc desc = panorama_render(1);
    desc.passes = UINT64_C(1) << TRC_PASS_POSITION;
    draw(camera, &desc, TRC_PASS_POSITION, at);
    real worst = 0;
    *seen_out = 0;
    for (uint32_t i = 0; i < FRAME; i++) {
        real p[3] = {0, 0, 0};
        *seen_out += expect(camera, i, p);
        for (int k = 0; k < 3; k++)
            worst = fmaxl(worst, fabsl((real)at[3 * i + (uint32_t)k] - p[k]));
    }
    return worst;
}

/* Places are up to 9 m away: an error of a few ulp of the direction and of the place. */
#define ALLOWED 6e-6L

static void directions(void **state) {
    (void)state;
    real worst = 0;
    for (int i = 0; i < CAMERAS; i++) {
        const trc_camera_desc camera = camera_of(i);
        uint32_t seen;
        const real off = compare_places(&camera, &seen);
        printf("  camera %d, type %u: %u pixels, off by %.1Le m\n", i, camera.type, seen, off);
        assert_true(seen > FRAME / 8);
        /* Near the rim of the ball an ulp of the place is many of the direction. */
        assert_true(off <= (camera.type == TRC_CAMERA_MIRROR_BALL ? 10 : 1) * ALLOWED);
        worst = fmaxl(worst, off);
    }
    print_figure("panoramas", "places off by at most %.1Le m of 9", worst);
}

static void stereo(void **state) {
    (void)state;
    static const struct {
        float offset, convergence, from, to;
    } eyes[] = {{0.2f, INFINITY, 0, 0},
                {-0.2f, 1.5f, 0, 0},
                {0.3f, 2.0f, 0.4f, 0.9f},
                {-0.1f, INFINITY, 0.5f, 0.5f}};
    static const float window[4] = {-1.1f, 0.9f, -0.6f, 0.8f};
    for (int i = 0; i <= CAMERAS; i++)
        for (size_t e = 0; e < sizeof eyes / sizeof *eyes; e++) {
            trc_camera_desc camera = camera_of(i < CAMERAS ? i : 0);
            if (i == CAMERAS)
                camera.type = TRC_CAMERA_PERSPECTIVE, camera.windows = window;
            if (camera.type == TRC_CAMERA_MIRROR_BALL)
                continue; /* Cycles exchanges its eyes */
            camera.eye_offset = eyes[e].offset;
            camera.convergence_distance = eyes[e].convergence;
            camera.pole_merge_from = eyes[e].from;
            camera.pole_merge_to = eyes[e].to;
            uint32_t seen;
            const real off = compare_places(&camera, &seen);
            if (!(off <= ALLOWED))
                fail_msg("camera %d, eye %zu: off by %.1Le m", i, e, off);
        }
}

/* Nothing of the room nor of the world is outside of the circle, and nothing shines through. */
static void outside_is_black(void **state) {
    (void)state;
    static float pixels[4 * FRAME];
    trc_render_desc desc = panorama_render(3);
    desc.film_transparent = 1;
    for (int i = 0; i < CAMERAS; i++) {
        const trc_camera_desc camera = camera_of(i);
        const trc_scene scene = scene_create();
        trc_world_desc world = default_world_desc(
            add_material(scene, TRC_NODE_BACKGROUND, (const float[3]){1, 1, 1}, 1.0f));
        assert_ok(trc_scene_set_world(scene, &world));
        add_room(scene);
        set_camera(scene, &camera);
        render(scene, &desc, pixels);
        assert_ok(trc_scene_destroy(scene));
        for (uint32_t p = 0; p < FRAME; p++) {
            real at[3];
            const float want = expect(&camera, p, at) ? 1.0f : 0.0f;
            for (uint32_t k = 0; k < 4; k++)
                if (pixels[4 * p + k] != (k < 3 ? want : 1.0f))
                    fail_msg("camera %d, pixel %u: %g", i, p, (double)pixels[4 * p + k]);
        }
    }
}

/* Shaders see the place of each pixel in the whole panorama: the way back from directions. */
static void window_coordinates(void **state) {
    (void)state;
    enum { WINDOW = 5 };
    static float pixels[4 * FRAME];
    const trc_render_desc desc = panorama_render(1);
    double worst = 0.0;
    for (int i = 0; i < CAMERAS; i++) {
        const trc_camera_desc camera = camera_of(i);
        const trc_scene scene = scene_create();
        const trc_node_input inputs[] = {{.node = 0, .output = WINDOW},
                                         {.node = -1, .value = {1.0f}}};
        const trc_node nodes[] = {{.type = TRC_NODE_TEXTURE_COORDINATE},
                                  {.type = TRC_NODE_EMISSION, .input_count = 2}};
        const trc_material_desc material = {.struct_size = sizeof material,
                                            .node_count = 2,
                                            .nodes = nodes,
                                            .inputs = inputs,
                                            .input_count = 2,
                                            .surface = 1};
        trc_id id = 0;
        assert_ok(trc_material_create(scene, &material, &id));
        static const float transform[12] = {4, 0, 0, 0.5f, 0, 4, 0, -0.25f, 0, 0, 4, 1};
        const trc_mesh_desc mesh = default_mesh_desc();
        fixture_mesh_at(scene, &mesh, transform, id, 0);
        set_camera(scene, &camera);
        render(scene, &desc, pixels);
        assert_ok(trc_scene_destroy(scene));
        for (uint32_t p = 0; p < FRAME; p++) {
            real ignored[3];
            const float *w = camera.windows;
            const double at[2] = {(p % WIDTH + 0.5) / WIDTH, (p / WIDTH + 0.5) / HEIGHT};
            for (int k = 0; k < 2 && expect(&camera, p, ignored); k++) {
                const double want = w[2 * k] + at[k] * ((double)w[2 * k + 1] - w[2 * k]);
                worst = fmax(worst, fabs((double)pixels[4 * p + (uint32_t)k] - want));
            }
        }
        printf("  camera %d: window coordinates off by at most %.1e\n", i, worst);
    }
    assert_true(worst <= 2e-6);
}

/* Packets whose rays look all over the sphere meet what single rays meet. */
static void packets_all_around(void **state) {
    (void)state;
    static float packets[FRAME], single[FRAME];
    for (int i = 0; i < CAMERAS; i++)
        for (int lens = 0; lens < 2; lens++) {
            trc_camera_desc camera = camera_of(i);
            camera.aperture_radius = lens ? 0.1f : 0.0f;
            camera.focus_distance = 2.0f;
            for (int alone = 0; alone < 2; alone++) {
                const trc_scene scene = scene_create();
                add_room(scene);
                const trc_mesh_desc mesh = default_mesh_desc();
                for (int n = 0; n < 60; n++) { /* small cubes all around */
                    const float a = 2.4f * (float)n, z = 2.0f * ((float)n + 0.5f) / 60.0f - 1.0f;
                    const float s = 0.12f, r = sqrtf(1.0f - z * z) * 2.0f;
                    const float transform[12] = {s, 0, 0, 0.3f + r * cosf(a),
                                                 0, s, 0, -0.45f + r * sinf(a),
                                                 0, 0, s, 0.2f + 2.0f * z};
                    fixture_mesh_at(scene, &mesh, transform,
                                    fixture_material(scene, TRC_NODE_EMISSION, 1.0f), 0);
                }
                set_camera(scene, &camera);
                trc_render_desc desc = panorama_render(4);
                desc.passes = UINT64_C(1) << TRC_PASS_DEPTH;
                desc.assembly = alone ? TRC_ASSEMBLY_NONE : TRC_ASSEMBLY_AUTO;
                fixture_draw(scene, &desc, TRC_PASS_DEPTH, alone ? single : packets, FRAME);
                assert_ok(trc_scene_destroy(scene));
            }
            assert_memory_equal(packets, single, sizeof packets);
        }
}

/* ---- the lens ---- */

/* In focus, all around, a lens shows what a pinhole shows; out of focus a spot has the moment of
 * the circle of confusion. */
static void lens_faces_every_direction(void **state) {
    (void)state;
    enum { SAMPLES = 256 };
    static const float radius = 0.05f, focus = 3.0f, distance = 1.5f;
    /* A small square seen at longitude .9, latitude .3, out of focus. */
    const double to[3] = {cos(0.3) * sin(0.9), sin(0.3), -cos(0.3) * cos(0.9)};
    const double right[3] = {cos(0.9), 0, sin(0.9)};
    const double up[3] = {-sin(0.3) * sin(0.9), cos(0.3), sin(0.3) * cos(0.9)};
    float corners[12];
    const double half = 2e-3;
    for (int c = 0; c < 4; c++)
        for (int k = 0; k < 3; k++)
            corners[3 * c + k] =
                (float)((double)distance * to[k] + half * (c == 1 || c == 2 ? 1 : -1) * right[k] +
                        half * (c >= 2 ? 1 : -1) * up[k]);
    const trc_scene scene = scene_create();
    fixture_quad(scene, corners, fixture_material(scene, TRC_NODE_EMISSION, 1.0f));
    trc_camera_desc camera = panorama_desc(TRC_CAMERA_EQUIRECTANGULAR);
    camera.transforms = identity_transform;
    camera.longitude_min = 0.85f, camera.longitude_max = 0.95f;
    camera.latitude_min = 0.25f, camera.latitude_max = 0.35f;
    camera.aperture_radius = radius;
    camera.focus_distance = focus;
    set_camera(scene, &camera);
    enum { SIDE = 64 };
    static float pixels[4 * SIDE * SIDE];
    trc_render_desc desc = default_render_desc(SIDE, SIDE, SAMPLES);
    desc.filter = TRC_FILTER_BOX;
    desc.filter_width = 1.0f;
    render(scene, &desc, pixels);
    assert_ok(trc_scene_destroy(scene));
    double sum = 0.0, square = 0.0;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        const double x = ((i % SIDE + 0.5) / SIDE - 0.5) * 0.1 * cos(0.3);
        const double y = ((double)(i / SIDE + 0.5) / SIDE - 0.5) * 0.1;
        sum += (double)pixels[4 * i];
        square += (double)pixels[4 * i] * (x * x + y * y);
    }
    /* A disk of radius a has the mean square a^2 / 2. */
    const double a = (double)radius * (1.0 / (double)distance - 1.0 / (double)focus);
    const double ratio = square / sum / (0.5 * a * a);
    printf("  circle of confusion: mean square %.4f of that of the disk, %.0f samples\n", ratio,
           sum * SAMPLES);
    /* A disk's r^2 deviates by 1/sqrt(3) of its mean: five standard errors, and 1 % for the
     * square, the pixels and the map's curvature. */
    assert_true(fabs(ratio - 1.0) <= 0.01 + 5.0 / sqrt(3.0 * sum * SAMPLES));
}

/* ---- passes ---- */

/* Depth and mist are of distances, and the Vector pass of where the panorama shows a point at the
 * ends and in the middle of the shutter. */
static void passes_of_panoramas(void **state) {
    (void)state;
    static float depth[FRAME], mist[FRAME], vectors[4 * FRAME], at[3 * FRAME];
    static const float moving[24] = {1, 0, 0, 0.2f, 0, 1, 0, 0.1f, 0, 0, 1, 0.3f,
                                     1, 0, 0, 0.5f, 0, 1, 0, -.2f, 0, 0, 1, 0.4f};
    double worst = 0.0;
    for (int i = 0; i < CAMERAS; i++) {
        trc_camera_desc camera = camera_of(i);
        camera.transforms = moving;
        camera.key_count = 2;
        camera.shutter_time = 1.0f;
        const trc_scene scene = scene_create();
        add_room(scene);
        set_camera(scene, &camera);
        trc_render_desc desc = panorama_render(1);
        desc.passes = UINT64_C(1) << TRC_PASS_DEPTH | UINT64_C(1) << TRC_PASS_MIST |
                      UINT64_C(1) << TRC_PASS_VECTOR | UINT64_C(1) << TRC_PASS_POSITION;
        desc.mist_start = 1.0f;
        desc.mist_depth = 9.0f;
        trc_render id = 0;
        assert_ok(trc_render_start(scene, &desc, &id));
        assert_ok(trc_render_wait(id, -1.0));
        assert_ok(trc_render_read(id, TRC_PASS_DEPTH, depth, FRAME));
        assert_ok(trc_render_read(id, TRC_PASS_MIST, mist, FRAME));
        assert_ok(trc_render_read(id, TRC_PASS_VECTOR, vectors, 4 * FRAME));
        assert_ok(trc_render_read(id, TRC_PASS_POSITION, at, 3 * FRAME));
        assert_ok(trc_render_destroy(id));
        assert_ok(trc_scene_destroy(scene));
        for (uint32_t p = 0; p < FRAME; p++) {
            real ignored[3];
            if (!expect(&camera, p, ignored))
                continue;
            double length = 0.0;
            for (uint32_t k = 0; k < 3; k++) {
                const double middle = 0.5 * ((double)moving[4 * k + 3] + moving[12 + 4 * k + 3]);
                length += pow((double)at[3 * p + k] - middle, 2.0);
            }
            length = sqrt(length);
            assert_true(fabs((double)depth[p] - length) <= 4e-6);
            assert_true(fabs((double)mist[p] - fmin(fmax((length - 1.0) / 9.0, 0), 1)) <= 2e-6);
        }
        if (camera.type != TRC_CAMERA_EQUIRECTANGULAR)
            continue;
        for (uint32_t p = 0; p < FRAME; p++) {
            double place[3][2];
            bool wraps = false;
            for (int moment = 0; moment < 3; moment++) {
                double d[3];
                for (uint32_t k = 0; k < 3; k++)
                    d[k] =
                        (double)at[3 * p + k] - ((double)moving[4 * k + 3] * (1.0 - 0.5 * moment) +
                                                 (double)moving[12 + 4 * k + 3] * 0.5 * moment);
                const double longitude = atan2(d[0], -d[2]);
                const double latitude = atan2(d[1], hypot(d[0], d[2]));
                wraps |= fabs(longitude) > 2.8;
                place[moment][0] = (longitude - (double)camera.longitude_min) /
                                   ((double)camera.longitude_max - camera.longitude_min) * WIDTH;
                place[moment][1] = (latitude - (double)camera.latitude_min) /
                                   ((double)camera.latitude_max - camera.latitude_min) * HEIGHT;
            }
            for (int k = 0; k < 4 && !wraps; k++) {
                const double want = place[k / 2][k % 2] - place[k / 2 + 1][k % 2];
                worst = fmax(worst, fabs((double)vectors[4 * p + (uint32_t)k] - want));
            }
        }
    }
    printf("  vectors off by at most %.1e pixels\n", worst);
    assert_true(worst <= 1e-4);
}

/* ---- the rolling shutter ---- */

/* A floor slides under a camera; each row sees the shining half for the part of its own exposure
 * in which it has come by. */
static void rows_are_exposed_in_turn(void **state) {
    (void)state;
    enum { SAMPLES = 128 };
    static float pixels[4 * FRAME];
    static const float keys[24] = {1, 0, 0, -1, 0, 1, 0, 0, 0, 0, 1, 5,
                                   1, 0, 0, 1,  0, 1, 0, 0, 0, 0, 1, 5};
    static const float window[4] = {-1, 1, -0.5f, 0.5f}, delays[] = {0.0f, 0.4f, 0.9f, 1.0f};
    for (size_t i = 0; i < sizeof delays / sizeof *delays; i++) {
        const trc_scene scene = scene_create();
        add_square(scene, 50.0f, 0.0f, 0.0f, 50.0f,
                   fixture_material(scene, TRC_NODE_EMISSION, 1.0f));
        trc_camera_desc camera = trc_camera_desc_default();
        camera.type = TRC_CAMERA_ORTHOGRAPHIC;
        camera.key_count = 2;
        camera.transforms = keys;
        camera.windows = window;
        camera.shutter_time = 0.5f;
        camera.row_delay = delays[i];
        set_camera(scene, &camera);
        const trc_render_desc desc = panorama_render(SAMPLES);
        render(scene, &desc, pixels);
        assert_ok(trc_scene_destroy(scene));
        double worst = 0.0;
        for (uint32_t p = 0; p < FRAME; p++) {
            const double x = 2.0 * (p % WIDTH + 0.5) / WIDTH - 1.0, delay = (double)delays[i];
            /* The row's exposure: the top row's begins with the shutter. */
            const double begin = (1.0 - (double)(p / WIDTH) / HEIGHT) * delay;
            const double comes = 0.5 * (1.0 - x); /* when x + 2 time - 1 is 0 */
            const double share =
                delay < 1.0 ? fmin(fmax((begin + 1.0 - delay - comes) / (1.0 - delay), 0), 1)
                            : begin > comes;
            /* With no exposure of its own a row sees one moment, here the very one. */
            if (delay == 1.0 && fabs(begin - comes) < 1e-6)
                continue;
            worst = fmax(worst, fabs((double)pixels[4 * p] - share));
        }
        printf("  delay %.1f: off by at most %.4f\n", (double)delays[i], worst);
        /* Times are stratified: one of SAMPLES strata is cut. */
        assert_true(worst <= (delays[i] < 1.0f ? 1.0 / SAMPLES : 0.0));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(directions),          cmocka_unit_test(stereo),
        cmocka_unit_test(outside_is_black),    cmocka_unit_test(window_coordinates),
        cmocka_unit_test(packets_all_around),  cmocka_unit_test(lens_faces_every_direction),
        cmocka_unit_test(passes_of_panoramas), cmocka_unit_test(rows_are_exposed_in_turn),
    };
    if (!query_test_isa())
        return QUERY_TEST_SKIPPED;
    return cmocka_run_group_tests_name("panoramas", tests, NULL, NULL);
}
