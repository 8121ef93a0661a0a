/* Evaluating and sampling lobes.
 *
 * Where normals are bent, a direction that is sampled has other sides than one towards a light, as
 * in Cycles. What is sampled is reflected above the lobe's normal and the geometric surface, and
 * transmitted below the lobe's normal: near the silhouette of a smooth surface refraction may leave
 * on the side of the flat triangle it came from, and still has to go on. Towards a light the
 * shading normal has to agree, so that nothing shines through.
 *
 * Departures from Cycles 3.4: a sampled direction of a toon lobe fades as an evaluated one;
 * reflections are sampled by bounded visible normals, refractions by the spherical cap; densities
 * are the true ones, where Cycles gives clearcoat the density of GTR1 and samples GGX. What that
 * does to its pictures is kept in trc_bsdf_sample.indirect_scale. */
#include "kernels/lobe/facets.h"

/* Lanes in which wi may be reflected, and transmitted; as_sampled: those that count as
 * trc_bsdf_sample has them. */
struct sides {
    vmask above, below;
};
TRC_INLINE struct sides sides_of(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi,
                                 vmask active, vmask as_sampled) {
    const vfloat cos_n = v3_dot(s->n, wi), cos_g = v3_dot(s->ng, wi);
    const vmask over = vm_or(vf_gt(cos_g, vf_zero()), vm_andnot(l->below_horizon, as_sampled));
    const vmask up = vm_or(vf_gt(cos_n, vf_zero()), as_sampled);
    const vmask down = vm_or(vf_lt(cos_n, vf_zero()), as_sampled);
    return (struct sides){vm_and(active, vm_and(up, over)), vm_and(active, down)};
}

/* Lanes in which a lobe transmits wi. */
TRC_INLINE vmask through_lobe(const struct trc_lobe *lobe, vvec3 wi, vmask below) {
    return vm_and(below, vf_lt(v3_dot(lobe->n, wi), vf_zero()));
}

TRC_INLINE bool is_reflection(enum trc_lobe_kind kind) { return kind <= TRC_LOBE_REFLECT; }

TRC_INLINE bool is_hair(enum trc_lobe_kind kind) {
    return kind == TRC_LOBE_HAIR_REFLECT || kind == TRC_LOBE_HAIR_TRANSMIT;
}

/* What a shading offset leaves of light from wi: it comes as from further down, so it is gone
 * before the lobe's horizon (F. Beaune, appleseed, in the form of Cycles). */
static __attribute__((noinline)) vfloat turned_share(const struct trc_lobes *l, vvec3 n, vvec3 wi) {
    const vfloat cosine = vf_min(v3_dot(n, wi), vf_one());
    const vfloat turned = vf_max(vf_cos(vf_acos(cosine) * l->turn), vf_zero());
    const vmask bends = vm_and(vf_gt(l->turn, vf_one()), vf_gt(cosine, vf_zero()));
    return vf_select(bends, vf_divide(turned, cosine), vf_one());
}

TRC_INLINE struct lobe_value value_of(const struct trc_lobes *l, const struct trc_lobe *lobe,
                                      const struct trc_surface *s, vvec3 wi, vmask side,
                                      bool rare) {
    struct lobe_value r = lobe->model->value(lobe, s, wi);
    if (rare && (l->rare & TRC_LOBES_TURN) && is_reflection(lobe->kind))
        r.value = v3_scale(r.value, turned_share(l, lobe->n, wi));
    return value_where(side, r);
}

/* Of a lobe whose sampled directions have values of their own, in lanes where they count. */
static void take_sampled(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                         const struct trc_draw *draw, vmask lanes, struct lobe_value *r) {
    const struct lobe_value own = lobe->model->sampled(lobe, s, wi, draw);
    r->value = v3_select(lanes, own.value, r->value);
    r->pdf = vf_select(lanes, own.pdf, r->pdf);
    r->pick = vf_select(lanes, own.pick, r->pick);
    r->claim = vf_select(lanes, own.claim, r->claim);
}

/* Whether a lobe's light is in the passes of reflection; rare: as in sum_lobes. */
TRC_INLINE bool is_glossy(const struct trc_lobes *l, const struct trc_lobe *lobe, bool rare) {
    if (lobe->kind == TRC_LOBE_REFLECT)
        return !rare || !lobe->is_whole_glass;
    return rare && (lobe->kind == TRC_LOBE_HAIR_REFLECT ||
                    (lobe->kind == TRC_LOBE_VELVET && (l->rare & TRC_LOBES_VELVET)));
}

/* The same of transmission, of lobes that are not glossy. */
TRC_INLINE bool is_transmissive(const struct trc_lobe *lobe, bool rare) {
    return lobe->kind == TRC_LOBE_REFRACT ||
           (rare && (lobe->kind == TRC_LOBE_HAIR_TRANSMIT || lobe->is_whole_glass));
}

/* Active lanes in which a lobe may have light from wi. What is translucent and has a normal that
 * faces away transmits to the side that is seen, as in Cycles. */
TRC_INLINE vmask side_of(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                         struct sides sides, vmask active, bool rare) {
    if (is_reflection(lobe->kind))
        return sides.above;
    if (rare && is_hair(lobe->kind))
        return active;
    vmask below = sides.below;
    if (rare && lobe->kind == TRC_LOBE_TRANSLUCENT)
        below = vm_or(below, vm_and(active, vf_lt(v3_dot(lobe->n, s->n), vf_zero())));
    return through_lobe(lobe, wi, below);
}

/* rare: whether l has anything rare; a constant, so that others have no test of it. */
TRC_INLINE void sum_lobes(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi,
                          vmask active, vmask as_sampled, bool rare, struct trc_bsdf_value *out) {
    const struct sides sides = sides_of(l, s, wi, active, as_sampled);
    out->diffuse = out->glossy = out->transmission = v3_zero();
    out->pdf = vf_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const vmask side = side_of(lobe, s, wi, sides, active, rare);
        if (lobe->kind == TRC_LOBE_TRANSPARENT || !vm_any(side))
            continue;
        struct lobe_value r = value_of(l, lobe, s, wi, side, rare);
        if (rare && lobe->model->sampled && !is_hair(lobe->kind))
            take_sampled(lobe, s, wi, NULL, vm_and(side, as_sampled), &r);
        if (is_glossy(l, lobe, rare))
            out->glossy = v3_add(out->glossy, r.value);
        else if (is_transmissive(lobe, rare))
            out->transmission = v3_add(out->transmission, r.value);
        else
            out->diffuse = v3_add(out->diffuse, r.value);
        out->pdf = out->pdf + r.pdf * lobe->sample_weight;
    }
    out->pdf = vf_divide(out->pdf, l->continue_weight);
}

static __attribute__((noinline)) void sum_rare(const struct trc_lobes *l,
                                               const struct trc_surface *s, vvec3 wi, vmask active,
                                               vmask as_sampled, struct trc_bsdf_value *out) {
    sum_lobes(l, s, wi, active, as_sampled, true, out);
}

void trc_bsdf_eval(const struct trc_lobes *l, const struct trc_surface *s, vvec3 wi, vmask active,
                   vmask as_sampled, struct trc_bsdf_value *out) {
    if (l->rare)
        sum_rare(l, s, wi, active, as_sampled, out);
    else
        sum_lobes(l, s, wi, active, as_sampled, false, out);
}

/* Sums over the lobes for a sampled rough direction; chosen: the number of the lobe, draw: what it
 * was sampled by; both are read if rare, which is as above. */
TRC_INLINE void weigh_direction(const struct trc_lobes *l, const struct trc_surface *s,
                                vmask active, vint chosen, const struct trc_draw *draw, bool rare,
                                struct trc_bsdf_sample *out) {
    const struct sides sides = sides_of(l, s, out->wi, active, active);
    vvec3 value = v3_zero();
    vfloat pdf = vf_zero(), picked = vf_zero(), claimed = vf_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        const vmask side = side_of(lobe, s, out->wi, sides, active, rare);
        if (lobe->kind == TRC_LOBE_TRANSPARENT || !vm_any(side))
            continue;
        struct lobe_value r = value_of(l, lobe, s, out->wi, side, rare);
        if (rare && lobe->model->sampled)
            take_sampled(lobe, s, out->wi, draw, vm_and(side, vi_eq(chosen, vi_set(i))), &r);
        value = v3_add(value, r.value);
        pdf = pdf + r.pdf * lobe->sample_weight;
        claimed = claimed + r.claim * lobe->mix_weight;
        if (!trc_lobe_ends(lobe->kind))
            picked = picked + r.pick * lobe->mix_weight;
    }
    pdf = vf_divide(pdf, l->continue_weight);
    const vmask lit = vm_and(active, vf_gt(pdf, vf_zero()));
    out->pdf = vf_select(active, pdf, out->pdf);
    out->whole_pdf = vf_select(active, vf_divide(claimed, l->mix_weight), out->whole_pdf);
    out->weight = v3_select(active, v3_where(lit, v3_scale(value, vf_rcp(pdf))), out->weight);
    out->indirect_scale = vf_select(lit, vf_divide(picked, claimed), out->indirect_scale);
    out->valid = vm_or(vm_andnot(out->valid, active), vm_and(lit, vf_gt(v3_max(value), vf_zero())));
}

/* ---- sampling ---- */

/* Mirror direction or ideal refraction, with what the lobe gives there. Lanes that have none get
 * weight 0. */
static vvec3 ideal_direction(const struct trc_lobe *lobe, const struct trc_surface *s,
                             vvec3 *weight) {
    vvec3 wi;
    vmask good = vf_gt(lobe->cos_o, vf_zero());
    if (lobe->kind == TRC_LOBE_REFLECT) {
        wi = v3_reflect(s->wo, lobe->n);
        good = vm_and(good, vf_gt(v3_dot(s->ng, wi), vf_zero()));
    } else {
        good = vm_and(good, trc_refract(s->wo, lobe->n, lobe->ior, &wi));
    }
    *weight = v3_where(good, v3_mul(lobe->weight, facet_fresnel(lobe, lobe->cos_o)));
    return wi;
}

static void clear_sample(struct trc_bsdf_sample *out) {
    out->wi = v3(vf_zero(), vf_zero(), vf_one());
    out->weight = v3_zero();
    out->indirect_scale = vf_one();
    out->pdf = out->whole_pdf = vf_zero();
    out->valid = out->singular = out->transparent = out->transmitted = out->diffuse = vm_none();
    out->fibre = out->whole_glass = out->clear = out->through_portal = vm_none();
}

/* Lanes of m that a lobe lets through clearly where it refracts. */
TRC_INLINE vmask clear_lanes(const struct trc_lobes *l, const struct trc_lobe *lobe, vmask m) {
    const vmask smooth = vf_le(lobe->alpha_x * lobe->alpha_y, vf_set(l->clear_alpha2));
    return vm_and(m, vm_or(lobe->ideal, smooth));
}

/* Enters the ideal direction of a lobe in lanes m; chance: that it was chosen there. */
static void take_ideal(const struct trc_lobes *l, const struct trc_lobe *lobe,
                       const struct trc_surface *s, vmask m, vfloat chance,
                       struct trc_bsdf_sample *out) {
    vvec3 weight = lobe->weight;
    vvec3 wi = v3_neg(s->wo);
    if (lobe->kind == TRC_LOBE_TRANSPARENT)
        out->transparent = vm_or(out->transparent, m);
    else
        wi = ideal_direction(lobe, s, &weight);
    if ((l->rare & TRC_LOBES_TURN) && lobe->kind == TRC_LOBE_REFLECT)
        weight = v3_scale(weight, turned_share(l, lobe->n, wi));
    if (lobe->model->is_portal) {
        wi = lobe->f90;
        out->origin = v3_select(m, lobe->f0, out->origin);
        out->through_portal = vm_or(out->through_portal, m);
    }
    weight = v3_scale(weight, vf_divide(vf_one(), chance));
    out->wi = v3_select(m, wi, out->wi);
    out->weight = v3_select(m, weight, out->weight);
    out->singular = vm_or(out->singular, m);
    out->valid = vm_or(out->valid, vm_and(m, vf_gt(v3_max(v3_abs(weight)), vf_zero())));
}

/* Waiting lanes that choose the twin of a lobe, which samples for both; rest: what the lobe leaves
 * of their numbers; is_last: nothing is chosen after the twin. */
TRC_INLINE vmask twin_lanes(const struct trc_lobe *lobe, vmask waiting, vfloat rest, bool is_last) {
    if (!lobe->has_twin)
        return vm_none();
    const struct trc_lobe *twin = lobe + 1;
    vmask m = vm_and(waiting, vf_gt(twin->sample_weight, vf_zero()));
    if (!is_last)
        m = vm_and(m, vf_lt(rest, twin->sample_weight));
    return vm_andnot(m, vm_or(lobe->ideal, twin->ideal));
}

TRC_INLINE void sample_lobes(const struct trc_lobes *l, const struct trc_surface *s, vfloat u_lobe,
                             vfloat u1, vfloat u2, bool rare, struct trc_bsdf_sample *out) {
    clear_sample(out);
    vint chosen = vi_set(-1);
    struct trc_draw draw = {u1, u2, vf_zero()};
    vmask waiting = vm_and(s->active, vf_gt(l->continue_weight, vf_zero()));
    vmask rough = vm_none();
    vfloat rest = u_lobe * l->continue_weight;
    int last = -1;
    for (int i = 0; i < l->count; i++)
        if (!trc_lobe_ends(l->lobe[i].kind))
            last = i;
    for (int i = 0; i <= last; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (trc_lobe_ends(lobe->kind))
            continue;
        /* The last lobe takes what rounding left over, if it has any chance. */
        vmask m = vm_and(waiting, vf_gt(lobe->sample_weight, vf_zero()));
        if (i != last)
            m = vm_and(m, vf_lt(rest, lobe->sample_weight));
        const vfloat before = rest;
        rest = rest - lobe->sample_weight;
        waiting = vm_andnot(waiting, m);
        const vmask exact = vm_and(m, lobe->ideal);
        const vmask twin = twin_lanes(lobe, waiting, rest, i + 1 == last);
        waiting = vm_andnot(waiting, twin);
        m = vm_or(m, twin);
        if (!vm_any(m))
            continue;
        const vfloat chosen_at = vf_select(twin, rest, before);
        const vmask spread = vm_andnot(m, exact);
        if (lobe->kind != TRC_LOBE_REFLECT && lobe->kind != TRC_LOBE_TRANSPARENT)
            out->transmitted = vm_or(out->transmitted, exact);
        /* Reflection, too: of a pair either may cross the surface. */
        if (l->clear_alpha2 >= 0.0f && lobe->model->has_facets)
            out->clear = vm_or(out->clear, clear_lanes(l, lobe, m));
        if (lobe->kind == TRC_LOBE_TRANSLUCENT)
            out->diffuse = vm_or(out->diffuse, m);
        if (rare && lobe->is_whole_glass)
            out->whole_glass = vm_or(out->whole_glass, m);
        if (vm_any(exact))
            take_ideal(l, lobe, s, exact, lobe->sample_weight / l->continue_weight, out);
        if (vm_any(spread)) {
            vmask alive = spread, crosses = twin;
            const vvec3 wi =
                v3_normalize(lobe->model->direction(lobe, s, u1, u2, chosen_at, &alive, &crosses));
            out->wi = v3_select(spread, wi, out->wi);
            out->transmitted = vm_or(out->transmitted, crosses);
            const struct sides sides = sides_of(l, s, wi, alive, alive);
            rough =
                vm_or(rough, rare && is_hair(lobe->kind)
                                 ? alive
                                 : vm_select(crosses, through_lobe(lobe, wi, alive), sides.above));
            if (rare) {
                if (lobe->kind == TRC_LOBE_HAIR_REFLECT)
                    out->fibre = vm_or(out->fibre, spread);
                chosen = vi_select(spread, vi_select(twin, vi_set(i + 1), vi_set(i)), chosen);
                draw.chosen_at = vf_select(spread, chosen_at, draw.chosen_at);
            }
        }
    }
    if (vm_any(rough))
        weigh_direction(l, s, rough, chosen, &draw, rare, out);
}

static __attribute__((noinline)) void sample_rare(const struct trc_lobes *l,
                                                  const struct trc_surface *s, vfloat u_lobe,
                                                  vfloat u1, vfloat u2,
                                                  struct trc_bsdf_sample *out) {
    sample_lobes(l, s, u_lobe, u1, u2, true, out);
}

void trc_bsdf_sample(const struct trc_lobes *l, const struct trc_surface *s, vfloat u_lobe,
                     vfloat u1, vfloat u2, struct trc_bsdf_sample *out) {
    if (l->rare)
        sample_rare(l, s, u_lobe, u1, u2, out);
    else
        sample_lobes(l, s, u_lobe, u1, u2, false, out);
}

void trc_bsdf_ideal(const struct trc_lobes *l, int i, const struct trc_surface *s,
                    struct trc_bsdf_sample *out) {
    const struct trc_lobe *lobe = &l->lobe[i];
    clear_sample(out);
    if (lobe->kind != TRC_LOBE_REFLECT && lobe->kind != TRC_LOBE_REFRACT &&
        lobe->kind != TRC_LOBE_TRANSPARENT)
        return;
    if (lobe->kind == TRC_LOBE_REFRACT)
        out->transmitted = s->active;
    if (lobe->is_whole_glass)
        out->whole_glass = s->active;
    if (lobe->kind == TRC_LOBE_REFRACT && l->clear_alpha2 >= 0.0f)
        out->clear = clear_lanes(l, lobe, s->active);
    take_ideal(l, lobe, s, s->active, vf_one(), out);
}

/* What a lobe of Blender 4 gives back under light from everywhere, over its weight. Where the
 * factor goes to white with the angle, micro-normals count, of refraction with
 * TRC_PASSES_MEAN_REFRACTION, and the dip of metal does not; else it is that of the lobe's normal:
 * all as in Cycles. */
static vvec3 mean_fresnel(const struct trc_lobe *lobe, uint32_t pass_flags) {
    const vfloat alpha = vf_sqrt(lobe->alpha_x * lobe->alpha_y);
    const bool reflects = lobe->kind == TRC_LOBE_REFLECT;
    if (lobe->fresnel == TRC_FRESNEL_METAL)
        return v3_lerp(lobe->f0, v3_splat(vf_one()), trc_schlick_share(lobe->cos_o, alpha));
    if (lobe->fresnel != TRC_FRESNEL_BLEND ||
        !(reflects || pass_flags & TRC_PASSES_MEAN_REFRACTION))
        return facet_fresnel(lobe, lobe->cos_o);
    const vvec3 reflected =
        v3_lerp(lobe->f0, lobe->f90, trc_dielectric_share(lobe->cos_o, alpha, lobe->ior));
    return reflects ? reflected : v3_sub(v3_splat(vf_one()), reflected);
}

/* What Cycles' closure weighs, without the energy of further bounces that a weight has here. */
static vvec3 closure_weight(const struct trc_lobe *lobe) {
    return lobe->is_whole_glass ? lobe->f0 : v3_scale(lobe->weight, lobe->albedo_scale);
}

void trc_bsdf_albedo(const struct trc_lobes *l, uint32_t pass_flags, vvec3 albedo_out[3]) {
    for (int k = 0; k < 3; k++)
        albedo_out[k] = v3_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_TRANSPARENT)
            continue;
        const int k = is_transmissive(lobe, true) ? 2 : is_glossy(l, lobe, true);
        vvec3 albedo = closure_weight(lobe);
        if (lobe->correlated)
            albedo = v3_mul(albedo, mean_fresnel(lobe, pass_flags));
        albedo_out[k] = v3_add(albedo_out[k], albedo);
    }
}

static vvec3 normal_of(const struct trc_lobe *lobe, const struct trc_surface *s) {
    if (lobe->kind == TRC_LOBE_TRANSPARENT)
        return s->n;
    return lobe->model->normal ? lobe->model->normal(lobe, s->wo) : lobe->n;
}

/* How much a lobe's normal counts beside those of others. Glass is one closure: of its two lobes
 * the refracting one, which follows, counts. */
static vfloat normal_weight(const struct trc_lobes *l, int i) {
    const struct trc_lobe *lobe = &l->lobe[i], *next = i + 1 < l->count ? lobe + 1 : lobe;
    const bool is_half = lobe->kind == TRC_LOBE_REFLECT && next->kind == TRC_LOBE_REFRACT &&
                         next->fresnel != TRC_FRESNEL_NONE;
    if (is_half)
        return vf_zero();
    const vfloat mean = v3_average(closure_weight(lobe)); /* 0: no colour in passes, but a normal */
    return vf_select(vf_gt(mean, vf_zero()), mean, v3_average(lobe->weight));
}

vvec3 trc_lobes_normal(const struct trc_lobes *l, const struct trc_surface *s) {
    vvec3 n = v3_zero();
    for (int i = 0; i < l->count; i++)
        n = v3_mad(normal_of(&l->lobe[i], s), normal_weight(l, i), n);
    return v3_select(vf_gt(v3_dot(n, n), vf_zero()), v3_normalize(n), s->n);
}

vvec3 trc_lobe_feature(const struct trc_lobe *lobe, const struct trc_surface *s) {
    return lobe->model->is_strand ? lobe->tangent : normal_of(lobe, s);
}

vfloat trc_lobe_alpha(const struct trc_lobe *lobe) {
    if (!lobe->model->has_facets)
        return vf_one();
    return vf_select(lobe->ideal, vf_zero(), vf_sqrt(lobe->alpha_x * lobe->alpha_y));
}

vvec3 trc_lobe_albedo(const struct trc_lobe *lobe, vvec3 wo, uint32_t pass_flags) {
    const vvec3 albedo = closure_weight(lobe);
    if (lobe->model->mean)
        return v3_scale(albedo, lobe->model->mean(lobe));
    if (trc_lobe_ends(lobe->kind) || lobe->kind == TRC_LOBE_TRANSLUCENT || lobe->is_whole_glass)
        return albedo;
    return v3_mul(albedo, lobe->correlated ? mean_fresnel(lobe, pass_flags)
                                           : facet_fresnel(lobe, v3_dot(lobe->n, wo)));
}

vvec3 trc_lobes_diffuse(const struct trc_lobes *l, const struct trc_surface *s, vvec3 *normal_out) {
    vvec3 weight = v3_zero(), n = v3_zero();
    for (int i = 0; i < l->count; i++) {
        const struct trc_lobe *lobe = &l->lobe[i];
        if (lobe->kind == TRC_LOBE_DIFFUSE || lobe->kind == TRC_LOBE_TRANSLUCENT) {
            weight = v3_add(weight, lobe->weight);
            n = v3_mad(lobe->n, v3_average(lobe->weight), n);
        }
    }
    *normal_out = v3_select(vf_gt(v3_dot(n, n), vf_zero()), v3_normalize(n), s->n);
    return weight;
}

vvec3 trc_lobes_transparency(const struct trc_lobes *l) {
    vvec3 sum = v3_zero();
    for (int i = 0; i < l->count; i++)
        if (l->lobe[i].kind == TRC_LOBE_TRANSPARENT)
            sum = v3_add(sum, l->lobe[i].weight);
    return sum;
}

vvec3 trc_lobes_straight(const struct trc_lobes *l) {
    vvec3 sum = v3_zero();
    for (int i = 0; i < l->count; i++)
        if (l->lobe[i].kind == TRC_LOBE_TRANSPARENT && !l->lobe[i].model->is_portal)
            sum = v3_add(sum, l->lobe[i].weight);
    return sum;
}
