/* Operations of material programs: what shading/compile.c emits and kernels/program/program.c runs.
 *
 * An operation reads floats and writes floats; a colour or vector is three of them. One definition
 * of each operation's meaning (kernels/program/) serves rendering at every width and, on the
 * scalar kernels, the folding of constants. */
#ifndef TRACER_MODEL_PROGRAM_H
#define TRACER_MODEL_PROGRAM_H

#include <stdbool.h>
#include <stdint.h>

#include "model/material.h"

/* Most inputs and outputs of an operation. */
#define TRC_OP_MAX_INPUTS 18
#define TRC_OP_MAX_OUTPUTS 9

/* trc_instruction.resource that names nothing: the default attribute, a missing image. */
#define TRC_NO_RESOURCE UINT32_MAX

/* Entries (RGBA) of a colour ramp's table. */
#define TRC_RAMP_SIZE 257u

/* X(name, inputs, outputs, is_pure): pure ones depend on inputs, mode and table only. Outputs are
 * three floats of a vector or colour unless the list of values says otherwise. */
#define TRC_OPS(X)                                                                          \
    /* the shading point, world space */                                                    \
    X(POSITION, 0, 3, 0)                                                                    \
    X(NORMAL, 0, 3, 0) /* shading normal */                                                 \
    X(TRUE_NORMAL, 0, 3, 0)                                                                 \
    X(INCOMING, 0, 3, 0)                                                                    \
    X(TANGENT, 0, 3, 0) /* mode: TRC_TANGENT_*; resource: name */                           \
    X(PARAMETRIC, 0, 2, 0)                                                                  \
    X(BACKFACING, 0, 1, 0)                                                                  \
    /* texture coordinates */                                                               \
    X(GENERATED, 0, 3, 0)                                                                   \
    X(OBJECT_NORMAL, 0, 3, 0)                                                               \
    X(OBJECT_POSITION, 0, 3, 0)                                                             \
    X(CAMERA_POSITION, 0, 3, 0)                                                             \
    X(WINDOW, 0, 2, 0)                                                                      \
    X(REFLECTION, 0, 3, 0)                                                                  \
    X(UV, 0, 2, 0)              /* resource: name */                                        \
    X(COLOR_ATTRIBUTE, 0, 4, 0) /* resource: name; RGBA */                                  \
    X(UV_DENSITY, 0, 1, 0)      /* resource: name; least change of UVs per metre */         \
    /* the ray and the object */                                                            \
    X(LIGHT_PATH, 0, 1, 0) /* mode: number of the Light Path node's output */               \
    X(OBJECT_LOCATION, 0, 3, 0)                                                             \
    X(OBJECT_COLOR, 0, 4, 0) /* RGBA */                                                     \
    X(OBJECT_INDEX, 0, 1, 0)                                                                \
    X(OBJECT_RANDOM, 0, 1, 0)                                                               \
    X(INSTANCE_VALUES, 0, 3, 0) /* mode: number of the first */                             \
    /* inputs and the point */                                                              \
    X(FRESNEL, 4, 1, 0)       /* ior, normal */                                             \
    X(LAYER_FRESNEL, 4, 1, 0) /* blend, normal */                                           \
    X(LAYER_FACING, 4, 1, 0)  /* blend, normal */                                           \
    X(NORMAL_MAP, 4, 3, 0)    /* strength, color; mode: space; resource: name */            \
    X(TRANSFORM, 3, 3, 0)     /* vector; mode: TRC_TRANSFORM_* */                           \
    X(WIREFRAME, 1, 1, 0)     /* size */                                                    \
    /* textures */                                                                          \
    X(IMAGE, 3, 4, 0)     /* u, v, density of these or 0; mode: TRC_IMAGE_MODE_*;           \
                             resource: image; RGBA */                                       \
    X(IMAGE_BOX, 4, 4, 0) /* vector, blend; the same */                                     \
    X(PROJECT, 3, 2, 1)   /* vector -> u, v; mode: TRC_PROJECT_* */                         \
    X(CHECKER, 10, 4, 1)  /* vector, color 1, color 2, scale -> color, factor */            \
    /* procedural textures; TRC_MODE_NO_COLOR */                                            \
    /* vector, w, octaves, roughness, lacunarity, offset, gain, distortion -> value, color; \
     * mode: dimensions - 1, TRC_FRACTAL_* << TRC_NOISE_TYPE_SHIFT */                       \
    X(NOISE, 10, 4, 1)                                                                      \
    X(WHITE_NOISE, 4, 4, 1) /* vector, w -> value, color; mode: dimensions - 1 */           \
    /* vector, w, smoothness, exponent, randomness, detail, roughness, lacunarity ->        \
     * distance, color, position, w, radius; mode: dimensions - 1, metric, feature,         \
     * TRC_VORONOI_NORMALIZE */                                                             \
    X(VORONOI, 10, 9, 1)                                                                    \
    X(GRADIENT, 3, 1, 1) /* vector; mode: TRC_GRADIENT_* */                                 \
    X(WAVE, 8, 1, 1)     /* vector, distortion, detail scale, octaves, roughness, phase */  \
    X(MAGIC, 5, 3, 1)    /* vector, scale, distortion; mode: depth */                       \
    /* vector, mortar size, mortar smoothness, bias, brick width, row height, offset,       \
     * squash -> shade, mortar */                                                           \
    X(BRICK, 10, 2, 1)                                                                      \
    /* floats */                                                                            \
    X(MATH, 3, 1, 1)  /* mode: TRC_MATH_* */                                                \
    X(CLAMP, 3, 1, 1) /* value, min, max; mode 1: min and max in either order */            \
    X(MAP_RANGE, 5, 1, 1)                                                                   \
    /* vectors */                                                                           \
    X(VECTOR_MATH, 10, 3, 1)   /* a, b, c, scale; mode: TRC_VECTOR_* that give a vector */  \
    X(VECTOR_MEASURE, 6, 1, 1) /* a, b; mode: TRC_VECTOR_DOT, DISTANCE, LENGTH */           \
    X(ROTATION, 3, 9, 1)       /* Euler angles XYZ -> rows of the matrix */                 \
    X(MAPPING, 18, 3, 1)       /* vector, location, scale, rows; mode as the node's */      \
    X(AXIS_ROTATION, 4, 9, 1)  /* axis, angle -> rows of the matrix */                      \
    X(CURVE, 3, 1, 1)          /* value, low, high; resource: first float in tables;        \
                                  mode: channel, TRC_CURVE_EXTRAPOLATE */                   \
    /* colours */                                                                           \
    X(MIX, 7, 3, 1)             /* factor, a, b; mode: TRC_BLEND_* */                       \
    X(SATURATE, 3, 3, 1)        /* each to [0, 1] */                                        \
    X(LUMINANCE, 3, 1, 1)       /* colour to float */                                       \
    X(AVERAGE, 3, 1, 1)         /* vector to float */                                       \
    X(INVERT, 4, 3, 1)          /* factor, color */                                         \
    X(GAMMA, 4, 3, 1)           /* color, gamma */                                          \
    X(HUE_SATURATION, 7, 3, 1)  /* hue, saturation, value, factor, color */                 \
    X(BRIGHT_CONTRAST, 5, 3, 1) /* color, bright, contrast */                               \
    X(RAMP, 1, 4, 1)            /* resource: first float in tables; mode 1: steps; RGBA */  \
    X(BLACKBODY, 1, 3, 1)       /* kelvin */                                                \
    X(WAVELENGTH, 1, 3, 1)      /* nanometres */                                            \
    X(SEPARATE, 3, 3, 1)        /* mode: TRC_SEPARATE_HSV, HSL */                           \
    X(COMBINE, 3, 3, 1)

enum trc_op {
#define TRC_OP_ENTRY(name, inputs, outputs, is_pure) TRC_OP_##name,
    TRC_OPS(TRC_OP_ENTRY)
#undef TRC_OP_ENTRY
        TRC_OP_COUNT
};

/* TRC_OP_IMAGE: interpolation in bits 0-1 and extension in bits 2-3 as in the public header, and:
 */
#define TRC_IMAGE_MODE_INTERPOLATION 3u
#define TRC_IMAGE_MODE_EXTENSION (3u << 2)
#define TRC_IMAGE_MODE_ALPHA (1u << 4) /* the alpha is used too: colours are divided by it */

enum { TRC_PROJECT_EQUIRECTANGULAR, TRC_PROJECT_MIRROR_BALL, TRC_PROJECT_SPHERE, TRC_PROJECT_TUBE };

/* TRC_OP_CURVE: straight on beyond the ends of the table. */
#define TRC_CURVE_EXTRAPOLATE 4u

/* Modes of TRC_OP_TRANSFORM; points are moved too, vectors only turned and scaled. */
enum {
    TRC_TRANSFORM_OBJECT_TO_WORLD,
    TRC_TRANSFORM_WORLD_TO_OBJECT,
    TRC_TRANSFORM_WORLD_TO_CAMERA,
    TRC_TRANSFORM_CAMERA_TO_WORLD,
    TRC_TRANSFORM_POINT = 4, /* bit */
    TRC_TRANSFORM_NORMAL = 8 /* bit: by the inverse transpose, unit; between world and object */
};

/* Set where nothing reads the colour of an operation whose colour costs extra. */
#define TRC_MODE_NO_COLOR (1u << 15)

/* A last octave counts by the fraction. */
#define TRC_MAX_OCTAVES 16.0f

/* Modes of the Separate and Combine nodes; the first and the last need no operation. */
enum { TRC_SEPARATE_RGB, TRC_SEPARATE_HSV, TRC_SEPARATE_HSL, TRC_SEPARATE_XYZ };

/* Outputs of TRC_NODE_LIGHT_PATH. */
enum {
    TRC_PATH_IS_CAMERA,
    TRC_PATH_IS_SHADOW,
    TRC_PATH_IS_DIFFUSE,
    TRC_PATH_IS_GLOSSY,
    TRC_PATH_IS_SINGULAR,
    TRC_PATH_IS_REFLECTION,
    TRC_PATH_IS_TRANSMISSION,
    TRC_PATH_RAY_LENGTH,
    TRC_PATH_DEPTH,
    TRC_PATH_DIFFUSE_DEPTH,
    TRC_PATH_GLOSSY_DEPTH,
    TRC_PATH_TRANSPARENT_DEPTH,
    TRC_PATH_TRANSMISSION_DEPTH,
    TRC_PATH_OUTPUTS
};

/* Whether the resource of an operation is a table. */
static inline bool trc_op_has_table(uint32_t op) { return op == TRC_OP_RAMP || op == TRC_OP_CURVE; }

#endif
