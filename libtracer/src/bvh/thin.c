#include "bvh/thin.h"

#include <string.h>

#include "core/core.h"

/* Times at which both have keys, as far as there is room. */
static uint32_t common_keys(uint32_t a, uint32_t b) {
    if (a < 2 || b < 2)
        return a > b ? a : b;
    uint32_t count = a;
    while ((count - 1) % (b - 1) != 0 && count + a - 1 <= TRC_MAX_KEYS)
        count += a - 1;
    return count;
}

static double between(double a, double b, double f) { return a + f * (b - a); }

/* Row-major, 3x4. */
static void transform_at(const struct trc_instance *instance, float time,
                         double m[TRC_AFFINE_FLOATS]) {
    uint32_t key;
    float f;
    trc_key_at(time, instance->key_count, &key, &f);
    const float *a = instance->object_to_world[key].m;
    const float *b = instance->object_to_world[key + (instance->key_count > 1)].m;
    for (int i = 0; i < TRC_AFFINE_FLOATS; i++)
        m[i] = between(a[i], b[i], f);
}

static void place_vertices(const struct trc_mesh *mesh, float time,
                           const double m[TRC_AFFINE_FLOATS], float *positions) {
    uint32_t key;
    float f;
    trc_key_at(time, mesh->key_count, &key, &f);
    const size_t count = (size_t)3 * mesh->vertex_count;
    const float *a = mesh->positions + count * key, *b = mesh->key_count > 1 ? a + count : a;
    for (size_t i = 0; i < count; i += 3) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = between(a[i + k], b[i + k], f);
        for (int k = 0; k < 3; k++)
            positions[i + k] =
                (float)(m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3]);
    }
}

trc_status trc_thin_mesh(const struct trc_instance *instance, const struct trc_mesh *mesh,
                         struct trc_mesh *mesh_out) {
    const uint32_t key_count = common_keys(mesh->key_count, instance->key_count);
    const size_t per_key = (size_t)3 * mesh->vertex_count;
    float *positions = trc_alloc(per_key * key_count + 1, sizeof *positions);
    if (!positions)
        return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a flat mesh");
    for (uint32_t key = 0; key < key_count; key++) {
        const float time = key_count > 1 ? (float)key / (float)(key_count - 1) : 0.0f;
        double m[TRC_AFFINE_FLOATS];
        transform_at(instance, time, m);
        place_vertices(mesh, time, m, positions + per_key * key);
    }
    *mesh_out = (struct trc_mesh){
        .key_count = key_count,
        .vertex_count = mesh->vertex_count,
        .triangle_count = mesh->triangle_count,
        .positions = positions,
        .indices = mesh->indices,
        .material_index = mesh->material_index,
    };
    return TRC_OK;
}

struct trc_own_tree *trc_own_tree_create(const struct trc_instance *instance,
                                         const struct trc_mesh *mesh) {
    const size_t bytes = instance->key_count * sizeof(struct trc_affine);
    struct trc_own_tree *thin = trc_alloc_zeroed(1, sizeof *thin + bytes);
    if (!thin)
        return NULL;
    atomic_init(&thin->blas.refs, 1);
    thin->blas.mesh = mesh;
    thin->key_count = instance->key_count;
    memcpy(thin->transforms, instance->object_to_world, bytes);
    return thin;
}

bool trc_own_tree_is_of(const struct trc_own_tree *thin, const struct trc_instance *instance,
                        const struct trc_mesh *mesh) {
    return thin->blas.mesh == mesh && thin->key_count == instance->key_count &&
           memcmp(thin->transforms, instance->object_to_world,
                  instance->key_count * sizeof(struct trc_affine)) == 0;
}
