/* The surface at a hit: position with the bound of its error, normals, sides. */
#include "kernels/surface.h"

#include "kernels/mesh_fetch.h"

/* What is read from the scene, before arithmetic. */
struct raw_hit {
    struct trc_corners p, n; /* object space; n only where smooth */
    struct trc_wide_affine m;
    vmask smooth, flips;
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

/* One lane: 9 positions, 9 normals, 12 elements. Returns 1 for smooth, 2 for a mirrored
 * instance. */
static uint32_t load_lane(const struct trc_surface *s, int lane, float p[9], float n[9],
                          float m[12]) {
    const struct trc_instance *instance = &s->snapshot->instances[vi_get(s->instance, lane)];
    const struct trc_mesh *mesh = s->snapshot->meshes[instance->mesh];
    const uint32_t triangle = (uint32_t)vi_get(s->triangle, lane);
    const uint32_t *index = mesh->indices + 3 * (size_t)triangle;
    const float time = vf_get(s->time, lane);
    trc_corner_at(mesh->positions, index, mesh->vertex_count, mesh->key_count, time, p);
    trc_affine_at(instance, time, m);
    const uint32_t flips = instance->flips ? 2u : 0u;
    if (mesh->smooth ? !mesh->smooth[triangle] : !mesh->corner_normals)
        return flips;
    if (mesh->corner_normals) {
        const uint32_t corners[3] = {3 * triangle, 3 * triangle + 1, 3 * triangle + 2};
        trc_corner_at(mesh->corner_normals, corners, 3 * mesh->triangle_count, mesh->key_count,
                      time, n);
        return flips | 1u;
    }
    if (!mesh->vertex_normals)
        return flips;
    trc_corner_at(mesh->vertex_normals, index, mesh->vertex_count, mesh->key_count, time, n);
    return flips | 1u;
}

static void load_mixed(const struct trc_surface *s, struct raw_hit *out) {
    float p[TRC_WIDTH * 9], n[TRC_WIDTH * 9], m[TRC_WIDTH * 12];
    memset(p, 0, sizeof p);
    memset(n, 0, sizeof n);
    memset(m, 0, sizeof m);
    uint32_t smooth = 0, flips = 0;
    for (uint32_t lanes = vm_bits(s->active); lanes; lanes &= lanes - 1) {
        const int lane = __builtin_ctz(lanes);
        const uint32_t flags = load_lane(s, lane, p + 9 * lane, n + 9 * lane, m + 12 * lane);
        smooth |= (flags & 1u) << lane;
        flips |= (flags >> 1) << lane;
    }
    out->p = trc_corners_of(p);
    out->n = trc_corners_of(n);
    for (int k = 0; k < 3; k++)
        out->m.column[k] =
            v3(trc_column_of(m, 12, k), trc_column_of(m, 12, 4 + k), trc_column_of(m, 12, 8 + k));
    out->m.origin = v3(trc_column_of(m, 12, 3), trc_column_of(m, 12, 7), trc_column_of(m, 12, 11));
    out->smooth = vm_from_bits(smooth);
    out->flips = vm_from_bits(flips);
}

/* ---- arithmetic ---- */

/* Object position v0 + u e1 + v e2, and a bound of how far it is from the plane of the float
 * corners, in the manner of M. Pharr, W. Jakob and G. Humphreys, "Physically Based Rendering", 3.9
 * and 6.8: with e = 2^-24, gamma(n) = n e / (1 - n e).
 *
 * e1, e2 are rounded differences (1 e each); a product adds 1 e, the two sums at most 2 e to each
 * of their terms: the u and v terms carry gamma(4), v0 gamma(2). That the barycentrics are rounded
 * does not matter, any u, v give a point of the plane. The world point M p adds, per axis, gamma(3)
 * of |M||p| and gamma(1) of the translation in the sum (one product, at most three sums), and
 * carries the object bound through |M| with its own rounding, gamma(3) of it, which the last digit
 * below covers. Trees over world-space meshes are built from corners M v that were rounded
 * themselves: gamma(4) of |M||v| + |t|, and the hit is on the triangle of those; hence gamma(3) +
 * gamma(4) on the world terms. */
#define GAMMA(n) ((n)*0x1p-24f / (1.0f - (n)*0x1p-24f))

static void set_position(struct trc_surface *s, const struct raw_hit *h, vvec3 e1, vvec3 e2) {
    const vvec3 v0 = h->p.corner[0];
    const vvec3 u1 = v3_scale(e1, s->u), v2 = v3_scale(e2, s->v);
    const vvec3 p = v3_add(v3_add(v0, u1), v2);
    const vfloat g4 = vf_set(GAMMA(4)), g2 = vf_set(GAMMA(2)), g7 = vf_set(GAMMA(7) * 1.000001f);
    const vvec3 bound = v3(g2 * vf_abs(v0.x) + g4 * (vf_abs(u1.x) + vf_abs(v2.x)),
                           g2 * vf_abs(v0.y) + g4 * (vf_abs(u1.y) + vf_abs(v2.y)),
                           g2 * vf_abs(v0.z) + g4 * (vf_abs(u1.z) + vf_abs(v2.z)));
    s->p = trc_transform_point(&h->m, p);
    /* |M| (bound + g7 |p|) + g7 |t| */
    const vvec3 reach =
        v3(bound.x + g7 * vf_abs(p.x), bound.y + g7 * vf_abs(p.y), bound.z + g7 * vf_abs(p.z));
    const vvec3 *c = h->m.column;
    s->p_error = v3(vf_abs(c[0].x) * reach.x + vf_abs(c[1].x) * reach.y + vf_abs(c[2].x) * reach.z +
                        g7 * vf_abs(h->m.origin.x),
                    vf_abs(c[0].y) * reach.x + vf_abs(c[1].y) * reach.y + vf_abs(c[2].y) * reach.z +
                        g7 * vf_abs(h->m.origin.y),
                    vf_abs(c[0].z) * reach.x + vf_abs(c[1].z) * reach.y + vf_abs(c[2].z) * reach.z +
                        g7 * vf_abs(h->m.origin.z));
}

/* a over its largest component: cross products of what comes out neither overflow nor vanish. */
static vvec3 scaled_to_one(vvec3 a) {
    return v3_scale(a, vf_divide(vf_one(), v3_max(v3(vf_abs(a.x), vf_abs(a.y), vf_abs(a.z)))));
}

/* A normal goes by the inverse transpose, which is the matrix of cofactors over the determinant;
 * its columns are cross products of the columns of M. Only the sign of the determinant matters
 * here. */
static vvec3 transform_normal(const struct trc_wide_affine *m, vvec3 n) {
    vvec3 c[3];
    vfloat most = vf_zero();
    for (int k = 0; k < 3; k++)
        most = vf_max(most, v3_max(v3(vf_abs(m->column[k].x), vf_abs(m->column[k].y),
                                      vf_abs(m->column[k].z))));
    for (int k = 0; k < 3; k++)
        c[k] = v3_scale(m->column[k], vf_divide(vf_one(), most));
    return v3_mad(v3_cross(c[1], c[2]), n.x,
                  v3_mad(v3_cross(c[2], c[0]), n.y, v3_scale(v3_cross(c[0], c[1]), n.z)));
}

/* The curved surface above the triangle: along each edge a parabola whose height, weights wa and wb
 * of its ends, is wa wb (na - nb) . (pa - pb), the sum of the three along the interpolated normal.
 * Twice the height of the arc that has the normals at its ends, so that it clears its neighbours
 * (J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, 2021, has tangent planes in
 * place of parabolas). Object space. */
static vvec3 bulge_of(const struct trc_surface *s, const struct raw_hit *h, vvec3 e1, vvec3 e2,
                      vvec3 n) {
    const vvec3 *c = h->n.corner;
    const vfloat w = vf_one() - s->u - s->v;
    const vfloat k01 = v3_dot(v3_sub(c[1], c[0]), e1), k02 = v3_dot(v3_sub(c[2], c[0]), e2),
                 k12 = v3_dot(v3_sub(c[2], c[1]), v3_sub(e2, e1));
    return v3_scale(n, w * (s->u * k01 + s->v * k02) + s->u * s->v * k12);
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
        const vfloat w = vf_one() - s->u - s->v;
        vvec3 sum =
            v3_mad(h->n.corner[0], w, v3_mad(h->n.corner[1], s->u, v3_scale(h->n.corner[2], s->v)));
        const vvec3 bulge = trc_transform_vector(&h->m, bulge_of(s, h, e1, e2, sum));
        sum = v3_normalize(v3_scale(transform_normal(&h->m, sum), sign));
        s->smooth = vm_and(h->smooth, vf_gt(v3_dot(sum, sum), vf_set(0.5f)));
        n = v3_select(s->smooth, sum, ng);
        const vmask above = vf_gt(v3_dot(bulge, ng) * side, vf_zero());
        s->bulge = v3_where(vm_and(s->smooth, above), bulge);
    }
    s->ng = v3_scale(ng, side);
    s->n = v3_scale(n, side);
}

void TRC_KERNEL(trc_surface_fetch)(struct trc_surface *s) {
    if (!vm_any(s->active))
        return;
    struct raw_hit h;
    const int32_t uniform = trc_uniform_instance(s->instance, s->active);
    const struct trc_instance *instance = uniform >= 0 ? &s->snapshot->instances[uniform] : NULL;
    const struct trc_mesh *mesh = instance ? s->snapshot->meshes[instance->mesh] : NULL;
    if (mesh && trc_mesh_in_reach(mesh))
        load_uniform(s, instance, mesh, &h);
    else
        load_mixed(s, &h);
    const vvec3 e1 = v3_sub(h.p.corner[1], h.p.corner[0]);
    const vvec3 e2 = v3_sub(h.p.corner[2], h.p.corner[0]);
    set_position(s, &h, e1, e2);
    set_normals(s, &h, e1, e2);
}
