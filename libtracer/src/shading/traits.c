/* What a material may do over all values of its inputs, and what it emits. */
#include <math.h>
#include <string.h>

#include "shading/build.h"

/* Some more than rounding may cost, so that a flag is never missing. */
#define MARGIN 1.001f

/* What is taken for a colour or a strength that a program computes, in the mean estimate. */
#define GUESSED_COLOR 0.5f
#define GUESSED_STRENGTH 1.0f

/* ---- values an operand may have ---- */

static bool may_exceed(struct trc_operand o, float limit) {
    return !trc_is_constant(o) || !(o.value <= limit);
}
static bool may_be_below(struct trc_operand o, float limit) {
    return !trc_is_constant(o) || !(o.value >= limit);
}

static bool is_constant3(const struct trc_operand *o) {
    return trc_is_constant(o[0]) && trc_is_constant(o[1]) && trc_is_constant(o[2]);
}

/* Whether an output of Light Path is another to light by different lobes, or to samples of it. */
static bool tells_lobes(uint32_t output) {
    return output == TRC_OUTPUT_OF(LIGHT_PATH, is_diffuse) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, is_glossy) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, is_reflection) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, is_transmission) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, ray_depth) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, diffuse_depth) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, glossy_depth) ||
           output == TRC_OUTPUT_OF(LIGHT_PATH, transmission_depth);
}

/* ---- microfacets ---- */

/* Ideal, rough or both, for roughness between low and high; alpha is its square. */
static uint32_t roughness_bits(float low, float high) {
    uint32_t has = 0;
    const float l2 = low * low, h2 = high * high;
    if (!(l2 * l2 > TRC_SINGULAR_ALPHA2 * MARGIN))
        has |= TRC_MATERIAL_HAS_SPECULAR;
    if (!(h2 * h2 * MARGIN <= TRC_SINGULAR_ALPHA2))
        has |= TRC_MATERIAL_HAS_GLOSSY;
    return has;
}

static uint32_t microfacet_bits(uint32_t distribution, struct trc_operand roughness) {
    if ((distribution & ~(uint32_t)TRC_DISTRIBUTION_CORRELATED) == TRC_DISTRIBUTION_SHARP)
        return TRC_MATERIAL_HAS_SPECULAR;
    if (!trc_is_constant(roughness))
        return roughness_bits(0.0f, INFINITY);
    const float r = fabsf(roughness.value); /* its square counts */
    return roughness_bits(r, r);
}

/* Refraction of the Principled shader: roughness and its own add up, with the GGX distribution. */
static uint32_t transmission_bits(uint32_t distribution, struct trc_operand roughness,
                                  struct trc_operand own) {
    const uint32_t reflected = microfacet_bits(distribution, roughness);
    if (distribution != TRC_DISTRIBUTION_GGX)
        return reflected;
    if (!trc_is_constant(own) || !trc_is_constant(roughness)) {
        return TRC_MATERIAL_HAS_SPECULAR | TRC_MATERIAL_HAS_GLOSSY;
    }
    const float sum = 1.0f - (1.0f - roughness.value) * (1.0f - own.value);
    return reflected | roughness_bits(fabsf(sum), fabsf(sum));
}

/* ---- leaves ---- */

static uint32_t principled_bits(uint32_t distribution, const struct trc_operand *in) {
    const struct trc_operand metallic = in[TRC_AT(PRINCIPLED, metallic)];
    const struct trc_operand transmission = in[TRC_AT(PRINCIPLED, transmission)];
    const struct trc_operand roughness = in[TRC_AT(PRINCIPLED, roughness)];
    const struct trc_operand alpha = in[TRC_AT(PRINCIPLED, alpha)];
    uint32_t has = may_be_below(alpha, 1.0f) ? TRC_MATERIAL_HAS_TRANSPARENCY : 0u;
    if (!may_exceed(alpha, 0.0f))
        return has;
    const bool not_metal = may_be_below(metallic, 1.0f),
               not_glass = may_be_below(transmission, 1.0f);
    if (not_metal && not_glass)
        has |= TRC_MATERIAL_HAS_DIFFUSE;
    if ((not_glass || may_exceed(metallic, 0.0f)) &&
        (may_exceed(in[TRC_AT(PRINCIPLED, specular)], TRC_WEIGHT_CUTOFF) ||
         may_exceed(metallic, TRC_WEIGHT_CUTOFF))) {
        has |= microfacet_bits(distribution, roughness);
    }
    if (not_metal && may_exceed(transmission, TRC_WEIGHT_CUTOFF)) {
        has |= TRC_MATERIAL_HAS_REFRACTION |
               transmission_bits(distribution, roughness,
                                 in[TRC_AT(PRINCIPLED, transmission_roughness)]);
    }
    if (may_exceed(in[TRC_AT(PRINCIPLED, clearcoat)], TRC_WEIGHT_CUTOFF)) {
        has |= microfacet_bits(TRC_DISTRIBUTION_GGX, in[TRC_AT(PRINCIPLED, clearcoat_roughness)]);
    }
    return has;
}

static uint32_t layered_principled_bits(uint32_t mode, const struct trc_operand *in) {
    const struct trc_operand metallic = in[TRC_AT(LAYERED_PRINCIPLED, metallic)];
    const struct trc_operand transmission = in[TRC_AT(LAYERED_PRINCIPLED, transmission_weight)];
    const struct trc_operand alpha = in[TRC_AT(LAYERED_PRINCIPLED, alpha)];
    uint32_t has = may_be_below(alpha, 1.0f) ? TRC_MATERIAL_HAS_TRANSPARENCY : 0u;
    if (!may_exceed(alpha, 0.0f))
        return has;
    has |= microfacet_bits(mode, in[TRC_AT(LAYERED_PRINCIPLED, roughness)]);
    if (may_be_below(metallic, 1.0f) && may_be_below(transmission, 1.0f))
        has |= TRC_MATERIAL_HAS_DIFFUSE;
    if (may_be_below(metallic, 1.0f) && may_exceed(transmission, TRC_WEIGHT_CUTOFF))
        has |= TRC_MATERIAL_HAS_REFRACTION |
               (mode & TRC_DISTRIBUTION_THIN_WALL ? TRC_MATERIAL_HAS_TRANSPARENCY : 0u);
    if (may_exceed(in[TRC_AT(LAYERED_PRINCIPLED, coat_weight)], TRC_WEIGHT_CUTOFF))
        has |=
            microfacet_bits(TRC_DISTRIBUTION_GGX, in[TRC_AT(LAYERED_PRINCIPLED, coat_roughness)]);
    if (may_exceed(in[TRC_AT(LAYERED_PRINCIPLED, sheen_weight)], TRC_WEIGHT_CUTOFF))
        has |= TRC_MATERIAL_HAS_DIFFUSE;
    return has;
}

/* Elliptic strands are clear where a ray passes them, but for shadow rays; how much a pixel sees of
 * their width counts. */
static uint32_t huang_hair_bits(const struct trc_operand *in) {
    const struct trc_operand aspect = in[TRC_AT(HUANG_HAIR, aspect_ratio)];
    const bool is_round = trc_is_constant(aspect) && aspect.value == 1.0f;
    return TRC_MATERIAL_HAS_GLOSSY | TRC_MATERIAL_HAS_REFRACTION | TRC_MATERIAL_READS_PIXEL |
           (is_round ? 0u : TRC_MATERIAL_HAS_TRANSPARENCY);
}

static uint32_t leaf_bits(const struct trc_leaf *leaf, const struct trc_operand *in) {
    switch (leaf->type) {
#define TRC_CLOSURE(NAME, lobes, branches) \
    case TRC_NODE_##NAME:                  \
        return lobes;
#include "tracer/nodes.def"
    default:
        return 0;
    }
}

/* Fibres that reflect send rays below the surface, too, where a light tree has no lights for them.
 */
static bool is_lit_below(const struct trc_leaf *leaf, uint32_t has, uint32_t flags) {
    if (leaf->type == TRC_NODE_HAIR && leaf->mode == TRC_HAIR_REFLECTION)
        return !(flags & TRC_MATERIAL_LIGHT_TREE);
    return has & (TRC_MATERIAL_HAS_REFRACTION | TRC_MATERIAL_HAS_TRANSLUCENT);
}

/* Glass is two lobes that rays are continued for. */
static uint32_t principled_branches(const struct trc_operand *in) {
    const uint32_t reflection = 1;
    return reflection + (may_exceed(in[TRC_AT(PRINCIPLED, transmission)], 0.0f) ? 2 : 0) +
           (may_exceed(in[TRC_AT(PRINCIPLED, clearcoat)], 0.0f) ? 1 : 0);
}

static uint32_t layered_principled_branches(const struct trc_operand *in) {
    const uint32_t reflection = 1;
    return reflection + (may_exceed(in[TRC_AT(LAYERED_PRINCIPLED, metallic)], 0.0f) ? 1 : 0) +
           (may_exceed(in[TRC_AT(LAYERED_PRINCIPLED, transmission_weight)], 0.0f) ? 2 : 0) +
           (may_exceed(in[TRC_AT(LAYERED_PRINCIPLED, coat_weight)], 0.0f) ? 1 : 0);
}

static uint32_t leaf_branches(const struct trc_leaf *leaf, const struct trc_operand *in) {
    switch (leaf->type) {
#define TRC_CLOSURE(NAME, lobes, branches) \
    case TRC_NODE_##NAME:                  \
        return branches;
#include "tracer/nodes.def"
    default:
        return 0;
    }
}

/* ---- emission ---- */

/* Colour, strength and the factor above them of a leaf that emits, in operands. */
struct emitter {
    const struct trc_operand *color;
    struct trc_operand strength, alpha;
};

/* False: the leaf emits nothing, whatever its inputs. */
static bool emitter_of(const struct trc_leaf *leaf, const struct trc_operand *in,
                       struct emitter *out) {
    if (leaf->type == TRC_NODE_EMISSION) {
        *out = (struct emitter){in + TRC_AT(EMISSION, color), in[TRC_AT(EMISSION, strength)],
                                trc_constant(1.0f)};
    } else if (leaf->type == TRC_NODE_BACKGROUND) {
        *out = (struct emitter){in + TRC_AT(BACKGROUND, color), in[TRC_AT(BACKGROUND, strength)],
                                trc_constant(1.0f)};
    } else if (leaf->type == TRC_NODE_PRINCIPLED) {
        *out = (struct emitter){in + TRC_AT(PRINCIPLED, emission),
                                in[TRC_AT(PRINCIPLED, emission_strength)],
                                in[TRC_AT(PRINCIPLED, alpha)]};
    } else if (leaf->type == TRC_NODE_LAYERED_PRINCIPLED) {
        *out = (struct emitter){in + TRC_AT(LAYERED_PRINCIPLED, emission_color),
                                in[TRC_AT(LAYERED_PRINCIPLED, emission_strength)],
                                in[TRC_AT(LAYERED_PRINCIPLED, alpha)]};
    } else {
        return false;
    }
    const struct trc_operand *c = out->color;
    const bool is_black =
        trc_is_value(c[0], 0.0f) && trc_is_value(c[1], 0.0f) && trc_is_value(c[2], 0.0f);
    return !is_black && !trc_is_value(out->strength, 0.0f) && may_exceed(out->alpha, 0.0f);
}

static float clamped_alpha(struct trc_operand o) {
    if (!trc_is_constant(o))
        return 1.0f;
    return fminf(fmaxf(o.value, 0.0f), 1.0f);
}

static void add_emission(const struct trc_leaf *leaf, const struct trc_operand *in,
                         struct trc_material *m) {
    struct emitter e;
    if (!emitter_of(leaf, in, &e))
        return;
    m->has |= TRC_MATERIAL_HAS_EMISSION;
    if (!is_constant3(e.color) || !trc_is_constant(e.strength) || !trc_is_constant(e.alpha) ||
        !trc_is_constant(leaf->weight)) {
        m->has |= TRC_MATERIAL_EMISSION_VARIES;
    }
    const float strength = trc_is_constant(e.strength) ? e.strength.value : GUESSED_STRENGTH;
    const float weight = trc_is_constant(leaf->weight) ? leaf->weight.value : GUESSED_COLOR;
    for (int c = 0; c < 3; c++) {
        const float color = trc_is_constant(e.color[c]) ? e.color[c].value : GUESSED_COLOR;
        m->emission[c] += weight * (color * strength * clamped_alpha(e.alpha));
    }
}

void trc_build_traits(const struct trc_build *b, struct trc_material *m) {
    for (uint32_t i = 0; i < b->leaf_count; i++) {
        const struct trc_leaf *leaf = &b->leaves[i];
        const struct trc_operand *in = b->leaf_operands + leaf->first_operand;
        const uint32_t has = leaf_bits(leaf, in);
        m->has |= has | (is_lit_below(leaf, has, m->flags) ? TRC_MATERIAL_LIT_BELOW : 0u);
        if ((has & TRC_MATERIAL_HAS_TRANSPARENCY) && leaf->type != TRC_NODE_HUANG_HAIR)
            m->has |= TRC_MATERIAL_CLEARS_SHADOWS;
        m->branch_count += leaf_branches(leaf, in);
        add_emission(leaf, in, m);
    }
    if (m->flags & TRC_MATERIAL_CUTS_OUT) {
        m->has = TRC_MATERIAL_HAS_HOLDOUT |
                 (m->has & (TRC_MATERIAL_HAS_TRANSPARENCY | TRC_MATERIAL_CLEARS_SHADOWS));
        m->branch_count = 0;
        memset(m->emission, 0, sizeof m->emission);
    }
    if (m->has & TRC_MATERIAL_HAS_TRANSPARENCY)
        m->branch_count++; /* all of it is one lobe */
    for (uint32_t i = 0; i < b->op_count; i++) {
        const struct trc_build_op *o = &b->ops[i];
        if (!o->is_live)
            continue;
        m->has |= TRC_MATERIAL_HAS_PROGRAM;
        if (o->op == TRC_OP_IMAGE || o->op == TRC_OP_IMAGE_BOX)
            m->has |= TRC_MATERIAL_HAS_TEXTURE;
        if (o->op == TRC_OP_UV_DENSITY)
            m->has |= TRC_MATERIAL_READS_FOOTPRINT;
        if (o->op == TRC_OP_BUMP || (o->op == TRC_OP_WIREFRAME && (o->mode & TRC_WIREFRAME_PIXELS)))
            m->has |= TRC_MATERIAL_READS_PIXEL;
        if (o->op == TRC_OP_AMBIENT_OCCLUSION || o->op == TRC_OP_BEVEL || o->op == TRC_OP_RAYCAST ||
            o->op == TRC_OP_RAYCAST_ATTRIBUTE)
            m->has |= TRC_MATERIAL_TRACES_RAYS;
        if (o->op == TRC_OP_LIGHT_PATH)
            m->has |=
                TRC_MATERIAL_READS_LIGHT_PATH | (tells_lobes(o->mode) * TRC_MATERIAL_READS_LOBES);
    }
}
