/* Edits of meshes, instances and lights. */
#include <inttypes.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/dicing.h"
#include "scene/curves.h"
#include "scene/displace.h"
#include "scene/mesh.h"
#include "scene/scene.h"

/* ---- meshes ---- */

/* Takes the geometry over, on failure too. */
static trc_status add_geometry(struct trc_scene_state *scene, struct trc_mesh *geometry,
                               trc_id *id) {
    struct trc_scene_mesh *mesh = trc_alloc_zeroed(1, sizeof *mesh);
    trc_status status = TRC_OK;
    if (mesh) {
        mesh->geometry = geometry;
        status = trc_store_add(&scene->meshes, mesh, id);
    } else {
        status = trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a mesh");
    }
    if (status != TRC_OK) {
        trc_geometry_release(geometry);
        trc_free(mesh);
        return status;
    }
    scene->changed |= TRC_CHANGED_MESHES;
    return TRC_OK;
}

trc_status trc_scene_add_mesh(struct trc_scene_state *scene, const trc_mesh_desc *desc,
                              trc_id *id) {
    struct trc_diced_mesh diced = {.desc = *desc};
    if (desc->dicing)
        TRC_TRY(trc_dice(desc, &diced));
    struct trc_mesh *geometry;
    trc_status status = trc_geometry_create(&diced.desc, scene->names, &geometry);
    const bool is_coarse = diced.is_coarse;
    trc_diced_mesh_free(&diced);
    TRC_TRY(status);
    status = add_geometry(scene, geometry, id);
    void *mesh;
    if (status == TRC_OK && is_coarse && trc_store_find(&scene->meshes, *id, &mesh) == TRC_OK)
        ((struct trc_scene_mesh *)mesh)->is_coarse = true;
    return status;
}

trc_status trc_scene_add_curves(struct trc_scene_state *scene, const trc_curves_desc *desc,
                                trc_id *id) {
    struct trc_mesh *geometry;
    TRC_TRY(trc_curves_geometry_create(desc, scene->names, &geometry));
    return add_geometry(scene, geometry, id);
}

trc_status trc_scene_pose_mesh(struct trc_scene_state *scene, trc_id id, uint32_t key_count,
                               const float *positions, uint64_t position_count,
                               const float *normals, uint64_t normal_count) {
    void *object;
    TRC_TRY(trc_store_find(&scene->meshes, id, &object));
    struct trc_scene_mesh *mesh = object;
    const struct trc_mesh *former = mesh->geometry;
    if (former->strands)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the mesh is of curves");
    const uint32_t kind = trc_geometry_normal_kind(former);
    const uint64_t expected = (uint64_t)3 * former->vertex_count * key_count;
    const uint64_t expected_normals = kind == TRC_NORMALS_NONE ? 0
                                      : kind == TRC_NORMALS_VERTEX
                                          ? expected
                                          : (uint64_t)9 * former->triangle_count * key_count;
    TRC_TRY(trc_check_array(positions, position_count, expected, 4, 4, "positions"));
    TRC_TRY(trc_check_array(normals, normal_count, expected_normals, 4, 4, "normals"));
    if (expected > INT32_MAX || expected_normals > INT32_MAX) {
        return trc_fail(TRC_ERROR_TOO_LARGE,
                        "a mesh can have at most 2^31 - 1 floats of each kind");
    }
    struct trc_mesh *pose;
    TRC_TRY(trc_geometry_pose(former, key_count, positions, normals, &pose));
    trc_geometry_release(mesh->geometry);
    mesh->geometry = pose;
    scene->changed |= TRC_CHANGED_MESHES;
    return TRC_OK;
}

trc_status trc_scene_pose_curves(struct trc_scene_state *scene, trc_id id, uint32_t key_count,
                                 const float *points, uint64_t point_value_count) {
    void *object;
    TRC_TRY(trc_store_find(&scene->meshes, id, &object));
    struct trc_scene_mesh *mesh = object;
    struct trc_mesh *pose;
    TRC_TRY(trc_curves_geometry_pose(mesh->geometry, key_count, points, point_value_count, &pose));
    trc_geometry_release(mesh->geometry);
    mesh->geometry = pose;
    scene->changed |= TRC_CHANGED_MESHES;
    return TRC_OK;
}

trc_status trc_scene_remove_mesh(struct trc_scene_state *scene, trc_id id) {
    void *object;
    TRC_TRY(trc_store_find(&scene->meshes, id, &object));
    struct trc_scene_mesh *mesh = object;
    if (mesh->use_count) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "the mesh is in use by %" PRIu32 " instances",
                        mesh->use_count);
    }
    trc_store_remove(&scene->meshes, id);
    trc_displacer_destroy(mesh->displacer);
    trc_geometry_release(mesh->geometry);
    trc_free(mesh);
    scene->changed |= TRC_CHANGED_MESHES;
    return TRC_OK;
}

/* ---- instances ---- */

static trc_status make_instance(const struct trc_scene_state *scene, const trc_instance_desc *desc,
                                struct trc_scene_instance **instance_out) {
    for (uint32_t i = 0; i < desc->material_count; i++) {
        void *ignored;
        if (desc->materials[i]) {
            TRC_TRY(trc_store_find(&scene->materials, desc->materials[i], &ignored));
        }
    }
    const size_t transform_bytes = desc->key_count * sizeof(struct trc_affine);
    const size_t material_bytes = desc->material_count * sizeof(trc_id);
    const size_t value_bytes = desc->value_count * sizeof(float);
    struct trc_scene_instance *instance =
        trc_alloc(1, sizeof *instance + transform_bytes + material_bytes + value_bytes);
    if (!instance)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for an instance");
    struct trc_affine *transforms = (struct trc_affine *)(instance + 1);
    trc_id *materials = (trc_id *)(transforms + desc->key_count);
    memcpy(transforms, desc->transforms, transform_bytes);
    if (material_bytes)
        memcpy(materials, desc->materials, material_bytes);
    float *values = (float *)(materials + desc->material_count);
    if (value_bytes)
        memcpy(values, desc->values, value_bytes);
    *instance = (struct trc_scene_instance){
        .mesh = desc->mesh,
        .key_count = desc->key_count,
        .material_count = desc->material_count,
        .transforms = transforms,
        .materials = materials,
        .value_count = desc->value_count,
        .values = values,
        .visibility = desc->visibility,
        .pass_index = desc->pass_index,
        .random = desc->random,
        .cryptomatte_object = desc->cryptomatte_object,
        .cryptomatte_asset = desc->cryptomatte_asset,
        .light_group = desc->light_group,
        .flags = desc->flags,
        .light_set = desc->light_set,
        .shadow_set = desc->shadow_set,
        .light_exclude = desc->light_exclude,
        .shadow_exclude = desc->shadow_exclude,
        .shadow_terminator_geometry = desc->shadow_terminator_geometry,
        .shadow_terminator_shading = desc->shadow_terminator_shading,
        .ao_distance = desc->ao_distance,
    };
    memcpy(instance->color, desc->color, sizeof instance->color);
    *instance_out = instance;
    return TRC_OK;
}

trc_status trc_scene_add_instance(struct trc_scene_state *scene, const trc_instance_desc *desc,
                                  trc_id *id) {
    void *mesh;
    TRC_TRY(trc_store_find(&scene->meshes, desc->mesh, &mesh));
    struct trc_scene_instance *instance;
    TRC_TRY(make_instance(scene, desc, &instance));
    const trc_status status = trc_store_add(&scene->instances, instance, id);
    if (status != TRC_OK) {
        trc_free(instance);
        return status;
    }
    ((struct trc_scene_mesh *)mesh)->use_count++;
    scene->changed |= TRC_CHANGED_INSTANCES;
    return TRC_OK;
}

trc_status trc_scene_change_instance(struct trc_scene_state *scene, trc_id id,
                                     const trc_instance_desc *desc) {
    void *former = NULL, *mesh = NULL;
    TRC_TRY(trc_store_find(&scene->instances, id, &former));
    TRC_TRY(trc_store_find(&scene->meshes, desc->mesh, &mesh));
    struct trc_scene_instance *instance;
    TRC_TRY(make_instance(scene, desc, &instance));
    struct trc_scene_mesh *former_mesh =
        trc_store_get(&scene->meshes, ((struct trc_scene_instance *)former)->mesh);
    former_mesh->use_count--;
    ((struct trc_scene_mesh *)mesh)->use_count++;
    scene->instances.slots[trc_store_slot_of(id)].object = instance;
    trc_free(former);
    scene->changed |= TRC_CHANGED_INSTANCES;
    return TRC_OK;
}

trc_status trc_scene_move_instances(struct trc_scene_state *scene, const trc_id *ids,
                                    uint64_t count, uint32_t key_count, const float *transforms) {
    for (uint64_t i = 0; i < count; i++) {
        void *object;
        TRC_TRY(trc_store_find(&scene->instances, ids[i], &object));
        const uint32_t keys = ((struct trc_scene_instance *)object)->key_count;
        if (keys != key_count)
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "instance %" PRIu64 " has %" PRIu32 " keys, not %" PRIu32, i, keys,
                            key_count);
    }
    const size_t bytes = key_count * sizeof(struct trc_affine);
    for (uint64_t i = 0; i < count; i++) {
        struct trc_scene_instance *instance = trc_store_get(&scene->instances, ids[i]);
        memcpy(instance->transforms, transforms + 12 * key_count * i, bytes);
    }
    if (count)
        scene->changed |= TRC_CHANGED_INSTANCES;
    return TRC_OK;
}

trc_status trc_scene_remove_instance(struct trc_scene_state *scene, trc_id id) {
    void *object;
    TRC_TRY(trc_store_find(&scene->instances, id, &object));
    struct trc_scene_mesh *mesh =
        trc_store_get(&scene->meshes, ((struct trc_scene_instance *)object)->mesh);
    mesh->use_count--;
    trc_store_remove(&scene->instances, id);
    trc_free(object);
    scene->changed |= TRC_CHANGED_INSTANCES;
    return TRC_OK;
}

/* ---- lights ---- */

static trc_status check_light_material(const struct trc_scene_state *scene,
                                       const trc_light_desc *desc) {
    void *ignored;
    return desc->material ? trc_store_find(&scene->materials, desc->material, &ignored) : TRC_OK;
}

/* What blocks a light is known to the instances. */
static void mark_light(struct trc_scene_state *scene, const trc_light_desc *light) {
    if (light->shadow_exclude)
        scene->changed |= TRC_CHANGED_INSTANCES;
}

trc_status trc_scene_add_light(struct trc_scene_state *scene, const trc_light_desc *desc,
                               trc_id *id) {
    TRC_TRY(check_light_material(scene, desc));
    trc_light_desc *light = trc_alloc(1, sizeof *light);
    if (!light)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a light");
    *light = *desc;
    mark_light(scene, desc);
    const trc_status status = trc_store_add(&scene->lights, light, id);
    if (status != TRC_OK) {
        trc_free(light);
        return status;
    }
    scene->changed |= TRC_CHANGED_LIGHTS;
    return TRC_OK;
}

trc_status trc_scene_change_light(struct trc_scene_state *scene, trc_id id,
                                  const trc_light_desc *desc) {
    void *light;
    TRC_TRY(trc_store_find(&scene->lights, id, &light));
    TRC_TRY(check_light_material(scene, desc));
    mark_light(scene, light);
    mark_light(scene, desc);
    *(trc_light_desc *)light = *desc;
    scene->changed |= TRC_CHANGED_LIGHTS;
    return TRC_OK;
}

trc_status trc_scene_remove_light(struct trc_scene_state *scene, trc_id id) {
    void *light;
    TRC_TRY(trc_store_find(&scene->lights, id, &light));
    mark_light(scene, light);
    trc_store_remove(&scene->lights, id);
    trc_free(light);
    scene->changed |= TRC_CHANGED_LIGHTS;
    return TRC_OK;
}
