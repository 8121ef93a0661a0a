/* Results as a table for people and, if wanted, as JSON, one object per line. */
#ifndef TRACER_BENCH_REPORT_H
#define TRACER_BENCH_REPORT_H

#include <stdbool.h>
#include <stdio.h>

#include "builds.h"
#include "counted.h"
#include "embree.h"
#include "race.h"

/* What all rows of a table have in common. */
struct report_table {
    const char *scene;
    uint32_t triangle_count;
    bool moving, streamed, queries;
    uint32_t isa, threads;
};

/* Rates in Mrays/s; [0]: Embree's default scene, [1]: its robust one. */
struct race_row {
    const struct ray_list *list;
    struct rate volley;
    struct rate query, alone;   /* public queries, also of packets of one ray; count 0: not run */
    uint32_t query_differences; /* rays whose hit is another than the kernels' */
    double miss_share;
    uint32_t mode_count; /* 0: Embree was not run */
    struct contestant modes[EMBREE_MODES];
    struct rate peer[2][EMBREE_MODES];
    struct hit_difference difference[2]; /* a: Volley, b: Embree's single rays */
    double peer_miss_share[2];
};

/* json: NULL for none. */
void report_builds(const struct report_table *table, const struct build_result *result, FILE *json);
void report_races_begin(const struct report_table *table, bool peer);
void report_race(const struct report_table *table, const struct race_row *row, FILE *json);

void report_counts_begin(const struct report_table *table);
void report_counts(const struct report_table *table, const struct ray_list *list,
                   const struct trace_counts *counts, FILE *json);

#endif
