/* Public calls on meshes and instances. */
#include <float.h>
#include <inttypes.h>

#include "core/checks.h"
#include "core/core.h"
#include "model/names.h"
#include "scene/scene.h"
#include "tracer/tracer.h"

/* Kernels address the floats of an array by 31 bits. */
#define MAX_ELEMENTS ((uint64_t)INT32_MAX)

/* a * b * c elements, within what kernels can address. */
static trc_status check_product(uint64_t a, uint64_t b, uint64_t c, const char *name) {
    uint64_t product;
    if (!trc_multiply_u64(a, b, &product) || !trc_multiply_u64(product, c, &product) ||
        product > MAX_ELEMENTS) {
        return trc_fail(TRC_ERROR_TOO_LARGE, "%s: more than %" PRIu64 " elements", name,
                        MAX_ELEMENTS);
    }
    return TRC_OK;
}

static trc_status check_attribute(const trc_corner_attribute *attribute, uint64_t triangle_count) {
    const char *name = "trc_corner_attribute";
    TRC_TRY(trc_check_struct(attribute, sizeof *attribute, name));
    if (attribute->width != 2 && attribute->width != 4) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s: width is %" PRIu32 ", it can be 2 or 4",
                        name, attribute->width);
    }
    if (!attribute->name)
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "%s: name is NULL", name);
    TRC_TRY(check_product(attribute->width, 3, triangle_count, name));
    return trc_check_array(attribute->values, attribute->value_count,
                           attribute->width * 3 * triangle_count, 4, 4, "attribute values");
}

static trc_status check_normals(const trc_mesh_desc *desc) {
    TRC_TRY(trc_check_enum(desc->normal_kind, 3, "normal_kind"));
    uint64_t per_key = 0;
    if (desc->normal_kind == TRC_NORMALS_VERTEX)
        per_key = desc->vertex_count;
    if (desc->normal_kind == TRC_NORMALS_CORNER)
        per_key = 3 * desc->triangle_count;
    TRC_TRY(check_product(3, per_key, desc->key_count, "normals"));
    if (!desc->normals && !desc->normal_count)
        return TRC_OK; /* computed, whatever the kind */
    return trc_check_array(desc->normals, desc->normal_count, 3 * per_key * desc->key_count, 4, 4,
                           "normals");
}

static trc_status check_sharpness(const float *values, uint64_t count, const char *name) {
    for (uint64_t i = 0; i < count; i++)
        TRC_TRY(trc_check_float(values[i], 0.0f, FLT_MAX, name));
    return TRC_OK;
}

static trc_status check_creases(const trc_dicing_desc *dicing, uint64_t vertex_count) {
    TRC_TRY(check_product(2, dicing->crease_count, 1, "crease_edges"));
    TRC_TRY(trc_check_array(dicing->crease_edges, dicing->crease_edge_count,
                            2 * dicing->crease_count, sizeof(uint32_t), sizeof(uint32_t),
                            "crease_edges"));
    TRC_TRY(trc_check_array(dicing->crease_sharpness, dicing->crease_count, dicing->crease_count,
                            sizeof(float), sizeof(float), "crease_sharpness"));
    TRC_TRY(check_sharpness(dicing->crease_sharpness, dicing->crease_count, "crease_sharpness"));
    for (uint64_t i = 0; i < dicing->crease_edge_count; i++) {
        if (dicing->crease_edges[i] >= vertex_count)
            return trc_fail(TRC_ERROR_INVALID_ARGUMENT,
                            "crease %" PRIu64 " has the vertex %" PRIu32
                            ", but the mesh has %" PRIu64,
                            i / 2, dicing->crease_edges[i], vertex_count);
    }
    if (!dicing->vertex_sharpness && !dicing->vertex_sharpness_count)
        return TRC_OK;
    TRC_TRY(trc_check_array(dicing->vertex_sharpness, dicing->vertex_sharpness_count, vertex_count,
                            sizeof(float), sizeof(float), "vertex_sharpness"));
    return check_sharpness(dicing->vertex_sharpness, vertex_count, "vertex_sharpness");
}

static trc_status check_dicing(const trc_mesh_desc *desc) {
    const trc_dicing_desc *dicing = desc->dicing;
    TRC_TRY(trc_check_struct(dicing, sizeof *dicing, "trc_dicing_desc"));
    TRC_TRY(trc_check_enum(dicing->surface, TRC_DICING_CATMULL_CLARK + 1, "surface"));
    TRC_TRY(trc_check_enum(dicing->space, TRC_DICING_CENTRAL + 1, "space"));
    TRC_TRY(trc_check_enum(dicing->sharp_corners, 2, "sharp_corners"));
    TRC_TRY(trc_check_count(dicing->max_subdivisions, 0, 16, "max_subdivisions"));
    TRC_TRY(trc_check_float(dicing->side, FLT_MIN, FLT_MAX, "side"));
    TRC_TRY(trc_check_finite(dicing->object_to_camera, 12, "object_to_camera"));
    TRC_TRY(trc_check_finite(dicing->window, 4, "window"));
    TRC_TRY(trc_check_float(dicing->offscreen_scale, 1.0f, FLT_MAX, "offscreen_scale"));
    TRC_TRY(check_creases(dicing, desc->vertex_count));
    if (!dicing->faces && !dicing->face_count)
        return TRC_OK;
    return trc_check_array(dicing->faces, dicing->face_count, desc->triangle_count,
                           sizeof(uint32_t), sizeof(uint32_t), "faces");
}

static trc_status check_mesh(const trc_mesh_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_mesh_desc"));
    TRC_TRY(trc_check_count(desc->key_count, 1, TRC_MAX_KEYS, "key_count"));
    /* Singles first: later products of them by 3 and 9 cannot wrap. */
    TRC_TRY(check_product(3, desc->vertex_count, desc->key_count, "positions"));
    TRC_TRY(check_product(3, desc->triangle_count, 1, "indices"));
    if (desc->generated || desc->generated_count)
        TRC_TRY(trc_check_array(desc->generated, desc->generated_count, 3 * desc->vertex_count,
                                sizeof(float), sizeof(float), "generated"));
    TRC_TRY(trc_check_array(desc->positions, desc->position_count,
                            3 * desc->vertex_count * desc->key_count, 4, 4, "positions"));
    TRC_TRY(trc_check_array(desc->indices, desc->index_count, 3 * desc->triangle_count, 4, 4,
                            "indices"));
    TRC_TRY(check_normals(desc));
    if (desc->material_index && (uintptr_t)desc->material_index % sizeof(uint16_t)) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "material_index is not aligned to 2 bytes");
    }
    TRC_TRY(trc_check_count(desc->attribute_count, 0, TRC_MAX_ATTRIBUTES, "attribute_count"));
    if (desc->attribute_count && !desc->attributes) {
        return trc_fail(TRC_ERROR_INVALID_ARGUMENT, "attributes is NULL");
    }
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        TRC_TRY(check_attribute(&desc->attributes[i], desc->triangle_count));
    }
    if (desc->dicing)
        TRC_TRY(check_dicing(desc));
    return TRC_OK;
}

trc_status trc_mesh_create(trc_scene scene, const trc_mesh_desc *desc, trc_id *mesh_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_mesh(desc);
    if (status == TRC_OK)
        status = trc_check_out(mesh_out, sizeof *mesh_out, "mesh_out");
    if (status == TRC_OK)
        status = trc_scene_add_mesh(access.scene, desc, mesh_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_mesh_update(trc_scene scene, trc_id mesh, uint32_t key_count, const float *positions,
                           uint64_t position_count, const float *normals, uint64_t normal_count) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = trc_check_count(key_count, 1, TRC_MAX_KEYS, "key_count");
    if (status == TRC_OK) {
        status = trc_scene_pose_mesh(access.scene, mesh, key_count, positions, position_count,
                                     normals, normal_count);
    }
    trc_scene_leave(&access);
    return status;
}

trc_status trc_mesh_destroy(trc_scene scene, trc_id mesh) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_remove_mesh(access.scene, mesh);
    trc_scene_leave(&access);
    return status;
}

/* Most material slots of an instance: a triangle's slot has 16 bits. */
#define MAX_SLOTS 65536

/* Transforms are checked at commit: one that is not finite hides the instance. */
static trc_status check_instance(const trc_instance_desc *desc) {
    TRC_TRY(trc_check_struct(desc, sizeof *desc, "trc_instance_desc"));
    TRC_TRY(trc_check_count(desc->key_count, 1, TRC_MAX_KEYS, "key_count"));
    TRC_TRY(trc_check_out(desc->transforms, sizeof(float), "transforms"));
    TRC_TRY(trc_check_count(desc->material_count, 0, MAX_SLOTS, "material_count"));
    if (desc->material_count) {
        TRC_TRY(trc_check_out(desc->materials, sizeof(trc_id), "materials"));
    }
    TRC_TRY(trc_check_enum(desc->visibility, TRC_VISIBLE_ALL + 1, "visibility"));
    TRC_TRY(trc_check_finite(&desc->random, 1, "random"));
    TRC_TRY(trc_check_finite(desc->color, 4, "color"));
    TRC_TRY(trc_check_finite(&desc->cryptomatte_object, 1, "cryptomatte_object"));
    TRC_TRY(trc_check_count(desc->light_group, 0, TRC_MAX_LIGHT_GROUPS, "light_group"));
    TRC_TRY(trc_check_enum(desc->flags, 2 * TRC_INSTANCE_WORLD_NORMALS, "flags"));
    TRC_TRY(trc_check_float(desc->ao_distance, 0.0f, FLT_MAX, "ao_distance"));
    TRC_TRY(trc_check_float(desc->shadow_terminator_geometry, 0.0f, 1.0f,
                            "shadow_terminator_geometry"));
    TRC_TRY(
        trc_check_float(desc->shadow_terminator_shading, 0.0f, 1.0f, "shadow_terminator_shading"));
    TRC_TRY(trc_check_count(desc->light_set, 0, 63, "light_set"));
    TRC_TRY(trc_check_count(desc->shadow_set, 0, 63, "shadow_set"));
    TRC_TRY(trc_check_count(desc->value_count, 0, TRC_MAX_INSTANCE_VALUES, "value_count"));
    if (desc->value_count) {
        TRC_TRY(trc_check_out(desc->values, sizeof(float), "values"));
        TRC_TRY(trc_check_finite(desc->values, desc->value_count, "values"));
    }
    return trc_check_finite(&desc->cryptomatte_asset, 1, "cryptomatte_asset");
}

trc_status trc_instance_create(trc_scene scene, const trc_instance_desc *desc,
                               trc_id *instance_out) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_instance(desc);
    if (status == TRC_OK)
        status = trc_check_out(instance_out, sizeof *instance_out, "instance_out");
    if (status == TRC_OK)
        status = trc_scene_add_instance(access.scene, desc, instance_out);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_instance_update(trc_scene scene, trc_id instance, const trc_instance_desc *desc) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_instance(desc);
    if (status == TRC_OK)
        status = trc_scene_change_instance(access.scene, instance, desc);
    trc_scene_leave(&access);
    return status;
}

static trc_status check_moves(const trc_id *instances, uint64_t instance_count, uint32_t key_count,
                              const float *transforms, uint64_t float_count) {
    TRC_TRY(trc_check_count(key_count, 1, TRC_MAX_KEYS, "key_count"));
    TRC_TRY(trc_check_array(instances, instance_count, instance_count, sizeof(trc_id),
                            sizeof(trc_id), "instances"));
    uint64_t floats;
    if (!trc_multiply_u64(instance_count, 12 * key_count, &floats))
        floats = UINT64_MAX; /* TOO_LARGE below */
    return trc_check_array(transforms, float_count, floats, sizeof(float), sizeof(float),
                           "transforms");
}

trc_status trc_instances_move(trc_scene scene, const trc_id *instances, uint64_t instance_count,
                              uint32_t key_count, const float *transforms, uint64_t float_count) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    trc_status status = check_moves(instances, instance_count, key_count, transforms, float_count);
    if (status == TRC_OK)
        status = trc_scene_move_instances(access.scene, instances, instance_count, key_count,
                                          transforms);
    trc_scene_leave(&access);
    return status;
}

trc_status trc_instance_destroy(trc_scene scene, trc_id instance) {
    struct trc_scene_access access;
    TRC_TRY(trc_scene_enter(scene, &access));
    const trc_status status = trc_scene_remove_instance(access.scene, instance);
    trc_scene_leave(&access);
    return status;
}
