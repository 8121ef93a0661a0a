/* Transparency: straight through. Of a material it is one lobe, however many leaves have it. */
#include "kernels/lobe/lobe.h"

void trc_add_transparent(struct trc_setup *c, vvec3 weight) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_TRANSPARENT};
    /* As in Cycles, colours below 0 take light away, and count by their mean. */
    const vfloat mean = vf_abs(v3_average(weight));
    for (int i = 0; i < c->out->count; i++) {
        struct trc_lobe *lobe = &c->out->lobe[i];
        if (lobe->model != &model)
            continue;
        const vmask counts = vm_and(c->s->active, vf_ge(mean, vf_set(TRC_WEIGHT_CUTOFF)));
        lobe->weight = v3_add(lobe->weight, v3_where(counts, weight));
        lobe->mix_weight = lobe->mix_weight + vf_where(counts, mean);
        return;
    }
    struct trc_lobe *lobe = trc_add_lobe(c, &model, v3_splat(mean));
    if (!lobe)
        return;
    lobe->weight = v3_where(vf_gt(lobe->mix_weight, vf_zero()), weight);
    lobe->n = c->s->n;
    lobe->cos_o = v3_dot(lobe->n, c->s->wo);
    lobe->ideal = vm_all_set();
}

static void add_leaf(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    trc_add_transparent(c, v3_scale(colour(c, leaf, TRC_AT(TRANSPARENT, color)), weight));
}

const struct trc_closure TRC_CLOSURE_OF(TRANSPARENT) = {.add = add_leaf};

/* ---- holdout: a hole in the film ---- */

static void add_holdout(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    (void)leaf;
    c->out->holdout = v3_add(c->out->holdout, v3_splat(vf_where(c->s->active, weight)));
}

const struct trc_closure TRC_CLOSURE_OF(HOLDOUT) = {.add = add_holdout};
