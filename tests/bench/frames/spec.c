#include "spec.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/thread.h"
#include "stages.h"
#include "tracer/tracer.h"

/* The paper gives no number; this one leaves as many rays per pixel as its tables imply. */
#define ATTENUATION_CUTOFF 0.02f

static const char *const integrator_names[] = {"raycast", "whitted", "distribution", NULL};
static const char *const assembly_names[] = {"auto",    "types", "runs", "groups",
                                             "octants", "blind", "none", NULL};
static const char *const sampler_names[] = {"sobol",       "sudoku",     "jitter",
                                            "independent", "blue_noise", NULL};
static const char *const surface_names[] = {"diffuse", "paper",   "mirror", "glossy",
                                            "glass",   "texture", NULL};

enum field_kind { FIELD_TEXT, FIELD_NAME, FIELD_COUNT, FIELD_FLAG, FIELD_FACTOR };

static const struct {
    const char *name, *help;
    enum field_kind kind;
    size_t offset;
    const char *const *names; /* FIELD_NAME: of the values 0, 1, ... */
    uint32_t low, high;       /* FIELD_COUNT */
} fields[] = {
#define AT(member) offsetof(struct spec, member)
    {"scene", "a stage, 'balls' or a path (conference)", FIELD_TEXT, AT(scene), NULL, 0, 0},
    {"integrator", "(whitted)", FIELD_NAME, AT(integrator), integrator_names, 0, 0},
    {"assembly", "(auto)", FIELD_NAME, AT(assembly), assembly_names, 0, 0},
    {"sampler", "(sobol)", FIELD_NAME, AT(sampler), sampler_names, 0, 0},
    {"surface", "(paper)", FIELD_NAME, AT(surface), surface_names, 0, 0},
    {"packet_size", "rays, 0 chooses (0)", FIELD_COUNT, AT(packet_size), NULL, 0, 256},
    {"samples", "per pixel (1)", FIELD_COUNT, AT(samples), NULL, 1, 1 << 20},
    {"light_samples", "shadow rays per camera hit (1)", FIELD_COUNT, AT(light_samples), NULL, 0,
     64},
    {"max_depth", "bounces (50)", FIELD_COUNT, AT(max_depth), NULL, 0, 1024},
    {"threads", "0: all (0)", FIELD_COUNT, AT(threads), NULL, 0, TRC_MAX_THREADS},
    {"width", "pixels (1024)", FIELD_COUNT, AT(width), NULL, 1, 65536},
    {"height", "pixels (1024)", FIELD_COUNT, AT(height), NULL, 1, 65536},
    {"eyes", "places on the camera's way (4)", FIELD_COUNT, AT(eyes), NULL, 1, STAGE_EYES},
    {"triangles", "of 'balls' (100000)", FIELD_COUNT, AT(triangles), NULL, 1024, 1 << 26},
    {"instances", "of one ball; 0: one mesh (0)", FIELD_COUNT, AT(instances), NULL, 0, 1 << 21},
    {"lights", "they share one's power (1)", FIELD_COUNT, AT(lights), NULL, 1, 1 << 20},
    {"aperture", "times a reasonable one (0)", FIELD_FACTOR, AT(aperture), NULL, 0, 0},
    {"exposure", "times a reasonable one (0)", FIELD_FACTOR, AT(exposure), NULL, 0, 0},
    {"light_size", "times the stage's own (0)", FIELD_FACTOR, AT(light_size), NULL, 0, 0},
    {"cutoff", "least share of a pixel that Whitted follows (0.02)", FIELD_FACTOR, AT(cutoff), NULL,
     0, 0},
    {"counts", "1: count tests, measure no times (0)", FIELD_FLAG, AT(counts), NULL, 0, 0},
#undef AT
};
#define FIELDS (sizeof fields / sizeof *fields)

static bool set_name(const char *const *names, const char *text, uint32_t *out) {
    for (*out = 0; names[*out]; ++*out)
        if (strcmp(names[*out], text) == 0)
            return true;
    return false;
}

static bool set_count(const char *text, uint32_t low, uint32_t high, uint32_t *out) {
    char *end;
    const unsigned long value = strtoul(text, &end, 10);
    *out = (uint32_t)value;
    return end != text && !*end && *text != '-' && value >= low && value <= high;
}

static bool set_factor(const char *text, float *out) {
    char *end;
    *out = strtof(text, &end);
    return end != text && !*end && *out >= 0.0f && *out <= 1e6f;
}

static bool set_field(size_t i, const char *text, struct spec *out) {
    void *at = (char *)out + fields[i].offset;
    uint32_t flag;
    switch (fields[i].kind) {
    case FIELD_TEXT:
        if (strlen(text) >= sizeof out->scene)
            return false;
        strcpy(at, text);
        return true;
    case FIELD_NAME:
        return set_name(fields[i].names, text, at);
    case FIELD_COUNT:
        return set_count(text, fields[i].low, fields[i].high, at);
    case FIELD_FACTOR:
        return set_factor(text, at);
    default:
        if (!set_count(text, 0, 1, &flag))
            return false;
        *(bool *)at = flag;
        return true;
    }
}

static bool set_item(char *item, struct spec *out) {
    char *value = strchr(item, '=');
    if (!value)
        return false;
    *value++ = '\0';
    for (size_t i = 0; i < FIELDS; i++)
        if (strcmp(fields[i].name, item) == 0)
            return set_field(i, value, out);
    return false;
}

bool spec_parse(const char *line, struct spec *out) {
    char copy[SPEC_TEXT], *rest = copy;
    *out = (struct spec){.scene = "conference",
                         .integrator = TRC_INTEGRATOR_WHITTED,
                         .surface = SURFACE_PAPER,
                         .samples = 1,
                         .light_samples = 1,
                         .max_depth = 50,
                         .width = 1024,
                         .height = 1024,
                         .eyes = STAGE_EYES,
                         .triangles = 100000,
                         .lights = 1,
                         .cutoff = ATTENUATION_CUTOFF};
    if (strlen(line) >= SPEC_TEXT || strpbrk(line, "\"\\")) {
        fprintf(stderr, "frame_bench: a line is too long or has quotes\n");
        return false;
    }
    strcpy(out->text, line);
    strcpy(copy, line);
    while (rest && *rest) {
        char *item = rest;
        rest = strchr(rest, ',');
        if (rest)
            *rest++ = '\0';
        if (!set_item(item, out)) {
            fprintf(stderr, "frame_bench: not a setting: '%s' in '%s', see --help\n", item, line);
            return false;
        }
    }
    return true;
}

void spec_print_help(void) {
    for (size_t i = 0; i < FIELDS; i++) {
        printf("  %-14s %s", fields[i].name, fields[i].help);
        for (uint32_t k = 0; fields[i].names && fields[i].names[k]; k++)
            printf("%s%s", k ? ", " : ": ", fields[i].names[k]);
        printf("\n");
    }
}
