#include "dicing/rings.h"

#include "core/core.h"
#include "dicing/edge_table.h"
#include "dicing/refined_mesh.h"

void trc_rings_free(struct trc_rings *r) {
    trc_free(r->edges);
    trc_free(r->ends);
    trc_free(r->uses);
    trc_free(r->rings);
}

static void number_edges(const struct trc_faces *f, struct trc_edge_table *table,
                         struct trc_rings *r) {
    for (uint32_t face = 0; face < f->face_count; face++) {
        for (uint32_t c = f->begin[face]; c < f->begin[face + 1]; c++) {
            const uint32_t a = f->indices[c], b = f->indices[trc_next_corner(f, face, c)];
            const uint32_t edge = trc_edge_table_take(table, a, b, r->edge_count);
            if (edge == r->edge_count) {
                r->ends[2 * (size_t)edge] = a;
                r->ends[2 * (size_t)edge + 1] = b;
                r->uses[edge] = 0;
                r->edge_count++;
            }
            r->edges[c] = edge;
            r->uses[edge]++;
            r->rings[a].face_count++;
        }
    }
}

static void count_boundaries(struct trc_rings *r) {
    for (size_t e = 0; e < r->edge_count; e++)
        for (size_t k = 0; k < 2; k++)
            r->rings[r->ends[2 * e + k]].boundary_count += r->uses[e] != 2;
}

trc_status trc_rings_find(const struct trc_faces *f, struct trc_rings *r) {
    const size_t corners = f->begin[f->face_count];
    *r = (struct trc_rings){
        .edges = trc_alloc(corners, sizeof *r->edges),
        .ends = trc_alloc(2 * corners, sizeof *r->ends),
        .uses = trc_alloc(corners, sizeof *r->uses),
        .rings = trc_alloc_zeroed(f->vertex_count, sizeof *r->rings),
    };
    struct trc_edge_table table;
    const bool enough =
        trc_edge_table_create(&table, corners) && r->edges && r->ends && r->uses && r->rings;
    if (enough) {
        number_edges(f, &table, r);
        count_boundaries(r);
    }
    trc_edge_table_free(&table);
    return enough ? TRC_OK : trc_no_memory_to_dice();
}

float trc_edge_rule(const struct trc_rings *r, size_t edge) {
    return r->uses[edge] == 2 ? 0.0f : 1.0f;
}

struct trc_vertex_rule trc_vertex_rule_of(const struct trc_faces *f, const struct trc_rings *r,
                                          uint32_t vertex) {
    const struct trc_ring *ring = &r->rings[vertex];
    const bool is_sharp_corner = f->sharp_corners && ring->face_count == 1;
    return (struct trc_vertex_rule){
        .smooth = ring->face_count && !ring->boundary_count,
        .crease = ring->boundary_count == 2 && !is_sharp_corner,
    };
}

bool trc_is_along_crease(const struct trc_rings *r, const struct trc_vertex_rule *rule,
                         size_t edge) {
    return rule->crease > 0.0f && r->uses[edge] != 2;
}
