/* frame_bench: whole frames of the generated scenes with every integrator and packet assembly, and
 * with more or less of one thing: what each costs. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "buffers.h"
#include "counted_frame.h"

#define SPECS 256

struct bench {
    struct spec specs[SPECS];
    uint32_t spec_count, repeats;
    FILE *json;
    const char *pictures; /* folder, or NULL */
};

/* ---- output ---- */

static void print_result(const struct spec *spec, const struct frame_result *r) {
    const uint64_t rays = r->rays_camera + r->rays_shadow + r->rays_reflection + r->rays_refraction;
    printf("%-90s %8.4f s %7.2f Mrays/s\n", spec->text, r->seconds,
           r->seconds > 0.0 ? 1e-6 * (double)rays / r->seconds : 0.0);
    fflush(stdout);
}

static void json_result(FILE *json, const struct spec *spec, const struct frame_result *r) {
    fprintf(json,
            "{\"row\": \"frame\", \"spec\": \"%s\", \"eyes\": %u, \"isa\": \"%s\", \"seconds\": "
            "%.6g, \"seconds_trace\": %.6g, \"seconds_shade\": %.6g, \"seconds_other\": %.6g, "
            "\"build_seconds\": %.6g, \"commit_seconds\": %.6g",
            spec->text, spec->eyes, trc_isa_name(trc_isa()), r->seconds, r->seconds_trace,
            r->seconds_shade, r->seconds_other, r->build_seconds, r->commit_seconds);
    fprintf(json,
            ", \"rays\": {\"camera\": %llu, \"shadow\": %llu, \"reflection\": %llu, "
            "\"refraction\": %llu}",
            (unsigned long long)r->rays_camera, (unsigned long long)r->rays_shadow,
            (unsigned long long)r->rays_reflection, (unsigned long long)r->rays_refraction);
    fprintf(json,
            ", \"triangles\": %llu, \"bvh_bytes\": %llu, \"geometry_bytes\": %llu, "
            "\"peak_bytes\": %llu}\n",
            (unsigned long long)r->triangle_count, (unsigned long long)r->bvh_bytes,
            (unsigned long long)r->geometry_bytes, (unsigned long long)r->peak_bytes);
}

static void json_counts(FILE *json, const struct spec *spec, const struct frame_result *r,
                        const struct trace_counts tests[RAY_CLASSES]) {
    static const char *const names[RAY_CLASSES] = {"camera", "reflection", "refraction", "shadow",
                                                   "mixed"};
    const uint64_t rays[RAY_CLASSES] = {r->rays_camera, r->rays_reflection, r->rays_refraction,
                                        r->rays_shadow, 0};
    fprintf(json, "{\"row\": \"counts\", \"spec\": \"%s\"", spec->text);
    for (int i = 0; i < RAY_CLASSES; i++) {
        const struct trace_counts *t = &tests[i];
        fprintf(json,
                ", \"%s\": {\"rays\": %llu, \"nodes\": %llu, \"box_rays\": %llu, "
                "\"triangle_rays\": %llu, \"visits\": %llu, \"visit_rays\": %llu, "
                "\"single_nodes\": %llu, \"single_leaves\": %llu, \"single_triangles\": %llu}",
                names[i], (unsigned long long)rays[i], (unsigned long long)t->nodes,
                (unsigned long long)t->box_rays, (unsigned long long)t->triangle_rays,
                (unsigned long long)t->visits, (unsigned long long)t->visit_rays,
                (unsigned long long)t->single_nodes, (unsigned long long)t->single_leaves,
                (unsigned long long)t->single_triangles);
    }
    fprintf(json, "}\n");
}

/* A portable float map: three channels, little-endian, bottom row first. */
static bool picture_write(const char *folder, uint32_t number, const struct spec *spec,
                          const float *rgba) {
    char path[512];
    snprintf(path, sizeof path, "%s/frame-%u.pfm", folder, number);
    FILE *file = fopen(path, "wb");
    if (!file) {
        fprintf(stderr, "frame_bench: %s: %s\n", path, strerror(errno));
        return false;
    }
    fprintf(file, "PF\n%u %u\n-1.0\n", spec->width, spec->height);
    for (size_t i = 0; i < (size_t)spec->width * spec->height; i++)
        fwrite(rgba + 4 * i, sizeof(float), 3, file);
    return fclose(file) == 0;
}

/* ---- frames ---- */

static bool measure(const struct bench *b, uint32_t number, const struct frame_scene *scene,
                    uint32_t repeat) {
    const struct spec *spec = &b->specs[number];
    struct frame_result result;
    struct trace_counts tests[RAY_CLASSES];
    const bool wants_picture = b->pictures && repeat == 0 && !spec->counts;
    float *picture =
        wants_picture ? buffer_alloc((size_t)spec->width * spec->height, 4 * sizeof(float)) : NULL;
    const trc_status status = spec->counts ? counted_frame_render(scene, spec, &result, tests)
                                           : frame_render(scene, spec, &result, picture);
    bool good = status == TRC_OK;
    if (!good)
        fprintf(stderr, "frame_bench: %s\n", trc_last_message());
    if (good && picture)
        good = picture_write(b->pictures, number, spec, picture);
    free(picture);
    if (!good)
        return false;
    print_result(spec, &result);
    if (b->json && spec->counts)
        json_counts(b->json, spec, &result, tests);
    else if (b->json)
        json_result(b->json, spec, &result);
    return true;
}

/* Repeats go over all specs in turn, so that a load of the machine meets all of them. */
static bool run(const struct bench *b) {
    for (uint32_t repeat = 0; repeat < b->repeats; repeat++)
        for (uint32_t i = 0; i < b->spec_count; i++) {
            struct frame_scene scene;
            if (b->specs[i].counts && repeat > 0)
                continue;
            if (!frame_scene_create(&b->specs[i], &scene))
                return false;
            const bool good = measure(b, i, &scene, repeat);
            frame_scene_destroy(&scene);
            if (!good)
                return false;
        }
    return true;
}

/* ---- program ---- */

static void print_help(void) {
    printf("Usage: frame_bench [--repeats N] [--json FILE] [--pictures FOLDER] SPEC...\n\n"
           "Renders frames, each repeat all of them in turn. A SPEC is a list of settings with\n"
           "commas, as scene=conference,integrator=whitted:\n\n");
    spec_print_help();
}

/* False: what is wrong was printed to the standard error stream. */
static bool set_option(struct bench *b, const char *name, const char *value, const char **json) {
    if (!value) {
        fprintf(stderr, "frame_bench: %s needs a value, see --help\n", name);
        return false;
    }
    if (strcmp(name, "--json") == 0) {
        *json = value;
        return true;
    }
    if (strcmp(name, "--pictures") == 0) {
        b->pictures = value;
        return true;
    }
    if (strcmp(name, "--repeats") == 0) {
        b->repeats = (uint32_t)strtoul(value, NULL, 10);
        if (b->repeats > 0)
            return true;
    }
    fprintf(stderr, "frame_bench: not an option: '%s %s', see --help\n", name, value);
    return false;
}

static bool add_spec(struct bench *b, const char *line) {
    if (b->spec_count < SPECS)
        return spec_parse(line, &b->specs[b->spec_count++]);
    fprintf(stderr, "frame_bench: more than %d frames\n", SPECS);
    return false;
}

static bool parse(struct bench *b, int argc, char **argv, const char **json) {
    b->repeats = 3;
    for (int i = 1; i < argc; i++) {
        const bool is_option = strncmp(argv[i], "--", 2) == 0;
        const char *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (!(is_option ? set_option(b, argv[i], value, json) : add_spec(b, argv[i])))
            return false;
        i += is_option;
    }
    if (b->spec_count == 0)
        fprintf(stderr, "frame_bench: nothing to render, see --help\n");
    return b->spec_count > 0;
}

int main(int argc, char **argv) {
    static struct bench b;
    const char *json = NULL;
    if (argc == 2 && strcmp(argv[1], "--help") == 0) {
        print_help();
        return EXIT_SUCCESS;
    }
    if (!parse(&b, argc, argv, &json))
        return EXIT_FAILURE;
    if (json && !(b.json = fopen(json, "w"))) {
        fprintf(stderr, "frame_bench: %s: %s\n", json, strerror(errno));
        return EXIT_FAILURE;
    }
    bool good = run(&b);
    if (b.json && fclose(b.json) != 0) {
        fprintf(stderr, "frame_bench: %s: %s\n", json, strerror(errno));
        good = false;
    }
    return good ? EXIT_SUCCESS : EXIT_FAILURE;
}
