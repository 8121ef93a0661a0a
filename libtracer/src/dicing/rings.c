#include "dicing/rings.h"

#include "core/core.h"
#include "dicing/edge_table.h"
#include "dicing/refined_mesh.h"

/* From here on a sharpness does not end, as in OpenSubdiv. */
#define SHARPNESS_INFINITE 10.0f

void trc_rings_free(struct trc_rings *r) {
    trc_free(r->edges);
    trc_free(r->ends);
    trc_free(r->uses);
    trc_free(r->sharpness);
    trc_free(r->rings);
    trc_free(r->rules);
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
                if (r->sharpness)
                    r->sharpness[edge] = f->edge_sharpness[c];
                r->edge_count++;
            }
            r->edges[c] = edge;
            r->uses[edge]++;
            r->rings[a].face_count++;
        }
    }
}

float trc_sharpness_after(float sharpness) {
    if (sharpness >= SHARPNESS_INFINITE)
        return sharpness;
    return sharpness > 1.0f ? sharpness - 1.0f : 0.0f;
}

static float sharpness_of(const struct trc_rings *r, size_t edge) {
    if (r->uses[edge] != 2)
        return SHARPNESS_INFINITE;
    return r->sharpness ? r->sharpness[edge] : 0.0f;
}

static void count_sharp_edges(struct trc_rings *r) {
    for (size_t e = 0; e < r->edge_count; e++) {
        const float sharpness = sharpness_of(r, e);
        const bool is_sharp = sharpness > 0.0f, stays = trc_sharpness_after(sharpness) > 0.0f;
        for (size_t k = 0; k < 2; k++) {
            struct trc_ring *ring = &r->rings[r->ends[2 * e + k]];
            ring->boundary_count += r->uses[e] != 2;
            ring->sharp_count += is_sharp;
            ring->still_sharp_count += stays;
            if (is_sharp && !stays)
                ring->ending += sharpness;
        }
    }
}

float trc_edge_rule(const struct trc_rings *r, size_t edge) {
    const float sharpness = sharpness_of(r, edge);
    return sharpness < 1.0f ? sharpness : 1.0f;
}

enum rule { SMOOTH, CREASE, CORNER };

static enum rule rule_of(float vertex_sharpness, uint32_t sharp_count) {
    if (vertex_sharpness > 0.0f || sharp_count > 2)
        return CORNER;
    return sharp_count == 2 ? CREASE : SMOOTH;
}

/* Infinite where a vertex is a corner by its edges, whatever the rest. */
static float vertex_sharpness_of(const struct trc_faces *f, const struct trc_ring *ring,
                                 uint32_t vertex) {
    const bool is_odd = !ring->face_count || ring->boundary_count % 2 || ring->boundary_count > 2;
    if (is_odd || (f->sharp_corners && ring->face_count == 1))
        return SHARPNESS_INFINITE;
    return f->vertex_sharpness ? f->vertex_sharpness[vertex] : 0.0f;
}

static struct trc_vertex_rule rule_of_vertex(const struct trc_faces *f, const struct trc_rings *r,
                                             uint32_t vertex) {
    const struct trc_ring *ring = &r->rings[vertex];
    const float sharpness = vertex_sharpness_of(f, ring, vertex);
    const float sharpness_after = trc_sharpness_after(sharpness);
    const enum rule rules[2] = {rule_of(sharpness, ring->sharp_count),
                                rule_of(sharpness_after, ring->still_sharp_count)};
    float parts[2] = {1.0f, 0.0f};
    /* A rule that ends holds by the mean sharpness of all that ends. */
    if (rules[0] != rules[1]) {
        const bool vertex_ends = sharpness > 0.0f && !(sharpness_after > 0.0f);
        const uint32_t count = ring->sharp_count - ring->still_sharp_count + vertex_ends;
        parts[0] = (ring->ending + (vertex_ends ? sharpness : 0.0f)) / (float)count;
        parts[1] = 1.0f - parts[0];
    }
    /* A corner may become a crease: along what is still sharp at the next level. */
    struct trc_vertex_rule rule = {.sharpness_min = rules[0] == CREASE ? 0.0f : 1.0f};
    for (int i = 0; i < 2; i++) {
        rule.smooth += rules[i] == SMOOTH ? parts[i] : 0.0f;
        rule.crease += rules[i] == CREASE ? parts[i] : 0.0f;
    }
    return rule;
}

trc_status trc_rings_find(const struct trc_faces *f, struct trc_rings *r) {
    const size_t corners = f->begin[f->face_count];
    *r = (struct trc_rings){
        .edges = trc_alloc(corners, sizeof *r->edges),
        .ends = trc_alloc(2 * corners, sizeof *r->ends),
        .uses = trc_alloc(corners, sizeof *r->uses),
        .sharpness = f->edge_sharpness ? trc_alloc(corners, sizeof *r->sharpness) : NULL,
        .rings = trc_alloc_zeroed(f->vertex_count, sizeof *r->rings),
        .rules = trc_alloc(f->vertex_count, sizeof *r->rules),
    };
    struct trc_edge_table table;
    const bool enough = trc_edge_table_create(&table, corners) && r->edges && r->ends && r->uses &&
                        (r->sharpness || !f->edge_sharpness) && r->rings && r->rules;
    if (enough) {
        number_edges(f, &table, r);
        count_sharp_edges(r);
        for (uint32_t v = 0; v < f->vertex_count; v++)
            r->rules[v] = rule_of_vertex(f, r, v);
    }
    trc_edge_table_free(&table);
    return enough ? TRC_OK : trc_no_memory_to_dice();
}

bool trc_is_along_crease(const struct trc_rings *r, const struct trc_vertex_rule *rule,
                         size_t edge) {
    return rule->crease > 0.0f && sharpness_of(r, edge) > rule->sharpness_min;
}
