#include "query_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene/scene.h"

static const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

void query_world_init(struct query_world *world) { memset(world, 0, sizeof *world); }

void query_world_free(struct query_world *world) {
    for (uint32_t i = 0; i < world->mesh_count; i++)
        mesh_free(&world->meshes[i]);
    query_world_init(world);
}

static void check_room(uint32_t count, uint32_t limit) {
    if (count < limit)
        return;
    fprintf(stderr, "a test world is full: raise QUERY_MAX_*\n");
    exit(EXIT_FAILURE);
}

struct mesh *query_world_mesh(struct query_world *world) {
    check_room(world->mesh_count, QUERY_MAX_MESHES);
    struct mesh *mesh = &world->meshes[world->mesh_count++];
    mesh_init(mesh);
    return mesh;
}

struct query_instance *query_world_instance(struct query_world *world, uint32_t mesh) {
    check_room(world->instance_count, QUERY_MAX_INSTANCES);
    struct query_instance *instance = &world->instances[world->instance_count++];
    *instance =
        (struct query_instance){.mesh = mesh, .key_count = 1, .visibility = TRC_VISIBLE_ALL};
    for (int key = 0; key < QUERY_MAX_KEYS; key++)
        memcpy(instance->transforms[key], identity, sizeof identity);
    return instance;
}

struct mesh *query_world_object(struct query_world *world) {
    struct mesh *mesh = query_world_mesh(world);
    query_world_instance(world, world->mesh_count - 1);
    return mesh;
}

static trc_status create_mesh(trc_scene scene, const struct mesh *mesh, trc_id *id) {
    const trc_mesh_desc desc = {.struct_size = sizeof desc,
                                .key_count = mesh->key_count,
                                .vertex_count = mesh->vertex_count,
                                .triangle_count = mesh->triangle_count,
                                .positions = mesh->positions,
                                .position_count =
                                    (uint64_t)3 * mesh->vertex_count * mesh->key_count,
                                .indices = mesh->indices,
                                .index_count = (uint64_t)3 * mesh->triangle_count};
    return trc_mesh_create(scene, &desc, id);
}

static trc_instance_desc instance_desc(const struct query_instance *instance, trc_id mesh) {
    return (trc_instance_desc){.struct_size = sizeof(trc_instance_desc),
                               .key_count = instance->key_count,
                               .mesh = mesh,
                               .transforms = instance->transforms[0],
                               .visibility = instance->visibility,
                               .color = {1, 1, 1, 1},
                               .shadow_terminator_geometry = 0.1f};
}

static trc_status create_instance(trc_scene scene, const struct query_instance *instance,
                                  trc_id mesh, trc_id *id) {
    const trc_instance_desc desc = instance_desc(instance, mesh);
    return trc_instance_create(scene, &desc, id);
}

trc_status query_scene_create(const struct query_world *world, bool is_final, uint32_t thread_count,
                              struct query_scene *out) {
    const trc_scene_desc desc = {
        .struct_size = sizeof desc, .thread_count = thread_count, .is_final = is_final};
    memset(out, 0, sizeof *out);
    trc_status status = trc_scene_create(&desc, &out->scene);
    if (status != TRC_OK)
        return status;
    for (uint32_t i = 0; i < world->mesh_count && status == TRC_OK; i++)
        status = create_mesh(out->scene, &world->meshes[i], &out->meshes[i]);
    for (uint32_t i = 0; i < world->instance_count && status == TRC_OK; i++)
        status = create_instance(out->scene, &world->instances[i],
                                 out->meshes[world->instances[i].mesh], &out->instances[i]);
    if (status == TRC_OK)
        status = trc_scene_commit(out->scene);
    if (status != TRC_OK)
        query_scene_destroy(out);
    return status;
}

void query_scene_destroy(struct query_scene *scene) {
    (void)trc_scene_destroy(scene->scene);
    memset(scene, 0, sizeof *scene);
}

trc_status query_scene_pose(struct query_scene *scene, const struct query_world *world,
                            uint32_t mesh) {
    const struct mesh *m = &world->meshes[mesh];
    const trc_status status =
        trc_mesh_update(scene->scene, scene->meshes[mesh], m->key_count, m->positions,
                        (uint64_t)3 * m->vertex_count * m->key_count, NULL, 0);
    return status == TRC_OK ? trc_scene_commit(scene->scene) : status;
}

trc_status query_scene_move(struct query_scene *scene, const struct query_world *world,
                            uint32_t instance) {
    const struct query_instance *moved = &world->instances[instance];
    const trc_instance_desc desc = instance_desc(moved, scene->meshes[moved->mesh]);
    return trc_instance_update(scene->scene, scene->instances[instance], &desc);
}

struct trc_snapshot *query_scene_snapshot(trc_scene scene) {
    struct trc_scene_access access;
    if (trc_scene_enter(scene, &access) != TRC_OK)
        return NULL;
    struct trc_snapshot *snapshot = access.scene->snapshot;
    trc_scene_leave(&access);
    return snapshot;
}

trc_scene_stats query_scene_stats(trc_scene scene) {
    trc_scene_stats stats = {.struct_size = sizeof stats};
    (void)trc_scene_get_stats(scene, &stats);
    return stats;
}

void query_transform(const float axis[3], float radians, const float scale[3],
                     const float offset[3], float transform_out[12]) {
    const float length = sqrtf(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    const float x = axis[0] / length, y = axis[1] / length, z = axis[2] / length;
    const float c = cosf(radians), s = sinf(radians), k = 1.0f - c;
    const float rotation[3][3] = {{c + x * x * k, x * y * k - z * s, x * z * k + y * s},
                                  {y * x * k + z * s, c + y * y * k, y * z * k - x * s},
                                  {z * x * k - y * s, z * y * k + x * s, c + z * z * k}};
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++)
            transform_out[4 * row + column] = rotation[row][column] * scale[column];
        transform_out[4 * row + 3] = offset[row];
    }
}

void query_turned_needles(struct mesh *mesh, uint32_t count, float aspect) {
    static const float axis[3] = {1, 2, 3}, scale[3] = {1, 1, 1}, offset[3] = {0, 0, 0};
    float turn[12];
    query_transform(axis, 1.0f, scale, offset, turn);
    mesh_add_needle_fan(mesh, count, 1.0f, aspect);
    mesh_transform(mesh, 0, turn);
}
