/* Area lights whose axes are not at right angles: parents and instancers with uneven scales shear
 * them. They are lit as by Cycles, which takes the axes for orthogonal ones: a rectangle is sampled
 * in the frame of its axes by what the way to its corner (Blender 4: its centre) has along each,
 * and the place is put together from these again, which is another one. So light does not come from
 * a parallelogram, but the pictures agree. Rays meet both shapes by the same products
 * (kernels/light/lamps.h). Part of kernels/light/lamps.h. */
#ifndef TRACER_KERNELS_LIGHT_SHEARED_H
#define TRACER_KERNELS_LIGHT_SHEARED_H

/* A rectangle in its frame, and the frame's third axis, of the length that the first two give it.
 */
struct trc_sheared_view {
    struct trc_view_rectangle r;
    vvec3 depth;
};
TRC_INLINE struct trc_sheared_view trc_sheared_view(const struct trc_wide_lamp *l, vvec3 p) {
    struct trc_sheared_view s;
    vvec3 to = v3_sub(l->position, p);
    const vfloat height = -v3_dot(to, l->normal);
    s.r.lit = vf_gt(height, vf_zero());
    vfloat u0 = -l->half_u, u1 = l->half_u, v0 = -l->half_v, v1 = l->half_v;
    if (vm_any(vf_gt(l->tan_spread, vf_zero()))) {
        const vfloat limit = trc_slats_reach(l, height);
        const vvec3 foot = v3_neg(v3_add(to, v3_scale(l->normal, height)));
        const vfloat foot_u = v3_dot(foot, l->axis_u), foot_v = v3_dot(foot, l->axis_v);
        u0 = vf_max(u0, foot_u - limit);
        u1 = vf_min(u1, foot_u + limit);
        v0 = vf_max(v0, foot_v - limit);
        v1 = vf_min(v1, foot_v + limit);
        s.r.lit = vm_and(s.r.lit, vm_and(vf_lt(u0, u1), vf_lt(v0, v1)));
    }
    const vmask centered = trc_lamp_has(l, TRC_LAMP_CENTERED);
    const vfloat from_u = vf_select(centered, vf_set(0.5f) * (u0 + u1), u0);
    const vfloat from_v = vf_select(centered, vf_set(0.5f) * (v0 + v1), v0);
    to = v3_add(to, v3_add(v3_scale(l->axis_u, from_u), v3_scale(l->axis_v, from_v)));
    const vvec3 across = v3_cross(l->axis_u, l->axis_v);
    const vfloat z = v3_dot(to, across);
    s.depth = v3_scale(across, vf_copysign(vf_one(), z));
    s.r.z = vf_abs(z);
    s.r.x0 = v3_dot(to, l->axis_u) - (from_u - u0);
    s.r.y0 = v3_dot(to, l->axis_v) - (from_v - v0);
    s.r.x1 = s.r.x0 + (u1 - u0);
    s.r.y1 = s.r.y0 + (v1 - v0);
    return s;
}

/* Behind slats Cycles of Blender 4 leaves out places that rays would not meet. */
TRC_INLINE vmask trc_sheared_keeps(const struct trc_wide_lamp *l, vvec3 off) {
    const vfloat u = v3_dot(off, l->axis_u) / l->half_u, v = v3_dot(off, l->axis_v) / l->half_v;
    const vmask inside = vm_and(vf_le(vf_abs(u), vf_one()), vf_le(vf_abs(v), vf_one()));
    const vmask narrow = vf_gt(l->tan_spread, vf_zero());
    return vm_or(inside, vm_not(vm_and(trc_lamp_has(l, TRC_LAMP_CENTERED), narrow)));
}
TRC_INLINE struct trc_place trc_sheared_rectangle_sample(const struct trc_wide_lamp *l, vvec3 p,
                                                         vfloat u1, vfloat u2) {
    const struct trc_sheared_view view = trc_sheared_view(l, p);
    const struct trc_view_rectangle *r = &view.r;
    const struct trc_spherical_rectangle q = trc_rectangle_angles(r, false);
    vfloat x, y;
    trc_spherical_place(r, &q, u1, u2, &x, &y);
    x = vf_select(q.small, vf_lerp(r->x0, r->x1, u1), x);
    y = vf_select(q.small, vf_lerp(r->y0, r->y1, u2), y);
    const vvec3 to =
        v3_add(v3_add(v3_scale(l->axis_u, x), v3_scale(l->axis_v, y)), v3_scale(view.depth, r->z));
    struct trc_place s;
    s.wi = v3_normalize_length(to, &s.distance);
    s.pdf = vf_where(trc_sheared_keeps(l, v3_sub(to, v3_sub(l->position, p))),
                     trc_area_density(l, r, &q, false, x, y));
    s.radiance = v3_scale(l->radiance, trc_spread_factor(l, s.wi));
    return s;
}
TRC_INLINE vfloat trc_sheared_rectangle_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi,
                                            vfloat *pdf, vvec3 *radiance) {
    const vfloat t = trc_area_hit(l, false, p, wi, pdf, radiance);
    const struct trc_sheared_view view = trc_sheared_view(l, p);
    const struct trc_spherical_rectangle q = trc_rectangle_angles(&view.r, false);
    *pdf = vf_where(view.r.lit, vf_rcp(q.solid_angle));
    return t;
}
TRC_INLINE void trc_sheared_rectangle_place(const struct trc_wide_lamp *l,
                                            const struct trc_lamp_axes *a, vvec3 off, vvec3 out,
                                            struct trc_lamp_place *q) {
    trc_rectangle_place(l, a, off, out, q);
}

/* By area, of which it has what its axes span at right angles. */
TRC_INLINE vfloat trc_sheared_ellipse_density(const struct trc_wide_lamp *l, vvec3 wi,
                                              vfloat distance) {
    const vfloat cosine = -v3_dot(l->normal, wi);
    return vf_where(vf_gt(cosine, vf_zero()), vf_divide(distance * distance * l->inv_area, cosine));
}
TRC_INLINE struct trc_place trc_sheared_ellipse_sample(const struct trc_wide_lamp *l, vvec3 p,
                                                       vfloat u1, vfloat u2) {
    vfloat x, y;
    trc_warp_disk(u1, u2, &x, &y);
    const vvec3 off =
        v3_add(v3_scale(l->axis_u, x * l->half_u), v3_scale(l->axis_v, y * l->half_v));
    struct trc_place s;
    s.wi = v3_normalize_length(v3_add(v3_sub(l->position, p), off), &s.distance);
    s.pdf = trc_sheared_ellipse_density(l, s.wi, s.distance);
    s.radiance = v3_scale(l->radiance, trc_spread_factor(l, s.wi));
    return s;
}
TRC_INLINE vfloat trc_sheared_ellipse_hit(const struct trc_wide_lamp *l, vvec3 p, vvec3 wi,
                                          vfloat *pdf, vvec3 *radiance) {
    const vfloat t = trc_area_hit(l, true, p, wi, pdf, radiance);
    *pdf = trc_sheared_ellipse_density(l, wi, t);
    return t;
}
TRC_INLINE void trc_sheared_ellipse_place(const struct trc_wide_lamp *l,
                                          const struct trc_lamp_axes *a, vvec3 off, vvec3 out,
                                          struct trc_lamp_place *q) {
    trc_rectangle_place(l, a, off, out, q);
}

#endif
