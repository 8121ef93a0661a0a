#include "dicing/dicing.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/catmull_clark.h"
#include "dicing/edge_splitting.h"
#include "dicing/face_joining.h"
#include "dicing/rate.h"

/* Catmull-Clark levels are even all over the mesh: where faces need more than this many make,
 * curved edges follow the surface closely enough. */
#define EVEN_FACE_MAX 65536u

static trc_status take_triangles(struct trc_refined_mesh *mesh, const trc_mesh_desc *desc) {
    TRC_TRY(trc_reserve_vertices(mesh, desc->vertex_count));
    TRC_TRY(trc_reserve_triangles(&mesh->open, desc->triangle_count, mesh->rows.corner_width));
    for (size_t v = 0; v < desc->vertex_count; v++) {
        memset(trc_refined_row(mesh, v), 0, mesh->rows.vertex_width * sizeof(float));
        trc_fill_row(&mesh->rows, desc, v, trc_refined_row(mesh, v));
    }
    mesh->vertex_count = desc->vertex_count;
    for (size_t t = 0; t < desc->triangle_count; t++) {
        memcpy(mesh->open.indices + 3 * t, desc->indices + 3 * t, 3 * sizeof *desc->indices);
        for (size_t k = 0; k < 3; k++)
            trc_fill_corner(desc, 3 * t + k,
                            mesh->open.corners + mesh->rows.corner_width * (3 * t + k));
        mesh->open.material_index[t] = trc_slot_of(desc, t);
        mesh->open.smooth[t] = trc_smooth_of(desc, t);
    }
    mesh->open.count = desc->triangle_count;
    return TRC_OK;
}

static bool has_long_edge(const struct trc_refined_mesh *mesh, const struct trc_faces *f) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t next = c + 1 == f->begin[face + 1] ? f->begin[face] : c + 1;
            if (trc_edge_is_too_long(mesh->rows.how, f->vertices + f->vertex_width * f->indices[c],
                                     f->vertices + f->vertex_width * f->indices[next]))
                return true;
        }
    }
    return false;
}

/* Quadrilaterals as two triangles each. */
static trc_status take_faces(struct trc_refined_mesh *mesh, const struct trc_faces *f) {
    TRC_TRY(trc_reserve_vertices(mesh, f->vertex_count));
    TRC_TRY(trc_reserve_triangles(&mesh->open, 2 * (size_t)f->face_count, mesh->rows.corner_width));
    for (size_t v = 0; v < f->vertex_count; v++) {
        memset(trc_refined_row(mesh, v), 0, mesh->rows.vertex_width * sizeof(float));
        memcpy(trc_refined_row(mesh, v), f->vertices + f->vertex_width * v,
               f->vertex_width * sizeof(float));
    }
    mesh->vertex_count = f->vertex_count;
    for (size_t i = 0; i < (size_t)6 * f->face_count; i++) {
        static const uint32_t corners[6] = {0, 1, 2, 0, 2, 3};
        const size_t corner = 4 * (i / 6) + corners[i % 6];
        mesh->open.indices[i] = f->indices[corner];
        if (mesh->rows.corner_width)
            memcpy(mesh->open.corners + mesh->rows.corner_width * i,
                   f->corners + mesh->rows.corner_width * corner,
                   mesh->rows.corner_width * sizeof(float));
        mesh->open.material_index[i / 3] = f->material_index[i / 6];
        mesh->open.smooth[i / 3] = f->smooth[i / 6];
    }
    mesh->open.count = 2 * (size_t)f->face_count;
    return TRC_OK;
}

/* On creases the surface has no normal: forgets those of their vertices. */
static void forget_creased_normals(struct trc_refined_mesh *mesh, const struct trc_faces *f) {
    for (uint32_t c = 0; c < 4 * f->face_count; c++) {
        const bool is_sharp = f->edge_sharpness && f->edge_sharpness[c] > 0.0f;
        const uint32_t ends[2] = {f->indices[c], f->indices[(c & ~3u) | ((c + 1) & 3)]};
        for (int k = 0; k < 2 && is_sharp; k++)
            trc_forget_normals(mesh, ends[k]);
    }
    for (uint32_t v = 0; f->vertex_sharpness && v < f->vertex_count; v++)
        if (f->vertex_sharpness[v] > 0.0f)
            trc_forget_normals(mesh, v);
}

/* Even levels, then the limit; the levels taken are in *levels_out. */
static trc_status subdivide(struct trc_refined_mesh *mesh, struct trc_faces *f,
                            uint32_t *levels_out) {
    uint32_t levels = 0;
    do {
        TRC_TRY(trc_catmull_clark_subdivide(f));
        levels++;
    } while (levels < mesh->rows.how->max_subdivisions && f->face_count <= EVEN_FACE_MAX &&
             8 * (uint64_t)f->face_count <= trc_triangle_max(mesh) && has_long_edge(mesh, f));
    TRC_TRY(trc_catmull_clark_limit(f));
    *levels_out = levels;
    TRC_TRY(take_faces(mesh, f));
    trc_compute_vertex_normals(mesh);
    forget_creased_normals(mesh, f);
    return TRC_OK;
}

static trc_status refine(struct trc_refined_mesh *mesh, const trc_mesh_desc *desc) {
    uint32_t levels = 0;
    trc_status status = TRC_OK;
    if (mesh->rows.how->surface == TRC_DICING_CATMULL_CLARK) {
        struct trc_faces faces;
        status = trc_join_faces(&mesh->rows, desc, &faces);
        if (status == TRC_OK)
            status = subdivide(mesh, &faces, &levels);
        trc_faces_free(&faces);
    } else {
        status = take_triangles(mesh, desc);
        if (status == TRC_OK && mesh->rows.how->surface == TRC_DICING_CURVED)
            trc_compute_vertex_normals(mesh);
    }
    TRC_TRY(status);
    const uint32_t levels_max = mesh->rows.how->max_subdivisions;
    return trc_split_edges(mesh, levels < levels_max ? levels_max - levels : 0);
}

trc_status trc_dice(const trc_mesh_desc *desc, struct trc_diced_mesh *diced_out) {
    struct trc_refined_mesh mesh = {.rows = trc_row_layout_of(desc)};
    *diced_out = (struct trc_diced_mesh){.desc = *desc};
    TRC_TRY(trc_check_indices(desc->indices, 3 * desc->triangle_count, desc->vertex_count));
    trc_status status = refine(&mesh, desc);
    if (status == TRC_OK)
        status = trc_diced_mesh_describe(&mesh, desc, diced_out);
    trc_refined_mesh_free(&mesh);
    if (status != TRC_OK)
        trc_diced_mesh_free(diced_out);
    return status;
}
