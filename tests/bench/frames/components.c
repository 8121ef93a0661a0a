#include "components.h"

#include <stdlib.h>

#include "buffers.h"

/* The lowest vertex that hangs together with v, with paths halved on the way (R. E. Tarjan and
 * J. van Leeuwen, "Worst-case analysis of set union algorithms", 1984). */
static uint32_t root_of(uint32_t *parent, uint32_t v) {
    while (parent[v] != v) {
        parent[v] = parent[parent[v]];
        v = parent[v];
    }
    return v;
}

static void join(uint32_t *parent, uint32_t a, uint32_t b) {
    a = root_of(parent, a);
    b = root_of(parent, b);
    if (a < b)
        parent[b] = a;
    else
        parent[a] = b;
}

uint16_t *components_of(const struct mesh *mesh, uint32_t modulus) {
    uint32_t *parent = buffer_alloc(mesh->vertex_count, sizeof *parent);
    uint32_t *number = buffer_alloc(mesh->vertex_count, sizeof *number);
    uint16_t *out = buffer_alloc(mesh->triangle_count, sizeof *out);
    uint32_t count = 0;
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        parent[v] = v;
    for (uint32_t i = 0; i < mesh->triangle_count; i++) {
        join(parent, mesh->indices[3 * i], mesh->indices[3 * i + 1]);
        join(parent, mesh->indices[3 * i], mesh->indices[3 * i + 2]);
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        number[v] = parent[v] == v ? count++ : 0;
    for (uint32_t i = 0; i < mesh->triangle_count; i++)
        out[i] = (uint16_t)(number[root_of(parent, mesh->indices[3 * i])] % modulus);
    free(parent);
    free(number);
    return out;
}
