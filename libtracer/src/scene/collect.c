/* From the editable scene to the arrays of a snapshot. */
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "image/image.h"
#include "model/material.h"
#include "scene/affine.h"
#include "scene/commit.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "shading/compile.h"

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the scene");
}

/* An image keeps its slot for life, so materials name images by slot; NULL: destroyed, or without
 * contents. */
trc_status trc_collect_images(const struct trc_scene_state *scene, struct trc_snapshot *s) {
    const struct trc_store *store = &scene->images;
    s->images = trc_alloc_zeroed(store->slot_count, sizeof *s->images);
    if (!s->images)
        return no_memory();
    s->image_count = store->slot_count;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        struct trc_image *image = store->slots[i].object;
        s->images[i] = image->level_count ? trc_image_retain(image) : NULL;
    }
    return TRC_OK;
}

/* Number 0, and every slot without a material, is the default. */
trc_status trc_collect_materials(const struct trc_scene_state *scene, struct trc_snapshot *s) {
    const struct trc_store *store = &scene->materials;
    const uint32_t count = store->slot_count + 1;
    s->materials = trc_alloc_zeroed(count, sizeof *s->materials);
    if (!s->materials)
        return no_memory();
    s->material_count = count;
    for (uint32_t i = 0; i < count; i++) {
        void *material = i ? store->slots[i - 1].object : NULL;
        s->materials[i] = trc_material_retain(material ? material : scene->default_material);
    }
    return TRC_OK;
}

trc_status trc_collect_meshes(struct trc_scene_state *scene, struct trc_snapshot *s) {
    const struct trc_store *store = &scene->meshes;
    s->meshes = trc_alloc_zeroed(store->living_count, sizeof *s->meshes);
    if (!s->meshes)
        return no_memory();
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        struct trc_scene_mesh *mesh = store->slots[i].object;
        TRC_TRY(trc_geometry_finish(mesh->geometry, scene->pool, &scene->cancel));
        mesh->index = s->mesh_count;
        s->meshes[s->mesh_count++] = trc_geometry_retain(mesh->geometry);
        if (atomic_load(&scene->cancel)) {
            return trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
        }
    }
    return TRC_OK;
}

/* ---- instances ---- */

/* Arrays behind the instances of a snapshot. */
struct instance_data {
    struct trc_affine *transforms; /* for each instance its keys, then their inverses */
    uint32_t *materials;
    float *values;
};

static void destroy_instance_data(void *object) {
    struct instance_data *data = object;
    trc_free(data->transforms);
    trc_free(data->materials);
    trc_free(data->values);
    trc_free(data);
}

static trc_status create_instance_data(const struct trc_store *store,
                                       struct trc_shared **shared_out) {
    size_t transforms = 0, materials = 0, values = 0;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        const struct trc_scene_instance *source = store->slots[i].object;
        transforms += (size_t)2 * source->key_count;
        materials += source->material_count ? source->material_count : 1;
        values += source->value_count;
    }
    struct instance_data *data = trc_alloc_zeroed(1, sizeof *data);
    if (!data)
        return no_memory();
    data->transforms = trc_alloc(transforms, sizeof *data->transforms);
    data->materials = trc_alloc(materials, sizeof *data->materials);
    data->values = trc_alloc(values, sizeof *data->values);
    struct trc_shared *shared = NULL;
    if (data->transforms && data->materials && data->values)
        shared = trc_shared_create(data, destroy_instance_data);
    if (!shared) {
        destroy_instance_data(data);
        return no_memory();
    }
    *shared_out = shared;
    return TRC_OK;
}

/* Keys that are all equal are one: an instance that stands still costs no motion. */
static uint32_t distinct_keys(const struct trc_scene_instance *source) {
    for (uint32_t key = 1; key < source->key_count; key++) {
        if (memcmp(&source->transforms[0], &source->transforms[key], sizeof(struct trc_affine)) !=
            0) {
            return source->key_count;
        }
    }
    return 1;
}

/* Fills the inverses of an instance's keys and tells whether one is thin. False where nothing would
 * be seen: none of them spans a plane, or one cannot be used at all. */
static bool invert_keys(struct trc_instance *instance, struct trc_affine *inverses) {
    bool shown = false;
    for (uint32_t key = 0; key < instance->key_count; key++) {
        const struct trc_affine *to_world = &instance->object_to_world[key];
        const bool thin = trc_affine_is_thin(to_world);
        const bool inverted = thin ? trc_affine_invert_thin(to_world, &inverses[key])
                                   : trc_affine_invert(to_world, &inverses[key]);
        if (!inverted && !trc_affine_is_finite(to_world))
            return false;
        if (!inverted)
            inverses[key] = trc_affine_identity;
        shown = shown || inverted;
        instance->is_thin = instance->is_thin || !inverted || thin;
    }
    return shown;
}

/* Fills transforms and inverses. A transform that maps all to a line or a point hides the instance:
 * it keeps its place, as places are what queries report, but no ray sees it. */
static void place(struct trc_instance *instance, const struct trc_scene_instance *source,
                  struct trc_affine *transforms) {
    const uint32_t key_count = distinct_keys(source);
    struct trc_affine *inverses = transforms + key_count;
    instance->key_count = key_count;
    instance->object_to_world = transforms;
    instance->world_to_object = inverses;
    memcpy(transforms, source->transforms, key_count * sizeof *transforms);
    if (!invert_keys(instance, inverses)) {
        transforms[0] = transforms[1] = trc_affine_identity;
        instance->world_to_object = transforms + 1;
        instance->key_count = 1;
        instance->visibility = 0;
        instance->is_thin = 0;
    }
    instance->flips = trc_affine_flips(&transforms[0]);
    instance->is_identity = instance->key_count == 1 && trc_affine_is_identity(&transforms[0]);
    instance->world_normals = (source->flags & TRC_INSTANCE_WORLD_NORMALS) &&
                              instance->key_count == 1 && !trc_affine_keeps_angles(&transforms[0]);
}

/* What sees an instance; an unblocked ray sees catchers alone. */
static uint32_t visibility_of(const struct trc_scene_instance *source) {
    if (!(source->flags & TRC_INSTANCE_SHADOW_CATCHER) || !source->visibility)
        return source->visibility;
    return source->visibility | source->visibility << TRC_UNBLOCKED_SHIFT | TRC_VISIBLE_UNBLOCKED;
}

/* Gives a shadow_exclude its class. False where none is left. */
static bool add_class(struct trc_snapshot *s, uint64_t excluded) {
    if (!excluded || trc_shadow_class_of(s, excluded))
        return true;
    if (s->shadow_class_count == TRC_MAX_SHADOW_CLASSES)
        return false;
    s->shadow_classes[s->shadow_class_count++] = excluded;
    return true;
}

/* The shadow classes of all lights and instances. */
static void find_classes(const struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    const struct trc_store *lights = &scene->lights, *instances = &scene->instances;
    uint32_t failed = 0;
    for (uint32_t i = trc_store_first(lights); i != TRC_STORE_END; i = trc_store_next(lights, i)) {
        const trc_light_desc *light = lights->slots[i].object;
        failed += !add_class(&block->snapshot, light->shadow_exclude);
    }
    for (uint32_t i = trc_store_first(instances); i != TRC_STORE_END;
         i = trc_store_next(instances, i)) {
        const struct trc_scene_instance *instance = instances->slots[i].object;
        failed += !add_class(&block->snapshot, instance->shadow_exclude);
    }
    if (failed)
        trc_warn(block,
                 "%u lights are blocked by everything: there are more than %d sets of blockers",
                 failed, TRC_MAX_SHADOW_CLASSES);
}

/* Which lights an instance blocks, and whether it is one of those that rays look for. */
static uint32_t linked_visibility(const struct trc_snapshot *s,
                                  const struct trc_instance *instance) {
    if (!instance->visibility)
        return 0;
    uint32_t bits = instance->shadow_class ? TRC_VISIBLE_EMITTER : 0;
    for (uint32_t i = 0; (instance->visibility & TRC_VISIBLE_SHADOW) && i < s->shadow_class_count;
         i++)
        bits |= (uint32_t)(~s->shadow_classes[i] >> instance->shadow_set & 1)
                << (TRC_SHADOW_CLASS_SHIFT + i);
    return bits;
}

/* Marks what hides emitters from rays that look for them: instances that no material lets shadow
 * rays through and that are nobody's blockers. The instances may be those of a former snapshot,
 * whose materials were others. */
static void mark_solid(struct trc_snapshot *s) {
    for (uint32_t i = 0; s->shadow_class_count && i < s->instance_count; i++) {
        struct trc_instance *instance = &s->instances[i];
        bool is_solid = instance->visibility && instance->shadow_set == 0;
        for (uint32_t m = 0; m < instance->material_count; m++)
            is_solid &= !trc_material_shadows_transparent(s->materials[instance->materials[m]]);
        instance->visibility &= ~(uint32_t)TRC_VISIBLE_SOLID;
        instance->visibility |= is_solid ? TRC_VISIBLE_SOLID : 0;
    }
}

static uint64_t fill_instances(const struct trc_scene_state *scene,
                               const struct instance_data *data, struct trc_snapshot *s) {
    const struct trc_store *store = &scene->instances;
    struct trc_affine *transforms = data->transforms;
    uint32_t *materials = data->materials;
    float *values = data->values;
    uint64_t hidden = 0;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        const struct trc_scene_instance *source = store->slots[i].object;
        const struct trc_scene_mesh *mesh = trc_store_get(&scene->meshes, source->mesh);
        struct trc_instance *instance = &s->instances[s->instance_count++];
        const uint32_t material_count = source->material_count ? source->material_count : 1;
        *instance = (struct trc_instance){
            .mesh = mesh->index,
            .visibility = visibility_of(source),
            .material_count = material_count,
            .materials = materials,
            .value_count = source->value_count,
            .values = values,
            .pass_index = source->pass_index,
            .random = source->random,
            .cryptomatte_object = source->cryptomatte_object,
            .cryptomatte_asset = source->cryptomatte_asset,
            .light_group = source->light_group,
            .light_set = source->light_set,
            .shadow_set = source->shadow_set,
            .light_exclude = source->light_exclude,
            .shadow_class = trc_shadow_class_of(s, source->shadow_exclude),
            .terminator_cosine = source->shadow_terminator_geometry,
            .terminator_turn = 1.0f / (1.0f - 0.5f * source->shadow_terminator_shading),
            .ao_distance = source->ao_distance,
            .first_light = UINT32_MAX,
            .keeps_shape = (source->flags & TRC_INSTANCE_KEEPS_SHAPE) != 0,
        };
        memcpy(instance->color, source->color, sizeof instance->color);
        for (uint32_t m = 0; m < material_count; m++) {
            const trc_id id = source->material_count ? source->materials[m] : 0;
            materials[m] = trc_scene_material_index(scene, id);
        }
        place(instance, source, transforms);
        if (instance->is_thin && mesh->geometry->strands)
            instance->visibility = instance->is_thin = 0; /* rays have no cross-section there */
        hidden += !instance->visibility && source->visibility;
        instance->visibility |= linked_visibility(s, instance);
        transforms += (size_t)2 * source->key_count;
        materials += material_count;
        memcpy(values, source->values, source->value_count * sizeof *values);
        values += source->value_count;
    }
    return hidden;
}

trc_status trc_collect_instances(const struct trc_scene_state *scene,
                                 const struct trc_snapshot_block *former,
                                 struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    const struct trc_store *store = &scene->instances;
    s->instances = trc_alloc(store->living_count, sizeof *s->instances);
    if (!s->instances)
        return no_memory();
    if (former && !(scene->changed & (TRC_CHANGED_MESHES | TRC_CHANGED_INSTANCES))) {
        block->instance_data = trc_shared_retain(former->instance_data);
        s->instance_count = former->snapshot.instance_count;
        if (s->instance_count) {
            memcpy(s->instances, former->snapshot.instances,
                   s->instance_count * sizeof *s->instances);
        }
        memcpy(s->shadow_classes, former->snapshot.shadow_classes, sizeof s->shadow_classes);
        s->shadow_class_count = former->snapshot.shadow_class_count;
        s->stats.skipped_instance_count = former->snapshot.stats.skipped_instance_count;
        mark_solid(s);
        return TRC_OK;
    }
    TRC_TRY(create_instance_data(store, &block->instance_data));
    find_classes(scene, block);
    s->stats.skipped_instance_count = fill_instances(scene, block->instance_data->object, s);
    mark_solid(s);
    return TRC_OK;
}

/* ---- camera and world ---- */

void trc_collect_view(const struct trc_scene_state *scene, struct trc_snapshot_block *block) {
    struct trc_snapshot *s = &block->snapshot;
    block->camera = trc_shared_retain(scene->camera);
    s->has_camera = scene->camera != NULL;
    if (scene->camera)
        s->camera = *(const struct trc_camera *)scene->camera->object;

    const trc_world_desc *desc = &scene->world;
    const uint32_t index = trc_scene_material_index(scene, desc->material);
    s->world = (struct trc_world){
        .material = index ? index : UINT32_MAX,
        .visibility = desc->visibility | TRC_VISIBLE_UNBLOCKED,
        .is_constant = 1,
        .ao_distance = desc->ao_distance,
        .ao_factor = desc->ao_factor,
        .ao_method = desc->ao_method,
        .light_group = desc->light_group,
    };
    if (!index)
        return;
    const struct trc_material *material = s->materials[index];
    s->world.is_constant = !(material->has & TRC_MATERIAL_EMISSION_VARIES);
    if (s->world.is_constant) {
        memcpy(s->world.radiance, material->emission, sizeof s->world.radiance);
    }
}
