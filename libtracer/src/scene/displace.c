#include "scene/displace.h"

#include <math.h>
#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "core/pool.h"
#include "image/image.h"
#include "model/kernels.h"
#include "model/material.h"
#include "scene/mesh.h"
#include "scene/scene.h"
#include "shading/compile.h"

/* Corners of one task: some 100 microseconds of work. */
#define CHUNK 1024u
/* Of a sum of unit normals: what is shorter than 1e-6 is the error of the sum. */
#define SQUARE_MIN 1e-12f

/* A moved mesh, and what it was made of: while that stays, it is not made again. */
struct trc_displacer {
    struct trc_mesh *from, *moved; /* held */
    struct trc_affine transform;
    uint32_t material_count;
    struct trc_material **materials; /* held, of the slots */
    uint32_t image_count;
    struct trc_image **images; /* of the scene, held */
};

static trc_status no_memory(void) {
    return trc_fail(TRC_ERROR_OUT_OF_MEMORY, "no memory for the displacement of a mesh");
}

static trc_status check_cancel(const atomic_uint *cancel) {
    return atomic_load(cancel) ? trc_fail(TRC_ERROR_CANCELLED, "the commit was cancelled") : TRC_OK;
}

/* ---- what has been moved ---- */

void trc_displacer_destroy(struct trc_displacer *d) {
    if (!d)
        return;
    trc_geometry_release(d->from);
    trc_geometry_release(d->moved);
    for (uint32_t i = 0; d->materials && i < d->material_count; i++)
        trc_material_release(d->materials[i]);
    for (uint32_t i = 0; d->images && i < d->image_count; i++)
        trc_image_release(d->images[i]);
    trc_free(d->materials);
    trc_free(d->images);
    trc_free(d);
}

static struct trc_displacer *create_displacer(const struct trc_snapshot *s,
                                              const struct trc_instance *instance) {
    struct trc_displacer *d = trc_alloc_zeroed(1, sizeof *d);
    if (!d)
        return NULL;
    d->from = trc_geometry_retain(s->meshes[instance->mesh]);
    d->transform = instance->object_to_world[0];
    d->materials = trc_alloc_zeroed(instance->material_count, sizeof(struct trc_material *));
    d->images = trc_alloc_zeroed(s->image_count, sizeof(struct trc_image *));
    if (!d->materials || !d->images) {
        trc_displacer_destroy(d);
        return NULL;
    }
    d->material_count = instance->material_count;
    for (uint32_t i = 0; i < d->material_count; i++)
        d->materials[i] = trc_material_retain(s->materials[instance->materials[i]]);
    d->image_count = s->image_count;
    for (uint32_t i = 0; i < d->image_count; i++)
        d->images[i] = trc_image_retain(s->images[i]);
    return d;
}

static bool is_of(const struct trc_displacer *d, const struct trc_snapshot *s,
                  const struct trc_instance *instance) {
    if (!d || d->from != s->meshes[instance->mesh] ||
        d->material_count != instance->material_count || d->image_count != s->image_count ||
        memcmp(&d->transform, instance->object_to_world, sizeof d->transform) != 0)
        return false;
    for (uint32_t i = 0; i < d->material_count; i++)
        if (d->materials[i] != s->materials[instance->materials[i]])
            return false;
    return !s->image_count ||
           memcmp(d->images, s->images, s->image_count * sizeof(struct trc_image *)) == 0;
}

/* ---- moving ---- */

struct work {
    const struct trc_snapshot *snapshot;
    struct trc_mesh *mesh;
    uint32_t instance;
    const atomic_uint *cancel;
    float *normals;    /* of the vertices */
    float *offsets;    /* of the vertices, object space */
    uint32_t *corners; /* one of each vertex that the program moves */
    uint8_t *done;     /* of the vertices */
    const struct trc_material *program;
    uint32_t count;
};

static const struct trc_material *material_of(const struct work *w, uint32_t triangle) {
    const struct trc_instance *instance = &w->snapshot->instances[w->instance];
    uint32_t slot = w->mesh->material_index ? w->mesh->material_index[triangle] : 0;
    if (slot >= instance->material_count)
        slot = instance->material_count - 1;
    return w->snapshot->materials[instance->materials[slot]];
}

/* The first corner of each vertex in a triangle that moves it decides where it goes. Collects those
 * of a material's program; returns their number. */
static uint32_t choose_corners(struct work *w, const struct trc_material *program) {
    uint32_t count = 0;
    for (uint32_t c = 0; c < 3 * w->mesh->triangle_count; c++) {
        const uint32_t vertex = w->mesh->indices[c];
        const struct trc_material *own = material_of(w, c / 3)->displacement;
        if (!own || w->done[vertex])
            continue;
        if (own == program)
            w->corners[count++] = c;
        w->done[vertex] = 1;
    }
    return count;
}

static void corners_task(void *context, uint32_t index, uint32_t worker) {
    (void)worker;
    const struct work *w = context;
    if (atomic_load(w->cancel))
        return;
    const uint32_t begin = index * CHUNK;
    const uint32_t count = w->count - begin > CHUNK ? CHUNK : w->count - begin;
    const struct trc_displace_job job = {.snapshot = w->snapshot,
                                         .instance = w->instance,
                                         .program = w->program,
                                         .corners = w->corners + begin,
                                         .count = count,
                                         .normals = w->normals,
                                         .offsets = w->offsets};
    trc_kernels_get(TRC_ISA_SCALAR)->displace(&job);
}

/* Offsets of all vertices, material by material. CANCELLED. */
static trc_status find_offsets(struct work *w, struct trc_pool *pool) {
    const struct trc_instance *instance = &w->snapshot->instances[w->instance];
    for (uint32_t i = 0; i < instance->material_count; i++) {
        const struct trc_material *program =
            w->snapshot->materials[instance->materials[i]]->displacement;
        bool is_first = program != NULL;
        for (uint32_t k = 0; k < i && is_first; k++)
            is_first = w->snapshot->materials[instance->materials[k]]->displacement != program;
        if (!is_first)
            continue;
        memset(w->done, 0, w->mesh->vertex_count);
        w->program = program;
        w->count = choose_corners(w, program);
        trc_pool_run(pool, (w->count + CHUNK - 1) / CHUNK, corners_task, w);
    }
    return check_cancel(w->cancel);
}

/* ---- normals ---- */

static void face_normal(const struct trc_mesh *mesh, const float *positions, uint32_t triangle,
                        float n[3]) {
    const uint32_t *v = mesh->indices + (size_t)3 * triangle;
    double a[3], b[3], c[3];
    for (size_t i = 0; i < 3; i++) {
        a[i] = (double)positions[3 * (size_t)v[1] + i] - positions[3 * (size_t)v[0] + i];
        b[i] = (double)positions[3 * (size_t)v[2] + i] - positions[3 * (size_t)v[0] + i];
    }
    for (int i = 0; i < 3; i++)
        c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
    const double length = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    for (int i = 0; i < 3; i++)
        n[i] = length > 0.0 ? (float)(c[i] / length) : 0.0f;
}

static bool is_moved(const struct work *w, uint32_t triangle) {
    const struct trc_material *m = material_of(w, triangle);
    return m->displacement && !m->keeps_normals;
}

/* Sums of the normals of the moved triangles at each vertex, of one key: all count alike, as in
 * Cycles. Vertices of other triangles alone keep what is there. */
static void sum_normals(const struct work *w, const float *positions, float *normals) {
    const uint32_t *indices = w->mesh->indices;
    for (uint32_t c = 0; c < 3 * w->mesh->triangle_count; c++)
        if (is_moved(w, c / 3))
            memset(normals + 3 * (size_t)indices[c], 0, 3 * sizeof *normals);
    for (uint32_t t = 0; t < w->mesh->triangle_count; t++) {
        float n[3];
        if (!is_moved(w, t))
            continue;
        face_normal(w->mesh, positions, t, n);
        for (uint32_t k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                normals[3 * (size_t)indices[3 * (size_t)t + k] + (size_t)i] += n[i];
    }
}

/* False for sums of normals that cancel out. */
static bool make_unit(float n[3]) {
    const float square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    if (!(square > SQUARE_MIN))
        return false;
    const float scale = 1.0f / sqrtf(square);
    for (int i = 0; i < 3; i++)
        n[i] *= scale;
    return true;
}

/* Unit normals of the vertices of the moved triangles, of one key. */
static void moved_normals(const struct work *w, const float *positions, float *normals) {
    sum_normals(w, positions, normals);
    for (size_t v = 0; v < w->mesh->vertex_count; v++)
        if (!make_unit(normals + 3 * v))
            trc_normal_fallback(positions + 3 * v, normals + 3 * v);
}

/* Corner normals turn with those of their vertices. before, after: of the vertices. */
static void turn_corners(const struct work *w, const float *before, const float *after,
                         float *corners) {
    for (uint32_t c = 0; c < 3 * w->mesh->triangle_count; c++) {
        const size_t v = w->mesh->indices[c];
        float *n = corners + 3 * (size_t)c;
        if (!is_moved(w, c / 3))
            continue;
        for (size_t i = 0; i < 3; i++)
            n[i] += after[3 * v + i] - before[3 * v + i];
        if (!make_unit(n))
            memcpy(n, after + 3 * v, 3 * sizeof *n);
    }
}

/* Normals of a moved mesh, key by key; those of from are in it. */
static trc_status fill_normals(const struct work *w, struct trc_mesh *moved) {
    const size_t per_key = (size_t)3 * moved->vertex_count;
    float *before = trc_alloc(per_key, sizeof *before), *after = trc_alloc(per_key, sizeof *after);
    const bool enough = before && after;
    for (size_t key = 0; enough && key < moved->key_count; key++) {
        const float *positions = moved->positions + per_key * key;
        if (moved->vertex_normals)
            moved_normals(w, positions, moved->vertex_normals + per_key * key);
        if (!moved->corner_normals)
            continue;
        memset(before, 0, per_key * sizeof *before);
        memset(after, 0, per_key * sizeof *after);
        moved_normals(w, w->mesh->positions + per_key * key, before);
        moved_normals(w, positions, after);
        turn_corners(w, before, after,
                     moved->corner_normals + (size_t)9 * moved->triangle_count * key);
    }
    trc_free(before);
    trc_free(after);
    return enough ? TRC_OK : no_memory();
}

/* ---- a mesh ---- */

static trc_status shift(const struct work *w, struct trc_mesh **moved_out) {
    struct trc_mesh *from = w->mesh;
    const size_t per_key = (size_t)3 * from->vertex_count;
    float *positions = trc_alloc(per_key * from->key_count, sizeof *positions);
    if (!positions)
        return no_memory();
    for (size_t key = 0; key < from->key_count; key++)
        for (size_t i = 0; i < per_key; i++)
            positions[per_key * key + i] = from->positions[per_key * key + i] + w->offsets[i];
    const trc_status status = trc_geometry_displace(from, positions, moved_out);
    trc_free(positions);
    return status;
}

static trc_status move(struct trc_scene_state *scene, struct work *w, struct trc_mesh **moved_out) {
    const size_t vertices = w->mesh->vertex_count;
    w->offsets = trc_alloc_zeroed(3 * vertices, sizeof *w->offsets);
    w->corners = trc_alloc(vertices, sizeof *w->corners);
    w->done = trc_alloc(vertices, 1);
    trc_status status = w->offsets && w->corners && w->done ? TRC_OK : no_memory();
    if (status == TRC_OK)
        status = trc_geometry_vertex_normals(w->mesh, scene->pool, &scene->cancel, &w->normals);
    if (status == TRC_OK)
        status = find_offsets(w, scene->pool);
    if (status == TRC_OK)
        status = shift(w, moved_out);
    if (status == TRC_OK)
        status = fill_normals(w, *moved_out);
    trc_free(w->offsets);
    trc_free(w->corners);
    trc_free(w->done);
    trc_free(w->normals);
    return status;
}

static bool moves_any(const struct trc_snapshot *s) {
    for (uint32_t i = 0; i < s->material_count; i++)
        if (s->materials[i]->displacement)
            return true;
    return false;
}

/* The first instance of each mesh that moves it; UINT32_MAX: none does. */
static void find_instances(const struct trc_snapshot *s, uint32_t *instance_of_mesh) {
    for (uint32_t i = 0; i < s->mesh_count; i++)
        instance_of_mesh[i] = UINT32_MAX;
    for (uint32_t i = s->instance_count; i-- > 0;) {
        const struct trc_instance *instance = &s->instances[i];
        const bool keeps_shape = instance->keeps_shape || s->meshes[instance->mesh]->strands;
        for (uint32_t m = 0; m < instance->material_count && !keeps_shape; m++)
            if (s->materials[instance->materials[m]]->displacement)
                instance_of_mesh[instance->mesh] = i;
    }
}

static trc_status displace(struct trc_scene_state *scene, struct trc_snapshot *s, uint32_t instance,
                           struct trc_scene_mesh *mesh) {
    struct trc_mesh **shown = &s->meshes[mesh->index];
    if (!is_of(mesh->displacer, s, &s->instances[instance])) {
        struct trc_displacer *d = create_displacer(s, &s->instances[instance]);
        if (!d)
            return no_memory();
        struct work w = {
            .snapshot = s, .mesh = *shown, .instance = instance, .cancel = &scene->cancel};
        const trc_status status = move(scene, &w, &d->moved);
        if (status != TRC_OK) {
            trc_displacer_destroy(d);
            return status;
        }
        trc_displacer_destroy(mesh->displacer);
        mesh->displacer = d;
    }
    trc_geometry_release(*shown);
    *shown = trc_geometry_retain(mesh->displacer->moved);
    mesh->shown = *shown;
    return TRC_OK;
}

trc_status trc_displace_meshes(struct trc_scene_state *scene, struct trc_snapshot *s) {
    uint32_t *instances = NULL; /* NULL: no mesh moves */
    if (moves_any(s)) {
        instances = trc_alloc(s->mesh_count, sizeof *instances);
        if (!instances)
            return no_memory();
        find_instances(s, instances);
    }
    trc_status status = TRC_OK;
    const struct trc_store *store = &scene->meshes;
    for (uint32_t i = trc_store_first(store); i != TRC_STORE_END && status == TRC_OK;
         i = trc_store_next(store, i)) {
        struct trc_scene_mesh *mesh = store->slots[i].object;
        mesh->shown = mesh->geometry;
        if (instances && instances[mesh->index] != UINT32_MAX) {
            status = displace(scene, s, instances[mesh->index], mesh);
        } else {
            trc_displacer_destroy(mesh->displacer);
            mesh->displacer = NULL;
        }
    }
    trc_free(instances);
    return status;
}
