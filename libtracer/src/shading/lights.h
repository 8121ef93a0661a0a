/* Builds the lights of a committed scene (model/lights.h). */
#ifndef TRACER_SHADING_LIGHTS_H
#define TRACER_SHADING_LIGHTS_H

#include "model/lights.h"

struct trc_pool; /* core/pool.h */

struct trc_light_options {
    const trc_light_desc *lights;
    const uint32_t *light_materials; /* into snapshot materials, 0: none; NULL: none has any */
    uint32_t light_count;
    float reach; /* metres across all that is lit: how far light is looked at that changes on its
                    way; 0: 1 */
    uint32_t scatters; /* TRC_MATERIAL_HAS_* of all surfaces, of TRC_MATERIAL_SCATTERS. 0: lamps are
                          seen alone and there is nothing to choose from. Without what is matt, a
                          constant world and emission that is not to be sampled are left to rays */
    const trc_world_desc *world; /* use_sampling, map_resolution, cast_shadow and the sun are read;
                                    NULL stands for 1, 0 and none */
    const struct trc_light_table
        *previous; /* of an earlier snapshot whose world, materials and
                      images are the same: its map is shared; may be NULL */
    struct trc_pool *pool;
    const atomic_uint *cancel; /* non-zero: end soon; may be NULL */
};
static inline bool trc_lights_are_cancelled(const struct trc_light_options *options) {
    return options->cancel && atomic_load(options->cancel);
}

/* Builds the table and sets instance.first_light. Reads snapshot->meshes, instances, materials,
 * images and world, which must be complete; calls trc_kernels_current()->world_evaluate for a world
 * that is not constant, and lamp_measure for lamps that are not. Ownership of *out goes to the
 * caller. TRC_ERROR_OUT_OF_MEMORY and TRC_ERROR_CANCELLED leave nothing behind. Cost: linear in
 * lights, n log n with a tree, over all threads; a map evaluates the world 4 times per cell. */
trc_status trc_light_table_create(const struct trc_snapshot *snapshot,
                                  const struct trc_light_options *options,
                                  struct trc_light_table **out);
/* NULL is fine. */
void trc_light_table_destroy(struct trc_light_table *table);
/* Emissive triangles that are sampled as lights. */
uint64_t trc_light_table_triangle_count(const struct trc_light_table *table);

/* Parts of the above, for shading/lights*.c. */
/* Takes over what the nodes of the descriptor number light emit into the lamp that was made of it,
 * the next of the table, whose memory is there. False for one that they leave dark. */
bool trc_lamp_take_nodes(struct trc_light_table *table, const struct trc_snapshot *snapshot,
                         const struct trc_light_options *options, uint32_t light);
/* What the mean of its nodes scales the lamp's bound by. */
float trc_lamp_mean(const struct trc_light_table *table, const struct trc_snapshot *snapshot,
                    uint32_t lamp, const struct trc_light_bound *bound, float reach);
trc_status trc_light_tree_build(struct trc_light_table *table, struct trc_light_bound *leaves,
                                uint32_t count, uint32_t cut_max,
                                const struct trc_light_options *options);
/* Of the wanted width, at most TRC_MAP_MAX_WIDTH, or a little more: whole blocks. */
trc_status trc_world_map_create(const struct trc_snapshot *snapshot, uint32_t wanted_width,
                                const struct trc_light_options *options,
                                struct trc_world_map **out);
/* Sets map->facings, down and along by its density, which is nowhere 0. */
void trc_world_map_set_chances(struct trc_world_map *map);
void trc_world_map_release(struct trc_world_map *map);

#endif
