/* Ray portals: rays that meet one go on from elsewhere. */
#include "kernels/lobe/lobe.h"
#include "kernels/trace/spawn.h"

/* Squared distance in metres up to which a portal leads to the point it is met at (Cycles). */
#define SAME_PLACE2 1e-9f

static void add_portal(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_TRANSPARENT, .is_portal = true};
    struct trc_lobe *lobe =
        trc_add_lobe(c, &model, v3_scale(colour(c, leaf, TRC_AT(RAY_PORTAL, color)), weight));
    if (!lobe)
        return;
    const struct trc_surface *s = c->s;
    const vvec3 position = colour(c, leaf, TRC_AT(RAY_PORTAL, position));
    const vvec3 direction = colour(c, leaf, TRC_AT(RAY_PORTAL, direction));
    const vvec3 apart = v3_sub(position, s->p);
    const vfloat distance2 = v3_dot(apart, apart), length2 = v3_dot(direction, direction);
    const vmask elsewhere = vf_gt(distance2, vf_set(SAME_PLACE2));
    const vmask turns = vm_and(vf_gt(length2, vf_zero()), vf_lt(length2, vf_set(INFINITY)));
    /* False for NaN too. */
    const vmask is_place = vf_lt(distance2, vf_set(INFINITY));
    lobe->weight = v3_where(is_place, lobe->weight);
    lobe->mix_weight = vf_where(is_place, lobe->mix_weight);
    lobe->n = s->n;
    lobe->cos_o = v3_dot(s->n, s->wo);
    lobe->ideal = vm_all_set();
    lobe->f90 = v3_select(turns, v3_normalize(direction), v3_neg(s->wo));
    const vmask outside = vf_ge(v3_dot(lobe->f90, s->ng), vf_zero());
    lobe->f0 = v3_select(elsewhere, position, trc_spawn_origin(s, outside));
}

const struct trc_closure TRC_CLOSURE_OF(RAY_PORTAL) = {.add = add_portal};
