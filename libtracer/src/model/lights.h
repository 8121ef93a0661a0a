/* The lights of a committed scene: what kernels/light/ read.
 *
 * Lamps, the world and emissive triangles, their strengths turned into radiance as Cycles 3.4 does,
 * and what chooses among them: a list of suns and world, and for lights with a place either a list
 * or, when there are many, a tree (A. Conty Estevez and C. Kulla, "Importance Sampling of Many
 * Lights with Adaptive Tree Splitting", 2018). Immutable once created; threads share it. */
#ifndef TRACER_MODEL_LIGHTS_H
#define TRACER_MODEL_LIGHTS_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "model/snapshot.h"

enum trc_light_kind {
#define TRC_LAMP_KIND(NAME, name, is_it) TRC_KIND_##NAME,
#include "model/light_kinds.def"
    TRC_KIND_WORLD,
    TRC_KIND_TRIANGLE
};

enum {
    TRC_LAMP_DELTA = 1, /* no extent: continuation rays never meet it */
    TRC_LAMP_MIS = 2,   /* continuation rays see it */
    TRC_LAMP_CASTS_SHADOW = 4,
    TRC_LAMP_SPHERE = 8,      /* TRC_LIGHT_SPHERE */
    TRC_LAMP_EVEN_CONE = 16,  /* TRC_LIGHT_EVEN_CONE */
    TRC_LAMP_DISTANT = 32,    /* it has no place: position is the direction towards it */
    TRC_LAMP_LOCAL_UV = 64,   /* TRC_LIGHT_LOCAL_UV */
    TRC_LAMP_OBJECT = 128,    /* TRC_LIGHT_OBJECT */
    TRC_LAMP_STRETCHED = 256, /* spot: its cone is not round */
    TRC_LAMP_CENTERED = 512   /* TRC_LIGHT_CENTERED */
};

/* A lamp: 32 words, read by gathers of TRC_LAMP_WORDS stride. Positions in world space. */
#define TRC_LAMP_WORDS 32
struct trc_lamp {
    float position[3];          /* centre; of a distant one the unit direction towards it */
    float axis_u[3], axis_v[3]; /* area: unit; stretched spot: as long as its own Z axis over its X,
                                 * and over its Y axis */
    float normal[3];            /* the way spot and area shine, unit */
    float radiance[3]; /* towards a point that sees it head-on; delta: intensity, sun irradiance */
    float half_u,
        half_v;         /* area: half sizes; point, spot: radius; sun: tangent of the half angle */
    float cos_cone;     /* spot: of the half angle; sun: of its angular radius */
    float inv_smooth;   /* spot: 1 / width of the soft edge in cosine, 0 for a hard one */
    float tan_spread;   /* area: cotangent of half the spread, 0 for no limit */
    float spread_scale; /* area: factor that keeps the power */
    float inv_area;
    int32_t kind, flags;
    uint32_t visibility;   /* TRC_VISIBLE_*, UNBLOCKED too */
    uint32_t group;        /* light group; 0: none */
    uint32_t program;      /* number of its trc_lamp_program, from 1 on; 0: none */
    uint32_t bounce_limit; /* as trc_light_desc has it */
    uint32_t excluded[2];  /* its light_exclude, low word first */
    uint32_t shadow_class; /* trc_snapshot.shadow_classes */
    float square_reach;    /* of the sphere about the position that rays meet it in */
};

/* What the nodes of a lamp need that does not emit evenly. */
struct trc_lamp_program {
    uint32_t material;  /* into snapshot materials */
    int32_t pass_index; /* these of Object Info */
    float random, color[4];
    float origin[3];
    float to_world[9]; /* rows; of directions */
    float to_light[9]; /* its inverse, 0 where it has none */
};

/* An emissive triangle. */
#define TRC_TRIANGLE_WORDS 16
struct trc_light_triangle {
    float v0[3], v1[3], v2[3]; /* world corners; of a moving one at key 0 */
    float emission[3];         /* constant, or an estimate where varies */
    int32_t instance, triangle;
    uint32_t material; /* into snapshot materials */
    uint32_t flags;    /* TRC_TRIANGLE_* */
};
enum {
    TRC_TRIANGLE_MOVES = 1,     /* its corners depend on time */
    TRC_TRIANGLE_VARIES = 2,    /* its emission is the material's program at the point */
    TRC_TRIANGLE_ASKS_RAYS = 4, /* which depends on the kind of ray */
    TRC_TRIANGLE_BY_RAYS = 8    /* and which Cycles does not sample */
};

/* Bounds of one light or of a subtree: a sphere, a cone of normals, the intensity inside. */
#define TRC_BOUND_WORDS 16
struct trc_light_bound {
    float center[3], radius;
    float axis[3];      /* mean direction of emission */
    float cos_o, sin_o; /* spread of the normals about the axis */
    float cos_e;        /* emission beyond the normals' cone; cos of the angle */
    float intensity;    /* on the axis, W / sr */
    int32_t two_sided;  /* the axis counts in both directions */
    int32_t child; /* inner node: index of the second child, the first is the next node; leaf: -1 */
    int32_t light; /* leaf: number of the light */
    uint32_t excluded[2]; /* bits of the light sets that none of its lights lights */
};

/* Of a scene-linear colour. */
static inline float trc_luminance(const float c[3]) {
    return 0.2126729f * c[0] + 0.7151522f * c[1] + 0.0721750f * c[2];
}

/* The disc of trc_world_desc, which is sampled beside the cells of the map. */
struct trc_world_sun {
    float direction[3]; /* unit */
    float sine;         /* of its radius */
    float tangent;      /* of its radius */
    float square_chord; /* from its middle to its rim on the unit sphere */
    float share;        /* of the light samples where it is above the surface; 0: no sun */
};

/* Blocks of the map's cells, and ranges of normals along a side of the octahedron's square: an odd
 * number, so that those along axes are in the middle of theirs. */
#define TRC_MAP_COLUMNS 16
#define TRC_MAP_ROWS 8
#define TRC_MAP_MAX_WIDTH 8192 /* in cells */
#define TRC_MAP_BLOCKS (TRC_MAP_COLUMNS * TRC_MAP_ROWS)
#define TRC_MAP_NORMALS 17
/* And one for points that are lit from both sides. */
#define TRC_MAP_FACINGS (TRC_MAP_NORMALS * TRC_MAP_NORMALS + 1)

/* How a range of normals weighs the blocks: their light times the cosine. */
struct trc_map_facing {
    float across[TRC_MAP_COLUMNS + 1];             /* running sums of the columns, 0 to 1 */
    float down[TRC_MAP_COLUMNS][TRC_MAP_ROWS + 1]; /* of the blocks of each, 0 to 1 */
    float factor[TRC_MAP_BLOCKS]; /* of the density in a block, down each column in turn */
};
#define TRC_MAP_FACING_WORDS ((int32_t)(sizeof(struct trc_map_facing) / sizeof(float)))

/* Importance map of the world: cells of equal angle, v = 0 at +Z, in blocks of equally many. A
 * direction is found by the chances of the blocks, then by the light of the cells in one. */
struct trc_world_map {
    atomic_uint refs;
    uint32_t width, height;         /* multiples of TRC_MAP_COLUMNS and TRC_MAP_ROWS */
    struct trc_map_facing *facings; /* TRC_MAP_FACINGS, normals by the octahedron's square */
    float *down;      /* for each block, down each column in turn: sums of its rows, 0 to 1 */
    float *along;     /* for each row, for each block in it: sums of its cells, 0 to 1 */
    float *density;   /* width * height: value over the mean, per unit square */
    float average[3]; /* mean magnitude of the radiance over the sphere */
    bool is_even;     /* to rays of no kind it is as bright everywhere */
    struct trc_world_sun sun;
};

/* Up to so many lights with a place the chances of all are computed at each point. */
#define TRC_LIGHT_LIST_MAX 32
/* With more there is a tree, and what is computed at each point are the chances of so many of its
 * nodes, suns included. */
#define TRC_LIGHT_CUT_MAX 8

struct trc_light_table {
    uint32_t lamp_count, triangle_count;
    uint32_t world_light;    /* number of the world as a light, or UINT32_MAX */
    uint32_t first_triangle; /* number of the first emissive triangle */
    uint32_t kinds;          /* 1 << kind of every light present */
    bool hides;          /* some light is not visible to all of diffuse, glossy, transmission, or
                            not of the footage behind shadow catchers */
    bool single;         /* there is exactly one light (world apart: besides it) */
    bool world_apart;    /* the world is sampled beside the other lights, not chosen among them */
    bool moves;          /* some emissive triangle moves */
    bool varies;         /* some has emission by program */
    bool linked;         /* TRC_FEATURE_LINKS */
    bool shadows_linked; /* some emissive triangle has a shadow class */
    bool limited;        /* some lamp has a bounce limit */
    uint32_t program_count;
    struct trc_lamp *lamps;
    struct trc_lamp_program *programs; /* of lamps; NULL: all emit evenly */
    struct trc_light_triangle *triangles;
    /* Chosen among: bounds in a list, or a tree of which bounds[0] is the root. Candidates are the
     * list or a cut through the tree, as indices of bounds, then what is distant. */
    struct trc_light_bound *bounds;
    uint32_t bound_count;
    uint32_t cut[TRC_LIGHT_LIST_MAX], cut_count;
    uint32_t *candidates; /* per light: the candidate it belongs to; UINT32_MAX: never chosen */
    uint32_t *trails;     /* tree: per light, the turns from its candidate on, first in bit 0, 1 the
                             second child */
    uint32_t *distant;    /* numbers of suns, and the world unless apart */
    float *distant_irradiance;
    uint32_t distant_count;
    uint32_t *seen;                                /* lamps that rays can meet, by light group */
    uint32_t group_seen[TRC_MAX_LIGHT_GROUPS + 2]; /* the first of each group, and their number */
    uint32_t *instance_triangles; /* per instance: how many of its triangles are lights */
    struct trc_world_map *map;    /* NULL: cosine or uniform sampling */
    uint32_t world_visibility;    /* of its light samples */
    bool world_asks_rays;         /* its light depends on the kind of ray */
    bool triangles_ask_rays;      /* so does that of some emissive triangle */
    bool world_is_shadowless;     /* nothing blocks its samples */
    bool has_shadowless;          /* of a light that rays find, too */
};

#endif
