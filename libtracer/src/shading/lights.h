/* Builds the lights of a committed scene (model/lights.h). */
#ifndef TRACER_SHADING_LIGHTS_H
#define TRACER_SHADING_LIGHTS_H

#include "model/lights.h"

struct trc_pool; /* core/pool.h */

struct trc_light_options {
    const trc_light_desc *lights;
    uint32_t light_count;
    uint32_t scatters; /* TRC_MATERIAL_HAS_* of all surfaces, of TRC_MATERIAL_SCATTERS. 0: lamps are
                          seen alone and there is nothing to choose from. Without what is matt, a
                          constant world and emission that is not to be sampled are left to rays */
    const trc_world_desc *world; /* use_sampling, map_resolution and the sun are read; NULL stands
                                    for 1, 0 and none */
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
 * that is not constant. Ownership of *out goes to the caller. TRC_ERROR_OUT_OF_MEMORY and
 * TRC_ERROR_CANCELLED leave nothing behind. Cost: linear in lights, n log n with a tree, over all
 * threads; a map evaluates the world 4 times per cell. */
trc_status trc_light_table_create(const struct trc_snapshot *snapshot,
                                  const struct trc_light_options *options,
                                  struct trc_light_table **out);
/* NULL is fine. */
void trc_light_table_destroy(struct trc_light_table *table);
/* Emissive triangles that are sampled as lights. */
uint64_t trc_light_table_triangle_count(const struct trc_light_table *table);

/* Parts of the above, for shading/lights*.c. */
trc_status trc_light_tree_build(struct trc_light_table *table, struct trc_light_bound *leaves,
                                uint32_t count, uint32_t cut_max,
                                const struct trc_light_options *options);
trc_status trc_world_map_create(const struct trc_snapshot *snapshot, uint32_t width,
                                const struct trc_light_options *options,
                                struct trc_world_map **out);
void trc_world_map_release(struct trc_world_map *map);

#endif
