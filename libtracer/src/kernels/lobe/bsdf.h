/* Lobes of a shading point: set up from a material's leaves, evaluated, sampled. TRC_WIDTH points
 * at once, all of one material, so the kinds of lobes are uniform and their parameters are not.
 *
 * The formulas are those of Cycles in Blender 3.4, and of 4.3 for the nodes and modes that stand
 * for it; where a lobe departs from it, its file says so. */
#ifndef TRACER_KERNELS_LOBE_BSDF_H
#define TRACER_KERNELS_LOBE_BSDF_H

#include "kernels/program/program.h"
#include "kernels/simd/simd.h"

#define TRC_MAX_LOBES 64

/* Which side and which passes a lobe's light belongs to, and whether rays are continued for it. */
enum trc_lobe_kind {
    TRC_LOBE_DIFFUSE, /* ends here: its light is all in light samples */
    TRC_LOBE_VELVET,  /* ends here, too; glossy in passes and for light visibility, as in Cycles */
    TRC_LOBE_REFLECT, /* microfacet reflection or ideal mirror; the last that reflects alone */
    TRC_LOBE_TRANSLUCENT, /* counts as diffuse in passes and for light visibility, as in Cycles */
    TRC_LOBE_REFRACT,     /* microfacet refraction or ideal */
    TRC_LOBE_TRANSPARENT, /* straight through, or through a portal: the same path */
    /* Of fibres, from and to all around, in the passes of reflection and of transmission. */
    TRC_LOBE_HAIR_REFLECT,
    TRC_LOBE_HAIR_TRANSMIT
};

/* trc_lobe.distribution, of microfacets. MULTI_GGX: GGX with height-correlated masking and the
 * energy of the single scattering restored, in place of Cycles' random walk. */
enum { TRC_LOBE_GGX, TRC_LOBE_GTR1, TRC_LOBE_BECKMANN, TRC_LOBE_ASHIKHMIN, TRC_LOBE_MULTI_GGX };

/* trc_lobe.fresnel: what multiplies the weight at a microfacet. */
enum {
    TRC_FRESNEL_NONE,       /* 1 (glass has the factor of the macro normal in its weight) */
    TRC_FRESNEL_BLEND,      /* f0 to f90 as the dielectric of index ior goes from F(0) to 1; 1 minus
                               it for refraction */
    TRC_FRESNEL_OVERSHOOT,  /* the same of Blender 3.4: where F is below F(0), beyond f0 */
    TRC_FRESNEL_DIELECTRIC, /* F of ior for reflection, 1 - F for refraction */
    TRC_FRESNEL_OWN,        /* trc_lobe.reflectance; 1 minus it for refraction */
    TRC_FRESNEL_METAL       /* the same, of trc_metal_fresnel: f90 is the dip */
};

struct trc_lobe_model; /* kernels/lobe/lobe.h */

struct trc_lobe {
    const struct trc_lobe_model *model;
    /* Reflected part of what meets a micro-normal at that cosine, from TRC_FRESNEL_OWN on; f0
     * and f90 are what it makes of them. */
    vvec3 (*reflectance)(const struct trc_lobe *lobe, vfloat cos_m);
    const float *film_colors; /* of thin films: trc_material's; NULL: Rec.709 */
    enum trc_lobe_kind kind;  /* the model's */
    uint32_t distribution;
    uint32_t fresnel;
    bool correlated;      /* microfacets mask and shadow by one height, and passes of the colour
                             have the mean reflectance, of hair too: as in Cycles 4 */
    bool is_whole_glass;  /* half of glass whose reflection is in the passes of transmission, as in
                             Cycles 3.4 where facets scatter more than once */
    bool facet_shadowing; /* bent normals lie in shadow as microfacets do, as in Cycles 5 */
    bool anisotropic;     /* tangent is set and alpha_x may differ from alpha_y */
    vmask ideal;          /* lanes that scatter into one direction only */
    vvec3 weight;         /* throughput colour, >= 0; 0 in lanes that do not have the lobe */
    vvec3 n;              /* the lobe's normal */
    vvec3 tangent; /* unit, orthogonal to n, anisotropic lobes only; bitangent is n x tangent */
    vfloat alpha_x, alpha_y;
    vfloat mean_alpha; /* of facets: their geometric mean before Filter Glossy widened them, by
                          which Cycles 4 puts back what scatters more than once */
    vfloat ior;        /* refraction: relative index, transmitted over incident side; metal under a
                          film: the film's */
    vfloat roughness;  /* Oren-Nayar sigma; Principled's roughness; velvet: 1 / sigma^2; metal under
                          a film: its thickness */
    /* Toon, f0: angle of full light, angle of its fading, cosine of both. Fibres, f0: the two
     * coefficients of their transform. Oren-Nayar that keeps energy, f0: factor of the part that
     * scatters more than once. Whole glass, f0: albedo in passes, in one of both lobes. Portals:
     * where the ray goes on, and its direction. Fibres: kernels/lobe/hair.c and principled_hair.c.
     */
    vvec3 f0, f90;
    vfloat cos_o;         /* n . wo */
    vfloat g1_o;          /* masking of wo */
    vfloat pdf_scale;     /* density of a sampled direction over D of its half vector */
    bool has_twin;        /* of glass: the next lobe refracts by the same micro-normals */
    vmask paired;         /* lanes of glass in which the sampled micro-normal decides between this
                             lobe and its other half, each of which has half of the chance */
    vfloat pair_tint;     /* mean colour of refraction over that of reflection, paired lanes */
    vvec3 multi_weight;   /* MULTI_GGX: what the lobe of the missing energy is scaled by */
    vfloat multi_chance;  /* and how often it is sampled, by cosine */
    vfloat albedo_scale;  /* what Cycles leaves of the weight in the albedo */
    vfloat mix_weight;    /* Cycles' sample weight, of every lobe */
    vfloat sample_weight; /* chance in proportion, 0 for lobes that are not continued */
};

/* trc_lobes.rare */
enum {
    TRC_LOBES_TURN = 1 << 0,   /* a shading offset: see turn */
    TRC_LOBES_HAIR = 1 << 1,   /* there are TRC_LOBE_HAIR_* */
    TRC_LOBES_VELVET = 1 << 2, /* there are TRC_LOBE_VELVET, whose light is glossy, and bumps shadow
                                  it as sampled; without it they are as diffuse ones */
    TRC_LOBES_BENT = 1 << 3,   /* there are TRC_LOBE_TRANSLUCENT whose normals are not the
                                  geometry's */
    TRC_LOBES_WHOLE_GLASS = 1 << 4 /* there are some with is_whole_glass; for passes of light */
};

/* Whether no ray is continued for a lobe of that kind. */
static inline bool trc_lobe_ends(enum trc_lobe_kind kind) { return kind <= TRC_LOBE_VELVET; }

struct trc_lobes {
    int count;
    struct trc_lobe lobe[TRC_MAX_LOBES];
    vvec3 emission;         /* radiance towards wo */
    vvec3 holdout;          /* weight of holdout leaves, or of all that cuts out */
    vfloat mix_weight;      /* sum over the lobes */
    vfloat continue_weight; /* sum of sample_weight */
    /* Lanes where a light below the geometric surface may reach reflecting lobes;
     * trc_lobes_setup sets none: nothing shines through. Direct light sets it for smooth surfaces,
     * as its shadow rays start off the flat triangle. */
    vmask below_horizon;
    uint32_t rare; /* TRC_LOBES_*, all that takes paths of their own */
    /* TRC_LOBES_TURN: factor on the angle of light to the normals of reflecting lobes; likewise. */
    vfloat turn;
    /* Product of alphas up to which refraction counts as clear, < 0: none does; likewise. */
    float clear_alpha2;
};

/* Lanes where all is held out: they have no data and no ambient occlusion, as in Cycles. */
TRC_INLINE vmask trc_lobes_are_holdout(const struct trc_lobes *lobes) {
    return vf_ge(v3_average(lobes->holdout), vf_set(1.0f));
}

/* From a material's leaves and the registers its program left. filter_alpha: lower bound on alpha
 * (Filter Glossy), 0 for none. Unit: weights include mix factors and alpha.
 * (kernels/lobe/setup.c) */
void trc_lobes_setup(const struct trc_material *m, const struct trc_surface *s,
                     const struct trc_registers *regs, vfloat filter_alpha, struct trc_lobes *out);

/* Emission of the leaves alone: what a light sample or a world lookup needs. */
vvec3 trc_lobes_emission(const struct trc_material *m, const struct trc_registers *regs);

/* Value times cosine towards wi, split as the passes want it, without ideal lobes; pdf is the
 * density of trc_bsdf_sample for wi over the lobes that are continued (solid angle, 0 for
 * diffuse-only). Lanes outside active are 0. Where light samples and continuation rays share the
 * work, the weight of a light sample (p_l^2 / (p_l^2 + pdf^2)) goes to all three parts, diffuse
 * included: the weight of a sampled ray carries all three too. as_sampled: lanes whose value is to
 * be that of trc_bsdf_sample, which differs where normals are bent (kernels/lobe/bsdf.c). */
struct trc_bsdf_value {
    vvec3 diffuse, glossy, transmission;
    vfloat pdf;
};
void trc_bsdf_eval(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi, vmask active,
                   vmask as_sampled, struct trc_bsdf_value *out);

/* One continuation ray per lane: the lobe by u_lobe in proportion to sample_weight, the direction
 * by u1, u2. Diffuse and sheen lobes are never continued; transparent and translucent are.
 *
 * Two throughputs. weight is for the emission, lamps and world that the ray itself finds (through
 * transparent surfaces too), with MIS against light samples: unbiased. Everything behind the next
 * surface gets weight * indirect_scale, which differs from 1 only where a rough lobe shares its
 * direction with lobes that are not continued: Cycles picks one lobe, diffuse ones included, and
 * weights the pick by the densities of all of them (balance heuristic); with diffuse bounces 0 the
 * picks of diffuse lobes then end, so the others carry S(wi) / P(wi), S the densities of continued
 * lobes and P of all. A picture without that factor would be "right" and differ from Cycles' by
 * several per cent on rough Principled materials. */
struct trc_bsdf_sample {
    vvec3 wi;     /* unit */
    vvec3 weight; /* value * cos / pdf, over all lobes for rough ones, for this lobe if ideal */
    vfloat indirect_scale; /* 1 for ideal and transparent ones */
    vfloat pdf;            /* as in trc_bsdf_eval; 0 where ideal or transparent */
    vfloat whole_pdf;      /* the same over all lobes, as Cycles has it; of rough ones alone */
    vmask valid;           /* the ray is worth tracing */
    vmask singular, transparent,
        transmitted;      /* transmitted: to the other side, incl. translucent */
    vmask diffuse;        /* the lobe was translucent: a diffuse transmission ray */
    vmask fibre;          /* the lobe was of fibres, in the passes of reflection on either side */
    vmask whole_glass;    /* it was of such glass; where TRC_LOBES_WHOLE_GLASS is set */
    vmask clear;          /* by what is smooth enough, where lobes ask */
    vmask through_portal; /* transparent lanes that go on from origin instead of straight */
    vvec3 origin;
};
void trc_bsdf_sample(const struct trc_lobes *l, const struct trc_surface *s, vfloat u_lobe,
                     vfloat u1, vfloat u2, struct trc_bsdf_sample *out);

/* Whitted: the same for lobe number i alone (weight not divided by a choice; rough lobes are taken
 * along their ideal direction). valid is none for lobes that are not continued. */
void trc_bsdf_ideal(const struct trc_lobes *l, int i, const struct trc_surface *s,
                    struct trc_bsdf_sample *out);

/* Albedo of the lobes for the colour passes: diffuse, glossy, transmission. As Cycles: the weights,
 * without what a Fresnel factor or masking takes; of correlated lobes with the mean Fresnel factor.
 * pass_flags: TRC_PASSES_*. */
void trc_bsdf_albedo(const struct trc_lobes *l, uint32_t pass_flags, vvec3 albedo_out[3]);

/* Albedo of one lobe towards wo, Fresnel factors included: that of its normal, of correlated lobes
 * the mean one. */
vvec3 trc_lobe_albedo(const struct trc_lobe *lobe, vvec3 wo, uint32_t pass_flags);

/* How rough one lobe is: the mean alpha of its facets, 0 where it is ideal, 1 without facets. */
vfloat trc_lobe_alpha(const struct trc_lobe *lobe);

/* The mean of the lobes' normals by their weights, as the Normal pass has it, which bumps turn; the
 * surface's own without lobes. */
vvec3 trc_lobes_normal(const struct trc_lobes *l, const struct trc_surface *s);

/* What denoisers know a lobe by: its normal, of Huang's hair the direction of the strand. */
vvec3 trc_lobe_feature(const struct trc_lobe *lobe, const struct trc_surface *s);

/* What ambient light meets: the weights of diffuse lobes, translucent ones too, and the mean of
 * their normals, the shading normal without any. */
vvec3 trc_lobes_diffuse(const struct trc_lobes *l, const struct trc_surface *s, vvec3 *normal_out);

/* Sum of transparent weights: what a shadow ray or the film's alpha sees through; as in Cycles with
 * the portals of a surface that is transparent besides. */
vvec3 trc_lobes_transparency(const struct trc_lobes *l);

/* The same without portals: what goes straight on. */
vvec3 trc_lobes_straight(const struct trc_lobes *l);

#endif
