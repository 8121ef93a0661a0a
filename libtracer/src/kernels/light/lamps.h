/* The kinds of lamps in the kernels: model/light_kinds.def lists them, shading/lamps.c makes them.
 *
 * Of each kind, by its name: sample, a place on the lamp for a point, the density per solid angle
 * of that place, the radiance it sends there; hit, the distance along a ray from the point,
 * infinite where it misses, the density that sample would have had, and the radiance; place, what
 * the lamp's nodes see there, unless it is a normal along the ray and no Parametric. Lamps that
 * are small as seen from the point are sampled by area: there the density is nearly constant
 * anyway, and spherical angles would lose their digits.
 *
 * C. Urena, M. Fajardo and A. King, "An Area-Preserving Parametrization for Spherical Rectangles"
 * (2013). */
#ifndef TRACER_KERNELS_LIGHT_LAMPS_H
#define TRACER_KERNELS_LIGHT_LAMPS_H

#include "kernels/light/place.h"
#include "model/lights.h"

/* Solid angles below it are sampled by area. Ellipses that are large are sampled as their
 * rectangle, whose corners give nothing: a fifth of the samples, but none with a huge weight. */
#define TRC_SMALL_RECTANGLE 4e-3f
#define TRC_SMALL_ELLIPSE 0.5f

struct trc_wide_lamp {
    vvec3 position, axis_u, axis_v, normal, radiance;
    vfloat half_u, half_v, cos_cone, inv_smooth, tan_spread, spread_scale, inv_area;
    vint kind, flags;
};

TRC_INLINE struct trc_wide_lamp trc_lamp_broadcast(const struct trc_lamp *l) {
    return (struct trc_wide_lamp){
        .position = v3_set(l->position),
        .axis_u = v3_set(l->axis_u),
        .axis_v = v3_set(l->axis_v),
        .normal = v3_set(l->normal),
        .radiance = v3_set(l->radiance),
        .half_u = vf_set(l->half_u),
        .half_v = vf_set(l->half_v),
        .cos_cone = vf_set(l->cos_cone),
        .inv_smooth = vf_set(l->inv_smooth),
        .tan_spread = vf_set(l->tan_spread),
        .spread_scale = vf_set(l->spread_scale),
        .inv_area = vf_set(l->inv_area),
        .flags = vi_set(l->flags),
        .kind = vi_set(l->kind),
    };
}
/* Lamps number index of each lane. */
TRC_INLINE struct trc_wide_lamp trc_lamp_gather(const struct trc_lamp *lamps, vint index, vmask m) {
    const vint at = index * vi_set(TRC_LAMP_WORDS);
    return (struct trc_wide_lamp){
        .position = v3_gather(lamps->position, at, m),
        .axis_u = v3_gather(lamps->axis_u, at, m),
        .axis_v = v3_gather(lamps->axis_v, at, m),
        .normal = v3_gather(lamps->normal, at, m),
        .radiance = v3_gather(lamps->radiance, at, m),
        .half_u = vf_gather(&lamps->half_u, at, m),
        .half_v = vf_gather(&lamps->half_v, at, m),
        .cos_cone = vf_gather(&lamps->cos_cone, at, m),
        .inv_smooth = vf_gather(&lamps->inv_smooth, at, m),
        .tan_spread = vf_gather(&lamps->tan_spread, at, m),
        .spread_scale = vf_gather(&lamps->spread_scale, at, m),
        .inv_area = vf_gather(&lamps->inv_area, at, m),
        .flags = vi_gather(&lamps->flags, at, m),
        .kind = vi_gather(&lamps->kind, at, m),
    };
}

/* For the nodes of a lamp: from world directions to its own. */
struct trc_lamp_axes {
    const float *to_light; /* rows */
    bool is_local;         /* TRC_LIGHT_LOCAL_UV */
};
TRC_INLINE vvec3 trc_lamp_local(const struct trc_lamp_axes *a, vvec3 w) {
    const float *m = a->to_light;
    return v3(v3_dot(v3_set(m), w), v3_dot(v3_set(m + 3), w), v3_dot(v3_set(m + 6), w));
}
/* A place on a lamp as its nodes see it: normal, and the two numbers of Parametric. */
struct trc_lamp_place {
    vvec3 n;
    vfloat x, y;
};

/* ---- point: a disk that faces whoever looks, or a sphere ---- */

TRC_INLINE vmask trc_lamp_has(const struct trc_wide_lamp *l, int32_t flag) {
    return vm_not(vi_eq(l->flags & vi_set(flag), vi_set(0)));
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
TRC_INLINE vfloat trc_point_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf,
                                vvec3 *radiance) {
    vfloat reach;
    *radiance = l->radiance;
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

/* off: of the place from the lamp's position; out: the way of the light. */
TRC_INLINE void trc_point_place(const struct trc_wide_lamp *l, const struct trc_lamp_axes *a,
                                vvec3 off, vvec3 out, struct trc_lamp_place *q) {
    const vmask ball = vm_and(trc_lamp_has(l, TRC_LAMP_SPHERE), vf_gt(l->half_u, vf_zero()));
    q->n = v3_select(ball, v3_normalize(off), out);
    const vvec3 w = a->is_local ? v3_normalize(trc_lamp_local(a, q->n)) : q->n;
    const vfloat u = vf_set(0.5f) - vf_atan2(w.x, w.y) * vf_set(0.5f * TRC_INV_PI);
    const vfloat v = vf_one() - vf_acos(vf_clamp(w.z, -1.0f, 1.0f)) * vf_set(TRC_INV_PI);
    /* 3.4 took them for barycentrics. */
    q->x = a->is_local ? u : vf_one() - u - v;
    q->y = a->is_local ? v : u;
}

/* ---- spot: a point behind a cone ---- */

/* The cosine to the axis of a stretched cone in the light's own space, where the cone is round. */
TRC_INLINE vfloat trc_spot_stretched(const struct trc_wide_lamp *l, vvec3 wi, vfloat c) {
    const vfloat x = v3_dot(l->axis_u, wi), y = v3_dot(l->axis_v, wi);
    return vf_divide(c, vf_sqrt(x * x + y * y + c * c));
}
TRC_INLINE vfloat trc_spot_factor(const struct trc_wide_lamp *l, vvec3 wi) {
    vfloat c = -v3_dot(l->normal, wi);
    const vmask stretched = trc_lamp_has(l, TRC_LAMP_STRETCHED);
    if (vm_any(stretched))
        c = vf_select(stretched, trc_spot_stretched(l, wi, c), c);
    const vfloat over = c - l->cos_cone;
    const vfloat t = vf_saturate(over * l->inv_smooth);
    const vfloat soft = t * t * (vf_set(3.0f) - vf_set(2.0f) * t);
    const vfloat edge = vf_select(vf_gt(l->inv_smooth, vf_zero()), soft, vf_one());
    const vfloat level = vf_select(trc_lamp_has(l, TRC_LAMP_EVEN_CONE), vf_one(), c);
    return vf_where(vf_gt(over, vf_zero()), level * edge);
}
TRC_INLINE struct trc_place trc_spot_sample(const struct trc_wide_lamp *l, vvec3 p, vfloat u1,
                                            vfloat u2) {
    struct trc_place s = trc_point_sample(l, p, u1, u2);
    s.radiance = v3_scale(s.radiance, trc_spot_factor(l, s.wi));
    return s;
}
TRC_INLINE vfloat trc_spot_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf,
                               vvec3 *radiance) {
    const vfloat t = trc_point_hit(l, p, wi, pdf, radiance);
    *radiance = v3_scale(*radiance, trc_spot_factor(l, wi));
    return t;
}

/* An image spans the cone, whatever its angle. */
TRC_INLINE void trc_spot_place(const struct trc_wide_lamp *l, const struct trc_lamp_axes *a,
                               vvec3 off, vvec3 out, struct trc_lamp_place *q) {
    trc_point_place(l, a, off, out, q);
    if (!a->is_local)
        return;
    const vvec3 w = trc_lamp_local(a, out);
    const vfloat sine = vf_safe_sqrt(vf_one() - l->cos_cone * l->cos_cone);
    const vfloat scale = vf_divide(vf_set(-0.5f) * l->cos_cone, sine * w.z);
    q->x = vf_set(0.5f) + w.x * scale;
    q->y = vf_set(0.5f) + w.y * scale;
}

/* ---- sun: a disk at distance 1 across its axis ---- */

TRC_INLINE vfloat trc_sun_density(const struct trc_wide_lamp *l, vfloat cosine) {
    return l->inv_area / (cosine * cosine * cosine);
}
TRC_INLINE struct trc_place trc_sun_sample(const struct trc_wide_lamp *l, vvec3 p, vfloat u1,
                                           vfloat u2) {
    (void)p;
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

TRC_INLINE vfloat trc_sun_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf,
                              vvec3 *radiance) {
    (void)p;
    const vfloat c = v3_dot(l->position, wi);
    *pdf = trc_sun_density(l, vf_max(c, vf_set(1e-3f)));
    const vmask even = trc_lamp_has(l, TRC_LAMP_EVEN_CONE);
    *radiance = v3_scale(l->radiance, vf_select(even, vf_one(), *pdf / l->inv_area));
    return vf_select(vf_ge(c, l->cos_cone), vf_set(TRC_FAR), vf_set(INFINITY));
}

/* An image spans its disk. */
TRC_INLINE void trc_sun_place(const struct trc_wide_lamp *l, const struct trc_lamp_axes *a,
                              vvec3 off, vvec3 out, struct trc_lamp_place *q) {
    (void)off;
    if (!a->is_local)
        return;
    const vvec3 w = v3_neg(trc_lamp_local(a, out));
    /* Twice the sine of half of the angular radius, and the distance of the ends of out and of a
     * unit vector towards the sun. */
    const vfloat chord = vf_sqrt(vf_set(2.0f) * (vf_one() - l->cos_cone));
    const vfloat apart = v3_length(v3_sub(l->position, out));
    const vfloat scale = vf_where(vf_gt(chord, vf_zero()), vf_divide(vf_one(), chord * apart));
    q->x = vf_set(0.5f) + w.x * scale;
    q->y = vf_set(0.5f) + w.y * scale;
}

/* ---- rectangle and ellipse: flat, shining from their front ---- */

/* What the slats let through towards -wi. */
TRC_INLINE vfloat trc_spread_factor(const struct trc_wide_lamp *l, vvec3 wi) {
    if (!vm_any(vf_gt(l->tan_spread, vf_zero())))
        return vf_one();
    const vfloat c = -v3_dot(l->normal, wi);
    const vfloat tangent = vf_divide(vf_safe_sqrt(vf_one() - c * c), c);
    const vfloat factor = (vf_one() - l->tan_spread * tangent) * l->spread_scale;
    return vf_select(vf_gt(l->tan_spread, vf_zero()), vf_max(factor, vf_zero()), vf_one());
}

/* How far from the foot of a point at that height slats show the light; any distance without. */
TRC_INLINE vfloat trc_slats_reach(const struct trc_wide_lamp *l, vfloat height) {
    const vmask narrow = vf_gt(l->tan_spread, vf_zero());
    return vf_select(narrow, vf_divide(height, l->tan_spread), vf_set(INFINITY));
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
    if (vm_any(vf_gt(l->tan_spread, vf_zero()))) {
        const vfloat limit = trc_slats_reach(l, r.z);
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
TRC_INLINE vfloat trc_area_hit(const struct trc_wide_lamp *l, bool is_ellipse, vvec3 p, vvec3 wi,
                               vfloat *pdf, vvec3 *radiance) {
    const vvec3 to_center = v3_sub(l->position, p);
    const vfloat cosine = -v3_dot(l->normal, wi), z = -v3_dot(l->normal, to_center);
    const vmask front = vm_and(vf_gt(cosine, vf_zero()), vf_gt(z, vf_zero()));
    const vfloat t = vf_select(front, vf_divide(z, cosine), vf_set(INFINITY));
    /* The place over the half sizes. */
    const vvec3 off = v3_sub(v3_scale(wi, vf_divide(z, cosine)), to_center);
    const vfloat u = v3_dot(off, l->axis_u) / l->half_u, v = v3_dot(off, l->axis_v) / l->half_v;
    const vmask round = vf_le(u * u + v * v, vf_one());
    const vmask square = vm_and(vf_le(vf_abs(u), vf_one()), vf_le(vf_abs(v), vf_one()));
    const vmask hit = is_ellipse ? round : square;
    *radiance = l->radiance;
    if (!vm_any(vm_and(hit, vf_lt(t, vf_set(INFINITY)))))
        return vf_set(INFINITY);
    *radiance = v3_scale(l->radiance, trc_spread_factor(l, wi));
    const struct trc_view_rectangle r = trc_rectangle_view(l, p);
    const struct trc_spherical_rectangle q = trc_rectangle_angles(&r, is_ellipse);
    const vvec3 to = v3_scale(wi, t);
    *pdf = trc_area_density(l, &r, &q, is_ellipse, v3_dot(to, l->axis_u), v3_dot(to, l->axis_v));
    return vf_select(hit, t, vf_set(INFINITY));
}

TRC_INLINE void trc_rectangle_place(const struct trc_wide_lamp *l, const struct trc_lamp_axes *a,
                                    vvec3 off, vvec3 out, struct trc_lamp_place *q) {
    const vfloat half = vf_set(0.5f);
    (void)a;
    (void)out;
    q->n = l->normal;
    q->x = half + half * v3_dot(off, l->axis_u) / l->half_u;
    q->y = half + half * v3_dot(off, l->axis_v) / l->half_v;
}

TRC_INLINE struct trc_place trc_rectangle_sample(const struct trc_wide_lamp *l, vvec3 p, vfloat u1,
                                                 vfloat u2) {
    return trc_area_sample(l, false, p, u1, u2);
}
TRC_INLINE vfloat trc_rectangle_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf,
                                    vvec3 *radiance) {
    return trc_area_hit(l, false, p, wi, pdf, radiance);
}
TRC_INLINE struct trc_place trc_ellipse_sample(const struct trc_wide_lamp *l, vvec3 p, vfloat u1,
                                               vfloat u2) {
    return trc_area_sample(l, true, p, u1, u2);
}
TRC_INLINE vfloat trc_ellipse_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi, vfloat *pdf,
                                  vvec3 *radiance) {
    return trc_area_hit(l, true, p, wi, pdf, radiance);
}

TRC_INLINE void trc_ellipse_place(const struct trc_wide_lamp *l, const struct trc_lamp_axes *a,
                                  vvec3 off, vvec3 out, struct trc_lamp_place *q) {
    trc_rectangle_place(l, a, off, out, q);
}

#include "kernels/light/sheared.h"

#endif
