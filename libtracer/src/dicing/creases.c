#include "dicing/creases.h"

#include <string.h>

#include "core/checks.h"
#include "core/core.h"
#include "dicing/edge_table.h"
#include "dicing/refined_mesh.h"

static void look_up_edges(struct trc_faces *f, const trc_dicing_desc *how,
                          struct trc_edge_table *table) {
    for (uint32_t i = 0; i < how->crease_count; i++)
        trc_edge_table_take(table, how->crease_edges[2 * (size_t)i],
                            how->crease_edges[2 * (size_t)i + 1], i);
    for (uint32_t face = 0; face < f->face_count; face++) {
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t next = trc_next_corner(f, face, c);
            const uint32_t crease = trc_edge_table_find(table, f->indices[c], f->indices[next]);
            f->edge_sharpness[c] = crease < UINT32_MAX ? how->crease_sharpness[crease] : 0.0f;
        }
    }
}

static trc_status take_edges(struct trc_faces *f, const trc_dicing_desc *how) {
    struct trc_edge_table table;
    f->edge_sharpness = trc_alloc(f->begin[f->face_count], sizeof *f->edge_sharpness);
    const bool enough = trc_edge_table_create(&table, how->crease_count) && f->edge_sharpness;
    if (enough)
        look_up_edges(f, how, &table);
    trc_edge_table_free(&table);
    return enough ? TRC_OK : trc_no_memory_to_dice();
}

trc_status trc_take_creases(struct trc_faces *f, const trc_dicing_desc *how) {
    if (how->crease_count)
        TRC_TRY(take_edges(f, how));
    if (!how->vertex_sharpness)
        return TRC_OK;
    f->vertex_sharpness = trc_alloc(f->vertex_count, sizeof *f->vertex_sharpness);
    if (!f->vertex_sharpness)
        return trc_no_memory_to_dice();
    memcpy(f->vertex_sharpness, how->vertex_sharpness,
           f->vertex_count * sizeof *f->vertex_sharpness);
    return TRC_OK;
}
