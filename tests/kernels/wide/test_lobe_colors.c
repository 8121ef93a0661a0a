/* Colours of Principled's lobes: what tints make of reflections, and what layers leave for those
 * below them. Ratios of two settings, which formulas of a line tell. */
#include <complex.h>

#include "bsdf_test.h"

/* For the observer's spectrum alone. */
#pragma GCC diagnostic ignored "-Wunused-function"
#include "kernels/program/table.h"

static const float tint[3] = {0.9f, 0.5f, 0.2f};

static float channel(vvec3 a, int c) { return vf_get(c == 0 ? a.x : c == 1 ? a.y : a.z, 0); }

/* Reflection of light from the mirror direction, so that the normal is the micro-normal. */
static vvec3 mirrored(struct model *m, double cosine) {
    struct trc_surface s;
    struct trc_lobes l;
    struct trc_bsdf_value v;
    prepare(m, direction(cosine, 0.0), &s, &l);
    trc_bsdf_eval(&l, &s, direction(cosine, M_PI), vm_all_set(), vm_none(), &v);
    return v.glossy;
}

/* Weight of the diffuse lobe seen at that cosine: the last one, below sheen. */
static vvec3 diffuse_weight(struct model *m, double cosine) {
    struct trc_surface s;
    struct trc_lobes l;
    prepare(m, direction(cosine, 0.3), &s, &l);
    for (int i = l.count - 1; i >= 0; i--)
        if (l.lobe[i].kind == TRC_LOBE_DIFFUSE)
            return l.lobe[i].weight;
    fail_msg("there is no diffuse lobe");
    return v3_zero();
}

static void expect_ratio(const char *what, vvec3 found, vvec3 whole, const double want[3]) {
    for (int c = 0; c < 3; c++) {
        const double ratio = (double)channel(found, c) / (double)channel(whole, c);
        if (!(fabs(ratio - want[c]) <= 1e-4 * fmax(want[c], 1.0)))
            fail_msg("%s, channel %d: %.5f, not %.5f", what, c, ratio, want[c]);
    }
}

/* Blender 3.4: the hue is the colour over .3 red, .6 green and .1 blue. */
static void specular_tint_is_the_hue(void **state) {
    (void)state;
    struct model plain = principled("plain"), tinted = principled("tinted");
    const double bright = 0.3 * (double)tint[0] + 0.6 * (double)tint[1] + 0.1 * (double)tint[2];
    for (int k = 1; k <= 2; k++) {
        const double amount = 0.5 * k;
        double want[3];
        set3(&plain, TRC_AT(PRINCIPLED, base_color), tint[0], tint[1], tint[2]);
        set3(&tinted, TRC_AT(PRINCIPLED, base_color), tint[0], tint[1], tint[2]);
        set(&tinted, TRC_AT(PRINCIPLED, specular_tint), (float)amount);
        for (int c = 0; c < 3; c++)
            want[c] = 1.0 - amount + amount * (double)tint[c] / bright;
        expect_ratio("specular tint", mirrored(&tinted, 1.0), mirrored(&plain, 1.0), want);
    }
}

/* Blender 4: the tint of metal is whole where the cosine is 1/7, and nothing at the normal. */
static void metals_have_their_tint_at_the_edge(void **state) {
    (void)state;
    struct model plain = layered_metal(TRC_DISTRIBUTION_GGX, 0.5f), tinted = plain;
    const double none[3] = {1.0, 1.0, 1.0},
                 whole[3] = {(double)tint[0], (double)tint[1], (double)tint[2]};
    set3(&plain, TRC_AT(LAYERED_PRINCIPLED, base_color), 0.7f, 0.6f, 0.5f);
    set3(&tinted, TRC_AT(LAYERED_PRINCIPLED, base_color), 0.7f, 0.6f, 0.5f);
    set3(&tinted, TRC_AT(LAYERED_PRINCIPLED, specular_tint), tint[0], tint[1], tint[2]);
    expect_ratio("at the normal", mirrored(&tinted, 1.0), mirrored(&plain, 1.0), none);
    expect_ratio("at the edge", mirrored(&tinted, 1.0 / 7.0), mirrored(&plain, 1.0 / 7.0), whole);
}

/* Blender 4: a layer takes as much from all channels as its strongest one reflects. */
static void layers_darken_by_their_strongest_channel(void **state) {
    (void)state;
    static const double same[3] = {1.0, 1.0, 1.0};
    static const double cosines[] = {1.0, 0.5, 0.2};
    for (int k = 0; k < 3; k++) {
        struct model white = layered("white sheen", TRC_DISTRIBUTION_GGX, 0.5f), red = white;
        set(&white, TRC_AT(LAYERED_PRINCIPLED, sheen_weight), 1.0f);
        set(&red, TRC_AT(LAYERED_PRINCIPLED, sheen_weight), 1.0f);
        set3(&red, TRC_AT(LAYERED_PRINCIPLED, sheen_tint), 1.0f, 0.1f, 0.0f);
        const vvec3 below_white = diffuse_weight(&white, cosines[k]);
        expect_ratio("below sheen", diffuse_weight(&red, cosines[k]), below_white, same);
        struct model bare = layered("bare", TRC_DISTRIBUTION_GGX, 0.5f);
        assert_true(channel(below_white, 0) <
                    0.99f * channel(diffuse_weight(&bare, cosines[k]), 0));
        struct model blue = bare;
        set3(&blue, TRC_AT(LAYERED_PRINCIPLED, specular_tint), 0.0f, 0.0f, 1.0f);
        expect_ratio("below gloss", diffuse_weight(&blue, cosines[k]),
                     diffuse_weight(&bare, cosines[k]), same);
    }
}

/* The tint of a coat is that of light that goes straight down; from the side its way is longer, as
 * the coat's index bends it. */
static void coats_tint_by_the_way_through_them(void **state) {
    (void)state;
    for (int k = 0; k < 4; k++) {
        const double cosine = 1.0 - 0.28 * k, index = 1.5;
        const double way = 1.0 / sqrt(1.0 - (1.0 - cosine * cosine) / (index * index));
        double want[3];
        struct model white = layered("white coat", TRC_DISTRIBUTION_GGX, 0.5f);
        set(&white, TRC_AT(LAYERED_PRINCIPLED, coat_weight), 1.0f);
        struct model tinted = white;
        set3(&tinted, TRC_AT(LAYERED_PRINCIPLED, coat_tint), tint[0], tint[1], tint[2]);
        for (int c = 0; c < 3; c++)
            want[c] = pow((double)tint[c], way);
        expect_ratio("below a coat", diffuse_weight(&tinted, cosine),
                     diffuse_weight(&white, cosine), want);
    }
}

/* What one polarisation reflects at a wavelength: Airy's formula from the amplitudes of both sides,
 * at phase between waves that differ by one way through the film and back. */
static double airy(double upper, complex double lower, double phase) {
    const complex double below = lower * cexp(I * phase);
    return pow(cabs((upper + below) / (1.0 + upper * below)), 2.0);
}

/* Of unpolarised light, by the channels of Rec.709, integrated over the observer's spectrum; an
 * even one is white. upper, lower: amplitudes across and along, these of each channel; path: of the
 * second wave, nanometres. */
static void film_reflectance(const double upper[2], complex double lower[3][2], double path,
                             double rgb[3]) {
    static const double to_rgb[3][3] = {{3.2404542, -1.5371385, -0.4985314},
                                        {-0.9692660, 1.8760108, 0.0415560},
                                        {0.0556434, -0.2040259, 1.0572252}};
    static const double white[3] = {0.9504700, 1.0, 1.0888300};
    for (int c = 0; c < 3; c++) {
        double seen[3] = {0, 0, 0}, all[3] = {0, 0, 0}, sum = 0.0;
        for (int i = 0; i < 8 * (CIE_COUNT - 1); i++) {
            const int low = i / 8;
            const double part = (double)(i % 8) / 8.0;
            const double wavelength = (double)CIE_FIRST + (double)CIE_STEP * (low + part);
            const double phase = 2.0 * M_PI * path / wavelength;
            const double r =
                0.5 * (airy(upper[0], lower[c][0], phase) + airy(upper[1], lower[c][1], phase));
            for (int k = 0; k < 3; k++) {
                const double weight = (1.0 - part) * (double)cie_observer[low][k] +
                                      part * (double)cie_observer[low + 1][k];
                seen[k] += weight * r;
                all[k] += weight;
            }
        }
        for (int k = 0; k < 3; k++)
            sum += to_rgb[c][k] * white[k] * seen[k] / all[k];
        rgb[c] = fmin(fmax(sum, 0.0), 1.0);
    }
}

/* Amplitudes that an interface between two indices reflects, across and along. */
static void amplitudes(complex double above, complex double below, double cosine,
                       complex double r[2]) {
    const complex double before = above * cosine;
    const complex double after = csqrt(below * below - above * above * (1.0 - cosine * cosine));
    r[0] = (before - after) / (before + after);
    r[1] = (below * below * before - above * above * after) /
           (below * below * before + above * above * after);
}

/* The film's upper side and the cosine within. */
static double film_top(double cosine, double film, double upper[2]) {
    complex double r[2];
    amplitudes(1.0, film, cosine, r);
    for (int k = 0; k < 2; k++)
        upper[k] = creal(r[k]);
    return sqrt(1.0 - (1.0 - cosine * cosine) / (film * film));
}

static void dielectric_under_film(double cosine, double thickness, double film, double ior,
                                  double rgb[3]) {
    double upper[2];
    complex double lower[3][2];
    const double within = film_top(cosine, film, upper);
    for (int c = 0; c < 3; c++)
        amplitudes(film, ior, within, lower[c]);
    film_reflectance(upper, lower, 2.0 * film * thickness * within, rgb);
}

/* A film on a dielectric, of several thicknesses and indices; thinner than 30 nm it fades away. */
static void films_interfere(void **state) {
    (void)state;
    static const double thicknesses[] = {15.0, 120.0, 300.0, 550.0, 1100.0};
    static const double films[] = {1.33, 1.8, 2.4}, cosines[] = {1.0, 0.6, 0.25};
    const double ior = 1.5;
    double worst = 0.0, least = 1.0, most = 0.0;
    for (int n = 0; n < 5 * 3 * 3; n++) {
        const double thickness = thicknesses[n / 9], film = films[n / 3 % 3],
                     cosine = cosines[n % 3];
        struct model plain = layered("bare", TRC_DISTRIBUTION_GGX, 0.3f), filmed = plain;
        set(&filmed, TRC_AT(LAYERED_PRINCIPLED, film_thickness), (float)thickness);
        set(&filmed, TRC_AT(LAYERED_PRINCIPLED, film_ior), (float)film);
        const double x = fmin(thickness / 30.0, 1.0), fade = x * x * (3.0 - 2.0 * x);
        double want[3], bare[3];
        dielectric_under_film(cosine, thickness, 1.0 + (film - 1.0) * fade, ior, want);
        dielectric_under_film(cosine, 0.0, 1.0, ior, bare);
        const vvec3 with = mirrored(&filmed, cosine), without = mirrored(&plain, cosine);
        for (int c = 0; c < 3; c++) {
            const double found = bare[c] * (double)channel(with, c) / (double)channel(without, c);
            worst = fmax(worst, fabs(found - want[c]));
            least = fmin(least, found / bare[c]);
            most = fmax(most, found / bare[c]);
        }
    }
    print_message("films: off by at most %.1e; %.2f to %.2f times what the bare surface reflects\n",
                  worst, least, most);
    assert_true(worst <= 2e-3);
    assert_true(least < 0.5 && most > 3.0);
}

/* The metal of Principled: Schlick's approximation and its dip, given by the reflectance at the
 * edge. */
static double metal(double f0, double at_edge, double cosine) {
    const double edge = 1.0 / 7.0, rest = 1.0 - edge;
    const double dip = (f0 + (1.0 - f0) * pow(rest, 5.0) - at_edge) / (edge * pow(rest, 6.0));
    const double s = 1.0 - cosine;
    return fmin(fmax(f0 + (1.0 - f0) * pow(s, 5.0) - dip * cosine * pow(s, 6.0), 0.0), 1.0);
}

/* Its phase is that of a complex index that reflects f0 head-on, its amplitude what it reflects
 * seen from within the film. */
static void metal_under_film(double cosine, double thickness, double film, const double f0[3],
                             const double at_edge[3], double rgb[3]) {
    double upper[2];
    complex double lower[3][2];
    const double within = film_top(cosine, film, upper);
    for (int c = 0; c < 3; c++) {
        const double root = sqrt(f0[c]), g = at_edge[c];
        const double n =
            (1.0 - g) * (1.0 + root) / (1.0 - root) + g * (1.0 - f0[c]) / (1.0 + f0[c]);
        const double k = sqrt((f0[c] * pow(n + 1.0, 2.0) - pow(n - 1.0, 2.0)) / (1.0 - f0[c]));
        const complex double index = n + I * k;
        amplitudes(film, index, within, lower[c]);
        const double inner = pow(cabs((index - film) / (index + film)), 2.0);
        for (int p = 0; p < 2; p++)
            lower[c][p] *= sqrt(metal(inner, g, within)) / cabs(lower[c][p]);
    }
    film_reflectance(upper, lower, 2.0 * film * thickness * within, rgb);
}

/* The kernel ends the series after three terms, which metals that are grazed feel. */
static void films_interfere_on_metals(void **state) {
    (void)state;
    static const double thicknesses[] = {120.0, 300.0, 550.0};
    static const double films[] = {1.33, 1.8}, cosines[] = {1.0, 0.8, 0.6};
    static const double edges[3] = {0.9, 0.7, 0.5};
    const double f0[3] = {(double)tint[0], (double)tint[1], (double)tint[2]};
    double at_edge[3], worst = 0.0, least = 1.0;
    for (int c = 0; c < 3; c++)
        at_edge[c] = edges[c] * (f0[c] + (1.0 - f0[c]) * pow(6.0 / 7.0, 5.0));
    for (int n = 0; n < 3 * 2 * 3; n++) {
        const double thickness = thicknesses[n / 6], film = films[n / 3 % 2],
                     cosine = cosines[n % 3];
        struct model plain =
            layered_metal(TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_FILMED_METAL, 0.3f);
        set3(&plain, TRC_AT(LAYERED_PRINCIPLED, base_color), tint[0], tint[1], tint[2]);
        set3(&plain, TRC_AT(LAYERED_PRINCIPLED, specular_tint), (float)edges[0], (float)edges[1],
             (float)edges[2]);
        struct model filmed = plain;
        set(&filmed, TRC_AT(LAYERED_PRINCIPLED, film_thickness), (float)thickness);
        set(&filmed, TRC_AT(LAYERED_PRINCIPLED, film_ior), (float)film);
        double want[3];
        metal_under_film(cosine, thickness, film, f0, at_edge, want);
        const vvec3 with = mirrored(&filmed, cosine), without = mirrored(&plain, cosine);
        for (int c = 0; c < 3; c++) {
            const double ratio = (double)channel(with, c) / (double)channel(without, c);
            worst = fmax(worst, fabs(ratio * metal(f0[c], at_edge[c], cosine) - want[c]));
            least = fmin(least, ratio);
        }
    }
    print_message("films on metals: off by at most %.1e; down to %.2f times the bare metal\n",
                  worst, least);
    assert_true(worst <= 5e-3);
    assert_true(least < 0.5);
}

/* Blender 3.4: glass that scatters more than once has one colour in its passes, all of it of the
 * light that goes through; without bounces between facets it has what the others have. */
static void multiple_glass_transmits_its_color(void **state) {
    (void)state;
    const double white[3] = {1.0, 1.0, 1.0};
    for (int i = 0; i < 3; i++) {
        struct model m = glass(TRC_DISTRIBUTION_MULTI_GGX, 0.2f + 0.3f * (float)i, 1.45f, false);
        set3(&m, TRC_AT(GLASS, color), 0.8f, 0.8f, 0.8f);
        struct trc_surface s;
        struct trc_lobes l;
        vvec3 albedo[3];
        prepare(&m, direction(0.7, 0.3), &s, &l);
        trc_bsdf_albedo(&l, 0, albedo);
        assert_true(vf_get(v3_max(albedo[0]), 0) == 0.0f);
        assert_true(vf_get(v3_max(albedo[1]), 0) == 0.0f);
        expect_ratio("colour of the transmission", albedo[2], v3_splat(vf_set(0.8f)), white);
    }
}

/* From within, at an index of 1.5, all is reflected below a cosine of .745: there Blender 4 has no
 * colour of refraction, 3.4 has. */
static void refraction_has_no_color_beyond_the_critical_angle(void **state) {
    (void)state;
    for (int i = 0; i < 4; i++) {
        const bool is_inside = i & 1, is_correlated = i & 2;
        const uint32_t mode =
            TRC_DISTRIBUTION_GGX | (is_correlated ? TRC_DISTRIBUTION_CORRELATED : 0);
        const double cosines[] = {0.7, 0.8};
        for (int k = 0; k < 2; k++) {
            struct model m = refraction(mode, 0.3f, 1.5f);
            struct trc_surface s;
            struct trc_lobes l;
            vvec3 albedo[3];
            m.back = is_inside;
            prepare(&m, direction(cosines[k], 0.3), &s, &l);
            trc_bsdf_albedo(&l, 0, albedo);
            assert_true(channel(albedo[2], 0) ==
                        (is_inside && is_correlated && k == 0 ? 0.0f : 1.0f));
        }
    }
}

/* Colours of rough glass from Blender 4 on: what its micro-normals do not reflect goes through,
 * from 5 on in passes, too; before, what its normal does not. Denoisers' albedo is both. */
static void rough_glass_passes_on_what_it_does_not_reflect(void **state) {
    (void)state;
    for (int i = 0; i < 3; i++) {
        const uint32_t mode = TRC_DISTRIBUTION_GGX | TRC_DISTRIBUTION_CORRELATED;
        struct model m = glass(mode, 0.3f + 0.3f * (float)i, 1.45f, false);
        struct trc_surface s;
        struct trc_lobes l;
        vvec3 at_normal[3], on_average[3];
        prepare(&m, direction(0.4, 0.3), &s, &l);
        trc_bsdf_albedo(&l, 0, at_normal);
        trc_bsdf_albedo(&l, TRC_PASSES_MEAN_REFRACTION, on_average);
        assert_true(channel(at_normal[1], 0) == channel(on_average[1], 0));
        assert_float_equal(channel(on_average[1], 0) + channel(on_average[2], 0), 1.0f, 1e-6f);
        assert_true(fabsf(channel(at_normal[1], 0) + channel(at_normal[2], 0) - 1.0f) > 2e-3f);
        vvec3 sum = v3_zero();
        for (int k = 0; k < l.count; k++)
            sum = v3_add(sum, trc_lobe_albedo(&l.lobe[k], s.wo, TRC_PASSES_MEAN_REFRACTION));
        assert_float_equal(channel(sum, 0), 1.0f, 1e-6f);
        sum = v3_zero();
        for (int k = 0; k < l.count; k++)
            sum = v3_add(sum, trc_lobe_albedo(&l.lobe[k], s.wo, 0));
        assert_float_equal(channel(sum, 0), channel(at_normal[1], 0) + channel(at_normal[2], 0),
                           1e-6f);
    }
}

/* ---- hair ---- */

/* Chiang et al. 2016, equation 9: what a strand of that roughness absorbs to have a colour. */
static double absorption_of(double color, double roughness) {
    const double terms[] = {5.969, -0.215, 2.532, -10.73, 5.574, 0.245};
    double scale = 0.0, power = 1.0;
    for (int i = 0; i < 6; i++, power *= roughness)
        scale += terms[i] * power;
    return pow(log(color) / scale, 2.0);
}

/* The part of light that a smooth round strand gives back, which it meets at that cosine, cos_t
 * beneath its surface; sin_o: along it. */
static double strand_gives(double cosine, double sin_o, double ior, double absorption) {
    const double cos_t = sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior));
    const double s = (cosine - ior * cos_t) / (cosine + ior * cos_t),
                 p = (cos_t - ior * cosine) / (cos_t + ior * cosine);
    const double f = 0.5 * (s * s + p * p), sin_t = sin_o / ior;
    const double left = exp(-2.0 * absorption * cos_t / (1.0 - sin_t * sin_t));
    return f + (1.0 - f) * (1.0 - f) * left / (1.0 - f * left);
}

/* By the colours of Huang's hair: the roughness says how dark a colour is; of a strand that is an
 * ellipse across, the place on its width is taken along its axes (Cycles). */
static void huang_hair_has_its_color(void **state) {
    (void)state;
    static const float ones[3] = {1.0f, 1.0f, 1.0f};
    static const struct trc_snapshot curves = {.features = TRC_FEATURE_CURVES};
    double worst = 0.0;
    for (int n = 0; n < 3 * 2 * 5; n++) {
        const double roughness = 0.1 + 0.3 * (n / 10), off = 0.2 * (n % 5) - 0.4,
                     up = sqrt(1.0 - off * off);
        const bool is_flat = n / 5 % 2;
        struct model m = huang_hair(0.0f, (float)roughness, is_flat ? 0.8f : 1.0f, ones);
        struct trc_registers regs;
        struct trc_surface s;
        struct trc_lobes l;
        vvec3 albedo[3];
        memset(&regs, 0, sizeof regs);
        m.material.leaves[0].mode = TRC_PIGMENT_COLOR;
        set3(&m, TRC_AT(HUANG_HAIR, color), tint[0], tint[1], tint[2]);
        set3(&m, TRC_AT(HUANG_HAIR, tangent), 0.0f, 1.0f, 0.0f);
        set3(&m, TRC_AT(HUANG_HAIR, major), 0.8f, 0.0f, 0.6f);
        point(&s, wide(0.0, 0.6, 0.8), &m);
        s.snapshot = &curves;
        s.ng = s.n = wide(off, 0.0, up);
        trc_lobes_setup(material_of(&m), &s, &regs, vf_zero(), &l);
        trc_bsdf_albedo(&l, 0, albedo);
        /* The ray comes along z, across the strand; its axes are turned by an angle of sine .6. */
        const double cosine = 0.8 * (is_flat ? fabs(0.8 * up - 0.6 * off) : up);
        for (int c = 0; c < 3; c++) {
            const double want =
                strand_gives(cosine, 0.6, 1.55, absorption_of((double)tint[c], roughness));
            worst = fmax(worst, fabs((double)channel(albedo[1], c) - want));
        }
    }
    print_message("colours of Huang's hair: off by at most %.1e\n", worst);
    assert_true(worst <= 1e-5);
}

static bool is_vector(vvec3 found, float x, float y, float z) {
    return fabsf(vf_get(found.x, 0) - x) < 1e-6f && fabsf(vf_get(found.y, 0) - y) < 1e-6f &&
           fabsf(vf_get(found.z, 0) - z) < 1e-6f;
}

/* The normals of strands that passes have: across the ray, of an ellipse along its axis; for
 * denoisers the strand itself (Cycles from Blender 4 on). */
static void huang_hair_has_normals_of_its_own(void **state) {
    (void)state;
    static const float ones[3] = {1.0f, 1.0f, 1.0f};
    static const struct trc_snapshot curves = {.features = TRC_FEATURE_CURVES};
    for (int is_flat = 0; is_flat < 2; is_flat++) {
        struct model m = huang_hair(0.5f, 0.3f, is_flat ? 0.8f : 1.0f, ones);
        struct trc_registers regs;
        struct trc_surface s;
        struct trc_lobes l;
        memset(&regs, 0, sizeof regs);
        set3(&m, TRC_AT(HUANG_HAIR, tangent), 0.0f, 1.0f, 0.0f);
        set3(&m, TRC_AT(HUANG_HAIR, major), 0.8f, 0.0f, 0.6f);
        point(&s, wide(0.0, 0.6, 0.8), &m);
        s.snapshot = &curves;
        trc_lobes_setup(material_of(&m), &s, &regs, vf_zero(), &l);
        assert_int_equal(l.count, 1);
        assert_true(is_vector(trc_lobe_feature(&l.lobe[0], &s), 0.0f, 1.0f, 0.0f));
        assert_true(is_flat ? is_vector(trc_lobes_normal(&l, &s), 0.8f, 0.0f, 0.6f)
                            : is_vector(trc_lobes_normal(&l, &s), 1.0f, 0.0f, 0.0f));
    }
}

int main(void) {
    if (!test_cpu_can())
        return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(specular_tint_is_the_hue),
        cmocka_unit_test(metals_have_their_tint_at_the_edge),
        cmocka_unit_test(layers_darken_by_their_strongest_channel),
        cmocka_unit_test(coats_tint_by_the_way_through_them),
        cmocka_unit_test(films_interfere),
        cmocka_unit_test(films_interfere_on_metals),
        cmocka_unit_test(multiple_glass_transmits_its_color),
        cmocka_unit_test(refraction_has_no_color_beyond_the_critical_angle),
        cmocka_unit_test(rough_glass_passes_on_what_it_does_not_reflect),
        cmocka_unit_test(huang_hair_has_its_color),
        cmocka_unit_test(huang_hair_has_normals_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
