/* Scenes of lights for tests, made by hand: no tree, no geometry but emissive triangles. */
#ifndef LIGHT_SCENE_H
#define LIGHT_SCENE_H

#include <math.h>
#include <string.h>

#include "core/pool.h"
#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"
#include "shading/lights.h"
#include "wide_test.h"

#define MESH_TRIANGLES 600
#define EVEN_RADIANCE 2.0f

struct scene {
    struct trc_snapshot snapshot;
    struct trc_light_table *table;
    struct trc_mesh mesh, *meshes[1];
    struct trc_instance instance;
    struct trc_affine to_world[2];
    struct trc_material material, plain, *materials[2];
    uint32_t slots[2];
    float positions[2 * 9 * MESH_TRIANGLES];
    uint32_t indices[3 * MESH_TRIANGLES];
    uint16_t material_index[MESH_TRIANGLES];
};

static const struct trc_affine identity = {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0}};

static inline void scene_begin(struct scene *s) {
    memset(s, 0, sizeof *s);
    s->meshes[0] = &s->mesh;
    s->materials[0] = &s->material;
    s->materials[1] = &s->plain;
    s->slots[1] = 1;
    s->mesh.key_count = 1;
    s->mesh.positions = s->positions;
    s->mesh.indices = s->indices;
    s->mesh.material_index = s->material_index;
    s->to_world[0] = s->to_world[1] = identity;
    s->instance.key_count = 1;
    s->instance.object_to_world = s->to_world;
    s->instance.world_to_object = s->to_world;
    s->instance.visibility = TRC_VISIBLE_ALL;
    s->instance.materials = s->slots;
    s->instance.material_count = 2;
    s->snapshot.meshes = s->meshes;
    s->snapshot.materials = s->materials;
    s->snapshot.instances = &s->instance;
    s->snapshot.mesh_count = 1;
    s->snapshot.material_count = 2;
    s->snapshot.world.material = UINT32_MAX;
    s->snapshot.world.visibility = TRC_VISIBLE_ALL;
    s->snapshot.world.is_constant = 1;
}
/* World of radiance EVEN_RADIANCE. */
static inline void scene_begin_in_even_world(struct scene *s) {
    scene_begin(s);
    s->snapshot.world.material = 1;
    for (int i = 0; i < 3; i++)
        s->snapshot.world.radiance[i] = EVEN_RADIANCE;
}
static inline void scene_emit(struct scene *s, float r, float g, float b) {
    s->material.has = TRC_MATERIAL_HAS_EMISSION;
    s->material.emission[0] = r;
    s->material.emission[1] = g;
    s->material.emission[2] = b;
}
static inline void scene_triangle(struct scene *s, const float corners[9], uint16_t material) {
    const uint32_t n = s->mesh.triangle_count++;
    memcpy(s->positions + 9 * n, corners, 9 * sizeof(float));
    for (uint32_t k = 0; k < 3; k++)
        s->indices[3 * n + k] = 3 * n + k;
    s->material_index[n] = material;
    s->mesh.vertex_count = 3 * s->mesh.triangle_count;
    s->snapshot.instance_count = 1;
}
static inline void scene_commit_as(struct scene *s, const trc_light_desc *lights, uint32_t count,
                                   uint32_t scatters) {
    struct trc_pool *pool;
    assert_int_equal(trc_pool_create(2, &pool), TRC_OK);
    const struct trc_light_options options = {
        .lights = lights, .light_count = count, .scatters = scatters, .pool = pool};
    assert_int_equal(trc_light_table_create(&s->snapshot, &options, &s->table), TRC_OK);
    trc_pool_destroy(pool);
    s->snapshot.lights = s->table;
}
static inline void scene_commit(struct scene *s, const trc_light_desc *lights, uint32_t count) {
    scene_commit_as(s, lights, count, TRC_MATERIAL_SCATTERS);
}
static inline void scene_end(struct scene *s) { trc_light_table_destroy(s->table); }

/* A lamp of 100 W at height z above the origin, shining down. */
static inline trc_light_desc lamp(uint32_t type, float x, float y, float z) {
    trc_light_desc d;
    memset(&d, 0, sizeof d);
    d.struct_size = sizeof d;
    d.type = type;
    d.transform[0] = d.transform[5] = d.transform[10] = 1.0f;
    d.transform[3] = x;
    d.transform[7] = y;
    d.transform[11] = z;
    d.color[0] = d.color[1] = d.color[2] = 1.0f;
    d.strength = 100.0f;
    d.size_x = d.size_y = 1.0f;
    d.spread = 3.14159265f;
    d.spot_angle = 3.0f;
    d.visibility = TRC_VISIBLE_ALL;
    d.cast_shadow = d.use_mis = 1;
    return d;
}

static inline struct trc_surface receiver(const struct scene *scene, double x, double y, double z) {
    struct trc_surface s;
    memset(&s, 0, sizeof s);
    s.snapshot = &scene->snapshot;
    s.active = vm_all_set();
    s.p = v3(vf_set((float)x), vf_set((float)y), vf_set((float)z));
    s.n = s.ng = v3(vf_zero(), vf_zero(), vf_one());
    return s;
}

/* Density of light sampling that trc_light_hit weighs with, from the weight it gives. */
static inline double implied_pdf(double seen, double radiance, double pb) {
    const double w = seen / radiance;
    return pb * sqrt(fmax(1.0 / w - 1.0, 0.0));
}

#endif
