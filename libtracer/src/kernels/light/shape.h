/* Places on lights: sampling them, the density of that, the radiance they send to a point.
 *
 * C. Urena, M. Fajardo and A. King, "An Area-Preserving Parametrization for Spherical Rectangles"
 * (2013); J. Arvo, "Stratified Sampling of Spherical Triangles" (1995); A. van Oosterom and J.
 * Strackee, "The Solid Angle of a Plane Triangle" (1983). Lights that are small as seen from the
 * point are sampled by area: there the density is nearly constant anyway, and spherical angles
 * would lose their digits. */
#ifndef TRACER_KERNELS_LIGHT_SHAPE_H
#define TRACER_KERNELS_LIGHT_SHAPE_H

#include "kernels/light/light.h"
#include "kernels/simd/wide_math.h"
#include "kernels/trace/mesh_fetch.h"
#include "model/lights.h"

/* Solid angles below it are sampled by area. Ellipses that are large are sampled as their
 * rectangle, whose corners give nothing: a fifth of the samples, but none with a huge weight. */
#define TRC_SMALL_RECTANGLE 4e-3f
#define TRC_SMALL_ELLIPSE 0.5f
#define TRC_SMALL_TRIANGLE 2e-2f

struct trc_wide_lamp {
    vvec3 position, axis_u, axis_v, normal, radiance;
    vfloat half_u, half_v, cos_cone, inv_smooth, tan_spread, spread_scale, inv_area;
    vint kind, flags;
};

TRC_INLINE struct trc_wide_lamp trc_lamp_broadcast(const struct trc_lamp *l) {
    return (struct trc_wide_lamp){
        v3_set(l->position),   v3_set(l->axis_u),     v3_set(l->axis_v),       v3_set(l->normal),
        v3_set(l->radiance),   vf_set(l->half_u),     vf_set(l->half_v),       vf_set(l->cos_cone),
        vf_set(l->inv_smooth), vf_set(l->tan_spread), vf_set(l->spread_scale), vf_set(l->inv_area),
        vi_set(l->kind),       vi_set(l->flags)};
}
/* Lamps number index of each lane. */
TRC_INLINE struct trc_wide_lamp trc_lamp_gather(const struct trc_lamp *lamps, vint index, vmask m) {
    const float *base = (const float *)lamps;
    const vint at = index * vi_set(TRC_LAMP_WORDS);
    struct trc_wide_lamp l;
    l.position = v3_gather(base, at, m);
    l.axis_u = v3_gather(base + 3, at, m);
    l.axis_v = v3_gather(base + 6, at, m);
    l.normal = v3_gather(base + 9, at, m);
    l.radiance = v3_gather(base + 12, at, m);
    l.half_u = vf_gather(base + 15, at, m);
    l.half_v = vf_gather(base + 16, at, m);
    l.cos_cone = vf_gather(base + 17, at, m);
    l.inv_smooth = vf_gather(base + 18, at, m);
    l.tan_spread = vf_gather(base + 19, at, m);
    l.spread_scale = vf_gather(base + 20, at, m);
    l.inv_area = vf_gather(base + 21, at, m);
    l.kind = vi_gather(&lamps->kind, at, m);
    l.flags = vi_gather(&lamps->flags, at, m);
    return l;
}

/* A sampled place as seen from the point. */
struct trc_place {
    vvec3 wi, radiance;
    vfloat distance, pdf;
};

/* ---- point and spot: a disk that faces the point, or a sphere ---- */

TRC_INLINE vmask trc_lamp_has(const struct trc_wide_lamp *l, int32_t flag) {
    return vm_not(vi_eq(l->flags & vi_set(flag), vi_set(0)));
}

TRC_INLINE vfloat trc_spot_factor(const struct trc_wide_lamp *l, vvec3 wi) {
    const vfloat c = -v3_dot(l->normal, wi);
    const vfloat over = c - l->cos_cone;
    const vfloat t = vf_saturate(over * l->inv_smooth);
    const vfloat soft = t * t * (vf_set(3.0f) - vf_set(2.0f) * t);
    const vfloat edge = vf_select(vf_gt(l->inv_smooth, vf_zero()), soft, vf_one());
    const vfloat level = vf_select(trc_lamp_has(l, TRC_LAMP_EVEN_CONE), vf_one(), c);
    return vf_where(vf_gt(over, vf_zero()), level * edge);
}

/* What is seen is a cone about the way to the centre: sampled uniformly by solid angle. 1 - cos of
 * its half angle, without cancellation; from inside a sphere all directions, 2. */
TRC_INLINE vfloat trc_point_cone(const struct trc_wide_lamp *l, vfloat reach) {
    const vfloat r2 = l->half_u * l->half_u, d2 = reach * reach;
    const vfloat far = vf_sqrt(d2 + r2), disk = vf_divide(r2, far * (far + reach));
    const vmask sphere = trc_lamp_has(l, TRC_LAMP_SPHERE);
    if (!vm_any(sphere))
        return disk;
    const vfloat ball = vf_divide(r2, reach * (reach + vf_safe_sqrt(d2 - r2)));
    return vf_select(sphere, vf_select(vf_gt(d2, r2), ball, vf_set(2.0f)), disk);
}
/* Distance along a direction of that cone, by its cosine to the way to the centre. */
TRC_INLINE vfloat trc_point_distance(const struct trc_wide_lamp *l, vfloat reach, vfloat cosine) {
    const vmask sphere = trc_lamp_has(l, TRC_LAMP_SPHERE);
    const vfloat disk = vf_divide(reach, cosine);
    if (!vm_any(sphere))
        return disk;
    const vfloat r2 = l->half_u * l->half_u, d2 = reach * reach;
    const vfloat half_chord = vf_safe_sqrt(r2 - d2 * (vf_one() - cosine * cosine));
    const vfloat sign = vf_select(vf_gt(d2, r2), vf_set(-1.0f), vf_one());
    return vf_select(sphere, reach * cosine + sign * half_chord, disk);
}
TRC_INLINE struct trc_place trc_point_sample(const struct trc_wide_lamp *l, vvec3 p, vfloat u1,
                                             vfloat u2) {
    vfloat reach;
    const vvec3 axis = v3_normalize_length(v3_sub(l->position, p), &reach);
    const vfloat k = trc_point_cone(l, reach);
    vvec3 a, b;
    v3_frame(axis, &a, &b);
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    const vfloat rise = (x * x + y * y) * k, scale = vf_safe_sqrt(k * (vf_set(2.0f) - rise));
    const vfloat cosine = vf_one() - rise;
    const vmask delta = vf_eq(l->half_u, vf_zero());
    struct trc_place s;
    s.wi = v3_select(delta, axis, v3_from_frame(v3(x * scale, y * scale, cosine), a, b, axis));
    s.distance = trc_point_distance(l, reach, cosine);
    /* A point without extent: intensity over squared distance, density 1. */
    const vfloat fade = vf_select(delta, vf_divide(vf_one(), reach * reach), vf_one());
    s.radiance = v3_scale(l->radiance, fade);
    s.pdf = vf_select(delta, vf_one(), vf_divide(vf_set(0.5f * TRC_INV_PI), k));
    return s;
}
/* Ray against the disk or sphere: distance, or beyond any. */
TRC_INLINE vfloat trc_point_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf) {
    vfloat reach;
    const vvec3 to = v3_sub(l->position, p);
    const vvec3 axis = v3_normalize_length(to, &reach);
    const vfloat cosine = v3_dot(axis, wi);
    const vfloat r2 = l->half_u * l->half_u;
    const vmask sphere = trc_lamp_has(l, TRC_LAMP_SPHERE);
    /* Where the ray passes the centre: in the disk's plane, or nearest to it. */
    const vfloat at = vf_select(sphere, reach * cosine, vf_divide(reach, cosine));
    const vvec3 off = v3_sub(v3_scale(wi, at), to);
    const vmask inside = vm_and(sphere, vf_le(reach * reach, r2));
    const vmask hit = vm_and(vm_or(vf_gt(cosine, vf_zero()), inside), vf_lt(v3_dot(off, off), r2));
    *pdf = vf_divide(vf_set(0.5f * TRC_INV_PI), trc_point_cone(l, reach));
    return vf_select(hit, trc_point_distance(l, reach, cosine), vf_set(INFINITY));
}

/* ---- sun: a disk at distance 1 across its axis ---- */

TRC_INLINE vfloat trc_sun_density(const struct trc_wide_lamp *l, vfloat cosine) {
    return l->inv_area / (cosine * cosine * cosine);
}
TRC_INLINE struct trc_place trc_sun_sample(const struct trc_wide_lamp *l, vfloat u1, vfloat u2) {
    vvec3 a, b;
    v3_frame(l->position, &a, &b);
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    const vvec3 offset = v3_add(v3_scale(a, x * l->half_u), v3_scale(b, y * l->half_u));
    struct trc_place s;
    s.wi = v3_normalize(v3_add(l->position, offset));
    s.distance = vf_set(TRC_FAR);
    const vfloat c = v3_dot(l->position, s.wi), spread = vf_rcp(c * c * c);
    const vmask delta = vf_eq(l->half_u, vf_zero());
    const vmask even = vm_or(delta, trc_lamp_has(l, TRC_LAMP_EVEN_CONE));
    s.radiance = v3_scale(l->radiance, vf_select(even, vf_one(), spread));
    s.pdf = vf_select(delta, vf_one(), l->inv_area * spread);
    return s;
}

/* ---- area lights ---- */

/* What the slats let through towards -wi. */
TRC_INLINE vfloat trc_spread_factor(const struct trc_wide_lamp *l, vvec3 wi) {
    if (!vm_any(vf_gt(l->tan_spread, vf_zero())))
        return vf_one();
    const vfloat c = -v3_dot(l->normal, wi);
    const vfloat tangent = vf_divide(vf_safe_sqrt(vf_one() - c * c), c);
    const vfloat factor = (vf_one() - l->tan_spread * tangent) * l->spread_scale;
    return vf_select(vf_gt(l->tan_spread, vf_zero()), vf_max(factor, vf_zero()), vf_one());
}

/* A rectangle in the frame of its axes with the point at the origin: x0..x1, y0..y1 at depth z > 0,
 * cut to what the slats show of it. */
struct trc_view_rectangle {
    vfloat x0, x1, y0, y1, z;
    vmask lit; /* the point is in front and sees some of it */
};
TRC_INLINE struct trc_view_rectangle trc_rectangle_view(const struct trc_wide_lamp *l, vvec3 p) {
    const vvec3 to = v3_sub(l->position, p);
    const vfloat cx = v3_dot(to, l->axis_u), cy = v3_dot(to, l->axis_v);
    struct trc_view_rectangle r;
    r.z = -v3_dot(to, l->normal);
    r.x0 = cx - l->half_u;
    r.x1 = cx + l->half_u;
    r.y0 = cy - l->half_v;
    r.y1 = cy + l->half_v;
    const vmask narrow = vf_gt(l->tan_spread, vf_zero());
    if (vm_any(narrow)) {
        /* Light passes up to the slats' angle: a circle about the foot of the point. */
        const vfloat limit = vf_select(narrow, vf_divide(r.z, l->tan_spread), vf_set(INFINITY));
        r.x0 = vf_max(r.x0, -limit);
        r.x1 = vf_min(r.x1, limit);
        r.y0 = vf_max(r.y0, -limit);
        r.y1 = vf_min(r.y1, limit);
    }
    r.lit = vm_and(vf_gt(r.z, vf_zero()), vm_and(vf_lt(r.x0, r.x1), vf_lt(r.y0, r.y1)));
    return r;
}

/* Inner angles of the spherical rectangle (Urena et al., 3.2): normals of its sides have only these
 * z. */
struct trc_spherical_rectangle {
    vfloat b0, b1, k, solid_angle;
    vmask small;
};
/* a / sqrt(z2 + a^2) and b / sqrt(z2 + b^2), with one division. */
TRC_INLINE void trc_edge_slopes(vfloat z2, vfloat a, vfloat b, vfloat *slope_a, vfloat *slope_b) {
    const vfloat ra = vf_sqrt(z2 + a * a), rb = vf_sqrt(z2 + b * b);
    const vfloat inverse = vf_rcp(ra * rb);
    *slope_a = a * rb * inverse;
    *slope_b = b * ra * inverse;
}
TRC_INLINE struct trc_spherical_rectangle trc_rectangle_angles(const struct trc_view_rectangle *r,
                                                               bool is_ellipse) {
    /* Side at y0 runs along +x, at x1 along +y, at y1 along -x, at x0 along -y; z of the paper is
     * -r->z. An angle is acos(-a b) = pi/2 + asin(a b), which keeps its digits for small
     * rectangles. */
    const vfloat z2 = r->z * r->z;
    vfloat n0, n1, n2, n3;
    trc_edge_slopes(z2, -r->y0, r->y1, &n0, &n2);
    trc_edge_slopes(z2, r->x1, -r->x0, &n1, &n3);
    struct trc_spherical_rectangle q;
    const vfloat first = vf_asin(n0 * n1) + vf_asin(n1 * n2);
    const vfloat second = vf_asin(n2 * n3) + vf_asin(n3 * n0);
    q.b0 = n0;
    q.b1 = n2;
    q.k = vf_set(TRC_PI) - second;
    q.solid_angle = first + second;
    const float small = is_ellipse ? TRC_SMALL_ELLIPSE : TRC_SMALL_RECTANGLE;
    q.small = vm_not(vf_gt(q.solid_angle, vf_set(small)));
    return q;
}
/* Density at the place (x, y) of the view. Small ellipses are sampled all over, whatever the slats
 * show. */
TRC_INLINE vfloat trc_area_density(const struct trc_wide_lamp *l,
                                   const struct trc_view_rectangle *r,
                                   const struct trc_spherical_rectangle *q, bool is_ellipse,
                                   vfloat x, vfloat y) {
    const vfloat by_angle = vf_rcp(q->solid_angle);
    if (!vm_any(q->small))
        return vf_where(r->lit, by_angle);
    const vfloat d2 = x * x + y * y + r->z * r->z, cube = d2 * vf_sqrt(d2);
    const vfloat by_area =
        is_ellipse ? cube * l->inv_area / r->z : cube / ((r->x1 - r->x0) * (r->y1 - r->y0) * r->z);
    return vf_where(r->lit, vf_select(q->small, by_area, by_angle));
}

/* Place in the spherical rectangle (Urena et al., 3.3). */
TRC_INLINE void trc_spherical_place(const struct trc_view_rectangle *r,
                                    const struct trc_spherical_rectangle *q, vfloat u1, vfloat u2,
                                    vfloat *x_out, vfloat *y_out) {
    vfloat sa, ca;
    vf_sincos(u1 * q->solid_angle + q->k, &sa, &ca);
    /* With f = (b0 cos - b1) / sin the paper's cu is +-1 / sqrt(f^2 + b0^2), and the place along x
     * is z cu / sqrt(1 - cu^2) = +-z / sqrt(f^2 + b0^2 - 1). */
    const vfloat num = ca * q->b0 - q->b1;
    const vfloat below = num * num - (vf_one() - q->b0 * q->b0) * sa * sa;
    const vfloat ratio = sa * vf_rcp(vf_sqrt(vf_max(below, vf_set(1e-14f))));
    const vfloat x = vf_copysign(r->z * ratio, num * sa);
    *x_out = vf_min(vf_max(x, r->x0), r->x1);
    const vfloat d2 = *x_out * *x_out + r->z * r->z, d = vf_sqrt(d2);
    vfloat h0, h1;
    trc_edge_slopes(d2, r->y0, r->y1, &h0, &h1);
    const vfloat h = h0 + u2 * (h1 - h0), h2 = h * h;
    const vfloat y = vf_select(vf_lt(h2, vf_set(1.0f - 1e-6f)),
                               h * d * vf_rcp(vf_safe_sqrt(vf_one() - h2)), r->y1);
    *y_out = vf_min(vf_max(y, r->y0), r->y1);
}

TRC_INLINE struct trc_place trc_area_sample(const struct trc_wide_lamp *l, bool is_ellipse, vvec3 p,
                                            vfloat u1, vfloat u2) {
    const struct trc_view_rectangle r = trc_rectangle_view(l, p);
    const struct trc_spherical_rectangle q = trc_rectangle_angles(&r, is_ellipse);
    const vvec3 center = v3_sub(l->position, p);
    const vfloat cx = v3_dot(center, l->axis_u), cy = v3_dot(center, l->axis_v);
    vfloat x, y;
    trc_spherical_place(&r, &q, u1, u2, &x, &y);
    vmask inside = r.lit;
    if (is_ellipse) {
        const vfloat u = (x - cx) / l->half_u, v = (y - cy) / l->half_v;
        inside = vm_and(inside, vm_or(q.small, vf_le(u * u + v * v, vf_one())));
    }
    if (vm_any(q.small)) {
        vfloat even_x = vf_lerp(r.x0, r.x1, u1), even_y = vf_lerp(r.y0, r.y1, u2);
        if (is_ellipse) {
            trc_warp_disk(u1, u2, &even_x, &even_y);
            even_x = cx + even_x * l->half_u;
            even_y = cy + even_y * l->half_v;
        }
        x = vf_select(q.small, even_x, x);
        y = vf_select(q.small, even_y, y);
    }
    struct trc_place s;
    const vvec3 to =
        v3_sub(v3_add(v3_scale(l->axis_u, x), v3_scale(l->axis_v, y)), v3_scale(l->normal, r.z));
    s.wi = v3_normalize_length(to, &s.distance);
    s.pdf = vf_where(inside, trc_area_density(l, &r, &q, is_ellipse, x, y));
    s.radiance = v3_scale(l->radiance, trc_spread_factor(l, s.wi));
    return s;
}
/* Ray against a rectangle or an ellipse; u, v the place over the half sizes. */
TRC_INLINE vfloat trc_area_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *u,
                               vfloat *v) {
    const vvec3 to = v3_sub(l->position, p);
    const vfloat cosine = -v3_dot(l->normal, wi), z = -v3_dot(l->normal, to);
    const vfloat t = vf_divide(z, cosine);
    const vvec3 off = v3_sub(v3_scale(wi, t), to);
    *u = v3_dot(off, l->axis_u) / l->half_u;
    *v = v3_dot(off, l->axis_v) / l->half_v;
    const vmask front = vm_and(vf_gt(cosine, vf_zero()), vf_gt(z, vf_zero()));
    return vf_select(front, t, vf_set(INFINITY));
}

/* ---- triangles ---- */

struct trc_view_triangle {
    vvec3 a, b, c; /* corners from the point */
    vvec3 normal;  /* cross product of two edges: twice the area long */
    vfloat solid_angle;
    vmask small;
};
TRC_INLINE struct trc_view_triangle trc_triangle_view(const struct trc_corners *t, vvec3 p) {
    struct trc_view_triangle v;
    v.a = v3_sub(t->corner[0], p);
    v.b = v3_sub(t->corner[1], p);
    v.c = v3_sub(t->corner[2], p);
    v.normal = v3_cross(v3_sub(t->corner[1], t->corner[0]), v3_sub(t->corner[2], t->corner[0]));
    const vvec3 a = v3_normalize(v.a), b = v3_normalize(v.b), c = v3_normalize(v.c);
    const vfloat volume = vf_abs(v3_dot(a, v3_cross(b, c)));
    const vfloat below = vf_one() + v3_dot(a, b) + v3_dot(b, c) + v3_dot(c, a);
    v.solid_angle = vf_set(2.0f) * vf_atan2(volume, below);
    v.small = vm_not(vm_and(vf_gt(v.solid_angle, vf_set(TRC_SMALL_TRIANGLE)),
                            vf_lt(v.solid_angle, vf_set(6.0f))));
    return v;
}
/* Density of the place at distance along wi. */
TRC_INLINE vfloat trc_triangle_density(const struct trc_view_triangle *v, vvec3 wi,
                                       vfloat distance) {
    const vfloat twice_projected = vf_abs(v3_dot(v->normal, wi));
    const vfloat by_area = vf_divide(vf_set(2.0f) * distance * distance, twice_projected);
    return vf_select(v->small, by_area, vf_rcp(v->solid_angle));
}

/* Direction into the spherical triangle. */
static inline vvec3 trc_spherical_triangle(const struct trc_view_triangle *v, vfloat u1,
                                           vfloat u2) {
    const vvec3 a = v3_normalize(v->a), b = v3_normalize(v->b), c = v3_normalize(v->c);
    const vvec3 ab = v3_normalize(v3_cross(a, b)), ca = v3_normalize(v3_cross(c, a));
    /* The angle at a, and the cosine of the side c. */
    const vfloat cos_alpha = vf_clamp(-v3_dot(ab, ca), -1.0f, 1.0f);
    const vfloat sin_alpha = vf_safe_sqrt(vf_one() - cos_alpha * cos_alpha);
    const vfloat alpha = vf_acos(cos_alpha);
    vfloat s, t;
    vf_sincos(u1 * v->solid_angle - alpha, &s, &t);
    const vfloat p = t - cos_alpha, q = s + sin_alpha * v3_dot(a, b);
    const vfloat num = (q * t - p * s) * cos_alpha - q, den = (q * s + p * t) * sin_alpha;
    const vfloat cosine = vf_clamp(vf_divide(num, den), -1.0f, 1.0f);
    const vvec3 across = v3_normalize(v3_sub(c, v3_scale(a, v3_dot(c, a))));
    const vvec3 d = v3_mad(across, vf_safe_sqrt(vf_one() - cosine * cosine), v3_scale(a, cosine));
    const vfloat db = v3_dot(d, b);
    const vfloat z = vf_one() - u2 * (vf_one() - db);
    const vvec3 side = v3_normalize(v3_sub(d, v3_scale(b, db)));
    return v3_mad(side, vf_safe_sqrt((vf_one() - z) * (vf_one() + z)), v3_scale(b, z));
}

/* wi, distance, density and the barycentrics of the second and third corner. */
TRC_INLINE struct trc_place trc_triangle_sample(const struct trc_corners *t, vvec3 p, vfloat u1,
                                                vfloat u2, vfloat *u, vfloat *v) {
    const struct trc_view_triangle view = trc_triangle_view(t, p);
    vfloat b1, b2;
    trc_warp_triangle(u1, u2, &b1, &b2);
    if (!vm_all(view.small)) {
        const vvec3 w = trc_spherical_triangle(&view, u1, u2);
        /* Where the ray meets the plane (Moeller and Trumbore 1997), kept inside. */
        const vvec3 e1 = v3_sub(view.b, view.a), e2 = v3_sub(view.c, view.a);
        const vvec3 h = v3_cross(w, e2);
        const vfloat inverse = vf_divide(vf_one(), v3_dot(e1, h));
        const vvec3 s = v3_neg(view.a);
        const vfloat x = vf_saturate(v3_dot(s, h) * inverse);
        const vfloat y = vf_saturate(v3_dot(w, v3_cross(s, e1)) * inverse);
        const vfloat over = vf_max(x + y, vf_one());
        b1 = vf_select(view.small, b1, x / over);
        b2 = vf_select(view.small, b2, y / over);
    }
    const vvec3 to = v3_mad(v3_sub(view.b, view.a), b1, v3_mad(v3_sub(view.c, view.a), b2, view.a));
    struct trc_place s;
    s.wi = v3_normalize_length(to, &s.distance);
    s.pdf = trc_triangle_density(&view, s.wi, s.distance);
    s.radiance = v3_zero();
    *u = b1;
    *v = b2;
    return s;
}

/* ---- world ---- */

/* Cell of the map and density per solid angle. theta by v, azimuth by u. */
TRC_INLINE vfloat trc_map_density(const struct trc_world_map *map, vvec3 wi, vmask m) {
    vfloat u = vf_atan2(wi.y, wi.x) * vf_set(0.5f * TRC_INV_PI);
    u = vf_select(vf_lt(u, vf_zero()), u + vf_one(), u);
    const vfloat v = vf_acos(wi.z) * vf_set(TRC_INV_PI);
    const vfloat width = vf_set((float)map->width), height = vf_set((float)map->height);
    const vint x = vf_to_int(vf_min(u * width, width - vf_one()));
    const vint y = vf_to_int(vf_min(v * height, height - vf_one()));
    const vfloat density = vf_gather(map->density, y * vi_set((int32_t)map->width) + x, m);
    const vfloat sine = vf_safe_sqrt((vf_one() - wi.z) * (vf_one() + wi.z));
    return vf_divide(density, sine * vf_set(2.0f * TRC_PI * TRC_PI));
}

/* Interval of rising sums that holds u, and where in it: count intervals from base (per lane an
 * offset). */
TRC_INLINE vint trc_sum_search(const float *sums, vint base, uint32_t count, vfloat u, vmask m,
                               vfloat *within) {
    vint low = vi_set(0), size = vi_set((int32_t)count);
    /* Halves of odd sizes differ by one from lane to lane; a size of 1 stays where it is. */
    for (uint32_t left = count; left > 1; left = (left + 1) / 2) {
        const vint half = size >> 1;
        const vmask up = vf_le(vf_gather(sums, base + low + half, m), u);
        low = vi_select(up, low + half, low);
        size = vi_select(up, size - half, half);
    }
    const vfloat start = vf_gather(sums, base + low, m),
                 end = vf_gather(sums, base + low + vi_set(1), m);
    *within = vf_saturate(vf_divide(u - start, end - start));
    return low;
}
static inline vvec3 trc_map_sample(const struct trc_world_map *map, vfloat u1, vfloat u2, vmask m,
                                   vfloat *pdf) {
    vfloat dx, dy;
    const vint y = trc_sum_search(map->marginal, vi_set(0), map->height, u2, m, &dy);
    const vint row = y * vi_set((int32_t)map->width + 1);
    const vint x = trc_sum_search(map->rows, row, map->width, u1, m, &dx);
    const vfloat u = (vi_to_float(x) + dx) / vf_set((float)map->width);
    const vfloat v = (vi_to_float(y) + dy) / vf_set((float)map->height);
    vfloat sine, cosine, s, c;
    vf_sincos_turns(v * vf_set(0.5f), &sine, &cosine);
    vf_sincos_turns(u, &s, &c);
    const vfloat density = vf_gather(map->density, y * vi_set((int32_t)map->width) + x, m);
    *pdf = vf_divide(density, sine * vf_set(2.0f * TRC_PI * TRC_PI));
    return v3(sine * c, sine * s, cosine);
}

/* Chance of sampling the sun of the world: none where all of it is below the surface. */
TRC_INLINE vfloat trc_world_sun_chance(const struct trc_world_sun *sun, vvec3 n, vmask has_n) {
    const vfloat cosine = v3_dot(n, v3_set(sun->direction));
    const vmask below = vm_and(has_n, vf_lt(cosine, vf_set(-sun->sine)));
    return vf_select(below, vf_zero(), vf_set(sun->share));
}
/* Of its places, taken evenly on a disk that touches the sphere at its middle. */
TRC_INLINE vfloat trc_world_sun_density(const struct trc_world_sun *sun, vvec3 wi) {
    const vvec3 middle = v3_set(sun->direction), off = v3_sub(wi, middle);
    const vfloat c = v3_dot(wi, middle);
    const vfloat inv_area = vf_set(1.0f / (TRC_PI * sun->tangent * sun->tangent));
    return vf_where(vf_lt(v3_dot(off, off), vf_set(sun->square_chord)),
                    inv_area * vf_rcp(c * c * c));
}
TRC_INLINE vvec3 trc_world_sun_sample(const struct trc_world_sun *sun, vfloat u1, vfloat u2) {
    const vvec3 middle = v3_set(sun->direction);
    vvec3 a, b;
    v3_frame(middle, &a, &b);
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    const vvec3 off = v3_add(v3_scale(a, x), v3_scale(b, y));
    return v3_normalize(v3_mad(off, vf_set(sun->tangent), middle));
}

/* Without a map: by cosine above n, or over the sphere. */
TRC_INLINE vfloat trc_world_density(const struct trc_light_table *t, vvec3 n, vmask has_n, vvec3 wi,
                                    vmask m) {
    if (t->map) {
        const vfloat density = trc_map_density(t->map, wi, m);
        if (!(t->map->sun.share > 0.0f))
            return density;
        const vfloat chance = trc_world_sun_chance(&t->map->sun, n, has_n);
        const vfloat sun_density = trc_world_sun_density(&t->map->sun, wi);
        return density + chance * (sun_density - density);
    }
    const vfloat cosine = vf_max(v3_dot(n, wi), vf_zero()) * vf_set(TRC_INV_PI);
    return vf_select(has_n, cosine, vf_set(0.25f * TRC_INV_PI));
}
TRC_INLINE struct trc_place trc_world_sample(const struct trc_light_table *t, vvec3 n, vmask has_n,
                                             vfloat u1, vfloat u2, vmask m) {
    struct trc_place s;
    s.distance = vf_set(TRC_FAR);
    s.radiance = v3_zero();
    if (t->map && t->map->sun.share > 0.0f) {
        const vfloat chance = trc_world_sun_chance(&t->map->sun, n, has_n);
        const vmask is_sun = vf_lt(u1, chance);
        const vfloat rest = vf_divide(u1 - chance, vf_one() - chance);
        u1 = vf_min(vf_select(is_sun, vf_divide(u1, chance), rest), vf_set(0x1.fffffep-1f));
        const vvec3 to_sun = trc_world_sun_sample(&t->map->sun, u1, u2);
        s.wi = v3_select(is_sun, to_sun, trc_map_sample(t->map, u1, u2, m, &s.pdf));
        s.pdf = trc_world_density(t, n, has_n, s.wi, m);
        return s;
    }
    if (t->map) {
        s.wi = trc_map_sample(t->map, u1, u2, m, &s.pdf);
        return s;
    }
    vvec3 a, b;
    v3_frame(n, &a, &b);
    const vvec3 above = v3_from_frame(trc_warp_cosine(u1, u2), a, b, n);
    s.wi = v3_select(has_n, above, trc_warp_sphere(u1, u2));
    s.pdf = trc_world_density(t, n, has_n, s.wi, m);
    return s;
}

#endif
