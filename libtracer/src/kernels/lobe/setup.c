/* From the leaves of a material to lobes, as Cycles sets up its closures: normals and tangents, the
 * closures of the leaves, chances. */
#include <math.h>

#include "kernels/lobe/lobe.h"
#include "kernels/trace/valid_normal.h"

/* First hit: a lobe gets at least this share of the samples (Cycles 3.4's defensive sampling). */
#define DEFENSIVE_SHARE 0.125f

/* ---- normals and tangents ---- */

/* What a normal is linked to may have any length, as a colour has; without a direction, it is the
 * surface's in Cycles 4 and 5, and what valid_normal makes of it in 3.4. */
static vvec3 linked_normal(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    const vvec3 n = colour(c, leaf, at);
    if (!(c->material->flags & TRC_MATERIAL_KEEPS_NORMALS))
        return n;
    vfloat length;
    const vvec3 unit = v3_normalize_length(n, &length);
    const vmask fine = vm_and(vf_gt(length, vf_zero()), vf_lt(length, vf_set(INFINITY)));
    return v3_select(fine, unit, c->s->n);
}

vvec3 trc_leaf_normal(struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    if (!is_unlinked(c, leaf, at))
        return valid_normal(c->s, linked_normal(c, leaf, at));
    return trc_default_normal(c);
}

vvec3 trc_matt_normal(struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at) {
    if (!(c->material->flags & TRC_MATERIAL_KEEPS_NORMALS))
        return trc_leaf_normal(c, leaf, at);
    return is_unlinked(c, leaf, at) ? c->s->n : linked_normal(c, leaf, at);
}

vvec3 trc_default_normal(struct trc_setup *c) {
    if (!c->has_default_n) {
        c->default_n = valid_normal(c->s, c->s->n);
        c->has_default_n = true;
    }
    return c->default_n;
}

vvec3 trc_leaf_tangent(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at, vvec3 n,
                       vfloat rotation) {
    const vvec3 t = colour(c, leaf, at);
    vfloat sine, cosine;
    vf_sincos_turns(rotation, &sine, &cosine);
    const vvec3 along = v3_scale(n, v3_dot(n, t) * (vf_one() - cosine));
    const vvec3 turned = v3_mad(v3_cross(n, t), sine, v3_mad(t, cosine, along));
    const vvec3 bitangent = v3_normalize(v3_cross(n, turned));
    vvec3 a, b;
    v3_frame(n, &a, &b);
    const vmask fine = vf_gt(v3_dot(bitangent, bitangent), vf_zero());
    return v3_select(fine, v3_cross(bitangent, n), a);
}

/* ---- lobes ---- */

struct trc_lobe *trc_add_lobe(struct trc_setup *c, const struct trc_lobe_model *model,
                              vvec3 weight) {
    struct trc_lobes *out = c->out;
    const vvec3 w =
        v3(vf_max(weight.x, vf_zero()), vf_max(weight.y, vf_zero()), vf_max(weight.z, vf_zero()));
    const vfloat mean = v3_average(w);
    /* False for NaN too. */
    const vmask counts = vm_and(c->s->active, vf_ge(mean, vf_set(TRC_WEIGHT_CUTOFF)));
    if (!vm_any(counts) || out->count == TRC_MAX_LOBES)
        return NULL;
    struct trc_lobe *lobe = &out->lobe[out->count++];
    lobe->model = model;
    lobe->kind = model->kind;
    lobe->distribution = TRC_LOBE_GGX;
    lobe->fresnel = TRC_FRESNEL_NONE;
    lobe->correlated = lobe->is_whole_glass = false;
    lobe->facet_shadowing = c->material->flags & TRC_MATERIAL_FACET_SHADOWING;
    lobe->albedo_scale = vf_one();
    lobe->anisotropic = lobe->has_twin = false;
    lobe->ideal = lobe->paired = vm_none();
    lobe->weight = v3_where(counts, w);
    lobe->mix_weight = vf_where(counts, mean);
    lobe->sample_weight = vf_zero();
    return lobe;
}

/* Chances of the lobes. At the first hit small ones may be raised to a share of the sum. */
static void set_chances(const struct trc_material *m, const struct trc_surface *s,
                        struct trc_lobes *out) {
    vfloat floor_weight = vf_zero();
    if (m->flags & TRC_MATERIAL_DEFENSIVE_SAMPLING) {
        vfloat sum = vf_zero();
        for (int i = 0; i < out->count; i++)
            sum = sum + out->lobe[i].mix_weight;
        const vmask is_first = vi_eq((vint)s->depths, vi_set(0));
        floor_weight = vf_where(is_first, sum * vf_set(DEFENSIVE_SHARE));
    }
    out->mix_weight = vf_zero();
    out->continue_weight = vf_zero();
    for (int i = 0; i < out->count; i++) {
        struct trc_lobe *lobe = &out->lobe[i];
        const vmask present = vf_gt(v3_max(v3_abs(lobe->weight)), vf_zero());
        lobe->mix_weight = vf_where(present, vf_max(lobe->mix_weight, floor_weight));
        out->mix_weight = out->mix_weight + lobe->mix_weight;
        if (trc_lobe_ends(lobe->kind))
            continue;
        lobe->sample_weight = lobe->mix_weight;
        out->continue_weight = out->continue_weight + lobe->mix_weight;
    }
}

/* Leaves what is transparent; all else is a hole. */
static void cut_out(struct trc_lobes *out) {
    vvec3 hole = v3_splat(vf_one());
    int kept = 0;
    for (int i = 0; i < out->count; i++) {
        if (out->lobe[i].kind != TRC_LOBE_TRANSPARENT)
            continue;
        hole = v3_sub(hole, out->lobe[i].weight);
        out->lobe[kept++] = out->lobe[i];
    }
    out->count = kept;
    out->emission = v3_zero();
    out->holdout = hole;
}

/* ---- leaves ---- */

/* By the type of a leaf's node; all types that leaves have are there (tests/unit/test_nodes.c). */
static const struct trc_closure *const closures[TRC_NODE_IMAGE] = {
#define TRC_CLOSURE(NAME, lobes, branches) [TRC_NODE_##NAME] = &TRC_CLOSURE_OF(NAME),
#include "tracer/nodes.def"
};

void trc_lobes_setup(const struct trc_material *m, const struct trc_surface *s,
                     const struct trc_registers *regs, vfloat filter_alpha, struct trc_lobes *out) {
    struct trc_setup c = {m, s, regs, filter_alpha, v3_zero(), false, out};
    out->count = 0;
    out->emission = v3_zero();
    out->holdout = v3_zero();
    out->below_horizon = vm_none();
    out->clear_alpha2 = -1.0f;
    out->rare = 0;
    for (uint32_t i = 0; i < m->leaf_count; i++) {
        const struct trc_leaf *leaf = &m->leaves[i];
        const vfloat weight = trc_operand_value(&leaf->weight, regs);
        if (!vm_any(vm_and(s->active, vf_ne(weight, vf_zero()))))
            continue;
        const struct trc_closure *closure = closures[leaf->type];
        vvec3 emission;
        if (closure->emission && closure->emission(&c, leaf, weight, &emission))
            out->emission = v3_add(out->emission, emission);
        if (closure->add)
            closure->add(&c, leaf, weight);
    }
    if (m->flags & TRC_MATERIAL_CUTS_OUT)
        cut_out(out);
    set_chances(m, s, out);
}

vvec3 trc_lobes_emission(const struct trc_material *m, const struct trc_registers *regs) {
    const struct trc_setup c = {m, NULL, regs, vf_zero(), v3_zero(), false, NULL};
    vvec3 sum = v3_zero(), emission;
    for (uint32_t i = 0; i < m->leaf_count; i++) {
        const struct trc_leaf *leaf = &m->leaves[i];
        const struct trc_closure *closure = closures[leaf->type];
        if (closure->emission &&
            closure->emission(&c, leaf, trc_operand_value(&leaf->weight, regs), &emission))
            sum = v3_add(sum, emission);
    }
    return sum;
}
