/* Scenes made by rule, in the manner of those of Boulos et al. 2007 and near their triangle counts:
 * a mesh, a way for the camera, a light. Metres, Z up. The same on every platform but for the last
 * bits of libm's functions. */
#ifndef TRACER_TESTS_STAGES_H
#define TRACER_TESTS_STAGES_H

#include <stdbool.h>
#include <stdint.h>

#include "meshes.h"

#define STAGE_EYES 4

struct stage {
    struct mesh mesh; /* one key */
    /* The camera's way: looks from eyes to targets. */
    float eyes[STAGE_EYES][3], targets[STAGE_EYES][3];
    float field_of_view;        /* of the square frame, radians */
    float light[3], light_size; /* a square lamp that faces down: centre and edge */
};

/* Names that stage_make knows, "" last. */
extern const char *const stage_names[];

/* Makes a stage by name; false for a name that is none. The pose of the character is that of a
 * phase of its walk, period 1; it changes no triangle, and the other stages not at all. */
bool stage_make(const char *name, float phase, struct stage *stage);
void stage_free(struct stage *stage);

/* The camera at a place of its way, [0, 1]. */
void stage_camera(const struct stage *stage, float place, float eye[3], float target[3]);

#endif
