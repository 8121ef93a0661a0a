/* Principled Hair: W. Huang, M. B. Hullin and J. Hanika, "A Microfacet-based Hair Scattering Model"
 * (2022): a rough dielectric cylinder of elliptical cross section, whose scales are tilted. Light
 * is reflected (R), goes through (TT), comes back from the far side (TRT), or goes on inside (the
 * rest), of which Chiang et al. (2016) sum up the series.
 *
 * Departures: where the paper integrates over the width of the strand and paths inside, a few are
 * drawn by random numbers of the shading point. The mean over shading points is the integral. As in
 * Cycles the rest is not the same in samples of lights and in sampled directions, and every density
 * counts as 1 where both are weighed against each other.
 *
 * Of its lobe the tangent is along the strand, alpha_x the roughness of the facets, alpha_y the
 * aspect ratio, roughness the tilt of the scales; g1_o and pair_tint the cosine and sine of the
 * longer axis in v3_frame of the tangent; multi_chance how far the ray passes the middle, over the
 * radius that it sees, -1 to 1, pdf_scale how far on both sides of that samples of lights go; f0
 * the absorption, f90 the factors of R, TT and TRT, multi_weight the albedo. */
#include "kernels/lobe/fibre.h"

#include "kernels/lobe/ggx_energy.h"
#include "kernels/lobe/microfacet.h"
#include "kernels/program/hash.h"

#define MIN_ASPECT 1e-2f
/* Of what light that grazes is divided by. */
#define MIN_COSINE 1e-6f
/* Of what is divided by the cosine to the flat surface, whose mean over the strand's width
 * converges slowly where that is grazed. */
#define MIN_RIM 0.02f
/* What rough facets let out at least, on average (Cycles). */
#define MIN_LEAVING 1e-5f

enum { PATH_R, PATH_TT, PATH_TRT, PATH_REST, PATH_COUNT };

/* Places of the width, and paths inside, that samples of lights are the mean of. */
#define PLACES 8

/* Random numbers of a shading point: for its place, for samples of lights, for a direction. */
enum { OF_PLACE, OF_LIGHTS, OF_DIRECTION };
struct numbers {
    vuint word;
};

static struct numbers numbers_of(const struct trc_surface *s, uint32_t use) {
    const vuint of_ray[] = {vf_as_uint(s->wo.x), vf_as_uint(s->wo.y), vf_as_uint(s->wo.z)};
    const vuint key[] = {vf_as_uint(s->p.x), vf_as_uint(s->p.y), vf_as_uint(s->p.z),
                         hash_words(3, of_ray)};
    return (struct numbers){vu_hash(hash_words(4, key) + vu_set(use))};
}

static vfloat next_number(struct numbers *n) {
    n->word = vu_hash(n->word + vu_set(0x9e3779b9u));
    return vf_min(hash_to_unit(n->word), vf_set(0x1.fffffep-1f));
}

/* ---- the strand ---- */

/* A point of the cross section is one of the unit circle, squeezed by aspect along y. */
struct fibre {
    vvec3 x, y, z; /* along the longer axis, the shorter one, the strand */
    vfloat aspect, sin_tilt, cos_tilt, alpha, ior;
};

static void fibre_of(const struct trc_lobe *lobe, struct fibre *f) {
    vvec3 a, b;
    f->z = lobe->tangent;
    v3_frame(f->z, &a, &b);
    f->x = v3_mad(a, lobe->g1_o, v3_scale(b, lobe->pair_tint));
    f->y = v3_cross(f->z, f->x);
    f->aspect = lobe->alpha_y;
    vf_sincos(lobe->roughness, &f->sin_tilt, &f->cos_tilt);
    f->alpha = lobe->alpha_x;
    f->ior = lobe->ior;
}

/* A place of the surface. */
struct place {
    vfloat qx, qy; /* of the circle */
    vvec3 flat, n; /* outside, without and with the tilt */
    vfloat arc;    /* length of the ellipse over that of the circle */
};

static struct place place_at(const struct fibre *f, vfloat qx, vfloat qy) {
    struct place at = {.qx = qx, .qy = qy};
    const vfloat x = qx * f->aspect;
    at.arc = vf_sqrt(x * x + qy * qy);
    const vfloat scale = vf_rcp(at.arc);
    at.flat = v3_mad(f->x, x * scale, v3_scale(f->y, qy * scale));
    at.n = v3_mad(at.flat, f->cos_tilt, v3_scale(f->z, f->sin_tilt));
    return at;
}

/* Where the ray met it; off: see above. */
static struct place first_place(const struct fibre *f, vvec3 wo, vfloat off) {
    const vfloat wx = v3_dot(f->x, wo) * f->aspect, wy = v3_dot(f->y, wo);
    const vfloat inverse = vf_rcp(vf_sqrt(vf_max(wx * wx + wy * wy, vf_set(1e-18f))));
    const vfloat depth = vf_safe_sqrt(vf_one() - off * off);
    return place_at(f, (wx * depth - wy * off) * inverse, (wy * depth + wx * off) * inverse);
}

/* Where the line from there in direction w meets the circle again, and what is left of light by
 * then. It is behind where w goes out; there facets see none of it. */
static struct place next_place(const struct fibre *f, struct place from, vvec3 w, vvec3 sigma,
                               vvec3 *left) {
    const vfloat ex = v3_dot(w, f->x), ey = v3_dot(w, f->y) / f->aspect;
    const vfloat along = from.qx * ex + from.qy * ey;
    const vfloat t = vf_divide(vf_set(-2.0f) * along, ex * ex + ey * ey), way = vf_abs(t);
    *left = v3(vf_exp(-sigma.x * way), vf_exp(-sigma.y * way), vf_exp(-sigma.z * way));
    return place_at(f, from.qx + t * ex, from.qy + t * ey);
}

/* ---- its facets ---- */

/* Light that comes from a direction meets facets about n, on its side of the surface. */
struct facets {
    vvec3 n, flat, from;
    vfloat cosine, lambda, alpha, ior;
    /* What both sides lose to masking is put back in proportion (E. Turquin, "Practical Multiple
     * Scattering Compensation for Microfacet Models", 2019). */
    vfloat gain;
    vmask met;
};

static vfloat lambda_of(vfloat alpha, vfloat cosine) {
    const vfloat c2 = vf_max(cosine * cosine, vf_set(MIN_COSINE * MIN_COSINE));
    return trc_ggx_lambda(alpha * alpha * vf_max(vf_one() - c2, vf_zero()) / c2);
}

static struct facets facets_at(const struct fibre *f, const struct place *at, bool inside,
                               vvec3 from) {
    struct facets e = {.alpha = f->alpha, .from = from};
    e.n = inside ? v3_neg(at->n) : at->n;
    e.flat = inside ? v3_neg(at->flat) : at->flat;
    e.ior = inside ? vf_rcp(f->ior) : f->ior;
    e.cosine = v3_dot(e.n, from);
    e.met = vf_gt(e.cosine, vf_zero());
    e.lambda = lambda_of(e.alpha, e.cosine);
    e.gain =
        vf_rcp(trc_correlated_glass_albedo(vf_max(e.cosine, vf_set(MIN_COSINE)), e.alpha, e.ior));
    return e;
}

/* One that the light sees. */
static vvec3 facet(const struct facets *e, vfloat u1, vfloat u2) {
    vvec3 a, b;
    v3_frame(e->n, &a, &b);
    const vvec3 o = v3_to_frame(e->from, a, b, e->n);
    return v3_from_frame(trc_ggx_sample(o, e->alpha, e->alpha, vf_one(), u1, u2), a, b, e->n);
}

static vvec3 random_facet(const struct facets *e, struct numbers *random) {
    const vfloat u = next_number(random);
    return facet(e, u, next_number(random));
}

/* What facets that the light sees let go in direction to. */
static vfloat unmasked(const struct facets *e, vvec3 to) {
    const vfloat lambda_to = lambda_of(e->alpha, v3_dot(e->n, to));
    return (vf_one() + e->lambda) / (vf_one() + e->lambda + lambda_to);
}

/* Density of facets, and masking of both directions. */
static vfloat facet_density(const struct facets *e, vvec3 m, vvec3 to) {
    const vvec3 across = v3_cross(e->n, m);
    const vfloat alpha2 = e->alpha * e->alpha, cosine = v3_dot(e->n, m);
    const vfloat d = trc_ggx_d(v3_dot(across, across) / alpha2, cosine, alpha2);
    const vfloat lambda_to = lambda_of(e->alpha, v3_dot(e->n, to));
    return vf_where(vf_gt(cosine, vf_zero()), d / (vf_one() + e->lambda + lambda_to));
}

/* Of light that is reflected to a direction, over what meets the strand; rim: how it lies to the
 * surface there. */
static vfloat reflected(const struct facets *e, vvec3 to, vfloat rim) {
    const vvec3 m = v3_normalize(v3_add(e->from, to));
    const vmask seen =
        vm_and(e->met, vm_and(vf_gt(rim, vf_zero()), vf_gt(v3_dot(e->flat, to), vf_zero())));
    const vfloat f = trc_fresnel_dielectric(v3_dot(e->from, m), e->ior);
    return vf_where(seen, vf_set(0.25f) * f * e->gain * facet_density(e, m, to) /
                              vf_max(rim, vf_set(MIN_RIM)));
}

/* Of light that goes through to a direction, over cosine (Walter et al. 2007, eq. 21 and 17). */
static vfloat refracted(const struct facets *e, vvec3 to) {
    vvec3 sum = v3_mad(to, e->ior, e->from);
    sum = v3_scale(sum, vf_copysign(vf_one(), v3_dot(sum, e->n)));
    const vfloat length2 = v3_dot(sum, sum);
    const vvec3 m = v3_normalize(sum);
    const vfloat cos_from = v3_dot(m, e->from), cos_to = v3_dot(m, to);
    const vmask passes =
        vm_and(e->met, vm_and(vf_gt(cos_from, vf_zero()), vf_lt(cos_to, vf_zero())));
    const vfloat jacobian = vf_divide(vf_abs(cos_from * cos_to) * e->ior * e->ior, length2);
    const vfloat part = vf_one() - trc_fresnel_dielectric(cos_from, e->ior);
    return vf_where(passes, part * e->gain * jacobian * facet_density(e, m, to));
}

/* Whether a facet and the flat surface face a direction. */
static vmask faces(const struct facets *e, vvec3 m, vvec3 w) {
    return vm_and(vf_gt(v3_dot(m, w), vf_zero()), vf_gt(v3_dot(e->flat, w), vf_zero()));
}

/* ---- samples of lights ---- */

static vfloat rest_variance(const struct fibre *f) { return vf_set(4.0f) * f->alpha; }

/* The sum of a geometric series, by channel. */
static vvec3 series(vvec3 first, vvec3 left, vfloat kept) {
    const vfloat one = vf_one();
    return v3(vf_divide(first.x, one - left.x * kept), vf_divide(first.y, one - left.y * kept),
              vf_divide(first.z, one - left.z * kept));
}

/* What goes on inside, of all directions. */
static vvec3 rest_of(vfloat passes, vfloat reflects, vvec3 left) {
    const vfloat out = vf_max(vf_one() - reflects, vf_set(MIN_LEAVING));
    const vvec3 thrice = v3_mul(left, v3_mul(left, left));
    return series(v3_scale(thrice, passes * reflects * reflects * out), left, vf_one() - out);
}

/* Its density, even around the strand, where the series is of the place that the light met; 2 / pi
 * of it (Cycles). */
static vfloat rest_density(const struct fibre *f, const struct place *at, vvec3 wo, vvec3 wi) {
    const vfloat sin_o = vf_clamp(v3_dot(f->z, wo), -1.0f, 1.0f);
    const vfloat sin_i = vf_clamp(v3_dot(f->z, wi), -1.0f, 1.0f), one = vf_one();
    const vfloat along = trc_along_strand(sin_i, vf_safe_sqrt(one - sin_i * sin_i), sin_o,
                                          vf_safe_sqrt(one - sin_o * sin_o), rest_variance(f));
    const vfloat rim = vf_max(v3_dot(at->flat, wo), vf_set(MIN_RIM)) * at->arc;
    return vf_set(0.5f * TRC_INV_PI * 2.0f * TRC_INV_PI) * along / rim;
}

/* All but R, by one path inside. */
static vvec3 inner_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                         const struct fibre *f, const struct place *at, const struct facets *entry,
                         vvec3 wi, struct numbers *random) {
    const vfloat one = vf_one(), rim = v3_dot(at->flat, s->wo);
    vvec3 w;
    const vvec3 m1 = random_facet(entry, random);
    vmask inside = vm_and(entry->met, trc_refract(entry->from, m1, entry->ior, &w));
    inside = vm_and(inside, vm_and(faces(entry, m1, entry->from), faces(entry, m1, v3_neg(w))));
    const vfloat cos_w = -v3_dot(entry->n, w);
    inside = vm_and(inside, vm_and(vf_gt(cos_w, vf_zero()), vf_gt(rim, vf_zero())));
    const vfloat passes = one - trc_fresnel_dielectric(v3_dot(entry->from, m1), entry->ior);
    const vfloat entering = passes * entry->gain * unmasked(entry, w);
    /* From what the facets see to what meets the strand. */
    const vfloat turned = entry->cosine / (vf_max(rim, vf_set(MIN_RIM)) * at->arc);

    vvec3 left, left_back;
    const struct place far_side = next_place(f, *at, w, lobe->f0, &left);
    const struct facets back = facets_at(f, &far_side, true, v3_neg(w));
    const vfloat through = refracted(&back, wi) * far_side.arc / cos_w;
    vvec3 sum = v3_scale(left, lobe->f90.y * through * entering * turned);

    if (vm_any(vf_gt(lobe->f90.z, vf_zero()))) {
        const vvec3 m2 = random_facet(&back, random);
        const vfloat reflects = trc_fresnel_dielectric(v3_dot(back.from, m2), back.ior);
        const vvec3 w2 = v3_reflect(back.from, m2);
        const vfloat cos_w2 = v3_dot(back.n, w2);
        const vmask again = vm_and(faces(&back, m2, back.from),
                                   vm_and(faces(&back, m2, w2), vf_gt(cos_w2, vf_zero())));
        const struct place near_side = next_place(f, far_side, w2, lobe->f0, &left_back);
        const struct facets out = facets_at(f, &near_side, true, v3_neg(w2));
        const vfloat returned = reflects * back.gain * unmasked(&back, w2) * refracted(&out, wi) *
                                near_side.arc * vf_divide(back.cosine, cos_w * cos_w2);
        const vmask leaves =
            vm_and(vf_lt(v3_dot(out.n, wi), vf_zero()), vf_lt(v3_dot(out.flat, wi), vf_zero()));
        const vvec3 twice =
            v3_scale(v3_mul(left, left_back), returned * entering * turned * lobe->f90.z);
        const vvec3 rest =
            v3_scale(rest_of(passes, reflects, left), rest_density(f, at, s->wo, wi));
        const vmask counts =
            vm_and(vf_gt(lobe->f90.z, vf_zero()), vf_gt(v3_dot(back.from, m2), vf_zero()));
        const vmask turns = vf_lt(v3_dot(w2, wi) * f->ior, one); /* total reflection */
        sum = v3_add(sum, v3_where(vm_and(counts, vm_and(again, leaves)), twice));
        sum = v3_add(sum, v3_where(vm_and(counts, vm_or(again, turns)), rest));
    }
    return v3_where(inside, sum);
}

static struct lobe_value value(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi) {
    struct fibre f;
    fibre_of(lobe, &f);
    struct numbers random = numbers_of(s, OF_LIGHTS);
    const vfloat one = vf_one(), part = vf_set(1.0f / PLACES);
    const vfloat low = vf_max(lobe->multi_chance - lobe->pdf_scale, -one);
    const vfloat width = vf_min(lobe->multi_chance + lobe->pdf_scale, one) - low;
    const bool goes_in = vm_any(vf_gt(lobe->f90.y + lobe->f90.z, vf_zero()));
    vvec3 sum = v3_zero();
    for (int i = 0; i < PLACES; i++) {
        const vfloat off = low + width * part * (vf_set((float)i) + next_number(&random));
        const struct place at = first_place(&f, s->wo, vf_clamp(off, -1.0f, 1.0f));
        const struct facets entry = facets_at(&f, &at, false, s->wo);
        const vfloat r = lobe->f90.x * reflected(&entry, wi, v3_dot(at.flat, s->wo));
        sum = v3_add(sum, v3_splat(r));
        if (goes_in)
            sum = v3_add(sum, inner_value(lobe, s, &f, &at, &entry, wi, &random));
    }
    return (struct lobe_value){v3_mul(lobe->weight, v3_scale(sum, part)), one, one, one};
}

static struct lobe_value sided_value(const struct trc_lobe *lobe, const struct trc_surface *s,
                                     vvec3 wi) {
    return value_where(trc_fibre_lit(lobe->tangent, s, wi), value(lobe, s, wi));
}

/* ---- sampled directions ---- */

/* A direction of each path, and what goes there. */
struct paths {
    vvec3 wi[PATH_COUNT], part[PATH_COUNT];
};

/* All directions alike around the strand. */
static vvec3 rest_direction(const struct fibre *f, vvec3 wo, struct numbers *random) {
    const vfloat sin_o = vf_clamp(v3_dot(f->z, wo), -1.0f, 1.0f), one = vf_one();
    const vfloat u1 = next_number(random), u2 = next_number(random);
    const vfloat sine = trc_along_strand_sampled(sin_o, vf_safe_sqrt(one - sin_o * sin_o),
                                                 rest_variance(f), u1, u2);
    vfloat sin_phi, cos_phi;
    vf_sincos_turns(next_number(random), &sin_phi, &cos_phi);
    const vvec3 around = v3_mad(f->x, cos_phi, v3_scale(f->y, sin_phi));
    return v3_mad(f->z, sine, v3_scale(around, vf_safe_sqrt(one - sine * sine)));
}

static void follow(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1, vfloat u2,
                   struct paths *out) {
    struct numbers random = numbers_of(s, OF_DIRECTION);
    struct fibre f;
    fibre_of(lobe, &f);
    const vfloat one = vf_one(), zero = vf_zero();
    const struct place at = first_place(&f, s->wo, lobe->multi_chance);
    const struct facets entry = facets_at(&f, &at, false, s->wo);
    const vvec3 m1 = facet(&entry, u1, u2);
    const vmask starts = vm_and(entry.met, faces(&entry, m1, entry.from));
    const vfloat reflects1 = trc_fresnel_dielectric(v3_dot(entry.from, m1), entry.ior);
    out->wi[PATH_R] = v3_reflect(entry.from, m1);
    const vfloat r = lobe->f90.x * reflects1 * entry.gain * unmasked(&entry, out->wi[PATH_R]);
    out->part[PATH_R] = v3_splat(vf_where(vm_and(starts, faces(&entry, m1, out->wi[PATH_R])), r));

    vvec3 w, left, left_back, leaves, leaves_back;
    vmask inside = vm_and(starts, trc_refract(entry.from, m1, entry.ior, &w));
    inside = vm_and(inside, faces(&entry, m1, v3_neg(w)));
    const struct place far_side = next_place(&f, at, w, lobe->f0, &left);
    const struct facets back = facets_at(&f, &far_side, true, v3_neg(w));
    const vvec3 m2 = random_facet(&back, &random);
    inside = vm_and(inside, vm_and(back.met, faces(&back, m2, back.from)));
    const vfloat reflects2 = trc_fresnel_dielectric(v3_dot(back.from, m2), back.ior);
    const vfloat entering = (one - reflects1) * entry.gain * unmasked(&entry, w);
    const vvec3 arriving = v3_scale(left, entering * back.gain);
    vmask passes = trc_refract(back.from, m2, back.ior, &leaves);
    passes = vm_and(passes, vm_and(vf_lt(v3_dot(back.n, leaves), zero),
                                   vf_lt(v3_dot(back.flat, leaves), zero)));
    out->wi[PATH_TT] = leaves;
    out->part[PATH_TT] =
        v3_where(vm_and(inside, passes),
                 v3_scale(arriving, lobe->f90.y * (one - reflects2) * unmasked(&back, leaves)));

    const vvec3 w2 = v3_reflect(back.from, m2);
    const struct place near_side = next_place(&f, far_side, w2, lobe->f0, &left_back);
    const struct facets exit = facets_at(&f, &near_side, true, v3_neg(w2));
    const vvec3 m3 = random_facet(&exit, &random);
    inside = vm_and(inside, exit.met);
    const vfloat reflects3 = trc_fresnel_dielectric(v3_dot(exit.from, m3), exit.ior);
    const vvec3 returning =
        v3_scale(v3_mul(arriving, left_back), reflects2 * exit.gain * unmasked(&back, w2));
    passes =
        vm_and(trc_refract(exit.from, m3, exit.ior, &leaves_back), faces(&exit, m3, exit.from));
    passes = vm_and(passes, vf_lt(v3_dot(exit.flat, leaves_back), zero));
    out->wi[PATH_TRT] = leaves_back;
    out->part[PATH_TRT] =
        v3_where(vm_and(inside, passes), v3_scale(returning, lobe->f90.z * (one - reflects3) *
                                                                 unmasked(&exit, leaves_back)));

    const vfloat out_mean =
        vf_max(one - vf_set(0.5f) * (reflects2 + reflects3), vf_set(MIN_LEAVING));
    const vvec3 mean = v3(vf_sqrt(left.x * left_back.x), vf_sqrt(left.y * left_back.y),
                          vf_sqrt(left.z * left_back.z));
    const vvec3 later = series(v3_scale(mean, out_mean), mean, one - out_mean);
    const vfloat turns = reflects3 * unmasked(&exit, v3_reflect(exit.from, m3));
    out->wi[PATH_REST] = rest_direction(&f, s->wo, &random);
    out->part[PATH_REST] = v3_where(inside, v3_mul(v3_scale(returning, turns), later));
}

/* The path that is chosen by its share of the light: where it goes, and its light over its chance.
 */
static vvec3 choose(const struct trc_lobe *lobe, const struct paths *p, vfloat chosen_at,
                    vvec3 *light) {
    vfloat sum = vf_zero();
    for (int i = 0; i < PATH_COUNT; i++)
        sum = sum + v3_average(p->part[i]);
    vfloat rest = vf_saturate(vf_divide(chosen_at, lobe->sample_weight)) * sum;
    vmask waiting = vm_all_set();
    vvec3 wi = p->wi[PATH_REST];
    *light = v3_zero();
    for (int i = 0; i < PATH_COUNT; i++) {
        const vfloat share = v3_average(p->part[i]);
        const vmask m = vm_and(waiting, vf_lt(rest, share));
        wi = v3_select(m, p->wi[i], wi);
        *light = v3_select(m, v3_scale(p->part[i], vf_divide(sum, share)), *light);
        waiting = vm_andnot(waiting, m);
        rest = rest - share;
    }
    return wi;
}

static vvec3 direction(const struct trc_lobe *lobe, const struct trc_surface *s, vfloat u1,
                       vfloat u2, vfloat chosen_at, vmask *alive, vmask *crosses) {
    struct paths p;
    follow(lobe, s, u1, u2, &p);
    vvec3 light;
    const vvec3 wi = choose(lobe, &p, chosen_at, &light);
    *crosses = vm_none();
    *alive = vm_and(*alive, vf_gt(v3_max(light), vf_zero()));
    return wi;
}

static struct lobe_value sampled(const struct trc_lobe *lobe, const struct trc_surface *s, vvec3 wi,
                                 const struct trc_draw *draw) {
    (void)wi;
    struct paths p;
    follow(lobe, s, draw->u1, draw->u2, &p);
    vvec3 light;
    choose(lobe, &p, draw->chosen_at, &light);
    const vfloat one = vf_one();
    return (struct lobe_value){v3_mul(lobe->weight, light), one, one, one};
}

/* ---- setting up ---- */

#define NUMBER(input) number(c, leaf, TRC_AT(HUANG_HAIR, input))
#define COLOUR(input) colour(c, leaf, TRC_AT(HUANG_HAIR, input))

static vvec3 albedo(const struct trc_lobe *lobe, vfloat cos_o) {
    (void)cos_o;
    return lobe->multi_weight;
}

/* Of a smooth strand that is round: R and all that follows it, by a geometric series. sin_o: along
 * it; cosine: where the ray meets it. */
static vvec3 albedo_of(const struct trc_lobe *lobe, vfloat sin_o, vfloat cosine) {
    const vfloat one = vf_one(), eta = lobe->ior;
    const vfloat f = trc_fresnel_dielectric(cosine, eta), sin_t = sin_o / eta;
    const vfloat cos_t = vf_safe_sqrt(one - (one - cosine * cosine) / (eta * eta));
    const vfloat way = vf_divide(vf_set(2.0f) * cos_t, one - sin_t * sin_t);
    const vfloat left[3] = {vf_exp(-lobe->f0.x * way), vf_exp(-lobe->f0.y * way),
                            vf_exp(-lobe->f0.z * way)};
    vfloat out[3];
    for (int k = 0; k < 3; k++)
        out[k] = vf_divide(left[k] - vf_set(2.0f) * f * left[k] + f, one - f * left[k]);
    return v3(out[0], out[1], out[2]);
}

static struct trc_strand_pigment pigment_of(const struct trc_setup *c, const struct trc_leaf *leaf,
                                            vfloat randomness) {
    const vfloat factor = vf_one() + randomness * vf_saturate(NUMBER(random_color));
    return (struct trc_strand_pigment){leaf->mode,   COLOUR(color),   COLOUR(absorption),
                                       COLOUR(tint), NUMBER(melanin), NUMBER(melanin_redness),
                                       factor};
}

/* Along the longer axis, of strands; of meshes across the ray. */
static vvec3 major_axis(const struct trc_setup *c, const struct trc_leaf *leaf, vvec3 z,
                        vmask on_strand) {
    const vvec3 wanted = v3_select(on_strand, COLOUR(major), v3_cross(z, c->s->wo));
    const vvec3 across = v3_sub(wanted, v3_scale(z, v3_dot(z, wanted)));
    /* As Cycles has it where there is none. */
    const vvec3 any = v3_cross(z, v3(z.z - z.y, z.x - z.z, z.y - z.x));
    const vmask given = vf_gt(v3_dot(across, across), vf_set(1e-12f));
    return v3_normalize(v3_select(given, across, any));
}

/* Where on the strand's width light is followed from. Camera rays see a part of it, as wide as a
 * pixel is, all others the whole. */
static void set_place(const struct trc_setup *c, const struct trc_leaf *leaf, struct trc_lobe *lobe,
                      vfloat off, vfloat radius) {
    const struct trc_surface *s = c->s;
    const vfloat pixel = vf_divide(vf_set(0.5f) * s->pixel, NUMBER(radius)), one = vf_one();
    vmask near = vm_and(vf_gt(NUMBER(radius), vf_zero()), vf_lt(pixel, radius));
    near = vm_and(near, vi_eq((vint)trc_depth_of(s->depths, TRC_DEPTH_ALL_SHIFT), vi_set(0)));
    struct numbers random = numbers_of(s, OF_PLACE);
    const vfloat anywhere = vf_set(2.0f) * next_number(&random) - one;
    const vfloat at = vf_clamp(vf_divide(off, radius), -1.0f, 1.0f);
    lobe->multi_chance = vf_select(near, at, anywhere);
    lobe->pdf_scale = vf_select(near, vf_divide(pixel, radius), vf_set(2.0f));
}

/* Cycles' normal: across the ray, of elliptical strands along the longer axis. */
static vvec3 normal(const struct trc_lobe *lobe, vvec3 wo) {
    struct fibre f;
    fibre_of(lobe, &f);
    return v3_select(vf_eq(f.aspect, vf_one()), v3_normalize(v3_cross(f.z, wo)), f.x);
}

static void add_huang_hair(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    static const struct trc_lobe_model model = {.kind = TRC_LOBE_HAIR_REFLECT,
                                                .is_strand = true,
                                                .normal = normal,
                                                .value = value,
                                                .sampled = sampled,
                                                .direction = direction};
    static const struct trc_lobe_model sided = {.kind = TRC_LOBE_HAIR_REFLECT,
                                                .is_strand = true,
                                                .normal = normal,
                                                .value = sided_value,
                                                .sampled = sampled,
                                                .direction = direction};
    const bool is_sided = c->material->flags & TRC_MATERIAL_FACET_SHADOWING;
    const struct trc_surface *s = c->s;
    const vfloat one = vf_one(), zero = vf_zero();
    vvec3 along = COLOUR(tangent), second;
    if (is_unlinked(c, leaf, TRC_AT(HUANG_HAIR, tangent)))
        trc_surface_sides(s, &along, &second);
    const vvec3 z = v3_normalize(along);
    const vmask on_strand = trc_on_strand(s);
    const vvec3 x = major_axis(c, leaf, z, on_strand);
    vfloat aspect = vf_max(NUMBER(aspect_ratio), vf_set(MIN_ASPECT));
    /* As Cycles: the axes stay as they are. */
    aspect = vf_select(vm_and(on_strand, vf_gt(aspect, one)), vf_rcp(aspect), aspect);

    /* How far the ray passes the middle, over the radius of the strand; and that of the ellipse. */
    const vvec3 across = v3_cross(z, s->wo);
    const vfloat inverse = vf_rcp(vf_sqrt(vf_max(v3_dot(across, across), vf_set(1e-18f))));
    const vfloat wx = v3_dot(x, s->wo) * inverse * aspect;
    const vfloat wy = v3_dot(v3_cross(z, x), s->wo) * inverse;
    const vfloat radius = vf_sqrt(wx * wx + wy * wy), off = v3_dot(s->ng, across) * inverse;
    /* To shadow rays strands are round (Cycles). */
    const vuint shadow = s->path & vu_set(TRC_VISIBLE_SHADOW);
    const vmask is_round = vm_not(vm_and(on_strand, vi_eq((vint)shadow, vi_set(0))));
    const vmask meets = vm_or(vf_lt(vf_abs(off), radius), is_round);
    if (vm_any(vm_andnot(s->active, meets)))
        trc_add_transparent(c, v3_splat(vf_where(vm_not(meets), weight)));
    struct trc_lobe *lobe =
        trc_add_lobe(c, is_sided ? &sided : &model, v3_splat(vf_where(meets, weight)));
    if (!lobe)
        return;
    c->out->rare |= TRC_LOBES_HAIR;
    lobe->n = trc_default_normal(c);
    lobe->cos_o = v3_dot(lobe->n, s->wo);
    lobe->tangent = z;
    vvec3 a, b;
    v3_frame(z, &a, &b);
    lobe->g1_o = v3_dot(x, a);
    lobe->pair_tint = v3_dot(x, b);
    set_place(c, leaf, lobe, off, radius);

    const vfloat randomness = vf_set(2.0f) * NUMBER(random) - one;
    const vfloat rough = NUMBER(roughness) * (one + randomness * NUMBER(random_roughness));
    lobe->alpha_x = vf_max(vf_clamp(rough, TRC_MIN_FIBRE_ROUGHNESS, 1.0f), c->filter_alpha);
    lobe->alpha_y = aspect;
    lobe->roughness = -NUMBER(offset);
    lobe->ior = vf_max(NUMBER(ior), vf_set(TRC_MIN_IOR));
    const struct trc_strand_pigment pigment = pigment_of(c, leaf, randomness);
    lobe->f0 = trc_absorption(&pigment, rough);
    lobe->f90 = v3(vf_max(NUMBER(reflection), zero), vf_max(NUMBER(transmission), zero),
                   vf_max(NUMBER(second_reflection), zero));
    /* Cycles has the place on the width of elliptical strands from their axes, not from the ray. */
    const vfloat sin_o = v3_dot(z, s->wo), up = vf_safe_sqrt(one - off * off);
    const vfloat turned = vf_abs(up * v3_dot(v3_cross(x, z), s->wo) - off * v3_dot(x, s->wo));
    const vmask is_elliptical = vm_andnot(on_strand, vf_eq(aspect, one));
    lobe->multi_weight = albedo_of(
        lobe, sin_o, vf_select(is_elliptical, turned, up * vf_safe_sqrt(one - sin_o * sin_o)));
    lobe->fresnel = TRC_FRESNEL_OWN;
    lobe->reflectance = albedo;
    lobe->correlated = true;
}
#undef NUMBER
#undef COLOUR

const struct trc_closure TRC_CLOSURE_OF(HUANG_HAIR) = {.add = add_huang_hair};
