#include "aim.h"

#include <math.h>
#include <stdbool.h>

#define PACKET_RAYS 64

void aim_vertex(const struct mesh *mesh, uint32_t vertex, float time, float out[3]) {
    const float *a = mesh->positions + 3 * (size_t)vertex, *b = a;
    double f = 0.0;
    if (mesh->key_count > 1) {
        const double x = (double)time * (mesh->key_count - 1);
        const uint32_t key = x < mesh->key_count - 1 ? (uint32_t)x : mesh->key_count - 2;
        f = x - key;
        a = mesh_key(mesh, key) + 3 * (size_t)vertex;
        b = mesh_key(mesh, key + 1) + 3 * (size_t)vertex;
    }
    for (int axis = 0; axis < 3; axis++)
        out[axis] = (float)((1.0 - f) * a[axis] + f * b[axis]);
}

void aim_target(const struct aim *aim, struct rng *rng, float time, float target_out[3]) {
    const struct mesh *mesh = aim->mesh;
    const uint32_t *index = mesh->indices + 3 * (size_t)rng_below(rng, mesh->triangle_count);
    const uint32_t corner = rng_below(rng, 3);
    aim_vertex(mesh, index[corner], time, target_out);
    if (aim->at == AIM_VERTICES || (aim->at == AIM_BOTH && (rng_bits(rng) & 1)))
        return;
    float q[3];
    aim_vertex(mesh, index[(corner + 1) % 3], time, q);
    for (int axis = 0; axis < 3; axis++)
        target_out[axis] = 0.5f * (target_out[axis] + q[axis]);
}

static void origin_of(const struct aim *aim, struct rng *rng, float o[3]) {
    for (int axis = 0; axis < 3; axis++)
        o[axis] = aim->inside[axis] + rng_range(rng, -aim->reach, aim->reach);
}

void aim_rays(const struct aim *aim, struct rng *rng, uint32_t count, struct ray_set *rays) {
    const bool moves = aim->mesh->key_count > 1;
    float o[3] = {0}, target[3], begin = 0.0f, length = 0.0f;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t packet = i / PACKET_RAYS;
        if (i % PACKET_RAYS == 0) {
            origin_of(aim, rng, o);
            begin = rng_unit(rng);
            length = packet % 3 == 0 ? 0.0f : packet % 3 == 1 ? 1.0f / 16.0f : 1.0f;
        } else if (packet & 1) {
            origin_of(aim, rng, o);
        }
        const float time = fminf(1.0f, (length < 1.0f ? begin : 0.0f) + length * rng_unit(rng));
        aim_target(aim, rng, moves ? time : 0.0f, target);
        ray_set_aim(rays, o, target, moves ? time : 0.0f);
    }
}
