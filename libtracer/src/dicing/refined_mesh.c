#include "dicing/refined_mesh.h"

#include <string.h>

#include "core/core.h"
#include "dicing/vector.h"

#define TRIANGLE_MAX_DEFAULT ((uint64_t)1 << 25)
/* Of a sum of unit normals: what is shorter than 1e-6 is the error of the sum. */
#define SQUARE_MIN 1e-12f

trc_status trc_no_memory_to_dice(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the dicing of a mesh");
}

static void free_triangles(struct trc_triangle_list *t) {
    trc_free(t->indices);
    trc_free(t->corners);
    trc_free(t->material_index);
    trc_free(t->smooth);
    *t = (struct trc_triangle_list){.count = 0};
}

void trc_refined_mesh_free(struct trc_refined_mesh *mesh) {
    trc_free(mesh->vertices);
    free_triangles(&mesh->done);
    free_triangles(&mesh->open);
    free_triangles(&mesh->next);
}

/* Gives an array room for more elements of a size; false without memory, and it stays. */
static bool grow(void *array_pointer, size_t count, size_t capacity, size_t size) {
    void *array, *larger = trc_alloc(capacity, size);
    if (!larger)
        return false;
    memcpy(&array, array_pointer, sizeof array);
    if (count)
        memcpy(larger, array, count * size);
    trc_free(array);
    memcpy(array_pointer, &larger, sizeof larger);
    return true;
}

trc_status trc_reserve_triangles(struct trc_triangle_list *t, size_t more, size_t corner_width) {
    if (t->count + more <= t->capacity)
        return TRC_OK;
    const size_t capacity = t->count + more > 2 * t->capacity ? t->count + more : 2 * t->capacity;
    if (!grow(&t->indices, t->count, capacity, 3 * sizeof *t->indices) ||
        !grow(&t->corners, t->count, capacity, 3 * corner_width * sizeof *t->corners) ||
        !grow(&t->material_index, t->count, capacity, sizeof *t->material_index) ||
        !grow(&t->smooth, t->count, capacity, 1))
        return trc_no_memory_to_dice();
    t->capacity = capacity;
    return TRC_OK;
}

trc_status trc_reserve_vertices(struct trc_refined_mesh *mesh, size_t more) {
    const size_t needed = mesh->vertex_count + more;
    if (3 * needed * mesh->rows.key_count > INT32_MAX)
        return trc_fail(TRC_ERROR_TOO_LARGE, "the diced mesh has too many vertices");
    if (needed <= mesh->vertex_capacity)
        return TRC_OK;
    const size_t capacity = needed > 2 * mesh->vertex_capacity ? needed : 2 * mesh->vertex_capacity;
    if (!grow(&mesh->vertices, mesh->vertex_count, capacity,
              mesh->rows.vertex_width * sizeof *mesh->vertices))
        return trc_no_memory_to_dice();
    mesh->vertex_capacity = capacity;
    return TRC_OK;
}

uint64_t trc_triangle_max(const struct trc_refined_mesh *mesh) {
    return mesh->rows.how->triangle_max ? mesh->rows.how->triangle_max : TRIANGLE_MAX_DEFAULT;
}

/* Adds the unit normal of a triangle, times its angle there, to each of its vertices, of the key
 * that begins at an offset of the rows. */
static void add_normals(const struct trc_refined_mesh *mesh, const uint32_t v[3], size_t key) {
    float sides[3][3], normal[3];
    for (int k = 0; k < 3; k++)
        for (size_t i = 0; i < 3; i++)
            sides[k][i] = trc_refined_row(mesh, v[(k + 1) % 3])[key + i] -
                          trc_refined_row(mesh, v[k])[key + i];
    for (int i = 0; i < 3; i++)
        normal[i] = sides[0][(i + 1) % 3] * sides[1][(i + 2) % 3] -
                    sides[0][(i + 2) % 3] * sides[1][(i + 1) % 3];
    const float size = trc_length(normal);
    if (!(size > 0.0f))
        return;
    for (int k = 0; k < 3; k++) { /* the cross product of any two sides is as long */
        const float angle = atan2f(size, -trc_dot(sides[k], sides[(k + 2) % 3]));
        for (size_t i = 0; i < 3; i++)
            trc_refined_row(mesh, v[k])[mesh->rows.normals + key + i] += angle / size * normal[i];
    }
}

void trc_compute_vertex_normals(struct trc_refined_mesh *mesh) {
    for (size_t k = 0; k < 3 * mesh->rows.key_count; k += 3) {
        for (size_t t = 0; t < mesh->open.count; t++)
            add_normals(mesh, mesh->open.indices + 3 * t, k);
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            float *n = trc_refined_row(mesh, v) + mesh->rows.normals + k;
            const float square = trc_dot(n, n);
            for (int i = 0; i < 3; i++)
                n[i] = square > SQUARE_MIN ? n[i] / sqrtf(square) : 0.0f;
        }
    }
}

void trc_forget_normals(struct trc_refined_mesh *mesh, size_t vertex) {
    memset(trc_refined_row(mesh, vertex) + mesh->rows.normals, 0,
           3 * mesh->rows.key_count * sizeof(float));
}
