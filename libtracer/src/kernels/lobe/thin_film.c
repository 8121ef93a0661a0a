/* Reflectance of dielectrics and metals under a thin film, by the interference of what its two
 * sides reflect.
 *
 * L. Belcour and P. Barla, "A Practical Extension to Microfacet Theory for the Modeling of Varying
 * Iridescence" (2017): Airy's sum as a series of path differences, each seen by colour channels as
 * the Fourier transform of their sensitivities (model/thin_film_table.h). As in Cycles from 4.2 on,
 * the series ends after three terms, the thinnest films fade away, and f0 tints what is reflected
 * less the more it is. Metals get a complex index from their colours: O. Gulbrandsen, "Artist
 * Friendly Metallic Fresnel" (2014), by that index the turn of the phase (M. Born and E. Wolf,
 * "Principles of Optics", 14.4.1), and how much they reflect by their colours. */
#include "kernels/lobe/facets.h"
#include "model/thin_film_table.h"

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

/* What a channel sees of exp(2 pi i difference / wavelength). */
struct film_wave {
    vfloat real, imaginary;
};

/* difference: nanometres. */
TRC_INLINE struct film_wave film_seen(const float table[2][TRC_THIN_FILM_SIZE], float carrier,
                                      vfloat difference) {
    vfloat x, sine, cosine;
    const vint at =
        trc_grid_cell(difference * vf_set(1.0f / TRC_THIN_FILM_REACH), TRC_THIN_FILM_SIZE, &x);
    vf_sincos_turns(difference * vf_set(1.0f / carrier), &sine, &cosine);
    const vfloat real = trc_grid_row(table[0], at, x), imaginary = trc_grid_row(table[1], at, x);
    return (struct film_wave){real * cosine - imaginary * sine, real * sine + imaginary * cosine};
}

/* What the channels of a scene see, from those of Rec.709. */
TRC_INLINE vfloat film_mix(const float row[3], vfloat red, vfloat green, vfloat blue) {
    return vf_set(row[0]) * red + vf_set(row[1]) * green + vf_set(row[2]) * blue;
}

static const float film_carriers[TRC_THIN_FILM_CHANNELS] = {TRC_THIN_FILM_RED, TRC_THIN_FILM_GREEN,
                                                            TRC_THIN_FILM_BLUE};

/* ---- dielectrics ---- */

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

/* cos_i: to the normal; thickness: nanometres; index, ior: of the film and of what is below over
 * that of what is above. */
static vvec3 film_fresnel(vfloat cos_i, vfloat thickness, vfloat index, vfloat ior,
                          const float *colors) {
    const struct film_side upper = film_side_of(vf_abs(cos_i), index);
    const struct film_side lower = film_side_of(upper.cosine, ior / index);
    const vfloat difference = (thickness + thickness) * index * upper.cosine;
    vvec3 seen[FILM_ORDERS];
    for (int m = 0; m < FILM_ORDERS; m++) {
        const vfloat d = difference * vf_set((float)(m + 1));
        seen[m] = v3(film_seen(trc_thin_film_table[0], film_carriers[0], d).real,
                     film_seen(trc_thin_film_table[1], film_carriers[1], d).real,
                     film_seen(trc_thin_film_table[2], film_carriers[2], d).real);
    }
    vvec3 mean = v3_scale(v3_add(film_sum(upper.across, lower.across, seen),
                                 film_sum(upper.along, lower.along, seen)),
                          vf_set(0.5f));
    if (colors)
        mean = v3(film_mix(colors, mean.x, mean.y, mean.z),
                  film_mix(colors + 3, mean.x, mean.y, mean.z),
                  film_mix(colors + 6, mean.x, mean.y, mean.z));
    return v3_select(vm_and(upper.passes, lower.passes), v3_saturate(mean), v3_splat(vf_one()));
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
    const vvec3 film = film_fresnel(cos_m, thickness, lobe->f90.y, lobe->ior, lobe->film_colors);
    const vvec3 tinted = v3(scaled(film.x, lobe->f0.x, own), scaled(film.y, lobe->f0.y, own),
                            scaled(film.z, lobe->f0.z, own));
    const vmask has_own = vf_gt(own, vf_set(MIN_OWN));
    return v3_select(vf_gt(thickness, vf_set(TRC_MIN_THIN_FILM)),
                     v3_saturate(v3_select(has_own, tinted, film)), bare);
}

/* ---- metals ---- */

/* Colours above that have no index. */
#define MAX_METAL_F0 0.999f

/* What a metal reflects of the light that comes through a film: the part, and the turn of its phase
 * across and along, as complex numbers of size 1. */
struct film_metal {
    vfloat part;
    struct film_wave across, along;
};

TRC_INLINE struct film_wave film_turn(vfloat real, vfloat imaginary) {
    const vfloat size = vf_sqrt(real * real + imaginary * imaginary);
    const vmask turns = vf_gt(size, vf_zero());
    return (struct film_wave){vf_select(turns, real / size, vf_one()),
                              vf_where(turns, imaginary / size)};
}

/* Of one channel. f0, dip: of trc_metal_fresnel; index: of the film; cosine: within it. */
static struct film_metal film_metal_of(vfloat f0, vfloat dip, vfloat index, vfloat cosine) {
    const vfloat one = vf_one(), two = vf_set(2.0f), half = vf_set(0.5f);
    const vfloat r = vf_min(f0, vf_set(MAX_METAL_F0)), root = vf_sqrt(r);
    const vfloat edge = trc_metal_fresnel(f0, dip, vf_set(TRC_METAL_EDGE));
    const vfloat n = vf_lerp((one + root) / (one - root), (one - r) / (one + r), edge);
    const vfloat k2 = vf_max((r * vf_square(n + one) - vf_square(n - one)) / (one - r), vf_zero());
    /* Seen from within the film it reflects less. */
    const vfloat m = n / index, m2 = k2 / (index * index);
    const vfloat inner = (vf_square(m - one) + m2) / (vf_square(m + one) + m2);
    struct film_metal metal;
    metal.part = trc_metal_fresnel(inner, trc_metal_dip(inner, edge), cosine);
    /* Square of the refracted wave's component along the normal: (u + iv)^2. */
    const vfloat real = n * n - k2 - index * index * (one - cosine * cosine);
    const vfloat imaginary = two * n * vf_sqrt(k2);
    const vfloat size = vf_sqrt(real * real + imaginary * imaginary);
    const vfloat u2 = half * vf_max(size + real, vf_zero());
    const vfloat v2 = half * vf_max(size - real, vf_zero());
    const vfloat u = vf_sqrt(u2), v = vf_sqrt(v2), c = index * cosine;
    metal.across = film_turn(c * c - u2 - v2, -two * c * v);
    metal.along = film_turn(vf_square((n * n + k2) * cosine) - index * index * (u2 + v2),
                            two * c * (imaginary * u - (n * n - k2) * v));
    return metal;
}

/* As film_sum, of one channel and a phase that turns as it likes. */
TRC_INLINE vfloat film_metal_sum(vfloat upper, vfloat lower2, struct film_wave turn,
                                 const struct film_wave seen[FILM_ORDERS]) {
    const vfloat one = vf_one(), upper2 = upper * upper;
    const vfloat through = one - upper2;
    const vfloat again = through * through * lower2 / (one - upper2 * lower2);
    const vfloat size = -upper * vf_sqrt(lower2);
    const struct film_wave step = {size * turn.real, size * turn.imaginary};
    struct film_wave factor = {(again - through) * vf_set(2.0f), vf_zero()};
    vfloat sum = upper2 + again;
    for (int m = 0; m < FILM_ORDERS; m++) {
        const vfloat real = factor.real * step.real - factor.imaginary * step.imaginary;
        factor.imaginary = factor.real * step.imaginary + factor.imaginary * step.real;
        factor.real = real;
        sum = sum + real * seen[m].real - factor.imaginary * seen[m].imaginary;
    }
    return sum;
}

/* What the channels see of each order. */
static void film_metal_seen(const struct trc_lobe *lobe, const struct film_side *upper,
                            struct film_wave seen[TRC_THIN_FILM_CHANNELS][FILM_ORDERS]) {
    const vfloat difference = (lobe->roughness + lobe->roughness) * lobe->ior * upper->cosine;
    for (int m = 0; m < FILM_ORDERS; m++) {
        struct film_wave w[TRC_THIN_FILM_CHANNELS];
        for (int c = 0; c < TRC_THIN_FILM_CHANNELS; c++)
            w[c] = film_seen(trc_thin_film_table[c], film_carriers[c],
                             difference * vf_set((float)(m + 1)));
        for (int c = 0; c < TRC_THIN_FILM_CHANNELS; c++) {
            const float *row = lobe->film_colors ? lobe->film_colors + 3 * c : NULL;
            seen[c][m] = w[c];
            if (row) {
                seen[c][m].real = film_mix(row, w[0].real, w[1].real, w[2].real);
                seen[c][m].imaginary =
                    film_mix(row, w[0].imaginary, w[1].imaginary, w[2].imaginary);
            }
        }
    }
}

static vfloat film_metal_channel(const struct trc_lobe *lobe,
                                 const struct film_wave seen[FILM_ORDERS], vfloat f0, vfloat dip,
                                 const struct film_side *upper) {
    const struct film_metal lower = film_metal_of(f0, dip, lobe->ior, upper->cosine);
    const vfloat sum = film_metal_sum(upper->across, lower.part, lower.across, seen) +
                       film_metal_sum(upper->along, lower.part, lower.along, seen);
    return vf_select(upper->passes, vf_saturate(vf_set(0.5f) * sum), vf_one());
}

static vvec3 film_metal_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    const struct film_side upper = film_side_of(vf_abs(cos_m), lobe->ior);
    const vvec3 f0 = lobe->f0, dip = lobe->f90;
    struct film_wave seen[TRC_THIN_FILM_CHANNELS][FILM_ORDERS];
    film_metal_seen(lobe, &upper, seen);
    const vvec3 film = v3(film_metal_channel(lobe, seen[0], f0.x, dip.x, &upper),
                          film_metal_channel(lobe, seen[1], f0.y, dip.y, &upper),
                          film_metal_channel(lobe, seen[2], f0.z, dip.z, &upper));
    const vvec3 bare =
        v3(trc_metal_fresnel(f0.x, dip.x, cos_m), trc_metal_fresnel(f0.y, dip.y, cos_m),
           trc_metal_fresnel(f0.z, dip.z, cos_m));
    return v3_select(vf_gt(lobe->roughness, vf_set(TRC_MIN_THIN_FILM)), film, bare);
}

/* ---- setting up ---- */

static const float *film_colors_of(const struct trc_setup *c) {
    return c->material->has_film_colors ? c->material->film_colors : NULL;
}

/* The film of a leaf, whose thickness is input number at and whose index is the next: the lanes
 * that have one. */
static vmask film_of(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                     vfloat above, float whole, vfloat *thickness, vfloat *index) {
    if (!may_exceed_zero(c, leaf, at))
        return vm_none();
    *thickness = number(c, leaf, at);
    const vfloat ior = vf_max(number(c, leaf, at + 1), vf_set(TRC_MIN_IOR)) / above;
    const vfloat part = vf_saturate(*thickness * vf_set(1.0f / whole));
    *index = vf_lerp(vf_one(), ior, part * part * (vf_set(3.0f) - part - part));
    return vm_and(c->s->active, vf_gt(*thickness, vf_set(TRC_MIN_THIN_FILM)));
}

vmask trc_thin_film_cover(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                          vfloat above, float whole, struct trc_fresnel *fresnel) {
    vfloat thickness, index;
    const vmask covered = film_of(c, leaf, at, above, whole, &thickness, &index);
    if (vm_any(covered)) {
        fresnel->kind = TRC_FRESNEL_OWN;
        fresnel->reflectance = film_reflectance;
        fresnel->film_colors = film_colors_of(c);
        fresnel->f90 = v3(thickness, index, vf_zero());
    }
    return covered;
}

vmask trc_thin_film_cover_metal(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                                float whole, struct trc_lobe *lobe) {
    vfloat thickness, index;
    const vmask covered = film_of(c, leaf, at, vf_one(), whole, &thickness, &index);
    if (vm_any(covered)) {
        lobe->fresnel = TRC_FRESNEL_OWN;
        lobe->reflectance = film_metal_reflectance;
        lobe->film_colors = film_colors_of(c);
        lobe->roughness = thickness;
        lobe->ior = index;
    }
    return covered;
}
