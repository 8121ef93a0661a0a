#include "options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/thread.h"
#include "kernels.h"
#include "rate.h"
#include "rays.h"

/* ---- parts of arguments ---- */

/* The items of a list with commas, one at a time, into item; false at the end, or if one is too
 * long or empty (then *bad is set). */
static bool next_item(const char **list, char item[64], bool *bad) {
    if (!*list)
        return false;
    const size_t length = strcspn(*list, ",");
    *bad = length == 0 || length >= 64;
    if (*bad)
        return false;
    memcpy(item, *list, length);
    item[length] = '\0';
    *list = (*list)[length] ? *list + length + 1 : NULL;
    return true;
}

static bool parse_number(const char *text, uint32_t low, uint32_t high, uint32_t *out) {
    char *end;
    const unsigned long value = strtoul(text, &end, 10);
    if (end == text || *end || *text == '-' || value < low || value > high)
        return false;
    *out = (uint32_t)value;
    return true;
}

/* Bits of the names in a list. */
static bool parse_names(const char *text, const char *const *names, uint32_t count,
                        uint32_t *bits_out) {
    char item[64];
    bool bad = false;
    uint32_t bits = 0;
    while (next_item(&text, item, &bad)) {
        uint32_t i = 0;
        while (i < count && strcmp(item, names[i]) != 0)
            i++;
        if (i == count)
            return false;
        bits |= 1u << i;
    }
    *bits_out = bits;
    return !bad;
}

/* ---- options ---- */

static bool set_scene(struct options *o, const char *text) {
    if (o->scene_count == OPTIONS_SCENES)
        return false;
    o->scenes[o->scene_count++] = text;
    return true;
}

static void set_all_isas(struct options *o) {
    o->isa_count = 0;
    for (uint32_t isa = TRC_ISA_SCALAR; isa <= TRC_ISA_NEON; isa++)
        if (packet_kernels_get(isa))
            o->isas[o->isa_count++] = isa;
}

static bool set_isa(struct options *o, const char *text) {
    char item[64];
    bool bad = false;
    o->isa_count = 0;
    if (strcmp(text, "all") == 0) {
        set_all_isas(o);
        return true;
    }
    while (next_item(&text, item, &bad)) {
        uint32_t isa = TRC_ISA_SCALAR;
        while (isa <= TRC_ISA_NEON && strcmp(item, trc_isa_name(isa)) != 0)
            isa++;
        if (isa > TRC_ISA_NEON || !packet_kernels_get(isa) || o->isa_count == OPTIONS_ISAS)
            return false;
        o->isas[o->isa_count++] = isa;
    }
    return !bad;
}

static bool set_threads(struct options *o, const char *text) {
    char item[64];
    bool bad = false;
    o->thread_count = 0;
    while (next_item(&text, item, &bad)) {
        uint32_t threads = trc_thread_processor_count();
        bool again = false;
        if (strcmp(item, "all") != 0 && !parse_number(item, 1, TRC_MAX_THREADS, &threads))
            return false;
        for (uint32_t i = 0; i < o->thread_count; i++)
            again = again || o->threads[i] == threads;
        if (!again && o->thread_count == OPTIONS_THREADS)
            return false;
        if (!again)
            o->threads[o->thread_count++] = threads;
    }
    return !bad;
}

static bool set_turn(struct options *o, const char *text) {
    return parse_number(text, 0, 359, &o->turn);
}
static bool set_kinds(struct options *o, const char *text) {
    return parse_names(text, ray_kind_names, RAY_KIND_COUNT, &o->kinds);
}
static bool set_orders(struct options *o, const char *text) {
    return parse_names(text, ray_order_names, RAY_ORDER_COUNT, &o->orders);
}
static bool set_motion(struct options *o, const char *text) {
    static const char *const names[] = {"still", "moving"};
    return parse_names(text, names, 2, &o->motions);
}
static bool set_repeats(struct options *o, const char *text) {
    return parse_number(text, 1, RATE_REPEATS, &o->repeats);
}
static bool set_size(struct options *o, const char *text) {
    return parse_number(text, 8, 65535, &o->size);
}
static bool set_samples(struct options *o, const char *text) {
    return parse_number(text, 1, 4096, &o->samples);
}
static bool set_bundle(struct options *o, const char *text) {
    return parse_number(text, 1, TRC_BUNDLE, &o->bundle);
}
static bool set_tiles(struct options *o, const char *text) {
    return parse_number(text, 1, 65536, &o->tiles);
}
static bool set_json(struct options *o, const char *text) {
    o->json = text;
    return true;
}
static bool set_streamed(struct options *o, const char *text) {
    (void)text;
    return o->streamed = true;
}
static bool set_queries(struct options *o, const char *text) {
    (void)text;
    return o->queries = true;
}
static bool set_no_embree(struct options *o, const char *text) {
    (void)text;
    o->embree = false;
    return true;
}
static bool set_no_builds(struct options *o, const char *text) {
    (void)text;
    o->builds = false;
    return true;
}
static bool set_counts(struct options *o, const char *text) {
    (void)text;
    return o->counts = true;
}
static bool set_accuracy(struct options *o, const char *text) {
    (void)text;
    return o->accuracy = true;
}
static bool set_strands(struct options *o, const char *text) {
    (void)text;
    return o->strands = true;
}
static bool set_check(struct options *o, const char *text) {
    (void)text;
    return o->check = true;
}

static const struct {
    const char *name, *argument, *help; /* argument: NULL for none */
    bool (*set)(struct options *, const char *);
} table[] = {
    {"--scene", "NAME|FILE.obj", "a generated scene or a file, may be repeated (conference)",
     set_scene},
    {"--turn", "DEGREES", "turns scenes and cameras about the vertical (0)", set_turn},
    {"--isa", "LIST", "instruction sets or 'all' (the best of this CPU, and avx2 beside avx512)",
     set_isa},
    {"--threads", "LIST", "thread counts, numbers or 'all' (1,all)", set_threads},
    {"--kinds", "LIST", "kinds of rays (all)", set_kinds},
    {"--order", "LIST", "orders of rays (auto,pixel)", set_orders},
    {"--motion", "LIST", "still, moving (both)", set_motion},
    {"--repeats", "N", "measured repeats, after one that warms up (5)", set_repeats},
    {"--size", "N", "edge of the square frame, pixels (1024)", set_size},
    {"--samples", "N", "samples per pixel (16)", set_samples},
    {"--bundle", "N", "packets that go together at most, where the renderer has them do so (4)",
     set_bundle},
    {"--tiles", "N", "tiles of 32x32 pixels that are traced, over four cameras (16)", set_tiles},
    {"--streamed", NULL, "rays and results pass through memory (default: stay in cache)",
     set_streamed},
    {"--queries", NULL, "also trace the rays through the public ray queries", set_queries},
    {"--no-embree", NULL, "do not run Embree", set_no_embree},
    {"--no-builds", NULL, "do not measure builds and refits", set_no_builds},
    {"--counts", NULL, "also count box and triangle tests and live rays", set_counts},
    {"--accuracy", NULL, "how exact hits at vertices and edges are; measures nothing else",
     set_accuracy},
    {"--strands", NULL, "curves beside Embree's, on one thread; measures nothing else",
     set_strands},
    {"--check", NULL, "compare hits with brute force and measure nothing", set_check},
    {"--json", "FILE", "also write one JSON object per row", set_json},
};
#define OPTION_COUNT (sizeof table / sizeof *table)

static void print_names(const char *title, const char *const *names, uint32_t count) {
    printf("%s:", title);
    for (uint32_t i = 0; i < count && *names[i]; i++)
        printf(" %s", names[i]);
    printf("\n");
}

static void print_help(void) {
    printf(
        "Usage: tracer_bench [option]...\n\n"
        "Measures builds, refits and rays per second of Volley's kernels, beside Embree 3 on the\n"
        "same rays where it is there.\n\n");
    for (size_t i = 0; i < OPTION_COUNT; i++) {
        char left[32];
        snprintf(left, sizeof left, "%s %s", table[i].name,
                 table[i].argument ? table[i].argument : "");
        printf("  %-22s %s\n", left, table[i].help);
    }
    printf("  %-22s %s\n\n", "--help", "this text");
    print_names("Generated scenes", stage_names, UINT32_MAX);
    print_names("Kinds", ray_kind_names, RAY_KIND_COUNT);
    print_names("Orders", ray_order_names, RAY_ORDER_COUNT);
    printf(
        "\n"
        "Order 'auto' is that of the renderer's AUTO assembly, 'pixel' takes squares of 8x8\n"
        "pixels, one sample after the other, without sorting. Rates are medians of all rays over\n"
        "the time spent tracing; with several threads, the sum of each one's own rate. Embree\n"
        "gets full packets in the same order, flushes denormals as its manual asks, and is held\n"
        "to the instruction set of the kernels beside it. The ratio is to its fastest mode.\n"
        "Public queries read and write the caller's arrays; 'alone' has packets of one ray, and\n"
        "its ratio is to Embree's single rays.\n"
        "Counts are per ray: 'beams' tests of a packet against the boxes of a node, 'boxes' of a\n"
        "packet's rays against one box, 'triangles' against one triangle, 'alone' nodes and\n"
        "leaves that few rays meet one by one; 'live' is the mean of live rays where packets go.\n"
        "Embree cannot refit trees of moving meshes: it builds them anew.\n");
}

static void set_defaults(struct options *o) {
    *o = (struct options){.kinds = (1u << RAY_KIND_COUNT) - 1,
                          .orders = (1u << RAY_ORDER_COUNT) - 1,
                          .motions = 3,
                          .repeats = 5,
                          .size = 1024,
                          .samples = 16,
                          .tiles = 16,
                          .bundle = TRC_BUNDLE,
                          .embree = true,
                          .builds = true};
    o->isas[o->isa_count++] = trc_isa();
    if (trc_isa() == TRC_ISA_AVX512)
        o->isas[o->isa_count++] = TRC_ISA_AVX2;
    set_threads(o, "1,all");
}

enum options_result options_parse(int argc, char **argv, struct options *options) {
    set_defaults(options);
    for (int i = 1; i < argc; i++) {
        size_t k = 0;
        if (strcmp(argv[i], "--help") == 0) {
            print_help();
            return OPTIONS_DONE;
        }
        while (k < OPTION_COUNT && strcmp(argv[i], table[k].name) != 0)
            k++;
        if (k == OPTION_COUNT) {
            fprintf(stderr, "tracer_bench: unknown option '%s', see --help\n", argv[i]);
            return OPTIONS_ERROR;
        }
        if (table[k].argument && ++i == argc) {
            fprintf(stderr, "tracer_bench: %s needs %s\n", table[k].name, table[k].argument);
            return OPTIONS_ERROR;
        }
        if (!table[k].set(options, argv[i])) {
            fprintf(stderr, "tracer_bench: %s cannot be '%s', see --help\n", table[k].name,
                    argv[i]);
            return OPTIONS_ERROR;
        }
    }
    if (options->scene_count == 0)
        set_scene(options, stage_names[0]);
    return OPTIONS_RUN;
}
