#include "dicing/face_joining.h"

#include "core/core.h"
#include "dicing/creases.h"
#include "dicing/refined_mesh.h"

/* Whether another triangle of a face shares the edge that begins at a corner. */
static bool is_inner(const uint32_t *indices, size_t count, size_t corner) {
    const uint32_t a = indices[corner], b = indices[corner / 3 * 3 + (corner + 1) % 3];
    for (size_t c = 0; c < count; c++)
        if (indices[c] == b && indices[c / 3 * 3 + (c + 1) % 3] == a)
            return true;
    return false;
}

/* The outline of the triangles of one face, count corners from the first on; its number of
 * corners, written as theirs. 0: it is not one ring. */
static uint32_t trace_outline(const uint32_t *indices, size_t count, uint32_t *outline) {
    uint32_t size = 0;
    const size_t expected = count / 3 + 2;
    size_t corner = 0;
    while (corner < count && is_inner(indices, count, corner))
        corner++;
    const size_t first = corner;
    while (corner < count && size < expected) {
        outline[size++] = (uint32_t)corner;
        const uint32_t end = indices[corner / 3 * 3 + (corner + 1) % 3];
        for (corner = 0; corner < count; corner++)
            if (indices[corner] == end && !is_inner(indices, count, corner))
                break;
        if (corner == first)
            break;
    }
    return corner == first && size == expected ? size : 0;
}

static void put_face(struct trc_faces *f, const trc_mesh_desc *desc, size_t triangle,
                     const uint32_t *outline, uint32_t size) {
    const uint32_t begin = f->begin[f->face_count];
    for (uint32_t k = 0; k < size; k++) {
        const size_t corner = 3 * triangle + outline[k];
        f->indices[begin + k] = desc->indices[corner];
        trc_fill_corner(desc, corner, f->corners + f->corner_width * (begin + k));
    }
    f->material_index[f->face_count] = trc_slot_of(desc, triangle);
    f->smooth[f->face_count] = trc_smooth_of(desc, triangle);
    f->begin[++f->face_count] = begin + size;
}

/* Triangles of one face become one, or stay where they make no ring. */
static void join_triangles(struct trc_faces *f, const trc_mesh_desc *desc, uint32_t *outline) {
    static const uint32_t whole[3] = {0, 1, 2};
    const uint32_t *faces = desc->dicing->faces;
    size_t end;
    f->begin[0] = 0;
    for (size_t t = 0; t < desc->triangle_count; t = end) {
        for (end = t + 1; faces && end < desc->triangle_count && faces[end] == faces[t]; end++)
            continue;
        const uint32_t size = trace_outline(desc->indices + 3 * t, 3 * (end - t), outline);
        if (size)
            put_face(f, desc, t, outline, size);
        for (size_t k = t; !size && k < end; k++)
            put_face(f, desc, k, whole, 3);
    }
}

trc_status trc_join_faces(const struct trc_row_layout *rows, const trc_mesh_desc *desc,
                          struct trc_faces *f) {
    const size_t corners = 3 * desc->triangle_count;
    *f = (struct trc_faces){
        .vertex_width = 3 * rows->key_count + (rows->generated ? 3 : 0),
        .corner_width = rows->corner_width,
        .vertex_count = (uint32_t)desc->vertex_count,
        .sharp_corners = desc->dicing->sharp_corners != 0,
        .begin = trc_alloc(desc->triangle_count + 1, sizeof *f->begin),
        .indices = trc_alloc(corners, sizeof *f->indices),
        .corners = trc_alloc(corners * rows->corner_width, sizeof *f->corners),
        .material_index = trc_alloc(desc->triangle_count, sizeof *f->material_index),
        .smooth = trc_alloc(desc->triangle_count, 1),
    };
    f->vertices = trc_alloc(desc->vertex_count * f->vertex_width, sizeof *f->vertices);
    uint32_t *outline = trc_alloc(desc->triangle_count + 2, sizeof *outline);
    const bool enough = f->begin && f->indices && f->corners && f->material_index && f->smooth &&
                        f->vertices && outline;
    if (enough) {
        join_triangles(f, desc, outline);
        for (size_t v = 0; v < desc->vertex_count; v++)
            trc_fill_row(rows, desc, v, f->vertices + f->vertex_width * v);
    }
    trc_free(outline);
    return enough ? trc_take_creases(f, desc->dicing) : trc_no_memory_to_dice();
}
