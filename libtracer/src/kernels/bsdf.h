/* Lobes of a shading point: set up from a material's leaves, evaluated, sampled. TRC_WIDTH points at
 * once, all of one material, so the kinds of lobes are uniform and their parameters are not. */
#ifndef TRACER_KERNELS_BSDF_H
#define TRACER_KERNELS_BSDF_H

#include "kernels/simd.h"
#include "kernels/surface.h"

#define TRC_MAX_LOBES 24

enum trc_lobe_kind {
    TRC_LOBE_DIFFUSE,       /* Lambert, or Oren-Nayar where roughness > 0 */
    TRC_LOBE_SHEEN,         /* Principled's sheen, counts as diffuse */
    TRC_LOBE_TRANSLUCENT,
    TRC_LOBE_REFLECT,       /* microfacet reflection (GGX, GTR1, Beckmann) or ideal mirror */
    TRC_LOBE_REFRACT,       /* microfacet refraction or ideal */
    TRC_LOBE_TRANSPARENT    /* straight through */
};

/* Lanes where alpha_x * alpha_y is at or below it are ideal (Cycles 3.4 uses the same bound). */
#define TRC_SINGULAR_ALPHA2 1e-7f

struct trc_lobe {
    enum trc_lobe_kind kind;
    uint32_t distribution;  /* of microfacets: 0 GGX, 1 GTR1 (clearcoat), 2 Beckmann, 3 Ashikhmin */
    uint32_t fresnel;       /* 0 none, 1 Principled's F0 blend, 2 clearcoat */
    vvec3 weight;           /* throughput colour, >= 0 */
    vvec3 n;                /* the lobe's normal */
    vvec3 tangent;          /* anisotropy */
    vfloat alpha_x, alpha_y;
    vfloat ior;             /* refraction: relative index, transmitted over incident side */
    vfloat roughness;       /* Oren-Nayar sigma */
    vvec3 f0, f90;
    vfloat sample_weight;   /* chance in proportion, 0 for lobes that are not continued */
};

struct trc_lobes {
    int count;
    struct trc_lobe lobe[TRC_MAX_LOBES];
    vvec3 emission;         /* radiance towards wo */
    vfloat holdout;         /* weight of holdout leaves */
    vfloat continue_weight; /* sum of sample_weight */
};

/* From a material's leaves and the registers its program left. filter_alpha: lower bound on alpha
 * (Filter Glossy), 0 for none. Unit: weights include mix factors and alpha.
 * (kernels/bsdf_setup.c) */
void TRC_KERNEL(trc_lobes_setup)(const struct trc_material *m, const struct trc_surface *s,
                                 const struct trc_registers *regs, vfloat filter_alpha,
                                 struct trc_lobes *out);

/* Value times cosine towards wi, split as the passes want it, without ideal lobes; pdf is the density of
 * trc_bsdf_sample for wi over the lobes that are continued (solid angle, 0 for diffuse-only). */
struct trc_bsdf_value {
    vvec3 diffuse, glossy, transmission; /* translucent counts as transmission */
    vfloat pdf;
};
void TRC_KERNEL(trc_bsdf_eval)(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi,
                               vmask active, struct trc_bsdf_value *out);

/* One continuation ray per lane: the lobe by u_lobe in proportion to sample_weight, the direction by u1,
 * u2. Diffuse and sheen lobes are never continued; transparent and translucent are. */
struct trc_bsdf_sample {
    vvec3 wi;               /* unit */
    vvec3 weight;           /* value * cos / pdf, over all lobes for rough ones, for this lobe if ideal */
    vfloat pdf;             /* as in trc_bsdf_eval; 0 where ideal or transparent */
    vmask valid;            /* the ray is worth tracing */
    vmask singular, transparent, transmitted; /* transmitted: to the other side, incl. translucent */
    vfloat alpha_min;       /* sqrt(alpha_x * alpha_y) of the lobe, for Filter Glossy */
};
void TRC_KERNEL(trc_bsdf_sample)(const struct trc_lobes *l, const struct trc_surface *s,
                                 vfloat u_lobe, vfloat u1, vfloat u2, struct trc_bsdf_sample *out);

/* Whitted: the same for lobe number i alone (weight not divided by a choice; rough lobes are taken along
 * their ideal direction). valid is none for lobes that are not continued. */
void TRC_KERNEL(trc_bsdf_ideal)(const struct trc_lobes *l, int i, const struct trc_surface *s,
                                struct trc_bsdf_sample *out);

/* Albedo of the lobes for the colour passes: diffuse, glossy, transmission. */
void TRC_KERNEL(trc_bsdf_albedo)(const struct trc_lobes *l, const struct trc_surface *s,
                                 vvec3 albedo_out[3]);

/* Sum of transparent weights: what a shadow ray or the film's alpha sees through. */
vvec3 TRC_KERNEL(trc_lobes_transparency)(const struct trc_lobes *l);

#endif
