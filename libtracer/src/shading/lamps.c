/* Lamps from their descriptors: strengths to radiance, bounds for choosing.
 *
 * Units, as measured on and read from Cycles 3.4: a point or spot of P watts has the intensity P /
 * (4 pi) and, with a radius r, is a disk that faces whoever looks, of radiance P / (4 pi^2 r^2); an
 * area light has the radiance P / (4 area); a sun of strength S and half angle h is a disk at
 * distance 1 of radius tan h and radiance S / (pi tan^2 h cos^3 theta). Of Cycles 4.3: a sun's cone
 * has the radiance S / (pi sin^2 h) all over. */
#include "shading/lamps.h"

#include <string.h>

#include "shading/vectors.h"

#define PI 3.14159265358979f
/* Relative difference of axes up to which a spot's cone counts as round. */
#define ROUND_CONE 1e-5f

_Static_assert(sizeof(struct trc_lamp) == 4 * TRC_LAMP_WORDS, "read by gathers");

static void set_radiance(struct trc_lamp *lamp, const trc_light_desc *desc, float factor) {
    for (int i = 0; i < 3; i++)
        lamp->radiance[i] = desc->color[i] * desc->strength * factor;
}

/* Cosine between axes from which on a light counts as sheared. */
#define MIN_SHEAR 1e-4f

static bool trc_is_sheared(const trc_light_desc *desc) {
    const float *m = desc->transform;
    float u[3] = {m[0], m[4], m[8]}, v[3] = {m[1], m[5], m[9]}, w[3] = {m[2], m[6], m[10]};
    if (!(trc_normalize(u, 1, 0, 0) > 0.0f && trc_normalize(v, 0, 1, 0) > 0.0f &&
          trc_normalize(w, 0, 0, 1) > 0.0f))
        return false;
    const float shear =
        fmaxf(fabsf(trc_dot(u, v)), fmaxf(fabsf(trc_dot(u, w)), fabsf(trc_dot(v, w))));
    return shear > MIN_SHEAR;
}

/* ---- point ---- */

static bool point_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    const float r = fmaxf(desc->radius, 0.0f);
    lamp->half_u = lamp->half_v = r;
    lamp->inv_area = r > 0.0f ? 1.0f / (PI * r * r) : 1.0f;
    set_radiance(lamp, desc, 0.25f / PI * lamp->inv_area);
    if (r == 0.0f)
        lamp->flags |= TRC_LAMP_DELTA;
    if (desc->flags & TRC_LIGHT_SPHERE)
        lamp->flags |= TRC_LAMP_SPHERE;
    return true;
}

static void point_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    b->radius = lamp->half_u;
    b->intensity = trc_brightness(lamp->radiance) / lamp->inv_area;
    b->cos_o = -1.0f; /* all directions */
}

/* ---- spot ---- */

/* The cone is round in the light's own space: by its Z axis over its X and Y axes. Where it is
 * sheared by the rows of the inverse matrix, over the length of the third, which is the normal. */
static void stretch_spot(const trc_light_desc *desc, struct trc_lamp *lamp) {
    const float *m = desc->transform;
    float u[3] = {m[0], m[4], m[8]}, v[3] = {m[1], m[5], m[9]}, w[3] = {m[2], m[6], m[10]};
    if (trc_is_sheared(desc)) {
        float rows[3][3];
        trc_cross(v, w, rows[0]);
        trc_cross(w, u, rows[1]);
        trc_cross(u, v, rows[2]);
        const float size = copysignf(trc_length(rows[2]), trc_dot(u, rows[0]));
        if (size == 0.0f)
            return;
        lamp->flags |= TRC_LAMP_STRETCHED;
        for (int i = 0; i < 3; i++) {
            lamp->axis_u[i] = rows[0][i] / size;
            lamp->axis_v[i] = rows[1][i] / size;
            lamp->normal[i] = -rows[2][i] / size;
        }
        return;
    }
    const float x = trc_normalize(u, 1, 0, 0), y = trc_normalize(v, 0, 1, 0);
    const float z = trc_normalize(w, 0, 0, 1);
    if (!(x > 0.0f && y > 0.0f && z > 0.0f) ||
        (fabsf(z - x) <= ROUND_CONE * z && fabsf(z - y) <= ROUND_CONE * z))
        return;
    lamp->flags |= TRC_LAMP_STRETCHED;
    for (int i = 0; i < 3; i++) {
        lamp->axis_u[i] = u[i] * (z / x);
        lamp->axis_v[i] = v[i] * (z / y);
    }
}

static bool spot_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    point_make(desc, lamp);
    if (desc->flags & TRC_LIGHT_EVEN_CONE) {
        lamp->flags |= TRC_LAMP_EVEN_CONE;
        stretch_spot(desc, lamp);
    }
    lamp->cos_cone = cosf(0.5f * fminf(desc->spot_angle, PI));
    const float width = (1.0f - lamp->cos_cone) * fminf(fmaxf(desc->spot_blend, 0.0f), 1.0f);
    lamp->inv_smooth = width > 0.0f ? 1.0f / width : 0.0f;
    return true;
}

static void spot_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    point_bound(lamp, b);
    b->cos_o = 1.0f;
    b->cos_e = fmaxf(lamp->cos_cone, 0.0f);
    if (lamp->flags & TRC_LAMP_STRETCHED && b->cos_e > 0.0f) {
        const float length_u = trc_length(lamp->axis_u), length_v = trc_length(lamp->axis_v);
        const float slant = fmaxf(fabsf(trc_dot(lamp->axis_u, lamp->normal)) / length_u,
                                  fabsf(trc_dot(lamp->axis_v, lamp->normal)) / length_v);
        const float skew = fabsf(trc_dot(lamp->axis_u, lamp->axis_v)) / (length_u * length_v);
        if (fmaxf(slant, skew) > 0.5f * MIN_SHEAR) {
            b->cos_e = 0.0f; /* sheared: anywhere in front */
            return;
        }
        const float shortest = fminf(length_u, length_v);
        const float widest = sqrtf(1.0f - b->cos_e * b->cos_e) / (b->cos_e * fminf(shortest, 1.0f));
        b->cos_e = 1.0f / sqrtf(1.0f + widest * widest);
    }
}

/* ---- sun ---- */

static bool sun_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    /* At pi the disk would be infinite; Cycles has no limit and gets nothing useful there. */
    const float half = 0.5f * fminf(fmaxf(desc->angle, 0.0f), 3.1f);
    const float r = tanf(half);
    lamp->flags |= TRC_LAMP_DISTANT;
    lamp->half_u = lamp->half_v = r;
    lamp->cos_cone = cosf(half);
    lamp->inv_area = r > 0.0f ? 1.0f / (PI * r * r) : 1.0f;
    set_radiance(lamp, desc, lamp->inv_area);
    if (r > 0.0f && (desc->flags & TRC_LIGHT_EVEN_CONE)) {
        lamp->flags |= TRC_LAMP_EVEN_CONE;
        set_radiance(lamp, desc, 1.0f / (PI * sinf(half) * sinf(half)));
    }
    for (int i = 0; i < 3; i++)
        lamp->position[i] = -lamp->normal[i];
    if (r == 0.0f)
        lamp->flags |= TRC_LAMP_DELTA;
    if (!desc->use_mis) /* of suns the camera sees those alone that reflections see */
        lamp->visibility &= ~(uint32_t)TRC_VISIBLE_CAMERA;
    return true;
}

/* It has no place. */
static void sun_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    (void)lamp;
    (void)b;
}

/* ---- rectangle and ellipse ---- */

/* fill: its part of the rectangle. False for one without area. */
static bool area_make(const trc_light_desc *desc, float fill, struct trc_lamp *lamp) {
    const float *m = desc->transform;
    float u[3] = {m[0], m[4], m[8]}, v[3] = {m[1], m[5], m[9]};
    const float size_u = trc_normalize(u, 1, 0, 0) * desc->size_x;
    const float size_v = trc_normalize(v, 0, 1, 0) * desc->size_y;
    const float area = size_u * size_v * fill;
    if (!(area > 0.0f) || !(area < INFINITY))
        return false;
    memcpy(lamp->axis_u, u, sizeof u);
    memcpy(lamp->axis_v, v, sizeof v);
    lamp->half_u = 0.5f * size_u;
    lamp->half_v = 0.5f * size_v;
    lamp->inv_area = 1.0f / area;
    lamp->spread_scale = 1.0f;
    const float half = 0.5f * fmaxf(desc->spread, 0.0f);
    if (half < 0.5f * PI - 1e-4f) {
        /* A grid of slats: what passes at theta is 1 - tan(theta) / tan(half), scaled to keep the
         * power. */
        const float t = tanf(fmaxf(half, 1e-3f));
        lamp->tan_spread = 1.0f / t;
        lamp->spread_scale = 1.0f / (1.0f - fmaxf(half, 1e-3f) / t);
    }
    set_radiance(lamp, desc, 0.25f * lamp->inv_area);
    return true;
}

static void area_bound(const struct trc_lamp *lamp, float radius, struct trc_light_bound *b) {
    b->radius = radius;
    b->intensity = trc_brightness(lamp->radiance) / lamp->inv_area * lamp->spread_scale;
    b->cos_o = 1.0f;
    /* cot(h) = tan_spread. */
    b->cos_e = lamp->tan_spread / sqrtf(1.0f + lamp->tan_spread * lamp->tan_spread);
}

static bool rectangle_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    return area_make(desc, 1.0f, lamp);
}
static void rectangle_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    const float u = lamp->half_u, v = lamp->half_v;
    area_bound(lamp, sqrtf(u * u + v * v), b);
}

static bool ellipse_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    return area_make(desc, 0.25f * PI, lamp);
}
static void ellipse_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    area_bound(lamp, fmaxf(lamp->half_u, lamp->half_v), b);
}

/* ---- the same, sheared ---- */

/* Rays meet it where the shadows of the way from its centre on both axes are within its sizes: in a
 * parallelogram whose sides are across the axes. */
static bool sheared_make(const trc_light_desc *desc, float fill, struct trc_lamp *lamp) {
    if (!area_make(desc, fill, lamp))
        return false;
    if (desc->flags & TRC_LIGHT_CENTERED)
        lamp->flags |= TRC_LAMP_CENTERED;
    float side_u[3], side_v[3];
    trc_cross(lamp->axis_v, lamp->normal, side_u);
    trc_cross(lamp->normal, lamp->axis_u, side_v);
    const float determinant = fabsf(trc_dot(lamp->axis_u, side_u));
    const float reach =
        (lamp->half_u * trc_length(side_u) + lamp->half_v * trc_length(side_v)) / determinant;
    lamp->square_reach = reach * reach;
    return reach < INFINITY;
}

static bool sheared_rectangle_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    return sheared_make(desc, 1.0f, lamp);
}
static void sheared_rectangle_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    area_bound(lamp, lamp->half_u + lamp->half_v, b);
    b->cos_o = -1.0f; /* what is sampled lies anywhere */
}

static bool sheared_ellipse_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    return sheared_make(desc, 0.25f * PI, lamp);
}
static void sheared_ellipse_bound(const struct trc_lamp *lamp, struct trc_light_bound *b) {
    area_bound(lamp, lamp->half_u + lamp->half_v, b);
    b->cos_o = -1.0f;
}

/* ---- all ---- */

/* Of its kind; false for one that has no such shape. */
static bool make_kind(const trc_light_desc *desc, struct trc_lamp *lamp) {
#define TRC_LAMP_KIND(NAME, name, is_it) \
    if (is_it) {                         \
        lamp->kind = TRC_KIND_##NAME;    \
        return name##_make(desc, lamp);  \
    }
#include "model/light_kinds.def"
    return false;
}

bool trc_lamp_make(const trc_light_desc *desc, struct trc_lamp *lamp) {
    memset(lamp, 0, sizeof *lamp);
    const float *m = desc->transform;
    float normal[3] = {-m[2], -m[6], -m[10]};
    trc_normalize(normal, 0, 0, -1);
    memcpy(lamp->normal, normal, sizeof normal);
    for (int i = 0; i < 3; i++)
        lamp->position[i] = m[4 * i + 3];
    lamp->visibility = desc->visibility | TRC_VISIBLE_SHADOW;
    if (!(desc->flags & TRC_LIGHT_SYNTHETIC))
        lamp->visibility |= TRC_VISIBLE_UNBLOCKED;
    if (desc->flags & TRC_LIGHT_LOCAL_UV)
        lamp->flags |= TRC_LAMP_LOCAL_UV;
    if (desc->flags & TRC_LIGHT_OBJECT)
        lamp->flags |= TRC_LAMP_OBJECT;
    lamp->group = desc->light_group;
    lamp->bounce_limit = desc->bounce_limit;
    lamp->excluded[0] = (uint32_t)desc->light_exclude;
    lamp->excluded[1] = (uint32_t)(desc->light_exclude >> 32);
    lamp->flags |=
        (desc->use_mis ? TRC_LAMP_MIS : 0) | (desc->cast_shadow ? TRC_LAMP_CASTS_SHADOW : 0);
    if (!make_kind(desc, lamp))
        return false;
    if (lamp->square_reach == 0.0f)
        lamp->square_reach = lamp->half_u * lamp->half_u + lamp->half_v * lamp->half_v;
    const float light = trc_brightness(lamp->radiance);
    return light > 0.0f && light < INFINITY && (desc->visibility & TRC_VISIBLE_ALL) != 0;
}

void trc_lamp_bound(const struct trc_lamp *lamp, uint32_t number, struct trc_light_bound *b) {
    memset(b, 0, sizeof *b);
    memcpy(b->center, lamp->position, sizeof b->center);
    memcpy(b->axis, lamp->normal, sizeof b->axis);
    b->child = -1;
    b->light = (int32_t)number;
    memcpy(b->excluded, lamp->excluded, sizeof b->excluded);
    switch (lamp->kind) {
#define TRC_LAMP_KIND(NAME, name, is_it) \
    case TRC_KIND_##NAME:                \
        name##_bound(lamp, b);           \
        break;
#include "model/light_kinds.def"
    default:
        break;
    }
}
