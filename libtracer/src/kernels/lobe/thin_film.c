/* Reflectance of a dielectric under a thin film, by the interference of what its two sides reflect.
 *
 * L. Belcour and P. Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
 * Iridescence" (2017): Airy's sum as a series of path differences, each seen by colour channels as
 * the Fourier transform of their sensitivities (model/thin_film_table.h). As in Cycles from 4.2 on,
 * the series ends after three terms, films much thinner than wavelengths fade away, and f0 tints
 * what is reflected less the more it is. */
#include "kernels/lobe/facets.h"
#include "model/thin_film_table.h"

/* Nanometres from which waves interfere in full. */
#define WHOLE_FILM 30.0f
/* Reflectance head-on up to which a dielectric has none that a tint could scale. */
#define MIN_OWN 1e-5f
/* Differences of paths that count: once, twice, three times that of the film. */
#define FILM_ORDERS 3

/* Amplitudes that an interface reflects of both polarisations, and the cosine behind it. */
struct film_side {
    vmask passes; /* else all is reflected */
    vfloat across, along, cosine;
};

TRC_INLINE struct film_side film_side_of(vfloat cosine, vfloat eta) {
    struct film_side r;
    const vfloat sine2 = (vf_one() - cosine * cosine) / (eta * eta);
    r.passes = vf_lt(sine2, vf_one());
    r.cosine = vf_safe_sqrt(vf_one() - sine2);
    const vfloat behind = eta * r.cosine, before = eta * cosine;
    r.across = vf_divide(cosine - behind, cosine + behind);
    r.along = vf_divide(before - r.cosine, before + r.cosine);
    return r;
}

/* What a channel sees of cos(2 pi difference / wavelength); difference in nanometres. */
TRC_INLINE vfloat film_seen(const float table[2][TRC_THIN_FILM_SIZE], float carrier,
                            vfloat difference) {
    vfloat x, sine, cosine;
    const vint at =
        trc_grid_cell(difference * vf_set(1.0f / TRC_THIN_FILM_REACH), TRC_THIN_FILM_SIZE, &x);
    vf_sincos_turns(difference * vf_set(1.0f / carrier), &sine, &cosine);
    return trc_grid_row(table[0], at, x) * cosine - trc_grid_row(table[1], at, x) * sine;
}

/* Of one polarisation: what the upper and the lower side reflect, what channels see of each order.
 */
TRC_INLINE vvec3 film_sum(vfloat upper, vfloat lower, const vvec3 seen[FILM_ORDERS]) {
    const vfloat one = vf_one(), upper2 = upper * upper, lower2 = lower * lower;
    const vfloat through = one - upper2;
    const vfloat again = through * through * lower2 / (one - upper2 * lower2);
    /* Light that is reflected within has the upper side's amplitude turned around. */
    const vfloat step = -upper * lower;
    vfloat factor = (again - through) * vf_set(2.0f);
    vvec3 sum = v3_splat(upper2 + again);
    for (int m = 0; m < FILM_ORDERS; m++) {
        factor = factor * step;
        sum = v3_mad(seen[m], factor, sum);
    }
    return sum;
}

/* cos_i: to the normal; thickness: nanometres; film_ior, ior: of the film and of what is below over
 * that of what is above. */
static vvec3 film_fresnel(vfloat cos_i, vfloat thickness, vfloat film_ior, vfloat ior) {
    const vfloat one = vf_one();
    const vfloat part = vf_saturate(thickness * vf_set(1.0f / WHOLE_FILM));
    const vfloat fade = part * part * (vf_set(3.0f) - part - part);
    const vfloat index = vf_lerp(one, film_ior, fade);
    const struct film_side upper = film_side_of(vf_abs(cos_i), index);
    const struct film_side lower = film_side_of(upper.cosine, ior / index);
    const vfloat difference = (thickness + thickness) * index * upper.cosine;
    vvec3 seen[FILM_ORDERS];
    for (int m = 0; m < FILM_ORDERS; m++) {
        const vfloat d = difference * vf_set((float)(m + 1));
        seen[m] = v3(film_seen(trc_thin_film_table[0], TRC_THIN_FILM_RED, d),
                     film_seen(trc_thin_film_table[1], TRC_THIN_FILM_GREEN, d),
                     film_seen(trc_thin_film_table[2], TRC_THIN_FILM_BLUE, d));
    }
    const vvec3 mean = v3_scale(v3_add(film_sum(upper.across, lower.across, seen),
                                       film_sum(upper.along, lower.along, seen)),
                                vf_set(0.5f));
    return v3_select(vm_and(upper.passes, lower.passes), v3_saturate(mean), v3_splat(one));
}

/* What a channel reflects under a film, scaled as f0 is to the dielectric's own: in full where both
 * reflect alike, not at all where everything is reflected. */
TRC_INLINE vfloat scaled(vfloat film, vfloat f0, vfloat own) {
    const vfloat one = vf_one(), near = vf_saturate((one - film) / (one - own));
    return film * vf_lerp(one, f0 / own, near);
}

static vvec3 film_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    const vfloat thickness = lobe->f90.x, own = trc_fresnel_normal(lobe->ior);
    const vvec3 bare = v3_lerp(lobe->f0, v3_splat(vf_one()), trc_fresnel_blend(cos_m, lobe->ior));
    const vvec3 film = film_fresnel(cos_m, thickness, lobe->f90.y, lobe->ior);
    const vvec3 tinted = v3(scaled(film.x, lobe->f0.x, own), scaled(film.y, lobe->f0.y, own),
                            scaled(film.z, lobe->f0.z, own));
    const vmask has_own = vf_gt(own, vf_set(MIN_OWN));
    return v3_select(vf_gt(thickness, vf_set(TRC_MIN_THIN_FILM)),
                     v3_saturate(v3_select(has_own, tinted, film)), bare);
}

void trc_thin_film_cover(struct trc_fresnel *fresnel, vfloat thickness, vfloat ior) {
    fresnel->kind = TRC_FRESNEL_OWN;
    fresnel->reflectance = film_reflectance;
    fresnel->f90 = v3(thickness, ior, vf_zero());
}
