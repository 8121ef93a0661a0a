/* What one measured frame is, from a line of settings: "scene=conference,integrator=whitted". */
#ifndef TRACER_BENCH_FRAMES_SPEC_H
#define TRACER_BENCH_FRAMES_SPEC_H

#include <stdbool.h>
#include <stdint.h>

#define SPEC_TEXT 512

enum surface {
    SURFACE_DIFFUSE,
    SURFACE_PAPER, /* a reflecting, refracting mix: palette.c */
    SURFACE_MIRROR,
    SURFACE_GLOSSY,
    SURFACE_GLASS,
    SURFACE_TEXTURE,
    SURFACE_COUNT
};

struct spec {
    char text[SPEC_TEXT];                   /* as given */
    char scene[64];                         /* a stage, "balls", or the path of an OBJ file */
    uint32_t integrator, assembly, sampler; /* TRC_INTEGRATOR_*, TRC_ASSEMBLY_*, TRC_SAMPLER_* */
    uint32_t surface;                       /* enum surface */
    uint32_t packet_size, samples, light_samples, max_depth, threads; /* as trc_render_desc */
    uint32_t width, height;                                           /* pixels */
    uint32_t eyes;      /* places on the camera's way, 1..STAGE_EYES, summed */
    uint32_t triangles; /* of "balls" */
    uint32_t instances; /* of "balls": so many of one ball; 0: one mesh */
    uint32_t lights;    /* they share the power of one */
    float aperture;     /* of the lens, in units of a reasonable one; 0: pinhole */
    float exposure;     /* of the shutter, in units of a reasonable one; 0: nothing moves */
    float light_size;   /* in units of the stage's own; 0: point lights */
    float cutoff;       /* Whitted follows no ray whose share of its pixel is below */
    bool counts;        /* count tests of boxes and triangles instead of measuring times */
};

/* False: what is wrong with the line was printed to the standard error stream. */
bool spec_parse(const char *line, struct spec *out);
void spec_print_help(void);

#endif
