/* What the files of lobes share.
 *
 * A closure is a shader node: it adds lobes for its leaf of a material. All that is known of a lobe
 * stands in one file: how it is set up, its value, its densities, its directions. A new one is a
 * TRC_CLOSURE of tracer/nodes.def and a file here. */
#ifndef TRACER_KERNELS_LOBE_LOBE_H
#define TRACER_KERNELS_LOBE_LOBE_H

#include "kernels/lobe/bsdf.h"
#include "kernels/simd/wide_math.h"
#include "model/nodes.h"

/* ---- what a lobe does ---- */

/* Value times cosine, and three densities: of the directions sampled here; of Cycles' sampling; and
 * the one that Cycles weights it with. */
struct lobe_value {
    vvec3 value;
    vfloat pdf, pick, claim;
};

TRC_INLINE struct lobe_value no_value(void) {
    return (struct lobe_value){v3_zero(), vf_zero(), vf_zero(), vf_zero()};
}

/* The value in the lanes of m, nothing in the others. */
TRC_INLINE struct lobe_value value_where(vmask m, struct lobe_value r) {
    return (struct lobe_value){v3_where(m, r.value), vf_where(m, r.pdf), vf_where(m, r.pick),
                               vf_where(m, r.claim)};
}

/* The numbers that a direction was sampled by, as trc_lobe_model.direction has them. */
struct trc_draw {
    vfloat u1, u2, chosen_at;
};

/* The functions of a lobe. Those of the lanes of a group are the same. */
struct trc_lobe_model {
    enum trc_lobe_kind kind;
    bool has_facets; /* its alpha says how rough it is */
    bool is_strand;  /* denoisers go by its tangent, not its normal */
    /* What the passes of normals have for n. NULL: n. */
    vvec3 (*normal)(const struct trc_lobe *lobe, vvec3 wo);
    /* The part of its weight that denoisers take for its albedo; of lobes without a Fresnel factor.
     * NULL: all. */
    vfloat (*mean)(const struct trc_lobe *lobe);
    /* Of TRC_LOBE_TRANSPARENT: the ray goes on from f0, in the direction f90, which is unit. */
    bool is_portal;
    /* Towards wi; lanes of the wrong side are dropped by the caller. NULL: straight through. */
    struct lobe_value (*value)(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi);
    /* The same of a direction that this lobe has sampled by those numbers, of hair alone; asked for
     * where trc_lobes.rare is not 0. NULL: no other. */
    struct lobe_value (*sampled)(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                                 const struct trc_draw *draw);
    /* A direction of the lobe's density, of those that rays are continued for and that are not
     * always ideal. chosen_at, evenly below its sample_weight, decides between paired lobes. Lanes
     * leave *alive where total reflection leaves none, or where it is on the wrong side: other
     * lobes may have a density there, but it was not theirs that was sampled. *crosses: lanes that
     * are transmitted; before, those in which the lobe's twin was chosen, whose direction it is. */
    vvec3 (*direction)(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses);
};

/* What multiplies the weight at a micro-normal; see the fields of trc_lobe. */
struct trc_fresnel {
    uint32_t kind;
    vvec3 (*reflectance)(const struct trc_lobe *lobe, vfloat cos_m);
    const float *film_colors;
    vvec3 f0, f90;
};

/* ---- from leaves to lobes ---- */

struct trc_setup {
    const struct trc_material *material;
    const struct trc_surface *s;
    const struct trc_registers *regs;
    vfloat filter_alpha;
    vvec3 default_n; /* s->n made valid; set once asked for */
    bool has_default_n;
    struct trc_lobes *out;
};

/* Inputs of a leaf are numbered in floats from its first operand. */
TRC_INLINE const struct trc_operand *input(const struct trc_setup *c, const struct trc_leaf *leaf,
                                           uint32_t at) {
    return c->material->operands + leaf->first_operand + at;
}
TRC_INLINE vfloat number(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return trc_operand_value(input(c, leaf, at), c->regs);
}
TRC_INLINE vvec3 colour(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return trc_operand_vec3(input(c, leaf, at), c->regs);
}
TRC_INLINE bool is_unlinked(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    return input(c, leaf, at)->reg == TRC_REG_DEFAULT;
}

/* Whether an input can exceed 0. */
TRC_INLINE bool may_exceed_zero(const struct trc_setup *c, const struct trc_leaf *leaf,
                                uint32_t at) {
    const struct trc_operand *o = input(c, leaf, at);
    return o->reg >= 0 || o->value > 0.0f;
}

/* What a shader node is to a material. */
struct trc_closure {
    /* Adds the lobes of a leaf, times weight. NULL: it has none. */
    void (*add)(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight);
    /* False if the leaf cannot emit. Without a surface, for samples of lights, the layers above an
     * emission are left out, as in Cycles. NULL: it emits nothing. */
    bool (*emission)(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                     vvec3 *emission);
};

/* Where the closure of a node is defined, and where it is used. */
#define TRC_CLOSURE_OF(NODE) TRC_KERNEL(trc_closure_##NODE)
#define TRC_CLOSURE(NAME, lobes, branches) extern const struct trc_closure TRC_CLOSURE_OF(NAME);
#include "tracer/nodes.def"

/* ---- kernels/lobe/setup.c ---- */

/* A lobe of weight in the lanes where it matters, or NULL where it matters in none. */
struct trc_lobe *trc_add_lobe(struct trc_setup *c, const struct trc_lobe_model *model,
                              vvec3 weight);

/* The normal of an input, turned so that the mirror direction is above the surface. */
vvec3 trc_leaf_normal(struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at);
/* The same for a lobe without microfacets, which may take it as it is. */
vvec3 trc_matt_normal(struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at);
/* That of facets, of an input that is not linked. */
vvec3 trc_default_normal(struct trc_setup *c);

/* The tangent of an anisotropic leaf, turned about n by rotation (in turns), then orthogonal to n.
 */
vvec3 trc_leaf_tangent(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at, vvec3 n,
                       vfloat rotation);

/* ---- lobes that several closures add; NULL as trc_add_lobe ---- */

/* kernels/lobe/diffuse.c */
struct trc_lobe *trc_add_matt(struct trc_setup *c, const struct trc_lobe_model *model, vvec3 weight,
                              vvec3 n, vfloat roughness);
void trc_add_lambert(struct trc_setup *c, vvec3 weight, vvec3 n);
/* Rough diffuse that keeps its energy; albedo: the colour of what scatters more than once. */
void trc_add_energy_oren_nayar(struct trc_setup *c, vvec3 weight, vvec3 albedo, vvec3 n,
                               vfloat sigma);
/* Principled's of Blender 3.4. */
void trc_add_burley(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness);

/* kernels/lobe/sheen.c */
void trc_add_schlick_sheen(struct trc_setup *c, vvec3 weight, vvec3 n);
/* Returns the albedo over the weight. */
vfloat trc_add_fibres(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness);
/* The same of a weight of 1, at the cosine x to the normal and the roughness y. */
vfloat trc_fibres_albedo(vfloat x, vfloat y);

/* kernels/lobe/transparent.c */
void trc_add_transparent(struct trc_setup *c, vvec3 weight);

/* kernels/lobe/reflection.c: of GGX until its distribution is set; without Fresnel's factor. */
struct trc_lobe *trc_add_reflection(struct trc_setup *c, vvec3 weight);

/* kernels/lobe/ashikhmin.c */
struct trc_lobe *trc_add_ashikhmin(struct trc_setup *c, vvec3 weight);

/* kernels/lobe/clearcoat.c; coat: its strength. */
void trc_add_clearcoat(struct trc_setup *c, vvec3 weight, vvec3 n, vfloat roughness, vfloat coat);

/* kernels/lobe/thin_film.c */

/* Nanometres up to which a film is none. */
#define TRC_MIN_THIN_FILM 0.1f
/* And from which its waves interfere in full, in Blender 4 and 5. */
#define TRC_WHOLE_FILM_4 30.0f
#define TRC_WHOLE_FILM_5 1.0f
/* Puts the film of a leaf, if there is one, on a dielectric whose fresnel goes from f0 to white.
 * at: the input that is its thickness, its index is the next; above: index of what it is seen from;
 * whole: one of those above. Returns the lanes that have a film. */
vmask trc_thin_film_cover(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                          vfloat above, float whole, struct trc_fresnel *fresnel);
/* The same on a lobe of metal, whose fresnel is that of trc_metal_fresnel. */
vmask trc_thin_film_cover_metal(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                                float whole, struct trc_lobe *lobe);

/* kernels/lobe/glass.c */

/* Index seen from the side of wo. */
vfloat trc_relative_ior(const struct trc_setup *c, vfloat ior);
/* Of what is on the side of wo. */
vfloat trc_ior_above(const struct trc_setup *c, vfloat ior);
/* Of a Fresnel factor what is reflected: the part of a lobe too light to be kept goes to the other.
 */
vfloat trc_reflected_part(vfloat f);
/* One of the two lobes of glass. */
struct trc_lobe *trc_add_dielectric(struct trc_setup *c, enum trc_lobe_kind kind, vvec3 weight,
                                    vvec3 n, vfloat alpha, vfloat eta, uint32_t mode);
/* kernels/lobe/thin_glass.c: glass without thickness. Its index; the weights of both sides; tint:
 * of bounces between facets. */
struct trc_thin_glass {
    vvec3 reflected, transmitted, tint, n;
    vfloat alpha, ior;
};
void trc_add_thin_glass(struct trc_setup *c, const struct trc_thin_glass *glass);

/* Multiple-scattering glass: both lobes with the factor of the micro-normal, scaled so that they
 * keep all energy together. reflected, refracted: colours of the lobes; albedo: that of passes. */
void trc_add_multi_glass(struct trc_setup *c, vvec3 weight, vvec3 reflected, vvec3 refracted,
                         vvec3 albedo, vvec3 n, vfloat alpha, vfloat eta);
/* Glass of Cycles 4: both lobes with the factor of the micro-normal. reflected, refracted: their
 * colours. */
void trc_add_correlated_glass(struct trc_setup *c, vvec3 weight, vvec3 reflected, vvec3 refracted,
                              const struct trc_fresnel *fresnel, vvec3 n, vfloat alpha, vfloat eta,
                              uint32_t mode);

#endif
