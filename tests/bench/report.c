#include "report.h"

#include <string.h>

/* ---- JSON ---- */

static void json_string(FILE *json, const char *key, const char *value) {
    fprintf(json, "\"%s\": \"", key);
    for (; *value; value++)
        if (*value == '"' || *value == '\\')
            fprintf(json, "\\%c", *value);
        else if ((unsigned char)*value < ' ')
            fprintf(json, "\\u%04x", (unsigned)*value);
        else
            fputc(*value, json);
    fputc('"', json);
}

/* Nothing if there are no values. */
static void json_rate(FILE *json, const char *key, const struct rate *rate) {
    if (rate->count == 0)
        return;
    fprintf(json,
            ", \"%s\": {\"median\": %.6g, \"min\": %.6g, \"max\": %.6g, \"quartiles\": [%.6g, "
            "%.6g], \"repeats\": %u}",
            key, rate_median(rate), rate_quantile(rate, 0.0), rate_quantile(rate, 1.0),
            rate_quantile(rate, 0.25), rate_quantile(rate, 0.75), rate->count);
}

static void json_table(FILE *json, const char *what, const struct report_table *t) {
    fprintf(json, "{\"row\": \"%s\", ", what);
    json_string(json, "scene", t->scene);
    fprintf(json, ", \"triangles\": %u, \"motion\": %s, \"threads\": %u", t->triangle_count,
            t->moving ? "true" : "false", t->threads);
}

/* ---- text ---- */

static double divide(double a, double b) { return b > 0.0 ? a / b : 0.0; }

static void print_title(const struct report_table *t) {
    printf("\n%s (%u triangles), %s, %u %s", t->scene, t->triangle_count,
           t->moving ? "moving" : "static", t->threads, t->threads == 1 ? "thread" : "threads");
}

/* ---- builds ---- */

static void print_build(const char *what, const struct rate *ours, const struct rate *peer) {
    printf("  %-8s %8.2f Mtri/s (%.2f-%.2f)", what, rate_median(ours), rate_quantile(ours, 0.0),
           rate_quantile(ours, 1.0));
    if (peer && peer->count)
        printf("   Embree %8.2f (%.2f-%.2f)   ratio %.2f", rate_median(peer),
               rate_quantile(peer, 0.0), rate_quantile(peer, 1.0),
               divide(rate_median(ours), rate_median(peer)));
    printf("\n");
}

void report_builds(const struct report_table *table, const struct build_result *result,
                   FILE *json) {
    print_title(table);
    printf(": builds, median (least-most)\n");
    print_build("build", &result->build, &result->peer_build);
    print_build("commit", &result->commit, NULL);
    print_build("refit", &result->refit, &result->peer_refit);
    printf("  memory   %8.1f bytes/tri", result->bytes);
    if (result->peer_bytes > 0.0)
        printf("   Embree %8.1f   ratio %.2f", result->peer_bytes,
               divide(result->bytes, result->peer_bytes));
    printf("\n  SAH cost %8.2f\n", result->sah_cost);
    fflush(stdout);
    if (!json)
        return;
    json_table(json, "build", table);
    json_rate(json, "build_mtri_s", &result->build);
    json_rate(json, "commit_mtri_s", &result->commit);
    json_rate(json, "refit_mtri_s", &result->refit);
    fprintf(json, ", \"bytes_per_triangle\": %.6g, \"sah_cost\": %.6g", result->bytes,
            result->sah_cost);
    json_rate(json, "embree_build_mtri_s", &result->peer_build);
    json_rate(json, "embree_refit_mtri_s", &result->peer_refit);
    if (result->peer_bytes > 0.0)
        fprintf(json, ", \"embree_bytes_per_triangle\": %.6g", result->peer_bytes);
    fprintf(json, "}\n");
}

/* ---- rays ---- */

static const char *const use_names[2] = {"default", "robust"};

static uint32_t best_mode(const struct race_row *row, int use) {
    uint32_t best = 0;
    for (uint32_t i = 1; i < row->mode_count; i++)
        if (rate_median(&row->peer[use][i]) > rate_median(&row->peer[use][best]))
            best = i;
    return best;
}

void report_races_begin(const struct report_table *table, bool peer) {
    print_title(table);
    printf(", %s, rays %s, Mrays/s\n", trc_isa_name(table->isa),
           table->streamed ? "streamed" : "in cache");
    printf("  %-16s %-5s %6s %7s %15s %6s", "rays", "order", "in pkt", "volley", "(least-most)",
           "miss%");
    if (table->queries)
        printf(" | %7s %6s %7s %6s %6s", "query", "ratio", "alone", "ratio", "differ");
    if (peer)
        printf(" | %7s %7s %7s %7s %7s %6s %6s | %7s %6s %6s", "single", "packet", "coher.",
               "stream", "coher.", "ratio", "differ", "robust", "ratio", "differ");
    printf("\n");
}

static uint32_t differences(const struct hit_difference *d) {
    return d->only_a + d->only_b + d->distance;
}

static void print_race(const struct race_row *row) {
    const struct ray_list *list = row->list;
    char spread[32];
    const double ours = rate_median(&row->volley);
    snprintf(spread, sizeof spread, "(%.2f-%.2f)", rate_quantile(&row->volley, 0.0),
             rate_quantile(&row->volley, 1.0));
    printf("  %-16s %-5s %6.1f %7.2f %15s %6.2f", ray_kind_names[list->kind],
           ray_order_names[list->order], divide(list->rays.count, list->packet_count), ours, spread,
           100.0 * row->miss_share);
    if (row->query.count) {
        const double query = rate_median(&row->query), alone = rate_median(&row->alone);
        const bool peer = row->mode_count > 0;
        printf(" | %7.2f %6.2f %7.2f %6.2f %6u", query,
               peer ? divide(query, rate_median(&row->peer[0][best_mode(row, 0)])) : 0.0, alone,
               peer ? divide(alone, rate_median(&row->peer[0][0])) : 0.0, row->query_differences);
    }
    if (row->mode_count) {
        printf(" |");
        for (uint32_t i = 0; i < EMBREE_MODES; i++)
            printf(" %7.2f", i < row->mode_count ? rate_median(&row->peer[0][i]) : 0.0);
        const double best = rate_median(&row->peer[0][best_mode(row, 0)]);
        const double robust = rate_median(&row->peer[1][best_mode(row, 1)]);
        printf(" %6.2f %6u | %7.2f %6.2f %6u", divide(ours, best), differences(&row->difference[0]),
               robust, divide(ours, robust), differences(&row->difference[1]));
    }
    printf("\n");
    fflush(stdout);
}

static void json_peer(FILE *json, const struct race_row *row, int use) {
    const uint32_t best = best_mode(row, use);
    const struct hit_difference *d = &row->difference[use];
    fprintf(json, ", \"embree_%s\": {\"best\": \"%s\", \"ratio\": %.4g, \"miss_share\": %.6g",
            use_names[use], row->modes[best].name,
            divide(rate_median(&row->volley), rate_median(&row->peer[use][best])),
            row->peer_miss_share[use]);
    fprintf(json,
            ", \"only_volley_hits\": %u, \"only_embree_hits\": %u, \"other_distances\": %u, "
            "\"largest_relative_difference\": %.3g",
            d->only_a, d->only_b, d->distance, d->largest);
    for (uint32_t i = 0; i < row->mode_count; i++)
        json_rate(json, row->modes[i].name, &row->peer[use][i]);
    fprintf(json, "}");
}

void report_race(const struct report_table *table, const struct race_row *row, FILE *json) {
    const struct ray_list *list = row->list;
    print_race(row);
    if (!json)
        return;
    json_table(json, "rays", table);
    fprintf(json,
            ", \"isa\": \"%s\", \"streamed\": %s, \"kind\": \"%s\", \"order\": \"%s\", \"rays\": "
            "%u, \"packets\": "
            "%u, \"miss_share\": %.6g",
            trc_isa_name(table->isa), table->streamed ? "true" : "false",
            ray_kind_names[list->kind], ray_order_names[list->order], list->rays.count,
            list->packet_count, row->miss_share);
    json_rate(json, "volley_mrays_s", &row->volley);
    json_rate(json, "query_mrays_s", &row->query);
    json_rate(json, "query_alone_mrays_s", &row->alone);
    for (int use = 0; use < 2 && row->mode_count; use++)
        json_peer(json, row, use);
    fprintf(json, "}\n");
    fflush(json);
}

/* ---- counts ---- */

void report_counts_begin(const struct report_table *table) {
    print_title(table);
    printf(", counts per ray\n  %-16s %-5s %8s %8s %9s %12s %13s %6s\n", "rays", "order", "beams",
           "boxes", "triangles", "nodes alone", "leaves alone", "live");
}

void report_counts(const struct report_table *table, const struct ray_list *list,
                   const struct trace_counts *counts, FILE *json) {
    const double rays = list->rays.count;
    const double live = divide((double)counts->visit_rays, (double)counts->visits);
    const struct {
        const char *key;
        int width;
        double value;
    } columns[] = {{"beams", 8, divide((double)counts->nodes, rays)},
                   {"box_tests", 8, divide((double)counts->box_rays, rays)},
                   {"triangle_tests", 9, divide((double)counts->triangle_rays, rays)},
                   {"nodes_alone", 12, divide((double)counts->single_nodes, rays)},
                   {"leaves_alone", 13, divide((double)counts->single_leaves, rays)},
                   {"live_rays", 6, live}};
    const size_t count = sizeof columns / sizeof *columns;
    printf("  %-16s %-5s", ray_kind_names[list->kind], ray_order_names[list->order]);
    for (size_t i = 0; i < count; i++)
        printf(" %*.2f", columns[i].width, columns[i].value);
    printf("\n");
    fflush(stdout);
    if (!json)
        return;
    json_table(json, "counts", table);
    fprintf(json, ", \"kind\": \"%s\", \"order\": \"%s\"", ray_kind_names[list->kind],
            ray_order_names[list->order]);
    for (size_t i = 0; i < count; i++)
        fprintf(json, ", \"%s\": %.6g", columns[i].key, columns[i].value);
    fprintf(json, "}\n");
}
