#include "stages.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265f

const char *const stage_names[] = {"conference", "pool_hall", "character", "tiny", ""};

/* ---- solids: spheres bent into rounded boxes and rods ---- */

static float signed_power(float x, float exponent) {
    return copysignf(powf(fabsf(x), exponent), x);
}

/* A superellipsoid in the box [-1, 1]^3: exponents 1 give a sphere; a small profile flattens top
 * and bottom, a small outline squares the plan. 2 * slices * (stacks - 1) triangles. */
static void add_superellipsoid(struct mesh *mesh, float profile, float outline, uint32_t stacks,
                               uint32_t slices, const float transform[12]) {
    static const float origin[3] = {0, 0, 0};
    const uint32_t first = mesh->vertex_count;
    mesh_add_uv_sphere(mesh, origin, 1.0f, stacks, slices);
    for (uint32_t i = first; i < mesh->vertex_count; i++) {
        float *p = mesh->positions + 3 * (size_t)i;
        const float r = hypotf(p[0], p[1]), wide = powf(r, profile);
        for (int k = 0; k < 2; k++)
            p[k] = r > 0.0f ? wide * signed_power(p[k] / r, outline) : 0.0f;
        p[2] = signed_power(p[2], profile);
    }
    mesh_transform(mesh, first, transform);
}

static void add_block(struct mesh *mesh, float x, float y, float z, float half_x, float half_y,
                      float half_z, uint32_t stacks, uint32_t slices) {
    const float m[12] = {half_x, 0, 0, x, 0, half_y, 0, y, 0, 0, half_z, z};
    add_superellipsoid(mesh, 0.3f, 0.3f, stacks, slices, m);
}

/* A solid of revolution about the line from a to b. */
static void add_rod(struct mesh *mesh, const float a[3], const float b[3], float radius,
                    float profile, uint32_t stacks, uint32_t slices) {
    float z[3], x[3], y[3], m[12];
    for (int k = 0; k < 3; k++)
        z[k] = 0.5f * (b[k] - a[k]);
    const float half = sqrtf(z[0] * z[0] + z[1] * z[1] + z[2] * z[2]);
    const int thin = fabsf(z[0]) < fabsf(z[1]) ? 0 : 1; /* an axis the rod does not lie along */
    const float helper[3] = {thin == 0 ? 1.0f : 0.0f, thin == 1 ? 1.0f : 0.0f, 0.0f};
    float length = 0.0f;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        x[k] = helper[i] * z[j] - helper[j] * z[i];
        length += x[k] * x[k];
    }
    for (int k = 0; k < 3; k++)
        x[k] *= radius / sqrtf(length);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        y[k] = (z[i] * x[j] - z[j] * x[i]) / half;
    }
    for (int row = 0; row < 3; row++) {
        const float values[4] = {x[row], y[row], z[row], 0.5f * (a[row] + b[row])};
        memcpy(m + 4 * row, values, sizeof values);
    }
    add_superellipsoid(mesh, profile, 1.0f, stacks, slices, m);
}

static void add_pole(struct mesh *mesh, float x, float y, float z0, float z1, float radius,
                     uint32_t slices) {
    const float a[3] = {x, y, z0}, b[3] = {x, y, z1};
    add_rod(mesh, a, b, radius, 0.2f, 8, slices);
}

static void add_ball(struct mesh *mesh, float x, float y, float z, float radius, uint32_t stacks,
                     uint32_t slices) {
    const float center[3] = {x, y, z};
    mesh_add_uv_sphere(mesh, center, radius, stacks, slices);
}

static void add_box(struct mesh *mesh, float x0, float y0, float z0, float x1, float y1, float z1) {
    const float lower[3] = {x0, y0, z0}, upper[3] = {x1, y1, z1};
    mesh_add_box(mesh, lower, upper);
}

/* Floor, ceiling and walls of a room around the z axis, seen from within. */
static void add_room(struct mesh *mesh, float half_x, float half_y, float height, uint32_t cells) {
    const float origins[6][3] = {{-half_x, -half_y, 0}, {-half_x, -half_y, height},
                                 {-half_x, -half_y, 0}, {-half_x, half_y, 0},
                                 {-half_x, -half_y, 0}, {half_x, -half_y, 0}};
    const float x[3] = {2 * half_x, 0, 0}, y[3] = {0, 2 * half_y, 0}, z[3] = {0, 0, height};
    const float *const edges[6][2] = {{x, y}, {y, x}, {z, x}, {x, z}, {y, z}, {z, y}};
    for (int i = 0; i < 6; i++)
        mesh_add_grid(mesh, origins[i], edges[i][0], edges[i][1], cells, cells);
}

/* Turns what follows first by an angle about z and moves it. */
static void place(struct mesh *mesh, uint32_t first, float angle, float x, float y, float z) {
    const float c = cosf(angle), s = sinf(angle);
    const float m[12] = {c, -s, 0, x, s, c, 0, y, 0, 0, 1, z};
    mesh_transform(mesh, first, m);
}

/* ---- conference room ---- */

/* At the origin, facing +x. */
static void add_office_chair(struct mesh *mesh) {
    add_block(mesh, 0, 0, 0.46f, 0.25f, 0.25f, 0.05f, 21, 48);
    add_block(mesh, -0.25f, 0, 0.85f, 0.04f, 0.23f, 0.28f, 20, 48);
    add_pole(mesh, 0, 0, 0.12f, 0.44f, 0.03f, 24);
    for (int side = -1; side <= 1; side += 2) {
        const float y = 0.29f * (float)side;
        const float back[3] = {-0.2f, y, 0.68f}, front[3] = {0.2f, y, 0.68f};
        add_rod(mesh, back, front, 0.025f, 0.3f, 12, 16);
        add_pole(mesh, 0.1f, y, 0.44f, 0.67f, 0.015f, 16);
    }
    for (int leg = 0; leg < 5; leg++) {
        const float angle = 0.4f * PI * (float)leg, c = 0.3f * cosf(angle), s = 0.3f * sinf(angle);
        const float middle[3] = {0, 0, 0.12f}, end[3] = {c, s, 0.09f};
        add_rod(mesh, middle, end, 0.025f, 0.3f, 10, 16);
        add_ball(mesh, c, s, 0.04f, 0.04f, 12, 16);
    }
}

static void make_conference(struct stage *stage) {
    struct mesh *m = &stage->mesh;
    add_room(m, 7.0f, 4.5f, 3.2f, 4);
    add_block(m, 0, 0, 0.74f, 4.2f, 0.9f, 0.03f, 13, 96);
    for (int side = -1; side <= 1; side += 2)
        add_block(m, 2.8f * (float)side, 0, 0.36f, 0.3f, 0.4f, 0.36f, 13, 48);
    for (int i = 0; i < 30; i++) {
        const uint32_t first = m->vertex_count;
        const float x = 0.62f * ((float)(i % 15) - 7.0f), side = i < 15 ? -1.0f : 1.0f;
        add_office_chair(m);
        place(m, first, -0.5f * PI * side + 0.3f * sinf(7.0f * (float)i), x, 1.35f * side, 0);
    }
    /* Blinds before two walls, lamps under the ceiling, panels behind the speaker. */
    for (int i = 0; i < 120; i++) {
        const float z = 0.8f + 0.018f * (float)i;
        for (int w = 0; w < 4; w++) {
            const float x = 3.2f * ((float)w - 1.5f);
            add_box(m, x - 1.4f, 4.40f, z, x + 1.4f, 4.43f, z + 0.004f);
        }
    }
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 5; j++) {
            const float x = 1.6f * ((float)i - 3.5f), y = 1.6f * ((float)j - 2.0f);
            add_box(m, x - 0.3f, y - 0.3f, 3.1f, x + 0.3f, y + 0.3f, 3.15f);
        }
    for (int i = 0; i < 5; i++)
        add_block(m, -6.9f, 1.7f * ((float)i - 2.0f), 1.5f, 0.05f, 0.75f, 1.2f, 25, 48);
    /* Cups and papers on the table. */
    for (int i = 0; i < 15; i++) {
        const float x = 0.56f * ((float)i - 7.0f), y = i % 2 ? 0.5f : -0.5f;
        add_pole(m, x, y, 0.77f, 0.87f, 0.04f, 32);
        add_box(m, x - 0.12f, -0.6f * y - 0.1f, 0.771f, x + 0.1f, -0.6f * y + 0.1f, 0.775f);
    }
    static const float eyes[STAGE_EYES][3] = {
        {6.3f, 3.6f, 2.2f}, {5.5f, -3.8f, 1.7f}, {-2.0f, -4.0f, 1.8f}, {-6.0f, -2.5f, 1.5f}};
    static const float targets[STAGE_EYES][3] = {
        {0, 0, 0.6f}, {-1.0f, 0.5f, 0.7f}, {1.0f, 1.0f, 0.7f}, {2.0f, 0.5f, 0.7f}};
    memcpy(stage->eyes, eyes, sizeof eyes);
    memcpy(stage->targets, targets, sizeof targets);
    stage->field_of_view = 1.1f;
    stage->light[0] = 0.8f;
    stage->light[1] = 0.4f;
    stage->light[2] = 3.0f;
    stage->light_size = 1.2f;
}

/* ---- pool hall ---- */

static void add_pool_table(struct mesh *m, uint32_t seed) {
    struct rng rng = rng_seed(seed);
    add_block(m, 0, 0, 0.74f, 1.3f, 0.7f, 0.04f, 13, 64);
    for (int side = -1; side <= 1; side += 2) {
        add_block(m, 0, 0.72f * (float)side, 0.8f, 1.36f, 0.06f, 0.05f, 17, 64);
        add_block(m, 1.32f * (float)side, 0, 0.8f, 0.06f, 0.72f, 0.05f, 17, 64);
        for (int end = -1; end <= 1; end += 2)
            add_pole(m, 1.1f * (float)end, 0.5f * (float)side, 0, 0.72f, 0.08f, 32);
    }
    for (int i = 0; i < 16; i++) { /* cells of a grid, so that no two meet */
        const float x = 0.55f * ((float)(i % 4) - 1.5f) + rng_range(&rng, -0.2f, 0.2f);
        const float y = 0.28f * ((float)(i / 4) - 1.5f) + rng_range(&rng, -0.1f, 0.1f);
        add_ball(m, x, y, 0.81f, 0.0285f, 20, 32);
    }
    add_pole(m, -0.6f, 0, 1.75f, 1.85f, 0.22f, 48);
    add_pole(m, 0.6f, 0, 1.75f, 1.85f, 0.22f, 48);
    const float tip[3] = {-0.3f, -0.2f, 0.83f}, butt[3] = {-1.5f, -0.5f, 1.05f};
    add_rod(m, tip, butt, 0.012f, 0.2f, 24, 24);
}

static void add_stool(struct mesh *m) {
    add_block(m, 0, 0, 0.72f, 0.18f, 0.18f, 0.04f, 17, 40);
    for (int leg = 0; leg < 4; leg++) {
        const float angle = 0.5f * PI * (float)leg;
        const float top[3] = {0.1f * cosf(angle), 0.1f * sinf(angle), 0.7f};
        const float foot[3] = {0.2f * cosf(angle), 0.2f * sinf(angle), 0};
        add_rod(m, top, foot, 0.018f, 0.2f, 12, 16);
    }
}

static void make_pool_hall(struct stage *stage) {
    struct mesh *m = &stage->mesh;
    add_room(m, 8.0f, 6.0f, 3.5f, 16);
    for (int i = 0; i < 6; i++) {
        const uint32_t first = m->vertex_count;
        add_pool_table(m, (uint32_t)i);
        place(m, first, 0.5f * PI, 4.4f * ((float)(i % 3) - 1.0f), 2.6f * (i < 3 ? -1.0f : 1.0f),
              0);
    }
    for (int i = 0; i < 24; i++) {
        const uint32_t first = m->vertex_count;
        add_stool(m);
        place(m, first, (float)i, 0.6f * ((float)i - 11.5f), 5.5f, 0);
    }
    for (int i = 0; i < 40; i++) { /* bottles on a shelf */
        const float x = 0.3f * ((float)i - 19.5f);
        add_pole(m, x, -5.8f, 1.4f, 1.62f, 0.035f, 32);
        add_pole(m, x, -5.8f, 1.6f, 1.72f, 0.012f, 32);
    }
    add_box(m, -6.2f, -5.95f, 1.36f, 6.2f, -5.6f, 1.4f);
    static const float eyes[STAGE_EYES][3] = {
        {6.5f, 4.6f, 2.2f}, {1.5f, 1.0f, 1.9f}, {-1.2f, -0.6f, 1.5f}, {-6.8f, 3.5f, 1.8f}};
    static const float targets[STAGE_EYES][3] = {
        {0, -1.0f, 0.7f}, {0, -2.6f, 0.8f}, {-4.4f, -2.6f, 0.8f}, {0, -1.0f, 0.8f}};
    memcpy(stage->eyes, eyes, sizeof eyes);
    memcpy(stage->targets, targets, sizeof targets);
    stage->field_of_view = 1.0f;
    stage->light[0] = 0.3f;
    stage->light[1] = 0.2f;
    stage->light[2] = 3.3f;
    stage->light_size = 1.5f;
}

/* ---- character ---- */

/* A joint's children hang from it at an angle from straight down, in the plane of the walk (x). */
static void limb_end(const float from[3], float length, float angle, float end[3]) {
    end[0] = from[0] + length * sinf(angle);
    end[1] = from[1];
    end[2] = from[2] - length * cosf(angle);
}

static void add_limb(struct mesh *m, const float from[3], float length, float angle, float radius,
                     float end[3]) {
    limb_end(from, length, angle, end);
    add_rod(m, from, end, radius, 0.5f, 39, 50);
}

static void add_leg(struct mesh *m, float side, float swing) {
    const float hip[3] = {0, 0.11f * side, 0.94f};
    const float thigh = 0.5f * sinf(swing), shin = thigh - 0.4f * (1.0f - cosf(swing + 0.8f));
    float knee[3], ankle[3], toe[3];
    add_limb(m, hip, 0.46f, thigh, 0.085f, knee);
    add_limb(m, knee, 0.44f, shin, 0.06f, ankle);
    add_limb(m, ankle, 0.2f, 0.45f * PI + shin, 0.05f, toe);
}

static void add_arm(struct mesh *m, float side, float swing) {
    const float shoulder[3] = {0, 0.24f * side, 1.44f};
    const float upper = 0.5f * sinf(swing), lower = upper + 0.3f + 0.2f * sinf(swing);
    float elbow[3], wrist[3], palm[3], tip[3];
    add_limb(m, shoulder, 0.31f, upper, 0.055f, elbow);
    add_limb(m, elbow, 0.27f, lower, 0.045f, wrist);
    add_limb(m, wrist, 0.1f, lower, 0.04f, palm);
    for (int finger = 0; finger < 4; finger++) {
        const float knuckle[3] = {palm[0], palm[1] + 0.018f * ((float)finger - 1.5f), palm[2]};
        limb_end(knuckle, 0.08f, lower + 0.3f, tip);
        add_rod(m, knuckle, tip, 0.009f, 0.4f, 12, 16);
    }
}

static void make_character(struct stage *stage, float phase) {
    struct mesh *m = &stage->mesh;
    const float swing = 2.0f * PI * phase, bob = 0.02f * cosf(2.0f * swing);
    const float hips[3] = {0, 0, 0.86f}, waist[3] = {0.02f * sinf(swing), 0, 1.15f};
    const float neck[3] = {0.03f, 0, 1.5f}, crown[3] = {0.05f, 0, 1.84f};
    for (int side = -1; side <= 1; side += 2) {
        const float turn = side < 0 ? swing : swing + PI;
        add_leg(m, (float)side, turn);
        add_arm(m, (float)side, turn + PI);
        add_ball(m, 0.15f, 0.04f * (float)side, 1.68f, 0.02f, 24, 32);
    }
    add_rod(m, hips, waist, 0.17f, 0.6f, 48, 64);
    add_rod(m, waist, neck, 0.2f, 0.6f, 64, 80);
    add_rod(m, neck, crown, 0.12f, 0.8f, 72, 96);
    place(m, 0, 0.0f, 0, 0, bob);
    const float corner[3] = {-4, -4, 0}, x[3] = {8, 0, 0}, y[3] = {0, 8, 0};
    mesh_add_grid(m, corner, x, y, 32, 32);
    static const float eyes[STAGE_EYES][3] = {
        {3.2f, 1.5f, 1.5f}, {2.6f, -1.8f, 1.2f}, {1.5f, -2.8f, 1.4f}, {1.6f, 0.4f, 1.7f}};
    static const float targets[STAGE_EYES][3] = {
        {0, 0, 0.95f}, {0, 0, 0.9f}, {0, 0, 1.0f}, {0, 0, 1.4f}};
    memcpy(stage->eyes, eyes, sizeof eyes);
    memcpy(stage->targets, targets, sizeof targets);
    stage->field_of_view = 0.75f;
    stage->light[0] = 1.5f;
    stage->light[1] = 1.2f;
    stage->light[2] = 3.5f;
    stage->light_size = 0.8f;
}

/* ---- tiny: a few hundred triangles, for checks against brute force ---- */

static void make_tiny(struct stage *stage) {
    struct mesh *m = &stage->mesh;
    add_room(m, 2.0f, 2.0f, 2.0f, 2);
    add_block(m, 0.5f, 0.3f, 0.4f, 0.4f, 0.3f, 0.4f, 5, 8);
    add_ball(m, -0.6f, -0.4f, 0.5f, 0.5f, 8, 12);
    const float a[3] = {-1.5f, 1.0f, 0.2f}, b[3] = {1.2f, -1.4f, 1.5f};
    add_rod(m, a, b, 0.1f, 0.3f, 5, 8);
    for (int i = 0; i < STAGE_EYES; i++) {
        const float angle = 0.5f * PI * (float)i,
                    eye[3] = {1.7f * cosf(angle), 1.7f * sinf(angle), 1.2f},
                    target[3] = {0, 0, 0.6f};
        memcpy(stage->eyes[i], eye, sizeof eye);
        memcpy(stage->targets[i], target, sizeof target);
    }
    stage->field_of_view = 1.2f;
    stage->light[2] = 1.8f;
    stage->light_size = 0.6f;
}

bool stage_make(const char *name, float phase, struct stage *stage) {
    memset(stage, 0, sizeof *stage);
    mesh_init(&stage->mesh);
    if (strcmp(name, "conference") == 0)
        make_conference(stage);
    else if (strcmp(name, "pool_hall") == 0)
        make_pool_hall(stage);
    else if (strcmp(name, "character") == 0)
        make_character(stage, phase);
    else if (strcmp(name, "tiny") == 0)
        make_tiny(stage);
    return stage->mesh.triangle_count > 0;
}

void stage_free(struct stage *stage) { mesh_free(&stage->mesh); }

void stage_camera(const struct stage *stage, float place, float eye[3], float target[3]) {
    const float x = fminf(fmaxf(place, 0.0f), 1.0f) * (STAGE_EYES - 1);
    const int i = x < STAGE_EYES - 2 ? (int)x : STAGE_EYES - 2;
    const float f = x - (float)i;
    for (int k = 0; k < 3; k++) {
        eye[k] = stage->eyes[i][k] + f * (stage->eyes[i + 1][k] - stage->eyes[i][k]);
        target[k] = stage->targets[i][k] + f * (stage->targets[i + 1][k] - stage->targets[i][k]);
    }
}
