#include "dicing/diced_mesh.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/vector.h"

static trc_status alloc_attributes(const trc_mesh_desc *desc, struct trc_diced_mesh *out) {
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        trc_corner_attribute *attribute = &out->attributes[i];
        *attribute = desc->attributes[i];
        attribute->value_count = attribute->width * out->desc.index_count;
        attribute->values = out->values[i] = trc_alloc(attribute->value_count, sizeof(float));
        if (!attribute->values)
            return trc_no_memory_to_dice();
    }
    out->desc.attributes = out->attributes;
    return TRC_OK;
}

static void write_rows(const struct trc_refined_mesh *mesh, struct trc_diced_mesh *out) {
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const float *from = trc_refined_row(mesh, v);
        for (size_t k = 0; k < mesh->rows.key_count; k++) {
            const size_t to = 3 * (mesh->vertex_count * k + v);
            memcpy(out->positions + to, from + 3 * k, 3 * sizeof *from);
            if (!out->normals)
                continue;
            const float *n = from + mesh->rows.normals + 3 * k;
            const float size = trc_length(n);
            for (size_t i = 0; i < 3; i++)
                out->normals[to + i] = size > 0.0f ? n[i] / size : 0.0f;
        }
        if (mesh->rows.generated)
            memcpy(out->generated + 3 * v, from + mesh->rows.generated, 3 * sizeof *from);
    }
}

static void write_corners(const struct trc_refined_mesh *mesh, struct trc_diced_mesh *out) {
    size_t offset = 0;
    for (uint32_t i = 0; i < out->desc.attribute_count; i++) {
        const size_t width = out->attributes[i].width;
        for (size_t c = 0; c < 3 * mesh->done.count; c++)
            memcpy(out->values[i] + width * c,
                   mesh->done.corners + mesh->rows.corner_width * c + offset,
                   width * sizeof(float));
        offset += width;
    }
}

trc_status trc_diced_mesh_describe(struct trc_refined_mesh *mesh, const trc_mesh_desc *desc,
                                   struct trc_diced_mesh *out) {
    const bool keeps_normals = mesh->rows.how->surface == TRC_DICING_LINEAR && mesh->rows.normals;
    const size_t floats = 3 * mesh->vertex_count * mesh->rows.key_count;
    out->is_coarse = mesh->is_coarse;
    out->positions = trc_alloc(floats, sizeof(float));
    out->normals = keeps_normals ? trc_alloc(floats, sizeof(float)) : NULL;
    out->generated = mesh->rows.generated ? trc_alloc(3 * mesh->vertex_count, sizeof(float)) : NULL;
    if (!out->positions || (keeps_normals && !out->normals) ||
        (mesh->rows.generated && !out->generated))
        return trc_no_memory_to_dice();
    out->desc.index_count = 3 * mesh->done.count;
    TRC_TRY(alloc_attributes(desc, out));
    write_rows(mesh, out);
    write_corners(mesh, out);
    out->indices = mesh->done.indices;
    out->smooth = mesh->done.smooth;
    out->material_index = mesh->done.material_index;
    mesh->done.indices = NULL;
    mesh->done.smooth = NULL;
    mesh->done.material_index = NULL;
    trc_mesh_desc *to = &out->desc;
    to->dicing = NULL;
    to->vertex_count = mesh->vertex_count;
    to->triangle_count = mesh->done.count;
    to->positions = out->positions;
    to->position_count = floats;
    to->indices = out->indices;
    to->normals = out->normals;
    to->normal_kind = keeps_normals ? TRC_NORMALS_VERTEX : TRC_NORMALS_NONE;
    to->normal_count = keeps_normals ? floats : 0;
    to->smooth = out->smooth;
    to->material_index = out->material_index;
    to->generated = out->generated;
    to->generated_count = mesh->rows.generated ? 3 * mesh->vertex_count : 0;
    return TRC_OK;
}

void trc_diced_mesh_free(struct trc_diced_mesh *diced) {
    trc_free(diced->indices);
    trc_free(diced->positions);
    trc_free(diced->normals);
    trc_free(diced->generated);
    trc_free(diced->smooth);
    trc_free(diced->material_index);
    for (uint32_t i = 0; i < TRC_MAX_ATTRIBUTES; i++)
        trc_free(diced->values[i]);
}
