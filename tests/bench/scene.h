/* A scene to measure: a stage or an OBJ file, at rest and in motion. */
#ifndef TRACER_BENCH_SCENE_H
#define TRACER_BENCH_SCENE_H

#include <stdbool.h>
#include <stddef.h>

#include "query_scene.h"
#include "stages.h"

struct bench_scene {
    char name[64];
    struct stage stage; /* the camera's way and the light; its mesh is the world's at rest */
    struct query_world worlds[2]; /* one mesh each; [1] with two motion keys */
    float extent;                 /* largest edge of the bounds */
};

/* name: a stage, else the path of an OBJ file. In motion, the character takes a 48th of its walk's
 * period; what else is turned about the vertical, the more the higher. False: message says why, and
 * nothing is to be freed. */
bool bench_scene_load(const char *name, struct bench_scene *scene, char *message, size_t capacity);
/* Turns all of it about the vertical through the origin: the same rays, but walls that do not
 * follow the axes. Its name says so. */
void bench_scene_turn(struct bench_scene *scene, uint32_t degrees);
void bench_scene_free(struct bench_scene *scene);

#endif
