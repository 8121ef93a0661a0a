/* Angle-weighted vertex normals: one pass over triangles, one over vertices that gathers from
 * their corners in index order, so that the sums do not depend on threads. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "core/core.h"
#include "core/pool.h"
#include "scene/mesh.h"

/* Triangles or vertices of one task: some 100 microseconds of work. */
#define CHUNK 4096u

/* Unit normal of a triangle and the angles at its corners; all 0 for one that takes no part. */
struct face {
    float normal[3], angle[3];
};

struct job {
    const struct trc_mesh *mesh;
    const struct trc_mesh_topology *topology;
    const float *positions; /* of the key */
    float *normals;         /* of the key */
    struct face *faces;
    const atomic_uint *cancel;
};

/* Abramowitz and Stegun 4.4.46: the arc cosine to 2e-8, several times faster than acos. */
static double arc_cosine(double x) {
    const double a = fabs(x) < 1.0 ? fabs(x) : 1.0;
    double p = -0.0012624911;
    p = p * a + 0.0066700901;
    p = p * a - 0.0170881256;
    p = p * a + 0.0308918810;
    p = p * a - 0.0501743046;
    p = p * a + 0.0889789874;
    p = p * a - 0.2145988016;
    p = p * a + 1.5707963050;
    const double angle = sqrt(1.0 - a) * p;
    return x < 0.0 ? 3.14159265358979323846 - angle : angle;
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Doubles, because squares of large coordinates leave the range of floats. */
static void make_face(const float *p0, const float *p1, const float *p2, struct face *face) {
    memset(face, 0, sizeof *face);
    if (!trc_point_is_valid(p0) || !trc_point_is_valid(p1) || !trc_point_is_valid(p2))
        return;
    double a[3], b[3], c[3]; /* p0 to p1, p1 to p2, p2 to p0 */
    for (int i = 0; i < 3; i++) {
        a[i] = (double)p1[i] - (double)p0[i];
        b[i] = (double)p2[i] - (double)p1[i];
        c[i] = (double)p0[i] - (double)p2[i];
    }
    const double n[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    const double area = sqrt(dot(n, n));
    const double aa = dot(a, a), bb = dot(b, b), cc = dot(c, c);
    if (!(area > 0.0 && aa > 0.0 && bb > 0.0 && cc > 0.0))
        return;
    const double angle0 = arc_cosine(-dot(c, a) / sqrt(cc * aa));
    const double angle1 = arc_cosine(-dot(a, b) / sqrt(aa * bb));
    const double angle2 = 3.14159265358979323846 - angle0 - angle1;
    for (int i = 0; i < 3; i++)
        face->normal[i] = (float)(n[i] / area);
    face->angle[0] = (float)angle0;
    face->angle[1] = (float)angle1;
    face->angle[2] = angle2 > 0.0 ? (float)angle2 : 0.0f;
}

static void face_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct job *job = context;
    if (atomic_load_explicit(job->cancel, memory_order_relaxed))
        return;
    const uint32_t count = job->mesh->triangle_count;
    const uint32_t begin = index * CHUNK, end = count - begin > CHUNK ? begin + CHUNK : count;
    for (uint32_t t = begin; t < end; t++) {
        const uint32_t *v = job->mesh->indices + (size_t)3 * t;
        make_face(job->positions + (size_t)3 * v[0], job->positions + (size_t)3 * v[1],
                  job->positions + (size_t)3 * v[2], &job->faces[t]);
    }
}

static void vertex_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct job *job = context;
    if (atomic_load_explicit(job->cancel, memory_order_relaxed))
        return;
    const uint32_t count = job->mesh->vertex_count;
    const uint32_t begin = index * CHUNK, end = count - begin > CHUNK ? begin + CHUNK : count;
    for (uint32_t v = begin; v < end; v++) {
        float sum[3] = {0.0f, 0.0f, 0.0f};
        for (uint32_t i = job->topology->corner_begin[v]; i < job->topology->corner_begin[v + 1];
             i++) {
            const uint32_t corner = job->topology->corners[i];
            const struct face *face = &job->faces[corner / 3];
            const float angle = face->angle[corner % 3];
            for (int axis = 0; axis < 3; axis++)
                sum[axis] += angle * face->normal[axis];
        }
        const float square = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
        float *normal = job->normals + (size_t)3 * v;
        /* Triangles that cancel each other give a direction of rounding errors. */
        if (square > 1e-12f) {
            const float inverse = 1.0f / sqrtf(square);
            for (int axis = 0; axis < 3; axis++)
                normal[axis] = sum[axis] * inverse;
        } else {
            trc_normal_fallback(job->positions + (size_t)3 * v, normal);
        }
    }
}

/* Corners between two looks at whether the commit was cancelled: some milliseconds. */
#define CORNERS_PER_LOOK (1u << 20)

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the normals of a mesh");
}

static trc_status cancelled(void) {
    return trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled");
}

/* Counting sort of the corners by vertex into begin and corners; false if cancelled. */
static bool sort_corners(const struct trc_mesh *mesh, const atomic_uint *cancel, uint32_t *begin,
                         uint32_t *corners) {
    const uint32_t corner_count = 3 * mesh->triangle_count;
    /* begin[v + 2] counts, becomes the place where v + 1 starts, and moves on as it is filled. */
    for (uint32_t i = 0; i < corner_count; i++) {
        if (i % CORNERS_PER_LOOK == 0 && atomic_load(cancel))
            return false;
        begin[mesh->indices[i] + 2]++;
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        begin[v + 2] += begin[v + 1];
    for (uint32_t i = 0; i < corner_count; i++) {
        if (i % CORNERS_PER_LOOK == 0 && atomic_load(cancel))
            return false;
        corners[begin[mesh->indices[i] + 1]++] = i;
    }
    return true;
}

static trc_status find_corners(const struct trc_mesh *mesh, const atomic_uint *cancel,
                               struct trc_mesh_topology *topology) {
    if (topology->corner_begin)
        return TRC_OK;
    const uint32_t corner_count = 3 * mesh->triangle_count;
    uint32_t *begin = trc_alloc_zeroed((size_t)mesh->vertex_count + 2, sizeof *begin);
    uint32_t *corners = trc_alloc(corner_count, sizeof *corners);
    const bool enough = begin && corners;
    if (!enough || !sort_corners(mesh, cancel, begin, corners)) {
        trc_free(begin);
        trc_free(corners);
        return enough ? cancelled() : no_memory();
    }
    topology->corner_begin = begin;
    topology->corners = corners;
    topology->bytes += ((uint64_t)mesh->vertex_count + 2 + corner_count) * sizeof(uint32_t);
    return TRC_OK;
}

/* Normals of so many keys. */
static trc_status make_normals(const struct trc_mesh *mesh, uint32_t key_count,
                               struct trc_pool *pool, const atomic_uint *cancel,
                               float **normals_out) {
    struct trc_mesh_topology *topology = ((const struct trc_geometry *)mesh)->topology;
    const size_t per_key = (size_t)3 * mesh->vertex_count;
    struct face *faces = trc_alloc(mesh->triangle_count, sizeof *faces);
    float *normals = trc_alloc(per_key * key_count, sizeof *normals);
    trc_status status = faces && normals ? find_corners(mesh, cancel, topology) : no_memory();
    for (uint32_t key = 0; key < key_count && status == TRC_OK; key++) {
        struct job job = {mesh,  topology, mesh->positions + per_key * key, normals + per_key * key,
                          faces, cancel};
        trc_pool_run(pool, (mesh->triangle_count + CHUNK - 1) / CHUNK, face_task, &job);
        trc_pool_run(pool, (mesh->vertex_count + CHUNK - 1) / CHUNK, vertex_task, &job);
        if (atomic_load(cancel))
            status = cancelled();
    }
    trc_free(faces);
    if (status != TRC_OK) {
        trc_free(normals);
        return status;
    }
    *normals_out = normals;
    return TRC_OK;
}

trc_status trc_geometry_finish(struct trc_mesh *mesh, struct trc_pool *pool,
                               const atomic_uint *cancel) {
    if (!mesh->smooth || mesh->vertex_normals || mesh->corner_normals)
        return TRC_OK;
    return make_normals(mesh, mesh->key_count, pool, cancel, &mesh->vertex_normals);
}

trc_status trc_geometry_vertex_normals(const struct trc_mesh *mesh, struct trc_pool *pool,
                                       const atomic_uint *cancel, float **normals_out) {
    const size_t count = (size_t)3 * mesh->vertex_count;
    if (!mesh->vertex_normals)
        return make_normals(mesh, 1, pool, cancel, normals_out);
    *normals_out = trc_alloc(count, sizeof(float));
    if (!*normals_out)
        return no_memory();
    memcpy(*normals_out, mesh->vertex_normals, count * sizeof(float));
    return TRC_OK;
}
