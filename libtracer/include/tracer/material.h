/* Materials: flat node lists, compiled at commit. Images that nodes read.
 *
 * A node list is a directed graph in an array: an input takes its value from an output of a node
 * that stands EARLIER in the array, or is a constant. The library folds constants, merges equal
 * nodes, drops what the output does not reach. Meanings follow Blender 3.4's Cycles unless a
 * comment says otherwise. */
#ifndef TRACER_MATERIAL_H
#define TRACER_MATERIAL_H

#include "tracer/base.h"

TRC_BEGIN_DECLS

#define TRC_MAX_NODES 65536
#define TRC_MAX_NODE_INPUTS 32

enum trc_node_type {
#define TRC_NODE(name, number, label, inputs, outputs, modes) TRC_NODE_##name = number,
#include "tracer/nodes.def"
};

/* A bit of MIX_COLOR, MATH and MAP_RANGE: the result is clamped, to [0, 1] or to the range. */
enum trc_mode_flags { TRC_MODE_CLAMP = 1 << 8 };

/* Of tables of COLOR_RAMP, CURVES and FLOAT_CURVE: RGBA values, evenly from end to end. */
enum trc_table_size { TRC_TABLE_ENTRIES = 257 };

/* KEEPS_ENERGY: that of rough surfaces, as Blender 4.3 and later. */
enum trc_diffuse_model { TRC_DIFFUSE_LOSES_ENERGY = 0, TRC_DIFFUSE_KEEPS_ENERGY };

enum trc_toon_component { TRC_TOON_DIFFUSE = 0, TRC_TOON_GLOSSY };
enum trc_hair_component { TRC_HAIR_REFLECTION = 0, TRC_HAIR_TRANSMISSION };
enum trc_pigment { TRC_PIGMENT_COLOR = 0, TRC_PIGMENT_MELANIN, TRC_PIGMENT_ABSORPTION };
enum trc_principled_hair_mode {
    TRC_PRINCIPLED_HAIR_PIGMENT_MASK = 3,
    /* Passes of its colour have its albedo, as from Blender 4.0 on, not its weight alone. */
    TRC_PRINCIPLED_HAIR_ALBEDO = 1 << 2
};

/* How rotation, scale and location apply. TEXTURE: the inverse of POINT; VECTOR is not moved;
 * NORMAL is divided by the scale, not moved, and made unit. */
enum trc_mapping_type {
    TRC_MAPPING_POINT = 0,
    TRC_MAPPING_TEXTURE,
    TRC_MAPPING_VECTOR,
    TRC_MAPPING_NORMAL
};

/* Space of the map; the BLENDER ones have Y and Z turned around (Blender's own baked maps). */
enum trc_normal_map_space {
    TRC_NORMAL_MAP_TANGENT = 0,
    TRC_NORMAL_MAP_OBJECT,
    TRC_NORMAL_MAP_WORLD,
    TRC_NORMAL_MAP_BLENDER_OBJECT,
    TRC_NORMAL_MAP_BLENDER_WORLD
};

/* Bits of NORMAL_MAP besides its space. SCALED: strength scales what a map of tangents says, and a
 * negative one turns it around, as from Blender 4.0 on; else it goes from the shading normal to
 * that of the map. UNIT: what such a map turns is as long between corners as at them, as in
 * Blender 5. DOWN: the map's Y points down (DirectX). */
enum trc_normal_map_flags {
    TRC_NORMAL_MAP_SCALED = 8,
    TRC_NORMAL_MAP_UNIT = 16,
    TRC_NORMAL_MAP_DOWN = 32,
    TRC_NORMAL_MAP_SPACE_MASK = 7
};

/* INVERT: bumps become hollows. ABOVE: normals are turned back until what they reflect rises above
 * the surface, as in Blender before 4.0. */
enum trc_bump_mode { TRC_BUMP_INVERT = 1, TRC_BUMP_ABOVE = 2 };

/* PIXELS: the size is in pixels at the point, as the ray sees them. STEEP: heights of wires have
 * slopes that are once more over the length of their step, as in Blender before 4.4. */
enum trc_wireframe_mode {
    TRC_WIREFRAME_PIXELS = 1,
    TRC_WIREFRAME_STEEP = 2,
    TRC_WIREFRAME_MASK = 3
};

/* LEVEL: heights of the attribute are those of the shaded point, as of the Color Attribute node in
 * Blender 5. */
enum trc_attribute_mode { TRC_ATTRIBUTE_LEVEL = 1 };

/* CURVED: heights of normals see these turn from point to point where the surface is smooth, as in
 * Blender 5; without it they are those of the shaded point. */
enum trc_coordinate_mode { TRC_COORDINATE_CURVED = 1 };

/* The number of samples, and bits. INSIDE: around the opposite of the normal. ONLY_LOCAL: of the
 * same instance alone. OF_WORLD: within the distance of trc_world_desc.
 */
enum trc_ambient_mode {
    TRC_AMBIENT_SAMPLES_MASK = 255,
    TRC_AMBIENT_INSIDE = 1 << 8,
    TRC_AMBIENT_ONLY_LOCAL = 1 << 9,
    TRC_AMBIENT_OF_WORLD = 1 << 10
};

enum trc_raycast_mode { TRC_RAYCAST_ONLY_LOCAL = 1 };

/* BUMP: the height along the normal turns the shading normal, as a Bump node would. TRUE: at commit
 * the vertices are moved, and their normals made anew. BOTH: they are moved, their normals stay and
 * are turned. ABOVE: a bit, as TRC_BUMP_ABOVE. */
enum trc_displacement_method {
    TRC_DISPLACEMENT_BUMP = 0,
    TRC_DISPLACEMENT_TRUE,
    TRC_DISPLACEMENT_BOTH,
    TRC_DISPLACEMENT_ABOVE = 4
};

/* Between the entries of the table. */
enum trc_ramp_interpolation { TRC_RAMP_LINEAR = 0, TRC_RAMP_CONSTANT };

/* Of trc_node.mode of a BLACKBODY and a WAVELENGTH: whether what Rec.709 cannot show keeps its
 * negative components, for another space of wider primaries. */
enum trc_gamut { TRC_GAMUT_CLIPPED = 0, TRC_GAMUT_OPEN };

/* Beyond the ends of the table: as at the end, or straight on. */
enum trc_curves_extension { TRC_CURVES_CONSTANT = 0, TRC_CURVES_EXTRAPOLATED };

enum trc_separate_mode {
    TRC_SEPARATE_RGB = 0,
    TRC_SEPARATE_HSV,
    TRC_SEPARATE_HSL,
    TRC_SEPARATE_XYZ
};

/* RANGE: min and max in either order. */
enum trc_clamp_type { TRC_CLAMP_MINMAX = 0, TRC_CLAMP_RANGE };

/* Around an axis of the object (Generated coordinates), or where U of a UV map grows. */
enum trc_tangent_source { TRC_TANGENT_Z = 0, TRC_TANGENT_X, TRC_TANGENT_Y, TRC_TANGENT_UV };

enum trc_space_id { TRC_SPACE_WORLD = 0, TRC_SPACE_OBJECT, TRC_SPACE_CAMERA };

/* UNIT_VECTOR: the normal of Blender before 4.0. NORMAL: by the inverse transpose, unit unless the
 * spaces are one. */
enum trc_transformed_type {
    TRC_TRANSFORMED_POINT = 0,
    TRC_TRANSFORMED_VECTOR,
    TRC_TRANSFORMED_UNIT_VECTOR,
    TRC_TRANSFORMED_NORMAL
};
enum trc_vector_transform_mode {
    TRC_SPACE_MASK = 3,
    TRC_SPACE_TO_SHIFT = 2,
    TRC_TRANSFORMED_SHIFT = 4
};

/* EULER reads rotation (XYZ), the others angle; AXIS_ANGLE axis too. */
enum trc_rotate_mode {
    TRC_ROTATE_AXIS_ANGLE = 0,
    TRC_ROTATE_X,
    TRC_ROTATE_Y,
    TRC_ROTATE_Z,
    TRC_ROTATE_EULER
};
enum trc_rotate_flags { TRC_ROTATE_INVERSE = 1 << 3 /* the other way */ };

/* Mask of NOISE, MUSGRAVE, VORONOI and WHITE_NOISE: dimensions - 1. */
enum trc_texture_mode { TRC_DIMENSIONS_MASK = 3 };

/* Fractals of gradient noise. FBM_UNIT is fractal Brownian motion scaled to [0, 1]. */
enum trc_fractal_type {
    TRC_FRACTAL_FBM_UNIT = 0,
    TRC_FRACTAL_FBM,
    TRC_FRACTAL_MULTIFRACTAL,
    TRC_FRACTAL_HETERO_TERRAIN,
    TRC_FRACTAL_HYBRID_MULTIFRACTAL,
    TRC_FRACTAL_RIDGED_MULTIFRACTAL
};
enum trc_noise_mode { TRC_NOISE_TYPE_SHIFT = 2 };

enum trc_voronoi_metric {
    TRC_VORONOI_EUCLIDEAN = 0,
    TRC_VORONOI_MANHATTAN,
    TRC_VORONOI_CHEBYCHEV,
    TRC_VORONOI_MINKOWSKI
};
enum trc_voronoi_feature {
    TRC_VORONOI_F1 = 0,
    TRC_VORONOI_F2,
    TRC_VORONOI_SMOOTH_F1,
    TRC_VORONOI_DISTANCE_TO_EDGE,
    TRC_VORONOI_N_SPHERE_RADIUS
};
enum trc_voronoi_mode {
    TRC_VORONOI_METRIC_MASK = 3, /* after the shift */
    TRC_VORONOI_METRIC_SHIFT = 2,
    TRC_VORONOI_FEATURE_MASK = 7, /* after the shift */
    TRC_VORONOI_FEATURE_SHIFT = 4,
    TRC_VORONOI_NORMALIZE = 1 << 7, /* distance and color to about [0, 1] */
    /* Points of cells as in Blender 5: those of 2 dimensions and more are hashed otherwise. */
    TRC_VORONOI_PCG = 1 << 8,
    /* Points of any distance count, as from Blender 4.0 on, not only those nearer than 8:
     * Minkowski's distances of small exponents are long. */
    TRC_VORONOI_UNLIMITED = 1 << 9
};

enum trc_wave_profile { TRC_WAVE_SINE = 0, TRC_WAVE_SAW, TRC_WAVE_TRIANGLE };
/* Of bands or, DIAGONAL being spherical, of rings. */
enum trc_wave_direction { TRC_WAVE_X = 0, TRC_WAVE_Y, TRC_WAVE_Z, TRC_WAVE_DIAGONAL };
enum trc_wave_mode {
    TRC_WAVE_PROFILE_MASK = 3,
    TRC_WAVE_RINGS = 1 << 2,
    TRC_WAVE_DIRECTION_MASK = 3, /* after the shift */
    TRC_WAVE_DIRECTION_SHIFT = 3
};

enum trc_gradient_type {
    TRC_GRADIENT_LINEAR = 0,
    TRC_GRADIENT_QUADRATIC,
    TRC_GRADIENT_EASING,
    TRC_GRADIENT_DIAGONAL,
    TRC_GRADIENT_RADIAL,
    TRC_GRADIENT_QUADRATIC_SPHERE,
    TRC_GRADIENT_SPHERICAL
};

enum trc_radial_tiling_mode { TRC_RADIAL_TILING_NORMALIZE = 1 };

enum trc_magic_mode {
    TRC_MAGIC_MAX_DEPTH = 10,
    TRC_MAGIC_DEPTH_MASK = 15,
    /* Coordinates are scaled before whole turns are left out, as in Blender 5.2, not after it:
     * where they are more than a turn, the pattern goes on without a seam. */
    TRC_MAGIC_SCALED_FIRST = 1 << 4
};

enum trc_brick_mode { TRC_BRICK_ROWS_MASK = 127, TRC_BRICK_SQUASH_SHIFT = 7 };

/* Microfacet distributions. SHARP ignores roughness. */
enum trc_distribution_type {
    TRC_DISTRIBUTION_GGX = 0,
    TRC_DISTRIBUTION_MULTI_GGX = 1,
    TRC_DISTRIBUTION_BECKMANN = 2,
    TRC_DISTRIBUTION_SHARP = 3,
    TRC_DISTRIBUTION_ASHIKHMIN = 4,
    /* Bit for Glossy, Glass and Refraction, as Blender 4.0 and later: masking and shadowing of one
     * height, Fresnel by the micro-normal, the energy of MULTI_GGX by a factor. */
    TRC_DISTRIBUTION_CORRELATED = 16,
    /* Bit for Principled from 4.0 on, as Blender 5: thin films lie on metal, too, and interfere in
     * full from 1 nm on in place of 30; conductors of small indices are not approximated. */
    TRC_DISTRIBUTION_FILMED_METAL = 32,
    /* Bit for Principled from 4.0 on, as Blender 5: its coat has the energy of MULTI_GGX. */
    TRC_DISTRIBUTION_WHOLE_COAT = 64,
    /* Bit for Principled from 4.0 on, of Blender 5: its glass is a sheet without thickness. */
    TRC_DISTRIBUTION_THIN_WALL = 128,
    /* Bit for Principled from 4.0 on, as the Metallic shader of 4.3: its metal reflects as one of
     * the complex index base_color + i specular_tint, channel by channel. */
    TRC_DISTRIBUTION_CONDUCTOR = 256
};

enum trc_blend_mode {
    TRC_BLEND_MIX = 0,
    TRC_BLEND_DARKEN,
    TRC_BLEND_MULTIPLY,
    TRC_BLEND_BURN,
    TRC_BLEND_LIGHTEN,
    TRC_BLEND_SCREEN,
    TRC_BLEND_DODGE,
    TRC_BLEND_ADD,
    TRC_BLEND_OVERLAY,
    TRC_BLEND_SOFT_LIGHT,
    TRC_BLEND_LINEAR_LIGHT,
    TRC_BLEND_DIFFERENCE,
    TRC_BLEND_SUBTRACT,
    TRC_BLEND_DIVIDE,
    TRC_BLEND_HUE,
    TRC_BLEND_SATURATION,
    TRC_BLEND_COLOR,
    TRC_BLEND_VALUE,
    TRC_BLEND_EXCLUSION
};

enum trc_math_operation {
    TRC_MATH_ADD = 0,
    TRC_MATH_SUBTRACT,
    TRC_MATH_MULTIPLY,
    TRC_MATH_DIVIDE,
    TRC_MATH_MULTIPLY_ADD,
    TRC_MATH_POWER,
    TRC_MATH_LOGARITHM,
    TRC_MATH_SQRT,
    TRC_MATH_INVERSE_SQRT,
    TRC_MATH_ABSOLUTE,
    TRC_MATH_EXPONENT,
    TRC_MATH_MINIMUM,
    TRC_MATH_MAXIMUM,
    TRC_MATH_LESS_THAN,
    TRC_MATH_GREATER_THAN,
    TRC_MATH_SIGN,
    TRC_MATH_COMPARE,
    TRC_MATH_SMOOTH_MIN,
    TRC_MATH_SMOOTH_MAX,
    TRC_MATH_ROUND,
    TRC_MATH_FLOOR,
    TRC_MATH_CEIL,
    TRC_MATH_TRUNC,
    TRC_MATH_FRACT,
    TRC_MATH_MODULO,
    TRC_MATH_WRAP,
    TRC_MATH_SNAP,
    TRC_MATH_PINGPONG,
    TRC_MATH_SINE,
    TRC_MATH_COSINE,
    TRC_MATH_TANGENT,
    TRC_MATH_ARCSINE,
    TRC_MATH_ARCCOSINE,
    TRC_MATH_ARCTANGENT,
    TRC_MATH_ARCTAN2,
    TRC_MATH_SINH,
    TRC_MATH_COSH,
    TRC_MATH_TANH,
    TRC_MATH_RADIANS,
    TRC_MATH_DEGREES
};

enum trc_vector_operation {
    TRC_VECTOR_ADD = 0,
    TRC_VECTOR_SUBTRACT,
    TRC_VECTOR_MULTIPLY,
    TRC_VECTOR_DIVIDE,
    TRC_VECTOR_MULTIPLY_ADD,
    TRC_VECTOR_CROSS,
    TRC_VECTOR_PROJECT,
    TRC_VECTOR_REFLECT,
    TRC_VECTOR_DOT,
    TRC_VECTOR_DISTANCE,
    TRC_VECTOR_LENGTH,
    TRC_VECTOR_SCALE,
    TRC_VECTOR_NORMALIZE,
    TRC_VECTOR_ABSOLUTE,
    TRC_VECTOR_MINIMUM,
    TRC_VECTOR_MAXIMUM,
    TRC_VECTOR_FLOOR,
    TRC_VECTOR_CEIL,
    TRC_VECTOR_FRACT,
    TRC_VECTOR_SINE,
    TRC_VECTOR_COSINE,
    TRC_VECTOR_TANGENT,
    TRC_VECTOR_SNAP,
    TRC_VECTOR_MODULO,
    TRC_VECTOR_WRAP,
    TRC_VECTOR_FACEFORWARD,
    TRC_VECTOR_REFRACT, /* scale: the relative index of refraction */
    TRC_VECTOR_ROUND,
    TRC_VECTOR_SIGN,
    TRC_VECTOR_POWER
};

/* Mode bits of IMAGE, one of each of the three. */
enum trc_image_interpolation { TRC_IMAGE_LINEAR = 0, TRC_IMAGE_CLOSEST = 1, TRC_IMAGE_CUBIC = 2 };
enum trc_image_extension {
    TRC_IMAGE_REPEAT = 0 << 2,
    TRC_IMAGE_EXTEND = 1 << 2,
    TRC_IMAGE_CLIP = 2 << 2,
    TRC_IMAGE_MIRROR = 3 << 2
};
enum trc_image_projection {
    TRC_IMAGE_FLAT = 0 << 4,
    TRC_IMAGE_BOX = 1 << 4,
    TRC_IMAGE_SPHERE = 2 << 4,
    TRC_IMAGE_TUBE = 3 << 4
};
enum trc_image_mode {
    TRC_IMAGE_INTERPOLATION_MASK = 3,
    TRC_IMAGE_EXTENSION_MASK = 3 << 2,
    TRC_IMAGE_PROJECTION_MASK = 3 << 4
};

enum trc_environment_projection {
    TRC_ENVIRONMENT_EQUIRECTANGULAR = 0 << 4,
    TRC_ENVIRONMENT_MIRROR_BALL = 1 << 4
};

/* What an input takes that is linked to no node. */
enum trc_input_source {
    TRC_INPUT_CONSTANT = -1, /* its value */
    TRC_INPUT_DEFAULT = -2   /* what Blender gives an unlinked socket; only of the kinds that have
                                a default (tracer/nodes.def) */
};

typedef struct trc_node_input {
    int32_t node;    /* index of an earlier node, or TRC_INPUT_* */
    uint32_t output; /* number of that node's output */
    float value[3];  /* the constant; a float input reads value[0] */
} trc_node_input;

/* The constant 0. */
TRC_API trc_node_input trc_node_input_default(void);

typedef struct trc_node {
    uint32_t type;        /* TRC_NODE_* */
    uint32_t mode;        /* of the type; 0 where it has none */
    uint32_t first_input; /* into trc_material_desc.inputs */
    uint32_t input_count; /* exactly the count of the type */
    trc_id image;         /* IMAGE, ENVIRONMENT; 0 renders magenta */
    const char *name;     /* attribute name or NULL */
    const float *table;   /* COLOR_RAMP, CURVES, FLOAT_CURVE, else NULL */
    uint64_t table_count; /* floats: 4 * TRC_TABLE_ENTRIES */
} trc_node;

/* A Diffuse, its inputs not yet given. */
TRC_API trc_node trc_node_default(void);

typedef struct trc_material_desc {
    uint32_t struct_size;         /* of this structure; checked */
    uint32_t node_count;          /* 0: black, opaque */
    const trc_node *nodes;        /* node_count <= TRC_MAX_NODES, each after those it reads */
    const trc_node_input *inputs; /* of all nodes, one after the other */
    uint32_t input_count;         /* <= TRC_MAX_NODES * TRC_MAX_NODE_INPUTS */
    int32_t surface;              /* index of the shader node that is the output; -1: black */
    int32_t pass_index;           /* Material Index pass */
    uint32_t flags;               /* TRC_MATERIAL_* */
    float cryptomatte;            /* trc_cryptomatte_id of its name; 0: in no matte */
    uint32_t reserved;            /* 0 */
    /* Thin films: what the colours of the scene are of those in Linear Rec.709, row by row, 9
     * floats, each row with the sum 1 for white to stay white; copied. NULL: they are those. */
    const float *film_colors;
} trc_material_desc;

/* Black. With nodes: emission is sampled, shadow rays see transparency. */
TRC_API trc_material_desc trc_material_desc_default(void);

enum trc_material_flags {
    /* Sample its emissive triangles as lights ("multiple importance sample"). Off: glossy rays
     * alone find them, unless some surface of the scene has diffuse or translucent lobes, which
     * only samples light. */
    TRC_MATERIAL_SAMPLE_EMISSION = 1,
    TRC_MATERIAL_TRANSPARENT_SHADOW =
        2, /* shadow rays see its transparency; else it is opaque to them */
    /* At camera hits each lobe is chosen at least one time in nine or so (Cycles 3.4); else by its
     * weight alone, as at later hits. What Cycles loses with diffuse bounces 0 depends on it. */
    TRC_MATERIAL_DEFENSIVE_SAMPLING = 4,
    /* Diffuse lobes whose normals are bent lie in shadow as microfacets do (Cycles 5), which is
     * darker towards the terminator, and Principled Hair on faces takes light samples from a part
     * of all sides; else as Cycles 3.4 and 4 have it. */
    TRC_MATERIAL_FACET_SHADOWING = 8,
    /* Rays that Hair reflects below the surface keep all light of what lies wholly there, as with
     * Cycles' light tree, which never chooses such a light for a surface without transmission; else
     * they share it with samples of lights that Hair gives nothing of, and lose that part. */
    TRC_MATERIAL_LIGHT_TREE = 16,
    /* Lobes without microfacets (diffuse, translucent, sheen, velvet, toon) take normals as they
     * are, and those of all lobes are made as long as 1 (Cycles 4 and 5); else these are turned
     * back until a mirror would reflect the view above the surface, as those of all other lobes
     * are, and keep their length (Cycles 3.4). */
    TRC_MATERIAL_KEEPS_NORMALS = 32,
    /* What the camera sees of a holdout that is made of it: what is transparent stays so, and all
     * else, emission too, is a hole in the film. */
    TRC_MATERIAL_CUTS_OUT = 64,
    /* Shadow rays that see its transparency are a pixel and their length times the roughness of
     * what is lit apart (Cycles 5), so that bumps there are smooth; else a pixel. */
    TRC_MATERIAL_WIDE_SHADOWS = 128
};

/* A material from a node list, in use from the next commit on. INVALID_ARGUMENT, with the node and
 * the input, for a list that is none: an unknown type or mode, a wrong number of inputs, a source
 * that is no earlier node or of another kind, a constant that is NaN or infinite. Others out of
 * range (roughness < 0, IOR <= 0) are clamped as Cycles does. */
TRC_API trc_status trc_material_create(trc_scene scene, const trc_material_desc *desc,
                                       trc_id *material_out);

/* Replaces a material where it is in use, from the next commit on; errors as for create. */
TRC_API trc_status trc_material_update(trc_scene scene, trc_id material,
                                       const trc_material_desc *desc);

/* Frees a material from the next commit on. Instances that still use it fall back to the default
 * material, a world to black. */
TRC_API trc_status trc_material_destroy(trc_scene scene, trc_id material);

enum trc_alpha_mode {
    TRC_ALPHA_STRAIGHT = 0,
    TRC_ALPHA_PREMULTIPLIED = 1,
    TRC_ALPHA_CHANNEL_PACKED = 2,
    TRC_ALPHA_NONE = 3
};

typedef struct trc_image_desc {
    uint32_t struct_size;   /* of this structure; checked */
    uint32_t width, height; /* pixels, 1..65536, width * height <= 2^30; 0 without pixels */
    uint32_t alpha_mode;    /* TRC_ALPHA_* */
    uint32_t is_srgb;     /* 1: colour values are sRGB-encoded and are linearised, 0: as they are */
    uint32_t is_float;    /* pixels are float (else uint8); ignored with a path */
    const void *pixels;   /* RGBA, bottom row first, float or uint8; NULL with a path */
    uint64_t pixel_bytes; /* size of that buffer, checked */
    const char *path;     /* file, read at once (see reader.h); NULL with pixels. Neither: an image
                             without contents, magenta until trc_image_update gives it some */
    const char
        *color_config;       /* OpenColorIO configuration, a file; read if there is a color_space */
    const char *color_space; /* of the pixels, in the configuration: colours are converted to its
                                role scene_linear at once, and bytes become half floats unless
                                that changes nothing. NULL: as is_srgb says, which is 0 otherwise */
    uint32_t max_side; /* a larger image is halved until no side is longer or one is a single pixel;
                          0: no limit */
    /* 1: smaller levels are kept for IMAGE nodes that read a UV map and interpolate, where a sample
     * stands for 4 texels or more: less noise, fewer cache misses, a sixth more memory (floats: a
     * twelfth). With more samples per pixel lookups return to the image itself. */
    uint32_t is_mip_mapped;
    /* 1: alpha_mode says of a file what its colours are, STRAIGHT or PREMULTIPLIED, as of pixels
     * (Blender 5); 0: the file does. */
    uint32_t is_alpha_literal;
} trc_image_desc;

/* Nothing yet: straight alpha, values as they are. */
TRC_API trc_image_desc trc_image_desc_default(void);

/* Copies an image into the scene, or reads its file. TRC_ERROR_IMAGE for a file that cannot be
 * read, or colours that cannot be converted: the caller may go on with image 0 (magenta).
 * TRC_ERROR_TOO_LARGE also for a file that claims more pixels than one of its size can have,
 * TRC_ERROR_FORMAT for one in no known format. TRC_ERROR_UNSUPPORTED for a path or a color_space
 * where the reader's program is absent (a build without OpenImageIO) or does not run. */
TRC_API trc_status trc_image_create(trc_scene scene, const trc_image_desc *desc, trc_id *image_out);

/* Gives an image other contents from the next commit on, of any size; errors as of trc_image_create
 * leave it as it was. Materials that were made while it had none have smaller levels if both
 * descriptors ask for them. */
TRC_API trc_status trc_image_update(trc_scene scene, trc_id image, const trc_image_desc *desc);

/* Reads the file of a descriptor ahead, beside others and beside other work: trc_image_create or
 * trc_image_update with an equal descriptor takes it from there, before the next commit, which
 * drops what was not taken. Nothing else comes of it, and it reports no file that cannot be read.
 * To make images without contents first and to update them last lets files be read all the while.
 */
TRC_API trc_status trc_image_expect(trc_scene scene, const trc_image_desc *desc);

/* Frees an image from the next commit on. Nodes that still read it render magenta. */
TRC_API trc_status trc_image_destroy(trc_scene scene, trc_id image);

TRC_END_DECLS

#endif
