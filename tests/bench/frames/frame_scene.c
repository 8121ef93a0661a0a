#include "frame_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "balls.h"
#include "components.h"
#include "palette.h"

/* Share of the scene's extent: a reasonable radius of the lens. */
#define LENS_SHARE 5e-3f
/* Watts for each square metre of the light's squared distance from the stage's middle: bright
 * enough there. */
#define LIGHT_WATTS 100.0f
#define WORLD_LIGHT 0.3f
/* Edge of the square that several lights fill, as a share of the scene's extent. */
#define LIGHTS_SPREAD 0.8f

static bool failed(trc_status status) {
    if (status != TRC_OK)
        fprintf(stderr, "frame_bench: %s\n", trc_last_message());
    return status != TRC_OK;
}

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* ---- geometry ---- */

/* The second key is as far from the first as the exposure says. */
static void mesh_expose(struct mesh *mesh, float exposure) {
    const float *from = mesh_key(mesh, 0);
    float *to = mesh_key(mesh, 1);
    for (size_t i = 0; i < 3 * (size_t)mesh->vertex_count; i++)
        to[i] = from[i] + exposure * (to[i] - from[i]);
}

static trc_status mesh_create(trc_scene scene, const struct mesh *mesh, trc_id *mesh_out) {
    uint16_t *slots = components_of(mesh, PALETTE_SIZE);
    const uint64_t position_count = (uint64_t)3 * mesh->vertex_count * mesh->key_count;
    const trc_mesh_desc desc = {.struct_size = sizeof desc,
                                .key_count = mesh->key_count,
                                .vertex_count = mesh->vertex_count,
                                .triangle_count = mesh->triangle_count,
                                .positions = mesh->positions,
                                .position_count = position_count,
                                .indices = mesh->indices,
                                .index_count = (uint64_t)3 * mesh->triangle_count,
                                .material_index = slots};
    const trc_status status = trc_mesh_create(scene, &desc, mesh_out);
    free(slots);
    return status;
}

static trc_status instance_create(trc_scene scene, trc_id mesh, const float transform[12],
                                  const trc_id *materials, uint32_t material_count) {
    trc_id instance;
    trc_instance_desc desc = trc_instance_desc_default();
    desc.mesh = mesh;
    desc.transforms = transform;
    desc.materials = materials;
    desc.material_count = material_count;
    return trc_instance_create(scene, &desc, &instance);
}

static trc_status instances_create(trc_scene scene, trc_id mesh, uint32_t count, uint32_t edge,
                                   const trc_id materials[PALETTE_SIZE]) {
    static const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    trc_status status = TRC_OK;
    if (count == 0)
        return instance_create(scene, mesh, identity, materials, PALETTE_SIZE);
    for (uint32_t i = 0; i < count && status == TRC_OK; i++) {
        float transform[12];
        balls_place(edge, i, transform);
        status = instance_create(scene, mesh, transform, &materials[i % PALETTE_SIZE], 1);
    }
    return status;
}

/* ---- light ---- */

static trc_status light_create(trc_scene scene, const float at[3], float size, float strength) {
    trc_id light;
    trc_light_desc desc = {.struct_size = sizeof desc,
                           .type = size > 0.0f ? TRC_LIGHT_AREA : TRC_LIGHT_POINT,
                           .transform = {1, 0, 0, at[0], 0, 1, 0, at[1], 0, 0, 1, at[2]},
                           .color = {1, 1, 1},
                           .strength = strength,
                           .size_x = size,
                           .size_y = size,
                           .spread = 3.14159265f,
                           .visibility = TRC_VISIBLE_ALL,
                           .cast_shadow = 1,
                           .use_mis = 1};
    return trc_light_create(scene, &desc, &light);
}

/* One light is where the stage has it; more are on a square grid at its height. */
static trc_status lights_create(trc_scene scene, const struct spec *spec, const struct stage *stage,
                                float extent) {
    const float size = spec->light_size * stage->light_size;
    const float strength = LIGHT_WATTS * dot(stage->light, stage->light) / (float)spec->lights;
    const uint32_t edge = (uint32_t)ceilf(sqrtf((float)spec->lights));
    const bool is_one = spec->lights == 1;
    trc_status status = TRC_OK;
    for (uint32_t i = 0; i < spec->lights && status == TRC_OK; i++) {
        const float x = ((float)(i % edge) + 0.5f) / (float)edge - 0.5f;
        const float y = ((float)(i / edge) + 0.5f) / (float)edge - 0.5f;
        const float at[3] = {is_one ? stage->light[0] : LIGHTS_SPREAD * extent * x,
                             is_one ? stage->light[1] : LIGHTS_SPREAD * extent * y,
                             stage->light[2]};
        status = light_create(scene, at, size / (float)edge, strength);
    }
    return status;
}

/* Reflected and refracted rays that leave the scene find some light; no shadow rays go there. */
static trc_status world_create(trc_scene scene) {
    const trc_node_input inputs[2] = {
        {.node = -1, .value = {WORLD_LIGHT, WORLD_LIGHT, WORLD_LIGHT}},
        {.node = -1, .value = {1, 1, 1}}};
    const trc_node node = {.type = TRC_NODE_BACKGROUND, .input_count = 2};
    const trc_material_desc material = {.struct_size = sizeof material,
                                        .node_count = 1,
                                        .nodes = &node,
                                        .inputs = inputs,
                                        .input_count = 2};
    trc_world_desc world = {.struct_size = sizeof world,
                            .visibility =
                                TRC_VISIBLE_CAMERA | TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION,
                            .ao_distance = 1.0f};
    const trc_status status = trc_material_create(scene, &material, &world.material);
    return status == TRC_OK ? trc_scene_set_world(scene, &world) : status;
}

/* ---- camera ---- */

/* Columns of the camera: right, up, back, place. Returns the distance of the target. */
static float camera_transform(const float eye[3], const float target[3], float out[12]) {
    float back[3], right[3], up[3];
    for (int k = 0; k < 3; k++)
        back[k] = eye[k] - target[k];
    const float distance = sqrtf(dot(back, back)), flat = hypotf(back[0], back[1]);
    for (int k = 0; k < 3; k++)
        back[k] /= distance;
    right[0] = -back[1] * distance / flat;
    right[1] = back[0] * distance / flat;
    right[2] = 0.0f;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        up[k] = back[i] * right[j] - back[j] * right[i];
    }
    for (int row = 0; row < 3; row++) {
        const float values[4] = {right[row], up[row], back[row], eye[row]};
        memcpy(out + 4 * row, values, sizeof values);
    }
    return distance;
}

trc_status frame_scene_look(const struct frame_scene *scene, const struct spec *spec,
                            uint32_t eye) {
    float place[3], target[3], transform[12];
    const float step = spec->eyes > 1 ? 1.0f / (float)(spec->eyes - 1) : 0.0f;
    stage_camera(&scene->stage, (float)eye * step, place, target);
    const float distance = camera_transform(place, target, transform);
    const float half = tanf(0.5f * scene->stage.field_of_view);
    const float high = half * (float)spec->height / (float)spec->width;
    const float window[4] = {-half, half, -high, high};
    const trc_camera_desc desc = {.struct_size = sizeof desc,
                                  .type = TRC_CAMERA_PERSPECTIVE,
                                  .key_count = 1,
                                  .transforms = transform,
                                  .windows = window,
                                  .window_key_count = 1,
                                  .clip_start = 1e-4f * scene->extent,
                                  .clip_end = 1e4f * scene->extent,
                                  .aperture_radius = LENS_SHARE * scene->extent * spec->aperture,
                                  .focus_distance = distance,
                                  .aperture_ratio = 1.0f,
                                  .shutter_time = spec->exposure > 0.0f ? 1.0f : 0.0f};
    const trc_status status = trc_scene_set_camera(scene->scene, &desc);
    return status == TRC_OK ? trc_scene_commit(scene->scene) : status;
}

/* ---- the scene ---- */

/* The stage and, of it, the mesh to render. */
static bool stage_load(const struct spec *spec, struct stage *stage, struct mesh *mesh,
                       uint32_t *edge) {
    char message[512];
    struct bench_scene loaded;
    if (strcmp(spec->scene, "balls") == 0) {
        if (spec->instances)
            balls_make_one(spec->instances, stage, edge);
        else
            balls_make(spec->triangles, stage);
        *mesh = stage->mesh;
        mesh_init(&stage->mesh);
        return true;
    }
    if (!bench_scene_load(spec->scene, &loaded, message, sizeof message)) {
        fprintf(stderr, "frame_bench: no generated scene has that name: %s\n", message);
        return false;
    }
    const bool moves = spec->exposure > 0.0f;
    *mesh = loaded.worlds[moves].meshes[0];
    mesh_init(&loaded.worlds[moves].meshes[0]);
    if (moves)
        mesh_expose(mesh, spec->exposure);
    *stage = loaded.stage;
    mesh_init(&stage->mesh);
    bench_scene_free(&loaded);
    return true;
}

static trc_status scene_fill(trc_scene scene, const struct spec *spec, const struct stage *stage,
                             const struct mesh *mesh, uint32_t edge, float extent) {
    const bool rough = spec->integrator == TRC_INTEGRATOR_DISTRIBUTION;
    trc_id materials[PALETTE_SIZE], id;
    trc_status status = palette_create(scene, spec->surface, rough, materials);
    if (status == TRC_OK)
        status = mesh_create(scene, mesh, &id);
    if (status == TRC_OK)
        status = instances_create(scene, id, spec->instances, edge, materials);
    if (status == TRC_OK)
        status = lights_create(scene, spec, stage, extent);
    return status == TRC_OK ? world_create(scene) : status;
}

static float extent_of(const struct spec *spec, const struct mesh *mesh) {
    float lower[3], upper[3], extent = 0.0f;
    mesh_bounds(mesh, lower, upper);
    for (int k = 0; k < 3; k++)
        extent = fmaxf(extent, upper[k] - lower[k]);
    /* An instanced ball is the unit one; the cube that its copies fill is twice as large. */
    return spec->instances ? 2.0f * extent : extent;
}

bool frame_scene_create(const struct spec *spec, struct frame_scene *out) {
    const trc_scene_desc desc = {
        .struct_size = sizeof desc, .thread_count = spec->threads, .is_final = 1};
    struct mesh mesh;
    uint32_t edge = 1;
    memset(out, 0, sizeof *out);
    if (!stage_load(spec, &out->stage, &mesh, &edge))
        return false;
    out->extent = extent_of(spec, &mesh);
    trc_status status = trc_scene_create(&desc, &out->scene);
    if (status == TRC_OK)
        status = scene_fill(out->scene, spec, &out->stage, &mesh, edge, out->extent);
    mesh_free(&mesh);
    if (status == TRC_OK)
        status = frame_scene_look(out, spec, 0);
    if (!failed(status))
        return true;
    frame_scene_destroy(out);
    return false;
}

void frame_scene_destroy(struct frame_scene *scene) {
    (void)trc_scene_destroy(scene->scene);
    memset(scene, 0, sizeof *scene);
}
