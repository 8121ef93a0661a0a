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

#define TRC_MAX_NODES 4096
#define TRC_MAX_NODE_INPUTS 32

/* Inputs of each type in order, with their kind: c colour or vector (3 floats), f float, s shader.
 * Outputs in order after "->". */
enum trc_node_type {
    /* shaders (one output, the closure) */
    TRC_NODE_DIFFUSE = 1,    /* c color, f roughness, c normal; mode: 1 keeps the energy of rough
                                surfaces, as Blender 4.3 and later */
    TRC_NODE_GLOSSY = 2,     /* c color, f roughness, f anisotropy, f rotation, c normal, c tangent;
                                mode: TRC_DISTRIBUTION_* */
    TRC_NODE_GLASS = 3,      /* c color, f roughness, f ior, c normal; mode: distribution */
    TRC_NODE_REFRACTION = 4, /* c color, f roughness, f ior, c normal; mode: distribution */
    TRC_NODE_TRANSPARENT = 5, /* c color */
    TRC_NODE_TRANSLUCENT = 6, /* c color, c normal */
    TRC_NODE_EMISSION = 7,    /* c color, f strength */
    TRC_NODE_BACKGROUND = 8,  /* c color, f strength (worlds) */
    TRC_NODE_MIX_SHADER = 9,  /* f factor, s first, s second */
    TRC_NODE_ADD_SHADER = 10, /* s first, s second */
    TRC_NODE_HOLDOUT = 11,    /* no input */
    /* Principled as in 3.4; mode: distribution; inputs: c base_color, f subsurface,
     * c subsurface_color, f metallic, f specular, f specular_tint, f roughness, f anisotropic,
     * f anisotropic_rotation, f sheen, f sheen_tint, f clearcoat, f clearcoat_roughness, f ior,
     * f transmission, f transmission_roughness, c emission, f emission_strength, f alpha, c normal,
     * c clearcoat_normal, c tangent */
    TRC_NODE_PRINCIPLED = 12,
    TRC_NODE_VELVET = 13, /* c color, f sigma, c normal */
    TRC_NODE_TOON = 14,   /* c color, f size, f smooth, c normal; mode: 0 diffuse, 1 glossy */
    /* Principled of Blender 4.0 and later; mode: GGX or MULTI_GGX; inputs: c base_color, f
     * metallic, f roughness, f ior, f alpha, c normal, f diffuse_roughness, f specular_ior_level,
     * c specular_tint, f anisotropic, f anisotropic_rotation, c tangent, f transmission_weight,
     * f coat_weight, f coat_roughness, f coat_ior, c coat_tint, c coat_normal, f sheen_weight,
     * f sheen_roughness, c sheen_tint, c emission_color, f emission_strength. Subsurface scattering
     * is the diffuse lobe, thin film is left out. */
    TRC_NODE_LAYERED_PRINCIPLED = 15,
    TRC_NODE_SHEEN = 16, /* c color, f roughness, c normal: the microfibres of Blender 4.0 */

    /* values */
    TRC_NODE_IMAGE = 64, /* c vector, f blend -> c color, f alpha; image, interpolation in mode bits
                            0-1, extension in bits 2-3, projection in bits 4-5: flat, box (blend:
                            how far its sides run into each other, 0 to 1), sphere, tube */
    TRC_NODE_ENVIRONMENT = 65, /* c vector -> c color; image; mode: interpolation bits 0-1, bit 4: 0
                                  equirectangular, 1 mirror ball */
    TRC_NODE_UV_MAP = 66,      /* -> c uv; name: the attribute, "" for the default map */
    TRC_NODE_COLOR_ATTRIBUTE = 67,    /* -> c color, f alpha; name */
    TRC_NODE_TEXTURE_COORDINATE = 68, /* -> c generated, c normal, c uv, c object, c camera, c
                                         window, c reflection */
    TRC_NODE_MAPPING = 69,      /* c vector, c location, c rotation, c scale -> c; mode 0 point,
                                   1 texture, 2 vector, 3 normal */
    TRC_NODE_MIX_COLOR = 70,    /* f factor, c a, c b -> c; mode: TRC_BLEND_* | 256 clamp */
    TRC_NODE_MATH = 71,         /* f a, f b, f c -> f; mode: TRC_MATH_* | 256 clamp */
    TRC_NODE_FRESNEL = 72,      /* f ior, c normal -> f */
    TRC_NODE_LAYER_WEIGHT = 73, /* f blend, c normal -> f fresnel, f facing */
    TRC_NODE_LIGHT_PATH = 74,   /* -> f is camera, shadow, diffuse, glossy, singular, reflection,
                                   transmission, ray length, ray depth, diffuse depth, glossy depth,
                                   transparent depth, transmission depth */
    TRC_NODE_GEOMETRY = 75,     /* -> c position, c normal, c tangent, c true_normal, c incoming,
                                   c parametric, f backfacing, f pointiness, f random_per_island */
    TRC_NODE_NORMAL_MAP =
        76,               /* f strength, c color -> c normal; mode 0 tangent, 1 object, 2 world,
                             3 and 4 object and world with Y and Z turned around (Blender's own
                             baked maps); name: UV map, whose tangents are those of each triangle
                             by itself, or an attribute of width 4 with tangents at the corners:
                             a, b, 1 or -1, 0 for the direction a (p1 - p0) + b (p2 - p0), made
                             perpendicular to the corner's normal, and the handedness */
    TRC_NODE_INVERT = 77, /* f factor, c color -> c */
    TRC_NODE_GAMMA = 78,  /* c color, f gamma -> c */
    TRC_NODE_HUE_SATURATION = 79,  /* f hue, f saturation, f value, f factor, c color -> c */
    TRC_NODE_BRIGHT_CONTRAST = 80, /* c color, f bright, f contrast -> c */
    TRC_NODE_COLOR_RAMP = 81,      /* f factor -> c color, f alpha; table: 257 RGBA values;
                                      mode 0 linear between them, 1 constant */
    TRC_NODE_SEPARATE = 82,        /* c -> f, f, f; mode 0 RGB, 1 HSV, 2 HSL, 3 XYZ */
    TRC_NODE_COMBINE = 83,         /* f, f, f -> c; mode as SEPARATE */
    TRC_NODE_MAP_RANGE = 84,   /* f value, f from_min, f from_max, f to_min, f to_max -> f; linear;
                                  mode bit 8: clamp */
    TRC_NODE_CLAMP = 85,       /* f value, f min, f max -> f; mode 0 min-max, 1 range */
    TRC_NODE_CHECKER = 86,     /* c vector, c color1, c color2, f scale -> c color, f factor */
    TRC_NODE_OBJECT_INFO = 87, /* -> c location, c color, f alpha, f object_index, f material_index,
                                  f random */
    TRC_NODE_VECTOR_MATH = 88, /* c a, c b, c c, f scale -> c vector, f value; mode: TRC_VECTOR_* */
    TRC_NODE_RGB_TO_BW = 89,   /* c color -> f */
    TRC_NODE_INSTANCE_VALUES = 90, /* -> c, three of the values of the instance; mode: number of the
                                      first. Those it does not have are 0 */

    /* procedural textures; vectors default to Generated */
    TRC_NODE_NOISE = 96,        /* c vector, f w, f scale, f detail, f roughness, f lacunarity,
                                   f offset, f gain, f distortion -> f value, c color; mode: dimensions
                                   - 1 in bits 0-1, TRC_FRACTAL_* from bit TRC_NOISE_TYPE_SHIFT */
    TRC_NODE_MUSGRAVE = 97,     /* c vector, f w, f scale, f detail, f dimension, f lacunarity,
                                   f offset, f gain -> f; mode as NOISE, without FBM_UNIT */
    TRC_NODE_VORONOI = 98,      /* c vector, f w, f scale, f smoothness, f exponent, f randomness,
                                   f detail, f roughness, f lacunarity -> f distance, c color,
                                   c position, f w, f radius; mode: dimensions - 1 in bits 0-1, metric
                                   and TRC_VORONOI_* feature from bits TRC_VORONOI_METRIC_SHIFT and
                                   TRC_VORONOI_FEATURE_SHIFT, TRC_VORONOI_NORMALIZE. The radius has
                                   no octaves */
    TRC_NODE_WAVE = 99,         /* c vector, f scale, f distortion, f detail, f detail_scale,
                                   f detail_roughness, f phase -> f; mode: profile in bits 0-1,
                                   TRC_WAVE_RINGS, from bit TRC_WAVE_DIRECTION_SHIFT 0-2 X, Y, Z,
                                   3 diagonal or spherical */
    TRC_NODE_GRADIENT = 100,    /* c vector -> f; mode: TRC_GRADIENT_* */
    TRC_NODE_WHITE_NOISE = 101, /* c vector, f w -> f value, c color; mode: dimensions - 1 */
    TRC_NODE_MAGIC = 102, /* c vector, f scale, f distortion -> c color, f factor; mode: depth,
                             0-10 */
    TRC_NODE_BRICK = 103, /* c vector, c color1, c color2, c mortar, f scale, f mortar_size,
                             f mortar_smooth, f bias, f brick_width, f row_height, f offset,
                             f squash -> c color, f factor; mode: every how many rows are offset
                             in bits 0-6, squashed from bit TRC_BRICK_SQUASH_SHIFT, 0: never */

    /* the rest */
    TRC_NODE_CURVES = 104, /* f factor, c color, f low, f high -> c; table: 257 RGBA values, each
                              channel by its own, over low to high; mode 1: straight on beyond */
    TRC_NODE_FLOAT_CURVE = 105, /* f factor, f value, f low, f high -> f; table: as CURVES, R is
                                   read; mode as CURVES */
    TRC_NODE_BLACKBODY = 106,   /* f temperature (K) -> c */
    TRC_NODE_WAVELENGTH = 107,  /* f wavelength (nm) -> c */
    TRC_NODE_VECTOR_TRANSFORM =
        108,                      /* c vector -> c; mode: TRC_SPACE_* of the source in bits 0-1, of
                                     the target in bits 2-3, bits 4-5: 0 point, 1 vector,
                                     2 unit vector (the normal of Blender before 4.0), 3 normal:
                                     by the inverse transpose, unit unless the spaces are one */
    TRC_NODE_VECTOR_ROTATE = 109, /* c vector, c center, c axis, f angle, c rotation -> c; mode:
                                     TRC_ROTATE_* | 8 to turn the other way */
    TRC_NODE_CAMERA_DATA = 110,   /* -> c view_vector, f view_z_depth, f view_distance */
    TRC_NODE_WIREFRAME = 111,     /* f size (m, world) -> f */
    TRC_NODE_TANGENT = 114, /* -> c; mode: TRC_TANGENT_*; name, if of a UV map: as NORMAL_MAP */

    /* outputs besides the surface: no node has to lead to them; mode: number of the AOV */
    TRC_NODE_AOV_VALUE = 112, /* f value */
    TRC_NODE_AOV_COLOR = 113  /* c color */
};

/* Around an axis of the object (Generated coordinates), or where U of a UV map grows. */
enum trc_tangent_source { TRC_TANGENT_Z = 0, TRC_TANGENT_X, TRC_TANGENT_Y, TRC_TANGENT_UV };

enum trc_space_id { TRC_SPACE_WORLD = 0, TRC_SPACE_OBJECT, TRC_SPACE_CAMERA };

/* Radians; EULER reads rotation (XYZ), the others angle; AXIS_ANGLE axis too. */
enum trc_rotate_mode {
    TRC_ROTATE_AXIS_ANGLE = 0,
    TRC_ROTATE_X,
    TRC_ROTATE_Y,
    TRC_ROTATE_Z,
    TRC_ROTATE_EULER
};

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
    TRC_VORONOI_METRIC_SHIFT = 2,
    TRC_VORONOI_FEATURE_SHIFT = 4,
    TRC_VORONOI_NORMALIZE = 1 << 7 /* distance and color to about [0, 1] */
};

enum trc_wave_mode {
    TRC_WAVE_SINE = 0,
    TRC_WAVE_SAW,
    TRC_WAVE_TRIANGLE,
    TRC_WAVE_PROFILE = 3, /* mask */
    TRC_WAVE_RINGS = 1 << 2,
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

enum trc_brick_mode { TRC_BRICK_SQUASH_SHIFT = 7 };

/* Microfacet distributions. SHARP ignores roughness. */
enum trc_distribution_type {
    TRC_DISTRIBUTION_GGX = 0,
    TRC_DISTRIBUTION_MULTI_GGX = 1,
    TRC_DISTRIBUTION_BECKMANN = 2,
    TRC_DISTRIBUTION_SHARP = 3,
    TRC_DISTRIBUTION_ASHIKHMIN = 4,
    /* Bit for Glossy, Glass and Refraction, as Blender 4.0 and later: masking and shadowing of one
     * height, Fresnel by the micro-normal, the energy of MULTI_GGX by a factor. */
    TRC_DISTRIBUTION_CORRELATED = 16
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
    TRC_VECTOR_REFRACT /* scale: the relative index of refraction */
};

/* Mode bits of TRC_NODE_IMAGE. */
enum trc_image_mode {
    TRC_IMAGE_LINEAR = 0,
    TRC_IMAGE_CLOSEST = 1,
    TRC_IMAGE_CUBIC = 2,
    TRC_IMAGE_REPEAT = 0 << 2,
    TRC_IMAGE_EXTEND = 1 << 2,
    TRC_IMAGE_CLIP = 2 << 2,
    TRC_IMAGE_MIRROR = 3 << 2
};

/* What an input takes that is linked to no node. */
enum trc_input_source {
    TRC_INPUT_CONSTANT = -1, /* its value */
    TRC_INPUT_DEFAULT = -2   /* "c normal", "c tangent", a texture's "c vector": what Blender gives
                                an unlinked socket; other inputs refuse it */
};

typedef struct trc_node_input {
    int32_t node;    /* index of an earlier node, or TRC_INPUT_* */
    uint32_t output; /* number of that node's output */
    float value[3];  /* the constant; a float input reads value[0]. An unlinked "c normal", "c
                        tangent"  or texture "c vector" input takes its default when node is -2 */
} trc_node_input;

typedef struct trc_node {
    uint32_t type; /* TRC_NODE_* */
    uint32_t mode;
    uint32_t first_input; /* into trc_material_desc.inputs */
    uint32_t input_count; /* exactly the count of the type */
    trc_id image;         /* IMAGE, ENVIRONMENT; 0 renders magenta */
    const char *name;     /* attribute name or NULL */
    const float *table;   /* COLOR_RAMP, CURVES, FLOAT_CURVE: table_count floats, else NULL */
    uint64_t table_count;
} trc_node;

typedef struct trc_material_desc {
    uint32_t struct_size;
    uint32_t node_count; /* 0: black, opaque */
    const trc_node *nodes;
    const trc_node_input *inputs;
    uint32_t input_count;
    int32_t surface;    /* index of the shader node that is the output; -1: black */
    int32_t pass_index; /* Material Index pass */
    uint32_t flags;     /* TRC_MATERIAL_* */
    float cryptomatte;  /* trc_cryptomatte_id of its name; 0: in no matte */
    uint32_t reserved;
} trc_material_desc;

enum trc_material_flags {
    /* Sample its emissive triangles as lights ("multiple importance sample"). Off: glossy rays
     * alone find them, unless some surface of the scene has diffuse or translucent lobes, which
     * only samples light. */
    TRC_MATERIAL_SAMPLE_EMISSION = 1,
    TRC_MATERIAL_TRANSPARENT_SHADOW =
        2, /* shadow rays see its transparency; else it is opaque to them */
    /* Lobes are chosen by their weights at camera hits too, as in Cycles 4; else each at least one
     * time in nine or so (Cycles 3.4). What Cycles loses with diffuse bounces 0 depends on it. */
    TRC_MATERIAL_PLAIN_CHOICE = 4
};

/* NaN or infinite constants refuse the material; out-of-range ones (roughness < 0, IOR <= 0) are
 * clamped as Cycles does. */
TRC_API trc_status trc_material_create(trc_scene scene, const trc_material_desc *desc,
                                       trc_id *material_out);
TRC_API trc_status trc_material_update(trc_scene scene, trc_id material,
                                       const trc_material_desc *desc);
/* Instances that still use it fall back to the default material. */
TRC_API trc_status trc_material_destroy(trc_scene scene, trc_id material);

enum trc_alpha_mode {
    TRC_ALPHA_STRAIGHT = 0,
    TRC_ALPHA_PREMULTIPLIED = 1,
    TRC_ALPHA_CHANNEL_PACKED = 2,
    TRC_ALPHA_NONE = 3
};

typedef struct trc_image_desc {
    uint32_t struct_size;
    uint32_t width, height; /* pixels, 1..65536, width * height <= 2^30; 0 with a path */
    uint32_t alpha_mode;    /* TRC_ALPHA_* */
    uint32_t is_srgb;     /* 1: colour values are sRGB-encoded and are linearised, 0: as they are */
    uint32_t is_float;    /* pixels are float (else uint8); ignored with a path */
    const void *pixels;   /* RGBA, bottom row first, float or uint8; NULL with a path */
    uint64_t pixel_bytes; /* size of that buffer, checked */
    const char *path;     /* file, read at once (see reader.h); NULL with pixels */
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
} trc_image_desc;

/* TRC_ERROR_IMAGE for a file that cannot be read, or colours that cannot be converted: the caller
 * may go on with image 0 (magenta). TRC_ERROR_TOO_LARGE also for a file that claims more pixels
 * than one of its size can have, TRC_ERROR_FORMAT for one in no known format. TRC_ERROR_UNSUPPORTED
 * for a path or a color_space where the reader's program is absent (a build without OpenImageIO) or
 * does not run. */
TRC_API trc_status trc_image_create(trc_scene scene, const trc_image_desc *desc, trc_id *image_out);

/* Reads the file of a descriptor ahead, beside others and beside other work: trc_image_create with
 * an equal descriptor takes it from there, before the next commit, which drops what was not taken.
 * Nothing else comes of it, and it reports no file that cannot be read. */
TRC_API trc_status trc_image_expect(trc_scene scene, const trc_image_desc *desc);

TRC_API trc_status trc_image_destroy(trc_scene scene, trc_id image);

TRC_END_DECLS

#endif
