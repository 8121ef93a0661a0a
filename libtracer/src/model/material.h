/* A compiled material: a list of shader leaves and the program that computes their inputs.
 *
 * Compiled by shading/compile.c from the public node list: mix and add shaders become weights of
 * leaves, constants are folded, equal nodes merged, unreached ones dropped. An input is an operand:
 * a constant, or a register of the program. A material of constants has no program. */
#ifndef TRACER_MODEL_MATERIAL_H
#define TRACER_MODEL_MATERIAL_H

#include <stdatomic.h>
#include <stdint.h>

#include "tracer/tracer.h"

#define TRC_MAX_LEAVES 64 /* as many as Cycles has closures */
#define TRC_MAX_REGISTERS 1024

/* Lobes whose mean weight is below it are dropped, lane by lane (Cycles' closure cut-off). */
#define TRC_WEIGHT_CUTOFF 1e-5f
/* Microfacets whose alpha_x * alpha_y is at or below it are ideal (Cycles 3.4 uses the same bound).
 */
#define TRC_SINGULAR_ALPHA2 1e-7f

/* trc_operand.reg besides registers. */
enum {
    TRC_REG_CONSTANT = -1,
    TRC_REG_DEFAULT = -2 /* unlinked normal, tangent or vector: the default of its place */
};

/* One float: a constant, or what the program left in a register. */
struct trc_operand {
    int32_t reg; /* or TRC_REG_* */
    float value;
};

/* One shader node that the output reaches, with the factor of the mix nodes above it. */
struct trc_leaf {
    uint32_t type;             /* TRC_NODE_DIFFUSE ... TRC_NODE_PRINCIPLED */
    uint32_t mode;             /* distribution */
    struct trc_operand weight; /* product of mix factors, [0, 1] or more for added shaders */
    uint32_t first_operand;    /* the node's inputs in order, 3 operands for a colour or vector */
    uint32_t operand_count;
};

/* A value besides the surface that a pass shows. */
#define TRC_MAX_AOV_OUTPUTS 32
struct trc_aov_output {
    uint32_t pass;          /* TRC_PASS_AOV_* */
    uint32_t first_operand; /* one for a value, three for a colour */
};

/* One step of a program on registers of TRC_WIDTH floats. Opcodes and their meaning of fields are
 * private to shading/compile.c and kernels/program/program.c (model/program.h). */
struct trc_instruction {
    uint16_t op;
    uint16_t mode;
    uint16_t out; /* first register written */
    uint16_t input_count;
    uint32_t first_input; /* into operands */
    uint32_t resource;    /* image, attribute name or table offset */
};

/* What the leaves may do, over all values of their inputs: decides code paths and features. */
enum {
    TRC_MATERIAL_HAS_DIFFUSE = 1 << 0,
    TRC_MATERIAL_HAS_SPECULAR = 1 << 1, /* ideal lobes */
    TRC_MATERIAL_HAS_GLOSSY = 1 << 2,   /* rough lobes */
    TRC_MATERIAL_HAS_REFRACTION = 1 << 3,
    TRC_MATERIAL_HAS_TRANSPARENCY = 1 << 4, /* transparent leaf or alpha below 1 */
    TRC_MATERIAL_HAS_EMISSION = 1 << 5,
    TRC_MATERIAL_HAS_PROGRAM = 1 << 6,
    TRC_MATERIAL_HAS_TEXTURE = 1 << 7,
    TRC_MATERIAL_HAS_TRANSLUCENT = 1 << 8,
    TRC_MATERIAL_HAS_HOLDOUT = 1 << 9,
    TRC_MATERIAL_EMISSION_VARIES = 1 << 10, /* emission depends on the program */
    TRC_MATERIAL_READS_LIGHT_PATH = 1 << 11,
    TRC_MATERIAL_READS_FOOTPRINT = 1 << 12, /* an image has smaller levels */
    TRC_MATERIAL_READS_PIXEL = 1 << 13,     /* it has slopes of heights, or strands across pixels */
    TRC_MATERIAL_HAS_PORTAL = 1 << 14,      /* rays go on elsewhere; shadow rays end */
    TRC_MATERIAL_TRACES_RAYS = 1 << 15,     /* its program does */
    TRC_MATERIAL_LIT_BELOW = 1 << 16,       /* light is sampled on both sides of the surface */
    TRC_MATERIAL_CLEARS_SHADOWS = 1 << 17,  /* it is transparent to shadow rays, too */
    TRC_MATERIAL_READS_LOBES = 1 << 18,     /* Light Path tells it what lobes rays come from */
    /* Lobes that no ray is continued for: only samples of lights bring them light. */
    TRC_MATERIAL_IS_MATT = TRC_MATERIAL_HAS_DIFFUSE | TRC_MATERIAL_HAS_TRANSLUCENT,
    /* All lobes that light samples light. */
    TRC_MATERIAL_SCATTERS = TRC_MATERIAL_IS_MATT | TRC_MATERIAL_HAS_GLOSSY
};

struct trc_material {
    atomic_uint refs;
    uint32_t has;   /* TRC_MATERIAL_HAS_* */
    uint32_t flags; /* TRC_MATERIAL_* of the public header */
    int32_t pass_index;
    float cryptomatte;     /* id of its name */
    uint32_t branch_count; /* rays that a hit sends on at most, if all lobes are followed */
    uint32_t leaf_count, operand_count, instruction_count, register_count, table_count;
    struct trc_leaf leaves[TRC_MAX_LEAVES];
    uint32_t aov_count;
    struct trc_aov_output *aovs; /* NULL: none */
    struct trc_operand *operands;
    struct trc_instruction *instructions;
    float *tables;
    bool has_film_colors;
    float film_colors[9]; /* of trc_material_desc */
    float emission[3];    /* constant emission; a mean estimate when it varies */
    /* Of a material that moves vertices, else NULL: has no leaves, but an AOV that is how far. */
    struct trc_material *displacement;
    uint32_t keeps_normals; /* 1: normals of moved vertices stay */
    /* What shadow rays need to know of a material that lets them through: its transparent leaves
     * and the part of its program that these read. NULL: the material itself says it. */
    struct trc_material *shadow;
};

/* Whether rays of lobes that look for light may pass it: what is not transparent to shadows hides
 * lights from their samples alone. */
static inline uint8_t trc_material_is_clear(const struct trc_material *m) {
    return (m->has & TRC_MATERIAL_CLEARS_SHADOWS) != 0;
}

/* Whether shadow rays may, too. */
static inline uint8_t trc_material_shadows_transparent(const struct trc_material *m) {
    return trc_material_is_clear(m) && (m->flags & TRC_MATERIAL_TRANSPARENT_SHADOW);
}

#endif
