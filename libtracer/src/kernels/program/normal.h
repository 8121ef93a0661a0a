/* The Normal Map and Tangent nodes. */
#ifndef TRACER_KERNELS_PROGRAM_NORMAL_H
#define TRACER_KERNELS_PROGRAM_NORMAL_H

#include "kernels/program/input.h"
#include "kernels/trace/curve_surface.h"

/* Normals at the corners in object space (unit) and the lanes that have them: those of smooth
 * triangles. */
static vmask load_normals(const struct trc_surface *s, const struct lane_group *g,
                          const vint index[3], struct trc_corners *n) {
    const struct trc_mesh *mesh = g->mesh;
    for (int k = 0; k < 3; k++)
        n->corner[k] = v3_zero();
    if (!mesh->corner_normals && (!mesh->smooth || !mesh->vertex_normals))
        return vm_none();
    vmask smooth = g->lanes;
    if (mesh->smooth) {
        uint32_t bits = 0;
        for (uint32_t rest = vm_bits(g->lanes); rest; rest &= rest - 1) {
            const int lane = __builtin_ctz(rest);
            bits |= (uint32_t)(mesh->smooth[vi_get(s->triangle, lane)] != 0) << lane;
        }
        smooth = vm_from_bits(bits);
    }
    if (mesh->corner_normals) {
        const vint first = s->triangle * vi_set(3);
        const vint corners[3] = {first, first + vi_set(1), first + vi_set(2)};
        trc_load_vectors(mesh->corner_normals, corners, 3 * mesh->triangle_count, mesh->key_count,
                         s->time, smooth, n);
    } else if (vm_any(smooth)) {
        trc_load_vectors(mesh->vertex_normals, index, mesh->vertex_count, mesh->key_count, s->time,
                         smooth, n);
    }
    return smooth;
}

/* Direction of growing U on the triangle, of any length, and the sign of its UV area, as Mikkelsen,
 * "Simulation of Wrinkled Surfaces Revisited", 2008 (MikkTSpace), has them for one triangle. */
static vvec3 triangle_tangent(const struct trc_attribute *uv, vint triangle, const vvec3 p[3],
                              vmask lanes, vfloat *sign) {
    vfloat u[3], v[3];
    attribute_corners(uv, 0, triangle, lanes, u);
    attribute_corners(uv, 1, triangle, lanes, v);
    const vvec3 e1 = v3_sub(p[1], p[0]), e2 = v3_sub(p[2], p[0]);
    const vfloat u1 = u[1] - u[0], v1 = v[1] - v[0], u2 = u[2] - u[0], v2 = v[2] - v[0];
    const vfloat area = u1 * v2 - v1 * u2;
    *sign = vf_select(vf_gt(area, vf_zero()), vf_one(), vf_set(-1.0f));
    const vvec3 t = v3_scale(v3_sub(v3_scale(e1, v2), v3_scale(e2, v1)), *sign);
    const vvec3 fallback = v3(vf_one(), vf_zero(), vf_zero());
    return v3_select(vf_ne(area, vf_zero()), t, fallback);
}

/* Directions of growing U at the corners, of any length, and the sign of the UV area: as the
 * attribute says or, of a UV map, those of the triangle alone. */
static void corner_tangents(const struct trc_attribute *a, vint triangle, const vvec3 p[3],
                            vmask lanes, vvec3 t[3], vfloat *sign) {
    if (a->width == 2) {
        t[0] = t[1] = t[2] = triangle_tangent(a, triangle, p, lanes, sign);
        return;
    }
    const vvec3 e1 = v3_sub(p[1], p[0]), e2 = v3_sub(p[2], p[0]);
    vfloat along1[3], along2[3], signs[3];
    attribute_corners(a, 0, triangle, lanes, along1);
    attribute_corners(a, 1, triangle, lanes, along2);
    attribute_corners(a, 2, triangle, lanes, signs);
    for (int k = 0; k < 3; k++)
        t[k] = v3_mad(e1, along1[k], v3_scale(e2, along2[k]));
    *sign = signs[0];
}

/* Interpolated normal and tangent, not normalised, of one object's lanes in object space. */
static void tangent_frame(const struct trc_surface *s, const struct lane_group *g,
                          const struct trc_attribute *a, vvec3 *normal, vvec3 *tangent,
                          vfloat *sign) {
    const struct trc_mesh *mesh = g->mesh;
    const vvec3 w = corner_weights(s);
    vint index[3];
    struct trc_corners p, n;
    trc_load_indices(mesh, s->triangle, g->lanes, index);
    trc_load_vectors(mesh->positions, index, mesh->vertex_count, mesh->key_count, s->time, g->lanes,
                     &p);
    vvec3 along[3];
    corner_tangents(a, s->triangle, p.corner, g->lanes, along, sign);
    const vmask smooth = load_normals(s, g, index, &n);
    if (vm_any(vm_andnot(g->lanes, smooth))) {
        const vvec3 flat = v3_normalize(
            v3_cross(v3_sub(p.corner[1], p.corner[0]), v3_sub(p.corner[2], p.corner[0])));
        for (int k = 0; k < 3; k++)
            n.corner[k] = v3_select(smooth, n.corner[k], flat);
    }
    for (int k = 0; k < 3; k++) {
        const vfloat across = v3_dot(n.corner[k], along[k]);
        along[k] = v3_normalize(v3_sub(along[k], v3_scale(n.corner[k], across)));
    }
    *normal = corners_mix(w, n.corner);
    *tangent = corners_mix(w, along);
}

/* The mapped normal of one object's lanes, world space, on the side of the winding; c in [-1, 1].
 */
static vvec3 normal_of_group(const struct trc_surface *s, const struct lane_group *g, uint32_t mode,
                             const struct trc_attribute *a, vvec3 c) {
    const uint32_t space = mode & TRC_NORMAL_MAP_SPACE_MASK;
    if (space == TRC_NORMAL_MAP_WORLD || space == TRC_NORMAL_MAP_BLENDER_WORLD)
        return v3_normalize(c);
    vvec3 n = c;
    if (space == TRC_NORMAL_MAP_TANGENT) {
        vvec3 normal, tangent;
        vfloat sign;
        tangent_frame(s, g, a, &normal, &tangent, &sign);
        if (mode & TRC_NORMAL_MAP_UNIT)
            normal = v3_normalize(normal);
        const vvec3 bitangent = v3_scale(v3_cross(normal, tangent), sign);
        n = v3_mad(tangent, c.x, v3_mad(bitangent, c.y, v3_scale(normal, c.z)));
    }
    struct trc_wide_affine m;
    trc_load_affine(g->instance, s->time, &m);
    return normal_to_world(&m, n);
}

/* What a colour of a map says, of length 1 in most maps. */
TRC_INLINE vvec3 normal_of_color(uint32_t mode, vvec3 color) {
    const vfloat half = vf_set(0.5f), two = vf_set(2.0f);
    const vvec3 c = v3(two * (color.x - half), two * (color.y - half), two * (color.z - half));
    const bool is_blender = (mode & TRC_NORMAL_MAP_SPACE_MASK) >= TRC_NORMAL_MAP_BLENDER_OBJECT;
    const bool turns_y = is_blender != !!(mode & TRC_NORMAL_MAP_DOWN);
    return v3(c.x, turns_y ? -c.y : c.y, is_blender ? -c.z : c.z);
}

/* The shading normal stays where there is no such attribute. */
static vvec3 op_normal_map(const struct trc_surface *s, uint32_t mode, uint32_t name,
                           vfloat strength, vvec3 color) {
    const bool is_tangent = (mode & TRC_NORMAL_MAP_SPACE_MASK) == TRC_NORMAL_MAP_TANGENT;
    vvec3 c = normal_of_color(mode, color);
    if (is_tangent && mode & TRC_NORMAL_MAP_SCALED) {
        const vfloat height = vf_one() + vf_saturate(strength) * (c.z - vf_one());
        c = v3(c.x * strength, c.y * strength, height);
        strength = vf_one();
    }
    const vmask full = vf_eq(strength, vf_one());
    vvec3 out = s->n;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.instance)
            continue;
        const struct trc_attribute *a = mesh_attribute(g.mesh, name, 2);
        if (is_tangent && !a)
            continue;
        vvec3 n = normal_of_group(s, &g, mode, a, c);
        n = v3_select(s->backfacing, v3_neg(n), n);
        if (!vm_all(full)) {
            const vvec3 moved = v3_mad(v3_sub(n, s->n), vf_max(strength, vf_zero()), s->n);
            n = v3_select(full, n, v3_normalize(moved));
        }
        n = v3_select(vf_gt(v3_dot(n, n), vf_zero()), n, s->n);
        out = v3_select(g.lanes, n, out);
    }
    return out;
}

/* Around an axis of the Generated coordinates, object space; of what has none Cycles takes the
 * place in the world. */
static vvec3 tangent_around(const struct trc_surface *s, const struct lane_group *g,
                            uint32_t mode) {
    const vvec3 at = has_no_generated(g->mesh) ? s->p : generated_of_group(s, g);
    const vvec3 half = v3_splat(vf_set(0.5f)), p = v3_sub(at, half);
    switch (mode) {
    case TRC_TANGENT_X:
        return v3(vf_zero(), -p.z, p.y);
    case TRC_TANGENT_Y:
        return v3(-p.z, vf_zero(), p.x);
    default:
        return v3(-p.y, p.x, vf_zero());
    }
}

/* Along the surface; 0 where there is no such attribute. */
static vvec3 op_tangent(const struct trc_surface *s, uint32_t mode, uint32_t name) {
    vvec3 out = v3_zero();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.instance)
            continue;
        vvec3 normal, along;
        vfloat sign;
        if (mode == TRC_TANGENT_UV) {
            const struct trc_attribute *a = mesh_attribute(g.mesh, name, 2);
            if (!a)
                continue;
            tangent_frame(s, &g, a, &normal, &along, &sign);
        } else {
            along = tangent_around(s, &g, mode);
        }
        struct trc_wide_affine m;
        trc_load_affine(g.instance, s->time, &m);
        const vvec3 world = normal_to_world(&m, along);
        const vvec3 t = v3_cross(s->n, v3_normalize(v3_cross(world, s->n)));
        out = v3_select(g.lanes, t, out);
    }
    return out;
}

/* Along strands, unit; else around Z. */
static vvec3 op_default_tangent(const struct trc_surface *s) {
    const vvec3 around = op_tangent(s, TRC_TANGENT_Z, TRC_NO_RESOURCE);
    if (!(s->snapshot->features & TRC_FEATURE_CURVES))
        return around;
    vmask strands = vm_none();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (g.instance && g.mesh->strands && !trc_shape_is_balls(g.mesh->shape))
            strands = vm_or(strands, g.lanes);
    }
    return vm_any(strands) ? v3_select(strands, trc_curve_along(s, strands), around) : around;
}

/* From tangent space to the world, about the shading normal; without that attribute the tangent is
 * the first side of the triangle. */
static vvec3 op_tangent_vector(const struct trc_surface *s, uint32_t name, vvec3 v) {
    vvec3 out = v;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.instance)
            continue;
        struct trc_wide_affine m;
        vvec3 normal, tangent;
        vfloat sign = vf_one();
        const struct trc_attribute *a = mesh_attribute(g.mesh, name, 2);
        trc_load_affine(g.instance, s->time, &m);
        if (a) {
            tangent_frame(s, &g, a, &normal, &tangent, &sign);
        } else {
            struct trc_corners p;
            group_corners(s, &g, &p);
            tangent = v3_normalize(v3_sub(p.corner[1], p.corner[0]));
        }
        normal = normal_to_object(&m, s->n);
        const vvec3 bitangent = v3_scale(v3_normalize(v3_cross(normal, tangent)), sign);
        const vvec3 sum = v3_mad(tangent, v.x, v3_mad(normal, v.y, v3_scale(bitangent, v.z)));
        out = v3_select(g.lanes, trc_transform_vector(&m, sum), out);
    }
    return out;
}

#endif
