/* Principled of Blender 4.0 and later, as Cycles 4.3 sets up its closures: layer upon layer, each
 * taking its albedo from what is below.
 *
 * From the top: transparency, sheen, coat with its tint, emission, then metal, glass, and specular
 * reflection over diffuse. Departures: subsurface scattering is diffuse. */
#include "kernels/lobe/facets.h"

/* Whether an input can differ from a value. */
static bool may_differ(const struct trc_setup *c, const struct trc_leaf *leaf, uint32_t at,
                       float value) {
    const struct trc_operand *o = input(c, leaf, at);
    return o->reg >= 0 || o->value != value;
}

/* What is left for the layers below one of that albedo, by its strongest channel. */
static vfloat below(vvec3 albedo) { return vf_saturate(vf_one() - v3_max(albedo)); }

/* ---- layers ---- */

/* All returns are what is left for the layers below. */
static vfloat layered_sheen(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vvec3 tint =
        v3_scale(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_tint)),
                 vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_weight)), vf_zero()));
    const vvec3 bent = trc_matt_normal(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_normal));
    const vfloat coat = vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_weight)));
    const vvec3 n = v3_normalize(
        v3_lerp(trc_matt_normal(c, leaf, TRC_AT(LAYERED_PRINCIPLED, normal)), bent, coat));
    const vfloat albedo =
        trc_add_fibres(c, v3_scale(tint, weight), n,
                       vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_roughness))));
    return below(v3_scale(tint, albedo));
}

/* What the tint of the coat leaves of light from below: it is that of the path straight down, the
 * view refracted into the coat takes a longer one. */
static vvec3 coat_tint(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat cos_o,
                       vfloat coat, vfloat ior) {
    const vvec3 white = v3_splat(vf_one());
    if (!may_differ(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_tint), 1.0f) &&
        !may_differ(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_tint) + 1, 1.0f) &&
        !may_differ(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_tint) + 2, 1.0f))
        return white;
    const vfloat sine2 = (vf_one() - cos_o * cos_o) / (ior * ior), none = vf_zero();
    const vfloat depth = vf_rcp(vf_sqrt(vf_max(vf_one() - sine2, vf_set(1e-6f))));
    const vvec3 tint = colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_tint));
    const vvec3 color = v3(vf_pow(vf_max(tint.x, none), depth), vf_pow(vf_max(tint.y, none), depth),
                           vf_pow(vf_max(tint.z, none), depth));
    return v3_lerp(white, color, coat);
}

static bool is_whole_coat(const struct trc_leaf *leaf) {
    return leaf->mode & TRC_DISTRIBUTION_WHOLE_COAT;
}
static vfloat coat_alpha(const struct trc_setup *c, const struct trc_leaf *leaf) {
    return vf_square(vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_roughness))));
}

/* Mean Fresnel factor of a coat over the hemisphere. */
static vfloat coat_mean(vfloat ior) {
    return vf_lerp(trc_fresnel_normal(ior), vf_one(), mean_blend(ior));
}

/* What a coat of weight 1 reflects of even light: as a smooth one, or as its facets do. */
static vfloat coat_albedo(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat cos_o,
                          vfloat ior) {
    if (!is_whole_coat(leaf))
        return trc_fresnel_dielectric(cos_o, ior);
    const vfloat alpha = coat_alpha(c, leaf), one = vf_one();
    vfloat single;
    const vfloat gain = trc_facets_gain(cos_o, alpha, v3_splat(coat_mean(ior)), &single).x;
    const vfloat f = vf_lerp(trc_fresnel_normal(ior), one, trc_dielectric_share(cos_o, alpha, ior));
    return f * single * gain;
}

/* What a coat of that albedo leaves for the layers below. */
static vvec3 coat_passes(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat cos_o,
                         vfloat coat, vfloat ior, vfloat albedo) {
    return v3_scale(coat_tint(c, leaf, cos_o, coat, ior), vf_saturate(vf_one() - coat * albedo));
}

static vvec3 layered_coat(struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight) {
    const vfloat coat = vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_weight)), vf_zero());
    const vfloat ior = vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_ior)), vf_one());
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_normal));
    const vfloat cos_o = v3_dot(n, c->s->wo), albedo = coat_albedo(c, leaf, cos_o, ior);
    struct trc_lobe *lobe = trc_add_reflection(c, v3_splat(coat * weight));
    if (lobe) {
        const vfloat chance = lobe->mix_weight * albedo;
        lobe->distribution = TRC_LOBE_GGX;
        lobe->correlated = true;
        lobe->fresnel = TRC_FRESNEL_DIELECTRIC;
        lobe->n = n;
        lobe->ior = ior;
        lobe->alpha_x = lobe->alpha_y = coat_alpha(c, leaf);
        trc_facets_finish(c, lobe, false);
        if (is_whole_coat(leaf)) {
            const struct trc_fresnel fresnel = blend_to_white(v3_splat(trc_fresnel_normal(ior)));
            set_fresnel(lobe, &fresnel);
            trc_facets_keep_energy(lobe, v3_splat(coat_mean(ior)));
        }
        lobe->mix_weight = chance;
    }
    return coat_passes(c, leaf, cos_o, coat, ior, albedo);
}

static uint32_t distribution(const struct trc_leaf *leaf) {
    return leaf->mode & ~(uint32_t)(TRC_DISTRIBUTION_FILMED_METAL | TRC_DISTRIBUTION_WHOLE_COAT |
                                    TRC_DISTRIBUTION_THIN_WALL | TRC_DISTRIBUTION_CONDUCTOR);
}

/* A lobe with the node's distribution, roughness and anisotropy. */
static struct trc_lobe *add_anisotropic(struct trc_setup *c, const struct trc_leaf *leaf,
                                        vvec3 weight, vvec3 n, vfloat ior) {
    struct trc_lobe *lobe = trc_add_reflection(c, weight);
    if (!lobe)
        return NULL;
    const vfloat alpha =
        vf_square(vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, roughness))));
    lobe->distribution =
        distribution(leaf) == TRC_DISTRIBUTION_BECKMANN ? TRC_LOBE_BECKMANN : TRC_LOBE_GGX;
    lobe->correlated = true;
    lobe->n = n;
    lobe->ior = ior;
    lobe->alpha_x = lobe->alpha_y = alpha;
    lobe->anisotropic = may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, anisotropic));
    if (lobe->anisotropic) {
        const vfloat aspect =
            aspect_of(vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, anisotropic))));
        lobe->alpha_x = alpha / aspect;
        lobe->alpha_y = alpha * aspect;
        lobe->tangent =
            trc_leaf_tangent(c, leaf, TRC_AT(LAYERED_PRINCIPLED, tangent), n,
                             number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, anisotropic_rotation)));
    }
    trc_facets_finish(c, lobe, false);
    return lobe;
}

/* Nanometres from which a film interferes in full. */
static float whole_film(const struct trc_leaf *leaf) {
    return leaf->mode & TRC_DISTRIBUTION_FILMED_METAL ? TRC_WHOLE_FILM_5 : TRC_WHOLE_FILM_4;
}

static vvec3 metal_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    return v3(trc_metal_fresnel(lobe->f0.x, lobe->f90.x, cos_m),
              trc_metal_fresnel(lobe->f0.y, lobe->f90.y, cos_m),
              trc_metal_fresnel(lobe->f0.z, lobe->f90.z, cos_m));
}

/* f0, f90: the two parts of the index. */
static vvec3 conductor_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    return v3(trc_conductor_fresnel(lobe->f0.x, lobe->f90.x, cos_m),
              trc_conductor_fresnel(lobe->f0.y, lobe->f90.y, cos_m),
              trc_conductor_fresnel(lobe->f0.z, lobe->f90.z, cos_m));
}

static vvec3 strong_conductor_reflectance(const struct trc_lobe *lobe, vfloat cos_m) {
    return v3(trc_strong_conductor_fresnel(lobe->f0.x, lobe->f90.x, cos_m),
              trc_strong_conductor_fresnel(lobe->f0.y, lobe->f90.y, cos_m),
              trc_strong_conductor_fresnel(lobe->f0.z, lobe->f90.z, cos_m));
}

/* Reflectance of a metal head-on and at the cosine of TRC_METAL_EDGE. */
static void metal_ends(const struct trc_setup *c, const struct trc_leaf *leaf,
                       struct trc_lobe *lobe, vvec3 *f0, vvec3 *at_edge) {
    const vvec3 base = colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, base_color));
    const vvec3 other = colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_tint));
    if (leaf->mode & TRC_DISTRIBUTION_CONDUCTOR) {
        const vfloat none = vf_zero();
        lobe->f0 = v3(vf_max(base.x, none), vf_max(base.y, none), vf_max(base.z, none));
        lobe->f90 = v3(vf_max(other.x, none), vf_max(other.y, none), vf_max(other.z, none));
        lobe->reflectance = leaf->mode & TRC_DISTRIBUTION_FILMED_METAL
                                ? conductor_reflectance
                                : strong_conductor_reflectance;
        *f0 = lobe->reflectance(lobe, vf_one());
        *at_edge = lobe->reflectance(lobe, vf_set(TRC_METAL_EDGE));
        return;
    }
    *f0 = v3_saturate(base);
    *at_edge =
        v3_mul(v3_lerp(*f0, v3_splat(vf_one()), vf_set(TRC_METAL_EDGE_POWER)), v3_saturate(other));
}

/* A conductor under a film is the metal that reflects as much head-on and at the edge. */
static void layered_metal(struct trc_setup *c, const struct trc_leaf *leaf, vvec3 weight, vvec3 n) {
    struct trc_lobe *lobe = add_anisotropic(c, leaf, weight, n, vf_one());
    if (!lobe)
        return;
    vvec3 f0, at_edge;
    metal_ends(c, leaf, lobe, &f0, &at_edge);
    const bool is_filmed = (leaf->mode & TRC_DISTRIBUTION_FILMED_METAL) &&
                           may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness));
    const vvec3 dip = v3(trc_metal_dip(f0.x, at_edge.x), trc_metal_dip(f0.y, at_edge.y),
                         trc_metal_dip(f0.z, at_edge.z));
    lobe->fresnel = TRC_FRESNEL_OWN;
    if (!(leaf->mode & TRC_DISTRIBUTION_CONDUCTOR) || is_filmed) {
        lobe->fresnel = TRC_FRESNEL_METAL;
        lobe->reflectance = metal_reflectance;
        lobe->f0 = f0;
        lobe->f90 = dip;
    }
    /* Schlick's mean over the hemisphere is 1/21 of the way to white. */
    const vvec3 mean = v3_sub(v3_lerp(f0, v3_splat(vf_one()), vf_set(1.0f / 21.0f)),
                              v3_scale(dip, vf_set(1.0f / 126.0f)));
    vvec3 albedo = mean;
    if (is_filmed) {
        const vmask covered = trc_thin_film_cover_metal(
            c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness), whole_film(leaf), lobe);
        if (vm_any(covered))
            albedo = v3_select(covered, facet_reflectance(lobe, lobe->cos_o), mean);
    }
    lobe->mix_weight = lobe->mix_weight * v3_average(albedo);
    if (distribution(leaf) == TRC_DISTRIBUTION_MULTI_GGX)
        trc_facets_keep_energy(lobe, v3_saturate(mean));
}

static void layered_glass(struct trc_setup *c, const struct trc_leaf *leaf, vvec3 weight, vvec3 n) {
    const vvec3 clear = v3_saturate(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, base_color)));
    /* In at one surface and out at another: each has the root of the colour. */
    const vvec3 tint = v3(vf_sqrt(clear.x), vf_sqrt(clear.y), vf_sqrt(clear.z));
    const vfloat ior = number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, ior));
    const vfloat eta = trc_relative_ior(c, ior);
    const vvec3 f0 = v3_scale(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_tint)),
                              trc_fresnel_normal(eta));
    struct trc_fresnel fresnel = blend_to_white(v3_saturate(f0));
    trc_thin_film_cover(c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness), trc_ior_above(c, ior),
                        whole_film(leaf), &fresnel);
    trc_add_correlated_glass(
        c, weight, v3_splat(vf_one()), tint, &fresnel, n,
        vf_square(vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, roughness)))), eta,
        distribution(leaf) | TRC_DISTRIBUTION_CORRELATED);
}

/* What the surface of a thin wall reflects; above: index of where that is seen from, cos_o: of the
 * angle there. */
static vvec3 wall_reflects(const struct trc_setup *c, const struct trc_leaf *leaf, vvec3 f0,
                           vfloat above, vfloat ior, vfloat cos_o) {
    struct trc_lobe side;
    struct trc_fresnel fresnel = blend_to_white(f0);
    side.ior = vf_select(vf_eq(above, vf_one()), ior, vf_rcp(ior));
    trc_thin_film_cover(c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness), above,
                        whole_film(leaf), &fresnel);
    set_fresnel(&side, &fresnel);
    return v3_saturate(facet_reflectance(&side, cos_o));
}

/* Of one channel: what both surfaces of a wall send back and through, reflecting front and back,
 * with that transmittance between them. */
static void wall_sum(vfloat front, vfloat back, vfloat between, vfloat *reflected,
                     vfloat *transmitted) {
    const vfloat one = vf_one(), once = back * between;
    *transmitted = vf_divide(between * (one - front) * (one - back), one - once * once);
    *transmitted = vf_where(vf_lt(once, one), *transmitted);
    *reflected = front + *transmitted * once;
}

static void layered_thin_glass(struct trc_setup *c, const struct trc_leaf *leaf, vvec3 weight,
                               vvec3 n) {
    const vfloat one = vf_one();
    const vfloat ior =
        vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, ior)), vf_set(TRC_MIN_IOR));
    const vvec3 tint = colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_tint));
    const vvec3 clear = v3_saturate(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, base_color)));
    const vvec3 f0 = v3_saturate(v3_scale(tint, trc_fresnel_normal(ior)));
    const vfloat cos_o = v3_dot(n, c->s->wo);
    const vfloat cos2_t = one - (one - cos_o * cos_o) / (ior * ior);
    const vfloat cos_t = vf_safe_sqrt(cos2_t);
    const vvec3 front = wall_reflects(c, leaf, f0, one, ior, cos_o);
    vvec3 back = front;
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness)))
        back = wall_reflects(c, leaf, f0, ior, ior, cos_t);
    /* The colour is that of the way straight through; there is none where all is reflected. */
    const vmask passes = vf_gt(cos_t, vf_zero());
    const vfloat way = vf_divide(one, cos_t);
    const vvec3 between =
        v3_where(passes, v3(vf_pow(clear.x, way), vf_pow(clear.y, way), vf_pow(clear.z, way)));
    vvec3 reflected, transmitted;
    wall_sum(front.x, back.x, between.x, &reflected.x, &transmitted.x);
    wall_sum(front.y, back.y, between.y, &reflected.y, &transmitted.y);
    wall_sum(front.z, back.z, between.z, &reflected.z, &transmitted.z);
    trc_add_thin_glass(
        c, &(struct trc_thin_glass){.reflected = v3_mul(weight, reflected),
                                    .transmitted = v3_mul(weight, transmitted),
                                    .tint = v3_saturate(tint),
                                    .n = n,
                                    .alpha = vf_square(vf_saturate(
                                        number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, roughness)))),
                                    .ior = ior});
}

/* The dielectric reflection; its index is the one that gives the reflectance level asks for. */
static vfloat layered_specular(struct trc_setup *c, const struct trc_leaf *leaf, vvec3 weight,
                               vvec3 n) {
    const vfloat one = vf_one();
    const vfloat ior =
        vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, ior)), vf_set(TRC_MIN_IOR));
    vfloat eta = ior, f0 = trc_fresnel_normal(ior);
    if (may_differ(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_ior_level), 0.5f)) {
        const vfloat level =
            vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_ior_level)), vf_zero());
        f0 = f0 * vf_set(2.0f) * level;
        const vfloat root = vf_sqrt(vf_clamp(f0, 0.0f, 0.99f));
        eta = (one + root) / (one - root);
        eta = vf_select(vf_lt(ior, one), vf_rcp(eta), eta);
    }
    const vvec3 tinted = v3_scale(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, specular_tint)), f0);
    const vvec3 low =
        v3(vf_max(tinted.x, vf_zero()), vf_max(tinted.y, vf_zero()), vf_max(tinted.z, vf_zero()));
    struct trc_fresnel fresnel = blend_to_white(low);
    const vmask covered = trc_thin_film_cover(c, leaf, TRC_AT(LAYERED_PRINCIPLED, film_thickness),
                                              one, whole_film(leaf), &fresnel);
    const vmask is_seen = vm_or(vf_ne(eta, one), covered);
    struct trc_lobe *lobe = add_anisotropic(c, leaf, v3_where(is_seen, weight), n, eta);
    if (!lobe)
        return one;
    set_fresnel(lobe, &fresnel);
    /* What it takes from below: of one bounce where the rest of the bounces is added; under a film
     * as if it were smooth, and the rest as without. */
    const vfloat alpha = lobe->mean_alpha, tiny = vf_set(1e-6f);
    const vvec3 white = v3_splat(one);
    vvec3 albedo = v3_lerp(low, white, trc_dielectric_share(lobe->cos_o, alpha, eta));
    if (vm_any(covered))
        albedo = v3_select(covered, facet_reflectance(lobe, lobe->cos_o), albedo);
    lobe->mix_weight = lobe->mix_weight * v3_average(albedo);
    vfloat kept = one;
    if (distribution(leaf) == TRC_DISTRIBUTION_MULTI_GGX) {
        const vvec3 mean = v3_lerp(low, white, mean_blend(eta));
        const vfloat before = v3_max(lobe->weight);
        trc_facets_keep_energy(lobe, v3_saturate(mean));
        const vfloat single = vf_max(trc_ggx_albedo(lobe->cos_o, alpha), vf_set(1e-3f));
        kept = single * v3_max(lobe->weight) / vf_max(before, tiny);
    }
    return vf_select(is_seen, below(v3_scale(albedo, kept)), one);
}

static vfloat opacity_of(const struct trc_setup *c, const struct trc_leaf *leaf) {
    const struct trc_operand *alpha = input(c, leaf, TRC_AT(LAYERED_PRINCIPLED, alpha));
    return alpha->reg < 0 && alpha->value >= 1.0f ? vf_one()
                                                  : vf_saturate(trc_operand_value(alpha, c->regs));
}

static void add_layered_principled(struct trc_setup *c, const struct trc_leaf *leaf, vfloat whole) {
    vfloat weight = whole;
    const struct trc_operand *alpha = input(c, leaf, TRC_AT(LAYERED_PRINCIPLED, alpha));
    if (alpha->reg >= 0 || alpha->value < 1.0f) {
        weight = whole * opacity_of(c, leaf);
        trc_add_transparent(c, v3_splat(whole - weight));
    }
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_weight)))
        weight = weight * layered_sheen(c, leaf, weight);
    vvec3 rest = v3_splat(weight);
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_weight)))
        rest = v3_mul(rest, layered_coat(c, leaf, weight));
    const vvec3 n = trc_leaf_normal(c, leaf, TRC_AT(LAYERED_PRINCIPLED, normal)),
                base = colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, base_color));
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, metallic))) {
        const vfloat metallic = vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, metallic)));
        layered_metal(c, leaf, v3_scale(rest, metallic), n);
        rest = v3_scale(rest, vf_one() - metallic);
    }
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, transmission_weight))) {
        const vfloat transmission =
            vf_saturate(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, transmission_weight)));
        (leaf->mode & TRC_DISTRIBUTION_THIN_WALL ? layered_thin_glass : layered_glass)(
            c, leaf, v3_scale(rest, transmission), n);
        rest = v3_scale(rest, vf_one() - transmission);
    }
    rest = v3_scale(rest, layered_specular(c, leaf, rest, n));
    const vvec3 matt = trc_matt_normal(c, leaf, TRC_AT(LAYERED_PRINCIPLED, normal));
    const struct trc_operand *sigma = input(c, leaf, TRC_AT(LAYERED_PRINCIPLED, diffuse_roughness));
    if (sigma->reg < 0 && sigma->value <= 0.0f)
        trc_add_lambert(c, v3_mul(base, rest), matt);
    else
        trc_add_energy_oren_nayar(c, v3_mul(base, rest), base, matt,
                                  vf_saturate(trc_operand_value(sigma, c->regs)));
}

/* Emission shines through sheen and coat. Without a surface, for samples of it as a light, Cycles
 * knows of the coat's tint only; here as seen head-on. */
static bool layered_emission(const struct trc_setup *c, const struct trc_leaf *leaf, vfloat weight,
                             vvec3 *emission) {
    const struct trc_operand *strength =
        input(c, leaf, TRC_AT(LAYERED_PRINCIPLED, emission_strength));
    if (strength->reg < 0 && strength->value == 0.0f)
        return false;
    vvec3 rest = v3_splat(trc_operand_value(strength, c->regs) * weight * opacity_of(c, leaf));
    const vfloat cos_o = c->s ? vf_saturate(v3_dot(c->s->n, c->s->wo)) : vf_one();
    if (c->s && may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_weight))) {
        const vvec3 tint =
            v3_scale(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_tint)),
                     vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_weight)), vf_zero()));
        const vfloat rough =
            vf_clamp(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, sheen_roughness)), 0.01f, 1.0f);
        rest = v3_scale(rest, below(v3_scale(tint, trc_fibres_albedo(cos_o, rough))));
    }
    if (may_exceed_zero(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_weight))) {
        const vfloat coat =
            vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_weight)), vf_zero());
        const vfloat ior = vf_max(number(c, leaf, TRC_AT(LAYERED_PRINCIPLED, coat_ior)), vf_one());
        rest = v3_mul(
            rest, c->s ? coat_passes(c, leaf, cos_o, coat, ior, coat_albedo(c, leaf, cos_o, ior))
                       : coat_tint(c, leaf, cos_o, coat, ior));
    }
    *emission = v3_mul(colour(c, leaf, TRC_AT(LAYERED_PRINCIPLED, emission_color)), rest);
    return true;
}

const struct trc_closure TRC_CLOSURE_OF(LAYERED_PRINCIPLED) = {.add = add_layered_principled,
                                                               .emission = layered_emission};
