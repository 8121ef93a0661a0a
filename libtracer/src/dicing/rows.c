#include "dicing/rows.h"

#include <stdbool.h>
#include <string.h>

struct trc_row_layout trc_row_layout_of(const trc_mesh_desc *desc) {
    struct trc_row_layout rows = {
        .how = desc->dicing,
        .key_count = desc->key_count,
        .vertex_width = 3 * desc->key_count,
    };
    if (desc->generated) {
        rows.generated = rows.vertex_width;
        rows.vertex_width += 3;
    }
    for (uint32_t i = 0; i < desc->attribute_count; i++)
        rows.corner_width += desc->attributes[i].width;
    const bool has_normals = desc->normals && desc->normal_kind == TRC_NORMALS_VERTEX;
    if (rows.how->surface != TRC_DICING_LINEAR || has_normals) {
        rows.normals = rows.vertex_width;
        rows.vertex_width += 3 * rows.key_count;
    }
    return rows;
}

void trc_fill_row(const struct trc_row_layout *rows, const trc_mesh_desc *desc, size_t vertex,
                  float *to) {
    for (size_t k = 0; k < rows->key_count; k++) {
        const size_t from = 3 * (desc->vertex_count * k + vertex);
        memcpy(to + 3 * k, desc->positions + from, 3 * sizeof *to);
        if (rows->how->surface == TRC_DICING_LINEAR && rows->normals)
            memcpy(to + rows->normals + 3 * k, desc->normals + from, 3 * sizeof *to);
    }
    if (rows->generated)
        memcpy(to + rows->generated, desc->generated + 3 * vertex, 3 * sizeof *to);
}

void trc_fill_corner(const trc_mesh_desc *desc, size_t corner, float *to) {
    for (uint32_t i = 0; i < desc->attribute_count; i++) {
        const size_t width = desc->attributes[i].width;
        memcpy(to, desc->attributes[i].values + width * corner, width * sizeof *to);
        to += width;
    }
}

uint16_t trc_slot_of(const trc_mesh_desc *desc, size_t triangle) {
    return desc->material_index ? desc->material_index[triangle] : 0;
}

uint8_t trc_smooth_of(const trc_mesh_desc *desc, size_t triangle) {
    if (desc->normals && desc->normal_kind == TRC_NORMALS_CORNER)
        return 1;
    return desc->smooth ? desc->smooth[triangle] : 0;
}
