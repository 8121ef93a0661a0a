#include "scene/mesh.h"

#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for a mesh");
}

/* ---- topology ---- */

void trc_topology_release(struct trc_mesh_topology *topology) {
    if (!topology || atomic_fetch_sub(&topology->refs, 1) != 1)
        return;
    trc_free(topology->indices);
    trc_free(topology->smooth);
    trc_free(topology->material_index);
    trc_free(topology->generated);
    for (uint32_t i = 0; i < topology->attribute_count; i++) {
        trc_free(topology->attributes[i].values);
    }
    trc_free(topology->attributes);
    trc_free(topology->corner_begin);
    trc_free(topology->corners);
    trc_free(topology->strands);
    trc_free(topology->lengths);
    trc_free(topology->cuts);
    trc_free(topology);
}

bool trc_topology_copy(struct trc_mesh_topology *topology, const void *source, uint64_t count,
                       size_t size, void *copy_out) {
    void *copy = NULL;
    if (source && count) {
        copy = trc_alloc(count, size);
        if (!copy)
            return false;
        memcpy(copy, source, count * size);
        topology->bytes += count * size;
    }
    memcpy(copy_out, &copy, sizeof copy);
    return true;
}

trc_status trc_topology_expect_attributes(struct trc_mesh_topology *topology, uint32_t count) {
    topology->default_uv = -1;
    if (!count)
        return TRC_OK;
    topology->attributes = trc_alloc_zeroed(count, sizeof *topology->attributes);
    topology->bytes += count * sizeof *topology->attributes;
    return topology->attributes ? TRC_OK : no_memory();
}

static bool all_zero(const void *data, uint64_t bytes) {
    const uint8_t *b = data;
    return !b || !bytes || (b[0] == 0 && memcmp(b, b + 1, bytes - 1) == 0);
}

void trc_clear_bad_values(float *values, uint64_t count) {
    for (uint64_t i = 0; i < count; i++) {
        if (!isfinite(values[i]))
            values[i] = 0.0f;
    }
}

static trc_status copy_attribute(struct trc_mesh_topology *topology,
                                 const trc_corner_attribute *desc, struct trc_names *names) {
    struct trc_attribute *attribute = &topology->attributes[topology->attribute_count];
    attribute->width = desc->width;
    TRC_TRY(trc_names_add(names, desc->name, &attribute->name));
    if (!trc_topology_copy(topology, desc->values, desc->value_count, sizeof(float),
                           &attribute->values)) {
        return no_memory();
    }
    if (desc->width == 2 && topology->default_uv < 0)
        topology->default_uv = (int32_t)topology->attribute_count;
    topology->attribute_count++;
    trc_clear_bad_values(attribute->values, desc->value_count);
    return TRC_OK;
}

static trc_status fill_topology(struct trc_mesh_topology *topology, const trc_mesh_desc *desc,
                                struct trc_names *names) {
    const uint64_t triangles = desc->triangle_count;
    topology->normal_kind = desc->normals ? desc->normal_kind : TRC_NORMALS_NONE;
    /* Corner normals rule over the flags; flags that say nothing are not kept. */
    const bool smooth =
        topology->normal_kind != TRC_NORMALS_CORNER && !all_zero(desc->smooth, triangles);
    const bool slots = !all_zero(desc->material_index, triangles * sizeof(uint16_t));
    TRC_TRY(trc_check_indices(desc->indices, 3 * triangles, desc->vertex_count));
    if (!trc_topology_copy(topology, desc->indices, 3 * triangles, sizeof(uint32_t),
                           &topology->indices) ||
        !trc_topology_copy(topology, smooth ? desc->smooth : NULL, triangles, 1,
                           &topology->smooth) ||
        !trc_topology_copy(topology, slots ? desc->material_index : NULL, triangles,
                           sizeof(uint16_t), &topology->material_index) ||
        !trc_topology_copy(topology, desc->generated, desc->generated_count, sizeof(float),
                           &topology->generated)) {
        return no_memory();
    }
    if (topology->generated)
        trc_clear_bad_values(topology->generated, desc->generated_count);
    TRC_TRY(trc_topology_expect_attributes(topology, desc->attribute_count));
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        TRC_TRY(copy_attribute(topology, &desc->attributes[i], names));
    }
    return TRC_OK;
}

/* ---- a pose ---- */

void trc_normal_fallback(const float position[3], float normal_out[3]) {
    const double x = position[0], y = position[1], z = position[2];
    const double length = sqrt(x * x + y * y + z * z);
    const bool usable = trc_point_is_valid(position) && length > 0.0;
    normal_out[0] = usable ? (float)(x / length) : 0.0f;
    normal_out[1] = usable ? (float)(y / length) : 0.0f;
    normal_out[2] = usable ? (float)(z / length) : 1.0f;
}

static bool normal_is_valid(const float n[3]) {
    const float square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    return square > 1e-12f && square < 1e12f; /* far from unit is as bad as none */
}

/* Puts the vertex's fallback in place of normals that cannot be interpolated. */
static void repair_normals(struct trc_mesh *mesh) {
    float *vertex = mesh->vertex_normals, *corner = mesh->corner_normals;
    for (uint32_t key = 0; key < mesh->key_count; key++) {
        const float *p = mesh->positions + (size_t)3 * mesh->vertex_count * key;
        for (size_t i = 0; vertex && i < mesh->vertex_count; i++) {
            float *n = vertex + 3 * (mesh->vertex_count * (size_t)key + i);
            if (!normal_is_valid(n))
                trc_normal_fallback(p + 3 * i, n);
        }
        for (size_t i = 0; corner && i < (size_t)3 * mesh->triangle_count; i++) {
            float *n = corner + 3 * ((size_t)3 * mesh->triangle_count * key + i);
            if (!normal_is_valid(n))
                trc_normal_fallback(p + 3 * (size_t)mesh->indices[i], n);
        }
    }
}

/* Floats of the points that find_bounds takes at once: a multiple of 3 and of most vector widths.
 */
#define BOUNDS_LANES 48

static bool all_valid(const float *values, size_t count) {
    const float m = TRC_MAX_COORDINATE;
    unsigned bad = 0;
    for (size_t i = 0; i < count; i++)
        bad |= !(values[i] >= -m) | !(values[i] <= m);
    return !bad;
}

static void grow_bounds(const float *p, float lower[3], float upper[3]) {
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = p[axis] < lower[axis] ? p[axis] : lower[axis];
        upper[axis] = p[axis] > upper[axis] ? p[axis] : upper[axis];
    }
}

/* Over all keys and vertices; those that take no part in the scene do not count. */
void trc_geometry_bound(struct trc_mesh *mesh) {
    float lower[3] = {INFINITY, INFINITY, INFINITY}, upper[3] = {-INFINITY, -INFINITY, -INFINITY};
    const size_t count = (size_t)3 * mesh->vertex_count * mesh->key_count;
    const float *p = mesh->positions;
    size_t i = 0;
    if (count >= BOUNDS_LANES && all_valid(p, count)) {
        float low[BOUNDS_LANES], high[BOUNDS_LANES];
        memcpy(low, p, sizeof low);
        memcpy(high, p, sizeof high);
        for (; i + BOUNDS_LANES <= count; i += BOUNDS_LANES)
            for (int k = 0; k < BOUNDS_LANES; k++) {
                low[k] = p[i + k] < low[k] ? p[i + k] : low[k];
                high[k] = p[i + k] > high[k] ? p[i + k] : high[k];
            }
        for (int k = 0; k < BOUNDS_LANES; k += 3) {
            grow_bounds(low + k, lower, upper);
            grow_bounds(high + k, lower, upper);
        }
    }
    for (; i < count; i += 3)
        if (trc_point_is_valid(p + i))
            grow_bounds(p + i, lower, upper);
    const bool empty = lower[0] > upper[0];
    for (int axis = 0; axis < 3; axis++) {
        mesh->bounds_lower[axis] = empty ? 0.0f : lower[axis];
        mesh->bounds_upper[axis] = empty ? 0.0f : upper[axis];
    }
}

static bool keys_are_equal(const float *values, uint64_t per_key, uint32_t key_count) {
    for (uint32_t key = 1; values && key < key_count; key++) {
        if (memcmp(values, values + per_key * key, per_key * sizeof *values) != 0)
            return false;
    }
    return true;
}

static void share_topology(struct trc_geometry *geometry, struct trc_mesh_topology *topology) {
    struct trc_mesh *mesh = &geometry->mesh;
    geometry->topology = topology;
    mesh->indices = topology->indices;
    mesh->smooth = topology->smooth;
    mesh->material_index = topology->material_index;
    mesh->generated = topology->generated;
    mesh->strands = topology->strands;
    mesh->shape = topology->shape;
    mesh->attribute_count = topology->attribute_count;
    mesh->attributes = topology->attributes;
    mesh->default_uv = topology->default_uv;
}

trc_status trc_geometry_alloc(struct trc_mesh_topology *topology, uint32_t vertex_count,
                              uint32_t triangle_count, uint32_t key_count,
                              struct trc_mesh **mesh_out) {
    struct trc_geometry *geometry = trc_alloc_zeroed(1, sizeof *geometry);
    if (!geometry) {
        trc_topology_release(topology);
        return no_memory();
    }
    struct trc_mesh *mesh = &geometry->mesh;
    atomic_init(&mesh->refs, 1);
    share_topology(geometry, topology);
    mesh->vertex_count = vertex_count;
    mesh->triangle_count = triangle_count;
    mesh->key_count = key_count;
    mesh->positions = trc_alloc((uint64_t)3 * vertex_count * key_count + 1, sizeof(float));
    if (!mesh->positions) {
        trc_geometry_release(mesh);
        return no_memory();
    }
    *mesh_out = mesh;
    return TRC_OK;
}

/* Takes the topology's reference over, on failure too. */
static trc_status create_pose(struct trc_mesh_topology *topology, uint32_t vertex_count,
                              uint32_t triangle_count, uint32_t key_count, const float *positions,
                              const float *normals, struct trc_mesh **mesh_out) {
    const uint32_t kind = topology->normal_kind;
    const uint64_t per_key = (uint64_t)3 * vertex_count;
    const uint64_t normals_per_key =
        kind == TRC_NORMALS_CORNER ? (uint64_t)9 * triangle_count : per_key;
    if (keys_are_equal(positions, per_key, key_count) &&
        keys_are_equal(normals, normals_per_key, key_count)) {
        key_count = 1;
    }
    struct trc_mesh *mesh;
    TRC_TRY(trc_geometry_alloc(topology, vertex_count, triangle_count, key_count, &mesh));
    /* Without smooth triangles nothing reads vertex normals. */
    if (kind == TRC_NORMALS_CORNER || (kind == TRC_NORMALS_VERTEX && mesh->smooth)) {
        float *copy = trc_alloc(normals_per_key * key_count, sizeof(float));
        if (!copy) {
            trc_geometry_release(mesh);
            return no_memory();
        }
        if (normals_per_key)
            memcpy(copy, normals, normals_per_key * key_count * sizeof(float));
        if (kind == TRC_NORMALS_CORNER)
            mesh->corner_normals = copy;
        else
            mesh->vertex_normals = copy;
    }
    if (per_key)
        memcpy(mesh->positions, positions, per_key * key_count * sizeof(float));
    repair_normals(mesh);
    trc_geometry_bound(mesh);
    *mesh_out = mesh;
    return TRC_OK;
}

trc_status trc_geometry_create(const trc_mesh_desc *desc, struct trc_names *names,
                               struct trc_mesh **mesh_out) {
    struct trc_mesh_topology *topology = trc_alloc_zeroed(1, sizeof *topology);
    if (!topology)
        return no_memory();
    atomic_init(&topology->refs, 1);
    const trc_status status = fill_topology(topology, desc, names);
    if (status != TRC_OK) {
        trc_topology_release(topology);
        return status;
    }
    return create_pose(topology, (uint32_t)desc->vertex_count, (uint32_t)desc->triangle_count,
                       desc->key_count, desc->positions, desc->normals, mesh_out);
}

trc_status trc_geometry_pose(const struct trc_mesh *from, uint32_t key_count,
                             const float *positions, const float *normals,
                             struct trc_mesh **mesh_out) {
    struct trc_mesh_topology *topology = ((const struct trc_geometry *)from)->topology;
    atomic_fetch_add(&topology->refs, 1);
    return create_pose(topology, from->vertex_count, from->triangle_count, key_count, positions,
                       normals, mesh_out);
}

/* Blender's default texture space, as kernels/program/input.h has it. */
static void fill_generated(const struct trc_mesh *from, float *generated) {
    for (uint32_t axis = 0; axis < 3; axis++) {
        const float low = from->bounds_lower[axis], high = from->bounds_upper[axis];
        const float half = 0.5f * (high - low), center = 0.5f * (low + high);
        const float scale = half == 0.0f ? 0.5f : 0.5f / (half < 1e-5f ? 1e-5f : half);
        for (size_t v = 0; v < from->vertex_count; v++)
            generated[3 * v + axis] =
                from->positions[3 * v + axis] * scale - (center * scale - 0.5f);
    }
    trc_clear_bad_values(generated, (uint64_t)3 * from->vertex_count);
}

trc_status trc_geometry_displace(struct trc_mesh *from, const float *positions,
                                 struct trc_mesh **mesh_out) {
    const float *normals = from->corner_normals ? from->corner_normals : from->vertex_normals;
    const size_t vertices = (size_t)3 * from->vertex_count;
    struct trc_mesh *mesh;
    TRC_TRY(trc_geometry_pose(from, from->key_count, positions, normals, &mesh));
    ((struct trc_geometry *)mesh)->from = trc_geometry_retain(from);
    mesh->rest = from->positions;
    bool ok = true;
    if (from->vertex_normals && !mesh->vertex_normals) { /* made by trc_geometry_finish */
        mesh->vertex_normals = trc_alloc(vertices * from->key_count, sizeof(float));
        ok = mesh->vertex_normals != NULL;
        if (ok)
            memcpy(mesh->vertex_normals, from->vertex_normals,
                   vertices * mesh->key_count * sizeof(float));
    }
    if (!mesh->generated) {
        mesh->generated = trc_alloc(vertices, sizeof(float));
        ok = ok && mesh->generated;
        if (ok)
            fill_generated(from, mesh->generated);
    }
    if (!ok) {
        trc_geometry_release(mesh);
        return no_memory();
    }
    *mesh_out = mesh;
    return TRC_OK;
}

uint32_t trc_geometry_normal_kind(const struct trc_mesh *mesh) {
    return ((const struct trc_geometry *)mesh)->topology->normal_kind;
}

struct trc_mesh *trc_geometry_retain(struct trc_mesh *mesh) {
    if (mesh)
        atomic_fetch_add_explicit(&mesh->refs, 1, memory_order_relaxed);
    return mesh;
}

void trc_geometry_release(struct trc_mesh *mesh) {
    if (!mesh || atomic_fetch_sub(&mesh->refs, 1) != 1)
        return;
    trc_free(mesh->positions);
    trc_free(mesh->radii);
    trc_free(mesh->vertex_normals);
    trc_free(mesh->corner_normals);
    if (mesh->generated != ((struct trc_geometry *)mesh)->topology->generated)
        trc_free(mesh->generated);
    trc_geometry_release(((struct trc_geometry *)mesh)->from);
    trc_topology_release(((struct trc_geometry *)mesh)->topology);
    trc_free(mesh);
}

uint64_t trc_geometry_bytes(const struct trc_mesh *mesh) {
    const uint64_t vertex = (uint64_t)3 * mesh->vertex_count * mesh->key_count * sizeof(float);
    const uint64_t corner = (uint64_t)9 * mesh->triangle_count * mesh->key_count * sizeof(float);
    const uint64_t radii = (uint64_t)mesh->vertex_count * mesh->key_count * sizeof(float);
    return ((const struct trc_geometry *)mesh)->topology->bytes + vertex +
           (mesh->radii ? radii : 0) + (mesh->vertex_normals ? vertex : 0) +
           (mesh->corner_normals ? corner : 0);
}
