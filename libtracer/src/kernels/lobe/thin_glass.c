/* Glass without thickness, after the thin-walled dielectric of OpenPBR: what its two surfaces
 * reflect to and fro is summed up in two lobes. What goes through is a reflection seen in the
 * surface as in a mirror. As Cycles 5. */
#include "kernels/lobe/facets.h"

/* Alpha times itself up to which rays go straight through (Cycles 5). */
#define CLEAR_ALPHA2 2e-10f

static vvec3 mirrored(vvec3 w, vvec3 n) {
    return v3_sub(w, v3_scale(n, vf_set(2.0f) * v3_dot(n, w)));
}

static struct lobe_value value(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi) {
    return trc_reflection_value(lobe, s, mirrored(wi, lobe->n));
}

static vvec3 direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    struct trc_lobe reflection = *lobe;
    reflection.kind = TRC_LOBE_REFLECT;
    const vvec3 wi = trc_facets_direction(&reflection, s, u1, u2, chosen_at, alive, crosses);
    *crosses = *alive;
    return mirrored(wi, lobe->n);
}

/* Two refractions roughen more than a reflection (C. Kulla and A. Conty, "Revisiting Physically
 * Based Shading at Imageworks", 2017). */
static vfloat roughened(vfloat alpha, vfloat ior) {
    const vfloat half = ior - vf_set(0.5f);
    const vfloat gain = vf_set(3.4f) * (ior - vf_one()) * half * half / (ior * ior * ior);
    return vf_saturate(alpha * vf_safe_sqrt(gain));
}

static void add_lobe(struct trc_setup *c, const struct trc_lobe_model *model, vvec3 weight, vvec3 n,
                     vfloat alpha, vvec3 per_bounce) {
    struct trc_lobe *lobe = trc_add_lobe(c, model, weight);
    if (!lobe)
        return;
    lobe->correlated = true;
    lobe->n = n;
    lobe->ior = vf_one();
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->kind = TRC_LOBE_REFLECT; /* as which both are set up */
    trc_facets_finish(c, lobe, false);
    trc_facets_keep_energy(lobe, per_bounce);
    lobe->kind = model->kind;
}

void trc_add_thin_glass(struct trc_setup *c, const struct trc_thin_glass *glass) {
    static const struct trc_lobe_model reflection = {.kind = TRC_LOBE_REFLECT,
                                                     .has_facets = true,
                                                     .value = TRC_KERNEL(trc_reflection_value),
                                                     .direction = TRC_KERNEL(trc_facets_direction)};
    static const struct trc_lobe_model transmission = {
        .kind = TRC_LOBE_REFRACT, .has_facets = true, .value = value, .direction = direction};
    const vfloat alpha = roughened(glass->alpha, glass->ior);
    /* Smooth glass does not bend rays: to all but the camera's it is transparent. */
    const vint camera = vi_set(TRC_VISIBLE_CAMERA);
    const vmask is_seen = vi_eq((vint)c->s->path & camera, camera);
    const vmask clear = vm_andnot(vf_le(alpha * alpha, vf_set(CLEAR_ALPHA2)), is_seen);
    add_lobe(c, &reflection, glass->reflected, glass->n, glass->alpha, glass->tint);
    if (vm_any(vm_and(clear, c->s->active)))
        trc_add_transparent(c, v3_where(clear, glass->transmitted));
    add_lobe(c, &transmission, v3_where(vm_not(clear), glass->transmitted), glass->n, alpha,
             v3_splat(vf_one()));
}
