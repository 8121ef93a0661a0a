/* Meshes and instances as plain data, and the scene made of them through the public API. The same
 * data is what the brute-force oracle (brute.h) reads. */
#ifndef TRACER_TESTS_QUERY_SCENE_H
#define TRACER_TESTS_QUERY_SCENE_H

#include <stdbool.h>
#include <stdint.h>

#include "meshes.h"
#include "tracer/tracer.h"

#define QUERY_MAX_MESHES 8
#define QUERY_MAX_INSTANCES 272
#define QUERY_MAX_KEYS 5

struct query_instance {
    uint32_t mesh;       /* into the world's meshes */
    uint32_t key_count;  /* 1..QUERY_MAX_KEYS */
    uint32_t visibility; /* TRC_VISIBLE_* */
    float transforms[QUERY_MAX_KEYS][12];
};

struct query_world {
    uint32_t mesh_count, instance_count;
    struct mesh meshes[QUERY_MAX_MESHES];
    struct query_instance instances[QUERY_MAX_INSTANCES];
};

void query_world_init(struct query_world *world);
void query_world_free(struct query_world *world);
/* An empty mesh to fill, and an instance of a mesh: identity, one key, seen by all rays. The
 * program ends when there is no room. */
struct mesh *query_world_mesh(struct query_world *world);
struct query_instance *query_world_instance(struct query_world *world, uint32_t mesh);
/* Both: a mesh with one instance of it. */
struct mesh *query_world_object(struct query_world *world);

struct query_scene {
    trc_scene scene;
    trc_id meshes[QUERY_MAX_MESHES];
    trc_id instances[QUERY_MAX_INSTANCES];
};

/* A committed scene. is_final: as in trc_scene_desc; thread_count for builds, 0: all. On failure
 * there is nothing to destroy. */
trc_status query_scene_create(const struct query_world *world, bool is_final, uint32_t thread_count,
                              struct query_scene *out);
void query_scene_destroy(struct query_scene *scene);

/* Gives a mesh of the scene the positions that the world's has now, and commits. */
trc_status query_scene_pose(struct query_scene *scene, const struct query_world *world,
                            uint32_t mesh);

/* Puts an instance of the scene where the world's is now, for the next commit. */
trc_status query_scene_move(struct query_scene *scene, const struct query_world *world,
                            uint32_t instance);

struct trc_snapshot;
/* The snapshot in force: valid until the next commit. */
struct trc_snapshot *query_scene_snapshot(trc_scene scene);

/* Counts of the last commit. */
trc_scene_stats query_scene_stats(trc_scene scene);

/* mesh_add_needle_fan about the origin, turned so that no coordinate is a round number, into an
 * empty mesh. */
void query_turned_needles(struct mesh *mesh, uint32_t count, float aspect);

/* The 3x4 matrix of a rotation by radians about axis (any length but 0), times scale, then moved by
 * offset. */
void query_transform(const float axis[3], float radians, const float scale[3],
                     const float offset[3], float transform_out[12]);

#endif
