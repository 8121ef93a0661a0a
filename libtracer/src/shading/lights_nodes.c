/* Lamps with nodes. */
#include <math.h>
#include <string.h>

#include "model/kernels.h"
#include "model/material.h"
#include "shading/lights.h"
#include "shading/vectors.h"

/* What a lamp counts at least, over one that emits white: the places looked at may miss where it is
 * bright. */
#define LEAST_MEAN 1e-3f

/* The inverse of a matrix of 9; zeros where it has none. */
static void invert(const float m[9], float out[9]) {
    float c[3][3];
    trc_cross(m + 3, m + 6, c[0]);
    trc_cross(m + 6, m, c[1]);
    trc_cross(m, m + 3, c[2]);
    const float determinant = trc_dot(m, c[0]);
    const float scale = determinant != 0.0f ? 1.0f / determinant : 0.0f;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            out[3 * i + k] = isfinite(scale) ? c[k][i] * scale : 0.0f;
}

bool trc_lamp_take_nodes(struct trc_light_table *table, const struct trc_snapshot *snapshot,
                         const struct trc_light_options *options, uint32_t light) {
    const uint32_t material = options->light_materials ? options->light_materials[light] : 0;
    struct trc_lamp *lamp = &table->lamps[table->lamp_count];
    if (!material)
        return true;
    const struct trc_material *m = snapshot->materials[material];
    if (!(m->has & TRC_MATERIAL_HAS_EMISSION))
        return false;
    if (!(m->has & TRC_MATERIAL_EMISSION_VARIES)) {
        for (int i = 0; i < 3; i++)
            lamp->radiance[i] *= m->emission[i];
        const float brightness = trc_brightness(lamp->radiance);
        return brightness > 0.0f && brightness < INFINITY;
    }
    const trc_light_desc *desc = &options->lights[light];
    struct trc_lamp_program *program = &table->programs[table->program_count++];
    program->material = material;
    program->random = desc->random;
    program->pass_index = desc->pass_index;
    memcpy(program->color, desc->object_color, sizeof program->color);
    for (int i = 0; i < 3; i++) {
        memcpy(program->to_world + 3 * i, desc->transform + 4 * i, 3 * sizeof(float));
        program->origin[i] = desc->transform[4 * i + 3];
    }
    invert(program->to_world, program->to_light);
    lamp->program = table->program_count;
    return true;
}

float trc_lamp_mean(const struct trc_light_table *table, const struct trc_snapshot *snapshot,
                    uint32_t lamp, const struct trc_light_bound *bound, float reach) {
    float mean[3];
    if (!table->lamps[lamp].program)
        return 1.0f;
    trc_kernels_current()->lamp_measure(snapshot, table, lamp, bound, reach > 0.0f ? reach : 1.0f,
                                        mean);
    const float brightness = trc_brightness(mean);
    return brightness < INFINITY ? fmaxf(brightness, LEAST_MEAN) : 1.0f;
}
