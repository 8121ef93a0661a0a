/* Rays in the object space of an instance. */
#ifndef TRACER_KERNELS_TRACE_OBJECT_RAYS_H
#define TRACER_KERNELS_TRACE_OBJECT_RAYS_H

#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/packet.h"

/* The matrix of each lane's time, and rows of the inverse of its linear part: the key's, or that of
 * the interpolated matrix. */
TRC_INLINE void trc_instance_matrices(const struct trc_instance *instance, vfloat time,
                                      vfloat m[TRC_AFFINE_FLOATS], vfloat inverse[3][3]) {
    if (instance->key_count < 2) {
        for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
            m[k] = vf_set(instance->object_to_world->m[k]);
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 3; k++)
                inverse[r][k] = vf_set(instance->world_to_object->m[4 * r + k]);
        return;
    }
    vfloat f;
    const vint at = trc_wide_key(time, instance->key_count, &f) * vi_set(TRC_AFFINE_FLOATS);
    const float *base = instance->object_to_world->m;
    for (int k = 0; k < TRC_AFFINE_FLOATS; k++)
        m[k] = trc_between(vf_gather(base + k, at, vm_all_set()),
                           vf_gather(base + TRC_AFFINE_FLOATS + k, at, vm_all_set()), f);
    const vvec3 r0 = v3(m[0], m[1], m[2]), r1 = v3(m[4], m[5], m[6]), r2 = v3(m[8], m[9], m[10]);
    const vvec3 c0 = v3_cross(r1, r2), c1 = v3_cross(r2, r0), c2 = v3_cross(r0, r1);
    const vfloat inv_det = vf_set(1.0f) / v3_dot(r0, c0);
    const vfloat rows[3][3] = {{c0.x, c1.x, c2.x}, {c0.y, c1.y, c2.y}, {c0.z, c1.z, c2.z}};
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++)
            inverse[r][k] = rows[r][k] * inv_det;
}

TRC_INLINE vfloat trc_row(const vfloat m[3], vfloat x, vfloat y, vfloat z) {
    return m[0] * x + m[1] * y + m[2] * z;
}

/* The rays of mask in an instance's object space; distances keep their meaning.
 *
 * What an origin's image is off by, seen from the world, does not depend on the matrix: the inverse
 * is rounded, so its product is a first guess, and what is left of the way from the matrix' origin
 * is taken through it once more. With q = |M| |image|, in half-ulps: way 1 q, the rest 3 q
 * (products, two sums; the third leaves little), the image itself 1 q. Without that step rays meet
 * the surface that they leave, .8 % of them at worst, where instances are turned and far away. */
static inline void trc_packet_to_object(const struct trc_instance *instance,
                                        const struct trc_packet *p, uint64_t mask,
                                        struct trc_packet *out) {
    for (int c = 0; c < TRC_PACKET_CHUNKS; c++) {
        if (!trc_chunk_bits(mask, c))
            continue;
        const int i = c * TRC_WIDTH;
        vfloat m[TRC_AFFINE_FLOATS], inverse[3][3], way[3], guess[3], rest[3];
        trc_instance_matrices(instance, vf_load(&p->time[i]), m, inverse);
        for (int r = 0; r < 3; r++)
            way[r] = vf_load(&p->o[r][i]) - m[4 * r + 3];
        for (int r = 0; r < 3; r++)
            guess[r] = trc_row(inverse[r], way[0], way[1], way[2]);
        for (int r = 0; r < 3; r++)
            rest[r] =
                way[r] - m[4 * r] * guess[0] - m[4 * r + 1] * guess[1] - m[4 * r + 2] * guess[2];
        const vfloat dx = vf_load(&p->d[0][i]), dy = vf_load(&p->d[1][i]),
                     dz = vf_load(&p->d[2][i]);
        for (int r = 0; r < 3; r++) {
            vf_store(&out->o[r][i], guess[r] + trc_row(inverse[r], rest[0], rest[1], rest[2]));
            vf_store(&out->d[r][i], trc_row(inverse[r], dx, dy, dz));
        }
        vf_store(&out->tmin[i], vf_load(&p->tmin[i]));
        vf_store(&out->t[i], vf_load(&p->t[i]));
        vf_store(&out->time[i], vf_load(&p->time[i]));
    }
    out->visibility = p->visibility;
    out->left = p->left;
    out->skip_transparent = p->skip_transparent;
    out->common_origin = p->common_origin && instance->key_count < 2;
}

#endif
