/* Continuation rays: N rays in, N rays out (Boulos et al. 2007, section 4.1). Distribution chooses
 * one lobe per ray from the sample sequence, where the camera looks up to two; Whitted follows
 * every lobe along its ideal direction. Diffuse lobes end here: their light is all in the light
 * samples. */
#include "kernels/program/hash.h"
#include "kernels/tile/light_split.h"
#include "kernels/tile/shade.h"
#include "kernels/trace/spawn.h"

/* Per channel. */
static vvec3 share_in(vvec3 part, vvec3 sum) {
    return v3(vf_divide(part.x, sum.x), vf_divide(part.y, sum.y), vf_divide(part.z, sum.z));
}

/* The diffuse lobes' share of what the lanes' rays bring, as a word: of rays that bounce for the
 * first time what lobes have in their direction, unless that is ideal; else as before. category: in
 * place, of first bounces; fibres reflect to all sides, some glass counts as transmission on both,
 * and their words may be of TRC_CATEGORY_MIXED. */
static vuint share_of(const struct trc_tile *t, const struct arrival *a,
                      const struct trc_surface *s, const struct trc_lobes *lobes,
                      const struct trc_bsdf_sample *b, vmask first, vmask ideal, vint *category) {
    const vuint before = word_column(t->work.w[TRC_RAY_SHARE], a);
    first = vm_andnot(first, b->transparent);
    const vmask rough = vm_andnot(first, ideal);
    if (!vm_any(rough))
        return before;
    struct trc_bsdf_value f;
    trc_bsdf_eval(lobes, s, b->wi, rough, rough, &f);
    const vvec3 sum = v3_add(f.diffuse, v3_add(f.glossy, f.transmission));
    const vvec3 share = share_in(f.diffuse, sum);
    vuint word = trc_share_pack(share);
    if (lobes->rare & (TRC_LOBES_HAIR | TRC_LOBES_WHOLE_GLASS)) {
        /* What fibres scatter to where no light sample would be taken has no value there. */
        const vmask unlit = vm_andnot(b->fibre, vf_gt(v3_max(sum), vf_set(0.0f)));
        const vmask glossy = vm_and(rough, vm_or(unlit, vf_gt(v3_max(f.glossy), vf_set(0.0f))));
        const vmask mixed = vm_and(glossy, vf_gt(v3_max(f.transmission), vf_set(0.0f)));
        const vuint both =
            trc_mixed_pack(share, share_in(f.glossy, sum), hash3(b->wi.x, b->wi.y, b->wi.z));
        word = (vuint)vi_select(mixed, (vint)both, (vint)word);
        *category = vi_select(glossy, vi_set(TRC_CATEGORY_GLOSSY), *category);
        *category = vi_select(mixed, vi_set(TRC_CATEGORY_MIXED), *category);
    }
    return (vuint)vi_select(first, (vint)word, (vint)before);
}

/* Appends the lanes' rays to a store. direction, weight factor, pdf (< 0: ideal). scale: that part
 * of the weight which makes a ray one of two. */
static void ray_append(struct trc_tile *t, struct trc_ray_store *to, const struct arrival *a,
                       const struct trc_surface *s, const struct trc_lobes *lobes,
                       const struct trc_bsdf_sample *b, vfloat scale, uint32_t material,
                       vmask active) {
    const trc_render_desc *desc = t->desc;
    const vmask transparent = b->transparent;
    const vmask straight = vm_andnot(transparent, b->through_portal);
    const vvec3 w = v3_select(straight, a->d, b->wi);
    vvec3 o = v3_select(straight, a->o, trc_spawn_origin(s, goes_out(s, b->wi)));
    const vvec3 n = v3_select(straight, a->n_from, a->receive_n);
    const vvec3 weight = v3_mul(v3_select(straight, a->found_weight, a->weight), b->weight);
    const vfloat indirect_scale = vf_select(straight, a->indirect_scale, b->indirect_scale);
    vfloat back = t->looks_back ? trc_spawn_look_back(s, o, b->wi, a->t) : vf_set(0.0f);
    vuint same_path = a->path;
    if (vm_any(b->through_portal)) {
        const vuint full = vu_set(TRC_PATH_PORTALS << TRC_PATH_PORTALS_SHIFT);
        const vmask counts =
            vm_andnot(b->through_portal, vi_eq((vint)(a->path & full), (vint)full));
        same_path =
            a->path + (vuint)vi_select(counts, vi_set(1 << TRC_PATH_PORTALS_SHIFT), vi_set(0));
        o = v3_select(b->through_portal, b->origin, o);
        back = vf_where(vm_not(b->through_portal), back);
    }
    const vfloat tmin = vf_select(straight, a->t, back);
    const vfloat old_far = column(t->work.f[TRC_RAY_TMAX], a);
    const vfloat tmax = vf_select(straight, old_far, vf_set(INFINITY));
    /* Portals end shadow rays: rays alone find what is behind them. */
    const vmask ideal = vm_or(b->singular, vf_le(b->pdf, vf_set(0.0f)));
    const vfloat pdf =
        vf_select(straight, a->pdf, vf_select(ideal, vf_set(-1.0f), b->pdf * a->chance));
    const vfloat min_pdf =
        vf_select(vm_or(transparent, ideal), a->min_pdf, vf_min(a->min_pdf, b->whole_pdf));

    const vuint one = vu_set(1);
    vuint depths = a->depths;
    const vuint by_kind =
        (vuint)vi_select(b->transmitted, vi_set(1 << TRC_DEPTH_TRANSMISSION_SHIFT),
                         vi_set(1 << TRC_DEPTH_GLOSSY_SHIFT));
    depths = depths + (vuint)vi_select(transparent, vi_set(1 << TRC_DEPTH_TRANSPARENT_SHIFT),
                                       (vint)(by_kind + one));
    const vmask over = vm_or(vm_or(vi_lt(vi_set((int32_t)desc->max_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_ALL_SHIFT)),
                                   vi_lt(vi_set((int32_t)desc->max_glossy_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_GLOSSY_SHIFT))),
                             vm_or(vi_lt(vi_set((int32_t)desc->max_transmission_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_TRANSMISSION_SHIFT)),
                                   vi_lt(vi_set((int32_t)desc->max_transparent_depth),
                                         (vint)trc_depth_of(depths, TRC_DEPTH_TRANSPARENT_SHIFT))));
    /* Transparent: the same path. Else a new kind, in the category of the first bounce. */
    const vuint category = a->path & vu_set(3u << TRC_PATH_CATEGORY_SHIFT);
    const vmask first =
        vi_eq((vint)category, vi_set(TRC_CATEGORY_CAMERA << TRC_PATH_CATEGORY_SHIFT));
    vint own = vi_select(vm_or(b->transmitted, b->whole_glass), vi_set(TRC_CATEGORY_TRANSMISSION),
                         vi_set(TRC_CATEGORY_GLOSSY));
    vuint share = vu_set(0);
    if (t->light_passes)
        share = share_of(t, a, s, lobes, b, first, ideal, &own);
    own = own << TRC_PATH_CATEGORY_SHIFT;
    vuint kind = (vuint)vi_select(b->transmitted, vi_set(TRC_VISIBLE_TRANSMISSION),
                                  vi_set(TRC_VISIBLE_GLOSSY | TRC_PATH_REFLECTED));
    kind = kind | (vuint)vi_select(ideal, vi_set(TRC_PATH_SINGULAR), vi_set(0));
    kind = kind | (vuint)vi_select(b->diffuse, vi_set(TRC_VISIBLE_DIFFUSE), vi_set(0));
    kind = kind | (vuint)vi_select(first, own, (vint)category);
    if (lobes->clear_alpha2 >= 0.0f) {
        const vuint straight_on = a->path & vu_set(TRC_PATH_TRANSPARENT_BACKGROUND);
        kind =
            kind | (vuint)vi_select(vm_and(b->clear, b->transmitted), (vint)straight_on, vi_set(0));
    }
    kind = kind |
           (a->path & vu_set(TRC_PATH_DATA_DONE | TRC_PATH_FEATURES | TRC_VISIBLE_UNBLOCKED |
                             TRC_PATH_PORTALS << TRC_PATH_PORTALS_SHIFT)) |
           vu_set(a->world_alone ? TRC_PATH_WORLD_ALONE : 0);
    vuint path = (vuint)vi_select(transparent, (vint)same_path, (vint)kind);
    path = path | (vuint)vi_select(over, vi_set(TRC_PATH_LAST), vi_set(0));

    vfloat path_length = vf_set(0.0f);
    if (t->measures_paths) {
        path_length = column(t->work.f[TRC_RAY_PATH_LENGTH], a);
        path_length = vf_select(straight, path_length, path_length + arrival_length(a));
    }
    if (t->scales_clamps)
        scale = scale * split_scale(t, a);
    const vfloat values[TRC_RAY_FLOATS] = {
        o.x,      o.y,      o.z, w.x,     w.y, w.z, tmin, tmax,           a->time,     weight.x,
        weight.y, weight.z, pdf, min_pdf, n.x, n.y, n.z,  indirect_scale, path_length, scale};
    vuint left = vu_set(0), strand[2] = {vu_set(0), vu_set(0)};
    if (t->remembers_left)
        left = (vuint)vi_select(transparent, (vint)word_column(t->work.w[TRC_RAY_LEFT], a),
                                s->instance);
    if (t->left)
        trc_strand_words(s, strand);
    const vuint words[TRC_RAY_WORDS] = {a->slot, path,  depths,    vu_set(material),
                                        left,    share, strand[0], strand[1]};
    trc_rays_append(to, values, words, vm_bits(active));
}

static void ray_push(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                     const struct trc_lobes *lobes, const struct trc_bsdf_sample *b,
                     uint32_t material, vmask active) {
    ray_append(t, &t->stack, a, s, lobes, b, vf_set(1.0f), material, active);
}

/* Lanes whose rays are worth tracing: Whitted prunes its tree where a ray would add next to nothing
 * (Boulos et al. 2007). */
static vmask attenuate(const struct trc_tile *t, const struct arrival *a,
                       const struct trc_bsdf_sample *b, vmask active) {
    const vfloat size = v3_max(v3_abs(v3_mul(a->weight, b->weight)));
    active = vm_and(active, is_light(size));
    if (t->desc->integrator == TRC_INTEGRATOR_DISTRIBUTION)
        return active;
    return vm_andnot(active, vf_lt(size, vf_set(t->desc->attenuation_cutoff)));
}

/* Russian roulette: in proportion to what the ray can bring to the picture, certain from a full
 * weight on. A matt surface with a weak gloss sends a ray now and then instead of always. The full
 * weight grows with the roughness: rough lobes find the mean of much, and light samples have the
 * most of their lights; what a narrow lobe finds its rays find alone, and then it is bright. Rays
 * between fibres find little that is new, and are the dearest. */
#define ROULETTE_FULL 0.25f
#define ROULETTE_FULL_HAIR 0.5f
#define ROULETTE_FULL_PER_ALPHA 0.4f
#define ROULETTE_FULL_IDEAL 0.02f
static vfloat full_weight_of(const struct trc_lobe *lobe) {
    const vfloat largest = vf_set(ROULETTE_FULL);
    if (lobe->kind >= TRC_LOBE_HAIR_REFLECT)
        return vf_set(ROULETTE_FULL_HAIR);
    if (lobe->kind != TRC_LOBE_REFLECT)
        return largest;
    const vfloat alpha = vf_where(vm_not(lobe->ideal), vf_min(lobe->alpha_x, lobe->alpha_y));
    return vf_max(vf_min(alpha * vf_set(ROULETTE_FULL_PER_ALPHA), largest),
                  vf_set(ROULETTE_FULL_IDEAL));
}

vfloat trc_bounce_chance(const struct trc_tile *t, const struct arrival *a,
                         const struct trc_lobes *lobes) {
    const vfloat one = vf_set(1.0f);
    if (t->desc->integrator != TRC_INTEGRATOR_DISTRIBUTION)
        return one;
    vfloat full = vf_zero(); /* times continue_weight */
    for (int i = 0; i < lobes->count; i++) {
        if (!trc_lobe_ends(lobes->lobe[i].kind))
            full = full + lobes->lobe[i].sample_weight * full_weight_of(&lobes->lobe[i]);
    }
    const vfloat brings = v3_max(v3_abs(a->weight)) * lobes->continue_weight;
    const vmask some = vf_gt(full, vf_zero());
    return vf_where(some, vf_min(vf_divide(brings * lobes->continue_weight, full), one));
}

/* Straight on through transparency alone, for rays that may not bounce any more. */
void trc_bounce_straight(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                         const struct trc_lobes *lobes, uint32_t material, vmask active) {
    struct trc_bsdf_sample b = {.wi = a->d,
                                .weight = trc_lobes_straight(lobes),
                                .indirect_scale = vf_set(1.0f),
                                .pdf = vf_set(0.0f),
                                .singular = vm_all_set(),
                                .transparent = vm_all_set(),
                                .transmitted = vm_none(),
                                .diffuse = vm_none(),
                                .clear = vm_none(),
                                .through_portal = vm_none(),
                                .valid = active};
    const vmask below = vi_lt((vint)trc_depth_of(a->depths, TRC_DEPTH_TRANSPARENT_SHIFT),
                              vi_set((int32_t)t->desc->max_transparent_depth + 1));
    active = attenuate(t, a, &b, vm_and(active, below));
    if (vm_any(active))
        ray_push(t, a, s, lobes, &b, material, active);
}

/* ---- what the camera sees through glass ----
 *
 * Whether a sample sees what glass reflects or what it refracts is the most of its noise. So hits
 * of the camera's rays may send two rays on: each lobe is followed this many times as often as if
 * one were chosen, at most always, with a weight that is less by as much. Refraction, which has the
 * most of the light, is nearly always there, at the price of some reflections more.
 *
 * Second rays wait until the paths of the first have ended: of a sample there is never more than
 * one ray in a step, so that its light is added up in one order, whatever else is in the batch. */
#define SPLIT_RAYS 2
#define SPLIT_RATE 1.5f

/* Part of the whole chance that a lobe has by itself. The two lobes of a pair are one choice. */
static vfloat split_part(const struct trc_lobes *lobes, const struct trc_lobe *lobe) {
    if (trc_lobe_ends(lobe->kind))
        return vf_zero();
    const vfloat part = vf_divide(lobe->sample_weight, lobes->continue_weight);
    if (lobe->kind == TRC_LOBE_REFRACT)
        return vf_where(vm_not(lobe->paired), part);
    return vf_select(lobe->paired, part + part, part);
}

/* Systematic sampling of the lobes, each with a stretch as long as the chance to be followed, by
 * the place x. Returns the lanes where there is a lobe. *u_lobe: what chooses it; *scale: on the
 * weight of its ray. */
static vmask split_choose(const struct trc_lobes *lobes, vfloat chance, vfloat x, vfloat *u_lobe,
                          vfloat *scale) {
    const vfloat one = vf_set(1.0f);
    vfloat begin = vf_zero(), before = vf_zero();
    vmask chosen = vm_none();
    *u_lobe = vf_zero();
    *scale = one;
    for (int i = 0; i < lobes->count; i++) {
        const vfloat part = split_part(lobes, &lobes->lobe[i]);
        const vfloat stretch = chance * vf_min(part * vf_set(SPLIT_RATE), one);
        const vmask here = vm_and(vf_ge(x, begin), vf_lt(x, begin + stretch));
        const vfloat at = before + vf_divide(x - begin, stretch) * part;
        *u_lobe = vf_select(here, vf_min(at, vf_set(TRC_BELOW_ONE)), *u_lobe);
        *scale = vf_select(here, vf_divide(part, stretch), *scale);
        chosen = vm_or(chosen, here);
        begin = begin + stretch;
        before = before + part;
    }
    return chosen;
}

static bool can_split(const struct trc_tile *t, const struct trc_lobes *lobes) {
    if (!t->splits || t->generation > 0)
        return false;
    int count = 0;
    for (int i = 0; i < lobes->count; i++)
        count += !trc_lobe_ends(lobes->lobe[i].kind);
    return count > 1;
}

static void split(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                  const struct trc_lobes *lobes, uint32_t material, const vfloat u[3],
                  vmask active) {
    for (int i = 0; i < SPLIT_RAYS; i++) {
        struct trc_bsdf_sample b;
        vfloat u_lobe, scale;
        const vfloat x = u[0] + vf_set((float)i);
        const vmask chosen = vm_and(active, split_choose(lobes, a->chance, x, &u_lobe, &scale));
        if (!vm_any(chosen))
            continue;
        trc_bsdf_sample(lobes, s, u_lobe, u[1], u[2], &b);
        b.weight = v3_scale(b.weight, scale);
        const vmask go = attenuate(t, a, &b, vm_and(chosen, b.valid));
        if (vm_any(go))
            ray_append(t, i ? &t->later : &t->stack, a, s, lobes, &b, scale * a->chance, material,
                       go);
    }
}

void trc_bounce(struct trc_tile *t, const struct arrival *a, const struct trc_surface *s,
                const struct trc_lobes *lobes, uint32_t material, vmask active) {
    struct trc_bsdf_sample b;
    if (t->desc->integrator == TRC_INTEGRATOR_WHITTED) {
        for (int i = 0; i < lobes->count; i++) {
            trc_bsdf_ideal(lobes, i, s, &b);
            const vmask go = attenuate(t, a, &b, vm_and(active, b.valid));
            if (vm_any(go))
                ray_push(t, a, s, lobes, &b, material, go);
        }
        return;
    }
    const uint32_t dimension = TRC_DIM_BOUNCE + t->generation * TRC_DIMS_PER_BOUNCE + TRC_DIM_LOBE;
    vfloat u[3];
    trc_samples(&t->sampler, a->pixel, a->sample, dimension, 3, 0, 1, u);
    if (can_split(t, lobes)) {
        split(t, a, s, lobes, material, u, active);
        return;
    }
    /* One stratified number for both choices: whether, and which lobe. */
    active = vm_and(active, vf_lt(u[0], a->chance));
    if (!vm_any(active))
        return;
    u[0] = vf_min(vf_divide(u[0], a->chance), vf_set(TRC_BELOW_ONE));
    trc_bsdf_sample(lobes, s, u[0], u[1], u[2], &b);
    b.weight = v3_scale(b.weight, vf_divide(vf_set(1.0f), a->chance));
    const vmask go = attenuate(t, a, &b, vm_and(active, b.valid));
    if (vm_any(go))
        ray_push(t, a, s, lobes, &b, material, go);
}
