/* Places on emissive triangles.
 *
 * J. Arvo, "Stratified Sampling of Spherical Triangles" (1995); A. van Oosterom and J. Strackee,
 * "The Solid Angle of a Plane Triangle" (1983). */
#ifndef TRACER_KERNELS_LIGHT_TRIANGLE_H
#define TRACER_KERNELS_LIGHT_TRIANGLE_H

#include "kernels/light/place.h"
#include "kernels/trace/mesh_fetch.h"

/* Solid angles below it are sampled by area. */
#define TRC_SMALL_TRIANGLE 2e-2f

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

#endif
