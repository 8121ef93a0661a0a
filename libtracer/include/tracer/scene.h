/* A scene: its life, its committed snapshot, what it uses.
 *
 * Edits (create, update, destroy, set) collect until trc_scene_commit, which builds or refits what
 * changed and publishes an immutable snapshot. Renders and queries use the snapshot that was
 * current when they started, and keep it alive; edits and later commits never disturb them. */
#ifndef TRACER_SCENE_H
#define TRACER_SCENE_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

typedef struct trc_scene_desc {
    uint32_t struct_size;  /* of this structure; checked */
    uint32_t thread_count; /* for builds, up to 1024; 0: one per logical processor */
    uint32_t is_final;     /* 1: final frame, best trees, static meshes of one instance, and small
                              ones of several, are joined in world space; 0: interactive, per-mesh trees
                              that can be refitted */
    uint32_t image_megabytes; /* 2^20 bytes that images may take: when one more does not fit, the
                                 largest are halved, again and again, and a warning says so.
                                 0: no limit */
    trc_reader reader;        /* of image files, held by the scene; 0: one of its own */
} trc_scene_desc;

/* Interactive, on all processors, images without limit, a reader of its own. */
TRC_API trc_scene_desc trc_scene_desc_default(void);

/* An empty scene, owned by the caller until trc_scene_destroy. INVALID_HANDLE for a reader that is
 * none. */
TRC_API trc_status trc_scene_create(const trc_scene_desc *desc, trc_scene *scene_out);

/* Renders that run on its snapshot are not disturbed. The handle and all its ids become stale. */
TRC_API trc_status trc_scene_destroy(trc_scene scene);

/* Compiles materials, refits or rebuilds trees, builds light tables, derives the feature set. Cost
 * in proportion to what changed. TRC_ERROR_CANCELLED after trc_scene_cancel: the former snapshot
 * stays. */
TRC_API trc_status trc_scene_commit(trc_scene scene);

/* From any thread: makes a running commit return soon. No effect when none runs. */
TRC_API trc_status trc_scene_cancel(trc_scene scene);

/* What a committed scene uses; what is not listed costs nothing. */
enum trc_feature_flags {
    TRC_FEATURE_LENS = 1 << 0,
    TRC_FEATURE_CAMERA_MOTION = 1 << 1,
    TRC_FEATURE_OBJECT_MOTION = 1 << 2,
    TRC_FEATURE_DEFORMATION = 1 << 3,
    TRC_FEATURE_INSTANCES = 1 << 4,
    TRC_FEATURE_SPECULAR = 1 << 5, /* ideal reflection or refraction */
    TRC_FEATURE_GLOSSY = 1 << 6,   /* rough reflection or refraction */
    TRC_FEATURE_REFRACTION = 1 << 7,
    TRC_FEATURE_TRANSPARENCY = 1 << 8,
    TRC_FEATURE_TEXTURES = 1 << 9,
    TRC_FEATURE_PROGRAMS = 1 << 10,
    TRC_FEATURE_LIGHTS = 1 << 11,
    TRC_FEATURE_AREA_LIGHTS = 1 << 12, /* any light of extent: soft shadows */
    TRC_FEATURE_EMISSIVE_MESHES = 1 << 13,
    TRC_FEATURE_ENVIRONMENT = 1 << 14, /* the world is not black */
    TRC_FEATURE_ENVIRONMENT_IMAGE = 1 << 15,
    TRC_FEATURE_VISIBILITY = 1 << 16, /* some instance is hidden from some rays */
    TRC_FEATURE_AMBIENT_OCCLUSION = 1 << 17,
    TRC_FEATURE_SHADOW_CATCHERS = 1 << 18,
    TRC_FEATURE_SLOPES = 1 << 19,  /* some surface has bumps */
    TRC_FEATURE_LINKS = 1 << 20,   /* some light does not light all, or all does not block it */
    TRC_FEATURE_PORTALS = 1 << 21, /* some surface sends rays on from elsewhere */
    TRC_FEATURE_CURVES = 1 << 22,
    /* Some instance has shadow terminator offsets other than the defaults. */
    TRC_FEATURE_SHADOW_TERMINATORS = 1 << 23,
    TRC_FEATURE_SHADOW_SLOPES = 1 << 24, /* some surface that shadow rays pass has bumps there */
    /* What is in a light's way tells shadow rays from those that lobes send. */
    TRC_FEATURE_RAY_KINDS = 1 << 25
};

typedef struct trc_scene_stats {
    uint32_t struct_size;              /* of this structure; checked */
    uint32_t features;                 /* TRC_FEATURE_* */
    uint64_t triangle_count;           /* in meshes, once however many instances */
    uint64_t instanced_triangle_count; /* once for each instance */
    uint64_t skipped_triangle_count;   /* not finite or too large */
    /* In the scene; skipped: hidden for a transform that cannot be used. */
    uint64_t mesh_count, instance_count, skipped_instance_count, light_count, material_count;
    uint64_t emissive_triangle_count;                /* sampled as lights */
    uint64_t bvh_bytes, geometry_bytes, image_bytes; /* memory held by trees, meshes, images */
    double build_seconds;                            /* of the last commit, trees only */
    double commit_seconds;                           /* of the last commit, all */
    uint32_t built_count, refitted_count;            /* trees in the last commit */
    float bounds_lower[3], bounds_upper[3]; /* world, over the shutter; lower > upper when empty */
} trc_scene_stats;

/* Zeros, for trc_scene_get_stats. */
TRC_API trc_scene_stats trc_scene_stats_default(void);

/* Of the last commit. struct_size is set by the caller. */
TRC_API trc_status trc_scene_get_stats(trc_scene scene, trc_scene_stats *stats_out);

/* Warnings of the last commit, one per line, UTF-8, cut to capacity (terminated); the full size
 * including the terminator goes to size_out (may be NULL). */
TRC_API trc_status trc_scene_get_warnings(trc_scene scene, char *text_out, uint64_t capacity,
                                          uint64_t *size_out);

TRC_END_DECLS

#endif
