/* The editable scene: what create, update, destroy and set calls collect until a commit. Callers
 * hold the scene's lock (trc_scene_enter, trc_scene_leave). */
#ifndef TRACER_SCENE_SCENE_H
#define TRACER_SCENE_SCENE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "model/names.h"
#include "model/snapshot.h"
#include "scene/shared.h"
#include "scene/store.h"

struct trc_pool;         /* core/pool.h */
struct trc_image_reader; /* image/reader.h */
struct trc_prefetch;     /* image/prefetch.h */
struct trc_displacer;    /* scene/displace.h */

/* What has changed since the last successful commit. */
enum {
    TRC_CHANGED_MESHES = 1 << 0,
    TRC_CHANGED_INSTANCES = 1 << 1, /* or which material one of them resolves to */
    TRC_CHANGED_MATERIALS = 1 << 2,
    TRC_CHANGED_IMAGES = 1 << 3,
    TRC_CHANGED_LIGHTS = 1 << 4,
    TRC_CHANGED_WORLD = 1 << 5,
    TRC_CHANGED_CAMERA = 1 << 6,
    TRC_CHANGED_ALL = (1 << 7) - 1
};

struct trc_scene_mesh {
    struct trc_mesh *geometry;       /* held */
    bool is_coarse;                  /* diced to fewer triangles than asked for */
    struct trc_displacer *displacer; /* of the geometry with displacement, or NULL */
    struct trc_mesh *shown;          /* what the snapshot under construction has of it */
    struct trc_mesh *committed;      /* and what the scene's snapshot has, or NULL */
    uint32_t use_count;              /* instances */
    uint32_t index;                  /* in the snapshot under construction */
};

/* One block: the keys stand behind the struct, then the ids, then the values. */
struct trc_scene_instance {
    trc_id mesh;
    uint32_t key_count;
    uint32_t material_count;
    struct trc_affine *transforms; /* key_count */
    const trc_id *materials;       /* material_count; 0: default */
    uint32_t value_count;
    const float *values;
    uint32_t visibility;
    int32_t pass_index;
    float random;
    float color[4];
    float cryptomatte_object, cryptomatte_asset;
    uint32_t light_group;           /* of its emission, from 1 on; 0: none */
    uint32_t flags;                 /* TRC_INSTANCE_* */
    uint32_t light_set, shadow_set; /* as trc_instance_desc has them, and so */
    uint64_t light_exclude, shadow_exclude;
    float shadow_terminator_geometry, shadow_terminator_shading, ao_distance;
};

struct trc_scene_state {
    uint32_t thread_count;
    bool is_final;
    uint64_t image_bytes_max; /* 0: no limit */
    pthread_mutex_t lock;     /* all but the next three */
    pthread_mutex_t cancel_lock;
    bool committing;                 /* under cancel_lock */
    atomic_uint cancel;              /* read by the workers of a commit */
    struct trc_image_reader *reader; /* held */
    struct trc_prefetch *prefetch;   /* of images before the next commit, or NULL */
    struct trc_names *names;
    struct trc_store meshes, instances, materials, images, lights;
    struct trc_material *default_material;
    struct trc_shared *camera;     /* of struct trc_camera, or NULL */
    trc_world_desc world;          /* struct_size 0: none was set */
    uint32_t changed;              /* TRC_CHANGED_* */
    struct trc_snapshot *snapshot; /* the last one published, or NULL */
    struct trc_pool *pool;         /* for commits, started by the first */
    struct trc_rebuild *rebuild;   /* under way or ready to be taken, or NULL */
};

/* OUT_OF_MEMORY, INVALID_HANDLE. */
trc_status trc_scene_state_create(const trc_scene_desc *desc, struct trc_scene_state **scene_out);
/* Nobody else may use the scene any more. Snapshots live on with those who hold them. */
void trc_scene_state_destroy(struct trc_scene_state *scene);

/* What a public call on a scene is wrapped in: pins the scene, takes its lock, sets the default
 * floating-point state. INVALID_HANDLE leaves nothing to undo. */
struct trc_scene_access {
    struct trc_scene_state *scene;
    trc_scene handle;
    uint64_t fp_state;
};
trc_status trc_scene_enter(trc_scene handle, struct trc_scene_access *access_out);
void trc_scene_leave(const struct trc_scene_access *access);

/* ---- edits; descriptors have been checked by the entry points ---- */

trc_status trc_scene_add_mesh(struct trc_scene_state *scene, const trc_mesh_desc *desc, trc_id *id);
trc_status trc_scene_pose_mesh(struct trc_scene_state *scene, trc_id id, uint32_t key_count,
                               const float *positions, uint64_t position_count,
                               const float *normals, uint64_t normal_count);
trc_status trc_scene_add_curves(struct trc_scene_state *scene, const trc_curves_desc *desc,
                                trc_id *id);
trc_status trc_scene_pose_curves(struct trc_scene_state *scene, trc_id id, uint32_t key_count,
                                 const float *points, uint64_t point_value_count);
trc_status trc_scene_remove_mesh(struct trc_scene_state *scene, trc_id id);

trc_status trc_scene_add_instance(struct trc_scene_state *scene, const trc_instance_desc *desc,
                                  trc_id *id);
trc_status trc_scene_change_instance(struct trc_scene_state *scene, trc_id id,
                                     const trc_instance_desc *desc);
trc_status trc_scene_move_instances(struct trc_scene_state *scene, const trc_id *ids,
                                    uint64_t count, uint32_t key_count, const float *transforms);
trc_status trc_scene_remove_instance(struct trc_scene_state *scene, trc_id id);

trc_status trc_scene_add_material(struct trc_scene_state *scene, const trc_material_desc *desc,
                                  trc_id *id);
trc_status trc_scene_change_material(struct trc_scene_state *scene, trc_id id,
                                     const trc_material_desc *desc);
trc_status trc_scene_remove_material(struct trc_scene_state *scene, trc_id id);
trc_status trc_scene_make_default_material(struct trc_scene_state *scene);

trc_status trc_scene_add_image(struct trc_scene_state *scene, const trc_image_desc *desc,
                               trc_id *id);
/* Reads an image with a path ahead: a wish, which nothing comes of without memory. */
void trc_scene_expect_image(struct trc_scene_state *scene, const trc_image_desc *desc);
trc_status trc_scene_change_image(struct trc_scene_state *scene, trc_id id,
                                  const trc_image_desc *desc);
trc_status trc_scene_remove_image(struct trc_scene_state *scene, trc_id id);

trc_status trc_scene_add_light(struct trc_scene_state *scene, const trc_light_desc *desc,
                               trc_id *id);
trc_status trc_scene_change_light(struct trc_scene_state *scene, trc_id id,
                                  const trc_light_desc *desc);
trc_status trc_scene_remove_light(struct trc_scene_state *scene, trc_id id);

trc_status trc_scene_put_camera(struct trc_scene_state *scene, const trc_camera_desc *desc);
trc_status trc_scene_put_world(struct trc_scene_state *scene, const trc_world_desc *desc);

/* Snapshot index of a material id: its slot + 1, so that it stays while the material lives; 0, the
 * default material, for a null or stale id. */
uint32_t trc_scene_material_index(const struct trc_scene_state *scene, trc_id id);

/* ---- commit (scene/commit.c) ---- */

/* Builds a snapshot and publishes it as scene->snapshot; on failure everything stays. */
trc_status trc_scene_state_commit(struct trc_scene_state *scene);

#endif
