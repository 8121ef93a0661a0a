/* The surface at a hit: position with the bound of its error, normals, sides. */
#include "kernels/trace/surface.h"

#include "kernels/trace/curve_surface.h"
#include "kernels/trace/mesh_fetch.h"

/* What is read from the scene, before arithmetic. */
struct raw_hit {
    struct trc_corners p, n; /* object space; n only where smooth */
    struct trc_wide_affine m;
    vmask smooth, flips, identity, world_normals;
};

/* ---- loading ---- */

/* All lanes hit one instance: gathers from its mesh, its matrix by broadcast. */
static void load_uniform(const struct trc_surface *s, const struct trc_instance *instance,
                         const struct trc_mesh *mesh, struct raw_hit *out) {
    const vmask m = s->active;
    vint index[3];
    trc_load_indices(mesh, s->triangle, m, index);
    trc_load_vectors(mesh->positions, index, mesh->vertex_count, mesh->key_count, s->time, m,
                     &out->p);
    trc_load_affine(instance, s->time, &out->m);
    out->flips = instance->flips ? vm_all_set() : vm_none();
    out->identity = instance->is_identity ? vm_all_set() : vm_none();
    out->world_normals = instance->world_normals ? vm_all_set() : vm_none();
    out->smooth = vm_none();
    if (mesh->corner_normals) {
        const vint corner = s->triangle * vi_set(3);
        const vint corners[3] = {corner, corner + vi_set(1), corner + vi_set(2)};
        trc_load_vectors(mesh->corner_normals, corners, 3 * mesh->triangle_count, mesh->key_count,
                         s->time, m, &out->n);
    }
    if (mesh->smooth) {
        uint32_t bits = 0;
        for (uint32_t lanes = vm_bits(m); lanes; lanes &= lanes - 1) {
            const int lane = __builtin_ctz(lanes);
            bits |= (uint32_t)(mesh->smooth[vi_get(s->triangle, lane)] != 0) << lane;
        }
        out->smooth = vm_from_bits(bits);
    } else if (mesh->corner_normals) {
        out->smooth = m;
    }
    if (!mesh->corner_normals && mesh->vertex_normals && vm_any(out->smooth))
        trc_load_vectors(mesh->vertex_normals, index, mesh->vertex_count, mesh->key_count, s->time,
                         m, &out->n);
    else if (!mesh->corner_normals)
        out->smooth = vm_none();
}

/* What load_lane says of a lane. */
enum { LANE_SMOOTH = 1, LANE_FLIPS = 2, LANE_IDENTITY = 4, LANE_WORLD_NORMALS = 8 };

/* One lane: 9 positions, 9 normals, 12 elements. Returns LANE_* together. */
static uint32_t load_lane(const struct trc_surface *s, int lane, float p[9], float n[9],
                          float m[TRC_AFFINE_FLOATS]) {
    const struct trc_instance *instance = &s->snapshot->instances[vi_get(s->instance, lane)];
    const struct trc_mesh *mesh = s->snapshot->meshes[instance->mesh];
    const uint32_t triangle = (uint32_t)vi_get(s->triangle, lane);
    const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
    const float time = vf_get(s->time, lane);
    trc_corner_at(mesh->positions, index, mesh->vertex_count, mesh->key_count, time, p);
    trc_affine_at(instance, time, m);
    const uint32_t flags = (instance->flips ? LANE_FLIPS : 0u) |
                           (instance->is_identity ? LANE_IDENTITY : 0u) |
                           (instance->world_normals ? LANE_WORLD_NORMALS : 0u);
    if (mesh->smooth ? !mesh->smooth[triangle] : !mesh->corner_normals)
        return flags;
    if (mesh->corner_normals) {
        const uint32_t corners[3] = {3 * triangle, 3 * triangle + 1, 3 * triangle + 2};
        trc_corner_at(mesh->corner_normals, corners, 3 * mesh->triangle_count, mesh->key_count,
                      time, n);
        return flags | LANE_SMOOTH;
    }
    if (!mesh->vertex_normals)
        return flags;
    trc_corner_at(mesh->vertex_normals, index, mesh->vertex_count, mesh->key_count, time, n);
    return flags | LANE_SMOOTH;
}

static void load_mixed(const struct trc_surface *s, struct raw_hit *out) {
    float p[TRC_WIDTH * 9], n[TRC_WIDTH * 9], m[TRC_WIDTH * TRC_AFFINE_FLOATS];
    memset(p, 0, sizeof p);
    memset(n, 0, sizeof n);
    memset(m, 0, sizeof m);
    uint32_t smooth = 0, flips = 0, identity = 0, world_normals = 0;
    for (uint32_t lanes = vm_bits(s->active); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint32_t flags =
            load_lane(s, lane, p + 9 * lane, n + 9 * lane, m + TRC_AFFINE_FLOATS * lane);
        smooth |= (uint32_t)((flags & LANE_SMOOTH) != 0) << lane;
        flips |= (uint32_t)((flags & LANE_FLIPS) != 0) << lane;
        identity |= (uint32_t)((flags & LANE_IDENTITY) != 0) << lane;
        world_normals |= (uint32_t)((flags & LANE_WORLD_NORMALS) != 0) << lane;
    }
    out->p = trc_corners_of(p);
    out->n = trc_corners_of(n);
    for (int k = 0; k < 3; k++)
        out->m.column[k] =
            v3(trc_column_of(m, TRC_AFFINE_FLOATS, k), trc_column_of(m, TRC_AFFINE_FLOATS, 4 + k),
               trc_column_of(m, TRC_AFFINE_FLOATS, 8 + k));
    out->m.origin =
        v3(trc_column_of(m, TRC_AFFINE_FLOATS, 3), trc_column_of(m, TRC_AFFINE_FLOATS, 7),
           trc_column_of(m, TRC_AFFINE_FLOATS, 11));
    out->smooth = vm_from_bits(smooth);
    out->flips = vm_from_bits(flips);
    out->identity = vm_from_bits(identity);
    out->world_normals = vm_from_bits(world_normals);
}

/* ---- arithmetic ---- */

/* Object position v0 + (u e1 + v e2), and a bound of how far it is from the plane of the float
 * corners, by the magnitudes of what is rounded (M. Pharr, W. Jakob and G. Humphreys, "Physically
 * Based Rendering", 3.9 and 6.8, bound each step by those of the corners). In half-ulps, e = 2^-24:
 * each edge 1 of itself and its product 1, their sum 1 of itself, the position 1 of itself. That
 * the barycentrics are rounded does not matter, any u, v give a point of the plane.
 *
 * An identity adds nothing. The world point M p + t adds 3 of q = |M| |p|, for one product and the
 * first two sums, and 1 of itself. A ray that starts there is off by 5 q once it is taken to object
 * space (object_rays.h); or the tree is in world space, and its corners M v + t are off by at most
 * 4 |M| |v| + |t|. With Q = |M| (|v0| + u |e1| + v |e2|), not less than q or the weighted mean of
 * |M| |v|, both are within 5 Q + |t|: 8 Q, 1 of the world point, 1 of t in all. */
#define ERROR_STEPS(n) vf_set((n)*0x1.0001p-24f) /* a last digit for what is of higher order */

/* What rounding adds on the way from object to world and back. */
static vvec3 transform_error(const struct trc_wide_affine *m, vvec3 object_error, vvec3 reach,
                             vvec3 p) {
    const vvec3 all = v3_add(object_error, v3_scale(reach, ERROR_STEPS(8)));
    const vvec3 *c = m->column;
    const vvec3 rest = v3_scale(v3_add(v3_abs(p), v3_abs(m->origin)), ERROR_STEPS(1));
    return v3_mad(v3_abs(c[0]), all.x,
                  v3_mad(v3_abs(c[1]), all.y, v3_mad(v3_abs(c[2]), all.z, rest)));
}

static void set_position(struct trc_surface *s, const struct raw_hit *h, vvec3 e1, vvec3 e2) {
    const vvec3 v0 = h->p.corner[0];
    const vvec3 u1 = v3_scale(e1, s->u), v2 = v3_scale(e2, s->v), way = v3_add(u1, v2);
    const vvec3 p = v3_add(v0, way);
    const vvec3 edges = v3_add(v3_abs(u1), v3_abs(v2));
    const vvec3 error = v3_add(v3_scale(edges, ERROR_STEPS(2)),
                               v3_scale(v3_add(v3_abs(way), v3_abs(p)), ERROR_STEPS(1)));
    s->p = p;
    s->p_error = error;
    if (!vm_any(vm_andnot(s->active, h->identity)))
        return;
    const vvec3 reach = v3_add(v3_abs(v0), edges);
    s->p = v3_select(h->identity, p, trc_transform_point(&h->m, p));
    s->p_error = v3_select(h->identity, error, transform_error(&h->m, error, reach, s->p));
}

/* a over its largest component: cross products of what comes out neither overflow nor vanish. */
static vvec3 scaled_to_one(vvec3 a) { return v3_scale(a, vf_divide(vf_one(), v3_max(v3_abs(a)))); }

/* A normal goes by the inverse transpose, which is the matrix of cofactors over the determinant;
 * its columns are cross products of the columns of M. Only the sign of the determinant matters
 * here. */
static vvec3 transform_normal(const struct trc_wide_affine *m, vvec3 n) {
    vvec3 c[3];
    vfloat maximum = vf_zero();
    for (int k = 0; k < 3; k++)
        maximum = vf_max(maximum, v3_max(v3_abs(m->column[k])));
    for (int k = 0; k < 3; k++)
        c[k] = v3_scale(m->column[k], vf_divide(vf_one(), maximum));
    return v3_mad(v3_cross(c[1], c[2]), n.x,
                  v3_mad(v3_cross(c[2], c[0]), n.y, v3_scale(v3_cross(c[0], c[1]), n.z)));
}

/* The sum of the corners' normals, each made unit in world space. */
static vvec3 sum_in_world(const struct trc_surface *s, const struct raw_hit *h) {
    const vfloat weight[3] = {vf_one() - s->u - s->v, s->u, s->v};
    vvec3 sum = v3_zero();
    for (int k = 0; k < 3; k++) {
        const vvec3 n = h->n.corner[k], world = transform_normal(&h->m, n);
        sum = v3_mad(n, vf_divide(weight[k], vf_sqrt(v3_dot(world, world))), sum);
    }
    return sum;
}

/* The height of a point below the plane through a corner that is normal to its normal, at least 0;
 * where the surface is hollow there, below the higher of the two neighbours. da and db are how high
 * they lie above the plane, wa and wb the point's weights of them. */
TRC_INLINE vfloat height_below(vfloat da, vfloat db, vfloat wa, vfloat wb) {
    const vfloat zero = vf_zero(), top = vf_max(vf_max(da, db), zero);
    return vf_max(top - (wa * da + wb * db), zero);
}

/* How high the curved surface that the normals describe lies above the triangle, in lengths of n,
 * as in Cycles: as high as the lowest of the planes at the corners (J. Hanika, "Hacking the Shadow
 * Terminator", Ray Tracing Gems II, 2021), but at least as half of the sum of the parabolas along
 * the edges, whose heights are wa wb (na - nb) . (pa - pb). Object space; e1 and e2 change their
 * sign with the side. */
static vfloat bulge_of(const struct trc_surface *s, const struct raw_hit *h, vvec3 e1, vvec3 e2) {
    const vvec3 *c = h->n.corner;
    const vvec3 e3 = v3_sub(e2, e1);
    const vfloat u = s->u, v = s->v, w = vf_one() - u - v, zero = vf_zero();
    const vfloat d01 = v3_dot(e1, c[0]), d02 = v3_dot(e2, c[0]);
    const vfloat d10 = zero - v3_dot(e1, c[1]), d12 = v3_dot(e3, c[1]);
    const vfloat d20 = zero - v3_dot(e2, c[2]), d21 = zero - v3_dot(e3, c[2]);
    const vfloat planes = vf_min(vf_min(height_below(d01, d02, u, v), height_below(d10, d12, w, v)),
                                 height_below(d20, d21, w, u));
    const vfloat arcs = w * (u * (d01 + d10) + v * (d02 + d20)) + u * v * (d12 + d21);
    return vf_max(planes, vf_set(-0.5f) * arcs);
}

/* Between the normals of the corners, not unit, object space. */
TRC_INLINE vvec3 normals_between(const struct trc_surface *s, const struct raw_hit *h) {
    const vfloat w = vf_one() - s->u - s->v;
    return v3_mad(h->n.corner[0], w, v3_mad(h->n.corner[1], s->u, v3_scale(h->n.corner[2], s->v)));
}

/* From p to the curved surface on the side that ng faces. */
TRC_INLINE vvec3 bulge_towards(const struct trc_surface *s, const struct raw_hit *h, vvec3 e1,
                               vvec3 e2, vvec3 ng) {
    const vvec3 axis = trc_transform_vector(&h->m, normals_between(s, h));
    const vfloat turn = vf_select(vf_lt(v3_dot(axis, ng), vf_zero()), vf_set(-1.0f), vf_one());
    return v3_scale(axis, bulge_of(s, h, v3_scale(e1, turn), v3_scale(e2, turn)) * turn);
}

/* The unit normal between those of the corners, on the front, and where it is one. */
static vvec3 smooth_normal(const struct trc_surface *s, const struct raw_hit *h, vmask *is_smooth) {
    const vfloat sign = vf_select(h->flips, vf_set(-1.0f), vf_one());
    vvec3 sum = normals_between(s, h);
    if (vm_any(vm_and(h->world_normals, s->active)))
        sum = v3_select(h->world_normals, sum_in_world(s, h), sum);
    const vvec3 n = v3_normalize(v3_scale(transform_normal(&h->m, sum), sign));
    *is_smooth = vm_and(h->smooth, vf_gt(v3_dot(n, n), vf_set(0.5f)));
    return n;
}

static void set_normals(struct trc_surface *s, const struct raw_hit *h, vvec3 e1, vvec3 e2) {
    /* The winding as the object has it: a mirroring matrix turns the world cross product over. */
    const vvec3 w1 = scaled_to_one(trc_transform_vector(&h->m, e1));
    const vvec3 w2 = scaled_to_one(trc_transform_vector(&h->m, e2));
    const vfloat sign = vf_select(h->flips, vf_set(-1.0f), vf_one());
    vvec3 ng = v3_normalize(v3_cross(w1, w2));
    /* A sliver whose cross product vanished gets any unit vector. */
    const vmask flat = vf_eq(v3_dot(ng, ng), vf_zero());
    if (vm_any(vm_and(flat, s->active)))
        ng = v3_select(flat, s->wo, ng);
    ng = v3_scale(ng, sign);
    vvec3 n = ng;
    s->smooth = vm_none();
    s->bulge = v3_zero();
    s->backfacing = vf_lt(v3_dot(ng, s->wo), vf_zero());
    const vfloat side = vf_select(s->backfacing, vf_set(-1.0f), vf_one());
    if (vm_any(h->smooth)) {
        const vvec3 bulge = bulge_towards(s, h, e1, e2, v3_scale(ng, side));
        const vvec3 smooth = smooth_normal(s, h, &s->smooth);
        n = v3_select(s->smooth, smooth, ng);
        s->bulge = v3_where(s->smooth, bulge);
    }
    s->ng = v3_scale(ng, side);
    s->n = v3_scale(n, side);
}

static void raw_load(const struct trc_surface *s, struct raw_hit *out) {
    const int32_t uniform = trc_uniform_instance(s->instance, s->active);
    const struct trc_instance *instance = uniform >= 0 ? &s->snapshot->instances[uniform] : NULL;
    const struct trc_mesh *mesh = instance ? s->snapshot->meshes[instance->mesh] : NULL;
    if (mesh && trc_mesh_in_reach(mesh))
        load_uniform(s, instance, mesh, out);
    else
        load_mixed(s, out);
}

TRC_INLINE vvec3 side_to(const struct raw_hit *h, int corner) {
    return v3_sub(h->p.corner[corner], h->p.corner[0]);
}

void trc_triangle_fetch(struct trc_surface *s) {
    if (!vm_any(s->active))
        return;
    struct raw_hit h;
    raw_load(s, &h);
    const vvec3 e1 = side_to(&h, 1), e2 = side_to(&h, 2);
    set_position(s, &h, e1, e2);
    set_normals(s, &h, e1, e2);
}

vvec3 trc_bulge_behind(const struct trc_surface *s, vmask lanes) {
    struct trc_surface part = *s;
    struct raw_hit h;
    part.active = lanes;
    raw_load(&part, &h);
    return bulge_towards(s, &h, side_to(&h, 1), side_to(&h, 2), v3_neg(s->ng));
}

vvec3 trc_normal_between(const struct trc_surface *s, vmask lanes) {
    struct trc_surface part = *s;
    struct raw_hit h;
    vmask is_smooth;
    part.active = lanes;
    raw_load(&part, &h);
    const vvec3 n = smooth_normal(&part, &h, &is_smooth);
    return v3_select(is_smooth, v3_select(s->backfacing, v3_neg(n), n), s->n);
}

void trc_surface_sides(const struct trc_surface *s, vvec3 *first, vvec3 *second) {
    const vmask curves =
        s->snapshot->features & TRC_FEATURE_CURVES ? trc_curve_lanes(s) : vm_none();
    float corners[TRC_WIDTH][9] = {{0}};
    for (uint32_t lanes = vm_bits(vm_andnot(s->active, curves)); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        trc_world_corners_at(s->snapshot, (uint32_t)vi_get(s->instance, lane),
                             (uint32_t)vi_get(s->triangle, lane), vf_get(s->time, lane),
                             corners[lane]);
    }
    const struct trc_corners c = trc_corners_of(corners[0]);
    vvec3 sides[2] = {v3_sub(c.corner[1], c.corner[0]), v3_sub(c.corner[2], c.corner[0])};
    if (vm_any(curves)) {
        const vvec3 along = trc_curve_along(s, curves);
        for (int k = 0; k < 2; k++)
            sides[k] = v3_select(curves, along, sides[k]);
    }
    *first = v3_select(s->backfacing, v3_neg(sides[0]), sides[0]);
    *second = v3_select(s->backfacing, v3_neg(sides[1]), sides[1]);
}

void trc_mixed_fetch(struct trc_surface *s) {
    const vmask active = s->active, curves = trc_curve_lanes(s);
    s->active = vm_andnot(active, curves);
    s->strand = vi_set(-1);
    if (vm_any(s->active)) {
        trc_triangle_fetch(s);
    } else {
        s->p = s->p_error = s->ng = s->n = s->bulge = v3_zero();
        s->backfacing = s->smooth = vm_none();
    }
    s->active = active;
    if (vm_any(curves))
        trc_curve_fetch(s, curves);
}
