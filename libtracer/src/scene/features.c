/* What a scene uses, and its statistics. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "image/image.h"
#include "model/material.h"
#include "scene/commit.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "shading/lamps.h"

static uint32_t material_features(uint32_t has) {
    static const uint32_t pairs[][2] = {
        {TRC_MATERIAL_HAS_SPECULAR, TRC_FEATURE_SPECULAR},
        {TRC_MATERIAL_HAS_GLOSSY, TRC_FEATURE_GLOSSY},
        {TRC_MATERIAL_HAS_REFRACTION, TRC_FEATURE_REFRACTION},
        {TRC_MATERIAL_HAS_TRANSPARENCY, TRC_FEATURE_TRANSPARENCY},
        {TRC_MATERIAL_HAS_EMISSION, TRC_FEATURE_EMISSIVE_MESHES},
        {TRC_MATERIAL_HAS_PROGRAM, TRC_FEATURE_PROGRAMS},
        {TRC_MATERIAL_HAS_TEXTURE, TRC_FEATURE_TEXTURES},
        {TRC_MATERIAL_READS_PIXEL, TRC_FEATURE_SLOPES},
        {TRC_MATERIAL_HAS_PORTAL, TRC_FEATURE_PORTALS},
    };
    uint32_t features = 0;
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        if (has & pairs[i][0])
            features |= pairs[i][1];
    }
    return features;
}

static uint32_t surface_features(const struct trc_material *m) {
    const struct trc_material *shadow = m->shadow ? m->shadow : m;
    const uint32_t passed = trc_material_is_clear(m) ? shadow->has : 0;
    uint32_t features = material_features(m->has);
    if (passed & TRC_MATERIAL_READS_PIXEL)
        features |= TRC_FEATURE_SHADOW_SLOPES;
    if ((passed & TRC_MATERIAL_READS_LIGHT_PATH) ||
        trc_material_is_clear(m) != trc_material_shadows_transparent(m))
        features |= TRC_FEATURE_RAY_KINDS;
    return features;
}

/* Whether shadow rays see an instance and those of some lobe do not, or the other way. */
static bool tells_shadow_rays(const struct trc_instance *instance) {
    const uint32_t lobes = TRC_VISIBLE_DIFFUSE | TRC_VISIBLE_GLOSSY | TRC_VISIBLE_TRANSMISSION;
    return (instance->visibility & lobes) !=
           (instance->visibility & TRC_VISIBLE_SHADOW ? lobes : 0u);
}

/* Meshes count whether or not the camera's shutter is open: queries have times of their own. */
static uint32_t instance_features(const struct trc_snapshot *s) {
    uint32_t features = 0;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        if ((instance->visibility & TRC_VISIBLE_ALL) != TRC_VISIBLE_ALL)
            features |= TRC_FEATURE_VISIBILITY;
        if (tells_shadow_rays(instance))
            features |= TRC_FEATURE_RAY_KINDS;
        if (!instance->visibility)
            continue;
        if (instance->light_exclude || instance->shadow_class)
            features |= TRC_FEATURE_LINKS;
        if (instance->visibility & TRC_VISIBLE_UNBLOCKED)
            features |= TRC_FEATURE_SHADOW_CATCHERS;
        if (instance->terminator_cosine != TRC_TERMINATOR_COSINE ||
            instance->terminator_turn != 1.0f)
            features |= TRC_FEATURE_SHADOW_TERMINATORS;
        if (instance->key_count > 1)
            features |= TRC_FEATURE_OBJECT_MOTION;
        if (s->meshes[instance->mesh]->key_count > 1)
            features |= TRC_FEATURE_DEFORMATION;
        if (s->meshes[instance->mesh]->strands)
            features |= TRC_FEATURE_CURVES;
        for (uint32_t m = 0; m < instance->material_count; m++)
            features |= surface_features(s->materials[instance->materials[m]]);
    }
    return features;
}

static bool is_instanced(const struct trc_scene_state *scene) {
    const struct trc_store *store = &scene->meshes;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        if (((const struct trc_scene_mesh *)store->slots[i].object)->use_count > 1)
            return true;
    }
    return false;
}

static uint32_t light_features(const struct trc_scene_state *scene, const struct trc_snapshot *s) {
    const struct trc_store *store = &scene->lights;
    uint32_t features = 0;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END; i = trc_store_next(store, i)) {
        const trc_light_desc *light = store->slots[i].object;
        const uint32_t has = s->materials[trc_scene_material_index(scene, light->material)]->has;
        features |= TRC_FEATURE_LIGHTS;
        if (light->light_exclude || light->shadow_exclude)
            features |= TRC_FEATURE_LINKS;
        if (light->material)
            features |= material_features(has) & (TRC_FEATURE_PROGRAMS | TRC_FEATURE_TEXTURES);
        struct trc_lamp lamp;
        trc_lamp_make(light, &lamp);
        if (!(lamp.flags & TRC_LAMP_DELTA))
            features |= TRC_FEATURE_AREA_LIGHTS;
    }
    return features;
}

static uint32_t view_features(const struct trc_snapshot *s) {
    const struct trc_world *world = &s->world;
    uint32_t features = 0;
    if (s->has_camera) {
        if (s->camera.aperture_radius > 0.0f)
            features |= TRC_FEATURE_LENS;
        if (s->camera.has_motion && s->camera.key_count > 1)
            features |= TRC_FEATURE_CAMERA_MOTION;
    }
    if (world->ao_factor > 0.0f)
        features |= TRC_FEATURE_AMBIENT_OCCLUSION;
    if (world->material == UINT32_MAX)
        return features;
    const uint32_t has = s->materials[world->material]->has;
    const float *radiance = world->radiance;
    if (!world->is_constant) {
        /* Programs and textures of the world are looked up like those of surfaces. */
        features |= TRC_FEATURE_ENVIRONMENT |
                    (material_features(has) & (TRC_FEATURE_PROGRAMS | TRC_FEATURE_TEXTURES));
        if (has & TRC_MATERIAL_HAS_TEXTURE)
            features |= TRC_FEATURE_ENVIRONMENT_IMAGE;
    } else if (radiance[0] != 0.0f || radiance[1] != 0.0f || radiance[2] != 0.0f) {
        features |= TRC_FEATURE_ENVIRONMENT;
    }
    return features;
}

uint32_t trc_find_branches(const struct trc_snapshot *s) {
    uint32_t count = 1;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const struct trc_instance *instance = &s->instances[i];
        for (uint32_t m = 0; m < instance->material_count; m++) {
            const uint32_t own = s->materials[instance->materials[m]]->branch_count;
            count = own > count ? own : count;
        }
    }
    return count;
}

uint32_t trc_find_features(const struct trc_scene_state *scene, const struct trc_snapshot *s) {
    return instance_features(s) | light_features(scene, s) | view_features(s) |
           (is_instanced(scene) ? (uint32_t)TRC_FEATURE_INSTANCES : 0u);
}

void trc_count_stats(const struct trc_scene_state *scene, struct trc_snapshot *s) {
    trc_scene_stats *stats = &s->stats;
    stats->struct_size = sizeof *stats;
    stats->features = s->features;
    stats->mesh_count = s->mesh_count;
    stats->instance_count = s->instance_count;
    stats->light_count = scene->lights.living_count;
    stats->material_count = scene->materials.living_count;
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        stats->triangle_count += s->meshes[i]->triangle_count;
        stats->geometry_bytes += trc_geometry_bytes(s->meshes[i]);
    }
    for (uint32_t i = 0; i < s->instance_count; i++) {
        stats->instanced_triangle_count += s->meshes[s->instances[i].mesh]->triangle_count;
    }
    for (uint32_t i = 0; i < s->image_count; i++) {
        if (s->images[i])
            stats->image_bytes += trc_image_bytes(s->images[i]);
    }
}

void trc_warn(struct trc_snapshot_block *block, const char *format, ...) {
    const size_t used = strlen(block->warnings), room = sizeof block->warnings - used;
    va_list arguments;
    va_start(arguments, format);
    const int size = vsnprintf(block->warnings + used, room, format, arguments);
    va_end(arguments);
    const bool fits = size >= 0 && (size_t)size + 1 < room; /* and the end of the line */
    if (fits)
        block->warnings[used + (size_t)size] = '\n';
    block->warnings[used + (fits ? (size_t)size + 1 : 0)] = '\0';
}
