/* Lights and the world. */
#ifndef TRACER_LIGHT_H
#define TRACER_LIGHT_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

enum trc_light_type {
    TRC_LIGHT_POINT = 0,
    TRC_LIGHT_SPOT = 1,
    TRC_LIGHT_SUN = 2,
    TRC_LIGHT_AREA = 3
};
enum trc_area_shape { TRC_AREA_RECTANGLE = 0, TRC_AREA_ELLIPSE = 1 };
enum trc_light_flags {
    TRC_LIGHT_SPHERE = 1,    /* point, spot: a sphere; else a disk that faces the lit point, as in
                                Blender before 4.0 and, from 4.1 on, with Soft Falloff */
    TRC_LIGHT_EVEN_CONE = 2, /* spot: as bright all over its cone, which is stretched as the
                                transform is; else times the cosine to its axis and
                                round, as in Blender before 4.0. Sun: the same radiance all over its
                                disc, strength the irradiance; else more at the rim and less in all,
                                as in Blender 3 */
    TRC_LIGHT_SYNTHETIC = 4, /* not a light of the footage that shadow catchers stand for: what
                                blocks it casts no shadow there */
    TRC_LIGHT_LOCAL_UV = 8,  /* its nodes' UV and Parametric are of the light's own space, and a
                                spot's span its cone, as in Blender 4; else a point's and a spot's
                                Parametric goes by world directions and UV is 0, as in Blender 3.4 */
    TRC_LIGHT_OBJECT = 16,  /* its nodes have object space: Object and Generated coordinates and the
                               place of Object Info are the light's, as in Blender 5; else only
                               normals are turned into it */
    TRC_LIGHT_CENTERED = 32 /* area: a rectangle whose transform shears it is sampled from its
                               centre, as in Blender 4; else from its corner */
};

/* Strengths are Blender's: watts for point, spot and area, W/m^2 for the sun, times color. A light
 * shines along its -Z; area lights span X and Y. */
typedef struct trc_light_desc {
    uint32_t struct_size; /* of this structure; checked */
    uint32_t type;        /* TRC_LIGHT_* */
    float transform[12];  /* light to world */
    float color[3];       /* scene-linear */
    float strength;       /* see above; may be negative */
    float radius;         /* point, spot: metres, >= 0 */
    float angle;          /* sun: angular diameter, radians, [0, pi] */
    float size_x, size_y; /* area: metres, full width before the transform's scale */
    uint32_t area_shape;  /* TRC_AREA_* */
    float spread;         /* area: radians, (0, pi]; pi: no restriction */
    float spot_angle;     /* full cone, radians, (0, pi] */
    float spot_blend;     /* [0, 1] */
    uint32_t visibility;  /* TRC_VISIBLE_*; SHADOW has no meaning for a light */
    uint32_t cast_shadow; /* 0: shines through everything */
    uint32_t use_mis;     /* reflected and refracted rays see it ("multiple importance") */
    uint32_t light_group; /* 0..TRC_MAX_LIGHT_GROUPS */
    uint32_t flags;       /* TRC_LIGHT_SPHERE and the like */
    float random;         /* Object Info's Random for its nodes, finite */
    uint32_t
        bounce_limit;   /* points that the path reaches after so many bounces or more get no light
                           samples of it; 0: all do. Rays that meet it see it all the same */
    int32_t pass_index; /* Object Info's Object Index, */
    float object_color[4];   /* Color and Alpha for its nodes */
    trc_id material;         /* its nodes: a material of the scene, of which emission alone counts,
                                times color and strength. 0, or one that was destroyed: white */
    uint64_t light_exclude;  /* light linking: 1 << trc_instance_desc.light_set of the instances
                                that it does not light; 0: it lights all */
    uint64_t shadow_exclude; /* shadow linking: 1 << trc_instance_desc.shadow_set of those that do
                                not block it, see TRC_MAX_SHADOW_CLASSES; 0: all do */
} trc_light_desc;

/* A point light of 1 W at the origin, white, without extent, that casts shadows and that all rays
 * see. As another type: a square of 1 m that shines to all sides of its front, a cone of pi / 4, a
 * sun of no extent. */
TRC_API trc_light_desc trc_light_desc_default(void);

/* Adds a light from the next commit on. INVALID_ARGUMENT for a value out of range; what a type does
 * not read must be finite. INVALID_HANDLE for a material that the scene does not have. */
TRC_API trc_status trc_light_create(trc_scene scene, const trc_light_desc *desc, trc_id *light_out);

/* Replaces all that is known of a light; errors as for create. */
TRC_API trc_status trc_light_update(trc_scene scene, trc_id light, const trc_light_desc *desc);

/* Takes a light out of the scene from the next commit on. */
TRC_API trc_status trc_light_destroy(trc_scene scene, trc_id light);

/* Ambient occlusion, the Fast GI Approximation of Cycles: rays from every shading point with
 * diffuse lobes, as many as light samples, by the cosine; light comes from those that meet nothing
 * within ao_distance. Shadow rays as any: transparent materials let them through. In the light
 * passes it is direct diffuse light. */
enum trc_ao_method {
    TRC_AO_ADD = 0,    /* white light of radiance ao_factor, besides all other light. As in Cycles,
                          what    is partly transparent gets it times its opacity once more */
    TRC_AO_REPLACE = 1 /* the world's own light on diffuse lobes, times ao_factor, in place of its
                          samples, which anything blocks at any distance: as in Cycles after one
                          bounce with a world that is not sampled as a light (there, a rough gloss
                          beside the diffuse lobe loses a part, too) */
};

typedef struct trc_world_desc {
    uint32_t struct_size;    /* of this structure; checked */
    uint32_t use_sampling;   /* 1: the environment image is sampled by importance */
    trc_id material;         /* a material whose surface is BACKGROUND (or a mix); 0: black */
    uint32_t visibility;     /* TRC_VISIBLE_* */
    uint32_t map_resolution; /* width of the importance map, up to 16384; 0: from the image */
    float ao_distance;       /* ambient occlusion: metres, > 0; 0 if it is off */
    float ao_factor;         /* 0: off */
    uint32_t ao_method;      /* TRC_AO_* */
    uint32_t light_group;    /* 0..TRC_MAX_LIGHT_GROUPS */
    /* A small, bright disc that the material shows, such as the sun of a sky: it is sampled by
     * itself instead of through the map. */
    float sun_direction[3]; /* towards it, of any length but 0; not read without sun_angle */
    float sun_angle;        /* its diameter in radians, 0..pi; 0: none */
    uint32_t cast_shadow;   /* 0: where it is sampled by importance nothing blocks the samples; rays
                               find it as ever */
} trc_world_desc;

/* Black, without ambient occlusion; a material that it gets is sampled and seen by all rays. */
TRC_API trc_world_desc trc_world_desc_default(void);

/* Replaces the scene's world, which is black at first. INVALID_HANDLE for a material that the scene
 * does not have, INVALID_ARGUMENT for a value out of range. */
TRC_API trc_status trc_scene_set_world(trc_scene scene, const trc_world_desc *desc);

TRC_END_DECLS

#endif
