/* Corners of triangles and matrices of instances, for TRC_WIDTH hits at once. */
#ifndef TRACER_KERNELS_TRACE_MESH_FETCH_H
#define TRACER_KERNELS_TRACE_MESH_FETCH_H

#include "kernels/simd/wide_math.h"
#include "model/snapshot.h"

/* 3 corners of 3 coordinates, lane by lane. */
struct trc_corners {
    vvec3 corner[3];
};
/* A 3x4 matrix per lane: columns and translation. */
struct trc_wide_affine {
    vvec3 column[3], origin;
};

/* Key and fraction of trc_key_at for all lanes; key_count >= 2. */
TRC_INLINE vint trc_wide_key(vfloat time, uint32_t key_count, vfloat *fraction) {
    const vfloat x = vf_saturate(time) * vf_set((float)(key_count - 1));
    vint key = vf_to_int(x);
    const vint last = vi_set((int32_t)key_count - 2);
    key = vi_select(vi_lt(last, key), last, key);
    *fraction = x - vi_to_float(key);
    return key;
}
/* a + f * (b - a): see snapshot.h. */
TRC_INLINE vfloat trc_between(vfloat a, vfloat b, vfloat f) { return a + f * (b - a); }
TRC_INLINE vvec3 trc_between3(vvec3 a, vvec3 b, vfloat f) {
    return v3(trc_between(a.x, b.x, f), trc_between(a.y, b.y, f), trc_between(a.z, b.z, f));
}

TRC_INLINE vvec3 trc_transform_point(const struct trc_wide_affine *m, vvec3 p) {
    /* Sums from the left: exact for identities and pure translations of exact sums. */
    return v3(m->column[0].x * p.x + m->column[1].x * p.y + m->column[2].x * p.z + m->origin.x,
              m->column[0].y * p.x + m->column[1].y * p.y + m->column[2].y * p.z + m->origin.y,
              m->column[0].z * p.x + m->column[1].z * p.y + m->column[2].z * p.z + m->origin.z);
}
TRC_INLINE vvec3 trc_transform_vector(const struct trc_wide_affine *m, vvec3 v) {
    return v3(m->column[0].x * v.x + m->column[1].x * v.y + m->column[2].x * v.z,
              m->column[0].y * v.x + m->column[1].y * v.y + m->column[2].y * v.z,
              m->column[0].z * v.x + m->column[1].z * v.y + m->column[2].z * v.z);
}

/* The matrix of key_count keys at the lanes' times: elements are interpolated. */
TRC_INLINE void trc_load_keys(const struct trc_affine *keys, uint32_t key_count, vfloat time,
                              struct trc_wide_affine *m) {
    vfloat e[TRC_AFFINE_FLOATS];
    if (key_count < 2) {
        for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
            e[i] = vf_set(keys[0].m[i]);
    } else {
        vfloat f;
        const vint at = trc_wide_key(time, key_count, &f) * vi_set(TRC_AFFINE_FLOATS);
        for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
            e[i] = trc_between(vf_gather(keys[0].m + i, at, vm_all_set()),
                               vf_gather(keys[1].m + i, at, vm_all_set()), f);
    }
    for (int i = 0; i < 3; i++)
        m->column[i] = v3(e[i], e[4 + i], e[8 + i]);
    m->origin = v3(e[3], e[7], e[11]);
}
TRC_INLINE void trc_load_affine(const struct trc_instance *instance, vfloat time,
                                struct trc_wide_affine *m) {
    trc_load_keys(instance->object_to_world, instance->key_count, time, m);
}

/* 9 floats per lane from an array of 3-vectors by 3 indices (in vectors); stride vectors between
 * keys. */
TRC_INLINE void trc_load_vectors(const float *values, const vint index[3], uint32_t stride,
                                 uint32_t key_count, vfloat time, vmask m,
                                 struct trc_corners *out) {
    if (key_count < 2) {
        for (int k = 0; k < 3; k++)
            out->corner[k] = v3_gather(values, index[k] * vi_set(3), m);
        return;
    }
    vfloat f;
    const vint key = trc_wide_key(time, key_count, &f) * vi_set((int32_t)(3 * stride));
    for (int k = 0; k < 3; k++) {
        const vint at = key + index[k] * vi_set(3);
        out->corner[k] = trc_between3(v3_gather(values, at, m),
                                      v3_gather(values + 3 * (size_t)stride, at, m), f);
    }
}
/* Corners as trc_mesh_corners has them. */
TRC_INLINE void trc_load_indices(const struct trc_mesh *mesh, vint triangle, vmask m,
                                 vint index[3]) {
    if (mesh->strands) {
        index[0] = index[2] = triangle + vi_gather((const int32_t *)mesh->strands, triangle, m);
        index[1] = index[0] + vi_set(!trc_shape_is_balls(mesh->shape));
        return;
    }
    const vint at = triangle * vi_set(3);
    for (int k = 0; k < 3; k++)
        index[k] = vi_gather((const int32_t *)mesh->indices + k, at, m);
}

/* Gathers reach 2^31 floats from their base: whether all of a mesh's arrays lie within. */
TRC_INLINE bool trc_mesh_in_reach(const struct trc_mesh *mesh) {
    const uint64_t vertices = 3ull * mesh->vertex_count * mesh->key_count;
    const uint64_t corners = 9ull * mesh->triangle_count * mesh->key_count;
    return vertices < 0x7fffffffull && corners < 0x7fffffffull;
}

/* ---- one lane at a time, where lanes hit many instances ---- */

static inline void trc_corner_at(const float *values, const uint32_t index[3], uint32_t stride,
                                 uint32_t key_count, float time, float out[9]) {
    uint32_t key;
    float f;
    trc_key_at(time, key_count, &key, &f);
    const float *a = values + 3 * (size_t)stride * key;
    if (key_count < 2) {
        for (int k = 0; k < 3; k++)
            memcpy(out + 3 * k, a + 3 * (size_t)index[k], 3 * sizeof(float));
        return;
    }
    const float *b = a + 3 * (size_t)stride;
    for (int k = 0; k < 3; k++)
        for (int axis = 0; axis < 3; axis++) {
            const size_t i = 3 * (size_t)index[k] + (size_t)axis;
            out[3 * k + axis] = a[i] + f * (b[i] - a[i]);
        }
}
static inline void trc_affine_at(const struct trc_instance *instance, float time,
                                 float out[TRC_AFFINE_FLOATS]) {
    uint32_t key;
    float f;
    trc_key_at(time, instance->key_count, &key, &f);
    const float *a = instance->object_to_world[key].m;
    if (instance->key_count < 2) {
        memcpy(out, a, TRC_AFFINE_FLOATS * sizeof(float));
        return;
    }
    const float *b = instance->object_to_world[key + 1].m;
    for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
        out[i] = a[i] + f * (b[i] - a[i]);
}
/* Of a mesh of curves: position and radius. */
static inline void trc_curve_vertex_at(const struct trc_mesh *mesh, uint32_t vertex, float time,
                                       float position_out[3], float *radius_out) {
    uint32_t key;
    float f;
    trc_key_at(time, mesh->key_count, &key, &f);
    const size_t a = (size_t)key * mesh->vertex_count + vertex;
    const size_t b = mesh->key_count > 1 ? a + mesh->vertex_count : a;
    const float *p = mesh->positions + 3 * a, *q = mesh->positions + 3 * b;
    for (int i = 0; i < 3; i++)
        position_out[i] = p[i] + f * (q[i] - p[i]);
    *radius_out = mesh->radii[a] + f * (mesh->radii[b] - mesh->radii[a]);
}
/* Turns TRC_WIDTH rows of width floats into registers. */
TRC_INLINE vfloat trc_column_of(const float *rows, int width, int column) {
    return vf_gather(rows + column, vi_lane() * vi_set(width), vm_all_set());
}
/* Rows of 9: three corners of a lane. */
TRC_INLINE struct trc_corners trc_corners_of(const float *rows) {
    struct trc_corners c;
    for (int k = 0; k < 3; k++)
        c.corner[k] = v3(trc_column_of(rows, 9, 3 * k), trc_column_of(rows, 9, 3 * k + 1),
                         trc_column_of(rows, 9, 3 * k + 2));
    return c;
}
/* One row of them: the triangle of an instance in the world. */
static inline void trc_world_corners_at(const struct trc_snapshot *snapshot, uint32_t instance,
                                        uint32_t triangle, float time, float out[9]) {
    const struct trc_instance *object = &snapshot->instances[instance];
    const struct trc_mesh *mesh = snapshot->meshes[object->mesh];
    float corner[9], m[TRC_AFFINE_FLOATS];
    uint32_t index[3];
    trc_mesh_corners(mesh, triangle, index);
    trc_corner_at(mesh->positions, index, mesh->vertex_count, mesh->key_count, time, corner);
    trc_affine_at(object, time, m);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            out[3 * k + i] = m[4 * i] * corner[3 * k] + m[4 * i + 1] * corner[3 * k + 1] +
                             m[4 * i + 2] * corner[3 * k + 2] + m[4 * i + 3];
}

/* A float of each active lane's instance: offset, of that member in struct trc_instance. */
static inline vfloat trc_instance_float(const struct trc_snapshot *snapshot, vint instance,
                                        size_t offset, vmask m) {
    float values[TRC_WIDTH] = {0};
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const struct trc_instance *of = &snapshot->instances[vi_get(instance, lane)];
        memcpy(&values[lane], (const char *)of + offset, sizeof *values);
    }
    return vf_load(values);
}

/* The instance of all lanes in m, or -1 when they differ. m not empty. */
TRC_INLINE int32_t trc_uniform_instance(vint instance, vmask m) {
    const int32_t first = vi_get(instance, __builtin_ctz(vm_bits(m)));
    return vm_any(vm_andnot(m, vi_eq(instance, vi_set(first)))) ? -1 : first;
}

#endif
