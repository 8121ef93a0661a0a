/* A stage with materials, lights, lens and motion as a spec wants them, through the public API. */
#ifndef TRACER_BENCH_FRAMES_FRAME_SCENE_H
#define TRACER_BENCH_FRAMES_FRAME_SCENE_H

#include "scene.h"
#include "spec.h"
#include "tracer/tracer.h"

struct frame_scene {
    trc_scene scene;
    struct stage stage; /* own; its mesh is freed once the scene has it */
    float extent;       /* largest edge of the bounds, metres */
};

/* A committed scene with the camera at the first place. False: why was printed to the standard
 * error stream, and nothing is to be destroyed. */
bool frame_scene_create(const struct spec *spec, struct frame_scene *out);
void frame_scene_destroy(struct frame_scene *scene);

/* Moves the camera to place i of the spec's eyes and commits. */
trc_status frame_scene_look(const struct frame_scene *scene, const struct spec *spec, uint32_t eye);

#endif
