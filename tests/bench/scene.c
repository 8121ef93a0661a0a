#include "scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "obj.h"
#include "ray_set.h"

#define WALK_PHASE 0.1f
/* Of the walk's period: at one step of half a second a 1/24 s frame with a 180 degree shutter. */
#define WALK_SHUTTER (1.0f / 48.0f)
/* Radians that the top of a scene turns while the shutter is open. */
#define TURN_SHUTTER 0.02f

/* ---- the camera of a file ---- */

/* Camera positions of a model whose middle and size are known, in units of its size: from within a
 * room, or from without. */
static const float inner_eyes[STAGE_EYES][3] = {
    {-0.30f, 0.25f, 0.10f}, {0.10f, 0.30f, 0.10f}, {0.30f, -0.10f, 0.15f}, {0.0f, -0.30f, 0.0f}};
static const float outer_eyes[STAGE_EYES][3] = {
    {0.2f, -1.2f, 0.2f}, {1.0f, -0.8f, 0.5f}, {1.2f, 0.3f, 0.3f}, {0.6f, 1.0f, 0.8f}};
#define INNER_TARGET (-0.15f) /* of the height, below the middle */

/* A place is inside a room if nearly all that is seen from there is near. */
#define PROBE_RAYS 256
#define PROBE_SHARE 0.9f

static bool is_enclosed(const struct query_world *world, const float eye[3]) {
    struct query_scene scene;
    struct ray_set rays;
    struct hit_set hits;
    struct rng rng = rng_seed(1);
    uint32_t seen = 0;
    if (query_scene_create(world, true, 0, &scene) != TRC_OK)
        return false;
    ray_set_init(&rays);
    for (int i = 0; i < PROBE_RAYS; i++) {
        float direction[3];
        rng_direction(&rng, direction);
        ray_set_add_simple(&rays, eye, direction);
    }
    hit_set_init(&hits, PROBE_RAYS);
    if (hit_set_query(&hits, scene.scene, &rays, 0) == TRC_OK)
        for (int i = 0; i < PROBE_RAYS; i++)
            seen += hits.instance[i] != TRC_NO_HIT;
    hit_set_free(&hits);
    ray_set_free(&rays);
    query_scene_destroy(&scene);
    return (float)seen >= PROBE_SHARE * PROBE_RAYS;
}

/* A camera's way around or inside a model that comes without one, and a light over it. */
static void stage_around(struct stage *stage, const struct query_world *world) {
    float lower[3], upper[3], middle[3], size[3];
    mesh_bounds(&stage->mesh, lower, upper);
    for (int k = 0; k < 3; k++) {
        middle[k] = 0.5f * (lower[k] + upper[k]);
        size[k] = upper[k] - lower[k];
    }
    float probe[3];
    for (int k = 0; k < 3; k++)
        probe[k] = middle[k] + inner_eyes[0][k] * size[k];
    const bool inside = is_enclosed(world, probe);
    const float reach = fmaxf(size[0], fmaxf(size[1], size[2]));
    for (int i = 0; i < STAGE_EYES; i++)
        for (int k = 0; k < 3; k++) {
            stage->eyes[i][k] =
                middle[k] + (inside ? inner_eyes[i][k] * size[k] : outer_eyes[i][k] * reach);
            stage->targets[i][k] = middle[k] + (inside && k == 2 ? INNER_TARGET * size[k] : 0.0f);
        }
    for (int k = 0; k < 3; k++)
        stage->light[k] =
            middle[k] + (k == 2 ? (inside ? 0.4f : 1.5f) : (inside ? 0.05f : 0.7f)) * size[k];
    stage->light_size = 0.1f * size[0];
    stage->field_of_view = inside ? 1.3f : 0.9f;
}

/* ---- motion ---- */

static void turn_by_height(struct mesh *mesh) {
    float lower[3], upper[3];
    mesh_bounds(mesh, lower, upper);
    const float x = 0.5f * (lower[0] + upper[0]), y = 0.5f * (lower[1] + upper[1]);
    mesh_set_keys(mesh, 2);
    const float *from = mesh_key(mesh, 0);
    float *to = mesh_key(mesh, 1);
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i += 3) {
        const float share = (from[i + 2] - lower[2]) / fmaxf(upper[2] - lower[2], 1e-30f);
        const float c = cosf(TURN_SHUTTER * share), s = sinf(TURN_SHUTTER * share);
        to[i] = x + c * (from[i] - x) - s * (from[i + 1] - y);
        to[i + 1] = y + s * (from[i] - x) + c * (from[i + 1] - y);
    }
}

static void walk_on(struct mesh *mesh, const char *name) {
    struct stage later;
    stage_make(name, WALK_PHASE + WALK_SHUTTER, &later);
    mesh_set_keys(mesh, 2);
    memcpy(mesh_key(mesh, 1), later.mesh.positions, 3 * (size_t)mesh->vertex_count * sizeof(float));
    stage_free(&later);
}

/* ---- the scene ---- */

static void name_of_path(const char *path, char *name, size_t capacity) {
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    const char *dot = strrchr(base, '.');
    snprintf(name, capacity, "%.*s", dot ? (int)(dot - base) : (int)strlen(base), base);
}

bool bench_scene_load(const char *name, struct bench_scene *scene, char *message, size_t capacity) {
    memset(scene, 0, sizeof *scene);
    const bool is_stage = stage_make(name, WALK_PHASE, &scene->stage);
    if (!is_stage && !obj_load(name, &scene->stage.mesh, message, capacity))
        return false;
    name_of_path(name, scene->name, sizeof scene->name);
    for (int moving = 0; moving < 2; moving++) {
        query_world_init(&scene->worlds[moving]);
        mesh_append(query_world_object(&scene->worlds[moving]), &scene->stage.mesh);
    }
    if (strcmp(name, "character") == 0)
        walk_on(&scene->worlds[1].meshes[0], name);
    else
        turn_by_height(&scene->worlds[1].meshes[0]);
    if (!is_stage)
        stage_around(&scene->stage, &scene->worlds[0]);
    float lower[3], upper[3];
    mesh_bounds(&scene->stage.mesh, lower, upper);
    for (int k = 0; k < 3; k++)
        scene->extent = fmaxf(scene->extent, upper[k] - lower[k]);
    return true;
}

static void points_turn(float *points, size_t count, float radians) {
    const float c = cosf(radians), s = sinf(radians);
    for (float *p = points; p < points + 3 * count; p += 3) {
        const float x = p[0], y = p[1];
        p[0] = c * x - s * y;
        p[1] = s * x + c * y;
    }
}

static void mesh_turn(struct mesh *mesh, float radians) {
    points_turn(mesh->positions, (size_t)mesh->vertex_count * mesh->key_count, radians);
}

void bench_scene_turn(struct bench_scene *scene, uint32_t degrees) {
    const float radians = (float)degrees * 3.14159265f / 180.0f;
    const size_t length = strlen(scene->name);
    mesh_turn(&scene->stage.mesh, radians);
    for (int moving = 0; moving < 2; moving++)
        mesh_turn(&scene->worlds[moving].meshes[0], radians);
    points_turn(scene->stage.eyes[0], STAGE_EYES, radians);
    points_turn(scene->stage.targets[0], STAGE_EYES, radians);
    points_turn(scene->stage.light, 1, radians);
    (void)snprintf(scene->name + length, sizeof scene->name - length, " turned");
}

void bench_scene_free(struct bench_scene *scene) {
    for (int moving = 0; moving < 2; moving++)
        query_world_free(&scene->worlds[moving]);
    stage_free(&scene->stage);
}
