/* Choosing among lights: how much each might give to a point, and with what chance it is chosen.
 *
 * A. Conty Estevez and C. Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting"
 * (2018): intensity over squared distance, times the minimum angle any part of the light may make
 * with its own axis, times the minimum angle it may make with the receiver's normal. Both bounds
 * are conservative, so a light of importance 0 gives nothing. */
#ifndef TRACER_KERNELS_LIGHT_SELECT_H
#define TRACER_KERNELS_LIGHT_SELECT_H

#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"
#include "model/lights.h"

/* Who receives: the point and the normal of kernels/light/light.h. */
struct trc_receiver {
    vvec3 p, n;
    vmask has_n;       /* the normal is of unit length: light from below does not count */
    const vuint *sets; /* the bit of its light set, low word first; read where lights are linked */
};

/* What each light may give to points, each computed once for the choice; of more lights than are
 * kept the others are computed again. */
#define TRC_LIGHT_CHOICES_KEPT 48
struct trc_light_choices {
    vvec3 p, n;
    vuint sets[2]; /* trc_receiver.sets */
    vfloat sum;
    vfloat kept[TRC_LIGHT_CHOICES_KEPT];
};

TRC_INLINE struct trc_receiver trc_receiver_make(vvec3 p, vvec3 n) {
    return (struct trc_receiver){.p = p, .n = n, .has_n = vf_gt(v3_dot(n, n), vf_set(0.25f))};
}

/* What few scenes need stays out of the way of what all do. */
#define TRC_LINKS static __attribute__((noinline, unused))

/* Those of the lanes' instances; none of -1, which every light lights. */
TRC_LINKS void trc_receiver_sets(const struct trc_snapshot *scene, vint instance, vmask m,
                                 vuint sets[2]) {
    uint32_t low[TRC_WIDTH] = {0}, high[TRC_WIDTH] = {0};
    for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const int32_t number = vi_get(instance, lane);
        if (number < 0)
            continue;
        const uint32_t set = scene->instances[number].light_set;
        *(set < 32 ? &low[lane] : &high[lane]) = 1u << set % 32;
    }
    sets[0] = vu_load(low);
    sets[1] = vu_load(high);
}

/* Lanes whose set is among those that a light excludes. */
TRC_INLINE vmask trc_is_unlit(vuint low, vuint high, const vuint sets[2]) {
    return vm_not(vi_eq((vint)((low & sets[0]) | (high & sets[1])), vi_set(0)));
}

struct trc_wide_bound {
    vvec3 center, axis;
    vfloat radius, cos_o, sin_o, cos_e, intensity;
    vmask two_sided;
};
TRC_INLINE struct trc_wide_bound trc_bound_broadcast(const struct trc_light_bound *b) {
    return (struct trc_wide_bound){v3_set(b->center),    v3_set(b->axis),
                                   vf_set(b->radius),    vf_set(b->cos_o),
                                   vf_set(b->sin_o),     vf_set(b->cos_e),
                                   vf_set(b->intensity), b->two_sided ? vm_all_set() : vm_none()};
}
/* Bounds number index of each lane. */
TRC_INLINE struct trc_wide_bound trc_bound_gather(const struct trc_light_bound *bounds, vint index,
                                                  vmask m) {
    const vint at = index * vi_set(TRC_BOUND_WORDS);
    struct trc_wide_bound b;
    b.center = v3_gather(bounds->center, at, m);
    b.radius = vf_gather(&bounds->radius, at, m);
    b.axis = v3_gather(bounds->axis, at, m);
    b.cos_o = vf_gather(&bounds->cos_o, at, m);
    b.sin_o = vf_gather(&bounds->sin_o, at, m);
    b.cos_e = vf_gather(&bounds->cos_e, at, m);
    b.intensity = vf_gather(&bounds->intensity, at, m);
    b.two_sided = vm_not(vi_eq(vi_gather(&bounds->two_sided, at, m), vi_set(0)));
    return b;
}

/* cos of max(0, a - b). */
TRC_INLINE vfloat trc_cos_less(vfloat cos_a, vfloat sin_a, vfloat cos_b, vfloat sin_b) {
    return vf_select(vf_gt(cos_a, cos_b), vf_one(), cos_a * cos_b + sin_a * sin_b);
}
/* sin of max(0, a - b). */
TRC_INLINE vfloat trc_sin_less(vfloat cos_a, vfloat sin_a, vfloat cos_b, vfloat sin_b) {
    return vf_select(vf_gt(cos_a, cos_b), vf_zero(), sin_a * cos_b - cos_a * sin_b);
}

/* How a light's directions are bounded, and at what price. */
enum trc_bound_shape {
    TRC_BOUND_SPHERE,     /* shines everywhere */
    TRC_BOUND_HEMISPHERE, /* one normal, 90 degrees about it: flat lights */
    TRC_BOUND_FLAT_LAMP,  /* the same of a single area lamp: all of it in a plane through center */
    TRC_BOUND_CONE
};
TRC_INLINE enum trc_bound_shape trc_shape_of(const struct trc_light_table *t,
                                             const struct trc_light_bound *b) {
    if (b->cos_o <= -1.0f)
        return TRC_BOUND_SPHERE;
    if (b->cos_o < 1.0f || b->cos_e != 0.0f)
        return TRC_BOUND_CONE;
    if (b->child >= 0 || (uint32_t)b->light >= t->lamp_count)
        return TRC_BOUND_HEMISPHERE;
    /* Spots of half a turn have such bounds, too, but are spheres. */
    const int32_t kind = t->lamps[b->light].kind;
    const bool is_area = kind == TRC_KIND_RECTANGLE || kind == TRC_KIND_ELLIPSE;
    return is_area ? TRC_BOUND_FLAT_LAMP : TRC_BOUND_HEMISPHERE;
}

/* Maximum that nearness counts, over 1 / squared radius. With 1, as in the paper, a point close to
 * a shining mesh takes half of its samples away from the nearest lights at each level of the tree,
 * so that those are found by few samples of great weight. */
#define TRC_NEAR_FADE 8.0f

/* What rounding may add to a cosine: no light that reaches a point counts as none. */
#define EDGE_SLACK 1e-4f
/* What light at an angle counts at least, of what it gives head-on: lobes need not be diffuse. */
#define MIN_FACING 0.0625f
/* Squared metres; what is divided by. */
#define MIN_DISTANCE2 1e-20f

/* Part of the light may be within 90 degrees of an axis iff cos a + sin b > 0, a the angle of its
 * centre, b its half angle; the sum also stands for the cosine of the nearest part, without
 * roots. */
TRC_INLINE vfloat trc_bound_importance(const struct trc_wide_bound *b, const struct trc_receiver *r,
                                       enum trc_bound_shape shape, bool has_radius) {
    const vvec3 d = v3_sub(b->center, r->p);
    const vfloat d2 = vf_max(v3_dot(d, d), vf_set(MIN_DISTANCE2));
    const vfloat inverse = vf_rcp(vf_sqrt(d2));
    const vvec3 w = v3_scale(d, inverse);
    /* Sine of the half angle of the sphere seen from p; within it, everything. */
    vfloat sin_b = vf_zero(), fade = inverse * inverse;
    vmask within = vm_none();
    if (has_radius) {
        sin_b = b->radius * inverse;
        within = vf_ge(sin_b, vf_one());
        sin_b = vf_min(sin_b, vf_one());
        const vfloat r2 = vf_max(b->radius * b->radius, vf_set(MIN_DISTANCE2));
        fade = vf_min(fade, vf_set(TRC_NEAR_FADE) * vf_rcp(r2));
    }
    vfloat cos_light = vf_one();
    vmask reaches = vm_all_set();
    if (shape != TRC_BOUND_SPHERE) {
        vfloat cos_l = -v3_dot(b->axis, w);
        cos_l = vf_select(b->two_sided, vf_abs(cos_l), cos_l);
        vfloat limit = vf_zero(), cos_nearest = cos_l;
        if (shape == TRC_BOUND_FLAT_LAMP) {
            /* Height over nearest distance. From behind no part is seen; if that were chosen, too,
             * what does shine there would have few samples of great weight. */
            cos_light = vf_divide(cos_l, vf_max(vf_one() - sin_b, vf_set(EDGE_SLACK)));
            within = vm_none();
        } else if (shape == TRC_BOUND_HEMISPHERE) {
            cos_nearest = cos_light = cos_l + sin_b;
        } else {
            const vfloat sin_l = vf_safe_sqrt(vf_one() - cos_l * cos_l);
            const vfloat cos_x = trc_cos_less(cos_l, sin_l, b->cos_o, b->sin_o);
            const vfloat sin_x = trc_sin_less(cos_l, sin_l, b->cos_o, b->sin_o);
            const vfloat cos_b = vf_safe_sqrt(vf_one() - sin_b * sin_b);
            cos_nearest = cos_light = trc_cos_less(cos_x, sin_x, cos_b, sin_b);
            limit = b->cos_e;
        }
        reaches = vm_or(within, vf_gt(cos_nearest, limit - vf_set(EDGE_SLACK)));
    }
    const vfloat cos_receiver = vf_select(r->has_n, v3_dot(r->n, w) + sin_b, vf_one());
    reaches = vm_and(reaches, vm_or(within, vf_gt(cos_receiver, vf_set(-EDGE_SLACK))));
    const vfloat factor =
        vf_clamp(cos_light, MIN_FACING, 1.0f) * vf_clamp(cos_receiver, MIN_FACING, 1.0f);
    return vf_where(reaches, b->intensity * factor * fade);
}

/* A sun or the world, if it is not apart: irradiance, over the horizon of n. */
TRC_INLINE vfloat trc_distant_importance(const struct trc_light_table *t, uint32_t i,
                                         const struct trc_receiver *r) {
    const vfloat irradiance = vf_set(t->distant_irradiance[i]);
    if (t->distant[i] == t->world_light)
        return irradiance;
    const struct trc_lamp *sun = &t->lamps[t->distant[i]];
    const vfloat cos_n = v3_dot(r->n, v3_set(sun->position));
    const vfloat sin_n = vf_safe_sqrt(vf_one() - cos_n * cos_n);
    const float sine = sqrtf(fmaxf(1.0f - sun->cos_cone * sun->cos_cone, 0.0f));
    vfloat cosine = trc_cos_less(cos_n, sin_n, vf_set(sun->cos_cone), vf_set(sine));
    cosine = vf_select(r->has_n, cosine, vf_one());
    const vmask reaches = vf_gt(cosine, vf_set(-EDGE_SLACK));
    return vf_where(reaches, irradiance * vf_max(cosine, vf_set(MIN_FACING)));
}

/* Candidates: the cut, then suns, then the world unless apart. */
TRC_INLINE uint32_t trc_candidate_count(const struct trc_light_table *t) {
    return t->cut_count + t->distant_count;
}
TRC_INLINE vfloat trc_candidate_importance(const struct trc_light_table *t, uint32_t i,
                                           const struct trc_receiver *r) {
    if (i >= t->cut_count)
        return trc_distant_importance(t, i - t->cut_count, r);
    const struct trc_light_bound *bound = &t->bounds[t->cut[i]];
    const struct trc_wide_bound b = trc_bound_broadcast(bound);
    return trc_bound_importance(&b, r, trc_shape_of(t, bound), bound->radius > 0.0f);
}

/* Takes the weight from candidates that do not light the receiver. Those that are not kept have it
 * still: what is chosen of them counts nothing. */
TRC_LINKS void trc_links_apply(const struct trc_light_table *t, const struct trc_receiver *r,
                               vfloat *weight, uint32_t count, vfloat *sum) {
    const uint32_t kept = count < TRC_LIGHT_CHOICES_KEPT ? count : TRC_LIGHT_CHOICES_KEPT;
    *sum = vf_zero();
    for (uint32_t i = 0; i < count; i++) {
        vfloat w = i < kept ? weight[i] : trc_candidate_importance(t, i, r);
        const uint32_t *excluded = NULL;
        if (i < t->cut_count)
            excluded = t->bounds[t->cut[i]].excluded;
        else if (t->distant[i - t->cut_count] != t->world_light)
            excluded = t->lamps[t->distant[i - t->cut_count]].excluded;
        if (i < kept && excluded)
            w = weight[i] = vf_where(
                vm_not(trc_is_unlit(vu_set(excluded[0]), vu_set(excluded[1]), r->sets)), w);
        *sum = *sum + w;
    }
}

/* ---- the tree ---- */

/* Lanes whose node has a light that lights the receiver. */
static inline vmask trc_node_lights(const struct trc_light_table *t, vint node,
                                    const struct trc_receiver *r, vmask m) {
    const vint at = node * vi_set(TRC_BOUND_WORDS);
    const vuint low = vu_gather(&t->bounds->excluded[0], at, m);
    const vuint high = vu_gather(&t->bounds->excluded[1], at, m);
    return vm_not(trc_is_unlit(low, high, r->sets));
}

/* Chance of the first child of each lane's node, as if both could be chosen; -1 where neither gives
 * anything. */
static inline vfloat trc_tree_first_chance(const struct trc_light_table *t, vint node, vint second,
                                           const struct trc_receiver *r, vmask m) {
    struct trc_wide_bound a, b;
    const vint lead = vi_set(vi_get(node, __builtin_ctz(vm_bits(m))));
    if (!vm_any(vm_andnot(m, vi_eq(node, lead)))) {
        /* Near the root lanes go together. */
        const struct trc_light_bound *parent = &t->bounds[vi_get(lead, 0)];
        a = trc_bound_broadcast(parent + 1);
        b = trc_bound_broadcast(&t->bounds[parent->child]);
    } else {
        a = trc_bound_gather(t->bounds, node + vi_set(1), m);
        b = trc_bound_gather(t->bounds, second, m);
    }
    vfloat ia = trc_bound_importance(&a, r, TRC_BOUND_CONE, true);
    vfloat ib = trc_bound_importance(&b, r, TRC_BOUND_CONE, true);
    if (t->linked) {
        ia = vf_where(trc_node_lights(t, node + vi_set(1), r, m), ia);
        ib = vf_where(trc_node_lights(t, second, r, m), ib);
    }
    const vfloat sum = ia + ib;
    return vf_select(vf_gt(sum, vf_zero()), ia / sum, vf_set(-1.0f));
}
TRC_INLINE vint trc_tree_second(const struct trc_light_table *t, vint node, vmask m) {
    return vi_select(m, vi_gather(&t->bounds->child, node * vi_set(TRC_BOUND_WORDS), m),
                     vi_set(-1));
}

/* From each lane's node to a light; u is used up on the way. chance gets multiplied; lanes that end
 * where no light reaches the point leave *found. */
static inline vint trc_tree_choose(const struct trc_light_table *t, const struct trc_receiver *r,
                                   vint node, vfloat u, vmask m, vfloat *chance, vmask *found) {
    *found = m;
    for (;;) {
        const vint second = trc_tree_second(t, node, *found);
        const vmask inner = vm_andnot(*found, vi_lt(second, vi_set(0)));
        if (!vm_any(inner))
            break;
        const vfloat first = trc_tree_first_chance(t, node, second, r, inner);
        *found = vm_andnot(*found, vm_and(inner, vf_lt(first, vf_zero())));
        const vmask go = vm_and(inner, *found);
        const vmask left = vf_lt(u, first);
        const vfloat other = vf_one() - first;
        vfloat rest = vf_select(left, vf_divide(u, first), vf_divide(u - first, other));
        rest = vf_min(vf_max(rest, vf_zero()), vf_set(TRC_BELOW_ONE));
        u = vf_select(go, rest, u);
        *chance = vf_select(go, *chance * vf_select(left, first, other), *chance);
        node = vi_select(go, vi_select(left, node + vi_set(1), second), node);
    }
    const vint light = vi_gather(&t->bounds->light, node * vi_set(TRC_BOUND_WORDS), *found);
    return vi_select(*found, light, vi_set(-1));
}

/* Chance with which trc_tree_choose arrives at the light from its candidate. */
static inline vfloat trc_tree_chance(const struct trc_light_table *t, const struct trc_receiver *r,
                                     vint light, vint candidate, vmask m) {
    vuint trail = vu_gather(t->trails, light, m);
    vint node = vi_gather((const int32_t *)t->cut, candidate, m);
    vfloat chance = vf_one();
    for (;;) {
        const vint second = trc_tree_second(t, node, m);
        const vmask inner = vm_andnot(m, vi_lt(second, vi_set(0)));
        if (!vm_any(inner))
            return chance;
        const vfloat first = trc_tree_first_chance(t, node, second, r, inner);
        const vmask to_second = vi_eq((vint)(trail & vu_set(1u)), vi_set(1));
        vfloat factor = vf_select(to_second, vf_one() - first, first);
        factor = vf_where(vf_ge(first, vf_zero()), factor);
        chance = vf_select(inner, chance * factor, chance);
        node = vi_select(inner, vi_select(to_second, second, node + vi_set(1)), node);
        trail = trail >> 1;
    }
}

/* ---- both ---- */

/* Chances of few candidates are whole sixteenths: numbers that are stratified in blocks of 16 then
 * give each light the same share of any block's samples, where a remainder would make a sample more
 * or less by chance. */
#define TRC_SHARED_CANDIDATES 8
#define TRC_SHARES 16.0f
/* Candidates due less than this part of a share keep their own small chance: a whole share would
 * take samples from lights that matter, and walk a tree of lights that do not. */
#define TRC_WEAK_SHARE 0.125f
static inline void trc_shares_round(vfloat *weight, uint32_t count, vfloat *sum) {
    const vfloat weak = *sum * vf_set(TRC_WEAK_SHARE / TRC_SHARES);
    const vfloat share = vf_divide(vf_set(TRC_SHARES), *sum);
    vfloat strong = vf_zero(), strong_count = vf_zero();
    for (uint32_t i = 0; i < count; i++) {
        const vmask is_strong = vf_gt(weight[i], weak);
        strong = strong + vf_where(is_strong, weight[i]);
        strong_count = strong_count + vf_where(is_strong, vf_one());
    }
    /* One each, the rest by weight. */
    const vfloat scale = vf_divide(vf_set(TRC_SHARES) - strong_count, strong);
    vfloat cumulative = vf_zero(), before = vf_zero(), total = vf_zero();
    for (uint32_t i = 0; i < count; i++) {
        const vmask is_strong = vf_gt(weight[i], weak);
        cumulative = cumulative + vf_where(is_strong, weight[i]);
        const vfloat upto = vf_floor(cumulative * scale + vf_set(0.5f));
        weight[i] = vf_select(is_strong, upto - before + vf_one(), weight[i] * share);
        before = vf_select(is_strong, upto, before);
        total = total + weight[i];
    }
    *sum = vf_where(vf_gt(*sum, vf_zero()), total);
}

static inline void trc_candidates_weigh(const struct trc_light_table *t,
                                        struct trc_light_choices *c) {
    const struct trc_receiver r = trc_receiver_make(c->p, c->n);
    const uint32_t count = t->single ? 0 : trc_candidate_count(t);
    c->sum = vf_zero();
    for (uint32_t i = 0; i < count; i++) {
        const vfloat w = trc_candidate_importance(t, i, &r);
        if (i < TRC_LIGHT_CHOICES_KEPT)
            c->kept[i] = w;
        c->sum = c->sum + w;
    }
    if (count <= TRC_SHARED_CANDIDATES)
        trc_shares_round(c->kept, count, &c->sum);
}

/* The same where lights are linked. */
TRC_LINKS void trc_candidates_weigh_linked(const struct trc_light_table *t,
                                           struct trc_light_choices *c) {
    struct trc_receiver r = trc_receiver_make(c->p, c->n);
    const uint32_t count = t->single ? 0 : trc_candidate_count(t);
    r.sets = c->sets;
    for (uint32_t i = 0; i < count && i < TRC_LIGHT_CHOICES_KEPT; i++)
        c->kept[i] = trc_candidate_importance(t, i, &r);
    trc_links_apply(t, &r, c->kept, count, &c->sum);
    if (count <= TRC_SHARED_CANDIDATES)
        trc_shares_round(c->kept, count, &c->sum);
}

_Static_assert(TRC_LIGHT_CHOICES_KEPT >= TRC_LIGHT_LIST_MAX, "what is not kept is distant");

/* A light for every lane of m, -1 where none reaches the point; its chance. */
static inline vint trc_light_choose(const struct trc_light_table *t,
                                    const struct trc_light_choices *c, const struct trc_receiver *r,
                                    vfloat u, vmask m, vfloat *chance) {
    const uint32_t count = trc_candidate_count(t);
    const vfloat sum = c->sum;
    vint light = vi_set(-1), node = vi_set(0);
    vfloat rest = u * sum, remainder = vf_zero();
    vmask waiting = vm_and(m, vf_gt(sum, vf_zero())), to_tree = vm_none();
    *chance = vf_zero();
    for (uint32_t i = 0; i < count && vm_any(waiting); i++) {
        const vfloat w = i < TRC_LIGHT_CHOICES_KEPT
                             ? c->kept[i]
                             : trc_distant_importance(t, i - t->cut_count, r);
        vmask take = vm_and(waiting, vf_gt(w, vf_zero()));
        if (i + 1 < count)
            take = vm_and(take, vf_lt(rest, w));
        const struct trc_light_bound *bound = i < t->cut_count ? &t->bounds[t->cut[i]] : NULL;
        if (bound && bound->child >= 0) {
            to_tree = vm_or(to_tree, take);
            remainder = vf_select(take, vf_divide(rest, w), remainder);
            node = vi_select(take, vi_set((int32_t)t->cut[i]), node);
        } else {
            const int32_t number = bound ? bound->light : (int32_t)t->distant[i - t->cut_count];
            light = vi_select(take, vi_set(number), light);
        }
        *chance = vf_select(take, w / sum, *chance);
        rest = rest - w;
        waiting = vm_andnot(waiting, take);
    }
    if (vm_any(to_tree)) {
        vmask found;
        const vint chosen = trc_tree_choose(t, r, node, remainder, to_tree, chance, &found);
        light = vi_select(to_tree, chosen, light);
    }
    return light;
}

/* Chance with which trc_light_choose gives the light (number per lane, a real one in lanes of
 * m). */
static inline vfloat trc_light_chance(const struct trc_light_table *t, const struct trc_receiver *r,
                                      vint light, vmask m) {
    if (t->single)
        return vf_one();
    const uint32_t count = trc_candidate_count(t);
    const vint candidate = vi_gather((const int32_t *)t->candidates, light, m);
    const bool shared = count <= TRC_SHARED_CANDIDATES;
    uint32_t kept = shared ? count : 0;
    vfloat weight[TRC_LIGHT_CHOICES_KEPT];
    vfloat sum = vf_zero(), own = vf_zero();
    if (t->linked)
        kept = count < TRC_LIGHT_CHOICES_KEPT ? count : TRC_LIGHT_CHOICES_KEPT;
    for (uint32_t i = 0; i < kept; i++) {
        weight[i] = trc_candidate_importance(t, i, r);
        sum = sum + weight[i];
    }
    if (t->linked)
        trc_links_apply(t, r, weight, count, &sum);
    if (shared)
        trc_shares_round(weight, count, &sum);
    for (uint32_t i = 0; i < count; i++) {
        vfloat w;
        if (i < kept) {
            w = weight[i];
        } else {
            w = trc_candidate_importance(t, i, r);
            if (!t->linked)
                sum = sum + w;
        }
        own = vf_select(vi_eq(candidate, vi_set((int32_t)i)), w, own);
    }
    vmask placed = vm_and(m, vi_lt(candidate, vi_set((int32_t)t->cut_count)));
    placed = vm_andnot(placed, vi_lt(candidate, vi_set(0)));
    if (t->trails && vm_any(placed))
        own = vf_select(placed, own * trc_tree_chance(t, r, light, candidate, placed), own);
    const vfloat chance = vf_divide(own, sum);
    return t->world_apart
               ? vf_select(vi_eq(light, vi_set((int32_t)t->world_light)), vf_one(), chance)
               : chance;
}

#endif
