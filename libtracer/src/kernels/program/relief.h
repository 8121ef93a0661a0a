/* The Bump node: slopes of a height from its values at three points of the surface; and wires,
 * which may be pixels wide.
 *
 * J. Blinn, "Simulation of Wrinkled Surfaces" (1978), in the form of M. Mikkelsen, "Bump Mapping
 * Unparametrized Surfaces on the GPU" (2010). The two points beside are one pixel's width away,
 * along the axes that Cycles takes: across the geometric normal, whatever the camera's. */
#ifndef TRACER_KERNELS_PROGRAM_RELIEF_H
#define TRACER_KERNELS_PROGRAM_RELIEF_H

#include "kernels/program/input.h"
#include "kernels/trace/valid_normal.h"

static bool has_triangles(const struct lane_group *g) { return g->mesh && !g->mesh->shape; }

/* Steps along the surface. */
static void pixel_steps(const struct trc_surface *s, vvec3 step[2]) {
    const vvec3 n = s->ng;
    const vmask even = vm_and(vf_eq(n.x, n.y), vf_eq(n.x, n.z));
    const vvec3 across = v3(n.z - n.y, vf_select(even, n.x + n.z, n.x - n.z),
                            vf_select(even, -n.y - n.x, n.y - n.x));
    const vvec3 unit = v3_normalize(across);
    step[0] = v3_scale(unit, s->pixel);
    step[1] = v3_scale(v3_cross(n, unit), s->pixel);
}

/* How far pixels are apart, as the ray sees them: the mean of both steps. */
static vfloat pixel_width(const struct trc_surface *s) {
    vvec3 step[2];
    vfloat sum = vf_zero();
    pixel_steps(s, step);
    for (int i = 0; i < 2; i++)
        sum = sum + v3_length(v3_sub(step[i], v3_scale(s->wo, v3_dot(step[i], s->wo))));
    return vf_set(0.5f) * sum;
}

/* 1 where a place on the triangle's plane is within half the size of one of its edges, in world
 * space. */
static vfloat op_wireframe(const struct trc_surface *s, uint32_t mode, vfloat size, vvec3 place) {
    if (mode & TRC_WIREFRAME_PIXELS)
        size = size * pixel_width(s);
    const vfloat reach2 = vf_square(size * vf_set(0.5f));
    vmask out = vm_none();
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!has_triangles(&g))
            continue;
        struct trc_corners c;
        struct trc_wide_affine a;
        group_corners(s, &g, &c);
        trc_load_affine(g.instance, s->time, &a);
        for (int k = 0; k < 3; k++)
            c.corner[k] = trc_transform_point(&a, c.corner[k]);
        for (int k = 0; k < 3; k++) {
            const vvec3 edge = v3_sub(c.corner[k], c.corner[(k + 2) % 3]);
            const vvec3 across = v3_cross(edge, v3_sub(place, c.corner[k]));
            const vmask near = vf_lt(v3_dot(across, across), v3_dot(edge, edge) * reach2);
            out = vm_or(out, vm_and(g.lanes, near));
        }
    }
    return vf_truth(out);
}

/* What a step in the plane of a triangle adds to U and V. */
static void step_in_triangle(const vvec3 side[2], vvec3 step, vfloat *du, vfloat *dv) {
    const vvec3 n = v3_cross(side[0], side[1]);
    const vfloat scale = vf_divide(vf_one(), v3_dot(n, n));
    *du = v3_dot(v3_cross(step, side[1]), n) * scale;
    *dv = v3_dot(v3_cross(side[0], step), n) * scale;
}

/* The surface at a point beside: in the plane of the triangle, beyond its edges too. All but the
 * place stays. As in Cycles, attributes of a surface seen from behind are those of the point on the
 * other side. */
static void point_beside(const struct trc_surface *s, bool is_along_y, vfloat filter_width,
                         struct trc_surface *out) {
    vvec3 steps[2];
    pixel_steps(s, steps);
    const vvec3 step = v3_scale(steps[is_along_y], filter_width);
    const vfloat facing = vf_select(s->backfacing, vf_set(-1.0f), vf_one());
    *out = *s;
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.mesh)
            continue;
        vvec3 side[2];
        group_sides(s, &g, side);
        vfloat du, dv;
        step_in_triangle(side, v3_scale(step, facing), &du, &dv);
        out->p = v3_select(g.lanes, v3_add(s->p, step), out->p);
        out->u = vf_select(g.lanes, s->u + du, out->u);
        out->v = vf_select(g.lanes, s->v + dv, out->v);
    }
}

/* Gives a point beside the normal that smooth triangles have there; others keep theirs. */
static void normal_beside(struct trc_surface *beside) {
    vmask triangles = vm_none();
    struct lane_group g = groups_begin(beside);
    while (groups_next(beside, &g))
        if (has_triangles(&g))
            triangles = vm_or(triangles, g.lanes);
    if (vm_any(triangles))
        beside->n = v3_select(triangles, trc_normal_between(beside, triangles), beside->n);
}

/* The point before displacement, and the mean length of both steps there, as Cycles has it, in
 * those of now. */
static void op_rest(const struct trc_surface *s, vfloat *out) {
    vvec3 steps[2], p = s->p;
    vfloat length = s->pixel;
    pixel_steps(s, steps);
    struct lane_group g = groups_begin(s);
    while (groups_next(s, &g)) {
        if (!g.mesh || !g.mesh->rest)
            continue;
        const struct trc_mesh *mesh = g.mesh;
        vint index[3];
        struct trc_corners c;
        struct trc_wide_affine m;
        vvec3 side[2], rest[2];
        vfloat sum = vf_zero();
        group_sides(s, &g, side);
        trc_load_indices(mesh, s->triangle, g.lanes, index);
        trc_load_vectors(mesh->rest, index, mesh->vertex_count, mesh->key_count, s->time, g.lanes,
                         &c);
        trc_load_affine(g.instance, s->time, &m);
        for (int i = 0; i < 2; i++)
            rest[i] = trc_transform_vector(&m, v3_sub(c.corner[i + 1], c.corner[0]));
        for (int i = 0; i < 2; i++) {
            vfloat du, dv;
            step_in_triangle(side, steps[i], &du, &dv);
            sum = sum + v3_length(v3_mad(rest[0], du, v3_scale(rest[1], dv)));
        }
        const vvec3 there = trc_transform_point(&m, corners_mix(corner_weights(s), c.corner));
        p = v3_select(g.lanes, there, p);
        length = vf_select(g.lanes, sum * vf_set(0.5f), length);
    }
    v3_write(out + TRC_OP_OUT_AT(REST, position), p);
    /* Where there is no pixel, nothing asks for slopes. */
    out[TRC_OP_OUT_AT(REST, step)] =
        vf_select(vf_gt(s->pixel, vf_zero()), vf_divide(length, s->pixel), vf_one());
}

/* The normal n turned by the slope of the heights; n and steps are in one space. */
static vvec3 turn_normal(uint32_t mode, vvec3 n, const vvec3 step[2], const vfloat *in) {
    const vfloat zero = vf_zero(), middle = in[TRC_OP_AT(BUMP, middle)];
    const vvec3 x = v3_cross(step[1], n), y = v3_cross(n, step[0]);
    const vfloat area = v3_dot(step[0], x);
    const vvec3 slope = v3_add(v3_scale(x, in[TRC_OP_AT(BUMP, beside_x)] - middle),
                               v3_scale(y, in[TRC_OP_AT(BUMP, beside_y)] - middle));
    vfloat distance = in[TRC_OP_AT(BUMP, distance)];
    distance = vf_select(vf_lt(area, zero), -distance, vf_where(vf_gt(area, zero), distance));
    if (mode & TRC_BUMP_INVERT)
        distance = -distance;
    const vvec3 turned = v3_normalize(v3_sub(
        v3_scale(n, in[TRC_OP_AT(BUMP, filter_width)] * vf_abs(area)), v3_scale(slope, distance)));
    const vfloat strength = vf_max(in[TRC_OP_AT(BUMP, strength)], zero);
    const vvec3 mixed = v3_normalize(v3_mad(turned, strength, v3_scale(n, vf_one() - strength)));
    /* Where there is no slope, or no pixel: 0, or not a number. */
    return v3_select(vf_gt(v3_dot(turned, turned), zero), mixed, n);
}

static vvec3 op_bump(const struct trc_surface *s, uint32_t mode, const vfloat *in) {
    const vvec3 n = v3_read(in + TRC_OP_AT(BUMP, normal));
    vvec3 step[2];
    pixel_steps(s, step);
    vvec3 out = turn_normal(mode, n, step, in);
    struct lane_group g = groups_begin(s);
    while (mode & TRC_BUMP_IN_OBJECT && groups_next(s, &g)) {
        if (!g.instance)
            continue;
        struct trc_wide_affine to_object, to_world;
        load_world_to_instance(g.instance, s->time, &to_object);
        trc_load_affine(g.instance, s->time, &to_world);
        const vvec3 own[2] = {trc_transform_vector(&to_object, step[0]),
                              trc_transform_vector(&to_object, step[1])};
        const vvec3 turned = turn_normal(mode, normal_to_object(&to_world, n), own, in);
        out = v3_select(g.lanes, normal_to_world(&to_world, turned), out);
    }
    return mode & TRC_BUMP_ABOVE ? valid_normal(s, out) : out;
}

#endif
