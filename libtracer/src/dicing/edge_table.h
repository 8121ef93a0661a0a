/* A number for each edge of a mesh that is asked for. */
#ifndef TRACER_DICING_EDGE_TABLE_H
#define TRACER_DICING_EDGE_TABLE_H

#include <stdbool.h>
#include <stdint.h>

struct trc_edge_table {
    uint64_t *keys; /* both vertices, the smaller one above; UINT64_MAX: free */
    uint32_t *values;
    uint64_t mask;
};

/* For up to count edges; false without memory. Free it in either case. */
bool trc_edge_table_create(struct trc_edge_table *table, uint64_t count);
void trc_edge_table_free(struct trc_edge_table *table);

/* The value of an edge of two vertices in either order: next, which is then stored, where it has
 * none yet. */
uint32_t trc_edge_table_take(struct trc_edge_table *table, uint32_t a, uint32_t b, uint32_t next);

/* The value of an edge, UINT32_MAX where it has none. */
uint32_t trc_edge_table_find(const struct trc_edge_table *table, uint32_t a, uint32_t b);

#endif
