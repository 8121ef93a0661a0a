/* The surface at hits of curves: see curve_surface.h. As Cycles has it: ribbons face the ray, with
 * the normals of a round one; both have the tangents of the smooth curve, not of its pieces. */
#include "kernels/trace/curve_surface.h"

#include "kernels/trace/mesh_fetch.h"
#include "kernels/trace/packet.h"

/* What is read of a lane. */
struct raw_curve {
    float p[2][3], r[2];       /* ends of the piece */
    float before[3], after[3]; /* the vertices beside them, or themselves at an end of the strand */
    float m[TRC_AFFINE_FLOATS];
    float shape; /* TRC_SHAPE_* */
    float u;     /* along the piece; balls: 0 */
};
#define RAW_FLOATS ((int)(sizeof(struct raw_curve) / sizeof(float)))
#define RAW_AT(field) ((int)(offsetof(struct raw_curve, field) / sizeof(float)))

vmask trc_curve_lanes(const struct trc_surface *s) {
    uint32_t bits = 0;
    for (uint32_t lanes = vm_bits(s->active); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const struct trc_instance *instance = &s->snapshot->instances[vi_get(s->instance, lane)];
        bits |= (uint32_t)(s->snapshot->meshes[instance->mesh]->strands != NULL) << lane;
    }
    return vm_from_bits(bits);
}

/* Returns the strand. */
static int32_t lane_load(const struct trc_surface *s, int lane, struct raw_curve *out) {
    const struct trc_instance *instance = &s->snapshot->instances[vi_get(s->instance, lane)];
    const struct trc_mesh *mesh = s->snapshot->meshes[instance->mesh];
    const uint32_t piece = (uint32_t)vi_get(s->triangle, lane);
    const float time = vf_get(s->time, lane);
    uint32_t ends[3];
    float ignored;
    trc_mesh_corners(mesh, piece, ends);
    const bool balls = trc_shape_is_balls(mesh->shape);
    const bool first = balls || trc_piece_is_first(mesh, piece);
    const bool last = balls || trc_piece_is_last(mesh, piece);
    for (int end = 0; end < 2; end++)
        trc_curve_vertex_at(mesh, ends[end], time, out->p[end], &out->r[end]);
    trc_curve_vertex_at(mesh, ends[0] - !first, time, out->before, &ignored);
    trc_curve_vertex_at(mesh, ends[1] + !last, time, out->after, &ignored);
    trc_affine_at(instance, time, out->m);
    out->shape = (float)mesh->shape;
    out->u = balls ? 0.0f : vf_get(s->u, lane);
    return (int32_t)(balls ? piece : mesh->strands[piece]);
}

TRC_INLINE vfloat raw_column(const struct raw_curve *raw, int at) {
    return trc_column_of((const float *)raw, RAW_FLOATS, at);
}
TRC_INLINE vvec3 raw_vector(const struct raw_curve *raw, int at) {
    return v3(raw_column(raw, at), raw_column(raw, at + 1), raw_column(raw, at + 2));
}

/* Lanes of the matrix, and the columns of its cofactors, which take normals to the world. */
struct space {
    struct trc_wide_affine to_world;
    vvec3 cofactors[3];
    vfloat determinant;
};

static void space_load(const struct raw_curve *raw, struct space *out) {
    for (int k = 0; k < 3; k++)
        out->to_world.column[k] =
            v3(raw_column(raw, RAW_AT(m) + k), raw_column(raw, RAW_AT(m) + 4 + k),
               raw_column(raw, RAW_AT(m) + 8 + k));
    out->to_world.origin = v3(raw_column(raw, RAW_AT(m) + 3), raw_column(raw, RAW_AT(m) + 7),
                              raw_column(raw, RAW_AT(m) + 11));
    /* Scaled to 1, so that products of columns neither overflow nor vanish. */
    vfloat maximum = vf_zero();
    vvec3 c[3];
    for (int k = 0; k < 3; k++)
        maximum = vf_max(maximum, v3_max(v3_abs(out->to_world.column[k])));
    for (int k = 0; k < 3; k++)
        c[k] = v3_scale(out->to_world.column[k], vf_divide(vf_one(), maximum));
    for (int k = 0; k < 3; k++)
        out->cofactors[k] = v3_cross(c[(k + 1) % 3], c[(k + 2) % 3]);
    out->determinant = v3_dot(c[0], out->cofactors[0]);
}

/* A direction of the world in object space, unit: rows of the inverse are the cofactors over the
 * determinant. */
static vvec3 direction_to_object(const struct space *m, vvec3 d) {
    const vvec3 object =
        v3(v3_dot(m->cofactors[0], d), v3_dot(m->cofactors[1], d), v3_dot(m->cofactors[2], d));
    return v3_scale(v3_normalize(object), vf_copysign(vf_one(), m->determinant));
}

static vvec3 normal_to_world(const struct space *m, vvec3 n) {
    const vvec3 sum =
        v3_mad(m->cofactors[0], n.x, v3_mad(m->cofactors[1], n.y, v3_scale(m->cofactors[2], n.z)));
    return v3_scale(v3_normalize(sum), vf_copysign(vf_one(), m->determinant));
}

/* Along the smooth curve in object space, unit. */
static vvec3 along_of(const struct raw_curve *raw, vfloat u) {
    const vvec3 p0 = raw_vector(raw, RAW_AT(p)), p1 = raw_vector(raw, RAW_AT(p) + 3);
    return v3_normalize(trc_between3(v3_sub(p1, raw_vector(raw, RAW_AT(before))),
                                     v3_sub(raw_vector(raw, RAW_AT(after)), p0), u));
}

vvec3 trc_curve_along(const struct trc_surface *s, vmask lanes) {
    struct raw_curve raw[TRC_WIDTH];
    memset(raw, 0, sizeof raw);
    for (uint32_t bits = vm_bits(lanes); bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits);
        lane_load(s, lane, &raw[lane]);
    }
    struct space m;
    space_load(raw, &m);
    return v3_normalize(
        trc_transform_vector(&m.to_world, along_of(raw, raw_column(raw, RAW_AT(u)))));
}

vvec3 trc_curve_true_normal(const struct trc_surface *s) {
    uint32_t ribbons = 0;
    for (uint32_t lanes = vm_bits(vm_and(s->active, trc_on_strand(s))); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const struct trc_instance *instance = &s->snapshot->instances[vi_get(s->instance, lane)];
        const bool is_ribbon = s->snapshot->meshes[instance->mesh]->shape == TRC_SHAPE_RIBBONS;
        ribbons |= (uint32_t)is_ribbon << lane;
    }
    return v3_select(vm_from_bits(ribbons), s->wo, s->ng);
}

/* The normal of a ball from how far the ray passes its middle, across (kernels/trace/curve.h). */
static vvec3 ball_normal(vvec3 d, vfloat x, vfloat y, vfloat front) {
    const vfloat ax = vf_abs(d.x), ay = vf_abs(d.y), az = vf_abs(d.z);
    const vmask is_x = vm_and(vf_ge(ax, ay), vf_ge(ax, az)), is_y = vm_andnot(vf_ge(ay, az), is_x);
    const vfloat du = vf_select(is_x, d.y, vf_select(is_y, d.z, d.x)),
                 dv = vf_select(is_x, d.z, vf_select(is_y, d.x, d.y)),
                 dz = vf_select(is_x, d.x, vf_select(is_y, d.y, d.z));
    const vfloat su = du / dz, sv = dv / dz;
    const vfloat w = vf_one() + sv * sv, q = w + su * su;
    const vfloat yy = vf_one() / vf_sqrt(w), per_length = vf_one() / vf_sqrt(q);
    /* The turn's rows are the unit vectors across: in the order u, v, z. */
    const vfloat xu = vf_sqrt(w) * per_length, xv = -(su * sv) * (per_length * yy),
                 xz = -(xu * su + xv * sv), yv = yy, yz = -(yy * sv);
    const vfloat along = vf_sqrt(vf_max(vf_one() - x * x - y * y, vf_zero())) * front;
    const vfloat nu = x * xu - along * du, nv = x * xv + y * yv - along * dv,
                 nz = x * xz + y * yz - along * dz;
    return v3(vf_select(is_x, nz, vf_select(is_y, nv, nu)),
              vf_select(is_x, nu, vf_select(is_y, nz, nv)),
              vf_select(is_x, nv, vf_select(is_y, nu, nz)));
}

/* Half-ulps that a position may be off by, of where it is and of the radius: ends 2 at most between
 * keys, the middle 3, the way across 4 of the radius, the sum 1, the matrix 8. */
#define ERROR_STEPS vf_set(24.0f * 0x1.0001p-24f)

void trc_curve_fetch(struct trc_surface *s, vmask lanes) {
    struct raw_curve raw[TRC_WIDTH];
    int32_t strands[TRC_WIDTH];
    memset(raw, 0, sizeof raw);
    vi_store(strands, s->strand);
    for (uint32_t bits = vm_bits(lanes); bits; bits &= bits - 1) {
        const int lane = __builtin_ctz(bits);
        strands[lane] = lane_load(s, lane, &raw[lane]);
    }
    s->strand = vi_load(strands);
    struct space m;
    space_load(raw, &m);
    const vfloat u = raw_column(raw, RAW_AT(u)), one = vf_one(), zero = vf_zero();
    const vfloat shape = raw_column(raw, RAW_AT(shape));
    const vmask ribbon = vf_eq(shape, vf_set(TRC_SHAPE_RIBBONS)),
                ball = vf_ge(shape, vf_set(TRC_SHAPE_BALLS));
    const vvec3 p0 = raw_vector(raw, RAW_AT(p)), p1 = raw_vector(raw, RAW_AT(p) + 3);
    const vfloat r0 = raw_column(raw, RAW_AT(r)), r1 = raw_column(raw, RAW_AT(r) + 1);
    const vvec3 middle = trc_between3(p0, p1, u);
    const vfloat radius = trc_between(r0, r1, u);
    const vvec3 along = along_of(raw, u);
    const vvec3 d = direction_to_object(&m, v3_neg(s->wo));
    const vmask within = vf_ge(s->v, vf_set(0.5f * TRC_CURVE_WITHIN));
    const vfloat front = vf_select(within, vf_set(-1.0f), one);
    const vfloat once = vf_where(within, vf_set(TRC_CURVE_WITHIN));
    const vmask came_in = vf_ge(s->v, vf_set(1.5f * TRC_CURVE_WITHIN));
    const vfloat v = s->v - vf_select(came_in, once + once, once);
    /* Across the curve and the ray, and towards the ray, across the curve. */
    const vvec3 side = v3_normalize(v3_cross(d, along));
    const vvec3 up = v3_normalize(v3_cross(side, along));
    const vfloat height = vf_sqrt(vf_max(one - v * v, zero)) * front;
    vvec3 n = v3_mad(side, v, v3_scale(up, height));
    n = v3_select(ball, ball_normal(d, s->u, v, front), n);
    n = v3_normalize(n);
    /* Ribbons are flat. */
    const vvec3 way = v3_select(ribbon, v3_scale(side, v), n);
    const vvec3 object = v3_mad(way, radius, middle);
    const vvec3 p = trc_transform_point(&m.to_world, object);
    const vvec3 reach = v3_add(v3_add(v3_abs(middle), v3_abs(v3_sub(p1, p0))), v3_splat(radius));
    const vvec3 *c = m.to_world.column;
    vvec3 error = v3_mad(v3_abs(c[0]), reach.x,
                         v3_mad(v3_abs(c[1]), reach.y, v3_scale(v3_abs(c[2]), reach.z)));
    error = v3_scale(v3_add(error, v3_add(v3_abs(p), v3_abs(m.to_world.origin))), ERROR_STEPS);
    vvec3 world = normal_to_world(&m, n);
    /* Such balls are lit as round ones where they are stretched: by where their middle is. */
    const vmask round = vf_eq(shape, vf_set(TRC_SHAPE_BALLS));
    if (vm_any(vm_and(lanes, round))) {
        const vvec3 outward = trc_transform_vector(&m.to_world, n);
        const vvec3 scaled = v3_scale(outward, vf_divide(one, v3_max(v3_abs(outward))));
        world = v3_select(round, v3_normalize(scaled), world);
    }
    world = v3_select(vf_gt(v3_dot(world, world), vf_set(0.5f)), world, s->wo);
    const vmask back = vm_and(lanes, vf_lt(v3_dot(world, s->wo), zero));
    const vvec3 facing = v3_select(back, v3_neg(world), world);
    s->p = v3_select(lanes, p, s->p);
    s->p_error = v3_select(lanes, error, s->p_error);
    s->n = v3_select(lanes, facing, s->n);
    s->ng = v3_select(lanes, facing, s->ng); /* Cycles has that of ribbons, too, where it counts */
    s->backfacing = vm_or(vm_andnot(s->backfacing, lanes), back);
    s->smooth = vm_andnot(s->smooth, lanes);
    s->bulge = v3_select(lanes, v3_zero(), s->bulge);
    s->u = vf_select(lanes, u, s->u);
    s->v = vf_select(lanes, zero, s->v);
}
