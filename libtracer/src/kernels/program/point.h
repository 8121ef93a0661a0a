/* The Point Info node: the ball of a point cloud that the shading point is on. */
#ifndef TRACER_KERNELS_PROGRAM_POINT_H
#define TRACER_KERNELS_PROGRAM_POINT_H

#include "kernels/program/hash.h"
#include "kernels/program/input.h"

/* Of one lane: where the middle is in the world, and the mean of the radii there. */
static void point_at(const struct trc_instance *instance, const struct trc_mesh *mesh,
                     uint32_t point, float time, float position[3], float *radius) {
    float m[TRC_AFFINE_FLOATS], p[3], own, diagonal2 = 0.0f;
    trc_curve_vertex_at(mesh, point, time, p, &own);
    trc_affine_at(instance, time, m);
    for (int i = 0; i < 3; i++) {
        const float *row = m + 4 * i, sum = row[0] + row[1] + row[2];
        position[i] = row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3];
        diagonal2 += sum * sum;
    }
    *radius = own * sqrtf(diagonal2 / 3.0f);
}

/* All 0 on what is no point. */
static void op_point_info(const struct trc_surface *s, vfloat *out) {
    float at[4][TRC_WIDTH] = {{0.0f}};
    int32_t numbers[TRC_WIDTH] = {0};
    uint32_t points = 0;
    for (uint32_t lanes = vm_bits(s->active); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const int32_t id = vi_get(s->instance, lane);
        if (id < 0)
            continue;
        const struct trc_instance *instance = &s->snapshot->instances[id];
        const struct trc_mesh *mesh = s->snapshot->meshes[instance->mesh];
        if (!trc_shape_is_balls(mesh->shape))
            continue;
        uint32_t corners[3];
        float position[3];
        trc_mesh_corners(mesh, (uint32_t)vi_get(s->triangle, lane), corners);
        point_at(instance, mesh, corners[0], vf_get(s->time, lane), position, &at[3][lane]);
        for (int i = 0; i < 3; i++)
            at[i][lane] = position[i];
        numbers[lane] = (int32_t)corners[0];
        points |= 1u << lane;
    }
    v3_write(out + TRC_OP_OUT_AT(POINT_INFO, position),
             v3(vf_load(at[0]), vf_load(at[1]), vf_load(at[2])));
    out[TRC_OP_OUT_AT(POINT_INFO, radius)] = vf_load(at[3]);
    const vuint key[2] = {(vuint)vi_load(numbers), vu_set(0)};
    out[TRC_OP_OUT_AT(POINT_INFO, random)] =
        vf_where(vm_from_bits(points), hash_to_unit(hash_words(2, key)));
}

#endif
